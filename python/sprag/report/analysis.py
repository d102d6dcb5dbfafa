"""Figures that a report computes from the tables of a run.

Contacts are counted from 1, as in the files.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from ..tables import Table

Numbers = npt.NDArray[np.float64]

FEWEST_RESIDUALS = 10


@dataclass
class Events:
    """Events, one entry each: time [s], contact, and kind: impact, closes or opens."""

    t: Numbers
    contact: npt.NDArray[np.int64]
    kind: npt.NDArray[np.str_]
    inserted: int = 0  # rows that identify inserted, which are left out

    def __len__(self) -> int:
        return len(self.t)

    @property
    def closings(self) -> int:
        """Number of impacts and closings."""
        return int(np.count_nonzero(self.kind != "opens"))


def events_of(table: Table) -> Events:
    """Measured events of a table of events, whose pulses are two rows, or of impacts."""
    data = table.data
    if "closed" not in data:
        kinds = data["kind"].to_numpy(str)
        return Events(table.column("t"), table.column("contact").astype(np.int64), kinds)
    measured = data[data["note"] != "lost"] if "note" in data else data
    events: list[tuple[float, int, str]] = []
    last: dict[float, int] = {}  # last event of each contact
    for t, contact, closed in zip(measured["t"], measured["contact"], measured["closed"]):
        before = last.get(contact)
        if closed <= 0.5 and before is not None and events[before] == (t, contact, "closes"):
            events[before] = (t, contact, "impact")
        else:
            last[contact] = len(events)
            events.append((t, contact, "closes" if closed > 0.5 else "opens"))
    t, contact, kind = zip(*events) if events else ((), (), ())
    inserted = len(data) - len(measured)
    return Events(np.array(t), np.array(contact, np.int64), np.array(kind, np.str_), inserted)


@dataclass
class Residuals:
    """Measured minus expected values over time, with standard deviations; nan: unknown."""

    t: Numbers
    value: Numbers
    sigma: Numbers
    contact: npt.NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.t)

    def normalized(self) -> Residuals:
        """value / sigma of those with a finite sigma > 0; all others are left out."""
        has = np.isfinite(self.sigma) & (self.sigma > 0.0)
        value = self.value[has] / self.sigma[has]
        return Residuals(self.t[has], value, np.ones(len(value)), self.contact[has])


@dataclass
class Consistency:
    """Test of standard deviations by the mean square of n normalized residuals.

    It is 1 if they are right and independent, and between low and high in 95 % of such cases.
    """

    n: int
    mean_square: float
    low: float
    high: float
    within_two: float  # share within 2 sigma

    @property
    def holds(self) -> bool:
        """Whether the test is passed."""
        return self.low <= self.mean_square <= self.high


def consistency(normalized: Residuals) -> Consistency | None:
    """The test of these residuals; None for less than FEWEST_RESIDUALS."""
    z = normalized.value
    n = len(z)
    if n < FEWEST_RESIDUALS:
        return None
    part = 2.0 / (9.0 * n)  # quantiles of chi^2 / n by Wilson and Hilferty
    low, high = ((1.0 - part + s * math.sqrt(part)) ** 3 for s in (-1.959964, 1.959964))
    within_two = float(np.mean(np.abs(z) <= 2.0))
    return Consistency(n, float(np.mean(z**2)), low, high, within_two)


def innovations(states: Table) -> Residuals:
    """Gap of the filter just before each reported closing, which is 0 for a perfect estimate.

    A states table has one closing for each tick; others are missing. Empty without a filter.
    """
    needed = ["closing_t", "closing_contact", "filter_gap", "sigma_filter_gap"]
    if any(name not in states.data for name in needed):
        nothing = np.zeros(0)
        return Residuals(nothing, nothing, nothing, np.zeros(0, np.int64))
    t, contact, gap, sigma = (states.column(name) for name in needed)
    rows = np.flatnonzero((t >= 0.0) & np.isfinite(gap))
    rows = rows[np.diff(t[rows], prepend=-1.0) != 0.0]
    sigma = np.where(sigma[rows] > 0.0, sigma[rows], np.nan)
    return Residuals(t[rows], gap[rows], sigma, contact[rows].astype(np.int64))


@dataclass
class PredictionCheck:
    """Measured minus predicted time of the next event, for each prediction."""

    errors: Residuals  # of predictions of the contact that closed or opened next
    none: int  # predictions that claim no event
    others: int  # predictions of another contact than the next event's
    open_end: int  # predictions after the last event

    @property
    def claimed(self) -> int:
        """Predictions whose next event was measured."""
        return len(self.errors) + self.others


def check_predictions(predictions: Table, events: Events, jitter: float) -> PredictionCheck:
    """Compares each prediction's first event with the next measured one.

    jitter: standard deviation of reported times [s].
    """
    first = predictions.data.drop_duplicates("made_at")
    claims = first[np.isfinite(first["t"])]
    order = np.maximum.accumulate(events.t) if len(events) else events.t
    following = np.searchsorted(order, claims["made_at"].to_numpy(float), side="right")
    measured = following < len(events)
    claims, following = claims[measured], following[measured]
    same = events.contact[following] == claims["contact"].to_numpy(float)
    same &= (events.kind[following] == "opens") == (claims["kind"] == "opens").to_numpy()
    t, contact = events.t[following[same]], events.contact[following[same]]
    predicted, sigma = (claims[name].to_numpy(float)[same] for name in ("t", "sigma_t"))
    errors = Residuals(t, t - predicted, np.hypot(sigma, jitter), contact)
    none, others, open_end = (
        int(np.count_nonzero(of)) for of in (~np.isfinite(first["t"]), ~same, ~measured)
    )
    return PredictionCheck(errors, none, others, open_end)
