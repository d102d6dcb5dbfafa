"""Numbers, times and units as people and devices write them, without loss of a digit."""

from __future__ import annotations

import datetime
import re
from collections.abc import Iterable
from decimal import Context, Decimal

EXACT = Context(prec=60)
_DAYS_UNTIL_1970 = datetime.date(1970, 1, 1).toordinal()
NUMBER = re.compile(r"[-+]?([0-9]+[.,]?[0-9]*|[.,][0-9]+)([eE][-+]?[0-9]{1,4})?")
INTEGER = re.compile(r"[-+]?[0-9]+")
WITH_UNIT = re.compile(rf"(?P<number>{NUMBER.pattern})\s*(?P<unit>[a-zA-Zµμ]+)")
CLOCK = re.compile(
    r"(?:(?P<hours>[0-9]{1,2}):)?(?P<minutes>[0-9]{1,2}):(?P<seconds>[0-9]{2}(?:[.,][0-9]{1,18})?)"
    r"(?:\s*(?P<half>[AaPp])\.?[Mm]\.?)?"
)
DATE = re.compile(
    r"(?:(?P<year>[0-9]{4})[-/](?P<month>[0-9]{1,2})[-/](?P<day>[0-9]{1,2})"
    r"|(?P<first>[0-9]{1,2})(?P<mark>[./])(?P<second>[0-9]{1,2})[./](?P<last>[0-9]{4}))"
    r"[T ,]+(?P<clock>.+?)\s*(?P<zone>Z|[-+][0-9]{2}(?::?[0-9]{2})?)?"
)
TIME_FORMS = (
    "numbers, 12.5 ms, 34:56.7, 12:34:56.7, 2024-05-03T12:34:56.7Z and 03.05.2024 12:34:56,7"
)

_LOW = "off false low falling open opens released 0 l no falling_edge"
_HIGH = "on true high rising closed closes pressed 1 h yes rising_edge"
LEVEL_WORDS = {word: high for high, words in enumerate((_LOW, _HIGH)) for word in words.split()}

_UNITS = {
    "1": "s sec second seconds sekunde sekunden",
    "1e-3": "ms msec millisecond milliseconds",
    "1e-6": "us usec µs μs microsecond microseconds",
    "1e-9": "ns nsec nanosecond nanoseconds",
    "1e-12": "ps",
    "1e-15": "fs",
}
TIME_UNITS = {word: Decimal(scale) for scale, words in _UNITS.items() for word in words.split()}
# Units of time that name no number of seconds that all readers agree on.
_WITHOUT_SECONDS = frozenset(
    "min minutes h hours d days ticks counts samples cycles frames".split()
)
_OTHER_UNITS = frozenset(
    "v mv volt volts a ma g m/s² m/s^2 m/s2 pa n mm m db % deg °c c unitless logic kn".split()
)


def is_time_unit(text: str) -> bool:
    """Whether `text` is a unit of time, also one whose length in seconds is unknown."""
    return _time_unit(text) is not None or text.casefold() in _WITHOUT_SECONDS


def _time_unit(text: str) -> Decimal | None:
    found = TIME_UNITS.get(text)
    return TIME_UNITS.get(text.casefold()) if found is None else found


def unit_of_cell(cell: str) -> str | None:
    """The unit in a cell of a row of units: (ms), [V], Volt. "": none is stated; None: no unit."""
    bare = cell.strip("()[] ")
    known = not bare or is_time_unit(bare) or bare.casefold() in _OTHER_UNITS
    return bare if known or re.fullmatch(r"\(.*\)|\[.*\]", cell) else None


def unit_in_name(name: str) -> str | None:
    """The unit of time in a column's name: "Time [ms]", "t (s)", "in us", "t / ns", "on_ms"."""
    candidates = re.findall(r"[\[(]([^\])]*)[\])]", name)
    if ending := re.search(r"(?:\bin |/|_)\s*([^\s/_]+)\s*$", name):
        candidates.append(ending[1])
    if len(name) > 2:  # Second; but not a column that is called s or h
        candidates.append(name)
    return next((unit.strip() for unit in candidates if is_time_unit(unit.strip())), None)


