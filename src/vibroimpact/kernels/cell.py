"""The numbers a cell is stepped with, and when it can stop."""

from __future__ import annotations

import math

from numba import njit

from vibroimpact.kernels.flight import REACH

NEVER = 1e300  # stands for 2 r / (1 - r) at r = 1, where chatter does not end


@njit(inline="always", error_model="numpy")
def fastest_rate(m, c, k, w):
    """Return L: the driving rate, the natural one, or the fast decay of overdamped motion."""
    stiff = k / m
    natural = math.sqrt(stiff)
    half = 0.5 * c / m
    over = half * half - stiff
    decay = half + math.sqrt(over) if over > 0.0 else 0.0
    return max(w, natural, decay)


@njit(error_model="numpy")
def prepare(m, c, k, f, w, r, g):
    """Return h and the constants C, K, A, G, th, Q, tail, sr, cr of a cell."""
    h = REACH / fastest_rate(m, c, k, w)
    per_mass = h * h / m
    A = f * per_mass
    G = k * g * per_mass
    th = w * h
    inside = -A < G < A
    sr = G / A if inside else 0.0
    cr = -math.sqrt((1.0 - sr) * (1.0 + sr))
    tail = 2.0 * r / (1.0 - r) if r < 1.0 else NEVER
    return h, c * h / m, k * per_mass, A, G, th, th * th, tail, sr, cr


@njit(error_model="numpy")
def cut_velocity(m, k, f, g, clearance, velocity, chatter):
    """Return the speed below which impacts are not recorded: chatter V, V = max(f, k |g|)/sqrt(k m).

    Without force and gap the only scale is the start's own speed.
    """
    force = max(f, k * abs(g))
    if force > 0.0:
        return chatter * (force / math.sqrt(k * m))
    return chatter * math.sqrt(velocity * velocity + k / m * clearance * clearance)


@njit(error_model="numpy")
def budgets(m, c, k, w, flight_periods, steps_per_impact):
    """Return the longest flight in steps, and the steps granted an impact, which grow with stiffness."""
    rate = fastest_rate(m, c, k, w)
    slowest = min(w, math.sqrt(k / m))
    return flight_periods * 2.0 * math.pi * rate / (slowest * REACH), steps_per_impact * (rate / slowest)


@njit(error_model="numpy")
def steady_motion(C, K, A, G, th):
    """Return the amplitudes (in phase, in quadrature) of the motion without a stop; infinite at resonance."""
    inertia = K - th * th
    damper = C * th
    impedance = inertia * inertia + damper * damper
    if impedance == 0.0:
        return math.inf, math.inf
    return A * inertia / impedance, -A * damper / impedance


@njit(error_model="numpy")
def never_again(u, p, s, c, C, K, A, G, th):
    """Return whether no impact can follow: R + sqrt(z^2 + (m/k) z'^2) < g, z = y - steady motion.

    Damping only lowers the energy of z, so the bound holds for ever, at any damping.
    """
    if not G > 0.0:
        return False
    in_phase, quadrature = steady_motion(C, K, A, G, th)
    if math.isinf(in_phase):
        return False
    gap = G / K
    z = gap - u - (in_phase * s + quadrature * c)
    dz = -p - th * (in_phase * c - quadrature * s)
    return math.hypot(in_phase, quadrature) + math.sqrt(z * z + dz * dz / K) < gap


@njit(error_model="numpy")
def pair_of(phase):
    """Return sine and cosine of a driving phase in [0, 1); exact at its quarters."""
    quarter = math.floor(4.0 * phase + 0.5)
    angle = 2.0 * math.pi * (phase - 0.25 * quarter)
    s, c = math.sin(angle), math.cos(angle)
    turned = quarter % 4
    if turned == 1:
        return c, -s
    if turned == 2:
        return -s, -c
    if turned == 3:
        return -c, s
    return s, c


@njit(error_model="numpy")
def phase_of(s, c):
    """Return the driving phase in [0, 1) from its sine and cosine."""
    phase = math.atan2(s, c) / (2.0 * math.pi)
    phase = phase + 1.0 if phase < 0.0 else phase
    return phase if phase < 1.0 else 0.0


RUNNING, FILLED, QUIET, PINNED, DYING, SPENT = range(6)


@njit(error_model="numpy")
def ending(state, constants, cut, age, longest, steps, granted):
    """Return why a cell that has not filled its window ends here, or RUNNING.

    QUIET: it never reaches the stop again. PINNED: at rest, pressed for ever. DYING: unforced rebounds
    have died out below the cut. SPENT: the flight or the whole cell is past its budget.
    """
    u, p, s, c = state
    C, K, A, G, th = constants
    resting = u == 0.0 and p == 0.0
    if resting and G <= -A:
        return PINNED
    if not resting and never_again(u, p, s, c, C, K, A, G, th):
        return QUIET
    # Without force energy only falls: no impact to come is faster than the speed it would leave at the stop.
    if A == 0.0 and G >= 0.0 and not resting and p * p + u * (K * u - 2.0 * G) < cut * cut:
        return DYING
    return SPENT if age > longest or steps > granted else RUNNING
