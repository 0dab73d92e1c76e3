"""The free flight in every damping regime: the kernels' power series and the witness's exponentials."""

import math

import numpy as np
import pytest
from numba import njit

from vibroimpact.backends.reference.events import Moment
from vibroimpact.backends.reference.phases import Equations, LinearSystem, exponential
from vibroimpact.backends.reference.stops import RigidStop
from vibroimpact.backends.reference.walk import Walk
from vibroimpact.kernels.cell import Cell, pair_of, phase_of, prepare
from vibroimpact.kernels.flight import REACH, evaluate, rotate, series, sine_cosine
from vibroimpact.kernels.leaps import leaps_of
from vibroimpact.kernels.state import Constants, Motion

STOP = 2.0  # out of reach: only the flight matters


@njit
def fly(k, motion, x):
    u, p = evaluate(series(motion, k, False), x)
    s, c = rotate(motion.s, motion.c, k.th * x)
    return Motion(u, p, s, c, 0.0)


def constants(C, K, A, G, th):
    return Constants(C, K, A, G, th, th * th, 0.8, 0.0, 0.0, 0.0, 0.0, *leaps_of(C, K, A, G, th))


@njit
def polynomial_pair(angle):
    return sine_cosine(angle)


@pytest.mark.long(but=1)
@pytest.mark.parametrize(
    "regime", ["under", "critical", "over", "k0", "k0c0", "resonant_c0", "near_resonant", "stiff", "negk"]
)
def test_a_flight_ends_where_50_digits_say(values, regime):
    known = values["flow_values"][regime]
    m, c, k, f, w = map(float, known["m_c_k_f_w"])
    if k > 0:
        h, _, constant = prepare(Cell(m, c, k, f, w, 0.8, STOP, STOP, 0.0, 0.0, 0.0), 1e-9)
    else:  # refused above the kernel, which does not mind
        h = REACH / (w + c / m)
        constant = constants(c * h / m, k * h * h / m, f * h * h / m, k * STOP * h * h / m, w * h)
    turns = 0.2 * w / (2 * math.pi)
    motion = Motion(STOP + 0.3, -0.4 * h, *pair_of(turns), 0.0)
    steps = math.ceil(1.7 / h)
    for _ in range(steps):
        motion = fly(constant, motion, 1.7 / h / steps)
    y, v = map(float, known["y_v"])
    assert STOP - motion.u == pytest.approx(y, abs=5e-15 * STOP)
    assert -motion.p / h == pytest.approx(v, abs=1e-14 * max(1.0, abs(v)))
    assert phase_of(motion.s, motion.c) == pytest.approx((turns + 1.7 * w / (2 * math.pi)) % 1, abs=1e-15)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.1, 0.75, REACH])
def test_the_polynomials_of_sine_and_cosine_are_exact_to_rounding(angle):
    s, c = polynomial_pair(angle)
    # Two roundings of the largest term of the series.
    assert s == pytest.approx(math.sin(angle), abs=2.3e-16 * max(angle, angle**3 / 6))
    assert c == pytest.approx(math.cos(angle), abs=2.3e-16 * max(1.0, angle**2 / 2))


def test_ten_thousand_rotations_keep_the_length_and_lose_a_rounding_of_phase_each():
    turning = constants(0.0, 0.0, 0.0, 0.0, 1.0)
    motion = Motion(1.0, 0.0, 0.0, 1.0, 0.0)
    for _ in range(10_000):
        motion = fly(turning, motion, 1.0)
    s, c = motion.s, motion.c
    assert math.hypot(s, c) == pytest.approx(1.0, abs=4e-16)
    assert phase_of(s, c) == pytest.approx((10_000 / (2 * math.pi)) % 1, abs=10_000 * 2.3e-16 / (2 * math.pi))


@pytest.mark.parametrize(("phase", "pair"), [(0.0, (0, 1)), (0.25, (1, 0)), (0.5, (0, -1)), (0.75, (-1, 0))])
def test_quarter_phases_are_exact_both_ways(phase, pair):
    assert pair_of(phase) == pair
    assert phase_of(*pair_of(phase)) == phase


def test_the_constants_of_the_tail_bound_hold_at_this_reach():
    # |b_j| <= 3^(j-7) B for j >= 7: the induction, and the sum.
    largest_damping, largest_stiffness = 2 * REACH, REACH**2
    assert 3 * largest_damping + largest_stiffness + 1 <= 9
    assert sum(3.0**i * math.factorial(7) / math.factorial(7 + i) for i in range(60)) <= 1.56


def free_motion(mass=1.0, damping=0.01, stiffness=1.0, amplitude=1.0, omega=2.0, gap=0.0):
    one = np.ones((1, 1))
    wave, stop = {1: np.array([amplitude + 0j])}, RigidStop(one[0], gap, 0.8)
    return Equations(LinearSystem(mass * one, damping * one, stiffness * one, omega, np.zeros(1), wave, (stop,)))


@pytest.mark.parametrize("name", ["under", "critical", "over", "resonant_c0", "near_resonant", "stiff"])
def test_a_flight_of_the_witness_is_exact_to_rounding_at_any_damping_and_at_resonance(values, name):
    flow = values["flow_values"][name]
    m, c, k, f, w = map(float, flow["m_c_k_f_w"])
    y, v = map(float, flow["y_v"])
    free = free_motion(mass=m, damping=c, stiffness=k, amplitude=f, omega=w, gap=STOP)
    x = Walk(free, Moment.of(free, 0.0, 0.2 * w / (2 * math.pi), [-0.3], [0.4]), 0.0).vector()
    end = free.phase(()).moved(x, 1.7)
    assert end[0] == pytest.approx(y, abs=1e-14)
    assert STOP - end[2] == pytest.approx(y, abs=1e-14)
    assert end[1] == pytest.approx(v, abs=1e-14 * math.sqrt(k / m) + 1e-14)


@pytest.mark.parametrize("tau", [1e-12, 1e-6, 1e-2])
def test_short_flights_keep_the_relative_accuracy_of_every_part(tau):
    free = free_motion()
    grown = exponential(free.phase(()).matrix, tau)
    # u from u', from sin wt and from cos wt: tau, -tau^2/2, -w tau^3/6, next order relative 0.01 tau or less.
    parts = grown[2, 3] / tau, -2 * grown[2, 5] * free.length / tau**2, -3 * grown[2, 6] * free.length / tau**3
    assert parts == pytest.approx([1, 1, 1], rel=1e-15 + 0.005 * tau + tau**2)
