#!/usr/bin/python3
"""Convergence of impacts under a recorded input, against the same machine under the harmonic.

A steel ruler of three modes on a shaker meets a screw that moves with the shaker. The harmonic is
sampled and read back. Prints, by samples per period, the relative error of the velocities at the
end and the largest error of an impact time.
"""
import tempfile
from pathlib import Path

import numpy as np

from machines import sprag

FREQUENCY, AMPLITUDE, PHASE, DURATION = 2.0 * np.pi * 40.0, 1e-3, 0.4, 0.1

RULER = """
[beam]
modes = 3
length = 0.3
bending_stiffness = 0.35
mass_per_length = 0.157
damping = 0.183
[impact]
restitution = 0.6
[[contact]]
position = 0.28
clearance = 5e-4
mount = "frame"
[excitation]
"""


def main() -> None:
    keys = f"amplitude = {AMPLITUDE}\nfrequency = {FREQUENCY!r}\nphase = {PHASE}\n"
    truth = sprag.simulate(sprag.parse_scene(RULER + keys), DURATION, tick=DURATION)
    print("| samples per period | input | velocities | impact times [s] |\n|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        for samples in (25, 50, 125, 250):
            t = np.arange(0.0, 1.2 * DURATION, 2.0 * np.pi / FREQUENCY / samples)
            shift = AMPLITUDE * np.cos(FREQUENCY * t + PHASE)
            file = Path(name) / "record.csv"
            for kind in ("linear", "spline", "displacement"):
                values = shift if kind == "displacement" else -(FREQUENCY**2) * shift
                np.savetxt(file, np.stack([t, values], 1), "%.17g", ",", header="t,x", comments="")
                how = f"interpolation = '{kind}'"
                if kind == "displacement":
                    how = "quantity = 'displacement'"
                recorded = sprag.parse_scene(f"{RULER}file = '{file}'\n{how}\n")
                run = sprag.simulate(recorded, DURATION, tick=DURATION)
                u = np.abs(run.u[-1] - truth.u[-1]).max() / np.abs(truth.u[-1]).max()
                n = len(truth.events)
                assert len(run.events) == n, (kind, samples, n, len(run.events))
                dt = np.abs(run.events["t"] - truth.events["t"]).max()
                print(f"| {samples} | {kind} | {u:.2g} | {dt:.2g} |")


if __name__ == "__main__":
    main()
