"""Draws studies: quantities over the one or two keys that vary.

Over one key: the median of the runs with a band from 5 to 95 %, a colour for each estimator, or the
points of the stroboscope, a bifurcation diagram. Over two: the median as a colour, or a basin, each
start in the colour of its attractor.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _studies
from ._command import UsageError, same_file
from ._drawing import WIDTH, legible, logarithmic_ticks, name_lines, new_figure, style
from ._errors import InputError
from .tables import Study, axes_of, is_study, manifest_of, read_study_rows

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["attractors", "draw"]

Numbers = npt.NDArray[np.float64]
Labels = npt.NDArray[np.int_]

ESTIMATORS = {  # prefixes of columns, and their colours
    "replica": "#d55e00",
    "timing": "#8a4b7d",
    "both": "#0072b2",
    "adaptive": "#009e73",
}
UNITS = {"V_floor": "J", "rate": "1/s", "time_below": "s", "lyapunov": "1/s"} | dict.fromkeys(
    "duration tick clock.offset events.jitter observer.events.jitter disturbance.jitter "
    "disturbance.offset".split(),
    "s",
)
NO_QUANTITIES = ("index", "point", "run", "n", "failure")
ATTRACTOR_COLOURS = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#000000"]
NONE_FOUND = "#e8e8e8"
MOST_POINTS_WITH_MARKERS = 40


def draw(
    study: Study | _studies.Study,
    *,
    over: Sequence[str] = (),
    where: Mapping[str, float] | None = None,
    show: Sequence[str] = (),
    title: str = "",
) -> Figure:
    """Draws the rows of a study.

    Args:
        study: of :func:`sprag.run_study` or :func:`sprag.read_study`, or as
            :func:`sprag.tables.read_study_rows` reads it.
        over: one or two keys, across and up; default those that the study varies.
        where: only the rows with the value of each key next to this one.
        show: quantities, such as ``V_floor`` (of all estimators), ``both.V_floor`` or
            ``attractor``; default by the kind of study.
        title: in place of the study's name.
    """
    if isinstance(study, _studies.Study):
        study = Study(study.manifest["name"], axes_of(study.manifest), study.table(), [])
    picture = _Picture(study, over, where or {}, show)
    with style():
        return picture.figure(title or study.name)


def attractors(periods: Numbers, q: Numbers, u: Numbers, tolerance: float = 1e-3) -> Labels:
    """Number of the attractor of each row: from 1 on by period and position, 0 for none.

    Args:
        periods: in periods of the excitation, 0 where none was found, of shape (n,).
        q, u: a point of the attractor, of shape (n, any).
        tolerance: two points are one if they differ by less than this share of the largest.
    """
    labels = np.zeros(len(periods), int)
    found = np.flatnonzero(periods > 0)
    if not len(found):
        return labels
    largest = [np.abs(x[found]).max(initial=0.0) for x in (q, u)]
    same = [max(tolerance * size, 1e-9 * max(largest)) for size in largest]
    limits = np.concatenate([np.full(q.shape[1], same[0]), np.full(u.shape[1], same[1])])
    points = np.hstack([q, u])
    # By these ranks, differences within the tolerance do not determine the order.
    ranks = np.column_stack([_ranks(x, limit) for x, limit in zip(points.T, limits)])
    firsts: list[int] = []
    for i in found[np.lexsort([*ranks[found].T[::-1], periods[found]])]:
        for k, first in enumerate(firsts, start=1):
            near = np.all(np.abs(points[i] - points[first]) <= limits)
            if near and periods[i] == periods[first]:
                labels[i] = k
                break
        else:
            firsts.append(i)
            labels[i] = len(firsts)
    return labels


def _ranks(values: Numbers, limit: float) -> Labels:
    """Number of each value's group; groups of ascending values are more than `limit` apart."""
    order = np.argsort(values)
    ranks = np.zeros(len(values), int)
    ranks[order[1:]] = np.cumsum(np.diff(values[order]) > limit)
    return ranks


