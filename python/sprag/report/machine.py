"""Section about the machine of a scene."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from .._command import counted
from .._machine import squared_frequencies
from .content import Block, Grid, facts, quantity, rounded, scale
from .pictures import record_picture

if TYPE_CHECKING:
    from .._core import Contact, Force, Harmonic, Model, Scene
    from .inputs import Inputs

MOST_LISTED = 8


def machine_blocks(inputs: Inputs) -> list[Block]:
    """What the scene says about the machine, its contacts and the observer's prior."""
    scene = inputs.scene
    if scene is None:
        return [
            "The compiled part of the Python package is not installed. So this page leaves out "
            "the rows about the machine, its contacts, its excitation and the prior."
        ]
    records = [record_picture(record) for record in scene.records]
    of_scene = facts(f"Scene {scene.name}", *_machine(scene), *_prior(scene))
    return [of_scene, _contacts(scene), *records, *inputs.remarks]


def _machine(scene: Scene) -> list[tuple[str, str]]:
    rows = [("machine", "general system M, C, K"), ("coordinates", str(scene.f))]
    beam, motion = scene.beam, scene.excitation
    if beam is not None:
        damping, ratios = f"{rounded(beam.damping, 6)} N s/m²", beam.damping_ratio
        rows = [
            ("machine", f"clamped-free Euler-Bernoulli beam, {counted(beam.modes, 'mode')}"),
            ("length", quantity(beam.length, "m", 6)),
            ("bending stiffness EI", f"{rounded(beam.bending_stiffness, 6)} N m²"),
            ("mass per length", f"{rounded(beam.mass_per_length, 6)} kg/m"),
            ("damping d", damping) if ratios is None else ("damping ratios", _list(ratios)),
        ]
    rows += [
        ("natural frequencies", _frequencies(scene.model)),
        ("impact law", scene.model.law.capitalize()),
    ]
    if motion is not None and motion.amplitude != 0.0:
        rows.append(("motion of the frame e(t)", f"{_harmonic(motion, 'm')}, {_hertz(motion)}"))
    for number, force in enumerate(scene.model.forces, start=1):
        rows.append((f"force {number}, times its direction", _force(force)))
    return rows


def _prior(scene: Scene) -> list[tuple[str, str]]:
    rows = [("jitter of event times", quantity(scene.jitter, "s"))]
    if scene.uncertainty is not None:
        rows.append(("uncertainty of the start, as energies", _list(scene.uncertainty)))
    if scene.sigma is not None:
        rows.append(("sigma of the start, q", _list(scene.sigma.q)))
        rows.append(("sigma of the start, u", _list(scene.sigma.u)))
    if scene.drift > 0.0:
        rows.append(("drift, energy per unit of time", rounded(scene.drift)))
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
            rows.append((f"tolerance of {name}", quantity(value, unit).rstrip()))
    parameters = scene.parameters
    if parameters is not None:
        for key, sigma, considered in zip(parameters.keys, parameters.sigma, parameters.consider):
            note = ", considered only" if considered else ""
            rows.append((f"sigma of {key}", rounded(sigma) + note))
    return rows


def _restitution(contact: Contact) -> str:
    by_speed = contact.restitution_by_speed
    if by_speed is None:
        return rounded(contact.restitution, 6)
    if "slope" in by_speed:
        return f"{rounded(by_speed['value'], 6)} - {rounded(-by_speed['slope'], 6)} v"
    points = zip(by_speed["value"], by_speed["at"])
    return ", ".join(f"{rounded(value, 6)} at {rounded(speed, 6)}" for value, speed in points)


def _contacts(scene: Scene) -> Grid:
    contacts = scene.model.contacts
    columns: list[tuple[str, list[str]]] = [
        ("contact", [str(number) for number in range(1, scene.m + 1)]),
        ("restitution", [_restitution(contact) for contact in contacts]),
        ("support", [_support(contact, scene.is_shaken) for contact in contacts]),
    ]
    for name, values in [
        ("clearance", [contact.clearance for contact in contacts]),
        ("position", scene.positions),
    ]:
        if len(values):
            factor, unit = scale(values, "m")
            texts = [rounded(factor * value, 6) for value in values]
            columns.insert(1, (f"{name} [{unit}]", texts))
    head, texts_of = zip(*columns)
    return Grid("Contacts", list(head), [list(row) for row in zip(*texts_of)])


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
    parts = [rounded(force.constant, 6)] if force.constant != 0.0 else []
    if force.harmonic.amplitude != 0.0:
        parts.append(f"{_harmonic(force.harmonic)}, {_hertz(force.harmonic)}")
    if force.recorded:
        parts.append("a recorded input")
    return " + ".join(parts)


def _frequencies(model: Model) -> str:
    """Undamped natural frequencies, of K - omega^2 M."""
    hertz = np.sqrt(np.maximum(squared_frequencies(model), 0.0)) / (2.0 * math.pi)
    return _list(hertz, 4, " Hz")


def _list(values: Iterable[float], digits: int = 5, unit: str = "") -> str:
    texts = [f"{rounded(float(value), digits)}{unit}" for value in values]
    return ", ".join(texts if len(texts) <= MOST_LISTED else [*texts[:MOST_LISTED], "…"])
