"""Telling how far a long computation is."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event
from typing import Any

# Called with cells done, cells in all, and the result so far; False asks to stop.
Report = Callable[[int, int, Any], Any]


class Stop(Event):
    """Whether a sweep shall stop: because it was set, or because whoever it reports to wants it between two reports.

    Parameters
    ----------
    progress : bool or callable
        What the sweep reports to; a callable may have an attribute `stopped`, true once it wants the sweep to stop.
    """

    def __init__(self, progress: bool | Report) -> None:
        super().__init__()
        self._progress = progress

    def is_set(self) -> bool:
        """Return whether to stop."""
        return super().is_set() or getattr(self._progress, "stopped", False) is True


@contextmanager
def reporter(progress: bool | Report, label: str) -> Iterator[Report]:
    """Yield the function that a sweep calls after every tile: the user's own, a bar, or nothing."""
    if callable(progress):
        yield progress
    elif not progress:
        yield lambda done, total, partial: None
    else:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
        with Progress(*columns, console=Console(file=sys.stderr)) as bar:
            task = bar.add_task(label, total=None)
            yield lambda done, total, partial: bar.update(task, completed=done, total=total)
