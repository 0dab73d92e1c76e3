"""One mass, one rigid stop, one sine, with 80 digits: exact flights, first contacts, chatter."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import mpmath as mp

mp.mp.dps = 80
SCAN = 200  # samples per driving period in which a first contact is looked for


@dataclass(frozen=True)
class Oscillator:
    """m y'' + c y' + k y = f sin(w t) below the stop at g, where y' -> -r y'."""

    m: mp.mpf = mp.mpf(1)
    c: mp.mpf = mp.mpf("0.01")
    k: mp.mpf = mp.mpf(1)
    f: mp.mpf = mp.mpf(1)
    w: mp.mpf = mp.mpf(2)
    r: mp.mpf = mp.mpf("0.8")
    g: mp.mpf = mp.mpf(0)

    @property
    def period(self):
        """Driving period."""
        return 2 * mp.pi / self.w

    def steady(self, t):
        """Return the motion without a stop, Im(f exp(i w t) / (k - m w^2 + i c w)), and its velocity."""
        amplitude = self.f / mp.mpc(self.k - self.m * self.w**2, self.c * self.w)
        turned = amplitude * mp.expj(self.w * t)
        return mp.im(turned), mp.im(1j * self.w * turned)

    def fly(self, t, y, v, tau):
        """Return (y, y') after a flight of length tau: about the steady motion, at any damping but critical."""
        y0, v0 = self.steady(t)
        p, q = self.kick(tau)
        dp, dq = -self.k / self.m * q, p - self.c / self.m * q
        y1, v1 = self.steady(t + tau)
        return y1 + p * (y - y0) + q * (v - v0), v1 + dp * (y - y0) + dq * (v - v0)

    def kick(self, tau):
        """Return what a unit of y and a unit of y' become in y after tau."""
        half = self.c / (2 * self.m)
        fast = mp.sqrt(mp.mpc(self.k / self.m - half**2))
        decay = mp.exp(-half * tau)
        q = decay * mp.re(mp.sin(fast * tau) / fast)
        return decay * mp.re(mp.cos(fast * tau)) + half * q, q

    def force(self, t):
        """Return m times the acceleration of a mass at rest on the stop."""
        return self.f * mp.sin(self.w * t) - self.k * self.g


def by_matrix(osc: Oscillator, t, y, v, tau):
    """Return (y, y') after a flight by the exponential of the 4 x 4 matrix of (y, y', sin, cos): any m, c, k, w."""
    system = mp.matrix(
        [[0, 1, 0, 0], [-osc.k / osc.m, -osc.c / osc.m, osc.f / osc.m, 0], [0, 0, 0, osc.w], [0, 0, -osc.w, 0]]
    )
    start = mp.matrix([y, v, mp.sin(osc.w * t), mp.cos(osc.w * t)])
    end = mp.expm(system * tau, method="taylor") * start
    return end[0], end[1]


def next_contact(osc: Oscillator, t, y, v, longest=20):
    """Return time and velocity of the first contact of a flight, scanned for within `longest` periods.

    Halving intervals finds it, then Newton's method confirms it: two root finders that share nothing.
    """
    acceleration = (osc.force(t) - osc.c * v) / osc.m
    leaving = y >= osc.g
    step = osc.period / SCAN
    if leaving and v < 0 < acceleration:  # a hop of a chatter lasts 2 |v| / a, however short that is
        step = min(step, -v / (4 * acceleration))

    def gap(tau):
        return osc.g - osc.fly(t, y, v, tau)[0]

    before = step / 1000 if leaving else mp.mpf(0)
    after = before + step
    while gap(after) > 0:
        before, after = after, after + step
        if after > longest * osc.period:
            raise ValueError("no contact found")
    newton = found = _bisected(gap, before, after)
    for _ in range(3):
        newton += gap(newton) / osc.fly(t, y, v, newton)[1]
    if abs(newton - found) > mp.mpf(10) ** -44 * (1 + abs(found)):
        raise ValueError("two root finders disagree")
    return t + newton, osc.fly(t, y, v, newton)[1]


def _bisected(gap, low, high):
    """Return where a gap that is positive at `low` and not at `high` closes."""
    while high - low > mp.mpf(10) ** -48 * (1 + abs(high)):
        middle = (low + high) / 2
        low, high = (middle, high) if gap(middle) > 0 else (low, middle)
    return high


def impacts(osc: Oscillator, t, y, v) -> Iterator[tuple[mp.mpf, mp.mpf]]:
    """Yield time and velocity just before contact of each impact."""
    while True:
        t, v = next_contact(osc, t, y, v)
        yield t, v
        y, v = osc.g, -osc.r * v


def end_of_chatter(osc: Oscillator, t, v):
    """Return when a complete chatter ends that goes on after an impact of a small velocity v, to second order in it."""
    a = osc.force(t) / osc.m
    t1 = 2 * osc.r * v / ((1 - osc.r) * a)
    jerk = osc.f * osc.w * mp.cos(osc.w * t) / osc.m
    return t + t1 - t1**2 * (jerk / (3 * a) + osc.c / (6 * osc.m))
