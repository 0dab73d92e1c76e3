"""The engine against values computed with 50 digits by independent code."""

import numpy as np
import pytest

import vibroimpact as vi


def on_orbit(omega, velocity, phase):
    """Return an oscillator and the start just before an impact of a periodic orbit."""
    osc = vi.ImpactOscillator(omega=float(omega))
    return osc, vi.State(0.0, float(velocity), float(phase) * osc.period)


@pytest.mark.parametrize("name", ["w=2.0,n=1", "w=1.4,n=1", "w=2.6,n=1"])
def test_period_1_impact_1_orbits_settle_on_their_velocity_and_phase(values, name):
    known = values["period_n_impact_1"][name]
    osc = vi.ImpactOscillator(omega=float(name[2:5]))
    hits = vi.impact_section(osc, transient_impacts=2000, sample_impacts=5)
    assert hits["velocity"].values == pytest.approx(float(known["v"]), rel=1e-11)
    assert hits["phase"].values == pytest.approx(float(known["phase_frac"]), rel=1e-11)


@pytest.mark.parametrize("side", [0, 1])
def test_an_orbit_at_its_period_doubling_returns_to_itself(values, side):
    known = values["period_doubling_w_of_n=1"][side]
    osc, start = on_orbit(known["w"], known["v"], known["phase_frac"])
    hits = vi.impact_section(osc, start=start, transient_impacts=0, sample_impacts=4)
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


def test_the_period_1_orbit_is_lost_where_it_grazes(values):
    known = values["grazing_w_of_n=1"][0]
    grazing = float(known["w"])

    def next_impact(omega):
        # The orbit just beside the graze, by the closed form of METHOD: v from alpha, beta at g = 0.
        osc, start = on_orbit(omega, *closed_form_orbit(omega))
        hits = vi.impact_section(osc, start=start, transient_impacts=1, sample_impacts=1)
        flight = (hits["time"].values[0] - start.time) / osc.period
        return flight, hits["velocity"].values[0]

    flight, velocity = next_impact(grazing + 1e-6)
    assert flight == pytest.approx(1.0, abs=1e-9)
    assert velocity == pytest.approx(float(known["v"]), rel=1e-4)
    flight, velocity = next_impact(grazing - 1e-6)
    assert flight == pytest.approx(float(known["tau_graze_over_T"]), abs=2e-3)
    assert velocity < 1e-2


def closed_form_orbit(omega, damping=0.01, restitution=0.8):
    """Return velocity and phase of the period-1 impact-1 orbit for m = k = f = 1, g = 0."""
    half, period = damping / 2, 2 * np.pi / omega
    wd = np.sqrt(1 - half**2)
    decay, cosine, sine = np.exp(-half * period), np.cos(wd * period), np.sin(wd * period)
    p, q = decay * (cosine + half / wd * sine), decay * sine / wd
    delta = 1 - 2 * decay * cosine + decay**2
    alpha = (1 + restitution) * q / delta
    beta = -restitution - (1 + restitution) * (p - 1) / delta
    inertia, damper = 1 - omega**2, damping * omega
    size = 1 / np.hypot(inertia, damper)
    v = size / np.hypot(alpha, beta / omega)
    # The steady motion is size sin(w t - lag), and -alpha v, (1 - beta) v ... of it remain at the impact.
    lag = np.arctan2(damper, inertia)
    return v, ((np.arctan2(alpha * v, beta * v / omega) + lag) / (2 * np.pi)) % 1


def test_the_sticking_orbit_at_w_01_impact_by_impact(values):
    known = values["sticking_w=0.1"]
    osc = vi.ImpactOscillator(omega=0.1)
    orbit = vi.simulate(osc, periods=1.9)
    release = float(known["lift_off_t"])
    assert orbit["release_time"].values[0] == pytest.approx(release, rel=1e-14)
    for listed, time, velocity in zip(
        known["impacts"], orbit["impact_time"].values, orbit["impact_velocity"].values, strict=False
    ):
        assert time - release == pytest.approx(float(listed["t_minus_liftoff"]), rel=1e-12)
        assert velocity == pytest.approx(float(listed["v"]), rel=1e-11)
    end = float(known["t_accumulation_minus_liftoff"])
    assert orbit["stick_time"].values[1] - release == pytest.approx(end, rel=1e-12)
    assert orbit["release_time"].values[1] - orbit["stick_time"].values[1] == pytest.approx(
        float(known["stuck_duration"]), rel=1e-11
    )


@pytest.mark.parametrize("cut", ["1e-2", "1e-3", "1e-4", "1e-6", "1e-9"])
def test_the_chatter_ends_at_the_same_time_wherever_it_is_cut(values, cut):
    known = values["sticking_w=0.1"]
    osc = vi.ImpactOscillator(omega=0.1)
    orbit = vi.simulate(osc, periods=1.9, tolerances=vi.Tolerances(chatter=float(cut)))
    end = orbit["stick_time"].values[1] - orbit["release_time"].values[0]
    # The closed tail is exact to second order in the tail's length, which is about 8 times the cut.
    assert end == pytest.approx(float(known["t_accumulation_minus_liftoff"]), abs=max(1e-12, float(cut) ** 3 * 1e3))


