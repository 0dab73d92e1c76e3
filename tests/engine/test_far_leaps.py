"""Far leaps and near-misses: what is passed and what is seen on the way is that of the motion."""

import numpy as np
import pytest
from scipy.linalg import expm

import vibroimpact as vi
from designs import random_oscillator
from leaping import PARTS, Leaping, remade
from systems import a_random_system
from vibroimpact.kernels.systems.elements import OPEN
from vibroimpact.kernels.systems.leap import FAR, LEAPS


def spread_out(rng, n):
    """Return a random system of which some modes are up to 100 times as fast as others; none is coupled to another."""
    model, rates = a_random_system(rng, n), 10.0 ** rng.uniform(-1, 1, n)
    damping, load = 10.0 ** rng.uniform(-3, 0, n) * rates, rng.standard_normal(n) * rates
    force = vi.Force(omega=model.omega, harmonics={1: load, 3: 0.2 * load}, constant=load)
    return remade(model, mass=np.eye(n), damping=np.diag(damping), stiffness=np.diag(rates**2), force=force)


@pytest.mark.long
def test_far_leaps_end_before_a_stop_is_touched_and_where_they_should():
    rng, leaps, tried, closest = np.random.default_rng(5), 0, 0, np.inf
    for _ in range(300):
        one = Leaping(spread_out(rng, int(rng.integers(2, 5))))
        for _ in range(20 if one.k.far else 0):
            state, angle = one.state(rng)
            states, without = one.course(state, LEAPS * FAR, LEAPS * PARTS)
            swing = np.ptp(without, axis=0)
            gaps = -without[0] + 10.0 ** rng.uniform(-2, 1, one.k.stops) * swing
            leapt, after = one.leap(state, angle, gaps, np.full(one.k.stops, OPEN), FAR)
            way = (gaps + without[: leapt * PARTS + 1])[1:]
            assert (way > 0.0).all()
            there = states[leapt * PARTS][: len(after)]
            np.testing.assert_allclose(after, there, rtol=0, atol=LEAPS * one.rounding * np.abs(states).max())
            leaps, tried = leaps + (leapt > 0), tried + 1
            closest = min(closest, (way / swing).min(initial=np.inf))
    assert tried > 1000
    assert leaps > 100
    assert closest < 0.2  # of a swing: the bound is no idle one


def test_what_is_seen_within_far_leaps_is_the_motion():
    rng, count = np.random.default_rng(6), 0
    for _ in range(20):
        model = spread_out(rng, 3)
        model = remade(model, stops=[stop.replace(gap=1e3) for stop in model.stops])
        one = Leaping(model)
        if not one.k.far:
            continue
        state = np.concatenate([rng.standard_normal(6), [1.0], np.tile([0.0, 1.0], len(one.waves))])
        start = vi.State(state[:3].tolist(), state[3:6].tolist())
        motion, step = vi.simulate(model, start=start, periods=5, samples_per_period=37), model.period / 37
        turn = expm(one.matrix * step)
        for displacement, velocity in zip(motion["displacement"].values, motion["velocity"].values, strict=True):
            size = 1e-11 * np.abs(state).max()
            np.testing.assert_allclose(np.concatenate([displacement, velocity]), state[:6], rtol=0, atol=size)
            state = turn @ state
        count += 1
    assert count > 3


@pytest.mark.parametrize("ends", ["tube_in_supports", "clamped_tube_in_supports"])
@pytest.mark.parametrize("modes", [3, 5, 8, 12])
def test_to_look_for_near_misses_changes_no_motion_before_or_in_the_window(ends, modes):
    """Far leaps of many modes keep away from every stop, also where no near-miss counts yet."""
    tube = getattr(vi.models, ends)(modes=modes, force_per_length=12.0)
    window = {"omega": [tube.omega], "transient_impacts": 20, "sample_impacts": 20}
    plain = vi.parameter_map(tube, indices=["max_velocity", "mean_velocity"], **window)
    wary = vi.parameter_map(tube, indices=["max_velocity", "mean_velocity", "grazing_margin"], **window)
    for name in ("max_velocity", "mean_velocity"):
        assert wary[name].item() == pytest.approx(plain[name].item(), rel=1e-6)
    hits = vi.impact_section(tube, transient_impacts=20, sample_impacts=20)["velocity"].values
    assert wary["max_velocity"].item() == pytest.approx(hits.max(), rel=1e-6)


@pytest.mark.long
def test_near_misses_that_leaps_pass_are_the_witness_s():
    rng, compared = np.random.default_rng(3), 0
    window = {"transient_impacts": 3, "sample_impacts": 12, "early_closing": False}
    names = ["grazing_margin", "mean_velocity", "n_periods"]
    for _ in range(200):
        osc = random_oscillator(rng, (-3, -1), omega=(3, 9), restitution=(0.5, 0.95), gap=(-0.3, 0.3))
        ours, theirs = (
            vi.parameter_map(osc, omega=[osc.omega], indices=names, backend=name, **window).isel(omega=0)
            for name in ("cpu", "reference")
        )
        margin = float(theirs["grazing_margin"])
        # Nor cycles, of which the witness looks at other flights, nor motions that have parted by rounding.
        undecided = theirs["n_periods"] == ours["n_periods"] == 0
        same = abs(ours["mean_velocity"] - theirs["mean_velocity"]) < 1e-9 * theirs["mean_velocity"]
        if np.isfinite(margin) and undecided and same:
            compared += 1
            assert float(ours["grazing_margin"]) == pytest.approx(margin, abs=1e-4)
    assert compared > 80
