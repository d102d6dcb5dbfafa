"""The type stubs match the package, by mypy if it is installed."""

import enum
import importlib.util
import inspect
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


def public_members(of: object) -> list[str]:
    return [name for name in vars(of) if not name.startswith("_")]


class DocstringsTest(unittest.TestCase):
    def test_public_names_have_docstrings(self):
        for name in sprag.__all__:
            of = getattr(sprag, name)
            if not callable(of) and not inspect.ismodule(of):
                continue
            with self.subTest(name):
                self.assertTrue(of.__doc__)

    def test_members_of_public_classes_have_docstrings(self):
        classes = [of for of in map(sprag.__dict__.get, sprag.__all__) if inspect.isclass(of)]
        self.assertGreater(len(classes), 20)
        for of in classes:
            if issubclass(of, (enum.Enum, Exception)):
                continue
            for name in public_members(of):
                with self.subTest(f"{of.__name__}.{name}"):
                    self.assertTrue(vars(of)[name].__doc__)

    def test_functions_of_modules_have_docstrings(self):
        for module in (sprag.plot, sprag.plot_study, sprag.report, sprag.tables):
            for name in getattr(module, "__all__", public_members(module)):
                of = getattr(module, name)
                if getattr(of, "__module__", "") == module.__name__ and callable(of):
                    with self.subTest(f"{module.__name__}.{name}"):
                        self.assertTrue(of.__doc__)


if __name__ == "__main__":
    unittest.main()