@pytest.mark.parametrize("cut", ["1e-2", "1e-3", "1e-4", "1e-6", "1e-9"])
def test_std_of_a_chattering_orbit_depends_on_the_cut_as_known(values, cut):
    count, mean, std = values["sticking_w=0.1"]["std_if_series_cut_at_v_threshold"][cut]
    sweep = vi.parameter_map(
        vi.ImpactOscillator(),
        omega=[0.1],
        indices=("std", "mean_velocity"),
        transient_impacts=int(count),
        sample_impacts=20 * int(count),
        tolerances=vi.Tolerances(chatter=float(cut)),
    )
    assert float(sweep["std"][0]) == pytest.approx(float(std), rel=1e-11)
    assert float(sweep["mean_velocity"][0]) == pytest.approx(float(mean), rel=1e-11)
    assert int(sweep["status"][0]) == vi.Status.STICKING


def test_the_period_1_impact_2_orbit_at_w_095(values):
    known = values["period_1_impact_2"]["w=0.95"]
    hits = vi.impact_section(vi.ImpactOscillator(omega=0.95), transient_impacts=1000, sample_impacts=4)
    first = int(np.argmax(hits["velocity"].values[:2]))
    a, b = hits.isel(impact=first), hits.isel(impact=first + 1)
    assert float(a["velocity"]) == pytest.approx(float(known["v_a"]), rel=1e-11)
    assert float(b["velocity"]) == pytest.approx(float(known["v_b"]), rel=1e-11)
    assert float(a["phase"]) == pytest.approx(float(known["phase_frac_a"]), rel=1e-11)
    assert float(b["phase"]) == pytest.approx(float(known["phase_frac_b"]), rel=1e-11)
    assert float(b["time"] - a["time"]) == pytest.approx(float(known["t_b_minus_t_a"]), rel=1e-11)


def test_std_of_the_period_1_impact_2_orbit(values):
    known = values["period_1_impact_2"]["w=0.95"]
    sweep = vi.parameter_map(
        vi.ImpactOscillator(), omega=[0.95], indices=("std", "mean_velocity", "max_velocity", "impacts_per_period")
    )
    assert float(sweep["std"][0]) == pytest.approx(float(known["std"]), rel=1e-11)
    assert float(sweep["mean_velocity"][0]) == pytest.approx(float(known["mean"]), rel=1e-11)
    assert float(sweep["max_velocity"][0]) == pytest.approx(float(known["v_a"]), rel=1e-11)
    assert float(sweep["impacts_per_period"][0]) == pytest.approx(2.0, rel=1e-3)


@pytest.mark.parametrize(("name", "start"), [("w=2.8,y-1", vi.State(-1.0)), ("w=0.9,liftoff", vi.State(0.0, 0.0, 0.0))])
def test_the_first_20_impacts(values, name, start):
    known = values["first_20_impacts"][name]
    osc = vi.ImpactOscillator(omega=float(name[2:5]))
    hits = vi.impact_section(osc, start=start, transient_impacts=0, sample_impacts=20)
    allowed = 1e-13 * max(1.0, float(known["linear_error_amplification"]))
    times = [float(listed["t"]) for listed in known["impacts"]]
    speeds = [float(listed["v"]) for listed in known["impacts"]]
    assert np.abs(hits["time"].values - times).max() < allowed
    assert np.abs(hits["velocity"].values - speeds).max() < allowed * osc.velocity_scale


def test_chaotic_statistics_at_w_28(values):
    known = values["lyapunov_w=2.8"]
    sweep = vi.parameter_map(
        vi.ImpactOscillator(),
        omega=[2.8],
        indices=("std", "mean_velocity", "max_velocity", "impacts_per_period"),
        start=vi.State(-1.0),
        sample_impacts=400_000,
    )
    for name, key in (("std", "v_std"), ("mean_velocity", "v_mean"), ("impacts_per_period", "impacts_per_period")):
        mean, error_of_4e7 = map(float, known[key])
        assert float(sweep[name][0]) == pytest.approx(mean, abs=5 * error_of_4e7 * np.sqrt(4e7 / 4e5))
    assert float(sweep["max_velocity"][0]) <= float(known["v_max"]) + 1e-6


def test_unforced_chatter_against_a_preloaded_stop_ends_as_the_sum_of_its_flights(values):
    known = float(values["static_chatter_f=0_c=0_m=k=1_g=-1"]["t_inf"])
    osc = vi.ImpactOscillator(damping=0.0, amplitude=0.0, gap=-1.0, omega=1.0)
    orbit = vi.simulate(osc, start=vi.State(-1.0, 1.0), periods=3)
    assert orbit["stick_time"].values[-1] == pytest.approx(known, rel=1e-13)
    assert int(orbit["status"]) == vi.Status.STUCK_FOREVER
    expected = 0.8 ** np.arange(orbit.sizes["impact"])
    assert orbit["impact_velocity"].values == pytest.approx(expected, rel=1e-12)
