"""Labels of motions: times, impacts and rests, and the names of coordinates and stops; results in the units to show."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from vibroimpact.backends.base import taken_by
from vibroimpact.backends.effects import Rests, forces_at
from vibroimpact.cells import Floats
from vibroimpact.dataset import dataset_of, impact_speed, plain_variable, status_variable, variable
from vibroimpact.model import as_system
from vibroimpact.model.balance import clearances
from vibroimpact.model.elements import REPORTS, Element, reports_of
from vibroimpact.model.units import DISPLAY, display, displayed_text

if TYPE_CHECKING:
    import xarray as xr

    from vibroimpact.model.system import ImpactSystem

# What only a model of several stops has, and the axes that one mass at one stop does not need.
NAMED = {"stop", "clearance", "impact_stop", "stick_stop", "simultaneous"}
ALONE = {"coordinate", "stop"}


def in_seconds(model: Any, periods: Any, phase: Any) -> Any:
    """Return times in s from whole driving periods and phases."""
    return (periods + phase) * model.period


def trajectory_of(samples: Any, design: Any) -> dict[str, xr.Variable]:
    """Return the variables of `simulate` except its status: coordinates and clearances over time, impacts and rests."""
    system, along = as_system(design), ("time", "coordinate")
    impact_time = in_seconds(design, samples.impact_periods, samples.impact_phase)
    u = clearances(system, samples.look_displacement, 2.0 * np.pi * samples.look_phase)
    variables = {
        "time": variable("time", "time", in_seconds(design, samples.look_periods, samples.look_phase)),
        "displacement": variable("displacement", along, samples.look_displacement),
        "velocity": variable("velocity", along, samples.look_velocity),
        "clearance": variable("clearance", ("time", "stop"), u),
        "stop": plain_variable("stop", np.array(system.stop_names, str), {"long_name": "stop"}),
        "impact_time": variable("impact_time", "impact", impact_time),
        "impact_velocity": variable("impact_velocity", "impact", samples.impact_velocity),
        "impact_stop": _stops(system, "impact", samples.impact_stop, "stop that is struck"),
    }
    return of_one_mass(variables | _contacts(system, samples) | _rests(system, samples), design)


def taken_by_stops(samples: Any, design: Any, impulses: Floats) -> dict[str, xr.Variable]:
    """Return the forces of stops over time, and the impulses of rests, which are given.

    The force of a rigid stop is that of a rest, and zero otherwise: an impact on it has an impulse but no force.
    """
    turns = samples.look_turns
    rests, motion = Rests(samples, math.inf), (samples.look_displacement, samples.look_velocity)
    taken = {
        "stick_impulse": variable("stick_impulse", "stick", impulses),
        "force": variable("force", ("time", "stop"), forces_at(as_system(design), rests, turns, *motion)),
    }
    return of_one_mass(taken, design)


def impulses_of(oscillator: Any, speeds: Floats) -> dict[str, xr.Variable]:
    """Return the quantities reported for impacts of one mass on its stop, at speeds in m/s."""
    taken = taken_by(oscillator.mass, oscillator.restitution, speeds)
    return {name: variable(name, "impact", getattr(taken, name)) for name in Element.reports}


def labelled_impacts(samples: Any, design: Any, attrs: dict[str, str], impulses: Floats | None = None) -> xr.Dataset:
    """Return the impacts in a window, as `impact_section` does: times, phases, stops, velocities and effects.

    `impulses` are those of the rests.
    """
    system = as_system(design)
    several = {"long_name": "whether other stops are struck at the same instant"}
    columns = {
        "time": variable("time", "impact", in_seconds(design, samples.impact_periods, samples.impact_phase)),
        "phase": phase_variable("impact", samples.impact_phase, design),
        "velocity": impact_speed("impact", samples.impact_velocity),
        **_contacts(system, samples),
        "stop": _stops(system, "impact", samples.impact_stop, "stop that is struck"),
        "simultaneous": plain_variable("impact", samples.impact_simultaneous, several),
        **_rests(system, samples),
        **({} if impulses is None else {"stick_impulse": variable("stick_impulse", "stick", impulses)}),
        "status": status_variable((), samples.status),
    }
    return dataset_of(of_one_mass(columns, design), attrs=attrs)


def of_one_mass(variables: dict[str, Any], design: Any) -> dict[str, Any]:
    """Return the variables of a motion of one mass at one stop without axes and names of these two.

    Such a design has plain numbers as its initial condition; the variables of all others are returned as they are.
    """
    if np.ndim(design.rest.displacement):
        return variables
    alone = {name: dict.fromkeys(ALONE & {*each.dims}, 0) for name, each in variables.items() if name not in NAMED}
    return {name: variables[name].isel(dims) if dims else variables[name] for name, dims in alone.items()}


def phase_variable(dims: Any, phases: Any, model: Any) -> xr.Variable:
    """Return phases of the driving period; NaN for a model without one."""
    if model.periodic:
        return variable("phase", dims, phases)
    reason = "a phase is a fraction of the driving period, which the model lacks"
    return variable("phase", dims, np.full(np.shape(phases), np.nan), no_value=reason)


def _contacts(system: ImpactSystem, samples: Any) -> dict[str, Any]:
    """Return the quantities that stops of these kinds report for every contact."""
    begins, columns = in_seconds(system, samples.impact_periods, samples.impact_phase), {}
    for name in reports_of(system.stops):
        values = getattr(samples.contacts, name)
        columns[name] = variable(name, "impact", begins + values if REPORTS[name].since else values)
    angles = [math.nan if stop.angle is None else stop.angle for stop in system.stops]
    if np.isfinite(angles).any():
        columns["angle"] = variable("angle", "impact", np.array(angles)[samples.impact_stop])
    return columns


def _rests(system: ImpactSystem, samples: Any) -> dict[str, Any]:
    return {
        "stick_time": variable("stick_time", "stick", in_seconds(system, *samples.rest_begin.T)),
        "release_time": variable("release_time", "stick", in_seconds(system, *samples.rest_end.T)),
        "stick_stop": _stops(system, "stick", samples.rest_stop, "stop that is closed"),
    }


def _stops(system: ImpactSystem, dim: str, numbers: Any, long_name: str) -> Any:
    names = np.array(system.stop_names or [""], str)
    return plain_variable(dim, names[numbers], {"long_name": long_name})


# Units in which parameters are shown


def with_display(dataset: xr.Dataset, units: Mapping[str, str]) -> xr.Dataset:
    """Return a result whose parameters along axes, branches and curves are written and drawn in these units."""
    for name, unit in units.items():
        standard = dataset[name].attrs.get("units") if name in dataset.coords else None
        if standard is None or unit == standard:
            continue
        of_name = [name, *({"special_value"} & set(map(str, dataset.variables)))]
        dataset = dataset.assign({key: _relabelled(dataset[key], 1.0, {DISPLAY: unit}) for key in of_name})
    return dataset


def displayed(dataset: xr.Dataset) -> xr.Dataset:
    """Return a result with parameters, and the messages that contain their values, in the units to show."""
    for key in [str(key) for key, column in dataset.variables.items() if DISPLAY in column.attrs]:
        attrs = dataset[key].attrs
        messages = {name: text for name, text in dataset.attrs.items() if "message" in name and isinstance(text, str)}
        messages = {name: displayed_text(text, key, attrs) for name, text in messages.items()}
        dataset = dataset.assign({key: _relabelled(dataset[key], *display(attrs))}).assign_attrs(messages)
    return dataset


def _relabelled(column: xr.DataArray, factor: float, labels: dict[str, Any]) -> xr.Variable:
    """Return an array times a factor, with some labels replaced."""
    attrs = {name: value for name, value in column.attrs.items() if name != DISPLAY} | labels
    return plain_variable(
        tuple(map(str, column.dims)), column.values * factor if factor != 1.0 else column.values, attrs
    )
