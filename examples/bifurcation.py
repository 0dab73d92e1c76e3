"""A bifurcation diagram with Std on top, as in figure 10 of Lee's paper, and what hysteresis does to it.

Run it: python bifurcation.py. It draws bifurcation.png.
"""

import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi

osc = vi.ImpactOscillator()
omega = np.linspace(0.5, 5, 451)
diagram = vi.bifurcation_diagram(osc, omega=omega, sample_impacts=300)
sweep = vi.parameter_map(osc, omega=omega)

figure, axes = plt.subplots(2, 1, figsize=(9, 9), layout="constrained")
vi.plotting.diagram_with_index(diagram, sweep, index="std", scale=5, ax=axes[0])
carried = vi.bifurcation_diagram(osc, omega=omega, sample_impacts=300, direction="down")
vi.plotting.bifurcation_diagram(carried, ax=axes[1])
axes[1].set_title("frequency lowered slowly, the motion carried along")
figure.savefig("bifurcation.png", dpi=120)
