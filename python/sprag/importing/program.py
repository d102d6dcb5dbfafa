"""The program import_events: options, messages and outputs."""

from __future__ import annotations

import argparse
import contextlib
import sys
import tomllib
from collections.abc import Iterator, Sequence
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from .._command import (
    EXIT_DONE,
    Parser,
    Read,
    SceneFile,
    UsageError,
    Written,
    choose,
    count,
    finite,
    names,
    positive,
    printable,
    require_compiled,
    run_program,
    scene_file,
    standard_output,
    written,
)
from .._errors import Error, SceneError
from .events import EDGES, LARGEST_CONTACT, Columns, Figures, Imported, Levels, Rules, import_table
from .formats import located, read_file
from .hints import find_batches, hints_at_bounces
from .moments import moment, seconds_of_unit
from .record import read_signal, write_record
from .tables import SEPARATORS, Table
from .times import ArgumentError, Clock

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


class _ColumnOption(argparse.Action):
    """Collects --impacts, --on, --off and --level in the order of the command line."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        given = getattr(namespace, self.dest) or []
        setattr(namespace, self.dest, [*given, ((option_string or "").lstrip("-"), values)])


def _unit(text: str) -> str:
    if seconds_of_unit(text) is None or (text.isalpha() and text not in ("s", "ms", "us", "ns")):
        choices = ["s", "ms", "us", "ns", "a number of seconds > 0"]
        raise argparse.ArgumentTypeError(choose(text, choices))
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
        raise argparse.ArgumentTypeError(choose(text, ["comma", "semicolon", "tab", "blank"]))
    return named


def _parser() -> Parser:
    parser = Parser("import_events", DESCRIPTION)
    parser.add_argument("file", metavar="FILE", type=Read, help="file with columns of times")
    parser.add_argument(
        "scene",
        metavar="SCENE",
        type=SceneFile,
        nargs="?",
        help="scene: a file (TOML), or the name of one that `sprag scenes` lists",
    )
    add = parser.add_argument
    for name, text in [
        ("--impacts", "column of impact times; repeatable"),
        ("--on", "column of times at which a contact closes; repeatable, each with an --off"),
        ("--off", "column of times at which it opens"),
        ("--level", "column of levels, high while the contact is closed; repeatable. Times are in "
         "--time. NAME@COLUMN=VALUE: of the rows in which COLUMN is VALUE"),
    ]:  # fmt: skip
        add(name, metavar="[CONTACT=]NAME", dest="chosen", action=_ColumnOption, help=text)
    add("--time", metavar="NAME", help="column of the levels' times")
    add(
        "--threshold",
        metavar="X",
        type=finite,
        help="a level above X is high; without it levels are 0 and 1 or words, as on and off",
    )
    add("--inverted", action="store_true", help="low while the contact is closed")
    add("--impacts-at", choices=EDGES, help="edges of the levels that are impacts; after "
        "--inverted, rising is where the level falls")  # fmt: skip
    add("--sample-rate", metavar="F", type=positive, help="rows without times are so many a second")
    add("--unit", metavar="U", type=_unit, help="unit of the times: s, ms, us, ns or its length in "
        "seconds; without it as the file says, else s")  # fmt: skip
    add("--offset", metavar="T", type=_offset, default="0", help="time that is the machine's t = "
        "0, in the unit and on the clock of the times")  # fmt: skip
    add("--rate", metavar="R", type=positive, default=1.0, help="seconds of the clock of the times "
        "per second of the machine: 1.0002 for a clock that is 200 ppm fast")  # fmt: skip
    add("--counter-bits", metavar="N", type=count, help="times are a counter of N bits that wraps")
    order = parser.add_mutually_exclusive_group()
    order.add_argument("--day-first", action="store_true", default=None,
                       help="dates as 5/3/2024 have the day first")  # fmt: skip
    order.add_argument("--month-first", dest="day_first", action="store_false", default=None,
                       help="they have the month first")  # fmt: skip
    add("--any-order", action="store_true", help="sort the times of a column that go back")
    add("--debounce", metavar="T", type=positive, default=0.0,
        help="merge closings of a contact that follow within T [s]")  # fmt: skip
    add("--pulse-shorter-than", metavar="T", type=positive, default=0.0,
        help="take contacts shorter than T [s] as pulses, at their closing")  # fmt: skip
    add("--duration", metavar="T", type=positive, default=np.inf,
        help="leave out events after this time [s]; a log ends there")  # fmt: skip
    add("--columns", metavar="NAME,...", type=names,
        help="names of the columns of lines without a header line")  # fmt: skip
    add("--separator", metavar="NAME", type=_separator,
        help="comma, semicolon, tab or blank, if the lines do not show it")  # fmt: skip
    add("--skip-lines", metavar="N", type=count, default=0, help="lines before the table")
    add("--record", metavar="NAME", help="write this column as a record for excitation.file or "
        "[[force]] file, not events; without SCENE")  # fmt: skip
    add("--output", metavar="F.csv|F.lcmlog", type=Written,
        help="write an events CSV or an LCM log here, not to stdout")  # fmt: skip
    return parser


def main() -> int:
    """Runs the program and returns its exit code."""
    return run_program(_parser(), _run)


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
    columns = columns_by_contact(options.chosen or [])
    levels = Levels(
        options.time,
        options.threshold,
        options.inverted,
        options.impacts_at,
        options.sample_rate,
    )
    contacts = _check_machine(options)
    columns.check(contacts)
    table = _table(options)
    rules = Rules(options.debounce, options.pulse_shorter_than, options.duration)
    with _said(options.file, table), located(options.file):
        imported = import_table(table, contacts, columns, _clock(options), levels, rules)
    _print_problems(options.file, imported)
    _print_summary(imported)
    _fill(imported, report)
    _print_hints(imported, report)
    if not len(imported.events):
        raise Error(f"{options.file}: no event is left")
    late = imported.of_clock or imported.events["t"][0] > _HARDLY_A_RUN
    if _is_zero(options.offset) and late:
        _say("the first event comes late; --offset gives the time of the file at t = 0")
    _write(options, imported.events, contacts, report)
    return EXIT_DONE


def _record(options: argparse.Namespace) -> int:
    if options.scene is not None:
        raise UsageError("--record needs no SCENE")
    if options.chosen:
        raise UsageError("--record makes no events; leave out --impacts, --on, --off and --level")
    if options.output and not options.output.endswith(".csv"):
        raise UsageError(f"--output is {options.output}; a record must end in .csv")
    table = _table(options)
    with _said(options.file, table), located(options.file):
        t, values = read_signal(
            table, options.record, options.time, options.sample_rate, _clock(options)
        )
    with _csv(options.output) as stream:
        write_record(stream, options.record, t, values)
    return EXIT_DONE


def _table(options: argparse.Namespace) -> Table:
    return read_file(options.file, options.columns, options.separator, options.skip_lines)


def _clock(options: argparse.Namespace) -> Clock:
    return Clock(
        options.unit,
        options.offset,
        options.rate,
        options.counter_bits,
        options.day_first,
        options.any_order,
    )


def columns_by_contact(options: Sequence[tuple[str, str]]) -> Columns:
    """The columns of options (role, text), where text is NAME or CONTACT=NAME.

    Without numbers contacts are counted in the order of the options, each --off with its --on.
    """
    parts = [(role, *_split_contact(text)) for role, text in options]
    numbered = [part for part in parts if part[1] is not None]
    if numbered and len(numbered) < len(parts):
        raise UsageError(
            "some columns are given as CONTACT=NAME and some as NAME; must all be alike"
        )
    if not numbered:
        parts = list(_in_order(parts))
    by_role: dict[str, dict[int, str]] = {"impacts": {}, "on": {}, "off": {}, "level": {}}
    for role, contact, name in parts:
        assert contact is not None
        if contact in by_role[role]:
            raise UsageError(f"--{role} {name} is a second --{role} for contact {contact}")
        by_role[role][contact] = name
    return Columns(**by_role)


def _split_contact(text: str) -> tuple[int | None, str]:
    digits, equals, name = text.partition("=")
    if not (equals and digits.isdecimal() and digits.isascii()):
        return None, text
    return (int(digits) if len(digits) < 10 else LARGEST_CONTACT + 1), name


def _in_order(
    parts: Sequence[tuple[str, int | None, str]]
) -> Iterator[tuple[str, int | None, str]]:
    closers = iter([
        contact
        for contact, (role, _, _) in enumerate((p for p in parts if p[0] != "off"), 1)
        if role == "on"
    ])  # fmt: skip
    contact = 0
    for role, _, name in parts:
        if role == "off":
            pair = next(closers, None)
            if pair is None:
                raise UsageError(f"--off {name} has no --on")
            yield role, pair, name
        else:
            contact += 1
            yield role, contact, name


def _check_machine(options: argparse.Namespace) -> int:
    """Number of contacts of the scene. Refuses a rate that the scene's clock corrects as well."""
    file = scene_file(options.scene)
    try:
        with open(file, "rb") as stream:
            scene = tomllib.load(stream)
    except OSError as error:
        raise SceneError(f"{file}: cannot be read: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise SceneError(f"{file}: is no TOML: {error}") from None
    contacts = scene.get("contact")
    if not isinstance(contacts, list) or not 1 <= len(contacts) <= LARGEST_CONTACT:
        raise SceneError(f"{file}: must have 1 to {LARGEST_CONTACT} [[contact]] tables")
    clock = scene.get("clock", {})
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


@contextlib.contextmanager
def _said(file: str, table: Table) -> Iterator[None]:
    """Prints what was guessed, also if the file is refused in the end: it may be the cause."""
    try:
        yield
    finally:
        for text in [*table.remarks, *table.doubts]:
            _say(f"{file}: {text}")


def _print_problems(file: str, imported: Imported) -> None:
    problems = imported.problems
    for problem in problems[:_MOST_PROBLEMS_SHOWN]:
        _say(f"{file}:{problem}; left out")
    if len(problems) > _MOST_PROBLEMS_SHOWN:
        _say(f"{file}: {len(problems) - _MOST_PROBLEMS_SHOWN} more bad rows left out")


def _print_summary(imported: Imported) -> None:
    for of in imported.figures:
        if of.pulses + of.sustained == 0:
            _say(f"contact {of.contact} has no events")
            continue
        _say(
            f"contact {of.contact}: {of.pulses} pulses, {of.sustained} sustained, {of.merged} "
            "bounces merged"
        )
    t = imported.events["t"]
    span = f" from t = {t[0]:g} to {t[-1]:g}" if len(t) else ""
    _say(
        f"{len(t)} events{span}; left out: {len(imported.problems)} bad rows, "
        f"{_sum(imported.figures, 'before_start')} events before t = 0, "
        f"{_sum(imported.figures, 'after_duration')} after the duration"
    )


def _sum(figures: Sequence[Figures], name: str) -> int:
    return sum(getattr(of, name) for of in figures)


def _fill(imported: Imported, report: dict[str, Any]) -> None:
    t = imported.events["t"]
    report["events"] = len(t)
    if len(t):
        report["first_t"] = float(t[0])
        report["last_t"] = float(t[-1])
    report["contacts"] = [
        {
            "contact": of.contact,
            "pulses": of.pulses,
            "sustained": of.sustained,
            "merged": of.merged,
        }
        for of in imported.figures
    ]
    report["bad_rows"] = len(imported.problems)
    report["before_start"] = _sum(imported.figures, "before_start")
    report["after_duration"] = _sum(imported.figures, "after_duration")
    report["remarks"] = [*imported.remarks, *imported.doubts]


def _print_hints(imported: Imported, report: dict[str, Any]) -> None:
    hints = hints_at_bounces(imported.events, imported.figures)
    if batches := find_batches(imported.closings):
        hints.append(batches.text(len(imported.closings)))
        report["batches"] = {"period": batches.period, "events": batches.events}
    for hint in hints:
        _say(hint)
    report["hints"] = hints


@contextlib.contextmanager
def _csv(output: str | None) -> Iterator[IO[str]]:
    if not output:
        with standard_output() as stream:
            yield stream
        return
    try:
        with written(output) as temporary:
            with open(temporary, "w", encoding="utf-8") as stream:
                yield stream
    except OSError as error:
        raise Error(f"{output}: cannot be written: {error.strerror}") from None


def _write(
    options: argparse.Namespace,
    events: npt.NDArray[np.void],
    contacts: int,
    report: dict[str, Any],
) -> None:
    if options.output and options.output.endswith(".lcmlog"):
        compiled = require_compiled("writing an LCM log")
        end = 0.0 if np.isinf(options.duration) else options.duration
        with written(options.output) as temporary:
            report["messages"] = compiled._write_contact_log(
                temporary, events, contacts, end, options.key
            )
        return
    with _csv(options.output) as stream:
        stream.write("t,contact,closed\n")
        for t, contact, kind in events.tolist():
            if kind != 2:
                stream.write(f"{t:.17g},{contact},1\n")
            if kind != 1:
                stream.write(f"{t:.17g},{contact},0\n")
