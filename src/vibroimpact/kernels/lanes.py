"""Many cells in lockstep: one masked step of every lane, again and again.

A lane's numbers stand in one flat array, row after row of LANES entries, so that the compiler sees constant distances
between all of them and turns the inner loop into vector instructions.
"""

from __future__ import annotations

from numba import njit

from vibroimpact.kernels.advance import IMPACT, RELEASE, advance
from vibroimpact.kernels.arithmetic import select
from vibroimpact.kernels.observers import count_impact, recurrence, stamp, sticks_within, velocity_sums
from vibroimpact.kernels.vector_loop import each_lane

LANES = 32
# Rows: the state, the cell's constants, what the observers keep.
U, P, S, C, N = range(5)
DAMP, STIFF, DRIVE, PRELOAD, TURN, TURN2, REST, CUT, TAIL, SIN_R, COS_R = range(5, 16)
COUNT, SHIFT, SUM1, SUM2, LARGEST, N0, S0, C0, N1, S1, C1, STUCK_SEEN, AGE = range(16, 29)
RELEASES, REF_V, REF_COUNT, REF_NEXT, NEAR, CANDIDATE = range(29, 35)
# What thorough lanes keep beside it.
DU, DP, FOLDS, SIZE0, FOLDS0, SIZE1, FOLDS1, SUM_S, SUM_C, MARGIN, LET_GO = range(35, 46)
ROWS = 46


@njit(error_model="numpy")
def constants_of(lanes, i):
    """Return C, K, A, G, th, Q, r, cut, tail, sr, cr of lane i."""
    return (
        lanes[DAMP * LANES + i],
        lanes[STIFF * LANES + i],
        lanes[DRIVE * LANES + i],
        lanes[PRELOAD * LANES + i],
        lanes[TURN * LANES + i],
        lanes[TURN2 * LANES + i],
        lanes[REST * LANES + i],
        lanes[CUT * LANES + i],
        lanes[TAIL * LANES + i],
        lanes[SIN_R * LANES + i],
        lanes[COS_R * LANES + i],
    )


@njit(error_model="numpy")
def state_of(lanes, i):
    """Return u, p, s, c, n of lane i."""
    return (
        lanes[U * LANES + i],
        lanes[P * LANES + i],
        lanes[S * LANES + i],
        lanes[C * LANES + i],
        lanes[N * LANES + i],
    )


@njit(inline="always", error_model="numpy")
def step_lane(lanes, i, transient, total):
    """Make one certified step in lane i; impacts past `total` no longer count.

    Return the event, whether it is a kept impact, the first and the last of them, its speed, and the steps passed.
    """
    u, p, s, c, n, event, v, x = advance(
        lanes[U * LANES + i],
        lanes[P * LANES + i],
        lanes[S * LANES + i],
        lanes[C * LANES + i],
        lanes[N * LANES + i],
        lanes[DAMP * LANES + i],
        lanes[STIFF * LANES + i],
        lanes[DRIVE * LANES + i],
        lanes[PRELOAD * LANES + i],
        lanes[TURN * LANES + i],
        lanes[TURN2 * LANES + i],
        lanes[REST * LANES + i],
        lanes[CUT * LANES + i],
        lanes[TAIL * LANES + i],
        lanes[SIN_R * LANES + i],
        lanes[COS_R * LANES + i],
    )
    lanes[U * LANES + i] = u
    lanes[P * LANES + i] = p
    lanes[S * LANES + i] = s
    lanes[C * LANES + i] = c
    lanes[N * LANES + i] = n

    count, hit = count_impact(lanes[COUNT * LANES + i], event, total)
    lanes[COUNT * LANES + i] = count
    kept = hit & (count > transient)
    first = hit & (count == transient + 1.0)
    last = hit & (count == total)
    shift, sum1, sum2, largest = velocity_sums(
        lanes[SHIFT * LANES + i],
        lanes[SUM1 * LANES + i],
        lanes[SUM2 * LANES + i],
        lanes[LARGEST * LANES + i],
        v,
        first,
        kept,
    )
    lanes[SHIFT * LANES + i] = shift
    lanes[SUM1 * LANES + i] = sum1
    lanes[SUM2 * LANES + i] = sum2
    lanes[LARGEST * LANES + i] = largest
    n0, s0, c0 = stamp(first, lanes[N0 * LANES + i], lanes[S0 * LANES + i], lanes[C0 * LANES + i], n, s, c)
    lanes[N0 * LANES + i] = n0
    lanes[S0 * LANES + i] = s0
    lanes[C0 * LANES + i] = c0
    n1, s1, c1 = stamp(last, lanes[N1 * LANES + i], lanes[S1 * LANES + i], lanes[C1 * LANES + i], n, s, c)
    lanes[N1 * LANES + i] = n1
    lanes[S1 * LANES + i] = s1
    lanes[C1 * LANES + i] = c1
    lanes[STUCK_SEEN * LANES + i] = sticks_within(lanes[STUCK_SEEN * LANES + i], event, count, transient, total)
    lanes[AGE * LANES + i] = select(event == IMPACT, 0.0, lanes[AGE * LANES + i] + x)
    lanes[RELEASES * LANES + i] = lanes[RELEASES * LANES + i] + select(event == RELEASE, 1.0, 0.0)

    ref_v, ref_count, ref_next, candidate = recurrence(
        lanes[REF_V * LANES + i],
        lanes[REF_COUNT * LANES + i],
        lanes[REF_NEXT * LANES + i],
        lanes[NEAR * LANES + i],
        lanes[CANDIDATE * LANES + i],
        v,
        count,
        hit,
    )
    lanes[REF_V * LANES + i] = ref_v
    lanes[REF_COUNT * LANES + i] = ref_count
    lanes[REF_NEXT * LANES + i] = ref_next
    lanes[CANDIDATE * LANES + i] = candidate
    return event, kept, first, last, v, x


@njit(error_model="numpy", forceinline=True)
def _step(lanes, i, transient, total):
    step_lane(lanes, i, transient, total)


_every_lane = each_lane(_step, LANES)


@njit(error_model="numpy", nogil=True)
def step_lanes(lanes, steps, transient, total):
    """Make `steps` certified steps in every lane."""
    for _ in range(steps):
        _every_lane(lanes, transient, total)
