"""Motions that end: a phase that certainly lasts for ever, and impacts that only become weaker.

In a phase X' = A X, and all that could end it are quantities w = row . X that would have to fall through zero. With the
eigenvalues of A in three groups,

    w(t) = p0 + p1 t + p2 t^2 + sum_h Re(a_h exp(i h w t)) + sum_i Re(c_i exp(l_i t)),    Re l_i <= 0,

constant loads, drifts of free masses, the load's harmonics, and free vibrations. So w stays above

    min(p0 + p1 t + p2 t^2) + min over a period of the harmonics - sum_i |c_i|.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import schur, solve_continuous_lyapunov, solve_sylvester

from vibroimpact.backends.reference.designs import Design
from vibroimpact.backends.reference.phases import CLEARANCE, DEPTH, FORCE, LASTING, Phase
from vibroimpact.backends.reference.stops import Floats
from vibroimpact.backends.reference.walk import Walk

NONE = 1e-6  # of the fastest rate: an eigenvalue so small is one of a constant or a drift
ROUNDING = 1e-11  # of the sizes of its terms: a smaller drift is rounding
PARALLEL = 1e6  # condition of eigenvectors that are taken for parallel
POINTS = 32  # per period of the highest harmonic
SAME = 1e-13  # of its largest values: a state that comes back so near repeats


class Part(NamedTuple):
    """A part of the motion, z' = F z: z = `into` X and X = `along` z + ..., and F, or its eigenvalues if diagonal."""

    matrix: Any
    into: Any
    along: Any
    defective: bool = False


def _split(matrix: Any, chosen: Callable[[complex], bool], into: Any, along: Any) -> tuple[Part, Part]:
    """Return the part of a motion with chosen eigenvalues, and the other part."""
    upper, turn, k = schur(matrix, "complex", sort=chosen)
    first, second = upper[:k, :k], upper[k:, k:]
    mixed = solve_sylvester(first, -second, -upper[:k, k:]) if 0 < k < len(upper) else np.zeros((k, len(upper) - k))
    back = turn.conj().T @ into
    ways = along @ turn
    return Part(first, back[:k] - mixed @ back[k:], ways[:, :k]), Part(
        second, back[k:], ways[:, k:] + ways[:, :k] @ mixed
    )


def _diagonal(part: Part) -> Part:
    """Return a part in its eigenvectors, with its eigenvalues; it is defective if they are nearly parallel."""
    if not len(part.matrix):
        return Part(np.zeros(0), part.into, part.along)
    values, vectors = np.linalg.eig(part.matrix)
    if np.linalg.cond(vectors) > PARALLEL:
        return part._replace(matrix=values, defective=True)
    return Part(values, np.linalg.solve(vectors, part.into), part.along @ vectors)


class Forever:
    """The bounds of what is watched in one phase."""

    def __init__(self, phase: Phase, eq: Any) -> None:
        n, s, self.eq = eq.n, eq.s, eq
        b, size = 2 * n + 2 * s, len(phase.matrix)
        # u and u' are no states of their own: X = lift Y, with Y = (q, q', the loads), all in m/s.
        lift, still = np.zeros((size, size - 2 * s)), np.zeros((s, 1))
        lift[: 2 * n, : 2 * n], lift[b:, 2 * n :] = np.eye(2 * n), np.eye(size - b)
        sines, cosines = eq.places[:, 1 : 1 + len(eq.rates)], eq.places[:, 1 + len(eq.rates) :]
        moving = np.hstack([still, -cosines * eq.rates, sines * eq.rates])
        lift[2 * n : 2 * n + s, :n], lift[2 * n : 2 * n + s, 2 * n :] = -eq.directions, eq.places / eq.length
        lift[2 * n + s : b, n : 2 * n], lift[2 * n + s : b, 2 * n :] = -eq.directions, moving / eq.length
        scale = np.full(size - 2 * s, phase.fastest)
        scale[n : 2 * n] = 1.0
        into, along = scale[:, None] * np.eye(size)[np.r_[: 2 * n, b:size]], lift / scale
        tiny, self.fastest = NONE * phase.fastest, phase.fastest

        def is_driven(value: complex) -> bool:
            order = round(abs(value.imag) / eq.omega)
            return order in eq.orders and abs(abs(value.imag) - order * eq.omega) + abs(value.real) < tiny

        drifts, others = _split(into @ phase.matrix @ along, lambda value: abs(value) < tiny, into, along)
        driven, free = _split(others.matrix, is_driven, others.into, others.along)
        self.drifts, self.driven, self.free = drifts, _diagonal(driven), _diagonal(free)
        growing = max(self.free.matrix.real.max(initial=0.0), self.driven.matrix.real.max(initial=0.0))
        # A vibration of the system at just the rate of the load shares its eigenvector, and nothing is bounded.
        self.bounded = bool(growing <= tiny) and not self.driven.defective
        self.ellipsoid = None
        if self.free.defective and self.bounded:  # as for critical damping; z . P z falls, with F^T P + P F = -1
            self.bounded = bool(self.free.matrix.real.max() < 0.0)
            self.free = free
            if self.bounded:
                self.ellipsoid = solve_continuous_lyapunov(free.matrix.conj().T, -np.eye(len(free.matrix)))

    def least(self, row: Floats, x: Floats) -> float:
        """Return a lower bound of row . X at all later times."""
        part, along, powers = self.drifts.into @ x, row @ self.drifts.along, []
        for k in range(3):
            powers.append(float((along @ part).real) / (1.0, 1.0, 2.0)[k])
            along = along @ self.drifts.matrix
        size = float(np.abs(row) @ np.abs(x))
        p0, p1, p2 = (p if k == 0 or abs(p) > ROUNDING * size * self.fastest**k else 0.0 for k, p in enumerate(powers))
        if p2 < 0.0 or (p2 == 0.0 and p1 < 0.0):
            return -math.inf
        bottom = p0 - p1**2 / (4.0 * p2) if p2 > 0.0 and p1 < 0.0 else p0
        z, across = self.free.into @ x, row @ self.free.along
        free = float(np.abs(across * z).sum())
        if self.ellipsoid is not None:
            reach = (z.conj() @ self.ellipsoid @ z) * (across @ np.linalg.solve(self.ellipsoid, across.conj()))
            free = math.sqrt(max(float(reach.real), 0.0))
        return bottom + self._harmonics((row @ self.driven.along) * (self.driven.into @ x)) - free

    def _harmonics(self, amplitudes: Any) -> float:
        """Return a lower bound of a sum of harmonics: between points less by at most d^2/8 |second derivative|."""
        rates, sizes = self.driven.matrix.imag, np.abs(amplitudes)
        highest = float(np.abs(rates).max(initial=0.0))
        if len({*np.rint(np.abs(rates[sizes > 0.0]) / self.eq.omega)}) < 2:
            return -float(sizes.sum())
        times, step = np.linspace(0.0, self.eq.period, int(POINTS * highest / self.eq.omega), retstep=True)
        values = (amplitudes * np.exp(1j * np.outer(times, rates))).real.sum(axis=1)
        return float(values.min() - step**2 / 8.0 * (rates**2 @ sizes))


