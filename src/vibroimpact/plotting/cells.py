"""The cells of a map over two parameters: colours with their scale, reasons for missing values, hatching."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import Normalize, PowerNorm, to_rgb
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path

from vibroimpact.figures import EXPONENTS
from vibroimpact.parameters import counted
from vibroimpact.plotting import labels, style
from vibroimpact.plotting.categories import COUNTS, OPEN, missing_layers, number_layers
from vibroimpact.plotting.diagrams import HATCHED, resolved
from vibroimpact.plotting.style import INK, WALL, Floats, Layer, Mask
from vibroimpact.plotting.ticks import Scaled, power_of

COLORS = "viridis"
SIGNED = "RdBu_r"  # colour map of exponents, white at zero
ROUND = "twilight"  # colour map of phases, which end where they begin
SHOWN = 99.0  # percentage of the cells within the colour scale of exponents; the others saturate
HATCH = "////"
ROOT = "(root scale)"
FIGURE_SPACE = "\u2007"  # a space as wide as a digit


def grid_of(field: xr.DataArray) -> tuple[Floats, Floats, Floats]:
    """Return x, y and values of shape (len(y), len(x)); the first axis of the map becomes the x axis."""
    x, y = (field[dim].values.astype(float) for dim in field.dims)
    return x, y, field.values.astype(float).T


def frame_plane(ax: Axes, field: xr.DataArray) -> None:
    """Set the limits and labels of the axes from the two axes of a map."""
    x, y = (field[dim] for dim in field.dims)
    ax.set_xlim(float(x[0]), float(x[-1]))
    ax.set_ylim(float(y[0]), float(y[-1]))
    labels.label_axes(ax, x, y)


def colour_mesh(ax: Axes, field: xr.DataArray, values: Any, **options: Any) -> QuadMesh:
    """Draw one rectangle per cell, without grid lines: given colours, or numbers with their `cmap` and `norm`."""
    ax.grid(visible=False)
    x, y, _ = grid_of(field)
    return ax.pcolormesh(x, y, values, shading="nearest", zorder=1, rasterized=True, **options)


def swatch(color: str, text: str) -> Patch:
    """Return the legend entry of a colour."""
    return Patch(facecolor=color, edgecolor=WALL if color == OPEN else color, label=text)


def fill_cells(ax: Axes, field: xr.DataArray, layers: Iterable[Layer], others: str | None = None) -> list[Patch]:
    """Fill the cells of each layer with its colour, all other cells with `others` if given; return legend entries."""
    shape = grid_of(field)[2].shape
    shade, entries = np.zeros((*shape, 4)) if others is None else np.full((*shape, 3), to_rgb(others)), []
    for mask, color, text in (layer for layer in layers if layer[0].any()):
        shade[mask] = (*to_rgb(color), 1.0)[: shade.shape[2]]
        entries.append(swatch(color, text))
    if entries or others:
        colour_mesh(ax, field, shade)
    return entries


def hatch_cells(ax: Axes, sweep: xr.Dataset, field: xr.DataArray) -> list[Patch]:
    """Hatch the cells in which other initial conditions differ from the colour shown; return the legend entry."""
    if HATCHED not in sweep:
        return []
    mask = sweep[HATCHED].transpose(*field.dims).values.T
    columns, rows = map(_edges, grid_of(field)[:2])
    boxes = []
    for row, cells in enumerate(mask):
        ends = np.flatnonzero(np.diff(np.pad(cells.astype(int), 1)))
        boxes += [(columns[i], columns[j], *rows[row : row + 2]) for i, j in zip(ends[::2], ends[1::2], strict=True)]
    if not boxes:
        return []
    left, right, low, high = np.array(boxes).T
    corners = np.stack([np.stack([left, right, right, left, left]), np.stack([low, low, high, high, low])], axis=-1)
    codes = np.tile([Path.MOVETO, *[Path.LINETO] * 3, Path.CLOSEPOLY], len(boxes))
    area = Path(corners.transpose(1, 0, 2).reshape(-1, 2), codes)
    for color, width in (("white", 2.4), (INK, 0.9)):  # visible on any colour
        with mpl.rc_context({"hatch.linewidth": width}):
            ax.add_patch(PathPatch(area, facecolor="none", edgecolor=color, hatch=HATCH, linewidth=0.0, zorder=2))
    text = f"{sweep.attrs[HATCHED]} ({counted(int(mask.sum()), 'cell')})"
    return [Patch(facecolor="white", edgecolor=INK, hatch=HATCH, linewidth=0.5, label=text)]


def _edges(centres: Floats) -> Floats:
    """Return the edges of cells, halfway between their centres."""
    inner = 0.5 * (centres[1:] + centres[:-1])
    return np.concatenate([[2.0 * centres[0] - inner[0]], inner, [2.0 * centres[-1] - inner[-1]]])


def add_bar(ax: Axes, mesh: Any, field: xr.DataArray, note: str = "", **options: Any) -> Any:
    """Add a colour bar beside a map, labelled with quantity and unit."""
    figure: Any = ax.get_figure(root=True)
    power = power_of(mesh.get_clim())
    bar = figure.colorbar(mesh, ax=ax, format=Scaled(power), **options)
    height = figure.get_size_inches()[1] * ax.get_position().height * options.get("shrink", 1.0)
    bar.set_label(labels.wrapped(f"{labels.label(field, power)} {note}", labels.PER_INCH * height), labelpad=6)
    return bar


def root_shades(values: Floats) -> PowerNorm:
    """Return colours on a square-root scale from zero, so that small values remain visible next to a resonance."""
    finite = values[np.isfinite(values)]
    low, high = float(finite.min(initial=np.inf)), float(finite.max(initial=-np.inf))
    if low >= high:  # one value, or none
        low, high = (low, low + (abs(low) or 1.0)) if finite.size else (0.0, 1.0)
    return PowerNorm(0.5, vmin=min(0.0, low), vmax=high)


def symmetric_limit(values: Floats) -> float:
    """Return the limit of the colour scale of exponents, for both signs; about 1 % of the cells exceed it."""
    sizes = np.abs(values[np.isfinite(values)])
    return float(np.percentile(sizes, SHOWN)) or 1.0 if sizes.size else 1.0


def colour_scale(sweep: xr.Dataset, field: xr.DataArray) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return colour map, scale and colour-bar note of an index: a square-root scale but for exponents and phases."""
    if field.attrs.get("units") == "rad":
        return {"cmap": ROUND, "norm": Normalize(-np.pi, np.pi)}, {}
    if field.name not in EXPONENTS:
        return {"cmap": COLORS, "norm": root_shades(resolved(sweep, field))}, {"note": ROOT}
    values = field.values.astype(float)
    limit = symmetric_limit(values)
    return {"cmap": SIGNED, "norm": Normalize(-limit, limit)}, {"extend": _beyond(values, limit)}


