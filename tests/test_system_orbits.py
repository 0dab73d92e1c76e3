"""Periodic orbits of systems: closed forms, values of 24 digits, independent flights, and roots by brute force."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

import vibroimpact as vi
from differences import derivative
from systems import (
    CHAIN,
    a_random_system,
    bouncing_ball,
    chain,
    changed,
    facing,
    impact_damper,
    linear,
    one_mass,
    two_sided,
    uncoupled,
)  # fmt: skip
from test_orbits import random_oscillator
from vibroimpact.backends.reference.systems import follow
from vibroimpact.orbits import orbit_distance, same_orbit
from vibroimpact.orbits.cycle import Cycle
from vibroimpact.orbits.events import Event
from vibroimpact.orbits.flow import Flow
from vibroimpact.orbits.one_mass import solution_of
from vibroimpact.orbits.symmetry import mirror
from vibroimpact.orbits.systems.closed_form import roots

pytestmark = pytest.mark.usefixtures("modal_engine")

SEAT = vi.Stop(direction=[1, 0], gap=0.0, restitution=0.8)


class Plain:
    """A system in its own coordinates, flown by SciPy's exponential: nothing is shared with the package's equations."""

    def __init__(self, system):
        self.system, n = system, len(system.mass)
        inverse = np.linalg.inv(system.mass)
        self.free = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ system.stiffness, -inverse @ system.damping]])
        orders = sorted(system.force.harmonics)
        constant = np.zeros(n) if system.force.constant is None else system.force.constant
        loads, turns = [constant], [np.zeros((1, 1))]
        for h in orders:
            loads += [system.force.harmonics[h].real, system.force.harmonics[h].imag]
            turns.append(h * system.omega * np.array([[0.0, 1.0], [-1.0, 0.0]]))
        size = 1 + 2 * len(orders)
        self.whole = np.zeros((2 * n + size, 2 * n + size))
        self.whole[: 2 * n, : 2 * n] = self.free
        self.whole[n : 2 * n, 2 * n :] = inverse @ np.array(loads).T
        at = 2 * n
        for turn in turns:
            self.whole[at : at + len(turn), at : at + len(turn)] = turn
            at += len(turn)
        self.orders, self.n, self.inverse = orders, n, inverse

    def fly(self, x, begin, end):
        drive = [1.0]
        for h in self.orders:
            drive += [math.sin(h * self.system.omega * begin), math.cos(h * self.system.omega * begin)]
        return (expm(self.whole * (end - begin)) @ np.append(x, drive))[: 2 * self.n]

    def wall(self, stop, time, order=0):
        """Return the contact value of a . q, or its rate."""
        factors = {h: by * (1j * h * self.system.omega) ** order for h, by in stop.motion.items()}
        moved = sum((by * np.exp(1j * h * self.system.omega * time)).imag for h, by in factors.items())
        return moved + (stop.gap if order == 0 else 0.0)

    def clearance(self, stop, x, time):
        return self.wall(stop, time) - stop.direction @ x[: self.n]

    def speed(self, stop, x, time):
        return stop.direction @ x[self.n :] - self.wall(stop, time, 1)

    def hit(self, stop, x, time):
        kappa = self.inverse @ stop.direction
        kappa /= stop.direction @ kappa
        return x - np.append(np.zeros(self.n), (1.0 + stop.restitution) * self.speed(stop, x, time) * kappa)

    def replayed(self, orbit):
        """Return the largest miss of an orbit's contacts and velocities, and of its return, over their sizes."""
        stops = {stop.name: stop for stop in self.system.stops}
        times = [turn * self.system.period for turn in orbit.turns]
        x = start = np.append(orbit.start.displacement, orbit.start.velocity)
        size, misses = np.abs(start).max(), []
        for i, name in enumerate(orbit.stops):
            misses.append(self.clearance(stops[name], x, times[i]) / size)
            misses.append((self.speed(stops[name], x, times[i]) - orbit.velocities[i]) / orbit.velocities[i])
            end = times[i + 1] if i + 1 < len(times) else times[0] + orbit.period
            x = self.fly(self.hit(stops[name], x, times[i]), times[i], end)
        return max(np.abs(misses).max(), np.abs(x - start).max() / size)


