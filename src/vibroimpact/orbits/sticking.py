r"""Orbits that come to rest at the stop: from the release, through a chatter, back to the release.

The force releases a resting mass where f sin(w t) falls through k g: once per period, always in the same state. A stick
erases all memory, so the motion from one release to the next *is* the cycle: an oscillator has one sticking
orbit or none, and it sticks once per cycle.

Sticking ends where the end of the chatter meets the release. Close to the release the force pressing the mass falls
linearly, a = j s with s the time still to go. In the scaled velocity q = v / (j s^2) one impact leads to the next by a
map of q alone; its fixed point is a chatter that ends in the very release:

    (1 - x)^2 (3 - x) = r (3 - 2 x),     s -> (1 - x) s,     dq -> r (3 - x) / ((3 - 2 x) (1 - x)^3) dq.

Weaker impacts complete their chatter before the release, stronger ones never do. A parameter d away from the end of
sticking therefore leaves a stuck time that goes as d^e, e = ln(1/(1 - x)) / ln(r (3 - x) / ((3 - 2 x) (1 - x)^3)),
from 1 at r = 0 down to 0.6 at r = 1: in double precision, d = 1e-16, the mass may still rest for 1e-9 of a period.

A graze does not end sticking: the impact it adds has velocity zero, and all that follows changes continuously, though
with infinite slope. So a sticking cycle is lost at the end of its own chatter, or at that of one in an earlier period.

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
from vibroimpact.motion import cycle_name
from vibroimpact.motion.neighbours import resolved
from vibroimpact.options import Tolerances
from vibroimpact.orbits.equations import Floats
from vibroimpact.orbits.orbit import Orbit, check_pair, family_of
from vibroimpact.parameters import invalid, whole_number

# Close to the end of sticking a chatter that is cut off early would hold a mass that flies on: impacts of 1e-12 V still
# leave the last 1e-6 T open. At this cutoff only 1e-14 T are left.
FINEST = 1e-24  # of V: the cutoff of a chatter that is followed from a release
LONGEST = 1000  # driving periods in which a released mass must come to rest
CREST = 0.25  # phase of the largest force: a mass put at the stop here, at rest, leaves at the very release
_ROOM = 4096  # impacts recorded at a time
_MOST_STEPS = 5e7  # certified steps in all: some seconds
_WALKS = 2000  # some 20 ms, before Python asks whether to stop


@dataclass(frozen=True)
class Stick:
    """How the mass comes to rest after its release, and is released again `periods` later.

    `impacts` has a row (whole periods, phase, speed in m/s) for each; `fraction` is the time at rest over T.
    """

    periods: int
    impacts: Floats
    stick_phase: float
    release_phase: float
    fraction: float


@lru_cache(maxsize=1)
def from_release(osc: ImpactOscillator, longest: int) -> Stick | None:
    """Follow the mass from its release to where it next rests at the stop, or None if that takes too many periods."""
    # Once per period the force presses the mass against the stop and releases it if k |g| < f.
    if abs(osc.stiffness * osc.gap) >= osc.amplitude or osc.restitution == 1.0:
        return None
    cell = osc.cells({}, State(osc.gap, 0.0, CREST * osc.period)).table[0]
    steps = min(1000.0 / (1.0 - osc.restitution), _MOST_STEPS / (longest + 2))
    allowed = limits(Tolerances(chatter=FINEST, steps_per_impact=math.ceil(steps)))
    # One look late in the last period ends a walk that never rests; room for one stick ends it at each.
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
    """Return the driving periods of the sticking cycle, 0 if it takes more than `longest` or does not exist."""
    stick = from_release(osc, longest)
    return stick.periods if stick else 0


def find_sticking_orbit(
    osc: ImpactOscillator | Model,
    n_periods: int | None = None,
    *,
    longest: int = LONGEST,
    tolerances: Tolerances | None = None,
) -> list[Orbit]:
    r"""Return the orbit on which the mass comes to rest at the stop, in a list; an empty list if there is none.

    The mass leaves the stop where the force stops pressing, and is at rest again when a chatter is complete:

    .. math:: \sin \psi_r = k g / f,\ \cos \psi_r < 0; \qquad
              v_{j+1} \to r v_{j+1},\quad t_\infty = \sum_j (t_{j+1} - t_j) < t_r + n T

    Parameters
    ----------
    osc : ImpactOscillator or family
        The oscillator; of a family, the one at its own values.
    n_periods : int, >= 1, optional
        Driving periods of the cycle; None takes any.
    longest : int, >= 1
        Driving periods after which a mass that has not come to rest is taken not to stick.
    tolerances : Tolerances, optional
        `chatter` sets the impacts too weak to be listed; the chatter itself is followed to 1e-24 V.

    Returns
    -------
    list of Orbit
        At most one: all sticks end in the same release, so the next stick closes the cycle, unless neighbours part by
        more than 1e13 on the way: then rounding decides when the mass rests again, and there is none. Its impacts are
        in the order of time, from the release on; `n_impacts` is -1 for a complete chatter, their number for r = 0;
        both multipliers are 0. `stuck_time` is that of the one stick in a cycle.

    Raises
    ------
    ValueError
        `n_periods` or `longest` is not a whole number >= 1.

    Notes
    -----
    There is none if the force never releases the mass (k g <= -f) or never presses it (k g >= f), and for r = 1, where
    no chatter completes. Phases and velocities are accurate to rounding times the growth of perturbations along one
    cycle. About 0.3 ms at r = 0.8, growing as 1/(1 - r).

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
    the_oscillator(osc)
    stick = from_release(osc.at(), max(whole_number("longest", longest, 1), wanted or 1))
    if stick is None or wanted not in (None, stick.periods) or not closes(osc.at(), stick):
        return []
    return [sticking_orbit(osc, stick, Tolerances.of(tolerances).chatter)]


