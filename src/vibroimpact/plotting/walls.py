"""Drawing of the walls of a view and of the forces of stops."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.colors import to_rgba
from matplotlib.patches import Rectangle

from vibroimpact.plotting import labels, style
from vibroimpact.plotting.style import INK, RED, Floats
from vibroimpact.plotting.views import View, Wall

STOPS = (RED, "#e69f00", "#7a3dd8", "#0b7a75", "#7a5230")  # of impacts, by stop in the model's order
FAR = 3.0  # in spans of the motion: an arrow points to a wall that is farther away
ROOM = 0.12  # of the span: depth drawn behind a wall
TOUCHED = float(np.finfo(float).tiny)  # m: the depth just after contact begins


def color_of(model: Any, name: str) -> str:
    """Return the colour of the impacts on a stop."""
    return style.color_at(STOPS, model.stop_names.index(name))


def caption_of(model: Any, name: str) -> str:
    """Return the name of a stop, with its gap if the model has the single parameter `gap`."""
    return f"{name}, {labels.parameter_text('gap', model)}" if "gap" in model.parameters else name


def draw_walls(ax: Axes, view: View, y: Floats, time: Floats, *, upright: bool) -> tuple[float, float]:
    """Draw the stops that act on y alone; return the limits of the y axis.

    Over time, the motion of a moving stop is drawn; in a portrait (upright), its farthest position. Arrows point to
    stops outside the limits. The part of a stop that the motion penetrates is shaded in the stop's colour.
    """
    scale = view.model.velocity_scale / view.model.slowest_frequency
    low, high = style.view(y, style.magnitude(y, scale))
    span = high - low
    near: list[tuple[Wall, Floats, float]] = []
    far: list[tuple[Wall, float]] = []
    for wall in view.walls:
        place = view.place(wall, time)
        outermost = float((wall.side * place).max()) * wall.side
        if (outermost - high if wall.side > 0 else low - outermost) <= FAR * span:
            near.append((wall, place, outermost))
        else:
            far.append((wall, outermost))
    reached = np.append(y, [outermost for _, _, outermost in near])
    low, high = style.view(reached, style.magnitude(reached, scale))
    room = ROOM * (high - low)
    deepest = {wall.name: _deepest(wall, y, outermost) for wall, _, outermost in near}
    for wall, _, _ in near:
        end = deepest[wall.name]
        low, high = (low, max(high, end + room)) if wall.side > 0 else (min(low, end - room), high)
    for wall, place, outermost in near:
        beyond = high if wall.side > 0 else low
        if view.moves(wall) and not upright:
            ax.fill_between(time, place, beyond, zorder=1.5, **style.BEHIND[wall.element.impenetrable])
            ax.plot(time, place, **style.FACE[wall.element.impenetrable], zorder=1.6)
        else:
            style.draw_stop(ax, outermost, beyond, upright=upright, impenetrable=wall.element.impenetrable)
        if not wall.element.impenetrable:
            _shade(ax, wall, (time, y, place), color_of(view.model, wall.name), upright=upright)
        _name(ax, caption_of(view.model, wall.name), 0.5 * (deepest[wall.name] + beyond), upright=upright)
    for wall, outermost in far:
        above, room = wall.side > 0, ROOM * (high - low)
        caption = caption_of(view.model, wall.name)
        far_off = "" if caption != wall.name else f" at {outermost:.4g} m"
        # Rotated with its text by a quarter turn, the downward arrow points right.
        arrow = r"$\downarrow$" if upright == above else r"$\uparrow$"
        _name(ax, f"{caption}{far_off} {arrow}", high + 0.5 * room if above else low - 0.5 * room, upright=upright)
        low, high = (low, high + room) if above else (low - room, high)
    return low, high


def draw_forces(ax: Axes, model: Any, simulation: xr.Dataset) -> None:
    """Draw the forces of stops over time, with a box of the duration and peak force behind each contact that lasts."""
    for stop in model.stops:
        force = simulation["force"].sel(stop=stop.name).values
        lasts = not stop.element.instantaneous
        hits = simulation.isel(impact=np.flatnonzero((simulation["impact_stop"] == stop.name) & lasts))
        if not (lasts or force.any()):
            continue
        begins, length, peak = (hits[name].values for name in ("impact_time", "contact_time", "peak_force"))
        touch = stop.element.force(np.full(len(begins), TOUCHED), hits["impact_velocity"].values)  # it jumps from zero
        time = np.concatenate([simulation["time"].values, begins, begins, begins + length])
        force = np.concatenate([force, 0.0 * touch, touch, 0.0 * touch])
        order, color = np.argsort(time, kind="stable")[: np.isfinite(time).sum()], color_of(model, str(stop.name))
        ax.plot(time[order], force[order], color=color, linewidth=1.2, zorder=3, label=f"force of {stop.name}")
        boxes = [Rectangle((at, 0.0), long, most) for at, long, most in zip(begins, length, peak, strict=True)]
        look: dict[str, Any] = {"facecolor": to_rgba(color, 0.2), "edgecolor": to_rgba(color, 0.5), "linewidth": 0.8}
        ax.add_collection(PatchCollection(boxes, **look, zorder=2))
    ax.set_ylim(bottom=0.0)
    labels.label_axes(ax, simulation["time"], simulation["force"])


def _deepest(wall: Wall, y: Floats, outermost: float) -> float:
    """Return the deepest position of the motion in a stop; the position of an impenetrable stop."""
    if wall.element.impenetrable:
        return outermost
    reached = np.append(y[np.isfinite(y)], outermost)
    return float(reached.max() if wall.side > 0 else reached.min())


def _shade(ax: Axes, wall: Wall, line: tuple[Floats, Floats, Floats], color: str, *, upright: bool) -> None:
    """Shade where the motion is inside a stop."""
    time, y, place = line
    inside = (y - place) * wall.side >= 0.0
    look: dict[str, Any] = {"facecolor": color, "alpha": 0.2, "linewidth": 0.0, "zorder": 1.7}
    if not upright:
        ax.fill_between(time, place, y, where=inside, label=f"penetration of {wall.name}", **look)
    elif inside.any():
        ends = place[inside], y[inside]
        ax.axvspan(min(map(np.min, ends)), max(map(np.max, ends)), label=f"penetration of {wall.name}", **look)


def _name(ax: Axes, text: str, middle: float, *, upright: bool) -> None:
    place: dict[str, Any] = {"x": 0.995, "y": middle, "transform": ax.get_yaxis_transform(), "ha": "right"}
    if upright:
        place = {"x": middle, "y": 0.995, "transform": ax.get_xaxis_transform(), "rotation": 90, "ha": "center"}
    box = {"facecolor": "#ededed", "edgecolor": "none", "pad": 2}
    ax.text(s=text, va="top" if upright else "center", fontsize=8.5, color=INK, bbox=box, **place)
