"""Every hard case ends within its budget, with its status, and harms nobody else."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from vibroimpact import Status


def cell(osc, *, start=None, transient=20, sample=200, **axes):
    return vi.parameter_map(
        osc,
        **(axes or {"omega": [osc.omega]}),
        start=start,
        indices=("std", "mean_velocity", "max_velocity", "impacts_per_period"),
        transient_impacts=transient,
        sample_impacts=sample,
    )


def outcome(osc, **settings):
    return Status(int(cell(osc, **settings)["status"].values.ravel()[0]))


def test_at_the_stop_with_zero_velocity_and_pressed_it_sticks_until_the_force_reverses():
    orbit = vi.simulate(vi.ImpactOscillator(omega=2.0), periods=1)
    assert orbit["stick_time"].values[0] == 0.0
    assert orbit["release_time"].values[0] == pytest.approx(math.pi / 2, rel=1e-15)
    assert (orbit["displacement"].values[:100] == 0.0).all()


def test_at_the_stop_with_zero_velocity_and_not_pressed_it_leaves():
    osc = vi.ImpactOscillator(omega=2.0)
    orbit = vi.simulate(osc, start=vi.State(0.0, 0.0, 0.6 * osc.period), periods=0.3)
    assert orbit.sizes["stick"] == 0
    assert (orbit["displacement"].values[1:] < 0.0).all()


def test_a_start_at_the_stop_towards_it_is_an_impact_at_the_start():
    osc = vi.ImpactOscillator(omega=2.0, gap=0.3)
    orbit = vi.simulate(osc, start=vi.State(0.3, 1.25, 0.7), periods=1)
    assert orbit["impact_time"].values[0] == pytest.approx(0.7, rel=1e-14)
    assert orbit["impact_velocity"].values[0] == pytest.approx(1.25, rel=1e-15)
    assert orbit["velocity"].values[0] == pytest.approx(-0.8 * 1.25, rel=1e-15)


def test_a_release_leaves_with_zero_acceleration_and_cubic_growth():
    osc = vi.ImpactOscillator(omega=0.1)
    orbit = vi.simulate(osc, periods=0.52, samples_per_period=10_000)
    after = orbit.sel(time=slice(orbit["release_time"].values[0] + 1e-9, None))
    elapsed = after["time"].values - orbit["release_time"].values[0]
    early = elapsed < 0.3
    assert after["displacement"].values[early] == pytest.approx(-0.1 * elapsed[early] ** 3 / 6, rel=2e-2, abs=1e-15)


def test_a_small_impact_that_is_no_chatter_is_rebounded_unrecorded():
    # Pulled away from the stop, a contact slower than the cut neither counts nor sticks.
    osc = vi.ImpactOscillator(omega=2.0)
    start = vi.State(0.0, 1e-12, 0.75 * osc.period)
    hits = vi.impact_section(osc, start=start, transient_impacts=0, sample_impacts=1)
    assert hits["time"].values[0] > start.time + 1.0
    assert hits.sizes["stick"] == 0


def test_a_chatter_that_the_release_interrupts_does_not_stick():
    # Impacts at the end of the pressing half period: t1 is longer than what is left of it.
    osc = vi.ImpactOscillator(omega=1.0)
    start = vi.State(0.0, 1e-10, 0.5 * osc.period - 1e-10)
    orbit = vi.simulate(osc, start=start, periods=0.1)
    assert orbit.sizes["stick"] == 0
    assert orbit["displacement"].values[-1] < -1e-3


def test_without_restitution_an_impact_sticks_where_the_force_presses():
    osc = vi.ImpactOscillator(omega=1.0, restitution=0.0)
    orbit = vi.simulate(osc, start=vi.State(0.0, 0.5, 0.25 * osc.period), periods=1)
    assert orbit["impact_velocity"].values[0] == 0.5
    assert orbit["stick_time"].values[0] == pytest.approx(0.25 * osc.period)
    assert orbit["release_time"].values[0] == pytest.approx(0.5 * osc.period)


def test_without_restitution_an_impact_leaves_at_once_where_the_force_pulls():
    osc = vi.ImpactOscillator(omega=1.0, restitution=0.0)
    orbit = vi.simulate(osc, start=vi.State(0.0, 0.5, 0.75 * osc.period), periods=0.2)
    assert orbit.sizes["stick"] == 0
    assert (orbit["displacement"].values[1:] < 0.0).all()


def test_full_restitution_without_damping_keeps_energy_between_impacts():
    osc = vi.ImpactOscillator(damping=0.0, amplitude=0.0, restitution=1.0, omega=1.0)
    hits = vi.impact_section(osc, start=vi.State(0.0, 1.0), transient_impacts=0, sample_impacts=1000)
    assert hits["velocity"].values == pytest.approx(1.0, rel=1e-12)
    assert np.diff(hits["time"].values) == pytest.approx(math.pi, rel=1e-12)


def test_full_restitution_forced_ends_with_a_status():
    assert outcome(vi.ImpactOscillator(omega=0.5, restitution=1.0)) in (Status.OK, Status.SHORT_WINDOW)


@pytest.mark.parametrize("gap", [-1.0, -1.5, -100.0])
def test_a_preload_that_the_force_cannot_lift_sticks_for_ever(gap):
    osc = vi.ImpactOscillator(gap=gap)
    assert outcome(osc) == Status.STUCK_FOREVER
    assert outcome(osc, start=vi.State(gap - 0.5)) == Status.STUCK_FOREVER
    assert np.isnan(cell(osc)["std"]).all()


@pytest.mark.parametrize("gap", [1.0, 1.2])
def test_a_gap_beyond_the_static_reach_never_presses_yet_may_be_hit(gap):
    osc = vi.ImpactOscillator(gap=gap, omega=1.0)
    hits = vi.impact_section(osc, sample_impacts=100)
    assert int(hits["status"]) == Status.OK
    assert hits.sizes["stick"] == 0


def test_no_force_and_a_gap_never_hits():
    assert outcome(vi.ImpactOscillator(amplitude=0.0, gap=0.5)) == Status.NO_IMPACT


def test_no_force_and_no_gap_rests_at_the_stop():
    assert outcome(vi.ImpactOscillator(amplitude=0.0)) == Status.STUCK_FOREVER


def test_no_force_and_no_gap_decays_for_ever_once_set_in_motion():
    assert outcome(vi.ImpactOscillator(amplitude=0.0), start=vi.State(-1.0)) == Status.DECAYING


def test_no_force_and_a_preload_chatters_to_rest():
    assert outcome(vi.ImpactOscillator(amplitude=0.0, gap=-0.5), start=vi.State(-1.0)) == Status.STUCK_FOREVER


def test_a_stop_out_of_reach_is_never_hit():
    osc = vi.ImpactOscillator(gap=10.0, omega=3.0)
    assert outcome(osc) == Status.NO_IMPACT
    assert vi.impact_section(osc)["velocity"].size == 0


def test_impacts_that_cease_are_told():
    osc = vi.ImpactOscillator(gap=1.0, omega=3.0, damping=0.1)
    assert outcome(osc, start=vi.State(-5.0)) == Status.STOPPED_IMPACTING
    hits = vi.impact_section(osc, start=vi.State(-5.0), transient_impacts=0)
    assert 0 < hits.sizes["impact"] < 5000
    assert int(hits["status"]) == Status.STOPPED_IMPACTING


def test_a_flight_that_does_not_end_is_over_budget():
    # Undamped, R < g, yet the free motion left over from the start reaches beyond g - R without ever hitting.
    osc = vi.ImpactOscillator(damping=0.0, amplitude=0.1, gap=1.0, omega=math.sqrt(2.0))
    sweep = cell(osc, start=vi.State(-0.95), gap=[0.0, 1.05, 1.2])
    assert sweep["status"].values.tolist() == [Status.CLOSED, Status.BUDGET, Status.NO_IMPACT]


@pytest.mark.parametrize("omega", [0.01, 100.0])
def test_very_slow_and_very_fast_driving(omega):
    assert outcome(vi.ImpactOscillator(omega=omega), sample=2000).has_indices


def test_undamped_resonance_is_bounded_by_its_impacts():
    # METHOD: at c = 0, w = w_n the period-1 impact-1 orbit has v = pi f / ((1 + r) sqrt(k m)).
    osc = vi.ImpactOscillator(damping=0.0, omega=1.0, restitution=0.5)
    v = math.pi / 1.5
    period = osc.period
    sweep = cell(osc, transient=2000)
    assert math.isfinite(sweep["max_velocity"].values[0])
    hits = vi.impact_section(osc, transient_impacts=2000, sample_impacts=50)
    if np.ptp(hits["velocity"].values) < 1e-9:
        assert hits["velocity"].values == pytest.approx(v, rel=1e-9)
        assert np.diff(hits["time"].values) == pytest.approx(period, rel=1e-9)


def test_impact_resonance_without_loss_grows_for_ever_and_is_reported_finite():
    osc = vi.ImpactOscillator(damping=0.0, omega=2.0, restitution=1.0)
    early, late = cell(osc, transient=100), cell(osc, transient=1000)
    assert int(late["status"][0]) == Status.OK
    assert late["mean_velocity"].values[0] > 2 * early["mean_velocity"].values[0]


def test_an_impact_next_to_the_start_of_a_period_keeps_its_time():
    osc = vi.ImpactOscillator(omega=2.0)
    for offset in (-1e-15, 0.0, 1e-15):
        start = vi.State(0.0, 1.0, (3.0 + offset) * osc.period)
        hits = vi.impact_section(osc, start=start, transient_impacts=0, sample_impacts=1)
        assert hits["time"].values[0] == pytest.approx(3 * osc.period, rel=1e-14)
        assert 0.0 <= hits["phase"].values[0] < 1.0


def test_nearly_equal_velocities_have_a_tiny_std_not_the_rounding_of_their_squares():
    sweep = cell(vi.ImpactOscillator(omega=2.0), transient=2000, sample=5000)
    assert 0.0 <= sweep["std"].values[0] < 1e-13


def test_fewer_than_ten_periods_are_told():
    assert outcome(vi.ImpactOscillator(omega=0.1), sample=300) == Status.SHORT_WINDOW


def test_hard_cells_leave_their_neighbours_alone():
    gaps = [-2.0, -0.5, 0.0, 0.5, 50.0]
    together = cell(vi.ImpactOscillator(), gap=gaps)
    for at, gap in enumerate(gaps):
        alone = cell(vi.ImpactOscillator(gap=gap))
        for name in ("std", "mean_velocity", "impacts_per_period", "status"):
            assert np.array_equal(together[name].values[at], alone[name].values[0], equal_nan=True)


@pytest.mark.parametrize("above", [1e-8, 1e-10, 1e-12])
def test_a_force_that_barely_lifts_the_mass_ends_over_budget_not_never(above):
    assert outcome(vi.ImpactOscillator(gap=-1.0 + above, omega=0.7)) == Status.BUDGET


def test_an_overdamped_mass_without_force_creeps_back_and_never_hits():
    osc = vi.ImpactOscillator(amplitude=0.0, damping=5.0)
    assert outcome(osc, start=vi.State(-1.0)) == Status.NO_IMPACT


def test_a_long_transient_of_periods_is_within_the_budget():
    looks = vi.stroboscopic_section(vi.ImpactOscillator(omega=2.8), transient_periods=2000, sample_periods=1)
    assert looks.sizes["period"] == 1
