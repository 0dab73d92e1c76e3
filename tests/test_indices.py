"""Indices beside the velocities, by both engines and the witness: exponents, names, losses, rests, near-misses."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

import vibroimpact as vi
from designs import orbit_of_one_impact
from oracles.one_impact import trace, transition
from systems import one_mass
from vibroimpact.indices import EVERY, INDICES, VELOCITY_INDICES
from vibroimpact.report import sentences_of

ALL = tuple(INDICES)
OSC = vi.ImpactOscillator()
SPREAD = np.linspace(0.025, 5.0, 100)
FAR = vi.State(-1.0)
CHAOS = vi.ImpactOscillator(omega=2.8)
# Of systems a rest's indices are averages over the window, and names need repetition alone.
ONE_MASS = pytest.mark.parametrize("way", ["engine", "witness"], indirect=True)
RATES = ("lyapunov", "lyapunov_per_impact", "dissipation", "stick_fraction")


@pytest.fixture(scope="module")
def spread():
    return {
        closing: vi.parameter_map(OSC, omega=SPREAD, start=FAR, indices=ALL, early_closing=closing)
        for closing in (False, True)
    }


def name_of(indices):
    return indices["n_periods"], indices["n_impacts"]


# Exponents


@pytest.mark.parametrize("omega", [1.4, 2.0, 2.6])
def test_the_exponent_of_a_period_1_orbit_is_that_of_its_50_digit_multipliers(values, way, omega):
    known = values["period_n_impact_1"][f"w={omega},n=1"]
    osc = vi.ImpactOscillator(omega=omega)
    growth = math.log(max(math.hypot(*map(float, known[name])) for name in ("mult1", "mult2")))
    indices = way.indices(osc, transient=200, sample=40 if way.slow else 5000)
    assert name_of(indices) == (1, 1)
    # At 2.0 the multipliers nearly meet, 5e-4 apart: a rounding of the trace counts 2000-fold.
    near = {"witness": 5e-12, "engine": 1e-8, "engine of systems": 1e-8}[way.name]
    assert indices["lyapunov"] == pytest.approx(growth / osc.period, abs=near)
    assert indices["lyapunov_per_impact"] == pytest.approx(growth, abs=2 * near * osc.period)


def test_a_period_1_impact_2_motion_has_its_name_its_50_digit_multiplier_and_its_spread(values, way):
    known = values["period_1_impact_2"]["w=0.95"]
    osc, growth = vi.ImpactOscillator(omega=0.95), math.log(float(known["absmult"]))
    indices = way.indices(osc, transient=200, sample=40 if way.slow else 5000)
    assert name_of(indices) == (1, 2)
    near = {"rel": 1e-11} if way.slow else {"abs": 1e-8}
    assert indices["lyapunov"] == pytest.approx(growth / osc.period, **near)
    assert indices["lyapunov_per_impact"] == pytest.approx(growth / 2, **near)
    # Two points half of a circle's arc 2 a apart have a mean vector of length cos a.
    apart = math.pi * (float(known["phase_frac_b"]) - float(known["phase_frac_a"]))
    assert indices["impact_phase_spread"] == pytest.approx(1 - math.cos(apart), rel=1e-10)


@pytest.mark.parametrize(
    ("n", "changes"),
    [
        (1, {"omega": 1.7, "gap": 0.1}),
        (2, {"omega": 4.1}),
        (1, {"omega": 2.8, "mass": 0.5, "restitution": 0.85}),
        (1, {"omega": 2.0, "damping": 2.5}),
        (1, {"omega": 2.2, "restitution": 0.6, "amplitude": 2.5, "gap": -0.1}),
    ],
)
def test_the_exponent_of_an_impact_1_motion_follows_from_its_trace_in_closed_form(way, n, changes):
    osc = vi.ImpactOscillator(**changes)
    indices, last = way.indices(osc, transient=600, sample=40), way.section(osc, 600, 40).isel(impact=-1)
    decay, _, _ = transition(osc, n * osc.period)
    sum_of_both = trace(osc, n * osc.period, float(last["phase"]), float(last["velocity"]))
    growth = math.log(max(abs(np.roots([1.0, -sum_of_both, osc.restitution**2 * decay**2]))))
    assert name_of(indices) == (n, 1)
    near = {"rel": 1e-9} if way.slow else {"rel": 1e-7, "abs": 1e-8}
    assert indices["lyapunov_per_impact"] == pytest.approx(growth, **near)
    assert indices["lyapunov"] == pytest.approx(growth / (n * osc.period), **near)


def test_an_orbit_that_repeats_but_is_unstable_is_no_cycle(way):
    osc = vi.ImpactOscillator(omega=1.15)
    start = orbit_of_one_impact(osc)
    hits, indices = way.section(osc, start=start), way.indices(osc, transient=0, sample=20, start=start)
    assert hits["velocity"].values == pytest.approx(start.velocity, rel=1e-10)
    assert name_of(indices) == (0, 0)
    assert indices["lyapunov"] > 0


DESIGNS = [
    CHAOS,
    vi.ImpactOscillator(omega=2.8, mass=0.3, stiffness=2.0, damping=0.2, gap=0.15, restitution=0.9),
    vi.ImpactOscillator(omega=3.0, damping=6.0, restitution=0.7),
]


@pytest.mark.parametrize("osc", DESIGNS, ids=["chaos", "off the stop", "overdamped"])
def test_growth_is_that_of_flights_and_saltations(way, osc):
    """Of a deviation (1, 0.7/h) with h = 2.4/L, of length |y| + h |y'|: the one after the other."""
    hits = way.section(osc, sample=60, start=FAR)
    times, v = np.array([0.0, *hits["time"].values]), hits["velocity"].values
    matrix = np.array([[0.0, 1.0], [-osc.stiffness / osc.mass, -osc.damping / osc.mass]])
    h = 2.4 / max(osc.omega, osc.natural_frequency, -np.linalg.eigvals(matrix).real.min())
    push = (osc.amplitude * np.sin(2 * math.pi * hits["phase"].values) - osc.stiffness * osc.gap) / osc.mass
    damp, r = osc.damping / osc.mass, osc.restitution
    deviation, lengths = np.array([1.0, 0.7 / h]), []
    for i in range(60):
        deviation = expm(matrix * (times[i + 1] - times[i])) @ deviation
        before, after = push[i] - damp * v[i], push[i] + damp * r * v[i]
        deviation = np.array([[-r, 0], [(after + r * before) / v[i], -r]]) @ deviation
        lengths.append(abs(deviation[0]) + h * abs(deviation[1]))
    indices = way.indices(osc, transient=10, sample=50, start=FAR)
    if indices["n_periods"] == 0:
        growth, begun = math.log(lengths[-1] / lengths[10]), times[-1] - times[11]
        assert indices["lyapunov"] * begun == pytest.approx(growth, abs=1e-9 if way.slow else 0.3)
        assert indices["lyapunov_per_impact"] * 49 == pytest.approx(growth, abs=1e-9 if way.slow else 0.3)
    else:
        later = math.log(lengths[-1] / lengths[-1 - indices["n_impacts"]])
        assert indices["lyapunov_per_impact"] * indices["n_impacts"] == pytest.approx(later, rel=1e-6)


