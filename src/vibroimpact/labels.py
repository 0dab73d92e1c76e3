"""What motions are labelled with: times, impacts and rests, and the coordinates and stops where these have names."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from vibroimpact.dataset import dataset_of, impact_speed, plain_variable, status_variable, variable
from vibroimpact.model.elements import REPORTS, Element

if TYPE_CHECKING:
    import xarray as xr

    from vibroimpact.model.system import ImpactSystem

Seconds = Callable[[Any, Any], Any]  # of whole driving periods and phases


def in_seconds(osc: Any) -> Seconds:
    """Return the function that makes seconds of a model's driving periods and phases."""
    period = osc.period
    return lambda periods, phase: (periods + phase) * period


def trajectory_of(seen: Any, seconds: Seconds, model: Any) -> dict[str, xr.Variable]:
    """Return the variables of `simulate` but its status: coordinates and clearances over time, impacts and rests."""
    dims, impact_times = ("time", "coordinate")[: seen.look_displacement.ndim], (seen.impact_periods, seen.impact_phase)
    motion = {
        "time": variable("time", "time", seconds(seen.look_periods, seen.look_phase)),
        "displacement": variable("displacement", dims, seen.look_displacement),
        "velocity": variable("velocity", dims, seen.look_velocity),
    }
    impacts = {
        "impact_time": variable("impact_time", "impact", seconds(*impact_times)),
        "impact_velocity": variable("impact_velocity", "impact", seen.impact_velocity),
    }
    if _is_plain(seen):
        return motion | impacts | _rests(model, seen, seconds)
    stops = {
        "clearance": variable("clearance", ("time", "stop"), _clearances(model, seen)),
        **_forces(model, seen),
        "stop": plain_variable("stop", np.array(model.stop_names, str), {"long_name": "stop"}),
    }
    contacts = {
        "impact_stop": _stops(model, "impact", seen.impact_stop, "stop that is struck"),
        **_contacts(model, seen),
    }
    return motion | stops | impacts | contacts | _rests(model, seen, seconds)


def labelled_impacts(seen: Any, seconds: Seconds, attrs: dict[str, str], model: Any) -> xr.Dataset:
    """Return the impacts that a window saw, as `impact_section` does: when, at which phase, which stop and how hard."""
    found = {
        "time": variable("time", "impact", seconds(seen.impact_periods, seen.impact_phase)),
        "phase": variable("phase", "impact", seen.impact_phase),
        "velocity": impact_speed("impact", seen.impact_velocity),
    }
    if not _is_plain(seen):
        several = {"long_name": "whether other stops are struck at the same instant"}
        found |= {
            **_contacts(model, seen),
            "stop": _stops(model, "impact", seen.impact_stop, "stop that is struck"),
            "simultaneous": plain_variable("impact", seen.impact_simultaneous, several),
        }
    status = {"status": status_variable((), seen.status)}
    return dataset_of(found | _rests(model, seen, seconds) | status, attrs=attrs)


def _is_plain(seen: Any) -> bool:
    """Return whether displacements are numbers, of one mass with one stop, neither of which needs a name."""
    return bool(np.ndim(seen.look_displacement) == 1)


def _contacts(system: ImpactSystem, seen: Any) -> dict[str, Any]:
    """Return what is reported of every contact, by whatever kinds of stops there are."""
    names = dict.fromkeys([*Element.reports, *(name for stop in system.stops for name in stop.element.reports)])
    return {name: variable(name, "impact", getattr(seen, REPORTS[name].field)) for name in names}


def _rests(model: Any, seen: Any, seconds: Seconds) -> dict[str, Any]:
    found = {
        "stick_time": variable("stick_time", "stick", seconds(*seen.rest_begin.T)),
        "release_time": variable("release_time", "stick", seconds(*seen.rest_end.T)),
    }
    if _is_plain(seen):
        return found
    return found | {"stick_stop": _stops(model, "stick", seen.rest_stop, "stop that is closed")}


def _stops(system: ImpactSystem, dim: str, numbers: Any, long_name: str) -> Any:
    names = np.array(system.stop_names or [""], str)
    return plain_variable(dim, names[numbers], {"long_name": long_name})


def _forces(system: ImpactSystem, seen: Any) -> dict[str, Any]:
    """Return the forces of all stops at the looks, NaN of those whose impacts take no time."""
    if all(stop.element.instantaneous for stop in system.stops):
        return {}
    found, angle, clearances = [], 2.0 * np.pi * seen.look_phase, _clearances(system, seen)
    for stop, clearance in zip(system.stops, clearances.T, strict=True):
        rate = seen.look_velocity @ stop.direction - stop.speed(angle, system.omega)
        found.append(stop.element.force(-clearance, rate))
    return {"force": variable("force", ("time", "stop"), np.column_stack(found))}


def _clearances(system: ImpactSystem, seen: Any) -> Any:
    """Return the clearances of all stops at the looks; rounding beyond a stop is contact."""
    angle = 2.0 * np.pi * seen.look_phase
    found = np.empty((len(angle), len(system.stops)))
    for at, stop in enumerate(system.stops):
        found[:, at] = stop.gap + stop.shift(angle) - seen.look_displacement @ stop.direction
    return np.where((found < 0.0) & (found > -1e-12 * np.abs(seen.look_displacement).max(initial=1e-300)), 0.0, found)
