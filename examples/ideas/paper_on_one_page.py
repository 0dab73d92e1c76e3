"""
The paper on one page
=====================

June-Yule Lee's *Numerical Analysis of Impact Vibration Based on a Bifurcation Diagram With Two Varying Control
Parameters* in six pictures: a chaotic motion in time, its stroboscopic section, the bifurcation diagram, and the
standard deviation of impact velocities over frequency and each of mass, damping and restitution. ``vibroimpact
reproduce`` draws all figures and checks the paper's statements one by one.
"""

import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi

osc = (
    vi.ImpactOscillator()
)  # the paper's numbers: m = k = f = 1, c = 0.01, r = 0.8, g = 0
chaotic = osc.replace(omega=2.8)
motion = vi.simulate(chaotic, periods=20)
strobed = vi.stroboscopic_section(chaotic, sample_periods=4000)
diagram = vi.bifurcation_diagram(
    osc, omega=np.linspace(0.5, 5, 400), sample_impacts=150
)
assert vi.recognise(vi.impact_section(chaotic)).name == "chaotic"

# %%
# Three of the five maps, 120 x 80 cells of 1000 impacts each.

planes = [
    vi.parameter_map(
        osc, omega=np.linspace(0.5, 5, 120), **{name: values}, sample_impacts=1000
    )
    for name, values in (
        ("mass", np.linspace(0.1, 5, 80)),
        ("damping", np.linspace(0.005, 1, 80)),
        ("restitution", np.linspace(0.1, 0.99, 80)),
    )
]

# %%

figure, axes = plt.subplots(2, 3, figsize=(16, 9), layout="constrained")
vi.plotting.time_history(motion, ax=axes[0, 0])
vi.plotting.stroboscopic_map(strobed, ax=axes[0, 1])
vi.plotting.bifurcation_diagram(diagram, ax=axes[0, 2])
for ax, plane in zip(axes[1], planes, strict=True):
    vi.plotting.index_contour(plane, "std", ax=ax)
for ax in axes.flat:
    ax.set_title("")
plt.show()
