"""Points of a branch, what is tested along it, and where between two points a test fails exactly."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from vibroimpact.continuation.arclength import Step, newton, tangent
from vibroimpact.continuation.system import DOUBLING, FOLD, LAST_IMPACT, TOUCH, System
from vibroimpact.orbits.admissibility import NearMiss, nearest_misses, orbit_size
from vibroimpact.orbits.building import make_orbit
from vibroimpact.orbits.equations import Floats, flight_of, parameters_of
from vibroimpact.orbits.orbit import Orbit

HALVINGS = 12  # of a step, in search of what happens inside


@dataclass(frozen=True)
class Point:
    """A point of a branch with what is tested along it; each test is positive or negative, `margin` maybe infinite."""

    x: Floats
    tangent: Floats
    fold: float
    doubling: float
    weakest: float
    margin: float
    closest: NearMiss | None

    @property
    def clear(self) -> bool:
        """Whether no flight passes the stop and no impact has a velocity away from it."""
        return self.weakest > 0.0 and self.margin > 0.0


@dataclass(frozen=True)
class Special:
    """A boundary met along a branch: which, the system it solves, where, and its unknown."""

    kind: str
    system: System
    x: Floats


def point(system: System, step: Step | Floats, along: Floats | None = None) -> Point:
    """Return a point of a branch with its tests made."""
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
    """Return the boundaries that lie between two neighbouring points of a branch, in their order."""
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
    """Solve for the boundary between two points, halving the way between them while Newton's method leaves it."""
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
        # Turns move along with the orbit's: the way from the flight's begin is kept.
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
    return make_orbit(system.oscillator_at(special.x), system.cycle, system.solution(special.x))


def residual(special: Special) -> float:
    """Return by how much an orbit misses its flights and its defining condition, in parts of its own size."""
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
    """Return the turns at which the orbit grazes; NaN where that is no part of the condition."""
    system = special.system
    if system.condition == LAST_IMPACT:
        return float(special.x[system.where])
    return float(special.x[system.inner - 1]) if system.condition == TOUCH else math.nan
