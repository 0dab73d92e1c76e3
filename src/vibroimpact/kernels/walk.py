"""One cell alone: a walk that leaves a trace of every step, for those who read what happened.

Lanes and the walk are the only callers of `advance`; closing, cycles and the recorder read what either leaves.
"""

from __future__ import annotations

from numba import njit

from vibroimpact.kernels.advance import IMPACT, RELEASE, advance
from vibroimpact.kernels.state import Motion

# A row of a trace: the motion after a step, the event, the speed of a contact, the steps passed.
STATE, TRACE = 5, 8
LOOK = 32  # steps between two looks at whether a cell has ended, counted from its own start; rows of a trace


@njit(error_model="numpy")
def walk(motion, k, trace, most, impacts):
    """Make certified steps and leave each in a row of the trace; return how many.

    The walk stops after `most` steps, when the trace is full, after a release, and after `impacts` recorded impacts if
    `impacts` is not 0. The motion it has come to stands in the last row.
    """
    rows = min(len(trace), most)
    for row in range(rows):
        motion, event, v, x = advance(motion, k)
        trace[row, 0], trace[row, 1], trace[row, 2], trace[row, 3], trace[row, 4] = motion
        trace[row, 5], trace[row, 6], trace[row, 7] = event, v, x
        impacts -= event == IMPACT
        if event == RELEASE or (event == IMPACT and impacts == 0):
            return row + 1
    return rows


@njit(inline="always", error_model="numpy")
def step_at(trace, row, width, i):
    """Return what `advance` gave for the step in a row of a trace, of lane i of `width`."""
    u, p, s = trace[row, i], trace[row, width + i], trace[row, 2 * width + i]
    motion = Motion(u, p, s, trace[row, 3 * width + i], trace[row, 4 * width + i])
    return motion, trace[row, 5 * width + i], trace[row, 6 * width + i], trace[row, 7 * width + i]
