"""Tables as devices, spreadsheets and loggers write them.

read_table() returns the cells as texts, so that no digit is lost, each row with its line. Most
files need no options: the last rows show what a row looks like. The separator is the one by which
the rows are alike and the header has as many cells; the data begin at the first such row; the
names, and a row of units if there is one, are just above.
"""

from __future__ import annotations

import csv
import difflib
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

from .._command import counted
from .._errors import InputError
from .moments import LEVEL_WORDS, NUMBER, is_moment, unit_in_name, unit_of_cell

SEPARATORS: dict[str, str | None] = {"semicolon": ";", "tab": "\t", "comma": ",", "blank": None}
_MOST_JUDGED = 400  # rows at each end that decide what a row looks like
_NO_VALUE = frozenset("nan n/a na - -- null none ol inf".split())  # in place of a number
_THOUSANDS = re.compile(r"[-+]?[0-9]{1,3}((,[0-9]{3}){2,}(\.[0-9]*)?|(,[0-9]{3})+\.[0-9]*)")
_RATE = re.compile(
    r"sample\s*rate\D{0,4}?[:,=\s]\s*([0-9.]+(?:e[+-]?[0-9]+)?)\s*([kMG]?)", re.IGNORECASE
)

Rows = list[list[str]]


@dataclass
class Problem:
    """A part of a row that cannot be used."""

    line: int
    column: str  # "": the whole row
    what: str

    def __str__(self) -> str:
        return f"{self.line}: " + (f"column {self.column}: " if self.column else "") + self.what


@dataclass
class Table:
    """Rows of cells, all with as many as there are names: "" where a cell is empty or missing."""

    names: list[str]
    rows: Rows
    lines: list[int]  # of each row in the file, from 1
    units: dict[str, str] = field(default_factory=dict)  # by a column's name, as a row states them
    remarks: list[str] = field(default_factory=list)  # what the reader guessed or left out
    doubts: list[str] = field(default_factory=list)  # guesses that may be wrong
    problems: list[Problem] = field(default_factory=list)
    sample_rate: float | None = None  # of a file without times, as its head states it [1/s]
    has_header: bool = True
    of_clock: bool = False  # some times that were read are dates or times of day

    def column(self, name: str) -> list[str]:
        """The cells of the column of this name. Raises InputError with the names there are."""
        exact = [i for i, other in enumerate(self.names) if other == name]
        near = exact or [i for i, n in enumerate(self.names) if n.casefold() == name.casefold()]
        if len(near) == 1:
            return [row[near[0]] for row in self.rows]
        if near:
            raise InputError(
                f"there is more than one column '{name}'; the columns are {self.listed()}; "
                "--columns NAME,... gives them other names"
            )
        alike = difflib.get_close_matches(name, self.names, 1)
        meant = f" (did you mean '{alike[0]}'?)" if alike else ""
        remedy = "; the file has no header: --columns NAME,... names them"
        raise InputError(
            f"there is no column '{name}'{meant}; the columns are {self.listed()}"
            + ("" if self.has_header else remedy)
        )

    def listed(self) -> str:
        """The names of all columns, for a message."""
        return ", ".join(f"'{name}'" for name in self.names)

    def unit(self, name: str) -> str | None:
        """The unit of the column, by a row of units or by its name; None: none is stated."""
        return self.units.get(name) or unit_in_name(name)


