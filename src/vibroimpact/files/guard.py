"""Reading files from unknown sources: only arrays that this package writes are read from stores, in the declared sizes.

A chunk of a few kilobytes may decode to gigabytes, or be a pipe or a link to a device; a description may contain
anything. A NetCDF file is read by HDF5, which unpacks whatever its chunks declare.
"""

from __future__ import annotations

import asyncio
import json
import math
import os
import re
import stat
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numcodecs import Zstd
from zarr.core.buffer import default_buffer_prototype
from zarr.storage import LocalStore

from vibroimpact.parameters import check_fits, in_words

if TYPE_CHECKING:
    from zarr.abc.store import ByteRequest
    from zarr.core.buffer import Buffer, BufferPrototype

DESCRIPTION = "zarr.json"
MOST_TEXT = 1 << 24  # bytes of a description, and of a chunk of words
WORD = 64  # bytes that a word takes in memory
RECORDS = "progress/tiles"  # the array that holds a record per tile of a stored sweep
CODECS = {"bytes", "vlen-utf8"}  # how `save` and stores encode numbers and words; zstd may follow


class Declared(NamedTuple):
    """The declared content of an array; words have no item size."""

    shape: tuple[int, ...]
    chunk: tuple[int, ...]
    item: int | None
    packed: bool

    @property
    def size(self) -> int:
        """Bytes of memory that reading the array takes: its values and one unpacked chunk."""
        return (self.item or WORD) * (math.prod(self.shape) + math.prod(self.chunk))


