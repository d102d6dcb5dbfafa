"""Files of a report: the scene, CSV files of a run, and JSON reports of programs."""

from __future__ import annotations

import json
import math
import os
import warnings
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .._command import Labelled, UsageError, finite_number, is_scene, scene_file
from .._errors import InputError
from .._machine import Machine, machine_of, read_machine
from ..tables import Kind, Table, contact_events, read_table

if TYPE_CHECKING:
    import pandas as pd

    from .._core import Scene

ALLOWED = (
    "expected a scene, a CSV of states, events, impacts, predictions or V, or the JSON of --report "
    "or of identify --json"
)


def at(tree: Any, *keys: str | int) -> Any:
    """The value at a path of keys and indices within JSON; None if there is none."""
    for key in keys:
        try:
            tree = tree[key]
        except (TypeError, KeyError, IndexError):
            return None
    return tree


def number_at(tree: Any, *keys: str | int) -> float | None:
    """The finite number there; None for anything else."""
    return finite_number(at(tree, *keys))


def numbers_at(tree: Any, *keys: str | int) -> list[float]:
    """The finite numbers at each of some keys; nan for anything else."""
    numbers = [number_at(tree, key) for key in keys]
    return [math.nan if number is None else number for number in numbers]


def count_at(tree: Any, *keys: str | int) -> str:
    """The whole number >= 0 there, as text; empty for anything else."""
    value = at(tree, *keys)
    return str(value) if type(value) is int and value >= 0 else ""


def text_at(tree: Any, *keys: str | int) -> str:
    """The text there; empty for anything else."""
    value = at(tree, *keys)
    return value if isinstance(value, str) else ""


def list_at(tree: Any, *keys: str | int) -> list[Any]:
    """The list there; an empty one for anything else."""
    value = at(tree, *keys)
    return value if isinstance(value, list) else []


@dataclass
class JsonReport:
    """What a program wrote with --report, or identify with --json."""

    label: str
    file: str
    program: str
    content: dict[str, Any]


@dataclass
class ObserverRun:
    """A run of the observer: its states, its report or both."""

    label: str
    states: Table | None = None
    report: dict[str, Any] | None = None


@dataclass
class Inputs:
    """All files of a report."""

    scene_file: str
    scene_name: str
    scene: Scene | None  # None: the compiled part of the package is not installed
    machine: Machine | None = None  # what pictures need of the scene
    remarks: list[str] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    reports: list[JsonReport] = field(default_factory=list)

    def of_kind(self, kind: Kind) -> list[Table]:
        """The tables of a kind, in the order of the files."""
        return [table for table in self.tables if table.kind == kind]

    @property
    def estimates(self) -> list[Table]:
        """The tables with states of an estimate."""
        return [table for table in self.tables if table.is_estimate]

    @property
    def damage(self) -> list[str]:
        """File, line and damage of each damaged file."""
        return [table.damage for table in self.tables if table.damage]

    @property
    def jitter(self) -> float:
        """Standard deviation of reported times by the scene [s]; nan if it is not known."""
        return self.scene.jitter if self.scene is not None else math.nan

    def measured(self) -> pd.DataFrame | None:
        """The measured events: of the first events file, else of the first impacts file."""
        tables = self.of_kind("events") or self.of_kind("impacts")
        if not tables:
            return None
        rows = tables[0].data  # without those that identify inserted
        return contact_events(rows[rows["note"] != "lost"] if "note" in rows else rows)

    def measured_in_machine_time(self) -> pd.DataFrame | None:
        """The same by the machine's clock, which all files but events have."""
        events = self.measured()
        if events is None or self.scene is None or not self.of_kind("events"):
            return events
        return events.assign(t=[self.scene.machine_time(t) for t in events["t"]])

    @property
    def end(self) -> float:
        """Latest time of the states, V and events [s]."""
        kinds = ("states", "energy", "events", "impacts")
        ends = [table.column("t")[-1:] for table in self.tables if table.kind in kinds]
        return float(np.concatenate([[-math.inf], *ends]).max())

    def runs(self) -> list[ObserverRun]:
        """Runs of the observer in the order of the files; files of one label are one run."""
        runs = [ObserverRun(table.label, table) for table in self.estimates]
        observed = [report for report in self.reports if report.program == "observer"]
        for report in observed:
            own = [run for run in runs if run.report is None and run.label == report.label]
            if not own and len(observed) == 1 and len(runs) == 1:
                own = runs
            if own:
                own[0].report = report.content
            else:
                runs.append(ObserverRun(report.label, None, report.content))
        return runs


