"""The rooms that orbits are solved in: flights, equations with their derivatives, roots, and the distance of cycles."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from designs import any_oscillator
from differences import derivative
from systems import a_symmetric_system
from vibroimpact.orbits import cycle, equations, orbit_distance, same_orbit
from vibroimpact.orbits.equations import Flight, parameters_of
from vibroimpact.orbits.events import Event
from vibroimpact.orbits.flow import Flow
from vibroimpact.orbits.systems.closed_form import roots

# Flights


def test_flights_are_regular_at_resonance_and_critical_damping():
    """Beside resonance and critical damping the flight moves by as little as the parameters do."""
    at, beside = (Flight(1.0, 2.0 + e, 1.0, 1.0, 1.0 + e, 0.3).after(0.4, 0.7, 5.0) for e in (0.0, 1e-9))
    assert beside == pytest.approx(at, rel=1e-8)
    at, beside = (Flight(1.0, 0.0, 1.0, 1.0, 1.0 + e, 0.3).after(0.4, 0.7, 5.0) for e in (0.0, 1e-9))
    assert beside == pytest.approx(at, rel=1e-8)


def test_flights_obey_the_equation_of_motion():
    rng = np.random.default_rng(2)
    for _ in range(50):
        osc = any_oscillator(rng)
        flight = Flight(osc.mass, osc.damping, osc.stiffness, osc.amplitude, osc.omega, osc.gap)
        tau, h = 10 ** rng.uniform(-2, 1), 1e-4
        angle, rate = rng.uniform(0, 6), rng.uniform(0, 2)
        gap, speed = flight.after(angle, rate, tau)
        scale = (1 + rate) * 10
        later, sooner = flight.after(angle, rate, tau + h), flight.after(angle, rate, tau - h)
        assert (later[0] - sooner[0]) / (2 * h) == pytest.approx(speed, abs=1e-5 * scale)
        bend = flight.bend(angle + osc.omega * tau, gap, speed)
        assert (later[1] - sooner[1]) / (2 * h) == pytest.approx(bend, abs=1e-4 * scale)


# Equations


def test_the_equations_of_one_mass_know_their_own_derivative():
    rng = np.random.default_rng(3)
    osc, unknowns = any_oscillator(rng), equations.Cycle(2, 3)
    z, parameters = np.array([0.1, 0.7, 1.2, 1.0, 0.5, 0.8]), parameters_of(osc)
    known = derivative(lambda x: unknowns.misses(parameters, x), z, 1e-6)
    assert unknowns.linearised(parameters, z)[1] == pytest.approx(known, abs=1e-6)


@pytest.mark.parametrize("n", [1, 2, 4])
def test_the_equations_of_systems_know_their_own_derivative(n):
    rng = np.random.default_rng(n)
    system = a_symmetric_system(rng, n)
    for stops, images in (((0, 1, 1, 0), ()), ((0, 1), (1, 0)), ((1,), ())):
        unknowns = cycle.Cycle(Flow(system), 1, tuple(map(Event, stops)), images)
        angles = np.sort(rng.uniform(0.0, unknowns.length, len(stops)))
        unknown = np.append(angles, rng.standard_normal(2 * n))
        _, matrix = unknowns.linearised(unknown)
        known = derivative(lambda x, unknowns=unknowns: unknowns.linearised(x)[0], unknown, 1e-6)
        assert known == pytest.approx(matrix, abs=1e-7 * np.abs(matrix).max())


def test_roots_of_trigonometric_polynomials_are_all_found():
    rng = np.random.default_rng(3)
    for _ in range(50):
        orders = np.sort(rng.choice(np.arange(1, 10), int(rng.integers(1, 6)), replace=False)).astype(float)
        c = rng.standard_normal(1 + 2 * len(orders))
        angles = np.linspace(0.0, 2.0 * np.pi, 20001)
        waves = np.outer(angles, orders)
        values = c[0] + np.sin(waves) @ c[1 : 1 + len(orders)] + np.cos(waves) @ c[1 + len(orders) :]
        places = np.flatnonzero(np.diff(np.sign(values)))
        assert roots(orders, c) == pytest.approx(angles[places], abs=1e-3)
    double = roots(np.array([1.0, 2.0]), np.array([0.25 + 0.5, 0.0, 0.0, -1.0, 0.5]))  # (cos t - 1/2)^2
    assert double == pytest.approx([np.pi / 3.0, 5.0 * np.pi / 3.0], abs=1e-7)
    assert roots(np.array([2.0]), np.array([1.0, 0.0, -1.0])) == pytest.approx([0.0, np.pi])
    assert roots(np.array([1.0]), np.array([1.0 + 1e-9, 0.0, 1.0])) == []


# The same orbit


def impacts(phases, velocities):
    """Return the impacts of a cycle."""
    return SimpleNamespace(phases=phases, velocities=velocities)


def test_the_first_impact_and_whole_turns_do_not_make_another_orbit():
    one = impacts([0.1, 0.6, 1.0 - 1e-9], [2.0, 1.0, 0.5])
    other = impacts([1e-9, 0.1, 0.6], [0.5, 2.0, 1.0])
    assert orbit_distance(one, other) == pytest.approx(2 * math.pi * 2e-9)
    assert same_orbit(one, other)
    assert not same_orbit(one, other, tolerance=1e-9)
    assert orbit_distance(one, impacts([0.6, 1.1, 1.6], [2.0, 1.0, 0.5])) > 0.5  # half a period later: another one


def test_orbits_of_different_numbers_of_impacts_are_never_the_same():
    twice = impacts([0.1, 0.1], [2.0, 2.0])
    assert orbit_distance(impacts([0.1], [2.0]), twice) == math.inf
    assert not same_orbit(impacts([0.1], [2.0]), twice, tolerance=1.0)
    assert orbit_distance(impacts([], []), impacts([], [])) == 0.0


def test_the_distance_of_orbits_is_symmetric_and_knows_no_unit():
    rng = np.random.default_rng(3)
    for p in (1, 2, 5):
        one, other = (impacts(rng.random(p), rng.random(p)) for _ in range(2))
        assert orbit_distance(one, other) == pytest.approx(orbit_distance(other, one))
        faster = [impacts(cycle.phases, 1e6 * cycle.velocities) for cycle in (one, other)]
        assert orbit_distance(*faster) == pytest.approx(orbit_distance(one, other))
