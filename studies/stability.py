#!/usr/bin/python3
"""Computes where methods for impacting machines fail and Sprag's do not, and draws it.

usage: stability.py FOLDER    writes FOLDER/stability.png
"""
import sys
from pathlib import Path
from typing import Any

import numpy as np

from machines import ROOT, Array, energy, sprag

BEAM = ROOT / "scenes" / "paper_beam.toml"
Curve = tuple[Array, Array]
G = np.array([[1.0, -0.8], [-0.8, 1.0]])  # of two coupled contacts


def least(b: Array) -> Array:
    """x with 0 <= x _|_ G x + b >= 0 for each row b of two entries."""
    det = np.linalg.det(G)
    both = np.stack([-G[1, 1] * b[:, 0] + G[0, 1] * b[:, 1], G[1, 0] * b[:, 0] - G[0, 0] * b[:, 1]])
    first = np.stack([np.maximum(-b[:, 0] / G[0, 0], 0.0), 0.0 * b[:, 0]], axis=1)
    second = np.stack([0.0 * b[:, 0], np.maximum(-b[:, 1] / G[1, 1], 0.0)], axis=1)
    x = np.where((first @ G + b)[:, 1:] >= 0.0, first, second)
    return np.where(np.all(both > 0.0, axis=0)[:, None], both.T / det, x)


def after_impact(law: str, epsilon: Array, gamma: Array) -> Array:
    """Velocities of both contacts, closed, after their impact; a row each."""
    if law == "Newton":
        return np.asarray(gamma + least(gamma * (1.0 + epsilon)) @ G)
    Lambda = (1.0 + epsilon) * least(gamma)
    return np.asarray(gamma + (Lambda + least(gamma + Lambda @ G)) @ G)


def newton() -> list[Curve]:
    """Velocity of a contact of a closed clutch, which the impact of the other one hits."""
    t, curves = np.array([0.0, 0.5, 0.5, 1.0]), []
    for law in ("Newton", "Poisson"):
        after = after_impact(law, np.full(2, 0.7), np.array([[-1.0, 0.3]]))[0, 1]
        curves.append((t, np.array([0.3, 0.3, after, after])))
    return curves


def criterion(difference: float) -> float:
    """Least eigenvalue of D G + G D."""
    epsilon = 0.5 + 0.5 * difference * np.array([1.0, -1.0])
    D = np.diag((1.0 - epsilon) / (1.0 + epsilon))
    return float(np.linalg.eigvalsh(D @ G + G @ D)[0])


def restitution(pairs: int = 100000) -> list[Curve]:
    """Largest growth of V at an impact, over pairs of velocities before it."""
    differences, curves = 0.05 * np.arange(20), []
    for law in ("Newton", "Poisson"):
        rng, largest = np.random.default_rng(1), []
        for difference in differences:
            epsilon = 0.5 + 0.5 * difference * np.array([1.0, -1.0])
            distance = np.exp(rng.uniform(np.log(1e-3), 0.0, (pairs, 1)))
            a = rng.uniform(-1.0, 1.0, (pairs, 2))
            b = a + distance * rng.uniform(-1.0, 1.0, (pairs, 2))
            V = [
                np.einsum("ki,ij,kj->k", apart, np.linalg.inv(G), apart)
                for apart in (b - a, after_impact(law, epsilon, b) - after_impact(law, epsilon, a))
            ]
            largest.append(np.max(V[1] / V[0]))
        curves.append((differences, np.array(largest)))
    return curves


def observed(scene: sprag.Scene, duration: float) -> tuple[Array, Array, Any]:
    """Time and V of the replica, and its states."""
    truth = sprag.simulate(scene, duration, tick=0.05)
    replica = sprag.observe(scene, truth.events, duration, tick=0.05, estimator="replica")
    return truth.t, energy(scene, truth, replica), replica


def damping() -> list[Curve]:
    text = BEAM.read_text(encoding="utf-8")
    scenes = [text.replace("damping = 0.17", f"damping = {d}") for d in (0.0, 0.17)]
    return [observed(sprag.parse_scene(scene), 100.0)[:2] for scene in scenes]


