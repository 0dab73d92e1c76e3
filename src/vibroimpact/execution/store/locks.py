"""One writer at a time."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

LOCK = "lock"


class StoreBusy(OSError):
    """Another process writes to the store."""


@contextmanager
def locked(lock: Path, store: Path, patience: float = 0.0) -> Iterator[None]:
    """Hold a lock of a store; the system takes it back from a process that ends, however it ends."""
    from filelock import FileLock, Timeout

    held = FileLock(lock, thread_local=False)
    try:
        held.acquire(timeout=patience, poll_interval=0.01)
    except Timeout:
        raise StoreBusy(
            f"`store` is {str(store)!r}, to which another process writes; allowed is one at a time; "
            "wait until it has ended, or choose another name"
        ) from None
    except FileNotFoundError:
        raise
    except OSError as error:
        raise PermissionError(
            error.errno,
            f"`store` is {str(store)!r}, which cannot be written to ({error.strerror or error}); choose another folder",
        ) from error
    try:
        yield
    finally:
        held.release()
