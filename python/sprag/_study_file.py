"""Study files (TOML): a scene, its varied keys, the disturbances of its events, what is recorded.

A row of a study is a pure function of the study and the index of its run.
"""

from __future__ import annotations

import difflib
import hashlib
import math
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from . import _core
from ._command import scenes_folder
from ._errors import Error, InputError, SceneError
from ._figures import figures

MOST_RUNS = 9e15  # in all, so that every index is a double
MOST_POINTS = 10_000_000  # of an axis
LARGEST = 1 << 27  # bytes of a study file, which may list the points of an axis
ESTIMATORS = ["replica", "timing", "both", "adaptive"]
OF_ERRORS = ["V_floor", "V_max", "rate", "time_below"]
OF_FILTERS = ["nees", "beyond_3_sigma", "trusted"]
OF_ESTIMATORS = [*OF_ERRORS, *OF_FILTERS, "worse"]
OF_RECURRENCE = ["poincare", "impacts_per_period", "lyapunov", "attractor"]
RECORDS = [*OF_ESTIMATORS, "impacts", *OF_RECURRENCE]


class Limits(NamedTuple):
    low: float = -math.inf
    high: float = math.inf
    without_low: bool = False

    def allow(self, value: float) -> bool:
        return self.low <= value <= self.high and not (self.without_low and value == self.low)

    def __str__(self) -> str:
        if math.isfinite(self.high):
            return f"in {'(' if self.without_low else '['}{_text(self.low)}, {_text(self.high)}]"
        return f"{'>' if self.without_low else '>='} {_text(self.low)}"


ANY, POSITIVE, NOT_NEGATIVE = Limits(), Limits(0.0, without_low=True), Limits(0.0)

# Quantities that vary and are no keys of a scene.
KNOBS = {
    "observer.modes": Limits(1.0, 1e6),
    "disturbance.jitter": NOT_NEGATIVE,
    "disturbance.offset": ANY,
    "disturbance.lost": Limits(0.0, 1.0),
    "disturbance.spurious": NOT_NEGATIVE,
    "start.replica": NOT_NEGATIVE,
    "start.machine": NOT_NEGATIVE,
    "duration": POSITIVE,
    "tick": POSITIVE,
}


def _text(value: float) -> str:
    """A number of a message."""
    return repr(value).removesuffix(".0")


def _near(word: str, words: Sequence[str]) -> str | None:
    return next(iter(difflib.get_close_matches(word, words, n=1)), None)


def _unknown(given: str, words: Sequence[str]) -> str:
    near = _near(given, words)
    better = f'did you mean "{near}"?' if near else f"must be one of {', '.join(words)}"
    return f'is "{given}"; {better}'


class Node(NamedTuple):
    """A value of a TOML text; tables and arrays have nodes."""

    value: Any
    line: int
    column: int
    key_line: int
    key_column: int
    inline: bool  # a table in braces

    @property
    def kind(self) -> str:
        kinds = {dict: "a table", list: "an array", str: "a string", bool: "a boolean"}
        kinds |= {int: "an integer", float: "a float"}
        return kinds.get(type(self.value), "a date")


def _node(given: Any) -> Node:
    value, *place = given
    if isinstance(value, dict):
        value = {key: _node(entry) for key, entry in value.items()}
    elif isinstance(value, list):
        value = [_node(entry) for entry in value]
    return Node(value, *place)


