"""The arguments of ready-made models: one table of names, units and ranges for all; and the two stops of a slot."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from dataclasses import replace
from typing import Any, ParamSpec, TypeVar

from vibroimpact.model import check_names
from vibroimpact.model.oscillator import ImpactOscillator
from vibroimpact.model.stops import Stop
from vibroimpact.parameters import Parameter

_Arguments = ParamSpec("_Arguments")
_Model = TypeVar("_Model")
_Documented = TypeVar("_Documented", bound=Callable[..., Any])


def _positive(name: str, long_name: str, unit: str, hint: str = "") -> Parameter:
    return Parameter(name, long_name, unit, name, 0.0, closed=False, hint=hint)


def _not_negative(name: str, long_name: str, unit: str, hint: str = "") -> Parameter:
    return Parameter(name, long_name, unit, name, 0.0, hint=hint)


def _restitution(stop: str) -> Parameter:
    name, where = f"{stop}_restitution", stop.replace("_", " ")
    usual = ImpactOscillator.parameters["restitution"]
    return replace(usual, name=name, symbol=name, long_name=f"{usual.long_name}, {where} side", follows="restitution")


def _place(name: str, of: str) -> Parameter:
    hint = "give the distance from the left end over the length"
    return Parameter(name, f"place of the {of}", "1", name, 0.0, 1.0, hint=hint)


_OF_OSCILLATORS = ("mass", "stiffness", "damping_ratio", "frequency", "restitution", "gap")
_OSCILLATORS = [replace(ImpactOscillator.parameters[name], replaces=None) for name in _OF_OSCILLATORS]
_MACHINES = [
    _not_negative("force", "driving force amplitude", "N", "for the opposite sign start half a period later instead"),
    Parameter("left_gap", "gap to the left stop", "m", "left_gap"),
    Parameter("right_gap", "gap to the right stop", "m", "right_gap"),
    _not_negative("amplitude", "amplitude of the driving motion", "m"),
    _positive("stop_stiffness", "stiffness of the stop", "N/m"),
    _not_negative("stop_damping", "damping of the stop", "N s/m"),
    _not_negative("base_acceleration", "amplitude of the base acceleration", "m/s^2"),
    _not_negative("unbalance", "unbalance", "kg m", "it is the rotating mass times its eccentricity"),
    _positive("rpm", "rotational speed", "1/min"),
    _positive("gravity", "acceleration of gravity", "m/s^2"),
    Parameter("inclination", "inclination of the slot", "deg", "inclination", -90.0, 90.0),
    _positive("clearance", "total clearance", "m", "it is the free travel from one side to the other"),
    _positive("second_clearance", "total clearance of the second slot", "m"),
]
_GEARS = [
    _positive("inertia", "moment of inertia", "kg m^2"),
    _positive("base_radius", "base radius", "m"),
    _positive("backlash", "backlash along the line of action", "m"),
    _positive("order", "engine order", "1", "it is the number of excitations per revolution, 2 for four cylinders"),
    _not_negative("angular_acceleration", "amplitude of the angular acceleration", "rad/s^2"),
    _not_negative("drag_torque", "mean drag torque", "N m"),
    _positive("second_inertia", "moment of inertia of the driven gear", "kg m^2"),
    _positive("second_base_radius", "base radius of the driven gear", "m"),
    _not_negative("torque", "mean torque", "N m"),
    _positive("mesh_stiffness", "stiffness of the teeth in mesh", "N/m"),
    _not_negative("mesh_damping_ratio", "damping ratio of the mesh", "1"),
    _not_negative("transmission_error", "amplitude of the static transmission error", "m"),
    _not_negative("rotational_damping", "rotational damping", "N m s/rad"),
]
_DAMPERS = [
    _positive("natural_frequency", "natural frequency of the structure", "Hz"),
    _positive("particle_mass", "mass of all particles", "kg"),
    _positive("second_particle_mass", "mass of the second particle", "kg"),
    Parameter("particles", "number of particles", "1", "particles", 1.0, 4.0, whole=True),
    _positive("mass_ratio", "mass of the absorber over that of the structure", "1"),
    _positive("tuning", "natural frequency of the absorber over that of the structure", "1"),
    _not_negative("absorber_damping_ratio", "damping ratio of the absorber", "1"),
    _positive("stroke", "stroke of the absorber to either side", "m"),
]
_BEAMS = [
    _positive("length", "length", "m"),
    _positive("width", "width", "m"),
    _positive("thickness", "thickness in the direction of motion", "m"),
    _positive("youngs_modulus", "Young's modulus", "Pa", "steel has 2.1e11 Pa"),
    _positive("density", "density", "kg/m^3", "steel has 7800 kg/m^3"),
    _place("force_at", "force"),
    _place("stop_at", "stop"),
    Parameter("modes", "number of modes", "1", "modes", 1.0, 12.0, whole=True),
]
_TUBES = [
    _positive("outer_diameter", "outer diameter", "m"),
    _positive("wall_thickness", "wall thickness", "m"),
    _not_negative("inner_fluid_density", "density of the fluid inside", "kg/m^3", "water has 1000 kg/m^3"),
    _not_negative("outer_fluid_density", "density of the fluid outside", "kg/m^3", "water has 1000 kg/m^3"),
    _not_negative("added_mass_coefficient", "added mass over displaced mass", "1", "it is 1 far from other tubes"),
    _not_negative("force_per_length", "amplitude of the force per length", "N/m"),
    Parameter("steady_force_per_length", "steady force per length", "N/m", "steady_force_per_length"),
    _place("first_support_at", "first support"),
    _place("second_support_at", "second support"),
    Parameter("supports", "number of supports", "1", "supports", 1.0, 32.0, whole=True),
    _positive("diametral_clearance", "diametral clearance in the supports", "m"),
]
_SIDES = [
    _restitution(stop)
    for stop in (
        "left", "right", "drive", "coast", "first_left", "first_right", "second_left", "second_right",
        "first_upper", "first_lower", "second_upper", "second_lower",
    )
]  # fmt: skip
TABLE = {entry.name: entry for entry in [*_OSCILLATORS, *_MACHINES, *_GEARS, *_DAMPERS, *_BEAMS, *_TUBES, *_SIDES]}


_RAISES = """
Raises
------
ValueError
    A number is out of its range.