# Values of 24 digits


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


def test_the_ball_of_the_table_folds_and_doubles_where_it_should():
    assert len(vi.find_orbit(bouncing_ball(1.047197551198))) == 2
    assert len(vi.find_orbit(bouncing_ball(1.047197551196))) == 0
    assert vi.find_orbit(bouncing_ball(1.5268))[0].stable
    assert not any(orbit.stable for orbit in vi.find_orbit(bouncing_ball(1.5269)))


# One mass


@pytest.mark.parametrize("n", [1, 2, 3])
def test_one_coordinate_and_one_stop_have_the_orbits_of_the_oscillator(n):
    rng, count = np.random.default_rng(n), 0
    for _ in range(60):
        osc = random_oscillator(rng)
        orbits, found = vi.find_orbit(osc, n_periods=n), vi.find_orbit(one_mass(osc), n_periods=n)
        assert len(orbits) == len(found)
        for expected, orbit in zip(orbits, found, strict=True):
            assert orbit.velocities == pytest.approx(expected.velocities, rel=1e-11)
            assert orbit_distance(orbit, expected) < 1e-11
            assert np.array(orbit.multipliers) == pytest.approx(np.array(expected.multipliers), rel=1e-8, abs=1e-12)
            assert orbit.stable == expected.stable
            assert orbit.admissible == expected.admissible, (expected.message, orbit.message)
            assert orbit.determinant == pytest.approx(expected.determinant, rel=1e-12)
            assert orbit.turns == pytest.approx(expected.turns, abs=1e-11)
            assert [kind for _, kind, _ in orbit.events] == [kind for _, kind, _ in expected.events] == ["impact"]
            for known, contact in zip(expected.contacts, orbit.contacts, strict=True):
                assert contact == pytest.approx(known, rel=1e-11, nan_ok=True)
            assert (orbit.rests, orbit.pushing, orbit.symmetric) == (expected.rests, expected.pushing, False)
        count += len(found)
    assert count > 40


def test_orbits_of_all_models_are_of_one_class():
    for model in (vi.ImpactOscillator(omega=0.1), one_mass(vi.ImpactOscillator(omega=0.1)), two_sided()):
        for n_impacts in (1, -1):
            assert {type(orbit) for orbit in vi.find_orbit(model, n_impacts=n_impacts)} <= {vi.Orbit}


@pytest.mark.parametrize(("omega", "n", "p"), [(2.0, 1, 1), (0.95, 1, 2), (3.0, 2, 3)])
def test_impacts_alone_make_the_orbit_of_one_mass(omega, n, p):
    orbit = vi.find_orbit(vi.ImpactOscillator(omega=omega), n_periods=n, n_impacts=p)[0]
    made = vi.Orbit(orbit.oscillator, n, p, orbit.velocities, orbit.phases, orbit.multipliers)
    assert made.turns == pytest.approx(orbit.turns, abs=1e-14)
    assert replace(made, turns=orbit.turns, events=orbit.events) == orbit


@pytest.mark.parametrize(("omega", "n", "p"), [(0.95, 1, 2), (2.8, 2, 2), (3.0, 2, 2), (1.2, 2, 3), (0.6, 1, 3)])
def test_newton_finds_the_orbits_of_several_impacts_of_the_oscillator(omega, n, p):
    osc = vi.ImpactOscillator(omega=omega)
    expected = vi.find_orbit(osc, n_periods=n, n_impacts=p)[0]
    turns = solution_of(expected)[1][:p]
    times = (turns + 0.01 * np.cos(np.arange(p))) * osc.period
    (orbit,) = vi.find_orbit(one_mass(osc), n_periods=n, stops=["stop_1"] * p, near=times)
    assert orbit_distance(orbit, expected) < 1e-12
    assert np.array(orbit.multipliers) == pytest.approx(np.array(expected.multipliers), rel=1e-9)
    assert (orbit.name, orbit.stable, orbit.admissible) == (expected.name, expected.stable, expected.admissible)


