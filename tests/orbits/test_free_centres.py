"""Orbits of masses whose centre is free: its place and its drift decide nothing."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from differences import derivative
from systems import beside_its_centre, free_masses, free_pair


def test_a_free_centre_has_multipliers_of_its_own_that_decide_nothing():
    orbit = vi.find_orbit(free_pair(), n_impacts=2)[0]
    (own, *_) = vi.find_orbit(beside_its_centre(free_pair())[0], n_impacts=2)
    assert orbit.neutral == (1.0, 1.0)
    assert orbit.stable
    assert orbit.velocities == pytest.approx([4.014863874979368] * 2, rel=1e-13)
    assert orbit.multipliers == pytest.approx(own.multipliers, rel=1e-12)
    assert orbit.lyapunov == pytest.approx(own.lyapunov, rel=1e-12)
    assert orbit.determinant == pytest.approx(0.5**4, rel=1e-13)
    after = vi.simulate(free_pair(), start=orbit.start, periods=orbit.n_periods, samples_per_period=1)
    assert after.displacement.values[-1] == pytest.approx(orbit.start.displacement, abs=1e-12)  # it does not drift


def test_a_centre_that_is_driven_away_takes_no_orbit_with_it():
    plain = vi.find_orbit(free_pair(), n_impacts=2)[0]
    pushed = free_pair(force=vi.Force(omega=1.0, harmonics={1: [2.0, 0.0]}, constant=[0.7, 0.7]))
    orbit = vi.find_orbit(pushed, n_impacts=2)[0]
    assert orbit.velocities == pytest.approx(plain.velocities, rel=1e-12)
    assert orbit.multipliers == pytest.approx(plain.multipliers, rel=1e-9)
    hits = vi.impact_section(pushed, start=orbit.start, transient_impacts=0, sample_impacts=20)
    assert hits.velocity.values == pytest.approx(orbit.velocities[0], rel=1e-9)


@pytest.mark.parametrize("drag", [[0.1, 0.1], [0.1, 0.3]])
def test_drag_leaves_the_place_of_the_centre_free_and_the_multipliers_are_those_of_differences(drag):
    """Where the drags differ the drift is felt, and its multiplier counts."""
    force = vi.Force(omega=1.0, harmonics={1: [1.0, -1.0]}, constant=[0.05, 0.02])
    model = free_pair(damping=np.diag(drag), force=force)
    orbit = vi.find_orbit(model, n_impacts=2)[0]
    place, *drifts = orbit.neutral
    assert place == 1.0
    assert drifts == (pytest.approx([math.exp(-0.1 * orbit.period)], rel=1e-12) if drag[0] == drag[1] else [])

    def carried(state, time, tenths):
        start = vi.State(state[:2].tolist(), state[2:].tolist(), time)
        end = vi.simulate(model, start=start, periods=0.1 * tenths, samples_per_period=10)
        return np.concatenate([end.displacement.values[tenths], end.velocity.values[tenths]])

    before = np.array([*orbit.start.displacement, *orbit.start.velocity])
    x, time = carried(before, orbit.start.time, 1), orbit.start.time + 0.1 * model.period
    sizes = sorted(abs(np.linalg.eigvals(derivative(lambda state: carried(state, time, 10), x, 1e-6))))
    assert sorted(map(abs, (*orbit.multipliers, *orbit.neutral))) == pytest.approx(sizes, abs=1e-6)


@pytest.mark.long
def test_free_masses_have_the_orbits_of_their_relative_motion():
    known = 0
    for seed in range(10):
        model = free_masses(seed)
        own, centres = beside_its_centre(model)
        for name in ({"n_impacts": 1}, {"n_impacts": 2}, {"n_impacts": -1}):
            found = vi.find_orbit(model, **name), vi.find_orbit(own, **name)
            orbits, others = (sorted(some, key=lambda orbit: (orbit.stops, orbit.phases)) for some in found)
            assert len(orbits) == len(others), seed
            for orbit, other in zip(orbits, others, strict=True):
                assert (orbit.name, orbit.stable, orbit.admissible) == (other.name, other.stable, other.admissible)
                assert orbit.velocities == pytest.approx(other.velocities, rel=1e-6)
                sizes = [abs(value) for value in orbit.multipliers]
                assert sizes == pytest.approx([abs(value) for value in other.multipliers], rel=1e-5, abs=1e-7)
                assert len(orbit.neutral) == 2 * centres
                known += 1
    assert known > 8


def test_orbits_with_a_free_centre_are_followed_through_the_same_bifurcations():
    branches = []
    for model in (free_pair(), beside_its_centre(free_pair())[0]):
        orbit = vi.find_orbit(model, n_impacts=2)[0]
        branches.append(vi.continue_orbit(orbit, "omega", (0.9, 1.0)))
    points, own = ([(point.kind, point.value) for point in branch.special] for branch in branches)
    assert [kind for kind, _ in points] == [kind for kind, _ in own]
    assert [value for _, value in points] == pytest.approx([value for _, value in own], rel=1e-9)
    assert points[0][0] == "pitchfork"


@pytest.mark.parametrize("gap", [0.0, 0.3])
@pytest.mark.parametrize("stop", [{"restitution": 0.6}, {"stiffness": 50.0}, {"stiffness": 50.0, "damping": 0.5}])
def test_a_free_mass_that_no_mean_load_pushes_has_no_orbit_with_impacts_on_one_stop(gap, stop):
    """Over a cycle the impulse is that of the mean load, which is zero; grazes anywhere are no impacts."""
    force = vi.Force(omega=1.7, harmonics={1: 1.6, 3: 0.3 + 0.4j})
    stops = [vi.Stop(direction=1, gap=gap, **stop)]
    model = vi.ImpactSystem(mass=1.0, stiffness=0.0, damping=0.05, force=force, stops=stops)
    for n_periods in (1, 2):
        assert not vi.find_orbit(model, n_periods=n_periods)


@pytest.mark.parametrize("n_periods", [1, 2])
def test_why_no_orbit_is_sought_where_a_gyroscope_conserves_what_a_free_centre_has(n_periods):
    model = vi.ImpactSystem(
        mass=np.eye(2),
        stiffness=[[1.0, -1.0], [-1.0, 1.0]],
        damping=[[0.0, -0.4], [0.4, 0.0]],
        force=vi.Force(omega=1.67, harmonics={1: [1.0, -2.0]}),
        stops=[vi.Stop(direction=[-1, 1], gap=0.25, stiffness=70.0)],
    )
    orbits = vi.find_orbit(model, n_periods=n_periods)
    assert not orbits
    assert "a continuum of states" in orbits.message
