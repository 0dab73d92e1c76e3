"""A system that is one mass in front of one fixed rigid stop is answered by the engine of one mass."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from systems import one_mass
from vibroimpact.backends import one_mass as engine
from vibroimpact.indices import INDICES

SAMPLES = {"transient_impacts": 200, "sample_impacts": 500, "workers": 1}


def a_machine(seed, settled=False):
    """Return a system of one mass, its stop on either side, loaded and driven at any phase, and the same oscillator.

    The oscillator moves about the equilibrium under the constant load, towards its stop, with its own phase.
    """
    rng = np.random.default_rng([4001, seed])
    mass, stiffness, force = rng.uniform(0.5, 3.0, 3)
    omega = rng.uniform(0.3, 4.0) * math.sqrt(stiffness / mass)
    damping = rng.uniform(0.1, 0.4) if settled else rng.choice([0.0, 0.02, 0.2])
    bounce = rng.uniform(0.2, 0.6 if settled else 0.95)
    side, load = rng.choice([-1.0, 1.0, 2.5]), rng.choice([0.0, rng.uniform(-0.3, 0.3)])
    phase, gap = rng.choice([0.0, rng.uniform(0.0, 2.0 * math.pi)]), rng.uniform(-0.2, 0.6)
    system = vi.ImpactSystem(
        mass=mass,
        damping=damping * math.sqrt(stiffness * mass),
        stiffness=stiffness,
        force=vi.Force(omega=omega, harmonics={1: force * np.exp(1j * phase)}, constant=load),
        stops=[vi.Stop(direction=side, gap=gap, restitution=bounce)],
    )
    offset = side * load / stiffness
    turn = phase + (math.pi if side < 0.0 else 0.0)
    oscillator = vi.ImpactOscillator(
        mass=mass / side**2,
        damping=system.damping.item() / side**2,
        stiffness=stiffness / side**2,
        amplitude=force / abs(side),
        omega=omega,
        restitution=bounce,
        gap=gap - offset,
    )
    start = vi.State(min(0.0, gap) - offset, 0.0, (turn / omega) % oscillator.period)
    return system, oscillator, start


@pytest.mark.parametrize("block", range(4))
def test_its_indices_are_those_of_the_oscillator_that_it_is(block):
    settled = 0
    for seed in range(10 * block, 10 * block + 10):
        system, oscillator, start = a_machine(seed)
        for omega in system.omega * np.linspace(0.9, 1.1, 5):
            there = vi.State(start.displacement, 0.0, start.time * system.omega / omega)
            ours = vi.parameter_map(system, omega=[omega], indices=tuple(INDICES), **SAMPLES)
            theirs = vi.parameter_map(oscillator, omega=[omega], indices=tuple(INDICES), start=there, **SAMPLES)
            if theirs["n_periods"] == 0 or theirs["lyapunov"] > -0.02 * system.omega:
                continue  # chaos, or hardly attracting: rounding grows
            settled += 1
            assert ours["status"] == theirs["status"]
            for name in INDICES:
                near = {"rel": 1e-6, "abs": 1e-9 * float(theirs["max_velocity"].fillna(1.0)[0])}
                assert float(ours[name][0]) == pytest.approx(float(theirs[name][0]), **near, nan_ok=True), (seed, name)
    assert settled > 10


@pytest.mark.parametrize("seed", range(20))
def test_its_motions_are_those_of_the_engine_of_systems(seed, request):
    """Rounding has not grown by then: the motions are strongly damped, and few impacts long."""
    system, _, _ = a_machine(seed, settled=True)
    looks = {"transient_periods": 3, "sample_periods": 6, "phase": 0.3 * (seed % 2)}

    def motions():
        return [
            vi.simulate(system, periods=3),
            vi.simulate(system, periods=3, skip_periods=5, samples_per_period=7),
            vi.impact_section(system, transient_impacts=2, sample_impacts=9),
            vi.stroboscopic_section(system, **looks),
        ]

    ours = motions()
    request.getfixturevalue("modal_engine")
    for mine, theirs in zip(ours, motions(), strict=True):
        assert mine.sizes == theirs.sizes
        for name in mine.variables:
            assert mine[name].dims == theirs[name].dims
            assert str(mine[name].attrs) == str(theirs[name].attrs)
            if mine[name].dtype.kind == "f":
                assert mine[name].values == pytest.approx(theirs[name].values, rel=1e-7, abs=1e-8, nan_ok=True), name
            else:
                assert mine[name].values.tolist() == theirs[name].values.tolist()


def test_chaos_has_the_same_statistics_by_both_engines(request):
    system = one_mass(vi.ImpactOscillator(omega=2.8))
    names = "std", "mean_velocity", "impacts_per_period", "lyapunov", "dissipation"
    ours, theirs = [], []
    for found in ours, theirs:
        found += [
            vi.parameter_map(system, omega=[2.8], indices=names, sample_impacts=100_000, start=vi.State(-x))
            for x in (0.1, 0.2, 0.3, 0.4)
        ]
        if found is ours:
            request.getfixturevalue("modal_engine")
    for name in names:
        mine, other = ([float(one[name][0]) for one in found] for found in (ours, theirs))
        spread = np.std(mine + other)
        assert abs(np.mean(mine) - np.mean(other)) < 3.0 * spread, name


@pytest.mark.parametrize(
    ("change", "is_one"),
    [
        ({}, True),
        ({"force": vi.Force(omega=2.0)}, True),
        ({"force": vi.Force(omega=2.0, harmonics={1: 1.0, 3: 0.1})}, False),
        ({"stiffness": 0.0, "damping": 0.1}, False),
        ({"stops": [vi.Stop(direction=-2.0, gap=0.1, restitution=0.5)]}, True),
        ({"stops": [vi.Stop(direction=1.0, gap=0.1, stiffness=100.0)]}, False),
        ({"stops": [vi.Stop(direction=1.0, gap=0.1, restitution=lambda speed: 0.5)]}, False),
        ({"stops": [vi.Stop(direction=1.0, gap=0.1, restitution=0.5, motion={1: 0.01})]}, False),
        ({"stops": [vi.Stop(direction=1.0, gap=0.1), vi.Stop(direction=-1.0, gap=0.1)]}, False),
    ],
)
def test_what_counts_as_one_mass(change, is_one):
    assert engine.is_one_mass(one_mass(vi.ImpactOscillator(gap=0.3), **change).cells({})).all() == is_one


def test_in_one_table_each_cell_has_the_engine_that_it_has_alone():
    """A stiffness of zero is for the engine of systems: what a cell hangs on is its own numbers, not its neighbours."""
    osc = vi.ImpactOscillator(omega=2.8, gap=0.1)
    designs = [one_mass(osc, stiffness=stiffness, damping=0.1) for stiffness in (1.0, 0.0, 2.0, 0.0)]
    cells = type(designs[0]).cells_of(designs)
    assert engine.is_one_mass(cells).tolist() == [True, False, True, False]
    wanted = vi.backends.Measurement(vi.backends.ImpactWindow(10, 50), indices=("std", "n_periods"), by_stop=True)
    together = vi.backends.get_backend("cpu").indices(cells, wanted)
    for row in range(4):
        alone = vi.backends.get_backend("cpu").indices(cells[row : row + 1], wanted)
        for name in ("std", "n_periods", "status"):
            assert np.array_equal(together[name][row], alone[name][0], equal_nan=True)
