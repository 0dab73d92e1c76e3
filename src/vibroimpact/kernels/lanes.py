"""Many cells in lockstep: one masked step of every lane, again and again.

A lane's numbers stand in one flat array, row after row of LANES entries at constant distances, so that a block of lanes
is read and written as vectors.

Lanes are stepped in three ways, by the same operations, so that the bits of the motion are the same: plain ones keep
what the velocities of impacts give, thorough ones all that can be observed, traced ones leave a record of every step.
"""

from __future__ import annotations

from vibroimpact.kernels.advance import RELEASE, STATE, advance, step_at, way_from
from vibroimpact.kernels.observers import (
    Deviation,
    Grown,
    Misses,
    Phases,
    Recurrence,
    Rests,
    Stamp,
    Sums,
    Turn,
    count_impact,
    deviation,
    folded,
    grown,
    margin_to_beat,
    misses,
    phases,
    phases_until,
    recurrence,
    rests,
    size_of,
    stamp,
    sums,
    turn,
)
from vibroimpact.kernels.shared.machine import inner, loop
from vibroimpact.kernels.shared.vectors import LANES as BLOCK
from vibroimpact.kernels.shared.vectors import anywhere, put_at
from vibroimpact.kernels.state import Constants, Motion, accessors

LANES = 32

(load_motion, store_motion), (load_constants, store_constants), CELL = accessors(0, LANES, Motion, Constants)
(
    (load_sums, store_sums),
    (load_first, store_first),
    (load_last, store_last),
    (load_rests, store_rests),
    (load_turn, store_turn),
    (load_recurrence, store_recurrence),
    (load_deviation, store_deviation),
    (load_first_size, store_first_size),
    (load_last_size, store_last_size),
    (load_phases, store_phases),
    (load_turn_phases, store_turn_phases),
    (load_misses, store_misses),
    ROWS,
) = accessors(
    CELL, LANES, Sums, Stamp, Stamp, Rests, Turn, Recurrence, Deviation, Grown, Grown, Phases, Phases, Misses
)  # fmt: skip


@inner(forceinline=True)
def take_on(lanes, i, wide, below=None):
    """Take lane i on by leaps and a step; return its constants, and what `advance` gives."""
    k = load_constants(lanes, i, wide)
    motion, event, v, x, way = advance(load_motion(lanes, i, wide), k, below)
    store_motion(lanes, i, motion, wide)
    return k, motion, event, v, x, way


@inner(forceinline=True)
def _margin_to_beat(lanes, i, transient, total, wide):
    """Return the gap below which near-misses count that lane i now flies by."""
    return margin_to_beat(load_misses(lanes, i, wide), load_sums(lanes, i, wide).hits, transient, total)


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
    summed = sums(load_sums(lanes, i, wide), count, v, first, kept)
    store_sums(lanes, i, summed, wide)
    if anywhere(event == RELEASE):
        store_turn(lanes, i, turn(load_turn(lanes, i, wide), motion, event, summed), wide)
    if anywhere(first | last):
        store_first(lanes, i, stamp(load_first(lanes, i, wide), motion, first), wide)
        store_last(lanes, i, stamp(load_last(lanes, i, wide), motion, last), wide)
    store_rests(lanes, i, rests(load_rests(lanes, i, wide), event, x, count, transient, total), wide)
    store_recurrence(lanes, i, recurrence(load_recurrence(lanes, i, wide), v, count, hit), wide)


@inner(forceinline=True)
def observe_thoroughly(lanes, i, k, below, motion, event, v, x, way, transient, total, wide):
    """Observe all that can be observed of the step of lane i that led to a motion, `way` being how."""
    store_misses(lanes, i, misses(load_misses(lanes, i, wide), *way, motion, k, event, v, x, below), wide)
    _, _, kept, first, last = _counted(lanes, i, event, transient, total, wide)
    old = load_deviation(lanes, i, wide)
    if anywhere(size_of(old) > 0.0):
        now = deviation(old, motion, k, event, v, x)
        if anywhere(first | last):
            store_first_size(lanes, i, grown(load_first_size(lanes, i, wide), now, first), wide)
            store_last_size(lanes, i, grown(load_last_size(lanes, i, wide), now, last), wide)
        store_deviation(lanes, i, folded(now), wide)
    added = phases(load_phases(lanes, i, wide), motion, kept)
    store_phases(lanes, i, added, wide)
    if anywhere(event == RELEASE):
        store_turn_phases(lanes, i, phases_until(load_turn_phases(lanes, i, wide), added, event), wide)
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
        below = _margin_to_beat(lanes, i, transient, total, None)
        way = way_from(before, k, below)
        observe_thoroughly(lanes, i, k, below, motion, event, v, x, way, transient, total, None)
    return event


@inner(forceinline=True)
def step_lane(lanes, i, transient, total, wide=None):
    """Make one certified step in lane i, or with `wide` in all of a block from there on, and observe it."""
    _, motion, event, v, x, _ = take_on(lanes, i, wide)
    observe(lanes, i, motion, event, v, x, transient, total, wide)


@inner(forceinline=True)
def step_thorough_lane(lanes, i, transient, total, wide=None):
    """Do what `step_lane` does, and observe all that can be observed."""
    below = _margin_to_beat(lanes, i, transient, total, wide)
    k, motion, event, v, x, way = take_on(lanes, i, wide, below)
    observe_thoroughly(lanes, i, k, below, motion, event, v, x, way, transient, total, wide)


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
            _, _, event, v, x, _ = take_on(lanes, first, 0)
            put_at(row, STATE * LANES + first, 0, event)
            put_at(row, (STATE + 1) * LANES + first, 0, v)
            put_at(row, (STATE + 2) * LANES + first, 0, x)
        for j in range(STATE * LANES):
            row[j] = lanes[j]