class Table:
    """A table of a study file. Wrong values raise SceneError with their place."""

    def __init__(self, file: str, node: Node, path: str, keys: Sequence[str]) -> None:
        self.file, self.node, self.path = file, node, path
        entries = node.value.items()
        for key, entry in sorted(entries, key=lambda item: (item[1].key_line, item[1].key_column)):
            if key not in keys:
                near = _near(key, keys)
                better = f"did you mean {near}?" if near else f"must be one of {', '.join(keys)}"
                self._raise(entry[3:5], f"unknown key {self._path(key)}; {better}")

    def _raise(self, place: tuple[int, int], message: str) -> NoReturn:
        text = f"{self.file}:{place[0]}:{place[1]}: {message}"
        raise SceneError(text, self.file, *place, message)

    def _path(self, key: str) -> str:
        return f"{self.path}.{key}" if self.path else key

    def fail(self, key: str, message: str, entry: int | None = None) -> NoReturn:
        """`entry`: of an array, from 0."""
        node, path = self.node.value.get(key, self.node), self._path(key)
        if entry is not None:
            node, path = node.value[entry], f"{path}[{entry + 1}]"
        self._raise(node[1:3], f"{path} {message}")

    def fail_here(self, message: str) -> NoReturn:
        self._raise(self.node[1:3], message)

    def has(self, key: str) -> bool:
        return key in self.node.value

    def _typed(self, key: str, types: type | tuple[type, ...], wanted: str) -> Any:
        if not self.has(key):
            self.fail_here(f"missing key {self._path(key)}")
        node = self.node.value[key]
        if not isinstance(node.value, types) or (isinstance(node.value, bool) and types != bool):
            self.fail(key, f"is {node.kind}; must be {wanted}")
        return node.value

    def string(self, key: str, default: str | None = None) -> str:
        if default is not None and not self.has(key):
            return default
        return str(self._typed(key, str, "a string"))

    def boolean(self, key: str) -> bool:
        return self.has(key) and bool(self._typed(key, bool, "true or false"))

    def number(self, key: str, default: float, limits: Limits) -> float:
        if not self.has(key):
            return default
        value = float(self._typed(key, (int, float), "a number"))
        if not math.isfinite(value):
            self.fail(key, f"is {value}; must be finite")
        if not limits.allow(value):
            self.fail(key, f"is {_text(value)}; must be {limits}")
        return value

    def integer(self, key: str, default: int, low: int, high: int) -> int:
        if not self.has(key):
            return default
        value = int(self._typed(key, int, "an integer"))
        if not low <= value <= high:
            self.fail(key, f"is {value}; must be in {low}..{high}")
        return value

    def numbers(self, key: str) -> list[float]:
        """A number, or an array of them; not empty."""
        value = self._typed(key, (int, float, list), "a number or an array of numbers")
        if not isinstance(value, list):
            return [self.number(key, 0.0, ANY)]
        if not value:
            self.fail(key, "is empty; must have a number at least")
        for i, node in enumerate(value):
            if not _is_number(node):
                self.fail(key, "is no finite number; must be one", i)
        return [float(node.value) for node in value]

    def words(self, key: str, allowed: Sequence[str]) -> list[str]:
        """Different words of an array of strings."""
        given = self._typed(key, list, "an array of strings") if self.has(key) else []
        words: list[str] = []
        for i, node in enumerate(given):
            if not isinstance(node.value, str):
                self.fail(key, f"is {node.kind}; must be a string", i)
            if node.value not in allowed:
                self.fail(key, _unknown(node.value, allowed), i)
            if node.value in words:
                self.fail(key, f'is "{node.value}" again; must be another one', i)
            words.append(node.value)
        return words

    def table(self, key: str, keys: Sequence[str]) -> Table:
        """Empty if the key is absent."""
        node = self.node._replace(value={})
        if self.has(key):
            self._typed(key, dict, "a table")
            node = self.node.value[key]
        return Table(self.file, node, self._path(key), keys)


def _is_number(node: Node) -> bool:
    number = isinstance(node.value, (int, float)) and not isinstance(node.value, bool)
    return number and math.isfinite(node.value)


@dataclass
class Axis:
    """A key that varies over a grid of values, or is drawn for each run between low and high."""

    path: str  # as in the study file; name of its column
    target: str = ""  # "scene": of machine and observer, "observer", or a knob's path
    key: str = ""  # of the scene
    values: list[float] = field(default_factory=list)
    low: float = 0.0
    high: float = 0.0
    logarithmic: bool = False  # drawn uniformly in the logarithm
    relative: bool = False  # values are deviations of the observer's value from the machine's
    base: float = 0.0  # the scene's value, of relative axes
    group: int = 0  # axes of one group vary together

    def between(self, x: float) -> float:
        if self.logarithmic:
            return self.low * math.pow(self.high / self.low, x)
        return self.low + (self.high - self.low) * x

    @property
    def ends(self) -> tuple[float, float]:
        values = self.values or [self.low, self.high]
        return min(values), max(values)


