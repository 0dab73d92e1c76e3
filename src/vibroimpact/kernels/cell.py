"""A cell: from its numbers to a motion and constants to step with, and when it can stop."""

from __future__ import annotations

import math
from typing import NamedTuple

from vibroimpact.kernels.flight import BARELY, REACH
from vibroimpact.kernels.law import chatter_factor
from vibroimpact.kernels.leaps import leaps_of
from vibroimpact.kernels.shared.machine import inner
from vibroimpact.kernels.state import Constants, Motion

# Of the motion's size: a clearance as small is none. Where the force begins at zero it would take 5e4 certified steps
# to cross from rest, and a smaller one ten times as many for every million times.
NOTHING = 1e-30


class Cell(NamedTuple):
    """The numbers of a cell, in the order of a row of the table that back ends pass.

    `clearance` is the gap at the start, at time (`periods` + `phase`) T.
    """

    mass: float
    damping: float
    stiffness: float
    amplitude: float
    omega: float
    restitution: float
    gap: float
    clearance: float
    velocity: float
    periods: float
    phase: float


@inner
def cell_of(row):
    """Return the cell in a row of a table."""
    return Cell(row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7], row[8], row[9], row[10])


@inner
def _fastest_rate(cell):
    """Return L: the driving rate, the natural one, or the fast decay of overdamped motion."""
    stiff = cell.stiffness / cell.mass
    natural = math.sqrt(stiff)
    half = 0.5 * cell.damping / cell.mass
    over = half * half - stiff
    decay = half + math.sqrt(over) if over > 0.0 else 0.0
    return max(cell.omega, natural, decay)


@inner
def prepare(cell, chatter):
    """Return the length h of a step, and the motion and the constants to begin with, from a cell and its tolerance."""
    h = REACH / _fastest_rate(cell)
    per_mass = h * h / cell.mass
    A = cell.amplitude * per_mass
    G = cell.stiffness * cell.gap * per_mass
    th = cell.omega * h
    inside = -A < G < A
    sr = G / A if inside else 0.0
    cr = -math.sqrt((1.0 - sr) * (1.0 + sr))
    C, K = cell.damping * h / cell.mass, cell.stiffness * per_mass
    short, long = leaps_of(C, K, A, G, th)
    constants = Constants(
        C=C,
        K=K,
        A=A,
        G=G,
        th=th,
        Q=th * th,
        r=cell.restitution,
        cut=h * _cut_velocity(cell, chatter),
        tail=chatter_factor(cell.restitution),
        sr=sr,
        cr=cr,
        short=short,
        long=long,
    )
    s, c = pair_of(cell.phase)
    clearance = cell.clearance if cell.clearance > NOTHING * (A + abs(G)) else 0.0
    return h, Motion(clearance, -h * cell.velocity, s, c, cell.periods), constants


@inner
def _cut_velocity(cell, chatter):
    """Return the speed below which impacts are not recorded: chatter V, V = max(f, k |g|)/sqrt(k m).

    Without force and gap the only scale is the start's own speed.
    """
    m, k = cell.mass, cell.stiffness
    force = max(cell.amplitude, k * abs(cell.gap))
    if force > 0.0:
        return chatter * (force / math.sqrt(k * m))
    return chatter * math.sqrt(cell.velocity * cell.velocity + k / m * cell.clearance * cell.clearance)


@inner
def budgets(cell, flight_periods, steps_per_impact, total):
    """Return the longest flight in steps, and the steps granted to so many impacts.

    These grow with stiffness, but to no more than MOST: a cell that needs more ends past its budget.
    """
    rate = _fastest_rate(cell)
    slowest = min(cell.omega, math.sqrt(cell.stiffness / cell.mass))
    granted = steps_per_impact * total
    longest = flight_periods * 2.0 * math.pi * rate / (slowest * REACH)
    return longest, max(granted, min(granted * (rate / slowest), MOST))


@inner
def steady_motion(k):
    """Return the amplitudes (in phase, in quadrature) of the motion without a stop; infinite at resonance."""
    inertia = k.K - k.th * k.th
    damper = k.C * k.th
    impedance = inertia * inertia + damper * damper
    if impedance == 0.0:
        return math.inf, math.inf
    return k.A * inertia / impedance, -k.A * damper / impedance


@inner
def never_again(motion, k):
    """Return whether no impact can follow: R + sqrt(z^2 + (m/k) z'^2) < g, z = y - steady motion.

    Damping only lowers the energy of z, so the bound holds for ever, at any damping.
    """
    if not k.G > 0.0:
        return False
    in_phase, quadrature = steady_motion(k)
    if math.isinf(in_phase):
        return False
    u, p, s, c, _ = motion
    gap = k.G / k.K
    z = gap - u - (in_phase * s + quadrature * c)
    dz = -p - k.th * (in_phase * c - quadrature * s)
    return math.hypot(in_phase, quadrature) + math.sqrt(z * z + dz * dz / k.K) < gap


@inner
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


@inner
def phase_of(s, c):
    """Return the driving phase in [0, 1) from its sine and cosine."""
    if c > 0.0 and -BARELY <= s < 0.0:
        return 0.0
    phase = math.atan2(s, c) / (2.0 * math.pi)
    return phase + 1.0 if phase < 0.0 else phase


MOST = 2.0**22  # steps, some 1 s of one cell, or 5 s of lanes, to which stiffness may raise what is granted
QUIET_FOR = 32.0  # steps without an impact, before it is checked whether any can follow
RUNNING, FILLED, QUIET, PINNED, DYING, SPENT, LAWLESS = range(7)


@inner
def ending(motion, k, age, longest, steps, granted):
    """Return the reason why a cell that has not filled its window ends here, or RUNNING.

    QUIET: it never reaches the stop again. PINNED: at rest, pressed for ever. DYING: unforced rebounds
    have died out below the cut. SPENT: the flight or the whole cell is past its budget.
    """
    u, p = motion.u, motion.p
    resting = u == 0.0 and p == 0.0
    if resting and k.G <= -k.A:
        return PINNED
    if age > QUIET_FOR and not resting and never_again(motion, k):
        return QUIET
    # Without force energy only falls: no impact to come is faster than the speed it would leave at the stop.
    if k.A == 0.0 and k.G >= 0.0 and not resting and p * p + u * (k.K * u - 2.0 * k.G) < k.cut * k.cut:
        return DYING
    return SPENT if age > longest or steps > granted else RUNNING