def seconds_of_unit(unit: str | None) -> Decimal | None:
    """Seconds of a unit or of a number of seconds > 0; None for any other text."""
    if unit is None:
        return None
    if (known := _time_unit(unit)) is not None:
        return known
    value = number(unit) if NUMBER.fullmatch(unit) and "," not in unit else None
    return value if value is not None and value > 0 else None


def number(cell: str) -> Decimal | None:
    """The number of a cell that matches NUMBER; None if it is beyond 10^300."""
    value = Decimal(cell.replace(",", "."))
    return value if abs(value.adjusted()) <= 300 or not value else None


def is_moment(cell: str) -> bool:
    """Whether the cell is a time other than a plain number."""
    if CLOCK.fullmatch(cell) or DATE.fullmatch(cell):
        return True
    with_unit = WITH_UNIT.fullmatch(cell)
    return with_unit is not None and _time_unit(with_unit["unit"]) is not None


def moment(cell: str, day_first: bool | None = None) -> tuple[Decimal, str] | None:
    """Value and kind of a time; None: the cell is none.

    Kinds: "number" (in the file's unit), "unit" (seconds, by the unit in the cell), "minutes" and
    "clock" (seconds since the hour or midnight), "date" (seconds since 1970, UTC without a zone).
    Raises ValueError for a date that needs `day_first`.
    """
    if NUMBER.fullmatch(cell):
        value = number(cell)
        return None if value is None else (value, "number")
    if with_unit := WITH_UNIT.fullmatch(cell):
        scale, value = _time_unit(with_unit["unit"]), number(with_unit["number"])
        return None if scale is None or value is None else (EXACT.multiply(value, scale), "unit")
    if clock := _clock(cell):
        return clock
    date = DATE.fullmatch(cell)
    return _date(cell, date, day_first) if date else None


def _clock(text: str) -> tuple[Decimal, str] | None:
    match = CLOCK.fullmatch(text)
    if not match:
        return None
    hours, minutes = int(match["hours"] or 0), int(match["minutes"])
    seconds = Decimal(match["seconds"].replace(",", "."))
    if hours > 24 or minutes > 59 or seconds >= 61:
        return None
    if match["half"]:
        if not match["hours"] or not 1 <= hours <= 12:
            return None
        hours = hours % 12 + 12 * (match["half"] in "Pp")
    kind = "clock" if match["hours"] else "minutes"
    return EXACT.add(Decimal(3600 * hours + 60 * minutes), seconds), kind


def _date(cell: str, date: re.Match[str], day_first: bool | None) -> tuple[Decimal, str] | None:
    clock = _clock(date["clock"])
    if clock is None or clock[1] != "clock":
        return None
    if date["year"]:
        year, month, day = int(date["year"]), int(date["month"]), int(date["day"])
    else:
        if date["mark"] == "/" and day_first is None:
            raise ValueError(f"{cell}: is the day or the month first?")
        numbers = int(date["first"]), int(date["second"])
        day, month = numbers if date["mark"] == "." or day_first else numbers[::-1]
        year = int(date["last"])
    try:
        days = datetime.date(year, month, day).toordinal() - _DAYS_UNTIL_1970
    except ValueError:
        return None
    zone = 0
    if date["zone"] and date["zone"] != "Z":
        digits = date["zone"][1:].replace(":", "").ljust(4, "0")
        sign = 1 if date["zone"][0] == "+" else -1
        zone = sign * (3600 * int(digits[:2]) + 60 * int(digits[2:]))
    return EXACT.add(Decimal(86400 * days - zone), clock[0]), "date"


def shown_day_first(cells: Iterable[str]) -> bool | None:
    """Whether dates with slashes have the day first; None: none of them shows it."""
    dates = [date for cell in cells if (date := DATE.fullmatch(cell)) and date["mark"] == "/"]
    if any(int(date["first"]) > 12 for date in dates):
        return True
    by_month = any(
        int(date["second"]) > 12 or re.search(r"[AaPp]\.?[Mm]", date["clock"]) for date in dates
    )
    return False if by_month else None
