"""Record what a window samples of a cell, step by step: impacts, looks at the mass, sticks."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from vibroimpact.kernels.advance import CHATTER, IMPACT, LOOK, RELEASE, STUCK, step_at, walk
from vibroimpact.kernels.cell import FILLED, PINNED, RUNNING, SPENT, budgets, cell_of, ending, phase_of, prepare
from vibroimpact.kernels.flight import evaluate, series, whole_step
from vibroimpact.kernels.lanes import CELL, LANES, trace_lanes
from vibroimpact.kernels.law import pressed, tail_duration
from vibroimpact.kernels.leaps import TURN
from vibroimpact.kernels.shared.machine import compiled, inner
from vibroimpact.kernels.state import Constants, Motion, accessors

IDLE = FILLED  # the ending of a lane without a cell
FADED = 1e-280  # square of a speed, in m a step: whole motion at rest at the stop, to any scale
SURELY = 1.0 + 1e-9  # periods from the beginning of a period, past which its end certainly lies


class Plan(NamedTuple):
    """The length of a step, the window, its first look in whole periods and phase, and limits in steps.

    The window is (impacts left out, impacts in all, looks, looks per period): the number of looks ends it if there are
    any, that of impacts otherwise.
    """

    h: float
    transient: float
    total: float
    looks: float
    per_period: float
    first_n: float
    first_phase: float
    longest: float
    granted: float


class Progress(NamedTuple):
    """When the mass last came to rest or hit, steps since an impact and in all, impacts, looks, at how many steps the
    ending is looked for next, and the ending.
    """

    rest_n: float
    rest_phase: float
    age: float
    steps: float
    hits: float
    looked: float
    due: float
    end: float


class Recorder(NamedTuple):
    """A cell's memory, from which an interrupted run is taken up again, and buffers with the rows filled of each.

    Rows are (n, phase, speed) of impacts numbered above the transient, (gap to the stop, velocity) of looks, and
    (n, phase, n, phase) of stick and release. There is room for every look; the other buffers may have to be emptied.
    """

    memory: Any
    impacts: Any
    looks: Any
    sticks: Any
    filled: Any


(
    (load_motion, store_motion),
    (load_constants, store_constants),
    (load_plan, store_plan),
    (load_progress, store_progress),
    MEMORY,
) = accessors(0, 1, Motion, Constants, Plan, Progress)
END = MEMORY - 1  # the place of the ending


@compiled("motions", 0.2)
def begin(row, memory, window, first, limits):
    """Put the cell in a row of a table at its start; `window` and its `first` look are those of a plan."""
    cell = cell_of(row)
    transient, total, looks, per_period = window
    first_n, first_phase = first
    chatter, flight_periods, steps_per_impact = limits
    h, motion, constants = prepare(cell, chatter)
    many = total if looks == 0.0 else (first_n - cell.periods) + 1.0 + looks / per_period
    longest, granted = budgets(cell, flight_periods, steps_per_impact, many)
    if looks > 0.0:
        longest = math.inf
    store_motion(memory, 0, motion)
    store_constants(memory, 0, constants)
    store_plan(memory, 0, Plan(h, transient, total, looks, per_period, first_n, first_phase, longest, granted))
    store_progress(memory, 0, Progress(cell.periods, cell.phase, 0.0, 0.0, 0.0, 0.0, LOOK, RUNNING))


@compiled("motions", 0.1)
def state_of(memory):
    """Return clearance in m, velocity in m/s, whole periods and phase of a cell, and its progress."""
    motion = load_motion(memory, 0)
    velocity = -motion.p / load_plan(memory, 0).h
    return (motion.u, velocity, motion.n, phase_of(motion.s, motion.c)), load_progress(memory, 0)


@inner
def _look(before, after, k, plan, looked, event, x, looks, row):
    """Write down the looks on a step, its end excluded, from a row on; return the looks so far and the steps passed."""
    phase = phase_of(before.s, before.c)
    rests = event in (RELEASE, STUCK)
    if event == RELEASE:
        x = ((after.n - before.n) + (phase_of(after.s, after.c) - phase)) * TURN / k.th
    passed, n = 0.0, before.n
    at_release = before.u == 0.0 and before.p == 0.0 and pressed(before.s, before.c, k)[1]
    while looked < plan.looks:
        since = (plan.first_phase - phase) + looked / plan.per_period
        ahead = ((plan.first_n - n) + since) * TURN / k.th
        if not (ahead < x or event == STUCK):
            break
        while ahead - passed > 1.0 and not rests:
            before, at_release, passed = whole_step(before, k), False, passed + 1.0
        y, dy = (0.0, 0.0) if rests else evaluate(series(before, k, at_release), max(ahead - passed, 0.0))
        looks[row, 0], looks[row, 1] = y, 0.0 - dy / plan.h
        row += 1
        looked += 1.0
    return looked, x


@inner
def read(recorder, trace, rows, width, i):
    """Record what the window samples of the steps in `rows` of a trace, of lane i of `width`.

    A full buffer ends the reading: the memory holds the state from which to step on once there is room.
    """
    # One loop, not a function a step: the arrays in a call are counted, which would take longer than all else.
    memory, impacts, looks, sticks, filled = recorder
    motion, k, plan = load_motion(memory, 0), load_constants(memory, 0), load_plan(memory, 0)
    rest_n, rest_phase, age, steps, hits, looked, due, end = load_progress(memory, 0)
    n_impacts, n_looks, n_sticks = filled[0], filled[1], filled[2]
    for row in range(rows):
        if n_impacts == len(impacts) or n_sticks == len(sticks):
            break
        before = motion
        after, event, v, x = step_at(trace, row, width, i)
        rests = event in (RELEASE, STUCK)
        if plan.looks > 0.0:
            following = (plan.first_n - after.n) + (plan.first_phase + looked / plan.per_period)
            if following < SURELY or event == STUCK:
                former = looked
                looked, x = _look(before, after, k, plan, looked, event, x, looks, n_looks)
                n_looks += int(looked - former)
                if looked >= plan.looks:
                    end = FILLED
        if rests and (plan.looks > 0.0 or hits > plan.transient):
            sticks[n_sticks, 0], sticks[n_sticks, 1] = rest_n, rest_phase
            sticks[n_sticks, 2], sticks[n_sticks, 3] = math.nan, math.nan
            if event == RELEASE and end == RUNNING:
                sticks[n_sticks, 2], sticks[n_sticks, 3] = after.n, phase_of(after.s, after.c)
            n_sticks += 1
        if end == RUNNING and event == STUCK:
            end = PINNED
        if end != RUNNING:
            break
        motion = after
        steps += 1.0
        age += x
        if motion.u == 0.0 and not rests:
            phase = phase_of(motion.s, motion.c)
            dwell = tail_duration(v, motion.s, motion.c, k) if event == CHATTER else 0.0
            settled = phase + dwell * k.th / TURN
            rest_n, rest_phase = motion.n + math.floor(settled), settled - math.floor(settled)
            if event == IMPACT:
                age = 0.0
                hits += 1.0
                if hits > plan.transient:
                    impacts[n_impacts, 0], impacts[n_impacts, 1], impacts[n_impacts, 2] = motion.n, phase, v / plan.h
                    n_impacts += 1
                if plan.looks == 0.0 and hits >= plan.total:
                    end = FILLED
                    break
        if steps >= due:
            due += LOOK
            ended = ending(motion, k, age, plan.longest, steps, plan.granted)
            if plan.looks == 0.0:
                end = ended
            elif steps > plan.granted:  # looks go on past other endings, but not for ever
                end = SPENT
            elif _faded(motion, k):
                while looked < plan.looks:
                    looks[n_looks, 0], looks[n_looks, 1] = 0.0, 0.0
                    n_looks += 1
                    looked += 1.0
                end = FILLED
            if end != RUNNING:
                break
    store_motion(memory, 0, motion)
    store_progress(memory, 0, Progress(rest_n, rest_phase, age, steps, hits, looked, due, end))
    filled[0], filled[1], filled[2] = n_impacts, n_looks, n_sticks


@inner
def _faded(motion, k):
    """Return whether a motion that nothing drives has become too small for its square to be a number."""
    return k.A == 0.0 and k.G == 0.0 and motion.p * motion.p + motion.u * (k.K * motion.u) < FADED


@inner
def room(recorder):
    """Return the number of impacts and sticks that can surely be written down yet."""
    return min(len(recorder.impacts) - recorder.filled[0], len(recorder.sticks) - recorder.filled[2])


@inner
def overhear(recorder, start, trace, rows):
    """Read a walk that another makes from the motion `start`, unless the recorder has ended, or stands elsewhere.

    One whose buffer was full falls behind; it can go on alone from its memory.
    """
    if recorder.memory[END] == RUNNING and load_motion(recorder.memory, 0) == start:
        read(recorder, trace, rows, 1, 0)


@compiled("motions", 1)
def record(recorder, trace, walks):
    """Step on until the window is filled, the motion ends, or a buffer is full, for so many walks; `trace` is room for
    one.
    """
    memory = recorder.memory
    for _ in range(walks):
        if memory[END] != RUNNING or room(recorder) <= 0:
            return
        rows = walk(load_motion(memory, 0), load_constants(memory, 0), trace, len(trace), 0.0)
        read(recorder, trace, rows, 1, 0)


@compiled("motions of many", 1)
def record_lanes(lanes, trace, recorders, walks):
    """Step the lanes until a cell ends, or a buffer of one is full, for so many walks; those that have ended are left
    alone.

    Each lane has its own row of the memory and the buffers of `recorders`.
    """
    memory, impacts, looks, sticks, filled = recorders
    for i in range(LANES):
        for row in range(CELL):
            lanes[row * LANES + i] = memory[i, row]
    halted = False
    for _ in range(walks):
        if halted:
            return
        trace_lanes(lanes, trace)
        for i in range(LANES):
            if memory[i, END] == RUNNING:
                recorder = Recorder(memory[i], impacts[i], looks[i], sticks[i], filled[i])
                read(recorder, trace, len(trace), LANES, i)
                halted |= memory[i, END] != RUNNING or room(recorder) == 0
