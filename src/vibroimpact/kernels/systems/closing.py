"""End a cell whose motion has settled on a cycle: its remaining impacts are known.

A cycle of p impacts is walked from one of them in lanes, with a deviation along each coordinate and rate: that gives
its Jacobian M, and the difference d of its end from its start, both beside a free centre. It is certain if a power of
M is a contraction, which bounds all that follow, and if the way still to go to the periodic orbit, at most
|(I - M)^-1 d| (1 + max |M^i|), changes no impact by more than 1e-12 of V. A cycle in which all comes to rest begins
anew each time: it is certain once d is rounding, unless that decides when the next rest comes. Then one cycle is made
in the cell itself, and what it adds to each sum is added as often as whole cycles fit, first into the impacts that are
left out and then into those that are kept. The remainder is made.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba import types

from vibroimpact.kernels.cycle import NOT_SMALL, UNRESOLVED
from vibroimpact.kernels.shared.deferred import deferred
from vibroimpact.kernels.shared.machine import copy, rare
from vibroimpact.kernels.shared.vectors import LANES
from vibroimpact.kernels.systems.elements import CLOSED
from vibroimpact.kernels.systems.event import go_on, lift, lower, lower_alike, occur, walk_on
from vibroimpact.kernels.systems.layout import NOTHING
from vibroimpact.kernels.systems.march import (
    ADDED,
    BEFORE,
    BESIDE,
    DECAY,
    DRAINED,
    EACH,
    FIRST,
    HITS,
    IMPACTS,
    LARGEST,
    LATEST,
    MISS,
    PEAK,
    PERIODS,
    RATE,
    REFERENCE,
    RESTING,
    RETURNED,
    STICKS,
    SUMS,
    TURNED,
    WATCHED,
    moment,
)
from vibroimpact.kernels.systems.pressed import LONGEST, WALK, comes_back, same_contacts
from vibroimpact.kernels.systems.rest import all_held
from vibroimpact.kernels.systems.tangent import accelerate, confine, deviate, happen_beside, leave_centre

SURE = 1e-12  # of V: the most that the remaining way may change an impact
SQUARED = 20  # times, M at most
DOUBLED = 36  # times: what M^(2^i) is more than a power of its spectral radius counts 2^-i of that
RETURNS = 4  # at most, until a cycle has its name: the impact that gives it may be replaced on the way
NOT_SUMS = FIRST, LARGEST, PEAK, BEFORE, RESTING, MISS, TURNED  # among the numbers of a stop


class Alone(NamedTuple):
    """Room to walk a cycle: a layout with a deviation; lanes, notes; start, end, note; M, two matrices; d, a vector."""

    layout: Any
    lanes: Any
    notes: Any
    start: Any
    end: Any
    note: Any
    jacobian: Any
    power: Any
    product: Any
    apart: Any
    moved: Any


@rare
def _advance(rows, k, room, note, window, alone, impacts):
    """Take the cell on by so many recorded impacts; return whether it came exactly so far."""
    lanes, notes, until = alone.lanes, alone.notes, note[HITS] + impacts
    lower_alike(lanes, rows, k.constants)
    lower_alike(notes, note, len(note))
    for _ in range(WALK):
        go_on(lanes, notes, k, window)
        if lanes[k.hit * LANES] != NOTHING:
            lift(lanes, 0, rows, k.fixed)
            lift(notes, 0, note, len(note))
            occur(rows, k, room, note, window)
            lower_alike(lanes, rows, k.constants)
            lower_alike(notes, note, len(note))
        if notes[HITS * LANES] >= until or lanes[k.lawless * LANES] > 0.0:
            break
    lift(lanes, 0, rows, k.fixed)
    lift(notes, 0, note, len(note))
    return note[HITS] == until and rows[k.lawless] == 0.0


@rare
def _cross(rows, k, room):
    """Make what ended a step, and carry the deviation over it; return how many stops were struck hard enough, at which
    speed the weakest, and the size of the deviation.
    """
    struck, hard, weakest, size = happen_beside(rows, k, room), int(0.0), math.inf, 0.0
    leave_centre(rows, k, None)
    for y in range(k.stops):
        if struck >> y & 1 and room.speed[y] >= rows[k.cut]:
            hard, weakest = hard + 1, min(weakest, room.speed[y])
    for j in range(2 * k.modes):
        size += abs(rows[k.deta + j])
    return hard, weakest, size


@rare
def part_lanes(lanes, rows, k, first, beside_centre):
    """Put a cell into all lanes, each with a deviation along another coordinate or rate, from `first` on."""
    for lane in range(LANES):
        for j in range(2 * k.modes):
            rows[k.deta + j] = 1.0 if j == first + lane else 0.0
        if beside_centre:
            leave_centre(rows, k, None)
        if rows[k.closed] > 0.0:
            confine(rows, k)
        lower(lanes, lane, rows, k.constants)


@rare
def _walk(room, alone, impacts, first):
    """Walk a cycle in lanes, each with a deviation along another coordinate or rate, from `first` on.

    Return whether it came exactly so far, its weakest impact, the largest deviation on the way, and whether all that
    moved has come to rest: then the cycle begins anew.
    """
    k, lanes, rows, weakest, largest, number = alone.layout, alone.lanes, alone.end, math.inf, 1.0, 0
    lost, later = False, 1.0
    copy(alone.start, rows)
    part_lanes(lanes, rows, k, first, True)
    for _ in range(WALK):
        walk_on(lanes, k, 0)
        hard = 0
        for lane in range(min(LANES, 2 * k.modes - first) if lanes[k.hit * LANES] != NOTHING else 0):
            lift(lanes, lane, rows, k.fixed)
            hard, speed, size = _cross(rows, k, room)
            weakest = min(weakest, speed)
            lost |= all_held(rows, k)
            if lost and size == 0.0:  # begun anew, to see how far neighbours part up to the next rest
                deviate(rows, k)
                leave_centre(rows, k, None)
            elif lost:
                later = max(later, size)
            else:
                largest = max(largest, size)
            lower(lanes, lane, rows, k.fixed)
        number += hard
        if number >= impacts or lanes[k.lawless * LANES] > 0.0:
            break
    for lane in range(min(LANES, 2 * k.modes - first)):
        lift(lanes, lane, rows, k.fixed)
        leave_centre(rows, k, None)
        for j in range(2 * k.modes):
            alone.jacobian[j, first + lane] = 0.0 if lost else rows[k.deta + j]
    return number == impacts and rows[k.lawless] == 0.0, weakest, largest * later, lost


@rare
def _compare(room, alone):
    """Leave the difference of a cycle's end from its start, at its phase; return its size and the periods between.

    The size is infinite where not the same stops are closed.
    """
    k, a, b = alone.layout, alone.start, alone.end
    accelerate(b, k, room.after)
    dx, size = (b[k.turn] * a[k.turn + 1] - b[k.turn + 1] * a[k.turn]) / b[k.theta], 0.0
    for j in range(k.modes):
        alone.apart[j] = b[k.eta + j] - a[k.eta + j] - b[k.rate + j] * dx
        alone.apart[k.modes + j] = b[k.rate + j] - a[k.rate + j] - room.after[j] * dx
    for j in range(2 * k.modes):
        if k.free and a[k.neutral + j] > 0.0:
            alone.apart[j] = 0.0
        size += abs(alone.apart[j])
    if not same_contacts(a, b, k):
        size = math.inf
    (began, phase), (ended, later) = (
        moment(a[k.turn], a[k.turn + 1], a[k.turn + 2]),
        moment(b[k.turn], b[k.turn + 1], b[k.turn + 2]),
    )
    wrapped = 1.0 if later - phase < -0.5 else -1.0 if later - phase > 0.5 else 0.0
    return size, ended - began + wrapped


@rare
def _apply(matrix, vector, moved):
    """Leave matrix times vector; return the sum of the sizes of its entries."""
    total = 0.0
    for i in range(len(vector)):
        moved[i] = 0.0
        for j in range(len(vector)):
            moved[i] += matrix[i, j] * vector[j]
        total += abs(moved[i])
    return total


@rare
def _way_to_go(alone):
    """Return the most that a later turn of the cycle is away from this one; infinite unless a power of M contracts.

    The difference of turn 2^i is that of turn 2^(i - 1) and M^(2^(i - 1)) times that.
    """
    power, way, moved = alone.power, alone.apart, alone.moved
    for i in range(len(way)):
        copy(alone.jacobian[i], power[i])
    largest = 1.0
    for _ in range(SQUARED):
        size, total = _size(power), 0.0
        largest = max(largest, size)
        _apply(power, way, moved)
        for j in range(len(way)):
            way[j] += moved[j]
            total += abs(way[j])
        if size < 0.5:
            return total / (1.0 - size) * (1.0 + largest)
        _square(alone)
    return math.inf


@rare
def _size(matrix):
    """Return the largest sum of the sizes of a column."""
    largest = 0.0
    for j in range(len(matrix)):
        column = 0.0
        for i in range(len(matrix)):
            column += abs(matrix[i, j])
        largest = max(largest, column)
    return largest


@rare
def _square(alone):
    """Make the power of M its square."""
    power, product = alone.power, alone.product
    for i in range(len(power)):
        for j in range(len(power)):
            product[i, j] = 0.0
            for m in range(len(power)):
                product[i, j] += power[i, m] * power[m, j]
    for i in range(len(power)):
        copy(product[i], power[i])


@rare
def _decay(alone):
    """Return ln of the spectral radius of M, the limit of ln |M^(2^i)| / 2^i; powers are brought to size 1."""
    power, total, share = alone.power, 0.0, 1.0
    for i in range(len(power)):
        copy(alone.jacobian[i], power[i])
    for _ in range(DOUBLED):
        size = _size(power)
        if size == 0.0:
            return -math.inf
        total, share = total + share * math.log(size), 0.5 * share
        for i in range(len(power)):
            for j in range(len(power)):
                power[i, j] /= size
        _square(alone)
    return total


@rare
def _certain(rows, k, room, note, window, alone, impacts):
    """Return the periods after which so many impacts repeat for ever, or 0 where that is not certain."""
    copy(rows, alone.start)
    least, spread, lost = math.inf, 1.0, False
    for first in range(0, 2 * k.modes, LANES):
        whole, weakest, largest, lost = _walk(room, alone, impacts, first)
        note[BESIDE] += alone.end[k.steps] - rows[k.steps]
        if not whole:
            return 0.0
        least, spread = min(least, weakest), max(spread, largest)
    if not spread < UNRESOLVED:
        return 0.0
    size, periods = _compare(room, alone)
    if not size < SURE * rows[k.speed]:
        return 0.0
    if lost:
        return periods
    way = _way_to_go(alone) * spread
    return periods if way < SURE * rows[k.speed] and way < NOT_SMALL * least else 0.0


@rare
def _skip(rows, k, note, alone, times, periods):
    """Add what the last cycle added so many times more; `alone.note` is that of its beginning."""
    for at in range(SUMS, len(note)):
        if (at - SUMS) % EACH not in NOT_SUMS:
            note[at] += times * (note[at] - alone.note[at])
    for at in (DRAINED, STICKS):
        note[at] += times * (note[at] - alone.note[at])
    added = times * (note[HITS] - alone.note[HITS])
    note[HITS] += added
    note[ADDED] += added
    rows[k.turn + 2] += times * periods


@deferred("pressed motions", 0.6, types.boolean)
def stays_pressed(rows, k, room, note, window, alone):
    """Return whether a pressed cell comes back to a state without an impact; see `pressed`."""
    lanes, work, begun = alone.lanes, alone.end, alone.start
    copy(rows, work)
    copy(note, alone.note)
    begun[k.which] = -1.0
    for _ in range(WALK):
        if work[k.turn + 2] > rows[k.turn + 2] + LONGEST:
            return False
        lower_alike(lanes, work, k.constants)
        walk_on(lanes, k, 0)
        lift(lanes, 0, work, k.fixed)
        if lanes[k.hit * LANES] == NOTHING:
            continue
        pushed = work[k.kind + int(work[k.which])] >= CLOSED
        occur(work, k, room, alone.note, window)
        if alone.note[HITS] > note[HITS] or work[k.lawless] > 0.0:
            return False
        if comes_back(work, k, pushed, begun):
            return True
    return False


@rare
def _ready(note, impacts, place, unnamed, first):
    """Return up to which impact a cell goes on: to the Jacobian's place in the cycle, in its window, and named."""
    to = max(note[HITS], first)
    if unnamed:
        to = max(to, (note[REFERENCE] if note[REFERENCE] > 0.0 else note[HITS] + 1.0) + impacts)
    return place + math.ceil((to - place) / impacts) * impacts


