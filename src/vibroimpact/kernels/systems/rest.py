"""Stops that are touched: which of them rest, are held or left, and by which derivatives that is decided."""

from __future__ import annotations

from numba import types

from vibroimpact.kernels.shared.complementarity import FEW, PIVOTS, ROUNDING, complementary, solve
from vibroimpact.kernels.shared.deferred import deferred
from vibroimpact.kernels.shared.machine import inner
from vibroimpact.kernels.shared.series import DEGREE, SIZE
from vibroimpact.kernels.systems.elements import BALANCED, CLOSED, OPEN, PASSING, RELEASED, RESTING, is_compliant
from vibroimpact.kernels.systems.flow import fly_together, stands, turns
from vibroimpact.kernels.systems.reach import in_reach

SHORTENED = 4  # the highest derivative that most decisions take


@inner
def measure(rows, k, room):
    """Leave the rates of all clearances and G; return the set of rigid stops in contact, closed ones left out."""
    n, s = k.modes, k.stops
    touching, beside = int(0.0), int(0.0)
    for z in range(s):
        room.rate[z] = 0.0
        if not in_reach(rows, z, k, None):
            continue
        u, room.rate[z], _, least = stands(rows, z, rows[k.turn], rows[k.turn + 1], k, None)
        open_rigid = rows[k.kind + z] < CLOSED and not is_compliant(rows, z, k, None)
        if open_rigid and u <= least:
            touching |= 1 << z
        if touching >> z & 1 or rows[k.kind + z] != OPEN or z == int(rows[k.which]):
            beside |= 1 << z
    for z in range(s):
        for y in range(s if beside >> z & 1 else 0):
            if beside >> y & 1:
                total = 0.0
                for j in range(n):
                    total += rows[k.alpha + z * n + j] * rows[k.jump + y * n + j]
                room.gram[z, y] = total
    return touching


@inner
def all_held(rows, k):
    """Return whether closed stops hold all that a stop feels."""
    number = rows[k.closed]
    for j in range(k.modes if k.free else 0):
        number += rows[k.neutral + k.modes + j]
    return number >= k.modes


@deferred("derivatives of motions", 1)
def derive(rows, k, last):
    """Leave derivatives of the modes up to `last`, under what is closed; those of clearances follow."""
    turns(rows, k, None)
    rows[k.pace] = 1.0
    fly_together(rows, k, None, last, True)


@inner(forceinline=True)
def derivative(rows, z, order, k):
    """Return the derivative of a clearance of one lane."""
    b = rows[k.stop + z * SIZE + order]
    for j in range(k.modes):
        b -= rows[k.alpha + z * k.modes + j] * rows[k.flight + j * SIZE + order]
    return b


@inner
def hold(rows, k, room, chosen):
    """Close a set of stops: leave (alpha alpha^T)^-1 over it, and how many they are."""
    s, number = k.stops, 0
    for z in range(s):
        number += chosen >> z & 1
        if not chosen >> z & 1 and rows[k.held + z * (s + 1)] == 0.0:
            continue
        for y in range(s):
            room.free[y] = -1.0 if y == z else 0.0
        if chosen >> z & 1:
            solve(room, chosen, s)
        for y in range(s):
            rows[k.held + y * s + z] = room.solution[y] if chosen >> z & 1 else 0.0
    rows[k.closed] = number


@deferred("contact that is held", 3, types.intp)
def settle(rows, k, room, members):
    """Decide which of the stops at rest close; leave how each is left or held, and the state on the closed ones.

    Return those that close. Where a force or an acceleration vanishes the derivatives that follow decide.
    """
    s, even = k.stops, int(0.0)
    hold(rows, k, room, int(0.0))
    derive(rows, k, SHORTENED)
    for z in range(s):
        if not members >> z & 1:
            continue
        room.free[z] = derivative(rows, z, 2, k)
        even |= (abs(room.free[z]) <= ROUNDING * size_of(rows, z, 2, k)) << z
    if even & members:
        return _settle_even(rows, k, room, members)
    chosen = complementary(room, members, s)
    for z in range(s):  # those that the others hold as well
        if not members & ~chosen & 1 << z:
            continue
        acceleration, size = room.free[z], abs(room.free[z])
        for y in range(s):
            if chosen >> y & 1:
                acceleration += room.gram[z, y] * room.solution[y]
                size += abs(room.gram[z, y] * room.solution[y])
        if acceleration <= ROUNDING * size:
            return _settle_even(rows, k, room, members)
    for z in range(s):
        if members >> z & 1:
            rows[k.kind + z] = CLOSED if chosen >> z & 1 else RESTING
    hold(rows, k, room, chosen)
    _press(rows, k, room, chosen)
    return chosen


