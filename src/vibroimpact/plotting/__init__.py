"""Figures of all results: one function per figure takes a Dataset and returns matplotlib Axes.

Legends are placed below the axes, where they hide no data; create your own figures with layout="constrained".
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroimpact import figures
from vibroimpact.dataset import unbundle
from vibroimpact.files import check_output, replacing
from vibroimpact.parameters import check_fits, invalid
from vibroimpact.plotting.animation import animate
from vibroimpact.plotting.continuation import boundaries, branch_diagram
from vibroimpact.plotting.designs import comparison_figure, oscillator_sketch
from vibroimpact.plotting.diagrams import bifurcation_diagram, diagram_with_index, index_curve
from vibroimpact.plotting.maps import boundary_lines, index_contour, index_scatter, index_surface
from vibroimpact.plotting.motions import basin_portrait, exponent_map, motion_map
from vibroimpact.plotting.orbits import phase_portrait, time_history
from vibroimpact.plotting.response import response_curve
from vibroimpact.plotting.sections import impact_histogram, impact_map, stroboscopic_map
from vibroimpact.plotting.style import SAMPLE_DIMS

PIXEL = 8  # bytes per pixel, of the canvas and of the file

__all__ = [
    "animate",
    "basin_portrait",
    "bifurcation_diagram",
    "boundaries",
    "boundary_lines",
    "branch_diagram",
    "comparison_figure",
    "default_kind",
    "diagram_with_index",
    "exponent_map",
    "impact_histogram",
    "impact_map",
    "index_contour",
    "index_curve",
    "index_scatter",
    "index_surface",
    "motion_map",
    "oscillator_sketch",
    "phase_portrait",
    "response_curve",
    "save_figure",
    "stroboscopic_map",
    "time_history",
]


def __dir__() -> list[str]:
    """Return the names of the public functions."""
    return __all__


def _drawer(kind: figures.Kind) -> Callable[..., Axes | Figure]:
    """Return the function of a kind of figure; for a bundled figure it takes all parts of one dataset."""
    draw: Callable[..., Axes | Figure] = globals()[kind.function]
    return (lambda dataset, **options: draw(unbundle(dataset), **options)) if kind.bundled else draw


KINDS: dict[str, Callable[..., Axes | Figure]] = {name: _drawer(kind) for name, kind in figures.KINDS.items()}
# By extension. Without a date and with fixed identifiers, equal figures give identical files.
_METADATA: dict[str, dict[str, None]] = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
_BY_SHAPE = ("impact_section", "stroboscopic_section", "bifurcation_diagram", "parameter_map")  # may lack selected axes


def default_kind(dataset: xr.Dataset) -> str:
    """Return the name in `KINDS` of the default figure of a result.

    Parameters
    ----------
    dataset : xarray.Dataset
        A result of any public function.

    Returns
    -------
    str

    Raises
    ------
    ValueError
        There is no figure for such a result; the message lists the results that have one.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> default_kind(vi.simulate(vi.ImpactOscillator(), periods=2))
    'time-history'
    """
    if not isinstance(dataset, xr.Dataset):
        raise invalid("dataset", dataset, "a result, an xarray.Dataset")
    maker = str(dataset.attrs.get("function"))
    if maker not in _BY_SHAPE and (kinds := figures.kinds_of(maker)):
        return kinds[0]
    if "impact_time" in dataset:
        return "time-history"
    axes = [str(dim) for dim in dataset["status"].dims if dim != "start"] if "status" in dataset else []
    if "status" in dataset and set(dataset.dims) & set(SAMPLE_DIMS):
        return "bifurcation-diagram" if axes else "impact-map" if "phase" in dataset else "stroboscopic-map"
    if axes == ["point"]:
        return "index-scatter"
    indices = {str(name) for name in dataset.data_vars} - {"status"}
    if len(axes) == 2 and indices and indices <= set(figures.EXPONENTS):
        return "exponent-map"
    if kinds := figures.kinds_of("parameter_map", len(axes)) if axes else ():
        return kinds[0]
    got, hint = f"one over {len(axes)} axes", "select values of further axes with .sel"
    if not axes:
        got, hint = f"one of {maker}", "draw orbits with orbit.motion(times), attractors with basins"
    raise ValueError(
        "`dataset` must be a result of simulate, a section, bifurcation_diagram, parameter_map over one or two axes, "
        f"continue_orbit, response_curve, boundary_curves, basins, impact_statistics or compare, got {got}; {hint}"
    )


def save_figure(
    figure: Axes | Figure,
    path: str | os.PathLike[str],
    size: tuple[float, float] | None = None,
    dpi: float = 150.0,
    overwrite: bool = False,
) -> Path:
    """Save a figure to a file. The file appears under its name only when it is complete.

    Parameters
    ----------
    figure : matplotlib.axes.Axes or matplotlib.figure.Figure
        What to save; for axes, the whole figure that contains them.
    path : path
        The file; its extension, .png, .svg or .pdf, determines the format.
    size : (float, float), optional
        Width and height in inches, each 0.5 to 100; None keeps the figure's own.
    dpi : float, 10 to 2400
        Dots per inch, also for the rasterised parts of an .svg or .pdf.
    overwrite : bool
        Whether an existing file may be replaced.

    Returns
    -------
    pathlib.Path
        The path of the file.

    Raises
    ------
    ValueError
        The extension, `size` or `dpi` is not allowed.
    OSError
        The file exists and `overwrite` is False, or it cannot be written; no partial file is left.

    Examples
    --------
    >>> import tempfile, vibroimpact as vi
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_figure(vi.plotting.oscillator_sketch(), f"{folder}/model.svg").name
    'model.svg'
    """
    dots = figures.check_dpi(dpi)
    if size is not None:
        size = figures.check_size(size)
    if not isinstance(figure, Axes | Figure):
        raise invalid("figure", figure, "axes or a figure of matplotlib", "every function of vi.plotting returns one")
    whole = figure.get_figure(root=True)
    if whole is None:
        raise ValueError(
            "`figure` must be axes that belong to a figure; these were removed from theirs: draw them again"
        )
    target = check_output(path, overwrite=overwrite, endings=tuple(_METADATA))
    ending, original_size = target.suffix.lower(), whole.get_size_inches()
    pixels = math.prod(original_size if size is None else size) * dots**2
    check_fits("dpi", f"makes {pixels:.3g} pixels, which take", int(PIXEL * pixels), "take a lower one")
    try:
        if size is not None:
            whole.set_size_inches(*size)
        with replacing(target, overwrite=overwrite) as part, mpl.rc_context({"svg.hashsalt": "vibroimpact"}):
            whole.savefig(part, dpi=dots, format=ending[1:], metadata=_METADATA[ending])
    finally:
        whole.set_size_inches(*original_size)
    return target
