#!/usr/bin/python3
"""Draws the charts of docs/measurements/speed_accuracy.md, and prints the orders of the methods.

usage: charts.py FOLDER    reads FOLDER/work_precision.csv, writes FOLDER/paper_beam.png and
                           FOLDER/error_of_q.png
"""
import csv
import math
import sys
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.axes import Axes  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from matplotlib.lines import Line2D  # noqa: E402

INK, MUTED = "#202020", "#707070"
# Palette of Okabe and Ito, distinguishable with red-green colour blindness, and a darker shade of
# some colours.
BLACK, GREY = "#000000", "#7f7f7f"
VERMILION, ORANGE, YELLOW = "#d55e00", "#e69f00", "#c9b800"
BLUE, SKY, NAVY = "#0072b2", "#56b4e9", "#00395c"
GREEN, PINE = "#009e73", "#00513b"
PURPLE, PLUM = "#cc79a7", "#7a3b63"

DASHED = (0, (5, 2.5))
plt.rcParams.update(
    {
        "font.size": 9,
        "axes.titlesize": 9.5,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.edgecolor": MUTED,
        "axes.grid": True,
        "axes.axisbelow": True,
        "axes.unicode_minus": True,
        "grid.color": "#dddddd",
        "grid.linewidth": 0.6,
        "legend.frameon": False,
        "xtick.color": INK,
        "ytick.color": INK,
    }
)
PIXELS = 120.0  # per inch
Points = list[tuple[float, float]]