def persistent(duration: float = 60.0) -> list[Curve]:
    """V with a contact that a force presses until t = 30 and then pulls; its static remainder."""
    beam = sprag.read_scene(BEAM)
    w = beam.model.contacts[0].w
    force = sprag.Force(w, harmonic=sprag.Harmonic(-0.5, 2.0 * np.pi / 120.0, 0.0))
    contact = sprag.Contact(w, 0.7, 0.0)
    model = sprag.Model(beam.model.M, beam.model.C, beam.model.K, [contact], [force])
    rest = sprag.State(np.zeros(3), np.zeros(3))
    t, V, replica = observed(sprag.Scene(model, master=rest, replica=beam.replica), duration)
    pressed = t < 29.0
    compliance = w @ np.linalg.solve(beam.model.K, w)
    return [(t, V), (t[pressed], 0.5 * (replica.q[pressed] @ w) ** 2 / compliance)]


def chatter(limit: int = 400) -> list[Curve]:
    """Contact events of a bouncing ball: in a plain event loop, and of the master."""
    g, epsilon = 9.81, 0.7
    first = np.sqrt(2.0 / g)
    flights = 2.0 * first * epsilon ** np.arange(1, limit)
    plain = np.concatenate([[first], first + np.cumsum(flights)])
    one, none = np.eye(1), np.zeros((1, 1))
    weight = sprag.Force([1.0], constant=-g)
    model = sprag.Model(one, none, none, [sprag.Contact([1.0], epsilon, 0.0)], [weight])
    start = sprag.State([1.0], [0.0])
    events = sprag.simulate(sprag.Scene(model, master=start, replica=start), 3.0).events
    counts = np.arange(1, len(events) + 1)
    completed = np.append(events["t"], 3.0), np.append(counts, len(events))
    return [(plain, np.arange(1, limit + 1)), completed]


def grazing(scenes: int = 5000) -> list[Curve]:
    """Share of the short touches of free motions that a sign check at the ticks misses, and that
    the event search of the master misses."""
    rng, ticks = np.random.default_rng(868), np.array([1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 1e-1])
    missed, unseen, touches = np.zeros(len(ticks)), 0, 0
    for _ in range(scenes):
        omega = 2.0 * np.pi * rng.uniform(0.5, 3.0, 3)
        w = np.append(1.0, rng.uniform(-1.0, 1.0, 2))
        q, u = rng.uniform(-1.0, 1.0, 3), rng.uniform(-6.0, 6.0, 3)
        damped = np.sqrt(omega**2 - 0.05**2)

        def gap(t: Any) -> Any:
            turn = np.multiply.outer(t, damped)
            motion = q * np.cos(turn) + (u + 0.05 * q) / damped * np.sin(turn)
            return np.exp(-0.05 * t) * (motion @ w)

        low, high = 0.0, 1.0
        for _ in range(6):  # each grid is fifty times finer
            t = np.linspace(low, high, 101)
            k = int(np.argmin(gap(t)))
            low, high = t[max(k - 1, 0)], t[min(k + 1, 100)]
        lowest = t[k]
        clearance = -float(gap(lowest)) - 10.0 ** rng.uniform(-9.0, -2.0)
        if not 0.0 < lowest < 1.0 or gap(np.float64(0.0)) + clearance <= 0.0:
            continue
        touches += 1
        for j, tick in enumerate(ticks):
            missed[j] += np.all(gap(np.arange(0.0, 1.0 + tick / 2, tick)) + clearance >= 0.0)
        contact = sprag.Contact(w, 0.5, clearance)
        model = sprag.Model(np.eye(3), 0.1 * np.eye(3), np.diag(omega**2), [contact])
        start = sprag.State(q, u)
        scene = sprag.Scene(model, master=start, replica=start)
        events = sprag.simulate(scene, 1.0, tick=1.0).events
        unseen += len(events) == 0 or events["t"][0] > lowest + 1e-9
    return [(ticks, missed / touches), (ticks, np.full(len(ticks), unseen / touches))]


