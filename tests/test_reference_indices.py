"""The witness's exponents, names of motions, losses, rests and near-misses against closed forms and identities."""

import math
from dataclasses import asdict
from itertools import pairwise

import numpy as np
import pytest

import vibroimpact as vi
from cells import make_cells
from vibroimpact.backends import ImpactWindow, Measurement, StroboscopicWindow, get_backend
from vibroimpact.backends.reference.flight import FreeMotion, State
from vibroimpact.backends.reference.indices import Tangent
from vibroimpact.indices import INDICES
from vibroimpact.recognition import recognise

REFERENCE = get_backend("reference")
LENGTH, BEGIN = 2.4, (1.0, 0.7)  # deviations are |y| + LENGTH/L |y'|, and begin in this direction
RATES = ("lyapunov", "lyapunov_per_impact", "dissipation", "stick_fraction")


def tell(osc, transient=200, keep=40, start=None, backend=REFERENCE):
    table = backend.indices(make_cells(osc, start), Measurement(ImpactWindow(transient, keep)))
    return {name: values[0].item() for name, values in table.items()}


def watch(osc, transient=200, keep=40, start=None):
    (seen,) = REFERENCE.samples(make_cells(osc, start), Measurement(ImpactWindow(transient, keep)))
    return seen


def free_motion(osc):
    return FreeMotion(**{name: value for name, value in asdict(osc).items() if name != "restitution"})


def transition(osc, time):
    """Return E, cos(wd t) (cosh when overdamped) and the entry of the free transition matrix by which y' enters y."""
    half = osc.damping / (2 * osc.mass)
    square = osc.stiffness / osc.mass - half**2
    rate = math.sqrt(abs(square))
    cosine, sine = (math.cos, math.sin) if square > 0 else (math.cosh, math.sinh)
    decay = math.exp(-half * time)
    return decay, cosine(rate * time), decay * sine(rate * time) / rate


def spectral_radius(trace, determinant):
    return max(abs(np.roots([1.0, -trace, determinant])))


@pytest.mark.parametrize("omega", [1.4, 2.0, 2.6])
def test_the_exponent_of_a_period_1_orbit_is_that_of_its_50_digit_multipliers(values, omega):
    known = values["period_n_impact_1"][f"w={omega},n=1"]
    osc = vi.ImpactOscillator(omega=omega)
    growth = math.log(max(math.hypot(*map(float, known[name])) for name in ("mult1", "mult2")))
    told = tell(osc)
    assert (told["n_periods"], told["n_impacts"]) == (1, 1)
    # At 2.0 the multipliers nearly meet, 5e-4 apart: a rounding of the trace counts 2000-fold.
    assert told["lyapunov"] == pytest.approx(growth / osc.period, abs=5e-12)
    assert told["lyapunov_per_impact"] == pytest.approx(growth, abs=1e-11)


def test_a_period_1_impact_2_motion_has_its_name_and_its_50_digit_multiplier(values):
    known = values["period_1_impact_2"]["w=0.95"]
    osc = vi.ImpactOscillator(omega=0.95)
    told = tell(osc)
    assert (told["n_periods"], told["n_impacts"]) == (1, 2)
    assert told["lyapunov"] == pytest.approx(math.log(float(known["absmult"])) / osc.period, rel=1e-11)
    assert told["lyapunov_per_impact"] == pytest.approx(math.log(float(known["absmult"])) / 2, rel=1e-11)


@pytest.mark.long(but=1)
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
def test_the_exponent_of_an_impact_1_motion_follows_from_its_trace_in_closed_form(n, changes):
    osc = vi.ImpactOscillator(**changes)
    told, hits = tell(osc, transient=600), watch(osc, transient=600)
    v, phase = hits.impact_velocity[-1], hits.impact_phase[-1]
    decay, cosine, q = transition(osc, n * osc.period)
    force = (osc.amplitude * math.sin(2 * math.pi * phase) - osc.stiffness * osc.gap) / osc.mass
    trace = -2 * osc.restitution * decay * cosine + (1 + osc.restitution) * q / v * force
    determinant = osc.restitution**2 * decay**2
    assert (told["n_periods"], told["n_impacts"]) == (n, 1)
    growth = math.log(spectral_radius(trace, determinant))
    assert told["lyapunov_per_impact"] == pytest.approx(growth, rel=1e-9)
    assert told["lyapunov"] == pytest.approx(growth / (n * osc.period), rel=1e-9)


