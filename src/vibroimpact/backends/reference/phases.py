"""Motion of a linear system between two events, while given stops stay closed and compliant ones push.

A phase is one linear system with constant coefficients, X' = A X, in

    X = (q, q', u, u', l, l sin hwt, l cos hwt, ...),

with a length l that makes the entries comparable. The clearances u are separate variables, because g - a.q would lose
its leading digits near contact. Held stops have u = u' = 0, and their forces are linear forms of X:

    M q'' + C q' + K q = p - sum_j a_j lambda_j,    u_j'' = d_j'' - a_j . q'' = 0    for each held stop j,

and so are those of pushing compliant stops, lambda_j = -k_j u_j - c_j u_j'.

The matrix exponential needs no steady state, so k = 0 and resonance are no special cases. It is summed as a series,
because a chatter needs small entries with full relative accuracy, while a Pade approximant is accurate only relative to
its norm.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from vibroimpact.backends.reference.stops import Floats, Stop

Which = NDArray[np.intp]
Real = NDArray[Any]  # of double or extended precision
Watch = tuple[int, int]  # quantities watched until they fall through zero, and their stops

CLEARANCE, FORCE, LASTING, AWAY, DEEP = range(5)  # u, lambda, -p u - q u', p u + q u', -u

STRIDE = 0.1  # radians of the fastest rate per interval of a block
ROOT = 8  # the square root of BLOCK
BLOCK = ROOT**2  # intervals per block
TERMS = 30  # of a series over a stride
DEPTH = 6  # derivatives tested where a force or an acceleration vanishes
BALANCE = 1e-13  # relative to the sum of its terms: a smaller value is rounding
ROUNDING = 4.0 * np.finfo(float).eps  # relative: the smallest that `brentq` accepts
NEARLY = 1e-9  # relative error of the place of an extremum; that of its value is the square


@dataclass(frozen=True)
class LinearSystem:
    """M q'' + C q' + K q = p0 + Im(sum_h p_h exp(i h w t)), with stops.

    Parameters
    ----------
    mass, damping, stiffness : array, shape (n, n)
        M is positive definite; C and K may be singular.
    omega : float
        Angular frequency w in rad/s, > 0.
    constant : array, shape (n,)
        Constant force in N.
    harmonics : dict of int to complex array, shape (n,)
        Harmonics of the force in N.
    stops : tuple of Stop
        Any number.
    """

    mass: Floats
    damping: Floats
    stiffness: Floats
    omega: float
    constant: Floats
    harmonics: dict[int, NDArray[np.complex128]]
    stops: tuple[Stop, ...]


class Equations:
    """The matrices of a system, and its phases."""

    def __init__(self, system: LinearSystem) -> None:
        self.mass, self.damping, self.stiffness = system.mass, system.damping, system.stiffness
        self.omega = float(system.omega)
        self.constant, self.period = system.constant, 2.0 * math.pi / self.omega
        self.n, self.s = len(self.mass), len(system.stops)
        self.directions = np.array([stop.direction for stop in system.stops], float).reshape(self.s, self.n)
        self.stops = system.stops
        self.impenetrable = np.array([stop.impenetrable for stop in system.stops], bool)
        self.orders = sorted({*system.harmonics, *(h for stop in system.stops for h in stop.motion)})
        still = np.zeros(self.n)
        waves = [np.asarray(system.harmonics.get(h, still), complex) for h in self.orders]
        moves = np.array([[stop.motion.get(h, 0.0) for h in self.orders] for stop in system.stops], complex)
        moves = moves.reshape(self.s, len(self.orders))
        force = np.column_stack([system.constant, *(p.real for p in waves), *(p.imag for p in waves)])
        gaps = np.array([stop.gap for stop in system.stops], float)
        self.places = np.column_stack([gaps, moves.real, moves.imag])  # over 1, sin hwt, cos hwt
        self.rates = np.array([h * self.omega for h in self.orders])
        self.kappa = np.linalg.solve(self.mass, self.directions.T)  # M^-1 a, one column per stop
        self.coupling = self.directions @ self.kappa  # G: changes of the rates by unit impulses

        flow = np.linalg.solve(self.mass, np.column_stack([-np.asarray(system.stiffness), -np.asarray(system.damping)]))
        push = np.linalg.solve(self.mass, force)
        state = np.block([[np.zeros((self.n, self.n)), np.eye(self.n)], [flow]])
        self.fastest = max(float(np.abs(np.linalg.eigvals(state)).max()), self.omega, *self.rates)
        sizes = [np.abs(push).max() / self.fastest**2, np.abs(moves).max(initial=0.0)]
        self.length = float(max(sizes)) or 1.0
        blank = np.zeros((self.n, 2 * self.s))
        self.acceleration = np.column_stack([flow, blank, push / self.length])  # q'' = row . X, with no stop held
        bends = -np.column_stack([np.zeros(self.s), moves.real * self.rates**2, moves.imag * self.rates**2])
        none = np.zeros((self.s, 2 * self.n + 2 * self.s))
        self.bending = np.column_stack([none, bends / self.length]) - self.directions @ self.acceleration
        self.slack = np.zeros_like(self.bending)  # k u + c u': minus the force of a stop that pushes
        self.ending = np.zeros_like(self.bending)  # p u + q u': rises through zero where a contact ends
        stops = np.arange(self.s)
        laws = np.array([[stop.slack, stop.ending] for stop in system.stops], float).reshape(self.s, 2, 2)
        for rows, law in ((self.slack, laws[:, 0]), (self.ending, laws[:, 1])):
            rows[stops, 2 * self.n + stops], rows[stops, 2 * self.n + self.s + stops] = law.T
        self.phases: dict[tuple[tuple[int, ...], tuple[int, ...]], Phase] = {}

    def basis(self, phase: float) -> Floats:
        """Return 1, sin hwt, cos hwt at a phase in [0, 1)."""
        pairs = np.array([sine_cosine((h * phase) % 1.0) for h in self.orders]).reshape(-1, 2)
        return np.concatenate([[1.0], pairs[:, 0], pairs[:, 1]])

    def stop_rates(self, basis: Floats) -> Floats:
        """Return the velocities of the stops."""
        h = len(self.orders)
        sines, cosines = self.places[:, 1 : 1 + h], self.places[:, 1 + h :]
        moving: Floats = (sines * self.rates) @ basis[1 + h :] - (cosines * self.rates) @ basis[1 : 1 + h]
        return moving

    def restitution(self, rates: Floats) -> Floats:
        """Return r of every stop for the given rate of its clearance before an impact."""
        speeds = np.maximum(-rates, 0.0)
        return np.array([stop.ratio(float(v)) for stop, v in zip(self.stops, speeds, strict=True)], float)

    def sensitivity(self, rates: Floats) -> Floats:
        """Return d(r v)/dv of every stop for the given rate of its clearance before an impact."""
        speeds = np.maximum(-rates, 0.0)
        return np.array([stop.sensitivity(float(v)) for stop, v in zip(self.stops, speeds, strict=True)], float)

    def phase(self, held: tuple[int, ...], pushing: tuple[int, ...] = ()) -> Phase:
        """Return the (cached) phase in which given rigid stops are held closed and given compliant ones push."""
        if (held, pushing) not in self.phases:
            self.phases[held, pushing] = Phase(self, held, pushing)
        return self.phases[held, pushing]


class Phase:
    """Motion while some stops are held closed and some push; `rows` holds the watchable quantities of every stop."""

    def __init__(self, eq: Equations, held: tuple[int, ...], pushing: tuple[int, ...]) -> None:
        n, s, size = eq.n, eq.s, eq.acceleration.shape[1]
        self.held, self.pushing, index, others = held, pushing, list(held), list(pushing)
        square = eq.coupling[np.ix_(index, index)]
        self.singular = bool(index) and np.linalg.cond(square) > 1.0 / BALANCE
        self.force = np.zeros((s, size))  # lambda, one row per stop
        self.force[others] = -eq.slack[others]
        if index and not self.singular:
            self.force[index] = np.linalg.solve(square, -(eq.bending + eq.coupling @ self.force)[index])
        self.bending = eq.bending + eq.coupling @ self.force
        self.bending[index] = 0.0
        matrix = np.zeros((size, size))
        matrix[:n, n : 2 * n] = np.eye(n)
        matrix[n : 2 * n] = eq.acceleration - eq.kappa @ self.force
        u, v, b = 2 * n, 2 * n + s, 2 * n + 2 * s
        matrix[u:v, v:b] = np.eye(s)
        matrix[v:b] = self.bending
        h = len(eq.orders)
        matrix[b + 1 : b + 1 + h, b + 1 + h :] = np.diag(eq.rates)
        matrix[b + 1 + h :, b + 1 : b + 1 + h] = -np.diag(eq.rates)
        self.matrix = matrix
        self.fastest = max(eq.fastest, float(np.abs(np.linalg.eigvals(matrix[:b, :b])).max()))
        self.stride = STRIDE / self.fastest
        self.tick = ROUNDING * eq.period  # tolerance of the time of an event
        self.powers = np.arange(TERMS)
        clearances = np.eye(size)[u:v]
        # in the order of the kinds of a Watch
        values = np.stack([clearances, self.force, -eq.ending, eq.ending, -clearances])
        self.rows = np.stack([values, values @ matrix, values @ matrix @ matrix], axis=2)  # (kinds, stops, 3, size)

    def moved(self, x: Floats, time: float) -> Floats:
        """Return X at a time >= 0 after x."""
        if time > self.stride:
            return exponential(self.matrix, time, time / self.stride) @ x
        moved: Floats = time**self.powers @ self.series(x)
        return moved

    def series(self, x: Floats) -> Floats:
        """Return the coefficients of the powers of time in X, shape (TERMS, size); x may have columns."""
        terms = [x]
        for k in range(1, TERMS):
            terms.append(self.matrix @ terms[-1] / k)
        return np.array(terms)

    def strides(self, x: Floats, time: float) -> tuple[Floats, Floats]:
        """Return X at the beginnings of strides over a time from x, at most a block, and their lengths."""
        count = max(1, math.ceil(time / self.stride))
        lengths = np.full(count, self.stride)
        lengths[-1] = time - (count - 1) * self.stride
        return np.concatenate([x[None], self.block @ x])[:count], lengths

    def states(self, x: Floats, times: Floats) -> Floats:
        """Return X at times from x, at most a block, one row each."""
        grid = np.concatenate([x[None], self.block @ x])
        whole = np.minimum((times / self.stride).astype(int), BLOCK)
        rest = (times - whole * self.stride)[:, None] ** self.powers
        states: Floats = np.einsum("tp,ptx->tx", rest, np.swapaxes(self.series(grid[whole].T), 1, 2))
        return states

    def dips(self, j: int, x: Floats, time: float, end: Floats) -> list[float]:
        """Return the minima of a stop's clearance over a time from x to X = `end`.

        Its rate rises through zero there: between two strides, or where the rate itself turns within one.
        """
        starts, lengths = self.strides(x, time)
        rows, minima = self.rows[CLEARANCE, j], []
        _, rate, bend = rows @ np.concatenate([starts, end[None]]).T
        rises, turns = (rate[:-1] < 0.0) & (rate[1:] >= 0.0), bend[:-1] * bend[1:] < 0.0
        for i in np.flatnonzero(rises | turns):
            u, w, b = (self._function(each) for each in rows @ self.series(starts[i]).T)
            for low, high in pairwise(_with_roots(b, [0.0, lengths[i]])):
                if w(low) < 0.0 <= w(high):
                    minima.append(u(_with_roots(w, [low, high])[1]))
        return minima

    @cached_property
    def block(self) -> Floats:
        """Propagators over 1 ... BLOCK strides, in extended precision because their errors recur in each block."""
        ones = _powers(exponential(self.matrix.astype(np.longdouble), self.stride))
        eights = np.concatenate([np.eye(len(self.matrix))[None], _powers(ones[-1])[:-1]]).astype(float)
        table: Floats = (eights[:, None] @ ones.astype(float)[None]).reshape(BLOCK, *self.matrix.shape)
        return table

    @cached_property
    def grown(self) -> Floats:
        """Entrywise bound of |exp(A tau)| for tau up to a stride."""
        return exponential(np.abs(self.matrix), self.stride)

    def leading(self, row: Floats, x: Floats) -> tuple[int, float]:
        """Return the order and the value of the first derivative of row . X that exceeds rounding.

        The result is (DEPTH, 0) if there is none; the value then stays zero.
        """
        size = np.abs(row)
        for order in range(DEPTH):
            value, row = float(row @ x), row @ self.matrix
            if abs(value) > BALANCE * float(size @ np.abs(x)) + self.tick * abs(float(row @ x)):
                return order, value
            size = size @ np.abs(self.matrix)
        return DEPTH, 0.0

    def surely_positive(self, row: Floats, x: Floats, order: int, value: float) -> float:
        """Return a time, at most a stride, up to which row . X certainly stays positive after being zero.

        With b > 0 its first derivative that is not zero, of order n, it is at least b t^n/n! - B t^(n+1)/(n+1)!, which
        is half its first term at t = (n + 1) b/(2 B).
        """
        bound = float(np.abs(row @ np.linalg.matrix_power(self.matrix, order + 1)) @ (self.grown @ np.abs(x)))
        lasts = (order + 1) * max(value, 0.0) / (2.0 * bound) if bound > 0.0 else math.inf
        return float(min(self.stride, lasts))

    def next_event(self, x: Floats, watched: dict[Watch, float], longest: float) -> tuple[float, Floats, list[Watch]]:
        """Return time, X, and the quantities that fall through zero first with their stops; none within a block.

        `watched` holds the quantities, each with a time up to which it is certainly positive.
        """
        states = np.concatenate([x[None], self.block @ x])
        count = math.ceil(min(longest / self.stride, BLOCK))
        index = list(watched)
        kinds, stops = np.array(index, int).reshape(-1, 2).T
        value, rate, bend = np.einsum("tk,mok->omt", states, self.rows[kinds, stops])
        fastest = np.maximum(np.abs(rate[:, :-1]), np.abs(rate[:, 1:]))
        sharpest = np.maximum(np.abs(bend[:, :-1]), np.abs(bend[:, 1:]))
        near = np.minimum(value[:, :-1], value[:, 1:]) <= self.stride * (fastest + self.stride * sharpest)
        for i in np.flatnonzero(near[:, :count].any(axis=0)):
            at = {}
            for m in np.flatnonzero(near[:, i]):
                begin = watched[index[m]] if i == 0 else 0.0
                time = self._first_zero(self.rows[index[m]], states[i], begin)
                if time is not None:
                    at[index[m]] = time
            if at:
                first = min(at.values())
                if i * self.stride + first > longest:
                    break
                return i * self.stride + first, self.moved(states[i], first), [j for j in at if at[j] == first]
        whole = BLOCK * self.stride
        return (whole, states[-1], []) if longest >= whole else (longest, self.moved(x, longest), [])

    def _function(self, coefficients: Floats) -> Callable[[float], float]:
        """Return the function of time that a power series is."""
        return lambda time: float(coefficients @ time**self.powers)

    def _first_zero(self, rows: Floats, x: Floats, begin: float) -> float | None:
        """Return the time at which a value falls through zero within a stride: brackets its extrema, then its root."""
        value, rate, bend = (self._function(each) for each in rows @ self.series(x).T)
        knots = _with_roots(rate, _with_roots(bend, [begin, self.stride]))
        for low, high in pairwise(knots):
            if value(high) <= 0.0:
                if value(low) <= 0.0:
                    return low
                while 0.0 < low < high / 2.0 and value(2.0 * low) > 0.0:
                    low *= 2.0
                high = min(high, 2.0 * low) if low > 0.0 and value(min(high, 2.0 * low)) <= 0.0 else high
                return float(brentq(value, low, high, xtol=1e-300, rtol=ROUNDING, maxiter=2000))
        return None


def sine_cosine(phase: float) -> tuple[float, float]:
    """Return sin and cos of 2 pi phase, exact at the quarters of a turn."""
    quarter = round(4.0 * phase)
    angle = 2.0 * math.pi * (phase - 0.25 * quarter)
    s, c = math.sin(angle), math.cos(angle)
    return ((s, c), (c, -s), (-s, -c), (-c, s))[quarter % 4]


def exponential(matrix: Real, time: float, strides: float = 1.0) -> Real:
    """Return exp(A time), each entry accurate relative to the sum of its terms; `time` is in strides.

    The series over a stride is summed until terms vanish in rounding, then squared, in the precision of the matrix.
    """
    squares = max(0, math.ceil(math.log2(strides)))
    step = matrix * (time / 2.0**squares)
    total: Real = np.eye(len(matrix)).astype(matrix.dtype)
    term, k = total, 0
    while (np.abs(term) > 0.1 * np.finfo(matrix.dtype).eps * np.abs(total)).any():
        k += 1
        term = (term @ step) / k
        total = total + term
    for _ in range(squares):
        total = total @ total
    return total


def _powers(matrix: Real) -> Real:
    powers = [matrix]
    while len(powers) < ROOT:
        powers.append(powers[-1] @ matrix)
    return np.array(powers)


def _with_roots(function: Callable[[float], float], knots: list[float]) -> list[float]:
    """Return the knots and, between neighbouring knots of different sign, the root of the function."""
    refined = knots[:1]
    for low, high in pairwise(knots):
        before, after = function(low), function(high)
        if before * after < 0.0 or (before != 0.0 != after and (before < 0.0) != (after < 0.0)):
            refined.append(float(brentq(function, low, high, xtol=1e-300, rtol=NEARLY, maxiter=2000)))
        refined.append(high)
    return refined
