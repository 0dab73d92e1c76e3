"""
Two motions, one machine
========================

Which motion a machine settles to may depend on how it began. Left, the initial conditions at the stop that lead to
each of two motions at one frequency. Right, what history does: between a period doubling and a fold the frequency's
way decides.
"""

import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi

osc = vi.ImpactOscillator()
shares = {motion.name: motion.share for motion in vi.attractors(osc.replace(omega=3.0))}
assert 0.08 < shares["period-6 sticking"] < 0.16  # about one initial condition in eight

# %%

figure, (left, right) = plt.subplots(1, 2, figsize=(13, 5.4), layout="constrained")
grid = {"phase": np.linspace(0, 1, 241), "velocity": np.linspace(0, 3, 181)}
vi.plotting.basin_portrait(vi.basins(osc.replace(omega=3.0), **grid), ax=left)
left.set_title("w = 3: initial conditions at the stop")
for direction, colour, size in (("up", "#d55e00", 3.0), ("down", "#0072b2", 1.2)):
    sweep = vi.bifurcation_diagram(
        osc,
        omega=np.linspace(1.1, 1.5, 300),
        direction=direction,
        transient_impacts=1000,
        sample_impacts=60,
    )
    omega, velocity = np.broadcast_arrays(
        sweep["omega"].values[:, None], sweep["velocity"].values
    )
    right.plot(
        omega.ravel(),
        velocity.ravel(),
        ".",
        color=colour,
        markersize=size,
        label=f"sweep {direction}",
    )
right.set(
    xlabel=r"angular driving frequency $\omega$ [rad/s]",
    ylabel="impact velocity $I$ [m/s]",
    ylim=(0, None),
)
right.set_title("one oscillator, up and down")
right.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=2, markerscale=4)
plt.show()