def test_two_impacts_a_period_agree_with_50_digits(values):
    known = values["period_1_impact_2"]["w=0.95"]
    first, second = float(known["phase_frac_a"]), float(known["phase_frac_b"])
    osc = vi.ImpactOscillator(omega=0.95)
    near = osc.period * np.array([first, second + (second < first)])
    (orbit,) = vi.find_orbit(one_mass(osc), stops=["stop_1", "stop_1"], near=near + 0.02)
    assert orbit.velocities == pytest.approx((float(known["v_a"]), float(known["v_b"])), rel=1e-13)
    assert sum(orbit.multipliers).real == pytest.approx(float(known["trace"]), rel=1e-12)


def test_undamped_resonance_leaves_the_limit_velocity():
    """pi n f/((1 + r) sqrt(k m)) holds where no steady state exists, and nearly where damping is as weak as that."""
    for damping in (0.0, 1e-14, 1e-12):
        osc = vi.ImpactOscillator(
            damping=damping, omega=1.5, stiffness=2.25 * 1.3, mass=1.3, amplitude=0.7, restitution=0.6
        )
        for n, model in product((1, 2), (osc, one_mass(osc))):
            (orbit,) = vi.find_orbit(model, n_periods=n)
            limit = math.pi * n * osc.amplitude / (1.6 * math.sqrt(osc.stiffness * osc.mass))
            assert orbit.velocities[0] == pytest.approx(limit, rel=1e-11 if damping else 1e-13)


# All orbits of one impact


def by_brute_force(system, stop, n_periods, mirrored=False, points=4000):
    """Return phases and velocities > 0 from steady state and flow over the cycle, roots by a scan of the phase."""
    plain, n, w = Plain(system), len(system.mass), system.omega
    half = 0.5 if mirrored else 1.0
    flow, one = expm(plain.free * system.period * n_periods * half), np.eye(2 * n)
    kappa = plain.inverse @ stop.direction
    kick = np.append(np.zeros(n), (1.0 + stop.restitution) * kappa / (stop.direction @ kappa))
    deviation = np.linalg.solve((-one if mirrored else one) - flow, -flow @ kick)
    reach, speed = stop.direction @ deviation[:n], 1.0 - stop.direction @ deviation[n:]
    steady = {
        h: stop.direction
        @ np.linalg.solve(system.stiffness + 1j * h * w * system.damping - (h * w) ** 2 * system.mass, p)
        for h, p in system.force.harmonics.items()
    }
    constant = np.zeros(n) if system.force.constant is None else system.force.constant
    level = stop.direction @ np.linalg.solve(system.stiffness, constant)

    def of(phase):
        turn = 2j * np.pi * phase
        moved = sum((c * np.exp(h * turn)).imag for h, c in steady.items())
        rate = sum((1j * h * w * c * np.exp(h * turn)).imag for h, c in steady.items())
        time = phase * system.period
        return plain.wall(stop, time) - level - moved, rate - plain.wall(stop, time, 1)

    def miss(phase):
        clearance, rate = of(phase)
        return clearance * speed - rate * reach

    phases = np.arange(points + 1) / points
    values, found = miss(phases), []
    for i in np.flatnonzero(np.diff(np.sign(values))):
        phase = brentq(miss, phases[i], phases[i + 1], xtol=1e-16)
        velocity = of(phase)[1] / speed
        if velocity > 0.0:
            found.append((phase, velocity))
    return sorted(found)


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


def a_symmetric_system(rng, n):
    system = a_random_system(rng, n, s=1)
    (stop,), force = system.stops, system.force
    motion = {1: 0.1 + 0.2j, 2: 0.05}
    stops = [
        stop.replace(motion=motion, name="above"),
        stop.replace(
            direction=-2.0 * stop.direction, gap=2.0 * stop.gap, motion={1: -0.2 - 0.4j, 2: 0.1}, name="below"
        ),
    ]
    load = vi.Force(omega=force.omega, harmonics=dict(force.harmonics))
    return vi.ImpactSystem(**system.arguments() | {"force": load, "stops": stops})


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


