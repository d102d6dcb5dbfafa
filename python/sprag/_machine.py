"""What pictures need of a machine: gaps, units of outputs, damping.

With the compiled part from a Scene. Without it, the program master_sim beside this package reads
the scene's file.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ._errors import Error, SceneError

Numbers = npt.NDArray[np.float64]


@dataclass
class Machine:
    """`gaps` maps t, of shape (n,), and q, of shape (n, f), to gaps of shape (n, m)."""

    name: str
    f: int
    m: int
    output_units: dict[str, str]  # by name; empty where not given
    decay_rate: float | None  # alpha of C = alpha M; without impacts V falls as exp(-alpha t)
    gaps: Callable[[Numbers, Numbers], Numbers]


def machine_of(scene: Any) -> Machine:
    """The machine of a :class:`sprag.Scene`."""
    model = scene.model
    units = {output.name: output.unit for output in model.outputs}
    return Machine(scene.name, scene.f, scene.m, units, _decay_rate(model.M, model.C), scene.gaps)


def rates_of_excitation(model: Any) -> list[float]:
    """Angular frequencies of forces and supports [rad/s]."""
    harmonics = [force.harmonic for force in model.forces] + [c.motion for c in model.contacts]
    return [of.frequency for of in harmonics if of.amplitude != 0.0 and of.frequency > 0.0]


def squared_frequencies(model: Any) -> Numbers:
    """Eigenvalues of M^-1 K, ascending [rad^2/s^2], f entries."""
    inverse = np.linalg.inv(np.linalg.cholesky(model.M))
    squares: Numbers = np.linalg.eigvalsh(inverse @ model.K @ inverse.T)
    return squares


def read_machine(file: str) -> Machine:
    """Reads the file of a scene. Raises SceneError."""
    try:
        from ._core import read_scene
    except ModuleNotFoundError:
        return _machine_by_program(file)
    return machine_of(read_scene(file))


def _decay_rate(M: Numbers, C: Numbers) -> float | None:
    alpha = float(np.trace(C) / np.trace(M))
    difference = np.linalg.norm(C - alpha * M)
    proportional = difference <= 1e-12 * min(np.linalg.norm(C), alpha * np.linalg.norm(M))
    return alpha if alpha > 0.0 and proportional else None


def _machine_by_program(file: str) -> Machine:
    command = [str(_master_sim()), file, "--machine"]
    done = subprocess.run(command, capture_output=True, text=True, errors="surrogateescape")
    if done.returncode != 0:
        raise SceneError(done.stderr.strip().removeprefix("master_sim: "))
    machine = json.loads(done.stdout)
    contacts = machine["contacts"]

    def gaps(t: Numbers, q: Numbers) -> Numbers:
        result = np.empty((len(t), len(contacts)))
        for i, contact in enumerate(contacts):
            if contact["recorded_motion"]:
                raise Error("gaps to a support in recorded motion need the package's compiled part")
            s = contact["motion"]
            shift = s["amplitude"] * np.cos(s["frequency"] * t + s["phase"])
            result[:, i] = q @ np.array(contact["w"]) + shift + contact["clearance"]
        return result

    units = {output["name"]: output["unit"] for output in machine["outputs"]}
    name, f, rate = machine["scene"], machine["coordinates"], machine["decay_rate"]
    return Machine(name, f, len(contacts), units, rate, gaps)


def _master_sim() -> Path:
    for folder in Path(__file__).absolute().parents:
        for programs in ("master_sim", "libexec/sprag"):
            program = folder / programs / "master_sim"
            if program.is_file():
                return program
    raise Error("a scene needs the package's compiled part, or the program master_sim")
