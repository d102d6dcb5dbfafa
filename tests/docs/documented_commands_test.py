"""The test of documented commands detects wrong markers, and commands that fail, hang or print
another output."""

import contextlib
import io
import tempfile
import time
import unittest
from pathlib import Path

import documented_commands as documented
from documented_commands import Failure


def page(*blocks: str) -> str:
    return "# Page\n\n" + "\n\nText.\n\n".join(blocks) + "\n"


def sh(text: str, marker: str = "") -> str:
    return (f"<!-- {marker} -->\n" if marker else "") + f"```sh\n{text}\n```"


def run(text: str, limit: float = 30.0) -> str:
    (block,) = documented.parse(text, "page.md")
    with tempfile.TemporaryDirectory() as folder:
        return documented.run(block, Path(folder), limit)


class MarkerTest(unittest.TestCase):
    def refused(self, text: str, *parts: str) -> None:
        with self.assertRaises(Failure) as caught:
            documented.check("page.md", text)
        for part in parts:
            self.assertIn(part, str(caught.exception))

    def test_reason_is_required(self):
        (block,) = documented.check("page.md", page(sh("true", "not run: needs a rig")))
        self.assertEqual(block.skip, "needs a rig")
        for marker in "not run:", "not run: ", "not run", "not run: -":
            self.refused(page(sh("true", marker)), "page.md:")

    def test_markers_are_known(self):
        for marker in (
            "run: needs",
            "run: needs a rig",
            "run: twice",
            "run: exits with x",
            "run: in parallel",
            "run:",
            "run",
        ):
            self.refused(page(sh("true", marker)), "page.md:")

    def test_every_command_is_found(self):
        self.refused(page("```bash\ntrue\n```"), "page.md:4", "```sh")
        self.refused(page("```\nbuild/sprag plot a.csv\n```"), "page.md:4", "```sh")
        self.refused(page("`build/tools/plot a.csv`"), "page.md:3", "build/sprag")
        self.refused(page("```sh\ntrue"), "page.md:4", "no end")

    def test_indentation_of_blocks_is_removed(self):
        (block,) = documented.parse(
            "* Item:\n\n  ```sh\n  cat << END\n  x\n  END\n  ```\n", "page.md"
        )
        self.assertEqual(block.text, "cat << END\nx\nEND")
        self.assertEqual(block.line, 4)


class RunTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        documented.namespace()

    def failed(self, text: str, *parts: str, limit: float = 30.0) -> None:
        with self.assertRaises(Failure) as caught:
            run(text, limit)
        for part in parts:
            self.assertIn(part, str(caught.exception))

    def test_output_is_returned(self):
        self.assertEqual(run(page(sh("echo one\necho two >&2"))), "one\ntwo\n")

    def test_failure_names_page_line_command_and_output(self):
        self.failed(
            page(sh("echo said\nfalse\necho after")), "page.md:4:", "exit code 1", "false", "said"
        )
        self.failed(page(sh("false | cat")), "exit code 1")
        self.failed(page(sh("echo $unset_variable")), "exit code 1")

    def test_exit_code_must_match_marker(self):
        run(page(sh("exit 3", "run: exits with 3")))
        self.failed(page(sh("exit 2", "run: exits with 3")), "exit code 2, not 3")
        self.failed(page(sh("true", "run: exits with 3")), "exit code 0, not 3")

    def test_hanging_block_is_killed_with_its_children(self):
        begin = time.monotonic()
        self.failed(page(sh("sleep 1000 &\nsleep 1000")), "does not end", limit=0.5)
        self.assertLess(time.monotonic() - begin, 900)

    def test_network_is_isolated_and_has_a_route(self):
        self.assertIn("224.0.0.0/4 dev lo", run(page(sh("ip route"))))
        self.assertNotIn("224.0.0.0", run(page(sh("ip route", "run: without a network"))))

    def test_parallel_commands_end_by_signal(self):
        wait = "bash -c 'trap \"exit 0\" INT; echo up; while true; do sleep 0.1; done'"
        printed = run(page(sh(f"{wait}   # one\n\n# comment\n{wait}", "run: in parallel for 1 s")))
        self.assertEqual(printed.count("up"), 2)
        self.failed(page(sh(f"{wait}\nfalse", "run: in parallel for 1 s")), "exit code 1: false")

    def test_continued_lines_are_one_command(self):
        (block,) = documented.parse(page(sh("a \\\n  b\nc")), "page.md")
        self.assertEqual(documented.commands(block), ["a b", "c"])


class OptionalPartTest(unittest.TestCase):
    def setUp(self):
        documented.namespace()
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.source = Path(folder.name) / "source"
        self.build = Path(folder.name) / "build"
        (self.build / "studies").mkdir(parents=True)
        self.source.mkdir()
        marked = sh("build/studies/exact", "run: needs build/studies/exact")
        (self.source / "page.md").write_text(page(sh("echo ran"), marked, sh("echo ran, too")))

    def run_page(self) -> tuple[bool, str]:
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            whole = documented.run_page(self.source, "page.md", self.build)
        return whole, printed.getvalue()

    def test_without_its_part_a_block_is_skipped_by_name_and_the_others_run(self):
        whole, printed = self.run_page()
        self.assertFalse(whole)
        self.assertIn("skipped: page.md:11 needs build/studies/exact", printed)
        self.assertIn("page.md:4: ", printed)
        self.assertIn("page.md:17: ", printed)

    def test_with_its_part_a_block_runs(self):
        program = self.build / "studies" / "exact"
        program.write_text("#!/bin/sh\nexit 1\n")
        program.chmod(0o755)
        with self.assertRaises(Failure):
            self.run_page()
        program.write_text("#!/bin/sh\nexit 0\n")
        self.assertTrue(self.run_page()[0])


class OutputTest(unittest.TestCase):
    def expect(self, lines: str, printed: str) -> None:
        documented.expect_output(documented.Block("page.md", 7, "text", lines.split("\n")), printed)

    def test_lines_are_compared_in_order_and_numbers_separately(self):
        self.expect("a 1.5 +- 2e-3\n...\nb -7", "x\na 2 +- 3.1\n  y\nb   8\n")
        for lines in "b\na", "a\nc", "a\na":
            with self.assertRaises(Failure):
                self.expect(lines, "a\nb\n")


if __name__ == "__main__":
    unittest.main()
