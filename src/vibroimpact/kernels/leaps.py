"""Leaps: long ways far from the stop by a matrix that is computed once a cell, certified by a chord.

The flow over a fixed length X is linear in (u, p, sin wt, cos wt, 1), so a leap costs some twenty multiply-adds. It is
made only where the stop is surely not reached on the way.

The certificate takes its bound from the clearance: in flight u'' + C u' + K u = f with f <= M over the leap, here
f = G - A sin wt and M its largest value there, or 0. With t = (1 - e^{-Cx})/(1 - e^{-CX}), from 0 to 1, let
v = (1 - t) u0 + t u1 - q t (1 - t), q = M ((e^{CX} - 1)/C)^2 / 2. Then v'' + C v' = M e^{2C(X - x)} >= M, so that where
v >= 0 the difference d = u - v has d'' + C d' + K d <= 0, and it vanishes at both ends. An equation whose solutions
cannot vanish twice within X, as (K - C^2/4) X^2 < pi^2, has a Green's function of one sign (Sturm): d >= 0. And v > 0
inside where sqrt(u0) + sqrt(u1) > sqrt(q) (theory, equation 2.2), for any damping, and from the stop itself (u0 = 0).

A leap that is not certified changes nothing. None is made over a least gap (the rate rises through zero): near-misses
are looked for in full steps.
"""

from __future__ import annotations

import math

from numba import njit

from vibroimpact.kernels.flight import BARELY, coefficients, evaluate
from vibroimpact.kernels.machine import fma, inner, select
from vibroimpact.kernels.state import Flow, Leap, Motion

# In steps, radians of the fastest rate: both below pi. Of some 400 sequences of 3 to 6 leaps of 0.4 to 2.8 none takes
# clearly less time an impact, at w = 2, 2.8 and over 0.05 to 5, than the one in `leap`. Both are doubled from half a
# step, over which the series loses nothing.
SHORT, LONG = 1.0, 2.0


@njit(error_model="numpy")
def leaps_of(C, K, A, G, th):
    """Return the short and the long leap: the flow over half a step, doubled, and doubled again."""
    part = 0.5 * SHORT
    uu, pu = _flown(1.0, 0.0, 0.0, 0.0, C, K, 0.0, 0.0, th, part)
    up, pp = _flown(0.0, 1.0, 0.0, 0.0, C, K, 0.0, 0.0, th, part)
    us, ps = _flown(0.0, 0.0, 1.0, 0.0, C, K, A, 0.0, th, part)
    uc, pc = _flown(0.0, 0.0, 0.0, 1.0, C, K, A, 0.0, th, part)
    ug, pg = _flown(0.0, 0.0, 0.0, 0.0, C, K, 0.0, G, th, part)
    half = Flow(uu, up, pu, pp, us, uc, ug, ps, pc, pg, math.sin(th * part), math.cos(th * part))
    short = _doubled(half)
    return _bounded(short, C, A, G, SHORT), _bounded(_doubled(short), C, A, G, LONG)


@inner(forceinline=True)
def _flown(u, p, s, c, C, K, A, G, th, x):
    return evaluate(coefficients(u, p, s, c, C, K, A, G, th, False), x)


@inner
def _doubled(a):
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


@inner
def _bounded(flow, C, A, G, X):
    """Return a flow over X <= pi with the bound of its certificate."""
    stretched = math.expm1(C * X) / C if C > 0.0 else X
    bend = 0.25 * stretched**2
    return Leap(flow, push=bend * A, load=bend * G)


@njit(error_model="numpy", forceinline=True)
def stays_clear(u0, u1, half):
    """Return whether the gap, u0 >= 0 and u1 at the ends, stays open between them; `half` is q/2 (see above)."""
    short = max(fma(-0.5, u1, fma(-0.5, u0, half)), 0.0)
    return (u1 > 0.0) & (u0 * u1 >= short * short)


@inner(forceinline=True)
def _leap(u, p, s, c, flown, over, X):
    by = over.flow
    u1 = fma(by.uu, u, by.up * p) + fma(by.us, s, fma(by.uc, c, by.ug))
    p1 = fma(by.pu, u, fma(by.pp, p, fma(by.ps, s, fma(by.pc, c, by.pg))))
    s1 = fma(s, by.cosine, c * by.sine)
    c1 = fma(c, by.cosine, -s * by.sine)
    # The least sine on the way: -1 where the cosine rises through zero, else at an end.
    least = select((c < 0.0) & (c1 > 0.0), -1.0, min(s, s1))
    leaps = stays_clear(u, u1, fma(-over.push, least, over.load)) & ((p >= 0.0) | (p1 <= 0.0))
    return (
        select(leaps, u1, u),
        select(leaps, p1, p),
        select(leaps, s1, s),
        select(leaps, c1, c),
        flown + select(leaps, X, 0.0),
    )


@njit(error_model="numpy", forceinline=True)
def leap(motion, k):
    """Return the motion as near to the next contact as leaps carry it, and the steps passed."""
    u, p, s, c, n = motion
    u, p, s1, c, flown = _leap(u, p, s, c, 0.0, k.short, SHORT)
    u, p, s1, c, flown = _leap(u, p, s1, c, flown, k.long, LONG)
    u, p, s2, c, flown = _leap(u, p, s1, c, flown, k.long, LONG)
    u, p, s3, c, flown = _leap(u, p, s2, c, flown, k.long, LONG)
    u, p, s3, c, flown = _leap(u, p, s3, c, flown, k.short, SHORT)
    periods = _passed(s, s1) + _passed(s1, s2) + _passed(s2, s3)
    return Motion(u, p, s3, c, n + periods), flown


@inner(forceinline=True)
def _passed(s, s1):
    """Return the periods that begin between two sines less than half a turn apart: leaps of at most 3 steps."""
    return select((s < -BARELY) & (s1 >= -BARELY), 1.0, 0.0)
