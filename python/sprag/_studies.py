"""Studies: many runs of a scene, with results as arrays."""

from __future__ import annotations

import csv
import itertools
import json
import os
import pathlib
from typing import Any

import numpy as np
import numpy.typing as npt

from ._core import _run_study
from ._errors import InputError


class Study:
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
        return f"<Study: {self.rows} rows of {', '.join(self.names)}>"

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


def run_study(study: str | os.PathLike[str], *, jobs: int | None = None) -> Study:
    """Runs the study of a study file, or one that comes with Sprag by its name, in memory.

    The rows are those that `sprag study` writes. That program is for a study that should continue
    after an interruption, or that runs on several hosts. jobs: number of threads, None: one for each
    core. Raises SceneError or InputError for a wrong study file or scene; a run that fails has its
    reason in the column failure.
    """
    columns, manifest = _run_study(study, jobs)
    columns["failure"] = np.array(columns["failure"], dtype=str)
    return Study(columns, [str(axis["path"]) for axis in manifest["axes"]], manifest)
