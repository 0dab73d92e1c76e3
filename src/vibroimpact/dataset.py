"""Names, units, symbols and provenance of results; several curves or branches in one dataset, and back."""

from __future__ import annotations

import ast
import json
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.cells import FASTEST
from vibroimpact.indices import EVERY
from vibroimpact.model import Model, State
from vibroimpact.model.elements import REPORTS
from vibroimpact.model.force import Force
from vibroimpact.model.oscillator import ImpactOscillator
from vibroimpact.model.stops import Stop
from vibroimpact.model.system import ImpactSystem
from vibroimpact.model.units import DISPLAY
from vibroimpact.parameters import Parameter
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr


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
    "stick_impulse": ("impulse that the stop takes in the rest", "N s", "P"),
    "count": ("number of samples kept", "1", "N"),
    "clearance": ("clearance to the stop", "m", "u"),
    "force": ("force of the stop", "N", "F"),
    "angle": ("angle of the facet that is struck", "deg", "theta"),
    **{name: (report.long_name, report.unit, report.symbol) for name, report in REPORTS.items()},
    "impacts": ("impacts", "1", "N"),
    "bursts": ("bursts of impacts, each of impacts within the rest time", "1", "N_b"),
    "rate": ("impacts per second", "1/s", "N/T"),
    "rms_velocity": ("rms impact velocity", "m/s", "rms I"),
    "mean_impulse": ("mean impulse of an impact", "N s", "<P>"),
    "max_impulse": ("largest impulse of an impact", "N s", "max P"),
    "power": ("energy lost at the stop per unit time", "W", "W"),
    "rest_fraction": ("time at rest at the stop over total time", "1", "T_r/T"),
    "rest_force": ("impulses of rests per unit time", "N", "<F_r>"),
    "mean_peak_force": ("mean of the largest forces of contacts", "N", "<F>"),
    "mean_contact_time": ("mean duration of a contact", "s", "<t_c>"),
    "contact_fraction": ("time in contact over total time", "1", "T_c/T"),
    "max_penetration": ("deepest penetration", "m", "max d"),
    "number": ("impacts in a class of velocities", "1", "N"),
}
# `amplitude` stays that of the driving force; variables of indices have the labels of their indices.
VARIABLES |= {
    name: (index.long_name, index.units, index.symbol) for name, index in EVERY.items() if name not in VARIABLES
}


def label(parameter: Parameter) -> dict[str, str]:
    """Return the attributes of an axis that varies a parameter."""
    return {"long_name": parameter.long_name, "units": parameter.unit, "symbol": parameter.symbol or parameter.name}


def bifurcation_name(kind: str) -> str:
    """Return the words for a kind of special point or boundary.

    Examples
    --------
    >>> bifurcation_name("period_doubling"), bifurcation_name("neimark_sacker")
    ('period doubling', 'Neimark-Sacker point')
    """
    return "Neimark-Sacker point" if kind == "neimark_sacker" else kind.replace("_", " ")


def variable(name: str, dims: str | Sequence[str], data: Any, **attrs: Any) -> xr.Variable:
    """Return `data` labelled with the long name, unit and symbol of this name."""
    long_name, units, symbol = VARIABLES[name]
    return plain_variable(dims, data, {"long_name": long_name, "units": units, "symbol": symbol, **attrs})


def plain_variable(dims: str | Sequence[str], data: Any, attrs: dict[str, Any]) -> xr.Variable:
    """Return an array of numbers with its attributes."""
    import xarray as xr  # takes a third of a second, which verdicts do not need

    # Without `fastpath`, xarray imports Dask to check whether the array is one of Dask's.
    return xr.Variable(dims, np.asarray(data), attrs, fastpath=True)


def dataset_of(variables: Mapping[str, Any] | None = None, coords: Any = None, attrs: Any = None) -> xr.Dataset:
    """Return labelled variables as one dataset."""
    import xarray as xr
    from pandas import Index

    def indexed(name: str, column: Any) -> Any:
        """Return an axis of numbers as xarray stores it; xarray itself would import Dask and pint to check its type."""
        if not isinstance(column, xr.Variable) or column.dims != (name,) or column.dtype.kind not in "iuf":
            return column
        return xr.IndexVariable(name, Index(column.values), column.attrs, fastpath=True)

    return xr.Dataset(variables, {name: indexed(name, column) for name, column in dict(coords or {}).items()}, attrs)


def missing(index: str, shape: int | tuple[int, ...]) -> NDArray[Any]:
    """Return an array of missing values of an index."""
    return np.full(shape, EVERY[index].fill, EVERY[index].dtype)


