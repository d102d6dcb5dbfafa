"""How far events and parameters may be off."""

from __future__ import annotations

import collections.abc
import os
from typing import Any

import numpy as np
import numpy.typing as npt

from ._core import Scene, _tolerance, read_scene

_LIMIT = [("amount", "f8"), ("unit", "U24"), ("kind", "U12")]


class Tolerances:
    """Largest deviations for which V, the energy of the error, stays below a target.

    target, motion_energy: energies; duration [s]: of a run; closings_per_time [1/s].

    limits: an array with the fields what ("jitter", "offset", "lost", "spurious", or a key of the
    scene file), estimator, amount, unit and kind. kind is "within"; "beyond_all" or "below_all":
    the limit is more, or less, than all amounts that were tried, of which amount is the largest or
    the least; "never": V stays above the target without any deviation, and amount is nan. Without
    a unit an amount is a share.

    guaranteed: what, amount, unit and kind, for which the proven bound of the replica stays below
    the target, of the deviations that the bound covers.

    points: all that was tried, an array with the fields what ("nothing": no deviation), estimator,
    amount, median, low, high (V over the runs) and worse (share of the time in which V is far above
    that of the replica).
    """

    def __init__(self, tables: dict[str, Any]) -> None:
        self.target = float(tables["target"])
        self.motion_energy = float(tables["motion_energy"])
        self.duration = float(tables["duration"])
        self.closings_per_time = float(tables["closings_per_time"])
        what, estimator = ("what", "U40"), ("estimator", "U8")
        spread = [(name, "f8") for name in ("amount", "median", "low", "high", "worse")]
        self.limits: npt.NDArray[np.void] = np.array(
            tables["limits"], dtype=[what, estimator, *_LIMIT]
        )
        self.guaranteed: npt.NDArray[np.void] = np.array(
            tables["guaranteed"], dtype=[what, *_LIMIT]
        )
        self.points: npt.NDArray[np.void] = np.array(
            tables["points"], dtype=[what, estimator, *spread]
        )

    def __repr__(self) -> str:
        return f"<Tolerances: {len(self.limits)} limits for V below {self.target:g}>"


def tolerance(
    scene: Scene | str | os.PathLike[str],
    *,
    target: float | None = None,
    duration: float | None = None,
    jitter: float | None = None,
    drift: float | None = None,
    runs: int = 7,
    estimators: collections.abc.Sequence[str] = (),
    jobs: int | None = None,
) -> Tolerances:
    """Finds how far event times and parameters of a scene may be off, one at a time.

    scene: a Scene, or a file or name as for read_scene(). target: of V, None: 1e-4 of the energy of
    the motion; duration [s] and runs of each amount; jitter [s] of event times besides a deviation,
    and drift that filters assume [energy per unit of time], None: the scene's; estimators:
    "replica", "timing", "both" or "adaptive", empty: the first three. jobs: number of threads,
    None: one for each core. Raises SceneError for a wrong scene file, ModelError, ValueError, or
    Error if no contact closes.
    """
    machine = scene if isinstance(scene, Scene) else read_scene(scene)
    return Tolerances(
        _tolerance(machine, target, duration, jitter, drift, runs, list(estimators), jobs)
    )
