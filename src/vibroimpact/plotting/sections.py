"""Sections of one settled motion: stroboscopic (Poincare) map and impact map; and its impacts as a histogram."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from vibroimpact.parameters import counted
from vibroimpact.plotting import labels, style
from vibroimpact.plotting.orbits import Dims, check_result, draw_sticks, legend, status_of
from vibroimpact.plotting.style import BLUE, DOTS, Floats, on_axes
from vibroimpact.plotting.ticks import quantity
from vibroimpact.plotting.views import View, times_of, view_of
from vibroimpact.plotting.walls import STOPS, caption_of, color_of

MANY = 200  # largest number of distinct points drawn as separate marks; more are drawn as an attractor


def distinct_points(points: Floats, tolerance: Floats, wrap: bool = False) -> Floats | None:
    """Return the distinct points, equal within `tolerance`; None if there are more than `MANY`.

    With `wrap` the first coordinate is a phase, so that 0 and 1 are equal.
    """
    places: list[Floats] = []
    while len(points) and len(places) < MANY:
        places.append(points[0])
        distance = np.abs(points - points[0])
        if wrap:
            distance[:, 0] = np.minimum(distance[:, 0], 1.0 - distance[:, 0])
        points = points[(distance > tolerance).any(axis=1)]
    return None if len(points) else np.array(places).reshape(-1, 2)


def _section(section: xr.Dataset, ax: Axes | None, maker: str, across: str, along: str) -> tuple[Axes, Floats]:
    """Return labelled axes for a checked section, and its points; axes without points show the reason."""
    check_result("section", section, maker, {across: along, "velocity": along})
    ax = style.new_axes(ax, (6.2, 5.0), labels.title(section))
    points: Floats = np.column_stack([section[across].values, section["velocity"].values])
    points = points[np.isfinite(points).all(axis=1)]
    labels.label_axes(ax, section[across], section["velocity"])
    if not len(points):
        status = status_of(section)
        text = "no sample" if status is None else labels.wrapped(status.sentence, 45)
        style.say_empty(ax, text)
    return ax, points


def _draw_points(
    ax: Axes, points: Floats, tolerance: Floats, noun: str, wrap: bool = False, color: str = BLUE, of: str = ""
) -> bool:
    """Draw few points as large marks and an attractor as fine translucent dots; return whether there are few."""
    places = distinct_points(points, tolerance, wrap)
    total = counted(len(points), noun) + of
    look = DOTS | {"color": color, "zorder": 3}
    if places is None:
        fine = {"markersize": 1.6, "alpha": 0.55 if len(points) > 1000 else 0.8, "rasterized": len(points) > 2000}
        ax.plot(*points.T, label=total, **(look | fine))
        return False
    name = f"{counted(len(places), 'point')} in {total}"
    ax.plot(*places.T, label=name, **(look | {"markersize": 9 if len(places) <= 12 else 4.5, "clip_on": False}))
    return True


@on_axes
def stroboscopic_map(
    section: xr.Dataset, ax: Axes | None = None, *, coordinate: int | None = None, stop: str | None = None
) -> Axes:
    """Draw the Poincare map: velocity against displacement, once per driving period.

    A period-n motion shows n points, a chaotic motion its attractor.

    Parameters
    ----------
    section : xarray.Dataset
        The result of `vibroimpact.stroboscopic_section`.
    coordinate : int, optional
        For systems, the coordinate drawn, as in `time_history`.
    stop : str, optional
        For systems, the stop whose clearance is drawn instead of a coordinate.

    Notes
    -----
    Samples that agree to 1e-6 of the size of the motion are drawn as one point; the legend gives the number of points.
    For a periodic orbit, an axis spans at least a tenth of that size; a smaller range would show only rounding.

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
    view = view_of(section, coordinate, stop) if isinstance(section, xr.Dataset) else None
    drawn = section
    if view is not None:
        dims: Dims = ("period", "coordinate") if "coordinate" in section.dims else "period"
        check_result("section", section, "stroboscopic_section", dict.fromkeys(("displacement", "velocity"), dims))
        drawn = section.assign(displacement=view.labelled(section), velocity=view.labelled(section, rate=True))
    ax, points = _section(drawn, ax, "stroboscopic_section", "displacement", "period")
    if not len(points):
        return ax
    # One scale for both axes: an orbit may cross the section near y = 0 or y' = 0.
    model = view.model if view else None
    rate = max(model.omega, model.slowest_frequency) if model else 1.0
    size = style.magnitude(points * [1.0, 1.0 / rate], model.velocity_scale / model.slowest_frequency if model else 1.0)
    sizes = np.array([size, size * rate])
    least = 0.1 if _draw_points(ax, points, 1e-6 * sizes, "period") else 1e-6
    low, high = style.view(points[:, 0], sizes[0], least)
    ax.set_xlim(low, high)
    ax.set_ylim(*style.view(points[:, 1], sizes[1], least))
    labels.label_axes(ax, drawn["displacement"], drawn["velocity"])
    if view is not None:
        _draw_stops(ax, view, times_of(section)[:1])
    legend(ax, section)
    return ax


