"""Refined maps on a Dask cluster: the bits of one machine, stored and in memory, stopped and taken up again."""

import numpy as np
import pytest
import zarr

import vibroimpact as vi
from contents import differing
from vibroimpact.execution.store import SweepStore

distributed = pytest.importorskip("distributed", reason="needs the extra [cluster]")

from vibroimpact.execution.cluster import connect  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore:`cluster` has no worker")

OSC = vi.ImpactOscillator()
PLANE = {"omega": np.linspace(1.5, 3.5, 9), "mass": np.linspace(0.5, 1.5, 7)}


def plane(**options):
    return vi.parameter_map(OSC, **{"refine": 2, "sample_impacts": 300, **PLANE, **options})


def assert_same(one, other):
    assert not differing(one, other)
    for name in ("impacts_computed", "steps_computed", "cells_computed", "complete"):
        assert one.attrs[name] == other.attrs[name], name


@pytest.fixture(scope="module")
def client():
    with connect("local:2") as client:
        yield client


@pytest.fixture(scope="module")
def whole():
    return plane()


@pytest.mark.long
def test_a_refined_map_on_a_cluster_has_the_bits_of_one_machine(client, whole, tmp_path):
    assert_same(plane(cluster=client), whole)
    assert_same(plane(cluster=client, tile=17, store=tmp_path / "r.zarr"), whole)


@pytest.mark.long
def test_a_sweep_stopped_on_a_cluster_goes_on_here_and_the_other_way_round(client, whole, tmp_path, monkeypatch):
    monkeypatch.setattr("vibroimpact.execution.base.LISTED", 32)
    for first, then in (({"cluster": client}, {}), ({}, {"cluster": client})):
        store = tmp_path / f"{len(first)}.zarr"
        partial = plane(store=store, progress=lambda done, total, partial: done < 150, **first)
        assert partial.attrs["complete"] == 0
        begun = []
        plane(store=store, progress=lambda done, total, partial, begun=begun: begun.append(done), **then)
        assert begun[0] >= 32
        root = zarr.open_group(store, mode="r")
        assert not differing(root, whole, whole.data_vars)
        assert SweepStore(store).damaged() == []


def test_a_finished_refined_store_needs_no_cluster(whole, tmp_path):
    plane(store=tmp_path / "r.zarr")
    again = plane(store=tmp_path / "r.zarr", cluster="tcp://127.0.0.1:1")
    assert not differing(again, whole, ["std"])


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
        plane(store=tmp_path / "r.zarr", **wrong)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.long
def test_the_command_line_refines_on_a_cluster(run, client, whole, tmp_path):
    command = "map --x omega=1.5:3.5:9 --y mass=0.5:1.5:7 --sample-impacts 300 --refine 2 --out r.zarr"
    code, lines, complaints = run(f"{command} --cluster {client.cluster.scheduler_address}")
    assert code == 0, complaints
    assert f"finished: {whole.attrs['cells_computed']} cells computed" in lines[0]
    assert not differing(vi.load(tmp_path / "r.zarr"), whole, ["std"])
    code, _, complaints = run(f"{command} --cluster local:2 --workers 2")
    assert (code, len(complaints)) == (2, 1)
