"""Where a polynomial is least on a way: how near a motion comes to a stop that it does not strike."""

from __future__ import annotations

from vibroimpact.kernels.shared.machine import inner
from vibroimpact.kernels.shared.series import rates, valued
from vibroimpact.kernels.shared.vectors import anywhere, select

PARTS = 4  # of a way, at whose ends the sign of the rate is compared


@inner
def _zero(a, wanted, low, high, y0, y1):
    """Return the zero of a polynomial between points where its values differ in sign, by the Illinois method."""
    sign = select(y0 < 0.0, 1.0, -1.0)
    y0, y1, side, x = select(wanted, sign * y0, -1.0), select(wanted, sign * y1, 1.0), 0.0 * y1, low
    for _ in range(8):
        x = low - y0 * (high - low) / (y1 - y0)
        y, _ = valued(a, x)
        beyond = sign * y > 0.0
        y0 = select(beyond, select(side > 0.0, 0.5 * y0, y0), sign * y)
        y1 = select(beyond, sign * y, select(side < 0.0, 0.5 * y1, y1))
        low, high, side = select(beyond, low, x), select(beyond, x, high), select(beyond, 1.0, -1.0)
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
            x = _zero(rates(c), nears, low, high, slope, slope1)
            p, _ = valued(c, x)
            before, dips = nears & (p0 < 0.0) & (p > 0.0), nears & (p0 > 0.0) & (p < 0.0)
            high, p1 = select(before, x, high), select(before, p, p1)
            low, p0 = select(dips, x, low), select(dips, p, p0)
            rises = rises | before | dips
        if anywhere(rises):
            x = _zero(c, rises, low, high, p0, p1)
            y, _ = valued(a, x)
            place, least = select(rises & (y < least), x, place), select(rises & (y < least), y, least)
    return least, place
