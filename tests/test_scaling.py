"""Scaling identities on whole maps: sticking and chaotic cells included."""

import numpy as np
import pytest

import vibroimpact as vi

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


def test_shifting_the_start_by_whole_periods_changes_nothing():
    osc = vi.ImpactOscillator(omega=2.8)
    now = vi.impact_section(osc, start=vi.State(-1.0), transient_impacts=0, sample_impacts=20)
    later = vi.impact_section(osc, start=vi.State(-1.0, 0.0, 64 * osc.period), transient_impacts=0, sample_impacts=20)
    assert later["velocity"].values == pytest.approx(now["velocity"].values, rel=1e-12)
    assert later["time"].values - now["time"].values == pytest.approx(64 * osc.period, rel=1e-13)
