"""Plays a recording in place of the bus, at a selectable speed.

Contacts without estimates are observed meanwhile.
"""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable
from typing import Any

from .._command import say
from .._core import _has_estimates, _LogRecording, _open_recording, _RecordingObserver
from .server import Stage
from .watch import Watch

# Takes channel, data, arrival [s], its wall time [us] and whether a recording was appended there.
Receive = Callable[[str, bytes, float, int, bool], None]

STEP = 1.0 / 60.0  # s of wall time, between the messages of an events file
LONGEST_PAUSE = 3600.0  # s of a recording; a longer one means that its clock was set
SERVED_EVERY = 0.02  # s of wall time
TICKS = 500  # of the observer, without serving the page


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


class Player:
    def __init__(self, scene: Any, options: Any) -> None:
        """Opens the recording. Raises InputError."""
        self.file = options.replay
        step = STEP * options.speed if math.isfinite(options.speed) else 0.0
        self.recording = _open_recording(self.file, scene, options.key, step)
        self.is_log = isinstance(self.recording, _LogRecording)
        self.observer = None
        if not self.is_log or not _has_estimates(self.file):
            self.observer = _RecordingObserver(scene, options.tick, self.is_log)

    async def play(
        self, watch: Watch, receive: Receive, stage: Stage, report: dict[str, Any]
    ) -> bool:
        """Plays to the end; False if the recording is damaged, of which the rest is used."""
        recording = self.recording
        report["observed_here"] = self.observer is not None
        if not isinstance(recording, _LogRecording):
            report["skipped_rows"] = len(recording.problems)
            for problem in recording.problems:
                say("view", problem)
        pace, before, elapsed = Pace(stage), None, 0.0
        for channel, data, utime, appended in recording:
            if before is not None:
                elapsed += min(max(1e-6 * (utime - before), 0.0), LONGEST_PAUSE)
            before = utime
            await pace.wait(elapsed)
            receive(channel, data, elapsed, utime, appended)
            if not self.observer:
                continue
            self.observer.take(channel, data, int(1e9 * elapsed), utime, appended)
            settled = False
            while not settled:
                estimates, settled = self.observer.settle(TICKS)
                for of_estimate, message in estimates:
                    watch.take(of_estimate, message, elapsed)
                await pace.wait(elapsed)
        if isinstance(recording, _LogRecording):
            report["unauthenticated"] = recording.unauthenticated
        for at, what in recording.damages:
            place = f": from byte {at}" if self.is_log else f":{at}"
            used = "the rest" if self.is_log else "everything before"
            say("view", f"{self.file}{place}: {what}; {used} is used")
            report.setdefault("damage", []).append({"from": at, "what": what})
        return not recording.damages
