"""The GPU back end: in the simulator, as machine code, and what it says where there is no GPU."""

import os
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numba.core import config

import vibroimpact as vi
from vibroimpact.backends import cuda as host
from vibroimpact.backends import get_backend
from vibroimpact.indices import INDICES, VELOCITY_INDICES

SIMULATED = bool(config.ENABLE_CUDASIM)
HERE = Path(__file__).parent
# Settled and sticking motions close; others never hit again, are pinned for ever, or die out.
PLACES = {"omega": [0.1, 0.9, 2.0, 3.0], "gap": [-2.0, 0.0, 0.3, 10.0], "amplitude": [0.0, 1.0]}
SAMPLES = {
    "indices": tuple(VELOCITY_INDICES),
    "transient_impacts": 100,
    "sample_impacts": 300,
    "start": vi.State(-3.0, 0.1),
}


def works():
    try:
        get_backend("cuda")
    except ValueError:
        return False
    return True


on_device = pytest.mark.skipif(not works(), reason="no GPU here: the simulator runs this in a child process")
with_numba_cuda = pytest.mark.skipif(
    SIMULATED or not find_spec("numba_cuda"), reason="numba-cuda, of the extra [cuda], is not installed"
)


def assert_same_map(ours, theirs):
    assert ours["status"].values.tolist() == theirs["status"].values.tolist()
    for name in ours.data_vars:
        if SIMULATED:  # the host's own arithmetic: only the book-keeping can differ
            np.testing.assert_array_equal(ours[name].values, theirs[name].values)
        else:
            assert ours[name].values == pytest.approx(theirs[name].values, rel=1e-9, abs=1e-9, nan_ok=True)


@pytest.mark.long
@pytest.mark.skipif(SIMULATED, reason="is the child process")
def test_the_contract_holds_in_the_simulator():
    child = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", "cuda"]
        + [str(HERE / name) for name in ("test_backends.py", "test_cuda.py")],
        env=os.environ | {"NUMBA_ENABLE_CUDASIM": "1"},
        capture_output=True,
        text=True,
        cwd=HERE.parents[1],
    )
    assert child.returncode == 0, child.stdout + child.stderr
    passed = re.search(r"(\d+) passed", child.stdout)
    assert int(passed[1]) >= 20, child.stdout


@on_device
@pytest.mark.parametrize(
    ("indices", "early_closing"),
    [(tuple(VELOCITY_INDICES), True), (tuple(VELOCITY_INDICES), False), (tuple(INDICES), True)],
)
def test_a_map_is_the_one_that_the_cpu_draws(indices, early_closing):
    maps = [
        vi.parameter_map(
            vi.ImpactOscillator(damping=0.1),
            backend=name,
            early_closing=early_closing,
            **PLACES,
            **{**SAMPLES, "indices": indices},
        )
        for name in ("cuda", "cpu")
    ]
    assert_same_map(*maps)
    words = {vi.Status(int(code)).word for code in np.unique(maps[0]["status"])}
    assert {"stuck_forever", "no_impact", "decaying", "closed" if early_closing else "ok"} <= words


@on_device
def test_a_map_does_not_depend_on_the_memory_it_is_given(monkeypatch):
    axes = {"omega": np.linspace(0.8, 3.0, 24)}
    whole = vi.parameter_map(vi.ImpactOscillator(), backend="cuda", **axes, **SAMPLES)
    monkeypatch.setattr(host, "_room", lambda cells: (min(cells, 7), 2))
    pieces = vi.parameter_map(vi.ImpactOscillator(), backend="cuda", workers=1, **axes, **SAMPLES)
    assert pieces.identical(whole)


@on_device
def test_all_cells_fit_into_a_share_of_the_free_memory(monkeypatch):
    from numba import cuda

    free = 1e9
    monkeypatch.setattr(
        cuda, "current_context", lambda: SimpleNamespace(get_memory_info=lambda: SimpleNamespace(free=free))
    )
    cells, closers = host._room(10_000_000)
    assert 0.5 * host.SHARE * free < cells * host.CELL_BYTES + closers * host.CYCLE_BYTES <= host.SHARE * free
    assert host._room(5) == (5, 5)
    free = 1.0
    assert host._room(5) == (1, 1)


