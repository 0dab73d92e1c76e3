"""Periodic impact orbits: closed forms, 50-digit values, and what the engine makes of them."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from designs import random_designs
from differences import derivative
from oracles.one_impact import response, velocities
from vibroimpact.orbits import orbit_distance, same_orbit
from vibroimpact.orbits.admissibility import contacts
from vibroimpact.orbits.distance import Impacts
from vibroimpact.orbits.equations import Cycle, Flight, parameters_of


def random_oscillator(rng, **fixed):
    numbers = {
        "mass": 10 ** rng.uniform(-1, 1),
        "damping": 10 ** rng.uniform(-2, 1),
        "stiffness": 10 ** rng.uniform(-1, 1),
        "amplitude": rng.uniform(0.1, 3),
        "omega": 10 ** rng.uniform(-0.5, 0.5),
        "restitution": rng.uniform(0.1, 0.95),
        "gap": rng.uniform(-0.5, 0.5),
    }
    return vi.ImpactOscillator(**{**numbers, **fixed})


@pytest.mark.parametrize("name", ["w=2.0,n=1", "w=1.4,n=1", "w=2.6,n=1"])
def test_one_impact_a_period_agrees_with_50_digits(values, name):
    known = values["period_n_impact_1"][name]
    (orbit,) = vi.find_orbit(vi.ImpactOscillator(omega=float(name[2:5])))
    assert orbit.velocities[0] == pytest.approx(float(known["v"]), rel=1e-13)
    assert orbit.phases[0] == pytest.approx(float(known["phase_frac"]), rel=1e-13)
    assert orbit.trace == pytest.approx(float(known["trace"]), rel=1e-13)
    assert orbit.determinant == pytest.approx(float(known["det"]), rel=1e-13)
    for multiplier, (real, imaginary) in zip(orbit.multipliers, (known["mult1"], known["mult2"]), strict=True):
        assert multiplier == pytest.approx(complex(float(real), float(imaginary)), rel=1e-11)


def test_two_impacts_a_period_agree_with_50_digits(values):
    known = values["period_1_impact_2"]["w=0.95"]
    (orbit,) = vi.find_orbit(vi.ImpactOscillator(omega=0.95), n_impacts=2)
    assert orbit.velocities == pytest.approx((float(known["v_a"]), float(known["v_b"])), rel=1e-13)
    assert orbit.phases == pytest.approx((float(known["phase_frac_a"]), float(known["phase_frac_b"])), rel=1e-13)
    assert orbit.trace == pytest.approx(float(known["trace"]), rel=1e-12)
    assert orbit.determinant == pytest.approx(float(known["det"]), rel=1e-13)
    assert orbit.stable
    assert orbit.admissible


def test_the_quadratic_of_one_impact_holds_on_random_oscillators():
    """(alpha^2 + beta^2/w^2) v^2 + 2 alpha g v + g^2 - R^2 = 0, with alpha and beta from the flow over nT."""
    rng = np.random.default_rng(1)
    count = 0
    for _ in range(200):
        osc, n = random_oscillator(rng), int(rng.integers(1, 4))
        expected = velocities(*response(osc, n * osc.period), osc.omega, osc.gap, osc.steady_amplitude)
        found = sorted(orbit.velocities[0] for orbit in vi.find_orbit(osc, n_periods=n))
        assert found == pytest.approx(expected, rel=1e-9)
        count += len(found)
    assert count > 150


def test_without_a_gap_there_is_exactly_one_impact_1_orbit_for_every_frequency_and_length():
    for omega in np.linspace(0.03, 5, 60):
        for n in (1, 2, 3):
            assert len(vi.find_orbit(vi.ImpactOscillator(omega=omega), n_periods=n)) == 1


@pytest.mark.parametrize(
    ("changes", "n", "why"),
    [
        ({"damping": 0.0, "omega": 0.5}, 1, "whole number of free periods"),
        ({"damping": 0.0, "omega": 2.0}, 2, "2 driving periods are a whole number of free periods"),
        ({"damping": 0.0, "restitution": 1.0}, 1, "grow without bound"),
        ({"amplitude": 0.0, "gap": -1.0}, 1, "unforced"),
        ({"amplitude": 0.0, "damping": 0.0, "restitution": 1.0, "gap": -1.0}, 1, "without loss"),
        ({"gap": 5.0}, 1, "beyond the steady amplitude"),
    ],
)
def test_where_no_orbit_exists_the_reason_is_told(changes, n, why):
    orbits = vi.find_orbit(vi.ImpactOscillator(**changes), n_periods=n)
    assert list(orbits) == []
    assert orbits.outcome == "none"
    assert why in orbits.message


def test_a_mass_that_does_not_rebound_sticks_instead_and_is_told_so():
    orbits = vi.find_orbit(vi.ImpactOscillator(restitution=0.0, omega=0.7))
    assert orbits.outcome == "inadmissible"
    assert "comes to rest at the stop" in orbits.message
    assert orbits[0].determinant == 0.0


def test_a_mass_that_does_not_rebound_but_is_pulled_away_has_an_orbit():
    """At w = 2.5 the force points away from the stop at the impact, so that the mass leaves at once, from rest."""
    osc = vi.ImpactOscillator(restitution=0.0, omega=2.5)
    (orbit,) = vi.find_orbit(osc)
    assert math.sin(2 * math.pi * orbit.phases[0]) < 0
    assert orbit.admissible
    assert orbit.determinant == 0.0
    hits = vi.impact_section(osc, transient_impacts=300, sample_impacts=3)
    assert hits["velocity"].values == pytest.approx(orbit.velocities[0], rel=1e-12)


def test_an_orbit_that_hits_too_early_is_inadmissible_and_says_where():
    orbits = vi.find_orbit(vi.ImpactOscillator(omega=0.9))
    assert orbits.outcome == "inadmissible"
    (orbit,) = orbits
    assert not orbit.admissible
    assert "first hits the stop at phase" in orbit.message


def test_two_orbits_beyond_the_steady_amplitude_one_stable():
    """The mass may swing clear of the stop, or keep hitting it; between the two lies the unstable orbit."""
    osc = vi.ImpactOscillator(omega=1.2, gap=3.0)
    first, second = vi.find_orbit(osc)
    assert osc.gap > osc.steady_amplitude
    assert (first.stable, second.stable) == (True, False)
    hits = vi.impact_section(osc, start=first.start, transient_impacts=500, sample_impacts=3)
    assert hits["velocity"].values == pytest.approx(first.velocities[0], rel=1e-11)
    swinging = vi.State(0.0, -osc.omega * osc.steady_amplitude)
    clear = vi.impact_section(osc, start=swinging, transient_impacts=500, sample_impacts=3)
    assert clear.sizes["impact"] == 0


@pytest.mark.parametrize(("omega", "n", "p"), [(2.8, 2, 2), (3.0, 2, 2), (1.2, 2, 3), (0.9, 1, 2), (0.6, 1, 3)])
def test_the_engine_returns_to_every_orbit_found(omega, n, p):
    osc = vi.ImpactOscillator(omega=omega)
    orbits = vi.find_orbit(osc, n_periods=n, n_impacts=p)
    assert orbits
    for orbit in orbits:
        growth = 1 + abs(orbit.multipliers[0])
        hits = vi.impact_section(osc, start=orbit.start, transient_impacts=0, sample_impacts=p + 1)
        assert hits["velocity"].values == pytest.approx((*orbit.velocities, orbit.velocities[0]), rel=1e-12 * growth)
        assert hits["time"].values[-1] - hits["time"].values[0] == pytest.approx(orbit.period, rel=1e-12 * growth)


def test_multipliers_tell_how_the_engine_brings_neighbours_back():
    """The return map of the impact surface, by differences, has the orbit's trace and determinant."""
    osc = vi.ImpactOscillator(omega=0.95)
    (orbit,) = vi.find_orbit(osc, n_impacts=2)

    def returned(start):
        (touches,) = contacts(osc, *start[:, None], 2)
        return np.array([touches.impact_phase[2], touches.impact_velocity[2]])

    matrix = derivative(returned, np.array([orbit.phases[0], orbit.velocities[0]]), 1e-5)
    assert np.trace(matrix) == pytest.approx(orbit.trace, abs=1e-7)
    assert np.linalg.det(matrix) == pytest.approx(orbit.determinant, abs=1e-7)


