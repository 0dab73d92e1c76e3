"""What is being compiled: announced on the error stream as soon as it begins, since it may take most of a minute.

What is compiled is kept for later processes, so that this happens once on a machine.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter

SILENT = 1.0  # s: what takes less is not announced

watching: list[Callable[[], None]] = []  # called when something begins to be compiled, and when it is

_first: list[Callable[[], None]] = []
_begun: list[tuple[str, float]] = []
_spent = 0.0


@contextmanager
def before_compiling(announce: Callable[[], None]) -> Iterator[Callable[[], None]]:
    """Yield what calls `announce` unless that was called: as soon as something is compiled, or at the end."""
    uncalled = [announce]

    def once() -> None:
        while uncalled:
            uncalled.pop()()

    _first.append(once)
    try:
        yield once
    finally:
        _first.remove(once)
    once()


def begin(what: str, seconds: float, kept: str) -> None:
    """Say what is compiled from now on, about how long that takes, and whether it is kept."""
    _begun.append((what, perf_counter()))
    if seconds < SILENT or len(_begun) > 1:
        return
    for announce in list(_first):
        announce()
    # By way of `sys.stderr` as it is now, so that it does not run into a bar.
    print(f"compiling {what}: about {seconds:.0f} s, {kept}", file=sys.stderr, flush=True)
    for notify in list(watching):
        notify()


def end() -> None:
    """Note that what was begun last is compiled."""
    global _spent
    _, began = _begun.pop()
    if not _begun:
        _spent += perf_counter() - began
        for notify in list(watching):
            notify()


def clock() -> float:
    """Return the seconds of a clock that stands still while this process compiles: limits and rates go by it."""
    return (_begun[0][1] if _begun else perf_counter()) - _spent


def under_way() -> str:
    """Return the kernel that is being compiled; nothing if none is."""
    return _begun[0][0] if _begun else ""
