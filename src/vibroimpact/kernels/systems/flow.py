"""How a system flies: the derivatives of its modes, free or coupled, and its state after a step."""

from __future__ import annotations

from vibroimpact.kernels.flight import BARELY, sine_cosine_from, turned
from vibroimpact.kernels.shared.machine import inner
from vibroimpact.kernels.shared.series import (
    SIZE,
    evaluate,
    load,
    oscillation,
    plus,
    plus_times,
    slipped,
    store,
    times,
    wave,
)
from vibroimpact.kernels.shared.vectors import anywhere, fma, get, put, select
from vibroimpact.kernels.systems.elements import CLOSED, OPEN, force_law, is_compliant
from vibroimpact.kernels.systems.reach import in_reach

# Less is contact: of the lengths that a clearance is the sum of; and, where these vanish, of V times a step.
TOUCH, NOWHERE = 1e-12, 1e-15


@inner(forceinline=True)
def sine_cosine(angle):
    """Return sin and cos of an angle up to 1.3 radians, by their power series."""
    z = angle * angle
    p, q = fma(z, -1 / 121645100408832000, 1 / 355687428096000), fma(z, 1 / 2432902008176640000, -1 / 6402373705728000)
    return sine_cosine_from(angle, z, p, q)


@inner(forceinline=True)
def _harmonic(rows, first, m, pace, k, wide):
    """Return the series of Im(a e^{i m theta x}) from the rows that hold a and those of (sin, cos) of m wt."""
    sine, cosine = get(rows, k.pairs + 2 * m, wide), get(rows, k.pairs + 2 * m + 1, wide)
    re, im = get(rows, first, wide), get(rows, first + 1, wide)
    theta = (m + 1.0) * get(rows, k.theta, wide) * pace
    return wave(fma(re, sine, im * cosine), theta * fma(re, cosine, -im * sine), -theta * theta)


@inner(forceinline=True)
def driven(rows, start, first, pace, k, wide):
    """Return a series that begins with `start` and has every harmonic from row `first` on, in steps of that pace."""
    zero = 0.0 * start
    b = wave(start, zero, zero)
    for m in range(k.harmonics):
        b = plus(b, _harmonic(rows, first + 2 * m, m, pace, k, wide))
    return b


@inner(forceinline=True)
def turns(rows, k, wide):
    """Leave (sin, cos) of every multiple of wt."""
    sine, cosine = get(rows, k.turn, wide), get(rows, k.turn + 1, wide)
    a, b = sine, cosine
    for m in range(k.harmonics):
        put(rows, k.pairs + 2 * m, wide, a)
        put(rows, k.pairs + 2 * m + 1, wide, b)
        a, b = fma(a, cosine, b * sine), fma(b, cosine, -a * sine)


@inner(forceinline=True)
def _forced(rows, j, pace, k, wide):
    """Return the series of the force on mode j."""
    return driven(rows, get(rows, k.load + j, wide), k.force + 2 * k.harmonics * j, pace, k, wide)


@inner(forceinline=True)
def fly_apart(rows, k, wide):
    """Leave the series of each mode, free of the others."""
    for j in range(k.modes):
        square, damping = get(rows, k.square + j, wide), get(rows, k.damping + j * (k.modes + 1), wide)
        b0, b1 = get(rows, k.eta + j, wide), get(rows, k.rate + j, wide)
        store(rows, k.flight + j * SIZE, wide, oscillation(b0, b1, square, damping, _forced(rows, j, 1.0, k, wide)))


@inner
def fly_together(rows, k, wide, last, held):
    """Leave the derivatives of all modes up to `last`, coupled by damping, and by stops and the forces of these where
    some are `held`.

    In flight under proportional damping these are the bits of `fly_apart`: what couples adds zeros.
    """
    couple(rows, k, wide, last, held, True)


