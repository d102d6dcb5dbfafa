"""Runs the shell commands of a Markdown page as they stand, in a copy of the checkout.

usage: documented_commands.py SOURCE PAGE BUILD    runs the blocks ```sh of PAGE
       documented_commands.py SOURCE --list        checks all pages, lists the blocks not run

The blocks of a page run one after the other in one folder, a copy of the tracked files of SOURCE in
which build/ is the folder BUILD, each in a network of its own with a multicast route. A comment on
the line before a block specifies exceptions:

<!-- not run: REASON -->           it is left out
<!-- run: exits with N -->         its exit code is N, not 0
<!-- run: in parallel for N s -->  its commands run in parallel; SIGINT ends them after N s,
                                   all exit with 0
<!-- run: without a network -->    the network has neither a loopback interface nor a route
<!-- run: needs FILE -->           without FILE, of an optional part such as build/studies/NAME, it
                                   is skipped by name; in FILE, * stands for any characters

A block ```text after a block is its expected output: its lines occur in the output in the same
order, apart from numbers; a line ... stands for any lines. Exit code 77: blocks were skipped, and
the others run; or this host permits no network namespaces.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

SKIPPED = 77  # exit code
LIMIT = 900.0  # of a block [s]; only a block that hangs reaches it
SHELL = ["bash", "-euo", "pipefail", "-c"]
MARKER = re.compile(r"\s*<!-- (not run|run): *(.*?) *-->\s*$")
OLD_NAME = re.compile(r"build/(?:observer|master_sim|tools)/")
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


class Failure(Exception):
    pass


@dataclass
class Block:
    page: str
    line: int  # of its first line, from 1
    language: str
    lines: list[str] = field(default_factory=list)
    skip: str = ""  # reason for not running it
    exit_code: int = 0
    parallel: float = 0.0  # [s]; 0: one command after the other
    network: bool = True
    needs: str = ""  # file of an optional part

    @property
    def text(self) -> str:
        return "\n".join(self.lines)

    @property
    def place(self) -> str:
        return f"{self.page}:{self.line}"

    def read_marker(self, kind: str, what: str) -> None:
        if kind == "not run":
            if len(what) < 5:
                raise Failure(f"{self.place}: `not run` needs a reason: <!-- not run: REASON -->")
            self.skip = what
        elif found := re.fullmatch(r"exits with (\d+)", what):
            self.exit_code = int(found[1])
        elif found := re.fullmatch(r"in parallel for (\d+) s", what):
            self.parallel = float(found[1])
        elif what == "without a network":
            self.network = False
        elif found := re.fullmatch(r"needs ([\w.*/-]+)", what):
            self.needs = found[1]
        else:
            raise Failure(f"{self.place}: unknown marker `run: {what}`")


def parse(text: str, page: str) -> list[Block]:
    """The fenced blocks of a page with their markers."""
    blocks: list[Block] = []
    block = marker = None
    indent = 0
    for number, line in enumerate(text.split("\n"), start=1):
        if fence := re.match(r"( *)```(\w*)", line):
            if block is None:
                block = Block(page, number + 1, fence[2])
                indent = len(fence[1])
                if marker:
                    block.read_marker(*marker.groups())
            else:
                blocks.append(block)
                block = None
        elif block is not None:
            block.lines.append(line[indent:] if line[:indent].isspace() else line)
        marker = MARKER.match(line) if block is None else None
        if marker is None and block is None and re.match(r"\s*<!-- *(not )?run\b", line):
            raise Failure(
                f"{page}:{number}: marker `{line.strip()}`; must be <!-- run: HOW --> or "
                "<!-- not run: REASON -->"
            )
    if block is not None:
        raise Failure(f"{block.place}: the block has no end")
    return blocks


def commands(block: Block) -> list[str]:
    """The commands of a block, one per line, without lines that are comments."""
    joined = re.sub(r"\\\n\s*", "", block.text).split("\n")
    return [line for line in joined if line.strip() and not line.lstrip().startswith("#")]


def expect_output(expected: Block, printed: str) -> None:
    """Fails unless the lines of `expected` occur in the output in the same order, apart from
    numbers."""

    def shape(line: str) -> str:
        return " ".join(NUMBER.sub("#", line).split())

    rest = iter([shape(line) for line in printed.split("\n")])
    for offset, line in enumerate(expected.lines):
        if line.strip() in ("", "...", "…"):
            continue
        if shape(line) not in rest:  # leaves the iterator after the found line
            raise Failure(
                f"{expected.page}:{expected.line + offset}: the block before does not print, or "
                f"not here: {line}\nIt prints:\n{printed}"
            )


def isolated(block: Block, script: str) -> list[str]:
    prepare = "ip link set lo up && ip route add 224.0.0.0/4 dev lo && " if block.network else ""
    inner = f'{prepare}exec "$@"'
    return [*namespace(), "sh", "-c", inner, "sh", *SHELL, script]


def namespace() -> list[str]:
    for command in (["unshare", "--net"], ["unshare", "--map-root-user", "--net"]):
        try:
            if subprocess.run([*command, "ip", "link"], capture_output=True).returncode == 0:
                return command
        except OSError:
            break
    print("not permitted or not installed: unshare --net, ip")
    sys.exit(SKIPPED)


def end(process: subprocess.Popen) -> None:
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        pass


def run(block: Block, folder: Path, limit: float = LIMIT) -> str:
    """Runs a block in `folder` and returns its output on stdout and stderr."""
    environment = dict(os.environ, HOME=str(folder / "home"), LC_ALL="C.UTF-8")
    (folder / "home").mkdir(exist_ok=True)
    script = block.text
    if block.parallel > 0.0:
        # Python starts the commands, because a shell's background commands ignore SIGINT.
        script = (
            f'exec {sys.executable} {Path(__file__).resolve()} --parallel {block.parallel} "$@"'
        )
    command = isolated(block, script)
    if block.parallel > 0.0:
        command += ["sh", *commands(block)]
    with tempfile.TemporaryFile("w+", errors="replace") as output:
        process = subprocess.Popen(
            command,
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            start_new_session=True,
        )
        try:
            code = process.wait(limit)
        except subprocess.TimeoutExpired:
            code = None
        finally:
            end(process)
            process.wait()
        output.seek(0)
        printed = output.read()
    if code != block.exit_code:
        what = (
            f"does not end within {limit:g} s"
            if code is None
            else (f"ends with exit code {code}, not {block.exit_code}")
        )
        raise Failure(f"{block.place}: {what}\n{block.text}\nIt prints:\n{printed}")
    return printed


def run_parallel(duration: float, texts: list[str]) -> int:
    """Runs the commands in parallel, ends them by SIGINT after `duration` [s]; 0 if all exit with
    0."""
    processes = [subprocess.Popen([*SHELL, f"exec {text}"]) for text in texts]
    deadline = time.monotonic() + duration
    while time.monotonic() < deadline and any(process.poll() is None for process in processes):
        time.sleep(0.05)
    for process in processes:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
    codes = [process.wait() for process in processes]
    for text, code in zip(texts, codes):
        if code != 0:
            print(f"exit code {code}: {text}", flush=True)
    return int(any(codes))


def copy_checkout(source: Path, build: Path, folder: Path) -> None:
    listed = subprocess.run(["git", "-C", source, "ls-files", "-z"], capture_output=True, text=True)
    if listed.returncode == 0:
        names = [name for name in listed.stdout.split("\0") if name]
    else:  # a source archive
        found = [path.relative_to(source) for path in source.rglob("*") if path.is_file()]
        names = [
            str(name) for name in found if not re.fullmatch(r"build.*|out|\.git", name.parts[0])
        ]
    for name in names:
        if (source / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source / name, folder / name)
    # A folder of links, so that a command that writes into build/ does not write into BUILD.
    (folder / "build").mkdir()
    for entry in build.iterdir():
        if entry.name != "CMakeCache.txt":
            (folder / "build" / entry.name).symlink_to(entry)


def run_page(source: Path, page: str, build: Path) -> bool:
    """Runs the blocks of a page; False if some were skipped because an optional part is missing."""
    blocks = parse((source / page).read_text(encoding="utf-8"), page)
    if not any(block.language == "sh" for block in blocks):
        return True
    skipped = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        copy_checkout(source, build, folder)
        printed = None
        for block in blocks:
            if block.language == "text" and printed is not None:
                expect_output(block, printed)
            printed = None
            if block.language != "sh":
                continue
            if block.skip:
                print(f"{block.place}: not run: {block.skip}")
                continue
            if block.needs and not list(folder.glob(block.needs)):
                skipped.append(f"{block.place} needs {block.needs}")
                continue
            begin = time.monotonic()
            printed = run(block, folder)
            print(f"{block.place}: {time.monotonic() - begin:.1f} s", flush=True)
    if skipped:
        print(f"skipped: {', '.join(skipped)}")
    return not skipped


def pages_of(source: Path) -> list[str]:
    found = [
        path
        for pattern in ("*.md", "docs/**/*.md", "python/*.md")
        for path in sorted(source.glob(pattern))
    ]
    return [str(path.relative_to(source)) for path in found if path.name != "CHANGELOG.md"]


def check(page: str, text: str) -> list[Block]:
    """The blocks of a page; fails if a command is not in a block that tests run."""
    for number, line in enumerate(text.split("\n"), start=1):
        if OLD_NAME.search(line):
            raise Failure(f"{page}:{number}: write build/sprag PROGRAM: {line.strip()}")
    blocks = parse(text, page)
    for block in blocks:
        if block.language in ("bash", "shell", "console", "zsh"):
            raise Failure(f"{block.place}: a block of commands is ```sh, not ```{block.language}")
        if not block.language and re.match(
            r"\$ |(build/)?sprag |build/|scripts/|cmake ", block.text
        ):
            raise Failure(f"{block.place}: a block of commands is ```sh")
    return blocks


def main() -> int:
    arguments = sys.argv[1:]
    if arguments[:1] == ["--parallel"]:
        return run_parallel(float(arguments[1]), arguments[2:])
    if len(arguments) not in (2, 3):
        print(__doc__)
        return 2
    source = Path(arguments[0]).resolve()
    try:
        if arguments[1] != "--list":
            whole = run_page(source, arguments[1], Path(arguments[2]).resolve())
            return 0 if whole else SKIPPED
        for page in pages_of(source):
            blocks = check(page, (source / page).read_text(encoding="utf-8"))
            for block in blocks:
                if block.skip:
                    print(f"{block.place}: not run: {block.skip}")
                elif block.needs:
                    print(f"{block.place}: needs {block.needs}")
    except Failure as failure:
        print(failure)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
