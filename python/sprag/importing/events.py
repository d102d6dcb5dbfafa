"""Contact events of a table: impacts, closings and openings, levels.

The rules for bounces, pulses and sustained contacts, and the edges of levels, are those of the
compiled library, which live sources use as well.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from .._command import counted, require_compiled
from .._errors import InputError
from .moments import LEVEL_WORDS
from .tables import Problem, Table
from .times import EDGES, ArgumentError, Floats, Options, TimeReader
from .times import numbers, sample_times, time_column

PULSE = 3
# event_dtype of the compiled part
EVENT = np.dtype([("t", "<f8"), ("contact", "<i4"), ("kind", "i1")], align=True)

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
        roles: dict[int, set[str]] = {contact: set() for contact in self.contacts()}
        for role in (of.name for of in fields(self)):
            for contact, name in getattr(self, role).items():
                roles[contact].add(role)
                if not 1 <= contact <= contacts:
                    raise ArgumentError(
                        f"--{role} {name} is for contact {contact}; the scene has "
                        f"{counted(contacts, 'contact')}, counted from 1"
                    )
        for contact, of in roles.items():
            for what, contradiction in {
                "--impacts and --on or --off; must be either": "impacts" in of
                and {"on", "off"} & of,
                "--level and --impacts, --on or --off; must be either": "level" in of
                and len(of) > 1,
                "--on without --off": of == {"on"},
                "--off without --on": of == {"off"},
            }.items():
                if contradiction:
                    raise ArgumentError(f"contact {contact} has {what}")


@dataclass
class Imported:
    """Events of a file, n entries of EVENT, times ascending [s]."""

    events: Events
    closings: Events  # all, before debouncing, EVENT; kind PULSE: an impact
    # Of each contact: its number, pulses, sustained, merged (bounces merged with the contact or
    # impact before), and events left out, before_start and after_duration.
    figures: list[dict[str, int]]


# Of one contact by role, "closings", "openings" or "impacts": the column, and the times
# [s] of all rows, NaN where there is none.
_Edges = dict[str, tuple[str, Floats]]
_ROLES = ("closings", "openings", "impacts")


def import_table(table: Table, contacts: int, columns: Columns, options: Options) -> Imported:
    """The events of the contacts that `columns` name, of a machine with so many contacts.

    Raises ArgumentError for columns that do not fit, InputError for a table that cannot be used.
    """
    columns = _chosen(table, contacts, columns)
    of_levels = ("time", "threshold", "inverted", "impacts_at", "sample_rate")
    if not columns.level and any(getattr(options, of) != getattr(Options, of) for of in of_levels):
        raise ArgumentError(
            "--time, --threshold, --inverted, --impacts-at and --sample-rate are for --level"
        )
    for contact in sorted(set(range(1, contacts + 1)) - set(columns.contacts())):
        table.doubts.append(
            f"contact {contact} of the scene has no column: it will seem open throughout"
        )
    if columns.impacts:
        _doubt_alternating(table)
    edges = _edges_of_times(table, columns, options) | _edges_of_levels(table, columns, options)
    events, closings, figures = [], [], []
    for contact, of in sorted(edges.items()):
        made, counts = _events_of(table, contact, of, options)
        events.append(made)
        figures.append({"contact": contact, **counts})
        role, kind = ("impacts", PULSE) if "impacts" in of else ("closings", 1)
        closings.append(_as_events(_sorted(of[role][1])[0], contact, kind))
    table.problems.sort(key=lambda problem: problem.line)
    return Imported(_by_time(events), _by_time(closings), figures)


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


def _edges_of_times(table: Table, columns: Columns, options: Options) -> dict[int, _Edges]:
    named = [*columns.impacts.values(), *columns.on.values(), *columns.off.values()]
    for name in named:
        table.column(name)
    edges: dict[int, _Edges] = {}
    if named:
        reader = TimeReader(table, named, options)
        for role, of_role in zip(_ROLES, (columns.on, columns.off, columns.impacts)):
            for contact, name in of_role.items():
                edges.setdefault(contact, {})[role] = (name, reader.seconds(name))
    return edges


def _edges_of_levels(table: Table, columns: Columns, options: Options) -> dict[int, _Edges]:
    if not columns.level:
        return {}
    time = time_column(table, options)
    changes = {
        contact: _changes(table, given, time, options) for contact, given in columns.level.items()
    }
    needed = np.logical_or.reduce([change != 0 for change in changes.values()])
    t = sample_times(table, time, options, needed)
    # A first level that is high (2) is a closing, but no edge that is an impact.
    of_role = {"closings": (1, 2), "openings": (-1,)}
    if options.impacts_at:
        of_role = {"impacts": EDGES[options.impacts_at]}
    edges: dict[int, _Edges] = {}
    for contact, change in changes.items():
        name = columns.level[contact]
        edges[contact] = {
            role: (name, np.where(np.isin(change, wanted), t, np.nan))
            for role, wanted in of_role.items()
        }
        if options.impacts_at == "both":
            table.doubts.append(
                f"both edges of '{name}' are taken as impacts: a contact that closes and opens "
                "counts twice; --impacts-at rising or falling takes one of them"
            )
    return edges


def _changes(table: Table, given: str, time: str | None, options: Options) -> npt.NDArray[np.int8]:
    """Of each row: 1 the level rises, -1 it falls, 2 it is the first one and high, 0 neither."""
    compiled = require_compiled("the import of levels")
    name, cells = _level_cells(table, given)
    if name == time:
        raise InputError(f"column '{name}' is the one of times and has no levels")
    values, threshold = _level_values(table, name, cells, options.threshold)
    known = np.flatnonzero(np.isfinite(values))
    change = np.zeros(len(values), np.int8)
    change[known] = compiled._level_changes(values[known], threshold, options.inverted)
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


def _events_of(
    table: Table, contact: int, edges: _Edges, options: Options
) -> tuple[Events, dict[str, int]]:
    if "impacts" in edges and not options.debounce:
        return _plain_impacts(table, contact, *edges["impacts"], options.duration)
    compiled = require_compiled(
        "--debounce" if "impacts" in edges else "the import of closings and openings"
    )
    nothing = ("", np.empty(0))
    times = [_sorted(edges.get(role, nothing)[1]) for role in _ROLES]
    events, counts, refused = compiled._contact_events(
        contact,
        *(t for t, _ in times),
        debounce=options.debounce,
        pulse_shorter_than=options.pulse_shorter_than,
        duration=options.duration,
    )
    for of, index, what in refused:
        line = table.lines[int(times[of][1][index])]
        table.problems.append(Problem(line, edges[_ROLES[of]][0], what))
    return events, counts


def _sorted(times: Floats) -> tuple[Floats, npt.NDArray[np.intp]]:
    """The known times in ascending order, and the row of each."""
    rows = np.flatnonzero(np.isfinite(times))
    rows = rows[np.argsort(times[rows], kind="stable")]
    return times[rows], rows


def _plain_impacts(
    table: Table, contact: int, name: str, times: Floats, duration: float
) -> tuple[Events, dict[str, int]]:
    """Impacts as they are, sorted and one at a time: for this nothing compiled is needed."""
    t, rows = _sorted(times)
    again = np.diff(t, prepend=-np.inf) == 0.0
    table.problems += [
        Problem(table.lines[row], name, f"impact at t = {at:.9g}, where there is one already")
        for at, row in zip(t[again], rows[again])
    ]
    t = t[~again]
    early, late = t < 0.0, t > duration
    events = _as_events(t[~(early | late)], contact, PULSE)
    counts = {"pulses": len(events), "sustained": 0, "merged": 0}
    return events, counts | {"before_start": int(early.sum()), "after_duration": int(late.sum())}


def _by_time(parts: Sequence[Events]) -> Events:
    """All entries, by time; those of one time in the order of the parts."""
    everything: npt.NDArray[Any] = np.concatenate(parts)
    return everything[np.argsort(everything["t"], kind="stable")].astype(EVENT)


def _as_events(t: Floats, contact: int, kind: int) -> Events:
    events: npt.NDArray[Any] = np.zeros(len(t), EVENT)
    events["t"], events["contact"], events["kind"] = t, contact, kind
    return events
