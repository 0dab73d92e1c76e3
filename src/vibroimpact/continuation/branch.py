"""Follow a periodic orbit along one parameter, in both directions, with the bifurcations on it."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from vibroimpact.continuation.bifurcations import BESIDE, between, lost_contact
from vibroimpact.continuation.energy import along_energy
from vibroimpact.continuation.equations import BRANCH, Equations, Range
from vibroimpact.continuation.flights import equations_of
from vibroimpact.continuation.following import (
    EDGE,
    MOST_POINTS,
    Way,
    both_ways,
    check_range,
    check_share,
    follow_dense,
)
from vibroimpact.continuation.points import Point, Solution
from vibroimpact.continuation.results import BifurcationPoint, Branch, course
from vibroimpact.orbits.admissibility import ROUNDING
from vibroimpact.orbits.equations import Floats
from vibroimpact.orbits.orbit import Orbit
from vibroimpact.orbits.sticking_end import KIND, ending, resting_orbits
from vibroimpact.parameters import ENERGY, invalid, truth
from vibroimpact.progress import Report, reporter
from vibroimpact.request import units_of

ONE_HALF = 1e-6  # largest difference between the halves of a doubled orbit that has merged with the simple one
CLOSEST = 1 / 16  # of the step: orbits closer than this to the end of a resting branch are not kept
MERGED = 1e-4  # largest change of an unknown from the last orbit before two events meet to the one where they do
SHARP = 24  # halvings of a step: impacts are still further apart than rounding


def continue_orbit(
    orbit: Orbit,
    parameter: str,
    range: tuple[float, float],
    *,
    step: float = 0.01,
    virtual: bool = True,
    progress: bool | Report | None = None,
) -> Branch:
    r"""Follow a periodic orbit, stable or unstable, along one parameter, in both directions and through folds.

    On the branch, every flight ends at the next impact of the orbit. The bifurcations on it are

    .. math:: \text{fold: } 1 - \operatorname{tr} M + \det M = 0, \qquad
              \text{period doubling: } 1 + \operatorname{tr} M + \det M = 0,

    with M the Jacobian of the cycle, and grazing, where a flight touches a stop between its ends or the velocity of an
    impact passes through zero. For systems, the conditions are det(M - 1) = 0 and det(M + 1) = 0; there are also
    Neimark-Sacker points, where a complex pair of multipliers leaves the unit circle, and pitchforks of symmetric
    orbits.

    Parameters
    ----------
    orbit : Orbit
        The orbit to begin with, from `find_orbit` or `switch_branch`.
    parameter : str
        The parameter to vary: any parameter of the orbit's model, including `frequency` (Hz) and the parameters of a
        family; for a system `omega`, `frequency`, or the gap or restitution of a stop. For an orbit of a system without
        load and loss, from ``find_orbit(energy=...)``, it is "energy" (J).
    range : tuple of two float
        Its lowest and highest value; the orbit's own value must lie between. Tables and figures show a quantity of pint
        in its own unit.
    step : float, 1e-6 to 0.5
        Longest step along the curve, relative to the whole range, a driving period, or the orbit's speed.
    virtual : bool
        Whether to continue beyond a graze, where orbits are inadmissible but may become admissible again; otherwise the
        branch ends at the graze.
    progress : bool or callable, optional
        None shows a temporary line on a terminal or in a notebook if it takes more than a second.
        True shows a count; a callable gets (orbits done, None, None) and stops the computation by returning False.

    Returns
    -------
    Branch
        With `orbits`, `special` (list of `BifurcationPoint`), `dataset`, and the reasons why the branch ends, in
        `outcome` and `message`.

    Raises
    ------
    ValueError
        An argument is out of its range, or the orbit does not solve its model's equations.

    Notes
    -----
    The method is pseudo-arclength continuation [1]_ with Newton's method at each point. At a special point, the
    equations of the orbit and the condition of the bifurcation are solved together to rounding: about 1e-14 of the
    parameter where the condition crosses zero at a finite slope. Only admissible special points are listed. A doubled
    branch ends at the period doubling it comes from. Two bifurcations of one kind within a step may be missed; if so,
    halve `step`. At a graze, one multiplier of the orbit that gains an impact tends to infinity [2]_. At r = 0, a graze
    at which the force begins to hold the mass after an impact shows only in `admissible`. Derivatives with respect to
    turns and velocities are in closed form, the others are central differences; this affects the rate of convergence of
    Newton's method, not its limit. An orbit takes about 1 ms per impact, for systems with up to 14 coordinates 10 ms;
    with long contacts of a compliant stop up to 40 ms, and a special point a second.

    An orbit that is its own mirror image half a cycle later is followed with the equations of half a cycle, as long as
    the parameter leaves the system symmetric; a pitchfork is the period doubling of its half map [3]_. Where two stops
    would be struck at the same instant, orbits become inadmissible without a special point. An undamped mode that no
    impact excites has multipliers on the unit circle; Neimark-Sacker points are then not detected.

    An orbit that rests at a stop is found anew at each value, in steps that are halved down to neighbouring
    floating-point numbers where the branch ends: at an end of sticking, at a fold, or as "lost" at a graze while it
    still rests. Along the branch its chatter gains and loses impacts of 1e-9 V. Where one of several rests ends, there
    is no special point. An orbit takes about 10 ms for one mass, 20 to 50 ms for a system.

    Where the velocity of an impact on a rigid stop passes 0, a multiplier passes through infinity, so the orbit often
    doubles its period just before. A doubling within 1e-8 of the value of such a graze counts as the graze.

    At a graze of a compliant stop a contact, or a gap within one, appears or disappears, and the branch continues; it
    ends where no impact is left, or where its orbits are shorter ones run through several times. A damped stop lets go
    while it is still pressed in. If the part is then no longer free before the stop pushes again, that impact is lost
    at a graze, too, and the reverse. If the stop is undamped, the multipliers are continuous: the graze is marked but
    is no bifurcation. If it is damped, the force jumps at contact and the multipliers jump at the graze, where the
    branch may turn back. Where events of two compliant stops change places, there is no special point.

    Along the energy, the period varies from orbit to orbit; `Branch.frequencies` has one value per orbit. The
    multipliers other than the two that are 1 show internal resonances: where a pair meets at 1, the branch folds or
    others cross it; where a pair meets at -1, a period doubling is listed (a pitchfork for a symmetric orbit, whose
    half map is used). Contacts appear and disappear without a special point. The branch ends as "grazing" where its
    last contact vanishes, at the linear mode, or where no orbit is found beyond a graze, and as "period_doubling" at an
    orbit whose cycle is twice that of another family, beyond which the same orbits come again; `message` has the
    details.

    References
    ----------
    .. [1] H. B. Keller, "Numerical solution of bifurcation and nonlinear eigenvalue problems", in Applications of
       Bifurcation Theory, Academic Press (1977) 359-384.
    .. [2] A. B. Nordmark, "Non-periodic motion caused by grazing incidence in an impact oscillator", J. Sound Vib. 145
       (1991) 279-297.
    .. [3] J. W. Swift and K. Wiesenfeld, "Suppression of period doubling in symmetric systems", Phys. Rev. Lett. 52
       (1984) 705-708.

    Examples
    --------
    >>> from vibroimpact.orbits import find_orbit
    >>> from vibroimpact.model.oscillator import ImpactOscillator
    >>> (orbit,) = find_orbit(ImpactOscillator(omega=2.5))
    >>> branch = continue_orbit(orbit, "omega", (2.0, 3.0), step=0.05)
    >>> [(point.kind, round(point.value, 9)) for point in branch.special]
    [('period_doubling', 2.65392352)]

    The bouncing ball folds at amplitude w^2/g = pi (1 - r)/(1 + r), here with r = 0.5 at 50 Hz:

    >>> from vibroimpact import family, models
    >>> ball = family(models.bouncing_ball)
    >>> branch = continue_orbit(find_orbit(ball)[0], "amplitude", (1e-4, 1.6e-4), step=0.1)
    >>> [(point.kind, round(point.value * (100 * np.pi) ** 2 / 9.81, 9)) for point in branch.special]
    [('fold', 1.047197551), ('period_doubling', 1.526823701)]

    The frequency of free vibration of a mass with a spring behind its gap rises with the energy:

    >>> from vibroimpact import ImpactSystem, Stop
    >>> system = ImpactSystem(mass=1.0, stiffness=10.0, stops=[Stop(direction=1, gap=0.01, stiffness=50.0)])
    >>> (orbit,) = find_orbit(system, energy=0.01)
    >>> branch = continue_orbit(orbit, "energy", (0.001, 0.1), step=0.1)
    >>> branch.frequencies[[0, -1]].round(6).tolist()
    [0.556889, 0.696221]
    """
    _check_orbit(orbit)
    of_energy = isinstance(parameter, str) and parameter == ENERGY.name and parameter not in orbit.model.parameters
    changes = orbit.oscillator.energy_changes
    if of_energy and changes:
        raise ValueError(f"`parameter` must not be {parameter!r}, since the energy is not constant: {changes}")
    if not (of_energy or changes):
        hint = "free vibration without loss is followed along its energy"
        raise invalid("parameter", parameter, f"{ENERGY.name!r} for this orbit", hint)
    table = {parameter: ENERGY} if of_energy else orbit.model.parameters
    ends = check_range(orbit.model, parameter, range, orbit, table)
    longest, virtual = check_share("step", step), truth("virtual", virtual)
    directions: Callable[[float], Iterator[Way]]
    if orbit.sticks:
        directions = partial(_resting, orbit, parameter, ends, longest)
    elif of_energy:
        directions = partial(along_energy, orbit, ends, longest)
    else:
        equations, z = equations_of(orbit, (parameter,), (ends,))
        directions = partial(_with_orbits, equations, _corrected(equations, equations.pack(z)), longest, virtual)
    with reporter(progress, "orbits") as report:
        down, up = both_ways(directions, report)
    special = [special.bifurcation(parameter) for special in down.special[::-1] + up.special]
    orbits = [p.orbit for p in down.points[:0:-1] + up.points]
    message = "; ".join([course("branch", orbits, (parameter,), (down.end, up.end)), *filter(None, (down.why, up.why))])
    inadmissible = sum(not orbit.admissible for orbit in orbits)
    if inadmissible:
        message += f"; {inadmissible} of {len(orbits)} orbits are inadmissible (see their `message`)"
    return Branch(
        parameter=parameter,
        orbits=orbits,
        special=[point for point in special if point.orbit.admissible],
        outcome=(down.end, up.end),
        message=message,
        arguments={"range": ends, "step": longest, "virtual": virtual},
        units=units_of({parameter: range}, table),
    )


def _check_orbit(orbit: Any) -> None:
    """Raise `ValueError` unless the argument is an orbit with impacts."""
    if not hasattr(orbit, "check_flies"):
        raise invalid("orbit", orbit, "an Orbit", "give one that find_orbit returned")
    if orbit.n_impacts < 1 and not orbit.sticks:
        raise invalid("orbit", orbit.name, "an orbit with impacts")


@dataclass(frozen=True)
class _Rests:
    """An orbit with a rest on a branch; the last one with the kind of end and its residual."""

    orbit: Any
    kind: str = ""
    missed: float = math.nan

    def bifurcation(self, parameter: str) -> BifurcationPoint:
        """Return the fold or the end of sticking at which the branch ends."""
        phase = self.orbit.release_phase if self.kind == KIND else math.nan
        return BifurcationPoint(self.kind, parameter, self.orbit.value(parameter), self.orbit, self.missed, phase)


def _resting(orbit: Any, parameter: str, ends: Range, longest: float, direction: float) -> Iterator[Way]:
    """Yield a branch of orbits with rests after each orbit; of the orbits close to its end only the last."""
    goal, span = ends[direction > 0.0], ends[1] - ends[0]
    way, distance = Way([_Rests(orbit)]), longest * span
    for found in resting_orbits(orbit, parameter, goal, distance):
        value, before = found.value(parameter), [point.orbit.value(parameter) for point in way.points[-2:-1]]
        if before and abs(value - before[0]) < CLOSEST * distance:
            way.points[-1] = _Rests(found)
        elif found is not orbit:
            way.points.append(_Rests(found))
        yield way
    last = way.points[-1].orbit
    if last.value(parameter) == goal:
        way.end = "range"
    else:
        way.end, missed = ending(last, orbit)
        way.special += [_Rests(last, way.end, missed)] if way.end in (KIND, "fold") else []
    yield way


def _corrected(equations: Equations, x: Floats) -> Floats:
    """Return the orbit corrected at its own parameter; raise `ValueError` if it does not solve its equations."""
    solution, corrections, _ = equations.newton(x, np.eye(len(x))[-1])
    if corrections and np.abs(solution - x).max() < 1e-3:
        return solution
    if np.abs(equations.misses(x)).max() < 1e-9:
        return x  # at a fold the equations are singular, but solved
    raise ValueError("`orbit` is not periodic; give an orbit that find_orbit returned")


def _with_orbits(equations: Equations, x: Floats, longest: float, virtual: bool, direction: float) -> Iterator[Way]:
    """Yield a branch as `walk` does, building the orbit of each point while its flights are still cached."""
    number = 0
    for way in walk(equations, x, longest, virtual, direction):
        number += sum(point.orbit is not None for point in way.points[number:])
        yield way


def walk(
    equations: Equations, x: Floats, longest: float, virtual: bool, direction: float, strides: int = 1
) -> Iterator[Way]:
    """Yield a branch as far as it has been followed, after each point, down (-1) or up (1) the parameter.

    Where no test function falls by half, steps are up to `strides` times as long.
    """
    along = direction * equations.tangent(x, np.eye(len(x))[-1])
    way, home = Way([Point(equations, x, along)]), None
    while (begin := (yield from _walk_on(way, longest, virtual, strides, home))) is not None:
        begin = begin.outward()
        if not virtual and not begin.clear:
            break
        way.points.append(begin)
        yield way
        home = begin.equations.seen(way.points[0])
    yield way


def _walk_on(
    way: Way, longest: float, virtual: bool, strides: int, home: list[Point] | None
) -> Generator[Way, None, Point | None]:
    """Yield a branch after each point, to its end or to where its equations change; return the first point beyond."""
    before = way.points[-1]
    equations = before.equations
    for after, end in follow_dense(before, longest, strides, home):
        if end == "lost":
            way.end = "lost"
            return None
        graze, merged, regular = None, not equations.in_order(after.x), after
        if merged:  # at the last point the equations are singular
            graze = lost_contact(before, after)
            if graze is None:
                after = before.furthest(after, SHARP, partial(_in_order, positive=before.speeds.min() > -ROUNDING))
            else:
                after = Point(equations, graze.on_branch, before.tangent)
            regular = after.towards(before, BESIDE) or before
        halved = _halved(before, regular)
        if halved is not None:
            way.special.append(halved)
            way.end = halved.kind
            return None
        for special in between(before, regular):
            if special.equations.soft and abs(special.on_branch[-1] - before.x[-1]) <= EDGE:
                continue  # the graze that the branch comes from
            if special.equations.soft:
                return _beyond(way, before, special)
            point = Point(special.equations, special.x, before.tangent)
            way.special.append(point)
            way.points.append(point)
            if special.kind == "grazing" and before.clear and not virtual:
                way.end = "grazing"
                return None
        if not virtual and not merged and before.clear and not after.clear:
            way.end = "inadmissible"
            way.points.append(before.furthest(after, SHARP, lambda point: point.clear))
            return None
        if graze is not None:
            return _beyond(way, before, graze)
        way.points.append(after)
        if merged:
            return _past(way, before, after)
        before = after
        way.end = end or "budget"
        if end or len(way.points) > MOST_POINTS:
            return None
        yield way
    return None


def _in_order(point: Point, positive: bool) -> bool:
    """Whether the events of a point follow one another, and whether its velocities are positive if they should be."""
    return point.equations.in_order(point.x) and (not positive or bool(point.speeds.min() > 0.0))


def _goes_beyond(way: Way, graze: Point) -> bool:
    """Add a graze of a compliant stop to a branch; return whether it goes on: orbits may become shorter ones there."""
    way.end = "grazing"
    way.special.append(graze)
    way.points.append(graze)
    return not graze.equations.repeats(graze.x)


def _beyond(way: Way, before: Point, special: Solution) -> Point | None:
    """Add the graze of a compliant stop to a branch, and return the first point beyond it, if there is one."""
    graze = Point(special.equations, special.x, before.tangent)
    further = graze.equations.beyond(graze.x, _sign(before, graze)) if _goes_beyond(way, graze) else None
    return None if further is None else Point(*further)


def _past(way: Way, before: Point, last: Point) -> Point | None:
    """Return the first point beyond the last one before two events meet, if the motion goes on there.

    A graze, at which both vanish, is listed.
    """
    way.end = "impacts_merge"
    further = last.equations.past(last.x) if before.admissible else None
    if further is None:
        return None
    equations, start = further
    at_graze, along = equations.condition != BRANCH, _sign(before, last)
    solution, corrections, _ = equations.newton(start, None if at_graze else np.eye(len(start))[-1])
    if not corrections or np.abs(solution - start).max() > MERGED:
        return None
    if at_graze:
        graze = Point(equations, solution, last.tangent)
        if not _goes_beyond(way, graze):
            return None
        equations, solution = equations.of_branch, graze.on_branch
    return Point(equations, solution, equations.tangent(solution, along * np.eye(len(solution))[-1]))


def _sign(before: Point, after: Point) -> float:
    """Return the direction in which the parameter changes between two points."""
    return math.copysign(1.0, after.on_branch[-1] - before.x[-1])


def _halved(a: Point, b: Point) -> Solution | None:
    """Return the bifurcation between two points at which the halves of a doubled orbit coincide, or None."""
    before, after = a.equations.halves(a.x), a.equations.halves(b.x)
    if before is None or after is None or (before @ after > 0.0 and np.abs(after).max() > ONE_HALF):
        return None
    share = 1.0 / (1.0 + float(np.linalg.norm(after) / np.linalg.norm(before)))
    half, start = a.equations.half(a.x + share * (b.x - a.x))
    solution, corrections, _ = half.newton(start)
    return Solution(half, solution) if corrections else None
