"""The one verb: a state goes in, leaps and one certified step are made, a state and an event come out.

Lanes and the walk are its only callers. A walk takes one cell alone and leaves a trace of every step; closing, cycles
and the recorder read what either leaves.
"""

from __future__ import annotations

from vibroimpact.kernels.flight import BARELY, acceleration, evaluate, rotate, series
from vibroimpact.kernels.law import chatters, pressed, speed_after
from vibroimpact.kernels.leaps import leap
from vibroimpact.kernels.shared.contact import certified_step
from vibroimpact.kernels.shared.machine import inner
from vibroimpact.kernels.shared.vectors import anywhere, fma, never, no, select
from vibroimpact.kernels.state import Motion, chosen

FLIGHT = 0.0  # flew on, or rebounded below the cut
IMPACT = 1.0  # a recorded impact
CHATTER = 2.0  # the tail of a complete chatter was closed: the mass now rests at the stop
RELEASE = 3.0  # the force let the resting mass go
STUCK = 4.0  # at rest, and never let go

# Near a contact the gap is monotone, and its root is found in two strides (see `_approach`).
CLOSE = 0.1  # steps, to first order
BEND = 0.06  # of the gap's rate, by its second derivative; two thirds of it by the higher ones

# A row of a trace: the motion after a step, the event, the speed of a contact, the steps passed.
STATE, TRACE = 5, 8
LOOK = 32  # steps between two looks at whether a cell has ended, counted from its own start; rows of a trace


@inner(forceinline=True)
def _passes_zero(s, c, s1, c1):
    """Return whether turning forward from (s, c) to (s1, c1), by less than a whole turn, passes phase 0."""
    below, below1 = s < 0.0, s1 < 0.0
    back = fma(s1, c, -c1 * s) < 0.0
    return (below & no(below1)) | (((below & below1) | no(below | below1)) & back)


@inner(forceinline=True)
def _approach(u, p, s, c, k):
    """Return whether the contact is close, and its distance, within 5e-4 of that.

    With d0 = -u/p the conditions keep the rate within 0.35 of p over 2 d0: by |p2| 2 d0 <= 4 BEND |p|, and, since
    |b_j| <= 3^(j-3) (|b_3| + |b_4|/3 + A) as in `contact`, by some (1.7 |b_3| + 1.4 A) 2.5 d0^2 for all higher terms.
    So the gap falls all the way to its first root, which lies within 1.6 d0, and nothing is touched before. What the
    series, reverted to the fourth order, leaves out is 14 bend^4 and as little of mixed terms.
    """
    e0, e1 = -k.A * s, -k.A * k.th * c
    p2 = acceleration(u, p, s, k)
    p3 = fma(-k.C, p2, fma(-k.K, p, e1))
    p4 = fma(-k.C, p3, fma(-k.K, p2, -k.Q * e0))
    inverse = 1.0 / p
    d0 = -u * inverse
    ratio = d0 * inverse
    bend, square = 0.5 * p2 * ratio, d0 * ratio
    close = (p < 0.0) & (d0 < CLOSE) & (abs(bend) < BEND)
    close = close & (fma(1.7, abs(p3), 1.4 * k.A) * (d0 * d0) < -2.0 / 3.0 * BEND * p)
    cubic, quartic = p3 * (1 / 6) * square, p4 * (1 / 24) * (square * d0)
    stretch = fma(bend, fma(bend, fma(-5.0, bend, 2.0), -1.0), fma(cubic, fma(5.0, bend, -1.0), -quartic))
    return close, fma(d0, stretch, d0)


@inner(forceinline=True)
def _turned(s, c, angle):
    """Return (s, c) turned by at most 0.16 radians."""
    z = angle * angle
    sine = angle * fma(z, fma(z, fma(z, fma(z, 1 / 362880, -1 / 5040), 1 / 120), -1 / 6), 1.0)
    cosine = fma(z, fma(z, fma(z, fma(z, fma(z, -1 / 3628800, 1 / 40320), -1 / 720), 1 / 24), -1 / 2), 1.0)
    return fma(s, cosine, c * sine), fma(c, cosine, -s * sine)


@inner(forceinline=True)
def _touch_down(u, p, s, c, k):
    """Return the distance of a contact that is almost reached, its rate, and its (s, c).

    The gap, its rate and p2 are exact at the beginning. The distance left, t, comes from the reverted series, with all
    that changes over it; what is left out is of the fourth order in t.
    """
    p2 = acceleration(u, p, s, k)
    p3 = fma(-k.C, p2, fma(-k.K, p, -k.A * k.th * c))
    inverse = 1.0 / p
    y = -u * inverse
    bend, cubic = -0.5 * p2 * inverse, p3 * inverse * (1 / 6)
    t = fma(y * y, fma(y, fma(2.0 * bend, bend, -cubic), bend), y)
    rate = fma(t, fma(0.5 * t, p3, p2), p)
    more = k.th * t
    half, third = 0.5 * more, more * more * (1 / 6)
    sine, cosine = fma(-more, third, more), -half * more
    return t, rate, fma(s, cosine, fma(c, sine, s)), fma(c, cosine, fma(-s, sine, c))


