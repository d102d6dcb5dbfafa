"""Files of other kinds than text as tables; kinds that cannot be read are named."""

from __future__ import annotations

import contextlib
import io
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from .._command import counted, require
from .._errors import InputError
from .moments import TIME_UNITS
from .tables import Table, read_table

# Below the peak of a sound, and after a pause of this length [s], a sample is an onset.
_BELOW_PEAK = 10 ** (-30 / 20)
_PAUSE = 0.03

_FOREIGN = {  # first bytes, what the file is and what to do
    b"\x89HDF": "is HDF5 (MATLAB's -v7.3 too); save with -v7, or export CSV",
    b"HDF": "is an HDF4 file; export CSV",
    b"TDSm": "is a LabVIEW TDMS file; export CSV",
    b"#ROSBAG": "is a ROS bag; export CSV with rostopic echo -p",
    b"<SALEAE>": "is a Saleae capture; export CSV",
    b"\xed\xa1\xda\x01": "is an LCM log, which observer --replay reads as it is",
    b"\x7fELF": "is a program",
    b"%PDF": "is a PDF",
    b"\xd0\xcf\x11\xe0": "is an old Excel file; save as .xlsx or CSV",
    b"\x1f\x8b": "is compressed; use gunzip",
}

Arrays = Mapping[str, npt.NDArray[Any]]


def read_file(
    file: str | os.PathLike[str],
    names: Sequence[str] | None = None,
    separator: str | None = None,
    skip_lines: int = 0,
) -> Table:
    """Reads a table: text (CSV, TSV, blanks, LVM), VCD, .xlsx, .mat, .npy, or onsets of a .wav.

    The arguments are those of read_table(). Raises InputError, with the file's name.
    """
    try:
        with open(file, "rb") as stream:
            data = stream.read()
    except OSError as error:
        raise InputError(f"{file}: {error.strerror}") from None
    with located(file):
        return _read(data, names, separator, skip_lines)


@contextlib.contextmanager
def located(file: str | os.PathLike[str]) -> Iterator[None]:
    """Puts the file's name before the message of an InputError, as FILE:LINE: or FILE: ."""
    try:
        yield
    except InputError as error:
        place = "" if re.match(r"[0-9]+:", str(error)) else " "
        raise InputError(f"{os.fspath(file)}:{place}{error}") from None


def _read(
    data: bytes, names: Sequence[str] | None, separator: str | None, skip_lines: int
) -> Table:
    for magic, what in _FOREIGN.items():
        if data.startswith(magic):
            raise InputError(what)
    readers = {
        b"MATLAB 5.0": _read_mat,
        b"\x93NUMPY": _read_npy,
        b"RIF[FX]....WAVE": _read_wav,
    }
    if data.startswith(b"PK\x03\x04"):
        (text, remarks), separator = _guarded(_text_of_excel, data), "tab"
    elif reader := next((of for form, of in readers.items() if re.match(form, data, re.S)), None):
        return _renamed(_guarded(reader, data), names)
    else:
        text, remarks = _decoded(data)
        start = text.lstrip()
        if start.startswith(("$date", "$version", "$timescale", "$comment", "$scope")):
            return _renamed(_read_vcd(text), names)
        if start[:1] in ("{", "[") and text.rstrip()[-1:] in ("}", "]"):
            raise InputError("is JSON; export CSV")
    table = read_table(text, names, separator, skip_lines)
    table.remarks[:0] = remarks
    return table


_Read = TypeVar("_Read")


def _guarded(reader: Callable[[bytes], _Read], data: bytes) -> _Read:
    try:
        return reader(data)
    except InputError:
        raise
    except MemoryError:
        raise InputError("claims to hold more than fits in memory; it is damaged") from None
    except Exception as error:  # the libraries raise many kinds for damaged files
        text = str(error).split("\n")[0] or type(error).__name__
        raise InputError(f"cannot be read: {text}") from None


def _renamed(table: Table, names: Sequence[str] | None) -> Table:
    if names and len(names) != len(table.names):
        raise InputError(
            f"has the columns {table.listed()}; --columns names {counted(len(names), 'column')}"
        )
    for old, name in zip(table.names, names or ()):
        if unit := table.units.pop(old, None) or table.unit(old):
            table.units[name] = unit
    table.names = list(names or table.names)
    return table


