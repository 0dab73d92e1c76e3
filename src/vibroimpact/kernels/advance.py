"""The one verb: a state goes in, one certified step is made, a state and an event come out.

Lanes and the walk are its only callers. A walk takes one cell alone and leaves a trace of every step; closing, cycles
and the recorder read what either leaves.
"""

from __future__ import annotations

from numba import njit

from vibroimpact.kernels.contact import certified_step
from vibroimpact.kernels.flight import acceleration, evaluate, rotate, series
from vibroimpact.kernels.law import pressed, rebound
from vibroimpact.kernels.machine import fma, select
from vibroimpact.kernels.state import Motion

FLIGHT = 0.0  # flew on, or rebounded below the cut
IMPACT = 1.0  # a recorded impact
CHATTER = 2.0  # the tail of a complete chatter was closed: the mass now rests at the stop
RELEASE = 3.0  # the force let the resting mass go
STUCK = 4.0  # at rest, and never let go

CLOSE = 4e-6  # steps from contact at which a third-order expansion is exact to rounding
BEND = 1e-4  # largest share of the curvature in that expansion

# A row of a trace: the motion after a step, the event, the speed of a contact, the steps passed.
STATE, TRACE = 5, 8
LOOK = 32  # steps between two looks at whether a cell has ended, counted from its own start; rows of a trace


@njit(inline="always", error_model="numpy")
def _passes_zero(s, c, s1, c1):
    """Return whether turning forward from (s, c) to (s1, c1), by less than a whole turn, passes phase 0."""
    below, below1 = s < 0.0, s1 < 0.0
    back = fma(s1, c, -c1 * s) < 0.0
    return (below & (below1 == False)) | ((below == below1) & back)  # noqa: E712


@njit(inline="always", error_model="numpy")
def _touch_down(u, p, s, c, k):
    """Return whether the contact is next to here, how far away, with which rate p, and its (s, c).

    Within CLOSE of a transversal contact u + p d + p2 d^2/2 = 0 is solved by its series.
    """
    p2 = acceleration(u, p, s, k)
    p3 = fma(-k.C, p2, fma(-k.K, p, -k.A * k.th * c))
    inverse = 1.0 / p
    d0 = -u * inverse
    bend = 0.5 * p2 * (d0 * inverse)
    close = (p < 0.0) & (d0 < CLOSE) & (abs(bend) < BEND)
    d = d0 * fma(bend, fma(2.0, bend, -1.0), 1.0)
    p = fma(d, fma(0.5 * d, p3, p2), p)
    angle = k.th * d
    half = -0.5 * angle * angle
    return close, d, p, fma(half, s, fma(angle, c, s)), fma(half, c, fma(-angle, s, c))


@njit(inline="always", error_model="numpy")
def advance(motion, k):
    """Return the motion one certified step on, the event, the speed v of a contact, and the steps passed.

    At most one contact lies in a step, at its end; the motion returned is the one after it.
    """
    u, p, s, c, n = motion
    touching = u <= 0.0
    at_rest = touching & (p == 0.0)
    pressing, balance = pressed(s, c, k)
    held = at_rest & pressing
    at_release = at_rest & balance
    a = series(motion, k, at_release)
    x = certified_step(a, k.A, touching & (p >= 0.0), at_rest, at_release)
    u1, p1 = evaluate(a, x)
    s1, c1 = rotate(s, c, k.th * x)

    close, d, pc, sc, cc = _touch_down(u1, p1, s1, c1, k)
    contact = close & (held == False)  # noqa: E712
    v = -pc
    back, tail_closed = rebound(v, sc, cc, k)

    forever = held & (k.G <= -k.A)
    s2 = select(held, select(forever, s, k.sr), select(contact, sc, s1))
    c2 = select(held, select(forever, c, k.cr), select(contact, cc, c1))
    u2 = select(held | contact, 0.0, u1)
    p2 = select(held, 0.0, select(contact, back, p1))
    # A step in flight turns by less than half a turn, a hold by up to a whole one.
    wrapped = ((s < 0.0) & (s2 >= 0.0)) | (held & _passes_zero(s, c, s2, c2))
    n2 = n + select(wrapped, 1.0, 0.0)
    struck = select(tail_closed, CHATTER, select(v < k.cut, FLIGHT, IMPACT))
    event = select(forever, STUCK, select(held, RELEASE, select(contact, struck, FLIGHT)))
    return Motion(u2, p2, s2, c2, n2), event, v, x + select(contact, d, 0.0)


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