# Stability


def sections_of_systems():
    rng = np.random.default_rng(7)
    for n in (1, 2, 3, 6):
        for system in (a_random_system(rng, n), a_symmetric_system(rng, n)):
            yield system, vi.find_orbit(system, n_periods=int(rng.integers(1, 3)))


def test_the_determinant_is_that_of_restitution_and_damping():
    count = 0
    for system, found in sections_of_systems():
        trace = np.trace(np.linalg.solve(system.mass, system.damping))
        for orbit in found:
            r = system.stops[system.stop_names.index(orbit.stops[0])].restitution
            expected = r**2 * math.exp(-trace * orbit.period)
            assert orbit.determinant == pytest.approx(expected, rel=1e-11)
            assert np.prod(orbit.multipliers).real == pytest.approx(expected, rel=1e-10, abs=1e-13)
            assert np.prod(orbit.multipliers).imag == pytest.approx(0.0, abs=1e-13)
            assert len(orbit.multipliers) == 2 * len(system.mass)
            count += 1
    assert count >= 15


def differences(system, orbit, step=1e-6):
    """Return the Jacobian of the motion over a cycle, from before its first impact, by differences of plain flights."""
    plain, stops = Plain(system), {stop.name: stop for stop in system.stops}
    times = [turn * system.period for turn in orbit.turns]
    flights = np.diff([*times, times[0] + orbit.period])
    early = 0.02 * flights.min()
    begin = times[0] - early
    start = plain.fly(np.append(orbit.start.displacement, orbit.start.velocity), times[0], begin)

    def after(x):
        now = begin
        for name, time in zip(orbit.stops, times, strict=True):

            def gap(at, x=x, now=now, stop=stops[name]):
                return plain.clearance(stop, plain.fly(x, now, at), at)

            hit = brentq(gap, time - 0.5 * early, time + 0.5 * early, xtol=1e-15)
            x, now = plain.hit(stops[name], plain.fly(x, now, hit), hit), hit
        return plain.fly(x, now, begin + orbit.period)

    return derivative(after, start, step * np.abs(start).max())


def test_multipliers_are_those_of_differences_between_neighbouring_motions():
    count = 0
    for system, found in sections_of_systems():
        if len(system.mass) > 3:
            continue
        for orbit in [*found, *vi.find_orbit(two_sided(), symmetric=True)][:4]:
            jacobian = differences(orbit.system, orbit)
            size = np.abs(np.poly(jacobian)).max()
            assert np.poly(np.array(orbit.multipliers)) == pytest.approx(np.poly(jacobian), abs=1e-6 * size)
            count += 1
    assert count >= 15


def test_a_symmetric_orbit_has_squares_of_the_multipliers_of_its_half():
    (orbit,) = vi.find_orbit(impact_damper(), stops="above", symmetric=True)
    jacobian = differences(orbit.system, orbit)
    assert np.poly(np.array(orbit.multipliers)) == pytest.approx(np.poly(jacobian), abs=1e-6)
    assert np.array(orbit.half_multipliers) ** 2 == pytest.approx(np.array(orbit.multipliers), rel=1e-14)


def test_without_any_loss_no_orbit_attracts():
    one = vi.ImpactOscillator(damping=0.0, omega=2.7, restitution=1.0)
    assert vi.find_orbit(one)
    for model, n in product((chain(1.0, damping=0.0), one), (1, 2, 3)):
        for orbit in vi.find_orbit(model, n_periods=n):
            assert orbit.determinant == 1.0
            assert np.prod(orbit.multipliers).real == pytest.approx(1.0, rel=1e-11)
            inverse = sorted(abs(1.0 / value) for value in orbit.multipliers)  # of a conservative motion in pairs
            assert inverse == pytest.approx(sorted(abs(value) for value in orbit.multipliers), rel=1e-9)
            assert not orbit.stable


