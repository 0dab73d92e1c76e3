"""Run many cells in lockstep lanes; a lane that ends takes the next cell."""

from __future__ import annotations

import math

from vibroimpact.kernels import lanes as lane
from vibroimpact.kernels.advance import LOOK, walk
from vibroimpact.kernels.cell import FILLED, QUIET_FOR, RUNNING, budgets, cell_of, ending, prepare
from vibroimpact.kernels.closing import close
from vibroimpact.kernels.cycle import forget
from vibroimpact.kernels.flight import NONE
from vibroimpact.kernels.machine import compiled, copy, inner, next_ticket
from vibroimpact.kernels.observers import DEVIATION, Deviation, Misses, Recurrence
from vibroimpact.kernels.recorder import END, overhear, room
from vibroimpact.kernels.results import (
    ADDED,
    FLIGHT,
    GRANTED,
    RATIO,
    RELEASES,
    SCALE,
    STEPS,
    TURN,
    H,
    harvest,
    harvest_thoroughly,
)

NEAR = 2e-11  # of V: how close an impact must come back to be looked at


@inner
def begin(lanes, i, note, cell, total, chatter, flight_periods, steps_per_impact):
    """Put a cell at its start into lane i, and begin its note."""
    h, motion, constants = prepare(cell, chatter)
    scale = constants.cut / chatter
    for row in range(lane.ROWS):
        lanes[row * lane.LANES + i] = 0.0
    lane.store_motion(lanes, i, motion)
    lane.store_constants(lanes, i, constants)
    lane.store_recurrence(lanes, i, Recurrence(-math.inf, 0.0, 32.0, NEAR * scale, 0.0))  # no reference yet
    lane.store_deviation(lanes, i, Deviation(DEVIATION[0], DEVIATION[1], 0.0))
    lane.store_misses(lanes, i, Misses(NONE))
    longest, granted = budgets(cell, flight_periods, steps_per_impact, total)
    note[H], note[SCALE], note[FLIGHT], note[GRANTED] = h, scale, longest, granted
    note[STEPS], note[RATIO], note[ADDED], note[RELEASES], note[TURN] = 0.0, 0.0, 0.0, 0.0, -1.0


@inner
def move(lanes, owner, notes, facts, i, j):
    """Move the cell in lane i to lane j, which is free."""
    for row in range(lane.ROWS):
        lanes[row * lane.LANES + j] = lanes[row * lane.LANES + i]
    copy(notes[i], notes[j])
    if facts is not None:
        copy(facts[i], facts[j])
    owner[j], owner[i] = owner[i], -1


@inner
def seated(cells, tickets, lanes, owner, notes, facts, total, chatter, flight_periods, steps_per_impact):
    """Give every free lane the next cell, while there is one; return how many lanes are busy, which come first."""
    busy = 0
    for i in range(len(owner)):
        if owner[i] < 0:
            following = next_ticket(tickets)
            if following < len(cells):
                cell = cell_of(cells[following])
                begin(lanes, i, notes[i], cell, total, chatter, flight_periods, steps_per_impact)
                owner[i] = following
                if facts is not None:
                    forget(facts[i])
        if owner[i] >= 0:
            if busy < i:  # no cells wait any more: those that are left close ranks
                move(lanes, owner, notes, facts, i, busy)
            busy += 1
    return busy


@inner(forceinline=True)
def may_end(lanes, i, note, total):
    """Return whether lane i may end here: a look at few of its numbers, before all that `ending_of` asks."""
    motion, k, age = lane.load_motion(lanes, i), lane.load_constants(lanes, i), lane.load_rests(lanes, i).age
    spent = (lane.load_sums(lanes, i).hits >= total) | (note[STEPS] > note[GRANTED])
    return spent | (motion.p == 0.0) | (k.A == 0.0) | (age > min(QUIET_FOR, note[FLIGHT]))


@inner
def ending_of(lanes, i, note, total):
    """Return why the cell in lane i ends here, or RUNNING."""
    if lane.load_sums(lanes, i).hits >= total:
        return FILLED
    age = lane.load_rests(lanes, i).age
    return ending(
        lane.load_motion(lanes, i), lane.load_constants(lanes, i), age, note[FLIGHT], note[STEPS], note[GRANTED]
    )


