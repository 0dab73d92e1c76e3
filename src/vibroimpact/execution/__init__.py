"""Where the cells of a request are computed: in threads of this process or on a cluster, and kept in a store."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from threading import Event
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends import check_known, get_backend
from vibroimpact.backends.base import Outcome
from vibroimpact.execution.threads import Threads, worker_count
from vibroimpact.execution.tiling import Part, Pieces
from vibroimpact.parameters import whole_number
from vibroimpact.request import Places, Request

if TYPE_CHECKING:
    from pathlib import Path

    from distributed import Client


class Place(Protocol):
    """Computes cells somewhere."""

    def part_size(self, request: Request, cells: int) -> int:
        """Return how many cells a part should hold where so many are to be computed."""
        ...

    def compute(self, request: Request, parts: Sequence[Part], stop: Event, store: Path | None = None) -> Pieces:
        """Yield (number of a part, which of its cells have ended, their results) until all have or `stop` is set.

        Whoever sees the `store` may write a tile there and give its record in place of its results.
        """
        ...


@contextmanager
def computing(cluster: Client | str | None, workers: int | None) -> Iterator[Place]:
    """Yield the place where cells are computed."""
    if cluster is None:
        yield Threads(worker_count(workers))
        return
    from vibroimpact.execution.cluster import Cluster, connect

    with connect(cluster) as client:
        yield Cluster(client)


def check_place(request: Request, workers: int | None, cluster: Client | str | None, tile: int | None) -> None:
    """Refuse what cannot compute a request, before anything is computed or started."""
    worker_count(workers)
    if tile is not None:
        whole_number("tile", tile, 1)
    if cluster is not None:
        from vibroimpact.execution.cluster import check_cluster

        check_cluster(cluster)
        if workers is not None:
            raise ValueError(f"give either `workers` or `cluster`, not both; or cluster='local:{workers}'")
    engine = get_backend(request.backend, time_step=request.time_step, elsewhere=cluster is not None)
    check_known(request.indices, engine)


class Gathered:
    """Pieces of parts, until a part is whole."""

    def __init__(self) -> None:
        self._begun: dict[int, tuple[Outcome, NDArray[np.bool_]]] = {}

    def add(self, part: int, size: int, which: Places, outcome: Outcome) -> Outcome | None:
        """Add a piece of a part of `size` cells; return the part's results if it is whole now."""
        if part not in self._begun:
            results = {name: np.empty(size, values.dtype) for name, values in outcome.items()}
            self._begun[part] = results, np.zeros(size, bool)
        results, ended = self._begun[part]
        for name, values in outcome.items():
            results[name][which] = values
        ended[which] = True
        return self._begun.pop(part)[0] if ended.all() else None

    def rest(self) -> Iterator[tuple[int, Places, Outcome]]:
        """Yield each part that is not whole, which of its cells have ended, and their results."""
        for part, (results, ended) in self._begun.items():
            yield part, np.flatnonzero(ended), {name: values[ended] for name, values in results.items()}
