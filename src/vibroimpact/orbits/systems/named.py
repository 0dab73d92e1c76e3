"""The orbits of a system by the name of their cycle: n periods, p impacts, on whichever stops."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from vibroimpact.backends import ImpactWindow, Measurement, get_backend
from vibroimpact.model import Model, State
from vibroimpact.motion import cycle_name
from vibroimpact.orbits.orbit import SAME, same_orbit
from vibroimpact.orbits.search import Orbits
from vibroimpact.orbits.systems.orbit import SystemOrbit
from vibroimpact.orbits.systems.search import find, ordered, struck_from
from vibroimpact.orbits.systems.sticking import find_sticking
from vibroimpact.orbits.systems.symmetry import mirror
from vibroimpact.parameters import invalid
from vibroimpact.recognition import cycle_length

# Impacts of the motion from rest before those that Newton's method starts from: the second, as in verdicts, where the
# first end in no cycle yet.
TRANSIENTS = 2000, 1 << 15
LOOK = 128  # impacts in which a cycle of up to half as many is recognised


def find_named(model: Model, n_periods: int, n_impacts: int, near: Any) -> Orbits[SystemOrbit]:
    """Return the orbits of a system that `find_orbit` finds.

    All those of one impact, and of two that are mirror images of one another; others, and one that rests, from `near`,
    or where the motion from rest has settled to one.
    """
    if near is not None and not isinstance(near, (SystemOrbit, State)):
        raise invalid("near", near, "an orbit or an attractor of a system, or a State")
    if n_impacts == -1:
        return find_sticking(model, n_periods, near)
    if isinstance(near, SystemOrbit) and len(near.stops) != n_impacts:
        raise invalid("near", near.name, f"an orbit of {n_impacts} impacts", f"or give n_impacts={len(near.stops)}")
    if n_impacts == 1:
        return _with_near(find(model, n_periods=n_periods), model, n_periods, near)
    if near is not None:
        return _from_near(model, n_periods, n_impacts, near)
    found: list[SystemOrbit] = []
    if n_impacts == 2 and n_periods % 2 and not mirror(model.at())[1]:
        found += find(model, n_periods=n_periods, symmetric=True)
    found += [
        orbit for orbit in settled(model, n_periods, n_impacts) if not any(same_orbit(orbit, known) for known in found)
    ]
    found = found or [orbit for orbit in find_sticking(model, n_periods, None) if orbit.n_impacts == n_impacts]
    if found:
        return ordered(found)
    name = cycle_name(n_periods, n_impacts)
    tried = f"does not settle to a {name} orbit within {TRANSIENTS[-1]} impacts"
    return Orbits(outcome="none", message=f"the motion from rest {tried}; give `near`")


def _from_near(model: Model, n_periods: int, n_impacts: int, near: SystemOrbit | State) -> Orbits[SystemOrbit]:
    """Return the orbit that Newton's method reaches from another, or from the motion from a state."""
    if isinstance(near, SystemOrbit):
        return find(model, n_periods=n_periods, near=near)
    stops = struck_from(model.at(), n_periods, n_impacts, near)
    if stops is None:
        message = f"the motion from there does not come near a {cycle_name(n_periods, n_impacts)} orbit at once"
        return Orbits(outcome="not_converged", message=f"{message}; begin nearer to one")
    return find(model, n_periods=n_periods, stops=stops, near=near)


def _with_near(
    orbits: Orbits[SystemOrbit], model: Model, n_periods: int, near: SystemOrbit | State | None
) -> Orbits[SystemOrbit]:
    """Return orbits, and the one near a guess if it is none of them."""
    stops = model.at().stops
    if near is None or not any(stop.compliant for stop in stops) or (isinstance(near, SystemOrbit) and near.sticks):
        return orbits
    more = [one for one in _from_near(model, n_periods, 1, near) if not any(same_orbit(one, each) for each in orbits)]
    return ordered([*orbits, *more]) if more else orbits


def settled(model: Model, n_periods: int, n_impacts: int, transients: Sequence[int] = TRANSIENTS) -> list[SystemOrbit]:
    """Return the orbit that the motion from rest has settled to, if it has that name."""
    system = model.at()
    seen: Any
    for transient in transients:
        window = ImpactWindow(transient, n_impacts * math.ceil(LOOK / n_impacts) + 1)  # it ends as the transient does
        (seen,) = get_backend("cpu").samples(system.cells({}), Measurement(window))
        turns = (seen.impact_periods + seen.impact_phase)[-n_impacts - 1 :]
        if len(turns) <= n_impacts:
            break
        if abs(turns[-1] - turns[0] - n_periods) <= SAME * n_periods:
            stops = [system.stop_names[at] for at in seen.impact_stop[-n_impacts - 1 : -1]]
            times = (turns[:-1] * system.period).tolist()
            if found := find_near(model, n_periods, stops, times, ended(system, seen)):
                return list(found)
        elif cycle_length(seen.impact_velocity, seen.impact_phase):  # of another name
            break
    return []


def ended(system: Any, seen: Any) -> State:
    """Return the state in which a sampled motion ended."""
    return State(seen.last_displacement, seen.last_velocity, seen.last_phase * system.period)


def find_near(
    model: Model, n_periods: int, stops: Sequence[str], times: Sequence[float], state: State
) -> Orbits[SystemOrbit]:
    """Return the orbit that a motion has settled to, by the times of its impacts, or by a state where contacts last."""
    near = state if any(stop.compliant for stop in model.at().stops if stop.name in stops) else times
    try:
        return find(model, n_periods=n_periods, stops=stops, near=near)
    except ValueError:  # the motion does not repeat these impacts
        return Orbits(outcome="none", message="the motion does not repeat these impacts")