@inner(forceinline=True)
def may_close(lanes, i, note, total, facts):
    """Return whether lane i has been released anew, or may have closed another cycle.

    Thorough lanes need every cycle that does not stick: `facts` is None in others.
    """
    count, releases = lane.load_sums(lanes, i).hits, lane.load_rests(lanes, i).releases
    recurs = (note[RATIO] == 0.0) & (releases < 2.0) & (lane.load_recurrence(lanes, i).candidate > 0.0)
    return (releases > note[RELEASES]) | (recurs & ((count < total) | (facts is not None)))


@compiled("maps", 7)
def run_cells(
    cells, results, ends, tickets, seat, finished, transient, total, chatter, flight_periods, steps_per_impact,
    early_closing, looks, facts,
):  # fmt: skip
    """Step the lanes of one thread until it has looked at them `looks` times, or no cell is left.

    `cells`, `results` and `ends` (why each cell ended) are shared by threads, each of which takes the next cell by
    ticket into its own `seat`: lanes, their owners, notes, room for a cycle and for a trace. `finished` receives the
    cells that ended. `facts` is None, or room for what thorough lanes learn of cycles. Return how many cells ended, and
    how many lanes are busy. Nothing in a cell depends on its lane, its neighbours or its thread.
    """
    lanes, owner, notes, cycle, trace = seat
    number = 0
    for _ in range(looks):
        busy = seated(cells, tickets, lanes, owner, notes, facts, total, chatter, flight_periods, steps_per_impact)
        if busy == 0 or number + len(owner) > len(finished):
            return number, busy
        if facts is None:
            lane.step_lanes(lanes, busy, LOOK, transient, total)
        else:
            lane.step_thorough_lanes(lanes, busy, LOOK, transient, total)
        for i in range(busy):
            notes[i, STEPS] += LOOK
            closes = may_close(lanes, i, notes[i], total, facts)
            if not (closes | may_end(lanes, i, notes[i], total)):
                continue
            j = owner[i]
            if closes:
                facts_of_cell = None if facts is None else facts[i]
                close(lanes, i, notes[i], transient, total, early_closing, cycle, facts_of_cell, trace, None)
            ends[j] = ending_of(lanes, i, notes[i], total)
            if ends[j] != RUNNING:
                keep = total - transient
                harvest(lanes, i, notes[i], keep, results[j])
                if facts is not None:
                    harvest_thoroughly(lanes, i, notes[i], facts[i], cell_of(cells[j]), keep, results[j], trace)
                finished[number] = j
                number += 1
                owner[i] = -1
    return number, busy


@compiled("motions with their indices", 7)
def follow_cell(
    cells, results, ends, seat, transient, total, chatter, flight_periods, steps_per_impact, early_closing, looks,
    facts, recorder,
):  # fmt: skip
    """Measure the only cell as `run_cells` does, while its recorder reads every step.

    Return after `looks` at it, when it ends, or when a buffer of the recorder is to be emptied; what either has still
    to see, it then sees alone.
    """
    lanes, owner, notes, cycle, trace = seat
    note, cell = notes[0], cell_of(cells[0])
    facts_of_cell = None if facts is None else facts[0]
    if owner[0] < 0:
        begin(lanes, 0, note, cell, total, chatter, flight_periods, steps_per_impact)
        owner[0] = 0
    k = lane.load_constants(lanes, 0)
    for _ in range(looks):
        if ends[0] != RUNNING or (room(recorder) <= LOOK and recorder.memory[END] == RUNNING):
            return
        steps = 0
        while steps < LOOK:
            start = lane.load_motion(lanes, 0)
            rows = walk(start, k, trace, LOOK - steps, 0.0)
            overhear(recorder, start, trace, rows)
            for row in range(rows):
                lane.observe_walked(lanes, 0, k, trace, row, transient, total, facts)
            steps += rows
        note[STEPS] += LOOK
        if may_close(lanes, 0, note, total, facts_of_cell):
            close(lanes, 0, note, transient, total, early_closing, cycle, facts_of_cell, trace, recorder)
        ends[0] = ending_of(lanes, 0, note, total)
        if ends[0] != RUNNING:
            harvest(lanes, 0, note, total - transient, results[0])
            if facts is not None:
                harvest_thoroughly(lanes, 0, note, facts[0], cell, total - transient, results[0], trace)
