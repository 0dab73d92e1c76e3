"""Impacts on several stops, and which touched stops stay closed, by trying every subset."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from vibroimpact.backends.reference.phases import BALANCE, DEPTH, Equations
from vibroimpact.backends.reference.stops import Floats

CRUSHED = 1e-6  # relative to the fastest rate: tolerance of the impact law


def subsets(stops: list[int]) -> Iterator[tuple[int, ...]]:
    """Yield every subset, smaller ones first."""
    for size in range(len(stops) + 1):
        yield from combinations(stops, size)


def impact_law(coupling: Floats, restitution: Floats, rates: Floats) -> tuple[Floats, Floats]:
    """Return the rates of clearances after an impact, and the impulses in N s.

    Moreau's law: 0 <= P complementary to w+ + R w- >= 0, with w+ = w- + G P.

    Parameters
    ----------
    coupling : array, shape (s, s)
        G = a M^-1 a^T of the stops in contact.
    restitution, rates : array, shape (s,)
        R and w-, the rates just before the impact, none of them above zero.

    Returns
    -------
    tuple of array
        The rates w+ and the impulses P. The energy does not increase.

    Raises
    ------
    ValueError
        No velocity separates from these stops: they move towards each other.

    Examples
    --------
    >>> impact_law(np.eye(2), np.array([0.5, 0.5]), np.array([-2.0, 0.0]))
    (array([1., 0.]), array([3., 0.]))
    """
    rates = np.asarray(rates, float)
    root = np.sqrt(np.diag(coupling))
    alike, speeds = coupling / np.outer(root, root), rates / root  # now in roots of energies
    rounding = BALANCE * float(np.abs(speeds).max(initial=0.0))
    best: tuple[float, Floats, Floats] | None = None
    for active in subsets(list(range(len(rates)))):
        index = list(active)
        square = alike[np.ix_(index, index)]
        if index and np.linalg.cond(square) > 1.0 / BALANCE:
            continue
        impulses = np.zeros(len(rates))
        impulses[index] = np.linalg.solve(square, -((1.0 + restitution) * speeds)[index])
        after = speeds + alike @ impulses
        after[np.abs(after) <= rounding] = 0.0
        after[index] = -restitution[index] * speeds[index]
        slack = after + restitution * speeds
        slack[index] = 0.0
        wrong = -min(float(slack.min(initial=0.0)), float(impulses.min(initial=0.0)))
        if best is None or wrong < best[0]:
            best = wrong, root * after, impulses / root
        if wrong <= rounding:
            break
    assert best is not None  # the empty set is never singular
    if best[0] > CRUSHED * float(np.abs(speeds).max(initial=0.0)):
        raise ValueError(f"no velocity separates from stops whose clearances have the rates {rates.tolist()}")
    return best[1] + 0.0, best[2]


def held_closed(
    eq: Equations, x: Floats, touched: list[int], others: tuple[int, ...]
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return, of the stops touched with a rate of zero, the impenetrable ones that push, and all that stay closed.

    Forces and accelerations are complementary, lambda >= 0 and u'' >= 0; where both vanish, their derivatives decide. A
    stop whose clearance stays zero without a force also stays closed. `others` are the pushing stops that are
    penetrable, whose forces are given.
    """
    best: tuple[int, tuple[int, ...], tuple[int, ...]] | None = None
    for pushing in subsets(touched):
        phase = eq.phase(pushing, others)
        if phase.singular:
            continue
        signs = []
        idle = []
        for j in touched:
            order, value = phase.leading(phase.force[j] if j in pushing else phase.bending[j], x)
            signs.append(value)
            if j not in pushing and order == DEPTH:
                idle.append(j)
        wrong = sum(value < 0.0 for value in signs)
        if best is None or wrong < best[0]:
            best = wrong, pushing, tuple(sorted((*pushing, *idle)))
        if not wrong:
            break
    assert best is not None
    return best[1], best[2]
