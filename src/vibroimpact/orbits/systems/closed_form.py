r"""All orbits with one impact per cycle, or one per half cycle of a symmetric orbit, in closed form.

The state x just before the impact and its velocity v must satisfy, at the driving angle of the impact, 2n + 2 linear
equations: the cycle closes (s = 1, or s = -1 for a half cycle), v is the velocity, and the clearance is zero,

    (s - Phi) x + (1 + r) Phi [0; beta] v = Psi z,    v - beta . y' = -b',    beta . y = b.

Their matrix L (2n + 2 rows, 2n + 1 columns) does not depend on the angle, and their right side C z is a trigonometric
polynomial of it. They have a solution where l . C z = 0, with l the left null vector of L: one equation for the angle.
All its roots are found, and x and v follow from each. This holds for any number of harmonics, for moving stops, for
free masses and for undamped modes in resonance, since neither a steady state nor (1 - Phi)^-1 is used; for one harmonic
it is the quadratic of S. W. Shaw and P. J. Holmes, J. Sound Vib. 90 (1983) 129-155.

If L has a right null vector, a free motion that repeats after the cycle's length and does not move the stop's clearance
can be added to every solution. Then orbits are not isolated, or the force drives that motion and there are none.

Under a law r(v), each solution is a closed-form solution whose r is the value of the law at its own velocity: a root of
law(v(r)) - r along the solutions over r, bracketed between RATIOS values of r.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.model.force import angles_of_zeros
from vibroimpact.orbits.cycle import Cycle
from vibroimpact.orbits.equations import RESONANT, TURN, UNFORCED
from vibroimpact.parameters import counted

Curve = Callable[[float], float]

EPS = float(np.finfo(np.float64).eps)
VANISHED = 1e-13  # relative: rounding
POLISHES = 60
RATIOS = 65  # values of r compared under a law, about 1 ms each


def one_impact(cycle: Cycle) -> tuple[list[tuple[Cycle, Floats]], str]:
    """Return all orbits with the one impact of a cycle, sorted by phase, and the reason if there are none."""
    flow, ((stop, _),) = cycle.flow, cycle.events
    constant = flow.elements[stop].ratio is not None
    unknowns, why = _at_ratio(cycle, float(flow.restitution[stop])) if constant else _at_all_ratios(cycle)
    return [(cycle, unknown) for unknown in unknowns], why


def _at_all_ratios(cycle: Cycle) -> tuple[list[Floats], str]:
    """Return the unknowns under a law of restitution."""
    ratios = np.linspace(0.0, 1.0, RATIOS)
    by_ratio, unknowns = [_at_ratio(cycle, float(r))[0] for r in ratios], []
    for (low, before), (high, after) in pairwise(zip(ratios.tolist(), by_ratio, strict=True)):
        for one in before:
            other = _nearest(after, one[0])
            if other is None:
                continue
            rises = _beyond(cycle, high, other) > 0.0
            if (_beyond(cycle, low, one) > 0.0) != rises:
                unknowns += _under_law(cycle, [low, high], np.unwrap([one[0], other[0]]), rises)
    return unknowns, "" if unknowns else _at_ratio(cycle, 0.5)[1] or nowhere(cycle)


def _nearest(unknowns: list[Floats], angle: float) -> Floats | None:
    """Return the solution at the nearest driving angle."""
    return min(unknowns, key=lambda unknown: 1.0 - np.cos(unknown[0] - angle), default=None)


def _beyond(cycle: Cycle, r: float, unknown: Floats) -> float:
    """Return the restitution that the law gives for a solution's velocity, minus the restitution assumed."""
    flow, ((stop, _),) = cycle.flow, cycle.events
    rate = flow.clearance(stop, unknown[1:], flow.drive(unknown[0]))[1]
    return flow.rebound(stop, rate)[0] - r


