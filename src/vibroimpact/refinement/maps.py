"""Maps that are computed finely where motions change, and filled in elsewhere."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from vibroimpact.axes import check_axes
from vibroimpact.backends import ImpactWindow
from vibroimpact.backends.starts import check_start
from vibroimpact.dataset import provenance, status_variable, variable
from vibroimpact.indices import check_indices
from vibroimpact.options import Sampling, Tolerances
from vibroimpact.oscillator import ImpactOscillator, State
from vibroimpact.parameters import real_number, whole_number
from vibroimpact.progress import Report, Stop, reporter
from vibroimpact.refinement.computing import Computer, check_place, computing
from vibroimpact.refinement.lattice import finer
from vibroimpact.refinement.picture import NAMING, Picture, level_variable
from vibroimpact.refinement.points import Points
from vibroimpact.refinement.quadtree import refine as refine_picture
from vibroimpact.refinement.request import RefinedRequest

if TYPE_CHECKING:
    from distributed import Client

DEEPEST = 12


def refined_map(
    osc: ImpactOscillator,
    *,
    refine: int,
    jump: float | None = None,
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
    cluster: Client | str | None = None,
    tile: int | None = None,
    progress: bool | Report = False,
    **axes: ArrayLike,
) -> xr.Dataset:
    r"""Return indices over a plane of parameters, computed finely only where the motion changes.

    The given grid is computed whole. Then, level by level, each square of neighbours is halved in which not all corners
    show the same motion, by the rule of `classify`,

    .. math:: (\text{class}, n, p)_i \ne (\text{class}, n, p)_j \quad\text{or}\quad
              |q_i - q_j| > \text{jump} \cdot (\max q - \min q),

    and so are squares that turn out to lie beside such a boundary. The other cells of the fine grid are filled in from
    their neighbours: the motion is theirs, an index is interpolated linearly.

    Parameters
    ----------
    osc : ImpactOscillator
        The parameters that no axis varies.
    refine : int, 1 to 12
        How often intervals of the axes are halved: N values become (N - 1) 2^refine + 1, the given ones among them.
    jump : float, optional
        Also refine where one of the `indices` differs between neighbours by more than this part of its range over the
        given grid, > 0 and <= 1. None looks at motions alone.
    indices : names
        As of `parameter_map`. The three by which motions are named, `lyapunov_per_impact`, `n_periods` and `n_impacts`,
        come along always.
    backend, time_step, transient_impacts, sample_impacts, start, early_closing, tolerances, workers
        As of `parameter_map`.
    store : path, optional
        A folder ending in .zarr that keeps computed cells as they end and the filled map at last. Where the same study
        stands there, only what it lacks is computed; another study is refused.
    cluster, tile
        As of `parameter_map`: where cells are computed instead of here, and how many a worker gets at a time. The
        result does not depend on them.
    progress : bool or callable
        As of `parameter_map`; the number of cells in all is what is known to be needed so far, and grows.
    **axes : sequences of numbers
        Values of two parameters by name, two or more each, strictly increasing.

    Returns
    -------
    xarray.Dataset
        What `parameter_map` returns over the fine axes, filled, and `level`: at which level a cell was computed, 0 the
        given grid, -1 filled in. `attrs` tell `cells_computed` and `fraction_computed`. Where the sweep was stopped,
        `attrs["complete"]` is 0 and the rest is filled from what there is.

    Raises
    ------
    ValueError
        Not two axes, one of them with a single value, or what `parameter_map` refuses.

    Notes
    -----
    A computed cell is bit for bit that of `parameter_map` over the fine axes. An island that lies between the points of
    the given grid is overlooked. The paper's (omega, mass) plane has detail at every scale: at 4097 x 4097 cells the
    quadtree computes 22 % of them and 0.5 % of the area shows another motion than the uniform map. Memory is 30 bytes a
    fine cell, 8 or 4 more for each further index, and some 60 MB.

    References
    ----------
    .. [1] J.-Y. Lee, section 4.

    Examples
    --------
    >>> import numpy as np
    >>> plane = refined_map(ImpactOscillator(), refine=3, omega=np.linspace(2, 3, 5), mass=[0.9, 1.0, 1.1],
    ...                     sample_impacts=500)
    >>> dict(plane.sizes), int((plane["level"] == 0).sum())
    ({'omega': 33, 'mass': 17}, 15)
    >>> plane.attrs["fraction_computed"] < 1
    True
    """
    check_start(start)
    chosen = check_indices(indices)
    names = (*chosen, *(name for name in NAMING if name not in chosen))
    levels = whole_number("refine", refine, 1)
    if levels > DEEPEST:
        raise ValueError(f"`refine` is {refine!r}; allowed is 1 to {DEEPEST}; give a finer grid to begin with")
    part = None if jump is None else real_number("jump", jump, "None or a number above 0 and up to 1")
    if part is not None and not 0.0 < part <= 1.0:
        raise ValueError(f"`jump` is {jump!r}; allowed is None or a number above 0 and up to 1; 0.1 is usual")
    grid = {name: finer(values, levels) for name, values in _plane(check_axes(axes)).items()}
    sampling = Sampling(transient_impacts=transient_impacts, sample_impacts=sample_impacts)
    window = ImpactWindow(sampling.transient_impacts, sampling.sample_impacts)
    request = RefinedRequest(
        osc, grid, names, window, tolerances or Tolerances(), start, backend, time_step, early_closing,
        levels, part,
    )  # fmt: skip
    request.cells(np.zeros(1, np.int64))  # refuses a bad start
    check_place(request, workers, cluster, tile)
    with reporter(progress, "cells") as report, ExitStack() as stack:
        kept = None
        if store is not None:
            from vibroimpact.refinement.stored import finished, keeping, open_refined

            stored = open_refined(store, request)
            if (whole := finished(stored)) is not None:
                return whole
            kept = stack.enter_context(keeping(stored, request))
        computer = stack.enter_context(computing(request, workers, cluster, tile))
        return _run(request, computer, report, kept)


def to_uniform(plane: xr.Dataset, *, shape: tuple[int, int] | None = None) -> xr.Dataset:
    """Return a refined map on evenly spaced axes, each cell that of the nearest one of the fine grid.

    Parameters
    ----------
    plane : xarray.Dataset
        What `refined_map` returned.
    shape : pair of int, >= 2, optional
        Cells along each axis; None keeps their number.

    Returns
    -------
    xarray.Dataset
        The same variables; nothing is interpolated, so that every value was computed or filled in before.

    Raises
    ------
    ValueError
        `plane` is no refined map, or `shape` no pair of whole numbers >= 2.

    Examples
    --------
    >>> plane = refined_map(ImpactOscillator(), refine=2, omega=[2.0, 2.4, 3.0], mass=[0.9, 1.1], sample_impacts=100)
    >>> dict(to_uniform(plane, shape=(11, 6)).sizes)
    {'omega': 11, 'mass': 6}
    """
    if not isinstance(plane, xr.Dataset) or "level" not in plane or len(plane["level"].dims) != 2:
        raise ValueError(
            f"`plane` is a {type(plane).__name__} without levels; allowed is a refined map; "
            "give what `refined_map` returned"
        )
    dims = [str(dim) for dim in plane["level"].dims]
    sizes = plane["level"].shape if shape is None else tuple(shape)
    if len(sizes) != 2:
        raise ValueError(f"`shape` is {shape!r}; allowed is a pair of whole numbers; give one a dimension")
    targets: dict[str, xr.Variable] = {}
    for dim, size in zip(dims, sizes, strict=True):
        values = plane[dim].values
        even = np.linspace(values[0], values[-1], whole_number("shape", size, 2))
        targets[dim] = variable(dim, dim, even)
    return plane.sel({dim: target.values for dim, target in targets.items()}, method="nearest").assign_coords(targets)


def _plane(given: Mapping[str, NDArray[np.float64]]) -> Mapping[str, NDArray[np.float64]]:
    if len(given) != 2:
        raise ValueError(
            f"`refine` is given with {len(given)} {'axis' if len(given) == 1 else 'axes'}; allowed are two; "
            "leave `refine` out for other numbers of axes"
        )
    for name, values in given.items():
        if len(values) < 2:
            raise ValueError(f"`{name}` has 1 value; allowed with `refine` are two or more; give its ends at least")
    return given


def _run(request: RefinedRequest, computer: Computer, report: Report, kept: Any) -> xr.Dataset:
    picture = Picture(request.shape, request.indices, request.window.keep)
    dataset = _labelled(request, picture)

    def told(done: int, total: int, impacts: int, steps: int) -> Any:
        dataset.attrs |= {"impacts_computed": impacts, "steps_computed": steps}
        return report(done, total, dataset)

    points = Points(request, picture, computer, told, Stop(report), kept)
    complete = refine_picture(picture, request.levels, request.jump, request.indices, points)
    dataset.attrs |= {
        "complete": int(complete),
        "cells_computed": picture.computed,
        "fraction_computed": picture.computed / picture.level.size,
    }
    return dataset if kept is None else kept.draw(picture, dataset.attrs, complete=complete)


def _labelled(request: RefinedRequest, picture: Picture) -> xr.Dataset:
    """Return the picture as a Dataset that shares its memory."""
    dims = tuple(request.axes)
    fields = {name: variable(name, dims, picture.values[name]) for name in request.indices}
    fields |= {"status": status_variable(dims, picture.values["status"]), "level": level_variable(dims, picture.level)}
    coords = {name: variable(name, name, values) for name, values in request.axes.items()}
    counts = {"impacts_computed": 0, "steps_computed": 0}
    told = provenance("parameter_map", request.oscillator, request.arguments())
    return xr.Dataset(fields, coords, attrs=counts | told)
