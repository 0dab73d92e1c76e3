"""The commands that work on files and stored maps, and the one that opens the explorer."""

from __future__ import annotations

import os
import shlex
import shutil
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import typer

from vibroimpact.cli import output
from vibroimpact.cli import schema as o
from vibroimpact.cli.endings import REFUSALS, Interrupted, WrongRequest, refusing
from vibroimpact.cli.options import FLAG, PATH, Option, Options, with_options
from vibroimpact.parameters import printable
from vibroimpact.progress import Meter, duration, remaining

if TYPE_CHECKING:
    import xarray as xr

    from vibroimpact.execution.store import SweepStore


@with_options(
    Option("file", "FILE", "A result saved as .zarr or .nc.", flags=(), required=True),
    o.FIGURE_KIND, o.SHOWN, o.INDEX, o.LEVEL, o.SWEEP_FILE, o.OVER, o.OUT, o.PICTURE,
)  # fmt: skip
def plot(options: Options) -> None:
    """Draw a saved result, summarise it as text, or save it in another format.

    For example:

      vibroimpact plot map.zarr --index std --level 0.05 --out map.png --size 8x5
      vibroimpact plot diagram.zarr --sweep sweep.zarr --out figure10.svg
      vibroimpact plot map.zarr --kind motion-map --out names.png
      vibroimpact plot curves.zarr --over map.zarr --out plane.png
      vibroimpact plot map.zarr --out map.csv
    """
    output.check_looks(options)
    if unused := [name for name in ("index", "level") if options[name] is not None and options["out"] is None]:
        raise WrongRequest(f"`--{unused[0]}` needs a figure; add for example --out figure.png")
    with refusing(OSError):
        over = output.read(options, "over")
    dataset = _summarise(options["file"], shown=options["out"] is None)
    if options["out"] is None:
        return
    with _understood(options["file"]):
        output.write(dataset, options, options["out"], over)
    typer.echo(f"wrote {options['out']}")


def _summarise(file: Path, *, shown: bool = True) -> xr.Dataset:
    """Return a saved result that has been understood, with its sentences printed."""
    from vibroimpact.files import load_dataset
    from vibroimpact.report import sentences_of

    with refusing(OSError), _understood(file):
        dataset = load_dataset(file)
        lines = sentences_of(dataset)
    if shown:
        typer.echo("\n".join(map(printable, lines)))
    return dataset


@contextmanager
def _understood(path: Path) -> Iterator[None]:
    """Report a file as damaged if it can be read but lacks the content of its kind of result."""
    try:
        yield
    except (LookupError, TypeError, AttributeError, ArithmeticError, ValueError) as error:
        if "`" in str(error) or str(error).startswith("unknown "):  # of an argument
            raise
        what = f"{type(error).__name__}: {error}"
        raise OSError(f"{str(path)!r} is damaged, or not a result of this package ({what}); make it again") from error


@with_options(
    Option(
        "file",
        "STORE",
        "A map written tile by tile, as a .zarr, or any result saved as .zarr or .nc.",
        flags=(),
        required=True,
    )
)
def info(options: Options) -> None:
    """Progress of a stored map, what it cost and found, and how to continue it; or what a saved result holds.

    For example:

      vibroimpact info map.zarr
      vibroimpact info orbit.nc
    """
    file: Path = options["file"]
    if file.is_file() or _holds_a_result(file):
        _summarise(file)
        return
    typer.echo("\n".join(map(printable, sentences_of_store(file))))


def _holds_a_result(folder: Path) -> bool:
    """Return whether a .zarr is a result saved as a whole, not a map written tile by tile."""
    import json

    from vibroimpact.files.guard import DESCRIPTION, GuardedStore

    with suppress(OSError, ValueError, LookupError, TypeError):
        attributes = json.loads(GuardedStore(folder).content(DESCRIPTION) or b"")["attributes"]
        return "function" in attributes and "study" not in attributes
    return False


