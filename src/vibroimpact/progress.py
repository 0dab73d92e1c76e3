"""Progress of long computations: a bar on a terminal, plain lines elsewhere; Ctrl-C keeps what is finished."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from queue import SimpleQueue
from threading import Event
from time import perf_counter
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Any, Self, TextIO, cast

from vibroimpact import compiling
from vibroimpact.parameters import truth

if TYPE_CHECKING:
    from rich.progress import Progress

# Called with cells done, cells in all, and the result so far; False asks to stop.
Report = Callable[[int, int, Any], Any]


class Stop(Event):
    """Whether a sweep must stop: because this was set, or because the receiver of its reports asks between two of them.

    The receiver may have an attribute `stopped`, which is true once the sweep must stop.
    """

    def __init__(self, progress: bool | Report | None) -> None:
        super().__init__()
        self._progress = progress

    def is_set(self) -> bool:
        """Return whether to stop."""
        return super().is_set() or getattr(self._progress, "stopped", False) is True


@contextmanager
def reporter(progress: bool | Report | None, label: str) -> Iterator[Report]:
    """Yield the function that a sweep calls after every tile: the user's own, a bar, a passing line, or nothing.

    None is the passing line where somebody watches, unless what calls this function reports already.
    """
    inside, _depth.value = _depth.value, _depth.value + 1
    try:
        with _reporter(progress, label, inside > 0) as report:
            yield report
    finally:
        _depth.value = inside


class _Depth(threading.local):
    value = 0  # of reporters within reporters, in each thread


_depth = _Depth()


@contextmanager
def _reporter(progress: bool | Report | None, label: str, inside: bool) -> Iterator[Report]:
    if callable(progress):
        yield progress
    elif progress is None and not inside and watched():
        with Passing(label) as line:
            yield line
    elif progress is None or not truth("progress", progress):
        yield lambda done, total, partial: None
    else:
        with _bar() as bar:
            task, began = bar.add_task(label, total=None, detail="", left=""), compiling.clock()

            def show(done: int, total: int, partial: Any) -> None:
                left = remaining(done, total, compiling.clock() - began)
                bar.update(task, completed=done, total=total, left=left)

            yield show


def watched() -> bool:
    """Return whether the error stream of this thread is read by somebody: on a terminal or in a notebook."""
    if Pulse.latest is not None or threading.current_thread() is not threading.main_thread():
        return False
    return in_notebook() or sys.stderr.isatty()


def in_notebook() -> bool:
    """Return whether this process is the kernel of a notebook."""
    return hasattr(getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)(), "kernel")


class _Line:
    """A temporary line on the error stream, which a thread of its own writes anew until the line has ended."""

    pause = 1.0  # of PULSE, between two looks at what to write

    def __init__(self) -> None:
        self._stream, self._width = sys.stderr, 0
        self._lock, self._ended = threading.Lock(), Event()

    def __enter__(self) -> Self:
        threading.Thread(target=self._run, daemon=True).start()
        return self

    def _run(self) -> None:
        while not self._ended.wait(self.pause * PULSE):
            with self._lock:
                line = self._text()
                if line is not None and not self._ended.is_set():
                    self._write(line)

    def _text(self) -> str | None:
        """Return what to write now; None leaves what stands there."""
        raise NotImplementedError

    def _write(self, line: str) -> None:
        """Write a line in the place of the one before."""
        if line or self._width:
            self._stream.write("\r" + " " * self._width + "\r" + line)
            self._stream.flush()
        self._width = len(line)


def _awaited(what: str, seconds: float) -> str:
    """Return what is waited for, a compilation if one is under way, and for how long; empty if it is nothing."""
    what = f"compiling {compiling.under_way()}" if compiling.under_way() else what
    return f"{what} ... {seconds:.0f} s" if what else ""


class Passing(_Line):
    """A line on the error stream about a computation that takes longer than a second; it goes at the end.

    Within a `with` block; it is the function that the computation reports to.
    """

    def __init__(self, label: str) -> None:
        super().__init__()
        self._label, self._news = label, ""

    def __enter__(self) -> Self:
        self._began, self._computed = perf_counter(), compiling.clock()
        compiling.announcing.append(self._clear)
        return super().__enter__()

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        compiling.announcing.remove(self._clear)
        self._clear()

    def __call__(self, done: int, total: int | None, partial: Any) -> None:
        """Note how far the computation is."""
        part = f"{done}" if total is None else f"{100 * done / max(total, 1):.0f} % of {total}"
        left = remaining(done, total, compiling.clock() - self._computed)
        self._news = ", ".join(filter(None, (part, left)))

    def _text(self) -> str | None:
        seconds = perf_counter() - self._began
        if seconds < compiling.SILENT:
            return None
        if self._news and not compiling.under_way():
            return f"{self._label}: {self._news}, after {seconds:.0f} s"
        return _awaited(self._label, seconds)

    def _clear(self) -> None:
        with self._lock:
            self._write("")


def _bar() -> Progress:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[detail]}"),
        TextColumn("{task.fields[left]}"),
        console=Console(file=sys.stderr),
    )


# On the command line


SECONDS = 5.0  # between plain lines about work of unknown length
PULSE = 0.5  # s of silence on a terminal, after which it shows what one waits for
SWITCH = 1e-4  # s, after which a thread in Python gives way to one that is urgent; the usual 5 ms add up


class Meter:
    """The callable that a command's computation reports to, within a `with` block.

    `keeps`: whether finished work is kept after an interruption. `patience`: the longest time in s that a stopped sweep
    waits for running cells. `finish` completes the writing to a store before the process ends at once. `opening` prints
    the text before the first report, or at the end of a sweep that reported nothing.
    """

    def __init__(
        self,
        label: str,
        *,
        keeps: bool = True,
        patience: float | None = None,
        finish: Callable[[], None] | None = None,
        opening: Callable[[], None] | None = None,
    ) -> None:
        self.label, self.keeps, self.patience, self.finish = label, keeps, patience, finish
        self._opening = compiling.before_compiling(opening or (lambda: None))
        self.stopped = False  # a sweep reads it between two reports, too
        self._bar: Progress | None = None
        self._shown = 0.0
        self._previous_handler: Any = None
        self._end: SimpleQueue[bool] = SimpleQueue()  # a signal may break into anything but its `put`

    def __enter__(self) -> Self:
        self._computed = compiling.clock()
        self._open = self._opening.__enter__()
        if threading.current_thread() is threading.main_thread():
            threading.Thread(target=self._end_at_once, daemon=True).start()
            self._previous_handler = signal.signal(signal.SIGINT, self._stop)
        if sys.stderr.isatty():
            self._bar = _bar()
            self._task = self._bar.add_task(self.label, total=None, detail="", left="")
            self._bar.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._bar is not None:
            self._bar.stop()
        if self._previous_handler is not None:
            signal.signal(signal.SIGINT, self._previous_handler)
            self._end.put(False)
        self._opening.__exit__(kind, error, at)  # if nothing was left to report
        self.seconds = compiling.clock() - self._computed

    def __call__(self, done: int, total: int | None, partial: Any) -> bool:
        """Show how far the computation is; return whether to continue."""
        self._open()
        seconds = compiling.clock() - self._computed
        impacts = getattr(partial, "attrs", {}).get("impacts_computed", 0)
        detail = partial if isinstance(partial, str) else speed(impacts, seconds)
        if self._bar is not None:
            shown, left = "" if total is None else detail, remaining(done, total, seconds)
            self._bar.update(self._task, completed=done, total=total, detail=shown, left=left)
        elif total is None:
            if seconds >= self._shown + SECONDS:
                self._shown = seconds
                print(f"{self.label}: {done}, {duration(seconds)}", file=sys.stderr, flush=True)
        elif done / total >= self._shown + 0.1 or done == total > self._shown * total:
            self._shown = done / total
            left = remaining(done, total, seconds) if done < total else duration(seconds)
            parts = [f"{self.label}: {100 * done / total:.0f} % of {total}", detail, left]
            print(", ".join(part for part in parts if part), file=sys.stderr, flush=True)
        return not self.stopped

    def _stop(self, signal_number: int, frame: FrameType | None) -> None:
        # os.write: a print here could meet one that the signal broke into
        if not self.stopped:
            self.stopped = True
            sys.setswitchinterval(SWITCH)
            kept = "; what is finished is kept" if self.keeps else ""
            limit = f", running cells are abandoned after {self.patience:.0f} s" if self.patience else ""
            os.write(2, f"\nstopping{limit}{kept} (Ctrl-C again to stop at once)\n".encode())
        elif self.keeps:  # Python would wait for a sweep's threads
            self._end.put(True)
        else:
            raise KeyboardInterrupt

    def _end_at_once(self) -> None:
        """Wait, in a thread of its own, for the second Ctrl-C; then end the process."""
        if self._end.get():
            if self.finish is not None:
                self.finish()
            kept = "finished tiles are kept" if self.finish else "nothing was kept"
            os.write(2, f"\nvibroimpact: stopped at once, {kept}\n".encode())
            os._exit(130)


class Pulse(_Line):
    """A temporary line on a terminal that shows what the program is waiting for, until something else is written.

    It is used in a `with` block, and removed before anything else is written to either stream.
    """

    latest: Pulse | None = None
    pause = 0.5

    def __init__(self) -> None:
        super().__init__()
        self._streams = sys.stdout, sys.stderr
        self._silent = perf_counter()
        self.waits_for = "loading"  # nothing where others are waited for, or where a line of theirs is being written

    def __enter__(self) -> Self:
        Pulse.latest = self
        sys.stdout, sys.stderr = (cast("TextIO", _Watched(stream, self)) for stream in self._streams)
        return super().__enter__()

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self.make_way()
        Pulse.latest = None
        sys.stdout, sys.stderr = self._streams

    def make_way(self, text: str = "") -> None:
        """Remove the line, because a text is being written."""
        with self._lock:
            self._write("")
            self._silent, self.waits_for = perf_counter(), "computing" if text.endswith(("\n", "\r")) else ""

    def _text(self) -> str | None:
        silent = perf_counter() - self._silent
        return _awaited(self.waits_for, silent) if silent > PULSE else None


def wait_for_others() -> None:
    """Show no temporary line until something is written: another process is being waited for."""
    if Pulse.latest is not None:
        Pulse.latest.waits_for = ""


class _Watched:
    """A stream of the terminal that removes the temporary line before anything is written to it."""

    def __init__(self, stream: TextIO, pulse: Pulse) -> None:
        self._stream, self._pulse = stream, pulse

    def write(self, text: str) -> int:
        self._pulse.make_way(text)
        return self._stream.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def interruptible() -> Iterator[None]:
    """Make Ctrl-C end the process at once while it compiles: Python would wait for the compiler, for seconds."""
    reads, writes = os.pipe()
    if os.name != "nt":  # there any pipe will do, and older Pythons cannot change one
        os.set_blocking(writes, False)

    def watch() -> None:
        while byte := os.read(reads, 1):
            if byte[0] == signal.SIGINT and (what := compiling.under_way()):
                os.write(2, f"\nvibroimpact: interrupted while compiling {what}\n".encode())
                os._exit(130)
        os.close(reads)

    threading.Thread(target=watch, daemon=True).start()
    before = signal.set_wakeup_fd(writes, warn_on_full_buffer=False)
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        os.close(writes)


def duration(seconds: float) -> str:
    """Return a time in the units that suit it.

    Examples
    --------
    >>> duration(0.0312), duration(42.4), duration(110.0), duration(8000.0)
    ('0.031 s', '42 s', '1 min 50 s', '2 h 13 min')
    """
    if seconds < 59.5:
        return f"{seconds:.2g} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def remaining(done: int, total: int | None, seconds: float) -> str:
    """Return the estimated remaining time, at the rate so far; empty if unknown."""
    return f"{duration(seconds * (total - done) / done)} left" if done and total and done < total else ""


def speed(impacts: int, seconds: float) -> str:
    """Return the rate of impacts as text; empty if none were counted."""
    if impacts <= 0 or seconds <= 0.0:
        return ""
    rate = impacts / seconds
    return f"{rate / 1e6:.3g} million impacts/s" if rate >= 1e6 else f"{rate:.3g} impacts/s"
