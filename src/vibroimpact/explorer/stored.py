"""Views of stored sweeps."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from vibroimpact import models
from vibroimpact.dataset import arguments_of, family_in, model_of
from vibroimpact.explorer.limits import FINEST
from vibroimpact.explorer.models import Find, name_in_links
from vibroimpact.explorer.plane import Plane, Stored, positions
from vibroimpact.explorer.state import SAMPLES, View, table, values_of
from vibroimpact.families import ready_made
from vibroimpact.figures import MOTION
from vibroimpact.files import load_dataset
from vibroimpact.indices import INDICES
from vibroimpact.model import Model
from vibroimpact.motion.classes import NEEDED, classify
from vibroimpact.parameters import Parameter, check_fits


def open_study(path: str | os.PathLike[str], model: Model | None = None, name: str = "") -> tuple[View, Stored, Find]:
    """Return the view of a whole stored sweep, the function that returns its cells, and the one that finds its model.

    Parameters
    ----------
    path : path
        A sweep over two or more parameters: a `.zarr` folder or an `.nc` file.
    model : ImpactOscillator, ImpactSystem or family, optional
        The model of the sweep; required for your own family, which is not stored in the file.
    name : str
        The name of the model in links.

    Raises
    ------
    ValueError
        The file is not a sweep over two parameters of its model, the model is unknown, or a page's limits are exceeded.
    OSError
        The file cannot be read.

    Notes
    -----
    All cells shown, at most 256 x 256, are read at once; the store may be removed or grow while pages are open. A sweep
    over frequency in Hz is shown in Hz.
    """
    try:
        return _view_of(path, model, name)
    except ValueError as error:
        where = os.fspath(path)
        raise error if where in str(error) else ValueError(f"{error} (in {where!r})") from error
    except (LookupError, TypeError, AttributeError, ArithmeticError) as error:
        raise OSError(f"`store` {os.fspath(path)!r} is damaged ({type(error).__name__}: {error})") from error


def _view_of(path: str | os.PathLike[str], model: Model | None, name: str) -> tuple[View, Stored, Find]:
    sweep = _read(path)
    model, name, find = _model_of(path, sweep, model, name)
    in_hertz = "frequency" in sweep.dims and "frequency" not in model.values
    parameters = table(model, in_hertz)
    status = sweep.get("status")
    dims = [str(dim) for dim in status.dims] if status is not None else []
    sweep = sweep.drop_vars([key for key, index in sweep.data_vars.items() if not set(index.dims) <= set(dims)])
    indices = [key for key in sweep.data_vars if key in INDICES]
    if len(dims) > 1 and not indices:
        raise ValueError(
            f"`store` must hold one of {', '.join(INDICES)}, for all stops together; {os.fspath(path)!r} has none"
        )
    if len(dims) < 2 or any(axis not in parameters for axis in dims):
        raise ValueError(
            f"`store` must be a sweep over two or more of {', '.join(parameters)}"
            f"{' (or frequency for omega)' if 'omega' in parameters else ''}, got "
            f"{os.fspath(path)!r} with axes {', '.join(dims) or 'none'}; make one with `vibroimpact map --out`"
        )
    for axis in dims[2:]:
        sweep = sweep.isel({axis: sweep.sizes[axis] // 2})
    osc = model.replace(**{axis: float(sweep[axis]) for axis in dims[2:]})
    x, y = dims[:2]
    ranges = {axis: _edges(parameters[axis], sweep[axis].values) for axis in (x, y)}
    middle = {axis: float(np.clip(values_of(osc, in_hertz)[axis], *ranges[axis])) for axis in (x, y)}
    view = View(
        osc=osc.replace(**middle), x=x, y=y, x_range=ranges[x], y_range=ranges[y], index=str(indices[0]),
        samples=_samples(sweep), model=name, hertz=in_hertz,
    )  # fmt: skip
    plane, shown = _plane(view, sweep.transpose(x, y, ...), Path(path).name)

    def stored(wanted: View) -> Plane | None:
        if wanted.plane_key != view.plane_key or wanted.index not in shown:
            return None
        return replace(plane, view=wanted)

    return view, stored, find


def _read(path: str | os.PathLike[str]) -> xr.Dataset:
    if Path(path).suffix == ".zarr":
        from vibroimpact.execution.store import SweepStore

        try:
            store = SweepStore(path)
        except OSError:
            pass  # a result that was saved in one piece
        else:
            return store.dataset()
    return load_dataset(path)


def _model_of(
    path: str | os.PathLike[str], sweep: xr.Dataset, model: Model | None, name: str
) -> tuple[Model, str, Find]:
    """Return the model of a sweep, its name in links, and the function that finds it by that name."""
    file = os.fspath(path)
    try:
        if recorded := family_in(sweep):
            family, values = recorded
            if model is None and family not in models.__all__:
                raise ValueError(f"it was computed from the family {family!r}; give its file with --model FILE.py:NAME")
            if model is None:
                model, name = ready_made(family), family
            model = model.replace(**values)
            return model, *name_in_links(model, name)
        if "system" in sweep.attrs or "oscillator" in sweep.attrs:
            model = model_of(sweep)
            return model, *name_in_links(model, name or Path(path).name)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise ValueError(
            f"`store` must be a sweep as `vibroimpact map --out` writes it; the model of {file!r} is unknown ({error})"
        ) from error
    raise ValueError(f"`store` must be a sweep of a model, got {file!r}; make one with `vibroimpact map --out`")


def _samples(sweep: xr.Dataset) -> int:
    """Return the allowed number of sampled impacts that is nearest to the sweep's."""
    try:
        wanted = float(arguments_of(sweep)["sample_impacts"])
    except (KeyError, TypeError, ValueError):
        return View.samples
    return min(SAMPLES, key=lambda samples: abs(samples - wanted))


