"""State of the page: collects the messages of a run and returns frames and curves as JSON.

It follows one session, by the same rules as an observer, and clears its data when the next session
starts. Independent of transport and clock; its memory is bounded.
"""

from __future__ import annotations

import json
import math
from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .._core import _ContactFollower, energies
from .history import History, Intervals, Keep, Window
from .machine import DrawnMachine, longest_period
from .messages import decoded, records

Numbers = npt.NDArray[np.float64]

MOST_COORDINATES = 12  # that have curves
MOST_PROVISIONAL = 4096
MOST_TRUTH = 512
MOST_UNPAIRED = 20_000
MOST_WAITING = 1000  # messages of a channel, between calls of settle()
# Silence [s] after which a message no longer counts as current.
CONTACTS_SILENCE, ESTIMATE_SILENCE, TRUTH_SILENCE, HEALTH_SILENCE = 0.5, 1.0, 0.5, 3.0
ANOTHER_ESTIMATE = 0.25  # s of silence after which an earlier time is accepted: a new observer
LARGEST_AGE = 10_000_000  # us, of a signed message that begins a session
SUSPICIONS = ("none", "model", "spurious event", "missing event")
ESTIMATORS = ("replica", "replica", "timing", "both")
MASTERS = ("awaited", "heard", "silent", "ended")
INPUTS = ("none", "heard", "silent")


@dataclass
class States:
    """n states of equal length as columns; sigma_* are nan without a filter."""

    raw: Any  # the messages
    tick: npt.NDArray[np.int64]
    t: Numbers
    q: Numbers  # (n, f), 0 where the message has fewer
    u: Numbers
    sigma_q: Numbers  # (n, f)
    sigma_g: Numbers  # (n, m)

    def after(self, t: float) -> States:
        """Those later than t and than all before them."""
        rising = np.maximum.accumulate(np.append(t, self.t))[:-1] < self.t
        return States(**{name: of[rising] for name, of in vars(self).items()})


def _padded(values: Any, columns: int, fill: float) -> Numbers:
    result = np.full((len(values), columns), fill)
    result[:, : values.shape[1]] = values
    return result


def _json(value: Any) -> str:
    try:
        return json.dumps(value, separators=(",", ":"), allow_nan=False)
    except ValueError:
        return json.dumps(_finite(value), separators=(",", ":"), allow_nan=False)


def _finite(value: Any) -> Any:
    """Numbers that are not finite are None."""
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    return value


def _drawn(values: Any) -> str:
    """A list of numbers with the digits of a float; several times as fast as json.dumps."""
    text = ("%.8g," * len(values))[:-1] % tuple(values.tolist())
    return "[" + text.replace("nan", "null").replace("-inf", "null").replace("inf", "null") + "]"


