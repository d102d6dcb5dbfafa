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
    unit: float = 1.0,
    offset: float = 0.0,
    debounce: float = 0.0,
    pulse_shorter_than: float = 0.0,
    duration: float = np.inf,
) -> npt.NDArray[np.void]:
    """Reads columns of time stamps (CSV or TSV with a header) as events, an array of event_dtype.

    impacts: name of the column of impacts of contact 1, or the name of each contact's column by its
    number from 1; on and off: of the times at which contacts close and open. All of them None: the
    only column of the file. unit: one unit of the file in seconds; offset: the file's time at the
    machine's t = 0, in its unit. debounce [s]: bounces that follow sooner are merged;
    pulse_shorter_than [s]: shorter contacts become pulses. Later events than duration [s] are left
    out. Cells that cannot be used are left out with a RuntimeWarning. Levels and the logs of loggers
    are read by the program `sprag import_events`. Raises InputError or ValueError.
    """
    return _import_events(
        file,
        scene,
        _by_contact(impacts),
        _by_contact(on),
        _by_contact(off),
        unit,
        offset,
        debounce,
        pulse_shorter_than,
        duration,
    )
