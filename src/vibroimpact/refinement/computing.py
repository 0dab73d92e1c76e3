"""Where batches of scattered cells are computed: in threads of this process, or on a cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Event
from typing import TYPE_CHECKING

from vibroimpact.backends import check_told, get_backend
from vibroimpact.backends.base import Counts, Outcome
from vibroimpact.execution.store.tiling import SLOW, usual_tile
from vibroimpact.execution.threads import check_alone, run_sweep, worker_count
from vibroimpact.parameters import whole_number
from vibroimpact.refinement.lattice import Places
from vibroimpact.request import Request

if TYPE_CHECKING:
    from distributed import Client

PARTS = 64  # that a batch is cut into for a cluster, at least
SMALLEST = 64  # cells that are handed to a worker, unless told otherwise
AHEAD = 64  # chunks that a cluster is handed at once: some 60 MB here
FEWEST = 4  # chunks that threads are handed at once: some 50 MB

CHUNK = 1 << 14  # cells kept together: a second or more of work
FEW = 64  # the same, where a cell takes up to seconds

Outcomes = Iterator[tuple[Counts | slice, Outcome]]


def chunk_of(request: Request) -> int:
    """Return how many cells are kept together."""
    return FEW if request.backend in SLOW else CHUNK


@dataclass(frozen=True)
class Computer:
    """What computes cells of a fine grid, by their flat indices.

    `run` yields which of the cells have ended, and what came of them, until all have or the event is set; it does best
    with so many `chunks` of them at once.
    """

    run: Callable[[Places, Event], Outcomes]
    chunks: int


@contextmanager
def computing(
    request: Request, workers: int | None, cluster: Client | str | None, tile: int | None
) -> Iterator[Computer]:
    """Yield what computes the cells of a request, in threads or on a cluster."""
    if cluster is None:
        yield _in_threads(request, worker_count(workers))
        return
    from vibroimpact.execution.cluster import connect, in_memory

    def run(at: Places, stop: Event) -> Outcomes:
        shared = max(len(at) // PARTS, SMALLEST)  # a small batch keeps many workers busy too
        return in_memory(client, request.scatter(at), tile or min(shared, usual_tile(request)), stop)

    with connect(cluster) as client:
        yield Computer(run, AHEAD)


def _in_threads(request: Request, workers: int) -> Computer:
    engine = get_backend(request.backend, time_step=request.time_step)

    def run(at: Places, stop: Event) -> Outcomes:
        return run_sweep(engine, request.cells(at), request.asked, workers, stop)

    return Computer(run, max(workers, FEWEST))


def check_place(request: Request, workers: int | None, cluster: Client | str | None, tile: int | None) -> None:
    """Refuse a place that is none, before anything is computed or started."""
    worker_count(workers)
    if tile is not None:
        whole_number("tile", tile, 1)
        if cluster is None:
            raise ValueError(f"`tile` is {tile!r} with `refine`; allowed is one with `cluster` only; leave it out")
    if cluster is not None:
        from vibroimpact.execution.cluster import check_cluster

        check_cluster(cluster)
        check_alone(workers)
    if cluster is None or request.backend != "cuda":  # the GPUs are those of the workers
        check_told(request.indices, get_backend(request.backend, time_step=request.time_step))
