"""Sections and verdicts of runs: measurement, motion, residuals, impacts, bound, provenance."""

from __future__ import annotations

import math
import shlex
from typing import TYPE_CHECKING, Any

import numpy as np

from .._command import counted
from ..tables import Closures, closures
from .analysis import FEWEST_RESIDUALS, check_predictions, consistency, innovations, normalized
from .content import MOST_ROWS, Block, Grid, Verdict, facts, quantity, rounded
from .inputs import at, count_at, list_at, number_at, text_at
from .pictures import MotionPictures, residual_picture

if TYPE_CHECKING:
    import pandas as pd

    from ..tables import Table
    from .inputs import Inputs, ObserverRun

Span = tuple[float, float]
AT = "at\N{NO-BREAK SPACE}t\N{NO-BREAK SPACE}[s]"


def verdict_of_run(run: ObserverRun, inputs: Inputs) -> Verdict:
    """Whether the filter fits the events, and what is known of the state at the end."""
    failures = number_at(run.report, "confidence", "inconsistencies")
    if failures is None:
        failures = _last(run.states, "inconsistencies")
    events = inputs.measured()
    closings = "" if events is None else counted((events["kind"] != "opens").sum(), "closing")
    about, second = f"Observer, run {run.label}", _end(run)
    if failures is None:
        first = (
            "Whether the events fit the filter is not determined: the run has no filter, or its "
            "report is not among the files."
        )
        return Verdict(about, first, second)
    if failures <= 0.0:
        none = f"None of the {closings}" if closings else "No event"
        return Verdict(about, f"{none} contradicts the filter's estimate.", second, "good")
    first = f"The filter's gate failed {counted(int(failures), 'time')}"
    first += f" in {closings}" if closings else ""
    where = at(run.report, "confidence", "first_inconsistencies", 0)
    if where is not None:
        first += (
            f", first at t = {rounded(number_at(where, 't'), 6)} s, contact "
            f"{count_at(where, 'contact')} (suspected: {text_at(where, 'suspicion')})"
        )
    return Verdict(about, f"{first}.", second, "bad")


def _last(table: Table | None, name: str) -> float | None:
    """Last value of a column; None if there is none, or if it is nan."""
    if table is None or name not in table.data or not len(table.data):
        return None
    value = float(table.column(name)[-1])
    return None if math.isnan(value) else value


def _end(run: ObserverRun) -> str:
    """What is known at the end."""
    states = run.states
    bound = _last(states, "B")
    if bound is None:
        bound = number_at(run.report, "confidence", "bound", "final")
    known = "no bound on the error energy is given"
    if bound is not None and math.isfinite(bound):
        known = (
            f"the error energy of the replica is at most B = {rounded(bound, 3)} J, if the scene "
            "and its tolerances are right"
        )
    t = _last(states, "t")
    if states is None or t is None:
        settled = rounded(number_at(run.report, "settled_tick"), 9)
        return f"At the last settled tick, {settled}, {known}."
    at_end = f"At the end, t = {rounded(t, 6)} s, "
    if "from_filter" in states.data and not (_last(states, "from_filter") or 0.0) > 0.5:
        return (
            f"{at_end}the estimate is the replica's, for which no standard deviation is claimed; "
            f"{known}."
        )
    gaps = [name for name in states.data if name[:7] == "sigma_g" and name[7:].isdigit()]
    sigmas = [sigma for name in gaps if (sigma := _last(states, name)) is not None]
    if not sigmas:
        return f"{at_end}{known}."
    if not math.isfinite(max(sigmas)):
        return f"{at_end}no standard deviation is claimed."
    gap = "gaps at most" if len(gaps) > 1 else "gap"
    largest = quantity(max(sigmas), "m", 2)
    return f"{at_end}the filter gives a standard deviation of {largest} for the {gap}, and {known}."


def measurement_blocks(inputs: Inputs) -> list[Block]:
    """Numbers and times of the measured events, and what the observer received."""
    events = inputs.measured()
    blocks: list[Block] = []
    if events is None:
        blocks.append("The files contain no events: neither an events CSV nor an impacts CSV.")
    else:
        blocks += [_extent(events, inputs), _counts(events, inputs)]
    reports = [(run.label, run.report) for run in inputs.runs() if run.report is not None]
    return blocks + [_reception(label, report) for label, report in reports]