def read_inputs(names: Iterable[str | os.PathLike[str]]) -> Inputs:
    """Reads [LABEL=]FILE in any order, exactly one of them a scene.

    Files without a label get the label machine or estimate by their content, unless there are
    several estimates. Raises UsageError, InputError and SceneError with the file's name.
    """
    files = [Labelled(os.fspath(name)) for name in names]
    scenes = [given for given in files if is_scene(given.file)]
    if not scenes:
        raise UsageError(
            "no scene is given; name the scene of the run, a file SCENE.toml or one that "
            "`sprag scenes` lists"
        )
    if len(scenes) > 1:
        raise UsageError(f"{scenes[1]} is a second scene; a report is of one machine")
    if len(files) == 1:
        raise UsageError(f"no file of a run is given beside the scene; {ALLOWED}")
    inputs = _read_scene(scene_file(scenes[0].file))
    for given in files:
        if given in scenes:
            continue
        if _is_json(given.file):
            inputs.reports.append(_read_json(given))
        else:
            inputs.tables.append(_read_table(given, inputs.machine))
    alone = len(inputs.estimates) <= 1
    labelled = {given.file for given in files if given.label}
    for table in inputs.tables:
        if str(table.file) in labelled:
            continue
        if table.kind == "states" and not table.is_estimate:
            table.label = "machine"
        elif alone and table.kind != "events":
            table.label = "estimate"
    # Curves of machines are thick, so that those of estimates are drawn over them.
    inputs.tables.sort(key=lambda table: table.kind != "states" or table.is_estimate)
    return inputs


def _read_table(given: Labelled, machine: Machine | None) -> Table:
    try:
        table = read_table(given.file, given.label)
    except InputError as error:
        raise InputError(f"{error}; {ALLOWED}") from None
    if table.kind == "study":
        raise InputError(f"{table.file}: the rows of a study; {ALLOWED}")
    if table.kind == "states" and machine is not None and table.coordinates != machine.f:
        raise InputError(
            f"{table.file}: has {table.coordinates} coordinates; the scene has {machine.f}"
        )
    return table


def _is_json(file: str) -> bool:
    try:
        with open(file, "rb") as stream:
            return stream.read(64).lstrip().startswith(b"{")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{file}: cannot be read: {reason}; {ALLOWED}") from None


def _read_json(given: Labelled) -> JsonReport:
    file = given.file
    try:
        content = json.loads(Path(file).read_bytes())
    except (ValueError, RecursionError) as error:
        raise InputError(f"{file}: is no complete JSON: {error}; {ALLOWED}") from None
    program = text_at(content, "program")
    if not program and "parameters" in content and "problem" in content:
        program = "identify"  # --json does not name its program
    if not program:
        raise InputError(f"{file}: has no key program, so it is no report of a program; {ALLOWED}")
    return JsonReport(given.label or Path(file).stem, file, program, content)


def _read_scene(file: str) -> Inputs:
    try:
        from .._core import read_scene
    except ModuleNotFoundError:
        machine = read_machine(file)
        return Inputs(file, machine.name, None, machine)
    with warnings.catch_warnings(record=True) as remarks:
        warnings.simplefilter("always")
        scene = read_scene(file)
    texts = [str(remark.message) for remark in remarks]
    return Inputs(file, scene.name, scene, machine_of(scene), texts)
