"""What all pictures share: look, units, thinned curves, and names written beside their curves.

Nothing here uses pyplot: a figure belongs to its caller alone.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ._command import printable, require

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.text import Text

Numbers = npt.NDArray[np.float64]
Pixels = npt.NDArray[np.int_]  # of shape (n, 2), or one coordinate of shape (n,)

# After Okabe and Ito: colour-blind readers distinguish them, and they differ in brightness.
RUN_COLOURS = ["#d55e00", "#0072b2", "#009e73", "#8a4b7d", "#b8860b", "#7f7f7f"]
FRAME = "#444444"
WIDTH = 7.2  # inches, a page of two columns; letters of 8 points are 12 pixels at 800 pixels' width
STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 8,
    "text.parse_math": False,  # names are text, whatever they contain
    "axes.titlesize": 8,
    "axes.titlelocation": "left",
    "axes.titlepad": 5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "axes.edgecolor": FRAME,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.5,
    **{f"{axis}tick.color": FRAME for axis in "xy"},
    **{f"{axis}tick.major.width": 0.6 for axis in "xy"},
    **{f"{axis}tick.major.size": 2.5 for axis in "xy"},
    "legend.fontsize": 7,
    "legend.framealpha": 0.85,
    "legend.edgecolor": "none",
    "legend.handletextpad": 0.5,
    "lines.linewidth": 1.1,
    "lines.solid_capstyle": "round",
    "agg.path.chunksize": 20000,
    "figure.dpi": 220,
    "svg.fonttype": "path",
    "svg.hashsalt": "sprag",  # equal files give equal pictures
    "pdf.fonttype": 42,
}
MOST_CHARACTERS = 200
PREFIXED_UNITS = ("m", "m/s", "m/s²", "s", "rad", "rad/s", "N", "J", "W", "V", "A")


@contextmanager
def style() -> Iterator[None]:
    """The look of all pictures, without the settings of the user."""
    module = require("matplotlib.style", "python3-matplotlib", "drawing")
    with module.context(["default", STYLE]), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # shown as a box
        yield


def new_figure(width: float, height: float, title: str = "") -> Figure:
    """A figure of this size in inches, whose parts find their places themselves."""
    figure_module = require("matplotlib.figure", "python3-matplotlib", "drawing")
    agg = require("matplotlib.backends.backend_agg", "python3-matplotlib", "drawing")
    figure = figure_module.Figure(figsize=(width, height), layout="constrained")
    agg.FigureCanvasAgg(figure)
    figure.get_layout_engine().set(w_pad=0.04, h_pad=0.04, wspace=0.03)
    if title:
        text = figure.suptitle(legible(title), x=0.01, ha="left", fontsize=8.5, fontweight="bold")
        shorten(text, 0.98 * figure.bbox.width)
    return figure


def legible(text: str) -> str:
    """Text of data in a picture: one line without control characters, at most 200 characters."""
    line = printable(text)
    return line if len(line) <= MOST_CHARACTERS else line[:MOST_CHARACTERS] + "…"


def shorten(text: Text, width: float) -> None:
    """Cuts a text that is wider than `width` pixels."""
    whole = text.get_text()
    kept = len(whole)
    while kept > 1 and (extent := text.get_window_extent().width) > width:
        kept = max(1, min(kept - 1, int(kept * width / extent)))
        text.set_text(whole[:kept] + "…")


def readable_unit(largest: float, unit: str) -> tuple[float, str]:
    """Factor and unit for values up to `largest`, with a prefix below a tenth of the larger unit.

    Other units, such as ``N s`` or ``mm``, stay as they are: a prefix would not be read.
    """
    if unit not in PREFIXED_UNITS:
        return 1.0, unit
    for factor, prefix in [(1.0, ""), (1e3, "m"), (1e6, "µ"), (1e9, "n")]:
        if not 0.0 < largest < np.inf or factor * largest >= 0.1:
            return factor, prefix + unit
    return 1e12, "p" + unit


def power_of_ten(exponent: float) -> str:
    """10⁻³ for -3."""
    digits = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
    return "10" + f"{exponent:g}".translate(digits)


def logarithmic_ticks(axis: Any, low: float, high: float) -> None:
    """At most eight powers of ten as ticks of an axis that shows `low` to `high`.

    Where fewer than two are in sight: their multiples by 1, 2 and 5, else a few round numbers.
    """
    from matplotlib import ticker

    first, last = np.log10(low), np.log10(high)
    step = next((s for s in (1, 2, 3, 5, 10, 20, 50) if (last - first) / s <= 8), 100)
    exponents = step * np.arange(np.ceil(first / step), np.floor(last / step) + 1)
    ticks = 10.0**exponents
    axis.set_major_formatter(lambda value, _: power_of_ten(round(np.log10(value))))
    if len(ticks) < 2:
        decades = 10.0 ** np.arange(np.floor(first), np.ceil(last) + 1)
        ticks = np.outer(decades, (1.0, 2.0, 5.0)).ravel()
        shown = (ticks > (1.0 - 1e-9) * low) & (ticks < (1.0 + 1e-9) * high)
        ticks = ticks[shown] if shown.sum() > 1 else ticker.MaxNLocator(3).tick_values(low, high)
        axis.set_major_formatter("{x:g}")
    axis.set_major_locator(ticker.FixedLocator(ticks))
    axis.set_minor_locator(ticker.NullLocator())


def thin(t: Numbers, *columns: Numbers, pixels: int = 2000) -> list[Numbers]:
    """First, least, greatest and last row of every pixel; what is drawn stays the same.

    `t` and all columns have shape (n,), t ascending. nan breaks a curve; a break stays.
    """
    if len(t) <= 4 * pixels:
        return [t, *columns]
    step = len(t) // pixels + 1
    blocks = np.arange(0, len(t), step)
    kept = [blocks, blocks[1:] - 1, np.array([len(t) - 1])]
    for y in columns:
        rows = np.full(len(blocks) * step, np.nan)
        rows[: len(t)] = y
        rows = rows.reshape(-1, step)
        for worst, best in ((np.inf, np.argmin), (-np.inf, np.argmax)):
            kept.append(blocks + best(np.where(np.isnan(rows), worst, rows), axis=1))
        known = ~np.isnan(y)
        kept += [edge + np.flatnonzero(known[1:] != known[:-1]) for edge in (0, 1)]
    rows_kept = np.unique(np.concatenate(kept))
    rows_kept = rows_kept[rows_kept < len(t)]
    return [t[rows_kept], *(y[rows_kept] for y in columns)]


def summary(t: Numbers, y: Numbers, pixels: int = 350) -> tuple[Numbers, Numbers, Numbers, Numbers]:
    """t, median, least and greatest value of every pixel: of noise, more is legible than a curve.

    `t` and `y` have shape (n,), without nan. Fewer than four rows a pixel stay as they are.
    """
    step = len(t) // pixels
    if step < 4:
        return t, y, y, y
    rows = np.append(y, np.full(-len(t) % step, y[-1])).reshape(-1, step)
    return t[::step], np.median(rows, axis=1), rows.min(axis=1), rows.max(axis=1)


# --- names beside their curves ---

# Distances in pixels from a point of the curve to its name, and directions, the best first.
PLACES = [
    (distance, across, up)
    for distance in (4, 10, 22, 40, 70)
    for across, up in [(1, 0), (0, 1), (0, -1), (-1, 0), (0.8, 1), (-0.8, 1), (0.8, -1), (-0.8, -1)]
]
WITH_LEADER = 10  # names at least this far from their curve get a line to it
FREE = 8  # pixels around a name that should be free
# Costs of a place: a pixel of ink under the name, against one around it and a pixel of distance.
INK_UNDER, INK_AROUND, DISTANCE, TO_THE_RIGHT = 100.0, 1.0, 6.0, 4.0
TOO_MUCH_INK = 30.0  # pixels of ink under a name that make it illegible


def name_lines(axes: Axes) -> None:
    """Writes the label of each line beside it, or makes a legend if one of them finds no place.

    Lines whose label begins with an underscore have no name. The figure must have been drawn.
    """
    lines = [line for line in axes.lines if not line.get_label().startswith("_")]
    if not lines:
        return
    ink = _Ink(axes)
    written: list[Any] = []
    for line in lines:
        artists = _name(axes, line, ink)
        if not artists:
            for artist in written:
                artist.remove()
            legend = axes.legend(handles=lines, loc="best")
            legend.set_zorder(10)
            for text in legend.get_texts():
                shorten(text, 0.8 * ink.width)
            return
        written += artists


class _Ink:
    """How many lines cover each pixel of the axes, from their lower left corner."""

    def __init__(self, axes: Axes) -> None:
        box = axes.get_window_extent()
        self.x0, self.y0 = box.x0, box.y0
        self.width, self.height = int(box.width), int(box.height)
        self.count = np.zeros((self.height, self.width))
        self.pixels = {line: self._pixels(axes, line) for line in axes.lines}
        for pixels in self.pixels.values():
            across, up = np.unique(pixels, axis=0).T
            self.count[up, across] += 1.0

    def _pixels(self, axes: Axes, line: Line2D) -> Pixels:
        """Pixels of a line, of shape (n, 2)."""
        with np.errstate(all="ignore"):
            xy = line.get_transform().transform(np.asarray(line.get_xydata(), float))
        xy = xy - (self.x0, self.y0)
        xy = xy[np.isfinite(xy).all(axis=1)]
        xy = np.clip(xy[(xy[:, 0] > -50) & (xy[:, 0] < self.width + 50)], -1e4, 1e4)
        if len(xy) < 2:
            return np.zeros((0, 2), int)
        along = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(xy, axis=0)).max(axis=1))])
        at = np.arange(0.0, along[-1], 1.0)
        pixels = np.column_stack([np.interp(at, along, xy[:, i]) for i in (0, 1)]).astype(int)
        if line.get_marker() not in ("None", ""):
            radius = int(line.get_markersize() * axes.figure.dpi / 144) + 1
            reach = range(-radius, radius + 1)
            around = [xy.astype(int) + (x, y) for x in reach for y in reach]
            pixels = np.vstack([pixels, *around])
        inside = (pixels >= 0).all(axis=1) & (pixels < (self.width, self.height)).all(axis=1)
        result: Pixels = pixels[inside]
        return result

    def between(self, point: Pixels, x: int, y: int, w: int, h: int) -> float:
        """Lines that a leader from a point of a curve to a box crosses beyond its beginning."""
        steps = np.linspace(point, np.clip(point, (x, y), (x + w, y + h)), 50)[5:]
        across, up = np.clip(steps.astype(int), 0, (self.width - 1, self.height - 1)).T
        return float(np.count_nonzero(self.count[up, across] > 0))

    def sums(self) -> Numbers:
        """Sum of the ink left of and below each corner of a pixel."""
        return np.pad(self.count.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))


def _name(axes: Axes, line: Line2D, ink: _Ink) -> list[Any]:
    """Writes the name of a line where it covers least; no artists if there is no place."""
    from matplotlib import patheffects

    halo = [patheffects.withStroke(linewidth=2.2, foreground="white")]
    colour = line.get_color()
    text = axes.text(
        0, 0, line.get_label().strip(), transform=axes.transAxes, color=colour, zorder=9
    )
    text.set(path_effects=halo, fontsize=7.5, in_layout=False)
    extent = text.get_window_extent()
    w, h = int(extent.width) + 6, int(extent.height) + 4
    place = _best_place(ink, ink.pixels[line], w, h)
    if place is None:
        text.remove()
        return []
    x, y, point = place
    to_axes = axes.transAxes.inverted().transform
    corner = np.array([ink.x0, ink.y0])
    text.set_position(to_axes(corner + (x + 3, y + 3)))
    ink.count[y : y + h, x : x + w] += TOO_MUCH_INK
    if point is None:
        return [text]
    ends = np.array([np.clip(point, (x, y), (x + w, y + h)), point])
    (leader,) = axes.plot(
        *to_axes(corner + ends).T, color=colour, lw=0.5, transform=axes.transAxes, label="_leader"
    )
    return [text, leader]


def _best_place(ink: _Ink, pixels: Pixels, w: int, h: int) -> tuple[int, int, Pixels | None] | None:
    """Lower left corner for a name of w x h pixels, and the point of its line if it is far."""
    total = ink.sums()
    points = pixels[:: max(1, len(pixels) // 400)]

    def ink_in(x: Pixels, y: Pixels, margin: int) -> Numbers:
        x0, x1 = (np.clip(e, 0, ink.width) for e in (x - margin, x + w + margin))
        y0, y1 = (np.clip(e, 0, ink.height) for e in (y - margin, y + h + margin))
        result: Numbers = total[y1, x1] - total[y0, x1] - total[y1, x0] + total[y0, x0]
        return result

    best_cost, best = np.inf, None
    for distance, across, up in PLACES if len(points) else []:
        x = points[:, 0] + int(across * (distance + w / 2) - w / 2)
        y = points[:, 1] + int(up * (distance + h / 2) - h / 2)
        under = ink_in(x, y, 0)
        cost = INK_UNDER * under + INK_AROUND * ink_in(x, y, FREE)
        cost += DISTANCE * distance - TO_THE_RIGHT * x / ink.width
        outside = (x < 2) | (y < 1) | (x + w > ink.width) | (y + h > ink.height - 1)
        cost[outside | (under > TOO_MUCH_INK)] = np.inf
        i = int(np.argmin(cost))
        leads = distance >= WITH_LEADER
        if leads and np.isfinite(cost[i]):
            cost[i] += INK_UNDER * ink.between(points[i], x[i], y[i], w, h)
        if cost[i] < best_cost:
            best_cost, best = cost[i], (int(x[i]), int(y[i]), points[i] if leads else None)
    return best
