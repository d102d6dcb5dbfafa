"""The examples of the tutorials run, and find what they say.

They are scripts in python/examples, one for each tutorial; that of Python consists of scripts.
"""

import contextlib
import io
import os
import re
import subprocess
import sys
import unittest

from support import BUILD, SOURCE, FolderTest, free_url, multicast_works

EXAMPLES = SOURCE / "python" / "examples"
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


class ExamplesTest(FolderTest):
    def printed(self, name: str, **environment: str) -> str:
        path = {"PATH": f"{BUILD}:{os.environ['PATH']}"}
        done = subprocess.run(
            [sys.executable, EXAMPLES / f"{name}.py"],
            cwd=self.folder,
            env={**os.environ, **path, **environment},
            capture_output=True,
            text=True,
        )
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    def number(self, pattern: str, text: str) -> float:
        found = re.search(pattern, text)
        self.assertIsNotNone(found, text)
        return float(found[1])

    def test_paper_beam(self):
        printed = self.printed("paper_beam")
        self.assertIn("synchronizes: True\n33 impacts, the first at t = 0.4565\n", printed)
        self.assertLess(self.number(r"t =  5.0: .* default (\S+)", printed), 1e-20)

    def test_own_machine(self):
        printed = self.printed("own_machine")
        self.assertIn("synchronizes: False\n30 bounces\nfits: True", printed)
        self.assertAlmostEqual(
            self.number(r"impact.restitution: (\S+)", printed), 0.9487, delta=0.001
        )

    def test_arduino(self):
        printed = self.printed("arduino")
        self.assertIn("time_us,contact,level\n", printed)
        self.assertLess(self.number(r"times within (\S+) us", printed), 1.0)
        self.assertLess(self.number(r"q is within (\S+) um", printed), 5.0)

    @unittest.skipUnless(multicast_works(), "multicast does not work on this host")
    @unittest.skipUnless((BUILD / "sprag").exists(), "the programs are not built")
    def test_live(self):
        printed = self.printed("live", SPRAG_URL=free_url())
        self.assertGreater(self.number(r"(\d+) settled", printed), 100)
        self.assertLess(self.number(r"off by (\S+)", printed), 1e-6)

    def test_the_tutorial_of_python(self):
        """But for its first example, which is that of the package's README."""
        text = (SOURCE / "docs/tutorials/python.md").read_text(encoding="utf-8")
        compared = 0
        parts = re.split(r"^```python\n", text, flags=re.M)[1:]
        self.assertEqual(len(parts), 5)
        for part in parts[1:]:
            code, rest = part.split("\n```", 1)
            with self.subTest(code):
                printed = io.StringIO()
                with contextlib.chdir(self.folder), contextlib.redirect_stdout(printed):
                    exec(code, {"__name__": "__main__"})
                said = re.match(r"\n+It prints\n\n```\n(.*?)^```", rest, flags=re.M | re.S)
                if not said:
                    continue
                compared += 1
                self.assertEqual(NUMBER.sub("#", printed.getvalue()), NUMBER.sub("#", said[1]))
                numbers = [
                    [float(x) for x in NUMBER.findall(of)] for of in (printed.getvalue(), said[1])
                ]
                for a, b in zip(*numbers):
                    # Numpy's random numbers and rounding may differ between versions.
                    self.assertLessEqual(abs(a - b), 0.5 * abs(b))
        self.assertEqual(compared, 1)