@pytest.mark.parametrize("way", ["witness"], indirect=True)
def test_the_growth_of_a_deviation_is_that_of_the_distance_of_neighbours(way):
    h, r = 2.4 / CHAOS.omega, CHAOS.restitution
    above, below, middle = (
        way.section(CHAOS, 1, 6, start=vi.State(-1.0 + off, off * 0.7 / h)) for off in (1e-6, -1e-6, 0.0)
    )
    late, faster = ((above[name] - below[name]).values for name in ("time", "velocity"))
    v, phase = middle["velocity"].values, middle["phase"].values
    after = np.sin(2 * math.pi * phase) + CHAOS.damping * r * v
    length = np.abs(r * v * late) + h * np.abs(after * late + r * faster)
    indices = way.indices(CHAOS, transient=1, sample=6, start=FAR)
    growth = indices["lyapunov"] * float(middle["time"][-1] - middle["time"][0])
    assert growth == pytest.approx(math.log(length[-1] / length[0]), abs=1e-8)
    assert indices["lyapunov_per_impact"] == pytest.approx(growth / 5, rel=1e-12)


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


@pytest.mark.long
def test_the_exponent_of_chaos_is_the_known_one_within_its_spread(values, way):
    mean, error = map(float, values["lyapunov_w=2.8"]["lam_per_time_mean_se"])
    indices = way.indices(CHAOS, transient=100, sample=2000, start=FAR)
    assert indices["lyapunov"] == pytest.approx(mean, abs=4 * error * math.sqrt(4e7 / 2000))
    assert name_of(indices) == (0, 0)