@inner
def couple(rows, k, wide, last, held, loaded):
    """Leave the derivatives of all modes, of the motion or of its deviation: that has no load, and no stop moves it.

    They are those over steps of the present pace.
    """
    n, s, pace = k.modes, k.stops if held else 0, get(rows, k.pace, wide)
    first, rate = (k.eta, k.rate) if loaded else (k.deta, k.drate)
    for j in range(n):
        b0 = get(rows, first + j, wide)
        put(rows, k.flight + j * SIZE, wide, b0)
        put(rows, k.flight + j * SIZE + 1, wide, pace * get(rows, rate + j, wide))
        store(rows, k.pull + j * SIZE, wide, _forced(rows, j, pace, k, wide))
        if not loaded:
            store(rows, k.pull + j * SIZE, wide, wave(0.0 * b0, 0.0 * b0, 0.0 * b0))
    acting = _acting(rows, s, k, wide)
    for z in range(s):
        if acting >> z & 1:
            start = get(rows, k.gap + z, wide)
            store(rows, k.stop + z * SIZE, wide, driven(rows, start, k.motion + 2 * k.harmonics * z, pace, k, wide))
            if not loaded:
                store(rows, k.stop + z * SIZE, wide, wave(0.0 * start, 0.0 * start, 0.0 * start))
            if k.compliant:
                put(rows, k.near + s + z, wide, clearance(rows, z, 0, k, wide))
    for o in range(last - 1):
        for j in range(n):
            b = pace * pace * get(rows, k.pull + j * SIZE + o, wide)
            b = fma(-pace * pace * get(rows, k.square + j, wide), get(rows, k.flight + j * SIZE + o, wide), b)
            for i in range(0 if k.coupled else j, n if k.coupled else j + 1):
                damping = pace * get(rows, k.damping + j * n + i, wide)
                b = fma(-damping, get(rows, k.flight + i * SIZE + o + 1, wide), b)
            put(rows, k.flight + j * SIZE + o + 2, wide, b)
        if k.compliant:
            for z in range(s):
                if acting >> z & 1:
                    _push(rows, z, o, pace, k, wide)
        if k.rigid:
            _hold(rows, acting, o, s, k, wide)


@inner(forceinline=True)
def _acting(rows, s, k, wide):
    """Return the stops closed or pushing in some lane; all those of a cell alone, as others read its derivatives."""
    acting = int(0.0)
    for z in range(s):
        acts = wide is None
        if not acts:
            acts = anywhere(get(rows, k.kind + z, wide) >= CLOSED)
        acting |= int(acts) << z
    return acting


@inner(forceinline=True)
def _hold(rows, acting, o, s, k, wide):
    """Leave a derivative of the forces that hold the closed clearances where they are, and let them act."""
    for z in range(s):
        if acting >> z & 1:
            put(rows, k.near + z, wide, clearance(rows, z, o + 2, k, wide))
    for z in range(s):
        if not acting >> z & 1:
            continue
        force = 0.0 * get(rows, k.near + z, wide)
        for y in range(s):
            if acting >> y & 1:
                force = fma(-get(rows, k.held + z * s + y, wide), get(rows, k.near + y, wide), force)
        if k.compliant:
            pushes = is_compliant(rows, z, k, wide)
            force = select(pushes, 0.0, force)
            put(rows, k.hold + z * SIZE + o, wide, select(pushes, get(rows, k.hold + z * SIZE + o, wide), force))
        else:
            put(rows, k.hold + z * SIZE + o, wide, force)
        _pull(rows, z, o, force, k, wide)


@inner(forceinline=True)
def _pull(rows, z, o, force, k, wide):
    """Let the derivative of a stop's force act on the modes."""
    for j in range(k.modes):
        at = k.flight + j * SIZE + o + 2
        b = fma(-get(rows, k.jump + z * k.modes + j, wide), force, get(rows, at, wide))
        put(rows, at, wide, b)


@inner(forceinline=True)
def _push(rows, z, o, pace, k, wide):
    """Leave a derivative of the force of a stop that pushes, and let it act."""
    u, w = get(rows, k.near + k.stops + z, wide), clearance(rows, z, o + 1, k, wide)
    put(rows, k.near + k.stops + z, wide, w)
    stiffness, damping = _engaged(rows, z, pace, k, wide)
    force = -fma(stiffness, u, damping * w)
    put(rows, k.hold + z * SIZE + o, wide, force)
    _pull(rows, z, o, force, k, wide)


@inner(forceinline=True)
def _engaged(rows, z, pace, k, wide):
    """Return stiffness and damping of a stop where it pushes, in steps of that pace."""
    pushes = get(rows, k.kind + z, wide) >= CLOSED
    stiffness, damping = force_law(rows, z, k, wide)
    return select(pushes, pace * pace * stiffness, 0.0), select(pushes, pace * damping, 0.0)


