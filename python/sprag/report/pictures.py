"""Pictures of a report as <svg> elements: those of plot in a narrow form, and residuals,
intervals and correlations."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .._command import require
from .._drawing import FRAME, RUN_COLOURS, legible, new_figure, style, thin
from ..plot import MARKERS, Panels, Span, figure_of, within
from .content import Picture, scale

if TYPE_CHECKING:
    import pandas as pd

    from .._core import Record
    from .inputs import Inputs

WIDTH = 4.4  # inches: its texts are legible on a phone, where it is half as wide as on a desktop
BLUE = RUN_COLOURS[1]
MOST_GAPS, MOST_OTHERS = 6, 4  # panels in one picture
MOST_TURNS = 50  # of a motion that is legible on a phone
MOST_WRITTEN = 12  # numbers in a row of a matrix
COMPACT = {"ncols": 3, "frameon": False, "fontsize": 7, "columnspacing": 0.8, "handletextpad": 0.1}
_FONT = re.compile(r"(?<=[; \"])font: (?:(?P<weight>\w+) )?(?P<size>[\d.]+px) ")
ZERO = {"color": FRAME, "linewidth": 0.6, "zorder": 1}


@contextmanager
def drawing(height: float, title: str = "") -> Iterator[Any]:
    """Axes in a figure of WIDTH x `height` inches, in the style of plot."""
    with style():
        axes = new_figure(WIDTH, height).add_subplot()
        axes.set_title(title)
        yield axes


def picture_of(figure: Any, caption: str) -> Picture:
    """The figure as an <svg> element that is as wide as its place, with texts as texts."""
    matplotlib = require("matplotlib", "python3-matplotlib", "report")
    stream = io.StringIO()
    with style(), matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "sprag"}):
        nothing = {"Date": None, "Creator": None, "Format": None, "Type": None}
        figure.savefig(stream, format="svg", metadata=nothing)
    text = stream.getvalue()
    svg = text[text.index("<svg") :].rstrip()
    svg = re.sub(r"\s*<metadata>.*?</metadata>", "", svg, count=1, flags=re.DOTALL)
    head, inside = svg.split(">", 1)
    # What WeasyPrint reads as well as browsers: plain references, no shorthand of fonts.
    inside = inside.replace("xlink:href=", "href=")
    inside = _FONT.sub(r"font-weight: \g<weight>; font-size: \g<size>; font-family: ", inside)
    viewbox = re.search(r'viewBox="[\d. ]*"', head)
    assert viewbox is not None
    return Picture(caption, f"<svg {viewbox[0]}>{inside}")


def residual_picture(residuals: pd.DataFrame, title: str, unit: str, caption: str) -> Picture:
    """Residuals over time, a mark for each contact, with bars of 2 sigma.

    Without a unit they are divided by sigma, and the range of 2 sigma is shaded instead.
    """
    factor, shown = scale(residuals["value"], unit)
    with drawing(1.9, f"{title} [{shown}]" if shown else title) as axes:
        axes.axhline(0.0, **ZERO)
        if not unit:
            axes.axhspan(-2.0, 2.0, color=BLUE, alpha=0.1, linewidth=0.0)
        look: dict[str, Any] = {"markersize": 2.5, "linewidth": 0.7}
        contacts = residuals.groupby("contact")
        for i, (contact, of) in enumerate(contacts):
            bars = 2.0 * factor * of["sigma"].where(np.isfinite(of["sigma"]), 0.0) if unit else None
            look |= {"fmt": MARKERS[i % len(MARKERS)], "label": f"contact {contact:g}"}
            look |= {"color": RUN_COLOURS[(i + 1) % len(RUN_COLOURS)]}
            axes.errorbar(of["t"], factor * of["value"], bars, **look)
        if len(contacts) > 1:
            above_right = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.1}
            axes.legend(**above_right, **COMPACT)
        axes.set_xlabel("time t [s]")
    return picture_of(axes.figure, caption)


@dataclass
class Interval:
    """A parameter with its 95 % interval.

    0 is the scene's value; -1 and 1 are the ends of the range within which it was assumed.
    """

    name: str
    text: str  # the value in words
    value: float
    low: float
    high: float


def interval_picture(intervals: list[Interval]) -> Picture:
    """A row for each interval, over the assumed range as a band."""
    with drawing(0.6 + 0.34 * len(intervals)) as axes:
        axes.axvspan(-1.0, 1.0, color=BLUE, alpha=0.08, linewidth=0.0)
        axes.axvline(0.0, **ZERO)
        reach = max(1.0, *(abs(x) for one in intervals for x in (one.low, one.high, one.value)))
        limit = 1.05 * min(reach, 4.0)  # an interval far beyond the range would squeeze all others
        axes.set(xlim=(-limit, limit), ylim=(len(intervals) - 0.4, -0.8))
        for row, one in enumerate(intervals):
            axes.plot([one.low, one.high], [row, row], color=BLUE, linewidth=2.0)
            axes.plot(one.value, row, "o", color=BLUE, markersize=4)
            # Beside the mark, inside the axes.
            x = min(max(one.value, -limit), limit)
            side, offset = ("left", 3) if x < 0.3 * limit else ("right", -3)
            place = {"xytext": (offset, 3), "textcoords": "offset points", "ha": side}
            axes.annotate(_cut(one.text), (x, row), fontsize=7, **place)
        axes.set_yticks(range(len(intervals)), [_cut(one.name) for one in intervals])
        axes.locator_params(axis="x", nbins=5)
        axes.grid(False)
        axes.set_xlabel("0: the scene's value, ± 1: ends of the assumed range")
    caption = (
        "Fitted values with 95 % intervals, against the scene's values and the ranges within "
        "which they were assumed."
    )
    return picture_of(axes.figure, caption)


def correlation_picture(names: list[str], values: npt.NDArray[np.float64]) -> Picture:
    """A square of colours from -1 (blue) to 1 (red) with the numbers in it; nan: none."""
    n = len(names)
    with drawing(0.5 + n * min(0.42, 2.6 / n)) as axes:
        axes.grid(False)
        edges = np.arange(n + 1) - 0.5
        colours = {"cmap": "RdBu_r", "vmin": -1.0, "vmax": 1.0, "edgecolors": "white"}
        axes.pcolormesh(edges, edges, values, **colours)
        axes.set(aspect="equal", ylim=(n - 0.5, -0.5))
        axes.set_xticks(range(n), [str(i + 1) for i in range(n)])
        axes.set_yticks(range(n), [f"{_cut(name)}  {i + 1}" for i, name in enumerate(names)])
        written = list(np.ndenumerate(values)) if n <= MOST_WRITTEN else []
        for (row, column), value in written:
            colour = "white" if abs(value) > 0.6 else "black"
            text = f"{value:.2f}" if np.isfinite(value) else ""
            axes.text(column, row, text, ha="center", va="center", fontsize=6, color=colour)
        axes.figure.draw_without_rendering()  # with equal scales the layout takes two passes
    caption = "Correlations of the determined parameters. Near ±1 only a combination of the two is "
    return picture_of(axes.figure, f"{caption}known well.")


def record_picture(record: Record) -> Picture:
    """A recorded input over time."""
    what, unit = ("displacement", "m") if record.displacement else ("acceleration", "m/s²")
    name = f"Recorded {what} of the frame"
    if record.of != "excitation":
        name, unit = f"Recorded input of {record.of}", ""
    factor, shown = scale(list(record.values), unit)
    with drawing(1.6, f"{name} [{shown}]" if shown else name) as axes:
        axes.axhline(0.0, **ZERO)
        t, y = thin(record.t, factor * record.values)
        axes.plot(t, y, color=FRAME, linewidth=0.7)
        axes.set_xlim(record.t[0], record.t[-1])
        axes.set_xlabel("time t [s]")
    return picture_of(axes.figure, f"{name}, with the gain and the delay of the scene.")


def _cut(name: str) -> str:
    longest, name = 40, legible(name)
    return name if len(name) <= longest else name[:longest] + "…"


class MotionPictures:
    """Pictures of panels of plot, over the part of a span that the tables show."""

    def __init__(self, inputs: Inputs, span: Span) -> None:
        tables = [table for table in inputs.tables if table.kind != "predictions"]
        self.panels = Panels(tables, inputs.machine)
        self.span = within(self.panels.span, *span)

    def of_panels(self, show: list[str], caption: str, span: Span | None = None) -> Picture:
        """The panels of these names, one above the other."""
        figure = figure_of(self.panels.chosen(show), span or self.span, width=WIDTH)
        return picture_of(figure, caption)

    def of_motion(self) -> list[Picture]:
        """Gaps with the contacts, and outputs, parameters or coordinates.

        Of a motion that would be a solid block only a part is shown, in which it is legible.
        """
        names = [panel.name for panel in self.panels.all if panel.rank == "single"]
        machine = self.panels.machine
        gaps = [f"g{i + 1}" for i in range(machine.m)] if machine is not None else []
        contacts = ["contacts"] if self.panels.closures else []
        others = [name for name in dict.fromkeys(names) if name not in gaps]
        pictures = []
        if gaps:
            what = "Gap at each contact with bands of ± 2 sigma, and reported contacts."
            pictures.append(self._legible(gaps[:MOST_GAPS] + contacts, what, gaps[MOST_GAPS:]))
        if others:
            what = "Outputs and estimated parameters." if gaps else "Coordinates and outputs."
            pictures.append(self._legible(others[:MOST_OTHERS], what, others[MOST_OTHERS:]))
        return pictures

    def _legible(self, show: list[str], caption: str, left_out: list[str]) -> Picture:
        part = self.panels.zoom(self.panels.chosen(show), self.span, MOST_TURNS)
        if left_out:
            caption += f" Not shown: {', '.join(left_out)}."
        if part is not None:
            caption += (
                f" Only t = {part[0]:.6g} to {part[1]:.6g} s is shown, where the motion is legible."
            )
        return self.of_panels(show, caption, part)