def _extent(events: pd.DataFrame, inputs: Inputs) -> str:
    text = (
        "The times at which contacts close and open; nothing else. The recording has "
        f"{counted(len(events), 'event')}"
    )
    if len(events):
        first, last = events["t"].iloc[[0, -1]]
        text += f" from t = {rounded(first, 6)} s to {rounded(last, 6)} s"
    text += "."
    tables = inputs.of_kind("events")
    if tables and tables[0].spurious:
        text += f" {counted(tables[0].spurious, 'row')} marked as spurious are not counted."
    notes = tables[0].data.get("note") if tables else None
    if notes is not None and (notes == "lost").any():
        inserted = counted((notes == "lost").sum(), "row")
        text += f" {inserted} that identify inserted for lost events are not counted."
    inferred = sum(int(count_at(run.report, "made_up_events") or 0) for run in inputs.runs())
    if inferred and not tables:
        text += (
            f" The observer inferred {inferred} of them after a gap; they were not measured, and "
            "the impacts CSV does not mark them."
        )
    return text


def _counts(events: pd.DataFrame, inputs: Inputs) -> Grid:
    head = ["contact", "impacts", "sustained contacts", "time closed [s]", "first [s]", "last [s]"]
    grid = Grid("Contact events", head)
    of_contacts = closures(events, inputs.end)
    contacts = 0 if inputs.scene is None else inputs.scene.m
    for contact in range(1, max([contacts, *of_contacts]) + 1):
        own = of_contacts.get(contact, Closures([], []))
        closed = sum(end - begin for begin, end in own.stretches)
        t = events["t"][events["contact"] == contact]
        ends = [rounded(time, 6) for time in t.iloc[[0, -1]]] if len(t) else ["", ""]
        counts = [str(contact), str(len(own.impacts)), str(len(own.stretches))]
        grid.rows.append([*counts, rounded(closed), *ends])
    return grid


def _reception(label: str, report: dict[str, Any]) -> Grid:
    """What the observer's report says about the events."""
    causes = ""
    if isinstance(skipped := report.get("skipped"), dict):
        numbers = [f"{count_at(skipped, cause)} {cause}" for cause in skipped]
        causes = ", ".join(text for text in numbers if text[0] not in " 0") or "0"
    free = number_at(report, "runs_free_from")
    from_there = "" if free is None else f"{rounded(free, 8)} s"
    return facts(
        f"Events of the run {label}, by its report",
        ("events taken", count_at(report, "events")),
        ("events inferred after a gap, not measured", count_at(report, "made_up_events")),
        ("records lost", count_at(report, "lost_records")),
        ("events skipped", causes),
        ("intervals in which events may be missing", str(len(list_at(report, "degraded")))),
        ("no event after, so that the estimate runs free from there", from_there),
        ("messages received", count_at(report, "messages", "received")),
        ("messages lost", count_at(report, "messages", "lost")),
    )


def residuals_blocks(inputs: Inputs) -> list[Block]:
    """Innovations and predictions."""
    states = [run.states for run in inputs.runs() if run.states is not None]
    of_runs = [block for of in states for block in _innovations(of, inputs.jitter)]
    return of_runs + _predictions(inputs)


def _innovations(states: Table, jitter: float) -> list[Block]:
    unit = normalized(innovations(states))
    if len(unit) == 0:
        return []
    caption = (
        f"Innovations of {states.label}: the gap that the filter predicts at each closing, divided "
        "by its standard deviation. The states have one closing for each tick."
    )
    test = consistency(unit)
    if math.isnan(jitter):
        text = "Whether sigma is right is not tested, because the jitter of the scene is not known."
    elif not jitter > 0.0:
        text = (
            "The scene has no jitter: event times count as exact, and innovations after the first "
            "impacts are rounding errors. Whether sigma is right is not tested."
        )
    elif test is None:
        fewest = f"that takes {FEWEST_RESIDUALS} innovations or more."
        text = f"Whether sigma is right is not determined: {fewest}"
    else:
        certain = "less" if test.mean_square > test.high else "more"
        fails = f"Sigma fails this test: the estimate is {certain} certain than it claims."
        text = (
            f"{rounded(100.0 * test.within_two, 3)} % of the {test.n} innovations are within 2 "
            f"sigma. Their mean square is {rounded(test.mean_square, 3)}; if sigma is right it "
            f"lies between {rounded(test.low, 3)} and {rounded(test.high, 3)} in 95 % of all runs. "
            f"{'Sigma passes this test.' if test.holds else fails}"
        )
    return [residual_picture(unit, "Innovation / sigma", "", caption), text]


