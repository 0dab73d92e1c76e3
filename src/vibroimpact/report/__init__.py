"""Results in words: what any function of the package returned, summed up in a few lines with units."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from vibroimpact.classes import NEEDED, classify
from vibroimpact.dataset import oscillator_of, unbundle
from vibroimpact.indices import INDICES, ROUNDING, shown_spread, spread_scale
from vibroimpact.motion import (
    MotionClass,
    cycle_length,
    cycle_name,
    decide,
    listed,
    motion_name,
    recognise,
    recurrence,
    refined,
)
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

MOTIONS = 8  # listed of a map, at most
INTERVALS = 12  # listed of a diagram, at most
IMPACTS, PER_LINE = 9, 3  # listed of a cycle at most, and in a line
CHATTER = 1e-6  # of the hardest impact: softer ones only show where a chatter was cut off


def sentences_of(dataset: xr.Dataset) -> list[str]:
    """Return the lines that sum up a result of this package, fresh or loaded: one fact per line, with units.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> sentences_of(vi.impact_section(vi.ImpactOscillator(omega=2.0), sample_impacts=200))[0]
    'period-1 impact-1, hits at 6.23 m/s every 3.14 s'
    """
    writer = _SUMMARIES.get(dataset.attrs.get("function", ""))
    if writer is None:
        raise ValueError(f"`dataset` must be a result of vibroimpact ({', '.join(_SUMMARIES)}), got another dataset")
    return list(writer(dataset))


# Quantities


def axis_range(dataset: xr.Dataset, name: str) -> str:
    """Return the long name of an axis and the range of its values."""
    return f"{dataset[name].attrs['long_name']} {span(dataset[name])}"


def span(values: xr.DataArray) -> str:
    """Return the smallest and the largest of some values, with their unit."""
    low, high = float(values.min()), float(values.max())
    ends = f"{low:.4g}" if f"{low:.4g}" == f"{high:.4g}" else f"{low:.4g} to {high:.4g}"
    units = values.attrs.get("units", "1")
    return ends if units == "1" else f"{ends} {units}"


def counted(number: int, noun: str) -> str:
    """Return a count with its noun, in the plural unless there is one."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def quantity(value: float, units: str, digits: int = 12) -> str:
    """Return a value with its unit."""
    return f"{value:.{digits}g}" + ("" if units == "1" else f" {units}")


# One motion


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
        mean, std = np.mean(speeds), shown_spread(np.std(speeds), max(speeds))
        kept = f"{counted(len(speeds), 'impact')} kept"
        yield f"{kept}, {span(dataset['velocity'])}, mean {mean:.4g}, standard deviation {std:.4g} m/s"
        yield from _ending(dataset)


def _stroboscopic(dataset: xr.Dataset) -> Iterator[str]:
    n = recurrence(dataset["displacement"].values, dataset["velocity"].values)
    if not n:
        yield "the samples taken once per driving period do not repeat"
    else:
        yield f"period-{n}, repeats every {n * oscillator_of(dataset).period:.3g} s"
    for name in ("displacement", "velocity"):
        if dataset[name].size:
            yield f"{name} {span(dataset[name])}"
    yield from _ending(dataset)


def _ending(dataset: xr.Dataset) -> Iterator[str]:
    status = Status(int(dataset["status"]))
    if status not in (Status.OK, Status.CLOSED):
        yield f"{_spaced(status.word)}: {status.sentence}"


def _spaced(word: str) -> str:
    return word.replace("_", " ")


# Maps


def _map(dataset: xr.Dataset) -> Iterator[str]:
    dims = [str(dim) for dim in dataset["status"].dims]
    axes = [str(name) for dim in dims for name, axis in dataset.coords.items() if axis.dims == (dim,)]
    shape = " x ".join(str(dataset.sizes[dim]) for dim in dims)
    cells = "cell" if dataset["status"].size == 1 else "cells"
    yield f"{shape} {cells}: " + "; ".join(axis_range(dataset, axis) for axis in axes)
    for name in (name for name in INDICES if name in dataset):
        yield _index(dataset[name], axes, oscillator_of(dataset).velocity_scale)
    if set(NEEDED) <= set(map(str, dataset.data_vars)):
        yield from _motions(classify(dataset))
    codes, counts = np.unique(dataset["status"].values, return_counts=True)
    for code, count in sorted(zip(codes, counts, strict=True), key=lambda pair: -pair[1]):
        status = Status(int(code))
        yield f"  {100 * count / dataset['status'].size:.3g} % {_spaced(status.word)}: {status.sentence}"


