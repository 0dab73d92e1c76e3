"""The models that pages may show: the one that the server was started with, and the ready-made ones by name."""

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

Find = Callable[[str], Model]  # returns the model of a name in a link, or raises ValueError

RATES = ("rad/s", "Hz", "1/min")
DECADE = 10.0  # on either side of a value that has to be positive


def find_ready_made(name: str) -> Model:
    """Return a ready-made model by its name, or one mass with one stop for ""; files are not run for links."""
    from vibroimpact import models
    from vibroimpact.families import ready_made

    if not name:
        return ImpactOscillator()
    if name not in models.__all__:
        raise ValueError(f"`model` {name[:80]!r} is not known here; start the explorer with --model {name[:80]}")
    return ready_made(name)


def finder(name: str, model: Model) -> Find:
    """Return the function that finds a model of one's own, and those that are always known."""
    return lambda wanted: model if name and wanted == name else find_ready_made(wanted)


def open_model(model: Model, name: str = "") -> tuple[View, Find]:
    """Return the view of a model that a server is started with, and what finds it by its name in links.

    One mass with one stop is what the page shows without a name.
    """
    check_model(model, "model")
    link_name, find = name_in_links(model, name)
    view = first_view(model, link_name)
    return view if link_name else replace(view, index=View.index, samples=View.samples), find


def name_in_links(model: Model, name: str) -> tuple[str, Find]:
    """Return the name of a model in links, and the function that finds it: one mass with one stop has no name."""
    if getattr(model, "says_all", False):
        return "", find_ready_made
    link_name = printable(name or str(model)).replace(" ", "_")
    return link_name, finder(link_name, model)


def usual_range(parameter: Parameter, value: float, system: Any) -> Range:
    """Return the range of a parameter's slider, from its range and its value.

    All of a bounded range; a decade to either side of a number that must be positive, a third to three times of a rate;
    else from 0, or from as far on its other side, to three times the value.
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
    """Return the first view of a model: over its frequency, and over a number that moves a stop.

    Raises
    ------
    ValueError
        It has fewer than two parameters, or nothing about its own values is within the limits.
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
    """Whether a quantity of the oscillator or system depends on a parameter."""
    value = model.values[name]
    for other in (1.001 * value, 0.999 * value) if value else (1e-6,):
        try:
            return bool(quantity(model.replace(**{name: other}).at()) != quantity(model.at()))
        except ValueError:  # out of its range on that side
            continue
    return False
