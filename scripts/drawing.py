"""What the scripts that draw charts share: colours, the look of a picture, CSV files."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.axes import Axes  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402

INK, MUTED = "#202020", "#707070"
BAND = "#d8d8d8"
# Palette of Okabe and Ito, distinguishable with red-green colour blindness, and a darker shade of
# some colours.
BLACK, GREY = "#000000", "#7f7f7f"
VERMILION, ORANGE, YELLOW = "#d55e00", "#e69f00", "#c9b800"
BLUE, SKY, NAVY = "#0072b2", "#56b4e9", "#00395c"
GREEN, PINE = "#009e73", "#00513b"
PURPLE, PLUM = "#cc79a7", "#7a3b63"
BROWN = "#8c5a00"

# An estimator has the same colour in every chart, and in plot's picture of the demo.
ESTIMATORS = {
    "replica": VERMILION,
    "timing": PURPLE,
    "both": BLUE,
    "adaptive": GREEN,
    "Moreau replica": GREY,
}

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


def plain(text: str) -> str:
    """Text of data in which matplotlib finds no formula."""
    return text.replace("$", r"\$")


def grid(
    width: float, height: float, down: int = 1, across: int = 1, title: str = "", below: float = 0.0
) -> tuple[Figure, np.ndarray]:
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


def curve(ax: Axes, points: list[tuple[float, float]], **look: Any) -> None:
    """A line with markers through the points."""
    x, y = zip(*points) if points else ((), ())
    ax.plot(x, y, **({"marker": "o", "markersize": 4.5, "linewidth": 1.6} | look))


def legend_below(figure: Figure, handles: list[Any], columns: int) -> None:
    """A legend in the space that grid() has left below all axes."""
    figure.subfigs[1].legend(
        handles=handles, loc="center", ncols=columns, frameon=False, fontsize=9
    )


def legend_beside(ax: Axes) -> None:
    """The legend of axes to the right of them."""
    ax.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)


def save(figure: Figure, directory: Path, name: str) -> None:
    """Writes DIRECTORY/NAME.png."""
    picture = directory / f"{name}.png"
    figure.savefig(picture, dpi=PIXELS, metadata={"Software": None})
    plt.close(figure)
    print(picture)
