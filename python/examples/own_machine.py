"""My own machine: docs/tutorials/own_machine.md in Python, with thirty measured bounces of a
ball."""

# %% Describe the machine: everything per kg of the ball. The drag of the air is taken as linear.
from pathlib import Path

import numpy as np
import sprag

ball = sprag.Scene(
    sprag.Model(
        M=[[1.0]],
        C=[[0.1]],  # [1/s], a guess
        K=[[0.0]],
        contacts=[sprag.Contact([1.0], restitution=0.93)],  # the table; a guess
        forces=[sprag.Force([1.0], constant=-9.81)],  # weight [N/kg]
        outputs=[sprag.Output("height", [1.0])],
        law="newton",
    ),
    replica=sprag.State([0.1]),  # somewhere above the table at t = 0
    sigma=sprag.State([0.1], [1.0]),
    name="ball",
)
print("synchronizes:", sprag.check(ball).synchronizes)

# %% Import the times. The first bounce is put at t = 0.1.
file = Path(__file__).parents[2] / "data" / "ping_pong_bounces.csv"
events = sprag.import_events(file, ball, offset=-0.1)
print(len(events), "bounces")

# %% Fit the restitution and the drag.
fit = sprag.identify(ball, events, free=["impact.restitution", "system.C"], within=2.0)
print("fits:", fit.fits, f"- jitter {1e3 * fit.jitter:.2f} ms")
for key, (value, sigma) in fit.parameters.items():
    print(f"{key}: {value:.4f} +- {sigma:.1g}")

# %% Reconstruct the height: each moment by all bounces, the later ones too.
estimate = sprag.smooth(fit.fitted, events, events["t"][-1], tick=0.001)
height, sigma = estimate.outputs[:, 0], estimate.sigma_outputs[:, 0]
between = (estimate.t > events["t"][0]) & (estimate.t < events["t"][1])
top = np.argmax(np.where(between, height, 0.0))
print(f"top of the first bounce: {1e3 * height[top]:.1f} mm +- {1e3 * sigma[top]:.1f} mm")

# %% Draw it.
try:
    import matplotlib.pyplot as plt
except ImportError:
    print("matplotlib is not installed: no picture")
else:
    plt.fill_between(estimate.t, height - 2 * sigma, height + 2 * sigma, alpha=0.3)
    plt.plot(estimate.t, height)
    plt.plot(events["t"], 0.0 * events["t"], "k|")
    plt.xlabel("t [s]")
    plt.ylabel("height [m]")
    plt.savefig("own_machine.png")