def test_an_impact_without_rebound_loses_one_dimension():
    for osc, rests in (
        (vi.ImpactOscillator(restitution=0.0, omega=0.7), True),
        (vi.ImpactOscillator(restitution=0.0, omega=2.5), False),
    ):
        orbits, found = vi.find_orbit(osc)[0], vi.find_orbit(one_mass(osc))[0]
        assert orbit_distance(orbits, found) < 1e-13
        assert found.determinant == 0.0
        assert abs(found.multipliers[1]) < 1e-14
        assert (
            (found.message == "after impact 1 the system comes to rest at 'stop_1'") == rests == (not orbits.admissible)
        )


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


def test_a_nearly_free_mass_keeps_its_digits():
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
    first, second = vi.find_orbit(one_mass(osc), n_periods=4)
    assert first.velocities[0] == pytest.approx(0.00010435060552674233, rel=1e-11)
    assert second.velocities[0] == pytest.approx(0.00010435050679215172, rel=1e-11)
    assert (first.phases[0], second.phases[0]) == pytest.approx((0.6958559636453552, 0.304118792792092), abs=1e-11)


# Several impacts


def witnessed(system, start, impacts):
    """Return the impacts that the plain witness sees from a start."""
    return follow(linear(system), start.displacement, start.velocity, start.time, impacts=impacts).impacts


@pytest.mark.long(but=1)
@pytest.mark.parametrize(
    ("system", "omega", "start", "n", "names"),
    [
        (chain(), 0.5, vi.State([0.0, 0.0, 0.0]), 1, ("bar", "bar")),
        (chain(), 1.1, vi.State([0.0, 0.0, 0.0]), 2, ("bar", "bar")),
        (two_sided(), 0.8, vi.State([0.1], [0.3]), 1, ("above", "below", "below", "above")),
        (two_sided(), 1.3, vi.State([0.1], [0.3]), 1, ("above", "below")),
    ],
)
def test_newton_makes_the_orbit_of_an_attractor_from_the_times_of_its_impacts(system, omega, start, n, names):
    system = system.replace(omega=omega)
    hits = witnessed(system, start, 250)[-len(names) :]
    first = int(hits[0].time / system.period) * system.period
    (orbit,) = vi.find_orbit(system, n_periods=n, stops=names, near=[round(hit.time - first, 2) for hit in hits])
    assert orbit.velocities == pytest.approx([hit.velocity for hit in hits], rel=1e-5)
    assert orbit.impulses == pytest.approx([hit.impulse for hit in hits], rel=1e-5)
    assert (orbit.stable, orbit.admissible, orbit.n_impacts) == (True, True, len(names))
    assert orbit.symmetric == (omega == 0.8)
    assert Plain(system).replayed(orbit) < 1e-12
    again = witnessed(system, orbit.start, 2 * len(names))
    assert [hit.velocity for hit in again] == pytest.approx(2 * orbit.velocities, rel=1e-10)
    jacobian = differences(system, orbit)
    assert np.poly(np.array(orbit.multipliers)) == pytest.approx(np.poly(jacobian), abs=1e-6 * np.abs(jacobian).max())
    moved = system.replace(omega=1.01 * omega)
    (next_one,) = vi.find_orbit(moved, n_periods=n, stops=orbit.stops, near=orbit)
    assert Plain(moved).replayed(next_one) < 1e-12
    assert next_one.velocities == pytest.approx(orbit.velocities, rel=0.2)


def test_an_orbit_without_symmetry_has_a_twin_and_the_symmetric_one_between_them_is_unstable():
    system = two_sided().replace(omega=1.3)
    (orbit,) = vi.find_orbit(system, stops=["above", "below"], near=[0.3 * system.period, 0.95 * system.period])
    times = (np.array(orbit.turns) + 0.5) * system.period
    (twin,) = vi.find_orbit(system, stops=["below", "above"], near=times + 0.01)
    assert twin.velocities == pytest.approx(orbit.velocities, rel=1e-12)
    assert twin.multipliers == pytest.approx(orbit.multipliers, rel=1e-9)
    assert not orbit.symmetric
    assert orbit.stable
    between = [other for other in vi.find_orbit(system, stops="above", symmetric=True) if other.admissible]
    assert [other.half_multipliers[0].real < -1.0 for other in between] == [True]


