"""Searches along several paths, whose motions are computed together.

A search is a generator: it yields the motions that it needs, receives them, and returns its result. So each search is
written as if it were the only one, while the motions of all searches fill the lanes of the engine.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from typing import Any, NamedTuple, TypeVar

from vibroimpact.backends import Cells, ImpactWindow
from vibroimpact.coexistence.measuring import Runner

Result = TypeVar("Result")


class Query(NamedTuple):
    """The motions that a search needs: the cells, what to compute for them, and one more argument."""

    compute: Callable[[Runner, Cells, Any], Sequence[Any]]
    cells: Cells
    argument: Any


Search = Generator[Query, Any, Result]


def measured(cells: Cells, window: ImpactWindow) -> Query:
    """Request the motion of each cell over a window."""
    return Query(Runner.glance, cells, window)


def followed(cells: Cells, impacts: int) -> Query:
    """Request the state of each motion after a number of impacts, or None if it could not be followed."""
    return Query(Runner.follow, cells, impacts)


def together(searches: Sequence[Search[Result]], runner: Runner) -> list[Result]:
    """Return the result of each search; queries of one kind are answered together."""
    results: dict[int, Result] = {}
    queries: dict[int, Query] = {}

    def go_on(number: int, answer: Any) -> None:
        try:
            queries[number] = searches[number].send(answer)
        except StopIteration as end:
            results[number] = end.value

    for number in range(len(searches)):
        go_on(number, None)
    while queries:
        kinds: dict[Any, dict[int, Cells]] = {}
        for number, (compute, cells, argument) in queries.items():
            kinds.setdefault((compute, argument), {})[number] = cells
        queries = {}
        for (compute, argument), of_kind in kinds.items():
            answers = iter(compute(runner, Cells.join(list(of_kind.values())), argument))
            for number, cells in of_kind.items():
                go_on(number, [next(answers) for _ in range(len(cells))])
    return [results[number] for number in range(len(searches))]
