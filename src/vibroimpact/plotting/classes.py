"""The names of motions over two swept parameters."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patches import Patch
from numpy.typing import NDArray

from vibroimpact.classes import classify
from vibroimpact.motion import MotionClass, cycle_name
from vibroimpact.plotting.checks import check_sweep
from vibroimpact.plotting.maps import frame_plane, grid_of
from vibroimpact.plotting.style import INK, STICKING, WALL, new_axes, title

# Colours that the usual names always have, so that maps can be compared: impact-1 motions from blue to green.
USUAL = {
    (1, 1): "#0072b2",
    (2, 1): "#56b4e9",
    (3, 1): "#009e73",
    (4, 1): "#8edfa7",
    (5, 1): "#cc79a7",
    (1, 2): "#d55e00",
}
SPARE = ("#7a2e12", "#7a3dd8")
PALETTE = (*USUAL.values(), *SPARE)
OTHER_PERIODIC = "#c79a5b"
MOST_NAMES = len(PALETTE)  # have colours of their own
LEAST_SHARE = 0.005  # of the cells; rarer names have no colour of their own
BESIDE = "beside"  # marks a legend that leaves the room below the axes free
FIGURE_SPACE = "\u2007"  # as wide as a digit

COLORS = {
    MotionClass.STICKING: STICKING,
    MotionClass.CHAOTIC: INK,
    MotionClass.NO_IMPACT: "#c9c9c9",
    MotionClass.UNDECIDED: "#ffffff",
}
WORDS = {kind: kind.word.replace("_", " ") for kind in COLORS}

Name = tuple[int, int]
Mask = NDArray[np.bool_]


def name_colors(counts: Counter[Name], cells: int) -> dict[Name, str]:
    """Return the colours of the commonest names (n_periods, n_impacts) among `cells`, the commonest first."""
    ranked = [name for name, count in counts.most_common(MOST_NAMES) if count >= LEAST_SHARE * cells]
    spare = iter([*SPARE, *(color for name, color in USUAL.items() if name not in ranked)])
    return {name: USUAL.get(name) or next(spare) for name in ranked}


def motion_map(sweep: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the name of the motion in every cell of a map over two parameters.

    The commonest periodic motions have a colour each; rarer ones share one; sticking, chaos, no impact and what could
    not be decided have their own. The legend tells the share of each in the cells.

    Parameters
    ----------
    sweep : xarray.Dataset
        What `vibroimpact.classify` returns over two axes, or a `parameter_map` that it takes; the first axis lies
        along x.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure without it.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        `sweep` has not two axes, or lacks the indices that names are decided from.

    Notes
    -----
    Every cell is drawn as computed. The usual names have the same colour on every map. All colours stay apart for
    readers who see two of the three primaries.

    Examples
    --------
    >>> import numpy as np, vibroimpact as vi
    >>> sweep = vi.parameter_map(vi.ImpactOscillator(), omega=np.linspace(2, 3, 5), mass=[0.9, 1.0, 1.1],
    ...                          sample_impacts=500, indices=("lyapunov_per_impact", "n_periods", "n_impacts"))
    >>> ax = motion_map(sweep)
    >>> ax.get_legend().get_texts()[0].get_text()
    '66.7 %   period-1 impact-1'
    """
    classes = sweep if isinstance(sweep, xr.Dataset) and "motion" in sweep else classify(sweep)
    field = check_sweep("sweep", classes, "motion", 2)
    x, y, codes = grid_of(field)
    shade, entries = np.ones((*codes.shape, 3)), []
    for where, color, word in _layers(classes, field):
        if where.any():
            shade[where] = to_rgb(color)
            edge = WALL if color == COLORS[MotionClass.UNDECIDED] else color
            entries.append(Patch(facecolor=color, edgecolor=edge, label=f"{share(where)}   {word}"))
    ax = new_axes(ax, (7.8, 5.0), title(classes))
    ax.grid(visible=False)
    ax.pcolormesh(x, y, shade, shading="nearest", rasterized=True, zorder=1)
    frame_plane(ax, field)
    legend_beside(ax, entries, "share of the cells, and motion")
    return ax


def _layers(classes: xr.Dataset, field: xr.DataArray) -> Iterator[tuple[Mask, str, str]]:
    """Yield which cells each motion of the legend fills, its colour, and its words."""
    codes = grid_of(field)[2]
    n, p = (grid_of(classes[name].transpose(*field.dims))[2].astype(int) for name in ("n_periods", "n_impacts"))
    rest = codes == MotionClass.PERIODIC
    counts = Counter(zip(n[rest].tolist(), p[rest].tolist(), strict=True))
    for name, color in name_colors(counts, codes.size).items():
        here = (codes == MotionClass.PERIODIC) & (n == name[0]) & (p == name[1])
        rest &= ~here
        yield here, color, cycle_name(*name)
    yield rest, OTHER_PERIODIC, "other periodic"
    for kind, word in WORDS.items():
        yield codes == kind, COLORS[kind], word


def share(where: Mask) -> str:
    """Return how many of the cells these are, in per cent, padded with figure spaces to one width."""
    part = 100.0 * float(where.mean())
    return (f"{part:.1f} %" if part >= 0.05 else "<0.1 %").rjust(6, FIGURE_SPACE)


def legend_beside(ax: Axes, entries: list[Patch], heading: str) -> None:
    """Put the legend to the right of the axes, where it hides no data."""
    told = ax.legend(
        handles=entries,
        title=heading,
        loc="upper left",
        bbox_to_anchor=(1.02, 1.0),
        borderaxespad=0.0,
        frameon=False,
        fontsize=8.5,
        title_fontsize=8.5,
        alignment="left",
        handlelength=1.4,
        handleheight=1.1,
        labelspacing=0.45,
    )
    told.set_gid(BESIDE)
