"""Time series and contact intervals for plots of any window, in bounded memory."""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

Numbers = npt.NDArray[np.float64]
Keep = Literal["both", "least", "greatest"]  # extremes of a column that a pixel keeps

LEVELS = 12  # at 1 kHz the last one reaches back a year
RATIO = 4
MEMORY = 24 << 20  # bytes of a history


@dataclass(frozen=True)
class Window:
    start: float
    end: float
    pixels: int

    @property
    def pixel(self) -> float:
        return (self.end - self.start) / self.pixels


class _Level:
    """The last buckets of RATIO**level rows: first and last time, least and greatest value."""

    def __init__(self, columns: int, capacity: int) -> None:
        self.capacity = capacity
        self.times = np.empty((2 * capacity, 2))
        self.values = np.empty((2 * capacity, 2, columns), np.float32)
        self.begin = self.end = 0
        self.open = 0  # the last buckets that the next level lacks

    def append(self, times: Numbers, values: npt.NDArray[np.float32]) -> None:
        if self.end + len(times) > len(self.times):
            kept = slice(max(self.begin, self.end - self.capacity + len(times)), self.end)
            self.end = kept.stop - kept.start
            self.begin = 0
            self.times[: self.end] = self.times[kept].copy()
            self.values[: self.end] = self.values[kept].copy()
        self.times[self.end : self.end + len(times)] = times
        self.values[self.end : self.end + len(times)] = values
        self.end += len(times)
        self.begin = max(self.begin, self.end - self.capacity)
        self.open += len(times)

    def __len__(self) -> int:
        return self.end - self.begin

    def first_t(self) -> float:
        return float(self.times[self.begin, 0])


