"""Identification, smoothing, impacts, predictions, import of events, and changes of scenes."""

import csv
import json
import os
import subprocess
import tempfile
import unittest
from pathlib import Path

import numpy as np

import sprag
from support import BUILD, SOURCE, FolderTest, scene, write_events


def program(name: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([BUILD / "sprag", name, *arguments], capture_output=True, text=True)


def rig(restitution: float = 0.6, **settings) -> sprag.Scene:
    """Two masses between springs on a shaken frame, the second against a stop."""
    model = sprag.Model(
        [[1.0, 0.2], [0.2, 0.8]],
        None,
        [[300.0, -120.0], [-120.0, 200.0]],
        [sprag.Contact([0.0, 1.0], restitution, clearance=0.004)],
        outputs=[
            sprag.Output("mass", [0.0, 1.0]),
            sprag.Output("speed", [1.0, 0.0], velocity=True),
        ],
        damping_ratio=[0.03, 0.02],
    )
    return sprag.Scene(
        model,
        excitation=sprag.Harmonic(0.004, 13.0),
        influence=1.0,
        mount=["frame"],
        uncertainty=[0.02, 0.02],
        **settings,
    )


def with_jitter(events: np.ndarray, jitter: float, seed: int) -> np.ndarray:
    late = events.copy()
    late["t"] += jitter * np.random.default_rng(seed).standard_normal(len(events))
    return np.sort(late, order="t")


class IdentifyTest(unittest.TestCase):
    def test_parameters_are_found(self):
        truth = rig(0.55)
        events = sprag.simulate(truth, 60.0).events
        self.assertGreater(len(events), 60)
        fit = sprag.identify(rig(), events, jitter=1e-6, free=["impact.restitution", "system.C"])
        self.assertTrue(fit.fits, fit.problem)
        self.assertEqual(fit.cause, "none")
        self.assertEqual(fit.keys, ["impact.restitution", "system.C"])
        value, sigma = fit.parameters["impact.restitution"]
        self.assertAlmostEqual(value, 0.55, delta=max(5 * sigma, 1e-6))
        self.assertEqual(value, fit.values[0])
        self.assertTrue((fit.low <= fit.values).all() and (fit.values <= fit.high).all())
        self.assertTrue(fit.determined.all())
        self.assertAlmostEqual(fit.fitted.model.contacts[0].restitution, value)
        self.assertEqual((fit.misfit, fit.culprit, fit.drift), ("none", None, None))
        self.assertEqual((len(fit.missing), len(fit.spurious)), (0, 0))
        self.assertEqual(fit.start.q.shape, (2,))

    def test_the_sigma_with_the_fitted_scene_covers_the_error(self):
        truth = scene("lab_rig")
        run = sprag.simulate(truth, 20.0)
        free = ["impact.restitution", "system.C", "system.K"]
        squares = {sprag.observe: [], sprag.smooth: []}
        for seed in range(10 if "SPRAG_THOROUGH" in os.environ else 5):
            events = with_jitter(run.events, 2e-5, seed)
            fit = sprag.identify(truth, events, jitter=2e-5, free=free)
            self.assertTrue(fit.fits, fit.problem)
            for estimates, of in squares.items():
                estimate = estimates(fit.fitted, events, 20.0)
                over_sigma = (estimate.q - run.q)[200:] / estimate.sigma_q[200:]
                of.append(np.mean(over_sigma**2))
        for of in squares.values():
            # The parameters are common to all ticks: each run counts as one sample of about 1.
            self.assertGreater(np.mean(of), 0.3)
            self.assertLess(np.mean(of), 4.0)

    def test_the_fitted_scene_and_mended_events_are_what_the_program_writes(self):
        truth = scene("lab_rig")
        events = with_jitter(sprag.simulate(truth, 20.0).events, 2e-5, seed=0)
        record = np.append(np.delete(events, 30), np.array([(11.1, 1, 3)], sprag.event_dtype))
        record = np.sort(record, order="t")
        with tempfile.TemporaryDirectory() as folder:
            file, written, fitted = (Path(folder) / name for name in ("e.csv", "m.csv", "f.toml"))
            write_events(file, record)
            rig_file = str(SOURCE / "scenes/lab_rig.toml")
            options = ["--jitter", "2e-5", "--free", "impact.restitution,system.K"]
            options += ["--events", str(written), "--output", str(fitted), "--json"]
            report = json.loads(program("identify", str(file), rig_file, *options).stdout)
            with written.open(newline="") as rows:
                expected = list(csv.DictReader(rows))
            scene_of_program = sprag.read_scene(fitted)
        fit = sprag.identify(truth, record, jitter=2e-5, free=["impact.restitution", "system.K"])
        self.assertTrue(fit.fits, fit.reason)
        self.assertEqual(sprag.to_toml(fit.fitted), sprag.to_toml(scene_of_program))
        self.assertEqual(fit.fitted.jitter, 2e-5)
        self.assertGreater(fit.fitted.drift, 0.0)
        self.assertEqual(set(fit.mended["note"]), {"", "lost", "spurious"})
        self.assertAlmostEqual(fit.missing["t"][0], events["t"][30], delta=1e-3)
        self.assertEqual((len(fit.missing), len(fit.spurious)), (1, 1))
        self.assertEqual(len(fit.repaired), len(events))
        self.assertEqual(fit.mended.dtype.names, tuple(expected[0]))
        for name, convert in (("t", float), ("contact", int), ("closed", int), ("note", str)):
            self.assertEqual(fit.mended[name].tolist(), [convert(row[name]) for row in expected])
        sigmas = np.array([of["sigma"] for of in report["parameters"]])
        expected = np.array(report["correlations"]) * np.outer(sigmas, sigmas)
        np.testing.assert_allclose(fit.covariance, expected, rtol=1e-12)
        self.assertEqual((fit.verdict, fit.held), (report["verdict"], report["held"]))

    def test_one_key_and_its_range(self):
        truth = rig(0.55)
        events = sprag.simulate(truth, 60.0).events
        fit = sprag.identify(rig(), events, jitter=1e-6, free="impact.restitution")
        self.assertEqual(fit.keys, ["impact.restitution"])
        np.testing.assert_allclose(fit.covariance, [[fit.sigmas[0] ** 2]])
        narrow = {"impact.restitution": 0.01, "system.K": 0.5}
        one = sprag.identify(rig(), events, jitter=1e-6, free="impact.restitution", within=narrow)
        self.assertEqual((one.problem, one.culprit), ("bound_reached", "impact.restitution"))

    def test_wrong_arguments(self):
        events = sprag.simulate(rig(), 20.0).events
        for arguments in (
            {"free": ["system.X"]},
            {"jitter": -1.0},
            {"within": 0.0},
            {"within": {"system.K": 11.0}},
            {"within": {"system.X": 0.1}},
            {"free": ["system.K"], "known": ["system.K"]},
        ):
            with self.subTest(arguments), self.assertRaises(ValueError):
                sprag.identify(rig(), events, **arguments)
        with self.assertRaises(sprag.Error):
            sprag.identify(rig(), events[:4])
        with self.assertRaisesRegex(sprag.Error, "contacts close at"):
            sprag.diagnose(rig(), [])


class SmoothTest(unittest.TestCase):
    def test_smoothed_estimates_are_better(self):
        rng = np.random.default_rng(5)
        jitter = 2e-4
        truth = rig(jitter=jitter)
        machine = sprag.simulate(truth, 30.0)
        events = machine.events.copy()
        events["t"] += jitter * rng.standard_normal(len(events))
        events = events[np.argsort(events["t"])]
        smoothed = sprag.smooth(truth, events, 30.0)
        filtered = sprag.observe(truth, events, 30.0, estimator="timing")
        self.assertEqual(smoothed.q.shape, machine.q.shape)
        rms = [np.sqrt(np.mean((of.q[500:] - machine.q[500:]) ** 2)) for of in (smoothed, filtered)]
        self.assertLess(rms[0], rms[1])
        np.testing.assert_allclose(smoothed.outputs[:, 0], smoothed.q[:, 1])
        np.testing.assert_allclose(smoothed.outputs[:, 1], smoothed.u[:, 0])
        self.assertEqual(smoothed.smoothed.dtype, bool)
        self.assertGreater(smoothed.smoothed.mean(), 0.9)
        self.assertAlmostEqual(smoothed.stretches[0].misfit, 1.0, delta=0.5)

    def test_without_jitter_it_is_refused(self):
        with self.assertRaises(sprag.Error):
            sprag.smooth(rig(), sprag.simulate(rig(), 5.0).events, 5.0)


class ImpactsTest(unittest.TestCase):
    def test_impacts_are_those_of_the_program(self):
        truth = scene("two_stops_beam")
        machine = sprag.simulate(truth, 40.0)
        impacts = sprag.impacts(truth, machine.events, 40.0)
        self.assertEqual(len(impacts), len(machine.events))
        np.testing.assert_array_equal(impacts["t"], machine.events["t"])
        with tempfile.TemporaryDirectory() as folder:
            events, file = Path(folder) / "events.csv", Path(folder) / "impacts.csv"
            write_events(events, machine.events)
            done = program(
                "observer", str(SOURCE / "scenes/two_stops_beam.toml"), "--replay", str(events),
                "--duration", "40", "--impacts", str(file)
            )  # fmt: skip
            self.assertEqual(done.returncode, 0, done.stderr)
            header = file.read_text().splitlines()[0].split(",")
            table = np.genfromtxt(file, delimiter=",", names=True)
        self.assertEqual([of for of in impacts.dtype.names if of != "sustained"], header)
        for name in ("t", "velocity_before", "velocity_after", "sigma_velocity_after"):
            np.testing.assert_array_equal(table[name], impacts[name])

    def test_prediction_is_what_comes(self):
        truth = rig()
        machine = sprag.simulate(truth, 40.0)
        prediction = sprag.predict(truth, machine.events, 20.0, 2.0)
        later = machine.events[machine.events["t"] > 20.0]
        n = len(prediction.events)
        self.assertEqual(prediction.events.dtype.names, ("t", "contact", "kind", "sigma_t"))
        self.assertGreaterEqual(n, 2)
        self.assertEqual(prediction.made_at, 20.0)
        np.testing.assert_allclose(prediction.events["t"], later["t"][:n], atol=1e-6)
        np.testing.assert_array_equal(prediction.events["contact"], later["contact"][:n])
        for t, ahead in ((-1.0, 1.0), (1.0, 0.0), (np.nan, 1.0)):
            with self.assertRaises(ValueError):
                sprag.predict(truth, machine.events, t, ahead)


class InconsistencyTest(unittest.TestCase):
    def test_reasons(self):
        truth = rig(jitter=1e-5)
        events = sprag.simulate(truth, 40.0).events
        self.assertEqual(sprag.observe(truth, events, 40.0).inconsistencies, [])
        spurious = np.append(events, np.array([(20.03, 1, 3)], dtype=sprag.event_dtype))
        estimates = sprag.observe(truth, spurious, 40.0)
        first = estimates.inconsistencies[0]
        self.assertEqual((first.contact, first.reason), (1, "spurious event"))
        self.assertAlmostEqual(first.t, 20.03)
        twice = sprag.observe(truth, [(1.0, 1, 1), (1.1, 1, 1)], 2.0)
        self.assertEqual(twice.skipped_by_reason["contradicting"], 1)
        self.assertEqual(twice.skipped, 1)


class ImportTest(FolderTest):
    """What import_events() says in Python, and clocks; importing_test.py has forms of files."""

    def test_doubts_are_warnings(self):
        one = self.file("one.csv", "t\n0.5\nx\n0.7\n")
        with self.assertWarnsRegex(RuntimeWarning, "one.csv:3"):
            events = sprag.import_events(one, scene())
        self.assertEqual(events.dtype, sprag.event_dtype)
        self.assertEqual(events.tolist(), [(0.5, 1, 3), (0.7, 1, 3)])
        with self.assertWarnsRegex(RuntimeWarning, "contact 2 of the scene has no column"):
            sprag.import_events(one, scene("two_stops_beam"), impacts={1: "t"})
        for wrong in ({"unit": 0.0}, {"unit": "h"}, {"separator": "bar"}, {"rate": -1.0}):
            with self.subTest(wrong), self.assertRaises(ValueError):
                sprag.import_events(one, scene(), **wrong)
        with self.assertRaisesRegex(sprag.InputError, "one.csv"):
            sprag.import_events(one, scene(), impacts="b")

    def test_levels(self):
        capture = self.file(
            "capture.csv",
            "Time [ms],D0,D1\n0,1,3.3\n500,0,3.3\n501,1,3.2\n700,1,0.1\n900,1,3.3\n"
            "1000,0,3.3\n1000.1,1,3.3\n1000.2,0,3.3\n1002,1,3.3\n",
        )
        arguments = {"level": {1: "D0", 2: "D1"}, "inverted": True, "threshold": 0.5}
        rules = {"debounce": 5e-4, "pulse_shorter_than": 3e-3}
        events = sprag.import_events(capture, scene("two_stops_beam"), **arguments, **rules)
        expected = [(0.5, 1, 3), (0.7, 2, 1), (0.9, 2, 2), (1.0, 1, 3)]
        self.assertEqual(events.tolist(), expected)
        clock = {"unit": "us", "offset": "0.5", "rate": 1.01, "duration": 9.897e-4}
        with self.assertWarnsRegex(RuntimeWarning, "unit"):
            falling = sprag.import_events(
                capture, scene(), level="D0", time="Time [ms]", impacts_at="falling", **clock
            )
        wanted = [(t - 0.5) * 1e-6 / 1.01 for t in (500.0, 1000.0)]
        np.testing.assert_allclose(falling["t"], wanted, rtol=1e-12)
        with self.assertRaisesRegex(ValueError, "impacts_at"):
            sprag.import_events(capture, scene(), level="D0", impacts_at="up")
        text = (SOURCE / "scenes/paper_beam.toml").read_text() + "\n[clock]\nrate = 1.0002\n"
        with self.assertRaisesRegex(ValueError, "twice"):
            sprag.import_events(capture, sprag.parse_scene(text), level="D0", rate=1.0002)


class ScenesTest(unittest.TestCase):
    def test_version(self):
        header = (SOURCE / "sprag/version.h").read_text()
        self.assertIn(f'"{sprag.__version__}"', header)

    def test_a_written_scene_begins_with_its_comment(self):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "rig.toml"
            sprag.write_scene(file, rig(), comment="A rig.")
            self.assertTrue(file.read_text().startswith("# A rig.\n"))
            self.assertEqual(sprag.read_scene(file).f, 2)

    def test_confidence_is_one_of_three_levels(self):
        scene = rig(jitter=1e-4)
        self.assertEqual(scene.confidence, "high")
        low = scene.replace(confidence="low")
        self.assertEqual(sprag.parse_scene(sprag.to_toml(low)).confidence, "low")
        with self.assertRaisesRegex(ValueError, 'is "sure"; must be "low", "medium" or "high"'):
            scene.replace(confidence="sure")

    def test_a_shaken_frame_is_a_force_and_the_motion_of_stops_on_the_ground(self):
        model = rig().model
        for mount, amplitude in (("ground", 0.5 * 0.004), ("frame", 0.0)):
            shaken = sprag.Scene(
                sprag.Model(model.M, model.C, model.K, model.contacts),
                excitation=sprag.Harmonic(0.004, 13.0),
                influence=[1.0, 0.5],
                mount=[mount],
            )
            (force,) = shaken.model.forces
            inertia = 13.0**2 * 0.004 * model.M @ [1.0, 0.5]
            np.testing.assert_allclose(force.harmonic.amplitude * force.direction, inertia)
            self.assertAlmostEqual(shaken.model.contacts[0].motion.amplitude, amplitude, 15)

    def test_forms_of_damping(self):
        rayleigh = sprag.Model(
            np.eye(2), None, 2 * np.eye(2), [sprag.Contact([1, 0], 0.5)], rayleigh=(0.1, 0.2)
        )
        np.testing.assert_allclose(rayleigh.C, 0.5 * np.eye(2))
        beam = sprag.Beam(modes=2, damping_ratio=0.01)
        np.testing.assert_array_equal(beam.damping_ratio, [0.01, 0.01])
        self.assertIsNone(sprag.Beam(modes=2, damping=0.1).damping_ratio)

    def test_kept_modes_are_those_of_a_file(self):
        n = 20
        k = n * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
        k[-1, -1] = n
        w = np.eye(n)[-1]
        model = sprag.Model(
            np.eye(n) / n, None, k, [sprag.Contact(w, 0.5, clearance=0.01)], damping_ratio=0.02
        )
        frame = {"excitation": sprag.Harmonic(0.05, 2.0), "influence": 1.0, "mount": ["frame"]}
        q = np.linspace(0.0, 0.05, n)
        whole = sprag.Scene(model, master=sprag.State(q), **frame)
        part = sprag.Scene(model, master=sprag.State(q), modes=3, static_vectors=[0, 1], **frame)
        self.assertEqual((part.f, part.kept.modes), (5, 3))
        np.testing.assert_allclose(part.kept.Phi.T @ model.M @ part.kept.Phi, np.eye(5), atol=1e-12)
        np.testing.assert_allclose(part.master.q, part.kept.to_kept @ q)
        text = sprag.to_toml(whole).replace(
            "[system]", "[system]\nmodes = 3\nstatic_vectors = [0, 1]"
        )
        np.testing.assert_allclose(sprag.parse_scene(text).model.C, part.model.C, atol=1e-12)
        self.assertIsNone(whole.kept)
        for wrong in ({"modes": 0}, {"modes": 21}, {"static_vectors": [0]}):
            with self.subTest(wrong), self.assertRaises(ValueError):
                sprag.Scene(model, **wrong)

    def test_changed_values(self):
        beam = scene().with_values({"impact.restitution": 0.5, "contact.1.position": 0.8})
        self.assertEqual(beam.model.contacts[0].restitution, 0.5)
        np.testing.assert_allclose(
            beam.model.contacts[0].w, sprag.beam_contact(beam.beam, 0.8, 0.5).w
        )
        self.assertEqual(scene().model.contacts[0].restitution, 0.7)  # the original stays
        shaken = sprag.read_scene("swept_beam")
        stronger = shaken.with_values({"excitation.gain": 1.5})
        self.assertNotEqual(stronger, shaken)
        self.assertEqual(stronger.with_values({"excitation.gain": 1.0}), shaken)
        other = rig().replace(jitter=1e-3, master=sprag.State([0.0, 0.001]), uncertainty=0.4)
        self.assertEqual((other.jitter, other.master.q[1]), (1e-3, 0.001))
        np.testing.assert_array_equal(other.uncertainty, [0.2, 0.2])
        for wrong in ({"jitter": -1.0}, {"master": sprag.State([0.0, -1.0])}):
            with self.subTest(wrong), self.assertRaises(ValueError):
                rig().replace(**wrong)
        for wrong in ({"impact.restitution": 1.5}, {"system.Q": 1.0}, {"system.K": -1.0}):
            with self.subTest(wrong), self.assertRaises(ValueError):
                rig().with_values(wrong)
        uncertain = rig().replace(parameters={"impact.restitution": 0.01, "system.K": 0.02})
        self.assertEqual(uncertain.parameters.keys, ["impact.restitution", "system.K"])
        np.testing.assert_array_equal(uncertain.parameters.sigma, [0.01, 0.02])
        events = sprag.simulate(rig(), 20.0).events
        sigmas = [sprag.observe(of, events, 20.0).sigma_q[-1, 0] for of in (uncertain, rig())]
        self.assertGreater(sigmas[0], sigmas[1])
        for wrong in ({"clock.rate": 0.1}, {"impact.restitution": 0.0}, {"x": 1.0}):
            with self.subTest(wrong), self.assertRaises(ValueError):
                rig().replace(parameters=wrong)
