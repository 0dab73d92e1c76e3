"""The one verb: a state goes in, one certified step is made, a state and an event come out."""

from __future__ import annotations

from numba import njit

from vibroimpact.kernels.arithmetic import fma, select
from vibroimpact.kernels.chatter import pressed, rebound
from vibroimpact.kernels.contact import certified_step
from vibroimpact.kernels.flight import evaluate, rotate, series

FLIGHT = 0.0  # flew on, or rebounded below the cut
IMPACT = 1.0  # a recorded impact
CHATTER = 2.0  # the tail of a complete chatter was closed: the mass now rests at the stop
RELEASE = 3.0  # the force let the resting mass go
STUCK = 4.0  # at rest, and never let go

CLOSE = 4e-6  # steps from contact at which a third-order expansion is exact to rounding
BEND = 1e-4  # largest share of the curvature in that expansion


@njit(inline="always", error_model="numpy")
def _turn(s, c):
    # Grows with the angle over [0, 4); precise where 1 - c alone is not, next to c = 1.
    t = s / (abs(s) + abs(c))
    return select(c >= 0.0, select(s >= 0.0, t, 4.0 + t), 2.0 - t)


@njit(inline="always", error_model="numpy")
def _touch_down(u, p, s, c, C, K, A, G, th):
    """Return whether the contact is next to here, how far away, with which rate p, and its (s, c).

    Within CLOSE of a transversal contact u + p d + p2 d^2/2 = 0 is solved by its series.
    """
    p2 = fma(-C, p, fma(-K, u, fma(-A, s, G)))
    p3 = fma(-C, p2, fma(-K, p, -A * th * c))
    d0 = -u / p
    bend = 0.5 * p2 * d0 / p
    close = (p < 0.0) & (d0 < CLOSE) & (abs(bend) < BEND)
    d = d0 * fma(bend, fma(2.0, bend, -1.0), 1.0)
    p = fma(d, fma(0.5 * d, p3, p2), p)
    angle = th * d
    half = -0.5 * angle * angle
    return close, d, p, fma(half, s, fma(angle, c, s)), fma(half, c, fma(-angle, s, c))


@njit(inline="always", error_model="numpy")
def advance(u, p, s, c, n, C, K, A, G, th, Q, r, cut, tail, sr, cr):
    """Return (u, p, s, c, n) one certified step on, the event, the speed v of a contact, and the steps passed.

    At most one contact lies in a step, at its end; the state returned is the one after it.
    """
    touching = u <= 0.0
    at_rest = touching & (p == 0.0)
    pressing, balance = pressed(s, c, A, G)
    held = at_rest & pressing
    at_release = at_rest & balance
    a = series(u, p, s, c, C, K, A, G, th, Q, at_release)
    x = certified_step(a, touching & (p >= 0.0), at_rest, at_release)
    u1, p1 = evaluate(a, x)
    s1, c1 = rotate(s, c, th * x)

    close, d, pc, sc, cc = _touch_down(u1, p1, s1, c1, C, K, A, G, th)
    contact = close & (held == False)  # noqa: E712
    v = -pc
    back, tail_closed = rebound(v, sc, cc, A, G, th, r, cut, tail, sr, cr)

    forever = held & (G <= -A)
    s2 = select(held, select(forever, s, sr), select(contact, sc, s1))
    c2 = select(held, select(forever, c, cr), select(contact, cc, c1))
    u2 = select(held | contact, 0.0, u1)
    p2 = select(held, 0.0, select(contact, back, p1))
    # A flight passes the start of a period from below; a hold may also jump over it.
    wrapped = select(held, _turn(s2, c2), s2) < select(held, _turn(s, c), 0.0)
    wrapped = select(held, select(wrapped, 1.0, 0.0), select((s < 0.0) & (s2 >= 0.0), 1.0, 0.0))
    struck = select(tail_closed, CHATTER, select(v < cut, FLIGHT, IMPACT))
    event = select(forever, STUCK, select(held, RELEASE, select(contact, struck, FLIGHT)))
    return u2, p2, s2, c2, n + wrapped, event, v, x + select(contact, d, 0.0)
