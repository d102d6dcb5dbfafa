"""The program tolerance and sprag.tolerance(): limits are admissible and tight, follow the law of
V, and do not depend on threads."""

import csv
import json
import os
import re
import signal
import threading
import unittest
import unittest.mock

import numpy as np

import sprag
from sprag import _core, tolerances
from sprag.tolerances import Deviation, _search, amount_text, amounts, draw
from support import SOURCE, FolderTest, scene

RIG = SOURCE / "scenes/lab_rig.toml"


def limit(found, what, estimator="replica"):
    chosen = found.limits[(found.limits["what"] == what) & (found.limits["estimator"] == estimator)]
    return chosen[0]


class ToleranceTest(unittest.TestCase):
    def test_limits_are_tolerated_and_scale_like_the_root_of_V(self):
        """V of a replica is quadratic: four times the target admits twice the deviation."""
        asked = {"runs": 3, "estimators": ["replica"]}
        narrow = sprag.tolerance("lab_rig", target=1e-6, **asked)
        wide = sprag.tolerance("lab_rig", target=4e-6, **asked)
        for what in ("jitter", "impact.restitution", "system.K"):
            one, two = limit(narrow, what), limit(wide, what)
            self.assertEqual((one["kind"], two["kind"]), ("within", "within"))
            self.assertAlmostEqual(two["amount"] / one["amount"], 2.0, delta=0.5)
            tried = narrow.points[narrow.points["what"] == what]
            below = tried["amount"] < one["amount"]
            self.assertTrue((tried["median"][below] < 1e-6).all())
            self.assertTrue((tried["median"][~below] > 1e-6).all())

    def test_the_target_in_percent_is_an_amplitude(self):
        asked = {"runs": 1, "duration": 20.0, "estimators": ["replica"]}
        one = sprag.tolerance("impact_oscillator", **asked)
        two = sprag.tolerance("impact_oscillator", target="2 %", **asked)
        self.assertEqual(one.target, 1e-4 * one.motion_energy)
        self.assertEqual(two.target, 4e-4 * one.motion_energy)
        self.assertAlmostEqual(two.amplitude, 0.02)
        self.assertIn("2 % of the motion's amplitude", str(two))
        self.assertAlmostEqual(
            limit(two, "jitter")["amount"] / limit(one, "jitter")["amount"], 2.0, delta=0.5
        )

    def test_the_energy_of_the_motion_does_not_depend_on_the_samples(self):
        """In 44.38 s the force of the rig has 199.9 periods, half of 400 samples."""
        for duration in (44.38, 44.44):
            found = sprag.tolerance(
                "lab_rig", runs=1, duration=duration, estimators=["replica"], target=1e6
            )
            rig = scene("lab_rig")
            truth = sprag.simulate(rig, duration, tick=duration / 30_000)
            q, u = (of[len(of) // 2 :] for of in (truth.q, truth.u))
            means = (np.broadcast_to(of.mean(axis=0), of.shape) for of in (q, u))
            expected = sprag.energies(rig, q, u, *means).V.mean()
            self.assertAlmostEqual(found.motion_energy / expected, 1.0, delta=0.02)

    def test_the_first_crossing_counts(self):
        """A clock that is off by a period of the force differs by nothing."""

        class Trials:
            target, estimators = 1.0, ["replica"]
            bound = None

            def spreads(self, deviation, amount):
                V = 1e4 * np.sin(2.0 * np.pi * amount) ** 2 + 1e-9
                return [(V, V, V, np.nan)]

            def guaranteed(self, deviation):
                return None

        limits, _, points = _search(
            Trials(), Deviation("offset", "s", 1e-6, 1.0), [(1e-9, 0.0, 0.0, 0.0)]
        )
        self.assertEqual(limits[0][4], "within")
        self.assertAlmostEqual(limits[0][2], 0.01 / (2.0 * np.pi), delta=1e-5)
        self.assertLess(len(points), 10)

    def test_kinds_of_limits(self):
        class Trials:
            target, estimators = 1.0, ["replica", "timing", "both"]

            def spreads(self, deviation, amount):
                return [(V, V, V, 0.0) for V in (1e-3, 2.0, 5.0)]

            def guaranteed(self, deviation):
                return 1e-3, "within"

        undisturbed = [(V, V, V, 0.0) for V in (1e-3, 1e-3, 5.0)]
        limits, proven, points = _search(Trials(), Deviation("lost", "", 1e-4, 0.5), undisturbed)
        self.assertEqual([of[4] for of in limits], ["beyond_all", "below_all", "never"])
        self.assertEqual([of[2] for of in limits[:2]], [0.5, 1e-4])
        self.assertEqual(proven, [("lost", 1e-3, "", "within")])

    def test_a_ball_without_loss_has_no_limit(self):
        ball = scene("bouncing_ball").with_values({"impact.restitution": 1.0})
        ball = ball.replace(name="a\n\x1b[31m")
        found = sprag.tolerance(ball, duration=20.0, runs=2, estimators=["replica"])
        self.assertTrue(str(found).startswith("a\\n\\x1b[31m: "), "names are printed as text")
        self.assertEqual(set(found.limits["kind"]), {"never"})
        self.assertTrue(np.isnan(found.limits["amount"]).all())
        self.assertRegex(str(found), r"event times jitter +- ")

    def test_a_wrong_parameter_stays_valid(self):
        rig = scene("lab_rig")

        def restitution(amount):
            wrong = _core._with_wrong(rig, "impact.restitution", amount)
            return wrong.model.contacts[0].restitution

        self.assertAlmostEqual(restitution(0.1), 0.66)
        self.assertAlmostEqual(restitution(-0.1), 0.54)
        with self.assertRaisesRegex(sprag.ModelError, "restitution cannot be off by so much"):
            restitution(0.8)
        K = _core._with_wrong(rig, "system.K", -0.2).model.K
        np.testing.assert_allclose(K, 0.8 * rig.model.K, atol=1e-9)

    def test_drift_is_given_to_filters_only(self):
        asked = {"jitter": 1e-4, "estimators": ["replica", "timing"], "duration": 10.0}
        asked |= {"runs": 1, "target": 1e6}
        plain, drifting = (sprag.tolerance("lab_rig", drift=d, **asked) for d in (None, 1e-3))
        self.assertEqual((plain.drift, drifting.drift), (0.0, 1e-3))
        before, after = (found.points["median"][:2] for found in (plain, drifting))
        self.assertEqual(before[0], after[0])
        self.assertNotEqual(before[1], after[1])

    def test_an_adaptive_observer_tolerates_parameters_that_it_identifies(self):
        beam = scene("paper_beam").replace(jitter=1e-4)
        trials = _core._Trials()
        truth = trials.run(beam, 100.0, 0.0, 400)
        wrong = _core._with_wrong(beam, "beam.bending_stiffness", 0.05)
        args = (["replica", "adaptive"], wrong, truth, 1, 0)
        replica, adaptive = (of.V for of in trials.follow(*args, jitter=beam.jitter))
        self.assertLess(np.median(adaptive[201:]), 1e-3 * np.median(replica[201:]))

    def test_results_do_not_depend_on_threads(self):
        asked = {"runs": 2, "duration": 10.0, "estimators": ["timing"]}
        one, three = (sprag.tolerance("lab_rig", jobs=jobs, **asked) for jobs in (1, 3))
        for name in ("limits", "guaranteed", "points"):
            self.assertEqual(repr(getattr(one, name)), repr(getattr(three, name)))
        self.assertEqual(str(one), str(three))

    def test_an_interrupt_ends_it(self):
        threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
        with self.assertRaises(KeyboardInterrupt):
            sprag.tolerance("lab_rig", runs=1000)

    def test_what_is_not_allowed(self):
        with self.assertRaisesRegex(sprag.SceneError, "nowhere"):
            sprag.tolerance("nowhere.toml")
        for wrong in (
            {"runs": 0},
            {"target": -1.0},
            {"target": "-1%"},
            {"target": "x%"},
            {"estimators": ["none"]},
            {"jobs": 0},
            {"jitter": 0.0},
        ):
            with self.subTest(wrong), self.assertRaises(ValueError):
                sprag.tolerance("impact_oscillator", **wrong)

    def test_amounts(self):
        self.assertEqual(amounts(2e-3, 1.0), [2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 0.1, 0.2, 0.5, 1.0])
        for amount, unit, text in (
            (3.4e-4, "s", "0.34 ms"),
            (2e-6, "s", "2 us"),
            (0.25, "s", "0.25 s"),
            (0.034, "rad", "0.034 rad"),
            (0.034, "", "3.4 %"),
            (0.05, "1", "0.05"),
            (0.1, "1/s", "0.1 per s and contact"),
        ):
            self.assertEqual(amount_text(amount, unit), text)

    def test_a_picture_has_a_panel_for_each_deviation(self):
        found = sprag.tolerance("lab_rig", runs=1, duration=10.0, estimators=["replica", "both"])
        panels = [axes for axes in draw(found).axes if axes.lines]
        whats = list(dict.fromkeys(found.limits["what"]))
        self.assertEqual(len(panels), len(whats))
        self.assertEqual(panels[0].get_ylabel(), "V [J]")
        self.assertEqual(
            [line.get_label() for line in panels[0].lines], ["replica", "both", "target"]
        )
        jitter = found.points[
            (found.points["what"] == "jitter") & (found.points["estimator"] == "replica")
        ]
        np.testing.assert_array_equal(panels[0].lines[0].get_xdata(), jitter["amount"])
        lost = panels[whats.index("lost")]
        self.assertEqual(lost.get_xlabel(), "events lost [%]")
        self.assertAlmostEqual(lost.lines[0].get_xdata()[0], 0.01)
        seen = jitter["median"] > panels[0].get_ylim()[0]
        np.testing.assert_array_equal(panels[0].lines[0].get_ydata()[seen], jitter["median"][seen])
        self.assertTrue(seen.any())


class ProgramTest(FolderTest):
    """The program within this process; Program.tolerance starts it as a user does."""

    def run_program(self, *arguments, code=0):
        return self.run_main(tolerances.main, *arguments, code=code)

    SHORT = ("--runs", "1", "--duration", "10", "--estimator", "replica")

    def test_a_table_its_rows_and_a_picture(self):
        options = ["--target", "1e-5", *self.SHORT]
        files = ["--csv", "t.csv", "--output", "t.svg", "--report", "r.json"]
        done = self.run_program(RIG, *options, *files)
        self.assertIn("event times jitter", done.stdout)
        with (self.folder / "t.csv").open() as rows:
            table = list(csv.DictReader(rows))
        columns = "what,unit,amount,estimator,median,low,high,worse"
        self.assertEqual(",".join(table[0]), columns)
        self.assertEqual((table[0]["what"], table[0]["worse"]), ("nothing", "nan"))
        self.assertIn("</svg>", (self.folder / "t.svg").read_text())
        report = json.loads((self.folder / "r.json").read_text())
        self.assertEqual(report["target"], 1e-5)
        first = report["disturbances"][0]
        self.assertEqual(first["what"], "jitter")
        self.assertEqual(first["tolerance"]["replica"]["kind"], "within")
        amounts = [float(row["amount"]) for row in table if row["what"] == "jitter"]
        self.assertEqual([point["amount"] for point in first["points"]], amounts)
        printed = json.loads(self.run_program(RIG, *options, "--json").stdout)
        self.assertEqual(printed["disturbances"], report["disturbances"])

    def test_gain_and_delay_of_a_record_may_be_off(self):
        beam = SOURCE / "scenes/swept_beam.toml"
        options = ["--runs", "1", "--duration", "3", "--estimator", "replica", "--json"]
        found = json.loads(self.run_program(beam, *options, "--target", "3 %").stdout)
        self.assertAlmostEqual(found["amplitude"], 0.03)
        whats = [of["what"] for of in found["disturbances"]]
        self.assertLess({"excitation.gain", "excitation.delay", "impact.restitution"}, set(whats))
        done = self.run_program(beam, "--duration", "9", code=2)
        self.assertIn("the recorded input of swept_beam ends", done.stderr)

    def test_a_full_disk_is_a_failure(self):
        (self.folder / "t.csv").symlink_to("/dev/full")
        done = self.run_program(RIG, *self.SHORT, "--csv", "t.csv", code=1)
        self.assertIn("t.csv: No space left on device", done.stderr)

    def test_bad_usage(self):
        for arguments, why in (
            (["--estimator", "kalman"], "kalman; choose replica, timing, both or adaptive"),
            (["--output", "t.gif"], "must end in .png, .svg or .pdf"),
            (["--target", "-1"], "--target"),
            (["--target", "0%"], "--target"),
        ):
            with self.subTest(arguments):
                self.assertIn(why, self.run_program(RIG, *arguments, code=2).stderr)

    def test_a_machine_without_contacts_that_close(self):
        text = (SOURCE / "scenes/impact_oscillator.toml").read_text()
        file = self.file("far.toml", re.sub("(?m)^clearance = .*", "clearance = 1e3", text))
        done = self.run_program(file, code=1)
        self.assertIn("no contact of the machine closes", done.stderr)

    def test_a_signal_ends_it(self):
        files = ["--csv", "t.csv", "--report", "r.json"]
        threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGTERM)).start()
        done = self.run_program(RIG, "--runs", "1000", *files, code=1)
        self.assertIn("tolerance: interrupted", done.stderr)
        self.assertEqual([file.name for file in self.folder.iterdir()], ["r.json"])

    def test_without_the_compiled_part(self):
        with unittest.mock.patch.dict("sys.modules", {"sprag._core": None}):
            done = self.run_program(RIG, code=1)
        needs = "tolerance needs the compiled part of the Python package sprag"
        self.assertIn(needs, done.stderr)
