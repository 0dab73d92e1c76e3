"""How contacts go: when and how fast each one ends, and when its force and its penetration are largest."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.polynomial import legendre

from vibroimpact.backends.effects import (
    FIT,
    MOST,
    NODES,
    Rates,
    Rests,
    States,
    angles_of,
    nodes_of,
    panels_over,
    parts_of,
)
from vibroimpact.cells import Floats
from vibroimpact.model.balance import depth_of, law_of
from vibroimpact.model.elements import Contact

if TYPE_CHECKING:
    from vibroimpact.model.system import ImpactSystem

HALVINGS = 40  # of the bracket of a largest value
ENDS = 1e-6  # of the largest force: what is left of it where it has ended


def courses_of(system: ImpactSystem, samples: Any, states: States) -> dict[str, Floats]:
    """Return the end of each contact in driving periods, the speed of separation there in m/s, and its largest values.

    An impact on a rigid stop ends when it begins. With a compliant stop a contact ends where its force has fallen to
    zero; the times of its largest force and penetration are in driving periods, too. Those are NaN for rigid stops, and
    all are for a contact that is not over, or in which the force ends and begins again. One mass needs none of them.
    """
    if not hasattr(samples, "impact_impulse"):
        return {}
    begins = samples.impact_periods + samples.impact_phase
    soft = np.array([not stop.element.instantaneous for stop in system.stops], bool)[samples.impact_stop]
    with np.errstate(divide="ignore", invalid="ignore"):
        after = samples.impact_velocity - 2.0 * samples.impact_energy / samples.impact_impulse
    found = {name: np.full(len(begins), np.nan) for name in ("exit", "exit_velocity", "peak", "deepest")}
    found["exit"][~soft], found["exit_velocity"][~soft] = begins[~soft], after[~soft]
    rows = np.flatnonzero(soft & np.isfinite(samples.impact_duration))
    ends = begins + samples.impact_duration / system.period
    parts, owners = _parts(begins, ends, rows, samples)
    panels, which = _panels(system, parts, _pushing(system, parts, rows, begins, ends, samples))
    if not 0 < len(panels) <= MOST:
        return found
    owners = owners[which]
    turns = nodes_of(panels)
    times, place = np.unique(turns, return_inverse=True)
    q, v = (part[place.ravel()].reshape(*turns.shape, -1) for part in states(times))
    for at in np.unique(samples.impact_stop[rows]):
        stop, own = system.stops[at], samples.impact_stop[owners] == at
        depth, rate = depth_of(stop, system.omega, q[own], v[own], angles_of(turns[own]))
        force = law_of(stop, depth, rate)
        of, spans = owners[own], panels[own]
        last = np.flatnonzero(np.diff(of, append=-1))
        contacts = of[last]
        found["exit"][contacts] = ends[contacts]
        found["exit_velocity"][contacts] = -_at(1.0, rate[last] @ FIT.T)
        for name, values in (("peak", force), ("deepest", depth)):
            found[name][contacts], most = largest(values @ FIT.T, spans, last)
            if name == "peak":
                unclear = contacts[np.abs(_at(1.0, force[last] @ FIT.T)) > ENDS * most]
        for values in found.values():
            values[unclear] = np.nan
    return found


class Course(NamedTuple):
    """How a contact goes: its end, speed of separation (m/s) and times of the largest force and penetration.

    Times are in s or in driving periods.
    """

    exit: float = math.nan
    exit_velocity: float = math.nan
    peak: float = math.nan
    deepest: float = math.nan


def contact_within(
    system: ImpactSystem, samples: Any, last: float, states: States, stop: int, span: tuple[float, float]
) -> tuple[Contact, Course, bool, bool]:
    """Return what a contact with a compliant stop comes to within a span, how it goes in s, and how that ends.

    It ends with the contact over or not, and if not, with the stop pushing or not. The stop is touched or pressed in
    where the span, in driving periods, begins.
    """
    rests = Rests(samples, last)
    panels = panels_over(system, parts_of([span], system, samples, rests), rests, states)
    depths, _ = panels.depth(stop)
    free: Any = np.flatnonzero(depths.mean(axis=1) < 0.0)
    panels = panels[: free[0] if len(free) else None]
    pushing: Any = panels.forces[..., stop].any(axis=1)
    over, pushes = len(free) > 0, not len(free) and bool(pushing[-1:].any())
    panels = panels[pushing]
    if not len(panels.ends):
        return Contact(*[0.0] * len(Contact._fields)), Course(), over, pushes
    forces, (depths, rates), run = panels.forces[..., stop], panels.depth(stop), np.array([len(panels.ends) - 1])
    (peak,), (force,) = largest(forces @ FIT.T, panels.ends, run)
    (deepest,), (depth,) = largest(depths @ FIT.T, panels.ends, run)
    time = system.period * float(np.diff(panels.ends).sum())
    taken = Contact(panels.integral(forces), time, float(force), float(depth), panels.integral(forces * rates))
    speed = -float(_at(1.0, rates[-1:] @ FIT.T)[0])
    return (
        taken,
        Course(panels.ends[-1, 1] * system.period, speed, peak * system.period, deepest * system.period),
        over,
        pushes,
    )


def _parts(begins: Floats, ends: Floats, rows: Any, samples: Any) -> tuple[Floats, Any]:
    """Return the parts without events of contacts, and the row of the contact that each one belongs to."""
    rests = samples.rest_begin.sum(axis=1), samples.rest_end.sum(axis=1)
    edges = np.unique(np.concatenate([begins, ends[np.isfinite(ends)], *rests]))
    first, last = np.searchsorted(edges, begins[rows]), np.searchsorted(edges, ends[rows])
    number = last - first
    at = np.arange(number.sum()) + np.repeat(first - np.cumsum(number) + number, number)
    return np.column_stack([edges[at], edges[at + 1]]), np.repeat(rows, number)


def _pushing(system: ImpactSystem, parts: Floats, rows: Any, begins: Floats, ends: Floats, samples: Any) -> Any:
    """Return which stops push in each part: one row per part."""
    pushing, middles = np.zeros((len(parts), len(system.stops)), bool), parts.mean(axis=1)
    for at in np.unique(samples.impact_stop[rows]):
        own = rows[samples.impact_stop[rows] == at]
        pushing[:, at] = np.searchsorted(begins[own], middles) > np.searchsorted(ends[own], middles)
    return pushing


def _panels(system: ImpactSystem, parts: Floats, pushing: Any) -> tuple[Floats, Any]:
    """Return the panels of parts, and the number of the part that each one belongs to."""
    rates, (sets, which) = Rates(system), np.unique(pushing, axis=0, return_inverse=True)
    fastest = np.array([rates[tuple(np.flatnonzero(each).tolist())] for each in sets])
    lengths = parts[:, 1] - parts[:, 0]
    number = np.ceil(lengths * fastest[which.ravel()]).astype(np.int64) if len(parts) else np.zeros(0, np.int64)
    if number.sum() > MOST:
        return np.zeros((0, 2)), np.zeros(0, np.int64)
    of = np.repeat(np.arange(len(parts)), number)
    at = np.arange(len(of)) - np.repeat(np.cumsum(number) - number, number)
    steps = (lengths / np.maximum(number, 1))[of]
    begins = parts[of, 0] + at * steps
    return np.column_stack([begins, begins + steps]), of


def _at(places: Any, series: Any) -> Any:
    """Return the values of series at one place in [-1, 1] each."""
    return legendre.legval(np.broadcast_to(places, len(series)), series.T, tensor=False)


def largest(series: Floats, spans: Floats, last: Any) -> tuple[Any, Any]:
    """Return where a function is largest, and that value, over runs of panels that end with those `last`."""
    places = np.concatenate([[-1.0], NODES, [1.0]])
    sampled = series @ legendre.legvander(places, series.shape[1] - 1).T
    firsts = np.append(0, last[:-1] + 1)
    most = np.maximum.reduceat(sampled.max(axis=1), firsts)
    number = np.repeat(np.arange(len(last)), last - firsts + 1)
    panel, node = np.nonzero(sampled == most[number][:, None])
    _, chosen = np.unique(number[panel], return_index=True)
    panel, node = panel[chosen], node[chosen]
    top, slopes = len(places) - 1, legendre.legder(series, axis=1)
    # It may be just beyond the end of a panel, in the next one.
    on = ((node == top) & (panel < last) & (_at(1.0, slopes[panel]) > 0.0)).astype(int)
    on -= (node == 0) & (panel > firsts) & (_at(-1.0, slopes[panel]) < 0.0)
    panel, node = panel + on, np.where(on > 0, 0, np.where(on < 0, top, node))
    low, high = places[np.maximum(node - 1, 0)], places[np.minimum(node + 1, top)]
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        up = _at(middle, slopes[panel]) > 0.0
        low, high = np.where(up, middle, low), np.where(up, high, middle)
    middle = 0.5 * (low + high)
    values = _at(middle, series[panel])
    middle = np.where(values < most, np.where(on == 0, middle, places[node]), middle)
    begin, end = spans[panel].T
    return begin + 0.5 * (1.0 + middle) * (end - begin), np.maximum(values, most)
