"""
Restitution that falls with speed
=================================

Measured restitutions fall with the speed of the impact. A stop takes a number, a law or a table: two laws of Hunt and
Crossley (1975), the constant of a spring and a damper that let go at zero force, and a monotone curve through
measurements.
"""

import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi

assert abs(vi.contact.hunt_crossley(damping=1.0)(1.0) - 0.59362426004004) < 1e-13
assert abs(vi.contact.kelvin_voigt(damping_ratio=0.2)(1.0) - 0.571740027585) < 1e-12

# %%

speeds, table = (
    np.logspace(-2, 1, 300),
    ([0.05, 0.2, 0.6, 2.0, 5.0], [0.86, 0.8, 0.68, 0.52, 0.45]),
)
figure, ax = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
for damping, line in ((0.12, "-"), (0.48, "--")):
    law = vi.contact.hunt_crossley(damping=damping)
    ax.semilogx(
        speeds,
        law(speeds),
        line,
        color="C0",
        label=f"Hunt and Crossley, D = {damping:g} s/m",
    )
ax.semilogx(
    speeds,
    vi.contact.kelvin_voigt(damping_ratio=0.2)(speeds),
    color="C1",
    label=r"Kelvin and Voigt, $\zeta$ = 0.2",
)
ax.semilogx(speeds, vi.contact.piecewise(*table)(speeds), color="C2", label="a table")
ax.plot(*table, "o", color="C2", markersize=4)
ax.set(
    xlabel="speed of the impact [m/s]",
    ylabel="restitution",
    ylim=(0, 1.02),
    xlim=(speeds[0], speeds[-1]),
)
ax.legend(frameon=False, loc="lower left")
plt.show()
