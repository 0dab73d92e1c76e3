"""A system of several coordinates: what it refuses, its parameters, initial states, and tables of modes."""

import copy
import itertools
import math
import pickle

import numpy as np
import pytest

import vibroimpact as vi
from systems import M, a_random_system, changed, one_mass, two_masses

pytestmark = pytest.mark.usefixtures("modal_engine")

# What is refused


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mass": [[1, 2, 3], [4, 5, 6]]}, r"`mass` must be a square array, got one of shape \(2, 3\)"),
        ({"mass": [[1, 0], [0]]}, r"`mass` must be an array of rows of numbers"),
        ({"mass": [[1, "0"], [0, 1]]}, r"`mass` must be an array of rows of numbers"),
        ({"mass": [[1, 1j], [0, 1]]}, r"`mass` must be an array of rows of numbers"),
        ({"mass": np.ones((1, 2, 2))}, r"got an array of shape \(1, 2, 2\)"),
        ({"mass": np.eye(129)}, r"`mass` must be at most 128 x 128, got an array of shape \(129, 129\)"),
        ({"mass": [[1, np.nan], [0, 1]]}, r"`mass\[0, 1\]` must be a finite number of a size up to 1e\+60, got nan"),
        ({"stiffness": [[1e61, 0], [0, 1]]}, r"`stiffness\[0, 0\]` must be a finite number of a size up to 1e\+60"),
        ({"mass": [[2, 1], [0, 1]]}, r"`mass` must be symmetric, but `mass\[0, 1\]` is 1 and `mass\[1, 0\]` is 0"),
        ({"stiffness": [[1, 1], [1.1, 9]]}, r"`stiffness` must be symmetric, but `stiffness\[0, 1\]` is 1 and"),
        ({"mass": [[1, 0], [0, 0]]}, r"`mass` must be positive definite, but `mass\[1, 1\]` is 0"),
        ({"mass": [[1, 0], [0, 1e-61]]}, r"`mass` must be positive definite, but `mass\[1, 1\]` is 1e-61"),
        ({"mass": [[1, 1], [1, 1]]}, r"`mass` must be positive definite, but v . mass v is 0 for v = \(1, -1\)"),
        ({"mass": [[1, 2], [2, 1]]}, r"`mass` must be positive definite, but v . mass v is -2 for v = \(1, -1\)"),
        (
            {"stiffness": [[1, 0], [0, -1e-9]]},
            r"`stiffness` .* positive semidefinite, but `stiffness\[1, 1\]` is -1e-09",
        ),
        ({"mass": np.eye(2), "stiffness": [[1, 2], [2, 1]]}, r"v . stiffness v is -2 for v = \(1, -1\)"),
        ({"damping": [[0, 1], [1, 0]]}, r"symmetric part of `damping` must be positive semidefinite"),
        ({"damping": 0.1}, r"`damping` must be 2 x 2, as `mass` is, got an array of shape \(\)"),
        ({"stiffness": np.eye(3)}, r"`stiffness` must be 2 x 2, as `mass` is, got an array of shape \(3, 3\)"),
        ({"force": vi.Force(omega=1.0, harmonics={2: 1.0})}, r"`harmonics\[2\]` must have 2 numbers, .*, got 1"),
        ({"force": vi.Force(omega=1.0, constant=[1, 2, 3])}, r"`constant` must have 2 numbers, .*, got 3"),
        (
            {"force": vi.Force(omega=1.0, constant={"tip": 1})},
            r"refers to points \(tip\), but the system has none; give it `points`, or 2 numbers, one per coordinate",
        ),
        ({"force": {"omega": 1.0}}, r"`force` must be a Force"),
        ({"stops": vi.Stop(direction=[0, 1], gap=0.1)}, r"`stops` must be a list of Stops"),
        ({"stops": [0.1]}, r"`stops\[0\]` must be a Stop, got 0.1"),
        ({"stops": [vi.Stop(direction=1, gap=0.1)]}, r"`stops\[0\].direction` must have 2 numbers, .*, got 1"),
        (
            {"stops": [vi.Stop(direction=[1, at], gap=1) for at in range(65)]},
            r"`stops` must have at most 64 entries, got 65",
        ),
        (
            {"stops": [vi.Stop(direction=[1, at], gap=1, name="a") for at in (0, 1)]},
            r"'a' is also the name of another stop",
        ),
        ({"stops": [vi.Stop(direction=[1, 0], gap=1, name="omega")]}, r"'omega' is also the name of a parameter"),
        (
            {"stops": [vi.Stop(direction=[1, at], gap=1, name=name) for at, name in enumerate(["a", "a_gap"])]},
            r"`stops\[1\].name` 'a_gap' is also the name of a parameter",
        ),
        (
            {"stops": [vi.Stop(direction=[1, 1], gap=0.1), vi.Stop(direction=[-2, -2], gap=-0.3)]},
            r"`stops` 'stop_1' and 'stop_2' overlap by 0.05 m",
        ),
        (
            {"stops": [vi.Stop(direction=way, gap=-1) for way in ([1, 0], [0, 1], [-1, -1])]},
            r"`stops` stop_1, stop_2, stop_3 overlap: no position is in front of all of them",
        ),
    ],
)
def test_a_system_names_the_matrix_and_the_entry_that_it_refuses(changes, message):
    with pytest.raises(ValueError, match=message) as error:
        two_masses(**changes)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"harmonics": {1: 1.0}}, r"give either `omega` \(rad/s\) or `frequency` \(Hz\)"),
        ({"omega": 1.0, "frequency": 1.0}, r"give either `omega` \(rad/s\) or `frequency` \(Hz\)"),
        ({"omega": 0.0}, r"`omega` must be a finite number > 0, got 0.0"),
        ({"frequency": -1.0}, r"`frequency` must be a finite number > 0, got -1.0"),
        ({"omega": 1.0, "harmonics": {0: [1.0]}}, r"`harmonics key` must be a whole number >= 1, got 0"),
        ({"omega": 1.0, "harmonics": {1.5: [1.0]}}, r"`harmonics key` must be a whole number >= 1, got 1.5"),
        ({"omega": 1.0, "harmonics": [1.0]}, r"`harmonics` must be a mapping from the order of a harmonic"),
        (
            {"omega": 1.0, "harmonics": {1: [1.0, complex(0, math.inf)]}},
            r"`harmonics\[1\]\[1\]` must be a finite number",
        ),
        ({"omega": 1.0, "constant": [1j]}, r"`constant` must be a list of numbers"),
        (
            {"omega": 1.0, "constant": {}},
            r"`constant` must be a list of numbers, or a mapping from names of points to numbers",
        ),
    ],
)
def test_a_force_names_what_it_refuses(arguments, message):
    with pytest.raises(ValueError, match=message):
        vi.Force(**arguments)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"direction": [0.0, 0.0]}, r"`direction` must not be zero, got \[0.0, 0.0\]"),
        ({"direction": [0.0, 1e-61], "name": "bar"}, r"`direction` of stop 'bar' must not be zero"),
        ({"direction": {"tip": 0.0}}, r"`direction` must not be zero, got \{'tip': 0.0\}"),
        ({"gap": math.nan}, r"`gap` must be a finite number, got nan"),
        ({"restitution": 1.2}, r"`restitution` must be between 0 and 1, got 1.2"),
        ({"name": "two words"}, r"`name` must be a word of letters, digits and underscores, got 'two words'"),
        ({"name": ""}, r"`name` must be a word"),
        ({"motion": {-1: 1.0}}, r"`motion key` must be a whole number >= 1, got -1"),
        ({"motion": {1: [1.0, 2.0]}}, r"`motion\[1\]` must be a number, got an array of shape \(2,\)"),
    ],
)
def test_a_stop_names_what_it_refuses(arguments, message):
    with pytest.raises(ValueError, match=message):
        vi.Stop(**{"direction": [0, 1], "gap": 0.1, **arguments})


