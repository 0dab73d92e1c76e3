"""The one verb: a state goes in, leaps and one certified step are made, a state and an event come out.

Lanes and the walk are its only callers. A walk takes one cell alone and leaves a trace of every step; closing, cycles
and the recorder read what either leaves.
"""

from __future__ import annotations

from numba import njit

from vibroimpact.kernels.contact import certified_step
from vibroimpact.kernels.flight import BARELY, acceleration, evaluate, rotate, series
from vibroimpact.kernels.law import pressed, rebound
from vibroimpact.kernels.leaps import leap
from vibroimpact.kernels.machine import fma, inner, select
from vibroimpact.kernels.state import Motion

FLIGHT = 0.0  # flew on, or rebounded below the cut
IMPACT = 1.0  # a recorded impact
CHATTER = 2.0  # the tail of a complete chatter was closed: the mass now rests at the stop
RELEASE = 3.0  # the force let the resting mass go
STUCK = 4.0  # at rest, and never let go

# Near a contact the gap is monotone, and a polynomial of degree 8 exact to rounding (see `_touch_down`).
CLOSE = 0.02  # steps, to first order
BEND = 0.03  # of the gap's rate, by its second derivative; two thirds of it by the higher ones

# A row of a trace: the motion after a step, the event, the speed of a contact, the steps passed.
STATE, TRACE = 5, 8
LOOK = 32  # steps between two looks at whether a cell has ended, counted from its own start; rows of a trace


@inner(forceinline=True)
def _passes_zero(s, c, s1, c1):
    """Return whether turning forward from (s, c) to (s1, c1), by less than a whole turn, passes phase 0."""
    below, below1 = s < 0.0, s1 < 0.0
    back = fma(s1, c, -c1 * s) < 0.0
    return (below & (below1 == False)) | ((below == below1) & back)  # noqa: E712


@njit(error_model="numpy", forceinline=True)
def _touch_down(u, p, s, c, k):
    """Return whether the contact is next to here, how far away, with which rate p, and its (s, c).

    With d0 = -u/p the conditions keep the rate within a fifth of p over 2 d0: by |p2| 2 d0 <= 4 BEND |p|, and, since
    |b_j| <= 3^(j-3) (|b_3| + |b_4|/3 + A) as in `contact`, by some (1.7 |b_3| + 1.4 A) 2 d0^2 for all higher terms.
    So the gap falls all the way to its first root, which lies within 1.3 d0, and nothing is touched before. What degree
    8 leaves out of the rate is at most 3^6 (1.3 CLOSE)^8/8! < 4e-15 of b_3 and A, some 5e-18 where C is small. The
    reverted cubic ends within 2e-4 d0 of the root; there the gap, its rate and p2 are exact, and reverting once more
    leaves out what is of the fourth order in that: some 1e-20.
    """
    e0, e1 = -k.A * s, -k.A * k.th * c
    e2, e3 = -k.Q * e0, -k.Q * e1
    e4, e5 = -k.Q * e2, -k.Q * e3
    p2 = acceleration(u, p, s, k)
    p3 = fma(-k.C, p2, fma(-k.K, p, e1))
    p4 = fma(-k.C, p3, fma(-k.K, p2, e2))
    p5 = fma(-k.C, p4, fma(-k.K, p3, e3))
    p6 = fma(-k.C, p5, fma(-k.K, p4, e4))
    p7 = fma(-k.C, p6, fma(-k.K, p5, e5))
    p8 = fma(-k.C, p7, fma(-k.K, p6, -k.Q * e4))
    inverse = 1.0 / p
    d0 = -u * inverse
    bend = 0.5 * p2 * (d0 * inverse)
    square = d0 * d0
    close = (p < 0.0) & (d0 < CLOSE) & (abs(bend) < BEND)
    close = close & (fma(1.7, abs(p3), 1.4 * k.A) * square < -2.0 / 3.0 * BEND * p)
    d = d0 * (fma(bend, fma(2.0, bend, -1.0), 1.0) - p3 * square * (inverse * (1 / 6)))
    gap, rate = _near(
        u, p, p2 * (1 / 2), p3 * (1 / 6), p4 * (1 / 24), p5 * (1 / 120), p6 * (1 / 720), p7 * (1 / 5040),
        p8 * (1 / 40320), d,
    )  # fmt: skip
    angle = k.th * d
    z = angle * angle
    sine = angle * fma(z, fma(z, fma(z, -1 / 5040, 1 / 120), -1 / 6), 1.0)
    cosine = fma(z, fma(z, fma(z, -1 / 720, 1 / 24), -1 / 2), 1.0)
    s1, c1 = fma(s, cosine, c * sine), fma(c, cosine, -s * sine)
    # What is left, t, by the reverted series there, and all that changes over it.
    p2, p3 = acceleration(gap, rate, s1, k), fma(p4, d, p3)
    inverse = 1.0 / rate
    y = -gap * inverse
    bend, cubic = -0.5 * p2 * inverse, p3 * inverse * (1 / 6)
    t = fma(y * y, fma(y, fma(2.0 * bend, bend, -cubic), bend), y)
    rate = fma(t, fma(0.5 * t, p3, p2), rate)
    more = k.th * t
    half = 0.5 * more
    return close, d + t, rate, fma(more, fma(-half, s1, c1), s1), fma(more, fma(-half, c1, -s1), c1)


