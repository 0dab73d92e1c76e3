"""Compliant stops, as parts of a model: what they are made of, what is refused, and what of them is an axis."""

import pickle
import warnings

import numpy as np
import pytest

import vibroimpact as vi


def spring(**changes):
    given = {"direction": [0.0, 1.0], "gap": 0.1, "stiffness": 50.0, "damping": 2.0, "name": "spring"}
    return vi.Stop(**(given | changes))


def between(*stops, **changes):
    given = {"mass": np.eye(2), "stiffness": np.eye(2), "force": vi.Force(omega=2.0, harmonics={1: [1.0, 0.0]})}
    return vi.ImpactSystem(**(given | changes), stops=stops)


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
