"""Neighbours of a motion: how a small deviation crosses an impact and ends at a closed stop, how fast it grows.

At an impact the neighbour hits later by dt = -du/w-, du = -alpha deta. With a-, a+ the accelerations just before and
after, and P the impulses of the stops that act (a set A of them, G over it, R their restitutions),

    deta+ = deta- + (p- - p+) dt,
    dp+ = dp- + (a- - a+) dt - jump^T dP,   G dP = -(1 + R) dw,   dw = -alpha (dp- + a- dt) + d'' dt,

d'' the accelerations of the stops, and R = d(r v)/dv where restitution is a law r(v); of one that stays closed dw =
-alpha (dp- + (a- - a+) dt) and R = 0, so that its clearance does not move. It is the saltation of M. A. Aizerman and
F. R. Gantmakher, J. Appl. Math. Mech. 22 (1958) 1065, for several stops. A stop that closes takes from a deviation what
would move its clearance; where all is closed nothing is left, and the exponent is minus infinity. A stop that lets go
takes nothing: the acceleration is continuous.
"""

from __future__ import annotations

import math

from vibroimpact.kernels.machine import inner
from vibroimpact.kernels.systems.complementarity import solve
from vibroimpact.kernels.systems.layout import CLOSED
from vibroimpact.kernels.systems.march import (
    AT,
    BEFORE,
    CHATTERED,
    EACH,
    FROM,
    GREW,
    HITS,
    IMPACTS,
    LATEST,
    NEAREST,
    PERIODS,
    PHASE,
    RESTING,
    SINCE,
    SUMS,
    moment,
)
from vibroimpact.kernels.systems.push import stands
from vibroimpact.kernels.systems.rest import measure

NEAR = 1e-7  # of V, of the modes' rates and their amplitudes: an impact that comes back so near is the same


@inner
def _load(rows, first, start, order, k):
    """Return a sum of harmonics at present, or its second derivative: of a load, or of a stop's motion."""
    a, b = rows[k.turn], rows[k.turn + 1]
    total = start
    for m in range(k.harmonics):
        factor = -(((m + 1.0) * rows[k.theta]) ** 2) if order else 1.0
        total += factor * (rows[first + 2 * m] * a + rows[first + 2 * m + 1] * b)
        a, b = a * rows[k.turn + 1] + b * rows[k.turn], b * rows[k.turn + 1] - a * rows[k.turn]
    return total


@inner
def accelerate(rows, k, found):
    """Leave the accelerations of all modes, under what is closed."""
    n, s = k.modes, k.stops
    for j in range(n):
        load = _load(rows, k.force + 2 * k.harmonics * j, rows[k.load + j], 0, k)
        found[j] = load - rows[k.square + j] * rows[k.eta + j]
        for i in range(n):
            found[j] -= rows[k.damping + j * n + i] * rows[k.rate + i]
    for z in range(s if k.giving else 0):
        if rows[k.kind + z] >= CLOSED and rows[k.spring + z] > 0.0:
            u, w, _ = stands(rows, z, rows[k.turn], rows[k.turn + 1], k, None)
            for j in range(n):
                found[j] += rows[k.jump + z * n + j] * (rows[k.spring + z] * u + rows[k.dashpot + z] * w)
    if rows[k.closed] == 0.0:
        return
    for z in range(s):  # of each clearance, as if nothing were closed
        rows[k.near + z] = _load(rows, k.motion + 2 * k.harmonics * z, 0.0, 2, k)
        for j in range(n):
            rows[k.near + z] -= rows[k.alpha + z * n + j] * found[j]
    for z in range(s):
        for y in range(s):
            force = -rows[k.held + z * s + y] * rows[k.near + y]
            for j in range(n):
                found[j] -= rows[k.jump + z * n + j] * force


@inner
def before(rows, k, room):
    """Keep the rates and accelerations just before an impact."""
    accelerate(rows, k, room.before)
    for j in range(k.modes):
        room.jumped[j] = rows[k.rate + j]


@inner
def cross(rows, k, room, z):
    """Carry the deviation over the impact of stop z that was just made."""
    n, s, active = k.modes, k.stops, int(0.0)
    measure(rows, k, room)
    accelerate(rows, k, room.after)
    du = 0.0
    for j in range(n):
        room.jumped[j] -= rows[k.rate + j]  # p- - p+
        du -= rows[k.alpha + z * n + j] * rows[k.deta + j]
    dt = du / room.speed[z]
    for y in range(s):
        held = rows[k.kind + y] >= CLOSED and room.speed[y] == 0.0
        if held or room.impulse[y] > 0.0:
            active |= 1 << y
        dw = 0.0 if held else _load(rows, k.motion + 2 * k.harmonics * y, 0.0, 2, k) * dt
        for j in range(n):
            change = room.before[j] - room.after[j] if held else room.before[j]
            dw -= rows[k.alpha + y * n + j] * (rows[k.drate + j] + change * dt)
        room.free[y] = dw if held else (1.0 + room.rebound[y]) * dw
    solve(room, active, s)
    for j in range(n):
        rows[k.deta + j] += room.jumped[j] * dt
        rows[k.drate + j] += (room.before[j] - room.after[j]) * dt
        for y in range(s):
            rows[k.drate + j] -= rows[k.jump + y * n + j] * room.found[y]


