"""The program import_events with the other programs: messages, exit codes and files."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import subprocess
import unittest
import unittest.mock
from pathlib import Path

from sprag.importing import program
from support import SOURCE, FolderTest, ended

SCENES = SOURCE / "scenes"
BEAM = str(SCENES / "paper_beam.toml")
COMPILED = importlib.util.find_spec("sprag._core") is not None
HEAD = "t,contact,closed\n"


class ProgramTest(FolderTest):
    """The program within this process; Program.import_events starts it as a user does."""

    def run_import(
        self, *arguments: str, code: int | None = None
    ) -> subprocess.CompletedProcess[str]:
        report = ("--report", self.path("report.json"))
        return self.run_main(program.main, *report, *arguments, code=code)

    def report(self) -> dict:
        return json.loads((self.folder / "report.json").read_text())

    def replay(self, recording: str, more: str = "") -> bytes:
        files = f"{BEAM} --replay {recording} --states states.csv --events used.csv"
        ended(self.folder, "OBSERVER", f"{files} --tick 0.01 {more}")
        return (self.folder / "states.csv").read_bytes()

    def test_impacts_on_another_clock_are_restored(self) -> None:
        options = "--events original.csv --duration 100 --speed max --no-lcm"
        ended(self.folder, "MASTER_SIM", f"{BEAM} {options}")
        lines = (self.folder / "original.csv").read_text().split()
        rows = [line.split(",") for line in lines[1:]]
        pulses = [
            a[0] for a, b in zip(rows, rows[1:]) if a[0] == b[0] and (a[2], b[2]) == ("1", "0")
        ]
        self.assertGreater(len(pulses), 100)
        expected = HEAD + "".join(f"{t},1,1\n{t},1,0\n" for t in pulses)
        text = "\ufeffNr.;Impact [ms]\r\n"
        for i, t in enumerate(pulses):
            # In milliseconds on a clock that is ahead, digit by digit.
            whole, digits = f"{float(t):.24f}".split(".")
            text += f'{i};"{int(whole) + 1732190400}{digits[:3]},{digits[3:]}"\r\n'
        arguments = (
            self.file("rig.csv", text), BEAM, "--impacts", "Impact [ms]", "--offset",
            "1732190400000",
        )  # fmt: skip
        done = self.run_import(*arguments)
        self.assertEqual((done.returncode, done.stdout), (0, expected), done.stderr)
        self.assertIn("times in ms, as column 'Impact [ms]' says", done.stderr)
        self.assertEqual(self.report()["contacts"][0]["pulses"], len(pulses))
        if COMPILED:
            done = self.run_import(*arguments, "--output", self.path("rig.lcmlog"), code=0)
            states = self.replay(self.file("events.csv", expected))
            self.assertEqual(self.replay(self.path("rig.lcmlog")), states)
            self.assertEqual((self.folder / "used.csv").read_text(), expected)

    @unittest.skipUnless(COMPILED, "no _core")
    def test_a_signed_log_is_read_only_with_the_key(self) -> None:
        key = self.file("key", "a" * 64 + "\n")
        log = self.path("rig.lcmlog")
        done = self.run_import(
            self.file("rig.csv", "t\n0.5\n1\n"), BEAM, "--key", key, "--output", log
        )
        self.assertEqual(done.returncode, 0, done.stderr)
        used = self.folder / "used.csv"
        self.replay(log, f"--key {key}")
        self.assertEqual(used.read_text(), HEAD + "0.5,1,1\n0.5,1,0\n1,1,1\n1,1,0\n")
        self.replay(log)
        self.assertEqual(used.read_text(), HEAD)

    @unittest.skipUnless(COMPILED, "no _core")
    def test_bounces_are_reported(self) -> None:
        capture = "".join(
            f"{0.05 * k + 5e-5 * edge:.6f},{1 - edge % 2}\n"
            for k in range(1, 41)
            for edge in range(6)
        )
        file = self.file("capture.csv", capture)
        done = self.run_import(file, BEAM, "--level", "level", code=2)
        self.assertIn("--columns NAME,...", done.stderr)
        arguments = ("--columns", "time,level", file, BEAM, "--level", "level")
        done = self.run_import(*arguments)
        self.assertIn("120 of 120 sustained contacts last less than 0.001 s", done.stderr)
        self.assertIn("longer than a twentieth of the period of the scene's fastest", done.stderr)
        self.assertEqual(len(self.report()["hints"]), 1)
        done = self.run_import(*arguments, "--debounce", "1e-3", "--pulse-shorter-than", "1e-3")
        self.assertEqual(self.report()["contacts"][0]["pulses"], 40)
        self.assertEqual(self.report()["hints"], [])

    @unittest.skipUnless(COMPILED, "no _core")
    def test_closings_and_openings_are_those_of_each_contact(self) -> None:
        file = self.file("rig.csv", "on;off;stop;go\n1;2;1.25;1.5\n3;3.5;;\n")
        options = ("--on", "on", "--off", "off", "--on", "stop", "--off", "go")
        done = self.run_import(file, str(SCENES / "two_stops_beam.toml"), *options, code=0)
        expected = HEAD + "1,1,1\n1.25,2,1\n1.5,2,0\n2,1,0\n3,1,1\n3.5,1,0\n"
        self.assertEqual(done.stdout, expected)
        self.assertEqual([of["sustained"] for of in self.report()["contacts"]], [2, 1])

    def test_bad_rows_are_named_and_left_out(self) -> None:
        text = "t\n0.5\n" + "x\n1.5\n" * 25 + "1.75\n1.8\n"
        text = text.replace("1.5\n", "{:.2f}\n").format(*(1 + 0.01 * k for k in range(25)))
        done = self.run_import(self.file("rig.csv", text), BEAM, code=0)
        self.assertEqual(done.stdout.count(",1,1\n"), 28)
        self.assertIn("rig.csv:3: column t: x is neither a finite number nor a time", done.stderr)
        self.assertIn("rig.csv: 5 more bad rows left out", done.stderr)
        self.assertEqual(self.report()["bad_rows"], 25)

    def test_no_event_is_a_failure_without_output(self) -> None:
        output = self.path("events.csv")
        rig = self.file("rig.csv", "t\n1\n2\nx\n")
        done = self.run_import(rig, BEAM, "--offset", "5", "--output", output, code=1)
        self.assertIn("no event is left", done.stderr)
        self.assertFalse(Path(output).exists())
        self.assertEqual(self.report()["before_start"], 2)

    def test_a_late_first_event_is_reported(self) -> None:
        rig = self.file("rig.csv", "t\n1732190400.5\n")
        self.assertIn("--offset", self.run_import(rig, BEAM).stderr)
        self.assertNotIn("--offset", self.run_import(rig, BEAM, "--offset", "1732190400").stderr)

    def test_bad_usage_and_input_exit_with_2(self) -> None:
        rig = self.file("rig.csv", "impact,on,off\n1,2,3\n")
        fast = self.file("fast.toml", Path(BEAM).read_text() + "\n[clock]\nrate = 1.0002\n")
        named = (rig, BEAM, "--impacts", "impact")
        for arguments, said in [
            ((), "FILE"), ((rig,), "SCENE is required"), ((self.path("no"), BEAM), "No such file"),
            ((str(self.folder), BEAM), "Is a directory"), ((rig, "absent.toml"), "absent.toml"),
            ((rig, BEAM), "name the columns with --impacts"), ((rig, rig), "is no TOML"),
            ((rig, BEAM, "--impacts", "impcat"), "did you mean 'impact'?"),
            ((rig, BEAM, "--impacts", "2=impact"), "the scene has 1 contact"),
            ((rig, BEAM, "--impacts", "impact", "--impacts", "on"), "for contact 2"),
            ((rig, BEAM, "--on", "on"), "--on without --off"),
            ((rig, BEAM, "--off", "on"), "no --on"),
            ((*named, "--impacts", "1=on"), "must all be alike"),
            ((*named, "--unit", "min"), "min; choose s, ms, us, ns or a number of seconds > 0"),
            ((*named, "--offset", "5/3/2024 1:00:00"), "first? --day-first or --month-first says"),
            ((*named, "--offset", "nan"), "a finite number"), ((*named, "--debounce", "0"), "> 0"),
            ((*named, "--separator", "x"), "x; choose comma, semicolon, tab or blank"),
            ((*named, "--output", "x.txt"), ".csv or .lcmlog"),
            ((*named, "--output", rig), "FILE and --output are the same file"),
            ((rig, fast, "--impacts", "impact", "--rate", "1.1"), "the same clock twice"),
            ((rig, BEAM, "--record", "on"), "--record needs no SCENE"),
        ]:  # fmt: skip
            with self.subTest(said):
                self.assertIn(said, self.run_import(*arguments, code=2).stderr)
        self.assertEqual(Path(rig).read_text(), "impact,on,off\n1,2,3\n")

    def test_a_signal_becomes_a_record(self) -> None:
        text = "Zeit [ms];a [g]\n0,0;1,0\n2,0;2,5\n4,0;1,0\n6,0;0,0\n"
        output = self.path("base.csv")
        file = self.file("rig.csv", text)
        done = self.run_import(file, "--record", "a [g]", "--output", output, code=0)
        record = "t [s],a [g]\n0,1\n0.002,2.5\n0.0040000000000000001,1\n0.0060000000000000001,0\n"
        self.assertEqual(Path(output).read_text(), record)
        gap = self.file("gap.csv", text.replace("2,5", ""))
        done = self.run_import(gap, "--record", "a [g]", code=2)
        self.assertIn("gap.csv:3: a sample has no value", done.stderr)

    def test_a_scene_names_the_command_that_converts_its_record(self) -> None:
        scene = (SCENES / "swept_beam.toml").read_text()
        scene = re.sub("(?m)^file = .*", 'file = "base.txt"', scene)
        scene = re.sub("(?m)^(time|acceleration) = .*\n", "", scene)
        rows = [f"{k}ms {0.1 * (k % 7):.1f}" for k in range(100)]
        self.file("base.txt", "\n".join(["time acceleration", *rows]) + "\n")
        command = [
            os.environ["MASTER_SIM"], self.file("rig.toml", scene), "--no-lcm", "--speed", "max",
            "--duration", "0.01",
        ]  # fmt: skip
        refused = subprocess.run(command, capture_output=True, text=True, cwd=self.folder)
        self.assertEqual(refused.returncode, 2)
        advice = re.search(
            r"sprag import_events (\S+base.txt --record NAME .*csv) ", refused.stderr
        )
        self.assertTrue(advice, refused.stderr)
        arguments = advice[1].replace("NAME", "acceleration").split()
        self.run_import(*arguments, code=0)
        self.file("rig.toml", scene.replace("base.txt", "RECORD.csv"))
        accepted = subprocess.run(command, capture_output=True, text=True, cwd=self.folder)
        self.assertEqual(accepted.returncode, 0, accepted.stderr)

    def test_a_missing_compiled_part_is_named(self) -> None:
        capture = self.file("capture.csv", "Time [s],D0\n0,0\n1,1\n2,0\n")
        with unittest.mock.patch.dict("sys.modules", {"sprag._core": None}):
            done = self.run_import(capture, BEAM, "--level", "D0", code=1)
        self.assertIn("install python3-sprag", done.stderr)
