"""Compliant stops: when they begin to push and let go, and what their forces come to.

Their laws are in `elements`. While one pushes the system is as linear as in flight. One that has let go and is still
pushed in would push again if -e = p u + q u' fell to zero while u < 0. As long as that is above zero nothing can begin,
whatever u does, so that it alone is watched until a step ends with u > 0.

A contact is stiff. A step in it is shorter than one in flight by `pace` = 1/(sqrt(1 + sum k G/W^2) + sum c G/W), a
bound of W over the fastest rate by that of free motion, G = alpha M^-1 alpha^T.
"""

from __future__ import annotations

import math

from numba import types

from vibroimpact.kernels.shared.complementarity import ROUNDING
from vibroimpact.kernels.shared.deferred import deferred
from vibroimpact.kernels.shared.machine import inner
from vibroimpact.kernels.shared.series import (
    DEGREE,
    SIZE,
    coefficients,
    evaluate,
    integral,
    load,
    times,
    valued,
)
from vibroimpact.kernels.shared.trough import trough
from vibroimpact.kernels.shared.vectors import anywhere, get, put, select
from vibroimpact.kernels.systems.elements import (
    BALANCED,
    CLOSED,
    OPEN,
    PASSING,
    RELEASED,
    RESTING,
    STRUCK,
    end_law,
    force_law,
    is_compliant,
    quickens,
)
from vibroimpact.kernels.systems.flow import clearances, stands, turns
from vibroimpact.kernels.systems.layout import NOTHING
from vibroimpact.kernels.systems.rest import derivative, derive, measure, settle, size_of

SURE = 1e-9  # of p times the lengths that u is the sum of: what q u' adds to that is no rounding
EARLY = 0.5  # of a step: so early e keeps the sign of its first derivative that is not zero
# Nodes and weights of Gauss and Legendre on [0, 1]: with eight the square of a rate is integrated to rounding.
NODES = (
    (0.019855071751231884, 0.05061426814518813),
    (0.10166676129318664, 0.11119051722668724),
    (0.2372337950418355, 0.15685332293894364),
    (0.4082826787521751, 0.18134189168918100),
    (0.5917173212478249, 0.18134189168918100),
    (0.7627662049581645, 0.15685332293894364),
    (0.8983332387068134, 0.11119051722668724),
    (0.9801449282487681, 0.05061426814518813),
)


@deferred("forces of stops", 1)
def account(rows, end, k, wide):
    """Add what the stops did over a step that is about to be made: impulse, energy taken, time, and the extremes.

    The times of extremes are counted as that in which the stop pushes.
    """
    pace = get(rows, k.pace, wide)
    for z in range(k.stops):
        pushes = get(rows, k.kind + z, wide) >= CLOSED
        damped = pushes & (force_law(rows, z, k, wide)[1] > 0.0)
        if anywhere(damped):
            _take(rows, z, damped, end, pace, k, wide)
        if anywhere(pushes):
            force, depth = load(rows, k.hold + z * SIZE, wide), times(clearances(rows, z, pace, k, wide), -1.0)
            _add(rows, k.thrust + z, wide, pushes, integral(force, end) / pace)
            since = get(rows, k.pushed + z, wide)
            force = times(force, 1.0 / (pace * pace))
            _raise(rows, k.peak + z, k.peaked + z, wide, pushes, since, pace, *_largest(force, end, pushes))
            _raise(rows, k.depth + z, k.deepest + z, wide, pushes, since, pace, *_largest(depth, end, pushes))
            put(rows, k.pushed + z, wide, since + select(pushes, end * pace, 0.0))


@inner(forceinline=True)
def _take(rows, z, damped, end, pace, k, wide):
    """Add the energy that a stop with a damper takes, k d^2/2 and the integral of c d'^2."""
    stiffness, damping = force_law(rows, z, k, wide)
    u, square = coefficients(clearances(rows, z, pace, k, wide)), 0.0 * end
    u1, _ = valued(u, end)
    for node, weight in NODES:
        _, rate = valued(u, node * end)
        square = square + weight * rate * rate
    work = 0.5 * stiffness * (u1 * u1 - u[0] * u[0])
    _add(rows, k.work + z, wide, damped, work + damping * square * end / pace)


@inner(forceinline=True)
def _largest(series, end, pushes):
    """Return the largest value of a series on the way to `end`, and where it is."""
    a = coefficients(times(series, -1.0))
    last, _ = valued(a, end)
    falls = a[0] < last
    lowest, place = trough(a, end, pushes, select(falls, a[0], last), select(falls, 0.0, end))
    return -lowest, place


