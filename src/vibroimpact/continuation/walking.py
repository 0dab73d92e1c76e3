"""The two ways of a branch from an orbit, with what is met along them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vibroimpact.continuation.arclength import follow, newton, tangent
from vibroimpact.continuation.points import Point, Special, between, branch_part, point
from vibroimpact.continuation.system import DOUBLING, System
from vibroimpact.orbits.building import solution_of
from vibroimpact.orbits.equations import Cycle, Floats
from vibroimpact.orbits.orbit import Orbit

MOST_POINTS = 20_000  # of one direction
ONE_HALF = 1e-6  # of the halves of a doubled orbit: nearer than this they are one orbit

ENDS = {
    "range": "at the end of the range",
    "grazing": "where it grazes the stop",
    "inadmissible": "where it is no motion of the mass any more",
    "period_doubling": "at the period doubling it comes from",
    "closed": "where it began: the branch is closed",
    "impacts_merge": "where two impacts become one",
    "lost": "where Newton's method finds no next orbit",
    "budget": f"after {MOST_POINTS} orbits",
    "stopped": "where it was told to stop",
}


@dataclass
class Way:
    """What was met along one direction of a branch, and why it ended."""

    points: list[Point]
    special: list[Special]
    end: str = "budget"


def branch_system(orbit: Orbit, parameter: str, range: tuple[float, float]) -> tuple[System, Floats]:
    """Return the equations of a branch and the unknown of the orbit it begins with."""
    cycle, z = solution_of(orbit)
    speed = max(orbit.oscillator.velocity_scale, float(np.abs(z[cycle.n_impacts :]).max()))
    system = System(orbit.oscillator, cycle, (parameter,), (range,), speed)
    return system, system.pack(z, orbit.oscillator)


def walk(system: System, x: Floats, along: Floats, longest: float, virtual: bool) -> Iterator[Way]:
    """Yield, point by point, what one direction of a branch has met so far."""
    start = here = point(system, x, along)
    way, far = Way([start], []), False
    for step in follow(system, x, along, longest):
        if step.end == "lost":
            way.end = "lost"
            break
        there = point(system, step)
        if _merged(system.cycle, there.x):
            way.end = "impacts_merge"
            break
        halved = _halved(system, here, there)
        if halved is not None:
            way.special.append(halved)
            way.end = "period_doubling"
            break
        met = between(system, here, there)
        for special in met:
            way.points.append(point(system, branch_part(special), here.tangent))
            way.special.append(special)
            if special.kind == "grazing" and here.clear and not virtual:
                way.end = "grazing"
                yield way
                return
        if not virtual and here.clear and not there.clear:
            way.end = "inadmissible"
            break
        way.points.append(there)
        here = there
        apart = there.x - start.x
        apart[: system.cycle.n_impacts] -= np.rint(apart[0])
        distance = float(np.linalg.norm(apart))
        far = far or distance > 3.0 * longest
        if step.end == "edge":
            way.end = "range"
            break
        if far and distance < longest and there.tangent @ start.tangent > 0.0:
            way.end = "closed"
            break
        if len(way.points) > MOST_POINTS:
            break
        yield way
    yield way


def _merged(cycle: Cycle, x: Floats) -> bool:
    turns = np.append(x[: cycle.n_impacts], x[0] + cycle.n_periods)
    return bool((np.diff(turns) <= 0.0).any())


def _apart(system: System, x: Floats) -> Floats | None:
    """Return how the two halves of a cycle of even n and p differ."""
    p = system.cycle.n_impacts
    if p % 2 or system.cycle.n_periods % 2:
        return None
    h = p // 2
    return np.concatenate([x[h:p] - x[:h] - 0.5 * system.cycle.n_periods, x[p + h : 2 * p] - x[p : p + h]])


def _halved(system: System, a: Point, b: Point) -> Special | None:
    """Return the period doubling at which the halves of a doubled orbit become one between two points."""
    before, after = _apart(system, a.x), _apart(system, b.x)
    if before is None or after is None:
        return None
    if before @ after > 0.0 and np.abs(after).max() > ONE_HALF:
        return None
    p, h = system.cycle.n_impacts, system.cycle.n_impacts // 2
    half = replace(system, cycle=Cycle(system.cycle.n_periods // 2, h), condition=DOUBLING)
    share = 1.0 / (1.0 + float(np.linalg.norm(after) / np.linalg.norm(before)))
    x = a.x + share * (b.x - a.x)
    turns = 0.5 * (x[:h] + x[h:p] - 0.5 * system.cycle.n_periods)
    found, made = newton(half, np.concatenate([turns, 0.5 * (x[p : p + h] + x[p + h : 2 * p]), x[2 * p :]]))
    return Special(DOUBLING, half, found) if made else None


def both_ways(system: System, x: Floats, longest: float, virtual: bool, report: Any = None) -> tuple[Way, Way]:
    """Return what lies down and up the parameter from an orbit."""
    up = np.zeros(len(x))
    up[-1] = 1.0
    ways: list[Way] = []
    count = 0
    up = tangent(system, x, up)
    for along in (-up, up):
        way = Way([point(system, x, along)], [], "closed")
        if not (ways and ways[0].end == "closed"):
            for way in walk(system, x, along, longest, virtual):
                if report is not None and report(count + len(way.points), None, None) is False:
                    way.end = "stopped"
                    break
        count += len(way.points)
        ways.append(way)
    return ways[0], ways[1]
