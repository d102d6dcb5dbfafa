"""Columns of times in seconds of the machine."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal

import numpy as np
import numpy.typing as npt

from .._errors import InputError
from .moments import (
    EXACT,
    INTEGER,
    NUMBER,
    TIME_FORMS,
    moment,
    seconds_of_unit,
    shown_day_first,
)
from .tables import Problem, Table

Floats = npt.NDArray[np.float64]

# Numbers of bits of counters that are recognized when they wrap.
_COUNTERS = (16, 24, 30, 31, 32)
_ASK_UNIT = "say which it is: --unit s, ms, us, ns or a number of seconds"


class ArgumentError(ValueError):
    """An argument that is wrong in itself, or does not fit the file or the scene."""


@dataclass(frozen=True)
class Clock:
    """How a file's times become those of the machine: (time - offset) * unit / rate."""

    unit: str | None = None  # s, ms, us, ns or a number of seconds; None: as the file states it
    offset: str = "0"  # in the file's unit, or as a date or a time of day
    rate: float = 1.0
    counter_bits: int | None = None  # the times are a counter of so many bits that wraps
    day_first: bool | None = None  # of dates with slashes; None: as the dates show it
    any_order: bool = False  # times of single events may go back

    def __post_init__(self) -> None:
        if self.unit is not None and seconds_of_unit(self.unit) is None:
            raise ArgumentError(
                f"unit {self.unit} is not allowed; must be s, ms, us, ns or a number of seconds > 0"
            )
        if self.counter_bits is not None and not 1 <= self.counter_bits <= 64:
            raise ArgumentError("counter_bits must be from 1 to 64")
        if not (self.rate > 0.0 and np.isfinite(self.rate)):
            raise ArgumentError("rate must be > 0")
        try:
            self.origin()
        except ValueError as error:
            raise ArgumentError(f"offset {error}; day_first or month first decides") from None

    def origin(self) -> tuple[Decimal, str]:
        """Value and kind of the offset (moment())."""
        origin = moment(self.offset, self.day_first)
        if origin is None:
            raise ArgumentError(
                f"offset {self.offset} is not allowed; must be a finite number or a time"
            )
        return origin


