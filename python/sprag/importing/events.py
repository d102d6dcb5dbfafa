"""Contact events of a table: impacts, closings and openings, levels.

The rules for bounces, pulses and sustained contacts, and the edges of levels, are those of the
compiled library, which live sources use as well.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from .._command import require_compiled
from .._errors import InputError
from .moments import LEVEL_WORDS, NUMBER, number
from .tables import Problem, Table
from .times import ArgumentError, Clock, Floats, TimeReader, time_column

PULSE = 3
EVENT = np.dtype(  # event_dtype of the compiled part
    {
        "names": ["t", "contact", "kind"],
        "formats": ["<f8", "<i4", "i1"],
        "offsets": [0, 8, 12],
        "itemsize": 16,
    }
)
EDGES = ("rising", "falling", "both")
LARGEST_CONTACT = 60


@dataclass(frozen=True)
class Columns:
    """Names of the columns by contact, from 1; a level may be NAME@COLUMN=VALUE.

    That is the column NAME in the rows in which COLUMN is VALUE.
    """

    impacts: Mapping[int, str] = field(default_factory=dict)
    on: Mapping[int, str] = field(default_factory=dict)
    off: Mapping[int, str] = field(default_factory=dict)
    level: Mapping[int, str] = field(default_factory=dict)

    def contacts(self) -> list[int]:
        return sorted({*self.impacts, *self.on, *self.off, *self.level})

    def check(self, contacts: int) -> None:
        """Raises ArgumentError if the columns contradict each other or the scene."""
        of_scene = f"the scene has {contacts} contact{'' if contacts == 1 else 's'}"
        for role in ("impacts", "on", "off", "level"):
            for contact, name in getattr(self, role).items():
                if not 1 <= contact <= contacts:
                    raise ArgumentError(
                        f"--{role} {name} is for contact {contact}; {of_scene}, counted from 1"
                    )
        for contact in self.contacts():
            pair = contact in self.on or contact in self.off
            if contact in self.impacts and pair:
                raise ArgumentError(
                    f"contact {contact} has --impacts and --on or --off; must be either"
                )
            if contact in self.level and (pair or contact in self.impacts):
                raise ArgumentError(
                    f"contact {contact} has --level and --impacts, --on or --off; must be either"
                )
            if contact in self.on and contact not in self.off:
                raise ArgumentError(f"contact {contact} has --on without --off")
            if contact in self.off and contact not in self.on:
                raise ArgumentError(f"contact {contact} has --off without --on")


@dataclass(frozen=True)
class Levels:
    """How levels become edges."""

    time: str | None = None  # column of their times; None: the only one that fits
    threshold: float | None = None  # a level above it is high; None: 0.5, of levels 0 and 1
    inverted: bool = False  # low while the contact is closed
    impacts_at: str | None = None  # one of EDGES: these are impacts; None: contacts close and open
    sample_rate: float | None = None  # of rows without times [1/s]

    def __post_init__(self) -> None:
        if self.impacts_at is not None and self.impacts_at not in EDGES:
            raise ArgumentError(
                f'impacts_at is "{self.impacts_at}"; must be "rising", "falling" or "both"'
            )
        if self.sample_rate is not None and not 0.0 < self.sample_rate < np.inf:
            raise ArgumentError("sample_rate must be > 0")


@dataclass(frozen=True)
class Rules:
    """Bounces, pulses and the end, all in seconds of the machine."""

    debounce: float = 0.0
    pulse_shorter_than: float = 0.0
    duration: float = np.inf

    def __post_init__(self) -> None:
        if not (self.debounce >= 0.0 and self.pulse_shorter_than >= 0.0):
            raise ArgumentError("debounce and pulse_shorter_than must be >= 0")


@dataclass
class Figures:
    """Numbers of a contact's events."""

    contact: int
    pulses: int = 0
    sustained: int = 0
    merged: int = 0  # bounces merged with the contact or impact before
    before_start: int = 0  # events left out
    after_duration: int = 0


