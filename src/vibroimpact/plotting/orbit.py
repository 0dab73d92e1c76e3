"""One orbit: displacement against time, and the phase portrait."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from numpy.typing import NDArray

from vibroimpact.oscillator import ImpactOscillator
from vibroimpact.plotting.checks import check_result
from vibroimpact.plotting.style import (
    BLUE,
    GREEN,
    INK,
    RED,
    Floats,
    draw_stop,
    label,
    legend_below,
    magnitude,
    new_axes,
    required_oscillator,
    tell_outcome,
    title,
    unit_suffix,
    view,
    words,
)

_NEEDED = {"displacement": "time", "velocity": "time", "impact_time": "impact", "impact_velocity": "impact"}


def _broken_orbit(simulation: xr.Dataset, gap: float, restitution: float) -> tuple[Floats, Floats, Floats]:
    """Return time, y and y' with each impact put in: arrival, a break (NaN), departure at -r times the speed.

    Samples alone would cut the corner at each impact with a chord that the mass never follows.
    """
    times, speeds = simulation["impact_time"].values, simulation["impact_velocity"].values
    jump = np.column_stack([speeds, np.full_like(speeds, np.nan), -restitution * speeds]).ravel()
    sampled = simulation["time"].values
    # A sample at an impact holds the state after it, but rounding may put its time before: the impact says it all.
    own = ~_beside(sampled, times)
    t = np.concatenate([np.repeat(times, 3), sampled[own]])
    y = np.concatenate([np.where(np.isnan(jump), np.nan, gap), simulation["displacement"].values[own]])
    dy = np.concatenate([jump, simulation["velocity"].values[own]])
    order = np.argsort(t, kind="stable")
    return _rounded(t[order], y[order], dy[order])


def _beside(sampled: Floats, times: Floats) -> NDArray[np.bool_]:
    """Return which samples lie at an impact, to a millionth of the sampling."""
    if times.size == 0 or sampled.size < 2:
        return np.zeros(sampled.shape, dtype=bool)
    following = np.searchsorted(times, sampled)
    nearest = np.minimum(
        np.abs(times[np.clip(following, 0, times.size - 1)] - sampled),
        np.abs(times[np.clip(following - 1, 0, times.size - 1)] - sampled),
    )
    return np.asarray(nearest < 1e-6 * (sampled[1] - sampled[0]))


def _rounded(t: Floats, y: Floats, dy: Floats, parts: int = 6) -> tuple[Floats, Floats, Floats]:
    """Return the cubic through neighbouring states (y and y' at both ends), so that few samples draw no polygon.

    It leaves the motion by (h w)^4/384 of its size, h apart: less than a line's width. NaN stays a break.
    """
    if len(t) > 50_000:
        return t, y, dy
    s, h = np.arange(parts) / parts, np.diff(t)[:, None]
    y0, y1, v0, v1 = y[:-1, None], y[1:, None], dy[:-1, None], dy[1:, None]
    # Between instants as good as equal, as at an impact, a slope would be nothing but rounding.
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
    """Return the (start, end) of each stick; one not released lasts to the end of the record."""
    if "stick_time" not in simulation:
        return np.empty((0, 2))
    ends = simulation["release_time"].values
    ends = np.where(np.isnan(ends), float(simulation["time"][-1]), ends)
    return np.column_stack([simulation["stick_time"].values, ends])


def _stop(ax: Axes, displacement: Floats, osc: ImpactOscillator, unit: str, *, upright: bool) -> tuple[float, float]:
    """Draw the stop and return the limits of the displacement axis; a stop too far off is only told."""
    size = magnitude(displacement, osc.velocity_scale / osc.natural_frequency)
    told = f"stop, $g$ = {osc.gap:g}{unit}"
    low, high = view(displacement, size)
    near = osc.gap - high <= 3.0 * (high - low)
    if near:
        low, high = view(np.append(displacement, osc.gap), size)
        start = osc.gap
        high = start + max(0.12 * (high - low), high - start)
        draw_stop(ax, start, high, upright=upright)
    else:
        # Turned with its text by a quarter, the downward arrow points right, to where the stop is.
        told += r" $\downarrow$" if upright else r" $\uparrow$"
        start, high = high, high + 0.12 * (high - low)
    middle = 0.5 * (start + high)
    place: dict[str, Any] = {"x": 0.995, "y": middle, "transform": ax.get_yaxis_transform(), "ha": "right"}
    if upright:
        place = {"x": middle, "y": 0.995, "transform": ax.get_xaxis_transform(), "rotation": 90, "ha": "center"}
    box = {"facecolor": "#ededed", "edgecolor": "none", "pad": 2}
    ax.text(s=told, va="top" if upright else "center", fontsize=8.5, color=INK, bbox=box, **place)
    return low, high


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"


def time_history(simulation: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw displacement against time, with the stop, the impacts on it and the sticks.

    Parameters
    ----------
    simulation : xarray.Dataset
        What `vibroimpact.simulate` returns.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure without it.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        `simulation` is another kind of result, or does not tell its oscillator.

    Notes
    -----
    Impact instants are put into the line, so that it reaches the stop where the mass does.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> ax = vi.plotting.time_history(vi.simulate(vi.ImpactOscillator(omega=2.0), periods=5))
    >>> ax.get_xlabel()
    'time $t$ [s]'
    """
    check_result("simulation", simulation, "simulate", _NEEDED)
    osc = required_oscillator("simulation", simulation)
    ax = new_axes(ax, (8.0, 3.8), title(simulation))
    t, y, _ = _broken_orbit(simulation, osc.gap, osc.restitution)
    whole = ~np.isnan(y)
    ax.plot(t[whole], y[whole], color=BLUE, linewidth=1.2, zorder=2)

    unit = unit_suffix(words(simulation["displacement"])[1], " {}")
    ax.set_ylim(*_stop(ax, y, osc, unit, upright=False))
    impacts = simulation["impact_time"].values
    if impacts.size:
        at_stop = np.full_like(impacts, osc.gap)
        name = _counted(impacts.size, "impact")
        ax.plot(impacts, at_stop, "o", color=RED, markersize=4, markeredgewidth=0, label=name, zorder=5)
    sticks = _sticks(simulation)
    if len(sticks):
        bars = [[(start, osc.gap), (end, osc.gap)] for start, end in sticks]
        name = f"{_counted(len(sticks), 'stick')} (at rest on the stop)"
        ax.add_collection(LineCollection(bars, colors=GREEN, linewidths=5, label=name, zorder=4), autolim=False)
    ax.set_xlim(float(simulation["time"][0]), float(simulation["time"][-1]))
    ax.set_xlabel(label(simulation["time"]))
    ax.set_ylabel(label(simulation["displacement"]))
    tell_outcome(ax, simulation)
    legend_below(ax)
    return ax


def phase_portrait(simulation: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw velocity against displacement, with the stop and the jumps of velocity at it.

    The line is broken at each impact; a thin dashed line joins arrival (y' = v) and departure (y' = -r v).

    Parameters
    ----------
    simulation : xarray.Dataset
        What `vibroimpact.simulate` returns.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure without it.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        `simulation` is another kind of result, or does not tell its oscillator.

    Notes
    -----
    Between samples both figures follow the cubic through the states at either end.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> ax = vi.plotting.phase_portrait(vi.simulate(vi.ImpactOscillator(omega=2.8)))
    >>> ax.get_xlabel()
    'displacement $y$ [m]'
    """
    check_result("simulation", simulation, "simulate", _NEEDED)
    osc = required_oscillator("simulation", simulation)
    ax = new_axes(ax, (6.4, 5.4), title(simulation))
    _, y, dy = _broken_orbit(simulation, osc.gap, osc.restitution)
    ax.plot(y, dy, color=BLUE, linewidth=0.9, label="flight", zorder=2)
    speeds = simulation["impact_velocity"].values
    if speeds.size:
        jumps = [[(osc.gap, speed), (osc.gap, -osc.restitution * speed)] for speed in speeds]
        style: dict[str, Any] = {"colors": RED, "linewidths": 0.8, "linestyles": (0, (3, 2)), "zorder": 3, "alpha": 0.6}
        ax.add_collection(LineCollection(jumps, label=_counted(speeds.size, "impact"), **style), autolim=False)
        ax.plot(np.full_like(speeds, osc.gap), speeds, "o", color=RED, markersize=3, markeredgewidth=0, zorder=4)
    if len(sticks := _sticks(simulation)):
        name = _counted(len(sticks), "stick")
        ax.plot([osc.gap], [0.0], "s", color=GREEN, markersize=7, markeredgewidth=0, label=name, zorder=5)
    first = simulation.isel(time=0)
    ax.plot(float(first["displacement"]), float(first["velocity"]), "o", markerfacecolor="white",
            markeredgecolor=INK, markersize=5, label="start", zorder=6, linestyle="none")  # fmt: skip

    unit = unit_suffix(words(simulation["displacement"])[1], " {}")
    ax.set_xlim(*_stop(ax, y, osc, unit, upright=True))
    ax.set_ylim(*view(dy, magnitude(dy, osc.velocity_scale)))
    ax.set_xlabel(label(simulation["displacement"]))
    ax.set_ylabel(label(simulation["velocity"]))
    tell_outcome(ax, simulation)
    legend_below(ax)
    return ax
