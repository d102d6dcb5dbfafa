"""Tables as devices, spreadsheets and loggers write them.

read_table() returns the cells as texts, so that no digit is lost, each row with its line. Most
files need no options: the last rows show what a row looks like. The separator is the one by which
the rows are alike and the header has as many cells; the data begin at the first such row; the
names, and a
row of units if there is one, are just above.
"""

from __future__ import annotations

import csv
import difflib
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

from .._errors import InputError
from .moments import LEVEL_WORDS, NUMBER, is_moment, unit_in_name, unit_of_cell

SEPARATORS: dict[str, str | None] = {"semicolon": ";", "tab": "\t", "comma": ",", "blank": None}
_UNSPLIT_DECIMALS = ", as with unquoted decimal or thousands commas"


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
    rows: list[list[str]]
    lines: list[int]  # of each row in the file, from 1
    units: dict[str, str] = field(default_factory=dict)  # by a column's name, as a row states them
    remarks: list[str] = field(default_factory=list)  # what the reader guessed or left out
    doubts: list[str] = field(default_factory=list)  # guesses that may be wrong
    problems: list[Problem] = field(default_factory=list)
    sample_rate: float | None = None  # of a file without times, as its head states it [1/s]
    has_header: bool = True

    def column(self, name: str) -> list[str]:
        """The cells of the column of this name. Raises InputError with the names there are."""
        exact = [i for i, other in enumerate(self.names) if other == name]
        near = exact or [i for i, n in enumerate(self.names) if n.casefold() == name.casefold()]
        if len(near) == 1:
            return [row[near[0]] for row in self.rows]
        listed = ", ".join(f"'{other}'" for other in self.names)
        if near:
            raise InputError(
                f"there is more than one column '{name}'; the columns are {listed}; "
                "--columns NAME,... gives them other names"
            )
        alike = difflib.get_close_matches(name, self.names, 1)
        meant = f" (did you mean '{alike[0]}'?)" if alike else ""
        headless = (
            "" if self.has_header else "; the file has no header: --columns NAME,... names them"
        )
        raise InputError(f"there is no column '{name}'{meant}; the columns are {listed}{headless}")

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
    every = list(enumerate(_lines(text), 1))[skip_lines:]
    comments = [line for _, line in every if _is_comment(line)]
    numbered = [(i, line) for i, line in every if line.strip(" \t;,") and not _is_comment(line)]
    if not numbered:
        raise InputError("there is no header and no row")
    mark = SEPARATORS[separator] if separator else _separator([x for _, x in numbered], names)
    most = len(names) - 1 if names else -1
    problems, rows, lines = [], [], []
    for line_number, line in numbered:
        row = _split(line, mark, most)
        if row is None:
            problems.append(Problem(line_number, "", "a quote is not closed"))
        else:
            rows.append(row)
            lines.append(line_number)
    if not rows:
        raise InputError(f"{numbered[0][0]}: a quote is not closed")
    usual = _usual(_last(rows))
    begin = _begin_of_data(rows, usual)
    if begin is None:
        raise InputError("has no rows of numbers or times in columns")
    table = Table([], rows[begin:], lines[begin:], problems=problems)
    before = [line for number, line in every if number < lines[begin] and _is_comment(line)]
    _name_columns(table, rows[:begin], lines, usual, names, mark, before[-1:])
    _make_equal(table, names is not None, mark)
    _check_commas(table)
    table.sample_rate = _stated_rate(comments + [",".join(row) for row in rows[:begin]])
    return table


def _lines(text: str) -> list[str]:
    if "\n" in text:
        return [line.removesuffix("\r") for line in text.split("\n")]
    return text.split("\r")


def _is_comment(line: str) -> bool:
    bare = line.strip()
    if bare.startswith(("#", "%", "//", "\\")):
        return True
    return bool(re.match(r";\s*[^\W\d]", bare)) and ";" not in bare[1:]


def _split(line: str, separator: str | None, most: int = -1) -> list[str] | None:
    """The cells of a line; by blanks at most `most` times. None: a quote is not closed."""
    if separator is None:
        return line.split(None, most)
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    try:
        return [
            cell.strip()
            for cell in next(
                csv.reader([line], delimiter=separator, skipinitialspace=True, strict=True)
            )
        ]
    except (csv.Error, StopIteration):
        # A blank after a closing quote is harmless, an open quote is not.
        if line.count('"') % 2:
            return None
        return [
            cell.strip()
            for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True))
        ]


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


def _usual(rows: list[list[str]]) -> list[str]:
    """The kind of each column's cells in rows of the usual width; in a tie a number or a time."""
    width = Counter(len(row) for row in reversed(rows)).most_common(1)[0][0]
    columns = zip(*(row for row in rows if len(row) == width))
    return [_usual_kind([_kind(cell) for cell in column]) for column in columns]


