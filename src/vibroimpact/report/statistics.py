"""The effect of impacts on each support, in words."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from vibroimpact.parameters import counted
from vibroimpact.report.quantities import quantity

if TYPE_CHECKING:
    import xarray as xr

# By name: the words before and after a quantity.
_FACTS = {
    "rate": ("", ""),
    "mean_velocity": ("mean ", ""),
    "max_velocity": ("up to ", ""),
    "mean_force": ("", " on average"),
    "rest_force": ("", " in rests"),
    "peak_force": ("up to ", ""),
    "power": ("", " lost"),
}


def statistics_sentences(dataset: xr.Dataset) -> Iterator[str]:
    """Yield the time, then a line for each support."""
    total = counted(int(dataset["impacts"].sum()), "impact")
    yield f"{total} in {quantity(float(dataset['duration']), 's', 4)}"
    for name in dataset["stop"].values.tolist():
        of = dataset.sel(stop=name)
        facts = [
            f"{before}{quantity(float(of[key]), of[key].attrs['units'], 4)}{after}"
            for key, (before, after) in _FACTS.items()
            if key in of and of[key].notnull() and (of[key].item() or key != "rest_force")
        ]
        yield f"  {name}: {', '.join(facts) if int(of['impacts']) else 'no impacts'}"
