"""At the stop: rebound, the tail of a chatter, sticking and release.

An impact of speed v under a pressing acceleration a = A s - G > 0 starts a complete chatter (infinitely many
impacts in finite time) that to leading order ends after t1 = 2 r v / ((1 - r) a). It is taken as complete only if t1 is
well before the release, when the force lets go.

Chatter is analysed in C. Budd and F. Dux, "Chattering and related behaviour in impact oscillators", Phil. Trans. R.
Soc. Lond. A 347 (1994) 365-389.
"""

from __future__ import annotations

from numba import njit

from vibroimpact.kernels.law import speed_after
from vibroimpact.kernels.machine import fma, select

COMPLETES = 0.6  # of the time to release: beyond it the leading order of t1 proves nothing
SHORT = 1e-4  # of a step: over a shorter tail the second order of its end is exact to rounding
HOLD = 1e-3  # of the cut: an impact this slow under a pressing force is held


@njit(inline="always", error_model="numpy")
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


@njit(inline="always", error_model="numpy")
def _angle_to_release_at_least(s, c, k):
    """Return a lower bound of the driving angle from (s, c) to the release, within 0.63 of it."""
    sine = fma(k.sr, c, -k.cr * s)
    cosine = fma(k.cr, c, k.sr * s)
    return select((cosine > 0.0) & (sine > 0.0), sine, 1.0)


@njit(inline="always", error_model="numpy")
def rebound(v, s, c, k):
    """Return the speed after an impact of speed v (0: stays), and whether a chatter's tail was closed by it."""
    push = fma(k.A, s, -k.G)
    duration = k.tail * v  # times push: t1 = duration / push
    reach = COMPLETES * _angle_to_release_at_least(s, c, k)
    complete = (duration < SHORT * push) & ((k.G <= -k.A) | (duration * k.th < reach * push))
    held = (v < k.cut) & (push > 0.0) & (k.r < 1.0) & (complete | (v < HOLD * k.cut))
    return select(held, 0.0, speed_after(v, k.r)), held


@njit(inline="always", error_model="numpy")
def tail_duration(v, s, c, k):
    """Return how long, in steps, the chatter goes on after an impact of speed v: t1 - t1^2 (J/(3a) + C/6)."""
    push = fma(k.A, s, -k.G)
    t1 = select(push > 0.0, k.tail * v / push, 0.0)
    t1 = select(t1 < 0.05, t1, 0.0)  # longer only where a mass was held that might have flown on
    return t1 - t1 * t1 * (k.A * k.th * c / (3.0 * push) + k.C / 6.0)
