"""What a model is: a value with a table of parameters, replace, at and cells, and an initial state before its stops."""

import copy
import itertools
import math
import pickle
from dataclasses import asdict, dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

import vibroimpact as vi
from systems import M, a_random_system, changed, one_mass, two_masses
from vibroimpact.cells import Cells
from vibroimpact.parameters import Parameter

pytestmark = pytest.mark.usefixtures("modal_engine")

# A model that is neither an oscillator nor a family


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


# Values

MODELS = {
    "one mass": lambda: vi.ImpactOscillator(gap=0.3),
    "two masses": two_masses,
    "a machine": vi.models.bouncing_ball,
    "a pendulum": Pendulum,
}


@pytest.mark.parametrize("name", MODELS)
def test_a_model_is_a_value(name):
    one, other = MODELS[name](), MODELS[name]()
    assert one == other
    assert hash(one) == hash(other)
    assert one != other.replace(omega=1.2 * one.omega)
    assert pickle.loads(pickle.dumps(one)) == one == copy.deepcopy(one)
    with pytest.raises(AttributeError):
        one.omega = 2.0


@pytest.mark.parametrize("name", MODELS)
def test_the_parameters_of_a_model_are_those_of_its_values_and_of_what_replaces_them(name):
    model = MODELS[name]()
    own = [parameter for parameter in model.parameters.values() if not parameter.replaces]
    assert [parameter.name for parameter in own] == list(model.values)
    assert len({parameter.symbol for parameter in model.parameters.values()}) == len(model.parameters)
    assert all(known == parameter.name for known, parameter in model.parameters.items())
    assert model.replace(omega=3.0).replace(**model.values) == model
    assert model.replace(frequency=2.0).values["omega"] == model.at(frequency=2.0).omega == 2.0 * math.pi * 2.0


def test_the_parts_of_a_system_are_values_that_cannot_be_written_into():
    one, other = two_masses(), two_masses()
    assert one != other.replace(bar_gap=0.06)
    assert one != two_masses(damping=0.0)
    assert one.force == other.force
    assert one.stops == other.stops
    for part in (one.mass, one.modal().squares, one.force.harmonics[1]):
        with pytest.raises(ValueError, match="read-only"):
            part[(0,) * part.ndim] = 1.0
    for matrix in (one.mass, one.damping, one.stiffness):
        with pytest.raises(ValueError, match="WRITEABLE"):
            matrix.setflags(write=True)


def test_an_unforced_system_needs_no_force():
    """It moves as with a force of zero, whose periods only count time, but has no period."""
    stops, modes = [vi.Stop(direction=1.0, gap=0.5)], {"frequencies": [0.1], "damping_ratios": 0.0, "shapes": [[1.0]]}
    for kept in (None, vi.Force()):
        assert vi.ImpactSystem(mass=1.0, stiffness=2.0, force=kept, stops=stops) == vi.ImpactSystem(
            mass=1.0, stiffness=2.0, stops=stops
        )
        assert vi.ImpactSystem.from_modes(**modes, force=kept) == vi.ImpactSystem.from_modes(**modes)
    for kept, length in ((None, {"duration": 4.0}), (vi.Force(omega=1.0), {"periods": 1})):
        free = vi.ImpactSystem(mass=1.0, stiffness=0.0, force=kept, stops=stops)
        assert free.periodic == ("omega" in repr(free)) == ("omega" in free.parameters) == ("periods" in length)
        hit = vi.simulate(free, start=vi.State(0.0, 0.25), **length)["impact_time"]
        assert hit.values.tolist() == pytest.approx([2.0])
    with pytest.raises(ValueError, match="no driving period"):
        vi.simulate(vi.ImpactSystem(mass=1.0, stiffness=0.0), periods=2)
    with pytest.raises(ValueError, match="`force` must have a frequency, since 'shaker' moves"):
        vi.ImpactSystem(
            mass=1.0, stiffness=0.0, stops=[vi.Stop(direction=1.0, gap=0.5, motion={1: 0.1}, name="shaker")]
        )


def test_arrays_given_are_copied():
    mass, p = np.array(M), np.array([5.0, 0.0])
    system = two_masses(mass=mass, force=vi.Force(omega=8.0, harmonics={1: p}))
    mass[0, 0], p[0] = 7.0, 7.0
    assert system.mass[0, 0] == 2.0
    assert system.force.harmonics[1][0] == 5.0


def test_repr_is_short_and_str_has_no_values():
    system = two_masses()
    assert len(repr(system)) < 120
    assert str(system) == str(system.replace(omega=3.0)) == "ImpactSystem of 2 coordinates with bar, baffle"
    assert repr(system.stops[0]) == (
        "Stop(direction=[0.0, 1.0], gap=0.05, restitution=0.7, name='bar', motion={1: 0.01})"
    )
    assert eval(repr(system.force), {"Force": vi.Force}) == system.force


