"""Bifurcation diagrams: a section over one parameter."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from threading import Event
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vibroimpact.backends import (
    Backend,
    ImpactWindow,
    Measurement,
    StroboscopicWindow,
    Window,
    check_known,
    check_takes,
    chosen_indices,
    get_backend,
    observed_by,
)
from vibroimpact.cells import Cells
from vibroimpact.dataset import dataset_of, flags, impact_speed, missing, status_variable, variable
from vibroimpact.execution.threads import run_sweep, run_tiles, tiles, worker_count
from vibroimpact.labels import phase_variable
from vibroimpact.model import Model, State, check_model, one_start
from vibroimpact.options import Sampling, Tolerances
from vibroimpact.parameters import check_fits, check_steps, choice, invalid, phase_number, several, whole_number
from vibroimpact.progress import Report, Stop, reporter
from vibroimpact.request import COSTLY, Request, check_apart, check_axes, units_of
from vibroimpact.sections import of_any_length
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr

SECTIONS = ("impact", "stroboscopic")
DIRECTIONS = ("fresh", "up", "down")
# Values sampled at once, at least and at most: enough to fill the lanes, and few enough to report progress. For long
# windows there are fewer: together no more than AT_ONCE impacts or periods, so that they end soon and fit into memory.
FEW, MANY, AT_ONCE = 32, 64, 400_000


def bifurcation_diagram(
    osc: Model,
    *,
    section: str = "impact",
    direction: str = "fresh",
    backend: str = "cpu",
    time_step: float | None = None,
    transient_impacts: int = 100,
    sample_impacts: int = 5000,
    phase: float = 0.0,
    transient_periods: int = 200,
    sample_periods: int = 500,
    indices: Iterable[str] = (),
    of: Any = None,
    start: State | None = None,
    coordinate: int = 0,
    tolerances: Tolerances | None = None,
    workers: int | None = None,
    progress: bool | Report | None = None,
    **axis: ArrayLike,
) -> xr.Dataset:
    """Return the points of a section over one parameter (the paper's bifurcation diagrams).

    Parameters
    ----------
    osc : ImpactOscillator, ImpactSystem or family
        The parameters that the axis does not vary.
    section : {"impact", "stroboscopic"}
        Velocities and phases at impacts, or displacement and velocity once per period.
    direction : {"fresh", "up", "down"}
        "fresh" takes the same initial condition for every value. "up" and "down" go along the axis and begin at each
        value with the final state of the previous one, which shows hysteresis. That state is clearance, velocity and
        phase, or for systems coordinates, velocities and phase. If the next value's stops are in the way, the motion
        continues from the nearest position in front of them.
    backend, time_step, tolerances
        As in `simulate`.
    transient_impacts, sample_impacts : int, >= 0 and >= 1
        Impacts to skip, then to keep (section "impact").
    phase, transient_periods, sample_periods
        As in `stroboscopic_section` (section "stroboscopic").
    indices : names or "all"
        Indices of `parameter_map` to compute for each value as well, over `transient_impacts` and `sample_impacts` from
        the same initial condition; none by default.
    of : str, int or sequence of n float, optional
        What the indices of displacements are of, as in `parameter_map`.
    start : State, optional
        Initial condition of every value ("fresh") or of the first one; None means at rest at min(0, gap) at time 0.
    coordinate : int, >= 0
        For systems, the coordinate to return (section "stroboscopic"); 0 is the first.
    workers : int, optional
        Threads for direction "fresh"; None means one per core. The other directions use one thread.
    progress : bool or callable, optional
        None shows a temporary line on a terminal or in a notebook if it takes more than a second.
        True shows a bar; a callable gets (values done, values in all, Dataset so far) and stops the sweep by returning
        False.
    **axis : sequence of numbers
        Exactly one parameter with strictly increasing values; `frequency` in Hz may replace `omega`. Figures and
        summaries show a quantity of pint in its own unit.

    Returns
    -------
    xarray.Dataset
        Dims (axis, `impact`) with `velocity` (m/s, before contact) and `phase`, or (axis, `period`) with `displacement`
        (m) and `velocity` (m/s); NaN-padded, with `count`, `status` and the `indices` over the axis. For systems,
        `stop` is the number of the stop hit; its flag meanings are the names of the stops.

    Raises
    ------
    ValueError
        There is not exactly one axis, or it is empty, unsorted, misnamed or out of range; the section, direction or
        back end is unknown; the initial condition lies beyond the stop; the samples do not fit into memory.

    Notes
    -----
    If a motion could not be followed to the end (`budget`), the next value begins at `start` again. Direction "fresh"
    follows many values at once, at about 0.15 microseconds per impact and core; the others take 0.7.

    References
    ----------
    .. [1] J.-Y. Lee, section 3, figures 2 and 3.

    Examples
    --------
    >>> from vibroimpact import ImpactOscillator
    >>> diagram = bifurcation_diagram(ImpactOscillator(), omega=[2.0, 4.0], sample_impacts=10)
    >>> diagram["velocity"].dims
    ('omega', 'impact')
    """
    check_model(osc)
    design = osc.at()
    choice("section", section, SECTIONS)
    choice("direction", direction, DIRECTIONS)
    axes = check_axes(axis, osc.parameters)
    if len(axes) != 1:
        got = ", ".join(f"`{name}`" for name in axes) or "no axis"
        raise ValueError(f"give exactly one axis, such as `omega`, got {got}; use parameter_map for more")
    sampling = Sampling(transient_impacts, sample_impacts, transient_periods, sample_periods)
    impacts = ImpactWindow(sampling.transient_impacts, sampling.sample_impacts)
    window: Window = impacts
    if section == "stroboscopic":
        window = StroboscopicWindow(sampling.transient_periods, sampling.sample_periods, phase_number("phase", phase))
    threads = worker_count(workers)
    engine = get_backend(backend, time_step=time_step)
    named = indices if isinstance(indices, str) else several("indices", indices, "a list of names of indices")
    chosen = chosen_indices(named, engine) if named else ()
    check_known(chosen, engine, design)
    check_apart(axes, chosen)
    check_takes(engine, design)
    if whole_number("coordinate", coordinate, 0) >= design.coordinates:
        raise invalid("coordinate", coordinate, f"less than the number of coordinates, {design.coordinates}")
    observed = observed_by(named, design, of) if named or of is not None else None
    measurement = Measurement(window, Tolerances.of(tolerances), indices=chosen, of=observed)
    units = units_of(axis, osc.parameters)
    request = Request(osc, axes, measurement, one_start(start), engine.sampler, time_step, of, units=units)
    cells = request.cells()
    total = len(cells) * window.keep
    hint = f"use fewer points, or smaller `sample_{_along(section)}s`"
    check_fits("axes", f"hold {len(cells):,} values, {total:,} samples, which take", 16 * total, hint)
    what = f"hold {len(cells):,} values of {_length(window):,} {_along(section)}s each, which take"
    check_steps("axes", what, len(cells) * _length(window), COSTLY)
    dataset = _empty_diagram(request, section, window.keep, () if design.says_all else design.stop_names)
    further: dict[str, Any] = {
        "section": section,
        "direction": direction,
        "window": window,
        "sample_impacts": impacts.keep,
    }
    if coordinate:
        further["coordinate"] = coordinate
    if chosen and engine.sampler != engine.name:
        further["indices_backend"] = engine.name
    dataset.attrs |= replace(request, further=further).provenance("bifurcation_diagram")

    stop = Stop(progress)
    if direction == "fresh":
        columns = _fresh(engine, cells, measurement, threads, stop)
    else:
        columns = _carried(engine, cells, measurement, stop, upward=direction == "up")
    finished: list[int] = []
    table = {str(name): values.values for name, values in dataset.data_vars.items()}
    with reporter(progress, "values") as report:
        for at, samples in ((at, of_any_length(samples, design)) for at, samples in columns):
            _fill(table, section, at, samples, coordinate)
            if section == "impact" and not design.periodic:
                table["phase"][at] = np.nan
            finished.append(at)
            if not stop.is_set() and report(len(finished), len(cells), dataset) is False:
                stop.set()
    if chosen and finished:
        # Every value that has its section gets its indices, even in a stopped diagram: this sweep is not stopped.
        rows, measured = np.array(finished), replace(request.measured, window=impacts)
        for which, result in run_sweep(engine, cells[rows], measured, threads, Event()):
            for name in measured.indices:
                table[name][rows[which]] = result[name]
    return dataset.isel({_along(section): slice(0, max(int(dataset["count"].values.max()), 1))})


def _along(section: str) -> str:
    return "impact" if section == "impact" else "period"


def _length(window: Window) -> int:
    """Return the number of impacts or periods of a window, including the skipped ones."""
    return window.transient + window.keep if isinstance(window, ImpactWindow) else math.ceil(window.length)


def _fresh(
    engine: Backend, cells: Cells, measurement: Measurement, threads: int, stop: Event
) -> Iterator[tuple[int, Any]]:
    most = min(max(AT_ONCE // _length(measurement.window), 1), MANY, engine.largest_tile)
    parts = tiles(len(cells), threads, min(engine.smallest_tile, FEW, most), most)
    for part, column in run_tiles(lambda part: engine.samples(cells[part], measurement), parts, threads, stop):
        yield from enumerate(column, start=part.start)


def _carried(
    engine: Backend, cells: Cells, measurement: Measurement, stop: Event, *, upward: bool
) -> Iterator[tuple[int, Any]]:
    """Yield each value's samples, and write the initial conditions that are carried along into `cells`."""
    order = range(len(cells)) if upward else range(len(cells) - 1, -1, -1)
    before: Any = None
    for at in order:
        if stop.is_set():
            return
        cell = cells[at : at + 1]
        if before is not None:
            cell = cell.continuing(before)
            cells.table[at] = cell.table
        (samples,) = engine.samples(cell, measurement)
        before = None if samples.status == Status.BUDGET else samples
        yield at, samples


def _empty_diagram(request: Request, section: str, keep: int, stops: tuple[str, ...]) -> xr.Dataset:
    (name,), (number,) = request.dims, request.shape
    dims, shape = (name, _along(section)), (number, keep)
    first, second = np.full(shape, np.nan), np.full(shape, np.nan)
    if section == "impact":
        points = {"velocity": impact_speed(dims, first), "phase": phase_variable(dims, second, request.model.at())}
        if stops:
            points["stop"] = flags(dims, np.full(shape, -1), "stop that is struck", ["none", *stops], first=-1)
    else:
        points = {"displacement": variable("displacement", dims, first), "velocity": variable("velocity", dims, second)}
    return dataset_of(
        {
            **points,
            "count": variable("count", name, np.zeros(number, np.int64)),
            "status": status_variable(name, np.full(number, Status.INTERRUPTED)),
            **{
                index: variable(index, name, missing(index, number), **request.attrs_of(index))
                for index in request.indices
            },
        },
        coords=request.coordinates(),
    )


def _fill(table: dict[str, NDArray[Any]], section: str, at: int, samples: Any, coordinate: int) -> None:
    if section == "impact":
        points = {"velocity": samples.impact_velocity, "phase": samples.impact_phase}
        if "stop" in table:
            points["stop"] = samples.impact_stop
    else:
        points = {
            "displacement": samples.look_displacement[:, coordinate],
            "velocity": samples.look_velocity[:, coordinate],
        }
    for name, column in points.items():
        table[name][at, : len(column)] = column
    table["count"][at] = len(column)
    table["status"][at] = samples.status
