"""Every hard case of an oscillator ends within its budget, with its status, by both engines and the witness."""

import math

import numpy as np
import pytest

import vibroimpact as vi

NAMES = ("std", "mean_velocity", "max_velocity", "impacts_per_period")

ENDINGS = [
    ("kg below -f: pressed for ever", {"gap": -2.0}, None, "stuck_forever"),
    ("kg far below -f", {"gap": -100.0}, (-100.5, 0.0), "stuck_forever"),
    ("kg equal -f: pressed for ever", {"gap": -1.0}, None, "stuck_forever"),
    ("kg equal -f, thrown at it", {"gap": -1.0}, (-1.5, 0.0), "stuck_forever"),
    ("kg equal f from the stop: leaves by its fourth derivative", {"gap": 1.0, "omega": 0.9}, (1.0, 0.0), "ok"),
    ("stop out of reach", {"gap": 5.0, "omega": 3.0}, None, "no_impact"),
    ("settles clear of the stop", {"gap": 1.0, "omega": 3.0}, (-2.0, 0.0), "stopped_impacting"),
    ("no force, no gap, at rest", {"amplitude": 0.0}, None, "stuck_forever"),
    ("no force, gap, at rest", {"amplitude": 0.0, "gap": 0.5}, None, "no_impact"),
    ("no force, no gap, moving", {"amplitude": 0.0, "restitution": 0.2}, (-1.0, 0.0), "decaying"),
    ("no force, no gap, creeping back", {"amplitude": 0.0, "damping": 5.0}, (-1.0, 0.0), "no_impact"),
    ("no force, no gap, no rebound", {"amplitude": 0.0, "restitution": 0.0}, (-1.0, 0.0), "stuck_forever"),
    ("no force, preload", {"amplitude": 0.0, "gap": -1.0, "restitution": 0.5}, (-2.0, 0.0), "stuck_forever"),
    ("no force, gap, losses only at the stop", {"amplitude": 0.0, "gap": 1.0, "damping": 0.0, "restitution": 0.5},
     (-2.0, 0.0), "decaying or stopped_impacting"),
    ("no damping, beats below the stop", {"damping": 0.0, "gap": 3.0, "omega": 3.0}, (-2.9, 0.0), "budget"),
    ("r = 0", {"restitution": 0.0}, None, "sticking"),
    ("r = 1", {"restitution": 1.0, "omega": 2.7}, None, "ok"),
    ("r = 1, slow", {"restitution": 1.0, "omega": 0.5}, None, "ok or short_window"),
    ("r = 1, c = 0, w = 2 w_n", {"restitution": 1.0, "damping": 0.0}, None, "ok"),
    ("c = 0, w = w_n", {"damping": 0.0, "omega": 1.0}, None, "ok"),
    ("w = w_n/100", {"omega": 0.01}, None, "short_window"),
    ("w = 100 w_n", {"omega": 100.0}, None, "ok"),
]  # fmt: skip


# One grazes within rounding and loses no more; the engine of systems does not see how a motion without force dies out.
OTHERWISE = {
    ("engine", "no force, gap, losses only at the stop"): "ok",
    ("engine of systems", "no force, gap, losses only at the stop"): "ok",
    ("witness", "no force, gap, losses only at the stop"): "ok",
    ("engine of systems", "no force, no gap, moving"): "stuck_forever",
    ("engine of systems", "no force, no gap, creeping back"): "budget",
}


@pytest.mark.parametrize(("case", "changes", "start", "word"), ENDINGS, ids=[ending[0] for ending in ENDINGS])
def test_each_motion_ends_with_its_status(way, case, changes, start, word):
    osc = vi.ImpactOscillator(**changes)
    # 20 natural periods of flight suffice to tell a flight without end here.
    how = {"start": start and vi.State(*start), "tolerances": vi.Tolerances(flight_periods=20.0)}
    keep = 200 if word == "stuck_forever" else 40
    hits = way.section(osc, 5, keep, **how)
    indices = way.indices(osc, NAMES, 5, keep, early_closing=False, **how)
    assert vi.Status(int(hits["status"])).word in OTHERWISE.get((way.name, case), word).split(" or ")
    assert indices["status"] == int(hits["status"])
    assert (hits["velocity"] > 0).all()
    assert vi.Status(indices["status"]).has_indices != math.isnan(indices["std"])


