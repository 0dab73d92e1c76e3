"""The linear system of a phase, along axes that its closed stops leave free; `lasting` says what it is for."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from vibroimpact.kernels.shared.machine import rare
from vibroimpact.kernels.systems.elements import end_law, force_law, pushes

GONE, DRIFTS, SLIDES, SWINGS = 0.0, 1.0, 2.0, 3.0  # axes: into a closed stop; mu = 0 without and with damping; mu > 0
SWEEPS = 16  # of rotations over a matrix: they converge quadratically, in some 6
SMALL = 16.0 * 2.0**-52  # per axis, of the sum of its terms: rounding


class Form(NamedTuple):
    """Room for the linear system of a phase. A row of loads and places is the constant, then two of each harmonic.

    Matrices of x, and the damping along the axes; the axes as columns, what they are, mu, y, p and v; forces on x,
    where it stands; steady z; a, b and the constant and harmonics of each w; its parts along the axes, and beta.
    """

    stiff: Any
    drag: Any
    damping: Any
    axes: Any
    sort: Any
    square: Any
    y: Any
    p: Any
    slide: Any
    loads: Any
    places: Any
    steady: Any
    on_place: Any
    on_rate: Any
    offset: Any
    q: Any
    r: Any
    beta: Any
    equations: Any


@rare
def find_form(rows, k, f):
    """Leave the form of the present phase, and the deviation from its steady motion; return whether there is one."""
    _matrices(rows, k, f)
    _loads(rows, k, f)
    _watch(rows, k, f)
    _find_axes(rows, k, f)
    if not (_slide(k, f) and _swing(rows, k, f)):
        return False
    _deviate(rows, k, f)
    return True


@rare
def is_pressed(rows, z, k):
    """Return whether a rigid stop is held closed by a force."""
    return rows[k.closed] > 0.0 and rows[k.held + z * (k.stops + 1)] > 0.0


@rare
def _alpha(rows, z, j, k):
    return rows[k.alpha + z * k.modes + j] / math.sqrt(rows[k.weight + j])


@rare
def _matrices(rows, k, f):
    """Leave stiffness and damping of x."""
    for i in range(k.modes):
        for j in range(k.modes):
            f.stiff[i, j] = rows[k.square + i] if i == j else 0.0
            f.drag[i, j] = rows[k.damping + i * k.modes + j] * math.sqrt(rows[k.weight + i] / rows[k.weight + j])
            for z in range(k.stops):
                if pushes(rows, z, k, None):
                    product = _alpha(rows, z, i, k) * _alpha(rows, z, j, k)
                    stiffness, damping = force_law(rows, z, k, None)
                    f.stiff[i, j] += stiffness * product
                    f.drag[i, j] += damping * product


@rare
def _moves(rows, z, h, k):
    """Return a number of a stop's own place: its gap, then two of each harmonic."""
    return rows[k.gap + z] if h == 0 else rows[k.motion + 2 * k.harmonics * z + h - 1]


@rare
def _by_law(rows, z, h, law, k):
    """Return the same number of p times that place and q times its rate, by a law (p, q)."""
    value = law[0] * _moves(rows, z, h, k)
    if h == 0:
        return value
    rate = (h + 1) // 2 * rows[k.theta] * law[1]
    return value - rate * _moves(rows, z, h + 1, k) if h % 2 else value + rate * _moves(rows, z, h - 1, k)


@rare
def _loads(rows, k, f):
    """Leave the forces on x, and where the closed stops put it, along M^-1 a."""
    for h in range(1 + 2 * k.harmonics):
        for j in range(k.modes):
            load = rows[k.load + j] if h == 0 else rows[k.force + 2 * k.harmonics * j + h - 1]
            f.loads[h, j], f.places[h, j] = load * math.sqrt(rows[k.weight + j]), 0.0
            for z in range(k.stops):
                if pushes(rows, z, k, None):
                    f.loads[h, j] += _alpha(rows, z, j, k) * _by_law(rows, z, h, force_law(rows, z, k, None), k)
                for y in range(k.stops if is_pressed(rows, z, k) else 0):
                    held = rows[k.held + z * k.stops + y]
                    f.places[h, j] += _alpha(rows, z, j, k) * held * _moves(rows, y, h, k)


