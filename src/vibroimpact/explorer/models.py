"""The models that pages can show: the one with which the server was started, and ready-made ones by name."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from vibroimpact.explorer.limits import Range, allowed_range, near, with_axes
from vibroimpact.explorer.state import View, table
from vibroimpact.model import Model, check_model
from vibroimpact.model.oscillator import ImpactOscillator
from vibroimpact.parameters import Parameter, printable

Find = Callable[[str], Model]  # returns the model of a name in a link or raises ValueError

RATES = ("rad/s", "Hz", "1/min")
DECADE = 10.0  # factor to either side of a value that must be positive


def find_ready_made(name: str) -> Model:
    """Return a ready-made model by its name, or one mass with one stop for ""; links never run files."""
    from vibroimpact import models
    from vibroimpact.families import ready_made

    if not name:
        return ImpactOscillator()
    if name not in models.__all__:
        raise ValueError(f"`model` {name[:80]!r} is not known here; start the explorer with --model {name[:80]}")
    return ready_made(name)


def finder(name: str, model: Model) -> Find:
    """Return the function that finds the user's own model as well as the ready-made ones."""
    return lambda wanted: model if name and wanted == name else find_ready_made(wanted)


def open_model(model: Model, name: str = "") -> tuple[View, Find]:
    """Return the first view of a server's model, and the function that finds the model by its name in links.

    Without a name the page shows one mass with one stop.
    """
    check_model(model, "model")
    link_name, find = name_in_links(model, name)
    view = first_view(model, link_name)
    return view if link_name else replace(view, index=View.index, samples=View.samples), find


def name_in_links(model: Model, name: str) -> tuple[str, Find]:
    """Return the name of a model in links, and the function that finds it; one mass with one stop needs no name."""
    if getattr(model, "says_all", False):
        return "", find_ready_made
    link_name = printable(name or str(model)).replace(" ", "_")
    return link_name, finder(link_name, model)


def usual_range(parameter: Parameter, value: float, system: Any) -> Range:
    """Return the range of a parameter's slider, from its range and its value.

    A bounded range is used whole. A value that must be positive gets a decade to either side, a rate a third to three
    times its value. Otherwise the range extends from 0, or from minus the value if that is allowed, to three times the
    value.
    """
    low, high = parameter.low, parameter.high
    if math.isfinite(low) and math.isfinite(high):
        return low, high
    size = abs(value) or (system.velocity_scale / system.omega if parameter.unit == "m" else 1.0)
    if low == 0.0 and parameter.unit in RATES:
        return size / 3.0, 3.0 * size
    if low == 0.0:
        return (0.0, 3.0 * size) if parameter.closed else (size / DECADE, DECADE * size)
    return max(low, -size if value >= 0.0 else -3.0 * size), min(high, 3.0 * size if value >= 0.0 else size)


def first_view(model: Model, name: str) -> View:
    """Return the first view of a model: over its frequency, and over a parameter that moves a stop.

    Raises
    ------
    ValueError
        The model has fewer than two parameters, or no range around its own values is within the limits.
    """
    parameters = table(model)
    if len(parameters) < 2:
        raise ValueError(f"`model` {name!r} must have two or more parameters to vary, got {len(parameters)}; add some")
    x = next((key for key in parameters if _changes(model, key, lambda system: system.omega)), next(iter(parameters)))
    others = [key for key in parameters if key != x]
    y = next(
        (key for key in others if _changes(model, key, lambda system: [stop.gap for stop in system.stops])), others[-1]
    )
    system, values = model.at(), model.values
    ranges = {key: allowed_range(parameters[key], usual_range(parameters[key], values[key], system)) for key in (x, y)}
    close = {key: near(parameters[key], values[key], ends) for key, ends in ranges.items()}
    view = View(osc=model, x=x, y=y, x_range=close[x], y_range=close[y], model=name, index="max_velocity", samples=200)
    return with_axes(view, ranges)[0]


def _changes(model: Model, name: str, quantity: Callable[[Any], Any]) -> bool:
    """Whether a quantity of the oscillator or system depends on the parameter."""
    value = model.values[name]
    for other in (1.001 * value, 0.999 * value) if value else (1e-6,):
        try:
            return bool(quantity(model.replace(**{name: other}).at()) != quantity(model.at()))
        except ValueError:  # outside its range on that side
            continue
    return False
