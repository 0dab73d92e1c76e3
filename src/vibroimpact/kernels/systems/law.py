"""What happens at the stops: impacts, chatter that completes, contact that is held, and release.

An impact involves the stops that are struck and those that are closed. With w the rates of their clearances and G =
alpha alpha^T, J. J. Moreau's law asks for impulses P with

    0 <= P,   w+ + R w- >= 0,   P . (w+ + R w-) = 0,   w+ = w- + G P,

so that a struck stop is left with r times the speed of approach, one that is closed stays so unless the impact opens
it, and energy cannot grow: its change, sum (1 - r) w- P/2, has w- <= 0 <= P. In the same way contact is held: of the
stops at rest those are closed for which 0 <= lambda, u'' >= 0, lambda u'' = 0, u'' = u''_free + G lambda.

A weak impact (below the cut) completes its chatter after t1 = 2 r v/((1 - r) a), a = -u'' with all that is closed, if
u'' stays below zero that long. All its impulses act along alpha, so that meanwhile the other coordinates move as if the
stop were closed, but for u(t) itself, which ends where it began: it is closed at once where t1 is short.
"""

from __future__ import annotations

import math

from numba import njit

from vibroimpact.kernels.law import COMPLETES, HOLD, SHORT
from vibroimpact.kernels.systems.complementarity import ROUNDING, complementary, solve
from vibroimpact.kernels.systems.series import SIZE
from vibroimpact.kernels.systems.step import (
    BALANCED,
    CLOSED,
    OPEN,
    RELEASED,
    RESTING,
    STRUCK,
    fly_together,
    turns,
)
from vibroimpact.kernels.vectors import stride

SHORTENED = 4  # the highest derivative that decides anything here
TOUCH = 1e-12  # of the lengths that a clearance is the sum of: less is contact


@njit(error_model="numpy")
def measure(rows, k, room):
    """Leave the rates of all clearances and G; return the set of stops in contact, closed ones left out."""
    n, s = k.modes, k.stops
    touching = int(0.0)
    for z in range(s):
        u, w = _stop_moves(rows, z, k, 0, None)
        size = abs(rows[k.gap + z])
        for j in range(n):
            alpha = rows[k.alpha + z * n + j]
            u -= alpha * rows[k.eta + j]
            size += abs(alpha * rows[k.eta + j])
            w -= alpha * rows[k.rate + j]
        room.rate[z] = w
        if rows[k.kind + z] < CLOSED and u <= TOUCH * size:
            touching |= 1 << z
        for y in range(s):
            total = 0.0
            for j in range(n):
                total += rows[k.alpha + z * n + j] * rows[k.jump + y * n + j]
            room.gram[z, y] = total
    return touching


@njit(error_model="numpy")
def _derive(rows, k):
    """Leave derivatives of the modes up to the fourth, under what is closed; those of clearances follow."""
    turns(rows, k, 0, None)
    fly_together(rows, k, 0, None, SHORTENED)


@njit(error_model="numpy", forceinline=True)
def _order(rows, z, order, k):
    """Return the derivative of a clearance of one lane."""
    b = rows[k.stop + z * SIZE + order]
    for j in range(k.modes):
        b -= rows[k.alpha + z * k.modes + j] * rows[k.flight + j * SIZE + order]
    return b


@njit(error_model="numpy")
def _hold(rows, k, room, chosen):
    """Close a set of stops: leave (alpha alpha^T)^-1 over it, and how many they are."""
    s, number = k.stops, 0
    for z in range(s):
        number += chosen >> z & 1
        for y in range(s):
            room.free[y] = -1.0 if y == z else 0.0
        if chosen >> z & 1:
            solve(room, chosen, s)
        for y in range(s):
            rows[k.held + y * s + z] = room.found[y] if chosen >> z & 1 else 0.0
    rows[k.closed] = number


