"""All boundaries of orbits with one impact in a plane of two parameters."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np

from vibroimpact.continuation.boundary import NoBoundary, Plane, boundary_through, check_box, check_plane
from vibroimpact.continuation.branch import walk
from vibroimpact.continuation.results import KINDS, BifurcationPoint, Boundary
from vibroimpact.continuation.sticking import Range, ends_on_line
from vibroimpact.continuation.system import UNKNOWN, both_ways, check_share, system_of
from vibroimpact.orbits.equations import Cycle, Floats, impact_1_orbits
from vibroimpact.orbits.orbit import make_orbit
from vibroimpact.orbits.sticking import StickingEnd
from vibroimpact.oscillator import ImpactOscillator, Model, check_model
from vibroimpact.parameters import choice, invalid, whole_number
from vibroimpact.progress import Report, reporter

SEEDS = 60  # values along a line at which orbits are looked for
SAME = 2.0  # steps: points of one kind nearer than this to a curve are on it


def boundary_curves(
    osc: ImpactOscillator | Model,
    parameters: tuple[str, str],
    ranges: tuple[Range, Range],
    *,
    n_periods: Sequence[int] = (1, 2),
    kinds: Sequence[str] = KINDS,
    lines: int = 5,
    step: float = 0.01,
    progress: bool | Report = False,
) -> list[Boundary]:
    r"""Return the boundaries of period-n impact-1 orbits and of period-n sticking in a plane of two parameters.

    On lines across the plane, along either parameter, the orbits known in closed form are followed [1]_, and their
    folds, period doublings and grazes collected, as well as the ends of sticking. Each of them that is on no curve yet
    is followed through the plane, by the equations of `continue_boundary` and `end_of_sticking`.

    Parameters
    ----------
    osc : ImpactOscillator or family
        The model; its own values of the two parameters do not matter.
    parameters, ranges
        As of `continue_boundary`.
    n_periods : sequence of int, >= 1
        Which n.
    kinds : sequence of {"fold", "period_doubling", "grazing", "end_of_sticking"}
        Which boundaries.
    lines : int, >= 2
        Lines along each parameter, spread evenly, the plane's edges included.
    step : float, 0 to 0.5
        As of `continue_boundary`.
    progress : bool or callable
        True shows a bar; a callable gets (lines done, lines in all, curves so far), several times per line, and stops
        by returning False: the curves finished by then are returned.

    Returns
    -------
    list of Boundary
        The curves as far as their orbits are admissible, in the order in which they were found.

    Raises
    ------
    ValueError
        Not two different parameters, a range that is empty or out of theirs, an unknown kind, or `lines` below 2.

    Notes
    -----
    A curve that crosses none of the lines is not found: an island smaller than their spacing, or a part that a graze
    cuts off. The residual of each point is below 1e-10 (1e-7 where an end of sticking meets a graze). Some seconds for
    a plane of the paper; a family's function adds its own time, called several times per point.

    References
    ----------
    .. [1] S. W. Shaw and P. J. Holmes, "A periodically forced piecewise linear oscillator", J. Sound Vib. 90 (1983)
       129-155: stability of the orbits with one impact.

    Examples
    --------
    >>> curves = boundary_curves(ImpactOscillator(), ("omega", "restitution"), ((2, 3), (0.5, 0.9)), lines=3)
    >>> sorted({(curve.kind, curve.orbits[0].n_periods) for curve in curves})
    [('end_of_sticking', 2), ('period_doubling', 1)]
    """
    check_model(osc)
    plane = names, box = check_box(osc, parameters, ranges)
    count, longest = whole_number("lines", lines, 2), check_share("step", step)
    lengths = [whole_number("n_periods", n, 1) for n in n_periods]
    wanted = {choice("kinds", kind, KINDS) for kind in ([kinds] if isinstance(kinds, str) else kinds)}
    if not wanted:
        raise invalid("kinds", kinds, f"at least one of {', '.join(KINDS)}")
    work = [
        (n, along, value) for n in lengths for along in (0, 1) for value in np.linspace(*box[1 - along], count).tolist()
    ]
    curves: list[Boundary] = []
    done = 0

    def look(*_: object) -> None:
        if report(done, len(work), curves) is False:
            raise _Stopped

    with reporter(progress, "lines") as report, suppress(_Stopped):
        for n, along, value in work:
            line = osc.replace(**{names[1 - along]: value}), names[along], box[along], n
            for point in _on_line(*line, longest, look):
                if point.kind in wanted:
                    _add_curve(curves, point, plane, longest, look)
            for end in ends_on_line(*line, SEEDS, look) if "end_of_sticking" in wanted else ():
                _add_curve(curves, end, plane, longest, look)
            done += 1
            look()
    return curves


def curves_through(
    points: Iterable[BifurcationPoint],
    parameters: tuple[str, str],
    ranges: tuple[Range, Range],
    *,
    step: float = 0.01,
    progress: bool | Report = False,
) -> list[Boundary]:
    """Return the boundaries through given bifurcation points, each curve once, as far as its orbits are admissible.

    Parameters
    ----------
    points : iterable of BifurcationPoint
        From the `special` of branches; those on a curve that was followed already are skipped.
    parameters, ranges, step
        As of `continue_boundary`.
    progress : bool or callable
        True shows a count; a callable gets (curves done, None, curves so far), several times per curve, and stops by
        returning False: the curves finished by then are returned.

    Returns
    -------
    list of Boundary
        In the order of the points. A point where two boundaries meet begins no curve.

    Raises
    ------
    ValueError
        An argument is out of its range, or a point lies outside `ranges`.
    """
    longest = check_share("step", step)
    curves: list[Boundary] = []

    def look(*_: object) -> None:
        if report(len(curves), UNKNOWN, curves) is False:
            raise _Stopped

    with reporter(progress, "curves") as report, suppress(_Stopped):
        for point in points:
            _add_curve(curves, point, check_plane(point, parameters, ranges), longest, look)
    return curves


class _Stopped(Exception):
    """The search was stopped by its progress callback."""


def _on_line(
    model: Model, parameter: str, range: Range, n: int, longest: float, look: Report
) -> Iterator[BifurcationPoint]:
    """Yield the special points of the period-n impact-1 orbits along a line, each branch followed once."""
    covered: list[Floats] = []
    for value in np.linspace(*range, SEEDS).tolist():
        look(0, UNKNOWN, None)
        here = model.replace(**{parameter: value})
        for z in impact_1_orbits(here.at(), n)[0]:
            if any(_covered(rows, value, float(z[1])) for rows in covered):
                continue
            orbit = make_orbit(here, Cycle(n, 1), z)
            if not orbit.admissible:
                continue
            system, solved = system_of(orbit, (parameter,), (range,))
            for way in both_ways(partial(walk, system, system.pack(solved), longest, False), look):
                covered.append(np.array([[*system.values(p.x), p.z[1]] for p in way.points]))
                yield from (special.bifurcation(parameter) for special in way.special)


def _covered(branch: Floats, value: float, speed: float) -> bool:
    """Whether an orbit is on a branch already followed: between two of its points, with a velocity between theirs."""
    values, speeds = branch.T
    around = np.flatnonzero((values[:-1] - value) * (values[1:] - value) <= 0.0)
    low, high = np.sort([speeds[around], speeds[around + 1]], axis=0)
    slack = 0.25 * (high - low) + 1e-6 * high
    return bool(((low - slack <= speed) & (speed <= high + slack)).any())


def _add_curve(
    curves: list[Boundary], point: BifurcationPoint | StickingEnd, plane: Plane, longest: float, look: Report
) -> None:
    """Append the curve through a point, unless the point lies on a known one or cannot be followed."""
    if any(_lies_on(point, curve, plane, longest) for curve in curves):
        return
    with suppress(NoBoundary):  # two boundaries meet in the point: the other lines cross them separately
        curves.append(boundary_through(point, plane, longest, virtual=False, report=look))


def _lies_on(point: BifurcationPoint | StickingEnd, curve: Boundary, plane: Plane, longest: float) -> bool:
    """Whether a point is on a curve: less than some steps from one of its points, with nearly that one's velocity."""
    orbit = point.orbit
    if orbit is None or (curve.kind, curve.orbits[0].n_periods) != (point.kind, orbit.n_periods):
        return False

    def place(orbits: Sequence[Any]) -> Floats:
        spans = [high - low for low, high in plane.box]
        rows = [[q.value(name) for name in curve.parameters] for q in orbits]
        speeds = [max(q.velocities, default=0.0) / q.oscillator.velocity_scale for q in orbits]
        return np.column_stack([np.array(rows) / spans, speeds])

    at, on = place([orbit])[0], place(curve.orbits)
    near = np.abs(on[:, :2] - at[:2]).max(axis=1) < SAME * longest
    return bool((near & (np.abs(on[:, 2] - at[2]) < 0.1 * (1.0 + at[2]))).any())
