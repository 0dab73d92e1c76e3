"""Scaling identities on whole maps and verdicts: sticking and chaotic motions included."""

import os

import numpy as np
import pytest

import vibroimpact as vi
from designs import random_designs
from systems import STEEL, a_random_system, chain, changed, free_masses, on_springs, sticking, system, two_masses
from vibroimpact.coexistence.measuring import Runner
from vibroimpact.indices import INDICES as EVERY_INDEX
from vibroimpact.model.scales import scale_of
from vibroimpact.verdict.boundaries import nearest_boundaries
from vibroimpact.verdict.branches import Branches
from vibroimpact.verdict.present import present_motion
from vibroimpact.verdict.ranges import range_of

OMEGA = np.linspace(0.1, 5.0, 15)
MASS = np.linspace(0.2, 4.0, 5)
INDICES = ("std", "mean_velocity", "max_velocity", "impacts_per_period")
BASE = {"damping": 0.01, "stiffness": 1.0, "amplitude": 1.0, "gap": -0.05}


def sweep(omega, mass, **parameters):
    osc = vi.ImpactOscillator(**{**BASE, **parameters})
    return vi.parameter_map(osc, omega=omega, mass=mass, indices=INDICES, transient_impacts=200, sample_impacts=300)


def scaled_by_force(s):
    """(s m, s c, s k, s f) leaves the motion alone."""
    return sweep(OMEGA, s * MASS, damping=s * 0.01, stiffness=s, amplitude=s), 1.0


def scaled_by_length(s):
    """(s f, s g) scales displacements and velocities by s."""
    return sweep(OMEGA, MASS, amplitude=s, gap=-0.05 * s), s


def scaled_by_time(s):
    """(m / s^2, c / s, k, f, s w) sends t to t / s and velocities to s times themselves."""
    return sweep(s * OMEGA, MASS / s**2, damping=0.01 / s), s


SCALINGS = [scaled_by_force, scaled_by_length, scaled_by_time]


@pytest.fixture(scope="module")
def plain():
    return sweep(OMEGA, MASS)


@pytest.mark.parametrize("scaling", SCALINGS)
@pytest.mark.parametrize("factor", [0.25, 2.0, 1024.0])
def test_powers_of_two_scale_every_cell_bit_for_bit(plain, scaling, factor):
    scaled, velocity = scaling(factor)
    assert {0, 2} <= set(np.unique(plain["status"]))
    assert np.array_equal(scaled["status"], plain["status"])
    for name in ("std", "mean_velocity", "max_velocity"):
        assert np.array_equal(scaled[name], velocity * plain[name], equal_nan=True)
    assert np.array_equal(scaled["impacts_per_period"], plain["impacts_per_period"], equal_nan=True)


@pytest.mark.parametrize("scaling", SCALINGS)
@pytest.mark.parametrize("factor", [0.3, 7.0])
def test_other_factors_scale_settled_cells_to_rounding(plain, scaling, factor):
    scaled, velocity = scaling(factor)
    settled = plain["std"].values < 1e-10
    assert settled.sum() > 10
    for name in ("std", "mean_velocity", "max_velocity"):
        assert scaled[name].values[settled] == pytest.approx(
            velocity * plain[name].values[settled], abs=1e-9 * velocity
        )


def drawn_with(n):
    """Return a random system of n coordinates, which damping couples, in front of its stops at rest."""
    rng = np.random.default_rng(n)
    while (model := a_random_system(rng, n)).clearances(np.zeros(n)).min() < 0.0:
        pass
    return model


LINKS = [vi.Stop(direction=a, gap=0.5) for a in ([1, -1, 0], [-1, 1, 0], [0, 1, -1], [0, -1, 1])]
SYSTEMS_OF_ANY_KIND = {
    "a chain": chain(),
    "a moving stop, a constant load": two_masses(),
    "rests": sticking(),
    "free masses": free_masses(0),
    "modes of one frequency": system(np.diag([0.3, 1.1, 0.7]), 0, np.zeros((3, 3)), 1.0, LINKS, {1: [1.0, -1.0, 0.5]}),
    "six coordinates": drawn_with(6),
    **{f"on springs, seed {seed}": on_springs(np.random.default_rng([3803, seed])) for seed in range(8)},
}


@pytest.mark.parametrize("unit", ["mass", "length", "time", "all"])
@pytest.mark.parametrize("name", SYSTEMS_OF_ANY_KIND)
def test_powers_of_two_scale_every_cell_of_a_system_bit_for_bit(name, unit):
    system, powers = SYSTEMS_OF_ANY_KIND[name], {"mass": 2.0**-7, "length": 2.0**9, "time": 2.0**5}
    powers = {one: power if unit in (one, "all") else 1.0 for one, power in powers.items()}
    mass, length, time = powers.values()
    window = {"indices": tuple(EVERY_INDEX), "transient_impacts": 50, "sample_impacts": 100}
    omega = system.omega * np.linspace(0.5, 2.0, 12)
    plain = vi.parameter_map(system, omega=omega, **window)
    scaled = vi.parameter_map(changed(system, **powers), omega=omega / time, **window)
    units = {"m/s": length / time, "1/s": 1 / time, "J": mass * length**2 / time**2, "m": length, "1": 1.0}
    for index in ("status", *EVERY_INDEX):
        unit_of = 1.0 if index == "status" else units[EVERY_INDEX[index].units]
        assert np.array_equal(scaled[index], unit_of * plain[index], equal_nan=True), index