@dataclass
class Imported:
    """Events of a file, n entries of EVENT, times ascending [s]."""

    events: npt.NDArray[np.void]
    closings: npt.NDArray[np.void]  # all, before debouncing, EVENT; kind PULSE: an impact
    figures: list[Figures]
    problems: list[Problem]
    remarks: list[str]
    doubts: list[str]
    of_clock: bool


@dataclass
class _Edges:
    """Times of one contact [s], with the row of each in the table."""

    impacts: tuple[Floats, str] | None = None
    closings: tuple[Floats, str] | None = None
    openings: tuple[Floats, str] | None = None


def import_table(
    table: Table, contacts: int, columns: Columns, clock: Clock, levels: Levels, rules: Rules
) -> Imported:
    """The events of the contacts that `columns` name, of a machine with so many contacts.

    Raises ArgumentError for columns that do not fit, InputError for a table that cannot be used.
    """
    columns = _chosen(table, contacts, columns)
    if not columns.level and levels != Levels():
        raise ArgumentError(
            "--time, --threshold, --inverted, --impacts-at and --sample-rate are for --level"
        )
    for contact in sorted(set(range(1, contacts + 1)) - set(columns.contacts())):
        table.doubts.append(
            f"contact {contact} of the scene has no column: it will seem open throughout"
        )
    _doubt_alternating(table, columns)
    edges, of_clock = _edges_of(table, columns, clock, levels)
    events, closings, figures = [], [], []
    for contact, of in sorted(edges.items()):
        closings.append(_closings(contact, of))
        made, counts = _events_of(table, contact, of, rules)
        events.append(made)
        figures.append(counts)
    table.problems.sort(key=lambda problem: problem.line)
    return Imported(
        _by_time(events),
        _by_time(closings),
        figures,
        table.problems,
        table.remarks,
        table.doubts,
        of_clock,
    )


def _chosen(table: Table, contacts: int, columns: Columns) -> Columns:
    if columns.contacts():
        columns.check(contacts)
        return columns
    if len(table.names) == 1 and contacts == 1:
        return Columns(impacts={1: table.names[0]})
    listed = ", ".join(f"'{name}'" for name in table.names)
    raise ArgumentError(
        f"the file has {len(table.names)} column{'' if len(table.names) == 1 else 's'} and the "
        f"scene has {contacts} contact{'' if contacts == 1 else 's'}; name the columns with "
        f"--impacts, or --on and --off, or --level; there are {listed}"
    )


def _edges_of(
    table: Table, columns: Columns, clock: Clock, levels: Levels
) -> tuple[dict[int, _Edges], bool]:
    edges: dict[int, _Edges] = {}
    of_clock = False
    named = [*columns.impacts.values(), *columns.on.values(), *columns.off.values()]
    for name in named:
        table.column(name)
    if named:
        reader = TimeReader(table, named, clock)
        for contact, name in columns.impacts.items():
            edges[contact] = _Edges(impacts=(reader.seconds(name), name))
        for contact, name in columns.on.items():
            off = columns.off[contact]
            edges[contact] = _Edges(None, (reader.seconds(name), name), (reader.seconds(off), off))
        of_clock = reader.of_clock
    if columns.level:
        of_levels, level_clock = _edges_of_levels(table, columns.level, clock, levels)
        edges.update(of_levels)
        of_clock = of_clock or level_clock
    return edges, of_clock


