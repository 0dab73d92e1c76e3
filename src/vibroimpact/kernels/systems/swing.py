"""How far a system swings along a direction: sums over a step that is about to be made.

The displacement is y = r . eta + g(t), of a coordinate, a point, or a clearance, whose stop may move. Its extremes are
those at the ends of steps and where its rate changes sign; integrals of y, y^2, y sin wt and y cos wt, and of squares
of the stops' forces, are those of Gauss and Legendre with eight nodes a step, which is rounding.
"""

from __future__ import annotations

from vibroimpact.kernels.flight import turned
from vibroimpact.kernels.shared.deferred import deferred
from vibroimpact.kernels.shared.machine import inner
from vibroimpact.kernels.shared.series import SIZE, bend, coefficients, load, plus_times, times, valued
from vibroimpact.kernels.shared.trough import trough
from vibroimpact.kernels.shared.vectors import anywhere, get, least, most, no, put, select
from vibroimpact.kernels.systems.elements import pushes
from vibroimpact.kernels.systems.flow import driven, sine_cosine
from vibroimpact.kernels.systems.push import NODES

# The time of the sums, in steps, the sums, the least and the largest y, and the time up to the end of a driving period.
LENGTH, MEAN, SQUARE, SINE, COSINE, LEAST, LARGEST, LEFT = range(8)
OVER = 1e-12  # steps: a driving period of which rounding leaves no more is over


@inner(forceinline=True)
def end_with_period(rows, end, close, k, wide):
    """Return the end of a step that does not go beyond the driving period, and whether it still ends at a contact."""
    left = get(rows, k.swing + LEFT, wide) / get(rows, k.pace, wide)
    cut = left + OVER < end
    return select(cut, left, end), close & no(cut)


@inner(forceinline=True)
def _along(rows, pace, k, wide):
    """Return the coefficients of y."""
    still = k.along + k.modes
    b = driven(rows, get(rows, still, wide), still + 1, pace, k, wide)
    for j in range(k.modes):
        b = plus_times(b, get(rows, k.along + j, wide), load(rows, k.flight + j * SIZE, wide))
    return coefficients(b)


@deferred("swings of systems", 2)
def swing(rows, end, held, k, wide):
    """Add what a step comes to."""
    pace, at = get(rows, k.pace, wide), k.swing
    a = _along(rows, pace, k, wide)
    _stretch(rows, a, end, k, wide)
    sine, cosine, theta = get(rows, k.turn, wide), get(rows, k.turn + 1, wide), pace * get(rows, k.theta, wide)
    sine, cosine = turned(sine, cosine, *sine_cosine(0.5 * theta * end))
    mean = square = upright = across = 0.0 * end
    for node, weight in NODES[:4]:  # and the one as far from the middle of the step, where the load has this phase
        (y, _), (y1, _) = valued(a, node * end), valued(a, (1.0 - node) * end)
        sine_off, cosine_off = sine_cosine((0.5 - node) * theta * end)
        even, odd = weight * (y1 + y), weight * (y1 - y)
        mean, square = mean + even, square + weight * (y * y + y1 * y1)
        upright, across = upright + even * cosine_off, across + odd * sine_off
    s, c = sine * upright + cosine * across, cosine * upright - sine * across
    length = end * pace
    for row, share in ((LENGTH, 1.0 + 0.0 * end), (MEAN, mean), (SQUARE, square), (SINE, s), (COSINE, c)):
        put(rows, at + row, wide, get(rows, at + row, wide) + share * length)
    left = get(rows, at + LEFT, wide)
    put(rows, at + LEFT, wide, select(left <= length + OVER, 0.0, left - length))
    if k.compliant and held:
        _strengthen(rows, end, pace, k, wide)


@inner(forceinline=True)
def _stretch(rows, a, end, k, wide):
    """Raise and lower the extremes.

    With |y''| <= B the rate is (p0 + p1 - B x)/2 at least on the way x between p0 and p1, and does not change its sign
    where |p0 + p1| > B x; y leaves the range of its ends by B x^2/8 at most.
    """
    low, high, bound = get(rows, k.swing + LEAST, wide), get(rows, k.swing + LARGEST, wide), bend(a)
    last, rate = valued(a, end)
    lower, higher, sag = least(a[0], last), most(a[0], last), 0.125 * bound * end * end
    low, high, turning = least(low, lower), most(high, higher), abs(a[1] + rate) <= bound * end
    falls, rises = turning & (lower - sag < low), turning & (higher + sag > high)
    if anywhere(falls):
        low, _ = trough(a, end, falls, low, 0.0 * end)
    if anywhere(rises):
        lowest, _ = trough(times(a, -1.0), end, rises, -high, 0.0 * end)
        high = -lowest
    put(rows, k.swing + LEAST, wide, low)
    put(rows, k.swing + LARGEST, wide, high)


@inner(forceinline=True)
def _strengthen(rows, end, pace, k, wide):
    """Add the squares of the forces with which compliant stops push."""
    for z in range(k.stops):
        pushing = pushes(rows, z, k, wide)
        if not anywhere(pushing):
            continue
        a, square = coefficients(times(load(rows, k.hold + z * SIZE, wide), 1.0 / (pace * pace))), 0.0 * end
        for node, weight in NODES:
            force, _ = valued(a, node * end)
            square = square + weight * force * force
        sums = get(rows, k.strength + z, wide)
        put(rows, k.strength + z, wide, sums + select(pushing, square * end * pace, 0.0))
