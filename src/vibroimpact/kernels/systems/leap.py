"""Leaps: half a step or a whole one far from all stops, by matrices that are computed once a cell.

Where no damping couples the modes, each moves over a fixed length X by a 2 x 2 matrix, and in proportion to its load
and to (sin, cos) of each harmonic at the beginning. Over it, with m the larger of |eta| at both ends and M a bound of
|eta''|,

    |eta| <= m + M X^2/8,   |p| <= |eta1 - eta0|/X + M X/2,   M <= F + L max|eta| + D max|p|,

F the amplitude of its load, so that M = (F + L m + D |eta1 - eta0|/X)/(1 - L X^2/8 - D X/2) is one; where that
denominator is not above zero nothing is leapt, nor where modes are coupled. A clearance has |u''| <= B = sum |alpha| M
plus that of its stop, and u >= min(u0, u1) - B X^2/8 between: a leap is certified where that is above zero for every
stop, or where a stop that was just struck is left so fast, p0 > B X/2, that it is not touched again. A leap that is not
certified changes nothing. No stop may be closed.
"""

from __future__ import annotations

from numba import njit

from vibroimpact.kernels.flight import BARELY
from vibroimpact.kernels.systems.layout import FLOW
from vibroimpact.kernels.systems.step import OPEN, STRUCK, stop_moves, turned, turns
from vibroimpact.kernels.vectors import fma, get, put, select

LEAPS, HALF, WHOLE = 5, 0.5, 1.0  # and their lengths in steps


@njit(error_model="numpy", forceinline=True)
def _flown(rows, first, j, k, wide):
    """Return a mode's amplitude and rate after a leap."""
    at = first + j * (FLOW + 4 * k.harmonics)
    y, p = get(rows, k.eta + j, wide), get(rows, k.rate + j, wide)
    uu, up, ul = get(rows, at, wide), get(rows, at + 1, wide), get(rows, at + 2, wide)
    pu, pp, pl = get(rows, at + 3, wide), get(rows, at + 4, wide), get(rows, at + 5, wide)
    y1, p1 = fma(uu, y, fma(up, p, ul)), fma(pu, y, fma(pp, p, pl))
    for m in range(k.harmonics):
        own, wave = at + FLOW + 4 * m, k.pairs + 2 * m
        sine, cosine = get(rows, wave, wide), get(rows, wave + 1, wide)
        y1 = fma(get(rows, own, wide), sine, fma(get(rows, own + 1, wide), cosine, y1))
        p1 = fma(get(rows, own + 2, wide), sine, fma(get(rows, own + 3, wide), cosine, p1))
    return y, y1, p1


@njit(error_model="numpy", forceinline=True)
def leap(rows, k, wide, first, length):
    """Make a leap of that many steps where it is certified."""
    turns(rows, k, wide)
    last = first + k.modes * (FLOW + 4 * k.harmonics)
    s, c = get(rows, k.turn, wide), get(rows, k.turn + 1, wide)
    sine, cosine = get(rows, last, wide), get(rows, last + 1, wide)
    s1, c1 = turned(s, c, sine, cosine)
    for j in range(k.modes):
        y, y1, p1 = _flown(rows, first, j, k, wide)
        put(rows, k.flight + 3 * j, wide, y1)
        put(rows, k.flight + 3 * j + 1, wide, p1)
        larger = select(abs(y) > abs(y1), abs(y), abs(y1))
        bound = fma(get(rows, k.square + j, wide), larger, get(rows, k.driven + j, wide))
        damping = get(rows, k.damping + j * (k.modes + 1), wide)
        bound = fma(damping * (1.0 / length), abs(y1 - y), bound)
        bound = bound * get(rows, first + j * (FLOW + 4 * k.harmonics) + 6, wide)
        put(rows, k.flight + 3 * j + 2, wide, bound)
    certain = s == s
    for z in range(k.stops):
        u0, w0 = stop_moves(rows, z, s, c, k, wide)
        u1, _ = stop_moves(rows, z, s1, c1, k, wide)
        bend = get(rows, k.driven + k.modes + z, wide)
        for j in range(k.modes):
            alpha = get(rows, k.alpha + z * k.modes + j, wide)
            u0 = fma(-alpha, get(rows, k.eta + j, wide), u0)
            w0 = fma(-alpha, get(rows, k.rate + j, wide), w0)
            u1 = fma(-alpha, get(rows, k.flight + 3 * j, wide), u1)
            bend = fma(abs(alpha), get(rows, k.flight + 3 * j + 2, wide), bend)
        kind = get(rows, k.kind + z, wide)
        low = select(u0 < u1, u0, u1)
        far = (kind == OPEN) & (low > 0.125 * length * length * bend)
        left = (kind == STRUCK) & (u1 > 0.0) & (w0 > 0.5 * length * bend)
        certain = certain & (far | left)
    _take(rows, certain, s, s1, c1, first, length, k, wide)


@njit(error_model="numpy", forceinline=True)
def _take(rows, certain, s, s1, c1, first, length, k, wide):
    """Leave the state after a leap where it is certain."""
    for j in range(k.modes):
        y, p = get(rows, k.eta + j, wide), get(rows, k.rate + j, wide)
        put(rows, k.eta + j, wide, select(certain, get(rows, k.flight + 3 * j, wide), y))
        put(rows, k.rate + j, wide, select(certain, get(rows, k.flight + 3 * j + 1, wide), p))
        if k.thorough:
            at = first + j * (FLOW + 4 * k.harmonics)
            y, p = get(rows, k.deta + j, wide), get(rows, k.drate + j, wide)
            y1 = fma(get(rows, at, wide), y, get(rows, at + 1, wide) * p)
            p1 = fma(get(rows, at + 3, wide), y, get(rows, at + 4, wide) * p)
            put(rows, k.deta + j, wide, select(certain, y1, y))
            put(rows, k.drate + j, wide, select(certain, p1, p))
    for z in range(k.stops):
        kind = get(rows, k.kind + z, wide)
        put(rows, k.kind + z, wide, select(certain, OPEN, kind))
    c = get(rows, k.turn + 1, wide)
    put(rows, k.turn, wide, select(certain, s1, s))
    put(rows, k.turn + 1, wide, select(certain, c1, c))
    begun = certain & (s < -BARELY) & (s1 >= -BARELY)
    put(rows, k.turn + 2, wide, get(rows, k.turn + 2, wide) + select(begun, 1.0, 0.0))
    put(rows, k.age, wide, get(rows, k.age, wide) + select(certain, length, 0.0))


@njit(error_model="numpy")
def attempt(rows, k, wide, number):
    """Make one of the LEAPS leaps before a step: half a one, whole ones, and half a one again."""
    if number == 0 or number == LEAPS - 1:
        leap(rows, k, wide, k.halves, HALF)
    else:
        leap(rows, k, wide, k.wholes, WHOLE)