# At the stop


def test_at_the_stop_with_zero_velocity_and_pressed_it_sticks_until_the_force_reverses(way):
    orbit = way.simulate(vi.ImpactOscillator(omega=2.0), periods=1)
    assert orbit["stick_time"].values[0] == 0.0
    assert orbit["release_time"].values[0] == pytest.approx(math.pi / 2, rel=1e-15)
    assert (orbit["displacement"].values[:100] == 0.0).all()


def test_at_the_stop_with_zero_velocity_and_not_pressed_it_leaves(way):
    osc = vi.ImpactOscillator(omega=2.0)
    orbit = way.simulate(osc, start=vi.State(0.0, 0.0, 0.6 * osc.period), periods=0.3)
    assert orbit.sizes["stick"] == 0
    assert (orbit["displacement"].values[1:] < 0.0).all()


def test_a_start_at_the_stop_towards_it_is_an_impact_at_the_start(way):
    osc = vi.ImpactOscillator(omega=2.0, gap=0.3)
    orbit = way.simulate(osc, start=vi.State(0.3, 1.25, 0.7), periods=1)
    assert orbit["impact_time"].values[0] == pytest.approx(0.7, rel=1e-14)
    assert orbit["impact_velocity"].values[0] == pytest.approx(1.25, rel=1e-15)
    assert orbit["velocity"].values[0] == pytest.approx(-0.8 * 1.25, rel=1e-15)


def test_a_small_impact_that_is_no_chatter_is_rebounded_unrecorded(way):
    """Pulled away from the stop, a contact slower than the cut neither counts nor sticks."""
    osc = vi.ImpactOscillator(omega=2.0)
    start = vi.State(0.0, 1e-12, 0.75 * osc.period)
    hits = way.section(osc, 0, 1, start=start)
    assert hits["time"].values[0] > start.time + 1.0
    assert hits.sizes["stick"] == 0


def test_impacts_below_the_cut_are_rebounded_but_not_counted(way):
    osc = vi.ImpactOscillator(amplitude=0.0, gap=0.5, damping=0.0, restitution=0.1)
    hits = way.section(osc, 0, 100, start=vi.State(-1.0), tolerances=vi.Tolerances(chatter=1e-3))
    speeds = math.sqrt(1 - 0.25) * 0.1 ** np.arange(4)
    assert hits["velocity"].values == pytest.approx(speeds[speeds > 0.5e-3], rel=1e-12)


def test_a_chatter_that_the_release_interrupts_does_not_stick(way):
    """Impacts at the end of the pressing half period: t1 is longer than what is left of it."""
    osc = vi.ImpactOscillator(omega=1.0)
    start = vi.State(0.0, 1e-10, 0.5 * osc.period - 1e-10)
    orbit = way.simulate(osc, start=start, periods=0.1)
    assert orbit.sizes["stick"] == 0
    assert orbit["displacement"].values[-1] < -1e-3


def test_without_restitution_an_impact_sticks_where_the_force_presses_and_leaves_where_it_pulls(way):
    osc = vi.ImpactOscillator(omega=1.0, restitution=0.0)
    pressed = way.simulate(osc, start=vi.State(0.0, 0.5, 0.25 * osc.period), periods=1)
    assert pressed["impact_velocity"].values[0] == 0.5
    assert pressed["stick_time"].values[0] == pytest.approx(0.25 * osc.period)
    assert pressed["release_time"].values[0] == pytest.approx(0.5 * osc.period)
    pulled = way.simulate(osc, start=vi.State(0.0, 0.5, 0.75 * osc.period), periods=0.2)
    assert pulled.sizes["stick"] == 0
    assert (pulled["displacement"].values[1:] < 0.0).all()


def test_without_rebound_every_recorded_impact_rests_or_leaves_with_no_velocity(way):
    osc = vi.ImpactOscillator(restitution=0.0, omega=0.5, gap=0.2)
    hits = way.section(osc)
    pressed = np.sin(2 * math.pi * hits["phase"].values) > osc.gap
    rests = hits["time"].values[:-1][pressed[:-1]]
    assert 0 < len(rests) < 20
    assert hits["stick_time"].values == pytest.approx(rests, rel=1e-14)


