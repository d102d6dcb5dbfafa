"""Contact events: their kinds, and arrays of events."""

from __future__ import annotations

import enum

import numpy as np
import numpy.typing as npt

from ._core import event_dtype


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
