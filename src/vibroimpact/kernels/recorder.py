"""Write down what a window sees of a cell, step by step: impacts, looks at the mass, sticks."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba import njit

from vibroimpact.kernels.advance import CHATTER, IMPACT, RELEASE, STUCK
from vibroimpact.kernels.cell import FILLED, PINNED, RUNNING, SPENT, budgets, cell_of, ending, phase_of, prepare
from vibroimpact.kernels.chatter import pressed, tail_duration
from vibroimpact.kernels.compilation import compiled
from vibroimpact.kernels.flight import evaluate, series
from vibroimpact.kernels.lanes import CELL, LANES, trace_lanes
from vibroimpact.kernels.state import Constants, Motion, kept
from vibroimpact.kernels.walk import LOOK, walk

TURN = 2.0 * math.pi
# Places in a recorder's memory, which lets a run be interrupted to make room and taken up again: the motion and the
# constants in the order of a lane, then the length of a step, limits, the first look, and what was seen.
U, P, S, C, N = range(5)
H, LONGEST, GRANTED, FIRST_N, FIRST_PHASE, REST_N, REST_PHASE, AGE, STEPS, COUNT, LOOKS, DUE = range(CELL, CELL + 12)
MEMORY = CELL + 12
IDLE = FILLED  # the ending of a lane without a cell
FADED = 1e-280  # square of a speed, in m a step: whole motion at rest at the stop, to any scale
SURELY = 1.0 + 1e-9  # periods from the beginning of a period, past which its end certainly lies

_load_motion, _store_motion = kept(Motion, 0, 1)
_load_constants, _store_constants = kept(Constants, len(Motion._fields), 1)


@compiled
def begin(row, memory, window, first, limits):
    """Put the cell in a row of a table at its start.

    `window` is (impacts left out, impacts in all, looks, looks per period): the number of looks ends it if there are
    any, that of impacts otherwise. `first` is when the first look is: whole periods and phase.
    """
    cell = cell_of(row)
    _, total, number, per_period = window
    chatter, flight_periods, steps_per_impact = limits
    h, motion, constants = prepare(cell, chatter)
    memory[:] = 0.0
    _store_motion(memory, 0, motion)
    _store_constants(memory, 0, constants)
    memory[H] = h
    memory[REST_N], memory[REST_PHASE] = cell.periods, cell.phase
    memory[DUE] = LOOK
    longest, granted = budgets(cell, flight_periods, steps_per_impact)
    granted *= total if number == 0.0 else (first[0] - cell.periods) + 1.0 + number / per_period
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
    motion, k = _load_motion(memory, 0), _load_constants(memory, 0)
    here = phase_of(motion.s, motion.c)
    rests = event in (RELEASE, STUCK)
    if event == RELEASE:
        x = ((after.n - motion.n) + (phase_of(after.s, after.c) - here)) * TURN / k.th
    at_release = motion.u == 0.0 and motion.p == 0.0 and pressed(motion.s, motion.c, k)[1]
    a = series(motion, k, at_release)
    while memory[LOOKS] < number and n_looks < len(looks):
        since = (memory[FIRST_PHASE] - here) + memory[LOOKS] / per_period
        ahead = ((memory[FIRST_N] - motion.n) + since) * TURN / k.th
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
def read(trace, rows, width, i, memory, window, impacts, looks, sticks, filled):
    """Write down what a window sees of the steps in `rows` of a trace, of lane i of `width`.

    Return the ending, or RUNNING.

    Rows written are (n, phase, speed) of impacts numbered above the transient, (gap to the stop, velocity) of looks,
    and (n, phase, n, phase) of stick and release; `filled` counts them. A full buffer ends the reading: the memory
    holds the state from which to step on once there is room.
    """
    # One loop, not a function a step: the arrays in a call are counted, which would take longer than all else.
    transient, total, number, per_period = window
    k = _load_constants(memory, 0)
    for at in range(rows):
        if filled[0] == len(impacts) or filled[1] == len(looks) or filled[2] == len(sticks):
            return RUNNING
        u, p, s = trace[at, i], trace[at, width + i], trace[at, 2 * width + i]
        c, n, event = trace[at, 3 * width + i], trace[at, 4 * width + i], trace[at, 5 * width + i]
        v, x = trace[at, 6 * width + i], trace[at, 7 * width + i]
        rests = event in (RELEASE, STUCK)
        if number > 0.0:
            following = (memory[FIRST_N] - n) + (memory[FIRST_PHASE] + memory[LOOKS] / per_period)
            if following < SURELY or event == STUCK:
                filled[1], x = look(memory, Motion(u, p, s, c, n), event, x, window, looks, filled[1])
                if memory[LOOKS] >= number:
                    if rests:
                        rest(memory, s, c, n, STUCK, sticks, filled)
                    return FILLED
        if rests and (number > 0.0 or memory[COUNT] > transient):
            rest(memory, s, c, n, event, sticks, filled)
        if event == STUCK:
            return PINNED
        _store_motion(memory, 0, Motion(u, p, s, c, n))
        memory[STEPS] += 1.0
        memory[AGE] += x
        if u == 0.0 and not rests:
            phase = phase_of(s, c)
            dwell = tail_duration(v, s, c, k) if event == CHATTER else 0.0
            there = phase + dwell * k.th / TURN
            memory[REST_N], memory[REST_PHASE] = n + math.floor(there), there - math.floor(there)
            if event == IMPACT:
                memory[AGE] = 0.0
                memory[COUNT] += 1.0
                if memory[COUNT] > transient:
                    impacts[filled[0], 0], impacts[filled[0], 1], impacts[filled[0], 2] = n, phase, v / memory[H]
                    filled[0] += 1
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


class Recorder(NamedTuple):
    """The recorder of one cell: what `read` takes, and in `ends` the ending, or RUNNING."""

    memory: Any
    window: Any
    impacts: Any
    looks: Any
    sticks: Any
    filled: Any
    ends: Any


@njit(error_model="numpy")
def overhear(recorder, start, trace, rows):
    """Read a walk that another makes from the motion `start`, unless the recorder has ended, or stands elsewhere.

    One whose buffer was full falls behind; it can go on alone from its memory.
    """
    memory, window, impacts, looks, sticks, filled, ends = recorder
    if ends[0] == RUNNING and _load_motion(memory, 0) == start:
        ends[0] = read(trace, rows, 1, 0, memory, window, impacts, looks, sticks, filled)


@njit(error_model="numpy")
def has_room(recorder):
    """Return whether the recorder can read LOOK steps more without falling behind, or has ended."""
    free = min(len(recorder.impacts) - recorder.filled[0], len(recorder.sticks) - recorder.filled[2])
    return free > LOOK or recorder.ends[0] != RUNNING


@njit(error_model="numpy")
def _ending(memory, number):
    motion, k = _load_motion(memory, 0), _load_constants(memory, 0)
    end = ending(motion, k, memory[AGE], memory[LONGEST], memory[STEPS], memory[GRANTED])
    return end if number == 0.0 or end == SPENT else RUNNING


@njit(error_model="numpy")
def _faded(memory):
    """Return whether a motion that nothing drives has become too small for its square to be a number."""
    motion, k = _load_motion(memory, 0), _load_constants(memory, 0)
    return k.A == 0.0 and k.G == 0.0 and motion.p * motion.p + motion.u * (k.K * motion.u) < FADED


@compiled
def record(memory, window, trace, buffers, filled):
    """Step on until the window is filled, the motion ends, or a buffer is full.

    `trace` is room for a walk. Returns the ending; RUNNING asks to be called again with buffers emptied.
    """
    impacts, looks, sticks = buffers
    end = RUNNING
    while end == RUNNING and filled[0] < len(impacts) and filled[1] < len(looks) and filled[2] < len(sticks):
        rows = walk(_load_motion(memory, 0), _load_constants(memory, 0), trace, len(trace), 0)
        end = read(trace, rows, 1, 0, memory, window, impacts, looks, sticks, filled)
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
                ends[i] = read(
                    trace, len(trace), LANES, i, memory[i], window, impacts[i], looks[i], sticks[i], filled[i]
                )
                full = filled[i, 0] == impacts.shape[1] or filled[i, 2] == sticks.shape[1]
                halted |= ends[i] != RUNNING or full
