"""
Grazing at resonance
====================

Where a steady motion first touches its stop, R = g, a small impact is born, and it stretches neighbouring motions
like a square root: mostly the motion with that impact is unstable from the beginning. Not so where the driving
frequency is twice the damped natural frequency. There the impact comes back after half a natural swing, whatever its
size, and the motion with it is stable. Nearby, the curves on which it folds or doubles its period leave the grazing
curve as its tangents: their distance from it grows as the square of the detuning.
"""

import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi

osc = vi.ImpactOscillator(damping=0.1, restitution=0.8)
resonance = 2.0 * np.sqrt(1.0 - 0.05**2)  # twice the damped natural frequency


def radius(omega):
    """Return the amplitude of the steady motion without the stop."""
    return osc.replace(omega=omega).steady_amplitude


def follow(kind, detuning, beyond):
    """Return detuning and R - g along the curve of that kind, from its point next to the grazing curve on."""
    omega = resonance + detuning
    grazing = radius(omega)
    orbit = vi.find_orbit(osc.replace(omega=omega, gap=grazing + beyond))[0]
    branch = vi.continue_orbit(
        orbit, "gap", (grazing - 0.01, grazing + 0.01), step=0.01
    )
    (point,) = (point for point in branch.special if point.kind == kind)
    ranges = (resonance - 0.06, resonance + 0.06), (0.25, 0.42)
    omegas, gaps = vi.continue_boundary(
        point, ("omega", "gap"), ranges, step=0.02
    ).values.T
    return (
        grazing - point.value,
        omegas - resonance,
        np.array([radius(omega) for omega in omegas]) - gaps,
    )


# %%
# At a detuning of 0.01 the doubling lies 0.80459502e-4 below the grazing curve. Over the square of the detuning the
# distance is nearly constant, on either curve.

doubled, doubling_at, doubling = follow("period_doubling", 0.01, -5e-5)
assert abs(doubled / 1e-4 - 0.80459502) < 1e-8
_, fold_at, fold = follow("fold", -0.01, 2e-4)
for detuning, distance in ((doubling_at, doubling), (fold_at, fold)):
    ratio = distance / detuning**2
    assert np.ptp(ratio) < 0.2 * abs(
        ratio.mean()
    )  # while the square itself changes by a thousand

# %%
# Below the line R = g the steady motion strikes the stop; the fold lies above it: there the silent motion coexists
# with one that hits.

figure, axes = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
for ax, detuning, distance, name, color in (
    (axes[0], doubling_at, -1e3 * doubling, "period doubling", "#0072b2"),
    (axes[1], fold_at, -1e3 * fold, "fold", "#d55e00"),
):
    order = np.argsort(detuning)
    ax.plot(detuning[order], distance[order], color=color, label=name)
    ax.axhline(0.0, color="0.3", linestyle="--", label="grazing, g = R")
    ax.set(
        xlabel="driving frequency less twice the damped natural one [rad/s]",
        ylabel="g - R [mm]",
    )
    ax.legend(frameon=False)
figure.suptitle("Both curves are tangent to the grazing curve at resonance")
plt.show()
