"""The certified step of a system: fly as far as no stop can have been touched and no closed one let go, or to it.

Watched of each stop is a polynomial, its clearance or the force that holds it closed. Divided by the zero that it
begins with (x after an impact, x^2 where it leaves from rest, x^3 at a release), it has the lower bound of
`kernels.shared.contact`: quadratic part exactly, cubic by its tangent, the negative of the others at the end of the
step. The smallest root of that bound over all stops is a step that cannot pass the first zero of any of them.

Where the zero of the nearest one is so near that its rate cannot change by half on the way (|u''| <= B over the whole
step, B d <= |p|/10 for the distance d = -u/p), the polynomial falls to it within 2 d, and Newton's method meets it: by
|e'| <= B e^2/(2 |p|) it is 0.06 d, 2e-4 d, 4e-9 d and 1e-18 d off after one step, two, three and four. The step goes
there if the other stops' bounds reach as far.
"""

from __future__ import annotations

from vibroimpact.kernels.shared.contact import negative_part, root_at_least
from vibroimpact.kernels.shared.deferred import deferred
from vibroimpact.kernels.shared.machine import inner
from vibroimpact.kernels.shared.series import (
    DEGREE,
    SIZE,
    bend,
    coefficients,
    either,
    load,
    oscillation,
    store,
    tail,
    valued,
    wave,
)
from vibroimpact.kernels.shared.trough import trough
from vibroimpact.kernels.shared.vectors import anywhere, fma, get, put, select
from vibroimpact.kernels.systems.elements import (
    BALANCED,
    CLOSED,
    OPEN,
    PASSING,
    RELEASED,
    RESTING,
    STRUCK,
    while_away,
    while_pushing,
)
from vibroimpact.kernels.systems.flow import carry, clearances, couple, fly_alone, fly_apart, fly_together, move, turns
from vibroimpact.kernels.systems.layout import CONTACT, NOTHING, STALLED
from vibroimpact.kernels.systems.push import account, drain, set_free
from vibroimpact.kernels.systems.reach import in_reach
from vibroimpact.kernels.systems.swing import end_with_period, swing

NEAR = 0.1  # of the rate: by how much it may change on the way to a contact that is solved for
BACK = 1e-12  # steps: a contact that rounding puts further behind is here
NO_WAY = 1e-24  # steps: a stop that allows no more is touched


@inner(forceinline=True)
def certified(a, kind):
    """Return an x in [0, 1] such that the polynomial is above zero on (0, x), from its coefficients.

    The bounds are sharp at x = X: they are taken twice, over the step and over twice what the first certified.
    """
    let_go = kind == RELEASED
    at_rest = let_go | (kind == RESTING)
    # Rounding may leave a clearance below zero that grows: that stop has just been left.
    leaving = at_rest | (kind == STRUCK) | (kind == BALANCED) | ((kind == OPEN) & (a[0] <= 0.0) & (a[1] > 0.0))
    q0 = select(let_go, a[3], select(at_rest, a[2], select(leaving, a[1], a[0])))
    q0 = select(q0 > 0.0, q0, 0.0)
    q1 = select(let_go, a[4], select(at_rest, a[3], select(leaving, a[2], a[1])))
    q2 = select(let_go, a[5], select(at_rest, a[4], select(leaving, a[3], a[2])))
    q3 = select(let_go, a[6], select(at_rest, a[5], select(leaving, a[4], a[3])))
    q4 = select(let_go, a[7], select(at_rest, a[6], select(leaving, a[5], a[4])))
    half = fma(0.5, fma(0.5, fma(0.5, fma(0.5, q4, q3), q2), q1), q0)
    X = select(half < 0.0, 0.5, 1.0)
    last, x = tail(a), 0.0 * X
    for _ in range(2):
        t7 = fma(last, X, negative_part(a[7]))
        t6 = fma(t7, X, negative_part(a[6]))
        t5 = fma(t6, X, negative_part(a[5]))
        t4 = fma(t5, X, negative_part(a[4]))
        cubic = fma(select(let_go, t7, select(at_rest, t6, select(leaving, t5, t4))), X, q3)
        bound = root_at_least(q0, q1, q2, cubic, X)
        x = select(bound > x, bound, x)
        X = select(2.0 * x < X, 2.0 * x, X)
    x = select((kind == CLOSED) & (a[0] == 0.0), 0.0, x)  # held by no force: to be settled again
    return select(kind < OPEN, -kind, select(kind > PASSING, kind - PASSING, x))


@inner(forceinline=True)
def _watched(rows, z, held, k, wide):
    """Return the series of a stop's clearance, or where it is closed of the force that holds it or that it pushes with.

    Of a compliant stop that pushes, or has let go and is still pushed in, it is what `elements` says.
    """
    pace = get(rows, k.pace, wide)
    b = clearances(rows, z, pace, k, wide)
    kind = get(rows, k.kind + z, wide)
    if held:
        force = load(rows, k.hold + z * SIZE, wide)
        if k.compliant:
            force = while_pushing(rows, z, b, force, pace, k, wide)
        b = either(kind >= CLOSED, force, b)
    leaving = get(rows, k.leaving + z, wide) > 0.0
    if k.compliant and anywhere(leaving):
        b = either(leaving & (kind < CLOSED), while_away(rows, z, b, pace, k, wide), b)
    # The zeros that it begins with are exact, whatever rounding makes of them.
    let_go = kind == RELEASED
    at_rest = let_go | (kind == RESTING)
    leaving = at_rest | (kind == STRUCK) | (kind == BALANCED)
    exact = select(leaving, 0.0, b[0]), select(at_rest, 0.0, b[1]), select(let_go, 0.0, b[2])
    return exact + b[3:]