def test_parameters_are_those_of_force_and_stops():
    system = two_masses()
    assert list(system.parameters) == [
        "omega", "frequency", "bar_gap", "bar_restitution", "baffle_gap", "baffle_restitution",
    ]  # fmt: skip
    assert system.values == {
        "omega": 8.0, "bar_gap": 0.05, "bar_restitution": 0.7, "baffle_gap": 0.02, "baffle_restitution": 0.8,
    }  # fmt: skip
    assert system.period == 2.0 * math.pi / 8.0
    assert system.at() is system
    there = system.at(frequency=2.0, bar_gap=0.1, baffle_restitution=0.0)
    assert there.omega == there.force.omega == there.values["omega"] == 2.0 * math.pi * 2.0
    assert there.stops[0].gap == 0.1
    assert there.stops[1].restitution == 0.0


def test_a_changed_system_has_the_modes_of_one_made_anew():
    system = two_masses()
    system.modal()
    changed_one = system.replace(omega=5.0, bar_gap=0.3, baffle_restitution=0.1)
    anew = vi.ImpactSystem(**changed_one.arguments())
    assert changed_one == anew
    for name, value in vars(anew.modal()).items():
        np.testing.assert_array_equal(getattr(changed_one.modal(), name), value)
    with pytest.raises(ValueError, match="overlap"):
        one_mass(vi.ImpactOscillator(), stops=[vi.Stop(direction=1, gap=1.0), vi.Stop(direction=-1, gap=1.0)]).replace(
            stop_1_gap=-1.5
        )


def test_designs_made_together_have_the_bits_of_each_alone():
    """Frequencies, stiffness, gaps (negative ones, too), restitutions and moving stops, each tied to another."""

    @vi.family
    def tied(omega=8.0, gap=0.05, k=100.0):
        stops = [
            vi.Stop(direction=[0, 1], gap=gap, restitution=0.5 + gap, name="bar", motion={1: 0.1 * abs(gap)}),
            vi.Stop(direction=[0.5, -1], gap=0.1 - gap, name="baffle"),
        ]
        K = [[300.0, -100.0], [-100.0, k]]
        return two_masses(stiffness=K, force=vi.Force(omega=omega, harmonics={1: [5.0, k]}), stops=stops)

    def still(gap=0.05, ratio=0.1):
        stops = [vi.Stop(direction=side, gap=gap, restitution=ratio) for side in (1.0, -0.5)]
        force = vi.Force(omega=2.0, harmonics={1: 1.0})
        return vi.ImpactSystem(mass=1.0, stiffness=1.0, damping=0.1, force=force, stops=stops)

    axes = {"omega": [7.0, 8.0, 9.0], "gap": [-0.02, 0.0, 0.05], "k": [80.0, 100.0]}
    for family, grid in ((tied, axes), (vi.family(still), {"gap": [-0.0, 0.1, 0.3], "ratio": [0.0, 0.3, 1.0]})):
        points = {name: values.ravel() for name, values in zip(grid, np.meshgrid(*grid.values()), strict=True)}
        rows = zip(*(values.tolist() for values in points.values()), strict=True)
        alone = [family.at(**dict(zip(points, row, strict=True))).cells({}).table for row in rows]
        assert family.cells(points).table.tobytes() == np.concatenate(alone).tobytes()


@pytest.mark.parametrize("numbers", [{}, {"omega": 0.3, "damping": 0.4}, {"mass": 2.0, "gap": -0.1}])
def test_one_mass_and_the_same_machine_as_a_system_answer_alike(numbers):
    osc = vi.ImpactOscillator(**numbers)
    assert osc.system.stop_names == osc.stop_names
    assert osc.system.coordinates == osc.coordinates
    assert osc.system.slowest_frequency == pytest.approx(osc.slowest_frequency, rel=1e-14)
    assert osc.system.steady_amplitude == pytest.approx(osc.steady_amplitude, rel=1e-14)


def test_the_steady_swing_of_what_is_no_single_sine_towards_one_stop_is_no_number():
    assert math.isnan(vi.models.two_sided_oscillator().steady_amplitude)
    assert math.isnan(vi.models.bouncing_ball().steady_amplitude)
    assert vi.models.bouncing_ball().slowest_frequency == vi.models.bouncing_ball().omega  # a free mass


def test_a_stop_is_where_its_motion_has_taken_it():
    stop, time = vi.Stop(direction=1.0, gap=0.5, motion={2: 0.1}), np.linspace(0.0, 3.0, 7)
    assert stop.gap + stop.shift(1.5 * time) == pytest.approx(0.5 + 0.1 * np.sin(3.0 * time), abs=1e-15)
    assert stop.speed(1.5 * time, 1.5) == pytest.approx(0.3 * np.cos(3.0 * time), abs=1e-15)


# Initial states


