"""Near-misses: where the gap has a least value in flight and no contact follows.

The rate p(x) of the gap rises through zero there. Its root is estimated, and the least gap is u - p^2/(2 u'') by the
step's own series near it. Where it passes zero the orbit grazes, and the impact map has a square root: A. B. Nordmark,
"Non-periodic motion caused by grazing incidence in an impact oscillator", J. Sound Vib. 145 (1991) 279-297.
"""

from __future__ import annotations

from numba import njit

from vibroimpact.kernels.flight import acceleration, evaluate, evaluate_roughly, rotate, series
from vibroimpact.kernels.machine import fma, select

NONE = 1e300  # stands for "no near-miss"
PIECES = 16  # of a step that is searched to rounding: 0.15 radians of the fastest rate each


@njit(inline="always", error_model="numpy")
def least_gap(a, x, p1, q1, lands):
    """Return the least gap within a flight of x steps from its coefficients, or NONE if there is none.

    `p1`, `q1` are the first and second derivative at its end, without meaning where it `lands` there. Good to about
    1e-5 of the motion's size; a dip of less than half a step may be overlooked.
    """
    half = 0.5 * x
    p0, middle = a[1], evaluate_roughly(a, half)[1]
    early = (p0 < 0.0) & (middle > 0.0)
    late = (middle < 0.0) & (p1 > 0.0) & (lands == False)  # noqa: E712
    # In its half the rate is taken as the parabola through both ends, with the slope at the outer one.
    outer = select(early, p0, p1)
    slope = half * select(early, 2.0 * a[2], -q1)
    bend = middle - outer - slope
    t = outer / (outer - middle)
    inverse = 1.0 / fma(2.0 * t, bend, slope)
    better = fma(-fma(t, fma(t, bend, slope), outer), inverse, t)
    improved = (better > 0.0) & (better < 1.0)
    t = half * select(improved, better, t)
    u, p = evaluate_roughly(a, select(early, t, x - t))
    lower = fma(-0.5 * p * p, half * select(improved, abs(inverse), 0.0), u)
    return select((early | late) & (lower > 0.0), lower, NONE)


@njit(error_model="numpy")
def least_gap_exactly(motion, k, x):
    """Return the least gap within a flight of x steps, to rounding, or NONE; the step is searched in pieces."""
    a = series(motion, k, False)
    least = NONE
    before = motion.p
    for piece in range(PIECES):
        low, high = x * piece / PIECES, x * (piece + 1.0) / PIECES
        after = evaluate(a, high)[1]
        if before < 0.0 and after > 0.0:
            at = low + (high - low) * before / (before - after)
            for _ in range(60):
                value, rate = evaluate(a, at)
                if rate > 0.0:
                    high = at
                else:
                    low = at
                s, _ = rotate(motion.s, motion.c, k.th * at)
                curvature = acceleration(value, rate, s, k)
                better = at - rate / curvature if curvature > 0.0 else 0.5 * (low + high)
                if not low <= better <= high:
                    better = 0.5 * (low + high)
                if abs(better - at) <= 1e-15 * x:
                    break
                at = better
            least = min(least, evaluate(a, at)[0])
        before = after
    return least
