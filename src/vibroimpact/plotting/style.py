"""The common style of all figures: colours, labels with symbol and unit, titles, limits, the stop, legends."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, TypeVar
from weakref import WeakSet

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import hsv_to_rgb, to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.transforms import ScaledTranslation
from numpy.typing import NDArray

from vibroimpact.dataset import arguments_of
from vibroimpact.motion import motion_name, refined
from vibroimpact.parameters import counted, invalid
from vibroimpact.plotting.labels import letters, wrapped
from vibroimpact.status import Status

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
Layer = tuple[Mask, str, str]  # mask of cells, colour, legend entry

# Okabe and Ito's palette: its hues can be distinguished by colour-blind readers and in print.
BLUE, RED, GREEN, INK, WALL = "#0072b2", "#d55e00", "#009e73", "#222222", "#b8b8b8"
STICKING = "#f0e442"  # colour of sticking in all maps

# Boundaries of motions by kind, in all maps and diagrams: the line, and a halo that makes it visible on any colour.
BOUNDARY_COLORS: dict[str, tuple[str, str]] = {
    "fold": ("#000000", "#ffffff"),
    "period_doubling": ("#ff5d8f", INK),
    "grazing": ("#ffb000", INK),
    "end_of_sticking": ("#7fe3ff", INK),
    "neimark_sacker": ("#6a3dff", "#ffffff"),
    "pitchfork": ("#d9ff5c", INK),
}

STATUS_COLORS: dict[Status, str] = {
    Status.NO_IMPACT: "#cfcfcf",
    Status.STOPPED_IMPACTING: "#a3a3a3",
    Status.STUCK_FOREVER: "#787878",
    Status.DECAYING: "#4f4f4f",
    Status.BUDGET: "#cc3d3d",
    Status.INTERRUPTED: "#f2a7a0",
    Status.INVALID_RESTITUTION: "#8a2f6b",
}

GOLDEN = 0.6180339887  # of a turn: successive hues at this distance fill the circle evenly for any number of them


def color_at(palette: Sequence[str], at: int) -> str:
    """Return colour number `at` of a palette; beyond its end, a further colour that is not in it."""
    if at < len(palette):
        return palette[at]
    further = at - len(palette)
    red, green, blue = hsv_to_rgb((GOLDEN * further % 1.0, *((0.95, 0.5), (0.55, 0.85), (0.9, 0.75))[further % 3]))
    return to_hex((red, green, blue))


STYLE: Any = {
    "axes.axisbelow": True,
    "axes.edgecolor": "#555555",
    "axes.grid": True,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.8,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlecolor": "#555555",
    "axes.titlesize": 8.5,
    "font.size": 10,
    "grid.color": "#e8e8e8",
    "grid.linewidth": 0.7,
    "xtick.color": "#555555",
    "xtick.labelcolor": INK,
    "ytick.color": "#555555",
    "ytick.labelcolor": INK,
}

DOTS: dict[str, Any] = {"linestyle": "none", "marker": "o", "markeredgewidth": 0}
RINGS: dict[str, Any] = {"linestyle": "none", "marker": "o", "markerfacecolor": "white"}
# By whether a stop is impenetrable: the fill behind it, and the line where contact begins.
BEHIND: dict[bool, dict[str, Any]] = {
    True: {"facecolor": "#ededed", "edgecolor": "#c4c4c4", "hatch": "////", "linewidth": 0.0},
    False: {"facecolor": "#f7f7f7", "edgecolor": "#e2e2e2", "hatch": "//", "linewidth": 0.0},
}
FACE: dict[bool, dict[str, Any]] = {
    True: {"color": "#555555", "linewidth": 1.2},
    False: {"color": "#8a8a8a", "linewidth": 1.0, "linestyle": (0, (4, 2))},
}
LETTERS = 15.0  # characters of a legend per inch of the figure
LEGEND_LINE = 0.17  # inches per line of a legend
PACKAGE_FIGURES: WeakSet[Figure] = WeakSet()  # figures created by the package
SAMPLE_DIMS = ("impact", "period")
LEGEND: dict[str, Any] = {"frameon": False, "fontsize": 8.5, "borderaxespad": 0.0}
BESIDE = "beside"  # marks a legend that is not below the axes


# Axes and their limits


Draw = TypeVar("Draw", bound=Callable[..., Axes])
ON_AXES = """
ax : matplotlib.axes.Axes, optional
    Where to draw; None makes a new figure.

Returns
-------
matplotlib.axes.Axes

Raises
------
ValueError
    A result is of another kind or lacks what is drawn, or an argument is out of its range.

