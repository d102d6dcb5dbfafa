"""Plays a recording in place of the bus, at a selectable speed.

Where a recording has contacts without estimates, the program observer runs along and writes its
states into a pipe.
"""

from __future__ import annotations

import asyncio
import math
import subprocess
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from .._command import say
from .._core import _Log, read_events
from .._errors import Error, InputError
from .messages import encoded
from .server import Stage
from .watch import Watch

# Takes channel, data, arrival [s], its wall time [us] and whether a recording was appended there.
Receive = Callable[[str, bytes, float, int, bool], float | None]

STEP = 1.0 / 60.0  # s of wall time, for an events file
STEPS_WITHOUT_WAITING = 1000  # for a whole events file, unpaced
LONGEST_PAUSE = 3600.0  # s of a log; a longer one means that its clock was set
SERVED_EVERY = 0.02  # s of wall time
MOST_RECORDS = 120  # of a contact message


def is_lcm_log(file: str) -> bool:
    """By its first bytes, or by its name if it is damaged there. Raises InputError."""
    try:
        with open(file, "rb") as opened:
            first = opened.read(4)
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}") from None
    return first == b"\xed\xa1\xda\x01" or file.endswith((".lcmlog", ".lcm"))


def _program(name: str) -> Path:
    for folder in Path(__file__).absolute().parents:
        for place in (f"{name}/{name}", f"libexec/sprag/{name}"):
            if (folder / place).is_file():
                return folder / place
    raise Error(f"a recording without estimates needs the program {name}")


class Pace:
    """Waits until a time of the recording [s from its start], at its speed."""

    def __init__(self, stage: Stage) -> None:
        self.stage, self.speed = stage, stage.speed or 1.0
        self.start = self.served = time.monotonic()

    async def wait(self, elapsed: float) -> None:
        while math.isfinite(self.speed):
            now = self.speed * (time.monotonic() - self.start)
            self.stage.now = min(now, elapsed)
            if now >= elapsed:
                break
            await asyncio.sleep(min((elapsed - now) / self.speed, SERVED_EVERY))
        self.stage.now = elapsed
        if time.monotonic() - self.served > SERVED_EVERY:
            await asyncio.sleep(0)  # the page is served meanwhile
            self.served = time.monotonic()


