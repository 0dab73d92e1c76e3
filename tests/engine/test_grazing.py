"""No contact is missed: flights whose first crest just touches the stop, or just does not."""

import math

import numpy as np
import pytest

import vibroimpact as vi


class FreeFlight:
    """Motion without a stop from y = 0, y' = v at phase 0, in closed form (off resonance, not critically damped)."""

    def __init__(self, osc, v):
        self.w = osc.omega
        self.roots = np.roots([osc.mass, osc.damping, osc.stiffness]).astype(complex)
        impedance = complex(osc.stiffness - osc.mass * self.w**2, osc.damping * self.w)
        self.steady = osc.amplitude / impedance
        begin = [-self.steady.imag, v - (1j * self.w * self.steady).imag]
        self.free = np.linalg.solve([np.ones(2), self.roots], begin)

    def derivative(self, t, order):
        forced = ((1j * self.w) ** order * self.steady * np.exp(1j * self.w * t)).imag
        return forced + (np.exp(np.multiply.outer(t, self.roots)) @ (self.roots**order * self.free)).real

    def first_crest(self, start, end):
        """Return the time of the first maximum, or None."""
        times = np.linspace(start, end, 4000)
        speeds = self.derivative(times, 1)
        falls = np.flatnonzero((speeds[:-1] > 0) & (speeds[1:] <= 0))
        if not falls.size:
            return None
        t = times[falls[0]]
        for _ in range(50):
            t -= self.derivative(t, 1) / self.derivative(t, 2)
        return t if times[falls[0]] - 0.1 < t < times[falls[0] + 1] + 0.1 else None


def random_crests(seed, number, overdamped=False):
    """Yield oscillators with a start and the crest their first flight reaches, well rounded and well above it."""
    rng = np.random.default_rng(seed)
    while number:
        osc = vi.ImpactOscillator(
            omega=10 ** rng.uniform(-1, 1),
            damping=10 ** rng.uniform(-3, 0.8 if overdamped else -0.3),
            stiffness=10 ** rng.uniform(-0.5, 0.5),
            restitution=rng.uniform(0.3, 0.95),
        )
        speed = rng.uniform(-1.5, 1.5)
        flight = FreeFlight(osc, speed)
        t = flight.first_crest(0.0, 4 * osc.period + 10)
        if t is None or flight.derivative(t, 0) < 0.05 or flight.derivative(t, 2) > -0.05:
            continue
        number -= 1
        size = abs(flight.steady) + np.abs(flight.free).sum()
        yield osc, vi.State(0.0, speed), t, flight.derivative(t, 0), -flight.derivative(t, 2), size


@pytest.mark.parametrize("overdamped", [False, True])
@pytest.mark.parametrize("margin", [1e-6, 1e-8, 1e-10, 1e-12])
def test_a_flight_that_just_touches_is_an_impact_and_one_that_just_misses_is_not(way, margin, overdamped):
    crests = random_crests(int(-math.log10(margin)), 12 if way.slow else 60, overdamped)
    for osc, start, crest_time, crest, curvature, size in crests:
        hits = way.section(osc.replace(gap=crest - margin), 0, 1, start=start)
        speed = math.sqrt(2 * curvature * margin)
        rounding = 2e-15 * size / margin  # of either code's crest, as a share of the margin
        assert hits["velocity"].values[0] == pytest.approx(speed, rel=1e-2 + rounding)
        assert hits["time"].values[0] == pytest.approx(crest_time - speed / curvature, abs=0.05 * speed + 1e-9)
        missing, turns = osc.replace(gap=crest + margin), 1.2 * crest_time / osc.period
        orbit = way.simulate(missing, start=start, periods=turns, samples_per_period=50)
        assert not (orbit["impact_time"].values < crest_time + speed).any()


def test_a_graze_with_zero_velocity_flies_on(way):
    # Undamped, unforced: y = sin t touches g = 1 with zero velocity, within rounding.
    osc = vi.ImpactOscillator(damping=0.0, amplitude=0.0, gap=1.0, omega=1.0)
    orbit = way.simulate(osc, start=vi.State(0.0, 1.0), periods=2)
    assert orbit["displacement"].values == pytest.approx(np.sin(orbit["time"].values), abs=1e-7)
    assert (orbit["impact_velocity"].values < 1e-7).all()
