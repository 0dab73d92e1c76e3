"""Places of a leg that are close enough for whatever still moves there, and power series about them.

With strong damping, as that in proportion to the stiffness of many finite elements, some components of the motion decay
thousands of times as fast as the others move. Let the law of state and drive be X' = A X, and let all eigenvalues of A
with Re < -60/a belong to an invariant subspace. At the age a of the leg its part in X is below e^-60 of what it was:
what is left is in the complementary invariant subspace, X = B c, with a slower law c' = L c. Linear forms f . X are
then (f B) . c, whose power series hold no differences of large terms. Both subspaces follow from an ordered Schur form
and a Sylvester equation (G. H. Golub and C. F. Van Loan, Matrix Computations, 4th edition, 2013, sections 7.6.2-7.6.3).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vibroimpact.backends.base import Counts
from vibroimpact.cells import Floats
from vibroimpact.matrices import block_matrix, growth
from vibroimpact.orbits.cycle import Leg
from vibroimpact.orbits.equations import FEWEST_SAMPLES, STRIDE, double_turns
from vibroimpact.orbits.events import Pushing
from vibroimpact.orbits.flow import Flow

GONE = 60.0  # time constants of a component that has decayed below rounding, whatever its size at first
SLOWER = 0.5  # of the fastest rate before: what is left must be that slow
SKEWED = 100.0  # largest factor by which the projection on what is left may raise rounding
AGES = 64  # doublings of the age, at most, up to which components decay
TERMS = 14  # of a power series over one stride: 0.15^14/14! is below rounding
# Of a product: of larger ones the threads of a linear algebra library take shares, and wait for one another. Response
# curves of a beam took 2.5 times as long with another program beside them.
ROWS = 8
BISECTIONS = 60
RESOLVED = float(np.finfo(float).eps)  # of a step: accuracy of the place of a minimum, whose value is flat there


class Stage(NamedTuple):
    """What is left of a motion from an `age` on, the angle since an event: X = `basis` c, c = `dual` X, c' = `law` c.

    `fastest` is its fastest rate per unit of the driving angle. The first stage, with the age 0, is the whole motion.
    """

    age: float
    law: Floats
    basis: Floats
    dual: Floats
    fastest: float


def stages(flow: Flow, pushing: Pushing, last: float) -> list[Stage]:
    """Return the stages of the motion while some stops push, up to an age."""
    phase, n = flow.phase(pushing), flow.n
    if pushing not in flow.stages:
        whole = block_matrix(phase.matrix, phase.load, np.zeros(phase.load.T.shape), flow.turning)
        flow.stages[pushing] = Stage(0.0, whole, np.eye(len(whole)), np.eye(len(whole)), phase.fastest), None
    first, later = flow.stages[pushing]
    if last * float(np.abs(phase.matrix[n:, n:]).sum(axis=1).max()) <= GONE:
        return [first]
    if later is None:
        later = _later(flow, pushing)
        flow.stages[pushing] = first, later
    return [first, *(stage for stage in later if stage.age < last)]


def _later(flow: Flow, pushing: Pushing) -> list[Stage]:
    """Return the stages after the first, at ages each of which is at least twice the one before."""
    from scipy.linalg import schur, solve_sylvester  # slow import

    law, basis, dual = _in_normal_modes(flow, pushing)
    fastest, found = flow.phase(pushing).fastest, list[Stage]()
    rates = np.linalg.eigvals(law)
    for age in GONE / float(-rates.real.min()) * 2.0 ** np.arange(AGES):
        left = rates[-rates.real * age < GONE]
        if len(left) == len(rates) or np.abs(left).max() > SLOWER * fastest:
            continue
        try:
            form, vectors, number = schur(law, sort=lambda re, im, age=age: -re * age < GONE)
        except np.linalg.LinAlgError:
            number = -1
        if number != len(left):  # rounding moved an eigenvalue across the limit
            continue
        above = solve_sylvester(form[:number, :number], -form[number:, number:], -form[:number, number:])
        slow, rate = form[:number, :number], float(np.linalg.norm(form[:number, :number], 2))
        if np.linalg.norm(above, 2) > SKEWED or rate > SLOWER * fastest:
            continue
        dual = (vectors[:, :number].T - above @ vectors[:, number:].T) @ dual
        law, basis, fastest, rates = slow, basis @ vectors[:, :number], rate, left
        found.append(Stage(float(age), law, basis, dual, fastest))
    return found


def _in_normal_modes(flow: Flow, pushing: Pushing) -> tuple[Floats, Floats, Floats]:
    """Return the law of state and drive in normal modes of the system with its pushing stops, where |x|^2 is energy.

    With it, the matrices to the coordinates of the flow, and back. A law restricted to slow components is then slow.
    """
    phase, n = flow.phase(pushing), flow.n
    elastic = -phase.matrix[n:, :n] * flow.units
    squares, turn = np.linalg.eigh(0.5 * (elastic + elastic.T)) if pushing else (flow.rates**2, np.eye(n))
    units, none = np.sqrt(np.maximum(squares, 1.0)), np.zeros((n, n))
    to = block_matrix(units[:, None] * turn.T / flow.units, none, none, turn.T)
    back = block_matrix(flow.units[:, None] * turn / units, none, none, turn)
    law, sizes = flow.whole(to @ phase.matrix @ back, to @ phase.load)
    wide = np.zeros((2 * n, len(sizes)))
    return law, block_matrix(back, wide, wide.T, np.diag(1.0 / sizes)), block_matrix(to, wide, wide.T, np.diag(sizes))


class Samples(NamedTuple):
    """States and drives at equal steps of a leg, or of a part of it, at `angles` from the beginning of the leg.

    The columns of `coarse` are the states after every so many steps; the matrices `fine` carry them on by 0, 1, ...
    steps. Linear forms of all samples then cost about one product per sample, without computing each state. They are
    forms of the components of the `stage`.
    """

    angles: Floats
    fine: Floats
    coarse: Floats
    stage: Stage

    @property
    def step(self) -> float:
        """The angle between two samples."""
        return float(self.angles[1] - self.angles[0])

    def forms(self, forms: Floats) -> Floats:
        """Return linear forms of state and drive as forms of what is left of them."""
        return forms @ self.stage.basis if self.stage.age else forms

    def series(self, forms: Floats) -> Floats:
        """Return the coefficients of the power series of linear forms of state and drive."""
        series = np.zeros((len(forms), TERMS, len(self.stage.law)))
        series[:, 0] = self.forms(forms)
        for j in range(1, TERMS):
            series[:, j] = series[:, j - 1] @ self.stage.law / j
        return series

    def along(self, forms: Floats) -> Floats:
        """Return linear forms at all samples, one row per form."""
        fine = (forms @ self.fine).transpose(1, 2, 0)
        parts = max(self.coarse.shape[1] // ROWS, 1)
        rows = self.coarse.T.reshape(parts, -1, len(self.coarse)) @ fine[:, None]
        return rows.reshape(len(forms), len(self.fine) * self.coarse.shape[1])[:, : len(self.angles)]

    def at(self, forms: Floats, which: Counts) -> Floats:
        """Return linear forms at some samples, one row per form."""
        block, step = np.divmod(which, len(self.fine))
        rows: Floats = ((forms @ self.fine)[step] @ self.coarse.T[block][..., None])[..., 0].T
        return rows


def places_of(leg: Leg) -> list[tuple[Stage, float, float, int]]:
    """Return the parts of a leg: a stage, the angles from the beginning of the leg to its ends, and a number of steps.

    Steps are 0.15 rad of the fastest rate of what is left.
    """
    end = leg.age + leg.duration
    passed = stages(leg.flow, leg.pushing, end)
    passed = passed[sum(stage.age <= leg.age for stage in passed) - 1 :]
    limits = [leg.age, *(stage.age for stage in passed[1:]), end]
    return [
        (stage, low - leg.age, high - leg.age, max(FEWEST_SAMPLES, math.ceil((high - low) * stage.fastest / STRIDE)))
        for stage, low, high in zip(passed, limits, limits[1:], strict=False)
    ]


def sampled(leg: Leg) -> list[Samples]:
    """Return samples of a leg, one part after the other, each beginning where the one before ends."""
    parts: list[Samples] = []
    for stage, low, high, number in places_of(leg):
        start = leg.start
        if parts:
            before = parts[-1]
            start = before.at(before.forms(np.eye(len(leg.start))), np.array([len(before.angles) - 1]))[:, 0]
        parts.append(_stepped(leg, stage, start, low, (high - low) / number, number))
    return parts


def evenly(leg: Leg, number: int) -> Samples:
    """Return samples of a leg after each of a number of equal steps."""
    return _stepped(leg, stages(leg.flow, leg.pushing, 0.0)[0], leg.start, 0.0, leg.duration / number, number)


def _stepped(leg: Leg, stage: Stage, start: Floats, begin: float, step: float, number: int) -> Samples:
    flow, n = leg.flow, 2 * leg.flow.n
    if stage.age:
        power, start = np.eye(len(stage.law)) + growth(stage.law * step), stage.dual @ start
    else:
        power, (grown, driven) = np.eye(len(start)), flow.over(step, leg.pushing)
        power[:n, :n] += grown
        power[:n, n:] = driven
        power[n:, n:] = flow.rotation(step)
    fine, coarse = np.eye(len(power))[None], start[:, None]
    for _ in range((number + 1).bit_length() // 2):
        fine = np.concatenate([fine, power @ fine])
        power = power @ power
    while coarse.shape[1] * len(fine) <= number:
        coarse = np.hstack([coarse, power @ coarse])
        power = power @ power
    return Samples(begin + step * np.arange(number + 1.0), fine, coarse, stage)


def turning_points(series: Floats, samples: Samples, along: Floats) -> tuple[Floats, Floats]:
    """Return the minima between samples of a linear form given as power series, and their values.

    `along` holds the form, its slope and half its bend at all samples.
    """
    slopes, bends = along[1], 2.0 * along[2]
    turning = np.flatnonzero((slopes[:-1] < 0.0) & (slopes[1:] >= 0.0))
    low, high = np.zeros(len(turning)), np.full(len(turning), samples.step)
    twice = double_turns(slopes, bends, samples.step)
    if len(twice):  # a minimum is beside the extreme slope between two samples, if that has the other sign
        sides = np.where(slopes[twice] < 0.0, -1.0, 1.0)
        rates = _derivative(samples.at(series, twice)) * sides
        extremes, lowest = _minima(rates, np.zeros(len(twice)), np.full(len(twice), samples.step))
        turns, after = lowest < 0.0, sides > 0.0
        turning = np.append(turning, twice[turns])
        low = np.append(low, np.where(after, extremes, 0.0)[turns])
        high = np.append(high, np.where(after, samples.step, extremes)[turns])
    offsets, lowest = _minima(samples.at(series, turning), low, high)
    return samples.angles[turning] + offsets, lowest


def pulls(row: Floats, lag: float) -> Floats:
    """Return the series of (u + l u')/(1 + l), which vanishes with the force, from the series of u."""
    series: Floats = (row[:-1] + lag * _derivative(row)) / (1.0 + lag)
    return series


def _derivative(series: Floats) -> Floats:
    """Return the derivatives of power series, one per column."""
    derivative: Floats = series[1:] * np.arange(1, len(series))[:, None]
    return derivative


def _minima(series: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Return the places between bounds where slopes of power series rise through zero, and the values there.

    By Newton's method; where it leaves the bracketing interval, the interval is halved.
    """
    slopes, step = _derivative(series), float(high.max(initial=0.0))
    bends = _derivative(slopes)
    at = 0.5 * (low + high)
    for _ in range(BISECTIONS):
        slope, bend = (np.polynomial.polynomial.polyval(at, each, tensor=False) for each in (slopes, bends))
        low, high = np.where(slope < 0.0, at, low), np.where(slope < 0.0, high, at)
        with np.errstate(divide="ignore", invalid="ignore"):
            following = at - slope / bend
        before, at = at, np.where((following >= low) & (following <= high), following, 0.5 * (low + high))
        if np.abs(at - before).max(initial=0.0) <= RESOLVED * step:
            break
    return at, np.asarray(np.polynomial.polynomial.polyval(at, series, tensor=False), dtype=np.float64)
