"""Newton's method, and curves followed by pseudo-arclength."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from vibroimpact.continuation.system import System
from vibroimpact.orbits.equations import Floats

MOST = 12  # corrections of a point
CLOSE = 1e-9  # the correction after which convergence, being quadratic, is complete
SHORTEST = 1e-6  # of the longest step
STRAIGHT = 0.97  # least cosine between the tangents at two points
EASY = 3  # corrections up to which the next step may be longer


def newton(system: System, x: Floats, rows: Floats | None = None, targets: Floats | None = None) -> tuple[Floats, int]:
    """Return the solution near x, with linear equations rows . x = targets beside the system's, and corrections made.

    The number is 0 where it did not converge.
    """
    x = x.copy()
    for made in range(1, MOST + 1):
        if not system.possible(x):
            return x, 0
        misses, matrix = system.misses(x), system.jacobian(x)
        if rows is not None and targets is not None:
            misses, matrix = np.concatenate([misses, rows @ x - targets]), np.concatenate([matrix, rows])
        if not (np.isfinite(misses).all() and np.isfinite(matrix).all()):
            return x, 0
        try:
            correction = np.linalg.solve(matrix, misses)
        except np.linalg.LinAlgError:
            return x, 0
        x -= correction
        size = float(np.abs(correction).max())
        if size < CLOSE:
            return x, made
        if not size < 1e3:
            return x, 0
    return x, 0


def weights(system: System, x: Floats) -> Floats:
    """Return what each unknown counts in the length of a step: velocities in parts of the largest once that grows."""
    p, counts = system.cycle.n_impacts, np.ones(len(x))
    counts[p : 2 * p] /= max(1.0, float(np.abs(x[p : 2 * p]).max()))
    return counts


def tangent(system: System, x: Floats, along: Floats) -> Floats:
    """Return the tangent of the curve at x that points the way `along` does, its weighted length 1."""
    counts = weights(system, x)
    direction = np.linalg.svd(system.jacobian(x) / counts)[2][-1]
    return np.asarray(direction / counts * (1.0 if direction @ (along * counts) >= 0.0 else -1.0))


@dataclass(frozen=True)
class Step:
    """A point of a curve and its tangent; `end` says why no point follows: "" if one does, "edge" or "lost"."""

    x: Floats
    tangent: Floats
    end: str = ""


def follow(system: System, x: Floats, along: Floats, longest: float) -> Iterator[Step]:
    """Yield the points of a curve after x, the way `along` points, up to the edge of the parameters' ranges."""
    way, step = tangent(system, x, along), longest
    while True:
        counts, ahead = weights(system, x), x + step * way
        row = counts * counts * way
        found, made = newton(system, ahead, row[None, :], np.array([row @ ahead]))
        turned = tangent(system, found, way) if made else way
        straight = (turned * counts) @ (way * counts) / np.linalg.norm(turned * counts)
        if not made or straight < STRAIGHT or np.abs((found - ahead) * counts).max() > step:
            step *= 0.5
            if step < SHORTEST * longest:
                yield Step(x, way, "lost")
                return
            continue
        outside = [j for j in range(system.inner, len(found)) if not -1e-12 <= found[j] <= 1.0 + 1e-12]
        if outside:
            yield _to_edge(system, x, found, outside, way)
            return
        x, way = found, turned
        yield Step(x, way)
        step = min(longest, step * (1.5 if made <= EASY else 1.0))


def _to_edge(system: System, inside: Floats, beyond: Floats, outside: list[int], way: Floats) -> Step:
    """Return the point of the curve at which it first leaves the ranges, between a point inside and one beyond."""
    reached = {j: ((0.0 if beyond[j] < 0.0 else 1.0) - inside[j]) / (beyond[j] - inside[j]) for j in outside}
    j = min(reached, key=lambda key: reached[key])
    row = np.zeros((1, len(inside)))
    row[0, j] = 1.0
    start = inside + reached[j] * (beyond - inside)
    edge = np.array([0.0 if beyond[j] < 0.0 else 1.0])
    found, made = newton(system, start, row, edge)
    if not made or np.abs(found - start).max() > np.abs(beyond - inside).max() + 1e-12:
        return Step(inside, way, "lost")
    return Step(found, tangent(system, found, way), "edge")
