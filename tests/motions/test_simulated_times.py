"""Motions over seconds, at given times and under loads in pieces: the same motion, wherever it is looked at and cut."""

import json
import re

import numpy as np
import pytest

import vibroimpact as vi
from dop853 import Compliant, Rigid, march
from systems import CONTACT, a_random_machine, drawn
from vibroimpact.report import attractor_sentences, sentences_of

GROUND = vi.Stop(direction=-1.0, gap=1.0, restitution=0.5)
BALL = vi.ImpactSystem(mass=2.0, stiffness=0.0, force=vi.Force(constant=-4.0), stops=[GROUND])
OSC = vi.ImpactOscillator(omega=0.9, restitution=0.3)  # it rests at its stop in every period
STEP = vi.Force(constant=2.0)


def states(motion):
    columns = (motion[name].values.reshape(len(motion["time"]), -1) for name in ("displacement", "velocity"))
    return np.concatenate([*columns], axis=1)


def assert_same(one, other, within=1e-9):
    """Samples are equal to rounding and its growth; impacts, contacts and rests in number, time and size."""
    np.testing.assert_allclose(states(one), states(other), atol=within * (1.0 + np.abs(states(other)).max()))
    columns = "impact_time", "impact_velocity", "stick_time", "release_time", "stick_impulse", *CONTACT
    for name in (name for name in columns if name in other):
        np.testing.assert_allclose(one[name], other[name], rtol=1e-6, atol=1e-7, err_msg=name)
    assert one["status"] == other["status"]


def test_a_ball_falls_and_bounces_by_its_closed_form():
    """It lands after 1 s at 2 m/s, flights last 1, 1/2, 1/4 ... s, and it lies from 3 s on; no period is needed."""
    times = np.sort(np.random.default_rng(1).uniform(0.0, 2.7, 50))
    motion = vi.simulate(BALL, times=times)
    landings = np.array([1.0, 2.0, 2.5, 2.75])
    flight = np.searchsorted(landings, times, side="right")
    since = times - np.where(flight > 0, landings[flight - 1], 0.0)
    height = np.where(flight > 0, 0.5 ** (flight - 1) * since - since**2, 1.0 - times**2)
    np.testing.assert_allclose(motion["clearance"][:, 0], height, atol=1e-14)
    np.testing.assert_array_equal(motion["time"], times)
    np.testing.assert_allclose(motion["impact_time"], landings[landings <= times[-1]], rtol=1e-14)
    lying = vi.simulate(BALL, duration=5.0)
    assert float(lying["time"][-1]) == 5.0
    assert float(lying["stick_time"][0]) == pytest.approx(3.0, rel=1e-9)
    assert not [line for line in sentences_of(lying) if "driving" in line or "period" in line]


def test_a_free_oscillation_decays_by_its_closed_form():
    decay, rate = 0.05, np.sqrt(4.0 - 0.05**2)
    mass = vi.ImpactSystem(mass=1.0, damping=2 * decay, stiffness=4.0)
    times = np.geomspace(0.01, 40.0, 30)
    motion = vi.simulate(mass, start=vi.State([1.0]), times=times)
    exact = np.exp(-decay * times) * (np.cos(rate * times) + decay / rate * np.sin(rate * times))
    np.testing.assert_allclose(motion["displacement"][:, 0], exact, atol=1e-13)


@pytest.mark.parametrize("osc", [OSC, OSC.system, vi.ImpactOscillator(omega=2.8, gap=0.1)])
@pytest.mark.parametrize("start", [None, 0.3])
def test_times_on_the_grid_of_periods_give_the_same_bits(osc, start):
    if start is not None:
        start = vi.State(*[part[0] if osc.says_all else part for part in ([-1.0], [0.0])], time=start)
    usual = vi.simulate(osc, start=start, periods=7.5, samples_per_period=40)
    at_times = vi.simulate(osc, start=start, times=usual["time"].values)
    seconds = vi.simulate(osc, start=start, duration=7.5 * osc.period, samples_per_period=40)
    for name in usual.data_vars:
        assert usual[name].identical(at_times[name])
        assert usual[name].identical(seconds[name])


