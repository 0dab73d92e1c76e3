"""Who compiles what: a process waits for what another one has begun to compile, and finds it in the cache then."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from time import perf_counter, sleep
from typing import Any

from vibroimpact import compiling
from vibroimpact.kernels.shared.interrupts import uninterrupted

PATIENCE = 60.0  # s: then the other process is taken for stopped

meanwhile: list[Callable[[], bool]] = []  # what to do while another process compiles; each says whether it did anything


def claim_what_is_missing(driver: Any, folder: str, announcement: tuple[str, float, str]) -> None:
    """Let a driver claim what its cache does not hold until that is compiled, or wait for whoever has claimed it."""
    cache, compile_alone, claims = driver._cache, driver.compile, ExitStack()
    load = cache.load_overload
    name = f"{cache._py_func.__module__}.{cache._py_func.__qualname__}"

    def loaded(signature: Any, *rest: Any) -> Any:
        overload = load(signature, *rest)
        if overload is not None:
            return overload
        from filelock import FileLock, Timeout  # here, as its import takes 45 ms

        file = f"{hashlib.sha256(f'{name}{signature}'.encode()).hexdigest()[:16]}.lock"
        lock = FileLock(Path(folder, file), blocking=False)
        try:
            lock.acquire()
        except Timeout:
            compiling.begin(*announcement)
            try:
                _wait(lock)
            finally:
                compiling.end()
        except (OSError, NotImplementedError):  # a folder that cannot be written, or is without locks
            return None
        claims.callback(lock.release)
        overload = load(signature, *rest)
        if overload is not None:
            claims.close()
        return overload

    def compiled(signature: Any) -> Any:
        try:
            with uninterrupted():
                return compiling.carried_out(lambda: compile_alone(signature))
        finally:
            claims.close()  # of what failed, too: who compiles it next would wait for this process itself

    cache.load_overload, driver.compile = loaded, compiled


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
