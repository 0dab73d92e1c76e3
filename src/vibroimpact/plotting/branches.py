"""Branches of periodic orbits over the brute-force bifurcation diagram."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from vibroimpact.motion import cycle_name
from vibroimpact.plotting.checks import check_diagram, datasets_of, holding
from vibroimpact.plotting.diagrams import draw_samples, mark_empty, set_height
from vibroimpact.plotting.style import BLUE, GREEN, INK, RED, Floats, label, legend_below, new_axes, title, view

SAMPLES = "#a9a9a9"
COLORS = (BLUE, RED, GREEN, "#8a5fa8", "#b8860b", "#56b4e9")  # one an orbit's name, in their order

NAME_WIDTH, NAME_HEIGHT = 0.03, 0.05  # of the axes: the room that the letters of a point take

STABLE, UNSTABLE, INADMISSIBLE = 0, 1, 2
LOOKS: dict[int, dict[str, Any]] = {
    STABLE: {"linestyle": "solid", "linewidth": 2.0, "label": "stable"},
    UNSTABLE: {"linestyle": (0, (4, 2)), "linewidth": 1.3, "label": "unstable"},
    INADMISSIBLE: {"linestyle": (0, (1, 2)), "linewidth": 1.0, "alpha": 0.5, "label": "no motion of the mass"},
}
# Letters, marker and words of each kind of special point.
MARKS = {
    "fold": ("F", "D", "fold"),
    "period_doubling": ("PD", "o", "period doubling"),
    "grazing": ("G", "s", "grazing"),
    "end_of_sticking": ("S", "^", "end of sticking"),
}


@dataclass(frozen=True)
class Part:
    """A stretch of a branch of one look: parameter values, and a velocity of each impact."""

    look: int
    values: Floats
    velocities: Floats


def branch_diagram(branches: Any, diagram: xr.Dataset | None = None, ax: Axes | None = None) -> Axes:
    """Draw branches of periodic orbits: stable parts solid, unstable ones dashed, bifurcations marked and named.

    Parameters
    ----------
    branches : Branch, xarray.Dataset, or sequence of them
        What `continue_orbit` returns, or the `dataset` of each, all along one parameter.
    diagram : xarray.Dataset, optional
        What `vibroimpact.bifurcation_diagram` returns with section="impact" over the same parameter, drawn beneath as
        grey dots.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure without it.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        `branches` is empty, no branch, or along several parameters; `diagram` is of another kind or parameter.

    Notes
    -----
    Each impact of a cycle is a line. Parts on which the mass cannot move so, because it would have hit before, are
    dotted; they do not widen the view. A point on two branches is named once.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> from vibroimpact.continuation import continue_orbit
    >>> from vibroimpact.orbits import find_orbit
    >>> (orbit,) = find_orbit(vi.ImpactOscillator(omega=2.6))
    >>> ax = branch_diagram(continue_orbit(orbit, "omega", (2.5, 2.7)))
    >>> [text.get_text() for text in ax.texts]
    ['PD']
    """
    drawn = _datasets(branches)
    parameter = _parameter(drawn)
    ax = new_axes(ax, (8.0, 5.0), title(drawn[0] if diagram is None else diagram))
    heights = _draw_beneath(ax, diagram, parameter)
    entries = ax.get_legend_handles_labels()[0]
    colors = _colors(drawn)
    looks: set[int] = set()
    seen = [heights]
    for branch, name in zip(drawn, map(orbit_name, drawn), strict=True):
        for part in split(branch, parameter):
            ax.plot(part.values, part.velocities, color=colors[name], zorder=3, **LOOKS[part.look] | {"label": None})
            looks.add(part.look)
            seen += [part.velocities.ravel()] if part.look != INADMISSIBLE else []
    entries += [Line2D([], [], color=color, linewidth=2.0, label=name) for name, color in colors.items()]
    entries += [Line2D([], [], color=INK, **LOOKS[look]) for look in sorted(looks)]
    _frame(ax, drawn, parameter, diagram, np.concatenate(seen))
    entries += _draw_special(ax, drawn, colors)
    legend_below(ax, entries)
    return ax


def split(branch: xr.Dataset, parameter: str) -> Iterator[Part]:
    """Return the stretches of a branch on which it stays stable, unstable, or inadmissible.

    A special point belongs to both stretches that meet in it.
    """
    values, velocities = branch[parameter].values, branch["velocity"].transpose("point", "impact").values
    stable, admissible = (branch[name].values.astype(bool) for name in ("stable", "admissible"))
    looks = np.where(admissible, np.where(stable, STABLE, UNSTABLE), INADMISSIBLE)
    special = np.isin(values, branch["special_value"].values)
    # Between two points: a special one leaves the word to its neighbour, for rounding decides on which side it is.
    left, right = looks[:-1], looks[1:]
    between = np.where(special[:-1], right, np.where(special[1:], left, np.maximum(left, right)))
    # Between two special ones, the second tells: beyond it the word is known, and at it the word changes.
    kinds = dict(zip(branch["special_value"].values.tolist(), _special_kinds(branch), strict=True))
    for k in np.flatnonzero(special[:-1] & special[1:])[::-1]:
        if k + 1 < len(between):
            between[k] = _before(kinds[values[k + 1]], int(between[k + 1]), int(between[k]))
    cuts = np.flatnonzero(np.diff(between)) + 1
    ends = zip([0, *cuts], [*cuts, len(between)], strict=True) if len(between) else [(0, 0)]
    look_of: NDArray[Any] = between if len(between) else looks
    for i, j in ends:
        yield Part(int(look_of[i]), values[i : j + 1], velocities[i : j + 1])


def _special_kinds(branch: xr.Dataset) -> list[str]:
    kinds = str(branch["special_kind"].attrs["flag_meanings"]).split()
    return [kinds[int(code)] for code in branch["special_kind"].values]


def _before(kind: str, beyond: int, otherwise: int) -> int:
    """Return the look before a special point from that beyond it."""
    if kind == "grazing":
        return otherwise if beyond == INADMISSIBLE else INADMISSIBLE
    return {STABLE: UNSTABLE, UNSTABLE: STABLE}.get(beyond, beyond)


def orbit_name(branch: xr.Dataset) -> str:
    """Return the name of the orbits on a branch."""
    n, p = int(branch.attrs["n_periods"]), int(branch.attrs["n_impacts"])
    return cycle_name(n, p)


def _colors(drawn: list[xr.Dataset]) -> dict[str, str]:
    """Return a colour for each name of orbits, in the order of the branches."""
    names = dict.fromkeys(map(orbit_name, drawn))
    return {name: COLORS[i % len(COLORS)] for i, name in enumerate(names)}


def _special_points(drawn: list[xr.Dataset]) -> Iterator[tuple[str, float, Floats, xr.Dataset]]:
    """Yield kind, parameter value, impact velocities and branch of the special points, each once."""
    met: list[tuple[str, float]] = []
    for branch in drawn:
        rows = branch["special_velocity"].transpose("special", "impact").values
        for kind, value, row in zip(_special_kinds(branch), branch["special_value"].values, rows, strict=True):
            if not any(kind == other and np.isclose(value, at, rtol=1e-9, atol=0.0) for other, at in met):
                met.append((kind, float(value)))
                yield kind, float(value), row[np.isfinite(row)], branch


def _draw_special(ax: Axes, drawn: list[xr.Dataset], colors: dict[str, str]) -> list[Line2D]:
    """Mark and name the special points of all branches; return the legend's entries."""
    entries, names = {}, []
    for kind, value, speeds, branch in _special_points(drawn):
        letters, marker, words = MARKS[kind]
        look: dict[str, Any] = {
            "linestyle": "none",
            "marker": marker,
            "markersize": 6.0,
            "markerfacecolor": "white",
            "zorder": 5,
        }
        ax.plot(np.full(len(speeds), value), speeds, markeredgecolor=colors[orbit_name(branch)], **look)
        entries[kind] = Line2D([], [], markeredgecolor=INK, label=f"{letters}: {words}", **look)
        names.append((value, float(speeds.max()), letters))
    halo = [withStroke(linewidth=2.4, foreground="white")]
    for value, height, letters in _merged(ax, names):
        ax.annotate(letters, (value, height), (3, 6), textcoords="offset points", fontsize=9, color=INK,
                    path_effects=halo, zorder=6, annotation_clip=True)  # fmt: skip
    return [entries[kind] for kind in MARKS if kind in entries]


