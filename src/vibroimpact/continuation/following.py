r"""Pseudo-arclength continuation of the curve defined by the equations of a branch or a boundary.

Each step goes along the tangent of the curve; Newton's method then corrects it on the hyperplane normal to the tangent,
so the curve can be followed through folds, where the parameter turns back (H. B. Keller, in Applications of Bifurcation
Theory, Academic Press (1977) 359-384).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from vibroimpact.continuation.equations import Range
from vibroimpact.continuation.points import Point
from vibroimpact.continuation.results import value_text
from vibroimpact.model import Model
from vibroimpact.model.units import check_pair
from vibroimpact.orbits.equations import Floats
from vibroimpact.orbits.orbit import Orbit
from vibroimpact.parameters import Parameter, invalid, real_number
from vibroimpact.progress import Report

SHORTEST = 1e-6  # of the longest step
STRAIGHT = 0.97  # least cosine between the tangents at two points
BENT = ((1.0 - STRAIGHT) / (1.0 + STRAIGHT)) ** 0.5  # of a step: how far aside an arc of a circle with it leads
EASY = 3  # corrections, at most, before a longer step
GROWTH = 1.5  # growth of the step after an easy one
AWAY = 3.0  # in longest steps: distance from the first point after which a curve may close
EDGE = 1e-12  # of a range: a point this close to an edge lies on it, and two points this close coincide
UNKNOWN: Any = None  # number of points or curves to come
MOST_POINTS = 20_000  # of one direction


def follow(first: Point, longest: float, home: Sequence[Point] | None = None) -> Iterator[tuple[Point, str]]:
    """Yield the points of a curve after the first, along its tangent, to the edge of the ranges or back to the first.

    Each comes with the reason why it is the last, "range", "closed" (the first point again) or "lost" (the last point
    again), else empty. A curve that has come to new equations may close at any of the points `home` instead.
    """
    equations, point, step, away = first.equations, first, longest, home is not None
    while True:
        weights, ahead = equations.weights(point.x), point.x + step * point.tangent
        solution, corrections, jacobian = equations.newton(ahead, weights * weights * point.tangent)
        following = point.at(solution, jacobian) if corrections else point
        direction = following.tangent * weights
        cosine = direction @ (point.tangent * weights) / np.linalg.norm(direction)
        aside = np.linalg.norm((solution - ahead) * weights)
        if not corrections or cosine < STRAIGHT or aside > BENT * step:
            step *= 0.5
            if step < SHORTEST * longest:
                yield point, "lost"
                return
            continue
        outside = [j for j in range(equations.inner, len(solution)) if not -EDGE <= solution[j] <= 1.0 + EDGE]
        if outside:
            yield _to_edge(point, solution, outside)
            return
        before, point = point, following
        away = away or equations.distance(first.x, point.x) > AWAY * longest
        again = _back(before, point, [first] if home is None else home, longest) if away else None
        if again is None or (again.x - point.x) @ point.tangent > 0.0:
            yield point, ""
        if again is not None:
            yield again, "closed"
            return
        step = min(longest, step * (GROWTH if corrections <= EASY else 1.0))


def follow_dense(
    first: Point, longest: float, strides: int, home: Sequence[Point] | None
) -> Iterator[tuple[Point, str]]:
    """Yield points as `follow` does, in steps of up to `strides` times `longest` where no test falls by half."""
    before = first
    for after, end in follow(first, strides * longest, home):
        for point in [] if end == "lost" else _inside(before, after, longest):
            yield point, ""
        yield after, end
        before = after


def _inside(a: Point, b: Point, longest: float) -> list[Point]:
    """Return points between two that are further apart than `longest`, if a test falls by half between them."""
    weights = a.equations.weights(a.x)
    if np.linalg.norm((b.x - a.x) * weights) <= 1.01 * longest or not b.nears(a):
        return []
    middle = a.towards(b)
    return [] if middle is None else [*_inside(a, middle, longest), middle, *_inside(middle, b, longest)]


def _back(before: Point, point: Point, home: Sequence[Point], near: float) -> Point | None:
    """Return the first of some points again, up to whole turns, if the curve comes or has just come to it."""
    for one in home:
        again = replace(one, x=point.x - point.equations.apart(one.x, point.x))
        close = point.equations.distance(one.x, point.x) < near
        if close and point.tangent @ one.tangent > 0.0 and (again.x - before.x) @ before.tangent > 0.0:
            return again
    return None


def _to_edge(inside: Point, beyond: Floats, outside: list[int]) -> tuple[Point, str]:
    """Return the point at which the curve first leaves the ranges, between a point inside and one beyond."""
    edges = {j: 0.0 if beyond[j] < 0.0 else 1.0 for j in outside}
    shares = {j: (edge - inside.x[j]) / (beyond[j] - inside.x[j]) for j, edge in edges.items()}
    j = min(shares, key=lambda key: shares[key])
    start = inside.x + shares[j] * (beyond - inside.x)
    solution, corrections, jacobian = inside.equations.newton(start, np.eye(len(start))[j], edges[j])
    if not corrections or np.abs(solution - start).max() > np.abs(beyond - inside.x).max() + EDGE:
        return inside, "lost"
    return inside.at(solution, jacobian), "range"


@dataclass
class Way:
    """One direction of a curve: its points, the bifurcations on it, and why it ended."""

    points: list[Any]
    special: list[Any] = field(default_factory=list)
    end: str = "budget"
    why: str = ""


def both_ways(walk: Callable[[float], Iterator[Way]], report: Report) -> list[Way]:
    """Return both directions of a curve, along the tangent (1) and against it (-1); a walk yields after each point."""
    ways: list[Way] = []
    done = 0
    for direction in (-1.0, 1.0):
        if ways and ways[0].end == "closed":
            break
        for way in walk(direction):
            if report(done + len(way.points), UNKNOWN, None) is False:
                way.end = "stopped"
                break
        done += len(way.points)
        ways.append(way)
    if ways[-1].end == "closed":  # the whole curve, even if the other way ended before
        nothing = Way(ways[-1].points[:1], end="closed")
        return [ways[0], nothing] if len(ways) == 1 else [nothing, ways[1]]
    return ways


def check_range(
    model: Model, name: Any, ends: Any, orbit: Orbit | None, table: Mapping[str, Parameter] | None = None
) -> Range:
    """Return the ends of a parameter's range, which must include the value of an orbit if there is one."""
    low, high = check_pair(model.parameters if table is None else table, name, "range", ends)
    if not low < high:
        raise invalid("range", ends, "a lower number before a higher one")
    if orbit and not low <= orbit.value(name) <= high:
        at = value_text(model, name, orbit.value(name))
        raise invalid("range", ends, f"one that contains the orbit's {at}", "widen it")
    return low, high


def check_share(name: str, share: Any) -> float:
    """Return a step length, relative to the ranges, a driving period and the orbit's speed."""
    allowed = "a number from 1e-6 to 0.5"
    value = real_number(name, share, allowed)
    if not 1e-6 <= value <= 0.5:
        raise invalid(name, share, allowed, "0.01 is usual")
    return value
