"""Results of continuation: branches of periodic orbits over a diagram, boundaries of motions in a plane."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from vibroimpact.dataset import flag_meanings, varied_parameters
from vibroimpact.motion import WITHOUT, listed, motion_along
from vibroimpact.plotting import labels, style
from vibroimpact.plotting.along import HALO, name_along
from vibroimpact.plotting.cells import draw_cells
from vibroimpact.plotting.diagrams import check_diagram, check_sweep, draw_samples, mark_empty, set_height
from vibroimpact.plotting.style import BLUE, BOUNDARY_COLORS, DOTS, GREEN, INK, RED, Floats, on_axes

SAMPLES = "#a9a9a9"
COLORS = (BLUE, RED, GREEN, "#8a5fa8", "#b8860b", "#56b4e9")  # colours of orbit types, in the order of their appearance

NAME_WIDTH, NAME_HEIGHT = 0.03, 0.05  # fraction of the axes taken by the letters of a point

STABLE, UNSTABLE, INADMISSIBLE = 0, 1, 2
LOOKS: dict[int, dict[str, Any]] = {
    STABLE: {"linestyle": "solid", "linewidth": 2.0, "label": "stable"},
    UNSTABLE: {"linestyle": (0, (4, 2)), "linewidth": 1.3, "label": "unstable"},
    INADMISSIBLE: {
        "linestyle": (0, (1, 2)),
        "linewidth": 1.0,
        "alpha": 0.5,
        "label": "inadmissible orbits (they penetrate the stop)",
    },
}


class Special(NamedTuple):
    """Appearance of a kind of special point in a branch diagram: name, letters, marker."""

    name: str
    letters: str
    marker: str


SPECIAL = {
    "fold": Special("fold", "F", "D"),
    "period_doubling": Special("period doubling", "PD", "o"),
    "grazing": Special("grazing", "G", "s"),
    "end_of_sticking": Special("end of sticking", "S", "^"),
    "neimark_sacker": Special("Neimark-Sacker", "NS", "v"),
    "pitchfork": Special("pitchfork", "P", "P"),
}


def _datasets(argument: str, value: Any, variable: str, allowed: str, makers: str) -> list[xr.Dataset]:
    """Return the datasets of one result or a sequence, if each has the variable that identifies its kind."""
    alone = isinstance(value, xr.Dataset) or not np.iterable(value)
    datasets = [getattr(result, "dataset", result) for result in ([value] if alone else value)]
    for dataset in datasets:
        if not isinstance(dataset, xr.Dataset) or variable not in dataset or not varied_parameters(dataset):
            raise labels.refused(argument, dataset, allowed, f"pass what {makers} returns")
    if not datasets:
        raise ValueError(f"`{argument}` must hold at least one result of {makers}, got none")
    return datasets


def _plane(argument: str, drawn: list[xr.Dataset], must: str) -> list[str]:
    """Return the parameters that vary along all branches or curves, in the order of the first."""
    planes = {frozenset(names): " and ".join(names) for names in map(varied_parameters, drawn)}
    if len(planes) > 1:
        raise ValueError(f"`{argument}` must {must}, got {', '.join(planes.values())}; draw one figure for each")
    return varied_parameters(drawn[0])


def _kinds(codes: xr.DataArray) -> list[str]:
    """Return the names of the kinds of special points or of a curve."""
    names = flag_meanings(codes)
    return [names[int(code)] for code in np.atleast_1d(codes.values)]


class Part(NamedTuple):
    """A stretch of a branch drawn in one style: parameter values, and heights, such as velocities of each impact."""

    look: int
    values: Floats
    heights: Floats


@on_axes
def branch_diagram(branches: Any, diagram: xr.Dataset | None = None, ax: Axes | None = None) -> Axes:
    """Draw branches of periodic orbits: stable parts solid, unstable parts dashed, bifurcations marked and named.

    Each impact of a cycle gives one line. Parts with inadmissible orbits, which penetrate the stop, are dotted and do
    not affect the axis limits. A point on two branches is named once.

    Parameters
    ----------
    branches : Branch, xarray.Dataset, or sequence of them
        Results of `continue_orbit`, or their `dataset`, all along the same parameter.
    diagram : xarray.Dataset, optional
        A `vibroimpact.bifurcation_diagram` with section="impact" over the same parameter, drawn beneath as grey dots.

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
    drawn = _datasets("branches", branches, "special_kind", "branches of periodic orbits", "continue_orbit")
    (parameter,) = _plane("branches", drawn, "go along one parameter")
    if diagram is not None:
        _check_beneath(diagram, parameter)
    ax = style.new_axes(ax, (8.0, 5.0), labels.title(drawn[0] if diagram is None else diagram))
    heights = _draw_beneath(ax, drawn, diagram, parameter)
    entries = ax.get_legend_handles_labels()[0]
    names = [motion_along(branch) for branch in drawn]
    colors = {name: style.color_at(COLORS, at) for at, name in enumerate(dict.fromkeys(names))}
    looks: set[int] = set()
    in_view = [heights]
    for branch, name in zip(drawn, names, strict=True):
        for part in split(branch, parameter):
            ax.plot(part.values, part.heights, color=colors[name], zorder=3, **LOOKS[part.look] | {"label": None})
            looks.add(part.look)
            in_view += [part.heights.ravel()] if part.look != INADMISSIBLE else []
    entries += [Line2D([], [], color=color, linewidth=2.0, label=name) for name, color in colors.items()]
    entries += [Line2D([], [], color=INK, **LOOKS[look]) for look in sorted(looks)]
    set_height(ax, drawn[0], "velocity", np.concatenate(in_view))
    labels.label_axes(ax, drawn[0][parameter], drawn[0]["velocity"])
    entries += draw_special(ax, drawn)
    style.legend_below(ax, entries)
    return ax


