"""Follow a periodic orbit along one parameter."""

from __future__ import annotations

import numpy as np

from vibroimpact.continuation.arclength import newton
from vibroimpact.continuation.points import Special, residual, special_orbit, touch_turns
from vibroimpact.continuation.request import check_orbit, check_parameter, check_range, check_step
from vibroimpact.continuation.results import BifurcationPoint, Branch
from vibroimpact.continuation.system import System
from vibroimpact.continuation.walking import ENDS, both_ways, branch_system
from vibroimpact.orbits.building import make_orbit
from vibroimpact.orbits.equations import Floats
from vibroimpact.orbits.orbit import Orbit
from vibroimpact.progress import Report, reporter


def bifurcation_point(special: Special, parameter: str) -> BifurcationPoint:
    """Return a special point of a branch as callers see it."""
    return BifurcationPoint(
        kind=special.kind,
        parameter=parameter,
        value=special.system.values(special.x)[0],
        orbit=special_orbit(special),
        residual=residual(special),
        touch_phase=touch_turns(special) % 1.0,
    )


def continue_orbit(
    orbit: Orbit,
    parameter: str,
    range: tuple[float, float],
    *,
    step: float = 0.01,
    virtual: bool = True,
    progress: bool | Report = False,
) -> Branch:
    r"""Follow a periodic orbit, stable or not, along one parameter, both ways and through folds.

    The branch is the curve on which all flights come back to their impacts; bifurcations on it are

    .. math:: \text{fold: } 1 - \operatorname{tr} M + \det M = 0, \qquad
              \text{period doubling: } 1 + \operatorname{tr} M + \det M = 0,

    with M the Jacobian of the cycle, and grazing, where a flight touches the stop between its ends, or the velocity of
    an impact passes through zero.

    Parameters
    ----------
    orbit : Orbit
        Where to begin; one that `find_orbit` or `switch_branch` returned, with n_impacts >= 1.
    parameter : str
        What to vary: one of the seven parameters, or `frequency` (Hz).
    range : tuple of two float
        Its lowest and highest value; the orbit's own lies between.
    step : float, 0 to 0.5
        Longest step along the curve, where 1 is the whole range, a driving period, or the orbit's speed.
    virtual : bool
        Whether to go on beyond a graze, where the mass does not move so any more (`admissible` False) but may do so
        again; else the branch ends at the graze.
    progress : bool or callable
        True shows a count; a callable gets (orbits done, None, None) and stops by returning False.

    Returns
    -------
    Branch
        `orbits`, `special` (list of `BifurcationPoint`), `dataset`, and why it ends, in `outcome` and `message`.

    Raises
    ------
    ValueError
        An argument is out of its range, or the orbit solves no equations (it is of another oscillator).

    Notes
    -----
    Pseudo-arclength with Newton's method at each point; special points solve their own equations together with the
    orbit's, to rounding: about 1e-14 of the parameter where the condition passes zero at a finite slope. Only those
    along which the mass moves so are listed. A doubled branch ends at the period doubling it comes from. Two events of
    one kind within a step may be missed: halve `step`. At r = 0 the graze at which the force begins to hold the mass
    after an impact is seen in `admissible` alone. About a millisecond an orbit and impact.

    References
    ----------
    .. [1] H. B. Keller, "Numerical solution of bifurcation and nonlinear eigenvalue problems", in Applications of
       Bifurcation Theory, Academic Press (1977) 359-384.

    Examples
    --------
    >>> from vibroimpact.orbits import find_orbit
    >>> from vibroimpact.oscillator import ImpactOscillator
    >>> (orbit,) = find_orbit(ImpactOscillator(omega=2.5))
    >>> branch = continue_orbit(orbit, "omega", (2.0, 3.0), step=0.05)
    >>> [(point.kind, round(point.value, 9)) for point in branch.special]
    [('period_doubling', 2.65392352)]
    """
    orbit, parameter = check_orbit("orbit", orbit), check_parameter(parameter)
    ends = check_range(parameter, range, getattr(orbit.oscillator, parameter))
    longest = check_step(step)
    system, x = branch_system(orbit, parameter, ends)
    x = _settled(system, x)
    with reporter(progress, "orbits") as report:
        down, up = both_ways(system, x, longest, virtual, report)
    points = down.points[:0:-1] + up.points
    special = [s for s in down.special[::-1] + up.special if special_orbit(s).admissible]
    orbits = [make_orbit(system.oscillator_at(p.x), system.cycle, system.solution(p.x)) for p in points]
    outcome = (down.end, up.end)
    return Branch(
        parameter=parameter,
        orbits=orbits,
        special=[bifurcation_point(s, parameter) for s in special],
        outcome=outcome,
        message=_message(orbits, parameter, outcome),
        arguments={"range": ends, "step": longest, "virtual": virtual},
    )


def _settled(system: System, x: Floats) -> Floats:
    """Return the orbit corrected at its own parameter, or refuse one that solves nothing."""
    row = np.zeros((1, len(x)))
    row[0, -1] = 1.0
    found, made = newton(system, x, row, x[-1:])
    if made and np.abs(found - x).max() < 1e-3:
        return found
    if np.abs(system.misses(x)).max() < 1e-9:
        return x  # at a fold: solved, though the parameter does not fix it
    raise ValueError(
        "`orbit` does not return to itself; allowed is a periodic orbit of its own oscillator; find it with find_orbit"
    )


def _message(orbits: list[Orbit], parameter: str, outcome: tuple[str, str]) -> str:
    first, last = (getattr(orbit.oscillator, parameter) for orbit in (orbits[0], orbits[-1]))
    words = (
        f"from {parameter} = {first:.9g}, {ENDS[outcome[0]]}, to {parameter} = {last:.9g}, {ENDS[outcome[1]]}"
        if outcome[0] != "closed"
        else f"a closed branch through {parameter} = {last:.9g}"
    )
    hidden = sum(not orbit.admissible for orbit in orbits)
    return words + (f"; {hidden} of {len(orbits)} orbits are no motion of the mass" if hidden else "")
