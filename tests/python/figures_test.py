"""Functions that draw results: sprag.plot and plot_study."""

import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

import sprag
from support import scene

STUDY = """scene = "lab_rig"
duration = 5.0
runs = 3
start.replica = 0.01
estimators = ["replica", "both"]
record = ["V_floor"]
[vary]
contact.1.restitution = [0.5, 0.6]
"""


def titles(figure) -> list[str]:
    return [axes.get_title(loc="left") for axes in figure.axes]


class PlotTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scene = scene("two_stops_beam")
        cls.machine = sprag.simulate(cls.scene, 10.0)
        cls.estimate = sprag.observe(cls.scene, cls.machine.events, 10.0)

    def test_the_modules_come_with_the_package(self):
        code = "import sprag, sys; assert 'sprag.plot' not in sys.modules; print(sprag.plot.states)"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        self.assertIn("function states", done.stdout, done.stderr)

    def test_curves_are_the_numbers(self):
        figure = sprag.plot.states(self.machine, self.scene, show=["g1"])
        gaps = self.scene.gaps(self.machine.t, self.machine.q)[:, 0]
        factor, unit = sprag.plot.readable_unit(np.abs(gaps).max(), "m")
        self.assertEqual(titles(figure), [f"Gap g1 [{unit}]"])
        curves = [line for line in figure.axes[0].get_lines() if line.get_label() == "machine"]
        t, g = curves[0].get_data()
        self.assertGreater(len(t), 100)
        np.testing.assert_allclose(np.interp(t, self.machine.t, factor * gaps), g, atol=1e-9)

    def test_all_that_results_show(self):
        impacts = sprag.impacts(self.scene, self.machine.events, 10.0)
        V = sprag.energies(
            self.scene, self.machine.q, self.machine.u, self.estimate.q, self.estimate.u
        )
        figure = sprag.plot.states(
            {"machine": self.machine, "estimate": self.estimate},
            self.scene,
            events=self.machine.events,
            impacts=impacts,
            V=V,
            title="run",
        )
        shown = " ".join(titles(figure))
        for title in ("Gap g1", "Gap g2", "Reported contacts", "Impulse", "Error energy"):
            self.assertIn(title, shown)
        with tempfile.TemporaryDirectory() as folder:
            figure.savefig(Path(folder) / "run.png")
        alone = sprag.plot.states(self.estimate, V=V.V, show=["q1", "V"])
        self.assertEqual(titles(alone), ["q1", "Error energy [J]"])
        with self.assertRaisesRegex(ValueError, "V has shape"):
            sprag.plot.states(self.estimate, V=V.V[1:])


class OthersTest(unittest.TestCase):
    def test_a_study_is_drawn(self):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "study.toml"
            file.write_text(STUDY)
            study = sprag.run_study(file, jobs=1)
        figure = sprag.plot_study.draw(study)
        self.assertIn("contact.1.restitution", figure.axes[0].get_xlabel())
        with self.assertRaises(sprag.Error):
            sprag.plot_study.draw(study, show=["nothing"])
