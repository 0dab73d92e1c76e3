"""Many cells in lockstep: one masked step of every lane, again and again.

A lane's numbers stand in one flat array, row after row of LANES entries, so that the compiler sees constant distances
between all of them and turns the inner loop into vector instructions.

Lanes are stepped in three ways, by the same operations, so that the bits of the motion are the same: plain ones keep
what the velocities of impacts give, thorough ones all that can be observed, traced ones leave a record of every step.
"""

from __future__ import annotations

from numba import njit

from vibroimpact.kernels.advance import STATE, TRACE, advance, step_at
from vibroimpact.kernels.leaps import leap
from vibroimpact.kernels.machine import BLOCK, each_lane, inner
from vibroimpact.kernels.observers import (
    Deviation,
    Misses,
    Phases,
    Recurrence,
    Rests,
    Stamp,
    Sums,
    Turn,
    count_impact,
    deviation,
    misses,
    phases,
    recurrence,
    rests,
    stamp,
    sums,
    turn,
)
from vibroimpact.kernels.state import Constants, Motion, kept

LANES = 32

(load_motion, store_motion), (load_constants, store_constants), CELL = kept(0, LANES, Motion, Constants)
(
    (load_sums, store_sums),
    (load_first, store_first),
    (load_last, store_last),
    (load_rests, store_rests),
    (load_turn, store_turn),
    (load_recurrence, store_recurrence),
    (load_deviation, store_deviation),
    (load_phases, store_phases),
    (load_misses, store_misses),
    ROWS,
) = kept(CELL, LANES, Sums, Stamp, Stamp, Rests, Turn, Recurrence, Deviation, Phases, Misses)
# What traced lanes keep beside the cell: the event, the speed of a contact, the steps passed.
TRACED_ROWS = CELL + TRACE - STATE


@inner(forceinline=True)
def _move(lanes, i):
    """Take lane i on; return its constants, and what `advance` gives."""
    k = load_constants(lanes, i)
    motion, event, v, x, ready, flown = advance(load_motion(lanes, i), k)
    store_motion(lanes, i, motion)
    return k, motion, event, v, x, ready, flown


@inner(forceinline=True)
def _counted(lanes, i, event, transient, total):
    """Return the recorded impacts of lane i after an event, and whether it adds one, which is kept, first or last.

    Impacts past `total` no longer count.
    """
    count, hit = count_impact(load_sums(lanes, i).hits, event, total)
    return count, hit, hit & (count > transient), hit & (count == transient + 1.0), hit & (count == total)


@inner(forceinline=True)
def observe(lanes, i, motion, event, v, x, transient, total):
    """Observe the step of lane i that led to a motion."""
    count, hit, kept, first, last = _counted(lanes, i, event, transient, total)
    found = sums(load_sums(lanes, i), count, v, first, kept)
    store_sums(lanes, i, found)
    store_turn(lanes, i, turn(load_turn(lanes, i), motion, event, found))
    store_first(lanes, i, stamp(load_first(lanes, i), motion, first))
    store_last(lanes, i, stamp(load_last(lanes, i), motion, last))
    store_rests(lanes, i, rests(load_rests(lanes, i), event, x, count, transient, total))
    store_recurrence(lanes, i, recurrence(load_recurrence(lanes, i), v, count, hit))


@inner(forceinline=True)
def observe_thoroughly(lanes, i, k, motion, event, v, x, ready, flown, transient, total):
    """Observe all that can be observed of the step of lane i that led from `ready`, after leaps, to a motion."""
    # Near-misses come first, while the step's coefficients are at hand: 2 % of a step.
    count, _, kept, first, last = _counted(lanes, i, event, transient, total)
    store_misses(lanes, i, misses(load_misses(lanes, i), ready, motion, k, event, x - flown, count, transient, total))
    store_deviation(lanes, i, deviation(load_deviation(lanes, i), motion, k, event, v, x, first, last))
    store_phases(lanes, i, phases(load_phases(lanes, i), motion, event, kept))
    observe(lanes, i, motion, event, v, x, transient, total)


@inner(forceinline=True)
def observe_walked(lanes, i, k, trace, row, transient, total, facts):
    """Take lane i over the step in a row of a trace, observed, thoroughly unless `facts` is None; return the event."""
    before = load_motion(lanes, i)
    motion, event, v, x = step_at(trace, row, 1, 0)
    store_motion(lanes, i, motion)
    if facts is None:
        observe(lanes, i, motion, event, v, x, transient, total)
    else:
        ready, flown = leap(before, k)
        observe_thoroughly(lanes, i, k, motion, event, v, x, ready, flown, transient, total)
    return event


@njit(error_model="numpy", forceinline=True)
def step_lane(lanes, i, transient, total):
    """Make one certified step in lane i and observe it."""
    _, motion, event, v, x, _, _ = _move(lanes, i)
    observe(lanes, i, motion, event, v, x, transient, total)


@njit(error_model="numpy", forceinline=True)
def step_thorough_lane(lanes, i, transient, total):
    """Make one certified step in lane i and observe all that can be observed."""
    k, motion, event, v, x, ready, flown = _move(lanes, i)
    observe_thoroughly(lanes, i, k, motion, event, v, x, ready, flown, transient, total)


@inner(forceinline=True)
def _plain(lanes, i, transient, total):
    step_lane(lanes, i, transient, total)


@inner(forceinline=True)
def _thorough(lanes, i, transient, total):
    step_thorough_lane(lanes, i, transient, total)


@inner(forceinline=True)
def _traced(lanes, i, transient, total):
    _, _, event, v, x, _, _ = _move(lanes, i)
    lanes[CELL * LANES + i], lanes[(CELL + 1) * LANES + i], lanes[(CELL + 2) * LANES + i] = event, v, x


_block_plain, _block_thorough, _block_traced = (each_lane(step) for step in (_plain, _thorough, _traced))


@njit(error_model="numpy", nogil=True)
def step_lanes(lanes, number, steps, transient, total):
    """Make `steps` certified steps in each of so many lanes, and in those that fill their last block."""
    for _ in range(steps):
        for first in range(0, number, BLOCK):
            _block_plain(lanes[first:], transient, total)


@njit(error_model="numpy", nogil=True)
def step_thorough_lanes(lanes, number, steps, transient, total):
    """Make `steps` certified steps in each of so many lanes, all observers at work."""
    for _ in range(steps):
        for first in range(0, number, BLOCK):
            _block_thorough(lanes[first:], transient, total)


@njit(error_model="numpy", nogil=True)
def trace_lanes(lanes, trace):
    """Make as many certified steps in every lane as the trace has rows, and leave each in its row."""
    for k in range(len(trace)):
        for first in range(0, LANES, BLOCK):
            _block_traced(lanes[first:], 0.0, 0.0)
        row = trace[k]
        for j in range(STATE * LANES):
            row[j] = lanes[j]
        for j in range((TRACE - STATE) * LANES):
            row[STATE * LANES + j] = lanes[CELL * LANES + j]
