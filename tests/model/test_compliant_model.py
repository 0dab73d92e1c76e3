"""Compliant stops, as parts of a model: what they are made of, what is refused, and what of them is an axis."""

import pickle
import warnings

import numpy as np
import pytest

import vibroimpact as vi
from vibroimpact.contact import hunt_crossley
from vibroimpact.model.elements import BLOCKS, KINDS, NUMBERS, bars


def spring(**changes):
    arguments = {"direction": [0.0, 1.0], "gap": 0.1, "stiffness": 50.0, "damping": 2.0, "name": "spring"}
    return vi.Stop(**(arguments | changes))


def between(*stops, **changes):
    arguments = {"mass": np.eye(2), "stiffness": np.eye(2), "force": vi.Force(omega=2.0, harmonics={1: [1.0, 0.0]})}
    return vi.ImpactSystem(**(arguments | changes), stops=stops)


def test_a_stop_that_gives_has_stiffness_and_damping_where_a_rigid_one_has_restitution():
    rigid, compliant = vi.Stop(direction=1.0, gap=0.1), vi.Stop(direction=1.0, gap=0.1, stiffness=3.0)
    assert (rigid.restitution, rigid.stiffness, rigid.damping, rigid.compliant) == (0.8, None, None, False)
    assert (compliant.restitution, compliant.stiffness, compliant.damping, compliant.compliant) == (
        None,
        3.0,
        0.0,
        True,
    )


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"stiffness": 0.0}, "`stiffness` must be"),
        ({"stiffness": -1.0}, "`stiffness` must be"),
        ({"stiffness": float("inf")}, "`stiffness` must be"),
        ({"damping": -1.0}, "`damping` must be"),
        ({"stiffness": None}, "give a `stiffness`"),
        (
            {"stiffness": 0},
            "`stiffness` must be .* > 0, got 0; give .* of a compliant stop .*; leave it out for a rigid",
        ),
        ({"restitution": 0.5}, "`restitution` must be None"),
    ],
)
def test_what_is_no_stop_is_refused_in_words(changes, says):
    with pytest.raises(ValueError, match=says):
        spring(**changes)


def test_its_numbers_are_parameters_of_the_system():
    system = between(spring(), vi.Stop(direction=[1.0, 0.0], gap=0.2, restitution=0.5, name="bar"))
    wanted = {"omega": 2.0, "spring_gap": 0.1, "spring_stiffness": 50.0, "spring_damping": 2.0}
    assert system.values == wanted | {"bar_gap": 0.2, "bar_restitution": 0.5}
    assert system.parameters["spring_stiffness"].unit == "N/m"
    assert system.replace(spring_stiffness=70.0).stops[0] == spring(stiffness=70.0)
    with pytest.raises(ValueError, match="spring_restitution"):
        system.replace(spring_restitution=0.5)


def test_a_start_may_push_it_in_where_a_rigid_stop_refuses():
    pushed = vi.State(displacement=[0.0, 0.5], velocity=[0.0, 0.0])
    assert between(spring()).initial(pushed)[0].tolist() == [0.0, 0.5]
    assert between(spring(gap=-0.3)).initial()[0].tolist() == [0.0, 0.0]
    with pytest.raises(ValueError, match="beyond 'wall'"):
        between(vi.Stop(direction=[0.0, 1.0], gap=0.1, name="wall")).initial(pushed)


def test_two_springs_may_squeeze_a_mass():
    between(spring(gap=-0.1), spring(direction=[0.0, -1.0], gap=-0.1, name="other"))


def test_a_system_is_equal_to_its_copies_and_is_pickled():
    system = between(spring(motion={1: 0.01j}))
    assert pickle.loads(pickle.dumps(system)) == system
    assert system != between(spring(damping=3.0, motion={1: 0.01j}))


def test_a_contact_too_short_to_matter_is_warned_of():
    with pytest.warns(UserWarning, match=r"'spring' takes less than 1e-09 driving periods; a rigid stop"):
        between(spring(stiffness=1e22))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        between(spring(stiffness=1e10))


# What a kind of stop says of itself

STOPS = {
    "number": vi.Stop(direction=1.0, gap=0.1, restitution=0.7),
    "law": vi.Stop(direction=1.0, gap=0.1, restitution=hunt_crossley(damping=0.4)),
    "compliant": vi.Stop(direction=1.0, gap=0.1, stiffness=50.0, damping=2.0),
}


def test_every_number_of_a_kind_has_a_range_and_a_block_of_cells():
    taken = {name for kind in KINDS for name in kind.takes}
    assert {"gap"} | taken == set(NUMBERS)
    assert NUMBERS.keys() | {"law"} == BLOCKS.keys()
    for at, kind in enumerate(KINDS):
        decided = {earlier.takes[0] for earlier in KINDS[:at]}  # with one of these, a stop is of an earlier kind
        assert kind.instead.keys() == taken - decided - {*kind.takes}


def test_a_table_of_cells_tells_the_kinds_apart():
    columns = [{*element.row()} - {"law"} for element in (stop.element for stop in STOPS.values())]
    kinds = [type(stop.element) for stop in STOPS.values()]
    assert len({*kinds}) == len(KINDS) == len({*map(frozenset, columns)})


@pytest.mark.parametrize("name", STOPS)
def test_a_stop_bars_the_way_in_a_table_as_its_kind_says(name):
    stop = STOPS[name]
    system = vi.ImpactSystem(mass=1.0, stiffness=1.0, force=vi.Force(omega=2.0), stops=[stop])
    cells = system.cells({})
    assert cells.bars.tolist() == [[stop.element.impenetrable]]
    row = {"gap": stop.gap} | stop.element.row()
    assert bars({number: np.array([row.get(number, block.none)]) for number, block in BLOCKS.items()}).tolist() == [
        stop.element.impenetrable
    ]


@pytest.mark.parametrize("name", STOPS)
def test_the_sensitivity_of_a_contact_is_the_derivative_of_the_speed_that_it_leaves(name):
    element, v, step = STOPS[name].element, 1.3, 1e-5
    rebounds = [speed * element.rebound(speed) for speed in (v - step, v + step)]
    assert element.sensitivity(v) == pytest.approx((rebounds[1] - rebounds[0]) / (2.0 * step), rel=1e-8)


@pytest.mark.parametrize("name", STOPS)
def test_a_force_has_a_value_only_where_a_contact_takes_time(name):
    element = STOPS[name].element
    force = element.force(np.array([-0.1, 0.1, 0.1]), np.array([1.0, 1.0, -9.0]))
    expected = [np.nan] * 3 if element.instantaneous else [0.0, 7.0, 0.0]
    assert force.tolist() == pytest.approx(expected, nan_ok=True)
    assert element.coefficients == ((0.0, 0.0) if element.instantaneous else (50.0, 2.0))
    assert ("peak_force" in element.reports) is not element.instantaneous


def test_a_moving_stop_has_the_speed_that_is_the_rate_of_its_shift():
    stop, omega, time, step = spring(motion={1: 0.01 + 0.02j, 3: 0.005j}), 2.0, np.linspace(0.0, 3.0, 7), 1e-6
    rate = (stop.shift(omega * (time + step)) - stop.shift(omega * (time - step))) / (2.0 * step)
    assert stop.speed(omega * time, omega) == pytest.approx(rate, abs=1e-9)
    moved = between(stop).clearances([0.0, 0.0], 1.7)
    assert moved == pytest.approx([stop.gap + stop.shift(omega * 1.7)])
