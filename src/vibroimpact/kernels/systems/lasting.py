"""Whether a phase of the motion lasts for ever: what is closed stays closed, what pushes pushes, nothing else is hit.

While the same stops are held closed and the same compliant ones push, the system is linear. In coordinates x = m^1/2
eta, along axes that diagonalise the stiffness within what the closed stops leave free (unit mass),

    z'' + B z' + mu z = load + harmonics,   mu >= 0,   B + B^T >= 0,

and all that ends the phase is the first zero of a w = const + harmonics + a . x + b . x': the clearance of a stop that
is open, the force of one that is closed or pushes. Each w is bounded from below for all later times, part by part:

- The steady motion has a least value over one period: exact for one harmonic; for several, of points at a distance d,
  less d^2/8 times a bound of the second derivative.
- A deviation from it has p^2 + mu y^2, y = z - steady, p = y', which damping only lowers: of every axis that damping
  does not couple to others, and the sum of those that it does. So q y + r p >= -sqrt((q^2/mu + r^2) (p^2 + mu y^2)).
- An axis with mu = 0 and without damping drifts: y + p t + load t^2/2 of all of them together is a parabola in w.
- Axes with mu = 0 that are damped, a set S, come to slide at v = B_SS^-1 load. Beside that c = p_S + B_SS y_S +
  B_Se y_e stays, so that with beta = B_SS^-T a_S they put beta (c - p_S - B_Se y_e) into w.

If every bound is above zero the phase never ends. A stop that is touched while its clearance, or the force that would
hold it, has no derivative but zeros has no part in it: both stay zero (the system satisfies an equation of finite
order), and it is touched for ever.
"""

from __future__ import annotations

import math

from numba import types

from vibroimpact.kernels.cell import PINNED, QUIET, RUNNING
from vibroimpact.kernels.shared.deferred import deferred
from vibroimpact.kernels.shared.machine import rare
from vibroimpact.kernels.shared.series import DEGREE
from vibroimpact.kernels.systems.elements import pushes
from vibroimpact.kernels.systems.flow import stands
from vibroimpact.kernels.systems.form import (
    DRIFTS,
    GONE,
    SLIDES,
    SMALL,
    SWINGS,
    along,
    coupled,
    find_form,
    is_pressed,
    solve,
)
from vibroimpact.kernels.systems.push import first
from vibroimpact.kernels.systems.rest import derive

POINTS = 32  # per period of the highest harmonic, at which several are summed up


@deferred("motions without impacts", 5, types.intp)
def lasting(rows, k, room):
    """Return PINNED or QUIET where the present phase never ends, in contact or clear of all stops; else RUNNING."""
    f, touches = room.form, rows[k.closed] > 0.0 or rows[k.engaged] > 0.0
    for z in range(k.stops):
        if rows[k.leaving + z] > 0.0:
            return RUNNING
    idle = _idle(rows, k)
    if not find_form(rows, k, f):
        return RUNNING
    for z in range(k.stops):
        if not idle >> z & 1 and not _least(rows, k, f, z) > 0.0:
            return RUNNING
    return PINNED if touches or idle > 0 else QUIET


@rare
def _idle(rows, k):
    """Return the stops that are touched for ever without any force."""
    idle, pace = int(0.0), rows[k.pace]
    derive(rows, k, DEGREE)
    rows[k.pace] = pace
    for z in range(k.stops):
        u, _, _, near = stands(rows, z, rows[k.turn], rows[k.turn + 1], k, None)
        if pushes(rows, z, k, None) or is_pressed(rows, z, k) or u > near:
            continue
        _, value, _ = first(rows, z, k, 1, 1.0, 0.0)
        idle |= int(value == 0.0) << z
    return idle


@rare
def _least(rows, k, f, z):
    """Return a lower bound of what is watched of a stop, at all later times."""
    n, lengths, rates = k.modes, 0.0, 0.0
    for j in range(n):
        lengths, rates = lengths + abs(f.on_place[z, j]), rates + abs(f.on_rate[z, j])
    for i in range(n):
        f.q[i] = f.r[i] = 0.0
        for j in range(n):
            f.q[i] += f.on_place[z, j] * f.axes[j, i]
            f.r[i] += f.on_rate[z, j] * f.axes[j, i]
        gone = f.sort[i] == GONE
        f.q[i] = 0.0 if gone or abs(f.q[i]) <= n * SMALL * lengths else f.q[i]  # it is not felt
        f.r[i] = 0.0 if gone or abs(f.r[i]) <= n * SMALL * rates else f.r[i]
    for i in range(n):
        slides = f.sort[i] == SLIDES
        for j in range(n):
            f.equations[i, j] = f.damping[j, i] if slides and f.sort[j] == SLIDES else 1.0 if i == j else 0.0
        f.equations[i, n] = f.q[i] if slides else 0.0
    solve(f.equations, n)  # as regular as it was
    for i in range(n):
        f.beta[i] = f.equations[i, n]
    return _constant(k, f, z) + _trough(k, f, z, rows[k.theta]) + _drift(k, f) - _transient(k, f)


