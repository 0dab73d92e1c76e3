"""What is known of one periodic orbit."""

from __future__ import annotations

import math
from dataclasses import dataclass

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
