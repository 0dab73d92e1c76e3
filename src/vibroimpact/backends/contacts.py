"""What a contact with a compliant stop comes to within a part of a motion, by quadrature of exact states."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial import legendre

from vibroimpact.backends.effects import FIT, NODES, Rests, States, panels_over, parts_of
from vibroimpact.cells import Floats
from vibroimpact.model.elements import NO_CONTACT, Contact

if TYPE_CHECKING:
    from vibroimpact.model.system import ImpactSystem


def contact_within(
    system: ImpactSystem,
    samples: Any,
    last: float,
    states: States,
    stop: int,
    span: tuple[float, float],
    since: float,
) -> tuple[Contact, bool, bool]:
    """Return the part within a span of a contact that began at `since`, in s, and how it ends.

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
        return NO_CONTACT, over, pushes
    forces, (depths, rates) = panels.forces[..., stop], panels.depth(stop)
    (peak, force), (deepest, depth) = (_largest(values @ FIT.T, panels.ends) for values in (forces, depths))
    exit_time, peak, deepest = (turns * system.period - since for turns in (panels.ends[-1, 1], peak, deepest))
    time = system.period * float(np.diff(panels.ends).sum())
    extremes, lost = (time, force, depth), panels.integral(forces * rates)
    speed = -float(legendre.legval(1.0, FIT @ rates[-1]))
    return Contact(panels.integral(forces), *extremes, lost, speed, exit_time, peak, deepest), over, pushes


def _largest(series: Floats, ends: Floats) -> tuple[float, float]:
    """Return the place of the maximum of a function over successive panels, and the maximum."""
    places = np.concatenate([[-1.0], NODES, [1.0]])
    sampled = legendre.legval(places, series.T)
    near, node = divmod(int(sampled.argmax()), len(places))
    most, panel, place = float(sampled[near, node]), near, places[node]
    for at in range(max(near - 1, 0), min(near + 2, len(series))):
        turning = legendre.legroots(legendre.legder(series[at]))
        for x in turning.real[(abs(turning.imag) < 1e-6) & (abs(turning.real) <= 1.0)].tolist():
            value = float(legendre.legval(x, series[at]))
            if value > most:
                most, panel, place = value, at, x
    begin, end = ends[panel].tolist()
    return begin + 0.5 * (1.0 + place) * (end - begin), most
