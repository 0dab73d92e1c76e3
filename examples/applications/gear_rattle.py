r"""
When an idle gear begins to rattle
==================================

The idle gears of a gearbox are held on their flank by drag only. They leave it once the driving gear slows down
faster than drag can: where its angular acceleration times their inertia exceeds the drag torque, :math:`J \alpha >
T`. Above that the map shows how hard the teeth hit; the threshold is exact, since from rest on the flank nothing
moves below it.
"""

import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi

gear = vi.family(vi.models.idle_gear)
acceleration, drag = np.linspace(20.0, 1000.0, 50), np.linspace(0.05, 0.5, 46)
sweep = vi.parameter_map(
    gear,
    angular_acceleration=acceleration,
    drag_torque=drag,
    indices=["max_velocity"],
    transient_impacts=500,
    sample_impacts=300,
)
ratio = 1e-3 * sweep["angular_acceleration"] / sweep["drag_torque"]
hits = sweep["max_velocity"].fillna(0.0) > 0
assert not bool(hits.where(ratio < 0.97, False).any())

# %%

vi.plotting.index_contour(sweep, "max_velocity", reference={})
plt.plot(
    drag / 1e-3,
    drag,
    color="#d55e00",
    linewidth=2,
    label="inertia times acceleration = drag",
)
plt.xlim(acceleration[0], acceleration[-1])
plt.legend(loc="lower right")
plt.show()
