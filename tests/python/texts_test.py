"""str() of a result is what the program prints."""

import json
import os
import subprocess
from pathlib import Path

import numpy as np

import sprag

from support import SOURCE, FolderTest, scene, write_events


def printed(name: str, *arguments: object) -> str:
    command = [os.environ[name], *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True).stdout


class TextsTest(FolderTest):
    def recorded(self, events: np.ndarray) -> Path:
        file = self.folder / "events.csv"
        write_events(file, events)
        return file

    def written(self, of: sprag.Scene) -> Path:
        file = self.folder / "scene.toml"
        sprag.write_scene(file, of)
        return file

    def test_identification(self):
        rig = scene("lab_rig")
        events = sprag.simulate(rig, 20.0).events
        late = events.copy()
        late["t"] += 2e-5 * np.random.default_rng(0).standard_normal(len(events))
        of_key = {"jitter": 2e-5, "free": ["impact.restitution"]}
        wrong = {"jitter": 1e-6, "free": ["system.K"], "within": {"system.K": 0.3}, "accept": True}
        for record, arguments, options in (
            (late, {"jitter": 2e-5, "within": 0.5}, "--jitter 2e-5 --within 0.5"),
            (np.delete(late, 30), of_key, "--jitter 2e-5 --free impact.restitution"),
            (late, wrong, "--jitter 1e-6 --free system.K --within system.K=0.3 --accept"),
        ):
            with self.subTest(options):
                fit = sprag.identify(rig, record, **arguments)
                events, file = self.recorded(record), self.written(rig)
                shown = printed("IDENTIFY", events, file, *options.split())
                self.assertEqual(str(fit), shown)
                self.assertTrue(str(fit).startswith(f"lab_rig: {fit.verdict}\n"), shown)
                self.assertTrue(fit.accepted)
                self.assertEqual(fit.fits, arguments is not wrong)

    def test_diagnosis(self):
        rig = scene("lab_rig")
        events = sprag.simulate(rig, 10.0).events
        for value in (rig.model.contacts[0].restitution, 0.5):
            with self.subTest(value):
                of = rig.with_values({"impact.restitution": value})
                diagnosis = sprag.diagnose(of, events, jitter=1e-5)
                file = self.written(of)
                shown = printed("DIAGNOSE", self.recorded(events), file, "--jitter", "1e-5")
                self.assertEqual(str(diagnosis), shown)
                self.assertIn(diagnosis.verdict, shown)
        self.assertFalse(diagnosis.fits)
        self.assertEqual(diagnosis.explanation.key, diagnosis.candidates[0].key)
        self.assertEqual(diagnosis.explanation.key, "impact.restitution")
        self.assertAlmostEqual(diagnosis.explanation.value, 0.6, delta=1e-3)

    def test_reduction(self):
        beam = scene("stiff_beam")
        events = sprag.simulate(beam, 60.0).events
        file = SOURCE / "scenes/stiff_beam.toml"
        shown = printed("REDUCE", self.recorded(events), file, "--modes", "3")
        reductions = sprag.reduce(beam, events, 3)
        self.assertEqual(str(reductions), shown)
        self.assertEqual(reductions[-1], list(reductions)[len(reductions) - 1])
        self.assertLess(reductions.begin, reductions.end)
        with self.assertRaises(IndexError):
            reductions[len(reductions)]
        self.assertEqual((reductions[0].modes, len(reductions[0].scene.master.q)), (3, 3))
        for modes in (0, 21):
            with self.assertRaises(ValueError):
                sprag.reduce(beam, events, modes)

    def test_assessment(self):
        for name in ("paper_beam", "bouncing_ball", "lab_rig"):
            file = SOURCE / "scenes" / f"{name}.toml"
            check = sprag.check(scene(name))
            with self.subTest(name):
                self.assertEqual(str(check), printed("CHECK_SCENE", file))
                of = json.loads(printed("CHECK_SCENE", file, "--json"))
                self.assertEqual(check.verdict, of["verdict"])
                self.assertIs(check.synchronizes, name != "bouncing_ball")
                names = ("id", "required", "holds", "what", "provided", "change")
                found = [[getattr(one, name) for name in names] for one in check.findings]
                self.assertEqual(found, [list(one.values()) for one in of["findings"]])
                for one in check.findings:
                    self.assertTrue(one.change or one.holds or not one.required, one)

    def test_number_of_modes_needed(self):
        self.assertIsNone(sprag.check(scene()).modes_needed)
        file = SOURCE / "scenes/stiff_beam.toml"
        of = json.loads(printed("REDUCE", file, "--json", "--accuracy", 0.1))
        self.assertEqual(sprag.check(scene("stiff_beam"), accuracy=0.1).modes_needed, of["modes"])
        with self.assertRaises(ValueError):
            sprag.check(scene(), accuracy=0.0)

    def test_uncertainties_of_a_scene(self):
        rig = scene("lab_rig")
        known = {"tolerance": sprag.Tolerance(time=1e-4), "parameters": {"system.K": 0.01}}
        uncertain = rig.replace(**known)
        check = sprag.check(uncertain)
        self.assertEqual(str(check), printed("CHECK_SCENE", self.written(uncertain)))
        self.assertIn("uncertain parameters: system.K", str(check))
        self.assertEqual(len(check.half_widths), max(len(rig.model.outputs), 1))
        self.assertIsNone(sprag.check(rig).half_widths)

    def test_names_are_printed_as_text(self):
        named = scene("lab_rig").replace(name="a\x1b[31m")
        self.assertTrue(str(sprag.check(named)).startswith("a\\x1b[31m: "))
