"""The type stubs match the package, by mypy if it is installed."""

import importlib.util
import subprocess
import sys
import unittest

import sprag

from support import BUILD, SOURCE


@unittest.skipUnless(importlib.util.find_spec("mypy"), "mypy is not installed")
class StubsTest(unittest.TestCase):
    def mypy(self, *command: str):
        return subprocess.run(
            [sys.executable, "-m", *command], cwd=BUILD / "python", capture_output=True, text=True
        )

    def test_stubtest(self):
        allowed = SOURCE / "tests" / "python" / "stubtest_allowlist"
        done = self.mypy("mypy.stubtest", "sprag._core", "--allowlist", str(allowed))
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_the_package_is_typed(self):
        cache = str(BUILD / "mypy_cache")
        settings = ["--config-file", str(SOURCE / "pyproject.toml"), "--cache-dir", cache]
        done = self.mypy("mypy", *settings, "sprag")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)


class DocstringsTest(unittest.TestCase):
    def test_public_names_have_docstrings(self):
        for name in sprag.__all__:
            if not callable(getattr(sprag, name)):
                continue
            with self.subTest(name):
                self.assertTrue(getattr(sprag, name).__doc__)


if __name__ == "__main__":
    unittest.main()
