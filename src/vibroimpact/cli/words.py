"""A result in words, with units."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from vibroimpact.classes import NEEDED, MotionClass, classify
from vibroimpact.cli.diagram_words import tell_diagram
from vibroimpact.cli.orbit_words import tell_basins, tell_boundaries, tell_branches, tell_comparison, tell_orbits
from vibroimpact.cli.phrases import axis_range, counted, span
from vibroimpact.cli.progress import speed
from vibroimpact.dataset import oscillator_of
from vibroimpact.indices import INDICES, ROUNDING, spread_scale, told_spread
from vibroimpact.motion import Motion, recognise, recurrence
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr

_MOTIONS = 8  # of a map, told at most


def describe(dataset: xr.Dataset, seconds: float | None = None) -> Iterator[str]:
    """Yield the lines that sum a result up; `seconds` is what it took to compute."""
    teller = _TELLERS.get(dataset.attrs.get("function", ""))
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
        yield f"displacement {span(dataset['displacement'])}"
    if len(speeds):
        at = dataset["impact_time"].values[speeds.argmax()]
        yield f"{counted(len(speeds), 'impact')}, the hardest at {speeds.max():.4g} m/s after {at:.4g} s"
    if rests := dataset.sizes.get("stick", 0):
        yield f"comes to rest at the stop {counted(rests, 'time')}"
    yield from _ending(dataset)


def _impacts(dataset: xr.Dataset) -> Iterator[str]:
    yield recognise(dataset).sentence(oscillator_of(dataset).period)
    if speeds := dataset["velocity"].values.tolist():
        mean, std = np.mean(speeds), told_spread(np.std(speeds), max(speeds))
        kept = f"{counted(len(speeds), 'impact')} kept"
        yield f"{kept}, {span(dataset['velocity'])}, mean {mean:.4g}, standard deviation {std:.4g} m/s"
        yield from _ending(dataset)


def _looks(dataset: xr.Dataset) -> Iterator[str]:
    n = recurrence(dataset["displacement"].values, dataset["velocity"].values)
    if not n:
        yield "aperiodic, what is seen once a driving period does not repeat"
    else:
        yield f"period-{n}, repeats every {n * oscillator_of(dataset).period:.3g} s"
    for name in ("displacement", "velocity"):
        if dataset[name].size:
            yield f"{name} {span(dataset[name])}"
    yield from _ending(dataset)


def _ending(dataset: xr.Dataset) -> Iterator[str]:
    status = Status(int(dataset["status"]))
    if status not in (Status.OK, Status.CLOSED):
        yield f"{status.word.replace('_', ' ')}: {status.sentence}"


def _map(dataset: xr.Dataset) -> Iterator[str]:
    axes = [str(dim) for dim in dataset["status"].dims]
    shape = " x ".join(str(dataset.sizes[axis]) for axis in axes)
    cells = "cell" if dataset["status"].size == 1 else "cells"
    yield f"{shape} {cells}: " + "; ".join(axis_range(dataset, axis) for axis in axes)
    for name in (name for name in INDICES if name in dataset):
        yield _index(_without_rounding(dataset[name], oscillator_of(dataset).velocity_scale), axes)
    if set(NEEDED) <= set(map(str, dataset.data_vars)):
        yield from _motions(classify(dataset))
    codes, counts = np.unique(dataset["status"].values, return_counts=True)
    for code, count in sorted(zip(codes, counts, strict=True), key=lambda pair: -pair[1]):
        status = Status(int(code))
        yield f"  {100 * count / dataset['status'].size:.3g} % {status.word.replace('_', ' ')}: {status.sentence}"


def _without_rounding(field: xr.DataArray, speed: float) -> xr.DataArray:
    """Return an index with 0 for spreads of cycles, which are nothing but rounding; others as they are."""
    least = ROUNDING * spread_scale(str(field.name), speed)
    return field.where(~(np.abs(field) <= least), 0.0).assign_attrs(field.attrs)


def _index(field: xr.DataArray, axes: list[str]) -> str:
    """Return range and largest value of an index, and how often it has none or an infinite one."""
    told = f"{field.attrs['long_name']} ({field.name})"
    values = field.where(np.isfinite(field))
    if not np.isfinite(field).any():
        return f"{told}: no cell has a finite value"
    peak = field.isel({str(dim): int(at) for dim, at in values.argmax(...).items()})
    place = ", ".join(f"{axis} = {float(peak[axis]):.4g}" for axis in axes)
    infinite = 100.0 * float(np.isinf(field).mean())
    more = f"; infinite in {infinite:.3g} % of the cells" if infinite else ""
    return f"{told}: {span(values.assign_attrs(field.attrs))}, largest at {place}{more}"


def _motions(classes: xr.Dataset) -> Iterator[str]:
    """Yield the commonest motions of a map."""
    kind, n, p = (classes[name].values.ravel() for name in ("motion", "n_periods", "n_impacts"))
    rows, counts = np.unique(np.column_stack([kind, n, np.where(kind == MotionClass.PERIODIC, p, 0)]), axis=0,
                             return_counts=True)  # fmt: skip
    order = np.argsort(-counts, kind="stable")
    for at in order[:_MOTIONS]:
        code, periods, impacts = rows[at].tolist()
        name = MotionClass(code).word.replace("_", " ")
        if code in (MotionClass.PERIODIC, MotionClass.STICKING):
            name = Motion(name, periods, impacts or -1).name
        yield f"  {100 * counts[at] / kind.size:.3g} % {name}"
    if len(order) > _MOTIONS:
        rest = 100 * counts[order[_MOTIONS:]].sum() / kind.size
        yield f"  {rest:.3g} % {counted(len(order) - _MOTIONS, 'other motion')}"


_TELLERS: dict[str, Callable[[xr.Dataset], Iterator[str]]] = {
    "simulate": _simulation,
    "impact_section": _impacts,
    "stroboscopic_section": _looks,
    "bifurcation_diagram": tell_diagram,
    "parameter_map": _map,
    "find_orbit": tell_orbits,
    "continue_orbit": tell_branches,
    "boundary_curves": tell_boundaries,
    "basins": tell_basins,
    "compare": tell_comparison,
}
