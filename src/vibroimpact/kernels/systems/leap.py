"""Leaps: fixed lengths far from all stops, by matrices that are computed once a cell.

Where no damping couples the modes, each moves over a fixed length X by a 2 x 2 matrix, and in proportion to its load
and to (sin, cos) of each harmonic at the beginning. Over it, with m the larger of |eta| at both ends and M a bound of
|eta''|,

    |eta'| <= |eta1 - eta0|/X + M X/2,   |eta| <= m + M X^2/8,   M <= F + L max|eta| + D max|eta'|,

F the amplitude of its load f, so that M = (F + L m + D |eta1 - eta0|/X)/(1 - L X^2/8 - D X/2) is one; where that
denominator is not above zero nothing is leapt, nor where modes are coupled. A clearance u = g - sum alpha eta has
u'' = g'' + w + sum alpha D eta', and w = sum alpha (L eta - f) lies near its chord, so that

    u'' <= B = max|g''| + max(w0, w1) + sum |alpha| ((L M + max|f''|) X^2/8 + D max|eta'|),

and u lies above its chord less B x (X - x)/2. That is above zero on the way where sqrt(u0) + sqrt(u1) > X sqrt(B/2)
(theory, equation 2.2), after an impact with u0 = 0. A leap is certified where it is so for every stop; one that is not
changes nothing. No stop may be closed.

A contact of a lone mode with a stop that gives begins with d = -u = 0, d' = v > 0 and is linear, d'' + D d' + K d =
a(x), D and K with the stop's damper and spring in them and a from the load and the stop's motion. With s(x) the answer
to a unit speed at x = 0, that of the force k d + c d' is r = k s + c s', R its integral, and while r > 0

    k d + c d' = v r(x) + integral of r(x - y) a(y) dy >= v r(x) + min(a, 0) R(x).

y = r'/r obeys y' = -(y^2 + D y + K); where it falls at first (without a damper it begins at infinity) it falls on, so
that R r' <= r (r - r(0)) <= r^2 and R/r grows: v > -min(a, 0) R(X)/r(X), a number of the cell, certifies that the stop
pushes over a leap of X. Other stops must stand on the other side of the mode, and still, so that it moves away from
them. X is below half a period of the contact's: r, above zero at both ends, is so between.
"""

from __future__ import annotations

import math

from vibroimpact.kernels.flight import BARELY
from vibroimpact.kernels.machine import inner
from vibroimpact.kernels.systems.flow import fly_apart, move, stop_moves, turned, turns
from vibroimpact.kernels.systems.layout import CLOSED, FLOW, OPEN, STRUCK
from vibroimpact.kernels.systems.push import account, drain, stands
from vibroimpact.kernels.systems.rest import NOWHERE, TOUCH
from vibroimpact.kernels.systems.step import fly, miss
from vibroimpact.kernels.vectors import anywhere, fma, get, put, select

# Before a step come a half, wholes while they are certified, up to so many, and a half again; their lengths in steps.
# A whole one is two halves: over a half the series holds.
LEAPS, HALF = 32, 0.5
WHOLE = 2.0 * HALF
# A contact's leaps, in steps of its pace: the longer one, with the step after it, ends most, the shorter one weak ones.
WITHIN = 2.0, 1.3


@inner(forceinline=True)
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


@inner(forceinline=True)
def _load(rows, j, s, c, k, wide):
    """Return the load on a mode when (sin wt, cos wt) are those."""
    f, a, b = get(rows, k.load + j, wide), s, c
    for m in range(k.harmonics):
        first = k.force + 2 * (k.harmonics * j + m)
        f = fma(get(rows, first, wide), a, fma(get(rows, first + 1, wide), b, f))
        a, b = fma(a, c, b * s), fma(b, c, -a * s)
    return f


@inner(forceinline=True)
def _leap(rows, k, wide, first, length, willing):
    """Make a leap of that many steps where it is wanted and certified; return where it was."""
    turns(rows, k, wide)
    n, last = k.modes, first + k.modes * (FLOW + 4 * k.harmonics)
    s, c = get(rows, k.turn, wide), get(rows, k.turn + 1, wide)
    s1, c1 = turned(s, c, get(rows, last, wide), get(rows, last + 1, wide))
    for j in range(n):
        at = k.pull + 5 * j
        y, y1, p1 = _flown(rows, first, j, k, wide)
        put(rows, at, wide, y1)
        put(rows, at + 1, wide, p1)
        square, damping = get(rows, k.square + j, wide), get(rows, k.damping + j * (n + 1), wide)
        largest, mean = select(abs(y) > abs(y1), abs(y), abs(y1)), (1.0 / length) * abs(y1 - y)
        bend = fma(square, largest, fma(damping, mean, get(rows, k.driven + j, wide)))
        bend = bend * get(rows, first + j * (FLOW + 4 * k.harmonics) + 6, wide)
        sag = (0.125 * length * length) * fma(square, bend, get(rows, k.driven + n + j, wide))
        put(rows, at + 2, wide, fma(damping, fma(0.5 * length, bend, mean), sag))
        put(rows, at + 3, wide, fma(square, y, -_load(rows, j, s, c, k, wide)))
        put(rows, at + 4, wide, fma(square, y1, -_load(rows, j, s1, c1, k, wide)))
    for z in range(k.stops):
        u0, _ = stop_moves(rows, z, s, c, k, wide)
        u1, _ = stop_moves(rows, z, s1, c1, k, wide)
        rest = get(rows, k.driven + 2 * n + z, wide)
        w0 = w1 = 0.0 * rest
        for j in range(n):
            alpha, at = get(rows, k.alpha + z * n + j, wide), k.pull + 5 * j
            u0 = fma(-alpha, get(rows, k.eta + j, wide), u0)
            u1 = fma(-alpha, get(rows, at, wide), u1)
            rest = fma(abs(alpha), get(rows, at + 2, wide), rest)
            w0 = fma(alpha, get(rows, at + 3, wide), w0)
            w1 = fma(alpha, get(rows, at + 4, wide), w1)
        kind = get(rows, k.kind + z, wide)
        struck = kind == STRUCK
        u0 = select(struck, 0.0, u0)
        room = u0 + u1 + 2.0 * math.sqrt(select(u0 > 0.0, u0 * u1, 0.0))
        bend = rest + select(w0 > w1, w0, w1)
        willing = willing & (struck | ((kind == OPEN) & (u0 > 0.0)))
        willing = willing & (u1 > 0.0) & (room > 0.5 * length * length * bend)
    if k.wary and anywhere(willing):
        fly_apart(rows, k, wide)
        for z in range(k.stops):
            miss(rows, z, length + 0.0 * s, willing, False, k, wide)
    _take(rows, willing, s, s1, c1, first, length, k, wide)
    return willing


