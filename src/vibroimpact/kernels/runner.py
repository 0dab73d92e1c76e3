"""Run many cells in lockstep lanes; a lane that ends takes the next cell."""

from __future__ import annotations

import math
from typing import Any

from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from vibroimpact.kernels import lanes as rows
from vibroimpact.kernels.cell import FILLED, RUNNING, budgets, cut_velocity, ending, pair_of, phase_of, prepare
from vibroimpact.kernels.closing import try_to_close
from vibroimpact.kernels.compilation import compiled
from vibroimpact.kernels.cycle import (
    IMPACTS,
    LOG_RADIUS,
    MISS,
    PARTING,
    PERIODS,
    RESTS,
    SQUARES,
    UNTOLD,
    describe_turn,
)
from vibroimpact.kernels.lanes import LANES, ROWS, step_lanes
from vibroimpact.kernels.near_miss import NONE
from vibroimpact.kernels.thorough_lanes import FOLD, START, step_thorough_lanes

H, SCALE, FLIGHT, GRANTED, MADE, RATIO, KNOWN = range(7)  # what is noted of a cell beside its lane
NOTES = 7
NEAR = 2e-11  # of V: how close an impact must come back to be looked at
PAYS = 16.0  # sticking cycles left, below which the lanes are faster than a walk of one or two of them
WALK = 50_000  # steps after which a cycle is given up
PERHAPS = 2000  # steps in which a mass that has stuck once may stick again

LOOK = 32  # steps between two looks at whether a cell has ended, counted from its own start
# What a cell hands out.
STD, MEAN, LARGEST, RATE, SPAN, STICKS, COUNTED, STEPS, KNOWN_WITHOUT = range(9)
COLUMNS = 9
# What a thorough one hands out beside it.
EXPONENT, PER_IMPACT, CYCLE_PERIODS, CYCLE_IMPACTS, LOSS, RESTING, SPREAD, MISSED = range(9, 17)
THOROUGH_COLUMNS = 17


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
    lanes[rows.DU * LANES + i], lanes[rows.DP * LANES + i] = START
    lanes[rows.MARGIN * LANES + i] = NONE
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
    result[COUNTED] = lanes[rows.COUNT * LANES + i] - note[KNOWN]
    result[STEPS], result[KNOWN_WITHOUT] = note[MADE], note[KNOWN]


@njit(error_model="numpy")
def harvest_thoroughly(lanes, i, note, facts, cell, keep, result):
    """Turn what a thorough lane and its cycle tell into indices; `harvest` comes first."""
    h = note[H]
    m, c, w, r = cell[0], cell[1], cell[4], cell[5]
    returns = lanes[rows.LET_GO * LANES + i] > 1.0
    stuck = returns or lanes[rows.STUCK_SEEN * LANES + i] > 0.0
    if stuck:
        describe_turn(lanes, i, WALK if returns else PERHAPS, facts)
    period = 2.0 * math.pi / w
    result[CYCLE_PERIODS], result[CYCLE_IMPACTS] = facts[PERIODS], facts[IMPACTS]
    if facts[PERIODS] > 0.0 and facts[PARTING] >= UNTOLD:  # it rests again, but rounding decides when
        result[CYCLE_PERIODS], result[CYCLE_IMPACTS] = 0.0, -1.0
    length = math.hypot(lanes[rows.SUM_S * LANES + i], lanes[rows.SUM_C * LANES + i])
    result[SPREAD] = max(1.0 - length / keep, 0.0)
    lost = 0.5 * m * (1.0 - r) * (1.0 + r) / (h * h)
    if facts[PERIODS] > 0.0:
        result[EXPONENT] = facts[LOG_RADIUS] / (facts[PERIODS] * period)
        result[PER_IMPACT] = facts[LOG_RADIUS] / abs(facts[IMPACTS])
        result[LOSS] = lost * facts[SQUARES] / facts[PERIODS]
        result[RESTING] = facts[RESTS] / facts[PERIODS]
        least = facts[MISS]
    else:
        span, gone = result[SPAN], keep - 1.0
        size0, size1 = lanes[rows.SIZE0 * LANES + i], lanes[rows.SIZE1 * LANES + i]
        growth = -math.inf
        if size1 > 0.0 and not stuck:
            folds = lanes[rows.FOLDS1 * LANES + i] - lanes[rows.FOLDS0 * LANES + i]
            growth = math.log(size1 / size0) + folds * math.log(FOLD) - 0.5 * c / m * span * period
        result[EXPONENT] = growth / (span * period) if gone > 0.0 else math.nan
        result[PER_IMPACT] = growth / gone if gone > 0.0 else math.nan
        first, sum1 = lanes[rows.SHIFT * LANES + i], lanes[rows.SUM1 * LANES + i]
        squares = lanes[rows.SUM2 * LANES + i] + first * (2.0 * sum1 + gone * first)
        result[LOSS] = lost * squares / span if gone > 0.0 else math.nan
        result[RESTING] = 0.0 if gone > 0.0 and not stuck else math.nan
        least = lanes[rows.MARGIN * LANES + i]
    result[MISSED] = least if least < NONE else math.inf


