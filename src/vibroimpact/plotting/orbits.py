"""One motion in time: time history and phase portrait."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from vibroimpact.parameters import counted
from vibroimpact.plotting import labels, style
from vibroimpact.plotting.style import BLUE, DOTS, GREEN, INK, RINGS, Floats, on_axes
from vibroimpact.plotting.views import View, between_impacts, stops_of, view_of
from vibroimpact.plotting.walls import color_of, draw_forces, draw_walls
from vibroimpact.status import Status

Dims = str | tuple[str, ...]
STATES: dict[str, Dims] = {
    "displacement": "time",
    "velocity": "time",
    "impact_time": "impact",
    "impact_velocity": "impact",
}
PARTS = 6  # of the line between two samples
COORDINATES: dict[str, Dims] = {
    "displacement": ("time", "coordinate"),
    "velocity": ("time", "coordinate"),
    "impact_stop": "impact",
}


def check_result(argument: str, value: Any, maker: str, needed: Mapping[str, Dims]) -> None:
    """Raise `ValueError` unless a result has the required variables, each over the required dimension."""
    if not isinstance(value, xr.Dataset) or any(
        name not in value or value[name].dims != ((dim,) if isinstance(dim, str) else dim)
        for name, dim in needed.items()
    ):
        wanted = ", ".join(
            f"{name} over {dim if isinstance(dim, str) else ' and '.join(dim)}" for name, dim in needed.items()
        )
        raise labels.refused(
            argument, value, f"a result of {maker} ({wanted})", f"pass what vibroimpact.{maker} returns"
        )


def legend(ax: Axes, dataset: xr.Dataset, *above: Axes) -> None:
    """Draw the legend of the axes and those above, with the status of the motion unless it is complete."""
    status = status_of(dataset)
    if status is not None and not status.has_indices:
        ax.plot([], [], linestyle="none", label=style.outcome(status))
    style.legend_below(ax, [handle for panel in (*above, ax) for handle in panel.get_legend_handles_labels()[0]])


def status_of(dataset: xr.Dataset) -> Status | None:
    """Return the status of the one motion of a result; None if there are several."""
    return Status(int(dataset["status"])) if "status" in dataset and dataset["status"].ndim == 0 else None


def _broken_orbit(states: tuple[Floats, ...], impacts: tuple[Floats, ...]) -> tuple[Floats, Floats, Floats]:
    """Return time, y and y' with each impact inserted: arrival, a break (NaN) where y' jumps, departure.

    `states` holds time, y and y' of samples; `impacts` holds times, y, and y' before and after. Samples alone would
    replace the corner at each impact by a chord.
    """
    (sampled, place, rate), (times, at, before, after) = states, impacts
    jump = np.column_stack([before, np.where(before == after, before, np.nan), after]).ravel()
    free = between_impacts(sampled, times)
    t = np.concatenate([np.repeat(times, 3), sampled[free]])
    y = np.concatenate([np.where(np.isnan(jump), np.nan, np.repeat(at, 3)), place[free]])
    dy = np.concatenate([jump, rate[free]])
    order = np.argsort(t, kind="stable")
    return _rounded(t[order], y[order], dy[order])


def _rounded(t: Floats, y: Floats, dy: Floats) -> tuple[Floats, Floats, Floats]:
    """Return cubic interpolants between neighbouring states (y and y' at both ends), for smooth lines.

    For a sample spacing h the error is (h w)^4/384 of the motion's size, less than a line's width. NaN remains a break.
    """
    if len(t) > 50_000:
        return t, y, dy
    s, h = np.arange(PARTS) / PARTS, np.diff(t)[:, None]
    y0, y1, v0, v1 = y[:-1, None], y[1:, None], dy[:-1, None], dy[1:, None]
    # Between nearly equal instants, as at an impact, slopes would consist of rounding errors.
    apart = h > 1e-6 * h.max(initial=0.0)
    slope = (y1 - y0) / np.where(apart, h, 1.0)
    bend = s * s * (3.0 - 2.0 * s)
    fine_t = t[:-1, None] + h * s
    fine_y = y0 + bend * (y1 - y0) + h * s * (1.0 - s) * ((1.0 - s) * v0 - s * v1)
    fine_dy = 6.0 * s * (1.0 - s) * slope + (1.0 - s) * (1.0 - 3.0 * s) * v0 + s * (3.0 * s - 2.0) * v1
    fine_y[:, 0], fine_dy[:, 0] = y[:-1], dy[:-1]
    keep = apart | (s == 0.0)
    return np.append(fine_t[keep], t[-1:]), np.append(fine_y[keep], y[-1:]), np.append(fine_dy[keep], dy[-1:])


def _sticks(simulation: xr.Dataset) -> Floats:
    """Return the (begin, end) of each stick; without a release it lasts to the end of the record."""
    if "stick_time" not in simulation:
        return np.empty((0, 2))
    starts, ends = simulation["stick_time"].values, simulation["release_time"].values
    return np.column_stack([starts, np.where(np.isnan(ends), float(simulation["time"][-1]), ends)])


def draw_sticks(ax: Axes, bars: Any, name: str, zorder: float) -> None:
    """Draw a bar along each stick, given as a line of times and positions."""
    look: dict[str, Any] = {"colors": GREEN, "linewidths": 5, "zorder": zorder, "capstyle": "butt"}
    ax.add_collection(LineCollection(bars, label=name, **look), autolim=False)


@dataclass(frozen=True)
class _Motion:
    """The data drawn from a simulation: y and y' over time and at impacts, and the line through both."""

    view: View
    y: xr.DataArray
    rate: xr.DataArray
    impacts: tuple[Floats, ...]  # y, and y' before and after
    line: tuple[Floats, Floats, Floats]

    def groups(self, simulation: xr.Dataset) -> Iterator[tuple[Any, str, str]]:
        """Yield the groups of impacts drawn in one style, with colour and name."""
        for wall, struck in self.view.struck(simulation):
            where = f" on {wall.name}" if "impact_stop" in simulation else ""
            text = counted(int(struck.sum()), "impact") + where
            yield struck, color_of(self.view.model, wall.name), text

    def rests(self, simulation: xr.Dataset) -> Iterator[tuple[list[Floats], str, str]]:
        """Yield, for each stop drawn, time, y and y' along each stick at it, their name, and their position."""
        sticks, names = _sticks(simulation), stops_of(simulation, "stick", self.view.model)
        for wall in self.view.walls:
            spans = sticks[names == wall.name]
            where = f" ({wall.name} is closed)" if "stick_stop" in simulation else " (at rest at the stop)"
            if len(spans):
                yield [self.view.rest(wall, *span) for span in spans], counted(len(spans), "stick"), where

    def limits(self, ax: Axes, *, upright: bool) -> tuple[float, float]:
        """Draw the stops and return the limits of the y axis."""
        return draw_walls(ax, self.view, self.line[1], self.line[0], upright=upright)


def _motion(simulation: xr.Dataset, coordinate: int | None, stop: str | None) -> _Motion:
    """Return the motion to draw from a checked simulation."""
    several = isinstance(simulation, xr.Dataset) and "coordinate" in simulation.dims
    check_result("simulation", simulation, "simulate", STATES | (COORDINATES if several else {}))
    view = view_of(simulation, coordinate, stop)
    if view is None:
        raise ValueError(
            "`simulation` has no attribute 'oscillator', which holds the position of the stop; "
            "to keep attributes in computations with results, call xarray.set_options(keep_attrs=True)"
        )
    y, rate, impacts = view.labelled(simulation), view.labelled(simulation, rate=True), view.impacts(simulation)
    states = simulation["time"].values, y.values, rate.values
    return _Motion(view, y, rate, impacts, _broken_orbit(states, (simulation["impact_time"].values, *impacts)))


@on_axes
def time_history(
    simulation: xr.Dataset, ax: Axes | None = None, *, coordinate: int | None = None, stop: str | None = None
) -> Axes:
    """Draw displacement against time, with the stop, the impacts on it and the sticks.

    The line includes the instants of impact, so that it reaches the stop exactly. For systems, a coordinate or the
    clearance of a stop is drawn with all stops that act on it alone, and impacts are coloured by stop. The penetration
    of compliant stops is shaded; a new figure then also shows the forces of all stops in a panel below, where each
    contact with a compliant one has a box with its duration and peak force.

    Parameters
    ----------
    simulation : xarray.Dataset
        The result of `vibroimpact.simulate`.
    coordinate : int, optional
        For systems, the coordinate drawn; 0 is the first. None draws the first coordinate or, if no stop acts on it
        alone, the clearance of the first stop.
    stop : str, optional
        For systems, the stop whose clearance is drawn instead of a coordinate.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> ax = vi.plotting.time_history(vi.simulate(vi.ImpactOscillator(omega=2.0), periods=5))
    >>> ax.get_xlabel()
    'time $t$ [s]'
    """
    motion, new = _motion(simulation, coordinate, stop), ax is None
    ax = style.new_axes(ax, (8.0, 3.8), labels.title(simulation))
    t, y, _ = motion.line
    whole = ~np.isnan(y)
    ax.plot(t[whole], y[whole], color=BLUE, linewidth=1.2, zorder=2)

    ax.set_ylim(*motion.limits(ax, upright=False))
    impacts = simulation["impact_time"].values
    for struck, color, text in motion.groups(simulation):
        look = DOTS | {"color": color, "markersize": 4, "zorder": 5}
        ax.plot(impacts[struck], motion.impacts[0][struck], label=text, **look)
    for rests, text, where in motion.rests(simulation):
        draw_sticks(ax, [rest[:, :2] for rest in rests], text + where, 4)
    ax.set_xlim(float(simulation["time"][0]), float(simulation["time"][-1]))
    if new and any(not stop.element.instantaneous for stop in motion.view.model.stops):
        labels.label_axis(ax.yaxis, motion.y)
        below = style.panel_below(ax, 1.9)
        draw_forces(below, motion.view.model, simulation)
        legend(below, simulation, ax)
    else:
        labels.label_axes(ax, simulation["time"], motion.y)
        legend(ax, simulation)
    return ax


@on_axes
def phase_portrait(
    simulation: xr.Dataset, ax: Axes | None = None, *, coordinate: int | None = None, stop: str | None = None
) -> Axes:
    """Draw velocity against displacement, with the stop and the jumps of velocity at it.

    The line is broken at each impact; a thin dashed line joins arrival (y' = v) and departure (y' = -r v). Between
    samples the line is a cubic through the states at both ends. For systems, a coordinate or the clearance of a stop is
    drawn against its rate, with all stops that act on it alone. A moving stop is drawn at its farthest position, and
    the line is also broken where impacts on other rigid stops make the rate jump. At a compliant stop no velocity
    jumps; its penetration is shaded.

    Parameters
    ----------
    simulation : xarray.Dataset
        The result of `vibroimpact.simulate`.
    coordinate : int, optional
        For systems, the coordinate drawn, as in `time_history`.
    stop : str, optional
        For systems, the stop whose clearance is drawn instead of a coordinate.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> ax = vi.plotting.phase_portrait(vi.simulate(vi.ImpactOscillator(omega=2.8)))
    >>> ax.get_xlabel()
    'displacement $y$ [m]'
    """
    motion = _motion(simulation, coordinate, stop)
    ax = style.new_axes(ax, (6.4, 5.4), labels.title(simulation))
    _, y, dy = motion.line
    ax.plot(y, dy, color=BLUE, linewidth=0.9, label="flight", zorder=2)
    for struck, color, text in motion.groups(simulation):
        place, before, after = (part[struck] for part in motion.impacts)
        ends = zip(place, before, after, strict=True)
        jumps = [[(at, arrives), (at, leaves)] for at, arrives, leaves in ends if leaves != arrives]
        thin: dict[str, Any] = {
            "colors": color,
            "linewidths": 0.8,
            "linestyles": (0, (3, 2)),
            "zorder": 3,
            "alpha": 0.6,
        }
        if jumps:
            ax.add_collection(LineCollection(jumps, label=text, **thin), autolim=False)
        ax.plot(place, before, **DOTS, color=color, markersize=3, zorder=4, label="" if jumps else text)
    for rests, text, where in motion.rests(simulation):
        name = text + where * ("stick_stop" in simulation)
        if all(np.ptp(rest[:, 1:], axis=0).any() for rest in rests):  # for a moving stop
            draw_sticks(ax, [rest[:, 1:] for rest in rests], name, 5)
        else:
            ax.plot(*rests[0][:1, 1:].T, "s", color=GREEN, markersize=7, markeredgewidth=0, label=name, zorder=5)
    ring = RINGS | {"markeredgecolor": INK, "markersize": 5, "zorder": 6}
    ax.plot(float(motion.y[0]), float(motion.rate[0]), label="start", **ring)
    ax.set_xlim(*motion.limits(ax, upright=True))
    ax.set_ylim(*style.view(dy, style.magnitude(dy, motion.view.model.velocity_scale)))
    labels.label_axes(ax, motion.y, motion.rate)
    legend(ax, simulation)
    return ax