class TimeReader:
    """Reads the columns of times of a table, which have one unit."""

    def __init__(self, table: Table, names: Sequence[str], clock: Clock) -> None:
        """`names`: of the columns of times. Raises InputError if their unit is not known."""
        self._table = table
        self._clock = clock
        self._unit = self._unit_of(names)
        self.of_clock = False  # some times are dates or times of day

    def _unit_of(self, names: Sequence[str]) -> Decimal:
        """Seconds of the file's unit."""
        stated = {name: self._table.unit(name) for name in names}
        given = self._clock.unit and seconds_of_unit(self._clock.unit)
        if given:
            for name, unit in stated.items():
                if unit and (seconds := seconds_of_unit(unit)) and seconds != given:
                    self._table.doubts.append(
                        f"column '{name}' says {unit}; --unit says something else, and counts"
                    )
            return given
        first = names[0]
        unit = stated[first]
        for name, other in stated.items():
            if other and seconds_of_unit(other) is None:
                raise InputError(f"column '{name}' is in {other}; {_ASK_UNIT}")
            if _length(other) != _length(unit):
                raise InputError(
                    f"columns '{first}' and '{name}' do not say the same unit; {_ASK_UNIT}"
                )
        if unit:
            self._table.remarks.append(f"times in {unit}, as column '{first}' says")
            return _length(unit) or Decimal(1)
        self._guess_seconds(names)
        return Decimal(1)

    def _guess_seconds(self, names: Sequence[str]) -> None:
        numbers = [
            cell for name in names for cell in self._table.column(name) if NUMBER.fullmatch(cell)
        ]
        if not numbers:
            return
        if all(INTEGER.fullmatch(cell) for cell in numbers):
            largest = max(numbers, key=lambda cell: abs(Decimal(cell)))
            if abs(Decimal(largest)) > 1000:
                raise InputError(
                    f"times are integers up to {largest} and no unit is stated; {_ASK_UNIT}"
                )
        self._table.remarks.append("no unit is stated: times are taken as seconds")

    def seconds(self, name: str) -> Floats:
        """Times of all cells of a column [s], NaN where there is none."""
        return self._exact(name, self._table.column(name), self._table.lines, True)

    def seconds_of_levels(self, name: str, needed: npt.NDArray[np.bool_]) -> Floats:
        """The same of a column whose times must not go back.

        Exact only where `needed`, since a capture has many more rows than edges.
        """
        cells = self._table.column(name)
        if self._clock.counter_bits is None:
            t = _as_floats(cells)
            if t is not None and (np.diff(t) >= 0.0).all():
                at = np.flatnonzero(needed)
                lines = [self._table.lines[i] for i in at]
                exact = self._exact(name, [cells[i] for i in at], lines, False)
                t[:] = np.nan
                t[at] = exact
                return t
        return self._exact(name, cells, self._table.lines, False)

    def _exact(self, name: str, cells: Sequence[str], lines: Sequence[int], single: bool) -> Floats:
        moments = self._moments(name, cells, lines)
        kinds = {kind for of in moments if of for kind in (of[1],)}
        start, values = self._on_one_clock(name, moments, kinds)
        if kinds and kinds <= {"number"} and self._clock.counter_bits:
            values = _unwrapped(values, self._clock.counter_bits, start)
        self._check_order(name, cells, lines, values, kinds, single)
        unit = self._unit if kinds <= {"number"} else Decimal(1)
        return np.array(
            [
                np.nan
                if value is None
                else float(EXACT.multiply(EXACT.subtract(value, start), unit)) / self._clock.rate
                for value in values
            ],
            float,
        )

    def _moments(
        self, name: str, cells: Sequence[str], lines: Sequence[int]
    ) -> list[tuple[Decimal, str] | None]:
        day_first = self._clock.day_first
        if day_first is None:
            day_first = shown_day_first(cells)
        moments = []
        bad = []
        for cell, line in zip(cells, lines):
            try:
                read = moment(cell, day_first) if cell else None
            except ValueError as error:
                raise InputError(f"{line}: {error} --day-first or --month-first says it") from None
            if cell and read is None:
                bad.append((cell, line))
            moments.append(read)
        if bad and not any(moments):
            raise InputError(
                f"{bad[0][1]}: column {name} has no times: '{bad[0][0]}' is none. "
                f"Times are {TIME_FORMS}"
            )
        self._table.problems += [
            Problem(line, name, f"{cell} is neither a finite number nor a time")
            for cell, line in bad
        ]
        return moments

    def _on_one_clock(
        self, name: str, moments: list[tuple[Decimal, str] | None], kinds: set[str]
    ) -> tuple[Decimal, list[Decimal | None]]:
        """The offset, and all times relative to the same zero."""
        origin, of_origin = self._clock.origin()
        if len(kinds) > 1 and kinds != {"minutes", "clock"}:
            raise InputError(
                f"column {name} has times of different kinds: {', '.join(sorted(kinds))}"
            )
        values = [of[0] if of else None for of in moments]
        self.of_clock = self.of_clock or bool(kinds & {"clock", "date"})
        if "date" in kinds and of_origin != "date":
            raise InputError(
                f"column {name} has dates; give --offset with the date and time at t = 0"
            )
        if kinds & {"clock", "minutes"}:
            if of_origin == "minutes" and "clock" in kinds:
                raise InputError(
                    f"--offset {self._clock.offset} has no seconds, and the times have hours; "
                    "give it as 12:34:00"
                )
            if of_origin == "date" or (of_origin == "clock" and "clock" not in kinds):
                raise InputError(f"column {name} has no times like --offset {self._clock.offset}")
        if kinds <= {"number"} and of_origin in ("date", "clock", "minutes") and kinds:
            raise InputError(
                f"column {name} has numbers; --offset must be one, too, not {self._clock.offset}"
            )
        if "clock" in kinds:
            values = _past_midnight(values, origin if of_origin == "clock" else None)
        if kinds == {"unit"} and of_origin == "number":
            origin = EXACT.multiply(origin, self._unit)
        return origin, values

    def _check_order(
        self,
        name: str,
        cells: Sequence[str],
        lines: Sequence[int],
        values: list[Decimal | None],
        kinds: set[str],
        single: bool,
    ) -> None:
        """Refuses times that go back: sorting would hide wraps, restarts and misprints."""
        last, at = None, 0
        for i, value in enumerate(values):
            if value is None:
                continue
            if last is None or value >= last:
                last, at = value, i
                continue
            what = f"column {name}: time goes back from {cells[at]} to {cells[i]}"
            if kinds == {"number"} and (bits := _wrapped_at(last, value)):
                raise InputError(
                    f"{lines[i]}: {what}, as of a counter of {bits} bits that wraps; "
                    f"--counter-bits {bits} continues it"
                )
            digits = {len(cell.partition(".")[2]) for cell in cells if "." in cell}
            if kinds == {"number"} and len(digits) > 1 and max(digits) in (6, 9):
                what += (
                    f"; fractions have {min(digits)} to {max(digits)} digits: are they printed "
                    "without leading zeros?"
                )
            if single and self._clock.any_order:
                self._table.doubts.append(f"{what} in line {lines[i]}; sorted")
                return
            remedy = "import each run alone after a restart"
            if single:
                remedy += "; --any-order sorts the times of a column"
            raise InputError(f"{lines[i]}: {what}; {remedy}")


