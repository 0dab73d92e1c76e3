"""How neighbours of an orbit move in free flight: the tangent of a certified step. `law` has that of a contact.

A deviation (du, dp) at a common time obeys the homogeneous equation of motion.
"""

from __future__ import annotations

from numba import njit

from vibroimpact.kernels.flight import evaluate, series
from vibroimpact.kernels.machine import fma
from vibroimpact.kernels.state import Constants, Motion


@njit(error_model="numpy")
def flow(C, K, x):
    """Return the transition matrix of (u, p) over x steps of free flight, row by row."""
    homogeneous = Constants(C, K, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    u0, p0 = evaluate(series(Motion(1.0, 0.0, 0.0, 1.0, 0.0), homogeneous, False), x)
    u1, p1 = evaluate(series(Motion(0.0, 1.0, 0.0, 1.0, 0.0), homogeneous, False), x)
    return u0, u1, p0, p1


@njit(error_model="numpy")
def product(a, b):
    """Return the matrix product a b of two 2 x 2 matrices given row by row."""
    return (
        fma(a[0], b[0], a[1] * b[2]),
        fma(a[0], b[1], a[1] * b[3]),
        fma(a[2], b[0], a[3] * b[2]),
        fma(a[2], b[1], a[3] * b[3]),
    )


@njit(inline="always", error_model="numpy")
def undamped_flow(du, dp, C, K, x):
    """Carry a deviation over x <= 1 steps of free flight, its decay exp(-C x/2) left out.

    With z = (K - C^2/4) x^2 the flow is exp(-C x/2) [[cos + C/2 s, s], [-K s, cos - C/2 s]], cos = cos sqrt z and
    s = x sin(sqrt z)/sqrt z, both power series in z, whatever its sign.
    """
    half = 0.5 * C
    z = fma(half, half, -K) * x * x
    cosine = fma(z, 1 / 620448401733239439360000, 1 / 1124000727777607680000)
    cosine = fma(z, cosine, 1 / 2432902008176640000)
    cosine = fma(z, cosine, 1 / 6402373705728000)
    cosine = fma(z, cosine, 1 / 20922789888000)
    cosine = fma(z, cosine, 1 / 87178291200)
    cosine = fma(z, cosine, 1 / 479001600)
    cosine = fma(z, cosine, 1 / 3628800)
    cosine = fma(z, cosine, 1 / 40320)
    cosine = fma(z, cosine, 1 / 720)
    cosine = fma(z, cosine, 1 / 24)
    cosine = fma(z, cosine, 1 / 2)
    cosine = fma(z, cosine, 1.0)
    sine = fma(z, 1 / 15511210043330985984000000, 1 / 25852016738884976640000)
    sine = fma(z, sine, 1 / 51090942171709440000)
    sine = fma(z, sine, 1 / 121645100408832000)
    sine = fma(z, sine, 1 / 355687428096000)
    sine = fma(z, sine, 1 / 1307674368000)
    sine = fma(z, sine, 1 / 6227020800)
    sine = fma(z, sine, 1 / 39916800)
    sine = fma(z, sine, 1 / 362880)
    sine = fma(z, sine, 1 / 5040)
    sine = fma(z, sine, 1 / 120)
    sine = fma(z, sine, 1 / 6)
    sine = x * fma(z, sine, 1.0)
    mean = half * sine
    return fma(cosine + mean, du, sine * dp), fma(cosine - mean, dp, -K * sine * du)
