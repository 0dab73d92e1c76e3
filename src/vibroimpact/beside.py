"""A second process that compiles missing kernels for a command, on machines with a second core."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from time import perf_counter, sleep
from typing import TYPE_CHECKING, Any

from vibroimpact import compiling

if TYPE_CHECKING:
    from vibroimpact.model import Model

PATIENCE = 5.0  # s without anything to compile, after which the second process ends

_processes: list[subprocess.Popen[bytes]] = []  # one at most
_latest: list[Callable[[], Model]] = []  # the model of the latest command


def compile_beside(model: Callable[[], Model]) -> None:
    """Start a second process that compiles for this model, once this process begins to compile; both end together."""
    from vibroimpact.execution.threads import worker_count

    _latest[:] = [model]
    if worker_count(None) > 1 and not _processes and _start not in compiling.watching:
        compiling.watching.append(_start)


def _start() -> None:
    if not compiling.under_way():  # called when a compilation ends
        return
    compiling.watching.remove(_start)
    with suppress(Exception):  # such as a law of restitution that cannot be pickled: this process compiles alone
        pickled = pickle.dumps(_latest[0]())
        streams: Any = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "bufsize": 0}
        process = subprocess.Popen([sys.executable, "-P", "-m", __name__], stdin=subprocess.PIPE, **streams)
        _processes.append(process)
        if process.stdin:  # left open: the second process ends when this one does
            process.stdin.write(pickled)


def main() -> None:
    """Run short computations with the model read from standard input, then compile other kernels that may be needed."""
    model = pickle.load(sys.stdin.buffer)
    threading.Thread(target=_end_with_the_other, daemon=True).start()
    compiling.SILENT = float("inf")
    import vibroimpact as vi
    from vibroimpact.kernels.shared import claims, deferred

    tried = set(deferred.noted())  # noted by earlier commands, which may not have needed them

    def compile_next() -> bool:
        new = [part for part in deferred.noted() if part not in tried and deferred.is_general(part)]
        if new:
            tried.add(new[0])
            deferred.compile_part(new[0])
        return bool(new)

    claims.meanwhile.append(compile_next)
    with suppress(ValueError):  # such as a model without a frequency
        vi.impact_section(model)
        vi.parameter_map(model, omega=[model.omega], workers=1)
    end = perf_counter() + PATIENCE
    while perf_counter() < end:
        if compile_next():
            end = perf_counter() + PATIENCE
        sleep(0.1)
    os._exit(0)  # the thread is still reading


def _end_with_the_other() -> None:
    sys.stdin.buffer.read()
    os._exit(0)


if __name__ == "__main__":
    main()
