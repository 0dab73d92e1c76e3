"""Where the cells of a request are computed: here, in threads, or on a cluster."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from vibroimpact.backends import check_known, get_backend
from vibroimpact.execution.base import Place
from vibroimpact.parameters import whole_number
from vibroimpact.request import Request

if TYPE_CHECKING:
    from distributed import Client


@contextmanager
def computing(cluster: Client | str | None, workers: int | None) -> Iterator[Place]:
    """Yield the place where cells are computed: threads of this process, or the workers of a cluster."""
    if cluster is None:
        from vibroimpact.execution.threads import Threads, worker_count

        yield Threads(worker_count(workers))
        return
    from vibroimpact.execution.cluster import Cluster, connect

    with connect(cluster) as client:
        yield Cluster(client)


def check_place(request: Request, workers: int | None, cluster: Client | str | None, tile: int | None) -> None:
    """Raise if these arguments cannot compute the request, before anything is computed or started."""
    for name, value in (("workers", workers), ("tile", tile)):
        if value is not None:
            whole_number(name, value, 1)
    if cluster is not None:
        from vibroimpact.execution.cluster import check_cluster

        check_cluster(cluster)
        if workers is not None:
            raise ValueError(f"give either `workers` or `cluster`, not both; instead, give cluster='local:{workers}'")
    engine = get_backend(request.backend, time_step=request.time_step, elsewhere=cluster is not None)
    check_known(request.indices, engine, request.model.at())
