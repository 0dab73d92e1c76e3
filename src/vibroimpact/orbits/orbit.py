"""One periodic orbit: what is known of it, how it follows from a solution of the equations, and which are the same."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vibroimpact.orbits.admissibility import ROUNDING, objection
from vibroimpact.orbits.equations import Cycle, Floats, parameters_of
from vibroimpact.oscillator import ImpactOscillator, State


@dataclass(frozen=True)
class Orbit:
    """A period-n impact-p motion, stable or not, of one oscillator.

    Parameters
    ----------
    oscillator : ImpactOscillator
        Whose motion it is.
    n_periods : int, >= 1
        Driving periods in a cycle.
    n_impacts : int, >= 1 or -1
        Impacts in a cycle; -1 for a complete chatter.
    velocities : tuple of float
        Speeds just before contact, in m/s, in the order of time; of a complete chatter those above its cut.
    phases : tuple of float
        Driving phases of these impacts, in [0, 1).
    multipliers : tuple of two complex
        Floquet multipliers of the cycle, in (y, y'); both 0 for an orbit that sticks, whose memory is erased.
    admissible : bool
        Whether the mass really moves so: no contact before the next impact, no velocity away from the stop.
    message : str
        Why it is not admissible; empty where it is.
    stick_phase, release_phase : float
        Driving phases, in [0, 1), at which the mass comes to rest at the stop and leaves it; NaN where it does not.
    stuck_time : float
        Time at rest in a cycle, in s.

    Examples
    --------
    >>> from vibroimpact import ImpactOscillator, find_orbit
    >>> orbit = find_orbit(ImpactOscillator(omega=2.0))[0]
    >>> orbit.name, orbit.stable, round(orbit.velocities[0], 6)
    ('period-1 impact-1', True, 6.226413)
    """

    oscillator: ImpactOscillator
    n_periods: int
    n_impacts: int
    velocities: tuple[float, ...]
    phases: tuple[float, ...]
    multipliers: tuple[complex, complex]
    admissible: bool = True
    message: str = ""
    stick_phase: float = math.nan
    release_phase: float = math.nan
    stuck_time: float = 0.0

    @property
    def trace(self) -> float:
        """Trace of the cycle's Jacobian: the sum of the multipliers."""
        return sum(self.multipliers).real

    @property
    def determinant(self) -> float:
        """Determinant of the cycle's Jacobian, r^(2p) exp(-c n T/m): the product of the multipliers."""
        return (self.multipliers[0] * self.multipliers[1]).real

    @property
    def sticks(self) -> bool:
        """Whether the mass comes to rest at the stop."""
        return self.stuck_time > 0.0

    @property
    def stable(self) -> bool:
        """Whether neighbours approach it: both multipliers lie inside the unit circle."""
        return max(map(abs, self.multipliers)) < 1.0

    @property
    def period(self) -> float:
        """Length of the cycle in s."""
        return self.n_periods * self.oscillator.period

    @property
    def lyapunov(self) -> float:
        """Largest exponent in 1/s: ln of the spectral radius over the cycle's time; -inf for an orbit that sticks."""
        radius = max(map(abs, self.multipliers))
        return math.log(radius) / self.period if radius > 0.0 else -math.inf

    @property
    def name(self) -> str:
        """The motion in two or three words."""
        return f"period-{self.n_periods} " + ("sticking" if self.sticks else f"impact-{self.n_impacts}")

    @property
    def start(self) -> State:
        """A state on the orbit: at its first impact, or at its release from the stop."""
        phase, velocity = (self.release_phase, 0.0) if self.sticks else (self.phases[0], self.velocities[0])
        return State(self.oscillator.gap, velocity, phase * self.oscillator.period)


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