"""


def on_axes(draw: Draw) -> Draw:
    """Add the common sections to the docstring of a figure function: last parameter, returns, raises."""
    text = inspect.cleandoc(draw.__doc__ or "")
    draw.__doc__ = re.sub(r"\n\n(?=(Notes|References|Examples)\n)", ON_AXES, text, count=1)
    return draw


def load_back_end() -> None:
    """Load the back end of pyplot: in a notebook it turns on interactive mode, which an rc context would undo."""
    import matplotlib.pyplot as plt

    plt.draw_if_interactive()  # type: ignore[no-untyped-call]


def new_axes(ax: Axes | None, size: tuple[float, float], title: str = "", projection: str | None = None) -> Axes:
    """Return `ax`, or the axes of a new pyplot figure in the package's style; global settings are not changed."""
    if isinstance(ax, Axes):
        return ax
    if ax is not None:
        raise invalid("ax", ax, "axes of matplotlib", "plt.subplots() makes some")
    import matplotlib.pyplot as plt

    load_back_end()
    with mpl.rc_context(STYLE):
        figure = plt.figure(figsize=size, layout="constrained")
        PACKAGE_FIGURES.add(figure)
        fresh = figure.add_subplot(projection=projection)
        fresh.set_title(broken(title, 9.5 * size[0]), y=1.0 if projection else None)
    return fresh


def panel_below(ax: Axes, inches: float) -> Axes:
    """Return new axes of the given height below those of a figure created by the package, with the same x axis."""
    figure: Any = ax.get_figure(root=True)
    width, height = figure.get_size_inches()
    figure.set_size_inches(width, height + inches)
    upper, lower = figure.add_gridspec(2, 1, height_ratios=(height, inches))
    ax.set_subplotspec(upper)
    ax.tick_params(labelbottom=False)
    with mpl.rc_context(STYLE):
        below: Axes = figure.add_subplot(lower, sharex=ax)
    return below


def broken(title: str, room: float) -> str:
    """Return a title, broken into two lines if it does not fit into one."""
    if letters(title) <= room:
        return title
    parts = title.split(",  ")
    half = (len(parts) + 1) // 2
    return ",  ".join(parts[:half]) + ",\n" + ",  ".join(parts[half:])


def magnitude(values: Floats, scale: float) -> float:
    """Return the largest magnitude of the values, or `scale` if they are rounding errors compared with it."""
    largest = float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
    return largest if largest > 1e-10 * scale else scale or 1.0


def view(values: Floats, size: float, least: float = 1e-6) -> tuple[float, float]:
    """Return axis limits around the finite values; ranges below `least` of the motion's size are widened to a tenth.

    A settled orbit repeats to rounding; tight limits would show the rounding errors.
    """
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return -size, size
    low, high = float(finite.min()), float(finite.max())
    half = 0.55 * (high - low)
    if high - low <= least * size:
        half = max(half, 0.05 * size)
    return 0.5 * (low + high) - half, 0.5 * (low + high) + half


def draw_stop(
    ax: Axes, gap: float, beyond: float, *, upright: bool, label: str = "", impenetrable: bool = True
) -> None:
    """Shade the region behind the stop, from the gap to the axis limit `beyond`; its label appears in the legend."""
    span, line = (ax.axvspan, ax.axvline) if upright else (ax.axhspan, ax.axhline)
    span(gap, beyond, **BEHIND[impenetrable], zorder=1.5, label=label)
    line(gap, **FACE[impenetrable], zorder=1.6)


def say_empty(ax: Axes, text: str) -> None:
    """Write in the middle of empty axes why nothing is drawn."""
    ax.text(0.5, 0.5, text, transform=ax.transAxes, ha="center", va="center", color="#555555")


# Legends


def _legible(handle: Any) -> Any:
    """Return a visible legend handle for fine dots; other handles are returned unchanged."""
    if not isinstance(handle, Line2D) or handle.get_linestyle() != "None" or handle.get_markersize() >= 4:
        return handle
    return Line2D([], [], **DOTS, markersize=4, color=handle.get_color(), label=str(handle.get_label()))


def _room(ax: Axes) -> float:
    """Return the number of letters of a legend that fit below the axes."""
    figure: Any = ax.get_figure(root=True)
    spec = ax.get_subplotspec()
    abreast = spec.get_topmost_subplotspec().get_gridspec().ncols if spec else 1
    beside = any(mesh.colorbar for mesh in ax.collections)  # the axes are then left of the centre
    return float((0.85 if beside else 1.0) * LETTERS * figure.get_size_inches()[0] / abreast)


def _columns(texts: Sequence[str], room: float) -> int:
    """Return the number of columns of legend entries that fit below the axes."""
    lengths = [letters(text) for text in texts]
    for columns in range(len(texts), 1, -1):  # Matplotlib fills column by column, as array_split does
        if sum(part.max() + 6 for part in np.array_split(lengths, columns)) <= room:
            return columns
    return 1


