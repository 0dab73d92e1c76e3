"""A coarse map of the motions in a plane, its class boundaries, and the bifurcations that cause them.

The motions are those from rest. A class boundary is an edge between two cells with different motions. The motion on one
side is followed along the line through the centres of both cells, to the bifurcation at which it ends.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vibroimpact.backends import ImpactWindow, Measurement, get_backend
from vibroimpact.continuation.boundary import Plane
from vibroimpact.continuation.branch import walk
from vibroimpact.continuation.flights import equations_of
from vibroimpact.continuation.results import BifurcationPoint, Boundary
from vibroimpact.model import Model
from vibroimpact.motion import NAMING, MotionClass, listed, motion_name
from vibroimpact.motion.classes import classify
from vibroimpact.orbits.equations import Cycle, Floats
from vibroimpact.orbits.one_mass import make_orbit
from vibroimpact.orbits.orbit import Orbit
from vibroimpact.orbits.search import search_of, settled_orbit
from vibroimpact.orbits.sticking_end import StickingEnd, end_of_sticking
from vibroimpact.progress import Report
from vibroimpact.sweeps import parameter_map

if TYPE_CHECKING:
    import xarray as xr

CELLS = 48  # along each parameter
LEAST = 0.01  # of the cells: smallest share of a motion that is followed
NEAR = 1.5  # in cells: largest distance between a class boundary and a curve that reaches it
STRIDE = 0.25  # longest step, relative to the distance between two cells
WINDOW = ImpactWindow(100, 5000)  # of `parameter_map`, whose motions these are

Cell = tuple[int, int]
Name = tuple[int, int, int]  # MotionClass, n_periods, n_impacts


class CellEdge(NamedTuple):
    """An edge between two cells with different motions, neighbours along one parameter (0 or 1)."""

    along: int
    low: Cell
    high: Cell

    @property
    def middle(self) -> tuple[float, float]:
        """The middle of the edge, in cells from the corner of the plane."""
        (a, b), (c, d) = self.low, self.high
        return 0.5 * (a + c + 1), 0.5 * (b + d + 1)


@dataclass
class Coverage:
    """The motions of a coarse map, and the share of its class boundaries that curves reach.

    Attributes
    ----------
    motions : xarray.Dataset
        The map as `classify` returns it.
    edges : list of CellEdge
        Its class boundaries.
    reached : array of bool
        Whether each edge lies within 1.5 cells of a curve.
    lasting : set of int
        Edges across which the motion on one side remains stable, although the motion from rest changes to another one.
    followed : list of (MotionClass, n, p)
        The motions that cover more than 1 % of the cells and whose boundaries can be followed, the most frequent first.
    """

    model: Model
    plane: Plane
    motions: xr.Dataset
    names: dict[Cell, Name]
    edges: list[CellEdge]
    reached: np.ndarray[tuple[int], np.dtype[np.bool_]]
    lasting: set[int] = field(default_factory=set)
    followed: list[Name] = field(init=False)

    @property
    def share(self) -> float:
        """The share of the class boundaries that curves reach; 1 where there is no class boundary."""
        return float(self.reached.mean()) if self.edges else 1.0

    def sentences(self, *, finished: bool) -> list[str]:
        """Return sentences on the curves, the share of the class boundaries that they reach, and the remaining ones."""
        names = listed([motion_name(*name) for name in self.followed]) or "no motion"
        piece = " (of sticking, in one piece)" if any(name[0] == MotionClass.STICKING for name in self.followed) else ""
        map_text = f"a map of {CELLS} x {CELLS} cells, from rest"
        sentences = [f"followed {names}: motions that cover more than {100 * LEAST:g} %{piece} of {map_text}"]
        unseen = "islands smaller than a cell are missed"
        if not self.edges:
            return [*sentences, f"that map has no class boundary, {unseen}"]
        near = f"lie within {NEAR:g} cells of a curve"
        sentences.append(f"{100 * self.share:.0f} % of that map's {len(self.edges)} class boundaries {near}, {unseen}")
        unreached = np.flatnonzero(~self.reached).tolist()
        if finished and unreached:
            lasting = [i for i in unreached if i in self.lasting]
            lost = [
                i for i in unreached if i not in self.lasting and not self._followed_cells.isdisjoint(self.edges[i][1:])
            ]
            lasting_share, lost_share = (100 * len(part) / len(self.edges) for part in (lasting, lost))
            beside = f"at {lasting_share:.0f} % a stable motion continues, but another one is reached from rest"
            ends = f"at {lost_share:.0f} % no curve could be followed" if lost else ""
            others = "the others bound chaos and motions that were not followed"
            sentences.append(", ".join(filter(None, [beside, ends, others])))
        return sentences

    def model_at(self, cell: Cell) -> Model:
        """Return the model at the centre of a cell."""
        return self.model.replace(**dict(zip(self.plane.names, self._centre(cell), strict=True)))

    def _centre(self, cell: Cell) -> list[float]:
        return [low + (i + 0.5) / CELLS * (high - low) for i, (low, high) in zip(cell, self.plane.box, strict=True)]

    def add(self, curve: Boundary) -> None:
        """Mark the class boundaries that a curve reaches."""
        if self.edges:
            lows, spans = np.array([(low, high - low) for low, high in self.plane.box]).T
            middles = np.array([edge.middle for edge in self.edges])
            self.reached |= distances(middles, (curve.values - lows) / spans * CELLS) <= NEAR

    def ends(self, number: int) -> Iterator[BifurcationPoint | StickingEnd]:
        """Yield the bifurcations at which the motions on either side of an edge end before reaching the other side."""
        edge = self.edges[number]
        for inside, beyond in ((edge.low, edge.high), (edge.high, edge.low)):
            if inside in self._followed_cells:
                end, lasts = self._end(edge.along, inside, beyond)
                if end is not None:
                    yield end
                elif lasts:
                    self.lasting.add(number)

    def __post_init__(self) -> None:
        from scipy.ndimage import label  # slow import (0.17 s), not needed by verdicts

        least, many = LEAST * len(self.names), Counter(self.names.values()).most_common()
        forgets = self.model.at().forgets
        followed = [name for name, number in many if number > least and _can_end(name, forgets)]
        cells = {cell for cell, name in self.names.items() if name in followed}
        # Tongues of sticking with ever longer cycles accumulate, and their ends are slow to follow.
        for name in (name for name in followed if name[0] == MotionClass.STICKING):
            places = np.zeros((CELLS, CELLS), dtype=bool)
            places[tuple(zip(*(cell for cell in cells if self.names[cell] == name), strict=True))] = True
            regions = label(places)[0]
            small = np.flatnonzero(np.bincount(regions.ravel()) <= least)
            cells -= set(map(tuple, np.argwhere(places & np.isin(regions, small)).tolist()))
        self._followed_cells = cells
        self.followed = [name for name in followed if any(self.names[cell] == name for cell in cells)]

    def _end(self, along: int, inside: Cell, beyond: Cell) -> tuple[BifurcationPoint | StickingEnd | None, bool]:
        """Return the end of a cell's motion on the way to another cell, and whether the motion still exists there."""
        kind, n, p = self.names[inside]
        parameter, model = self.plane.names[along], self.model_at(inside)
        values = self._centre(inside)[along], self._centre(beyond)[along]
        if kind == MotionClass.NO_IMPACT:
            return _touch(model, parameter, values)
        if kind == MotionClass.STICKING:
            end = end_of_sticking(model, parameter, values, longest=n)
            return (end, False) if end.found and end.n_periods == n else (None, end.outcome == "no_change")
        orbit = _orbit_of(model, n, p)
        return (None, False) if orbit is None else _end_of_orbit(orbit, parameter, values)