def _under_law(cycle: Cycle, ratios: list[float], angles: Floats, rises: bool) -> list[Floats]:
    """Return the solution under the law between two values of r, on the branch between two angles, by bisection."""
    unknown = None
    while ratios[1] - ratios[0] > EPS:
        middle = 0.5 * (ratios[0] + ratios[1])
        unknown = _nearest(_at_ratio(cycle, middle)[0], float(angles.mean()))
        if unknown is None:
            return []
        end = int((_beyond(cycle, middle, unknown) > 0.0) == rises)
        ratios[end], angles[end] = middle, unknown[0]
        angles = np.unwrap(angles)
    return [] if unknown is None else [unknown]


def _at_ratio(cycle: Cycle, r: float) -> tuple[list[Floats], str]:
    """Return the unknowns at one restitution."""
    flow, ((stop, _),) = cycle.flow, cycle.events
    if flow.unforced and r < 1.0:
        return [], nowhere(cycle)
    matrix, sides = _equations(cycle, stop, r)
    left, sizes, right = np.linalg.svd(matrix)
    steepest = 1.0 + cycle.length * float(np.linalg.norm(flow.phase().matrix, 2))
    rank = int((sizes > 16.0 * EPS * steepest * sizes[0]).sum())
    size = cycle.length * float(np.linalg.norm(flow.phase().load)) + float(np.linalg.norm(flow.bounds[stop]))
    nulls, negligible = left[:, rank:].T @ sides, VANISHED * size
    if rank < matrix.shape[1]:
        if flow.unforced and flow.damping.any():
            return [], nowhere(cycle)
        driven = np.linalg.svd(nulls, compute_uv=False)[1:] > negligible  # two conditions on the phase
        return [], not_isolated(cycle, right[rank], bool(driven.any()))
    solution = right.T @ ((left[:, :rank].T / sizes[:, None]) @ sides)
    if np.abs(nulls).max() <= negligible:
        return [], _at_any_phase(cycle, bool(np.abs(solution[-1]).max() > negligible))
    unknowns, least = [], VANISHED * float(np.linalg.norm(solution[:-1], 2))  # at a graze x may vanish, too
    for angle in roots(flow.orders, nulls[0]):
        x, v = np.split(solution @ flow.drive(angle), [2 * flow.n])
        if v[0] > least:
            unknowns.append(np.append(angle, x))
    return unknowns, "" if unknowns else nowhere(cycle)


def _equations(cycle: Cycle, stop: int, r: float) -> tuple[Floats, Floats]:
    """Return L and C."""
    flow, n = cycle.flow, cycle.flow.n
    grown, driven = flow.over(cycle.length)
    bound, beta = flow.bounds[stop], flow.beta[stop]
    near = np.linalg.norm(beta / flow.units)
    matrix = np.zeros((2 * n + 2, 2 * n + 1))
    matrix[: 2 * n, : 2 * n] = -grown - (2.0 * np.eye(2 * n) if cycle.images else 0.0)
    matrix[n : 2 * n, -1] = (1.0 + r) * beta
    matrix[: 2 * n, -1] += grown[:, n:] @ matrix[n : 2 * n, -1]
    matrix[-2, n:] = *-beta, 1.0
    matrix[-1, :n] = beta / flow.units / near
    matrix[: 2 * n] = cycle.pinned(matrix[: 2 * n], np.eye(2 * n, 2 * n + 1))
    driven = cycle.pinned(driven, np.zeros_like(driven))
    return matrix, np.vstack([driven, -bound @ flow.turning, bound / near])