def test_opposite_stops_that_move_together_overlap_where_their_slot_is_negative():
    slot = [vi.Stop(direction=way, gap=-0.1, motion={1: way * 5.0}) for way in (1.0, -1.0)]
    with pytest.raises(ValueError, match="overlap by 0.2 m"):
        vi.ImpactSystem(mass=1.0, stiffness=1.0, force=vi.Force(omega=1.0), stops=slot)
    apart = [stop.replace(motion={1: 5.0}) for stop in slot]
    vi.ImpactSystem(mass=1.0, stiffness=1.0, force=vi.Force(omega=1.0), stops=apart)  # room for a part of the period


def test_a_slot_without_width_is_room_enough():
    system = two_masses(stops=[vi.Stop(direction=[1, 2], gap=0.3), vi.Stop(direction=[-0.5, -1], gap=-0.15)])
    np.testing.assert_allclose(system.clearances(system.initial()[0]), 0.0, atol=1e-16)


def test_symmetry_is_asked_for_up_to_rounding():
    system = two_masses(mass=[[2.0, 0.1 * 3], [0.3, 1.0]])
    assert system.mass[0, 1] == system.mass[1, 0]


# Values


def test_a_system_is_a_value():
    one, other = two_masses(), two_masses()
    assert one == other and hash(one) == hash(other) and one != other.replace(bar_gap=0.06)  # noqa: PT018
    assert one != two_masses(damping=0.0)
    assert one.force == other.force and one.stops == other.stops  # noqa: PT018
    assert pickle.loads(pickle.dumps(one)) == one == copy.deepcopy(one)
    with pytest.raises(AttributeError):
        one.mass = 2.0
    with pytest.raises(ValueError, match="read-only"):
        one.mass[0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        one.modal().squares[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        one.force.harmonics[1][0] = 1.0


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
    assert len({parameter.symbol for parameter in system.parameters.values()}) == len(system.parameters)
    assert all(name == parameter.name for name, parameter in system.parameters.items())
    assert system.period == 2.0 * math.pi / 8.0
    assert system.at() is system
    there = system.at(frequency=2.0, bar_gap=0.1, baffle_restitution=0.0)
    assert there.omega == there.force.omega == there.values["omega"] == 2.0 * math.pi * 2.0
    assert there.stops[0].gap == 0.1
    assert there.stops[1].restitution == 0.0
    assert there.replace(**system.values) == system


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


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"bar": 1.0}, "unknown parameter 'bar'; choose from omega, frequency, bar_gap, .*did you mean 'bar_gap'"),
        ({"mass": 1.0}, "unknown parameter 'mass'"),
        ({"bar_restitution": 2.0}, "`bar_restitution` must be between 0 and 1, got 2.0"),
        ({"omega": None}, "`omega` must be a finite number > 0, got None"),
        ({"omega": 1.0, "frequency": 1.0}, "give either `omega` or `frequency`, not both"),
    ],
)
def test_replace_refuses_what_is_no_parameter_or_out_of_range(changes, message):
    with pytest.raises(ValueError, match=message):
        two_masses().replace(**changes)