def coverage(model: Model, plane: Plane, report: Report) -> Coverage:
    """Return the coarse map of a plane, without curves; `report` may stop the computation by returning False."""
    centres: dict[str, Any] = {
        name: low + (np.arange(CELLS) + 0.5) / CELLS * (high - low)
        for name, (low, high) in zip(plane.names, plane.box, strict=True)
    }
    sweep = parameter_map(
        model,
        indices=NAMING,
        transient_impacts=WINDOW.transient,
        sample_impacts=WINDOW.keep,
        progress=report,
        **centres,
    )
    motions = classify(sweep).transpose(*plane.names)
    columns = [motions[name].values.tolist() for name in ("motion", "n_periods", "n_impacts")]
    names = {(i, j): tuple(column[i][j] for column in columns) for i, j in product(range(CELLS), repeat=2)}
    edges = [
        CellEdge(along, (i, j), other)
        for along in (0, 1)
        for i, j in names
        if (other := (i + 1 - along, j + along)) in names and names[i, j] != names[other]
    ]
    return Coverage(model, plane, motions, names, edges, np.zeros(len(edges), dtype=bool))


def distances(points: Floats, curve: Floats) -> Floats:
    """Return the distance of each point, rows (x, y, ...), from a curve through rows of points."""
    first, chords = (curve[:-1], np.diff(curve, axis=0)) if len(curve) > 1 else (curve, 0.0 * curve)
    length = (chords * chords).sum(axis=1)
    length[length == 0.0] = 1.0
    share = np.clip(((points[:, None] - first) * chords).sum(axis=2) / length, 0.0, 1.0)
    return np.asarray(np.linalg.norm(points[:, None] - first - share[..., None] * chords, axis=2).min(axis=1))


