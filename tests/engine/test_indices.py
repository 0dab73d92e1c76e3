"""Indices are those of their window, whatever else is observed, for every model and back end."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from codes import ONE_MASS, name_of
from vibroimpact.indices import EVERY, INDICES, VELOCITY_INDICES
from vibroimpact.report import sentences_of

ALL = tuple(INDICES)
OSC = vi.ImpactOscillator()
SPREAD = np.linspace(0.025, 5.0, 100)
FAR = vi.State(-1.0)
CHAOS = vi.ImpactOscillator(omega=2.8)
RATES = ("lyapunov", "lyapunov_per_impact", "dissipation", "stick_fraction")


@pytest.fixture(scope="module")
def spread():
    return {
        closing: vi.parameter_map(OSC, omega=SPREAD, start=FAR, indices=ALL, early_closing=closing)
        for closing in (False, True)
    }


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


def test_equal_phases_have_no_spread_and_others_one_less_the_length_of_their_mean(way):
    assert way.indices(OSC.replace(omega=2.0), sample=100)["impact_phase_spread"] == pytest.approx(0.0, abs=1e-12)
    hits = way.section(CHAOS, 100, 500)
    expected = 1 - abs(np.exp(2j * np.pi * hits["phase"].values).mean())
    assert way.indices(CHAOS, sample=500)["impact_phase_spread"] == pytest.approx(expected, abs=1e-12)


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


# All indices


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


def test_indices_none_of_which_the_model_has_are_refused():
    with pytest.raises(ValueError, match="`max_force` needs a compliant stop; the force of a rigid one has no largest"):
        vi.parameter_map(vi.ImpactOscillator(), omega=[2.0], indices=["max_force", "rms_force"])
    with pytest.raises(ValueError, match="unknown index 'alle'; choose from std"):
        vi.parameter_map(vi.ImpactOscillator(), omega=[2.0], indices="alle")