@inner
def _settle_even(rows, k, room, members):
    """Settle stops some of which are in balance: by the first derivatives that do not vanish, under every set held.

    A stop that stays in balance is closed by no force.
    """
    s, number = k.stops, 0
    for z in range(s):
        number += members >> z & 1
    best = _tried(rows, k, room, members) if number <= FEW else _pivoted(rows, k, room, members)
    hold(rows, k, room, best)
    derive(rows, k, DEGREE)
    closed = best
    for z in range(s):
        if not members >> z & 1:
            continue
        holds = best >> z & 1
        order, _, lasts = _leading(rows, z, k, holds)
        if order == 0:
            closed |= 1 << z
        if holds:
            rows[k.kind + z] = CLOSED if order == 2 else BALANCED if order == 3 else PASSING + lasts
        elif order:
            rows[k.kind + z] = RESTING if order == 2 else RELEASED if order == 3 else -lasts
        else:
            rows[k.kind + z] = PASSING + 1.0
    _press(rows, k, room, best)
    rank = best
    for z in range(s):
        if closed >> z & 1 and _regular(room, rank | 1 << z, s):
            rank |= 1 << z
    number = 0
    for z in range(s):
        number += rank >> z & 1
    rows[k.closed] = number
    return closed


@inner
def _tried(rows, k, room, members):
    """Return the set of stops, of all of a few, which held closed contradicts least."""
    best, least, held = int(0.0), k.stops + 1, int(0.0)
    while least > 0:
        if _regular(room, held, k.stops):
            wrong = 0
            _hold_alone(rows, k, room, held)
            for z in range(k.stops):
                wrong += _is_wrong(rows, z, k, members, held)
            if wrong < least:
                best, least = held, wrong
        held = (held - members) & members  # the next of their subsets
        if held == 0:
            break
    return best


@inner
def _pivoted(rows, k, room, members):
    """Return such a set of many stops: the first that contradicts it enters or leaves, the rule of K. G. Murty."""
    held, given_up = int(0.0), int(0.0)
    for _ in range(PIVOTS * k.stops):
        _hold_alone(rows, k, room, held)
        first = -1
        for z in range(k.stops):
            if first < 0 and not given_up >> z & 1 and _is_wrong(rows, z, k, members, held):
                first = z
        if first < 0:
            break
        if held >> first & 1 or _regular(room, held | 1 << first, k.stops):
            held ^= 1 << first
        else:  # the others hold it as well
            given_up |= 1 << first
    return held


@inner
def _hold_alone(rows, k, room, held):
    """Hold a set of stops closed, and leave all derivatives under that."""
    hold(rows, k, room, held)
    derive(rows, k, DEGREE)


@inner
def _is_wrong(rows, z, k, members, held):
    """Return whether a stop opens into its body, or is held by a force that pulls."""
    return members >> z & 1 and _leading(rows, z, k, held >> z & 1)[1] < 0.0


@inner
def _regular(room, members, size):
    for z in range(size):
        room.free[z] = 0.0
    return solve(room, members, size)


@inner
def _leading(rows, z, k, holds):
    """Return the order from 2 on of the first derivative of a stop's clearance, or two less of the force that holds
    it, that is not rounding, its value, and up to where it surely decides the sign; 0 if there is none.
    """
    order, first, size, factor, others = 0, 0.0, 0.0, 1.0, 0.0
    for o in range(2, SIZE):
        if holds:
            value, terms = rows[k.hold + z * SIZE + o - 2], 0.0
            for y in range(k.stops):
                terms += abs(rows[k.held + z * k.stops + y]) * size_of(rows, y, o, k)
            factor *= max(o - 2, 1)
        else:
            value, terms = derivative(rows, z, o, k), size_of(rows, z, o, k)
            factor *= o
        size = max(size, terms)
        if order:
            others += abs(value) / factor if value * first < 0.0 else 0.0
        elif abs(value) > ROUNDING * size:
            order, first, leads = o, value, abs(value) / factor
    if order == 0:
        return 0, 0.0, 1.0
    return order, first, leads / max(2.0 * others, leads)


@inner
def size_of(rows, z, o, k):
    """Return the sum of the sizes of what a derivative of a clearance is the sum of."""
    size = abs(rows[k.stop + z * SIZE + o])
    for j in range(k.modes):
        terms = _parts(rows, j, o - 2, k) if o > 1 else abs(rows[k.flight + j * SIZE + o])
        size += abs(rows[k.alpha + z * k.modes + j]) * terms
    return size


@inner(forceinline=True)
def _parts(rows, j, o, k):
    """Return the sum of the sizes of what a derivative of a mode's acceleration is the sum of."""
    total = abs(rows[k.pull + j * SIZE + o])
    total += abs(rows[k.square + j] * rows[k.flight + j * SIZE + o])
    for i in range(k.modes):
        total += abs(rows[k.damping + j * k.modes + i] * rows[k.flight + i * SIZE + o + 1])
    for z in range(k.stops):
        total += abs(rows[k.jump + z * k.modes + j] * rows[k.hold + z * SIZE + o])
    return total


@inner
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
