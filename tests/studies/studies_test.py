"""The studies in Python: disturbed events, drawn machines, and a calibration that finds false
sigmas."""

import argparse
import sys
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "studies"))
import calibration  # noqa: E402
from machines import disturbed, machines, sprag  # noqa: E402


def options(**given: object) -> argparse.Namespace:
    usual = {"trouble": "none", "confidence": "high", "bound": False, "estimator": "both"}
    return argparse.Namespace(**(usual | given))


class Machines(unittest.TestCase):
    def test_a_seed_draws_one_machine(self) -> None:
        self.assertEqual(machines("coupled:3"), machines("coupled:1-3")[2:])
        self.assertNotEqual(machines("single:1"), machines("single:7"))
        self.assertEqual([scene.f for scene in machines("single:1-6")], [1, 2, 3, 4, 5, 6])
        self.assertEqual(machines("modes:8")[0].f, 8)

    def test_disturbed_events_keep_the_order_of_a_contact(self) -> None:
        events = sprag.simulate(machines("two_stops_beam")[0], 20.0).events
        moved = disturbed(events, np.random.default_rng(1), 0.1)
        self.assertEqual(len(moved), len(events))
        self.assertTrue(np.all(np.diff(moved["t"]) >= 0.0))
        for contact in (1, 2):
            of = [x[x["contact"] == contact] for x in (events, moved)]
            np.testing.assert_array_equal(of[0]["kind"], of[1]["kind"])
            self.assertGreater(np.std(of[1]["t"] - of[0]["t"]), 0.03)

    def test_shares_of_lost_and_spurious_events(self) -> None:
        events = sprag.simulate(machines("two_stops_beam")[0], 20.0).events
        few = disturbed(events, np.random.default_rng(1), 0.0, lost=0.1)
        more = disturbed(events, np.random.default_rng(1), 0.0, more=0.1)
        self.assertAlmostEqual(len(few) / len(events), 0.9, delta=0.03)
        self.assertAlmostEqual(len(more) / len(events), 1.1, delta=0.01)


class Calibration(unittest.TestCase):
    def test_a_right_model_is_calibrated(self) -> None:
        (scene,) = machines("paper_beam")
        found = calibration.errors(scene, 1, 1e-4, options())
        assert found is not None
        z, ratio = found
        self.assertLess(np.nanmean(z**2), 2.0)
        self.assertGreater(np.nanmean(z**2), 0.3)
        self.assertLess(np.mean(z > 5.0), 0.001)
        self.assertLess(ratio, 0.2)

    def test_false_sigmas_are_found(self) -> None:
        (scene,) = machines("paper_beam")
        found = calibration.errors(scene, 1, 1e-4, options(trouble="wrong", estimator="timing"))
        assert found is not None
        z = found[0][~np.isnan(found[0])]
        self.assertGreater(np.mean(z > 5.0), 0.05)
        self.assertGreater(np.mean(z**2), 5.0)


if __name__ == "__main__":
    unittest.main()
