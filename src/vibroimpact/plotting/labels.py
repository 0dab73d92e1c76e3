"""Texts of labels and titles: names, symbols, units, and the fixed parameters of a result."""

from __future__ import annotations

import re
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.axis import Axis

from vibroimpact.dataset import VARIABLES, arguments_of, family_in, model_of
from vibroimpact.model import Model
from vibroimpact.model.units import DISPLAY, display
from vibroimpact.parameters import counted, hertz
from vibroimpact.plotting.ticks import power_of, quantity, scale_axis, unit_label

MOST = 8  # most parameter values in a title
PER_INCH = 11.5  # most letters in a line of an axis label
SHOWN: WeakKeyDictionary[Axis, str] = WeakKeyDictionary()  # what the axes labelled here show

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
WORDS = ("stuck", "spread", "margin")  # index symbols omitted in figures, where the long name suffices


def math(symbol: str) -> str:
    """Return a glossary symbol as mathtext; a name of several letters becomes plain text."""
    if match := re.fullmatch(r"([^\W_])_(\w+)('?)", symbol):  # such as g_bar, the gap of a stop named "bar"
        letter, name, prime = match.groups()
        dot, below = r"\dot " if prime else "", name.replace("_", r"\ ")
        return rf"${dot}{letter}_\mathrm{{{below}}}$"
    if symbol in _MATH or re.fullmatch(r"\w(/\w)?", symbol):
        return f"${_MATH.get(symbol, symbol)}$"
    return symbol.replace("$", r"\$")


def described(data: xr.DataArray) -> tuple[str, str, str]:
    """Return long name, unit and symbol of a labelled array as shown, completed from the package's table."""
    usual, attrs = VARIABLES.get(str(data.name), (str(data.name), "", "")), display(data.attrs)[1]
    long_name, units, symbol = (
        str(attrs.get(key, other)) for key, other in zip(("long_name", "units", "symbol"), usual, strict=True)
    )
    return long_name, units, symbol


def symbol_of(data: xr.DataArray) -> str:
    """Return the symbol of a labelled array as mathtext, or its long name if it has none."""
    long_name, _, symbol = described(data)
    return long_name if symbol in WORDS else math(symbol or str(data.name))


def label(data: xr.DataArray, power: int = 0) -> str:
    r"""Return an axis label such as 'angular driving frequency $\omega$ [rad/s]', with a power of ten in the unit."""
    long_name, units, symbol = described(data)
    shown = symbol_of(data) if symbol not in ("", long_name, data.name, *WORDS) else ""
    if symbol == "Std":
        shown = f"({shown})"
    return f"{long_name} {shown}".rstrip() + unit_label(units, power)


def letters(text: str) -> int:
    """Return the number of visible letters of a label."""
    plain = re.sub(r"\\[a-zA-Z,]+ ?", "x", text.replace(r"\mathrm", ""))
    return max(len(re.sub(r"[${}^_]", "", line)) for line in plain.split("\n"))


def wrapped(text: str, room: float) -> str:
    """Return a label wrapped into lines; symbols, units and text in parentheses are not split."""
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
    """Label an axis with name, symbol and unit, and set ticks in that unit, with a prefix if needed.

    The magnitude of `values` determines the prefix; None uses the axis limits, or the data if no limits are set yet.
    """
    axes: Any = axis.axes
    along_x = axis is axes.xaxis
    if values is None:
        unset = axes.get_autoscalex_on() if along_x else axes.get_autoscaley_on()
        values = data.values if unset else axis.get_view_interval()
    factor = display(data.attrs)[0]
    power = power_of(np.asarray(values) * factor)
    scale_axis(axis, data, power, factor)
    SHOWN[axis] = name_of(data)
    width, height = axes.get_figure(root=True).get_size_inches() * axes.get_position().size
    axis.set_label_text(wrapped(label(data, power), PER_INCH * (width if along_x else height)))


def name_of(data: xr.DataArray) -> str:
    """Return the label of an axis without its unit, whichever unit is shown."""
    return label(data.assign_attrs({DISPLAY: data.attrs.get("units", "1")})).partition(" [")[0]


