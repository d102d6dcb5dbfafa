"""Contact events of a table: impacts, closings and openings, levels.

The rules for bounces, pulses and sustained contacts, and the edges of levels, are those of the
compiled library, which live sources use as well.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from .._command import require_compiled
from .._errors import InputError
from .moments import LEVEL_WORDS
from .tables import Problem, Table, counted
from .times import (
    ArgumentError,
    Clock,
    Floats,
    TimeReader,
    numbers,
    sample_times,
    time_column,
)

PULSE = 3
EVENT = np.dtype(  # event_dtype of the compiled part
    {
        "names": ["t", "contact", "kind"],
        "formats": ["<f8", "<i4", "i1"],
        "offsets": [0, 8, 12],
        "itemsize": 16,
    }
)
# The changes of a level that are impacts; see _changes().
EDGES = {"rising": (1,), "falling": (-1,), "both": (1, -1)}
LARGEST_CONTACT = 60

Events = npt.NDArray[np.void]


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
        for role in ("impacts", "on", "off", "level"):
            for contact, name in getattr(self, role).items():
                if not 1 <= contact <= contacts:
                    raise ArgumentError(
                        f"--{role} {name} is for contact {contact}; the scene has "
                        f"{counted(contacts, 'contact')}, counted from 1"
                    )
        for contact in self.contacts():
            on, off = contact in self.on, contact in self.off
            impacts, level = contact in self.impacts, contact in self.level
            for contradiction, what in [
                (impacts and (on or off), "--impacts and --on or --off; must be either"),
                (
                    level and (on or off or impacts),
                    "--level and --impacts, --on or --off; must be either",
                ),
                (on and not off, "--on without --off"),
                (off and not on, "--off without --on"),
            ]:
                if contradiction:
                    raise ArgumentError(f"contact {contact} has {what}")


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

    events: Events
    closings: Events  # all, before debouncing, EVENT; kind PULSE: an impact
    figures: list[Figures]
    of_clock: bool  # some times are dates or times of day


# Of one contact by role, "closings", "openings" or "impacts": the column, and the times
# [s] of all rows, NaN where there is none.
_Edges = dict[str, tuple[str, Floats]]
_ROLES = ("closings", "openings", "impacts")


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
    if columns.impacts:
        _doubt_alternating(table)
    edges, of_clock = _edges_of_times(table, columns, clock)
    if columns.level:
        of_levels, level_clock = _edges_of_levels(table, columns.level, clock, levels)
        edges.update(of_levels)
        of_clock = of_clock or level_clock
    events, closings, figures = [], [], []
    for contact, of in sorted(edges.items()):
        made, counts = _events_of(table, contact, of, rules)
        events.append(made)
        figures.append(counts)
        _, t = of["impacts"] if "impacts" in of else of["closings"]
        closings.append(_as_events(_sorted(t)[0], contact, PULSE if "impacts" in of else 1))
    table.problems.sort(key=lambda problem: problem.line)
    return Imported(_by_time(events), _by_time(closings), figures, of_clock)


def _chosen(table: Table, contacts: int, columns: Columns) -> Columns:
    if columns.contacts():
        columns.check(contacts)
        return columns
    if len(table.names) == 1 and contacts == 1:
        return Columns(impacts={1: table.names[0]})
    raise ArgumentError(
        f"the file has {counted(len(table.names), 'column')} and the scene has "
        f"{counted(contacts, 'contact')}; name the columns with --impacts, or --on and --off, or "
        f"--level; there are {table.listed()}"
    )


def _doubt_alternating(table: Table) -> None:
    """A column that alternates between 0 and 1 suggests that impacts are edges of a level."""
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


def _edges_of_times(table: Table, columns: Columns, clock: Clock) -> tuple[dict[int, _Edges], bool]:
    """Edges by contact, and whether the times are those of a clock."""
    named = [*columns.impacts.values(), *columns.on.values(), *columns.off.values()]
    for name in named:
        table.column(name)
    if not named:
        return {}, False
    reader = TimeReader(table, named, clock)
    edges: dict[int, _Edges] = {}
    for role, of_role in zip(_ROLES, (columns.on, columns.off, columns.impacts)):
        for contact, name in of_role.items():
            edges.setdefault(contact, {})[role] = (name, reader.seconds(name))
    return edges, reader.of_clock


def _edges_of_levels(
    table: Table, columns: Mapping[int, str], clock: Clock, levels: Levels
) -> tuple[dict[int, _Edges], bool]:
    time = None if levels.sample_rate else time_column(table, levels.time)
    changes = {contact: _changes(table, given, time, levels) for contact, given in columns.items()}
    needed = np.logical_or.reduce([change != 0 for change in changes.values()])
    t, of_clock = sample_times(table, time, levels.sample_rate, clock, needed)
    edges: dict[int, _Edges] = {}
    for contact, change in changes.items():
        # A first level that is high (2) is a closing, but no edge that is an impact.
        of_role = {"closings": (1, 2), "openings": (-1,)}
        if levels.impacts_at:
            of_role = {"impacts": EDGES[levels.impacts_at]}
        edges[contact] = {
            role: (columns[contact], np.where(np.isin(change, wanted), t, np.nan))
            for role, wanted in of_role.items()
        }
        if levels.impacts_at == "both":
            table.doubts.append(
                f"both edges of '{columns[contact]}' are taken as impacts: a contact that closes "
                "and opens counts twice; --impacts-at rising or falling takes one of them"
            )
    return edges, of_clock


def _changes(table: Table, given: str, time: str | None, levels: Levels) -> npt.NDArray[np.int8]:
    """Of each row: 1 the level rises, -1 it falls, 2 it is the first one and high, 0 neither."""
    compiled = require_compiled("the import of levels")
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
    levels = words & LEVEL_WORDS.keys()
    others = words - levels
    are_words = levels - {"0", "1"} and np.isnan(numbers(list(others))).all()
    if threshold is None and (are_words or (levels and not others)):
        if not words <= {"0", "1"}:
            meanings = [f"{word} is {'high' if LEVEL_WORDS[word] else 'low'}" for word in levels]
            table.remarks.append(f"levels of '{name}': {', '.join(sorted(meanings))}")
        as_words = [LEVEL_WORDS.get(cell.casefold(), np.nan) for cell in cells]
        table.problems += [
            Problem(table.lines[i], name, f"{cell} is no level")
            for i, cell in enumerate(cells)
            if cell and np.isnan(as_words[i])
        ]
        return np.array(as_words, float), 0.5
    values = numbers(cells)
    bad = [i for i, cell in enumerate(cells) if cell and np.isnan(values[i])]
    known = values[np.isfinite(values)]
    if bad and not len(known):
        raise InputError(
            f"{table.lines[bad[0]]}: column {name} has no levels: '{cells[bad[0]]}' is none; words "
            f"that are read: {', '.join(LEVEL_WORDS)}"
        )
    table.problems += [
        Problem(table.lines[i], name, f"{cells[i]} is not a finite number") for i in bad
    ]
    if threshold is None and not np.isin(known, (0.0, 1.0)).all():
        raise InputError(
            f"the levels of '{name}' are not 0 and 1 (from {known.min():g} to {known.max():g}); "
            "say from where on it is high: --threshold X"
        )
    if threshold is not None and len(known) and not (known > threshold).any():
        table.doubts.append(
            f"no level of '{name}' is above the threshold {threshold:g}; the largest is "
            f"{known.max():g}"
        )
    return values, 0.5 if threshold is None else threshold


def _events_of(table: Table, contact: int, edges: _Edges, rules: Rules) -> tuple[Events, Figures]:
    if "impacts" in edges and not rules.debounce:
        return _plain_impacts(table, contact, *edges["impacts"], rules.duration)
    compiled = require_compiled(
        "--debounce" if "impacts" in edges else "the import of closings and openings"
    )
    nothing = ("", np.empty(0))
    times = [_sorted(edges.get(role, nothing)[1]) for role in _ROLES]
    events, counts, refused = compiled._contact_events(
        contact,
        *(t for t, _ in times),
        debounce=rules.debounce,
        pulse_shorter_than=rules.pulse_shorter_than,
        duration=rules.duration,
    )
    for of, index, what in refused:
        line = table.lines[int(times[of][1][index])]
        table.problems.append(Problem(line, edges[_ROLES[of]][0], what))
    return events, Figures(contact, **counts)


def _sorted(times: Floats) -> tuple[Floats, npt.NDArray[np.intp]]:
    """The known times in ascending order, and the row of each."""
    rows = np.flatnonzero(np.isfinite(times))
    rows = rows[np.argsort(times[rows], kind="stable")]
    return times[rows], rows


def _plain_impacts(
    table: Table, contact: int, name: str, times: Floats, duration: float
) -> tuple[Events, Figures]:
    """Impacts as they are, sorted and one at a time: for this nothing compiled is needed."""
    t, rows = _sorted(times)
    again = np.diff(t, prepend=-np.inf) == 0.0
    table.problems += [
        Problem(table.lines[row], name, f"impact at t = {at:.9g}, where there is one already")
        for at, row in zip(t[again], rows[again])
    ]
    t = t[~again]
    early, late = int((t < 0.0).sum()), int((t > duration).sum())
    events = _as_events(t[(t >= 0.0) & (t <= duration)], contact, PULSE)
    return events, Figures(contact, len(events), before_start=early, after_duration=late)


def _by_time(parts: Sequence[Events]) -> Events:
    """All entries, by time; those of one time in the order of the parts."""
    everything: npt.NDArray[Any] = np.concatenate(parts)
    return everything[np.argsort(everything["t"], kind="stable")].astype(EVENT)


def _as_events(t: Floats, contact: int, kind: int) -> Events:
    events: npt.NDArray[Any] = np.zeros(len(t), EVENT)
    events["t"], events["contact"], events["kind"] = t, contact, kind
    return events
