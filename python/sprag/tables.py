"""CSV files of the programs as tables of numbers, told apart by their headers.

A file is read up to its damage, which its table describes. Nothing here needs the compiled part of
the package.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ._command import require
from ._errors import InputError

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    import pandas as pd

    Numbers = npt.NDArray[np.float64]

Kind = Literal["states", "events", "impacts", "predictions", "energy", "study"]

# The columns with which each kind of file begins.
HEADERS: dict[Kind, list[str]] = {
    "states": ["k", "t", "q1"],
    "energy": ["k", "t", "V"],
    "events": ["t", "contact", "closed"],
    "impacts": ["t", "contact", "kind"],
    "predictions": ["made_at", "certain_until", "t", "contact"],
    "study": ["index", "point", "run"],
}
TEXT_COLUMNS = ("kind", "note", "failure")  # all others hold numbers
MOST_CONTACTS = 60


@dataclass
class Table:
    """Rows of one file, without those from its first damage on.

    Columns are numbers, nan where a cell is none, but for TEXT_COLUMNS.
    """

    kind: Kind
    label: str  # name of its curves
    data: pd.DataFrame
    file: Path
    damage: str = ""  # file, line and what is wrong there
    spurious: int = 0  # rows of events that are marked as spurious, which are left out

    @property
    def is_estimate(self) -> bool:
        """Whether states are those of an estimate, which has columns about its own error."""
        return self.kind == "states" and any(
            name == "B" or name.startswith(("sigma_", "bound_")) for name in self.data
        )

    @property
    def coordinates(self) -> int:
        """Number f of columns q1 ... qf."""
        f = 0
        while f"q{f + 1}" in self.data:
            f += 1
        return f

    def column(self, name: str) -> Numbers:
        """The numbers of a column, of shape (rows,)."""
        numbers: Numbers = self.data[name].to_numpy(float)
        return numbers


def read_table(file: str | Path, label: str = "") -> Table:
    """Reads a file of any Kind up to its damage; the default label is its name without suffix.

    Raises InputError if the file cannot be read or its header is that of no Kind.
    """
    path = Path(file)
    try:
        lines = path.read_bytes().removeprefix(b"\xef\xbb\xbf").splitlines(keepends=True)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be read: {reason}") from None
    header = _fields(lines[0]) if lines else []
    kind = next((k for k, first in HEADERS.items() if header[: len(first)] == first), None)
    if kind is None:
        known = "; ".join(f"{','.join(first)} ({k})" for k, first in HEADERS.items())
        raise InputError(f"{path}:1: the header is none of a table of Sprag, which begins {known}")
    whole, damage = _whole_rows(lines, len(header))
    data = _numbers(b"".join(lines[1 : whole + 1]), header)
    if kind in ("events", "impacts", "predictions"):
        contact = data["contact"]
        good = contact.between(1, MOST_CONTACTS) & (contact % 1 == 0)
        if kind == "predictions":  # one without an event has no contact
            good |= contact.isna()
        if not good.all():
            bad = int(good.to_numpy().argmin())
            given = _fields(lines[bad + 1])[header.index("contact")]
            damage = f"{bad + 2}: contact {given}; must be a whole number in 1 to {MOST_CONTACTS}"
            data = data.iloc[:bad]
    table = Table(kind, label or path.stem, data, path, f"{path}:{damage}" if damage else "")
    if kind == "events" and "note" in data:
        kept = data["note"] != "spurious"
        table.spurious = int((~kept).sum())
        table.data = data[kept].reset_index(drop=True)
    return table


def _fields(line: bytes) -> list[str]:
    return line.decode(errors="surrogateescape").rstrip("\r\n").split(",")


def _whole_rows(lines: Sequence[bytes], columns: int) -> tuple[int, str]:
    """Number of rows before the first damaged one, with its line and its damage."""
    for i, line in enumerate(lines[1:]):
        if not line.endswith((b"\n", b"\r")):
            return i, f"{i + 2}: truncated line (no end of line)"
        if line.count(b",") + 1 != columns:
            return i, f"{i + 2}: {line.count(b',') + 1} fields; the header has {columns}"
    return max(0, len(lines) - 1), ""


def _numbers(rows: bytes, header: Sequence[str]) -> pd.DataFrame:
    pd = require("pandas", "python3-pandas", "reading of tables")
    texts = {i: str for i, name in enumerate(header) if name in TEXT_COLUMNS}
    data = pd.read_csv(
        io.BytesIO(rows),
        header=None,
        names=range(len(header)),
        index_col=False,
        dtype=texts,
        keep_default_na=False,
        na_values={i: ["", "nan", "-nan"] for i in range(len(header)) if i not in texts},
        quoting=csv.QUOTE_NONE,
        skip_blank_lines=False,
        float_precision="round_trip",
        encoding_errors="surrogateescape",
    )
    for i in data:
        if i not in texts:
            data[i] = pd.to_numeric(data[i], errors="coerce").astype(float)
    columns = pd.Index(header)
    return data.set_axis(columns, axis=1).loc[:, ~columns.duplicated()]


@dataclass
class Study:
    """Rows of a study, of all its shards."""

    name: str
    axes: list[str]  # keys that vary, one of each group; empty without a manifest
    rows: pd.DataFrame
    damage: list[str]


def is_study(file: str | Path) -> bool:
    """Whether a file has the header of the rows of a study."""
    try:
        with open(file, "rb") as stream:
            return _fields(stream.readline(1 << 20))[:3] == HEADERS["study"]
    except (OSError, ValueError):
        return False


def manifest_of(rows: str | Path) -> Path:
    """The manifest of rows: rows*.csv has manifest.json, others their own name with .json."""
    path = Path(rows)
    if path.stem.startswith("rows"):
        return path.with_name("manifest.json")
    return path.with_suffix(".json")


def read_manifest(rows: str | Path) -> dict[str, Any]:
    """What the manifest of rows says; nothing without one. Raises InputError if it is damaged."""
    file = manifest_of(rows)
    if not file.exists():
        return {}
    try:
        manifest: dict[str, Any] = json.loads(file.read_text("utf-8", "surrogateescape"))
        axes_of(manifest)  # raises where they are missing
        return manifest
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{file}: no manifest of a study: {error}") from None


def read_study_rows(files: Sequence[str | Path]) -> Study:
    """Reads the only file of a study, or its shards, with the manifest beside them.

    Raises InputError if a file or a manifest cannot be read, or if headers differ.
    """
    pd = require("pandas", "python3-pandas", "reading of tables")
    tables = [read_table(file) for file in files]
    study = Study(tables[0].file.absolute().parent.name, [], tables[0].data, [])
    for table in tables:
        if list(table.data) != list(tables[0].data):
            raise InputError(f"{table.file}:1: the header is not that of the first file")
        if table.damage:
            study.damage.append(table.damage)
        if not study.axes and (manifest := read_manifest(table.file)):
            study.name = str(manifest.get("name", study.name))
            study.axes = axes_of(manifest)
    study.rows = pd.concat([table.data for table in tables], ignore_index=True)
    return study


def axes_of(manifest: Mapping[str, Any]) -> list[str]:
    """Keys of the scene that a study varies; of keys that vary together the first."""
    keys = []
    groups = set()
    for axis in manifest["axes"]:
        if "group" not in axis or axis["group"] not in groups:
            keys.append(str(axis["path"]))
        groups.add(axis.get("group"))
    return keys


def columns(run: Any, scene: Any = None) -> dict[str, Numbers]:
    """A Simulation, Estimates or Smoothed as the columns of the states file that programs write.

    Each has one entry for each tick; pandas.DataFrame(columns(run, scene)) is the file as a table.
    Outputs and gaps have their columns if the scene is given, a :class:`sprag.Scene`.
    """
    import numpy as np

    all_columns: dict[str, Numbers] = {"k": np.arange(len(run.t), dtype=float), "t": run.t}

    def add(prefix: str, names: Sequence[str], attribute: str) -> None:
        rows = getattr(run, attribute, None)
        if rows is not None and np.size(rows):
            all_columns.update({prefix + name: rows[:, i] for i, name in enumerate(names)})

    f = run.q.shape[1]
    q, u = ([f"{letter}{i + 1}" for i in range(f)] for letter in "qu")
    outputs = [] if scene is None else [output.name for output in scene.model.outputs]
    gaps = [] if scene is None else [f"g{i + 1}" for i in range(scene.m)]
    keys = list(getattr(run, "keys", []))
    add("", q, "q")
    add("", u, "u")
    for name, column in (
        ("bound", "B"),
        ("from_filter", "from_filter"),
        ("penetrating", "penetrating"),
    ):
        if getattr(run, name, None) is not None:
            all_columns[column] = np.asarray(getattr(run, name), float)
    for prefix in ("sigma_", "bound_"):
        for names, of in ((q, "q"), (u, "u"), (gaps, "gap"), (outputs, "outputs")):
            add(prefix, names, prefix + of)
    add("", keys, "parameters")
    add("sigma_", keys, "sigma_parameters")
    add("", outputs, "outputs")
    return all_columns


def contact_events(rows: pd.DataFrame) -> pd.DataFrame:
    """Events of the rows of an events or impacts file: t, contact and kind.

    A pulse, two rows of an events file, is one event of the kind impact; others are closes and
    opens.
    """
    if "closed" not in rows:
        return rows[["t", "contact", "kind"]]
    closes, following = rows["closed"] > 0.5, rows.groupby("contact").shift(-1)
    impact = closes & (following["closed"] <= 0.5) & (following["t"] == rows["t"])
    kinds = closes.map({True: "closes", False: "opens"}).mask(impact, "impact")
    is_end = impact.groupby(rows["contact"]).shift(1, fill_value=False)
    return rows[["t", "contact"]].assign(kind=kinds)[~is_end]


@dataclass
class Closures:
    """When a contact is closed: impacts, and stretches [from, to] of longer contact."""

    impacts: list[float]
    stretches: list[tuple[float, float]]

    @property
    def begins(self) -> list[float]:
        """Times at which the contact closes, ascending."""
        return sorted([*self.impacts, *(begin for begin, _ in self.stretches)])


def closures(events: pd.DataFrame, end: float) -> dict[int, Closures]:
    """Closures of each contact by its number; a contact that stays closed does so up to `end`."""
    result = {}
    for contact, own in events.groupby("contact"):
        is_impact, closes = own["kind"] == "impact", own["kind"] == "closes"
        until = own["t"][~is_impact].shift(-1, fill_value=end).clip(lower=own["t"])
        stretches = zip(own["t"][closes], until[closes])
        result[int(contact)] = Closures(list(own["t"][is_impact]), list(stretches))
    return result
