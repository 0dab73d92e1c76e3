"""
Orbits, stable or not
=====================

``find_orbit`` solves for periodic motions instead of waiting for them, so it finds unstable ones too, which no
simulation shows but which separate the motions that it does. Here a motion with one impact, a stable and an unstable
one with three impacts in two periods, and one that sticks.
"""

import matplotlib.pyplot as plt

import vibroimpact as vi

osc = vi.ImpactOscillator()
(one,) = vi.find_orbit(osc.replace(omega=1.4))
stable, unstable = vi.find_orbit(osc.replace(omega=1.3), n_periods=2, n_impacts=3)
(sticking,) = vi.find_orbit(osc.replace(omega=0.1), n_impacts=-1)
assert stable.stable
assert abs(unstable.multipliers[0]) > 3
assert sticking.release_phase == 0.5


def cycle(orbit):
    """Return one cycle of an orbit in time."""
    return vi.simulate(
        orbit.oscillator,
        start=orbit.start,
        periods=orbit.n_periods,
        samples_per_period=2000,
    )


# %%

figure, axes = plt.subplots(1, 3, figsize=(12.5, 4.4), layout="constrained")
for ax, orbit in zip(axes, (one, stable, sticking), strict=True):
    vi.plotting.phase_portrait(cycle(orbit), ax=ax)
    ax.set_title(
        f"w = {orbit.oscillator.omega:g}: {orbit.name}\nmultipliers {abs(orbit.multipliers[0]):.2g} in size"
    )
    ax.get_legend().remove()
    ax.locator_params(axis="x", nbins=5)
beside = cycle(unstable)
axes[1].plot(
    beside["displacement"], beside["velocity"], "--", color="#d55e00", linewidth=1
)
axes[1].set_title(
    "w = 1.3: period-2 impact-3, stable (blue)\nand unstable (red, dashed)"
)
plt.show()