# Verdicts in other units

SYSTEMS = range(100) if "FUZZ" in os.environ else (0, 1, 4, 5)  # `make fuzz` asks for all


def in_units(osc, mass, length, time):
    """Return a design in other units."""
    if isinstance(osc, vi.ImpactSystem):
        return changed(osc, mass=mass, length=length, time=time)
    return osc.replace(**{name: value * unit(name, mass, length, time) for name, value in osc.values.items()})


def unit(name, mass, length, time):
    """Return what a parameter's value is multiplied by."""
    kinds = {"mass": mass, "damping": mass / time, "stiffness": mass / time**2, "amplitude": mass * length / time**2}
    return (kinds | {"omega": 1.0 / time, "gap": length, "restitution": 1.0})[name.rpartition("_")[2]]


def assert_the_same_in_units(osc, parameters, mass, length, time):
    """All that is said of a design in one unit is said of it in another; only numbers with a unit are multiplied."""
    here, there = (vi.describe(one, parameters=parameters) for one in (osc, in_units(osc, mass, length, time)))
    speed = length / time

    def words(verdict):
        edges = [(edge.parameter, edge.direction, edge.kind, edge.of, edge.beyond) for edge in verdict.boundaries]
        motions = [(one.name, one.share, one.n_periods, one.stop) for one in verdict.attractors]
        advice = [(one.parameter, one.of, one.benefit, one.motion, one.tried) for one in verdict.advice]
        return verdict.motion.name, edges, motions, advice

    def numbers(verdict, unit_of, speed):
        for edge in verdict.boundaries:
            yield from (edge.change, edge.spacing)
            yield from (x * unit_of(edge.parameter) for x in (edge.value, edge.searched_to, edge.beyond_at))
        for motion in verdict.attractors:
            yield motion.max_velocity * speed
        for one in verdict.advice:
            yield from (one.change, one.value * unit_of(one.parameter), one.max_velocity * speed, one.before * speed)

    assert words(here) == words(there), (osc, mass, length, time)
    expected = [*numbers(here, lambda name: unit(name, mass, length, time), speed)]
    assert [*numbers(there, lambda name: 1.0, 1.0)] == pytest.approx(expected, rel=1e-9, nan_ok=True)


@pytest.mark.long
@pytest.mark.parametrize("seed", SYSTEMS)
def test_a_verdict_on_a_system_does_not_depend_on_units(seed):
    rng = np.random.default_rng([3801, seed])
    system, powers = on_springs(rng), 2.0 ** rng.integers(-9, 10, 3)
    zeros = [name for name, value in system.values.items() if value == 0.0]
    assert_the_same_in_units(system, [rng.choice(zeros or list(system.values))], *powers.tolist())


@pytest.mark.long(but=1)
@pytest.mark.parametrize("seed", range(100 if "FUZZ" in os.environ else 11))
def test_a_verdict_on_one_mass_does_not_depend_on_units(seed):
    rng = np.random.default_rng([3802, seed])
    (osc,), powers = random_designs(rng, 1), 2.0 ** rng.integers(-9, 10, 3)
    osc = osc.replace(**{str(rng.choice(["damping", "restitution", "gap"])): 0.0})
    assert_the_same_in_units(osc, sorted({"gap", str(rng.choice(list(osc.values)))}), *powers.tolist())


@pytest.mark.long
def test_boundaries_are_the_same_in_metres_and_in_millimetres():
    """N, m, kg and N, mm, t: a gap of 0 is compared with the static deflection f/k, damping with the critical one."""
    gap, damping = "stop_1_gap", "stop_1_damping"
    here, there = (
        nearest_boundaries(
            present_motion(one, Runner()), [range_of(one, name, 3.0) for name in (gap, damping)], Runner(), Branches()
        )
        for one in (STEEL, in_units(STEEL, 1e-3, 1e3, 1.0))
    )
    assert [(edge.kind, edge.of) for edge in here] == [(edge.kind, edge.of) for edge in there]
    assert [edge.change for edge in here] == pytest.approx([edge.change for edge in there], rel=1e-9, nan_ok=True)
    down, up, *_ = here
    assert (down.kind, down.of, down.change) == (
        "grazing",
        "the static deflection",
        pytest.approx(down.value / (5 / 2e4)),
    )
    assert (up.kind, up.value) == ("fold", pytest.approx(0.672389e-3, rel=1e-6))


def test_a_parameter_of_a_family_that_is_zero_is_compared_with_what_changes_the_design_as_much():
    """Half a millimetre of clearance is as much as the deflection f/k; as much force as there is doubles it."""

    def shaker(clearance_mm=0.0, more=0.0, ratio=0.0):
        return vi.ImpactOscillator(
            mass=2.0, stiffness=2e4, damping=400.0 * ratio, amplitude=10.0 + more, omega=150.0, gap=clearance_mm / 1e3
        )

    sizes = {name: scale_of(vi.family(shaker), name, 0.0).size for name in ("clearance_mm", "more", "ratio")}
    assert sizes == pytest.approx({"clearance_mm": 0.5, "more": 10.0, "ratio": 0.05})
