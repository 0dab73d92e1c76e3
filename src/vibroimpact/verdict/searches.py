"""Searches along several paths, each a function of its own path, whose motions are computed together.

A search is a generator: it yields which motions it needs, gets them, and returns what it has found. So a search reads
as if it were alone, and yet the motions of all fill the lanes of the engine.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from typing import Any, NamedTuple, TypeVar

from vibroimpact.backends import Cells, ImpactWindow
from vibroimpact.coexistence.measuring import Runner
from vibroimpact.verdict.present import measure

Result = TypeVar("Result")


class Query(NamedTuple):
    """Motions that a search needs: what is to be computed of which cells, with one argument more."""

    compute: Callable[[Runner, Cells, Any], Sequence[Any]]
    cells: Cells
    argument: Any


Search = Generator[Query, Any, Result]


def measured(cells: Cells, window: ImpactWindow) -> Query:
    """Ask for the motion of each cell over a window."""
    return Query(measure, cells, window)


def followed(cells: Cells, impacts: int) -> Query:
    """Ask for the state of each motion after so many impacts, or None where it could not be followed."""
    return Query(Runner.follow, cells, impacts)


def together(searches: Sequence[Search[Result]], runner: Runner) -> list[Result]:
    """Return what each search finds: queries of one kind are answered at once."""
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
