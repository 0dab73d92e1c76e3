"""Exact location of the bifurcations between two points of a branch, and switching to the branch born at a bifurcation.

Test functions along a branch change sign at folds, period doublings and grazes. `switch_branch` leads from a period
doubling to the doubled orbit that is born there.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np

from vibroimpact.continuation.equations import DOUBLING, FOLD, GRAZING, LAST_IMPACT, TORUS, TOUCH
from vibroimpact.continuation.flights import equations_of
from vibroimpact.continuation.following import check_share, follow
from vibroimpact.continuation.points import Point, Solution
from vibroimpact.continuation.results import BifurcationPoint
from vibroimpact.model.scales import scale_of
from vibroimpact.orbits.equations import Floats
from vibroimpact.parameters import invalid

HALVINGS = 12  # halvings of a step in search of the bifurcations inside it
AS_GRAZE = 1e-8  # of a parameter: no machine is set so exactly
BESIDE = 1 / 64  # of the step to a graze: there the orbit is still admissible, and its equations are regular
TRIES = 12  # attempts, with the amplitude halved each time


def between(a: Point, b: Point) -> list[Solution]:
    """Return the bifurcations between two neighbouring points of a branch, in the order of the branch.

    A doubling just beside the place where the velocity of an impact passes zero counts as that graze: a multiplier is
    infinite there.
    """
    changed = _changed(a, b)
    wanted = [condition for condition in (FOLD, DOUBLING) if condition in changed]
    wanted += [TORUS] if TORUS in changed and LAST_IMPACT not in changed else []
    located = [special for condition in wanted if (special := _located(condition, a, b)) is not None]
    graze = _graze(a, b) if a.clear != b.clear else None
    if graze is not None and graze.equations.condition == LAST_IMPACT:
        beside = AS_GRAZE * abs(graze.value)
        located = [one for one in located if one.kind != DOUBLING or abs(one.value - graze.value) > beside]
    located += [] if graze is None else [graze]
    return sorted(located, key=lambda special: float((special.on_branch - a.x) @ (b.x - a.x)))


def _changed(a: Point, b: Point) -> list[str]:
    """Return the conditions whose test functions change sign between two points."""
    return [condition for condition in a.tests if (a.tests[condition] > 0.0) != (b.tests[condition] > 0.0)]


def _graze(a: Point, b: Point) -> Solution | None:
    """Return the graze at which the admissible orbits of a step end, or begin.

    Another flight or impact may graze before the one that is found; then orbits beside that are inadmissible. The graze
    itself is inadmissible if the step led to another curve; then shorter steps lead to it.
    """
    inside, outside = (a, b) if a.clear else (replace(b, tangent=-b.tangent), a)
    graze = None
    for _ in range(HALVINGS):
        found = _first(inside, outside)
        if found is None:
            break
        graze, beside = found, inside.at(found.on_branch).towards(inside, BESIDE)
        if beside is None or beside.clear:
            break
        outside = beside
    if graze is None or not graze.admissible:
        return _first(*_finer(inside, outside, lambda point: point.clear)) or graze
    return graze


def _finer(a: Point, b: Point, holds: Callable[[Point], bool]) -> tuple[Point, Point]:
    """Return the neighbours, of points in shorter steps from one towards another, between which a condition fails."""
    steps = follow(a, BESIDE * a.equations.distance(a.x, b.x))
    for after, end in islice(steps, math.ceil(1.0 / BESIDE)):
        if end or not holds(after):
            return a, after
        a = after
    return a, b


def _first(inside: Point, outside: Point) -> Solution | None:
    """Return the graze nearest to a point inside, of those between it and another."""
    conditions = [condition for condition in _changed(inside, outside) if condition in GRAZING]
    grazes = [one for condition in conditions if (one := _located(condition, inside, outside)) is not None]
    return min(grazes, key=lambda one: float(np.linalg.norm(one.on_branch - inside.x)), default=None)


def lost_contact(a: Point, b: Point) -> Solution | None:
    """Return the graze between two points at which a contact with a compliant stop is lost (its velocity passes zero).

    None if the order of the impacts changes for another reason.
    """
    at = int(np.argmin(b.speeds))
    if b.speeds[at] >= 0.0 or a.speeds[at] <= 0.0 or not a.equations.compliant_at(at):
        return None
    located = _located(LAST_IMPACT, a, b)
    return located or _located(LAST_IMPACT, *_finer(a, b, lambda point: point.equations.in_order(point.x)))


def _located(condition: str, a: Point, b: Point) -> Solution | None:
    """Solve for the bifurcation between two points; while Newton's method leaves the interval, halve it."""
    for _ in range(HALVINGS):
        low, high = (
            value if math.isfinite(value) else math.copysign(1.0, value)
            for value in (a.tests[condition], b.tests[condition])
        )
        share = low / (low - high) if low != high else 0.5
        special = _solved(condition, a.x + share * (b.x - a.x), a, b)
        if special is not None:
            return special
        middle = a.towards(b)
        if middle is None:
            return None
        a, b = (middle, b) if (middle.tests[condition] > 0.0) == (low > 0.0) else (a, middle)
    return None