@inner
def drain(rows, end, k, wide):
    """Add the energy that dampers take over a step that is about to be made."""
    pace, total = get(rows, k.pace, wide), 0.0 * end
    for node, weight in NODES:
        for j in range(k.modes):
            _, rate = evaluate(load(rows, k.flight + j * SIZE, wide), node * end)
            put(rows, k.pull + j, wide, rate)
        for j in range(k.modes):
            share = weight * get(rows, k.weight + j, wide) * get(rows, k.pull + j, wide)
            for i in range(k.modes):
                total = total + share * get(rows, k.damping + j * k.modes + i, wide) * get(rows, k.pull + i, wide)
    put(rows, k.drained, wide, get(rows, k.drained, wide) + total * end / pace)


@inner(forceinline=True)
def _add(rows, row, wide, where, more):
    put(rows, row, wide, get(rows, row, wide) + select(where, more, 0.0))


@inner(forceinline=True)
def _raise(rows, row, time, wide, where, since, pace, value, place):
    higher = where & (value > get(rows, row, wide))
    put(rows, row, wide, select(higher, value, get(rows, row, wide)))
    put(rows, time, wide, select(higher, since + place * pace, get(rows, time, wide)))


@inner(forceinline=True)
def set_free(rows, k, wide):
    """Watch clearances again of stops that let go and are pushed in no more."""
    sine, cosine = get(rows, k.turn, wide), get(rows, k.turn + 1, wide)
    for z in range(k.stops):
        leaving = get(rows, k.leaving + z, wide)
        if not anywhere(leaving > 0.0):
            continue
        u, _, _, _ = stands(rows, z, sine, cosine, k, wide)
        free = (leaving > 0.0) & (u > 0.0)
        put(rows, k.kind + z, wide, select(free, OPEN, get(rows, k.kind + z, wide)))
        put(rows, k.leaving + z, wide, select(free, 0.0, leaving))
        # What ended the step was then -e falling to zero with u > 0, where nothing begins.
        mistaken = free & (get(rows, k.which, wide) == float(z))
        put(rows, k.hit, wide, select(mistaken, NOTHING, get(rows, k.hit, wide)))
        put(rows, k.engaged, wide, get(rows, k.engaged, wide) - select(free, 1.0, 0.0))


@inner(forceinline=True)
def meet(rows, k, wide, contact):
    """Begin and end the usual contacts with compliant stops; return where they begin, where they end, and the speed.

    Usual is one above the cut while no other stop is closed, touched or pushes. `contact` is where a step ended at one.
    """
    which, engaged = get(rows, k.which, wide), get(rows, k.engaged, wide)
    sine, cosine = get(rows, k.turn, wide), get(rows, k.turn + 1, wide)
    usual = contact & (get(rows, k.closed, wide) <= 0.0)
    begins, ends = usual & (engaged <= 0.0), usual & (engaged == 1.0)
    speed = hard = thick = 0.0 * which
    for z in range(k.stops):
        at_z, elsewhere = which == float(z), (which < float(z)) | (which > float(z))
        u, w, size, least = stands(rows, z, sine, cosine, k, wide)
        kind, soft, (p, q) = get(rows, k.kind + z, wide), is_compliant(rows, z, k, wide), end_law(rows, z, k, wide)
        first = at_z & soft & (kind < CLOSED) & (-w >= get(rows, k.cut, wide))
        first = first & ((q <= 0.0) | (-q * w > SURE * p * size))
        last = at_z & soft & (kind >= CLOSED) & (w > 0.0) & ((q <= 0.0) | (u < -least))
        begins, ends = begins & (first | (elsewhere & (u > least))), ends & (last | (elsewhere & (u > least)))
        speed = select(at_z, -w, speed)
        harder, thicker = quickens(rows, z, k, wide)
        hard, thick = select(at_z, harder, hard), select(at_z, thicker, thick)
    for z in range(k.stops):
        at_z, (_, q) = which == float(z), end_law(rows, z, k, wide)
        pushes = select(q > 0.0, CLOSED, BALANCED)
        kind = select(at_z & begins, pushes, select(at_z & ends, STRUCK, get(rows, k.kind + z, wide)))
        put(rows, k.kind + z, wide, kind)
        leaves = at_z & ends & (q > 0.0)
        put(rows, k.leaving + z, wide, select(leaves, 1.0, get(rows, k.leaving + z, wide)))
        engaged = select(at_z & begins, 1.0, select(at_z & ends & (q <= 0.0), 0.0, engaged))
    put(rows, k.engaged, wide, engaged)
    pace = select(begins, 1.0 / (math.sqrt(1.0 + hard) + thick), select(ends, 1.0, get(rows, k.pace, wide)))
    put(rows, k.pace, wide, pace)
    put(rows, k.age, wide, select(begins | ends, 0.0, get(rows, k.age, wide)))
    return begins, ends, speed


