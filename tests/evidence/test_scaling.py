"""Scaling identities on whole maps and verdicts: sticking and chaotic motions included."""

import os

import numpy as np
import pytest

import vibroimpact as vi
from designs import random_designs
from systems import (
    STEEL,
    a_random_system,
    chain,
    changed,
    free_masses,
    on_springs,
    random_pair,
    sticking,
    system,
    two_masses,
)
from vibroimpact.coexistence.measuring import Runner
from vibroimpact.indices import INDICES
from vibroimpact.model.scales import scale_of
from vibroimpact.verdict.boundaries import nearest_boundaries
from vibroimpact.verdict.branches import Branches
from vibroimpact.verdict.present import present_motion
from vibroimpact.verdict.ranges import range_of


def drawn_with(n):
    """Return a random system of n coordinates, which damping couples, in front of its stops at rest."""
    rng = np.random.default_rng(n)
    while (model := a_random_system(rng, n)).clearances(np.zeros(n)).min() < 0.0:
        pass
    return model


LINKS = [vi.Stop(direction=a, gap=0.5) for a in ([1, -1, 0], [-1, 1, 0], [0, 1, -1], [0, -1, 1])]
ONE_MASS = vi.ImpactOscillator(omega=2.5, damping=0.2, restitution=0.6, gap=-0.05)
MODELS = {
    "one mass": ONE_MASS,
    "one mass, chaos": vi.ImpactOscillator(omega=2.8, gap=-0.05),
    "one mass that rests": ONE_MASS.replace(omega=0.4, restitution=0.2),
    "a chain": chain(),
    "a moving stop, a constant load": two_masses(),
    "rests": sticking(),
    "free masses": free_masses(0),
    "modes of one frequency": system(np.diag([0.3, 1.1, 0.7]), 0, np.zeros((3, 3)), 1.0, LINKS, {1: [1.0, -1.0, 0.5]}),
    "six coordinates": drawn_with(6),
    **{f"on springs, seed {seed}": on_springs(np.random.default_rng([3803, seed])) for seed in range(8)},
}


def mapped_in_units(model, mass, length, time):
    """Yield each index of a map as it is in other units, and as it would be by its unit."""
    how = {"indices": tuple(INDICES), "transient_impacts": 200, "sample_impacts": 300}
    omega = model.omega * np.linspace(0.5, 2.0, 12)
    plain = vi.parameter_map(model, omega=omega, **how)
    scaled = vi.parameter_map(in_units(model, mass, length, time), omega=omega / time, **how)
    units = {"m/s": length / time, "1/s": 1 / time, "J": mass * length**2 / time**2, "m": length, "1": 1.0}
    for index in ("status", *INDICES):
        yield (
            index,
            scaled[index].values,
            (1.0 if index == "status" else units[INDICES[index].units]) * plain[index].values,
        )


@pytest.mark.parametrize("unit", ["mass", "length", "time", "all"])
@pytest.mark.parametrize("name", MODELS)
def test_powers_of_two_scale_every_cell_bit_for_bit(name, unit):
    powers = {"mass": 2.0**-7, "length": 2.0**9, "time": 2.0**5}
    powers = {one: power if unit in (one, "all") else 1.0 for one, power in powers.items()}
    for index, found, expected in mapped_in_units(MODELS[name], **powers):
        assert np.array_equal(found, expected, equal_nan=True), index
        assert index != "status" or vi.Status.STICKING in found or "rests" not in name


@pytest.mark.parametrize("unit", ["mass", "length", "time"])
@pytest.mark.parametrize("factor", [0.3, 7.0])
def test_other_factors_scale_cycles_to_rounding(unit, factor):
    units = {"mass": 1.0, "length": 1.0, "time": 1.0} | {unit: factor}
    found = {index: values for index, *values in mapped_in_units(ONE_MASS, **units)}
    speed = units["length"] / units["time"]
    settled = found["std"][1] < 1e-10 * speed
    assert settled.sum() > 8
    for name in ("std", "mean_velocity", "max_velocity"):
        there, here = found[name]
        assert there[settled] == pytest.approx(here[settled], abs=1e-9 * speed)


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


@pytest.mark.parametrize("model", [vi.ImpactOscillator(omega=1.4), random_pair(10)], ids=["one mass", "two masses"])
def test_a_verdict_in_micrometres_and_milliseconds_has_the_same_words(model):
    assert_the_same_in_units(model, ["omega"], 1.0, 1e-6, 1e-3)


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