def _edges(parameter: Parameter, values: Any) -> tuple[float, float]:
    """Return the outer edges of the first and the last cell, within the parameter's range."""
    if len(values) < 2:
        raise ValueError(f"`store` must hold two or more values of {parameter.name}, got one")
    if values.dtype.kind not in "fiu" or not (np.diff(values) > 0.0).all():
        raise ValueError(f"`store` must hold increasing values of {parameter.name}; sort them")
    low, high = values[0] - 0.5 * (values[1] - values[0]), values[-1] + 0.5 * (values[-1] - values[-2])
    return _within(parameter, low, values[0]), _within(parameter, high, values[-1])


def _within(parameter: Parameter, edge: float, value: float) -> float:
    """Return the edge of a cell, or the cell's value where the edge is out of the parameter's range."""
    try:
        return parameter.check(edge)
    except ValueError:
        return float(value)


def _origin(sweep: xr.Dataset) -> str:
    """Return the initial condition of a stored sweep as text, as far as it is recorded."""
    try:
        start = arguments_of(sweep)["start"]
    except (KeyError, TypeError, ValueError):
        return "from the stored initial condition"
    return Plane.origin if start is None else "from the stored initial condition"


def _nearest(values: Any, places: Any) -> Any:
    """Return the index of the nearest of increasing values for each place."""
    after = np.searchsorted(values, places).clip(1, len(values) - 1)
    return after - (places - values[after - 1] <= values[after] - places)


def _plane(view: View, sweep: xr.Dataset, name: str) -> tuple[Plane, frozenset[str]]:
    """Return the sweep on the finest lattice, taking the nearest stored cell for each, and the indices stored."""
    cells = np.arange(FINEST)
    where = [
        _nearest(sweep[axis].values, positions(*ends, cells))
        for axis, ends in ((view.x, view.x_range), (view.y, view.y_range))
    ]
    try:
        near = sweep.isel({view.x: where[0], view.y: where[1]})
        check_fits("store", f"is {name!r}, of which what is shown takes", near.nbytes, "it is damaged")
        near = near.load()
    except (RuntimeError, OSError) as error:  # a damaged tile
        raise OSError(f"`store`: a tile of {name!r} cannot be read ({error}); run the sweep again") from error
    plane = Plane.unknown(view)
    growth = "lyapunov_per_impact" in near or ("lyapunov" in near and "impacts_per_period" in near)
    if growth and set(NEEDED[1:]) <= set(map(str, near.variables)):
        near = near.assign(motion=classify(near)["motion"])
    for key, array in plane.values.items():
        if key in near and near[key].dtype.kind in "fiub":
            array[...] = near[key].values
    missing = int(sweep.attrs.get("cells_missing", 0))
    plane.stored = f"{name}, {len(sweep[view.x])} × {len(sweep[view.y])} cells" + f", {missing} missing" * bool(missing)
    plane.side = FINEST
    plane.indices = frozenset(map(str, near.data_vars)) & frozenset(INDICES)
    plane.origin = _origin(sweep)
    return plane, plane.indices | ({MOTION} & set(near.data_vars))
