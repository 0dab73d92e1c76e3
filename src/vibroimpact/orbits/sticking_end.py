r"""The end of sticking: where the end of the chatter of an orbit that rests at a stop meets its release.

Close to the release the force pressing the mass falls linearly, a = j s with s the time still to go. In the scaled
velocity q = v / (j s^2) one impact leads to the next by a map of q alone; its fixed point is a chatter that ends in the
very release:

    (1 - x)^2 (3 - x) = r (3 - 2 x),     s -> (1 - x) s,     dq -> r (3 - x) / ((3 - 2 x) (1 - x)^3) dq.

Weaker impacts complete their chatter before the release, stronger ones never do. A parameter d away from the end of
sticking therefore leaves a stuck time that goes as d^e, e = ln(1/(1 - x)) / ln(r (3 - x) / ((3 - 2 x) (1 - x)^3)),
from 1 at r = 0 down to 0.6 at r = 1: in double precision, d = 1e-16, the mass may still rest for 1e-9 of a period.

A graze does not end sticking: the impact it adds has velocity zero, and all that follows changes continuously, though
with infinite slope. So a sticking cycle of one mass is lost at the end of its own chatter, or at that of one in an
earlier period. That of a system may also fold, or be lost at a graze, while it still rests.

The local law is that of A. B. Nordmark and P. T. Piiroinen, "Simulation and stability analysis of impacting systems
with complete chattering", Nonlinear Dynamics 58 (2009) 85-106.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from vibroimpact.model import Model, check_model
from vibroimpact.model.oscillator import ImpactOscillator
from vibroimpact.motion import cycle_name
from vibroimpact.options import Tolerances
from vibroimpact.orbits.orbit import check_pair
from vibroimpact.orbits.resting import resting_orbits
from vibroimpact.orbits.search import find_orbit
from vibroimpact.orbits.sticking import LONGEST, from_release, periods_from_release, sticking_orbit
from vibroimpact.orbits.systems.sticking import periods_from_rest
from vibroimpact.parameters import invalid, whole_number

KIND = "end_of_sticking"
MET = 1e-7  # largest (stuck time / T)^(1/e): usually 1e-16, its square root beside a graze, 1e-2 where it jumps
FOLDS = 1e-3  # a multiplier as near to 1, which goes to it as the root of the distance
STEP = 0.02  # of the way between two values: the longest to the next orbit of a system
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


def residual(restitution: float, stuck_fraction: float) -> float:
    """Return (stuck time / T)^(1/e), linear in every parameter: how far the end of the chatter is from the release."""
    return float(max(stuck_fraction, 0.0) ** (1.0 / scaling_exponent(restitution)))


@dataclass(frozen=True)
class StickingEnd:
    """A point of the boundary at which a sticking cycle is lost because the end of its chatter meets the release.

    Parameters
    ----------
    oscillator : ImpactOscillator or ImpactSystem
        With the parameter at the boundary: the last value in double precision at which the orbit still rests.
    parameter, value : str, float
        What was varied, and its value there; NaN if none was found.
    n_periods : int
        Driving periods of the sticking cycle that ends here.
    stuck_fraction : float
        Time at rest over T at that value, at all stops together.
    residual : float
        (stuck time / T)^(1/e), which falls linearly to zero; below 1e-10 if found, or 1e-7 beside a graze.
    outcome : str
        "found"; "no_change" (the same cycle, or none, at both values), "pressed_for_ever" (beyond `value` the mass is
        never released), "unresolved" (the stuck time jumps between neighbouring numbers), "lost" (of a system: no next
        orbit is found, though this one still rests: it folds, or grazes a stop).
    message : str
        The outcome in a sentence.
    orbit : Orbit, SystemOrbit or None
        The sticking cycle at the boundary.
    """

    oscillator: Any
    parameter: str
    value: float = math.nan
    n_periods: int = 0
    stuck_fraction: float = math.nan
    residual: float = math.nan
    outcome: str = "found"
    message: str = ""
    orbit: Any = None
    kind: str = KIND

    @property
    def found(self) -> bool:
        """Whether this is an end of sticking."""
        return self.outcome == "found"


def end_of_sticking(osc: Model, parameter: str, between: tuple[float, float], *, longest: int = LONGEST) -> StickingEnd:
    r"""Find where a sticking cycle is lost: the end of its chatter meets the release, and the stuck time is zero.

    .. math:: t_\infty(p) = t_r(p) + n T(p)

    Parameters
    ----------
    osc : ImpactOscillator, ImpactSystem or family
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
    One mass: by bisection on whether the mass rests, down to neighbouring floating-point numbers, where the stuck time
    is about 1e-10 to 1e-8 of T: it vanishes as the distance to the power `scaling_exponent`. Of several ends between
    the values one is found. About 60 walks from the release, 10 to 30 ms.

    For systems, the cycle is that to which the motion from rest settles at the value at which it rests; at the first
    one, or that of fewer periods, where it does at both. It is followed towards the other value, stable or not, in
    steps that are halved down to neighbouring numbers. A chatter is cut off at 1e-9 V, so that the boundary is some
    1e-11 from its place. About 100 orbits, 2 to 10 s.

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
    check_model(osc)
    inside, outside = check_pair(osc, parameter, "between", between)
    longest = whole_number("longest", longest, 1)
    if inside == outside:
        raise invalid("between", between, f"two different values of {parameter}")
    one_mass = osc.at().forgets

    def periods(value: float, most: int) -> int:
        model = osc.replace(**{parameter: value})
        return periods_from_release(model.at(), most) if one_mass else periods_from_rest(model.at(), most)

    lengths = {value: periods(value, longest) for value in (inside, outside)}
    if lengths[inside] == lengths[outside] and (one_mass or not lengths[inside]):
        what = cycle_name(lengths[inside], -1) if lengths[inside] else "no sticking orbit"
        message = f"{what} at `{parameter}` = {inside:g} and at {outside:g}; give values with a change between them"
        return StickingEnd(osc.at(), parameter, outcome="no_change", message=message)
    if not lengths[inside] or 0 < lengths[outside] < lengths[inside]:
        inside, outside = outside, inside
    n_periods = lengths[inside]
    if not one_mass:
        return _followed(osc, parameter, inside, outside, n_periods)
    narrow = 1e-17 * abs(inside - outside)
    while abs(inside - outside) > narrow and (middle := 0.5 * (inside + outside)) not in (inside, outside):
        same = periods(middle, n_periods) == n_periods
        inside, outside = (middle, outside) if same else (inside, middle)
    if 0 < periods(outside, n_periods) < n_periods:  # lost to the chatter of an earlier period, which has its end here
        inside, outside = outside, inside
    return _point(osc.replace(**{parameter: inside}), parameter, inside, osc.at(**{parameter: outside}), n_periods)


