"""The paper's own scheme: of fourth order in flight, of first at contact, and lost where the mass should rest."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from cells import make_cells
from vibroimpact.backends import ImpactWindow, Measurement, StroboscopicWindow, get_backend
from vibroimpact.indices import INDICES


def watch(osc, window, start=None, time_step=0.0005, **tolerances):
    backend = get_backend("fixed-step", time_step=time_step)
    (samples,) = backend.samples(make_cells(osc, start), Measurement(window, vi.Tolerances(**tolerances)))
    return samples


def times(samples, osc):
    return (samples.impact_periods + samples.impact_phase) * osc.period


def test_free_flight_converges_with_the_fourth_power_of_the_step(values):
    flow = values["flow_values"]["under"]
    _, damping, _, _, omega = map(float, flow["m_c_k_f_w"])
    osc = vi.ImpactOscillator(damping=damping, omega=omega, gap=10.0)

    def miss(time_step):
        looks = watch(osc, StroboscopicWindow(0, 2, None, 1), vi.State(-0.3, 0.4, 0.2), time_step)
        exact = get_backend("reference").samples(
            make_cells(osc, vi.State(-0.3, 0.4, 0.2)), Measurement(StroboscopicWindow(0, 2, None, 1))
        )[0]
        return abs(looks.look_displacement[1, 0] - exact.look_displacement[1, 0])

    coarse, fine = miss(osc.period / 40), miss(osc.period / 80)
    assert coarse / fine == pytest.approx(16, rel=0.15)
    assert miss(osc.period / 4000) < 1e-11


def test_impacts_lie_on_steps_and_err_with_the_first_power_of_the_step(values):
    known = values["first_20_impacts"]["w=2.8,y-1"]["impacts"][:3]
    osc = vi.ImpactOscillator(omega=2.8)
    samples = watch(osc, ImpactWindow(0, 3), vi.State(-1.0))
    on_steps = times(samples, osc) / 0.0005
    assert on_steps == pytest.approx(np.rint(on_steps), abs=1e-8)
    late = times(samples, osc)[0] - float(known[0]["t"])
    assert 0 <= late < 0.0005
    assert samples.impact_velocity == pytest.approx([float(i["v"]) for i in known], abs=5e-3)
    assert abs(samples.impact_velocity[0] - float(known[0]["v"])) > 1e-8
    closer = watch(osc, ImpactWindow(0, 3), vi.State(-1.0), time_step=5e-6)
    assert closer.impact_velocity == pytest.approx([float(i["v"]) for i in known], abs=5e-5)


def test_a_mass_that_should_rest_rattles_with_one_false_impact_a_step():
    # From rest on the stop the exact mass stays there until T/2.
    osc = vi.ImpactOscillator(omega=0.1)
    samples = watch(osc, StroboscopicWindow(0, 2, 0.0, 2))
    assert len(samples.rest_begin) == 0
    resting = times(samples, osc) < osc.period / 2
    assert resting.sum() == pytest.approx(osc.period / 2 / 0.0005, rel=1e-3)
    # Each false impact has the speed one step gives: v = (r v + a h)/1 settles near a h with |v| < h f/m/(1 - r).
    assert samples.impact_velocity[resting].max() < 0.0005 / 0.2
    (exact,) = get_backend("reference").samples(make_cells(osc, None), Measurement(StroboscopicWindow(0, 2, 0.0, 2)))
    assert len(exact.impact_velocity) == 0
    assert exact.rest_end[0, 1] == 0.5


def test_chatter_s_cut_does_not_apply():
    osc = vi.ImpactOscillator(omega=0.1)
    kept = [watch(osc, ImpactWindow(0, 500), chatter=cut).impact_velocity for cut in (1e-9, 1e-2)]
    assert (kept[0] == kept[1]).all()
    assert kept[0].min() < 1e-3


def test_a_stroboscopic_window_gives_every_impact_of_the_paper_s_time_window():
    osc = vi.ImpactOscillator(omega=2.8)
    samples = watch(osc, StroboscopicWindow(0, math.ceil(150 / osc.period) + 1))
    at = times(samples, osc)
    (every,) = get_backend("fixed-step").samples(make_cells(osc, None), Measurement(ImpactWindow(0, len(at))))
    assert (every.impact_velocity == samples.impact_velocity).all()
    paper = (at >= 100) & (at <= 150)
    assert (samples.look_periods + samples.look_phase)[-1] * osc.period >= 150
    assert paper.sum() > 20
    assert (np.diff(at) > 0).all()


def test_looks_are_made_at_the_nearest_step_and_told_so():
    osc = vi.ImpactOscillator(omega=2.0)
    samples = watch(osc, StroboscopicWindow(1, 30, 0.25, 3), time_step=0.003)
    told = (samples.look_periods + samples.look_phase) * osc.period
    wanted = (1.25 + np.arange(30) / 3) * osc.period
    assert told == pytest.approx(wanted, abs=0.0015 + 1e-9)
    assert told / 0.003 == pytest.approx(np.rint(told / 0.003), abs=1e-8)
    assert samples.last_clearance == pytest.approx(osc.gap - samples.look_displacement[-1, 0], abs=1e-15)


def test_it_finds_the_paper_s_settled_orbit_to_the_size_of_a_step(values):
    known = values["period_n_impact_1"]["w=2.0,n=1"]
    table = get_backend("fixed-step").indices(
        make_cells(vi.ImpactOscillator(), vi.State(-1.0)), Measurement(ImpactWindow(400, 50))
    )
    assert table["mean_velocity"][0] == pytest.approx(float(known["v"]), rel=2e-2)
    assert table["impacts_per_period"][0] == pytest.approx(1.0, abs=1e-4)
    assert vi.Status(table["status"][0]) == vi.Status.OK


def test_an_impact_at_the_start_is_recorded_at_the_start():
    samples = watch(vi.ImpactOscillator(), ImpactWindow(0, 1), vi.State(0.0, 2.0, 0.5))
    assert samples.impact_velocity.tolist() == [2.0]
    assert times(samples, vi.ImpactOscillator())[0] == pytest.approx(0.5, abs=1e-15)
    assert (samples.last_clearance, samples.last_velocity[0]) == (0.0, -1.6)


@pytest.mark.parametrize(
    ("changes", "start", "word"),
    [
        ({"gap": 5.0, "omega": 3.0}, None, "no_impact"),
        ({"gap": 1.0, "omega": 3.0}, vi.State(-2.0), "stopped_impacting"),
        ({"gap": 3.0, "omega": 3.0, "damping": 0.0}, vi.State(-2.9), "budget"),
        ({"stiffness": 1e9, "gap": -0.5}, vi.State(-1.0), "budget"),
        ({"omega": 1.0}, None, "short_window"),
    ],
    ids=["out of reach", "impacts cease", "a flight without end", "a step too long to stay finite", "few periods"],
)
def test_motions_end_with_the_statuses_of_the_contract(changes, start, word):
    samples = watch(vi.ImpactOscillator(**changes), ImpactWindow(10, 30), start, flight_periods=30.0)
    assert vi.Status(samples.status).word == word


@pytest.mark.parametrize("time_step", [0.0, -1e-3, math.nan, math.inf, "0.001", True])
def test_a_time_step_that_is_no_positive_number_is_refused(time_step):
    with pytest.raises(ValueError, match="`time_step` must be a finite number > 0, got"):
        get_backend("fixed-step", time_step=time_step)


def test_indices_are_those_that_its_samples_tell_and_no_more():
    cells, window = make_cells(vi.ImpactOscillator(omega=0.95), vi.State(-1.0)), Measurement(ImpactWindow(100, 50))
    ours, exact = (get_backend(name).indices(cells, window) for name in ("fixed-step", "reference"))
    assert get_backend("reference").known_indices == set(INDICES)
    for name, index in INDICES.items():
        if name in get_backend("fixed-step").known_indices:
            assert ours[name][0] == pytest.approx(exact[name][0], rel=0.05)
        else:
            assert ours[name][0] == 0 if index.dtype == "int32" else math.isnan(ours[name][0])
