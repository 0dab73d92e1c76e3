"""Motions of oscillators against values with 50 digits and closed forms, by both engines and the witness."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from designs import orbit_of_one_impact
from dop853 import Rigid, march

REST = vi.State(0.0)


def on_orbit(omega, velocity, phase):
    """Return an oscillator and the start just before an impact of a periodic orbit."""
    osc = vi.ImpactOscillator(omega=float(omega))
    return osc, vi.State(0.0, float(velocity), float(phase) * osc.period)


@pytest.mark.parametrize("name", ["w=2.0,n=1", "w=1.4,n=1", "w=2.6,n=1"])
def test_period_1_impact_1_orbits_settle_on_their_velocity_and_phase(values, way, name):
    known = values["period_n_impact_1"][name]
    hits = way.section(vi.ImpactOscillator(omega=float(name[2:5])), 300 if way.slow else 2000)
    assert hits["velocity"].values == pytest.approx(float(known["v"]), rel=1e-13)
    assert hits["phase"].values == pytest.approx(float(known["phase_frac"]), abs=1e-13)


@pytest.mark.parametrize(
    ("changes", "n"),
    [
        ({"omega": 1.7}, 1),
        ({"omega": 4.1}, 2),
        ({"omega": 2.0, "damping": 2.5}, 1),
        ({"omega": 2.3, "damping": 5.0}, 1),
        ({"omega": 1.3, "damping": 0.0}, 1),
        ({"omega": 7.4, "mass": 2.0, "stiffness": 3.0, "restitution": 0.5}, 3),
    ],
)
def test_a_period_n_impact_1_orbit_returns_as_its_closed_form_says(way, changes, n):
    osc = vi.ImpactOscillator(**changes)
    start = orbit_of_one_impact(osc, n)
    hits = way.section(osc, start=start, sample=2)
    assert hits["velocity"].values == pytest.approx(start.velocity, rel=1e-12)
    assert hits["phase"].values == pytest.approx(start.time / osc.period, abs=1e-12)
    assert np.diff(hits["time"]) == pytest.approx(n * osc.period, rel=1e-12)


@pytest.mark.parametrize("side", [0, 1])
def test_an_orbit_at_its_period_doubling_returns_to_itself(values, way, side):
    known = values["period_doubling_w_of_n=1"][side]
    osc, start = on_orbit(known["w"], known["v"], known["phase_frac"])
    hits = way.section(osc, start=start, sample=4)
    assert hits["velocity"].values == pytest.approx(float(known["v"]), rel=1e-11)
    assert hits["phase"].values == pytest.approx(float(known["phase_frac"]), rel=1e-11)


@pytest.mark.parametrize(("side", "stable_towards"), [(0, +1), (1, -1)])
def test_one_impact_becomes_two_across_a_period_doubling(values, side, stable_towards):
    known = values["period_doubling_w_of_n=1"][side]

    def spread(shift):
        osc, start = on_orbit(float(known["w"]) + shift, known["v"], known["phase_frac"])
        hits = vi.impact_section(osc, start=start, transient_impacts=20000, sample_impacts=10)
        v = hits["velocity"].values
        return abs(v[1] - v[0]), abs(v[2] - v[0])

    next_one, next_but_one = spread(stable_towards * 2e-3)
    assert next_one < 1e-9
    next_one, next_but_one = spread(-stable_towards * 2e-3)
    assert next_one > 1e-3
    assert next_but_one < 1e-9


def test_the_period_1_orbit_is_lost_where_it_grazes(values, way):
    known = values["grazing_w_of_n=1"][0]

    def next_impact(omega):
        osc = vi.ImpactOscillator(omega=omega)
        start = orbit_of_one_impact(osc)
        hits = way.section(osc, 1, 1, start=start)
        return (hits["time"].values[0] - start.time) / osc.period, hits["velocity"].values[0]

    flight, velocity = next_impact(float(known["w"]) + 1e-6)
    assert flight == pytest.approx(1.0, abs=1e-9)
    assert velocity == pytest.approx(float(known["v"]), rel=1e-4)
    flight, velocity = next_impact(float(known["w"]) - 1e-6)
    assert flight == pytest.approx(float(known["tau_graze_over_T"]), abs=2e-3)
    assert velocity < 1e-2


def test_the_period_1_impact_2_orbit_at_w_095_and_its_indices(values, way):
    known = {
        name: float(value) for name, value in values["period_1_impact_2"]["w=0.95"].items() if isinstance(value, str)
    }
    osc = vi.ImpactOscillator(omega=0.95)
    hits = way.section(osc, 1000, 4)
    first = int(np.argmax(hits["velocity"].values[:2]))
    a, b = hits.isel(impact=first), hits.isel(impact=first + 1)
    for impact, name in (a, "a"), (b, "b"):
        assert float(impact["velocity"]) == pytest.approx(known[f"v_{name}"], rel=1e-12)
        assert float(impact["phase"]) == pytest.approx(known[f"phase_frac_{name}"], rel=1e-11)
    assert float(b["time"] - a["time"]) == pytest.approx(known["t_b_minus_t_a"], rel=1e-11)
    indices = way.indices(osc, ("std", "mean_velocity", "max_velocity", "impacts_per_period"), 300, 500)
    assert indices["std"] == pytest.approx(known["std"], rel=1e-11)
    assert indices["mean_velocity"] == pytest.approx(known["mean"], rel=1e-11)
    assert indices["max_velocity"] == pytest.approx(known["v_a"], rel=1e-11)
    assert indices["impacts_per_period"] == pytest.approx(2.0, rel=1e-3)
    cycle, growth = way.indices(osc, transient=200, sample=40 if way.slow else 5000), math.log(known["absmult"])
    assert (cycle["n_periods"], cycle["n_impacts"]) == (1, 2)
    near = {"rel": 1e-11} if way.slow else {"abs": 1e-8}
    assert cycle["lyapunov"] == pytest.approx(growth / osc.period, **near)
    assert cycle["lyapunov_per_impact"] == pytest.approx(growth / 2, **near)
    # Two points half of a circle's arc 2 a apart have a mean vector of length cos a.
    apart = math.pi * (known["phase_frac_b"] - known["phase_frac_a"])
    assert cycle["impact_phase_spread"] == pytest.approx(1 - math.cos(apart), rel=1e-10)


@pytest.mark.parametrize(
    ("name", "start"), [("w=2.8,y-1", vi.State(-1.0)), ("w=0.9,liftoff", REST), ("w=0.9,liftoff", "at the release")]
)
def test_the_first_20_impacts(values, way, name, start):
    known = values["first_20_impacts"][name]
    osc = vi.ImpactOscillator(omega=float(name[2:5]))
    start = vi.State(0.0, 0.0, math.pi / osc.omega) if start == "at the release" else start
    hits = way.section(osc, start=start)
    allowed = 1e-13 * max(1.0, float(known["linear_error_amplification"]))
    for part, unit in ("time", 1.0), ("velocity", min(1.0, osc.velocity_scale)):
        listed = np.array([float(impact[part[0]]) for impact in known["impacts"]])
        assert np.abs(hits[part].values - listed).max() < allowed * unit


def test_the_sticking_orbit_at_w_01_impact_by_impact(values, way):
    known = values["sticking_w=0.1"]
    orbit = way.simulate(vi.ImpactOscillator(omega=0.1), periods=1.9)
    release = float(known["lift_off_t"])
    assert orbit["release_time"].values[0] == pytest.approx(release, rel=1e-14)
    number = len(known["impacts"])
    times, speeds = (np.array([float(one[part]) for one in known["impacts"]]) for part in ("t_minus_liftoff", "v"))
    assert orbit["impact_time"].values[:number] - release == pytest.approx(times, rel=1e-12)
    assert orbit["impact_velocity"].values[:number] == pytest.approx(speeds, rel=1e-11, abs=1e-13)
    end = float(known["t_accumulation_minus_liftoff"])
    assert orbit["stick_time"].values[1] - release == pytest.approx(end, rel=1e-12)
    stuck = orbit["release_time"].values[1] - orbit["stick_time"].values[1]
    assert stuck == pytest.approx(float(known["stuck_duration"]), rel=1e-11)


@pytest.mark.parametrize("cut", ["1e-2", "1e-3", "1e-4", "1e-6", "1e-7", "1e-9"])
def test_the_chatter_ends_at_the_same_time_wherever_it_is_cut(values, way, cut):
    known = values["sticking_w=0.1"]
    osc, cut = vi.ImpactOscillator(omega=0.1), float(cut)
    orbit = way.simulate(osc, periods=1.9, tolerances=vi.Tolerances(chatter=cut))
    end = orbit["stick_time"].values[1] - orbit["release_time"].values[0]
    # The closed tail is exact to second order in its length, 8 times the cut; to first order for systems.
    allowed = max(1e-12, cut**2 * 10.0 if way.as_system else cut**3 * 1e3)
    if way.slow and cut <= 1e-4:
        allowed = 1e-13 * osc.period
    assert end == pytest.approx(float(known["t_accumulation_minus_liftoff"]), abs=allowed)


@pytest.mark.parametrize("cut", ["1e-2", "1e-3", "1e-4", "1e-6", "1e-9"])
def test_std_of_a_chattering_orbit_depends_on_the_cut_as_known(values, way, cut):
    count, mean, std = values["sticking_w=0.1"]["std_if_series_cut_at_v_threshold"][cut]
    window, tolerances = (
        {"transient": int(count), "sample": (11 if way.slow else 20) * int(count)},
        vi.Tolerances(chatter=float(cut)),
    )
    indices = way.indices(vi.ImpactOscillator(omega=0.1), ("std", "mean_velocity"), **window, tolerances=tolerances)
    assert indices["std"] == pytest.approx(float(std), rel=1e-11)
    assert indices["mean_velocity"] == pytest.approx(float(mean), rel=1e-11)
    assert indices["status"] == vi.Status.STICKING


def test_chaotic_statistics_at_w_28(values, way):
    known, sample = values["lyapunov_w=2.8"], 1_000 if way.slow else 400_000
    names = {"std": "v_std", "mean_velocity": "v_mean", "impacts_per_period": "impacts_per_period"}
    indices = way.indices(vi.ImpactOscillator(omega=2.8), (*names, "max_velocity"), sample=sample, start=vi.State(-1.0))
    for name, key in names.items():
        mean, error_of_4e7 = map(float, known[key])
        assert indices[name] == pytest.approx(mean, abs=5 * error_of_4e7 * np.sqrt(4e7 / sample))
    assert indices["max_velocity"] <= float(known["v_max"]) + 1e-6


def test_unforced_chatter_against_a_preloaded_stop_ends_as_the_sum_of_its_flights(values, way):
    known = float(values["static_chatter_f=0_c=0_m=k=1_g=-1"]["t_inf"])
    osc, start = vi.ImpactOscillator(damping=0.0, amplitude=0.0, gap=-1.0, omega=1.0), vi.State(-1.0, 1.0)
    orbit, hits = way.simulate(osc, start=start, periods=3), way.section(osc, start=start, sample=1000)
    assert orbit["stick_time"].values[-1] == pytest.approx(known, rel=1e-13)
    assert np.isnan(orbit["release_time"].values[-1])
    assert int(hits["status"]) == int(orbit["status"]) == vi.Status.STUCK_FOREVER
    assert hits["velocity"].values == pytest.approx(0.8 ** np.arange(hits.sizes["impact"]), rel=1e-12)


def test_impacts_agree_with_a_ready_made_integrator_away_from_sticking(way):
    osc = vi.ImpactOscillator(omega=1.7, damping=0.3, gap=0.4)
    wall, still = Rigid(np.ones(1), osc.gap, osc.restitution, np.eye(1)), np.zeros(1)
    linear = {"mass": np.eye(1), "damping": 0.3 * np.eye(1), "stiffness": np.eye(1), "step": 0.2}
    march([wall], still, still, 8.0 * osc.period, load=lambda t: np.array([math.sin(1.7 * t)]), **linear)
    hits = way.section(osc, sample=6)
    found = np.column_stack([wall.times, wall.speeds])[:6]
    assert np.column_stack([hits["time"], hits["velocity"]]) == pytest.approx(found, abs=1e-9)


def test_a_release_leaves_with_the_third_derivative(way):
    osc = vi.ImpactOscillator(omega=0.7, gap=0.3)
    orbit = way.simulate(osc, start=vi.State(0.3, 0.0, 0.2 * osc.period), periods=0.4, samples_per_period=20_000)
    release = orbit["release_time"].values[0]
    since = orbit["time"].values - release
    soon = (since > 0) & (since < 0.02)
    jerk = osc.omega * math.sqrt(1 - 0.3**2)
    assert release / osc.period == pytest.approx(0.5 - math.asin(0.3) / (2 * math.pi), abs=1e-15)
    assert osc.gap - orbit["displacement"].values[soon] == pytest.approx(
        jerk * since[soon] ** 3 / 6, rel=0.01, abs=1e-15
    )


def test_a_free_flight_under_full_restitution_keeps_its_energy(way):
    osc = vi.ImpactOscillator(damping=0.0, amplitude=0.0, restitution=1.0, omega=1.0)
    hits = way.section(osc, start=vi.State(0.0, 1.0), sample=100 if way.slow else 1000)
    assert hits["velocity"].values == pytest.approx(1.0, rel=1e-12)
    assert np.diff(hits["time"].values) == pytest.approx(math.pi, rel=1e-12)
