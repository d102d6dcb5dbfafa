"""Machines built in Python equal those of a scene file."""

import unittest

import numpy as np
import sprag
from sprag import _machine

from support import SOURCE, scene


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
    def test_uncertain_parameters_are_read(self):
        text = (SOURCE / "scenes" / "paper_beam.toml").read_text()
        parameters = sprag.parse_scene(
            text
            + """
[parameters]
impact.restitution = { sigma = 0.01 }
beam.damping = { sigma = 0.002, consider = true }
correlation = [["impact.restitution", "beam.damping", -0.3]]
"""
        ).parameters
        self.assertEqual(parameters.keys, ["impact.restitution", "beam.damping"])
        self.assertEqual(parameters.consider, [False, True])
        np.testing.assert_array_equal(parameters.sigma, [0.01, 0.002])
        np.testing.assert_array_equal(parameters.correlation, [[1.0, -0.3], [-0.3, 1.0]])

    def test_records_and_positions_are_those_of_the_scene(self):
        swept = scene("swept_beam")
        rows = np.loadtxt(
            SOURCE / "scenes" / "records" / "swept_base.csv", delimiter=",", skiprows=1
        )
        (record,) = swept.records
        self.assertEqual((record.of, record.displacement), ("excitation", False))
        np.testing.assert_allclose(record.t, rows[:, 0], atol=1e-12)
        np.testing.assert_allclose(record.values, 9.80665 * rows[:, 1], rtol=1e-14)
        self.assertEqual(swept.positions, [0.28])

    def test_pictures_show_the_same_machine_without_the_compiled_part(self):
        for name in ("paper_beam", "two_stops_beam", "three_ball_chain", "lab_rig"):
            with self.subTest(name):
                file = str(SOURCE / "scenes" / f"{name}.toml")
                of = _machine._machine_by_program(file)
                expected = _machine.machine_of(scene(name))
                for field in ("name", "f", "m", "output_units"):
                    self.assertEqual(getattr(of, field), getattr(expected, field), field)
                self.assertEqual(of.decay_rate is None, expected.decay_rate is None)
                if expected.decay_rate is not None:
                    self.assertAlmostEqual(of.decay_rate / expected.decay_rate, 1.0, 14)
                t = np.linspace(0.0, 10.0, 7)
                q = np.random.default_rng(3).normal(size=(7, of.f))
                np.testing.assert_allclose(of.gaps(t, q), expected.gaps(t, q), atol=1e-13)

    def test_restitutions_may_depend_on_the_speed(self):
        line = {"value": 0.9, "slope": -0.05}
        points = {"at": [0.1, 1.0], "value": [0.9, 0.8]}
        for by_speed in (line, points):
            contact = sprag.Contact([1.0], by_speed)
            self.assertEqual(contact.restitution, 0.9)
            self.assertEqual(contact.restitution_by_speed, by_speed)
            self.assertNotEqual(contact, sprag.Contact([1.0], 0.9))
            scene = sprag.Scene(sprag.Model([[1.0]], [[0.0]], [[0.0]], [contact]))
            self.assertEqual(sprag.parse_scene(sprag.to_toml(scene)), scene)
        slower = scene.with_values({"impact.restitution.value": 0.45})
        self.assertEqual(slower.model.contacts[0].restitution_by_speed["value"], [0.45, 0.4])
        for wrong in (
            {"value": 0.9},
            {"value": 0.9, "slope": 0.1},
            {"at": [1.0, 0.5], "value": [0.9, 0.8]},
            {"at": [1.0, 1.1], "value": [0.9, 0.1]},
        ):
            with self.assertRaisesRegex(ValueError, "restitution"):
                sprag.Contact([1.0], wrong)

    def test_outputs_have_names_values_and_sigmas(self):
        outputs = [
            sprag.Output("tip", [1.0, -1.0]),
            sprag.Output("speed", [0.0, 1.0], velocity=True, unit="m/s"),
        ]
        model = sprag.Model(
            np.eye(2),
            0.1 * np.eye(2),
            np.diag([4.0, 9.0]),
            [sprag.Contact([1.0, 0.5], 0.5, clearance=0.1)],
            [sprag.Force([1.0, 1.0], harmonic=sprag.Harmonic(1.0, 2.5))],
            outputs=outputs,
        )
        machine = sprag.Scene(
            model,
            replica=sprag.State(q=[0.1]),
            sigma=sprag.State(q=[0.25, 0.5], u=[1.0, 1.0]),
        )
        run = sprag.simulate(machine, 10.0)
        estimates = sprag.observe(machine, run.events, 10.0)
        np.testing.assert_array_equal(
            estimates.outputs[:, 0], estimates.q[:, 0] - estimates.q[:, 1]
        )
        np.testing.assert_array_equal(estimates.outputs[:, 1], estimates.u[:, 1])
        self.assertAlmostEqual(estimates.sigma_outputs[0, 0], np.hypot(0.25, 0.5), 12)
        observer = sprag.Observer(machine)
        observer.set_horizon(1.0)
        self.assertEqual(observer.settle()[-1].outputs.shape, (2,))
        with self.assertRaisesRegex(ValueError, "output"):
            sprag.Model(np.eye(1), np.eye(1), np.eye(1), model.contacts[:0], outputs=outputs)

    def test_gaps_are_those_of_the_contacts(self):
        machine = sprag.read_scene("two_stops_beam")
        run = sprag.simulate(machine, 2.0)
        gaps = machine.gaps(run.t, run.q)
        self.assertEqual(gaps.shape, (len(run.t), 2))
        for i, contact in enumerate(machine.model.contacts):
            s = contact.motion
            shift = s.amplitude * np.cos(s.frequency * run.t + s.phase)
            expected = run.q @ contact.w + shift + contact.clearance
            np.testing.assert_allclose(gaps[:, i], expected, rtol=0, atol=1e-15)
        self.assertGreater(gaps.min(), -1e-12)
        with self.assertRaisesRegex(ValueError, "row of 5 for each"):
            machine.gaps(run.t[:-1], run.q)

    def test_remarks_on_a_scene_are_warnings(self):
        text = (
            "[system]\nM = [[1.0, 1e-16], [0.0, 1.0]]\nrayleigh = { alpha = 0.1, beta = 0.0 }\n"
            "K = [[1.0, 0.0], [0.0, 2.0]]\n[excitation]\ninfluence = 1.0\namplitude = 0.1\n"
            "frequency = 2.0\n[impact]\nrestitution = 0.5\n[[contact]]\ndirection = [1.0, 0.0]\n"
        )
        with self.assertWarnsRegex(RuntimeWarning, "system.M is symmetric but for rounding"):
            machine = sprag.parse_scene(text)
        np.testing.assert_array_equal(machine.model.C, 0.1 * machine.model.M)
        self.assertEqual(machine.model.contacts[0].motion.amplitude, 0.1)

    def test_beam_in_code_equals_scene_file(self):
        ours, theirs = paper_beam(), scene()
        for name in "MCK":
            np.testing.assert_array_equal(getattr(ours.model, name), getattr(theirs.model, name))
        a, b = sprag.simulate(ours, 50.0), sprag.simulate(theirs, 50.0)
        np.testing.assert_array_equal(a.events, b.events)
        np.testing.assert_array_equal(a.q, b.q)

    def test_invalid_machines_are_refused(self):
        one, contact = [[1.0]], sprag.Contact([1.0], 0.5)
        beam = sprag.Beam(3)
        model = sprag.Model(one, one, one, [contact])
        wrong = {
            "modes": lambda: sprag.Beam(0),
            "restitution": lambda: sprag.Contact([1.0], 1.1),
            "w": lambda: sprag.Contact([0.0], 0.5),
            "position": lambda: sprag.beam_contact(beam, 1.1, 0.5),
            "side": lambda: sprag.beam_contact(beam, 1.0, 0.5, side="left"),
            "no contact": lambda: sprag.beam_model(beam, []),
            "contact of another size": lambda: sprag.beam_model(beam, [contact]),
            "sizes": lambda: sprag.Model(one, np.eye(2), one, [contact]),
            "definite": lambda: sprag.Model([[0.0]], one, one, [contact]),
            "no damping": lambda: sprag.Model(one, None, one, [contact]),
            "two dampings": lambda: sprag.Model(one, one, one, [contact], damping_ratio=0.1),
            "sizes of damping": lambda: sprag.Model(
                one, None, one, [contact], damping_ratio=[0.1, 0.2]
            ),
            "negative damping": lambda: sprag.Model(one, None, one, [contact], damping_ratio=-0.1),
            "two dampings of a beam": lambda: sprag.Beam(2, damping=0.1, damping_ratio=0.1),
            "law": lambda: sprag.Model(one, one, one, [contact], law="none"),
            "start": lambda: sprag.Scene(model, master=sprag.State(q=[1.0, 2.0])),
            "inside": lambda: sprag.Scene(model, master=sprag.State(q=[-1.0])),
            "jitter": lambda: sprag.Scene(model, jitter=-1.0),
        }
        for name, call in wrong.items():
            with self.subTest(name), self.assertRaises(ValueError):
                call()
