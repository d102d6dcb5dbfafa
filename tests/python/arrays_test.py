"""Results are views: C order, read-only, without copies, and valid as long as they are
referenced."""

import gc
import resource
import unittest

import numpy as np
import sprag

from support import scene

TABLES = ["q", "u", "sigma_q", "sigma_u", "sigma_gap"]


class ArraysTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scene = scene()

    def test_arrays_are_in_c_order_read_only_and_not_copied(self):
        run = sprag.simulate(self.scene, 5.0, tick=0.01)
        seen = sprag.observe(self.scene, run.events, 5.0, tick=0.01)
        owners = {
            run: ["events", "t", "q", "u"],
            seen: ["t", "bound", "from_filter", *TABLES],
            sprag.Observer(self.scene).at(0.5): TABLES,
            sprag.energies(self.scene, run.q, run.u, seen.q, seen.u): ["V", "V_i"],
            self.scene.master: ["q", "u"],
            self.scene: ["uncertainty"],
            self.scene.model.contacts[0]: ["w"],
        }
        for owner, attribute in ((owner, name) for owner in owners for name in owners[owner]):
            with self.subTest(f"{type(owner).__name__}.{attribute}"):
                array = getattr(owner, attribute)
                self.assertTrue(array.flags.c_contiguous)
                self.assertFalse(array.flags.writeable)
                with self.assertRaises(ValueError):
                    array.flags.writeable = True
                with self.assertRaises(ValueError):
                    array[0] = array[0]
                self.assertFalse(array.flags.owndata)
                self.assertIs(array.base, owner)
                again = getattr(owner, attribute)
                self.assertEqual(array.ctypes.data, again.ctypes.data)

    def test_long_run_is_stored_once(self):
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        run = sprag.simulate(self.scene, 1000.0, tick=1e-3)
        views = [run.t, run.q, run.u]
        grown = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
        self.assertLess(grown, 1.5 * sum(view.nbytes for view in views))

    def test_arrays_outlive_their_owner(self):
        def taken():
            run = sprag.simulate(self.scene, 200.0, tick=1e-2)
            return run.q, run.events, run.q.copy(), run.events.copy()

        q, events, q_copy, events_copy = taken()
        gc.collect()
        sprag.simulate(self.scene, 200.0, tick=1e-2)  # reuses freed memory
        np.testing.assert_array_equal(q, q_copy)
        np.testing.assert_array_equal(events, events_copy)

    def test_parts_of_a_scene_outlive_it(self):
        w = scene().model.contacts[0].w
        q = scene().master.q
        gc.collect()
        np.testing.assert_array_equal(w, self.scene.model.contacts[0].w)
        np.testing.assert_array_equal(q, [-0.05, 0.0, 0.0])
