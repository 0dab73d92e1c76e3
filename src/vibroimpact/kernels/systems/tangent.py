"""Neighbours of a motion: how a small deviation crosses an impact and ends at a closed stop, how fast it grows.

At an impact the neighbour hits later by dt = -du/w-, du = -alpha deta. With a-, a+ the accelerations just before and
after, and P the impulses of the stops that act (a set A of them, G over it, R their restitutions),

    deta+ = deta- + (p- - p+) dt,
    dp+ = dp- + (a- - a+) dt - jump^T dP,   G dP = -(1 + R) dw,   dw = -alpha (dp- + a- dt) + d'' dt,

d'' the accelerations of the stops, and R = d(r v)/dv where restitution is a law r(v); of one that stays closed dw =
-alpha (dp- + (a- - a+) dt) and R = 0, so that its clearance does not move. It is the saltation of M. A. Aizerman and
F. R. Gantmakher, J. Appl. Math. Mech. 22 (1958) 1065, for several stops. A stop that closes takes from a deviation what
would move its clearance; where all is closed nothing is left, and the exponent is minus infinity. A stop that lets go
takes nothing where its force has fallen to zero: the acceleration is continuous. Where that jumps, P = 0 and the
clearance rises, w- > 0.
"""

from __future__ import annotations

import math

from vibroimpact.kernels.cycle import UNRESOLVED
from vibroimpact.kernels.shared.complementarity import solve
from vibroimpact.kernels.shared.machine import inner, whole
from vibroimpact.kernels.shared.vectors import anywhere, fma, get, no, put, select
from vibroimpact.kernels.systems.elements import CLOSED, force_law, is_compliant, parts_abruptly
from vibroimpact.kernels.systems.flow import stands
from vibroimpact.kernels.systems.layout import CONTACT
from vibroimpact.kernels.systems.march import (
    BEFORE,
    CHATTERED,
    EACH,
    GREW,
    GROWN,
    HITS,
    IMPACTS,
    LATEST,
    NEAREST,
    PARTED,
    PERIODS,
    REFERENCE,
    REFERENCE_STOP,
    REFERENCE_TIME,
    RESTING,
    SUMS,
    TURNED,
    UNSURE,
    happen,
    mark,
)
from vibroimpact.kernels.systems.rest import all_held, measure

NEAR = 1e-7  # of V, of the modes' rates and their amplitudes: an impact that comes back so near is the same
ROUNDED_FROM = math.log(UNRESOLVED)  # growth between two rests from which on rounding decides when the second one comes
LOST = 2.0**-27  # of the deviation's length: its square is below rounding


@inner
def _load(rows, first, start, order, k, wide):
    """Return a sum of harmonics at present, or its second derivative: of a load, or of a stop's motion."""
    sine, cosine, rate = get(rows, k.turn, wide), get(rows, k.turn + 1, wide), get(rows, k.theta, wide)
    total, a, b = start, sine, cosine
    for m in range(k.harmonics):
        harmonic = fma(get(rows, first + 2 * m, wide), a, get(rows, first + 2 * m + 1, wide) * b)
        total = total + (-(((m + 1.0) * rate) * ((m + 1.0) * rate)) * harmonic if order else harmonic)
        a, b = fma(a, cosine, b * sine), fma(b, cosine, -a * sine)
    return total


@inner
def accelerate(rows, k, acceleration):
    """Leave the accelerations of all modes, under what is closed."""
    n, s = k.modes, k.stops
    for j in range(n):
        load = _load(rows, k.force + 2 * k.harmonics * j, rows[k.load + j], 0, k, None)
        acceleration[j] = load - rows[k.square + j] * rows[k.eta + j]
        for i in range(n):
            acceleration[j] -= rows[k.damping + j * n + i] * rows[k.rate + i]
    for z in range(s if k.compliant else 0):
        if rows[k.kind + z] >= CLOSED and is_compliant(rows, z, k, None):
            p, q = force_law(rows, z, k, None)
            u, w, _, _ = stands(rows, z, rows[k.turn], rows[k.turn + 1], k, None)
            for j in range(n):
                acceleration[j] += rows[k.jump + z * n + j] * (p * u + q * w)
    if rows[k.closed] == 0.0:
        return
    for z in range(s):  # of each clearance, as if nothing were closed
        rows[k.near + z] = _load(rows, k.motion + 2 * k.harmonics * z, 0.0, 2, k, None)
        for j in range(n):
            rows[k.near + z] -= rows[k.alpha + z * n + j] * acceleration[j]
    for z in range(s):
        for y in range(s):
            force = -rows[k.held + z * s + y] * rows[k.near + y]
            for j in range(n):
                acceleration[j] -= rows[k.jump + z * n + j] * force


