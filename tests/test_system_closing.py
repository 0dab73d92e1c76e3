"""Cells of systems that end once their cycle is certain say what all their impacts would have said."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from systems import one_mass
from test_system_exponents import between_stops, chain
from vibroimpact.indices import INDICES, VELOCITY_INDICES

pytestmark = pytest.mark.usefixtures("modal_engine")

ALL = tuple(INDICES)
SPEEDS = tuple(sorted(VELOCITY_INDICES))
EXPONENTS = ("lyapunov", "lyapunov_per_impact")
TURNS = ("n_periods", "n_impacts")  # not numbers that converge


def sticking():
    """Return two coupled masses, one of which comes to rest at a stop: the other remembers."""
    return vi.ImpactSystem(
        mass=np.eye(2),
        damping=[[0.05, -0.02], [-0.02, 0.05]],
        stiffness=[[2.0, -1.0], [-1.0, 2.0]],
        force=vi.Force(omega=0.4, harmonics={1: [1.0, -0.8j]}),
        stops=[
            vi.Stop(direction=[1, 0], gap=0.0, restitution=0.0),
            vi.Stop(direction=[0, 1], gap=0.3, restitution=0.6),
        ],
    )


SYSTEMS = {
    "a chain at a stop": (chain(), np.linspace(0.6, 1.2, 9)),
    "between two stops": (between_stops(1.0), np.linspace(0.95, 1.2, 6)),
    "sticking": (sticking(), np.linspace(0.35, 0.5, 6)),
    "a compliant stop": (vi.models.bilinear_oscillator(), None),
}


def both(model, indices, omega, **settings):
    axis = {"omega": omega if omega is not None else model.omega * np.linspace(0.8, 1.2, 5)}
    settings |= {"indices": indices} | axis
    return [vi.parameter_map(model, early_closing=early, **settings) for early in (True, False)]


def agree(closed, stepped, names):
    """Check every index of every cell to 1e-11 of its size over the map, bitwise where nothing closed.

    But for exponents: a cell that closed has that of its cycle, the other an average along the orbit.
    """
    same = closed["status"].values == stepped["status"].values
    assert (closed["status"].values[~same] == vi.Status.CLOSED).all()
    for name in names:
        a, b = closed[name].values, stepped[name].values
        known = np.isfinite(b)
        assert np.array_equal(a[~known], b[~known], equal_nan=True), name
        scale = max(1.0, np.abs(b[known]).max(initial=0.0))
        near = 1e-11 * scale if name not in EXPONENTS else math.inf
        assert a[known] == pytest.approx(b[known], rel=0.0, abs=near), name


@pytest.mark.long(but=4)
@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("indices", [SPEEDS, ALL], ids=["speeds", "all"])
def test_every_index_is_the_same_with_and_without(name, indices):
    closed, stepped = both(SYSTEMS[name][0], indices, SYSTEMS[name][1])
    agree(closed, stepped, indices)
    assert (stepped["status"].values != vi.Status.CLOSED).all()
    assert closed.attrs["impacts_computed"] < 0.5 * stepped.attrs["impacts_computed"]
    assert closed.attrs["steps_computed"] < 0.5 * stepped.attrs["steps_computed"]


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_cell_that_closes_has_the_exponent_of_its_orbit(name):
    model, omegas = SYSTEMS[name]
    axis = {"omega": [model.omega] if omegas is None else omegas}
    sweep = vi.parameter_map(model, **axis, indices=ALL, transient_impacts=1500)
    compared = 0
    for omega in sweep["omega"].values[sweep["n_periods"].values > 0]:
        there, cell = model.replace(omega=float(omega)), sweep.sel(omega=omega)
        p = -1 if int(cell["status"]) == vi.Status.STICKING else int(cell["n_impacts"])
        for orbit in vi.find_orbit(there, n_periods=int(cell["n_periods"]), n_impacts=p):
            if orbit.stable and max(orbit.velocities) == pytest.approx(float(cell["max_velocity"]), rel=1e-6):
                compared += 1
                assert float(cell["lyapunov"]) == pytest.approx(orbit.lyapunov, rel=1e-7)
                per_period = float(cell["lyapunov_per_impact"] * cell["impacts_per_period"])
                assert per_period == pytest.approx(orbit.lyapunov * there.period, rel=1e-7)
    assert compared > 0


@pytest.mark.parametrize("transient", [0, 7, 1000])
@pytest.mark.parametrize("sample", [61, 500, 4000])
def test_windows_that_begin_and_end_in_mid_cycle(transient, sample):
    closed, stepped = both(
        between_stops(1.0), ALL, np.linspace(0.98, 1.2, 4), transient_impacts=transient, sample_impacts=sample
    )
    agree(closed, stepped, ALL)


@pytest.mark.parametrize("transient", [36, 100, 500, 1000, 1020, 2040])
@pytest.mark.parametrize("sample", [60, 535, 2000])
def test_a_chatter_of_every_period_has_its_name_and_its_rest_wherever_a_window_begins(transient, sample):
    # Every power of two of impacts another one is watched: 512, 1024 and 2048 lie within turns that are closed.
    ball = vi.models.bouncing_ball(restitution=0.43)
    closed, stepped = both(
        ball, ALL, ball.omega * np.linspace(0.96, 1.0, 6), transient_impacts=transient, sample_impacts=sample
    )
    for found in (closed, stepped):
        assert (found["n_periods"] == 1).all()
        assert (found["n_impacts"] == -1).all()
    agree(closed, stepped, ALL)


MACHINES = ("bouncing_ball", "idle_gear", "two_sided_oscillator", "impact_damper", "tuned_mass_damper", "gear_pair")


@pytest.mark.long(but=4)
@pytest.mark.parametrize("seed", range(12))
def test_random_windows_of_machines_say_what_all_their_impacts_say(seed):
    rng = np.random.default_rng([1201, seed])
    machine = getattr(vi.models, MACHINES[seed % len(MACHINES)])()
    bounces = [name for name in machine.values if name.endswith("restitution")]
    machine = machine.replace(**dict(zip(bounces, rng.uniform(0.05, 0.9, len(bounces)), strict=True)))
    window = {"transient_impacts": int(rng.integers(0, 1100)), "sample_impacts": int(rng.integers(50, 3000))}
    closed, stepped = both(machine, ALL, np.sort(machine.omega * rng.uniform(0.7, 1.4, 12)), **window)
    agree(closed, stepped, ALL)


def test_what_settles_early_costs_a_small_part_of_its_impacts():
    closed, stepped = both(one_mass(vi.ImpactOscillator()), SPEEDS, [1.0, 2.0, 2.4])
    assert closed["status"].values.tolist() == [vi.Status.CLOSED] * 3
    assert closed.attrs["impacts_computed"] < 0.1 * stepped.attrs["impacts_computed"]
    agree(closed, stepped, SPEEDS)


def test_a_rest_that_leaves_a_memory_is_closed_by_its_multipliers():
    closed, stepped = both(sticking(), ALL, [0.4])
    assert closed["status"].item() == stepped["status"].item() == vi.Status.STICKING
    assert closed.attrs["impacts_computed"] < 0.3 * stepped.attrs["impacts_computed"]


def test_a_chatter_that_erases_all_memory_is_closed_after_few_of_its_rests():
    """Neighbours part on the way to each rest, but each cycle begins anew: what is left out repeats to rounding."""
    closed, stepped = both(vi.models.idle_gear(), SPEEDS, [138.0, 140.64, 143.0])
    assert closed["status"].values.tolist() == stepped["status"].values.tolist() == [vi.Status.STICKING] * 3
    assert closed.attrs["impacts_computed"] < 0.4 * stepped.attrs["impacts_computed"]
    agree(closed, stepped, SPEEDS)


@pytest.mark.parametrize("indices", [SPEEDS, ALL], ids=["speeds", "all"])
def test_what_does_not_settle_has_all_its_impacts(indices):
    """Chaos of one mass, quasi-periodic motions of two, and a motion that keeps its energy."""
    lossless = one_mass(vi.ImpactOscillator(damping=0.0, restitution=1.0))
    for model, omega in ((one_mass(vi.ImpactOscillator()), 2.8), (between_stops(0.96), 0.96), (lossless, 0.7)):
        closed, stepped = both(model, indices, [omega], sample_impacts=3000)
        assert closed["status"].item() == vi.Status.OK
        assert closed.attrs["impacts_computed"] == stepped.attrs["impacts_computed"]
        for name in indices:
            assert np.array_equal(closed[name].values, stepped[name].values, equal_nan=True)
