"""The paper's beam: docs/tutorials/paper_beam.md in Python.

Each part between two lines `# %%` is a cell of a notebook, in editors that know them.
"""

# %% Look at the machine: a clamped beam on a shaken frame, whose tip knocks against a support.
import numpy as np
import sprag

scene = sprag.read_scene("paper_beam")
print("synchronizes:", sprag.check(scene).synchronizes)

# %% Simulate it for 20 units of time.
machine = sprag.simulate(scene, 20.0)
print(len(machine.events), "impacts, the first at t =", round(machine.events["t"][0], 4))

# %% Reconstruct its state from the impact times alone: by the replica of the paper, and by default.
replica = sprag.observe(scene, machine.events, 20.0, estimator="replica")
estimate = sprag.observe(scene, machine.events, 20.0)

# %% Compare with the truth: V is the energy of the error.
V_replica = sprag.energies(scene, machine.q, machine.u, replica.q, replica.u).V
V = sprag.energies(scene, machine.q, machine.u, estimate.q, estimate.u).V
for t in (0.0, 2.0, 5.0, 20.0):
    k = np.searchsorted(estimate.t, t)
    print(f"t = {t:4.1f}: V of the replica {V_replica[k]:.1e}, of the default {V[k]:.1e}")

# %% Draw it.
try:
    import matplotlib.pyplot as plt
except ImportError:
    print("matplotlib is not installed: no picture")
else:
    plt.semilogy(machine.t, V_replica + 1e-32, label="replica")
    plt.semilogy(machine.t, V + 1e-32, label="default")
    plt.vlines(machine.events["t"], 1e-32, 1e-31, color="grey", label="impacts")
    plt.xlabel("t")
    plt.ylabel("V")
    plt.legend()
    plt.savefig("paper_beam.png")
