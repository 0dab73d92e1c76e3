"""How far the study is, what it is doing, and how long each stage took."""

from __future__ import annotations

import sys
from collections.abc import Callable
from time import perf_counter
from typing import Any

Tick = Callable[[float], None]  # told the part of a step that is done, 0 to 1
Progress = bool | Callable[[int, int, str], Any]


class Stages:
    """Tells progress step by step and keeps the time of each stage.

    Parameters
    ----------
    progress : bool or callable
        True writes a line to the error stream as each step begins; a callable is given
        (work done, work in all, text) and stops the study by returning False.
    total : int
        Work in all, in the units of the steps' weights.
    """

    def __init__(self, progress: Progress, total: int) -> None:
        self.seconds: dict[str, float] = {}
        self.text = ""
        self._progress, self._total, self._done = progress, total, 0
        self._since = perf_counter()

    def begin(self, stage: str, text: str, weight: int) -> Tick:
        """Open a step of a stage; return the function that tells how far the step is."""
        self._close()
        self._stage, self._weight = stage, weight
        self.text = text
        if self._progress is True:
            print(f"[{self._done / self._total:4.0%}] {stage}: {text}", file=sys.stderr, flush=True)
        tick = self._tick
        tick(0.0)
        return tick

    def finish(self) -> None:
        """Close the last step."""
        self._close()
        self._tell(self._total)

    def _tick(self, part: float) -> None:
        self._tell(self._done + int(part * self._weight))

    def _tell(self, done: int) -> None:
        if callable(self._progress) and self._progress(done, self._total, self.text) is False:
            raise KeyboardInterrupt

    def _close(self) -> None:
        now = perf_counter()
        if self.text:
            self.seconds[self._stage] = self.seconds.get(self._stage, 0.0) + now - self._since
            self._done += self._weight
        self._since = now
