"""Rows of studies, as `sprag study` writes them, as arrays."""

from __future__ import annotations

import csv
import itertools
import json
import os
import pathlib
from typing import Any

import numpy as np
import numpy.typing as npt

from ._errors import InputError


class Study:
    """A study's rows, column by column: study["both.V_floor"] is an array of one entry a row.

    index, point, run and n are whole numbers, failure is text, all others are floats, nan where a
    run failed. axes are the names of the columns that varied; manifest is what
    the study says of itself: its text, that of the scene, version, compiler.
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
        return f"<Study: {self.rows} rows of {', '.join(self.names)}>"

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return len(self._columns["index"])

    def grid(self, name: str) -> npt.NDArray[Any]:
        """Column `name` by the axes: an array of one dimension for each axis, in the order of
        their values, and a last one for the runs of a point (with poincare, all points of all its
        runs).

        Axes that were varied together (zip) count as the first of them. ValueError where points
        have different numbers of rows, or the axes no values in common, as random starts.
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


_WHOLE = {"index", "point", "run", "n"}


def _column(name: str, fields: list[str], file: pathlib.Path) -> npt.NDArray[Any]:
    if name == "failure":
        return np.array(fields, dtype=str)
    try:
        if name in _WHOLE:
            return np.array(fields, dtype=np.int64)
        return np.array(fields, dtype=np.float64)
    except (ValueError, OverflowError) as error:
        raise InputError(f"{file}: column {name}: {error}") from None


def read_study(path: str | os.PathLike[str]) -> Study:
    """Reads the results of `sprag study`: the folder, or the CSV file of a shard, with the manifest
    beside it.

    Raises InputError: no such file, no rows of a study, or a damaged row, with its line.
    """
    file = pathlib.Path(path)
    if file.is_dir():
        file = file / "rows.csv"
    try:
        with open(file, newline="", encoding="utf-8") as stream:
            rows = csv.reader(stream, quoting=csv.QUOTE_NONE)
            names: list[str] = next(rows, [])
            if names[:3] != ["index", "point", "run"]:
                raise InputError(f"{file}:1: the header does not begin with index,point,run")
            parts: dict[str, list[npt.NDArray[Any]]] = {name: [] for name in names}
            number = 2
            # Text takes far more room than numbers: some rows at a time.
            while True:
                block = list(itertools.islice(rows, 65536))
                for line, row in enumerate(block, start=number):
                    if len(row) != len(names):
                        raise InputError(
                            f"{file}:{line}: {len(row)} fields; the header has {len(names)}"
                        )
                number += len(block)
                for i, name in enumerate(names):
                    parts[name].append(_column(name, [row[i] for row in block], file))
                if not block:
                    break
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{file}: {error}") from None
    columns = {name: np.concatenate(of) for name, of in parts.items()}
    rows_file = file.stem.startswith("rows")
    beside = file.with_name("manifest.json") if rows_file else file.with_suffix(".json")
    manifest: dict[str, Any] = {}
    if beside.exists():
        try:
            manifest = json.loads(beside.read_text(encoding="utf-8"))
            axes = [str(axis["path"]) for axis in manifest["axes"]]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(f"{beside}: no manifest of a study: {error}") from None
        return Study(columns, axes, manifest)
    return Study(columns, [], manifest)
