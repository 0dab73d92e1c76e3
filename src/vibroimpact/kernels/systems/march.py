"""What lanes and the walk share: what ends a step, the sums of impacts, and what ends a cell."""

from __future__ import annotations

import math
from typing import NamedTuple

from numba import types

from vibroimpact.kernels.cell import FILLED, LAWLESS, PINNED, QUIET, QUIET_FOR, RUNNING, SPENT
from vibroimpact.kernels.leaps import TURN
from vibroimpact.kernels.shared.deferred import deferred
from vibroimpact.kernels.shared.machine import inner
from vibroimpact.kernels.shared.vectors import anywhere, fma, get, put, select
from vibroimpact.kernels.systems.elements import CLOSED, is_compliant
from vibroimpact.kernels.systems.lasting import lasting
from vibroimpact.kernels.systems.law import release, stalled, strike
from vibroimpact.kernels.systems.layout import CONTACT
from vibroimpact.kernels.systems.push import attend
from vibroimpact.kernels.systems.rest import all_held, measure

# Numbers of a cell's note: the length of its step, what it is granted, and what it has come to; sin wt, cos wt,
# whole periods of the first and of the last impact of the window, and the stop of the first.
H, FLIGHT, GRANTED, STEPS, HITS, STICKS, GREW = range(7)
BEGAN, ENDED, STOP = 7, 10, 13
# of a cycle: number, time and stop of the reference impact, how near it came back at best, and impacts and periods
# until it returned
REFERENCE, REFERENCE_TIME, REFERENCE_STOP, CHATTERED, NEAREST, IMPACTS, PERIODS = 14, 15, 18, 19, 20, 21, 22
# of an impact that is watched for: speed, stop and number, when the next one takes its place, and after how many it
# came back; impacts that were added without having been made, and steps made beside to be sure of them; ln of the
# growth up to the reference impact; of a cycle that is certain, ln of the spectral radius and impacts, per period; ln
# of the growth since a rest took all of the deviation, and the number of the last impact with a rest that rounding
# decided
WATCHED, WHICH, NUMBER, NEXT, RETURNED, ADDED, BESIDE, GROWN, DECAY, RATE, PARTED, UNSURE = range(23, 35)
# The energy that dampers took within the window, and the age at which it is checked again whether a phase lasts; the
# period in which it is checked again whether a pressed motion repeats, in how many, and after which impact. Then of its
# impacts on each stop: how many, the first speed, sums of what the others differ by and of squares of that, the
# largest speed, sums of cos wt and sin wt, and the energy lost after the window's first impact, the impulse and the
# largest force.
# Of its rests, in periods (and of those at any stop, in a block of their own): how long up to now, less the time now
# while it is closed; up to the last impact, and up to the reference; in a cycle. Its closest miss, and how many
# impacts it had since the reference until that returned.
DRAINED, DUE, AGAIN, WAITS, STILL, SUMS, EACH = 35, 36, 37, 38, 39, 40, 16
COUNT, FIRST, SUM, SQUARES, LARGEST, COSINE, SINE, ENERGY, THRUST, PEAK = range(10)
RESTED, LATEST, BEFORE, RESTING, MISS, TURNED = range(10, EACH)


class Window(NamedTuple):
    """Recorded impacts left out, those left out or kept, and whether cells end once all that remain are known."""

    transient: float
    total: float
    closes: bool = False


@inner(forceinline=True)
def moment(sine, cosine, periods):
    """Return whole driving periods and phase."""
    phase = math.atan2(sine, cosine) / TURN
    if phase < 0.0:
        phase = phase + 1.0 if phase + 1.0 < 1.0 else 0.0
    return periods, phase