class GuardedStore(LocalStore):
    """A Zarr store in a folder: it reads only regular files inside it, and chunks that decode to what is declared.

    `OSError` names the file that is refused. Nothing is written or removed through a link out of the folder.
    """

    def __init__(self, root: Path | str, *, read_only: bool = True) -> None:
        super().__init__(root, read_only=read_only)
        self._real = os.path.realpath(root)
        self._declared: dict[str, Declared | None] = {}

    # Reading

    async def get(
        self, key: str, prototype: BufferPrototype | None = None, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        """Return the content of a file, or None if there is none."""
        return await asyncio.to_thread(self.get_sync, key, prototype=prototype, byte_range=byte_range)

    def get_sync(
        self, key: str, *, prototype: BufferPrototype | None = None, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        """Return the content of a file, or None if there is none."""
        content = self.content(key)
        if content is None:
            return None
        if byte_range is not None:
            raise self._refused(key, "would be read in part, which no array of this package needs")
        return (prototype or default_buffer_prototype()).buffer.from_bytes(content)

    async def get_partial_values(
        self, prototype: BufferPrototype, key_ranges: Iterable[tuple[str, ByteRequest | None]]
    ) -> list[Buffer | None]:
        """Return the contents of files."""
        return [await self.get(key, prototype, part) for key, part in key_ranges]

    def content(self, key: str) -> bytes | None:
        """Return the content of a file once it has been checked, or None if there is none."""
        if key.rpartition("/")[2] == DESCRIPTION:
            content = self._bytes(key, MOST_TEXT)
            if content is not None:
                self._describe(key, content)
            return content
        place = re.fullmatch(r"(.+?)/c(?:/\d+)*", key)
        array = None if place is None else self.declared(place[1])
        if array is None:
            return None
        size = math.prod(array.chunk) * array.item if array.item else MOST_TEXT
        content = self._bytes(key, size + size // 100 + 1024)
        if content is not None:
            self._check_chunk(key, content, array, size)
        return content

    def is_whole(self, key: str) -> bool:
        """Return whether a file is there and was not altered since it was written."""
        try:
            return self.content(key) is not None
        except (OSError, ValueError):
            return False

    def declared(self, name: str) -> Declared | None:
        """Return the declaration of an array; None if there is none, or for a group."""
        if name not in self._declared:
            self.content(f"{name}/{DESCRIPTION}")
        return self._declared.setdefault(name, None)

    def size(self) -> int:
        """Return the bytes that the arrays at the root take in memory."""
        arrays = [self.declared(name) for name in os.listdir(self.root)]
        return sum(array.size for array in arrays if array)

    def check_sweep(self, axes: Iterable[str], names: Iterable[str]) -> None:
        """Raise if a stored sweep has lost a chunk, which Zarr would read as missing values.

        The status of a tile is written last: where it exists, every array of these `names` has a chunk, which spans all
        dimensions that follow those of the grid.
        """
        if self.declared(RECORDS) is None:
            return
        dims = {name: len(array.shape) for name in names if (array := self.declared(name))}
        chunks = [f"{axis}/c/0" for axis in axes]
        for tile in (self.root / "status/c").glob("/".join("*" * dims["status"])):
            if tile.name.isdigit():  # else it is partly written
                place = tile.relative_to(self.root / "status").as_posix()
                chunks += [f"{name}/{place}{'/0' * (number - dims['status'])}" for name, number in dims.items()]
        for chunk in chunks:
            if not (self.root / chunk).exists():
                raise self._refused(chunk, "is missing")

    def _bytes(self, key: str, most: int) -> bytes | None:
        try:
            real = os.path.realpath(self.root / key, strict=True)
            state = os.stat(real)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except (OSError, ValueError) as error:
            raise self._refused(key, f"cannot be read ({getattr(error, 'strerror', error)})") from None
        if not real.startswith(self._real + os.sep):
            raise self._refused(key, "is a link out of the store; replace it by its target")
        if stat.S_ISDIR(state.st_mode):
            return None
        if not stat.S_ISREG(state.st_mode):
            raise self._refused(key, "is not a regular file")
        if state.st_size > most:
            raise self._refused(key, f"takes {in_words(state.st_size)}, more than its array declares")
        with open(real, "rb") as file:
            return file.read(state.st_size)

    def _describe(self, key: str, content: bytes) -> None:
        """Record what an array declares; raise if its description is damaged or not one that this package writes."""
        name = key.removesuffix(DESCRIPTION).removesuffix("/")
        try:
            described = json.loads(content)
            if described["zarr_format"] != 3 or not isinstance(described.get("attributes", {}), dict):
                raise ValueError
            array = _declared(described) if described["node_type"] != "group" else None
        except (ValueError, TypeError, LookupError, AttributeError, RecursionError):
            raise self._refused(key, "is damaged, or of a kind that this package does not write") from None
        if array is not None:
            check_fits(
                str(self.root / name), "declares chunks that take", array._replace(shape=()).size, "it is damaged"
            )
        self._declared[name] = array

    def _check_chunk(self, key: str, content: bytes, array: Declared, size: int) -> None:
        """Raise unless a chunk decodes to `size` bytes, or to the declared number of words in at most `size` bytes."""
        try:
            plain = _unpacked(content, size) if array.packed else content
        except (RuntimeError, ValueError):
            plain = b""
        words = int.from_bytes(plain[:4], "little")
        if len(plain) != size if array.item else words != math.prod(array.chunk):
            raise self._refused(key, "was altered, or is not a chunk of its array; run a stored sweep again to repair")

    def _refused(self, key: str, why: str) -> OSError:
        return OSError(f"{str(self.root / key)!r} {why}")

    # Writing

    async def set(self, key: str, value: Buffer) -> None:
        """Write a file, replacing a link or a pipe of its name."""
        self._check_folder(key)
        await super().set(key, value)

    def set_sync(self, key: str, value: Buffer) -> None:
        """Write a file, replacing a link or a pipe of its name."""
        self._check_folder(key)
        super().set_sync(key, value)

    async def delete(self, key: str) -> None:
        """Remove a file, or the link or pipe of its name."""
        self._check_folder(key)
        await super().delete(key)

    def delete_sync(self, key: str) -> None:
        """Remove a file, or the link or pipe of its name."""
        self._check_folder(key)
        super().delete_sync(key)

    def _check_folder(self, key: str) -> None:
        """Raise if a file lies behind a link out of the store."""
        folder = os.path.realpath((self.root / key).parent)
        if not f"{folder}{os.sep}".startswith(self._real + os.sep):
            raise self._refused(key, "lies behind a link out of the store; replace it by the folder")


def _declared(described: dict[str, Any]) -> Declared:
    """Return the declaration in an array's description; raise if this package writes no such description."""
    shape, chunk = tuple(described["shape"]), tuple(described["chunk_grid"]["configuration"]["chunk_shape"])
    names = described.get("dimension_names") or [None] * len(shape)
    codecs = [codec if isinstance(codec, str) else codec["name"] for codec in described["codecs"]]
    kind = described["data_type"]
    fits = (
        described["node_type"] == "array"
        and described["chunk_grid"]["name"] == "regular"
        and described["chunk_key_encoding"]["name"] == "default"
        and described["chunk_key_encoding"].get("configuration", {}).get("separator", "/") == "/"
        and not described.get("storage_transformers")
        and all(type(side) is int and 0 <= side < 1 << 62 for side in (*shape, *chunk))
        and len(shape) == len(chunk) == len(names)
        and codecs[0] in CODECS
        and codecs[1:] in ([], ["zstd"])
    )
    if not fits:
        raise ValueError
    item = None
    if isinstance(kind, dict):
        item = int(kind["configuration"]["length_bytes"]) if kind["name"] == "fixed_length_utf32" else 0
    elif kind != "string":
        item = np.dtype(kind).itemsize if np.dtype(kind).kind in "biufc" else 0
    if item == 0 or (item is None) != (codecs[0] == "vlen-utf8"):
        raise ValueError
    return Declared(shape, chunk, item, len(codecs) > 1)


def _unpacked(content: bytes, most: int) -> bytes:
    """Return the decoded chunk; raise if it was altered or takes more than `most` bytes."""
    Zstd().decode(content, np.empty(most, np.uint8))  # never writes beyond the end, whatever the chunk declares
    return bytes(Zstd().decode(content))


def netcdf_size(path: Path) -> int:
    """Return the bytes that the variables of a NetCDF file take in memory.

    `OSError`: it is not a regular file, not HDF5, or a variable is stored elsewhere. Chunks are not inspected.
    """
    import h5py

    if not path.is_file():
        raise OSError(f"{str(path)!r} is not a regular file")
    size = 0
    with h5py.File(path, "r") as file:
        for name in file:
            if not isinstance(file.get(name, getlink=True), h5py.HardLink):
                raise OSError(f"variable {name!r} is a link")
            variable = file[name]
            if not isinstance(variable, h5py.Dataset):
                continue
            properties = variable.id.get_create_plist()
            if properties.get_layout() == h5py.h5d.VIRTUAL or properties.get_external_count():
                raise OSError(f"variable {name!r} lies in another file")
            item = WORD if variable.dtype.kind == "O" else variable.dtype.itemsize
            size += item * (math.prod(variable.shape or ()) + math.prod(variable.chunks or (0,)))
    return size