def roots(orders: Floats, coefficients: Floats) -> list[float]:
    """Return all zeros of a trigonometric polynomial in [0, 2 pi), double zeros once.

    `coefficients` are the constant, then those of sin h t, then those of cos h t over the `orders` h. Between the
    angles of all complex zeros of its derivative the polynomial is monotone and changes sign at most once.

    Examples
    --------
    >>> [round(angle / np.pi, 12) for angle in roots(np.array([1.0, 2.0]), np.array([0.0, 0.0, 1.0, 0.0, 0.0]))]
    [0.0, 0.5, 1.0, 1.5]
    """
    constant, sines, cosines = coefficients[0], *coefficients[1:].reshape(2, -1)
    size = float(np.abs(coefficients).sum())

    def value(angle: float) -> float:
        return float(constant + sines @ np.sin(orders * angle) + cosines @ np.cos(orders * angle))

    def slope(angle: float) -> float:
        return float((orders * sines) @ np.cos(orders * angle) - (orders * cosines) @ np.sin(orders * angle))

    angles = [0.0]
    for level, factors in ((constant, sines + 1j * cosines), (0.0, orders * (-cosines + 1j * sines))):
        angles += angles_of_zeros(orders, level, factors)
    ends = np.unique(angles)
    heights = np.array([value(angle) for angle in ends])
    touching = np.abs(heights) <= 8.0 * EPS * size
    zeros = list(ends[touching])
    for i, low in enumerate(ends):
        high = ends[i + 1] if i + 1 < len(ends) else ends[0] + TURN
        begin, end = heights[i], heights[(i + 1) % len(ends)]
        if not (touching[i] or touching[(i + 1) % len(ends)]) and (begin < 0.0) != (end < 0.0):
            zeros.append(_between(value, slope, float(low), float(high), begin < 0.0) % TURN)

    def same(low: float, high: float) -> bool:  # two values at a double zero that differ only by rounding
        return high - low < 0.1 / float(orders.max(initial=1.0)) and abs(value(0.5 * (low + high))) <= 8.0 * EPS * size

    kept: list[float] = []
    for angle in sorted(map(float, zeros)):
        if not kept or not (same(kept[-1], angle) or same(angle, kept[0] + TURN)):
            kept.append(angle)
    return kept


def _between(value: Curve, slope: Curve, low: float, high: float, rising: bool) -> float:
    """Return the zero between two angles: Newton's method kept inside the bracket."""
    angle = 0.5 * (low + high)
    for _ in range(POLISHES):
        height, steep = value(angle), slope(angle)
        low, high = (angle, high) if (height < 0.0) == rising else (low, angle)
        better = angle - height / steep if steep else low
        if not low <= better <= high:
            better = 0.5 * (low + high)
        if abs(better - angle) <= EPS * max(abs(better), 1.0):
            return better
        angle = better
    return angle


def _what(cycle: Cycle) -> str:
    periods = counted(cycle.n_periods, "driving period")
    return f"half of {periods}" if cycle.images else periods


def not_isolated(cycle: Cycle, null: Floats, driven: bool) -> str:
    """Return the reason why orbits are not isolated, or do not exist, when a free motion can be added to each."""
    flow, x = cycle.flow, null[:-1]
    if abs(null[-1]) > 1e-8:
        if driven:
            return RESONANT
        return "without loss: impacts of any velocity repeat, so orbits are not isolated"
    drifting = float(np.linalg.norm(flow.phase().matrix @ x)) <= 1e-8 * float(np.linalg.norm(x))
    if drifting:
        free = "a free mass or rigid-body motion, which does not change the clearance of the stop,"
        return f"{free} {'is driven away by the load' if driven else 'can be anywhere: orbits are not isolated'}"
    free = f"an undamped motion returns to itself after {_what(cycle)}, without moving the stop's clearance"
    return f"{free}: {'the force drives it without bound' if driven else 'orbits are not isolated'}"


def _at_any_phase(cycle: Cycle, hits: bool) -> str:
    if hits:
        return "the phase is not determined: the motion can be shifted in time, so orbits are not isolated"
    return (
        f"the force does no work over {_what(cycle)}, which {'are' if cycle.n_periods > 1 else 'is'} a whole number of "
        "periods of an undamped motion, and cannot make up for the loss at impact"
    )


def nowhere(cycle: Cycle) -> str:
    """Return the default reason why there are no orbits."""
    if cycle.flow.unforced:
        return UNFORCED
    return f"no velocity > 0 returns to itself after {_what(cycle)}"
