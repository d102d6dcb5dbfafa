"""Machines without a file are those that a scene file makes."""

import unittest

import numpy as np
import sprag

from support import scene


def paper_beam() -> sprag.Scene:
    frame = sprag.Harmonic(0.03, 9.5)
    beam = sprag.Beam(modes=3, damping=0.17)
    model = sprag.beam_model(
        beam, [sprag.beam_contact(beam, 0.868, 0.7, motion=frame)], excitation=frame
    )
    of_file = scene()
    return sprag.Scene(
        model,
        master=sprag.State(q=[-0.05]),
        replica=of_file.replica,
        uncertainty=of_file.uncertainty,
        name="paper_beam",
    )


class MachinesTest(unittest.TestCase):
    def test_a_beam_in_code_is_the_one_of_the_file(self):
        ours, theirs = paper_beam(), scene()
        self.assertEqual((ours.name, ours.f, ours.m), (theirs.name, theirs.f, theirs.m))
        self.assertEqual(ours.model.chatter_time, theirs.model.chatter_time)
        for name in "MCK":
            np.testing.assert_array_equal(getattr(ours.model, name), getattr(theirs.model, name))
        a, b = sprag.simulate(ours, 50.0), sprag.simulate(theirs, 50.0)
        np.testing.assert_array_equal(a.events, b.events)
        np.testing.assert_array_equal(a.q, b.q)
        a, b = sprag.observe(ours, a.events, 50.0), sprag.observe(theirs, b.events, 50.0)
        np.testing.assert_array_equal(a.u, b.u)
        np.testing.assert_array_equal(a.bound, b.bound)

    def test_a_ball_bounces(self):
        ball = sprag.Model(
            [[2.0]], [[0.0]], [[0.0]], [sprag.Contact([1.0], 0.5)], [sprag.Force([-2.0], 9.81)]
        )
        start = sprag.State(q=[1.0])
        run = sprag.simulate(sprag.Scene(ball, master=start), 1.0, tick=0.1)
        first = np.sqrt(2.0 / 9.81)
        np.testing.assert_allclose(run.events["t"][:2], [first, 2.0 * first], rtol=1e-12)
        self.assertEqual(run.events["kind"][0], sprag.ContactEventKind.PULSE)
        np.testing.assert_allclose(run.q[:5, 0], 1.0 - 0.5 * 9.81 * run.t[:5] ** 2, rtol=1e-12)

    def test_what_a_machine_says_of_itself(self):
        ours = paper_beam()
        contact = ours.model.contacts[0]
        self.assertEqual((contact.restitution, contact.clearance), (0.7, 0.0))
        self.assertEqual((contact.motion.amplitude, contact.motion.frequency), (0.03, 9.5))
        self.assertEqual(ours.model.law, "poisson")
        self.assertIsNone(ours.beam)
        self.assertEqual(scene().beam.modes, 3)
        self.assertIsNone(scene("bouncing_ball").beam)
        self.assertEqual(repr(scene()), "<sprag.Scene paper_beam: f = 3, m = 1>")

    def test_what_makes_no_machine_is_refused(self):
        one, contact = [[1.0]], sprag.Contact([1.0], 0.5)
        beam = sprag.Beam(3)
        model = sprag.Model(one, one, one, [contact])
        wrong = {
            "modes": lambda: sprag.Beam(0),
            "length": lambda: sprag.Beam(3, length=0.0),
            "restitution": lambda: sprag.Contact([1.0], 1.1),
            "w": lambda: sprag.Contact([0.0], 0.5),
            "frequency": lambda: sprag.Harmonic(1.0, -1.0),
            "position": lambda: sprag.beam_contact(beam, 1.1, 0.5),
            "side": lambda: sprag.beam_contact(beam, 1.0, 0.5, side="left"),
            "no contact": lambda: sprag.beam_model(beam, []),
            "contact of another size": lambda: sprag.beam_model(beam, [contact]),
            "sizes": lambda: sprag.Model(one, np.eye(2), one, [contact]),
            "symmetry": lambda: sprag.Model(
                np.eye(2), [[0.0, 1.0], [0.0, 0.0]], np.eye(2), [sprag.Contact([1.0, 0.0], 0.5)]
            ),
            "definite": lambda: sprag.Model([[0.0]], one, one, [contact]),
            "semidefinite": lambda: sprag.Model(one, one, [[-1.0]], [contact]),
            "law": lambda: sprag.Model(one, one, one, [contact], law="none"),
            "start": lambda: sprag.Scene(model, master=sprag.State(q=[1.0, 2.0])),
            "inside": lambda: sprag.Scene(model, master=sprag.State(q=[-1.0])),
            "uncertainty": lambda: sprag.Scene(model, uncertainty=[-1.0]),
            "jitter": lambda: sprag.Scene(model, jitter=-1.0),
            "chatter_time": lambda: sprag.Scene(model, chatter_time=0.0),
        }
        for name, call in wrong.items():
            with self.subTest(name), self.assertRaises(ValueError):
                call()


if __name__ == "__main__":
    unittest.main()