@pytest.mark.parametrize("backend", ["cpu", "reference"])
@pytest.mark.parametrize("osc", [OSC, OSC.system])
def test_where_a_motion_is_looked_at_does_not_change_it(osc, backend):
    """Impacts and rests are the same to the bit on an uneven grid, whose last sample is at the last time."""
    usual = vi.simulate(osc, periods=3, samples_per_period=50, backend=backend)
    rng = np.random.default_rng(2)
    grid = np.sort(np.concatenate([usual["time"].values, rng.uniform(0.0, 3.0 * osc.period, 100)]))
    uneven = vi.simulate(osc, times=grid, backend=backend)
    np.testing.assert_array_equal(uneven["time"], grid)
    for name in ("impact_time", "impact_velocity", "stick_time", "release_time"):
        np.testing.assert_array_equal(uneven[name], usual[name])
    shared = uneven.isel(time=np.searchsorted(grid, usual["time"].values))
    np.testing.assert_allclose(states(shared), states(usual), atol=1e-13)
    assert len(usual["stick_time"]) > 2


def test_the_last_instant_is_a_sample():
    motion = vi.simulate(OSC, duration=10.0, samples_per_period=30)
    assert float(motion["time"][-1]) == 10.0
    np.testing.assert_allclose(np.diff(motion["time"])[:-1], OSC.period / 30, rtol=1e-12)
    assert vi.simulate(OSC, times=[10.0])["displacement"].item() == pytest.approx(float(motion["displacement"][-1]))


@pytest.mark.long(but=8)
@pytest.mark.parametrize("seed", range(40))
def test_a_load_in_equal_pieces_is_the_whole_load(seed):
    """Of one mass and of systems, with rigid, compliant and moving stops, at rest at them, in contact or in flight."""
    rng = np.random.default_rng(seed)
    model, *state = (a_random_machine(rng),) if seed % 2 else drawn(rng, True)
    start = vi.State(*state) if state else None
    end = 2.5 * model.period
    times = np.linspace(0.0, end, 101)
    whole = vi.simulate(model, start=start, times=times)
    cuts = [0.0, *np.sort(rng.uniform(0.0, end, 5)), end]
    pieces = [(length, model.force) for length in np.diff(cuts)]
    assert_same(vi.simulate(model, start=start, times=times, pieces=pieces), whole, within=1e-7)


@pytest.mark.parametrize("backend", ["cpu", "reference"])
def test_an_oscillator_goes_on_from_piece_to_piece_where_it_rests(backend):
    whole = vi.simulate(OSC, duration=30.0, backend=backend)
    rests = whole["release_time"].values - whole["stick_time"].values
    within = (whole["stick_time"].values + 0.5 * rests)[1:]
    cuts = np.append(np.diff([0.0, *within[np.isfinite(within)]]), 30.0)
    cuts[-1] -= cuts[:-1].sum()
    pieces = [(length, OSC.system.force) for length in cuts]
    cut = vi.simulate(OSC, times=whole["time"].values, pieces=pieces, backend=backend)
    assert_same(cut, whole)
    assert [*cut.data_vars] == [*whole.data_vars]


