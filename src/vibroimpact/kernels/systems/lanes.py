"""Many systems in lockstep lanes; a lane that ends takes the next cell.

The usual impact is made in all lanes at once. All else (several stops at once, contact that is held, weak impacts,
ends) is done on the cell alone: it is lifted out of its lane and put back.
"""

from __future__ import annotations

import math

from numba import njit

from vibroimpact.kernels.cell import QUIET_FOR, RUNNING
from vibroimpact.kernels.machine import compiled, next_ticket
from vibroimpact.kernels.systems.law import begin, bounce, closed
from vibroimpact.kernels.systems.layout import CLOSED, CONTACT, NOTHING
from vibroimpact.kernels.systems.leap import LEAPS, leap_half, leap_whole, leap_within, may_leap
from vibroimpact.kernels.systems.march import (
    CHATTERED,
    EACH,
    GRANTED,
    HITS,
    LOOK,
    MADE,
    MISS,
    STICKS,
    SUMS,
    add,
    add_all,
    conclude,
    ending,
    happen,
    note_drain,
    note_misses,
    note_rests,
)
from vibroimpact.kernels.systems.push import meet
from vibroimpact.kernels.systems.step import step
from vibroimpact.kernels.systems.tangent import before, confine, cross, deviate, measure_growth, recur
from vibroimpact.kernels.vectors import LANES, anywhere, get, put, select


@njit(error_model="numpy")
def _lift(lanes, lane, cell):
    for row in range(len(cell)):
        cell[row] = lanes[row * LANES + lane]


@njit(error_model="numpy")
def _lower(lanes, lane, cell, number):
    for row in range(number):
        lanes[row * LANES + lane] = cell[row]


@njit(error_model="numpy")
def _seat(table, budgets, tickets, lanes, lane, notes, rows, note, k, room):
    """Put the next cell into a lane; return its number, or -2 if there is none."""
    cell = next_ticket(tickets)
    if cell >= len(table):
        return -2
    note[:] = 0.0
    note[:MADE] = budgets[cell]
    rows[:] = 0.0
    rows[: k.constants] = table[cell]
    rows[k.pace] = 1.0
    closing = begin(rows, k, room)
    if k.thorough:
        deviate(rows, k)
    if k.thorough:
        note[SUMS + MISS :: EACH] = math.inf
        note_misses(rows, k, note, False)
    if k.thorough and closing:
        confine(rows, k)
        note_rests(rows, k, room, note, int(0.0), closing, False)
    _lower(lanes, lane, rows, k.rows)
    _lower(notes, lane, note, len(note))
    return cell


@njit(error_model="numpy")
def _neighbour(rows, k, room, note, z, struck, closing, window):
    """Carry the deviation over an event, and count its growth from the first impact of the window on."""
    if struck and room.speed[z] > 0.0:
        cross(rows, k, room, z)
    if closing:
        confine(rows, k)
    if struck and note[HITS] < window.total:
        measure_growth(rows, k, note, note[HITS] > window.transient)


@njit(error_model="numpy")
def _unusual(lanes, lane, notes, rows, note, k, room, window):
    """Make what ended a lane's step, on the cell alone."""
    _lift(lanes, lane, rows)
    _lift(notes, lane, note)
    shut = closed(rows, k)
    if k.thorough:
        before(rows, k, room)
    struck, closing = happen(rows, k, room)
    z = int(rows[k.which])
    if k.thorough:
        _neighbour(rows, k, room, note, z, struck, closing, window)
    recorded = add_all(rows, k, room, note, struck, window)
    if k.thorough:
        note_rests(rows, k, room, note, shut, closing, recorded and note[HITS] <= window.total)
        if struck:
            note_misses(rows, k, note, window.transient + 1.0 < note[HITS] <= window.total)
        if recorded and note[HITS] <= window.total:
            recur(rows, k, note, z, window.total)
    if k.thorough and closing:
        for y in range(k.stops):
            note[CHATTERED] += closing >> y & 1 and room.tail[y] > 0.0
    for y in range(k.stops if k.giving or k.forceful else 0):
        if rows[k.kind + y] < CLOSED:
            conclude(note, rows, k, None, rows[k.kind + y] < CLOSED, y, window)
    note[STICKS] += rows[k.closed] > 0.0 and window.transient < note[HITS] < window.total
    _lower(lanes, lane, rows, k.constants)
    _lower(notes, lane, note, len(note))


