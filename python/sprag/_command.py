"""What the programs in Python have in common: options, exit codes, messages, files and the report.

The counterpart of command_line/ in C++. A program is a function ``main()`` that calls
:func:`run_program` with its parser and its work.
"""

from __future__ import annotations

import argparse
import contextlib
import difflib
import importlib
import itertools
import json
import math
import os
import re
import signal
import sys
import tempfile
import tomllib
import unicodedata
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import FrameType, ModuleType
from typing import Any, NoReturn, TextIO

from ._errors import Error, InputError, ModelError, SceneError
from ._version import __version__

EXIT_DONE = 0
EXIT_FAILED = 1
EXIT_USAGE = 2

DEFAULT_URL = "udpm://239.255.76.67:7667?ttl=0"


class UsageError(Error):
    """Bad usage that is detected after parsing; the program exits with 2."""


class Interrupted(BaseException):
    """SIGINT, SIGTERM or SIGHUP arrived."""


class Read(str):
    """Name of a file that the program reads."""


class SceneFile(Read):
    """Name of a scene or a study, whose files the program reads as well."""


class Written(str):
    """Name of a file that the program writes."""


class Labelled(str):
    """``[LABEL=]FILE``: a file that the program reads, with the name of what it shows."""

    @property
    def file(self) -> Read:
        label, separator, file = self.partition("=")
        return Read(file if separator and not os.path.exists(self) else self)

    @property
    def label(self) -> str:
        return self[: -len(self.file) - 1] if len(self.file) < len(self) else ""


class _HelpFormatter(argparse.ArgumentDefaultsHelpFormatter):
    """Names the default of an option, if there is one."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        if action.default in (None, False, "", [], math.inf):
            return action.help
        return super()._get_help_string(action)


class Parser(argparse.ArgumentParser):
    """Options that all programs have; errors and help in the form of the programs in C++."""

    def __init__(self, program: str, description: str) -> None:
        super().__init__(
            prog=program,
            description=description,
            allow_abbrev=False,
            formatter_class=_HelpFormatter,
        )
        add = self.add_argument
        add("--version", action="version", version=f"{program} {__version__}")
        add("--url", metavar="LCM_URL", default=DEFAULT_URL, help="LCM address")
        text = "sign all messages, and accept only signed ones"
        add("--key", metavar="FILE", type=Read, help=text)
        text = "write the run's figures to this file"
        add("--report", metavar="FILE.json", type=Written, help=text)

    def format_help(self) -> str:
        formatter = self._get_formatter()
        formatter.add_usage(self.usage, self._actions, self._mutually_exclusive_groups, "Usage: ")
        for group in self._action_groups:
            formatter.start_section((group.title or "").capitalize())
            formatter.add_arguments(group._group_actions)
            formatter.end_section()
        return f"{self.description}\n{formatter.format_help()}"

    def error(self, message: str) -> NoReturn:
        self.exit(EXIT_USAGE, f"{printable(message)}\nRun with --help for more information.\n")


def positive(text: str) -> float:
    """A finite number > 0, for the ``type`` of an option."""
    value = finite(text)
    if value <= 0.0:
        raise argparse.ArgumentTypeError(f"{text} is not allowed; must be a number > 0")
    return value


def finite(text: str) -> float:
    """A finite number, for the ``type`` of an option."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text} is not allowed; must be a finite number")
    return value


def count(text: str, most: int | None = None) -> int:
    """A whole number from 1 on, at most `most`, for the ``type`` of an option."""
    if not re.fullmatch(r"\d{1,9}", text) or not 1 <= int(text) <= (most or int(text)):
        allowed = ">= 1" if most is None else f"from 1 to {most}"
        raise argparse.ArgumentTypeError(f"{text} is not allowed; must be a whole number {allowed}")
    return int(text)


def jobs(text: str) -> int:
    """A number of threads, for the ``type`` of an option."""
    return count(text, 1024)


def names(text: str) -> list[str]:
    """Names separated by commas, for the ``type`` of an option."""
    return [name for name in (part.strip() for part in text.split(",")) if name]


def choose(given: str, choices: Sequence[str]) -> str:
    """Message about an invalid choice: ``kalman; choose replica, timing or both``."""
    head = ", ".join(choices[:-1])
    return f"{given}; choose {head + ' or ' if head else ''}{choices[-1]}"


def counted(number: int, noun: str) -> str:
    """1 event, 2 events."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def finite_number(value: object) -> float | None:
    """A finite number of a JSON text; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    try:
        return float(value) if math.isfinite(value) else None
    except OverflowError:
        return None


