"""Run many cells in lockstep lanes; a lane that ends takes the next cell."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from vibroimpact.backends.closing import LONGEST, try_to_close
from vibroimpact.kernels import lanes as rows
from vibroimpact.kernels.cell import FILLED, RUNNING, budgets, cut_velocity, ending, pair_of, phase_of, prepare
from vibroimpact.kernels.compilation import compiled
from vibroimpact.kernels.lanes import LANES, ROWS, step_lanes

COLUMNS = 9
H, SCALE, FLIGHT, GRANTED, MADE, RATIO, KNOWN = range(7)  # what is noted of a cell beside its lane
NOTES = 7
NEAR = 2e-11  # of V: how close an impact must come back to be looked at
PAYS = 16.0  # sticking cycles left, below which the lanes are faster than a walk of one or two of them
WALK = 50_000  # steps after which a cycle is given up

LOOK = 32  # steps between two looks at whether a cell has ended, counted from its own start
STD, MEAN, LARGEST, RATE, SPAN, STICKS, IMPACTS, STEPS, KNOWN_WITHOUT = range(COLUMNS)  # what a cell hands out


@njit(error_model="numpy")
def begin(lanes, i, note, cell, total, chatter, flight_periods, steps_per_impact):
    """Put a cell at its start into lane i, and begin its note."""
    m, c, k, f, w, r, g = cell[0], cell[1], cell[2], cell[3], cell[4], cell[5], cell[6]
    clearance, velocity, periods, phase = cell[7], cell[8], cell[9], cell[10]
    h, damp, stiff, drive, preload, turn, turn2, tail, sin_r, cos_r = prepare(m, c, k, f, w, r, g)
    s, co = pair_of(phase)
    cut = h * cut_velocity(m, k, f, g, clearance, velocity, chatter)
    for row in range(ROWS):
        lanes[row * LANES + i] = 0.0
    state = (clearance, -h * velocity, s, co, periods)
    for row in range(5):
        lanes[row * LANES + i] = state[row]
    constants = (damp, stiff, drive, preload, turn, turn2, r, cut, tail, sin_r, cos_r)
    for row in range(11):
        lanes[(rows.DAMP + row) * LANES + i] = constants[row]
    scale = cut / chatter
    lanes[rows.NEAR * LANES + i] = NEAR * scale
    lanes[rows.REF_V * LANES + i] = -math.inf  # no reference yet
    lanes[rows.REF_NEXT * LANES + i] = 32.0
    longest, granted = budgets(m, c, k, w, flight_periods, steps_per_impact)
    note[H], note[SCALE], note[FLIGHT], note[GRANTED] = h, scale, longest, granted * total
    note[MADE], note[RATIO], note[KNOWN] = 0.0, 0.0, 0.0


@njit(error_model="numpy")
def ending_of(lanes, i, note, total):
    """Return why the cell in lane i ends here, or RUNNING."""
    if lanes[rows.COUNT * LANES + i] >= total:
        return FILLED
    state = (
        lanes[rows.U * LANES + i],
        lanes[rows.P * LANES + i],
        lanes[rows.S * LANES + i],
        lanes[rows.C * LANES + i],
    )
    constants = (
        lanes[rows.DAMP * LANES + i],
        lanes[rows.STIFF * LANES + i],
        lanes[rows.DRIVE * LANES + i],
        lanes[rows.PRELOAD * LANES + i],
        lanes[rows.TURN * LANES + i],
    )
    return ending(
        state,
        constants,
        lanes[rows.CUT * LANES + i],
        lanes[rows.AGE * LANES + i],
        note[FLIGHT],
        note[MADE],
        note[GRANTED],
    )


@njit(error_model="numpy")
def harvest(lanes, i, note, keep, result):
    """Turn the sums of lane i, in lengths of a step, into indices per second and their window's span in periods."""
    h = note[H]
    first = phase_of(lanes[rows.S0 * LANES + i], lanes[rows.C0 * LANES + i])
    last = phase_of(lanes[rows.S1 * LANES + i], lanes[rows.C1 * LANES + i])
    span = (lanes[rows.N1 * LANES + i] - lanes[rows.N0 * LANES + i]) + (last - first)
    mean = lanes[rows.SUM1 * LANES + i] / keep
    variance = lanes[rows.SUM2 * LANES + i] / keep - mean * mean
    result[STD] = math.sqrt(max(variance, 0.0)) / h
    result[MEAN] = (lanes[rows.SHIFT * LANES + i] + mean) / h
    result[LARGEST] = lanes[rows.LARGEST * LANES + i] / h
    result[RATE] = (keep - 1.0) / span if keep > 1.0 else math.nan
    if note[RATIO] > 0.0:
        result[RATE] = note[RATIO]  # exactly p/n
    result[SPAN] = span
    result[STICKS] = lanes[rows.STUCK_SEEN * LANES + i]
    result[IMPACTS] = lanes[rows.COUNT * LANES + i] - note[KNOWN]
    result[STEPS], result[KNOWN_WITHOUT] = note[MADE], note[KNOWN]


@njit(error_model="numpy")
def may_close(lanes, i, note, total):
    """Return whether lane i may have closed a cycle, and whether walking that cycle alone would pay."""
    if note[RATIO] > 0.0:
        return False
    count, releases = lanes[rows.COUNT * LANES + i], lanes[rows.RELEASES * LANES + i]
    if lanes[rows.CANDIDATE * LANES + i] > 0.0:
        return count < total
    return releases >= 2.0 and total - count > PAYS * count / releases


@njit(error_model="numpy")
def close(lanes, i, note, transient, total, early_closing, cycle):
    """Close the cycle of lane i if it is certain, and note it."""
    number, periods, made, known = try_to_close(lanes, i, transient, total, note[SCALE], WALK, early_closing, cycle)
    note[MADE] += made
    if number > 0:
        note[RATIO] = number / periods
        note[KNOWN] = known


@compiled
def run_cells(cells, results, ends, transient, total, chatter, flight_periods, steps_per_impact, early_closing):
    """Run every cell, a row of `cells`, to its end.

    `results` (n, COLUMNS) receives the columns above and `ends` why each cell ended. Nothing in a cell depends on its
    lane or its neighbours.
    """
    lanes = np.zeros(ROWS * LANES)
    cycle = np.zeros((LONGEST, 4))
    owner = np.full(LANES, -1)
    notes = np.zeros((LANES, NOTES))
    following = 0
    busy = 0
    while True:
        for i in range(LANES):
            if owner[i] < 0 and following < len(cells):
                begin(lanes, i, notes[i], cells[following], total, chatter, flight_periods, steps_per_impact)
                owner[i] = following
                following += 1
                busy += 1
        if busy == 0:
            return
        step_lanes(lanes, LOOK, transient, total)
        for i in range(LANES):
            j = owner[i]
            if j < 0:
                continue
            notes[i, MADE] += LOOK
            if may_close(lanes, i, notes[i], total):
                close(lanes, i, notes[i], transient, total, early_closing, cycle)
            ends[j] = ending_of(lanes, i, notes[i], total)
            if ends[j] != RUNNING:
                harvest(lanes, i, notes[i], total - transient, results[j])
                owner[i] = -1
                busy -= 1
