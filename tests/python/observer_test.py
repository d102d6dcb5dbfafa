"""observe() and Observer give the program's results, to the last bit; energies() is V."""

import os
import subprocess
import tempfile
import unittest
from pathlib import Path

import numpy as np
import sprag

from support import SOURCE, scene, write_events


def replayed(name: str, events, duration: float, tick: float, options: list[str]):
    """The states CSV of observer --replay, by column."""
    with tempfile.TemporaryDirectory() as folder:
        recorded, states = Path(folder) / "events.csv", Path(folder) / "states.csv"
        write_events(recorded, events)
        subprocess.run(
            [
                os.environ["OBSERVER"],
                str(SOURCE / "scenes" / f"{name}.toml"),
                *["--replay", str(recorded), "--states", str(states)],
                *["--duration", repr(duration), "--tick", repr(tick), *options],
            ],
            check=True,
            capture_output=True,
        )
        names = states.read_text().partition("\n")[0].split(",")
        return dict(zip(names, np.loadtxt(states, delimiter=",", skiprows=1, unpack=True)))


class ObserverTest(unittest.TestCase):
    def test_observe_equals_the_program(self):
        cases = [
            ("paper_beam_chatter", "both"),
            ("two_stops_beam", "timing"),
            ("paper_beam", "replica"),
            ("paper_beam", "adaptive"),
        ]
        duration, tick = 20.0, 1e-2
        for name, estimator in cases:
            with self.subTest(scene=name, estimator=estimator):
                of = scene(name)
                events = sprag.simulate(of, duration, tick=0.0).events
                ours = sprag.observe(of, events, duration, tick=tick, estimator=estimator)
                theirs = replayed(name, events, duration, tick, ["--estimator", estimator])
                self.assertEqual(ours.skipped, 0)
                self.assertGreaterEqual(ours.taken, len(events))
                found = sprag.tables.columns(ours, of)
                filtered = estimator != "replica"
                of_filter = {"sigma_q1", "sigma_u1", "sigma_g1"} if filtered else set()
                self.assertLessEqual({"t", "q1", "u1", *of_filter}, set(found))
                self.assertEqual(estimator == "timing", "B" not in theirs)
                for column, values in found.items():
                    if column in theirs or column in ("t", "q1", "u1", *of_filter):
                        np.testing.assert_array_equal(values, theirs[column], column)

    def test_stepwise_observer_equals_observe(self):
        beam = scene()
        events = sprag.simulate(beam, 10.0).events
        at_once = sprag.observe(beam, events, 10.0)
        observer = sprag.Observer(beam)
        settled = []
        for start in range(10):
            of_second = events[(events["t"] > start) & (events["t"] <= start + 1)]
            for t, contact, kind in of_second[::-1].tolist():
                self.assertTrue(observer.take(t, contact, kind))
            observer.at(start + 0.5)
            observer.set_horizon(start + 1)
            settled += observer.settle()
        self.assertEqual([e.tick for e in settled], list(range(1001)))
        self.assertTrue(all(e.settled for e in settled))
        np.testing.assert_array_equal([e.q for e in settled], at_once.q)
        np.testing.assert_array_equal([e.sigma_u for e in settled], at_once.sigma_u)
        np.testing.assert_array_equal([e.bound for e in settled], at_once.bound)
        self.assertEqual(observer.taken, len(events))

    def test_adaptive_observer_reports_parameters(self):
        beam = scene()
        events = sprag.simulate(beam, 20.0, tick=0.0).events
        everything = sprag.observe(beam, events, 20.0, tick=0.02, estimator="adaptive")
        of = everything.keys.index("impact.restitution")
        self.assertEqual(everything.parameters.shape, (1001, len(everything.keys)))
        self.assertTrue(np.isinf(everything.sigma_parameters[0, of]))
        self.assertAlmostEqual(everything.parameters[-1, of], 0.7, 9)
        self.assertTrue(everything.from_filter[-1])
        observer = sprag.Observer(beam, tick=0.02, estimator="adaptive")
        for event in events.tolist():
            observer.take(*event)
        observer.set_horizon(20.0)
        last = observer.settle()[-1]
        np.testing.assert_array_equal(last.q, everything.q[-1])
        self.assertEqual(
            last.parameters["impact.restitution"],
            (everything.parameters[-1, of], everything.sigma_parameters[-1, of]),
        )
        self.assertEqual(sprag.Observer(beam).at(0.0).parameters, {})

    def test_provisional_estimates_and_refusal_of_late_events(self):
        observer = sprag.Observer(scene())
        self.assertEqual(observer.tick, 0.01)
        self.assertTrue(observer.take(0.4565))
        before = observer.at(2.0)
        self.assertFalse(before.settled)
        self.assertTrue(observer.take(1.2957))
        self.assertFalse(np.array_equal(before.q, observer.at(2.0).q))
        observer.set_horizon(2.0)
        self.assertEqual(len(observer.settle()), 201)
        self.assertFalse(observer.take(1.9))
        self.assertEqual(observer.skipped, 1)
        self.assertEqual(observer.settle(), [])
        with self.assertRaises(ValueError):
            observer.at(1.0)

    def test_contacts_count_from_one(self):
        observer = sprag.Observer(scene("two_stops_beam"))
        observer.take(0.5, 2, sprag.ContactEventKind.CLOSES)
        self.assertEqual(observer.at(0.6).closed, (2,))
        observer.take(0.7, 2, sprag.ContactEventKind.OPENS)
        self.assertEqual(observer.at(0.8).closed, ())

    def test_events_may_be_given_in_many_ways(self):
        beam = scene()
        run = sprag.simulate(beam, 5.0)
        expected = sprag.observe(beam, run.events, 5.0).q
        given = {
            "triples": run.events.tolist(),
            "lists": [list(event) for event in run.events.tolist()],
            "in another order": run.events[::-1],
            "every second of an array": np.repeat(run.events, 2)[::2],
            "pulses": sprag.pulses(run.events["t"]),
            "single entries": list(run.events),
        }
        self.assertTrue((run.events["kind"] == sprag.ContactEventKind.PULSE).all())
        for name, events in given.items():
            with self.subTest(name):
                np.testing.assert_array_equal(sprag.observe(beam, events, 5.0).q, expected)
        self.assertEqual(sprag.observe(beam, [], 5.0).taken, 0)

    def test_an_events_file_is_read(self):
        chatter = scene("paper_beam_chatter")
        events = sprag.simulate(chatter, 20.0, tick=0.0).events
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "events.csv"
            write_events(file, events)
            read = sprag.read_events(file, chatter)
            np.testing.assert_array_equal(read, events)
            self.assertFalse(read.flags.writeable)
            self.assertFalse(read.flags.owndata)
            with file.open("a") as csv:
                csv.write("0.001,1,1\n22,1")
            with self.assertWarns(RuntimeWarning) as caught:
                np.testing.assert_array_equal(sprag.read_events(file, chatter), events)
            lines = len(file.read_text().splitlines())
            texts = [str(warning.message) for warning in caught.warnings]
            self.assertEqual(len(texts), 2)
            self.assertTrue(texts[0].startswith(f"{file}:{lines - 1}: "), texts)
            self.assertTrue(texts[1].startswith(f"{file}:{lines}: "), texts)
        with self.assertRaises(sprag.InputError):
            sprag.read_events("/nowhere/events.csv", scene())

    def test_an_events_file_has_the_contact_clocks_times(self):
        text = (
            SOURCE / "scenes" / "lab_rig.toml"
        ).read_text() + "\n[clock]\nrate = 2.0\noffset = 3.0\n"
        clocked = sprag.parse_scene(text)
        self.assertEqual(clocked.machine_time(5.0), 1.0)
        self.assertEqual(scene("lab_rig").machine_time(5.0), 5.0)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "events.csv"
            file.write_text("t,contact,closed\n2,1,1\n2,1,0\n5,1,1\n5,1,0\n")
            with self.assertWarns(RuntimeWarning) as caught:
                events = sprag.read_events(file, clocked)
            self.assertIn("1 event before the machine's t = 0", str(caught.warning))
            np.testing.assert_array_equal(events["t"], [1.0])

    def test_energies_are_v(self):
        beam = scene()
        run = sprag.simulate(beam, 20.0)
        estimates = sprag.observe(beam, run.events, 20.0, estimator="replica")
        energies = sprag.energies(beam, run.q, run.u, estimates.q, estimates.u)
        dq, du = run.q - estimates.q, run.u - estimates.u
        M, K = np.diag(beam.model.M), np.diag(beam.model.K)
        np.testing.assert_allclose(energies.V_i, 0.5 * (M * du**2 + K * dq**2), rtol=1e-12)
        np.testing.assert_allclose(energies.V, energies.V_i.sum(axis=1), rtol=1e-12)
        self.assertAlmostEqual(energies.V[0], 0.4783533, places=7)
        self.assertTrue((energies.V <= estimates.bound).all())
        # Missing columns are zero. One state gives one row.
        self.assertEqual(
            sprag.energies(beam, run.q[0], run.u[0], estimates.q[0, :2], []).V[0],
            sprag.energies(beam, run.q[0], run.u[0], [*estimates.q[0, :2], 0], [0, 0, 0]).V[0],
        )
