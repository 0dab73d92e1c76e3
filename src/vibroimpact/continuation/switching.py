"""From a period doubling to the doubled orbit that is born there."""

from __future__ import annotations

from typing import Any

import numpy as np

from vibroimpact.continuation.arclength import newton
from vibroimpact.continuation.results import BifurcationPoint
from vibroimpact.continuation.system import System
from vibroimpact.orbits.building import make_orbit, solution_of
from vibroimpact.orbits.equations import Cycle, parameters_of
from vibroimpact.orbits.orbit import Orbit
from vibroimpact.parameters import real_number

TRIES = 12  # of an amplitude, halved each time


def switch_branch(point: BifurcationPoint, *, amplitude: float = 1e-2) -> Orbit:
    r"""Return an orbit of the doubled branch that is born at a period doubling.

    There the orbit, gone through twice, solves the equations of 2n periods and 2p impacts with a singular Jacobian; its
    null vector :math:`\phi` says how the two rounds come to differ. The doubled orbit solves the same equations with

    .. math:: \phi \cdot (z - z_0) = \varepsilon,

    the parameter being free, which is regular for :math:`\varepsilon \ne 0`.

    Parameters
    ----------
    point : BifurcationPoint
        Of kind "period_doubling".
    amplitude : float, 0 to 0.5
        How far the two rounds lie apart, :math:`\varepsilon`, in driving periods and in parts of the orbit's speed;
        halved as often as needed.

    Returns
    -------
    Orbit
        A period-2n impact-2p orbit, at a parameter near the point's: above it or below, as the doubled branch goes.

    Raises
    ------
    ValueError
        `point` is no period doubling, `amplitude` is out of its range, or no doubled orbit is found.

    Notes
    -----
    Follow it with `continue_orbit`; its branch ends at the period doubling, where the two rounds are one. A stable
    orbit is doubled into a stable one (supercritical) or meets an unstable one (subcritical). A few milliseconds.

    Examples
    --------
    >>> from vibroimpact.continuation import continue_orbit
    >>> from vibroimpact.orbits import find_orbit
    >>> from vibroimpact.oscillator import ImpactOscillator
    >>> (orbit,) = find_orbit(ImpactOscillator(omega=2.6))
    >>> branch = continue_orbit(orbit, "omega", (2.5, 2.7))
    >>> doubled = switch_branch(branch.special[0])
    >>> doubled.name, doubled.stable
    ('period-2 impact-2', True)
    """
    if not isinstance(point, BifurcationPoint) or point.kind != "period_doubling":
        given = repr(getattr(point, "kind", point))
        raise ValueError(f"`point` is {given}; allowed is a period doubling; take one from the `special` of a branch")
    size = real_number("amplitude", amplitude, "a number above 0 and up to 0.5")
    if not 0.0 < size <= 0.5:
        raise ValueError(f"`amplitude` is {amplitude!r}; allowed is a number above 0 and up to 0.5; 0.01 is usual")
    system, x, apart = _twice(point)
    for _ in range(TRIES):
        start = x + size * apart
        found, made = newton(system, start, apart[None, :], np.array([apart @ start]))
        if made and np.abs(found - start).max() < 0.5 * size:
            return make_orbit(system.oscillator_at(found), system.cycle, system.solution(found))
        size *= 0.5
    raise ValueError(
        f"`point` at {point.parameter} = {point.value:.12g} leads to no doubled orbit; allowed is one that does; "
        "try a smaller `amplitude`"
    )


def _twice(point: BifurcationPoint) -> tuple[System, Any, Any]:
    """Return the doubled equations, the orbit gone through twice, and the direction in which the rounds differ."""
    osc, parameter = point.orbit.oscillator, point.parameter
    cycle, z = solution_of(point.orbit)
    p, n = cycle.n_impacts, cycle.n_periods
    turns, speeds = np.concatenate([z[:p], z[:p] + n]), np.tile(z[p:], 2)
    value = point.value
    around = (value - max(abs(value), 1e-3), value + max(abs(value), 1e-3))
    system = System(osc, Cycle(2 * n, 2 * p), (parameter,), (around,), max(osc.velocity_scale, float(speeds.max())))
    twice = np.concatenate([turns, speeds])
    scale = np.repeat([1.0, system.speed], 2 * p)
    matrix = system.cycle.jacobian(parameters_of(osc), twice) * scale
    rows = np.repeat([system.speed / max(osc.natural_frequency, osc.omega), system.speed], 2 * p)
    direction = np.linalg.svd(matrix / rows[:, None])[2][-1]
    return system, system.pack(twice, osc), np.append(direction, 0.0)
