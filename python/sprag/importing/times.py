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
    number,
    seconds_of_unit,
    shown_day_first,
)
from .tables import Problem, Table

Floats = npt.NDArray[np.float64]

# The changes of a level that are impacts: 1 it rises, -1 it falls.
EDGES = {"rising": (1,), "falling": (-1,), "both": (1, -1)}
# Numbers of bits of counters that are recognized when they wrap.
_COUNTERS = (16, 24, 30, 31, 32)
_ASK_UNIT = "say which it is: --unit s, ms, us, ns or a number of seconds"
_DAY = Decimal(86400)


class ArgumentError(ValueError):
    """An argument that is wrong in itself, or does not fit the file or the scene."""


@dataclass(frozen=True)
class Options:
    """How cells become events: times are (time - offset) * unit / rate, levels become edges."""

    unit: str | None = None  # s, ms, us, ns or a number of seconds; None: as the file states it
    offset: str = "0"  # in the file's unit, or as a date or a time of day
    rate: float = 1.0
    counter_bits: int | None = None  # the times are a counter of so many bits that wraps
    day_first: bool | None = None  # of dates with slashes; None: as the dates show it
    any_order: bool = False  # times of single events may go back
    # Of levels.
    time: str | None = None  # column of their times; None: the only one that fits
    threshold: float | None = None  # a level above it is high; None: 0.5, of levels 0 and 1
    inverted: bool = False  # low while the contact is closed
    impacts_at: str | None = None  # one of EDGES: these are impacts; None: contacts close and open
    sample_rate: float | None = None  # of rows without times [1/s]
    # Of contacts, in seconds of the machine.
    debounce: float = 0.0
    pulse_shorter_than: float = 0.0
    duration: float = np.inf

    def __post_init__(self) -> None:
        units = "must be s, ms, us, ns or a number of seconds > 0"
        for problem, holds in {
            f"unit {self.unit} is not allowed; {units}": self.unit is None
            or seconds_of_unit(self.unit),
            "counter_bits must be from 1 to 64": self.counter_bits in (None, *range(1, 65)),
            "rate must be > 0": 0.0 < self.rate < np.inf,
            f'impacts_at is "{self.impacts_at}"; must be "rising", "falling" or "both"': (
                self.impacts_at in (None, *EDGES)
            ),
            "sample_rate must be > 0": self.sample_rate is None or 0.0 < self.sample_rate < np.inf,
            "debounce and pulse_shorter_than must be >= 0": (
                self.debounce >= 0.0 and self.pulse_shorter_than >= 0.0
            ),
        }.items():
            if not holds:
                raise ArgumentError(problem)
        self.origin()

    def origin(self) -> tuple[Decimal, str]:
        """Value and kind of the offset (moment())."""
        try:
            origin = moment(self.offset, self.day_first)
        except ValueError as error:
            raise ArgumentError(f"offset {error} --day-first or --month-first says it") from None
        if origin is None:
            raise ArgumentError(
                f"offset {self.offset} is not allowed; must be a finite number or a time"
            )
        return origin


