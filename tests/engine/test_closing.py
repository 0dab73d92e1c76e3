"""Cells that end once their cycle is certain say what all their impacts would have said."""

import numpy as np
import pytest
from numba import njit

import vibroimpact as vi
from contents import differing
from systems import between_stops, chain, one_mass, sticking
from vibroimpact.indices import FORCES, INDICES, VELOCITY_INDICES
from vibroimpact.kernels.cell import Cell, prepare
from vibroimpact.kernels.flight import flow, product
from vibroimpact.kernels.law import saltation

OSC = vi.ImpactOscillator()
ALL, SPEEDS = tuple(INDICES), tuple(sorted(VELOCITY_INDICES))
EXPONENTS = ("lyapunov", "lyapunov_per_impact")
OMEGA = np.linspace(0.025, 5.0, 24)
PLANES = {
    "mass": np.linspace(0.1, 5.0, 12),
    "damping": np.linspace(0.005, 1.0, 12),
    "stiffness": np.linspace(0.1, 5.0, 12),
    "amplitude": np.linspace(0.1, 5.0, 12),
    "restitution": np.linspace(0.1, 0.99, 12),
}
MODELS = {
    "one mass": (OSC, OMEGA),
    "a chain at a stop": (chain(), np.linspace(0.6, 1.2, 9)),
    "between two stops": (between_stops(1.0), np.linspace(0.95, 1.2, 6)),
    "sticking": (sticking(), np.linspace(0.35, 0.5, 6)),
    "a compliant stop": (SOFT := vi.models.bilinear_oscillator(), SOFT.omega * np.linspace(0.8, 1.2, 5)),
}
EITHER = pytest.mark.parametrize("indices", [SPEEDS, ALL], ids=["speeds", "all"])


def both(model=OSC, indices=SPEEDS, **settings):
    """Return a map with early closing and one without; every cell has all indices or none, whatever its status."""
    return [vi.parameter_map(model, indices=indices, early_closing=early, **settings) for early in (True, False)]


def agree(closed, stepped, near, of_cycle=("max_velocity",), least=0.0):
    """Hold every index of every cell to `near` of its size over the map or the least, to its bits where nothing closed.

    But for exponents, and what is of the cycle alone: a cell that closed has no average along the way to it.
    """
    ours, theirs = closed["status"].values, stepped["status"].values
    assert (ours[ours != theirs] == vi.Status.CLOSED).all()
    alone = (ours == theirs) & (theirs == vi.Status.OK)
    for name in set(stepped.data_vars) - {"status"}:
        a, b = closed[name].values, stepped[name].values
        known = np.isfinite(b)
        assert np.array_equal(a[~known], b[~known], equal_nan=True), name
        assert np.array_equal(a[alone], b[alone], equal_nan=True), name
        compared = known & (alone if name in (*EXPONENTS, *of_cycle) else True)
        assert (np.abs(a[compared] - b[compared]) <= near * np.abs(b[known]).max(initial=least)).all(), name


@pytest.mark.parametrize("parameter", PLANES)
def test_every_index_of_the_paper_s_maps_is_the_same_with_and_without(parameter):
    closed, stepped = both(omega=OMEGA, **{parameter: PLANES[parameter]})
    agree(closed, stepped, 1e-9)
    rests = stepped["status"].values == vi.Status.STICKING
    assert rests.any()
    assert np.array_equal(closed["status"].values == vi.Status.STICKING, rests)
    assert (closed["status"].values == vi.Status.CLOSED).mean() > 0.5
    assert closed.attrs["steps_computed"] < 0.4 * stepped.attrs["steps_computed"]