@on_device
@pytest.mark.skipif(SIMULATED, reason="the simulator runs one kernel at a time")
def test_tiles_that_begin_together_load_the_kernels_once():
    map_of_many = (
        "import numpy as np, vibroimpact as vi\n"
        "vi.parameter_map(vi.ImpactOscillator(), backend='cuda', transient_impacts=20, sample_impacts=20, "
        "omega=np.linspace(0.05, 5.0, 512), restitution=np.linspace(0.5, 0.95, 128))"
    )
    for _ in range(4):  # the first may compile, the others load
        child = subprocess.run([sys.executable, "-c", map_of_many], capture_output=True, text=True, cwd=HERE.parents[1])
        assert child.returncode == 0, child.stderr


def test_without_numba_cuda_it_is_told_what_to_install(monkeypatch):
    monkeypatch.setattr(host, "find_spec", lambda name: None)
    monkeypatch.setattr(host, "config", SimpleNamespace(ENABLE_CUDASIM=0))
    with pytest.raises(
        ValueError, match=r"'cuda' cannot be used here: numba-cuda is not installed.*pip install .*numba-cuda"
    ):
        get_backend("cuda")


def test_without_a_gpu_it_is_told_that_none_was_found(monkeypatch):
    from numba import cuda

    monkeypatch.setattr(host, "find_spec", lambda name: object())
    monkeypatch.setattr(cuda, "is_available", lambda: False)
    with pytest.raises(ValueError, match=r"'cuda' cannot be used here: no NVIDIA GPU was found"):
        get_backend("cuda")


@pytest.mark.skipif(works(), reason="there is a GPU here")
def test_on_the_command_line_a_missing_gpu_is_a_wrong_request(tmp_path, capsys):
    from vibroimpact.cli import main

    out = tmp_path / "map.nc"
    code = main(["map", "--x", "omega=1:2:2", "--backend", "cuda", "--out", str(out)])
    complaint = capsys.readouterr().err
    assert code == 2
    assert complaint.count("\n") == 1
    assert "'cuda' cannot be used here" in complaint
    assert not out.exists()


@pytest.fixture(scope="module")
def machine_code():
    """The PTX for sm_90 of every kernel; needs the compiler's library, but no driver."""
    from numba import cuda, types
    from numba.cuda import dispatcher

    from vibroimpact.kernels import device

    number, whole = types.float64, types.int64
    table, cube = number[:, ::1], number[:, :, ::1]
    lists, states = whole[::1], types.int8[::1]
    sums = table, table, table, states
    signatures = {
        "begin": (table, *sums, *[number] * 4),
        "step": (lists, *sums, whole, number, number),
        "close": (lists, *sums, cube, number, number, types.boolean),
        "hand_out": (*[table] * 5, number),
    }
    thorough = {"step": "step_thoroughly", "close": "close_thoroughly", "hand_out": "hand_out_thoroughly"}
    signatures |= {thorough[name]: signatures[name] for name in thorough}
    kernels = {name for name, thing in vars(device).items() if isinstance(thing, dispatcher.CUDADispatcher)}
    assert kernels == set(signatures)
    with pytest.MonkeyPatch.context() as patch:
        # Helpers that are not inlined ask the device at hand what it can do.
        patch.setattr(dispatcher, "get_current_device", lambda: SimpleNamespace(compute_capability=(9, 0)))
        return {
            name: cuda.compile(getattr(device, name).py_func, signature, cc=(9, 0), abi="numba", device=False)[0]
            for name, signature in signatures.items()
        }


@with_numba_cuda
def test_every_kernel_becomes_machine_code_for_sm_90(machine_code):
    for ptx in machine_code.values():
        assert ".target sm_90" in ptx
        assert ".entry" in ptx
    for name in ("step", "step_thoroughly"):
        assert machine_code[name].count("fma.rn.f64") > 100
        assert not re.search(r"\bcall\b", machine_code[name])


@with_numba_cuda
@pytest.mark.skipif(not shutil.which("ptxas"), reason="no ptxas on the path")
def test_a_step_keeps_all_its_numbers_in_registers(machine_code, tmp_path):
    source = tmp_path / "step.ptx"
    source.write_text(machine_code["step"])
    told = subprocess.run(
        ["ptxas", "-arch=sm_90", "-v", str(source), "-o", str(tmp_path / "step.cubin")], capture_output=True, text=True
    )
    assert told.returncode == 0, told.stderr
    assert "0 bytes spill stores, 0 bytes spill loads" in told.stderr
