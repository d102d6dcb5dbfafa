"""Contact events from the files of devices, spreadsheets and loggers.

Reading is exact and never silent: what is guessed is said, what cannot be used is named by its
line, and what cannot be known is refused. Columns of impacts need no compiled part of the package.
"""

from __future__ import annotations

import os
import tomllib
import warnings
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import numpy.typing as npt

from .events import Columns, import_table
from .formats import located, read_file
from .tables import SEPARATORS
from .times import ArgumentError, Options

if TYPE_CHECKING:
    from .._core import Scene

__all__ = ["import_events"]

_Columns: TypeAlias = str | Mapping[int, str] | None


def _by_contact(columns: _Columns) -> dict[int, str]:
    return {1: columns} if isinstance(columns, str) else dict(columns or {})


def _contacts(scene: Scene | int, rate: float) -> int:
    """Number of contacts. Refuses a rate that the scene's clock would correct again."""
    if isinstance(scene, int):
        return scene
    if rate != 1.0:
        from .._core import to_toml

        if tomllib.loads(to_toml(scene)).get("clock", {}).get("rate", 1.0) != 1.0:
            raise ValueError("rate and the scene's clock.rate would correct the same clock twice")
    return scene.m


def import_events(
    file: str | os.PathLike[str],
    scene: Scene | int,
    *,
    impacts: _Columns = None,
    on: _Columns = None,
    off: _Columns = None,
    level: _Columns = None,
    time: str | None = None,
    threshold: float | None = None,
    inverted: bool = False,
    impacts_at: str | None = None,
    sample_rate: float | None = None,
    unit: float | str | None = None,
    offset: float | str = 0.0,
    rate: float = 1.0,
    counter_bits: int | None = None,
    day_first: bool | None = None,
    any_order: bool = False,
    debounce: float = 0.0,
    pulse_shorter_than: float = 0.0,
    duration: float = np.inf,
    columns: Sequence[str] | None = None,
    separator: str | None = None,
    skip_lines: int = 0,
) -> npt.NDArray[np.void]:
    """Reads columns of time stamps or levels as events, n entries of event_dtype, t in seconds.

    The file is text (CSV, TSV, columns by blanks, LVM), VCD, .xlsx, .mat, .npy, or a .wav whose
    onsets are impacts. `scene`: the machine, or its number of contacts.

    impacts: name of the column of impacts of contact 1, or the name of each contact's column by its
    number from 1; on and off: of the times at which contacts close and open; level: of levels, high
    while a contact is closed, NAME@COLUMN=VALUE: of the rows in which COLUMN is VALUE. All of them
    None: the only column of the file.

    Of levels: time is the column of their times, None: the one that its name shows; a level above
    threshold is high, None: 0.5, of levels 0 and 1 and of words such as on and off; inverted: low
    while the contact is closed; impacts_at: "rising", "falling" or "both" edges are impacts, None:
    contacts that close and open; sample_rate [1/s]: of rows without times.

    unit: "s", "ms", "us", "ns" or seconds, None: as the file says, else seconds; offset: the file's
    time at the machine's t = 0, in its unit or as a date or a time such as "12:34:00"; rate:
    seconds of the file's clock per second of the machine; counter_bits: times are a counter of so
    many bits that wraps; day_first: of dates such as 5/3/2024; any_order: times of a column may go
    back, which is refused otherwise. debounce [s]: bounces that follow sooner are merged;
    pulse_shorter_than [s]: shorter contacts become pulses. Later events than duration [s] are left
    out. columns: names of the columns of a file without a header line; separator: "comma",
    "semicolon", "tab" or "blank", None: as the file shows; skip_lines: lines before the table.

    Cells that cannot be used are left out with a RuntimeWarning; so are doubtful guesses named.
    Raises InputError for a file that cannot be used, ValueError for wrong arguments, Error if an
    optional package is missing.
    """
    if separator is not None and separator not in SEPARATORS:
        raise ArgumentError(
            f'separator is "{separator}"; must be "comma", "semicolon", "tab" or "blank"'
        )
    contacts = _contacts(scene, rate)
    chosen = Columns(*map(_by_contact, (impacts, on, off, level)))
    chosen.check(contacts)
    options = Options(
        None if unit is None else str(unit), str(offset), rate, counter_bits, day_first, any_order,
        time or None, threshold, inverted, impacts_at, sample_rate, debounce,
        pulse_shorter_than, duration,
    )  # fmt: skip
    table = read_file(file, columns, separator, skip_lines)
    with located(file):
        events = import_table(table, contacts, chosen, options).events
    for text in [f":{problem}; left out" for problem in table.problems] + [
        f": {doubt}" for doubt in table.doubts
    ]:
        warnings.warn(f"{os.fspath(file)}{text}", RuntimeWarning, stacklevel=2)
    return events
