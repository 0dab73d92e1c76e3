"""Is this the kind of result the figure needs? If not, say what is."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import xarray as xr

SAMPLE_DIMS = ("impact", "period")


def holding(value: Any) -> str:
    """Return what a wrong argument is or holds, in words that follow its name."""
    if not isinstance(value, xr.Dataset):
        return f"is a {type(value).__name__}"
    maker = value.attrs.get("function")
    held = ", ".join(map(str, value.data_vars)) or "no variable"
    over = ", ".join(map(str, value.dims)) or "no dimension"
    return f"{f'comes from {maker} and ' if maker else ''}holds {held} over {over}"


def datasets_of(given: Any) -> list[Any]:
    """Return as a list what was given alone or in a sequence; each that has a `dataset` as that dataset."""
    alone = isinstance(given, xr.Dataset) or hasattr(given, "dataset") or not isinstance(given, Iterable)
    each = [given] if alone else list(given)
    return [one if isinstance(one, xr.Dataset) else getattr(one, "dataset", one) for one in each]


def check_result(argument: str, value: Any, maker: str, needed: dict[str, str]) -> xr.Dataset:
    """Return `value` if it is a Dataset whose variables lie along the needed dims, else raise `ValueError`.

    `needed` maps each variable to its one dimension; `maker` is the public function that returns such a result.
    """
    if isinstance(value, xr.Dataset) and all(
        name in value and value[name].dims == (dim,) for name, dim in needed.items()
    ):
        return value
    wanted = ", ".join(f"{name} over {dim}" for name, dim in needed.items())
    raise ValueError(
        f"`{argument}` {holding(value)}; allowed is a result of {maker} ({wanted}); "
        f"pass what vibroimpact.{maker} returns"
    )


def check_diagram(argument: str, value: Any) -> tuple[xr.Dataset, str, str]:
    """Return a bifurcation diagram with the names of its axis and of its sample dimension."""
    if isinstance(value, xr.Dataset) and "velocity" in value and len(value["velocity"].dims) == 2:
        samples = [str(dim) for dim in value["velocity"].dims if dim in SAMPLE_DIMS]
        axes = [str(dim) for dim in value["velocity"].dims if dim not in SAMPLE_DIMS]
        if len(axes) == 1 and len(samples) == 1 and axes[0] in value.coords:
            return value, axes[0], samples[0]
    raise ValueError(
        f"`{argument}` {holding(value)}; allowed is a result of bifurcation_diagram (velocity over its axis and "
        "impact or period); pass what vibroimpact.bifurcation_diagram returns"
    )


def check_sweep(argument: str, value: Any, index: str, n_axes: int) -> xr.DataArray:
    """Return `index` of a parameter map over `n_axes` axes, or raise `ValueError` telling what to select."""
    words = {1: "one axis", 2: "two axes"}[n_axes]
    allowed = f"allowed is a parameter_map over {words}"
    if not isinstance(value, xr.Dataset) or "status" not in value or set(value.dims) & set(SAMPLE_DIMS):
        raise ValueError(f"`{argument}` {holding(value)}; {allowed}; pass what vibroimpact.parameter_map returns")
    field = _index_of(value, index)
    axes = [str(dim) for dim in field.dims]
    if len(axes) == n_axes:
        short = [axis for axis in axes if field.sizes[axis] < 2]
        if short:
            raise ValueError(
                f"`{argument}` has 1 value along {short[0]}; allowed are two or more; give the sweep a longer axis"
            )
        return field
    count = f"{len(axes)} {'axis' if len(axes) == 1 else 'axes'} ({', '.join(axes)})"
    raise ValueError(f"`{argument}` has {count}; {allowed}; {_axes_remedy(field, axes, n_axes)}")


def _axes_remedy(field: xr.DataArray, axes: Sequence[str], n_axes: int) -> str:
    if len(axes) < n_axes:
        return "draw it with index_curve" if len(axes) == 1 else "sweep more axes"
    chosen = ", ".join(f"{axis}={float(field[axis][0]):g}" for axis in axes[n_axes:])
    return f"select one value of the others, for instance sweep.sel({chosen}, method='nearest')"


def _index_of(sweep: xr.Dataset, index: str) -> xr.DataArray:
    held = [str(name) for name in sweep.data_vars if name != "status"]
    if index not in held:
        raise ValueError(
            f"`index` is {index!r}; allowed are {', '.join(held)}, which this parameter_map holds; "
            "choose one, or run the map again with it among `indices`"
        )
    return sweep[index]


def check_choice(argument: str, value: Any, allowed: Iterable[str]) -> str:
    """Return `value` if it is among the allowed names, else raise `ValueError`."""
    names = list(allowed)
    if value not in names:
        raise ValueError(f"`{argument}` is {value!r}; allowed are {', '.join(names)}; choose one")
    return str(value)


def check_number(argument: str, value: Any) -> float:
    """Return `value` as a finite float, else raise `ValueError`."""
    if isinstance(value, (bool, str)) or not np.isscalar(value) or not np.isfinite(np.real(value)):
        raise ValueError(f"`{argument}` is {value!r}; allowed is a finite number; give a plain number")
    return float(value)  # type: ignore[arg-type]
