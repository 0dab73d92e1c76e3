"""Orbits are motions that the engine repeats, and their multipliers are what becomes of neighbouring motions."""

import math
from itertools import product

import numpy as np
import pytest

import vibroimpact as vi
from designs import random_designs
from differences import derivative
from plain import differences
from systems import (
    CHAIN,
    a_random_system,
    a_symmetric_system,
    chain,
    impact_damper,
    on_springs,
    two_sided,
)
from vibroimpact.orbits import orbit_distance

# The engine


@pytest.mark.usefixtures("modal_engine")
@pytest.mark.parametrize(
    ("omega", "n", "p"), [(2.8, 2, 2), (3.0, 2, 2), (1.2, 2, 3), (0.95, 1, 2), (0.9, 1, 2), (0.6, 1, 3)]
)
def test_newton_finds_the_orbits_of_several_impacts_from_times_and_the_engine_returns_to_them(omega, n, p):
    osc = vi.ImpactOscillator(omega=omega)
    orbits = vi.find_orbit(osc, n_periods=n, n_impacts=p)
    assert orbits
    for expected in orbits:
        times = (np.array(expected.turns) + 0.01 * np.cos(np.arange(p))) * osc.period
        (orbit,) = vi.find_orbit(osc.system, n_periods=n, stops=["stop"] * p, near=times)
        assert orbit_distance(orbit, expected) < 1e-12
        assert np.array(orbit.multipliers) == pytest.approx(np.array(expected.multipliers), rel=1e-9)
        assert (orbit.name, orbit.stable, orbit.admissible) == (expected.name, expected.stable, expected.admissible)
        check_return(expected)
        check_return(orbit)


@pytest.mark.parametrize("system", [two_sided(), chain(), impact_damper()], ids=["two sides", "chain", "damper"])
def test_the_engine_returns_to_the_orbits_of_systems(system):
    orbits = [orbit for orbit in vi.find_orbit(system, symmetric=len(system.stops) == 2) if orbit.admissible]
    assert orbits
    for orbit in orbits:
        check_return(orbit)


def check_return(orbit):
    growth, p = 1 + abs(orbit.multipliers[0]), len(orbit.velocities)
    hits = vi.impact_section(orbit.model, start=orbit.start, transient_impacts=0, sample_impacts=p + 1)
    assert hits["velocity"].values == pytest.approx((*orbit.velocities, orbit.velocities[0]), rel=1e-12 * growth)
    assert hits["time"].values[-1] - hits["time"].values[0] == pytest.approx(orbit.period, rel=1e-12 * growth)


DESIGNS = {  # with periods, the largest multiplier and the least velocity of what settles soon, and how many do
    "one mass": (lambda: random_designs(np.random.default_rng(8), 40), (1, 2), 1.0, 0.0, 10),
    "masses on springs": (lambda: map(on_springs, [np.random.default_rng(5)] * 60), (1,), 0.97, 1e-3, 5),
}


@pytest.mark.parametrize("name", DESIGNS)
def test_a_stable_orbit_is_a_motion_that_is_stayed_on_and_an_inadmissible_one_is_never_stable(name):
    """The usual filter is enough: what penetrates the stop is no motion, though its multipliers may be small."""
    designs, periods, slowest, lightest, least = DESIGNS[name]
    kept = penetrating = 0
    for model in designs():
        for n, stop in product(periods, model.stop_names):
            orbits = vi.find_orbit(model, n_periods=n, stops=stop)
            penetrating += sum(orbit.spectral_radius < 1.0 and not orbit.admissible for orbit in orbits)
            assert [orbit.admissible for orbit in orbits] == sorted((o.admissible for o in orbits), reverse=True)
            for orbit in orbits:
                if not orbit.stable or orbit.spectral_radius > slowest or max(orbit.velocities) < lightest:
                    continue
                kept += 1
                later = vi.impact_section(model, start=orbit.start, transient_impacts=300, sample_impacts=1)
                assert later["velocity"].values == pytest.approx(orbit.velocities, rel=1e-6), model
    assert kept > least
    assert penetrating > 2


# Multipliers


def test_multipliers_tell_how_the_engine_brings_neighbours_back(form):
    """The return map of the impact surface, by differences, has the orbit's trace and determinant."""
    model = form(vi.ImpactOscillator(omega=0.95))
    (orbit,) = vi.find_orbit(model, n_impacts=2)
    following = vi.impact_map(model)

    def returned(start):
        return np.array(following(*following(*start)))

    matrix = derivative(returned, np.array([orbit.phases[0], orbit.velocities[0]]), 1e-5)
    assert np.trace(matrix) == pytest.approx(orbit.trace, abs=1e-7)
    assert np.linalg.det(matrix) == pytest.approx(orbit.determinant, abs=1e-7)


def sections_of_systems():
    rng = np.random.default_rng(7)
    for n in (1, 2, 3, 6, 4, 5):
        for system in (a_random_system(rng, n), a_symmetric_system(rng, n)):
            yield system, vi.find_orbit(system, n_periods=int(rng.integers(1, 3)))