@dataclass
class Setting:
    """Settings of the runs with some values of the axes."""

    machine: Any
    observer: Any  # its model of the machine, possibly with fewer coordinates
    knobs: dict[str, float]


@dataclass
class StudyFile:
    """A study, read and checked."""

    file: str
    text: str
    name: str = ""
    scene_file: str = ""
    scene_text: str = ""
    scene: Any = None  # without variations
    remarks: list[str] = field(default_factory=list)
    inputs: list[str] = field(default_factory=list)  # the scene and the files that it names
    hash: str = ""  # of the study file and the contents of all inputs
    seed: int = 1
    common_draws: bool = False  # run r uses the same random numbers at every point
    runs: int = 1  # of a point
    samples: int = 1000
    threshold: float = 0.0  # of V; 0: 1e-4 of V at the start
    estimators: list[str] = field(default_factory=list)
    records: list[str] = field(default_factory=list)
    period: float = 0.0  # of the stroboscope [s]; 0: that of the excitation
    transient: int = 300  # periods before recording
    periods: int = 200  # recorded periods
    longest: int = 32  # longest cycle that is sought, in periods
    coordinates: list[int] = field(default_factory=list)  # of the state (q, u), from 0
    coordinate_names: list[str] = field(default_factory=list)
    knobs: dict[str, float] = field(default_factory=dict)  # that the file gives
    axes: list[Axis] = field(default_factory=list)  # in the order of the file
    group_size: list[int] = field(default_factory=list)  # points; the last group varies fastest

    @property
    def points(self) -> int:
        return math.prod(self.group_size)

    def records_any(self, of: Sequence[str]) -> bool:
        return any(record in of for record in self.records)

    def varies(self, target: str) -> bool:
        return any(axis.target == target for axis in self.axes)

    def stream(self, index: int) -> int:
        """Number of the streams of random numbers of a run."""
        return index % self.runs if self.common_draws else index

    def values_at(self, index: int) -> list[float]:
        """Values of the axes."""
        rest, place = index // self.runs, [0] * len(self.group_size)
        for group in reversed(range(len(place))):
            rest, place[group] = divmod(rest, self.group_size[group])
        drawn = sum(not axis.values for axis in self.axes)
        numbers = iter(_core._uniforms(self.seed, self.stream(index), drawn))
        values = [
            axis.values[place[axis.group]] if axis.values else axis.between(next(numbers))
            for axis in self.axes
        ]
        of_machine = {a.key: x for a, x in zip(self.axes, values) if a.target == "scene"}
        for i, axis in enumerate(self.axes):
            if axis.relative:
                values[i] = of_machine.get(axis.key, axis.base) * (1.0 + values[i])
        return values

    def _scene_with(self, numbers: dict[str, float]) -> Any:
        if not numbers:
            return self.scene
        text = _core._with_numbers(self.scene_text, numbers, self.scene_file)
        return _core._parse_study_scene(text, self.scene_file)

    def setting_of(self, values: Sequence[float]) -> Setting:
        """Raises SceneError, ModelError or Error if these values make no scene."""
        knobs = dict(self.knobs)
        of: dict[str, dict[str, float]] = {"scene": {}, "observer": {}}
        for axis, value in zip(self.axes, values):
            if axis.target not in of:
                knobs[axis.target] = value
                continue
            of[axis.target][axis.key] = value
            # An entry off the diagonal of a symmetric matrix is there twice.
            if entry := re.fullmatch(r"(system\.[A-Z])\.(\d+)\.(\d+)", axis.key):
                of[axis.target][f"{entry[1]}.{entry[3]}.{entry[2]}"] = value
        machine = observer = self._scene_with(of["scene"])
        if of["observer"]:
            observer = self._scene_with(of["scene"] | of["observer"])
        if observer.f > machine.f:
            raise Error(
                "the observer has more coordinates than the machine; must be as many at most"
            )
        end = min(_core._end_of_inputs(machine), _core._end_of_inputs(observer))
        if knobs.get("duration", 0.0) > end:
            raise Error(
                f"the recorded input ends at t = {end:f}, before the study's duration; the "
                'duration must be shorter, or the scene must have outside = "zero" or "hold"'
            )
        knobs.setdefault("disturbance.jitter", machine.jitter)
        if modes := int(knobs.get("observer.modes", 0)):
            observer, machine = _core._in_modes(observer, modes), _core._in_modes(machine, 0)
        return Setting(machine, observer, knobs)

    @property
    def recorded(self) -> list[str]:
        """Names of the recorded columns."""
        names = [
            f"{estimator}.{record}"
            for estimator in self.estimators
            for record in self.of_estimator(estimator)
        ]
        names += [r for r in ("impacts", "impacts_per_period", "lyapunov") if r in self.records]
        if "attractor" in self.records:
            names += ["attractor.period", *(f"attractor.{name}" for name in self.coordinate_names)]
        return names + (self.coordinate_names if "poincare" in self.records else [])

    def of_estimator(self, estimator: str) -> list[str]:
        """Names of what is recorded of an estimator; of a replica only errors."""
        known = OF_ERRORS if estimator == "replica" else OF_ESTIMATORS
        return [record for record in known if record in self.records]

    @property
    def columns(self) -> list[str]:
        number = ["n"] if "poincare" in self.records else []
        axes = [axis.path for axis in self.axes]
        return ["index", "point", "run", *axes, *number, *self.recorded, "failure"]


