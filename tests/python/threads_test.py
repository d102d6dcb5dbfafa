"""Other threads run while the library computes, and may share an observer."""

import sys
import threading
import time
import unittest
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import sprag

from support import scene


def switches_during(call) -> int:
    """How often another thread ran in the meantime."""
    counted, done = 0, threading.Event()

    def count():
        nonlocal counted
        while not done.wait(1e-3):
            counted += 1

    # A thread that does not release the interpreter keeps it for that long.
    interval = sys.getswitchinterval()
    sys.setswitchinterval(100.0)
    thread = threading.Thread(target=count)
    try:
        thread.start()
        started = time.monotonic()
        counted = 0
        call()
        during = counted
        if time.monotonic() - started < 0.05:
            raise AssertionError("too short to decide")
    finally:
        done.set()
        sys.setswitchinterval(interval)
        thread.join()
    return during


class ThreadsTest(unittest.TestCase):
    def test_long_calls_let_other_threads_run(self):
        beam = scene()
        run = sprag.simulate(beam, 400.0, tick=1e-3)
        observer = sprag.Observer(beam, tick=1e-3)
        observer.set_horizon(30.0)
        ahead = sprag.Observer(beam, tick=1e-4)
        estimate = np.repeat(run.q, 2, axis=0)
        calls = {
            "simulate": lambda: sprag.simulate(beam, 500.0, tick=1e-3),
            "observe": lambda: sprag.observe(beam, run.events, 60.0, tick=1e-3),
            "settle": observer.settle,
            "at": lambda: ahead.at(500.0),
            "energies": lambda: sprag.energies(beam, estimate, estimate, estimate, estimate),
        }
        for name, call in calls.items():
            with self.subTest(name):
                self.assertGreater(switches_during(call), 3)

    def test_runs_in_many_threads_are_the_same(self):
        beam = scene()
        events = sprag.simulate(beam, 50.0).events
        expected = sprag.observe(beam, events, 50.0).q
        with ThreadPoolExecutor(4) as pool:
            for result in pool.map(lambda _: sprag.observe(beam, events, 50.0), range(8)):
                np.testing.assert_array_equal(result.q, expected)

    def test_threads_may_share_an_observer(self):
        beam = scene()
        events = sprag.simulate(beam, 20.0).events
        observer = sprag.Observer(beam)

        def take(event):
            observer.take(*event)
            observer.at(20.0)

        with ThreadPoolExecutor(4) as pool:
            list(pool.map(take, events.tolist()))
        observer.set_horizon(20.0)
        settled = [estimate.q for estimate in observer.settle()]
        np.testing.assert_array_equal(settled, sprag.observe(beam, events, 20.0).q)
