"""A run or an identification as one page to hand in.

:func:`page` returns the page as HTML text; ``sprag report`` writes it as HTML or PDF.
"""

from __future__ import annotations

import argparse
import math
import os
from collections.abc import Iterable
from typing import Any

from .. import _command
from .._command import EXIT_DONE, EXIT_FAILED, Labelled, Parser, UsageError, Written, finite

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
    shown as text. Raises InputError or SceneError if a file is none of these, or if there is
    nothing in the given time.
    """
    from .document import make_document, page_of
    from .inputs import read_inputs

    return page_of(make_document(read_inputs(files), title, (begin, end)))


def main() -> int:
    """The program ``sprag report``."""
    parser = Parser(
        "report",
        "Writes a run or an identification as one page to hand in. It has the verdict, machine, "
        "measurement, parameters, residuals, gaps, impacts, bound, inconsistencies, versions and "
        "command lines, and needs no network and no script.",
    )
    add = parser.add_argument
    files = "SCENE.toml, or the name of a scene, and any of [LABEL=]FILE: the CSV files of "
    files += "master_sim, observer and sync_logger, the JSON of --report, and that of identify "
    add("files", metavar="FILE", nargs="+", type=Labelled, help=f"{files}--json")
    add("--output", metavar="F", type=Written, required=True, help="the report: F.html or F.pdf")
    form = "format, in place of the output's ending; pdf needs chromium or WeasyPrint"
    add("--format", choices=["html", "pdf"], help=form)
    begin, end = "show the time from here on [s]", "show the time up to here [s]"
    add("--from", dest="begin", metavar="T", type=finite, help=begin)
    add("--to", dest="end", metavar="T", type=finite, help=end)
    add("--title", metavar="TEXT", default="", help="title, in place of the scene's name")
    return _command.run_program(parser, _run)


def _run(options: argparse.Namespace, report: dict[str, Any]) -> int:
    from .document import make_document, page_of
    from .inputs import read_inputs
    from .pdf import pdf_of

    form = options.format or os.path.splitext(options.output)[1].removeprefix(".")
    if form not in ("html", "pdf"):
        allowed = "must end in .html or .pdf, or --format must be given"
        raise UsageError(f"--output: {options.output} is not allowed; {allowed}")
    inputs = read_inputs(options.files)
    for damage in inputs.damage:
        _command.say("report", f"{damage}; the report shows everything before it")
    if inputs.scene is None:
        missing = "the compiled part of the Python package is not installed"
        left_out = "the report leaves out the rows about the machine and the prior"
        _command.say("report", f"{missing}; {left_out}")
    begin = -math.inf if options.begin is None else options.begin
    end = math.inf if options.end is None else options.end
    document = make_document(inputs, options.title, (begin, end))
    report["sections"] = [section for section, _ in document.sections]
    if inputs.damage:
        report["damage"] = inputs.damage
    html = page_of(document)
    content = pdf_of(html) if form == "pdf" else html.encode(errors="backslashreplace")
    with _command.written(options.output) as file:
        file.write_bytes(content)
    return EXIT_FAILED if inputs.damage else EXIT_DONE
