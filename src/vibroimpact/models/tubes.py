"""Tubes in supports with clearance: a span of a heat exchanger's tube in water."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vibroimpact.model.force import Force
from vibroimpact.model.stops import Stop
from vibroimpact.model.system import ImpactSystem
from vibroimpact.models.arguments import checked, first_given, sharing
from vibroimpact.models.beam_modes import beam_modes, moving_row
from vibroimpact.models.meshes import ring

_SIDES = {"upper": 1.0, "lower": -1.0}  # of a support
_OF_TUBES = r"""
.. math:: E I w'''' + m' \ddot w + \mathrm{damping} = f_0 + f \sin \omega t, \qquad |w(x_i)| \le c/2, \\
          m' = \rho A + \rho_i A_i + C_m \rho_o \pi D^2/4

Parameters
----------
length : float, > 0
    L in m, from one tight baffle or tube sheet to the next.
outer_diameter, wall_thickness : float, > 0
    D and t in m; t is less than D/2.
youngs_modulus : float, > 0
    E in Pa.
density : float, > 0
    rho of the tube in kg/m^3.
inner_fluid_density, outer_fluid_density : float, >= 0
    rho_i and rho_o in kg/m^3.
added_mass_coefficient : float, >= 0
    C_m, the mass of outside fluid that moves with the tube, divided by the mass that the tube displaces: 1 for a single
    tube in still water, 1.3 to 2 in a bundle.
damping_ratio : float, >= 0
    Damping ratio of every mode, including the fluid.
force_per_length, steady_force_per_length : float
    f >= 0 and f_0 in N/m, uniform along the tube; drag or weight presses the tube to one side.
frequency : float, > 0
    Frequency of f in Hz, such as that of vortex shedding.
%(places)s
diametral_clearance : float, > 0
    c in m, diameter of the hole minus D.
restitution : float, 0 to 1
    Restitution in all supports.
%(sides)smodes : int, 1 to 12
    The number of modes.

Returns
-------
ImpactSystem
    Its coordinates are modal, in m sqrt(kg) with M = I; %(stops)s.

Raises
------
ValueError
    A number is out of range%(at_end)s.
"""
_OF_TWO = _OF_TUBES % {
    "places": """first_support_at, second_support_at : float, 0 to 1
    x_1 and x_2 divided by the length, away from the ends.""",
    "sides": """first_upper_restitution, first_lower_restitution : float, 0 to 1, optional
    Restitution at one side of the first support, if it differs.
second_upper_restitution, second_lower_restitution : float, 0 to 1, optional
    Restitution at one side of the second support, if it differs.
""",
    "stops": """the stops are `first_upper`, `first_lower` of the group
    `first`, and `second_upper`, `second_lower` of the group `second`""",
    "at_end": ", or a support is at an end",
}
_OF_MANY = _OF_TUBES % {
    "places": """supports : int, 1 to 32
    n; support i is at x_i = i L/(n + 1).""",
    "sides": "",
    "stops": """the stops are `support_1_upper`, `support_1_lower` of
    the group `support_1`, and so on""",
    "at_end": "",
}


@checked
@sharing(_OF_TWO)
def tube_in_supports(
    *,
    length: float = 1.5,
    outer_diameter: float = 0.019,
    wall_thickness: float = 1.6e-3,
    youngs_modulus: float = 2e11,
    density: float = 7900.0,
    inner_fluid_density: float = 1000.0,
    outer_fluid_density: float = 1000.0,
    added_mass_coefficient: float = 1.5,
    damping_ratio: float = 0.015,
    force_per_length: float = 3.0,
    steady_force_per_length: float = 0.0,
    frequency: float = 18.0,
    first_support_at: float = 0.35,
    second_support_at: float = 0.7,
    diametral_clearance: float = 0.8e-3,
    restitution: float = 0.6,
    first_upper_restitution: float | None = None,
    first_lower_restitution: float | None = None,
    second_upper_restitution: float | None = None,
    second_lower_restitution: float | None = None,
    modes: int = 3,
) -> ImpactSystem:
    r"""Return a heat exchanger tube, pinned at its ends, that rattles in two supports with clearance.

    Sketch: a tube from one tight baffle to the next, in water; between them two plates, each with a hole that leaves a
    clearance of half `diametral_clearance` above and below. The flow excites the tube along its whole length.

    Notes
    -----
    With restitution, results depend on `modes` and do not converge: see `cantilever_with_stop`. Left out: motion
    perpendicular to the plane with friction and sliding in the hole, forces that depend on the motion (fluid-elastic
    instability), turbulence, squeeze films.

    References
    ----------
    R. D. Blevins, Flow-Induced Vibration, 2nd edition, 1990.
    R. J. Rogers and R. J. Pick, Factors associated with support plate forces due to heat-exchanger tube vibratory
    contact, Nuclear Engineering and Design 44, 1977.
    M. J. Pettigrew and C. E. Taylor, Vibration analysis of shell-and-tube heat exchangers: an overview, part 1, Journal
    of Fluids and Structures 18, 2003.

    Examples
    --------
    >>> tube = tube_in_supports()
    >>> (tube.natural_frequencies / (2 * np.pi)).round(2).tolist()
    [15.75, 62.98, 141.72]
    >>> tube.clearances([0.0, 0.0, 0.0]).tolist()
    [0.0004, 0.0004, 0.0004, 0.0004]
    """
    return _tube("pinned-pinned", locals(), ("first", "second"))


@checked
@sharing(_OF_TWO)
def clamped_tube_in_supports(
    *,
    length: float = 1.5,
    outer_diameter: float = 0.019,
    wall_thickness: float = 1.6e-3,
    youngs_modulus: float = 2e11,
    density: float = 7900.0,
    inner_fluid_density: float = 1000.0,
    outer_fluid_density: float = 1000.0,
    added_mass_coefficient: float = 1.5,
    damping_ratio: float = 0.015,
    force_per_length: float = 10.0,
    steady_force_per_length: float = 0.0,
    frequency: float = 38.0,
    first_support_at: float = 0.35,
    second_support_at: float = 0.7,
    diametral_clearance: float = 0.8e-3,
    restitution: float = 0.6,
    first_upper_restitution: float | None = None,
    first_lower_restitution: float | None = None,
    second_upper_restitution: float | None = None,
    second_lower_restitution: float | None = None,
    modes: int = 3,
) -> ImpactSystem:
    r"""Return a tube clamped at its ends, as in two tube sheets, that rattles in two supports with clearance.

    Sketch: a tube rolled into a tube sheet at each end, in water; between them two plates, each with a hole that leaves
    a clearance of half `diametral_clearance` above and below. The flow excites the tube along its whole length.

    Notes
    -----
    As in `tube_in_supports`; the axial load of a cold or hot tube between stiff sheets is left out as well.

    References
    ----------
    R. D. Blevins, Flow-Induced Vibration, 2nd edition, 1990.

    Examples
    --------
    >>> (clamped_tube_in_supports().natural_frequencies / (2 * np.pi)).round(2).tolist()
    [35.69, 98.39, 192.89]
    """
    return _tube("clamped-clamped", locals(), ("first", "second"))


@checked
@sharing(_OF_MANY)
def tube_in_many_supports(
    *,
    length: float = 3.0,
    outer_diameter: float = 0.019,
    wall_thickness: float = 1.6e-3,
    youngs_modulus: float = 2e11,
    density: float = 7900.0,
    inner_fluid_density: float = 1000.0,
    outer_fluid_density: float = 1000.0,
    added_mass_coefficient: float = 1.5,
    damping_ratio: float = 0.015,
    force_per_length: float = 10.0,
    steady_force_per_length: float = 0.0,
    frequency: float = 16.0,
    supports: int = 4,
    diametral_clearance: float = 0.8e-3,
    restitution: float = 0.6,
    modes: int = 6,
) -> ImpactSystem:
    r"""Return a heat exchanger tube, clamped in two tube sheets, that rattles in evenly spaced supports with clearance.

    Sketch: a tube rolled into a tube sheet at each end, in water; between them plates at equal distances, each with a
    hole that leaves a clearance of half `diametral_clearance` above and below. The flow excites the tube along its
    whole length.

    Notes
    -----
    A support at a node of a mode does not see it: give more modes than supports. Left out: what `tube_in_supports`
    leaves out, and the axial load of a cold or hot tube between stiff sheets.

    References
    ----------
    R. D. Blevins, Flow-Induced Vibration, 2nd edition, 1990.

    Examples
    --------
    >>> tube = tube_in_many_supports()
    >>> len(tube.stops), sorted(set(tube.groups))
    (8, ['support_1', 'support_2', 'support_3', 'support_4'])
    """
    return _tube("clamped-clamped", locals(), [f"support_{at}" for at in range(1, int(supports) + 1)])


def _tube(ends: str, numbers: Mapping[str, Any], supports: Sequence[str]) -> ImpactSystem:
    """Return a tube with given end conditions, from the arguments that all tubes share and the names of supports.

    Supports stand where an argument puts them, or at equal distances.
    """
    length, outer, wall_thickness = numbers["length"], numbers["outer_diameter"], numbers["wall_thickness"]
    wall, gyration_squared = ring(outer, wall_thickness)
    bore, disc = (0.25 * math.pi * diameter**2 for diameter in (outer - 2.0 * wall_thickness, outer))
    rigidity = numbers["youngs_modulus"] * wall * gyration_squared
    inside = numbers["inner_fluid_density"] * bore
    outside = numbers["added_mass_coefficient"] * numbers["outer_fluid_density"] * disc
    per_length = numbers["density"] * wall + inside + outside
    shapes = beam_modes(ends, int(numbers["modes"]))
    places = {f"{name}_support_at": at / (len(supports) + 1.0) for at, name in enumerate(supports, 1)}
    rows = [moving_row(argument, numbers.get(argument, at), shapes) for argument, at in places.items()]
    return ImpactSystem.from_modes(
        frequencies=shapes.hertz(rigidity, per_length, length),
        damping_ratios=numbers["damping_ratio"],
        shapes=np.array([*rows, length * shapes.means]) / math.sqrt(per_length * length),
        points=[*supports, "span"],
        force=Force(
            frequency=numbers["frequency"],
            harmonics={1: {"span": numbers["force_per_length"]}},
            constant={"span": numbers["steady_force_per_length"]},
        ),
        stops=[
            Stop(
                direction={support: sign},
                gap=0.5 * numbers["diametral_clearance"],
                restitution=first_given(numbers.get(f"{support}_{side}_restitution"), numbers["restitution"]),
                name=f"{support}_{side}",
                group=support,
            )
            for support in supports
            for side, sign in _SIDES.items()
        ],
    )