@inner(forceinline=True)
def _near(u, p, a2, a3, a4, a5, a6, a7, a8, d):
    """Return the gap and its rate a little later, by degree 8."""
    y, r = fma(a8, d, a7), a8
    y, r = fma(y, d, a6), fma(r, d, y)
    y, r = fma(y, d, a5), fma(r, d, y)
    y, r = fma(y, d, a4), fma(r, d, y)
    y, r = fma(y, d, a3), fma(r, d, y)
    y, r = fma(y, d, a2), fma(r, d, y)
    y, r = fma(y, d, p), fma(r, d, y)
    return fma(y, d, u), fma(r, d, y)


@inner(forceinline=True)
def _step(motion, k):
    """Return the motion one certified step on, the event, the speed v of a contact, and how much of a step passed.

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
    wrapped = ((s < -BARELY) & (s2 >= -BARELY)) | (held & _passes_zero(s, c, s2, c2))
    n2 = n + select(wrapped, 1.0, 0.0)
    struck = select(tail_closed, CHATTER, select(v < k.cut, FLIGHT, IMPACT))
    event = select(forever, STUCK, select(held, RELEASE, select(contact, struck, FLIGHT)))
    return Motion(u2, p2, s2, c2, n2), event, v, x + select(contact, d, 0.0)


@njit(error_model="numpy", forceinline=True)
def advance(motion, k):
    """Return the motion after leaps and a certified step, the event, the speed v of a contact, and the steps passed;
    and the motion between leaps and step, with the steps that the leaps passed.
    """
    ready, flown = leap(motion, k)
    motion, event, v, x = _step(ready, k)
    return motion, event, v, flown + x, ready, flown


@inner
def walk(motion, k, trace, most, impacts):
    """Make certified steps and leave each in a row of the trace; return how many.

    The walk stops after `most` steps, when the trace is full, after a release, and after `impacts` recorded impacts if
    `impacts` is not 0. The motion it has come to stands in the last row.
    """
    rows = min(len(trace), most)
    for row in range(rows):
        motion, event, v, x, _, _ = advance(motion, k)
        trace[row, 0], trace[row, 1], trace[row, 2], trace[row, 3], trace[row, 4] = motion
        trace[row, 5], trace[row, 6], trace[row, 7] = event, v, x
        impacts -= event == IMPACT
        if event == RELEASE or (event == IMPACT and impacts == 0):
            return row + 1
    return rows


@inner(forceinline=True)
def step_at(trace, row, width, i):
    """Return what `advance` gave for the step in a row of a trace, of lane i of `width`."""
    u, p, s = trace[row, i], trace[row, width + i], trace[row, 2 * width + i]
    motion = Motion(u, p, s, trace[row, 3 * width + i], trace[row, 4 * width + i])
    return motion, trace[row, 5 * width + i], trace[row, 6 * width + i], trace[row, 7 * width + i]
