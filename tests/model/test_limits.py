"""Calls end, or say beforehand why they would not: counts and numbers have limits that name themselves."""

import os
import random
import signal
import threading
from importlib import import_module

import numpy as np
import pytest

import vibroimpact as vi
from designs import RARE, random_oscillator
from vibroimpact.backends import ImpactWindow, scalar
from vibroimpact.coexistence import measuring

OSC = vi.ImpactOscillator()
LONG = {"transient_impacts": 10**9, "sample_impacts": 1}
PHASE = np.linspace(0.0, 0.9, 1000)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: vi.impact_section(OSC, sample_impacts=10**30), "`sample_impacts` must be at most 1,000,000,000"),
        (lambda: vi.impact_section(OSC, sample_impacts=10**9), "`sample_impacts` needs 1e[+]09 rows, which take"),
        (lambda: vi.stroboscopic_section(OSC, sample_periods=10**9), "`sample_periods` needs 1e[+]09 rows"),
        (lambda: vi.simulate(OSC, samples_per_period=10**8), "`samples_per_period` needs 2e[+]09 rows"),
        (lambda: vi.simulate(OSC, periods=1e300), "`samples_per_period` needs 2e[+]302 rows"),
        (lambda: vi.parameter_map(OSC, omega=[1.0], transient_impacts=10**10), "`transient_impacts` must be at most"),
        (lambda: vi.find_orbit(OSC, n_impacts=10**30), "`n_impacts` must be at most 1,000, got 10+"),
        (lambda: vi.describe(OSC, within=1e300), "`within` must be above 0 and up to 1000, got 1e[+]300"),
        (lambda: vi.ImpactOscillator(amplitude=1e154), "`amplitude` must be of a size from 1e-60 to 1e[+]60, got"),
        (lambda: vi.parameter_map(OSC, mass=[1e-200, 1.0]), "`mass` must be of a size from 1e-60"),
        (
            lambda: vi.simulate(OSC, backend="fixed-step", time_step=1e-320),
            "`time_step` must be a finite number > 0",
        ),
        (lambda: vi.simulate(OSC, backend="fixed-step", time_step=1e-30), "`time_step` must be larger, or the motion"),
        (lambda: vi.State(0.0, 0.0, 1e300), None),
        (lambda: vi.parameter_map(OSC, omega=np.linspace(1, 2, 10_000), sample_impacts=10**9), "some 1e.13 steps, 56"),
        (lambda: vi.parameter_map(OSC, omega=[1.0], backend="fixed-step", time_step=1e-30), "`axes` make 1 cells of"),
        (lambda: vi.impact_section(OSC, backend="fixed-step", time_step=1e-30), "`time_step` must be larger, or"),
        (
            lambda: vi.bifurcation_diagram(OSC, omega=np.linspace(1, 2, 5000), **LONG),
            "5,000 values of 1,000,000,001 imp",
        ),
        (lambda: vi.basins(OSC, phase=PHASE, velocity=[1.0, 2.0], **LONG), "1,000,000,001 impacts or more each, which"),
    ],
)
def test_what_would_not_end_or_fit_is_refused_before_it_begins(call, words):
    if words is None:
        call()
        return
    with pytest.raises(ValueError, match=words):
        call()


@pytest.mark.long(but=1)
@pytest.mark.parametrize("numbers", [{"mass": 1e-10}, {"omega": 1e9}])
def test_a_motion_of_two_paces_far_apart_ends_past_its_budget(numbers):
    """It would take steps of the faster pace through flights of the slower one; a budget bounds these."""
    osc = vi.ImpactOscillator(**numbers)
    section = vi.impact_section(osc, sample_impacts=50, transient_impacts=0)
    assert int(section["status"]) == vi.Status.BUDGET


@pytest.mark.parametrize(
    "call",
    [
        lambda stiff: vi.simulate(stiff, periods=1e6, samples_per_period=1),
        lambda stiff: vi.find_orbit(stiff.replace(restitution=0.999999), n_periods=7, n_impacts=-1),
        lambda stiff: vi.attractors(stiff),
        lambda stiff: vi.parameter_map(stiff, restitution=[0.1, 0.5]),
    ],
)
def test_ctrl_c_is_heard_in_a_flight_of_many_steps(call):
    stiff = vi.ImpactOscillator(mass=1e-20)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        interrupt = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
        interrupt.start()
        with pytest.raises(KeyboardInterrupt):
            call(stiff)
    finally:
        interrupt.cancel()
        signal.signal(signal.SIGINT, before)


def test_what_ordinary_machines_need_is_granted():
    """A motion driven a hundred times faster than it swings, 131 steps a flight."""
    fast = vi.parameter_map(vi.ImpactOscillator(), omega=[100.0], start=vi.State(-1.0), sample_impacts=1000)
    assert np.isfinite(fast["std"].values).all()


