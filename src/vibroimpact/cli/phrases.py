"""Counts, ranges and quantities in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from vibroimpact.dataset import VARIABLES

if TYPE_CHECKING:
    import xarray as xr


def axis_range(dataset: xr.Dataset, name: str) -> str:
    """Return an axis and the values it spans."""
    return f"{dataset[name].attrs['long_name']} {span(dataset[name])}"


def span(values: xr.DataArray) -> str:
    """Return the smallest and the largest of some values, with their unit."""
    low, high = float(values.min()), float(values.max())
    ends = f"{low:.4g}" if f"{low:.4g}" == f"{high:.4g}" else f"{low:.4g} to {high:.4g}"
    units = values.attrs.get("units", "1")
    return ends if units == "1" else f"{ends} {units}"


def counted(number: int, noun: str, plural: str = "s") -> str:
    """Return how many there are of a thing."""
    return f"{number} {noun}{'' if number == 1 else plural}"


def quantity(name: str, value: float, digits: int = 12) -> str:
    """Return a value of a parameter with its unit."""
    units = VARIABLES[name][1]
    return f"{value:.{digits}g}" + ("" if units == "1" else f" {units}")


def listed(words: list[str]) -> str:
    """Return words with commas, and an "and" before the last."""
    return " and ".join(part for part in (", ".join(words[:-1]), words[-1]) if part) if words else ""