def split(branch: xr.Dataset, parameter: str, quantity: str = "velocity") -> Iterator[Part]:
    """Yield the stretches of a branch on which its orbits are all stable, all unstable, or all inadmissible.

    A special point belongs to both stretches that meet at it.
    """
    values, heights = branch[parameter].values, branch[quantity].transpose("point", ...).values
    stable, admissible = (branch[name].values.astype(bool) for name in ("stable", "admissible"))
    looks = np.where(admissible, np.where(stable, STABLE, UNSTABLE), INADMISSIBLE)
    special = np.isin(values, branch["special_value"].values)
    # Between two points: rounding decides the side of a special point, so its neighbour determines the style.
    left, right = looks[:-1], looks[1:]
    between = np.where(special[:-1], right, np.where(special[1:], left, np.maximum(left, right)))
    # Between two special points the second decides: the style beyond it is known, and changes there.
    kinds = dict(zip(branch["special_value"].values.tolist(), _kinds(branch["special_kind"]), strict=True))
    for k in np.flatnonzero(special[:-1] & special[1:])[::-1]:
        if k + 1 < len(between):
            between[k] = _before(kinds[values[k + 1]], int(between[k + 1]), int(between[k]))
    if not len(between):  # a branch of one point
        between = looks
    cuts = np.flatnonzero(np.diff(between)) + 1
    for i, j in zip([0, *cuts], [*cuts, len(between)], strict=True):
        yield Part(int(between[i]), values[i : j + 1], heights[i : j + 1])


def _before(kind: str, beyond: int, otherwise: int) -> int:
    """Return the style before a special point from the style beyond it."""
    if kind == "grazing":
        return otherwise if beyond == INADMISSIBLE else INADMISSIBLE
    return {STABLE: UNSTABLE, UNSTABLE: STABLE}.get(beyond, beyond)


def _special_points(drawn: list[xr.Dataset], quantity: str) -> Iterator[tuple[str, float, Floats]]:
    """Yield kind, parameter value and heights of each special point once."""
    met: list[tuple[str, float]] = []
    for branch in drawn:
        rows = branch[f"special_{quantity}"].transpose("special", ...).values.reshape(branch.sizes["special"], -1)
        for kind, value, row in zip(_kinds(branch["special_kind"]), branch["special_value"].values, rows, strict=True):
            if not any(kind == other and np.isclose(value, at, rtol=1e-9, atol=0.0) for other, at in met):
                met.append((kind, float(value)))
                yield kind, float(value), row[np.isfinite(row)]


def draw_special(ax: Axes, drawn: list[xr.Dataset], quantity: str = "velocity") -> list[Line2D]:
    """Mark and name the special points of all branches; return the legend's entries."""
    entries, names = {}, []
    for kind, value, speeds in _special_points(drawn, quantity):
        special = SPECIAL[kind]
        look = DOTS | {"marker": special.marker, "markersize": 6.5, "zorder": 5, "markeredgewidth": 0.8}
        look |= dict(zip(("color", "markeredgecolor"), BOUNDARY_COLORS[kind], strict=True))
        ax.plot(np.full(len(speeds), value), speeds, **look)
        entries[kind] = Line2D([], [], label=f"{special.letters}: {special.name}", **look)
        names.append((value, float(speeds.max()), special.letters))
    for value, height, letters in _merged(ax, names):
        ax.annotate(letters, (value, height), (3, 6), textcoords="offset points", fontsize=9, color=INK,
                    path_effects=[HALO], zorder=6, annotation_clip=True)  # fmt: skip
    return [entries[kind] for kind in SPECIAL if kind in entries]


