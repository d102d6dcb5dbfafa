"""Live: docs/tutorials/live.md in Python. The machine and the listener are here, the observer is
the program of Sprag, which must be installed or built."""

# %% Start the observer in a process of its own.
import os
import shutil
import subprocess
import time
from pathlib import Path

import sprag

url = os.environ.get("SPRAG_URL", "udpm://239.255.76.67:7667?ttl=0")
program = shutil.which("sprag") or str(Path(__file__).parents[2] / "build" / "sprag")
scene = sprag.read_scene("paper_beam")
command = [program, "observer", "paper_beam", "--url", url, "--duration", "5"]
observer = subprocess.Popen(command, stderr=subprocess.DEVNULL)
listener = sprag.EstimateListener(settled=True, url=url)

# %% The machine publishes its impacts in real time. An observer that starts later joins it.
machine = sprag.simulate(scene, 6.0)
waiting = machine.events.tolist()
estimates = []
with sprag.EventPublisher(scene.m, url=url) as publisher:
    start = time.monotonic()
    while (t := time.monotonic() - start) < 6.0:
        while waiting and waiting[0][0] <= t:
            publisher.take(*waiting.pop(0))
        publisher.set_horizon(t)  # also while nothing happens
        while (estimate := listener.next(timeout=0.01)) is not None:
            estimates.append(estimate)
    publisher.set_horizon(6.0)
observer.wait(timeout=10)

# %% Compare the settled estimates with the machine.
last = estimates[-1]
k = round(last.t / 0.01)
off = abs(last.q - machine.q[k]).max()
print(f"{len(estimates)} settled estimates, the last at t = {last.t:.2f}, off by {off:.0e}")
