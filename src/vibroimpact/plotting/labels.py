"""What labels and titles say: names, symbols, units, the parameters that a result holds fixed."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.axis import Axis

from vibroimpact.dataset import VARIABLES, model_of
from vibroimpact.model import Model
from vibroimpact.parameters import counted
from vibroimpact.plotting.ticks import power_of, quantity, scale_axis, unit_label

MOST = 8  # values of parameters in a title
PER_INCH = 11.5  # letters of an axis label

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
    "Std": r"\mathrm{Std}",
}
WORDS = ("stuck", "spread", "margin")  # of the table of indices, which no figure shows: the long name says it


def math(symbol: str) -> str:
    """Return a symbol of the glossary as mathtext; a name of several letters as plain text."""
    if match := re.fullmatch(r"([^\W_])_(\w+)('?)", symbol):  # such as g_bar, of a stop
        letter, name, prime = match.groups()
        dot, below = r"\dot " if prime else "", name.replace("_", r"\ ")
        return rf"${dot}{letter}_\mathrm{{{below}}}$"
    if symbol in _MATH or re.fullmatch(r"\w(/\w)?", symbol):
        return f"${_MATH.get(symbol, symbol)}$"
    return symbol.replace("$", r"\$")


def described(data: xr.DataArray) -> tuple[str, str, str]:
    """Return long name, unit and symbol of a labelled array; the package's table fills in what is missing."""
    usual = VARIABLES.get(str(data.name), (str(data.name), "", ""))
    long_name, units, symbol = (
        str(data.attrs.get(key, other)) for key, other in zip(("long_name", "units", "symbol"), usual, strict=True)
    )
    return long_name, units, symbol


def symbol_of(data: xr.DataArray) -> str:
    """Return the symbol of a labelled array as mathtext, or its long name if it has none."""
    long_name, _, symbol = described(data)
    return long_name if symbol in WORDS else math(symbol or str(data.name))


def label(data: xr.DataArray, power: int = 0) -> str:
    r"""Return an axis label such as 'angular driving frequency $\omega$ [rad/s]', in units of a power of ten."""
    long_name, units, symbol = described(data)
    shown = symbol_of(data) if symbol not in ("", long_name, data.name, *WORDS) else ""
    if symbol == "Std":
        shown = f"({shown})"
    return f"{long_name} {shown}".rstrip() + unit_label(units, power)


def letters(text: str) -> int:
    """Return the number of letters that a label shows."""
    plain = re.sub(r"\\[a-zA-Z,]+ ?", "x", text.replace(r"\mathrm", ""))
    return max(len(re.sub(r"[${}^_]", "", line)) for line in plain.split("\n"))


def wrapped(text: str, room: float) -> str:
    """Return a label in as many lines as it needs; symbols, units and what stands in parentheses are not split."""
    parts = re.findall(r"\(.*?\)|\$[^$]*\$|\[[^]]*\]|\S+", text)
    lines = parts[:1]
    for part in parts[1:]:
        joined = f"{lines[-1]} {part}"
        if letters(joined) <= room:
            lines[-1] = joined
        else:
            lines.append(part)
    return "\n".join(lines)


def label_axis(axis: Axis, data: xr.DataArray, values: Any = None) -> None:
    """Label an axis with name, symbol and unit, and give it ticks in that unit, with a prefix where it needs one.

    The size of `values` decides; None takes the axis limits, or the data where limits are not set yet.
    """
    axes: Any = axis.axes
    along_x = axis is axes.xaxis
    if values is None:
        unset = axes.get_autoscalex_on() if along_x else axes.get_autoscaley_on()
        values = data.values if unset else axis.get_view_interval()
    power = power_of(values)
    scale_axis(axis, data, power)
    width, height = axes.get_figure(root=True).get_size_inches() * axes.get_position().size
    axis.set_label_text(wrapped(label(data, power), PER_INCH * (width if along_x else height)))


def label_axes(ax: Axes, x: xr.DataArray, y: xr.DataArray) -> None:
    """Label both axes with name, symbol and unit of what lies along them."""
    label_axis(ax.xaxis, x)
    label_axis(ax.yaxis, y)


