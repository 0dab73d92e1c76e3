"""Numbers with their units, ranges, counts and initial conditions, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from vibroimpact.parameters import with_unit

if TYPE_CHECKING:
    import xarray as xr


def axis_range(dataset: xr.Dataset, name: str) -> str:
    """Return the long name of an axis and the range of its values."""
    return f"{dataset[name].attrs['long_name']} {span(dataset[name])}"


def span(values: xr.DataArray) -> str:
    """Return the smallest and the largest of some values, with their unit."""
    low, high = float(values.min()), float(values.max())
    ends = f"{low:.4g}" if f"{low:.4g}" == f"{high:.4g}" else f"{low:.4g} to {high:.4g}"
    return with_unit(ends, values.attrs.get("units", "1"))


def quantity(value: float, units: str, digits: int = 12) -> str:
    """Return a value with its unit."""
    return with_unit(f"{value:.{digits}g}", units)


def place_of(dataset: Any, name: str, digits: int = 4) -> str:
    """Return an axis and its value where one is selected."""
    return f"{name} = {quantity(float(dataset[name]), dataset[name].attrs.get('units', '1'), digits)}"


def spaced(word: str) -> str:
    """Return the meaning of a flag with spaces in place of underscores."""
    return word.replace("_", " ")


def initial_condition(dataset: xr.Dataset, before: str = "from ", after: str = "") -> str:
    """Return the initial conditions from which a result was computed; empty if it does not contain them."""
    start = dataset.attrs.get("initial_condition", "")
    if "start" in dataset.coords and "start" not in dataset.dims:  # one of several was selected
        start = f"start = {int(dataset['start'])} of {start}"
    return f"{before}{start}{after}" if start else ""