def _draw_stops(ax: Axes, view: View, time: Floats) -> None:
    """Draw the stops that act on this quantity alone, at their positions at that time, with legend entries."""
    low, high = ax.get_xlim()
    for wall in view.walls:
        place = float(view.place(wall, time)[0])
        if (high - place if wall.side > 0 else place - low) > 0.0:
            caption = caption_of(view.model, wall.name)
            name = caption if caption != wall.name else f"{wall.element.label} {wall.name}"
            solid = wall.element.impenetrable
            style.draw_stop(ax, place, (low, high)[wall.side > 0], upright=True, label=name, impenetrable=solid)


def _stick_phases(section: xr.Dataset, period: float) -> list[tuple[float, float]]:
    """Return the phase intervals of all sticks, cut where the phase wraps."""
    spans = np.column_stack([section["stick_time"].values, section["release_time"].values]) / period
    pieces = []
    for start, end in np.unique(spans[np.isfinite(spans).all(axis=1)] % 1.0, axis=0):
        pieces += [(start, end)] if start <= end else [(start, 1.0), (0.0, end)]
    return pieces


@on_axes
def impact_map(section: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the impact map: the velocity of each impact against its phase in the driving period.

    An impact-p motion shows p points. A complete chatter shows a sequence that descends to a green bar, which marks the
    stick, from coming to rest at the stop to the release. Impacts of a system are coloured by stop.

    Parameters
    ----------
    section : xarray.Dataset
        The result of `vibroimpact.impact_section`.

    Notes
    -----
    The axes cover the whole period and velocities from zero, so that maps can be compared. Impacts that agree to 1e-6
    (of the period and of the largest velocity) are drawn as one point; the legend gives the number of points.

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
    if isinstance(section, xr.Dataset) and "phase" in section and "no_value" in section["phase"].attrs:
        reason = section["phase"].attrs["no_value"]
        raise ValueError(f"`section` has no phases to draw: {reason}; draw its motion from `simulate` over time")
    ax, points = _section(section, ax, "impact_section", "phase", "impact")
    ax.set_xlim(0.0, 1.0)
    if not len(points):
        return ax
    fastest = float(points[:, 1].max())
    model: Any = labels.selected_model(section)
    tolerance = np.array([1e-6, 1e-6 * fastest])
    if model and "stop" in section:
        for name in (name for name in model.stop_names if (section["stop"] == name).any()):
            struck, look = section["stop"].values == name, {"color": color_of(model, name), "of": f" on {name}"}
            _draw_points(ax, points[struck], tolerance, "impact", wrap=True, **look)
    else:
        _draw_points(ax, points, tolerance, "impact", wrap=True)
    if model and "stick_time" in section and (sticks := _stick_phases(section, model.period)):
        draw_sticks(ax, [[(start, 0.0), (end, 0.0)] for start, end in sticks], "stick (at rest at the stop)", 2)
    ax.set_ylim(-0.03 * fastest, 1.08 * fastest)
    labels.label_axes(ax, section["phase"], section["velocity"])
    legend(ax, section)
    return ax


@on_axes
def impact_histogram(statistics: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw how many impacts per second fall into each class of velocities, stacked over the supports.

    The legend gives the rate, the hardest impact and the power of each support; those that are not struck are left out.

    Parameters
    ----------
    statistics : xarray.Dataset
        The result of `vibroimpact.impact_statistics`.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> ax = vi.plotting.impact_histogram(vi.impact_statistics(vi.models.impact_damper(), sample_impacts=400))
    >>> [text.get_text().split(":")[0] for text in ax.get_legend().get_texts()]
    ['left', 'right']
    """
    check_result("statistics", statistics, "impact_statistics", {"number": ("stop", "velocity_class"), "rate": "stop"})
    ax = style.new_axes(ax, (6.2, 4.2), labels.title(statistics))
    low, high = statistics["velocity_from"].values, statistics["velocity_to"].values
    rates = statistics["number"].values / float(statistics["duration"])
    below = np.zeros(len(low))
    for at, name in enumerate(statistics["stop"].values.tolist()):
        if rates[at].any():
            of = statistics.isel(stop=at)
            facts = [quantity(of[key].item(), of[key].attrs["units"], 4) for key in ("rate", "max_velocity", "power")]
            text = f"{name}: {facts[0]}, up to {facts[1]}, {facts[2]}"
            look: Any = {"color": style.color_at(STOPS, at), "edgecolor": "white", "linewidth": 0.4}
            ax.bar(low, rates[at], high - low, below, align="edge", label=text, **look)
            below += rates[at]
    if not below.any():
        style.say_empty(ax, "no impacts")
    ax.set_xlim(low[0], high[-1])
    velocity = statistics["velocity_class"].assign_attrs(long_name="impact velocity")
    labels.label_axes(ax, velocity, statistics["rate"])
    legend(ax, statistics)
    return ax