def impact_1_start(osc):
    """Return a start on the period-1 impact-1 orbit at gap 0, stable or not."""
    decay, cosine, q = transition(osc, osc.period)
    half = osc.damping / (2 * osc.mass)
    p = decay * cosine + half * q
    delta = 1 - 2 * decay * cosine + decay**2
    alpha, beta = (1 + osc.restitution) * q / delta, -osc.restitution - (1 + osc.restitution) * (p - 1) / delta
    inertia, damper = osc.stiffness - osc.mass * osc.omega**2, osc.damping * osc.omega
    v = osc.amplitude / math.hypot(inertia, damper) / math.hypot(alpha, beta / osc.omega)
    turn = math.atan2(alpha * v, beta * v / osc.omega) + math.atan2(damper, inertia)
    return vi.State(0.0, v, turn / (2 * math.pi) % 1.0 * osc.period)


def test_an_orbit_that_repeats_but_is_unstable_is_no_cycle():
    osc = vi.ImpactOscillator(omega=1.15)
    start = impact_1_start(osc)
    hits = watch(osc, 0, 20, start)
    assert hits.impact_velocity == pytest.approx([start.velocity] * 20, rel=1e-10)
    told = tell(osc, 0, 20, start)
    assert (told["n_periods"], told["n_impacts"]) == (0, 0)
    assert told["lyapunov"] > 0


@pytest.mark.parametrize("changes", [{"omega": 2.8}, {"omega": 3.9, "damping": 0.1, "gap": 0.05}, {"omega": 0.93}])
def test_each_flight_s_jacobian_has_the_determinant_of_the_law(changes):
    osc = vi.ImpactOscillator(**changes)
    hits = watch(osc, 50, 200)
    turns = hits.impact_periods + hits.impact_phase
    flight, v = np.diff(turns, prepend=turns[0]) * osc.period, hits.impact_velocity
    steps = Tangent(free_motion(osc), osc.restitution, hits.impact_phase, v, flight).step[1:]
    law = osc.restitution**2 * v[:-1] / v[1:] * np.exp(-osc.damping * flight[1:] / osc.mass)
    size = np.abs(steps).max(axis=(1, 2)) ** 2
    assert (np.abs(np.linalg.det(steps) - law) <= 1e-13 * np.maximum(size, 1.0)).all()


CHAOS = vi.ImpactOscillator(omega=2.8)
FAR = vi.State(-1.0)


def test_the_growth_of_a_tangent_is_that_of_the_distance_of_neighbours():
    window, h = (1, 6), LENGTH / 2.8
    nudge = 1e-6 * np.array([BEGIN[0], BEGIN[1] / h])
    above, below = (watch(CHAOS, *window, vi.State(-1.0 + s * nudge[0], s * nudge[1])) for s in (1, -1))
    middle = watch(CHAOS, *window, FAR)
    late = ((above.impact_periods - below.impact_periods) + (above.impact_phase - below.impact_phase)) * CHAOS.period
    faster, v = above.impact_velocity - below.impact_velocity, middle.impact_velocity
    after = np.sin(2 * math.pi * middle.impact_phase) + CHAOS.damping * CHAOS.restitution * v
    length = np.abs(0.8 * v * late) + h * np.abs(after * late + 0.8 * faster)
    turns = middle.impact_periods + middle.impact_phase
    told = tell(CHAOS, *window, FAR)
    growth = told["lyapunov"] * (turns[-1] - turns[0]) * CHAOS.period
    assert growth == pytest.approx(math.log(length[-1] / length[0]), abs=1e-8)
    assert told["lyapunov_per_impact"] == pytest.approx(growth / 5, rel=1e-12)


