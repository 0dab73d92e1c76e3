"""Systems through time, with all that is observed of them: impacts, states at given times, contacts that are held."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from vibroimpact.kernels.advance import LOOK
from vibroimpact.kernels.cell import FILLED, LAWLESS, PINNED, RUNNING, SPENT
from vibroimpact.kernels.leaps import TURN
from vibroimpact.kernels.shared.deferred import deferred
from vibroimpact.kernels.shared.machine import compiled, copy, inner
from vibroimpact.kernels.shared.series import SIZE, evaluate, load
from vibroimpact.kernels.shared.vectors import LANES, anywhere, get, put, select
from vibroimpact.kernels.systems.closing import part_lanes, stays_pressed
from vibroimpact.kernels.systems.elements import CLOSED, is_compliant
from vibroimpact.kernels.systems.event import lift, lower, rigid, walk_on
from vibroimpact.kernels.systems.flow import move, stands, turns
from vibroimpact.kernels.systems.lasting import lasting
from vibroimpact.kernels.systems.law import begin, bounce
from vibroimpact.kernels.systems.layout import NOTHING
from vibroimpact.kernels.systems.leap import HALF
from vibroimpact.kernels.systems.march import GRANTED, HITS, STEPS, ending, happen, lasting_is_due, moment
from vibroimpact.kernels.systems.pressed import in_contact, is_pressed, repetition_is_due
from vibroimpact.kernels.systems.rest import measure
from vibroimpact.kernels.systems.step import BACK, fly_on, fly_one
from vibroimpact.kernels.systems.tangent import happen_beside


class Record(NamedTuple):
    """Rows of what is observed of the cell in each lane, and how many of each are filled.

    Impacts: periods, phase, stop, speed, impulse, whether others were struck at once; of compliant stops the largest
    force, the time, the penetration and the energy taken, when the force ended, the speed then, and when force and
    penetration were largest, after the impact, NaN until the contact is over. Looks: eta, then its rate. Rests: stop,
    periods and phase of its beginning, and of its end (NaN until then). Time is counted in steps in rates.
    """

    impacts: Any
    looks: Any
    rests: Any
    filled: Any


class Schedule(NamedTuple):
    """When motions are looked at: how often, and the times in each lane, ascending: whole periods, then phases."""

    number: float
    times: Any


class Busy(NamedTuple):
    """Lanes: which hold a cell, their notes, why they stopped, how they were a step before, and room for two cells."""

    lanes: Any
    owner: Any
    notes: Any
    ends: Any
    before: Any
    rows: Any
    spare: Any


IMPACT = 14  # numbers of an impact
GOES_ON = -1  # beside the ends of cells
SLACK = 1e-9  # periods: looks that are so little ahead may be behind, but for rounding


@inner
def _ahead(record, lane, schedule, periods, phase):
    """Return the time from there to the next look of a lane, in periods."""
    times, number = schedule.times[lane], record.filled[lane, 1]
    return (times[0, number] - periods) + (times[1, number] - phase)


@inner
def _look(rows, k, record, lane, schedule, periods, phase):
    """Leave the states at the looks that lie within the step just made, which began at that time."""
    end, pace, filled, looks = rows[k.passed], rows[k.pace], record.filled[lane], record.looks[lane]
    while filled[1] < len(looks):
        x = _ahead(record, lane, schedule, periods, phase) * TURN / rows[k.theta]
        if x >= end:
            return
        for j in range(k.modes):
            y, p = evaluate(load(rows, k.flight + j * SIZE, None), max(x, 0.0) / pace)
            looks[filled[1], j], looks[filled[1], k.modes + j] = y, p / pace
        filled[1] += 1


@inner
def _look_on_way(rows, before, k, record, lane, schedule):
    """Leave the states at the looks since the state `before`: those within leaps need series of their own."""
    leapt = rows[k.age] - before[k.age] - rows[k.passed]
    within = k.compliant and before[k.engaged] > 0.0
    length = 0.5 * leapt if within else HALF
    for _ in range(int(leapt / length + 0.5) if leapt > BACK else 0):
        periods, phase = moment(before[k.turn], before[k.turn + 1], before[k.turn + 2])
        turns(before, k, None)
        fly_one(before, within, k)
        before[k.passed] = length
        _look(before, k, record, lane, schedule, periods, phase)
        move(before, length / before[k.pace], False, k, None)
    periods, phase = moment(before[k.turn], before[k.turn + 1], before[k.turn + 2])
    _look(rows, k, record, lane, schedule, periods, phase)


@inner
def _note_rests(rows, k, record, lane, room, closing):
    """Begin a row for each stop that closed, and end those of stops that are open."""
    periods, phase = moment(rows[k.turn], rows[k.turn + 1], rows[k.turn + 2])
    rests, filled = record.rests[lane], record.filled[lane]
    for at in range(filled[2]):
        row = rests[at]
        z = int(row[0])
        if math.isnan(row[3]) and (rows[k.kind + z] < CLOSED or closing >> z & 1):  # opened and closed at one instant
            row[3], row[4] = periods, phase
    for z in range(k.stops):
        if closing >> z & 1:
            row = rests[filled[2]]
            later = phase + room.tail[z] * rows[k.theta] / TURN
            row[0], row[1], row[2], row[3], row[4] = z, periods + math.floor(later), later % 1.0, math.nan, math.nan
            filled[2] += 1


@inner
def _count(record, lane, note, window):
    """Count an impact; return which row is its, one that stays free where it is not kept."""
    note[HITS] += 1.0
    at = record.filled[lane, 0]
    record.filled[lane, 0] = at + (window.transient < note[HITS] <= window.total)
    return at


@inner
def _record_usual(lanes, lane, k, record, note, window):
    """Leave a row for the usual impact that ended a lane's step; `near` has its speeds, impulse and energy."""
    row = record.impacts[lane, _count(record, lane, note, window)]
    near, turn = k.near * LANES + lane, k.turn * LANES + lane
    row[0], row[1] = moment(lanes[turn], lanes[turn + LANES], lanes[turn + 2 * LANES])
    row[2], row[3], row[4], row[5] = lanes[k.which * LANES + lane], lanes[near], lanes[near + LANES], 0.0
    row[6:], row[9], row[10], row[11] = math.nan, lanes[near + 2 * LANES], 0.0, lanes[near + 3 * LANES]