def _predictions(inputs: Inputs) -> list[Block]:
    tables = inputs.of_kind("predictions")
    events = inputs.measured_in_machine_time()
    if tables and events is None:
        return ["Predictions are given without measured events: an events CSV or an impacts CSV."]
    blocks: list[Block] = []
    for table in tables:
        assert events is not None
        check = check_predictions(table, events, float(np.nan_to_num(inputs.jitter)))
        text = (
            f"Of {counted(check.made, 'prediction')} {check.none} claim no event. Of the "
            f"{check.claimed} whose next event was measured, {len(check.errors)} have the right "
            "contact."
        )
        if len(check.errors):
            caption = "Next event after each prediction: measured minus predicted time, with bars "
            title = "Measured − predicted time"
            blocks.append(residual_picture(check.errors, title, "s", f"{caption}of ± 2 sigma."))
        if test := consistency(normalized(check.errors)):
            text += (
                f" {rounded(100.0 * test.within_two, 3)} % of the measured times are within 2 "
                "sigma of the predicted ones."
            )
        blocks.append(text)
    return blocks


def impacts_blocks(inputs: Inputs, span: Span) -> list[Block]:
    """Velocities over time, and by contact and kind."""
    tables = inputs.of_kind("impacts")
    if not tables:
        return []
    columns = ["velocity_before", "velocity_after"]
    with_velocity = [table for table in tables if columns[0] in table.data]
    first: Block = "The impacts files have no event with a velocity."
    if any(np.isfinite(table.column(columns[0])).any() for table in with_velocity):
        caption = "Gap velocity before and after each event, with bars of ± 2 sigma."
        sigmas = [table.data.get(f"sigma_{name}", 0.0) for table in tables for name in columns]
        if any(np.isinf(sigma).any() for sigma in sigmas):
            caption += " An infinite sigma has no bar."
        first = MotionPictures(inputs, span).of_panels(columns, caption)
    return [first, *(grid for table in tables if (grid := _speeds(table)).rows)]


def _speeds(impacts: Table) -> Grid:
    head = f"contact,kind,events,median speed,largest speed,{AT},its sigma,largest impulse [N s]"
    grid = Grid(f"Closings of {impacts.label}, by contact and kind", head.split(","))
    names = ("velocity_before", "sigma_velocity_before", "impulse")
    if any(name not in impacts.data for name in names):
        return grid
    data = impacts.data[np.isfinite(impacts.data["velocity_before"])]
    data = data[data["kind"] != "opens"].assign(speed=lambda rows: rows["velocity_before"].abs())
    for (contact, kind), rows in data.groupby(["contact", "kind"], sort=True):
        fastest = rows.loc[rows["speed"].idxmax()]
        sigma = float(fastest["sigma_velocity_before"])
        speeds = [quantity(v, "m/s") for v in (rows["speed"].median(), fastest["speed"])]
        claimed = quantity(sigma, "m/s", 2) if math.isfinite(sigma) else "none claimed"
        row = [f"{contact:g}", str(kind), str(len(rows)), *speeds, rounded(fastest["t"], 6)]
        grid.rows.append([*row, claimed, rounded(rows["impulse"].max())])
    return grid


