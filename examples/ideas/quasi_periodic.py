"""
Neither periodic nor chaotic
============================

Two masses, the second one between two stops. Where two complex multipliers of a cycle pass the unit circle, a motion
is born that never repeats, though neighbours do not part: quasi-periodic, its impacts fill closed curves. One mass
alone cannot do that, since its impacts and damper shrink every area of its section.
"""

import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi


@vi.family(units={"omega": "rad/s", "gap": "m"})
def masses(omega=0.955, gap=0.7):
    """Return two masses, the second one between two stops."""
    stiffness = np.array([[2.9, -1.6], [-1.6, 1.6]])
    return vi.ImpactSystem(
        mass=np.diag([1.1, 0.8]),
        damping=0.017 * stiffness,
        stiffness=stiffness,
        force=vi.Force(omega=omega, harmonics={1: [1.0, 0.0]}),
        stops=[
            vi.Stop(direction=[0.0, side], gap=gap, restitution=0.81)
            for side in (1.0, -1.0)
        ],
    )


# %%
# The motions of a plane, and the impacts of one of them.

axes = {"omega": np.linspace(0.8, 1.1, 48), "gap": np.linspace(0.6, 0.8, 32)}
window = {"transient_impacts": 1500, "sample_impacts": 1500}
names = ["lyapunov_per_impact", "n_periods", "n_impacts"]
sweep = vi.parameter_map(masses, **axes, indices=names, **window)
own = vi.parameter_map(masses, omega=[0.955], indices=names, **window)
assert own["n_periods"].item() == 0
assert abs(1500 * own["lyapunov_per_impact"].item()) < np.log(
    1500
)  # neighbours neither part nor meet

figure, (left, right) = plt.subplots(
    1, 2, figsize=(11, 4), layout="constrained", width_ratios=(3, 2)
)
vi.plotting.motion_map(sweep, ax=left)
left.set_title("two masses between two stops, from rest")
hits = vi.impact_section(masses, **window)
for stop, color in (("stop_1", "#0072b2"), ("stop_2", "#d55e00")):
    here = hits["stop"].values == stop
    right.plot(
        hits["phase"].values[here],
        hits["velocity"].values[here],
        ".",
        color=color,
        markersize=2,
        label=stop,
    )
right.set(
    xlabel=r"phase $\psi/T$",
    ylabel="impact velocity [m/s]",
    title="impacts at omega 0.955, gap 0.7",
)
right.legend(frameon=False, markerscale=4)
plt.show()