@inner
def _record(rows, k, room, note, record, lane, struck, window):
    """Leave a row for each stop that was struck hard enough."""
    hard = 0
    for z in range(k.stops):
        hard += struck >> z & 1 and room.speed[z] >= rows[k.cut]
    if not hard:
        return
    measure(rows, k, room)
    for z in range(k.stops):
        if struck >> z & 1 and room.speed[z] >= rows[k.cut]:
            row, soft = record.impacts[lane, _count(record, lane, note, window)], is_compliant(rows, z, k, None)
            row[0], row[1] = moment(rows[k.turn], rows[k.turn + 1], rows[k.turn + 2])
            row[2], row[3], row[4], row[5] = z, room.speed[z], math.nan if soft else room.impulse[z], hard > 1
            row[6:] = math.nan
            if not soft:
                row[9], row[10], row[11] = 0.5 * (room.speed[z] - room.rate[z]) * room.impulse[z], 0.0, room.rate[z]
            if soft and window.transient < note[HITS] <= window.total:
                rows[k.entry + z] = record.filled[lane, 0]


@inner
def _conclude(rows, k, record, lane):
    """Leave what contacts that are over came to; one that goes on after its stop let go adds to its row."""
    for z in range(k.stops):
        if rows[k.kind + z] < CLOSED and rows[k.pushed + z] > 0.0:
            if rows[k.entry + z] > 0.0:
                row = record.impacts[lane, int(rows[k.entry + z]) - 1]
                before = 0.0
                if math.isnan(row[4]):
                    row[4], row[6:] = 0.0, 0.0
                else:
                    periods, phase = moment(rows[k.turn], rows[k.turn + 1], rows[k.turn + 2])
                    now = ((periods - row[0]) + (phase - row[1])) * TURN / rows[k.theta]
                    before = now - rows[k.pushed + z]
                row[4] += rows[k.thrust + z]
                row[7], row[9] = row[7] + rows[k.pushed + z], row[9] + rows[k.work + z]
                _, rate, _, _ = stands(rows, z, rows[k.turn], rows[k.turn + 1], k, None)
                row[10], row[11] = before + rows[k.pushed + z], rate
                for at, then, largest, time in ((6, 12, k.peak, k.peaked), (8, 13, k.depth, k.deepest)):
                    if rows[largest + z] > row[at]:
                        row[at], row[then] = rows[largest + z], before + rows[time + z]
            for first in (k.thrust, k.pushed, k.work, k.peak, k.depth):
                rows[first + z] = 0.0