def _leaves(node: Node, path: str = "") -> Iterator[tuple[str, Node]]:
    """Entries of [vary] with their paths."""
    for key, entry in node.value.items():
        full = f"{path}.{key}" if path else key
        if isinstance(entry.value, dict) and not entry.inline:
            yield from _leaves(entry, full)
        else:
            yield full, entry


class _Variations:
    """Reads [vary]."""

    def __init__(self, study: StudyFile, root: Table) -> None:
        self.study = study
        self.zips: list[str] = []  # name of the zip of each group; "": none
        vary = root.node.value["vary"]
        if not isinstance(vary.value, dict):
            root._raise(vary[1:3], "vary must be a table")
        leaves = sorted(_leaves(vary), key=lambda leaf: leaf[1][1:3])
        self.table = Table(study.file, vary, "vary", list(vary.value))
        for path, node in leaves:
            self._read(path, node)
        if (runs := float(study.points) * study.runs) > MOST_RUNS:
            most = _text(MOST_RUNS)
            root._raise(vary[1:3], f"vary has {_text(runs)} runs in all; must be at most {most}")
        for i, (path, node) in enumerate(leaves):
            self._check_in_scene(path, node, i)

    def _refuse(self, path: str, node: Node, message: str) -> NoReturn:
        self.table._raise(node[1:3], f"vary.{path} {message}")

    def _axis(self, path: str, node: Node) -> Axis:
        if path in KNOBS:
            return Axis(path, path)
        group = next((p for p in ("disturbance.", "start.") if path.startswith(p)), "")
        if group or "." not in path:
            knobs = [knob for knob in KNOBS if knob.startswith(group)]
            near = _near(path, knobs)
            known = f"must be a key of the scene or one of {', '.join(knobs)}"
            better = f"did you mean {near}?" if near else known
            self._refuse(path, node, f"is not known; {better}")
        if path.startswith("observer."):
            return Axis(path, "observer", path.removeprefix("observer."))
        return Axis(path, "scene", path)

    def _read(self, path: str, node: Node) -> None:
        study, axis, zipped = self.study, self._axis(path, node), ""
        if any(other.path == path for other in study.axes):
            self._refuse(path, node, "is there again; must be there once")
        if isinstance(node.value, dict):
            zipped = self._read_spread(axis, node)
        else:
            nodes = node.value if isinstance(node.value, list) else [node]
            for entry in nodes:
                if not _is_number(entry):
                    wanted = "a number, an array of numbers, or a table such as"
                    table = "{ linear = [0, 1], points = 5 }"
                    what = f"has an entry that is no finite number; must be {wanted} {table}"
                    self._refuse(path, entry, what)
            if not nodes:
                self._refuse(path, node, "is empty; must have a number at least")
            axis.values = [float(entry.value) for entry in nodes]
        self._check_limits(axis, node)
        if zipped and not axis.values:
            self._refuse(path, node, "is random; must be without zip")
        points = max(len(axis.values), 1)
        if zipped and zipped in self.zips:
            axis.group = self.zips.index(zipped)
            if (others := study.group_size[axis.group]) != points:
                what = f'has {points} points; must have {others}, as others of zip "{zipped}"'
                self._refuse(path, node, what)
        else:
            axis.group = len(study.group_size)
            study.group_size.append(points)
            self.zips.append(zipped)
        study.axes.append(axis)

    def _read_spread(self, axis: Axis, node: Node) -> str:
        """Returns the name of its zip."""
        kinds = ["values", "linear", "log", "relative"]
        keys = [*kinds, "points", "random", "zip"]
        table = Table(self.study.file, node, f"vary.{axis.path}", keys)
        given = [kind for kind in kinds if table.has(kind)]
        if not given:
            missing = "missing key values, linear, log or relative in"
            table.fail_here(f"{missing} vary.{axis.path}")
        if len(given) > 1:
            table.fail(given[1], f"and {given[0]} exclude each other")
        (kind,) = given
        numbers, random = table.numbers(kind), table.boolean("random")
        axis.logarithmic = kind == "log"
        ranged = random or table.has("points")
        if axis.logarithmic and not min(numbers) > 0.0:
            table.fail(kind, f"has {_text(min(numbers))}; must be > 0")
        if ranged and (kind == "values" or len(numbers) != 2):
            by = "random" if random else "points"
            table.fail(kind, f"has {len(numbers)} numbers; must be a range of two, with {by}")
        if random and table.has("points"):
            table.fail("points", "and random exclude each other; must be one of them")
        if not ranged and kind in ("linear", "log"):
            table.fail(kind, "is a range; must go with points = n or random = true")
        axis.low, axis.high = numbers[0], numbers[-1]
        if table.has("points"):
            n = table.integer("points", 1, 1, MOST_POINTS)
            inner = [axis.between(i / (n - 1)) for i in range(1, n - 1)]
            axis.values = [axis.low, *inner, axis.high][:n]
        elif not random:
            axis.values = numbers
        if kind == "relative":
            self._make_relative(axis, node)
        return table.string("zip", "")

    def _make_relative(self, axis: Axis, node: Node) -> None:
        study = self.study
        if axis.target not in ("scene", "observer"):
            what = "is relative, and is no key of a scene; must be linear, log or values"
            self._refuse(axis.path, node, what)
        base = _core._number_of(study.scene_text, axis.key, study.scene_file)
        if not math.isfinite(base):
            what = f"is relative; must be a number that {study.scene_file} gives"
            self._refuse(axis.path, node, what)
        axis.base = base
        if axis.target == "observer":
            axis.relative = True
            return
        axis.values = [base * (1.0 + value) for value in axis.values]
        axis.low, axis.high = base * (1.0 + axis.low), base * (1.0 + axis.high)

    def _check_limits(self, axis: Axis, node: Node) -> None:
        limits = KNOBS.get(axis.path, ANY)
        for value in axis.values or axis.ends:
            if not limits.allow(value):
                self._refuse(axis.path, node, f"has {_text(value)}; must be {limits}")
            f = self.study.scene.f
            if axis.target == "observer.modes" and (value % 1.0 or value > f or not axis.values):
                what = f"has {_text(value)}; must be whole numbers in 1..{f}"
                self._refuse(axis.path, node, what)

    def _check_in_scene(self, path: str, node: Node, i: int) -> None:
        """The least and the largest value must make a scene, with the first ones of the others."""
        study, axis = self.study, self.study.axes[i]
        if axis.target not in ("scene", "observer"):
            return
        if axis.target == "observer" and study.varies("observer.modes") and not study.scene.beam:
            beam = "the scene must be a [beam] then, whose modes are the same for both"
            self._refuse(path, node, f"varies with observer.modes; {beam}")
        values = study.values_at(0)
        ends = [axis.base * (1.0 + end) for end in axis.ends] if axis.relative else axis.ends
        for value in sorted(ends):
            values[i] = value
            try:
                study.setting_of(values)
            except SceneError as error:
                what = f"= {_text(value)}: {study.scene_file}: {error.message}"
                self._refuse(path, node, what)
            except Error as error:
                self._refuse(path, node, f"= {_text(value)}: {error}")


