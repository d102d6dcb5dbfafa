"""Draws runs and studies: states with bands, gaps, contacts, impacts and error energies.

The program ``plot`` draws files. :func:`states` draws results of the package, :func:`draw` tables
of any origin; both return a figure of matplotlib to change, show or save.
"""

from __future__ import annotations

import argparse
import io
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from . import _command, tables
from ._command import EXIT_DONE, EXIT_FAILED, Labelled, Parser, UsageError, Written, choose
from ._drawing import FRAME, RUN_COLOURS, WIDTH, legible, logarithmic_ticks, name_lines
from ._drawing import new_figure, readable_unit, style, summary, thin
from ._errors import InputError
from ._machine import Machine, machine_of, read_machine
from .tables import Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw", "readable_unit", "states"]

Numbers = npt.NDArray[np.float64]
Span = tuple[float, float]  # from, to [s]
Rank = Literal["single", "summary", "unasked"]

MOST_SINGLE_PANELS = 4
MOST_MODES = 3
OUTSIDE, INSIDE, REPLICA = "-", (0, (2.0, 1.2)), (0, (0.8, 1.6))  # parts of an estimate
GUARANTEED = "#777777"
MARKERS = "osD^vP<X"  # by contact
# A motion with more turns is a solid block at 800 pixels; a part with fewer is shown then.
MOST_TURNS, TURNS_IN_ZOOM = 120, 40
SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")


@dataclass
class Panel:
    """One quantity over time. `draw` adds it to axes that show a span."""

    name: str
    draw: Callable[[Axes, Span], None]
    # Of the single ones the first four are shown by default, of the summaries all.
    rank: Rank = "single"
    whole_run: bool = False  # a zoom does not apply
    height: float = 1.0
    named_lines: bool = True  # labels stand beside their lines


