"""Leaps: fixed lengths far from all stops, by matrices that are computed once a cell.

Over a fixed length X the modes move by a matrix, of a mode alone where no damping couples them, and in proportion to
their loads and to (sin, cos) of each harmonic at the beginning. Over it, with m the larger of |eta| at both ends, v =
|eta1 - eta0|/X and M a bound of |eta''|, mode by mode,

    |eta'| <= v + M X/2,   |eta| <= m + M X^2/8,   M <= F + L max|eta| + |D| max|eta'|,

F the amplitudes of the loads, so that M <= A M + F + L m + |D| v with A = L X^2/8 + |D| X/2. Where A d < d for some d >
0, the inverse N of 1 - A exists and is >= 0: then M = N (F + L m + |D| v) is a bound. For d the modes of equal mass are
taken; where they do not do nothing is leapt. A clearance u has u'' = w - alpha D eta', w = g'' - alpha (f - L eta), and
w lies near its chord: with G the amplitude of the second derivative of g'' - alpha f,

    u'' <= B = max(w0, w1) + (|alpha| L M + G) X^2/8 + |alpha D| (v + M X/2),

and u lies above its chord less B x (X - x)/2. That is above zero on the way where sqrt(u0) + sqrt(u1) > X sqrt(B/2)
(theory, equation 2.2), after an impact with u0 = 0. A leap is certified where it is so for every stop; one that is not
changes nothing. No stop may be closed.

Fast modes, which swing about where they stand, do not bend what a *far* leap of many steps is certified by. Of one that
loads leave with amplitude P and speed P' at most, and that damping does not couple, energy only falls, so that

    |eta| <= 2 P + P'/sqrt(L) + |eta0| + |eta0'|/sqrt(L)

for ever. A clearance lies above that of the slow modes alone, which has the bound above, less |alpha| times that of the
fast ones; there sqrt(u0) + sqrt(u1) has to be so large once it is taken from both.

A contact of a lone mode with a compliant stop begins with d = -u = 0, d' = v > 0 and is linear, d'' + D d' + K d =
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

from vibroimpact.kernels.flight import BARELY, turned
from vibroimpact.kernels.shared.deferred import deferred
from vibroimpact.kernels.shared.machine import inner
from vibroimpact.kernels.shared.vectors import anywhere, fma, get, most, no, put, select
from vibroimpact.kernels.systems.elements import CLOSED, OPEN, STRUCK
from vibroimpact.kernels.systems.flow import move, stands, stop_moves, turns
from vibroimpact.kernels.systems.push import account, drain
from vibroimpact.kernels.systems.reach import SPAN, in_reach
from vibroimpact.kernels.systems.step import fly, miss

# Before a step come a half, far ones and wholes while they are certified, up to so many of each, and a half again.
# Lengths are in steps.
# A whole one is two halves: over a half the series holds.
LEAPS, HALF = 8, 0.5
WHOLE, FAR = 2.0 * HALF, 16.0 * HALF
# A contact's leaps, in steps of its pace: the longer one, with the step after it, ends most, the shorter one weak ones.
WITHIN = 2.0, 1.3


@inner(forceinline=True)
def _carried(rows, first, j, amplitude, rate, y1, p1, k, wide):
    """Return the amplitude and rate of a mode after a leap without load, added to what the load makes of them."""
    at = first + j * k.flow + 2
    for i in range(0 if k.coupled else j, k.modes if k.coupled else j + 1):
        y, p = get(rows, amplitude + i, wide), get(rows, rate + i, wide)
        y1 = fma(get(rows, at, wide), y, fma(get(rows, at + 1, wide), p, y1))
        p1 = fma(get(rows, at + 2, wide), y, fma(get(rows, at + 3, wide), p, p1))
        at += 4
    return y1, p1


@inner(forceinline=True)
def _flown(rows, first, j, k, wide):
    """Return a mode's amplitude and rate after a leap."""
    at = first + j * k.flow
    y1, p1 = get(rows, at, wide), get(rows, at + 1, wide)
    y1, p1 = _carried(rows, first, j, k.eta, k.rate, y1, p1, k, wide)
    for m in range(k.harmonics):
        row, wave = at + k.flow - 4 * (k.harmonics - m), k.pairs + 2 * m
        sine, cosine = get(rows, wave, wide), get(rows, wave + 1, wide)
        y1 = fma(get(rows, row, wide), sine, fma(get(rows, row + 1, wide), cosine, y1))
        p1 = fma(get(rows, row + 2, wide), sine, fma(get(rows, row + 3, wide), cosine, p1))
    return y1, p1