def test_exponents_of_cycles_are_those_of_the_orbits_that_newton_finds(spread):
    compared = 0
    for at in range(0, len(SPREAD), 2):
        cell = spread[True].isel(omega=at)
        n, p = int(cell["n_periods"]), int(cell["n_impacts"])
        if not 0 < n <= 4 or not 0 < p <= 4:
            continue
        osc = OSC.replace(omega=SPREAD[at])
        hits = vi.impact_section(osc, start=FAR, transient_impacts=3000, sample_impacts=1)
        near = float(hits["phase"][0]), float(hits["velocity"][0])
        (orbit,) = vi.find_orbit(osc, n_periods=n, n_impacts=p, near=near)
        assert float(cell["lyapunov"]) == pytest.approx(orbit.lyapunov, abs=1e-8), (osc.omega, n, p)
        compared += 1
    assert compared >= 10


def test_chaos_and_no_cycle_are_one_thing(spread):
    """A positive exponent means no cycle, and a cycle means a negative one."""
    exponent, named = spread[True]["lyapunov"], spread[True]["n_periods"] > 0
    assert not bool((named & (exponent > 0)).any())
    unnamed = exponent.values[~named.values & np.isfinite(exponent.values)]  # what rests now and then has none
    # What never repeats within 5100 impacts is chaotic, but for orbits that settle too slowly to be told.
    assert (unnamed > 0).mean() > 0.9
    assert len(unnamed) >= 15


# Names


def test_a_lossless_oscillator_neither_closes_nor_loses(way):
    indices = way.indices(vi.ImpactOscillator(restitution=1.0, damping=0.0, omega=2.7), transient=20, sample=150)
    assert (*name_of(indices), indices["dissipation"]) == (0, 0, 0.0)
    assert math.isfinite(indices["lyapunov"])


@pytest.mark.long(but=6)
@pytest.mark.parametrize("omega", [0.2, 0.5, 1.2, 2.8, 3.0, 3.4, 4.9])
def test_motions_are_called_what_their_sections_show(way, omega):
    osc = vi.ImpactOscillator(omega=omega)
    indices, motion = (
        way.indices(osc, transient=300, sample=200),
        vi.recognise(way.section(osc, 300, 200), tolerance=1e-9),
    )
    assert name_of(indices) == (motion.n_periods, motion.n_impacts)


def test_names_agree_with_impacts_a_period_and_with_those_read_off_the_impacts(spread):
    named = (spread[True]["n_periods"] > 0) & (spread[True]["n_impacts"] > 0)
    ratio = spread[True]["n_impacts"] / spread[True]["n_periods"]
    assert int(named.sum()) > 20
    np.testing.assert_array_equal(ratio.values[named], spread[True]["impacts_per_period"].values[named])
    for at in range(0, len(SPREAD), 7):
        cell = spread[True].isel(omega=at)
        motion = vi.recognise(vi.impact_section(OSC.replace(omega=SPREAD[at]), start=FAR, transient_impacts=2000))
        if motion.kind in ("periodic", "sticking"):
            assert (int(cell["n_periods"]), int(cell["n_impacts"])) == (motion.n_periods, motion.n_impacts), SPREAD[at]


RESTING = {"omega": np.linspace(0.1, 0.9, 9), "mass": np.linspace(0.2, 1.0, 9)}


