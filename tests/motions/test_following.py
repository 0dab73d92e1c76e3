"""One run of one orbit is both measured and recorded, and neither shows."""

import numpy as np
import pytest

import vibroimpact as vi
from cells import columns_of, make_cells
from vibroimpact.backends import ImpactWindow, Measurement, StroboscopicWindow, get_backend, scalar
from vibroimpact.indices import INDICES

NUMBER = 60
PAPER = ImpactWindow(100, 1500)
SEEN = {
    "fewer impacts": ImpactWindow(20, 40),
    "more impacts": ImpactWindow(200, 3000),
    "more impacts than a buffer holds": ImpactWindow(0, scalar.ROOM + 500),
    "looks": StroboscopicWindow(50, 200, 0.3),
    "looks many times a period": StroboscopicWindow(20, 6000, None, 30),
}


def random_oscillators(number=NUMBER):
    rng = np.random.default_rng(12)
    for _ in range(number):
        yield vi.ImpactOscillator(
            mass=rng.uniform(0.3, 3.0),
            damping=10.0 ** rng.uniform(-3.0, 0.5),
            stiffness=10.0 ** rng.uniform(-1.0, 1.0),
            amplitude=rng.choice([0.0, 1.0], p=[0.1, 0.9]) * rng.uniform(0.2, 3.0),
            omega=10.0 ** rng.uniform(-1.0, 0.7),
            restitution=rng.choice([0.0, 0.3, 0.8, 0.95, 1.0]),
            gap=rng.choice([0.0, rng.uniform(-0.5, 0.5)]),
        )


@pytest.fixture
def alone(monkeypatch):
    """The steps that recorders make alone."""
    steps = []
    record = scalar.record

    def counted(seen, trace, walks):
        before = scalar.state_of(seen.memory)[1].steps
        record(seen, trace, walks)
        steps.append(int(scalar.state_of(seen.memory)[1].steps - before))

    monkeypatch.setattr(scalar, "record", counted)
    return steps


def follow(osc, measurement, seen):
    """Follow an orbit, and check that the bits are those of two runs."""
    engine, cell = get_backend("cpu"), make_cells(osc)
    found, samples = engine.follow(cell, measurement, seen)
    wanted, (expected,) = engine.indices(cell, measurement), engine.samples(cell, seen)
    assert found.keys() == wanted.keys()
    assert all(np.array_equal(found[name], wanted[name], equal_nan=True) for name in wanted)
    columns = columns_of(expected)
    assert all(np.array_equal(values, columns[name], equal_nan=True) for name, values in columns_of(samples).items())
    return found, samples


@pytest.mark.long(but=2)
@pytest.mark.parametrize("early_closing", [True, False], ids=["closing", "stepping"])
@pytest.mark.parametrize("indices", [tuple(INDICES), ("std",)], ids=["all indices", "std"])
@pytest.mark.parametrize("window", SEEN.values(), ids=SEEN)
def test_one_run_gives_the_bits_of_two(window, indices, early_closing):
    measurement = Measurement(PAPER, vi.Tolerances(), early_closing, indices)
    for osc in random_oscillators():
        follow(osc, measurement, Measurement(window, vi.Tolerances(steps_per_impact=100)))


@pytest.mark.long
def test_a_recorder_whose_buffers_fill_before_they_are_emptied_goes_on_alone(monkeypatch, alone):
    monkeypatch.setattr(scalar, "ROOM", scalar.LOOK + 2)
    measurement = Measurement(PAPER, indices=tuple(INDICES))
    for osc in random_oscillators(10):
        follow(osc, measurement, Measurement(SEEN["looks"]))
    assert alone


@pytest.mark.parametrize("sticks", [False, True])
def test_what_is_measured_longer_is_recorded_without_a_step_of_its_own(sticks, alone):
    osc = vi.ImpactOscillator(omega=0.1) if sticks else vi.ImpactOscillator(omega=2.8)  # chaos is never closed
    cell, seen = make_cells(osc), Measurement(ImpactWindow(0, 4800))
    measurement = Measurement(ImpactWindow(100, 5000), early_closing=False, indices=tuple(INDICES))
    found, samples = get_backend("cpu").follow(cell, measurement, seen)
    assert scalar.ROOM < samples.steps < found["steps"][0]
    assert alone == []


@pytest.mark.long
def test_a_recorder_takes_up_the_orbit_where_its_measurement_ended(alone):
    cell, longer = make_cells(vi.ImpactOscillator(omega=2.8)), Measurement(ImpactWindow(0, 9000))
    found, samples = get_backend("cpu").follow(cell, Measurement(ImpactWindow(100, 5000)), longer)
    assert sum(alone) == samples.steps - found["steps"][0]


def test_chatter_must_be_the_same_for_both():
    cell, window = make_cells(vi.ImpactOscillator()), ImpactWindow(10, 10)
    with pytest.raises(ValueError, match="`chatter`"):
        get_backend("cpu").follow(cell, Measurement(window), Measurement(window, vi.Tolerances(chatter=1e-6)))


@pytest.mark.parametrize("name", ["reference", "fixed-step"])
def test_every_back_end_gives_both(name):
    engine, cell = get_backend(name), make_cells(vi.ImpactOscillator(omega=2.0))
    measurement, seen = Measurement(ImpactWindow(2, 5)), Measurement(StroboscopicWindow(1, 3, 0.0))
    found, samples = engine.follow(cell, measurement, seen)
    assert found["std"] == engine.indices(cell, measurement)["std"]
    assert np.array_equal(samples.look_velocity, engine.samples(cell, seen)[0].look_velocity)
