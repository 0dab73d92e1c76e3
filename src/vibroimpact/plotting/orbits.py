"""One motion: time history, phase portrait, stroboscopic (Poincare) map and impact map."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from vibroimpact.oscillator import ImpactOscillator
from vibroimpact.plotting import labels, style
from vibroimpact.plotting.style import BLUE, DOTS, GREEN, INK, RED, RINGS, Floats, on_axes
from vibroimpact.status import Status

MANY = 200  # more distinct points than this are drawn as an attractor, fewer as separate marks
STATES = {"displacement": "time", "velocity": "time", "impact_time": "impact", "impact_velocity": "impact"}


def _check(argument: str, value: Any, maker: str, needed: dict[str, str]) -> None:
    """Raise `ValueError` unless the needed variables of a result lie along their one dimension each."""
    if not isinstance(value, xr.Dataset) or any(
        name not in value or value[name].dims != (dim,) for name, dim in needed.items()
    ):
        wanted = ", ".join(f"{name} over {dim}" for name, dim in needed.items())
        raise labels.refused(
            argument, value, f"a result of {maker} ({wanted})", f"pass what vibroimpact.{maker} returns"
        )


def _legend(ax: Axes, dataset: xr.Dataset) -> None:
    """Draw the legend, which says how a motion ended unless it simply filled its window."""
    status = _ended(dataset)
    if status is not None and not status.has_indices:
        ax.plot([], [], linestyle="none", label=style.outcome(status))
    style.legend_below(ax)


def _ended(dataset: xr.Dataset) -> Status | None:
    """Return how the one motion of a result ended; None if there are several."""
    return Status(int(dataset["status"])) if "status" in dataset and dataset["status"].ndim == 0 else None


def _broken_orbit(simulation: xr.Dataset, gap: float, restitution: float) -> tuple[Floats, Floats, Floats]:
    """Return time, y and y' with each impact put in: arrival, a break (NaN), departure at -r times the speed.

    Samples alone would cut the corner at each impact with a chord that the mass never follows.
    """
    times, speeds = simulation["impact_time"].values, simulation["impact_velocity"].values
    jump = np.column_stack([speeds, np.full_like(speeds, np.nan), -restitution * speeds]).ravel()
    sampled = simulation["time"].values
    # A sample at an impact holds the state after it, but rounding may put its time before: it adds nothing.
    around = np.concatenate([[-np.inf], times, [np.inf]])
    after = np.searchsorted(times, sampled)
    nearest = np.minimum(sampled - around[after], around[after + 1] - sampled)
    own = nearest >= 1e-6 * np.ptp(sampled[:2])
    t = np.concatenate([np.repeat(times, 3), sampled[own]])
    y = np.concatenate([np.where(np.isnan(jump), np.nan, gap), simulation["displacement"].values[own]])
    dy = np.concatenate([jump, simulation["velocity"].values[own]])
    order = np.argsort(t, kind="stable")
    return _rounded(t[order], y[order], dy[order])


def _rounded(t: Floats, y: Floats, dy: Floats, parts: int = 6) -> tuple[Floats, Floats, Floats]:
    """Return the cubic through neighbouring states (y and y' at both ends), so that few samples draw no polygon.

    Between samples h apart it errs by (h w)^4/384 of the motion's size, less than a line's width. NaN stays a break.
    """
    if len(t) > 50_000:
        return t, y, dy
    s, h = np.arange(parts) / parts, np.diff(t)[:, None]
    y0, y1, v0, v1 = y[:-1, None], y[1:, None], dy[:-1, None], dy[1:, None]
    # Between nearly equal instants, as at an impact, a slope would be mere rounding.
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
    starts, ends = simulation["stick_time"].values, simulation["release_time"].values
    return np.column_stack([starts, np.where(np.isnan(ends), float(simulation["time"][-1]), ends)])


def _draw_sticks(ax: Axes, spans: Any, height: float, name: str, zorder: float) -> None:
    """Draw a bar for each (start, end) of a stick."""
    bars = [[(start, height), (end, height)] for start, end in spans]
    look: dict[str, Any] = {"colors": GREEN, "linewidths": 5, "zorder": zorder}
    ax.add_collection(LineCollection(bars, label=f"{name} (at rest at the stop)", **look), autolim=False)


def _stop(ax: Axes, displacement: Floats, osc: ImpactOscillator, *, upright: bool) -> tuple[float, float]:
    """Draw the stop and return the limits of the displacement axis; an arrow points to a stop too far off."""
    size = style.magnitude(displacement, osc.velocity_scale / osc.natural_frequency)
    text = f"stop, {labels.parameter_text('gap', osc)}"
    low, high = style.view(displacement, size)
    near = osc.gap - high <= 3.0 * (high - low)
    if near:
        low, high = style.view(np.append(displacement, osc.gap), size)
        start = osc.gap
        high = start + max(0.12 * (high - low), high - start)
        style.draw_stop(ax, start, high, upright=upright)
    else:
        # Turned with its text by a quarter, the downward arrow points right, to where the stop is.
        text += r" $\downarrow$" if upright else r" $\uparrow$"
        start, high = high, high + 0.12 * (high - low)
    middle = 0.5 * (start + high)
    place: dict[str, Any] = {"x": 0.995, "y": middle, "transform": ax.get_yaxis_transform(), "ha": "right"}
    if upright:
        place = {"x": middle, "y": 0.995, "transform": ax.get_xaxis_transform(), "rotation": 90, "ha": "center"}
    box = {"facecolor": "#ededed", "edgecolor": "none", "pad": 2}
    ax.text(s=text, va="top" if upright else "center", fontsize=8.5, color=INK, bbox=box, **place)
    return low, high


def _started(
    simulation: xr.Dataset, ax: Axes | None, size: tuple[float, float]
) -> tuple[ImpactOscillator, Axes, tuple[Floats, Floats, Floats]]:
    """Return the oscillator of a checked simulation, the axes to draw on, and time, y and y' of the line."""
    _check("simulation", simulation, "simulate", STATES)
    osc = labels.reference(simulation)
    if osc is None:
        raise ValueError(
            "`simulation` has no attribute 'oscillator', which says where the stop is; "
            "keep the attributes (xarray.set_options(keep_attrs=True)) when you compute with a result"
        )
    return osc, style.new_axes(ax, size, labels.title(simulation)), _broken_orbit(simulation, osc.gap, osc.restitution)


@on_axes
def time_history(simulation: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw displacement against time, with the stop, the impacts on it and the sticks.

    The line includes the instants of impact, so that it reaches the stop where the mass does.

    Parameters
    ----------
    simulation : xarray.Dataset
        What `vibroimpact.simulate` returns.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> ax = vi.plotting.time_history(vi.simulate(vi.ImpactOscillator(omega=2.0), periods=5))
    >>> ax.get_xlabel()
    'time $t$ [s]'
    """
    osc, ax, (t, y, _) = _started(simulation, ax, (8.0, 3.8))
    whole = ~np.isnan(y)
    ax.plot(t[whole], y[whole], color=BLUE, linewidth=1.2, zorder=2)

    ax.set_ylim(*_stop(ax, y, osc, upright=False))
    impacts = simulation["impact_time"].values
    if impacts.size:
        look = DOTS | {"color": RED, "markersize": 4, "zorder": 5}
        ax.plot(impacts, np.full_like(impacts, osc.gap), label=labels.counted(impacts.size, "impact"), **look)
    if len(sticks := _sticks(simulation)):
        _draw_sticks(ax, sticks, osc.gap, labels.counted(len(sticks), "stick"), 4)
    ax.set_xlim(float(simulation["time"][0]), float(simulation["time"][-1]))
    labels.label_axes(ax, simulation["time"], simulation["displacement"])
    _legend(ax, simulation)
    return ax


@on_axes
def phase_portrait(simulation: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw velocity against displacement, with the stop and the jumps of velocity at it.

    The line is broken at each impact; a thin dashed line joins arrival (y' = v) and departure (y' = -r v). Between
    samples it follows the cubic through the states at either end.

    Parameters
    ----------
    simulation : xarray.Dataset
        What `vibroimpact.simulate` returns.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> ax = vi.plotting.phase_portrait(vi.simulate(vi.ImpactOscillator(omega=2.8)))
    >>> ax.get_xlabel()
    'displacement $y$ [m]'
    """
    osc, ax, (_, y, dy) = _started(simulation, ax, (6.4, 5.4))
    ax.plot(y, dy, color=BLUE, linewidth=0.9, label="flight", zorder=2)
    speeds = simulation["impact_velocity"].values
    if speeds.size:
        jumps = [[(osc.gap, speed), (osc.gap, -osc.restitution * speed)] for speed in speeds]
        thin: dict[str, Any] = {"colors": RED, "linewidths": 0.8, "linestyles": (0, (3, 2)), "zorder": 3, "alpha": 0.6}
        ax.add_collection(LineCollection(jumps, label=labels.counted(speeds.size, "impact"), **thin), autolim=False)
        ax.plot(np.full_like(speeds, osc.gap), speeds, **DOTS, color=RED, markersize=3, zorder=4)
    if len(sticks := _sticks(simulation)):
        name = labels.counted(len(sticks), "stick")
        ax.plot([osc.gap], [0.0], "s", color=GREEN, markersize=7, markeredgewidth=0, label=name, zorder=5)
    first = simulation.isel(time=0)
    ring = RINGS | {"markeredgecolor": INK, "markersize": 5, "zorder": 6}
    ax.plot(float(first["displacement"]), float(first["velocity"]), label="start", **ring)
    ax.set_xlim(*_stop(ax, y, osc, upright=True))
    ax.set_ylim(*style.view(dy, style.magnitude(dy, osc.velocity_scale)))
    labels.label_axes(ax, simulation["displacement"], simulation["velocity"])
    _legend(ax, simulation)
    return ax


def distinct_points(points: Floats, tolerance: Floats, wrap: bool = False) -> Floats | None:
    """Return one point for each place visited, to within `tolerance`; None if there are more than `MANY`.

    With `wrap` the first coordinate is a phase, so that 0 and 1 are the same place.
    """
    left = points
    found: list[Floats] = []
    while len(left) and len(found) < MANY:
        found.append(left[0])
        away = np.abs(left - left[0])
        if wrap:
            away[:, 0] = np.minimum(away[:, 0], 1.0 - away[:, 0])
        left = left[(away > tolerance).any(axis=1)]
    return None if len(left) else np.array(found).reshape(-1, 2)


def _section(section: xr.Dataset, ax: Axes | None, maker: str, across: str, along: str) -> tuple[Axes, Floats]:
    """Return labelled axes for a checked section and its points; axes without any say why."""
    _check("section", section, maker, {across: along, "velocity": along})
    ax = style.new_axes(ax, (6.2, 5.0), labels.title(section))
    points: Floats = np.column_stack([section[across].values, section["velocity"].values])
    points = points[np.isfinite(points).all(axis=1)]
    labels.label_axes(ax, section[across], section["velocity"])
    if not len(points):
        status = _ended(section)
        text = "no sample" if status is None else labels.wrapped(status.sentence, 45)
        ax.text(0.5, 0.5, text, transform=ax.transAxes, ha="center", va="center", color="#555555")
    return ax, points


def _draw_points(ax: Axes, points: Floats, tolerance: Floats, noun: str, wrap: bool = False) -> bool:
    """Draw few places as large marks and an attractor as fine translucent dots; return whether they are few."""
    places = distinct_points(points, tolerance, wrap)
    total = labels.counted(len(points), noun)
    look = DOTS | {"color": BLUE, "zorder": 3}
    if places is None:
        fine = {"markersize": 1.6, "alpha": 0.55 if len(points) > 1000 else 0.8, "rasterized": len(points) > 2000}
        ax.plot(*points.T, label=total, **(look | fine))
        return False
    name = f"{labels.counted(len(places), 'point')} in {total}"
    ax.plot(*places.T, label=name, **(look | {"markersize": 9 if len(places) <= 12 else 4.5, "clip_on": False}))
    return True


@on_axes
def stroboscopic_map(section: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the Poincare map: velocity against displacement once per driving period.

    A period-n motion shows n points, a chaotic motion its attractor.

    Parameters
    ----------
    section : xarray.Dataset
        What `vibroimpact.stroboscopic_section` returns.

    Notes
    -----
    Samples that agree to 1e-6 of the size of the motion are one point, drawn once and counted in the legend.
    Around a periodic orbit an axis spans at least a tenth of that size; less would show only rounding.

    References
    ----------
    Lee, section 2 and figures 4a to 9a.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> section = vi.stroboscopic_section(vi.ImpactOscillator(omega=2.0), sample_periods=50)
    >>> vi.plotting.stroboscopic_map(section).get_legend().get_texts()[0].get_text()
    '1 point in 50 periods'
    """
    ax, points = _section(section, ax, "stroboscopic_section", "displacement", "period")
    if not len(points):
        return ax
    osc = labels.reference(section)
    # One size for both axes: an orbit may well pass the section near y = 0 or at y' = 0.
    rate = max(osc.omega, osc.natural_frequency) if osc else 1.0
    size = style.magnitude(points * [1.0, 1.0 / rate], osc.velocity_scale / osc.natural_frequency if osc else 1.0)
    sizes = np.array([size, size * rate])
    least = 0.1 if _draw_points(ax, points, 1e-6 * sizes, "period") else 1e-6
    low, high = style.view(points[:, 0], sizes[0], least)
    ax.set_xlim(low, high)
    ax.set_ylim(*style.view(points[:, 1], sizes[1], least))
    labels.label_axes(ax, section["displacement"], section["velocity"])
    if osc and osc.gap < high:
        style.draw_stop(ax, osc.gap, high, upright=True, label=f"stop, {labels.parameter_text('gap', osc)}")
    _legend(ax, section)
    return ax


def _stick_phases(section: xr.Dataset, period: float) -> list[tuple[float, float]]:
    """Return the phases from each stick to its release, cut where the phase wraps."""
    spans = np.column_stack([section["stick_time"].values, section["release_time"].values]) / period
    pieces = []
    for start, end in np.unique(spans[np.isfinite(spans).all(axis=1)] % 1.0, axis=0):
        pieces += [(start, end)] if start <= end else [(start, 1.0), (0.0, end)]
    return pieces


@on_axes
def impact_map(section: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the impact map: the velocity of each impact against its phase in the driving period.

    An impact-p motion shows p points; a complete chatter a sequence that runs down to the green bar of
    the stick, from coming to rest at the stop until the release.

    Parameters
    ----------
    section : xarray.Dataset
        What `vibroimpact.impact_section` returns.

    Notes
    -----
    Phases run over the whole period and velocities from zero, so that maps compare at a glance. Impacts that
    agree to 1e-6 (of the period, of the largest velocity) are one point, counted in the legend.

    References
    ----------
    Lee, section 2 and figures 4b to 9b.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> section = vi.impact_section(vi.ImpactOscillator(omega=2.0), sample_impacts=50)
    >>> vi.plotting.impact_map(section).get_legend().get_texts()[0].get_text()
    '1 point in 50 impacts'
    """
    ax, points = _section(section, ax, "impact_section", "phase", "impact")
    ax.set_xlim(0.0, 1.0)
    if not len(points):
        return ax
    fastest = float(points[:, 1].max())
    _draw_points(ax, points, np.array([1e-6, 1e-6 * fastest]), "impact", wrap=True)
    osc = labels.reference(section)
    if osc and "stick_time" in section and (sticks := _stick_phases(section, osc.period)):
        _draw_sticks(ax, sticks, 0.0, "stick", 2)
    ax.set_ylim(-0.03 * fastest, 1.08 * fastest)
    labels.label_axes(ax, section["phase"], section["velocity"])
    _legend(ax, section)
    return ax
