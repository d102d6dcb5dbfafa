"""Shows a run in a browser while it goes on, or from a recording."""

from __future__ import annotations

import asyncio
import contextlib
import math
import signal
import sys
import time
from argparse import ArgumentTypeError, Namespace
from collections import Counter
from typing import Any

from .._command import (
    EXIT_DONE,
    EXIT_FAILED,
    Interrupted,
    Parser,
    Read,
    SceneFile,
    UsageError,
    positive,
    require,
    require_compiled,
    run_program,
    scene_file,
)


STEPS_UNSEEN = 6  # between batches of messages while nobody looks


def _speed(text: str) -> float:
    if text == "max":
        return math.inf
    try:
        return positive(text)
    except ArgumentTypeError:
        message = f"{text} is not allowed; must be a number > 0, or max"
        raise ArgumentTypeError(message) from None


def _parser() -> Parser:
    parser = Parser(
        "view",
        "Shows a run in a browser while it goes on: the machine in motion, gaps with bands of two "
        "sigma, contacts, error energies, and the observer's health. Serves a page until a signal "
        "comes; it can only be looked at.",
    )
    add = parser.add_argument
    add("scene", metavar="SCENE", type=SceneFile, help="scene file or name")
    text = "where the page is; port 0 takes one that is free"
    add("--http", metavar="ADDRESS:PORT", default="127.0.0.1:8080", help=text)
    text = "show an LCM log or an events CSV; contacts without estimates are observed meanwhile"
    add("--replay", metavar="FILE", type=Read, help=text)
    text = "replay so many times as fast, or max [1]"
    add("--speed", metavar="R", type=_speed, help=text)
    text = "step of the observer of a replay [0.001 s]"
    add("--tick", metavar="H", type=positive, help=text)
    return parser


def main() -> int:
    return run_program(_parser(), _run)


def _run(options: Namespace, report: dict[str, Any]) -> int:
    if not options.replay and (options.speed or options.tick):
        raise UsageError(f"{'--speed' if options.speed else '--tick'} needs --replay")
    options.speed, options.tick = options.speed or 1.0, options.tick or 0.001
    require("aiohttp", "python3-aiohttp", "view")
    core = require_compiled("view")
    from .server import endpoint_of

    try:
        endpoint_of(options.http)
        options.scene = scene_file(options.scene)
        return asyncio.run(_serve(core.read_scene(options.scene), options, report))
    except Interrupted:
        return EXIT_DONE


async def _serve(scene: Any, options: Namespace, report: dict[str, Any]) -> int:
    from .. import _core
    from .messages import CHANNELS
    from .replay import Player
    from .server import RATE, Server, Stage, is_loopback, text_of
    from .watch import Watch

    stopped = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) != signal.SIG_IGN:
            loop.add_signal_handler(number, stopped.set)
    bus = player = None
    if options.replay:
        player = Player(scene, options)
        watch = Watch(scene, machine_time=not player.is_log)
        stage = Stage(speed=options.speed)
    else:
        try:
            bus = _core._Receiver(CHANNELS, options.url, options.key)
        except ValueError as error:
            raise UsageError(f"--url: {error}") from None
        watch = Watch(scene, signed=options.key is not None)
        stage = Stage(now=time.monotonic())
    server = Server(watch, stage, options.http)
    await server.start()
    print(f"http://{text_of(server.address, server.port)}/", file=sys.stderr, flush=True)
    if not is_loopback(server.address):
        print("other hosts can look on, too; nobody is asked for a password", file=sys.stderr)

    refused: Counter[str] = Counter()
    received = 0

    def receive(channel: str, data: bytes, now: float, utime: int, appended: bool) -> None:
        nonlocal received
        if channel not in CHANNELS:
            return
        received += 1
        if why := _core._refusal(channel, data):
            refused[why] += 1
        else:
            watch.take(channel, data, now, utime, appended)

    play = loop.create_task(player.play(watch, receive, stage, report)) if player else None
    due, step = time.monotonic(), 0
    while not stopped.is_set():
        due = max(due + 1.0 / RATE, time.monotonic())
        with contextlib.suppress(asyncio.TimeoutError):
            await asyncio.wait_for(stopped.wait(), due - time.monotonic())
        if bus:
            stage.now = time.monotonic()
            for channel, data, utime in bus.receive():
                receive(channel, data, stage.now, utime, False)
        step += 1
        if server.clients or step % STEPS_UNSEEN == 0:
            watch.settle()
        server.send()
        if play and play.done() and not stage.over:
            play.result()  # raises its exception
            stage.over = True
            print("the recording is over", file=sys.stderr, flush=True)
    watch.settle()
    whole = play.result() if play and play.done() else True

    counts = server.counts
    report["http"] = text_of(server.address, server.port)
    for name in ("clients", "requests", "requests_refused", "displaced", "turned_away"):
        report[name] = getattr(counts, name)
    report["frames"] = {"sent": counts.sent, "dropped": counts.dropped, "bytes": counts.bytes}
    report["messages"] = {
        "received": received,
        "refused": {why: n for why, n in (refused | (bus.refused if bus else {})).items() if n},
        "overflowed": bus.overflowed if bus else 0,
        "of_others": watch.of_others,
        "misfits": watch.misfits + watch.follower.misfits,
        "contacts": watch.follower.received,
        "contacts_lost": watch.follower.lost,
    }
    return EXIT_DONE if whole else EXIT_FAILED