@deferred("compliant stops", 1, types.UniTuple(types.intp, 2))
def attend(rows, k, room, ahead):
    """Decide of every compliant stop, but for those `ahead`, whether it pushes, has let go or is free.

    Return those that were free and push, with their speeds left, and the rigid ones that close by it. Where a damper
    begins or ends to push, accelerations jump, and stops that are closed or left from rest are settled anew.
    """
    changed, members, shut, began = False, int(0.0), int(0.0), int(0.0)
    measure(rows, k, room)
    for z in range(k.stops):
        kind = rows[k.kind + z]
        if is_compliant(rows, z, k, None):
            free = kind < CLOSED and rows[k.leaving + z] == 0.0
            if not ahead >> z & 1:
                changed |= _decide(rows, z, k)
            if free and rows[k.kind + z] >= CLOSED:
                began |= 1 << z
                room.speed[z] = max(-room.rate[z], 0.0)
        elif kind != OPEN and kind != STRUCK:
            members |= 1 << z
            shut |= int(kind >= CLOSED) << z
    closing = int(0.0)
    if changed and members:
        closing = settle(rows, k, room, members) & ~shut
        for z in range(k.stops):
            changed |= is_compliant(rows, z, k, None) and _decide(rows, z, k)
    engaged = hard = thick = 0.0
    for z in range(k.stops):
        if is_compliant(rows, z, k, None) and (rows[k.kind + z] >= CLOSED or rows[k.leaving + z] > 0.0):
            engaged += 1.0
            harder, thicker = quickens(rows, z, k, None)
            hard += harder * (rows[k.kind + z] >= CLOSED)
            thick += thicker * (rows[k.kind + z] >= CLOSED)
    rows[k.engaged], rows[k.pace] = engaged, 1.0 / (math.sqrt(1.0 + hard) + thick)
    return began, closing


@inner
def _decide(rows, z, k):
    """Decide how a compliant stop stands; return whether it pushes and did not, or the other way round.

    The first derivatives that are not rounding decide. They are those without its own force: as long as that is zero
    it does not matter.
    """
    pushed, (p, q) = rows[k.kind + z] >= CLOSED, end_law(rows, z, k, None)
    turns(rows, k, None)
    u, _, _, least = stands(rows, z, rows[k.turn], rows[k.turn + 1], k, None)
    if u > least:
        if pushed or rows[k.leaving + z] > 0.0:
            rows[k.kind + z], rows[k.leaving + z] = OPEN, 0.0
        return pushed
    rows[k.kind + z], rows[k.leaving + z] = OPEN, 0.0
    derive(rows, k, DEGREE)
    touched = u >= -least
    order, value, lasts = first(rows, z, k, 1, 1.0, 0.0) if touched else (0, 0.0, 1.0)
    if touched and value >= 0.0:
        free = STRUCK if order == 1 else RESTING if order == 2 else RELEASED if order == 3 else -lasts
        rows[k.kind + z] = free
        return pushed
    # of -e, which has one zero less than u after a touch, if q > 0
    after = (order - 1 if q > 0.0 else order) if touched else 0
    order, value, lasts = first(rows, z, k, after, p, q)
    if value > 0.0:
        away = STRUCK if order == 1 else RESTING if order == 2 else RELEASED if order == 3 else -lasts
        rows[k.kind + z], rows[k.leaving + z] = OPEN if order == 0 else away, 1.0
        return pushed
    several = PASSING + min(lasts, EARLY)
    rows[k.kind + z] = several if value == 0.0 or order > 1 else BALANCED if order else CLOSED
    return not pushed


@inner
def first(rows, z, k, least, p, q):
    """Return the order from `least` on of the first derivative of p u + q u' that is not rounding, its value, and up to
    where it surely decides the sign.
    """
    order, lead, size, leads, factor, others = 0, 0.0, 0.0, 1.0, 1.0, 0.0
    for o in range(SIZE - 1):
        factor *= max(o, 1)
        if o < least:
            continue
        value = p * derivative(rows, z, o, k) + q * derivative(rows, z, o + 1, k)
        size = max(size, p * size_of(rows, z, o, k) + q * size_of(rows, z, o + 1, k))
        if lead != 0.0:
            others += abs(value) / factor if value * lead < 0.0 else 0.0
        elif abs(value) > ROUNDING * size:
            order, lead, leads = o, value, abs(value) / factor
    return order, lead, leads / max(2.0 * others, leads)
