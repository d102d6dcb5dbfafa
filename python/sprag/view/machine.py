"""Drawing of a scene's machine: heights of its shape at fixed places, and of its stops.

A beam is drawn as its deflection along its length. A general system is drawn by its nodes, if its
outputs name at least two displacements, or one and it has more coordinates than a chain shows well:
a node for each such output and for each contact at none of them. Rotations of a finite-element
model then share no axis with displacements. Any other system is a chain of its coordinates.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from .._core import _drawing_of, beam_contact
from .._machine import rates_of_excitation, squared_frequencies

Numbers = npt.NDArray[np.float64]

BEAM_PLACES = 64
LONGEST_CHAIN = 12


def longest_period(model: Any) -> float | None:
    """Period of the excitation, else of the slowest vibration [s]. None: nothing vibrates."""
    rates = rates_of_excitation(model)
    if not rates:
        squares = squared_frequencies(model)  # those below rounding are rigid motion
        rates = [math.sqrt(s) for s in squares if s > 1e-12 * np.abs(squares).max()]
    return 2.0 * math.pi / min(rates) if rates else None


def _multiple(w: Numbers, d: Numbers) -> float:
    """s of w = s d; 0 if they are not parallel."""
    s = float(w @ d / (d @ d))
    return s if np.linalg.norm(w - s * d) <= 1e-9 * np.linalg.norm(w) else 0.0


class DrawnMachine:
    """`kind` is beam, nodes or chain; `places` are across the picture, `stops` as for the page.

    `weights` are the derivatives of the gaps with respect to the height of the shape.
    """

    def __init__(self, scene: Any) -> None:
        self.contacts = scene.model.contacts
        self.names: list[str] = []
        self.stops: list[dict[str, Any]] = []
        self.weights: list[float] = []
        self.base_of: Any = None  # moving support whose motion is that of the ground
        self.drawing = _drawing_of(scene)
        displacements = [o for o in scene.model.outputs if not o.velocity and o.direction.any()]
        if scene.beam:
            self._draw_beam(scene)
        elif (
            len(displacements) >= 2
            or (displacements and scene.f > LONGEST_CHAIN)
            or self._may_have_rotations()
        ):
            self._draw_nodes(displacements)
        else:
            self._draw_chain(scene)

    def _may_have_rotations(self) -> bool:
        """Springs between displacements alone make no positive entry of K off the diagonal."""
        K = np.array(self.drawing["K"])
        rounding = 1e-9 * np.abs(K).max()
        np.fill_diagonal(K, 0.0)
        return len(K) > LONGEST_CHAIN and bool(K.max() > rounding)

    def _add_stop(self, across: float, weight: float, other: float | None = None) -> None:
        self.stops.append({"across": across, "side": -1 if weight > 0.0 else 1, "other": other})
        self.weights.append(weight)

    def _draw_beam(self, scene: Any) -> None:
        def shape(x: float) -> Numbers:
            of_contact: Numbers = beam_contact(scene.beam, x, 0.0).w
            return of_contact

        self.kind = "beam"
        self.places = np.arange(BEAM_PLACES + 1) * scene.beam.length / BEAM_PLACES
        self.shapes = np.array([np.zeros(scene.f), *(shape(float(x)) for x in self.places[1:])])
        for contact, x in zip(self.contacts, scene.positions):
            self._add_stop(x, 1.0 if contact.w @ shape(x) > 0.0 else -1.0)
        moving = (i for i, c in enumerate(self.contacts) if c.motion.amplitude != 0.0)
        self.base_of = next(moving, None)

    def _draw_nodes(self, displacements: list[Any]) -> None:
        self.kind = "nodes"
        directions = [output.direction for output in displacements]
        self.names = [output.name for output in displacements]
        for i, contact in enumerate(self.contacts):
            at = next((k for k, d in enumerate(directions) if _multiple(contact.w, d)), None)
            if at is None:
                at = len(directions)
                directions.append(contact.w)
                self.names.append(f"contact {i + 1}")
            self._add_stop(at + 1.0, _multiple(contact.w, directions[at]))
        self.shapes = np.array(directions)
        self.places = np.arange(1.0, len(directions) + 1)

    def _draw_chain(self, scene: Any) -> None:
        """Without coordinates that a shaken frame does not move, unless a contact is there."""
        self.kind = "chain"
        given = scene.kept.Phi if scene.kept else np.eye(scene.f)
        influence = self.drawing["influence"]
        at_contact = {int(np.argmax(np.abs(w))) for w in self.drawing["w"]}
        chain = [
            i for i in range(len(given)) if influence is None or influence[i] or i in at_contact
        ]
        self.shapes = np.array(given)[chain]
        self.places = np.array(chain) + 1.0
        self.names = [f"q{i + 1}" for i in chain]
        for w in self.drawing["w"]:
            # Between the two coordinates with the largest entries.
            first = int(np.argmax(np.abs(w)))
            others = np.abs(w)
            others[first] = 0.0
            other = float(np.argmax(others) + 1) if others.any() else None
            self._add_stop(first + 1.0, float(w[first]), other)

    def support(self, contact: int, t: float) -> float:
        motion = self.contacts[contact].motion
        return float(motion.amplitude * math.cos(motion.frequency * t + motion.phase))

    def base(self, t: float) -> float:
        """Height of the ground's motion, which is added to all heights."""
        if self.base_of is None:
            return 0.0
        return -float(self.stops[self.base_of]["side"]) * self.support(self.base_of, t)

    def shape(self, q: Numbers, t: float) -> list[float]:
        """Heights at the places; missing coordinates count as zero."""
        heights: list[float] = (self.shapes[:, : len(q)] @ q + self.base(t)).tolist()
        return heights

    def sigma(self, sigma_q: Numbers) -> list[float]:
        """Standard deviations of the heights, with independent errors of the coordinates."""
        squares = self.shapes[:, : len(sigma_q)] ** 2 @ sigma_q**2
        deviations: list[float] = np.sqrt(squares).tolist()
        return deviations

    def stop(self, contact: int, t: float) -> float | None:
        """Height at which the gap is 0; None for a contact between two coordinates."""
        if self.stops[contact]["other"] is not None:
            return None
        gap_at_0 = self.support(contact, t) + float(self.contacts[contact].clearance)
        return self.base(t) - gap_at_0 / self.weights[contact]
