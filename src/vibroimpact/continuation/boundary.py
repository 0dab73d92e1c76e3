"""Follow a fold, a period doubling or a graze as a curve in two parameters, in both directions from a point."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from vibroimpact.continuation.arclength import Loop, follow, newton, tangent
from vibroimpact.continuation.branch import ENDS, MOST_POINTS
from vibroimpact.continuation.points import Special, residual, special_orbit, touch_turns
from vibroimpact.continuation.results import BifurcationPoint, Boundary
from vibroimpact.continuation.sticking import LONGEST_STEP, sticking_curve
from vibroimpact.continuation.system import LAST_IMPACT, TOUCH, System, check_range, check_share
from vibroimpact.orbits.admissibility import ROUNDING, nearest_misses, orbit_size
from vibroimpact.orbits.equations import Floats
from vibroimpact.orbits.orbit import Orbit, solution_of
from vibroimpact.orbits.sticking import StickingEnd
from vibroimpact.oscillator import Model, check_names
from vibroimpact.parameters import invalid
from vibroimpact.progress import Report, reporter

Range = tuple[float, float]
HALVINGS = 20  # of the step within which the orbits of a boundary become inadmissible
WORST = 1e-10  # residual of a point


class NoBoundary(ValueError):
    """A point from which no boundary can be followed."""


def continue_boundary(
    point: BifurcationPoint | StickingEnd,
    parameters: tuple[str, str],
    ranges: tuple[Range, Range],
    *,
    step: float = 0.01,
    virtual: bool = True,
    progress: bool | Report = False,
) -> Boundary:
    r"""Follow a bifurcation of a periodic orbit as a curve in two parameters.

    The orbit's equations and the boundary's own condition hold together,

    .. math:: 1 \mp \operatorname{tr} M + \det M = 0 \quad\text{(fold, period doubling)}, \qquad
              u(t_*) = \dot u(t_*) = 0 \quad\text{or}\quad v_i = 0 \quad\text{(grazing)},

    with two parameters free; u is the gap left, M the Jacobian of the cycle.

    Parameters
    ----------
    point : BifurcationPoint or StickingEnd
        Where to begin: from the `special` of a `Branch`, or what `end_of_sticking` found.
    parameters : tuple of two str
        The plane: two different parameters of the orbit's model.
    ranges : tuple of two pairs of float
        Lowest and highest value of each; the point lies between.
    step : float, 0 to 0.5
        Longest step along the curve, where 1 is a whole range, a driving period, or the orbit's speed; along an end of
        sticking at most 0.02.
    virtual : bool
        Whether to go on where the orbit on the boundary is inadmissible; otherwise the curve ends there.
    progress : bool or callable
        True shows a count; a callable gets (points done, None, None) and stops by returning False.

    Returns
    -------
    Boundary
        `values`, `orbits`, `residuals`, `dataset`, and why it ends, in `outcome` and `message`.

    Raises
    ------
    ValueError
        An argument is out of its range, or the point does not satisfy the condition of its kind.

    Notes
    -----
    Pseudo-arclength continuation with Newton's method at each point. The residual of each point, the larger of the miss
    of its flights and of its condition relative to the orbit's size, stays below 1e-10; otherwise the curve ends there
    as "lost". Some milliseconds per point. An end of sticking is no smooth equation: its curve is followed by
    bisection on small circles, some 10 ms per point.

    References
    ----------
    .. [1] H. B. Keller, "Numerical solution of bifurcation and nonlinear eigenvalue problems", in Applications of
       Bifurcation Theory, Academic Press (1977) 359-384.
    .. [2] S. Foale and S. R. Bishop, "Bifurcations in impact oscillations", Nonlinear Dynamics 6 (1994) 285-299.

    Examples
    --------
    >>> from vibroimpact.continuation import continue_orbit
    >>> from vibroimpact.orbits import find_orbit
    >>> from vibroimpact.oscillator import ImpactOscillator
    >>> (orbit,) = find_orbit(ImpactOscillator(omega=2.6))
    >>> branch = continue_orbit(orbit, "omega", (2.5, 2.7))
    >>> curve = continue_boundary(branch.special[0], ("omega", "restitution"), ((2, 3), (0.5, 0.9)), step=0.05)
    >>> curve.kind, max(curve.residuals) < 1e-10
    ('period_doubling', True)
    """
    names, box = check_plane(point, parameters, ranges)
    longest = check_share("step", step)
    with reporter(progress, "points") as report:
        return boundary_through(point, names, box, longest, virtual, report)


def boundary_through(
    point: BifurcationPoint | StickingEnd,
    names: tuple[str, str],
    box: tuple[Range, Range],
    longest: float,
    virtual: bool,
    report: Report,
) -> Boundary:
    """Return the curve through a point, whatever its kind, in a plane that was checked."""
    if isinstance(point, StickingEnd):
        total: Any = None
        look = partial(report, 0, total, None)
        return sticking_curve(point, names, box, min(longest, LONGEST_STEP), look)
    system, x = boundary_system(point, names, box)
    return trace_boundary(system, x, point.kind, longest, virtual, report)


def check_plane(point: Any, parameters: Any, ranges: Any) -> tuple[tuple[str, str], tuple[Range, Range]]:
    """Return two parameters and their ranges, checked together with the point that they must hold."""
    if isinstance(point, StickingEnd) and not point.found:
        raise invalid("point", point.outcome, "an end of sticking that was found", point.message)
    if not isinstance(point, (BifurcationPoint, StickingEnd)):
        raise invalid("point", point, "a BifurcationPoint", "take one from the `special` of a branch")
    assert point.orbit is not None
    return check_box(point.orbit.model, parameters, ranges, point.orbit)


def check_box(
    model: Model, parameters: Any, ranges: Any, orbit: Orbit | None = None
) -> tuple[tuple[str, str], tuple[Range, Range]]:
    """Return two different parameters of a model and their ranges, which hold an orbit where one is given."""
    chosen, box = (tuple(given) if isinstance(given, (tuple, list)) else () for given in (parameters, ranges))
    if len(chosen) != 2:
        raise invalid("parameters", parameters, "two names", "give for example ('omega', 'mass')")
    check_names(model.parameters, chosen)
    if len({model.parameters[name].replaces or name for name in chosen}) < 2:
        raise invalid("parameters", parameters, "two different parameters")
    if len(box) != 2:
        raise invalid("ranges", ranges, "two pairs", "give ((lowest, highest), (lowest, highest))")
    first, second = (check_range(orbit or model, name, span) for name, span in zip(chosen, box, strict=True))
    return (chosen[0], chosen[1]), (first, second)


def boundary_system(point: BifurcationPoint, names: tuple[str, str], box: tuple[Range, Range]) -> tuple[System, Floats]:
    """Return the equations of a boundary, and the unknown of the point where it begins."""
    osc, p = point.orbit.oscillator, point.orbit.n_impacts
    cycle, z = solution_of(point.orbit)
    speed = max(osc.velocity_scale, float(z[p:].max()))
    condition, where, touch = point.kind, 0, math.nan
    if condition == "grazing":
        where = int(np.argmin(z[p:]))
        condition = LAST_IMPACT if z[p + where] <= 1e-9 * speed else TOUCH
    if condition == TOUCH:
        misses = nearest_misses(osc, cycle, z)
        lowest = min(misses, key=lambda miss: abs(miss.gap), default=None)
        if lowest is None:
            raise _no_boundary(point)
        where, touch = lowest.flight, lowest.turns
    system = System(point.orbit.model, cycle, names, box, speed, condition, where)
    x = system.pack(z, touch)
    if np.abs(system.misses(x)).max() > 1e-6:
        raise _no_boundary(point)
    return system, x


def _no_boundary(point: BifurcationPoint) -> NoBoundary:
    return NoBoundary(
        f"the orbit of `point` does not satisfy the condition of a {point.kind.replace('_', ' ')}; "
        "take a point from the `special` of a branch"
    )


def admissible(special: Special) -> bool:
    """Whether the mass can move along the orbit of a boundary; the graze that defines the boundary is allowed."""
    system, x = special.system, special.x
    osc, z, p = system.oscillator_at(x), system.solution(x), system.cycle.n_impacts
    others = np.delete(z[p:], system.where) if system.condition == LAST_IMPACT else z[p:]
    if (others <= 0.0).any():
        return False
    lowest = min((miss.gap for miss in nearest_misses(osc, system.cycle, z)), default=math.inf)
    return lowest >= -ROUNDING * orbit_size(osc, z)


def _inside(system: System, x: Floats) -> bool:
    """Whether impacts are in order, and the touch is inside its flight."""
    begin, end = system.cycle.span(x, system.where)
    return system.cycle.in_order(x) and (system.condition != TOUCH or begin < x[system.inner - 1] < end)


def trace_boundary(system: System, x: Floats, kind: str, longest: float, virtual: bool, report: Any = None) -> Boundary:
    """Return the curve through a point, in both directions."""
    x, made = _onto(system, x)
    if not made:
        raise NoBoundary("Newton's method does not lead from `point` to its boundary; take another point")
    both: list[list[Floats]] = []
    ends: list[str] = []
    along = tangent(system, x, np.ones(len(x)))
    for way in (-along, along):
        points, end = [x], "closed"
        if ends != ["closed"]:
            for found, end in _walk(system, x, way, kind, longest, virtual):
                points.append(found)
                done = len(points) + sum(map(len, both))
                if report is not None and report(done, None, None) is False:
                    end = "stopped"
                    break
        both.append(points)
        ends.append(end)
    return _boundary(system, both[0][:0:-1] + both[1], kind, (ends[0], ends[1]), longest, virtual)


def _onto(system: System, x: Floats) -> tuple[Floats, int]:
    """Return the nearest point of the boundary."""
    row = tangent(system, x, np.ones(len(x)))
    return newton(system, x, row[None, :], np.array([row @ x]))


def _walk(
    system: System, x: Floats, along: Floats, kind: str, longest: float, virtual: bool
) -> Iterator[tuple[Floats, str]]:
    """Yield points in one direction, each with the reason for which the curve would end there."""
    here, loop = x, Loop(system, x, along, longest)
    at_first = admissible(Special(kind, system, x))
    for number, step in enumerate(follow(system, x, along, longest)):
        if step.end == "lost" or residual(Special(kind, system, step.x)) > WORST:
            yield here, "lost"
            return
        if not _inside(system, step.x):
            yield here, "impacts_merge"
            return
        if at_first and not virtual and not admissible(Special(kind, system, step.x)):
            yield _last_admissible(system, here, step.x, kind), "inadmissible"
            return
        closed = loop.closed_by(step)
        end = "range" if step.end == "edge" else "closed" if closed else "budget"
        yield step.x, end
        if end != "budget" or number > MOST_POINTS:
            return
        here = step.x


def _last_admissible(system: System, inside: Floats, outside: Floats, kind: str) -> Floats:
    """Return the last point between two at which the boundary is admissible."""
    for _ in range(HALVINGS):
        way = outside - inside
        middle = inside + 0.5 * way
        found, made = newton(system, middle, way[None, :], np.array([way @ middle]))
        if not made:
            break
        special = Special(kind, system, found)
        if admissible(special) and residual(special) <= WORST:
            inside = found
        else:
            outside = found
    return inside


def _boundary(
    system: System, points: list[Floats], kind: str, ends: tuple[str, str], longest: float, virtual: bool
) -> Boundary:
    specials = [Special(kind, system, x) for x in points]

    def at(x: Floats) -> str:
        return ", ".join(f"{name} = {value:.9g}" for name, value in zip(system.names, system.values(x), strict=True))

    message = (
        f"from {at(points[0])}, {ENDS[ends[0]]}, to {at(points[-1])}, {ENDS[ends[1]]}"
        if "closed" not in ends
        else f"a closed curve through {at(points[-1])}"
    )
    return Boundary(
        kind=kind,
        parameters=(system.names[0], system.names[1]),
        orbits=[special_orbit(special) for special in specials],
        residuals=[residual(special) for special in specials],
        touch_phases=[touch_turns(special) % 1.0 for special in specials],
        outcome=ends,
        message=message,
        arguments={"ranges": system.ranges, "step": longest, "virtual": virtual},
    )
