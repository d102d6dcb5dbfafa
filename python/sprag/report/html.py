"""A report as one HTML page: no script, nothing that is loaded, pictures within it."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from .._command import printable, require
from .._version import __version__

if TYPE_CHECKING:
    from .content import Document, Picture


def page_of(document: Document) -> str:
    """The page as text. Every name in it is text of one line, whatever it contains."""
    jinja2 = require("jinja2", "python3-jinja2", "report")
    markup = require("markupsafe", "python3-markupsafe", "report").Markup

    def shown(value: Any) -> Any:
        return value if isinstance(value, markup) else printable(str(value))

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("sprag.report", "."),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        finalize=shown,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    template = environment.get_template("page.html.j2")
    page: str = template.render(
        document=document, version=__version__, inline_svg=_inline_svg(markup)
    )
    return page


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
