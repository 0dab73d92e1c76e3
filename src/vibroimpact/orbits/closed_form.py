r"""Orbits with one impact, in closed form.

Over nT the gap returns to zero and the velocity to v if, with the flight's responses q, q', E0 = E(0), E = E(i w),

    (f/m) Im(e^{i psi} E)          = r q v + (k g/m) E0,
    (f/m) Im(e^{i psi} (q + i w E)) = (1 + r q') v + (k g/m) q.

Two linear equations give sin psi and cos psi as straight lines in v; sin^2 + cos^2 = 1 is a quadratic in v. This is
the usual (alpha^2 + beta^2/w^2) v^2 + 2 alpha g v + g^2 - R^2 = 0 (Shaw and Holmes, J. Sound Vib. 90 (1983) 129-155),
but no term of it is infinite at resonance.
"""

from __future__ import annotations

import math

import numpy as np

from vibroimpact.orbits.equations import TURN, Floats, flight_of, parameters_of
from vibroimpact.oscillator import ImpactOscillator

VANISHED = 1e-12  # relative: a response this small is rounding
BOUNDLESS = 1e12  # of V: a velocity this large stands for infinity


def impact_1_orbits(osc: ImpactOscillator, n_periods: int) -> tuple[list[Floats], str]:
    """Return every (turns, velocity) of a period-n impact-1 orbit, the faster first, and why there is none, if so."""
    if osc.amplitude == 0.0:
        return [], _unforced(osc)
    flight, tau = flight_of(parameters_of(osc)), n_periods * osc.period
    q, dq = flight.kick(tau)
    steady, driven = flight.driven(0.0, tau, q, dq).real, flight.driven(1j * osc.omega, tau, q, dq)
    if abs(driven) <= VANISHED * tau / max(osc.omega, osc.natural_frequency):
        return [], (
            f"undamped, and {n_periods} driving period{'s are' if n_periods > 1 else ' is'} a whole number of free "
            "periods: each flight returns unchanged by the force, which cannot make up for the loss at impact"
        )
    velocity = q + 1j * osc.omega * driven
    force, r, preload = osc.amplitude / osc.mass, osc.restitution, osc.stiffness * osc.gap / osc.mass
    matrix = force * np.array([[driven.real, driven.imag], [velocity.real, velocity.imag]])
    # (sin psi, cos psi) = slope v + shift
    slope = np.asarray(np.linalg.solve(matrix, [r * q, 1.0 + r * dq]), dtype=np.float64)
    shift = np.linalg.solve(matrix, [preload * steady, preload * q])
    speeds = _roots(float(slope @ slope), float(slope @ shift), float(shift @ shift) - 1.0)
    speeds = [v for v in speeds if 0.0 < v < BOUNDLESS * osc.velocity_scale]
    if not speeds:
        return [], _nowhere(osc, slope, n_periods)
    return [np.array([math.atan2(*(slope * v + shift)) / TURN % 1.0, v]) for v in speeds], ""


def _roots(a: float, b: float, c: float) -> list[float]:
    """Return the real roots of a x^2 + 2 b x + c = 0, the larger first, without cancellation."""
    split = b * b - a * c
    if split < 0.0 or (a == 0.0 and b == 0.0):
        return []
    half = -(b + math.copysign(math.sqrt(split), b))
    found = {half / a if a else math.inf, c / half if half else 0.0}
    return sorted(found, reverse=True)


def _unforced(osc: ImpactOscillator) -> str:
    if osc.restitution == 1.0 and osc.damping == 0.0:
        return "unforced and without loss: any free motion that reaches the stop repeats at its own period"
    return "unforced: impacts and damping dissipate energy, and nothing supplies it"


def _nowhere(osc: ImpactOscillator, slope: Floats, n_periods: int) -> str:
    if float(np.abs(slope).max()) * osc.velocity_scale < 1.0 / BOUNDLESS:
        return "undamped, without loss and in resonance: impact velocities grow without bound"
    reach = osc.steady_amplitude
    far = f", beyond the steady amplitude {reach:.6g} m" if abs(osc.gap) > reach else ""
    return f"no velocity > 0 returns to itself after {n_periods} periods: the gap is {osc.gap:.6g} m{far}"
