"""One look for every figure: colours, labels with symbol and unit, the stop, legends clear of the data."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.transforms import ScaledTranslation
from numpy.typing import NDArray

from vibroimpact.dataset import VARIABLES, oscillator_of
from vibroimpact.oscillator import PARAMETERS, ImpactOscillator
from vibroimpact.status import Status

Floats = NDArray[np.float64]

# Okabe and Ito's palette: the hues stay apart for colour-blind readers and in print.
BLUE, RED, GREEN, INK, WALL = "#0072b2", "#d55e00", "#009e73", "#222222", "#b8b8b8"
STICKING = "#f0e442"  # in every map that shows where the mass comes to rest at the stop

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
    "psi/T": r"\psi/T",
    "y'": r"\dot y",
    "Std": r"\mathrm{Std}",
    "<I>": r"\langle I\,\rangle",
    "max I": r"\max\,I",
    "λ": r"\lambda",
    "λ per impact": r"\lambda_\mathrm{impact}",
    "stuck": r"\mathrm{stuck}",
    "spread": r"\mathrm{spread}",
    "margin": r"\mathrm{margin}",
}


def new_axes(ax: Axes | None, size: tuple[float, float], title: str = "", projection: str | None = None) -> Axes:
    """Return `ax`, or the axes of a fresh pyplot figure in the house style; global settings stay as they are."""
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    with mpl.rc_context(STYLE):
        figure = plt.figure(figsize=size, layout="constrained")
        fresh = figure.add_subplot(projection=projection)
        fresh.set_title(_broken(title, 13.0 * size[0]))
    return fresh


def _broken(title: str, room: float) -> str:
    """Return a title in two lines if it has more characters than there is room for."""
    if len(title.replace("$", "")) <= room:
        return title
    parts = title.split(",  ")
    half = (len(parts) + 1) // 2
    return ",  ".join(parts[:half]) + ",\n" + ",  ".join(parts[half:])


def math(symbol: str) -> str:
    """Return a symbol of the glossary as mathtext."""
    return f"${_MATH.get(symbol, symbol)}$"


def unit_suffix(units: str, form: str = " [{}]") -> str:
    """Return the unit as a label shows it; nothing where the quantity is a pure number."""
    return "" if units in ("", "1") else form.format(units)


def words(data: xr.DataArray) -> tuple[str, str, str]:
    """Return long name, unit and symbol of a labelled array; the house's table where a label is missing."""
    usual = VARIABLES.get(str(data.name), (str(data.name), "", ""))
    return tuple(  # type: ignore[return-value]
        str(data.attrs.get(key, other)) for key, other in zip(("long_name", "units", "symbol"), usual, strict=True)
    )


def label(data: xr.DataArray) -> str:
    r"""Return an axis label such as 'angular driving frequency $\omega$ [rad/s]'."""
    long_name, units, symbol = words(data)
    return f"{long_name}{f' {math(symbol)}' if symbol else ''}{unit_suffix(units)}"


def value_text(name: str, value: float) -> str:
    """Return 'm = 1 kg' for a parameter and its value."""
    _, units, symbol = VARIABLES[name]
    return f"{math(symbol)} = {value:.5g}{unit_suffix(units, ' {}')}"


def reference(dataset: xr.Dataset) -> ImpactOscillator | None:
    """Return the oscillator a result was made from, with the values selected from its axes, if it is told."""
    if "oscillator" not in dataset.attrs:
        return None
    selected = {
        str(name): float(coord)
        for name, coord in dataset.coords.items()
        if coord.ndim == 0 and name in (*PARAMETERS, "frequency")
    }
    return oscillator_of(dataset).replace(**selected)


def title(dataset: xr.Dataset) -> str:
    """Return the parameters that a result holds fixed, in one line."""
    osc = reference(dataset)
    if osc is None:
        return ""
    varied = [str(name) for name, coord in dataset.coords.items() if coord.ndim]
    swept = {"omega" if name == "frequency" else name for name in varied}
    return ",  ".join(held_text(name, osc) for name in PARAMETERS if name not in swept)


def held_text(name: str, osc: ImpactOscillator) -> str:
    """Return a parameter and its value, an angular frequency also in Hz."""
    told = value_text(name, getattr(osc, name))
    return f"{told} ({osc.frequency:.5g} Hz)" if name == "omega" else told


