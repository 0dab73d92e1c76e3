"""Follow a fold, a period doubling or a graze as a curve in two parameters."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibroimpact.continuation.request import check_parameter, check_range, check_step
from vibroimpact.continuation.results import BifurcationPoint
from vibroimpact.continuation.sticking import sticking_boundary
from vibroimpact.continuation.system import LAST_IMPACT, TOUCH, System
from vibroimpact.continuation.tracing import trace_boundary
from vibroimpact.orbits.admissibility import nearest_misses
from vibroimpact.orbits.building import solution_of
from vibroimpact.orbits.equations import Floats
from vibroimpact.orbits.sticking_end import StickingEnd
from vibroimpact.progress import Report, reporter

Range = tuple[float, float]


def continue_boundary(
    point: BifurcationPoint,
    parameters: tuple[str, str],
    ranges: tuple[Range, Range],
    *,
    step: float = 0.01,
    virtual: bool = True,
    progress: bool | Report = False,
) -> Any:
    r"""Follow a bifurcation of a periodic orbit as a curve in two parameters.

    The orbit's equations and the boundary's own condition hold together,

    .. math:: 1 \mp \operatorname{tr} M + \det M = 0 \quad\text{(fold, period doubling)}, \qquad
              u(t_*) = \dot u(t_*) = 0 \quad\text{or}\quad v_i = 0 \quad\text{(grazing)},

    with two parameters free; u is the gap left, M the Jacobian of the cycle.

    Parameters
    ----------
    point : BifurcationPoint
        Where to begin: from the `special` of a `Branch`. An end of sticking is followed by its own method.
    parameters : tuple of two str
        The plane: any two different ones of the seven, or `frequency` (Hz).
    ranges : tuple of two pairs of float
        Lowest and highest value of each; the point lies between.
    step : float, 0 to 0.5
        Longest step along the curve, where 1 is a whole range, a driving period, or the orbit's speed.
    virtual : bool
        Whether to go on where the orbit on the boundary is no motion of the mass (`admissible` False); else the curve
        ends there.
    progress : bool or callable
        True shows a count; a callable gets (points done, None, None) and stops by returning False.

    Returns
    -------
    Boundary
        `values`, `orbits`, `residuals`, `dataset`, and why it ends, in `outcome` and `message`.

    Raises
    ------
    ValueError
        An argument is out of its range, or the point does not satisfy the condition of its kind.

    Notes
    -----
    Pseudo-arclength with Newton's method at each point. Each point is tested anew: its residual, the larger of the miss
    of its flights and of its condition in parts of the orbit's size, stays below 1e-10, else the curve ends there as
    "lost". Some milliseconds a point.

    Examples
    --------
    >>> from vibroimpact.continuation import continue_orbit
    >>> from vibroimpact.orbits import find_orbit
    >>> from vibroimpact.oscillator import ImpactOscillator
    >>> (orbit,) = find_orbit(ImpactOscillator(omega=2.6))
    >>> branch = continue_orbit(orbit, "omega", (2.5, 2.7))
    >>> curve = continue_boundary(branch.special[0], ("omega", "restitution"), ((2, 3), (0.5, 0.9)), step=0.05)
    >>> curve.kind, max(curve.residuals) < 1e-10
    ('period_doubling', True)
    """
    if isinstance(point, StickingEnd):
        return sticking_boundary(point, parameters, ranges, step)
    if not isinstance(point, BifurcationPoint):
        raise ValueError(
            f"`point` is {point!r}; allowed is a BifurcationPoint; take one from the `special` of a branch"
        )
    names, box = check_plane(point, parameters, ranges)
    longest = check_step(step)
    system, x = boundary_system(point, names, box)
    with reporter(progress, "points") as report:
        return trace_boundary(system, x, point.kind, longest, virtual, report)


def check_plane(point: BifurcationPoint, parameters: Any, ranges: Any) -> tuple[tuple[str, str], tuple[Range, Range]]:
    """Return two parameters and their ranges, or say what is wrong with them."""
    names, box = plane_names(parameters), list(ranges)
    if len(box) != 2:
        raise ValueError(f"`ranges` is {ranges!r}; allowed are two pairs; give ((lowest, highest), (lowest, highest))")
    osc = point.orbit.oscillator
    return names, (
        check_range(names[0], box[0], getattr(osc, names[0])),
        check_range(names[1], box[1], getattr(osc, names[1])),
    )


def plane_names(parameters: Any) -> tuple[str, str]:
    """Return the names of two different parameters."""
    chosen = tuple(parameters) if isinstance(parameters, (tuple, list)) else ()
    if len(chosen) != 2:
        raise ValueError(f"`parameters` is {parameters!r}; allowed are two names; give for example ('omega', 'mass')")
    first, second = map(check_parameter, chosen)
    if first == second or {first, second} == {"omega", "frequency"}:
        raise ValueError(f"`parameters` is {parameters!r}; allowed are two different ones; replace one of them")
    return first, second


def boundary_system(point: BifurcationPoint, names: tuple[str, str], box: tuple[Range, Range]) -> tuple[System, Floats]:
    """Return the equations of a boundary and the unknown of the point it begins with."""
    osc, p = point.orbit.oscillator, point.orbit.n_impacts
    cycle, z = solution_of(point.orbit)
    speed = max(osc.velocity_scale, float(z[p:].max()))
    condition, where, touch = point.kind, 0, math.nan
    if condition == "grazing":
        where = int(np.argmin(z[p:]))
        condition = LAST_IMPACT if z[p + where] <= 1e-9 * speed else TOUCH
    if condition == TOUCH:
        misses = nearest_misses(osc, cycle, z)
        lowest = min(misses, key=lambda miss: abs(miss.gap), default=None)
        if lowest is None:
            raise _no_boundary(point)
        where, touch = lowest.flight, lowest.turns
    system = System(osc, cycle, names, box, speed, condition, where)
    x = system.pack(z, osc, touch)
    if np.abs(system.misses(x)).max() > 1e-6:
        raise _no_boundary(point)
    return system, x


def _no_boundary(point: BifurcationPoint) -> ValueError:
    return ValueError(
        f"`point` is no {point.kind.replace('_', ' ')}; allowed is a point whose orbit satisfies its condition; "
        "take one from the `special` of a branch"
    )