def rows(directory: Path, name: str) -> list[dict[str, str]]:
    """The rows of DIRECTORY/NAME.csv by column."""
    with open(directory / f"{name}.csv", newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def number(text: str) -> float:
    """A cell as a number; nan if it is none."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def grid(
    width: float, height: float, down: int = 1, across: int = 1, title: str = "", below: float = 0.0
) -> tuple[Figure, Any]:
    """A figure of `width` x `height` pixels with down x across axes, and the axes as an array.

    `below`: height [pixels] below the axes that legend_below() uses.
    """
    figure = plt.figure(figsize=(width / PIXELS, height / PIXELS), layout="constrained")
    body = figure
    if below:
        body, _ = figure.subfigures(2, 1, height_ratios=[height - below, below])
    axes = body.subplots(down, across, squeeze=False)
    if title:
        body.suptitle(title, fontsize=11)
    return figure, axes


def curve(ax: Axes, points: Points, **look: Any) -> None:
    """A line with markers through the points."""
    x, y = zip(*points) if points else ((), ())
    ax.plot(x, y, **({"marker": "o", "markersize": 4.5, "linewidth": 1.6} | look))


def legend_below(figure: Figure, handles: list[Any], columns: int) -> None:
    """A legend in the space that grid() has left below all axes."""
    figure.subfigs[1].legend(
        handles=handles, loc="center", ncols=columns, frameon=False, fontsize=9
    )


def save(figure: Figure, directory: Path, name: str) -> None:
    """Writes DIRECTORY/NAME.png."""
    picture = directory / f"{name}.png"
    figure.savefig(picture, dpi=PIXELS, metadata={"Software": None})
    plt.close(figure)
    print(picture)


OURS = VERMILION
SCENES = [
    "paper_beam",
    "paper_beam_chatter",
    "paper_beam_frame",
    "stiff_beam",
    "two_stops_beam",
    "bouncing_ball",
]

# A method has the same colour in every chart: Sprag vermilion, other event-driven methods blue and
# purple, time stepping green, brown and grey. Peers (programs of other projects) are dashed.
METHODS = {
    "exact": (OURS, "o"),
    "odeint dopri5": (BLUE, "^"),
    "RK4": (SKY, "s"),
    "CVODE Adams": (PLUM, "v"),
    "CVODE BDF": (PURPLE, "D"),
    "Siconos event-driven": (NAVY, "p"),
    "Moreau-Jean 1/2": (PINE, "h"),
    "Moreau-Jean 1": (GREEN, "8"),
    "generalized-alpha": (YELLOW, ">"),
    "penalty": (GREY, "H"),
    "Siconos Moreau-Jean": (GREEN, "x"),
    "Siconos Bilbao": (ORANGE, "*"),
    "MuJoCo": (BLACK, "P"),
}
COST = "CPU time per unit of simulated time [µs]"


def style(method: str, peer: bool = False) -> dict[str, Any]:
    color, marker = METHODS[method]
    ours = method == "exact"
    return {
        "color": color,
        "marker": marker,
        "markersize": 7 if ours else 4.5,
        "linewidth": 2.8 if ours else 1.4,
        "linestyle": DASHED if peer else "-",
        "label": method,
        "zorder": 4 if ours else 3,
    }


def front(points: Points) -> Points:
    """The Pareto front of (cost, error) pairs, as the steps of a staircase."""
    steps: Points = []
    least = math.inf
    for cost, error in sorted(points):
        if error < least:
            if steps:
                steps.append((cost, least))
            steps.append((cost, error))
            least = error
    return steps


FRONT = {
    "color": "#f3e2a0",
    "linewidth": 7,
    "marker": "",
    "zorder": 1,
    "label": "least error for the time",
}


def panels(
    directory: Path,
    name: str,
    against: dict[tuple[str, str], str],
    title: str,
    ylabel: str,
    layout: tuple[int, int],
) -> None:
    """One frame a scene of `against` = {(scene, column): heading}, and one legend below them
    all."""
    table = rows(directory, "work_precision")
    peers = {row["method"] for row in table if row["kind"] == "peer"}
    shown = [method for method in METHODS if any(row["method"] == method for row in table)]
    across, down = layout
    entries = [Line2D([], [], **style(method, method in peers)) for method in shown]
    entries += [
        Line2D([], [], **FRONT),
        Line2D(
            [],
            [],
            color=INK,
            marker="x",
            linestyle="none",
            label="upper edge: some settings failed",
        ),
    ]
    below = 30 + 24 * math.ceil(len(entries) / 4)
    figure, axes = grid(1280, 420 * down + 50 + below, down, across, title, below)
    for ax, ((scene, column), heading) in zip(axes.flat, against.items()):
        every, failed = [], 0
        for method in shown:
            mine = [row for row in table if row["scene"] == scene and row["method"] == method]
            points = [
                (number(row["cpu_us_per_time"]), max(number(row[column]), 1e-16))
                for row in mine
                if row["status"] == "ok"
            ]
            points = [p for p in points if all(math.isfinite(x) and x > 0 for x in p)]
            if any(row["status"] != "ok" for row in mine):
                ax.plot(
                    0.985 - 0.03 * failed,
                    1.0,
                    "x",
                    color=METHODS[method][0],
                    transform=ax.transAxes,
                    clip_on=False,
                )
                failed += 1
            every += points
            curve(ax, points, **style(method, method in peers))
        if every:
            curve(ax, front(every), **FRONT)
            ax.set_ylim(10 ** math.floor(math.log10(min(p[1] for p in every)) - 0.5), 1)
        ax.set(title=heading, xlabel=COST, ylabel=ylabel, xscale="log", yscale="log", xlim=(1, 1e6))
    legend_below(figure, entries, 4)
    save(figure, directory, name)


EARLY = {
    "paper_beam": "5",
    "paper_beam_chatter": "5",
    "paper_beam_frame": "5",
    "stiff_beam": "0.5",
    "two_stops_beam": "1",
    "bouncing_ball": "20",
}


def work_precision(directory: Path) -> None:
    panels(
        directory,
        "paper_beam",
        {
            ("paper_beam", "early_sup_q"): "t ≤ 5: before chaos",
            ("paper_beam", "sup_q"): "t ≤ 20: within it",
        },
        "The paper’s beam: error of q against the time that it costs",
        "largest error of q [m]",
        (2, 1),
    )
    panels(
        directory,
        "error_of_q",
        {(scene, "early_sup_q"): f"{scene}, t ≤ {EARLY[scene]}" for scene in SCENES},
        "Error of q before chaos has grown it, against the time that it costs",
        "largest error of q [m]",
        (2, 3),
    )
    orders(directory)


def orders(directory: Path) -> None:
    """Prints fitted orders: slope of log error over log step or tolerance, in the range where the
    error still falls."""
    table = rows(directory, "work_precision")
    print("scene,method,knob,of q,of impact times")
    for scene in SCENES:
        for method in METHODS:
            mine = [
                row
                for row in table
                if (row["scene"], row["method"], row["status"]) == (scene, method, "ok")
            ]
            if len(mine) > 1:
                fitted = [fitted_order(mine, name) for name in ("early_sup_q", "early_median_dt")]
                print(",".join([scene, method, mine[0]["knob"], *fitted]))


def fitted_order(rows_of_one: list[dict[str, str]], column: str) -> str:
    points = [(number(row["setting"]), number(row[column])) for row in rows_of_one]
    points = [p for p in points if all(math.isfinite(x) and x > 0 for x in p)]
    # Errors at the rounding level carry no slope.
    points = [p for p in points if p[1] > 1e-11]
    return f"{fitted_exponent(points):.2f}" if len(points) >= 3 else ""


def fitted_exponent(points: Points) -> float:
    xs = [math.log(x) for x, _ in points]
    ys = [math.log(y) for _, y in points]
    x_mean, y_mean = sum(xs) / len(xs), sum(ys) / len(ys)
    return sum((x - x_mean) * (y - y_mean) for x, y in zip(xs, ys)) / sum(
        (x - x_mean) ** 2 for x in xs
    )


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    work_precision(Path(sys.argv[1]))