class Panels:
    """The panels that some tables show, in the order in which they are drawn by default."""

    def __init__(self, runs: Sequence[Table], machine: Machine | None = None) -> None:
        self.machine = machine
        self.states, energies, self.impacts, events = (
            [table for table in runs if table.kind == kind]
            for kind in ("states", "energy", "impacts", "events")
        )
        self.energies = [table for table in energies if (table.column("V") > 0.0).any()]
        self.bounds = [t for t in self.states if "B" in t.data and np.isfinite(t.column("B")).any()]
        self.span = _span(runs)
        self.colours = _colours(runs)
        self.closures: dict[int, tables.Closures] = {}
        for table in events:
            contacts = tables.contact_events(table.data)
            self.closures.update(tables.closures(contacts, self.span[1]))
        self.gaps = [f"g{i + 1}" for i in range(machine.m)] if machine and self.states else []
        self.all = [*self._of_states(), *self._of_contacts()]
        if self.energies or self.bounds:
            self.all.append(Panel("V", self._draw_energy, "summary", whole_run=True))
        for name in [*(self._coordinates("q") if self.gaps else []), *self._coordinates("u")]:
            self.all.append(self._quantity(name, name, "", "unasked"))

    def chosen(self, show: Sequence[str]) -> list[Panel]:
        """Panels by their names, or those of the default. Raises UsageError for unknown names."""
        if not show:
            single = [p for p in self.all if p.rank == "single"][:MOST_SINGLE_PANELS]
            panels = [p for p in self.all if p in single or p.rank == "summary"]
        else:
            # Several panels may have one name, since an output may have any.
            panels = [p for name in show for p in self.all if p.name == name]
            known = {p.name: p for p in self.all}
            for name in show:
                if name not in known:
                    problem = f"{name} is nothing that these files show"
                    raise UsageError(choose(problem, list(known)) if known else problem)
        if not panels:
            raise InputError("there is nothing to show in these files")
        return panels

    def left_out(self) -> list[str]:
        """Names of the panels that would be shown by default if there were room."""
        return [p.name for p in self.all if p.rank == "single"][MOST_SINGLE_PANELS:]

    def zoom(
        self, panels: Sequence[Panel], span: Span, most_turns: int = MOST_TURNS
    ) -> Span | None:
        """A part in which the first panel's motion is legible; None where the whole span is."""
        first = next((panel for panel in panels if not panel.whole_run), None)
        if first is None:
            return None
        turns = max((_turns(t, y, span) for t, y in self._motions(first.name)), default=0)
        if turns <= most_turns:
            return None
        length = (span[1] - span[0]) * TURNS_IN_ZOOM / turns
        digit = 10.0 ** np.floor(np.log10(length))
        length = digit * max(round(length / digit), 1)
        begin = digit * np.floor(span[0] / digit)
        return begin, begin + length

    # --- states ---

    def _of_states(self) -> list[Panel]:
        units = self.machine.output_units if self.machine is not None else {}
        panels = [self._quantity(name, name, units.get(name, "")) for name in self._named()]
        for gap in self.gaps:
            panels.append(self._quantity(gap, f"Gap {gap if len(self.gaps) > 1 else 'g'}", "m"))
        if not self.gaps:
            panels += [self._quantity(name, name, "") for name in self._coordinates("q")]
        return panels

    def _coordinates(self, letter: str) -> list[str]:
        f = max((table.coordinates for table in self.states), default=0)
        names = [f"{letter}{i + 1}" for i in range(f)]
        return [name for name in names if any(name in table.data for table in self.states)]

    def _named(self) -> list[str]:
        """Outputs of the scene, then parameters by their keys, which contain a dot."""
        found: dict[str, None] = {}
        for table in self.states:
            after_state = list(table.data)[2 + 2 * table.coordinates :]
            own = {*self._coordinates("q"), *self._coordinates("u"), "filter_gap", ""}
            for name in after_state:
                if name not in own and (not table.is_estimate or f"sigma_{name}" in table.data):
                    found[name] = None
        return sorted(found, key=lambda name: "." in name)

    def _quantity(self, name: str, title: str, unit: str, rank: Rank = "single") -> Panel:
        return Panel(name, partial(self._draw_states, name=name, title=title, unit=unit), rank)

    def _values(self, table: Table, name: str) -> Numbers | None:
        """A column of states, or a gap, of shape (rows,)."""
        if self.machine is None or name not in self.gaps:
            return table.column(name) if name in table.data else None
        f = self.machine.f
        if table.coordinates != f:
            raise InputError(
                f"{table.label}: has {table.coordinates} coordinates; the scene has {f}"
            )
        q = table.data[[f"q{i + 1}" for i in range(f)]].to_numpy(float)
        gap: Numbers = self.machine.gaps(table.column("t"), q)[:, int(name[1:]) - 1]
        gap[np.abs(gap) < 1e-13 * _largest([q])] = 0.0  # the rounding of a contact at rest
        return gap

    def _shown(self, name: str) -> list[tuple[Table, Numbers]]:
        values = [(table, self._values(table, name)) for table in self.states]
        return [(table, y) for table, y in values if y is not None]

    def _motions(self, name: str) -> list[tuple[Numbers, Numbers]]:
        if name == "contacts":
            begins = [c.begins for c in self.closures.values()]
            return [(np.repeat(t, 2), np.tile([0.0, 1.0], len(t))) for t in begins if t]
        return [(table.column("t"), y) for table, y in self._shown(name)]

    def _draw_states(self, axes: Axes, span: Span, name: str, title: str, unit: str) -> None:
        curves = self._shown(name)
        factor, unit = readable_unit(_largest(y for _, y in curves), unit)
        axes.set_title(legible(f"{title} [{unit}]" if unit else title))
        for table, y in curves:
            self._draw_bands(axes, table, name, factor, y)
            self._draw_parts(axes, table, name, factor * y)
        if name in self.gaps:
            closures = self.closures.get(int(name[1:]))
            begins = closures.begins if closures is not None else []
            axes.plot(begins, np.zeros(len(begins)), "k.", ms=3.5, zorder=6, label="_closes")
            axes.axhline(0.0, color=FRAME, lw=0.6, zorder=2, label="_zero")
        visible = [y[(t >= span[0]) & (t <= span[1])] for t, y in self._motions(name)]
        _set_range(axes, [factor * y for y in visible])

    def _draw_bands(self, axes: Axes, table: Table, name: str, factor: float, y: Numbers) -> None:
        for prefix, width in (("bound_", 1.0), ("sigma_", 2.0)):
            if prefix + name not in table.data:
                continue
            half = width * _finite(table.column(prefix + name))
            x, low, high = thin(table.column("t"), factor * (y - half), factor * (y + half))
            if prefix == "sigma_":
                colour = self.colours[table.label]
                axes.fill_between(x, low, high, color=colour, alpha=0.15, lw=0, zorder=1)
                continue
            axes.fill_between(x, low, high, color=GUARANTEED, alpha=0.12, lw=0, zorder=0)
            label = "guaranteed" if np.isfinite(high).any() else "_none"
            for edge, name_of_edge in ((low, "_low"), (high, label)):
                look = {"color": GUARANTEED, "lw": 0.6, "ls": ":", "zorder": 1}
                axes.plot(x, edge, label=name_of_edge, **look)

    def _draw_parts(self, axes: Axes, table: Table, name: str, y: Numbers) -> None:
        """A curve, dashed inside a support and dotted where the replica stands for the filter."""
        never = np.zeros(len(y), bool)
        inside = table.column("penetrating") > 0.5 if "penetrating" in table.data else never
        replica = table.column("from_filter") < 0.5 if "from_filter" in table.data else never
        replica = replica & ~inside
        band = " ± 2σ" if f"sigma_{name}" in table.data else ""
        parts: list[tuple[npt.NDArray[np.bool_], Any, str]] = [
            (~(inside | replica), OUTSIDE, _name(table) + band),
            (_widened(inside), INSIDE, "inside a support"),
            (_widened(replica), REPLICA, "replica shown"),
        ]
        width, order = (1.1, 4) if table.is_estimate else (2.0, 3)
        look = {"color": self.colours[table.label], "lw": width, "zorder": order}
        for part, dashes, label in parts:
            if part.any() or (dashes == OUTSIDE and not len(y)):
                x, shown = thin(table.column("t"), np.where(part, y, np.nan))
                axes.plot(x, shown, ls=dashes, label=label, **look)

    # --- contacts and impacts ---

    def _of_contacts(self) -> list[Panel]:
        panels = []
        if self.closures:
            height = 0.05 + 0.1 * len(self.closures)
            panels.append(Panel("contacts", self._draw_contacts, "summary", False, height, False))
        for name, title, unit in [
            ("impulse", "Impulse", "N s"),
            ("velocity_before", "Gap velocity before", "m/s"),
            ("velocity_after", "Gap velocity after", "m/s"),
        ]:
            if any(name in t.data and t.data[name].notna().any() for t in self.impacts):
                draw = partial(self._draw_impacts, name=name, title=title, unit=unit)
                rank: Rank = "summary" if name == "impulse" else "unasked"
                panels.append(Panel(name, draw, rank, named_lines=False))
        return panels

    def _draw_contacts(self, axes: Axes, span: Span) -> None:
        axes.set_title("Reported contacts")
        rows = sorted(self.closures)
        for row, contact in enumerate(rows):
            closures = self.closures[contact]
            axes.vlines(closures.impacts, row - 0.32, row + 0.32, color="black", lw=0.8)
            lengths = [(begin, end - begin) for begin, end in closures.stretches]
            axes.broken_barh(lengths, (row - 0.32, 0.64), color="#666666", lw=0.3)
        axes.set_ylim(len(rows) - 0.5, -0.5)
        numbers = [str(contact) for contact in rows] if rows != [1] else []
        axes.set_yticks(range(len(numbers)), numbers)
        axes.grid(axis="y", visible=False)

    def _draw_impacts(self, axes: Axes, span: Span, name: str, title: str, unit: str) -> None:
        shown = [(run, run.data[run.data["t"].between(*span)]) for run in self.impacts]
        shown = [(run, rows[rows[name].notna()]) for run, rows in shown if name in rows]
        factor, unit = readable_unit(_largest(rows[name].to_numpy() for _, rows in shown), unit)
        axes.set_title(f"{title} ± 2σ [{unit}]")
        for table, rows in shown:
            run = f"{_name(table)}, " if len(shown) > 1 else ""
            for contact, of in rows.groupby("contact"):
                sigma = of.get(f"sigma_{name}", 0.0 * of[name])
                bars = 2.0 * factor * sigma.where(np.isfinite(sigma), 0.0)
                look = {"color": self.colours[table.label], "ms": 2.5, "lw": 0.7}
                look |= {"fmt": MARKERS[int(contact - 1) % len(MARKERS)]}
                label = f"{run}contact {contact:g}"
                axes.errorbar(of["t"], factor * of[name], bars, label=label, **look)
        _set_range(axes, [factor * rows[name].to_numpy() for _, rows in shown])
        if len(axes.containers) > 1:
            axes.legend(loc="best", ncols=min(4, len(axes.containers)))

    # --- error energies ---

    def _draw_energy(self, axes: Axes, span: Span) -> None:
        axes.set_title("Error energy [J]")
        axes.set_yscale("log", nonpositive="mask")
        for i, table in enumerate(self.energies):
            if i == 0:  # of one run alone: more are illegible
                modes = [f"V{n}" for n in range(1, MOST_MODES + 1) if f"V{n}" in table.data]
                modes = modes if len(modes) > 1 else []
                label = ", ".join(modes).translate(SUBSCRIPTS)
                for mode in modes:
                    self._draw_decades(axes, table, mode, span, label, 0.6, 0.5)
                    label = "_mode"
            label = "V" if len(self.energies) == 1 else f"V, {legible(table.label)}"
            self._draw_decades(axes, table, "V", span, label, 1.6, 1.0)
        for table in self.bounds:
            x, y = thin(table.column("t"), _finite(table.column("B")), pixels=350)
            label = "B ≥ V, guaranteed" + (
                f", {legible(table.label)}" if len(self.bounds) > 1 else ""
            )
            axes.plot(x, y, color=self.colours[table.label], ls=(0, (4, 1.5)), label=label)
        rate = self.machine.decay_rate if self.machine is not None else None
        first = self.energies[0].column("V")[0] if self.energies else 0.0
        if rate and first > 0.0:
            t = self.energies[0].column("t")[[0, -1]]
            y = first * np.exp(-rate * (t - t[0]))
            axes.plot(t, y, color="#555555", lw=0.9, ls=":", label="by damping alone")
        if not axes.lines:  # within the span
            axes.set_ylim(0.1, 1.0)
        logarithmic_ticks(axes.yaxis, *axes.get_ylim())

    def _draw_decades(
        self, axes: Axes, table: Table, name: str, span: Span, label: str, lw: float, alpha: float
    ) -> None:
        """A curve on a logarithmic axis, as median and band where it is noise."""
        t, y = table.column("t"), table.column(name)
        seen = (t >= span[0]) & (t <= span[1]) & (y > 0.0)
        if seen.any():
            colour = self.colours[table.label]
            x, median, low, high = summary(t[seen], y[seen])
            axes.fill_between(x, low, high, color=colour, alpha=0.35 * alpha, lw=0)
            order = 3 + alpha
            axes.plot(x, median, color=colour, lw=lw, alpha=alpha, zorder=order, label=label)


