"""Cells computed by the workers of a Dask cluster."""

from __future__ import annotations

import logging
import re
import socket
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from threading import Event
from time import sleep
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit
from uuid import uuid4

from vibroimpact.backends.base import Outcome
from vibroimpact.dataset import package_version
from vibroimpact.execution.base import Part, Pieces, usual_tile
from vibroimpact.execution.threads import compute_here
from vibroimpact.parameters import MissingExtra, to_install
from vibroimpact.request import Request

if TYPE_CHECKING:
    from distributed import Client

    from vibroimpact.execution.layout import Rows

PATIENCE = 5  # seconds within which a scheduler must answer
LOOK = 0.05  # seconds between checks for finished tasks and for a stop
RETRIES = 3  # times that a failed task is run again; Dask itself reruns tasks whose worker died
BATCH = 1000  # tasks submitted together: workers begin while the next ones are being submitted
PARTS, SMALLEST = 64, 64  # parts of a batch of scattered cells, and the fewest cells of a part
LOCAL = re.compile(r"local:([1-9]\d{0,3})")
REMOTE = re.compile(r"(tcp|tls)://[^/\s]+:\d{1,5}")
# Dask's monitoring of itself costs a tenth of a core with two workers. Here it takes no stack samples, and checks
# loops, memory and system every 1 to 2 s instead of every 10 to 500 ms.
QUIET = {
    "distributed.worker.profile.enabled": False,
    "distributed.worker.memory.monitor-interval": "1s",
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "2s",
}