class _Picture:
    """What to show of a study: rows, the keys they are shown over, quantities."""

    def __init__(
        self, study: Study, over: Sequence[str], where: Mapping[str, float], show: Sequence[str]
    ) -> None:
        self.rows = study.rows
        self.varied = study.axes
        for key, value in where.items():
            column = self._column(key)
            if not column.notna().any():
                raise InputError(f"{key} has no values")
            nearest = column[(column - value).abs().idxmin()]
            self.rows = self.rows[column == nearest]
        self.keys = self._chosen_keys(over)
        self.quantities = self._chosen_quantities(show)
        # Points of the stroboscope repeat the other quantities of their run, which count once.
        self.once = self.rows[self.rows["n"] <= 1] if "n" in self.rows else self.rows

    def _column(self, name: str) -> pd.Series[Any]:
        if name not in self.rows or name == "failure":
            known = ", ".join(self.rows.columns)
            raise UsageError(f"{name} is no column of the study; there are {known}")
        return self.rows[name]

    def _chosen_keys(self, over: Sequence[str]) -> list[str]:
        # A key that `where` fixes does not vary.
        keys = list(over) or [key for key in self.varied if len(self._values(key)) > 1]
        if not keys and not self.varied:
            unknown = "without its manifest the varied keys of the study are unknown"
            raise UsageError(f"{unknown}; give --over KEY")
        if len(keys) not in (1, 2):
            raise UsageError(
                f"the study varies {', '.join(keys) or 'nothing'}; --over chooses one or two of "
                "them, --where KEY=VALUE one value of the others"
            )
        for key in keys:
            if not len(self._values(key)):
                raise InputError(f"{key} has no values")
        return keys

    def _values(self, key: str) -> Numbers:
        column = self._column(key)
        values: Numbers = np.unique(column[np.isfinite(column)].to_numpy(float))
        return values

    def _chosen_quantities(self, show: Sequence[str]) -> list[str]:
        recorded = [c for c in self.rows if c not in (*self.varied, *NO_QUANTITIES, *self.keys)]
        every = list(dict.fromkeys(_quantity_of(column) for column in recorded))
        for name in show:
            if name not in every and (name not in self.rows or name == "failure"):
                problem = f"{name} is nothing that the study has recorded"
                raise UsageError(f"{problem}; there are {', '.join(every)}")
        if show:
            return list(show)
        if len(self.keys) == 2:
            return ["attractor"] if "attractor" in every else every[:1]
        points = [name for name in every if self._of_stroboscope(name)]
        if points:
            return [points[0], *(name for name in every if name == "lyapunov")]
        return [name for name in every if name != "attractor"][:2]

    def _columns_of(self, quantity: str) -> list[str]:
        """Its column, or one for each estimator, with known values; of an attractor its period."""
        columns = [quantity, *(f"{estimator}.{quantity}" for estimator in ESTIMATORS)]
        if quantity == "attractor":
            columns = ["attractor.period"]
        present = [column for column in columns if column in self.rows]
        return [column for column in present if np.isfinite(self._medians(column)).any()]

    def _of_stroboscope(self, name: str) -> bool:
        return "n" in self.rows and name[:1] in ("q", "u") and name[1:].isdigit()

    def figure(self, title: str) -> Figure:
        return self._lines(title) if len(self.keys) == 1 else self._maps(title)

    # --- over one key ---

    def _lines(self, title: str) -> Figure:
        shown = [name for name in self.quantities if self._columns_of(name)]
        if not shown:
            raise InputError("there is nothing to show in this study")
        figure = new_figure(0.75 * WIDTH, 0.6 + 1.9 * len(shown), title)
        panels = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
        for axes, name in zip(panels, shown):
            axes.set_title(_title(name))
            if self._of_stroboscope(name):
                x, y = self.rows[self.keys[0]], self.rows[name]
                axes.plot(x, y, ".", ms=1.2, mew=0, color="black", rasterized=True, label="_points")
            else:
                self._median_and_band(axes, name)
        _set_scale(panels[-1].xaxis, self._values(self.keys[0]))
        panels[-1].set_xlabel(_title(self.keys[0]))
        figure.draw_without_rendering()
        for axes in panels:
            name_lines(axes)
        figure.set_layout_engine("none")
        return figure

    def _known(self, column: str) -> pd.DataFrame:
        """Rows with finite keys and a value in this column."""
        rows = self.rows if self._of_stroboscope(column) else self.once
        return rows[np.isfinite(rows[self.keys]).all(axis=1) & rows[column].notna()]

    def _median_and_band(self, axes: Axes, quantity: str) -> None:
        shown = []
        for column in self._columns_of(quantity):
            runs = self._known(column).groupby(self.keys[0])[column]
            values = [np.sort(of_key.to_numpy()) for _, of_key in runs]
            x = np.array([key for key, _ in runs])
            quantiles = np.array([[_quantile(v, p) for p in (0.05, 0.5, 0.95)] for v in values])
            low, median, high = quantiles.reshape(-1, 3).T
            estimator = column.partition(".")[0]
            look: dict[str, Any] = {"color": ESTIMATORS.get(estimator, "black"), "ms": 2}
            if max(map(len, values)) > 1:
                axes.fill_between(x, low, high, color=look["color"], alpha=0.18, lw=0)
            look["marker"] = "o" if len(x) <= MOST_POINTS_WITH_MARKERS else ""
            look["label"] = estimator if estimator in ESTIMATORS else "_only"
            axes.plot(x, np.where(np.isfinite(median), median, np.nan), **look)
            shown += values
        if _is_wide(np.concatenate(shown)):
            axes.set_yscale("log")
            axes.figure.draw_without_rendering()
            logarithmic_ticks(axes.yaxis, *axes.get_ylim())

    # --- over two keys ---

    def _maps(self, title: str) -> Figure:
        columns = [(q, c) for q in self.quantities for c in self._columns_of(q)]
        if not columns:
            raise InputError("there is nothing to show in this study")
        across = min(2, len(columns))
        down = (len(columns) + across - 1) // across
        width = WIDTH * (0.72 if across == 1 else 1.0)
        figure = new_figure(width, 0.4 + (3.0 if across == 1 else 2.5) * down, title)
        panels = figure.subplots(down, across, sharex=True, sharey=True, squeeze=False)
        for axes in panels.flat[len(columns) :]:
            axes.remove()
        for axes, (quantity, column) in zip(panels.flat, columns):
            axes.set_title(_title("attractor" if quantity == "attractor" else column))
            axes.grid(False)
            if quantity == "attractor":
                self._basin(axes)
            else:
                self._map(axes, column, [c for q, c in columns if q == quantity])
        for axes in panels[-1]:
            axes.set_xlabel(_title(self.keys[0]))
        for axes in panels[:, 0]:
            axes.set_ylabel(_title(self.keys[1]))
        _set_scale(panels[0, 0].xaxis, self._values(self.keys[0]))
        _set_scale(panels[0, 0].yaxis, self._values(self.keys[1]))
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
        return figure

    def _medians(self, column: str) -> pd.Series[Any]:
        keys = self.keys if len(self.keys) > 1 else self.keys[0]
        runs_of = self._known(column).groupby(keys)[column]
        return runs_of.agg(lambda runs: _quantile(np.sort(runs.to_numpy()), 0.5))

    def _map(self, axes: Axes, column: str, together: Sequence[str]) -> None:
        """The median as a colour, with the same colours for all estimators."""
        from matplotlib import colors

        every = np.concatenate([self._medians(c).to_numpy() for c in together])
        is_wide = _is_wide(every)
        finite = every[np.isfinite(every)]
        norm = (colors.LogNorm if is_wide else colors.Normalize)(finite.min(), finite.max())
        medians = self._medians(column)
        x, y = (medians.index.get_level_values(i).to_numpy(float) for i in (0, 1))
        drawn = self._fill(axes, x, y, medians.to_numpy(), norm=norm, cmap="viridis")
        bar = axes.figure.colorbar(drawn, ax=axes, pad=0.02)
        if is_wide:
            logarithmic_ticks(bar.ax.yaxis, finite.min(), finite.max())

    def _basin(self, axes: Axes) -> None:
        """Each start in the colour of its attractor."""
        from matplotlib import colors

        starts = self._known("attractor.period")
        periods = starts["attractor.period"].to_numpy(float)
        q, u = (
            np.nan_to_num(starts.filter(regex=rf"^attractor\.{letter}\d+$").to_numpy(float))
            for letter in "qu"
        )
        labels = attractors(periods, q, u)
        count = int(labels.max())
        repeated = [ATTRACTOR_COLOURS[i % len(ATTRACTOR_COLOURS)] for i in range(count)]
        cmap = colors.ListedColormap([NONE_FOUND, *repeated])
        x, y = (starts[key].to_numpy(float) for key in self.keys)
        self._fill(axes, x, y, labels.astype(float), cmap=cmap, vmin=-0.5, vmax=count + 0.5)
        for label in np.unique(labels):
            period = periods[labels == label][0]
            words = f"{label}: period {period:g}" if label else "none found"
            share = np.mean(labels == label)
            axes.plot([], [], "s", color=cmap(int(label)), label=f"{words}, {100 * share:.0f} %")
        axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0))

    def _fill(self, axes: Axes, x: Numbers, y: Numbers, z: Numbers, **colours: Any) -> Any:
        """Cells of a grid in colours, or dots where the points are no grid."""
        columns, rows = np.unique(x), np.unique(y)
        if len(columns) * len(rows) > 4 * len(z):
            return axes.scatter(x, y, c=z, s=9, lw=0, **colours)
        table = np.full((len(rows), len(columns)), np.nan)
        table[np.searchsorted(rows, y), np.searchsorted(columns, x)] = z
        table[np.isinf(table)] = np.nan
        return axes.pcolormesh(_edges(columns), _edges(rows), table, rasterized=True, **colours)


