"""Maps from several initial conditions: each slice is the map from that one alone, wherever it is computed."""

import numpy as np
import pytest

import vibroimpact as vi
from contents import differing
from designs import random_designs
from systems import two_masses
from vibroimpact.cells import spread
from vibroimpact.coexistence.measuring import spread_cells
from vibroimpact.report import sentences_of

NAMES = ("std", "max_velocity")
COMPARED = (*NAMES, "status")
SHORT = {"indices": NAMES, "transient_impacts": 20, "sample_impacts": 100}


def explicit(osc, number):
    """Return the initial conditions that a number of them stands for, one by one."""
    phase, velocity = spread(np.arange(number - 1))
    scale = osc.velocity_scale or 1.0
    hits = zip((phase * osc.period).tolist(), (scale * velocity).tolist(), strict=True)
    return [None, *(vi.State(osc.gap, speed, time) for time, speed in hits)]


@pytest.mark.parametrize("osc", list(random_designs(np.random.default_rng(13), 20)))
def test_a_number_of_initial_conditions_gives_the_bits_of_each_of_them_in_every_cell(osc):
    gaps = np.array([osc.gap, osc.gap + 0.3 * osc.velocity_scale / osc.natural_frequency])
    sweep = vi.parameter_map(osc, start=5, gap=gaps, **SHORT)
    assert sweep["std"].dims == ("gap", "start")
    for at, gap in enumerate(gaps.tolist()):
        here = osc.replace(gap=gap)
        listed = vi.parameter_map(osc, start=explicit(here, 5), gap=[gap], **SHORT)
        assert not differing(sweep.isel(gap=[at]), listed, COMPARED)
        for number, start in enumerate(explicit(here, 5)):
            assert not differing(
                sweep.isel(gap=[at], start=number), vi.parameter_map(osc, start=start, gap=[gap], **SHORT), COMPARED
            )
    worst = sweep["max_velocity"].max("start").values
    assert np.array_equal(worst, np.fmax.reduce(sweep["max_velocity"].values, axis=1), equal_nan=True)


def test_they_are_the_initial_conditions_that_attractors_are_looked_for_from():
    for osc in (*random_designs(np.random.default_rng(1), 5), vi.ImpactOscillator(amplitude=0.0)):
        mine, theirs = osc.cells({"gap": np.full(40, osc.gap)}).struck(np.arange(40)), spread_cells(osc.cells({}), 40)
        assert np.array_equal(mine.table, theirs.table)
        phase, velocity = spread(np.arange(40))
        assert np.array_equal(theirs["velocity"], (osc.velocity_scale or 1.0) * velocity)
        assert np.abs(theirs["phase"] - phase).max() < 4e-16  # as a time in seconds it is rounded
        assert not theirs["clearance"].any()


def test_a_store_and_a_table_of_designs_hold_the_same_bits(tmp_path):
    grid = {"omega": np.linspace(0.5, 4.0, 7), "gap": [-0.2, 0.1]}
    whole = vi.parameter_map(vi.ImpactOscillator(), start=4, **grid, **SHORT)
    stored = vi.parameter_map(vi.ImpactOscillator(), start=4, store=tmp_path / "s.zarr", tile=9, **grid, **SHORT)
    assert not differing(stored.load(), whole, COMPARED)
    table = {"omega": np.repeat(grid["omega"], 2), "gap": np.tile(grid["gap"], 7)}
    scattered = vi.parameter_map(vi.ImpactOscillator(), start=4, points=table, **SHORT)
    flat = {name: whole[name].values.reshape(14, 4) for name in COMPARED}
    assert not differing(scattered, flat, COMPARED)
    with pytest.raises(ValueError, match="start is at rest; 3 impacts .* there, at rest; 4 impacts .* here"):
        vi.parameter_map(vi.ImpactOscillator(), start=5, store=tmp_path / "s.zarr", **grid, **SHORT)


@pytest.mark.parametrize("start", [1, 0, -2, True])
def test_fewer_than_two_are_refused(start):
    with pytest.raises(ValueError, match="`start` must be a whole number >= 2"):
        vi.parameter_map(vi.ImpactOscillator(), omega=[1.0], start=start)


