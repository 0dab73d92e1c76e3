"""One look for every figure: colours, labels with symbol and unit, titles, limits, the stop, legends."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.transforms import ScaledTranslation
from numpy.typing import NDArray

from vibroimpact.dataset import VARIABLES, oscillator_of
from vibroimpact.oscillator import ImpactOscillator, Model
from vibroimpact.status import Status

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
Layer = tuple[Mask, str, str]  # cells, their colour, their legend entry

# Okabe and Ito's palette: the hues differ for colour-blind readers and in print.
BLUE, RED, GREEN, INK, WALL = "#0072b2", "#d55e00", "#009e73", "#222222", "#b8b8b8"
STICKING = "#f0e442"  # in every map that shows where the mass comes to rest at the stop

# Of the boundaries of motions by kind, in every map and diagram: the line, and a halo that makes it show on any colour.
BOUNDARY_COLORS: dict[str, tuple[str, str]] = {
    "fold": ("#000000", "#ffffff"),
    "period_doubling": ("#ff5d8f", INK),
    "grazing": ("#ffb000", INK),
    "end_of_sticking": ("#7fe3ff", INK),
}

STATUS_COLORS: dict[Status, str] = {
    Status.NO_IMPACT: "#cfcfcf",
    Status.STOPPED_IMPACTING: "#a3a3a3",
    Status.STUCK_FOREVER: "#787878",
    Status.DECAYING: "#4f4f4f",
    Status.BUDGET: "#cc3d3d",
    Status.INTERRUPTED: "#f2a7a0",
}

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

_MATH = {
    "w": r"\omega",
    "w/2pi": r"\omega/2\pi",
    "zeta": r"\zeta",
    "psi/T": r"\psi/T",
    "y'": r"\dot y",
    "<I>": r"\langle I\,\rangle",
    "max I": r"\max\,I",
    "λ": r"\lambda",
    "λ per impact": r"\lambda_\mathrm{impact}",
} | {name: rf"\mathrm{{{name}}}" for name in ("Std", "stuck", "spread", "margin")}
DOTS: dict[str, Any] = {"linestyle": "none", "marker": "o", "markeredgewidth": 0}
RINGS: dict[str, Any] = {"linestyle": "none", "marker": "o", "markerfacecolor": "white"}
LETTERS = 12.5  # of a legend, per inch of the figure
SAMPLE_DIMS = ("impact", "period")
LEGEND: dict[str, Any] = {"frameon": False, "fontsize": 8.5, "borderaxespad": 0.0}
BESIDE = "beside"  # marks a legend that leaves the room below the axes free


# Labels and titles


def math(symbol: str) -> str:
    """Return a symbol of the glossary as mathtext; a name of several letters as plain text."""
    if symbol in _MATH or re.fullmatch(r"\w(/\w)?", symbol):
        return f"${_MATH.get(symbol, symbol)}$"
    return symbol.replace("$", r"\$")


def unit_suffix(units: str, form: str = " [{}]") -> str:
    """Return the unit as a label shows it; nothing for a pure number."""
    return "" if units in ("", "1") else form.format(units)


def described(data: xr.DataArray) -> tuple[str, str, str]:
    """Return long name, unit and symbol of a labelled array; the package's table fills in what is missing."""
    usual = VARIABLES.get(str(data.name), (str(data.name), "", ""))
    long_name, units, symbol = (
        str(data.attrs.get(key, other)) for key, other in zip(("long_name", "units", "symbol"), usual, strict=True)
    )
    return long_name, units, symbol


def symbol_of(data: xr.DataArray) -> str:
    """Return the symbol of a labelled array as mathtext, or its name if it has none."""
    return math(described(data)[2] or str(data.name))


def label(data: xr.DataArray) -> str:
    r"""Return an axis label such as 'angular driving frequency $\omega$ [rad/s]'."""
    long_name, units, symbol = described(data)
    shown = f" {math(symbol)}" if symbol and symbol not in (long_name, data.name) else ""
    return f"{long_name}{shown}{unit_suffix(units)}"


def label_axes(ax: Axes, x: xr.DataArray, y: xr.DataArray) -> None:
    """Label both axes with name, symbol and unit of what lies along them."""
    ax.set_xlabel(label(x))
    ax.set_ylabel(label(y))


def value_text(symbol: str, value: float, units: str) -> str:
    """Return 'm = 1 kg' for a quantity and its value."""
    return f"{math(symbol)} = {value:.5g}{unit_suffix(units, ' {}')}"