def _length(unit: str | None) -> Decimal | None:
    return seconds_of_unit(unit) if unit else None


def _as_floats(cells: Sequence[str]) -> Floats | None:
    if any("_" in cell for cell in cells[:1]):
        return None
    try:
        t = np.array(cells, float)
    except ValueError:
        return None
    return t if np.isfinite(t).all() else None


def _past_midnight(values: list[Decimal | None], start: Decimal | None) -> list[Decimal | None]:
    """Adds a day where a time of day is more than half a day before the one before it."""
    day, last = Decimal(0), start
    result: list[Decimal | None] = []
    for value in values:
        if value is not None:
            if last is not None and value + day < last - 43200:
                day += 86400
            last = value + day
        result.append(None if value is None else value + day)
    return result


def _unwrapped(values: list[Decimal | None], bits: int, start: Decimal) -> list[Decimal | None]:
    """Continues a counter past its wraps: steps back by more than half of its range."""
    size = Decimal(2) ** bits
    lap, last = Decimal(0), start
    result: list[Decimal | None] = []
    for value in values:
        if value is not None:
            if not 0 <= value < size:
                raise InputError(f"{value} is no count of a counter of {bits} bits")
            if value + lap < last - size / 2:
                lap += size
            last = value + lap
        result.append(None if value is None else value + lap)
    return result


def _wrapped_at(last: Decimal, value: Decimal) -> int | None:
    for bits in _COUNTERS:
        size = Decimal(2) ** bits
        if last > size * Decimal("0.95") and last < size and value < size / 2:
            return bits
    return None


def time_column(table: Table, given: str | None) -> str:
    """Name of the column with the times of the levels: the given one, or the only that fits."""
    if given:
        table.column(given)
        return given
    named = [name for name in table.names if re.match(r"(time|zeit|temps|tiempo)", name, re.I)]
    if not named:
        named = [name for name in table.names if re.fullmatch(r"t|x_value|x-axis|in s", name, re.I)]
    if not named:
        named = [name for name in table.names if table.unit(name)]
    if len(named) == 1:
        if not named[0].casefold().startswith("time"):
            table.remarks.append(f"times are in column '{named[0]}'")
        return named[0]
    listed = ", ".join(f"'{name}'" for name in table.names)
    rate = ""
    if table.sample_rate and not named:
        rate = f" or --sample-rate {table.sample_rate:g}, as the file says"
    raise InputError(
        ("several columns may have the times" if named else "no column seems to have the times")
        + f"; say which has the times: --time NAME{rate}. The columns are {listed}"
    )
