"""The view as one figure, drawn with the package's own plots."""

from __future__ import annotations

import io
from typing import Any

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import vibroimpact as vi
from vibroimpact.explorer.plane import Plane
from vibroimpact.explorer.point import Point
from vibroimpact.explorer.state import MOTION, View
from vibroimpact.plotting.style import BLUE, INK, STYLE, draw_stop
from vibroimpact.plotting.style import view as limits

SIZE, DPI = (13.0, 7.6), 150


def picture(plane: Plane, point: Point, view: View) -> bytes:
    """Return the plane, the four plots and the sentence as a PNG."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=SIZE, dpi=DPI, layout="constrained")
        FigureCanvasAgg(figure)
        parts: Any = figure.subfigures(1, 2, width_ratios=(1.1, 1.0))
        left, right = parts
        _plane(left.add_subplot(), plane, view)
        axes: Any = right.subplots(2, 2)
        _plots(axes, point)
        figure.suptitle(point.sentence, fontsize=10, color=INK)
        content = io.BytesIO()
        figure.savefig(content, format="png")
    return content.getvalue()


def _plane(ax: Any, plane: Plane, view: View) -> None:
    sweep = plane.dataset()
    if view.index == MOTION:
        vi.plotting.motion_map(sweep, ax=ax)
    elif view.index.startswith("lyapunov"):
        vi.plotting.exponent_map(sweep, view.index, ax=ax)
    else:
        vi.plotting.index_contour(sweep, view.index, ax=ax)
    ax.plot(view.osc_value("x"), view.osc_value("y"), marker="o", markersize=9, markerfacecolor="none", color="white",
            markeredgewidth=3.5)  # fmt: skip
    ax.plot(view.osc_value("x"), view.osc_value("y"), marker="o", markersize=9, markerfacecolor="none", color=INK)


def _plots(axes: Any, point: Point) -> None:
    gap, (history, portrait), (looks, hits) = point.osc.gap, axes[0], axes[1]
    size = max(point.osc.amplitude / point.osc.stiffness, abs(gap)) or 1.0
    y, v = point.history["displacement"], point.history["velocity"]
    low, high = limits(y, size)
    high = max(high, gap + 0.05 * (gap - low))
    history.plot(point.history["time"], y, color=BLUE, linewidth=0.9)
    begin = float(point.history["time"][0]) if len(y) else 0.0
    history.set(
        xlim=(begin, begin + 8 * point.osc.period), ylim=(low, high), xlabel="time [s]", ylabel="displacement [m]"
    )
    portrait.plot(y, v, color=BLUE, linewidth=0.7)
    portrait.set(xlim=(low, high), ylim=limits(v, point.osc.velocity_scale or 1.0))
    portrait.set(xlabel="displacement [m]", ylabel="velocity [m/s]")
    looks.plot(point.poincare["displacement"], point.poincare["velocity"], ".", color=BLUE, markersize=3)
    looks.set(xlim=portrait.get_xlim(), ylim=portrait.get_ylim(), xlabel="displacement [m]", ylabel="velocity [m/s]")
    hits.plot(point.impact_map["phase"], point.impact_map["velocity"], ".", color=BLUE, markersize=3)
    most = float(point.impact_map["velocity"].max(initial=0.0)) or 1.0
    hits.set(xlim=(0, 1), ylim=(-0.03 * most, 1.08 * most), xlabel="phase", ylabel="impact velocity [m/s]")
    draw_stop(history, gap, high, upright=False)
    draw_stop(portrait, gap, high, upright=True)
    for ax, title in zip(
        (history, portrait, looks, hits), ("time history", "phase portrait", "Poincaré map", "impact map"), strict=True
    ):
        ax.set_title(title)