class Endings:
    """How the motion of a cell may be known to end."""

    def __init__(self, design: Design) -> None:
        self.design, self.eq = design, design.eq
        self.undriven = not self.eq.orders
        self.bounds: dict[Phase, Forever] = {}
        self.mark: tuple[float, Floats] | None = None  # a state of a motion without impacts, and when it was

    def lasts(self, walk: Walk) -> bool:
        """Whether the present phase never ends: what is held and pushes goes on to, and nothing else is touched."""
        phase = self.eq.phase(walk.held, walk.pushing)
        if walk.away:
            return False
        if phase not in self.bounds:
            self.bounds[phase] = Forever(phase, self.eq)
        forever, x = self.bounds[phase], walk.vector()
        if walk.calm >= self.eq.period and self.holds_all(walk.closed):
            return True  # the force on what nothing else moves has gone through a whole period
        if not forever.bounded:
            return False
        for j in range(self.eq.s):
            kind = FORCE if j in walk.held else LASTING if j in walk.pushing else CLEARANCE
            row = phase.rows[kind, j, 0]
            idle = j in walk.closed and j not in walk.held
            idle |= kind == CLEARANCE and walk.at.clearance[j] == 0.0 and phase.leading(row, x)[0] == DEPTH
            if not idle and not forever.least(row, x) > 0.0:
                return False
        return True

    def holds_all(self, closed: tuple[int, ...]) -> bool:
        """Whether closed stops leave nothing free to move that a stop feels."""
        felt = int(np.count_nonzero(self.design.felt[self.eq.n :]))
        return len(closed) >= felt > 0 and int(np.linalg.matrix_rank(self.eq.directions[list(closed)])) == felt

    def repeats(self, walk: Walk, quiet_since: float) -> bool:
        """Whether the motion, without an impact since a time in periods, comes back to a state: it then has no more.

        States are compared at whole periods after each other, with that after 0, 1, 3, 7, ... periods.
        """
        flight = walk.flight
        if flight is None:
            return False
        begun, ended = flight.begin.periods + flight.begin.phase, walk.turns
        if self.mark is None or self.mark[0] < quiet_since:
            self.mark, self.due, self.next = (begun, flight.x), begun + 1.0, begun + 1.0
        while begun <= self.due < ended:
            x = flight.phase.states(flight.x, np.array([(self.due - begun) * self.eq.period]))[0]
            if (np.abs(x - self.mark[1]) <= SAME * np.abs(self.mark[1]).max()).all():
                return True
            if self.due >= self.next:
                self.mark, self.next = (self.due, x), self.due + 2.0 * (self.due - quiet_since)
            self.due += 1.0
        return False

    def fades(self, walk: Walk, cut: float) -> bool:
        """Whether, without a load, no later impact can be as fast as the cutoff."""
        if not self.undriven or self.eq.constant.any() or walk.closed or walk.pushing:
            return False
        at = walk.at
        return bool((self.design.bound(at.displacement, at.velocity) < cut).all())
