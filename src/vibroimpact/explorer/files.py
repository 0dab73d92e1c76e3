"""A stored sweep as a view, and a view as files: picture, data, study file, and the Python lines that make it again."""

from __future__ import annotations

import csv
import io
import json
import math
import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

import vibroimpact as vi
from vibroimpact.classes import NEEDED, classify
from vibroimpact.dataset import impact_speed, oscillator_of, variable
from vibroimpact.explorer.address import to_query
from vibroimpact.explorer.plane import ONLY_OTHERS, OTHERS, TRANSIENT, Plane, lattice, positions
from vibroimpact.explorer.point import Point
from vibroimpact.explorer.session import Explorer
from vibroimpact.explorer.state import FINEST, MOTION, NAMES, SAMPLES, TABLE, View
from vibroimpact.files import load
from vibroimpact.indices import INDICES
from vibroimpact.oscillator import ImpactOscillator
from vibroimpact.parameters import check_fits
from vibroimpact.plotting import labels
from vibroimpact.plotting.diagrams import HATCHED
from vibroimpact.plotting.style import BLUE, INK, STYLE, draw_stop
from vibroimpact.plotting.style import view as limits

STATE = ("displacement", "velocity", "phase")
Stored = Callable[[View], Plane | None]
SIZE, DPI = (13.0, 7.6), 150  # of a picture, in inches and dots per inch


# ---- a stored sweep as a view


def open_study(path: str | os.PathLike[str]) -> tuple[View, Stored]:
    """Return the view that shows all of a stored sweep, and a function that gives a session its cells.

    Parameters
    ----------
    path : path
        A sweep over two or more parameters: a `.zarr` folder or an `.nc` file.

    Raises
    ------
    ValueError
        It is not a sweep over two parameters of the oscillator, or exceeds the limits of a page.
    OSError
        It cannot be read.

    Notes
    -----
    All that is shown is read at once, 256 x 256 cells at most: the store may be removed, or continue to grow, while
    pages are open. A frequency in Hz is shown as omega in rad/s.
    """
    try:
        return _view_of(path)
    except ValueError as error:
        where = os.fspath(path)
        raise error if where in str(error) else ValueError(f"{error} (in {where!r})") from error
    except (LookupError, TypeError, AttributeError, ArithmeticError) as error:
        raise OSError(f"`store` {os.fspath(path)!r} is damaged ({type(error).__name__}: {error})") from error