@inner(forceinline=True)
def _lift(rows, at, amplitude, sine, cosine, k, wide):
    """Return a clearance's acceleration by all but damping, w = g'' - alpha (f - L eta)."""
    w, a, b = get(rows, at + k.modes, wide), sine, cosine
    for j in range(k.modes):
        w = fma(get(rows, at + j, wide), get(rows, amplitude + j, wide), w)
    for m in range(k.harmonics):
        row = at + k.modes + 1 + 2 * m
        w = fma(get(rows, row, wide), a, fma(get(rows, row + 1, wide), b, w))
        a, b = fma(a, cosine, b * sine), fma(b, cosine, -a * sine)
    return w


@inner(forceinline=True)
def _apart(rows, z, alpha, lift, amplitude, sine, cosine, k, wide):
    """Return a clearance and its acceleration by all but damping, of all modes or of those in rows `alpha`, `lift`."""
    u, _ = stop_moves(rows, z, sine, cosine, k, wide)
    for j in range(k.modes):
        u = fma(-get(rows, alpha + z * k.modes + j, wide), get(rows, amplitude + j, wide), u)
    return u, _lift(rows, lift + z * (k.modes + 1 + 2 * k.harmonics), amplitude, sine, cosine, k, wide)


@inner(forceinline=True)
def look(rows, k, wide):
    """Leave what leaps need to know of the clearances where they begin."""
    for z in range(k.stops):
        if not anywhere(in_reach(rows, z, k, wide)):
            continue
        s, c = get(rows, k.turn, wide), get(rows, k.turn + 1, wide)
        u, w = _apart(rows, z, k.alpha, k.lift, k.eta, s, c, k, wide)
        put(rows, k.apart + 2 * z, wide, u)
        put(rows, k.apart + 2 * z + 1, wide, w)


@inner(forceinline=True)
def _fly_over(rows, first, k, wide):
    """Leave amplitudes and rates after a leap; return (sin wt, cos wt) before and after it."""
    turns(rows, k, wide)
    for j in range(k.modes):
        y1, p1 = _flown(rows, first, j, k, wide)
        put(rows, k.leapt + j, wide, y1)
        put(rows, k.leapt + k.modes + j, wide, p1)
    s, c, last = get(rows, k.turn, wide), get(rows, k.turn + 1, wide), first + k.modes * k.flow
    return s, c, turned(s, c, get(rows, last, wide), get(rows, last + 1, wide))


@inner(forceinline=True)
def _bend(rows, first, z, w0, w1, k, wide):
    """Return the largest second derivative of a clearance within a leap."""
    at = first + k.modes * k.flow + 2 + z * (1 + 2 * k.modes)
    rest = get(rows, at, wide)
    for j in range(k.modes):
        y, y1 = get(rows, k.eta + j, wide), get(rows, k.leapt + j, wide)
        rest = fma(get(rows, at + 1 + j, wide), most(abs(y), abs(y1)), rest)
        rest = fma(get(rows, at + 1 + k.modes + j, wide), abs(y1 - y), rest)
    return rest + most(w0, w1)


