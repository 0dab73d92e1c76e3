"""Rest and other initial states: before all stops, in any coordinates, and in contact up to rounding."""

import itertools
import math

import numpy as np
import pytest

import vibroimpact as vi
from systems import a_random_system, changed, one_mass, two_masses


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
