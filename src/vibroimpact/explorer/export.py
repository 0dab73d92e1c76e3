"""A view as files: picture, data, study file, and the Python lines that make it again."""

from __future__ import annotations

import csv
import io
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vibroimpact.explorer.address import to_query
from vibroimpact.explorer.plane import TRANSIENT, positions
from vibroimpact.explorer.session import Explorer
from vibroimpact.explorer.state import FINEST, MOTION, View
from vibroimpact.oscillator import PARAMETERS


@dataclass(frozen=True)
class File:
    """A file for the browser to keep."""

    name: str
    type: str
    content: bytes


def export(kind: str, explorer: Explorer) -> File:
    """Return the view as a file of that kind."""
    return KINDS[kind](explorer)


def _lattice(view: View, axis: str) -> tuple[float, float]:
    """Return the first and the last value along an axis of the finest lattice."""
    low, high = getattr(view, f"{axis}_range")
    first, last = positions(low, high, np.array([0, FINEST - 1]))
    return float(first), float(last)


def _indices(view: View) -> tuple[str, ...]:
    named = ("lyapunov_per_impact", "n_periods", "n_impacts")
    return named if view.index == MOTION else tuple(dict.fromkeys((view.index, *named)))


def python_lines(view: View) -> str:
    """Return a script that computes and draws what the view shows."""
    osc = ", ".join(f"{name}={getattr(view.osc, name)!r}" for name in PARAMETERS)
    (x0, x1), (y0, y1) = _lattice(view, "x"), _lattice(view, "y")
    start = ""
    if view.start is not None:
        start = f", start=vi.{view.start!r}"
    plot = "motion_map(sweep)" if view.index == MOTION else f'index_contour(sweep, "{view.index}")'
    if view.index.startswith("lyapunov"):
        plot = f'exponent_map(sweep, "{view.index}")'
    return f"""\
# The view of the explorer at ?{to_query(view)}
import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi

osc = vi.ImpactOscillator({osc})

# the plane
sweep = vi.parameter_map(
    osc,
    {view.x}=np.linspace({x0!r}, {x1!r}, {FINEST}),
    {view.y}=np.linspace({y0!r}, {y1!r}, {FINEST}),
    indices={list(_indices(view))!r},
    transient_impacts={TRANSIENT},
    sample_impacts={view.samples},
)
vi.plotting.{plot}
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
    lines = ["[oscillator]", *(f"{name} = {_toml(getattr(view.osc, name))}" for name in PARAMETERS), "", "[axes]"]
    for axis in ("x", "y"):
        first, last = _lattice(view, axis)
        lines.append(f"{getattr(view, axis)} = {{ from = {_toml(first)}, to = {_toml(last)}, points = {FINEST} }}")
    lines += ["", "[sampling]", f"transient_impacts = {TRANSIENT}", f"sample_impacts = {view.samples}"]
    names = ", ".join(f'"{name}"' for name in _indices(view))
    lines += ["", "[run]", f"indices = [{names}]", ""]
    return "\n".join(lines)


def _toml(value: float) -> str:
    text = repr(float(value))
    return text if "." in text or "e" not in text else text.replace("e", ".0e")


def _python(explorer: Explorer) -> File:
    return File("view.py", "text/x-python", python_lines(explorer.view).encode())


def _study(explorer: Explorer) -> File:
    return File("study.toml", "application/toml", study_file(explorer.view).encode())


def _data(explorer: Explorer) -> File:
    import vibroimpact as vi

    plane = _known_plane(explorer)
    if plane.stored:  # each of its cells stands for the nearest stored one
        raise ValueError(
            f"the plane is taken from {plane.stored}; allowed is what was computed here; take it from there, or zoom"
        )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plane.nc"
        vi.save(plane.dataset(), path)
        return File("plane.nc", "application/x-netcdf", path.read_bytes())


def _motion(explorer: Explorer) -> File:
    point = explorer.point
    if point is None:
        raise ValueError("the point is not computed yet; allowed is to wait a moment; export it again")
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(["# " + ", ".join(f"{name} = {getattr(point.osc, name)!r}" for name in PARAMETERS)])
    writer.writerow(["time [s]", "displacement [m]", "velocity [m/s]"])
    columns = (point.history[name].tolist() for name in ("time", "displacement", "velocity"))
    writer.writerows(zip(*columns, strict=True))
    return File("motion.csv", "text/csv", text.getvalue().encode())


def _known_plane(explorer: Explorer) -> Any:
    if explorer.plane is None or not explorer.plane.side:
        raise ValueError("the plane is not computed yet; allowed is to wait a moment; export it again")
    return explorer.plane


def _picture(explorer: Explorer) -> File:
    """Draw the plane and the four plots as one figure."""
    from vibroimpact.explorer.picture import picture

    if explorer.point is None:
        raise ValueError("the point is not computed yet; allowed is to wait a moment; export it again")
    return File("view.png", "image/png", picture(_known_plane(explorer), explorer.point, explorer.view))


KINDS = {"png": _picture, "nc": _data, "csv": _motion, "toml": _study, "py": _python}
