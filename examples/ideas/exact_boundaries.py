"""
Exact boundaries
================

Left, orbits followed along a parameter, stable (solid) and unstable (dashed), over what a sweep sees. Right, the
points where they fold, double or graze, followed as curves in two parameters, over a map of Std: the edges of the
map, to twelve digits, without a grid.
"""

import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi
from vibroimpact.continuation.windows import follow_all

osc = vi.ImpactOscillator()
orbits = [
    *vi.find_orbit(osc.replace(omega=2.5)),
    *vi.find_orbit(osc.replace(omega=3.25), n_periods=2),
]
branches = follow_all(orbits, "omega", (2.4, 3.6), longest=2, most=2)
doublings = [
    point.value
    for branch in branches
    for point in branch.special
    if point.kind == "period_doubling"
]
assert any(abs(value - 2.653923520184) < 1e-11 for value in doublings)

# %%

figure, (left, right) = plt.subplots(1, 2, figsize=(12, 5.2), layout="constrained")
sweep = vi.bifurcation_diagram(
    osc,
    omega=np.linspace(2.4, 3.6, 300),
    direction="up",
    transient_impacts=500,
    sample_impacts=50,
)
vi.plotting.branch_diagram(branches, sweep, ax=left)
box = (1.0, 4.0), (0.3, 0.95)
curves = vi.boundary_curves(osc, ("omega", "restitution"), box, n_periods=(1, 2))
cells = {"omega": np.linspace(*box[0], 200), "restitution": np.linspace(*box[1], 120)}
vi.plotting.boundaries(
    curves, vi.parameter_map(osc, **cells, sample_impacts=1000), ax=right
)
plt.show()