def legend_below(ax: Axes, handles: Sequence[Any] | None = None) -> None:
    """Place the legend below the axis label, in as many columns as fit, where it hides no data.

    The height of a figure created by the package is increased, so that the axes keep their height.
    """
    handles = ax.get_legend_handles_labels()[0] if handles is None else handles
    if not handles:
        return
    figure: Any = ax.get_figure(root=True)
    before, room = legend_lines(ax), _room(ax)
    texts = [wrapped(str(handle.get_label()), room - 6) for handle in handles]
    below = 6 / 72 if ax.name == "3d" else (ax.xaxis.label.get_text().count("\n") * 14 + 34) / 72  # of the axis label
    ax.legend(
        handles=[_legible(handle) for handle in handles],
        labels=texts,
        loc="upper center",
        ncols=_columns(texts, room),
        bbox_to_anchor=(0.5, 0.0),
        bbox_transform=ax.transAxes + ScaledTranslation(0.0, -below, figure.dpi_scale_trans),
        handletextpad=0.5,
        columnspacing=1.6,
        **LEGEND,
    )
    if figure in PACKAGE_FIGURES:
        width, height = figure.get_size_inches()
        figure.set_size_inches(width, height + LEGEND_LINE * (legend_lines(ax) - before))


def legend_lines(ax: Axes) -> int:
    """Return the number of lines of the legend below the axes."""
    legend: Any = ax.get_legend()
    if legend is None or legend.get_gid() == BESIDE:
        return 0
    texts = [text.get_text() for text in legend.get_texts()]
    return int(max(sum(text.count("\n") + 1 for text in part) for part in np.array_split(texts, legend._ncols)))


def legend_beside(ax: Axes, handles: Sequence[Any], heading: str) -> None:
    """Place the legend to the right of the axes, where it hides no data."""
    legend = ax.legend(
        handles=handles,
        title=heading,
        loc="upper left",
        bbox_to_anchor=(1.02, 1.0),
        title_fontsize=8.5,
        alignment="left",
        handlelength=1.4,
        handleheight=1.1,
        labelspacing=0.45,
        **LEGEND,
    )
    legend.set_gid(BESIDE)


def legend_added(ax: Axes, handles: Sequence[Any]) -> None:
    """Place entries below the axes, after those of an existing legend."""
    before = ax.get_legend()
    if not handles:
        return
    if before is not None and before.get_gid() == BESIDE:
        legend_below(ax, handles)
        ax.add_artist(before).set_clip_on(False)
    else:
        legend_below(ax, [*(before.legend_handles if before else []), *handles])


# Missing values and their reasons


def outcome(status: Status) -> str:
    """Return the status of a motion as text, with its meaning."""
    return f"{status.word.replace('_', ' ')}: {status.sentence.split(';')[0]}"


def origin(dataset: xr.Dataset) -> str:
    """Return the initial condition of a map's motions as text such as ' from rest', or ''."""
    if "origin" in dataset.attrs:
        return str(dataset.attrs["origin"])
    arguments = arguments_of(dataset)
    fresh = arguments.get("direction", "fresh") == "fresh"
    from_rest = fresh and "start" in arguments and arguments["start"] is None
    return " from rest" if from_rest else ""


def by_status(missing: Mask, codes: NDArray[np.integer[Any]], noun: str, origin: str = "") -> Iterator[Layer]:
    """Yield, for each status that leaves values missing, the mask of its cells, its colour and its legend entry."""
    for status in Status:
        mask = missing & (codes == status)
        if count := int(mask.sum()):
            words = {
                Status.NO_IMPACT: f"no impact{origin}",
                Status.STOPPED_IMPACTING: f"impacts cease after a transient{origin.removeprefix(' from rest')}",
            }
            text = words.get(status) or motion_name(int(refined(0, status)))
            yield mask, STATUS_COLORS.get(status, WALL), text + (f" ({counted(count, noun)})" if noun else "")


def mark_missing(ax: Axes, positions: Floats, layers: Iterable[Layer]) -> None:
    """Mark missing values along the bottom axis, one colour per reason."""
    look: dict[str, Any] = DOTS | {"marker": "s", "markersize": 4.0, "zorder": 4, "transform": ax.get_xaxis_transform()}
    for mask, color, text in layers:
        edge = {"markeredgewidth": 0.5, "markeredgecolor": WALL} if color == "#ffffff" else {}
        ax.add_line(Line2D(positions[mask], np.full(mask.sum(), 0.012), color=color, label=text, **look | edge))
