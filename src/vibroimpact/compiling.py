"""Announcements of what is being compiled, on the error stream, since it may take most of a minute.

Compiled code is kept for later processes, so that each machine compiles it once.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from concurrent.futures import Executor

Result = TypeVar("Result")

SILENT = 1.0  # s: shorter compilations are not announced

watching: list[Callable[[], None]] = []  # called when a compilation begins, and when it ends

compilers: list[Executor] = []  # the last one compiles for all threads: others wait for what one of low priority needs

announcing: list[Callable[[], None]] = []  # called before a compilation is announced
_begun: list[tuple[str, float]] = []
_spent = 0.0


@contextmanager
def before_compiling(announce: Callable[[], None]) -> Iterator[Callable[[], None]]:
    """Call `announce` once: when a compilation begins, when the yielded function is called, or at the end."""
    uncalled = [announce]

    def once() -> None:
        while uncalled:
            uncalled.pop()()

    announcing.append(once)
    try:
        yield once
    finally:
        announcing.remove(once)
    once()


def begin(what: str, seconds: float, kept: str) -> None:
    """Announce a compilation that begins now, its approximate duration, and whether its result is kept."""
    _begun.append((what, perf_counter()))
    if seconds < SILENT or len(_begun) > 1:
        return
    for announce in list(announcing):
        announce()
    # `sys.stderr` is looked up now, since a progress bar may have replaced it.
    print(f"compiling {what}: about {seconds:.0f} s, {kept}", file=sys.stderr, flush=True)
    for notify in list(watching):
        notify()


def end() -> None:
    """Note that the compilation begun last has ended."""
    global _spent
    _, began = _begun.pop()
    if not _begun:
        _spent += perf_counter() - began
        for notify in list(watching):
            notify()


def clock() -> float:
    """Return the time in s of a clock that stops while this process compiles; limits and rates use it."""
    return (_begun[0][1] if _begun else perf_counter()) - _spent


def under_way() -> str:
    """Return the name of the kernel that is being compiled; an empty string if there is none."""
    return _begun[0][0] if _begun else ""


def carried_out(compilation: Callable[[], Result]) -> Result:
    """Return the result of a compilation, by another thread if there is one that compiles for all."""
    return compilers[-1].submit(compilation).result() if compilers else compilation()