@inner(forceinline=True)
def _step(motion, k):
    """Return the motion one certified step on, the event, the speed v of a contact, how much of a step passed, and
    the coefficients of the gap.

    At most one contact lies in a step, at its end; the motion returned is the one after it. What is rare, rest and weak
    impacts, is computed only where some lane has it, and changes nothing in the others.
    """
    u, p, s, c, n = motion
    touching = u <= 0.0
    at_rest = touching & (p == 0.0)
    resting = anywhere(at_rest)
    held = at_release = never(u)
    if resting:
        pressing, balance = pressed(s, c, k)
        held, at_release = at_rest & pressing, at_rest & balance
    a = series(motion, k, at_release)
    x = certified_step(a, k.A, touching & (p >= 0.0), at_rest, at_release, resting)
    u1, p1 = evaluate(a, x)
    s1, c1 = rotate(s, c, k.th * x)

    near, d = _approach(u1, p1, s1, c1, k)
    contact = near & (x + d <= 1.0) & no(held)
    x = select(contact, x + d, x)
    u1, p1 = evaluate(a, x)
    s1, c1 = _turned(s1, c1, select(contact, k.th * d, 0.0))
    t, pc, sc, cc = _touch_down(u1, p1, s1, c1, k)
    v = -pc
    weak = contact & (v < k.cut)
    back, event = speed_after(v, k.r), select(contact, select(weak, FLIGHT, IMPACT), FLIGHT)
    if anywhere(weak):
        stays = weak & chatters(v, sc, cc, k)
        back, event = select(stays, 0.0, back), select(stays, CHATTER, event)

    s1, c1 = select(contact, sc, s1), select(contact, cc, c1)
    # A step turns by less than half a turn.
    n1 = n + select((s < -BARELY) & (s1 >= -BARELY), 1.0, 0.0)
    after = Motion(select(contact, 0.0, u1), select(contact, back, p1), s1, c1, n1)
    if resting:
        forever = held & (k.G <= -k.A)
        s1, c1 = select(forever, s, k.sr), select(forever, c, k.cr)
        turned = _passes_zero(s, c, s1, c1) | ((s < -BARELY) & (s1 >= -BARELY))
        rest = Motion(0.0, 0.0, s1, c1, n + select(turned, 1.0, 0.0))
        after, event = chosen(held, rest, after), select(held, select(forever, STUCK, RELEASE), event)
    return after, event, v, x + select(contact, t, 0.0), a


@inner(forceinline=True)
def advance(motion, k, below=None):
    """Return the motion after leaps and a certified step, the event, the speed v of a contact, and the steps passed;
    and how: where the leaps came to, which look for near-misses `below` a gap, and the coefficients of the step.
    """
    leapt = leap(motion, k, below)
    motion, event, v, x, a = _step(leapt.at, k)
    return motion, event, v, leapt.steps + x, (leapt, a)


@inner
def way_from(motion, k, below):
    """Return the way that `advance` goes from a motion: its leaps, and the coefficients of its step."""
    leapt = leap(motion, k, below)
    at = leapt.at
    at_release = (at.u <= 0.0) & (at.p == 0.0) & pressed(at.s, at.c, k)[1]
    return leapt, series(at, k, at_release)


@inner
def walk(motion, k, trace, most, impacts):
    """Make certified steps and leave each in a row of the trace; return how many.

    The walk stops after `most` steps, when the trace is full, after a release, and after `impacts` recorded impacts if
    `impacts` is not 0.0. The motion it has come to stands in the last row.
    """
    rows = min(len(trace), most)
    for row in range(rows):
        motion, event, v, x, _ = advance(motion, k)
        trace[row, 0], trace[row, 1], trace[row, 2], trace[row, 3], trace[row, 4] = motion
        trace[row, 5], trace[row, 6], trace[row, 7] = event, v, x
        impacts -= event == IMPACT
        if event == RELEASE or (event == IMPACT and impacts == 0.0):
            return row + 1
    return rows


@inner(forceinline=True)
def step_at(trace, row, width, i):
    """Return the result of `advance` for the step in a row of a trace, of lane i of `width`."""
    u, p, s = trace[row, i], trace[row, width + i], trace[row, 2 * width + i]
    motion = Motion(u, p, s, trace[row, 3 * width + i], trace[row, 4 * width + i])
    return motion, trace[row, 5 * width + i], trace[row, 6 * width + i], trace[row, 7 * width + i]