def required_oscillator(argument: str, dataset: xr.Dataset) -> ImpactOscillator:
    """Return the oscillator of a result whose figure shows the stop, or raise `ValueError`."""
    osc = reference(dataset)
    if osc is None:
        raise ValueError(
            f"`{argument}` has no attribute 'oscillator'; allowed is a result that tells where its stop is; "
            "keep the attributes (xarray.set_options(keep_attrs=True)) when you compute with a result"
        )
    return osc


def draw_stop(ax: Axes, gap: float, beyond: float, *, upright: bool) -> None:
    """Shade the room behind the stop, from the gap to the axis limit `beyond`."""
    span, line = (ax.axvspan, ax.axvline) if upright else (ax.axhspan, ax.axhline)
    span(gap, beyond, facecolor="#ededed", edgecolor="#c4c4c4", hatch="////", linewidth=0.0, zorder=1.5)
    line(gap, color="#555555", linewidth=1.2, zorder=1.6)


def magnitude(values: Floats, scale: float) -> float:
    """Return the largest magnitude of the values, or `scale` where they are nothing but rounding beside it."""
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


def _legible(handle: Any) -> Any:
    """Return a stand-in for fine dots that can be seen in a legend; other handles as they are."""
    if not isinstance(handle, Line2D) or handle.get_linestyle() != "None" or handle.get_markersize() >= 4:
        return handle
    name, color = str(handle.get_label()), handle.get_color()
    return Line2D([], [], linestyle="none", marker="o", markersize=4, markeredgewidth=0, color=color, label=name)


def legend_below(ax: Axes, handles: list[Any] | None = None) -> None:
    """Put the legend under the axis label, where it hides no data and leaves the title alone.

    It has as many columns as fit if all entries were as long as the longest.
    """
    handles = ax.get_legend_handles_labels()[0] if handles is None else handles
    if not handles:
        return
    longest = max(len(str(handle.get_label())) for handle in handles)
    under_label = ScaledTranslation(0.0, -34 / 72, ax.get_figure(root=True).dpi_scale_trans)  # type: ignore[union-attr]
    ax.legend(
        handles=[_legible(handle) for handle in handles],
        loc="upper center",
        ncols=max(1, min(len(handles), 84 // (longest + 6))),
        bbox_to_anchor=(0.5, 0.0),
        bbox_transform=ax.transAxes + under_label,
        frameon=False,
        fontsize=8.5,
        borderaxespad=0.0,
        handletextpad=0.5,
        columnspacing=1.6,
    )


def legend_lines(ax: Axes) -> int:
    """Return how many lines the legend of the axes has."""
    told = ax.get_legend()
    return -(-len(told.get_texts()) // told._ncols) if told else 0  # type: ignore[attr-defined]


def outcome(status: Status) -> str:
    """Return how a motion ended and what that means."""
    return f"{status.word.replace('_', ' ')}: {status.sentence.split(';')[0]}"


def status_label(status: Status, count: int, of_what: str) -> str:
    """Return a legend entry that says what happened in so many cells."""
    return f"{outcome(status)} ({count} {of_what}{'' if count == 1 else 's'})"


def mark_missing(ax: Axes, positions: Floats, codes: NDArray[np.integer[Any]], missing: NDArray[np.bool_]) -> None:
    """Mark along the bottom axis where there is nothing to draw, one colour a status."""
    for status in Status:
        here = missing & (codes == status)
        if here.any():
            count = int(here.sum())
            ax.add_line(
                Line2D(
                    positions[here],
                    np.full(count, 0.012),
                    transform=ax.get_xaxis_transform(),
                    linestyle="none",
                    marker="s",
                    markersize=4.0,
                    markeredgewidth=0.0,
                    color=STATUS_COLORS.get(status, WALL),
                    label=status_label(status, count, "column"),
                    zorder=4,
                )
            )


def tell_outcome(ax: Axes, dataset: xr.Dataset) -> None:
    """Let the legend say how a motion ended, unless it simply filled its window."""
    if "status" in dataset and dataset["status"].ndim == 0:
        status = Status(int(dataset["status"]))
        if not status.has_indices:
            ax.plot([], [], linestyle="none", label=outcome(status))


def note_empty(ax: Axes, dataset: xr.Dataset) -> None:
    """Say in the middle of empty axes why there is nothing to see."""
    text = "no sample"
    if "status" in dataset and dataset["status"].ndim == 0:
        text = Status(int(dataset["status"])).sentence.replace("; ", ";\n")
    ax.text(0.5, 0.5, text, transform=ax.transAxes, ha="center", va="center", color="#555555")