@rare
def _constant(k, f, z):
    """Return the constant part of what is watched of a stop, less what rounding may have made of it."""
    total, size = f.offset[z, 0], abs(f.offset[z, 0])
    for j in range(k.modes):
        part = f.on_place[z, j] * f.places[0, j]
        total, size = total + part, size + abs(part)
    for i in range(k.modes):
        part = f.r[i] * f.slide[i]
        if f.sort[i] == SLIDES:
            kept = f.p[i]
            for j in range(k.modes):
                kept += f.damping[i, j] * f.y[j]
            part += f.beta[i] * kept
        total, size = total + part, size + abs(part)
    return total - k.modes * SMALL * size


@rare
def _trough(k, f, z, theta):
    """Return the least value of the harmonics of what is watched of a stop, or a bound below it."""
    swings, bends, number = 0.0, 0.0, 0
    for h in range(1, 1 + 2 * k.harmonics, 2):
        rate = (h + 1) // 2 * theta
        re, im = f.offset[z, h], f.offset[z, h + 1]
        for j in range(k.modes):
            re += f.on_place[z, j] * f.places[h, j] - rate * f.on_rate[z, j] * f.places[h + 1, j]
            im += f.on_place[z, j] * f.places[h + 1, j] + rate * f.on_rate[z, j] * f.places[h, j]
        f.offset[z, h], f.offset[z, h + 1] = re, im
        size = math.sqrt(re * re + im * im)
        swings, bends, number = swings + size, bends + ((h + 1) // 2) ** 2 * size, number + (size > 0.0)
    if number < 2:
        return -swings
    least, points = math.inf, POINTS * k.harmonics
    for point in range(points):
        angle, total = 2.0 * math.pi * point / points, 0.0
        for h in range(1, 1 + 2 * k.harmonics, 2):
            turn = (h + 1) // 2 * angle
            total += f.offset[z, h] * math.sin(turn) + f.offset[z, h + 1] * math.cos(turn)
        least = min(least, total)
    return max(-swings, least - 0.125 * (2.0 * math.pi / points) ** 2 * bends)


@rare
def _drift(k, f):
    """Return the least value of the parabola that drifting axes make, at any later time; -inf if there is none."""
    start = slope = bend = slopes = bends = 0.0
    for i in range(k.modes):
        if f.sort[i] == DRIFTS:
            load = along(f, 0, i)
            start += f.q[i] * f.y[i] + f.r[i] * f.p[i]
            slope += f.q[i] * f.p[i] + f.r[i] * load
            slopes += abs(f.q[i] * f.p[i]) + abs(f.r[i] * load)
            bend += 0.5 * f.q[i] * load
            bends += abs(0.5 * f.q[i] * load)
        elif f.sort[i] == SLIDES:
            slope += f.q[i] * f.slide[i]
            slopes += abs(f.q[i] * f.slide[i])
    slope = 0.0 if abs(slope) <= k.modes * SMALL * slopes else slope
    bend = 0.0 if abs(bend) <= k.modes * SMALL * bends else bend
    if bend < 0.0 or (bend == 0.0 and slope < 0.0):
        return -math.inf
    return start - (0.25 * slope * slope / bend if slope < 0.0 else 0.0)


@rare
def _transient(k, f):
    """Return the most that the deviation of the axes that damping and springs hold can take."""
    single = give = energy = 0.0
    for i in range(k.modes):
        if f.sort[i] < SLIDES:
            continue
        on_y, on_p = f.q[i], f.r[i] - f.beta[i]
        for j in range(k.modes):
            on_y -= f.beta[j] * f.damping[j, i]
        takes = on_p * on_p + (on_y * on_y / f.square[i] if f.sort[i] == SWINGS else 0.0)
        has = f.p[i] * f.p[i] + f.square[i] * f.y[i] * f.y[i]
        if coupled(f, i):
            give, energy = give + takes, energy + has
        else:
            single += math.sqrt(takes * has)
    return single + math.sqrt(give * energy)