class History:
    """Rows of `columns` values with rising times; of old rows the extremes over 4, 16, ..."""

    def __init__(self, columns: int) -> None:
        capacity = min(max(MEMORY // (2 * LEVELS * (16 + 8 * columns)), 512), 8192)
        self.levels = [_Level(columns, capacity) for _ in range(LEVELS)]
        self.last_t = -math.inf

    def first_t(self) -> float:
        return min((level.first_t() for level in self.levels if len(level)), default=math.inf)

    def at(self, t: float) -> npt.NDArray[np.float32] | None:
        """The row at t; None if it is not among the last ones."""
        level = self.levels[0]
        at = level.begin + int(np.searchsorted(level.times[level.begin : level.end, 0], t))
        found = at < level.end and level.times[at, 0] == t
        return level.values[at, 0] if found else None

    def add(self, t: Numbers, values: npt.ArrayLike) -> None:
        """Rows t, shape (n,), and values, shape (n, columns). The times rise, also over calls."""
        if not len(t):
            return
        with np.errstate(over="ignore"):
            rows = np.asarray(values).astype(np.float32)
        rows[~np.isfinite(rows)] = np.nan
        self.last_t = float(t[-1])
        for i in range(0, len(t), 512):
            part = rows[i : i + 512]
            times = np.column_stack([t[i : i + 512]] * 2)
            self._push(0, times, np.stack([part, part], axis=1))

    def _push(self, to: int, times: Numbers, values: npt.NDArray[np.float32]) -> None:
        level = self.levels[to]
        level.append(times, values)
        full = level.open // RATIO
        if not full or to + 1 == LEVELS:
            return
        part = slice(level.end - level.open, level.end - level.open + RATIO * full)
        level.open -= RATIO * full
        blocks = level.values[part].reshape(full, RATIO, 2, -1)
        least, greatest = np.fmin.reduce(blocks[:, :, 0], 1), np.fmax.reduce(blocks[:, :, 1], 1)
        ends = level.times[part].reshape(full, RATIO, 2)
        times = np.column_stack([ends[:, 0, 0], ends[:, -1, 1]])
        self._push(to + 1, times, np.stack([least, greatest], axis=1))

    def thinned(self, window: Window, columns: list[int], keep: list[Keep]) -> tuple[Numbers, ...]:
        """Times and a column of values each from `start` to `end`, and a row on either side.

        Where several rows share a pixel: two rows with the least and the greatest value, or one of
        the two twice.
        """
        if self.last_t == -math.inf or not window.start < window.end:
            return tuple(np.empty(0) for _ in range(len(columns) + 1))
        times, values = self._buckets(window, columns)
        pixel = np.clip(np.floor((times[:, 0] - window.start) / window.pixel), -1, window.pixels)
        begin = np.flatnonzero(np.diff(pixel, prepend=-2))
        end = np.append(begin[1:], len(pixel)) - 1
        same = np.repeat(np.arange(len(begin)), end + 1 - begin)
        one = (begin == end) & (times[begin, 0] == times[end, 1])
        shown = np.column_stack([np.ones_like(one), ~one]).ravel()
        result = [np.column_stack([times[begin, 0], times[end, 1]]).ravel()[shown]]
        order = np.arange(len(pixel))
        for column, kept in enumerate(keep):
            low, high = values[:, 0, column], values[:, 1, column]
            least, greatest = np.fmin.reduceat(low, begin), np.fmax.reduceat(high, begin)
            before, after = least, greatest
            if kept == "both":
                at_least = np.minimum.reduceat(
                    np.where(low == least[same], order, order[-1]), begin
                )
                at_most = np.minimum.reduceat(
                    np.where(high == greatest[same], order, order[-1]), begin
                )
                falls = at_most < at_least
                before, after = np.where(falls, greatest, least), np.where(falls, least, greatest)
            elif kept == "least":
                after = least
            else:
                before = greatest
            result.append(np.column_stack([before, after]).ravel()[shown])
        return tuple(result)

    def _buckets(
        self, window: Window, columns: list[int]
    ) -> tuple[Numbers, npt.NDArray[np.float32]]:
        """Buckets that cover the window: coarse ones first, what they lack from finer levels."""
        used = [level for level in self.levels if len(level)]
        first = 0
        while first + 1 < len(used):
            level, coarser = used[first], used[first + 1]
            span = level.times[level.end - 1, 0] - level.first_t()
            bucket = span / max(len(level) - 1, 1)
            reaches = level.first_t() <= max(window.start, coarser.first_t())
            if reaches and not RATIO * bucket < window.pixel / 2:
                break
            if coarser.first_t() > max(window.start, level.first_t()):
                break
            first += 1
        times, values, done = [], [], -math.inf
        for level in reversed(used[: first + 1]):
            stored = level.times[level.begin : level.end]
            low = int(np.searchsorted(stored[:, 1], max(done, window.start), "right"))
            if low > 0 and stored[low - 1, 1] > done:
                low -= 1
            high = int(np.searchsorted(stored[:, 0], window.end, "right")) + 1
            part = slice(level.begin + low, min(level.begin + high, level.end))
            if part.start < part.stop:
                times.append(level.times[part])
                values.append(level.values[part][:, :, columns])
                done = float(level.times[part.stop - 1, 1])
            if done > window.end:
                break
        return np.concatenate(times), np.concatenate(values)


class Intervals:
    """Closed intervals of a contact: [from, to], `to` is infinite while it is closed."""

    def __init__(self, most: int = 1 << 16) -> None:
        self.most = most
        self.intervals: list[list[float]] = []
        self.events = 0
        self.last: float | None = None  # time of the last event

    @property
    def closed(self) -> bool:
        return bool(self.intervals) and self.intervals[-1][1] == math.inf

    def add(self, t: float, kind: int) -> None:
        """An event, in order of time: 1 closes, 2 opens, 3 closes and opens."""
        self.events += 1
        self.last = t
        if self.closed:
            self.intervals[-1][1] = t
        if kind != 2:
            self.intervals.append([t, math.inf if kind == 1 else t])
            del self.intervals[: -self.most]

    def correct(self, closed: bool, t: float) -> None:
        """Sets the state at t after missed events."""
        if closed and not self.closed:
            self.intervals.append([t, math.inf])
        elif self.closed and not closed:
            self.intervals[-1][1] = t

    def thinned(self, window: Window) -> list[float]:
        """From and to in turn of the intervals in the window; those within a pixel are merged."""
        found: list[float] = []
        start = bisect_left(self.intervals, window.start, key=lambda interval: interval[1])
        for low, high in self.intervals[start:]:
            if low > window.end:
                break
            if found and low - found[-1] < window.pixel:
                found[-1] = high
            else:
                found += [low, high]
        return found