@inner
def before(rows, k, room):
    """Keep the rates and accelerations just before an impact."""
    accelerate(rows, k, room.before)
    for j in range(k.modes):
        room.jumped[j] = rows[k.rate + j]


@inner
def cross(rows, k, room, z, v):
    """Carry the deviation over the impact of stop z that was just made, or the end of a contact; v is -w-."""
    n, s, active = k.modes, k.stops, int(0.0)
    measure(rows, k, room)
    accelerate(rows, k, room.after)
    du = 0.0
    for j in range(n):
        room.jumped[j] -= rows[k.rate + j]  # p- - p+
        du -= rows[k.alpha + z * n + j] * rows[k.deta + j]
    dt = du / v
    for y in range(s):
        held = rows[k.kind + y] >= CLOSED and not is_compliant(rows, y, k, None) and room.speed[y] == 0.0
        if held or room.impulse[y] > 0.0:
            active |= 1 << y
        dw = 0.0 if held else _load(rows, k.motion + 2 * k.harmonics * y, 0.0, 2, k, None) * dt
        for j in range(n):
            change = room.before[j] - room.after[j] if held else room.before[j]
            dw -= rows[k.alpha + y * n + j] * (rows[k.drate + j] + change * dt)
        room.free[y] = dw if held else (1.0 + room.rebound[y]) * dw
    solve(room, active, s)
    for j in range(n):
        rows[k.deta + j] += room.jumped[j] * dt
        rows[k.drate + j] += (room.before[j] - room.after[j]) * dt
        for y in range(s):
            rows[k.drate + j] -= rows[k.jump + y * n + j] * room.solution[y]


@inner
def cross_one(rows, k, wide, struck, v, impulse):
    """Carry the deviation over the usual impact, of one stop while none is closed or pushes, where it was made.

    Then a- - a+ = -D (p- - p+), and (1 + R)/G = P/v.
    """
    n, which = k.modes, get(rows, k.which, wide)
    v, impulse = select(struck, v, 1.0), select(struck, impulse, 0.0)
    du = dw = 0.0 * v
    for j in range(n):
        jump = 0.0 * v
        for z in range(k.stops):
            at_z = struck & (which == float(z))
            jump = select(at_z, get(rows, k.jump + z * n + j, wide), jump)
            alpha = get(rows, k.alpha + z * n + j, wide)
            du = select(at_z, fma(-alpha, get(rows, k.deta + j, wide), du), du)
        put(rows, k.leapt + j, wide, jump)
    dt = du / v
    for j in range(n):
        acceleration = fma(-get(rows, k.square + j, wide), get(rows, k.eta + j, wide), get(rows, k.load + j, wide))
        acceleration, changed = _load(rows, k.force + 2 * k.harmonics * j, acceleration, 0, k, wide), 0.0 * v
        for i in range(0 if k.coupled else j, n if k.coupled else j + 1):
            damping, jumped = get(rows, k.damping + j * n + i, wide), impulse * get(rows, k.leapt + i, wide)
            acceleration = fma(-damping, get(rows, k.rate + i, wide) + jumped, acceleration)
            changed = fma(-damping, jumped, changed)
        put(rows, k.leapt + n + j, wide, changed)
        gained = fma(acceleration, dt, get(rows, k.drate + j, wide))
        for z in range(k.stops):
            at_z, alpha = struck & (which == float(z)), get(rows, k.alpha + z * n + j, wide)
            dw = select(at_z, fma(-alpha, gained, dw), dw)
    for z in range(k.stops if k.moving else 0):
        at_z = struck & (which == float(z))
        moved = _load(rows, k.motion + 2 * k.harmonics * z, 0.0 * v, 2, k, wide)
        dw = select(at_z, fma(moved, dt, dw), dw)
    for j in range(n):
        jump = get(rows, k.leapt + j, wide)
        deta, drate = get(rows, k.deta + j, wide), get(rows, k.drate + j, wide)
        put(rows, k.deta + j, wide, fma(impulse * jump, dt, deta))
        drate = fma(get(rows, k.leapt + n + j, wide), dt, drate)
        put(rows, k.drate + j, wide, fma(impulse / v * jump, dw, drate))


