"""Refined maps in stores: killed and gone on with, and what `info` tells of them."""

from __future__ import annotations

import json
import os

import numpy as np
import pytest
import zarr

import store_driver as driver
import vibroimpact as vi
from contents import differing
from processes import told_by
from vibroimpact.execution.store import SweepStore
from vibroimpact.files.guard import GuardedStore

NAMES = ("std", "lyapunov_per_impact", "n_periods", "n_impacts", "status", "level")


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch):
    monkeypatch.setattr("vibroimpact.execution.base.LISTED", 100)
    monkeypatch.setattr("vibroimpact.execution.threads.SHARE", 100)  # and computed one at a time


def partly(store, **options):
    """Refine the plane until the given grid of 169 cells and 100 more are computed."""
    return driver.refined(store, workers=1, progress=lambda done, total, partial: done < 269, **options)


@pytest.fixture(scope="module")
def whole():
    """Return the plane refined in memory."""
    return vi.parameter_map(driver.OSC, refine=2, **driver.REFINED)


@pytest.mark.long
@pytest.mark.skipif(os.name == "nt", reason="signals and forks are those of POSIX")
def test_a_refined_map_killed_at_random_moments_is_in_the_end_the_uninterrupted_one(tmp_path, whole):
    report = told_by("harm", tmp_path, 10, "SIGKILL", "refined")
    assert report["code"] == 0
    assert set(report["codes"]) <= {0, -9}
    for name in ("whole", *range(report["stores"])):
        loaded = vi.load(tmp_path / f"{name}.zarr")
        assert not differing(loaded, whole, NAMES), name
        assert not list((tmp_path / f"{name}.zarr").rglob("*.partial"))


@pytest.mark.long
def test_a_refined_map_is_not_complete_until_all_of_its_attributes_are_written(tmp_path, whole, monkeypatch):
    store, written = tmp_path / "r.zarr", []
    write = GuardedStore.set

    async def watched(files, key, value):
        await write(files, key, value)
        if key == "zarr.json":
            written.append({"complete", "filled_in"} & set(json.loads(value.to_bytes())["attributes"]))

    monkeypatch.setattr(GuardedStore, "set", watched)
    driver.refined(store, workers=1)
    assert written[-1] == {"complete", "filled_in"}
    assert all(not found for found in written[:-1])


@pytest.mark.long(but=1)
@pytest.mark.parametrize("array", ["std", "level", "progress/cells/std", "progress/cells/cell"])
def test_a_damaged_chunk_of_the_picture_or_the_lists_is_found_and_made_again(tmp_path, whole, array):
    store = tmp_path / "r.zarr"
    driver.refined(store)
    chunk = next(file for file in sorted((store / array / "c").rglob("*")) if file.is_file())
    chunk.write_bytes(chunk.read_bytes()[:-3])
    what = "1 damaged tile; computed" if "cells" in array else "the picture is damaged; drawn"
    assert SweepStore(store).faults() == [f"{what} again when you continue"]
    again = driver.refined(store)
    assert not differing(again, whole, NAMES)
    assert SweepStore(store).is_whole()


def summary(store):
    return SweepStore(store).summary()


def test_the_summary_counts_cells_while_a_refined_map_is_computed(tmp_path, whole):
    store, news = tmp_path / "r.zarr", []

    def look(done, total, partial):
        news.append((done, total, summary(store)))
        return done < 269

    driver.refined(store, workers=1, progress=look)
    for done, total, found in news:
        assert found["needed"] == total
        assert done - 2 * 100 < found["cells_done"] <= done  # but for tiles that have not ended
    found = summary(store)
    assert found["cells_done"] == 269 < found["needed"] < found["cells"] == 2401
    assert sum(found["statuses"].values()) == 269
    assert found["seconds"] > 0.0
    assert not SweepStore(store).is_complete()
    driver.refined(store)
    found = summary(store)
    assert found["cells_done"] == found["needed"] == int((whole["level"] >= 0).sum()) == whole.attrs["cells_computed"]
    assert found["impacts"] == whole.attrs["impacts_computed"]
    assert SweepStore(store).is_complete()


