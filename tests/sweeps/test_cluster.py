"""Sweeps on a Dask cluster: one machine's bits, whoever computes them, dies, joins, dawdles or cannot see the store."""

import functools
import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time

import dask
import numpy as np
import pytest
import zarr

import vibroimpact as vi
from contents import differing
from processes import until
from studies import STUDIES
from vibroimpact.backends import ImpactWindow, Measurement
from vibroimpact.execution import cluster, layout
from vibroimpact.execution.cluster import connect
from vibroimpact.execution.store import SweepStore
from vibroimpact.request import Request

distributed = pytest.importorskip("distributed", reason="needs the extra [cluster]")

# On a busy machine, killed workers take their time to be there again.
pytestmark = pytest.mark.filterwarnings("ignore:`cluster` has no worker", "ignore:unclosed:ResourceWarning")


AXES = {"omega": np.linspace(0.1, 5.0, 24), "mass": np.linspace(0.2, 3.0, 10)}
NAMES = ("std", "lyapunov", "n_periods")


def sweep(tile=16, **settings):
    arguments = {"indices": NAMES, "transient_impacts": 20, "sample_impacts": 60, **AXES, **settings}
    if {"cluster", "store"} & settings.keys():
        arguments["tile"] = tile
    return vi.parameter_map(vi.ImpactOscillator(), **arguments)


def long_sweep(**settings):
    """Return a sweep of some seconds."""
    return sweep(sample_impacts=3000, early_closing=False, tile=4, **settings)


def assert_same(one, other):
    assert not differing(one, other, (*NAMES, "status"))
    assert one.attrs["impacts_computed"] == other.attrs["impacts_computed"]


@pytest.fixture(scope="module")
def shared():
    """Return a client of two workers."""
    with connect("local:2") as client:
        yield client


@pytest.fixture
def client(shared):
    """Return the client, once those workers are there again that an earlier test has killed."""
    try:
        shared.wait_for_workers(2, timeout=10)
    except TimeoutError:  # one was killed before it was quite started, and is not started anew by itself
        shared.cluster.scale(0)
        shared.cluster.scale(2)
        shared.wait_for_workers(2, timeout=300)
    return shared


@pytest.fixture(scope="module")
def whole():
    return sweep()


@pytest.fixture(scope="module")
def long_whole():
    return long_sweep()


def test_a_cluster_gives_the_bits_of_one_machine(client, whole):
    assert_same(sweep(cluster=client), whole)


@pytest.mark.parametrize("study", STUDIES)
def test_workers_compute_what_one_machine_computes(client, tmp_path, study):
    model, how = STUDIES[study]
    place = {"store": tmp_path / "run.zarr"} if study == "a family" else {}
    cells, there = vi.parameter_map(model(), **how), vi.parameter_map(model(), cluster=client, tile=2, **place, **how)
    assert not differing(there, cells, cells.data_vars)


@pytest.mark.parametrize("seen", [True, False])
def test_tiles_are_written_by_the_workers_that_see_the_store_or_else_by_the_client(
    client, whole, tmp_path, monkeypatch, seen
):
    monkeypatch.chdir(tmp_path)  # workers are in another folder
    if seen:
        monkeypatch.setattr(layout, "write_tile", lambda *what: pytest.fail("the client wrote a tile"))
    client.run(_look_for, layout.MARK if seen else "another mark")
    try:
        stored = sweep(cluster=client, store="run.zarr")
    finally:
        client.run(_look_for, layout.MARK)
    assert_same(stored, whole)
    assert SweepStore(tmp_path / "run.zarr").is_whole()


def _look_for(mark):
    layout.MARK = mark


def test_an_older_copy_of_the_same_study_at_the_same_path_is_not_taken_for_the_store(tmp_path):
    sweep(store=tmp_path / "run.zarr", progress=lambda done, total, partial: False)
    store = SweepStore(tmp_path / "run.zarr")
    before = store.records()
    with cluster._marked(store.path) as mark:
        assert cluster.sees(str(store.path), mark)
        assert not cluster.sees(str(store.path), "the mark of a run elsewhere")
    assert not cluster.sees(str(store.path), mark)  # a worker that comes late writes nothing either
    assert np.array_equal(store.records(), before)


