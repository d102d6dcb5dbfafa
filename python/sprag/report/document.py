"""The sections of a report in their order, as far as the files have something for them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .content import Document, Section, Verdict
from .identification import identification_section, verdict_of_identification
from .machine import machine_section
from .run import (
    certainty_section,
    impacts_section,
    inconsistencies_section,
    measurement_section,
    motion_section,
    provenance_section,
    residuals_section,
    verdict_of_run,
)

if TYPE_CHECKING:
    from .inputs import Inputs


def make_document(inputs: Inputs, title: str, span: tuple[float, float]) -> Document:
    """The whole report; an empty title is the scene's name. span: time of the pictures [s]."""
    fits = [report for report in inputs.reports if report.program == "identify"]
    verdicts = [verdict_of_identification(report) for report in fits]
    verdicts += [verdict_of_run(run, inputs) for run in inputs.runs()]
    if not verdicts:
        verdicts.append(
            Verdict(
                "Verdict",
                "Not determined.",
                "Neither an estimate of the observer nor a report of observer or identify is among "
                "the files.",
            )
        )
    sections: list[Section | None] = [
        machine_section(inputs),
        measurement_section(inputs),
        *(identification_section(report, inputs.scene_name) for report in fits),
        motion_section(inputs, span),
        residuals_section(inputs),
        impacts_section(inputs, span),
        certainty_section(inputs, span),
        inconsistencies_section(inputs),
        provenance_section(inputs),
    ]
    title = title or inputs.scene_name
    return Document(title, verdicts, [section for section in sections if section is not None])
