"""One system through time, with all that is seen of it: impacts, states at given times, contacts that are held."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba import types

from vibroimpact.kernels.cell import FILLED, LAWLESS, PINNED, RUNNING, SPENT
from vibroimpact.kernels.deferred import deferred
from vibroimpact.kernels.held import held, without
from vibroimpact.kernels.machine import compiled, copy, inner
from vibroimpact.kernels.systems.flow import move, turns
from vibroimpact.kernels.systems.lasting import lasting
from vibroimpact.kernels.systems.law import begin, bounce
from vibroimpact.kernels.systems.layout import CLOSED, NOTHING
from vibroimpact.kernels.systems.leap import FAR, HALF, LEAPS, WHOLE, leap, leap_far, leap_within, look, may_leap
from vibroimpact.kernels.systems.march import GRANTED, HITS, LOOK, MADE, TURN, add_all, asks, ending, happen, moment
from vibroimpact.kernels.systems.pressed import LONGEST, WALK, asks_again, comes_back, in_contact, is_pressed
from vibroimpact.kernels.systems.rest import measure
from vibroimpact.kernels.systems.series import SIZE, evaluate, load
from vibroimpact.kernels.systems.step import fly_on, fly_one, step_one
from vibroimpact.kernels.systems.tangent import confine, happen_beside


class Seen(NamedTuple):
    """Rows of what is seen, and how many of each are filled.

    Impacts: periods, phase, stop, speed, impulse, whether others were struck at once, and of stops that give the
    largest force, the time, the penetration and the energy taken, NaN until the contact is over. Looks: eta, then its
    rate. Rests: stop, periods and phase of its beginning, and of its end (NaN until then). Time is counted in steps in
    rates.
    """

    impacts: Any
    looks: Any
    rests: Any
    filled: Any


class Schedule(NamedTuple):
    """When a motion is looked at: how often, the first time in whole periods and phase, and how often a period."""

    number: float
    periods: float
    phase: float
    per_period: float


@inner
def _look(rows, k, seen, periods, phase, schedule):
    """Leave the states at the looks that lie within the step just made, which began at that time."""
    end, pace = rows[k.passed], rows[k.pace]
    while seen.filled[1] < len(seen.looks):
        number = float(seen.filled[1])
        whole = math.floor(number / schedule.per_period)
        ahead = (schedule.periods - periods + whole) + (schedule.phase - phase)
        x = (ahead + (number - whole * schedule.per_period) / schedule.per_period) * TURN / rows[k.theta]
        if x >= end:
            return
        for j in range(k.modes):
            y, p = evaluate(load(rows, k.flight + j * SIZE, None), max(x, 0.0) / pace)
            seen.looks[seen.filled[1], j], seen.looks[seen.filled[1], k.modes + j] = y, p / pace
        seen.filled[1] += 1


@inner
def _leap(rows, spare, k, seen, schedule, length, willing):
    """Make a leap of that length, or far ones; looks within need series. Return whether another may follow."""
    if schedule.number > 0.0:
        copy(rows, spare)
    if length == FAR:
        leap_far(rows, k, None, willing)
    else:
        willing = leap(rows, k, None, length == WHOLE, willing)
    for _ in range(int((rows[k.age] - spare[k.age]) / HALF) if schedule.number > 0.0 else 0):
        periods, phase = moment(spare[k.turn], spare[k.turn + 1], spare[k.turn + 2])
        turns(spare, k, None)
        fly_one(spare, False, k)
        spare[k.passed] = HALF
        _look(spare, k, seen, periods, phase, schedule)
        move(spare, HALF, False, k, None)
    return willing


@inner
def _leap_within(rows, spare, k, seen, schedule):
    """Leap from the beginning of a contact; the looks within need series."""
    if schedule.number > 0.0:
        copy(rows, spare)
    leap_within(rows, k, None)
    if schedule.number > 0.0 and rows[k.age] > spare[k.age]:
        end = 0.5 * rows[k.age]
        for _ in range(2):
            periods, phase = moment(spare[k.turn], spare[k.turn + 1], spare[k.turn + 2])
            turns(spare, k, None)
            fly_one(spare, True, k)
            spare[k.passed] = end
            _look(spare, k, seen, periods, phase, schedule)
            move(spare, end / spare[k.pace], False, k, None)


@inner
def _note_rests(rows, k, seen, room, closing):
    """Begin a row for each stop that closed, and end those of stops that are open."""
    periods, phase = moment(rows[k.turn], rows[k.turn + 1], rows[k.turn + 2])
    for at in range(seen.filled[2]):
        row = seen.rests[at]
        z = int(row[0])
        if math.isnan(row[3]) and (rows[k.kind + z] < CLOSED or closing >> z & 1):  # opened and closed at one instant
            row[3], row[4] = periods, phase
    for z in range(k.stops):
        if closing >> z & 1:
            row = seen.rests[seen.filled[2]]
            later = phase + room.tail[z] * rows[k.theta] / TURN
            row[0], row[1], row[2], row[3], row[4] = z, periods + math.floor(later), later % 1.0, math.nan, math.nan
            seen.filled[2] += 1


@inner
def _record(rows, k, room, seen, struck, before, several, window):
    """Leave a row for each stop that was struck hard enough."""
    measure(rows, k, room)
    periods, phase = moment(rows[k.turn], rows[k.turn + 1], rows[k.turn + 2])
    for z in range(k.stops):
        if struck >> z & 1 and room.speed[z] >= rows[k.cut]:
            before += 1.0
            if window.transient < before <= window.total:
                row = seen.impacts[seen.filled[0]]
                row[0], row[1], row[2] = periods, phase, z
                row[3], row[4], row[5] = room.speed[z], room.impulse[z], several
                row[6:9], row[9] = math.nan, 0.5 * (room.speed[z] - room.rate[z]) * room.impulse[z]
                seen.filled[0] += 1
                if rows[k.spring + z] > 0.0:
                    row[4] = row[9] = math.nan
                    rows[k.entry + z] = seen.filled[0]


@inner
def _conclude(rows, k, seen):
    """Leave what contacts that are over came to; one that goes on after its stop let go adds to its row."""
    for z in range(k.stops):
        if rows[k.kind + z] < CLOSED and rows[k.pushed + z] > 0.0:
            if rows[k.entry + z] > 0.0:
                row = seen.impacts[int(rows[k.entry + z]) - 1]
                if math.isnan(row[4]):
                    row[4], row[6:] = 0.0, 0.0
                row[4] += rows[k.thrust + z]
                row[6], row[7] = max(row[6], rows[k.peak + z]), row[7] + rows[k.pushed + z]
                row[8], row[9] = max(row[8], rows[k.depth + z]), row[9] + rows[k.work + z]
            for first in (k.thrust, k.pushed, k.work, k.peak, k.depth):
                rows[first + z] = 0.0


@inner
def _after_step(rows, k, room, note, seen, window):
    """Make what ended a step, and record it."""
    before = note[HITS]
    for z in range(k.stops if k.giving else 0):
        if not in_contact(rows, z, k):
            rows[k.entry + z] = 0.0
    usual, v, impulse, _ = bounce(rows, k, None)
    note[MADE] = rows[k.made]
    if usual:
        z = int(rows[k.which])
        room.speed[z], room.impulse[z] = v, impulse
        note[HITS] += 1.0
        _record(rows, k, room, seen, 1 << z, before, False, window)
        return
    struck, closing = happen(rows, k, room)
    recorded = add_all(rows, k, room, note, struck, window) if struck else 0
    if k.giving:
        _conclude(rows, k, seen)
    if recorded:
        _record(rows, k, room, seen, struck, before, recorded > 1, window)
    _note_rests(rows, k, seen, room, closing)


@inner
def _waits(rows, k):
    """Return whether a contact that was recorded goes on."""
    waits = False
    for z in range(k.stops):
        waits |= rows[k.entry + z] > 0.0 and in_contact(rows, z, k)
    return waits


@inner
def _stays_pressed(rows, work, begun, k, room):
    """Return whether a pressed cell comes back to a state without an impact; see `pressed`."""
    copy(rows, work)
    begun[k.which] = -1.0
    for _ in range(WALK):
        if work[k.turn + 2] > rows[k.turn + 2] + LONGEST:
            return False
        step_one(work, k)
        if work[k.hit] == NOTHING:
            continue
        pushed = work[k.kind + int(work[k.which])] >= CLOSED
        struck, _ = happen(work, k, room)
        for z in range(k.stops):
            if struck >> z & 1 and room.speed[z] >= work[k.cut]:
                return False
        if work[k.lawless] > 0.0:
            return False
        if comes_back(work, k, pushed, begun):
            return True
    return False


@compiled("motions of systems, its start", 1)
def seat(rows, k, row, room, seen):
    """Put a cell, a row of its constants, where one is followed alone."""
    k, room, seen = held(k), held(room), held(seen)
    rows[:] = 0.0
    copy(row, rows)
    rows[k.pace] = 1.0
    room.tail[:] = 0.0
    _note_rests(rows, k, seen, room, begin(rows, k, room))


@deferred("motions of systems", 7, types.intp, by_kind=True)
def _follow(rows, spare, begun, k, room, note, seen, window, schedule, most):
    """Follow a cell until its window is full, a buffer is, it ends, or so many steps are made; return why."""
    for number in range(most):
        look(rows, k, None)
        on = leapt = _leap(rows, spare, k, seen, schedule, HALF, may_leap(rows, k, None))
        if k.far and on:
            _leap(rows, spare, k, seen, schedule, FAR, on)
        for _ in range(LEAPS if on else 0):
            on = on and _leap(rows, spare, k, seen, schedule, WHOLE, on)
        if leapt:
            _leap(rows, spare, k, seen, schedule, HALF, leapt)
        if k.giving and k.modes == 1:
            _leap_within(rows, spare, k, seen, schedule)
            if schedule.number > 0.0 and seen.filled[1] >= schedule.number:
                return FILLED  # within the contact
        periods, phase = moment(rows[k.turn], rows[k.turn + 1], rows[k.turn + 2])
        step_one(rows, k)
        _look(rows, k, seen, periods, phase, schedule)
        if rows[k.hit] != NOTHING:
            _after_step(rows, k, room, note, seen, window)
        if rows[k.lawless] > 0.0:
            return LAWLESS
        full = note[HITS] >= window.total
        if full and _waits(rows, k):
            full = rows[k.made] > note[GRANTED]
            full |= number % LOOK == 0 and asks(rows, k, note) and lasting(rows, k, room) != RUNNING
        if full or (schedule.number > 0.0 and seen.filled[1] >= schedule.number):
            return FILLED
        if seen.filled[0] + k.stops > len(seen.impacts) or seen.filled[2] + k.stops > len(seen.rests):
            return RUNNING
        if number % LOOK == 0 and note[HITS] < window.total:
            end = ending(rows, k, room, note, window.total)
            still = k.giving and asks_again(note, 1, 0, rows[k.turn + 2]) and is_pressed(rows, k)
            if end == RUNNING and still and _stays_pressed(rows, spare, begun, k, room):
                end = PINNED
            if end != RUNNING and (schedule.number == 0.0 or end == SPENT):
                return end
    return RUNNING


_unwatched = without("thorough", "wary", "draining")
_rigid = without("giving", "forceful")


@compiled("motions of systems", 0.6)
def follow(rows, spare, begun, k, room, note, seen, window, schedule, most):
    """Do so; neither a deviation nor misses or what dampers take are seen of it."""
    k, room, seen = _unwatched(held(k)), held(room), held(seen)
    if k.giving:
        return _follow(rows, spare, begun, k, room, note, seen, window, schedule, most)
    return _follow(rows, spare, begun, _rigid(k), room, note, seen, window, schedule, most)


@compiled("multipliers of systems", 3)
def carry_over(rows, spare, k, room, periods, most):
    """Carry a cell and its deviation over driving periods; return whether it came so far in that many steps."""
    k, room = held(k), held(room)
    if rows[k.closed] > 0.0:
        confine(rows, k)
    began, phase = moment(rows[k.turn], rows[k.turn + 1], rows[k.turn + 2])
    passed = 0.0
    for _ in range(most):
        copy(rows, spare)
        step_one(rows, k)
        now, later = moment(rows[k.turn], rows[k.turn + 1], rows[k.turn + 2])
        before, passed = passed, (now - began) + (later - phase)
        if passed >= periods:
            copy(spare, rows)
            fly_on(rows, (periods - before) * TURN / rows[k.theta], k)
            return True
        if rows[k.hit] != NOTHING:
            happen_beside(rows, k, room)
        if rows[k.lawless] > 0.0:
            return False
    return False
