"""What a window sees of many cells at once is what it sees of each alone."""

import numpy as np
import pytest

import vibroimpact as vi


def test_of_long_windows_few_values_are_sampled_at_once_and_a_stop_is_heard():
    looks = []

    def no(done, total, partial):
        looks.append(done)
        return False

    values = np.linspace(1.9, 2.1, 40)
    part = vi.bifurcation_diagram(
        vi.ImpactOscillator(), omega=values, sample_impacts=100_000, transient_impacts=0, workers=1, progress=no
    )
    computed = int((part["status"] != vi.Status.INTERRUPTED).sum())
    assert looks == [1]
    assert 0 < computed <= 12  # three tiles of four


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
