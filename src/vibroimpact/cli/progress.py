"""How far a sweep is: a bar on a terminal, plain lines elsewhere; Ctrl-C keeps what is finished."""

from __future__ import annotations

import os
import signal
import sys
import threading
from time import perf_counter
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from rich.progress import Progress


SECONDS = 5.0  # between plain lines about work whose end is not known


class Meter:
    """The callable a sweep reports to, within a `with` block."""

    def __init__(self, label: str, *, keeps: bool = True) -> None:
        self.label = label
        self.keeps = keeps  # whether what is finished outlives an interruption
        self.stopped = False
        self._bar: Progress | None = None
        self._told = 0.0
        self._before: Any = None

    def __enter__(self) -> Self:
        self._began = perf_counter()
        if threading.current_thread() is threading.main_thread():
            self._before = signal.signal(signal.SIGINT, self._stop)
        if sys.stderr.isatty():
            self._bar = _bar()
            self._task = self._bar.add_task(self.label, total=None, detail="")
            self._bar.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._bar is not None:
            self._bar.stop()
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)
        self.seconds = perf_counter() - self._began

    def __call__(self, done: int, total: int | None, partial: Any) -> bool:
        """Tell how far the sweep is, where its end is known or not; say whether it shall go on."""
        seconds = perf_counter() - self._began
        if total is None:
            return self._count(done, seconds)
        impacts = getattr(partial, "attrs", {}).get("impacts_computed", 0)
        detail = partial if isinstance(partial, str) else speed(impacts, seconds)
        if self._bar is not None:
            self._bar.update(self._task, completed=done, total=total, detail=detail)
        elif done / total >= self._told + 0.1 or done == total:
            self._told = done / total
            left = f"{seconds * (total - done) / done:.0f} s left" if done < total else f"{seconds:.1f} s"
            told = [f"{self.label}: {100 * done / total:.0f} % of {total}", detail, left]
            print(", ".join(part for part in told if part), file=sys.stderr, flush=True)
        return not self.stopped

    def _count(self, done: int, seconds: float) -> bool:
        """Tell how many are done of nobody knows how many."""
        if self._bar is not None:
            self._bar.update(self._task, completed=done)
        elif seconds >= self._told + SECONDS:
            self._told = seconds
            print(f"{self.label}: {done}, {seconds:.0f} s", file=sys.stderr, flush=True)
        return not self.stopped

    def _stop(self, signal_number: int, frame: FrameType | None) -> None:
        # os.write: a print here could meet one that the signal broke into
        if not self.stopped:
            self.stopped = True
            kept = "; what is finished is kept" if self.keeps else ""
            os.write(2, f"\nstopping{kept} (Ctrl-C again to stop at once)\n".encode())
        elif self.keeps:  # a sweep has no file open, and its threads would be waited for
            os.write(2, b"\nvibroimpact: stopped at once, nothing was kept\n")
            os._exit(130)
        else:
            raise KeyboardInterrupt


def speed(impacts: int, seconds: float) -> str:
    """Return impacts a second in words; empty where none were counted."""
    if impacts <= 0 or seconds <= 0.0:
        return ""
    rate = impacts / seconds
    return f"{rate / 1e6:.3g} million impacts/s" if rate >= 1e6 else f"{rate:.3g} impacts/s"


def _bar() -> Progress:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[detail]}"),
        TimeRemainingColumn(),
        TextColumn("left"),
        console=Console(file=sys.stderr),
    )