class OwnObserver:
    """Estimates of `observer --replay`, row by row as its states file has them."""

    def __init__(self, process: asyncio.subprocess.Process, scene: Any) -> None:
        assert process.stdout and process.stderr
        self.process, self.scene, self.lines = process, scene, process.stdout
        self.said = asyncio.create_task(process.stderr.read())
        self.names: list[str] = []
        self.row: dict[str, float] = {}  # the next one; empty after the last one
        self.k, self.sessions = -1.0, 0  # of the last estimate

    @classmethod
    async def start(cls, scene: Any, options: Any) -> OwnObserver:
        command = [str(_program("observer")), options.scene, "--replay", options.replay]
        command += ["--tick", repr(options.tick), "--states", "/dev/stdout"]
        command += ["--key", options.key] if options.key else []
        process = await asyncio.create_subprocess_exec(
            *command, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        observer = cls(process, scene)
        observer.names = (await observer.lines.readline()).decode().strip().split(",")
        await observer._next()
        return observer

    async def _next(self) -> None:
        line = (await self.lines.readline()).decode()
        self.row = dict(zip(self.names, map(float, line.split(",")))) if line else {}

    async def settle(self, horizon: float, watch: Watch, now: float) -> None:
        """Passes the estimates of the followed session up to `horizon` [s] to the watch."""
        if watch.sessions != self.sessions:
            self.sessions, self.k = watch.sessions, -1.0
        while self.row and self.row["t"] <= horizon and self.row["k"] > self.k:
            self.k = self.row["k"]
            for channel, data in self._messages(watch.session or 0):
                watch.take(channel, data, now)
            await self._next()

    def _messages(self, session: int) -> Iterator[tuple[str, bytes]]:
        f, m, outputs, row = self.scene.f, self.scene.m, self.scene.model.outputs, self.row

        def of(name: str, n: int) -> list[float]:
            return [row[f"{name}{i}"] for i in range(1, n + 1)] if f"{name}1" in row else []

        tick: dict[str, Any] = {"session": session, "tick": int(row["k"]), "t": row["t"]}
        sigma_q, sigma_g = of("sigma_q", f), of("sigma_g", m)
        filter_only = ("replica_gap", "filter_gap", "sigma_filter_gap")
        whole = ("closing_contact", "from_filter", "inconsistencies")
        yield "SPRAG_SETTLED", encoded(
            "estimate_t",
            **tick,
            **{name: row[name] for name in filter_only},
            **{name: int(row[name]) for name in whole},
            **{"f": f, "q": of("q", f), "u": of("u", f), "bound": row["B"], "estimators": 3},
            **{"deviations": len(sigma_q), "sigma_q": sigma_q, "sigma_u": of("sigma_u", f)},
            **{"gaps": len(sigma_g), "sigma_g": sigma_g},
            **{"closing": row["closing_t"], "suspect_t": -1.0},
        )
        names = [output.name for output in outputs]
        if names and f"sigma_{names[0]}" in row:
            of_outputs = {
                "value": [row[n] for n in names],
                "sigma": [row[f"sigma_{n}"] for n in names],
            }
            yield "SPRAG_OUTPUTS", encoded(
                "outputs_t", **tick, settled=1, n=len(names), name=names, **of_outputs
            )
        if bounds := {
            n.removeprefix("bound_"): w for n, w in row.items() if n.startswith("bound_")
        }:
            names, widths = list(bounds), list(bounds.values())
            yield "SPRAG_BOUNDS", encoded(
                "bounds_t", **tick, n=len(names), name=names, half_width=widths
            )

    async def end(self, file: str) -> bool:
        """Whether it has read the whole file; says what it has said of the file."""
        for line in (await self.said).decode(errors="replace").splitlines():
            if line.startswith(f"{file}:"):
                say("view", line)
        return await self.process.wait() == 0


class Player:
    def __init__(
        self, scene: Any, options: Any, watch: Watch, receive: Receive, stage: Stage
    ) -> None:
        self.scene, self.options, self.watch = scene, options, watch
        self.receive, self.stage = receive, stage

    async def play(self, report: dict[str, Any]) -> bool:
        """Plays to the end; False if the recording is damaged, of which the rest is used."""
        if is_lcm_log(self.options.replay):
            return await self._play_log(report)
        return await self._play_events(report)

    async def _play_log(self, report: dict[str, Any]) -> bool:
        file = self.options.replay
        if not Path(file).is_file():
            raise InputError(f"{file}: must be a file; its content is examined first")
        estimates = ("SPRAG_SETTLED", "SPRAG_ESTIMATE")
        observed = not any(channel in estimates for channel, *_ in _Log(file, None))
        report["observed_here"] = observed
        observer = await OwnObserver.start(self.scene, self.options) if observed else None
        log = _Log(file, self.options.key)
        pace, before, elapsed = Pace(self.stage), None, 0.0
        for channel, data, utime, appended in log:
            if before is not None:
                elapsed += min(max(1e-6 * (utime - before), 0.0), LONGEST_PAUSE)
            before = utime
            await pace.wait(elapsed)
            horizon = self.receive(channel, data, elapsed, utime, appended)
            if observer and horizon is not None:
                await observer.settle(horizon, self.watch, elapsed)
        if self.options.key:
            report["unauthenticated"] = log.unauthenticated
        for begin, end, what in log.damages:
            say("view", f"{file}: from byte {begin}: {what}; the rest is used")
            report.setdefault("damage", []).append({"from": begin, "to": end, "what": what})
        return not log.damages

    async def _play_events(self, report: dict[str, Any]) -> bool:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the observer says the same
            events = read_events(self.options.replay, self.scene)
        report["observed_here"] = True
        observer = await OwnObserver.start(self.scene, self.options)
        times = events["t"]
        end = float(times[-1]) if len(times) else 0.0
        pace = Pace(self.stage)
        step = pace.speed * STEP if math.isfinite(pace.speed) else end / STEPS_WITHOUT_WAITING
        sent = sequence = closed = 0
        horizon = 0.0
        while sent < len(times):
            horizon = min(horizon + step, end)
            await pace.wait(horizon)
            until = int(np.searchsorted(times, horizon, "right"))
            while True:
                new = events[sent : min(until, sent + MOST_RECORDS)]
                sent += len(new)
                for contact, kind in zip(new["contact"].tolist(), new["kind"].tolist()):
                    bit = 1 << (contact - 1)
                    closed = closed | bit if kind == 1 else closed & ~bit
                reached = horizon if sent == until else float(times[sent - 1])
                sequence += 1
                rest = [0] * (MOST_RECORDS - len(new))
                message = encoded(
                    "contacts_t",
                    **{"session": 1, "sequence": sequence, "speed": 1.0, "horizon": reached},
                    **{"closed": closed, "contacts": self.scene.m, "records_total": sent},
                    **{"records": len(new), "t": [*new["t"], *rest]},
                    **{"contact": [*new["contact"], *rest], "kind": [*new["kind"], *rest]},
                )
                self.receive("SPRAG_CONTACTS", message, horizon, 0, False)
                await observer.settle(reached, self.watch, horizon)
                if sent == until:
                    break
        return await observer.end(self.options.replay)