def test_a_sticking_motion_is_named_only_if_one_digit_more_or_less_leaves_its_name():
    names = ("n_periods", "n_impacts", "lyapunov_per_impact")
    sweep = vi.parameter_map(OSC, indices=names, sample_impacts=1000, **RESTING)
    beside = {name: np.nextafter(values, 9.0) for name, values in RESTING.items()}
    cells = vi.parameter_map(OSC, indices=names, sample_impacts=1000, **beside)
    named = (sweep["n_impacts"].values == -1) & (sweep["n_periods"].values > 0)
    assert named.sum() > 30
    assert np.array_equal(sweep["n_periods"].values[named], cells["n_periods"].values[named])


@ONE_MASS
def test_rests_at_times_that_rounding_decides_have_no_period(way):
    tube = vi.ImpactOscillator(
        mass=0.5, damping=0.63246, stiffness=2000.0, amplitude=2.0, omega=44.0 * np.pi, restitution=0.7, gap=0.0003
    )
    gaps, resting = np.unique(tube.gap * (1.0 + 1e-16 * np.arange(-9, 10)))[:: 100 if way.slow else 1], 0
    for gap in gaps:
        indices = way.indices(tube.replace(gap=gap), ("n_periods", "n_impacts", "lyapunov_per_impact"), sample=1000)
        assert indices["n_periods"] == 0
        if indices["status"] == vi.Status.STICKING:
            resting += 1
            assert (indices["n_impacts"], indices["lyapunov_per_impact"]) == (-1, -math.inf)
    assert resting > len(gaps) / 2 or way.slow


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


def test_a_mass_that_hits_and_stays_is_named_by_its_count(way):
    osc = OSC.replace(restitution=0.0, omega=0.4)
    indices, times = way.indices(osc, sample=200), way.section(osc, 100, 50)["time"].values
    assert (indices["n_periods"], indices["lyapunov"]) == (1, -math.inf)
    assert indices["n_impacts"] == (times > times[-1] - osc.period + 1e-6).sum()


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


# Losses


def work_done(osc, hits):
    """Return the work of force and damper from the first to the last impact, by Gauss quadrature of each flight."""
    nodes, weights = np.polynomial.legendre.leggauss(120)
    drive = osc.amplitude / complex(osc.stiffness - osc.mass * osc.omega**2, osc.damping * osc.omega)
    matrix = np.array([[0.0, 1.0], [-osc.stiffness / osc.mass, -osc.damping / osc.mass]])
    rates, shapes = np.linalg.eig(matrix)
    releases, total = hits["release_time"].values, 0.0
    for (begin, v), end in zip(
        np.column_stack([hits["time"], hits["velocity"]])[:-1], hits["time"].values[1:], strict=True
    ):
        left = releases[(begin < releases) & (releases < end)]
        begin, velocity = (left[-1], 0.0) if len(left) else (begin, -osc.restitution * v)
        times = begin + 0.5 * (end - begin) * (nodes + 1.0)
        steady = [
            (factor * drive * np.exp(1j * osc.omega * t)).imag for t in (begin, times) for factor in (1, 1j * osc.omega)
        ]
        free = np.linalg.solve(shapes, np.array([osc.gap - steady[0], velocity - steady[1]], complex))
        speed = steady[3] + (shapes[1] * free @ np.exp(np.outer(rates, times - begin))).real
        force = osc.amplitude * np.sin(osc.omega * times) - osc.damping * speed
        total += 0.5 * (end - begin) * float(weights @ (force * speed))
    return total


@ONE_MASS
@pytest.mark.parametrize(
    "changes",
    [
        {"omega": 2.0},
        {"omega": 0.95},
        {"omega": 4.1},
        {"omega": 1.3, "mass": 2.0, "damping": 0.4, "gap": 0.2, "amplitude": 1.7},
        {"omega": 0.1},
        {"omega": 0.35, "restitution": 0.5, "gap": -0.2},
        {"omega": 0.5, "restitution": 0.0, "gap": 0.2},
    ],
)
def test_over_a_cycle_the_stop_takes_what_the_force_brings_less_what_the_damper_takes(way, changes):
    osc = vi.ImpactOscillator(**changes)
    hits, indices = way.section(osc, 300, 200), way.indices(osc, transient=300, sample=200)
    assert indices["n_periods"] > 0
    turns = hits["time"].values / osc.period
    first = int(np.abs(turns - (turns[-1] - indices["n_periods"])).argmin())
    work = work_done(osc, hits.isel(impact=slice(first, None)))
    assert indices["dissipation"] == pytest.approx(work / indices["n_periods"], rel=1e-9)


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


