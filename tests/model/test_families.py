"""A family is a model whose parameters are those of a function."""

import pickle

import numpy as np
import pytest

import vibroimpact as vi
from contents import differing
from designs import shaker
from vibroimpact.indices import INDICES


@vi.family
def same(mass=1.0, damping=0.01, stiffness=1.0, amplitude=1.0, omega=2.0, restitution=0.8, gap=0.0):
    """Return the oscillator of the same numbers."""
    return vi.ImpactOscillator(
        mass=mass, damping=damping, stiffness=stiffness, amplitude=amplitude, omega=omega, restitution=restitution,
        gap=gap,
    )  # fmt: skip


OSC = vi.ImpactOscillator()


def test_a_family_of_the_oscillator_s_own_parameters_gives_its_bits():
    axes = {"omega": np.linspace(0.1, 4.0, 12), "gap": [-0.5, 0.0, 0.5]}
    one, other = (vi.parameter_map(model, indices=INDICES, sample_impacts=200, **axes) for model in (OSC, same))
    assert not differing(one, other)
    assert not differing(vi.impact_section(OSC), vi.impact_section(same))
    assert not differing(vi.simulate(OSC), vi.simulate(same))
    assert not differing(vi.stroboscopic_section(OSC), vi.stroboscopic_section(same))
    up = {"omega": np.linspace(2.0, 3.0, 6), "sample_impacts": 30, "direction": "up"}
    assert not differing(vi.bifurcation_diagram(OSC, **up), vi.bifurcation_diagram(same, **up))


def test_tied_parameters_are_those_of_the_oscillator_at_each_point():
    speeds, gaps = np.linspace(600, 1800, 9), np.array([0.1, 0.5])
    sweep = vi.parameter_map(shaker, rpm=speeds, clearance_mm=gaps, sample_impacts=100)
    for i, rpm in enumerate(speeds):
        for j, gap in enumerate(gaps):
            osc = shaker(rpm=rpm, clearance_mm=gap)
            alone = vi.parameter_map(osc, omega=[osc.omega], sample_impacts=100)
            assert np.array_equal(sweep["std"].values[i, j], alone["std"].values[0], equal_nan=True)
    assert sweep["clearance_mm"].attrs["units"] == "mm"
    assert '"family": "shaker"' in sweep.attrs["model"]


def test_a_store_of_a_family_is_named_by_the_numbers_that_it_made(tmp_path):
    axes = {"rpm": np.linspace(600, 1800, 9), "sample_impacts": 50}
    store = tmp_path / "run.zarr"
    first = vi.parameter_map(shaker, store=store, **axes).load()
    assert not differing(vi.parameter_map(shaker, store=store, **axes).load(), first)
    assert vi.parameter_map(shaker, store=store, **axes).attrs["cells_missing"] == 0

    @vi.family
    def other(unbalance=0.002, rpm=1500.0, clearance_mm=0.5):
        return shaker(unbalance=1.01 * unbalance, rpm=rpm, clearance_mm=clearance_mm)

    other.__name__ = "shaker"
    with pytest.raises(ValueError, match="another study.*numbers is"):
        vi.parameter_map(other, store=store, **axes)
    assert not differing(vi.load(store).drop_attrs(), first.drop_attrs())


def test_a_family_of_a_family_and_a_pickled_one_are_models_too():
    @vi.family
    def slow(gap_mm=0.5):
        return shaker.replace(rpm=700.0, clearance_mm=gap_mm)

    assert slow.at(gap_mm=0.3) == shaker(rpm=700.0, clearance_mm=0.3)
    assert pickle.loads(pickle.dumps(shaker.replace(rpm=800.0))) == shaker.replace(rpm=800.0)


def test_a_refined_map_and_a_diagram_take_a_family():
    plane = vi.parameter_map(
        shaker, rpm=np.linspace(900, 1500, 5), clearance_mm=np.linspace(0.1, 0.5, 4), refine=2, sample_impacts=60
    )
    fine = {name: plane[name].values for name in ("rpm", "clearance_mm")}
    whole = vi.parameter_map(shaker, sample_impacts=60, **fine)
    computed = plane["level"].values >= 0
    assert np.array_equal(plane["std"].values[computed], whole["std"].values[computed], equal_nan=True)
    assert vi.bifurcation_diagram(shaker, rpm=[900.0, 1000.0], sample_impacts=5)["velocity"].dims == ("rpm", "impact")


def test_scattered_designs_are_those_of_a_grid():
    rng = np.random.default_rng(5)
    table = {"omega": rng.uniform(0.5, 4.0, 40), "gap": rng.uniform(-0.5, 0.5, 40)}
    sweep = vi.parameter_map(OSC, points=table, indices=("std", "n_periods"), sample_impacts=100)
    assert sweep["std"].dims == ("point",)
    assert sweep["gap"].dims == ("point",)
    for at in (0, 17, 39):
        alone = vi.parameter_map(OSC, omega=[table["omega"][at]], gap=[table["gap"][at]], sample_impacts=100)
        assert np.array_equal(sweep["std"].values[at], alone["std"].values[0, 0], equal_nan=True)


