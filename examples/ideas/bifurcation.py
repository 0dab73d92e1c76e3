"""
A bifurcation diagram, twice
============================

Above, each frequency begins from rest, and Std, five times enlarged, runs along: figure 10 of Lee's paper. Below, the
frequency is lowered slowly and the motion carried along. Where the two differ, several motions exist.
"""

import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi

osc = vi.ImpactOscillator()
omega = np.linspace(0.5, 5, 451)
diagram = vi.bifurcation_diagram(osc, omega=omega, sample_impacts=300)
carried = vi.bifurcation_diagram(osc, omega=omega, sample_impacts=300, direction="down")

# %%
# The hardest impacts are near w = 2 and 4, where half a natural swing takes one and two driving periods.

for low, high, peak in ((1.5, 2.5, 2.0), (3.5, 4.5, 4.0)):
    hardest = diagram["velocity"].max("impact").sel(omega=slice(low, high))
    assert abs(float(hardest.idxmax()) - peak) < 0.05

# %%

figure, axes = plt.subplots(2, 1, figsize=(9, 9), layout="constrained")
vi.plotting.diagram_with_index(
    diagram, vi.parameter_map(osc, omega=omega), index="std", scale=5, ax=axes[0]
)
vi.plotting.bifurcation_diagram(carried, ax=axes[1])
axes[1].set_title("frequency lowered slowly, the motion carried along")
plt.show()
