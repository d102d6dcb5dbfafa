"""Common parts of the tests."""

from __future__ import annotations

import contextlib
import io
import os
import re
import socket
import sys
import tempfile
import unittest
import unittest.mock
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess, run

import sprag

SOURCE = Path(os.environ["SPRAG_SOURCE_DIR"])
BUILD = Path(os.environ["SPRAG_BUILD_DIR"])


class FolderTest(unittest.TestCase):
    """Tests with a temporary folder."""

    def setUp(self) -> None:
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = Path(temporary.name)

    def path(self, name: str) -> str:
        return str(self.folder / name)

    def file(self, name: str, text: str | bytes) -> str:
        (self.folder / name).parent.mkdir(exist_ok=True)
        (self.folder / name).write_bytes(text.encode() if isinstance(text, str) else text)
        return self.path(name)

    def run_main(
        self, main: Callable[[], int | None], *arguments: object, code: int | None = None
    ) -> CompletedProcess[str]:
        """Runs a program in this process and in the folder; without a new start of Python.

        Fails if its exit code is not `code`.
        """
        command = ["program", *map(str, arguments)]
        out, err = io.StringIO(), io.StringIO()
        with (
            unittest.mock.patch.object(sys, "argv", command),
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
            contextlib.chdir(self.folder),
        ):
            try:
                exit_code = main()
            except SystemExit as ended:
                exit_code = ended.code if isinstance(ended.code, int) else int(bool(ended.code))
        done = CompletedProcess(command, exit_code or 0, out.getvalue(), err.getvalue())
        if code is not None:
            self.assertEqual(done.returncode, code, f"{command}: {done.stderr}")
        return done


def ended(folder: Path, program: str, arguments: str) -> str:
    """Runs a program of the build tree, such as OBSERVER, in a folder. Returns what it prints."""
    command = [os.environ[program], *arguments.split()]
    done = run(command, capture_output=True, text=True, cwd=folder)
    assert done.returncode == 0, done.stderr
    return done.stdout


def scene(name: str = "paper_beam") -> sprag.Scene:
    return sprag.read_scene(SOURCE / "scenes" / f"{name}.toml")


def readme_examples() -> list[str]:
    text = (SOURCE / "python" / "README.md").read_text()
    return re.findall(r"^```python\n(.*?)^```", text, flags=re.M | re.S)


def write_events(file: Path, events) -> None:
    """In the form of an events file: a pulse is two rows."""
    rows = {1: [1], 2: [0], 3: [1, 0]}
    with file.open("w") as csv:
        csv.write("t,contact,closed\n")
        for t, contact, kind in events.tolist():
            for closed in rows[kind]:
                csv.write(f"{t!r},{contact},{closed}\n")


def free_url() -> str:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        return f"udpm://239.255.76.67:{probe.getsockname()[1]}?ttl=0"


def multicast_works() -> bool:
    try:
        sprag.EstimateListener(url=free_url())
    except sprag.BusError:
        return False
    return True