def _edges_of_levels(
    table: Table, columns: Mapping[int, str], clock: Clock, levels: Levels
) -> tuple[dict[int, _Edges], bool]:
    compiled = require_compiled("the import of levels")
    time = None if levels.sample_rate else time_column(table, levels.time)
    changes = {
        contact: _changes(compiled, table, given, time, levels)
        for contact, given in columns.items()
    }
    of_clock = False
    if levels.sample_rate:
        t = np.arange(len(table.rows)) / (levels.sample_rate * clock.rate)
    else:
        assert time is not None
        reader = TimeReader(table, [time], clock)
        needed = np.logical_or.reduce([change != 0 for change in changes.values()])
        t = reader.seconds_of_levels(time, needed)
        of_clock = reader.of_clock
    edges = {}
    for contact, change in changes.items():
        # A first level that is high (2) is a closing, but no edge that is an impact.
        wanted = {"rising": (1,), "falling": (-1,), "both": (1, -1)}
        if levels.impacts_at:
            times = np.where(np.isin(change, wanted[levels.impacts_at]), t, np.nan)
            edges[contact] = _Edges(impacts=(times, columns[contact]))
        else:
            closings = np.where(change > 0, t, np.nan)
            openings = np.where(change < 0, t, np.nan)
            name = columns[contact]
            edges[contact] = _Edges(None, (closings, name), (openings, name))
        if levels.impacts_at == "both":
            table.doubts.append(
                f"both edges of '{columns[contact]}' are taken as impacts: a contact that closes "
                "and opens counts twice; --impacts-at rising or falling takes one of them"
            )
    return edges, of_clock


def _changes(
    compiled: ModuleType, table: Table, given: str, time: str | None, levels: Levels
) -> npt.NDArray[np.int8]:
    """Of each row: 1 the level rises, -1 it falls, 2 it is the first one and high, 0 neither."""
    name, cells = _level_cells(table, given)
    if name == time:
        raise InputError(f"column '{name}' is the one of times and has no levels")
    values, threshold = _level_values(table, name, cells, levels.threshold)
    known = np.flatnonzero(np.isfinite(values))
    change = np.zeros(len(values), np.int8)
    change[known] = compiled._level_changes(values[known], threshold, levels.inverted)
    return change


def _level_cells(table: Table, given: str) -> tuple[str, list[str]]:
    """Name of the column and its cells; "" in rows that another column excludes."""
    name, at, condition = given.partition("@")
    key, equals, value = condition.partition("=")
    if given in table.names or not (at and equals):
        return given, table.column(given)
    cells = [
        cell if other == value else "" for cell, other in zip(table.column(name), table.column(key))
    ]
    if not any(cells):
        raise InputError(f"no row has '{value}' in column '{key}'")
    return name, cells


def _level_values(
    table: Table, name: str, cells: Sequence[str], threshold: float | None
) -> tuple[Floats, float]:
    """Levels, NaN where there is none, and the threshold above which they are high."""
    words = {cell.casefold() for cell in cells if cell}
    if words and words <= LEVEL_WORDS.keys() and threshold is None:
        if not words <= {"0", "1"}:
            meanings = [f"{word} is {'high' if LEVEL_WORDS[word] else 'low'}" for word in words]
            table.remarks.append(f"levels of '{name}': {', '.join(sorted(meanings))}")
        as_words = [LEVEL_WORDS[cell.casefold()] if cell else np.nan for cell in cells]
        return np.array(as_words, float), 0.5
    values = np.full(len(cells), np.nan)
    bad = []
    for i, cell in enumerate(cells):
        read = number(cell) if NUMBER.fullmatch(cell) else None
        if read is not None:
            values[i] = float(read)
        elif cell:
            bad.append(i)
    known = values[np.isfinite(values)]
    if bad and not len(known):
        raise InputError(
            f"{table.lines[bad[0]]}: column {name} has no levels: '{cells[bad[0]]}' is none; words "
            f"that are read: {', '.join(LEVEL_WORDS)}"
        )
    table.problems += [
        Problem(table.lines[i], name, f"{cells[i]} is not a finite number") for i in bad
    ]
    if threshold is None:
        if not np.isin(known, (0.0, 1.0)).all():
            raise InputError(
                f"the levels of '{name}' are not 0 and 1 (from {known.min():g} to "
                f"{known.max():g}); say from where on it is high: --threshold X"
            )
        return values, 0.5
    if len(known) and not (known > threshold).any():
        table.doubts.append(
            f"no level of '{name}' is above the threshold {threshold:g}; the largest is "
            f"{known.max():g}"
        )
    return values, threshold


