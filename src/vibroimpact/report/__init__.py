"""Results in words: what any function of the package returned, summed up in a few lines with units."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from vibroimpact.coexistence.attractor import distinct
from vibroimpact.coexistence.losses import why_undecided
from vibroimpact.dataset import arguments_of, bifurcation_name, flag_meanings, model_of, unbundle, varied_parameters
from vibroimpact.indices import EVERY, shown_spread, spread_scale
from vibroimpact.labels import displayed
from vibroimpact.motion import WITHOUT, cycle_name, listed, motion_along, motion_name
from vibroimpact.motion.recognition import recognise, recurrence
from vibroimpact.parameters import counted, hertz, times, with_unit
from vibroimpact.report.quantities import axis_range, initial_condition, quantity, spaced, span
from vibroimpact.report.sweeps import diagram_sentences, map_sentences
from vibroimpact.report.systems import carried, each_stop, moving_columns, statistics_sentences, system_sentence
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr

    from vibroimpact.coexistence import Attractor
    from vibroimpact.model import Model

__all__ = ["attractor_sentences", "motion_of", "quantity", "sentences_of"]

IMPACTS, PER_LINE = 9, 3  # listed of a cycle at most, and in a line


def sentences_of(dataset: xr.Dataset) -> list[str]:
    """Return the lines that sum up a result of this package, fresh or loaded: one fact per line, with units.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> sentences_of(vi.impact_section(vi.ImpactOscillator(omega=2.0), sample_impacts=200))[0]
    'from rest at y = min(0, gap): period-1 impact-1, hits at 6.23 m/s every 3.14 s'
    """
    writer = _SUMMARIES.get(dataset.attrs.get("function", ""))
    if writer is None:
        raise ValueError(f"`dataset` must be a result of vibroimpact ({', '.join(_SUMMARIES)}), got another dataset")
    return list(writer(dataset))


# One motion


def _simulation(dataset: xr.Dataset) -> Iterator[str]:
    model: Any = model_of(dataset)
    time, speeds = dataset["time"].values, dataset["impact_velocity"].values
    if len(time):
        periods = f"{(time[-1] - time[0]) / model.period:.4g} driving periods of {model.period:.4g} s, "
        if not model.periodic or "pieces" in arguments_of(dataset):
            periods = ""
        yield f"{initial_condition(dataset, after=': ')}{periods}{time[0]:.4g} to {time[-1]:.4g} s"
        yield from _places(dataset)
    if len(speeds):
        at = dataset["impact_time"].values[speeds.argmax()]
        yield f"{counted(len(speeds), 'impact')}, the hardest at {speeds.max():.4g} m/s after {at:.4g} s"
    if "coordinate" in dataset.dims:
        yield from each_stop(dataset)
    elif rests := dataset.sizes.get("stick", 0):
        yield f"comes to rest at the stop {times(rests)}{carried(dataset, slice(None))}"
    yield from _ending(dataset)


def _places(dataset: xr.Dataset) -> Iterator[str]:
    """Yield the range of the displacement, or of each coordinate."""
    if "coordinate" not in dataset.dims:
        yield f"displacement {span(dataset['displacement'])}"
        return
    for at in range(dataset.sizes["coordinate"] if dataset["displacement"].size else 0):
        yield f"coordinate {at}: {span(dataset['displacement'].isel(coordinate=at))}"


def motion_of(section: xr.Dataset) -> str:
    """Return the motion of an impact section in a sentence."""
    model: Any = model_of(section)
    if "stop" in section:
        return system_sentence(section, model)
    return recognise(section).sentence(model.period)


def _impacts(dataset: xr.Dataset) -> Iterator[str]:
    yield initial_condition(dataset, after=": ") + motion_of(dataset)
    if speeds := dataset["velocity"].values.tolist():
        mean, std = np.mean(speeds), shown_spread(np.std(speeds), max(speeds))
        kept = f"{counted(len(speeds), 'impact')} kept"
        yield f"{kept}, {span(dataset['velocity'])}, mean {mean:.4g}, standard deviation {std:.4g} m/s"
        if "stop" in dataset:
            yield from each_stop(dataset)
        yield from _ending(dataset)


def _stroboscopic(dataset: xr.Dataset) -> Iterator[str]:
    several = "coordinate" in dataset.dims
    columns = moving_columns(dataset) if several else [dataset[name].values for name in ("displacement", "velocity")]
    n, start = recurrence(*columns), initial_condition(dataset, after=": ")
    if not n:
        yield f"{start}the samples taken once per driving period do not repeat"
    else:
        yield f"{start}period-{n}, repeats every {n * model_of(dataset).period:.3g} s"
    if several:
        yield from _places(dataset)
    for name in ("displacement", "velocity"):
        if dataset[name].size and not several:
            yield f"{name} {span(dataset[name])}"
    yield from _ending(dataset)


def _ending(dataset: xr.Dataset) -> Iterator[str]:
    status = Status(int(dataset["status"]))
    if status not in (Status.OK, Status.CLOSED):
        yield f"{spaced(status.word)}: {status.sentence}"


# Orbits, branches and boundaries


def _orbits(dataset: xr.Dataset) -> Iterator[str]:
    period = model_of(dataset).period
    yield dataset.attrs["message"]
    for at, reason in enumerate(json.loads(dataset.attrs["messages"])):
        orbit = dataset.isel(orbit=at)
        kind = "inadmissible" if reason else "stable" if bool(orbit["stable"]) else "unstable"
        length = int(orbit["n_periods"]) * period
        yield f"{at + 1}. {_orbit_type(orbit)}, {kind}, repeats every {length:.6g} s"
        if reason:
            yield f"   {reason}"
        yield from _cycle_of_impacts(orbit)
        if float(orbit.get("stuck_time", 0.0)) > 0.0:
            rest, release, stuck = (float(orbit[key]) for key in ("stick_phase", "release_phase", "stuck_time"))
            yield f"   at rest at the stop from phase {rest:.6g} to {release:.6g}, {stuck:.6g} s per cycle"
        yield f"   multipliers {_multipliers(orbit)}"


def _cycle_of_impacts(orbit: xr.Dataset) -> Iterator[str]:
    """Yield the impacts of a cycle, a few to a line."""
    stops = [f" on {stop}" for stop in orbit["stop"].values] if "stop" in orbit else [""] * orbit.sizes["impact"]
    rows = orbit["velocity"].values, orbit["phase"].values, stops
    hits = [f"{v:.6g} m/s at phase {phase:.6g}{stop}" for v, phase, stop in zip(*rows, strict=True) if math.isfinite(v)]
    parts = hits[:IMPACTS] + [f"and {len(hits) - IMPACTS} more"] * (len(hits) > IMPACTS)
    for first in range(0, len(parts), PER_LINE):
        comma = "," if first + PER_LINE < len(parts) else ""
        yield f"   {'hits at' if first == 0 else '       '} {', '.join(parts[first : first + PER_LINE])}{comma}"


def _multipliers_of(orbit: xr.Dataset) -> list[complex]:
    if "multiplier" in orbit.dims:
        return list(orbit["multiplier_real"].values + 1j * orbit["multiplier_imag"].values)
    return [complex(*(orbit[f"multiplier_{i}_{part}"] for part in ("real", "imag"))) for i in (1, 2)]


def _multipliers(orbit: xr.Dataset) -> str:
    first, *_, last = values = _multipliers_of(orbit)
    if "multiplier" in orbit.dims:
        return f"{len(values)}, the largest {_multiplier(first)}"
    if not any(values):
        return "0 and 0: a rest at the stop erases all memory"
    return _multiplier(first) if first.imag else f"{first.real:.6g} and {last.real:.6g}"


def _multiplier(value: complex) -> str:
    """Return a multiplier, with its conjugate if it is not real."""
    size = f"{value.real:.6g} ± {abs(value.imag):.6g} i, modulus {abs(value):.6g}"
    return size if value.imag else f"{value.real:.6g}"


def _orbit_type(part: xr.Dataset) -> str:
    """Return the type of an orbit."""
    n, p = (int(part[key]) for key in ("n_periods", "n_impacts"))
    return cycle_name(n, p, float(part.get("stuck_time", 0.0)) > 0.0 and not any(_multipliers_of(part)))


def _branches(dataset: xr.Dataset) -> Iterator[str]:
    branches = unbundle(displayed(dataset))
    for at, branch in enumerate(branches, start=1):
        (parameter,) = varied_parameters(branch)
        head = f"branch {at} of {len(branches)}, " if len(branches) > 1 else ""
        yield f"{head}{motion_along(branch)}: {counted(branch.sizes['point'], 'orbit')}, {branch.attrs['message']}"
        intervals = [f"{low:.6g} to {high:.6g}" for low, high in _stable_intervals(branch, parameter)]
        where = with_unit(listed(intervals), branch[parameter].attrs["units"])
        yield f"  stable for {parameter} {where}" if intervals else "  nowhere stable"
        kinds = flag_meanings(branch["special_kind"])
        for i in range(branch.sizes["special"]):
            point = branch.isel(special=i)
            speeds = [f"{v:.6g}" for v in point["special_velocity"].values if math.isfinite(v)]
            hits = f"hits at {listed(speeds)}" if len(speeds) <= IMPACTS else f"hardest hit {max(speeds, key=float)}"
            kind = bifurcation_name(kinds[int(point["special_kind"])])
            touch, does = float(point["special_touch_phase"]), "leaves" if kind == "end of sticking" else "touches"
            at_phase = f", {does} the stop at phase {touch:.6g}" if math.isfinite(touch) else ""
            value = quantity(float(point["special_value"]), point["special_value"].attrs["units"])
            yield f"  {kind} at {parameter} = {value}, {hits} m/s{at_phase}"


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


def _boundaries(dataset: xr.Dataset) -> Iterator[str]:
    curves = unbundle(displayed(dataset))
    yield f"{counted(len(curves), 'curve')} in the plane of {listed(varied_parameters(curves[0]))}"
    for curve in curves:
        ranges = ", ".join(axis_range(curve, name) for name in varied_parameters(curve))
        size, residual = counted(curve.sizes["point"], "point"), float(curve["residual"].max())
        kind = flag_meanings(curve["kind"])[int(curve["kind"])]
        motion = _bounded_motion(curve, grazes=kind == "grazing")
        yield f"  {bifurcation_name(kind)} of {motion}: {ranges} ({size}, residual at most {residual:.0e})"
    yield from filter(None, dataset.attrs.get("message", "").split("; "))


def _bounded_motion(curve: xr.Dataset, grazes: bool) -> str:
    """Return the motion that a curve bounds: at velocity 0 the steady one; or that it is no attractor there."""
    motion = motion_along(curve)
    if motion == WITHOUT:
        return f"{motion}, which first touches the stop"
    stable = curve["stable"].values == 1
    if not grazes or stable.all():
        return motion
    return f"{motion}, " + (f"stable at {stable.sum()} of these points" if stable.any() else "unstable")


def _response(dataset: xr.Dataset) -> Iterator[str]:
    dataset = displayed(dataset)
    (name,) = varied_parameters(dataset)
    units = dataset[name].attrs["units"]
    yield str(dataset.attrs["message"])
    amplitude, rms = (dataset[key].values for key in ("amplitude", "rms"))
    at = int(np.nanargmax(amplitude))
    stable = "stable" if dataset["stable"].values[at] else "unstable"
    largest, where = quantity(amplitude[at], "m", 6), quantity(dataset[name].values[at], units, 6)
    yield f"largest amplitude {largest} (rms {quantity(rms[at], 'm', 6)}) at {name} = {where}, {stable}"
    kinds, heights = flag_meanings(dataset["special_kind"]), dataset["special_amplitude"].values
    for code, value, height in zip(
        dataset["special_kind"].values, dataset["special_value"].values, heights, strict=True
    ):
        where = f"{name} = {quantity(value, units)}, amplitude {quantity(height, 'm', 6)}"
        yield f"  {bifurcation_name(kinds[int(code)])} at {where}"


# Basins and comparisons


def _basins(dataset: xr.Dataset) -> Iterator[str]:
    dataset = displayed(dataset)
    field = dataset["attractor"]
    axes = [str(dim) for dim in field.dims]
    shape = " x ".join(str(dataset.sizes[axis]) for axis in axes)
    yield f"{shape} initial conditions: " + "; ".join(axis_range(dataset, axis) for axis in axes)
    yield from (_attractor(*row) for row in _rows(dataset, [spaced(name) for name in flag_meanings(field)[1:]]))
    undecided = field.values < 0
    for code, count in zip(*np.unique(dataset["status"].values[undecided], return_counts=True), strict=True):
        status = Status(int(code))
        unfinished = status in (Status.BUDGET, Status.INTERRUPTED)
        reason = status.sentence if unfinished else why_undecided(model_of(dataset))
        yield f"  {100 * count / field.size:.3g} % undecided: {reason}"


def _attractors(dataset: xr.Dataset) -> Iterator[str]:
    columns = (dataset[name].values.tolist() for name in ("kind", "n_periods", "n_impacts"))
    names = distinct([motion_name(*row) for row in zip(*columns, strict=True)])
    yield from _of_attractors(_rows(dataset, names), model_of(dataset))


def attractor_sentences(attractors: Sequence[Attractor], model: Model) -> Iterator[str]:
    """Yield the content of a list of attractors: one per line, with the share of the initial conditions."""
    names = distinct([attractor.name for attractor in attractors])
    rows = [(name, one.share, one.max_velocity, one.lyapunov) for name, one in zip(names, attractors, strict=True)]
    yield from _of_attractors(rows, model.at())


Row = tuple[str, float, float, float]  # of an attractor: name, share, hardest hit, exponent


def _rows(dataset: xr.Dataset, names: list[str]) -> list[Row]:
    columns = (dataset[key].values.tolist() for key in ("share", "max_velocity", "lyapunov"))
    return list(zip(names, *columns, strict=True))


def _of_attractors(rows: list[Row], design: Any) -> Iterator[str]:
    yield f"{counted(len(rows), 'attractor')} found; shares of the initial conditions:"
    yield from (_attractor(*row) for row in rows)
    undecided = 1.0 - sum(share for _, share, _, _ in rows)
    if undecided > 1e-9:
        yield f"  {100 * undecided:.3g} % undecided: {why_undecided(design)}"


def _attractor(name: str, share: float, hardest: float, exponent: float) -> str:
    hits = f", hardest hit {hardest:.4g} m/s" if math.isfinite(hardest) else ""
    rate = f", largest exponent {exponent:.4g} 1/s" if math.isfinite(exponent) else ""
    return f"  {100 * share:.3g} % {name}{hits}{rate}"


def _comparison(dataset: xr.Dataset) -> Iterator[str]:
    names = [str(name) for name in dataset["design"].values]
    yield f"{names[0]} and {names[1]}: {' and '.join(map(str, dataset['motion'].values))}"
    for name in (name for name in (*model_of(dataset).parameters, *EVERY, "worst_velocity") if name in dataset):
        scales = [spread_scale(name, float(speed)) for speed in dataset["max_velocity"].values]
        first, second = map(shown_spread, dataset[name].values.tolist(), scales)
        units = dataset[name].attrs["units"]
        yield f"  {dataset[name].attrs['long_name']}: {quantity(first, units, 6)} and {quantity(second, units, 6)}"
        if name == "omega":
            first, second = hertz(first), hertz(second)
            yield f"  driving frequency: {quantity(first, 'Hz', 6)} and {quantity(second, 'Hz', 6)}"


_SUMMARIES: dict[str, Callable[[xr.Dataset], Iterator[str]]] = {
    "simulate": _simulation,
    "impact_section": _impacts,
    "impact_statistics": statistics_sentences,
    "stroboscopic_section": _stroboscopic,
    "bifurcation_diagram": diagram_sentences,
    "parameter_map": map_sentences,
    "classify": map_sentences,
    "attractors": _attractors,
    "find_orbit": _orbits,
    "continue_orbit": _branches,
    "response_curve": _response,
    "continue_boundary": _boundaries,
    "boundary_curves": _boundaries,
    "basins": _basins,
    "compare": _comparison,
}