def test_equal_phases_have_no_spread_and_others_one_less_the_length_of_their_mean(way):
    assert way.indices(OSC.replace(omega=2.0), sample=100)["impact_phase_spread"] == pytest.approx(0.0, abs=1e-12)
    hits = way.section(CHAOS, 100, 500)
    expected = 1 - abs(np.exp(2j * np.pi * hits["phase"].values).mean())
    assert way.indices(CHAOS, sample=500)["impact_phase_spread"] == pytest.approx(expected, abs=1e-12)


# Near-misses


def test_the_margin_of_a_period_1_orbit_vanishes_linearly_where_it_grazes(values, way):
    grazes, slopes = float(values["grazing_w_of_n=1"][0]["w"]), []
    for away in (1e-3, 1e-4, 1e-5, 1e-6):
        osc = vi.ImpactOscillator(omega=grazes + away)
        indices = way.indices(osc, transient=0, sample=6 if way.slow else 1000, start=orbit_of_one_impact(osc))
        assert name_of(indices) == (1, 1)
        slopes.append(indices["grazing_margin"] / away)
    assert slopes == pytest.approx([slopes[-1]] * 4, rel=2e-2)
    assert slopes[2:] == pytest.approx([slopes[-1]] * 2, rel=2e-4)


@pytest.mark.long(but=6)
@pytest.mark.parametrize(
    ("changes", "start"),
    [
        ({"omega": 2.8}, FAR),
        ({"omega": 2.0}, vi.State(0.0)),
        ({"omega": 0.3, "restitution": 0.0}, vi.State(0.0)),
        ({"omega": 0.64}, FAR),
        ({"omega": 4.7, "gap": 0.01, "damping": 0.05}, FAR),
        ({"omega": 0.12, "gap": 0.4, "restitution": 0.4}, vi.State(0.0)),
        ({"omega": 0.4, "mass": 0.01, "damping": 0.001}, FAR),
        *(({"omega": omega}, FAR) for omega in (0.1, 0.2, 0.45, 0.95, 1.4)),
    ],
)
def test_the_margin_is_the_closest_turn_back_that_dense_looks_show(way, changes, start):
    """Each by the parabola through three looks, those beside an impact left out."""
    osc = vi.ImpactOscillator(**changes)
    hits, indices = (
        way.section(osc, 0, 25, start=start)["time"].values,
        way.indices(osc, transient=0, sample=25, start=start),
    )
    periods = math.ceil(hits[-1] / osc.period) + 1
    looks = way.simulate(osc, start=start, periods=periods, samples_per_period=2500)
    at, gap = looks["time"].values, osc.gap - looks["displacement"].values
    if indices["n_periods"]:
        hits = hits[np.abs(hits - (hits[-1] - indices["n_periods"] * osc.period)).argmin() :]
    inner = (gap[1:-1] < gap[:-2]) & (gap[1:-1] < gap[2:])
    near = np.array([np.any((hits >= a) & (hits <= b)) for a, b in zip(at[:-2], at[2:], strict=True)])
    chosen = np.flatnonzero(inner & (at[:-2] > hits[0]) & (at[2:] < hits[-1]) & ~near)
    slope, bend = 0.5 * (gap[chosen + 2] - gap[chosen]), gap[chosen] - 2 * gap[chosen + 1] + gap[chosen + 2]
    expected = (gap[chosen + 1] - slope**2 / (2 * bend)).min(initial=math.inf)
    assert indices["grazing_margin"] == pytest.approx(float(expected), rel=1e-6, abs=1e-9 if way.slow else 1e-6)


# Windows


