"""Content of a report, independent of its form, and numbers as its texts show them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal

from .._drawing import readable_unit

MOST_ROWS = 100  # of a table of single events; a longer one is cut

_NUMBER = re.compile(r"(\[?[-+±]?\d[-+\d.e%± ,\]]*)?")


@dataclass
class Grid:
    """A table of texts with a head."""

    caption: str
    head: list[str]
    rows: list[list[str]] = field(default_factory=list)

    def is_number(self, column: int) -> bool:
        """Whether a column is shown to the right: all its cells are numbers, or empty."""
        cells = [row[column] for row in self.rows]
        return any(cells) and all(_NUMBER.fullmatch(cell) for cell in cells)


@dataclass
class Picture:
    """A drawing, an <svg> element."""

    caption: str
    svg: str


Block = str | Grid | Picture


@dataclass
class Verdict:
    """Two sentences about a program and its run."""

    about: str
    first: str
    second: str = ""
    tone: Literal["good", "bad", ""] = ""


@dataclass
class Document:
    """A whole report."""

    title: str
    verdicts: list[Verdict]
    sections: list[tuple[str, list[Block]]]  # titles with paragraphs, tables and pictures


def facts(caption: str, *pairs: tuple[str, str]) -> Grid:
    """A table of quantities and their values, without those that have none."""
    return Grid(caption, ["quantity", "value"], [list(pair) for pair in pairs if pair[1]])


def rounded(value: float | None, digits: int = 4) -> str:
    """A number of significant digits; "not determined" if it is not finite."""
    if value is None or not math.isfinite(value):
        return "not determined"
    return f"{value + 0.0:.{digits}g}"


def rounded_to(value: float, sigma: float) -> str:
    """The same with the digits that its standard deviation supports: two of sigma."""
    if not 0.0 < sigma < math.inf or value == 0.0 or not math.isfinite(value):
        return rounded(value, 6)
    digits = math.floor(math.log10(abs(value))) - math.floor(math.log10(sigma)) + 2
    return rounded(value, min(max(digits, 2), 10))


def scale(values: Iterable[float], unit: str) -> tuple[float, str]:
    """Factor and unit for values, as in pictures: mm, µm, nm or pm for small ones in m."""
    finite = [abs(value) for value in values if math.isfinite(value)]
    return readable_unit(max(finite, default=0.0), unit)


def quantity(value: float | None, unit: str, digits: int = 4) -> str:
    """A number with its unit: 0.00012 s is 120 µs; "not determined" if it is not finite."""
    if value is None or not math.isfinite(value):
        return "not determined"
    factor, prefixed = scale([value], unit)
    return f"{rounded(factor * value, digits)} {prefixed}"