def why_none(osc: ImpactOscillator, n_periods: int) -> str:
    """Return why there is no sticking orbit of so many periods, in words."""
    stick = from_release(osc, max(LONGEST, n_periods))
    if stick is None or closes(osc, stick):
        return f"no period-{n_periods} orbit sticks"
    return (
        "no orbit sticks: neighbours part by more than 1e13 from one rest to the next, so that rounding decides when "
        "the mass rests again"
    )


def closes(osc: ImpactOscillator, stick: Stick) -> bool:
    """Return whether a stick closes an orbit, rather than being an accident of rounding (`resolved`)."""
    listed = stick.impacts[stick.impacts[:, 2] >= Tolerances().chatter * osc.velocity_scale]
    time = np.append(stick.release_phase, listed[:, 0] + listed[:, 1]) * osc.period
    phase, velocity = (np.append(first, listed[:, at]) for at, first in ((1, stick.release_phase), (2, 0.0)))
    return resolved(osc, time, phase, velocity)


def sticking_orbit(model: Model, stick: Stick, chatter: float) -> Orbit:
    """Return the numbers known of the cycle that a stick closes; impacts above `chatter` times V are listed."""
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
        family=family_of(model),
    )


KIND = "end_of_sticking"
MET = 1e-7  # largest (stuck time / T)^(1/e): usually 1e-16, its square root beside a graze, 1e-2 where it jumps
LIFTED = 1e-6  # of f: a preload this close to f counts as one that the force never lifts


def scaling_exponent(restitution: float) -> float:
    """Return e of stuck time ~ distance^e at the end of sticking: 1 at r = 0, 0.6 in the limit r = 1.

    Examples
    --------
    >>> round(scaling_exponent(0.8), 6), scaling_exponent(0.0), scaling_exponent(1.0)
    (0.600318, 1.0, 0.6)
    """
    r = restitution
    if r < 1e-12 or r > 1.0 - 1e-6:
        return 1.0 if r < 0.5 else 0.6
    low, high = 0.0, 1.0
    while (x := 0.5 * (low + high)) not in (low, high):
        low, high = (x, high) if (1.0 - x) ** 2 * (3.0 - x) > r * (3.0 - 2.0 * x) else (low, x)
    growth = math.log(r * (3.0 - x) / (3.0 - 2.0 * x)) - 3.0 * math.log1p(-x)
    return -math.log1p(-x) / growth


def residual(osc: ImpactOscillator, stuck_fraction: float) -> float:
    """Return (stuck time / T)^(1/e), linear in every parameter: how far the end of the chatter is from the release."""
    return float(max(stuck_fraction, 0.0) ** (1.0 / scaling_exponent(osc.restitution)))


@dataclass(frozen=True)
class StickingEnd:
    """A point of the boundary at which a sticking cycle is lost because the end of its chatter meets the release.

    Parameters
    ----------
    oscillator : ImpactOscillator
        With the parameter at the boundary: the last value in double precision at which the mass still sticks.
    parameter, value : str, float
        What was varied, and its value there; NaN if none was found.
    n_periods : int
        Driving periods of the sticking cycle that ends here.
    stuck_fraction : float
        Time at rest over T at that value.
    residual : float
        (stuck time / T)^(1/e), which falls linearly to zero; below 1e-10 if found, or 1e-7 beside a graze.
    outcome : str
        "found"; "no_change" (the same cycle, or none, at both values), "pressed_for_ever" (beyond `value` the mass is
        never released), "unresolved" (the stuck time jumps between neighbouring numbers).
    message : str
        The outcome in a sentence.
    orbit : Orbit or None
        The sticking cycle at the boundary.
    """

    oscillator: ImpactOscillator
    parameter: str
    value: float = math.nan
    n_periods: int = 0
    stuck_fraction: float = math.nan
    residual: float = math.nan
    outcome: str = "found"
    message: str = ""
    orbit: Orbit | None = None
    kind: str = KIND

    @property
    def found(self) -> bool:
        """Whether this is an end of sticking."""
        return self.outcome == "found"


