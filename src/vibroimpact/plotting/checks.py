"""Is this the kind of result that a figure shows? If not, the error says what is."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import xarray as xr

from vibroimpact.parameters import unknown

SAMPLE_DIMS = ("impact", "period")


def refused(argument: str, value: Any, allowed: str, hint: str) -> ValueError:
    """Return the error for a result of another kind."""
    return ValueError(f"`{argument}` must be {allowed}, got {_held(value)}; {hint}")


def _held(value: Any) -> str:
    """Return what a wrong argument is or holds."""
    if not isinstance(value, xr.Dataset):
        name = type(value).__name__
        return f"{'an' if name[0] in 'AEIOUaeiou' else 'a'} {name}"
    names, dims = (", ".join(map(str, found)) for found in (value.data_vars, value.dims))
    maker = value.attrs.get("function")
    return f"{f'a result of {maker}' if maker else 'a Dataset'} with {names or 'no variable'} over {dims or 'no axis'}"


def check_result(argument: str, value: Any, maker: str, needed: dict[str, str]) -> xr.Dataset:
    """Return `value` if it is a Dataset whose variables lie along the needed dims, else raise `ValueError`.

    `needed` maps each variable to its one dimension; `maker` is the public function that returns such a result.
    """
    if isinstance(value, xr.Dataset) and all(
        name in value and value[name].dims == (dim,) for name, dim in needed.items()
    ):
        return value
    wanted = ", ".join(f"{name} over {dim}" for name, dim in needed.items())
    raise refused(argument, value, f"a result of {maker} ({wanted})", f"pass what vibroimpact.{maker} returns")


def check_parts(
    argument: str, given: Any, belongs: Callable[[xr.Dataset], bool], what: str, makers: str
) -> list[xr.Dataset]:
    """Return what was given, alone or in a sequence, as a list of datasets that all belong; else raise `ValueError`.

    A part may also be an object that has a `dataset`, such as a Branch.
    """
    alone = isinstance(given, xr.Dataset) or hasattr(given, "dataset") or not isinstance(given, Iterable)
    parts = [part if isinstance(part, xr.Dataset) else getattr(part, "dataset", part) for part in _listed(given, alone)]
    for part in parts:
        if not isinstance(part, xr.Dataset) or not belongs(part):
            raise refused(argument, part, what, f"pass what {makers} returns")
    if not parts:
        raise ValueError(f"`{argument}` must hold at least one of {what}, got none; pass what {makers} returns")
    return parts


def _listed(given: Any, alone: bool) -> list[Any]:
    return [given] if alone else list(given)


def check_diagram(argument: str, value: Any) -> tuple[xr.Dataset, str, str]:
    """Return a bifurcation diagram with the names of its axis and of its sample dimension."""
    if isinstance(value, xr.Dataset) and "velocity" in value and len(value["velocity"].dims) == 2:
        samples = [str(dim) for dim in value["velocity"].dims if dim in SAMPLE_DIMS]
        axes = [str(dim) for dim in value["velocity"].dims if dim not in SAMPLE_DIMS]
        if len(axes) == 1 and len(samples) == 1 and axes[0] in value.coords:
            return value, axes[0], samples[0]
    allowed = "a result of bifurcation_diagram (velocity over its axis and impact or period)"
    raise refused(argument, value, allowed, "pass what vibroimpact.bifurcation_diagram returns")


def check_sweep(argument: str, value: Any, index: str, n_axes: int) -> tuple[xr.Dataset, xr.DataArray]:
    """Return a parameter map over `n_axes` axes and its `index`, or raise `ValueError` saying what to select.

    Of several initial conditions it is the largest value, which the map's `note` says.
    """
    allowed = f"a parameter_map over {('one axis', 'two axes')[n_axes - 1]}"
    if not isinstance(value, xr.Dataset) or "status" not in value or set(value.dims) & set(SAMPLE_DIMS):
        raise refused(argument, value, allowed, "pass what vibroimpact.parameter_map returns")
    value, field = _with_index(value, index)
    axes = [str(dim) for dim in field.dims if dim != "start"]
    if len(axes) == n_axes and "point" not in axes:
        short = [axis for axis in axes if field.sizes[axis] < 2]
        if short:
            raise ValueError(f"`{argument}` needs two or more values along each axis, got 1 along {short[0]}")
        return value, field
    count = f"{len(axes)} {'axis' if len(axes) == 1 else 'axes'} ({', '.join(axes)})"
    raise ValueError(f"`{argument}` must be {allowed}, got {count}; {_axes_hint(field, axes, n_axes)}")


def check_points(argument: str, value: Any, index: str) -> tuple[xr.Dataset, xr.DataArray, list[xr.DataArray]]:
    """Return a map of scattered designs, its `index` and the parameters that vary, or raise `ValueError`."""
    if not isinstance(value, xr.Dataset) or "status" not in value or "point" not in value["status"].dims:
        hint = "pass what vibroimpact.parameter_map(points=...) returns"
        raise refused(argument, value, "a parameter_map of scattered designs", hint)
    value, field = _with_index(value, index)
    varied = [coord for name, coord in value.coords.items() if coord.dims == ("point",) and name != "point"]
    if not varied:
        raise refused(argument, value, "a parameter_map with the parameters that vary", "keep its coordinates")
    return value, field, varied


def _with_index(sweep: xr.Dataset, index: str) -> tuple[xr.Dataset, xr.DataArray]:
    """Return a map and its index: of several initial conditions the largest value."""
    held = [str(name) for name in sweep.data_vars if name != "status"]
    if index not in held:
        raise unknown("`index`", index, held, "or run the map again with it among `indices`")
    if "start" in sweep[index].dims and index != "motion":
        sweep = _largest(sweep[[index, "status"]])
    return sweep, sweep[index]


def _largest(sweep: xr.Dataset) -> xr.Dataset:
    """Return the largest value over the initial conditions; where none has one, the status of the first."""
    status = sweep["status"].isel(start=0, drop=True)
    found = sweep.drop_vars("status").max("start", keep_attrs=True).assign(status=status)
    return found.assign_attrs(sweep.attrs, note=f"largest of {sweep.sizes['start']} initial conditions")


def _axes_hint(field: xr.DataArray, axes: Sequence[str], n_axes: int) -> str:
    if "point" in axes:
        return "draw scattered designs with index_scatter"
    if len(axes) < n_axes:
        return "draw it with index_curve" if len(axes) == 1 else "sweep more axes"
    chosen = ", ".join(f"{axis}={float(field[axis][0]):g}" for axis in axes[n_axes:])
    return f"select one value of the others, for instance sweep.sel({chosen}, method='nearest')"