def _usual_kind(kinds: list[str]) -> str:
    counts = Counter(kinds)
    return max(counts, key=lambda kind: (counts[kind], kind in ("number", "moment")))


def _last(rows: list[list[str]]) -> list[list[str]]:
    """Rows at the end, which are past the head even of a short file."""
    return rows[-min(400, max(3, len(rows) // 4)) :]


def _fits(row: list[str], usual: list[str]) -> bool:
    """Whether a row is like the usual one: each cell is empty or of the column's kind."""
    kinds = [_kind(cell) for cell in row]
    return (
        len(row) <= len(usual)
        and any(kind in ("number", "moment") for kind in kinds)
        and all(
            kind == "" or of == "" or kind == of or (kind == "word" and of == "text")
            for kind, of in zip(kinds, usual)
        )
    )


def _begin_of_data(rows: list[list[str]], usual: list[str]) -> int | None:
    """The first row of full width that fits, if most of the next ones do as well."""
    for i, row in enumerate(rows):
        if len(row) == len(usual) and _fits(row, usual):
            following = [_fits(other, usual) for other in rows[i : i + 4]]
            if 2 * sum(following) >= len(following):
                while i > 0 and _fits(rows[i - 1], usual):
                    i -= 1
                return i
    return None


def _judge(
    lines: list[str], separator: str | None, names: Sequence[str] | None
) -> tuple[bool, float, int]:
    """How well a separator divides the lines: the header agrees, share of like rows, columns."""
    most = len(names) - 1 if names else -1
    split = [row for line in lines if (row := _split(line, separator, most))]
    usual = _usual(_last(split)) if split else []
    if not any(kind in ("number", "moment") for kind in usual):
        return False, 0.0, 0
    rows = split[:400]
    begin = _begin_of_data(rows, usual)
    begin = len(rows) if begin is None else begin
    header = len(names) if names else len(rows[begin - 1]) if begin > 0 else len(usual)
    alike = sum(_fits(row, usual) for row in rows[begin:]) / max(1, len(rows) - begin)
    return len(usual) <= header <= len(usual) + 2, round(alike, 1), len(usual)


def _separator(lines: list[str], names: Sequence[str] | None) -> str | None:
    """The separator of the lines. In doubt the one of fewer columns: commas may be decimal."""
    sample = lines[:400] + lines[400:][-400:]
    scores = {mark: _judge(sample, mark, names) for mark in SEPARATORS.values()}
    best = max(score[:2] for score in scores.values())
    good = [mark for mark, score in scores.items() if score[:2] == best]
    if names:
        wanted = len(names)
        return max(good, key=lambda mark: (scores[mark][2] == wanted, mark is not None))
    several = [mark for mark in good if scores[mark][2] > 1]
    single = [mark for mark in good if scores[mark][2] == 1 and mark != ","]
    if several == [","] and single and all(_kind(c) for c in _split(lines[0], ",") or [""]):
        if _fits(
            _split(lines[0], ",") or [], _usual(_last([_split(x, ",") or [] for x in sample]))
        ):
            raise InputError(
                f"'{lines[-1].strip()}' is one column with decimal commas or several; "
                "give --separator or --columns"
            )
    order = list(SEPARATORS.values())
    return min(several, key=order.index) if several else "\t"


def _are_names(row: list[str]) -> bool:
    """Texts, or whole numbers after a first text, as in x-axis,1."""
    kinds = [_kind(cell) for cell in row]
    if not any(row):
        return False
    if all(kind in ("text", "", "word") for kind in kinds):
        return True
    return kinds[0] == "text" and all(
        kind in ("text", "", "word") or cell.isdigit() for kind, cell in zip(kinds, row)
    )


def _header(head: list[list[str]], width: int) -> tuple[list[str] | None, list[str] | None]:
    """Names and units in the rows just before the data."""
    last = head[-1] if head else []
    if not (_are_names(last) and width <= len(last) <= width + 2):
        return None, None
    above = head[-2] if len(head) > 1 else []
    units = [unit_of_cell(cell) for cell in last]
    if len(above) == len(last) and _are_names(above):
        stated = [unit for unit in units if unit is not None]
        if len(stated) == len(units):
            return above, stated
    return last, None


def _name_columns(
    table: Table,
    head: list[list[str]],
    lines: list[int],
    usual: list[str],
    names: Sequence[str] | None,
    mark: str | None,
    comment: list[str],
) -> None:
    """Sets the names and units of the columns, and says which rows of the head are not used.

    `comment`: the last line before the rows that is one, which numpy.savetxt writes as the header.
    """
    if names:
        if len(usual) > len(names):
            raise InputError(
                f"{table.lines[0]}: has {_counted(len(usual), 'field')}; --columns names "
                f"{_counted(len(names), 'column')}"
            )
        table.names = list(names)
        if head:
            table.remarks.append(
                f"line {lines[len(head) - 1]} is not used, since --columns names the columns: "
                f"'{_short(head[-1])}'"
            )
        return
    found, units = _header(head, len(usual))
    if found is None and head and len(head[-1]) != len(usual) and _are_names(head[-1]):
        raise InputError(
            f"{table.lines[0]}: has {_counted(len(usual), 'field')}; the header has "
            f"{len(head[-1])}" + (_UNSPLIT_DECIMALS if mark == "," else "")
        )
    if any(row and row[0].casefold() == "sequence" for row in head):
        raise InputError(
            "X is the number of the sample; its start and increment are in line 2. Save times, "
            "or multiply"
        )
    if found and units:
        table.units = {name: unit for name, unit in zip(found, units) if unit}
        stated = ", ".join(f"{name} in {unit}" for name, unit in table.units.items())
        table.remarks.append(f"row of units: {stated}")
    used = 0 if found is None else 2 if units else 1
    if len(head) > used:
        table.remarks.append(
            f"{_counted(len(head) - used, 'line')} before the "
            f"{'header' if found else 'numbers'} left out, the last one: "
            f"'{_short(head[len(head) - used - 1])}'"
        )
    if found is None and comment:
        found = _names_in_comment(comment[0], len(usual))
        if found:
            table.remarks.append(f"the columns are named by the comment {comment[0].strip()}")
    if found is None:
        found = [f"column {i + 1}" for i in range(len(usual))]
        table.has_header = False
        if len(found) > 6:
            raise InputError(
                f"lines like '{_short(table.rows[-1])}' are no table; give --columns, or export CSV"
            )
        table.remarks.append(
            f"there is no header; the columns are called {', '.join(found)} "
            "(--columns NAME,... names them)"
        )
    table.names = found


def _names_in_comment(comment: str, width: int) -> list[str] | None:
    for mark in SEPARATORS.values():
        names = _split(comment.strip().lstrip("#%/\\; \t"), mark)
        if names and len(names) == width and _are_names(names):
            return names
    return None


def _short(row: list[str]) -> str:
    return " ".join(row)[:60]


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _make_equal(table: Table, named: bool, mark: str | None) -> None:
    """Fills short rows with empty cells, and leaves out rows with more cells than names."""
    width = len(table.names)
    rows, lines, long = [], [], []
    short = 0
    for row, line in zip(table.rows, table.lines):
        if len(row) > width and any(row[width:]):
            has = f"has {_counted(len(row), 'field')}; {'--columns' if named else 'the header'} has"
            long.append(Problem(line, "", f"{has} {width}"))
            continue
        short += len(row) < width
        rows.append(row[:width] + [""] * (width - len(row)))
        lines.append(line)
    if 10 * len(long) > len(table.rows):
        raise InputError(f"{long[0]}" + (_UNSPLIT_DECIMALS if mark == "," else ""))
    table.rows, table.lines = rows, lines
    table.problems += long
    if short:
        table.remarks.append(
            f"{short} of {len(rows)} rows have fewer cells than the header; the last ones count "
            "as empty"
        )


def _check_commas(table: Table) -> None:
    """Says that numbers have decimal commas, and refuses commas between thousands."""
    decimal = ambiguous = ""
    for name, column in zip(table.names, zip(*table.rows[:2000])):
        cells = [cell for cell in column if cell]
        commas = [cell for cell in cells if "," in cell and _kind(cell) == "number"]
        for cell in cells:
            if re.fullmatch(r"[-+]?[0-9]{1,3}(,[0-9]{3}){2,}(\.[0-9]*)?", cell) or (
                re.fullmatch(r"[-+]?[0-9]{1,3}(,[0-9]{3})+\.[0-9]*", cell)
            ):
                raise InputError(
                    f"column {name}: numbers have commas between thousands ({cell}); remove them"
                )
        if not commas:
            continue
        if any("." in cell for cell in cells if _kind(cell) == "number"):
            raise InputError(f"column {name}: numbers have decimal commas and decimal points")
        if all(re.fullmatch(r"[-+]?[0-9]{1,3},[0-9]{3}", cell) for cell in commas):
            ambiguous = ambiguous or commas[0]
        else:
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
        match = re.search(
            r"sample\s*rate\D{0,4}?[:,=\s]\s*([0-9.]+(?:e[+-]?[0-9]+)?)\s*([kMG]?)", text, re.I
        )
        if match and NUMBER.fullmatch(match[1]) and 0 < float(match[1]) < 1e15:
            return float(match[1]) * {"": 1.0, "k": 1e3, "M": 1e6, "G": 1e9}[match[2]]
    return None
