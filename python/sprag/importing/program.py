"""The program import_events: options, messages and outputs."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import functools
import math
import sys
import tomllib
from collections.abc import Callable, Iterator, Sequence
from typing import IO, Any

import numpy as np

from .. import _command
from .._command import EXIT_DONE, Parser, Read, SceneFile, UsageError, Written
from .._command import count, finite, names, positive, printable
from .._errors import Error, SceneError
from ..tables import MOST_CONTACTS
from .events import Columns, Imported, import_table
from .formats import located, read_file
from .hints import find_batches, hints_at_bounces
from .moments import moment, seconds_of_unit
from .tables import SEPARATORS, Table
from .times import EDGES, ArgumentError, Options, read_signal

DESCRIPTION = """\
Turns columns of time stamps or levels into contact events for observer --replay, or with --record
a signal into a record for a scene. Files: CSV, TSV, columns by blanks, LVM, VCD, .xlsx, .mat, .npy,
and .wav, whose onsets are impacts.
Impacts are pulses. A contact with a closing (--on) and an opening (--off) is a pulse if it is
shorter than --pulse-shorter-than, from its closing to its opening, else it is sustained. --debounce
comes first: closings that follow within this time after the last opening (impacts: after the last
impact) are bounces of the same contact, which closes at its first closing and opens at its last
opening. Times are t = (value - offset) * unit / rate. What is guessed, and rows that cannot be used
and are left out, are named on stderr."""

_MOST_PROBLEMS_SHOWN = 20
_HARDLY_A_RUN = 1e7  # [s]; later times are those of a clock, as since 1970


def _column(role: str, text: str) -> tuple[str, int | None, str]:
    """Role, contact if it is given, and name of a column, for the ``type`` of an option."""
    digits, equals, name = text.partition("=")
    if not (equals and digits.isdecimal() and digits.isascii()):
        return role, None, text
    return role, int(digits) if len(digits) < 10 else MOST_CONTACTS + 1, name


def _unit(text: str) -> str:
    if seconds_of_unit(text) is None or (text.isalpha() and text not in ("s", "ms", "us", "ns")):
        choices = ["s", "ms", "us", "ns", "a number of seconds > 0"]
        raise argparse.ArgumentTypeError(_command.choose(text, choices))
    return text


def _offset(text: str) -> str:
    with contextlib.suppress(ValueError):  # a date whose order --day-first may state
        if moment(text) is None:
            raise argparse.ArgumentTypeError(
                f"{text} is not allowed; must be a finite number or a time"
            )
    return text


def _separator(text: str) -> str:
    named = {",": "comma", ";": "semicolon", "\t": "tab", " ": "blank"}.get(text, text)
    if named not in SEPARATORS:
        choices = ["comma", "semicolon", "tab", "blank"]
        raise argparse.ArgumentTypeError(_command.choose(text, choices))
    return named


# Role of columns, and the text of its option.
_ROLES = {
    "impacts": "column of impact times; repeatable",
    "on": "column of times at which a contact closes; repeatable, each with an --off",
    "off": "column of times at which it opens",
    "level": "column of levels, high while the contact is closed; repeatable. Times are in "
    "--time. NAME@COLUMN=VALUE: of the rows in which COLUMN is VALUE",
}
# Option, metavar, type, default, text.
_VALUES: list[tuple[str, str, Callable[[str], Any], Any, str]] = [
    ("time", "NAME", str, None, "column of the levels' times"),
    ("threshold", "X", finite, None, "a level above X is high; without it levels are 0 and 1 or "
     "words, as on and off"),
    ("sample-rate", "F", positive, None, "rows without times are so many a second"),
    ("unit", "U", _unit, None, "unit of the times: s, ms, us, ns or its length in seconds; without "
     "it as the file says, else s"),
    ("offset", "T", _offset, "0", "time that is the machine's t = 0, in the unit and on the clock "
     "of the times"),
    ("rate", "R", positive, 1.0, "seconds of the clock of the times per second of the machine: "
     "1.0002 for a clock that is 200 ppm fast"),
    ("counter-bits", "N", count, None, "times are a counter of N bits that wraps"),
    ("debounce", "T", positive, 0.0, "merge closings of a contact that follow within T [s]"),
    ("pulse-shorter-than", "T", positive, 0.0, "take contacts shorter than T [s] as pulses, at "
     "their closing"),
    ("duration", "T", positive, math.inf, "leave out events after this time [s]; a log ends there"),
    ("columns", "NAME,...", names, None, "names of the columns of lines without a header line"),
    ("separator", "NAME", _separator, None, "comma, semicolon, tab or blank, if the lines do not "
     "show it"),
    ("skip-lines", "N", count, 0, "lines before the table"),
    ("record", "NAME", str, None, "write this column as a record for excitation.file or [[force]] "
     "file, not events; without SCENE"),
    ("output", "F.csv|F.lcmlog", Written, None, "write an events CSV or an LCM log here, not to "
     "stdout"),
]  # fmt: skip


def _parser() -> Parser:
    parser = Parser("import_events", DESCRIPTION)
    add = parser.add_argument
    add("file", metavar="FILE", type=Read, help="file with columns of times")
    text = "scene: a file (TOML), or the name of one that `sprag scenes` lists"
    add("scene", metavar="SCENE", type=SceneFile, nargs="?", help=text)
    for role, text in _ROLES.items():
        add(f"--{role}", metavar="[CONTACT=]NAME", type=functools.partial(_column, role),
            dest="chosen", action="append", help=text)  # fmt: skip
    for name, metavar, of_type, default, text in _VALUES:
        add(f"--{name}", metavar=metavar, type=of_type, default=default, help=text)
    add("--inverted", action="store_true", help="low while the contact is closed")
    text = "edges of the levels that are impacts; after --inverted, rising is where the level falls"
    add("--impacts-at", choices=list(EDGES), help=text)
    add("--any-order", action="store_true", help="sort the times of a column that go back")
    order = parser.add_mutually_exclusive_group()
    for name, value in ("day", True), ("month", False):
        order.add_argument(f"--{name}-first", dest="day_first", action="store_const", const=value,
                           help=f"dates as 5/3/2024 have the {name} first")  # fmt: skip
    return parser


def main() -> int:
    """Runs the program and returns its exit code."""
    return _command.run_program(_parser(), _run)


def _run(options: argparse.Namespace, report: dict[str, Any]) -> int:
    try:
        return _record(options) if options.record else _events(options, report)
    except ArgumentError as error:
        raise UsageError(f"{options.file}: {error}") from None


def _events(options: argparse.Namespace, report: dict[str, Any]) -> int:
    if options.scene is None:
        raise UsageError("SCENE is required, or --record NAME")
    if options.output and not options.output.endswith((".csv", ".lcmlog")):
        raise UsageError(f"--output is {options.output}; must end in .csv or .lcmlog")
    columns = _by_contact(options.chosen or [])
    contacts = _check_machine(options)
    columns.check(contacts)
    with _table(options) as table:
        imported = import_table(table, contacts, columns, _given(options))
    _report_import(imported, table, options.file, report)
    t = imported.events["t"]
    if not len(t):
        raise Error(f"{options.file}: no event is left")
    if _is_zero(options.offset) and (table.of_clock or t[0] > _HARDLY_A_RUN):
        _say("the first event comes late; --offset gives the time of the file at t = 0")
    if options.output and options.output.endswith(".lcmlog"):
        compiled = _command.require_compiled("writing an LCM log")
        end = 0.0 if math.isinf(options.duration) else options.duration
        with _command.written(options.output) as temporary:
            report["messages"] = compiled._write_contact_log(
                temporary, imported.events, contacts, end, options.key
            )
        return EXIT_DONE
    with _csv(options.output) as stream:
        stream.write("t,contact,closed\n")
        for at, contact, kind in imported.events.tolist():
            for closed in {1: "1", 2: "0"}.get(kind, "10"):
                stream.write(f"{at:.17g},{contact},{closed}\n")
    return EXIT_DONE


def _record(options: argparse.Namespace) -> int:
    if options.scene is not None:
        raise UsageError("--record needs no SCENE")
    if options.chosen:
        raise UsageError("--record makes no events; leave out --impacts, --on, --off and --level")
    if options.output and not options.output.endswith(".csv"):
        raise UsageError(f"--output is {options.output}; a record must end in .csv")
    with _table(options) as table:
        t, values = read_signal(table, options.record, _given(options))
    name = options.record.replace(",", " ").replace(";", " ").replace('"', "")
    with _csv(options.output) as stream:
        np.savetxt(
            stream, np.column_stack([t, values]), "%.17g", ",", header=f"t [s],{name}", comments=""
        )
    return EXIT_DONE


@contextlib.contextmanager
def _table(options: argparse.Namespace) -> Iterator[Table]:
    """The table. Prints what was guessed, also if it is refused in the end: it may be the cause."""
    table = read_file(options.file, options.columns, options.separator, options.skip_lines)
    try:
        with located(options.file):
            yield table
    finally:
        for text in [*table.remarks, *table.doubts]:
            _say(f"{options.file}: {text}")


def _given(options: argparse.Namespace) -> Options:
    return Options(**{f.name: getattr(options, f.name) for f in dataclasses.fields(Options)})


def _by_contact(columns: Sequence[tuple[str, int | None, str]]) -> Columns:
    """The columns; without numbers contacts are counted in order, each --off with its --on."""
    given = [contact is not None for _, contact, _ in columns]
    if any(given) and not all(given):
        raise UsageError(
            "some columns are given as CONTACT=NAME and some as NAME; must all be alike"
        )
    openers = [role for role, _, _ in columns if role != "off"]
    in_order = iter(range(1, len(openers) + 1))
    pairs = iter([i for i, role in enumerate(openers, 1) if role == "on"])
    by_role: dict[str, dict[int, str]] = {role: {} for role in _ROLES}
    for role, contact, name in columns:
        if contact is None:
            contact = next(pairs if role == "off" else in_order, None)
        if contact is None:
            raise UsageError(f"--off {name} has no --on")
        if contact in by_role[role]:
            raise UsageError(f"--{role} {name} is a second --{role} for contact {contact}")
        by_role[role][contact] = name
    return Columns(**by_role)


def _check_machine(options: argparse.Namespace) -> int:
    """Number of contacts of the scene. Refuses a rate that the scene's clock corrects as well."""
    file = _command.scene_file(options.scene)
    try:
        with open(file, "rb") as stream:
            scene = tomllib.load(stream)
    except OSError as error:
        raise SceneError(f"{file}: cannot be read: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise SceneError(f"{file}: is no TOML: {error}") from None
    contacts, clock = scene.get("contact"), scene.get("clock")
    if not isinstance(contacts, list) or not 1 <= len(contacts) <= MOST_CONTACTS:
        raise SceneError(f"{file}: must have 1 to {MOST_CONTACTS} [[contact]] tables")
    clock = clock if isinstance(clock, dict) else {}
    if options.rate != 1.0 and clock.get("rate", 1) != 1:
        raise UsageError(
            "--rate and clock.rate of the scene would correct the same clock twice; leave one of "
            "them out"
        )
    if not _is_zero(options.offset) and clock.get("offset", 0) != 0:
        _say("clock.offset of the scene counts in addition to --offset")
    return len(contacts)


def _is_zero(offset: str) -> bool:
    try:
        value = moment(offset)
    except ValueError:
        return False
    return value is not None and value[0] == 0


def _say(text: str) -> None:
    print(printable(text), file=sys.stderr)


def _report_import(imported: Imported, table: Table, file: str, report: dict[str, Any]) -> None:
    """Prints and reports bad rows, figures of the contacts, and hints."""
    for problem in table.problems[:_MOST_PROBLEMS_SHOWN]:
        _say(f"{file}:{problem}; left out")
    bad_rows = len(table.problems)
    if bad_rows > _MOST_PROBLEMS_SHOWN:
        _say(f"{file}: {bad_rows - _MOST_PROBLEMS_SHOWN} more bad rows left out")
    t, span = imported.events["t"], ""
    report["events"] = len(t)
    if len(t):
        report["first_t"], report["last_t"] = float(t[0]), float(t[-1])
        span = f" from t = {t[0]:g} to {t[-1]:g}"
    counts = ("contact", "pulses", "sustained", "merged")
    report["contacts"] = [{name: of[name] for name in counts} for of in imported.figures]
    for of in imported.figures:
        form = "contact {contact} has no events"
        if of["pulses"] + of["sustained"]:
            form = (
                "contact {contact}: {pulses} pulses, {sustained} sustained, {merged} bounces merged"
            )
        _say(form.format(**of))
    report["bad_rows"] = bad_rows
    early, late = (
        sum(of[n] for of in imported.figures) for n in ("before_start", "after_duration")
    )
    report["before_start"], report["after_duration"] = early, late
    _say(
        f"{len(t)} events{span}; left out: {bad_rows} bad rows, {early} events before t = 0, "
        f"{late} after the duration"
    )
    report["remarks"] = [*table.remarks, *table.doubts]
    report["hints"] = hints_at_bounces(imported.events, imported.figures)
    if batches := find_batches(imported.closings):
        report["hints"].append(batches.text(len(imported.closings)))
        report["batches"] = {"period": batches.period, "events": batches.events}
    for hint in report["hints"]:
        _say(hint)


@contextlib.contextmanager
def _csv(output: str | None) -> Iterator[IO[str]]:
    if not output:
        with _command.standard_output() as stream:
            yield stream
        return
    with _command.written(output) as temporary, _command.writing(output):
        with open(temporary, "w", encoding="utf-8") as stream:
            yield stream
