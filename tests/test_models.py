"""A model that is neither an oscillator nor a family is known by its table, values, replace, at and cells alone."""

import math
from dataclasses import asdict, dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

import vibroimpact as vi
from vibroimpact.cells import Cells
from vibroimpact.parameters import Parameter

OWN = (
    Parameter("length", "length of the rod", "m", "l", 0.0, closed=False),
    Parameter("wall_angle", "angle of the wall", "rad", "a"),
    Parameter("omega", "angular driving frequency", "rad/s", "w", 0.0, closed=False),
    Parameter("frequency", "driving frequency", "Hz", "w/2pi", 0.0, closed=False, replaces="omega"),
)


@dataclass(frozen=True)
class Pendulum:
    """A bob of 1 kg that meets a wall, for small angles: k = m g/l, and a gap of l times the angle."""

    parameters: ClassVar = {parameter.name: parameter for parameter in OWN}

    length: float = 9.81
    wall_angle: float = 0.0
    omega: float = 2.0

    def __str__(self):
        return "pendulum"

    @property
    def values(self):
        return asdict(self)

    @property
    def frequency(self):
        return self.omega / (2.0 * math.pi)

    @staticmethod
    def _own(values):
        arguments = dict(values)
        if "frequency" in arguments:
            arguments["omega"] = 2.0 * math.pi * arguments.pop("frequency")
        return arguments

    @staticmethod
    def _numbers(length, wall_angle, omega):
        usual = {"mass": 1.0, "damping": 0.01, "stiffness": 9.81 / length, "amplitude": 1.0, "omega": omega}
        return {**usual, "restitution": 0.8, "gap": length * wall_angle}

    def replace(self, **changes):
        return replace(self, **self._own(changes))

    def at(self, **values):
        return vi.ImpactOscillator(**self._numbers(**self.replace(**values).values))

    def cells(self, points, start=None):
        return Cells.at_rest(self._numbers(**(self.values | self._own(points)))).begun(start)


def test_a_map_of_a_model_is_that_of_the_oscillators_it_makes():
    lengths, angles = np.array([5.0, 9.81, 15.0]), np.array([-0.01, 0.02])
    sweep = vi.parameter_map(Pendulum(), length=lengths, wall_angle=angles, sample_impacts=200)
    for at in np.ndindex(3, 2):
        osc = Pendulum(lengths[at[0]], angles[at[1]]).at()
        (alone,) = vi.parameter_map(osc, omega=[2.0], sample_impacts=200)["std"].values
        assert sweep["std"].values[at] == alone


@pytest.mark.parametrize("name", ["length", "frequency"])
def test_orbits_and_verdicts_of_a_model_vary_its_own_parameters(name):
    model = Pendulum()
    value = getattr(model, name)
    (orbit,) = vi.find_orbit(model)
    branch = vi.continue_orbit(orbit, name, (0.9 * value, 1.1 * value))
    assert branch.dataset[name].min() < value < branch.dataset[name].max()
    below, above = vi.describe(model, parameters=[name]).boundaries
    assert (below.parameter, above.parameter) == (name, name)
    assert not below.found or below.value < value


def test_a_stored_map_of_a_model_is_named_without_its_values(tmp_path):
    for base in (5.0, 9.81):  # the axis replaces it: the same study
        sweep = vi.parameter_map(Pendulum(base), length=[4.0, 5.0], sample_impacts=50, store=tmp_path / "map.zarr")
    assert "pendulum" in sweep.attrs["model"]
