"""The certified step: how far the mass flies without any chance of having touched the stop.

The gap is the polynomial u(x) = x^m (q_0 + q_1 x + q_2 x^2 + ...) with the contact it starts from divided out:
m = 0 in mid-flight, 1 just after an impact, 2 leaving from rest, 3 at a release. On 0 <= x <= X <= 1
the negative terms from the fourth degree on sum to at least -T X x^3 with T = sum max(-q_j, 0) X^(j-4), so the cubic
term and all behind it to at least d x^3, d = q_3 - T X. That in turn is at least d X x^2 if d < 0, and if d > 0 both 0
and, since x (x - X)^2 >= 0, the tangent d (2 X x^2 - X^2 x). What remains is a quadratic lower bound of u/x^m; its
smallest positive root cannot lie beyond the first contact. The bounds are sharp at x = X.
"""

from __future__ import annotations

import math

from vibroimpact.kernels.shared.machine import inner
from vibroimpact.kernels.shared.vectors import fma, select

CANCELS = 1e-3  # of a coefficient: a difference so small has lost digits


@inner(forceinline=True)
def negative_part(a):
    """Return a number that is negative, or 0."""
    return select(a < 0.0, a, 0.0)


@inner(forceinline=True)
def root_at_least(q0, q1, q2, cubic, X):
    """Return a lower bound of the smallest positive root of q0 + q1 x + q2 x^2 + cubic x^3 with q0 >= 0, X at most."""
    # The tangent costs slope near x = 0: worth it only where that does not bring a false contact near.
    slope = cubic * X * X
    tangent = (cubic > 0.0) & (2.0 * slope < -q1)
    linear = select(tangent, q1 - slope, q1)
    square = fma(select(tangent, 2.0 * cubic, negative_part(cubic)), X, q2)
    discriminant = fma(linear, linear, -4.0 * q0 * square)
    root = math.sqrt(select(discriminant > 0.0, discriminant, 0.0))
    cancels = root - linear < CANCELS * linear  # q0 is small, and the gap grows at first: the sum keeps its digits
    above, below = select(cancels, root + linear, 2.0 * q0), select(cancels, -2.0 * square, root - linear)
    x = select((discriminant >= 0.0) & (below > 0.0), above / below, X)
    return select(x < X, x, X)


@inner(forceinline=True)
def _tail_from_7(a, A):
    """Return a lower bound of the sum of a_j x^(j-7) from j = 7 on over 0 <= x <= 1.

    It is one of absolute terms: |b_j| <= 3^(j-7) B with B = |b_7| + |b_8|/3 + A, by induction, since C <= 2 H,
    K <= H^2, th <= H and 3 C + K + 1 <= 9 at H = 1. That sums to 1.56 B/7!. Near the contact, where x^7 is small,
    nothing is lost.
    """
    return -1.56 * (abs(a[7]) + fma(8.0 / 3.0, abs(a[8]), A * (1 / 5040)))


@inner(forceinline=True)
def _shift(leaving, at_rest, at_release, resting, a0, a1, a2, a3):
    first = select(leaving, a1, a0)
    if resting:
        return select(at_release, a3, select(at_rest, a2, first))
    return first


@inner(forceinline=True)
def certified_step(a, A, leaving, at_rest, at_release, resting):
    """Return an x in (0, 1] such that u > 0 on all of (0, x), from the coefficients of u and the drive A.

    `leaving`: the flight starts at the stop. `at_rest`: with zero velocity too. `at_release`: with zero
    acceleration too. Each includes the next. `resting`: whether there is one at rest among the lanes.
    """
    q0 = _shift(leaving, at_rest, at_release, resting, a[0], a[1], a[2], a[3])
    q1 = _shift(leaving, at_rest, at_release, resting, a[1], a[2], a[3], a[4])
    q2 = _shift(leaving, at_rest, at_release, resting, a[2], a[3], a[4], a[5])
    q3 = _shift(leaving, at_rest, at_release, resting, a[3], a[4], a[5], a[6])
    q4 = _shift(leaving, at_rest, at_release, resting, a[4], a[5], a[6], a[7])
    # Only efficiency hangs on X: half a step if the contact seems to lie within, else a whole one.
    half = fma(0.5, fma(0.5, fma(0.5, fma(0.5, q4, q3), q2), q1), q0)
    X = select(half < 0.0, 0.5, 1.0)
    t7 = _tail_from_7(a, A)
    t6 = fma(t7, X, negative_part(a[6]))
    t5 = fma(t6, X, negative_part(a[5]))
    t4 = fma(t5, X, negative_part(a[4]))
    cubic = fma(_shift(leaving, at_rest, at_release, resting, t4, t5, t6, t7), X, q3)
    return root_at_least(q0, q1, q2, cubic, X)
