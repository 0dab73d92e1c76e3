"""The time at rest and the energy lost are those of the rests and impacts of a cycle, or else of the window."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from codes import ONE_MASS, name_of
from systems import one_mass, system

OSC = vi.ImpactOscillator()
FAR = vi.State(-1.0)
RATES = ("lyapunov", "lyapunov_per_impact", "dissipation", "stick_fraction")


# Rests


@ONE_MASS
def test_a_complete_chatter_forgets_all_and_has_its_name_its_rest_and_its_loss(values, way):
    known = values["sticking_w=0.1"]
    indices = way.indices(vi.ImpactOscillator(omega=0.1), transient=100, sample=950)
    speeds = [float(impact["v"]) for impact in known["impacts"]]
    squares = math.fsum(v * v for v in speeds) + (0.8 * speeds[-1]) ** 2 / (1 - 0.64)
    assert (*name_of(indices), indices["status"]) == (1, -1, vi.Status.STICKING)
    assert indices["lyapunov"] == indices["lyapunov_per_impact"] == -math.inf
    assert indices["stick_fraction"] == pytest.approx(float(known["stuck_duration"]) / float(known["T"]), rel=1e-12)
    assert indices["dissipation"] == pytest.approx(0.5 * 0.36 * squares, rel=1e-12)


@ONE_MASS
@pytest.mark.long(but=2)
@pytest.mark.parametrize("window", [(0, 100), (37, 200), (95, 10), (300, 1)])
def test_a_sticking_cycle_tells_the_same_whatever_the_window_once_it_was_left_twice(way, window):
    osc = vi.ImpactOscillator(omega=0.1)
    settled, indices = (
        way.indices(osc, transient=100, sample=500),
        way.indices(osc, transient=window[0], sample=window[1]),
    )
    for name in (*RATES, "n_periods", "n_impacts", "grazing_margin"):
        assert indices[name] == pytest.approx(settled[name], rel=0.0 if way.slow else 1e-12), name


@ONE_MASS
def test_without_rebound_a_sticking_cycle_counts_its_impacts_and_rests_from_each_to_its_release(way):
    osc = vi.ImpactOscillator(restitution=0.0, omega=0.5, gap=0.2)
    indices, hits = way.indices(osc, transient=100, sample=60), way.section(osc, 100, 60)
    rests = (hits["release_time"] - hits["stick_time"]).values[-4:] / osc.period
    assert name_of(indices) == (1, 2)
    assert indices["stick_fraction"] == pytest.approx(rests.mean(), rel=1e-12)
    assert indices["dissipation"] == pytest.approx(0.5 * (hits["velocity"].values[-2:] ** 2).sum(), rel=1e-12)
    assert indices["lyapunov"] == -math.inf


@pytest.mark.parametrize("way", ["witness"], indirect=True)
def test_a_rest_in_the_window_ends_all_memory(way):
    osc = vi.ImpactOscillator(omega=0.1)
    # From the stop at 0.55 T it leaves with the force pulling, chatters from 0.02 T on and rests once by 1.5 T.
    start = vi.State(0.0, 0.0, 0.55 * osc.period)
    hits, indices = way.section(osc, 0, 95, start=start), way.indices(osc, transient=0, sample=95, start=start)
    assert hits.sizes["stick"] == 1
    assert indices["lyapunov"] == indices["lyapunov_per_impact"] == -math.inf
    assert name_of(indices) == (0, 0)
    span = float(hits["time"][-1] - hits["time"][0])
    assert indices["stick_fraction"] == pytest.approx(
        float(hits["release_time"][0] - hits["stick_time"][0]) / span, rel=1e-12
    )


@pytest.mark.usefixtures("modal_engine")
def test_the_share_of_time_at_rest_is_that_of_the_rests():
    """Of a coupled system's rests between a cycle's impacts, stop by stop."""
    stop = [vi.Stop(direction=[1, 0], gap=0.0, restitution=0.4), vi.Stop(direction=[0, 1], gap=0.3, restitution=0.0)]
    pair = system(np.eye(2), 0.1 * np.eye(2), [[2, -1], [-1, 2]], 0.3, stop, {1: [1.0, 0.7]})
    how = {"transient_impacts": 300, "sample_impacts": 212}  # the last one is number 2^9
    sweep = vi.parameter_map(pair, omega=[0.3], by_stop=True, indices=("stick_fraction", "n_periods"), **how).isel(
        omega=0
    )
    hits = vi.impact_section(pair, **how)
    periods = int(sweep["n_periods"])
    assert periods > 0
    time = hits["time"].values
    for number, name in enumerate(pair.stop_names):
        rests = hits["stick_stop"].values == name
        begun, ended = hits["stick_time"].values[rests], hits["release_time"].values[rests]
        within = (begun >= time[0]) & (begun < time[0] + periods * pair.period * (1 - 1e-9))
        share = (ended - begun)[within].sum() / (periods * pair.period)
        assert float(sweep["stick_fraction"][number]) == pytest.approx(share, rel=1e-9, abs=1e-12)
    assert float(sweep["stick_fraction"].max()) > 0.1


# Losses


def test_away_from_cycles_the_loss_is_that_of_the_impacts_after_the_first_over_the_window(way):
    osc = vi.ImpactOscillator(omega=4.0, mass=0.5, restitution=0.85)
    hits, indices = way.section(osc, 10, 50, start=FAR), way.indices(osc, transient=10, sample=50, start=FAR)
    turns = hits["time"].values / osc.period
    lost = sum(0.5 * 0.5 * (v**2 - (0.85 * v) ** 2) for v in hits["velocity"].values[1:])
    assert indices["n_periods"] == 0
    assert indices["dissipation"] == pytest.approx(lost / (turns[-1] - turns[0]), rel=1e-12)


@ONE_MASS
def test_dissipation_converges_where_the_std_depends_on_the_cut(way):
    sample = 1000 if way.slow else 5000
    coarse, fine = (
        way.indices(
            OSC.replace(omega=0.1), ("dissipation", "std"), sample=sample, tolerances=vi.Tolerances(chatter=cut)
        )
        for cut in (1e-6, 1e-9)
    )
    assert coarse["dissipation"] == pytest.approx(fine["dissipation"], rel=1e-11)
    assert abs(coarse["std"] - fine["std"]) > 0.005


def test_forces_and_powers_of_one_mass_balance_its_momentum_and_energy_over_a_cycle():
    """The stop's mean force is -k <y>; stop and damper take what the first harmonic of y takes from the load."""
    names, closed = ("mean_force", "work_rate", "damper_rate", "mean", "harmonic_amplitude", "harmonic_phase"), 0
    omega = np.linspace(0.6, 5.0, 30)
    for osc in (
        OSC,
        vi.ImpactOscillator(mass=2.0, damping=0.3, stiffness=5.0, amplitude=4.0, restitution=0.6, gap=-0.2),
        vi.ImpactOscillator(mass=2.0, damping=0.4, gap=0.2, amplitude=1.7),
        vi.ImpactOscillator(restitution=0.0, gap=0.2),
    ):
        how = {"omega": osc.natural_frequency * omega, "transient_impacts": 2000, "sample_impacts": 841}
        one = vi.parameter_map(osc, indices=[*names, "dissipation", "n_impacts"], of=0, **how)
        cycle = ((one["status"] == vi.Status.CLOSED) & (840 % one["n_impacts"].clip(1) == 0)).values
        force, work, damper, mean, size, phase = (one[name].values[cycle] for name in names)
        assert force == pytest.approx(-osc.stiffness * mean, rel=1e-9)
        power = -0.5 * osc.amplitude * how["omega"][cycle] * size * np.sin(phase)
        assert work + damper == pytest.approx(power, rel=1e-9)
        period = 2.0 * math.pi / how["omega"][cycle]
        assert one["dissipation"].values[cycle] == pytest.approx(work * period, rel=1e-9)
        closed += len(force)
        same = vi.parameter_map(one_mass(osc), indices=names, of=0, **how)
        for name in names:
            np.testing.assert_allclose(one[name], same[name], rtol=1e-12, err_msg=name)
    assert closed >= 30
