"""Periodic orbits: by the closed form for one impact, and by Newton's method on flights, for any number."""

from __future__ import annotations

from dataclasses import replace

import mpmath as mp

from oracles.motion import Oscillator


def one_impact(osc: Oscillator, n=1):
    """Return velocity and phase of the period-n impact-1 orbit at g = 0, by the closed form."""
    p, q, delta = _transition(osc, n)
    alpha = (1 + osc.r) * q / delta
    beta = -osc.r - (1 + osc.r) * (p - 1) / delta
    inertia, damper = osc.k - osc.m * osc.w**2, osc.c * osc.w
    v = osc.f / mp.hypot(inertia, damper) / mp.hypot(alpha, beta / osc.w)
    angle = mp.atan2(alpha * v, beta * v / osc.w) + mp.atan2(damper, inertia)
    return v, angle / (2 * mp.pi) - mp.floor(angle / (2 * mp.pi))


def _transition(osc: Oscillator, n):
    half, length = osc.c / (2 * osc.m), n * osc.period
    fast = mp.sqrt(mp.mpc(osc.k / osc.m - half**2))
    decay = mp.exp(-half * length)
    return *osc.kick(length), 1 - 2 * decay * mp.re(mp.cos(fast * length)) + decay**2


def stability(osc: Oscillator, hits):
    """Return trace and determinant of a cycle's Jacobian in (y, y'), from flights and saltation matrices.

    `hits` are time and velocity of each impact, and the time at which the cycle closes.
    """
    *within, (end, _) = hits
    jacobian = mp.eye(2)
    times = [t for t, _ in within] + [end]
    for (t, _), after, v in zip(within, times[1:], [v for _, v in within[1:]] + [within[0][1]], strict=True):
        p, q = osc.kick(after - t)
        flight = mp.matrix([[p, q], [-osc.k / osc.m * q, p - osc.c / osc.m * q]])
        before = (osc.force(after) - osc.c * v) / osc.m
        back = (osc.force(after) + osc.c * osc.r * v) / osc.m
        saltation = mp.matrix([[-osc.r, 0], [(back + osc.r * before) / v, -osc.r]])
        jacobian = saltation * flight * jacobian
    return jacobian[0, 0] + jacobian[1, 1], mp.det(jacobian)


def by_flights(osc: Oscillator, guess, n=1):
    """Return time and velocity of each impact of a cycle that closes after n periods, by Newton's method on flights."""
    count = len(guess) // 2

    def misses(unknown):
        times, speeds = unknown[:count], unknown[count:]
        found = []
        for i in range(count):
            end = times[i + 1] if i + 1 < count else times[0] + n * osc.period
            y, v = osc.fly(times[i], osc.g, -osc.r * speeds[i], end - times[i])
            found += [y - osc.g, v - speeds[(i + 1) % count]]
        return found

    return _newton(misses, guess)


def period_doubling(guess, osc: Oscillator | None = None):
    """Return the frequency at which the period-1 impact-1 orbit doubles: 1 + trace + determinant = 0."""
    given = osc or Oscillator()

    def condition(w):
        at = replace(given, w=mp.mpf(w))
        v, phase = one_impact(at)
        trace, determinant = stability(at, [(phase * at.period, v), ((phase + 1) * at.period, v)])
        return 1 + trace + determinant

    return mp.findroot(condition, guess, solver="secant", tol=mp.mpf(10) ** -100)


def grazing(guess, osc: Oscillator | None = None):
    """Return the frequency at which the period-1 impact-1 orbit touches the stop in mid-flight, and where in turns."""
    given = osc or Oscillator()

    def touch(unknown):
        w, turns = unknown
        at = replace(given, w=w)
        v, phase = one_impact(at)
        return list(at.fly(phase * at.period, at.g, -at.r * v, turns * at.period))

    return tuple(_newton(touch, guess))


def _newton(function, guess):
    """Return a root of as many equations as unknowns, by Newton's method with differences of 1e-30."""
    x = [mp.mpf(value) for value in guess]
    for _ in range(40):
        here = mp.matrix(function(x))
        columns = []
        for i in range(len(x)):
            moved = x.copy()
            moved[i] += mp.mpf(10) ** -30
            columns.append((mp.matrix(function(moved)) - here) * mp.mpf(10) ** 30)
        matrix = mp.matrix(len(x), len(x))
        for i, column in enumerate(columns):
            matrix[:, i] = column
        step = mp.lu_solve(matrix, -here)
        x = [value + change for value, change in zip(x, step, strict=True)]
        if mp.norm(step) < mp.mpf(10) ** -50:
            return x
    raise ValueError("Newton's method did not converge")