@pytest.mark.long(but=9)
@pytest.mark.parametrize("indices", [SPEEDS, ALL, tuple(FORCES)], ids=["speeds", "all", "forces"])
@pytest.mark.parametrize("name", MODELS)
def test_every_index_of_a_model_is_the_same_with_and_without(name, indices):
    model, omega = MODELS[name]
    closed, stepped = both(model, indices, omega=omega)
    if model.forgets:  # one mass closes sooner, and its largest velocity is that of its cycle
        agree(closed, stepped, 1e-9)
    else:
        agree(closed, stepped, 1e-11, ())
    assert (stepped["status"].values != vi.Status.CLOSED).all()
    assert closed.attrs["impacts_computed"] < 0.5 * stepped.attrs["impacts_computed"]
    assert closed.attrs["steps_computed"] < 0.5 * stepped.attrs["steps_computed"]


@pytest.mark.parametrize("name", MODELS)
def test_a_cell_that_closes_has_the_exponent_of_its_orbit(name):
    model, omega = MODELS[name]
    sweep, compared = vi.parameter_map(model, omega=omega, indices=ALL, transient_impacts=1500), 0
    for value in sweep["omega"].values[sweep["n_periods"].values > 0]:
        there, cell = model.replace(omega=float(value)), sweep.sel(omega=value)
        p = -1 if int(cell["status"]) == vi.Status.STICKING else int(cell["n_impacts"])
        for orbit in vi.find_orbit(there, n_periods=int(cell["n_periods"]), n_impacts=p):
            if orbit.stable and max(orbit.velocities) == pytest.approx(float(cell["max_velocity"]), rel=1e-6):
                compared += 1
                assert float(cell["lyapunov"]) == pytest.approx(orbit.lyapunov, abs=8e-10)
                per_period = float(cell["lyapunov_per_impact"] * cell["impacts_per_period"])
                assert per_period / there.period == pytest.approx(orbit.lyapunov, abs=8e-10)
    assert compared > (10 if name == "one mass" else 0)


def test_the_largest_velocity_of_a_closed_cell_is_that_of_its_cycle():
    slow = vi.ImpactOscillator(omega=2.1, damping=0.0005, restitution=0.99)  # hits at 5.110 m/s on its way
    names = ("max_velocity", "n_periods", "n_impacts")
    for osc, axis in ((slow, {"omega": [2.05, 2.1, 2.15]}), (OSC, {"omega": OMEGA})):
        sweep = vi.parameter_map(osc, indices=names, **axis)
        alone = vi.parameter_map(osc, indices="max_velocity", **axis)
        closed = np.flatnonzero(sweep["status"].values == vi.Status.CLOSED)
        assert len(closed) > 1
        for at in closed:
            hits = vi.impact_section(osc.replace(omega=axis["omega"][at]), transient_impacts=20_000, sample_impacts=200)
            assert sweep["n_impacts"].values[at] <= 200
            assert sweep["max_velocity"].values[at] == pytest.approx(float(hits["velocity"].max()), rel=1e-9)
            assert alone["max_velocity"].values[at] == pytest.approx(sweep["max_velocity"].values[at], rel=1e-9)


# Windows


@pytest.mark.parametrize("transient", [0, 7, 100, 1000])
@pytest.mark.parametrize("sample", [1, 2, 61, 500])
def test_windows_of_one_mass_that_begin_and_end_in_mid_cycle(transient, sample):
    # Sticking, period-1 impact-2, period-1 impact-1, a long cycle, chaos.
    window = {"transient_impacts": transient, "sample_impacts": sample}
    agree(*both(omega=[0.1, 0.95, 1.25, 2.0, 2.8, 4.0], **window), 1e-9)


@pytest.mark.parametrize("transient", [0, 7, 1000])
@pytest.mark.parametrize("sample", [61, 500, 4000])
def test_windows_of_two_masses_that_begin_and_end_in_mid_cycle(transient, sample):
    window = {"transient_impacts": transient, "sample_impacts": sample}
    agree(*both(between_stops(1.0), ALL, omega=np.linspace(0.98, 1.2, 4), **window), 1e-11, ())


MACHINES = ("bouncing_ball", "idle_gear", "two_sided_oscillator", "impact_damper", "tuned_mass_damper", "gear_pair")