@njit(error_model="numpy")
def may_close(lanes, i, note, total, facts):
    """Return whether lane i may have closed a cycle, and whether walking that cycle alone would pay.

    Thorough lanes are told of every cycle that does not stick: `facts` is None in others.
    """
    if note[RATIO] > 0.0:
        return False
    count, releases = lanes[rows.COUNT * LANES + i], lanes[rows.RELEASES * LANES + i]
    if lanes[rows.CANDIDATE * LANES + i] > 0.0:
        return count < total or facts is not None
    return releases >= 2.0 and total - count > PAYS * count / releases


@njit(error_model="numpy")
def close(lanes, i, note, transient, total, early_closing, cycle, facts):
    """Close the cycle of lane i if it is certain, and note it."""
    number, periods, made, known = try_to_close(
        lanes, i, transient, total, note[SCALE], WALK, early_closing, cycle, facts
    )
    note[MADE] += made
    if number > 0:
        note[RATIO] = number / periods
        note[KNOWN] = known


@intrinsic
def next_ticket(typingctx: Any, counter: Any) -> Any:
    """Return `counter[0]` and add one to it, at one stroke."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, args[0])
        return builder.atomic_rmw("add", array.data, ir.Constant(ir.IntType(64), 1), "monotonic")

    return types.int64(counter), codegen


@compiled
def run_cells(
    cells, results, ends, tickets, seat, finished, transient, total, chatter, flight_periods, steps_per_impact,
    early_closing, looks, facts,
):  # fmt: skip
    """Step the lanes of one thread until it has looked at them `looks` times, or no cell is left.

    `cells`, `results` and `ends` (why each cell ended) are shared by threads, each of which takes the next cell by
    ticket into its own `seat`: lanes, their owners, notes, and room for a cycle. `finished` receives the cells that
    ended. `facts` is None, or room for what thorough lanes are told of cycles. Return how many cells ended, and how
    many lanes are busy. Nothing in a cell depends on its lane, its neighbours or its thread.
    """
    lanes, owner, notes, cycle = seat
    number = 0
    for _ in range(looks):
        busy = 0
        for i in range(LANES):
            if owner[i] < 0:
                following = next_ticket(tickets)
                if following < len(cells):
                    begin(lanes, i, notes[i], cells[following], total, chatter, flight_periods, steps_per_impact)
                    owner[i] = following
                    if facts is not None:
                        facts[i, PERIODS], facts[i, IMPACTS] = 0.0, 0.0
            busy += owner[i] >= 0
        if busy == 0 or number + LANES > len(finished):
            return number, busy
        if facts is None:
            step_lanes(lanes, LOOK, transient, total)
        else:
            step_thorough_lanes(lanes, LOOK, transient, total)
        for i in range(LANES):
            j = owner[i]
            if j < 0:
                continue
            notes[i, MADE] += LOOK
            told = None if facts is None else facts[i]
            if may_close(lanes, i, notes[i], total, told):
                close(lanes, i, notes[i], transient, total, early_closing, cycle, told)
            ends[j] = ending_of(lanes, i, notes[i], total)
            if ends[j] != RUNNING:
                harvest(lanes, i, notes[i], total - transient, results[j])
                if facts is not None:
                    harvest_thoroughly(lanes, i, notes[i], facts[i], cells[j], total - transient, results[j])
                finished[number] = j
                number += 1
                owner[i] = -1
    return number, busy
