"""Where a result goes: to a file by its ending, or to the screen in words."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vibroimpact.cli.request import WrongRequest, asked, number

if TYPE_CHECKING:
    import xarray as xr

FIGURE_ENDINGS = (".png", ".svg", ".pdf")
_FIGURES = {
    "simulate": ("time-history", "phase-portrait"),
    "impact_section": ("impact-map",),
    "stroboscopic_section": ("stroboscopic-map",),
    "bifurcation_diagram": ("bifurcation-diagram",),
}
_FIGURES_OF_SWEEPS = {1: ("index-curve",), 2: ("index-contour", "index-surface")}
_INCHES, _DOTS = (0.5, 100.0), (10.0, 2400.0)


def check(options: Mapping[str, Any], function: str, indices: tuple[str, ...] = (), n_axes: int = 0) -> None:
    """Refuse an output that could not be made, before anything is computed."""
    check_looks(options)
    kinds = _FIGURES_OF_SWEEPS.get(n_axes, ()) if function == "parameter_map" else _FIGURES[function]
    figure, index = options.get("figure"), options.get("index")
    if figure is not None and figure not in kinds:
        raise WrongRequest(f"`--figure` is {figure!r}; allowed here are {', '.join(kinds) or 'none'}; choose one")
    if index is not None and index not in indices:
        raise WrongRequest(f"`--index` is {index!r}; allowed here are {', '.join(indices)}; add it to --indices")
    out = options.get("out")
    if out is not None and out.suffix.lower() in FIGURE_ENDINGS and not kinds:
        raise WrongRequest(
            f"`--out` is {str(out)!r}, a figure of {n_axes} axes; allowed are one or two; save a .zarr instead"
        )


def check_looks(options: Mapping[str, Any]) -> None:
    """Refuse a place that cannot be written to, and sizes and levels that are no numbers."""
    _size(options), _dpi(options), level_of(options)
    if options.get("out") is not None:
        from vibroimpact.storage import DATA_ENDINGS, check_output

        with asked(OSError):
            check_output(options["out"], overwrite=options["overwrite"], endings=DATA_ENDINGS + FIGURE_ENDINGS)


def write(dataset: xr.Dataset, options: Mapping[str, Any], path: Path) -> None:
    """Write data or a figure to `path`, as its ending says."""
    if path.suffix.lower() not in FIGURE_ENDINGS:
        from vibroimpact.storage import save

        save(dataset, path, overwrite=options["overwrite"])
        return
    import matplotlib as mpl

    mpl.use("Agg")  # no window is ever opened
    from vibroimpact import plotting

    with asked(OSError):
        axes = draw(dataset, options)
    plotting.save_figure(axes, path, size=_size(options), dpi=_dpi(options), overwrite=options["overwrite"])


def draw(dataset: xr.Dataset, options: Mapping[str, Any]) -> Any:
    """Return the Axes of the figure asked for, or of the one that shows the result best."""
    from vibroimpact import plotting

    if options.get("sweep") is not None:
        from vibroimpact.storage import load

        return plotting.diagram_with_index(dataset, load(options["sweep"]), index=options.get("index") or "std")
    kind = options.get("figure") or plotting.default_kind(dataset)
    if kind not in plotting.KINDS:
        raise ValueError(f"`--kind` is {kind!r}; allowed are {', '.join(plotting.KINDS)}; choose one of them")
    more: dict[str, Any] = {}
    if kind.startswith("index-"):
        from vibroimpact.indices import INDICES

        more["index"] = options.get("index") or next((name for name in INDICES if name in dataset), "std")
    if kind == "index-contour":
        more["level"] = level_of(options)
    return plotting.KINDS[kind](dataset, **more)


def _size(options: Mapping[str, Any]) -> tuple[float, float] | None:
    text = options.get("size")
    if text is None:
        return None
    sides = [number(part) for part in text.lower().split("x")]
    fit = [not isinstance(side, str) and _INCHES[0] <= side <= _INCHES[1] for side in sides]
    if len(sides) != 2 or not all(fit):
        raise WrongRequest(f"`--size` is {text!r}; allowed is width x height, each 0.5 to 100 inches; write 8x5")
    return float(sides[0]), float(sides[1])


def _dpi(options: Mapping[str, Any]) -> float:
    text = options.get("dpi")
    dpi = 150.0 if text is None else number(text)
    if isinstance(dpi, str) or not _DOTS[0] <= dpi <= _DOTS[1]:
        raise WrongRequest(f"`--dpi` is {text!r}; allowed is a number from 10 to 2400; 150 is usual")
    return dpi


def level_of(options: Mapping[str, Any]) -> float | None:
    """Return the level at which a boundary is drawn; None leaves it to the figure."""
    text = options.get("level")
    level = None if text is None else number(text)
    if isinstance(level, str) or (level is not None and not abs(level) < float("inf")):
        raise WrongRequest(f"`--level` is {text!r}; allowed is a finite number; give it in the unit of the index")
    return level