@inner
def _record_unusual(rows, k, room, note, record, lane, window):
    """Make what else ended a step, and record it."""
    for z in range(k.stops if k.compliant else 0):
        if not in_contact(rows, z, k):
            rows[k.entry + z] = 0.0
    struck, closing = happen(rows, k, room)
    if k.compliant:
        _conclude(rows, k, record, lane)
    _record(rows, k, room, note, record, lane, struck, window)
    _note_rests(rows, k, record, lane, room, closing)


@inner
def _waits(rows, k):
    """Return whether a contact that was recorded goes on."""
    waits = False
    for z in range(k.stops):
        waits |= rows[k.entry + z] > 0.0 and in_contact(rows, z, k)
    return waits


@inner
def _is_complete(record, lane, note, schedule, window):
    """Return whether a lane has all impacts, or all looks."""
    return note[HITS] >= window.total or (schedule.number > 0.0 and record.filled[lane, 1] >= schedule.number)


@inner
def _is_full(k, record, lane):
    """Return whether a lane's rows might not be enough for the next event."""
    impacts, rests = record.filled[lane, 0] + k.stops, record.filled[lane, 2] + k.stops
    return impacts >= record.impacts.shape[1] or rests > record.rests.shape[1]


@inner
def _end(rows, k, room, note, record, lane, schedule, window, alone, due):
    """Return the reason why a cell stops here, RUNNING if for a full buffer alone, or that it goes on."""
    if rows[k.lawless] > 0.0:
        return LAWLESS
    full = _is_complete(record, lane, note, schedule, window)
    if full and schedule.number == 0.0 and _waits(rows, k):
        full = rows[k.steps] > note[GRANTED]
        full |= due and lasting_is_due(rows, k, note) and lasting(rows, k, room) != RUNNING
    if full:
        stays = schedule.number > 0.0 and rows[k.closed] > 0.0 and lasting(rows, k, room) == PINNED
        return PINNED if stays else FILLED
    if _is_full(k, record, lane):
        return RUNNING
    if not due or note[HITS] >= window.total:
        return GOES_ON
    end = ending(rows, k, room, note, window.total)
    still = k.compliant and repetition_is_due(note, 1, 0, rows[k.turn + 2]) and is_pressed(rows, k)
    if end == RUNNING and still and stays_pressed(rows, k, room, note, window, alone):
        end = PINNED
    return end if end != RUNNING and (schedule.number == 0.0 or end == SPENT) else GOES_ON


@inner
def _begin(rows, k, row, room):
    """Begin with a row of a cell's constants; return the set of stops that are closed."""
    rows[:] = 0.0
    copy(row, rows)
    rows[k.pace] = 1.0
    room.tail[:] = 0.0
    return begin(rows, k, room)


@compiled("starts of motions of systems", 1)
def seat(busy, lane, k, row, room, record):
    """Put a cell, a row of its constants, into a lane."""
    rows = busy.rows[lane]
    closing = _begin(rows, k, row, room)
    _note_rests(rows, k, record, lane, room, closing)
    lower(busy.lanes, lane, rows, k.rows)


@inner
def _is_alone(busy):
    """Return whether there is a single cell: it is stepped outside of its lane, where it has its series."""
    return len(busy.rows) == 1


@inner
def _keep(lanes, k, before):
    """Keep what can change of all lanes."""
    for at in range(k.fixed * LANES):
        before[at] = lanes[at]


@inner
def _look_at_all(busy, k, record, schedule):
    """Leave the states of all cells at the looks since the step before, whose lanes are `before`."""
    lanes, turn = busy.lanes, k.turn * LANES
    for lane in range(LANES):
        if busy.owner[lane] < 0:
            continue
        at = turn + lane
        periods, phase = moment(lanes[at], lanes[at + LANES], lanes[at + 2 * LANES])
        if _ahead(record, lane, schedule, periods, phase) <= SLACK:
            rows = busy.rows[lane]
            lift(lanes, lane, rows, k.fixed if _is_alone(busy) else k.rows)
            copy(rows, busy.spare)
            lift(busy.before, lane, busy.spare, k.fixed)
            _look_on_way(rows, busy.spare, k, record, lane, schedule)