def impact_speed(dims: str | Sequence[str], data: Any, **attrs: Any) -> xr.Variable:
    """Return impact velocities under the name `velocity`, labelled as speeds just before contact."""
    return variable("velocity", dims, data, long_name="impact velocity", symbol="I", **attrs)


def flags(
    dims: Any, codes: Any, long_name: str, meanings: Iterable[str], first: int = 0, dtype: Any = np.int8
) -> xr.Variable:
    """Return small whole numbers, counted from `first`, with their CF flag values and meanings."""
    words = [meaning.replace(" ", "_") for meaning in meanings]
    values = np.arange(first, first + len(words), dtype=dtype)
    attrs = {"long_name": long_name, "flag_values": values, "flag_meanings": " ".join(words)}
    return plain_variable(dims, np.asarray(codes, dtype=dtype), attrs)


def flag_meanings(codes: xr.DataArray | xr.Variable) -> list[str]:
    """Return the words for the numbers that `flags` labels."""
    return str(codes.attrs["flag_meanings"]).split()


def status_variable(dims: str | Sequence[str], codes: Any) -> xr.Variable:
    """Return status codes with their CF flag values and meanings."""
    return flags(dims, codes, "how the motion ended", [status.word for status in Status])


def level_variable(dims: str | Sequence[str], levels: Any) -> xr.Variable:
    """Return levels of refinement with their meaning."""
    meaning = "level of refinement at which a cell was computed, -1 where it was filled in"
    return plain_variable(dims, levels, {"long_name": meaning, "units": "1", "symbol": "level"})


@cache
def package_version() -> str:
    """Return the installed version of vibroimpact."""
    try:
        return version("vibroimpact")
    except PackageNotFoundError:
        return "unknown"


def provenance(function: str, model: Model, arguments: Mapping[str, Any]) -> dict[str, str]:
    """Return the attributes that record the call, the model and the version that made a result.

    For a family, they hold its own parameters (`model`) and the oscillator made from them; `initial_condition`
    describes the initial conditions in words.
    """
    design = model.at()
    family = {}
    if model is not design:
        units = {name: entry.unit for name, entry in model.parameters.items()}
        family = {"model": json.dumps({"family": str(model), **model.values}), "model_units": json.dumps(units)}
    attrs = {
        "source": f"vibroimpact {package_version()}",
        "function": function,
        **family,
        design.kind: json.dumps(design.plain()),
        "arguments": json.dumps(dict(arguments), default=str),
    }
    if "start" in arguments:
        attrs["initial_condition"] = _initial_condition(arguments["start"], design.at_rest)
    return attrs


def _initial_condition(start: Any, rest: str) -> str:
    """Return the initial conditions of a result in words; None means `rest`."""
    if isinstance(start, int):
        scale = "max(f, k|g|)/sqrt(k m)" if rest == ImpactOscillator.at_rest else "V, on all stops in turn"
        others = f"{start - 1} impacts at phases 0 to 1 and velocities 0 to {FASTEST:g} {scale}"
        return f"{start} initial conditions: {rest}; {others}"
    if isinstance(start, tuple):
        return f"{len(start)} initial conditions: {'; '.join(_initial_condition(each, rest) for each in start)}"
    if start is None:
        return rest
    if isinstance(start.displacement, tuple):
        return f"q = {list(start.displacement)} m, q' = {list(start.velocity)} m/s at t = {start.time:g} s"
    return f"y = {start.displacement:g} m, y' = {start.velocity:g} m/s at t = {start.time:g} s"