@pytest.mark.long(but=4)
@pytest.mark.parametrize("seed", range(12))
def test_random_windows_of_machines_say_what_all_their_impacts_say(seed):
    rng = np.random.default_rng([1201, seed])
    machine = getattr(vi.models, MACHINES[seed % len(MACHINES)])()
    bounces = [name for name in machine.values if name.endswith("restitution")]
    machine = machine.replace(**dict(zip(bounces, rng.uniform(0.05, 0.9, len(bounces)), strict=True)))
    window = {"transient_impacts": int(rng.integers(0, 1100)), "sample_impacts": int(rng.integers(50, 3000))}
    maps = both(machine, ALL, omega=np.sort(machine.omega * rng.uniform(0.7, 1.4, 12)), **window)
    agree(*maps, 1e-11, (), least=1.0)


# Rests


def test_a_window_of_a_sticking_cycle_is_exact_to_rounding():
    closed, stepped = both(omega=[0.1, 0.2, 5.0])
    for name in SPEEDS:
        assert closed[name].values == pytest.approx(stepped[name].values, rel=1e-13)
    assert closed.attrs["steps_computed"] < 0.2 * stepped.attrs["steps_computed"]


@pytest.mark.parametrize("seed", [0, 1, 2, 3, 6, 8, 9, 10])
def test_turns_from_release_to_release_are_skipped_without_a_trace(seed):
    # Random designs, of which these stick, and windows that begin and end anywhere; all observers.
    rng = np.random.default_rng(seed)
    osc = vi.ImpactOscillator(
        damping=rng.uniform(0.0, 0.3), restitution=rng.uniform(0.0, 0.7), gap=rng.uniform(-0.4, 0.3)
    )
    window = {"transient_impacts": int(rng.integers(0, 300)), "sample_impacts": int(rng.integers(100, 900))}
    closed, stepped = both(osc, ALL, omega=np.sort(rng.uniform(0.05, 0.9, 24)), **window)
    sticks = stepped["status"].values == vi.Status.STICKING
    assert sticks.any()
    assert np.array_equal(closed["status"].values[sticks], stepped["status"].values[sticks])
    for name in INDICES:
        scale = np.abs(np.nan_to_num(stepped[name].values[sticks], posinf=0.0, neginf=0.0)).max(initial=1e-3)
        same = stepped[name].values[sticks]
        if name == "max_velocity":  # of a closed cell that of its turn, without the way to it
            assert (closed[name].values[sticks] <= same * (1.0 + 1e-13)).all()
        else:
            tolerance = max(1e-12 * scale, 1e-13)  # speeds are of size 1
            np.testing.assert_allclose(closed[name].values[sticks], same, rtol=1e-12, atol=tolerance)
    assert closed.attrs["impacts_computed"] <= stepped.attrs["impacts_computed"]


@pytest.mark.parametrize("transient", [36, 100, 500, 1000, 1020, 2040])
@pytest.mark.parametrize("sample", [60, 535, 2000])
def test_a_chatter_of_every_period_has_its_name_and_its_rest_wherever_a_window_begins(transient, sample):
    # Every power of two of impacts another one is watched: 512, 1024 and 2048 lie within turns that are closed.
    ball, window = vi.models.bouncing_ball(restitution=0.43), {"transient_impacts": transient, "sample_impacts": sample}
    closed, stepped = both(ball, ALL, omega=ball.omega * np.linspace(0.96, 1.0, 6), **window)
    for found in (closed, stepped):
        assert (found["n_periods"] == 1).all()
        assert (found["n_impacts"] == -1).all()
    agree(closed, stepped, 1e-11, ())