def printable(text: str) -> str:
    """`text` as one line without characters that a terminal would interpret."""
    return "".join(_escaped(character) for character in text)


def _escaped(character: str) -> str:
    code = ord(character)
    if 0xDC80 <= code <= 0xDCFF:  # a byte that is not valid UTF-8, by surrogateescape
        return f"\\x{code - 0xDC00:02x}"
    if unicodedata.category(character) in ("Cc", "Cf", "Cn", "Cs", "Zl", "Zp"):
        short = {"\n": "\\n", "\t": "\\t", "\r": "\\r"}.get(character)
        return short or (f"\\x{code:02x}" if code < 0x80 else f"\\u{code:04x}")
    return character


def scenes_folder() -> Path | None:
    """Folder of the scenes that are shipped with this package; None if there is none."""
    for folder in Path(__file__).absolute().parents:
        scenes = folder / "share" / "sprag" / "scenes"
        if scenes.is_dir():
            return scenes
    return None


def is_scene(given: str) -> bool:
    """Whether a file of a command line is a scene: SCENE.toml, or a name that is no file."""
    suffix = os.path.splitext(given)[1]
    return suffix == ".toml" or (not suffix and not _is_file(given))


def scene_file(given: str) -> Read:
    """File of a scene that is given by its file or by its name among the shipped ones.

    A folder of that name does not hide the scene.
    """
    if _is_file(given):
        return Read(given)
    folder = scenes_folder()
    if folder is None:
        raise SceneError(f"{given}: cannot be read: no such file")
    if re.fullmatch(r"[\w-]+", given) and os.path.isfile(folder / f"{given}.toml"):
        return Read(folder / f"{given}.toml")
    shipped = sorted(file.stem for file in folder.glob("*.toml"))
    problem = f"{given}: cannot be read: no such file, and none of this name in {folder}"
    if near := difflib.get_close_matches(given.removesuffix(".toml"), shipped, n=1):
        raise SceneError(f"{problem}; did you mean {near[0]}?")
    raise SceneError(choose(problem, shipped))


def _is_file(given: str) -> bool:
    return os.path.exists(given) and not os.path.isdir(given)


def say(program: str, message: str) -> None:
    """A message of the program to stderr."""
    print(f"{program}: {printable(message)}", file=sys.stderr, flush=True)


def require(module: str, package: str, purpose: str) -> ModuleType:
    """Imports a module of an optional package.

    Raises Error with the command that installs it: `package` is the name of Debian's package.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name != module.partition(".")[0]:
            raise
        raise Error(
            f"{purpose} needs the Python package {module.partition('.')[0]}; "
            f"install it: apt install {package}"
        ) from None


def require_compiled(purpose: str) -> ModuleType:
    """The compiled part of this package. Raises Error with its Debian package if it is missing."""
    try:
        return importlib.import_module("._core", __package__)
    except ModuleNotFoundError:
        raise Error(
            f"{purpose} needs the compiled part of the Python package sprag; install python3-sprag "
            "or build with SPRAG_PYTHON"
        ) from None


@contextlib.contextmanager
def written(file: str | os.PathLike[str]) -> Iterator[Path]:
    """Path of a temporary file that replaces `file` when the block ends without an exception.

    An existing file stays as it is until then. A device or a pipe is written directly.
    """
    target = Path(os.path.realpath(file))
    if target.exists() and not target.is_file():
        yield target
        return
    try:
        handle, name = tempfile.mkstemp(
            prefix=f".{target.stem}.", suffix=target.suffix, dir=target.parent
        )
    except OSError as error:
        raise OSError(f"{file}: cannot be written: {error.strerror}") from None
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        mode = target.stat().st_mode & 0o777 if target.exists() else 0o666 & ~_umask()
        temporary.chmod(mode)
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def writing(file: str) -> Iterator[None]:
    """Adds the name of a file to errors without one, such as those of a full disk."""
    try:
        yield
    except OSError as error:
        if error.strerror is None or error.filename is not None:
            raise
        raise OSError(f"{file}: {error.strerror}") from None


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def run_program(
    parser: Parser,
    run: Callable[[argparse.Namespace, dict[str, Any]], int],
    arguments: Sequence[str] | None = None,
) -> int:
    """Parses the command line and calls ``run(options, report)``. Returns the exit code.

    `run` fills the report, which ``--report`` writes, and returns an exit code. Exit code 2: bad
    usage, InputError, SceneError, ModelError, or an output that would overwrite another file of
    the command line, and then nothing is opened. Exit code 1: any other failure, or a signal.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    options = parser.parse_intermixed_args(given)
    program = parser.prog
    if clash := _overwritten(parser, options):
        say(program, clash)
        return EXIT_USAGE
    report: dict[str, Any] = {"program": program, "version": __version__, "command": given}
    error = ""
    try:
        with _signals_raise():
            code = run(options, report)
            with standard_output():
                pass  # what print() has kept back
    except Interrupted:
        error, code = "interrupted", EXIT_FAILED
    except (UsageError, InputError, SceneError, ModelError) as what:
        error, code = str(what), EXIT_USAGE
    except (Error, OSError) as what:
        error, code = str(what), EXIT_FAILED
    if error:
        say(program, error)
        report["error"] = error
    report["exit"] = code
    if options.report and not _write_report(program, options.report, report):
        return EXIT_FAILED
    return code