def _index(field: xr.DataArray, axes: list[str], scale: float) -> str:
    """Return range and largest value of an index, and how often it is infinite; `scale` is that of velocities."""
    rounding = ROUNDING * spread_scale(str(field.name), scale)  # the spread of a cycle is nothing else
    field = field.where(~(np.abs(field) <= rounding), 0.0).assign_attrs(field.attrs)
    head = f"{field.attrs['long_name']} ({field.name})"
    values = field.where(np.isfinite(field))
    if not np.isfinite(field).any():
        return f"{head}: no cell has a finite value"
    peak = field.isel({str(dim): int(at) for dim, at in values.argmax(...).items()})
    place = ", ".join(f"{axis} = {float(peak[axis]):.4g}" for axis in axes)
    infinite = 100.0 * float(np.isinf(field).mean())
    more = f"; infinite in {infinite:.3g} % of the cells" if infinite else ""
    return f"{head}: {span(values.assign_attrs(field.attrs))}, largest at {place}{more}"


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


def _diagram(dataset: xr.Dataset) -> Iterator[str]:
    axis = str(dataset["status"].dims[0])
    values = dataset[axis].values
    yield f"{counted(len(values), 'value')} of {axis_range(dataset, axis)}"
    for name in ("displacement", "velocity"):
        if name in dataset and np.isfinite(dataset[name]).any():
            yield from _sample_range(dataset[name], axis)
    labels = [_motion_at(dataset.isel({axis: i}), axis) for i in range(len(values))]
    runs = [(label, [i for i, _ in group]) for label, group in groupby(enumerate(labels), lambda pair: pair[1])]
    longest = sorted(sorted(runs, key=lambda run: -len(run[1]))[:INTERVALS], key=lambda run: run[1][0])
    for label, at in longest:
        ends = f"{values[at[0]]:.4g}" + (f" to {values[at[-1]]:.4g}" if len(at) > 1 else "")
        yield f"  {axis} {ends}: {label}"
    if len(runs) > len(longest):
        yield f"  and {counted(len(runs) - len(longest), 'shorter interval')}"


def _sample_range(samples: xr.DataArray, axis: str) -> Iterator[str]:
    """Yield the range of the samples; for impact velocities also where the largest is."""
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
    kept = {name: row[name].values[:count] for name in ("displacement", "velocity", "phase") if name in row}
    n, p = (int(row[name]) if name in row else 0 for name in ("n_periods", "n_impacts"))
    kind = MotionClass(int(decide(status, _growth(row, axis, kept), n, p)))
    if kind != MotionClass.UNDECIDED:
        return motion_name(kind, n, p)
    if "phase" not in kept:
        if n := recurrence(kept["displacement"], kept["velocity"]):
            return f"period-{n}"
    elif status == Status.STICKING:
        return "comes to rest at the stop"
    elif p := cycle_length(kept["velocity"], kept["phase"]):
        return f"{counted(p, 'impact')} per cycle"
    elif status == Status.SHORT_WINDOW:
        return "sample too short to classify"
    return "does not repeat"


def _growth(row: xr.Dataset, axis: str, kept: Mapping[str, NDArray[np.float64]]) -> float:
    """Return ln of the growth of perturbations over the sample; NaN where no index gives it."""
    if "lyapunov_per_impact" in row and "phase" in kept:
        return float(row["lyapunov_per_impact"]) * int(row["count"])
    osc = oscillator_of(row)
    if "lyapunov" not in row or axis not in osc.parameters:
        return math.nan
    # A phase that falls from one impact to the next shows that a driving period began between them.
    periods = int((np.diff(kept["phase"]) < 0.0).sum()) if "phase" in kept else int(row["count"])
    return float(row["lyapunov"]) * osc.replace(**{axis: float(row[axis])}).period * periods


# Orbits, branches and boundaries


