"""Files from elsewhere: of a store or a file nothing is read but what this package writes, of the sizes declared there.

A chunk of a few kilobytes may decode to gigabytes, a chunk may be a pipe or a link to a device, a description anything.
"""

from __future__ import annotations

import asyncio
import json
import math
import mmap
import os
import re
import shutil
import stat
import struct
import zlib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numcodecs import Zstd
from numpy.typing import NDArray
from zarr.core.buffer import default_buffer_prototype
from zarr.storage import LocalStore

from vibroimpact.parameters import check_fits, in_words

if TYPE_CHECKING:
    import h5py
    from zarr.abc.store import ByteRequest
    from zarr.core.buffer import Buffer, BufferPrototype

DESCRIPTION = "zarr.json"
MOST_TEXT = 1 << 24  # bytes of a description, and of a chunk of words
WORD = 64  # bytes that a word takes in memory
CODECS = {"bytes", "vlen-utf8"}  # how `save` and stores turn numbers and words into bytes, which zstd may pack
RECORDS = "progress/tiles"  # the array that holds a record per tile of a stored sweep, of which the first number says
DIGEST = 2  # that the tile is done and, from here on, the digest of its numbers; earlier versions wrote 1
MAGIC = b"\x28\xb5\x2f\xfd"  # of a frame of zstd
HEAP = b"GCOL\1\0\0\0"  # begins what holds the words of an HDF5 file


class Declared(NamedTuple):
    """What an array says that it holds; a word has no item size."""

    shape: tuple[int, ...]
    chunk: tuple[int, ...]
    item: int | None
    packed: bool

    @property
    def size(self) -> int:
        """Bytes that the array takes in memory, and what reading it takes beside that: a chunk, unpacked."""
        item = self.item or WORD
        return item * (math.prod(self.shape) + math.prod(self.chunk))