@inner
def confine(rows, k):
    """Take from the deviation what would move the clearances of closed stops.

    While they rest nothing damps that: of a motion that attracts, rounding would in time be all that is left.
    """
    n, s = k.modes, k.stops
    for row in (k.deta, k.drate):
        for z in range(s):
            moved = 0.0
            for j in range(n):
                moved -= rows[k.alpha + z * n + j] * rows[row + j]
            for y in range(s):
                for j in range(n):
                    rows[row + j] += rows[k.jump + y * n + j] * rows[k.held + y * s + z] * moved
    if all_held(rows, k):
        for j in range(n):
            rows[k.deta + j] = rows[k.drate + j] = 0.0


@inner(inline="always")
def pass_over(rows, k, room, struck, closing):
    """Carry the deviation over what was just made; `before` comes before that."""
    z = int(rows[k.which])
    if struck and room.speed[z] > 0.0:
        cross(rows, k, room, z, room.speed[z])
    elif k.compliant and not struck and rows[k.hit] == CONTACT and parts_abruptly(rows, z, k) and room.rate[z] > 0.0:
        cross(rows, k, room, z, -room.rate[z])
    if closing or rows[k.closed] > 0.0:
        confine(rows, k)


@inner(inline="always")
def happen_beside(rows, k, room):
    """Make what ended a step, and carry the deviation over it; return the set of stops struck."""
    before(rows, k, room)
    struck, closing = happen(rows, k, room)
    pass_over(rows, k, room, struck, closing)
    return struck


@inner
def deviate(rows, k):
    """Begin with some deviation."""
    for j in range(k.modes):
        rows[k.deta + j], rows[k.drate + j] = 1.0 / (j + 1.0), 1.0 / (j + 2.0)


@inner
def has_lost_all(rows, k):
    """Return whether a rest that is over has taken all of the deviation."""
    size = 0.0
    for j in range(2 * k.modes):
        size += abs(rows[k.deta + j])
    return size == 0.0 and not all_held(rows, k)


@inner
def leave_centre(rows, k, wide):
    """Take from the deviation the place and the drift of a free centre: nothing depends on them."""
    for j in range(2 * k.modes if k.free else 0):  # amplitudes, then rates
        value = get(rows, k.deta + j, wide)
        put(rows, k.deta + j, wide, select(get(rows, k.neutral + j, wide) > 0.0, 0.0, value))


@inner
def measure_growth(rows, notes, k, wide, hit, counted):
    """Make the deviation of length 1 again, and add the logarithm of what it was, or begin to count.

    What a closed stop took of it is begun anew before it counts; after that only one that is taken wholly is: its
    exponent is minus infinity, and how far neighbours part up to the next rest says whether rounding decides that.
    """
    leave_centre(rows, k, wide)
    square = 0.0 * get(rows, k.deta, wide)
    for j in range(2 * k.modes):
        square = fma(get(rows, k.deta + j, wide), get(rows, k.deta + j, wide), square)
    remains, grown = square > 0.0, get(notes, GREW, wide)
    length = math.sqrt(select(hit & remains, square, 1.0))
    for j in range(2 * k.modes):
        put(rows, k.deta + j, wide, get(rows, k.deta + j, wide) / length)
    if anywhere(hit & (no(counted) | no(remains))):
        _begin_anew(rows, k, wide, hit & (no(counted) | no(remains)), remains)
    grew = select(remains, math.log(length), -math.inf)
    put(notes, GREW, wide, select(hit, select(counted, grown + grew, 0.0), grown))
    parted, rests = get(notes, PARTED, wide), hit & no(remains)
    unsure, sum_ = rests & (parted > ROUNDED_FROM), parted + grew
    put(notes, UNSURE, wide, select(unsure, get(notes, HITS, wide), get(notes, UNSURE, wide)))
    put(notes, PARTED, wide, select(hit, select(sum_ > 0.0, sum_, 0.0), parted))


@inner
def _begin_anew(rows, k, wide, where, remains):
    """Give the modes of which nothing is left some deviation again: where others are left, so little of it that it
    changes no length.
    """
    for j in range(k.modes):
        deta, drate = get(rows, k.deta + j, wide), get(rows, k.drate + j, wide)
        anew, size = where & (abs(deta) < LOST) & (abs(drate) < LOST), select(remains, LOST, 1.0)
        put(rows, k.deta + j, wide, select(anew, size / (j + 1.0), deta))
        put(rows, k.drate + j, wide, select(anew, size / (j + 2.0), drate))


