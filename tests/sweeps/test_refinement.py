"""Fine pictures computed where motions change and filled in elsewhere."""

import math
import tracemalloc
from functools import cache

import numpy as np
import pytest

import vibroimpact as vi
from cells import make_cells
from contents import differing
from designs import random_designs
from vibroimpact.backends import ImpactWindow, Measurement
from vibroimpact.execution.store import SweepStore
from vibroimpact.motion import MotionClass
from vibroimpact.refinement.picture import finer, motion_codes
from vibroimpact.request import Request

OSC = vi.ImpactOscillator()
NAMED = ("std", "lyapunov_per_impact", "n_periods", "n_impacts")
HARD = {"omega": np.linspace(1.5, 3.5, 13), "mass": np.linspace(0.5, 1.5, 13)}  # chaos, sticking and windows
BRIEF = {"sample_impacts": 500}


def uniform(plane, osc=OSC, **options):
    axes = {dim: plane[dim].values for dim in plane["level"].dims}
    return vi.parameter_map(osc, **{"indices": NAMED, **BRIEF, **options}, **axes)


def different(plane, whole):
    """Return the share of the cells whose class or name differs."""
    classes, true = vi.classify(plane), vi.classify(whole)
    same = classes["motion"] == true["motion"]
    named = (classes["n_periods"] == true["n_periods"]) & (classes["n_impacts"] == true["n_impacts"])
    return 1.0 - float((same & (named | (true["motion"] != MotionClass.PERIODIC))).mean())


BETWEEN_STOPS = {"frequency": np.linspace(15.0, 35.0, 9), "right_gap": np.linspace(0.5e-3, 2e-3, 5)}
PICTURES = {  # a model, its given grid, levels, indices, the most that is computed, and the most that differs
    "hard plane": (OSC, HARD, 3, NAMED, 0.45, 0.001),  # 0.433 and 0.0006
    "two stops": (vi.models.two_sided_oscillator(), BETWEEN_STOPS, 2, ("max_velocity", *NAMED[1:]), 0.6, 0.005),
}


@cache
def picture(name):
    """Return a plane refined both ways, and computed whole."""
    model, axes, refine, indices, *_ = PICTURES[name]
    plane = vi.refined_map(model, refine=refine, indices=indices, **BRIEF, **axes)
    return plane, uniform(plane, model, indices=indices)


@pytest.fixture
def hard():
    return picture("hard plane")


@pytest.mark.parametrize("name", PICTURES)
def test_computed_cells_are_those_of_the_uniform_map_bit_for_bit_and_few_others_differ(name):
    (plane, whole), (_, _, _, indices, most, wrong) = picture(name), PICTURES[name]
    computed = plane["level"].values >= 0
    assert computed.sum() == plane.attrs["cells_computed"]
    for index in (*indices, "status"):
        assert np.array_equal(plane[index].values[computed], whole[index].values[computed], equal_nan=True)
    assert 0.2 < plane.attrs["fraction_computed"] < most
    assert different(plane, whole) < wrong
    assert computed[plane["status"].values == vi.Status.NO_IMPACT].all()


@pytest.mark.long
@pytest.mark.parametrize("name", PICTURES)
def test_a_stopped_sweep_goes_on_where_it_stopped_with_the_same_bits(name, tmp_path):
    (plane, _), (model, axes, refine, indices, *_) = picture(name), PICTURES[name]
    cells = math.prod(map(len, axes.values()))
    request = {"refine": refine, "indices": indices, "store": tmp_path / "r.zarr", **BRIEF, **axes}
    partial = vi.refined_map(model, progress=lambda done, *_: done < 2 * cells, **request)
    assert partial.attrs["complete"] == 0
    assert not (partial["status"] == vi.Status.INTERRUPTED).any()  # filled in from what there is
    begun, again = [], []
    kept = vi.refined_map(model, progress=lambda done, total, partial: begun.append(done), **request)
    assert begun[0] == cells  # the given grid was kept
    assert kept.attrs["complete"] == 1
    assert not differing(kept, plane, (*indices, "status", "level"))
    assert vi.refined_map(model, progress=lambda *seen: again.append(seen), **request).equals(kept)
    assert not again  # nothing was left to do


