"""What a change of a parameter is measured in where the parameter itself is 0: the size that its design gives it.

A size has the parameter's unit and is made of the design's other numbers. So a verdict does not depend on units.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.model import Model
from vibroimpact.oscillator import ImpactOscillator
from vibroimpact.system import ImpactSystem

LIGHT = 0.05  # of critical damping: a damping that machines have
WIDEST = 200  # powers of two between which the size of a family's parameter is sought
TURNED = 0.5  # of a design's numbers: as far as one must change to show the size of a parameter


class Scale(NamedTuple):
    """A size > 0 in the unit of a parameter, and its name; without a name it is the parameter's own."""

    size: float
    of: str = ""


def scale_of(model: Model, name: str, value: float) -> Scale:
    """Return the scale to which changes of a parameter from a value are relative.

    That is the value, or what is larger for a gap and for a number that is not positive: the static deflection (f/k of
    one mass) of a gap, critical damping, k |g| of a force, 1 of a restitution, m w^2 of a stiffness. Of a family's
    parameter at 0 it is the change that makes one of the design's numbers another one of its size.
    """
    if is_own_scale(model, name, value):
        return Scale(value)
    if isinstance(model, ImpactOscillator):
        given = _of_oscillator(model).get(name, Scale(0.0))
    elif isinstance(model, ImpactSystem):
        given = _of_system(model)[name]
    else:
        given = Scale(0.0) if value else _of_family(model, name)
    if given.size < abs(value):
        return Scale(abs(value))
    return given if given.size > 0.0 else _unit(model, name)


def is_own_scale(model: Model, name: str, value: float) -> bool:
    """Return whether a value is what its changes are relative to: not the gap of one mass, which may be 0 as well."""
    return value > 0.0 and not (isinstance(model, ImpactOscillator) and name == "gap")


def _unit(model: Model, name: str) -> Scale:
    """Return one unit: nothing in the design has a size that could be compared, and motions are alike at any."""
    return Scale(1.0, f"1 {model.parameters[name].unit}".removesuffix(" 1"))


def _of_oscillator(osc: ImpactOscillator) -> dict[str, Scale]:
    critical = 2.0 * math.sqrt(osc.stiffness * osc.mass)
    return {
        "damping": Scale(critical, "critical damping"),
        "damping_ratio": Scale(1.0, "critical damping"),
        "amplitude": Scale(osc.stiffness * abs(osc.gap), "k |g|"),
        "restitution": Scale(1.0, "1"),
        "gap": Scale(osc.amplitude / osc.stiffness, "f/k"),
    }


def _of_system(system: ImpactSystem) -> dict[str, Scale]:
    """Return the sizes of the numbers of stops, with the mass that each strikes, 1/(a . M^-1 a)."""
    found: dict[str, Scale] = {}
    widest = max((abs(stop.gap) for stop in system.stops), default=0.0)
    struck = 1.0 / np.diag(system.modal().mobility)
    for stop, mass, deflection in zip(system.stops, struck.tolist(), deflections(system).tolist(), strict=True):
        inert = mass * system.omega**2
        critical = 2.0 * math.sqrt((stop.stiffness or inert) * mass)
        gap = Scale(deflection, "the static deflection") if deflection else Scale(widest, "the widest gap")
        found |= {
            f"{stop.name}_gap": gap,
            f"{stop.name}_restitution": Scale(1.0, "1"),
            f"{stop.name}_stiffness": Scale(inert, "m w^2"),
            f"{stop.name}_damping": Scale(critical, "critical damping"),
        }
    return found


def deflections(system: ImpactSystem) -> Floats:
    r"""Return the change of clearances by forces at rest, :math:`\sum_{i,h} |\alpha_{ji} f_{hi}|/\Omega_i^2`, and the
    largest move of the stop itself; w stands for the :math:`\Omega` of modes without a spring.
    """
    form = system.modal()
    pushes = np.abs(form.constant) + np.abs(form.forces).sum(axis=0)
    squares = np.where(form.squares > 0.0, form.squares, form.omega**2)
    found: Floats = np.abs(form.directions) @ (pushes / squares) + np.abs(form.motions).sum(axis=1)
    return found


# Parameters of families


def _of_family(model: Model, name: str) -> Scale:
    """Return the size of a family's parameter at 0: a power of two near it is found first, then what share that is."""
    low, high, unit = -WIDEST, WIDEST, model.parameters[name].unit
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if _turned(model, name, 2.0**middle) >= TURNED else (middle, high)
    if high == WIDEST:
        return Scale(0.0)
    far = _turned(model, name, 2.0**high)
    size = 2.0**high / far if math.isfinite(far) else 2.0**high
    return Scale(size, f"{size:.3g} {unit}".removesuffix(" 1"))


def _turned(model: Model, name: str, value: float) -> float:
    """Return by how much a parameter changes a design's numbers, in parts of their sizes; infinite where none is."""
    numbers = _numbers(model.at())
    for signed in (value, -value):
        try:
            others = _numbers(model.at(**{name: signed}))
        except ValueError:
            continue
        if others.keys() != numbers.keys():
            return math.inf
        apart = [
            float(np.abs(np.subtract(others[key][0], at)).max(initial=0.0)) / size
            for key, (at, size) in numbers.items()
            if size > 0.0 and np.shape(at) == np.shape(others[key][0])
        ]
        return max(apart)
    return math.inf


def _numbers(made: Any) -> Mapping[str, tuple[Any, float]]:
    """Return the numbers of a design with their sizes."""
    if isinstance(made, ImpactOscillator):
        own = _of_oscillator(made)
        light = {"damping": LIGHT * own["damping"].size}
        return {
            name: (value, max(abs(value), light.get(name, own[name].size if name in own else 0.0)))
            for name, value in made.values.items()
        }
    mass, inert = float(np.abs(made.mass).max()), float(np.abs(made.mass).max()) * made.omega**2
    stiffness = max(float(np.abs(made.stiffness).max()), inert)
    found: dict[str, tuple[Any, float]] = {
        "mass": (made.mass, mass),
        "stiffness": (made.stiffness, stiffness),
        "damping": (made.damping, 2.0 * LIGHT * math.sqrt(stiffness * mass)),
        "omega": (made.omega, made.omega),
    }
    loads = {name: np.asarray(vector) for name, vector in made.force.vectors.items()}
    most = max((float(np.abs(vector).max()) for vector in loads.values()), default=0.0)
    own, values = _of_system(made), made.values
    for stop in made.stops:
        size = float(np.abs(stop.direction).max())
        found[f"{stop.name}_direction"] = stop.direction, size
        reach = max(own[f"{stop.name}_gap"].size, abs(stop.gap))
        found |= {f"{stop.name}_{order}": (by, reach) for order, by in stop.motion.items()}
        most = most or stiffness * reach / size
        for kind in stop.kinds:
            name = f"{stop.name}_{kind}"
            part = LIGHT if kind == "damping" else 1.0
            found[name] = values[name], max(abs(values[name]), part * own[name].size)
    return found | {name: (vector, most) for name, vector in loads.items()}