def _merged(ax: Axes, names: list[tuple[float, float, str]]) -> list[tuple[float, float, str]]:
    """Return names and their places; overlapping names are merged, with each kind named once."""
    wide, high = np.ptp(ax.get_xlim()), np.ptp(ax.get_ylim())
    joined: list[tuple[float, float, list[str]]] = []
    for value, height, letters in sorted(names):
        for i, (at, top, texts) in enumerate(joined):
            if value - at < NAME_WIDTH * wide * (len(texts) + 1) and abs(height - top) < NAME_HEIGHT * high:
                joined[i] = at, max(top, height), list(dict.fromkeys([*texts, letters]))
                break
        else:
            joined.append((value, height, [letters]))
    return [(at, top, ", ".join(texts)) for at, top, texts in joined]


def _check_beneath(diagram: Any, parameter: str) -> None:
    axis, samples = check_diagram(diagram)
    if samples != "impact" or axis != parameter:
        raise ValueError(
            f"`diagram` must hold impacts over {parameter}, as `branches` do, got {samples}s over {axis}; "
            f"call bifurcation_diagram with section='impact' over {parameter}"
        )


def _draw_beneath(ax: Axes, drawn: list[xr.Dataset], diagram: xr.Dataset | None, parameter: str) -> Floats:
    """Draw the samples of the diagram in grey, or set the x limits from the branches; return the heights drawn."""
    if diagram is None:
        values = np.concatenate([branch[parameter].values for branch in drawn])
        ax.set_xlim(*style.view(values, float(np.abs(values).max()) or 1.0))
        return np.empty(0)
    heights = draw_samples(ax, diagram, parameter, "impact", "velocity", SAMPLES)
    mark_empty(ax, diagram, parameter)
    return heights


@on_axes
def boundaries(curves: Any, sweep: xr.Dataset | None = None, index: str = "std", ax: Axes | None = None) -> Axes:
    """Draw the curves on which motions fold, double their period, graze, or cease to stick (bifurcation curves).

    Parameters
    ----------
    curves : Boundary, xarray.Dataset, or sequence of them
        Results of `continue_boundary` or `boundary_curves`, or their `dataset`, all in one plane.
    sweep : xarray.Dataset, optional
        A `vibroimpact.parameter_map` over the same two parameters, drawn beneath as in `index_contour` but without
        boundary lines; its first axis is the x axis.
    index : str
        The index of `sweep` to draw.

    Notes
    -----
    The colour shows the kind, and the dashes show the driving periods in a cycle: solid for 1, dashed for 2, with one
    more dot for each further period. Curves with enough room are labelled with their type, such as p1 i2 for period-1
    impact-2. If curves of one kind and type concern different stops, the label names the stops struck and, where these
    are the same, the stop that is grazed. Without `sweep` the first parameter of the curves is on the x axis, unless
    `ax` is labelled the other way round; axes that already show the plane keep their limits and legend. The points of a
    curve are joined by straight lines.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> from vibroimpact.continuation import boundary_curves
    >>> plane = ("omega", "restitution"), ((2, 3), (0.5, 0.9))
    >>> curves = boundary_curves(vi.ImpactOscillator(), *plane, n_periods=(1, 2), lines=3)
    >>> boundaries(curves).get_legend().get_texts()[0].get_text()
    'period doubling of period-1 impact-1'
    """
    makers = "continue_boundary or boundary_curves"
    drawn = _datasets("curves", curves, "kind", "boundaries in a plane of two parameters", makers)
    plane = _plane("curves", drawn, "lie in one plane")
    below: list[Any] = []
    if sweep is not None:
        _check_plane(sweep, plane)
        sweep, field = check_sweep(sweep, index, 2)
        ax = style.new_axes(ax, (7.2, 5.4), labels.title(sweep))
        below = draw_cells(ax, sweep, field)
    ax = style.new_axes(ax, (7.2, 5.4), labels.title(drawn[0]))
    x, y = _order(ax, drawn[0], plane)
    labelled = bool(ax.get_xlabel())
    limits = ax.get_xlim(), ax.get_ylim()
    lines = [_draw_curve(ax, curve, x, y) for curve in drawn]
    if labelled:
        ax.set(xlim=limits[0], ylim=limits[1])
    else:
        labels.label_axes(ax, drawn[0][x], drawn[0][y])
    style.legend_added(ax, [*below, *_entries(drawn, lines)])
    name_along(ax, zip(lines, _labels_of(drawn), strict=True))
    return ax


