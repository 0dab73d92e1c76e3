"""What motions are labelled with: times, impacts and rests; for systems coordinates and stops, too."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from vibroimpact.backends.base import Samples, SystemSamples
from vibroimpact.dataset import dataset_of, impact_speed, plain_variable, status_variable, stick_times, variable
from vibroimpact.elements import REPORTS, Element

if TYPE_CHECKING:
    import xarray as xr

    from vibroimpact.system import ImpactSystem

Seconds = Callable[[Any, Any], Any]  # of whole driving periods and phases


def in_seconds(osc: Any) -> Seconds:
    """Return the function that makes seconds of a model's driving periods and phases."""
    period = osc.period
    return lambda periods, phase: (periods + phase) * period


def trajectory_of(seen: Samples | SystemSamples, seconds: Seconds, model: Any) -> dict[str, xr.Variable]:
    """Return the variables of `simulate` but its status."""
    if isinstance(seen, SystemSamples):
        return _trajectory_of_system(model, seen, seconds)
    return {
        "time": variable("time", "time", seconds(seen.look_periods, seen.look_phase)),
        "displacement": variable("displacement", "time", seen.look_displacement),
        "velocity": variable("velocity", "time", seen.look_velocity),
        "impact_time": variable("impact_time", "impact", seconds(seen.impact_periods, seen.impact_phase)),
        "impact_velocity": variable("impact_velocity", "impact", seen.impact_velocity),
        **stick_times(seconds, seen),
    }


def labelled_impacts(seen: Samples | SystemSamples, seconds: Seconds, attrs: dict[str, str], model: Any) -> xr.Dataset:
    """Return the impacts that a window saw, labelled as `impact_section` returns them."""
    if isinstance(seen, SystemSamples):
        return dataset_of(_impacts_of_system(model, seen, seconds), attrs=attrs)
    return dataset_of(
        {
            "time": variable("time", "impact", seconds(seen.impact_periods, seen.impact_phase)),
            "phase": variable("phase", "impact", seen.impact_phase),
            "velocity": impact_speed("impact", seen.impact_velocity),
            **stick_times(seconds, seen),
            "status": status_variable((), seen.status),
        },
        attrs=attrs,
    )


def _trajectory_of_system(system: ImpactSystem, seen: SystemSamples, seconds: Seconds) -> dict[str, Any]:
    """Return the variables of `simulate`: coordinates and clearances over time, impacts and rests."""
    found = {
        "time": variable("time", "time", seconds(seen.look_periods, seen.look_phase)),
        "displacement": variable("displacement", ("time", "coordinate"), seen.look_displacement),
        "velocity": variable("velocity", ("time", "coordinate"), seen.look_velocity),
        "clearance": variable("clearance", ("time", "stop"), _clearances(system, seen)),
        **_forces(system, seen),
        "stop": plain_variable("stop", np.array(system.stop_names, str), {"long_name": "stop"}),
        "impact_time": variable("impact_time", "impact", seconds(seen.impact_periods, seen.impact_phase)),
        "impact_velocity": variable("impact_velocity", "impact", seen.impact_velocity),
        "impact_stop": _stops(system, "impact", seen.impact_stop, "stop that is struck"),
        **_contacts(system, seen),
    }
    return found | _rests(system, seen, seconds)


def _impacts_of_system(system: ImpactSystem, seen: SystemSamples, seconds: Seconds) -> dict[str, Any]:
    """Return the variables of `impact_section`: when, at which phase, which stop and how hard."""
    several = {"long_name": "whether other stops are struck at the same instant"}
    return {
        "time": variable("time", "impact", seconds(seen.impact_periods, seen.impact_phase)),
        "phase": variable("phase", "impact", seen.impact_phase),
        "velocity": impact_speed("impact", seen.impact_velocity),
        **_contacts(system, seen),
        "stop": _stops(system, "impact", seen.impact_stop, "stop that is struck"),
        "simultaneous": plain_variable("impact", seen.impact_simultaneous, several),
        **_rests(system, seen, seconds),
        "status": status_variable((), seen.status),
    }


def _contacts(system: ImpactSystem, seen: SystemSamples) -> dict[str, Any]:
    """Return what is reported of every contact, by whatever kinds of stops there are."""
    names = dict.fromkeys([*Element.reports, *(name for stop in system.stops for name in stop.element.reports)])
    return {name: variable(name, "impact", getattr(seen, REPORTS[name].field)) for name in names}


def _rests(system: ImpactSystem, seen: SystemSamples, seconds: Seconds) -> dict[str, Any]:
    return {
        "stick_time": variable("stick_time", "stick", seconds(*seen.rest_begin.T)),
        "release_time": variable("release_time", "stick", seconds(*seen.rest_end.T)),
        "stick_stop": _stops(system, "stick", seen.rest_stop, "stop that is closed"),
    }


def _stops(system: ImpactSystem, dim: str, numbers: Any, long_name: str) -> Any:
    names = np.array(system.stop_names or [""], str)
    return plain_variable(dim, names[numbers], {"long_name": long_name})


def _forces(system: ImpactSystem, seen: SystemSamples) -> dict[str, Any]:
    """Return the forces of all stops at the looks, NaN of those whose impacts take no time."""
    if all(stop.element.instantaneous for stop in system.stops):
        return {}
    found, angle, clearances = [], 2.0 * np.pi * seen.look_phase, _clearances(system, seen)
    for stop, clearance in zip(system.stops, clearances.T, strict=True):
        rate = seen.look_velocity @ stop.direction - stop.speed(angle, system.omega)
        found.append(stop.element.force(-clearance, rate))
    return {"force": variable("force", ("time", "stop"), np.column_stack(found))}


def _clearances(system: ImpactSystem, seen: SystemSamples) -> Any:
    """Return the clearances of all stops at the looks; rounding beyond a stop is contact."""
    angle = 2.0 * np.pi * seen.look_phase
    found = np.empty((len(angle), len(system.stops)))
    for at, stop in enumerate(system.stops):
        found[:, at] = stop.gap + stop.shift(angle) - seen.look_displacement @ stop.direction
    return np.where((found < 0.0) & (found > -1e-12 * np.abs(seen.look_displacement).max(initial=1e-300)), 0.0, found)
