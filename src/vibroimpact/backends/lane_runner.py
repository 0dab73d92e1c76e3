"""Run many cells in lockstep lanes; a lane that ends takes the next cell."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from vibroimpact.kernels import lanes as rows
from vibroimpact.kernels.cell import FILLED, RUNNING, budgets, cut_velocity, ending, pair_of, phase_of, prepare
from vibroimpact.kernels.compilation import compiled
from vibroimpact.kernels.lanes import LANES, ROWS, step_lanes

LOOK = 32  # steps between two looks at whether a cell has ended, counted from its own start
STD, MEAN, LARGEST, RATE, SPAN, STICKS, IMPACTS = range(7)  # columns of what a finished cell hands out


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
    return h


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
def _harvest(lanes, i, keep, h, result):
    """Turn the sums of lane i, in lengths of a step, into indices per second and their window's span in periods."""
    first = phase_of(lanes[rows.S0 * LANES + i], lanes[rows.C0 * LANES + i])
    last = phase_of(lanes[rows.S1 * LANES + i], lanes[rows.C1 * LANES + i])
    span = (lanes[rows.N1 * LANES + i] - lanes[rows.N0 * LANES + i]) + (last - first)
    mean = lanes[rows.SUM1 * LANES + i] / keep
    variance = lanes[rows.SUM2 * LANES + i] / keep - mean * mean
    result[STD] = math.sqrt(max(variance, 0.0)) / h
    result[MEAN] = (lanes[rows.SHIFT * LANES + i] + mean) / h
    result[LARGEST] = lanes[rows.LARGEST * LANES + i] / h
    result[RATE] = (keep - 1.0) / span if keep > 1.0 else math.nan
    result[SPAN] = span
    result[STICKS] = lanes[rows.STUCK_SEEN * LANES + i]
    result[IMPACTS] = lanes[rows.COUNT * LANES + i]


@compiled
def run_cells(cells, results, ends, steps_made, transient, total, chatter, flight_periods, steps_per_impact):
    """Run every cell, a row of `cells`, to its end.

    `results` (n, 7) receives the columns above, `ends` why each cell ended, `steps_made` its certified steps.
    Nothing in a cell depends on its lane or its neighbours.
    """
    lanes = np.zeros(ROWS * LANES)
    owner = np.full(LANES, -1)
    made = np.zeros(LANES)
    limits = np.zeros((LANES, 3))  # longest flight and steps granted, and the length h of a step
    following = 0
    busy = 0
    while True:
        for i in range(LANES):
            if owner[i] >= 0 or following == len(cells):
                continue
            cell = cells[following]
            limits[i, 2] = _load(lanes, i, cell, chatter)
            longest, granted = budgets(cell[0], cell[1], cell[2], cell[4], flight_periods, steps_per_impact)
            limits[i, 0], limits[i, 1] = longest, granted * total
            made[i] = 0.0
            owner[i] = following
            following += 1
            busy += 1
        if busy == 0:
            return
        step_lanes(lanes, LOOK, transient, total)
        for i in range(LANES):
            j = owner[i]
            made[i] += LOOK
            end = RUNNING if j < 0 else _ending(lanes, i, total, limits[i, 0], made[i], limits[i, 1])
            if end != RUNNING:
                ends[j], steps_made[j] = end, made[i]
                _harvest(lanes, i, total - transient, limits[i, 2], results[j])
                owner[i] = -1
                busy -= 1
