"""Tiles as they travel: each carries what a worker needs to compute it, and where it may write it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import Any
from uuid import uuid4

from numpy.typing import NDArray

from vibroimpact.dataset import package_version
from vibroimpact.execution.store.layout import PROGRESS, RECORDS
from vibroimpact.execution.store.records import Record
from vibroimpact.execution.store.writer import TileWriter
from vibroimpact.execution.threads import compute
from vibroimpact.request import Request

Computed = tuple[dict[str, NDArray[Any]], float]
Part = tuple[slice, ...]
_writing = Lock()  # held from looking for the mark until the tile is whole
MARK = "cluster"  # the file, beside a store's flags, that tells workers that it is this store


@dataclass(frozen=True)
class Tile:
    """A box of a sweep's cells, with its own stretch of the axes only: some kilobytes, however large the grid."""

    request: Request
    version: str

    def __call__(self) -> Computed:
        """Compute it, on whichever machine this is."""
        if package_version() != self.version:
            raise RuntimeError(
                f"`cluster` has a worker with vibroimpact {package_version()}, here it is {self.version}; allowed is "
                "one version, for one machine's numbers; install the same everywhere"
            )
        return compute(self.request, tuple(slice(None) for _ in self.request.dims))


def cut_out(request: Request, part: Part) -> Tile:
    """Return the tile of a box of cells."""
    return Tile(request.cut_out(part), package_version())


@dataclass(frozen=True)
class WritableTile:
    """A tile with its place in a store."""

    tile: Tile
    number: int
    part: Part
    folder: str
    mark: str

    def __call__(self) -> Record | Computed:
        """Compute it and write it, where this machine sees the store; else return its numbers."""
        result, seconds = self.tile()
        with _writing:
            if not sees(self.folder, self.mark):
                return result, seconds
            try:
                return _writer(self.folder, self.mark).write(self.number, self.part, result, seconds)
            except OSError:  # it sees the store and may not write; the client may, or knows how to say what is wrong
                return result, seconds


def wait_for_writers() -> None:
    """Return once the tile that this process is writing, if any, is whole."""
    with _writing:
        pass


@contextmanager
def marked(folder: Path) -> Iterator[str]:
    """Leave a random word in a store for as long as its tiles are out.

    The same path on another machine may be another folder, with an older copy of the same study even: workers write
    only where they read this word, and no longer once the run that left it has ended.
    """
    mark = uuid4().hex
    file = folder / PROGRESS / RECORDS / MARK
    with suppress(OSError):  # then no worker finds it, and the client writes
        file.write_text(mark)
    try:
        yield mark
    finally:
        with suppress(OSError):
            file.unlink()


def sees(folder: str, mark: str) -> bool:
    """Whether this machine sees the store that bears the mark."""
    try:
        return (Path(folder) / PROGRESS / RECORDS / MARK).read_text() == mark
    except (OSError, UnicodeDecodeError):
        return False


@lru_cache(maxsize=4)
def _writer(folder: str, mark: str) -> TileWriter:
    """Return the writer of a store, opened once a run."""
    return TileWriter(Path(folder))
