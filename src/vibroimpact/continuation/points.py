"""Points of a branch and its bifurcations.

Tests along a branch change sign where it folds, doubles its period or grazes; between two points the bifurcation is
solved for exactly. At a period doubling `switch_branch` leads to the doubled orbit that is born there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vibroimpact.continuation.results import BifurcationPoint
from vibroimpact.continuation.system import (
    DOUBLING,
    FOLD,
    LAST_IMPACT,
    TOUCH,
    System,
    check_share,
    newton,
    system_of,
    tangent,
)
from vibroimpact.orbits.admissibility import ROUNDING, NearMiss, nearest_misses, orbit_size
from vibroimpact.orbits.equations import Cycle, Floats, fastest_of, parameters_of
from vibroimpact.orbits.orbit import Orbit, make_orbit
from vibroimpact.oscillator import ImpactOscillator
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


def point(system: System, x: Floats, way: Floats) -> Point:
    """Return a point of a branch and its tangent with its tests evaluated."""
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


@dataclass(frozen=True)
class Special:
    """A bifurcation on a branch, or a point of a boundary: the system that it solves, and its unknown."""

    system: System
    x: Floats

    @property
    def kind(self) -> str:
        """What it is to callers."""
        return "grazing" if self.system.condition in (TOUCH, LAST_IMPACT) else self.system.condition

    @property
    def part(self) -> Floats:
        """The unknown of the branch that it lies on."""
        return np.concatenate([self.x[: 2 * self.system.cycle.n_impacts], self.x[self.system.inner :]])

    @property
    def touch_phase(self) -> float:
        """Driving phase of the graze; NaN for other kinds."""
        return self.system.touch(self.x) % 1.0

    @cached_property
    def orbit(self) -> Orbit:
        """The orbit there."""
        return orbit_at(self.system, self.x)

    @cached_property
    def _moving(self) -> tuple[ImpactOscillator, Floats]:
        return self.system.oscillator_at(self.x), self.system.solution(self.x)

    @cached_property
    def residual(self) -> float:
        """By how much the orbit misses its flights and its defining condition, relative to its own size."""
        system, (osc, z), p = self.system, self._moving, self.system.cycle.n_impacts
        parameters, size, speed = parameters_of(osc), orbit_size(osc, z), fastest_of(osc, z[p:])
        flights = system.cycle.misses(parameters, z) / np.repeat([size, speed], p)
        ahead = (system.touch(self.x) - system.cycle.span(z, system.where)[0]) * osc.period
        own = system.condition_misses(parameters, z, ahead, size, speed)
        return max(float(np.abs(flights).max()), *map(abs, own))

    @property
    def admissible(self) -> bool:
        """Whether the mass can move along the orbit; the graze that defines a boundary is allowed."""
        system, (osc, z), p = self.system, self._moving, self.system.cycle.n_impacts
        others = np.delete(z[p:], system.where) if system.condition == LAST_IMPACT else z[p:]
        if (others <= 0.0).any():
            return False
        lowest = min((miss.gap for miss in nearest_misses(osc, system.cycle, z)), default=math.inf)
        return lowest >= -ROUNDING * orbit_size(osc, z)

    def bifurcation(self, parameter: str) -> BifurcationPoint:
        """Return it as callers see it on a branch."""
        value = self.system.values(self.x)[0]
        return BifurcationPoint(self.kind, parameter, value, self.orbit, self.residual, self.touch_phase)


def orbit_at(system: System, x: Floats) -> Orbit:
    """Return the orbit of an unknown."""
    return make_orbit(system.model_at(x), system.cycle, system.solution(x))


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
    return sorted(found, key=lambda special: float((special.part - a.x) @ way))


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
        found, made = newton(system, 0.5 * (a.x + b.x), b.x - a.x)
        if not made:
            return []
        inside = point(system, found, tangent(system, found, a.tangent))
        a, b = (inside, b) if (_test(condition, inside) > 0.0) == (low > 0.0) else (a, inside)
    return []


def _solved(system: System, condition: str, x: Floats, a: Point, b: Point) -> Special | None:
    where, touch = 0, math.nan
    p = system.cycle.n_impacts
    if condition == LAST_IMPACT:
        where = int(np.argmin((a if a.weakest < b.weakest else b).x[p : 2 * p]))
    if condition == TOUCH:
        owner = a if a.margin < b.margin else b
        if owner.closest is None:
            return None
        where = owner.closest.flight
        # The touch moves with the orbit: its distance from the start of the flight is kept.
        touch = owner.closest.turns + float(x[where] - owner.x[where])
    bounded = replace(system, condition=condition, where=where)
    start = np.concatenate([x[: 2 * p], [touch] if condition == TOUCH else [], x[2 * p :]])
    found, made = newton(bounded, start)
    if not made:
        return None
    special = Special(bounded, found)
    part, way = special.part, b.x - a.x
    share = float((part - a.x) @ way / (way @ way))
    aside = float(np.abs(part - a.x - share * way).max())
    return special if -1e-9 <= share <= 1.0 + 1e-9 and aside <= float(np.linalg.norm(way)) else None


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
        found, made = newton(system, start, direction)
        if made and np.abs(found - start).max() < 0.5 * size:
            return orbit_at(system, found)
        size *= 0.5
    raise ValueError(
        f"no doubled orbit was found from `point` at {point.parameter} = {point.value:.12g}; try a smaller `amplitude`"
    )


def _twice(point: BifurcationPoint) -> tuple[System, Floats, Floats]:
    """Return the doubled equations, the orbit traversed twice, and the direction in which the rounds separate."""
    value, width = point.value, max(abs(point.value), 1e-3)
    once, z = system_of(point.orbit, (point.parameter,), ((value - width, value + width),))
    n, p = once.cycle.n_periods, once.cycle.n_impacts
    system = replace(once, cycle=Cycle(2 * n, 2 * p))
    twice = np.concatenate([z[:p], z[:p] + n, z[p:], z[p:]])
    matrix = system.flights_jacobian(parameters_of(system.oscillator), twice)
    return system, system.pack(twice), np.append(np.linalg.svd(matrix)[2][-1], 0.0)