def _span(runs: Sequence[Table]) -> Span:
    """The time that tables show. Events alone do not say how long a run is."""
    filled = [table for table in runs if len(table.data)]
    ticks = [table for table in filled if table.kind in ("states", "energy")]
    ends = [table.column("t")[[0, -1]] for table in ticks or filled]
    if not ends:
        raise InputError("there is nothing to show in these files")
    return float(min(t[0] for t in ends)), float(max(t[1] for t in ends))


def _colours(runs: Sequence[Table]) -> dict[str, str]:
    """Colour of each label: a run has one in all panels, a machine black."""
    machines = [t for t in runs if t.kind == "states" and not t.is_estimate]
    colours = {table.label: "black" for table in machines}
    estimates = [t.label for t in runs if t.kind != "events" and t.label not in colours]
    for i, label in enumerate(dict.fromkeys(estimates)):
        colours[label] = RUN_COLOURS[min(i, len(RUN_COLOURS) - 1)]
    return colours


def _turns(t: Numbers, y: Numbers, span: Span) -> int:
    """How often a curve crosses its median within a span; ripples beside it do not count."""
    y = y[(t >= span[0]) & (t <= span[1]) & np.isfinite(y)]
    if not len(y):
        return 0
    low, middle, high = np.quantile(y, [0.05, 0.5, 0.95])
    above = y[np.abs(y - middle) > 0.1 * (high - low)] > middle
    return int(np.count_nonzero(above[1:] != above[:-1]))


