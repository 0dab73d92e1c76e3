"""Free flight as a power series in x = tau/h, the rotation of the forcing, neighbours of an orbit, and near-misses.

With b_j the j-th derivative of the gap u at x = 0, the equation of motion differentiates to
b_{j+2} = -C b_{j+1} - K b_j + e_j, where e_0 = G - A s, e_1 = -A th c, e_{j+2} = -Q e_j (the constant G enters e_0
alone; theory, equation 2.1). One formula serves every damping, and driving at w = w_n; nothing is divided.

A deviation (du, dp) at a common time obeys the homogeneous equation; how it crosses a contact is in `law`.

A near-miss is a least value of the gap that no contact follows: its rate p(x) rises through zero there. The root is
estimated, and the least gap is u - p^2/(2 u'') by the step's own series near it. Where it passes zero the orbit grazes,
and the impact map has a square root: A. B. Nordmark, "Non-periodic motion caused by grazing incidence in an impact
oscillator", J. Sound Vib. 145 (1991) 279-297.
"""

from __future__ import annotations

import math

from vibroimpact.kernels.shared.machine import inner
from vibroimpact.kernels.shared.vectors import anywhere, fma, no, select
from vibroimpact.kernels.state import Motion

# A full step is at most H radians of the fastest rate. What the series leaves out after degree 18 is about H^18/18! of
# the motion's size in its rate: 2e-16 at the end of a whole step of H = 1. Leaps do the longer ways.
REACH = 1.0

BARELY = 4e-16  # a sine so little below 0 is that of phase 0, to which the phase rounds: a period is counted there
NONE = 1e300  # stands for "no near-miss"
ROUGH, CHORDS = 0.02, 5  # a rate as near to zero, of its change over the part searched; or after so many chords
PIECES = 8  # of a step that is searched to rounding: 0.125 radians of the fastest rate each


@inner(forceinline=True)
def _four_more(b0, b1, e0, e1, C, K, Q):
    b2 = fma(-C, b1, fma(-K, b0, e0))
    b3 = fma(-C, b2, fma(-K, b1, e1))
    e2 = -Q * e0
    e3 = -Q * e1
    b4 = fma(-C, b3, fma(-K, b2, e2))
    b5 = fma(-C, b4, fma(-K, b3, e3))
    return b2, b3, b4, b5, -Q * e2, -Q * e3


@inner(forceinline=True)
def acceleration(u, p, s, k):
    """Return u'' in flight."""
    return fma(-k.C, p, fma(-k.K, u, fma(-k.A, s, k.G)))


@inner(forceinline=True)
def series(motion, k, at_release):
    """Return the coefficients a_0 ... a_18 of u(x); `at_release` the acceleration is zero by assignment."""
    u, p, s, c, _ = motion
    return coefficients(u, p, s, c, k.C, k.K, k.A, k.G, k.th, at_release)


@inner(forceinline=True)
def coefficients(u, p, s, c, C, K, A, G, th, at_release):
    """Return the coefficients that `series` returns, from single numbers."""
    Q = th * th
    e0 = -A * s
    e1 = -A * th * c
    b2 = select(at_release, 0.0, fma(-C, p, fma(-K, u, G + e0)))
    b3 = fma(-C, b2, fma(-K, p, e1))
    b4, b5, b6, b7, e6, e7 = _four_more(b2, b3, -Q * e0, -Q * e1, C, K, Q)
    b8, b9, b10, b11, e10, e11 = _four_more(b6, b7, e6, e7, C, K, Q)
    b12, b13, b14, b15, e14, e15 = _four_more(b10, b11, e10, e11, C, K, Q)
    b16 = fma(-C, b15, fma(-K, b14, e14))
    b17 = fma(-C, b16, fma(-K, b15, e15))
    b18 = fma(-C, b17, fma(-K, b16, -Q * e14))
    return (
        u, p, b2 * (1 / 2), b3 * (1 / 6), b4 * (1 / 24), b5 * (1 / 120), b6 * (1 / 720), b7 * (1 / 5040),
        b8 * (1 / 40320), b9 * (1 / 362880), b10 * (1 / 3628800), b11 * (1 / 39916800), b12 * (1 / 479001600),
        b13 * (1 / 6227020800), b14 * (1 / 87178291200), b15 * (1 / 1307674368000), b16 * (1 / 20922789888000),
        b17 * (1 / 355687428096000), b18 * (1 / 6402373705728000),
    )  # fmt: skip


@inner(forceinline=True)
def _horner4(y, d, x, a3, a2, a1, a0):
    d = fma(d, x, y)
    y = fma(y, x, a3)
    d = fma(d, x, y)
    y = fma(y, x, a2)
    d = fma(d, x, y)
    y = fma(y, x, a1)
    d = fma(d, x, y)
    y = fma(y, x, a0)
    return y, d


