"""Stored sweeps in the explorer: shown as they are, computed on where they end, refused where they are none."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import vibroimpact as vi
from vibroimpact.explorer.address import from_query, to_query
from vibroimpact.explorer.files import export
from vibroimpact.explorer.limits import FINEST
from vibroimpact.explorer.session import Explorer
from vibroimpact.explorer.shades import shades
from vibroimpact.explorer.stored import open_study

OMEGA, MASS = np.linspace(1.9, 2.1, 6), np.linspace(0.9, 1.1, 5)


@pytest.fixture(scope="module")
def sweep():
    return vi.parameter_map(vi.ImpactOscillator(), omega=OMEGA, mass=MASS, indices=["std"], sample_impacts=1900)


@pytest.fixture
def study(tmp_path, sweep):
    """Write a changed sweep to a file."""

    def written(change=lambda sweep: sweep):
        path = tmp_path / "study.nc"
        vi.save(change(sweep.copy()), path)
        return path

    return written


def middles(plane):
    """Return what a plane shows in the middle of each of 6 by 5 cells."""
    return plane.values["std"][FINEST // 12 :: FINEST // 6, FINEST // 10 :: FINEST // 5][:6, :5]


def test_a_study_is_seen_with_the_sampling_and_the_cells_that_it_has(study, sweep):
    view, look, _ = open_study(study())
    assert view.samples == 2000  # the nearest that a page may ask for
    assert (view.x_range, view.y_range) == ((pytest.approx(1.88), pytest.approx(2.12)), (0.875, 1.125))
    plane = look(view)
    assert (middles(plane) == sweep["std"].values).all()


def test_a_study_says_from_where_its_motions_begin_and_only_what_it_knows(tmp_path):
    path = tmp_path / "began.nc"
    how = {"indices": ["n_impacts"], "sample_impacts": 200, "start": vi.State(-1.0)}
    vi.save(vi.parameter_map(vi.ImpactOscillator(), omega=np.linspace(2.0, 3.0, 9), gap=[0.0, 9.0], **how), path)
    view, look, _ = open_study(path)
    plane = look(view)
    assert plane.origin == "from the stored initial condition"
    legend = [text.partition(" (")[0] for _, text in shades(plane).legend]
    assert {"1", "no cycle found: chaotic or undecided", "no impact from the stored initial condition"} <= set(legend)


def test_edges_of_cells_stay_where_parameters_may_be(tmp_path):
    path = tmp_path / "edges.nc"
    axes = {"restitution": np.linspace(0.0, 1.0, 5), "damping": np.linspace(0.0, 0.1, 5)}
    vi.save(vi.parameter_map(vi.ImpactOscillator(), **axes, indices=["std"], sample_impacts=20), path)
    view, _, _ = open_study(path)
    assert view.x_range == (0.0, 1.0)
    assert view.y_range == (0.0, pytest.approx(0.1125))


def test_a_store_that_vanishes_is_shown_all_the_same(tmp_path):
    path = tmp_path / "run.zarr"
    vi.parameter_map(vi.ImpactOscillator(), omega=OMEGA, mass=MASS, indices=["std"], sample_impacts=20, store=path)
    view, look, _ = open_study(path)
    shutil.rmtree(path)
    explorer = Explorer(view, stored=look)
    explorer.start()
    assert explorer.wait(300)
    assert explorer.plane.stored == "run.zarr, 6 × 5 cells"
    assert np.isfinite(explorer.plane.values["std"]).all()
    explorer.close()


@pytest.mark.long
def test_an_index_that_the_study_does_not_tell_and_what_one_zooms_to_are_computed(study):
    view, look, _ = open_study(study())
    explorer = Explorer(view, stored=look)
    explorer.start()
    assert explorer.wait(300)
    assert explorer.plane.stored.startswith("study.nc, 6 × 5")
    with pytest.raises(ValueError, match=r"read from study\.nc, 6 × 5 cells; use that file"):
        export("nc", explorer)  # as if they were computed here
    assert len(np.unique(explorer.plane.values["std"])) <= 30
    for change in (lambda: explorer.zoom((1.99, 2.01), (0.99, 1.01)), explorer.undo):
        assert change()
        assert explorer.wait(300)
        assert bool(explorer.plane.stored) == (change == explorer.undo)
    explorer.set(index="lyapunov")
    assert explorer.wait(300)
    assert not explorer.plane.stored
    assert np.isfinite(explorer.plane.values["lyapunov"]).any()
    explorer.close()


def test_an_axis_of_a_hundred_thousand_values_needs_no_gigabyte(study, sweep):
    count = 100_000
    axes = {"omega": np.linspace(1.0, 2.0, count), "mass": [1.0, 2.0]}
    zeros = {
        name: (("omega", "mass"), np.zeros((count, 2), dtype)) for name, dtype in (("std", "f8"), ("status", "i1"))
    }
    long = xr.Dataset(zeros, coords=axes, attrs=sweep.attrs)
    view, look, _ = open_study(study(lambda _: long))
    assert look(view).stored == "study.nc, 100000 × 2 cells"


@pytest.mark.parametrize("change", [
    lambda sweep: sweep.assign_attrs(oscillator="{not json"),
    lambda sweep: sweep.assign_attrs(oscillator='{"colour": 1}'),
    lambda sweep: sweep.assign_attrs(oscillator="[1]"),
    lambda sweep: sweep.assign_attrs(oscillator='{"mass": -1}'),
    lambda sweep: sweep.assign_coords(omega=[1.9, np.nan, 2.0, 2.01, 2.02, 2.1]),
    lambda sweep: sweep.assign_coords(omega=[1.9, 2.1, 1.95, 2.0, 2.05, 2.2]),
    lambda sweep: sweep.assign_coords(omega=np.linspace(1e5, 1e6, 6)),
    lambda sweep: sweep.assign_coords(omega=2.0 + np.arange(6) * 1e-15),
    lambda sweep: sweep.isel(omega=slice(None, None, -1)),
    lambda sweep: sweep.isel(omega=slice(0, 1)),
    lambda sweep: sweep.isel(omega=0, drop=True),
    lambda sweep: sweep.drop_vars("std"),
    lambda sweep: sweep.drop_vars("status"),
    lambda sweep: sweep.rename(omega="colour"),
    lambda sweep: vi.simulate(vi.ImpactOscillator()),
    lambda sweep: xr.Dataset(),
])  # fmt: skip
def test_a_study_that_cannot_be_shown_is_refused_in_words(study, change):
    with pytest.raises((ValueError, OSError), match=r"`store` must|must be|must span|must have|is damaged"):
        open_study(study(change))


@pytest.mark.parametrize(("name", "content"), [
    ("nothing.zarr", None), ("nothing.nc", None), ("garbage.nc", b"\x00garbage" * 50), ("empty.nc", b""),
    ("file.zarr", b"hi"), ("table.csv", b"a,b"), ("no_ending", b""),
])  # fmt: skip
def test_what_is_no_study_at_all_is_refused(tmp_path, name, content):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises((ValueError, OSError)):
        open_study(path)


def test_a_damaged_tile_is_refused_and_not_shown(tmp_path):
    path = tmp_path / "run.zarr"
    vi.parameter_map(vi.ImpactOscillator(), omega=OMEGA, mass=MASS, indices=["std"], sample_impacts=20, store=path)
    tile = next(file for file in sorted((path / "std").rglob("*")) if file.is_file() and file.name != "zarr.json")
    tile.write_bytes(b"\xff broken")
    with pytest.raises(OSError, match=r"run\.zarr"):
        open_study(path)


def test_a_sweep_over_the_frequency_is_shown_in_hertz(tmp_path, sweep):
    """The same cells, whether the axis was given in Hz or in rad/s: w = 2 pi f."""
    path = tmp_path / "hertz.zarr"
    hertz = OMEGA / (2.0 * np.pi)
    vi.parameter_map(
        vi.ImpactOscillator(), frequency=hertz, mass=MASS, indices=["std"], sample_impacts=1900, store=path, workers=1
    )
    view, look, _ = open_study(path)
    assert (view.x, view.y, view.hertz) == ("frequency", "mass", True)
    assert view.x_range == (pytest.approx(1.88 / (2.0 * np.pi)), pytest.approx(2.12 / (2.0 * np.pi)))
    assert from_query(to_query(view)).x_range == view.x_range
    np.testing.assert_allclose(middles(look(view)), sweep["std"].values, atol=1e-9)


def test_a_frequency_held_in_the_middle_of_a_third_axis_is_the_frequency_shown(tmp_path):
    path = tmp_path / "three.nc"
    axes = {"mass": MASS, "gap": [0.0, 0.1, 0.2], "frequency": [0.3, 0.4, 0.5]}
    vi.save(vi.parameter_map(vi.ImpactOscillator(), **axes, indices=["std"], sample_impacts=20, workers=1), path)
    view, _, _ = open_study(path)
    assert view.values["frequency"] == 0.4


@pytest.mark.parametrize("ending", ["zarr", "nc"])
def test_a_sweep_of_a_ready_made_model_is_shown_with_its_own_parameters(tmp_path, ending):
    path = tmp_path / f"pair.{ending}"
    axes = {"frequency": np.linspace(20.0, 30.0, 4), "clearance": np.linspace(1e-3, 2e-3, 3)}
    sweep = vi.parameter_map(
        vi.family(vi.models.impact_pair).replace(restitution=0.5),
        sample_impacts=30,
        indices=["max_velocity", "std"],
        **axes,
    )
    vi.save(sweep, path)
    view, look, find = open_study(path)
    assert (view.model, view.x, view.y, view.index) == ("impact_pair", "frequency", "clearance", "max_velocity")
    assert view.osc.values["restitution"] == 0.5
    assert from_query(to_query(view), find) == view
    shown = look(view).values["max_velocity"]
    for i, j in np.ndindex(4, 3):  # the cell in the middle of that value's
        assert shown[32 + 64 * i, round((j + 0.5) * 256 / 3)] == sweep["max_velocity"].values[i, j]
    assert look(replace(view, index="lyapunov")) is None  # it holds none: computed anew


def test_a_sweep_of_a_system_is_shown_over_what_was_varied_of_its_stops(tmp_path):
    path = tmp_path / "two.nc"
    axes = {"upper_gap": np.linspace(0.1, 0.3, 4), "omega": np.linspace(1.0, 2.0, 3)}
    system = vi.ImpactSystem(
        mass=np.eye(2), stiffness=[[2.0, -1.0], [-1.0, 2.0]], damping=0.1 * np.eye(2),
        force=vi.Force(omega=1.5, harmonics={1: [0.5, 0.0]}),
        stops=[vi.Stop(direction=[1.0, 0.0], gap=0.2, restitution=0.7, name="upper"),
               vi.Stop(direction=[0.0, -1.0], gap=0.4, restitution=0.7, name="lower")],
    )  # fmt: skip
    vi.save(vi.parameter_map(system, sample_impacts=30, by_stop=True, indices=["std"], **axes), path)
    with pytest.raises(ValueError, match="for all stops together"):
        open_study(path)
    vi.save(vi.parameter_map(system, sample_impacts=30, indices=["std"], **axes), path, overwrite=True)
    view, look, find = open_study(path)
    assert (view.x, view.y, view.model) == ("upper_gap", "omega", "two.nc")
    assert look(view).stored.startswith("two.nc, 4 × 3")
    assert from_query(to_query(view), find) == view


def test_a_sweep_of_a_family_of_ones_own_needs_the_family(tmp_path):
    def shaker(gap: float = 0.1, omega: float = 2.0) -> vi.ImpactOscillator:
        return vi.ImpactOscillator(gap=gap, omega=omega)

    path, model = tmp_path / "own.nc", vi.family(shaker)
    vi.save(vi.parameter_map(model, sample_impacts=30, gap=[0.1, 0.2], omega=[2.0, 2.5]), path)
    with pytest.raises(
        ValueError, match=r"computed from the family 'shaker'; give its file with --model FILE\.py:NAME"
    ):
        open_study(path)
    view, look, _ = open_study(path, model, "tube.py:shaker")
    assert (view.model, view.x, view.y) == ("tube.py:shaker", "gap", "omega")
    assert look(view) is not None
