"""From the solution of the equations to an orbit, and back."""

from __future__ import annotations

import math

import numpy as np

from vibroimpact.orbits.admissibility import ROUNDING, objection
from vibroimpact.orbits.equations import Cycle, Floats, parameters_of
from vibroimpact.orbits.orbit import Orbit
from vibroimpact.oscillator import ImpactOscillator

ALIKE = 1e-7  # turns, and velocities over the largest one: nearer than this, two orbits are one


def make_orbit(osc: ImpactOscillator, cycle: Cycle, z: Floats, message: str | None = None) -> Orbit:
    """Return the orbit of a solution z = (turns, velocities); `message` None asks the engine if it is admissible."""
    p = cycle.n_impacts
    rounding = ROUNDING * max(float(np.abs(z[p:]).max()), osc.velocity_scale)
    z = np.where((np.arange(2 * p) >= p) & (np.abs(z) <= rounding), 0.0, z)  # grazes
    message = objection(osc, cycle, z) if message is None else message
    return Orbit(
        oscillator=osc,
        n_periods=cycle.n_periods,
        n_impacts=p,
        velocities=tuple(float(v) for v in z[p:]),
        phases=tuple(_phase(float(s)) for s in z[:p]),
        multipliers=cycle.multipliers(parameters_of(osc), z),
        admissible=not message,
        message=message,
    )


def _phase(turns: float) -> float:
    phase = turns - math.floor(turns)
    return phase if phase < 1.0 else 0.0


def solution_of(orbit: Orbit) -> tuple[Cycle, Floats]:
    """Return the equations and the solution of an orbit; whole periods in a flight are those that come back best."""
    cycle, p = Cycle(orbit.n_periods, orbit.n_impacts), orbit.n_impacts
    parameters, turns = parameters_of(orbit.oscillator), [orbit.phases[0]]
    for i in range(p - 1):
        ahead = (orbit.phases[i + 1] - orbit.phases[i]) % 1.0

        def miss(whole: int, i: int = i, ahead: float = ahead) -> float:
            arrival = turns[i] + ahead + whole
            pair = np.array([turns[i], arrival, orbit.velocities[i], orbit.velocities[i + 1]])
            gap, _, speed, _ = Cycle(orbit.n_periods, 2).misses(parameters, pair)
            return float(abs(gap) * orbit.oscillator.natural_frequency + abs(speed))

        turns.append(turns[i] + ahead + min(range(orbit.n_periods + 1), key=miss))
    return cycle, np.array([*turns, *orbit.velocities])


def rolled(cycle: Cycle, z: Floats, first: int) -> Floats:
    """Return the same cycle told from another of its impacts, at turns in [0, 1)."""
    p = cycle.n_impacts
    turns = np.concatenate([z[first:p], z[:first] + cycle.n_periods])
    return np.concatenate([turns - np.floor(turns[0]), np.roll(z[p:], -first)])


def from_hardest(cycle: Cycle, z: Floats) -> Floats:
    """Return the cycle told from its hardest hit on."""
    return rolled(cycle, z, int(np.argmax(z[cycle.n_impacts :])))


def distance(cycle: Cycle, a: Floats, b: Floats) -> float:
    """Return how far two cycles lie apart, impact by impact: turns on the circle, velocities over the largest."""
    p = cycle.n_impacts
    turns = a[:p] - b[:p]
    apart = np.abs(turns - np.rint(turns[0])).max()
    return float(max(apart, np.abs(a[p:] - b[p:]).max() / max(np.abs(a[p:]).max(), np.abs(b[p:]).max())))


def true_name(cycle: Cycle, z: Floats) -> Cycle:
    """Return the smallest n and p with which the cycle repeats."""
    n, p = cycle.n_periods, cycle.n_impacts
    for parts in range(math.gcd(n, p), 1, -1):
        if math.gcd(n, p) % parts == 0:
            later = rolled(cycle, z, p // parts)
            turns = np.diff(np.append(z[:p], z[0] + n)) - np.diff(np.append(later[:p], later[0] + n))
            if distance(cycle, z, later) < ALIKE and np.abs(turns).max() < ALIKE:
                return Cycle(n // parts, p // parts)
    return cycle
