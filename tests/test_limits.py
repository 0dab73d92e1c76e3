"""Calls end, or say beforehand why they would not: counts and numbers have limits that name themselves."""

import os
import signal
import threading

import numpy as np
import pytest

import vibroimpact as vi

OSC = vi.ImpactOscillator()


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: vi.impact_section(OSC, sample_impacts=10**30), "`sample_impacts` must be at most 1,000,000,000"),
        (lambda: vi.impact_section(OSC, sample_impacts=10**9), "`sample_impacts` asks for 1e[+]09 rows, which take"),
        (lambda: vi.stroboscopic_section(OSC, sample_periods=10**9), "`sample_periods` asks for 1e[+]09 rows"),
        (lambda: vi.simulate(OSC, samples_per_period=10**8), "`samples_per_period` asks for 2e[+]09 rows"),
        (lambda: vi.simulate(OSC, periods=1e300), "`samples_per_period` asks for 2e[+]302 rows"),
        (lambda: vi.parameter_map(OSC, omega=[1.0], transient_impacts=10**10), "`transient_impacts` must be at most"),
        (lambda: vi.find_orbit(OSC, n_impacts=10**30), "`n_impacts` must be at most 1,000, got 10+"),
        (lambda: vi.describe(OSC, within=1e300), "`within` must be above 0 and up to 1000, got 1e[+]300"),
        (lambda: vi.ImpactOscillator(amplitude=1e154), "`amplitude` must be of a size from 1e-60 to 1e[+]60, got"),
        (lambda: vi.parameter_map(OSC, mass=[1e-200, 1.0]), "`mass` must be of a size from 1e-60"),
        (
            lambda: vi.simulate(OSC, backend="fixed-step", time_step=1e-320),
            "`time_step` must be a finite number > 0",
        ),
        (lambda: vi.simulate(OSC, backend="fixed-step", time_step=1e-30), "`time_step` must be longer, or the motion"),
        (lambda: vi.State(0.0, 0.0, 1e300), None),
    ],
)
def test_what_would_not_end_or_fit_is_refused_before_it_begins(call, told):
    if told is None:
        call()
        return
    with pytest.raises(ValueError, match=told):
        call()


@pytest.mark.parametrize("numbers", [{"mass": 1e-10}, {"omega": 1e9}])
def test_a_motion_of_two_paces_far_apart_ends_past_its_budget(numbers):
    """It would take steps of the faster pace through flights of the slower one; a budget bounds these."""
    osc = vi.ImpactOscillator(**numbers)
    section = vi.impact_section(osc, sample_impacts=50, transient_impacts=0)
    assert int(section["status"]) == vi.Status.BUDGET


def test_ctrl_c_is_heard_in_a_flight_of_many_steps():
    stiff = vi.ImpactOscillator(mass=1e-20)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        interrupt = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
        interrupt.start()
        with pytest.raises(KeyboardInterrupt):
            vi.simulate(stiff, periods=1e6, samples_per_period=1)
    finally:
        interrupt.cancel()
        signal.signal(signal.SIGINT, before)


def test_what_ordinary_machines_need_is_granted():
    """A motion driven a hundred times faster than it swings, 131 steps a flight."""
    fast = vi.parameter_map(vi.ImpactOscillator(), omega=[100.0], start=vi.State(-1.0), sample_impacts=1000)
    assert np.isfinite(fast["std"].values).all()