def draw_cells(ax: Axes, sweep: xr.Dataset, field: xr.DataArray) -> list[Patch]:
    """Draw every cell of an index in colour with a colour bar; return legend entries for all other colours.

    For numbers of periods or impacts, each number has its own colour, explained in a legend beside the map.
    """
    values = grid_of(field)[2]
    entries = []
    if field.name in COUNTS:
        shown = [(mask.T, color, f"{share_of(mask)}   {text}") for mask, color, text in number_layers(sweep, field)]
        style.legend_beside(ax, fill_cells(ax, field, shown, OPEN), f"share of the cells, and\n{labels.label(field)}")
    else:
        scale, bar = colour_scale(sweep, field)
        add_bar(ax, colour_mesh(ax, field, np.ma.masked_invalid(values), **scale), field, pad=0.02, **bar)
        missing = missing_layers(sweep, field, "cell")
        entries = fill_cells(ax, field, ((mask.T, color, text) for mask, color, text in missing))
    frame_plane(ax, field)
    return entries + hatch_cells(ax, sweep, field)


def share_of(mask: Mask) -> str:
    """Return the share of selected cells in per cent, right-aligned."""
    return labels.percent(float(mask.mean())).rjust(6, FIGURE_SPACE)


def _beyond(values: Floats, limit: float) -> str:
    """Return the ends at which values exceed the scale, in Matplotlib's terms."""
    finite = values[np.isfinite(values)]
    low, high = bool((finite < -limit).any()), bool((finite > limit).any())
    return "both" if low and high else "min" if low else "max" if high else "neither"
