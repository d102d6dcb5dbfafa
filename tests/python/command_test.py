"""What the programs in Python have in common: files that they refuse to overwrite, and signals."""

from __future__ import annotations

import argparse
import math
import os
import signal
import subprocess
import unittest
from pathlib import Path
from typing import Any

from sprag import plot, report
from sprag import study as study_program
from sprag._command import Parser, run_program
from sprag.importing import program
from support import BUILD, FolderTest

SCENE = """name = "rig.csv"
[system]
M = "M.csv"
[[force]]
direction = [1, 0]
file = "base.csv"
"""
# A module that the programs import; it says which signal handlers there are, and waits.
SLOW_NUMPY = """import signal, time
print(repr(signal.getsignal(signal.SIGHUP)), flush=True)
time.sleep(60)
"""


class OverwriteTest(FolderTest):
    def test_files_that_a_scene_names_are_inputs(self) -> None:
        rig = self.file("rig/rig.toml", SCENE)
        study = self.file("study.toml", 'scene = "rig/rig.toml"\n[[vary]]\nkeys = ["rig.csv"]\n')
        events = self.file("events.csv", "t\n1\n")
        inputs = [self.file(f"rig/{name}.csv", "1,0\n0,1\n") for name in ("M", "base")]
        link = self.folder / "link.csv"
        link.symlink_to("rig/M.csv")
        for main, *arguments in [
            (program.main, events, rig),
            (report.main, rig, events, "--output", "a.html"),
            (plot.main, f"a machine={rig}", events, "--output", "a.png"),
            (study_program.main, study),
        ]:
            for output in [*inputs, str(link)]:
                with self.subTest(main, output=output):
                    done = self.run_main(main, *arguments, "--report", output, code=2)
                    self.assertIn("a file of SCENE", done.stderr)
                    self.assertIn("--report", done.stderr)
                    self.assertEqual(Path(output).read_text(), "1,0\n0,1\n")
        named = self.file("rig/rig.csv", "")  # the name of a scene is no file
        done = self.run_main(program.main, events, rig, "--report", named)
        self.assertNotIn("same file", done.stderr)


class SignalTest(FolderTest):
    def start(self, ignored: bool = False) -> subprocess.Popen[str]:
        """The program plot in its imports. Returns after these have begun."""
        self.file("numpy.py", SLOW_NUMPY)
        before = signal.getsignal(signal.SIGHUP)
        self.addCleanup(signal.signal, signal.SIGHUP, before)
        signal.signal(signal.SIGHUP, signal.SIG_IGN if ignored else signal.SIG_DFL)
        process = subprocess.Popen(
            [BUILD / "tools/plot", "states.csv", "--output", "a.png"],
            env={**os.environ, "PYTHONPATH": str(self.folder)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.addCleanup(process.communicate)
        self.addCleanup(process.kill)
        assert process.stdout
        self.handler = process.stdout.readline()
        return process

    def test_a_signal_ends_a_program_in_its_imports(self) -> None:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            with self.subTest(number.name):
                process = self.start()
                process.send_signal(number)
                _, err = process.communicate()
                self.assertEqual((process.returncode, err), (1, "plot: interrupted\n"))

    def test_an_ignored_hang_up_stays_ignored(self) -> None:
        self.start(ignored=True)
        self.assertIn("SIG_IGN", self.handler)
        self.assertIs(signal.getsignal(signal.SIGHUP), signal.SIG_IGN)
        handlers = []

        def run(options: argparse.Namespace, report: dict[str, Any]) -> int:
            handlers.append(signal.getsignal(signal.SIGHUP))
            return 0

        self.assertEqual(run_program(Parser("test", "A program."), run, []), 0)
        self.assertEqual(handlers, [signal.SIG_IGN])


class OutputTest(FolderTest):
    def test_standard_output_that_cannot_be_written_is_named(self) -> None:
        scene = self.file("rig.toml", "[[contact]]\n")
        many = "".join(f"{k}\n" for k in range(1, 20001))
        read_end, pipe = os.pipe()
        os.close(read_end)
        full = os.open("/dev/full", os.O_WRONLY)
        for text, output, reason in (
            ("t [s]\n" + many, full, "No space left on device"),
            ("t [s]\n" + many, pipe, "Broken pipe"),
        ):
            command = [BUILD / "tools/import_events", self.file("times.csv", text), scene]
            done = subprocess.run(command, stdout=output, stderr=subprocess.PIPE, text=True)
            self.assertEqual(done.returncode, 1, done.stderr)
            last = done.stderr.splitlines()[-1]
            self.assertEqual(last, f"import_events: standard output: {reason}")
        os.close(pipe)
        os.close(full)


class HelpTest(unittest.TestCase):
    def test_only_defaults_that_there_are_are_named(self) -> None:
        parser = Parser("test", "A program.")
        parser.add_argument("--rate", type=float, default=1.5, help="of a clock")
        parser.add_argument("--end", type=float, default=math.inf, help="of the run")
        parser.add_argument("--flag", action="store_true", help="for nothing")
        parser.add_argument("--show", action="extend", default=[], help="of names")
        text = parser.format_help()
        self.assertIn("of a clock (default: 1.5)", text)
        self.assertEqual(text.count("(default: "), 2, text)  # and --url