@njit(error_model="numpy")
def _settle(rows, k, room, members):
    """Decide which of the stops at rest close; leave how each is left or held, and the state on the closed ones."""
    n, s = k.modes, k.stops
    _hold(rows, k, room, int(0.0))
    _derive(rows, k)
    for z in range(s):
        size = 0.0
        for j in range(n):
            size += abs(rows[k.alpha + z * n + j]) * _parts(rows, j, k)
        size += abs(rows[k.stop + z * SIZE + 2])
        second, third = _order(rows, z, 2, k), _order(rows, z, 3, k)
        fourth = _order(rows, z, 4, k)
        if abs(second) <= ROUNDING * size:  # in balance: what comes next decides
            next_one = third if abs(third) > ROUNDING * size else fourth
            second = math.copysign(ROUNDING * (size + abs(next_one)), next_one) if next_one else 0.0
            room.rest[z] = RELEASED
        else:
            room.rest[z] = RESTING
        room.free[z] = second
    chosen = complementary(room, members, s)
    for z in range(s):
        if members >> z & 1:
            rows[k.kind + z] = CLOSED if chosen >> z & 1 else room.rest[z]
    balanced = int(0.0)
    for z in range(s):
        if chosen >> z & 1 and room.rest[z] == RELEASED:
            balanced |= 1 << z
    _hold(rows, k, room, chosen)
    for z in range(s):
        if balanced >> z & 1:
            rows[k.kind + z] = BALANCED
    _press(rows, k, room, chosen)
    return chosen


@njit(error_model="numpy", forceinline=True)
def _parts(rows, j, k):
    """Return the sum of the sizes of what a mode's acceleration is the sum of."""
    total = abs(rows[k.pull + j * SIZE])
    total += abs(rows[k.square + j] * rows[k.eta + j])
    for i in range(k.modes):
        total += abs(rows[k.damping + j * k.modes + i] * rows[k.rate + i])
    return total


@njit(error_model="numpy")
def _press(rows, k, room, chosen):
    """Take what rounding left of closed clearances and of their rates out of the state."""
    n, s = k.modes, k.stops
    measure(rows, k, room)
    for z in range(s):
        if not chosen >> z & 1:
            continue
        u = rows[k.stop + z * SIZE]
        for j in range(n):
            u -= rows[k.alpha + z * n + j] * rows[k.eta + j]
        for y in range(s):
            held = rows[k.held + y * s + z]
            for j in range(n):
                jump = rows[k.jump + y * n + j]
                rows[k.eta + j] += jump * held * u
                rows[k.rate + j] += jump * held * room.rate[z]


@njit(error_model="numpy")
def begin(rows, k, room):
    """Settle the stops at which the start is at rest; return the set of those that closed."""
    turns(rows, k, 0, None)
    touching, members = measure(rows, k, room), int(0.0)
    for z in range(k.stops):
        size = abs(room.rate[z])
        for j in range(k.modes):
            size += abs(rows[k.alpha + z * k.modes + j] * rows[k.rate + j])
        if touching >> z & 1 and abs(room.rate[z]) <= ROUNDING * size:
            members |= 1 << z
    return _settle(rows, k, room, members) if members else 0


@njit(error_model="numpy")
def release(rows, k, room):
    """Let go of the stop whose holding force has fallen to zero."""
    z = int(rows[k.which])
    rows[k.kind + z] = RELEASED
    measure(rows, k, room)
    _hold(rows, k, room, _closed(rows, k))


@njit(error_model="numpy", forceinline=True)
def _closed(rows, k):
    found = int(0.0)
    for z in range(k.stops):
        if rows[k.kind + z] >= CLOSED:
            found |= 1 << z
    return found


@njit(error_model="numpy")
def stalled(rows, k, room):
    """Go on from a stop that is touched without approach: held from here on, or left."""
    z = int(rows[k.which])
    turns(rows, k, 0, None)
    measure(rows, k, room)
    if rows[k.kind + z] >= CLOSED:
        rows[k.kind + z] = BALANCED
        return 0
    return _settle(rows, k, room, _closed(rows, k) | 1 << z)


@njit(error_model="numpy", forceinline=True)
def bounce(rows, k, lane, wide):
    """Make the usual impact, of one stop while none is closed; return its speed and impulse, 0 if it is not usual.

    Usual is an impact above the cut with r > 0 in which no other stop is touched.
    """
    n, z, r = k.modes, int(rows[k.which * stride(wide) + lane]), 0.0
    if rows[k.closed * stride(wide) + lane] > 0.0:
        return 0.0, 0.0
    rate, gram = 0.0, 0.0
    for y in range(k.stops):
        u, p, size = rows[(k.gap + y) * stride(wide) + lane], 0.0, 0.0
        if k.moving:
            u, p = _stop_moves(rows, y, k, lane, wide)
        for j in range(n):
            alpha = rows[(k.alpha + y * n + j) * stride(wide) + lane]
            own = alpha * rows[(k.eta + j) * stride(wide) + lane]
            u, size = u - own, size + abs(own)
            p -= alpha * rows[(k.rate + j) * stride(wide) + lane]
            if y == z:
                gram += alpha * rows[(k.jump + y * n + j) * stride(wide) + lane]
        if y == z:
            rate, r = p, rows[(k.restitution + y) * stride(wide) + lane]
        elif u <= TOUCH * (size + abs(rows[(k.gap + y) * stride(wide) + lane])):
            return 0.0, 0.0
    if r == 0.0 or -rate < rows[k.cut * stride(wide) + lane]:
        return 0.0, 0.0
    impulse = -(1.0 + r) * rate / gram
    for j in range(n):
        rows[(k.rate + j) * stride(wide) + lane] -= rows[(k.jump + z * n + j) * stride(wide) + lane] * impulse
    rows[(k.kind + z) * stride(wide) + lane] = STRUCK
    rows[k.age * stride(wide) + lane] = 0.0
    return -rate, impulse