@inner(forceinline=True)
def evaluate(a, x):
    """Return u and du/dx at x from the coefficients of u, even and odd ones apart: two short chains, not a long one."""
    z = x * x
    even, even_rate = fma(a[18], z, a[16]), a[18]
    even, even_rate = _horner4(even, even_rate, z, a[14], a[12], a[10], a[8])
    even, even_rate = _horner4(even, even_rate, z, a[6], a[4], a[2], a[0])
    odd, odd_rate = a[17], 0.0
    odd, odd_rate = _horner4(odd, odd_rate, z, a[15], a[13], a[11], a[9])
    odd, odd_rate = _horner4(odd, odd_rate, z, a[7], a[5], a[3], a[1])
    return fma(x, odd, even), fma(2.0, fma(x, even_rate, z * odd_rate), odd)


@inner(forceinline=True)
def evaluate_roughly(a, x):
    """Return u and du/dx at x to 1/11! < 3e-8 of the motion's size, for two thirds of the price."""
    y, d = fma(a[10], x, a[9]), a[10]
    y, d = fma(y, x, a[8]), fma(d, x, y)
    y, d = _horner4(y, d, x, a[7], a[6], a[5], a[4])
    y, d = _horner4(y, d, x, a[3], a[2], a[1], a[0])
    return y, d


@inner(forceinline=True)
def sine_cosine(angle):
    """Return sin and cos of an angle up to REACH radians, by their power series."""
    return sine_cosine_from(angle, angle * angle, 1 / 355687428096000, -1 / 6402373705728000)


@inner(forceinline=True)
def sine_cosine_from(angle, z, p, q):
    """Return sin and cos of an angle with the square z from the last terms of their power series, z^8 and z^9."""
    p = fma(z, p, -1 / 1307674368000)
    p = fma(z, p, 1 / 6227020800)
    p = fma(z, p, -1 / 39916800)
    p = fma(z, p, 1 / 362880)
    p = fma(z, p, -1 / 5040)
    p = fma(z, p, 1 / 120)
    p = fma(z, p, -1 / 6)
    q = fma(z, q, 1 / 20922789888000)
    q = fma(z, q, -1 / 87178291200)
    q = fma(z, q, 1 / 479001600)
    q = fma(z, q, -1 / 3628800)
    q = fma(z, q, 1 / 40320)
    q = fma(z, q, -1 / 720)
    q = fma(z, q, 1 / 24)
    q = fma(z, q, -1 / 2)
    return fma(angle * z, p, angle), fma(z, q, 1.0)


@inner(forceinline=True)
def turned(s, c, sine, cosine):
    """Return (sin wt, cos wt) turned by an angle, and pulled back to unit length."""
    s1, c1 = fma(s, cosine, c * sine), fma(c, cosine, -s * sine)
    # One Newton step of 1/sqrt: |(s, c)| stays 1 to rounding however many steps are taken.
    pull = fma(-0.5, fma(s1, s1, c1 * c1), 1.5)
    return s1 * pull, c1 * pull


@inner(forceinline=True)
def rotate(s, c, angle):
    """Return (sin wt, cos wt) turned by an angle of at most REACH radians."""
    return turned(s, c, *sine_cosine(angle))


@inner
def flow(C, K, x):
    """Return the transition matrix of (u, p) over x steps of free flight, row by row."""
    decay = math.exp(-0.5 * C * x)
    u0, p0 = undamped_flow(1.0, 0.0, C, K, x)
    u1, p1 = undamped_flow(0.0, 1.0, C, K, x)
    return decay * u0, decay * u1, decay * p0, decay * p1


@inner
def whole_step(motion, k):
    """Return the motion after a whole step of free flight; its driving periods are not counted."""
    u, p = evaluate(series(motion, k, False), 1.0)
    s, c = rotate(motion.s, motion.c, k.th)
    return Motion(u, p, s, c, motion.n)


@inner
def product(a, b):
    """Return the matrix product a b of two 2 x 2 matrices given row by row."""
    return (
        fma(a[0], b[0], a[1] * b[2]),
        fma(a[0], b[1], a[1] * b[3]),
        fma(a[2], b[0], a[3] * b[2]),
        fma(a[2], b[1], a[3] * b[3]),
    )


@inner(forceinline=True)
def undamped_flow(du, dp, C, K, x):
    """Carry a deviation over x <= 24 steps of free flight, its decay exp(-C x/2) left out.

    With z = (K - C^2/4) x^2 the flow is exp(-C x/2) [[cos + C/2 s, s], [-K s, cos - C/2 s]], cos = cos sqrt z and
    s = x sin(sqrt z)/sqrt z, both power series in z, whatever its sign; here of a part of the way, doubled five
    times. What is doubled is w = 1 - cos, which keeps its digits where the angle is small.
    """
    half, part = 0.5 * C, x / 32.0
    z = fma(half, half, -K) * part * part
    w = fma(z, 1 / 87178291200, 1 / 479001600)
    w = fma(z, w, 1 / 3628800)
    w = fma(z, w, 1 / 40320)
    w = fma(z, w, 1 / 720)
    w = fma(z, w, 1 / 24)
    w = -z * fma(z, w, 1 / 2)
    sine = fma(z, 1 / 1307674368000, 1 / 6227020800)
    sine = fma(z, sine, 1 / 39916800)
    sine = fma(z, sine, 1 / 362880)
    sine = fma(z, sine, 1 / 5040)
    sine = fma(z, sine, 1 / 120)
    sine = fma(z, sine, 1 / 6)
    sine = part * fma(z, sine, 1.0)
    for _ in range(5):
        sine = 2.0 * sine * (1.0 - w)
        w = 2.0 * w * (2.0 - w)
    cosine, mean = 1.0 - w, half * sine
    return fma(cosine + mean, du, sine * dp), fma(cosine - mean, dp, -K * sine * du)