"""


def checked(function: Callable[_Arguments, _Model]) -> Callable[_Arguments, _Model]:
    """Return the function with a check of each of its named numbers; `parameters` holds their table."""
    parameters = {name: TABLE[name] for name in inspect.signature(function).parameters}
    if "\nRaises\n" not in inspect.cleandoc(function.__doc__ or ""):
        function = sharing(_RAISES)(function)

    @functools.wraps(function)
    def model(*positional: _Arguments.args, **arguments: _Arguments.kwargs) -> _Model:
        check_names(parameters, arguments)
        numbers: dict[str, Any] = {
            name: parameters[name].check(value)
            for name, value in arguments.items()
            if value is not None or not parameters[name].follows
        }
        return function(*positional, **numbers)

    vars(model)["parameters"] = parameters
    return model


def sharing(sections: str) -> Callable[[_Documented], _Documented]:
    """Return the decorator that adds sections to the docstrings of machines that share them, before their notes."""

    def share(function: _Documented) -> _Documented:
        text = inspect.cleandoc(function.__doc__ or "")
        function.__doc__ = text.replace("\n\nNotes\n", f"\n\n{sections.strip()}\n\nNotes\n", 1)
        return function

    return share


def first_given(value: float | None, usual: float) -> float:
    """Return the restitution of a side, or that of all sides if it has none of its own."""
    return usual if value is None else value


def slot(
    below: str,
    above: str,
    direction: Any,
    clearance: float,
    amplitude: float | None = None,
    restitutions: tuple[float | None, float | None] = (None, None),
    **contact: Any,
) -> list[Stop]:
    """Return the two ends of a slot along direction . q, each at half of the clearance at q = 0.

    The flanks of a tooth are such ends, too. They move together as amplitude sin wt, if an amplitude is given;
    `contact` holds their restitution, or their stiffness and damping; `restitutions` are those of the two ends if they
    differ.
    """
    return [
        Stop(
            direction=sign * direction,
            gap=0.5 * clearance,
            name=name,
            motion=None if amplitude is None else {1: sign * amplitude},
            **contact | ({} if own is None else {"restitution": own}),
        )
        for name, sign, own in zip((below, above), (-1.0, 1.0), restitutions, strict=True)
    ]
