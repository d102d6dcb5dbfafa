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
from .._drawing import FRAME, RUN_COLOURS, legible, name_lines, new_figure, style, thin
from .._errors import InputError
from .content import Picture, scale

if TYPE_CHECKING:
    from .._core import Record
    from .analysis import Residuals
    from .inputs import Inputs

WIDTH = 4.4  # inches: its texts are legible on a phone, where it is half as wide as on a desktop
MARKS = "osD^v"
MOST_GAPS, MOST_OTHERS = 6, 4  # panels in one picture
MOST_WRITTEN = 12  # numbers in a row of a matrix
COMPACT = {"ncols": 3, "frameon": False, "fontsize": 7, "columnspacing": 0.8, "handletextpad": 0.1}
_FONT = re.compile(r"(?<=[; \"])font: (?:(?P<weight>\w+) )?(?P<size>[\d.]+px) ")
ZERO = {"color": FRAME, "linewidth": 0.6, "zorder": 1}


@contextmanager
def drawing(height: float) -> Iterator[tuple[Any, Any]]:
    """A figure of WIDTH x `height` inches and its axes, in the style of plot."""
    with style():
        figure = new_figure(WIDTH, height)
        yield figure, figure.add_subplot()


def picture_of(figure: Any, caption: str) -> Picture:
    """The figure as an <svg> element that is as wide as its place, with texts as texts."""
    matplotlib = require("matplotlib", "python3-matplotlib", "report")
    stream = io.StringIO()
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "sprag"}):
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


def residual_picture(residuals: Residuals, title: str, unit: str, caption: str) -> Picture:
    """Residuals over time, a mark for each contact, with bars of 2 sigma.

    Without a unit they are divided by sigma, and the range of 2 sigma is shaded instead.
    """
    factor, shown = scale(list(residuals.value), unit)
    with drawing(1.9) as (figure, axes):
        axes.set_title(f"{title} [{shown}]" if shown else title)
        axes.axhline(0.0, **ZERO)
        if not unit:
            axes.axhspan(-2.0, 2.0, color="#0072b2", alpha=0.1, linewidth=0.0)
        contacts = np.unique(residuals.contact)
        for i, contact in enumerate(contacts):
            of = residuals.contact == contact
            bars = np.where(np.isfinite(residuals.sigma[of]), 2.0 * residuals.sigma[of], 0.0)
            axes.errorbar(
                residuals.t[of],
                factor * residuals.value[of],
                factor * bars if unit else None,
                fmt=MARKS[i % len(MARKS)],
                markersize=2.5,
                linewidth=0.7,
                color=RUN_COLOURS[(i + 1) % len(RUN_COLOURS)],
                label=f"contact {contact}",
            )
        if len(contacts) > 1:
            above_right = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.1}
            axes.legend(**above_right, **COMPACT)
        axes.set_xlabel("time t [s]")
        return picture_of(figure, caption)


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
    with drawing(0.6 + 0.34 * len(intervals)) as (figure, axes):
        axes.axvspan(-1.0, 1.0, color="#0072b2", alpha=0.08, linewidth=0.0)
        axes.axvline(0.0, **ZERO)
        reach = max(1.0, *(abs(x) for one in intervals for x in (one.low, one.high, one.value)))
        limit = 1.05 * min(reach, 4.0)  # an interval far beyond the range would squeeze all others
        axes.set(xlim=(-limit, limit), ylim=(len(intervals) - 0.4, -0.8))
        for row, one in enumerate(intervals):
            axes.plot([one.low, one.high], [row, row], color="#0072b2", linewidth=2.0)
            axes.plot(one.value, row, "o", color="#0072b2", markersize=4)
            # Beside the mark, inside the axes.
            place = min(max(one.value / limit, -1.0), 1.0)
            side = "left" if place < 0.3 else "right"
            axes.annotate(
                legible(one.text),
                (place * limit, row),
                (3 if side == "left" else -3, 3),
                textcoords="offset points",
                ha=side,
                fontsize=7,
            )
        names = [_cut(one.name) for one in intervals]
        axes.set_yticks(range(len(names)), names)
        axes.locator_params(axis="x", nbins=5)
        axes.grid(False)
        axes.set_xlabel("0: the scene's value, ± 1: ends of the assumed range")
        return picture_of(
            figure,
            "Fitted values with 95 % intervals, against the scene's values and the ranges within "
            "which they were assumed.",
        )


