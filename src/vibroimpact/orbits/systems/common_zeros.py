r"""All common zeros of two trigonometric polynomials whose coefficients are smooth functions of a duration.

    F_i(tau, theta) = sum_h a_ih(tau) z_h(theta) = 0,    z = (1, sin h theta, ..., cos h theta, ...),    i = 1, 2.

The coefficients are interpolated at Chebyshev points of intervals. An interval is halved until the last terms of its
series have fallen to `RESOLVED` of the largest; these terms estimate the truncation error (J. P. Boyd, Chebyshev and
Fourier Spectral Methods, Dover (2001), section 2.12). Then rectangles of duration and angle are halved along one side
at a time. Scale a rectangle to half sides 1; let F and J be the values and derivatives at its centre, and R bounds of
the second-order terms and of the truncation error. Then

    |F_i| > |J_i1| + |J_i2| + R_i,  or  |J^-1 F|_i > 1 + (|J^-1| R)_i:    it contains no zero, (|J^-1| R)_1 < 1/2 and
    (|J^-1| R)_2 < 1/2:                            it contains at most one.

So no zero is missed, except perhaps in rectangles where neither test succeeds after `HALVINGS` of both sides: two zeros
may be closer together than such a rectangle, and Newton's method must find them. The side halved is the one along which
the second-order terms are larger.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from vibroimpact.cells import Floats
from vibroimpact.orbits.equations import TURN

Coefficients = Callable[[Floats, float], Floats]

DEGREE = 16  # of the series
RESOLVED = 1e-9
FEWEST_INTERVALS, MOST_INTERVALS = 4, 128  # intervals, at most; beyond that, longer durations are left out
SMOOTH = 0.1  # the last terms fall to less where an interval is halved, unless they are rounding,
ROUNDED = 1e-6  # which they are at most that part of the largest to be
SHORTEST = 2.0**-40  # of the length: shorter intervals hold nothing but rounding
SECTORS = 8  # rectangles a turn of the highest order
HALVINGS = 12
RECTANGLES, CROWD = 1 << 13, 1 << 8  # limits in all and per interval; beyond, Newton's method
STEPS = 12  # Newton steps: near a double zero each step only halves the error
ARRIVED = 1e-6  # of a rectangle's side: convergence test of a Newton step

NODES = -np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))
TO_TERMS = np.linalg.inv(chebyshev.chebvander(NODES, DEGREE))
SLOPES, BENDS = (chebyshev.chebder(np.eye(DEGREE + 1), order) for order in (1, 2))


class Zeros(NamedTuple):
    """Common zeros, and the interval of durations in which others may have been missed; None if there is none."""

    durations: Floats
    angles: Floats
    unsearched: tuple[float, float] | None


class Series(NamedTuple):
    """Coefficients over intervals: middles, half lengths, terms (interval, function, degree, z), bounds of the rest."""

    middles: Floats
    halves: Floats
    terms: Floats
    rest: Floats


class Rectangles(NamedTuple):
    """Rectangles: their intervals, centres (places in the intervals, -1 to 1, and angles), and half sides."""

    intervals: NDArray[np.intp]
    places: Floats
    angles: Floats
    halves: Floats
    wides: Floats

    def of(self, chosen: NDArray[np.bool_]) -> Rectangles:
        """Return a selection of the rectangles."""
        intervals, *rest = self
        return Rectangles(intervals[chosen], *(column[chosen] for column in rest))

    def halved(self, along: NDArray[np.bool_]) -> Rectangles:
        """Return the two halves of each: of its duration where `along` is true, else of its angle."""
        halves, wides = np.where(along, 0.5, 1.0) * self.halves, np.where(along, 1.0, 0.5) * self.wides
        offset, turn = np.where(along, halves, 0.0), np.where(along, 0.0, wides)
        low = Rectangles(self.intervals, self.places - offset, self.angles - turn, halves, wides)
        high = Rectangles(self.intervals, self.places + offset, self.angles + turn, halves, wides)
        return _joined([low, high])


def _joined(parts: Sequence[Rectangles]) -> Rectangles:
    return Rectangles(*map(np.concatenate, zip(*parts, strict=True)))


def common_zeros(coefficients: Coefficients, length: float, orders: Floats) -> Zeros:
    """Return all common zeros between the durations 0 and `length`.

    `coefficients` returns the coefficients at the Chebyshev points of intervals of one width, given where they begin,
    indexed by interval, point, function and z.
    """
    series, ends = _interpolated(coefficients, length)
    number, sectors = len(series.middles), SECTORS * int(orders.max(initial=1.0))
    wide = 0.5 * TURN / sectors
    angles = np.tile(wide * (1.0 + 2.0 * np.arange(sectors)), number)
    one = np.ones(len(angles))
    rectangles = Rectangles(np.repeat(np.arange(number), sectors), 0.0 * one, angles, one, wide * one)
    second, starts = _second(series, orders), []
    for _ in range(2 * HALVINGS):
        possible, single, along = _tested(series, orders, second, rectangles)
        starts.append(rectangles.of(single))
        counts = np.bincount(rectangles.intervals[more := possible & ~single], minlength=number)
        order = np.argsort(counts)
        crowded = order[(np.cumsum(counts[order]) > RECTANGLES) | (counts[order] > CROWD)]
        starts.append(rectangles.of(more & (aside := np.isin(rectangles.intervals, crowded))))
        ends = np.concatenate([ends, (series.middles + np.array([[-1.0], [1.0]]) * series.halves)[:, crowded].ravel()])
        rectangles = rectangles.of(more := more & ~aside).halved(along[more])
        if not more.any():
            break
    unsearched = (float(ends.min()), float(ends.max())) if len(ends) else None
    return Zeros(*_refined(series, orders, _joined([*starts, rectangles])), unsearched)


def _interpolated(coefficients: Coefficients, length: float) -> tuple[Series, Floats]:
    """Return the series of the coefficients between 0 and a length, and the ends of the intervals left out."""
    width, pieces, unresolved = length / FEWEST_INTERVALS, [], np.array([])
    lows, before = width * np.arange(float(FEWEST_INTERVALS)), np.full((FEWEST_INTERVALS, 2), np.inf)
    while len(lows):
        terms = np.einsum("kj,pjiz->pikz", TO_TERMS, coefficients(lows, width))
        rest, sizes = np.abs(terms[:, :, -2:]).sum(axis=(2, 3)), np.abs(terms).max(axis=(2, 3))
        rounded = (rest > SMOOTH * before) & (rest <= ROUNDED * sizes)
        done = ((rest <= RESOLVED * sizes) | rounded).all(axis=1)
        pieces.append(Series(lows[done] + 0.5 * width, np.full(done.sum(), 0.5 * width), terms[done], rest[done]))
        before, width = np.repeat(rest[~done], 2, axis=0), 0.5 * width
        lows = (lows[~done, None] + [0.0, width]).ravel()
        if width < SHORTEST * length:
            unresolved, lows = np.concatenate([unresolved, lows, lows + width]), lows[:0]
        if len(lows) > MOST_INTERVALS:
            unresolved = np.concatenate([unresolved, lows[MOST_INTERVALS:], lows[MOST_INTERVALS:] + width])
            lows, before = lows[:MOST_INTERVALS], before[:MOST_INTERVALS]
    return Series(*map(np.concatenate, zip(*pieces, strict=True))), unresolved


def _second(series: Series, orders: Floats) -> list[Floats]:
    """Return bounds of the second derivatives in each interval: place-place, place-angle, angle-angle."""
    turns = np.concatenate([[0.0], orders, orders])
    every = series.terms, SLOPES @ series.terms, BENDS @ series.terms
    values, slopes, bends = (np.abs(terms).sum(axis=2) for terms in every)
    return [bends.sum(axis=-1), slopes @ turns, values @ turns**2]


def _values(series: Series, orders: Floats, at: Rectangles) -> tuple[Floats, Floats]:
    """Return both functions at the centres of rectangles, and their derivatives with respect to place and angle."""
    powers = chebyshev.chebvander(at.places, DEGREE)
    weights = np.stack([powers, powers[:, :-1] @ SLOPES], axis=1)
    number, size = len(at.places), series.terms.shape[-1]
    terms = series.terms[at.intervals].swapaxes(1, 2).reshape(number, DEGREE + 1, 2 * size)
    rows, rates = (weights @ terms).reshape(number, 2, 2, size).swapaxes(0, 1)
    turned = np.multiply.outer(at.angles, orders)
    sine, cosine, one = np.sin(turned), np.cos(turned), np.ones((len(turned), 1))
    z = np.concatenate([one, sine, cosine], axis=1)
    turning = np.concatenate([0.0 * one, orders * cosine, -orders * sine], axis=1)
    slopes = [np.einsum("piz,pz->pi", rates, z), np.einsum("piz,pz->pi", rows, turning)]
    return np.einsum("piz,pz->pi", rows, z), np.stack(slopes, axis=-1)


def _inverse(slopes: Floats) -> Floats:
    """Return the inverses of 2 x 2 matrices; infinite or NaN for singular ones."""
    (a, b), (c, d) = slopes[:, 0].T, slopes[:, 1].T
    with np.errstate(divide="ignore", invalid="ignore"):
        inverses: Floats = np.array([[d, -b], [-c, a]]) / (a * d - b * c)
    return inverses.transpose(2, 0, 1)


def _tested(
    series: Series, orders: Floats, second: list[Floats], rectangles: Rectangles
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which rectangles may contain a zero, which of these at most one, and which to halve by duration."""
    half, wide = rectangles.halves[:, None], rectangles.wides[:, None]
    values, slopes = _values(series, orders, rectangles)
    slopes = slopes * np.stack([half, wide], axis=2)
    bend, twist, curl = (each[rectangles.intervals] for each in second)
    bend, curl = 0.5 * bend * half**2, 0.5 * curl * wide**2
    rest = series.rest[rectangles.intervals] + bend + twist * half * wide + curl
    possible = (np.abs(values) <= np.abs(slopes).sum(axis=2) + rest).all(axis=1)
    with np.errstate(invalid="ignore"):
        inverse = _inverse(slopes)
        steps = np.abs(np.einsum("pij,pj->pi", inverse, values))
        spread = np.einsum("pij,pj->pi", np.abs(inverse), rest)
        possible &= ~(steps > 1.0 + spread).any(axis=1)
    along = np.divide(bend - curl, rest, out=np.zeros_like(rest), where=rest > 0.0).sum(axis=1) > 0.0
    return possible, possible & (spread < 0.5).all(axis=1), along


def _refined(series: Series, orders: Floats, at: Rectangles) -> tuple[Floats, Floats]:
    """Return durations and angles of the zeros that Newton's method reaches."""
    steps = np.zeros((0, 2))
    for _ in range(STEPS):
        values, slopes = _values(series, orders, at)
        with np.errstate(invalid="ignore"):
            steps = np.einsum("pij,pj->pi", _inverse(slopes), values)
        at = at.of(inside := (np.abs(steps) < 1.0).all(axis=1) & (np.abs(at.places) < 1.1))
        steps = steps[inside]
        at = at._replace(places=at.places - steps[:, 0], angles=at.angles - steps[:, 1])
    at = at.of((np.abs(steps) < ARRIVED).all(axis=1) & (np.abs(at.places) < 1.0 + ARRIVED))
    durations, angles = series.middles[at.intervals] + series.halves[at.intervals] * at.places, at.angles % TURN
    places = np.stack([durations, np.cos(angles), np.sin(angles)], axis=-1)
    first = np.unique(np.round(places / ARRIVED), axis=0, return_index=True)[1]
    return durations[first], angles[first]