@pytest.mark.parametrize(
    ("model", "indices", "omega", "share"),
    [(sticking(), ALL, [0.4], 0.3), (vi.models.idle_gear(), SPEEDS, [138.0, 140.64, 143.0], 0.4)],
)
def test_a_rest_is_closed_by_its_multipliers_or_after_few_where_it_erases_all_memory(model, indices, omega, share):
    """Neighbours part on the way to each rest, but each cycle begins anew: what is left out repeats to rounding."""
    closed, stepped = both(model, indices, omega=omega)
    assert set(closed["status"].values) == set(stepped["status"].values) == {vi.Status.STICKING}
    assert closed.attrs["impacts_computed"] < share * stepped.attrs["impacts_computed"]
    agree(closed, stepped, 1e-11, ())


# What closes late, and what never does


@pytest.mark.parametrize("shift", [1e-2, 1e-3, 1e-4, 1e-5, 0.0])
@pytest.mark.parametrize("bifurcation", [1.25896223487675874, 2.653923520183519489])
def test_next_to_a_period_doubling_a_cell_is_closed_late_or_not_at_all(bifurcation, shift):
    agree(*both(omega=[bifurcation - shift, bifurcation + shift][: 2 if shift else 1]), 1e-9)


@pytest.mark.usefixtures("modal_engine")
def test_what_settles_early_costs_a_small_part_of_its_impacts():
    closed, stepped = both(one_mass(OSC), omega=[1.0, 2.0, 2.4])
    assert closed["status"].values.tolist() == [vi.Status.CLOSED] * 3
    assert closed.attrs["impacts_computed"] < 0.1 * stepped.attrs["impacts_computed"]
    agree(closed, stepped, 1e-11, ())


LOSSLESS = vi.ImpactOscillator(damping=0.0, restitution=1.0)


@EITHER
@pytest.mark.parametrize(
    ("model", "omega", "start"),
    [
        (LOSSLESS, [0.7, 2.0, 3.1], None),
        (OSC, [2.8], vi.State(-1.0)),
        (one_mass(OSC), [2.8], None),
        (between_stops(0.96), [0.96], None),
        (one_mass(LOSSLESS), [0.7], None),
    ],
    ids=["no loss", "chaos", "chaos of a system", "quasi-periodic", "no loss of a system"],
)
def test_what_does_not_settle_has_all_its_impacts(modal_engine, model, omega, start, indices):
    closed, stepped = both(model, indices, omega=omega, sample_impacts=3000, start=start)
    assert (closed["status"] != vi.Status.CLOSED).all()
    assert closed.attrs["impacts_computed"] == stepped.attrs["impacts_computed"]
    assert not differing(closed, stepped, indices)


def test_long_chaos_is_never_closed():
    # The exponent at w = 2.8 is known to be positive.
    closed = vi.parameter_map(OSC, omega=[2.8], sample_impacts=20_000, start=vi.State(-1.0))
    assert closed["status"].values.tolist() == [vi.Status.OK]


@njit
def cycle_tangent(omega, v, s, c):
    """Return the tangent over the period-1 impact-1 orbit that hits with v at (s, c), from just after an impact."""
    h, _, k = prepare(Cell(1.0, 0.01, 1.0, 1.0, omega, 0.8, 0.0, 0.0, 0.0, 0.0, 0.0), 1e-9)
    tangent = (1.0, 0.0, 0.0, 1.0)
    for _ in range(100):
        tangent = product(flow(k.C, k.K, 2 * np.pi / omega / h / 100), tangent)
    return product(saltation(h * v, s, k), tangent)


@pytest.mark.long
@pytest.mark.parametrize("name", ["w=2.0,n=1", "w=1.4,n=1", "w=2.6,n=1"])
def test_the_tangent_of_a_cycle_has_the_known_trace_and_determinant(values, name):
    known = values["period_n_impact_1"][name]
    angle = 2 * np.pi * float(known["phase_frac"])
    a, b, c, d = cycle_tangent(float(name[2:5]), float(known["v"]), np.sin(angle), np.cos(angle))
    assert a + d == pytest.approx(float(known["trace"]), rel=1e-11)
    assert a * d - b * c == pytest.approx(float(known["det"]), rel=1e-11)