def test_newton_knows_a_symmetric_orbit_when_it_meets_one():
    (known,) = (orbit for orbit in vi.find_orbit(two_sided(), stops="above", symmetric=True) if orbit.stable)
    times = np.array(known.turns) * two_sided().period
    (orbit,) = vi.find_orbit(two_sided(), stops=["above", "below"], near=times + np.array([0.02, -0.03]))
    assert orbit.symmetric
    assert orbit.velocities == pytest.approx(known.velocities, rel=1e-13)
    assert orbit.multipliers == pytest.approx(known.multipliers, rel=1e-12)


def test_newton_for_half_a_symmetric_cycle():
    system = two_sided().replace(omega=0.8)
    whole = vi.find_orbit(system, stops=["above", "below", "below", "above"], near=[3.07, 5.28, 7.0, 9.21])
    half = vi.find_orbit(system, stops=["above", "below"], symmetric=True, near=[3.07, 5.28])
    assert whole[0].stops == ("above", "below", "below", "above") == half[0].stops
    assert same_orbit(whole[0], half[0], tolerance=1e-12)
    assert whole[0].half_multipliers == pytest.approx(half[0].half_multipliers, rel=1e-12)
    again = vi.find_orbit(system, symmetric=True, near=whole[0])
    assert again[0].turns == pytest.approx(whole[0].turns, rel=1e-13)


@pytest.mark.parametrize("n", [1, 2, 4])
def test_the_derivatives_of_the_equations_are_those_of_differences(n):
    rng = np.random.default_rng(n)
    system = a_symmetric_system(rng, n)
    for stops, images in (((0, 1, 1, 0), ()), ((0, 1), (1, 0)), ((1,), ())):
        cycle = Cycle(Flow(system), 1, tuple(map(Event, stops)), images)
        angles = np.sort(rng.uniform(0.0, cycle.length, len(stops)))
        unknown = np.append(angles, rng.standard_normal(2 * n))
        _, matrix = cycle.linearised(unknown)
        known = derivative(lambda x, cycle=cycle: cycle.linearised(x)[0], unknown, 1e-6)
        assert known == pytest.approx(matrix, abs=1e-7 * np.abs(matrix).max())


def test_every_orbit_that_newton_reaches_from_anywhere_is_one():
    rng, outcomes = np.random.default_rng(8), []
    for _ in range(35):
        system, p = a_random_system(rng, int(rng.integers(1, 4))), int(rng.integers(2, 4))
        stops = rng.choice(system.stop_names, p).tolist()
        orbits = vi.find_orbit(system, n_periods=2, stops=stops, near=2.0 * system.period * (np.arange(p) + 0.1) / p)
        outcomes.append(orbits.outcome)
        assert orbits.message
        for orbit in orbits:
            assert Plain(system).replayed(orbit) < 1e-9
            assert orbit.stops == tuple(stops)
            assert orbit.admissible or orbit.message
    assert outcomes.count("found") + outcomes.count("inadmissible") >= 10


def test_a_shorter_orbit_is_recognised():
    (known,) = (orbit for orbit in vi.find_orbit(chain()) if orbit.stable)
    period = chain().period
    orbits = vi.find_orbit(
        chain(), n_periods=2, stops=["bar", "bar"], near=[(known.turns[0] + k) * period for k in (0, 1)]
    )
    assert (orbits.outcome, orbits.message) == (
        "other_name",
        "converged to a period-1 impact-1 orbit instead of a period-2 impact-2 one",
    )


# Admissibility


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


@pytest.mark.parametrize("restitution", [1e-6, 1e-4, 3e-3])
def test_a_second_touch_right_after_a_weak_rebound_is_seen(restitution):
    """Shortly before the force pulls the mass away, it presses it back; the mass leaves for good within one sample."""
    seen = []
    for omega in np.linspace(1.2, 2.2, 200):
        osc = vi.ImpactOscillator(omega=omega, gap=0.3, damping=0.5, restitution=restitution)
        for orbit, same in zip(vi.find_orbit(osc), vi.find_orbit(one_mass(osc)), strict=True):
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


