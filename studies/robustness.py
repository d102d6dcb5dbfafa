#!/usr/bin/python3
"""Prints the tables of docs/measurements/robustness.md on the paper's beam, and draws its figures.

usage: robustness.py [FOLDER]    default out/robustness. Takes five minutes.
"""
import statistics
import subprocess
import sys
from pathlib import Path

from machines import ROOT, sprag

SPRAG = ROOT / "build" / "sprag"
DRIFTS: dict[str, list[str]] = {"tolerance": [], "tolerance_drift": ["--drift", "1e-5"]}
ESTIMATORS = ["replica", "timing", "both"]


def medians(study: sprag.Study, name: str) -> list[tuple[dict[str, float], float]]:
    """The values of the axes of each point, and the median of a record over its runs."""
    points: dict[tuple[float, ...], list[float]] = {}
    for *axes, value in zip(*(study[axis] for axis in study.axes), study[name]):
        points.setdefault(tuple(axes), []).append(float(value))
    return [
        (dict(zip(study.axes, axes)), statistics.median(values)) for axes, values in points.items()
    ]


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "out" / "robustness")
    folder.mkdir(parents=True, exist_ok=True)
    for name, drift in DRIFTS.items():
        command: list[str | Path] = [
            SPRAG,
            "tolerance",
            "paper_beam",
            "--target",
            "1e-4",
            "--jitter",
            "1e-4",
        ]
        command += [*drift, "--output", folder / f"{name}.png"]
        subprocess.run(command, check=True)
    for name in ("paper_beam_jitter", "paper_beam_events", "paper_beam_drift", "paper_beam_modes"):
        subprocess.run([SPRAG, "study", name, "--output", folder / name], check=True)
        study = sprag.read_study(folder / name)
        print("| " + " | ".join([*study.axes, *ESTIMATORS]) + " |")
        print("|---" * (len(study.axes) + 3) + "|")
        columns = [medians(study, f"{estimator}.V_floor") for estimator in ESTIMATORS]
        for cells in zip(*columns):
            values = [*cells[0][0].values(), *(V for _, V in cells)]
            print("| " + " | ".join(f"{value:.2g}" for value in values) + " |")
    picture: list[str | Path] = [SPRAG, "plot", folder / "paper_beam_jitter" / "rows.csv"]
    picture += ["--output", folder / "jitter.png", "--show", "timing.V_floor,both.V_floor"]
    subprocess.run(picture, check=True)


if __name__ == "__main__":
    main()
