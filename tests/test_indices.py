"""What the lanes tell beside the velocities: exponents, names of motions, losses, rest, near-misses."""

import math

import numpy as np
import pytest
from numba import njit

import vibroimpact as vi
from vibroimpact.backends import ImpactWindow, Measurement, get_backend
from vibroimpact.indices import INDICES, VELOCITY_INDICES
from vibroimpact.kernels.advance import IMPACT, RELEASE, advance
from vibroimpact.kernels.cell import Cell, prepare
from vibroimpact.kernels.flight import flow
from vibroimpact.kernels.law import saltation
from vibroimpact.kernels.results import ThoroughIndices, VelocityIndices
from vibroimpact.orbits import find_orbit

ALL = tuple(INDICES)
OSC = vi.ImpactOscillator()
SPREAD = np.linspace(0.025, 5.0, 100)


@pytest.fixture(scope="module")
def spread():
    return {
        closing: vi.parameter_map(OSC, omega=SPREAD, start=vi.State(-1.0), indices=ALL, early_closing=closing)
        for closing in (False, True)
    }


@njit(error_model="numpy")
def growths(cell, transient, impacts):
    """Walk an orbit with two tangent vectors; return ln of their stretching, ln of their area's, and the time in steps.

    The vectors are kept apart by turning the second square to the first at every step.
    """
    _, motion, k = prepare(cell, 1e-9)
    a0, a1, b0, b1 = 1.0, 0.0, 0.0, 1.0
    stretch, area, passed, number = 0.0, 0.0, 0.0, 0
    while number < transient + impacts:
        motion, event, v, x, _ = advance(motion, k)
        if event == RELEASE:
            return math.nan, math.nan, math.nan
        m0, m1, m2, m3 = flow(k.C, k.K, x)
        a0, a1, b0, b1 = m0 * a0 + m1 * a1, m2 * a0 + m3 * a1, m0 * b0 + m1 * b1, m2 * b0 + m3 * b1
        if motion.u == 0.0:
            m0, m1, m2, m3 = saltation(v, motion.s, k)
            a0, a1, b0, b1 = m0 * a0 + m1 * a1, m2 * a0 + m3 * a1, m0 * b0 + m1 * b1, m2 * b0 + m3 * b1
        size, product = math.hypot(a0, a1), abs(a0 * b1 - a1 * b0)
        if number >= transient:
            stretch += math.log(size)
            area += math.log(product)
            passed += x
        a0, a1 = a0 / size, a1 / size
        b0, b1 = -a1, a0
        number += event == IMPACT
    return stretch, area, passed


def walked(omega, transient=100, impacts=5000):
    cell = Cell(
        OSC.mass, OSC.damping, OSC.stiffness, OSC.amplitude, omega, OSC.restitution, OSC.gap, 1.0, 0.0, 0.0, 0.0
    )
    stretch, area, passed = growths(cell, transient, impacts)
    return stretch, area, passed * prepare(cell, 1e-9)[0]


def test_lanes_give_every_index_of_the_table():
    assert set(VelocityIndices._fields) == VELOCITY_INDICES
    assert set(ThoroughIndices._fields) == set(INDICES) - VELOCITY_INDICES


@pytest.mark.long
def test_the_exponents_of_two_vectors_sum_to_what_restitution_and_damping_take():
    for omega in (2.8, 4.3, 0.95):
        _, area, passed = walked(omega)
        expected = 2 * math.log(OSC.restitution) - OSC.damping / OSC.mass * passed / 5000
        assert area / 5000 == pytest.approx(expected, abs=1e-9)


def test_the_exponent_of_chaos_is_what_two_vectors_walked_alone_give():
    stretch, _, passed = walked(2.8)
    cell = vi.parameter_map(OSC, omega=[2.8], start=vi.State(-1.0), indices=["lyapunov", "lyapunov_per_impact"])
    # Directions forget where they started, and norms differ by a factor: both are a few units in 5000 ln.
    assert float(cell["lyapunov_per_impact"][0]) == pytest.approx(stretch / 5000, abs=5e-3)
    assert float(cell["lyapunov"][0]) == pytest.approx(stretch / passed, abs=3e-3)