class TimeReader:
    """Reads the columns of times of a table, which have one unit."""

    def __init__(self, table: Table, names: Sequence[str], options: Options) -> None:
        """`names`: of the columns of times. Raises InputError if their unit is not known."""
        self._table = table
        self._options = options
        self._unit = self._given_unit(names) or self._stated_unit(names)

    def _given_unit(self, names: Sequence[str]) -> Decimal | None:
        given = seconds_of_unit(self._options.unit)
        for name in names if given else ():
            stated = self._table.unit(name)
            if seconds_of_unit(stated) not in (None, given):
                self._table.doubts.append(
                    f"column '{name}' says {stated}; --unit says something else, and counts"
                )
        return given

    def _stated_unit(self, names: Sequence[str]) -> Decimal:
        units = {name: self._table.unit(name) for name in names}
        first = names[0]
        for name, unit in units.items():
            if unit and not seconds_of_unit(unit):
                raise InputError(f"column '{name}' is in {unit}; {_ASK_UNIT}")
            if seconds_of_unit(unit) != seconds_of_unit(units[first]):
                raise InputError(
                    f"columns '{first}' and '{name}' do not say the same unit; {_ASK_UNIT}"
                )
        if stated := seconds_of_unit(units[first]):
            self._table.remarks.append(f"times in {units[first]}, as column '{first}' says")
            return stated
        cells = [cell for name in names for cell in self._table.column(name)]
        plain = [cell for cell in cells if NUMBER.fullmatch(cell)]
        if plain and all(map(INTEGER.fullmatch, plain)):
            largest = max(plain, key=lambda cell: abs(Decimal(cell)))
            if abs(Decimal(largest)) > 1000:
                raise InputError(
                    f"times are integers up to {largest} and no unit is stated; {_ASK_UNIT}"
                )
        if plain:
            self._table.remarks.append("no unit is stated: times are taken as seconds")
        return Decimal(1)

    def seconds(self, name: str, needed: npt.NDArray[np.bool_] | None = None) -> Floats:
        """Times of all cells of a column [s], NaN where there is none.

        `needed`: the rows are those of levels, whose order counts, and times are exact where this
        holds: a capture has many more rows than edges.
        """
        cells, lines = self._table.column(name), self._table.lines
        rows = list(range(len(cells)))
        if needed is not None and not self._options.counter_bits and _ascend(cells):
            rows = np.flatnonzero(needed).tolist()
        t = np.full(len(cells), np.nan)
        single = needed is None
        t[rows] = self._exact(name, [cells[i] for i in rows], [lines[i] for i in rows], single)
        return t

    def _exact(self, name: str, cells: Sequence[str], lines: Sequence[int], single: bool) -> Floats:
        moments = self._moments(name, cells, lines)
        kinds = {of[1] for of in moments if of}
        values = [of[0] if of else None for of in moments]
        start = self._start(name, kinds)
        if kinds == {"minutes"} and not re.search("[.,]", "".join(cells)):
            first = next(filter(None, cells))
            self._table.doubts.append(f"column {name}: {first} is read as minutes:seconds")
        if "clock" in kinds:
            values = _continued(
                values, _DAY, start if self._options.origin()[1] == "clock" else None
            )
        if kinds == {"number"} and (bits := self._options.counter_bits):
            for value in values:
                if value is not None and not 0 <= value < 2**bits:
                    raise InputError(f"{value} is no count of a counter of {bits} bits")
            values = _continued(values, Decimal(2**bits), start)
        self._check_order(name, cells, lines, values, kinds, single)
        unit = self._unit if kinds <= {"number"} else Decimal(1)
        seconds = [
            np.nan if value is None else float(EXACT.multiply(EXACT.subtract(value, start), unit))
            for value in values
        ]
        return np.array(seconds, float) / self._options.rate

    def _moments(
        self, name: str, cells: Sequence[str], lines: Sequence[int]
    ) -> list[tuple[Decimal, str] | None]:
        day_first = self._options.day_first
        if day_first is None:
            day_first = shown_day_first(cells)
        moments, bad = [], []
        for cell, line in zip(cells, lines):
            try:
                moments.append(moment(cell, day_first) if cell else None)
            except ValueError as error:
                raise InputError(f"{line}: {error} --day-first or --month-first says it") from None
            if cell and moments[-1] is None:
                bad.append(Problem(line, name, f"{cell} is neither a finite number nor a time"))
        if bad and not any(moments):
            cell = bad[0].what.split(" is neither")[0]
            raise InputError(
                f"{bad[0].line}: column {name} has no times: '{cell}' is none. "
                f"Times are {TIME_FORMS}"
            )
        self._table.problems += bad
        return moments

    def _start(self, name: str, kinds: set[str]) -> Decimal:
        """The offset on the clock of the column. Raises InputError if it is on another one."""
        start, of_start = self._options.origin()
        if len(kinds) > 1 and kinds != {"minutes", "clock"}:
            raise InputError(
                f"column {name} has times of different kinds: {', '.join(sorted(kinds))}"
            )
        self._table.of_clock |= bool(kinds & {"clock", "date"})
        problem = ""
        if "date" in kinds and of_start != "date":
            problem = "dates; give --offset with the date and time at t = 0"
        elif "clock" in kinds and of_start == "minutes":
            raise InputError(
                f"--offset {self._options.offset} has no seconds, and the times have hours; "
                "give it as 12:34:00"
            )
        elif kinds & {"clock", "minutes"} and (
            of_start == "date" or (of_start == "clock" and "clock" not in kinds)
        ):
            problem = f"no times like --offset {self._options.offset}"
        elif kinds == {"number"} and of_start in ("date", "clock", "minutes"):
            problem = f"numbers; --offset must be one, too, not {self._options.offset}"
        if problem:
            raise InputError(f"column {name} has {problem}")
        in_unit = kinds == {"unit"} and of_start == "number"
        return EXACT.multiply(start, self._unit) if in_unit else start

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
        known = [(value, i) for i, value in enumerate(values) if value is not None]
        for (last, before), (value, i) in zip(known, known[1:]):
            if value >= last:
                continue
            what = f"column {name}: time goes back from {cells[before]} to {cells[i]}"
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
            if single and self._options.any_order:
                self._table.doubts.append(f"{what} in line {lines[i]}; sorted")
                return
            remedy = "; --any-order sorts the times of a column" if single else ""
            raise InputError(f"{lines[i]}: {what}; import each run alone after a restart{remedy}")


