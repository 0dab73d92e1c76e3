"""Stability maps: an index over a grid of parameters."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Sequence
from contextlib import closing
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vibroimpact.backends import ImpactWindow, Measurement, check_takes, chosen_indices, get_backend, observed_by
from vibroimpact.dataset import missing
from vibroimpact.execution.base import usual_tile
from vibroimpact.execution.places import check_place, computing
from vibroimpact.model import Model, State, check_model
from vibroimpact.options import Sampling, Tolerances
from vibroimpact.parameters import STEPS, check_fits, truth, whole_number
from vibroimpact.progress import Report, Stop, reporter
from vibroimpact.request import Request, check_apart, check_axes, check_points, check_start, map_of, units_of
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr
    from distributed import Client

FINE_CELL = 30  # bytes per cell of a refined map


def parameter_map(
    osc: Model,
    *,
    points: Any = None,
    indices: Iterable[str] = ("std",),
    backend: str = "cpu",
    time_step: float | None = None,
    transient_impacts: int = 100,
    sample_impacts: int = 5000,
    start: State | Sequence[State | None] | int | None = None,
    early_closing: bool = True,
    by_stop: bool = False,
    of: Any = None,
    tolerances: Tolerances | None = None,
    workers: int | None = None,
    store: str | os.PathLike[str] | None = None,
    tile: int | None = None,
    cluster: Client | str | None = None,
    refine: int | None = None,
    jump: float | None = None,
    progress: bool | Report | None = None,
    **axes: ArrayLike,
) -> xr.Dataset:
    r"""Return indices of the impacts over a grid of one, two or more parameters (the paper's stability maps).

    .. math:: \mathrm{Std} = \sqrt{\tfrac1N \sum_i |I_i - \mu|^2}, \quad
              \mu = \tfrac1N \sum_i I_i, \quad I_i \text{ the impact velocities}

    Parameters
    ----------
    osc : ImpactOscillator, ImpactSystem or family
        The parameters that no axis varies.
    points : mapping or DataFrame, optional
        Columns of parameters, one design per row, instead of axes: a list of variants or a Monte Carlo sample. The
        result has a dim `point`.
    indices : names or "all"
        From velocity sums: `std`, `mean_velocity`, `max_velocity` (m/s), `impacts_per_period` = (N-1) T/(t_N - t_1).
        From all observers, at 1.3 times the cost: `lyapunov` (1/s) and `lyapunov_per_impact`, the largest exponent,
        -inf for motions that stick; `n_periods` and `n_impacts`, the type of the cycle, 0 if none was found,
        n_impacts = -1 for complete chatter; `dissipation` (J per period); `stick_fraction`; `impact_phase_spread` =
        1 - \|<exp 2 pi i phase>\|; `grazing_margin` (m), the gap left at the closest near-miss, inf without one.
        Over the impacts kept: `mean_force`, `max_force` of compliant stops (N), `work_rate` and `damper_rate` (W). Of a
        displacement over one cycle: `amplitude` (half peak to peak), `rms`, `mean`, `harmonic_amplitude` (m) and
        `harmonic_phase` (rad) of the part Y sin(wt + phase); `rms_force` (N) of compliant stops. "all" are those that
        the back end computes.
    backend : str
        Name of the back end; `time_step` in s is for "fixed-step" only. "cpu" and "reference" take any model, the
        others one mass with one fixed rigid stop, driven at one frequency, which may be given as an `ImpactSystem`.
    transient_impacts, sample_impacts : int, >= 0 and >= 1
        Impacts to skip, then to keep, in every cell.
    start : State, list of State or int, optional
        The initial condition of every cell; None means at rest at min(0, gap) at time 0. A list of initial conditions
        adds a dim `start`: ``.max("start")`` is the worst case. A number N >= 2 means N initial conditions: at rest
        first, then N - 1 impacts spread over phases 0 to 1 and velocities 0 to 4 V of each cell,
        V = max(f, k \|g\|)/sqrt(k m). Number j has the phase psi/T = frac(1/2 + 0.7548776662466927 (j - 1)) and the
        velocity 4 V frac(1/2 + 0.5698402909980532 (j - 1)), as in `attractors`.
    early_closing : bool
        Whether a cell stops once all its remaining impacts are known. Its indices are then completed in closed form,
        within 1e-10 of the velocity scale (1e-11 for systems), but `max_velocity` of an oscillator becomes that of the
        cycle, without the rest of the transient. False computes every impact.
    by_stop : bool
        Whether to separate the stops: `std`, `mean_velocity`, `max_velocity`, `impacts_per_period`, `dissipation`,
        `stick_fraction`, `impact_phase_spread` and `grazing_margin` get a dim `stop`, for the impacts, rests and
        near-misses at each stop while the impacts on all stops are kept. For a stop without impacts, velocities and
        phases are NaN.
    of : str, int or sequence of n float, optional
        What the indices of displacements are of: the name of a point, or of a stop (then its clearance), the number of
        a coordinate from 0 on, or factors of all coordinates. None means the only coordinate or point.
    tolerances : Tolerances, optional
        Numerical tolerances.
    workers : int, optional
        Threads; None means one per core. The result does not depend on it.
    store : path, optional
        A folder ending in .zarr into which tiles are written as they finish. If it holds the same study, only tiles
        that are missing or damaged are computed; another study, or other damage, raises an error. The returned Dataset
        reads from the store, and memory is bounded by the tiles being computed.
    tile : int, >= 1, optional
        Approximate number of cells per tile, with `store` or `cluster` only; 4096 by default, 4 with the slow back ends
        "reference" and "fixed-step". An existing store keeps its tiles.
    cluster : dask.distributed.Client or str, optional
        Compute on a Dask cluster: a client, `tcp://HOST:PORT` of a running scheduler, or `local:N` for N processes on
        this machine. Workers may join, leave and die; those that can reach the store write their tiles there
        themselves. The result does not depend on them.
    refine, jump : int and float, optional
        As in `refined_map`.
    progress : bool or callable, optional
        None shows a temporary line on a terminal or in a notebook if it takes more than a second.
        True shows a bar. A callable gets (cells done, cells in all, Dataset so far) and stops the sweep by returning
        False; the Dataset so far is then returned, with unfinished cells `interrupted`.
    **axes : sequences of numbers
        Values of parameters by name, strictly increasing; `frequency` in Hz may replace `omega`. Figures and summaries
        show a quantity of pint in its own unit; coordinates are always in the unit of the parameter.

    Returns
    -------
    xarray.Dataset
        One variable per index, and `status`, over the axes in the order given. An index without a value is NaN, and the
        status gives the reason; if the model has no such index, the variable's attribute `no_value` does. `attrs` hold
        the numbers of impacts and certified steps computed.

    Raises
    ------
    ValueError
        There is no axis, or one that is empty, unsorted, unknown or out of range; an index or back end is unknown; an
        initial condition lies beyond the stop somewhere on the grid; the store holds another study; `workers` and
        `cluster` are both given; without `store`, the grid does not fit into memory (250 bytes per cell, plus 8 for
        each further index); the sweep has more than 2^40 impacts in all, or 2^50 with `store` or `cluster`.
    OSError
        The store cannot be read or written, or another process writes to it; no scheduler answers.

    Notes
    -----
    Each cell's numbers are bit for bit the same on every grid, tile and thread. `impacts_per_period` is exactly p/n if
    a cycle of n periods and p impacts closed. If a cycle is certain (a stable Jacobian, within 1e-10 of the velocity
    scale of the periodic orbit, at most 4096 impacts), the exponent, dissipation, rest and margin are those of the
    cycle, and the exponent is ln of the spectral radius divided by the cycle's duration; for systems, dissipation is an
    average over the impacts kept, and exponent and margin are those of these where they span less than a cycle. The
    error of other exponents and dissipations is of the order of one over the number of impacts, that of other margins
    1e-5 of the motion's size; without load and loss, perturbations grow in proportion to time, and N impacts give
    exponents of about ln(N)/N per impact in place of 0; ripples of the gap shorter than half a radian of the fastest
    rate are missed. Displacements are followed after the impacts until the state at the end of a driving period returns
    within 1e-9 of the velocity scale, then over exactly one cycle: extremes to rounding, integrals to 1e-12. A motion
    that does not return within 63 periods is measured over these, which is an estimate. If a motion without contact
    settles by damping, the settled motion is measured. Time: about 0.1 microseconds per impact and core; over the
    paper's maps, closing leaves one sixth of the impacts to compute.

    References
    ----------
    .. [1] J.-Y. Lee, eq. (2) and section 4.

    Examples
    --------
    >>> from vibroimpact import ImpactOscillator
    >>> sweep = parameter_map(ImpactOscillator(), omega=[2.0, 2.8], mass=[1.0, 2.0], sample_impacts=200)
    >>> sweep["std"].dims
    ('omega', 'mass')
    >>> float(sweep["std"].sel(omega=2.0, mass=1.0)) < 1e-9
    True
    """
    check_model(osc)
    if points is None and not axes:
        raise ValueError("an axis is missing; give one, as in omega=[1, 2, 3], or a table of designs as points=")
    if points is not None and axes:
        raise ValueError(f"give either `points` or the axes {', '.join(axes)}, not both")
    sampling = Sampling(transient_impacts=transient_impacts, sample_impacts=sample_impacts)
    window = ImpactWindow(sampling.transient_impacts, sampling.sample_impacts)
    early_closing, by_stop = truth("early_closing", early_closing), truth("by_stop", by_stop)
    engine = get_backend(backend, time_step=time_step, elsewhere=cluster is not None)
    chosen = chosen_indices(indices, engine)
    observed = observed_by(indices, osc.at(), of)
    measurement = Measurement(window, Tolerances.of(tolerances), early_closing, chosen, by_stop, observed)
    varied = check_axes(axes, osc.parameters) if points is None else check_points(points, osc)
    check_apart(varied, chosen)
    request = Request(
        osc, varied, measurement, check_start(start), backend, time_step, of, points is not None,
        units=units_of(axes if points is None else points, osc.parameters),
    )  # fmt: skip
    check_takes(engine, osc.at())
    if by_stop and refine is not None:
        raise ValueError("give either `by_stop` or `refine`, not both")
    request.check_cost(STEPS if store is None and cluster is None else STEPS << 10)
    if refine is not None:
        from vibroimpact.refinement import refine_map

        _check_room_refined(request, whole_number("refine", refine, 1))
        return refine_map(
            request, refine, jump, workers=workers, store=store, cluster=cluster, tile=tile, progress=progress
        )
    check_place(request, workers, cluster, tile)
    if tile is not None and store is None and cluster is None:
        raise ValueError(
            f"`tile` needs a `store` (--out run.zarr) or a `cluster`, got {tile!r} without either; leave it out"
        )
    request.check_starts()
    size = tile or usual_tile(request)
    if store is not None:
        from vibroimpact.execution.store import run_into_store

        with reporter(progress, "cells") as report:
            return run_into_store(request, store, size, partial(computing, cluster, workers), report)
    hint = "write it to disk tile by tile, store='run.zarr' or --out run.zarr, or use fewer points"
    check_fits("axes", f"span {_spanned(request.shape)}, which take", len(request) * request.cell_size, hint)
    return _in_memory(request, cluster, workers, size, progress)


def _in_memory(
    request: Request, cluster: Client | str | None, workers: int | None, size: int, progress: bool | Report | None
) -> xr.Dataset:
    dataset, flat = _empty_map(request)
    done, stop = 0, Stop(progress)
    with reporter(progress, "cells") as report, computing(cluster, workers) as place:
        size = place.part_size(request, len(request)) if cluster is None else size
        parts = [slice(low, min(low + size, len(request))) for low in range(0, len(request), size)]
        with closing(place.compute(request, parts, stop)) as pieces:
            for part, which, result in pieces:
                for name, values in flat.items():
                    values[parts[part]][which] = result[name]
                for count in ("impacts", "steps"):
                    dataset.attrs[f"{count}_computed"] += int(result[count].sum())
                done += len(result["status"])
                if report(done, len(request), dataset) is False:
                    stop.set()
    return dataset


def refined_map(osc: Model, *, refine: int, jump: float | None = None, **how: Any) -> xr.Dataset:
    r"""Return indices over a plane of parameters, computed finely only where the motion changes.

    All of the given grid is computed. Then, level by level, each square of neighbours is halved if its corners do not
    all show the same motion, by the rule of `classify`,

    .. math:: (\text{class}, n, p)_i \ne (\text{class}, n, p)_j \quad\text{or}\quad
              |q_i - q_j| > \text{jump} \cdot (\max q - \min q),

    The same is done for squares that turn out to lie next to such a boundary, and all cells without impacts are
    computed. The other cells of the fine grid are filled in from their neighbours: the motion is theirs, and an index
    is interpolated linearly.

    Parameters
    ----------
    osc : ImpactOscillator, ImpactSystem or family
        The parameters that no axis varies.
    refine : int, 1 to 12
        How often intervals of the axes are halved: N values become (N - 1) 2^refine + 1, including the given ones.
    jump : float, optional
        Also refine if one of the `indices` differs between neighbours by more than this fraction of its range over the
        given grid, > 0 and <= 1. None compares motions only.
    **how
        As in `parameter_map`, with two axes of two or more values each. The indices that name motions,
        `lyapunov_per_impact`, `n_periods` and `n_impacts`, are always computed. A `store` keeps computed cells as they
        end, and the filled map at the end; `tile` is the number of cells that a worker of the `cluster` gets at a time.
        The total number of cells that `progress` gets is the number known to be needed so far, and may grow.

    Returns
    -------
    xarray.Dataset
        The result of `parameter_map` over the fine axes, and `level`: the level at which a cell was computed, 0 for the
        given grid, -1 if it was filled in. `attrs` hold `cells_computed`, `fraction_computed`, `filled_in` (a
        description of the other cells) and, for a stopped sweep, whose other cells are filled in from the computed
        ones, `complete` = 0.

    Raises
    ------
    ValueError
        There are not two axes, or one has a single value, or `parameter_map` would raise.

    Notes
    -----
    A computed cell is bit for bit that of `parameter_map` over the fine axes. Cells without impacts are never filled
    in. Among motions with impacts, an island that lies between the points of the given grid is missed. The paper's
    (omega, mass) plane has detail at every scale: at 4097 x 4097 cells, 22 % of them are computed, and on 0.5 % of the
    area the motion differs from that of the uniform map. Memory is 30 bytes per fine cell, 8 or 4 more for each further
    index, plus about 60 MB.

    References
    ----------
    .. [1] J.-Y. Lee, section 4.

    Examples
    --------
    >>> import numpy as np
    >>> from vibroimpact import ImpactOscillator
    >>> plane = refined_map(ImpactOscillator(), refine=3, omega=np.linspace(2, 3, 5), mass=[0.9, 1.0, 1.1],
    ...                     sample_impacts=500)
    >>> dict(plane.sizes), int((plane["level"] == 0).sum())
    ({'omega': 33, 'mass': 17}, 15)
    >>> plane.attrs["fraction_computed"] < 1
    True
    """
    return parameter_map(osc, refine=refine, jump=jump, **how)


def _check_room_refined(request: Request, levels: int) -> None:
    """Raise if memory cannot hold a refined map; a store does not help, since the map is filled in as a whole."""
    from vibroimpact.refinement import DEEPEST

    shape = tuple(((size - 1) << min(levels, DEEPEST)) + 1 for size in request.shape)
    size = math.prod(shape) * FINE_CELL
    check_fits("refine", f"makes {_spanned(shape)}, which take", size, "refine less, or use fewer points")


def _spanned(shape: tuple[int, ...]) -> str:
    return f"{' x '.join(map(str, shape))} = {math.prod(shape):,} cells"


def _empty_map(request: Request) -> tuple[xr.Dataset, dict[str, NDArray[Any]]]:
    """Return a map in which no cell is done, and flat views of its variables to fill."""
    shapes = {name: tuple(request.sizes_of(name).values()) for name in request.indices}
    arrays: dict[str, NDArray[Any]] = {name: missing(name, shape) for name, shape in shapes.items()}
    arrays["status"] = np.full(request.shape, Status.INTERRUPTED, np.int8)
    return map_of(request, arrays), {
        name: array.reshape(len(request), *array.shape[len(request.shape) :]) for name, array in arrays.items()
    }