@inner
def _never_again(rows, k, room):
    """Return whether no stop can be reached any more.

    What free motion is left over the steady one has an energy E that cannot grow; so it takes at most sqrt(2 E `give`)
    of a clearance, give = alpha L^-1 M^-1 alpha, and the steady motion leaves `margin`. A mode without stiffness drifts
    beside it, and must not drift to the stop. Those that damping couples to others, or that it brakes under a load,
    keep eta_B' + D_B eta, which takes `sliding` times that; see `modal.steady_motion`.
    """
    energy = 0.0
    for z in range(k.stops):
        room.free[z] = rows[k.margin + z]
    for j in range(k.modes):
        y, p = rows[k.steady + j], 0.0
        a, b = rows[k.turn], rows[k.turn + 1]
        for m in range(k.harmonics):
            first = k.steady + k.modes + 2 * (k.harmonics * j + m)
            y += rows[first] * a + rows[first + 1] * b
            p += (m + 1.0) * rows[k.theta] * (rows[first] * b - rows[first + 1] * a)
            a, b = a * rows[k.turn + 1] + b * rows[k.turn], b * rows[k.turn + 1] - a * rows[k.turn]
        y, p = rows[k.eta + j] - y, rows[k.rate + j] - p - rows[k.slide + j]
        slides = rows[k.slide + j] != 0.0
        for z in range(k.stops):
            room.free[z] -= rows[k.sliding + z * k.modes + j] * p
            for i in range(k.modes):
                room.free[z] -= rows[k.sliding + z * k.modes + i] * rows[k.damping + i * k.modes + j] * y
        for i in range(k.modes if k.coupled else 0):
            slides |= i != j and (rows[k.damping + i * k.modes + j] != 0.0 or rows[k.damping + j * k.modes + i] != 0.0)
        if rows[k.square + j] > 0.0 or slides:
            energy += rows[k.weight + j] * (p * p + rows[k.square + j] * y * y)
            continue
        for z in range(k.stops):
            alpha = rows[k.alpha + z * k.modes + j]
            damping = rows[k.damping + j * (k.modes + 1)]
            room.free[z] -= _farthest(alpha * y, alpha * p, alpha * rows[k.load + j], damping)
    clear = True
    for z in range(k.stops):
        clear &= room.free[z] > math.sqrt(energy * rows[k.give + z])
    return clear


@inner(forceinline=True)
def _farthest(y, p, load, damping):
    """Return a bound of y(t) at any later time, y'' = load - damping y'."""
    if p <= 0.0 >= load:
        return y
    if load > 0.0:
        return math.inf
    slowed = p / damping if damping > 0.0 else math.inf
    return y + min(slowed, -0.5 * p * p / load if load < 0.0 else math.inf)


@deferred("ends of motions", 0.6, types.intp)
def ending(rows, k, room, note, total):
    """Return the reason why a cell ends here, or RUNNING."""
    if rows[k.lawless] > 0.0:
        return LAWLESS
    if note[HITS] >= total:
        return FILLED
    closed = rows[k.closed]
    if all_held(rows, k) and rows[k.age] * rows[k.theta] > TURN:
        return PINNED  # nothing is free to move, and the force has gone through a whole period
    if closed == 0.0 and rows[k.engaged] == 0.0 and _never_again(rows, k, room):
        return QUIET
    spent = rows[k.age] > note[FLIGHT] or rows[k.steps] > note[GRANTED]
    end = lasting(rows, k, room) if spent or lasting_is_due(rows, k, note) else RUNNING
    return SPENT if spent and end == RUNNING else end


@inner
def lasting_is_due(rows, k, note):
    """Return whether to check if a phase lasts: a period after an impact, and whenever twice as much has passed."""
    age = rows[k.age]
    if age < max(QUIET_FOR, TURN / rows[k.theta]):
        return False
    if 2.0 * age < note[DUE]:
        note[DUE] = 0.0  # that was before the impact
    if age < note[DUE]:
        return False
    note[DUE] = 2.0 * age
    return True


