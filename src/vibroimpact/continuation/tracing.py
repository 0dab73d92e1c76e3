"""A boundary traced through a plane of two parameters, both ways from a point."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from vibroimpact.continuation.arclength import follow, newton, tangent, weights
from vibroimpact.continuation.points import Special, residual, special_orbit, touch_turns
from vibroimpact.continuation.results import Boundary
from vibroimpact.continuation.system import LAST_IMPACT, TOUCH, System
from vibroimpact.continuation.walking import ENDS, MOST_POINTS
from vibroimpact.orbits.admissibility import ROUNDING, nearest_misses, orbit_size
from vibroimpact.orbits.equations import Floats

HALVINGS = 20  # of the step at which a boundary ceases to be one of the motion
WORST = 1e-10  # residual of a point


def sound(special: Special) -> bool:
    """Whether the mass moves along the orbit of a boundary, but for the graze that the boundary itself is."""
    system, x = special.system, special.x
    osc, z, p = system.oscillator_at(x), system.solution(x), system.cycle.n_impacts
    others = np.delete(z[p:], system.where) if system.condition == LAST_IMPACT else z[p:]
    if (others <= 0.0).any():
        return False
    lowest = min((miss.gap for miss in nearest_misses(osc, system.cycle, z)), default=math.inf)
    return lowest >= -ROUNDING * orbit_size(osc, z)


def _inside(system: System, x: Floats) -> bool:
    """Whether impacts follow in order, and the touch lies inside its flight."""
    p = system.cycle.n_impacts
    turns = np.append(x[:p], x[0] + system.cycle.n_periods)
    if (np.diff(turns) <= 0.0).any():
        return False
    return system.condition != TOUCH or bool(turns[system.where] < x[system.inner - 1] < turns[system.where + 1])


def trace_boundary(system: System, x: Floats, kind: str, longest: float, virtual: bool, report: Any = None) -> Boundary:
    """Return the curve through a point, both ways."""
    x, made = _onto(system, x)
    if not made:
        raise ValueError("`point` cannot be corrected onto its boundary; allowed is a regular one; take another point")
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
    """Yield points one way, each with the reason for which the curve would end there; "" is turned to the last one."""
    start, far, here, p = x, False, x, system.cycle.n_impacts
    begun_sound = sound(Special(kind, system, x))
    for number, step in enumerate(follow(system, x, along, longest)):
        if step.end == "lost" or residual(Special(kind, system, step.x)) > WORST:
            yield here, "lost"
            return
        if not _inside(system, step.x):
            yield here, "impacts_merge"
            return
        if begun_sound and not virtual and not sound(Special(kind, system, step.x)):
            yield _last_sound(system, here, step.x, kind), "inadmissible"
            return
        apart = (step.x - start) * weights(system, start)
        apart[[*range(p), *([2 * p] if system.condition == TOUCH else [])]] -= np.rint(apart[0])
        distance = float(np.linalg.norm(apart))
        far = far or distance > 3.0 * longest
        closed = far and distance < longest and bool(step.tangent @ along > 0.0)
        end = "range" if step.end == "edge" else "closed" if closed else "budget"
        yield step.x, end
        if end != "budget" or number > MOST_POINTS:
            return
        here = step.x


def _last_sound(system: System, inside: Floats, outside: Floats, kind: str) -> Floats:
    """Return the last point between two at which the boundary is one of the motion."""
    for _ in range(HALVINGS):
        way = outside - inside
        middle = inside + 0.5 * way
        found, made = newton(system, middle, way[None, :], np.array([way @ middle]))
        if not made:
            break
        special = Special(kind, system, found)
        if sound(special) and residual(special) <= WORST:
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