def _orbits(dataset: xr.Dataset) -> Iterator[str]:
    period = oscillator_of(dataset).period
    yield dataset.attrs["message"]
    for at, reason in enumerate(json.loads(dataset.attrs["messages"])):
        orbit = dataset.isel(orbit=at)
        stable = "stable" if bool(orbit["stable"]) else "unstable"
        length = int(orbit["n_periods"]) * period
        yield f"{at + 1}. {_orbit_type(orbit)}, {stable}, repeats every {length:.6g} s"
        if reason:
            yield f"   inadmissible: {reason}"
        yield from _cycle_of_impacts(orbit)
        if float(orbit["stuck_time"]) > 0.0:
            rest, leaves, stuck = (float(orbit[key]) for key in ("stick_phase", "release_phase", "stuck_time"))
            yield f"   at rest at the stop from phase {rest:.6g} to {leaves:.6g}, {stuck:.6g} s per cycle"
        yield f"   multipliers {_multipliers(orbit)}"


def _cycle_of_impacts(orbit: xr.Dataset) -> Iterator[str]:
    """Yield the impacts of a cycle, a few to a line."""
    rows = orbit["velocity"].values, orbit["phase"].values
    hits = [f"{v:.6g} m/s at phase {phase:.6g}" for v, phase in zip(*rows, strict=True) if math.isfinite(v)]
    parts = hits[:IMPACTS] + [f"and {len(hits) - IMPACTS} more"] * (len(hits) > IMPACTS)
    for first in range(0, len(parts), PER_LINE):
        comma = "," if first + PER_LINE < len(parts) else ""
        yield f"   {'hits at' if first == 0 else '       '} {', '.join(parts[first : first + PER_LINE])}{comma}"


def _multipliers(orbit: xr.Dataset) -> str:
    (a, b), (c, d) = ([float(orbit[f"multiplier_{i}_{part}"]) for part in ("real", "imag")] for i in (1, 2))
    if not any((a, b, c, d)):
        return "0 and 0: a rest at the stop erases all memory"
    return f"{a:.6g} ± {abs(b):.6g} i, modulus {math.hypot(a, b):.6g}" if b else f"{a:.6g} and {c:.6g}"


def _orbit_type(part: xr.Dataset) -> str:
    """Return the type of an orbit, or of those of a branch or a curve."""
    n, p = (int(part[key] if key in part else part.attrs[key]) for key in ("n_periods", "n_impacts"))
    return cycle_name(n, p, sticks=float(part.get("stuck_time", 0.0)) > 0.0)


def _branches(dataset: xr.Dataset) -> Iterator[str]:
    branches = unbundle(dataset)
    for at, branch in enumerate(branches, start=1):
        (parameter,) = _varied(branch)
        head = f"branch {at} of {len(branches)}, " if len(branches) > 1 else ""
        yield f"{head}{_orbit_type(branch)}: {counted(branch.sizes['point'], 'orbit')}, {branch.attrs['message']}"
        intervals = [f"{low:.6g} to {high:.6g}" for low, high in _stable_intervals(branch, parameter)]
        yield f"  stable for {parameter} {listed(intervals)}" if intervals else "  nowhere stable"
        kinds = str(branch["special_kind"].attrs["flag_meanings"]).split()
        for i in range(branch.sizes["special"]):
            point = branch.isel(special=i)
            hits = listed([f"{v:.6g}" for v in point["special_velocity"].values if math.isfinite(v)][:IMPACTS])
            kind = _spaced(kinds[int(point["special_kind"])])
            touch = float(point["special_touch_phase"])
            at_phase = f", touches the stop at phase {touch:.6g}" if math.isfinite(touch) else ""
            value = quantity(float(point["special_value"]), point["special_value"].attrs["units"])
            yield f"  {kind} at {parameter} = {value}, hits at {hits} m/s{at_phase}"


def _stable_intervals(branch: xr.Dataset, parameter: str) -> Iterator[tuple[float, float]]:
    """Yield the intervals of stable, admissible orbits, up to the special points that end them."""
    good = (branch["stable"].values == 1) & (branch["admissible"].values == 1)
    values, special = branch[parameter].values, branch["special_value"].values
    for stable, run in groupby(range(len(values)), key=lambda i: bool(good[i])):
        rows = list(run)
        if stable and len(rows) > 1:
            first, last = max(rows[0] - 1, 0), min(rows[-1] + 1, len(values) - 1)
            ends = [at for at in (first, last) if values[at] in special]  # stable or not by rounding alone
            part = values[[*rows, *ends]]
            yield float(part.min()), float(part.max())


