"""Points of a branch and its bifurcations.

Tests along a branch change sign where it folds, doubles its period or grazes; between two points the bifurcation is
solved for exactly. At a period doubling `switch_branch` leads to the doubled orbit that is born there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vibroimpact.continuation.arclength import Step, newton, tangent
from vibroimpact.continuation.results import BifurcationPoint
from vibroimpact.continuation.system import DOUBLING, FOLD, LAST_IMPACT, TOUCH, System, check_share
from vibroimpact.orbits.admissibility import NearMiss, nearest_misses, orbit_size
from vibroimpact.orbits.equations import Cycle, Floats, flight_of, parameters_of
from vibroimpact.orbits.orbit import Orbit, make_orbit, solution_of
from vibroimpact.parameters import invalid

HALVINGS = 12  # of a step, in search of what happens inside
TRIES = 12  # of an amplitude, halved each time


@dataclass(frozen=True)
class Point:
    """A point of a branch and the tests along it, which change sign at bifurcations; `margin` may be infinite."""

    x: Floats
    tangent: Floats
    fold: float
    doubling: float
    weakest: float
    margin: float
    closest: NearMiss | None

    @property
    def clear(self) -> bool:
        """Whether no flight penetrates the stop and no impact has a velocity away from it."""
        return self.weakest > 0.0 and self.margin > 0.0


@dataclass(frozen=True)
class Special:
    """A bifurcation on a branch: its kind, the system it solves, and its unknown."""

    kind: str
    system: System
    x: Floats


def point(system: System, step: Step | Floats, along: Floats | None = None) -> Point:
    """Return a point of a branch with its tests evaluated."""
    if isinstance(step, Step):
        x, way = step.x, step.tangent
    else:
        assert along is not None
        x, way = step, tangent(system, step, along)
    parameters, z = system.parameters(x), system.solution(x)
    osc, cycle = system.oscillator_at(x), system.cycle
    closest = min(nearest_misses(osc, cycle, z), key=lambda miss: miss.gap, default=None)
    trace, determinant = cycle.trace(parameters, z), cycle.determinant(parameters)
    return Point(
        x=x,
        tangent=way,
        fold=float(way[-1]),
        doubling=1.0 + trace + determinant,
        weakest=float(z[cycle.n_impacts :].min()) / system.speed,
        margin=closest.gap / orbit_size(osc, z) if closest else math.inf,
        closest=closest,
    )


def between(system: System, a: Point, b: Point) -> list[Special]:
    """Return the bifurcations between two neighbouring points of a branch, in their order."""
    found: list[Special] = []
    if (a.fold > 0.0) != (b.fold > 0.0):
        found += _located(system, FOLD, a, b)
    if (a.weakest > 0.0) == (b.weakest > 0.0) and (a.doubling > 0.0) != (b.doubling > 0.0):
        found += _located(system, DOUBLING, a, b)
    if a.clear != b.clear:
        found += _located(system, LAST_IMPACT if (a.weakest > 0.0) != (b.weakest > 0.0) else TOUCH, a, b)
    way = b.x - a.x
    return sorted(found, key=lambda special: float((branch_part(special) - a.x) @ way))


def branch_part(special: Special) -> Floats:
    """Return the unknown of the branch that a special point lies on."""
    inner = 2 * special.system.cycle.n_impacts
    return np.concatenate([special.x[:inner], special.x[special.system.inner :]])


def _test(condition: str, at: Point) -> float:
    value = {FOLD: at.fold, DOUBLING: at.doubling, LAST_IMPACT: at.weakest, TOUCH: at.margin}[condition]
    return value if math.isfinite(value) else math.copysign(1.0, value)


def _located(system: System, condition: str, a: Point, b: Point) -> list[Special]:
    """Solve for the bifurcation between two points; while Newton's method leaves the interval, halve it."""
    for _ in range(HALVINGS):
        low, high = _test(condition, a), _test(condition, b)
        share = low / (low - high) if low != high else 0.5
        special = _solved(system, condition, a.x + share * (b.x - a.x), a, b)
        if special is not None:
            return [special]
        middle = 0.5 * (a.x + b.x)
        found, made = newton(system, middle, (b.x - a.x)[None, :], np.array([(b.x - a.x) @ middle]))
        if not made:
            return []
        inside = point(system, found, a.tangent)
        a, b = (inside, b) if (_test(condition, inside) > 0.0) == (low > 0.0) else (a, inside)
    return []


def _solved(system: System, condition: str, x: Floats, a: Point, b: Point) -> Special | None:
    where, touch = 0, math.nan
    p = system.cycle.n_impacts
    if condition == LAST_IMPACT:
        where = int(np.argmin((a if a.weakest < b.weakest else b).x[p : 2 * p]))
    if condition == TOUCH:
        closest = (a if a.margin < b.margin else b).closest
        if closest is None:
            return None
        where = closest.flight
        # The touch moves with the orbit: its distance from the start of the flight is kept.
        owner = a if a.margin < b.margin else b
        touch = closest.turns + float(x[where] - owner.x[where])
    bounded = replace(system, condition=condition, where=where)
    start = np.concatenate([x[: 2 * p], [touch] if condition == TOUCH else [], x[2 * p :]])
    found, made = newton(bounded, start)
    special = Special("grazing" if condition in (TOUCH, LAST_IMPACT) else condition, bounded, found)
    if not made:
        return None
    part, way = branch_part(special), b.x - a.x
    share = float((part - a.x) @ way / (way @ way))
    aside = float(np.abs(part - a.x - share * way).max())
    return special if -1e-9 <= share <= 1.0 + 1e-9 and aside <= float(np.linalg.norm(way)) else None


