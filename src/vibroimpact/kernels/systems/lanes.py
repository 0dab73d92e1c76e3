"""Many systems in lockstep lanes; a lane that ends takes the next cell.

The usual impact is made where the lane stands. All else (several stops at once, contact that is held, weak impacts,
ends) is done on the cell alone: it is lifted out of its lane and put back.
"""

from __future__ import annotations

from numba import njit

from vibroimpact.kernels.cell import QUIET_FOR, RUNNING
from vibroimpact.kernels.machine import compiled, next_ticket
from vibroimpact.kernels.systems.law import begin, bounce
from vibroimpact.kernels.systems.leap import LEAPS, attempt
from vibroimpact.kernels.systems.march import (
    CHATTERED,
    GRANTED,
    HITS,
    LOOK,
    MADE,
    STICKS,
    add,
    add_all,
    ending,
    happen,
)
from vibroimpact.kernels.systems.step import CONTACT, NOTHING, step
from vibroimpact.kernels.systems.tangent import before, confine, cross, deviate, measure_growth, recur
from vibroimpact.kernels.vectors import LANES, group


@njit(error_model="numpy")
def _lift(lanes, lane, rows):
    for row in range(len(rows)):
        rows[row] = lanes[row * LANES + lane]


@njit(error_model="numpy")
def _lower(lanes, lane, rows, number):
    for row in range(number):
        lanes[row * LANES + lane] = rows[row]


@njit(error_model="numpy")
def _seat(table, budgets, tickets, lanes, lane, notes, rows, k, room):
    """Put the next cell into a lane; return its number, or -2 if there is none."""
    cell = next_ticket(tickets)
    if cell >= len(table):
        return -2
    notes[lane] = 0.0
    notes[lane, :MADE] = budgets[cell]
    rows[:] = 0.0
    rows[: k.constants] = table[cell]
    closing = begin(rows, k, room)
    if k.thorough:
        deviate(rows, k)
    if k.thorough and closing:
        confine(rows, k)
    _lower(lanes, lane, rows, k.rows)
    return cell


@njit(error_model="numpy")
def _neighbour(rows, k, room, notes, lane, z, struck, closing, window):
    """Carry the deviation over an event, and count its growth from the first impact of the window on."""
    if struck and room.speed[z] > 0.0:
        cross(rows, k, room, z)
    if closing:
        confine(rows, k)
    if struck and notes[lane, HITS] < window.total:
        measure_growth(rows, k, notes, lane, notes[lane, HITS] > window.transient)


@njit(error_model="numpy")
def _unusual(lanes, lane, notes, rows, k, room, window):
    """Make what ended a lane's step, on the cell alone."""
    _lift(lanes, lane, rows)
    z = int(rows[k.which])
    if k.thorough:
        before(rows, k, room)
    struck, closing = happen(rows, k, room)
    if k.thorough:
        _neighbour(rows, k, room, notes, lane, z, struck, closing, window)
    if struck:
        recorded = add_all(rows, k, room, notes, lane, struck, window)
        if k.thorough and recorded and notes[lane, HITS] <= window.total:
            recur(rows, k, notes, lane, z)
    if k.thorough and closing:
        for y in range(k.stops):
            notes[lane, CHATTERED] += closing >> y & 1 and room.tail[y] > 0.0
    notes[lane, STICKS] += rows[k.closed] > 0.0 and window.transient < notes[lane, HITS] < window.total
    _lower(lanes, lane, rows, k.constants)


@njit(error_model="numpy", forceinline=True)
def _usual(lanes, lane, notes, k, window):
    """Make what ended a lane's step if it is the usual impact; return whether it was."""
    if k.thorough or lanes[k.hit * LANES + lane] != CONTACT:
        return False
    v, impulse = bounce(lanes, k, lane, 0)
    if v > 0.0:
        z, at = int(lanes[k.which * LANES + lane]), k.turn * LANES + lane
        lost = 0.5 * (1.0 - lanes[(k.restitution + z) * LANES + lane]) * v * impulse
        add(notes, lane, v, lost, lanes[at], lanes[at + LANES], lanes[at + 2 * LANES], window)
    return v > 0.0


@njit(error_model="numpy")
def _ended(lanes, lane, notes, rows, k, window):
    """Return why the cell in a lane ends here, or RUNNING."""
    age, made = lanes[k.age * LANES + lane], lanes[k.made * LANES + lane]
    if notes[lane, HITS] < window.total and made <= notes[lane, GRANTED] and age <= QUIET_FOR:
        return RUNNING
    notes[lane, MADE] = made
    _lift(lanes, lane, rows)
    return ending(rows, k, notes, lane, window.total)


@compiled
def run_lanes(table, budgets, results, ends, tickets, lanes, owner, notes, ended, rows, k, room, window, looks):
    """Step lanes until so many looks are made or cells ended; return how many ended, and how many lanes are busy."""
    number, busy = 0, 0
    for lane in range(LANES):
        if owner[lane] == -1:
            owner[lane] = _seat(table, budgets, tickets, lanes, lane, notes, rows, k, room)
    for _ in range(looks):
        for _ in range(LOOK):
            for first in range(0, LANES, group(0)):
                for which in range(LEAPS):
                    attempt(lanes, k, first, 0, which)
                step(lanes, k, first, 0)
                for lane in range(first, first + group(0)):
                    if lanes[k.hit * LANES + lane] == NOTHING or owner[lane] < 0:
                        continue
                    # `room` is not handed to what is inlined: it would be counted there, array by array.
                    if not _usual(lanes, lane, notes, k, window):
                        _unusual(lanes, lane, notes, rows, k, room, window)
        busy = 0
        for lane in range(LANES):
            if owner[lane] < 0:
                continue
            end = _ended(lanes, lane, notes, rows, k, window)
            if end != RUNNING:
                results[owner[lane]], ends[owner[lane]] = notes[lane], end
                ended[number] = owner[lane]
                number += 1
                owner[lane] = _seat(table, budgets, tickets, lanes, lane, notes, rows, k, room)
            busy += owner[lane] >= 0
        if busy == 0 or number + LANES > len(ended):
            break
    return number, busy
