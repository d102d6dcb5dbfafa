"""An Arduino prints edges: docs/tutorials/arduino.md in Python, with the lines of a serial monitor.

A script stands in for the device: it prints what the sketch of the tutorial prints.
"""

# %% The rig, and the lines that its device has printed: microseconds, the contact and its level.
import subprocess
import sys
from pathlib import Path

import numpy as np
import sprag

rig = sprag.read_scene("lab_rig").replace(jitter=1e-5)  # resolution of micros() and interrupt
machine = sprag.simulate(rig, 8.0)
with open("machine.csv", "w", encoding="utf-8") as file:
    file.write("t,contact,closed\n")
    for t, contact, kind in machine.events.tolist():
        for closed in {1: [1], 2: [0], 3: [1, 0]}[kind]:
            file.write(f"{t!r},{contact},{closed}\n")
device = Path(__file__).parents[2] / "scripts" / "simulated_device"
command = [sys.executable, str(device), "machine.csv", "--speed", "max"]
with open("serial.csv", "w", encoding="utf-8") as file:
    subprocess.run(command, stdout=file, check=True)
print("".join(open("serial.csv", encoding="utf-8").readlines()[:3]), end="")

# %% Levels become contact events. A contact that opens within 3 ms is an impact.
events = sprag.import_events("serial.csv", rig, level="level", pulse_shorter_than=0.003)
off = 1e6 * np.abs(events["t"] - machine.events["t"][: len(events)]).max()
print(f"{len(events)} impacts, their times within {off:.1f} us")

# %% Reconstruct the motion.
estimate = sprag.observe(rig, events, 8.0)
late = estimate.t > 4.0
error = np.abs(estimate.q - machine.q)[late].max()
print(f"after 4 s q is within {1e6 * error:.1f} um, of {1e3 * np.abs(machine.q).max():.1f} mm")
