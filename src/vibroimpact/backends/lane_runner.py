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
H, SCALE, FLIGHT, GRANTED, MADE, RATIO, KNOWN = range(7)  # what is noted of the cell in each lane
NEAR = 2e-11  # of V: how close an impact must come back to be looked at
PAYS = 16.0  # sticking cycles left, below which the lanes are faster than a walk of one or two of them
WALK = 50_000  # steps after which a cycle is given up

LOOK = 32  # steps between two looks at whether a cell has ended, counted from its own start
STD, MEAN, LARGEST, RATE, SPAN, STICKS, IMPACTS, STEPS, KNOWN_WITHOUT = range(
    9
)  # columns of what a finished cell hands out


@njit(error_model="numpy")
def _load(lanes, i, cell, chatter):
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
    lanes[rows.CONTACT * LANES + i] = math.inf
    scale = cut / chatter
    lanes[rows.NEAR * LANES + i] = NEAR * scale
    lanes[rows.REF_S * LANES + i] = 9.0  # no reference yet
    lanes[rows.REF_NEXT * LANES + i] = 32.0
    return h, scale


@njit(error_model="numpy")
def _ending(lanes, i, total, longest, steps, granted):
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
        lanes[rows.CONTACT * LANES + i],
        lanes[rows.AGE * LANES + i],
        longest,
        steps,
        granted,
    )


@njit(error_model="numpy")
def _harvest(lanes, i, keep, note, result):
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
def _recurs(lanes, i, total):
    """Return whether lane i may have closed a cycle, and whether walking that cycle alone would pay."""
    count, releases = lanes[rows.COUNT * LANES + i], lanes[rows.RELEASES * LANES + i]
    if lanes[rows.CANDIDATE * LANES + i] > 0.0:
        return count < total
    return releases >= 2.0 and total - count > PAYS * count / releases


@njit(error_model="numpy")
def _begin(lanes, i, cell, notes, total, chatter, flight_periods, steps_per_impact):
    notes[i] = 0.0
    notes[i, H], notes[i, SCALE] = _load(lanes, i, cell, chatter)
    longest, granted = budgets(cell[0], cell[1], cell[2], cell[4], flight_periods, steps_per_impact)
    notes[i, FLIGHT], notes[i, GRANTED] = longest, granted * total


@njit(error_model="numpy")
def _look(lanes, i, notes, transient, total, early_closing, cycle):
    """Close the cell in lane i if its cycle is certain; return why it ended, or RUNNING."""
    notes[i, MADE] += LOOK
    if notes[i, RATIO] == 0.0 and _recurs(lanes, i, total):
        number, periods, made, known = try_to_close(
            lanes, i, transient, total, notes[i, SCALE], WALK, early_closing, cycle
        )
        notes[i, MADE] += made
        if number > 0:
            notes[i, RATIO] = number / periods
            notes[i, KNOWN] = known
    return _ending(lanes, i, total, notes[i, FLIGHT], notes[i, MADE], notes[i, GRANTED])


@compiled
def run_cells(cells, results, ends, transient, total, chatter, flight_periods, steps_per_impact, early_closing):
    """Run every cell, a row of `cells`, to its end.

    `results` (n, COLUMNS) receives the columns above and `ends` why each cell ended. Nothing in a cell depends on its
    lane or its neighbours.
    """
    lanes = np.zeros(ROWS * LANES)
    cycle = np.zeros((LONGEST, 4))
    owner = np.full(LANES, -1)
    notes = np.zeros((LANES, 7))
    following = 0
    busy = 0
    while True:
        for i in range(LANES):
            if owner[i] < 0 and following < len(cells):
                _begin(lanes, i, cells[following], notes, total, chatter, flight_periods, steps_per_impact)
                owner[i] = following
                following += 1
                busy += 1
        if busy == 0:
            return
        step_lanes(lanes, LOOK, transient, total)
        for i in range(LANES):
            j = owner[i]
            end = RUNNING if j < 0 else _look(lanes, i, notes, transient, total, early_closing, cycle)
            if end != RUNNING:
                ends[j] = end
                _harvest(lanes, i, total - transient, notes[i], results[j])
                owner[i] = -1
                busy -= 1