@rare
def _watch(rows, k, f):
    """Leave what ends the phase: of every stop a, b, and the constant and harmonics."""
    n, s = k.modes, k.stops
    for z in range(s):
        pushed, held_closed, law = pushes(rows, z, k, None), is_pressed(rows, z, k), end_law(rows, z, k, None)
        for j in range(n):
            alpha = _alpha(rows, z, j, k)
            f.on_place[z, j] = law[0] * alpha if pushed else 0.0 if held_closed else -alpha
            f.on_rate[z, j] = law[1] * alpha if pushed else 0.0
        for h in range(1 + 2 * k.harmonics):
            f.offset[z, h] = -_by_law(rows, z, h, law, k) if pushed else 0.0 if held_closed else _moves(rows, z, h, k)
        for y in range(s if held_closed else 0):  # G^-1 (a . acceleration without it - acceleration of the stop)
            held = rows[k.held + z * s + y]
            for h in range(1 + 2 * k.harmonics):
                f.offset[z, h] += held * ((h + 1) // 2 * rows[k.theta]) ** 2 * _moves(rows, y, h, k)
                for j in range(n):
                    f.offset[z, h] += held * _alpha(rows, y, j, k) * f.loads[h, j]
            for i in range(n):
                for j in range(n):
                    f.on_place[z, j] -= held * _alpha(rows, y, i, k) * f.stiff[i, j]
                    f.on_rate[z, j] -= held * _alpha(rows, y, i, k) * f.drag[i, j]


@rare
def _find_axes(rows, k, f):
    """Leave axes along which the stiffness is diagonal, what each of them is, and the damping along them."""
    n, trace, drags, turned = k.modes, 0.0, 0.0, rows[k.closed] > 0.0 or rows[k.engaged] > 0.0
    for i in range(n):
        trace, drags, f.sort[i] = trace + f.stiff[i, i], drags + f.drag[i, i], SWINGS
    apart = 2.0 * trace if trace > 0.0 else 1.0  # what closed stops hold is as stiff as nothing else
    _project(rows, k, f, apart)
    _turn(f.damping, f.axes, f.sort, SWINGS)
    for i in range(n):
        f.square[i] = f.damping[i, i]
        if f.square[i] > 0.75 * apart:
            f.sort[i] = GONE
        elif f.square[i] <= (n * SMALL * trace if turned else 0.0):
            f.sort[i], f.square[i] = SLIDES, 0.0
    _dampen(k, f)
    for i in range(n):
        for j in range(i):
            f.damping[i, j] = f.damping[j, i] = 0.5 * (f.damping[i, j] + f.damping[j, i])
    _turn(f.damping, f.axes, f.sort, SLIDES)
    _dampen(k, f)
    for i in range(n):
        if f.sort[i] == SLIDES and f.damping[i, i] <= n * SMALL * drags and not coupled(f, i):
            f.sort[i] = DRIFTS


@rare
def _project(rows, k, f, apart):
    """Leave the stiffness within what closed stops leave free, that of the rest of space `apart`; no axis is turned."""
    n, s = k.modes, k.stops
    for i in range(n):
        for j in range(n):
            f.axes[i, j] = 1.0 if i == j else 0.0
            for z in range(s):
                for y in range(s if is_pressed(rows, z, k) else 0):
                    f.axes[i, j] -= _alpha(rows, z, i, k) * rows[k.held + z * s + y] * _alpha(rows, y, j, k)
    for i in range(n):
        for j in range(n):
            f.damping[i, j] = apart * ((1.0 if i == j else 0.0) - f.axes[i, j])
            for a in range(n):
                for b in range(n):
                    f.damping[i, j] += f.axes[i, a] * f.stiff[a, b] * f.axes[b, j]
    for i in range(n):
        for j in range(n):
            f.axes[i, j] = 1.0 if i == j else 0.0


@rare
def _turn(matrix, axes, sort, which):
    """Turn the axes of one sort until a symmetric matrix is diagonal among them, by C. G. J. Jacobi's rotations."""
    n = len(sort)
    for _ in range(SWEEPS):
        turned = False
        for i in range(n):
            for j in range(i + 1, n):
                off, level = matrix[i, j], math.sqrt(abs(matrix[i, i] * matrix[j, j]))
                if sort[i] != which or sort[j] != which or abs(off) <= 2.0**-53 * level:
                    continue
                turned = True
                ratio = 0.5 * (matrix[j, j] - matrix[i, i]) / off
                t = math.copysign(1.0, ratio) / (abs(ratio) + math.sqrt(1.0 + ratio * ratio))
                c = 1.0 / math.sqrt(1.0 + t * t)
                for a in range(n):
                    x, y = matrix[a, i], matrix[a, j]
                    matrix[a, i], matrix[a, j] = c * (x - t * y), c * (t * x + y)
                    x, y = axes[a, i], axes[a, j]
                    axes[a, i], axes[a, j] = c * (x - t * y), c * (t * x + y)
                for a in range(n):
                    x, y = matrix[i, a], matrix[j, a]
                    matrix[i, a], matrix[j, a] = c * (x - t * y), c * (t * x + y)
        if not turned:
            return


@rare
def _dampen(k, f):
    """Leave the damping along the axes, zero where it is rounding or along none."""
    n = k.modes
    for i in range(n):
        for j in range(n):
            value = size = 0.0
            for a in range(n):
                for b in range(n):
                    part = f.axes[a, i] * f.drag[a, b] * f.axes[b, j]
                    value, size = value + part, size + abs(part)
            gone = f.sort[i] == GONE or f.sort[j] == GONE
            f.damping[i, j] = 0.0 if gone or abs(value) <= n * SMALL * size else value


@rare
def coupled(f, i):
    """Return whether damping couples an axis to another."""
    couples = False
    for j in range(len(f.sort)):
        couples |= j != i and (f.damping[i, j] != 0.0 or f.damping[j, i] != 0.0)
    return couples


@rare
def solve(a, size):
    """Solve size equations in place, right sides in the column after; return whether they are regular."""
    for i in range(size):
        largest = 0.0
        for j in range(size):
            largest = max(largest, abs(a[i, j]))
        if not largest > 0.0:
            return False
        for j in range(size + 1):
            a[i, j] /= largest
    for c in range(size):
        best = c
        for i in range(c + 1, size):
            if abs(a[i, c]) > abs(a[best, c]):
                best = i
        if not abs(a[best, c]) > SMALL:
            return False
        for j in range(size + 1):
            a[c, j], a[best, j] = a[best, j], a[c, j]
        for i in range(size):
            part = a[i, c] / a[c, c]
            for j in range(c, size + 1 if i != c and part != 0.0 else c):
                a[i, j] -= part * a[c, j]
    for i in range(size):
        a[i, size] /= a[i, i]
    return True


@rare
def along(f, h, i):
    """Return a number of the force along an axis."""
    total = 0.0
    for j in range(len(f.sort)):
        total += f.axes[j, i] * f.loads[h, j]
    return total


@rare
def _slide(k, f):
    """Leave how fast the axes slide in the end, and the constant place of the others; return whether that is known."""
    n = k.modes
    for j in range(n):  # from here on what pulls x back to where closed stops put it is a load
        for i in range(n):
            f.loads[0, j] -= f.stiff[j, i] * f.places[0, i]
    for i in range(n):
        slides = f.sort[i] == SLIDES
        for j in range(n):
            f.equations[i, j] = f.damping[i, j] if slides and f.sort[j] == SLIDES else 1.0 if i == j else 0.0
        f.equations[i, n] = along(f, 0, i) if slides else 0.0
    if not solve(f.equations, n):
        return False
    for i in range(n):
        f.slide[i] = f.equations[i, n]
    for i in range(n):
        f.steady[0, i] = 0.0
        if f.sort[i] == SWINGS:
            total = along(f, 0, i)
            for j in range(n):
                total -= f.damping[i, j] * f.slide[j]
            f.steady[0, i] = total / f.square[i]
    return True


@rare
def _swing(rows, k, f):
    """Leave the harmonics of the steady motion; return whether there is one."""
    n = k.modes
    for h in range(1, 1 + 2 * k.harmonics, 2):
        rate = (h + 1) // 2 * rows[k.theta]
        for j in range(n):
            for i in range(n):
                re, im = f.places[h, i], f.places[h + 1, i]
                f.loads[h, j] -= f.stiff[j, i] * re - rate * f.drag[j, i] * im
                f.loads[h + 1, j] -= f.stiff[j, i] * im + rate * f.drag[j, i] * re
        for i in range(n):
            re, im, stiffness = along(f, h, i), along(f, h + 1, i), f.square[i] - rate * rate
            still = f.sort[i] == GONE or (re == 0.0 == im and not coupled(f, i))
            for j in range(n):
                drag = 0.0 if still else rate * f.damping[i, j]
                f.equations[i, j] = f.equations[n + i, n + j] = (1.0 if still else stiffness) if i == j else 0.0
                f.equations[i, n + j], f.equations[n + i, j] = -drag, drag
            f.equations[i, 2 * n], f.equations[n + i, 2 * n] = 0.0 if still else re, 0.0 if still else im
        if not solve(f.equations, 2 * n):
            return False
        for i in range(n):
            f.steady[h, i], f.steady[h + 1, i] = f.equations[i, 2 * n], f.equations[n + i, 2 * n]
    return True


@rare
def _deviate(rows, k, f):
    """Leave the deviation from the steady motion along the axes, and where x stands in that."""
    n = k.modes
    for i in range(n):
        f.y[i], f.p[i] = -f.steady[0, i], -f.slide[i]
        for j in range(n):
            root = f.axes[j, i] * math.sqrt(rows[k.weight + j])
            f.y[i] += root * rows[k.eta + j]
            f.p[i] += root * rows[k.rate + j]
        a, b = rows[k.turn], rows[k.turn + 1]
        for h in range(1, 1 + 2 * k.harmonics, 2):
            re, im, rate = f.steady[h, i], f.steady[h + 1, i], (h + 1) // 2 * rows[k.theta]
            f.y[i] -= re * a + im * b
            f.p[i] -= rate * (re * b - im * a)
            a, b = a * rows[k.turn + 1] + b * rows[k.turn], b * rows[k.turn + 1] - a * rows[k.turn]
    for h in range(1 + 2 * k.harmonics):
        for j in range(n):
            for i in range(n):
                f.places[h, j] += f.axes[j, i] * f.steady[h, i]
