"""The grazing margin is the least clearance at which a motion turns back between its impacts."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from codes import name_of
from designs import orbit_of_one_impact
from systems import one_mass, two_masses
from vibroimpact.kernels.shared.series import SIZE
from vibroimpact.kernels.shared.trough import trough

pytestmark = pytest.mark.usefixtures("modal_engine")

FAR = vi.State(-1.0)


def test_the_margin_of_a_period_1_orbit_vanishes_linearly_where_it_grazes(values, way):
    grazes, slopes = float(values["grazing_w_of_n=1"][0]["w"]), []
    for away in (1e-3, 1e-4, 1e-5, 1e-6):
        osc = vi.ImpactOscillator(omega=grazes + away)
        indices = way.indices(osc, transient=0, sample=6 if way.slow else 1000, start=orbit_of_one_impact(osc))
        assert name_of(indices) == (1, 1)
        slopes.append(indices["grazing_margin"] / away)
    assert slopes == pytest.approx([slopes[-1]] * 4, rel=2e-2)
    assert slopes[2:] == pytest.approx([slopes[-1]] * 2, rel=2e-4)


@pytest.mark.long(but=6)
@pytest.mark.parametrize(
    ("changes", "start"),
    [
        ({"omega": 2.8}, FAR),
        ({"omega": 2.0}, vi.State(0.0)),
        ({"omega": 0.3, "restitution": 0.0}, vi.State(0.0)),
        ({"omega": 0.64}, FAR),
        ({"omega": 4.7, "gap": 0.01, "damping": 0.05}, FAR),
        ({"omega": 0.12, "gap": 0.4, "restitution": 0.4}, vi.State(0.0)),
        ({"omega": 0.4, "mass": 0.01, "damping": 0.001}, FAR),
        *(({"omega": omega}, FAR) for omega in (0.1, 0.2, 0.45, 0.95, 1.4)),
    ],
)
def test_the_margin_is_the_closest_turn_back_that_dense_looks_show(way, changes, start):
    """Each by the parabola through three looks, those beside an impact left out."""
    osc = vi.ImpactOscillator(**changes)
    hits, indices = (
        way.section(osc, 0, 25, start=start)["time"].values,
        way.indices(osc, transient=0, sample=25, start=start),
    )
    periods = math.ceil(hits[-1] / osc.period) + 1
    looks = way.simulate(osc, start=start, periods=periods, samples_per_period=2500)
    at, gap = looks["time"].values, osc.gap - looks["displacement"].values
    if indices["n_periods"]:
        hits = hits[np.abs(hits - (hits[-1] - indices["n_periods"] * osc.period)).argmin() :]
    inner = (gap[1:-1] < gap[:-2]) & (gap[1:-1] < gap[2:])
    near = np.array([np.any((hits >= a) & (hits <= b)) for a, b in zip(at[:-2], at[2:], strict=True)])
    chosen = np.flatnonzero(inner & (at[:-2] > hits[0]) & (at[2:] < hits[-1]) & ~near)
    slope, bend = 0.5 * (gap[chosen + 2] - gap[chosen]), gap[chosen] - 2 * gap[chosen + 1] + gap[chosen + 2]
    expected = (gap[chosen + 1] - slope**2 / (2 * bend)).min(initial=math.inf)
    assert indices["grazing_margin"] == pytest.approx(float(expected), rel=1e-6, abs=1e-9 if way.slow else 1e-6)


def test_a_dip_between_two_looks_is_seen():
    """Of a polynomial whose rate rises through zero only within a quarter of the way: near-misses of a step."""
    for low, high in ((0.3, 0.45), (0.55, 0.7), (0.76, 0.99)):
        for sign in (1.0, -1.0):
            rate = np.polynomial.Polynomial.fromroots([low, high]) * sign  # it rises through zero at one of them
            found = rate.integ(k=[1.0])
            a = tuple(np.pad(found.coef, (0, SIZE - len(found.coef))))
            place = high if sign > 0.0 else low
            assert trough(a, 1.0, True, np.inf, 0.0) == pytest.approx((found(place), place), abs=1e-9)


def test_a_dip_is_found_to_rounding_where_the_rate_falls_before_it_rises():
    """The rate is zero just before a quarter of the way, falls, and rises through zero later in that quarter."""
    for low in (0.0, 0.25, 0.5, 0.75):
        for before in 10.0 ** np.arange(-12.0, -1.0):
            for high in low + np.linspace(0.02, 0.24, 12):
                rate = np.polynomial.Polynomial.fromroots([low - before, high]) * np.polynomial.Polynomial([1.0, -0.3])
                found = rate.integ(k=[1.0])
                a = tuple(np.pad(found.coef, (0, SIZE - len(found.coef))))
                assert trough(a, 1.0, True, np.inf, 0.0) == pytest.approx((found(high), high), abs=1e-12)


def test_a_least_clearance_just_before_a_greatest_one_is_seen(way):
    """Between them the rate is above zero for a hundredth of a period only, within one look."""
    osc = vi.ImpactOscillator(
        mass=1.1546134206394105,
        damping=0.0,
        stiffness=2.215647720813994,
        amplitude=0.9984182889802913,
        omega=0.4612733417411939,
        restitution=0.30724307119423255,
        gap=0.03659073740331492,
    )
    indices = way.indices(osc, transient=300, sample=50)
    assert (indices["n_periods"], indices["n_impacts"]) == (1, -1)
    assert indices["grazing_margin"] == pytest.approx(0.0748328522390, abs=1e-9)


def test_the_closest_miss_is_the_least_clearance_between_impacts():
    """That of the oscillator, and of densely sampled motions of a system, stop by stop."""
    omega = np.linspace(0.4, 2.9, 60)
    settings = {
        "omega": omega,
        "indices": ("grazing_margin", "n_periods"),
        "transient_impacts": 1000,
        "sample_impacts": 99,
    }
    osc = vi.ImpactOscillator(damping=0.1, gap=0.3)
    one, cells = vi.parameter_map(osc, **settings), vi.parameter_map(one_mass(osc), **settings)
    cycles = (one["n_periods"] > 0).values
    assert cycles.sum() > 20
    finite = np.isfinite(one["grazing_margin"].values[cycles])
    assert 3 < finite.sum() < cycles.sum()
    np.testing.assert_allclose(cells["grazing_margin"].values[cycles], one["grazing_margin"].values[cycles], atol=1e-9)

    pair = two_masses()
    how = {"transient_impacts": 500, "sample_impacts": 60}
    names = ("grazing_margin", "n_periods")
    sweep = vi.parameter_map(pair, omega=np.linspace(1.4, 3, 17) * pair.omega, by_stop=True, indices=names, **how)
    compared = 0
    for at in np.flatnonzero(sweep["n_periods"].values > 0):
        cell, periods = sweep.isel(omega=at), int(sweep["n_periods"][at])
        model = pair.replace(omega=float(cell["omega"]))
        motion = vi.simulate(model, periods=300 + periods, samples_per_period=400).isel(
            time=slice(-400 * periods - 2, None)
        )
        clear = motion["clearance"].values
        hits = np.searchsorted(motion["time"].values, motion["impact_time"].values)
        for number in range(len(pair.stops)):
            a, b, c = clear[:-2, number], clear[1:-1, number], clear[2:, number]
            lows = np.flatnonzero((b < a) & (b < c) & (b > 1e-9))
            lows = lows[[np.abs(hits - low - 1).min(initial=9) > 2 for low in lows]]
            vertex = (b - (a - c) ** 2 / (8.0 * (a - 2.0 * b + c)))[lows]  # of the parabola through the three
            assert float(cell["grazing_margin"][number]) == pytest.approx(
                vertex.min(initial=np.inf), abs=1e-6 * np.ptp(clear)
            )
            compared += lows.size > 0
    assert compared > 2
