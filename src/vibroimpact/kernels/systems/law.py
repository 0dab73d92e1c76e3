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

With a law r(v) the flights of a chatter take 2 v_i/a, v_{i+1} = r(v_i) v_i. Where r falls from 1 as 1 - A v^p the sum
over the speeds is the integral of dv/(1 - r) = v/((1 - p)(1 - r)), so that 1 - r + v r' stands for 1 - r. For p >= 1 it
diverges: the law of Hunt and Crossley, with p = 1 and A = 2 D/3, lets the speed fall as exp(-D a t/3), in ever more
impacts, and ends at no time. Such a chatter is held from the cut on.
"""

from __future__ import annotations

from numba import types

from vibroimpact.kernels.law import COMPLETES, HOLD, SHORT
from vibroimpact.kernels.restitution import restitution
from vibroimpact.kernels.shared.complementarity import ROUNDING, complementary
from vibroimpact.kernels.shared.deferred import deferred
from vibroimpact.kernels.shared.machine import inner
from vibroimpact.kernels.shared.vectors import anywhere, get, no, put, select
from vibroimpact.kernels.systems.elements import CLOSED, OPEN, RELEASED, STRUCK, is_compliant
from vibroimpact.kernels.systems.flow import stands, turns
from vibroimpact.kernels.systems.layout import CONTACT
from vibroimpact.kernels.systems.push import attend
from vibroimpact.kernels.systems.reach import in_reach
from vibroimpact.kernels.systems.rest import SHORTENED, derivative, derive, hold, measure, settle

ENDLESS = 0.1  # of 1 - r: with less of (1 - p)(1 - r) a chatter is taken to end at no time


@deferred("starts of systems", 0.6, types.intp)
def begin(rows, k, room):
    """Settle the stops at which the start is at rest; return the set of those that closed.

    A compliant stop that is touched at a speed of approach is struck at the end of the first step, of length zero.
    """
    turns(rows, k, None)
    touching, members, ahead = measure(rows, k, room), int(0.0), int(0.0)
    for z in range(k.stops):
        least = ROUNDING * _size_of_rate(rows, z, k, room)
        if touching >> z & 1 and abs(room.rate[z]) <= least:
            members |= 1 << z
        if is_compliant(rows, z, k, None) and room.rate[z] < -least:
            u, _, _, near = stands(rows, z, rows[k.turn], rows[k.turn + 1], k, None)
            ahead |= int(abs(u) <= near) << z
    closing = settle(rows, k, room, members) if members else 0
    return closing | attend(rows, k, room, ahead)[1] if k.compliant else closing


@inner
def _size_of_rate(rows, z, k, room):
    """Return the sum of the sizes of what the rate of a clearance is the sum of."""
    size = abs(room.rate[z])
    for j in range(k.modes):
        size += abs(rows[k.alpha + z * k.modes + j] * rows[k.rate + j])
    return size


@inner
def release(rows, k, room):
    """Let go of the stop whose holding force has fallen to zero; return those that close instead.

    Others may be let go at the same instant, and rest at it without a force: what follows decides for all together.
    """
    z, idle = int(rows[k.which]), False
    rows[k.kind + z] = RELEASED
    touching = measure(rows, k, room) & ~(1 << z)
    shut = closed(rows, k)
    members = shut | 1 << z
    for y in range(k.stops):
        idle |= shut >> y & 1 and rows[k.held + y * (k.stops + 1)] == 0.0  # it may have to hold now
        if touching >> y & 1 and abs(room.rate[y]) <= ROUNDING * _size_of_rate(rows, y, k, room):
            members |= 1 << y
    if idle or members != shut | 1 << z:
        return settle(rows, k, room, members) & ~(shut | 1 << z)
    hold(rows, k, room, shut)
    return 0


@inner(forceinline=True)
def closed(rows, k):
    """Return the set of rigid stops that are closed."""
    members = int(0.0)
    for z in range(k.stops):
        if rows[k.kind + z] >= CLOSED and not is_compliant(rows, z, k, None):
            members |= 1 << z
    return members


@inner
def stalled(rows, k, room):
    """Go on from a stop that is touched without approach, held from then on, or left; return those that close."""
    turns(rows, k, None)
    measure(rows, k, room)
    shut = closed(rows, k)
    return settle(rows, k, room, shut | 1 << int(rows[k.which])) & ~shut


@inner(forceinline=True)
def bounce(rows, k, wide):
    """Make the usual impact, of one stop while none is closed; return where it is made, its speed, impulse and r.

    Usual is an impact above the cut with a number r > 0 in which no other stop is touched.
    """
    n, which = k.modes, get(rows, k.which, wide)
    usual = (get(rows, k.hit, wide) == CONTACT) & (get(rows, k.closed, wide) <= 0.0)
    if k.compliant:
        usual = usual & (get(rows, k.engaged, wide) <= 0.0)
    rate = gram = r = 0.0 * which
    for y in range(k.stops):
        if not anywhere(in_reach(rows, y, k, wide)):
            continue
        at_y, inverse = which == float(y), 0.0 * which
        u, w, _, near = stands(rows, y, get(rows, k.turn, wide), get(rows, k.turn + 1, wide), k, wide)
        for j in range(n):
            inverse = inverse + get(rows, k.alpha + y * n + j, wide) * get(rows, k.jump + y * n + j, wide)
        rate, gram = select(at_y, w, rate), select(at_y, inverse, gram)
        r = select(at_y & (get(rows, k.law + y, wide) <= 0.0), get(rows, k.restitution + y, wide), r)
        if k.compliant:
            at_y = at_y & no(is_compliant(rows, y, k, wide))
        usual = usual & (at_y | (u > near))
    usual = usual & (r > 0.0) & (-rate >= get(rows, k.cut, wide))
    impulse = select(usual, -(1.0 + r) * rate / gram, 0.0)
    for y in range(k.stops):
        at_y, kind = usual & (which == float(y)), get(rows, k.kind + y, wide)
        if not anywhere(at_y):
            continue
        push = select(at_y, impulse, 0.0)
        for j in range(n):
            kick = get(rows, k.jump + y * n + j, wide) * push
            put(rows, k.rate + j, wide, get(rows, k.rate + j, wide) - kick)
        put(rows, k.kind + y, wide, select(at_y, STRUCK, kind))
    put(rows, k.age, wide, select(usual, 0.0, get(rows, k.age, wide)))
    return usual, -rate, impulse, r


@inner
def strike(rows, k, room):
    """Make any impact at the end of a step; return the sets of the stops that were struck and that closed by it.

    Leaves their speeds of approach, impulses, and for those that close the durations of their chatter, where all are 0.
    """
    z, s = int(rows[k.which]), k.stops
    turns(rows, k, None)
    touching = measure(rows, k, room) | 1 << z
    shut, struck = closed(rows, k), int(0.0)  # no literal: it would compile twice what takes it
    cut = rows[k.cut]
    weak = cut < 0.0
    for y in range(s):
        if touching >> y & 1 and (room.rate[y] < 0.0 or y == z):
            struck |= 1 << y
            room.speed[y] = max(-room.rate[y], 0.0)
            room.free[y], room.rebound[y] = restitution(rows, y, room.speed[y], k)
            weak |= room.speed[y] < cut or room.free[y] == 0.0
    beside = shut
    for y in range(s):  # touched and at rest to rounding: it takes part
        if touching & ~struck & 1 << y and room.rate[y] <= ROUNDING * room.speed[z]:
            beside |= 1 << y
    for y in range(s):
        if beside & ~struck & 1 << y:
            _, room.rebound[y] = restitution(rows, y, ROUNDING * room.speed[z], k)
    return struck, _collide(rows, k, room, struck, beside, weak) & ~shut


@inner
def _collide(rows, k, room, struck, beside, weak):
    """Make an impact on several stops, with those beside them that are closed or at rest, or a weak one.

    Return the set of stops that are closed after it.
    """
    s, n = k.stops, k.modes
    if weak:
        derive(rows, k, SHORTENED)
    involved = struck | beside
    for y in range(s):
        if struck >> y & 1:
            r = _bounce(rows, y, k, room, room.free[y])
            room.free[y] = -(1.0 + r) * room.speed[y]
        else:
            room.free[y] = 0.0
    # G P here is the change of the rates: a clearance opens where P acts.
    complementary(room, involved, s)
    fastest, rest = 0.0, int(0.0)
    for y in range(s):
        fastest = max(fastest, room.speed[y])
        room.impulse[y] = room.solution[y]
        for j in range(n):
            rows[k.rate + j] -= rows[k.jump + y * n + j] * room.solution[y]
    for y in range(s):
        if involved >> y & 1:
            rate = -room.speed[y]
            for x in range(s):
                rate += room.gram[y, x] * room.impulse[x] if involved >> x & 1 else 0.0
            leaves = rate > max(ROUNDING * fastest, HOLD * rows[k.cut])  # so slow, what presses holds
            rows[k.kind + y] = STRUCK if leaves else OPEN
            rest |= 0 if leaves else 1 << y
    chosen = settle(rows, k, room, rest) if rest else 0
    if not rest:
        hold(rows, k, room, int(0.0))
    return chosen


@inner
def _bounce(rows, z, k, room, r):
    """Return the restitution of an impact: zero where it completes a chatter, whose duration is left."""
    v, cut, elastic = room.speed[z], rows[k.cut], r == 1.0 and room.rebound[z] == 1.0
    if v >= cut or elastic or r == 0.0:
        return r
    push, change = -derivative(rows, z, 2, k), derivative(rows, z, 3, k)
    less = (1.0 - r) + (room.rebound[z] - r)  # (1 - p)(1 - r) where r is 1 - A v^p
    duration = 2.0 * r / less * v if less > ENDLESS * (1.0 - r) else 0.0  # times push
    complete = duration < SHORT * push and duration * max(change, 0.0) < COMPLETES * push * push
    if push > 0.0 and (complete or v < HOLD * cut):
        room.tail[z], room.rebound[z] = min(duration / push, SHORT), 0.0
        return 0.0
    return r
