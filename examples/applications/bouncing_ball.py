r"""
A bouncing ball's doublings
===========================

A ball on a table that shakes, as a part on a vibratory conveyor, knows two numbers: the restitution r and the table's
largest acceleration over that of gravity, :math:`\Gamma`. One bounce per period begins at :math:`\Gamma = \pi (1 -
r)/(1 + r)` and doubles its period where :math:`\Gamma^2 = \pi^2 (1 - r)^2/(1 + r)^2 + 4 (1 + r^2)^2/(1 + r)^4`
(Holmes 1982). Both curves, followed by the program without these formulas, agree with them to ten digits.
"""

import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi

OMEGA, GRAVITY = 100.0 * np.pi, 9.81  # 50 Hz


@vi.family(units={"gamma": "1"})
def ball(gamma=1.3, restitution=0.5):
    """Return a ball on a table of that largest acceleration."""
    return vi.models.bouncing_ball(
        amplitude=gamma * GRAVITY / OMEGA**2, restitution=restitution
    )


def fold(r):
    """Return the acceleration from which one bounce per period exists."""
    return np.pi * (1 - r) / (1 + r)


def doubling(r):
    """Return the acceleration at which it doubles its period."""
    return np.sqrt(fold(r) ** 2 + (2 * (1 + r**2) / (1 + r) ** 2) ** 2)


# %%
# The special points of the branch at r = 0.5, then each of them as a curve over restitution.

branch = vi.continue_orbit(vi.find_orbit(ball)[0], "gamma", (0.9, 1.7), step=0.1)
points = {point.kind: point for point in branch.special}
assert abs(points["fold"].value - 1.047197551197) < 1e-11
assert abs(points["period_doubling"].value - 1.526823700519) < 1e-11
box = (0.1, 3.0), (0.2, 0.9)
curves = {
    kind: vi.continue_boundary(point, ("gamma", "restitution"), box).values
    for kind, point in points.items()
}
for kind, formula in (("fold", fold), ("period_doubling", doubling)):
    gamma, r = curves[kind].T
    assert np.allclose(gamma, formula(r), rtol=1e-10, atol=0)

# %%
# Left, the bounces of a table that shakes ever harder, from the apex of a bounce, with the doubling as a line; beyond
# it two speeds, then four, then chaos. Right, the curves.

first = vi.find_orbit(ball.replace(gamma=1.1))[0]
flight = vi.simulate(first.system, start=first.start, periods=0.5).isel(time=-1)
apex = vi.State(
    flight["displacement"].values, flight["velocity"].values, float(flight["time"])
)
sweep = vi.bifurcation_diagram(
    ball,
    gamma=np.linspace(1.1, 1.7, 200),
    direction="up",
    sample_impacts=60,
    transient_impacts=400,
    start=apex,
)
figure, (left, right) = plt.subplots(1, 2, figsize=(11.5, 4.6), layout="constrained")
vi.plotting.bifurcation_diagram(sweep, ax=left)
for kind, color in (("fold", "#d55e00"), ("period_doubling", "#0072b2")):
    left.axvline(points[kind].value, color=color, linewidth=1)
    right.plot(*curves[kind].T, color=color, label=kind.replace("_", " "))
right.plot(fold(r := np.linspace(0.2, 0.9, 15)), r, "k.", label="formulas")
right.plot(doubling(r), r, "k.")
right.set(
    xlabel=r"$\Gamma$",
    ylabel="restitution",
    title="one bounce per period is stable between the curves",
)
right.legend(frameon=False)
plt.show()