def read_table(
    text: str,
    names: Sequence[str] | None = None,
    separator: str | None = None,
    skip_lines: int = 0,
) -> Table:
    """Reads the table in `text`.

    `names`: of the columns of a file without a header; `separator`: a key of SEPARATORS, None: as
    the lines show; `skip_lines`: number of lines at the beginning that are no part of the table.
    """
    ends = "\n" if "\n" in text else "\r"
    every = list(enumerate(text.replace("\r\n", "\n").split(ends), 1))[skip_lines:]
    comments = [(number, line) for number, line in every if _is_comment(line)]
    numbered = [(i, line) for i, line in every if line.strip(" \t\r;,") and not _is_comment(line)]
    if not numbered:
        raise InputError("there is no header and no row")
    lines = [line for _, line in numbered]
    mark = SEPARATORS[separator] if separator else _separator(lines, names)
    problems, rows, numbers = [], [], []
    for number, line in numbered:
        if (row := _split(line, mark, names)) is None:
            problems.append(Problem(number, "", "a quote is not closed"))
        else:
            rows.append(row)
            numbers.append(number)
    if not rows:
        raise InputError(str(problems[0]))
    usual = _usual(rows)
    begin = _begin_of_data(rows, usual)
    if begin is None:
        raise InputError("has no rows of numbers or times in columns")
    table = Table([], rows[begin:], numbers[begin:], problems=problems)
    above = [line.strip() for number, line in comments if number < numbers[begin]]
    if names:
        _take_names(table, names, len(usual), rows[:begin], numbers)
    else:
        _find_names(table, len(usual), rows[:begin], above[-1:], mark)
    _make_equal(table, "--columns has" if names else "the header has", mark)
    _check_commas(table)
    table.sample_rate = _stated_rate(
        [line for _, line in comments] + [",".join(row) for row in rows[:begin]]
    )
    return table


def _is_comment(line: str) -> bool:
    bare = line.strip()
    if bare.startswith(("#", "%", "//", "\\")):
        return True
    return bool(re.match(r";\s*[^\W\d]", bare)) and ";" not in bare[1:]


def _split(line: str, mark: str | None, names: Sequence[str] | None = None) -> list[str] | None:
    """The cells of a line; by blanks at most as many as there are names. None: an open quote."""
    if mark is None:
        return line.split(None, len(names) - 1 if names else -1)
    if '"' not in line:
        return [cell.strip() for cell in line.split(mark)]
    for strict in (True, False):
        with_quotes = csv.reader([line], delimiter=mark, skipinitialspace=True, strict=strict)
        try:
            return [cell.strip() for cell in next(with_quotes)]
        except (csv.Error, StopIteration):
            # A blank after a closing quote is harmless, an open quote is not.
            if line.count('"') % 2:
                break
    return None


@lru_cache(maxsize=65536)
def _kind(cell: str) -> str:
    """Of a cell: "" (empty), "number", "moment", "word" (a level) or "text"."""
    if not cell:
        return ""
    if NUMBER.fullmatch(cell):
        return "number"
    if is_moment(cell):
        return "moment"
    return "word" if cell.casefold() in LEVEL_WORDS else "text"