def test_indices_filled_in_within_a_motion_err_as_the_square_of_the_coarse_step():
    errors = []
    for points in (3, 5):
        axes = {"omega": np.linspace(1.6, 1.8, points), "amplitude": [1.0, 2.0]}
        plane = vi.refined_map(OSC, refine=4, indices=("std", "mean_velocity"), **BRIEF, **axes)
        whole = uniform(plane, indices=("mean_velocity",))
        errors.append(float(np.abs(plane["mean_velocity"] - whole["mean_velocity"]).max() / OSC.velocity_scale))
    assert errors[1] < 0.04
    assert 3.0 < errors[0] / errors[1] < 5.0


def test_a_plane_of_one_motion_is_computed_on_the_given_grid_alone():
    plane = vi.refined_map(OSC, refine=4, omega=[1.99, 2.0, 2.01], amplitude=[0.5, 1.0, 2.0], **BRIEF)
    assert plane.sizes == {"omega": 33, "amplitude": 33}
    assert np.argwhere(plane["level"].values >= 0).tolist() == [[16 * i, 16 * j] for i in range(3) for j in range(3)]
    assert plane.attrs["cells_computed"] == 9
    assert plane.attrs["fraction_computed"] == 9 / 33**2
    assert (vi.classify(plane)["motion"] == MotionClass.PERIODIC).all()


def test_motions_do_not_depend_on_amplitude_where_the_gap_is_zero():
    plane = vi.refined_map(OSC, refine=3, omega=np.linspace(1.9, 2.5, 7), amplitude=[0.5, 1.0, 2.0], **BRIEF)
    codes = vi.classify(plane)["n_periods"].values + 1000 * vi.classify(plane)["motion"].values.astype(int)
    assert (codes == codes[:, :1]).all()
    computed = plane["level"].values >= 0
    assert 0 < computed.mean() < 0.7


def test_a_gap_that_is_never_crossed_is_followed_to_the_finest_level():
    damped = OSC.replace(damping=0.5)  # a start at rest never overshoots far: the mass swings by R(omega) at last
    plane = vi.refined_map(damped, refine=4, omega=np.linspace(2.0, 3.0, 9), gap=np.linspace(0.1, 1.3, 9), **BRIEF)
    whole = uniform(plane, damped)
    quiet = vi.classify(plane)["motion"].values == MotionClass.NO_IMPACT
    swing = 1.0 / np.hypot(1.0 - plane["omega"].values ** 2, 0.5 * plane["omega"].values)
    assert not quiet[plane["gap"].values[None, :] < 0.999 * swing[:, None]].any()
    assert quiet[plane["gap"].values[None, :] > 2.0 * swing[:, None]].all()
    assert np.array_equal(quiet, vi.classify(whole)["motion"].values == MotionClass.NO_IMPACT)
    edge = quiet[:, 1:] != quiet[:, :-1]
    finest = (plane["level"].values[:, 1:] >= 0) & (plane["level"].values[:, :-1] >= 0)
    assert edge.any(axis=1).all()
    assert finest[edge].all()


def test_an_island_of_hits_between_quiet_points_of_the_given_grid_is_found():
    resonant = vi.ImpactOscillator(gap=1.0)
    plane = vi.refined_map(resonant, refine=4, omega=np.linspace(0.6, 1.5, 4), amplitude=[0.01, 0.035, 0.06], **BRIEF)
    quiet = plane["status"] == vi.Status.NO_IMPACT
    assert quiet.values[::16, ::16].all()
    whole = uniform(plane, resonant)
    assert (whole["status"] < vi.Status.NO_IMPACT).sum() > 50
    assert np.array_equal(plane["status"].values, whole["status"].values)