@pytest.mark.long
@pytest.mark.parametrize("stored", [True, False])
def test_workers_killed_in_mid_sweep_leave_no_trace_in_the_result(client, long_whole, tmp_path, stored):
    rng = random.Random(5)
    reported, killed, ended, kills = threading.Event(), threading.Event(), threading.Event(), []

    def kill_now_and_then():
        reported.wait(300)
        while not ended.is_set() and len(kills) < (3 if stored else 2):
            pid = rng.choice([worker["pid"] for worker in _workers(client)] or [None])
            if pid:
                os.kill(pid, signal.SIGKILL)
                kills.append(pid)
                killed.set()
                until(lambda pid=pid: ended.is_set() or pid not in {w["pid"] for w in _workers(client)})
            ended.wait(rng.uniform(0.02, 0.4))

    def report(*told):
        reported.set()
        killed.wait(300)  # however fast the machine, the sweep is not over before

    killer = threading.Thread(target=kill_now_and_then)
    killer.start()
    try:
        store = {"store": tmp_path / "run.zarr"} if stored else {}
        result = long_sweep(cluster=client, progress=report, **store)
    finally:
        ended.set()
        killer.join()
    assert kills
    assert_same(result, long_whole)
    if stored:
        assert result.attrs["cells_missing"] == 0
        assert SweepStore(tmp_path / "run.zarr").damaged() == []


def _workers(client):
    """Return pid and address of the workers that the scheduler knows."""
    found = client.run_on_scheduler(_addresses)
    with dask.config.set({"distributed.comm.timeouts.connect": "1s"}):  # for 30 s, of a worker that was just killed
        pids = client.run(os.getpid, workers=found, on_error="ignore") if found else {}
    return [{"address": address, "pid": pid} for address, pid in pids.items()]


def _addresses(dask_scheduler):
    return list(dask_scheduler.workers)


@pytest.mark.long
def test_a_tile_whose_worker_dies_every_time_is_told_of_in_the_end(client, monkeypatch):
    monkeypatch.setattr(cluster, "_work", _die)
    with pytest.raises(RuntimeError, match=r"^`cluster` has lost too many workers over one tile .* more memory"):
        sweep(cluster=client)


def _die(part, shared):
    time.sleep(1.0)  # a worker that ends in its first moments is not started anew
    os.kill(os.getpid(), signal.SIGKILL)


def test_what_a_task_raises_is_raised_here(client, monkeypatch):
    monkeypatch.setattr(cluster, "_work", _fail)
    with pytest.raises(ZeroDivisionError):
        list(pieces(client, 3))


def _fail(part, shared):
    return 1 // (part.start - 1)


@pytest.mark.long
def test_a_task_that_fails_now_and_then_is_tried_again(client, whole, tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "_work", functools.partial(_fail_once, cluster._work, tmp_path))
    assert_same(sweep(cluster=client), whole)
    assert len(list(tmp_path.iterdir())) == 15


def _fail_once(work, folder, part, shared):
    try:
        (folder / str(part.start)).touch(exist_ok=False)
    except FileExistsError:
        return work(part, shared)
    raise OSError("for a moment")


@pytest.mark.long
def test_a_slow_worker_keeps_the_others_from_nothing(client, monkeypatch):
    monkeypatch.setattr(cluster, "_work", _nap_at_first)
    order = [number for number, _, _ in pieces(client, 31)]
    assert order.index(0) >= 25  # a task or two wait behind it
    assert sorted(order) == list(range(31))


def pieces(client, number, stop=None):
    """Compute so many parts of one cell."""
    measurement = Measurement(ImpactWindow(100, 5000))
    request = Request(vi.ImpactOscillator(), {"omega": np.linspace(1.0, 2.0, number)}, measurement)
    return cluster.Cluster(client).compute(request, [slice(n, n + 1) for n in range(number)], stop or threading.Event())


@pytest.mark.skipif(os.name == "nt", reason="links and pipes of POSIX")
def test_a_worker_writes_a_tile_in_the_place_of_a_link_and_never_through_one(tmp_path):
    sweep(store=tmp_path / "run.zarr")
    store = SweepStore(tmp_path / "run.zarr")
    precious = tmp_path / "precious"
    precious.write_text("?")
    request = Request(vi.ImpactOscillator(), AXES, Measurement(ImpactWindow(20, 60), indices=NAMES))
    chunk, mark = store.path / "std/c/1/1", store.path / "progress" / layout.MARK
    before = chunk.read_bytes()
    for planted in (chunk, mark):
        planted.unlink(missing_ok=True)
        planted.symlink_to(precious)
    with cluster._marked(store.path) as word:
        shared = cluster._Shared(request, vi.__version__, str(store.path), word)
        record = cluster._work(store.tiling[1 + store.tiling.counts[1]], shared)
    assert record.shape == (layout.COLUMNS,)  # it wrote
    assert not chunk.is_symlink()
    assert chunk.read_bytes() == before
    shutil.move(store.path / "std/c", tmp_path / "elsewhere")
    (store.path / "std/c").symlink_to(tmp_path / "elsewhere")
    os.truncate(tmp_path / "elsewhere/1/1", 0)
    with cluster._marked(store.path) as word:
        shared = cluster._Shared(request, vi.__version__, str(store.path), word)
        assert "std" in cluster._work(store.tiling[1 + store.tiling.counts[1]], shared)  # the client is to see to it
    assert (tmp_path / "elsewhere/1/1").read_bytes() == b""
    os.mkfifo(mark)
    assert not cluster.sees(str(store.path), word)
    assert precious.read_text() == "?"


