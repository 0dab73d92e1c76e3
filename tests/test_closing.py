"""Cells closed in closed form say what all their impacts would have said."""

import numpy as np
import pytest
from numba import njit

import vibroimpact as vi
from vibroimpact.indices import INDICES, VELOCITY_INDICES
from vibroimpact.kernels.cell import Cell, prepare
from vibroimpact.kernels.flight import flow, product
from vibroimpact.kernels.law import saltation

OSC = vi.ImpactOscillator()
NAMES = tuple(sorted(VELOCITY_INDICES))
OMEGA = np.linspace(0.025, 5.0, 24)
PLANES = {
    "mass": np.linspace(0.1, 5.0, 12),
    "damping": np.linspace(0.005, 1.0, 12),
    "stiffness": np.linspace(0.1, 5.0, 12),
    "amplitude": np.linspace(0.1, 5.0, 12),
    "restitution": np.linspace(0.1, 0.99, 12),
}


def both(osc=OSC, **settings):
    return [vi.parameter_map(osc, indices=NAMES, early_closing=early, **settings) for early in (True, False)]


def agree(closed, stepped):
    """Check every index of every cell to 1e-9 of its scale, bitwise where nothing closed."""
    open_cells = (closed["status"].values == stepped["status"].values) & (closed["status"].values == vi.Status.OK)
    for name in NAMES:
        a, b = closed[name].values, stepped[name].values
        assert np.array_equal(np.isnan(a), np.isnan(b))
        assert np.array_equal(a[open_cells], b[open_cells])
        # The largest impact velocity of a closed cell is that of its cycle, without the way to it.
        known = ~np.isnan(a) & (open_cells | (name != "max_velocity"))
        assert (np.abs(a - b)[known] <= 1e-9 * np.abs(b[known]).max(initial=0.0)).all()


@pytest.mark.parametrize("parameter", PLANES)
def test_every_index_of_the_paper_s_maps_is_the_same_with_and_without(parameter):
    closed, stepped = both(omega=OMEGA, **{parameter: PLANES[parameter]})
    agree(closed, stepped)
    sticking = stepped["status"].values == vi.Status.STICKING
    assert sticking.any()
    assert np.array_equal(closed["status"].values == vi.Status.STICKING, sticking)
    assert (closed["status"].values == vi.Status.CLOSED).mean() > 0.5
    assert closed.attrs["steps_computed"] < 0.4 * stepped.attrs["steps_computed"]


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


@pytest.mark.parametrize("transient", [0, 7, 100, 1000])
@pytest.mark.parametrize("sample", [1, 2, 61, 500])
def test_windows_that_begin_and_end_in_mid_cycle(transient, sample):
    # Sticking, period-1 impact-2, period-1 impact-1, a long cycle, chaos.
    closed, stepped = both(omega=[0.1, 0.95, 1.25, 2.0, 2.8, 4.0], transient_impacts=transient, sample_impacts=sample)
    agree(closed, stepped)


@pytest.mark.parametrize("shift", [1e-2, 1e-3, 1e-4, 1e-5, 0.0])
@pytest.mark.parametrize("bifurcation", [1.25896223487675874, 2.653923520183519489])
def test_next_to_a_period_doubling_a_cell_is_closed_late_or_not_at_all(bifurcation, shift):
    closed, stepped = both(omega=[bifurcation - shift, bifurcation + shift][: 2 if shift else 1])
    agree(closed, stepped)


def test_a_window_of_a_sticking_cycle_is_exact_to_rounding():
    closed, stepped = both(omega=[0.1, 0.2, 5.0])
    for name in NAMES:
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
    axis = {"omega": np.sort(rng.uniform(0.05, 0.9, 24))}
    closed, stepped = (
        vi.parameter_map(osc, indices=tuple(INDICES), early_closing=early, **axis, **window) for early in (True, False)
    )
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


def test_a_motion_that_keeps_its_energy_is_never_closed():
    lossless = vi.ImpactOscillator(damping=0.0, restitution=1.0)
    closed, stepped = both(lossless, omega=[0.7, 2.0, 3.1], sample_impacts=1000)
    assert (closed["status"] != vi.Status.CLOSED).all()
    agree(closed, stepped)


def test_impacts_per_period_of_a_closed_cycle_is_exactly_p_over_n():
    for sweep in both(omega=[0.95, 2.0, 4.0]):
        assert sweep["impacts_per_period"].values.tolist() == [2.0, 1.0, 0.5]


def test_chaos_is_never_closed():
    # The exponent at w = 2.8 is known to be positive.
    closed, _ = both(omega=[2.8], sample_impacts=20_000, start=vi.State(-1.0))
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
