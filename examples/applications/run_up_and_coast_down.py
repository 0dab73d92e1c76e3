"""
Running up and coasting down
============================

A screen on springs, driven by an unbalance, hits the stop above it. Run up slowly it hits ever harder and then falls
silent at one speed; coasting down it begins to hit again at another, lower one. Between the two speeds history
decides, so a test run in one direction shows half of the truth.
"""

import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi

machine = vi.family(vi.models.unbalanced_machine).replace(gap=3e-3)
rpm = np.linspace(600.0, 1300.0, 281)
ways = {
    way: vi.bifurcation_diagram(
        machine, rpm=rpm, direction=way, transient_impacts=400, sample_impacts=80
    )
    for way in ("up", "down")
}


def last_hit(sweep):
    """Return the highest speed at which the machine hits its stop."""
    return float(sweep["rpm"][sweep["velocity"].notnull().any("impact")].max())


silent, again = last_hit(ways["up"]), last_hit(ways["down"])
assert silent > again + 100
print(
    f"running up it falls silent at {silent:.0f} rpm; coasting down it hits from {again:.0f} rpm down"
)

# %%

figure, ax = plt.subplots(figsize=(9, 5), layout="constrained")
for way, label, color, size in (
    ("up", "running up", "#d55e00", 8),
    ("down", "coasting down", "#0072b2", 2),
):
    sweep = ways[way]
    speed, velocity = np.broadcast_arrays(rpm[:, None], sweep["velocity"].values)
    ax.scatter(
        speed.ravel(), velocity.ravel(), s=size, color=color, linewidths=0, label=label
    )
ax.axvspan(again, silent, color="0.92", zorder=0, label="history decides")
ax.set(xlabel="speed [1/min]", ylabel="impact velocity [m/s]", ylim=(0, None))
ax.legend(frameon=False)
plt.show()
