"""Histories and contact intervals of the page of `view`."""

import unittest

import numpy as np
from sprag.view.history import History, Intervals, Window


def rows_of(history, window, keep="both", column=0):
    return history.thinned(window, [column], [keep])


class HistoryTest(unittest.TestCase):
    def test_every_pixel_keeps_minimum_and_maximum_of_any_age(self):
        for batch, rows in ((1, 10_000), (5000, 300_000)):
            t = 0.001 * np.arange(rows)
            y = np.random.default_rng(11).normal(size=rows).astype(np.float32)
            history = History(2)
            for i in range(0, len(t), batch):
                part = y[i : i + batch]
                history.add(t[i : i + batch], np.column_stack([0.0 * part, part]))
            pixels = 200
            for low, high in ((0.0, 300.0), (17.0, 203.0), (299.5, 299.9), (290.0, 400.0)):
                if low > t[-1]:
                    continue
                with self.subTest(batch=batch, low=low):
                    kept, values = rows_of(history, Window(low, high, pixels), column=1)
                    self.assertTrue(np.all(np.diff(kept) >= 0.0))
                    self.assertLessEqual(len(kept), 2 * (pixels + 2))
                    inside = y[(t >= low) & (t <= high)]
                    # The rows next to the window on both sides may be outside.
                    self.assertLessEqual(values.min(), inside.min())
                    self.assertGreaterEqual(values.max(), inside.max())
                    self.assertLessEqual(kept[0], low + 0.2)
                    self.assertGreaterEqual(kept[-1], min(high, t[-1]) - 0.002)

    def test_few_rows_are_unchanged(self):
        history = History(1)
        y = np.array([3.0, -1.0, 7.0, 2.0])
        history.add(np.arange(4.0), y[:, None])
        t, values = rows_of(history, Window(0.0, 3.0, 1000))
        self.assertEqual(t.tolist(), [0.0, 1.0, 2.0, 3.0])
        self.assertEqual(values.tolist(), y.tolist())
        self.assertEqual(history.at(2.0).tolist(), [7.0])
        self.assertIsNone(history.at(2.5))

    def test_a_band_keeps_its_outline_and_gaps_are_not_a_number(self):
        history = History(2)
        i = np.arange(1000)
        low, high = np.where(i >= 500, [-1.0 - i % 7, 1.0 + i % 5], np.inf)
        history.add(i.astype(float), np.column_stack([low, high]))
        _, low, high = history.thinned(Window(0.0, 999.0, 10), [0, 1], ["least", "greatest"])
        self.assertTrue(np.isnan(low[0]))
        self.assertEqual(low[-2], -7.0)
        self.assertEqual(high[-2], 5.0)

    def test_memory_is_constant_and_covers_the_whole_run(self):
        # Half a week of ticks at 10 Hz.
        history = History(1)
        n = 3_000_000
        for i in range(0, n, 500):
            y = np.zeros((500, 1))
            if i == 1000:
                y[234] = 5.0
            history.add(0.1 * np.arange(i, i + 500), y)
        self.assertEqual(history.first_t(), 0.0)
        t, values = rows_of(history, Window(0.0, 0.1 * n, 800))
        self.assertLessEqual(len(t), 1700)
        self.assertEqual(values.max(), 5.0, "a single peak")
        size = sum(level.times.nbytes + level.values.nbytes for level in history.levels)
        self.assertLess(size, 25 << 20)


class IntervalsTest(unittest.TestCase):
    def test_intervals_within_one_pixel_are_merged(self):
        first, second = Intervals(), Intervals()
        for t in (1.0, 1.01, 5.0):
            first.add(t, 3)
        for t, kind in ((2.0, 1), (6.0, 2), (7.0, 1)):
            second.add(t, kind)
        coarse = Window(0.0, 10.0, 100)
        self.assertEqual(first.thinned(coarse), [1.0, 1.01, 5.0, 5.0])
        self.assertEqual(second.thinned(coarse), [2.0, 6.0, 7.0, np.inf], "still closed")
        self.assertEqual(len(first.thinned(Window(0.9, 1.1, 100))), 4)
        self.assertEqual(second.thinned(Window(3.0, 4.0, 100)), [2.0, 6.0], "all the while")
        self.assertTrue(second.closed)
        self.assertEqual(first.events, 3)
        small = Intervals(10)
        for t in range(1000):
            small.add(float(t), 3)
        self.assertEqual(len(small.thinned(Window(0.0, 2000.0, 100_000))), 20)
        self.assertEqual(small.events, 1000)
