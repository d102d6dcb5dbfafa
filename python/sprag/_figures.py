"""Figures of estimators in a run, as a study records them. "Settled" is the second half."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Numbers = npt.NDArray[np.float64]

USUAL_THRESHOLD = 1e-4  # of V at the start
NEAR_FLOOR = 10.0
MUCH_WORSE = 10.0
ROUNDING = 1e-20  # of V at the start


class Figures(NamedTuple):
    """Figures that follow from V at the samples; docs/reference/study_files.md explains them."""

    V_floor: float
    V_max: float
    rate: float
    time_below: float
    worse: float


def figures(V: Numbers, of_replica: Numbers | None, interval: float, threshold: float) -> Figures:
    """of_replica: V that `worse` is against. interval: of samples. threshold: of V, 0: usual."""
    settled = slice((len(V) - 1) // 2 + 1, None)
    floor = float(np.median(V[settled]))
    below = np.flatnonzero(V < (threshold or USUAL_THRESHOLD * V[0]))
    landed = np.append(np.flatnonzero(V[1:] <= NEAR_FLOOR * floor), len(V) - 2)[0] + 1
    with np.errstate(divide="ignore", invalid="ignore"):
        decay = float(V[0] / V[landed])
    worse = math.nan
    if of_replica is not None:
        much = (V > ROUNDING * of_replica[0]) & (V > MUCH_WORSE * of_replica)
        worse = float(much[settled].mean())
    return Figures(
        V_floor=floor,
        V_max=float(V[settled].max()),
        rate=(math.log(decay) if decay else -math.inf) / float(landed * interval),
        time_below=float(below[0] * interval) if len(below) else math.inf,
        worse=worse,
    )
