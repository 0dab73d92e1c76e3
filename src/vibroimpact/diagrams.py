"""Bifurcation diagrams: a section over one parameter."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import fields, replace
from threading import Event
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from vibroimpact import memory
from vibroimpact.axes import check_axes
from vibroimpact.backends import (
    Backend,
    Cells,
    ImpactWindow,
    Samples,
    StroboscopicWindow,
    check_told,
    get_backend,
)
from vibroimpact.backends.starts import check_start, make_cells
from vibroimpact.dataset import impact_speed, missing, provenance, status_variable, variable
from vibroimpact.execution.threads import run_sweep, run_tiles, tiles, worker_count
from vibroimpact.indices import check_indices
from vibroimpact.options import Sampling, Tolerances
from vibroimpact.oscillator import ImpactOscillator, State
from vibroimpact.progress import Report, Stop, reporter
from vibroimpact.sections import section_phase
from vibroimpact.status import Status

SECTIONS = ("impact", "stroboscopic")
DIRECTIONS = ("fresh", "up", "down")
# Values sampled at once, at least and at most: lanes are full, and progress is heard. Of long windows there are fewer,
# no more than have AT_ONCE impacts or periods together, so that they are soon done and fit into memory.
FEW, MANY, AT_ONCE = 32, 64, 400_000


def bifurcation_diagram(
    osc: ImpactOscillator,
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
    start: State | None = None,
    tolerances: Tolerances | None = None,
    workers: int | None = None,
    progress: bool | Report = False,
    **axis: ArrayLike,
) -> xr.Dataset:
    """Return a section's points over one parameter (the paper's bifurcation diagrams).

    Parameters
    ----------
    osc : ImpactOscillator
        The parameters that the axis does not vary.
    section : {"impact", "stroboscopic"}
        Velocities and phases at impacts, or displacement and velocity once a period.
    direction : {"fresh", "up", "down"}
        Start every value anew, or go up or down the axis and start each where the one before ended: clearance to the
        stop, velocity and phase are carried along, which shows hysteresis.
    backend : {"cpu", "cuda", "reference", "fixed-step"}
        Who computes; `time_step` in s is for "fixed-step" alone.
    transient_impacts, sample_impacts : int, >= 0 and >= 1
        Impacts left out, then kept (section "impact").
    phase : float, 0 <= phase < 1
        When to look (section "stroboscopic").
    transient_periods, sample_periods : int, >= 0 and >= 1
        Periods left out, then kept (section "stroboscopic").
    indices : names
        Indices of `parameter_map` to tell of each value too, over `transient_impacts` and `sample_impacts` from the
        same start; none by default.
    start : State, optional
        The start of every value, or of the first one; None is at rest at min(0, gap), time 0.
    tolerances : Tolerances, optional
        How small is small.
    workers : int, optional
        Threads for fresh starts; None is one a core. A carried state leaves nothing to share.
    progress : bool or callable
        True shows a bar; a callable gets (values done, values in all, Dataset so far) and stops the sweep by returning
        False.
    **axis : sequence of numbers
        Exactly one parameter with strictly increasing values; `frequency` in Hz may stand for `omega`.

    Returns
    -------
    xarray.Dataset
        Dims (axis, `impact`) with `velocity` (m/s, before contact) and `phase`, or (axis, `period`) with `displacement`
        (m) and `velocity` (m/s); NaN-padded, with `count`, `status` and the indices asked for over the axis.

    Raises
    ------
    ValueError
        Not exactly one axis, or one that is empty, unsorted, misnamed or out of range; an unknown section, direction or
        back end; a start beyond the stop; more samples than fit into memory.

    Notes
    -----
    A carried state that could not be followed to the end (`budget`) is replaced by a fresh start at the next value.
    Fresh starts are followed side by side, at about 0.15 microseconds an impact and core; a carried state takes 0.7.

    References
    ----------
    .. [1] J.-Y. Lee, section 3, figures 2 and 3.

    Examples
    --------
    >>> diagram = bifurcation_diagram(ImpactOscillator(), omega=[2.0, 4.0], sample_impacts=10)
    >>> diagram["velocity"].dims
    ('omega', 'impact')
    """
    check_start(start)
    _one_of("section", section, SECTIONS)
    _one_of("direction", direction, DIRECTIONS)
    grid = check_axes(axis)
    if len(grid) != 1:
        given = ", ".join(grid) or "none"
        raise ValueError(f"the axes given are {given}; allowed is exactly one; use parameter_map for more")
    sampling = Sampling(transient_impacts, sample_impacts, transient_periods, sample_periods)
    window: ImpactWindow | StroboscopicWindow
    if section == "impact":
        window = ImpactWindow(sampling.transient_impacts, sampling.sample_impacts)
    else:
        window = StroboscopicWindow(sampling.transient_periods, sampling.sample_periods, section_phase(phase))
    threads = worker_count(workers)
    chosen = check_indices(indices) if indices else ()
    engine = get_backend(backend, time_step=time_step)
    check_told(chosen, engine)
    cells = make_cells(osc, start, grid)
    limits = tolerances or Tolerances()
    samples = len(cells) * window.keep
    remedy = f"take fewer points, or smaller `sample_{'impacts' if section == 'impact' else 'periods'}`"
    memory.check_fits("axes", f"hold {len(cells):,} values, {samples:,} samples, which take", 16 * samples, remedy)
    dataset = _empty_diagram(grid, section, window.keep, chosen)
    arguments = {
        "section": section,
        "direction": direction,
        "backend": backend,
        "time_step": time_step,
        "start": start,
        "window": window,
        "indices": chosen,
        "sample_impacts": sampling.sample_impacts,
    }
    dataset.attrs |= provenance("bifurcation_diagram", osc, arguments)

    stop = Stop(progress)
    if direction == "fresh":
        columns = _fresh(engine, cells, window, limits, threads, stop)
    else:
        columns = _carried(engine, cells, window, limits, stop, upward=direction == "up")
    begun: list[tuple[int, Cells]] = []
    table = {str(name): values.values for name, values in dataset.data_vars.items()}
    with reporter(progress, "values") as report:
        for done, (at, cell, seen) in enumerate(columns, start=1):
            _fill(table, section, at, seen)
            begun.append((at, cell))
            if not stop.is_set() and report(done, len(cells), dataset) is False:
                stop.set()
    if chosen and begun:
        impacts = ImpactWindow(sampling.transient_impacts, sampling.sample_impacts)
        _fill_indices(dataset, engine, begun, impacts, limits, chosen, threads)
    return dataset.isel({_along(section): slice(0, max(int(dataset["count"].max()), 1))})


def _one_of(name: str, value: Any, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        raise ValueError(f"`{name}` is {value!r}; allowed are {', '.join(allowed)}; choose one of them")


def _along(section: str) -> str:
    return "impact" if section == "impact" else "period"


def _fresh(
    engine: Backend,
    cells: Cells,
    window: ImpactWindow | StroboscopicWindow,
    limits: Tolerances,
    threads: int,
    stop: Event,
) -> Iterator[tuple[int, Cells, Samples]]:
    left_out = window.transient if isinstance(window, ImpactWindow) else window.skip_periods
    most = min(max(AT_ONCE // (left_out + window.keep), 1), MANY, engine.largest_tile)
    parts = tiles(len(cells), threads, min(engine.smallest_tile, FEW, most), most)
    for part, column in run_tiles(lambda part: engine.samples(cells[part], window, limits), parts, threads, stop):
        for at, seen in enumerate(column, start=part.start):
            yield at, cells[at : at + 1], seen


def _carried(
    engine: Backend,
    cells: Cells,
    window: ImpactWindow | StroboscopicWindow,
    limits: Tolerances,
    stop: Event,
    *,
    upward: bool,
) -> Iterator[tuple[int, Cells, Samples]]:
    order = range(len(cells)) if upward else range(len(cells) - 1, -1, -1)
    before: Samples | None = None
    for at in order:
        if stop.is_set():
            return
        cell = cells[at : at + 1]
        if before is not None and np.isfinite(before.last_clearance):
            cell = replace(
                cell,
                clearance=np.array([before.last_clearance]),
                velocity=np.array([before.last_velocity]),
                periods=np.zeros(1),
                phase=np.array([before.last_phase]),
            )
        (seen,) = engine.samples(cell, window, limits)
        before = None if seen.status == Status.BUDGET else seen
        yield at, cell, seen


def _empty_diagram(
    grid: dict[str, NDArray[np.float64]], section: str, keep: int, indices: tuple[str, ...]
) -> xr.Dataset:
    ((name, values),) = grid.items()
    dims, shape = (name, _along(section)), (len(values), keep)
    first, second = np.full(shape, np.nan), np.full(shape, np.nan)
    if section == "impact":
        points = {"velocity": impact_speed(dims, first), "phase": variable("phase", dims, second)}
    else:
        points = {"displacement": variable("displacement", dims, first), "velocity": variable("velocity", dims, second)}
    return xr.Dataset(
        {
            **points,
            "count": variable("count", name, np.zeros(len(values), np.int64)),
            "status": status_variable(name, np.full(len(values), Status.INTERRUPTED)),
            **{index: variable(index, name, missing(index, len(values))) for index in indices},
        },
        coords={name: variable(name, name, values)},
    )


def _fill(table: dict[str, NDArray[Any]], section: str, at: int, seen: Samples) -> None:
    if section == "impact":
        points = {"velocity": seen.impact_velocity, "phase": seen.impact_phase}
    else:
        points = {"displacement": seen.look_displacement, "velocity": seen.look_velocity}
    for name, column in points.items():
        table[name][at, : len(column)] = column
    table["count"][at] = len(column)
    table["status"][at] = seen.status


def _fill_indices(
    dataset: xr.Dataset,
    engine: Backend,
    begun: list[tuple[int, Cells]],
    window: ImpactWindow,
    limits: Tolerances,
    names: tuple[str, ...],
    threads: int,
) -> None:
    """Tell the indices of every value from the start that its section had."""
    where = np.array([at for at, _ in begun])
    columns = {field.name: np.concatenate([getattr(cell, field.name) for _, cell in begun]) for field in fields(Cells)}
    for which, result in run_sweep(engine, Cells(**columns), window, limits, True, names, threads, Event()):
        for name in names:
            dataset[name].values[where[which]] = result[name]
