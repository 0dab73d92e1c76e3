"""What a window sees of many cells at once is what it sees of each alone."""

from dataclasses import fields

import numpy as np
import pytest

import vibroimpact as vi
from cells import make_cells
from vibroimpact.backends import ImpactWindow, Measurement, StroboscopicWindow, cpu, get_backend

OSCILLATORS = {
    "touching the stop": vi.ImpactOscillator(),
    "often out of reach of it": vi.ImpactOscillator(gap=0.5, restitution=0.5),
    "sticking": vi.ImpactOscillator(gap=-0.3, restitution=0.3, damping=0.2),
    "pressed for ever": vi.ImpactOscillator(gap=-1.3),
    "dying out": vi.ImpactOscillator(amplitude=0.0, damping=0.1),
}
WINDOWS = {
    "impacts": ImpactWindow(transient=20, keep=100),
    "more impacts than a buffer holds": ImpactWindow(transient=0, keep=cpu.ROOM + 500),
    "one impact": ImpactWindow(transient=3, keep=1),
    "looks": StroboscopicWindow(skip_periods=20, keep=60, phase=0.3),
    "looks many times a period": StroboscopicWindow(skip_periods=3, keep=400, phase=None, per_period=30),
}


def same(one: object, other: object) -> bool:
    pairs = [(getattr(one, field.name), getattr(other, field.name)) for field in fields(one)]
    return all(np.array_equal(np.asarray(a), np.asarray(b), equal_nan=True) for a, b in pairs)


@pytest.mark.parametrize("window", WINDOWS.values(), ids=WINDOWS)
@pytest.mark.parametrize("osc", OSCILLATORS.values(), ids=OSCILLATORS)
def test_lanes_see_the_bits_that_a_cell_shows_alone(osc, window):
    start = vi.State(min(osc.gap, 0.0) - 0.1, 0.5)
    cells = make_cells(osc, start, {"omega": np.linspace(0.1, 5.0, 37)})
    engine = get_backend("cpu")
    together = engine.samples(cells, Measurement(window))
    alone = [engine.samples(cells[at : at + 1], Measurement(window))[0] for at in range(len(cells))]
    assert all(same(one, other) for one, other in zip(together, alone, strict=True))


def test_a_diagram_shows_the_impacts_of_its_sections():
    values = np.linspace(1.0, 5.0, 70)  # more than are sampled at once
    diagram = vi.bifurcation_diagram(vi.ImpactOscillator(), omega=values, sample_impacts=40, workers=2)
    for omega, column in zip(values, diagram["velocity"].values, strict=True):
        section = vi.impact_section(vi.ImpactOscillator(omega=omega), sample_impacts=40)
        assert np.array_equal(column, section["velocity"].values)


def test_of_long_windows_few_values_are_sampled_at_once_and_a_stop_is_heard():
    asked = []

    def no(done, total, partial):
        asked.append(done)
        return False

    values = np.linspace(1.9, 2.1, 40)
    part = vi.bifurcation_diagram(
        vi.ImpactOscillator(), omega=values, sample_impacts=100_000, transient_impacts=0, workers=1, progress=no
    )
    computed = int((part["status"] != vi.Status.INTERRUPTED).sum())
    assert asked == [1]
    assert 0 < computed <= 12  # three tiles of four


def test_full_buffers_are_emptied_and_nothing_is_lost(monkeypatch):
    cells = make_cells(vi.ImpactOscillator(gap=-0.3, restitution=0.3), None, {"omega": np.linspace(0.3, 2.0, 40)})
    window, engine = StroboscopicWindow(skip_periods=0, keep=50, phase=0.5), get_backend("cpu")
    whole = engine.samples(cells, Measurement(window))
    monkeypatch.setattr(cpu, "ROOM", 3)
    assert all(same(one, other) for one, other in zip(engine.samples(cells, Measurement(window)), whole, strict=True))


def test_an_undriven_mass_is_at_rest_once_its_motion_is_too_small_for_numbers():
    osc = vi.ImpactOscillator(amplitude=0.0, damping=1.0)
    looks = vi.stroboscopic_section(osc, start=vi.State(0.0, 1.0), transient_periods=0, sample_periods=600)
    assert looks.sizes["period"] == 600
    speed = np.abs(looks["velocity"].values)
    # Between impacts the motion decays as exp(-c t / 2m), and each impact takes its share.
    assert np.all(speed <= np.exp(-0.5 * looks["time"].values))
    assert speed[-1] == 0.0


def test_periods_that_cannot_be_counted_are_refused():
    late = vi.State(0.0, 1.0, time=1e18)
    with pytest.raises(ValueError, match=r"`start` must have a time of less than 2\^53 driving periods.*got 1e\+18"):
        vi.stroboscopic_section(vi.ImpactOscillator(), start=late)


@pytest.mark.parametrize(
    "model",
    [vi.ImpactOscillator(omega=0.9, gap=0.1), vi.ImpactOscillator(omega=0.2), vi.models.two_sided_oscillator()],
    ids=["knocks", "sticks", "between stops"],
)
def test_a_motion_of_which_periods_are_skipped_is_the_end_of_the_whole_one(model):
    whole = vi.simulate(model, periods=33, samples_per_period=20)
    late = vi.simulate(model, periods=3, skip_periods=30, samples_per_period=20)
    assert late["time"].values.tolist() == whole["time"].values[600:].tolist()
    np.testing.assert_allclose(late["displacement"], whole["displacement"][600:], rtol=0, atol=1e-12)
    hits = whole["impact_time"].values
    assert late["impact_time"].values.tolist() == hits[hits >= late["time"].values[0]].tolist()
    assert (late["release_time"].values >= late["time"].values[0]).all()