def test_the_determinant_is_what_impacts_and_damping_leave():
    for orbit in vi.find_orbit(vi.ImpactOscillator(omega=3.0), n_periods=2, n_impacts=3):
        osc = orbit.oscillator
        determinant = osc.restitution**6 * math.exp(-osc.damping * orbit.period / osc.mass)
        assert orbit.determinant == pytest.approx(determinant, rel=1e-13)
        assert math.prod(orbit.multipliers) == pytest.approx(determinant, rel=1e-12)


def test_scaling_leaves_phases_and_multipliers():
    osc = vi.ImpactOscillator(omega=3.0, gap=0.05)
    twin = vi.ImpactOscillator(
        mass=4.0, stiffness=4.0, damping=0.04, amplitude=8.0, omega=3.0, gap=0.1
    )  # masses times 4, lengths times 2
    for one, other in zip(
        vi.find_orbit(osc, n_periods=2, n_impacts=2), vi.find_orbit(twin, n_periods=2, n_impacts=2), strict=True
    ):
        assert other.phases == pytest.approx(one.phases, rel=1e-12)
        assert other.velocities == pytest.approx(2 * np.array(one.velocities), rel=1e-12)
        assert other.multipliers == pytest.approx(one.multipliers, rel=1e-10)


def test_each_way_of_saying_near_leads_to_the_same_orbit():
    osc = vi.ImpactOscillator(omega=0.95)
    (orbit,) = vi.find_orbit(osc, n_impacts=2)
    before = vi.find_orbit(osc.replace(omega=0.94), n_impacts=2)[0]
    for near in (before, before.start, (before.phases[1], before.velocities[1]), (0.1, 1.5)):
        (again,) = vi.find_orbit(osc, n_impacts=2, near=near)
        assert again.velocities == pytest.approx(orbit.velocities, rel=1e-12)
        assert again.phases == pytest.approx(orbit.phases, rel=1e-12)


