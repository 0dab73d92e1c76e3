"""The contact law: what an impact at closing speed v does, here Newton's v -> r v.

All that depends on the law stands in this file: the speed after an impact, how neighbours of an orbit cross it, how
long a chatter lasts, and the energy lost at the stop.

Neighbours at a common time do not hit at the same time: with p the rate of the gap just before an impact and a-, a+ its
second derivatives just before and after, saltation takes a deviation (du, dp) to

    du -> -r du,    dp -> (a+ + r a-)/p du - r dp.

Over a closed cycle of n periods and p impacts the determinant is r^(2p) exp(-c n T / m). Saltation is due to M. A.
Aizerman and F. R. Gantmakher, "On the stability of periodic motions", J. Appl. Math. Mech. 22 (1958) 1065; for Lyapunov
exponents of systems with jumps see P. C. Müller, "Calculation of Lyapunov exponents for dynamic systems with
discontinuities", Chaos, Solitons & Fractals 5 (1995) 1671, and R. I. Leine and H. Nijmeijer, "Dynamics and
Bifurcations of Non-Smooth Mechanical Systems", Springer (2004).
"""

from __future__ import annotations

from numba import njit

from vibroimpact.kernels.machine import fma

NEVER = 1e300  # stands for 2 r/(1 - r) at r = 1, where chatter does not end


@njit(inline="always", error_model="numpy")
def speed_after(v, r):
    """Return the speed just after an impact of speed v."""
    return r * v


@njit(inline="always", error_model="numpy")
def _accelerations(v, s, k):
    """Return the second derivatives of the gap just before and just after an impact of speed v at sin wt = s."""
    force = fma(-k.A, s, k.G)
    return fma(k.C, v, force), fma(-k.C * k.r, v, force)


@njit(error_model="numpy")
def saltation(v, s, k):
    """Return the saltation matrix of an impact of speed v (in steps) at sin wt = s, row by row."""
    before, after = _accelerations(v, s, k)
    return -k.r, 0.0, -(after + k.r * before) / v, -k.r


@njit(inline="always", error_model="numpy")
def across_impact(du, dp, v, s, k):
    """Carry a deviation over an impact of speed v (in steps) at sin wt = s: its saltation, in fewer roundings."""
    before, after = _accelerations(v, s, k)
    return -k.r * du, fma(-fma(k.r, before, after) / v, du, -k.r * dp)


@njit(error_model="numpy")
def chatter_factor(r):
    """Return the duration of a chatter times the pressing acceleration, per unit of the speed of its first impact."""
    return 2.0 * r / (1.0 - r) if r < 1.0 else NEVER


@njit(error_model="numpy")
def energy_loss(mass, r):
    """Return the energy that an impact of unit speed loses; the loss grows with the square of the speed."""
    return 0.5 * mass * (1.0 - r) * (1.0 + r)