class Cluster:
    """Computes cells on the workers of a cluster; workers that can reach the store write to it themselves."""

    def __init__(self, client: Client) -> None:
        self.client = client

    def part_size(self, request: Request, cells: int) -> int:
        """Return the number of cells that a part should hold, so that a small batch keeps many workers busy too."""
        return min(max(cells // PARTS, SMALLEST), usual_tile(request))

    def compute(self, request: Request, parts: Sequence[Part], stop: Event, store: Path | None = None) -> Pieces:
        """Yield (number of a part, all of its cells, their results) as parts finish, until all have or `stop` is set.

        If a worker has written a part into the store, the record of the part replaces its results.

        Raises
        ------
        RuntimeError
            Too many workers died while they computed the same part.
        ConnectionError
            The scheduler no longer answers.
        """
        from distributed import as_completed

        client = self.client
        if not client.nthreads():
            address = getattr(client.scheduler, "address", "ADDRESS")
            warnings.warn(
                f"`cluster` has no workers yet; the sweep waits until you start one with `dask worker {address}`",
                stacklevel=2,
            )
        with _marked(store) as mark:
            shared = client.submit(_Shared, request, package_version(), store and str(store), mark, pure=False)
            name = f"vibroimpact-{uuid4().hex}"
            keys = [f"{name}-{number}" for number in range(len(parts))]
            futures = client.map(_work, parts, key=keys, retries=RETRIES, batch_size=BATCH, pure=False, shared=shared)
            finished = as_completed(futures, loop=client.loop, with_results=True, raise_errors=False)
            waiting = {future.key: (number, future) for number, future in enumerate(futures)}
            del futures  # so that workers can release results already received
            try:
                while waiting:
                    if client.status not in ("running", "connecting"):
                        raise _lost_scheduler()
                    stopped, ready = stop.is_set(), finished.next_batch(block=False)
                    for future, result in ready:
                        number, _ = waiting.pop(future.key)
                        yield number, slice(None), _checked(future, result)
                    if stopped:
                        return
                    if not ready:
                        sleep(LOOK)
            finally:
                finished.clear()
                if waiting and client.status == "running":
                    with suppress(Exception):  # the scheduler may be gone
                        client.cancel([future for _, future in waiting.values()])


@dataclass(frozen=True)
class _Shared:
    """The data that all tasks of a sweep share."""

    request: Request
    version: str
    store: str | None
    mark: str


def _work(part: Part, shared: _Shared) -> Outcome | Rows:
    """Compute a part; write it if this machine can reach the store, else return its results."""
    if package_version() != shared.version:
        raise RuntimeError(
            f"`cluster` has a worker with vibroimpact {package_version()}, but this process has {shared.version}; "
            "results are the same only with equal versions, so install the same one on all workers"
        )
    outcome = compute_here(shared.request, part)
    if shared.store is not None and isinstance(part, tuple) and sees(shared.store, shared.mark):
        from vibroimpact.execution.layout import record_of, write_tile

        with suppress(OSError):  # it may not write: the client writes instead, or reports what is wrong
            arrays = _arrays(shared.store, shared.mark, (*shared.request.indices, "status"))
            write_tile(arrays, part, outcome)
            return record_of(outcome)
    return outcome


@contextmanager
def _marked(store: Path | None) -> Iterator[str]:
    """Keep a random word in a store while its tiles are being computed elsewhere.

    On another machine, the same path may be another folder, even one with an older copy of the same study: workers
    write only where they find this word.
    """
    mark = uuid4().hex
    if store is None:
        yield mark
        return
    file = _mark_of(store)
    with suppress(OSError):  # then no worker finds it, and the client writes
        file.unlink(missing_ok=True)  # so that nothing is written through a link
        file.write_text(mark)
    try:
        yield mark
    finally:
        with suppress(OSError):
            file.unlink()


def _mark_of(store: Path) -> Path:
    from vibroimpact.execution.layout import MARK, PROGRESS

    return store / PROGRESS / MARK


def sees(store: str, mark: str) -> bool:
    """Return whether this machine can reach the store with this mark."""
    file = _mark_of(Path(store))
    try:
        return file.is_file() and file.stat().st_size == len(mark) and file.read_text() == mark
    except (OSError, UnicodeDecodeError):
        return False


@lru_cache(maxsize=4)
def _arrays(store: str, mark: str, names: tuple[str, ...]) -> dict[str, Any]:
    """Return a store's arrays, opened once per run."""
    import zarr

    from vibroimpact.files.guard import GuardedStore

    root: Any = zarr.open_group(GuardedStore(store, read_only=False), mode="r+", zarr_format=3)
    return {name: root[name] for name in names}


def _checked(future: Any, result: Any) -> Any:
    """Return the result of a task, or raise its error."""
    from distributed import CancelledError, KilledWorker

    if isinstance(result, CancelledError):
        raise _lost_scheduler() from result
    if future.status != "error":
        return result
    _, error, trace = result
    if isinstance(error, KilledWorker):
        raise RuntimeError(
            f"`cluster` has lost too many workers over one tile ({error}); tiles in a store are safe; give the workers "
            "more memory or time, or start a new sweep with a smaller `tile`, then run the same again"
        ) from error
    raise error.with_traceback(trace)


def _lost_scheduler() -> ConnectionError:
    return ConnectionError(
        "`cluster` has lost its scheduler, which no longer answers; tiles in a store are safe; "
        "start a scheduler and workers, then run the same again"
    )


@contextmanager
def connect(cluster: Client | str) -> Iterator[Client]:
    """Yield a connected client; at the end, close only what was opened here.

    A given client stays open. `tcp://HOST:PORT` or `tls://HOST:PORT` is a running scheduler (`ConnectionError` if none
    answers within five seconds). `local:N` starts N single-threaded processes on this machine and ends them afterwards
    (`RuntimeError` if they do not start).
    """
    from distributed import Client

    check_cluster(cluster)
    if isinstance(cluster, Client):
        yield cluster
        return
    opened = _local(int(local[1])) if (local := LOCAL.fullmatch(cluster)) else nullcontext(cluster)
    with opened as scheduler, _reach(scheduler) as client:
        yield client


def check_cluster(cluster: Any) -> None:
    """Raise if `cluster` is not a cluster, before anything is computed or started."""
    try:
        from distributed import Client
    except ImportError as error:
        raise MissingExtra(
            f"`cluster` needs Dask, which is not installed ({error}); {to_install('cluster')} installs it"
        ) from None
    if isinstance(cluster, Client):
        if cluster.asynchronous:
            raise ValueError("`cluster` must be a synchronous Client, got an asynchronous one")
        if cluster.status != "running":
            raise ValueError(f"`cluster` must be an open Client, got one that is {cluster.status}; make a new one")
    elif not isinstance(cluster, str) or not (LOCAL.fullmatch(cluster) or REMOTE.fullmatch(cluster)):
        raise ValueError(
            "`cluster` must be a dask.distributed.Client, 'tcp://HOST:PORT' of a running scheduler, or 'local:N' for N "
            f"processes on this machine, got {cluster!r}"
        )


@contextmanager
def _local(processes: int) -> Iterator[Any]:
    from dask import config
    from distributed import LocalCluster

    # On a busy machine, a killed process may take longer to restart than Dask waits before it gives it up.
    with config.set({**QUIET, "distributed.deploy.lost-worker-timeout": "1 day"}):
        try:
            cluster = LocalCluster(
                n_workers=processes,
                threads_per_worker=1,
                processes=True,
                dashboard_address="127.0.0.1:0",
                silence_logs=logging.ERROR,
            )
        except RuntimeError as error:
            raise RuntimeError(
                f"`cluster` 'local:{processes}': its processes did not start ({error}); each of them imports the "
                "calling script, so put the statements of the script below `if __name__ == '__main__':`"
            ) from error
        try:
            yield cluster
        finally:
            with suppress(KeyError):  # Dask may be notified twice that a killed process is gone
                cluster.close()


def _reach(scheduler: Any) -> Client:
    from distributed import Client

    try:
        if isinstance(scheduler, str):
            _knock(scheduler)
        return Client(scheduler, timeout=PATIENCE, set_as_default=False)
    except Exception as error:  # anything may answer at that address
        raise ConnectionError(
            f"`cluster` {scheduler!r}: no scheduler answered within {PATIENCE} seconds "
            f"({type(error).__name__}); start one there with `dask scheduler`, or check address, port and firewall"
        ) from error


def _knock(address: str) -> None:
    """Raise unless a scheduler answers; a client would wait forever for a server that listens but sends nothing."""
    scheme, host, port = urlsplit(address).scheme, urlsplit(address).hostname, urlsplit(address).port
    with socket.create_connection((host, port), PATIENCE) as line:
        if scheme == "tcp":  # the scheduler speaks first: the length of its greeting, in eight bytes
            length = int.from_bytes(line.recv(8, socket.MSG_WAITALL), "little")
            if not 0 < length < 1 << 20:
                raise ConnectionError("something else answers")
