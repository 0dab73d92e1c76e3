"""Stability maps: an index over a grid of parameters."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from contextlib import closing
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from vibroimpact import memory
from vibroimpact.axes import check_axes
from vibroimpact.backends import ImpactWindow, check_told, get_backend
from vibroimpact.backends.starts import check_start, make_cells
from vibroimpact.dataset import missing, provenance, status_variable, variable
from vibroimpact.execution.threads import check_alone, run_sweep, worker_count
from vibroimpact.indices import check_indices
from vibroimpact.options import Sampling, Tolerances
from vibroimpact.oscillator import ImpactOscillator, State, check_oscillator
from vibroimpact.parameters import whole_number
from vibroimpact.progress import Report, Stop, reporter
from vibroimpact.request import Request
from vibroimpact.status import Status

if TYPE_CHECKING:
    from distributed import Client

FINE_CELL = 30  # bytes a cell of a refined map takes


def parameter_map(
    osc: ImpactOscillator,
    *,
    indices: Iterable[str] = ("std",),
    backend: str = "cpu",
    time_step: float | None = None,
    transient_impacts: int = 100,
    sample_impacts: int = 5000,
    start: State | None = None,
    early_closing: bool = True,
    tolerances: Tolerances | None = None,
    workers: int | None = None,
    store: str | os.PathLike[str] | None = None,
    tile: int | None = None,
    cluster: Client | str | None = None,
    refine: int | None = None,
    jump: float | None = None,
    progress: bool | Report = False,
    **axes: ArrayLike,
) -> xr.Dataset:
    r"""Return indices of the impacts over a grid of one, two or more parameters (the paper's stability maps).

    .. math:: \mathrm{Std} = \sqrt{\tfrac1N \sum_i |I_i - \mu|^2}, \quad
              \mu = \tfrac1N \sum_i I_i, \quad I_i \text{ the impact velocities}

    Parameters
    ----------
    osc : ImpactOscillator
        The parameters that no axis varies.
    indices : names
        Any of `std`, `mean_velocity`, `max_velocity` (m/s), `impacts_per_period` = (N-1) T/(t_N - t_1), told by sums of
        velocities; and of those that need all observers and cost 1.6 times as much: `lyapunov` (1/s) and
        `lyapunov_per_impact`, the largest exponent, -inf for motions that stick; `n_periods` and `n_impacts`, the
        name of the cycle, 0 where none was found, n_impacts = -1 for complete chatter; `dissipation` (J a period);
        `stick_fraction`; `impact_phase_spread` = 1 - \|<exp 2 pi i phase>\|; `grazing_margin` (m), the least gap that
        is no contact, inf where there is none.
    backend : {"cpu", "cuda", "reference", "fixed-step"}
        Who computes; `time_step` in s is for "fixed-step" alone.
    transient_impacts, sample_impacts : int, >= 0 and >= 1
        Impacts left out, then kept, in every cell.
    start : State, optional
        Where every cell starts; None is at rest at min(0, gap), time 0.
    early_closing : bool
        Whether a cell stops once all its remaining impacts are known: its sums are then finished in closed form, and
        every index is what all impacts would give, within 1e-10 of the velocity scale. False computes every impact.
    tolerances : Tolerances, optional
        How small is small.
    workers : int, optional
        Threads; None is one a core. The result does not depend on it.
    store : path, optional
        A folder ending in .zarr into which tiles are written as they finish. Where the same study stands there, what
        it lacks is computed and the rest is taken as it is, once its checksums are verified; another study is refused.
        The Dataset returned reads from it. Memory is bounded by the tiles in flight.
    tile : int, >= 1, optional
        Cells of a tile in a store or on a cluster, about; 4096 by default, 4 with the slow back ends "reference" and
        "fixed-step". A store keeps the tiles it was made with.
    cluster : dask.distributed.Client or str, optional
        Computes on the workers of a Dask cluster instead of here: a client, `tcp://HOST:PORT` of a running scheduler,
        or `local:N` for N processes of this machine. Workers may come, go and die; those that see the store write
        their tiles there themselves. The result does not depend on them.
    refine, jump : int and float, optional
        Halve the intervals of two axes `refine` times, but compute only where the motion, or an index by more than
        `jump`, changes; see `refined_map`.
    progress : bool or callable
        True shows a bar; a callable gets (cells done, cells in all, Dataset so far) and stops the sweep by returning
        False: the Dataset so far is returned, unfinished cells `interrupted`.
    **axes : sequences of numbers
        Values of parameters by name, strictly increasing; `frequency` in Hz may stand for `omega`.

    Returns
    -------
    xarray.Dataset
        One variable an index and `status`, over the axes in the order given. An index is NaN where it has no value;
        the status says why. `attrs` count the impacts and certified steps computed.

    Raises
    ------
    ValueError
        No axis, an axis that is empty, unsorted, misnamed or out of range, an unknown index or back end, a start
        beyond the stop anywhere on the grid, another study in the store, `workers` together with `cluster`; a grid
        that this machine's memory cannot hold (250 bytes a cell, 8 more for each further index) without `store`.
    OSError
        The store cannot be read or written, or another process writes to it; no scheduler answers.

    Notes
    -----
    `impacts_per_period` is exactly p/n wherever a cycle of n periods and p impacts closed, whether or not its impacts
    were computed. Sums run over velocities shifted by the first one, free of cancellation. Each cell's numbers are the
    same bits on whatever grid, tile or thread it is computed. Of a cycle that is certain (its Jacobian is stable and it
    lies within 1e-10 of the velocity scale of the periodic orbit; at most 4096 impacts) exponent, dissipation, rest and
    margin are those of the cycle: the exponent is ln of the spectral radius over its time. Other exponents and
    dissipations err as one over the number of impacts, other margins by 1e-5 of the motion's size; ripples of the gap
    shorter than half a radian of the fastest rate are overlooked. About 0.1 microseconds an impact and core; closing
    leaves a sixth of the impacts to compute over the paper's maps.

    References
    ----------
    .. [1] J.-Y. Lee, eq. (2) and section 4.

    Examples
    --------
    >>> sweep = parameter_map(ImpactOscillator(), omega=[2.0, 2.8], mass=[1.0, 2.0], sample_impacts=200)
    >>> sweep["std"].dims
    ('omega', 'mass')
    >>> float(sweep["std"].sel(omega=2.0, mass=1.0)) < 1e-9
    True
    """
    check_oscillator(osc)
    if refine is not None:
        from vibroimpact.refinement import refined_map

        _check_room_refined(axes, whole_number("refine", refine, 1))
        how: dict[str, Any] = {"transient_impacts": transient_impacts, "sample_impacts": sample_impacts, "start": start}
        how |= {"backend": backend, "time_step": time_step, "early_closing": early_closing, "tolerances": tolerances}
        how |= {"workers": workers, "store": store, "tile": tile, "cluster": cluster, "indices": indices, **axes}
        how |= {"progress": progress}
        return refined_map(osc, refine=refine, jump=jump, **how)
    check_start(start)
    chosen = check_indices(indices)
    grid = check_axes(axes)
    if not grid:
        raise ValueError(
            "no axis is given; allowed is any parameter's list of values; write for example omega=[1, 2, 3]"
        )
    sampling = Sampling(transient_impacts=transient_impacts, sample_impacts=sample_impacts)
    window = ImpactWindow(sampling.transient_impacts, sampling.sample_impacts)
    threads = worker_count(workers)
    if cluster is not None:
        _check_place(cluster, workers)
    if cluster is None or backend != "cuda":  # the GPUs are those of the workers
        check_told(chosen, get_backend(backend, time_step=time_step))
    limits = tolerances or Tolerances()
    request = Request(osc, grid, chosen, window, limits, start, backend, time_step, early_closing)
    size = None if tile is None else whole_number("tile", tile, 1)
    if store is not None:
        make_cells(osc, start, {name: values for name, values in grid.items() if name == "gap"})  # refuses a bad start
        with reporter(progress, "cells") as report:
            return _run_into_store(request, store, cluster, threads, size, report)
    _check_room(request)
    cells = make_cells(osc, start, grid)

    dataset, flat = _empty_map(osc, grid, chosen)
    dataset.attrs |= provenance("parameter_map", osc, request.arguments())
    done, stop = 0, Stop(progress)
    parts: Any
    if cluster is None:
        engine = get_backend(backend, time_step=time_step)
        parts = run_sweep(engine, cells, window, limits, early_closing, chosen, threads, stop)
    else:
        from vibroimpact.execution.cluster import in_memory

        parts = in_memory(cluster, request, size or request.usual_tile, stop)
    with reporter(progress, "cells") as report, closing(parts):
        for which, result in parts:
            for name in (*chosen, "status"):
                flat[name][which] = result[name]
            for count in ("impacts", "steps"):
                dataset.attrs[f"{count}_computed"] += int(result[count].sum())
            done += len(result["status"])
            if report(done, len(cells), dataset) is False:
                stop.set()
    return dataset


def _check_room(request: Request) -> None:
    """Refuse a map that this machine's memory cannot hold."""
    size = math.prod(request.shape) * (memory.CELL + memory.INDEX * (len(request.indices) - 1))
    remedy = "write it to disk tile by tile, store='run.zarr' or --out run.zarr, or take fewer points"
    memory.check_fits("axes", f"span {_spanned(request.shape)}, which take", size, remedy)


def _check_room_refined(axes: Mapping[str, Any], levels: int) -> None:
    """Refuse a refined map that memory cannot hold; a store does not help it, as it is filled in as a whole."""
    from vibroimpact.refinement.maps import DEEPEST

    shape = tuple(((len(values) - 1) << min(levels, DEEPEST)) + 1 for values in check_axes(axes).values())
    size = math.prod(shape) * FINE_CELL
    memory.check_fits("refine", f"makes {_spanned(shape)}, which take", size, "refine less, or take fewer points")


def _spanned(shape: tuple[int, ...]) -> str:
    return f"{' x '.join(map(str, shape))} = {math.prod(shape):,} cells"


def _check_place(cluster: Client | str, workers: int | None) -> None:
    from vibroimpact.execution.cluster import check_cluster

    check_cluster(cluster)
    check_alone(workers)


# What needs Zarr and Dask is imported where a store or a cluster is asked for: a first map does not wait for them.
def _run_into_store(
    request: Request,
    store: str | os.PathLike[str],
    cluster: Client | str | None,
    threads: int,
    size: int | None,
    report: Report,
) -> xr.Dataset:
    from vibroimpact.execution.store import in_threads, run_into_store

    if cluster is None:
        return run_into_store(request, store, in_threads(threads), report, size)
    from vibroimpact.execution.cluster import on_cluster

    return run_into_store(request, store, on_cluster(cluster), report, size)


def _empty_map(
    osc: ImpactOscillator, grid: dict[str, NDArray[np.float64]], chosen: tuple[str, ...]
) -> tuple[xr.Dataset, dict[str, NDArray[Any]]]:
    """Return a map in which no cell is done, and flat views of its variables to fill."""
    shape = tuple(len(values) for values in grid.values())
    arrays: dict[str, NDArray[Any]] = {name: missing(name, shape) for name in chosen}
    arrays["status"] = np.full(shape, Status.INTERRUPTED, np.int8)
    labelled = {name: variable(name, tuple(grid), arrays[name]) for name in chosen}
    labelled["status"] = status_variable(tuple(grid), arrays["status"])
    coords = {name: variable(name, name, values) for name, values in grid.items()}
    dataset = xr.Dataset(labelled, coords=coords, attrs={"impacts_computed": 0, "steps_computed": 0})
    return dataset, {name: array.reshape(-1) for name, array in arrays.items()}