@with_options(
    o.FOLDER,
    Option("quick", "", "Coarse grids: the same report in well under a minute.", kind=FLAG),
    o.LEVEL, o.OVERWRITE,
)  # fmt: skip
def reproduce(options: Options) -> None:
    """Every figure and statement of Lee's paper, computed again, as one HTML report.

    For example:

      vibroimpact reproduce --out report --quick
    """
    level = options.value("level")
    from vibroimpact.studies.lee import run

    with Meter("report", keeps=False) as meter:
        try:
            with refusing(*REFUSALS):
                report = run(
                    options["out"], quick=options["quick"], level=level, overwrite=options["overwrite"], progress=meter
                )
        except KeyboardInterrupt as error:
            raise Interrupted(str(error) or "interrupted") from error
    typer.echo(f"wrote {report} ({duration(meter.seconds)})")


@with_options(
    Option(
        "store", "STORE", "A saved map over two or more parameters, .zarr or .nc, to open.", flags=(), kind=PATH
    ),
    Option("port", "N", "Port to listen on; 0 is any free port. (default: the first free one from 5006)"),
    replace(o.USER_MODEL, help="What to show: a model of your own (its file is run), or a ready-made one.", panel=None),
    Option("no_browser", "", "Print the address without opening the page.", kind=FLAG),
    Option("host", "ADDRESS", "Address to listen on, for access from the network. (default: 127.0.0.1)"),
)  # fmt: skip
def explore(options: Options) -> None:
    r"""A page in the browser: change the parameters, see the stability map, click a point, watch its motion.

    Needs the extra \[web]. Nothing is loaded from outside; only this machine
    reaches the page unless --host is given. Ctrl-C ends it.

    For example:

      vibroimpact explore
      vibroimpact explore --model tube.py:shaker
      vibroimpact explore map.zarr --port 8080 --no-browser
    """
    with refusing(OSError):
        from vibroimpact import ImpactOscillator
        from vibroimpact.beside import compile_beside
        from vibroimpact.explorer import explore as serve

        model, name = None, ""
        if options["model"] is not None:
            from vibroimpact.families import load_model

            model, name = load_model(options["model"]), Path(options["model"]).name
        if options["store"] is None:
            compile_beside((model or ImpactOscillator()).at)
        serve(
            options["store"],
            model=model,
            name=name,
            port=options.value("port"),
            host=options["host"] or "127.0.0.1",
            browser=not options["no_browser"],
        )


@with_options(replace(o.CLUSTER, help="Compile on each machine of a Dask cluster: tcp://HOST:PORT of its scheduler."))
def warm_up(options: Options) -> None:
    """Compile everything in advance, for a container image, a cluster, or a first command without a wait.

    This takes one to three minutes, once per machine and again after an update.

    For example:

      vibroimpact warm-up
    """
    from vibroimpact import warming

    began = perf_counter()
    with refusing(), Meter("kernels", keeps=False) as meter:
        if options["cluster"] is None:
            warming.warm_up(meter)
        else:
            warming.warm_up_cluster(options["cluster"], meter)
    typer.echo(f"all kernels are compiled ({duration(perf_counter() - began)})")


# Maps that are written tile by tile


def is_store(options: Mapping[str, Any]) -> bool:
    """Return whether a map is written to a store, tile by tile."""
    return options["out"] is not None and options["out"].suffix.lower() == ".zarr"


def store_exists(options: Mapping[str, Any]) -> bool:
    """Return whether there is a stored map, of this study or another, that may not be overwritten."""
    from vibroimpact.files.guard import RECORDS

    if options["overwrite"] or not (options["out"] / RECORDS).exists():
        return False
    with refusing(OSError):
        from vibroimpact.execution.store import SweepStore

        SweepStore(options["out"])
    return True


def announce(out: Path) -> None:
    """Show the progress of the existing store of the same study."""
    store = _opened(out)
    if store is not None:
        rest = "nothing is left to compute" if store.is_complete() else "continuing"
        # By way of `sys.stderr` as it is now, so that it does not run into a bar.
        print(f"{out} exists: {_progress(store)[0]}; {rest}", file=sys.stderr, flush=True)


def place_for(options: Mapping[str, Any]) -> Path:
    """Return the folder in which a map is stored tile by tile: next to the store that it may replace in the end."""
    from vibroimpact.files import partial_name

    out: Path = options["out"]
    beside = partial_name(out)
    return beside if options["overwrite"] and (os.path.lexists(out) or beside.exists()) else out


