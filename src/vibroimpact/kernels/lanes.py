"""Many cells in lockstep: one masked step of every lane, again and again.

A lane's numbers stand in one flat array, row after row of LANES entries, so that the compiler sees constant distances
between all of them and turns the inner loop into vector instructions.

Lanes are stepped in three ways, by the same operations, so that the bits of the motion are the same: plain ones keep
what the velocities of impacts give, thorough ones all that can be observed, traced ones leave a record of every step.
"""

from __future__ import annotations

from vibroimpact.kernels.advance import RELEASE, STATE, TRACE, advance, step_at
from vibroimpact.kernels.leaps import leap
from vibroimpact.kernels.machine import inner, loop
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
from vibroimpact.kernels.vectors import LANES as BLOCK
from vibroimpact.kernels.vectors import anywhere, give

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
def _move(lanes, i, wide):
    """Take lane i on; return its constants, and what `advance` gives."""
    k = load_constants(lanes, i, wide)
    before = load_motion(lanes, i, wide)
    motion, event, v, x, leapt = advance(before, k)
    store_motion(lanes, i, motion, wide)
    return k, before, motion, event, v, x, leapt


@inner(forceinline=True)
def _counted(lanes, i, event, transient, total, wide):
    """Return the recorded impacts of lane i after an event, and whether it adds one, which is kept, first or last.

    Impacts past `total` no longer count.
    """
    count, hit = count_impact(load_sums(lanes, i, wide).hits, event, total)
    return count, hit, hit & (count > transient), hit & (count == transient + 1.0), hit & (count == total)


@inner(forceinline=True)
def observe(lanes, i, motion, event, v, x, transient, total, wide):
    """Observe the step of lane i that led to a motion."""
    count, hit, kept, first, last = _counted(lanes, i, event, transient, total, wide)
    found = sums(load_sums(lanes, i, wide), count, v, first, kept)
    store_sums(lanes, i, found, wide)
    if anywhere(event == RELEASE):
        store_turn(lanes, i, turn(load_turn(lanes, i, wide), motion, event, found), wide)
    if anywhere(first | last):
        store_first(lanes, i, stamp(load_first(lanes, i, wide), motion, first), wide)
        store_last(lanes, i, stamp(load_last(lanes, i, wide), motion, last), wide)
    store_rests(lanes, i, rests(load_rests(lanes, i, wide), event, x, count, transient, total), wide)
    store_recurrence(lanes, i, recurrence(load_recurrence(lanes, i, wide), v, count, hit), wide)


@inner(forceinline=True)
def observe_thoroughly(lanes, i, k, before, motion, event, v, x, leapt, transient, total, wide):
    """Observe all that can be observed of the step of lane i that led from `before`, by way of leaps, to a motion."""
    # Near-misses come first, while the step's coefficients are at hand: 2 % of a step.
    # They are those of the flight that began with the impact before.
    _, _, kept, first, last = _counted(lanes, i, event, transient, total, wide)
    begun = load_sums(lanes, i, wide).hits
    found = misses(load_misses(lanes, i, wide), before, leapt, motion, k, event, x, begun, transient, total)
    store_misses(lanes, i, found, wide)
    store_deviation(lanes, i, deviation(load_deviation(lanes, i, wide), motion, k, event, v, x, first, last), wide)
    store_phases(lanes, i, phases(load_phases(lanes, i, wide), motion, event, kept), wide)
    observe(lanes, i, motion, event, v, x, transient, total, wide)


@inner(forceinline=True)
def observe_walked(lanes, i, k, trace, row, transient, total, facts):
    """Take lane i over the step in a row of a trace, observed, thoroughly unless `facts` is None; return the event."""
    before = load_motion(lanes, i)
    motion, event, v, x = step_at(trace, row, 1, 0)
    store_motion(lanes, i, motion)
    if facts is None:
        observe(lanes, i, motion, event, v, x, transient, total, None)
    else:
        observe_thoroughly(lanes, i, k, before, motion, event, v, x, leap(before, k), transient, total, None)
    return event


@inner(forceinline=True)
def step_lane(lanes, i, transient, total, wide=None):
    """Make one certified step in lane i, or with `wide` in all of a block from there on, and observe it."""
    _, _, motion, event, v, x, _ = _move(lanes, i, wide)
    observe(lanes, i, motion, event, v, x, transient, total, wide)


@inner(forceinline=True)
def step_thorough_lane(lanes, i, transient, total, wide=None):
    """Do what `step_lane` does, and observe all that can be observed."""
    k, before, motion, event, v, x, leapt = _move(lanes, i, wide)
    observe_thoroughly(lanes, i, k, before, motion, event, v, x, leapt, transient, total, wide)


@loop
def step_lanes(lanes, number, steps, transient, total):
    """Make `steps` certified steps in each of so many lanes, and in those that fill their last block."""
    for _ in range(steps):
        for first in range(0, number, BLOCK):
            step_lane(lanes, first, transient, total, 0)


@loop
def step_thorough_lanes(lanes, number, steps, transient, total):
    """Make `steps` certified steps in each of so many lanes, all observers at work."""
    for _ in range(steps):
        for first in range(0, number, BLOCK):
            step_thorough_lane(lanes, first, transient, total, 0)


@inner
def trace_lanes(lanes, trace):
    """Make as many certified steps in every lane as the trace has rows, and leave each in its row."""
    for k in range(len(trace)):
        row = trace[k]
        for first in range(0, LANES, BLOCK):
            _, _, _, event, v, x, _ = _move(lanes, first, 0)
            give(row, STATE * LANES + first, 0, event)
            give(row, (STATE + 1) * LANES + first, 0, v)
            give(row, (STATE + 2) * LANES + first, 0, x)
        for j in range(STATE * LANES):
            row[j] = lanes[j]
