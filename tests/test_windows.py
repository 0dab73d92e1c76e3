"""Stable windows: what continuation says lasts, the engine shows when swept up and down, and the other way round."""

import numpy as np
import pytest

import vibroimpact as vi
from vibroimpact.continuation import continue_orbit
from vibroimpact.continuation.window_matches import compare_windows
from vibroimpact.continuation.windows import follow_all, stable_windows, swept_windows
from vibroimpact.orbits import find_orbit

OSC = vi.ImpactOscillator()
RANGE = (0.4, 5.0)
NAMES = ("n_periods", "n_impacts", "lyapunov_per_impact")
GRID = np.linspace(*RANGE, 300)
LONGEST, MOST = 4, 4
SEVERAL = (2.6, 3.0)  # where orbits of several impacts are sought on a grid of starts


@pytest.fixture(scope="module")
def sweeps():
    more = {"transient_impacts": 2000, "sample_impacts": 400, "indices": NAMES}
    return {way: vi.bifurcation_diagram(OSC, omega=GRID, direction=way, **more) for way in ("up", "down")}


def sought():
    """Yield orbits found without any sweep: in closed form, and from grids of starts."""
    for omega in np.linspace(*RANGE, 62)[1:-1]:
        for n in range(1, LONGEST + 1):
            yield from find_orbit(OSC.replace(omega=omega), n_periods=n)
    for omega in SEVERAL:
        for n in range(1, LONGEST + 1):
            for p in range(2, MOST + 1):
                yield from find_orbit(OSC.replace(omega=omega), n_periods=n, n_impacts=p)


def seen(sweep):
    """Yield the orbits that the windows of a sweep lead to."""
    for window in swept_windows(sweep):
        n, p = window.n_periods, window.n_impacts
        if n <= LONGEST and 0 < p <= MOST:
            last = sweep.sel(omega=window.low)
            at = slice(int(last["count"]) - p, int(last["count"]))
            phase, velocity = last["phase"].values[at], last["velocity"].values[at]
            hardest = velocity.argmax()
            near = float(phase[hardest]), float(velocity[hardest])
            yield from find_orbit(OSC.replace(omega=window.low), n_periods=n, n_impacts=p, near=near)


@pytest.fixture(scope="module")
def branches(sweeps):
    orbits = [*sought(), *seen(sweeps["up"]), *seen(sweeps["down"])]
    return follow_all(orbits, "omega", RANGE, longest=LONGEST, most=MOST)


@pytest.fixture(scope="module")
def matches(branches, sweeps):
    return {way: compare_windows(branches, sweep, longest=LONGEST, most=MOST) for way, sweep in sweeps.items()}


@pytest.mark.parametrize("way", ["up", "down"])
def test_every_stable_window_of_continuation_is_seen_or_the_sweep_is_on_another_attractor(matches, way):
    windows = [match for match in matches[way] if match.source == "continuation"]
    assert len(windows) >= 9
    assert [match.message for match in windows if match.outcome not in ("found", "coexistence")] == []
    assert all(match.found + sum(match.others.values()) == match.values for match in windows)


@pytest.mark.parametrize("way", ["up", "down"])
def test_every_window_of_a_sweep_is_one_of_continuation_unless_its_name_is_longer(matches, way):
    windows = [match for match in matches[way] if match.source == "sweep"]
    assert sum(match.outcome == "found" for match in windows) >= 5
    assert [match.message for match in windows if match.outcome not in ("found", "out_of_scope")] == []
    beyond = [match.window for match in windows if match.outcome == "out_of_scope"]
    assert all(w.n_impacts not in range(1, MOST + 1) or w.n_periods > LONGEST for w in beyond)


def test_a_window_that_a_sweep_leaves_is_what_the_engine_keeps_to_when_started_on_it(matches):
    hidden = [match.window for found in matches.values() for match in found if match.outcome == "coexistence"]
    assert len(hidden) >= 4
    for window in hidden:
        omega = 0.5 * (window.low + window.high)
        (orbit, *_) = window.orbits_at(omega)
        kept = vi.parameter_map(OSC, omega=[omega], start=orbit.start, indices=NAMES, sample_impacts=200)
        assert (int(kept["n_periods"][0]), int(kept["n_impacts"][0])) == (window.n_periods, window.n_impacts)


def test_both_ways_together_leave_no_window_unseen(matches):
    for up, down in zip(matches["up"], matches["down"], strict=False):
        if up.source == down.source == "continuation":
            assert up.window.low == down.window.low
            assert max(up.found, down.found) > 0, up.message


def test_windows_end_at_the_values_known_with_50_digits(values, branches):
    doublings = [float(entry["w"]) for entry in values["period_doubling_w_of_n=1"]]
    (window,) = [w for w in stable_windows(branches) if w.name == "period-1 impact-1" and w.high > 2.0]
    assert window.ends == ("period_doubling", "period_doubling")
    for end in (window.low, window.high):
        assert min(abs(end - omega) for omega in doublings) < 1e-12


def test_a_window_narrower_than_a_step_of_the_branch_is_not_lost():
    (orbit,) = find_orbit(OSC.replace(omega=1.5))
    (narrow, _) = stable_windows(continue_orbit(orbit, "omega", (0.5, 2.0), step=0.5, virtual=False))
    assert narrow.ends == ("grazing", "period_doubling")
    assert (narrow.low, narrow.high) == pytest.approx((1.00711, 1.00830), abs=1e-5)


def test_what_no_branch_was_given_for_is_unexplained(sweeps):
    up = sweeps["up"].sel(omega=slice(1.9, 2.6))
    (match,) = compare_windows([], up)
    assert match.outcome == "unexplained"
    assert match.message.endswith(f"0 of {match.values} values; {match.values} without a reason, the first 1.90769")


def test_a_motion_that_still_settles_is_no_reason():
    unsettled = vi.bifurcation_diagram(
        OSC, omega=np.linspace(2.64, 2.652, 8), transient_impacts=0, sample_impacts=40, indices=NAMES
    )
    branches = follow_all(find_orbit(OSC.replace(omega=2.6)), "omega", (2.5, 2.66))
    match = compare_windows(branches, unsettled)[0]
    assert (match.outcome, match.found) == ("unexplained", 0)


def test_branches_along_another_parameter_are_refused(sweeps):
    (orbit,) = find_orbit(OSC.replace(omega=2.0))
    with pytest.raises(ValueError, match="`branches` holds one along mass"):
        compare_windows([continue_orbit(orbit, "mass", (0.9, 1.1), step=0.2)], sweeps["up"])
    others = follow_all(find_orbit(OSC.replace(omega=2.0, restitution=0.7)), "omega", (1.9, 2.1))
    with pytest.raises(ValueError, match="`branches` holds one along omega"):
        compare_windows(others, sweeps["up"])


def test_a_sweep_that_does_not_name_its_motions_is_refused(sweeps):
    with pytest.raises(ValueError, match="`sweep` lacks n_periods; allowed"):
        swept_windows(sweeps["up"].drop_vars("n_periods"))
