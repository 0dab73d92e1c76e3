"""A stored sweep shown as a plane."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from vibroimpact.classes import NEEDED, classify
from vibroimpact.dataset import oscillator_of
from vibroimpact.explorer.plane import Plane, positions
from vibroimpact.explorer.state import FINEST, SAMPLES, View
from vibroimpact.indices import INDICES
from vibroimpact.oscillator import PARAMETERS

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
        It holds no sweep over two parameters of the oscillator.
    OSError
        It cannot be read.
    """
    sweep = _read(path)
    status = sweep.get("status")
    dims = [str(name) for name in status.dims] if status is not None else []
    told = [name for name in sweep.data_vars if name in INDICES]
    if len(dims) < 2 or not told or any(name not in PARAMETERS for name in dims) or "oscillator" not in sweep.attrs:
        raise ValueError(
            f"`store` is {os.fspath(path)!r} with axes {', '.join(dims) or 'none'}; allowed is a sweep over two or "
            f"more of {', '.join(PARAMETERS)}; make one with `vibroimpact map --out`"
        )
    for name in dims[2:]:
        sweep = sweep.isel({name: sweep.sizes[name] // 2})
    osc = oscillator_of(sweep).replace(**{name: float(sweep[name]) for name in dims[2:]})
    x, y = dims[:2]
    ranges = {name: _edges(sweep[name].values) for name in (x, y)}
    middle = {name: float(np.clip(getattr(osc, name), *ranges[name])) for name in (x, y)}
    view = View(
        osc=osc.replace(**middle), x=x, y=y, x_range=ranges[x], y_range=ranges[y], index=str(told[0]),
        samples=SAMPLES[1],
    )  # fmt: skip
    plane = _plane(view, sweep.transpose(x, y, ...), Path(path).name)

    def look(wanted: View) -> Plane | None:
        if wanted.plane_key != view.plane_key:
            return None
        return replace(plane, view=wanted)

    return view, look


def _read(path: str | os.PathLike[str]) -> xr.Dataset:
    if Path(path).suffix == ".zarr":
        from vibroimpact.stores import SweepStore

        try:
            return SweepStore(path).dataset()
        except OSError:
            pass  # a result that was saved whole
    from vibroimpact.storage import load

    return load(path)


def _edges(values: Any) -> tuple[float, float]:
    """Return the outer edges of the first and the last cell, within what parameters may be."""
    if len(values) < 2:
        raise ValueError("`store` has an axis with one value; allowed are two or more; store a wider sweep")
    low, high = values[0] - 0.5 * (values[1] - values[0]), values[-1] + 0.5 * (values[-1] - values[-2])
    return float(low if low > 0.0 or values[0] <= 0.0 else values[0]), float(high)


def _plane(view: View, sweep: xr.Dataset, name: str) -> Plane:
    """Return the sweep on the finest lattice, each cell that of the nearest stored value."""
    cells = np.arange(FINEST)
    where = [
        np.abs(sweep[axis].values[None, :] - positions(*ends, cells)[:, None]).argmin(axis=1)
        for axis, ends in ((view.x, view.x_range), (view.y, view.y_range))
    ]
    near = sweep.isel({view.x: where[0], view.y: where[1]}).load()
    plane = Plane.unknown(view)
    growth = {"lyapunov_per_impact"} <= set(near) or {"lyapunov", "impacts_per_period"} <= set(near)
    if growth and set(NEEDED[1:]) <= set(map(str, near.variables)):
        near = near.assign(motion=classify(near)["motion"])
    for key, array in plane.values.items():
        if key in near:
            array[...] = near[key].values
    plane.side, plane.stored = FINEST, f"{name}, {len(sweep[view.x])} × {len(sweep[view.y])} cells"
    return plane