def _varied(part: xr.Dataset) -> list[str]:
    return [str(name) for name, coord in part.coords.items() if coord.dims == ("point",)]


def _boundaries(dataset: xr.Dataset) -> Iterator[str]:
    curves = unbundle(dataset)
    yield f"{counted(len(curves), 'curve')} in the plane of {listed(_varied(curves[0]))}"
    meanings = str(dataset["kind"].attrs["flag_meanings"]).split()
    for curve in curves:
        where = ", ".join(axis_range(curve, name) for name in _varied(curve))
        size, residual = counted(curve.sizes["point"], "point"), float(curve["residual"].max())
        kind = _spaced(meanings[int(curve["kind"])])
        yield f"  {kind} of {_that_ends(curve)}: {where} ({size}, residual at most {residual:.0e})"
    yield from filter(None, dataset.attrs.get("message", "").split("; "))


def _that_ends(curve: xr.Dataset) -> str:
    """Return the motion that a curve bounds: at velocity 0 the steady one; or that it is no attractor there."""
    if not np.nanmax(curve["velocity"].values, initial=0.0) > 0.0 and curve.attrs["n_impacts"] > 0:
        return "the motion without impacts, which first touches the stop"
    grazes = str(curve["kind"].attrs["flag_meanings"]).split()[int(curve["kind"])] == "grazing"
    stable = curve["stable"].values == 1
    if not grazes or stable.all():
        return _orbit_type(curve)
    return f"{_orbit_type(curve)}, " + (f"stable at {stable.sum()} of these points" if stable.any() else "unstable")


# Basins and comparisons


def _basins(dataset: xr.Dataset) -> Iterator[str]:
    field = dataset["attractor"]
    axes = [str(dim) for dim in field.dims]
    shape = " x ".join(str(dataset.sizes[axis]) for axis in axes)
    yield f"{shape} initial conditions: " + "; ".join(axis_range(dataset, axis) for axis in axes)
    names = [_spaced(name) for name in str(field.attrs["flag_meanings"]).split()[1:]]
    for name, at in zip(names, range(dataset.sizes["attractor_id"]), strict=True):
        attractor = dataset.isel(attractor_id=at)
        hardest, exponent = float(attractor["max_velocity"]), float(attractor["lyapunov"])
        hits = f", hardest hit {hardest:.4g} m/s" if math.isfinite(hardest) else ""
        rate = f", largest exponent {exponent:.4g} 1/s" if math.isfinite(exponent) else ""
        yield f"  {100 * float(attractor['share']):.3g} % {name}{hits}{rate}"
    undecided = field.values < 0
    for code, count in zip(*np.unique(dataset["status"].values[undecided], return_counts=True), strict=True):
        status = Status(int(code))
        unfinished = status in (Status.BUDGET, Status.INTERRUPTED)
        reason = status.sentence if unfinished else "neither a cycle nor certain chaos; raise `sample_impacts`"
        yield f"  {100 * count / field.size:.3g} % undecided: {reason}"


def _comparison(dataset: xr.Dataset) -> Iterator[str]:
    names = [str(name) for name in dataset["design"].values]
    yield f"{names[0]} and {names[1]}: {' and '.join(map(str, dataset['motion'].values))}"
    for name in (name for name in (*oscillator_of(dataset).parameters, *INDICES) if name in dataset):
        scales = [spread_scale(name, float(speed)) for speed in dataset["max_velocity"].values]
        first, second = map(shown_spread, dataset[name].values.tolist(), scales)
        units = dataset[name].attrs["units"]
        yield f"  {dataset[name].attrs['long_name']}: {quantity(first, units, 6)} and {quantity(second, units, 6)}"
        if name == "omega":
            first, second = first / (2.0 * math.pi), second / (2.0 * math.pi)
            yield f"  driving frequency: {quantity(first, 'Hz', 6)} and {quantity(second, 'Hz', 6)}"


_SUMMARIES: dict[str, Callable[[xr.Dataset], Iterator[str]]] = {
    "simulate": _simulation,
    "impact_section": _impacts,
    "stroboscopic_section": _stroboscopic,
    "bifurcation_diagram": _diagram,
    "parameter_map": _map,
    "find_orbit": _orbits,
    "continue_orbit": _branches,
    "boundary_curves": _boundaries,
    "basins": _basins,
    "compare": _comparison,
}