def test_the_function_of_a_family_is_called_once_for_each_design_of_a_table(tmp_path):
    calls = []

    @vi.family
    def counted(omega=2.0):
        calls.append(omega)
        return vi.ImpactOscillator(omega=omega)

    for place in ({}, {"store": tmp_path / "c.zarr", "tile": 2}):
        calls.clear()
        how = {"points": {"omega": [1.0, 1.5, 3.0]}, "start": [None, vi.State(-1.0)], "sample_impacts": 20}
        vi.parameter_map(counted, **how, **place)
        assert [calls.count(omega) for omega in (1.0, 1.5, 3.0)] == [1, 1, 1]
    calls.clear()
    vi.parameter_map(counted, omega=[1.0, 1.5, 3.0], start=6, sample_impacts=20)
    assert max(calls.count(omega) for omega in (1.0, 1.5, 3.0)) <= 2  # corners are looked at beforehand


@vi.family
def mixed(x=1.0):
    """An oscillator or a system."""
    return OSC if x < 2.0 else vi.models.bouncing_ball()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: vi.family(lambda rpm: OSC), "`rpm` of .* needs a number as its default"),
        (lambda: vi.family(lambda *numbers: OSC), "`numbers` of .* needs a number"),
        (lambda: vi.family(lambda rpm="fast": OSC), "`rpm` must be a finite number, got 'fast'"),
        (lambda: vi.family(lambda rpm=1.0: 3).at(), "must be a model, got 3"),
        (lambda: vi.family(units={"speed": "m/s"})(lambda rpm=1.0: OSC), "unknown parameter 'speed'"),
        (lambda: shaker.replace(rmp=1.0), "unknown parameter 'rmp'; .*did you mean 'rpm'"),
        (lambda: shaker.at(rpm=-5.0), r"shaker fails at unbalance=0.002, rpm=-5, clearance_mm=0.5: `omega` must be"),
        (lambda: vi.parameter_map(shaker, omega=[1.0]), "unknown parameter 'omega'; choose from unbalance, rpm"),
        (lambda: vi.parameter_map(OSC, points={"omega": [1.0], "gap": [0.0, 1.0]}), "columns of equal length"),
        (
            lambda: vi.parameter_map(OSC, points={"omega": [1.0]}, gap=[0.0]),
            "either `points` or .* gap, not both",
        ),
        (lambda: vi.parameter_map(OSC, points=3), "`points` must be a mapping or DataFrame"),
        (lambda: vi.parameter_map(mixed, x=[1.0, 3.0]), "either oscillators or systems"),
        (lambda: vi.parameter_map(mixed, points={"x": [3.0, 1.0]}), "either oscillators or systems"),
        (lambda: vi.parameter_map(OSC, omega=[1.0], start=[]), "`start` must be .* at least one"),
        (lambda: vi.parameter_map(OSC, omega=[1.0], start=[None, 3]), "`start` must be None or a State, got 3"),
    ],
)
def test_what_is_no_family_or_no_table_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_counts_stay_whole_numbers_in_results(tmp_path):
    @vi.family
    def many(order: int = 1, omega=2.0):
        return vi.ImpactOscillator(omega=order * omega)

    window = {"sample_impacts": 5, "transient_impacts": 5}
    for result in (
        vi.parameter_map(many, order=[1, 2, 3], **window),
        vi.parameter_map(many, order=[1.0, 2.0, 3.0], **window, store=tmp_path / "map.zarr"),
        vi.parameter_map(many, points={"order": [1, 2, 3], "omega": [2.0, 2.1, 2.2]}, **window),
        vi.bifurcation_diagram(many, order=[1, 2, 3], **window),
    ):
        assert result["order"].dtype.kind == "i"
        assert result["order"].values.tolist() == [1, 2, 3]
    assert many.replace(order=3.0).values["order"] == 3
    assert str(vi.find_orbit(many)[0].value("order")) == "1"
    assert repr(many.replace(order=3.0)) == "many(order=3, omega=2.0)"
    with pytest.raises(ValueError, match="`order` must be a whole number, got 1.5"):
        vi.parameter_map(many, order=[1.0, 1.5], **window)


def test_a_map_over_the_number_of_modes_is_refused():
    beam = vi.family(vi.models.cantilever_with_stop)
    with pytest.raises(ValueError, match="`osc` must have equal numbers of coordinates and stops at all points"):
        vi.parameter_map(beam, modes=[1, 2], sample_impacts=5)