@inner
def confine(rows, k):
    """Take from the deviation what would move the clearances of closed stops."""
    n, s = k.modes, k.stops
    for row in (k.deta, k.drate):
        for z in range(s):
            moved = 0.0
            for j in range(n):
                moved -= rows[k.alpha + z * n + j] * rows[row + j]
            for y in range(s):
                for j in range(n):
                    rows[row + j] += rows[k.jump + y * n + j] * rows[k.held + y * s + z] * moved
    if rows[k.closed] >= n:
        for j in range(n):
            rows[k.deta + j] = rows[k.drate + j] = 0.0


@inner
def deviate(rows, k):
    """Begin with some deviation."""
    for j in range(k.modes):
        rows[k.deta + j], rows[k.drate + j] = 1.0 / (j + 1.0), 1.0 / (j + 2.0)


@inner
def measure_growth(rows, k, note, counted):
    """Make the deviation of length 1 again, and add the logarithm of what it was, or begin to count here.

    One that a closed stop took wholly is begun anew before it counts; after that the exponent is minus infinity.
    """
    square = 0.0
    for j in range(k.modes):
        square += rows[k.deta + j] ** 2 + rows[k.drate + j] ** 2
    if square == 0.0 and not counted:
        deviate(rows, k)
    for j in range(k.modes if square > 0.0 else 0):
        rows[k.deta + j] /= math.sqrt(square)
        rows[k.drate + j] /= math.sqrt(square)
    grew = 0.5 * math.log(square) if square > 0.0 else -math.inf
    note[GREW] = note[GREW] + grew if counted else 0.0


@inner
def recur(rows, k, note, z, total):
    """Compare an impact of stop z, just recorded, with the one that is known, or make it the known one.

    It has come back if the state is the same within NEAR of V after whole periods: the next impact of a chatter that
    completes is as near, too. Without chatter it must be as much nearer than it ever was before, or a cycle that is
    reached by turns from either side would be named double. Every power of two of impacts the known one is replaced,
    unless a cycle is known and there are fewer left than it has.
    """
    hits, n = note[HITS], k.modes
    enough = note[PERIODS] * hits <= (total - hits) * rows[k.turn + 2]
    if hits >= 2.0 * note[FROM] and hits < total and enough:
        for j in range(n):
            rows[k.known + j], rows[k.known + n + j] = rows[k.eta + j], rows[k.rate + j]
        rows[k.known + 2 * n], rows[k.known + 2 * n + 1] = rows[k.turn], rows[k.turn + 1]
        note[FROM], note[AT] = hits, z
        note[SINCE], note[PHASE] = moment(rows[k.turn], rows[k.turn + 1], rows[k.turn + 2])
        for y in range(k.stops + 1):
            note[SUMS + y * EACH + BEFORE] = note[SUMS + y * EACH + LATEST]
        note[CHATTERED] = note[IMPACTS] = note[PERIODS] = 0.0
        note[NEAREST] = rows[k.speed]
        return
    if z != note[AT] or note[IMPACTS] != 0.0:
        return
    apart = rows[k.speed] * max(
        abs(rows[k.turn] - rows[k.known + 2 * n]), abs(rows[k.turn + 1] - rows[k.known + 2 * n + 1])
    )
    for j in range(n):
        apart = max(apart, abs(rows[k.eta + j] - rows[k.known + j]), abs(rows[k.rate + j] - rows[k.known + n + j]))
    if rows[k.turn + 2] - note[SINCE] <= 0.5:
        return
    if apart <= NEAR * (rows[k.speed] if note[CHATTERED] > 0.0 else note[NEAREST]):
        note[IMPACTS] = -1.0 if note[CHATTERED] > 0.0 else hits - note[FROM]
        note[PERIODS] = round(rows[k.turn + 2] - note[SINCE])
        for y in range(k.stops + 1):
            at = SUMS + y * EACH
            note[at + RESTING] = note[at + LATEST] - note[at + BEFORE]
    note[NEAREST] = min(note[NEAREST], apart)
