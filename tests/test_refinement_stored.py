"""Refined maps in stores: killed and gone on with, and what `info` tells of them."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest

import store_driver as driver
import vibroimpact as vi
from vibroimpact.execution.store import SweepStore
from vibroimpact.refinement.progress import progress_of

NAMES = ("std", "lyapunov_per_impact", "n_periods", "n_impacts", "status", "level")


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch):
    monkeypatch.setattr("vibroimpact.refinement.computing.CHUNK", 100)
    monkeypatch.setattr("vibroimpact.refinement.computing.FEWEST", 1)  # and computed one at a time


def partly(store, **options):
    """Refine the plane until the given grid of 169 cells and 100 more are computed."""
    return driver.refined(store, workers=1, progress=lambda done, total, partial: done < 269, **options)


@pytest.fixture(scope="module")
def whole():
    """Return the plane refined in memory."""
    return vi.parameter_map(driver.OSC, refine=2, **driver.REFINED)


@pytest.mark.skipif(os.name == "nt", reason="signals and forks are those of POSIX")
def test_a_refined_map_killed_at_random_moments_is_in_the_end_the_uninterrupted_one(tmp_path, whole):
    done = subprocess.run(
        [sys.executable, driver.__file__, "harm_refined", tmp_path, "10"], capture_output=True, text=True, timeout=240
    )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["code"] == 0
    assert set(told["codes"]) <= {0, -9}
    for name in ("whole", *range(told["stores"])):
        found = vi.load(tmp_path / f"{name}.zarr")
        for variable in NAMES:
            assert found[variable].values.tobytes() == whole[variable].values.tobytes(), (name, variable)
        assert not list((tmp_path / f"{name}.zarr").rglob("*.partial"))


def test_progress_counts_the_cells_of_each_level(tmp_path, whole):
    store, seen = tmp_path / "r.zarr", []

    def look(done, total, partial):
        seen.append((done, total, progress_of(SweepStore(store))))  # while it runs
        return done < 269

    driver.refined(store, workers=1, progress=look)
    for done, total, found in seen:
        assert found.needed == total
        assert done - 2 * 100 < found.computed <= done  # but for chunks that have not ended
    found = progress_of(SweepStore(store))
    assert [level.level for level in found.levels] == [0, 1]
    assert found.levels[0].computed == found.levels[0].needed == 169
    assert found.levels[1].computed == 100 < found.levels[1].needed
    assert not found.drawn
    assert sum(found.statuses.values()) == found.computed
    assert found.seconds > 0.0
    driver.refined(store)
    found = progress_of(SweepStore(store))
    levels = whole["level"].values
    assert [(level.computed, level.needed) for level in found.levels] == [
        (int((levels == n).sum()),) * 2 for n in range(3)
    ]
    assert found.impacts == whole.attrs["impacts_computed"]
    assert found.drawn


def test_info_tells_how_far_a_refined_map_is_and_how_to_go_on(run, tmp_path):
    partly(tmp_path / "r.zarr")
    code, told, _ = run("info r.zarr")
    assert code == 0
    found = progress_of(SweepStore(tmp_path / "r.zarr"))
    assert "refined map of std" in told[0]
    assert "refine 2" in told[1]
    assert told[2] == (
        f"{found.computed:,} of {found.needed:,} cells computed (the total may grow), for a map of 2,401, which is "
        "completed when the run ends or is stopped"
    )
    assert told[3] == "  level 0: 169 of 169 cells"
    assert told[4] == f"  level 1: {found.levels[1].computed} of {found.levels[1].needed} cells"
    assert told[5] == "  level 2: not started"
    assert "s elapsed" in told[6]
    assert "left for the cells known so far" in told[6]
    assert told[-1].startswith("continue with: ")


def test_info_tells_of_damaged_cells_and_of_a_store_just_begun(run, tmp_path):
    partly(tmp_path / "r.zarr")
    before = progress_of(SweepStore(tmp_path / "r.zarr")).computed
    chunk = tmp_path / "r.zarr" / "progress" / "points" / "std" / "c" / "1" / "0"
    chunk.write_bytes(chunk.read_bytes()[:-3])
    told = run("info r.zarr")[1]
    assert "1 damaged chunks of cells; they are computed again when you continue" in told
    assert progress_of(SweepStore(tmp_path / "r.zarr")).computed == before - 69  # of 169, the second chunk
    driver.refined(tmp_path / "new.zarr", progress=lambda *seen: False)
    told = run("info new.zarr")[1]
    assert told[2].startswith("0 of 169 cells computed")
    assert told[4:6] == ["  levels 1 to 2: not started", "continue with: the same parameter_map(..., store=...) call"]


def test_info_of_a_finished_refined_map_has_nothing_to_go_on_with(run, tmp_path, whole):
    command = "map --x omega=1.5:3.5:13 --y mass=0.5:1.5:13 --sample-impacts 200 --refine 2 --out r.zarr"
    assert run(command)[0] == 0
    told = run("info r.zarr")[1]
    computed = whole.attrs["cells_computed"]
    assert told[2] == f"finished: {computed:,} cells computed, {computed / 2401:.1%} of 2,401 in the map"
    assert "continue" not in " ".join(told)
    assert "left" not in " ".join(told)
    assert f"finished: {computed:,} cells computed" in run(command)[2][0]  # it exists


def test_points_whose_description_is_damaged_are_told_of(tmp_path):
    store = tmp_path / "r.zarr"
    partly(store)
    (store / "progress" / "points" / "zarr.json").write_text("{")
    assert progress_of(SweepStore(store)).computed == 0
    with pytest.raises(OSError, match=r"cells is damaged .*; remove its folder progress/points, and"):
        driver.refined(store)


def test_cells_of_a_slow_back_end_are_kept_a_few_at_a_time(tmp_path):
    axes = {"omega": np.linspace(2.0, 2.6, 9), "gap": np.linspace(0.0, 0.3, 9)}
    told = []
    more = {
        "refine": 1,
        "backend": "reference",
        "transient_impacts": 1,
        "sample_impacts": 2,
        "store": tmp_path / "r.zarr",
    }
    vi.parameter_map(driver.OSC, progress=lambda *seen: told.append(seen[0]) or seen[0] < 70, **more, **axes)
    assert progress_of(SweepStore(tmp_path / "r.zarr")).computed == 64