def _read_stroboscope(root: Table, study: StudyFile) -> None:
    keys = ["period", "transient", "periods", "longest", "coordinates"]
    table, most, f = root.table("machine", keys), 100_000_000, study.scene.f
    study.period = table.number("period", 0.0, POSITIVE)
    study.transient = table.integer("transient", 300, 0, most)
    study.periods = table.integer("periods", 200, 1, most)
    study.longest = table.integer("longest", 32, 1, most)
    names = [f"{letter}{i}" for letter in "qu" for i in range(1, f + 1)]
    study.coordinate_names = table.words("coordinates", names)
    if not table.has("coordinates"):
        study.coordinate_names = names
    elif not study.coordinate_names:
        table.fail("coordinates", "is empty; must name a coordinate at least")
    study.coordinates = [names.index(name) for name in study.coordinate_names]


def _check_completeness(root: Table, study: StudyFile) -> None:
    estimators = study.estimators
    of_estimators = study.records_any(OF_ESTIMATORS)
    filters = "the estimator timing, both or adaptive"
    if of_estimators and not estimators:
        root.fail("record", "has quantities of an estimator; must go with estimators = [...]")
    any_filter = any(estimator != "replica" for estimator in estimators)
    if study.records_any(OF_FILTERS) and not any_filter:
        what = "has nees, beyond_3_sigma or trusted, which a replica does not tell"
        root.fail("record", f"{what}; must go with {filters}")
    if "worse" in study.records and not (any_filter and "replica" in estimators):
        what = "has worse, which is against the replica; must go with the estimators replica and"
        root.fail("record", f"{what} timing, both or adaptive")
    if "adaptive" in estimators:
        if study.varies("observer.modes"):
            what = "has adaptive, which seeks keys of the scene; must be without it where"
            root.fail("estimators", f"{what} observer.modes varies")
        if why := _core._why_not_adaptive(study.scene):
            root.fail("estimators", f"has adaptive: {why}")
    if not of_estimators and estimators:
        what = "has nothing that is recorded of them; must be left out, or record one of"
        root.fail("estimators", f"{what} {', '.join(OF_ESTIMATORS)}")
    needs_duration = of_estimators or "impacts" in study.records
    if needs_duration and "duration" not in study.knobs and not study.varies("duration"):
        root.fail_here("missing key duration")
    recurrence = study.records_any(OF_RECURRENCE)
    if recurrence and not (study.period or _core._only_frequency(study.scene) > 0.0):
        what = "has quantities of a stroboscope, and the scene has not one frequency"
        root.fail("record", f"{what}; must go with machine.period")
    if (needs_duration or recurrence) and not _core._has_master(study.scene):
        root.fail("scene", "has no [master]; must say where the machine starts")