@pytest.mark.parametrize("soft", [False, True])
def test_a_step_and_a_square_pulse_agree_with_an_integration_by_scipy(soft):
    """Two masses before a stop, pushed by 8 N for 0.6 s, then by none, then by a sine."""
    mass, damping = np.diag([2.0, 1.0]), np.array([[0.3, -0.1], [-0.1, 0.1]])
    stiffness = np.array([[300.0, -100.0], [-100.0, 100.0]])
    contact = {"stiffness": 4e3, "damping": 5.0} if soft else {"restitution": 0.8}
    stop = vi.Stop(direction=[0.0, 1.0], gap=0.05, name="bar", **contact)
    system = vi.ImpactSystem(mass=mass, damping=damping, stiffness=stiffness, stops=[stop])
    sine = vi.Force(omega=5.0, harmonics={1: [0.0, 8.0]})
    pieces = [(0.6, vi.Force(constant=[8.0, 0.0])), (0.7, None), (0.5, sine)]
    times = np.sort(np.random.default_rng(3).uniform(0.0, 1.8, 40))
    motion = vi.simulate(system, times=times, pieces=pieces)
    across = np.array([0.0, 1.0])
    bar = Compliant(across, 0.05, 4e3, 5.0) if soft else Rigid(across, 0.05, 0.8, mass)
    linear = {"mass": mass, "damping": damping, "stiffness": stiffness, "step": 0.05}
    loads = [lambda t: np.array([8.0, 0.0]), lambda t: np.zeros(2), lambda t: np.array([0.0, 8.0 * np.sin(5.0 * t)])]
    q, v, begin, found = np.zeros(2), np.zeros(2), 0.0, []
    for (length, _), load in zip(pieces, loads, strict=True):
        own = times[(times >= begin) & (times < begin + length)] - begin
        shifted = lambda t, load=load, begin=begin: load(t + begin)  # noqa: E731
        y, seen = march([bar], q, v, length, load=shifted, instants=own, **linear)
        q, v, begin, found = y[:2], y[2:], begin + length, found + [state for state, _ in seen]
    np.testing.assert_allclose(states(motion), found, atol=1e-9)
    assert len(motion["impact_time"]) > 2
    assert json.loads(motion.attrs["arguments"])["pieces"][1] == [pytest.approx(0.7), None]


def test_a_mass_that_is_pressed_against_a_stop_leaves_it_when_the_load_ends():
    held = vi.ImpactSystem(mass=1.0, stiffness=1.0, stops=[vi.Stop(direction=1.0, gap=0.0, restitution=0.3)])
    motion = vi.simulate(held, pieces=[(3.0, STEP), (1.0, vi.Force(constant=3.0)), (2.0, vi.Force(constant=-1.0))])
    assert motion["stick_time"].values.tolist() == [0.0]
    assert motion["release_time"].values.tolist() == [4.0]
    later = motion["time"].values >= 4.0
    exact = np.cos(motion["time"].values[later] - 4.0) - 1.0
    np.testing.assert_allclose(motion["displacement"].values[later, 0], exact, atol=1e-12)


def test_a_moving_stop_keeps_its_frequency():
    wall = vi.Stop(direction=1.0, gap=0.5, motion={1: 0.1}, name="wall")
    system = vi.ImpactSystem(mass=1.0, stiffness=1.0, force=vi.Force(omega=2.0), stops=[wall])
    times = np.linspace(0.0, 9.0, 500)
    assert_same(vi.simulate(system, pieces=[(9.0, None)], times=times), vi.simulate(system, times=times))
    with pytest.raises(ValueError, match="must keep the frequency of the model, 2 rad/s, at which 'wall' moves; got 3"):
        vi.simulate(system, pieces=[(1.0, vi.Force(omega=3.0))])


