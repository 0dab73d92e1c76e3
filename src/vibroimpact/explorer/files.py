"""Export of a view: data, study file, and the Python code that reproduces it."""

from __future__ import annotations

import csv
import io
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import vibroimpact as vi
from vibroimpact import figures
from vibroimpact.explorer.address import to_query
from vibroimpact.explorer.limits import FINEST
from vibroimpact.explorer.plane import OTHERS, TRANSIENT, WORST, positions
from vibroimpact.explorer.session import Explorer
from vibroimpact.explorer.state import View
from vibroimpact.figures import MOTION
from vibroimpact.motion import NAMING


@dataclass(frozen=True)
class File:
    """A file for the browser to save."""

    name: str
    type: str
    content: bytes


def export(kind: str, explorer: Explorer) -> File:
    """Return the view as a file of the given kind."""
    name, media_type, make = KINDS[kind]
    return File(name, media_type, make(explorer))


def _computed(name: str, result: Any) -> Any:
    if result is None:
        raise ValueError(f"this {name} is still being computed; try again in a moment")
    return result


def _axis(view: View, axis: str) -> tuple[float, float]:
    """Return the first and the last value along an axis of the finest lattice."""
    low, high = getattr(view, f"{axis}_range")
    first, last = positions(low, high, np.array([0, FINEST - 1]))
    return float(first), float(last)


def _indices(view: View) -> tuple[str, ...]:
    """Return the index shown, and those needed to classify motions."""
    shown = () if view.index == MOTION else (view.index,)
    return tuple(dict.fromkeys((*shown, *NAMING)))


def python_lines(view: View) -> str:
    """Return a script that computes and plots the contents of the view."""
    (x0, x1), (y0, y1) = _axis(view, "x"), _axis(view, "y")
    start = "" if view.start is None else f", start=vi.{view.start!r}"
    figure = figures.KINDS[figures.kind_of_index(view.index)].function
    arguments = () if view.index == MOTION else (view.index,)
    note = f"# the plane, from rest; start={OTHERS + 1} also tries {OTHERS} other initial conditions in each cell"
    more = ""
    if view.worst:
        note, more = f"# the plane, {WORST} in each cell", f"\n    start={OTHERS + 1},"
    return f"""\
# The view of the explorer at ?{to_query(view)}
import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi

{_model_lines(view)}

{note}
sweep = vi.parameter_map(
    osc,
    {view.x}=np.linspace({x0!r}, {x1!r}, {FINEST}),
    {view.y}=np.linspace({y0!r}, {y1!r}, {FINEST}),
    indices={list(_indices(view))!r},
    transient_impacts={TRANSIENT},
    sample_impacts={view.samples},{more}
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


def _model_lines(view: View) -> str:
    """Return the lines that create the model."""
    values = ", ".join(f"{name}={value!r}" for name, value in view.values.items())
    if not view.model:
        return f"osc = vi.{type(view.osc).__name__}({values})"
    if view.model in vi.models.__all__:
        return f"osc = vi.family(vi.models.{view.model}).replace({values})"
    file, _, name = view.model.rpartition(":")
    source = f"from {Path(file).stem} import {name}" if file else f"# define {view.model} here"
    return f"{source}\n\nosc = {name}.replace({values})"


def study_file(view: View) -> str:
    """Return the plane as a study file."""
    lines = [f'model = "{view.model}"', ""] if view.model else []
    lines += ["[oscillator]", *(f"{name} = {_toml(value)}" for name, value in view.values.items()), "", "[axes]"]
    for axis in ("x", "y"):
        first, last = _axis(view, axis)
        lines.append(f"{getattr(view, axis)} = {{ from = {_toml(first)}, to = {_toml(last)}, points = {FINEST} }}")
    lines += ["", "[sampling]", f"transient_impacts = {TRANSIENT}", f"sample_impacts = {view.samples}"]
    names = ", ".join(f'"{name}"' for name in _indices(view))
    lines += ["", "[run]", f"indices = [{names}]", *[f"starts = {OTHERS + 1}"] * view.worst, ""]
    return "\n".join(lines)


def _toml(value: float) -> str:
    text = repr(float(value))
    return text if "." in text or "e" not in text else text.replace("e", ".0e")


def _data(explorer: Explorer) -> bytes:
    plane = _computed("plane", explorer.plane)
    if plane.stored:  # each of its cells is a copy of the nearest stored cell
        raise ValueError(f"this plane was read from {plane.stored}; use that file, or zoom in to compute cells here")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plane.nc"
        vi.save(plane.dataset(), path)
        return path.read_bytes()


def _motion(explorer: Explorer) -> bytes:
    point = _computed("point", explorer.point)
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(["# " + ", ".join(f"{name} = {value!r}" for name, value in explorer.view.values.items())])
    writer.writerow(["time [s]", f"{point.shown.name.removesuffix(' y')} [m]", "velocity [m/s]"])
    columns = (point.history[name].tolist() for name in ("time", "displacement", "velocity"))
    writer.writerows(zip(*columns, strict=True))
    return text.getvalue().encode()


KINDS: dict[str, tuple[str, str, Callable[[Explorer], bytes]]] = {
    "nc": ("plane.nc", "application/x-netcdf", _data),
    "csv": ("motion.csv", "text/csv", _motion),
    "toml": ("study.toml", "application/toml", lambda explorer: study_file(explorer.view).encode()),
    "py": ("view.py", "text/x-python", lambda explorer: python_lines(explorer.view).encode()),
}
