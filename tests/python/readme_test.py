"""The examples of the package's README run unchanged."""

import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

from support import SOURCE, readme_examples

try:
    import matplotlib
except ImportError:
    matplotlib = None


def run(block: str, *, without: str = "") -> tuple[str, list[str]]:
    """Its output, and the files that it makes."""
    refusal = f"import sys; sys.modules[{without!r}] = None\n" if without else ""
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, "-c", refusal + block],
            cwd=folder,
            capture_output=True,
            text=True,
        )
        if done.returncode != 0:
            raise AssertionError(done.stderr)
        made = sorted(file.name for file in Path(folder).iterdir())
        return done.stdout, made


class ReadmeTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.blocks = readme_examples()
        text = (SOURCE / "python" / "README.md").read_text()
        cls.printed = re.search(r"^It prints\n\n```\n(.*?)^```", text, flags=re.M | re.S)[1]

    def test_the_tutorial_has_the_first_example(self):
        text = (SOURCE / "docs/tutorials/python.md").read_text(encoding="utf-8")
        parts = text.split("```python\n")[1].split("```")
        self.assertEqual(parts[0].strip(), self.blocks[0].strip())
        self.assertEqual(parts[2].lstrip("\n"), self.printed)

    def test_the_first_example_prints_and_draws(self):
        printed, files = run(self.blocks[0])
        self.assertEqual(printed, self.printed)
        self.assertEqual(files, ["synchronization.png"] if matplotlib else [])

    def test_without_matplotlib_it_only_prints(self):
        printed, files = run(self.blocks[0], without="matplotlib")
        self.assertEqual(printed, self.printed)
        self.assertEqual(files, [])


class FrontPageTest(unittest.TestCase):
    def test_python_prints_what_cpp_prints(self):
        text = (SOURCE / "README.md").read_text(encoding="utf-8")
        block = re.search(r"^```python\n(.*?)^```", text, flags=re.M | re.S)[1]
        expected = re.search(r"^Both print\n\n```\n(.*?)^```", text, flags=re.M | re.S)[1]
        self.assertEqual(run(block), (expected, []))
