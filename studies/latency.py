#!/usr/bin/python3
"""Measures the time from an event until the estimate that contains it has arrived, over LCM.

Starts an observer of the scene `bouncing_ball`, publishes EVENTS closings and openings at random
times of the wall clock, and waits for the first estimate that shows each. The time includes the
publisher and the listener in Python. Prints quantiles in microseconds for each tick.
"""
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from machines import ROOT, sprag

EVENTS, TICKS = 1000, (1e-2, 1e-3, 1e-4)
URL = "udpm://239.255.76.67:7693?ttl=0"


def latencies(tick: float) -> list[float]:
    command: list[str | Path] = [
        ROOT / "build" / "observer" / "observer",
        "bouncing_ball",
        "--url",
        URL,
    ]
    command += ["--estimator", "replica", "--tick", f"{tick}"]
    observer = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    rng, found = np.random.default_rng(1), []
    try:
        time.sleep(1.0)
        with sprag.EventPublisher(1, url=URL) as publisher:
            listener = sprag.EstimateListener(url=URL)
            begin, closed = time.monotonic(), False
            for _ in range(EVENTS):
                time.sleep(rng.uniform(2e-3, 1e-2))
                closed = not closed
                kind = sprag.ContactEventKind.CLOSES if closed else sprag.ContactEventKind.OPENS
                while listener.next(0.0):  # estimates of earlier ticks
                    pass
                sent = time.monotonic()
                publisher.take(sent - begin, 1, kind)
                publisher.set_horizon(sent - begin)
                while (estimate := listener.next(1.0)) and bool(estimate.closed) != closed:
                    pass
                if estimate is None:
                    sys.exit("no estimate arrives")
                found.append(1e6 * (time.monotonic() - sent))
    finally:
        observer.terminate()
        observer.wait()
    return found


def main() -> None:
    print("| tick [s] | p50 [us] | p99 [us] | max [us] |\n|---|---|---|---|")
    for tick in TICKS:
        quantiles = np.quantile(latencies(tick), [0.5, 0.99, 1.0])
        print(f"| {tick:g} | " + " | ".join(f"{x:.0f}" for x in quantiles) + " |", flush=True)


if __name__ == "__main__":
    main()
