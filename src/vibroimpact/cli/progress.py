"""How far a sweep is: a bar on a terminal, plain lines elsewhere; Ctrl-C keeps what is finished."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable
from queue import SimpleQueue
from time import perf_counter
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from rich.progress import Progress


SECONDS = 5.0  # between plain lines about work whose end is not known
SWITCH = 1e-4  # seconds after which cells that are computed in Python make way for whoever winds a stopped sweep up


class Meter:
    """The callable a sweep reports to, within a `with` block.

    Parameters
    ----------
    label : str
        What is computed.
    keeps : bool
        Whether what is finished outlives an interruption.
    patience : float, optional
        Seconds, at most, for which a sweep that is stopped waits for what runs.
    settle : callable, optional
        Makes whole what is being written to a store; called before the process is ended at once.
    opening : callable, optional
        Tells what is to be told before the first report, or at the end of a sweep that reported nothing.
    """

    def __init__(
        self,
        label: str,
        *,
        keeps: bool = True,
        patience: float | None = None,
        settle: Callable[[], None] | None = None,
        opening: Callable[[], None] | None = None,
    ) -> None:
        self.label, self.keeps, self.patience, self.settle = label, keeps, patience, settle
        self._opening = opening
        self.stopped = False  # a sweep looks at it between two reports, too
        self._bar: Progress | None = None
        self._told = 0.0
        self._before: Any = None
        self._end: SimpleQueue[bool] = SimpleQueue()  # a signal may break into anything but its `put`

    def __enter__(self) -> Self:
        self._began = perf_counter()
        if threading.current_thread() is threading.main_thread():
            threading.Thread(target=self._end_at_once, daemon=True).start()
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
            self._end.put(False)
        if error is None:  # nothing was left to report
            self._open()
        self.seconds = perf_counter() - self._began

    def __call__(self, done: int, total: int | None, partial: Any) -> bool:
        """Tell how far the sweep is, where its end is known or not; say whether it shall go on."""
        self._open()
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

    def _open(self) -> None:
        if self._opening is not None:
            opening, self._opening = self._opening, None
            opening()

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
            sys.setswitchinterval(SWITCH)
            kept = "; what is finished is kept" if self.keeps else ""
            limit = f", what runs is given up after {self.patience:.0f} s" if self.patience else ""
            os.write(2, f"\nstopping{limit}{kept} (Ctrl-C again to stop at once)\n".encode())
        elif self.keeps:  # a sweep's threads would be waited for
            self._end.put(True)
        else:
            raise KeyboardInterrupt

    def _end_at_once(self) -> None:
        """Wait until it is asked for, then end the process, in a thread of its own."""
        if self._end.get():
            if self.settle is not None:
                self.settle()
            kept = "finished tiles are kept" if self.settle else "nothing was kept"
            os.write(2, f"\nvibroimpact: stopped at once, {kept}\n".encode())
            os._exit(130)


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