def certainty_blocks(inputs: Inputs, span: Span) -> list[Block]:
    """V, and the bound B where it is finite."""
    head = ["quantity", "run", "first", AT, "last", AT]
    grid = Grid("First and last value", head)
    drawn = False
    for table in inputs.tables:
        name = {"energy": "V", "states": "B"}.get(table.kind, "")
        y = table.column(name) if name in table.data else np.zeros(0)
        if np.isfinite(y).any():
            t = table.column("t")
            texts = [f"{rounded(v)} J" if math.isfinite(v) else "none" for v in y[[0, -1]]]
            first, last = ([text, rounded(time, 6)] for text, time in zip(texts, t[[0, -1]]))
            grid.rows.append([name, table.label, *first, *last])
            drawn |= bool((np.isfinite(y) & (y > 0.0)).any())
    if not grid.rows:
        return []
    blocks: list[Block] = []
    if drawn:
        caption = "V compares the estimate with a simulated machine. B bounds V of the replica."
        blocks.append(MotionPictures(inputs, span).of_panels(["V"], caption))
    else:
        blocks.append("No value of V or B is positive, so there is no picture.")
    if not inputs.of_kind("energy"):
        blocks.append(
            "V is not determined: the true state is not among the files. It is known of a "
            "simulated machine only."
        )
    return [*blocks, grid]


def inconsistencies_blocks(inputs: Inputs) -> list[Block]:
    """Events that failed the filter's gate, and intervals in which events may be missing."""
    runs = [run for run in inputs.runs() if run.report is not None]
    blocks = [block for run in runs for block in _failures(run)]
    for run in runs:
        missing = f"Intervals of the run {run.label} in which events may be missing"
        grid = Grid(missing, ["from [s]", "to [s]"])
        for gap in list_at(run.report, "degraded")[:MOST_ROWS]:
            end = number_at(gap, "to")
            last = "the end" if end is None else rounded(end, 8)
            grid.rows.append([rounded(number_at(gap, "from"), 8), last])
        blocks += [grid] if grid.rows else []
    return blocks


def _failures(run: ObserverRun) -> list[Block]:
    failures = number_at(run.report, "confidence", "inconsistencies")
    listed = list_at(run.report, "confidence", "first_inconsistencies")
    if failures is None or not listed:
        return [f"Run {run.label}: none."] if failures == 0 else []
    head = ["t [s]", "contact", "suspected", "innovation² / variance", "records lost"]
    grid = Grid(f"Events of the run {run.label} that failed the filter's gate", head)
    for one in listed[:MOST_ROWS]:
        square = number_at(one, "square_over_variance")
        row = [rounded(number_at(one, "t"), 8), count_at(one, "contact"), text_at(one, "suspicion")]
        row.append("" if square is None else rounded(square, 3))
        grid.rows.append([*row, "yes" if at(one, "known_loss") is True else "no"])
    blocks: list[Block] = [grid]
    if failures > len(grid.rows):
        blocks.append(f"The first {len(grid.rows)} of {rounded(failures, 9)}.")
    refutations = number_at(run.report, "confidence", "refutations")
    if refutations is not None:
        times = rounded(refutations, 9)
        blocks.append(f"The bound has refuted the filter's estimate {times} times.")
    return blocks


def provenance_blocks(inputs: Inputs) -> list[Block]:
    """Files, and the programs that wrote them as far as they say so."""
    files = Grid("Files of this report", ["file", "content", "damage"])
    files.rows.append([inputs.scene_file, "scene", "none"])
    for table in inputs.tables:
        content = {"energy": "V"}.get(table.kind, str(table.kind))
        if table.kind == "states":
            content += " of an estimate" if table.is_estimate else " of a machine"
        content += f", {counted(len(table.data), 'row')}"
        if table.spurious:
            content += f", {table.spurious} marked as spurious and left out"
        files.rows.append([str(table.file), content, table.damage or "none"])
    programs = Grid("Programs that wrote a report", ["program", "version", "exit", "command"])
    for report in inputs.reports:
        files.rows.append([report.file, f"report of {report.program}", "none"])
        version = text_at(report.content, "version") or "not in the report"
        words = [shlex.quote(w) for w in list_at(report.content, "command") if isinstance(w, str)]
        command = " ".join(["sprag", report.program, *words]) if words else "not in the report"
        programs.rows.append([report.program, version, count_at(report.content, "exit"), command])
    note = "CSV files have no version and no command line. --report of each program writes both."
    return [files, programs, note] if programs.rows else [files, note]
