"""Labels of motions: times, impacts and rests, and the names of coordinates and stops."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from vibroimpact.cells import BEYOND
from vibroimpact.dataset import dataset_of, impact_speed, plain_variable, status_variable, variable
from vibroimpact.model.elements import REPORTS, Element

if TYPE_CHECKING:
    import xarray as xr

    from vibroimpact.model.system import ImpactSystem


def in_seconds(model: Any, periods: Any, phase: Any) -> Any:
    """Return times in s from whole driving periods and phases."""
    return (periods + phase) * model.period


def trajectory_of(samples: Any, model: Any) -> dict[str, xr.Variable]:
    """Return the variables of `simulate` except its status: coordinates and clearances over time, impacts and rests."""
    dims = ("time", "coordinate")[: samples.look_displacement.ndim]
    motion = {
        "time": variable("time", "time", in_seconds(model, samples.look_periods, samples.look_phase)),
        "displacement": variable("displacement", dims, samples.look_displacement),
        "velocity": variable("velocity", dims, samples.look_velocity),
    }
    impacts = {
        "impact_time": variable(
            "impact_time", "impact", in_seconds(model, samples.impact_periods, samples.impact_phase)
        ),
        "impact_velocity": variable("impact_velocity", "impact", samples.impact_velocity),
    }
    if _is_plain(samples):
        return motion | impacts | _rests(model, samples)
    clearances = _clearances(model, samples)
    stops = {
        "clearance": variable("clearance", ("time", "stop"), clearances),
        **_forces(model, samples, clearances),
        "stop": plain_variable("stop", np.array(model.stop_names, str), {"long_name": "stop"}),
    }
    contacts = {
        "impact_stop": _stops(model, "impact", samples.impact_stop, "stop that is struck"),
        **_contacts(model, samples),
    }
    return motion | stops | impacts | contacts | _rests(model, samples)


def labelled_impacts(samples: Any, model: Any, attrs: dict[str, str]) -> xr.Dataset:
    """Return the impacts in a window, as `impact_section` does: their times, phases, stops and velocities."""
    columns = {
        "time": variable("time", "impact", in_seconds(model, samples.impact_periods, samples.impact_phase)),
        "phase": phase_variable("impact", samples.impact_phase, model),
        "velocity": impact_speed("impact", samples.impact_velocity),
    }
    if not _is_plain(samples):
        several = {"long_name": "whether other stops are struck at the same instant"}
        columns |= {
            **_contacts(model, samples),
            "stop": _stops(model, "impact", samples.impact_stop, "stop that is struck"),
            "simultaneous": plain_variable("impact", samples.impact_simultaneous, several),
        }
    status = {"status": status_variable((), samples.status)}
    return dataset_of(columns | _rests(model, samples) | status, attrs=attrs)


def phase_variable(dims: Any, phases: Any, model: Any) -> xr.Variable:
    """Return phases of the driving period; NaN for a model without one."""
    if model.periodic:
        return variable("phase", dims, phases)
    reason = "a phase is a fraction of the driving period, which the model lacks"
    return variable("phase", dims, np.full(np.shape(phases), np.nan), no_value=reason)


def _is_plain(samples: Any) -> bool:
    """Return whether displacements are plain numbers: one mass with one stop, neither of which needs a name."""
    return bool(np.ndim(samples.look_displacement) == 1)


def _contacts(system: ImpactSystem, samples: Any) -> dict[str, Any]:
    """Return the quantities that stops of these kinds report for every contact."""
    names = dict.fromkeys([*Element.reports, *(name for stop in system.stops for name in stop.element.reports)])
    columns = {name: variable(name, "impact", getattr(samples, REPORTS[name].field)) for name in names}
    angles = [math.nan if stop.angle is None else stop.angle for stop in system.stops]
    if np.isfinite(angles).any():
        columns["angle"] = variable("angle", "impact", np.array(angles)[samples.impact_stop])
    return columns


def _rests(model: Any, samples: Any) -> dict[str, Any]:
    times = {
        "stick_time": variable("stick_time", "stick", in_seconds(model, *samples.rest_begin.T)),
        "release_time": variable("release_time", "stick", in_seconds(model, *samples.rest_end.T)),
    }
    if _is_plain(samples):
        return times
    return times | {"stick_stop": _stops(model, "stick", samples.rest_stop, "stop that is closed")}


def _stops(system: ImpactSystem, dim: str, numbers: Any, long_name: str) -> Any:
    names = np.array(system.stop_names or [""], str)
    return plain_variable(dim, names[numbers], {"long_name": long_name})


def _forces(system: ImpactSystem, samples: Any, clearances: Any) -> dict[str, Any]:
    """Return the forces of all stops at the sampled times; NaN for stops whose impacts take no time."""
    if all(stop.element.instantaneous for stop in system.stops):
        return {}
    forces, angle = [], 2.0 * np.pi * samples.look_phase
    for stop, clearance in zip(system.stops, clearances.T, strict=True):
        rate = samples.look_velocity @ stop.direction - stop.speed(angle, system.omega)
        forces.append(stop.element.force(-clearance, rate))
    return {"force": variable("force", ("time", "stop"), np.column_stack(forces))}


def _clearances(system: ImpactSystem, samples: Any) -> Any:
    """Return the clearances of all stops at the sampled times; a penetration of rounding size is contact."""
    angle = 2.0 * np.pi * samples.look_phase
    clearances = np.empty((len(angle), len(system.stops)))
    for at, stop in enumerate(system.stops):
        clearances[:, at] = stop.gap + stop.shift(angle) - samples.look_displacement @ stop.direction
    rounding = BEYOND * np.abs(samples.look_displacement).max(initial=1e-300)
    return np.where((clearances < 0.0) & (clearances > -rounding), 0.0, clearances)
