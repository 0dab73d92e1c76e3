"""What stops take over parts of a motion: impulses, energies and largest values, by quadrature of exact states.

A part is divided where stops are struck, close or open and where the force of a compliant stop begins or ends, and then
into panels of at most 1 rad of the fastest rate. On each of them forces are as smooth as a sine, and the 12 nodes of
Gauss and Legendre integrate and interpolate them to 1e-14 of their size.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from vibroimpact.cells import Floats
from vibroimpact.matrices import block_matrix
from vibroimpact.model.balance import depth_of, law_of, stop_forces

if TYPE_CHECKING:
    from vibroimpact.model.system import ImpactSystem

NODES, WEIGHTS = legendre.leggauss(12)
FIT = np.linalg.inv(legendre.legvander(NODES, len(NODES) - 1))  # the series through values at the nodes
LONGEST = 1.0  # rad of the fastest rate per panel
EDGE = 1e-9  # of a panel: a force that begins or ends so near its end does so at its end
INSIDE = legendre.legvander(np.concatenate([[EDGE - 1.0], NODES, [1.0 - EDGE]]), len(NODES) - 1)
SHORT = 1e-13  # driving periods: shorter parts are rounding
MOST = 20_000  # rad of the fastest rate per part: what takes longer is NaN
ROUNDS = 8  # of dividing panels; the error of such a place is about squared in each

States = Callable[[Floats], tuple[Floats, Floats]]  # coordinates and velocities, one row per time in driving periods


class Rests:
    """The rests of a motion at its stops between two times; times are in driving periods."""

    def __init__(self, samples: Any, last: float, first: float = -math.inf) -> None:
        self.stops = samples.rest_stop
        ends = samples.rest_end.sum(axis=1)
        self.begins = np.maximum(samples.rest_begin.sum(axis=1), first)
        self.ends = np.minimum(np.where(np.isnan(ends), last, ends), last)

    def closed(self, turns: Floats, stops: int) -> NDArray[np.bool_]:
        """Return whether each of so many stops is closed, one row per time; times ascend."""
        closed = np.zeros((len(turns), stops), bool)
        rows = np.searchsorted(turns, [self.begins, self.ends]).T.tolist()
        for stop, (first, last) in zip(self.stops.tolist(), rows, strict=True):
            closed[first:last, stop] = True
        return closed


def forces_at(system: ImpactSystem, rests: Rests, turns: Floats, q: Floats, v: Floats) -> Floats:
    """Return the forces of all stops in N in the states at ascending times in driving periods, one row per time."""
    closed, angles = rests.closed(turns, len(system.stops)), angles_of(turns)
    if all(stop.element.instantaneous for stop in system.stops):
        forces = np.zeros(closed.shape)
    else:
        forces = stop_forces(system, q, v, angles)
    resting = np.flatnonzero(closed.any(axis=1))
    sets, which = np.unique(np.packbits(closed[resting], axis=1), axis=0, return_inverse=True)
    for number in range(len(sets)):
        rows = resting[which.ravel() == number]
        forces[rows] = stop_forces(system, q[rows], v[rows], angles[rows], np.flatnonzero(closed[rows[0]]).tolist())
    return forces


def angles_of(turns: Floats) -> Floats:
    """Return the driving angles at times in driving periods."""
    angles: Floats = 2.0 * np.pi * (turns - np.floor(turns))
    return angles


@dataclass(frozen=True)
class Panels:
    """Parts of a motion: their ends in driving periods; states and forces at their nodes, (panels, nodes, ...)."""

    system: ImpactSystem
    ends: Floats
    q: Floats
    v: Floats
    forces: Floats

    def __getitem__(self, which: Any) -> Panels:
        return Panels(self.system, self.ends[which], self.q[which], self.v[which], self.forces[which])

    def between(self, begin: float, end: float) -> Panels:
        """Return the panels between two times in driving periods."""
        return self[slice(*np.searchsorted(self.ends.mean(axis=1), [begin, end]))]

    def integral(self, values: Floats) -> float:
        """Return the integral of values at the nodes over time in s."""
        return float((0.5 * self.system.period * np.diff(self.ends) * WEIGHTS * values).sum())

    def depth(self, stop: int) -> tuple[Floats, Floats]:
        """Return the penetration of a stop in m at the nodes, and its rate in m/s."""
        angles = angles_of(nodes_of(self.ends))
        return depth_of(self.system.stops[stop], self.system.omega, self.q, self.v, angles)

    def velocity(self, at: int, end: float) -> Any:
        """Return the velocity at the beginning (-1) or at the end (1) of a panel, before the event there."""
        return legendre.legval(end, FIT @ self.v[at])

    @cached_property
    def _levels(self) -> dict[int, tuple[Floats, Floats]]:
        """The series of the penetration of each compliant stop and of k d + c d', whose zeros bound its force."""
        levels = {}
        for at, stop in enumerate(self.system.stops):
            if not stop.element.instantaneous:
                depth, rate = self.depth(at)
                levels[at] = depth @ FIT.T, law_of(stop, depth, rate) @ FIT.T
        return levels

    def divides(self, rates: Rates) -> NDArray[np.bool_]:
        """Return which panels may have to be divided."""
        pushing = np.array([self.forces[..., stop].any(axis=1) for stop in self._levels], bool).reshape(
            -1, len(self.ends)
        )
        sets, which = np.unique(pushing, axis=1, return_inverse=True)
        stops = np.array([*self._levels], int)
        fastest = np.array([rates[tuple(stops[each].tolist())] for each in sets.T])[which.ravel()]
        divides: NDArray[np.bool_] = np.diff(self.ends)[:, 0] * fastest > LONGEST * (1.0 + EDGE)
        for series in (each for pair in self._levels.values() for each in pair):
            divides |= (np.diff(np.sign(series @ INSIDE.T)) != 0.0).any(axis=1)
        return divides

    def cuts(self, at: int, rates: Rates) -> list[float]:
        """Return the places at which a panel must be divided, in fractions of it."""
        pushing = tuple(stop for stop in self._levels if self.forces[at, :, stop].any())
        places = rates.places(self.ends[at], pushing)
        for depths, pushes in self._levels.values():
            roots = [root for root in _roots(pushes[at]) if legendre.legval(root, depths[at]) > 0.0]
            places += [0.5 * (1.0 + root) for root in [*roots, *_roots(depths[at])]]
        return sorted(places)