# Initial conditions


def test_states_of_several_coordinates_keep_them_as_tuples():
    state = vi.State(np.array([1, 2]), [0.5, 0.0], 3)
    assert state == vi.State((1.0, 2.0), (0.5, 0.0), 3.0)
    assert (state.displacement, state.velocity, state.time) == ((1.0, 2.0), (0.5, 0.0), 3.0)
    assert hash(state) == hash(vi.State([1, 2], [0.5, 0], 3))
    assert vi.State([1, 2]).velocity == (0.0, 0.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([],), "`displacement` must be a number, or one number per coordinate"),
        (([1.0, "2"],), r"`displacement\[1\]` must be a finite number, got '2'"),
        (([1.0, math.nan],), r"`displacement\[1\]` must be a finite number, got nan"),
        (([1.0, 2.0], [1.0]), "the same length, got 2 and 1"),
        (([1.0, 2.0], 1.0), "the same length, got 2 and a single number"),
        ((1.0, [1.0]), "the same length, got a single number and 1"),
    ],
)
def test_states_refuse_numbers_that_do_not_fit(arguments, message):
    with pytest.raises(ValueError, match=message):
        vi.State(*arguments)


@pytest.mark.parametrize(
    "call",
    [
        lambda osc, several: vi.simulate(osc, periods=1, start=several),
        lambda osc, several: vi.parameter_map(osc, gap=[0.0], start=[several, several]),
        lambda osc, several: vi.attractors(osc, starts=[several]),
        lambda osc, several: vi.find_orbit(osc, near=several),
        lambda osc, several: vi.impact_map(osc) and vi.impact_section(osc, start=several),
    ],
)
def test_one_mass_refuses_a_state_of_several_coordinates(call):
    refusal = r"`(start|starts|near)` must (be .*got State\(displacement=\(0.0, 0.0\)|have 1 coordinate, .*got 2)"
    with pytest.raises(ValueError, match=refusal):
        call(vi.ImpactOscillator(), vi.State([0.0, 0.0]))


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
        q = np.linalg.lstsq(system._directions, system._bounds(0.7), rcond=None)[0]  # all three in contact
        system.initial(vi.State(q, np.zeros(4), 0.7))


# A table of modes