@inner(forceinline=True)
def leap(rows, k, wide, whole, willing):
    """Make a leap, a whole one or half a one, where it is wanted and certified; return where it was."""
    first, length = (k.wholes, WHOLE) if whole else (k.halves, HALF)
    s, _, (s1, c1) = _fly_over(rows, first, k, wide)
    beyond = k.apart + 2 * k.stops
    for z in range(k.stops):
        near = in_reach(rows, z, k, wide)
        if not anywhere(near):
            continue
        u0, w0 = get(rows, k.apart + 2 * z, wide), get(rows, k.apart + 2 * z + 1, wide)
        u1, w1 = _apart(rows, z, k.alpha, k.lift, k.leapt, s1, c1, k, wide)
        put(rows, beyond + 2 * z, wide, u1)
        put(rows, beyond + 2 * z + 1, wide, w1)
        kind = get(rows, k.kind + z, wide)
        struck = kind == STRUCK
        u0 = select(struck, 0.0, u0)
        room = u0 + u1 + 2.0 * math.sqrt(select(u0 > 0.0, u0 * u1, 0.0))
        certain = struck | ((kind == OPEN) & (u0 > 0.0))
        sag = 0.5 * length * length * _bend(rows, first, z, w0, w1, k, wide)
        willing = willing & (no(near) | (certain & (u1 > 0.0) & (room > sag)))
        if k.wary:
            put(rows, k.near + z, wide, select(_above(u0, u1, sag, get(rows, k.missed + z, wide)), 0.0, 1.0))
    if k.wary:
        _search(rows, willing, length + 0.0 * s, k, wide)
    for z in range(k.stops):
        if anywhere(in_reach(rows, z, k, wide)):
            for row in (k.apart + 2 * z, k.apart + 2 * z + 1):
                passed = get(rows, row + 2 * k.stops, wide)
                put(rows, row, wide, select(willing, passed, get(rows, row, wide)))
    _take(rows, willing, s, s1, c1, first, length, k, wide)
    return willing


@deferred("long leaps", 1)
def leap_far(rows, k, wide, willing):
    """Make far leaps where they are wanted, while they are certified, up to so many."""
    number = 0
    while number < LEAPS and anywhere(willing):
        s, c, (s1, c1) = _fly_over(rows, k.fars, k, wide)
        if not k.wary:
            willing = willing & (FAR * (number + 1.0) + SPAN <= get(rows, k.calm, wide))
        for z in range(k.stops):
            near = in_reach(rows, z, k, wide)
            if not anywhere(near):
                continue
            at = k.reach + z * (1 + 2 * k.modes)
            away = get(rows, at, wide)
            for j in range(k.modes):
                away = fma(get(rows, at + 1 + j, wide), abs(get(rows, k.eta + j, wide)), away)
                away = fma(get(rows, at + 1 + k.modes + j, wide), abs(get(rows, k.rate + j, wide)), away)
            if k.wary:  # below zero it says that no near-miss counts; the stop is there all the same
                missed = get(rows, k.missed + z, wide)
                away = away + select(missed > 0.0, missed, 0.0)
            u0, w0 = _apart(rows, z, k.slow, k.drawn, k.eta, s, c, k, wide)
            u1, w1 = _apart(rows, z, k.slow, k.drawn, k.leapt, s1, c1, k, wide)
            sag = 0.5 * FAR * FAR * _bend(rows, k.fars, z, w0, w1, k, wide)
            certain = (get(rows, k.kind + z, wide) == OPEN) & _above(u0, u1, sag, away)
            willing = willing & (no(near) | certain)
        if anywhere(willing):
            _take(rows, willing, s, s1, c1, k.fars, FAR, k, wide)
        number += 1
    look(rows, k, wide)


@inner(forceinline=True)
def _above(u0, u1, sag, closest):
    """Return whether a clearance stays above that much, certified as that it stays above zero is."""
    a, b = u0 - closest, u1 - closest
    return (a > 0.0) & (b > 0.0) & (a + b + 2.0 * math.sqrt(select(a > 0.0, abs(a * b), 0.0)) > sag)


@inner
def _search(rows, willing, end, k, wide):
    """Look for near-misses within a leap, of stops of which it may hold a closer one than is known."""
    flown = False
    for z in range(k.stops):
        wanted = willing & (get(rows, k.near + z, wide) > 0.0)
        if anywhere(wanted):
            if not flown:
                fly(rows, False, k, wide)
            flown = True
            miss(rows, z, end, wanted, False, k, wide)