def _followed(model: Model, parameter: str, inside: float, outside: float, n_periods: int) -> StickingEnd:
    """Return where the orbit that rests at a value of a parameter is lost on the way to another."""
    found = find_orbit(model.replace(**{parameter: inside}), n_periods=n_periods, n_impacts=-1)
    if not found:
        return StickingEnd(model.at(), parameter, outcome="unresolved", message=found.message)
    *_, orbit = resting_orbits(found[0], parameter, outside, STEP * abs(outside - inside))
    value, (outcome, missed) = orbit.value(parameter), ending(orbit)
    fraction, message = orbit.stuck_time / orbit.oscillator.period, ""
    if value == outside:
        outcome = "no_change"
        message = f"the {orbit.name} orbit of `{parameter}` = {inside:g} goes on to {outside:g}"
    elif outcome != KIND:
        why = "it folds" if outcome == "fold" else "no next one is found"
        message = f"the orbit still rests for {fraction:.3g} T at `{parameter}` = {value!r}, where {why}"
        outcome = "lost"
    else:
        outcome = "found"
    return StickingEnd(orbit.oscillator, parameter, value, n_periods, fraction, missed, outcome, message, orbit)


def ending(orbit: Any) -> tuple[str, float]:
    """Return how a branch ends whose last orbit this is, which rests at a stop, and by how much it misses that.

    At the end of sticking, at a fold, or lost, where its next orbit would graze a stop.
    """
    (stop, *_), *_ = orbit.rests
    restitution = orbit.oscillator.stops[orbit.oscillator.stop_names.index(stop)].element.rebound(0.0)
    missed = residual(restitution, orbit.stuck_time / orbit.oscillator.period)
    if missed <= MET:
        return KIND, missed
    away = min(abs(multiplier - 1.0) for multiplier in orbit.multipliers)
    return ("fold", away) if away < FOLDS else ("lost", missed)


def _point(model: Model, parameter: str, value: float, beyond: ImpactOscillator, n_periods: int) -> StickingEnd:
    osc = model.at()
    stick = from_release(osc, max(LONGEST, n_periods))
    assert stick is not None
    orbit = sticking_orbit(model, stick, Tolerances().chatter)
    fraction = orbit.stuck_time / osc.period
    missed = residual(osc.restitution, fraction)
    outcome, message = "found", ""
    if missed > MET and beyond.stiffness * beyond.gap <= -(1.0 - LIFTED) * beyond.amplitude:
        outcome = "pressed_for_ever"
        message = f"beyond `{parameter}` = {value!r} the force no longer lifts the mass off the stop (k g <= -f)"
    elif missed > MET:
        outcome = "unresolved"
        message = (
            f"the mass rests for {fraction:.3g} T at `{parameter}` = {value!r} and not at the next number: "
            "a long transient magnifies rounding beyond double precision; look for cycles of fewer periods"
        )
    return StickingEnd(osc, parameter, value, orbit.n_periods, fraction, missed, outcome, message, orbit)