@pytest.mark.parametrize("osc", list(random_designs(np.random.default_rng(131), 10)))
def test_no_cell_that_hits_is_shown_without_impacts(osc):
    size = osc.velocity_scale / osc.natural_frequency
    axes = {"omega": osc.omega * np.linspace(0.6, 1.4, 6), "gap": osc.gap + size * np.linspace(-0.3, 0.5, 6)}
    plane = vi.refined_map(osc, refine=3, **axes, **BRIEF)
    quiet = plane["status"].values >= vi.Status.NO_IMPACT
    assert (plane["level"].values[quiet] >= 0).all()
    assert not (quiet & (uniform(plane, osc)["status"].values < vi.Status.NO_IMPACT)).any()


def test_a_refined_map_says_what_was_filled_in(hard):
    grid = "islands of another motion between the points of the given 13 x 13 grid may be missing"
    assert hard[0].attrs["filled_in"].endswith(grid)


def test_jumps_of_an_index_are_refined_too():
    axes = {"omega": np.linspace(1.5, 2.5, 9), "amplitude": [0.5, 1.0]}
    plain = vi.refined_map(OSC, refine=2, indices=("max_velocity",), **BRIEF, **axes)
    steep = vi.refined_map(OSC, refine=2, indices=("max_velocity",), jump=0.1, **BRIEF, **axes)
    assert steep.attrs["cells_computed"] > plain.attrs["cells_computed"]
    most = 0.1 * float(np.ptp(steep["max_velocity"].values[::4, ::4]))
    rough = np.abs(np.diff(steep["max_velocity"].values, axis=0)) > most
    computed = steep["level"].values >= 0
    assert (computed[1:] & computed[:-1])[rough].all()


def test_finer_axes_keep_the_given_values():
    values = np.array([0.1, 0.3, 1.7])
    fine = finer(values, 5)
    assert np.array_equal(fine[::32], values)
    assert (np.diff(fine) > 0.0).all()
    assert len(fine) == 65


@pytest.mark.parametrize(
    ("first", "second", "start"),
    [
        ("omega", "mass", None),
        ("gap", "frequency", vi.State(0.3, 0.1, 1.7)),
        ("omega", "gap", vi.State(0.3, 0.1, 1.7)),
        ("stiffness", "restitution", vi.State(-0.3, 0.1, 1.7)),
    ],
)
def test_scattered_cells_are_those_of_the_grid(first, second, start):
    axes = {first: np.linspace(0.4, 0.9, 5), second: np.linspace(0.5, 0.8, 4)}
    request = Request(OSC, axes, Measurement(ImpactWindow(0, 1), indices=NAMED), start)
    osc = OSC.replace(gap=0.4) if "gap" in axes else OSC
    at = np.array([19, 0, 7, 8])
    whole, some = make_cells(osc, start, axes)[at], request.cells(at)
    assert np.array_equal(whole.table, some.table)


@pytest.mark.long
def test_damaged_cells_are_computed_anew_and_another_study_is_refused(tmp_path):
    axes = {"omega": np.linspace(2.0, 3.0, 5), "mass": np.linspace(0.5, 1.5, 5)}
    request = {"refine": 2, "store": tmp_path / "r.zarr", **BRIEF, **axes}
    whole = vi.refined_map(OSC, **request).load()
    for name in ("std/c/0/0", "level/c/0/0", "progress/cells/n_periods/c/0"):
        chunk = tmp_path / "r.zarr" / name
        chunk.write_bytes(chunk.read_bytes()[:-3])
        assert not SweepStore(tmp_path / "r.zarr").is_whole() or "cells" in name
        assert vi.refined_map(OSC, **request).load().equals(whole)
        chunk.unlink()
        assert vi.refined_map(OSC, **request).load().equals(whole)
    with pytest.raises(ValueError, match="jump is None there, 0.5 here"):
        vi.refined_map(OSC, **request, jump=0.5)


