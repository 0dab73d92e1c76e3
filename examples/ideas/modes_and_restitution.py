"""
Modes and restitution
=====================

Results with a coefficient of restitution do not converge as modes are added: each further mode makes the mass that is
struck smaller. Left, that mass for a strip with a stop at its tip or at 0.7 of its length. Middle, the impacts per
period that follow. Right, the exception: a free bar leaves a stop with its whole speed, and with many modes it no
longer matters what r was.
"""

import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi

modes = np.arange(1, 13)
strip = vi.models.cantilever_with_stop


def struck_mass(modes, stop_at):
    """Return the mass that a stop strikes, in grams."""
    return 1e3 / strip(modes=float(modes), stop_at=stop_at).modal().mobility[0, 0]


def impacts_per_period(modes):
    """Return how often the strip hits its stop per period."""
    hits = vi.impact_section(
        strip(modes=float(modes)), transient_impacts=4000, sample_impacts=4000
    )["time"].values
    return float((len(hits) - 1) / (hits[-1] - hits[0]) / strip().frequency)


def rebound(modes, restitution):
    """Return the speed of a free bar after a stop over that before; length, mass and speed of sound are 1."""
    order = np.arange(modes)
    stop = vi.Stop(
        direction=np.where(order, np.sqrt(2.0), 1.0), gap=0.0, restitution=restitution
    )
    stiffness = np.diag((np.pi * order) ** 2)
    bar = vi.ImpactSystem(
        mass=np.eye(modes), stiffness=stiffness, force=vi.Force(omega=0.3), stops=[stop]
    )
    coming = vi.State([-1.0] + [0.0] * (modes - 1), [1.0] + [0.0] * (modes - 1))
    return -float(vi.simulate(bar, start=coming, periods=1)["velocity"][-1, 0])


assert abs(struck_mass(12, 1.0) - 46.8 / 4 / 12) < 1e-9  # the strip's mass over 4 n
assert abs(rebound(12, 0.0) - 22 / 23) < 2e-4  # about (2 n - 2)/(2 n - 1)

# %%

figure, (left, middle, right) = plt.subplots(
    1, 3, figsize=(11, 3.4), layout="constrained"
)
for at, marker, name in ((1.0, "o-", "the tip"), (0.7, "s--", "0.7 of the length")):
    left.plot(
        modes,
        [struck_mass(n, at) for n in modes],
        marker,
        markersize=4,
        label=f"stop at {name}",
    )
left.set(ylabel="struck mass [g]", ylim=(0, None))
middle.semilogy(
    modes[:10], [impacts_per_period(n) for n in modes[:10]], "o-", markersize=4
)
middle.set(ylabel="impacts per period")
for r in (0.0, 0.4, 0.7, 0.9):
    right.plot(
        modes, [rebound(n, r) for n in modes], "o-", markersize=4, label=f"r = {r:g}"
    )
right.set(ylabel="speed after over speed before", ylim=(0, 1.02))
for ax in (left, middle, right):
    ax.set(xlabel="number of modes", xticks=range(2, 13, 2))
left.legend(frameon=False)
right.legend(frameon=False, loc="lower right")
plt.show()