def _shipped(name: str, folder: Path | None) -> Path | None:
    file = folder / f"{name.removesuffix('.toml')}.toml" if folder and "/" not in name else None
    return file.resolve() if file and file.is_file() else None


def _found(given: str) -> str:
    """File of a study that is given by its file or by its name among the shipped ones."""
    if "/" in given or (os.path.exists(given) and not os.path.isdir(given)):
        return given
    scenes = scenes_folder()
    folder = scenes / "studies" if scenes else None
    if file := _shipped(given, folder):
        return str(file)
    if not folder:
        raise InputError(f"{given}: no such file")
    names = sorted(file.stem for file in folder.glob("*.toml"))
    near = _near(given.removesuffix(".toml"), names)
    better = f"did you mean {near}?" if near else f"must be one of {', '.join(names)}"
    raise InputError(f"{given}: no such file, and none of this name in {folder}; {better}")


def _contents(file: str | os.PathLike[str]) -> str:
    try:
        return _core._read_whole(file, LARGEST).decode()
    except UnicodeDecodeError as error:
        raise InputError(f"{os.fspath(file)}: {error}") from None


def read_study_file(given: str | os.PathLike[str]) -> StudyFile:
    """Reads and checks a study and its scene. Raises SceneError, with the place, or InputError."""
    file = _found(os.fspath(given))
    study = StudyFile(file, _contents(file))
    keys = ["name", "scene", "seed", "draws", "runs", "duration", "tick", "samples", "estimators"]
    keys += ["threshold", "record", "machine", "disturbance", "start", "vary"]
    root = Table(file, _node(_core._parse_toml(study.text, file)), "", keys)
    study.name = root.string("name", Path(file).stem)
    scene = root.string("scene")
    beside = Path(file).parent / scene
    found = beside if beside.is_file() else _shipped(scene, scenes_folder())
    if not found:
        wanted = "a scene file, seen from the study's folder, or the name of a scene that comes"
        root.fail("scene", f'is "{scene}"; must be {wanted} with Sprag')
    study.scene_file = str(found)
    study.scene_text = _contents(found)
    study.scene, study.remarks, inputs = _core._read_study_scene(found)
    study.inputs = [study.scene_file, *map(str, inputs)]

    most = 1_000_000_000
    study.seed = root.integer("seed", 1, 0, most)
    draws = root.string("draws", "independent")
    if draws not in ("independent", "common"):
        root.fail("draws", f'is "{draws}"; must be "independent" or "common"')
    study.common_draws = draws == "common"
    study.runs = root.integer("runs", 1, 1, most)
    study.samples = root.integer("samples", 1000, 2, 10_000_000)
    study.threshold = root.number("threshold", 0.0, POSITIVE)
    study.estimators = root.words("estimators", ESTIMATORS)
    study.records = root.words("record", RECORDS)
    _read_stroboscope(root, study)
    for path, limits in KNOBS.items():
        group, _, key = path.rpartition(".")
        if group == "observer":
            continue
        keys = [knob.removeprefix(f"{group}.") for knob in KNOBS if knob.startswith(f"{group}.")]
        table = root.table(group, keys) if group else root
        if table.has(key):
            study.knobs[path] = table.number(key, 0.0, limits)
    if root.has("vary"):
        _Variations(study, root)
    _check_completeness(root, study)
    digest = hashlib.blake2b(study.text.encode(), digest_size=8)
    for name in study.inputs:
        digest.update(_core._read_whole(name))
    study.hash = digest.hexdigest()
    return study