@inner(forceinline=True)
def _certify(rows, held, k, wide):
    """Return the certified step, that of all stops but the one that limits it, which one that is, and whether its next
    zero is sought; leave what is watched of it.
    """
    one = 0.0 * get(rows, k.theta, wide) + 1.0
    x, others, which, sought = one, one, 0.0 * one, 0.0 * one
    for z in range(k.stops):
        near = in_reach(rows, z, k, wide)
        if not anywhere(near):
            continue
        a = coefficients(_watched(rows, z, held, k, wide))
        kind = get(rows, k.kind + z, wide)
        bound = select(near, certified(a, kind), 1.0)
        nearer = bound < x
        free = select((kind < OPEN) | (kind > PASSING), 0.0, one)
        sought = select(nearer, free, sought)
        others = select(nearer, x, select(bound < others, bound, others))
        x, which = select(nearer, bound, x), select(nearer, float(z) * one, which)
        if anywhere(nearer):
            store(rows, k.near, wide, either(nearer, a, load(rows, k.near, wide)))
    return x, others, which, sought > 0.0


@inner(forceinline=True)
def _approach(a, x, others, sought):
    """Return whether a zero is next to x and before what is certified of the others, and where the step then ends."""
    y, p = valued(a, x)
    d = select(y > 0.0, y, 0.0) / -p
    close = sought & (p < 0.0) & (bend(a) * d < -NEAR * p) & (x + 2.0 * d <= 1.0)
    t = x + select(close, d, 0.0)
    for _ in range(3):
        y, p = valued(a, t)
        t = t - select(close, y / p, 0.0)
    t = select(t > -BACK, t, 0.0)
    first = close & (t <= others)
    return first, select(first, t, x)


@inner
def miss(rows, z, end, flown, held, k, wide):
    """Keep the least clearance of an open stop on a way that was flown."""
    a, kind = coefficients(_watched(rows, z, held, k, wide)), get(rows, k.kind + z, wide)
    flown = flown & (kind < CLOSED)
    if k.compliant:
        flown = flown & (get(rows, k.leaving + z, wide) <= 0.0)
    missed, _ = trough(a, end, flown, get(rows, k.missed + z, wide), 0.0 * end)
    put(rows, k.missed + z, wide, missed)


@inner(forceinline=True)
def _carry(rows, x, held, k, wide):
    """Carry the deviation over x: it moves as the modes do without any load."""
    if held or k.coupled:
        couple(rows, k, wide, DEGREE, held, False)
    else:
        for j in range(k.modes):
            square, damping = get(rows, k.square + j, wide), get(rows, k.damping + j * (k.modes + 1), wide)
            b0, b1 = get(rows, k.deta + j, wide), get(rows, k.drate + j, wide)
            unloaded = wave(0.0 * b0, 0.0 * b0, 0.0 * b0)
            store(rows, k.flight + j * SIZE, wide, oscillation(b0, b1, square, damping, unloaded))
    carry(rows, k.deta, k.drate, x, k, wide)


@inner(forceinline=True)
def fly_inline(rows, held, k, wide):
    """Leave the series of all modes, and of the forces of stops that are closed or push where some are `held`."""
    if k.compliant and held and k.modes == 1 and not k.rigid:
        fly_alone(rows, k, wide)
    elif held or k.coupled:
        fly_together(rows, k, wide, DEGREE, held)
    else:
        fly_apart(rows, k, wide)


@inner
def fly(rows, held, k, wide):
    """Leave what `fly_inline` leaves: compiled once for all callers that fly rarely."""
    fly_inline(rows, held, k, wide)


@deferred("series of one system", 1.5)
def fly_one(rows, held, k):
    """Leave what `fly_inline` leaves, of one cell."""
    fly_inline(rows, held, k, None)


@inner
def fly_on(rows, x, k):
    """Carry a cell and its deviation over so many steps in which nothing happens."""
    held = rows[k.closed] > 0.0 or (k.compliant and rows[k.engaged] > 0.0)
    x = x / rows[k.pace]
    while x > 0.0:
        part = min(x, 1.0)
        turns(rows, k, None)
        fly_one(rows, held, k)
        move(rows, part, False, k, None)
        _carry(rows, part, held, k, None)
        x -= part


@inner(forceinline=True)
def step(rows, k, wide):
    """Make a certified step; leave the state after it, how far it went, which stop ended it and how."""
    turns(rows, k, wide)
    held = anywhere(get(rows, k.closed, wide) > 0.0) or (k.compliant and anywhere(get(rows, k.engaged, wide) > 0.0))
    fly_inline(rows, held, k, wide)
    x, others, which, sought = _certify(rows, held, k, wide)
    close, end = _approach(load(rows, k.near, wide), x, others, sought)
    if k.swinging:
        end, close = end_with_period(rows, end, close, k, wide)
        swing(rows, end, held, k, wide)
    if k.wary:
        for z in range(k.stops):
            miss(rows, z, end, end > 0.0, held, k, wide)
    if k.forceful and held:
        account(rows, end, k, wide)
    if k.draining:
        drain(rows, end, k, wide)
    move(rows, end, close, k, wide)
    stalled = select(end <= NO_WAY, STALLED, NOTHING)
    put(rows, k.which, wide, which)
    put(rows, k.hit, wide, select(close, CONTACT, stalled))
    if k.thorough:
        _carry(rows, end, held, k, wide)
    if k.compliant:
        end = end * get(rows, k.pace, wide)
        set_free(rows, k, wide)
    put(rows, k.passed, wide, end)
    put(rows, k.age, wide, get(rows, k.age, wide) + end)
    put(rows, k.steps, wide, get(rows, k.steps, wide) + 1.0)
