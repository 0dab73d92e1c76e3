"""Names, units, symbols and provenance of every result."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.indices import INDICES
from vibroimpact.oscillator import ImpactOscillator, Model
from vibroimpact.parameters import Parameter
from vibroimpact.status import Status

# name: (long name, unit, symbol)
VARIABLES: dict[str, tuple[str, str, str]] = {
    **{name: (entry.long_name, entry.unit, entry.symbol) for name, entry in ImpactOscillator.parameters.items()},
    "time": ("time", "s", "t"),
    "phase": ("phase of the driving period", "1", "psi/T"),
    "displacement": ("displacement", "m", "y"),
    "velocity": ("velocity", "m/s", "y'"),
    "impact_time": ("time of impact", "s", "t"),
    "impact_velocity": ("impact velocity", "m/s", "I"),
    "stick_time": ("time at which the mass comes to rest at the stop", "s", "t"),
    "release_time": ("time at which the mass leaves the stop", "s", "t"),
    "count": ("number of samples kept", "1", "N"),
} | {index.name: (index.long_name, index.units, index.symbol) for index in INDICES.values()}

SYMBOLS = {entry.symbol: name for name, entry in ImpactOscillator.parameters.items() if not entry.replaces}


def label(parameter: Parameter) -> dict[str, str]:
    """Return the attributes of an axis that varies a parameter."""
    return {"long_name": parameter.long_name, "units": parameter.unit, "symbol": parameter.symbol or parameter.name}


def variable(name: str, dims: str | Sequence[str], data: Any, **attrs: Any) -> xr.Variable:
    """Return `data` labelled with the long name, unit and symbol that the name stands for."""
    long_name, units, symbol = VARIABLES[name]
    return plain_variable(dims, data, {"long_name": long_name, "units": units, "symbol": symbol, **attrs})


def plain_variable(dims: str | Sequence[str], data: Any, attrs: dict[str, Any]) -> xr.Variable:
    """Return an array of numbers with its attributes."""
    # Without `fastpath`, xarray asks whether the array is one of Dask's, and imports Dask for that.
    return xr.Variable(dims, np.asarray(data), attrs, fastpath=True)


def missing(index: str, shape: int | tuple[int, ...]) -> NDArray[Any]:
    """Return an array of an index that has no value yet anywhere."""
    return np.full(shape, INDICES[index].fill, INDICES[index].dtype)


def impact_speed(dims: str | Sequence[str], data: Any) -> xr.Variable:
    """Return impact velocities under the name `velocity`, labelled as speeds just before contact."""
    return variable("velocity", dims, data, long_name="impact velocity", symbol="I")


def status_variable(dims: str | Sequence[str], codes: Any) -> xr.Variable:
    """Return status codes with their CF flag values and meanings."""
    return plain_variable(
        dims,
        np.asarray(codes, dtype=np.int8),
        {
            "long_name": "how the motion ended",
            "flag_values": np.array([status.value for status in Status], dtype=np.int8),
            "flag_meanings": " ".join(status.word for status in Status),
        },
    )


def level_variable(dims: str | Sequence[str], levels: Any) -> xr.Variable:
    """Return levels of refinement with their meaning."""
    meaning = "level of refinement at which a cell was computed, -1 where it was filled in"
    return plain_variable(dims, levels, {"long_name": meaning, "units": "1", "symbol": "level"})


def stick_times(seconds: Callable[[Any, Any], Any], seen: Any) -> dict[str, xr.Variable]:
    """Return when the mass came to rest at the stop and when it left, from a back end's samples."""
    return {
        "stick_time": variable("stick_time", "stick", seconds(seen.stick_periods, seen.stick_phase)),
        "release_time": variable("release_time", "stick", seconds(seen.release_periods, seen.release_phase)),
    }


@cache
def package_version() -> str:
    """Return the installed version of vibroimpact."""
    try:
        return version("vibroimpact")
    except PackageNotFoundError:
        return "unknown"


def provenance(function: str, model: Model, arguments: Mapping[str, Any]) -> dict[str, str]:
    """Return attributes that say which call, on which model, by which version made a result.

    Of a family they hold its own parameters (`model`) and the oscillator that these make.
    """
    osc = model.at()
    family = {} if model is osc else {"model": json.dumps({"family": str(model), **model.values})}
    return {
        "source": f"vibroimpact {package_version()}",
        "function": function,
        **family,
        "oscillator": json.dumps(asdict(osc)),
        "arguments": json.dumps(dict(arguments), default=str),
    }


def oscillator_of(dataset: xr.Dataset) -> ImpactOscillator:
    """Return the oscillator a result was made from (axes of a sweep stand at their reference value)."""
    return ImpactOscillator(**json.loads(dataset.attrs["oscillator"]))
