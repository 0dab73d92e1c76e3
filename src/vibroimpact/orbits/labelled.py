"""Orbits as labelled datasets."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from vibroimpact.dataset import dataset_of, flags, impact_speed, plain_variable, provenance, variable
from vibroimpact.model import Model
from vibroimpact.model.elements import REPORTS, reports_of
from vibroimpact.orbits.results import Orbits

if TYPE_CHECKING:
    import xarray as xr


def orbits_dataset(orbits: Orbits, model: Model, arguments: Mapping[str, Any]) -> xr.Dataset:
    """Return orbits over `orbit` and `impact`, rows padded with NaN; `count` is the number of impacts."""
    counts = [len(orbit.velocities) for orbit in orbits]
    content = orbit_variables(orbits, max(counts, default=0), "orbit")
    parts = {"real": "real part of a Floquet multiplier", "imag": "imaginary part of a Floquet multiplier"}
    several = not model.at().says_all
    for part, text in parts.items():
        rows = [[getattr(complex(value), part) for value in orbit.multipliers] for orbit in orbits]
        width = 2 * np.size(model.at().mass, 0) if several else 2
        table = rows_of(rows, max(map(len, rows), default=width))
        if several:
            content[f"multiplier_{part}"] = number(("orbit", "multiplier"), table, text)
        else:
            content |= {f"multiplier_{i}_{part}": number("orbit", column, text) for i, column in enumerate(table.T, 1)}
    whole = {
        "n_periods": ([orbit.n_periods for orbit in orbits], "driving periods per cycle"),
        "n_impacts": ([orbit.n_impacts for orbit in orbits], "impacts per cycle"),
        "count": (counts, "number of impacts listed"),
    }
    for key, (kept, long_name) in whole.items():
        content[key] = plain_variable("orbit", np.array(kept, np.int32), {"long_name": long_name, "units": "1"})
    outcome = {"outcome": orbits.outcome, "message": orbits.sentence}
    outcome["messages"] = json.dumps([orbit.message for orbit in orbits])
    real = {
        "stick_phase": "phase of coming to rest at the stop",
        "release_phase": "phase of leaving the stop",
        "stuck_time": "time at rest per cycle",
    }
    content |= {key: number("orbit", [getattr(orbit, key) for orbit in orbits], text) for key, text in real.items()}
    content["stuck_time"].attrs["units"] = "s"
    content |= _struck(orbits, max(counts, default=0), model.at())
    return dataset_of(content, attrs=provenance("find_orbit", model, arguments) | outcome)


def _struck(orbits: Orbits, p: int, design: Any) -> dict[str, xr.Variable]:
    """Return the effects of impacts, and the times and stops of those of a system."""
    dims, begins = ("orbit", "impact"), [np.multiply(orbit.turns, orbit.oscillator.period) for orbit in orbits]

    def column(name: str) -> xr.Variable:
        rows = [np.array([getattr(contact, name) for contact in orbit.contacts]) for orbit in orbits]
        if REPORTS[name].since:
            rows = [begin + row for begin, row in zip(begins, rows, strict=True)]
        return variable(name, dims, rows_of(rows, p))

    columns = {name: column(name) for name in reports_of(design.stops)}
    if design.says_all:
        return columns
    names = np.full((len(orbits), p), "", dtype=object)
    for at, orbit in enumerate(orbits):
        names[at, : len(orbit.stops)] = orbit.stops
    stops = plain_variable(dims, names.astype(str), {"long_name": "stop that is struck"})
    return columns | {"time": variable("time", dims, rows_of(begins, p)), "stop": stops}


def orbit_variables(orbits: Sequence[Any], p: int, dim: str) -> dict[str, xr.Variable]:
    """Return velocities, phases, stability and admissibility of orbits as variables."""
    return {
        "velocity": impact_speed((dim, "impact"), rows_of([orbit.velocities for orbit in orbits], p)),
        "phase": variable("phase", (dim, "impact"), rows_of([orbit.phases for orbit in orbits], p)),
        "stable": flags(dim, [orbit.stable for orbit in orbits], "whether the orbit is stable", ("unstable", "stable")),
        "admissible": flags(
            dim, [q.admissible for q in orbits], "whether the orbit is admissible", ("inadmissible", "admissible")
        ),
    }


def number(dims: Any, data: Any, long_name: str) -> xr.Variable:
    """Return plain numbers, labelled."""
    return plain_variable(dims, np.asarray(data, dtype=np.float64), {"long_name": long_name, "units": "1"})


def rows_of(rows: Sequence[Any], width: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return rows of one width, padded with NaN."""
    table = np.full((len(rows), width), np.nan)
    for i, row in enumerate(rows):
        table[i, : len(row)] = row
    return table
