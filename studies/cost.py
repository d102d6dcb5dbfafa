#!/usr/bin/python3
"""Measures what estimators cost, and what a finer tick is worth.

Two tables:
- ns a tick without events and us an event, by the modes of the paper's beam: CPU time of replays by
  the program `observer`. A tick is the difference between two ticks of a run without events, an
  event the difference between a run with and one without;
- V after 100 units of time by the tick.
The least CPU time of REPEATS runs counts. Needs a quiet machine.
"""
import resource
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from machines import ROOT, Events, disturbed, energy, machines, sprag

OBSERVER = ROOT / "build" / "observer" / "observer"
ESTIMATORS = ["replica", "timing", "both"]
JITTER, REPEATS = 1e-4, 3


def seconds(scene: sprag.Scene, events: Events, duration: float, tick: float, name: str) -> float:
    """Least CPU time [s] of a replay, with the start of the program."""
    with tempfile.TemporaryDirectory() as folder:
        file, table = Path(folder) / "scene.toml", Path(folder) / "events.csv"
        sprag.write_scene(file, scene)
        lines = []
        for event in events:
            levels = {sprag.ContactEventKind.CLOSES: [1], sprag.ContactEventKind.OPENS: [0]}
            for closed in levels.get(event["kind"], [1, 0]):
                lines.append(f"{event['t']!r},{event['contact']},{closed}\n")
        table.write_text("t,contact,closed\n" + "".join(lines), encoding="utf-8")
        command: list[str | Path] = [OBSERVER, file, "--replay", table, "--duration", f"{duration}"]
        command += ["--tick", f"{tick}", "--estimator", name]
        times = []
        for _ in range(REPEATS):
            before = sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
            subprocess.run(command, check=True, capture_output=True)
            times.append(sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2]) - before)
        return min(times)


def table(*head: str) -> None:
    print("| " + " | ".join(head) + " |\n|" + "---|" * len(head))


def costs() -> None:
    table("modes", "estimator", "a tick [ns]", "an event [us]", "with a jitter [us]")
    for modes in (3, 10, 50):
        (scene,) = machines(f"modes:{modes}")
        duration = 3000.0 / modes
        exact = sprag.simulate(scene, duration).events
        for name in ESTIMATORS:
            idle = seconds(scene, exact[:0], duration, 1.0, name)
            tick = (seconds(scene, exact[:0], duration, duration / 3e6, name) - idle) / 3e6
            row = [f"{modes}", name, f"{1e9 * tick:.1f}"]
            for jitter in (0.0, JITTER):
                events = disturbed(exact, np.random.default_rng(1), jitter)
                run = seconds(scene.replace(jitter=jitter), events, duration, 1.0, name)
                row.append(f"{1e6 * (run - idle) / len(events):.2g}")
            print("| " + " | ".join(row) + " |", flush=True)


def ticks() -> None:
    table("tick [s]", "estimator", "V, exact times", "V, jitter 1e-4 s")
    (scene,) = machines("paper_beam")
    for tick in (1e-1, 1e-2, 1e-3, 1e-4):
        truth = sprag.simulate(scene, 100.0, tick=tick)
        late = truth.t > 98.0
        for name in ESTIMATORS:
            row = [f"{tick:g}", name]
            for jitter in (0.0, JITTER):
                given = scene.replace(jitter=jitter)
                events = disturbed(truth.events, np.random.default_rng(1), jitter)
                estimate = sprag.observe(given, events, 100.0, tick=tick, estimator=name)
                row.append(f"{np.median(energy(scene, truth, estimate)[late]):.2g}")
            print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    costs()
    print()
    ticks()
