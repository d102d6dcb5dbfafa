"""How far events and parameters of a scene may be off: the program `tolerance`, and tolerance()."""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from . import _command
from ._command import EXIT_DONE, Parser, SceneFile, UsageError, Written, choose, printable
from ._errors import Error, ModelError
from ._figures import figures
from ._machine import rates_of_excitation
from ._values import Value

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from . import _core
    from ._core import Scene, _Truth

ESTIMATORS = ("replica", "timing", "both", "adaptive")
USUAL_ESTIMATORS = ("replica", "timing", "both")
USUAL_TARGET = "1%"
SEED = 1
SAMPLES = 400  # of a run
SAMPLES_OF_MOTION, SAMPLES_OF_A_PERIOD = 10_000, 20  # for the energy of the motion
ENERGY_OF_STARTS = 0.1  # of the energy of the motion
WANTED_CLOSINGS, ENOUGH_CLOSINGS, MOST_CLOSINGS = 60, 200, 5000
BISECTIONS = 12  # of a proven limit
# From the least to the largest amount. A wrong frequency grows to a wrong phase with time.
RANGE_OF_TIMES, RANGE_OF_PARAMETER, RANGE_OF_FREQUENCY = 1e6, 1e5, 1e9
MOST_DEVIATIONS = 1000  # that are searched at once

WHAT, UNIT, ESTIMATOR = ("what", "U40"), ("unit", "U24"), ("estimator", "U8")
LIMIT = [("amount", "f8"), UNIT, ("kind", "U12")]
SPREAD = [(name, "f8") for name in ("median", "low", "high", "worse")]

Spread = tuple[float, ...]  # of V over the runs: median, low, high; and worse
Rows = list[tuple[Any, ...]]
Array = npt.NDArray[np.void]


# --- results


@dataclass(frozen=True, eq=False)
class Tolerances(Value):
    """Largest deviations for which V, the energy of the error, stays below a target.

    target, motion_energy: energies; duration [s] and number of runs; closings_per_time [1/s];
    jitter [s] and drift that all runs have.

    limits: an array with the fields what ("jitter", "offset", "lost", "spurious", or a key of the
    scene file), estimator, amount, unit and kind. kind is "within"; "beyond_all" or "below_all":
    the limit is more, or less, than all amounts that were tried, of which amount is the largest or
    the least; "never": V stays above the target without any deviation, and amount is nan. Without
    a unit an amount is a share.

    guaranteed: what, amount, unit and kind, for which the proven bound of the replica stays below
    the target, of the deviations that the bound covers.

    points: all that was tried, an array with the fields what ("nothing": no deviation), unit,
    amount, estimator, median, low, high (V over the runs) and worse (share of the time in which V
    is more than ten times that of the replica).
    """

    scene: str
    estimators: list[str]
    target: float
    motion_energy: float
    duration: float
    runs: int
    closings_per_time: float
    jitter: float
    drift: float
    limits: Array
    guaranteed: Array
    points: Array

    @property
    def amplitude(self) -> float:
        """The target as a share of the amplitude of the motion."""
        return math.sqrt(self.target / self.motion_energy)

    def __repr__(self) -> str:
        return f"<sprag.Tolerances {len(self.limits)} limits for V below {self.target:g}>"

    def __str__(self) -> str:
        """The table that the program prints."""
        rows = [["what is off", *self.estimators, "guaranteed for"]]
        nothing = _of(self.points, "nothing")
        rows.append(["nothing: V is", *(f"{V:.2g}" for V in nothing["median"]), ""])
        for what in _whats(self):
            cells = [limit_text(limit) for limit in _of(self.limits, what)]
            proven = [limit_text(limit) for limit in _of(self.guaranteed, what)] or ["-"]
            rows.append([DESCRIPTIONS.get(what, what), *cells, *proven])
        widths = [max(map(len, column)) for column in zip(*rows)]
        lines = ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
        drift = f", and filters are given a drift of {self.drift:.2g} per s" if self.drift else ""
        closings = self.duration * self.closings_per_time
        return "\n".join(
            [
                f"{printable(self.scene)}: how much may be off for V < {self.target:.2g}, "
                f"{100 * self.amplitude:.2g} % of the motion's amplitude\n",
                *lines,
                f"\nV: median of the second half of a run, then of {self.runs} runs of "
                f"{self.duration:.2g} s, {closings:.2g} closings each.",
                f"One thing is off at a time; event times jitter by {self.jitter:.2g} s beside it"
                f"{drift}.",
                'Estimators are measured. "guaranteed for" is proven: the replica\'s bound B stays '
                "below the target.\n",
            ]
        )


