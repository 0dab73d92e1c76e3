r"""Orbits that come to rest at the stop: from the release, through a chatter, back to the release.

The force releases a resting mass when f sin(w t) falls through k g: once per period, always in the same state. A stick
erases all memory, so the motion from one release to the next is the whole cycle: an oscillator has at most one sticking
orbit, which sticks once per cycle.

Chatter and its limit are those of C. Budd and F. Dux, "Chattering and related behaviour in impact oscillators", Phil.
Trans. R. Soc. Lond. A 347 (1994) 365-389, and of A. B. Nordmark and P. T. Piiroinen, "Simulation and stability analysis
of impacting systems with complete chattering", Nonlinear Dynamics 58 (2009) 85-106.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from vibroimpact.backends.scalar import limits
from vibroimpact.kernels.advance import LOOK, TRACE
from vibroimpact.kernels.cell import RUNNING
from vibroimpact.kernels.recorder import END, MEMORY, Recorder, begin, record
from vibroimpact.model import Model, State
from vibroimpact.model.oscillator import ImpactOscillator, the_oscillator
from vibroimpact.motion.recognition import resolved
from vibroimpact.options import Tolerances
from vibroimpact.orbits.equations import Floats
from vibroimpact.orbits.orbit import Orbit, family_of
from vibroimpact.parameters import whole_number

# Near the end of sticking, a chatter that is cut off too early would hold a mass that really flies on: impacts of 1e-12
# V still leave the last 1e-6 T undecided. At this cutoff only 1e-14 T is undecided.
FINEST = 1e-24  # of V: the cutoff of a chatter that is followed from a release
LONGEST = 1000  # driving periods in which a released mass must come to rest
CREST = 0.25  # phase of the largest force: a mass put at rest at the stop here leaves exactly at the release
_ROOM = 4096  # impacts recorded per call
_MOST_STEPS = 5e7  # certified steps in all: a few seconds
_WALKS = 2000  # steps per call, about 20 ms, between checks for an interrupt


@dataclass(frozen=True)
class Stick:
    """The motion of the mass from its release to rest and to the next release, `periods` later.

    `impacts` has a row (whole periods, phase, speed in m/s) for each; `fraction` is the time at rest over T.
    """

    periods: int
    impacts: Floats
    stick_phase: float
    release_phase: float
    fraction: float


@lru_cache(maxsize=1)
def from_release(osc: ImpactOscillator, longest: int) -> Stick | None:
    """Follow the mass from its release to its next rest at the stop; None if that takes too many periods."""
    # Once per period the force presses the mass against the stop and releases it if k |g| < f.
    if abs(osc.stiffness * osc.gap) >= osc.amplitude or osc.restitution == 1.0:
        return None
    cell = osc.cells({}, State(osc.gap, 0.0, CREST * osc.period)).table[0]
    steps = min(1000.0 / (1.0 - osc.restitution), _MOST_STEPS / (longest + 2))
    allowed = limits(Tolerances(chatter=FINEST, steps_per_impact=math.ceil(steps)))
    # One sample late in the last period ends a run that never rests; a buffer of one stick ends it at each rest.
    window = 0.0, 0.0, 1.0, 1.0
    memory = np.zeros(MEMORY)
    begin(cell, memory, window, (float(longest), 0.999), allowed)
    trace = np.empty((LOOK, TRACE))
    parts: list[Floats] = []
    released = False
    while True:
        recorder = Recorder(memory, np.empty((_ROOM, 3)), np.empty((1, 2)), np.empty((1, 4)), np.zeros(3, np.int64))
        while memory[END] == RUNNING and recorder.filled[0] < _ROOM and not recorder.filled[2]:
            record(recorder, trace, _WALKS)
        n_impacts, _, n_sticks = recorder.filled
        parts.append(recorder.impacts[:n_impacts])
        if n_sticks and released and math.isfinite(recorder.sticks[0, 2]):
            before, stick_phase, periods, phase = recorder.sticks[0].tolist()
            fraction = (periods - before) + (phase - stick_phase)
            return Stick(int(periods), np.concatenate(parts), stick_phase, phase, fraction)
        released = released or (n_sticks == 1 and recorder.sticks[0, 2] == 0.0 and n_impacts == 0)
        if memory[END] != RUNNING or not released:
            return None


def periods_from_release(osc: ImpactOscillator, longest: int) -> int:
    """Return the driving periods of the sticking cycle; 0 if it has more than `longest` or does not exist."""
    stick = from_release(osc, longest)
    return stick.periods if stick else 0


def find_sticking_orbit(
    osc: ImpactOscillator | Model,
    n_periods: int | None = None,
    *,
    longest: int = LONGEST,
    tolerances: Tolerances | None = None,
) -> list[Orbit]:
    r"""Find the orbit on which the mass comes to rest at the stop.

    The mass leaves the stop when the force ceases to press it there, and is at rest again when a chatter is complete:

    .. math:: \sin \psi_r = k g / f,\ \cos \psi_r < 0; \qquad
              v_{j+1} \to r v_{j+1},\quad t_\infty = \sum_j (t_{j+1} - t_j) < t_r + n T

    Parameters
    ----------
    osc : ImpactOscillator or family
        The oscillator; a family is taken at its own values.
    n_periods : int, >= 1, optional
        Driving periods of the cycle; None allows any number.
    longest : int, >= 1
        Number of driving periods without a rest after which the mass is taken not to stick.
    tolerances : Tolerances, optional
        Impacts below `chatter` (relative to V) are not listed; the chatter itself is followed to 1e-24 V.

    Returns
    -------
    list of Orbit
        One orbit, or an empty list. All sticks end in the same release, so the next stick closes the cycle. No orbit is
        listed if perturbations grow by more than 1e13 on the way, since rounding then decides when the mass rests
        again. The impacts are in the order of time, beginning at the release; `n_impacts` is -1 for a complete chatter
        and the number of impacts for r = 0; both multipliers are 0. `stuck_time` is the duration of the one stick in a
        cycle.

    Raises
    ------
    ValueError
        `n_periods` or `longest` is not a whole number >= 1.

    Notes
    -----
    There is no such orbit if the force never releases the mass (k g <= -f) or never presses it against the stop (k g >=
    f), or if r = 1, for which no chatter completes. Phases and velocities are accurate to rounding times the growth of
    perturbations along one cycle. A search takes about 0.3 ms at r = 0.8, growing as 1/(1 - r).

    References
    ----------
    .. [1] C. Budd and F. Dux, "Chattering and related behaviour in impact oscillators", Phil. Trans. R. Soc. Lond. A
       347 (1994) 365-389.

    Examples
    --------
    >>> (orbit,) = find_sticking_orbit(ImpactOscillator(omega=0.1))
    >>> orbit.name, round(orbit.stick_phase, 9), orbit.release_phase
    ('period-1 sticking', 0.112768636, 0.5)
    >>> find_sticking_orbit(ImpactOscillator(omega=2.0))
    []
    """
    wanted = None if n_periods is None else whole_number("n_periods", n_periods, 1)
    design = the_oscillator(osc)
    stick = from_release(design, max(whole_number("longest", longest, 1), wanted or 1))
    if stick is None or wanted not in (None, stick.periods) or not closes(design, stick):
        return []
    return [sticking_orbit(osc, stick, Tolerances.of(tolerances).chatter)]


def why_none(osc: ImpactOscillator, n_periods: int) -> str:
    """Return the reason why there is no sticking orbit with this number of periods."""
    stick = from_release(osc, max(LONGEST, n_periods))
    if stick is None or closes(osc, stick):
        return f"no period-{n_periods} orbit sticks"
    return (
        "no orbit sticks: perturbations grow by more than 1e13 from one rest to the next, so rounding decides when "
        "the mass rests again"
    )


def closes(osc: ImpactOscillator, stick: Stick) -> bool:
    """Return whether a stick closes an orbit, rather than being determined by rounding (see `resolved`)."""
    listed = stick.impacts[stick.impacts[:, 2] >= Tolerances().chatter * osc.velocity_scale]
    time = np.append(stick.release_phase, listed[:, 0] + listed[:, 1]) * osc.period
    phase, velocity = (np.append(first, listed[:, at]) for at, first in ((1, stick.release_phase), (2, 0.0)))
    return resolved(osc, time, phase, velocity)


def sticking_orbit(model: Model, stick: Stick, chatter: float) -> Orbit:
    """Return the orbit closed by a stick; impacts above `chatter` times V are listed."""
    osc = model.at()
    listed = stick.impacts[stick.impacts[:, 2] >= chatter * osc.velocity_scale]
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
        family=family_of(model, osc),
        turns=tuple((listed[:, 0] + listed[:, 1]).tolist()),
    )
