"""Section and verdict of a report of identify."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from .._command import require
from ..tables import MOST_CONTACTS
from .analysis import consistency, normalized
from .content import MOST_ROWS, Block, Grid, Verdict, quantity, rounded
from .content import rounded_to, scale
from .inputs import at, count_at, list_at, number_at, numbers_at, text_at
from .pictures import Interval, correlation_picture, interval_picture, residual_picture

if TYPE_CHECKING:
    from .inputs import JsonReport


def verdict_of_identification(report: JsonReport) -> Verdict:
    """The verdict of identify, with its reason or with the check of the prediction."""
    content = report.content
    fits, verdict = at(content, "fits") is True, text_at(content, "verdict")

    def seconds(key: str, digits: int = 2) -> str:
        return quantity(number_at(content, key), "s", digits)

    if not verdict:
        verdict, second = text_at(content, "error") or "the report has no verdict", ""
    elif not fits:
        second = text_at(content, "reason")
    elif (number_at(content, "predicted") or 0.0) > 0.0:
        second = (
            "The fit to the first four fifths of the recording predicts the impacts of the last "
            f"fifth within {seconds('predicted')}, and those of the four within "
            f"{seconds('predicted_before')}."
        )
    else:
        scatter = seconds("scatter", 3)
        second = (
            f"The residuals scatter by {scatter}; a prediction of later impacts was not tested."
        )
    first = verdict[0].upper() + verdict[1:].removesuffix(".") + "."
    return Verdict(f"Identification, {report.file}", first, second, "good" if fits else "bad")


def identification_blocks(report: JsonReport, scene_name: str) -> list[Block]:
    """Parameters, their intervals and correlations, the residuals, lost and spurious events."""
    content = report.content
    blocks: list[Block] = []
    name = text_at(content, "scene")
    if name and name != scene_name:
        blocks.append(
            f"The identification was of the scene {name}, this report shows the scene {scene_name}."
        )
    parameters, intervals = _parameters(content)
    if list_at(content, "parameters"):
        blocks.append(parameters)
    if list_at(content, "others"):
        blocks.append(
            "Other values of the parameters fit the events as well: the result is ambiguous."
        )
    if intervals:
        blocks.append(interval_picture(intervals))
    blocks.append(_facts(content))
    rows, of = list_at(content, "correlations"), list_at(content, "parameters")
    known = [i for i in range(min(len(rows), len(of))) if number_at(rows, i, i) is not None]
    if len(known) > 1:
        names = [text_at(of, i, "parameter") for i in known]
        correlations = np.array([numbers_at(rows[i], *known) for i in known])
        blocks.append(correlation_picture(names, correlations))
    blocks += _residuals(content)
    events = Grid("Lost and spurious events", ["t [s]", "contact", "event"])
    for key, what in [
        ("missing", "lost: the machine has an impact there"),
        ("spurious", "spurious: no impact belongs to it"),
    ]:
        for event in list_at(content, key):
            t = rounded(number_at(event, "t"), 8)
            events.rows.append([t, count_at(event, "contact"), what])
    del events.rows[MOST_ROWS:]
    return [*blocks, events] if events.rows else blocks


def _parameters(content: dict[str, Any]) -> tuple[Grid, list[Interval]]:
    """A table of the parameters, and the intervals of those that are determined."""
    grid = Grid(
        "Parameters: value of the scene, fitted value, standard deviation, 95 % interval",
        ["parameter", "scene", "fitted", "sigma", "95 % interval", "change"],
    )
    intervals = []
    for of in list_at(content, "parameters"):
        name, unit = text_at(of, "parameter"), text_at(of, "unit").replace("^2", "²")
        numbers = numbers_at(of, "nominal", "value", "sigma", "low", "high")
        numbers += numbers_at(at(of, "range"), 0, 1)
        factor, unit = scale(numbers[:2], unit)
        nominal, value, sigma, low, high, least, most = (factor * number for number in numbers)
        row = [f"{name} [{unit}]" if unit else name, rounded(nominal, 6)]
        grid.rows.append(row)
        if at(of, "determined") is not True or math.isnan(value):
            row += ["not determined", "", "", ""]
            continue
        width = high - low if math.isnan(sigma) else sigma
        fitted = rounded_to(value, width)
        row += [fitted, "at a physical bound" if math.isnan(sigma) else rounded(sigma, 2)]
        row.append(f"[{rounded_to(low, width)}, {rounded_to(high, width)}]")
        change = rounded(value, 3)
        if nominal != 0.0:
            change = f"{rounded(100.0 * (value - nominal) / abs(nominal), 3)} %"
        row.append("" if math.isnan(nominal) else change)
        if not math.isnan(nominal + value + low + high + least + most):
            ends = [max(abs(end - nominal), 1e-300) for end in (least, most)]
            in_range = [(x - nominal) / ends[x >= nominal] for x in (value, low, high)]
            intervals.append(Interval(name, f"{fitted} {unit}".rstrip(), *in_range))
    if held := text_at(content, "held"):
        grid.rows.append([held, "", "held: it sets the scale", "", "", ""])
    return grid, intervals


def _facts(content: dict[str, Any]) -> Grid:
    grid = Grid("Fit", ["quantity", "value"])

    def add(name: str, value: str) -> None:
        if value:
            grid.rows.append([name, value])

    def number(*keys: str, digits: int = 2, unit: str = "") -> str:
        value = number_at(content, *keys)
        return "" if value is None else quantity(value, unit, digits).rstrip()

    told = at(content, "jitter_told") is True
    add("impacts used", count_at(content, "impacts"))
    add("uninterrupted parts", count_at(content, "stretches"))
    add("closings in the recording", count_at(content, "events"))
    add("closings left out", count_at(content, "left_out"))
    add("from", number("from", digits=6, unit="s"))
    add("to", number("to", digits=6, unit="s"))
    add("jitter, as given" if told else "jitter, as found", number("jitter", digits=3, unit="s"))
    add("scatter of the residuals", number("scatter", digits=3, unit="s"))
    if told:
        add("χ²", number("chi2", digits=4))
        add("largest χ² that is accepted", number("largest_chi2", digits=4))
    add("degrees of freedom", count_at(content, "freedom"))
    if (number_at(content, "predicted") or 0.0) > 0.0:
        error = "error of predicting the last fifth from the first four"
        add(error, number("predicted", unit="s"))
        add("the same error within the first four", number("predicted_before", unit="s"))
    if at(content, "drift", "value") is not None:
        low, high = number("drift", "low"), number("drift", "high")
        found = at(content, "drift", "found") is True
        text = f"{number('drift', 'value')} ({low} to {high})"
        none = f"none found, below {high} (95 %)"
        add("drift, energy per unit of time", text if found else none)
    if at(content, "restitution_scatter", "found") is True:
        add("scatter of the restitution", number("restitution_scatter", "value"))
    if at(content, "restitution_trend", "value") is not None:
        trend = [number("restitution_trend", key) for key in ("value", "sigma")]
        found = at(content, "restitution_trend", "found") is True
        name = "trend of the restitution with the impact's speed"
        add(name, " ± ".join(trend) + ("" if found else ", not significant"))
    return grid


def _residuals(content: dict[str, Any]) -> list[Block]:
    """Their picture and their test; none in a report of an older version."""
    pd = require("pandas", "python3-pandas", "report")
    keys = ("t", "residual", "sigma", "contact")
    rows = [
        numbers_at(list(row), 0, 1, 2, 3)
        for row in zip(*(list_at(content, "residuals", key) for key in keys))
    ]
    residuals = pd.DataFrame(rows, columns=["t", "value", "sigma", "contact"], dtype=float)
    known = np.isfinite(residuals["t"] + residuals["value"])
    residuals = residuals[known & residuals["contact"].isin(range(1, MOST_CONTACTS + 1))]
    if not len(residuals):
        return []
    caption = (
        "Residuals of the event times, with bars of ± 2 sigma of the jitter. Events that the fit "
        "leaves out are not among them."
    )
    picture = residual_picture(residuals, "Measured − fitted time", "s", caption)
    test = consistency(normalized(residuals))
    if test is None:
        return [picture]
    text = f"{rounded(100.0 * test.within_two, 3)} % of the {test.n} residuals are within 2 sigma. "
    if at(content, "jitter_told") is True:
        text += (
            "The jitter was given. The mean square of residual over sigma is "
            f"{rounded(test.mean_square, 3)}, expected within {rounded(test.low, 3)} to "
            f"{rounded(test.high, 3)}."
        )
    else:
        text += (
            "The jitter was estimated from these residuals, so that their size is no test of it."
        )
    return [picture, text]
