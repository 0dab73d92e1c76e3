"""Leaps: long ways far from the stop by a matrix that is computed once a cell, certified by a chord.

The flow over a fixed length X is linear in (u, p, sin wt, cos wt, 1), so a leap costs some twenty multiply-adds. It is
made only where the stop is surely not reached on the way.

The certificate takes its bound from the clearance: in flight u'' + C u' + K u = f with f <= M over the leap, here
f = G - A sin wt and M its largest value there, or 0. With t = (1 - e^{-Cx})/(1 - e^{-CX}), from 0 to 1, let
v = (1 - t) u0 + t u1 - q t (1 - t), q = M ((e^{CX} - 1)/C)^2 / 2. Then v'' + C v' = M e^{2C(X - x)} >= M, so that where
v >= 0 the difference d = u - v has d'' + C d' + K d <= 0, and it vanishes at both ends. An equation whose solutions
cannot vanish twice within X, as (K - C^2/4) X^2 < pi^2, has a Green's function of one sign (Sturm): d >= 0. And v > 0
inside where sqrt(u0) + sqrt(u1) > sqrt(q) (theory, equation 2.2), for any damping, and from the stop itself (u0 = 0).

A leap that is not certified changes nothing.
"""

from __future__ import annotations

import math

from vibroimpact.kernels.flight import BARELY, NONE, acceleration, coefficients, evaluate, least_gap, series
from vibroimpact.kernels.shared.machine import inner, whole
from vibroimpact.kernels.shared.vectors import anywhere, fma, least, most, never, no, select
from vibroimpact.kernels.state import Flow, Leap, Leapt, Motion, chosen

TURN = 2.0 * math.pi

# In steps, radians of the fastest rate: FAR for LONG where the force is FAST times faster than the mass swings and than
# its velocity decays: there it flies over whole periods, nearly straight, and a longer chord loses little. All are
# doubled from parts of at most 0.825, over which the series loses nothing.
SHORT, LONG, FAR = 1.0, 2.0, 3.3
FAST = 3.0
LONGS = 6  # at most; with the others less than the 24 steps that `undamped_flow` carries over


@inner
def leaps_of(C, K, A, G, th):
    """Return the short and the long leap."""
    far = FAST * max(C, math.sqrt(K)) < th
    return _leap_over(SHORT, C, K, A, G, th), _leap_over(FAR if far else LONG, C, K, A, G, th)


@inner
def _leap_over(X, C, K, A, G, th):
    """Return the leap over X <= FAR: the flow over a part of it, doubled, with the bound of its certificate."""
    part, doublings = (0.5 * X, 1) if X == SHORT else (0.25 * X, 2)
    uu, pu = _flown(1.0, 0.0, 0.0, 0.0, C, K, 0.0, 0.0, th, part)
    up, pp = _flown(0.0, 1.0, 0.0, 0.0, C, K, 0.0, 0.0, th, part)
    us, ps = _flown(0.0, 0.0, 1.0, 0.0, C, K, A, 0.0, th, part)
    uc, pc = _flown(0.0, 0.0, 0.0, 1.0, C, K, A, 0.0, th, part)
    ug, pg = _flown(0.0, 0.0, 0.0, 0.0, C, K, 0.0, G, th, part)
    flow = Flow(uu, up, pu, pp, us, uc, ug, ps, pc, pg, math.sin(th * part), math.cos(th * part))
    for _ in range(doublings):
        flow = doubled(flow)
    stretched = math.expm1(C * X) / C if C > 0.0 else X
    bend = 0.25 * stretched**2
    if th * X < math.pi:
        return Leap(flow, push=bend * A, load=bend * G, X=X)
    return Leap(flow, push=0.0, load=bend * (G + A), X=X)  # over more than half a turn the least sine is -1


@inner(forceinline=True)
def _flown(u, p, s, c, C, K, A, G, th, x):
    return evaluate(coefficients(u, p, s, c, C, K, A, G, th, False), x)


@inner
def doubled(a):
    """Return the flow over twice the length."""
    return Flow(
        uu=fma(a.uu, a.uu, a.up * a.pu),
        up=fma(a.uu, a.up, a.up * a.pp),
        pu=fma(a.pu, a.uu, a.pp * a.pu),
        pp=fma(a.pp, a.pp, a.pu * a.up),
        us=fma(a.uu, a.us, a.up * a.ps) + fma(a.us, a.cosine, -a.uc * a.sine),
        uc=fma(a.uu, a.uc, a.up * a.pc) + fma(a.uc, a.cosine, a.us * a.sine),
        ug=fma(a.uu, a.ug, a.up * a.pg) + a.ug,
        ps=fma(a.pu, a.us, a.pp * a.ps) + fma(a.ps, a.cosine, -a.pc * a.sine),
        pc=fma(a.pu, a.uc, a.pp * a.pc) + fma(a.pc, a.cosine, a.ps * a.sine),
        pg=fma(a.pu, a.ug, a.pp * a.pg) + a.pg,
        sine=2.0 * a.sine * a.cosine,
        cosine=(a.cosine - a.sine) * (a.cosine + a.sine),
    )


