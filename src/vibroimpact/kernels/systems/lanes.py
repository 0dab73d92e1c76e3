"""Many systems in lockstep lanes; a lane that ends takes the next cell.

The usual impact is made in all lanes at once. All else (several stops at once, contact that is held, weak impacts,
ends) is done on the cell alone: it is lifted out of its lane and put back.
"""

from __future__ import annotations

import math

from vibroimpact.kernels.advance import LOOK
from vibroimpact.kernels.cell import PINNED, QUIET_FOR, RUNNING
from vibroimpact.kernels.shared.deferred import deferred
from vibroimpact.kernels.shared.machine import compiled, copy, inner, next_ticket
from vibroimpact.kernels.shared.vectors import LANES, anywhere, get
from vibroimpact.kernels.systems.closing import close, stays_pressed
from vibroimpact.kernels.systems.event import FIRST_LOOK, go_on, lift, lower, occur
from vibroimpact.kernels.systems.law import begin
from vibroimpact.kernels.systems.layout import NOTHING
from vibroimpact.kernels.systems.march import (
    DUE,
    EACH,
    GRANTED,
    HITS,
    MISS,
    NEXT,
    RETURNED,
    STEPS,
    SUMS,
    WATCHED,
    ending,
    note_misses,
    note_rests,
)
from vibroimpact.kernels.systems.pressed import is_pressed, repetition_is_due
from vibroimpact.kernels.systems.tangent import confine, deviate


@inner(inline="always")
def seat(table, budgets, tickets, lanes, lane, notes, rows, note, k, room, window):
    """Put the next cell into a lane; return its number, or -2 if there is none."""
    cell = next_ticket(tickets)
    if cell >= len(table):
        rows[:] = 0.0  # what has ended would slow its neighbours
        lower(lanes, lane, rows, k.rows)
        return -2
    note[:] = 0.0
    copy(budgets[cell], note)
    note[WATCHED], note[NEXT] = -math.inf, FIRST_LOOK
    rows[:] = 0.0
    copy(table[cell], rows)
    rows[k.pace] = 1.0
    closing = begin(rows, k, room)
    if k.thorough:
        _begin_thoroughly(rows, k, room, note, closing, window)
    lower(lanes, lane, rows, k.rows)
    lower(notes, lane, note, len(note))
    return cell


@deferred("neighbours of motions", 0.5)
def _begin_thoroughly(rows, k, room, note, closing, window):
    """Begin with a deviation, and to look for misses and rests."""
    deviate(rows, k)
    note[SUMS + MISS :: EACH] = math.inf
    note_misses(rows, note, k, None, True, window)
    if closing:
        confine(rows, k)
        note_rests(rows, k, room, note, int(0.0), closing, False)


@inner(inline="always")
def unusual(lanes, lane, notes, rows, note, k, room, window):
    """Make what ended a lane's step, on the cell alone."""
    held = lanes[k.closed * LANES + lane] > 0.0  # what holds is zero else, here and in the lane
    lift(lanes, lane, rows, k.fixed if held else k.held)
    lift(notes, lane, note, len(note))
    occur(rows, k, room, note, window)
    lower(lanes, lane, rows, k.fixed if held or rows[k.closed] > 0.0 else k.held)
    lower(notes, lane, note, len(note))


@inner(inline="always")
def _close(lanes, lane, notes, rows, note, k, room, window, alone):
    """Look whether the cell in a lane has settled on a cycle; if so, leave out what is known."""
    lift(lanes, lane, rows, k.fixed)
    lift(notes, lane, note, len(note))
    close(rows, k, room, note, window, alone)
    lower(lanes, lane, rows, k.fixed)
    lower(notes, lane, note, len(note))


@inner(inline="always")
def _ended(lanes, lane, notes, rows, note, k, room, window, alone):
    """Return the reason why the cell in a lane ends here, or RUNNING; an ended one's note is left."""
    hits, age, steps = notes[HITS * LANES + lane], lanes[k.age * LANES + lane], lanes[k.steps * LANES + lane]
    lawful = lanes[k.lawless * LANES + lane] == 0.0
    still = k.compliant and repetition_is_due(notes, LANES, lane, lanes[(k.turn + 2) * LANES + lane])
    if lawful and hits < window.total and steps <= notes[GRANTED * LANES + lane] and age <= QUIET_FOR and not still:
        return RUNNING
    lift(lanes, lane, rows, k.fixed)
    lift(notes, lane, note, len(note))
    note[STEPS] = steps
    end = ending(rows, k, room, note, window.total)
    notes[DUE * LANES + lane] = note[DUE]
    if end == RUNNING and still and is_pressed(rows, k) and stays_pressed(rows, k, room, note, window, alone):
        return PINNED
    return end


@compiled("maps of systems", 3)
def run_lanes(
    table, budgets, results, finals, ends, tickets, lanes, owner, notes, ended, cells, note, k, room, window, alone,
    looks,
):  # fmt: skip
    """Step lanes until so many looks are made or cells ended; return how many ended, and how many lanes are busy.

    `finals` take the state in which a cell ends, or none if they are empty.
    """
    number, busy = 0, 0
    for lane in range(LANES):
        if owner[lane] == -1:
            owner[lane] = seat(table, budgets, tickets, lanes, lane, notes, cells[lane], note, k, room, window)
    for _ in range(looks):
        for _ in range(LOOK):
            go_on(lanes, notes, k, window)
            if anywhere(get(lanes, k.hit, 0) > NOTHING):
                for lane in range(LANES):
                    if lanes[k.hit * LANES + lane] != NOTHING and owner[lane] >= 0:
                        unusual(lanes, lane, notes, cells[lane], note, k, room, window)
        busy = 0
        for lane in range(LANES):
            if owner[lane] < 0:
                continue
            if window.closes and notes[RETURNED * LANES + lane] > 0.0:
                _close(lanes, lane, notes, cells[lane], note, k, room, window, alone)
            end = _ended(lanes, lane, notes, cells[lane], note, k, room, window, alone)
            if end != RUNNING:
                copy(note, results[owner[lane]])
                for row in range(finals.shape[1]):  # eta, rate and turn
                    finals[owner[lane], row] = cells[lane][k.eta + row]
                ends[owner[lane]] = end
                ended[number] = owner[lane]
                number += 1
                owner[lane] = seat(table, budgets, tickets, lanes, lane, notes, cells[lane], note, k, room, window)
            busy += owner[lane] >= 0
        if busy == 0 or number + LANES > len(ended):
            break
    return number, busy
