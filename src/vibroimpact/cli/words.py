"""A result in words, with units."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from vibroimpact.cli.progress import speed
from vibroimpact.dataset import oscillator_of
from vibroimpact.indices import INDICES
from vibroimpact.motion import cycle_length, recognise, recurrence
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr

_STRETCHES = 12  # of a diagram, told at most


def describe(dataset: xr.Dataset, seconds: float | None = None) -> Iterator[str]:
    """Yield the lines that sum a result up; `seconds` is what it took to compute."""
    teller = {
        "simulate": _simulation,
        "impact_section": _impacts,
        "stroboscopic_section": _looks,
        "bifurcation_diagram": _diagram,
        "parameter_map": _map,
    }.get(dataset.attrs.get("function", ""))
    if teller is None:
        raise ValueError("`file` holds no result of vibroimpact; allowed is what this package saved; choose another")
    yield from teller(dataset)
    if seconds is not None:
        impacts = speed(int(dataset.attrs.get("impacts_computed", 0)), seconds)
        yield ", ".join(part for part in (f"computed in {seconds:.2g} s", impacts) if part)


def _simulation(dataset: xr.Dataset) -> Iterator[str]:
    period = oscillator_of(dataset).period
    time, speeds = dataset["time"].values, dataset["impact_velocity"].values
    if len(time):
        periods = f"{(time[-1] - time[0]) / period:.4g} driving periods of {period:.4g} s"
        yield f"{periods}, {time[0]:.4g} to {time[-1]:.4g} s"
        yield f"displacement {_range(dataset['displacement'])}"
    if len(speeds):
        at = dataset["impact_time"].values[speeds.argmax()]
        yield f"{_count(len(speeds), 'impact')}, the hardest at {speeds.max():.4g} m/s after {at:.4g} s"
    if rests := dataset.sizes.get("stick", 0):
        yield f"comes to rest at the stop {_count(rests, 'time')}"
    yield from _ending(dataset)


def _impacts(dataset: xr.Dataset) -> Iterator[str]:
    yield recognise(dataset).sentence(oscillator_of(dataset).period)
    if speeds := dataset["velocity"].values.tolist():
        mean, std = np.mean(speeds), np.std(speeds)
        kept = f"{_count(len(speeds), 'impact')} kept"
        yield f"{kept}, {_range(dataset['velocity'])}, mean {mean:.4g}, standard deviation {std:.4g} m/s"
        yield from _ending(dataset)


def _looks(dataset: xr.Dataset) -> Iterator[str]:
    n = recurrence(dataset["displacement"].values, dataset["velocity"].values)
    if not n:
        yield "aperiodic, what is seen once a driving period does not repeat"
    else:
        yield f"period-{n}, repeats each {n * oscillator_of(dataset).period:.3g} s"
    for name in ("displacement", "velocity"):
        if dataset[name].size:
            yield f"{name} {_range(dataset[name])}"
    yield from _ending(dataset)


def _ending(dataset: xr.Dataset) -> Iterator[str]:
    status = Status(int(dataset["status"]))
    if status not in (Status.OK, Status.CLOSED):
        yield f"{status.word}: {status.sentence}"


def _diagram(dataset: xr.Dataset) -> Iterator[str]:
    (axis,) = dataset["status"].dims
    values = dataset[axis].values
    yield f"{_count(len(values), 'value')} of {_axis(dataset, str(axis))}"
    for name in ("displacement", "velocity"):
        if name in dataset and np.isfinite(dataset[name]).any():
            yield f"{dataset[name].attrs['long_name']} {_range(dataset[name])}"
    labels = [_row(dataset.isel({axis: i})) for i in range(len(values))]
    runs = [(label, [i for i, _ in group]) for label, group in groupby(enumerate(labels), lambda pair: pair[1])]
    longest = sorted(sorted(runs, key=lambda run: -len(run[1]))[:_STRETCHES], key=lambda run: run[1][0])
    for label, at in longest:
        ends = f"{values[at[0]]:.4g}" + (f" to {values[at[-1]]:.4g}" if len(at) > 1 else "")
        yield f"  {axis} {ends}: {label}"
    if len(runs) > len(longest):
        yield f"  and {_count(len(runs) - len(longest), 'shorter stretch', 'es')}"


def _row(row: xr.Dataset) -> str:
    """Return what moves at one value of a diagram's axis."""
    status, count = Status(int(row["status"])), int(row["count"])
    if not status.has_indices:
        return status.word.replace("_", " ")
    kept = {name: row[name].values[:count] for name in ("displacement", "velocity", "phase") if name in row}
    if "phase" not in kept:
        n = recurrence(kept["displacement"], kept["velocity"])
        return f"period-{n}" if n else "aperiodic"
    if status == Status.STICKING:
        return "sticking"
    if p := cycle_length(kept["velocity"], kept["phase"]):
        return f"{_count(p, 'impact')} a cycle"
    return "too short a sample to tell" if status == Status.SHORT_WINDOW else "aperiodic"


def _map(dataset: xr.Dataset) -> Iterator[str]:
    axes = [str(dim) for dim in dataset["status"].dims]
    shape = " x ".join(str(dataset.sizes[axis]) for axis in axes)
    yield f"{shape} cells: " + "; ".join(_axis(dataset, axis) for axis in axes)
    for name in (name for name in INDICES if name in dataset):
        field = dataset[name]
        if not np.isfinite(field).any():
            yield f"{field.attrs['long_name']} ({name}): no cell has a value"
            continue
        peak = field.isel({str(dim): int(at) for dim, at in field.argmax(...).items()})
        place = ", ".join(f"{axis} = {float(peak[axis]):.4g}" for axis in axes)
        yield f"{field.attrs['long_name']} ({name}): {_range(field)}, largest at {place}"
    codes, counts = np.unique(dataset["status"].values, return_counts=True)
    for code, count in sorted(zip(codes, counts, strict=True), key=lambda pair: -pair[1]):
        status = Status(int(code))
        yield f"  {100 * count / dataset['status'].size:.3g} % {status.word}: {status.sentence}"


def _axis(dataset: xr.Dataset, name: str) -> str:
    return f"{dataset[name].attrs['long_name']} {_range(dataset[name])}"


def _range(values: xr.DataArray) -> str:
    low, high = float(values.min()), float(values.max())
    ends = f"{low:.4g}" if f"{low:.4g}" == f"{high:.4g}" else f"{low:.4g} to {high:.4g}"
    units = values.attrs.get("units", "1")
    return ends if units == "1" else f"{ends} {units}"


def _count(number: int, noun: str, plural: str = "s") -> str:
    return f"{number} {noun}{'' if number == 1 else plural}"