def test_a_system_of_modes_is_that_of_its_matrices():
    rng = np.random.default_rng(11)
    n = 4
    half, other = rng.standard_normal((2, n, n))
    mass, stiffness = half @ half.T + np.eye(n), other @ other.T
    force = vi.Force(frequency=0.3, harmonics={1: [0.0, 2.0, 0.0, 0.0]}, constant=[0.0, 0.0, 0.0, -1.0])
    stops = [vi.Stop(direction=[1.0, 0.0, -1.0, 0.0], gap=0.1), vi.Stop(direction=[0, 0, 0, 2.0], gap=0.2)]
    damping = 0.05 * mass + 0.01 * stiffness
    physical = vi.ImpactSystem(mass=mass, damping=damping, stiffness=stiffness, force=force, stops=stops)
    form = physical.modal()
    rates = np.sqrt(form.squares)
    table = {
        "frequencies": rates / (2.0 * math.pi),
        "damping_ratios": np.diag(form.damping) / (2.0 * rates),
        "shapes": form.shapes / np.sqrt(form.masses),
    }
    by_rows = vi.ImpactSystem.from_modes(**table, force=force, stops=stops)
    by_name = vi.ImpactSystem.from_modes(
        **table,
        points=["foot", "knee", "hip", "tip"],
        force=vi.Force(frequency=0.3, harmonics={1: {"knee": 2.0}}, constant={"tip": -1.0}),
        stops=[vi.Stop(direction={"hip": -1.0, "foot": 1.0}, gap=0.1), vi.Stop(direction={"tip": 2.0}, gap=0.2)],
    )
    assert by_rows == by_name
    modal = by_rows.modal()
    assert modal.decoupled
    np.testing.assert_allclose(modal.squares, form.squares, rtol=1e-14)
    np.testing.assert_allclose(modal.damping, form.damping, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(modal.mobility, form.mobility, rtol=1e-11)
    np.testing.assert_allclose(modal.directions @ modal.constant, form.directions @ form.constant, rtol=1e-11)
    np.testing.assert_allclose(modal.directions @ modal.forces[0], form.directions @ form.forces[0], rtol=1e-11)
    assert by_rows.velocity_scale == pytest.approx(physical.velocity_scale, rel=1e-10)


def test_a_mode_at_0_hz_is_a_free_mass():
    system = vi.ImpactSystem.from_modes(
        [0.0, 10.0], 0.01, [[1.0, 1.0]], force=vi.Force(omega=1.0), stops=[vi.Stop(direction=1, gap=0.1)]
    )
    assert system.modal().squares.tolist() == [0.0, (20.0 * math.pi) ** 2]
    assert system.stops[0].direction.tolist() == [1.0, 1.0]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"frequencies": [1.0]}, r"equal lengths, one per mode, got 1, 2 and 2"),
        ({"damping_ratios": [0.1] * 3}, r"equal lengths, one per mode, got 2, 3 and 2"),
        ({"frequencies": [1.0, -2.0]}, r"`frequencies` must be numbers >= 0, got \[1.0, -2.0\]"),
        ({"damping_ratios": -0.1}, r"`damping_ratios` must be numbers >= 0"),
        ({"points": ["tip"]}, r"`points` must be 2 different names, one per row of `shapes`, got \['tip'\]"),
        ({"points": ["tip", "tip"]}, r"`points` must be 2 different names"),
        ({"shapes": [1.0, 2.0]}, r"`shapes` must be an array of rows of numbers, got an array of shape \(2,\)"),
        ({"force": vi.Force(omega=1.0, constant={"tup": 1.0})}, r"unknown point 'tup'; .*; did you mean 'tip'\?"),
        ({"force": vi.Force(omega=1.0, constant=[1.0])}, r"`constant` must have 2 numbers, one per point, got 1"),
        ({"stops": [vi.Stop(direction={"tap": 1.0}, gap=1.0)]}, r"unknown point 'tap'"),
    ],
)
def test_a_table_of_modes_names_what_it_refuses(changes, message):
    arguments = {
        "frequencies": [1.0, 2.0],
        "damping_ratios": [0.1, 0.1],
        "shapes": [[1.0, 0.5], [2.0, -1.0]],
        "points": ["mid", "tip"],
        "force": vi.Force(omega=1.0),
    }
    with pytest.raises(ValueError, match=message):
        vi.ImpactSystem.from_modes(**arguments | changes)


# Families of systems: what designs share is computed once


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


def test_a_design_that_is_refused_is_named():
    oscillator = vi.family(vi.models.two_sided_oscillator)
    with pytest.raises(ValueError, match=r"fails at .*left_gap=-1, .*overlap"):
        oscillator.cells({"left_gap": np.array([0.1, -1.0]), "right_gap": np.array([0.1, 0.1])})


def test_matrices_that_systems_share_cannot_be_written_into():
    system = two_masses()
    for matrix in (system.mass, system.damping, system.stiffness):
        with pytest.raises(ValueError, match="WRITEABLE"):
            matrix.setflags(write=True)


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
