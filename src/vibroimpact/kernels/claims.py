"""Who compiles what: a process waits for what another one has begun to compile, and finds it in the cache then."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from time import perf_counter, sleep
from typing import Any

from vibroimpact import compiling

PATIENCE = 60.0  # s: then the other process is taken for stopped

meanwhile: list[Callable[[], bool]] = []  # what to do while another process compiles; each says whether it did anything


def claim_what_is_missing(cache: Any, folder: str, told: tuple[str, float, str]) -> None:
    """Let a cache of Numba's claim what it does not hold until that is compiled, or wait for whoever has claimed it."""
    load, save, claims = cache.load_overload, cache.save_overload, ExitStack()
    name = f"{cache._py_func.__module__}.{cache._py_func.__qualname__}"

    def loaded(signature: Any, *rest: Any) -> Any:
        found = load(signature, *rest)
        if found is not None:
            return found
        from filelock import FileLock, Timeout  # here, as its import takes 45 ms

        file = f"{hashlib.sha256(f'{name}{signature}'.encode()).hexdigest()[:16]}.lock"
        lock = FileLock(Path(folder, file), blocking=False)
        try:
            lock.acquire()
        except Timeout:
            compiling.begin(*told)
            try:
                _wait(lock)
            finally:
                compiling.end()
        except (OSError, NotImplementedError):  # a folder that cannot be written, or is without locks
            return None
        claims.callback(lock.release)
        found = load(signature, *rest)
        if found is not None:
            claims.close()
        return found

    def saved(*what: Any) -> None:
        save(*what)
        claims.close()

    cache.load_overload, cache.save_overload = loaded, saved


def _wait(lock: Any) -> None:
    from filelock import Timeout

    end = perf_counter() + PATIENCE
    while perf_counter() < end:
        try:
            lock.acquire()
        except Timeout:
            if not any(work() for work in meanwhile):
                sleep(0.02)
        else:
            return
