"""The examples of the tutorial run unchanged, and print what it says."""

import re
import subprocess
import sys
import tempfile
import unittest

from support import SOURCE

TEXT = (SOURCE / "docs/tutorials/python.md").read_text(encoding="utf-8")
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def blocks() -> list[tuple[str, str | None]]:
    """Each example and its output; None where the tutorial does not print it."""
    found = []
    parts = re.split(r"^```python\n", TEXT, flags=re.M)[1:]
    for part in parts:
        code, rest = part.split("\n```", 1)
        printed = re.match(r"\n+It prints\n\n```\n(.*?)^```", rest, flags=re.M | re.S)
        found.append((code, printed[1] if printed else None))
    return found


class TutorialTest(unittest.TestCase):
    def test_every_example_runs_and_prints_its_output(self):
        self.assertEqual(len(blocks()), 5)
        self.assertEqual(sum(printed is not None for _, printed in blocks()), 2)
        for i, (code, printed) in enumerate(blocks()):
            with self.subTest(i), tempfile.TemporaryDirectory() as folder:
                done = subprocess.run(
                    [sys.executable, "-c", code],
                    cwd=folder,
                    capture_output=True,
                    text=True,
                )
                self.assertEqual(done.returncode, 0, done.stderr)
                if printed is None:
                    continue
                self.assertEqual(NUMBER.sub("#", done.stdout), NUMBER.sub("#", printed))
                numbers = [[float(x) for x in NUMBER.findall(of)] for of in (done.stdout, printed)]
                for a, b in zip(*numbers):
                    # Numpy's random numbers and rounding may differ between versions.
                    self.assertLessEqual(abs(a - b), 0.5 * abs(b))


if __name__ == "__main__":
    unittest.main()
