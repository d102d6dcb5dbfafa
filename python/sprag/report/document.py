"""A report: its sections in their order, and their form as one HTML page.

The page has no script, loads nothing, and contains its pictures.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from .._command import printable, require
from .._version import __version__
from .content import Block, Document, Verdict
from .identification import identification_blocks, verdict_of_identification
from .machine import machine_blocks
from .pictures import MotionPictures
from .run import certainty_blocks, impacts_blocks, inconsistencies_blocks, measurement_blocks
from .run import provenance_blocks, residuals_blocks, verdict_of_run

if TYPE_CHECKING:
    from .content import Picture
    from .inputs import Inputs


def make_document(inputs: Inputs, title: str, span: tuple[float, float]) -> Document:
    """The whole report; an empty title is the scene's name. span: time of the pictures [s]."""
    fits = [report for report in inputs.reports if report.program == "identify"]
    verdicts = [verdict_of_identification(report) for report in fits]
    verdicts += [verdict_of_run(run, inputs) for run in inputs.runs()]
    if not verdicts:
        none = (
            "Neither an estimate of the observer nor a report of observer or identify is among the "
            "files."
        )
        verdicts = [Verdict("Verdict", "Not determined.", none)]
    motion = MotionPictures(inputs, span).of_motion() if inputs.of_kind("states") else []
    sections: list[tuple[str, list[Block]]] = [
        ("Machine and scene", machine_blocks(inputs)),
        ("What was measured", measurement_blocks(inputs)),
        *(("Identification", identification_blocks(fit, inputs.scene_name)) for fit in fits),
        ("Motion", [*motion]),
        ("Predicted and measured events", residuals_blocks(inputs)),
        ("Impact velocities", impacts_blocks(inputs, span)),
        ("Error energy V and bound B", certainty_blocks(inputs, span)),
        ("Inconsistencies", inconsistencies_blocks(inputs)),
        ("Files, versions and command lines", provenance_blocks(inputs)),
    ]
    present = [(name, blocks) for name, blocks in sections if blocks]
    return Document(title or inputs.scene_name, verdicts, present)


def page_of(document: Document) -> str:
    """The page as text. Every name in it is text of one line, whatever it contains."""
    jinja2 = require("jinja2", "python3-jinja2", "report")
    markup = require("markupsafe", "python3-markupsafe", "report").Markup
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("sprag.report", "."),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        finalize=lambda value: value if isinstance(value, markup) else printable(str(value)),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    template = environment.get_template("page.html.j2")
    inline_svg = _inline_svg(markup)
    return str(template.render(document=document, version=__version__, inline_svg=inline_svg))


def _inline_svg(markup: Any) -> Callable[[Picture], Any]:
    """Makes <svg> elements part of one page.

    Identifiers hold for the whole page, so those of each picture get a prefix of its own.
    """
    number = itertools.count(1)

    def inline_svg(picture: Picture) -> Any:
        prefix = f"p{next(number)}-"
        tags = re.compile(r"<[^>]*>")  # text between tags stays as it is
        references = re.compile(r"""(\bid="|href="#|url\(#)""")
        svg = tags.sub(lambda tag: references.sub(rf"\g<1>{prefix}", tag[0]), picture.svg)
        label = markup.escape(printable(picture.caption))
        return markup(svg.replace("<svg ", f'<svg role="img" aria-label="{label}" ', 1))

    return inline_svg
