r"""Orbits that come to rest at the stop: from the release, through a chatter, back to the release.

The force lets a resting mass go where f sin(w t) falls through k g: once a period, always in the same state. A stick
erases all memory, so the motion from one release to the next *is* the cycle: an oscillator has one sticking
orbit or none, and it sticks once a cycle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends import recorder
from vibroimpact.backends.cpu import limits, table
from vibroimpact.backends.starts import make_cells
from vibroimpact.kernels.cell import RUNNING
from vibroimpact.options import Tolerances
from vibroimpact.orbits.orbit import Orbit
from vibroimpact.oscillator import ImpactOscillator, State
from vibroimpact.parameters import whole_number

Floats = NDArray[np.float64]

# Where the end of a chatter meets the release an engine that stops early holds a mass that would have flown on: impacts
# of 1e-12 V still leave the fate of the last 1e-6 T open. Down here only 1e-14 T are left.
FINEST = 1e-24  # of V: the cut of a chatter that is followed from a release
LONGEST = 1000  # driving periods in which a mass let go must come to rest
CREST = 0.25  # phase of the largest force: a mass put at the stop here, at rest, leaves at the very release
_ROOM = 4096  # impacts recorded at a time
_MOST_STEPS = 5e7  # certified steps in all: some seconds


@dataclass(frozen=True)
class Stick:
    """How the mass comes to rest after its release: that `periods` later it is let go again.

    `impacts` has a row (whole periods, phase, speed in m/s) for each; `fraction` is the time at rest over T.
    """

    periods: int
    impacts: Floats
    stick_phase: float
    release_phase: float
    fraction: float


def lets_go(osc: ImpactOscillator) -> bool:
    """Return whether the force both presses the mass on the stop and lets it go once a period: k |g| < f."""
    return abs(osc.stiffness * osc.gap) < osc.amplitude


def from_release(osc: ImpactOscillator, longest: int) -> Stick | None:
    """Follow the mass from its release to where it next rests at the stop, or None if that takes too many periods."""
    if not lets_go(osc) or osc.restitution == 1.0:
        return None
    cell = table(make_cells(osc, State(osc.gap, 0.0, CREST * osc.period)))[0]
    steps = min(1000.0 / (1.0 - osc.restitution), _MOST_STEPS / (longest + 2))
    allowed = limits(Tolerances(chatter=FINEST, steps_per_impact=math.ceil(steps)))
    # One look late in the last period ends a walk that never rests; room for one stick ends it at each.
    window = 0.0, 0.0, 1.0, 1.0
    memory = np.zeros(recorder.MEMORY)
    recorder.begin(cell, memory, window, (float(longest), 0.999), allowed)
    parts: list[Floats] = []
    released = False
    while True:
        impacts, looks, sticks = np.empty((_ROOM, 3)), np.empty((1, 2)), np.empty((1, 4))
        filled = np.zeros(3, np.int64)
        end = recorder.record(memory, window, (impacts, looks, sticks), filled)
        n_impacts, _, n_sticks = filled
        parts.append(impacts[:n_impacts])
        if n_sticks and released and math.isfinite(sticks[0, 2]):
            return _stick(sticks[0], np.concatenate(parts))
        released = released or (n_sticks == 1 and sticks[0, 2] == 0.0 and n_impacts == 0)
        if end != RUNNING or not released:
            return None


def _stick(row: Floats, impacts: Floats) -> Stick:
    rest_periods, rest_phase, periods, phase = row.tolist()
    return Stick(int(periods), impacts, rest_phase, phase, (periods - rest_periods) + (phase - rest_phase))


def find_sticking_orbit(
    osc: ImpactOscillator,
    n_periods: int | None = None,
    *,
    longest: int = LONGEST,
    tolerances: Tolerances | None = None,
) -> list[Orbit]:
    r"""Return the orbit on which the mass comes to rest at the stop, in a list; an empty list if there is none.

    It leaves the stop where the force stops pressing, and is at rest again once a chatter is complete:

    .. math:: \sin \psi_r = k g / f,\ \cos \psi_r < 0; \qquad
              v_{j+1} \to r v_{j+1},\quad t_\infty = \sum_j (t_{j+1} - t_j) < t_r + n T

    Parameters
    ----------
    osc : ImpactOscillator
        The seven numbers.
    n_periods : int, >= 1, optional
        Driving periods of the cycle wanted; None takes any.
    longest : int, >= 1
        Driving periods after which a mass that has not come to rest is given up.
    tolerances : Tolerances, optional
        `chatter` says which impacts are too weak to be listed; the chatter itself is followed to 1e-24 V.

    Returns
    -------
    list of Orbit
        At most one: all sticks end in the same release, so the next stick closes the cycle. Its impacts stand in the
        order of time, from the release on; `n_impacts` is -1 for a complete chatter, their number for r = 0;
        both multipliers are 0. `stuck_time` is that of the one stick in a cycle.

    Raises
    ------
    ValueError
        `n_periods` or `longest` is no whole number >= 1.

    Notes
    -----
    Empty where the mass does not come to rest within `longest` periods of its release, where the force never
    lets it go (k g <= -f) or never presses (k g >= f), and for r = 1, where no chatter ends. Phases and velocities are
    exact to rounding and the growth of errors along one cycle. About 0.3 ms at r = 0.8, growing as 1/(1 - r).

    References
    ----------
    .. [1] J.-Y. Lee, section 3.2: the motion with complete chatter at low driving frequency.

    Examples
    --------
    >>> (orbit,) = find_sticking_orbit(ImpactOscillator(omega=0.1))
    >>> orbit.name, round(orbit.stick_phase, 9), orbit.release_phase
    ('period-1 sticking', 0.112768636, 0.5)
    >>> find_sticking_orbit(ImpactOscillator(omega=2.0))
    []
    """
    wanted = None if n_periods is None else whole_number("n_periods", n_periods, 1)
    stick = from_release(osc, max(whole_number("longest", longest, 1), wanted or 1))
    if stick is None or wanted not in (None, stick.periods):
        return []
    weakest = (tolerances or Tolerances()).chatter * osc.velocity_scale
    return [sticking_orbit(osc, stick, weakest)]


def sticking_orbit(osc: ImpactOscillator, stick: Stick, weakest: float) -> Orbit:
    """Return what is known of the cycle that a stick closes, its impacts of at least `weakest` m/s listed."""
    listed = stick.impacts[stick.impacts[:, 2] >= weakest]
    return Orbit(
        oscillator=osc,
        n_periods=stick.periods,
        n_impacts=len(listed) if osc.restitution == 0.0 else -1,
        velocities=tuple(listed[:, 2].tolist()),
        phases=tuple(listed[:, 1].tolist()),
        multipliers=(0j, 0j),
        stick_phase=stick.stick_phase,
        release_phase=stick.release_phase,
        stuck_time=stick.fraction * osc.period,
    )
