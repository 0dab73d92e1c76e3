"""Making a store: it appears whole, and only one process makes it."""

from __future__ import annotations

import math
import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from shlex import join

from vibroimpact import memory
from vibroimpact.execution.store.layout import lay_out
from vibroimpact.execution.store.locks import LOCK, StoreBusy, locked
from vibroimpact.execution.store.records import COLUMNS
from vibroimpact.execution.store.tiling import Tiling, cut
from vibroimpact.files import remove_folder
from vibroimpact.request import Request


def scratch_of(folder: Path) -> Path:
    """Return where a store is laid out before it gets its name."""
    return folder.with_name(f".{folder.name}.part")


def create(folder: Path, request: Request, cells: int) -> None:
    """Make the store of a request, unless one stands there by now; what a killed process left half made goes."""
    if not folder.parent.is_dir():
        raise FileNotFoundError(f"`store` is {str(folder)!r}; its folder does not exist; make it first")
    _check_room(request, cut(request.shape, cells))
    command = join([Path(sys.argv[0]).name, *sys.argv[1:]])
    try:
        with _claimed(scratch_of(folder), folder) as part:
            if not os.path.lexists(folder):
                lay_out(part, request, cut(request.shape, cells), command)
                # Refused where another store has appeared: a rename never replaces a folder that holds something.
                os.rename(part, folder)
    except StoreBusy:
        raise
    except OSError as error:
        if folder.is_dir() and scratch_of(folder).exists():
            return  # it stands; only a leftover beside it could not be removed
        message = (
            f"`store` is {str(folder)!r}, which could not be made ({error.strerror or error}); nothing was changed; "
            "make room there or choose another folder"
        )
        kind = PermissionError if isinstance(error, PermissionError) else OSError
        raise kind(error.errno, message) from error


def _check_room(request: Request, tiling: Tiling) -> None:
    """Refuse tiles of which memory cannot hold one, or whose records it cannot hold."""
    many = f"span {math.prod(tiling.shape):,} cells in {len(tiling):,} tiles, whose records take"
    memory.check_fits("axes", many, len(tiling) * COLUMNS * 8, "take fewer points, or larger tiles")
    one = math.prod(tiling.tile) * (memory.CELL + memory.INDEX * (len(request.indices) - 1))
    memory.check_fits("tile", f"is {math.prod(tiling.tile):,} cells, which take", one, "4096 is usual")


@contextmanager
def _claimed(scratch: Path, folder: Path) -> Iterator[Path]:
    """Yield a free name in the scratch folder, which no other process uses meanwhile."""
    part = scratch / folder.name
    with ExitStack() as held:
        held.callback(_remove_empty, scratch)
        _claim(scratch, folder, held)
        try:
            shutil.rmtree(part, ignore_errors=True)
            yield part
        except BaseException:
            remove_folder(part)
            raise
        finally:
            with suppress(OSError):  # Windows removes no open file
                (scratch / LOCK).unlink()


def _claim(scratch: Path, folder: Path, held: ExitStack) -> None:
    for _ in range(100):
        scratch.mkdir(exist_ok=True)
        with suppress(FileNotFoundError):  # whoever held it has just removed it
            held.enter_context(locked(scratch / LOCK, folder, patience=20.0))
            return
    raise StoreBusy(f"`store` is {str(folder)!r}, which another process keeps making; wait until it has ended")


def _remove_empty(folder: Path) -> None:
    with suppress(OSError):
        folder.rmdir()
