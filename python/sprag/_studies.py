"""Studies: many runs of a scene, with results as arrays."""

from __future__ import annotations

import csv
import itertools
import os
import pathlib
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from ._command import require
from ._errors import InputError
from ._values import Value
from .tables import read_manifest


class Study(Value):
    """Rows of a study by column: study["both.V_floor"] is an array with one entry per row.

    index, point, run and n are integers, failure is text, all others are floats, nan where a run
    failed. axes are the names of the varied columns. manifest describes the study: its text, the
    text of the scene, the values of each axis.
    """

    def __init__(
        self, columns: dict[str, npt.NDArray[Any]], axes: list[str], manifest: dict[str, Any]
    ) -> None:
        self._columns = columns
        self.axes = axes
        self.manifest = manifest

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        return self._columns[name]

    @property
    def names(self) -> list[str]:
        """Names of the columns, in the order of the file."""
        return list(self._columns)

    def __repr__(self) -> str:
        return f"<sprag.Study {self.rows} rows, {len(self.names)} columns>"

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self._columns["index"])

    def grid(self, name: str) -> npt.NDArray[Any]:
        """Returns column `name` as an array with a dimension for each axis, in ascending order of
        its values. The last dimension holds the runs of a point (with poincare, all points of all
        its runs).

        Axes varied together (zip) count as the first of them. Raises ValueError if the rows form no
        grid: points with different numbers of rows, or axes without common values (random starts).
        """
        groups: dict[Any, str] = {}
        for i, axis in enumerate(self.manifest.get("axes", [])):
            groups.setdefault(axis.get("group", i), axis["path"])
        axes = list(groups.values()) or self.axes
        values, places = [], []
        for axis in axes:
            of_axis, place = np.unique(self[axis], return_inverse=True)
            values.append(len(of_axis))
            places.append(place)
        cell: npt.NDArray[Any] = np.zeros(self.rows, dtype=np.int64)
        for size, place in zip(values, places):
            cell = cell * size + place
        count = int(np.prod(values, dtype=int))
        runs = self.rows // max(count, 1)
        if runs == 0 or (np.bincount(cell, minlength=count) != runs).any():
            raise ValueError(f"{', '.join(axes)} are no grid with as many rows at every point")
        order = np.argsort(cell, kind="stable")
        return self[name][order].reshape(*values, runs)

    def table(self) -> Any:
        """The rows as a pandas.DataFrame."""
        pandas = require("pandas", "python3-pandas", "Study.table()")
        return pandas.DataFrame(self._columns)

    def dataset(self) -> Any:
        """The rows as an xarray.Dataset.

        Its dimensions are the varied axes, named by the first of those that vary together, `run`
        and, with poincare, `n`. Coordinates are the axes' values: of a relative axis the deviation
        that the study file gives. Randomly drawn axes are variables like the recorded quantities.
        Rows that are missing, as in a part of a study, are nan.
        """
        xarray = require("xarray", "python3-xarray", "Study.dataset()")
        grid = [axis for axis in self.manifest["axes"] if "values" in axis]
        names: dict[int, str] = {}
        for axis in grid:
            names.setdefault(axis["group"], axis["path"])
        coordinates = {axis["path"]: (names[axis["group"]], axis["values"]) for axis in grid}
        dimensions = [names[group] for group in sorted(names)] + ["run"]
        sizes = self.manifest["group_size"]
        shape = [*(sizes[group] for group in sorted(names)), self.manifest["runs"]]
        coordinates["run"] = ("run", np.arange(shape[-1]))
        place = self["index"]
        if "n" in self._columns:
            last = int(self["n"].max(initial=1))
            dimensions.append("n")
            shape.append(last)
            coordinates["n"] = ("n", np.arange(1, last + 1))
            place = place * last + np.maximum(self["n"], 1) - 1
        variables = {}
        for name, column in self._columns.items():
            if name in _WHOLE or name in coordinates:
                continue
            cells: npt.NDArray[Any] = np.full(
                int(np.prod(shape)), "" if column.dtype.kind == "U" else np.nan, column.dtype
            )
            cells[place] = column
            variables[name] = (dimensions, cells.reshape(shape))
        return xarray.Dataset(variables, coordinates)


_WHOLE = {"index", "point", "run", "n"}


def _column(name: str, fields: list[str], file: str) -> npt.NDArray[Any]:
    if name == "failure":
        return np.array(fields, dtype=str)
    try:
        if name in _WHOLE:
            return np.array(fields, dtype=np.int64)
        return np.array(fields, dtype=np.float64)
    except (ValueError, OverflowError) as error:
        raise InputError(f"{file}: column {name}: {error}") from None


def _columns(stream: Iterable[str], file: str) -> dict[str, npt.NDArray[Any]]:
    rows = csv.reader(stream, quoting=csv.QUOTE_NONE)
    names: list[str] = next(rows, [])
    if names[:3] != ["index", "point", "run"]:
        raise InputError(f"{file}:1: the header does not begin with index,point,run")
    parts: dict[str, list[npt.NDArray[Any]]] = {name: [] for name in names}
    number = 2
    # Text takes far more memory than numbers, so the file is converted in blocks of rows.
    while True:
        block = list(itertools.islice(rows, 65536))
        for line, row in enumerate(block, start=number):
            if len(row) != len(names):
                raise InputError(f"{file}:{line}: {len(row)} fields; the header has {len(names)}")
        number += len(block)
        for i, name in enumerate(names):
            parts[name].append(_column(name, [row[i] for row in block], file))
        if not block:
            break
    return {name: np.concatenate(of) for name, of in parts.items()}


def study_from_rows(rows: Iterable[str], manifest: dict[str, Any]) -> Study:
    """The study of lines of a file of rows."""
    return _study(_columns(rows, "rows"), manifest)


def _study(columns: dict[str, npt.NDArray[Any]], manifest: dict[str, Any]) -> Study:
    return Study(columns, [str(axis["path"]) for axis in manifest.get("axes", [])], manifest)


def read_study(path: str | os.PathLike[str]) -> Study:
    """Reads the results of `sprag study`: its folder, or the CSV file of a shard with the manifest
    beside it.

    Raises InputError if the file does not exist, holds no rows of a study, or has a damaged row,
    whose line the text gives.
    """
    file = pathlib.Path(path)
    if file.is_dir():
        file = file / "rows.csv"
    try:
        with open(file, newline="", encoding="utf-8") as stream:
            columns = _columns(stream, str(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{file}: {error}") from None
    return _study(columns, read_manifest(file))
