"""Errors raise exceptions: Sprag's own with their place, ValueError for wrong arguments."""

import os
import pickle
import signal
import threading
import time
import unittest

import numpy as np
import sprag

from support import scene


class ErrorsTest(unittest.TestCase):
    def test_scene_errors_name_file_line_and_column(self):
        with self.assertRaises(sprag.SceneError) as raised:
            sprag.parse_scene("\nname = 1", "x.toml")
        error = raised.exception
        self.assertEqual((error.file, error.line, error.column), ("x.toml", 2, 8))
        self.assertEqual(str(error), f"x.toml:2:8: {error.message}")
        self.assertIn("must be a string", error.message)
        self.assertIsInstance(error, sprag.Error)
        copied = pickle.loads(pickle.dumps(error))
        self.assertEqual((str(copied), copied.line), (str(error), 2))

    def test_a_scene_that_is_not_there_has_no_line(self):
        for name, message in (
            ("/nowhere/x.toml", "cannot be read: No such file or directory"),
            ("paper_baem", "did you mean paper_beam?"),
        ):
            with self.assertRaises(sprag.SceneError) as raised:
                sprag.read_scene(name)
            error = raised.exception
            self.assertEqual((error.file, error.line, error.column), (name, None, None))
            self.assertIn(message, error.message)

    def test_simulation_error(self):
        # Three supports under a rigid plate, whose forces are not unique.
        plate = sprag.Model(
            np.diag([1.0, 0.5]),
            np.zeros((2, 2)),
            np.zeros((2, 2)),
            [sprag.Contact([1.0, x], restitution=0.0) for x in (-1.0, 0.2, 1.0)],
            [sprag.Force([-1.0, 0.0], constant=1.0)],
        )
        with self.assertRaises(sprag.SimulationError) as raised:
            sprag.simulate(sprag.Scene(plate, master=sprag.State(q=[1.0])), 5.0)
        self.assertIsInstance(raised.exception, sprag.Error)
        self.assertRegex(str(raised.exception), r"^t = 1\.41")

    def test_machine_without_exact_flow(self):
        # A double pair of eigenvalues: (s^2 + s/2 + 1)^2.
        defective = sprag.Model(
            np.eye(2),
            np.diag([1.0, 0.0]),
            [[1.25, -0.5], [-0.5, 1.0]],
            [sprag.Contact([1.0, 0.0], 0.5)],
        )
        for call in (sprag.Observer, lambda of: sprag.simulate(of, 1.0)):
            with self.assertRaises(sprag.ModelError) as raised:
                call(sprag.Scene(defective))
            self.assertIsInstance(raised.exception, sprag.Error)
            self.assertIn("defective mode", str(raised.exception))

    def test_wrong_arguments(self):
        beam = scene()
        events = sprag.simulate(beam, 2.0).events
        state = np.zeros((2, 3))
        wrong = {
            "duration": lambda: sprag.simulate(beam, -1.0),
            "duration of observe": lambda: sprag.observe(beam, events, float("nan")),
            "tick": lambda: sprag.simulate(beam, 1.0, tick=-1.0),
            "tick of observe": lambda: sprag.observe(beam, events, 1.0, tick=0.0),
            "estimator": lambda: sprag.observe(beam, events, 1.0, estimator="none"),
            "contact": lambda: sprag.observe(beam, [(1.0, 2, 3)], 1.0),
            "contact from 0": lambda: sprag.observe(beam, [(1.0, 0, 3)], 1.0),
            "kind": lambda: sprag.observe(beam, [(1.0, 1, 4)], 1.0),
            "time": lambda: sprag.observe(beam, [(float("nan"), 1, 3)], 1.0),
            "an array of times": lambda: sprag.observe(beam, np.array([1.0, 1.5]), 2.0),
            "times alone": lambda: sprag.observe(beam, [1.0, 1.5], 2.0),
            "other fields": lambda: sprag.observe(
                beam, np.zeros(1, dtype=[("t", "f8"), ("on", "i4"), ("off", "i1")]), 2.0
            ),
            "two dimensions": lambda: sprag.observe(beam, events[None, :], 2.0),
            "too many columns": lambda: sprag.energies(beam, state, state, np.zeros((2, 4)), state),
            "too few columns": lambda: sprag.energies(beam, state[:, :2], state, state, state),
            "rows": lambda: sprag.energies(beam, state, state, state[:1], state),
            "dimensions": lambda: sprag.energies(beam, state[None], state, state, state),
            "take": lambda: sprag.Observer(beam).take(1.0, 2),
            "at": lambda: sprag.Observer(beam).at(-1.0),
        }
        for name, call in wrong.items():
            with self.subTest(name), self.assertRaises(ValueError):
                call()
        with self.assertRaises(TypeError):
            sprag.simulate(beam)
        with self.assertRaises(ValueError) as raised:
            sprag.observe(beam, [(1.0, 1, 3), (2.0, 7, 3)], 1.0)
        self.assertEqual(str(raised.exception), "events[1]: contact is 7; must be from 1 to 1")

    def test_out_of_memory(self):
        with self.assertRaises(MemoryError):
            sprag.simulate(scene(), 1e9, tick=1e-9)

    def interrupted(self, call, after):
        timer = threading.Timer(after, os.kill, (os.getpid(), signal.SIGINT))
        timer.start()
        with self.assertRaises(KeyboardInterrupt):
            call()
            time.sleep(60.0)  # if the call has ended first
        timer.join()

    def test_ctrl_c_ends_a_call(self):
        observer = sprag.Observer(scene("stiff_beam"), tick=1e-2)
        observer.set_horizon(1e8)
        # The calls would take hours.
        for call in (
            lambda: sprag.simulate(scene(), 1e10, tick=0.0),
            lambda: sprag.observe(scene("stiff_beam"), [], 1e5, tick=1e-2),
            observer.settle,
            lambda: observer.at(2e8),
        ):
            handler = signal.getsignal(signal.SIGINT)
            self.interrupted(call, 0.3)
            self.assertIs(signal.getsignal(signal.SIGINT), handler)
        # The next call is not interrupted.
        self.assertEqual(len(sprag.simulate(scene(), 1.0).t), 101)

    def test_ctrl_c_loses_no_tick(self):
        observer = sprag.Observer(scene("stiff_beam"), tick=1e-2)
        observer.set_horizon(500.0)
        self.interrupted(observer.settle, 0.05)
        ticks = [estimate.tick for estimate in observer.settle()]
        self.assertEqual(ticks, list(range(50_001)))