def _solved(condition: str, x: Floats, a: Point, b: Point) -> Solution | None:
    """Return the bifurcation that Newton's method reaches from x, or None if it does not lie between the points."""
    impact, touch, stop = 0, 0.0, 0
    if condition in GRAZING:
        closer = a if a.tests[condition] < b.tests[condition] else b
        impact = int(np.argmin(closer.speeds))
        if condition == TOUCH:
            if closer.nearest is None:
                return None
            impact, stop = closer.nearest.flight, closer.nearest.stop
            # The touch moves with the orbit: its time from the beginning of the flight is kept.
            touch = closer.nearest.turns + float(x[impact] - closer.x[impact])
    bounded, start = a.equations.bounded(condition, x, impact, touch, stop)
    solution, corrections, _ = bounded.newton(start)
    if not corrections or not bounded.fits(solution):
        return None
    special = Solution(bounded, solution)
    from_a, chord = special.on_branch - a.x, b.x - a.x
    share = float(from_a @ chord / (chord @ chord))
    aside = float(np.abs(from_a - share * chord).max())
    return special if -1e-9 <= share <= 1.0 + 1e-9 and aside <= float(np.linalg.norm(chord)) else None


def switch_branch(point: BifurcationPoint, *, amplitude: float = 1e-2) -> Any:
    r"""Return an orbit on the branch that is born at a period doubling, or at a pitchfork of symmetric orbits.

    At a period doubling the orbit, traversed twice, solves the equations of 2n periods and 2p impacts with a singular
    Jacobian; its null vector :math:`\phi` is the direction in which the two rounds separate. The doubled orbit solves
    the same equations with

    .. math:: \phi \cdot (z - z_0) = \varepsilon,

    and a free parameter, which is regular for :math:`\varepsilon \ne 0` [1]_. A pitchfork is a period doubling of the
    half map (half a cycle, then the mirror): the two rounds are the two halves of the cycle.

    Parameters
    ----------
    point : BifurcationPoint
        Of kind "period_doubling" or "pitchfork".
    amplitude : float, 1e-6 to 0.5
        Separation :math:`\varepsilon` of the two rounds, in driving periods and relative to the orbit's speed; it is
        halved, up to eleven times, if no orbit is found or if that is inadmissible.

    Returns
    -------
    Orbit
        A period-2n impact-2p orbit, at a parameter value above or below that of the point, depending on the direction
        of the doubled branch. At a pitchfork, an asymmetric orbit of the same n and p; the other one is its `twin`. It
        is inadmissible only if all are.

    Raises
    ------
    ValueError
        `point` is of another kind, `amplitude` is out of its range, or no doubled orbit is found.

    Notes
    -----
    Follow it with `continue_orbit`; its branch ends at the point, where the two rounds coincide. The doubled orbit is
    stable beyond a supercritical period doubling, unstable before a subcritical one. This takes a few milliseconds.

    References
    ----------
    .. [1] E. Doedel, H. B. Keller and J. P. Kernévez, "Numerical analysis and control of bifurcation problems (I)",
       Int. J. Bifurcation Chaos 1 (1991) 493-520.

    Examples
    --------
    >>> from vibroimpact.continuation import continue_orbit
    >>> from vibroimpact.orbits import find_orbit
    >>> from vibroimpact.model.oscillator import ImpactOscillator
    >>> (orbit,) = find_orbit(ImpactOscillator(omega=2.6))
    >>> branch = continue_orbit(orbit, "omega", (2.5, 2.7))
    >>> doubled = switch_branch(branch.special[0])
    >>> doubled.name, doubled.stable
    ('period-2 impact-2', True)
    """
    if not isinstance(point, BifurcationPoint) or point.kind not in ("period_doubling", "pitchfork"):
        kind = getattr(point, "kind", point)
        raise invalid("point", kind, "a period doubling or a pitchfork", "take one from the `special` of a branch")
    if not point.orbit.oscillator.energy_changes:
        raise ValueError("`point` belongs to a free vibration without loss; its doubled orbits are not available")
    size = check_share("amplitude", amplitude)
    width = scale_of(point.orbit.model, point.parameter, point.value).size
    once, z = equations_of(point.orbit, (point.parameter,), ((point.value - width, point.value + width),))
    twice, x, apart = once.doubled(z)
    virtual: list[Any] = []
    for _ in range(TRIES):
        start = x + size * apart
        solution, corrections, _ = twice.newton(start, apart)
        if corrections and np.abs(solution - start).max() < 0.5 * size:
            orbit = twice.orbit(solution)
            if orbit.admissible:
                return orbit
            virtual.append(orbit)
        size *= 0.5
    if virtual:
        return virtual[0]
    raise ValueError(
        f"no doubled orbit was found from `point` at {point.parameter} = {point.value:.12g}, with separations from "
        f"{amplitude:g} to {2.0 * size:.1g}"
    )