def label_axes(ax: Axes, x: xr.DataArray, y: xr.DataArray) -> None:
    """Label both axes with the names, symbols and units of their quantities."""
    label_axis(ax.xaxis, x)
    label_axis(ax.yaxis, y)


def value_text(symbol: str, value: float, units: str) -> str:
    """Return a quantity and its value, such as 'm = 1 kg'."""
    return f"{math(symbol)} = {quantity(value, units)}"


def parameter_value_text(symbol: str, value: float, units: str) -> str:
    """Return a parameter and its value; angular frequencies are also given in Hz."""
    in_hertz = f" ({quantity(hertz(value), 'Hz')})" if units == "rad/s" else ""
    return value_text(symbol, value, units) + in_hertz


def parameter_text(name: str, model: Model) -> str:
    """Return a parameter of a model and its value."""
    parameter = model.parameters[name]
    return parameter_value_text(parameter.symbol or name, model.values[name], parameter.unit)


def percent(share: float) -> str:
    """Return a share as a percentage."""
    return f"{100.0 * share:.1f} %" if share >= 0.0005 else "<0.1 %"


def refused(argument: str, value: Any, allowed: str, hint: str) -> ValueError:
    """Return the error for a value of the wrong kind; its message names the kind received."""
    if isinstance(value, xr.Dataset):
        names, dims = (", ".join(map(str, part)) for part in (value.data_vars, value.dims))
        maker = f"a result of {value.attrs['function']}" if value.attrs.get("function") else "a Dataset"
        kind = f"{maker} with {names or 'no variable'} over {dims or 'no axis'}"
    else:
        name = type(value).__name__
        kind = f"{'an' if name[0] in 'AEIOUaeiou' else 'a'} {name}"
    return ValueError(f"`{argument}` must be {allowed}, got {kind}; {hint}")


def _selected(dataset: xr.Dataset) -> dict[str, float]:
    """Return the axis values selected from a result."""
    return {
        str(name): float(coord)
        for name, coord in dataset.coords.items()
        if coord.ndim == 0 and coord.dtype.kind in "biuf"
    }


def _family(dataset: xr.Dataset) -> tuple[str, dict[str, float]] | None:
    """Return the family of a result, as `family_in` does, at the selected axis values."""
    family = family_in(dataset)
    if family is None:
        return None
    name, values = family
    return name, values | {k: v for k, v in _selected(dataset).items() if k in values}


def selected_model(dataset: xr.Dataset) -> Any:
    """Return the oscillator or system of a result at the selected axis values; None if it was not recorded.

    For a family, it is the one at the family's own values.
    """
    if not {"oscillator", "system"} & set(dataset.attrs):
        return None
    model = model_of(dataset)
    if _family(dataset):
        return model
    return model.replace(**{name: value for name, value in _selected(dataset).items() if name in model.parameters})


def model_value(dataset: xr.Dataset, name: str) -> float | None:
    """Return the value of a parameter in the model of a result; None if it has none."""
    family = _family(dataset)
    if family:
        return family[1].get(name)
    model = selected_model(dataset)
    value = getattr(model, "values", {}).get(name, getattr(model, name, None))
    return None if value is None else float(value)


def title(dataset: xr.Dataset) -> str:
    """Return the fixed parameters of a result, and its note or initial condition, in one line."""
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
            values = [*values[: "omega" in model.values and "omega" not in varied], counted(len(model.stops), "stop")]
    return ",  ".join(filter(None, [*values, str(dataset.attrs.get("note", _origin(dataset)))]))


def _origin(dataset: xr.Dataset) -> str:
    """Return the initial condition of a result as text; empty if it is not recorded."""
    start = str(dataset.attrs.get("initial_condition", "")).partition(":")[0]
    direction = arguments_of(dataset).get("direction", "fresh")
    way = "" if direction == "fresh" else f"going {direction} "
    return f"{way}from {'rest' if start.startswith('rest') else start}" if start else ""