def arguments_of(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the arguments of the function that computed a result; none if they are not recorded."""
    arguments: dict[str, Any] = json.loads(dataset.attrs.get("arguments", "{}"))
    return arguments


def varied_parameters(dataset: xr.Dataset) -> list[str]:
    """Return the parameters that vary along the points of a branch, a curve or scattered designs."""
    return [str(name) for name, coord in dataset.coords.items() if coord.dims == ("point",) and name != "point"]


def first_start(dataset: xr.Dataset) -> str:
    """Return in words where the first of a result's several initial conditions lies."""
    start = arguments_of(dataset).get("start")
    at_rest = isinstance(start, int) or (isinstance(start, list) and start[:1] == [None])
    return "rest" if at_rest else "the first initial condition"


def start_of(dataset: xr.Dataset) -> State | None:
    """Return the initial condition of one motion; None means at rest."""
    start = arguments_of(dataset)["start"]
    if start is None:
        return None
    call: Any = ast.parse(start, mode="eval").body
    return State(**{part.arg: ast.literal_eval(part.value) for part in call.keywords})


def model_of(dataset: xr.Dataset) -> ImpactOscillator | ImpactSystem:
    """Return the oscillator or the system that a result was made from, with the axes of a sweep at reference values."""
    name = "oscillator" if "oscillator" in dataset.attrs else "system"
    plain = json.loads(dataset.attrs[name])
    if ("stops" in plain) != (name == "system"):
        raise ValueError("an oscillator has no `stops`, a system has some")
    return model_from(plain)


def units_of_model(dataset: xr.Dataset) -> dict[str, str]:
    """Return the units of the parameters of a result's model by name; those of a family are in the file, if at all."""
    if "model" in dataset.attrs:
        return dict(json.loads(dataset.attrs.get("model_units", "{}")))
    return {name: entry.unit for name, entry in model_of(dataset).parameters.items()}


def family_in(dataset: xr.Dataset) -> tuple[str, dict[str, Any]] | None:
    """Return the name and the parameters of the family that a result was made from; None if it was made from none."""
    if "model" not in dataset.attrs:
        return None
    values = json.loads(dataset.attrs["model"])
    return str(values.pop("family")), values


def model_from(plain: dict[str, Any]) -> ImpactOscillator | ImpactSystem:
    """Return the oscillator or the system with these plain numbers."""
    if "stops" not in plain:
        return ImpactOscillator(**plain)

    def waves(harmonics: Mapping[str, Any]) -> dict[int, Any]:
        return {int(order): np.array(real) + 1j * np.array(imag) for order, (real, imag) in harmonics.items()}

    force = plain["force"] | {"harmonics": waves(plain["force"]["harmonics"])}
    stops = [Stop(**stop | {"motion": waves(stop["motion"])}) for stop in plain["stops"]]
    return ImpactSystem(**plain | {"force": Force(**force), "stops": stops})


def check_attributes(dataset: xr.Dataset) -> None:
    """Raise `ValueError` if an attribute that this package reads is not of the type that it writes."""
    for name, value in dataset.attrs.items():
        if name in _ENCODED and not _encodes(value, _ENCODED[name]):
            raise ValueError(f"its attribute {name!r} is damaged")
    for name in {"oscillator", "system"} & set(dataset.attrs):
        try:
            model_of(dataset)
        except (TypeError, ValueError, LookupError, AttributeError, ArithmeticError) as error:
            raise ValueError(f"its attribute {name!r} is damaged: {error}") from None
    for name, column in dataset.variables.items():
        words = column.attrs.get("flag_meanings", "")
        counted = np.size(column.attrs["flag_values"]) if "flag_values" in column.attrs and words else None
        if any(not isinstance(column.attrs.get(key, ""), str) for key in _LABELS) or (
            counted is not None and counted != len(words.split())
        ):
            raise ValueError(f"the labels of {name!r} are damaged")


def _encodes(value: Any, kind: type) -> bool:
    """Return whether an attribute is text, or JSON of this type."""
    if not isinstance(value, str) or kind is str:
        return isinstance(value, kind)
    try:
        return isinstance(json.loads(value), kind)
    except (ValueError, RecursionError):
        return False


_LABELS = ("long_name", "units", "symbol", "flag_meanings", DISPLAY)
_BUNDLES = {"boundary_curves": "curve", "continue_orbit": "branch"}  # the name of one result of each function
_LAID_OUT = ("point", "special")  # dims along which the parts are concatenated
# Attributes of each part, kept as lists; systems alone have the last two.
ENDS = ("outcome", "message", "arguments", "stops", "touched")
# Attributes that are read back: text, or the type that their JSON encodes.
_ENCODED: dict[Any, type] = {
    **dict.fromkeys(("function", "initial_condition", "filled_in", "message"), str),
    **dict.fromkeys(("oscillator", "system", "arguments", "model", "model_units"), dict),
    **dict.fromkeys(("messages", "variable_order"), list),
    **{f"{name}_{end}": list for name in _BUNDLES.values() for end in ENDS},
}


def bundle(parts: Sequence[xr.Dataset], function: str, provenance: Mapping[str, str]) -> xr.Dataset:
    """Return one dataset of several curves of `boundary_curves` in a plane, or branches of `continue_orbit`.

    Variables run over `point` (and `special`), and `curve` or `branch` numbers the part of each point. Variables of
    whole parts run over `curve_id` or `branch_id`. Rows of impacts are padded with NaN to the longest; `count` is the
    number of impacts.

    Examples
    --------
    >>> from vibroimpact import ImpactOscillator, boundary_curves
    >>> plane = ("omega", "restitution"), ((2, 3), (0.5, 0.9))
    >>> curves = boundary_curves(ImpactOscillator(), *plane, n_periods=(1,), lines=2)
    >>> joined = bundle([curve.dataset for curve in curves], "boundary_curves", {})
    >>> len(unbundle(joined)) == len(curves)
    True
    """
    name = _BUNDLES[function]
    wide = max(part.sizes["impact"] for part in parts)
    padded = [part.pad(impact=(0, wide - part.sizes["impact"])) for part in parts]
    rows: dict[str, Any] = {}
    for dim in _LAID_OUT:
        if dim in parts[0].dims:
            rows |= _in_a_row(padded, dim, name)
    ends = {key: [str(part.attrs.get(key, "")) for part in parts] for key in ENDS}
    attrs = {f"{name}_{key}": json.dumps(texts) for key, texts in ends.items() if any(texts)}
    attrs = {**provenance, "function": function} | attrs
    return dataset_of(rows | _of_each(parts, f"{name}_id"), attrs=attrs).set_coords(list(parts[0].coords))


def _in_a_row(parts: Sequence[xr.Dataset], dim: str, name: str) -> dict[str, Any]:
    """Return the variables along `dim`, the parts one after another, with the number of each entry's part."""
    keys = [str(key) for key, variable in parts[0].variables.items() if dim in variable.dims]
    join: Any = type(parts[0][keys[0]].variable).concat
    rows = {key: join([part[key].variable for part in parts], dim) for key in keys}
    owner = np.repeat(np.arange(len(parts)), [part.sizes[dim] for part in parts]).astype(np.int32)
    rows[_owner(dim, name)] = plain_variable(dim, owner, {"long_name": f"number of the {name}", "units": "1"})
    if dim == "point":
        kept = np.isfinite(rows["velocity"].transpose("point", "impact").values).sum(axis=1)
        rows["count"] = plain_variable("point", kept, {"long_name": "number of impacts", "units": "1", "symbol": "N"})
    return rows


def _of_each(parts: Sequence[xr.Dataset], dim: str) -> dict[str, Any]:
    """Return the variables that have one value per part."""
    names = {"n_periods": "driving periods in a cycle", "n_impacts": "impacts in a cycle", dim: "number"}
    columns = {
        str(key): plain_variable(dim, np.array([part[key].item() for part in parts], variable.dtype), variable.attrs)
        for key, variable in parts[0].data_vars.items()
        if not variable.dims
    }
    for key, long_name in names.items():
        numbers = range(len(parts)) if key == dim else [part.attrs[key] for part in parts]
        columns[key] = plain_variable(dim, np.array(numbers, np.int32), {"long_name": long_name, "units": "1"})
    return columns


def _owner(dim: str, name: str) -> str:
    return name if dim == "point" else f"{dim}_{name}"


def unbundle(dataset: xr.Dataset) -> list[xr.Dataset]:
    """Return the curves or branches in a dataset, as they were before `bundle`; a single one is returned unchanged."""
    name = next((name for name in _BUNDLES.values() if f"{name}_id" in dataset.dims), None)
    if name is None:
        return [_in_order(dataset)]
    ends = {key: json.loads(dataset.attrs[f"{name}_{key}"]) for key in ENDS if f"{name}_{key}" in dataset.attrs}
    parts = []
    for number in range(dataset.sizes[f"{name}_id"]):
        part = dataset.isel({f"{name}_id": number})
        for dim in _LAID_OUT:
            if (owner := _owner(dim, name)) in part:
                part = part.isel({dim: np.flatnonzero(part[owner].values == number)}).drop_vars(owner)
        cycle = {key: int(part[key]) for key in ("n_periods", "n_impacts")}
        attrs = {key: value for key, value in dataset.attrs.items() if not key.startswith(f"{name}_")}
        part = part.isel(impact=slice(0, int(part["count"].max()))).drop_vars([f"{name}_id", "count", *cycle])
        part.attrs = attrs | cycle | {key: values[number] for key, values in ends.items() if values[number]}
        parts.append(_in_order(part))
    return parts


def _in_order(part: xr.Dataset) -> xr.Dataset:
    """Return a curve with its plane's parameters in the order given; stores sort them alphabetically."""
    names = arguments_of(part).get("parameters", ())
    plane = [name for name in names if name in part.coords]
    return part.drop_vars(plane).assign_coords({name: part[name].variable for name in plane})
