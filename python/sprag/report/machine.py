"""Section about the machine of a scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from .content import Grid, Section, count, quantity, rounded, scale
from .pictures import record_picture

if TYPE_CHECKING:
    from .._core import Contact, Force, Harmonic, Model, Scene
    from .inputs import Inputs

MOST_LISTED = 8
TITLE = "Machine and scene"


def machine_section(inputs: Inputs) -> Section:
    """What the scene says about the machine, its contacts and the observer's prior."""
    scene = inputs.scene
    if scene is None:
        return Section(
            TITLE,
            [
                "The compiled part of the Python package is not installed. So this page leaves out "
                "the rows about the machine, its contacts, its excitation and the prior."
            ],
        )
    grid = Grid(f"Scene {scene.name}", ["quantity", "value"])
    grid.rows += _machine(scene) + _prior(scene)
    section = Section(TITLE, [grid, _contacts(scene)])
    for record in scene.records:
        section.blocks.append(record_picture(record))
    section.blocks += inputs.remarks
    return section


def _machine(scene: Scene) -> list[list[str]]:
    rows: list[list[str]] = []
    beam = scene.beam
    if beam is not None:
        ratios = beam.damping_ratio
        rows += [
            ["machine", f"clamped-free Euler-Bernoulli beam, {count(beam.modes, 'mode')}"],
            ["length", quantity(beam.length, "m", 6)],
            ["bending stiffness EI", f"{rounded(beam.bending_stiffness, 6)} N m²"],
            ["mass per length", f"{rounded(beam.mass_per_length, 6)} kg/m"],
            (
                ["damping d", f"{rounded(beam.damping, 6)} N s/m²"]
                if ratios is None
                else ["damping ratios", _list(ratios)]
            ),
        ]
    else:
        rows += [["machine", "general system M, C, K"], ["coordinates", str(scene.f)]]
    rows.append(["natural frequencies", _frequencies(scene.model)])
    rows.append(["impact law", scene.model.law.capitalize()])
    motion = scene.excitation
    if motion is not None and motion.amplitude != 0.0:
        rows.append(["motion of the frame e(t)", f"{_harmonic(motion, 'm')}, {_hertz(motion)}"])
    for number, force in enumerate(scene.model.forces, start=1):
        if text := _force(force):
            rows.append([f"force {number}, times its direction", text])
    return rows


def _prior(scene: Scene) -> list[list[str]]:
    rows = [["jitter of event times", quantity(scene.jitter, "s")]]
    if scene.uncertainty is not None:
        rows.append(["uncertainty of the start, as energies", _list(scene.uncertainty)])
    if scene.sigma is not None:
        rows.append(["sigma of the start, q", _list(scene.sigma.q)])
        rows.append(["sigma of the start, u", _list(scene.sigma.u)])
    if scene.drift > 0.0:
        rows.append(["drift, energy per unit of time", rounded(scene.drift)])
    tolerance = scene.tolerance
    for name, value, unit in [
        ("event times", tolerance.time, "s"),
        ("restitutions", tolerance.restitution, ""),
        ("stiffness, relative", tolerance.stiffness, ""),
        ("damping, relative", tolerance.damping, ""),
        ("forces", tolerance.force, ""),
        ("clearances", tolerance.clearance, "m"),
    ]:
        if value > 0.0:
            rows.append([f"tolerance of {name}", quantity(value, unit).rstrip()])
    parameters = scene.parameters
    if parameters is not None:
        for key, sigma, considered in zip(parameters.keys, parameters.sigma, parameters.consider):
            text = rounded(sigma) + (", considered only" if considered else "")
            rows.append([f"sigma of {key}", text])
    return rows


def _contacts(scene: Scene) -> Grid:
    contacts = scene.model.contacts
    factor, unit = scale([contact.clearance for contact in contacts], "m")
    grid = Grid("Contacts", ["contact", f"clearance [{unit}]", "restitution", "support"])
    for number, contact in enumerate(contacts, start=1):
        grid.rows.append(
            [
                str(number),
                rounded(factor * contact.clearance, 6),
                rounded(contact.restitution, 6),
                _support(contact, scene.is_shaken),
            ]
        )
    if scene.positions:
        factor, unit = scale(scene.positions, "m")
        grid.head.insert(1, f"position [{unit}]")
        for row, position in zip(grid.rows, scene.positions):
            row.insert(1, rounded(factor * position, 6))
    return grid


def _support(contact: Contact, is_shaken: bool) -> str:
    if contact.motion.amplitude == 0.0 and not contact.recorded:
        return "moves with the shaken frame" if is_shaken else "rests"
    parts = []
    if contact.motion.amplitude != 0.0:
        parts.append(f"by {_harmonic(contact.motion, 'm')}")
    if contact.recorded:
        parts.append("by a recorded input")
    return f"moves {' and '.join(parts)}" + (", seen from the shaken frame" if is_shaken else "")


def _harmonic(harmonic: Harmonic, unit: str = "") -> str:
    phase = ""
    if harmonic.phase != 0.0:
        phase = f" {'-' if harmonic.phase < 0.0 else '+'} {rounded(abs(harmonic.phase), 6)}"
    amplitude = quantity(harmonic.amplitude, unit, 6).rstrip()
    return f"{amplitude} cos({rounded(harmonic.frequency, 8)} t{phase})"


def _hertz(harmonic: Harmonic) -> str:
    return f"{rounded(harmonic.frequency / (2.0 * math.pi))} Hz"


def _force(force: Force) -> str:
    parts = []
    if force.constant != 0.0:
        parts.append(rounded(force.constant, 6))
    if force.harmonic.amplitude != 0.0:
        parts.append(f"{_harmonic(force.harmonic)}, {_hertz(force.harmonic)}")
    if force.recorded:
        parts.append("a recorded input")
    return " + ".join(parts)


def _frequencies(model: Model) -> str:
    """Undamped natural frequencies, of K - omega^2 M."""
    inverse = np.linalg.inv(np.linalg.cholesky(model.M))
    squares = np.linalg.eigvalsh(inverse @ model.K @ inverse.T)
    hertz = np.sqrt(np.maximum(squares, 0.0)) / (2.0 * math.pi)
    listed = [f"{rounded(value)} Hz" for value in hertz[:MOST_LISTED]]
    return ", ".join(listed) + (", …" if len(hertz) > MOST_LISTED else "")


def _list(values: Sequence[float] | np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> str:
    listed = [rounded(float(value), 5) for value in values[:MOST_LISTED]]
    return ", ".join(listed) + (", …" if len(values) > MOST_LISTED else "")
