"""The type stubs match the package, by mypy if it is installed."""

import enum
import importlib.util
import inspect
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import sprag

from support import BUILD, SOURCE


USE = """\
import sprag

scene = sprag.read_scene("paper_beam")
run = sprag.simulate(scene, 5.0)
fit = sprag.identify(scene, run.events, free="impact.restitution", within={"system.K": 0.1})
seen = sprag.observe(scene, [(0.1, 1, 3)], 5.0, tick=0.1).q @ scene.model.M
ball = sprag.Model([[1.0]], None, [[1.0]], [sprag.Contact([1.0], 0.5)], damping_ratio=0.1)
with sprag.EventPublisher(1, key=None) as publisher:
    publisher.take(0.1)
sprag.smooth(fit.fitted, run.events, 1.0)  # it may be None
sprag.read_scene(3)
scene.jitter = 0.1
publisher.tak(0.1)
print(scene.excitation.phase)  # it may be None
"""
WRONG = [10, 11, 12, 13, 14]


@unittest.skipUnless(importlib.util.find_spec("mypy"), "mypy is not installed")
class TypesTest(unittest.TestCase):
    def test_the_package_is_typed_and_errors_of_users_are_found(self):
        cache = str(BUILD / "mypy_cache")
        settings = ["--config-file", str(SOURCE / "pyproject.toml"), "--cache-dir", cache]
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "use.py"
            file.write_text(USE)
            command = [sys.executable, "-m", "mypy", *settings, "sprag", str(file)]
            done = subprocess.run(command, cwd=BUILD / "python", capture_output=True, text=True)
        found = re.findall(r"^(.*?):(\d+): error", done.stdout, flags=re.M)
        wrong = [("use.py", str(line)) for line in WRONG]
        self.assertEqual(
            [(Path(at).name, line) for at, line in found], wrong, done.stdout + done.stderr
        )


def members(of: object) -> list[str]:
    return [name for name in vars(of) if not name.startswith("_")]


class DocstringsTest(unittest.TestCase):
    def test_public_names_and_members_have_docstrings(self):
        public = {name: getattr(sprag, name) for name in sprag.__all__}
        documented = {name: of for name, of in public.items() if callable(of)}
        for name, of in public.items():
            if inspect.isclass(of) and not issubclass(of, (enum.Enum, Exception)):
                documented |= {f"{name}.{member}": vars(of)[member] for member in members(of)}
            elif inspect.ismodule(of):
                for member in getattr(of, "__all__", members(of)):
                    function = getattr(of, member)
                    if callable(function) and function.__module__ == of.__name__:
                        documented[f"{name}.{member}"] = function
        self.assertGreater(len(documented), 200)
        for name, of in documented.items():
            with self.subTest(name):
                self.assertTrue(of.__doc__)
