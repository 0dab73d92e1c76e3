"""Ctrl-C while something is compiled: kept until Python can feel it.

No exception can pass through a kernel that waits for one of its parts, and what LLVM calls back loses it, and the
compiled code with it.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import CodeType, FrameType

LATER = 0.1  # s after which a kept signal is raised again

within_kernels: list[CodeType] = []  # functions that kernels call, in which nothing may be raised

_kept: list[int] | None = None  # signals that came while something is compiled


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Keep Ctrl-C, which is felt soon after; within another such block, and in other threads, do nothing."""
    global _kept
    if _kept is not None or threading.current_thread() is not threading.main_thread():
        yield
        return
    _kept = kept = []
    before = signal.signal(signal.SIGINT, lambda number, frame: kept.append(number))
    before = signal.SIG_DFL if before is None else before

    def felt(number: int, frame: FrameType | None) -> None:
        if any(calling.f_code in within_kernels for calling in _callers(frame)):
            _raise_later(number)
            return
        signal.signal(signal.SIGINT, before)
        signal.raise_signal(number)

    try:
        yield
    finally:
        _kept = None
        signal.signal(signal.SIGINT, felt if kept else before)
        if kept:
            _raise_later(kept[0])


def _callers(frame: FrameType | None) -> Iterator[FrameType]:
    """Yield a frame and all that it was called from."""
    while frame is not None:
        yield frame
        frame = frame.f_back


def _raise_later(number: int) -> None:
    """Raise a signal soon, in the main thread where the system can: only this wakes it where it waits for events."""
    send = getattr(signal, "pthread_kill", lambda thread, number: signal.raise_signal(number))
    threading.Timer(LATER, send, [threading.main_thread().ident, number]).start()
