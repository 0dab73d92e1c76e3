r"""The end of sticking: the boundary on which the chatter of a sticking orbit ends exactly at its release.

Close to the release, the pressing acceleration falls linearly, a = j s, where s is the time left until the release. In
the scaled velocity q = v / (j s^2), each impact follows from the last by a map of q alone; the fixed point of this map
is a chatter that ends exactly at the release:

    (1 - x)^2 (3 - x) = r (3 - 2 x),     s -> (1 - x) s,     dq -> r (3 - x) / ((3 - 2 x) (1 - x)^3) dq.

Weaker impacts complete their chatter before the release, stronger ones never do. At a distance d of the parameter from
the end of sticking, the stuck time is therefore proportional to d^e, e = ln(1/(1 - x)) / ln(r (3 - x) / ((3 - 2 x) (1 -
x)^3)), which falls from 1 at r = 0 to 0.6 at r = 1. At the resolution of double precision, d = 1e-16, the mass may
still rest for 1e-9 of a period.

A graze does not end sticking: the impact it adds has velocity zero, and the motion after it changes continuously,
though with infinite slope. A sticking cycle of one mass is therefore lost at the end of its own chatter, or of a
chatter in an earlier period. A sticking cycle of a system may also end in a fold or at a graze while it still rests.

The local law is due to A. B. Nordmark and P. T. Piiroinen, "Simulation and stability analysis of impacting systems with
complete chattering", Nonlinear Dynamics 58 (2009) 85-106.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from vibroimpact.model import Model, check_model
from vibroimpact.model.oscillator import ImpactOscillator
from vibroimpact.model.units import check_pair
from vibroimpact.motion import cycle_name
from vibroimpact.options import Tolerances
from vibroimpact.orbits.search import find_orbit
from vibroimpact.orbits.sticking import LONGEST, from_release, periods_from_release, sticking_orbit
from vibroimpact.orbits.systems.sticking import periods_from_rest
from vibroimpact.parameters import invalid, whole_number
from vibroimpact.progress import reporter

KIND = "end_of_sticking"
MET = 1e-7  # largest (stuck time / T)^(1/e): usually 1e-16, 1e-8 near a graze, 1e-2 where the stuck time jumps
FOLDS = 1e-3  # by which the distance of a multiplier from 1 falls up to a fold, as the square root of that of the value
STEP = 0.02  # of the interval between two values: longest step to the next orbit of a system
LIFTED = 1e-6  # of f: a preload closer to f than this counts as one that the force never overcomes
NEAREST = 2.0**-52  # of a value: steps are halved down to neighbouring floating-point numbers
SUDDEN = 0.05  # largest change per step, in time at rest over T or of the hardest impact


def scaling_exponent(restitution: float) -> float:
    """Return the exponent e in stuck time ~ distance^e at the end of sticking: 1 at r = 0, 0.6 in the limit r = 1.

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
    """Return (stuck time / T)^(1/e), which goes to zero linearly in every parameter at the end of sticking."""
    return float(max(stuck_fraction, 0.0) ** (1.0 / scaling_exponent(restitution)))


@dataclass(frozen=True)
class StickingEnd:
    """A point on the boundary where a sticking cycle is lost because the end of its chatter meets the release.

    Parameters
    ----------
    oscillator : ImpactOscillator or ImpactSystem
        The model at the boundary: `parameter` has the last value in double precision at which the orbit still rests.
    parameter, value : str, float
        The parameter varied, and its value at the boundary; NaN if none was found.
    n_periods : int
        Driving periods of the sticking cycle that ends at the boundary.
    stuck_fraction : float
        Time at rest over T at that value, summed over all stops.
    residual : float
        (stuck time / T)^(1/e), which falls linearly to zero; below 1e-10 if found (1e-7 near a graze).
    outcome : str
        "found"; "no_change" (the same cycle, or none, at both values), "pressed_for_ever" (beyond `value` the mass is
        never released), "unresolved" (the stuck time jumps between neighbouring floating-point numbers), "lost"
        (systems only: no next orbit is found although this one still rests, as at a fold or a graze).
    message : str
        The outcome in a sentence.
    orbit : Orbit or None
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
    r"""Find the parameter value at which a sticking cycle is lost: its chatter ends at the release, with no stuck time.

    .. math:: t_\infty(p) = t_r(p) + n T(p)

    Parameters
    ----------
    osc : ImpactOscillator, ImpactSystem or family
        The model; its own value of `parameter` is not used.
    parameter : str
        The parameter to vary; any parameter of the model.
    between : tuple of two float
        Two values of the parameter. The mass must stick at one of them; at the other it does not, or only after more
        periods.
    longest : int, >= 1
        Driving periods after which a mass that has not come to rest is taken not to stick.

    Returns
    -------
    StickingEnd
        The boundary and the outcome of the search, for the cycle with fewer periods.

    Raises
    ------
    ValueError
        `parameter` is unknown, or `between` is not a pair of different values in its range.

    Notes
    -----
    For one mass, bisection on whether the mass rests goes down to neighbouring floating-point numbers, where the stuck
    time is about 1e-10 to 1e-8 of T: it vanishes as the distance to the power `scaling_exponent`. If there are several
    ends between the values, one of them is found. This takes about 60 runs from the release, 10 to 30 ms.

    For systems, the cycle is the one to which the motion from rest settles at the value where it rests; if it rests at
    both values, the one with fewer periods, or that at the first value. It is followed towards the other value, stable
    or not, in steps that are halved down to neighbouring floating-point numbers. A chatter is cut off at 1e-9 V, which
    shifts the boundary by about 1e-11. This takes about 100 orbits, 2 to 10 s.

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
    inside, outside = check_pair(osc.parameters, parameter, "between", between)
    longest = whole_number("longest", longest, 1)
    if inside == outside:
        raise invalid("between", between, f"two different values of {parameter}")
    with reporter(None, "end of sticking"):
        return _end(osc, parameter, inside, outside, longest)