def test_a_window_that_is_not_filled_tells_nothing(way):
    for osc in (vi.ImpactOscillator(gap=5.0, omega=3.0), vi.ImpactOscillator(gap=50.0, omega=3.0)):
        indices = way.indices(osc, sample=50)
        assert indices["status"] == vi.Status.NO_IMPACT
        for name, index in INDICES.items():
            assert indices[name] == 0 if index.dtype == "int32" else math.isnan(indices[name]), name


@ONE_MASS
def test_of_one_impact_no_rate_is_told(way):
    indices = way.indices(CHAOS, transient=5, sample=1, start=FAR)
    assert all(math.isnan(indices[name]) for name in (*RATES, "impacts_per_period"))
    assert (*name_of(indices), indices["std"], indices["status"]) == (0, 0, 0.0, vi.Status.SHORT_WINDOW)
    assert (indices["impact_phase_spread"], indices["grazing_margin"]) == (0.0, math.inf)


def test_indices_of_velocities_are_those_of_the_kept_impacts(way):
    osc = vi.ImpactOscillator(omega=0.95)
    indices, hits = way.indices(osc, transient=200, sample=100, early_closing=False), way.section(osc, 200, 100)
    velocity, span = hits["velocity"].values, float(hits["time"][-1] - hits["time"][0]) / osc.period
    assert indices["std"] == pytest.approx(np.std(velocity), rel=1e-12)
    assert indices["mean_velocity"] == pytest.approx(velocity.mean(), rel=1e-14)
    assert indices["max_velocity"] == velocity.max()
    rate = (
        indices["n_impacts"] / indices["n_periods"] if not way.slow else 99 / span
    )  # of a known cycle p/n, to the bit
    assert indices["impacts_per_period"] == pytest.approx(rate, rel=1e-12)


@pytest.mark.parametrize("scale", [2.0, 0.25])
def test_twice_as_fast_an_oscillator_has_twice_the_exponent(way, scale):
    slow, fast = CHAOS, vi.ImpactOscillator(mass=1 / scale**2, damping=0.01 / scale, omega=2.8 * scale)
    a, b = (way.indices(osc, transient=20, sample=12, start=FAR) for osc in (slow, fast))
    assert b["lyapunov"] == pytest.approx(scale * a["lyapunov"], rel=1e-9)
    for name in ("lyapunov_per_impact", "dissipation", "impact_phase_spread", "grazing_margin"):
        assert b[name] == pytest.approx(a[name], rel=1e-9)


def test_the_state_is_stepped_with_the_same_bits_whatever_is_observed(spread):
    plain = vi.parameter_map(OSC, omega=SPREAD, start=FAR, indices=VELOCITY_INDICES, early_closing=False)
    for name in VELOCITY_INDICES - {"impacts_per_period"}:
        np.testing.assert_array_equal(plain[name], spread[False][name], err_msg=name)
    np.testing.assert_array_equal(plain["status"], spread[False]["status"])


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


@pytest.mark.long
def test_the_witness_tells_the_same():
    settings = {"omega": [0.3, 0.95, 1.4, 2.0], "start": FAR, "sample_impacts": 600, "indices": ALL}
    fast, witness = vi.parameter_map(OSC, **settings), vi.parameter_map(OSC, backend="reference", **settings)
    for name in set(ALL) - {"impacts_per_period"}:  # exactly p/n here, over the window's span there
        a, b = fast[name].values.astype(float), witness[name].values.astype(float)
        np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-7, err_msg=name)


# Diagrams


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
    periodic, cycle = diagram["n_periods"] > 0, (diagram["n_periods"] > 0) & (diagram["n_periods"] < 20)
    settled, sample = diagram["velocity"][:, -100:].max("impact"), diagram["velocity"].max("impact")
    np.testing.assert_allclose(diagram["max_velocity"].where(~periodic), sample.where(~periodic), rtol=1e-9)
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