def test_a_start_that_leads_to_a_smaller_name_is_told():
    osc = vi.ImpactOscillator(omega=2.0)
    orbits = vi.find_orbit(osc, n_periods=2, n_impacts=2, near=(0.499, 6.2))
    assert (list(orbits), orbits.outcome) == ([], "other_name")
    assert "period-1 impact-1" in orbits.message
    assert vi.find_orbit(osc, n_periods=3, n_impacts=3).outcome == "other_name"


def test_a_start_at_a_fold_is_called_singular():
    """At g^2 = R^2 (1 + (alpha w / beta)^2) the two impact-1 orbits are one; no equation tells it from its twin."""
    osc = vi.ImpactOscillator(omega=1.2, gap=3.0)
    low, high = 3.0, 10.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if len(vi.find_orbit(osc.replace(gap=middle))) == 2 else (low, middle)
    one = vi.find_orbit(osc.replace(gap=low))[0]
    doubled = vi.Orbit(one.oscillator, 2, 2, one.velocities * 2, one.phases * 2, one.multipliers)
    assert vi.find_orbit(one.oscillator, n_periods=2, n_impacts=2, near=doubled).outcome in ("singular", "other_name")


@pytest.mark.parametrize(("damping", "omega", "gap"), [(10.0, 0.99, -0.57), (10.0, 0.26, 0.4), (3.0, 0.92, -0.44)])
def test_orbits_of_heavily_damped_masses_are_sought_without_an_overflow(damping, omega, gap):
    """A step of Newton's method may put an impact long before the one that it follows."""
    osc = vi.ImpactOscillator(damping=damping, omega=omega, gap=gap, restitution=0.5)
    assert vi.find_orbit(osc, n_impacts=2).outcome in ("none", "other_name")


def test_a_start_from_which_the_mass_hits_no_more_is_told():
    orbits = vi.find_orbit(vi.ImpactOscillator(gap=3.0, damping=0.5), n_impacts=2, near=(0.0, 0.01))
    assert orbits.outcome == "not_converged"
    assert "fewer than 2 impacts follow" in orbits.message


def test_flights_are_regular_at_resonance_and_critical_damping():
    """Beside resonance and critical damping the flight moves by as little as the parameters do."""
    at, beside = (Flight(1.0, 2.0 + e, 1.0, 1.0, 1.0 + e, 0.3).after(0.4, 0.7, 5.0) for e in (0.0, 1e-9))
    assert beside == pytest.approx(at, rel=1e-8)
    at, beside = (Flight(1.0, 0.0, 1.0, 1.0, 1.0 + e, 0.3).after(0.4, 0.7, 5.0) for e in (0.0, 1e-9))
    assert beside == pytest.approx(at, rel=1e-8)


def test_flights_obey_the_equation_of_motion():
    rng = np.random.default_rng(2)
    for _ in range(50):
        osc = random_oscillator(rng)
        flight = Flight(osc.mass, osc.damping, osc.stiffness, osc.amplitude, osc.omega, osc.gap)
        tau, h = 10 ** rng.uniform(-2, 1), 1e-4
        angle, rate = rng.uniform(0, 6), rng.uniform(0, 2)
        gap, speed = flight.after(angle, rate, tau)
        scale = (1 + rate) * 10
        later, sooner = flight.after(angle, rate, tau + h), flight.after(angle, rate, tau - h)
        assert (later[0] - sooner[0]) / (2 * h) == pytest.approx(speed, abs=1e-5 * scale)
        bend = flight.bend(angle + osc.omega * tau, gap, speed)
        assert (later[1] - sooner[1]) / (2 * h) == pytest.approx(bend, abs=1e-4 * scale)