def _usual(rows: Rows) -> list[str]:
    """The kind of each column's cells, by the last rows, which are past the head.

    Of those with the usual width; in a tie a number or a time.
    """
    last = rows[-min(_MOST_JUDGED, max(3, len(rows) // 4)) :]
    width = Counter(len(row) for row in reversed(last)).most_common(1)[0][0]
    usual = []
    for column in zip(*(row for row in last if len(row) == width)):
        counts = Counter(map(_kind, column))
        usual.append(max(counts, key=lambda kind: (counts[kind], kind in ("number", "moment"))))
    return usual


def _fits(row: list[str], usual: list[str]) -> bool:
    """Whether a row is like the usual one: each cell is empty or of the column's kind."""
    kinds = [_kind(cell) for cell in row]
    return (
        len(row) <= len(usual)
        and any(kind in ("number", "moment") for kind in kinds)
        and all(
            kind in ("", of) or of == "" or (kind == "word" and of == "text")
            for kind, of in zip(kinds, usual)
        )
    )


def _is_odd(row: list[str], usual: list[str]) -> bool:
    """Whether a row belongs to the data although a cell is bad.

    Its first cell where rows have a number or a time is of that kind, or says that there is none.
    """
    first = next((i for i, kind in enumerate(usual) if kind in ("number", "moment")), None)
    if first is None or len(row) != len(usual):
        return False
    return _kind(row[first]) == usual[first] or row[first].casefold() in _NO_VALUE


def _begin_of_data(rows: Rows, usual: list[str]) -> int | None:
    """The first row of full width that fits, if most of the next ones do as well."""
    for i, row in enumerate(rows):
        if len(row) == len(usual) and _fits(row, usual):
            following = [_fits(other, usual) for other in rows[i : i + 4]]
            if 2 * sum(following) >= len(following):
                while i > 0 and (_fits(rows[i - 1], usual) or _is_odd(rows[i - 1], usual)):
                    i -= 1
                return i
    return None


def _judge(
    lines: list[str], mark: str | None, names: Sequence[str] | None
) -> tuple[bool, float, int]:
    """How well a separator divides the lines: the header agrees, share of like rows, columns."""
    split = [row for line in lines if (row := _split(line, mark, names))]
    usual = _usual(split) if split else []
    if not any(kind in ("number", "moment") for kind in usual):
        return False, 0.0, 0
    rows = split[:_MOST_JUDGED]
    begin = _begin_of_data(rows, usual)
    begin = len(rows) if begin is None else begin
    header = len(names) if names else len(rows[begin - 1]) if begin > 0 else len(usual)
    alike = sum(_fits(row, usual) for row in rows[begin:]) / max(1, len(rows) - begin)
    return len(usual) <= header <= len(usual) + 2, round(alike, 1), len(usual)


def _separator(lines: list[str], names: Sequence[str] | None) -> str | None:
    """The separator of the lines. In doubt the one of fewer columns: commas may be decimal."""
    sample = lines[:_MOST_JUDGED] + lines[_MOST_JUDGED:][-_MOST_JUDGED:]
    scores = {mark: _judge(sample, mark, names) for mark in SEPARATORS.values()}
    best = max(score[:2] for score in scores.values())
    good = [mark for mark, score in scores.items() if score[:2] == best]
    if names:
        wanted = len(names)
        return max(good, key=lambda mark: (scores[mark][2] == wanted, mark is not None))
    several = [mark for mark in good if scores[mark][2] > 1]
    if several == [","] and any(scores[mark][2] == 1 for mark in good if mark != ","):
        first = _split(lines[0], ",") or [""]
        if all(first) and _fits(first, _usual([_split(line, ",") or [] for line in sample])):
            raise InputError(
                f"'{lines[-1].strip()}' is one column with decimal commas or several; "
                "give --separator or --columns"
            )
    return several[0] if several else "\t"


def _are_names(row: list[str]) -> bool:
    """Texts, or whole numbers after a first text, as in x-axis,1."""
    others = [cell for cell in row if _kind(cell) not in ("text", "", "word")]
    return any(row) and (not others or (_kind(row[0]) == "text" and "".join(others).isdigit()))


def _take_names(
    table: Table, names: Sequence[str], width: int, head: Rows, numbers: list[int]
) -> None:
    if width > len(names):
        raise InputError(
            f"{table.lines[0]}: has {counted(width, 'field')}; --columns names "
            f"{counted(len(names), 'column')}"
        )
    table.names = list(names)
    if head:
        table.remarks.append(
            f"line {numbers[len(head) - 1]} is not used, since --columns names the columns: "
            f"'{_short(head[-1])}'"
        )


def _find_names(
    table: Table, width: int, head: Rows, comments: list[str], mark: str | None
) -> None:
    """Sets the names and units of the columns, and says which rows of the head are not used.

    `comments`: the last one before the rows, if there is one.
    """
    if any(row and row[0].casefold() == "sequence" for row in head):
        raise InputError(
            "X is the number of the sample; its start and increment are in line 2. Save times, "
            "or multiply"
        )
    last = head[-1] if head else []
    above = head[-2] if len(head) > 1 else []
    used = 0
    if _are_names(last) and width <= len(last) <= width + 2:
        table.names, used = last, 1
        units = [unit for cell in last if (unit := unit_of_cell(cell)) is not None]
        if len(units) == len(last) == len(above) and _are_names(above):
            table.names, used = above, 2
            table.units = {name: unit for name, unit in zip(above, units) if unit}
            stated = ", ".join(f"{name} in {unit}" for name, unit in table.units.items())
            table.remarks.append(f"row of units: {stated}")
    elif _are_names(last) and len(last) != width:
        raise InputError(
            f"{table.lines[0]}: has {counted(width, 'field')}; the header has {len(last)}"
            + _cause(mark)
        )
    if len(head) > used:
        table.remarks.append(
            f"{counted(len(head) - used, 'line')} before the {'header' if used else 'numbers'} "
            f"left out, the last one: '{_short(head[len(head) - used - 1])}'"
        )
    if used:
        return
    # As numpy.savetxt writes its header.
    for separator in [*filter(None, SEPARATORS.values()), mark] if comments else []:
        names = _split(comments[0].lstrip("#%/\\; \t"), separator)
        if names and len(names) == width and _are_names(names):
            table.names = names
            table.remarks.append(f"the columns are named by the comment {comments[0]}")
            return
    if width > 6:
        raise InputError(
            f"lines like '{_short(table.rows[-1])}' are no table; give --columns, or export CSV"
        )
    table.names = [f"column {i + 1}" for i in range(width)]
    table.has_header = False
    table.remarks.append(
        f"there is no header; the columns are called {', '.join(table.names)} "
        "(--columns NAME,... names them)"
    )


def _cause(mark: str | None) -> str:
    """What makes more fields of a row than there are columns."""
    return ", as with unquoted decimal or thousands commas" if mark == "," else ""


def _short(row: list[str]) -> str:
    return " ".join(row)[:60]


def _make_equal(table: Table, given: str, mark: str | None) -> None:
    """Fills short rows with empty cells, and leaves out rows with more cells than names."""
    width = len(table.names)
    rows, lines, long = [], [], []
    for row, line in zip(table.rows, table.lines):
        if any(row[width:]):
            has = f"has {counted(len(row), 'field')}; {given} {width}"
            long.append(Problem(line, "", has))
        else:
            rows.append(row)
            lines.append(line)
    if 10 * len(long) > len(table.rows):
        raise InputError(f"{long[0]}{_cause(mark)}")
    table.problems += long
    table.rows, table.lines = [row[:width] + [""] * (width - len(row)) for row in rows], lines
    if short := sum(len(row) < width for row in rows):
        table.remarks.append(
            f"{short} of {len(rows)} rows have fewer cells than the header; the last ones count "
            "as empty"
        )


def _check_commas(table: Table) -> None:
    """Says that numbers have decimal commas, and refuses commas between thousands."""
    decimal = ambiguous = ""
    for name, column in zip(table.names, zip(*table.rows[:2000])):
        if thousands := next(filter(_THOUSANDS.fullmatch, column), None):
            raise InputError(
                f"column {name}: numbers have commas between thousands ({thousands}); remove them"
            )
        numbers = [cell for cell in column if _kind(cell) == "number"]
        commas = [cell for cell in numbers if "," in cell]
        if commas and any("." in cell for cell in numbers):
            raise InputError(f"column {name}: numbers have decimal commas and decimal points")
        if commas and all(re.fullmatch(r"[-+]?[0-9]{1,3},[0-9]{3}", cell) for cell in commas):
            ambiguous = ambiguous or commas[0]
        elif commas:
            decimal = decimal or commas[0]
    if decimal:
        table.remarks.append(f"numbers have decimal commas, as {decimal}")
    elif ambiguous:
        table.doubts.append(
            f"{ambiguous} is read with a decimal comma; if the comma separates thousands, remove it"
        )


def _stated_rate(texts: list[str]) -> float | None:
    """The sample rate [1/s] that a line of the head states."""
    for text in texts:
        match = _RATE.search(text)
        if match and NUMBER.fullmatch(match[1]) and 0 < float(match[1]) < 1e15:
            return float(match[1]) * {"": 1.0, "k": 1e3, "M": 1e6, "G": 1e9}[match[2]]
    return None
