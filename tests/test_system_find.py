"""Orbits of systems by the name of their cycle."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from differences import derivative
from systems import beside_its_centre, free_masses, free_pair, on_springs, two_sided, uncoupled


def test_the_motion_from_rest_gives_the_orbit_that_it_settles_to():
    system = two_sided().replace(below_gap=0.3)
    orbit = vi.find_orbit(system, n_impacts=2)[0]
    hits = vi.impact_section(system, transient_impacts=2000, sample_impacts=2)
    assert orbit.stable
    assert sorted(orbit.velocities) == pytest.approx(sorted(hits.velocity.values), rel=1e-12)
    assert set(orbit.stops) == {"above", "below"}


def test_an_orbit_of_another_system_is_a_guess():
    orbit = vi.find_orbit(two_sided().replace(below_gap=0.3), n_impacts=2)[0]
    near = vi.find_orbit(two_sided().replace(below_gap=0.31), n_impacts=2, near=orbit)
    assert [found.stable for found in near] == [True]
    assert near[0].velocities == pytest.approx(orbit.velocities, rel=0.1)
    assert near[0].velocities != orbit.velocities


def test_an_attractor_and_any_state_on_it_are_guesses():
    system = two_sided().replace(below_gap=0.3)
    settled = next(found for found in vi.attractors(system) if found.kind == "periodic")
    name = {"n_periods": settled.n_periods, "n_impacts": settled.n_impacts}
    (orbit,) = vi.find_orbit(system, near=settled, **name)
    assert orbit.stable
    assert sorted(orbit.velocities) == pytest.approx(sorted(settled.velocities), rel=1e-9)
    displacement, velocity, _ = orbit.motion([0.4])
    (again,) = vi.find_orbit(system, near=vi.State(displacement[0], velocity[0], 0.4), **name)
    assert sorted(again.velocities) == pytest.approx(sorted(orbit.velocities), rel=1e-9)


def test_of_one_contact_the_orbit_near_a_guess_is_reached():
    stops = [vi.Stop(direction=1, gap=0.785, stiffness=10.298, name="stop")]
    force = vi.Force(omega=1.33, harmonics={1: 0.05})
    system = vi.ImpactSystem(mass=1.0, damping=0.02, stiffness=1.0, force=force, stops=stops)
    both = vi.find_orbit(system)
    for orbit in both:
        assert [near.velocities for near in vi.find_orbit(system, stops=orbit.stops, near=orbit)] == [
            pytest.approx(orbit.velocities, rel=1e-9)
        ]
        assert len(vi.find_orbit(system, near=orbit)) == len(both)


def test_unforced_and_free_systems_say_why_nothing_repeats():
    far = vi.Stop(direction=[0, 1], gap=9.0)  # feels where the second mass is, the other stop does not
    for stop in ({"restitution": 0.8}, {"stiffness": 100.0, "damping": 1.0}):
        stops, unforced = [vi.Stop(direction=[1, -1], gap=1.0, **stop)], vi.Force(omega=1.0)
        free = vi.ImpactSystem(mass=np.eye(2), stiffness=np.zeros((2, 2)), force=unforced, stops=stops)
        assert "nothing supplies it" in vi.find_orbit(free).message
        for constant, words in ((None, "not isolated"), ([0.0, 0.1], "driven away by the load")):
            seat = vi.Stop(direction=[1, 0], gap=0.0, **stop)
            driven = uncoupled([0.1, 0.0], [1.0, 0.0], [seat, far], constant=constant)
            assert words in vi.find_orbit(driven, stops="stop_1").message


def a_degenerate_system(rng):
    """Return a system of one to three coordinates: free, unforced, with equal modes or undamped."""
    n = int(rng.integers(1, 4))
    mass, stiffness = np.diag(rng.choice([1.0, 2.0], n)), np.diag(rng.choice([0.0, 1.0], n))
    pair = np.eye(n)[0] - np.eye(n)[-1] if n > 1 else np.ones(1)
    stiffness = stiffness + rng.integers(2) * np.outer(pair, pair)
    loads = [{}, {1: np.zeros(n)}, {2: np.ones(n)}, {1: rng.standard_normal(n), 3: np.ones(n)}]
    force = vi.Force(omega=rng.choice([0.7, 1.0]), harmonics=loads[rng.integers(4)])
    kinds = [{"restitution": 0.0}, {"restitution": 1.0}, {"stiffness": 1.0}, {"stiffness": 100.0, "damping": 1.0}]
    stop = vi.Stop(
        direction=[pair, np.eye(n)[0]][rng.integers(2)], gap=rng.choice([0.0, 1.0]), **kinds[rng.integers(4)]
    )
    return vi.ImpactSystem(
        mass=mass, damping=rng.choice([0.0, 0.1]) * stiffness, stiffness=stiffness, force=force, stops=[stop]
    )


def test_of_degenerate_systems_orbits_are_found_or_it_is_said_why_not():
    rng = np.random.default_rng(7)
    for _ in range(25):
        orbits = vi.find_orbit(a_degenerate_system(rng), n_periods=int(rng.integers(1, 3)))
        assert orbits.message
        assert orbits or orbits.outcome == "none"


def test_orbits_that_are_not_there_are_not_found():
    orbits = vi.find_orbit(two_sided(), n_impacts=4)
    assert not orbits
    assert "the motion from rest does not settle to a period-1 impact-4 orbit within 32768 impacts" in orbits.message


def test_an_orbit_that_is_reached_after_a_long_transient_is_found():
    stop = vi.Stop(direction=1, gap=0.1520699669575002, restitution=0.8122562355431232)
    force = vi.Force(omega=2.7116540730750396, harmonics={1: 1})
    slow = vi.ImpactSystem(mass=1, damping=0.04840109500397925, stiffness=1, force=force, stops=[stop])
    early = vi.impact_section(slow, transient_impacts=2000, sample_impacts=6)
    assert abs(float(early["velocity"][5] - early["velocity"][0])) > 1e-4
    (orbit,) = vi.find_orbit(slow, n_periods=4, n_impacts=5)
    late = vi.impact_section(slow, transient_impacts=20_000, sample_impacts=5)
    assert orbit.stable
    assert sorted(orbit.velocities) == pytest.approx(sorted(late["velocity"].values), rel=1e-9)


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"n_impacts": 2, "near": (0.1, 2.0)}, "an orbit or an attractor of a system"),
        ({"n_impacts": 0}, "n_impacts"),
        ({"n_impacts": 2, "stops": ["above", "below"]}, "omitted if `stops` or `symmetric` is given"),
        ({"n_impacts": 2, "near": vi.State((0.1, 0.2), (0.0, 0.0))}, "coordinate"),
    ],
)
def test_what_cannot_be_searched_for_is_refused(how, words):
    with pytest.raises(ValueError, match=words):
        vi.find_orbit(two_sided(), **how)


def test_the_stops_of_one_mass_are_those_of_a_system_of_one_stop():
    one = vi.ImpactOscillator(omega=0.9)
    assert vi.find_orbit(one, stops=["stop", "stop"]) == vi.find_orbit(one, n_impacts=2)
    assert vi.find_orbit(one, symmetric=True).outcome == vi.find_orbit(one.system, symmetric=True).outcome == "none"


def test_orbits_of_one_mass_and_of_its_system_answer_the_same_questions():
    one = vi.ImpactOscillator(omega=0.9)
    (orbit,), (other,) = vi.find_orbit(one, n_impacts=2), vi.find_orbit(one.system, n_impacts=2)
    assert isinstance(other, vi.Orbit)
    assert (orbit.name, orbit.stops, orbit.stable, orbit.symmetric) == (
        other.name,
        other.stops,
        other.stable,
        other.symmetric,
    )
    assert orbit.spectral_radius == pytest.approx(other.spectral_radius, rel=1e-12)
    times = np.linspace(0.0, 2.0 * orbit.period, 50)
    for ours, theirs in zip(orbit.motion(times), other.motion(times), strict=True):
        assert ours == pytest.approx(theirs, abs=1e-10)
    (orbit,), (other,) = (vi.find_orbit(model.replace(omega=0.1), n_impacts=-1) for model in (one, one.system))
    rest = [(each.stick_phase, each.release_phase, each.stuck_time) for each in (orbit, other)]
    assert rest[0] == pytest.approx(rest[1], rel=1e-6)
    for ours, theirs in zip(orbit.motion(times), other.motion(times), strict=True):
        assert ours == pytest.approx(theirs, abs=1e-9)


def test_one_mass_and_its_system_take_the_orbits_and_attractors_of_the_other_as_guesses():
    one = vi.ImpactOscillator(omega=0.9)
    for p in (2, -1):
        model = one if p > 0 else one.replace(omega=0.1)
        guesses = [*vi.find_orbit(model, n_impacts=p), *vi.find_orbit(model.system, n_impacts=p)]
        assert len(guesses) == 2
        for near in (*guesses, vi.attractors(model)[0] if p > 0 else guesses[0]):
            for machine in (model, model.system):
                (found,) = vi.find_orbit(machine, n_impacts=p, near=near)
                assert sorted(found.velocities)[-1] == pytest.approx(sorted(near.velocities)[-1], rel=1e-9)


def test_a_family_of_systems_has_the_orbits_of_its_values():
    @vi.family
    def slot(width=1.0):
        return two_sided(gap=width / 2)

    assert vi.find_orbit(slot, n_impacts=2)[0].velocities == vi.find_orbit(two_sided(), n_impacts=2)[0].velocities


def test_a_beam_can_move_along_the_orbit_that_it_settles_to_although_rounding_leaves_its_clearance_below_zero():
    beam = vi.models.cantilever_with_stop()
    (orbit,) = (one for one in vi.find_orbit(beam, n_impacts=3) if one.stable)
    hits = vi.impact_section(beam, transient_impacts=2000, sample_impacts=3)
    assert sorted(orbit.velocities) == pytest.approx(sorted(hits["velocity"].values), rel=1e-9)
    assert orbit.admissible, orbit.message


# Masses whose centre is free


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


def test_a_stable_orbit_of_a_system_is_a_motion_that_it_stays_on_and_an_inadmissible_one_is_never_stable():
    kept = penetrating = 0
    rng = np.random.default_rng(5)
    for system in (on_springs(rng) for _ in range(60)):
        for stop in system.stop_names:
            orbits = vi.find_orbit(system, stops=stop)
            penetrating += sum(orbit.spectral_radius < 1.0 and not orbit.admissible for orbit in orbits)
            assert [orbit.admissible for orbit in orbits] == sorted((o.admissible for o in orbits), reverse=True)
            for orbit in orbits:
                if not orbit.stable or orbit.spectral_radius > 0.97 or max(orbit.velocities) < 1e-3:
                    continue
                kept += 1
                start = vi.State(*(part[0] for part in orbit.motion([0.0])[:2]), 0.0)
                later = vi.impact_section(system, start=start, transient_impacts=300, sample_impacts=1)
                assert later["velocity"].values == pytest.approx(orbit.velocities, rel=1e-6), system
    assert kept > 5
    assert penetrating > 2


def test_of_several_impacts_only_admissible_orbits_are_listed_unless_a_guess_is_given():
    """Symmetric orbits of two impacts are known in closed form, also those that penetrate a stop in between."""
    tube = vi.models.tube_in_supports()
    assert len(vi.find_orbit(tube, symmetric=True)) == 2
    found = vi.find_orbit(tube, n_impacts=2)
    assert (list(found), found.outcome) == ([], "none")
    assert found.message.startswith("2 symmetric orbits found, but inadmissible; the motion from rest")
    some = 0
    for seed in range(12):
        rng = np.random.default_rng([77, seed])
        system = two_sided(rng.uniform(0.6, 3.0), gap=rng.uniform(0.05, 1.5))
        orbits = vi.find_orbit(system, n_impacts=2)
        assert all(orbit.admissible for orbit in orbits)
        some += len(orbits)
    assert some > 3


@pytest.mark.parametrize("late", [3000, 50_000])
def test_the_times_of_a_guess_may_be_late(late):
    system = two_sided().replace(below_gap=0.3)
    orbit = vi.find_orbit(system, n_impacts=2)[0]
    times = (np.array(orbit.turns) + late) * system.period
    (again,) = vi.find_orbit(system, stops=orbit.stops, near=times)
    assert again.turns[0] < 1.0
    for name in ("phases", "velocities"):
        assert getattr(again, name) == pytest.approx(getattr(orbit, name), rel=1e-13)