def _quantity_of(column: str) -> str:
    """A column without the prefix of its estimator; an attractor has several columns."""
    head, _, rest = column.partition(".")
    if head == "attractor":
        return head
    return rest if head in ESTIMATORS and rest else column


def _title(column: str) -> str:
    unit = UNITS.get(_quantity_of(column))
    return legible(f"{column} [{unit}]" if unit else column)


def _quantile(ascending: Numbers, p: float) -> float:
    place = p * (len(ascending) - 1)
    below = int(place)
    part = place - below
    if part == 0.0:
        return float(ascending[below])
    # A weighted sum: the difference of two infinite values is not a number.
    return float((1.0 - part) * ascending[below] + part * ascending[below + 1])


def _is_wide(values: Numbers) -> bool:
    """Whether values are positive and span more than two decades: shown by their logarithms."""
    finite = values[np.isfinite(values)]
    return bool(len(finite) and finite.min() > 0.0 and finite.max() > 100.0 * finite.min())


def _by_factors(values: Numbers) -> bool:
    """Whether values differ by a constant factor and span more than a decade."""
    if len(values) < 3 or not values[0] > 0.0 or not values[-1] > 10.0 * values[0]:
        return False
    steps = np.diff(np.log(values))
    return bool(np.allclose(steps, steps[0], rtol=0.01))


