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
from vibroimpact.continuation.system import DOUBLING, FOLD, LAST_IMPACT, TOUCH, System, check_share, system_of
from vibroimpact.orbits.admissibility import ROUNDING, NearMiss, closest, orbit_size
from vibroimpact.orbits.equations import Cycle, Floats, fastest_of, parameters_of
from vibroimpact.orbits.orbit import Orbit, make_orbit
from vibroimpact.oscillator import ImpactOscillator
from vibroimpact.parameters import invalid

HALVINGS = 12  # of a step, in search of what happens inside
TRIES = 12  # of an amplitude, halved each time


@dataclass(frozen=True)
class Solution:
    """A solution of a system: a point of a branch or a boundary, or a bifurcation."""

    system: System
    x: Floats

    @cached_property
    def orbit(self) -> Orbit:
        """The orbit there."""
        return make_orbit(self.system.model_at(self.x), self.system.cycle, self.z)

    @cached_property
    def oscillator(self) -> ImpactOscillator:
        """The oscillator there."""
        osc: ImpactOscillator = self.system.model_at(self.x).at()
        return osc

    @cached_property
    def z(self) -> Floats:
        """Turns and velocities."""
        return self.system.solution(self.x)

    @cached_property
    def closest(self) -> NearMiss | None:
        """Where the mass comes closest to the stop between impacts."""
        return closest(self.oscillator, self.system.cycle, self.z)

    @property
    def margin(self) -> float:
        """The gap there, in parts of the orbit's size; infinite if there is none."""
        return self.closest.gap / orbit_size(self.oscillator, self.z) if self.closest else math.inf

    @property
    def admissible(self) -> bool:
        """Whether the mass can move along the orbit; the graze that defines a boundary is allowed."""
        speeds = self.z[self.system.cycle.n_impacts :]
        others = np.delete(speeds, self.system.where) if self.system.condition == LAST_IMPACT else speeds
        return bool((others > 0.0).all() and self.margin >= -ROUNDING)

    @property
    def kind(self) -> str:
        """Which bifurcation it is."""
        return "grazing" if self.system.condition in (TOUCH, LAST_IMPACT) else self.system.condition

    @property
    def touch_phase(self) -> float:
        """Driving phase of the graze; NaN for other kinds."""
        return self.system.touch(self.x) % 1.0

    @cached_property
    def residual(self) -> float:
        """By how much the orbit misses its flights and its defining condition, relative to its own size."""
        system, osc, z, p = self.system, self.oscillator, self.z, self.system.cycle.n_impacts
        parameters, size, speed = parameters_of(osc), orbit_size(osc, z), fastest_of(osc, z[p:])
        flights = system.cycle.misses(parameters, z) / np.repeat([size, speed], p)
        ahead = (system.touch(self.x) - system.cycle.span(z, system.where)[0]) * osc.period
        own = system.condition_misses(parameters, z, ahead, size, speed)
        return max(float(np.abs(flights).max()), *map(abs, own))

    @property
    def on_branch(self) -> Floats:
        """The unknown of the branch that a bifurcation lies on."""
        return np.concatenate([self.x[: 2 * self.system.cycle.n_impacts], self.x[self.system.inner :]])

    def bifurcation(self, parameter: str) -> BifurcationPoint:
        """Return a bifurcation on a branch as callers see it."""
        value = self.system.values(self.x)[0]
        return BifurcationPoint(self.kind, parameter, value, self.orbit, self.residual, self.touch_phase)


@dataclass(frozen=True)
class Point(Solution):
    """A point of a branch with its tangent, and the tests along it, which change sign at bifurcations."""

    tangent: Floats

    @cached_property
    def tests(self) -> dict[str, float]:
        """The test of each condition."""
        cycle, parameters = self.system.cycle, self.system.parameters(self.x)
        return {
            FOLD: float(self.tangent[-1]),
            DOUBLING: 1.0 + cycle.trace(parameters, self.z) + cycle.determinant(parameters),
            LAST_IMPACT: float(self.z[cycle.n_impacts :].min()) / self.system.speed,
            TOUCH: self.margin,
        }

    def nears(self, other: Point) -> bool:
        """Whether a test is less than half of what it was at another point."""
        return any(self.tests[key] * math.copysign(1.0, was) < 0.5 * abs(was) for key, was in other.tests.items())

    @property
    def clear(self) -> bool:
        """Whether no flight penetrates the stop and no impact has a velocity away from it."""
        return self.tests[LAST_IMPACT] > 0.0 and self.margin > 0.0


def between(a: Point, b: Point) -> list[Solution]:
    """Return the bifurcations between two neighbouring points of a branch, in their order."""
    changed = [condition for condition in a.tests if (a.tests[condition] > 0.0) != (b.tests[condition] > 0.0)]
    last = LAST_IMPACT in changed
    wanted = [FOLD] if FOLD in changed else []
    wanted += [DOUBLING] if DOUBLING in changed and not last else []
    wanted += [LAST_IMPACT if last else TOUCH] if a.clear != b.clear else []
    found = [special for condition in wanted if (special := _located(condition, a, b)) is not None]
    return sorted(found, key=lambda special: float((special.on_branch - a.x) @ (b.x - a.x)))


def _located(condition: str, a: Point, b: Point) -> Solution | None:
    """Solve for the bifurcation between two points; while Newton's method leaves the interval, halve it."""
    system = a.system
    for _ in range(HALVINGS):
        low, high = (
            value if math.isfinite(value) else math.copysign(1.0, value)
            for value in (a.tests[condition], b.tests[condition])
        )
        share = low / (low - high) if low != high else 0.5
        special = _solved(condition, a.x + share * (b.x - a.x), a, b)
        if special is not None:
            return special
        found, made, jacobian = system.newton(0.5 * (a.x + b.x), b.x - a.x)
        if not made:
            return None
        inside = Point(system, found, system.tangent(found, a.tangent, jacobian))
        a, b = (inside, b) if (inside.tests[condition] > 0.0) == (low > 0.0) else (a, inside)
    return None


def _solved(condition: str, x: Floats, a: Point, b: Point) -> Solution | None:
    """Return the bifurcation that Newton's method reaches from x, or None if it does not lie between the points."""
    where, touch, p = 0, math.nan, a.system.cycle.n_impacts
    if condition in (LAST_IMPACT, TOUCH):
        owner = a if a.tests[condition] < b.tests[condition] else b
        where = int(np.argmin(owner.x[p : 2 * p]))
        if condition == TOUCH:
            if owner.closest is None:
                return None
            where = owner.closest.flight
            # The touch moves with the orbit: its distance from the start of the flight is kept.
            touch = owner.closest.turns + float(x[where] - owner.x[where])
    bounded = replace(a.system, condition=condition, where=where)
    start = np.concatenate([x[: 2 * p], [touch] if condition == TOUCH else [], x[2 * p :]])
    found, made, _ = bounded.newton(start)
    if not made:
        return None
    special = Solution(bounded, found)
    part, way = special.on_branch, b.x - a.x
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
        found, made, _ = system.newton(start, direction)
        if made and np.abs(found - start).max() < 0.5 * size:
            return Solution(system, found).orbit
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