# Where orbits are not isolated, or none exists


def free_pair(constant=None, harmonic=0.0):
    """Return a mass in front of a stop, and a free one between stops far away."""
    return uncoupled(
        [0.1, 0.0], [1.0, 0.0], [SEAT, vi.Stop(direction=[0, 1], gap=9.0)], [1.0, harmonic], constant=constant
    )


@pytest.mark.parametrize(
    ("system", "n", "why"),
    [
        (one_mass(vi.ImpactOscillator(amplitude=0.0, gap=-1.0)), 1, "unforced"),
        (one_mass(vi.ImpactOscillator(damping=0.0, omega=0.5)), 1, "whole number of periods of an undamped motion"),
        (one_mass(vi.ImpactOscillator(damping=0.0, omega=2.0)), 2, "over 2 driving periods, which are a whole number"),
        (one_mass(vi.ImpactOscillator(damping=0.0, restitution=1.0, omega=2.0, amplitude=0.0)), 1, "without loss"),
        (one_mass(vi.ImpactOscillator(damping=0.0, restitution=1.0)), 1, "grow without bound"),
        (one_mass(vi.ImpactOscillator(gap=5.0)), 1, "no velocity > 0 returns to itself after 1 driving period"),
        (
            free_pair(),
            1,
            "free mass or rigid-body motion, which does not change the clearance of the stop, can be anywhere",
        ),
        (free_pair(constant=[0.0, 1.0]), 1, "driven away by the load"),
        (two_sided(force=vi.Force(omega=2.0)), 1, "unforced"),
    ],
)
def test_where_there_is_no_isolated_orbit_the_reason_is_given(system, n, why):
    orbits = vi.find_orbit(system, n_periods=n)
    assert (list(orbits), orbits.outcome) == ([], "none")
    assert why in orbits.message


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
        ([upper], False),
        ([], True),
    ):
        images, why = mirror(two_sided(stops=stops))
        assert (why == "") == symmetric
        assert len(images) == (len(stops) if symmetric else 0)
    assert "even harmonic 4" in mirror(two_sided(force=vi.Force(omega=2.0, harmonics={4: 1.0})))[1]
    assert "constant" in mirror(two_sided(force=vi.Force(omega=2.0, constant=1.0)))[1]
    orbits = vi.find_orbit(two_sided(stops=[upper]), symmetric=True)
    assert (orbits.outcome, orbits.message) == ("none", "not symmetric: no stop is the mirror image of 'above'")


# Identities


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


def test_what_cannot_be_asked_for_is_refused():
    for arguments, words in (
        ({"stops": "middle"}, "unknown `stops` 'middle'; choose from above, below"),
        ({"stops": ["above", "below"]}, "orbits of several impacts need a guess"),
        ({"stops": ["above", "below"], "near": [0.1]}, "one time for each of the 2 stops"),
        ({"stops": ["above", "below"], "near": [0.1, 4.0]}, "times in order, within 3.14159 s"),
        ({"n_periods": 2, "symmetric": True}, "odd for symmetric motions"),
        ({"n_periods": 0}, "a whole number >= 1"),
        ({"stops": []}, "stops to strike"),
    ):
        with pytest.raises(ValueError, match=words.replace("(", "\\(")):
            vi.find_orbit(two_sided(), **arguments)
    with pytest.raises(ValueError, match="stops to strike"):
        vi.find_orbit(two_sided(stops=[]))


@pytest.mark.parametrize(
    "osc", [vi.ImpactOscillator(omega=2.0), vi.models.impact_damper()], ids=["one mass", "a system"]
)
def test_an_orbit_tells_its_motion_at_one_time_as_at_several(osc):
    orbit = vi.find_orbit(osc, n_impacts=2 if osc.coordinates == 2 else 1)[0]
    for one, several in zip(orbit.motion(0.1), orbit.motion([0.1, 0.2]), strict=True):
        assert np.ravel(one) == pytest.approx(np.ravel(several[0]), rel=1e-15)
