"""
Every figure
============

Each function of ``vibroimpact.plotting`` takes a result and returns axes. Here is one picture of each that no other
program of this gallery draws.
"""

import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi

osc = vi.ImpactOscillator(omega=0.95)
vi.plotting.oscillator_sketch()

# %%
# An impact section, and one look per driving period.

vi.plotting.impact_map(vi.impact_section(osc.replace(omega=2.8)))
vi.plotting.stroboscopic_map(
    vi.stroboscopic_section(osc.replace(omega=2.8), sample_periods=2000)
)

# %%
# An index along one parameter.

line = vi.parameter_map(
    osc, omega=np.linspace(0.5, 5, 300), indices=["max_velocity"], sample_impacts=500
)
assert (
    abs(float(line["max_velocity"].idxmax()) - 2.0) < 0.02
)  # resonance at twice the natural frequency
vi.plotting.index_curve(line, "max_velocity")

# %%
# A map as a surface, and the lines of one level, as data.

plane = {"omega": np.linspace(1.5, 5, 60), "restitution": np.linspace(0.5, 0.95, 40)}
sweep = vi.parameter_map(osc, **plane, sample_impacts=500)
vi.plotting.index_surface(sweep, "std")
figure, ax = plt.subplots(figsize=(6, 4), layout="constrained")
for along, across in (
    line.T for line in vi.plotting.boundary_lines(sweep, "std", level=0.05)
):
    ax.plot(along, across, color="#0072b2")
ax.set(xlabel="driving frequency [rad/s]", ylabel="restitution", title="Std = 0.05 m/s")
plt.show()
