"""Newton's method, and curves followed by pseudo-arclength.

A step leads along the tangent; Newton's method then corrects it on the hyperplane normal to the tangent, which passes
folds where the parameter turns (H. B. Keller, in Applications of Bifurcation Theory, Academic Press (1977) 359-384).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from vibroimpact.continuation.system import TOUCH, System
from vibroimpact.orbits.equations import Floats

MOST = 12  # corrections per point
CLOSE = 1e-9  # the correction after which convergence, which is quadratic, is complete
SHORTEST = 1e-6  # of the longest step
STRAIGHT = 0.97  # least cosine between the tangents at two points
EASY = 3  # corrections up to which the next step may be longer


def newton(system: System, x: Floats, rows: Floats | None = None, targets: Floats | None = None) -> tuple[Floats, int]:
    """Return the solution near x of the system and of linear equations rows . x = targets, and corrections made.

    The number is 0 if it did not converge.
    """
    x = x.copy()
    for made in range(1, MOST + 1):
        if not system.possible(x):
            return x, 0
        try:
            misses, matrix = system.misses(x), system.jacobian(x)
        except ValueError:  # a family makes no oscillator of values beside these
            return x, 0
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
    """Return the weight of each unknown in the length of a step; velocities are relative to the largest above 1."""
    p, counts = system.cycle.n_impacts, np.ones(len(x))
    counts[p : 2 * p] /= max(1.0, float(np.abs(x[p : 2 * p]).max()))
    return counts


def tangent(system: System, x: Floats, along: Floats) -> Floats:
    """Return the tangent of the curve at x, in the direction of `along`, of weighted length 1."""
    counts = weights(system, x)
    direction = np.linalg.svd(system.jacobian(x) / counts)[2][-1]
    return np.asarray(direction / counts * (1.0 if direction @ (along * counts) >= 0.0 else -1.0))


@dataclass(frozen=True)
class Step:
    """A point of a curve and its tangent; `end` is why no point follows, "edge" or "lost", or empty if one does."""

    x: Floats
    tangent: Floats
    end: str = ""


def follow(system: System, x: Floats, along: Floats, longest: float) -> Iterator[Step]:
    """Yield the points of a curve after x, in the direction of `along`, up to the edge of the parameters' ranges."""
    way, step = tangent(system, x, along), longest
    while True:
        counts, ahead = weights(system, x), x + step * way
        row = counts * counts * way
        found, made = newton(system, ahead, row[None, :], np.array([row @ ahead]))
        try:
            turned = tangent(system, found, way) if made else way
        except ValueError:
            made, turned = 0, way
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
    """Return the point at which the curve first leaves the ranges, between a point inside and one beyond."""
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


class Loop:
    """Whether a curve has come back to its first point after it went away from it."""

    def __init__(self, system: System, start: Floats, along: Floats, longest: float) -> None:
        p = system.cycle.n_impacts
        self._turns = [*range(p), *([2 * p] if system.condition == TOUCH else [])]
        self._start, self._along, self._longest = start, along, longest
        self._weights, self._far = weights(system, start), False

    def closed_by(self, step: Step) -> bool:
        """Whether the curve closes at its next point; whole turns do not count."""
        apart = (step.x - self._start) * self._weights
        apart[self._turns] -= np.rint(apart[0])
        distance = float(np.linalg.norm(apart))
        self._far = self._far or distance > 3.0 * self._longest
        return self._far and distance < self._longest and bool(step.tangent @ self._along > 0.0)