@pytest.mark.parametrize(
    ("osc", "start"),
    [
        (CHAOS, FAR),
        (vi.ImpactOscillator(omega=2.8, mass=0.3, stiffness=2.0, damping=0.2, gap=0.15, restitution=0.9), FAR),
        (vi.ImpactOscillator(omega=3.0, damping=6.0, restitution=0.7), FAR),
    ],
)
def test_the_growth_by_the_impact_map_is_that_by_saltation(osc, start):
    hits, free = watch(osc, 0, 60, start), free_motion(osc)
    h = LENGTH / free.fastest
    turns, v = np.array([0.0, *(hits.impact_periods + hits.impact_phase)]) * osc.period, hits.impact_velocity
    push = (osc.amplitude * np.sin(2 * math.pi * hits.impact_phase) - osc.stiffness * osc.gap) / osc.mass
    damp, r = osc.damping / osc.mass, osc.restitution
    deviation, lengths = np.array([BEGIN[0], BEGIN[1] / h]), []
    for i in range(60):
        deviation = free.propagators([turns[i + 1] - turns[i]])[0, :2, :2] @ deviation
        before, after = push[i] - damp * v[i], push[i] + damp * r * v[i]
        deviation = np.array([[-r, 0], [(after + r * before) / v[i], -r]]) @ deviation
        lengths.append(abs(deviation[0]) + h * abs(deviation[1]))
    told = tell(osc, 10, 50, start)
    if told["n_periods"] == 0:
        growth = told["lyapunov"] * (turns[-1] - turns[11])
        assert growth == pytest.approx(math.log(lengths[-1] / lengths[10]), abs=1e-9)
    else:
        later = math.log(lengths[-1] / lengths[-1 - told["n_impacts"]])
        assert told["lyapunov_per_impact"] * told["n_impacts"] == pytest.approx(later, rel=1e-6)


@pytest.mark.long
def test_the_exponent_of_chaos_is_the_known_one_within_its_spread(values):
    mean, error = map(float, values["lyapunov_w=2.8"]["lam_per_time_mean_se"])
    keep = 2000
    told = tell(CHAOS, 100, keep, FAR)
    assert told["lyapunov"] == pytest.approx(mean, abs=4 * error * math.sqrt(4e7 / keep))
    assert (told["n_periods"], told["n_impacts"]) == (0, 0)


def test_a_lossless_oscillator_neither_closes_nor_loses():
    told = tell(vi.ImpactOscillator(restitution=1.0, damping=0.0, omega=2.7), 20, 150)
    assert (told["n_periods"], told["n_impacts"], told["dissipation"]) == (0, 0, 0.0)
    assert math.isfinite(told["lyapunov"])


@pytest.mark.long(but=2)
@pytest.mark.parametrize("omega", [0.2, 0.5, 1.2, 2.8, 3.0, 3.4, 4.9])
def test_motions_are_called_what_their_sections_show(omega):
    osc = vi.ImpactOscillator(omega=omega)
    told = tell(osc, 300, 200)
    motion = recognise(
        vi.impact_section(osc, transient_impacts=300, sample_impacts=200, backend="reference"), tolerance=1e-9
    )
    assert (told["n_periods"], told["n_impacts"]) == (motion.n_periods, motion.n_impacts)


def last_round(hits, n_periods):
    """Return which impact came a cycle before the last one."""
    turns = hits.impact_periods + hits.impact_phase
    return int(np.abs(turns - (turns[-1] - n_periods)).argmin())


def work_done(osc, hits, sticks):
    """Return the work of force and damper from the first to the last impact, by Gauss quadrature of each flight."""
    nodes, weights = np.polynomial.legendre.leggauss(120)
    free, total = free_motion(osc), 0.0
    for (periods, phase, v), (to_periods, to_phase, _) in pairwise(hits):
        start = State(0.0, -osc.restitution * v, periods, phase)
        for release_periods, release_phase in sticks:
            if periods + phase < release_periods + release_phase < to_periods + to_phase:
                start = State(0.0, 0.0, release_periods, release_phase)
        length = ((to_periods - start.periods) + (to_phase - start.phase)) * osc.period
        times = 0.5 * length * (nodes + 1.0)
        _, velocity = free.after(start, times)
        force = osc.amplitude * np.sin(2 * math.pi * start.phase + osc.omega * times) - osc.damping * velocity
        total += 0.5 * length * float(weights @ (force * velocity))
    return total


@pytest.mark.long(but=1)
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
def test_over_a_cycle_the_stop_takes_what_the_force_brings_less_what_the_damper_takes(changes):
    osc = vi.ImpactOscillator(**changes)
    hits, told = watch(osc, 300, 200), tell(osc, 300, 200)
    rows = np.column_stack([hits.impact_periods, hits.impact_phase, hits.impact_velocity])
    releases = list(zip(hits.release_periods, hits.release_phase, strict=True))
    assert told["n_periods"] > 0
    work = work_done(osc, rows[last_round(hits, told["n_periods"]) :], releases)
    assert told["dissipation"] == pytest.approx(work / told["n_periods"], rel=1e-9)


