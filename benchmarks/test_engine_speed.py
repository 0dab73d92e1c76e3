"""How fast the engine is, as ratios within one run; run with `make bench`."""

import time
import tracemalloc

import numpy as np
import pytest

import vibroimpact as vi

OSC = vi.ImpactOscillator()
SPREAD = np.linspace(0.05, 5.0, 128)
CELLS = 40_000  # of the paper's maps


def seconds(job, rounds=5):
    """Return the median time of a job, and what it returned, after a first round that compiles."""
    job()
    times = []
    for _ in range(rounds):
        begin = time.perf_counter()
        result = job()
        times.append(time.perf_counter() - begin)
    return float(np.median(times)), result


def ns_an_impact(rounds=5, **settings):
    elapsed, sweep = seconds(
        lambda: vi.parameter_map(OSC, early_closing=False, **{"omega": SPREAD, "workers": 1, **settings}), rounds
    )
    return elapsed / sweep.attrs["impacts_computed"] * 1e9, sweep


def test_an_impact_costs_at_most_150_ns_on_one_core():
    cost, sweep = ns_an_impact()
    steps = sweep.attrs["steps_computed"] / sweep.attrs["impacts_computed"]
    print(f"\n{cost:.0f} ns an impact, {steps:.2f} certified steps an impact, w spread over 0.05 to 5")
    assert cost <= 150


def test_the_lanes_are_at_least_500_times_the_compiled_fixed_step_scheme():
    omega = np.linspace(1.5, 4.5, 32)
    ours, _ = ns_an_impact(omega=omega)
    theirs, _ = ns_an_impact(rounds=1, omega=omega[:4], backend="fixed-step", transient_impacts=5, sample_impacts=20)
    print(f"\nfixed step {theirs / 1e3:.1f} us an impact, ours {ours:.0f} ns: {theirs / ours:.0f} times")
    assert theirs >= 500 * ours


def test_two_threads_are_at_least_18_times_one():
    omega = np.linspace(0.05, 5.0, 2048)
    settings = {"omega": omega, "sample_impacts": 1000, "rounds": 3}
    one, _ = ns_an_impact(**settings)
    two, _ = ns_an_impact(**settings, workers=2)
    print(f"\ntwo threads over one: {one / two:.2f}")
    assert one >= 1.8 * two


def test_the_mass_map_of_the_paper_takes_under_20_s():
    begin = time.perf_counter()
    sweep = vi.parameter_map(OSC, omega=np.linspace(0.025, 5, 200), mass=np.linspace(0.1, 5, 200), early_closing=False)
    elapsed = time.perf_counter() - begin
    print(f"\n(w, m) map: {elapsed:.1f} s, {sweep.attrs['impacts_computed']:.3g} impacts")
    assert elapsed < 20


def test_a_map_of_the_paper_s_size_stays_under_500_mb():
    tracemalloc.start()
    vi.parameter_map(
        OSC, omega=np.linspace(1, 3, 200), mass=np.linspace(0.5, 2, 200), transient_impacts=0, sample_impacts=5
    )
    peak = tracemalloc.get_traced_memory()[1] / 1e6
    tracemalloc.stop()
    print(f"\n{CELLS} cells: {peak:.1f} MB at most")
    assert peak < 500


@pytest.mark.parametrize("omega", [0.05, 0.9, 2.0, 2.8, 4.5])
def test_cost_of_single_regimes(benchmark, omega):
    cells = omega * (1 + 1e-9 * np.arange(64))
    run = lambda: vi.parameter_map(OSC, omega=cells, workers=1, sample_impacts=1000, early_closing=False)  # noqa: E731
    run()
    sweep = benchmark(run)
    benchmark.extra_info["steps_an_impact"] = sweep.attrs["steps_computed"] / sweep.attrs["impacts_computed"]
