"""Studies and tolerances, which the installed programs of Sprag compute."""

from __future__ import annotations

import collections.abc
import json
import os
import pathlib
import shutil
import subprocess
import tempfile
from typing import Any

import numpy as np
import numpy.typing as npt

from ._core import Scene, to_toml
from ._errors import Error, InputError
from ._studies import Study, read_study


def _command() -> str:
    """The command `sprag`: of the build tree or the installation of this package, else of PATH."""
    package = pathlib.Path(__file__).resolve().parent
    for candidate in [package.parents[1] / "sprag", *(p / "bin" / "sprag" for p in package.parents)]:
        if candidate.is_file() and os.access(candidate, os.X_OK):
            return str(candidate)
    found = shutil.which("sprag")
    if found is None:
        raise Error("the command sprag is not installed; a package by pip has the library alone")
    return found


def _run(*arguments: str | os.PathLike[str]) -> str:
    command = [_command(), *(str(argument) for argument in arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode == 2:
        raise InputError(done.stderr.strip())
    if done.returncode != 0:
        raise Error(done.stderr.strip())
    return done.stdout


def run_study(
    study: str | os.PathLike[str], output: str | os.PathLike[str], *, jobs: int | None = None
) -> Study:
    """Runs a study file into the folder `output` by the program `sprag study`, and reads its rows.

    A study that was interrupted continues. jobs: number of threads, None: one for each core. Raises
    InputError for a wrong study file, and Error if the programs are not installed or a run fails.
    """
    threads = [] if jobs is None else ["--jobs", str(jobs)]
    _run("study", study, "--output", output, *threads)
    return read_study(output)


class Tolerances:
    """Largest deviations for which V, the energy of the error, stays below a target.

    limits is an array with the fields what ("jitter", ..., or a key of the scene file), estimator,
    amount, unit and kind: "within"; "beyond_all" and "below_all": the limit is more, or less, than
    all amounts that were tried, of which amount is the largest or the least; "never": V stays above
    the target without any deviation, and amount is nan. target and motion_energy are energies.
    report has all figures, as `sprag tolerance --json` prints them.
    """

    def __init__(self, report: dict[str, Any]) -> None:
        self.report = report
        self.target = float(report["target"])
        self.motion_energy = float(report["motion_energy"])
        rows = [
            (of["what"], estimator, limit.get("amount") or np.nan, of["unit"], limit["kind"])
            for of in report["disturbances"]
            for estimator, limit in of["tolerance"].items()
        ]
        fields = [("what", "U40"), ("estimator", "U8"), ("amount", "f8"), ("unit", "U24")]
        self.limits: npt.NDArray[np.void] = np.array(rows, dtype=[*fields, ("kind", "U12")])

    def __repr__(self) -> str:
        return f"<Tolerances: {len(self.limits)} limits for V below {self.target:g}>"


def tolerance(
    scene: Scene | str | os.PathLike[str],
    *,
    target: float | None = None,
    duration: float | None = None,
    jitter: float | None = None,
    runs: int | None = None,
    estimators: collections.abc.Sequence[str] = (),
    jobs: int | None = None,
) -> Tolerances:
    """Finds the tolerances of a scene by the program `sprag tolerance`.

    scene: a file, the name of a scene that comes with Sprag, or a Scene, whose parameters then have
    the keys of a [system]. target: of V, None: 1e-4 of the energy of the motion; duration [s] and
    runs of each amount; jitter [s] besides a deviation; estimators: "replica", "timing", "both" or
    "adaptive". Raises InputError for a wrong scene, and Error if the programs are not installed or a
    run fails.
    """
    options = {
        "--target": target,
        "--duration": duration,
        "--jitter": jitter,
        "--runs": runs,
        "--jobs": jobs,
        "--estimator": ",".join(estimators) or None,
    }
    given = [
        part
        for name, value in options.items()
        if value is not None
        for part in (name, value if isinstance(value, str) else repr(value))
    ]
    if not isinstance(scene, Scene):
        return Tolerances(json.loads(_run("tolerance", scene, "--json", *given)))
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "scene.toml"
        file.write_text(to_toml(scene), encoding="utf-8")
        return Tolerances(json.loads(_run("tolerance", file, "--json", *given)))