def test_the_equations_know_their_own_derivative():
    rng = np.random.default_rng(3)
    osc, cycle = random_oscillator(rng), Cycle(2, 3)
    z, parameters = np.array([0.1, 0.7, 1.2, 1.0, 0.5, 0.8]), parameters_of(osc)
    known = derivative(lambda x: cycle.misses(parameters, x), z, 1e-6)
    assert cycle.jacobian(parameters, z) == pytest.approx(known, abs=1e-6)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"n_periods": 0}, "`n_periods` must be .* >= 1, got 0"),
        ({"n_periods": 1.5}, "`n_periods` must be .*, got 1.5"),
        ({"n_impacts": 0}, "`n_impacts` must be .* -1 .*, got 0"),
        ({"n_impacts": -2}, "`n_impacts` must be .*, got -2"),
        ({"n_impacts": 2, "near": "there"}, "`near` must be .*, got 'there'"),
        ({"n_impacts": 2, "near": (0.2, -1.0)}, "`near` must be .* > 0, got -1.0"),
        ({"n_impacts": 2, "near": vi.State(1.0, 1.0)}, "`near` lies beyond .* by 1 m"),
        ({"n_impacts": 2, "near": (0.2, math.nan)}, "`near` must be .*, got nan"),
    ],
)
def test_a_wrong_request_is_refused_by_name(arguments, named):
    with pytest.raises(ValueError, match=named):
        vi.find_orbit(vi.ImpactOscillator(), **arguments)


def test_what_is_no_oscillator_is_refused():
    with pytest.raises(ValueError, match="`osc` must be .*, got 2"):
        vi.find_orbit(2.0)


# The same orbit


def test_the_first_impact_and_whole_turns_do_not_make_another_orbit():
    one = Impacts([0.1, 0.6, 1.0 - 1e-9], [2.0, 1.0, 0.5])
    other = Impacts([1e-9, 0.1, 0.6], [0.5, 2.0, 1.0])
    assert orbit_distance(one, other) == pytest.approx(2 * math.pi * 2e-9)
    assert same_orbit(one, other)
    assert not same_orbit(one, other, tolerance=1e-9)
    assert orbit_distance(one, Impacts([0.6, 1.1, 1.6], [2.0, 1.0, 0.5])) > 0.5  # half a period later: another one


def test_orbits_of_different_numbers_of_impacts_are_never_the_same():
    twice = Impacts([0.1, 0.1], [2.0, 2.0])
    assert orbit_distance(Impacts([0.1], [2.0]), twice) == math.inf
    assert not same_orbit(Impacts([0.1], [2.0]), twice, tolerance=1.0)
    assert orbit_distance(Impacts([], []), Impacts([], [])) == 0.0


def test_the_distance_of_orbits_is_symmetric_and_knows_no_unit():
    rng = np.random.default_rng(3)
    for p in (1, 2, 5):
        one, other = (Impacts(rng.random(p), rng.random(p)) for _ in range(2))
        assert orbit_distance(one, other) == pytest.approx(orbit_distance(other, one))
        faster = [Impacts(cycle.phases, 1e6 * cycle.velocities) for cycle in (one, other)]
        assert orbit_distance(*faster) == pytest.approx(orbit_distance(one, other))


def test_a_stable_orbit_is_a_motion_that_the_mass_stays_on_and_an_inadmissible_one_is_never_stable():
    """The usual filter is enough: what penetrates the stop is no motion, though its multipliers may be small."""
    kept = penetrating = 0
    for osc in random_designs(np.random.default_rng(8), 40):
        for n in (1, 2):
            orbits = vi.find_orbit(osc, n_periods=n)
            assert [orbit.admissible for orbit in orbits] == sorted((o.admissible for o in orbits), reverse=True)
            penetrating += sum(orbit.spectral_radius < 1.0 and not orbit.admissible for orbit in orbits)
            for orbit in orbits:
                if not orbit.stable:
                    continue
                kept += 1
                later = vi.impact_section(osc, start=orbit.start, transient_impacts=200, sample_impacts=1)
                assert later["velocity"].values == pytest.approx(orbit.velocities, rel=1e-6), osc
    assert kept > 10
    assert penetrating > 2


@pytest.mark.parametrize("name", ["energy", "omegas"])
def test_the_value_of_what_neither_the_model_nor_the_orbit_has_is_refused(name):
    (orbit,) = vi.find_orbit(vi.ImpactOscillator(omega=2.0))
    with pytest.raises(ValueError, match=f"unknown parameter '{name}'; choose from mass, "):
        orbit.value(name)