@inner(forceinline=True)
def stays_clear(u0, u1, half):
    """Return whether the gap, u0 >= 0 and u1 at the ends, stays open between them; `half` is q/2 (see above)."""
    short = most(fma(-0.5, u1, fma(-0.5, u0, half)), 0.0)
    return (u1 > 0.0) & (u0 * u1 >= short * short)


@inner(forceinline=True)
def flown_over(motion, by):
    """Return the motion at the end of a flow; its driving periods are not counted."""
    u, p, s, c, n = motion
    u1 = fma(by.uu, u, by.up * p) + fma(by.us, s, fma(by.uc, c, by.ug))
    p1 = fma(by.pu, u, fma(by.pp, p, fma(by.ps, s, fma(by.pc, c, by.pg))))
    return Motion(u1, p1, fma(s, by.cosine, c * by.sine), fma(c, by.cosine, -s * by.sine), n)


@inner(forceinline=True)
def _leap(leapt, over, k, below):
    """Return the state of leaps after one more, which is made where it is certified."""
    at = leapt.at
    to = flown_over(at, over.flow)
    # The least sine on the way: -1 where the cosine rises through zero, else at an end.
    lowest = select((at.c < 0.0) & (to.c > 0.0), -1.0, least(at.s, to.s))
    half = fma(-over.push, lowest, over.load)
    leaps = stays_clear(at.u, to.u, half)
    margin = leapt.margin
    if below is not None:
        # The gap less a constant is certified like the gap: what stays above the least one known is not searched.
        closest = least(below, margin)
        doubtful = leaps & no(stays_clear(at.u - closest, to.u - closest, half))
        if anywhere(doubtful):
            dips = doubtful & (dipping(at, to, k) > 0.0)
            far = doubtful & (over.X > LONG)  # enough for its rate to turn back
            if anywhere(far):
                one = flown_over(at, k.short.flow)
                two = flown_over(one, k.short.flow)
                within = most(dipping(at, one, k), most(dipping(one, two, k), dipping(two, to, k)))
                dips = dips | (far & (within > 0.0))
            if anywhere(dips):
                margin = select(dips, least(margin, _least_gap_between(at, to, over.X, k)), margin)
    return Leapt(chosen(leaps, to, at), leapt.steps + select(leaps, over.X, 0.0), margin)


@inner(forceinline=True)
def dipping(at, to, k):
    """Return a number that is positive where the gap may have a minimum between two motions of one flight.

    Its rate passes zero upwards, or its size falls at first and rises at last, but for a maximum of the gap.
    """
    slope, slope1 = acceleration(at.u, at.p, at.s, k), acceleration(to.u, to.p, to.s, k)
    turns = most(least(-at.p, to.p), least(-slope * at.p, slope1 * to.p))
    return least(most(-at.p, to.p), turns)


@inner(forceinline=False)
def _least_gap_between(at, to, X, k):
    """Return the least gap of the near-misses that a leap passed, step by step, or NONE."""
    nowhere = never(at.u)
    margin, remaining = select(nowhere, at.u, NONE), select(nowhere, at.u, X)
    while anywhere(remaining > 0.0):
        end = chosen(remaining < 1.0, to, flown_over(at, k.short.flow))
        dips = least(remaining, dipping(at, end, k)) > 0.0
        if anywhere(dips):
            slope = acceleration(end.u, end.p, end.s, k)
            gap = least_gap(series(at, k, nowhere), least(remaining, 1.0), end.p, slope)
            margin = select(dips, least(margin, gap), margin)
        at, remaining = end, remaining - 1.0
    return margin


@inner(forceinline=True)
def leap(motion, k, below=None):
    """Return the motion that leaps lead to, as near to the next contact as they can.

    Near-misses on the way are looked for where a gap is given `below` which they matter; of one that hardly approaches
    the stop, for much less than a step, nothing may be seen.
    """
    nowhere = never(motion.u)
    leapt = _leap(Leapt(motion, select(nowhere, motion.u, 0.0), select(nowhere, motion.u, NONE)), k.short, k, below)
    for _ in range(LONGS):
        before = leapt.steps
        leapt = _leap(leapt, k.long, k, below)
        if no(anywhere(leapt.steps > before)):
            break
    leapt = _leap(leapt, k.short, k, below)
    at = leapt.at
    # The periods that begin on the way: what is turned, less the difference of the phases, is a whole number.
    begun = fma(k.th * leapt.steps, 1.0 / TURN, _roughly(motion.s, motion.c) - _roughly(at.s, at.c))
    return Leapt(Motion(at.u, at.p, at.s, at.c, motion.n + whole(begun)), leapt.steps, leapt.margin)


@inner(forceinline=True)
def _roughly(s, c):
    """Return a phase, from 0 to 1, to 0.06."""
    return 0.25 * select(s < -BARELY, 3.0 + c, 1.0 - c)