def _nap_at_first(part, shared):
    time.sleep(0.01 if part.start else 2.0)
    return os.getpid()


def _nap(part, shared):
    time.sleep(0.05)
    return os.getpid()


@pytest.mark.long
def test_a_worker_that_joins_later_gets_its_share(client, monkeypatch):
    monkeypatch.setattr(cluster, "_work", _nap)
    stop, workers = threading.Event(), set()
    for done, (_, _, pid) in enumerate(pieces(client, 2000, stop)):
        if done == 0:
            client.cluster.scale(3)
        workers.add(pid)
        if len(workers) == 3:
            stop.set()
    client.cluster.scale(2)
    assert len(workers) == 3


def test_nothing_that_was_sent_stays_with_the_workers(client):
    before = set(client.run_on_scheduler(_tasks))
    for ended in (False, None):
        sweep(cluster=client, progress=lambda done, total, partial, ended=ended: ended)
        until(lambda: not set(client.run_on_scheduler(_tasks)) - before)


def _tasks(dask_scheduler):
    return list(dask_scheduler.tasks)


@pytest.mark.long
@pytest.mark.parametrize("stored", [True, False])
def test_a_sweep_that_is_stopped_keeps_what_is_done_and_goes_on_later(client, whole, tmp_path, monkeypatch, stored):
    monkeypatch.setattr(cluster, "_work", functools.partial(_slowly, cluster._work))
    store = {"store": tmp_path / "run.zarr"} if stored else {}
    part = sweep(cluster=client, progress=lambda done, total, partial: done < 40, **store)
    missing = part["status"].values == vi.Status.INTERRUPTED
    assert 0 < missing.sum() < missing.size
    assert np.array_equal(part["std"].values[~missing], whole["std"].values[~missing], equal_nan=True)
    if stored:
        assert part.attrs["cells_missing"] >= missing.sum()  # a worker may have written what was given up by then
        assert_same(sweep(cluster=client, **store), whole)


def _slowly(work, part, shared):
    time.sleep(0.2)
    return work(part, shared)


def test_a_finished_store_needs_no_cluster(whole, refined_whole, tmp_path):
    sweep(store=tmp_path / "run.zarr")
    assert_same(sweep(store=tmp_path / "run.zarr", cluster="tcp://127.0.0.1:1"), whole)
    refined(store=tmp_path / "refined.zarr")
    again = refined(store=tmp_path / "refined.zarr", cluster="tcp://127.0.0.1:1")
    assert not differing(again, refined_whole, ["std"])


def test_a_client_that_was_given_stays_open_and_one_made_here_is_closed(client):
    with connect(client) as same:
        assert same is client
    assert client.status == "running"
    with connect("local:1") as made:
        assert sum(made.nthreads().values()) == 1
    assert made.status == made.cluster.status.name == "closed"


def test_a_running_scheduler_is_reached_by_its_address(client, whole):
    with connect(client.cluster.scheduler_address) as reached:
        assert_same(sweep(cluster=reached), whole)
    assert reached.status == "closed"
    assert client.status == "running"


@pytest.mark.parametrize("wrong", ["local", "local:0", "local:two", "10.0.0.1:8786", "tcp://host", "", 8786, None])
def test_what_is_no_cluster_is_refused(wrong):
    with pytest.raises(ValueError, match=r"^`cluster` must be a .*, got"), connect(wrong):
        pass


def test_a_closed_client_is_refused(client):
    with connect(client.cluster.scheduler_address) as closed:
        pass
    with pytest.raises(ValueError, match="`cluster` must be an open Client, got one that is closed"):
        sweep(cluster=closed)


@pytest.mark.parametrize("listening", [True, False])
def test_an_address_where_no_scheduler_answers_is_told_of_within_seconds(listening, monkeypatch):
    monkeypatch.setattr(cluster, "PATIENCE", 1)
    with socket.socket() as deaf:
        deaf.bind(("127.0.0.1", 0))
        if listening:
            deaf.listen()
        with pytest.raises(ConnectionError, match=r"^`cluster` .* no scheduler answered .*`dask scheduler`"):
            sweep(cluster=f"tcp://127.0.0.1:{deaf.getsockname()[1]}")