@pytest.mark.long
def test_info_tells_how_far_a_refined_map_is_and_how_to_go_on(run, tmp_path):
    partly(tmp_path / "r.zarr")
    code, lines, _ = run("info r.zarr")
    assert code == 0
    assert "refined map of std" in lines[0]
    assert "refine 2" in lines[1]
    needed = summary(tmp_path / "r.zarr")["needed"]
    assert lines[2] == f"269 of {needed:,} cells computed (the total may grow), for a map of 2,401"
    assert "s elapsed" in lines[3]
    assert "s left" in lines[3]
    assert lines[-1].startswith("continue with: ")


@pytest.mark.long
def test_info_tells_of_damaged_cells_and_of_a_store_just_begun(run, tmp_path):
    partly(tmp_path / "r.zarr")
    chunk = tmp_path / "r.zarr" / "progress" / "cells" / "std" / "c" / "1"
    chunk.write_bytes(chunk.read_bytes()[:-3])
    assert "1 damaged tile; computed again when you continue" in run("info r.zarr")[1]
    driver.refined(tmp_path / "new.zarr", progress=lambda *seen: False)
    lines = run("info new.zarr")[1]
    assert lines[2].startswith("0 of 169 cells computed")
    assert lines[-1] == "continue with: the same parameter_map(..., store=...) call"


@pytest.mark.long
def test_info_of_a_finished_refined_map_has_nothing_to_go_on_with(run, tmp_path, whole):
    command = "map --x omega=1.5:3.5:13 --y mass=0.5:1.5:13 --sample-impacts 200 --refine 2 --out r.zarr"
    assert run(command)[0] == 0
    lines = run("info r.zarr")[1]
    computed = whole.attrs["cells_computed"]
    assert lines[2] == f"finished: {computed:,} cells computed, {computed / 2401:.1%} of 2,401 in the map"
    assert lines[-1] == whole.attrs["filled_in"]
    assert "continue" not in " ".join(lines)
    assert "left" not in " ".join(lines)
    assert f"finished: {computed:,} cells computed" in run(command)[2][1]  # it exists


@pytest.mark.parametrize("name", ["progress/cells", "progress/cells/cell", "std", "level"])
def test_a_refined_map_whose_description_is_damaged_is_refused(tmp_path, name):
    partly(tmp_path / "r.zarr")
    (tmp_path / "r.zarr" / name / "zarr.json").write_text("{")
    for job in (SweepStore, driver.refined):
        with pytest.raises(OSError, match=f"is damaged .*r.zarr/{name}/zarr.json' is damaged, .*; restore"):
            job(tmp_path / "r.zarr")


def test_cells_that_are_not_those_asked_for_are_computed_anew(tmp_path, whole):
    driver.refined(tmp_path / "r.zarr", workers=1, progress=lambda done, total, partial: done < 400)
    root = zarr.open_group(tmp_path / "r.zarr", mode="r+")
    cells = root["progress/cells/cell"][:100]
    root["progress/cells/cell"][:100] = cells[::-1]
    root["progress/cells/std"][:100] = 7.0
    found = driver.refined(tmp_path / "r.zarr")
    assert not differing(found, whole, NAMES)


def test_batches_for_which_the_lists_have_no_room_are_computed_all_the_same(tmp_path, whole, monkeypatch):
    monkeypatch.setattr("vibroimpact.execution.layout.SPARE", -20)  # 4 tiles of 100 cells
    found = driver.refined(tmp_path / "r.zarr")
    assert SweepStore(tmp_path / "r.zarr").summary()["tiles"] == 4
    assert not differing(found, whole, NAMES)


def test_cells_of_a_slow_back_end_are_kept_a_few_at_a_time(tmp_path):
    axes = {"omega": np.linspace(2.0, 2.6, 9), "gap": np.linspace(0.0, 0.3, 9)}
    more = {"refine": 1, "backend": "reference", "transient_impacts": 1, "sample_impacts": 2}
    store = tmp_path / "r.zarr"
    vi.parameter_map(driver.OSC, progress=lambda done, total, partial: done < 70, store=store, **more, **axes)
    assert summary(store)["cells_done"] == 64