def _view_of(path: str | os.PathLike[str]) -> tuple[View, Stored]:
    sweep = _over_omega(_read(path))
    status = sweep.get("status")
    dims = [str(name) for name in status.dims] if status is not None else []
    indices = [name for name in sweep.data_vars if name in INDICES]
    if len(dims) < 2 or not indices or any(name not in NAMES for name in dims) or "oscillator" not in sweep.attrs:
        raise ValueError(
            f"`store` must be a sweep over two or more of {', '.join(NAMES)} (or frequency for omega), got "
            f"{os.fspath(path)!r} with axes {', '.join(dims) or 'none'}; make one with `vibroimpact map --out`"
        )
    for name in dims[2:]:
        sweep = sweep.isel({name: sweep.sizes[name] // 2})
    osc = _oscillator(path, sweep).replace(**{name: float(sweep[name]) for name in dims[2:]})
    x, y = dims[:2]
    ranges = {name: _edges(name, sweep[name].values) for name in (x, y)}
    middle = {name: float(np.clip(getattr(osc, name), *ranges[name])) for name in (x, y)}
    view = View(
        osc=osc.replace(**middle), x=x, y=y, x_range=ranges[x], y_range=ranges[y], index=str(indices[0]),
        samples=_samples(sweep),
    )  # fmt: skip
    plane, known = _plane(view, sweep.transpose(x, y, ...), Path(path).name)

    def stored(wanted: View) -> Plane | None:
        if wanted.plane_key != view.plane_key or wanted.index not in known:
            return None
        return replace(plane, view=wanted)

    return view, stored


def _read(path: str | os.PathLike[str]) -> xr.Dataset:
    if Path(path).suffix == ".zarr":
        from vibroimpact.execution.store import SweepStore

        try:
            store = SweepStore(path)
        except OSError:
            pass  # a result that was saved whole
        else:
            return store.dataset()
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
            f"`store` must be a sweep as `vibroimpact map --out` writes it; the oscillator of {os.fspath(path)!r} "
            f"cannot be read ({error})"
        ) from error


def _samples(sweep: xr.Dataset) -> int:
    """Return the allowed number of sampled impacts that is nearest to the sweep's."""
    try:
        wanted = float(json.loads(sweep.attrs["arguments"])["sample_impacts"])
    except (KeyError, TypeError, ValueError):
        return View.samples
    return min(SAMPLES, key=lambda samples: abs(samples - wanted))


def _edges(name: str, values: Any) -> tuple[float, float]:
    """Return the outer edges of the first and the last cell, within the parameter's range."""
    if len(values) < 2:
        raise ValueError(f"`store` must hold two or more values of {name}, got one")
    if values.dtype.kind not in "fiu" or not (np.diff(values) > 0.0).all():
        raise ValueError(f"`store` must hold increasing values of {name}; sort them")
    low, high = values[0] - 0.5 * (values[1] - values[0]), values[-1] + 0.5 * (values[-1] - values[-2])
    return _within(name, low, values[0]), _within(name, high, values[-1])


def _within(name: str, edge: float, value: float) -> float:
    """Return the edge of a cell, or the cell's value where the edge is out of the parameter's range."""
    try:
        return TABLE[name].check(edge)
    except ValueError:
        return float(value)


def _origin(sweep: xr.Dataset) -> str:
    """Return from where the motions of a stored sweep began, as far as it says so."""
    try:
        start = json.loads(sweep.attrs["arguments"])["start"]
    except (KeyError, TypeError, ValueError):
        return "from the stored initial condition"
    return Plane.origin if start is None else "from the stored initial condition"


def _nearest(values: Any, places: Any) -> Any:
    """Return which of increasing values is nearest to each place."""
    after = np.searchsorted(values, places).clip(1, len(values) - 1)
    return after - (places - values[after - 1] <= values[after] - places)


def _plane(view: View, sweep: xr.Dataset, name: str) -> tuple[Plane, frozenset[str]]:
    """Return the sweep on the finest lattice, each cell that of the nearest stored value, and the indices it holds."""
    cells = np.arange(FINEST)
    where = [
        _nearest(sweep[axis].values, positions(*ends, cells))
        for axis, ends in ((view.x, view.x_range), (view.y, view.y_range))
    ]
    try:
        near = sweep.isel({view.x: where[0], view.y: where[1]})
        check_fits("store", f"is {name!r}, of which what is shown takes", near.nbytes, "it is damaged")
        near = near.load()
    except (RuntimeError, OSError) as error:  # raised for a damaged tile
        raise OSError(f"`store`: a tile of {name!r} cannot be read ({error}); run the sweep again") from error
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
    plane.held = frozenset(map(str, near.data_vars)) & frozenset(INDICES)
    plane.origin = _origin(sweep)
    return plane, plane.held | ({MOTION} & set(near.data_vars))


# ---- a view as files


@dataclass(frozen=True)
class File:
    """A file for the browser to keep."""

    name: str
    type: str
    content: bytes


def export(kind: str, explorer: Explorer) -> File:
    """Return the view as a file of that kind."""
    name, media_type, make = KINDS[kind]
    return File(name, media_type, make(explorer))


def _computed(what: str, content: Any) -> Any:
    if content is None:
        raise ValueError(f"this {what} is still being computed; try again in a moment")
    return content


def _axis(view: View, axis: str) -> tuple[float, float]:
    """Return the first and the last value along an axis of the finest lattice."""
    low, high = getattr(view, f"{axis}_range")
    first, last = positions(low, high, np.array([0, FINEST - 1]))
    return float(first), float(last)


def _indices(view: View) -> tuple[str, ...]:
    """Return the index shown, and those that motions are classified by."""
    shown = () if view.index == MOTION else (view.index,)
    return tuple(dict.fromkeys((*shown, *NEEDED[:3])))


def _figure(index: str) -> tuple[str, tuple[str, ...]]:
    """Return which function of `plotting` draws a plane of an index, and its arguments beside the sweep."""
    if index == MOTION:
        return "motion_map", ()
    return ("exponent_map" if index.startswith("lyapunov") else "index_contour"), (index,)


def python_lines(view: View) -> str:
    """Return a script that computes and draws what the view shows."""
    osc = ", ".join(f"{name}={getattr(view.osc, name)!r}" for name in NAMES)
    (x0, x1), (y0, y1) = _axis(view, "x"), _axis(view, "y")
    start = "" if view.start is None else f", start=vi.{view.start!r}"
    figure, arguments = _figure(view.index)
    return f"""\
# The view of the explorer at ?{to_query(view)}
import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi

osc = vi.{type(view.osc).__name__}({osc})

# the plane, from rest; start={OTHERS + 1} tries {OTHERS} other initial conditions of each cell too
sweep = vi.parameter_map(
    osc,
    {view.x}=np.linspace({x0!r}, {x1!r}, {FINEST}),
    {view.y}=np.linspace({y0!r}, {y1!r}, {FINEST}),
    indices={list(_indices(view))!r},
    transient_impacts={TRANSIENT},
    sample_impacts={view.samples},
)
vi.plotting.{figure}({", ".join(["sweep", *map(repr, arguments)])})
plt.savefig("plane.png", dpi=150)

# the point
print(vi.describe(osc))
orbit = vi.simulate(osc{start})
hits = vi.impact_section(osc{start})
looks = vi.stroboscopic_section(osc{start})
for name, draw, data in [
    ("history", vi.plotting.time_history, orbit),
    ("portrait", vi.plotting.phase_portrait, orbit),
    ("impact_map", vi.plotting.impact_map, hits),
    ("poincare_map", vi.plotting.stroboscopic_map, looks),
]:
    draw(data)
    plt.savefig(f"{{name}}.png", dpi=150)
"""


def study_file(view: View) -> str:
    """Return the plane as a study file."""
    lines = ["[oscillator]", *(f"{name} = {_toml(getattr(view.osc, name))}" for name in NAMES), "", "[axes]"]
    for axis in ("x", "y"):
        first, last = _axis(view, axis)
        lines.append(f"{getattr(view, axis)} = {{ from = {_toml(first)}, to = {_toml(last)}, points = {FINEST} }}")
    lines += ["", "[sampling]", f"transient_impacts = {TRANSIENT}", f"sample_impacts = {view.samples}"]
    names = ", ".join(f'"{name}"' for name in _indices(view))
    lines += ["", "[run]", f"indices = [{names}]", ""]
    return "\n".join(lines)


def _toml(value: float) -> str:
    text = repr(float(value))
    return text if "." in text or "e" not in text else text.replace("e", ".0e")


def _data(explorer: Explorer) -> bytes:
    plane = _computed("plane", explorer.plane)
    if plane.stored:  # each of its cells is a copy of the nearest stored one
        raise ValueError(f"this plane is taken from {plane.stored}; use that file, or zoom to compute cells here")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plane.nc"
        vi.save(plane.dataset(), path)
        return path.read_bytes()


def _motion(explorer: Explorer) -> bytes:
    point = _computed("point", explorer.point)
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(["# " + ", ".join(f"{name} = {getattr(point.osc, name)!r}" for name in NAMES)])
    writer.writerow(["time [s]", "displacement [m]", "velocity [m/s]"])
    columns = (point.history[name].tolist() for name in ("time", "displacement", "velocity"))
    writer.writerows(zip(*columns, strict=True))
    return text.getvalue().encode()


def _picture(explorer: Explorer) -> bytes:
    """Return the plane, the four plots and the sentence as a PNG, drawn with the package's own plots."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    plane, point = _computed("plane", explorer.plane), _computed("point", explorer.point)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=SIZE, dpi=DPI, layout="constrained")
        FigureCanvasAgg(figure)
        grid = figure.add_gridspec(1, 2, width_ratios=(1.1, 1.0))
        _draw_plane(figure.add_subplot(grid[0]), plane, explorer.view)
        _draw_plots(grid[1].subgridspec(2, 2).subplots(), point)
        figure.suptitle(point.sentence, fontsize=10, color=INK)
        content = io.BytesIO()
        figure.savefig(content, format="png")
    return content.getvalue()


def _draw_plane(ax: Any, plane: Plane, view: View) -> None:
    figure, arguments = _figure(view.index)
    sweep = plane.dataset()
    cells = lattice(plane.side)
    hit = plane.elsewhere[np.ix_(cells, cells)] > 0.0
    sweep = sweep.assign({HATCHED: (sweep["status"].dims, hit)}).assign_attrs({HATCHED: ONLY_OTHERS})
    getattr(vi.plotting, figure)(sweep, *arguments, ax=ax)
    ring: dict[str, Any] = {"marker": "o", "markersize": 9, "markerfacecolor": "none"}
    for color, width in (("white", 3.5), (INK, None)):
        ax.plot(view.osc_value("x"), view.osc_value("y"), color=color, markeredgewidth=width, **ring)


def _draw_plots(axes: Any, point: Point) -> None:
    gap, (history, portrait), (looks, hits) = point.osc.gap, axes[0], axes[1]
    y, v = point.history["displacement"], point.history["velocity"]
    low, high = limits(y, point.size)
    high = max(high, gap + 0.05 * (gap - low))
    begin = float(point.history["time"][0]) if len(y) else 0.0
    states: dict[str, Any] = {"xlim": (low, high), "ylim": limits(v, point.osc.velocity_scale or 1.0)}
    history.plot(point.history["time"], y, color=BLUE, linewidth=0.9)
    history.set(xlim=(begin, begin + 8 * point.osc.period), ylim=(low, high), title="time history")
    portrait.plot(y, v, color=BLUE, linewidth=0.7)
    portrait.set(**states, title="phase portrait")
    looks.plot(point.poincare["displacement"], point.poincare["velocity"], ".", color=BLUE, markersize=3)
    looks.set(**states, title="Poincaré map")
    hits.plot(point.impact_map["phase"], point.impact_map["velocity"], ".", color=BLUE, markersize=3)
    most = float(point.impact_map["velocity"].max(initial=0.0)) or 1.0
    hits.set(xlim=(0, 1), ylim=(-0.03 * most, 1.08 * most), title="impact map")
    time, place, velocity, phase = (xr.DataArray(0.0, name=name) for name in ("time", *STATE))
    labels.label_axes(history, time, place)
    for plot in (portrait, looks):
        labels.label_axes(plot, place, velocity)
    labels.label_axes(hits, phase, xr.DataArray(impact_speed((), 0.0), name="velocity"))
    draw_stop(history, gap, high, upright=False)
    draw_stop(portrait, gap, high, upright=True)


KINDS: dict[str, tuple[str, str, Callable[[Explorer], bytes]]] = {
    "png": ("view.png", "image/png", _picture),
    "nc": ("plane.nc", "application/x-netcdf", _data),
    "csv": ("motion.csv", "text/csv", _motion),
    "toml": ("study.toml", "application/toml", lambda explorer: study_file(explorer.view).encode()),
    "py": ("view.py", "text/x-python", lambda explorer: python_lines(explorer.view).encode()),
}
