"""The scripts in python/examples, one for each tutorial, run and find what their tutorials find."""

import os
import re
import subprocess
import sys
import tempfile
import unittest


from support import BUILD, SOURCE, free_url, multicast_works

EXAMPLES = SOURCE / "python" / "examples"


def run(name: str, folder: str, **environment: str) -> str:
    """What the script prints."""
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / f"{name}.py")],
        cwd=folder,
        env={**os.environ, "PATH": f"{BUILD}:{os.environ['PATH']}", **environment},
        capture_output=True,
        text=True,
    )
    if done.returncode != 0:
        raise AssertionError(done.stderr)
    return done.stdout


class ExamplesTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def number(self, pattern: str, text: str) -> float:
        found = re.search(pattern, text)
        self.assertIsNotNone(found, text)
        return float(found[1])

    def test_each_tutorial_has_a_script_and_links_to_it(self):
        names = {file.stem for file in EXAMPLES.glob("*.py")}
        for page in (SOURCE / "docs/tutorials").glob("*.md"):
            if page.stem == "python":  # consists of scripts, which tutorial_test.py runs
                continue
            self.assertIn(page.stem, names)
            self.assertIn(f"python/examples/{page.stem}.py", page.read_text(encoding="utf-8"))

    def test_paper_beam(self):
        printed = run("paper_beam", self.folder)
        self.assertIn("synchronizes: True\n33 impacts, the first at t = 0.4565\n", printed)
        self.assertLess(self.number(r"t =  5.0: .* default (\S+)", printed), 1e-20)

    def test_own_machine(self):
        printed = run("own_machine", self.folder)
        self.assertIn("synchronizes: False\n30 bounces\nfits: True", printed)
        self.assertAlmostEqual(
            self.number(r"impact.restitution: (\S+)", printed), 0.9487, delta=0.001
        )

    def test_arduino(self):
        printed = run("arduino", self.folder)
        self.assertIn("time_us,contact,level\n", printed)
        self.assertLess(self.number(r"times within (\S+) us", printed), 1.0)
        self.assertLess(self.number(r"q is within (\S+) um", printed), 5.0)

    @unittest.skipUnless(multicast_works(), "multicast does not work on this host")
    @unittest.skipUnless((BUILD / "sprag").exists(), "the programs are not built")
    def test_live(self):
        printed = run("live", self.folder, SPRAG_URL=free_url())
        self.assertGreater(self.number(r"(\d+) settled", printed), 100)
        self.assertLess(self.number(r"off by (\S+)", printed), 1e-6)


if __name__ == "__main__":
    unittest.main()
