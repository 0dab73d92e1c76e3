"""Maps and diagrams: the same bits however they are cut, labels, progress, hysteresis."""

import tracemalloc

import numpy as np
import pytest

import vibroimpact as vi
from contents import differing
from systems import two_masses

OSC = vi.ImpactOscillator()
NAMES = ("std", "mean_velocity", "max_velocity", "impacts_per_period")
COMPARED = (*NAMES, "status")
OMEGA, MASS = np.linspace(0.1, 5.0, 23), np.linspace(0.2, 3.0, 7)


def sweep(**settings):
    defaults = {"indices": NAMES, "transient_impacts": 30, "sample_impacts": 100, "omega": OMEGA, "mass": MASS}
    return vi.parameter_map(OSC, **{**defaults, **settings})


@pytest.fixture(scope="module")
def whole():
    return sweep()


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_a_map_does_not_depend_on_the_number_of_threads(whole, workers):
    assert not differing(sweep(workers=workers), whole, COMPARED)


def test_axes_become_dims_in_the_order_given(whole):
    turned = vi.parameter_map(OSC, mass=MASS, omega=OMEGA, indices=NAMES, transient_impacts=30, sample_impacts=100)
    assert turned["std"].dims == ("mass", "omega")
    assert not differing(turned.transpose("omega", "mass"), whole, COMPARED)


def test_three_axes_are_as_good_as_two(whole):
    cube = sweep(restitution=[0.7, 0.8])
    assert cube["std"].dims == ("omega", "mass", "restitution")
    assert not differing(cube.sel(restitution=0.8), whole, COMPARED)


@pytest.mark.parametrize("backend", ["cpu", "reference"])
def test_told_apart_by_stop_a_map_of_one_mass_is_that_of_its_only_stop(backend):
    axes = {"omega": OMEGA[:: 1 if backend == "cpu" else 9], "mass": [1.0]}
    plain, apart = (sweep(backend=backend, by_stop=by_stop, **axes) for by_stop in (False, True))
    assert apart["std"].dims == ("omega", "mass", "stop")
    assert apart["stop"].values.tolist() == ["stop"]
    assert not differing(plain, apart.isel(stop=0), COMPARED)


def test_everything_is_labelled(whole):
    assert whole["std"].attrs["units"] == "m/s"
    assert whole["omega"].attrs["units"] == "rad/s"
    assert whole["mass"].attrs["long_name"] == "mass"
    meanings = whole["status"].attrs["flag_meanings"].split()
    assert meanings[int(whole["status"].attrs["flag_values"][2])] == "sticking"
    assert whole["status"].dtype == np.int8
    assert "vibroimpact" in whole.attrs["source"]


def test_progress_counts_cells_and_hands_on_the_map_so_far():
    news = []
    result = sweep(
        progress=lambda done, total, partial: news.append((done, total, int((partial["status"] == 9).sum())))
    )
    assert news[-1] == (161, 161, 0)
    assert [done for done, _, _ in news] == sorted(done for done, _, _ in news)
    assert all(total - done == missing for done, total, missing in news)
    assert result.attrs["impacts_computed"] >= 161 * 130 * 0.5


def test_progress_that_says_no_stops_the_map_and_leaves_what_is_done():
    wide = {"omega": np.linspace(0.1, 5.0, 199), "sample_impacts": 4000, "early_closing": False}
    whole = sweep(**wide)
    part = sweep(**wide, progress=lambda done, total, partial: False, workers=1)
    interrupted = part["status"].values == vi.Status.INTERRUPTED
    assert 0 < interrupted.sum() < interrupted.size
    assert np.isnan(part["std"].values[interrupted]).all()
    assert np.array_equal(part["std"].values[~interrupted], whole["std"].values[~interrupted])


@pytest.mark.parametrize("direction", ["fresh", "up"])
def test_progress_that_says_no_stops_a_diagram(direction):
    many = np.linspace(1.0, 5.0, 300)  # more than are sampled at once
    part = vi.bifurcation_diagram(
        OSC, omega=many, direction=direction, sample_impacts=20, workers=1, progress=lambda done, total, partial: False
    )
    assert 0 < (part["status"].values == vi.Status.INTERRUPTED).sum() < len(many)