def test_the_exponent_at_28_is_that_of_forty_million_impacts(values):
    starts = np.linspace(-1.9, -0.1, 50)
    found = [
        vi.parameter_map(
            OSC, omega=2.8 + 1e-12 * np.arange(20), start=vi.State(start), indices=["lyapunov"], sample_impacts=10_000
        )["lyapunov"].values
        for start in starts
    ]
    mean, error = (float(number) for number in values["lyapunov_w=2.8"]["lam_per_time_mean_se"])
    chaotic = np.concatenate(found)
    assert np.isfinite(chaotic).all()
    assert abs(chaotic.mean() - mean) < 5e-4  # 1e7 impacts
    assert abs(chaotic.mean() - mean) < 4 * math.hypot(error, chaotic.std() / math.sqrt(chaotic.size))


@pytest.mark.parametrize("case", ["w=2.0,n=1", "w=1.4,n=1", "w=2.6,n=1"])
def test_the_exponent_of_a_cycle_is_the_logarithm_of_its_multiplier(values, case):
    entry = values["period_n_impact_1"][case]
    omega = float(case[2:5])
    radius = max(abs(complex(float(a), float(b))) for a, b in (entry["mult1"], entry["mult2"]))
    found = vi.parameter_map(OSC, omega=[omega], start=near(omega), indices=ALL, early_closing=False)
    assert float(found["lyapunov"][0]) == pytest.approx(math.log(radius) * omega / (2 * math.pi), abs=1e-8)
    assert (int(found["n_periods"][0]), int(found["n_impacts"][0])) == (1, 1)


def test_an_orbit_that_sticks_forgets_everything_at_once(values):
    entry = values["sticking_w=0.1"]
    cell = vi.parameter_map(OSC, omega=[0.1], indices=ALL).isel(omega=0)
    assert float(cell["lyapunov"]) == -math.inf
    assert float(cell["lyapunov_per_impact"]) == -math.inf
    assert (int(cell["n_periods"]), int(cell["n_impacts"])) == (1, -1)
    assert vi.Status(int(cell["status"])) == vi.Status.STICKING
    assert float(cell["stick_fraction"]) == pytest.approx(float(entry["stuck_duration"]) / float(entry["T"]), abs=1e-12)


def test_a_mass_that_hits_once_and_stays_is_named_by_its_count():
    cell = vi.parameter_map(OSC.replace(restitution=0.0), omega=[0.4], indices=ALL).isel(omega=0)
    assert (int(cell["n_periods"]), float(cell["lyapunov"])) == (1, -math.inf)
    section = vi.impact_section(OSC.replace(restitution=0.0, omega=0.4), sample_impacts=50)
    a_period = section["time"] > section["time"][-1] - OSC.replace(omega=0.4).period + 1e-6
    assert int(cell["n_impacts"]) == int(a_period.sum())


def test_the_state_is_stepped_with_the_same_bits_whatever_is_observed(spread):
    plain = vi.parameter_map(OSC, omega=SPREAD, start=vi.State(-1.0), indices=VELOCITY_INDICES, early_closing=False)
    for name in VELOCITY_INDICES - {"impacts_per_period"}:
        np.testing.assert_array_equal(plain[name], spread[False][name], err_msg=name)
    np.testing.assert_array_equal(plain["status"], spread[False]["status"])


@pytest.mark.parametrize("number", [3, 17, 40, 97])
def test_a_cell_has_the_bits_it_has_alone_however_many_lanes_are_busy(number):
    """Some cells close early and some never do, so that those that are left close ranks."""
    engine, wanted = get_backend("cpu"), Measurement(ImpactWindow(100, 1000), indices=ALL)
    cells = OSC.cells({"omega": np.random.default_rng(number).uniform(1.0, 4.0, number)})
    together = engine.indices(cells, wanted)
    alone = [engine.indices(cells[i : i + 1], wanted) for i in range(number)]
    for name in together:
        np.testing.assert_array_equal(together[name], np.concatenate([one[name] for one in alone]), err_msg=name)