def without_a_period(seed):
    """Return a system of one to three masses without a load, or under a constant one, with or without losses."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    spring = rng.normal(size=(n, n))
    stiffness = (spring @ spring.T + np.eye(n)) * (rng.random() < 0.7)
    lossless = rng.random() < 0.5
    damping = (0.0 if lossless else 0.05) * (stiffness + np.eye(n))
    load = vi.Force(constant=rng.normal(size=n)) if rng.random() < 0.6 else None
    restitution = 1.0 if lossless else float(rng.uniform(0.3, 0.9))
    stops = [
        vi.Stop(direction=sign * np.eye(n)[-1], gap=float(rng.uniform(0.05, 1.0)), restitution=restitution, name=name)
        for sign, name in ((1.0, "right"), (-1.0, "left"))
    ]
    return vi.ImpactSystem(
        mass=np.diag(rng.uniform(0.5, 2.0, n)), damping=damping, stiffness=stiffness, force=load, stops=stops
    )


def sentences_on(model):
    """Yield what the functions say of a model, and the labels of their columns that have a value."""
    start = vi.State(np.zeros(model.coordinates).tolist(), np.ones(model.coordinates).tolist())
    gap = model.values["right_gap"]
    axis = {"right_gap": [gap, 1.1 * gap]}
    sampled = {"start": start, "sample_impacts": 30}
    section = vi.impact_section(model, transient_impacts=10, **sampled)
    sweep = vi.parameter_map(model, transient_impacts=10, indices="all", **sampled, **axis)
    diagram = vi.bifurcation_diagram(model, transient_impacts=10, **sampled, **axis)
    for dataset in (section, sweep, diagram):
        yield from sentences_of(dataset)
        yield from (str(each.attrs.get("long_name")) for each in dataset.values() if "no_value" not in each.attrs)
    for n_impacts in (1, 2, -1):
        yield vi.find_orbit(model, n_impacts=n_impacts).message
    yield from attractor_sentences(vi.attractors(model, sample_impacts=50), model)
    yield from str(vi.describe(model, parameters=["right_gap"], workers=1)).splitlines()


@pytest.mark.long(but=4)
@pytest.mark.parametrize("seed", range(24))
def test_nothing_that_is_said_of_a_model_without_a_period_counts_periods(seed):
    model = without_a_period(seed)
    for sentence in sentences_on(model):
        lacks = "no value" in sentence or sentence.startswith("the load has no frequency")
        assert lacks or not re.search(r"driving period|per period|\bperiods\b|period-\d", sentence), sentence


def test_an_index_of_periods_has_no_value_without_them():
    model = without_a_period(0)
    sweep = vi.parameter_map(model, indices="all", right_gap=[0.2, 0.3], sample_impacts=20)
    for name in ("impacts_per_period", "dissipation", "n_periods", "n_impacts", "impact_phase_spread"):
        assert "refers to the driving period, which the model lacks" in sweep[name].attrs["no_value"]
    with pytest.raises(ValueError, match="`dissipation` refers to the driving period"):
        vi.parameter_map(model, indices="dissipation", right_gap=[0.2, 0.3])


def test_a_bouncing_ball_repeats_after_one_impact_and_a_thrown_mass_after_two():
    ground = vi.Stop(direction=-1.0, gap=1.0, restitution=1.0, name="ground")
    ball = vi.ImpactSystem(mass=1.0, stiffness=0.0, force=vi.Force(constant=-9.81), stops=[ground])
    ends = [vi.Stop(direction=sign, gap=1.0, restitution=1.0) for sign in (1.0, -1.0)]
    thrown = vi.ImpactSystem(mass=1.0, stiffness=0.0, stops=ends)
    for model, start, gap, count in (
        (ball, None, "ground_gap", "1 impact per cycle"),
        (thrown, vi.State(0.0, 1.0), "stop_1_gap", "2 impacts per cycle"),
    ):
        diagram = vi.bifurcation_diagram(model, start=start, sample_impacts=20, **{gap: [1.0, 1.5]})
        assert sentences_of(diagram)[-1] == f"  {gap} 1 to 1.5 m: {count}"
        section = vi.impact_section(model, start=start, sample_impacts=20)
        assert section["phase"].isnull().all()
        assert vi.recognise(section).n_periods == 0
        with pytest.raises(ValueError, match="unknown `quantity` 'phase'; choose from velocity"):
            vi.plotting.bifurcation_diagram(diagram, quantity="phase")
        with pytest.raises(ValueError, match="`section` has no phases to draw: a phase is a fraction of the driving"):
            vi.plotting.impact_map(section)


def loaded_constantly(seed):
    """Return a chain of one to three masses that a constant load presses on stops, lossless or not, of any kind."""
    rng = np.random.default_rng(seed)
    n, lossless = int(rng.integers(1, 4)), seed % 2 == 0
    springs = rng.uniform(0.5, 2.0, n + 1)
    stiffness = np.diag(springs[:-1] + springs[1:]) - np.diag(springs[1:-1], 1) - np.diag(springs[1:-1], -1)
    law = {"stiffness": rng.uniform(5.0, 50.0)} if rng.random() < 0.5 else {"restitution": 1.0 if lossless else 0.6}
    return vi.ImpactSystem(
        mass=np.diag(rng.uniform(0.5, 2.0, n)),
        damping=(not lossless) * 0.05 * stiffness,
        stiffness=stiffness,
        force=vi.Force(constant=rng.uniform(0.5, 2.0, n)),
        stops=[vi.Stop(direction=np.eye(n)[-1], gap=rng.uniform(0.05, 0.3), name="bar", **law)],
    )


def slower(model, times):
    """Return the system whose motions are the same, but take longer."""
    matrices = {"mass": times**2 * model.mass, "damping": times * model.damping, "stiffness": model.stiffness}
    return vi.ImpactSystem(**matrices, force=model.force, stops=model.stops)


@pytest.mark.parametrize("seed", range(10))
def test_a_verdict_without_a_driving_period_counts_per_second_and_never_per_period(seed):
    model = loaded_constantly(seed)
    verdict, slow = (vi.describe(each, parameters=[], workers=1) for each in (model, slower(model, 7.0)))
    sweep = vi.parameter_map(model, bar_gap=[model.stops[0].gap], indices=tuple(verdict.indices), sample_impacts=20)
    reasons = {name: column.attrs["no_value"] for name, column in sweep.items() if "no_value" in column.attrs}
    assert verdict.no_value == verdict.to_dict()["no_value"] == reasons
    assert {"impacts_per_period", "dissipation", "n_periods", "impact_phase_spread"} <= set(reasons)
    for name in reasons:
        np.testing.assert_equal(verdict.indices[name], float(sweep[name][0]))
    assert all(np.isnan(one.dissipation) or one.dissipation == 0.0 for one in verdict.attractors)
    assert "period" not in str(verdict).replace("periodic", "")
    within = 1e-6 if model.coordinates == 1 else 0.3  # of chaos, only averages are the same
    assert slow.rate == pytest.approx(verdict.rate / 7.0, rel=within, nan_ok=True)
    assert slow.power == pytest.approx(verdict.power / 7.0, rel=within, abs=1e-9, nan_ok=True)
    if np.isfinite(verdict.rate):
        time = vi.impact_section(model, transient_impacts=127, sample_impacts=128)["time"].values
        assert verdict.rate == pytest.approx(127 / (time[-1] - time[0]), rel=1e-6)
        assert f"{verdict.rate:.2g} impacts per second" in str(verdict)
    other = vi.compare(model, slower(model, 7.0), parameters=[], workers=1).dataset
    assert {name for name, column in other.items() if "no_value" in column.attrs} == set(reasons)


def test_a_preloaded_system_without_a_load_settles():
    """Its stop lies beyond the rest position; there is no frequency to compute again with."""
    stop = vi.Stop(direction=1.0, gap=-0.2, restitution=0.8, name="stop")
    model = vi.ImpactSystem(mass=1.0, stiffness=4.0, damping=0.1, stops=[stop])
    assert [each.name for each in vi.attractors(model)] == ["at rest"]
    moved = vi.simulate(model, start=vi.State(-1.0, 0.0), duration=60.0)
    assert moved["displacement"].values[-1] == pytest.approx(-0.2)


@pytest.mark.parametrize("omega", np.random.default_rng(5).uniform(0.3, 30.0, 40).tolist())
def test_a_motion_under_pieces_is_sampled_up_to_their_end(omega):
    """Times counted in driving periods must not round beyond it, and are dense however slow the model's own load is."""
    osc = vi.ImpactOscillator(mass=2.0, stiffness=4e4, damping=10.0, omega=omega, gap=5e-4)
    motion = vi.simulate(osc, pieces=[(0.004, vi.Force(constant=50.0)), (0.1, None)], samples_per_period=20)
    assert motion["time"].values[[0, -1]] == pytest.approx([0.0, 0.104], rel=1e-12)
    assert motion.sizes["impact"] > 0
    assert motion["displacement"].values.max() == pytest.approx(5e-4, rel=0.01)  # it reaches its stop


