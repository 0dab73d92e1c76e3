"""What a stored sweep promises: the same bits, taken up where it was left, in bounded memory."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib import pyplot as plt

import vibroimpact as vi
from contents import differing
from processes import told_by
from studies import STUDIES
from vibroimpact.backends.cpu import CpuBackend
from vibroimpact.execution import threads
from vibroimpact.execution.base import cut
from vibroimpact.execution.store import SweepStore

OSC = vi.ImpactOscillator()
OMEGA, MASS = np.linspace(0.3, 4.0, 23), np.linspace(0.5, 2.0, 17)


def plane(**options) -> xr.Dataset:
    """Return a small map over a plane."""
    return vi.parameter_map(OSC, **{"omega": OMEGA, "mass": MASS, "sample_impacts": 50} | options)


class Counting:
    """A progress that keeps what it is told, and stops after some tiles."""

    def __init__(self, tiles: int | None = None) -> None:
        self.tiles, self.cells, self.attrs = tiles, [], {}

    def __call__(self, done, total, partial):
        self.cells.append(done)
        self.attrs = dict(partial.attrs)
        return len(self.cells) - 1 != self.tiles


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    """Let threads share a tile or two at a time, so that a sweep that is stopped leaves some of these few cells."""
    monkeypatch.setattr(threads, "SHARE", 30)


@pytest.fixture
def partly(tmp_path) -> Path:
    """Return a store of which a part is done."""
    plane(store=tmp_path / "run.zarr", tile=30, workers=1, progress=Counting(5))
    return tmp_path / "run.zarr"


# The same sweep


@pytest.mark.long(but=4)
@pytest.mark.parametrize(
    "axes",
    [
        {"omega": np.linspace(0.3, 4.0, 7)},
        {"frequency": np.linspace(0.1, 0.6, 5), "restitution": [0.0, 0.5, 1.0]},
        {"gap": np.linspace(-2.0, 8.0, 5), "omega": [0.5, 1.0, 2.8], "damping": [0.0, 0.01, 0.1, 0.2]},
        {"mass": [1.0], "omega": [2.0]},
    ],
    ids=["1-D", "2-D", "3-D", "one cell"],
)
@pytest.mark.parametrize("tile", [1, 4, 7, 100_000])
def test_tiles_of_any_size_hold_the_bits_of_the_sweep_in_memory(tmp_path, axes, tile):
    study = {"indices": ("std", "n_impacts", "lyapunov"), "sample_impacts": 30, **axes}
    memory = vi.parameter_map(OSC, **study)
    stored = vi.parameter_map(OSC, store=tmp_path / "run.zarr", tile=tile, **study).load()
    assert list(stored.dims) == list(axes)
    for name in memory.variables:
        assert stored[name].dtype == memory[name].dtype
        assert stored[name].values.tobytes() == memory[name].values.tobytes(), name
        xr.testing.assert_identical(stored[name], memory[name])
    assert {name: stored.attrs[name] for name in memory.attrs} == memory.attrs


def test_a_store_keeps_the_labels_the_call_and_the_order_of_variables(tmp_path):
    how = {"start": vi.State(-0.5), "indices": ("std", "max_velocity")}
    stored, memory = plane(store=tmp_path / "run.zarr", tile=64, **how), plane(**how)
    assert stored.attrs["oscillator"] == memory.attrs["oscillator"]
    assert stored.attrs["arguments"] == memory.attrs["arguments"]
    assert stored.attrs["cells_missing"] == 0
    assert list(stored.variables) == list(vi.load(tmp_path / "run.zarr").variables) == list(memory.variables)
    xr.testing.assert_identical(vi.load(tmp_path / "run.zarr").drop_attrs(), memory.drop_attrs())


@pytest.mark.parametrize("study", [name for name in STUDIES if "refined" not in name])
def test_a_store_holds_the_bits_of_memory(tmp_path, study):
    model, how = STUDIES[study]
    memory = vi.parameter_map(model(), **how)
    stored = vi.parameter_map(model(), store=tmp_path / "run.zarr", tile=3, **how)
    assert not differing(stored.load(), memory)
    assert vi.parameter_map(model(), store=tmp_path / "run.zarr", **how).attrs["cells_missing"] == 0


# Taken up again


def test_a_second_run_computes_only_what_the_first_one_left(tmp_path):
    store, first, second, third = tmp_path / "run.zarr", Counting(4), Counting(), Counting()
    plane(store=store, tile=30, workers=1, progress=first)
    done = SweepStore(store).records()
    whole = plane(store=store, tile=30, progress=second)
    again = plane(store=store, tile=30, progress=third)
    assert second.attrs["cells_skipped"] == first.cells[-1]
    assert second.attrs["tiles_skipped"] == int((done[:, 0] > 0).sum()) == len(first.cells) - 1
    assert second.cells[0] == first.cells[-1]
    assert second.cells[-1] == OMEGA.size * MASS.size
    assert first.attrs["impacts_computed"] + second.attrs["impacts_computed"] == whole.attrs["impacts_computed"]
    assert (third.attrs["impacts_computed"], third.attrs["tiles_skipped"]) == (0, len(SweepStore(store).tiling))
    assert third.cells == [OMEGA.size * MASS.size]
    assert whole.attrs["impacts_computed"] == again.attrs["impacts_computed"] == plane().attrs["impacts_computed"]


def test_a_finished_tile_is_not_written_again(partly):
    chunks = [*partly.glob("std/c/*/*"), *partly.glob("status/c/*/*")]
    finished = {file: file.stat().st_mtime_ns for file in chunks}
    plane(store=partly)
    assert len(finished) >= 2 * 5
    assert {file: file.stat().st_mtime_ns for file in finished} == finished


def test_a_store_keeps_the_tiles_it_was_made_with(partly):
    plane(store=partly, tile=7)
    assert SweepStore(partly).tiling.tile == cut((23, 17), 30).tile


@pytest.mark.parametrize(
    ("change", "difference"),
    [
        ({"osc": OSC.replace(restitution=0.7)}, "restitution is 0.8 there, 0.7 here"),
        ({"omega": OMEGA[:-1]}, "axis 1 is omega 0.3 to 4 in 23 there, omega 0.3 to 3.83182 in 22 here"),
        (
            {"mass": np.linspace(0.5, 2.0, 17) ** 1.0000001},
            r"axis 2 is mass 0.5 to 2 in 17 \(\w{8}\) there, mass .* in 17 \(\w{8}\) here",
        ),
        ({"indices": ("std", "max_velocity")}, "indices is std there, std, max_velocity here"),
        ({"sample_impacts": 51}, "sample_impacts is 50 there, 51 here"),
        ({"transient_impacts": 99}, "transient_impacts is 100 there, 99 here"),
        ({"start": vi.State(-1.0)}, "start is at rest there, State.displacement=-1.0, .* here"),
        ({"tolerances": vi.Tolerances(chatter=1e-8)}, "chatter is 1e-09 there, 1e-08 here"),
        ({"backend": "reference"}, "backend is cpu there, reference here"),
        ({"early_closing": False}, "early_closing is True there, False here"),
        ({"version": "99.0"}, "version is .* there, 99.0 here"),
        ({"reversed": True}, "axis 1 is omega .* there, mass .* here; axis 2 is mass"),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_another_study_is_refused_with_the_difference(partly, monkeypatch, change, difference):
    before = sorted((file, file.stat().st_mtime_ns) for file in partly.rglob("*"))
    osc, change = change.get("osc", OSC), {name: value for name, value in change.items() if name != "osc"}
    if version := change.pop("version", None):
        monkeypatch.setattr("vibroimpact.request.package_version", lambda: version)
    axes = {"mass": MASS, "omega": OMEGA} if change.pop("reversed", False) else {"omega": OMEGA, "mass": MASS}
    with pytest.raises(ValueError, match=f"`store` '.*' holds another study .{difference}.*; choose another"):
        vi.parameter_map(osc, store=partly, **axes | {"sample_impacts": 50} | change)
    assert sorted((file, file.stat().st_mtime_ns) for file in partly.rglob("*")) == before


# A part of it


def test_a_partly_finished_store_opens_without_a_warning_and_its_root_holds_results_only(partly):
    with xr.open_zarr(partly, consolidated=False) as stored:
        assert set(stored.variables) == {"omega", "mass", "std", "status"}
        missing = stored["status"].values == vi.Status.INTERRUPTED
        assert stored["status"].dtype == np.int8
        assert 0 < missing.sum() < missing.size
        assert np.isnan(stored["std"].values[missing]).all()
        np.testing.assert_array_equal(stored["std"].values[~missing], plane()["std"].values[~missing])
    with xr.open_datatree(partly, engine="zarr", consolidated=False) as tree:
        assert list(tree.children) == ["progress"]


def test_what_is_missing_is_told_by_the_dataset_and_by_the_summary(partly):
    store = SweepStore(partly)
    summary, dataset = store.summary(), store.dataset().load()
    missing = int((dataset["status"] == vi.Status.INTERRUPTED).sum())
    assert dataset.attrs["cells_missing"] == missing == summary["cells"] - summary["cells_done"]
    assert (summary["cells"], summary["tiles"]) == (391, len(store.tiling))
    assert 5 <= summary["tiles_done"] < summary["tiles"]
    assert summary["impacts"] == dataset.attrs["impacts_computed"] > 0
    assert 0.0 < summary["seconds"] < 60.0
    words = {status.word: int((dataset["status"] == status).sum()) for status in vi.Status}
    assert summary["statuses"] == {word: count for word, count in words.items() if count and word != "interrupted"}


def test_a_store_of_which_nothing_is_done_opens(tmp_path):
    stored = plane(store=tmp_path / "run.zarr", progress=lambda *news: False).load()
    assert (stored["status"] == vi.Status.INTERRUPTED).all()
    assert stored["std"].isnull().all()
    assert SweepStore(tmp_path / "run.zarr").summary()["statuses"] == {}


@pytest.mark.filterwarnings("error")
def test_the_picture_of_a_partly_finished_store_says_which_part_is_missing(partly):
    ax = vi.plotting.index_contour(SweepStore(partly).dataset())
    legend = ax.get_legend() or ax.get_figure().legends[0]
    missing = SweepStore(partly).dataset().attrs["cells_missing"]
    lines = [text.get_text() for text in legend.get_texts()]
    assert any("interrupted" in words and f"{missing} cells" in words for words in lines), lines
    vi.plotting.index_surface(SweepStore(partly).dataset())
    plt.close("all")


def test_the_curve_of_a_partly_finished_store_says_which_part_is_missing(tmp_path, monkeypatch):
    study = {"omega": OMEGA, "sample_impacts": 50, "store": tmp_path / "run.zarr", "tile": 4, "workers": 1}
    monkeypatch.setattr(threads, "SHARE", 4)
    ax = vi.plotting.index_curve(vi.parameter_map(OSC, progress=Counting(2), **study))
    legend = ax.get_legend() or ax.get_figure().legends[0]
    assert any("interrupted" in text.get_text() for text in legend.get_texts())
    plt.close("all")


# Size


@pytest.mark.long
def test_a_map_of_sixteen_million_cells_is_begun_in_bounded_memory(tmp_path):
    report = told_by("large", tmp_path / "run.zarr")
    assert 15_900_000 < report["missing"] < 16_000_000
    assert report["MB"] < 1000.0  # a quarter of it once the kernels are compiled


def test_only_what_cannot_work_is_refused_of_a_store(tmp_path, memory):
    memory(4_000_000)
    wide = {"omega": np.linspace(1, 2, 20_000), "mass": np.linspace(1, 2, 5_000), "progress": lambda *news: False}
    stored = vi.parameter_map(OSC, store=tmp_path / "run.zarr", sample_impacts=1, **wide)  # 1e8 cells in 4 MB
    assert stored["status"].size == 100_000_000
    with pytest.raises(ValueError, match="`tile` is 19,600 cells, which take 4.9 MB of memory, .*; 4096 is usual"):
        vi.parameter_map(OSC, store=tmp_path / "other.zarr", tile=19_600, **wide)
    with pytest.raises(ValueError, match="`axes` span 100,000,000 cells in 25,000,000 tiles, .* or larger tiles"):
        vi.parameter_map(OSC, store=tmp_path / "other.zarr", tile=4, **wide)
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.zarr"]


@pytest.mark.parametrize("shape", [(1,), (7,), (23, 17), (5, 4, 3), (2, 1, 3, 2), (1, 100)])
@pytest.mark.parametrize("cells", [1, 2, 10, 4096])
def test_tiles_cover_every_cell_once_and_none_is_larger_than_asked_by_much(shape, cells):
    tiling, count = cut(shape, cells), np.zeros(shape, int)
    for number in range(len(tiling)):
        count[tiling[number]] += 1
        assert count[tiling[number]].size == tiling.cells(number) <= 2 ** len(shape) * cells
    assert (count == 1).all()


# Where it lies


@pytest.mark.long(but=4)
@pytest.mark.parametrize(
    "name", ["two words.zarr", "Stöße α.zarr", "run[1]*?.zarr", "a#b%20.zarr", "a.b.zarr", "-x.zarr", "UP.ZARR"]
)
def test_a_store_may_have_any_name(tmp_path, name):
    plane(store=tmp_path / name, tile=60, progress=Counting(2))
    second = Counting()
    plane(store=str(tmp_path / name) + "/", tile=60, progress=second)
    assert second.attrs["tiles_skipped"] >= 2
    assert [entry.name for entry in tmp_path.iterdir()] == [name]


def test_a_sweep_stays_with_its_store_when_the_process_changes_its_folder(tmp_path, monkeypatch):
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path)
    stored = plane(store="run.zarr", tile=60, progress=lambda *news: os.chdir("/" if news[0] else "elsewhere"))
    xr.testing.assert_equal(stored.load(), plane())
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["elsewhere", "run.zarr"]
    assert list((tmp_path / "elsewhere").iterdir()) == []


@pytest.mark.skipif(os.name == "nt", reason="links need rights there")
@pytest.mark.parametrize("there", [True, False])
def test_a_store_may_be_a_link(tmp_path, there):
    (tmp_path / "disk").mkdir()
    if there:
        plane(store=tmp_path / "disk" / "run.zarr", progress=lambda *news: False)
    (tmp_path / "link.zarr").symlink_to(tmp_path / "disk" / "run.zarr")
    plane(store=tmp_path / "link.zarr")
    assert SweepStore(tmp_path / "disk" / "run.zarr").is_whole()
    assert (tmp_path / "link.zarr").is_symlink()


# Refused


@pytest.mark.parametrize(
    ("how", "error", "words"),
    [
        ({"store": "run.nc"}, ValueError, "`store` must be a folder ending in .zarr, got"),
        ({"store": 5}, ValueError, "`store` must be the path of a folder ending in .zarr, got"),
        ({"store": "missing/run.zarr"}, FileNotFoundError, "folder does not exist; create it first"),
        ({"store": "file.zarr"}, OSError, "is not a stored sweep"),
        ({"store": "empty.zarr"}, OSError, "is not a stored sweep"),
        ({"store": "saved.zarr"}, OSError, "is not a stored sweep"),
        ({"tile": 0}, ValueError, "`tile` must be .*, got"),
        ({"tile": 2.5}, ValueError, "`tile` must be .*, got"),
        ({"tile": "many"}, ValueError, "`tile` must be .*, got"),
        ({"start": vi.State(0.5), "gap": [0.4, 0.6]}, ValueError, "at most the gap, 0.4 m here, got 0.5"),
        ({"start": vi.State(0.5)}, ValueError, "`start` must have a displacement .* got 0.5"),
    ],
    ids=str,
)
def test_what_cannot_be_stored_is_refused_and_what_lies_there_left_alone(tmp_path, monkeypatch, how, error, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file.zarr").write_text("mine")
    (tmp_path / "empty.zarr").mkdir()
    vi.save(vi.parameter_map(OSC, omega=[2.0], sample_impacts=10), "saved.zarr")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(error, match=words):
        plane(**{"store": "run.zarr"} | how)
    assert sorted(tmp_path.rglob("*")) == before


def test_a_failing_back_end_ends_the_sweep_and_frees_the_store(tmp_path, monkeypatch):
    share, begun = CpuBackend.share, []

    def fail(backend, cells, wanted):
        begun.append(len(cells))
        if len(begun) == 3:
            raise MemoryError("no room for the cells")
        return share(backend, cells, wanted)

    with monkeypatch.context() as patched:
        patched.setattr(CpuBackend, "share", fail)
        with pytest.raises(MemoryError):
            plane(store=tmp_path / "run.zarr", tile=60)
    assert len(begun) == 3
    xr.testing.assert_equal(plane(store=tmp_path / "run.zarr").load(), plane())
