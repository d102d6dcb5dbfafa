"""Classes of the package are values: they pickle, compare equal, and show themselves in a line."""

import copy
import pickle
import unittest

import numpy as np

import sprag
from sprag import _core
from sprag._studies import study_from_rows

from support import scene

# Open connections and running observers.
NO_VALUES = {"Observer", "EventPublisher", "EstimateListener"}


def examples() -> list[object]:
    """At least one value of each class but LiveEstimate, which only a bus makes."""
    beam = scene()
    rig = scene("lab_rig").replace(jitter=1e-5)
    events = sprag.simulate(rig, 8.0).events
    run = sprag.simulate(beam, 5.0)
    estimates = sprag.observe(beam, run.events, 5.0)
    observer = sprag.Observer(beam)
    assessment = sprag.check(beam)
    diagnosis = sprag.diagnose(rig, events)
    smoothed = sprag.smooth(rig, events, 2.0, tick=0.001)
    wrong = sprag.observe(rig, events[::3], 2.0, tick=0.001)
    recorded = scene("swept_beam")
    two_modes = sprag.reduce(beam, sprag.simulate(beam, 30.0).events, 2)
    return [
        beam.beam,
        beam.model,
        beam.model.contacts[0],
        beam.master,
        beam.tolerance,
        beam,
        sprag.Harmonic(1.0, 2.0, 3.0),
        sprag.Force([1.0, 2.0], 3.0),
        sprag.Output("tip", [1.0, 0.0]),
        recorded,
        recorded.records[0],
        rig.replace(parameters={"impact.restitution": 0.01}).parameters,
        in_modes().kept,
        run,
        estimates,
        observer.at(0.0),
        sprag.energies(beam, run.q, run.u, estimates.q, estimates.u),
        assessment,
        assessment.findings[0],
        diagnosis,
        diagnosis.candidates[0],
        smoothed,
        smoothed.stretches[0],
        wrong.inconsistencies[0],
        sprag.predict(rig, events, 1.0, 0.5),
        sprag.identify(rig, events, free=["impact.restitution"]),
        two_modes,
        two_modes[0],
        sprag.tolerance(rig, runs=1, duration=2.0, estimators=["replica"]),
        study_from_rows(["index,point,run,x,failure", "0,0,0,nan,late", "1,1,0,2,"], {"name": "x"}),
    ]


def in_modes() -> sprag.Scene:
    M = np.diag([1.0, 2.0])
    model = sprag.Model(M, 0.1 * M, 4.0 * M, [sprag.Contact([1.0, 1.0], 0.5)])
    return sprag.Scene(model, master=sprag.State([1.0, 0.0]), modes=1)


def made_here() -> list[sprag.Scene]:
    """Scenes that no file describes."""
    frame = sprag.Harmonic(0.03, 9.5, 0.1)
    push = sprag.Force([1.0, 0.5], 2.0, sprag.Harmonic(0.1, 3.0))
    outputs = [sprag.Output("tip", [1.0, 0.0], unit="m"), sprag.Output("v", [0.0, 1.0], True)]
    contacts = [sprag.Contact([1.0, 1.0], 0.5, 0.1), sprag.Contact([0.0, 1.0], 0.6, motion=frame)]
    M, K = [[1.0, 0.2], [0.2, 0.8]], [[300.0, -120.0], [-120.0, 200.0]]
    system = sprag.Model(M, None, K, contacts, [push], "newton", outputs, rayleigh=(0.1, 0.001))
    start = sprag.State([0.01, 0.0], [0.0, -0.2])
    sigma = sprag.State([0.1, 0.2], [0.3, 0.4])
    whole = sprag.Scene(system, name="whole", master=start, replica=start, uncertainty=[0.3, 0.3])
    on_frame = sprag.Scene(
        system, name="frame", excitation=frame, influence=1.0, mount=["ground", "frame"]
    )
    resting = [sprag.Contact([1.0, 1.0], 0.5, 0.1), sprag.Contact([0.0, 1.0], 0.6)]
    shaken = sprag.Scene(
        sprag.Model(M, None, K, resting, damping_ratio=0.01),
        name="shaken",
        excitation=frame,
        influence=[1.0, 0.5],
        mount=["frame", "ground"],
    )
    return [
        on_frame,
        shaken,
        whole.replace(name="all", sigma=sigma, drift=1e-7, jitter=1e-5),
        scene("lab_rig").replace(
            tolerance=sprag.Tolerance(time=1e-4), parameters={"impact.restitution": 0.01}
        ),
    ]


class ValuesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.examples = examples()

    def test_every_class_has_an_example(self):
        names = {name for name in vars(_core) if not name.startswith("_")}
        classes = {name for name in names if isinstance(getattr(_core, name), type)}
        seen = {type(of).__name__ for of in self.examples}
        self.assertEqual(classes - seen, NO_VALUES | {"LiveEstimate"})

    def test_pickles_are_equal(self):
        for value in self.examples:
            with self.subTest(type(value).__name__):
                back = pickle.loads(pickle.dumps(value))
                self.assertIsNot(back, value)
                self.assertEqual(back, value)
                self.assertEqual(hash(back), hash(value))
                self.assertEqual(copy.deepcopy(value), value)
                self.assertNotEqual(value, 1)

    def test_pickles_keep_every_bit(self):
        state = pickle.loads(pickle.dumps(sprag.State([-0.0, np.nan, np.inf], [1 / 3, 5e-324, 0])))
        self.assertEqual(state.q.tobytes(), np.array([-0.0, np.nan, np.inf]).tobytes())
        self.assertEqual(state.u.tobytes(), np.array([1 / 3, 5e-324, 0.0]).tobytes())

    def test_values_differ_by_each_member(self):
        self.assertEqual(sprag.State([0.0], [1.0]), sprag.State([-0.0], [1.0]))
        self.assertNotEqual(sprag.State([0.0], [1.0]), sprag.State([0.0], [2.0]))
        self.assertNotEqual(scene(), scene().replace(jitter=1e-5))
        self.assertNotEqual(scene(), scene("lab_rig"))
        self.assertNotEqual(sprag.Harmonic(1.0), sprag.Harmonic(1.0, 1.0))

    def test_damaged_pickles_are_refused(self):
        version, state = sprag.Harmonic(1.0).__getstate__()
        harmonic = sprag.Harmonic.__new__(sprag.Harmonic)
        with self.assertRaisesRegex(ValueError, "too short"):
            harmonic.__setstate__((version, state[:-1]))
        with self.assertRaisesRegex(ValueError, "another version"):
            harmonic.__setstate__(("0.0.1", state))

    def test_repr_is_one_line(self):
        for value in self.examples:
            with self.subTest(type(value).__name__):
                self.assertRegex(repr(value), rf"^<sprag\.{type(value).__name__} [^\n]+>$")
                self.assertLessEqual(len(repr(value)), 160)

    def test_html_is_escaped(self):
        for value in self.examples:
            with self.subTest(type(value).__name__):
                self.assertRegex(value._repr_html_(), "^<(table|pre)>")
        hostile = sprag.Output("<script>", [1.0])
        self.assertIn("&lt;script&gt;", hostile._repr_html_())
        self.assertNotIn("<script>", hostile._repr_html_())

    def test_text_of_a_scene_is_the_scene(self):
        for of in made_here():
            with self.subTest(of.name):
                self.assertEqual(sprag.parse_scene(sprag.to_toml(of)), of)
