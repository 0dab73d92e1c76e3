"""Stable windows: what continuation says lasts, the engine shows when swept up and down, and the other way round."""

import numpy as np
import pytest

import vibroimpact as vi
from vibroimpact.continuation.windows import follow_all, stable_windows, swept_windows
from vibroimpact.orbits import same_orbit
from vibroimpact.orbits.distance import Impacts

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
            yield from vi.find_orbit(OSC.replace(omega=omega), n_periods=n)
    for omega in SEVERAL:
        for n in range(1, LONGEST + 1):
            for p in range(2, MOST + 1):
                yield from vi.find_orbit(OSC.replace(omega=omega), n_periods=n, n_impacts=p)


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
            yield from vi.find_orbit(OSC.replace(omega=window.low), n_periods=n, n_impacts=p, near=near)


@pytest.fixture(scope="module")
def branches(sweeps):
    orbits = [*sought(), *seen(sweeps["up"]), *seen(sweeps["down"])]
    return follow_all(orbits, "omega", RANGE, longest=LONGEST, most=MOST)


def shown(sweep, at, window):
    """Whether the sweep is on the window's orbit at a value of its grid."""
    end = int(sweep["count"][at])
    last = slice(max(0, end - window.n_impacts), end)
    hits = Impacts(sweep["phase"].values[at, last], sweep["velocity"].values[at, last])
    return any(same_orbit(orbit, hits, tolerance=1e-6) for orbit in window.orbits_at(float(sweep["omega"][at])))


def on_another(sweep, at, window):
    """Whether the sweep has settled on another motion: another cycle, sticking, chaos or no impacts."""
    name = int(sweep["n_periods"][at]), int(sweep["n_impacts"][at])
    exponent = float(sweep["lyapunov_per_impact"][at])
    return name[0] > 0 or exponent > 0 or exponent == -np.inf or np.isnan(exponent)


def inside(window):
    """Return where on the grid a window lies; nowhere if it is hardly wider than the grid's steps."""
    values = np.flatnonzero((window.low < GRID) & (window.high > GRID))
    return values if window.high - window.low > 3 * (GRID[1] - GRID[0]) else values[:0]


@pytest.fixture(scope="module")
def windows(branches):
    return [window for window in stable_windows(branches) if len(inside(window))]


@pytest.fixture(scope="module")
def missed(windows, sweeps):
    """Return, for each direction, where on each window the sweep is not on its orbit."""
    return {
        way: [[at for at in inside(window) if not shown(sweep, at, window)] for window in windows]
        for way, sweep in sweeps.items()
    }


@pytest.mark.long
@pytest.mark.parametrize("way", ["up", "down"])
def test_every_stable_window_of_continuation_is_seen_or_the_sweep_is_on_another_attractor(windows, missed, sweeps, way):
    assert len(windows) >= 9
    for window, values in zip(windows, missed[way], strict=True):
        assert all(on_another(sweeps[way], at, window) for at in values), window


@pytest.mark.long
@pytest.mark.parametrize("way", ["up", "down"])
def test_every_window_of_a_sweep_is_one_of_continuation_unless_its_name_is_longer(branches, sweeps, way):
    found = 0
    for window in swept_windows(sweeps[way]):
        n, p = window.n_periods, window.n_impacts
        values = np.flatnonzero((window.low <= GRID) & (window.high >= GRID))
        if len(values) <= 3 or n > LONGEST or not 0 < p <= MOST:
            continue
        found += 1
        alike = [w for w in stable_windows(branches) if (w.n_periods, w.n_impacts) == (n, p)]
        for at in values:
            assert any(w.low <= GRID[at] <= w.high and shown(sweeps[way], at, w) for w in alike), (window, GRID[at])
    assert found >= 5


@pytest.mark.long
def test_a_window_that_a_sweep_leaves_is_what_the_engine_keeps_to_when_started_on_it(windows, missed):
    hidden = [window for values in missed.values() for window, left in zip(windows, values, strict=True) if left]
    assert len(hidden) >= 4
    for window in hidden:
        omega = 0.5 * (window.low + window.high)
        (orbit, *_) = window.orbits_at(omega)
        kept = vi.parameter_map(OSC, omega=[omega], start=orbit.start, indices=NAMES, sample_impacts=200)
        assert (int(kept["n_periods"][0]), int(kept["n_impacts"][0])) == (window.n_periods, window.n_impacts)


@pytest.mark.long
def test_both_ways_together_leave_no_window_unseen(windows, missed):
    for window, up, down in zip(windows, missed["up"], missed["down"], strict=True):
        assert min(len(up), len(down)) < len(inside(window)), window


@pytest.mark.long
def test_windows_end_at_the_values_known_with_50_digits(values, branches):
    doublings = [float(entry["w"]) for entry in values["period_doubling_w_of_n=1"]]
    (window,) = [w for w in stable_windows(branches) if w.name == "period-1 impact-1" and w.high > 2.0]
    assert window.ends == ("period_doubling", "period_doubling")
    for end in (window.low, window.high):
        assert min(abs(end - omega) for omega in doublings) < 1e-12


def test_a_window_narrower_than_a_step_of_the_branch_is_not_lost():
    (orbit,) = vi.find_orbit(OSC.replace(omega=1.5))
    (narrow, _) = stable_windows(vi.continue_orbit(orbit, "omega", (0.5, 2.0), step=0.5, virtual=False))
    assert narrow.ends == ("grazing", "period_doubling")
    assert (narrow.low, narrow.high) == pytest.approx((1.00711, 1.00830), abs=1e-5)


@pytest.mark.long
def test_a_sweep_that_does_not_name_its_motions_is_refused(sweeps):
    with pytest.raises(ValueError, match="`sweep` lacks n_periods; .*indices="):
        swept_windows(sweeps["up"].drop_vars("n_periods"))


def test_two_orbits_of_one_impact_at_one_value_lie_on_branches_of_their_own():
    osc = vi.ImpactOscillator(damping=0.05, gap=0.3, omega=2.4)
    fast, slow = vi.find_orbit(osc, n_periods=2)
    branches = follow_all([fast, slow, *vi.find_orbit(osc.replace(omega=2.5), n_periods=2)], "omega", (2.2, 2.6))
    assert [branch.outcome for branch in branches] == [("grazing", "range"), ("range", "range")]
    assert all(branch.values.min() < 2.4 < branch.values.max() for branch in branches)
