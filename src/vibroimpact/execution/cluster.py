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
LOOK = 0.05  # seconds between two looks for finished tasks, and at whether to stop
RETRIES = 3  # times that a task which failed is run again; one whose worker died is run again by Dask itself
BATCH = 1000  # tasks submitted together: workers begin while the next ones are being submitted
PARTS, SMALLEST = 64, 64  # a batch of scattered cells is cut into so many parts, of so many cells or more
LOCAL = re.compile(r"local:([1-9]\d{0,3})")
REMOTE = re.compile(r"(tcp|tls)://[^/\s]+:\d{1,5}")
# Dask's watching of itself costs a tenth of a core beside two workers. Here it samples no stacks, and looks at loops,
# memory and system every second or two instead of every 10 to 500 ms.
QUIET = {
    "distributed.worker.profile.enabled": False,
    "distributed.worker.memory.monitor-interval": "1s",
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "2s",
}


class Cluster:
    """Computes cells on the workers of a cluster; those that see the store write to it themselves."""

    def __init__(self, client: Client) -> None:
        self.client = client

    def part_size(self, request: Request, cells: int) -> int:
        """Return the number of cells, of so many, a part should hold: a small batch keeps many workers busy too."""
        return min(max(cells // PARTS, SMALLEST), usual_tile(request))

    def compute(self, request: Request, parts: Sequence[Part], stop: Event, store: Path | None = None) -> Pieces:
        """Yield (number of a part, all of its cells, their results) as parts finish, until all have or `stop` is set.

        The results of a part that a worker has written into the store are its record.

        Raises
        ------
        RuntimeError
            A part was lost with its worker too often.
        ConnectionError
            The scheduler has gone.
        """
        from distributed import as_completed

        client = self.client
        if not client.nthreads():
            address = getattr(client.scheduler, "address", "ADDRESS")
            warnings.warn(
                f"`cluster` has no workers yet; the sweep waits for one: start it with `dask worker {address}`",
                stacklevel=2,
            )
        with _marked(store) as mark:
            shared = client.submit(_Shared, request, package_version(), store and str(store), mark, pure=False)
            name = f"vibroimpact-{uuid4().hex}"
            keys = [f"{name}-{number}" for number in range(len(parts))]
            futures = client.map(_work, parts, key=keys, retries=RETRIES, batch_size=BATCH, pure=False, shared=shared)
            finished = as_completed(futures, loop=client.loop, with_results=True, raise_errors=False)
            waiting = {future.key: (number, future) for number, future in enumerate(futures)}
            del futures  # workers forget results that no future stands for
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
                    with suppress(Exception):  # the scheduler may be gone, and its work with it
                        client.cancel([future for _, future in waiting.values()])


@dataclass(frozen=True)
class _Shared:
    """What all tasks of a sweep share."""

    request: Request
    version: str
    store: str | None
    mark: str


def _work(part: Part, shared: _Shared) -> Outcome | Rows:
    """Compute a part and write it where this machine sees the store; else return its results."""
    if package_version() != shared.version:
        raise RuntimeError(
            f"`cluster` has a worker with vibroimpact {package_version()}, but this is {shared.version}; numbers are "
            "the same everywhere with one version only: install it on all workers"
        )
    outcome = compute_here(shared.request, part)
    if shared.store is not None and isinstance(part, tuple) and sees(shared.store, shared.mark):
        from vibroimpact.execution.layout import record_of, write_tile

        with suppress(OSError):  # it sees the store and may not write: the client may, or explains what is wrong
            arrays = _arrays(shared.store, shared.mark, (*shared.request.indices, "status"))
            write_tile(arrays, part, outcome)
            return record_of(outcome)
    return outcome


@contextmanager
def _marked(store: Path | None) -> Iterator[str]:
    """Leave a random word in a store for as long as its tiles are out.

    The same path on another machine may be another folder, even one with an older copy of the same study: workers write
    only where they read this word.
    """
    mark = uuid4().hex
    if store is None:
        yield mark
        return
    file = _mark_of(store)
    with suppress(OSError):  # then no worker finds it, and the client writes
        file.unlink(missing_ok=True)  # never written through a link
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
    """Whether this machine sees the store that bears the mark."""
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
    """Return the result of a task, or raise what it raised."""
    from distributed import CancelledError, KilledWorker

    if isinstance(result, CancelledError):
        raise _lost_scheduler() from result
    if future.status != "error":
        return result
    _, error, trace = result
    if isinstance(error, KilledWorker):
        raise RuntimeError(
            f"`cluster` has lost a tile with its workers too often ({error}); what a store holds is safe; give the "
            "workers more memory or time, or a new sweep a smaller `tile`, and run the same again"
        ) from error
    raise error.with_traceback(trace)


def _lost_scheduler() -> ConnectionError:
    return ConnectionError(
        "`cluster` has lost its scheduler, which no longer answers; what a store holds is safe; "
        "start a scheduler and workers, and run the same again"
    )


@contextmanager
def connect(cluster: Client | str) -> Iterator[Client]:
    """Yield a client that is connected; close in the end what was opened here, and nothing else.

    A client given stays open. `tcp://HOST:PORT` or `tls://HOST:PORT` is a running scheduler: `ConnectionError` where
    none answers within five seconds. `local:N` starts N processes of one thread each on this machine and ends them at
    the end: `RuntimeError` where they do not start.
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
    """Refuse what is not a cluster, before anything is computed or started."""
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

    # On a busy machine, a killed process may take longer to be back than Dask would wait before it drops it.
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
                f"`cluster` is 'local:{processes}', whose processes did not start ({error}); each of them imports the "
                "script that starts it, so put what the script does below `if __name__ == '__main__':`"
            ) from error
        try:
            yield cluster
        finally:
            with suppress(KeyError):  # Dask may hear twice that a killed process is gone
                cluster.close()


def _reach(scheduler: Any) -> Client:
    from distributed import Client

    try:
        if isinstance(scheduler, str):
            _knock(scheduler)
        return Client(scheduler, timeout=PATIENCE, set_as_default=False)
    except Exception as error:  # what answers there may be anything
        raise ConnectionError(
            f"`cluster` is {scheduler!r}, where no scheduler answers within {PATIENCE} seconds "
            f"({type(error).__name__}); start one there with `dask scheduler`, or check address, port and firewall"
        ) from error


def _knock(address: str) -> None:
    """Raise unless a scheduler greets: a client would wait forever for something that listens and says nothing."""
    scheme, host, port = urlsplit(address).scheme, urlsplit(address).hostname, urlsplit(address).port
    with socket.create_connection((host, port), PATIENCE) as line:
        if scheme == "tcp":  # the scheduler speaks first: the length of its greeting, in eight bytes
            length = int.from_bytes(line.recv(8, socket.MSG_WAITALL), "little")
            if not 0 < length < 1 << 20:
                raise ConnectionError("something else answers")