# Within the budget


@pytest.mark.parametrize("gap", [1.0, 1.2])
def test_a_gap_beyond_the_static_reach_never_presses_yet_may_be_hit(way, gap):
    hits = way.section(vi.ImpactOscillator(gap=gap, omega=1.0), 100, 100)
    assert int(hits["status"]) == vi.Status.OK
    assert hits.sizes["stick"] == 0


def test_a_stop_out_of_reach_has_no_impacts_and_impacts_that_cease_are_told(way):
    assert way.section(vi.ImpactOscillator(gap=10.0, omega=3.0))["velocity"].size == 0
    hits = way.section(vi.ImpactOscillator(gap=1.0, omega=3.0, damping=0.1), 0, 5000, start=vi.State(-5.0))
    assert 0 < hits.sizes["impact"] < 5000
    assert int(hits["status"]) == vi.Status.STOPPED_IMPACTING


def test_a_flight_that_does_not_end_is_over_budget():
    # Undamped, R < g, yet the free motion left over from the start reaches beyond g - R without ever hitting.
    osc = vi.ImpactOscillator(damping=0.0, amplitude=0.1, gap=1.0, omega=math.sqrt(2.0))
    window = {"transient_impacts": 20, "sample_impacts": 200}
    sweep = vi.parameter_map(osc, gap=[0.0, 1.05, 1.2], start=vi.State(-0.95), **window)
    assert sweep["status"].values.tolist() == [vi.Status.CLOSED, vi.Status.BUDGET, vi.Status.NO_IMPACT]


@pytest.mark.parametrize("above", [1e-8, 1e-10, 1e-12])
def test_a_force_that_barely_lifts_the_mass_ends_over_budget_not_never(above):
    sweep = vi.parameter_map(vi.ImpactOscillator(gap=-1.0 + above), omega=[0.7], transient_impacts=20)
    assert sweep["status"].item() == vi.Status.BUDGET


def test_undamped_resonance_is_bounded_by_its_impacts(way):
    """At c = 0, w = w_n an orbit of one impact, here through the stop, has v = pi f / ((1 + r) sqrt(k m))."""
    osc = vi.ImpactOscillator(damping=0.0, omega=1.0, restitution=0.5)
    (orbit,) = vi.find_orbit(osc)
    assert orbit.velocities == pytest.approx([math.pi / 1.5], rel=1e-9)
    assert way.section(osc, 300, 50)["velocity"].max() < math.pi


def test_impact_resonance_without_loss_grows_for_ever_and_is_reported_finite(way):
    osc = vi.ImpactOscillator(damping=0.0, omega=2.0, restitution=1.0)
    early, late = (way.indices(osc, NAMES, transient, 200) for transient in (100, 1000))
    assert late["status"] == vi.Status.OK
    assert late["mean_velocity"] > 2 * early["mean_velocity"]


@pytest.mark.parametrize("offset", [-1e-15, 0.0, 1e-15])
def test_an_impact_next_to_the_start_of_a_period_keeps_its_time(way, offset):
    osc = vi.ImpactOscillator(omega=2.0)
    hits = way.section(osc, 0, 1, start=vi.State(0.0, 1.0, (3.0 + offset) * osc.period))
    assert hits["time"].values[0] == pytest.approx(3 * osc.period, rel=1e-14)
    assert 0.0 <= hits["phase"].values[0] < 1.0


def test_nearly_equal_velocities_have_a_tiny_std_not_the_rounding_of_their_squares(way):
    indices = way.indices(vi.ImpactOscillator(omega=2.0), NAMES, 300 if way.slow else 2000, 100 if way.slow else 5000)
    assert 0.0 <= indices["std"] < 1e-13


def test_a_long_transient_of_periods_is_within_the_budget():
    looks = vi.stroboscopic_section(vi.ImpactOscillator(omega=2.8), transient_periods=2000, sample_periods=1)
    assert looks.sizes["period"] == 1