def test_where_none_of_some_stiff_motions_ends_the_others_are_not_tried(monkeypatch):
    monkeypatch.setattr(scalar, "MOST", 1000)  # stiffness is what needs more than that
    osc, runner = RARE, measuring.Runner(tolerances=vi.Tolerances(steps_per_impact=1))
    status, steps = np.zeros(256, int), np.zeros(256, int)
    for which, outcome in runner.run(measuring.spread_cells(osc.cells({})), ImpactWindow(100, 500)):
        status[which], steps[which] = outcome["status"], outcome["steps"]
    assert (status == vi.Status.BUDGET).all()
    assert np.count_nonzero(steps) == measuring.PROBES
    assert runner.steps == steps.sum()


def test_motions_that_close_early_are_followed_together_however_long_the_window(monkeypatch):
    parts, run = [], measuring.run_sweep
    monkeypatch.setattr(
        measuring, "run_sweep", lambda engine, cells, *more: parts.append(len(cells)) or run(engine, cells, *more)
    )
    runner = measuring.Runner()
    runner.most = 1 << 25  # enough for 80 motions of 1e5 impacts that do not close
    cells = measuring.spread_cells(vi.ImpactOscillator(omega=2.0).cells({}))
    assert len(runner.measure(cells, ImpactWindow(50_000, 50_000))) == 256
    assert parts == [32, 224]
    assert runner.steps < runner.most / measuring.PARTS


def test_a_verdict_that_would_take_too_many_steps_ends_early_and_says_why(monkeypatch):
    monkeypatch.setattr(import_module("vibroimpact.verdict.present"), "STEP_LIMIT", 1_000_000)
    verdict = vi.describe(vi.ImpactOscillator(omega=2.8), parameters=["gap"])
    assert not verdict.complete
    assert verdict.motion.name == "chaotic"
    assert "the motions of this design take too many, as its" in " ".join(str(verdict).split())


def test_a_range_ends_where_the_numbers_of_a_design_do():
    verdict = vi.describe(vi.ImpactOscillator(amplitude=1e60, gap=1.0), parameters=["gap"])
    assert [edge.searched_to for edge in verdict.boundaries] == pytest.approx([-1e60, 1e60], rel=1e-3)


@pytest.mark.parametrize("power", [-190, 40, 190])
def test_a_verdict_scales_with_the_force_as_the_motion_does(power):
    """A power of two changes no rounding: the same words and changes, from the same work."""
    osc, scale = random_oscillator(random.Random(power)), 2.0**power
    plain, scaled = (
        vi.describe(one, parameters=["omega"]) for one in (osc, osc.replace(amplitude=scale, gap=osc.gap * scale))
    )
    assert (plain.motion.name, plain.cells, plain.steps) == (scaled.motion.name, scaled.cells, scaled.steps)
    edges = [[(edge.kind, edge.value, edge.change, edge.beyond) for edge in one.boundaries] for one in (plain, scaled)]
    assert repr(edges[0]) == repr(edges[1])
    for parts in ("attractors", "advice"):
        pairs = zip(getattr(plain, parts), getattr(scaled, parts), strict=True)
        assert all(a.max_velocity * scale == b.max_velocity for a, b in pairs)
    assert [(one.name, one.share) for one in plain.attractors] == [(one.name, one.share) for one in scaled.attractors]
    assert [one.value for one in plain.advice] == [one.value for one in scaled.advice]


def test_looks_at_a_motion_that_never_hits_end_past_their_budget_too():
    """Whatever else is known of its future, a step is a step."""
    osc, hasty = vi.ImpactOscillator(mass=1e-10, amplitude=0.0, omega=1.0, gap=1.0), vi.Tolerances(steps_per_impact=1)
    looks = vi.stroboscopic_section(osc, transient_periods=0, sample_periods=100, tolerances=hasty)
    assert int(looks["status"]) == vi.Status.BUDGET


def test_an_orbit_whose_flight_is_too_long_to_be_followed_says_so():
    (orbit,) = vi.find_orbit(vi.ImpactOscillator(omega=2.5e-11, stiffness=1e-4))[:1]
    assert not orbit.admissible
    assert "certified steps: it was not checked" in orbit.message


def test_whatever_the_budget_a_verdict_is_given():
    random = np.random.default_rng(4)
    for _ in range(12):
        osc = random_oscillator(random)
        for hasty in (vi.Tolerances(steps_per_impact=1), vi.Tolerances(steps_per_impact=3, flight_periods=1.0)):
            assert vi.attractors(osc, tolerances=hasty)
            assert str(vi.compare(osc, osc.replace(gap=osc.gap + 0.1), parameters=[], tolerances=hasty))