def _end(osc: Model, parameter: str, inside: float, outside: float, longest: int) -> StickingEnd:
    """Return the end of sticking between two values that were checked."""
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
    if 0 < periods(outside, n_periods) < n_periods:  # another chatter, in an earlier period, ends here
        inside, outside = outside, inside
    return _point(osc.replace(**{parameter: inside}), parameter, inside, osc.at(**{parameter: outside}), n_periods)


def _followed(model: Model, parameter: str, inside: float, outside: float, n_periods: int) -> StickingEnd:
    """Return the point at which the orbit that rests at one value of a parameter is lost on the way to another."""
    found = find_orbit(model.replace(**{parameter: inside}), n_periods=n_periods, n_impacts=-1)
    if not found:
        return StickingEnd(model.at(), parameter, outcome="unresolved", message=found.message)
    *_, orbit = resting_orbits(found[0], parameter, outside, STEP * abs(outside - inside))
    value, (outcome, missed) = orbit.value(parameter), ending(orbit, found[0])
    if value == outside:
        message = f"the {orbit.name} orbit of `{parameter}` = {inside:g} persists up to {outside:g}"
        return StickingEnd(model.at(), parameter, outcome="no_change", message=message)
    fraction, message = orbit.stuck_time / orbit.oscillator.period, ""
    if outcome != KIND:
        why = "it folds" if outcome == "fold" else "no next orbit is found"
        message = f"the orbit still rests for {fraction:.3g} T at `{parameter}` = {value!r}, where {why}"
        outcome = "lost"
    else:
        outcome = "found"
    return StickingEnd(orbit.oscillator, parameter, value, n_periods, fraction, missed, outcome, message, orbit)


def resting_orbits(orbit: Any, parameter: str, goal: float, longest: float) -> Iterator[Any]:
    """Yield an orbit and the next ones towards another value of a parameter, as long as they rest at a stop.

    Steps have the length `longest` and are halved wherever no orbit is found near the last one, down to neighbouring
    floating-point numbers.
    """
    value, step, easy = orbit.value(parameter), longest, True
    finest = NEAREST * max(abs(value), abs(goal))
    yield orbit
    while value != goal and step >= finest:
        further = goal if abs(goal - value) <= step else value + step * (1.0 if goal > value else -1.0)
        model = orbit.model.replace(**{parameter: further})
        found = find_orbit(model, n_periods=orbit.n_periods, n_impacts=-1, near=orbit)
        if not found or _change(orbit, found[0]) > SUDDEN:
            step, easy = 0.5 * min(step, abs(goal - value)), False
            continue
        value, orbit = further, found[0]
        yield orbit
        step, easy = min(longest, 2.0 * step) if easy else step, True


def _change(one: Any, other: Any) -> float:
    """Return the change between two orbits, in time at rest over T or relative to their hardest impacts.

    With one coordinate a rest erases all memory, so no other orbit rests at the same stops.
    """
    if one.oscillator.coordinates == 1 and {rest.stop for rest in one.rests} == {rest.stop for rest in other.rests}:
        return 0.0
    rested = abs(one.stuck_time / one.oscillator.period - other.stuck_time / other.oscillator.period)
    hardest = max(one.velocities), max(other.velocities)
    return float(max(rested, 1.0 - min(hardest) / max(hardest)))


def ending(orbit: Any, before: Any) -> tuple[str, float]:
    """Return the kind of end of a branch from its last orbit, which rests at a stop, and the residual of that end.

    The end is an end of sticking, a fold, or "lost" if the next orbit would graze a stop. At a fold a multiplier tends
    to 1, which it did not in an orbit of the branch long `before`.
    """
    (stop, *_), *_ = orbit.rests
    restitution = orbit.oscillator.stops[orbit.oscillator.stop_names.index(stop)].element.rebound(0.0)
    missed = residual(restitution, orbit.stuck_time / orbit.oscillator.period)
    if missed <= MET:
        return KIND, missed
    away, first = (min(abs(multiplier - 1.0) for multiplier in each.multipliers) for each in (orbit, before))
    return ("fold", away) if away < FOLDS * first else ("lost", missed)


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
            f"the mass rests for {fraction:.3g} T at `{parameter}` = {value!r} but not at the next number: "
            "a long transient amplifies rounding errors; search for cycles of fewer periods"
        )
    return StickingEnd(osc, parameter, value, orbit.n_periods, fraction, missed, outcome, message, orbit)
