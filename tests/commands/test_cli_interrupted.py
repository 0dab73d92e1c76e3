"""Ctrl-C on the command line, once and twice, while cells take longer than anybody waits and disks are slow."""

from __future__ import annotations

import os
import signal
import subprocess
from pathlib import Path

import numpy as np
import pytest

import vibroimpact as vi
from processes import DRIVER
from vibroimpact.execution.store import SweepStore

posix = pytest.mark.skipif(os.name == "nt", reason="a child cannot be sent Ctrl-C alone")

NEVER = "--backend reference --sample-impacts 1000000000 --workers 2"  # a cell takes days
QUICK = "map --x omega=0.3:4:31 --y gap=-2:1.5:20 --sample-impacts 50 --tile 36 --workers 2 --out run.zarr"


STARTED: list[subprocess.Popen] = []


@pytest.fixture(autouse=True)
def ended():
    """End what a failed test would leave computing for ever."""
    yield
    while STARTED:
        with STARTED.pop() as process:
            process.kill()


def started(folder: Path, patience: float, command: str) -> subprocess.Popen:
    """Start the command line; return once it computes."""
    words = [*DRIVER, "typed", str(folder), str(patience), *command.split()]
    STARTED.append(subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True))
    return STARTED[-1]


def with_one_slow_cell(folder: Path, patience: float) -> subprocess.Popen:
    """Start a map of which all cells but one end, those that the mass never reaches; return once they have."""
    process = started(folder, patience, f"map --x gap=0:300:4 -p omega=2 {NEVER} --out map.nc")
    assert process.stderr.readline().startswith("ImpactOscillator: mass 1 kg")
    assert "map: " in process.stderr.readline()
    return process


def interrupt(process: subprocess.Popen) -> str:
    """Send Ctrl-C; return what the command line says to that."""
    process.send_signal(signal.SIGINT)
    lines = iter(process.stderr.readline, "")
    return next(line for line in lines if "stopping" in line or "at once" in line)


def await_file(process: subprocess.Popen, folder: Path, name: str) -> None:
    while not list(folder.glob(name)):
        assert process.poll() is None, process.communicate()


@pytest.mark.long
@posix
def test_the_first_ctrl_c_gives_up_cells_that_take_too_long_and_the_store_can_be_gone_on_with(tmp_path):
    process = started(tmp_path, 1.0, f"map --x omega=2:3:5 --y mass=1:2:5 {NEVER} --out run.zarr")
    await_file(process, tmp_path, "run.zarr/progress/tiles/lock")
    said = interrupt(process)
    assert "running cells are abandoned after 1 s; what is finished is kept (Ctrl-C again to stop at once)" in said
    out, complaints = process.communicate(timeout=600)
    assert (process.returncode, out) == (130, "")
    assert "run the same command again to continue" in complaints
    assert "Traceback" not in complaints
    store = SweepStore(tmp_path / "run.zarr")
    assert not store.records()[:, 0].any()
    assert store.tiling.tile == (2, 2)  # so that little is lost
    with store.writing():
        pass


@pytest.mark.long
@posix
def test_the_first_ctrl_c_keeps_the_cells_that_have_ended_beside_one_that_takes_too_long(tmp_path):
    process = with_one_slow_cell(tmp_path, 1.0)
    interrupt(process)
    _, complaints = process.communicate(timeout=600)
    assert process.returncode == 130
    assert "what was finished is kept" in complaints
    status = vi.load(tmp_path / "map.nc")["status"].values
    assert status[0] == vi.Status.INTERRUPTED
    assert vi.Status.NO_IMPACT in status[1:]


@pytest.mark.long
@posix
def test_the_second_ctrl_c_ends_at_once_and_leaves_no_tile_half_written(tmp_path):
    process = started(tmp_path, 1000.0, QUICK)
    await_file(process, tmp_path, "run.zarr/std/c/*/*")  # a tile takes 0.3 s to write, of which this is the first part
    assert "stopping, running cells are abandoned after 1000 s" in interrupt(process)
    assert "stopped at once, finished tiles are kept" in interrupt(process)
    process.communicate(timeout=600)
    assert process.returncode == 130
    store, done = SweepStore(tmp_path / "run.zarr"), 0
    assert not list(store.path.rglob("*.partial"))
    for number, record in enumerate(store.records()):
        place = Path("c", *map(str, np.unravel_index(number, store.tiling.counts)))
        files = [(store.path / name / place).exists() for name in ("std", "status")]
        assert files == [bool(record[0])] * 2
        done += files[0]
    assert 0 < done < len(store.tiling)
    assert store.damaged() == []


@pytest.mark.long
@posix
def test_the_second_ctrl_c_ends_cells_that_take_too_long(tmp_path):
    process = with_one_slow_cell(tmp_path, 1000.0)
    interrupt(process)
    assert "stopped at once, nothing was kept" in interrupt(process)
    process.communicate(timeout=600)
    assert process.returncode == 130
    assert list(tmp_path.iterdir()) == []
