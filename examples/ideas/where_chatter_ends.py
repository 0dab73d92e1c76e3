r"""
Where chatter ends
==================

A slowly driven mass chatters: ever softer impacts, infinitely many in a finite time, until it rests at the stop; then
the force lifts it off. Driven faster it has less time for that. At some frequency the chatter ends at the very
instant of the release, and beyond there is no rest any more. ``end_of_sticking`` finds that frequency to twelve
digits. Close to it the time at rest vanishes as a power of the distance, 0.6 at r = 0.8: a tenth of the distance
leaves a quarter of the time, so that a search by looking for motions that rest finds the end too early.
"""

import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi

osc = vi.ImpactOscillator()
end = vi.end_of_sticking(osc, "omega", (0.3, 0.4)).value
assert abs(end - 0.347180413266) < 1e-12

# %%
# Share of time at rest over the distance from the end.

figure, (left, right) = plt.subplots(1, 2, figsize=(11.5, 4.4), layout="constrained")
orbit = vi.simulate(osc.replace(omega=0.3), periods=2, samples_per_period=2000)
vi.plotting.time_history(orbit, ax=left)
left.set_title(f"w = 0.3; no rest from w = {end:.6f} on")
distance = np.logspace(-8, -1, 29)
for r, exponent, color in (
    (0.2, None, "#d55e00"),
    (0.5, None, "#009e73"),
    (0.8, 0.6003, "#0072b2"),
):
    own = osc.replace(restitution=r)
    between = {0.2: (0.5, 1.2), 0.5: (0.4, 0.8), 0.8: (0.3, 0.4)}[r]
    last = vi.end_of_sticking(own, "omega", between).value
    table = {"omega": last * (1 - distance)}
    rest = vi.parameter_map(own, points=table, indices=["stick_fraction"])[
        "stick_fraction"
    ].values
    slope = np.polyfit(np.log(distance[:12]), np.log(rest[:12]), 1)[0]
    if exponent:
        assert abs(slope - exponent) < 0.002
    right.loglog(
        distance,
        rest,
        "o-",
        markersize=3,
        color=color,
        label=f"r = {r:g}: power {slope:.2f}",
    )
right.set(xlabel="distance from the end, relative", ylabel="share of time at rest")
right.legend(frameon=False)
plt.show()