def held_text(symbol: str, value: float, units: str) -> str:
    """Return a parameter and its value, an angular frequency also in Hz."""
    hertz = f" ({value / (2.0 * np.pi):.5g} Hz)" if units == "rad/s" else ""
    return value_text(symbol, value, units) + hertz


def parameter_text(name: str, model: Model) -> str:
    """Return a parameter of a model and its value."""
    parameter = model.parameters[name]
    return held_text(parameter.symbol or name, model.values[name], parameter.unit)


def percent(share: float) -> str:
    """Return a share in per cent."""
    return f"{100.0 * share:.1f} %" if share >= 0.0005 else "<0.1 %"


def counted(count: int, noun: str) -> str:
    """Return '1 impact', '2 impacts'."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def refused(argument: str, value: Any, allowed: str, hint: str) -> ValueError:
    """Return the error for a result of another kind, which says what was given."""
    if isinstance(value, xr.Dataset):
        names, dims = (", ".join(map(str, found)) for found in (value.data_vars, value.dims))
        kind = f"a result of {value.attrs['function']}" if value.attrs.get("function") else "a Dataset"
        given = f"{kind} with {names or 'no variable'} over {dims or 'no axis'}"
    else:
        name = type(value).__name__
        given = f"{'an' if name[0] in 'AEIOUaeiou' else 'a'} {name}"
    return ValueError(f"`{argument}` must be {allowed}, got {given}; {hint}")


def _selected(dataset: xr.Dataset) -> dict[str, float]:
    """Return the values selected from the axes of a result."""
    return {str(name): float(coord) for name, coord in dataset.coords.items() if coord.ndim == 0}


def _family(dataset: xr.Dataset) -> tuple[str, dict[str, float]] | None:
    """Return the name of the family that made a result, and its parameters; None for a plain oscillator."""
    if "model" not in dataset.attrs:
        return None
    values = json.loads(dataset.attrs["model"])
    return str(values.pop("family")), values | {k: v for k, v in _selected(dataset).items() if k in values}


def reference(dataset: xr.Dataset) -> ImpactOscillator | None:
    """Return the oscillator of a result, with the values selected from its axes; None if it is not recorded.

    Of a family it is the oscillator at the family's own values.
    """
    if "oscillator" not in dataset.attrs:
        return None
    osc = oscillator_of(dataset)
    if _family(dataset):
        return osc
    return osc.replace(**{name: value for name, value in _selected(dataset).items() if name in osc.parameters})


def own_value(dataset: xr.Dataset, name: str) -> float | None:
    """Return a parameter's own value in the model of a result; None if there is none."""
    family = _family(dataset)
    return family[1].get(name) if family else getattr(reference(dataset), name, None)


def title(dataset: xr.Dataset) -> str:
    """Return the parameters that a result holds fixed, and its note if it has one, in one line."""
    osc, family = reference(dataset), _family(dataset)
    varied = {str(name) for name, coord in dataset.coords.items() if coord.ndim}
    held: list[str] = []
    if family:
        held = [family[0], *(f"{name} = {value:.5g}" for name, value in family[1].items() if name not in varied)]
    elif osc:
        varied |= {osc.parameters[name].replaces or name for name in varied if name in osc.parameters}
        held = [parameter_text(name, osc) for name in osc.values if name not in varied]
    return ",  ".join([*held, *([str(dataset.attrs["note"])] if "note" in dataset.attrs else [])])


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
    """Add to the docstring of a figure's function what is the same for all: its last parameter, returns, raises."""
    own = inspect.cleandoc(draw.__doc__ or "")
    draw.__doc__ = re.sub(r"\n\n(?=(Notes|References|Examples)\n)", ON_AXES, own, count=1)
    return draw


def new_axes(ax: Axes | None, size: tuple[float, float], title: str = "", projection: str | None = None) -> Axes:
    """Return `ax`, or the axes of a new pyplot figure in the package's style; global settings do not change."""
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    with mpl.rc_context(STYLE):
        figure = plt.figure(figsize=size, layout="constrained")
        fresh = figure.add_subplot(projection=projection)
        fresh.set_title(_broken(title, 13.0 * size[0]))
    return fresh


def _broken(title: str, room: float) -> str:
    """Return a title in two lines if it has more characters than fit into one."""
    if len(title.replace("$", "")) <= room:
        return title
    parts = title.split(",  ")
    half = (len(parts) + 1) // 2
    return ",  ".join(parts[:half]) + ",\n" + ",  ".join(parts[half:])


def magnitude(values: Floats, scale: float) -> float:
    """Return the largest magnitude of the values, or `scale` if they are mere rounding compared with it."""
    largest = float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
    return largest if largest > 1e-10 * scale else scale or 1.0


