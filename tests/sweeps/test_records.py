"""Orbits, branches and attractors on disk: what is loaded is what was saved, to the bit."""

import json

import numpy as np
import pytest
import xarray as xr

import vibroimpact as vi
from systems import a_random_machine, on_springs, sticking, two_sided
from vibroimpact.files import load_dataset
from vibroimpact.report import sentences_of

OSC = vi.ImpactOscillator(omega=0.9)


@vi.family
def slot(width=1.0):
    """Return one mass between two stops."""
    return two_sided(gap=width / 2)


def orbits():
    return vi.find_orbit(OSC, n_impacts=2)


def chatter():
    return vi.find_orbit(OSC.replace(omega=0.1), n_impacts=-1)[0]


def resting():
    return vi.find_orbit(sticking(), near=sticking().rest)


def of_a_family():
    return vi.find_orbit(slot, n_impacts=2)[0]


def of_a_machine():
    return vi.find_orbit(vi.family(vi.models.bouncing_ball))


def with_several_attractors():
    return vi.attractors(vi.ImpactOscillator(omega=3.0), workers=1)


def chaos():
    return vi.attractors(vi.ImpactOscillator(omega=2.8), workers=1)[0]


def branch():
    return vi.continue_orbit(vi.find_orbit(OSC.replace(omega=2.6))[0], "omega", (2.4, 2.7), step=0.05)


def branch_of_a_family():
    return vi.continue_orbit(of_a_family(), "width", (0.9, 1.1), step=0.1)


def boundary():
    (point,) = branch().special
    return vi.continue_boundary(point, ("omega", "gap"), ((2.5, 2.8), (-0.1, 0.1)), step=0.2)


def models_of(value):
    """Return the models in an object, in order."""
    if isinstance(value, list):
        return [model for each in value for model in models_of(each)]
    return models_of(value.orbits) if hasattr(value, "orbits") else [value.model]


RESULTS = [orbits, chatter, resting, of_a_family, of_a_machine, with_several_attractors, chaos, branch]
RESULTS += [branch_of_a_family, boundary]


@pytest.mark.parametrize("ending", [".nc", ".zarr"])
@pytest.mark.parametrize("make", RESULTS)
def test_an_object_comes_back_equal_with_its_model_and_its_orbit(tmp_path, make, ending):
    saved = make()
    loaded = vi.load(vi.save(saved, tmp_path / f"result{ending}"))
    assert type(loaded) is type(saved)
    assert loaded == saved
    assert models_of(loaded) == models_of(saved)
    if hasattr(saved, "dataset"):
        xr.testing.assert_identical(loaded.dataset, saved.dataset)
    if isinstance(saved, vi.Orbit) and not saved.sticks:
        assert np.array_equal(loaded.motion([0.1, 0.2]), saved.motion([0.1, 0.2]))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("make", [on_springs, a_random_machine])
def test_attractors_of_random_systems_come_back_with_multipliers_to_the_bit(tmp_path, make, seed):
    found = vi.attractors(make(np.random.default_rng(100 + seed)), workers=1)
    loaded = vi.load(vi.save(found, tmp_path / "attractors.nc"))
    assert loaded == found
    for one, other in zip(found, loaded, strict=True):
        assert one.orbit == other.orbit
        assert one.orbit is None or str(one.orbit.multipliers) == str(other.orbit.multipliers)


def test_what_was_loaded_goes_on_as_what_was_saved(tmp_path):
    loaded = vi.load(vi.save(of_a_family(), tmp_path / "orbit.nc"))
    assert loaded.model == slot
    assert vi.continue_orbit(loaded, "width", (0.9, 1.1), step=0.1) == branch_of_a_family()


def test_a_family_that_cannot_be_found_leaves_the_system_that_it_made(tmp_path):
    @vi.family
    def local(width=1.0):
        return two_sided(gap=width / 2)

    orbit = vi.find_orbit(local, n_impacts=2)[0]
    loaded = vi.load(vi.save(orbit, tmp_path / "orbit.nc"))
    assert loaded == orbit
    assert loaded.model == orbit.oscillator


@pytest.mark.parametrize("ending", ["nc", "zarr"])
@pytest.mark.parametrize("make", RESULTS)
def test_info_tells_what_is_in_a_file(tmp_path, make, run, ending):
    path = vi.save(make(), tmp_path / f"result.{ending}")
    code, lines, _ = run(f"info {path}")
    assert code == 0
    assert lines == sentences_of(load_dataset(path))


def test_attractors_are_told_by_name_and_share(tmp_path):
    path = vi.save(with_several_attractors(), tmp_path / "result.nc")
    first, *rest = sentences_of(load_dataset(path))
    assert first == "2 attractors found; shares of the initial conditions:"
    assert [line.split(",")[0] for line in rest] == ["  87.5 % period-2 impact-2", "  12.5 % period-6 sticking"]


def test_a_table_of_an_object_has_its_impacts_and_no_record(tmp_path):
    text = vi.save(orbits(), tmp_path / "orbits.csv").read_text()
    assert "velocity" in text
    assert "object" not in json.loads((tmp_path / "orbits.csv.json").read_text())["columns"]


def test_what_cannot_be_saved_or_loaded_is_refused_in_a_sentence(tmp_path):
    for value in ([], [1], OSC, vi.find_orbit(OSC, n_periods=1, n_impacts=7)):
        with pytest.raises(
            ValueError, match="`dataset` must be an xarray.Dataset, an orbit, an attractor, a list of these"
        ):
            vi.save(value, tmp_path / "result.nc")
    assert not list(tmp_path.iterdir())
    path = vi.save(orbits(), tmp_path / "result.nc")
    with pytest.raises(FileExistsError, match="exists; overwrite it"):
        vi.save(orbits(), path)
    damaged = xr.open_dataset(path, engine="h5netcdf").load()
    damaged["object"] = "{}"
    damaged.to_netcdf(tmp_path / "damaged.nc", engine="h5netcdf")
    with pytest.raises(OSError, match="cannot be read .*; give a result that this package saved"):
        vi.load(tmp_path / "damaged.nc")