def _decoded(data: bytes) -> tuple[str, list[str]]:
    marks = {b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
    for mark, code in marks.items():
        if data.startswith(mark):
            try:
                return data.decode(code), []
            except UnicodeDecodeError:
                raise InputError(f"begins as {code.upper()} and is none") from None
    try:
        text, remarks = data.decode("utf-8"), []
    except UnicodeDecodeError:
        text, remarks = data.decode("latin-1"), ["the text is not UTF-8; it is read as Latin-1"]
    if re.search(r"[\0-\x08\x0e-\x1a\x1c-\x1f]", text[:4000]):
        raise InputError("is a binary file of an unknown kind; export CSV")
    return text, remarks


def _text_of(value: Any) -> str:
    """A value as a cell: integers with all digits, "" for NaN and None."""
    if value is None or value != value:
        return ""
    if isinstance(value, bool):
        return str(int(value))
    return repr(value) if isinstance(value, float) else str(value)


def _of_arrays(arrays: Arrays) -> Table:
    """Columns of equal length."""
    cells = [[_text_of(value) for value in array.tolist()] for array in arrays.values()]
    rows = [list(row) for row in zip(*cells)]
    if not rows:
        raise InputError("has no rows")
    return Table(list(arrays), rows, list(range(1, len(rows) + 1)))


def _text_of_excel(data: bytes) -> tuple[str, list[str]]:
    """The first sheet, its cells separated by tabs."""
    if b"[Content_Types]" not in data[:4000] and b"xl/" not in data:
        raise InputError("is a zip archive (sigrok's .sr, numpy's .npz, ...); export CSV")
    openpyxl = require("openpyxl", "python3-openpyxl", "reading .xlsx files")
    book = openpyxl.load_workbook(io.BytesIO(data), read_only=True, data_only=True)
    sheet = book.worksheets[0]
    lines = [
        "\t".join(_text_of(cell).replace("\t", " ") for cell in row)
        for row in sheet.iter_rows(values_only=True)
    ]
    others = len(book.worksheets) - 1
    remark = f"only the first of {others + 1} sheets is read, '{sheet.title}'"
    return "\n".join(lines), [remark] if others else []


def _read_mat(data: bytes) -> Table:
    scipy_io = require("scipy.io", "python3-scipy", "reading .mat files")
    arrays = {
        name: np.asarray(value).squeeze()
        for name, value in scipy_io.loadmat(io.BytesIO(data)).items()
        if not name.startswith("__") and np.asarray(value).dtype.kind in "fiub"
    }
    if {"Tinterval", "Tstart"} <= arrays.keys():
        return _of_picoscope(arrays)
    columns: dict[str, npt.NDArray[Any]] = {}
    for name, array in arrays.items():
        if array.ndim == 1:
            columns[name] = array
        elif array.ndim == 2:
            columns.update({f"{name}{i + 1}": column for i, column in enumerate(array.T)})
    if not columns:
        raise InputError("has no vectors")
    if len({len(column) for column in columns.values()}) > 1:
        sizes = ", ".join(f"{name} {len(column)}" for name, column in columns.items())
        raise InputError(f"its variables differ in length: {sizes}")
    return _of_arrays(columns)


def _of_picoscope(arrays: Arrays) -> Table:
    signals = {name: array for name, array in arrays.items() if array.ndim == 1 and len(array) > 1}
    if not signals:
        raise InputError("has no signals")
    longest = max(len(signal) for signal in signals.values())
    t = float(arrays["Tstart"]) + np.arange(longest) * float(arrays["Tinterval"])
    table = _of_arrays({"Time [s]": t, **signals})
    table.remarks.append("times are Tstart + k Tinterval")
    return table


def _read_npy(data: bytes) -> Table:
    array = np.load(io.BytesIO(data), allow_pickle=False)
    if array.dtype.names:
        return _of_arrays({name: array[name] for name in array.dtype.names})
    if array.ndim not in (1, 2) or array.dtype.kind not in "fiub":
        raise InputError("must be an array of one or two dimensions of numbers")
    columns = [array] if array.ndim == 1 else list(array.T)
    table = _of_arrays({f"column {i + 1}": column for i, column in enumerate(columns)})
    table.remarks.append(f"the columns have no names; they are called {', '.join(table.names)}")
    table.has_header = False
    return table


def _read_wav(data: bytes) -> Table:
    wavfile = require("scipy.io.wavfile", "python3-scipy", "reading .wav files")
    rate, sound = wavfile.read(io.BytesIO(data))
    level = sound.astype(float)
    level = level if level.ndim == 1 else level.mean(axis=1)
    level = np.abs(level - np.median(level)) if len(level) else level
    loud = np.flatnonzero(level > level.max(initial=0.0) * _BELOW_PEAK)
    onsets = loud[np.diff(loud, prepend=-rate) > _PAUSE * rate]
    if not len(onsets):
        raise InputError("is silent")
    table = _of_arrays({"Onset [s]": onsets / rate})
    table.remarks.append(
        f"{len(onsets)} onsets: the first sample less than 30 dB below the peak after a pause of "
        f"{_PAUSE:g} s"
    )
    return table


def _read_vcd(text: str) -> Table:
    """Value change dump: a row of all signals at each time of a change."""
    head, _, body = text.partition("$enddefinitions")
    scale = re.search(r"\$timescale\s+([0-9]+)\s*(fs|ps|ns|us|ms|s)\s+\$end", head)
    if not scale:
        raise InputError("the VCD file has no $timescale")
    signals = {
        match["code"]: match["name"]
        for match in re.finditer(
            r"\$var\s+(?P<type>\w+)\s+(?P<bits>[0-9]+)\s+(?P<code>\S+)\s+(?P<name>.+?)\s+\$end",
            head,
        )
        if match["bits"] == "1" or match["type"] == "real"
    }
    values = dict.fromkeys(signals, "")
    rows, lines, number = [], [], head.count("\n") + 1
    change = re.compile(r"(?m)^[ \t]*(?:([01xXzZ])(\S+)|[rR](\S+)[ \t]+(\S+))[ \t\r]*$")
    # A block is a time and the changes up to the next one; the first block has no time.
    for block in re.split(r"(?m)^[ \t]*#", body):
        time, _, changes = block.partition("\n")
        for bit, of_bit, real, of_real in change.findall(changes):
            if (code := of_bit or of_real) in values:
                values[code] = real or bit.strip("xXzZ")
        rows.append([time.strip(), *values.values()])
        lines.append(number)
        number += block.count("\n")
    if len(rows) == 1:
        raise InputError("the VCD file has no times")
    unit = scale[2] if scale[1] == "1" else f"{int(scale[1]) * TIME_UNITS[scale[2]]}"
    return Table(["Time", *signals.values()], rows[1:], lines[1:], {"Time": unit})