DESCRIPTIONS = {
    "jitter": "event times jitter",
    "offset": "clocks differ",
    "lost": "events get lost",
    "spurious": "events that were none",
}


def _whats(found: Tolerances) -> list[str]:
    return list(dict.fromkeys(found.limits["what"].tolist()))


def _of(rows: Array, name: str, field: str = "what") -> Array:
    chosen: Array = rows[rows[field] == name]
    return chosen


def amount_text(amount: float, unit: str) -> str:
    """0.3 ms, 5 %, 0.02 rad, 0.1 per s and contact."""
    if unit == "s":
        scale = (1.0, "s") if amount >= 0.1 else (1e3, "ms") if amount >= 1e-4 else (1e6, "us")
        amount, unit = scale[0] * amount, scale[1]
    elif not unit:
        amount, unit = 100.0 * amount, "%"
    text = {"1/s": "per s and contact", "1": ""}.get(unit, unit)
    return f"{amount:.2g} {text}".rstrip()


def limit_text(limit: np.void) -> str:
    """`> 20 ms`: even the largest amount is tolerated; `< 1 us`: not even the least; `-`: never."""
    if limit["kind"] == "never":
        return "-"
    sign = {"beyond_all": "> ", "below_all": "< "}.get(limit["kind"], "")
    return sign + amount_text(float(limit["amount"]), str(limit["unit"]))


# --- computation


class Deviation(NamedTuple):
    """Something that may be off, and the amounts that are tried. Without a unit: shares."""

    what: str  # jitter, offset, lost, spurious, or a parameter's key
    unit: str
    least: float
    most: float
    bounded: str = ""  # field of Tolerance that covers it
    nominal: float = 1.0