@deferred("impacts on several stops", 4, types.UniTuple(types.intp, 2))
def happen(rows, k, room):
    """Make what ended a step, but for the usual impact; return the sets of stops struck, and closed by it."""
    z, struck, closing = int(rows[k.which]), int(0.0), int(0.0)
    for y in range(k.stops):
        room.speed[y], room.impulse[y], room.tail[y], room.rebound[y] = 0.0, 0.0, 0.0, 0.0
    if is_compliant(rows, z, k, None):
        touching = measure(rows, k, room)
        for y in range(k.stops):  # a rigid one at the same place comes first, whatever their order
            if rows[k.hit] == CONTACT and not struck and touching >> y & 1 and room.rate[y] < 0.0:
                rows[k.which] = y
                struck, closing = strike(rows, k, room)
    elif rows[k.hit] != CONTACT:
        closing = stalled(rows, k, room)
    elif rows[k.kind + z] >= CLOSED:
        closing = release(rows, k, room)
    else:
        struck, closing = strike(rows, k, room)
    if rows[k.hit] == CONTACT and (struck or is_compliant(rows, z, k, None)):
        rows[k.age] = 0.0  # not where a stop lets go: between two without clearance, rests alternate for ever
    if k.compliant:
        began, more = attend(rows, k, room, int(0.0))
        return struck | began, closing | more
    return struck, closing


@inner
def note_rests(rows, k, room, note, before, closing, recorded):
    """Sum up how long stops have been closed; `before` this event were those of a set."""
    periods, phase = moment(rows[k.turn], rows[k.turn + 1], rows[k.turn + 2])
    now, any_tail, closed = periods + phase, math.inf, int(0.0)
    for y in range(k.stops):
        if rows[k.kind + y] >= CLOSED and not is_compliant(rows, y, k, None):
            closed |= 1 << y
            any_tail = min(any_tail, room.tail[y] if closing >> y & 1 else 0.0)
    for y in range(k.stops + 1):
        at, one = SUMS + y * EACH, 1 << y
        was, held = (before & one, closed & one) if y < k.stops else (before, closed)
        if held and not was:
            tail = room.tail[y] if y < k.stops else any_tail
            note[at + RESTED] -= now + tail * rows[k.theta] / TURN
        if was and not held:
            note[at + RESTED] += now
        if recorded:
            note[at + LATEST] = note[at + RESTED] + (now if held else 0.0)


@inner
def note_misses(rows, notes, k, wide, hit, window):
    """Keep at an impact the closest misses since the last one, if they count, and begin anew.

    Misses that do not count, or are not closer than the closest so far, are not looked for.
    """
    hits = get(notes, HITS, wide)
    counts = hit & (hits > window.transient + 1.0) & (hits <= window.total)
    follows = (hits > window.transient) & (hits < window.total)
    for y in range(k.stops):
        at, missed = SUMS + y * EACH + MISS, get(rows, k.missed + y, wide)
        closest = get(notes, at, wide)
        closest = select(counts & (missed > -math.inf) & (missed < closest), missed, closest)
        put(notes, at, wide, closest)
        put(rows, k.missed + y, wide, select(hit, select(follows, closest, -math.inf), missed))


@inner
def note_open(notes, k, wide, hit):
    """Note at a recorded impact how long stops have been closed, where none is."""
    for y in range(k.stops + 1):
        at = SUMS + y * EACH
        put(notes, at + LATEST, wide, select(hit, get(notes, at + RESTED, wide), get(notes, at + LATEST, wide)))


