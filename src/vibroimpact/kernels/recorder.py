"""Write down what a window sees of a cell, step by step: impacts, looks at the mass, sticks."""

from __future__ import annotations

import math

from numba import njit

from vibroimpact.kernels.advance import CHATTER, IMPACT, RELEASE, STUCK, advance
from vibroimpact.kernels.cell import (
    FILLED,
    PINNED,
    RUNNING,
    SPENT,
    budgets,
    cut_velocity,
    ending,
    pair_of,
    phase_of,
    prepare,
)
from vibroimpact.kernels.chatter import pressed, tail_duration
from vibroimpact.kernels.compilation import compiled
from vibroimpact.kernels.flight import evaluate, series
from vibroimpact.kernels.lanes import LANES
from vibroimpact.kernels.runner import LOOK
from vibroimpact.kernels.traced_lanes import CELL, TRACE, trace_lanes

TURN = 2.0 * math.pi
# Places in a recorder's memory, which lets a run be interrupted to make room and taken up again: the state and the
# constants in the order of a lane, then the length of a step, limits, the first look, and what was seen.
U, P, S, C, N, DAMP, STIFF, DRIVE, PRELOAD, OMEGA, OMEGA2, REST, CUT, TAIL, SIN_R, COS_R = range(16)
H, LONGEST, GRANTED, FIRST_N, FIRST_PHASE, REST_N, REST_PHASE, AGE, STEPS, COUNT, LOOKS, DUE = range(16, 28)
MEMORY = 28
IDLE = FILLED  # the ending of a lane without a cell
FADED = 1e-280  # square of a speed, in m a step: whole motion at rest at the stop, to any scale
SURELY = 1.0 + 1e-9  # periods from the beginning of a period, past which its end certainly lies


@compiled
def begin(cell, memory, window, first, limits):
    """Put a cell at its start.

    `window` is (impacts left out, impacts in all, looks, looks a period): the number of looks ends it if there are
    any, that of impacts otherwise. `first` is when the first look is: whole periods and phase.
    """
    m, c0, k, f, w, r, g = cell[0], cell[1], cell[2], cell[3], cell[4], cell[5], cell[6]
    _, total, number, per_period = window
    chatter, flight_periods, steps_per_impact = limits
    h, damp, stiff, drive, preload, turn, turn2, tail, sin_r, cos_r = prepare(m, c0, k, f, w, r, g)
    s, c = pair_of(cell[10])
    memory[:] = 0.0
    memory[U], memory[P], memory[S], memory[C], memory[N] = cell[7], -h * cell[8], s, c, cell[9]
    memory[REST_N], memory[REST_PHASE] = cell[9], cell[10]
    memory[DUE] = LOOK
    cut = h * cut_velocity(m, k, f, g, cell[7], cell[8], chatter)
    constants = (damp, stiff, drive, preload, turn, turn2, r, cut, tail, sin_r, cos_r, h)
    for row in range(12):
        memory[DAMP + row] = constants[row]
    longest, granted = budgets(m, c0, k, w, flight_periods, steps_per_impact)
    granted *= total if number == 0.0 else (first[0] - cell[9]) + 1.0 + number / per_period
    memory[LONGEST] = longest if number == 0.0 else math.inf
    memory[GRANTED], memory[FIRST_N], memory[FIRST_PHASE] = granted, first[0], first[1]


@compiled
def place(memory):
    """Return the velocity in m/s and the phase that the memory holds."""
    return -memory[P] / memory[H], phase_of(memory[S], memory[C])


@njit(error_model="numpy")
def look(memory, after, event, x, window, looks, n_looks):
    """Write down the looks before the end of a step that is not taken yet, the end itself excluded.

    Return the rows filled by now, and the steps passed.
    """
    _, _, number, per_period = window
    u, p, s, c, n = memory[U], memory[P], memory[S], memory[C], memory[N]
    _, _, s1, c1, n1 = after
    damp, stiff, drive, preload = memory[DAMP], memory[STIFF], memory[DRIVE], memory[PRELOAD]
    turn, turn2 = memory[OMEGA], memory[OMEGA2]
    here = phase_of(s, c)
    rests = event in (RELEASE, STUCK)
    if event == RELEASE:
        x = ((n1 - n) + (phase_of(s1, c1) - here)) * TURN / turn
    at_release = u == 0.0 and p == 0.0 and pressed(s, c, drive, preload)[1]
    a = series(u, p, s, c, damp, stiff, drive, preload, turn, turn2, at_release)
    while memory[LOOKS] < number and n_looks < len(looks):
        since = (memory[FIRST_PHASE] - here) + memory[LOOKS] / per_period
        ahead = ((memory[FIRST_N] - n) + since) * TURN / turn
        if not (ahead < x or event == STUCK):
            break
        y, dy = (0.0, 0.0) if rests else evaluate(a, max(ahead, 0.0))
        looks[n_looks, 0], looks[n_looks, 1] = y, 0.0 - dy / memory[H]
        n_looks += 1
        memory[LOOKS] += 1.0
    return n_looks, x


@njit(error_model="numpy")
def rest(memory, s, c, n, event, sticks, filled):
    """Write down a stick of the resting mass, and its release if that is known."""
    at = filled[2]
    sticks[at, 0], sticks[at, 1] = memory[REST_N], memory[REST_PHASE]
    sticks[at, 2], sticks[at, 3] = math.nan, math.nan
    if event == RELEASE:
        sticks[at, 2], sticks[at, 3] = n, phase_of(s, c)
    filled[2] = at + 1