def test_away_from_cycles_the_loss_is_that_of_the_impacts_after_the_first_over_the_window():
    osc = vi.ImpactOscillator(omega=4.0, mass=0.5, restitution=0.85)
    hits = watch(osc, 10, 50, FAR)
    turns = hits.impact_periods + hits.impact_phase
    told = tell(osc, 10, 50, FAR)
    lost = sum(0.5 * 0.5 * (v**2 - (0.85 * v) ** 2) for v in hits.impact_velocity[1:])
    assert told["n_periods"] == 0
    assert told["dissipation"] == pytest.approx(lost / (turns[-1] - turns[0]), rel=1e-12)


def test_a_complete_chatter_has_its_name_its_rest_and_its_loss(values):
    known = values["sticking_w=0.1"]
    told = tell(vi.ImpactOscillator(omega=0.1), 100, 950)
    speeds = [float(impact["v"]) for impact in known["impacts"]]
    squares = math.fsum(v * v for v in speeds) + (0.8 * speeds[-1]) ** 2 / (1 - 0.64)
    assert (told["n_periods"], told["n_impacts"]) == (1, -1)
    assert told["lyapunov"] == told["lyapunov_per_impact"] == -math.inf
    assert told["stick_fraction"] == pytest.approx(float(known["stuck_duration"]) / float(known["T"]), rel=1e-12)
    assert told["dissipation"] == pytest.approx(0.5 * 0.36 * squares, rel=1e-12)


@pytest.mark.long(but=1)
@pytest.mark.parametrize("window", [(0, 100), (37, 200), (95, 10), (300, 1)])
def test_a_sticking_cycle_tells_the_same_whatever_the_window_once_it_was_left_twice(window):
    osc = vi.ImpactOscillator(omega=0.1)
    names = (*RATES, "n_periods", "n_impacts", "grazing_margin")
    settled, told = tell(osc, 100, 500), tell(osc, *window)
    assert [told[name] for name in names] == [settled[name] for name in names]


def test_without_rebound_a_sticking_cycle_counts_its_impacts_and_rests_from_each_to_its_release():
    osc = vi.ImpactOscillator(restitution=0.0, omega=0.5, gap=0.2)
    told, hits = tell(osc, 100, 60), watch(osc, 100, 60)
    rests = ((hits.release_periods - hits.stick_periods) + (hits.release_phase - hits.stick_phase))[-4:]
    assert (told["n_periods"], told["n_impacts"]) == (1, 2)
    assert told["stick_fraction"] == pytest.approx(rests.mean(), rel=1e-12)
    assert told["dissipation"] == pytest.approx(0.5 * (hits.impact_velocity[-2:] ** 2).sum(), rel=1e-12)
    assert told["lyapunov"] == -math.inf


def test_phases_spread_by_the_length_of_their_mean_vector(values):
    known = values["period_1_impact_2"]["w=0.95"]
    # Two points half of a circle's arc 2 a apart have a mean vector of length cos a.
    apart = math.pi * (float(known["phase_frac_b"]) - float(known["phase_frac_a"]))
    assert tell(vi.ImpactOscillator(omega=0.95))["impact_phase_spread"] == pytest.approx(1 - math.cos(apart), rel=1e-11)
    assert tell(vi.ImpactOscillator(omega=2.0))["impact_phase_spread"] <= 1e-15


def test_the_margin_of_a_period_1_orbit_vanishes_linearly_where_it_grazes(values):
    grazes = float(values["grazing_w_of_n=1"][0]["w"])
    slopes = []
    for away in (1e-3, 1e-4, 1e-5, 1e-6):
        osc = vi.ImpactOscillator(omega=grazes + away)
        told = tell(osc, 0, 6, impact_1_start(osc))
        assert (told["n_periods"], told["n_impacts"]) == (1, 1)
        slopes.append(told["grazing_margin"] / away)
    assert slopes == pytest.approx([slopes[-1]] * 4, rel=2e-2)
    assert slopes[2:] == pytest.approx([slopes[-1]] * 2, rel=2e-4)


def looks_margin(osc, hits, looks):
    """Return the least local minimum of the gap between looks, each by the parabola through three of them."""
    gap = osc.gap - looks.look_displacement
    at = looks.look_periods + looks.look_phase
    inner = (gap[1:-1] < gap[:-2]) & (gap[1:-1] < gap[2:])
    inside = (at[:-2] > hits[0]) & (at[2:] < hits[-1])
    near = np.array([np.any((hits >= a) & (hits <= b)) for a, b in zip(at[:-2], at[2:], strict=True)])
    chosen = np.flatnonzero(inner & inside & ~near)
    slope, bend = 0.5 * (gap[chosen + 2] - gap[chosen]), gap[chosen] - 2 * gap[chosen + 1] + gap[chosen + 2]
    return float((gap[chosen + 1] - slope**2 / (2 * bend)).min(initial=math.inf))