class Watch:
    """`now` of all methods is monotonic [s], the arrival of messages or the time of a replay."""

    def __init__(self, scene: Any, signed: bool = False, machine_time: bool = False) -> None:
        self.scene = scene
        self.f, self.m = scene.f, scene.m
        self.machine = DrawnMachine(scene)
        self.outputs = scene.model.outputs
        coordinates = (
            self.f if self.f <= MOST_COORDINATES or not self.outputs + [*range(self.m)] else 0
        )
        self.quantities = [(output.name, output.name) for output in self.outputs]
        self.quantities += [(f"g{i}", f"gap g{i} [m]") for i in range(1, self.m + 1)]
        self.quantities += [(f"q{i}", f"coordinate q{i}") for i in range(1, coordinates + 1)]
        self.coordinates = coordinates
        self.signed = signed
        self.follower = _ContactFollower(scene, signed, machine_time)
        self.record = scene.records[0] if scene.records else None
        self.of_others = self.misfits = 0
        self.last_utime = 0  # of the followed session
        self.health: Any = None
        self.arrived: dict[str, float] = {}
        self.speed = 1.0
        self.waiting: dict[str, list[tuple[bytes, float, int]]] = {}
        self._begin(None)

    def _begin(self, session: int | None) -> None:
        n = len(self.quantities)
        self.session = session
        self.estimates, self.truths = History(3 * n), History(n)
        self.output_bands = History(3 * max(len(self.outputs), 1))
        self.guaranteed = History(2 * n)
        self.bounds, self.energies, self.innovations = History(1), History(1), History(1)
        self.inputs = History(1)
        self.closures = [Intervals() for _ in range(self.m)]
        self.penetrating = Intervals()
        self.suspects: deque[dict[str, Any]] = deque(maxlen=1000)
        self.provisional: dict[float, Any] = {}  # after the last settled estimate, by time
        self.settled: Any = None
        self.latest: Any = None  # the latest provisional estimate
        self.truth: deque[Any] = deque(maxlen=MOST_TRUTH)
        # States and estimates that wait for each other: tick, t, q, u.
        self.unpaired: tuple[deque[Any], deque[Any]] = (deque(), deque())
        self.energy: dict[str, Any] | None = None
        self.innovation: dict[str, Any] | None = None
        self.parameters: Any = None
        self.inconsistencies = 0
        for channel in ("SPRAG_ESTIMATE", "SPRAG_TRUTH"):
            self.arrived.pop(channel, None)

    # Messages

    def take(
        self, channel: str, data: bytes, now: float, utime: int = 0, appended: bool = False
    ) -> None:
        """A valid message. Its effect is complete after settle()."""
        if channel == "SPRAG_CONTACTS":
            self._take_contacts(data, now, utime, appended)
        elif channel == "SPRAG_HEALTH":
            self.health = decoded(channel, data)
            self.arrived[channel] = now
        else:
            waiting = self.waiting.setdefault(channel, [])
            waiting.append((data, now, utime))
            if len(waiting) == MOST_WAITING:
                self.settle()

    def settle(self) -> None:
        """Takes the messages that wait, by channel: guaranteed bounds need their estimates."""
        waiting, self.waiting = self.waiting, {}
        for channel, take in (
            ("SPRAG_ESTIMATE", self._take_estimates),
            ("SPRAG_SETTLED", self._take_settled),
            ("SPRAG_TRUTH", self._take_truth),
            ("SPRAG_OUTPUTS", self._take_outputs),
            ("SPRAG_BOUNDS", self._take_bounds),
            ("SPRAG_PARAMETERS", self._take_parameters),
            ("SPRAG_INPUT", self._take_input),
        ):
            if followed := [item for item in waiting.get(channel, []) if self._follows(*item)]:
                take(channel, [data for data, _, _ in followed], followed[-1][1])

    def _follows(self, data: bytes, now: float, utime: int) -> bool:
        """Contact messages select the session. Before the first of them, any other message does."""
        session, sent = (int.from_bytes(data[i : i + 8], "big", signed=True) for i in (8, 16))
        if session == self.session:
            return True
        recent = abs(sent - utime) <= LARGEST_AGE and sent >= self.last_utime
        if self.session is not None or self.follower.sessions or (self.signed and not recent):
            self.of_others += 1
            return False
        self.last_utime = max(sent, self.last_utime)
        self._begin(session)
        return True

    def _take_contacts(self, data: bytes, now: float, utime: int, appended: bool) -> None:
        if self.session is None:
            self.settle()  # what arrived before may begin the session
        taken = self.follower.take(data, int(1e9 * now), utime, appended)
        if taken is None:
            return
        begins, session, self.speed, horizon, closed, events = taken
        if begins:
            self.settle()
            if session != self.session or closed is not None:
                self._begin(session)
        self.arrived["SPRAG_CONTACTS"] = now
        if closed is not None:
            for i, closures in enumerate(self.closures):
                closures.correct(i + 1 in closed, horizon)
        for t, contact, kind in events:
            self.closures[contact].add(t, kind)

    def _states(self, messages: list[bytes], of_estimates: bool) -> list[States]:
        """The messages whose machine has the scene's coordinates, or fewer for an estimate."""
        result = []
        for raw in records(messages, of_estimates):
            f = int(raw["f"][0])
            if f > self.f or (f < self.f and not of_estimates):
                self.misfits += len(raw)
                continue
            q, u = (_padded(raw[name], self.f, 0.0) for name in ("q", "u"))
            nothing = np.empty((len(raw), 0))
            sq, sg = (raw["sigma_q"], raw["sigma_g"]) if of_estimates else (nothing, nothing)
            sigma_q, sigma_g = _padded(sq, self.f, np.nan), _padded(sg[:, : self.m], self.m, np.nan)
            t, tick = raw["t"].astype(float), raw["tick"].astype(int)
            result.append(States(raw, tick, t, q, u, sigma_q, sigma_g))
        return result

    def _values(self, states: States) -> Numbers:
        """Of all quantities, (n, k)."""
        outputs = [(states.u if o.velocity else states.q) @ o.direction for o in self.outputs]
        gaps = self.scene.gaps(states.t, states.q)
        return np.column_stack([*outputs, gaps, states.q[:, : self.coordinates]])

    def _bands(self, states: States) -> Numbers:
        """Low, mean and high of all quantities, (n, 3 k). Only a filter has deviations."""
        mean = self._values(states)
        sigma = np.full_like(mean, np.nan)
        of_filter = states.raw["from_filter"] == 1
        known = np.column_stack([states.sigma_g, states.sigma_q[:, : self.coordinates]])
        sigma[of_filter, len(self.outputs) :] = known[of_filter]
        bands: Numbers = np.stack([mean - 2.0 * sigma, mean, mean + 2.0 * sigma], axis=2)
        return bands.reshape(len(mean), -1)

    def _depths(self, states: States) -> Numbers:
        """How deep each estimate is inside a support [m]; 0: not beyond its uncertainty.

        The estimate of an adaptive filter obeys its own supports, not those of the scene.
        """
        depth = -self.scene.gaps(states.t, states.q)
        allowed = 1e-9 * self.machine.drawing["length"] + np.zeros_like(depth)
        known = np.isfinite(states.sigma_g)
        allowed[known] += 4.0 * states.sigma_g[known]
        deepest: Numbers = np.where(depth > allowed, depth, 0.0).max(axis=1, initial=0.0)
        if self.parameters:
            deepest[states.raw["from_filter"] == 1] = 0.0
        return deepest

    def _take_estimates(self, channel: str, messages: list[bytes], now: float) -> None:
        for states in self._states(messages, True):
            silent = now - self.arrived.get(channel, -math.inf) > ANOTHER_ESTIMATE
            at = len(states.t) - 1 - int(np.argmax(states.t[::-1]))  # the last one of the latest
            if self.latest is None or states.t[at] >= self.latest["t"] or silent:
                self.latest = states.raw[at]
                self.arrived[channel] = now
            for t, raw in zip(states.t.tolist(), states.raw):
                if t > self.estimates.last_t:
                    self.provisional[t] = raw
        if len(self.provisional) > MOST_PROVISIONAL:
            # Equally spaced ones stay, so that they span the time since the last settled estimate.
            t = np.sort(np.fromiter(self.provisional, float))
            cell = np.floor((t - t[0]) / (t[-1] - t[0]) * MOST_PROVISIONAL / 2)
            keep = t[np.append(np.diff(cell) > 0, True)].tolist()
            self.provisional = {t: self.provisional[t] for t in keep}

    def _take_settled(self, channel: str, messages: list[bytes], now: float) -> None:
        for states in self._states(messages, True):
            self.arrived["SPRAG_ESTIMATE"] = max(now, self.arrived.get("SPRAG_ESTIMATE", now))
            states = states.after(self.estimates.last_t)
            if not len(states.t):
                continue
            self.estimates.add(states.t, self._bands(states))
            self.bounds.add(states.t, states.raw["bound"][:, None])
            self.settled = states.raw[-1]
            for t, depth in zip(states.t.tolist(), self._depths(states) > 0.0):
                if depth != self.penetrating.closed:
                    self.penetrating.add(t, 1 if depth else 2)
            last = states.t[-1]
            self.provisional = {t: raw for t, raw in self.provisional.items() if t > last}
            self.inconsistencies = int(self.settled["inconsistencies"])
            for raw in states.raw[np.flatnonzero(np.diff(states.raw["suspect_t"], prepend=-1.0))]:
                self._add_suspect(raw)
            self._add_innovations(states.raw)
            self._pair(1, states)

    def _add_suspect(self, raw: Any) -> None:
        t = float(raw["suspect_t"])
        if t >= 0.0 and (not self.suspects or self.suspects[-1]["t"] != t):
            contact = max(int(raw["suspect_contact"]), 1)
            suspicion = SUSPICIONS[raw["suspicion"]]
            self.suspects.append({"t": t, "contact": contact, "suspicion": suspicion})

    def _add_innovations(self, raw: Any) -> None:
        """Every estimate carries the last closing; each closing is taken once."""
        sigma = raw["sigma_filter_gap"]
        predicted = raw[(sigma > 0.0) & np.isfinite(sigma)]
        for one in predicted[np.diff(predicted["closing"], prepend=-np.inf) > 0.0]:
            t, ratio = float(one["closing"]), float(one["filter_gap"] / one["sigma_filter_gap"])
            if t <= self.innovations.last_t:
                continue
            self.innovations.add(np.array([t]), [[ratio]])
            contact = max(int(one["closing_contact"]), 1)
            self.innovation = {"t": t, "contact": contact, "ratio": ratio}

    def _take_truth(self, channel: str, messages: list[bytes], now: float) -> None:
        for states in self._states(messages, False):
            self.arrived[channel] = now
            states = states.after(self.truths.last_t)
            if len(states.t):
                self.truths.add(states.t, self._values(states))
                self.truth.extend(states.raw)
                self._pair(0, states)

    def _pair(self, side: int, states: States) -> None:
        """V of the instants that both sides have: times that agree to a relative 1e-9."""
        self.unpaired[side].extend(zip(states.tick.tolist(), states.t.tolist(), states.q, states.u))
        machine, estimate = self.unpaired
        pairs = []
        while machine and estimate:
            difference = machine[0][1] - estimate[0][1]
            if abs(difference) <= 1e-9 * abs(machine[0][1]):
                pairs.append((machine.popleft(), estimate.popleft()))
            else:
                (machine if difference < 0.0 else estimate).popleft()
        for one in (machine, estimate):
            while len(one) > MOST_UNPAIRED:
                one.popleft()
        if not pairs:
            return
        of = [np.array([pair[i][j] for pair in pairs]) for i in (0, 1) for j in (2, 3)]
        V = energies(self.scene, *of).V
        t = np.array([pair[0][1] for pair in pairs])
        self.energies.add(t, V[:, None])
        self.energy = {"k": pairs[-1][1][0], "t": float(t[-1]), "V": float(V[-1])}

    def _take_outputs(self, channel: str, messages: list[bytes], now: float) -> None:
        for sample in (decoded(channel, data) for data in messages):
            if sample.name != [output.name for output in self.outputs]:
                self.misfits += 1
            elif sample.settled == 1 and sample.t > self.output_bands.last_t:
                mean, sigma = np.array(sample.value), np.array(sample.sigma)
                band = np.column_stack([mean - 2.0 * sigma, mean, mean + 2.0 * sigma])
                self.output_bands.add(np.array([sample.t]), band.reshape(1, -1))

    def _take_bounds(self, channel: str, messages: list[bytes], now: float) -> None:
        """Used with the settled estimate of their tick: a band needs both."""
        for sample in (decoded(channel, data) for data in messages):
            others = [f"g{i + 1}" for i in range(self.m)] + [output.name for output in self.outputs]
            f = len(sample.name) - len(others)
            if not 0 <= f <= self.f or sample.name[f:] != others:
                self.misfits += 1
                continue
            mean = self.estimates.at(sample.t)
            if mean is None or sample.t <= self.guaranteed.last_t:
                continue
            q, g, outputs = np.split(np.array(sample.half_width), [f, f + self.m])
            missing = np.full(self.coordinates, np.nan)
            width = np.concatenate([outputs, g, np.append(q, missing)[: self.coordinates]])
            band = np.column_stack([mean[1::3] - width, mean[1::3] + width])
            self.guaranteed.add(np.array([sample.t]), band.reshape(1, -1))

    def _take_parameters(self, channel: str, messages: list[bytes], now: float) -> None:
        self.parameters = decoded(channel, messages[-1])

    def _take_input(self, channel: str, messages: list[bytes], now: float) -> None:
        if not self.machine.drawing["streamed"]:
            self.misfits += len(messages)
            return
        gain, delay = self.machine.drawing["gain"], self.machine.drawing["delay"]
        for sample in (decoded(channel, data) for data in messages):
            k = np.arange(sample.total - sample.n, sample.total)
            t = sample.t0 + k * sample.dt + delay
            value = gain * np.array(sample.value[: sample.n * sample.channels : sample.channels])
            new = t > self.inputs.last_t
            self.inputs.add(t[new], value[new, None])

    # The page

    def _lives(self, channel: str, now: float, silence: float) -> bool:
        return now - self.arrived.get(channel, -math.inf) <= silence

    def _shown_estimate(self, now: float) -> Any:
        """The last one not later than the machine's last state, to draw both at one instant."""
        latest = self.latest if self.latest is not None else self.settled
        if not self._lives("SPRAG_TRUTH", now, TRUTH_SILENCE) or latest is None:
            return latest
        if self.settled is not None and self.settled["t"] > latest["t"]:
            latest = self.settled
        end = self.truth[-1]["t"]
        if latest["t"] <= end:
            return latest
        before = max((t for t in self.provisional if t <= end), default=None)
        if before is not None:
            return self.provisional[before]
        return self.settled if self.settled is not None else latest

    def _shown_truth(self, estimate: Any, now: float) -> Any:
        if not self.truth or not self._lives("SPRAG_TRUTH", now, TRUTH_SILENCE):
            return None
        if estimate is None:
            return self.truth[-1]
        t = float(estimate["t"])
        nearest = self.truth[-1]
        for state in reversed(self.truth):  # their times rise
            if abs(state["t"] - t) > abs(nearest["t"] - t):
                break
            nearest = state
        tick = self.truth[-1]["t"] - self.truth[-2]["t"] if len(self.truth) > 1 else 0.0
        return nearest if abs(nearest["t"] - t) <= 3.0 * tick + 1e-9 * t else None

    def _runs_free(self, now: float) -> bool:
        """No contact messages arrive, either here or, by its health, at the observer."""
        if self.follower.sessions and not self._lives("SPRAG_CONTACTS", now, CONTACTS_SILENCE):
            return True
        current = self.health and not self.health.last and self.health.session == self.session
        known = current and self._lives("SPRAG_HEALTH", now, HEALTH_SILENCE)
        return bool(known and MASTERS[self.health.master] in ("silent", "ended"))

    def frame(self, now: float) -> str:
        """What the page shows at one instant."""

        def state(raw: Any) -> dict[str, Any] | None:
            if raw is None:
                return None
            tick, t = int(raw["tick"]), float(raw["t"])
            return {"tick": tick, "t": t, "q": raw["q"].tolist(), "u": raw["u"].tolist()}

        estimate = self._shown_estimate(now)
        truth = self._shown_truth(estimate, now)
        badge, estimator, from_filter, depth, t = "waiting", "unknown", False, 0.0, 0.0
        gaps = sigmas = true_gaps = sigma = None
        if estimate is not None:
            (shown,) = self._states([estimate.tobytes()], True)
            t, from_filter = float(shown.t[0]), bool(estimate["from_filter"])
            estimator = "adaptive" if self.parameters else ESTIMATORS[estimate["estimators"]]
            depth = float(self._depths(shown)[0])
            gaps = self.scene.gaps(shown.t, shown.q)[0]
            sigmas = shown.sigma_g[0] if from_filter else None
            sigma_q = estimate["sigma_q"].astype(float)
            if from_filter and len(sigma_q) and np.isfinite(sigma_q).all():
                sigma = self.machine.sigma(sigma_q)
            if self._lives("SPRAG_ESTIMATE", now, ESTIMATE_SILENCE):
                badge = "filter" if from_filter else "replica"
                badge = "free" if self._runs_free(now) else badge
        elif truth is not None:
            t = float(truth["t"])
        if truth is not None:
            (real,) = self._states([truth.tobytes()], False)
            true_gaps = self.scene.gaps(real.t, real.q)[0]
        contacts = [
            {
                "gap": None if gaps is None else float(gaps[i]),
                "sigma": None if sigmas is None else float(sigmas[i]),
                "truth": None if true_gaps is None else float(true_gaps[i]),
                "y": self.machine.stop(i, t),
                "closed": closures.closed,
                "events": closures.events,
                "last": closures.last,
            }
            for i, closures in enumerate(self.closures)
        ]
        p = self.parameters
        parameters = zip(p.key, p.value, p.sigma) if p else ()
        shape = self.machine.shape
        bound = math.inf if self.settled is None else float(self.settled["bound"])
        frame = {
            "session": None if self.session is None else str(self.session),
            "badge": badge,
            "from_filter": from_filter,
            "penetration": depth,
            "estimator": estimator,
            "now": state(self.latest),
            "settled": state(self.settled),
            "truth": state(self.truth[-1]) if self.truth else None,
            "energy": self.energy,
            "innovation": self.innovation,
            "bound": bound if math.isfinite(bound) else None,
            "speed": self.speed,
            "inconsistencies": self.inconsistencies,
            "suspect": self.suspects[-1] if self.suspects else None,
            "machine": {
                "t": t,
                "base": self.machine.base(t),
                "estimate": None if estimate is None else shape(estimate["q"].astype(float), t),
                "sigma": sigma,
                "truth": None if truth is None else shape(truth["q"].astype(float), truth["t"]),
            },
            "contacts": contacts,
            "parameters": [{"key": k, "value": v, "sigma": s} for k, v, s in parameters],
        }
        return _json(frame)

    def extent(self) -> tuple[float, float]:
        """The first and the last time of all curves."""
        histories = (self.estimates, self.truths)
        first = min([h.first_t() for h in histories] + list(self.provisional))
        last = max([h.last_t for h in histories] + list(self.provisional))
        return (first, last) if first <= last else (0.0, 0.0)

    def curves(self, name: str, window: Window) -> str:
        """Curves of a quantity, closures and energies in a window."""
        names = [quantity[0] for quantity in self.quantities]
        k = names.index(name) if name in names else 0
        is_output = k < len(self.outputs)
        history = self.output_bands if is_output else self.estimates
        band: list[Keep] = ["least", "both", "greatest"]
        estimate = history.thinned(window, [3 * k, 3 * k + 1, 3 * k + 2], band)
        later = [t for t in self.provisional if max(history.last_t, window.start) < t <= window.end]
        if later:
            # Provisional estimates continue the curve after the last settled estimate.
            later = sorted(later)[:: 1 + len(later) // (2 * window.pixels)]
            parts = self._states([self.provisional[t].tobytes() for t in later], True)
            rows = np.concatenate([self._bands(part) for part in parts])[:, 3 * k : 3 * k + 3]
            estimate = tuple(map(np.append, estimate, (np.array(later), *rows.T)))

        edges: list[Keep] = ["least", "greatest"]
        both: list[Keep] = ["both"]
        guaranteed = self.guaranteed.thinned(window, [2 * k, 2 * k + 1], edges)
        all_curves = {
            "estimate": (estimate, ["low", "mean", "high"]),
            "guaranteed": (guaranteed, ["low", "high"]),
            "truth": (self.truths.thinned(window, [k], both), ["value"]),
            "energy": (self.energies.thinned(window, [0], both), ["V"]),
            "bound": (self.bounds.thinned(window, [0], both), ["B"]),
            "innovation": (self.innovations.thinned(window, [0], both), ["ratio"]),
            "input": (self._input(window), ["value"]),
        }
        first, last = self.extent()
        rest = {
            "from": window.start,
            "to": window.end,
            "first": first,
            "last": last,
            "quantity": names[k],
            "raster": [closures.thinned(window) for closures in self.closures],
            "penetrating": self.penetrating.thinned(window),
            "suspects": [s for s in self.suspects if window.start <= s["t"] <= window.end],
        }
        texts = [_json(rest)[1:-1]]
        for curve_name, ((t, *values), columns) in all_curves.items():
            columns_text = [f'"t":{_json(t.tolist())}']
            columns_text += [f'"{c}":{_drawn(value)}' for c, value in zip(columns, values)]
            texts.append(f'"{curve_name}":{{{",".join(columns_text)}}}')
        return "{" + ",".join(texts) + "}"

    def _input(self, window: Window) -> tuple[Numbers, ...]:
        if self.record is None or self.machine.drawing["streamed"]:
            return self.inputs.thinned(window, [0], ["both"])
        t, values = self.record.t, self.record.values
        first = max(int(np.searchsorted(t, window.start, "right")) - 1, 0)
        end = int(np.searchsorted(t, window.end, "right"))
        t, values = t[first:end], values[first:end]
        each = max(1, len(t) // window.pixels)
        if each == 1:
            return t, values
        at = np.arange(0, len(t), each)
        least, greatest = np.minimum.reduceat(values, at), np.maximum.reduceat(values, at)
        ends = np.append(at[1:], len(t)) - 1
        times = np.column_stack([t[at], t[ends]]).ravel()
        return times, np.column_stack([least, greatest]).ravel()

    def description(self, replay_speed: float | None) -> str:
        """What does not change: the first message to a page has it."""
        machine, label = self.machine, None
        if self.record:
            label = f"{self.record.of} [unit of the force]"
            if self.record.of == "excitation":
                kinds = ("acceleration [m/s^2]", "displacement [m]")
                label = f"excitation {kinds[self.record.displacement]}"
        text = {
            "name": self.scene.name,
            "machine": machine.kind,
            "coordinates": self.f,
            "places": machine.places.tolist(),
            "names": machine.names,
            "stops": machine.stops,
            "quantities": [{"name": name, "label": label} for name, label in self.quantities],
            "input": label,
            "period": longest_period(self.scene.model),
            "replay": replay_speed is not None,
            "speed": replay_speed,
        }
        return _json(text)

    def health_text(self, now: float) -> str:
        """The observer's condition, and the messages received here."""
        observer: dict[str, Any] | None = None
        if health := self.health:
            quantiles = ("p50", "p99", "max")
            left_out = ("cause", "causes", "estimate", "session", "utime")
            names = [name for name in health.__slots__ if not name.endswith(quantiles)]
            observer = {name: getattr(health, name) for name in names if name not in left_out}
            observer |= {
                "age": now - self.arrived["SPRAG_HEALTH"],
                "last": health.last == 1,
                "master": MASTERS[health.master],
                "input": INPUTS[health.input],
                "refused": dict(zip(health.cause, health.refused)),
            }
            for name in ("latency", "lateness"):
                observer[name] = {q: getattr(health, f"{name}_{q}") for q in quantiles}
        here = {
            "messages": self.follower.received,
            "lost_messages": self.follower.lost,
            "of_others": self.of_others,
            "misfits": self.misfits + self.follower.misfits,
        }
        return _json({"observer": observer, "here": here})
