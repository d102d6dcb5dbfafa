"""The studies in Python: disturbed events, drawn machines, a calibration that finds false sigmas,
and the situations in which common methods fail and Sprag does not."""

import argparse
import sys
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "studies"))
import calibration  # noqa: E402
import stability  # noqa: E402
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


class Stability(unittest.TestCase):
    def test_newtons_law_moves_a_closed_clutch_into_its_support(self) -> None:
        newton, poisson = stability.newton()
        self.assertAlmostEqual(newton[1][-1], -0.21, delta=1e-12)
        self.assertAlmostEqual(poisson[1][-1], 0.0, delta=1e-12)

    def test_unlike_restitutions_let_V_grow_beyond_the_criterion(self) -> None:
        for differences, growth in stability.restitution(20000):
            allowed = np.array([stability.criterion(d) >= 0.0 for d in differences])
            self.assertLessEqual(growth[allowed].max(), 1.0 + 1e-9)
            self.assertGreater(growth[~allowed].min(), 1.01)

    def test_without_damping_nothing_converges(self) -> None:
        (_, free), (_, damped) = stability.damping()
        self.assertGreater(free[-1], 0.2 * free[0])
        self.assertLess(damped[-1], 1e-7 * damped[0])
        for V in (free, damped):
            self.assertLessEqual(np.diff(V).max(), 1e-13 * V[0])

    def test_a_sustained_contact_stalls_V_until_it_is_released(self) -> None:
        (t, V), (_, remainder) = stability.persistent(90.0)
        at_28 = np.interp(28.0, t, V)
        self.assertAlmostEqual(remainder[300], remainder[560], delta=1e-12)
        self.assertGreater(at_28, remainder[560])
        self.assertLess(at_28 - remainder[560], 0.1 * at_28)
        self.assertLess(V[-1], 1e-4 * remainder[560])

    def test_chatter_is_completed(self) -> None:
        plain, completed = stability.chatter(5000)
        self.assertLess(plain[0][-1], np.sqrt(2.0 / 9.81) * 1.7 / 0.3 + 1e-12)
        self.assertEqual(completed[0][-1], 3.0)
        self.assertLess(completed[1][-1], 100)

    def test_the_event_search_finds_touches_that_a_sign_check_misses(self) -> None:
        (_, sampled), (_, searched) = stability.grazing(300)
        self.assertGreater(sampled[0], 0.3)
        self.assertGreater(sampled[-1], sampled[0])
        self.assertEqual(searched.max(), 0.0)

    def test_activation_by_the_gap_alone_gains_energy(self) -> None:
        gap, approach = stability.activation()
        self.assertGreater(gap[1].max(), 1e-3)
        self.assertLessEqual(approach[1].max(), 0.0)

    def test_steps_beyond_their_limit_diverge(self) -> None:
        euler, theta, half, exact = (energies[-1] for _, energies in stability.steps())
        self.assertGreater(euler, 20.0)
        self.assertGreater(theta, 5.0)
        self.assertAlmostEqual(half, 0.0, delta=1e-12)
        self.assertAlmostEqual(exact, 0.0, delta=1e-12)


if __name__ == "__main__":
    unittest.main()
