"""Periodic orbits as a labelled dataset and as plain JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from vibroimpact.continuation.results import number, orbit_variables
from vibroimpact.dataset import provenance

if TYPE_CHECKING:
    from vibroimpact.orbits import Orbits
    from vibroimpact.oscillator import Model

WORDS = {"real": "real part of a Floquet multiplier", "imag": "imaginary part of a Floquet multiplier"}


def orbits_dataset(found: Orbits, model: Model, arguments: Mapping[str, Any]) -> xr.Dataset:
    """Return orbits over `orbit` and `impact`, rows padded with NaN; `count` is the number of impacts."""
    multipliers = np.array([orbit.multipliers for orbit in found], complex).reshape(len(found), 2)
    content = orbit_variables(found, max((len(orbit.velocities) for orbit in found), default=0), "orbit")
    for i in (0, 1):
        parts = {"real": multipliers[:, i].real, "imag": multipliers[:, i].imag}
        content |= {f"multiplier_{i + 1}_{key}": number("orbit", part, WORDS[key]) for key, part in parts.items()}
    content |= {
        "n_periods": _whole([orbit.n_periods for orbit in found], "driving periods per cycle"),
        "n_impacts": _whole([orbit.n_impacts for orbit in found], "impacts per cycle"),
        "count": _whole([len(orbit.velocities) for orbit in found], "number of impacts listed"),
        "stick_phase": number("orbit", [orbit.stick_phase for orbit in found], "phase of coming to rest at the stop"),
        "release_phase": number("orbit", [orbit.release_phase for orbit in found], "phase of leaving the stop"),
        "stuck_time": number("orbit", [orbit.stuck_time for orbit in found], "time at rest per cycle"),
    }
    content["stuck_time"].attrs["units"] = "s"
    outcome = {"outcome": found.outcome, "message": _sentence(found)}
    outcome["messages"] = json.dumps([orbit.message for orbit in found])
    return xr.Dataset(content, attrs=provenance("find_orbit", model, arguments) | outcome)


def orbits_json(found: Orbits, model: Model) -> dict[str, Any]:
    """Return orbits as plain dictionaries, lists, numbers and text: NaN as None, multipliers as pairs."""
    return {
        "oscillator": asdict(model.at()),
        "outcome": found.outcome,
        "message": _sentence(found),
        "orbits": [_plain(orbit) for orbit in found],
    }


def _plain(orbit: Any) -> dict[str, Any]:
    content = {key: value for key, value in vars(orbit).items() if key not in ("oscillator", "family")}
    content["multipliers"] = [[z.real, z.imag] for z in orbit.multipliers]
    content |= {key: getattr(orbit, key) for key in ("name", "stable", "trace", "determinant")}
    return {key: None if isinstance(value, float) and math.isnan(value) else value for key, value in content.items()}


def _sentence(found: Orbits) -> str:
    if found.outcome == "inadmissible":
        return f"no admissible {found[0].name} orbit: the equations have {len(found)}"
    return found.message or f"{len(found)} {found[0].name} orbit{'s' * (len(found) > 1)}"


def _whole(values: list[int], long_name: str) -> xr.Variable:
    return xr.Variable("orbit", np.array(values, np.int32), {"long_name": long_name, "units": "1"})