def _name(table: Table) -> str:
    """The label as a name in a picture; matplotlib leaves out those that begin with _."""
    name = legible(table.label)
    return " " + name if name.startswith("_") else name


def _largest(columns: Any) -> float:
    values = [np.abs(y[np.isfinite(y)]).max(initial=0.0) for y in columns]
    return float(max(values, default=0.0))


def _finite(values: Numbers) -> Numbers:
    return np.where(np.isfinite(values), values, np.nan)


def _widened(part: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """A part of a curve with the points beside it, so that it meets the rest."""
    wide = part.copy()
    wide[1:] |= part[:-1]
    wide[:-1] |= part[1:]
    return wide


def _set_range(axes: Axes, curves: Sequence[Numbers]) -> None:
    """A range of y about curves with room for their names; bands may leave it."""
    values = np.concatenate([y[np.isfinite(y)] for y in curves] or [np.zeros(0)])
    if not len(values):
        return
    low, high = values.min(), values.max()
    reach = 0.35 * (high - low)
    if reach <= 1e-9 * max(abs(low), abs(high)):
        reach = 0.1 * abs(low) if low else 1.0
    axes.set_ylim(low - reach, high + reach)


# --- figures ---


def draw(
    runs: Sequence[Table],
    scene: Any = None,
    *,
    show: Sequence[str] = (),
    begin: float | None = None,
    end: float | None = None,
    zoom: Span | None = None,
    title: str = "",
) -> Figure:
    """Draws tables of runs on one time axis; tables with one label are one run, in one colour.

    Args:
        runs: tables of all kinds but predictions and studies.
        scene: turns states into gaps, a :class:`sprag.Scene`. Without it coordinates are shown.
        show: names of panels, in this order; default: as many as are legible.
        begin, end: the time that is shown [s].
        zoom: shows all panels but V in this time only, beside the whole V. Without `begin`, `end`
            and `zoom` a part is chosen where the whole motion would be a solid block.
        title: in place of the scene's name.
    """
    panels = Panels(runs, None if scene is None else machine_of(scene))
    return _chosen_figure(panels, show, begin, end, zoom, title)[0]


def _chosen_figure(
    panels: Panels,
    show: Sequence[str],
    begin: float | None,
    end: float | None,
    zoom: Span | None,
    title: str,
) -> tuple[Figure, list[Panel], Span | None]:
    """The figure that draw() returns, its panels, and the part of the time that they show."""
    span = within(panels.span, begin, end)
    chosen = panels.chosen(show)
    if zoom is None and begin is None and end is None:
        zoom = panels.zoom(chosen, span)
    name = panels.machine.name if panels.machine is not None else ""
    return figure_of(chosen, span, zoom=zoom, title=title or name), chosen, zoom


def within(span: Span, begin: float | None, end: float | None) -> Span:
    """The part of a span from `begin` to `end`. Raises InputError if it is empty."""
    part = (
        span[0] if begin is None else max(begin, span[0]),
        span[1] if end is None else min(end, span[1]),
    )
    if not part[0] < part[1]:
        raise InputError("there is nothing to show in this time")
    return part


def figure_of(
    panels: Sequence[Panel],
    span: Span,
    *,
    zoom: Span | None = None,
    title: str = "",
    width: float = WIDTH,
) -> Figure:
    """Panels one above the other; with a zoom those of the whole run beside the others."""
    beside = [p for p in panels if p.whole_run and zoom is not None and len(panels) > 1]
    columns = [c for c in (beside, [p for p in panels if p not in beside]) if c]
    heights = [[panel.height for panel in column] for column in columns]
    height = 0.6 + (1.5 if width == WIDTH and not beside else 1.35) * max(
        sum(column) for column in heights
    )
    with style():
        figure = new_figure(width, max(0.375 * width, height), title)
        grid = figure.add_gridspec(1, len(columns))
        axes: list[tuple[Panel, Axes]] = []
        for i, column in enumerate(columns):
            places = grid[i].subgridspec(len(column), 1, height_ratios=heights[i])
            for row, panel in enumerate(column):
                ax = figure.add_subplot(places[row])
                seen = span if panel.whole_run or zoom is None else zoom
                panel.draw(ax, seen)
                ax.set_xlim(*seen)
                ax.locator_params(axis="x", nbins=9 if width / len(columns) > 5.0 else 6)
                ax.tick_params(labelbottom=panel is column[-1])
                axes.append((panel, ax))
            ax.set_xlabel("time t [s]")
        figure.draw_without_rendering()
        for panel, ax in axes:
            if panel.named_lines:
                name_lines(ax)
        figure.set_layout_engine("none")
    return figure


def states(
    runs: Any,
    scene: Any = None,
    *,
    events: Any = None,
    impacts: Any = None,
    V: Any = None,
    show: Sequence[str] = (),
    begin: float | None = None,
    end: float | None = None,
    zoom: Span | None = None,
    title: str = "",
) -> Figure:
    """Draws simulations and estimates on one time axis, with bands of two sigma.

    Args:
        runs: a Simulation, Estimates or Smoothed, or a mapping from names to these.
        scene: the Scene; gaps are shown in place of coordinates, outputs by their names.
        events: array of `event_dtype`, to show when contacts close.
        impacts: array that :func:`sprag.impacts` returns, to show impulses.
        V: Energies of an estimate, or its V alone, at the ticks of the first run.
        show, begin, end, zoom, title: as in :func:`draw`.

    >>> sprag.plot.states({"machine": run, "filter": estimates}, scene).savefig("run.png")
    """
    kind = "estimate" if hasattr(runs, "sigma_q") else "machine"
    named = runs if isinstance(runs, Mapping) else {kind: runs}
    drawn = [_table("states", name, tables.columns(run, scene)) for name, run in named.items()]
    if events is not None:
        drawn.append(_table("events", "events", _events(events)))
    label = list(named)[-1]
    if impacts is not None:
        rows = np.asarray(impacts)
        drawn.append(
            _table("impacts", label, {name: rows[name] for name in rows.dtype.names or ()})
        )
    if V is not None:
        drawn.append(_table("energy", label, _energies(V, drawn[0].column("t"))))
    return draw(drawn, scene, show=show, begin=begin, end=end, zoom=zoom, title=title)


def _table(kind: tables.Kind, label: str, columns: Mapping[str, Any]) -> Table:
    """A result as the file that the programs write of it."""
    pd = _command.require("pandas", "python3-pandas", "drawing")
    return Table(kind, label, pd.DataFrame(columns), Path(label))


def _energies(V: Any, t: Numbers) -> dict[str, Numbers]:
    """Error energies at the ticks of runs, V alone or with its parts."""
    total = np.asarray(getattr(V, "V", V), float)
    if total.shape != t.shape:
        raise ValueError(f"V has shape {total.shape}; must have that of t, {t.shape}")
    parts = getattr(V, "V_i", np.zeros((len(t), 0)))
    of_modes = {f"V{i + 1}": part for i, part in enumerate(parts.T)}
    return {"k": np.arange(len(t), dtype=float), "t": t, "V": total, **of_modes}


def _events(events: Any) -> dict[str, Any]:
    rows = np.asarray(events)
    kinds = np.array(["", "closes", "opens", "impact"])  # by their numbers
    return {"t": rows["t"], "contact": rows["contact"], "kind": kinds[rows["kind"]]}


# --- the program ---


def main() -> int:
    """The program ``plot``."""
    parser = Parser(
        "plot",
        "Draws states, gaps, contacts and error energies of any run on one time axis, with bands "
        "of two sigma. Files are distinguished by their headers; those with one LABEL are one run "
        "and have one colour. With the scene, gaps are shown in place of coordinates. Of a study's "
        "rows: bands over one key, maps over two, bifurcation diagrams and basins.",
    )
    add = parser.add_argument
    listed: dict[str, Any] = {"type": _command.names, "action": "extend", "default": []}
    files = "[LABEL=]FILE.csv as master_sim --states and --events, observer --states and --impacts "
    files += "and sync_logger --csv write it; SCENE.toml. Or rows.csv of a study, or its shards"
    add("files", metavar="FILE", nargs="+", type=Labelled, help=files)
    add("--output", metavar="F", type=Written, required=True, help="the picture: .png, .svg, .pdf")
    panels = (
        "panels, in this order: names of outputs, keys of parameters, g1, q1, u1, contacts, V, "
    )
    add("--show", metavar="NAME,...", help=f"{panels}...; of a study: its quantities", **listed)
    over = "of a study: one or two keys that vary, across and up"
    add("--over", metavar="KEY,...", type=_command.names, default=[], help=over)
    where = "of a study: only rows with the value of KEY next to this one"
    add("--where", metavar="KEY=VALUE,...", help=where, **listed)
    begin, end = "show the time from here on [s]", "show the time up to here [s]"
    add("--from", dest="begin", metavar="T", type=_command.finite, help=begin)
    add("--to", dest="end", metavar="T", type=_command.finite, help=end)
    zoom = "show all but V in this time only, beside it [s]"
    add("--zoom", metavar="FROM:TO", type=_zoom, help=zoom)
    add("--title", metavar="TEXT", default="", help="title, in place of the scene's name")
    return _command.run_program(parser, _run)


def _zoom(text: str) -> Span:
    begin, _, end = text.partition(":")
    try:
        span = _command.finite(begin), _command.finite(end)
    except argparse.ArgumentTypeError:
        span = 0.0, 0.0
    if not span[0] < span[1]:
        problem = f"{text} is not allowed; must be FROM:TO, two numbers that rise"
        raise argparse.ArgumentTypeError(problem)
    return span


def _run(options: argparse.Namespace, report: dict[str, Any]) -> int:
    check_picture(options.output)
    if any(tables.is_study(given.file) for given in options.files):
        from .plot_study import study_of_program

        figure, damage = study_of_program(options, report)
    else:
        figure, damage = _runs_of_program(options, report)
    for what in damage:
        shown = "the picture shows everything before it"
        print(f"{_command.printable(what)}; {shown}", file=sys.stderr)
        report.setdefault("damage", []).append(what)
    save(figure, options.output)
    return EXIT_FAILED if damage else EXIT_DONE


def check_picture(file: str) -> None:
    """Raises UsageError if the name of a picture has no known ending."""
    if Path(file).suffix not in (".png", ".svg", ".pdf"):
        raise UsageError(f"{file} is not allowed; must end in .png, .svg or .pdf")


def save(figure: Figure, file: str) -> None:
    """Writes a picture; an existing one stays as it is if that fails."""
    with _command.written(file) as temporary, _command.writing(file):
        write_figure(figure, temporary, Path(file).suffix[1:])


def write_figure(figure: Figure, file: Path, kind: str) -> None:
    """Writes a picture of the kind png, svg or pdf."""
    metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind, {})
    picture = io.BytesIO()  # on a full disk matplotlib's writer of PDF fails with a wrong error
    with style():
        figure.savefig(picture, format=kind, dpi="figure", metadata=metadata)
    file.write_bytes(picture.getvalue())


