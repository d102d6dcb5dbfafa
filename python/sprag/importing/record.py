"""Writes a column as a record for excitation.file and [[force]] file."""

from __future__ import annotations

from typing import IO

import numpy as np

from .._errors import InputError
from .tables import Table
from .times import Floats, Options, numbers, sample_times, time_column


def read_signal(table: Table, name: str, options: Options) -> tuple[Floats, Floats]:
    """Times [s] and values, in the column's unit, of all rows. Raises InputError for a gap."""
    cells = table.column(name)
    time = time_column(table, options)
    if time == name:
        raise InputError(f"the column '{name}' is the time; the signal must be another")
    t = sample_times(table, time, options, np.ones(len(cells), bool))
    values = numbers(cells)
    gap = "a gap in a record cannot be interpolated"
    for what, of in ("value", values), ("time", t):
        if len(at := np.flatnonzero(np.isnan(of))):
            cell = f" ({cells[at[0]]!r})" if cells[at[0]] else ""
            raise InputError(f"{table.lines[at[0]]}: a sample has no {what}{cell}; {gap}")
    if table.problems:
        raise InputError(f"{table.problems[0]}; {gap}")
    return t, values


def write_record(stream: IO[str], name: str, t: Floats, values: Floats) -> None:
    """Writes the form that the scene's reader takes: a header, then rows of numbers."""
    quoted = name.replace(",", " ").replace(";", " ").replace('"', "")
    stream.write(f"t [s],{quoted}\n")
    for pair in zip(t.tolist(), values.tolist()):
        stream.write("{:.17g},{:.17g}\n".format(*pair))