@inner(forceinline=True)
def _take(rows, certain, s, s1, c1, first, length, k, wide):
    """Leave the state after a leap where it is certain."""
    _put(rows, certain, k.eta, k.rate, k, wide)
    if k.thorough:
        for j in range(k.modes):
            y1, p1 = _carried(rows, first, j, k.deta, k.drate, 0.0 * s, 0.0 * s, k, wide)
            put(rows, k.leapt + j, wide, y1)
            put(rows, k.leapt + k.modes + j, wide, p1)
        _put(rows, certain, k.deta, k.drate, k, wide)
    for z in range(k.stops):
        if anywhere(in_reach(rows, z, k, wide)):
            kind = get(rows, k.kind + z, wide)
            put(rows, k.kind + z, wide, select(certain, OPEN, kind))
    c = get(rows, k.turn + 1, wide)
    put(rows, k.turn, wide, select(certain, s1, s))
    put(rows, k.turn + 1, wide, select(certain, c1, c))
    begun = certain & (s < -BARELY) & (s1 >= -BARELY)
    put(rows, k.turn + 2, wide, get(rows, k.turn + 2, wide) + select(begun, 1.0, 0.0))
    put(rows, k.age, wide, get(rows, k.age, wide) + select(certain, length, 0.0))


@inner(forceinline=True)
def _put(rows, certain, amplitude, rate, k, wide):
    """Leave amplitudes and rates after a leap where it is certain."""
    for j in range(k.modes):
        for row, at in ((amplitude + j, k.leapt + j), (rate + j, k.leapt + k.modes + j)):
            put(rows, row, wide, select(certain, get(rows, at, wide), get(rows, row, wide)))


@inner(forceinline=True)
def may_leap(rows, k, wide):
    """Return the lanes in which leaps may be tried."""
    may = get(rows, k.closed, wide) <= (-1.0 if k.draining or k.swinging else 0.0)
    return may & (get(rows, k.engaged, wide) <= 0.0) if k.compliant else may


@inner
def leap_within(rows, k, wide):
    """Leap from the beginning of a contact of a lone mode, where it is certified."""
    begun = (get(rows, k.age, wide) <= 0.0) & (get(rows, k.engaged, wide) == 1.0) & (get(rows, k.closed, wide) <= 0.0)
    if not anywhere(begun):
        return
    for number in range(2 * k.stops):
        z, length, first = number // 2, WITHIN[number % 2], k.within + number * (k.flow + 3)
        s, c = get(rows, k.turn, wide), get(rows, k.turn + 1, wide)
        last, least = first + k.flow, get(rows, first + k.flow + 2, wide)
        kind, (u, w, _, near) = get(rows, k.kind + z, wide), stands(rows, z, s, c, k, wide)
        certain = begun & (kind >= CLOSED) & (-w > least) & (-w >= get(rows, k.cut, wide))
        certain = certain & (abs(u) <= near)
        if not anywhere(certain):
            continue
        if k.forceful or k.draining or k.wary:
            _account_within(rows, select(certain, 0.5 * length, 0.0 * w), k, wide)
        turns(rows, k, wide)
        y1, p1 = _flown(rows, first, 0, k, wide)
        put(rows, k.leapt, wide, y1)
        put(rows, k.leapt + 1, wide, p1)
        s1, c1 = turned(s, c, get(rows, last, wide), get(rows, last + 1, wide))
        _take(rows, certain, s, s1, c1, first, length * get(rows, k.pace, wide), k, wide)
        put(rows, k.kind + z, wide, select(certain, CLOSED, get(rows, k.kind + z, wide)))
        begun = begun & (get(rows, k.age, wide) <= 0.0)


@deferred("forces of leaps within contacts", 2)
def _account_within(rows, end, k, wide):
    """Count what a leap within a contact does on its way, by two steps that are taken back."""
    y, p = get(rows, k.eta, wide), get(rows, k.rate, wide)
    s, c, periods = get(rows, k.turn, wide), get(rows, k.turn + 1, wide), get(rows, k.turn + 2, wide)
    leaping = end > 0.0
    for _ in range(2):
        turns(rows, k, wide)
        fly(rows, True, k, wide)
        if k.wary:
            for z in range(k.stops):
                miss(rows, z, end, leaping, True, k, wide)
        account(rows, end, k, wide)
        if k.draining:
            drain(rows, end, k, wide)
        move(rows, end, leaping, k, wide)
    put(rows, k.eta, wide, y)
    put(rows, k.rate, wide, p)
    put(rows, k.turn, wide, s)
    put(rows, k.turn + 1, wide, c)
    put(rows, k.turn + 2, wide, periods)
