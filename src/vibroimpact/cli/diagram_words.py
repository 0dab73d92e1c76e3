"""A bifurcation diagram in words: its ranges, where it hits hardest, and which motions follow one another."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from vibroimpact.classes import CERTAIN_GROWTH
from vibroimpact.cli.phrases import axis_range, counted, quantity, span
from vibroimpact.dataset import oscillator_of
from vibroimpact.motion import Motion, cycle_length, recurrence
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr

_STRETCHES = 12  # told at most
_CHATTER = 1e-6  # of the hardest hit: softer ones are where a chatter was cut off


def tell_diagram(dataset: xr.Dataset) -> Iterator[str]:
    """Yield the ranges of a diagram, its hardest hit, and its longest stretches of one motion."""
    axis = str(dataset["status"].dims[0])
    values = dataset[axis].values
    yield f"{counted(len(values), 'value')} of {axis_range(dataset, axis)}"
    for name in ("displacement", "velocity"):
        if name in dataset and np.isfinite(dataset[name]).any():
            yield from _range(dataset[name], axis)
    labels = [_motion(dataset.isel({axis: i}), axis) for i in range(len(values))]
    runs = [(label, [i for i, _ in group]) for label, group in groupby(enumerate(labels), lambda pair: pair[1])]
    longest = sorted(sorted(runs, key=lambda run: -len(run[1]))[:_STRETCHES], key=lambda run: run[1][0])
    for label, at in longest:
        ends = f"{values[at[0]]:.4g}" + (f" to {values[at[-1]]:.4g}" if len(at) > 1 else "")
        yield f"  {axis} {ends}: {label}"
    if len(runs) > len(longest):
        yield f"  and {counted(len(runs) - len(longest), 'shorter stretch', 'es')}"


def _range(samples: xr.DataArray, axis: str) -> Iterator[str]:
    """Yield the range of the samples; of impact velocities also where the largest is."""
    told = samples.attrs["long_name"]
    if samples.name != "velocity" or "impact" not in samples.dims:
        yield f"{told} {span(samples)}"
        return
    hardest = float(samples.max())
    if float(samples.min()) < _CHATTER * hardest:
        yield f"{told} up to {quantity('velocity', hardest, 4)}"
    else:
        yield f"{told} {span(samples)}"
    column = int(np.nanargmax(samples.transpose(axis, "impact").values)) // samples.sizes["impact"]
    yield f"hardest {quantity('velocity', hardest, 4)} at {axis} {quantity(axis, float(samples[axis][column]), 4)}"


def _motion(row: xr.Dataset, axis: str) -> str:
    """Return what moves at one value of a diagram's axis."""
    status, count = Status(int(row["status"])), int(row["count"])
    if not status.has_indices:
        return status.word.replace("_", " ")
    if cycle := _cycle(row):
        return cycle
    kept = {name: row[name].values[:count] for name in ("displacement", "velocity", "phase") if name in row}
    if "phase" not in kept:
        n = recurrence(kept["displacement"], kept["velocity"])
        return f"period-{n}" if n else "chaotic" if _grows(row, axis, count) else "aperiodic"
    if status == Status.STICKING:
        return "sticking"
    if p := cycle_length(kept["velocity"], kept["phase"]):
        return f"{counted(p, 'impact')} a cycle"
    if status == Status.SHORT_WINDOW:
        return "too short a sample to tell"
    # A phase that falls from one impact to the next tells of a period that began between them.
    begun = int((np.diff(kept["phase"]) < 0.0).sum())
    return "chaotic" if _grows(row, axis, begun) else "aperiodic"


def _cycle(row: xr.Dataset) -> str:
    """Return the name of the cycle that the indices tell of, if there is one."""
    if not {"n_periods", "n_impacts"} <= set(map(str, row.data_vars)):
        return ""
    n, p = int(row["n_periods"]), int(row["n_impacts"])
    if not (n and p) and p >= 0:
        return ""
    rests = p < 0 or any(name in row and math.isinf(float(row[name])) for name in ("lyapunov", "lyapunov_per_impact"))
    return Motion("sticking" if rests else "periodic", n, p).name


def _grows(row: xr.Dataset, axis: str, periods: int) -> bool:
    """Return whether neighbours certainly part, by the rule of `classify`, over the sample or so many periods of it."""
    if "lyapunov_per_impact" in row and "phase" in row:
        return float(row["lyapunov_per_impact"]) * int(row["count"]) > CERTAIN_GROWTH
    if "lyapunov" not in row:
        return False
    period = oscillator_of(row).replace(**{axis: float(row[axis])}).period
    return float(row["lyapunov"]) * period * periods > CERTAIN_GROWTH