class _Trials:
    """Runs of the machine, which all deviations share.

    The first starts as the scene does, the others a tenth of the motion's energy off. Everything is
    computed by the pool.
    """

    def __init__(
        self,
        scene: Scene,
        core: _core._Trials,
        pool: ThreadPoolExecutor,
        target: float | str,
        duration: float | None,
        runs: int,
        estimators: list[str],
    ) -> None:
        from . import _core

        self.scene, self._core, self._pool = scene, core, pool
        self.runs, self.estimators = runs, estimators
        self._end = _core._end_of_inputs(scene)
        rate = self._closings_per_time()
        longest = min(MOST_CLOSINGS / rate, self._end)
        self.duration = min(duration or ENOUGH_CLOSINGS / rate, self._end)
        self.motion_energy = self._energy_of_motion()
        self.target = _energy(target, self.motion_energy)
        first = self._run(self.duration)
        # Twice the time that the replica needs to fall a decade below the target.
        while duration is None and self.duration < longest:
            args = (["replica"], scene, first, SEED, 0)
            (replica,) = pool.submit(core.follow, *args, or_none=True).result()
            found = figures(replica.V, None, first.interval, 0.1 * self.target)
            needed = 2.0 * found.time_below + ENOUGH_CLOSINGS / rate
            if needed <= self.duration:
                break
            self.duration = min(needed if math.isfinite(needed) else 2 * self.duration, longest)
            first = self._run(self.duration)
        self.closings_per_time = first.closings / self.duration
        self._truths = [first, *pool.map(self._run_elsewhere, range(1, runs))]

    def _run(self, duration: float, samples: int = SAMPLES) -> _Truth:
        return self._pool.submit(self._core.run, self.scene, duration, 0.0, samples).result()

    def _run_elsewhere(self, number: int) -> _Truth:
        energy = ENERGY_OF_STARTS * self.motion_energy
        machine, _ = self._core.drawn(self.scene, self.scene, SEED, number, energy)
        return self._core.run(machine, self.duration, 0.0, SAMPLES)

    def _closings_per_time(self) -> float:
        slowest = min(rates_of_excitation(self.scene.model), default=20.0)
        duration = min(20.0 / slowest, self._end)
        for _ in range(12):
            closings = self._run(duration, 2).closings
            if closings >= WANTED_CLOSINGS or duration >= self._end:
                break
            duration = min(2.0 * duration, self._end)
        if not closings:
            raise Error("no contact of the machine closes: an observer would receive no events")
        return closings / duration

    def _energy_of_motion(self) -> float:
        """Mean of V between the motion and its own mean, in the second half of the first run.

        Few samples in a period of the excitation would meet the same phases again and again.
        """
        from ._core import energies

        fastest = max(rates_of_excitation(self.scene.model), default=0.0)
        wanted = SAMPLES_OF_A_PERIOD * self.duration * fastest / (2.0 * math.pi)
        truth = self._run(self.duration, int(min(max(wanted, SAMPLES_OF_MOTION), 1e6)))
        q, u = (of[len(of) // 2 :] for of in (truth.q, truth.u))
        mean_q, mean_u = (np.broadcast_to(of.mean(axis=0), of.shape) for of in (q, u))
        return float(energies(self.scene, q, u, mean_q, mean_u).V.mean())

    def deviations(self) -> list[Deviation]:
        """All deviations of events, and one for every parameter of the machine."""
        from ._core import _parameters_of

        interval = 1.0 / self.closings_per_time
        found = [
            Deviation("jitter", "s", interval / RANGE_OF_TIMES, interval, "time"),
            Deviation("offset", "s", interval / RANGE_OF_TIMES, interval),
            Deviation("lost", "", 1e-4, 0.5),
            Deviation("spurious", "1/s", 1e-4 / interval, 3.0 / interval),
        ]
        for of in _parameters_of(self.scene):
            least = of["most"] / (RANGE_OF_FREQUENCY if of["frequency"] else RANGE_OF_PARAMETER)
            more = (of["bounded"], of["nominal"])
            found.append(Deviation(of["key"], of["unit"], least, of["most"], *more))
        return found

    def spreads(self, deviation: Deviation | None, amount: float) -> list[Spread]:
        """V of each estimator at an amount of a deviation, over all runs."""
        follow = [
            self._pool.submit(self._follow, deviation, amount, run) for run in range(self.runs)
        ]
        V, worse = np.moveaxis(np.array([future.result() for future in follow]), -1, 0)
        columns = (np.median(V, axis=0), V.min(axis=0), V.max(axis=0), worse.mean(axis=0))
        return list(zip(*(column.tolist() for column in columns)))

    def _follow(
        self, deviation: Deviation | None, amount: float, run: int
    ) -> list[tuple[float, float]]:
        """V and `worse` of each estimator in a run. In every other run the sign is negative."""
        given = self.scene
        disturbance: dict[str, Any] = {"jitter": given.jitter}
        signed = -amount if run % 2 else amount
        what = deviation.what if deviation else "nothing"
        if what == "jitter":
            given = given.replace(jitter=amount)
        if what in ("jitter", "lost", "spurious"):
            disturbance[what] = amount
        elif what == "offset":
            disturbance[what] = signed
        elif deviation:
            wrong = self._wrong(what, signed)
            if wrong is None:
                return [(math.inf, math.nan)] * len(self.estimators)
            given = wrong
        truth = self._truths[run]
        args = (self.estimators, given, truth, SEED, run)
        V = [of.V for of in self._core.follow(*args, or_none=True, **disturbance)]
        replica = dict(zip(self.estimators, V)).get("replica")
        found = [
            figures(of, None if of is replica else replica, truth.interval, self.target) for of in V
        ]
        return [(of.V_floor, of.worse) for of in found]

    def _wrong(self, key: str, amount: float) -> Scene | None:
        """The observer's scene with a wrong parameter; None if it cannot be off by so much."""
        from ._core import _with_wrong

        for signed in (amount, -amount):
            with contextlib.suppress(ModelError):
                return _with_wrong(self.scene, key, signed)
        return None

    def guaranteed(self, deviation: Deviation) -> tuple[float, str] | None:
        """Largest amount for which the median of the replica's bound is below the target.

        None if the bound does not cover the deviation, or the machine has no bound.
        """
        from ._core import Tolerance, energies

        if not deviation.bounded or not deviation.nominal > 0.0:
            return None
        scene, factor, limit = self.scene, 1.0, 0.5
        if deviation.bounded == "time":
            limit = math.inf
        elif deviation.bounded == "restitution":
            factor, limit = max(contact.restitution for contact in scene.model.contacts), 1.0
        elif deviation.unit:
            factor = 1.0 / deviation.nominal
        starts = (of[None] for start in (scene.master, scene.replica) for of in (start.q, start.u))
        V = max(energies(scene, *starts).V[0], 1e-12 * self.motion_energy)
        uncertainty = np.full(scene.f, V / scene.f)

        def bound(amount: float) -> float:
            given = Tolerance(**{deviation.bounded: min(factor * amount, limit)})
            args = (scene, given, uncertainty, self._truths[0])
            return self._pool.submit(self._core.bound, *args).result()

        low, high = 1e-4 * deviation.least, deviation.most
        lowest = bound(low)
        if not lowest < self.target:
            return (math.nan, "never") if math.isfinite(lowest) else None
        if bound(high) < self.target:
            return high, "beyond_all"
        for _ in range(BISECTIONS):
            middle = math.sqrt(low * high)
            low, high = (middle, high) if bound(middle) < self.target else (low, middle)
        return low, "within"


def amounts(least: float, most: float) -> list[float]:
    """1, 2 and 5 times powers of ten."""
    powers = range(math.floor(math.log10(least)), math.floor(math.log10(most)) + 1)
    values = [float(f"{digit}e{power}") for power in powers for digit in (1, 2, 5)]
    return [value for value in values if least <= value <= most]


def _search(
    trials: _Trials, deviation: Deviation, undisturbed: list[Spread]
) -> tuple[Rows, Rows, Rows]:
    """Rows of limits, guaranteed and points of a deviation.

    Amounts by decades until V of each estimator has crossed the target, then between them: a
    bisection of the whole range could miss the first crossing, since clocks that differ by a period
    of the force differ by nothing.
    """
    grid = amounts(deviation.least, deviation.most)
    tried: dict[int, list[Spread]] = {}
    found = [e for e, spread in enumerate(undisturbed) if spread[0] < trials.target]

    def attempt(place: int) -> None:
        tried[place] = trials.spreads(deviation, grid[place])

    def crossing(e: int) -> tuple[int, int]:
        """Places in `grid` around it; before the first, or after the last, if there is none."""
        below = -1
        for place in sorted(tried):
            if not tried[place][e][0] < trials.target:
                return below, place
            below = place
        return below, len(grid)

    for place, amount in enumerate(grid):
        if f"{amount:e}".startswith("1") or place == len(grid) - 1:
            attempt(place)
            if all(crossing(e)[1] < len(grid) for e in found):
                break
    limits = [(math.nan, "never")] * len(undisturbed)
    for e in found:
        low, high = crossing(e)
        while high - low > 1:
            attempt((low + high) // 2)
            low, high = crossing(e)
        if high == len(grid):
            limits[e] = grid[low], "beyond_all"
        elif low < 0:
            limits[e] = grid[high], "below_all"
        else:
            V = tried[low][e][0], tried[high][e][0]
            limits[e] = _between(grid[low], grid[high], *V, trials.target), "within"
    what, unit = deviation.what, deviation.unit
    names = trials.estimators
    proven = trials.guaranteed(deviation)
    return (
        [(what, name, of, unit, kind) for name, (of, kind) in zip(names, limits)],
        [(what, proven[0], unit, proven[1])] if proven else [],
        [
            (what, unit, grid[place], name, *spread)
            for place in sorted(tried)
            for name, spread in zip(names, tried[place])
        ],
    )


def _between(low: float, high: float, V_low: float, V_high: float, target: float) -> float:
    """Where V crosses the target, linear in the logarithms of amounts and V."""
    if not (math.isfinite(V_high) and V_low > 0.0):
        return low
    share = math.log(target / V_low) / math.log(V_high / V_low)
    return float(low * (high / low) ** share)


def tolerance(
    scene: Scene | str | os.PathLike[str],
    *,
    target: float | str = USUAL_TARGET,
    duration: float | None = None,
    jitter: float | None = None,
    drift: float | None = None,
    runs: int = 7,
    estimators: Sequence[str] = USUAL_ESTIMATORS,
    jobs: int | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Tolerances:
    """Finds how far event times and parameters of a scene may be off, one at a time.

    scene: a Scene, or a file or name as for read_scene(). target: of V, an energy, or a text such
    as "1%" of the motion's amplitude; duration [s] and runs of each amount, duration None: twice
    the time that the replica needs, and 200 closings; jitter [s] of event times besides a
    deviation, and drift that filters assume [energy per unit of time], None: the scene's;
    estimators: "replica", "timing", "both" or "adaptive". jobs: number of threads, None: one for
    each core. progress: receives how many of all deviations are done. Raises SceneError for a wrong
    scene file, ModelError, ValueError, or Error if no contact closes.
    """
    core = _command.require_compiled("tolerance")
    machine: Scene = scene if isinstance(scene, core.Scene) else core.read_scene(scene)
    _energy(target, 1.0)
    for name, value in {"duration": duration, "jitter": jitter, "drift": drift}.items():
        _positive(1.0 if value is None else value, name)
    for name, number in {"runs": runs, "jobs": jobs}.items():
        if number is not None and number < 1:
            raise ValueError(f"{name} must be >= 1")
    chosen = list(estimators) or list(USUAL_ESTIMATORS)
    for name in chosen:
        if name not in ESTIMATORS:
            raise ValueError(f"estimator: {choose(name, ESTIMATORS)}")
    machine = machine.replace(
        jitter=machine.jitter if jitter is None else jitter,
        drift=machine.drift if drift is None else drift,
    )
    if "adaptive" in chosen:
        core.observe(machine, [], 1.0, tick=1.0, estimator="adaptive")  # raises if there is none
    if not core._has_master(machine):
        machine = machine.replace(master=machine.replica)
    if duration is not None and duration > (end := core._end_of_inputs(machine)):
        raise ValueError(
            f"the recorded input of {machine.name} ends at t = {end:g}; duration must be at "
            f'most {end:g}, or the table with the key `file` must have outside = "zero" or '
            '"hold"'
        )
    # The threads of `searches` wait for those of `pool`, which compute.
    computing: _core._Trials = core._Trials()
    with ThreadPoolExecutor(MOST_DEVIATIONS) as searches, _pool(computing, jobs) as pool:
        trials = _Trials(machine, computing, pool, target, duration, runs, chosen)
        undisturbed = trials.spreads(None, 0.0)
        limits: Rows = []
        guaranteed: Rows = []
        points: Rows = [("nothing", "", 0.0, name, *V) for name, V in zip(chosen, undisturbed)]
        deviations = trials.deviations()
        results = searches.map(lambda of: _search(trials, of, undisturbed), deviations)
        for done, rows in enumerate(results, start=1):
            for all_rows, more in zip((limits, guaranteed, points), rows):
                all_rows += more
            progress(done, len(deviations))
    return Tolerances(
        scene=machine.name,
        estimators=chosen,
        target=trials.target,
        motion_energy=trials.motion_energy,
        duration=trials.duration,
        runs=runs,
        closings_per_time=trials.closings_per_time,
        jitter=machine.jitter,
        drift=machine.drift,
        limits=np.array(limits, dtype=[WHAT, ESTIMATOR, *LIMIT]),
        guaranteed=np.array(guaranteed, dtype=[WHAT, *LIMIT]),
        points=np.array(points, dtype=[WHAT, UNIT, ("amount", "f8"), ESTIMATOR, *SPREAD]),
    )


def _positive(value: float | str, name: str) -> float:
    number = float(value)
    if not 0.0 < number < math.inf:
        raise ValueError(f"{name} must be > 0")
    return number


def _energy(target: float | str, of_motion: float) -> float:
    """The largest V that is good enough: an energy, or as "1%" of the amplitude."""
    if isinstance(target, str):
        return (_positive(target.removesuffix("%"), "target") / 100.0) ** 2 * of_motion
    return _positive(target, "target")


@contextlib.contextmanager
def _pool(computing: _core._Trials, jobs: int | None) -> Iterator[ThreadPoolExecutor]:
    """Threads that compute; they end at once after an exception."""
    with ThreadPoolExecutor(jobs or os.cpu_count() or 1) as pool:
        try:
            yield pool
        except BaseException:
            computing.stop()
            pool.shutdown(cancel_futures=True)
            raise


# --- files and pictures


def to_json(found: Tolerances) -> dict[str, Any]:
    """All results as the program writes them; numbers that are not finite are null."""

    def spreads(points: Array) -> dict[str, Any]:
        return {
            str(point["estimator"]): {
                name: float(point[name]) if math.isfinite(point[name]) else None
                for name, _ in SPREAD
                if name != "worse" or not math.isnan(point[name])
            }
            for point in points
        }

    def limit_of(limit: np.void) -> dict[str, Any]:
        of: dict[str, Any] = {"kind": str(limit["kind"]), "text": limit_text(limit)}
        return of if of["kind"] == "never" else {**of, "amount": float(limit["amount"])}

    disturbances = []
    for what in _whats(found):
        limits, points = _of(found.limits, what), _of(found.points, what)
        unit = str(limits["unit"][0])
        of: dict[str, Any] = {"what": what, "unit": unit, "share": not unit}
        of["tolerance"] = {str(limit["estimator"]): limit_of(limit) for limit in limits}
        for proven in _of(found.guaranteed, what):
            of["guaranteed"] = limit_of(proven)
        of["points"] = [
            {"amount": amount, "V": spreads(points[points["amount"] == amount])}
            for amount in dict.fromkeys(points["amount"].tolist())
        ]
        disturbances.append(of)
    names = "scene target amplitude motion_energy duration runs closings_per_time jitter drift"
    return {
        **{name: getattr(found, name) for name in names.split()},
        "undisturbed": spreads(_of(found.points, "nothing")),
        "disturbances": disturbances,
    }


def to_csv(found: Tolerances) -> str:
    """All that was tried, a row for each amount and estimator; the first without a deviation."""
    lines = [",".join(found.points.dtype.names or ())]
    for point in found.points.tolist():
        lines.append(",".join(c if isinstance(c, str) else f"{c:.17g}" for c in point))
    return "\n".join(lines) + "\n"


LABELS = {
    "jitter": "jitter of event times [s]",
    "offset": "offset of event times [s]",
    "lost": "events lost [%]",
    "spurious": "false pulses per s and contact",
}
LINES = {"replica": "-", "timing": (0, (1.5, 1.0)), "both": (0, (5.0, 2.0)), "adaptive": "-."}
ACROSS = 3  # panels
LOWEST = 1e-10  # of the target: V below needs no resolution
HIGHEST = 100.0  # of the energy of the motion: V above has diverged


def draw(found: Tolerances) -> Figure:
    """V of every estimator against the amounts, with the target: a panel for each deviation."""
    from ._drawing import WIDTH, logarithmic_ticks, new_figure, style

    V = found.points["median"][found.points["median"] > 0.0]
    low = min(max(V.min(), LOWEST * found.target), found.target) / 3.0
    high = 3.0 * max(min(V.max(), HIGHEST * found.motion_energy), found.motion_energy)
    with style():
        whats = _whats(found)
        down = -(-len(whats) // ACROSS)
        title = f"{found.scene}: V that is left, against what is off (shaded: all runs)"
        figure = new_figure(WIDTH, 0.6 + 1.55 * down, title)
        grid = figure.add_gridspec(down + 1, ACROSS, height_ratios=[0.12] + [1.0] * down)
        panels: list[Axes] = []
        for i, what in enumerate(whats):
            place = grid[1 + i // ACROSS, i % ACROSS]
            panels.append(figure.add_subplot(place, sharey=panels[0] if panels else None))
            _draw_panel(panels[-1], found, what, (low, high))
            panels[-1].tick_params(labelleft=i % ACROSS == 0)
            panels[-1].set_ylabel("" if i % ACROSS else "V [J]")
        panels[0].set_ylim(low, high)
        logarithmic_ticks(panels[0].yaxis, low, high)
        top = figure.add_subplot(grid[0, :])
        top.axis("off")
        lines = panels[0].lines
        top.legend(handles=lines, loc="center left", ncol=len(lines), borderpad=0.0)
        return figure


def _draw_panel(panel: Axes, found: Tolerances, what: str, ends_of_V: tuple[float, float]) -> None:
    from ._drawing import legible, logarithmic_ticks
    from .plot_study import ESTIMATORS as COLOURS

    points = _of(found.points, what)
    unit = str(points["unit"][0])
    factor = 1.0 if unit else 100.0
    for name in found.estimators:
        own = _of(points, name, "estimator")
        low, median, high = (
            np.clip(np.nan_to_num(own[column], nan=np.inf), *ends_of_V)
            for column in ("low", "median", "high")
        )
        look = {"color": COLOURS[name]}
        panel.fill_between(factor * own["amount"], low, high, alpha=0.15, lw=0, **look)
        panel.plot(factor * own["amount"], median, ls=LINES[name], label=name, **look)
    panel.axhline(found.target, color="#202020", lw=0.8, ls=(0, (1.0, 1.5)), label="target")
    of_unit = {"": " [%]", "1": ""}.get(unit, f" [{unit}]")
    panel.set(xscale="log", yscale="log", xlabel=LABELS.get(what, legible(what + of_unit)))
    ends = factor * points["amount"].min(), factor * points["amount"].max()
    panel.set_xlim(*ends)
    logarithmic_ticks(panel.xaxis, *ends)


# --- the program


def _target(text: str) -> float | str:
    share = text.strip().removesuffix("%").strip()
    number = _command.positive(share)
    return number if share == text.strip() else f"{share}%"


def _run(options: argparse.Namespace, report: dict[str, Any]) -> int:
    from .plot import check_picture, write_figure

    for name in options.estimator:
        if name not in ESTIMATORS:
            raise UsageError(f"--estimator: {choose(name, ESTIMATORS)}")
    if options.output:
        check_picture(options.output)
    core = _command.require_compiled("tolerance")
    with warnings.catch_warnings(record=True) as remarks:
        scene = core.read_scene(_command.scene_file(options.SCENE))
    for remark in remarks:
        print(printable(str(remark.message)), file=sys.stderr)

    def show(done: int, total: int) -> None:
        if sys.stderr.isatty():
            end = "\n" if done == total else ""
            print(f"\r{done} of {total} deviations", end=end, file=sys.stderr, flush=True)

    with contextlib.ExitStack() as files:
        csv = files.enter_context(_command.written(options.csv)) if options.csv else None
        picture = files.enter_context(_command.written(options.output)) if options.output else None
        asked = ("target", "duration", "jitter", "drift", "runs", "jobs")
        given = {name: getattr(options, name) for name in asked}
        try:
            found = tolerance(scene, **given, estimators=options.estimator, progress=show)
        except ValueError as error:
            raise UsageError(str(error)) from None
        result = to_json(found)
        report.update(result)
        text = json.dumps(result, ensure_ascii=False) + "\n" if options.json else str(found)
        print(text, end="", flush=True)
        if csv:
            with _command.writing(options.csv):
                csv.write_text(to_csv(found), encoding="utf-8")
        if picture:
            with _command.writing(options.output):
                write_figure(draw(found), picture, Path(options.output).suffix[1:])
    return EXIT_DONE


def main() -> int:
    """The program ``tolerance``."""
    parser = Parser(
        "tolerance",
        "Reports the largest deviations for which V, the energy of the error, stays below a "
        "target: jitter and offset of event times, lost and spurious events, and errors of every "
        "parameter of the scene. The observers are run on the scene's machine with one deviation "
        "at a time.",
    )
    positive = _command.positive

    def add(name: str, metavar: str, type_: Any, text: str, **more: Any) -> None:
        parser.add_argument(name, metavar=metavar, type=type_, help=text, **more)

    add("SCENE", "SCENE", SceneFile, "scene file, or the name of a scene that comes with Sprag")
    target = "largest V that is good enough: an energy, or in %% of the motion's amplitude"
    add("--target", "V", _target, target, default=USUAL_TARGET)
    estimators = "replica, timing, both (these by default), adaptive"
    more = {"action": "extend", "default": []}
    add("--estimator", "NAME,...", _command.names, estimators, **more)
    jitter = "standard deviation of event times beside a deviation; default the scene's [s]"
    add("--jitter", "SIGMA", positive, jitter)
    drift = "energy by which filters take their model to depart from the machine, per unit of time"
    add("--drift", "D", positive, f"{drift}; default the scene's")
    add("--runs", "n", _command.count, "runs of each amount", default=7)
    duration = "of a run; default twice the time to convergence of the replica, and 200 closings"
    add("--duration", "T", positive, f"{duration} [s]")
    add("--output", "F", Written, "draw V against every amount: .png, .svg or .pdf")
    add("--csv", "F.csv", Written, "write all that was tried")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    add("--jobs", "n", _command.jobs, "threads; default: all cores")
    return _command.run_program(parser, _run)
