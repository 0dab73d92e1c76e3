"""The sizes to which changes of parameters are relative where the parameters themselves are 0.

A size has the parameter's unit and is made of the design's other numbers. So a verdict does not depend on units.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibroimpact.model import Model
from vibroimpact.parameters import CRITICAL, Scale, critical_damping
from vibroimpact.parameters import LIGHT as LIGHT

WIDEST = 200  # powers of two between which the size of a family's parameter is sought
LARGE = 0.5  # of a design's numbers: as far as one must change to show the size of a parameter


def scale_of(model: Model, name: str, value: float) -> Scale:
    """Return the scale to which changes of a parameter from a value are relative.

    That is the value, or what is larger for a gap and for a number that is not positive: the static deflection (f/k of
    one mass) of a gap, critical damping, k |g| of a force, 1 of a restitution, m w^2 of a stiffness. For a
    family's parameter at 0 it is the change that makes one of the design's numbers another one of its size.
    """
    if is_own_scale(model, name, value):
        return Scale(value)
    if model.at() is model:
        scale = model.at().scales().get(name, Scale(0.0))
    else:
        scale = Scale(0.0) if value else _of_family(model, name)
    if scale.size < abs(value):
        return Scale(abs(value))
    return scale if scale.size > 0.0 else _unit(model, name)


def is_own_scale(model: Model, name: str, value: float) -> bool:
    """Return whether a value is what its changes are relative to: not the gap of one mass, which may be 0 as well."""
    return value > 0.0 and name not in getattr(model, "offsets", ())  # families have none


def _unit(model: Model, name: str) -> Scale:
    """Return one unit: nothing in the design has a size that could be compared, and motions are alike at any."""
    return Scale(1.0, f"1 {model.parameters[name].unit}".removesuffix(" 1"))


# Parameters of families


def _of_family(model: Model, name: str) -> Scale:
    """Return the size of a family's parameter at 0: a power of two near it is found first, then what share that is."""
    low, high, unit = -WIDEST, WIDEST, model.parameters[name].unit
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if _relative_change(model, name, 2.0**middle) >= LARGE else (middle, high)
    if high == WIDEST:
        return Scale(0.0)
    far = _relative_change(model, name, 2.0**high)
    size = 2.0**high / far if math.isfinite(far) else 2.0**high
    return Scale(size, f"{size:.3g} {unit}".removesuffix(" 1"))


def _relative_change(model: Model, name: str, value: float) -> float:
    """Return the change of a design's numbers by a parameter, over their sizes; infinite where there is no design."""
    numbers = _numbers(model.at())
    for signed in (value, -value):
        try:
            others = _numbers(model.at(**{name: signed}))
        except ValueError:
            continue
        if others.keys() != numbers.keys():
            return math.inf
        changes = [
            float(np.abs(np.subtract(others[key][0], number)).max(initial=0.0)) / size
            for key, (number, size) in numbers.items()
            if size > 0.0 and np.shape(number) == np.shape(others[key][0])
        ]
        return max(changes)
    return math.inf


def _numbers(design: Any) -> dict[str, tuple[Any, float]]:
    """Return the numbers of a design with their sizes."""
    scales = design.scales()
    sizes = {name: LIGHT * size if of == CRITICAL else size for name, (size, of) in scales.items()}
    numbers = {name: (value, max(abs(value), sizes.get(name, 0.0))) for name, value in design.values.items()}
    return numbers if design.says_all else numbers | _linear_numbers(design)


def _linear_numbers(design: Any) -> dict[str, tuple[Any, float]]:
    """Return the matrices, loads, directions and motions of a system, with their sizes."""
    mass = float(np.abs(design.mass).max())
    stiffness = max(float(np.abs(design.stiffness).max()), mass * design.omega**2)
    numbers: dict[str, tuple[Any, float]] = {
        "mass": (design.mass, mass),
        "stiffness": (design.stiffness, stiffness),
        "damping": (design.damping, LIGHT * critical_damping(stiffness, mass)),
    }
    scales, loads = design.scales(), {name: np.asarray(vector) for name, vector in design.force.vectors.items()}
    most = max((float(np.abs(vector).max()) for vector in loads.values()), default=0.0)
    for stop in design.stops:
        size, reach = float(np.abs(stop.direction).max()), max(scales[f"{stop.name}_gap"].size, abs(stop.gap))
        numbers[f"{stop.name}_direction"] = stop.direction, size
        numbers |= {f"{stop.name}_{order}": (by, reach) for order, by in stop.motion.items()}
        most = most or stiffness * reach / size
    return numbers | {name: (vector, most) for name, vector in loads.items()}