def _events_of(
    table: Table, contact: int, edges: _Edges, rules: Rules
) -> tuple[npt.NDArray[np.void], Figures]:
    if edges.impacts and not rules.debounce:
        return _plain_impacts(table, contact, *edges.impacts, rules.duration)
    compiled = require_compiled(
        "--debounce" if edges.impacts else "the import of closings and openings"
    )
    lists = (edges.closings, edges.openings, edges.impacts)
    sorted_times = [_sorted(of[0]) if of else (np.empty(0), np.empty(0, int)) for of in lists]
    events, counts, refused = compiled._contact_events(
        contact,
        *(times for times, _ in sorted_times),
        debounce=rules.debounce,
        pulse_shorter_than=rules.pulse_shorter_than,
        duration=rules.duration,
    )
    for of, index, what in refused:
        column = lists[of]
        assert column is not None
        line = table.lines[int(sorted_times[of][1][index])]
        table.problems.append(Problem(line, column[1], what))
    return events, Figures(contact, **counts)


def _sorted(times: Floats) -> tuple[Floats, npt.NDArray[np.intp]]:
    """The known times in ascending order, and the row of each."""
    rows = np.flatnonzero(np.isfinite(times))
    rows = rows[np.argsort(times[rows], kind="stable")]
    return times[rows], rows


def _plain_impacts(
    table: Table, contact: int, times: Floats, name: str, duration: float
) -> tuple[npt.NDArray[np.void], Figures]:
    """Impacts as they are: sorted, and one at a time."""
    t, rows = _sorted(times)
    again = np.diff(t, prepend=-np.inf) == 0.0
    table.problems += [
        Problem(table.lines[row], name, f"impact at t = {at:.9g}, where there is one already")
        for at, row in zip(t[again], rows[again])
    ]
    t = t[~again]
    inside = t[(t >= 0.0) & (t <= duration)]
    figures = Figures(
        contact,
        pulses=len(inside),
        before_start=int((t < 0.0).sum()),
        after_duration=int((t > duration).sum()),
    )
    return _as_events(inside, contact, PULSE), figures


def _by_time(parts: Sequence[npt.NDArray[np.void]]) -> npt.NDArray[np.void]:
    """All entries, by time; those of one time in the order of the parts."""
    everything: npt.NDArray[Any] = np.concatenate(parts)
    return everything[np.argsort(everything["t"], kind="stable")].astype(EVENT)


def _closings(contact: int, edges: _Edges) -> npt.NDArray[np.void]:
    times = edges.impacts or edges.closings
    assert times is not None
    return _as_events(_sorted(times[0])[0], contact, PULSE if edges.impacts else 1)


def _as_events(t: Floats, contact: int, kind: int) -> npt.NDArray[np.void]:
    events: npt.NDArray[Any] = np.zeros(len(t), EVENT)
    events["t"], events["contact"], events["kind"] = t, contact, kind
    return events


def _doubt_alternating(table: Table, columns: Columns) -> None:
    """A column that alternates between 0 and 1 suggests that impacts are edges of a level."""
    if not columns.impacts:
        return
    for name, column in zip(table.names, zip(*table.rows)):
        cells = [cell for cell in column if cell]
        if len(cells) < 4 or not set(cells) <= {"0", "1"}:
            continue
        if all(a != b for a, b in zip(cells, cells[1:])):
            table.doubts.append(
                f"column '{name}' alternates between 0 and 1: these are the times of both its "
                "edges, and each is taken as an impact; --level distinguishes closings from "
                "openings"
            )
            return
