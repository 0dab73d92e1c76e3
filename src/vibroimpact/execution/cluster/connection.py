"""From what a user gives to a client of a Dask cluster."""

from __future__ import annotations

import logging
import re
import socket
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

if TYPE_CHECKING:
    from distributed import Client

PATIENCE = 5  # seconds within which a scheduler must answer
LOCAL = re.compile(r"local:([1-9]\d{0,3})")
REMOTE = re.compile(r"(tcp|tls)://[^/\s]+:\d{1,5}")
# Watching itself costs Dask a tenth of a core beside two workers, and sweeps have little to show: here no stack is
# sampled, and loops, memory and system are looked at every second or two instead of every 10 to 500 ms.
QUIET = {
    "distributed.worker.profile.enabled": False,
    "distributed.worker.memory.monitor-interval": "1s",
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "2s",
}
ALLOWED = "a dask.distributed.Client, 'tcp://HOST:PORT' of a running scheduler, or 'local:N' for N processes here"


@contextmanager
def connect(cluster: Client | str) -> Iterator[Client]:
    """Yield a client of a cluster; close in the end what was opened here, and nothing else.

    Parameters
    ----------
    cluster : dask.distributed.Client or str
        A client, which stays open; `tcp://HOST:PORT` or `tls://HOST:PORT` of a running scheduler; or `local:N`, which
        starts N processes of one thread each on this machine and ends them at the end.

    Yields
    ------
    dask.distributed.Client
        A client that is connected.

    Raises
    ------
    ValueError
        It is neither, or a client that is asynchronous or closed.
    ImportError
        Dask is not installed.
    ConnectionError
        No scheduler answers there within five seconds.
    RuntimeError
        The processes of `local:N` did not start.
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
    """Refuse what is no cluster, before anything is computed or started."""
    try:
        from distributed import Client
    except ImportError as error:
        raise ImportError(
            f"`cluster` needs Dask, which is not installed ({error}); "
            "install it with `pip install 'vibroimpact[cluster]'`"
        ) from None
    if isinstance(cluster, Client):
        if cluster.asynchronous:
            raise ValueError("`cluster` is an asynchronous Client; allowed is a synchronous one; make one without that")
        if cluster.status != "running":
            raise ValueError(f"`cluster` is a Client that is {cluster.status}; allowed is an open one; make a new one")
    elif not isinstance(cluster, str) or not (LOCAL.fullmatch(cluster) or REMOTE.fullmatch(cluster)):
        raise ValueError(f"`cluster` is {cluster!r}; allowed is {ALLOWED}; give one of them")


@contextmanager
def _local(processes: int) -> Iterator[Any]:
    from dask import config
    from distributed import LocalCluster

    class Processes(LocalCluster):
        def _update_worker_status(self, op: str, message: Any) -> None:
            # A worker killed in its first moments may be reported gone without ever having been reported there, over
            # which Dask stops watching its workers and cannot close.
            if op == "add" or message in self.scheduler_info["workers"]:
                super()._update_worker_status(op, message)  # type: ignore[no-untyped-call]

    # On a busy machine, a killed process may take longer to be there again than Dask would wait before it drops it.
    with config.set({**QUIET, "distributed.deploy.lost-worker-timeout": "1 day"}):
        try:
            cluster = Processes(  # type: ignore[no-untyped-call]
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
        with cluster:
            yield cluster


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
    """Raise unless something that sounds like a scheduler answers; a client would wait for ever for a silent one."""
    scheme, host, port = urlsplit(address).scheme, urlsplit(address).hostname, urlsplit(address).port
    with socket.create_connection((host, port), PATIENCE) as line:
        if scheme == "tcp":  # the scheduler speaks first: how long its greeting is, in eight bytes
            length = int.from_bytes(line.recv(8, socket.MSG_WAITALL), "little")
            if not 0 < length < 1 << 20:
                raise ConnectionError("something else answers")
