"""The sizes that relative changes of parameters refer to when the parameters themselves are 0.

A size has the unit of the parameter and is computed from the design's other numbers, so that verdicts do not depend on
units.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibroimpact.model import Model
from vibroimpact.parameters import CRITICAL, Scale, critical_damping, with_unit
from vibroimpact.parameters import LIGHT as LIGHT

WIDEST = 200  # powers of two between which the size of a family's parameter is searched for
LARGE = 0.5  # relative change of one of a design's numbers at which the size of a parameter is found


def scale_of(model: Model, name: str, value: float) -> Scale:
    """Return the scale that changes of a parameter from a value are relative to.

    That is the value itself. For a gap, and for a number that is not positive, it is the larger of the value's modulus
    and a size: the static deflection for a gap (f/k of one mass), critical damping, k |g| for a force, 1 for a
    restitution, m w^2 for a stiffness. For a family's parameter at 0, the size is the change that changes one of the
    design's numbers by that number's own size.
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
    """Return whether changes are relative to the value itself; they are not for the gap of one mass, which may be 0."""
    return value > 0.0 and name not in getattr(model, "offsets", ())  # families have none


def _unit(model: Model, name: str) -> Scale:
    """Return one unit, for designs in which nothing has a comparable size: their motions are similar at any size."""
    return Scale(1.0, with_unit("1", model.parameters[name].unit))


# Parameters of families


def _of_family(model: Model, name: str) -> Scale:
    """Return the size of a family's parameter at 0: a power of two near it, divided by the change that this causes."""
    low, high, unit = -WIDEST, WIDEST, model.parameters[name].unit
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if _relative_change(model, name, 2.0**middle) >= LARGE else (middle, high)
    if high == WIDEST:
        return Scale(0.0)
    far = _relative_change(model, name, 2.0**high)
    size = 2.0**high / far if math.isfinite(far) else 2.0**high
    return Scale(size, with_unit(f"{size:.3g}", unit))


def _relative_change(model: Model, name: str, value: float) -> float:
    """Return the largest change of a design's numbers by a parameter, over their sizes; infinite without a design."""
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
