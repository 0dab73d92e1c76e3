"""Maps and diagrams in words."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vibroimpact.dataset import arguments_of, first_start, model_of
from vibroimpact.indices import EVERY, ROUNDING, VELOCITY_INDICES, spread_scale
from vibroimpact.labels import displayed
from vibroimpact.motion import MotionClass, decide, listed, may_wind, motion_name, refined
from vibroimpact.motion.classes import NEEDED, classify
from vibroimpact.motion.recognition import cycle_length, recurrence
from vibroimpact.parameters import counted, with_unit
from vibroimpact.report.quantities import axis_range, initial_condition, place_of, quantity, spaced, span
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr

MOTIONS = 8  # the most that are listed for a map
INTERVALS = 12  # the most that are listed for a diagram
CHATTER = 1e-6  # of the hardest impact: softer ones only show where a chatter was cut off


def map_sentences(dataset: xr.Dataset) -> Iterator[str]:
    """Yield the content of a map, or of its `classify` result: ranges of indices, motions, and how they ended."""
    dataset, several = displayed(dataset), dataset.sizes.get("start", 1)
    dims = [str(dim) for dim in dataset["status"].dims if dim != "start"]
    axes = [str(name) for dim in dims for name, axis in dataset.coords.items() if axis.dims == (dim,)]
    shape = " x ".join(str(dataset.sizes[dim]) for dim in dims)
    cells = "cell" if dataset["status"].size == several else "cells"
    ranges = "; ".join(axis_range(dataset, axis) for axis in axes)
    if "start" in dataset.dims:
        yield f"{shape} {cells}: {ranges}"
        yield initial_condition(dataset, "each from ")
    else:
        yield f"{shape} {cells}{initial_condition(dataset, ' from ')}: {ranges}"
    for name in (name for name in EVERY if name in dataset):
        yield _index(dataset[name], axes, model_of(dataset).velocity_scale)
    if "filled_in" in dataset.attrs:
        yield f"{100 * dataset.attrs['fraction_computed']:.3g} % of the cells computed; {dataset.attrs['filled_in']}"
    if "start" in dataset.dims:
        yield from hits_of(dataset)
        yield f"of the {dataset['status'].size:,} motions:"
    if "motion" in dataset:  # they are classified already
        yield from _motions(dataset)
    elif set(NEEDED) <= set(map(str, dataset.data_vars)):
        yield from _motions(classify(dataset))
    codes, counts = np.unique(dataset["status"].values, return_counts=True)
    for code, count in sorted(zip(codes, counts, strict=True), key=lambda pair: -pair[1]):
        status = Status(int(code))
        yield f"  {100 * count / dataset['status'].size:.3g} % {spaced(status.word)}: {status.sentence}"


def hits_of(dataset: xr.Dataset) -> Iterator[str]:
    """Yield the numbers of cells with lasting impacts from the first initial condition, and only from others."""
    field = dataset["status"].transpose("start", ...)
    if (field == Status.INTERRUPTED).any():
        return
    with_impacts = [status for status in Status if status.has_indices or status == Status.DECAYING]
    has_impacts = np.isin(field.values, with_impacts)
    first, others = has_impacts[0], has_impacts.any(axis=0) & ~has_impacts[0] & (field.values[0] != Status.BUDGET)
    origin = first_start(dataset)
    yield (
        f"impacts persist from {origin} in {first.sum():,} of {first.size:,} cells ({100 * first.mean():.3g} %); in "
        f"{others.sum():,} more ({100 * others.mean():.3g} %) only from others of the {len(field)} initial conditions"
    )


def _index(field: xr.DataArray, axes: list[str], scale: float) -> str:
    """Return the range and the largest value of an index, and how often it is infinite; `scale` is that of velocities.

    For several initial conditions, the range is that of the largest value in each cell.
    """
    rounding = ROUNDING * spread_scale(str(field.name), scale)  # a smaller spread is that of a cycle
    field = field.where(~(np.abs(field) <= rounding), 0.0).assign_attrs(field.attrs)
    head = f"{field.attrs['long_name']} ({field.name})"
    if "no_value" in field.attrs:
        return f"{head}: no value; {field.attrs['no_value']}"
    values = field.where(np.isfinite(field)).assign_attrs(field.attrs)
    if not np.isfinite(field).any():
        return f"{head}: no cell has a finite value"
    peak = field.isel({str(dim): int(at) for dim, at in values.argmax(...).items()})
    place = ", ".join(place_of(peak, axis) for axis in axes)
    unstruck = ""
    if "stop" in field.dims:
        place += f", on {peak['stop'].item()}"
        silent = [name for name in field["stop"].values.tolist() if field.sel(stop=name).isnull().all()]
        if silent and field.name in VELOCITY_INDICES:
            unstruck = f"; {listed(silent)} {'is' if len(silent) == 1 else 'are'} never struck in the impacts kept"
    if "start" in field.dims:
        head += f", the largest of {field.sizes['start']} initial conditions"
        place += f", start = {int(peak['start'])}"
        field, values = field.max("start"), values.max("start").assign_attrs(field.attrs)
    infinite = 100.0 * float(np.isinf(field).mean())
    partly = f"; infinite in {infinite:.3g} % of the cells" if infinite else ""
    return f"{head}: {span(values)}, largest at {place}{partly}{unstruck}"


def _motions(classes: xr.Dataset) -> Iterator[str]:
    """Yield the most frequent motions of a map."""
    kind = refined(classes["motion"].values, classes["status"].values).ravel()
    n, p = (classes[name].values.ravel() for name in ("n_periods", "n_impacts"))
    rows, counts = np.unique(np.column_stack([kind, n, np.where(kind == MotionClass.PERIODIC, p, 0)]), axis=0,
                             return_counts=True)  # fmt: skip
    order = np.argsort(-counts, kind="stable")
    for at in order[:MOTIONS]:
        yield f"  {100 * counts[at] / kind.size:.3g} % {motion_name(*rows[at].tolist())}"
    if len(order) > MOTIONS:
        rest = 100 * counts[order[MOTIONS:]].sum() / kind.size
        yield f"  {rest:.3g} % {counted(len(order) - MOTIONS, 'other motion')}"


# Diagrams


def diagram_sentences(dataset: xr.Dataset) -> Iterator[str]:
    """Yield the content of a diagram: ranges of its samples, and the motions along its axis."""
    axis = str(dataset["status"].dims[0])
    shown = displayed(dataset)
    values, unit = shown[axis].values, shown[axis].attrs["units"]
    direction = arguments_of(dataset).get("direction", "fresh")
    start = initial_condition(dataset, ", each from ")
    if direction != "fresh":
        start = initial_condition(dataset, f", going {direction} from ", ", then each next one from the last state")
    yield f"{counted(len(values), 'value')} of {axis_range(shown, axis)}{start}"
    for name in ("displacement", "velocity"):
        if name in dataset and np.isfinite(dataset[name]).any():
            yield from _sample_range(shown[name], axis)
    labels = [_motion_at(dataset.isel({axis: i}), axis) for i in range(len(values))]
    runs = [(label, [i for i, _ in group]) for label, group in groupby(enumerate(labels), lambda pair: pair[1])]
    longest = sorted(sorted(runs, key=lambda run: -len(run[1]))[:INTERVALS], key=lambda run: run[1][0])
    for label, places in longest:
        ends = f"{values[places[0]]:.4g}" + (f" to {values[places[-1]]:.4g}" if len(places) > 1 else "")
        yield f"  {axis} {with_unit(ends, unit)}: {label}"
    if len(runs) > len(longest):
        yield f"  and {counted(len(runs) - len(longest), 'shorter interval')}"


def _sample_range(samples: xr.DataArray, axis: str) -> Iterator[str]:
    """Yield the range of the samples; for impact velocities, also the place of the largest."""
    head = samples.attrs["long_name"]
    if samples.name != "velocity" or "impact" not in samples.dims:
        yield f"{head} {span(samples)}"
        return
    hardest = float(samples.max())
    cut_off = float(samples.min()) < CHATTER * hardest
    yield f"{head} " + (f"up to {quantity(hardest, 'm/s', 4)}" if cut_off else span(samples))
    column = int(np.nanargmax(samples.transpose(axis, "impact").values)) // samples.sizes["impact"]
    value = quantity(float(samples[axis][column]), samples[axis].attrs["units"], 4)
    yield f"hardest impact {quantity(hardest, 'm/s', 4)} at {axis} {value}"


def _motion_at(row: xr.Dataset, axis: str) -> str:
    """Return the motion at one value of a diagram's axis, from its indices and samples."""
    status, count = Status(int(row["status"])), int(row["count"])
    samples = {name: row[name].values[:count] for name in ("displacement", "velocity", "phase") if name in row}
    n, p = (int(row[name]) if name in row else 0 for name in ("n_periods", "n_impacts"))
    winding = count * may_wind(model_of(row))
    kind = MotionClass(int(decide(status, _growth(row, axis, samples), n, p, winding)))
    if kind != MotionClass.UNDECIDED:
        return motion_name(kind, n, p)
    if "phase" not in samples:
        if n := recurrence(samples["displacement"], samples["velocity"]):
            return f"period-{n}"
    elif status == Status.STICKING:
        return "comes to rest at the stop"
    elif p := _impacts_in_cycle(row, samples):
        return f"{counted(p, 'impact')} per cycle"
    elif status == Status.SHORT_WINDOW:
        return "sample too short to classify"
    return "does not repeat"


def _impacts_in_cycle(row: xr.Dataset, samples: Mapping[str, NDArray[np.float64]]) -> int:
    """Return the number of impacts after which the samples repeat; without a driving period, from speeds and stops."""
    if model_of(row).periodic:
        return cycle_length(samples["velocity"], samples["phase"])
    stops = row["stop"].values[: len(samples["velocity"])].astype(float) if "stop" in row else samples["velocity"]
    return recurrence(samples["velocity"], stops)


def _growth(row: xr.Dataset, axis: str, samples: Mapping[str, NDArray[np.float64]]) -> float:
    """Return ln of the growth of perturbations over the sample; NaN if no index gives it."""
    if "lyapunov_per_impact" in row and "phase" in samples:
        return float(row["lyapunov_per_impact"]) * int(row["count"])
    osc = model_of(row)
    if "lyapunov" not in row or axis not in osc.parameters:
        return math.nan
    # A phase that decreases from one impact to the next shows that a driving period began between them.
    periods = int((np.diff(samples["phase"]) < 0.0).sum()) if "phase" in samples else int(row["count"])
    return float(row["lyapunov"]) * osc.replace(**{axis: float(row[axis])}).period * periods
