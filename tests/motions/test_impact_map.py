"""The impact map as a function."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from differences import derivative
from vibroimpact.contact import hunt_crossley

OSC = vi.ImpactOscillator(omega=2.8, damping=0.05, restitution=0.7, gap=0.1)


FORCE = vi.Force(omega=2.8, harmonics={1: 1.0})


def one_coordinate(force=FORCE, **stop):
    """Return a system of one coordinate in front of one stop of any kind."""
    return vi.ImpactSystem(mass=1.0, damping=0.05, stiffness=1.0, force=force, stops=[vi.Stop(**stop)])


MODELS = {
    "oscillator": OSC,
    "its physical form": OSC.system,
    "a stop on the other side": one_coordinate(direction=-2.0, gap=0.1, restitution=0.7),
    "two harmonics": one_coordinate(
        vi.Force(omega=2.8, harmonics={1: 1.0, 2: 0.4j}), direction=1.0, gap=0.1, restitution=0.7
    ),
    "a moving stop": one_coordinate(direction=1.0, gap=0.1, restitution=0.7, motion={1: 0.2}),
    "a compliant stop": one_coordinate(direction=1.0, gap=0.1, stiffness=50.0),
    "a law of restitution": one_coordinate(direction=1.0, gap=0.1, restitution=hunt_crossley(damping=0.4)),
}


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_it_leads_from_each_impact_of_a_section_to_the_next(model):
    hits = vi.impact_section(model, transient_impacts=50, sample_impacts=200)
    phase, velocity = vi.impact_map(model)(hits["phase"].values[:-1], hits["velocity"].values[:-1])
    assert velocity == pytest.approx(hits["velocity"].values[1:], rel=1e-9)
    turned = np.exp(2j * np.pi * phase)
    assert turned == pytest.approx(np.exp(2j * np.pi * hits["phase"].values[1:]), abs=1e-9)


@pytest.mark.parametrize(
    ("model", "has"),
    [
        (vi.models.impact_damper(), "2 coordinates and 2 stops"),
        (vi.models.two_sided_oscillator(), "1 coordinate and 2 stops"),
    ],
)
def test_an_impact_that_is_not_the_whole_state_is_refused(model, has):
    with pytest.raises(ValueError, match=f"`osc` must have one coordinate and one stop.* has {has}; use"):
        vi.impact_map(model)


def test_its_jacobian_has_the_determinant_of_a_flight_and_an_impact():
    following = vi.impact_map(OSC)
    phase, velocity = 0.37, 1.3
    jacobian = derivative(lambda start: np.array(following(*start)), np.array([phase, velocity]), 1e-6)
    orbit = vi.simulate(OSC, start=vi.State(OSC.gap, velocity, phase * OSC.period), periods=20)
    flight = float(orbit["impact_time"][1] - orbit["impact_time"][0])
    after = float(following(phase, velocity)[1])
    expected = OSC.restitution**2 * velocity / after * math.exp(-OSC.damping * flight / OSC.mass)
    assert np.linalg.det(jacobian) == pytest.approx(expected, rel=1e-6)


def test_it_keeps_the_shape_and_tells_where_nothing_follows():
    quiet = vi.ImpactOscillator(amplitude=0.01, gap=1.0, damping=0.5)
    phase, velocity = vi.impact_map(quiet)(np.full((2, 3), 0.2), 0.1)
    assert phase.shape == velocity.shape == (2, 3)
    assert np.isnan(velocity).all()


def test_the_witness_agrees():
    rng = np.random.default_rng(3)
    phases, velocities = rng.uniform(0, 1, 20), rng.uniform(0.2, 3.0, 20)
    for one, other in zip(
        vi.impact_map(OSC)(phases, velocities), vi.impact_map(OSC, backend="reference")(phases, velocities), strict=True
    ):
        assert one == pytest.approx(other, rel=1e-9)


@pytest.mark.parametrize(
    ("phase", "velocity", "name"),
    [(1.0, 1.0, "phase"), (-0.1, 1.0, "phase"), (0.2, 0.0, "velocity"), (0.2, np.inf, "velocity")],
)
def test_what_is_no_impact_is_refused(phase, velocity, name):
    with pytest.raises(ValueError, match=f"`{name}` must be .*, got"):
        vi.impact_map(OSC)(phase, velocity)