@inner(forceinline=True)
def fly_alone(rows, k, wide):
    """Leave the series of a single mode and the forces of stops that all give: they are springs and dampers of it."""
    pace = get(rows, k.pace, wide)
    square, damping = pace * pace * get(rows, k.square, wide), pace * get(rows, k.damping, wide)
    load = times(_forced(rows, 0, pace, k, wide), pace * pace)
    for z in range(k.stops):
        p, q = _engaged(rows, z, pace, k, wide)
        jump, alpha = get(rows, k.jump + z, wide), get(rows, k.alpha + z, wide)
        load = plus_times(load, jump, slipped(_standing(rows, z, pace, k, wide), p, q))
        square, damping = fma(jump * alpha, p, square), fma(jump * alpha, q, damping)
    b0, b1 = get(rows, k.eta, wide), pace * get(rows, k.rate, wide)
    store(rows, k.flight, wide, oscillation(b0, b1, square, damping, load))
    for z in range(k.stops):
        p, q = _engaged(rows, z, pace, k, wide)
        store(rows, k.hold + z * SIZE, wide, slipped(clearances(rows, z, pace, k, wide), -p, -q))


@inner(forceinline=True)
def _standing(rows, z, pace, k, wide):
    """Return the series of where a stop is."""
    start = get(rows, k.gap + z, wide)
    if k.moving:
        return driven(rows, start, k.motion + 2 * k.harmonics * z, pace, k, wide)
    return wave(start, 0.0 * start, 0.0 * start)


@inner(forceinline=True)
def clearances(rows, z, pace, k, wide):
    """Return the series of a stop's clearance from those of the modes."""
    b = _standing(rows, z, pace, k, wide)
    for j in range(k.modes):
        alpha = get(rows, k.alpha + z * k.modes + j, wide)
        b = plus_times(b, -alpha, load(rows, k.flight + j * SIZE, wide))
    return b


@inner(forceinline=True)
def clearance(rows, z, o, k, wide):
    """Return the derivative of a clearance of that order, once those of the modes and of the stop are known."""
    b = get(rows, k.stop + z * SIZE + o, wide)
    for j in range(k.modes):
        b = fma(-get(rows, k.alpha + z * k.modes + j, wide), get(rows, k.flight + j * SIZE + o, wide), b)
    return b


@inner(forceinline=True)
def stop_moves(rows, z, sine, cosine, k, wide):
    """Return the place of a stop, as a clearance, and its speed."""
    u = get(rows, k.gap + z, wide)
    w = 0.0 * u
    if k.moving:
        a, b = sine, cosine
        for m in range(k.harmonics):
            first = k.motion + 2 * (k.harmonics * z + m)
            re, im = get(rows, first, wide), get(rows, first + 1, wide)
            u = u + fma(re, a, im * b)
            w = w + (m + 1.0) * get(rows, k.theta, wide) * fma(re, b, -im * a)
            a, b = fma(a, cosine, b * sine), fma(b, cosine, -a * sine)
    return u, w


@inner(forceinline=True)
def stands(rows, z, sine, cosine, k, wide):
    """Return a clearance, its rate, the sum of the lengths that it is made of, and below what it is contact."""
    u, w = stop_moves(rows, z, sine, cosine, k, wide)
    size = abs(get(rows, k.gap + z, wide))
    for j in range(k.modes):
        alpha = get(rows, k.alpha + z * k.modes + j, wide)
        moved = alpha * get(rows, k.eta + j, wide)
        u, size = u - moved, size + abs(moved)
        w = w - alpha * get(rows, k.rate + j, wide)
    return u, w, size, TOUCH * size + NOWHERE * get(rows, k.speed, wide)


@inner(forceinline=True)
def carry(rows, amplitude, rate, x, k, wide):
    """Leave the amplitudes and rates of all modes, or of their deviation, after x, from their derivatives."""
    for j in range(k.modes):
        y, p = evaluate(load(rows, k.flight + j * SIZE, wide), x)
        put(rows, amplitude + j, wide, y)
        put(rows, rate + j, wide, p / get(rows, k.pace, wide) if k.compliant else p)


@inner(forceinline=True)
def move(rows, x, close, k, wide):
    """Carry the state over a part x of a step of its pace, to a contact or not."""
    carry(rows, k.eta, k.rate, x, k, wide)
    if k.compliant:
        x = x * get(rows, k.pace, wide)
    s, c = get(rows, k.turn, wide), get(rows, k.turn + 1, wide)
    s1, c1 = turned(s, c, *sine_cosine(get(rows, k.theta, wide) * x))
    put(rows, k.turn, wide, s1)
    put(rows, k.turn + 1, wide, c1)
    begun = select((s < -BARELY) & (s1 >= -BARELY), 1.0, 0.0)
    put(rows, k.turn + 2, wide, get(rows, k.turn + 2, wide) + begun)
    for z in range(k.stops):
        if anywhere(in_reach(rows, z, k, wide)):
            kind = get(rows, k.kind + z, wide)
            put(rows, k.kind + z, wide, select((x > 0.0) | close, select(kind >= CLOSED, CLOSED, OPEN), kind))
