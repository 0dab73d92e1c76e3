"""Labels of motions: times, impacts and rests, and the names of coordinates and stops."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from vibroimpact.backends.base import taken_by
from vibroimpact.backends.effects import Rests, forces_at
from vibroimpact.cells import Floats
from vibroimpact.dataset import dataset_of, impact_speed, plain_variable, status_variable, variable
from vibroimpact.model import as_system
from vibroimpact.model.balance import clearances
from vibroimpact.model.elements import REPORTS, Element, reports_of

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
    u = clearances(model, samples.look_displacement, 2.0 * np.pi * samples.look_phase)
    stops = {
        "clearance": variable("clearance", ("time", "stop"), u),
        "stop": plain_variable("stop", np.array(model.stop_names, str), {"long_name": "stop"}),
    }
    contacts = {
        "impact_stop": _stops(model, "impact", samples.impact_stop, "stop that is struck"),
        **_contacts(model, samples),
    }
    return motion | stops | impacts | contacts | _rests(model, samples)


def taken_by_stops(samples: Any, model: Any, impulses: Floats) -> dict[str, xr.Variable]:
    """Return what stops take: forces over time, and the impulses of rests, which are given.

    The force of a rigid stop is that of a rest, and zero otherwise: an impact on it has an impulse but no force.
    """
    system, turns = as_system(model), samples.look_periods + samples.look_phase
    shape, rests = (len(turns), system.coordinates), Rests(samples, math.inf)
    q, v = samples.look_displacement.reshape(shape), samples.look_velocity.reshape(shape)
    forces = forces_at(system, rests, turns, q, v)
    taken = {"stick_impulse": variable("stick_impulse", "stick", impulses)}
    if _is_plain(samples):
        speeds = samples.impact_velocity
        return taken | {"force": variable("force", "time", forces[:, 0])} | impulses_of(model, speeds)
    return taken | {"force": variable("force", ("time", "stop"), forces)}


def impulses_of(oscillator: Any, speeds: Floats) -> dict[str, xr.Variable]:
    """Return what is reported for impacts of one mass on its stop, at speeds in m/s."""
    columns = zip(Element.reports, taken_by(oscillator.mass, oscillator.restitution, speeds), strict=True)
    return {name: variable(name, "impact", column) for name, column in columns}


def labelled_impacts(samples: Any, model: Any, attrs: dict[str, str], impulses: Floats | None = None) -> xr.Dataset:
    """Return the impacts in a window, as `impact_section` does: times, phases, stops, velocities and effects.

    `impulses` are those of the rests.
    """
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
    else:
        columns |= impulses_of(model, samples.impact_velocity)
    taken = {} if impulses is None else {"stick_impulse": variable("stick_impulse", "stick", impulses)}
    status = {"status": status_variable((), samples.status)}
    return dataset_of(columns | _rests(model, samples) | taken | status, attrs=attrs)


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
    begins, columns = in_seconds(system, samples.impact_periods, samples.impact_phase), {}
    for name in reports_of(system.stops):
        values = getattr(samples, REPORTS[name].field)
        columns[name] = variable(name, "impact", begins + values if REPORTS[name].since else values)
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