@njit(error_model="numpy", forceinline=True)
def _stop_moves(rows, z, k, lane, wide):
    """Return where a stop is, as a clearance, and how fast it moves."""
    u, w = rows[(k.gap + z) * stride(wide) + lane], 0.0
    sine, cosine = rows[k.turn * stride(wide) + lane], rows[(k.turn + 1) * stride(wide) + lane]
    a, b = sine, cosine
    for m in range(k.harmonics):
        first = k.motion + 2 * (k.harmonics * z + m)
        re, im = rows[first * stride(wide) + lane], rows[(first + 1) * stride(wide) + lane]
        u += re * a + im * b
        w += (m + 1.0) * rows[k.theta * stride(wide) + lane] * (re * b - im * a)
        a, b = a * cosine + b * sine, b * cosine - a * sine
    return u, w


@njit(error_model="numpy")
def strike(rows, k, room):
    """Make any impact at the end of a step; return the sets of the stops that were struck and that closed by it.

    Leaves their speeds of approach, impulses, and for those that close the durations of their chatter.
    """
    z, s = int(rows[k.which]), k.stops
    turns(rows, k, 0, None)
    touching = measure(rows, k, room) | 1 << z
    closed, struck = _closed(rows, k), int(0.0)  # no literal: it would compile twice what takes it
    cut = rows[k.cut]
    weak = cut < 0.0
    for y in range(s):
        room.speed[y], room.impulse[y], room.tail[y] = 0.0, 0.0, 0.0
        if touching >> y & 1 and (room.rate[y] < 0.0 or y == z):
            struck |= 1 << y
            room.speed[y] = max(-room.rate[y], 0.0)
            weak |= room.speed[y] < cut or rows[k.restitution + y] == 0.0
    return struck, _collide(rows, k, room, struck, closed, weak)


@njit(error_model="numpy")
def _collide(rows, k, room, struck, closed, weak):
    """Make an impact on several stops, or a weak one; return the set of stops that closed by it."""
    s, n = k.stops, k.modes
    if weak:
        _derive(rows, k)
    involved = struck | closed
    for y in range(s):
        if struck >> y & 1:
            r = _bounce(rows, y, k, room)
            room.free[y] = -(1.0 + r) * room.speed[y]
        else:
            room.free[y] = 0.0
    # G P here is the change of the rates: a clearance opens where P acts.
    complementary(room, involved, s)
    fastest, rest = 0.0, int(0.0)
    for y in range(s):
        fastest = max(fastest, room.speed[y])
        room.impulse[y] = room.found[y]
        for j in range(n):
            rows[k.rate + j] -= rows[k.jump + y * n + j] * room.found[y]
    for y in range(s):
        if involved >> y & 1:
            rate = -room.speed[y]
            for x in range(s):
                rate += room.gram[y, x] * room.impulse[x]
            leaves = rate > max(ROUNDING * fastest, HOLD * rows[k.cut])  # so slow, what presses holds
            rows[k.kind + y] = STRUCK if leaves else OPEN
            rest |= 0 if leaves else 1 << y
    chosen = _settle(rows, k, room, rest) if rest else 0
    if not rest:
        _hold(rows, k, room, int(0.0))
    return chosen & ~closed


@njit(error_model="numpy")
def _bounce(rows, z, k, room):
    """Return the restitution of an impact: zero where it completes a chatter, whose duration is left."""
    r, v, cut = rows[k.restitution + z], room.speed[z], rows[k.cut]
    if v >= cut or r == 1.0 or r == 0.0:
        return r
    push, change = -_order(rows, z, 2, k), _order(rows, z, 3, k)
    duration = 2.0 * r / (1.0 - r) * v  # times push
    complete = duration < SHORT * push and duration * max(change, 0.0) < COMPLETES * push * push
    if push > 0.0 and (complete or v < HOLD * cut):
        room.tail[z] = min(duration / push, SHORT)
        return 0.0
    return r
