"""Section and verdict of a report of identify."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from .analysis import Residuals, consistency
from .content import (
    MOST_ROWS,
    Grid,
    Section,
    Verdict,
    quantity,
    rounded,
    rounded_to,
    scale,
)
from .inputs import at, count_at, list_at, number_at, text_at
from .pictures import Interval, correlation_picture, interval_picture, residual_picture

if TYPE_CHECKING:
    from .inputs import JsonReport

MOST_CONTACTS = 60


def verdict_of_identification(report: JsonReport) -> Verdict:
    """The verdict of identify, with its reason or with the check of the prediction."""
    content = report.content
    verdict = Verdict(
        f"Identification, {report.file}",
        _sentence(text_at(content, "verdict")),
        tone="good" if at(content, "fits") is True else "bad",
    )
    predicted = number_at(content, "predicted")
    if not verdict.first:
        error = text_at(content, "error")
        verdict.first = _sentence(error) if error else "The report has no verdict."
    elif at(content, "fits") is not True:
        verdict.second = text_at(content, "reason")
    elif predicted is not None and predicted > 0.0:
        before = quantity(number_at(content, "predicted_before"), "s", 2)
        verdict.second = (
            "The fit to the first four fifths of the recording predicts the impacts of the last "
            f"fifth within {quantity(predicted, 's', 2)}, and those of the four within {before}."
        )
    else:
        scatter = quantity(number_at(content, "scatter"), "s", 3)
        verdict.second = (
            f"The residuals scatter by {scatter}; a prediction of later impacts was not tested."
        )
    return verdict


def identification_section(report: JsonReport, scene_name: str) -> Section:
    """Parameters, their intervals and correlations, the residuals, lost and spurious events."""
    content = report.content
    section = Section("Identification")
    name = text_at(content, "scene")
    if name and name != scene_name:
        section.blocks.append(
            f"The identification was of the scene {name}, this report shows the scene "
            f"{scene_name}."
        )
    if list_at(content, "parameters"):
        section.blocks.append(_parameters(content))
    if list_at(content, "others"):
        section.blocks.append(
            "Other values of the parameters fit the events as well: the result is ambiguous."
        )
    if intervals := _intervals(content):
        section.blocks.append(interval_picture(intervals))
    section.blocks.append(_facts(content))
    names, correlations = _correlations(content)
    if len(names) > 1:
        section.blocks.append(correlation_picture(names, correlations))
    _add_residuals(content, section)
    events = _events(content)
    if events.rows:
        section.blocks.append(events)
    return section


def _sentence(clause: str) -> str:
    return clause[:1].upper() + clause[1:] + ("" if clause.endswith(".") or not clause else ".")


def _unit(parameter: Any) -> str:
    return text_at(parameter, "unit").replace("^2", "²")


def _parameters(content: dict[str, Any]) -> Grid:
    grid = Grid(
        "Parameters: value of the scene, fitted value, standard deviation, 95 % interval",
        ["parameter", "scene", "fitted", "sigma", "95 % interval", "change"],
    )
    for of in list_at(content, "parameters"):
        nominal, value = number_at(of, "nominal"), number_at(of, "value")
        factor, unit = scale([nominal, value], _unit(of))

        def scaled(number: float | None) -> float | None:
            return None if number is None else factor * number

        name = text_at(of, "parameter") + (f" [{unit}]" if unit else "")
        row = [name, rounded(scaled(nominal), 6)]
        grid.rows.append(row)
        if at(of, "determined") is not True or value is None:
            row += ["not determined", "", "", ""]
            continue
        sigma, low, high = (scaled(number_at(of, key)) for key in ("sigma", "low", "high"))
        width = sigma if sigma is not None or low is None or high is None else high - low
        row.append(rounded_to(scaled(value), width))
        row.append("at a physical bound" if sigma is None else rounded(sigma, 2))
        row.append(f"[{rounded_to(low, width)}, {rounded_to(high, width)}]")
        if nominal is None:
            row.append("")
        elif nominal == 0.0:
            row.append(rounded(factor * value, 3))
        else:
            row.append(f"{rounded(100.0 * (value - nominal) / abs(nominal), 3)} %")
    if held := text_at(content, "held"):
        grid.rows.append([held, "", "held: it sets the scale", "", "", ""])
    return grid


def _intervals(content: dict[str, Any]) -> list[Interval]:
    intervals = []
    for of in list_at(content, "parameters"):
        ends = [number_at(of, "range", 0), number_at(of, "range", 1)]
        numbers = [number_at(of, key) for key in ("nominal", "value", "low", "high")] + ends
        nominal, value, low, high, least, most = (
            math.nan if number is None else number for number in numbers
        )
        if at(of, "determined") is not True or math.isnan(sum(numbers_of(numbers))):
            continue

        def in_range(x: float) -> float:
            end = nominal - least if x < nominal else most - nominal
            return (x - nominal) / max(abs(end), 1e-300)

        sigma = number_at(of, "sigma")
        factor, unit = scale([value], _unit(of))
        width = factor * (high - low if sigma is None else sigma)
        text = f"{rounded_to(factor * value, width)} {unit}".rstrip()
        places = (in_range(value), in_range(low), in_range(high))
        intervals.append(Interval(text_at(of, "parameter"), text, *places))
    return intervals


def numbers_of(values: list[float | None]) -> list[float]:
    """The values with nan for None."""
    return [math.nan if value is None else value for value in values]


def _correlations(content: dict[str, Any]) -> tuple[list[str], Any]:
    rows, parameters = list_at(content, "correlations"), list_at(content, "parameters")
    known = [i for i in range(min(len(rows), len(parameters))) if number_at(rows, i, i) is not None]
    names = [text_at(parameters, i, "parameter") for i in known]
    values = [numbers_of([number_at(rows, i, k) for k in known]) for i in known]
    return names, np.array(values, float)


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


def residuals_of(content: dict[str, Any]) -> Residuals:
    """Residuals of a report of identify; empty in one of an older version."""
    keys = ("t", "residual", "sigma", "contact")
    rows = []
    for row in zip(*(list_at(content, "residuals", key) for key in keys)):
        numbers = numbers_of([number_at(list(row), i) for i in range(len(keys))])
        in_range = numbers[3] in range(1, MOST_CONTACTS + 1)
        if in_range and math.isfinite(numbers[0] + numbers[1]):
            rows.append(numbers)
    columns = np.array(rows, float).reshape(-1, len(keys)).T
    return Residuals(columns[0], columns[1], columns[2], columns[3].astype(np.int64))


def _add_residuals(content: dict[str, Any], section: Section) -> None:
    residuals = residuals_of(content)
    if len(residuals) == 0:
        return
    section.blocks.append(
        residual_picture(
            residuals,
            "Measured − fitted time",
            "s",
            "Residuals of the event times, with bars of ± 2 sigma of the jitter. Events that the "
            "fit leaves out are not among them.",
        )
    )
    test = consistency(residuals.normalized())
    if test is None:
        return
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
    section.blocks.append(text)


def _events(content: dict[str, Any]) -> Grid:
    grid = Grid("Lost and spurious events", ["t [s]", "contact", "event"])
    for key, what in [
        ("missing", "lost: the machine has an impact there"),
        ("spurious", "spurious: no impact belongs to it"),
    ]:
        for event in list_at(content, key):
            t = rounded(number_at(event, "t"), 8)
            grid.rows.append([t, count_at(event, "contact"), what])
    del grid.rows[MOST_ROWS:]
    return grid
