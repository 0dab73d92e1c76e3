"""Run one cell and write down what a window sees: impacts, looks at the mass, sticks."""

from __future__ import annotations

import math

from vibroimpact.backends.lane_runner import LOOK
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

TURN = 2.0 * math.pi
# Places in the recorder's memory, which lets a run be interrupted to make room and taken up again.
U, P, S, C, N, REST_N, REST_PHASE, AGE, STEPS, COUNT, LOOKS = range(11)
MEMORY = 11


@compiled
def begin(cell, memory):
    """Put a cell at its start."""
    h = prepare(cell[0], cell[1], cell[2], cell[3], cell[4], cell[5], cell[6])[0]
    s, c = pair_of(cell[10])
    memory[:] = 0.0
    memory[U], memory[P], memory[S], memory[C], memory[N] = cell[7], -h * cell[8], s, c, cell[9]
    memory[REST_N], memory[REST_PHASE] = cell[9], cell[10]


@compiled
def place(cell, memory):
    """Return the velocity in m/s and the phase that the memory holds."""
    h = prepare(cell[0], cell[1], cell[2], cell[3], cell[4], cell[5], cell[6])[0]
    return -memory[P] / h, phase_of(memory[S], memory[C])


@compiled
def record(cell, memory, impacts, looks, sticks, transient, total, first_n, first_phase, per_period, number, limits):
    """Step on until the window is filled, the motion ends, or a buffer is full.

    Rows written are (n, phase, speed) of impacts numbered above `transient`, (gap to the stop, velocity) of looks, and
    (n, phase, n, phase) of stick and release. `total` ends an impact window; `number` looks end a stroboscopic
    one. Returns the ending and the rows filled of the three buffers; RUNNING asks to be called again.
    """
    chatter, flight_periods, steps_per_impact = limits
    m, c0, k, f, w, r, g = cell[0], cell[1], cell[2], cell[3], cell[4], cell[5], cell[6]
    h, damp, stiff, drive, preload, turn, turn2, tail, sin_r, cos_r = prepare(m, c0, k, f, w, r, g)
    cut = h * cut_velocity(m, k, f, g, cell[7], cell[8], chatter)
    longest, granted = budgets(m, c0, k, w, flight_periods, steps_per_impact)
    granted *= total if number == 0 else (first_n - cell[9]) + 1.0 + number / per_period
    u, p, s, c, n = memory[U], memory[P], memory[S], memory[C], memory[N]
    n_impacts, n_looks, n_sticks = 0, 0, 0
    end = RUNNING
    while n_impacts < len(impacts) and n_looks < len(looks) and n_sticks < len(sticks):
        here = phase_of(s, c)
        u1, p1, s1, c1, n1, event, v, x = advance(
            u, p, s, c, n, damp, stiff, drive, preload, turn, turn2, r, cut, tail, sin_r, cos_r
        )
        rests = event in (RELEASE, STUCK)
        if number > 0:
            # Every look that lies before the end of this step, the end itself excluded.
            if event == RELEASE:
                x = ((n1 - n) + (phase_of(s1, c1) - here)) * TURN / turn
            at_release = u == 0.0 and p == 0.0 and pressed(s, c, drive, preload)[1]
            a = series(u, p, s, c, damp, stiff, drive, preload, turn, turn2, at_release)
            while memory[LOOKS] < number and n_looks < len(looks):
                ahead = ((first_n - n) + ((first_phase - here) + memory[LOOKS] / per_period)) * TURN / turn
                if not (ahead < x or event == STUCK):
                    break
                y, dy = (0.0, 0.0) if rests else evaluate(a, max(ahead, 0.0))
                looks[n_looks, 0], looks[n_looks, 1] = y, 0.0 - dy / h
                n_looks += 1
                memory[LOOKS] += 1.0
            if n_looks == len(looks) or memory[LOOKS] >= number:
                if memory[LOOKS] >= number:
                    if rests:
                        sticks[n_sticks] = (memory[REST_N], memory[REST_PHASE], math.nan, math.nan)
                        n_sticks += 1
                    end = FILLED
                break  # the step is not taken: it is made again, with the same bits, after the buffer is emptied

        kept = number > 0 or memory[COUNT] > transient
        if rests and kept:
            sticks[n_sticks, 0], sticks[n_sticks, 1] = memory[REST_N], memory[REST_PHASE]
            sticks[n_sticks, 2], sticks[n_sticks, 3] = math.nan, math.nan
            if event == RELEASE:
                sticks[n_sticks, 2], sticks[n_sticks, 3] = n1, phase_of(s1, c1)
            n_sticks += 1
        if event == STUCK:
            end = PINNED
            break
        u, p, s, c, n = u1, p1, s1, c1, n1
        memory[STEPS] += 1.0
        memory[AGE] += x
        if u == 0.0 and not rests:
            dwell = tail_duration(v, s, c, damp, drive, preload, turn, tail) if event == CHATTER else 0.0
            there = phase_of(s, c) + dwell * turn / TURN
            memory[REST_N], memory[REST_PHASE] = n + math.floor(there), there - math.floor(there)
        if event == IMPACT:
            memory[AGE] = 0.0
            memory[COUNT] += 1.0
            if memory[COUNT] > transient:
                impacts[n_impacts, 0], impacts[n_impacts, 1], impacts[n_impacts, 2] = n, phase_of(s, c), v / h
                n_impacts += 1
            if number == 0 and memory[COUNT] >= total:
                end = FILLED
                break
        if memory[STEPS] % LOOK == 0.0:
            end = ending(
                (u, p, s, c),
                (damp, stiff, drive, preload, turn),
                cut,
                memory[AGE],
                longest if number == 0 else math.inf,
                memory[STEPS],
                granted,
            )
            if number > 0 and end != SPENT:
                end = RUNNING
            if end != RUNNING:
                break
    memory[U], memory[P], memory[S], memory[C], memory[N] = u, p, s, c, n
    return end, n_impacts, n_looks, n_sticks