def _set_scale(axis: Any, values: Numbers) -> None:
    if (values % 1.0 == 0.0).all():  # such as numbers of modes
        axis.get_major_locator().set_params(integer=True)
    if _by_factors(values):
        axis.axes.set(**{f"{axis.axis_name}scale": "log"})
        edges = _edges(values)
        logarithmic_ticks(axis, edges[0], edges[-1])


def _edges(values: Numbers) -> Numbers:
    """Borders of the cells about ascending values, of shape (n + 1,)."""
    if len(values) == 1:
        reach = 0.5 * abs(values[0]) or 0.5
        return np.array([values[0] - reach, values[0] + reach])
    logarithmic = _by_factors(values)
    v = np.log(values) if logarithmic else values
    middle = (v[1:] + v[:-1]) / 2.0
    edges = np.concatenate([[2.0 * v[0] - middle[0]], middle, [2.0 * v[-1] - middle[-1]]])
    result: Numbers = np.exp(edges) if logarithmic else edges
    return result


def study_of_program(
    options: argparse.Namespace, report: dict[str, Any]
) -> tuple[Figure, list[str]]:
    """The picture and the damage of the files that the command line of ``plot`` names."""
    for given in options.files:
        if not is_study(given.file):
            none = f"{given} holds no rows of a study"
            raise UsageError(f"{none}; a picture is of a study or of runs")
        for option, written in (("--output", options.output), ("--report", options.report)):
            manifest = manifest_of(given.file)
            if written and manifest.exists() and same_file(manifest, written):
                raise UsageError(f"the manifest of FILE and {option} are the same file, {written}")
    study = read_study_rows([given.file for given in options.files])
    where = dict(map(_key_and_value, options.where))
    figure = draw(study, over=options.over, where=where, show=options.show, title=options.title)
    titles = [axes.get_title(loc="left").partition(" [")[0] for axes in figure.axes]
    report["panels"] = [title for title in titles if title]
    return figure, study.damage


def _key_and_value(text: str) -> tuple[str, float]:
    key, _, value = text.partition("=")
    try:
        return key, float(value)
    except ValueError:
        raise UsageError(f"{text} is not allowed; must be KEY=VALUE") from None
