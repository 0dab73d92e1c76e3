"""Lanes that leave a trace of every step, for those who write down what happens.

The motion is stepped by the same operations as in other lanes, so its bits are the same.
"""

from __future__ import annotations

from numba import njit

from vibroimpact.kernels.advance import advance
from vibroimpact.kernels.lanes import (
    COS_R,
    CUT,
    DAMP,
    DRIVE,
    LANES,
    PRELOAD,
    REST,
    SIN_R,
    STIFF,
    TAIL,
    TURN,
    TURN2,
    C,
    N,
    P,
    S,
    U,
)
from vibroimpact.kernels.vector_loop import each_lane

STATE = 5  # rows of the state, the first ones
CELL = 16  # rows of the state and the constants
EVENT, SPEED, PASSED = range(CELL, CELL + 3)
ROWS = CELL + 3
TRACE = STATE + 3  # numbers a step and lane leaves: the state after it, the event, the speed of a contact, steps passed


@njit(error_model="numpy", forceinline=True)
def _step(lanes, i, transient, total):
    """Make one certified step in lane i."""
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
    lanes[EVENT * LANES + i] = event
    lanes[SPEED * LANES + i] = v
    lanes[PASSED * LANES + i] = x


_every_lane = each_lane(_step, LANES)


@njit(error_model="numpy", nogil=True)
def trace_lanes(lanes, trace):
    """Make as many certified steps in every lane as the trace has rows, and leave each in its row."""
    for k in range(len(trace)):
        _every_lane(lanes, 0.0, 0.0)
        row = trace[k]
        for j in range(STATE * LANES):
            row[j] = lanes[j]
        for j in range((TRACE - STATE) * LANES):
            row[STATE * LANES + j] = lanes[CELL * LANES + j]