@deferred("cycles of systems", 3)
def close(rows, k, room, note, window, alone):
    """Leave out the impacts of a cell that are known, if its motion has settled on a cycle.

    `alone` is room to work. What is not certain is not looked at again before another impact is watched for.
    """
    impacts, transient, total = note[RETURNED], window.transient, window.total
    note[RETURNED], note[WATCHED] = 0.0, -math.inf
    if note[ADDED] > 0.0 or (2.0 * k.modes + 6.0) * impacts + 3.0 > total - note[HITS]:
        return  # too little would be gained
    if not _advance(rows, k, room, note, window, alone, 1.0):
        return
    periods, place = _certain(rows, k, room, note, window, alone, impacts), note[HITS]
    if periods > 0.0 and k.thorough:
        note[DECAY], note[RATE] = _decay(alone) / periods, impacts / periods
    for bound in (transient, total):
        if periods == 0.0:
            return
        reference, to = note[REFERENCE], note[HITS]
        for _ in range(RETURNS):
            unnamed = k.thorough and note[IMPACTS] == 0.0
            if unnamed and note[HITS] - note[REFERENCE] > impacts and note[HITS] + 4.0 * impacts <= bound:
                # That one does not come back: the next impact is the one whose return names the cycle.
                note[REFERENCE] = 0.0
                reference = reference if bound == transient else 0.0
            to = _ready(note, impacts, place, unnamed, transient + 1.0 if bound == total else 0.0)
            if to == note[HITS] or to + 2.0 * impacts > bound:
                break
            if not _advance(rows, k, room, note, window, alone, to - note[HITS]):
                return
        if to > note[HITS] or to + 2.0 * impacts > bound or (k.thorough and note[IMPACTS] == 0.0):
            continue
        note[REFERENCE] = total  # the reference stays: what has come back keeps its name
        copy(note, alone.note)
        if not _advance(rows, k, room, note, window, alone, impacts):
            return
        times = int((bound - note[HITS] - (bound == total)) / impacts)
        if k.thorough and bound == total:
            for at in range(SUMS, len(note), EACH):
                note[at + RESTING] = (note[at + LATEST] - alone.note[at + LATEST]) * note[PERIODS] / periods
        _skip(rows, k, note, alone, times, periods)
        if bound == total and place <= transient and 2.0 * (transient + 1.0) > total:
            reference = transient + 1.0  # of the cycle, as all later ones
        note[REFERENCE] = reference if bound == transient or 2.0 * reference > total else total
        while bound == transient and 0.0 < 2.0 * note[REFERENCE] <= note[HITS]:
            note[REFERENCE] *= 2.0