def _entries(drawn: list[xr.Dataset], lines: list[Line2D]) -> Iterator[Line2D]:
    """Yield the legend entries, one per style, by periods and then by kind, labelled with all its motions.

    Curves that differ only in their numbers of impacts have the same style; the label on each curve shows its type.
    """
    looks: dict[tuple[int, str], list[tuple[str, Line2D]]] = {}
    for curve, line in zip(drawn, lines, strict=True):
        (kind,) = _kinds(curve["kind"])
        motion = motion_along(curve, kind == "end_of_sticking")
        looks.setdefault((int(curve.attrs["n_periods"]), kind), []).append((motion, line))
    for (n, kind), curves in sorted(looks.items()):
        motions = sorted({motion for motion, _ in curves})
        same = f"period-{n} "
        further = [motion.removeprefix(same) if motions[0].startswith(same) else motion for motion in motions[1:]]
        line = curves[0][1]
        line.set_label(f"{_name_of(kind)} of {listed([*motions[:1], *further])}")
        yield line


def _name_of(kind: str) -> str:
    """Return the name of a kind of boundary as written before the name of a motion."""
    return "end" if kind == "end_of_sticking" else SPECIAL[kind].name


def _type_of(curve: xr.Dataset) -> str:
    """Return the shortest name of the motion that a curve bounds."""
    n, p = (int(curve.attrs[name]) for name in ("n_periods", "n_impacts"))
    if motion_along(curve) == WITHOUT:
        return "no impact"
    return f"p{n} i{p}" if p > 0 else f"p{n} sticking"


def _labels_of(drawn: list[xr.Dataset]) -> list[str]:
    """Return the types of the motions, with their stops where curves of one kind and type differ in these."""
    names = [_type_of(curve) for curve in drawn]
    kinds = [kind for curve in drawn for kind in _kinds(curve["kind"])]
    for stops in (_struck, _touched):
        texts = [stops(curve) for curve in drawn]
        looks = list(zip(kinds, names, strict=True))
        alike = {look: {text for other, text in zip(looks, texts, strict=True) if other == look} for look in looks}
        names = [
            f"{name}, {text}" if text and len(alike[kind, name]) > 1 else name
            for (kind, name), text in zip(looks, texts, strict=True)
        ]
    return names


def _struck(curve: xr.Dataset) -> str:
    """Return the stops that the motion strikes, such as 'left' or '2 left + right'; empty for one mass."""
    counts = Counter(str(curve.attrs.get("stops", "")).split())
    return " + ".join(f"{n} {stop}" if n > 1 < len(counts) else stop for stop, n in sorted(counts.items()))


def _touched(curve: xr.Dataset) -> str:
    """Return the stop that the motion grazes; empty for other kinds, and for one mass."""
    return f"touching {stop}" if (stop := curve.attrs.get("touched")) else ""


def _check_plane(sweep: Any, plane: list[str]) -> None:
    over = [str(dim) for dim in getattr(sweep, "dims", ()) if dim != "start"]
    if not isinstance(sweep, xr.Dataset) or set(over) != set(plane):
        raise ValueError(
            f"`sweep` must run over {' and '.join(plane)}, as `curves` do, got {' and '.join(over) or 'no axis'}; "
            "select values of further axes with .sel"
        )


def _order(ax: Axes, curve: xr.Dataset, plane: list[str]) -> tuple[str, str]:
    """Return the parameters on the x and the y axis: as the axes are labelled, else in the plane's order."""
    shown = tuple(
        labels.SHOWN.get(axis, axis.get_label_text().replace("\n", " ").partition(" [")[0])
        for axis in (ax.xaxis, ax.yaxis)
    )
    for x, y in (plane, plane[::-1]):
        if shown in (("", ""), tuple(labels.name_of(curve[name]) for name in (x, y))):
            return x, y
    raise ValueError(
        f"`ax` must be new or show {' and '.join(plane)}, as `curves` do, got axes of {shown[0]} and {shown[1]}"
    )


def _draw_curve(ax: Axes, curve: xr.Dataset, x: str, y: str) -> Line2D:
    """Draw one curve and return it."""
    (kind,) = _kinds(curve["kind"])
    color, halo = BOUNDARY_COLORS[kind]
    (line,) = ax.plot(
        curve[x].values,
        curve[y].values,
        color=color,
        linewidth=1.7,
        linestyle=_dashes(int(curve.attrs["n_periods"])),
        path_effects=[withStroke(linewidth=3.1, foreground=halo)],
        label="_",
        zorder=5,
    )
    return line


def _dashes(n_periods: int) -> Any:
    """Return the dash pattern for a number of driving periods: a dash, and a dot for each period beyond two."""
    return "solid" if n_periods == 1 else (0, (3.0, 1.2, *(0.7, 1.1) * (n_periods - 2)))
