"""The growth of perturbations of one mass's motion, computed from impact to impact."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.model.oscillator import ImpactOscillator

UNRESOLVED = math.log(1e13)  # ln of the growth between two rests beyond which rounding decides when the second comes


def separations(osc: ImpactOscillator, time: Floats, phase: Floats, velocity: Floats) -> Floats:
    r"""Return ln of the growth of a perturbation since the first of some impacts, after each later one.

    A perturbation :math:`(\delta y, \delta\dot y)` obeys the homogeneous equation in flight. At an impact with speed v
    before it and accelerations :math:`a_-, a_+` before and after, it obeys the saltation (theory, equation 5.1; P. C.
    Müller, Chaos, Solitons & Fractals 5, 1671 (1995), for exponents of systems with jumps)

    .. math:: \delta y \to -r\,\delta y, \qquad
              \delta\dot y \to \frac{a_+ + r a_-}{v}\,\delta y - r\,\delta\dot y.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> osc = vi.ImpactOscillator(omega=2.8)
    >>> hits = vi.impact_section(osc, sample_impacts=1000)
    >>> grown = separations(osc, hits.time.values, hits.phase.values, hits.velocity.values)
    >>> round(float(grown[-1]) / 999, 2)  # the exponent per impact of `parameter_map`
    0.28
    """
    grown: list[float] = []
    total, scale = 0.0, osc.natural_frequency
    y, rate = 1.0, scale
    for a, b, d, e in _across(osc, time, phase, velocity):
        y, rate = a * y + b * rate, d * y + e * rate
        size = math.hypot(y * scale, rate)
        if not size:  # the perturbation has become zero
            return np.array([*grown, -math.inf])
        total += math.log(size)
        grown.append(total)
        y, rate = y / size, rate / size
    return np.array(grown)


def resolved(osc: ImpactOscillator, time: Floats, phase: Floats, velocity: Floats) -> bool:
    """Return whether double precision resolves the motion from a release, the first row, through impacts to the next.

    It does unless perturbations grow by 1e13 between any two of the times: beyond that, rounding decides when the mass
    rests again, and the motion is not an orbit of the oscillator. As in `describe_turn` of the kernels, perturbations
    begin as (1, 0.7) in units of a step's length and speed, and begin again when they become smaller than that.
    """
    from vibroimpact.kernels.flight import REACH  # slower to import

    step = REACH / float(osc.cells({}).fastest_rate[0])
    begin = 1.0, 0.7
    (y, rate), whole = begin, sum(begin)
    for a, b, d, e in _across(osc, time, phase, velocity):
        y, rate = a * y + b * rate / step, step * d * y + e * rate
        size = abs(y) + abs(rate)
        if size >= math.exp(UNRESOLVED) * whole:
            return False
        if size < whole:
            y, rate = begin
    return True


def _across(
    osc: ImpactOscillator, time: Floats, phase: Floats, velocity: Floats
) -> Iterator[tuple[float, float, float, float]]:
    """Yield the matrices that carry a perturbation from just after one impact to just after the next, by rows."""
    m, c, k, r = osc.mass, osc.damping, osc.stiffness, osc.restitution
    half, flight, speed = 0.5 * c / m, np.diff(time), velocity[1:]
    root = np.sqrt(complex(k / m - half * half))  # imaginary above critical damping
    damped = np.exp(-half * flight)
    cosine = damped * np.cos(root * flight).real
    sine = damped * ((np.sin(root * flight) / root).real if root else flight)
    force = (osc.amplitude * np.sin(2.0 * np.pi * phase[1:]) - k * osc.gap) / m
    salt = ((force + r * c / m * speed) + r * (force - c / m * speed)) / speed
    columns = cosine + half * sine, sine, -k / m * sine, cosine - half * sine, salt
    for a, b, d, e, kick in zip(*(column.tolist() for column in columns), strict=True):  # numbers of Python are faster
        yield -r * a, -r * b, kick * a - r * d, kick * b - r * e
