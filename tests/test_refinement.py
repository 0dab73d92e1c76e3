"""Fine pictures computed where motions change and filled in elsewhere."""

import tracemalloc

import numpy as np
import pytest

import vibroimpact as vi
from cells import make_cells
from designs import random_designs
from vibroimpact import refined_map, to_uniform
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
    told, true = vi.classify(plane), vi.classify(whole)
    same = told["motion"] == true["motion"]
    named = (told["n_periods"] == true["n_periods"]) & (told["n_impacts"] == true["n_impacts"])
    return 1.0 - float((same & (named | (true["motion"] != MotionClass.PERIODIC))).mean())


@pytest.fixture(scope="module")
def hard():
    """The hard plane refined eightfold both ways, and computed whole."""
    plane = refined_map(OSC, refine=3, **BRIEF, **HARD)
    return plane, uniform(plane)


def test_computed_cells_are_those_of_the_uniform_map_bit_for_bit(hard):
    plane, whole = hard
    computed = plane["level"].values >= 0
    assert 0 < computed.sum() == plane.attrs["cells_computed"]
    for name in (*NAMED, "status"):
        assert np.array_equal(plane[name].values[computed], whole[name].values[computed], equal_nan=True)


def test_the_quadtree_misses_less_than_a_tenth_of_a_percent_of_the_hard_plane(hard):
    assert hard[0].attrs["fraction_computed"] < 0.45  # 0.433
    assert different(*hard) < 0.001  # 0.0006


def test_indices_filled_in_within_a_motion_err_as_the_square_of_the_coarse_step():
    errors = []
    for points in (3, 5):
        axes = {"omega": np.linspace(1.6, 1.8, points), "amplitude": [1.0, 2.0]}
        plane = refined_map(OSC, refine=4, indices=("std", "mean_velocity"), **BRIEF, **axes)
        whole = uniform(plane, indices=("mean_velocity",))
        errors.append(float(np.abs(plane["mean_velocity"] - whole["mean_velocity"]).max() / OSC.velocity_scale))
    assert errors[1] < 0.04
    assert 3.0 < errors[0] / errors[1] < 5.0


def test_a_plane_of_one_motion_is_computed_on_the_given_grid_alone():
    plane = refined_map(OSC, refine=4, omega=[1.99, 2.0, 2.01], amplitude=[0.5, 1.0, 2.0], **BRIEF)
    assert plane.sizes == {"omega": 33, "amplitude": 33}
    assert np.argwhere(plane["level"].values >= 0).tolist() == [[16 * i, 16 * j] for i in range(3) for j in range(3)]
    assert plane.attrs["cells_computed"] == 9
    assert plane.attrs["fraction_computed"] == 9 / 33**2
    assert (vi.classify(plane)["motion"] == MotionClass.PERIODIC).all()


def test_motions_do_not_depend_on_amplitude_where_the_gap_is_zero():
    plane = refined_map(OSC, refine=3, omega=np.linspace(1.9, 2.5, 7), amplitude=[0.5, 1.0, 2.0], **BRIEF)
    codes = vi.classify(plane)["n_periods"].values + 1000 * vi.classify(plane)["motion"].values.astype(int)
    assert (codes == codes[:, :1]).all()
    computed = plane["level"].values >= 0
    assert 0 < computed.mean() < 0.7


def test_a_gap_that_is_never_crossed_is_followed_to_the_finest_level():
    damped = OSC.replace(damping=0.5)  # a start at rest never overshoots far: the mass swings by R(omega) at last
    plane = refined_map(damped, refine=4, omega=np.linspace(2.0, 3.0, 9), gap=np.linspace(0.1, 1.3, 9), **BRIEF)
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
    plane = refined_map(resonant, refine=4, omega=np.linspace(0.6, 1.5, 4), amplitude=[0.01, 0.035, 0.06], **BRIEF)
    quiet = plane["status"] == vi.Status.NO_IMPACT
    assert quiet.values[::16, ::16].all()
    whole = uniform(plane, resonant)
    assert (whole["status"] < vi.Status.NO_IMPACT).sum() > 50
    assert np.array_equal(plane["status"].values, whole["status"].values)


