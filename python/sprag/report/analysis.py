"""Figures that a report computes from the tables of a run.

Contacts are counted from 1, as in the files. Residuals are tables with the columns t [s], value
(measured minus expected), sigma and contact; a sigma that is unknown is nan.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

    from ..tables import Table

FEWEST_RESIDUALS = 10


def normalized(residuals: pd.DataFrame) -> pd.DataFrame:
    """value / sigma of those with a finite sigma > 0; all others are left out."""
    known = residuals[np.isfinite(residuals["sigma"]) & (residuals["sigma"] > 0.0)]
    return known.assign(value=known["value"] / known["sigma"], sigma=1.0)


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


def consistency(normalized: pd.DataFrame) -> Consistency | None:
    """The test of these residuals; None for less than FEWEST_RESIDUALS."""
    z = normalized["value"].to_numpy()
    n = len(z)
    if n < FEWEST_RESIDUALS:
        return None
    part = 2.0 / (9.0 * n)  # quantiles of chi^2 / n by Wilson and Hilferty
    low, high = ((1.0 - part + s * math.sqrt(part)) ** 3 for s in (-1.959964, 1.959964))
    within_two = float(np.mean(np.abs(z) <= 2.0))
    return Consistency(n, float(np.mean(z**2)), low, high, within_two)


def innovations(states: Table) -> pd.DataFrame:
    """Gap of the filter just before each reported closing, which is 0 for a perfect estimate.

    Residuals. A states table has one closing for each tick; others are missing. Without a filter
    there are none.
    """
    columns = {"closing_t": "t", "filter_gap": "value", "sigma_filter_gap": "sigma"}
    columns["closing_contact"] = "contact"
    found = states.data.reindex(columns=list(columns)).rename(columns=columns)
    found = found[(found["t"] >= 0.0) & np.isfinite(found["value"])]
    found = found[found["t"].diff() != 0.0]
    return found.assign(sigma=found["sigma"].where(found["sigma"] > 0.0))


class PredictionCheck(NamedTuple):
    """Measured minus predicted time of the next event, for each prediction."""

    errors: pd.DataFrame  # residuals of predictions of the contact that closed or opened next
    made: int  # predictions
    none: int  # those that claim no event
    claimed: int  # those that claim an event before the last measured one


def check_predictions(predictions: Table, events: pd.DataFrame, jitter: float) -> PredictionCheck:
    """Compares each prediction's first event with the next measured one.

    jitter: standard deviation of reported times [s].
    """
    first = predictions.data.drop_duplicates("made_at")
    claims = first[np.isfinite(first["t"])]
    order = np.maximum.accumulate(events["t"].to_numpy())
    following = np.searchsorted(order, claims["made_at"], side="right")
    claimed = claims[following < len(events)].reset_index(drop=True)
    next_events = events.iloc[following[following < len(events)]].reset_index(drop=True)
    same = next_events["contact"] == claimed["contact"]
    same &= (next_events["kind"] == "opens") == (claimed["kind"] == "opens")
    error, sigma = next_events["t"] - claimed["t"], np.hypot(claimed["sigma_t"], jitter)
    errors = next_events.assign(value=error, sigma=sigma)[same]
    return PredictionCheck(errors, len(first), len(first) - len(claims), len(claimed))