def test_a_sweep_stopped_on_its_first_cells_says_which_are_missing():
    plane = vi.refined_map(OSC, refine=2, progress=lambda *seen: False, **BRIEF, **HARD)
    assert plane.attrs["complete"] == 0
    assert set(np.unique(plane["status"])) >= {vi.Status.INTERRUPTED}


@pytest.mark.long
def test_memory_is_that_of_the_picture_and_little_more(monkeypatch):
    for place, number in (
        ("execution.base.LISTED", 256),
        ("execution.threads.SHARE", 256),
        ("refinement.picture.BAND", 8),
    ):
        monkeypatch.setattr(f"vibroimpact.{place}", number)  # what is taken at a time is next to nothing
    plane = {"omega": np.linspace(1.5, 2.5, 33), "mass": np.linspace(0.5, 1.5, 33)}
    vi.refined_map(OSC, refine=1, sample_impacts=50, **plane)  # compiles
    tracemalloc.start()
    try:
        fine = vi.refined_map(OSC, refine=4, sample_impacts=50, **plane)
        most = tracemalloc.get_traced_memory()[1] / fine["level"].size
    finally:
        tracemalloc.stop()
    kept = sum(array.dtype.itemsize for array in fine.data_vars.values()) + 4  # the names of the motions
    assert kept == 30
    assert most < 40.0  # 35; 1 MB in all is not of the picture


def test_a_refined_map_is_drawn_and_resampled(hard):
    plane = hard[0]
    assert vi.plotting.index_contour(plane).get_xlabel() == r"angular driving frequency $\omega$ [rad/s]"
    assert len(vi.plotting.motion_map(plane).get_legend().get_texts()) > 3
    even = vi.to_uniform(plane, shape=(65, 33))
    assert even["std"].shape == (65, 33)
    assert even["std"].values[::8, ::8][1, 1] == plane["std"].sel(omega=even["omega"][8], mass=even["mass"][8])
    assert vi.to_uniform(plane).sizes == plane.sizes


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"refine": 0}, "`refine` must be a whole number >= 1, got 0"),
        ({"refine": 13}, "`refine` must be between 1 and 12, got 13"),
        ({"jump": 0.0}, "`jump` must be None or a number above 0.*, got 0.0"),
        ({"mass": [1.0]}, "`mass` must have at least two values"),
        ({"gap": [0.0, 0.1]}, "`refine` needs two axes, got 3"),
        ({"mass": None}, "`refine` needs two axes, got 1"),
        ({"start": vi.State(1.0)}, "`start` must have a displacement .* got 1.0"),
    ],
)
def test_a_wrong_request_is_told_what_is_allowed(wrong, words):
    request = {"refine": 2, "omega": [1.0, 2.0], "mass": [1.0, 2.0]} | wrong
    with pytest.raises(ValueError, match=words):
        vi.refined_map(OSC, **{name: value for name, value in request.items() if value is not None or name == "jump"})


def test_a_uniform_map_is_no_refined_one():
    with pytest.raises(ValueError, match="`plane` must be a result of `refined_map`, got a Dataset without"):
        vi.to_uniform(vi.parameter_map(OSC, omega=[1.0, 2.0], sample_impacts=10))
    plane = vi.refined_map(OSC, refine=1, omega=[1.9, 2.0], mass=[1.0, 1.1], sample_impacts=50)
    with pytest.raises(ValueError, match="`shape` must be a pair"):
        vi.to_uniform(plane, shape=(3,))


def test_motions_of_two_masses_are_told_apart_by_class_where_they_have_no_cycle():
    """A quasi-periodic cell beside a chaotic one is refined: both have no cycle."""
    cells = {"status": np.zeros(2, int), "n_periods": np.zeros(2), "n_impacts": np.zeros(2)}
    cells["lyapunov_per_impact"] = np.array([0.0, 0.1])
    one, several = (motion_codes(cells, 2000, several).tolist() for several in (False, True))
    assert one == [MotionClass.UNDECIDED, MotionClass.CHAOTIC]
    assert several == [MotionClass.QUASI_PERIODIC, MotionClass.CHAOTIC]