def test_memory_does_not_grow_with_the_impacts_sampled():
    def peak(sample_impacts):
        tracemalloc.start()
        sweep(sample_impacts=sample_impacts)
        high = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return high

    peak(10)
    # Kept, 2000 impacts a cell would be 2.6 MB more.
    assert peak(2000) < peak(20) + 500_000


def test_a_section_changes_nothing():
    osc = OSC.replace(omega=2.8)
    hits = vi.impact_section(osc, start=vi.State(-1.0), transient_impacts=0, sample_impacts=150)
    for density in (1, 7, 200):
        orbit = vi.simulate(osc, start=vi.State(-1.0), periods=120, samples_per_period=density)
        assert np.array_equal(orbit["impact_velocity"].values[:100], hits["velocity"].values[:100])


def test_a_diagram_is_padded_with_nan_where_impacts_cease():
    diagram = vi.bifurcation_diagram(
        OSC.replace(damping=0.1, omega=3.0),
        gap=[0.0, 1.0],
        start=vi.State(-5.0),
        transient_impacts=0,
        sample_impacts=50,
    )
    assert diagram["count"].values[0] == 50
    short = int(diagram["count"].values[1])
    assert 0 < short < 50
    assert np.isnan(diagram["velocity"].values[1, short:]).all()
    assert diagram["status"].values[1] == vi.Status.STOPPED_IMPACTING


def test_sweeps_up_and_down_carry_the_state_and_show_hysteresis():
    # In front of a wide gap a large and a small motion coexist below resonance.
    osc = vi.ImpactOscillator(damping=0.05, gap=3.0)
    omega = np.linspace(0.9, 1.6, 60)
    up, down = (
        vi.bifurcation_diagram(osc, omega=omega, direction=way, section="stroboscopic", sample_periods=5)
        for way in ("up", "down")
    )
    apart = np.abs(up["velocity"].values[:, 0] - down["velocity"].values[:, 0]) > 0.1
    assert 3 < apart.sum() < 55


def test_a_carried_state_keeps_its_clearance_when_the_gap_moves():
    diagram = vi.bifurcation_diagram(
        OSC, gap=np.linspace(-0.3, 0.3, 13), direction="down", start=vi.State(-1.0), sample_impacts=20
    )
    assert (diagram["count"].values == 20).all()


def test_one_cell_is_a_map_too():
    assert vi.parameter_map(OSC, omega=[2.0], sample_impacts=1, indices=NAMES)["std"].values.tolist() == [0.0]


AXES = {  # more values of one mass than are sampled at once
    "one mass": (OSC, "omega", np.linspace(1.0, 5.0, 70)),
    "two masses": (two_masses(), "bar_gap", np.array([0.02, 0.04, 0.06])),
}


@pytest.mark.parametrize("name", AXES)
def test_a_diagram_is_its_sections_side_by_side(name):
    model, parameter, values = AXES[name]
    window = {"transient_impacts": 20, "sample_impacts": 40}
    diagram = vi.bifurcation_diagram(model, **{parameter: values}, workers=2, **window)
    for at, value in enumerate(values):
        hits, column = vi.impact_section(model.replace(**{parameter: value}), **window), diagram.isel({parameter: at})
        for part in ("velocity", "phase"):
            assert np.array_equal(column[part].values, hits[part].values)
        if "stop" in hits:
            names = np.array(diagram["stop"].attrs["flag_meanings"].split())
            assert (names[column["stop"].values + 1] == hits["stop"].values).all()


@pytest.mark.parametrize("name", AXES)
def test_a_stroboscopic_diagram_is_its_sections_of_the_coordinate_asked_for(name):
    model, parameter, values = AXES[name]
    window, one = {"transient_periods": 20, "sample_periods": 30}, {} if name == "one mass" else {"coordinate": 1}
    diagram = vi.bifurcation_diagram(model, section="stroboscopic", **{parameter: values[:3]}, **window, **one)
    looks = vi.stroboscopic_section(model.replace(**{parameter: values[2]}), **window).isel(one)
    for part in ("displacement", "velocity"):
        assert np.array_equal(diagram[part].values[2], looks[part].values)