@pytest.mark.parametrize("osc", list(random_designs(np.random.default_rng(131), 10)))
def test_no_cell_that_hits_is_shown_without_impacts(osc):
    size = osc.velocity_scale / osc.natural_frequency
    axes = {"omega": osc.omega * np.linspace(0.6, 1.4, 6), "gap": osc.gap + size * np.linspace(-0.3, 0.5, 6)}
    plane = refined_map(osc, refine=3, **axes, **BRIEF)
    quiet = plane["status"].values >= vi.Status.NO_IMPACT
    assert (plane["level"].values[quiet] >= 0).all()
    assert not (quiet & (uniform(plane, osc)["status"].values < vi.Status.NO_IMPACT)).any()


def test_a_refined_map_says_what_was_filled_in(hard):
    grid = "islands of another motion between the points of the given 13 x 13 grid may be missing"
    assert hard[0].attrs["filled_in"].endswith(grid)


def test_jumps_of_an_index_are_refined_too():
    axes = {"omega": np.linspace(1.5, 2.5, 9), "amplitude": [0.5, 1.0]}
    plain = refined_map(OSC, refine=2, indices=("max_velocity",), **BRIEF, **axes)
    steep = refined_map(OSC, refine=2, indices=("max_velocity",), jump=0.1, **BRIEF, **axes)
    assert steep.attrs["cells_computed"] > plain.attrs["cells_computed"]
    most = 0.1 * float(np.ptp(steep["max_velocity"].values[::4, ::4]))
    rough = np.abs(np.diff(steep["max_velocity"].values, axis=0)) > most
    computed = steep["level"].values >= 0
    assert (computed[1:] & computed[:-1])[rough].all()


def test_finer_axes_keep_the_given_values():
    given = np.array([0.1, 0.3, 1.7])
    fine = finer(given, 5)
    assert np.array_equal(fine[::32], given)
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
def test_a_stopped_sweep_goes_on_where_it_stopped_with_the_same_bits(hard, tmp_path):
    told = []

    def stop(done, total, partial):
        told.append((done, total))
        return done < 500

    request = {"refine": 3, "store": tmp_path / "r.zarr", **BRIEF, **HARD}
    partial = refined_map(OSC, progress=stop, **request)
    assert partial.attrs["complete"] == 0
    assert not (partial["status"] == vi.Status.INTERRUPTED).any()  # filled in from what there is
    begun = []
    plane = refined_map(OSC, progress=lambda done, total, partial: begun.append(done), **request)
    assert begun[0] == 13 * 13  # the given grid was kept
    assert plane.attrs["complete"] == 1
    for name in (*NAMED, "status", "level"):
        assert np.array_equal(plane[name].values, hard[0][name].values, equal_nan=True), name
    again = []
    assert refined_map(OSC, progress=lambda *seen: again.append(seen), **request).equals(plane)
    assert not again  # nothing was left to do


@pytest.mark.long
def test_damaged_cells_are_computed_anew_and_another_study_is_refused(tmp_path):
    axes = {"omega": np.linspace(2.0, 3.0, 5), "mass": np.linspace(0.5, 1.5, 5)}
    request = {"refine": 2, "store": tmp_path / "r.zarr", **BRIEF, **axes}
    whole = refined_map(OSC, **request).load()
    for name in ("std/c/0/0", "level/c/0/0", "progress/cells/n_periods/c/0"):
        chunk = tmp_path / "r.zarr" / name
        chunk.write_bytes(chunk.read_bytes()[:-3])
        assert not SweepStore(tmp_path / "r.zarr").is_whole() or "cells" in name
        assert refined_map(OSC, **request).load().equals(whole)
        chunk.unlink()
        assert refined_map(OSC, **request).load().equals(whole)
    with pytest.raises(ValueError, match="jump is None there, 0.5 here"):
        refined_map(OSC, **request, jump=0.5)


def test_a_sweep_stopped_on_its_first_cells_says_which_are_missing():
    plane = refined_map(OSC, refine=2, progress=lambda *seen: False, **BRIEF, **HARD)
    assert plane.attrs["complete"] == 0
    assert set(np.unique(plane["status"])) >= {vi.Status.INTERRUPTED}


