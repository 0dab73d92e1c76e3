"""
What Std hides
==============

A small standard deviation of the impact velocities says that impacts are alike, no more. Left: a stable motion with two
unequal impacts has a large one. Middle: where the mass chatters it depends on the slowest impact that is counted.
Right: where two motions coexist it depends on the initial condition.
"""

import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi

osc = vi.ImpactOscillator()

# %%
# A period-1 impact-2 motion.

unequal = osc.replace(omega=1.0)
name = vi.recognise(vi.impact_section(unequal)).name
hits = vi.impact_section(unequal, sample_impacts=12)
spread = float(hits["velocity"].std())
assert name == "period-1 impact-2"
assert abs(spread - 0.454) < 0.001

# %%
# One chattering motion, with ever softer impacts counted.

cuts = np.logspace(-2, -9, 29)
std = [
    vi.parameter_map(osc, omega=[0.1], tolerances=vi.Tolerances(chatter=cut))[
        "std"
    ].item()
    for cut in cuts
]
assert std[0] > 1.4 * std[-1]

# %%
# Two motions, from many impacts as initial conditions.

portrait = vi.basins(
    osc.replace(omega=3.0),
    phase=np.linspace(0, 1, 81),
    velocity=np.linspace(0.05, 2, 61),
)
assert np.ptp(portrait["std"].values) > 0.02

# %%

figure, (left, middle, right) = plt.subplots(
    1, 3, figsize=(13, 4.2), layout="constrained"
)
left.stem(
    (hits["time"] - hits["time"][0]) / unequal.period, hits["velocity"], basefmt=" "
)
left.set(ylim=(0, None), xlabel="driving periods", ylabel="impact velocity [m/s]")
left.set_title(f"w = 1: {name}, stable, Std = {spread:.3f}")
middle.semilogx(cuts, std, "o-", markersize=4)
middle.set(
    ylim=(0, None), xlabel="slowest impact counted, relative to V", ylabel="Std [m/s]"
)
middle.set_title("w = 0.1, chattering: Std depends on the cut-off")
vi.plotting.basin_portrait(portrait, ax=right)
unlike = " and ".join(f"{value:.3f}" for value in portrait["std"].values)
right.set_title(f"w = 3: two motions, Std {unlike}")
plt.show()