@pytest.mark.long
@pytest.mark.parametrize(
    ("changes", "start"),
    [
        ({"omega": 2.8}, FAR),
        ({"omega": 2.0}, None),
        ({"omega": 0.3, "restitution": 0.0}, None),
        ({"omega": 0.64}, FAR),
        ({"omega": 4.7, "gap": 0.01, "damping": 0.05}, FAR),
        ({"omega": 0.12, "gap": 0.4, "restitution": 0.4}, None),
        ({"omega": 0.4, "mass": 0.01, "damping": 0.001}, FAR),
    ],
)
def test_the_margin_is_the_closest_turn_back_that_dense_looks_show(changes, start):
    osc = vi.ImpactOscillator(**changes)
    hits = watch(osc, 0, 25, start)
    turns = hits.impact_periods + hits.impact_phase
    rate = 2500
    window = StroboscopicWindow(0, rate * (math.ceil(turns[-1]) + 1), None, rate)
    (looks,) = REFERENCE.samples(make_cells(osc, start), Measurement(window))
    told = tell(osc, 0, 25, start)
    if told["n_periods"]:
        turns = turns[last_round(hits, told["n_periods"]) :]
    assert told["grazing_margin"] == pytest.approx(looks_margin(osc, turns, looks), rel=1e-6, abs=1e-9)


def test_a_window_that_is_not_filled_tells_nothing():
    told = tell(vi.ImpactOscillator(gap=5.0, omega=3.0))
    for name, index in INDICES.items():
        assert told[name] == 0 if index.dtype == "int32" else math.isnan(told[name])


def test_of_one_impact_no_rate_is_told():
    told = tell(vi.ImpactOscillator(omega=2.8), 5, 1, FAR)
    assert all(math.isnan(told[name]) for name in RATES)
    assert (told["n_periods"], told["n_impacts"]) == (0, 0)
    assert (told["impact_phase_spread"], told["grazing_margin"]) == (0.0, math.inf)


def test_a_rest_in_the_window_ends_all_memory():
    osc = vi.ImpactOscillator(omega=0.1)
    # From the stop at 0.55 T it leaves with the force pulling, chatters from 0.02 T on and rests once by 1.5 T.
    start = vi.State(0.0, 0.0, 0.55 * osc.period)
    hits = watch(osc, 0, 95, start)
    told = tell(osc, 0, 95, start)
    assert len(hits.release_phase) == 1
    assert told["lyapunov"] == told["lyapunov_per_impact"] == -math.inf
    assert (told["n_periods"], told["n_impacts"]) == (0, 0)
    rest = (hits.release_periods[0] - hits.stick_periods[0]) + (hits.release_phase[0] - hits.stick_phase[0])
    span = (hits.impact_periods[-1] - hits.impact_periods[0]) + (hits.impact_phase[-1] - hits.impact_phase[0])
    assert told["stick_fraction"] == pytest.approx(rest / span, rel=1e-12)


@pytest.mark.parametrize("scale", [2.0, 0.25])
def test_twice_as_fast_an_oscillator_has_twice_the_exponent(scale):
    slow = vi.ImpactOscillator(omega=2.8, damping=0.01)
    fast = vi.ImpactOscillator(mass=1 / scale**2, damping=0.01 / scale, omega=2.8 * scale)
    a, b = tell(slow, 20, 12, FAR), tell(fast, 20, 12, FAR)
    assert b["lyapunov"] == pytest.approx(scale * a["lyapunov"], rel=1e-9)
    for name in ("lyapunov_per_impact", "dissipation", "impact_phase_spread", "grazing_margin"):
        assert b[name] == pytest.approx(a[name], rel=1e-9)


def test_the_paper_s_scheme_tells_what_its_samples_tell_and_no_more():
    osc, engine = vi.ImpactOscillator(omega=0.95), get_backend("fixed-step")
    told, exact = tell(osc, 100, 50, FAR, engine), tell(osc, 100, 50, FAR)
    assert REFERENCE.known_indices == set(INDICES)
    for name, index in INDICES.items():
        if name in engine.known_indices:
            assert told[name] == pytest.approx(exact[name], rel=0.05)
        else:
            assert told[name] == 0 if index.dtype == "int32" else math.isnan(told[name])