def nodes_of(ends: Floats) -> Floats:
    """Return the nodes of panels in driving periods, one row each."""
    nodes: Floats = ends.mean(axis=1)[:, None] + 0.5 * np.diff(ends) * NODES
    return nodes


def _roots(series: Floats) -> list[float]:
    """Return the places within (-1, 1), one between two nodes, where a series changes its sign."""
    from scipy.optimize import brentq  # slow import

    def value(x: Any) -> Any:
        return legendre.legval(x, series)

    places = np.concatenate([[EDGE - 1.0], NODES, [1.0 - EDGE]])
    signs = np.sign(value(places))
    return [brentq(value, *pair) for pair in np.column_stack([places[:-1], places[1:]])[signs[:-1] * signs[1:] < 0.0]]


def orders_of(system: ImpactSystem) -> list[int]:
    """Return the orders of the harmonics of load and stops, ascending."""
    return sorted({*system.force.harmonics, *(order for stop in system.stops for order in stop.motion)})


class Rates(dict[tuple[int, ...], float]):
    """The fastest rate in rad per driving period while some stops push."""

    def __init__(self, system: ImpactSystem) -> None:
        self.system, self.too_long = system, False

    def __missing__(self, pushing: tuple[int, ...]) -> float:
        system, n = self.system, self.system.coordinates
        stiffness, damping = system.stiffness, system.damping
        for stop in (system.stops[at] for at in pushing):
            (k, c), along = stop.element.coefficients, np.outer(stop.direction, stop.direction)
            stiffness, damping = stiffness + k * along, damping + c * along
        acting: Any = np.linalg.solve(system.mass, np.hstack([-stiffness, -damping]))
        companion = block_matrix(np.zeros((n, n)), np.eye(n), acting[:, :n], acting[:, n:])
        highest = max(orders_of(system), default=0)
        fastest = max(np.abs(np.linalg.eigvals(companion)).max(), system.omega * highest)
        self[pushing] = float(system.period * fastest)
        return self[pushing]

    def places(self, ends: Floats, pushing: tuple[int, ...] = ()) -> list[float]:
        """Return the places at which a panel must be divided, in fractions of it."""
        number = math.ceil(float(ends[1] - ends[0]) * self[pushing] / LONGEST - EDGE)
        if number * LONGEST > MOST:
            number, self.too_long = 1, True
        return [at / number for at in range(1, number)]


def _divided(ends: Floats, cuts: list[list[float]]) -> Floats:
    """Return the ends of the parts of panels that are divided at fractions of them."""
    parts: list[tuple[float, float]] = []
    for (begin, end), places in zip(ends, cuts, strict=True):
        parts += pairwise([begin, *(begin + (end - begin) * place for place in places), end])
    return np.array(parts).reshape(-1, 2)


def parts_of(spans: Any, system: ImpactSystem, samples: Any, rests: Rests) -> Floats:
    """Return the ends of the parts without events of spans of a motion, in driving periods, ascending."""
    impacts = samples.impact_turns
    over = impacts + np.nan_to_num(samples.contacts.exit_time) / system.period
    bounds = np.sort(np.reshape(spans, (-1, 2)), axis=0).T

    def within(times: Floats) -> NDArray[np.bool_]:
        begun, ended = (np.searchsorted(ends, times) for ends in bounds)
        inside: NDArray[np.bool_] = begun > ended
        return inside

    events = np.concatenate([impacts, over, rests.begins, rests.ends])
    edges = np.unique(np.concatenate([events[within(events)], np.ravel(spans)]))
    parts: Floats = np.column_stack([edges[:-1], edges[1:]])
    kept: Floats = parts[within(parts.mean(axis=1)) & (parts[:, 1] - parts[:, 0] > SHORT)]
    return kept


def panels_over(system: ImpactSystem, parts: Floats, rests: Rests, states: States) -> Panels:
    """Return the panels of parts of a motion without events but for those of the forces of compliant stops."""
    rates, done = Rates(system), []
    ends = _divided(parts, [rates.places(each) for each in parts])
    for left in reversed(range(ROUNDS)):
        turns = nodes_of(ends)
        q, v = states(turns.ravel()) if len(ends) else np.zeros((2, 0, system.coordinates))
        forces = forces_at(system, rests, turns.ravel(), q, v)
        panels = Panels(system, ends, *(part.reshape(*turns.shape, part.shape[-1]) for part in (q, v, forces)))
        divides = panels.divides(rates) & (left > 0) if len(ends) else ()
        cuts = [panels.cuts(at, rates) if each else [] for at, each in enumerate(divides)]
        whole = np.array([not places for places in cuts], bool)
        done.append(panels[whole])
        ends = _divided(ends[~whole], [places for places in cuts if places])
        if not len(ends):
            break
    names = "ends", "q", "v", "forces"
    ends, *values = (np.concatenate([getattr(each, name) for each in done]) for name in names)
    order = np.argsort(ends[:, 0])
    return Panels(system, ends[order], *(np.nan * each if rates.too_long else each[order] for each in values))