@njit(error_model="numpy")
def read(trace, width, i, memory, window, impacts, looks, sticks, filled):
    """Write down what a window sees of the steps in a trace, of lane i of `width`; return the ending, or RUNNING.

    Rows written are (n, phase, speed) of impacts numbered above the transient, (gap to the stop, velocity) of looks,
    and (n, phase, n, phase) of stick and release; `filled` counts them. A full buffer ends the reading: the memory
    holds the state from which to step on once there is room.
    """
    # One loop, not a function a step: the arrays in a call are counted, which would take longer than all else.
    transient, total, number, per_period = window
    for k in range(len(trace)):
        if filled[0] == len(impacts) or filled[1] == len(looks) or filled[2] == len(sticks):
            return RUNNING
        u, p, s = trace[k, i], trace[k, width + i], trace[k, 2 * width + i]
        c, n, event = trace[k, 3 * width + i], trace[k, 4 * width + i], trace[k, 5 * width + i]
        v, x = trace[k, 6 * width + i], trace[k, 7 * width + i]
        rests = event in (RELEASE, STUCK)
        if number > 0.0:
            following = (memory[FIRST_N] - n) + (memory[FIRST_PHASE] + memory[LOOKS] / per_period)
            if following < SURELY or event == STUCK:
                filled[1], x = look(memory, (u, p, s, c, n), event, x, window, looks, filled[1])
                if memory[LOOKS] >= number:
                    if rests:
                        rest(memory, s, c, n, STUCK, sticks, filled)
                    return FILLED
        if rests and (number > 0.0 or memory[COUNT] > transient):
            rest(memory, s, c, n, event, sticks, filled)
        if event == STUCK:
            return PINNED
        memory[U], memory[P], memory[S], memory[C], memory[N] = u, p, s, c, n
        memory[STEPS] += 1.0
        memory[AGE] += x
        if u == 0.0 and not rests:
            phase = phase_of(s, c)
            turn = memory[OMEGA]
            dwell = 0.0
            if event == CHATTER:
                dwell = tail_duration(v, s, c, memory[DAMP], memory[DRIVE], memory[PRELOAD], turn, memory[TAIL])
            there = phase + dwell * turn / TURN
            memory[REST_N], memory[REST_PHASE] = n + math.floor(there), there - math.floor(there)
            if event == IMPACT:
                memory[AGE] = 0.0
                memory[COUNT] += 1.0
                if memory[COUNT] > transient:
                    at = filled[0]
                    impacts[at, 0], impacts[at, 1], impacts[at, 2] = n, phase, v / memory[H]
                    filled[0] = at + 1
                if number == 0.0 and memory[COUNT] >= total:
                    return FILLED
        if memory[STEPS] >= memory[DUE]:
            memory[DUE] += LOOK
            end = _ending(memory, number)
            if end != RUNNING:
                return end
            if number > 0.0 and _faded(memory):
                while memory[LOOKS] < number:
                    looks[filled[1], 0], looks[filled[1], 1] = 0.0, 0.0
                    filled[1] += 1
                    memory[LOOKS] += 1.0
                return FILLED
    return RUNNING


@njit(error_model="numpy")
def _ending(memory, number):
    end = ending(
        (memory[U], memory[P], memory[S], memory[C]),
        (memory[DAMP], memory[STIFF], memory[DRIVE], memory[PRELOAD], memory[OMEGA]),
        memory[CUT],
        memory[AGE],
        memory[LONGEST],
        memory[STEPS],
        memory[GRANTED],
    )
    return end if number == 0.0 or end == SPENT else RUNNING


@njit(error_model="numpy")
def _faded(memory):
    """Return whether a motion that nothing drives has become too small for its square to be a number."""
    u, p = memory[U], memory[P]
    return memory[DRIVE] == 0.0 and memory[PRELOAD] == 0.0 and p * p + u * (memory[STIFF] * u) < FADED


@compiled
def record(memory, window, trace, buffers, filled):
    """Step on until the window is filled, the motion ends, or a buffer is full.

    `trace` has room for LOOK steps. Returns the ending; RUNNING asks to be called again with buffers emptied.
    """
    impacts, looks, sticks = buffers
    end = RUNNING
    while end == RUNNING and filled[0] < len(impacts) and filled[1] < len(looks) and filled[2] < len(sticks):
        u, p, s, c, n = memory[U], memory[P], memory[S], memory[C], memory[N]
        for k in range(len(trace)):
            u, p, s, c, n, event, v, x = advance(
                u, p, s, c, n,
                memory[DAMP], memory[STIFF], memory[DRIVE], memory[PRELOAD], memory[OMEGA], memory[OMEGA2],
                memory[REST], memory[CUT], memory[TAIL], memory[SIN_R], memory[COS_R],
            )  # fmt: skip
            step = (u, p, s, c, n, event, v, x)
            for j in range(TRACE):
                trace[k, j] = step[j]
        end = read(trace, 1, 0, memory, window, impacts, looks, sticks, filled)
    return end


@compiled
def record_lanes(lanes, trace, memory, ends, window, impacts, looks, sticks, filled):
    """Step the lanes until a cell ends, or a buffer of one is full.

    Each lane has its own row of `memory`, from which it begins, of `ends`, of the three buffers and of `filled`; those
    that have ended are left alone.
    """
    for i in range(LANES):
        for row in range(CELL):
            lanes[row * LANES + i] = memory[i, row]
    halted = False
    while not halted:
        trace_lanes(lanes, trace)
        for i in range(LANES):
            if ends[i] == RUNNING:
                ends[i] = read(trace, LANES, i, memory[i], window, impacts[i], looks[i], sticks[i], filled[i])
                full = filled[i, 0] == impacts.shape[1] or filled[i, 2] == sticks.shape[1]
                halted |= ends[i] != RUNNING or full
