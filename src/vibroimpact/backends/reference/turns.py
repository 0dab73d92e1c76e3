"""Near-misses: where a flight turns back in front of the stop, for the `reference` back end.

As with contacts (`reference_contact`), a flight is cut into intervals, and an interval is halved until bounds of the
derivatives leave no doubt whether u' rises through zero on it. Only then is the root looked for.
"""

from __future__ import annotations

import math

import numpy as np

from vibroimpact.backends.reference.contact import HALVINGS, root
from vibroimpact.backends.reference.flight import Floats, FreeMotion
from vibroimpact.backends.reference.motion import Flight

ROUNDING = 1e-16


def closest_miss(free: FreeMotion, flight: Flight) -> float:
    """Return the smallest local minimum of the gap u > 0 in a piece of flight; infinite if there is none.

    A piece that begins on the stop is the take-off, on which u only grows.
    """
    if flight.start.clearance <= 0.0 or flight.duration == 0.0:
        return math.inf
    return min(_minima(free, *_intervals(free, flight)), default=math.inf)


def _intervals(free: FreeMotion, flight: Flight) -> tuple[Floats, Floats, Floats]:
    """Return where the intervals of a flight start and end, and how long they last; all are strides but the last."""
    whole = math.ceil(flight.duration / free.stride) - 1
    first = free.vector(flight.start)
    points = np.concatenate([first[None], free.block[:whole] @ first, free.vector(flight.end)[None]])
    spans = np.full(whole + 1, free.stride)
    spans[-1] = flight.duration - whole * free.stride
    return points[:-1], points[1:], spans


def _minima(free: FreeMotion, starts: Floats, ends: Floats, spans: Floats) -> list[float]:
    """Return the local minima of u on intervals.

    A function with |F''| <= B differs from its chord by at most B span^2/8: u' with B a bound of |u'''|, u'' with one
    of |u''''|. Where u cannot change by more than a rounding there is no turn.
    """
    found = []
    for _ in range(HALVINGS):
        b2, b3, b4, _ = free.bounds(starts, spans)
        p0, p1 = starts[:, 1], ends[:, 1]
        a0, a1 = free.acceleration(starts), free.acceleration(ends)
        moves_on = (np.minimum(p0, p1) > b3 * spans**2 / 8) | (np.maximum(p0, p1) < -b3 * spans**2 / 8)
        bends_down = np.maximum(a0, a1) + b4 * spans**2 / 8 < 0.0
        bends_up = np.minimum(a0, a1) - b4 * spans**2 / 8 > 0.0
        for i in np.flatnonzero(bends_up & (p0 < 0.0) & (p1 >= 0.0)):
            found.append(max(float(root(free, starts[i], spans[i], 1)[1][0]), 0.0))
        still = (np.maximum(np.abs(p0), np.abs(p1)) + b2 * spans) * spans <= ROUNDING * np.abs(starts[:, 0])
        doubt = ~(moves_on | bends_down | bends_up | still)
        if not doubt.any():
            break
        starts, ends, spans = starts[doubt], ends[doubt], 0.5 * spans[doubt]
        middles = np.einsum("nij,nj->ni", free.propagators(spans), starts)
        starts, ends = np.concatenate([starts, middles]), np.concatenate([middles, ends])
        spans = np.tile(spans, 2)
    return found
