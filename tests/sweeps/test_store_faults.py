"""Stored sweeps come to harm, for real: killed, interrupted, out of disk, damaged, written by two at once."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import zarr

import store_driver as driver
import vibroimpact as vi
from contents import differing
from fenced import ROOT
from processes import DRIVER, told_by
from vibroimpact.execution.layout import StoreBusy
from vibroimpact.execution.store import SweepStore

posix = pytest.mark.skipif(os.name == "nt", reason="signals and forks are those of POSIX")


@pytest.fixture(scope="module")
def whole():
    """Return the study as computed in memory."""
    return vi.parameter_map(driver.OSC, workers=1, **driver.STUDY)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Return a finished store, to be copied."""
    store = tmp_path_factory.mktemp("stores") / "finished.zarr"
    driver.sweep(store)
    return store


@pytest.fixture
def store(finished, tmp_path):
    """Return a finished store of one's own."""
    return Path(shutil.copytree(finished, tmp_path / "run.zarr"))


def refused_by(job) -> str:
    """Return why a job was refused."""
    with pytest.raises(OSError, match="store|path") as refused:
        job()
    return str(refused.value)


def started(command: str, folder: Path) -> subprocess.Popen:
    """Start the driver; return once it has told of a tile."""
    process = subprocess.Popen([*DRIVER, command, folder], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    for _ in range(2):  # the first line tells of what stood there
        assert process.stdout.readline() == "tile\n"
    return process


def assert_whole(store: Path, whole: xr.Dataset) -> None:
    """Check that a store holds the bits of the uninterrupted sweep, nothing else, and is free to be written."""
    found = SweepStore(store)
    assert found.is_whole()
    with xr.open_zarr(store, consolidated=False, chunks=None) as dataset:
        assert set(dataset.variables) == {"omega", "gap", "std", "n_periods", "status"}
        assert not differing(dataset, whole)
    assert not list(store.rglob("*.partial"))
    assert not list(store.parent.glob(".*"))
    with found.writing():
        pass


def resumed(store: Path) -> int:
    """Run the study again; return how many tiles it computed."""
    news = []
    driver.sweep(store, progress=lambda *told: news.append(told[2].attrs["tiles_skipped"]))
    assert len(news) - 1 == driver.TILES - news[0]
    return len(news) - 1


# Killed and interrupted


@pytest.mark.long
@posix
@pytest.mark.parametrize(("sent", "times", "code"), [("SIGKILL", 32, -9), ("SIGINT", 12, 130)])
def test_a_sweep_ended_at_random_moments_is_in_the_end_the_uninterrupted_one(tmp_path, whole, sent, times, code):
    report = told_by("harm", tmp_path, times, sent, "sweep")
    assert report["code"] == 0
    assert set(report["codes"]) <= {0, code}
    assert report["codes"].count(code) >= times
    assert 0 < report["unborn"] < times  # some while the store was made, some later
    names = {"whole.zarr", *(f"{number}.zarr" for number in range(report["stores"]))}
    assert {entry.name for entry in tmp_path.iterdir()} == names
    for name in names:
        assert_whole(tmp_path / name, whole)


@pytest.mark.long
@posix
@pytest.mark.parametrize("presses", [1, 2])
def test_after_ctrl_c_nothing_more_is_written_and_finished_tiles_are_kept(tmp_path, whole, presses):
    store = tmp_path / "run.zarr"
    process = started("interrupted", store)
    for _ in range(presses):
        time.sleep(0.1)  # into the middle of a tile, then into the wait for it
        process.send_signal(signal.SIGINT)
    out, complaints = process.communicate(timeout=600)
    assert (process.returncode, complaints) == (0, "")
    report = json.loads(out.splitlines()[-1])
    assert report["quiet"]
    assert 1 <= report["done"] < driver.TILES
    assert resumed(store) == driver.TILES - report["done"]
    assert_whole(store, whole)


@pytest.mark.long
@posix
def test_a_thousand_kills_in_small_lose_nothing_and_leave_nothing():
    words = ["10", "7", "map.zarr, overwriting", "map.nc, overwriting"]  # the rest: `python -m benchmarks.kills`
    done = subprocess.run([sys.executable, "-m", "benchmarks.kills", *words], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert sum(int(row.split("|")[2]) for row in done.stdout.splitlines()[2:4]) == 10


# Two on one store


@pytest.mark.long
@posix
def test_two_that_begin_a_store_at_the_same_moment_never_both_compute_a_tile(tmp_path, whole):
    for number, outcome in enumerate(told_by("race", tmp_path, 6)):
        assert outcome["codes"] in ([0, 0], [0, 3])  # both had a whole store in the end, or one was refused
        assert outcome["computed"] == driver.TILES
        assert_whole(tmp_path / f"{number}.zarr", whole)


@pytest.mark.long
@posix
def test_a_second_writer_is_refused_until_the_first_is_gone_even_if_it_was_killed(tmp_path, whole):
    store = tmp_path / "run.zarr"
    process = started("slow", store)
    try:
        with pytest.raises(StoreBusy, match=r"`store` '.*run.zarr' is being written by another process; wait"):
            driver.sweep(store)
        assert 0 < SweepStore(store).dataset().attrs["cells_missing"] < 620  # reading is always allowed
    finally:
        process.kill()
        process.communicate()
    driver.sweep(store)
    assert_whole(store, whole)


def test_a_sweep_that_writes_a_store_is_refused_to_its_own_process_too(tmp_path):
    refused = []

    def begin_again(done, total, partial):
        with pytest.raises(StoreBusy):
            driver.sweep(tmp_path / "run.zarr")
        refused.append(done)
        return len(refused) < 3

    driver.sweep(tmp_path / "run.zarr", progress=begin_again)
    assert len(refused) >= 3


# Out of disk, not allowed


@pytest.mark.long
@posix
def test_where_files_cannot_grow_the_error_says_what_to_do_and_finished_tiles_stay(tmp_path, whole):
    store = tmp_path / "run.zarr"
    calls = []
    driver.sweep(store, progress=lambda *news: calls.append(news) or len(calls) < 6)
    before = SweepStore(store).records()
    report = told_by("small_files", store)
    assert "could not be written to" in report["told"]
    assert "File too large); finished tiles are kept; make room there" in report["told"]
    assert np.array_equal(before, SweepStore(store).records())
    assert resumed(store) == driver.TILES - int((before[:, 0] > 0).sum())
    assert_whole(store, whole)


@contextmanager
def small_disk(folder: Path, size: str):
    """Yield a disk of its own, in memory; or skip."""
    folder.mkdir()
    if sys.platform != "linux" or os.geteuid() != 0:
        pytest.skip("only root can mount a small disk")
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", folder], capture_output=True)
    if mounted.returncode:
        pytest.skip(f"a small disk cannot be mounted here: {mounted.stderr.decode().strip()}")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", folder], check=True)


def remount(folder: Path, options: str) -> None:
    subprocess.run(["mount", "-o", f"remount,{options}", folder], check=True)


def test_a_full_disk_ends_the_sweep_in_words_and_more_room_lets_it_go_on(tmp_path, whole):
    with small_disk(tmp_path / "disk", "220k") as disk:
        store = disk / "run.zarr"
        with pytest.raises(OSError, match="No space left on device.; finished tiles are kept; make room there"):
            driver.sweep(store)
        done = int((SweepStore(store).records()[:, 0] > 0).sum())
        assert 0 < done < driver.TILES
        remount(disk, "size=4m")
        assert resumed(store) == driver.TILES - done
        assert_whole(store, whole)


def test_a_store_for_which_there_is_no_room_at_all_leaves_nothing_behind(tmp_path, whole):
    with small_disk(tmp_path / "disk", "20k") as disk:
        with pytest.raises(OSError, match="could not be created .No space left on device.; nothing was changed"):
            driver.sweep(disk / "run.zarr")
        assert list(disk.iterdir()) == []


def test_where_nothing_can_be_written_a_sweep_is_refused_but_a_finished_one_is_returned(tmp_path, finished, whole):
    with small_disk(tmp_path / "disk", "4m") as disk:
        shutil.copytree(finished, disk / "finished.zarr")
        calls = []
        driver.sweep(disk / "begun.zarr", progress=lambda *news: calls.append(news) or len(calls) < 6)
        remount(disk, "ro")
        with pytest.raises(OSError, match="new.zarr' could not be created .Read-only file system"):
            driver.sweep(disk / "new.zarr")
        with pytest.raises(PermissionError, match="begun.zarr' cannot be written to .Read-only file system"):
            driver.sweep(disk / "begun.zarr")
        news = []
        again = driver.sweep(disk / "finished.zarr", progress=lambda *told: news.append(told[:2]))
        assert news == [(620, 620)]
        xr.testing.assert_equal(again.load(), whole)
        again.close()


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="permissions bind all but root")
def test_a_folder_that_may_not_be_written_is_refused(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(PermissionError, match="could not be created .Permission denied"):
        driver.sweep(tmp_path / "run.zarr")


def test_a_store_that_is_removed_while_it_is_written_ends_the_sweep_in_words(tmp_path):
    store, calls = tmp_path / "run.zarr", []

    def remove(done, total, partial):
        calls.append(done)
        if len(calls) == 4:
            store.rename(tmp_path / "away.zarr")

    with pytest.raises(OSError, match="run.zarr' has been removed; run the same again"):
        driver.sweep(store, progress=remove)


# Damaged


def flip(file: Path, place: int = -1) -> None:
    """Alter one bit of a file."""
    content = bytearray(file.read_bytes())
    content[place] ^= 1
    file.write_bytes(content)


HARMS = {
    "truncated": lambda file: file.write_bytes(file.read_bytes()[:-5]),
    "emptied": lambda file: file.write_bytes(b""),
    "deleted": lambda file: file.unlink(),
    "replaced by text": lambda file: file.write_text("moved to archive"),
    "altered by a bit": flip,
}
# The tiles to compute again where a chunk is damaged: one in the middle, one in the far corner, which is smaller and
# where nothing hits (its std is all NaN), or all of which the records lay there.
CHUNKS = {"std/c/2/1": 1, "std/c/5/3": 1, "n_periods/c/5/3": 1, "status/c/2/1": 1, "progress/tiles/c/0/0": driver.TILES}


@pytest.mark.long(but=2)
@pytest.mark.parametrize("harm", HARMS)
@pytest.mark.parametrize("file", CHUNKS)
def test_tiles_of_which_a_chunk_is_damaged_are_found_and_computed_again(store, whole, harm, file):
    HARMS[harm](store / file)
    found, of_a_tile = SweepStore(store), CHUNKS[file] == 1
    assert found.faults() == ["1 damaged tile; computed again when you continue"] * of_a_tile
    assert not found.is_whole()
    if of_a_tile and (harm, file) != ("deleted", "status/c/2/1"):  # then the tile reads as not computed
        assert str(store / file) in refused_by(lambda: vi.load(store))
    assert resumed(store) == CHUNKS[file]
    assert_whole(store, whole)


def test_a_lost_chunk_of_an_index_by_stop_is_found_and_computed_again(tmp_path):
    study = {"clearance": [4e-3, 5e-3], "frequency": [29.0, 30.0], "sample_impacts": 9, "indices": ["std"], "tile": 1}

    def sweep():
        return vi.parameter_map(vi.family(vi.models.impact_damper), by_stop=True, store=tmp_path / "run.zarr", **study)

    whole = sweep().load()
    (tmp_path / "run.zarr/std/c/1/0/0").unlink()
    assert "std/c/1/0/0' is missing" in refused_by(lambda: vi.load(tmp_path / "run.zarr"))
    assert SweepStore(tmp_path / "run.zarr").damaged() == [2]
    xr.testing.assert_equal(sweep().load(), whole)


@pytest.mark.parametrize("done", [1, 2 + 0xBC0D3E57])
def test_a_store_of_an_earlier_version_is_read_and_gone_on_with(store, whole, done):
    records = zarr.open_array(store / "progress/tiles", mode="r+")
    rows = records[:]
    rows[:, 0] = done  # the second with a digest
    rows[3] = 0
    records[:] = rows
    vi.load(store)
    assert resumed(store) == 1
    assert_whole(store, whole)


@pytest.mark.long
def test_whichever_bit_of_a_tile_is_altered_its_numbers_are_refused_or_the_same(store):
    found, number = SweepStore(store), 9
    before = found.read(number)
    refused = 0
    for name in ("std/c/2/1", "status/c/2/1"):
        content = (store / name).read_bytes()
        for place in range(0, len(content), 2):
            flip(store / name, place)
            if number in found.damaged():
                refused += 1
            else:
                assert all(np.array_equal(found.read(number)[key], before[key], equal_nan=True) for key in before)
            (store / name).write_bytes(content)
    assert refused > 50


def test_a_damaged_tile_that_is_not_computed_again_yet_reads_as_missing(store):
    flip(store / "std/c/2/1")
    partly = driver.sweep(store, progress=lambda *news: False).load()
    missing = partly["status"] == vi.Status.INTERRUPTED
    assert int(missing.sum()) == partly.attrs["cells_missing"] == 36
    assert np.isnan(partly["std"].values[missing]).all()


def test_a_plain_reader_is_refused_an_altered_tile_instead_of_given_wrong_numbers(store):
    flip(store / "std/c/2/1")
    with xr.open_zarr(store, consolidated=False, chunks=None) as dataset:
        float(dataset["std"][0, 0])
        with pytest.raises(RuntimeError, match="decompression"):
            dataset["std"].load()


def test_values_read_where_they_are_looked_at_are_refused_with_the_name_of_the_file(store, whole):
    lazily = SweepStore(store).dataset()
    flip(store / "std/c/2/1")
    assert lazily["status"][12, 6].values == whole["status"][12, 6].values
    with pytest.raises(OSError, match=r"run.zarr/std/c/2/1' was altered, .*; run a stored sweep again to repair"):
        lazily["std"].load()


@pytest.mark.long(but=2)
@pytest.mark.parametrize("harm", list(HARMS)[:4])
@pytest.mark.parametrize(
    "file", ["omega/c/0", "zarr.json", *(f"{name}/zarr.json" for name in ("gap", "std", "progress", "progress/tiles"))]
)
def test_a_damaged_axis_or_description_is_refused_by_name_until_it_is_restored(store, whole, file, harm):
    content = (store / file).read_bytes()
    HARMS[harm](store / file)
    before = sorted(store.rglob("*"))
    for job in (lambda: driver.sweep(store), lambda: SweepStore(store)):
        assert refused_by(job).endswith("restore that file, delete the store, or choose another name")
        assert str(store / file) in refused_by(job)
    assert sorted(store.rglob("*")) == before
    (store / file).write_bytes(content)
    assert resumed(store) == 0
    assert_whole(store, whole)


def test_a_store_whose_study_was_altered_is_refused(store):
    text = (store / "zarr.json").read_text()
    (store / "zarr.json").write_text(text.replace('\\"sample_impacts\\": 100', '\\"sample_impacts\\": 101'))
    with pytest.raises(OSError, match="is damaged"):
        driver.sweep(store, sample_impacts=101)


def test_what_killed_writers_left_is_swept_up(store, whole):
    (store / "std" / "c" / "2" / "0").unlink()
    (store / "std" / "c" / "2" / "0.0123.partial").write_bytes(b"half")
    (store / "progress" / "cluster").write_text("the mark of a killed run")
    (store.parent / ".run-0123.part" / "run.zarr").mkdir(parents=True)
    (store.parent / ".run-0123.part" / "run.zarr" / "zarr.json").write_text("{")
    assert resumed(store) == 1
    assert not (store / "progress" / "cluster").exists()
    assert_whole(store, whole)


# The clock, and names


@pytest.mark.long
@posix
def test_nothing_depends_on_the_clock_on_the_wall(tmp_path, whole):
    told_by("clock", tmp_path / "run.zarr")
    assert_whole(tmp_path / "run.zarr", whole)
