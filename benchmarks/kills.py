"""What is lost by SIGKILL at random moments: `python -m benchmarks.kills [kills] [seed] [kind ...]`, POSIX only.

A story is one command in a folder of its own: killed again and again, then left alone. Half of the kills come at a
random moment; the others before an operation on files, late ones and renames of outputs more often.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, suppress
from dataclasses import dataclass, replace
from importlib import import_module
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from numcodecs import Zstd

PLANE = "--x omega=0.3:4:31 --y gap=-2:1.5:20 --indices std,n_periods"
TILED = f"map {PLANE} --tile 36"
OPERATIONS = {"open", "os.rename", "os.remove", "os.rmdir", "os.mkdir"}


class Kind(NamedTuple):
    """A kind of run that writes; its former output is that of other `--sample-impacts`, or of another `--level`."""

    share: int  # of a thousand kills
    words: str
    over: bool = False  # whether a former output is overwritten
    former: str = "--sample-impacts 60"


KINDS = {
    "map.zarr": Kind(220, f"{TILED} --workers 2 --out run.zarr"),
    "map.zarr, overwriting": Kind(220, f"{TILED} --workers 2 --out run.zarr", over=True),
    "refined.zarr": Kind(140, "map --x omega=1.5:3.5:13 --y mass=0.5:1.5:13 --refine 2 --workers 2 --out run.zarr"),
    "cluster.zarr": Kind(20, f"{TILED} --cluster local:2 --out run.zarr"),
    "map.nc, overwriting": Kind(110, f"map {PLANE} --workers 2 --out run.nc", over=True),
    "map.csv": Kind(90, f"map {PLANE} --workers 2 --out run.csv"),
    "map.mat, overwriting": Kind(70, f"map {PLANE} --workers 2 --out run.mat", over=True),
    "map.png, overwriting": Kind(80, "map --x omega=0.3:4:31 --y gap=-2:1.5:20 --out run.png", over=True),
    "reproduce, overwriting": Kind(50, "reproduce --quick --out run", over=True, former="--level 0.06"),
}


def warm_up() -> None:
    """Load kernels and libraries in this thread alone: a process with threads must not fork."""
    for name in (
        "dask.array",
        "distributed",
        "filelock",
        "h5netcdf.legacyapi",
        "matplotlib.pyplot",
        "pandas",
        "scipy.io",
    ):
        import_module(name)
    import xarray as xr

    import vibroimpact as vi
    from vibroimpact import cli, execution
    from vibroimpact.backends import ImpactWindow, Measurement
    from vibroimpact.execution import store, threads
    from vibroimpact.request import Request
    from vibroimpact.studies.lee import pipeline

    xr.backends.list_engines(), store, pipeline
    with redirect_stderr(StringIO()):
        cli.main(["map", "--x", "omega=1:2:0"])
    # Small parts, so that a run has many; a study of a second.
    threads.SHARE, execution.LISTED = 72, 100
    small = {"map_points": 6, "map_impacts": 30, "columns": 10, "looks": 5, "orbit_impacts": 50, "dpi": 30}
    pipeline.QUICK = replace(pipeline.QUICK, column_impacts=10, column_transient=10, **small)
    pipeline.CLAIMS, plates = pipeline.CLAIMS[:1], pipeline.plates
    pipeline.plates = lambda results, level: [plate for plate in plates(results, level) if plate.number in (1, 2, 11)]
    measured = Measurement(ImpactWindow(0, 10), indices=("std", "n_periods"))
    for axes in ({"omega": np.array([1.0, 2.0])}, {"omega": np.linspace(0.3, 4.0, 40)}):
        threads.compute_here(Request(vi.ImpactOscillator(), axes, measured), slice(len(axes["omega"])))
    assert threading.active_count() == 1


# A run, and its death


@dataclass
class Watch:
    """Counts the operations on files of this process; kills it before number `last`, or that rename of an output."""

    folder: str
    last: int = 0
    renaming: bool = False
    count: int = 0
    renames: int = 0

    def __call__(self, event: str, given: tuple[Any, ...]) -> None:
        if event not in OPERATIONS or not isinstance(given[0], (str, bytes, os.PathLike)):
            return
        places = [os.path.abspath(os.fsdecode(name)) for name in given[: 1 + (event == "os.rename")]]
        writes = event != "open" or given[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT)
        if writes and places[0].startswith(self.folder + os.sep):
            self.count += 1
            self.renames += event == "os.rename" and self.folder in map(os.path.dirname, places)
            if self.last == (self.renames if self.renaming else self.count):
                os.kill(os.getpid(), signal.SIGKILL)


def begun(words: list[str], folder: Path, last: int = 0, renaming: bool = False, count_into: Path | None = None) -> int:
    """Run the command line in a copy of this process, which has a group of its own; return its number."""
    child = os.fork()
    if child:
        return child
    code = 1
    try:
        os.setpgid(0, 0)
        os.chdir(folder)
        said = os.open(folder.with_suffix(".log"), os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(said, 1), os.dup2(said, 2)
        watch = Watch(str(folder), last, renaming)
        sys.addaudithook(watch)
        sys.argv = ["vibroimpact", *words]
        from vibroimpact.cli import main

        code = main()
        if count_into:
            count_into.write_text(json.dumps([watch.count, watch.renames]))
    finally:
        os._exit(code)


def ended(child: int) -> int:
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


# What lies there


def content(place: Path) -> dict[str, bytes]:
    """Return the files of an output that have to be equal: neither times that tiles took nor dates."""
    if place.is_file():
        return {"": place.read_bytes()[116 * (place.suffix == ".mat") :]}  # where a .mat says when it was made
    files = {str(file.relative_to(place)): file.read_bytes() for file in sorted(place.rglob("*")) if file.is_file()}
    left_out = ("progress/tiles/c/", "progress/tiles/lock", "report.html", "study.json")
    return {name: held for name, held in files.items() if not name.startswith(left_out)}


def tiles(store: Path) -> dict[int, int]:
    """Return the tiles recorded as done, and when the status of each was written."""
    root = store / "progress/cells" if (store / "progress/cells").exists() else store
    described = store / "progress/tiles/zarr.json", root / "status/zarr.json"
    if not all(file.exists() for file in described):
        return {}
    (rows, columns), _ = _sides(described[0])
    shape, chunk = _sides(described[1])
    grid = [-(-cells // side) for cells, side in zip(shape, chunk, strict=True)]
    records = np.zeros((rows, columns), np.int64)
    for file in (store / "progress/tiles/c").glob("*/0"):
        held = np.frombuffer(Zstd().decode(file.read_bytes()), np.int64).reshape(-1, columns)
        first = int(file.parent.name) * len(held)
        records[first : first + len(held)] = held[: rows - first]
    files = {n: root.joinpath("status/c", *map(str, np.unravel_index(n, grid))) for n in np.flatnonzero(records[:, 0])}
    return {int(number): file.stat().st_mtime_ns for number, file in files.items()}


def _sides(description: Path) -> tuple[list[int], list[int]]:
    array = json.loads(description.read_text())
    return array["shape"], array["chunk_grid"]["configuration"]["chunk_shape"]


def in_flight(store: Path, done: int) -> int:
    """Return how many tiles lie there in part or whole without a record."""
    root = store / "progress/cells" if (store / "progress/cells").exists() else store
    arrays = [place for place in root.glob("*/c") if place.parent.name not in ("omega", "gap", "mass")]
    chunks = {str(file.relative_to(place)) for place in arrays for file in place.rglob("*") if file.is_file()}
    return len({name.partition(".")[0] for name in chunks}) - done


# Stories


class Reference(NamedTuple):
    """What an undisturbed run leaves, and what it takes; and the former output."""

    new: dict[str, bytes]
    old: dict[str, bytes]
    former: Path
    seconds: float
    operations: int
    renames: int  # of outputs, among them


def reference(kind: Kind, folder: Path) -> Reference:
    """Run a kind undisturbed, with its former output made first."""
    outputs, counted, seconds = [], folder / "count", 0.0
    for name, more in (("old", kind.former), ("new", ""), ("again", "")):
        place = folder / name
        place.mkdir()
        output = place / kind.words.split()[-1]
        if kind.over and name != "old":
            _copy(folder / "old" / output.name, output)
        began = time.perf_counter()
        code = ended(
            begun([*kind.words.split(), *more.split(), *["--overwrite"] * kind.over], place, count_into=counted)
        )
        seconds = time.perf_counter() - began
        assert not code, place.with_suffix(".log").read_text()
        outputs.append(output)
    old, new, again = map(content, outputs)
    assert new == again != old
    return Reference(new, old, outputs[0], seconds, *json.loads(counted.read_text()))


def _copy(one: Path, other: Path) -> None:
    shutil.copytree(one, other) if one.is_dir() else shutil.copy(one, other)


class Story:
    """One command in a folder of its own: killed some times, then left alone; `faults` is what should not be."""

    def __init__(self, kind: Kind, known: Reference, folder: Path, chance: random.Random) -> None:
        self.kind, self.known, self.folder, self.chance = kind, known, folder, chance
        self.out = folder / kind.words.split()[-1]
        self.kills = self.writing = self.lost = self.aside = 0
        self.faults: list[str] = []
        self.store, self.done = 0, dict[int, int]()  # the number of its folder, which a new name does not change

    def tell(self, turns: int) -> None:
        """Run, kill and look, up to so many times, until a run has ended by itself."""
        self.folder.mkdir()
        if self.kind.over:
            _copy(self.known.former, self.out)
        groups, code = [], -signal.SIGKILL
        while code == -signal.SIGKILL:
            child, code = self._run(killed=self.kills < turns)
            groups.append(child)
            if code == -signal.SIGKILL:
                self.kills += 1
                self._look()
        for group in groups:  # workers of a cluster may survive their client for a while
            with suppress(ProcessLookupError):
                os.killpg(group, signal.SIGKILL)
        self._look_at_the_end(code)

    def _run(self, *, killed: bool) -> tuple[int, int]:
        words = self.kind.words.split()
        if self.kind.over or (self.out.exists() and self.out.suffix != ".zarr"):
            words.append("--overwrite")
        by_operation, renaming, last = killed and self.chance.random() < 0.5, False, 0
        if by_operation:
            renaming = self.chance.random() < 0.3
            share = 1.0 - self.chance.random() ** 2 if not self.done else self.chance.random()
            last = 1 + int((self.known.renames if renaming else self.known.operations) * share)
        child = begun(words, self.folder, last, renaming)
        if killed and not by_operation:
            wait = self.chance.uniform(0.0, 1.1 * self.known.seconds)
            if self.out.suffix != ".zarr" and self.chance.random() < 0.5:
                self._await_scratch()
                wait = self.chance.uniform(0.0, 0.1)
            time.sleep(wait)
            group = "--cluster" in words and self.chance.random() < 0.5
            (os.killpg if group else os.kill)(child, signal.SIGKILL)
        return child, ended(child)

    def _await_scratch(self) -> None:
        end, before = time.monotonic() + 2 * self.known.seconds, set(self.folder.glob(".*.part"))
        while time.monotonic() < end and set(self.folder.glob(".*.part")) <= before:
            time.sleep(0.001)

    def _must(self, so: bool, otherwise: str) -> None:
        if not so:
            self.faults.append(f"after {self.kills} kills {otherwise}")

    def _look(self) -> None:
        """Look at what a kill has left."""
        known, found = self.known, content(self.out) if self.out.exists() else None
        half = [file for ending in ("part", "partial", "old") for file in self.folder.rglob(f"*.{ending}")]
        if self.kind.over:
            from vibroimpact.files import aside_hint

            self.aside += found is None
            self._must(
                found in (known.old, known.new) or (found is None and bool(aside_hint(self.out))), "neither is whole"
            )
            former = list(map(content, self.folder.glob(".*.old")))
            self._must(found is not None or known.old in former or known.new in former, "the old is lost")
        elif self.out.suffix != ".zarr":
            self._must(found in (None, known.new), "it is not whole")
        half += self._look_into_stores() if self.out.suffix == ".zarr" else []
        self.writing += bool(half)

    def _look_into_stores(self) -> list[Path]:
        """Look at stores that are begun or done; return those with tiles in flight."""
        places = [self.out, self.out.with_name("run.partial.zarr")]
        stores = {place.stat().st_ino: place for place in places if place.exists() and content(place) != self.known.old}
        flying = []
        for number, place in stores.items():
            done, before = tiles(place), self.done if number == self.store else {}
            self._must(before.items() <= done.items(), "tiles are lost, or were computed again")
            chunks = {name: held for name, held in content(place).items() if "/c/" in name and name[-8:] != ".partial"}
            self._must(chunks.items() <= self.known.new.items(), "there are other bits")
            if lost := in_flight(place, len(done)):
                self.lost = max(self.lost, lost)
                flying.append(place)
        whole = self.known.new in map(content, [*places[:1], *self.folder.glob(".*.old")])
        self._must(self.store in (0, *stores) or whole, "a store is lost")
        self.store, place = list(stores.items())[-1] if stores else (0, None)
        self.done = tiles(place) if place else {}
        return flying

    def _look_at_the_end(self, code: int) -> None:
        """Look at what the last run has left, which was not killed."""
        self._must(code == 0, f"it ends with {code}: {self.folder.with_suffix('.log').read_text()[-300:]}")
        self._must(self.out.exists() and content(self.out) == self.known.new, "the result differs")
        if self.out.suffix == ".zarr":
            self._look_into_stores()
        for left in self.folder.iterdir():
            whole = self.kind.over and left.suffix == ".old" and content(left) in (self.known.old, self.known.new)
            self._must(left == self.out or whole, f"{left.name} is left")


def stories(kind: Kind, kills: int, seed: str, folder: Path) -> Iterator[Story]:
    """Yield stories until there were so many kills."""
    folder.mkdir()
    known, chance, number = reference(kind, folder), random.Random(seed), 0
    while kills > 0:
        story = Story(kind, known, folder / str(number), chance)
        story.tell(min(chance.randint(2, 9), kills))
        kills -= story.kills
        number += 1
        yield story
        if not story.faults:
            shutil.rmtree(story.folder)


def run(kills: int, seed: int, names: list[str], tell: Callable[[str], Any] = print) -> list[str]:
    """Kill so many times in all; tell the rows of the table, and return the faults."""
    warm_up()
    faults = []
    shares = sum(KINDS[name].share for name in names)
    tell("| kind of run | kills | while writing | tiles lost in one | old set aside | stories | equal bits |")
    tell("|---|---:|---:|---:|---:|---:|---:|")
    with TemporaryDirectory(ignore_cleanup_errors=True) as place:
        for name in names:
            kind = KINDS[name]
            told = list(stories(kind, round(kills * kind.share / shares), f"{seed} {name}", Path(place, name)))
            sums = [sum(getattr(story, what) for story in told) for what in ("kills", "writing", "aside")]
            lost = max(story.lost for story in told) if "zarr" in name else "all"
            equal = sum(not story.faults for story in told)
            tell(f"| {name} | {sums[0]} | {sums[1]} | {lost} | {sums[2]} | {len(told)} | {equal} |")
            faults += [f"{name}, {story.folder.name}: {fault}" for story in told for fault in story.faults]
    return faults


if __name__ == "__main__":
    total, seed, *names = [*sys.argv[1:], *["1000", "1"][len(sys.argv) - 1 :]]
    sys.stdout.reconfigure(line_buffering=True)
    found = run(int(total), int(seed), names or list(KINDS))
    print("\n".join(found))
    sys.exit(bool(found))
