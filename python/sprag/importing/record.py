"""Writes a column as a record for excitation.file and [[force]] file."""

from __future__ import annotations

from typing import IO

import numpy as np

from .._errors import InputError
from .moments import NUMBER, number
from .tables import Table
from .times import Clock, Floats, TimeReader, time_column


def read_signal(
    table: Table, name: str, time: str | None, sample_rate: float | None, clock: Clock
) -> tuple[Floats, Floats]:
    """Times [s] and values, in the column's unit, of all rows. Raises InputError for a gap."""
    cells = table.column(name)
    if sample_rate:
        t = np.arange(len(cells)) / (sample_rate * clock.rate)
    else:
        time = time_column(table, time)
        if time == name:
            raise InputError(f"the column '{name}' is the time; the signal must be another")
        t = TimeReader(table, [time], clock).seconds_of_levels(time, np.ones(len(cells), bool))
    values = np.full(len(cells), np.nan)
    for i, cell in enumerate(cells):
        value = number(cell) if NUMBER.fullmatch(cell) else None
        if value is None or not np.isfinite(t[i]):
            raise InputError(
                f"{table.lines[i]}: a sample has no {'value' if value is None else 'time'}"
                f"{f' ({cell!r})' if cell else ''}; a gap in a record cannot be interpolated"
            )
        values[i] = float(value)
    if table.problems:
        raise InputError(f"{table.problems[0]}; a gap in a record cannot be interpolated")
    return t, values


def write_record(stream: IO[str], name: str, t: Floats, values: Floats) -> None:
    """Writes the form that the scene's reader takes: a header, then rows of numbers."""
    quoted = name.replace(",", " ").replace(";", " ").replace('"', "")
    stream.write(f"t [s],{quoted}\n")
    for pair in zip(t.tolist(), values.tolist()):
        stream.write("{:.17g},{:.17g}\n".format(*pair))