def numbers(cells: Sequence[str]) -> Floats:
    """The numbers in cells, NaN where there is none."""
    read = [number(cell) if NUMBER.fullmatch(cell) else None for cell in cells]
    return np.array([np.nan if value is None else float(value) for value in read], float)


def _ascend(cells: Sequence[str]) -> bool:
    """Whether all cells are finite numbers in ascending order, as numpy reads them."""
    try:
        t = np.array(cells, float) if "_" not in "".join(cells[:1]) else np.array([np.nan])
    except ValueError:
        return False
    return bool(np.isfinite(t).all() and (np.diff(t) >= 0.0).all())


def _continued(
    values: list[Decimal | None], period: Decimal, start: Decimal | None
) -> list[Decimal | None]:
    """Adds a period where a value is more than half of one below the value before it."""
    laps, last = Decimal(0), start
    result = []
    for value in values:
        if value is not None:
            if last is not None and value + laps < last - period / 2:
                laps += period
            last = value = value + laps
        result.append(value)
    return result


def _wrapped_at(last: Decimal, value: Decimal) -> int | None:
    sizes = [(bits, Decimal(2**bits)) for bits in _COUNTERS]
    near = (bits for bits, size in sizes if last / size > Decimal("0.95") and value < size / 2)
    return next((bits for bits in near if last < 2**bits), None)


def time_column(table: Table, options: Options) -> str | None:
    """The column with the times of the levels: the given one, or the only one that fits.

    None with a sample rate.
    """
    if options.sample_rate:
        return None
    if options.time:
        table.column(options.time)
        return options.time
    named = (
        [name for name in table.names if re.match(r"(time|zeit|temps|tiempo)", name, re.I)]
        or [name for name in table.names if re.fullmatch(r"t|x_value|x-axis|in s", name, re.I)]
        or [name for name in table.names if table.unit(name)]
    )
    if len(named) == 1:
        if not named[0].casefold().startswith("time"):
            table.remarks.append(f"times are in column '{named[0]}'")
        return named[0]
    rate = ""
    if table.sample_rate and not named:
        rate = f" or --sample-rate {table.sample_rate:g}, as the file says"
    raise InputError(
        ("several columns may have the times" if named else "no column seems to have the times")
        + f"; say which has the times: --time NAME{rate}. The columns are {table.listed()}"
    )


def sample_times(
    table: Table, time: str | None, options: Options, needed: npt.NDArray[np.bool_]
) -> Floats:
    """Times of all rows [s] as TimeReader.seconds().

    `time`: their column, as time_column() finds it; None with a sample rate.
    """
    if time is None:
        assert options.sample_rate
        return np.arange(len(table.rows)) / (options.sample_rate * options.rate)
    return TimeReader(table, [time], options).seconds(time, needed)


def read_signal(table: Table, name: str, options: Options) -> tuple[Floats, Floats]:
    """Times [s] and values, in the column's unit, of all rows. Raises InputError for a gap."""
    cells = table.column(name)
    time = time_column(table, options)
    if time == name:
        raise InputError(f"the column '{name}' is the time; the signal must be another")
    t = sample_times(table, time, options, np.ones(len(cells), bool))
    values = numbers(cells)
    gap = "a gap in a record cannot be interpolated"
    for what, of in ("value", values), ("time", t):
        if len(at := np.flatnonzero(np.isnan(of))):
            cell = f" ({cells[at[0]]!r})" if cells[at[0]] else ""
            raise InputError(f"{table.lines[at[0]]}: a sample has no {what}{cell}; {gap}")
    if table.problems:
        raise InputError(f"{table.problems[0]}; {gap}")
    return t, values