@inner(forceinline=True)
def least_gap(a, x, p1, q1):
    """Return the least gap within a flight of x steps from its coefficients, or NONE if there is none.

    `p1`, `q1` are the first and second derivative at its end. Good to about 1e-5 of the motion's size.
    """
    # Parted where it turns, or else halfway, the rate has one root a part, at most.
    p0, q0 = a[1], 2.0 * a[2]
    parted = x * select(q0 * q1 < 0.0, q0 / (q0 - q1), 0.5)
    middle = evaluate_roughly(a, parted)[1]
    early = (p0 < 0.0) & (middle > 0.0)
    dips, least = early | ((middle < 0.0) & (p1 > 0.0)), select(early, NONE, NONE)
    if anywhere(dips):
        # In its part the rate is a parabola through both ends with the slope at the outer one, then a chord.
        outer, length = select(early, p0, p1), select(early, parted, x - parted)
        slope = length * select(early, q0, -q1)
        bend = middle - outer - slope
        t = outer / (outer - middle)
        better = t - fma(t, fma(t, bend, slope), outer) / fma(2.0 * t, bend, slope)
        t = length * select((better > 0.0) & (better < 1.0), better, t)
        low, high, at_low, at_high = select(early, 0.0, 0.0), length, outer, middle
        for _ in range(CHORDS):
            u, p = evaluate_roughly(a, select(early, t, x - t))
            short = p * outer > 0.0
            low, at_low = select(short, t, low), select(short, p, at_low)
            high, at_high = select(short, high, t), select(short, at_high, p)
            inverse = (high - low) / (at_high - at_low)
            rough = dips & (abs(p) > ROUGH * abs(outer - middle))
            if no(anywhere(rough)):
                break
            t = select(rough, fma(-at_low, inverse, low), t)
        lower = fma(-0.5 * p * p, abs(inverse), u)
        least = select(dips & (lower > 0.0), lower, NONE)
    return least


@inner
def least_gap_exactly(motion, k, x, below):
    """Return the least gap within a flight of x steps, to rounding, or NONE.

    One that is not `below` this gap may be left out.
    """
    least = NONE
    while x > 1.0:
        least = min(least, _least_in_step(motion, k, 1.0, min(below, least)))
        motion, x = whole_step(motion, k), x - 1.0
    return min(least, _least_in_step(motion, k, x, min(below, least)))


@inner
def _least_in_step(motion, k, x, below):
    """Return the least gap within a step, searched in pieces."""
    a = series(motion, k, False)
    least, change = NONE, 0.0
    for j in range(len(a) - 1, 1, -1):
        change = x * (change + 1.001 * j * abs(a[j]))
    # Neither where the rate keeps its sign, nor where the gap stays above u + min(p, 0) x - change x/2.
    if abs(motion.p) > change or motion.u + (min(motion.p, 0.0) - 0.5 * change) * x > below:
        return least
    before, slope = motion.p, acceleration(motion.u, motion.p, motion.s, k)
    for piece in range(PIECES):
        low, high = x * piece / PIECES, x * (piece + 1.0) / PIECES
        after, later = _rate(motion, a, k, high)
        first, last = before, after
        if before * after > 0.0 and before * slope < 0.0 and after * later > 0.0:  # it comes nearer to zero between
            turn = _turn(motion, a, k, low, high, slope)
            if before < 0.0:
                high, last = turn, evaluate(a, turn)[1]
            else:
                low, first = turn, evaluate(a, turn)[1]
        if first < 0.0 and last > 0.0:
            at = low + (high - low) * first / (first - last)
            for _ in range(60):
                rate, curvature = _rate(motion, a, k, at)
                if rate > 0.0:
                    high = at
                else:
                    low = at
                better = at - rate / curvature if curvature > 0.0 else 0.5 * (low + high)
                if not low <= better <= high:
                    better = 0.5 * (low + high)
                if abs(better - at) <= 1e-15 * x:
                    break
                at = better
            least = min(least, evaluate(a, at)[0])
        before, slope = after, later
    return least


@inner
def _rate(motion, a, k, x):
    """Return the rate of the gap within a step, and its slope."""
    u, p = evaluate(a, x)
    return p, acceleration(u, p, rotate(motion.s, motion.c, k.th * x)[0], k)


@inner
def _turn(motion, a, k, low, high, slope):
    """Return where the rate turns between two places at which its slope has different signs."""
    for _ in range(50):
        middle = 0.5 * (low + high)
        if _rate(motion, a, k, middle)[1] * slope > 0.0:
            low = middle
        else:
            high = middle
    return low