class StudyRuns:
    """A study that computes its rows. Several threads may call rows() at once."""

    def __init__(self, given: str | os.PathLike[str]) -> None:
        self.study = read_study_file(given)
        self._trials = _core._Trials()
        self._stopped = False

    @property
    def rows_of_run(self) -> int:
        """Rows of a run that does not fail."""
        return self.study.periods if "poincare" in self.study.records else 1

    @property
    def manifest(self) -> dict[str, Any]:
        """What the manifest says of the study."""
        study, axes = self.study, []
        for axis in study.axes:
            of: dict[str, Any] = {"path": axis.path}
            if axis.values:
                of["values"] = axis.values
            else:
                of |= {"random": [axis.low, axis.high], "logarithmic": axis.logarithmic}
            axes.append(of | ({"relative": True} if axis.relative else {}) | {"group": axis.group})
        return {
            "name": study.name,
            "compiler": _core._compiler,
            "hash": study.hash,
            "study": {"file": study.file, "text": study.text},
            "scene": {"file": study.scene_file, "text": study.scene_text},
            "points": study.points,
            "runs": study.runs,
            "columns": study.columns,
            "axes": axes,
            "group_size": study.group_size,
        }

    def stop(self) -> None:
        """Ends all calls of rows() after the runs that they complete."""
        self._stopped = True
        self._trials.stop()

    def rows(self, first: int, end: int) -> tuple[str, int, int]:
        """Lines of the runs first, ..., end - 1, the number of these runs, and of failed ones.

        There are fewer runs only after stop().
        """
        study = self.study
        if not 0 <= first <= end <= study.points * study.runs:
            raise ValueError("the study has no such runs")
        lines: list[str] = []
        failures = 0
        known: tuple[list[float], Setting] | None = None
        for index in range(first, end):
            values = study.values_at(index)
            rows: list[list[float]] = [[math.nan] * len(study.recorded)]
            failure = ""
            try:
                if study.recorded:
                    if known is None or known[0] != values:
                        known = values, study.setting_of(values)
                    rows = self._recorded(known[1], study.stream(index))
            except KeyboardInterrupt:
                if not self._stopped:
                    raise
                return "".join(lines), index - first, failures
            except (Error, ValueError) as error:
                failure = re.sub(r"[\x00-\x1f]", " ", str(error).replace(",", ";")) or "failed"
                failures += 1
            head = f"{index},{index // study.runs},{index % study.runs},"
            head += _core._csv_fields(values)
            for n, row in enumerate(rows, 0 if failure else 1):
                number = f"{n}," if "poincare" in study.records else ""
                lines.append(f"{head}{number}{_core._csv_fields(row)}{failure}\n")
            if self._stopped:
                return "".join(lines), index + 1 - first, failures
        return "".join(lines), end - first, failures

    def _recorded(self, setting: Setting, stream: int) -> list[list[float]]:
        """The recorded quantities: one row, or one for each n."""
        study, knobs, trials = self.study, setting.knobs, self._trials
        energies = knobs.get("start.machine", 0.0), knobs.get("start.replica")
        random = study.seed, stream
        machine, observer = trials.drawn(setting.machine, setting.observer, *random, *energies)
        row: list[float] = []
        if study.estimators or "impacts" in study.records:
            samples = study.samples if study.estimators else 2
            tick = knobs.get("tick", 0.0) if study.estimators else 0.0
            truth = trials.run(machine, knobs["duration"], tick, samples)
            group = "disturbance."
            given: dict[str, Any] = {
                k.removeprefix(group): x for k, x in knobs.items() if k.startswith(group)
            }
            followed = trials.follow(study.estimators, observer, truth, *random, **given)
            V = {name: of.V for name, of in zip(study.estimators, followed)}
            for name, of in zip(study.estimators, followed):
                replica = V.get("replica") if name != "replica" else None
                of_V = figures(of.V, replica, truth.interval, study.threshold)
                row += [
                    getattr(of if record in OF_FILTERS else of_V, record)
                    for record in study.of_estimator(name)
                ]
            row += [truth.closings] if "impacts" in study.records else []
        if not study.records_any(OF_RECURRENCE):
            return [row]
        wanted = study.period, study.transient, study.periods, study.longest
        found = trials.recurrence(machine, *wanted, "lyapunov" in study.records)
        single = [name for name in ("impacts_per_period", "lyapunov") if name in study.records]
        row += [getattr(found, name) for name in single]
        if "attractor" in study.records:
            row += [found.attractor_period, *(found.attractor[i] for i in study.coordinates)]
        if "poincare" not in study.records:
            return [row]
        return [[*row, *point] for point in found.points[:, study.coordinates].tolist()]
