"""A stored sweep shown as a plane."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from vibroimpact.classes import NEEDED, classify
from vibroimpact.dataset import oscillator_of, variable
from vibroimpact.explorer.plane import Plane, positions
from vibroimpact.explorer.state import FINEST, MOTION, SAMPLES, View
from vibroimpact.indices import INDICES
from vibroimpact.oscillator import PARAMETERS, ImpactOscillator, parameter_value

Look = Callable[[View], Plane | None]


def open_study(path: str | os.PathLike[str]) -> tuple[View, Look]:
    """Return the view that shows a stored sweep whole, and what hands its cells to a session.

    Parameters
    ----------
    path : path
        A sweep over two or more parameters: a `.zarr` folder or an `.nc` file.

    Raises
    ------
    ValueError
        It holds no sweep over two parameters of the oscillator, or one beyond what a page may ask for.
    OSError
        It cannot be read.

    Notes
    -----
    What is shown is read at once, 256 x 256 cells at most: the store may go away, or go on growing, while pages are
    open. A frequency in Hz is shown as omega in rad/s.
    """
    sweep = _over_omega(_read(path))
    status = sweep.get("status")
    dims = [str(name) for name in status.dims] if status is not None else []
    told = [name for name in sweep.data_vars if name in INDICES]
    if len(dims) < 2 or not told or any(name not in PARAMETERS for name in dims) or "oscillator" not in sweep.attrs:
        raise ValueError(
            f"`store` is {os.fspath(path)!r} with axes {', '.join(dims) or 'none'}; allowed is a sweep over two or "
            f"more of {', '.join(PARAMETERS)}, or frequency for omega; make one with `vibroimpact map --out`"
        )
    for name in dims[2:]:
        sweep = sweep.isel({name: sweep.sizes[name] // 2})
    osc = _oscillator(path, sweep).replace(**{name: float(sweep[name]) for name in dims[2:]})
    x, y = dims[:2]
    ranges = {name: _edges(name, sweep[name].values) for name in (x, y)}
    middle = {name: float(np.clip(getattr(osc, name), *ranges[name])) for name in (x, y)}
    view = View(
        osc=osc.replace(**middle), x=x, y=y, x_range=ranges[x], y_range=ranges[y], index=str(told[0]),
        samples=_samples(sweep),
    )  # fmt: skip
    plane, known = _plane(view, sweep.transpose(x, y, ...), Path(path).name)

    def look(wanted: View) -> Plane | None:
        if wanted.plane_key != view.plane_key or wanted.index not in known:
            return None
        return replace(plane, view=wanted)

    return view, look


def _read(path: str | os.PathLike[str]) -> xr.Dataset:
    if Path(path).suffix == ".zarr":
        from vibroimpact.execution.store import SweepStore

        try:
            store = SweepStore(path)
        except OSError:
            pass  # a result that was saved whole
        else:
            return store.dataset()
    from vibroimpact.files import load

    return load(path)


def _over_omega(sweep: xr.Dataset) -> xr.Dataset:
    """Return a sweep over the frequency in Hz as one over w = 2 pi frequency in rad/s; others as they are."""
    if "frequency" not in sweep.dims or "omega" in sweep.variables or sweep["frequency"].dtype.kind not in "fiu":
        return sweep
    omega = variable("omega", "frequency", 2.0 * math.pi * sweep["frequency"].values)
    return sweep.assign_coords(frequency=omega).rename(frequency="omega")


def _oscillator(path: str | os.PathLike[str], sweep: xr.Dataset) -> ImpactOscillator:
    try:
        return oscillator_of(sweep)
    except (ValueError, TypeError) as error:
        raise ValueError(
            f"`store` is {os.fspath(path)!r}, whose oscillator cannot be read ({error}); allowed is a sweep as "
            "`vibroimpact map --out` writes it; make it again"
        ) from error


def _samples(sweep: xr.Dataset) -> int:
    """Return the allowed number of sampled impacts that is nearest to the study's."""
    try:
        wanted = float(json.loads(sweep.attrs["arguments"])["sample_impacts"])
    except (KeyError, TypeError, ValueError):
        return View.samples
    return min(SAMPLES, key=lambda samples: abs(samples - wanted))


def _edges(name: str, values: Any) -> tuple[float, float]:
    """Return the outer edges of the first and the last cell, within what the parameter may be."""
    if len(values) < 2:
        raise ValueError(f"`store` has one value of {name}; allowed are two or more; store a wider sweep")
    if values.dtype.kind not in "fiu" or not (np.diff(values) > 0.0).all():
        raise ValueError(f"`store` has values of {name} that do not increase; allowed is an increasing axis; sort it")
    low, high = values[0] - 0.5 * (values[1] - values[0]), values[-1] + 0.5 * (values[-1] - values[-2])
    return _within(name, low, values[0]), _within(name, high, values[-1])


def _within(name: str, edge: float, value: float) -> float:
    """Return the edge of a cell, or the cell's value where the edge is no value that the parameter may have."""
    try:
        return parameter_value(name, edge)
    except ValueError:
        return float(value)


def _nearest(values: Any, places: Any) -> Any:
    """Return which of increasing values is nearest to each place."""
    after = np.searchsorted(values, places).clip(1, len(values) - 1)
    return after - (places - values[after - 1] <= values[after] - places)


def _plane(view: View, sweep: xr.Dataset, name: str) -> tuple[Plane, frozenset[str]]:
    """Return the sweep on the finest lattice, each cell that of the nearest stored value, and what it tells."""
    cells = np.arange(FINEST)
    where = [
        _nearest(sweep[axis].values, positions(*ends, cells))
        for axis, ends in ((view.x, view.x_range), (view.y, view.y_range))
    ]
    try:
        near = sweep.isel({view.x: where[0], view.y: where[1]}).load()
    except RuntimeError as error:  # how a damaged tile shows
        raise OSError(f"`store` is {name!r}, in which a tile cannot be read ({error}); run the sweep again") from error
    plane = Plane.unknown(view)
    growth = {"lyapunov_per_impact"} <= set(near) or {"lyapunov", "impacts_per_period"} <= set(near)
    if growth and set(NEEDED[1:]) <= set(map(str, near.variables)):
        near = near.assign(motion=classify(near)["motion"])
    for key, array in plane.values.items():
        if key in near and near[key].dtype.kind in "fiub":
            array[...] = near[key].values
    missing = int(sweep.attrs.get("cells_missing", 0))
    plane.stored = f"{name}, {len(sweep[view.x])} × {len(sweep[view.y])} cells" + f", {missing} missing" * bool(missing)
    plane.side = FINEST
    return plane, frozenset(map(str, near.data_vars)) & {MOTION, *INDICES}