@pytest.mark.parametrize(
    ("model", "axis", "absent"),
    [
        (vi.ImpactOscillator(), {"omega": [2.0, 2.5]}, {"max_force", "rms_force"}),
        (vi.family(vi.models.bilinear_oscillator), {"frequency": [10.0, 12.0]}, set()),
        (vi.family(vi.models.two_sided_oscillator), {"frequency": [24.0, 25.0]}, {"max_force", "rms_force"}),
    ],
    ids=["one mass", "one compliant stop", "two rigid stops"],
)
def test_all_indices_are_those_of_every_model_and_those_that_it_lacks_are_nan_with_the_reason(
    model, axis, absent, tmp_path
):
    window = {"sample_impacts": 50, "transient_impacts": 50}
    every = vi.parameter_map(model, **axis, **window, indices="all")
    assert [name for name in every if name != "status"] == list(EVERY)
    assert {name for name in EVERY if "no_value" in every[name].attrs} == absent
    assert all(every[name].isnull().all() for name in absent)
    assert all(name in every[name].attrs["no_value"] for name in absent)
    alone = vi.parameter_map(model, **axis, **window, indices=[name for name in EVERY if name not in absent])
    diagram = vi.bifurcation_diagram(model, **axis, **window, indices="all")
    stored = vi.parameter_map(model, **axis, **window, indices="all", store=tmp_path / "map.zarr")
    vi.save(every, tmp_path / "map.nc")
    for name in EVERY:
        same = [diagram, stored, vi.load(tmp_path / "map.nc"), *([] if name in absent else [alone])]
        assert all(np.array_equal(other[name].values, every[name].values, equal_nan=True) for other in same), name
        assert all(other[name].attrs.get("no_value") == every[name].attrs.get("no_value") for other in same), name
    lines = [line for line in sentences_of(every) if ": no value; " in line]
    assert len(lines) == len(absent)


def test_all_indices_of_a_back_end_are_those_that_it_computes():
    window = {"sample_impacts": 5, "transient_impacts": 5, "omega": [2.0]}
    steps = vi.parameter_map(vi.ImpactOscillator(), indices="all", backend="fixed-step", **window)
    assert "std" in steps
    assert "lyapunov" not in steps
    with pytest.raises(ValueError, match="`backend` 'fixed-step' does not compute the index 'lyapunov', only std"):
        vi.parameter_map(vi.ImpactOscillator(), indices=["lyapunov"], backend="fixed-step", **window)


def test_forces_and_powers_of_one_mass_balance_its_momentum_and_energy_over_a_cycle():
    """The stop's mean force is -k <y>; stop and damper take what the first harmonic of y takes from the load."""
    names, closed = ("mean_force", "work_rate", "damper_rate", "mean", "harmonic_amplitude", "harmonic_phase"), 0
    omega = np.linspace(0.6, 5.0, 30)
    for osc in (
        OSC,
        vi.ImpactOscillator(mass=2.0, damping=0.3, stiffness=5.0, amplitude=4.0, restitution=0.6, gap=-0.2),
    ):
        how = {"omega": osc.natural_frequency * omega, "transient_impacts": 2000, "sample_impacts": 841}
        one = vi.parameter_map(osc, indices=[*names, "std", "n_impacts"], of=0, **how)
        cycle = ((one["status"] == vi.Status.CLOSED) & (840 % one["n_impacts"].clip(1) == 0)).values
        force, work, damper, mean, size, phase = (one[name].values[cycle] for name in names)
        assert force == pytest.approx(-osc.stiffness * mean, rel=1e-9)
        power = -0.5 * osc.amplitude * how["omega"][cycle] * size * np.sin(phase)
        assert work + damper == pytest.approx(power, rel=1e-9)
        closed += len(force)
        same = vi.parameter_map(one_mass(osc), indices=names, of=0, **how)
        for name in names:
            np.testing.assert_allclose(one[name], same[name], rtol=1e-12, err_msg=name)
    assert closed >= 30


def test_indices_none_of_which_the_model_has_are_refused():
    with pytest.raises(ValueError, match="`max_force` needs a compliant stop; the force of a rigid one has no largest"):
        vi.parameter_map(vi.ImpactOscillator(), omega=[2.0], indices=["max_force", "rms_force"])
    with pytest.raises(ValueError, match="unknown index 'alle'; choose from std"):
        vi.parameter_map(vi.ImpactOscillator(), omega=[2.0], indices="alle")
