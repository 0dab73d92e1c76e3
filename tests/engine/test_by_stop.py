"""Indices told apart by stop are those of the impacts on each, and add up to those of all."""

import numpy as np
import pytest

import vibroimpact as vi
from systems import random_pair, two_masses
from vibroimpact import models
from vibroimpact.report import sentences_of

pytestmark = pytest.mark.usefixtures("modal_engine")


def test_indices_by_stop_are_those_of_the_impacts_on_each_stop():
    tube = models.tube_in_supports()
    how = {"sample_impacts": 300, "transient_impacts": 40}
    names = ("std", "mean_velocity", "max_velocity", "impacts_per_period", "dissipation", "impact_phase_spread")
    omega = np.linspace(0.9, 1.1, 3) * tube.omega
    sweep = vi.parameter_map(tube, omega=omega, by_stop=True, indices=(*names, "n_impacts"), **how)
    together = vi.parameter_map(tube, omega=omega, indices=names, **how)
    assert sweep["std"].dims == ("omega", "stop")
    assert sweep["n_impacts"].dims == ("omega",)
    assert sweep["stop"].values.tolist() == list(tube.stop_names)
    for name in ("impacts_per_period", "dissipation"):
        np.testing.assert_allclose(sweep[name].sum("stop"), together[name], rtol=1e-12)
    np.testing.assert_allclose(sweep["max_velocity"].max("stop"), together["max_velocity"], rtol=0)
    for at, value in enumerate(omega):
        section = vi.impact_section(tube.replace(omega=value), **how)
        for stop in tube.stop_names:
            velocity = section["velocity"].values[section["stop"].values == stop]
            found = sweep.isel(omega=at).sel(stop=stop)
            if not velocity.size:
                assert np.isnan(found["std"])
                assert found["impacts_per_period"] == 0.0
                continue
            np.testing.assert_allclose(found["mean_velocity"], velocity.mean(), rtol=1e-9)
            np.testing.assert_allclose(found["std"], velocity.std(), rtol=1e-9, atol=1e-9 * velocity.max())
            np.testing.assert_allclose(found["max_velocity"], velocity.max(), rtol=1e-9)


def test_a_map_of_one_stop_says_in_which_cells_it_is_not_struck(shown):
    """Counted by another index, which is 0 there: impacts per period on that stop."""
    plane = {"omega": np.linspace(0.8, 2.2, 8), "left_gap": np.linspace(0.1, 1.2, 6)}
    names = ("max_velocity", "impact_phase_spread", "impacts_per_period")
    how = {"by_stop": True, "indices": names, "transient_impacts": 300, "sample_impacts": 50}
    sweep = vi.parameter_map(random_pair(4), **plane, **how)
    for stop in ("left", "right"):
        part = sweep.sel(stop=stop)
        count = int((part["impacts_per_period"] == 0.0).sum())
        assert 0 < count < part["status"].size
        for name in names[:2]:
            texts = [text.get_text() for text in shown.index_contour(part, index=name).get_legend().get_texts()]
            assert f"{stop} is not struck ({count} cells)" in texts
            assert "no value" not in " ".join(texts)


def test_the_summary_of_a_map_by_stop_says_which_stops_are_never_struck():
    """Right is out of reach at every speed; where both are struck, the hardest impact has its stop."""
    slot = vi.family(models.two_sided_oscillator)
    how = {"by_stop": True, "indices": ["max_velocity", "impacts_per_period"], "sample_impacts": 50}
    far, near = (
        vi.parameter_map(slot.replace(left_gap=1e-3, right_gap=gap), frequency=[15.0, 20.0], **how)
        for gap in (1.0, 2e-3)
    )
    assert np.isnan(far["max_velocity"].sel(stop="right")).all()
    never = "right is never struck in the impacts kept"
    velocity, rate = (line for line in sentences_of(far) if "(max_velocity)" in line or "(impacts_per" in line)
    assert velocity.endswith(f", on left; {never}")
    assert never not in rate  # 0 is a value
    hardest = near["max_velocity"].max("frequency")
    (line,) = (line for line in sentences_of(near) if "(max_velocity)" in line)
    assert line.endswith(f", on {hardest.idxmax('stop').item()}")


def test_indices_by_stop_are_not_refined():
    with pytest.raises(ValueError, match="`refine`"):
        vi.parameter_map(models.tube_in_supports(), omega=[1.0, 2.0], by_stop=True, refine=1)


@pytest.mark.parametrize("closing", [True, False])
@pytest.mark.parametrize("model", [two_masses(), vi.ImpactOscillator()], ids=["two masses", "one mass"])
def test_impacts_per_period_of_a_known_cycle_are_its_own_impacts_over_its_periods(model, closing):
    """To the last bit, whatever the window; and those of each stop are as many as it has in the cycle."""
    settings = {"omega": np.linspace(1.4, 3, 33) * model.omega, "transient_impacts": 400, "early_closing": closing}
    names = ("impacts_per_period", "n_periods", "n_impacts")
    whole = vi.parameter_map(model, indices=names, sample_impacts=213, **settings)
    apart = vi.parameter_map(model, indices=names, sample_impacts=213, by_stop=True, **settings)
    known = (whole["n_impacts"] > 0).values
    assert known.sum() > 5
    impacts, periods = whole["n_impacts"].values[known], whole["n_periods"].values[known]
    np.testing.assert_array_equal(whole["impacts_per_period"].values[known], impacts / periods)
    each = apart["impacts_per_period"].transpose("omega", "stop").values[known] * periods[:, None]
    np.testing.assert_allclose(each, np.round(each), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(np.round(each).sum(axis=1), impacts)


def test_a_map_stop_by_stop_of_a_family_is_drawn_of_one_stop_and_else_asks_for_one():
    machine, index = vi.family(vi.models.idle_gear), "max_velocity"
    axes = {"rpm": [600.0, 850.0], "backlash": [5e-5, 1e-4]}
    sweep = vi.parameter_map(machine, **axes, indices=[index], by_stop=True, transient_impacts=10, sample_impacts=10)
    vi.plotting.index_contour(sweep.sel(stop="drive"), index)
    with pytest.raises(ValueError, match=r"sweep\.sel\(stop='drive'\)"):
        vi.plotting.index_contour(sweep, index)