def special_orbit(special: Special) -> Orbit:
    """Return the orbit at a special point."""
    system = special.system
    return make_orbit(system.model_at(special.x), system.cycle, system.solution(special.x))


def residual(special: Special) -> float:
    """Return by how much an orbit misses its flights and its defining condition, relative to its own size."""
    system, x = special.system, special.x
    osc, z, cycle = system.oscillator_at(x), system.solution(x), system.cycle
    parameters, p = parameters_of(osc), system.cycle.n_impacts
    size, speed = orbit_size(osc, z), max(float(np.abs(z[p:]).max()), osc.velocity_scale)
    misses = cycle.misses(parameters, z) / np.repeat([size, speed], p)
    if system.condition == LAST_IMPACT:
        own = abs(float(z[p + system.where])) / speed
    elif system.condition == TOUCH:
        angle, rate, _ = cycle.takeoff(parameters, z, system.where)
        ahead = (touch_turns(special) - cycle.span(z, system.where)[0]) * osc.period
        gap, slope = flight_of(parameters).after(angle, rate, ahead)
        own = max(abs(gap) / size, abs(slope) / speed)
    else:
        trace, determinant = cycle.trace(parameters, z), cycle.determinant(parameters)
        own = abs((1.0 - trace if special.kind == FOLD else 1.0 + trace) + determinant)
    return max(float(np.abs(misses).max()), own)


def touch_turns(special: Special) -> float:
    """Return the turns at which the orbit grazes; NaN for other conditions."""
    system = special.system
    if system.condition == LAST_IMPACT:
        return float(special.x[system.where])
    return float(special.x[system.inner - 1]) if system.condition == TOUCH else math.nan


def switch_branch(point: BifurcationPoint, *, amplitude: float = 1e-2) -> Orbit:
    r"""Return an orbit of the doubled branch that is born at a period doubling.

    There the orbit, traversed twice, solves the equations of 2n periods and 2p impacts with a singular Jacobian; its
    null vector :math:`\phi` is the direction in which the two rounds separate. The doubled orbit solves the same
    equations with

    .. math:: \phi \cdot (z - z_0) = \varepsilon,

    and a free parameter, which is regular for :math:`\varepsilon \ne 0` [1]_.

    Parameters
    ----------
    point : BifurcationPoint
        Of kind "period_doubling".
    amplitude : float, 0 to 0.5
        Separation :math:`\varepsilon` of the two rounds, in driving periods and relative to the orbit's speed; halved
        as often as needed.

    Returns
    -------
    Orbit
        A period-2n impact-2p orbit, at a parameter above or below the point's, wherever the doubled branch is.

    Raises
    ------
    ValueError
        `point` is not a period doubling, `amplitude` is out of its range, or no doubled orbit is found.

    Notes
    -----
    Follow it with `continue_orbit`; its branch ends at the period doubling, where the two rounds coincide. The doubled
    orbit is stable beyond a supercritical period doubling, unstable before a subcritical one. A few milliseconds.

    References
    ----------
    .. [1] E. Doedel, H. B. Keller and J. P. Kernévez, "Numerical analysis and control of bifurcation problems (I)",
       Int. J. Bifurcation Chaos 1 (1991) 493-520.

    Examples
    --------
    >>> from vibroimpact.continuation import continue_orbit
    >>> from vibroimpact.orbits import find_orbit
    >>> from vibroimpact.oscillator import ImpactOscillator
    >>> (orbit,) = find_orbit(ImpactOscillator(omega=2.6))
    >>> branch = continue_orbit(orbit, "omega", (2.5, 2.7))
    >>> doubled = switch_branch(branch.special[0])
    >>> doubled.name, doubled.stable
    ('period-2 impact-2', True)
    """
    if not isinstance(point, BifurcationPoint) or point.kind != "period_doubling":
        given = getattr(point, "kind", point)
        raise invalid("point", given, "a period doubling", "take one from the `special` of a branch")
    size = check_share("amplitude", amplitude)
    system, x, direction = _twice(point)
    for _ in range(TRIES):
        start = x + size * direction
        found, made = newton(system, start, direction[None, :], np.array([direction @ start]))
        if made and np.abs(found - start).max() < 0.5 * size:
            return make_orbit(system.model_at(found), system.cycle, system.solution(found))
        size *= 0.5
    raise ValueError(
        f"no doubled orbit was found from `point` at {point.parameter} = {point.value:.12g}; try a smaller `amplitude`"
    )


def _twice(point: BifurcationPoint) -> tuple[System, Any, Any]:
    """Return the doubled equations, the orbit traversed twice, and the direction in which the rounds separate."""
    osc, parameter = point.orbit.oscillator, point.parameter
    cycle, z = solution_of(point.orbit)
    p, n = cycle.n_impacts, cycle.n_periods
    turns, speeds = np.concatenate([z[:p], z[:p] + n]), np.tile(z[p:], 2)
    value = point.value
    around = (value - max(abs(value), 1e-3), value + max(abs(value), 1e-3))
    system = System(
        point.orbit.model, Cycle(2 * n, 2 * p), (parameter,), (around,), max(osc.velocity_scale, float(speeds.max()))
    )
    twice = np.concatenate([turns, speeds])
    scale = np.repeat([1.0, system.speed], 2 * p)
    matrix = system.cycle.jacobian(parameters_of(osc), twice) * scale
    rows = np.repeat([system.speed / max(osc.natural_frequency, osc.omega), system.speed], 2 * p)
    direction = np.linalg.svd(matrix / rows[:, None])[2][-1]
    return system, system.pack(twice), np.append(direction, 0.0)
