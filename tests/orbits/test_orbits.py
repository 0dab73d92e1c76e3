"""Periodic orbits against digits computed by independent code, closed forms, and roots by brute force."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import vibroimpact as vi
from designs import any_oscillator
from oracles.one_impact import response, velocities
from plain import Plain, by_brute_force
from systems import (
    a_random_system,
    a_symmetric_system,
    bouncing_ball,
    chain,
    changed,
    facing,
    impact_damper,
    two_sided,
)
from vibroimpact.orbits import orbit_distance

TWO_IMPACTS = {
    "one mass": lambda osc, times: vi.find_orbit(osc, n_impacts=2),
    "its system": lambda osc, times: vi.find_orbit(osc.system, n_impacts=2),
    "its system, from times": lambda osc, times: vi.find_orbit(osc.system, stops=["stop"] * 2, near=times + 0.02),
}

# Values of 24 and of 50 digits


@pytest.mark.parametrize("name", ["w=2.0,n=1", "w=1.4,n=1", "w=2.6,n=1"])
def test_one_impact_a_period_agrees_with_50_digits(values, form, name):
    known = values["period_n_impact_1"][name]
    (orbit,) = vi.find_orbit(form(vi.ImpactOscillator(omega=float(name[2:5]))))
    assert orbit.velocities[0] == pytest.approx(float(known["v"]), rel=1e-13)
    assert orbit.phases[0] == pytest.approx(float(known["phase_frac"]), rel=1e-13)
    assert orbit.trace == pytest.approx(float(known["trace"]), rel=1e-13)
    assert orbit.determinant == pytest.approx(float(known["det"]), rel=1e-13)
    for multiplier, (real, imaginary) in zip(orbit.multipliers, (known["mult1"], known["mult2"]), strict=True):
        assert multiplier == pytest.approx(complex(float(real), float(imaginary)), rel=1e-11)


@pytest.mark.usefixtures("modal_engine")
@pytest.mark.parametrize("way", TWO_IMPACTS)
def test_two_impacts_a_period_agree_with_50_digits(values, way):
    known = values["period_1_impact_2"]["w=0.95"]
    first, second = float(known["phase_frac_a"]), float(known["phase_frac_b"])
    osc = vi.ImpactOscillator(omega=0.95)
    (orbit,) = TWO_IMPACTS[way](osc, osc.period * np.array([first, second + (second < first)]))
    assert orbit.velocities == pytest.approx((float(known["v_a"]), float(known["v_b"])), rel=1e-13)
    assert orbit.phases == pytest.approx((first, second), rel=1e-13)
    assert orbit.trace == pytest.approx(float(known["trace"]), rel=1e-12)
    assert orbit.determinant == pytest.approx(float(known["det"]), rel=1e-13)
    assert orbit.stable
    assert orbit.admissible


@pytest.mark.parametrize(
    ("system", "symmetric", "velocity", "phase", "radius"),
    [
        (two_sided(), True, 1.01091975000998629752895, 0.30697182627669859292, 0.576894695880845),
        (chain(), False, 0.6314772880991517553058458, 0.61512189651226436508, 0.916997423593104),
        (impact_damper(), True, 9.407221992561745893002965, 0.74256436841325221938, 0.951484071086934),
    ],
)
def test_stable_orbits_agree_with_24_digits(system, symmetric, velocity, phase, radius):
    (orbit,) = (
        orbit for orbit in vi.find_orbit(system, stops=system.stops[0].name, symmetric=symmetric) if orbit.stable
    )
    assert orbit.velocities[0] == pytest.approx(velocity, rel=1e-14)
    assert orbit.phases[0] == pytest.approx(phase, abs=1e-14)
    assert abs((orbit.half_multipliers or orbit.multipliers)[0]) == pytest.approx(radius, rel=1e-13)
    assert orbit.admissible
    assert orbit.symmetric == symmetric


def test_a_nearly_free_mass_keeps_its_digits(form):
    """The force turns 1000 times per free period; values of the quadratic with 50 digits."""
    osc = vi.ImpactOscillator(
        mass=29.622023395880277,
        damping=0.04002985614795189,
        stiffness=0.007317046314114021,
        amplitude=0.0024504668600181865,
        omega=17.076030406138702,
        restitution=0.969678298492064,
        gap=-0.5653230303832933,
    )
    first, second = vi.find_orbit(form(osc), n_periods=4)
    assert first.velocities[0] == pytest.approx(0.00010435060552674233, rel=1e-11)
    assert second.velocities[0] == pytest.approx(0.00010435050679215172, rel=1e-11)
    assert (first.phases[0], second.phases[0]) == pytest.approx((0.6958559636453552, 0.304118792792092), abs=1e-11)


def test_a_beam_of_twelve_modes_keeps_its_digits():
    """The last frequency is 371 times the first, near which the force is; the stop is in sight of all modes."""
    roots_of_beam = np.array([1.8751040687, 4.6940911330, *((2 * i - 1) * np.pi / 2 for i in range(3, 13))])
    beam = vi.ImpactSystem.from_modes(
        frequencies=10.0 * (roots_of_beam / roots_of_beam[0]) ** 2,
        damping_ratios=0.01,
        shapes=[2.0 * (-1.0) ** np.arange(12), np.linspace(0.7, 1.0, 12)],
        force=vi.Force(frequency=9.3, harmonics={1: {"point_2": 1.0}, 2: {"point_2": 0.3j}}),
        stops=[vi.Stop(direction={"point_1": 1.0}, gap=1e-4, restitution=0.6)],
    )
    for n in (1, 2):
        (orbit,) = vi.find_orbit(beam, n_periods=n)
        assert Plain(beam).replayed(orbit) < 1e-12


# The quadratic of one mass


def test_the_quadratic_of_one_impact_holds_on_random_oscillators(form):
    """(alpha^2 + beta^2/w^2) v^2 + 2 alpha g v + g^2 - R^2 = 0, with alpha and beta from the flow over nT."""
    rng = np.random.default_rng(1)
    count = 0
    for _ in range(200):
        osc, n = any_oscillator(rng), int(rng.integers(1, 4))
        expected = velocities(*response(osc, n * osc.period), osc.omega, osc.gap, osc.steady_amplitude)
        found = sorted(orbit.velocities[0] for orbit in vi.find_orbit(form(osc), n_periods=n))
        assert found == pytest.approx(expected, rel=1e-9)
        count += len(found)
    assert count > 150


def test_without_a_gap_there_is_exactly_one_impact_1_orbit_for_every_frequency_and_length(form):
    for omega in np.linspace(0.03, 5, 60):
        for n in (1, 2, 3):
            assert len(vi.find_orbit(form(vi.ImpactOscillator(omega=omega)), n_periods=n)) == 1


def test_two_orbits_beyond_the_steady_amplitude_one_stable(form):
    """The mass may swing clear of the stop, or keep hitting it; between the two lies the unstable orbit."""
    osc = vi.ImpactOscillator(omega=1.2, gap=3.0)
    model = form(osc)
    first, second = vi.find_orbit(model)
    assert osc.gap > osc.steady_amplitude
    assert (first.stable, second.stable) == (True, False)
    hits = vi.impact_section(model, start=first.start, transient_impacts=500, sample_impacts=3)
    assert hits["velocity"].values == pytest.approx(first.velocities[0], rel=1e-11)
    swinging = vi.State(0.0, -osc.omega * osc.steady_amplitude)
    clear = vi.impact_section(model, start=swinging, transient_impacts=500, sample_impacts=3)
    assert clear.sizes["impact"] == 0


def test_undamped_resonance_leaves_the_limit_velocity(form):
    """pi n f/((1 + r) sqrt(k m)) holds where no steady state exists, and nearly where damping is as weak as that."""
    for damping, n in product((0.0, 1e-14, 1e-12), (1, 2)):
        osc = vi.ImpactOscillator(
            damping=damping, omega=1.5, stiffness=2.25 * 1.3, mass=1.3, amplitude=0.7, restitution=0.6
        )
        (orbit,) = vi.find_orbit(form(osc), n_periods=n)
        limit = math.pi * n * osc.amplitude / (1.6 * math.sqrt(osc.stiffness * osc.mass))
        assert orbit.velocities[0] == pytest.approx(limit, rel=1e-11 if damping else 1e-13)


# One mass and its system


@pytest.mark.usefixtures("modal_engine")
@pytest.mark.parametrize("n", [1, 2, 3])
def test_one_coordinate_and_one_stop_have_the_orbits_of_the_oscillator(n):
    rng, count = np.random.default_rng(n), 0
    for _ in range(60):
        osc = any_oscillator(rng)
        orbits, found = vi.find_orbit(osc, n_periods=n), vi.find_orbit(osc.system, n_periods=n)
        assert len(orbits) == len(found)
        for expected, orbit in zip(orbits, found, strict=True):
            assert type(orbit) is type(expected) is vi.Orbit
            assert orbit.velocities == pytest.approx(expected.velocities, rel=1e-11)
            assert orbit_distance(orbit, expected) < 1e-11
            assert np.array(orbit.multipliers) == pytest.approx(np.array(expected.multipliers), rel=1e-8, abs=1e-12)
            assert (orbit.name, orbit.stops, orbit.stable) == (expected.name, expected.stops, expected.stable)
            assert orbit.admissible == expected.admissible, (expected.message, orbit.message)
            assert orbit.determinant == pytest.approx(expected.determinant, rel=1e-12)
            assert orbit.turns == pytest.approx(expected.turns, abs=1e-11)
            assert [kind for _, kind, _ in orbit.events] == [kind for _, kind, _ in expected.events] == ["impact"]
            for known, contact in zip(expected.contacts, orbit.contacts, strict=True):
                assert contact == pytest.approx(known, rel=1e-11, nan_ok=True)
            assert (orbit.rests, orbit.pushing, orbit.symmetric) == (expected.rests, expected.pushing, False)
            times = np.linspace(0.0, 2.0 * orbit.period, 50)
            for ours, theirs in zip(orbit.motion(times), expected.motion(times), strict=True):
                assert ours == pytest.approx(theirs, abs=1e-10)
        count += len(found)
    assert count > 40


@pytest.mark.parametrize(("omega", "n", "p"), [(2.0, 1, 1), (0.95, 1, 2), (3.0, 2, 3)])
def test_impacts_alone_make_the_orbit_of_one_mass(omega, n, p):
    orbit = vi.find_orbit(vi.ImpactOscillator(omega=omega), n_periods=n, n_impacts=p)[0]
    made = vi.Orbit(orbit.oscillator, n, p, orbit.velocities, orbit.phases, orbit.multipliers)
    assert made.turns == pytest.approx(orbit.turns, abs=1e-14)
    assert replace(made, turns=orbit.turns, events=orbit.events) == orbit


@pytest.mark.parametrize("name", ["energy", "omegas"])
@pytest.mark.parametrize(
    ("model", "first"),
    [(vi.ImpactOscillator(omega=2.0), "mass"), (chain(), "omega")],
    ids=["one mass", "chain"],
)
def test_the_value_of_what_neither_the_model_nor_the_orbit_has_is_refused(model, first, name):
    orbit = vi.find_orbit(model)[0]
    with pytest.raises(ValueError, match=f"unknown parameter '{name}'; choose from {first}, "):
        orbit.value(name)


@pytest.mark.parametrize(
    ("model", "impacts"),
    [(vi.ImpactOscillator(omega=2.0), 1), (vi.models.impact_damper(), 2)],
    ids=["one mass", "a system"],
)
def test_an_orbit_tells_its_motion_at_one_time_as_at_several(model, impacts):
    orbit = vi.find_orbit(model, n_impacts=impacts)[0]
    for one, several in zip(orbit.motion(0.1), orbit.motion([0.1, 0.2]), strict=True):
        assert np.ravel(one) == pytest.approx(np.ravel(several[0]), rel=1e-15)


# The bouncing ball


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("r", [0.0, 0.5, 0.9])
def test_the_bouncing_ball_has_its_fold_trace_and_period_doubling(n, r):
    fold = n * math.pi * (1.0 - r) / (1.0 + r)
    below = vi.find_orbit(bouncing_ball(fold * (1.0 - 1e-9), r), n_periods=n)
    assert (list(below), below.outcome) == ([], "none")
    assert len(vi.find_orbit(bouncing_ball(fold * (1.0 + 1e-9), r), n_periods=n)) == 2
    for gamma in (1.01 * fold, 1.5 * fold, 10.0 * fold):
        for orbit in vi.find_orbit(bouncing_ball(gamma, r), n_periods=n):
            sine = math.sin(2.0 * math.pi * orbit.phases[0])
            assert math.cos(2.0 * math.pi * orbit.phases[0]) == pytest.approx(fold / gamma, abs=1e-13)
            trace = 1.0 + r * r - (1.0 + r) ** 2 * gamma * sine
            assert sum(orbit.multipliers).real == pytest.approx(trace, rel=1e-12)
            flight = n * 2.0 * math.pi / 3.0 * 9.81 / 2.0  # the speed relative to the table's, of both ends the same
            assert orbit.velocities[0] == pytest.approx(2.0 * flight / (1.0 + r), rel=1e-13)
            assert np.prod(orbit.multipliers).real == pytest.approx(r * r, abs=1e-12)
    doubling = math.sqrt(fold**2 + (2.0 * (1.0 + r * r) / (1.0 + r) ** 2) ** 2)
    if r > 0.0:
        multipliers = [m for orbit in vi.find_orbit(bouncing_ball(doubling, r), n_periods=n) for m in orbit.multipliers]
        assert min(abs(m + 1.0) for m in multipliers) < 1e-12


# All orbits of one impact


@pytest.mark.parametrize("n", [1, 2, 3, 5, 12])
def test_all_orbits_of_one_impact_are_found(n):
    """Gyroscopic damping, constant load, two harmonics of the force, moving stops, against a scan of the phase."""
    rng, count = np.random.default_rng(10 + n), 0
    for _ in range(10):
        system, length = a_random_system(rng, n), int(rng.integers(1, 4))
        for stop in system.stops:
            known = by_brute_force(system, stop, length)
            orbits = vi.find_orbit(system, n_periods=length, stops=stop.name)
            assert len(orbits) == len(known)
            for orbit, (phase, velocity) in zip(sorted(orbits, key=lambda o: o.phases), known, strict=True):
                assert orbit.phases[0] == pytest.approx(phase, abs=1e-10)
                assert orbit.velocities[0] == pytest.approx(velocity, rel=1e-9)
                assert Plain(system).replayed(orbit) < 1e-11
            count += len(orbits)
    assert count >= 10


@pytest.mark.parametrize("n", [1, 2, 4])
def test_all_symmetric_orbits_are_found(n):
    rng, count = np.random.default_rng(20 + n), 0
    for _ in range(6):
        system, length = a_symmetric_system(rng, n), int(rng.choice([1, 3]))
        known = by_brute_force(system, system.stops[0], length, mirrored=True)
        orbits = vi.find_orbit(system, n_periods=length, stops="above", symmetric=True)
        assert len(orbits) == len(known)
        for orbit, (phase, velocity) in zip(sorted(orbits, key=lambda o: o.phases), known, strict=True):
            assert orbit.stops == ("above", "below")
            assert orbit.turns[1] - orbit.turns[0] == pytest.approx(length / 2.0, rel=1e-14)
            assert orbit.phases[0] == pytest.approx(phase, abs=1e-10)
            assert orbit.velocities == pytest.approx((velocity, 2.0 * velocity), rel=1e-9)  # a direction twice as long
            assert orbit.impulses[0] == pytest.approx(2.0 * orbit.impulses[1], rel=1e-12)
            assert Plain(system).replayed(orbit) < 1e-11
        count += len(orbits)
    assert count >= 6


def test_a_slot_that_moves_is_a_force_in_its_own_frame():
    """A free mass in a shaken slot has the orbits of one in a slot at rest under the force m b w^2."""
    shaken = two_sided(
        stiffness=0.0,
        damping=0.0,
        force=vi.Force(omega=2.0),
        stops=[stop.replace(motion={1: 0.3 * stop.direction[0]}) for stop in facing([1.0], 0.5, 0.6)],
    )
    still = two_sided(stiffness=0.0, damping=0.0, force=vi.Force(omega=2.0, harmonics={1: 0.3 * 4.0}))
    for n in (1, 3, 5):
        found, known = (vi.find_orbit(system, n_periods=n, stops="above", symmetric=True) for system in (shaken, still))
        assert len(found) == len(known) > 0
        for orbit, other in zip(found, known, strict=True):
            assert orbit_distance(orbit, other) < 1e-13
            assert orbit.multipliers == pytest.approx(other.multipliers, rel=1e-10)
            assert (orbit.admissible, orbit.stable) == (other.admissible, other.stable)


# Identities


@pytest.mark.parametrize(("omega", "n", "p"), [(3.0, 2, 1), (2.95, 2, 2), (0.9, 1, 2)])
def test_scaling_leaves_phases_and_multipliers(form, omega, n, p):
    osc = vi.ImpactOscillator(omega=omega, gap=0.05)
    twin = vi.ImpactOscillator(
        mass=4.0, stiffness=4.0, damping=0.04, amplitude=8.0, omega=omega, gap=0.1
    )  # masses times 4, lengths times 2
    orbits, twins = (vi.find_orbit(form(one), n_periods=n, n_impacts=p) for one in (osc, twin))
    assert orbits
    for one, other in zip(orbits, twins, strict=True):
        assert other.phases == pytest.approx(one.phases, rel=1e-12)
        assert other.velocities == pytest.approx(2 * np.array(one.velocities), rel=1e-12)
        assert other.multipliers == pytest.approx(one.multipliers, rel=1e-10)


@pytest.mark.parametrize("n", [2, 4])
def test_units_and_coordinates_change_nothing(n):
    rng = np.random.default_rng(n)
    system = a_random_system(rng, n)
    basis = np.eye(n) + 0.3 * rng.standard_normal((n, n))
    there = changed(system, mass=3.0, force=0.7, length=100.0, time=1e-3, basis=basis)
    assert len(vi.find_orbit(system)) == len(vi.find_orbit(there)) > 0
    for orbit, other in zip(vi.find_orbit(system), vi.find_orbit(there), strict=True):
        assert other.velocities[0] == pytest.approx(1e5 * orbit.velocities[0], rel=1e-11)
        assert other.phases == pytest.approx(orbit.phases, abs=1e-12)
        assert np.poly(other.multipliers) == pytest.approx(np.poly(orbit.multipliers), rel=1e-8, abs=1e-9)
        assert basis @ other.start.displacement == pytest.approx(100.0 * np.array(orbit.start.displacement), rel=1e-9)
        assert orbit.admissible == other.admissible
