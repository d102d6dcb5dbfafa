#!/usr/bin/python3
"""Measures how conservative the guaranteed bound is under tolerances.

Prints, for each tolerance and machine, relative to the square root of the median energy of the
motion: the certified floor, sqrt of the median bound in the second half of the run, and the largest
median error of the replica that shifts of the event times within the tolerance, or parameters at
their limits, cause. For tolerances of time also the median error of the timing filter with a jitter
of a quarter of the tolerance. Drawn machines: medians of those without and with sustained contacts.
Fails if an error exceeds the bound.
"""
from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np

from machines import Array, Events, energy, machines, scaled, sprag

RUNS = {"paper_beam": 400.0, "paper_beam_frame": 400.0, "lab_rig": 40.0}
DRAWN, DURATION, IMPACTS = "single:1-24", 500.0, 50
LIMITS = [{"time": t} for t in (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)]
LIMITS += [{"restitution": 1e-2}, {"stiffness": 1e-4}, {"stiffness": 1e-3}, {"stiffness": 1e-2}]
LIMITS += [{"damping": 1e-1}]


def moved(events: Events, shift: Array) -> Events:
    """The events with shifted times, in their order."""
    events = events.copy()
    t = np.maximum(events["t"] + shift, 0.0)
    for k in range(1, len(t)):
        t[k] = max(t[k], np.nextafter(t[k - 1], np.inf))
    events["t"] = t
    return events


def shifts(n: int, delta: float, rng: np.random.Generator) -> Iterator[Array]:
    yield np.full(n, delta)
    yield np.full(n, -delta)
    yield delta * (-1.0) ** np.arange(n)
    for _ in range(5):
        yield delta * rng.choice([-1.0, 1.0], n)


def at_limits(scene: sprag.Scene, limits: dict[str, float]) -> list[sprag.Scene]:
    """Machines with the parameters at both limits; one machine if only times are uncertain."""
    if "time" in limits:
        return [scene]
    (key, limit), sign = *limits.items(), (1.0, -1.0)
    nominal = 0.0 if key == "restitution" else 1.0
    return [scaled(scene, **{key: nominal + s * limit}) for s in sign]


def run(
    scene: sprag.Scene, duration: float, rng: np.random.Generator, limits: dict[str, float]
) -> list[float]:
    """Certified floor, largest median error found, median error of the filter."""
    delta = limits.get("time", 0.0)
    # Rounding must not lift the energy of the error at the start above the stated uncertainty.
    start = float(energy(scene, scene.master, scene.replica)[0])
    scene = scene.replace(uncertainty=np.full(scene.f, 1.01 * max(start, 1e-12) / scene.f))
    limited = scene.replace(tolerance=sprag.Tolerance(**limits))
    floors, found = [], []
    for machine in at_limits(scene, limits):
        truth = sprag.simulate(machine, duration)
        rest = SimpleNamespace(q=0.0 * truth.q, u=0.0 * truth.u)
        motion = np.median(energy(scene, truth, rest))
        late = len(truth.t) // 2
        for shift in shifts(len(truth.events), 0.999 * delta, rng):
            seen = sprag.observe(limited, moved(truth.events, shift), duration, estimator="replica")
            V, B = energy(scene, truth, seen), seen.bound
            assert np.all(V[np.isfinite(B)] <= B[np.isfinite(B)]), (scene.name, limits)
            floors.append(np.sqrt(np.median(B[late:]) / motion))
            found.append(np.sqrt(np.median(V[late:]) / motion))
            if not delta:
                break
    jitter = delta / 4
    noise = np.clip(rng.normal(0.0, jitter, len(truth.events)), -delta, delta)
    given = scene.replace(jitter=jitter)
    seen = sprag.observe(given, moved(truth.events, noise), duration, estimator="timing")
    of_filter = np.sqrt(np.median(energy(scene, truth, seen)[late:]) / motion)
    return [max(floors), max(found), of_filter]


def main() -> None:
    rng = np.random.default_rng(1)
    groups = {name: (machines(name), duration) for name, duration in RUNS.items()}
    drawn: dict[bool, list[sprag.Scene]] = {False: [], True: []}
    for scene in machines(DRAWN):
        events = sprag.simulate(scene, DURATION).events
        if len(events) >= IMPACTS:
            stays = np.any(events["kind"] == sprag.ContactEventKind.CLOSES)
            drawn[bool(stays)].append(scene)
    groups[f"{len(drawn[False])} drawn"] = drawn[False], DURATION
    groups[f"{len(drawn[True])} drawn, chatter"] = drawn[True], DURATION
    print("| tolerance | " + " | ".join(groups) + " |\n|---|" + "---|" * len(groups))
    for limits in LIMITS:
        cells = []
        for scenes, duration in groups.values():
            medians = np.median([run(scene, duration, rng, limits) for scene in scenes], axis=0)
            cells.append(" / ".join(f"{x:.2g}" for x in medians[: 3 if "time" in limits else 2]))
        label = ", ".join(f"{key} {value:g}" for key, value in limits.items())
        print(f"| {label} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
