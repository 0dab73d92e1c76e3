"""Sets of points on a section: the stroboscopic (Poincare) map and the impact map."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from vibroimpact.plotting.checks import check_result
from vibroimpact.plotting.style import (
    BLUE,
    GREEN,
    Floats,
    draw_stop,
    label,
    legend_below,
    magnitude,
    new_axes,
    note_empty,
    reference,
    tell_outcome,
    title,
    view,
)

MANY = 200  # more distinct points than this are drawn as an attractor, fewer as separate marks


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


def _draw_points(ax: Axes, points: Floats, tolerance: Floats, noun: str, wrap: bool = False) -> bool:
    """Draw few places as large marks and an attractor as fine translucent dots; tell whether they are few."""
    places = distinct_points(points, tolerance, wrap)
    total = f"{len(points)} {noun}{'' if len(points) == 1 else 's'}"
    look: dict[str, Any] = {"linestyle": "none", "marker": "o", "color": BLUE, "markeredgewidth": 0, "zorder": 3}
    if places is None:
        fine = {"markersize": 1.6, "alpha": 0.55 if len(points) > 1000 else 0.8, "rasterized": len(points) > 2000}
        ax.plot(*points.T, label=total, **(look | fine))
        return False
    name = f"{len(places)} point{'' if len(places) == 1 else 's'} in {total}"
    ax.plot(*places.T, label=name, **(look | {"markersize": 9 if len(places) <= 12 else 4.5, "clip_on": False}))
    return True


def stroboscopic_map(section: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the Poincare map: velocity against displacement once a driving period.

    A period-n motion shows n points, a chaotic one its attractor.

    Parameters
    ----------
    section : xarray.Dataset
        What `vibroimpact.stroboscopic_section` returns.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure without it.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        `section` is another kind of result.

    Notes
    -----
    Samples that agree to 1e-6 of the size of the motion are one point, drawn once and counted in the legend.
    Around a periodic orbit an axis spans at least a tenth of that size, else it would show only rounding.

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
    check_result("section", section, "stroboscopic_section", {"displacement": "period", "velocity": "period"})
    ax = new_axes(ax, (6.2, 5.0), title(section))
    ax.set_xlabel(label(section["displacement"]))
    ax.set_ylabel(label(section["velocity"]))
    points = np.column_stack([section["displacement"].values, section["velocity"].values])
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        note_empty(ax, section)
        return ax
    osc = reference(section)
    # One size for both axes: an orbit may well pass the section near y = 0 or at y' = 0.
    rate = max(osc.omega, osc.natural_frequency) if osc else 1.0
    size = magnitude(points * [1.0, 1.0 / rate], osc.velocity_scale / osc.natural_frequency if osc else 1.0)
    sizes = np.array([size, size * rate])
    least = 0.1 if _draw_points(ax, points, 1e-6 * sizes, "period") else 1e-6
    low, high = view(points[:, 0], sizes[0], least)
    ax.set_xlim(low, high)
    ax.set_ylim(*view(points[:, 1], sizes[1], least))
    ax.locator_params(axis="x", nbins=6)
    if osc and osc.gap < high:
        draw_stop(ax, osc.gap, high, upright=True)
    tell_outcome(ax, section)
    legend_below(ax)
    return ax


def _stick_bars(section: xr.Dataset, period: float) -> list[list[tuple[float, float]]]:
    """Return bars on the phase axis from each stick to its release, cut where the phase wraps."""
    bars = []
    spans = np.column_stack([section["stick_time"].values, section["release_time"].values]) / period
    for start, end in np.unique(spans[np.isfinite(spans).all(axis=1)] % 1.0, axis=0):
        pieces = [(start, end)] if start <= end else [(start, 1.0), (0.0, end)]
        bars += [[(a, 0.0), (b, 0.0)] for a, b in pieces]
    return bars


def impact_map(section: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the impact map: the velocity of each impact against its phase in the driving period.

    An impact-p motion shows p points; a complete chatter a sequence that runs down to the green bar of
    the stick, from coming to rest at the stop until the release.

    Parameters
    ----------
    section : xarray.Dataset
        What `vibroimpact.impact_section` returns.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure without it.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        `section` is another kind of result.

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
    check_result("section", section, "impact_section", {"phase": "impact", "velocity": "impact"})
    ax = new_axes(ax, (6.2, 5.0), title(section))
    ax.set_xlim(0.0, 1.0)
    ax.set_xlabel(label(section["phase"]))
    ax.set_ylabel(label(section["velocity"]))
    points = np.column_stack([section["phase"].values, section["velocity"].values])
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        note_empty(ax, section)
        return ax
    fastest = float(points[:, 1].max())
    _draw_points(ax, points, np.array([1e-6, 1e-6 * fastest]), "impact", wrap=True)
    osc = reference(section)
    if osc and "stick_time" in section and (bars := _stick_bars(section, osc.period)):
        name = "stick (at rest on the stop)"
        ax.add_collection(LineCollection(bars, colors=GREEN, linewidths=5, label=name, zorder=2), autolim=False)
    ax.set_ylim(-0.03 * fastest, 1.08 * fastest)
    tell_outcome(ax, section)
    legend_below(ax)
    return ax