@contextmanager
def replacing_store(place: Path, out: Path) -> Iterator[None]:
    """Replace the store at `out` by that at `place` once complete; remove it if it fails before its first tile."""
    from vibroimpact.files import replace_output, sweep_up

    sweep_up(out)
    new = place != out and not place.exists()
    try:
        yield
    except BaseException:
        store = _opened(place) if new else None
        if store is not None and not store.summary()["tiles_done"]:
            shutil.rmtree(place, ignore_errors=True)
        raise
    store = _opened(place)
    if place != out and store is not None and store.is_complete():
        replace_output(place, out)


def state_of(out: Path, seconds: float) -> str:
    """Return the content of a store after a run, in one line."""
    store = _opened(out)
    return f"{out}: {_progress(store)[0] if store else 'nothing'} ({duration(seconds)})"


def sentences_of_store(path: Path) -> Iterator[str]:
    """Yield the description, progress and results of a stored map, and how to continue it."""
    with refusing(*REFUSALS, OSError):
        from vibroimpact.dataset import units_of_model
        from vibroimpact.execution.store import SweepStore
        from vibroimpact.report import quantity
        from vibroimpact.request import unmarked

        store = SweepStore(path)
    identity = dict(store.identity)
    axes = [unmarked(name, str(identity.pop(name))) for name in list(identity) if name.startswith("axis ")]
    units: dict[str, str] = {}
    with suppress(OSError):
        dataset = store.dataset()
        axes, units = _with_units(axes, dataset), units_of_model(dataset)
    kind = "refined map" if "refine" in identity else "parameter map"
    yield f"{path}: {kind} of {identity.pop('indices')} over {' and '.join(axes)}"
    given = {name: value for name, value in identity.items() if value is not None}
    shown = {name: quantity(value, units[name]) if name in units else value for name, value in given.items()}
    yield "  " + ", ".join(f"{name} {value}" for name, value in shown.items())
    yield from _progress(store)
    faults = store.faults()
    if store.is_complete() and not faults:
        from vibroimpact.report.sweeps import hits_of

        with refusing(OSError), _understood(path):
            dataset = store.dataset()
            if "filled_in" in dataset.attrs:
                yield dataset.attrs["filled_in"]
            if "start" in dataset.dims:
                yield from hits_of(dataset)
    yield from faults
    if faults or not store.is_complete():
        yield f"continue with: {_command_of(store) or 'the same parameter_map(..., store=...) call'}"


def _with_units(axes: list[str], dataset: xr.Dataset) -> list[str]:
    """Return the axes of a store in the units in which they were given."""
    from vibroimpact.labels import displayed
    from vibroimpact.report.quantities import span

    dataset = displayed(dataset)
    return [f"{name} {span(dataset[name])} in {dataset[name].size}" for name in (axis.split()[0] for axis in axes)]


def _command_of(store: SweepStore) -> str:
    """Return the command that made a store, quoted for a shell.

    It is empty if a script made the store, or if the store holds no such command.
    """
    try:
        words = [word for word in shlex.split(store.command) if word != "--overwrite"]
    except ValueError:
        return ""
    if words[:2] != ["vibroimpact", "map"] or not all(map(str.isprintable, words)):
        return ""
    return shlex.join(words)


def _opened(path: Path) -> SweepStore | None:
    from vibroimpact.execution.store import SweepStore

    try:
        return SweepStore(path)
    except OSError:
        return None


def _progress(store: SweepStore) -> list[str]:
    """Return the progress of a sweep, its cost, and how its cells ended, one line each."""
    summary = store.summary()
    done, needed, cells = (summary[name] for name in ("cells_done", "needed", "cells"))
    if not store.refined:
        lines = [f"{summary['tiles_done']} of {summary['tiles']} tiles done, {done / cells:.0%} of {cells:,} cells"]
    elif store.is_complete():
        lines = [f"finished: {done:,} cells computed, {done / cells:.1%} of {cells:,} in the map"]
    else:
        lines = [f"{done:,} of {needed:,} cells computed (the total may grow), for a map of {cells:,}"]
    if done:
        left = remaining(done, needed, summary["seconds"])
        more = f", about {left}" if left else ""
        lines.append(f"{duration(summary['seconds'])} elapsed, {summary['impacts']:.3g} impacts{more}")
        lines.append(", ".join(f"{word.replace('_', ' ')} {count:,}" for word, count in summary["statuses"].items()))
    return lines