@njit(error_model="numpy", forceinline=True)
def _usual(lanes, notes, k, window):
    """Make the usual impacts that ended steps; they are then no hits any more."""
    usual, v, impulse, r = bounce(lanes, k, 0)
    if not anywhere(usual):
        return
    lost = 0.5 * (1.0 - r) * v * impulse
    if k.draining:
        note_drain(notes, lanes, k, 0, usual, get(notes, HITS, 0), window)
    sine, cosine, periods = get(lanes, k.turn, 0), get(lanes, k.turn + 1, 0), get(lanes, k.turn + 2, 0)
    add(notes, k, 0, usual, get(lanes, k.which, 0), v, lost, impulse, sine, cosine, periods, window)
    put(lanes, k.hit, 0, select(usual, NOTHING, get(lanes, k.hit, 0)))


@njit(error_model="numpy", forceinline=True)
def _usual_contacts(lanes, notes, k, window):
    """Begin and end the usual contacts with stops that give; they are then no hits any more."""
    hit, which = get(lanes, k.hit, 0), get(lanes, k.which, 0)
    if not anywhere(hit == CONTACT):
        return
    begins, ends, v = meet(lanes, k, 0, hit == CONTACT)
    for y in range(k.stops if anywhere(ends) else 0):
        conclude(notes, lanes, k, 0, ends & (which == float(y)), y, window)
    if anywhere(begins):
        if k.draining:
            note_drain(notes, lanes, k, 0, begins, get(notes, HITS, 0), window)
        now = get(lanes, k.turn, 0), get(lanes, k.turn + 1, 0), get(lanes, k.turn + 2, 0)
        add(notes, k, 0, begins, which, v, 0.0 * v, 0.0 * v, *now, window)
    put(lanes, k.hit, 0, select(begins | ends, NOTHING, hit))


@njit(error_model="numpy")
def _ended(lanes, lane, notes, rows, note, k, room, window):
    """Return why the cell in a lane ends here, or RUNNING; an ended one's note is left."""
    hits, age, made = notes[HITS * LANES + lane], lanes[k.age * LANES + lane], lanes[k.made * LANES + lane]
    lawful = lanes[k.lawless * LANES + lane] == 0.0
    if lawful and hits < window.total and made <= notes[GRANTED * LANES + lane] and age <= QUIET_FOR:
        return RUNNING
    _lift(lanes, lane, rows)
    _lift(notes, lane, note)
    note[MADE] = made
    return ending(rows, k, room, note, window.total)


@compiled
def run_lanes(table, budgets, results, ends, tickets, lanes, owner, notes, ended, rows, note, k, room, window, looks):
    """Step lanes until so many looks are made or cells ended; return how many ended, and how many lanes are busy."""
    number, busy = 0, 0
    for lane in range(LANES):
        if owner[lane] == -1:
            owner[lane] = _seat(table, budgets, tickets, lanes, lane, notes, rows, note, k, room)
    for _ in range(looks):
        for _ in range(LOOK):
            on = leapt = leap_half(lanes, k, 0, may_leap(lanes, k, 0))
            for _ in range(LEAPS):
                if not anywhere(on):
                    break
                on = leap_whole(lanes, k, 0, on)
            if anywhere(leapt):
                leap_half(lanes, k, 0, leapt)
            if k.giving and k.modes == 1:
                leap_within(lanes, k, 0)
            step(lanes, k, 0)
            if not k.thorough:
                _usual(lanes, notes, k, window)
                if k.giving:
                    _usual_contacts(lanes, notes, k, window)
            if anywhere(get(lanes, k.hit, 0) > NOTHING):
                for lane in range(LANES):
                    if lanes[k.hit * LANES + lane] != NOTHING and owner[lane] >= 0:
                        _unusual(lanes, lane, notes, rows, note, k, room, window)
        busy = 0
        for lane in range(LANES):
            if owner[lane] < 0:
                continue
            end = _ended(lanes, lane, notes, rows, note, k, room, window)
            if end != RUNNING:
                results[owner[lane]], ends[owner[lane]] = note, end
                ended[number] = owner[lane]
                number += 1
                owner[lane] = _seat(table, budgets, tickets, lanes, lane, notes, rows, note, k, room)
            busy += owner[lane] >= 0
        if busy == 0 or number + LANES > len(ended):
            break
    return number, busy