@inner
def _bounce_all(lanes, k):
    """Make the usual impacts in all lanes; leave their speed, or 0, impulse, energy and speed after it.

    Return where they are made.
    """
    struck, v, impulse, r = bounce(lanes, k, 0)
    put(lanes, k.near, 0, select(struck, v, 0.0))
    put(lanes, k.near + 1, 0, impulse)
    put(lanes, k.near + 2, 0, 0.5 * (1.0 - r) * v * impulse)
    put(lanes, k.near + 3, 0, r * v)
    put(lanes, k.hit, 0, select(struck, NOTHING, get(lanes, k.hit, 0)))
    return anywhere(struck)


@deferred("motions of systems", 3, by_kind=True)
def _follow(busy, k, room, record, window, schedule, most, alone):
    """Follow cells until one ends or a buffer of its is full, or so many steps are made; leave why."""
    lanes, looking, over = busy.lanes, schedule.number > 0.0, False
    for number in range(most):
        if looking:
            _keep(lanes, k, busy.before)
        if _is_alone(busy):
            lift(lanes, 0, busy.rows[0], k.fixed)
            walk_on(busy.rows[0], k, None)
            lower(lanes, 0, busy.rows[0], k.fixed)
        else:
            walk_on(lanes, k, 0)
        if looking:
            _look_at_all(busy, k, record, schedule)
        struck, due = _bounce_all(lanes, k), number % LOOK == 0
        if not (looking or due or struck or anywhere(get(lanes, k.hit, 0) > NOTHING)):
            continue
        for lane in range(LANES):
            usual, hit = lanes[k.near * LANES + lane] > 0.0, lanes[k.hit * LANES + lane]
            if busy.owner[lane] < 0 or not (looking or due or usual or hit != NOTHING):
                continue
            note = busy.notes[lane]
            note[STEPS] = lanes[k.steps * LANES + lane]
            if usual:
                _record_usual(lanes, lane, k, record, note, window)
            if not (
                due or hit != NOTHING or _is_complete(record, lane, note, schedule, window) or _is_full(k, record, lane)
            ):
                continue
            rows = busy.rows[lane]
            lift(lanes, lane, rows, k.fixed)
            if hit != NOTHING:
                _record_unusual(rows, k, room, note, record, lane, window)
                lower(lanes, lane, rows, k.fixed)
            busy.ends[lane] = _end(rows, k, room, note, record, lane, schedule, window, alone, due)
            over |= busy.ends[lane] != GOES_ON
        if over:
            return


@compiled("motions of systems", 0.3)
def follow(busy, k, room, record, window, schedule, most, alone):
    """Follow cells as `_follow` does; what compliant stops need is left out where there are none."""
    if k.compliant:
        _follow(busy, k, room, record, window, schedule, most, alone)
    else:
        _follow(busy, rigid(k), room, record, window, schedule, most, alone)


@compiled("multipliers of systems", 2)
def carry_over(row, rows, k, room, lanes, before, first, periods, most):
    """Carry a cell over driving periods, in lanes with a deviation along each coordinate and rate from `first` on.

    Return whether it came so far in that many steps.
    """
    _begin(rows, k, row, room)
    columns = min(LANES, 2 * k.modes - first)
    part_lanes(lanes, rows, k, first, False)
    began, phase = moment(rows[k.turn], rows[k.turn + 1], rows[k.turn + 2])
    passed = 0.0
    for _ in range(most):
        _keep(lanes, k, before)
        walk_on(lanes, k, 0)
        now, later = moment(lanes[k.turn * LANES], lanes[(k.turn + 1) * LANES], lanes[(k.turn + 2) * LANES])
        last, passed = passed, (now - began) + (later - phase)
        if passed >= periods:
            for lane in range(columns):
                lift(before, lane, rows, k.fixed)
                fly_on(rows, (periods - last) * TURN / rows[k.theta], k)
                lower(lanes, lane, rows, k.fixed)
            return True
        if lanes[k.hit * LANES] == NOTHING:
            continue
        for lane in range(LANES):
            lift(lanes, lane, rows, k.fixed)
            happen_beside(rows, k, room)
            lower(lanes, lane, rows, k.fixed)
        if rows[k.lawless] > 0.0:
            return False
    return False