def end_of_sticking(
    osc: ImpactOscillator | Model, parameter: str, between: tuple[float, float], *, longest: int = LONGEST
) -> StickingEnd:
    r"""Find where a sticking cycle is lost: the end of its chatter meets the release, and the stuck time is zero.

    .. math:: t_\infty(p) = t_r(p) + n T(p)

    Parameters
    ----------
    osc : ImpactOscillator or family
        The model; its own value of `parameter` does not matter.
    parameter : str
        What is varied: any parameter of the model.
    between : tuple of two float
        Values of the parameter; the mass sticks at one of them; at the other it does not, or after more periods.
    longest : int, >= 1
        Driving periods after which a mass that has not come to rest is taken not to stick.

    Returns
    -------
    StickingEnd
        The boundary and its outcome; the cycle followed is that of fewer periods.

    Raises
    ------
    ValueError
        `parameter` is unknown, or `between` is not a pair of different values in its range.

    Notes
    -----
    By bisection on whether the mass rests, down to neighbouring floating-point numbers, where the stuck time is about
    1e-10 to 1e-8 of T: it vanishes as the distance to the power `scaling_exponent`. Of several ends between the values
    one is found. About 60 walks from the release, 10 to 30 ms.

    References
    ----------
    .. [1] A. B. Nordmark and P. T. Piiroinen, "Simulation and stability analysis of impacting systems with complete
       chattering", Nonlinear Dynamics 58 (2009) 85-106.

    Examples
    --------
    >>> point = end_of_sticking(ImpactOscillator(), "omega", (0.3, 0.4))
    >>> point.n_periods, round(point.value, 12)
    (1, 0.347180413266)
    """
    the_oscillator(osc)
    inside, outside = check_pair(osc, parameter, "between", between)
    longest = whole_number("longest", longest, 1)
    if inside == outside:
        raise invalid("between", between, f"two different values of {parameter}")

    def periods(value: float, most: int) -> int:
        return periods_from_release(osc.at(**{parameter: value}), most)

    lengths = {value: periods(value, longest) for value in (inside, outside)}
    if lengths[inside] == lengths[outside]:
        what = cycle_name(lengths[inside], -1) if lengths[inside] else "no sticking orbit"
        message = f"{what} at `{parameter}` = {inside:g} and at {outside:g}; give values with a change between them"
        return StickingEnd(osc.at(), parameter, outcome="no_change", message=message)
    if not lengths[inside] or 0 < lengths[outside] < lengths[inside]:
        inside, outside = outside, inside
    n_periods = lengths[inside]
    narrow = 1e-17 * abs(inside - outside)
    while abs(inside - outside) > narrow and (middle := 0.5 * (inside + outside)) not in (inside, outside):
        same = periods(middle, n_periods) == n_periods
        inside, outside = (middle, outside) if same else (inside, middle)
    if 0 < periods(outside, n_periods) < n_periods:  # lost to the chatter of an earlier period, which has its end here
        inside, outside = outside, inside
    return _point(osc.replace(**{parameter: inside}), parameter, inside, osc.at(**{parameter: outside}), n_periods)


def _point(model: Model, parameter: str, value: float, beyond: ImpactOscillator, n_periods: int) -> StickingEnd:
    osc = model.at()
    stick = from_release(osc, max(LONGEST, n_periods))
    assert stick is not None
    orbit = sticking_orbit(model, stick, Tolerances().chatter)
    fraction = orbit.stuck_time / osc.period
    remainder = residual(osc, fraction)
    outcome, message = "found", ""
    if remainder > MET and beyond.stiffness * beyond.gap <= -(1.0 - LIFTED) * beyond.amplitude:
        outcome = "pressed_for_ever"
        message = f"beyond `{parameter}` = {value!r} the force no longer lifts the mass off the stop (k g <= -f)"
    elif remainder > MET:
        outcome = "unresolved"
        message = (
            f"the mass rests for {fraction:.3g} T at `{parameter}` = {value!r} and not at the next number: "
            "a long transient magnifies rounding beyond double precision; look for cycles of fewer periods"
        )
    return StickingEnd(osc, parameter, value, orbit.n_periods, fraction, remainder, outcome, message, orbit)