def _runs_of_program(
    options: argparse.Namespace, report: dict[str, Any]
) -> tuple[Figure, list[str]]:
    machine, runs = None, []
    for given in options.files:
        if _command.is_scene(given.file):
            if machine is not None:
                raise UsageError(f"{given} is a second scene; a picture is of one machine")
            machine = read_machine(_command.scene_file(given.file))
            continue
        runs.append(tables.read_table(given.file, given.label))
        if runs[-1].kind == "predictions":
            raise UsageError(f"{given} holds predictions, which plot does not draw; report does")
    if not runs:
        raise UsageError("no CSV file is given")
    panels = Panels(runs, machine)
    figure, chosen, zoom = _chosen_figure(
        panels, options.show, options.begin, options.end, options.zoom, options.title
    )
    if zoom is not None and options.zoom is None:
        print(
            f"the motion is shown from {zoom[0]:g} to {zoom[1]:g} s, where it is legible; "
            "--zoom FROM:TO shows another part, --from and --to all of one",
            file=sys.stderr,
        )
    if not options.show and (left_out := panels.left_out()):
        names = " ".join(map(_command.printable, left_out))
        print(f"not shown: {names}; --show NAME,... chooses", file=sys.stderr)
    report["panels"] = [panel.name for panel in chosen]
    return figure, [run.damage for run in runs if run.damage]