@inner(forceinline=True)
def _take(rows, certain, s, s1, c1, first, length, k, wide):
    """Leave the state after a leap where it is certain."""
    for j in range(k.modes):
        y, p = get(rows, k.eta + j, wide), get(rows, k.rate + j, wide)
        put(rows, k.eta + j, wide, select(certain, get(rows, k.pull + 5 * j, wide), y))
        put(rows, k.rate + j, wide, select(certain, get(rows, k.pull + 5 * j + 1, wide), p))
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


@inner(forceinline=True)
def may_leap(rows, k, wide):
    """Return where leaps may be tried."""
    may = get(rows, k.closed, wide) <= (-1.0 if k.draining else 0.0)
    return may & (get(rows, k.engaged, wide) <= 0.0) if k.giving else may


@inner
def leap_half(rows, k, wide, willing):
    """Make half a leap where it is certified; return where it was."""
    return _leap(rows, k, wide, k.halves, HALF, willing)


@inner
def leap_whole(rows, k, wide, willing):
    """Make a leap where it is certified; return where it was."""
    return _leap(rows, k, wide, k.wholes, WHOLE, willing)


@inner
def leap_within(rows, k, wide):
    """Leap from the beginning of a contact of a lone mode, where it is certified; return where it was."""
    begun = (get(rows, k.age, wide) <= 0.0) & (get(rows, k.engaged, wide) == 1.0) & (get(rows, k.closed, wide) <= 0.0)
    leapt = begun & (get(rows, k.age, wide) > 0.0)
    if not anywhere(begun):
        return leapt
    for own in range(2 * k.stops):
        z, length, first = own // 2, WITHIN[own % 2], k.within + own * (FLOW + 4 * k.harmonics + 2)
        s, c = get(rows, k.turn, wide), get(rows, k.turn + 1, wide)
        least, last = get(rows, first + FLOW - 1, wide), first + FLOW + 4 * k.harmonics
        kind, (u, w, size) = get(rows, k.kind + z, wide), stands(rows, z, s, c, k, wide)
        here = begun & (kind >= CLOSED) & (-w > least) & (-w >= get(rows, k.cut, wide))
        here = here & (abs(u) <= TOUCH * size + NOWHERE * get(rows, k.speed, wide))
        if not anywhere(here):
            continue
        if k.forceful or k.draining or k.wary:
            _see(rows, select(here, 0.5 * length, 0.0 * w), k, wide)
        turns(rows, k, wide)
        _, y1, p1 = _flown(rows, first, 0, k, wide)
        put(rows, k.pull, wide, y1)
        put(rows, k.pull + 1, wide, p1)
        s1, c1 = turned(s, c, get(rows, last, wide), get(rows, last + 1, wide))
        _take(rows, here, s, s1, c1, first, length * get(rows, k.pace, wide), k, wide)
        put(rows, k.kind + z, wide, select(here, CLOSED, get(rows, k.kind + z, wide)))
        leapt, begun = leapt | here, begun & (get(rows, k.age, wide) <= 0.0)
    return leapt


@inner
def _see(rows, end, k, wide):
    """Count what a leap within a contact does on its way, by two steps that are taken back."""
    y, p = get(rows, k.eta, wide), get(rows, k.rate, wide)
    s, c, periods = get(rows, k.turn, wide), get(rows, k.turn + 1, wide), get(rows, k.turn + 2, wide)
    here = end > 0.0
    for _ in range(2):
        turns(rows, k, wide)
        fly(rows, True, k, wide)
        for z in range(k.stops if k.wary else 0):
            miss(rows, z, end, here, True, k, wide)
        account(rows, end, k, wide)
        if k.draining:
            drain(rows, end, k, wide)
        move(rows, end, here, k, wide)
    put(rows, k.eta, wide, y)
    put(rows, k.rate, wide, p)
    put(rows, k.turn, wide, s)
    put(rows, k.turn + 1, wide, c)
    put(rows, k.turn + 2, wide, periods)