class GuardedStore(LocalStore):
    """A Zarr store in a folder: each file read is a regular one inside it, and a chunk decodes to what is declared.

    `OSError` names the file that is refused. Written files take the place of whatever has their name.
    """

    def __init__(self, root: Path | str, *, read_only: bool = True) -> None:
        super().__init__(root, read_only=read_only)
        self._real = os.path.realpath(root)
        self._declared: dict[str, Declared | None] = {}

    # Reading

    async def get(
        self, key: str, prototype: BufferPrototype | None = None, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        """Return the content of a file, or None where there is none."""
        return await asyncio.to_thread(self.get_sync, key, prototype=prototype, byte_range=byte_range)

    def get_sync(
        self, key: str, *, prototype: BufferPrototype | None = None, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        """Return the content of a file, or None where there is none."""
        content = self.content(key)
        if content is None:
            return None
        if byte_range is not None:
            raise self._refused(key, "would be read in part, as no array of this package is")
        return (prototype or default_buffer_prototype()).buffer.from_bytes(content)

    async def get_partial_values(
        self, prototype: BufferPrototype, key_ranges: Iterable[tuple[str, ByteRequest | None]]
    ) -> list[Buffer | None]:
        """Return the contents of files."""
        return [await self.get(key, prototype, part) for key, part in key_ranges]

    def content(self, key: str) -> bytes | None:
        """Return the content of a file once it has been checked, or None where there is none."""
        if key.rpartition("/")[2] == DESCRIPTION:
            found = self._bytes(key, MOST_TEXT)
            if found is not None:
                self._describe(key, found)
            return found
        place = re.fullmatch(r"(.+?)/c(?:/\d+)*", key)
        array = None if place is None else self.declared(place[1])
        if array is None:
            return None
        size = math.prod(array.chunk) * array.item if array.item else MOST_TEXT
        found = self._bytes(key, size + size // 100 + 1024)
        if found is not None:
            self._check_chunk(key, found, array, size)
        return found

    def declared(self, name: str) -> Declared | None:
        """Return the declaration of an array; None where there is none, or a group."""
        if name not in self._declared:
            self.content(f"{name}/{DESCRIPTION}")
        return self._declared.setdefault(name, None)

    def size(self) -> int:
        """Return the bytes that the arrays at the root take in memory."""
        arrays = [self.declared(name) for name in os.listdir(self.root)]
        return sum(array.size for array in arrays if array)

    def done(self) -> NDArray[np.int64] | None:
        """Return of every tile of a stored sweep whether it is done, and its digest; None of what has no records."""
        import zarr

        with suppress(Exception):
            records: Any = zarr.open_array(self, path=RECORDS, mode="r") if self.declared(RECORDS) else None
            return None if records is None else np.asarray(records[:, 0], np.int64)
        return None

    def _bytes(self, key: str, most: int) -> bytes | None:
        try:
            real = os.path.realpath(self.root / key, strict=True)
            state = os.stat(real)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except (OSError, ValueError) as error:
            raise self._refused(key, f"cannot be read ({getattr(error, 'strerror', error)})") from None
        if not real.startswith(self._real + os.sep):
            raise self._refused(key, "is a link out of the store; put what it means in its place")
        if stat.S_ISDIR(state.st_mode):
            return None
        if not stat.S_ISREG(state.st_mode):
            raise self._refused(key, "is no regular file")
        if state.st_size > most:
            raise self._refused(key, f"takes {in_words(state.st_size)}, more than its array declares")
        with open(real, "rb") as file:
            return file.read(most)

    def _describe(self, key: str, content: bytes) -> None:
        """Note what an array declares; raise where a description is damaged, or none that this package writes."""
        name = key.removesuffix(DESCRIPTION).removesuffix("/")
        try:
            described = json.loads(content)
            if described["zarr_format"] != 3 or not isinstance(described.get("attributes", {}), dict):
                raise ValueError
            array = _declared(described) if described["node_type"] != "group" else None
        except (ValueError, TypeError, KeyError, LookupError, AttributeError, RecursionError):
            raise self._refused(key, "is damaged, or of a kind that this package does not write") from None
        if array is not None:
            check_fits(
                str(self.root / name), "declares chunks that take", array._replace(shape=()).size, "it is damaged"
            )
        self._declared[name] = array

    def _check_chunk(self, key: str, content: bytes, array: Declared, size: int) -> None:
        found = unpacked_size(content) if array.packed else len(content)
        if found is None or (found > size if array.item is None else found != size):
            raise self._refused(key, f"does not decode to the {in_words(size)} of its array")
        try:
            plain = bytes(Zstd().decode(content)) if array.packed else content
        except RuntimeError:
            raise self._refused(key, "was altered; running the same sweep again computes it anew") from None
        if array.item is None and int.from_bytes(plain[:4], "little") != math.prod(array.chunk):  # words' number
            raise self._refused(key, "does not hold as many words as its array declares")

    def _refused(self, key: str, why: str) -> OSError:
        return OSError(f"{str(self.root / key)!r} {why}")

    # Writing

    async def set(self, key: str, value: Buffer) -> None:
        """Write a file; a folder, a pipe or a link that has its name goes."""
        await asyncio.to_thread(self._make_way, key)
        await super().set(key, value)

    def set_sync(self, key: str, value: Buffer) -> None:
        """Write a file; a folder, a pipe or a link that has its name goes."""
        self._make_way(key)
        super().set_sync(key, value)

    async def delete(self, key: str) -> None:
        """Remove a file, or what has its name."""
        await asyncio.to_thread(self.delete_sync, key)

    def delete_sync(self, key: str) -> None:
        """Remove a file, or what has its name."""
        self._check_writable()
        self._make_way(key)
        (self.root / key).unlink(missing_ok=True)

    def _make_way(self, key: str) -> None:
        place = self.root
        for part in key.split("/")[:-1]:
            place = place / part
            if place.is_symlink():
                raise self._refused(str(place.relative_to(self.root)), "is a link; put the folder in its place")
            if not place.is_dir():
                _make_folder(place)
        clear(self.root / key)


def _make_folder(place: Path) -> None:
    """Make a folder in the place of whatever has its name; another thread or process may at the same moment."""
    if not place.is_dir():
        try:
            place.unlink(missing_ok=True)
        except OSError:
            if not place.is_dir():
                raise
    place.mkdir(parents=True, exist_ok=True)


def clear(path: Path) -> None:
    """Remove what has the name of a file and is none: a folder, a link, a pipe."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    elif os.path.lexists(path) and not stat.S_ISREG(os.lstat(path).st_mode):
        path.unlink(missing_ok=True)


def _declared(described: dict[str, Any]) -> Declared:
    """Return the declaration in the description of an array; raise some error where this package writes no such one."""
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


def unpacked_size(content: bytes) -> int | None:
    """Return the bytes that one frame of zstd decodes to; None where it is no single whole frame that says so."""
    try:
        head = content[4]
        single, at = head >> 5 & 1, 5
        at += (not single) + (0, 1, 2, 4)[head & 3]
        length = (single, 2, 4, 8)[head >> 6]
        size = int.from_bytes(content[at : at + length], "little") + 256 * (length == 2)
        at += length
        last = 0
        while not last:
            block = int.from_bytes(content[at : at + 3].ljust(3, b"\x06"), "little")  # block type 3 is none
            last, kind = block & 1, block >> 1 & 3
            at += 3 + (1 if kind == 1 else block >> 3)
            if kind == 3:
                return None
        at += 4 * (head >> 2 & 1)
    except IndexError:
        return None
    return size if content[:4] == MAGIC and length and at == len(content) else None


def netcdf_size(path: Path) -> int:
    """Return the bytes that the variables of a NetCDF file take in memory.

    `OSError`: it is no regular file, or a damaged one, or a variable lies elsewhere or unpacks to another size.
    """
    import h5py

    if not path.is_file():
        raise OSError(f"{str(path)!r} is no regular file")
    size = 0
    with h5py.File(path, "r") as file:
        _check_heaps(path)
        for name in file:
            if not isinstance(file.get(name, getlink=True), h5py.HardLink):
                raise OSError(f"variable {name!r} is a link")
            variable = file[name]
            if not isinstance(variable, h5py.Dataset):
                continue
            made = variable.id.get_create_plist()
            if made.get_layout() == h5py.h5d.VIRTUAL or made.get_external_count():
                raise OSError(f"variable {name!r} lies in another file")
            declared = Declared(
                variable.shape or (),
                variable.chunks or (0,),
                None if variable.dtype.kind == "O" else variable.dtype.itemsize,
                made.get_nfilters() > 0,
            )
            size += declared.size
            if declared.packed:
                _check_packed(variable)
    return size


def digest_of(values: Mapping[str, Any]) -> int:
    """Return 32 bits that follow from a tile's numbers: a chunk that was put in the place of another alters them."""
    digest = 0
    for name in sorted(values):
        digest = zlib.crc32(np.ascontiguousarray(values[name]).data, digest)
    return digest


def is_as_written(done: int, values: Mapping[str, Any]) -> bool:
    """Whether the numbers of a tile are those of which its record says that they were written."""
    return done < DIGEST or done - DIGEST == digest_of(values)


def _check_heaps(path: Path) -> None:
    """Raise where HDF5 would follow a list without end: what holds the words of a file has no checksum there."""
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        begin = -1
        while (begin := content.find(HEAP, begin + 1)) >= 0:
            at, end = begin + 16, begin + int.from_bytes(content[begin + 8 : begin + 16], "little")
            while at + 16 <= end:
                number, length = struct.unpack("<H6xQ", content[at : at + 16].ljust(16, b"\0"))
                at += 16 + -(-length // 8) * 8 if number else length
                if not (number or length) or at > min(end, len(content)):
                    raise OSError("its words are damaged")


def _check_packed(variable: h5py.Dataset) -> None:
    """Raise where zlib did not pack a chunk, its bytes perhaps shuffled before, or it unpacks to another size."""
    import h5py

    made = variable.id.get_create_plist()
    filters = [made.get_filter(at)[0] for at in range(made.get_nfilters())]
    if filters[-1] != h5py.h5z.FILTER_DEFLATE or filters[:-1] not in ([], [h5py.h5z.FILTER_SHUFFLE]):
        raise OSError(f"variable {variable.name!r} is packed by other means than zlib; repack it with nccopy -d 1")
    size = math.prod(variable.chunks) * variable.id.get_type().get_size()
    check_fits("path", f"has chunks of variable {variable.name!r} that take", size, "it is damaged")
    chunks: list[Any] = []
    variable.id.chunk_iter(chunks.append)
    for chunk in chunks:
        whole = chunk.filter_mask == 0 and chunk.size <= size + size // 100 + 1024
        if not whole or _inflated(variable.id.read_direct_chunk(chunk.chunk_offset)[1], size) != size:
            raise OSError(f"a chunk of variable {variable.name!r} does not unpack to the {in_words(size)} it declares")


def _inflated(content: bytes, most: int) -> int:
    """Return the bytes that zlib makes of a chunk, counted a part at a time, and not far beyond `most`."""
    unpacking, found = zlib.decompressobj(), 0
    while content and found <= most:
        found += len(unpacking.decompress(content, 1 << 20))
        content = unpacking.unconsumed_tail
    return found