def test_states_of_several_coordinates_keep_them_as_tuples():
    state = vi.State(np.array([1, 2]), [0.5, 0.0], 3)
    assert state == vi.State((1.0, 2.0), (0.5, 0.0), 3.0)
    assert (state.displacement, state.velocity, state.time) == ((1.0, 2.0), (0.5, 0.0), 3.0)
    assert hash(state) == hash(vi.State([1, 2], [0.5, 0], 3))
    assert vi.State([1, 2]).velocity == (0.0, 0.0)


def test_rest_is_at_zero_or_at_the_nearest_place_before_all_stops():
    for part, expected in zip(two_masses().initial(), (np.zeros(2), np.zeros(2), 0.0), strict=True):
        np.testing.assert_array_equal(part, expected)
    for gap in (0.3, -0.3):  # as an oscillator rests at min(0, gap)
        assert one_mass(vi.ImpactOscillator(mass=3.0, gap=gap)).initial()[0].tolist() == [min(0.0, gap)]
    stops = [vi.Stop(direction=[0.0, 1.0], gap=-0.2), vi.Stop(direction=[1.0, 0.3], gap=-0.1)]
    system = two_masses(stops=stops)
    q, velocity, time = system.initial()
    assert time == 0.0 and not velocity.any()  # noqa: PT018
    assert system.clearances(q).min() > -1e-15
    rng = np.random.default_rng(1)
    others = rng.uniform(-1.0, 1.0, (20000, 2))
    others = others[(others @ np.array([stop.direction for stop in stops]).T <= [-0.2, -0.1]).all(axis=1)]
    assert q @ system.mass @ q <= np.einsum("ij,jk,ik->i", others, system.mass, others).min()


def test_rest_is_in_the_corner_of_stops_that_are_almost_parallel():
    for tilt in (1e-3, 1e-5, 3e-7):
        stops = [vi.Stop(direction=[1.0, 0.0], gap=-1.0), vi.Stop(direction=[1.0, tilt], gap=-1.0 - 0.5 * tilt**2)]
        system = two_masses(mass=np.eye(2), stops=stops)
        np.testing.assert_allclose(system.initial()[0], [-1.0, -0.5 * tilt], rtol=1e-2)


def test_rest_is_the_same_in_any_coordinates():
    rng = np.random.default_rng(2)
    for n, s in itertools.product((2, 3, 5), (1, 2, 3)):
        system = a_random_system(rng, n, s)
        system = system.replace(**{f"{name}_gap": -1.0 for name in system.stop_names}) if s <= n else system
        basis = rng.standard_normal((n, n)) + 2.0 * np.eye(n)
        there = changed(system, basis=basis)
        np.testing.assert_allclose(basis @ there.initial()[0], system.initial()[0], rtol=1e-8, atol=1e-10)


def test_rest_before_a_moving_stop_is_where_it_is_at_time_0():
    stop = vi.Stop(direction=1, gap=0.1, motion={1: -0.5j})
    system = vi.ImpactSystem(mass=2.0, stiffness=0.0, force=vi.Force(omega=2.0), stops=[stop])
    np.testing.assert_allclose(system.initial()[0], [-0.4], rtol=1e-15)
    np.testing.assert_allclose(system.clearances([0.0], math.pi / 2.0), [0.6], rtol=1e-15)


def test_an_initial_state_is_checked_against_all_stops():
    system = two_masses()
    q, velocity, time = system.initial(vi.State([0.01, 0.05], [1.0, 2.0], 2.0 * system.period))
    assert (q.tolist(), velocity.tolist(), time) == ([0.01, 0.05], [1.0, 2.0], 2.0 * system.period)  # in contact
    with pytest.raises(ValueError, match="`start` lies beyond 'bar' by 0.01 m at time 0; start in front of them"):
        system.initial(vi.State([0.0, 0.06]))
    corner = two_masses(stops=[vi.Stop(direction=way, gap=0.1) for way in ([1, 0], [0, 1])])
    with pytest.raises(ValueError, match="beyond 'stop_1' by 0.1 m and 'stop_2' by 0.2 m"):
        corner.initial(vi.State([0.2, 0.3]))
    with pytest.raises(ValueError, match="`start` must have 2 coordinates, as the mass matrix has, got 3"):
        system.initial(vi.State([0.0, 0.0, 0.0]))
    with pytest.raises(ValueError, match="`start` must be None or a State, got 0.5"):
        system.initial(0.5)
    assert one_mass(vi.ImpactOscillator(gap=1.0)).initial(vi.State(0.5, 1.0))[0].tolist() == [0.5]


def test_contact_to_rounding_is_no_penetration():
    rng = np.random.default_rng(3)
    for _ in range(200):
        system = a_random_system(rng, 4, 3)
        directions = np.array([stop.direction for stop in system.stops])
        bounds = [stop.gap + stop.shift(0.7 * system.omega) for stop in system.stops]
        q = np.linalg.lstsq(directions, bounds, rcond=None)[0]  # all three in contact
        system.initial(vi.State(q, np.zeros(4), 0.7))
