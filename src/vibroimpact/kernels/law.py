"""At the stop: what an impact at closing speed v does, the tail of a chatter, sticking and release.

All that depends on the contact law, here Newton's v -> r v, stands in this file: the speed after an impact, how
neighbours of an orbit cross it, how long a chatter lasts, and the energy lost at the stop.

Neighbours at a common time do not hit at the same time: with p the rate of the gap just before an impact and a-, a+ its
second derivatives just before and after, saltation (theory, eq. 5.1) takes a deviation (du, dp) to

    du -> -r du,    dp -> (a+ + r a-)/p du - r dp.

Over a closed cycle of n periods and p impacts the determinant is r^(2p) exp(-c n T / m) (eq. 5.2). Saltation is due
to M. A. Aizerman and F. R. Gantmakher, "On the stability of periodic motions", J. Appl. Math. Mech. 22 (1958) 1065; for
Lyapunov exponents of systems with jumps see P. C. Müller, "Calculation of Lyapunov exponents for dynamic systems with
discontinuities", Chaos, Solitons & Fractals 5 (1995) 1671, and R. I. Leine and H. Nijmeijer, "Dynamics and
Bifurcations of Non-Smooth Mechanical Systems", Springer (2004).

An impact of speed v under a pressing acceleration a = A s - G > 0 starts a complete chatter (infinitely many
impacts in finite time) that to leading order ends after t1 = 2 r v / ((1 - r) a) (eq. 4.2). It is taken as complete
only if t1 is well before the release, when the force lets go: C. Budd and F. Dux, "Chattering and related behaviour in
impact oscillators", Phil. Trans. R. Soc. Lond. A 347 (1994) 365-389.
"""

from __future__ import annotations

from vibroimpact.kernels.shared.machine import inner
from vibroimpact.kernels.shared.vectors import fma, select

NEVER = 1e300  # stands for 2 r/(1 - r) at r = 1, where chatter does not end
COMPLETES = 0.6  # of the time to release: beyond it the leading order of t1 proves nothing
SHORT = 1e-4  # of a step: over a shorter tail the second order of its end is exact to rounding
HOLD = 1e-3  # of the cut: an impact this slow under a pressing force is held


@inner(forceinline=True)
def speed_after(v, r):
    """Return the speed just after an impact of speed v."""
    return r * v


@inner(forceinline=True)
def _accelerations(v, s, k):
    """Return the second derivatives of the gap just before and just after an impact of speed v at sin wt = s."""
    force = fma(-k.A, s, k.G)
    return fma(k.C, v, force), fma(-k.C * k.r, v, force)


@inner
def saltation(v, s, k):
    """Return the saltation matrix of an impact of speed v (in steps) at sin wt = s, row by row."""
    before, after = _accelerations(v, s, k)
    return -k.r, 0.0, -(after + k.r * before) / v, -k.r


@inner(forceinline=True)
def across_impact(du, dp, v, s, k):
    """Carry a deviation over an impact of speed v (in steps) at sin wt = s: its saltation, in fewer roundings."""
    before, after = _accelerations(v, s, k)
    return -k.r * du, fma(-fma(k.r, before, after) / v, du, -k.r * dp)


@inner
def chatter_factor(r):
    """Return the duration of a chatter times the pressing acceleration, per unit of the speed of its first impact."""
    return 2.0 * r / (1.0 - r) if r < 1.0 else NEVER


@inner
def energy_loss(mass, r):
    """Return the energy that an impact of unit speed loses; the loss grows with the square of the speed."""
    return 0.5 * mass * (1.0 - r) * (1.0 + r)


@inner(forceinline=True)
def pressed(s, c, k):
    """Return whether the force presses a mass at rest on the stop, and whether it is in balance.

    The first non-zero of y'', y''', y'''' decides; at balance that is the sign of cos wt, and at both extremes of
    the force the sign of A -+ G.
    """
    push = fma(k.A, s, -k.G)
    size = k.A + abs(k.G)
    balance = abs(push) <= 4.5e-16 * size
    towards = select(balance, c, push)
    return (k.G <= -k.A) | ((k.G < k.A) & (towards > 0.0)), balance


@inner(forceinline=True)
def _angle_to_release_at_least(s, c, k):
    """Return a lower bound of the driving angle from (s, c) to the release, within 0.63 of it."""
    sine = fma(k.sr, c, -k.cr * s)
    cosine = fma(k.cr, c, k.sr * s)
    return select((cosine > 0.0) & (sine > 0.0), sine, 1.0)


@inner(forceinline=True)
def chatters(v, s, c, k):
    """Return whether the mass stays at the stop after an impact below the cut: its chatter is complete, or slow."""
    push = fma(k.A, s, -k.G)
    duration = k.tail * v  # times push: t1 = duration / push
    reach = COMPLETES * _angle_to_release_at_least(s, c, k)
    complete = (duration < SHORT * push) & ((k.G <= -k.A) | (duration * k.th < reach * push))
    return (push > 0.0) & (k.r < 1.0) & (complete | (v < HOLD * k.cut))


@inner(forceinline=True)
def tail_duration(v, s, c, k):
    """Return the time in steps for which the chatter goes on after an impact of speed v: t1 - t1^2 (J/(3a) + C/6)."""
    push = fma(k.A, s, -k.G)
    t1 = select(push > 0.0, k.tail * v / push, 0.0)
    t1 = select(t1 < 0.05, t1, 0.0)  # longer only where a mass was held that might have flown on
    return t1 - t1 * t1 * (k.A * k.th * c / (3.0 * push) + k.C / 6.0)
