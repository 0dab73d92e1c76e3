"""Boundaries in a plane of two parameters: of orbits with one impact, and of the motions on a coarse map."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import groupby, product
from typing import TYPE_CHECKING

import numpy as np

from vibroimpact.continuation.boundary import NoBoundary, Plane, boundary_through, check_box, check_plane
from vibroimpact.continuation.coverage import CELLS, Coverage, coverage, distances
from vibroimpact.continuation.equations import Range
from vibroimpact.continuation.following import UNKNOWN, check_share
from vibroimpact.continuation.lines import ends_on_line, points_on_line, without_grazing_impacts
from vibroimpact.continuation.results import KINDS, BifurcationPoint, Boundary, course, kinds_of
from vibroimpact.continuation.sticking import MOST
from vibroimpact.dataset import bifurcation_name
from vibroimpact.model import Model, check_model
from vibroimpact.model.oscillator import ImpactOscillator
from vibroimpact.motion import cycle_name, listed
from vibroimpact.orbits.admissibility import ROUNDING
from vibroimpact.orbits.equations import Floats
from vibroimpact.orbits.orbit import Orbit
from vibroimpact.orbits.sticking_end import StickingEnd
from vibroimpact.orbits.symmetry import images_along
from vibroimpact.parameters import choice, counted, invalid, several, whole_number
from vibroimpact.progress import Report, reporter
from vibroimpact.showing import Table, written
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr

Bools = np.ndarray[tuple[int], np.dtype[np.bool_]]

USUAL = (1, 2)  # driving periods of the one-impact orbits and sticking orbits sought on lines
ENOUGH = 200  # points to either side along an end of sticking; each takes ten times as long as on other curves
CRITICAL = 1.0 + 1e-6  # modulus of an unstable multiplier; the critical ones of a boundary are 1 to rounding
SAME = 0.25  # in steps: a point closer than this to a curve of its kind and orbit type lies on it


class Boundaries(list[Boundary]):
    """The boundaries found in a plane, with a description of the search.

    Attributes
    ----------
    message : str
        The motions followed, and the share of the class boundaries of a coarse map that the curves reach.
    share : float
        The share of that map's class boundaries within 1.5 cells of a curve; NaN if no map was computed.
    motions : xarray.Dataset or None
        That map, of motions from rest, as `classify` returns it.
    """

    def __init__(self, curves: Iterable[Boundary] = ()) -> None:
        super().__init__(curves)
        self.message = ""
        self.share = math.nan
        self.motions: xr.Dataset | None = None

    def _rows(self) -> list[tuple[str, str]]:
        """Return each curve in words, and its ranges of the two parameters."""
        tables = [curve._table() for curve in self]
        return [(t.title, ", ".join(f"{name} {low:.4g} to {high:.4g}" for name, low, high in t.rows)) for t in tables]

    def __repr__(self) -> str:
        lines = [f"  {title}, {ranges}" for title, ranges in self._rows()]
        return "\n".join([counted(len(self), "curve"), *lines, *filter(None, [self.message])])

    def _repr_html_(self) -> str:
        notes = list(filter(None, [self.message]))
        return written(Table(counted(len(self), "curve"), ("boundary", "ranges") if self else (), self._rows(), notes))


def boundary_curves(
    osc: ImpactOscillator | Model,
    parameters: tuple[str, str],
    ranges: tuple[Range, Range],
    *,
    n_periods: Sequence[int] | None = None,
    kinds: Sequence[str] | None = None,
    lines: int = 5,
    step: float = 0.01,
    progress: bool | Report | None = None,
) -> Boundaries:
    r"""Find the curves in a plane of two parameters at which attractors end.

    The search has two parts. First, orbits with one impact, known in closed form [1]_, are followed on lines across the
    plane along either parameter; their folds, period doublings and grazes are collected, as are ends of sticking.
    Second, motions from rest are computed on a map of 48 x 48 cells. Wherever two neighbouring cells differ and no
    curve passes within 1.5 cells, the motions on both sides are followed to their ends, if they cover more than 1 % of
    the map. Each bifurcation found that is on no curve yet is followed through the plane, by the equations of
    `continue_boundary` and `end_of_sticking`.

    Parameters
    ----------
    osc : ImpactOscillator, ImpactSystem or family
        The model; its own values of the two parameters are not used.
    parameters, ranges
        As in `continue_boundary`.
    n_periods : sequence of int, >= 1, optional
        Search only for boundaries of period-n impact-1 orbits and of period-n sticking for these n, without a map;
        boundaries of orbits that are unstable on both sides are included. None searches for n = 1 and 2 and for the
        motions on the map.
    kinds : sequence of {"fold", "period_doubling", "grazing", "end_of_sticking"}, optional
        Kinds of boundaries; systems have no "end_of_sticking" here, but also "neimark_sacker" and "pitchfork". None
        means all.
    lines : int, >= 2
        Number of lines along each parameter, evenly spaced, including the plane's edges.
    step : float, 1e-6 to 0.5
        As in `continue_boundary`.
    progress : bool or callable, optional
        None shows a temporary line on a terminal or in a notebook if it takes more than a second.
        True shows a bar; a callable gets (lines done, lines in all, curves so far), several times per line, and stops
        the search by returning False: the curves finished by then are returned.

    Returns
    -------
    Boundaries
        A list of `Boundary`, restricted to admissible orbits, each curve once, in the order found; with a `message`
        that describes the search, and the `share` of the map's class boundaries within 1.5 cells of a curve.

    Raises
    ------
    ValueError
        The parameters are not two different ones, a range is empty or not allowed, a kind is unknown, or `lines` is
        below 2.

    Notes
    -----
    The motion named is stable and admissible on one side of a curve only. At a graze with velocity 0 the impact-free
    steady motion first touches the stop. A class boundary that no curve reaches bounds chaos (a crisis) or a motion
    that covers less than 1 % of the map, or both motions exist on both sides and the one reached from rest changes. A
    motion that covers less than a cell of the map, or is not reached from rest, is found only if it crosses one of the
    lines. For symmetric systems, orbits with an impact in each half of a cycle are also followed from the lines;
    sticking of systems is not followed, nor are impact-free motions from their maps. The residual of each point is
    below 1e-10 (1e-7 where an end of sticking meets a graze). A plane of the paper takes 15 to 60 s, mostly for ends of
    sticking; the function of a family is called several times per point and adds its own time.

    References
    ----------
    .. [1] S. W. Shaw and P. J. Holmes, "A periodically forced piecewise linear oscillator", J. Sound Vib. 90 (1983)
       129-155: stability of the orbits with one impact.

    Examples
    --------
    >>> plane = ("omega", "restitution"), ((2, 3), (0.5, 0.9))
    >>> curves = boundary_curves(ImpactOscillator(), *plane, n_periods=(1, 2), lines=3)
    >>> sorted({(curve.kind, curve.orbits[0].n_periods) for curve in curves})
    [('end_of_sticking', 2), ('period_doubling', 1)]
    """
    check_model(osc)
    possible = kinds_of(osc)
    plane = names, box, _ = check_box(osc, parameters, ranges)
    count, longest = whole_number("lines", lines, 2), check_share("step", step)
    periods = several("n_periods", USUAL if n_periods is None else n_periods, "a list of whole numbers")
    lengths = [whole_number("n_periods", n, 1) for n in periods]
    chosen = possible if kinds is None else several("kinds", kinds, "a list of kinds")
    wanted = frozenset(choice("kinds", kind, possible) for kind in chosen)
    if not wanted:
        raise invalid("kinds", kinds, f"at least one of {', '.join(possible)}")
    work = [
        (n, along, value) for n in lengths for along in (0, 1) for value in np.linspace(*box[1 - along], count).tolist()
    ]
    curves = Boundaries()
    done, total = 0, len(work) + (0 if n_periods is not None else 2 * CELLS)

    def going(*_: object) -> bool:
        return report(done, total, curves) is not False

    def look(*_: object) -> None:
        if not going():
            raise _Stopped

    search = _Search(curves, plane, longest, look, wanted, attractors=n_periods is None)
    with reporter(progress, "lines") as report, suppress(_Stopped):
        for n, along, value in work:
            line = osc.replace(**{names[1 - along]: value}), names[along], box[along], n
            for point in points_on_line(*line, longest, look):
                search.add(point)
            for end in ends_on_line(*line, look) if "end_of_sticking" in wanted else ():
                search.add(end)
            done += 1
            look()
        if n_periods is None:
            for _ in search.cover(coverage(osc, plane, going)):
                done += 1
                look()
    followed_kinds = [kind for kind in possible if kind in wanted]
    _describe(curves, search.map, n_periods, followed_kinds, possible, finished=done == total)
    return curves


def curves_through(
    points: Iterable[BifurcationPoint],
    parameters: tuple[str, str],
    ranges: tuple[Range, Range],
    *,
    step: float = 0.01,
    progress: bool | Report | None = None,
) -> Boundaries:
    """Follow the boundaries through given bifurcation points, each curve once, as far as its orbits are admissible.

    Parameters
    ----------
    points : iterable of BifurcationPoint
        From the `special` of branches; points on a curve already followed are skipped.
    parameters, ranges, step
        As in `continue_boundary`.
    progress : bool or callable, optional
        None shows a temporary line on a terminal or in a notebook if it takes more than a second.
        True shows a count; a callable gets (curves done, None, curves so far), several times per curve, and stops the
        computation by returning False: the curves finished by then are returned.

    Returns
    -------
    Boundaries
        In the order of the points. No curve is followed from a point where two boundaries meet.

    Raises
    ------
    ValueError
        An argument is out of its range, or a point lies outside `ranges`.
    """
    longest = check_share("step", step)
    curves = Boundaries()

    def look(*_: object) -> None:
        if report(len(curves), UNKNOWN, curves) is False:
            raise _Stopped

    with reporter(progress, "curves") as report, suppress(_Stopped):
        search: _Search | None = None
        for point in points:
            plane = check_plane(point, parameters, ranges)
            search = search or _Search(curves, plane, longest, look)
            search.add(point)
    return curves


class _Stopped(Exception):
    """The search was stopped by its progress callback."""


@dataclass
class _Search:
    """The curves of a plane followed so far.

    Attributes
    ----------
    curves : list of Boundary
        The list in which the parts of interest are collected.
    attractors : bool
        Whether a curve is of interest only where it bounds a stable orbit or the impact-free steady motion.
    followed : list of Boundary
        All curves followed, complete.
    map : Coverage or None
        The map whose class boundaries the curves should reach.
    """

    curves: list[Boundary]
    plane: Plane
    longest: float
    look: Report
    kinds: Collection[str] = KINDS
    attractors: bool = False
    followed: list[Boundary] = field(default_factory=list)
    map: Coverage | None = None

    def add(self, point: BifurcationPoint | StickingEnd) -> None:
        """Follow the curve through a point, unless it is not wanted, lies on a followed curve or cannot be followed."""
        point = without_grazing_impacts(point)
        if point.kind not in self.kinds or self._on_curve(point.kind, [point.orbit] if point.orbit else [])[0]:
            return
        with suppress(NoBoundary):  # two boundaries meet at the point; another line or edge crosses them separately
            longest, most = self.longest, MOST
            if self.attractors and isinstance(point, StickingEnd):
                longest, most = 2.0 * longest, ENOUGH
            curve = boundary_through(point, self.plane, longest, virtual=False, report=self.look, most=most)
            again = self._on_curve(curve.kind, curve.orbits)
            unstable = np.zeros(len(again), dtype=bool)
            if self.attractors and point.orbit is not None and not point.orbit.sticks:
                unstable = np.array([_unstable(curve.kind, orbit) for orbit in curve.orbits])
            for part in _parts(curve, again, unstable):
                self.curves.append(part)
                if self.map is not None:
                    self.map.add(part)
            self.followed.append(curve)

    def cover(self, map: Coverage) -> Iterator[None]:
        """Follow the motions at the class boundaries that no curve reaches yet; yield after each row and column."""
        if (map.motions["status"] == Status.INTERRUPTED).any():
            raise _Stopped
        self.map = map
        for curve in self.curves:
            map.add(curve)
        number = 0
        for along, row in product((0, 1), range(CELLS)):
            while number < len(map.edges) and map.edges[number][:1] == (along,) and map.edges[number].low[0] == row:
                if not map.reached[number]:
                    self.look(0, UNKNOWN, None)
                    for end in map.ends(number):
                        self.add(end)
                number += 1
            yield

    def _on_curve(self, kind: str, orbits: Sequence[Orbit]) -> Bools:
        """Return which orbits lie on a curve already followed, closer to it than a fraction of a step."""
        on_curve = np.zeros(len(orbits), dtype=bool)
        sought = [_type(kind, orbit) for orbit in orbits[:1]]
        alike = [curve for curve in self.followed if _type(curve.kind, curve.orbits[0]) in sought]
        stops = orbits[0].system.stop_names if alike else ()
        images = images_along(orbits[0].model, self.plane.names, self.plane.box) if len(stops) > 1 else ()
        orders = [stops, tuple(stops[at] for at in images)] if images else [stops]  # of itself, and of its mirror image
        for curve, names in product(alike, orders):
            fastest = max(max(orbit.velocities, default=0.0) for orbit in curve.orbits)
            places = self._places(orbits, stops, fastest), self._places(curve.orbits, names, fastest)
            on_curve |= distances(*places) < SAME * self.longest
        return on_curve

    def _places(self, orbits: Sequence[Orbit], stops: Sequence[str], fastest: float) -> Floats:
        """Return parameters relative to their ranges and, without sticking, the hardest impact on each stop."""
        spans = [high - low for low, high in self.plane.box]
        rows = np.array([[orbit.value(name) for name in self.plane.names] for orbit in orbits]) / spans
        if orbits[0].n_impacts == -1 or fastest == 0.0:
            return rows
        return np.column_stack([rows, [[_hardest(orbit, stop) / fastest for stop in stops] for orbit in orbits]])


def _hardest(orbit: Orbit, stop: str) -> float:
    """Return the velocity of the hardest impact on a stop, 0 if it is not struck."""
    return max((v for v, struck in zip(orbit.velocities, orbit.stops, strict=True) if struck == stop), default=0.0)


def _unstable(kind: str, orbit: Orbit) -> bool:
    """Whether an orbit on a boundary is unstable on both sides: it has more unstable multipliers."""
    if kind == "grazing":
        return orbit.spectral_radius >= 1.0 - ROUNDING and max(orbit.velocities) > 0.0
    return max(map(abs, orbit.multipliers)) > CRITICAL


def _type(kind: str, orbit: Orbit) -> tuple[str, int, int]:
    return kind, orbit.n_periods, orbit.n_impacts


def _parts(curve: Boundary, again: Bools, unstable: Bools) -> Iterator[Boundary]:
    """Yield the runs of points of a curve that are neither on another curve nor unstable, and why they end."""
    drop = again | unstable
    if not drop.any():
        yield curve
        return
    for dropped, run in groupby(range(len(drop)), key=lambda i: bool(drop[i])):
        points = list(run)
        first, last = points[0], points[-1] + 1
        before = curve.outcome[0] if first == 0 else "unstable" if unstable[first - 1] else "joined"
        after = curve.outcome[1] if last == len(drop) else "unstable" if unstable[last] else "joined"
        first, last = first - (before == "joined"), last + (after == "joined")  # up to the other curve
        if dropped or last - first < 2:
            continue
        orbits = curve.orbits[first:last]
        yield replace(
            curve,
            orbits=orbits,
            residuals=curve.residuals[first:last],
            touch_phases=curve.touch_phases[first:last],
            outcome=(before, after),
            message=course("curve", orbits, curve.parameters, (before, after)),
        )


def _describe(
    curves: Boundaries,
    map: Coverage | None,
    n_periods: Sequence[int] | None,
    kinds: Sequence[str],
    possible: Sequence[str],
    finished: bool,
) -> None:
    """Describe which motions were followed, and the kinds of boundaries unless all were sought."""
    sentences = [] if finished else ["stopped before all was followed"]
    if len(kinds) < len(possible):
        sentences += [f"{listed([bifurcation_name(kind) for kind in kinds])} only"]
    if n_periods is not None:
        impacts = [1] * (set(kinds) != {"end_of_sticking"}) + [-1] * ("end_of_sticking" in kinds)
        names = listed([cycle_name(n, p) for n in n_periods for p in impacts])
        names += ", and symmetric orbits with an impact in each half," * ("pitchfork" in possible)
        sentences += [f"searched for {names} on lines across the plane only", "other motions end elsewhere"]
    elif map is not None:
        curves.share, curves.motions = map.share, map.motions
        sentences += map.sentences(finished=finished)
    curves.message = "; ".join(sentences)
