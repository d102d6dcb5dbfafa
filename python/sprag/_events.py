"""Contact events: their kinds, and arrays of events."""

from __future__ import annotations

import collections.abc
import enum
import os
from typing import Union

import numpy as np
import numpy.typing as npt

from ._core import Scene, _import_events, event_dtype


class ContactEventKind(enum.IntEnum):
    """Kind of a contact event. A pulse is an isolated impact: closes and opens at one instant."""

    CLOSES = 1
    OPENS = 2
    PULSE = 3


def pulses(t: npt.ArrayLike, contact: int = 1) -> npt.NDArray[np.void]:
    """Returns isolated impacts of a contact (from 1) at times t [s], an array of event_dtype."""
    times = np.atleast_1d(np.asarray(t, dtype=np.float64))
    events = np.zeros(times.shape, dtype=event_dtype)
    events["t"] = times
    events["contact"] = contact
    events["kind"] = ContactEventKind.PULSE
    return events


_Columns = Union[str, collections.abc.Mapping[int, str], None]


def _by_contact(columns: _Columns) -> dict[int, str]:
    if columns is None:
        return {}
    return {1: columns} if isinstance(columns, str) else dict(columns)


def import_events(
    file: str | os.PathLike[str],
    scene: Scene,
    *,
    impacts: _Columns = None,
    on: _Columns = None,
    off: _Columns = None,
    level: _Columns = None,
    time: str = "",
    threshold: float | None = None,
    inverted: bool = False,
    impacts_at: str | None = None,
    unit: float | str | None = None,
    offset: float | str = 0.0,
    rate: float = 1.0,
    debounce: float = 0.0,
    pulse_shorter_than: float = 0.0,
    duration: float = np.inf,
    columns: collections.abc.Sequence[str] | None = None,
    separator: str | None = None,
) -> npt.NDArray[np.void]:
    """Reads columns of time stamps or levels (CSV, TSV) as events, an array of event_dtype.

    impacts: name of the column of impacts of contact 1, or the name of each contact's column by its
    number from 1; on and off: of the times at which contacts close and open; level: of levels, high
    while a contact is closed. All of them None: the only column of the file.

    Of levels: time is the column of their times, "": the one whose name begins with Time; a level
    above threshold is high, None: 0.5, of levels 0 and 1; inverted: low while the contact is closed;
    impacts_at: "rising", "falling" or "both" edges are impacts, None: contacts that close and open.

    unit: "s", "ms", "us", "ns" or seconds, None: as the columns' names say, else seconds; offset:
    the file's time at the machine's t = 0, in its unit or as a time such as "12:34:00"; rate:
    seconds of the file's clock per second of the machine. debounce [s]: bounces that follow sooner
    are merged; pulse_shorter_than [s]: shorter contacts become pulses. Later events than duration
    [s] are left out. columns: names of the columns of a file without a header line; separator:
    "comma", "semicolon" or "tab", None: as the file shows.

    Cells that cannot be used are left out with a RuntimeWarning. Raises InputError or ValueError.
    """
    return _import_events(
        file,
        scene,
        impacts=_by_contact(impacts),
        on=_by_contact(on),
        off=_by_contact(off),
        level=_by_contact(level),
        time=time,
        threshold=threshold,
        inverted=inverted,
        impacts_at=impacts_at,
        unit=unit,
        offset=offset,
        rate=rate,
        debounce=debounce,
        pulse_shorter_than=pulse_shorter_than,
        duration=duration,
        columns=None if columns is None else list(columns),
        separator=separator,
    )