def test_multipliers_are_those_of_differences_between_neighbouring_motions():
    count = 0
    of_one_mass = vi.find_orbit(vi.ImpactOscillator(omega=0.95), n_impacts=2)
    for system, found in [*sections_of_systems(), (vi.ImpactOscillator().system, of_one_mass)]:
        if len(system.mass) > 3:
            continue
        for orbit in [*found, *vi.find_orbit(two_sided(), symmetric=True)][:4]:
            jacobian = differences(orbit.system, orbit)
            size = np.abs(np.poly(jacobian)).max()
            assert np.poly(np.array(orbit.multipliers)) == pytest.approx(np.poly(jacobian), abs=1e-6 * size)
            count += 1
    assert count >= 16


def test_a_symmetric_orbit_has_squares_of_the_multipliers_of_its_half():
    (orbit,) = vi.find_orbit(impact_damper(), stops="above", symmetric=True)
    jacobian = differences(orbit.system, orbit)
    assert np.poly(np.array(orbit.multipliers)) == pytest.approx(np.poly(jacobian), abs=1e-6)
    assert np.array(orbit.half_multipliers) ** 2 == pytest.approx(np.array(orbit.multipliers), rel=1e-14)


def test_a_mode_that_nothing_couples_adds_its_own_multipliers():
    system = chain()
    joined = vi.ImpactSystem(
        mass=np.diag([2.0, 1.0, 1.0, 1.0]),
        damping=np.pad(0.02 * CHAIN, (1, 0)) + np.diag([0.3, 0.0, 0.0, 0.0]),
        stiffness=np.pad(CHAIN, (1, 0)) + np.diag([50.0, 0.0, 0.0, 0.0]),
        force=vi.Force(omega=0.9, harmonics={1: [7.0, 1.0, 0.0, 0.0]}),
        stops=[vi.Stop(direction=[0, 0, 0, 1], gap=0.5, restitution=0.7)],
    )
    rate = -0.075 + 1j * math.sqrt(25.0 - 0.075**2)
    for orbit, other in zip(vi.find_orbit(system), vi.find_orbit(joined), strict=True):
        assert other.velocities == pytest.approx(orbit.velocities, rel=1e-13)
        multipliers = np.exp(np.array([rate, rate.conjugate()]) * orbit.period)
        expected = np.poly([*orbit.multipliers, *multipliers])
        assert np.poly(np.array(other.multipliers)) == pytest.approx(expected, abs=1e-11)


# Determinants


def of_one_mass():
    return vi.find_orbit(vi.ImpactOscillator(omega=3.0), n_periods=2, n_impacts=3)


def of_systems():
    return [orbit for _, found in sections_of_systems() for orbit in found]


@pytest.mark.parametrize(("orbits", "least", "rel"), [(of_one_mass, 2, 1e-13), (of_systems, 15, 1e-11)])
def test_the_determinant_is_what_impacts_and_damping_leave(orbits, least, rel):
    found = orbits()
    assert len(found) >= least
    for orbit in found:
        system = orbit.system
        bounces = [system.stops[system.stop_names.index(stop)].restitution for stop in orbit.stops]
        damped = math.exp(-np.trace(np.linalg.solve(system.mass, system.damping)) * orbit.period)
        expected = math.prod(bounces) ** 2 * damped
        assert orbit.determinant == pytest.approx(expected, rel=rel)
        volume = np.prod(orbit.multipliers)
        assert (volume.real, volume.imag) == pytest.approx((expected, 0.0), rel=10 * rel, abs=1e-13)
        assert len(orbit.multipliers) == 2 * len(system.mass)


def test_without_any_loss_no_orbit_attracts(form):
    one = form(vi.ImpactOscillator(damping=0.0, omega=2.7, restitution=1.0))
    assert vi.find_orbit(one)
    for model, n in product((chain(1.0, damping=0.0), one), (1, 2, 3)):
        for orbit in vi.find_orbit(model, n_periods=n):
            assert orbit.determinant == 1.0
            assert np.prod(orbit.multipliers).real == pytest.approx(1.0, rel=1e-11)
            inverse = sorted(abs(1.0 / value) for value in orbit.multipliers)  # of a conservative motion in pairs
            assert inverse == pytest.approx(sorted(abs(value) for value in orbit.multipliers), rel=1e-9)
            assert not orbit.stable


@pytest.mark.parametrize(("omega", "rests"), [(0.7, True), (2.5, False)])
def test_an_impact_without_rebound_loses_one_dimension(form, omega, rests):
    """At w = 2.5 the force points away from the stop at the impact, so that the mass leaves at once, from rest."""
    osc = vi.ImpactOscillator(restitution=0.0, omega=omega)
    model = form(osc)
    (orbit,) = found = vi.find_orbit(model)
    assert orbit_distance(orbit, vi.find_orbit(osc)[0]) < 1e-13
    assert orbit.determinant == 0.0
    assert abs(orbit.multipliers[1]) < 1e-14
    assert orbit.admissible != rests
    assert found.outcome == ("inadmissible" if rests else "found")
    at_rest = "the mass comes to rest at the stop" if model is osc else "the system comes to rest at 'stop'"
    assert (f"after impact 1 {at_rest}" in found.message) == rests
    assert (math.sin(2 * math.pi * orbit.phases[0]) < 0) != rests
    if not rests:
        hits = vi.impact_section(model, transient_impacts=300, sample_impacts=3)
        assert hits["velocity"].values == pytest.approx(orbit.velocities[0], rel=1e-12)
