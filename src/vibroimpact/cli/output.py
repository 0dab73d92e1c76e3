"""Where a result goes: to a file by its ending, or to the screen as text."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from vibroimpact.cli.endings import Interrupted, WrongRequest, refusing
from vibroimpact.cli.options import Options
from vibroimpact.figures import EXPONENTS, KINDS, MOTION, kind_of_index, kinds_of
from vibroimpact.parameters import choice
from vibroimpact.progress import Meter, duration, speed

if TYPE_CHECKING:
    import xarray as xr

FIGURE_ENDINGS = (".png", ".svg", ".pdf")
FILM_ENDINGS = (".gif", ".mp4")
NEEDS = {name: kind.needs for name, kind in KINDS.items()}  # indices that figures are drawn from


Units = Mapping[str, str]  # by parameter


def hand_on(
    dataset: xr.Dataset, options: Options, seconds: float, over: xr.Dataset | None = None, units: Units | None = None
) -> None:
    """Write a result to its file, or print its sentences, with the parameters of curves in these units."""
    from vibroimpact.labels import with_display

    dataset = with_display(dataset, units or {})
    if options["out"] is not None:
        write(dataset, options, options["out"], over)
        typer.echo(f"wrote {options['out']} ({duration(seconds)})")
        return
    from vibroimpact.report import sentences_of

    rate = speed(int(dataset.attrs.get("impacts_computed", 0)), seconds)
    for line in (
        *sentences_of(dataset),
        ", ".join(filter(None, (f"computed in {duration(seconds)}", rate))),
    ):
        typer.echo(line)


def finish(
    dataset: xr.Dataset | None,
    options: Options,
    meter: Meter,
    over: xr.Dataset | None = None,
    units: Units | None = None,
) -> None:
    """Write or print a result, or the finished part of an interrupted one, which never replaces a complete result."""
    from vibroimpact.files import partial_name
    from vibroimpact.status import Status

    if dataset is not None and not meter.stopped:
        hand_on(dataset, options, meter.seconds, over, units)
        return
    if dataset is None or ("status" in dataset and (dataset["status"] == Status.INTERRUPTED).all()):
        raise Interrupted("interrupted before anything was finished; nothing was written")
    out: Path | None = options["out"]
    marked = ", the rest has status interrupted" if "status" in dataset else ""
    message = f"interrupted; what was finished is kept{marked}"
    if out is not None and out.exists():
        message += f"; {out} is unchanged"
        out = partial_name(out)
    hand_on(dataset, options.with_values(out=out), meter.seconds, over, units)
    raise Interrupted(message)


def check(options: Options, function: str, indices: tuple[str, ...] = (), n_axes: int = 0) -> None:
    """Refuse an output that cannot be made, before anything is computed."""
    check_looks(options, FIGURE_ENDINGS + FILM_ENDINGS * (function == "simulate"))
    out: Path | None = options["out"]
    if _is_film(out) and any(options.get(name) is not None for name in ("figure", "size", "dpi")):
        raise WrongRequest("a film shows the time history at one size; leave out --figure, --size and --dpi")
    kinds = kinds_of(function, n_axes)
    figure, index = options.get("figure"), options.get("index")
    if figure is not None and figure not in kinds:
        raise WrongRequest(f"unknown `--figure` {figure!r} for this result; choose from {', '.join(kinds) or 'none'}")
    if index is not None and index not in indices:
        computed = ", ".join(indices) or "none"
        raise WrongRequest(
            f"`--index` must be one of the computed indices ({computed}), got {index!r}; add it to --indices"
        )
    if missing := [name for name in NEEDS.get(figure or "", ()) if name not in indices]:
        raise WrongRequest(f"`--indices` must include {', '.join(missing)} for a {figure}; or leave --indices out")
    if is_figure(out) and not kinds:
        raise WrongRequest(f"`--out` must be data such as .zarr for {n_axes} axes, got {str(out)!r}")


def check_looks(options: Options, endings: tuple[str, ...] = FIGURE_ENDINGS) -> None:
    """Refuse a place that cannot be written to, and invalid sizes and levels.

    `endings` are the endings allowed in addition to the data formats.
    """
    for name in ("size", "dpi", "level"):
        options.value(name)
    if options.get("out") is not None:
        from vibroimpact.files import DATA_ENDINGS, check_output

        with refusing(OSError):
            check_output(options["out"], overwrite=options["overwrite"], endings=DATA_ENDINGS + endings)


def is_figure(out: Path | None) -> bool:
    """Return whether an output is a figure, or a film of one."""
    return out is not None and out.suffix.lower() in FIGURE_ENDINGS + FILM_ENDINGS


def _is_film(out: Path | None) -> bool:
    return out is not None and out.suffix.lower() in FILM_ENDINGS


def read(options: Options, name: str) -> xr.Dataset | None:
    """Return the saved result that an option names; it is drawn only in a figure."""
    if options.get(name) is None:
        return None
    if not is_figure(options["out"]):
        raise WrongRequest(f"`--{name}` needs a figure; add for example --out figure.png")
    from vibroimpact.files import load_dataset

    with refusing(OSError):
        return load_dataset(options[name])


def write_json(content: Any, options: Options, path: Path) -> None:
    """Write plain lists, dictionaries, numbers and text."""
    from vibroimpact.files import replacing

    with replacing(path, overwrite=options["overwrite"]) as part:
        part.write_text(as_json(content) + "\n", encoding="utf-8")


def as_json(content: Any) -> str:
    """Return plain content as JSON text, readable."""
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)


def write(dataset: xr.Dataset, options: Options, path: Path, over: xr.Dataset | None = None) -> None:
    """Write data, a film, or a figure drawn over another result, in the format that the ending of `path` names."""
    if not is_figure(path):
        from vibroimpact.files import save

        save(dataset, path, overwrite=options["overwrite"])
        return
    import matplotlib as mpl

    mpl.use("Agg")  # no window is ever opened
    import matplotlib.pyplot as plt

    from vibroimpact import plotting

    if _is_film(path):
        shown = options.given("coordinate", "stop")
        with refusing(OSError), Meter("film", keeps=False) as meter:
            plotting.animate(dataset, path, overwrite=options["overwrite"], progress=meter, **shown)
        return
    try:
        with refusing(OSError):
            drawn = draw(dataset, options, over)
        plotting.save_figure(
            drawn, path, size=options.value("size"), dpi=options.value("dpi"), overwrite=options["overwrite"]
        )
    finally:
        plt.close("all")


def draw(dataset: xr.Dataset, options: Options, over: xr.Dataset | None = None) -> Any:
    """Return the Axes of the figure chosen, or of the default figure of the result."""
    from vibroimpact import plotting

    if options.get("sweep") is not None:
        from vibroimpact.files import load_dataset

        return plotting.diagram_with_index(dataset, load_dataset(options["sweep"]), index=options.get("index") or "std")
    index, stop = options.get("index"), options.get("stop")
    if stop is not None and dataset.attrs.get("function") == "parameter_map" and "stop" in dataset.dims:
        dataset = dataset.sel(stop=choice("--stop", stop, dataset["stop"].values.tolist()))
    kind = options.get("figure") or _kind_for(index, plotting.default_kind(dataset))
    if kind not in plotting.KINDS:
        raise ValueError(f"unknown `--kind` {kind!r}; choose from {', '.join(plotting.KINDS)}")
    if over is not None and kind not in ("boundaries", "branch-diagram"):
        raise ValueError(f"`--over` is for boundaries and branches only, got a {kind}")
    more: dict[str, Any] = {}
    if kind.startswith("index-"):
        more["index"] = index or _first_index(dataset)
    if kind == "index-contour":
        more["level"] = options.value("level")
    if kind == "exponent-map":
        more["index"] = index or next((name for name in EXPONENTS if name in dataset), EXPONENTS[0])
    if kind == "branch-diagram":
        more["diagram"] = over
    if kind == "boundaries" and over is not None:
        more |= _beneath_boundaries(over, index or _first_index(over))
    if kind in ("time-history", "phase-portrait", "stroboscopic-map"):
        more |= options.given("coordinate", "stop")
    if kind == "bifurcation-diagram" and index is not None:
        if index not in dataset:
            raise ValueError(f"`--index` must be an index of the diagram, got {index!r}; add it to --indices")
        return plotting.diagram_with_index(dataset, dataset[[index, "status"]], index=index)
    return plotting.KINDS[kind](dataset, **more)


def _kind_for(index: str | None, usual: str) -> str:
    """Return the figure of an index over two axes; exponents and types of motion have figures of their own."""
    return usual if index is None or usual not in ("index-contour", "exponent-map") else kind_of_index(index)


def _beneath_boundaries(over: xr.Dataset, index: str) -> dict[str, Any]:
    """Return the function that draws a map beneath boundaries: types of motion, exponents, or contours of an index."""
    from vibroimpact import plotting

    kind = kind_of_index(index)
    if kind == "index-contour":
        return {"sweep": over, "index": index}
    return {"ax": plotting.KINDS[kind](over, **{} if index == MOTION else {"index": index})}


def _first_index(dataset: xr.Dataset) -> str:
    from vibroimpact.indices import EVERY

    return next((name for name in EVERY if name in dataset), "std")


def map_beneath(options: Options, names: tuple[str, ...]) -> xr.Dataset | None:
    """Return the saved map that the curves are drawn over."""
    over = read(options, "over")
    if over is None:
        return None
    if set(map(str, over.dims)) != set(names):
        dims = " and ".join(map(str, over.dims)) or "no axis"
        raise WrongRequest(
            f"`--over` must be a map over {' and '.join(names)}, as the curves are, got one over {dims}; compute "
            "it with `vibroimpact map`"
        )
    index = options["index"]
    needed = NEEDS["motion-map"] if index == MOTION else (index,) if index else ()
    if missing := [name for name in needed if name not in over]:
        raise WrongRequest(f"`--over` must be a map of {', '.join(missing)}, which this one lacks; compute it again")
    return over