def activation() -> list[Curve]:
    """Work of the impulse of a Moreau-Jean step, over the velocity at its beginning."""
    gamma, curves = 0.25 * np.arange(-40, 41) / 40.0, []
    free = gamma - 0.25
    for active in (gamma > -1.0, gamma <= 0.0):
        after = np.where(active, np.maximum(free, -0.2 * gamma), free)
        curves.append((gamma, 0.5 * (after - free) * (after + gamma)))
    return curves


def steps() -> list[Curve]:
    """Energy of an oscillator in steps of omega h = 2.1."""
    turn, one, count, curves = 2.1 * np.array([[0.0, 1.0], [-1.0, 0.0]]), np.eye(2), 61, []
    methods = [one + turn]
    methods += [np.linalg.solve(one - x * turn, one + (1.0 - x) * turn) for x in (0.4, 0.5)]
    methods.append(np.array([[np.cos(2.1), np.sin(2.1)], [-np.sin(2.1), np.cos(2.1)]]))
    for method in methods:
        x = [np.linalg.matrix_power(method, k) @ [1.0, 0.0] for k in range(count)]
        curves.append((np.arange(count), np.log10(np.sum(np.square(x), axis=1))))
    return curves


def draw(folder: Path) -> None:
    from charts import BLUE, DASHED, GREEN, MUTED, VERMILION, grid, save

    wrong, right, other = {"color": VERMILION}, {"color": BLUE}, {"color": GREEN}
    limit, dots = {"color": MUTED, "linestyle": DASHED}, {"marker": "o", "markersize": 3}
    log = {"xlabel": "time [s]", "ylabel": "V [J]", "yscale": "log"}
    panels: list[tuple[str, list[Curve], list[tuple[str, Any]], dict[str, Any]]] = [
        (
            "Newton's law and a closed clutch",
            newton(),
            [("Newton", wrong), ("Poisson", right)],
            {"xlabel": "time [s]", "ylabel": r"$\gamma_2$ [m/s], must not be < 0"},
        ),
        (
            "Unlike restitution",
            restitution(),
            [("Newton", wrong | dots), ("Poisson", right | dots)],
            {"xlabel": r"$\epsilon_1 - \epsilon_2$", "ylabel": "largest growth of V at an impact"},
        ),
        ("No damping", damping(), [("C = 0", wrong), ("the paper's C", right)], log),
        (
            "A contact that stays closed",
            persistent(),
            [("V, released at t = 30 s", right), (r"$\frac{1}{2}\|c\|^2_K$ of (17)", limit)],
            log,
        ),
        (
            "Chatter of a bouncing ball",
            chatter(),
            [("plain event loop, no end", wrong), ("completed", right)],
            {"xlabel": "time [s]", "ylabel": "contact events", "ylim": (0, 200)},
        ),
        (
            "Grazing touches missed",
            grazing(),
            [("sign check at the ticks", wrong | dots), ("event search", right | dots)],
            {"xlabel": "tick [s]", "ylabel": "share missed", "xscale": "log"},
        ),
        (
            "Moreau-Jean: when is a contact active?",
            activation(),
            [("by its gap alone: gains energy", wrong), ("while it approaches", right)],
            {"xlabel": r"$\gamma_k$ [m/s]", "ylabel": "work of its impulse [J]"},
        ),
        (
            r"Steps beyond their limit, $\omega h$ = 2.1",
            steps(),
            [("explicit Euler", wrong), (r"$\theta$ = 0.4", other), (r"$\theta$ = 1/2", limit)]
            + [("exact flow", right)],
            {"xlabel": "steps", "ylabel": r"$\log_{10}$ of the energy", "ylim": (-2, 25)},
        ),
    ]
    figure, axes = grid(1800, 960, down=2, across=4)
    for ax, (title, curves, looks, frame) in zip(axes.flat, panels):
        for curve, (label, look) in zip(curves, looks):
            ax.plot(*curve, label=label, **look)
        ax.set(title=title, **frame)
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2))
    folder.mkdir(parents=True, exist_ok=True)
    save(figure, folder, "stability")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    draw(Path(sys.argv[1]))