def test_no_status_counts_periods_where_there_are_none():
    """Few impacts are a short window only for what is driven, and impacts per period have no value."""
    slot = [vi.Stop(direction=side, gap=1.0, restitution=1.0) for side in (1.0, -1.0)]
    free = {"mass": 1.0, "stiffness": 0.0, "stops": slot}
    for force, status in ((None, vi.Status.OK), (vi.Force(omega=1.0), vi.Status.SHORT_WINDOW)):
        model = vi.ImpactSystem(**free, force=force)
        hits = vi.impact_section(model, start=vi.State(0.0, 4.0), transient_impacts=0, sample_impacts=20)
        assert vi.Status(int(hits["status"])) == status
        motion = vi.simulate(model, start=vi.State(0.0, 4.0), times=[0.0, 10.0])
        counted = vi.impact_statistics(motion)
        assert counted["rate"].values.tolist() == [1.0, 1.0]
        assert bool(np.isnan(counted["impacts_per_period"]).all()) == (force is None)
        assert any("driving periods" in line for line in sentences_of(motion)) == (force is not None)
    with pytest.raises(ValueError, match="has no driving period, since its force has no frequency; use simulate"):
        vi.stroboscopic_section(vi.ImpactSystem(**free))


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ({"times": [0.0, 2.0, 1.0]}, "`times` must increase, got 2 s, then 1 s"),
        ({"times": [0.0, 1.0, 1.0]}, "`times` must increase, got 1 s, then again"),
        ({"times": [-0.5, 1.0]}, "`times` must not lie before the initial condition, at 0 s, got -0.5 s"),
        ({"times": [0.5, 1.0], "start": vi.State(-1.0, 0.0, 0.7)}, "before the initial condition, at 0.7 s, got 0.5 s"),
        ({"times": [0.0, np.nan]}, r"`times\[1\]` must be a finite number"),
        ({"times": [0.0, np.inf]}, r"`times\[1\]` must be a finite number"),
        ({"times": []}, "`times` must be a list of numbers"),
        ({"times": [1.0], "periods": 2}, "give either `periods` or `times`, not both"),
        ({"times": [1.0], "duration": 2.0}, "give either `duration` or `times`, not both"),
        ({"times": [1.0], "skip_periods": 2}, "`skip_periods` must be 0 with `times` or `pieces`"),
        ({"duration": 0.0}, "`duration` must be a finite number > 0"),
        ({"duration": 1.0, "periods": 1}, "give either `periods` or `duration`, not both"),
        ({"pieces": [(1.0, None)], "periods": 1}, "give either `periods` or `pieces`, not both"),
        ({"pieces": [(1.0, None), (0.0, STEP)]}, r"`pieces\[1\]` must last longer than 0 s, got 0 s"),
        ({"pieces": [(-1.0, None)]}, r"`pieces\[0\]` must last longer than 0 s, got -1 s"),
        ({"pieces": []}, "`pieces` must be at least one pair"),
        ({"pieces": [(1.0, 2.0)]}, r"`pieces\[0\]` must be a duration in s and a Force or None"),
        ({"pieces": [(1.0, None)], "times": [0.5, 1.5]}, "after the end of `pieces`, at 1 s, got 1.5 s"),
        ({"times": [1e50]}, "`times` needs some .* steps"),
    ],
)
def test_what_is_wrong_with_times_and_pieces_is_said(how, message):
    with pytest.raises(ValueError, match=message):
        vi.simulate(OSC, **how)