def view(values: Floats, size: float, least: float = 1e-6) -> tuple[float, float]:
    """Return axis limits around the finite values; a range below `least` of the motion's size is widened to a tenth.

    A settled orbit repeats to rounding; limits drawn tightly around it would show the rounding.
    """
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return -size, size
    low, high = float(finite.min()), float(finite.max())
    half = 0.55 * (high - low)
    if high - low <= least * size:
        half = max(half, 0.05 * size)
    return 0.5 * (low + high) - half, 0.5 * (low + high) + half


def draw_stop(ax: Axes, gap: float, beyond: float, *, upright: bool) -> None:
    """Shade the room behind the stop, from the gap to the axis limit `beyond`."""
    span, line = (ax.axvspan, ax.axvline) if upright else (ax.axhspan, ax.axhline)
    span(gap, beyond, facecolor="#ededed", edgecolor="#c4c4c4", hatch="////", linewidth=0.0, zorder=1.5)
    line(gap, color="#555555", linewidth=1.2, zorder=1.6)


# Legends


def _legible(handle: Any) -> Any:
    """Return a stand-in for fine dots that can be seen in a legend; other handles as they are."""
    if not isinstance(handle, Line2D) or handle.get_linestyle() != "None" or handle.get_markersize() >= 4:
        return handle
    return Line2D([], [], **DOTS, markersize=4, color=handle.get_color(), label=str(handle.get_label()))


def _columns(ax: Axes, handles: Sequence[Any]) -> int:
    """Return how many columns of legend entries fit below the axes."""
    figure: Any = ax.get_figure(root=True)
    spec = ax.get_subplotspec()
    abreast = spec.get_topmost_subplotspec().get_gridspec().ncols if spec else 1
    room = LETTERS * figure.get_size_inches()[0] / abreast
    lengths = [len(str(handle.get_label())) for handle in handles]
    for columns in range(len(handles), 1, -1):  # Matplotlib fills column by column, as array_split does
        if sum(part.max() + 6 for part in np.array_split(lengths, columns)) <= room:
            return columns
    return 1


def legend_below(ax: Axes, handles: Sequence[Any] | None = None) -> None:
    """Put the legend under the axis label, in as many columns as fit, where it hides no data."""
    handles = ax.get_legend_handles_labels()[0] if handles is None else handles
    if not handles:
        return
    under_label = ScaledTranslation(0.0, -34 / 72, ax.get_figure(root=True).dpi_scale_trans)  # type: ignore[union-attr]
    ax.legend(
        handles=[_legible(handle) for handle in handles],
        loc="upper center",
        ncols=_columns(ax, handles),
        bbox_to_anchor=(0.5, 0.0),
        bbox_transform=ax.transAxes + under_label,
        handletextpad=0.5,
        columnspacing=1.6,
        **LEGEND,
    )


def legend_beside(ax: Axes, handles: Sequence[Any], heading: str) -> None:
    """Put the legend to the right of the axes, where it hides no data."""
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
    """Put entries below the axes, after those of a legend that is there already."""
    before = ax.get_legend()
    if before is not None and before.get_gid() == BESIDE:
        legend_below(ax, handles)
        ax.add_artist(before).set_clip_on(False)
    else:
        legend_below(ax, [*(before.legend_handles if before else []), *handles])


# Where there is nothing to draw, and why


def outcome(status: Status) -> str:
    """Return how a motion ended and what that means."""
    return f"{status.word.replace('_', ' ')}: {status.sentence.split(';')[0]}"


def by_status(missing: Mask, codes: NDArray[np.integer[Any]], of_what: str) -> Iterator[Layer]:
    """Yield for each status where it leaves something without a value, its colour, and its legend entry."""
    for status in Status:
        here = missing & (codes == status)
        if count := int(here.sum()):
            yield here, STATUS_COLORS.get(status, WALL), f"{outcome(status)} ({counted(count, of_what)})"


def mark_missing(
    ax: Axes, positions: Floats, codes: NDArray[np.integer[Any]], missing: Mask, of_what: str = "column"
) -> None:
    """Mark along the bottom axis where there is nothing to draw, one colour per status."""
    look: dict[str, Any] = DOTS | {"marker": "s", "markersize": 4.0, "zorder": 4, "transform": ax.get_xaxis_transform()}
    for here, color, text in by_status(missing, codes, of_what):
        ax.add_line(Line2D(positions[here], np.full(here.sum(), 0.012), color=color, label=text, **look))