def test_closing_early_changes_no_index(spread):
    for name in ALL:
        whole, closed = spread[False][name].values.astype(float), spread[True][name].values.astype(float)
        finite = np.isfinite(whole)
        np.testing.assert_array_equal(finite, np.isfinite(closed), err_msg=name)
        scale = np.abs(whole[finite]).max()
        if name == "max_velocity":  # of a cell that is closed it is that of its cycle, without the way to it
            cycles = np.isin(spread[True]["status"].values, (vi.Status.CLOSED, vi.Status.STICKING))
            assert (closed[finite & cycles] <= whole[finite & cycles] * (1.0 + 1e-8)).all()
            finite &= ~cycles
        # Multipliers of a cycle are taken 1e-10 from it at most, at either time.
        np.testing.assert_allclose(whole[finite], closed[finite], rtol=0, atol=1e-8 * scale, err_msg=name)


def test_names_agree_with_impacts_a_period(spread):
    named = (spread[True]["n_periods"] > 0) & (spread[True]["n_impacts"] > 0)
    ratio = spread[True]["n_impacts"] / spread[True]["n_periods"]
    assert int(named.sum()) > 20
    np.testing.assert_array_equal(ratio.values[named], spread[True]["impacts_per_period"].values[named])


def test_names_agree_with_those_read_off_the_impacts(spread):
    from vibroimpact.recognition import recognise

    for at in range(0, len(SPREAD), 7):
        cell = spread[True].isel(omega=at)
        motion = recognise(
            vi.impact_section(OSC.replace(omega=SPREAD[at]), start=vi.State(-1.0), transient_impacts=2000)
        )
        if motion.kind not in ("periodic", "sticking"):
            continue
        assert (int(cell["n_periods"]), int(cell["n_impacts"])) == (motion.n_periods, motion.n_impacts), SPREAD[at]


RESTING = {"omega": np.linspace(0.1, 0.9, 9), "mass": np.linspace(0.2, 1.0, 9)}


def test_a_sticking_motion_is_named_only_if_one_digit_more_or_less_leaves_its_name():
    names = ("n_periods", "n_impacts", "lyapunov_per_impact")
    here = vi.parameter_map(OSC, indices=names, sample_impacts=1000, **RESTING)
    beside = {name: np.nextafter(values, 9.0) for name, values in RESTING.items()}
    there = vi.parameter_map(OSC, indices=names, sample_impacts=1000, **beside)
    named = (here["n_impacts"].values == -1) & (here["n_periods"].values > 0)
    assert named.sum() > 30
    assert np.array_equal(here["n_periods"].values[named], there["n_periods"].values[named])


def test_rests_at_times_that_rounding_decides_have_no_period():
    tube = vi.ImpactOscillator(
        mass=0.5, damping=0.63246, stiffness=2000.0, amplitude=2.0, omega=44.0 * np.pi, restitution=0.7, gap=0.0003
    )
    gaps = np.unique(tube.gap * (1.0 + 1e-16 * np.arange(-9, 10)))
    for backend in ("cpu", "reference"):
        cells = gaps if backend == "cpu" else gaps[:1]
        told = vi.parameter_map(
            tube,
            indices=("n_periods", "n_impacts", "lyapunov_per_impact"),
            sample_impacts=1000,
            backend=backend,
            gap=cells,
        )
        resting = told["status"].values == vi.Status.STICKING
        assert (told["n_periods"].values == 0).all()
        assert (told["lyapunov_per_impact"].values[resting] == -np.inf).all()
        assert (told["n_impacts"].values[resting] == -1).all()
        assert resting.sum() > len(cells) / 2 or backend == "reference"


def test_chaos_and_no_cycle_are_one_thing(spread):
    """A positive exponent means no cycle, and a cycle means a negative one."""
    exponent, named = spread[True]["lyapunov"], spread[True]["n_periods"] > 0
    assert not bool((named & (exponent > 0)).any())
    unnamed = exponent.values[~named.values & np.isfinite(exponent.values)]  # what rests now and then has none
    # What never repeats within 5100 impacts is chaotic, but for orbits that settle too slowly to be told.
    assert (unnamed > 0).mean() > 0.9
    assert len(unnamed) >= 15


