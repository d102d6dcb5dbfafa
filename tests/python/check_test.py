"""check() gives the result of the program check_scene."""

import json
import os
import subprocess
import unittest

import sprag

from support import BUILD, SOURCE, scene


def program(name: str, *options: str):
    done = subprocess.run(
        [os.environ["CHECK_SCENE"], str(SOURCE / "scenes" / f"{name}.toml"), *options],
        capture_output=True,
        text=True,
    )
    return done.returncode, done.stdout


class CheckTest(unittest.TestCase):
    def test_equals_output_of_the_program(self):
        for name, synchronizes in [("paper_beam", True), ("bouncing_ball", False)]:
            with self.subTest(name):
                check = sprag.check(scene(name))
                self.assertIs(check.synchronizes, synchronizes)
                code, text = program(name)
                self.assertEqual(code, 0 if synchronizes else 3)
                self.assertEqual(str(check), text)
                printed = json.loads(program(name, "--json")[1])
                self.assertEqual(check.verdict, printed["verdict"])
                self.assertEqual(
                    [
                        (f.id, f.required, f.holds, f.what, f.provided, f.change)
                        for f in check.findings
                    ],
                    [tuple(finding.values()) for finding in printed["findings"]],
                )

    def test_failed_findings_name_a_change(self):
        broken = [
            f for f in sprag.check(scene("bouncing_ball")).findings if f.required and not f.holds
        ]
        self.assertGreater(len(broken), 0)
        for finding in broken:
            self.assertNotEqual(finding.change, "")

    def test_number_of_modes_needed(self):
        self.assertIsNone(sprag.check(scene("paper_beam")).modes_needed)
        command = [BUILD / "tools/reduce", SOURCE / "scenes/stiff_beam.toml"]
        options = ["--json", "--accuracy", "0.01"]
        printed = subprocess.run([*command, *options], capture_output=True, check=True).stdout
        check = sprag.check(scene("stiff_beam"), accuracy=0.01)
        self.assertEqual(check.modes_needed, json.loads(printed)["modes"])
        with self.assertRaises(ValueError):
            sprag.check(scene("paper_beam"), accuracy=0.0)


if __name__ == "__main__":
    unittest.main()
