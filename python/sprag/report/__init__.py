"""A run or an identification as one page to hand in.

:func:`page` returns the page as HTML text; ``sprag report`` writes it as HTML or PDF.
"""

from __future__ import annotations

import argparse
import math
import os
from collections.abc import Iterable
from typing import Any

from .._command import (
    EXIT_DONE,
    EXIT_FAILED,
    Labelled,
    Parser,
    UsageError,
    Written,
    finite,
    printable,
    run_program,
    say,
    written,
)

__all__ = ["main", "page"]


def page(
    files: Iterable[str | os.PathLike[str]],
    *,
    title: str = "",
    begin: float = -math.inf,
    end: float = math.inf,
) -> str:
    """The report of a run or an identification as the text of an HTML page.

    files: the scene, as SCENE.toml or the name of a shipped one, and any of [LABEL=]FILE, in any
    order: CSV files of states, events, impacts, predictions and V, and JSON of --report or of
    identify --json. title: in place of the scene's name. begin, end: the time that the pictures of
    motion, impacts, V and B show [s]. The page has no script and loads nothing; names in it are
    shown as text. Raises InputError or SceneError if a file is none of these, and ValueError if
    there is nothing in the given time.
    """
    from .document import make_document
    from .inputs import read_inputs
    from .document import page_of

    return page_of(make_document(read_inputs(files), title, (begin, end)))


def main() -> int:
    """The program ``sprag report``."""
    parser = Parser(
        "report",
        "Writes a run or an identification as one page to hand in. It has the verdict, machine, "
        "measurement, parameters, residuals, gaps, impacts, bound, inconsistencies, versions and "
        "command lines, and needs no network and no script.",
    )
    parser.add_argument(
        "files",
        metavar="FILE",
        nargs="+",
        type=Labelled,
        help="SCENE.toml, or the name of a scene, and any of [LABEL=]FILE: the CSV files of "
        "master_sim, observer and sync_logger, the JSON of --report, and that of identify --json",
    )
    parser.add_argument(
        "--output",
        metavar="F",
        type=Written,
        required=True,
        help="the report: F.html or F.pdf",
    )
    parser.add_argument(
        "--format",
        choices=["html", "pdf"],
        help="format, in place of the output's ending; pdf needs chromium or WeasyPrint",
    )
    parser.add_argument(
        "--from", dest="begin", metavar="T", type=finite, help="show the time from here on [s]"
    )
    parser.add_argument(
        "--to", dest="end", metavar="T", type=finite, help="show the time up to here [s]"
    )
    parser.add_argument("--title", metavar="TEXT", help="title, in place of the scene's name")
    return run_program(parser, _run)


def _run(options: argparse.Namespace, report: dict[str, Any]) -> int:
    from .document import make_document
    from .inputs import read_inputs
    from .document import page_of
    from .pdf import pdf_of

    form = options.format or os.path.splitext(options.output)[1].removeprefix(".")
    if form not in ("html", "pdf"):
        raise UsageError(
            f"--output: {options.output} is not allowed; must end in .html or .pdf, or --format "
            "must be given"
        )
    inputs = read_inputs(options.files)
    for damage in inputs.damage:
        say("report", f"{damage}; the report shows everything before it")
    if inputs.scene is None:
        say(
            "report",
            "the compiled part of the Python package is not installed; the report leaves out the "
            "rows about the machine and the prior",
        )
    begin = -math.inf if options.begin is None else options.begin
    end = math.inf if options.end is None else options.end
    try:
        document = make_document(inputs, options.title or "", (begin, end))
    except ValueError as error:
        raise UsageError(printable(str(error))) from None
    report["sections"] = [section.title for section in document.sections]
    if inputs.damage:
        report["damage"] = inputs.damage
    html = page_of(document)
    content = pdf_of(html) if form == "pdf" else html.encode(errors="backslashreplace")
    with written(options.output) as file:
        file.write_bytes(content)
    return EXIT_FAILED if inputs.damage else EXIT_DONE