def _can_end(name: Name, forgets: bool) -> bool:
    """Whether the end of a motion can be followed as a curve.

    The end of a motion with rests, or without impacts, only if an impact determines the whole state (one mass).
    """
    kind, n, p = name
    if kind == MotionClass.STICKING:
        return forgets and n > 0 and p == -1
    return (kind == MotionClass.PERIODIC and p > 0) or (kind == MotionClass.NO_IMPACT and forgets)


def _orbit_of(model: Model, n: int, p: int) -> Orbit | None:
    """Return the cycle to which the motion from rest settles; None if it is not a stable one of that type."""
    window = ImpactWindow(WINDOW.transient + WINDOW.keep - p, p)
    search = search_of(model)
    (samples,) = get_backend("cpu").samples(search.design.cells({}), Measurement(window))
    return settled_orbit(search, n, samples, slice(0, p)) if len(samples.impact_phase) == p else None


def _end_of_orbit(orbit: Orbit, parameter: str, values: tuple[float, float]) -> tuple[BifurcationPoint | None, bool]:
    """Return the first bifurcation of a stable orbit between two values, and whether the orbit exists at the second."""
    begin, end = values
    equations, z = equations_of(orbit, (parameter,), ((min(values), max(values)),))
    for way in walk(equations, equations.pack(z), STRIDE, False, 1.0 if end > begin else -1.0):
        if way.special:
            return way.special[0].bifurcation(parameter), False
    return None, way.end == "range" and abs(way.points[-1].value - end) < abs(end - begin) / 2


def _touch(model: Model, parameter: str, values: tuple[float, float]) -> tuple[BifurcationPoint | None, bool]:
    """Return the value at which the impact-free motion first touches the stop, and whether it is clear at the end."""
    from scipy.optimize import brentq  # slow import, too

    def clearance(value: float) -> float:
        osc = model.at(**{parameter: value})
        return float(osc.gap - osc.steady_amplitude)

    first, last = map(clearance, values)
    if not (math.isfinite(first) and math.isfinite(last)) or first <= 0.0 or last > 0.0:
        return None, first > 0.0 and last > 0.0
    touching = model.replace(**{parameter: float(brentq(clearance, *values, xtol=1e-300, rtol=1e-15))})
    osc = touching.at()
    steady = osc.steady_state
    turns = math.atan2(steady.velocity / osc.omega, steady.displacement) / (2.0 * math.pi)
    orbit = make_orbit(touching, Cycle(1, 1), np.array([turns % 1.0, 0.0]))
    return BifurcationPoint("grazing", parameter, orbit.value(parameter), orbit), False