def correlation_picture(names: list[str], values: npt.NDArray[np.float64]) -> Picture:
    """A square of colours from -1 (blue) to 1 (red) with the numbers in it; nan: none."""
    n = len(names)
    side = min(0.42, 2.6 / n)
    with drawing(0.5 + side * n) as (figure, axes):
        axes.grid(False)
        edges = np.arange(n + 1) - 0.5
        axes.pcolormesh(
            edges, edges, values, cmap="RdBu_r", vmin=-1.0, vmax=1.0, edgecolors="white"
        )
        axes.set(aspect="equal", ylim=(n - 0.5, -0.5))
        numbers = [str(i + 1) for i in range(n)]
        axes.set_xticks(range(n), numbers)
        rows = [f"{_cut(name)}  {i}" for name, i in zip(names, numbers)]
        axes.set_yticks(range(n), rows)
        if n <= MOST_WRITTEN:
            for (row, column), value in np.ndenumerate(values):
                colour = "white" if abs(value) > 0.6 else "black"
                text = f"{value:.2f}" if np.isfinite(value) else ""
                axes.text(column, row, text, ha="center", va="center", fontsize=6, color=colour)
        figure.canvas.draw()  # with equal scales the layout takes two passes
        return picture_of(
            figure,
            "Correlations of the determined parameters. Near ±1 only a combination of the two is "
            "known well.",
        )


def record_picture(record: Record) -> Picture:
    """A recorded input over time."""
    is_excitation = record.of == "excitation"
    unit = ("m" if record.displacement else "m/s²") if is_excitation else ""
    factor, shown = scale(list(record.values), unit)
    what = "displacement" if record.displacement else "acceleration"
    name = f"Recorded {what} of the frame" if is_excitation else f"Recorded input of {record.of}"
    with drawing(1.6) as (figure, axes):
        axes.set_title(f"{name} [{shown}]" if shown else name)
        axes.axhline(0.0, **ZERO)
        t, y = thin(record.t, factor * record.values)
        axes.plot(t, y, color=FRAME, linewidth=0.7)
        axes.set_xlim(record.t[0], record.t[-1])
        axes.set_xlabel("time t [s]")
        caption = f"{name}, with the gain and the delay of the scene."
        return picture_of(figure, caption)


def _cut(name: str) -> str:
    longest, name = 40, legible(name)
    return name if len(name) <= longest else name[:longest] + "…"


class MotionPictures:
    """Pictures of panels of plot, over the part of a span that the tables show."""

    def __init__(self, inputs: Inputs, span: tuple[float, float]) -> None:
        from ..plot import Panels

        self.machine = inputs.machine
        self.panels = Panels([t for t in inputs.tables if t.kind != "predictions"], self.machine)
        whole = self.panels.span
        self.span = max(span[0], whole[0]), min(span[1], whole[1])
        if not self.span[0] < self.span[1]:
            raise InputError("there is nothing to show in this time")

    def of_panels(
        self, show: list[str], caption: str, span: tuple[float, float] | None = None
    ) -> Picture:
        """The panels of these names, one above the other."""
        chosen = self.panels.chosen(show)
        begin, end = span or self.span
        ratios = [panel.height for panel in chosen]
        with style():
            figure = new_figure(WIDTH, 0.5 + 1.3 * sum(ratios))
            all_axes = figure.subplots(
                len(chosen), 1, squeeze=False, gridspec_kw={"height_ratios": ratios}
            )[:, 0]
            for panel, axes in zip(chosen, all_axes):
                panel.draw(axes, (begin, end))
                axes.set_xlim(begin, end)
                axes.tick_params(labelbottom=axes is all_axes[-1])
            all_axes[-1].set_xlabel("time t [s]")
            figure.canvas.draw()
            for panel, axes in zip(chosen, all_axes):
                if panel.named_lines:
                    name_lines(axes)
            figure.set_layout_engine("none")
            return picture_of(figure, caption)

    def of_motion(self) -> list[Picture]:
        """Gaps with the contacts, and outputs, parameters or coordinates.

        Of a motion that would be a solid block only a part is shown, in which it is legible.
        """
        names = [panel.name for panel in self.panels.all if panel.rank == "single"]
        m = 0 if self.machine is None else self.machine.m
        gaps = [f"g{i + 1}" for i in range(m)]
        contacts = [panel.name for panel in self.panels.all if panel.name == "contacts"]
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
        part = self.panels.zoom(self.panels.chosen(show), self.span)
        if left_out:
            caption += f" Not shown: {', '.join(left_out)}."
        if part is not None:
            caption += (
                f" Only t = {part[0]:.6g} to {part[1]:.6g} s is shown, where the motion is legible."
            )
        return self.of_panels(show, caption, part)