@inner
def recur(rows, notes, k, wide, recorded, total):
    """Compare a recorded impact with the reference impact, or make it that.

    It has come back if the state is the same within NEAR of V after whole periods, wherever a free centre is: the next
    impact of a chatter that completes is as near, too. Without chatter it must be as much nearer than it ever was
    before, or a cycle that is reached by turns from either side would be named double. Every power of two of impacts
    the reference is replaced, unless a cycle is known and there are fewer left than it has.
    """
    hits, z, periods = get(notes, HITS, wide), get(rows, k.which, wide), get(rows, k.turn + 2, wide)
    enough = get(notes, PERIODS, wide) * hits <= (total - hits) * periods
    moves = recorded & (hits >= 2.0 * get(notes, REFERENCE, wide)) & (hits < total) & enough
    if anywhere(moves):
        _set_reference(rows, notes, k, wide, moves, hits, z)
    compared = recorded & (get(notes, IMPACTS, wide) == 0.0) & (hits > get(notes, REFERENCE, wide))
    for y in range(k.stops):
        at = SUMS + y * EACH + TURNED
        put(notes, at, wide, get(notes, at, wide) + select(compared & (z == float(y)), 1.0, 0.0))
    periods = periods - get(notes, REFERENCE_TIME + 2, wide)
    may_return = compared & (z == get(notes, REFERENCE_STOP, wide)) & (periods > 0.5)
    if not anywhere(may_return):
        return
    speed, nearest = get(rows, k.speed, wide), get(notes, NEAREST, wide)
    apart = 0.0 * speed
    for j in range(2 * k.modes + 2):
        at = k.eta + j if j < 2 * k.modes else k.turn + j - 2 * k.modes
        off = abs(get(rows, at, wide) - get(rows, k.reference + j, wide))
        off = speed * off if j >= 2 * k.modes else off
        if k.free and j < 2 * k.modes:
            off = select(get(rows, k.neutral + j, wide) > 0.0, 0.0, off)
        apart = select(off > apart, off, apart)
    chatters = get(notes, CHATTERED, wide) > 0.0
    back = may_return & (apart <= NEAR * select(chatters, speed, nearest))
    if anywhere(back):
        impacts = select(chatters, -1.0, hits - get(notes, REFERENCE, wide))
        put(notes, IMPACTS, wide, select(back, impacts, get(notes, IMPACTS, wide)))
        put(notes, PERIODS, wide, select(back, whole(periods), get(notes, PERIODS, wide)))
        for y in range(k.stops + 1):
            at = SUMS + y * EACH
            rested = get(notes, at + LATEST, wide) - get(notes, at + BEFORE, wide)
            put(notes, at + RESTING, wide, select(back, rested, get(notes, at + RESTING, wide)))
    put(notes, NEAREST, wide, select(may_return & (apart < nearest), apart, nearest))


@inner
def _set_reference(rows, notes, k, wide, where, hits, z):
    """Make an impact the reference impact."""
    for j in range(2 * k.modes + 2):
        at = k.eta + j if j < 2 * k.modes else k.turn + j - 2 * k.modes
        put(rows, k.reference + j, wide, select(where, get(rows, at, wide), get(rows, k.reference + j, wide)))
    mark(
        notes,
        REFERENCE_TIME,
        wide,
        where,
        get(rows, k.turn, wide),
        get(rows, k.turn + 1, wide),
        get(rows, k.turn + 2, wide),
    )
    for y in range(k.stops + 1):
        at = SUMS + y * EACH
        put(notes, at + BEFORE, wide, select(where, get(notes, at + LATEST, wide), get(notes, at + BEFORE, wide)))
        put(notes, at + TURNED, wide, select(where, 0.0, get(notes, at + TURNED, wide)))
    for at, value in (
        (REFERENCE, hits),
        (REFERENCE_STOP, z),
        (NEAREST, get(rows, k.speed, wide)),
        (GROWN, get(notes, GREW, wide)),
    ):
        put(notes, at, wide, select(where, value, get(notes, at, wide)))
    for at in (CHATTERED, IMPACTS, PERIODS):
        put(notes, at, wide, select(where, 0.0, get(notes, at, wide)))
