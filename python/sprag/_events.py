"""Contact events in Python: what a contact did, and arrays of events."""

from __future__ import annotations

import enum

import numpy as np
import numpy.typing as npt

from ._core import event_dtype


class ContactEventKind(enum.IntEnum):
    """A pulse closes and opens at the same instant: an isolated impact."""

    CLOSES = 1
    OPENS = 2
    PULSE = 3


def pulses(t: npt.ArrayLike, contact: int = 1) -> npt.NDArray[np.void]:
    """Impacts at the times t [s] of one contact, from 1, as an array of event_dtype."""
    times = np.atleast_1d(np.asarray(t, dtype=np.float64))
    events = np.zeros(times.shape, dtype=event_dtype)
    events["t"] = times
    events["contact"] = contact
    events["kind"] = ContactEventKind.PULSE
    return events
