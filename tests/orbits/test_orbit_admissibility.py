"""Orbits that penetrate a stop are told as such, and where none is isolated, or none exists, the reason is given."""

import math
import re

import numpy as np
import pytest

import vibroimpact as vi
from plain import witnessed
from systems import a_random_system, facing, two_sided, uncoupled

SEAT = vi.Stop(direction=[1, 0], gap=0.0, restitution=0.8)

# Admissibility


@pytest.mark.parametrize(("omega", "n"), [(0.9, 1), (3.0, 2)])
def test_an_orbit_that_hits_too_early_is_inadmissible_and_says_where(form, omega, n):
    osc = vi.ImpactOscillator(omega=omega)
    orbits = vi.find_orbit(form(osc), n_periods=n)
    assert orbits.outcome == "inadmissible"
    (orbit,) = orbits
    assert not orbit.admissible
    too_early = "first hits the stop" if form(osc) is osc else "would penetrate 'stop', by .* m"
    assert re.search(f"{too_early} at phase 0", orbit.message)


def test_orbits_are_admissible_where_the_witness_moves_along_them():
    rng, agreed = np.random.default_rng(9), []
    for _ in range(20):
        system = a_random_system(rng, int(rng.integers(1, 4)))
        wide = [stop.replace(gap=stop.gap + 2.0 * rng.uniform()) for stop in system.stops]
        system = vi.ImpactSystem(**system.arguments() | {"stops": wide})
        for orbit in vi.find_orbit(system):
            try:
                impacts = witnessed(system, orbit.start, 2)
            except ValueError:  # the start lies beyond the other stop
                assert "penetrate" in orbit.message
                continue
            same = [hit.velocity for hit in impacts] == pytest.approx([*orbit.velocities] * 2, rel=1e-7)
            assert orbit.admissible == same, orbit.message
            agreed.append(same)
    assert 4 < sum(agreed) < len(agreed) - 4


def test_a_fast_mode_that_dips_between_slow_samples_is_seen():
    """The stop sees a mode of 400 times the frequency that decays as the flight begins: it hits again at once."""

    def beam(share):
        return uncoupled([0.05, 2.0], [1.0, 800.0**2], [SEAT.replace(direction=[1.0, share])])

    (alone,), (joined,) = vi.find_orbit(beam(1e-9)), vi.find_orbit(beam(1.0))
    assert alone.admissible
    assert not joined.admissible
    assert "after impact 1 it would penetrate 'stop_1'" in joined.message


@pytest.mark.usefixtures("modal_engine")
@pytest.mark.parametrize("restitution", [1e-6, 1e-4, 3e-3])
def test_a_second_touch_right_after_a_weak_rebound_is_seen(restitution):
    """Shortly before the force pulls the mass away, it presses it back; the mass leaves for good within one sample."""
    seen = []
    for omega in np.linspace(1.2, 2.2, 200):
        osc = vi.ImpactOscillator(omega=omega, gap=0.3, damping=0.5, restitution=restitution)
        for orbit, same in zip(vi.find_orbit(osc), vi.find_orbit(osc.system), strict=True):
            hits = vi.impact_section(osc, start=orbit.start, transient_impacts=0, sample_impacts=2)["velocity"].values
            moves = len(hits) == 2 and math.isclose(hits[1], orbit.velocities[0], rel_tol=1e-6)
            assert (orbit.admissible, same.admissible) == (moves, moves), (omega, orbit.message, same.message)
            seen.append(moves)
    assert 5 < sum(seen) < len(seen) - 5


def test_stops_that_are_struck_together_are_no_single_impact():
    both = [vi.Stop(direction=1, gap=0.1, restitution=0.6), vi.Stop(direction=2, gap=0.2, restitution=0.6)]
    orbits = vi.find_orbit(two_sided(stops=both), stops="stop_1")
    assert orbits.outcome == "inadmissible"
    assert "would strike 'stop_2' at the same time" in orbits.message


def test_a_beam_can_move_along_the_orbit_that_it_settles_to_although_rounding_leaves_its_clearance_below_zero():
    beam = vi.models.cantilever_with_stop()
    (orbit,) = (one for one in vi.find_orbit(beam, n_impacts=3) if one.stable)
    hits = vi.impact_section(beam, transient_impacts=2000, sample_impacts=3)
    assert sorted(orbit.velocities) == pytest.approx(sorted(hits["velocity"].values), rel=1e-9)
    assert orbit.admissible, orbit.message


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


# Where orbits are not isolated, or none exists


