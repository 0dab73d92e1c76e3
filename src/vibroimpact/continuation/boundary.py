"""Follow a bifurcation as a curve in two parameters, in both directions from a point."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from vibroimpact.continuation.equations import DOUBLING, Range
from vibroimpact.continuation.flights import equations_of
from vibroimpact.continuation.following import EDGE, MOST_POINTS, Way, both_ways, check_range, check_share, follow
from vibroimpact.continuation.points import Point
from vibroimpact.continuation.results import BifurcationPoint, Boundary, course
from vibroimpact.continuation.sticking import LONGEST_STEP, MOST, Sticking, sticking_curve
from vibroimpact.dataset import bifurcation_name
from vibroimpact.model import Model, check_names
from vibroimpact.motion import listed
from vibroimpact.orbits.orbit import Orbit
from vibroimpact.orbits.sticking_end import KIND, StickingEnd
from vibroimpact.orbits.symmetry import images_along
from vibroimpact.parameters import invalid, truth
from vibroimpact.progress import Report, reporter
from vibroimpact.request import units_of

HALVINGS = 20  # of a step, to locate the last point at which a condition holds
WORST = 1e-10  # residual of a point
CONDITIONS: dict[str, Callable[[Point], bool]] = {  # of all points of a curve, by the end where one fails
    "impacts_merge": lambda at: at.equations.in_order(at.x),
    "resonance": lambda at: at.equations.fits(at.x),
}
NEAR = 1e-6  # relative to the orbit's size: largest residual accepted at the given point


class NoBoundary(ValueError):
    """A point from which no boundary can be followed."""


class Plane(NamedTuple):
    """Two parameters and their ranges, with the units of ranges that were given as quantities in others."""

    names: tuple[str, str]
    box: tuple[Range, Range]
    units: dict[str, str]


def continue_boundary(
    point: BifurcationPoint | StickingEnd,
    parameters: tuple[str, str],
    ranges: tuple[Range, Range],
    *,
    step: float = 0.01,
    virtual: bool = True,
    progress: bool | Report | None = None,
) -> Boundary:
    r"""Follow a bifurcation of a periodic orbit as a curve in two parameters.

    The equations of the orbit are solved together with the condition of the bifurcation,

    .. math:: 1 \mp \operatorname{tr} M + \det M = 0 \quad\text{(fold, period doubling)}, \qquad
              u(t_*) = \dot u(t_*) = 0 \quad\text{or}\quad v_i = 0 \quad\text{(grazing)},

    with two free parameters; u is the clearance and M the Jacobian of the cycle. For systems, a Neimark-Sacker point
    has a complex pair of multipliers with product 1, and a pitchfork a multiplier -1 of the half map.

    Parameters
    ----------
    point : BifurcationPoint or StickingEnd
        The point to begin at: one of the `special` points of a `Branch`, or a result of `end_of_sticking`.
    parameters : tuple of two str
        The plane: two different parameters of the orbit's model.
    ranges : tuple of two pairs of float
        Lowest and highest value of each parameter; the point must lie inside. Tables and figures show a quantity of
        pint in its own unit.
    step : float, 1e-6 to 0.5
        Longest step along the curve, relative to a whole range, a driving period, or the orbit's speed; at most 0.02
        along an end of sticking.
    virtual : bool
        Whether to continue where the orbit on the boundary is inadmissible; otherwise the curve ends there.
    progress : bool or callable, optional
        None shows a temporary line on a terminal or in a notebook if it takes more than a second.
        True shows a count; a callable gets (points done, None, None) and stops the computation by returning False.

    Returns
    -------
    Boundary
        With `values`, `orbits`, `residuals`, `dataset`, and the reasons why the curve ends, in `outcome` and `message`.

    Raises
    ------
    ValueError
        An argument is out of its range, or the point does not satisfy the condition of its kind.

    Notes
    -----
    The method is pseudo-arclength continuation [1]_ with Newton's method at each point. The residual of each point (the
    larger of those of its flights and of its condition, relative to the orbit's size) stays below 1e-10; otherwise the
    curve ends there as "lost". A point takes a few milliseconds, about ten for systems. A pitchfork can be followed
    only in planes whose parameters keep the symmetry. A Neimark-Sacker curve ends as "resonance" where its pair of
    multipliers becomes real. An end of sticking has no smooth equation; its curve is followed by bisection on small
    circles, about 10 ms per point.

    References
    ----------
    .. [1] H. B. Keller, "Numerical solution of bifurcation and nonlinear eigenvalue problems", in Applications of
       Bifurcation Theory, Academic Press (1977) 359-384.
    .. [2] S. Foale and S. R. Bishop, "Bifurcations in impact oscillations", Nonlinear Dynamics 6 (1994) 285-299.

    Examples
    --------
    >>> from vibroimpact.continuation import continue_orbit
    >>> from vibroimpact.orbits import find_orbit
    >>> from vibroimpact.model.oscillator import ImpactOscillator
    >>> (orbit,) = find_orbit(ImpactOscillator(omega=2.6))
    >>> branch = continue_orbit(orbit, "omega", (2.5, 2.7))
    >>> curve = continue_boundary(branch.special[0], ("omega", "restitution"), ((2, 3), (0.5, 0.9)), step=0.05)
    >>> curve.kind, max(curve.residuals) < 1e-10
    ('period_doubling', True)
    """
    plane, longest = check_plane(point, parameters, ranges), check_share("step", step)
    virtual = truth("virtual", virtual)
    with reporter(progress, "points") as report:
        return boundary_through(point, plane, longest, virtual, report)


def boundary_through(
    point: BifurcationPoint | StickingEnd, plane: Plane, longest: float, virtual: bool, report: Report, most: int = MOST
) -> Boundary:
    """Return the curve of any kind through a point, in a plane already checked.

    An end of sticking is followed for at most `most` points to either side.
    """
    walk: Callable[[float], Iterator[Way]]
    if isinstance(point, StickingEnd) or point.kind == KIND:
        sticking = Sticking(point.orbit.model, plane.names, plane.box, point.orbit.n_periods, report)
        longest = min(longest, LONGEST_STEP)
        walk = partial(sticking_curve, sticking, longest, most)
    else:
        walk = partial(_walk, _beginning(point, plane), longest, virtual)
    back, on = both_ways(walk, report)
    points, ends = [*back.points[:0:-1], *on.points], (back.end, on.end)
    orbits = [place.orbit for place in points]
    return Boundary(
        kind=points[0].kind,
        parameters=plane.names,
        orbits=orbits,
        residuals=[place.residual for place in points],
        touch_phases=[place.touch_phase for place in points],
        touched=points[0].touched,
        outcome=ends,
        message="; ".join([course("curve", orbits, plane.names, ends), *filter(None, (back.why, on.why))]),
        arguments={"ranges": plane.box, "step": longest, "virtual": virtual},
        units=plane.units,
    )


def check_plane(point: Any, parameters: Any, ranges: Any) -> Plane:
    """Return the checked plane of two parameters, whose ranges must include the point."""
    if isinstance(point, StickingEnd) and not point.found:
        raise invalid("point", point.outcome, "an end of sticking that was found", point.message)
    if not isinstance(point, (BifurcationPoint, StickingEnd)):
        raise invalid("point", point, "a BifurcationPoint", "take one from the `special` of a branch")
    if point.orbit.sticks and not point.orbit.oscillator.forgets:
        hint = "find it at each value with continue_orbit or end_of_sticking"
        raise invalid("point", point.kind, "a bifurcation of an orbit that never rests, or of one mass", hint)
    return check_box(point.orbit.model, parameters, ranges, point.orbit)


def check_box(model: Model, parameters: Any, ranges: Any, orbit: Orbit | None = None) -> Plane:
    """Return two different parameters of a model and their ranges, which must include an orbit if one is given."""
    names, box = (tuple(pair) if isinstance(pair, (tuple, list)) else () for pair in (parameters, ranges))
    if len(names) != 2:
        raise invalid("parameters", parameters, "two names", "give for example ('omega', 'mass')")
    check_names(model.parameters, names)
    if len({model.parameters[name].replaces or name for name in names}) < 2:
        raise invalid("parameters", parameters, "two different parameters")
    if len(box) != 2:
        raise invalid("ranges", ranges, "two pairs", "give ((lowest, highest), (lowest, highest))")
    first, second = (check_range(model, name, span, orbit) for name, span in zip(names, box, strict=True))
    units = units_of(dict(zip(names, box, strict=True)), model.parameters)
    return Plane((names[0], names[1]), (first, second), units)


def _beginning(point: BifurcationPoint, plane: Plane) -> Point:
    """Return the point of a boundary at a bifurcation on a branch."""
    once, z = equations_of(point.orbit, plane.names, plane.box)
    if point.kind == "pitchfork" and not once.cycle.images:
        model, spans = point.orbit.model, zip(plane.names, plane.box, strict=True)
        breaking = listed([name for name, span in spans if not images_along(model, (name,), (span,))] or [*plane.names])
        raise NoBoundary(
            f"a pitchfork is a bifurcation of orbits that are their own mirror image, and {breaking} would break the "
            "symmetry of the model; vary parameters that act alike on both sides"
        )
    x = once.pack(z)
    if point.kind == "grazing":
        equations, x = once.at_graze(x)
    else:  # a pitchfork is the period doubling of half of a cycle
        equations, x = once.bounded(DOUBLING if point.kind == "pitchfork" else point.kind, x)
    if not np.abs(equations.misses(x)).max() <= NEAR:  # also rejects NaN, where no flight comes near the stop
        what = f"satisfy the condition of a {bifurcation_name(point.kind)}"
        raise NoBoundary(f"the orbit of `point` does not {what}; take a point from the `special` of a branch")
    solution, corrections, _ = equations.newton(x, equations.tangent(x, np.ones(len(x))))
    if not corrections:
        raise NoBoundary("Newton's method does not converge from `point` to its boundary; take another point")
    ends = np.rint(solution[equations.inner :])
    on_edge = np.flatnonzero(np.abs(solution[equations.inner :] - ends) <= EDGE)
    solution[equations.inner + on_edge] = ends[on_edge]  # but for rounding
    return Point(equations, solution, equations.tangent(solution, np.ones(len(solution))))


def _holds(condition: Callable[[Point], bool], point: Point) -> bool:
    """Whether a condition holds at an accurate point."""
    return point.residual <= WORST and condition(point)


def _walk(first: Point, longest: float, virtual: bool, direction: float) -> Iterator[Way]:
    """Yield one direction of a boundary as far as it has been followed, after each point."""
    last = replace(first, tangent=direction * first.tangent)
    way, conditions = Way([last]), dict(CONDITIONS)
    if last.admissible and not virtual:
        conditions["inadmissible"] = lambda at: at.admissible
    for number, (point, end) in enumerate(follow(last, longest)):
        broken = next((reason for reason, holds in conditions.items() if not holds(point)), "")
        if end == "lost" or point.residual > WORST:
            point, end = last, "lost"
        elif broken:
            point, end = last.furthest(point, HALVINGS, partial(_holds, conditions[broken])), broken
        if np.abs(point.x - last.x).max() > EDGE:  # nor the first point again, if it lies on the edge of the ranges
            way.points.append(point)
        way.end = end or "budget"
        yield way
        if end or number > MOST_POINTS:
            return
        last = point
