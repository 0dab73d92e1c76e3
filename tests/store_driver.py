"""Processes that sweep into a store and come to harm: run as `python store_driver.py COMMAND FOLDER ...`."""

import json
import os
import random
import re
import resource
import signal
import sys
import time
from pathlib import Path

import filelock
import numpy as np
import xarray as xr

import vibroimpact as vi
from vibroimpact.backends import ImpactWindow, Measurement
from vibroimpact.backends.cpu import CpuBackend
from vibroimpact.cli import main
from vibroimpact.execution import base, layout, threads
from vibroimpact.execution.layout import StoreBusy
from vibroimpact.execution.store import SweepStore
from vibroimpact.request import Request

OSC = vi.ImpactOscillator()
# Tiles at the far edges are smaller; two kinds of numbers; many kinds of motions.
STUDY = {
    "omega": np.linspace(0.3, 4.0, 31),
    "gap": np.linspace(-2.0, 1.5, 20),
    "indices": ("std", "n_periods"),
    "sample_impacts": 100,
}
TILE, TILES = 36, 24


def sweep(store, **options):
    """Run the study into a store, some tiles at a time; return it."""
    threads.SHARE = min(threads.SHARE, TILE)
    return vi.parameter_map(OSC, store=store, tile=TILE, workers=2, **STUDY | options)


def warm_up():
    """Load kernels and libraries, in this thread alone: a process with threads must not fork."""
    xr.Variable("x", [0.0]), xr.backends.list_engines(), filelock.FileLock
    axes = {name: STUDY[name][:2] for name in ("omega", "gap")}
    threads.compute_here(Request(OSC, axes, Measurement(ImpactWindow(0, 10), indices=STUDY["indices"])), slice(4))


def slow_down(seconds):
    """Let every tile take a while longer, in which its thread hears no signal."""
    threads.SHARE, share = TILE // 2, CpuBackend.share

    def slowly(backend, cells, asked):
        work = share(backend, cells, asked)

        def slow_work(stopped):
            time.sleep(seconds)
            yield from work(stopped)

        return slow_work

    CpuBackend.share = slowly


def forked(job):
    """Run a job in a copy of this process; return the copy's number. Ctrl-C waits until the copy can tell of it."""
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    child = os.fork()
    if child:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        return child
    code = 1
    try:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        job()
        code = 0
    except KeyboardInterrupt:
        code = 130
    except StoreBusy:
        code = 3
    finally:
        os._exit(code)


def ended(child):
    """Wait for a child; return its exit code, negative for a signal."""
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


REFINED = {"omega": np.linspace(1.5, 3.5, 13), "mass": np.linspace(0.5, 1.5, 13), "sample_impacts": 200}


def refined(store, **options):
    """Refine a plane into a store, kept in chunks of a hundred cells; return it."""
    base.LISTED = 100
    return vi.parameter_map(OSC, refine=2, store=store, **{"workers": 2} | REFINED | options)


def harm(folder, wanted, name, job):
    """Sweep into one store after the other, each ended by a signal again and again, then left alone."""
    chance, sent, run = random.Random(20), signal.Signals[name], {"sweep": sweep, "refined": refined}[job]
    began = time.perf_counter()
    code = ended(forked(lambda: run(folder / "whole.zarr")))
    whole = time.perf_counter() - began
    stores, codes, unborn = 0, [], 0
    while len([hit for hit in codes if hit]) < int(wanted):
        store = folder / f"{stores}.zarr"
        for turn in range(8):
            child = forked(lambda store=store: run(store))
            # The first while the store is being made, but once the copy of this process runs.
            early, late = [(0.03, 0.08), (0.03, 0.35)][turn] if turn < 2 else (0.25, 0.9)
            time.sleep(whole * chance.uniform(early, late))
            os.kill(child, sent)
            codes.append(ended(child))
            unborn += not store.exists()
            if not codes[-1]:
                break
        code |= ended(forked(lambda store=store: run(store)))
        stores += 1
    return {"stores": stores, "codes": codes, "unborn": unborn, "code": code}


def race(folder, times):
    """Let two processes begin the same store at the same moment, again and again."""

    def run(store, told):
        calls = []
        try:
            sweep(store, progress=lambda *news: calls.append(news))
        finally:
            os.write(told, json.dumps(len(calls) - 1).encode() + b"\n")

    outcomes = []
    for number in range(int(times)):
        read, told = os.pipe()
        children = [forked(lambda told=told, number=number: run(folder / f"{number}.zarr", told)) for _ in range(2)]
        codes = sorted(map(ended, children))
        os.close(told)
        with os.fdopen(read) as counts:
            outcomes.append({"codes": codes, "computed": sum(max(json.loads(line), 0) for line in counts)})
    return outcomes


def interrupted(folder):
    """Sweep slowly until Ctrl-C; tell whether anything is written after control is back."""
    slow_down(0.4)
    try:
        sweep(folder, progress=lambda *news: print("tile", flush=True))
    except KeyboardInterrupt:
        store = SweepStore(folder)
        records = store.records()
        with store.writing():  # another may write at once
            time.sleep(1.0)
        return {"done": int((records[:, 0] > 0).sum()), "quiet": bool(np.array_equal(records, store.records()))}
    return {}


def slow(folder):
    """Sweep slowly, telling when each tile is done."""
    slow_down(0.2)
    sweep(folder, progress=lambda *news: print("tile", flush=True))
    return {}


def clock(folder):
    """Sweep while the clock on the wall jumps back and forth by years."""
    chance = random.Random(5)
    time.time = lambda: chance.uniform(-1e9, 4e9)
    time.time_ns = lambda: int(1e9 * time.time())
    calls = []
    sweep(folder, progress=lambda *news: calls.append(news) or len(calls) < 6)
    for file in folder.rglob("*"):
        os.utime(file, (4e9, 4e9))
    sweep(folder)
    return {}


def small_files(folder):
    """Sweep into a store that stands, where no file may grow beyond a few bytes."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (40, 40))
    try:
        sweep(folder)
    except OSError as error:
        return {"errno": error.errno, "told": error.strerror}
    return {}


def large(folder):
    """Begin a map of 16 million cells; tell the memory that it took at most, in MB."""
    sides = {"omega": np.linspace(0.3, 4.0, 4000), "mass": np.linspace(0.5, 2.0, 4000)}
    calls = []
    dataset = vi.parameter_map(
        OSC, **sides, sample_impacts=20, store=folder, progress=lambda *news: calls.append(news) or len(calls) < 6
    )
    return {"MB": most_memory(), "missing": dataset.attrs["cells_missing"]}


def most_memory():
    """Return the most memory in MB that this process held; on Linux `getrusage` counts what its parent held too."""
    if sys.platform == "linux":
        return int(re.search(r"VmHWM:\s+(\d+)", Path("/proc/self/status").read_text())[1]) / 1024.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0**2


def typed(folder, patience, *words):
    """Run the command line as typed, with another patience for what runs when it is stopped, and with slow disks."""
    threads.GRACE = float(patience)
    keeping = layout._keeping

    def slow_array(array):
        time.sleep(0.1)
        return keeping(array)

    layout._keeping = slow_array
    os.chdir(folder)
    sys.argv = ["vibroimpact", *words]
    sys.exit(main())


COMMANDS = {job.__name__: job for job in (harm, race, interrupted, slow, clock, small_files, large, typed)}

if __name__ == "__main__":
    command, place, *rest = sys.argv[1:]
    warm_up()
    print(json.dumps(COMMANDS[command](Path(place), *rest)), flush=True)