@pytest.mark.parametrize(
    ("changes", "n", "why", "why_of_system"),
    [
        ({"damping": 0.0, "omega": 0.5}, 1, "whole number of free periods", "whole number of periods of an undamped"),
        (
            {"damping": 0.0, "omega": 2.0},
            2,
            "2 driving periods are a whole number of free periods",
            "over 2 driving periods, which are a whole number",
        ),
        ({"damping": 0.0, "restitution": 1.0}, 1, "grow without bound", "grow without bound"),
        ({"amplitude": 0.0, "gap": -1.0}, 1, "unforced", "unforced"),
        ({"amplitude": 0.0, "damping": 0.0, "restitution": 1.0, "gap": -1.0}, 1, "without loss", "without loss"),
        ({"amplitude": 0.0, "damping": 0.0, "restitution": 1.0, "omega": 2.0}, 1, "without loss", "without loss"),
        ({"gap": 5.0}, 1, "beyond the steady amplitude", "no velocity > 0 returns to itself after 1 driving period"),
    ],
)
def test_where_one_mass_has_no_isolated_orbit_the_reason_is_given(form, changes, n, why, why_of_system):
    osc = vi.ImpactOscillator(**changes)
    check_none(form(osc), n, why if form(osc) is osc else why_of_system)


def check_none(model, n, why):
    orbits = vi.find_orbit(model, n_periods=n)
    assert (list(orbits), orbits.outcome) == ([], "none")
    assert why in orbits.message


@pytest.mark.parametrize("stop", [{"restitution": 0.8}, {"stiffness": 100.0, "damping": 1.0}], ids=["rigid", "springy"])
def test_unforced_and_free_systems_say_why_nothing_repeats(stop):
    stops, unforced = [vi.Stop(direction=[1, -1], gap=1.0, **stop)], vi.Force(omega=1.0)
    check_none(vi.ImpactSystem(mass=np.eye(2), stiffness=np.zeros((2, 2)), force=unforced, stops=stops), 1, "unforced")
    check_none(two_sided(force=vi.Force(omega=2.0)), 1, "nothing supplies it")
    far = vi.Stop(direction=[0, 1], gap=9.0)  # feels where the second mass is, the other stop does not
    for constant, words in (
        (None, "free mass or rigid-body motion, which does not change the clearance of the stop, can be anywhere"),
        ([0.0, 0.1], "driven away by the load"),
    ):
        seat = vi.Stop(direction=[1, 0], gap=0.0, **stop)
        driven = uncoupled([0.1, 0.0], [1.0, 0.0], [seat, far], constant=constant)
        check_none(driven, 1, words)
        assert ("not isolated" if constant is None else words) in vi.find_orbit(driven, stops="stop_1").message


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


def test_an_undamped_mode_that_the_stop_does_not_see_is_named():
    def beside(stiffness):
        return uncoupled([0.1, 0.0], [1.0, stiffness], [SEAT], [1.0, 1.0])

    assert "the force drives it without bound" in vi.find_orbit(beside(4.0)).message
    assert "orbits are not isolated" in vi.find_orbit(beside(16.0)).message
    assert len(vi.find_orbit(beside(4.0 + 1e-6))) == 1
    assert len(vi.find_orbit(beside(16.0), n_periods=1)) == 0
    assert len(vi.find_orbit(beside(1.0), n_periods=1)) == 1


# Symmetry


def test_what_makes_a_system_symmetric():
    upper, lower = facing([1.0], 0.5, 0.6)
    spring = vi.Stop(direction=1, gap=0.1, stiffness=30.0)
    for stops, symmetric in (
        ([upper, lower], True),
        ([lower, upper], True),
        ([upper, vi.Stop(direction=-3, gap=1.5, restitution=0.6)], True),
        ([upper, vi.Stop(direction=-3, gap=1.4, restitution=0.6)], False),
        ([upper, vi.Stop(direction=-1, gap=0.5, restitution=0.61)], False),
        ([upper.replace(motion={1: 0.1j}), lower.replace(motion={1: -0.1j})], True),
        ([upper.replace(motion={2: 0.1j}), lower.replace(motion={2: 0.1j})], True),
        ([upper.replace(motion={1: 0.1j}), lower.replace(motion={1: 0.1j})], False),
        ([upper.replace(motion={2: 0.1j}), lower], False),
        ([spring, spring.replace(direction=-1)], True),
        ([spring, spring.replace(direction=-2, gap=0.2, stiffness=7.5)], True),
        ([spring, spring.replace(direction=-1, stiffness=31.0)], False),
        ([upper], False),
    ):
        orbits = vi.find_orbit(two_sided(3.0, stops=stops), symmetric=True)
        assert orbits.message.startswith("not symmetric: ") != symmetric
        assert all(len({*orbit.stops}) == 2 for orbit in orbits)
        assert bool(orbits) == symmetric
    for force, why in (({"harmonics": {4: 1.0}}, "even harmonic 4"), ({"constant": 1.0}, "constant")):
        assert why in vi.find_orbit(two_sided(force=vi.Force(omega=2.0, **force)), symmetric=True).message
    orbits = vi.find_orbit(two_sided(stops=[upper]), symmetric=True)
    assert (orbits.outcome, orbits.message) == ("none", "not symmetric: no stop is the mirror image of 'above'")
