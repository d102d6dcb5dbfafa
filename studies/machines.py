"""What the studies in Python share: the package of the build tree, and machines drawn by a seed."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

ROOT = Path(__file__).resolve().parent.parent
# PYTHONPATH, for another version, comes first.
sys.path.append(str(ROOT / "build" / "python"))
import sprag as sprag  # noqa: E402

Array = npt.NDArray[Any]
Events = npt.NDArray[np.void]


def machines(name: str) -> list[sprag.Scene]:
    """A shipped scene; modes:N, the paper's beam with N modes; or drawn machines, KIND:FIRST-LAST
    for these seeds, where KIND is `single` (one contact) or `coupled` (two to four)."""
    kind, _, rest = name.partition(":")
    if not rest:
        return [certain(sprag.read_scene(name))]
    first, _, last = rest.partition("-")
    if kind == "modes":
        text = (ROOT / "scenes" / "paper_beam.toml").read_text(encoding="utf-8")
        return [
            sprag.parse_scene(text.replace("modes = 3 ", f"modes = {first} ")).replace(name=name)
        ]
    draw = {"single": single, "coupled": coupled}[kind]
    drawn = (draw(seed) for seed in range(int(first), int(last or first) + 1))
    return [scene for scene in drawn if scene is not None]


def certain(scene: sprag.Scene) -> sprag.Scene:
    """The scene; without an uncertainty of its own, with the energy of its error at the start."""
    if scene.uncertainty is not None:
        return scene
    V = float(energy(scene, scene.master, scene.replica)[0])
    return scene.replace(uncertainty=np.full(scene.f, max(V, 1e-12) / scene.f)) if V else scene


def energy(scene: sprag.Scene, of: Any, than: Any) -> Array:
    """V between the rows q, u of two motions."""
    rows = [np.atleast_2d(x) for x in (of.q, of.u, than.q, than.u)]
    return np.asarray(sprag.energies(scene, *rows).V)


def slowest_period(scene: sprag.Scene) -> float:
    """Of the natural modes [s]."""
    squares = np.linalg.eigvals(np.linalg.solve(scene.model.M, scene.model.K)).real
    return float(2.0 * math.pi / math.sqrt(min(w for w in squares if w > 1e-9)))


def disturbed(
    events: Events, rng: np.random.Generator, jitter: float, lost: float = 0.0, more: float = 0.0
) -> Events:
    """The events with normal errors of their times [s], where each contact's events keep their
    order, without a share `lost`, and with a share `more` of pulses that were none."""
    events = events[rng.random(len(events)) >= lost]
    shifted = np.maximum(events["t"] + jitter * rng.normal(size=len(events)), 0.0)
    for contact in np.unique(events["contact"]):
        of_contact = events["contact"] == contact
        shifted[of_contact] = np.sort(shifted[of_contact])
    events["t"] = shifted
    false = rng.choice(events, int(more * len(events)))
    false["t"] = rng.uniform(0.0, events["t"].max(initial=0.0), len(false))
    false["kind"] = sprag.ContactEventKind.PULSE
    return np.sort(np.concatenate([events, false]), order="t", kind="stable")


def scaled(
    scene: sprag.Scene, stiffness: float = 1.0, damping: float = 1.0, restitution: float = 0.0
) -> sprag.Scene:
    """The machine with multiples of K and C, and a restitution that differs."""
    model = scene.model
    contacts = [
        sprag.Contact(c.w, min(max(c.restitution + restitution, 0.0), 1.0), c.clearance, c.motion)
        for c in model.contacts
    ]
    other = sprag.Model(
        model.M, damping * model.C, stiffness * model.K, contacts, model.forces, model.law
    )
    return sprag.Scene(
        other, master=scene.master, replica=scene.replica, uncertainty=scene.uncertainty
    )


def coupled(seed: int) -> sprag.Scene | None:
    """Two to four coordinates and contacts, any restitution and law, moving supports, rigid
    motions."""
    rng = np.random.default_rng(seed)
    n, m = rng.integers(2, 5), rng.integers(2, 5)
    M = np.diag(rng.integers(1, 4, n).astype(float))
    springs = rng.integers(1, 6, n).astype(float)
    if rng.uniform() < 0.2:
        springs[0] = 0.0  # a rigid-body mode
    K = np.diag(springs)
    for i in range(1, n):
        K[i - 1, i - 1] += springs[i]
        K[i - 1, i] = K[i, i - 1] = -springs[i]
    root = rng.normal(size=(n, n))
    shaken = rng.uniform(0.3, 10.0)
    forces = []
    for _ in range(rng.integers(1, 3)):
        direction = rng.normal(size=n)
        shaking = (rng.uniform(0.05, 3.0), shaken * rng.integers(1, 5), rng.uniform(0.0, 6.28))
        forces.append(sprag.Force(direction, harmonic=sprag.Harmonic(*shaking)))
    q, u, off = 0.7 * rng.normal(size=n), 0.7 * rng.normal(size=n), rng.normal(size=n)
    restitution, contacts = float(rng.choice([0.0, 0.3, 0.5, 0.8])), []
    for _ in range(m):
        w = 1.2 * rng.normal(size=n)
        motion = sprag.Harmonic()
        if rng.uniform() < 0.7:
            motion = sprag.Harmonic(rng.uniform(0.01, 0.1), shaken, rng.uniform(0.0, 6.28))
        clearance = float(rng.choice([0.0, 0.05, 0.3]))
        contacts.append(sprag.Contact(np.sign(w @ q) * w, restitution, clearance, motion))
    law = str(rng.choice(["newton", "poisson"]))
    return start(
        sprag.Model(M, symmetric(0.15 * root @ root.T), K, contacts, forces, law), q, u, off, seed
    )


def single(seed: int) -> sprag.Scene | None:
    """One contact in a random direction, 1 to 6 coordinates by turns. Some machines are pressed
    against the contact, which then chatters, or have a moving support."""
    rng = np.random.default_rng(seed)
    f = (seed - 1) % 6 + 1
    M = definite(rng, rng.uniform(0.5, 2.0, f))
    omega = np.sort(rng.uniform(1.0, 12.0, f))
    L = np.linalg.cholesky(M)
    K = L @ definite(rng, omega**2) @ L.T
    C = rng.uniform(0.05, 0.4) * M + rng.uniform(0.0, 0.02) * K
    w = unit(rng.normal(size=f))
    shaken = rng.uniform(0.6, 2.2) * omega[0]
    shaking = sprag.Harmonic(rng.uniform(1.0, 6.0), shaken, rng.uniform(0.0, 6.0))
    forces = [sprag.Force(unit(rng.normal(size=f)), harmonic=shaking)]
    if rng.random() < 0.4:
        forces.append(sprag.Force(-w, constant=rng.uniform(0.0, 2.0)))
    moves = rng.uniform(0.0, 0.05) if rng.random() < 0.3 else 0.0
    motion = sprag.Harmonic(moves, shaken, rng.uniform(0.0, 6.0))
    clearance = rng.uniform(-0.05, 0.15)
    q = 0.3 * rng.normal(size=f)
    q += w * max(0.1 - float(w @ q + clearance), 0.0)
    contact = sprag.Contact(w, rng.uniform(0.3, 0.85), clearance, motion)
    off = 0.3 * rng.normal(size=f)
    return start(sprag.Model(M, symmetric(C), symmetric(K), [contact], forces), q, 0 * q, off, seed)


def unit(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v))


def definite(rng: np.random.Generator, values: Array) -> Array:
    """A symmetric matrix with these eigenvalues."""
    Q = np.linalg.qr(rng.normal(size=(len(values), len(values))))[0]
    return symmetric(Q @ np.diag(values) @ Q.T)


def symmetric(A: Array) -> Array:
    return (A + A.T) / 2.0


def start(model: sprag.Model, q: Array, u: Array, off: Array, seed: int) -> sprag.Scene | None:
    """The machine at q, u and its replica off by `off`; None if the machine starts in a support."""
    master, replica = sprag.State(q, u), sprag.State(q + off, 0.0 * u)
    try:
        return certain(sprag.Scene(model, master=master, replica=replica, name=f"drawn {seed}"))
    except ValueError:
        return None
