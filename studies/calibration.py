#!/usr/bin/python3
"""Holds the standard deviations that an estimator claims against its errors.

Each machine is simulated, its event times are disturbed, and every coordinate and velocity at every
tick is compared with the claimed sigma. Prints a row for each MACHINES and jitter: mean square of
error over sigma (median of the runs), shares beyond 3 and 5 sigma, share of values without a sigma,
median V over that of the replica in the second half of the run, and the number of runs that are
falsely certain, of which more than 1 % of the values are beyond 5 sigma.

MACHINES: a shipped scene, modes:N (the paper's beam with N modes), or drawn machines with one
contact, single:FIRST-LAST, or with two to four, coupled:FIRST-LAST.
PYTHONPATH=DIR measures another version, whose package is in DIR.
"""
import argparse
from typing import Any

import numpy as np

from machines import Array, disturbed, energy, machines, scaled, slowest_period, sprag

PERIODS, TICKS, EVENTS = 60.0, 3000, 2500
TROUBLES: dict[str, dict[str, float]] = {
    "none": {},
    "lost": {"lost": 0.1},
    "spurious": {"more": 0.1},
    "wrong": {},
}
HEAD = ["machines", "jitter", "runs", "mean square", "> 3 sigma [%]", "> 5 sigma [%]"]
HEAD += ["no sigma [%]", "V over replica's", "falsely certain"]


def wrong(scene: sprag.Scene, rng: np.random.Generator) -> sprag.Scene:
    """Stiffness, damping or restitution is off by 1 to 5 %."""
    off = rng.choice([-1.0, 1.0]) * rng.uniform(0.01, 0.05)
    key = rng.choice(["stiffness", "damping", "restitution"])
    return scaled(scene, **{key: off if key == "restitution" else 1.0 + off})


def errors(scene: sprag.Scene, seed: int, share: float, options: Any) -> tuple[Array, float] | None:
    """Errors over sigma of one run, nan without a sigma, and V over that of the replica; None if
    the machine cannot be simulated or is never hit."""
    rng = np.random.default_rng(seed)
    period = slowest_period(scene)
    duration, jitter = PERIODS * period, share * period
    try:
        few = sprag.simulate(scene, duration, tick=duration).events[:EVENTS]
        if len(few) == 0:
            return None
        duration = min(duration, float(few["t"][-1]))
        tick = duration / TICKS
        truth = sprag.simulate(scene, duration, tick=tick)
    except sprag.SimulationError:
        return None
    seen = disturbed(truth.events, rng, jitter, **TROUBLES[options.trouble])
    given = wrong(scene, rng) if options.trouble == "wrong" else scene
    given = given.replace(jitter=jitter, confidence=options.confidence)
    if options.bound:
        given = given.replace(tolerance=sprag.Tolerance(time=4.0 * jitter))
    estimate = sprag.observe(given, seen, duration, tick=tick, estimator=options.estimator)
    replica = sprag.observe(given, seen, duration, tick=tick, estimator="replica")
    off = np.abs(np.hstack([estimate.q - truth.q, estimate.u - truth.u]))
    sigma = np.hstack([estimate.sigma_q, estimate.sigma_u])
    with np.errstate(divide="ignore", invalid="ignore"):
        z = np.where(off == 0.0, 0.0, off / sigma)
    V = [np.median(energy(scene, truth, other)[TICKS // 2 :]) for other in (estimate, replica)]
    return np.where(np.isfinite(sigma), z, np.nan), V[0] / V[1]


def row(name: str, share: float, options: Any) -> list[str]:
    runs = [
        run
        for scene in machines(name)
        for seed in range(1, options.draws + 1)
        if (run := errors(scene, seed, share, options)) is not None
    ]
    false = sum(np.sum(z > 5.0) > 0.01 * max(np.sum(np.isfinite(z)), 1) for z, _ in runs)
    z = np.concatenate([z.ravel() for z, _ in runs])
    known = z[~np.isnan(z)]
    shares = [100.0 * np.mean(known > limit) for limit in (3.0, 5.0)] + [100 * np.mean(np.isnan(z))]
    squares = [np.nanmean(z**2) for z, _ in runs if not np.all(np.isnan(z))]
    figures = [np.median(squares), *shares, np.median([ratio for _, ratio in runs])]
    return [name, f"{share:g}", f"{len(runs)}", *(f"{x:.2g}" for x in figures), f"{false}"]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("machines", nargs="+", metavar="MACHINES")
    parser.add_argument(
        "--jitter",
        type=float,
        nargs="+",
        default=[1e-6, 1e-5, 1e-4, 1e-3, 1e-2],
        metavar="SHARE",
        help="standard deviations of the event times, of the slowest period",
    )
    parser.add_argument("--draws", type=int, default=1, help="of the disturbance, each machine")
    parser.add_argument("--estimator", choices=["timing", "both"], default="both")
    parser.add_argument("--confidence", choices=["low", "medium", "high"], default="high")
    parser.add_argument(
        "--trouble",
        choices=list(TROUBLES),
        default="none",
        help="a tenth of the events lost, or more; or a parameter off by 1 to 5 %%",
    )
    parser.add_argument(
        "--bound", action="store_true", help="with a tolerance of 4 times the jitter"
    )
    options = parser.parse_args()
    print("| " + " | ".join(HEAD) + " |\n|" + "---|" * len(HEAD))
    for name in options.machines:
        for share in options.jitter:
            print("| " + " | ".join(row(name, share, options)) + " |", flush=True)


if __name__ == "__main__":
    main()