def test_results_say_from_where_they_begin():
    osc = vi.ImpactOscillator()
    assert vi.simulate(osc, periods=1).attrs["initial_condition"] == "rest at y = min(0, gap)"
    hits = vi.impact_section(osc, start=vi.State(-1.0, 0.5), sample_impacts=5)
    assert hits.attrs["initial_condition"] == "y = -1 m, y' = 0.5 m/s at t = 0 s"
    sweep = vi.parameter_map(osc, omega=[2.0], start=[None, vi.State(-1.0)], sample_impacts=5)
    both = "2 initial conditions: rest at y = min(0, gap); y = -1 m, y' = 0 m/s at t = 0 s"
    assert sweep.attrs["initial_condition"] == both
    assert sentences_of(sweep.isel(start=1))[0].startswith(f"1 cell from start = 1 of {both}: angular")


def test_figures_say_from_where_they_begin():
    osc, way = vi.ImpactOscillator(), {"omega": [2.0, 2.1], "sample_impacts": 20}
    drawn = {
        "from rest": vi.plotting.impact_map(vi.impact_section(osc, sample_impacts=20)),
        "from y = -1 m, y' = 0 m/s at t = 0 s": vi.plotting.time_history(vi.simulate(osc, start=vi.State(-1.0))),
        "going up from rest": vi.plotting.bifurcation_diagram(vi.bifurcation_diagram(osc, direction="up", **way)),
        "worst of 3 initial conditions": vi.plotting.index_curve(vi.parameter_map(osc, start=3, **way)),
    }
    for said, axes in drawn.items():
        title = np.ravel(axes)[0].figure.axes[0].get_title()
        assert title.replace("\n", " ").endswith(f",  {said}") or title.replace("\n", " ").endswith(f", {said}")


@pytest.mark.parametrize(
    "model", [vi.ImpactOscillator(gap=0.0), two_masses(stops=[vi.Stop(direction=[1.0, 0.0], gap=0.0, restitution=0.7)])]
)
def test_a_state_that_rounding_puts_beyond_a_stop_is_at_it(model):
    """Also where the gap is zero, so that there is no length to compare with."""
    still = [0.0] * (model.coordinates - 1)
    hits = [
        vi.impact_section(model, start=vi.State([y, *still] if still else y), sample_impacts=5, transient_impacts=0)
        for y in (0.0, 3e-17)
    ]
    np.testing.assert_allclose(hits[1]["velocity"].values, hits[0]["velocity"].values, rtol=1e-9)
    with pytest.raises(ValueError, match="`start` "):
        vi.impact_section(model, start=vi.State([1e-9, *still] if still else 1e-9))


def test_a_start_beyond_a_stop_is_refused_by_the_name_of_the_stop():
    stops = [vi.Stop(direction=[1.0, 0.0], gap=0.5, name="left"), vi.Stop(direction=[0.0, 1.0], gap=0.5, name="bar")]
    load = vi.Force(omega=1.0, harmonics={1: [1.0, 0.0]})
    stiffness = [[2.0, -1.0], [-1.0, 1.0]]
    chain = vi.ImpactSystem(mass=np.eye(2), damping=0.1 * np.eye(2), stiffness=stiffness, force=load, stops=stops)

    @vi.family
    def softer(factor=1.0):
        return vi.ImpactSystem(**chain.arguments() | {"stiffness": factor * np.array(stiffness)})

    start = vi.State([0.0, 1.0], [0.0, 0.0])
    for call in (
        lambda: vi.simulate(chain, start=start, duration=1.0),
        lambda: vi.parameter_map(chain, start=start, omega=[1.0, 2.0]),
        lambda: vi.bifurcation_diagram(chain, start=start, left_gap=[0.5, 0.6]),
        lambda: vi.parameter_map(softer, start=[None, start], factor=[1.0, 2.0]),
        lambda: vi.impact_section(softer, start=start),
    ):
        with pytest.raises(ValueError, match="`start` lies beyond 'bar' by 0.5 m at time 0"):
            call()
