"""How neighbours of an orbit move: the tangent of a certified step, and of the contact at its end.

A deviation (du, dp) at a common time obeys the homogeneous equation in flight. At an impact, with p the rate just
before it and a-, a+ the second derivatives of the gap just before and after, saltation takes it to

    du -> -r du,    dp -> (a+ + r a-)/p du - r dp.

Over a closed cycle of n periods and p impacts the determinant is r^(2p) exp(-c n T / m).
"""

from __future__ import annotations

from numba import njit

from vibroimpact.kernels.arithmetic import fma
from vibroimpact.kernels.flight import evaluate, series


@njit(error_model="numpy")
def flow(C, K, x):
    """Return the transition matrix of (u, p) over x steps of free flight, row by row."""
    u0, p0 = evaluate(series(1.0, 0.0, 0.0, 1.0, C, K, 0.0, 0.0, 0.0, 0.0, False), x)
    u1, p1 = evaluate(series(0.0, 1.0, 0.0, 1.0, C, K, 0.0, 0.0, 0.0, 0.0, False), x)
    return u0, u1, p0, p1


@njit(error_model="numpy")
def saltation(v, s, c, C, A, G, r):
    """Return the saltation matrix of an impact of speed v (in steps) at (s, c), row by row."""
    force = fma(-A, s, G)
    before = fma(C, v, force)
    after = fma(-C * r, v, force)
    return -r, 0.0, -(after + r * before) / v, -r


@njit(error_model="numpy")
def product(a, b):
    """Return the matrix product a b of two 2 x 2 matrices given row by row."""
    return (
        fma(a[0], b[0], a[1] * b[2]),
        fma(a[0], b[1], a[1] * b[3]),
        fma(a[2], b[0], a[3] * b[2]),
        fma(a[2], b[1], a[3] * b[3]),
    )