def test_a_cycle_loses_at_the_stop_what_the_force_puts_in_and_the_damper_leaves(spread):
    for at in (10, 40, 60):
        osc = OSC.replace(omega=SPREAD[at])
        cell = spread[True].isel(omega=at)
        n = int(cell["n_periods"])
        if n == 0:
            continue
        orbit = vi.simulate(osc, start=vi.State(-1.0), periods=400 + n, samples_per_period=4000)
        tail = orbit.isel(time=slice(400 * 4000, None))
        t, v = tail["time"].values, tail["velocity"].values
        # Velocities jump at impacts, so the work is summed between them by the midpoint rule.
        y = tail["displacement"].values
        work = np.sum(np.sin(osc.omega * 0.5 * (t[1:] + t[:-1])) * np.diff(y)) * osc.amplitude
        damped = osc.damping * np.sum(0.5 * (v[1:] ** 2 + v[:-1] ** 2) * np.diff(t))
        assert float(cell["dissipation"]) == pytest.approx((work - damped) / n, rel=3e-3)


def test_dissipation_converges_where_the_std_depends_on_the_cut():
    def at(cut, name):
        cell = vi.parameter_map(OSC, omega=[0.1], indices=[name], tolerances=vi.Tolerances(chatter=cut))
        return float(cell[name][0])

    assert at(1e-6, "dissipation") == pytest.approx(at(1e-9, "dissipation"), rel=1e-11)
    assert abs(at(1e-6, "std") - at(1e-9, "std")) > 0.005


def test_equal_phases_have_no_spread_and_opposite_ones_all():
    one = vi.parameter_map(OSC, omega=[2.0], indices=["impact_phase_spread"])
    assert float(one["impact_phase_spread"][0]) == pytest.approx(0.0, abs=1e-12)
    section = vi.impact_section(OSC.replace(omega=2.8))
    expected = 1 - abs(np.exp(2j * np.pi * section["phase"].values).mean())
    chaos = vi.parameter_map(OSC, omega=[2.8], indices=["impact_phase_spread"])
    assert float(chaos["impact_phase_spread"][0]) == pytest.approx(expected, abs=1e-12)


def test_the_margin_of_a_cycle_falls_to_zero_where_it_grazes(values):
    graze = float(values["grazing_w_of_n=1"][0]["w"])
    steps = np.array([1e-6, 1e-5, 1e-4])
    cells = [
        vi.parameter_map(OSC, omega=[graze + step], start=near(graze + step), indices=["grazing_margin", "n_impacts"])
        for step in steps
    ]
    margins = np.array([float(cell["grazing_margin"][0]) for cell in cells])
    assert (margins > 0).all()
    np.testing.assert_allclose(margins / margins[-1], steps / steps[-1], rtol=1e-2)


def near(omega):
    """Return a state on the period-1 impact-1 orbit."""
    return find_orbit(OSC.replace(omega=omega))[0].start


@pytest.mark.parametrize("omega", [0.1, 0.2, 0.45, 0.95, 1.4, 2.8])
def test_the_margin_is_the_least_dip_of_a_finely_sampled_flight(omega):
    osc = OSC.replace(omega=omega)
    cell = vi.parameter_map(
        osc, omega=[omega], start=vi.State(-1.0), transient_impacts=1000, sample_impacts=300, indices=["grazing_margin"]
    )
    hits = vi.impact_section(osc, start=vi.State(-1.0), transient_impacts=1000, sample_impacts=300)["time"].values
    periods = int(hits[-1] / osc.period) + 1
    orbit = vi.simulate(osc, start=vi.State(-1.0), periods=periods, samples_per_period=2000)
    time, gap = orbit["time"].values, osc.gap - orbit["displacement"].values
    dips = np.flatnonzero((gap[1:-1] < gap[:-2]) & (gap[1:-1] <= gap[2:])) + 1
    dips = dips[(time[dips] > hits[0]) & (time[dips] < hits[-1])]
    every = orbit["impact_time"].values
    beside = np.abs(time[dips][:, None] - every[None, :]).min(axis=1) if dips.size else np.empty(0)
    dips = dips[beside > 2 * osc.period / 2000]
    expected = gap[dips].min() if dips.size else math.inf
    if math.isinf(expected):
        assert math.isinf(float(cell["grazing_margin"][0]))
    else:
        assert float(cell["grazing_margin"][0]) == pytest.approx(expected, abs=2e-4)


