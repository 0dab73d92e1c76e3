"""Ready-made models by application: functions of engineering numbers that return a system or an oscillator.

All arguments are given by name and have defaults, so that `vibroimpact.family` makes a model of any of them, with these
numbers as its parameters. `fe_beam` and `fe_rod` build beams and rods of finite elements; they are no machines, since
they also take supports, points, stops and loads.

Examples
--------
>>> import vibroimpact as vi
>>> ball = vi.models.bouncing_ball(amplitude=0.2e-3, restitution=0.8)
>>> ball
ImpactSystem(1 coordinate, omega=314.1592653589793, table_gap=0.0, table_restitution=0.8)
"""

from vibroimpact.models.absorbers import impact_damper, tuned_mass_damper, two_unit_impact_damper
from vibroimpact.models.beams import (
    cantilever_with_stop,
    clamped_beam_with_stop,
    clamped_pinned_beam_with_stop,
    pinned_beam_with_stop,
)
from vibroimpact.models.finite_elements import fe_beam as fe_beam
from vibroimpact.models.finite_elements import fe_rod as fe_rod
from vibroimpact.models.free_masses import bouncing_ball, gear_pair, idle_gear, impact_pair
from vibroimpact.models.one_mass import (
    base_excited_oscillator,
    bilinear_oscillator,
    two_sided_oscillator,
    unbalanced_machine,
)
from vibroimpact.models.tubes import clamped_tube_in_supports, tube_in_many_supports, tube_in_supports

__all__ = [  # the machines, which the command line and the explorer list
    "base_excited_oscillator",
    "bilinear_oscillator",
    "bouncing_ball",
    "cantilever_with_stop",
    "clamped_beam_with_stop",
    "clamped_pinned_beam_with_stop",
    "clamped_tube_in_supports",
    "gear_pair",
    "idle_gear",
    "impact_damper",
    "impact_pair",
    "pinned_beam_with_stop",
    "tube_in_many_supports",
    "tube_in_supports",
    "tuned_mass_damper",
    "two_sided_oscillator",
    "two_unit_impact_damper",
    "unbalanced_machine",
]
