"""Where a polynomial is least on a way: how near a motion comes to a stop that it does not strike."""

from __future__ import annotations

from vibroimpact.kernels.shared.machine import inner
from vibroimpact.kernels.shared.series import rates, valued
from vibroimpact.kernels.shared.vectors import anywhere, select

PARTS = 4  # of a way, at whose ends the sign of the rate is compared
STEPS = 10  # of Newton's method


@inner
def _zero(a, low, high, y0):
    """Return the zero of a polynomial between points where its values, the first of which is y0, differ in sign.

    It may fall before it rises there: Newton's steps that lead out of what is left of the way halve it instead.
    """
    sign, x = select(y0 < 0.0, 1.0, -1.0), 0.5 * (low + high)
    for _ in range(STEPS):
        y, slope = valued(a, x)
        beyond = sign * y > 0.0
        low, high = select(beyond, low, x), select(beyond, x, high)
        nearer = x - y / slope
        x = select((nearer >= low) & (nearer <= high), nearer, 0.5 * (low + high))
    return x


@inner
def trough(a, end, flown, least, place):
    """Return the least of a number and of a polynomial where its rate rises through zero on the way to `end`.

    Then return the `place` of that number, or where the polynomial is less. The rate is looked at four times on the
    way, and where it turns between two looks, if it comes nearer to zero there.
    """
    c = rates(a)
    after, slope_after = valued(c, 0.0 * end)
    for part in range(PARTS):
        low, high = (part / PARTS) * end, ((part + 1.0) / PARTS) * end
        p0, slope, (p1, slope1) = after, slope_after, valued(c, high)
        after, slope_after = p1, slope1
        rises = flown & (p0 < 0.0) & (p1 > 0.0)
        nears = flown & (p0 * p1 > 0.0) & (p0 * slope < 0.0) & (p1 * slope1 > 0.0)
        if anywhere(nears):
            x = _zero(rates(c), low, high, slope)
            p, _ = valued(c, x)
            before, dips = nears & (p0 < 0.0) & (p > 0.0), nears & (p0 > 0.0) & (p < 0.0)
            high, p1 = select(before, x, high), select(before, p, p1)
            low, p0 = select(dips, x, low), select(dips, p, p0)
            rises = rises | before | dips
        if anywhere(rises):
            x = _zero(c, low, high, p0)
            y, _ = valued(a, x)
            place, least = select(rises & (y < least), x, place), select(rises & (y < least), y, least)
    return least, place