def _merged(ax: Axes, names: list[tuple[float, float, str]]) -> list[tuple[float, float, str]]:
    """Return names and where they stand; those that would lie over one another are joined into one."""
    wide, high = np.ptp(ax.get_xlim()), np.ptp(ax.get_ylim())
    joined: list[tuple[float, float, str]] = []
    for value, height, letters in sorted(names):
        if joined and value - joined[-1][0] < NAME_WIDTH * wide and abs(height - joined[-1][1]) < NAME_HEIGHT * high:
            at, top, before = joined.pop()
            joined.append((at, max(top, height), f"{before}, {letters}"))
        else:
            joined.append((value, height, letters))
    return joined


def _draw_beneath(ax: Axes, diagram: xr.Dataset | None, parameter: str) -> Floats:
    """Draw the samples of the diagram in grey; return the heights drawn."""
    if diagram is None:
        return np.empty(0)
    _, axis, samples = check_diagram("diagram", diagram)
    if samples != "impact" or axis != parameter:
        raise ValueError(
            f"`diagram` holds a sample each {samples} over {axis}; allowed is a diagram of impacts over {parameter}, "
            f"as `branches` are; call bifurcation_diagram with section='impact' over {parameter}"
        )
    heights = draw_samples(ax, diagram, axis, samples, "velocity", SAMPLES)
    mark_empty(ax, diagram, axis)
    return heights


def _frame(ax: Axes, drawn: list[xr.Dataset], parameter: str, diagram: xr.Dataset | None, heights: Floats) -> None:
    """Limit and label the axes."""
    if diagram is None:
        values = np.concatenate([branch[parameter].values for branch in drawn])
        ax.set_xlim(*view(values, float(np.abs(values).max()) or 1.0))
    set_height(ax, drawn[0], "velocity", heights)
    ax.set_xlabel(label(drawn[0][parameter]))
    ax.set_ylabel(label(drawn[0]["velocity"]))


def _datasets(branches: Any) -> list[xr.Dataset]:
    """Return the branches as datasets, or raise `ValueError`."""
    drawn = datasets_of(branches)
    for branch in drawn:
        if not isinstance(branch, xr.Dataset) or "special_kind" not in branch or "point" not in branch.dims:
            raise ValueError(
                f"`branches` {holding(branch)}; allowed are branches of periodic orbits; "
                "pass what continue_orbit returns"
            )
    if not drawn:
        raise ValueError("`branches` is empty; allowed is one branch or more; follow an orbit with continue_orbit")
    return drawn


def _parameter(drawn: list[xr.Dataset]) -> str:
    """Return the one parameter along which all branches go."""
    names = [str(name) for branch in drawn for name, coord in branch.coords.items() if coord.dims == ("point",)]
    if len(set(names)) > 1:
        raise ValueError(
            f"`branches` go along {' and '.join(dict.fromkeys(names))}; allowed is one parameter; draw one figure each"
        )
    return names[0]