def value_text(symbol: str, value: float, units: str) -> str:
    """Return 'm = 1 kg' for a quantity and its value."""
    return f"{math(symbol)} = {quantity(value, units)}"


def parameter_value_text(symbol: str, value: float, units: str) -> str:
    """Return a parameter and its value, an angular frequency also in Hz."""
    hertz = f" ({quantity(value / (2.0 * np.pi), 'Hz')})" if units == "rad/s" else ""
    return value_text(symbol, value, units) + hertz


def parameter_text(name: str, model: Model) -> str:
    """Return a parameter of a model and its value."""
    parameter = model.parameters[name]
    return parameter_value_text(parameter.symbol or name, model.values[name], parameter.unit)


def percent(share: float) -> str:
    """Return a share in per cent."""
    return f"{100.0 * share:.1f} %" if share >= 0.0005 else "<0.1 %"


def refused(argument: str, value: Any, allowed: str, hint: str) -> ValueError:
    """Return the error for a value of another kind, which it names."""
    if isinstance(value, xr.Dataset):
        names, dims = (", ".join(map(str, part)) for part in (value.data_vars, value.dims))
        maker = f"a result of {value.attrs['function']}" if value.attrs.get("function") else "a Dataset"
        kind = f"{maker} with {names or 'no variable'} over {dims or 'no axis'}"
    else:
        name = type(value).__name__
        kind = f"{'an' if name[0] in 'AEIOUaeiou' else 'a'} {name}"
    return ValueError(f"`{argument}` must be {allowed}, got {kind}; {hint}")


def _selected(dataset: xr.Dataset) -> dict[str, float]:
    """Return the values selected from the axes of a result."""
    return {
        str(name): float(coord)
        for name, coord in dataset.coords.items()
        if coord.ndim == 0 and coord.dtype.kind in "biuf"
    }


def _family(dataset: xr.Dataset) -> tuple[str, dict[str, float]] | None:
    """Return the name of the family that made a result, and its parameters; None for a plain oscillator."""
    if "model" not in dataset.attrs:
        return None
    values = json.loads(dataset.attrs["model"])
    return str(values.pop("family")), values | {k: v for k, v in _selected(dataset).items() if k in values}


def selected_model(dataset: xr.Dataset) -> Any:
    """Return the oscillator or the system of a result, with the values selected from its axes; None if not recorded.

    Of a family it is the one at the family's own values.
    """
    if not {"oscillator", "system"} & set(dataset.attrs):
        return None
    model = model_of(dataset)
    if _family(dataset):
        return model
    return model.replace(**{name: value for name, value in _selected(dataset).items() if name in model.parameters})


def model_value(dataset: xr.Dataset, name: str) -> float | None:
    """Return a parameter's value in the model of a result; None if there is none."""
    family = _family(dataset)
    if family:
        return family[1].get(name)
    model = selected_model(dataset)
    value = getattr(model, "values", {}).get(name, getattr(model, name, None))
    return None if value is None else float(value)


def title(dataset: xr.Dataset) -> str:
    """Return the parameters that a result holds fixed, and its note or from where it begins, in one line."""
    model, family = selected_model(dataset), _family(dataset)
    varied = {str(name) for name, coord in dataset.coords.items() if coord.ndim}
    values: list[str] = []
    if family:
        values = [f"{name} = {value:.5g}" for name, value in family[1].items() if name not in varied]
        values = [family[0], *(values if len(values) <= MOST else ())]
    elif model:
        varied |= {model.parameters[name].replaces or name for name in varied if name in model.parameters}
        values = [parameter_text(name, model) for name in model.values if name not in varied]
        if len(values) > MOST:
            values = [*values[: "omega" not in varied], counted(len(model.stops), "stop")]
    return ",  ".join(filter(None, [*values, str(dataset.attrs.get("note", _origin(dataset)))]))


def _origin(dataset: xr.Dataset) -> str:
    """Return from which initial condition a result was computed, if it says so."""
    start = str(dataset.attrs.get("initial_condition", "")).partition(":")[0]
    direction = json.loads(dataset.attrs.get("arguments", "{}")).get("direction", "fresh")
    way = "" if direction == "fresh" else f"going {direction} "
    return f"{way}from {'rest' if start.startswith('rest') else start}" if start else ""