@contextlib.contextmanager
def standard_output() -> Iterator[TextIO]:
    """sys.stdout. Raises Error if it cannot be written, as a pipe that nobody reads."""
    try:
        yield sys.stdout
        sys.stdout.flush()
    except OSError as error:
        # Python flushes it again at exit, and would fail again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise Error(f"standard output: {error.strerror}") from None


def _write_report(program: str, file: str, report: dict[str, Any]) -> bool:
    try:
        with written(file) as temporary:
            lines = json.dumps(report, indent=2, ensure_ascii=False).split("\n")
            temporary.write_text("\n".join(map(printable, lines)) + "\n", encoding="utf-8")
    except OSError as error:
        say(program, str(error))
        return False
    return True


@contextlib.contextmanager
def _signals_raise() -> Iterator[None]:
    def stop(number: int, frame: FrameType | None) -> NoReturn:
        raise Interrupted

    numbers = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # as after nohup
        numbers.append(signal.SIGHUP)
    before = {number: signal.signal(number, stop) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _overwritten(parser: Parser, options: argparse.Namespace) -> str:
    """Describes the first output that would overwrite another file of the command line."""
    files: list[tuple[str, str, bool]] = []
    in_scenes: list[tuple[str, str, bool]] = []
    for action in parser._actions:
        value = getattr(options, action.dest, None)
        name = action.option_strings[-1] if action.option_strings else action.metavar or action.dest
        for item in value if isinstance(value, list) else [value]:
            if not isinstance(item, (Read, Written, Labelled)):
                continue
            file = str(item.file if isinstance(item, Labelled) else item)
            files.append((str(name), file, isinstance(item, Written)))
            if isinstance(item, SceneFile) or (
                isinstance(item, Labelled) and file.endswith(".toml")
            ):
                in_scenes += [("a file of SCENE", named, False) for named in _files_of_scene(file)]
    for (name, file, is_written), (other, second, other_is_written) in itertools.combinations(
        files + in_scenes, 2
    ):
        if (is_written or other_is_written) and same_file(file, second):
            if file == second:
                return f"{name} and {other} are the same file, {file}"
            return f"{name} {file} and {other} {second} are the same file"
    return ""


def _files_of_scene(given: str) -> list[str]:
    """The files that a scene names; those of a study, and of its scene.

    None of a scene that cannot be read, which the program says itself.
    """
    found: list[str] = []
    waiting: list[str] = [given]
    while waiting:
        try:
            file = Path(scene_file(waiting.pop()))
            texts = _texts(tomllib.loads(file.read_text("utf-8") if file.is_file() else ""))
            named = [str(file.parent / text) for text in texts]
        except (SceneError, OSError, ValueError, RecursionError):
            continue
        named = [other for other in named if os.path.isfile(other)]
        waiting += [other for other in named if other.endswith(".toml") and other not in found]
        found += named
    return found


def _texts(value: object) -> Iterator[str]:
    """The texts in a TOML value except names, titles and units, which are no files."""
    if isinstance(value, dict):
        value = [v for key, v in value.items() if key not in ("name", "title", "unit")]
    if isinstance(value, list):
        for item in value:
            yield from _texts(item)
    elif isinstance(value, str):
        yield value


def same_file(a: str | os.PathLike[str], b: str | os.PathLike[str]) -> bool:
    """Whether writing one of two files would destroy the other."""
    if os.path.exists(a) and not os.path.isfile(a):  # writing does not destroy a device or a pipe
        return False
    if os.path.exists(a) and os.path.exists(b) and os.path.samefile(a, b):
        return True
    return os.path.realpath(a) == os.path.realpath(b)