@pytest.mark.long
def test_memory_is_that_of_the_picture_and_little_more(monkeypatch):
    for place, number in (
        ("execution.LISTED", 256),
        ("execution.threads.SHARE", 256),
        ("refinement.picture.BAND", 8),
    ):
        monkeypatch.setattr(f"vibroimpact.{place}", number)  # what is taken at a time is next to nothing
    plane = {"omega": np.linspace(1.5, 2.5, 33), "mass": np.linspace(0.5, 1.5, 33)}
    refined_map(OSC, refine=1, sample_impacts=50, **plane)  # compiles
    tracemalloc.start()
    try:
        fine = refined_map(OSC, refine=4, sample_impacts=50, **plane)
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
    even = to_uniform(plane, shape=(65, 33))
    assert even["std"].shape == (65, 33)
    assert even["std"].values[::8, ::8][1, 1] == plane["std"].sel(omega=even["omega"][8], mass=even["mass"][8])
    assert to_uniform(plane).sizes == plane.sizes


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"refine": 0}, "`refine` must be a whole number >= 1, got 0"),
        ({"refine": 13}, "`refine` must be between 1 and 12, got 13"),
        ({"jump": 0.0}, "`jump` must be None or a number above 0.*, got 0.0"),
        ({"mass": [1.0]}, "`mass` must have two or more values"),
        ({"gap": [0.0, 0.1]}, "`refine` needs two axes, got 3"),
        ({"mass": None}, "`refine` needs two axes, got 1"),
        ({"start": vi.State(1.0)}, "`start` must have a displacement .* got 1.0"),
    ],
)
def test_a_wrong_request_is_told_what_is_allowed(wrong, words):
    request = {"refine": 2, "omega": [1.0, 2.0], "mass": [1.0, 2.0]} | wrong
    with pytest.raises(ValueError, match=words):
        refined_map(OSC, **{name: value for name, value in request.items() if value is not None or name == "jump"})


def test_a_uniform_map_is_no_refined_one():
    with pytest.raises(ValueError, match="`plane` must be what `refined_map` returned, got a Dataset without"):
        to_uniform(vi.parameter_map(OSC, omega=[1.0, 2.0], sample_impacts=10))
    plane = refined_map(OSC, refine=1, omega=[1.9, 2.0], mass=[1.0, 1.1], sample_impacts=50)
    with pytest.raises(ValueError, match="`shape` must be a pair"):
        to_uniform(plane, shape=(3,))


@pytest.fixture(scope="module")
def between_stops():
    """A mass between two stops, refined fourfold both ways."""
    axes = {"frequency": np.linspace(15.0, 35.0, 9), "right_gap": np.linspace(0.5e-3, 2e-3, 5)}
    system = vi.models.two_sided_oscillator()
    return system, axes, refined_map(system, refine=2, indices=("max_velocity",), **BRIEF, **axes)


def test_a_refined_map_of_a_system_has_the_cells_of_the_uniform_one(between_stops):
    system, _, plane = between_stops
    whole = uniform(plane, system, indices=("max_velocity", *NAMED[1:]))
    computed = plane["level"].values >= 0
    assert 0.2 < computed.mean() < 0.6
    for name in ("max_velocity", *NAMED[1:], "status"):
        assert np.array_equal(plane[name].values[computed], whole[name].values[computed], equal_nan=True)
    assert different(plane, whole) < 0.005
    quiet = plane["status"].values == vi.Status.NO_IMPACT
    assert computed[quiet].all()


@pytest.mark.long
def test_a_refined_map_of_a_system_goes_on_in_its_store(between_stops, tmp_path):
    system, axes, plane = between_stops
    how = {"refine": 2, "indices": ("max_velocity",), "store": tmp_path / "plane.zarr", **BRIEF, **axes}
    stopped = refined_map(system, **how, progress=lambda done, *_: done < 60)
    assert stopped.attrs["complete"] == 0
    kept = refined_map(system, **how)
    for name in ("max_velocity", "n_periods", "status", "level"):
        assert np.array_equal(kept[name].values, plane[name].values, equal_nan=True)


def test_motions_of_two_masses_are_told_apart_by_class_where_they_have_no_cycle():
    """A quasi-periodic cell beside a chaotic one is refined: both have no cycle."""
    cells = {"status": np.zeros(2, int), "n_periods": np.zeros(2), "n_impacts": np.zeros(2)}
    cells["lyapunov_per_impact"] = np.array([0.0, 0.1])
    one, several = (motion_codes(cells, 2000, several).tolist() for several in (False, True))
    assert one == [MotionClass.UNDECIDED, MotionClass.CHAOTIC]
    assert several == [MotionClass.QUASI_PERIODIC, MotionClass.CHAOTIC]