@inner(forceinline=True)
def add(notes, k, wide, hit, z, v, energy, impulse, sine, cosine, periods, window):
    """Add a recorded impact of stop z, where there is a hit, to its window's sums, with the energy that it cost."""
    hits = get(notes, HITS, wide) + select(hit, 1.0, 0.0)
    put(notes, HITS, wide, hits)
    kept = hit & (hits > window.transient) & (hits <= window.total)
    if not anywhere(kept):
        return
    opens, last = kept & (hits == window.transient + 1.0), kept & (hits == window.total)
    mark(notes, BEGAN, wide, opens, sine, cosine, periods)
    put(notes, STOP, wide, select(opens, z, get(notes, STOP, wide)))
    mark(notes, ENDED, wide, last, sine, cosine, periods)
    for y in range(k.stops):
        at, at_y = SUMS + y * EACH, kept & (z == float(y))
        if not anywhere(at_y):
            continue
        count, first = get(notes, at + COUNT, wide), get(notes, at + FIRST, wide)
        first = select(at_y & (count <= 0.0), v, first)
        put(notes, at + FIRST, wide, first)
        put(notes, at + COUNT, wide, count + select(at_y, 1.0, 0.0))
        more = select(at_y, v - first, 0.0)
        put(notes, at + SUM, wide, get(notes, at + SUM, wide) + more)
        put(notes, at + SQUARES, wide, fma(more, more, get(notes, at + SQUARES, wide)))
        largest = get(notes, at + LARGEST, wide)
        put(notes, at + LARGEST, wide, select(at_y & (v > largest), v, largest))
        put(notes, at + COSINE, wide, get(notes, at + COSINE, wide) + select(at_y, cosine, 0.0))
        put(notes, at + SINE, wide, get(notes, at + SINE, wide) + select(at_y, sine, 0.0))
        lost = select(at_y, select(opens, 0.0, energy), 0.0)
        put(notes, at + ENERGY, wide, get(notes, at + ENERGY, wide) + lost)
        pushed = select(at_y, select(opens, 0.0, impulse), 0.0)
        put(notes, at + THRUST, wide, get(notes, at + THRUST, wide) + pushed)


@inner(forceinline=True)
def note_drain(notes, rows, k, wide, hit, before, window):
    """Add what dampers took since the last recorded impact, the number `before` of them, where there is another."""
    kept = hit & (before > window.transient) & (before < window.total)
    more = get(rows, k.drained, wide)
    put(notes, DRAINED, wide, get(notes, DRAINED, wide) + select(kept, more, 0.0))
    put(rows, k.drained, wide, select(hit, 0.0, more))


@inner(forceinline=True)
def conclude(notes, rows, k, wide, over, y, window):
    """Add what contacts with a stop came to, where they are over, to the window's sums, and begin to count anew."""
    at, hits = SUMS + y * EACH, get(notes, HITS, wide)
    kept = over & (hits > window.transient) & (hits < window.total)
    for number, row in ((ENERGY, k.work), (THRUST, k.thrust)):
        more = select(kept, get(rows, row + y, wide), 0.0)
        put(notes, at + number, wide, get(notes, at + number, wide) + more)
    largest, peak = get(notes, at + PEAK, wide), get(rows, k.peak + y, wide)
    put(notes, at + PEAK, wide, select(kept & (peak > largest), peak, largest))
    for row in (k.work, k.thrust, k.pushed, k.peak, k.depth):
        put(rows, row + y, wide, select(over, 0.0, get(rows, row + y, wide)))


@inner(forceinline=True)
def mark(notes, at, wide, where, sine, cosine, periods):
    """Leave the time of an impact `where` there is one."""
    put(notes, at, wide, select(where, sine, get(notes, at, wide)))
    put(notes, at + 1, wide, select(where, cosine, get(notes, at + 1, wide)))
    put(notes, at + 2, wide, select(where, periods, get(notes, at + 2, wide)))


@inner
def add_all(rows, k, room, note, struck, window):
    """Add an unusual impact, stop by stop; weak ones are not recorded."""
    recorded, turn, before = 0, k.turn, note[HITS]
    for z in range(k.stops):
        if struck >> z & 1 and room.speed[z] >= rows[k.cut]:
            v, after = room.speed[z], -room.speed[z]
            for y in range(k.stops):
                after += room.gram[z, y] * room.impulse[y] if room.impulse[y] > 0.0 else 0.0
            lost = 0.5 * (v - after) * room.impulse[z]  # -(w- + w+) P/2
            now = rows[turn], rows[turn + 1], rows[turn + 2]
            add(note, k, None, v >= 0.0, float(z), v, lost, room.impulse[z], *now, window)
            recorded += 1
    if k.draining:
        note_drain(note, rows, k, None, recorded > 0, before, window)
    return recorded
