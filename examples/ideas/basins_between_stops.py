"""
Basins between two stops
========================

A mass between two stops, driven fast, may strike one of them harder than the other. Its mirror image, half a period
later, is another attractor. Which one a state leads to depends on the phase of the force: half a period later every
basin is the other's mirror image.
"""

import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi

stops = [
    vi.Stop(direction=side, gap=0.05, name=name)
    for side, name in ((1, "above"), (-1, "below"))
]
force = vi.Force(omega=5.0, harmonics={1: 1.0})
mass = vi.ImpactSystem(mass=1.0, damping=0.05, stiffness=1.0, force=force, stops=stops)

# %%

states = {
    "displacement": np.linspace(-0.05, 0.05, 81),
    "velocity": np.linspace(-1.0, 1.0, 81),
}
portraits = [vi.basins(mass, **states, phase=phase) for phase in (0.0, 0.5)]
first, second = (portrait["attractor"].values for portrait in portraits)
assert (
    np.mean(first == second[::-1, ::-1]) > 0.99
)  # either portrait names the larger basin first

figure, axes = plt.subplots(1, 2, figsize=(13, 5.4), layout="constrained")
for ax, portrait, phase in zip(axes, portraits, (0.0, 0.5), strict=True):
    vi.plotting.basin_portrait(portrait, ax=ax)
    ax.set_title(f"states at phase {phase:g}")
plt.show()