@pytest.mark.long
def test_the_witness_tells_the_same():
    omegas = [0.3, 0.95, 1.4, 2.0, 2.8]
    settings = {"omega": omegas, "start": vi.State(-1.0), "sample_impacts": 600, "indices": ALL}
    fast, witness = vi.parameter_map(OSC, **settings), vi.parameter_map(OSC, backend="reference", **settings)
    chaotic = 4
    for name in set(ALL) - {"impacts_per_period"}:  # exactly p/n here, over the window's span there
        a, b = fast[name].values[:chaotic].astype(float), witness[name].values[:chaotic].astype(float)
        np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-7, err_msg=name)


def test_an_index_that_a_back_end_cannot_tell_is_refused():
    with pytest.raises(ValueError, match="'fixed-step' does not give the index 'lyapunov', only std"):
        vi.parameter_map(OSC, omega=[2.0], indices=["lyapunov"], backend="fixed-step")


def test_where_the_mass_never_hits_nothing_is_told():
    cell = vi.parameter_map(OSC.replace(gap=50.0), omega=[3.0], indices=ALL)
    assert vi.Status(int(cell["status"][0])) == vi.Status.NO_IMPACT
    for name in ALL:
        value = cell[name].values[0]
        assert value == 0 if INDICES[name].dtype == "int32" else math.isnan(value), name


@pytest.mark.parametrize("direction", ["fresh", "up", "down"])
def test_a_diagram_tells_the_indices_of_the_motion_it_shows(direction):
    diagram = vi.bifurcation_diagram(
        OSC,
        omega=np.linspace(2.9, 3.05, 16),
        direction=direction,
        sample_impacts=500,
        indices=["n_periods", "n_impacts", "lyapunov", "max_velocity"],
    )
    assert diagram["lyapunov"].dims == ("omega",)
    # Of a cycle the largest velocity is told without the way to it; the sample's end holds short ones whole.
    told, cycle = diagram["n_periods"] > 0, (diagram["n_periods"] > 0) & (diagram["n_periods"] < 20)
    settled, sample = diagram["velocity"][:, -100:].max("impact"), diagram["velocity"].max("impact")
    np.testing.assert_allclose(diagram["max_velocity"].where(~told), sample.where(~told), rtol=1e-9)
    np.testing.assert_allclose(diagram["max_velocity"].where(cycle), settled.where(cycle), rtol=1e-6)
    one = (diagram["n_impacts"] == 1).values
    spread = (diagram["velocity"].max("impact") - diagram["velocity"].min("impact")).values
    assert (spread[one] < 1e-3).all()


def test_hysteresis_shows_in_the_names_of_up_and_down_sweeps():
    names = [
        vi.bifurcation_diagram(
            OSC, omega=np.linspace(2.9, 3.1, 41), direction=direction, indices=["n_impacts"], sample_impacts=200
        )["n_impacts"].values
        for direction in ("up", "down")
    ]
    assert (names[0] != names[1]).any()


def test_exponents_of_cycles_are_those_of_the_orbits_that_newton_finds(spread):
    compared = 0
    for at in range(0, len(SPREAD), 2):
        cell = spread[True].isel(omega=at)
        n, p = int(cell["n_periods"]), int(cell["n_impacts"])
        if not 0 < n <= 4 or not 0 < p <= 4:
            continue
        osc = OSC.replace(omega=SPREAD[at])
        hits = vi.impact_section(osc, start=vi.State(-1.0), transient_impacts=3000, sample_impacts=1)
        (orbit,) = find_orbit(osc, n_periods=n, n_impacts=p, near=(float(hits["phase"][0]), float(hits["velocity"][0])))
        assert float(cell["lyapunov"]) == pytest.approx(orbit.lyapunov, abs=1e-8), (osc.omega, n, p)
        compared += 1
    assert compared >= 10