def test_without_dask_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    with pytest.raises(ImportError, match="pip install dask distributed"):
        sweep(cluster="local:2")


def test_a_worker_with_another_version_is_refused(client, monkeypatch):
    monkeypatch.setattr("vibroimpact.execution.cluster.package_version", lambda: "0.0.1")
    with pytest.raises(RuntimeError, match=r"this process has 0\.0\.1; .* equal versions"):
        sweep(cluster=client)


@pytest.mark.long
@pytest.mark.parametrize("what", ["scheduler", "client"])
def test_a_cluster_that_goes_away_is_told_of(what, monkeypatch):
    monkeypatch.setattr(cluster, "PATIENCE", 2)
    with connect("local:1") as made:
        monkeypatch.setattr(cluster, "_work", _nap)
        results = pieces(made, 100)
        next(results)
        (made.cluster if what == "scheduler" else made).close()
        with pytest.raises(ConnectionError, match="lost its scheduler"):
            list(results)


@pytest.mark.long
def test_a_scheduler_that_is_killed_is_told_of(monkeypatch):
    monkeypatch.setattr(cluster, "PATIENCE", 2)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    how = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(port)]
    with subprocess.Popen([*how, "--no-dashboard"], stderr=subprocess.DEVNULL) as scheduler:
        try:
            until(lambda: _listens(port))
            with connect(f"tcp://127.0.0.1:{port}") as client:
                threading.Timer(0.5, scheduler.kill).start()
                with pytest.raises(ConnectionError, match="lost its scheduler"):
                    list(pieces(client, 10))
        finally:
            scheduler.kill()


def _listens(port):
    with socket.socket() as line:
        return line.connect_ex(("127.0.0.1", port)) == 0


# Refined maps


PLANE = {"omega": np.linspace(1.5, 3.5, 9), "mass": np.linspace(0.5, 1.5, 7)}


def refined(**options):
    return vi.parameter_map(vi.ImpactOscillator(), **{"refine": 2, "sample_impacts": 300, **PLANE, **options})


@pytest.fixture(scope="module")
def refined_whole():
    return refined()


@pytest.mark.long
def test_a_refined_map_on_a_cluster_has_the_bits_of_one_machine(client, refined_whole, tmp_path):
    for place in ({}, {"tile": 17, "store": tmp_path / "r.zarr"}):
        found = refined(cluster=client, **place)
        assert not differing(found, refined_whole)
        for name in ("impacts_computed", "steps_computed", "cells_computed", "complete"):
            assert found.attrs[name] == refined_whole.attrs[name], name


@pytest.mark.long
def test_a_sweep_stopped_on_a_cluster_goes_on_here_and_the_other_way_round(
    client, refined_whole, tmp_path, monkeypatch
):
    monkeypatch.setattr("vibroimpact.execution.base.LISTED", 32)
    for first, then in (({"cluster": client}, {}), ({}, {"cluster": client})):
        store = tmp_path / f"{len(first)}.zarr"
        partial = refined(store=store, progress=lambda done, total, partial: done < 150, **first)
        assert partial.attrs["complete"] == 0
        begun = []
        refined(store=store, progress=lambda done, total, partial, begun=begun: begun.append(done), **then)
        assert begun[0] >= 32
        root = zarr.open_group(store, mode="r")
        assert not differing(root, refined_whole, refined_whole.data_vars)
        assert SweepStore(store).damaged() == []


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"cluster": "local"}, "`cluster` must be .*, got 'local'"),
        ({"cluster": "local:2", "workers": 2}, "either `workers` or `cluster`.*cluster='local:2'"),
        ({"tile": 100}, "with `refine`, `tile` needs a `cluster`"),
        ({"cluster": "local:2", "tile": 0}, "`tile` must be a whole number >= 1, got 0"),
    ],
)
def test_a_wrong_place_is_refused_before_anything_is_started(wrong, words, tmp_path):
    with pytest.raises(ValueError, match=words):
        refined(store=tmp_path / "r.zarr", **wrong)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.long
def test_the_command_line_refines_on_a_cluster(run, client, refined_whole, tmp_path):
    command = "map --x omega=1.5:3.5:9 --y mass=0.5:1.5:7 --sample-impacts 300 --refine 2 --out r.zarr"
    code, lines, complaints = run(f"{command} --cluster {client.cluster.scheduler_address}")
    assert code == 0, complaints
    assert f"finished: {refined_whole.attrs['cells_computed']} cells computed" in lines[0]
    assert not differing(vi.load(tmp_path / "r.zarr"), refined_whole, ["std"])
    code, _, complaints = run(f"{command} --cluster local:2 --workers 2")
    assert (code, len(complaints)) == (2, 1)
