"""Which motion: names and exponents over two parameters, attractors over initial conditions."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vibroimpact.classes import classify
from vibroimpact.dataset import VARIABLES
from vibroimpact.figures import EXPONENTS
from vibroimpact.motion import MotionClass, cycle_name
from vibroimpact.parameters import choice
from vibroimpact.plotting import diagrams, maps, style
from vibroimpact.plotting.style import DOTS, INK, RINGS, STICKING, Floats, Layer, Mask, on_axes
from vibroimpact.status import Status

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
FIGURE_SPACE = "\u2007"  # as wide as a digit

COLORS = {
    MotionClass.STICKING: STICKING,
    MotionClass.CHAOTIC: INK,
    MotionClass.NO_IMPACT: "#c9c9c9",
    MotionClass.UNDECIDED: maps.OPEN,
}
WORDS = {kind: kind.word.replace("_", " ") for kind in COLORS}
SEVERAL = "#5d175d"  # where the motion depends on the initial condition

SIGNED = "RdBu_r"  # of exponents, white at zero
SHOWN = 99.0  # per cent of the cells within the scale of exponents; the others saturate

# Of attractors: Okabe and Ito's palette, the lightest and most different hues first; without impacts they are grey.
ATTRACTORS = "#56b4e9", "#e69f00", "#009e73", "#cc79a7", "#f0e442", "#0072b2", "#d55e00"
FURTHER = "#7a5230"
QUIET = {
    "no_impact": style.STATUS_COLORS[Status.NO_IMPACT],
    "permanently_in_contact": style.STATUS_COLORS[Status.STUCK_FOREVER],
    "at_rest": style.STATUS_COLORS[Status.DECAYING],
}
RING = RINGS | {"markersize": 5.0, "markeredgecolor": INK, "markeredgewidth": 1.2}
DOT = DOTS | {"markersize": 1.8, "color": INK}
FEW = 24  # points of an attractor that are marked as rings; more are marked as dots

Name = tuple[int, int]


def name_colors(counts: Counter[Name], cells: int) -> dict[Name, str]:
    """Return the colours of the most frequent names (n_periods, n_impacts) among `cells`, the most frequent first."""
    ranked = [name for name, count in counts.most_common(MOST_NAMES) if count >= LEAST_SHARE * cells]
    spare = iter([*SPARE, *(color for name, color in USUAL.items() if name not in ranked)])
    return {name: USUAL.get(name) or next(spare) for name in ranked}


@on_axes
def motion_map(sweep: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the name of the motion in every cell of a map over two parameters.

    The most frequent periodic motions have a colour each, rarer ones share one; sticking, chaos, no impact and
    undecided cells have their own. The legend gives the share of each in the cells.

    Parameters
    ----------
    sweep : xarray.Dataset
        What `vibroimpact.classify` returns over two axes, or a `parameter_map` that it takes; the first axis lies
        along x.

    Notes
    -----
    Every cell is drawn as computed. The usual names have the same colour on every map. All colours differ for
    readers who see two of the three primaries. Cells in which several initial conditions lead to different motions
    have a colour of their own.

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
    classes, field = diagrams.check_sweep("sweep", classes, "motion", 2)
    several = np.zeros(field.shape, dtype=bool)
    if "start" in field.dims:
        classes, several = _one_start(classes)
        field = classes["motion"]
    layers = [
        (here, color, f"{style.percent(float(here.mean())).rjust(6, FIGURE_SPACE)}   {text}")
        for here, color, text in _layers(classes, field, several.T)
    ]
    ax = style.new_axes(ax, (7.8, 5.0), style.title(classes))
    entries = maps.fill_cells(ax, field, layers, maps.OPEN)
    maps.frame_plane(ax, field)
    style.legend_beside(ax, entries, "share of the cells, and motion")
    return ax


def _one_start(classes: xr.Dataset) -> tuple[xr.Dataset, Mask]:
    """Return the motions from the first initial condition, and where another one leads to a different motion."""
    first = classes.isel(start=0, drop=True)
    differs = np.zeros(first["motion"].shape, dtype=bool)
    for name in ("motion", "n_periods", "n_impacts"):
        values = classes[name].transpose("start", *first["motion"].dims).values
        differs |= (values != values[0]).any(axis=0)
    return first.assign_attrs(note=f"{classes.sizes['start']} initial conditions"), differs


def _layers(classes: xr.Dataset, field: xr.DataArray, several: Mask) -> Iterator[Layer]:
    """Yield which cells each motion of the legend fills, perhaps none, its colour and its name."""
    codes = np.where(several, -1, maps.grid_of(field)[2].astype(int))
    n, p = (maps.grid_of(classes[name].transpose(*field.dims))[2].astype(int) for name in ("n_periods", "n_impacts"))
    yield from motion_layers(codes, n, p)
    yield several, SEVERAL, "depends on the initial condition"


def motion_layers(codes: Any, n_periods: Any, n_impacts: Any) -> Iterator[Layer]:
    """Yield for each entry of a legend of motions which cells it fills, perhaps none, its colour and its name."""
    rest = codes == MotionClass.PERIODIC
    counts = Counter(zip(n_periods[rest].tolist(), n_impacts[rest].tolist(), strict=True))
    for name, color in name_colors(counts, codes.size).items():
        here = (codes == MotionClass.PERIODIC) & (n_periods == name[0]) & (n_impacts == name[1])
        rest = rest & ~here
        yield here, color, cycle_name(*name)
    yield rest, OTHER_PERIODIC, "other periodic"
    yield from ((codes == kind, COLORS[kind], word) for kind, word in WORDS.items())


def symmetric_limit(values: Floats) -> float:
    """Return the largest exponent that the colours show, of either sign: some 1 % of the cells exceed it."""
    sizes = np.abs(values[np.isfinite(values)])
    return float(np.percentile(sizes, SHOWN)) or 1.0 if sizes.size else 1.0


@on_axes
def exponent_map(sweep: xr.Dataset, index: str = "lyapunov", ax: Axes | None = None) -> Axes:
    r"""Draw the largest Lyapunov exponent over two parameters: red where perturbations grow, blue where they decay.

    .. math:: \lambda = \lim_{t \to \infty} \frac1t \ln \frac{|\delta(t)|}{|\delta(0)|}

    Parameters
    ----------
    sweep : xarray.Dataset
        What `vibroimpact.parameter_map` returns over two axes; the first lies along x.
    index : {"lyapunov", "lyapunov_per_impact"}
        Per unit time, in 1/s, or per impact.

    Notes
    -----
    White is zero: bifurcations are white lines within blue. Both signs share one scale; the outermost 1 % of the cells
    exceed it. A motion that sticks loses all memory of its start: its exponent is minus infinity and has a colour
    of its own. Cells without a value are grey or red by their status, which the legend names.

    Examples
    --------
    >>> import numpy as np, vibroimpact as vi
    >>> sweep = vi.parameter_map(vi.ImpactOscillator(), omega=np.linspace(2, 3, 5), mass=[0.9, 1.0, 1.1],
    ...                          sample_impacts=200, indices=["lyapunov"])
    >>> exponent_map(sweep).get_ylabel()
    'mass $m$ [kg]'
    """
    choice("index", index, EXPONENTS)
    sweep, field = diagrams.check_sweep("sweep", sweep, index, 2)
    values = maps.grid_of(field)[2]
    limit = symmetric_limit(values)
    ax = style.new_axes(ax, (7.2, 5.4), style.title(sweep))
    mesh = maps.colour_mesh(ax, field, np.ma.masked_invalid(values), cmap=SIGNED, norm=Normalize(-limit, limit))
    sticks, entries = np.isneginf(values), []
    if sticks.any():
        maps.colour_mesh(
            ax, field, np.ma.masked_where(~sticks, np.zeros(sticks.shape)), cmap=ListedColormap([STICKING])
        )
        symbol, share = style.symbol_of(field).strip("$"), style.percent(float(sticks.mean()))
        entries = [Patch(color=STICKING, label=rf"sticking: ${symbol} = -\infty$ ({share} of the cells)")]
    entries += maps.draw_missing(ax, sweep, field.where(~np.isneginf(field), 0.0))
    maps.frame_plane(ax, field)
    maps.add_bar(ax, mesh, field, pad=0.02, extend=_beyond(values, limit))
    style.legend_below(ax, entries)
    return ax


def _beyond(values: Floats, limit: float) -> str:
    """Return at which ends of the scale values exceed it, as Matplotlib calls them."""
    finite = values[np.isfinite(values)]
    low, high = bool((finite < -limit).any()), bool((finite > limit).any())
    return "both" if low and high else "min" if low else "max" if high else "neither"


@on_axes
def basin_portrait(dataset: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Draw which initial conditions lead to which attractor, one colour per attractor, and where the attractors lie.

    Parameters
    ----------
    dataset : xarray.Dataset
        What `vibroimpact.basins` returns; its first axis lies along x.

    Notes
    -----
    Every initial condition is drawn as computed. The legend names each motion with its hardest impact and its share of
    the initial conditions; the eighth attractor with impacts and all smaller ones share a colour. Rings (dots where
    there are more than 24) mark the attractors themselves: their impacts, or their states at the portrait's phase.

    Examples
    --------
    >>> import numpy as np
    >>> from vibroimpact import ImpactOscillator
    >>> from vibroimpact.coexistence import basins
    >>> found = basins(ImpactOscillator(omega=3.0), phase=np.linspace(0, 1, 21), velocity=np.linspace(0, 3, 21))
    >>> basin_portrait(found).get_ylabel()
    'impact velocity $I$ [m/s]'
    """
    field = _attractors(dataset)
    across, upwards = (str(dim) for dim in field.dims)
    ax = style.new_axes(ax, (7.2, 5.4), _title(dataset))
    entries: list[Any] = list(maps.fill_cells(ax, field, _basins(dataset, field), maps.OPEN))
    if _mark_attractors(ax, dataset, (across, upwards)):
        entries.append(Line2D([], [], **RING, label="the attractors themselves"))
    maps.frame_plane(ax, field)
    style.legend_below(ax, entries)
    return ax


def _attractors(value: Any) -> xr.DataArray:
    """Return the attractor of each initial condition, or raise `ValueError`."""
    if not isinstance(value, xr.Dataset) or "attractor" not in value or value["attractor"].ndim != 2:
        allowed = "a result of basins (attractor over two axes)"
        raise style.refused("dataset", value, allowed, "pass what vibroimpact.basins returns")
    diagrams.check_lengths("dataset", value["attractor"])
    return value["attractor"]


def _title(dataset: xr.Dataset) -> str:
    """Return the oscillator's parameters, and the phase of initial conditions that have none of their own."""
    held = style.title(dataset)
    if "phase" in dataset.dims or not held:
        return held
    phase = json.loads(dataset.attrs["arguments"]).get("phase", 0.0)
    return f"{held},  {style.value_text(VARIABLES['phase'][2], phase, '')}"


def _basins(dataset: xr.Dataset, field: xr.DataArray) -> Iterator[Layer]:
    """Yield which initial conditions each attractor of the legend has, its colour and its name; then the others."""
    numbers, codes = field.values.T, dataset["status"].transpose(*field.dims).values.T
    shares, hardest = dataset["share"].values, dataset["max_velocity"].values
    units, left, further = style.unit_suffix(style.described(dataset["max_velocity"])[1], " {}"), iter(ATTRACTORS), []
    for number, meaning in enumerate(str(field.attrs["flag_meanings"]).split()[1:]):
        color = QUIET.get(meaning) or next(left, FURTHER)
        if color == FURTHER:
            further.append(number)
            continue
        hits = f", impacts up to {hardest[number]:.3g}{units}" if np.isfinite(hardest[number]) else ""
        yield numbers == number, color, f"{meaning.replace('_', ' ')}{hits}: {style.percent(shares[number])}"
    if further:
        text = f"{len(further)} further attractors: {style.percent(shares[further].sum())}"
        yield np.isin(numbers, further), FURTHER, text
    cut_off = (numbers < 0) & np.isin(codes, (Status.BUDGET, Status.INTERRUPTED))
    yield from style.by_status(cut_off, codes, "initial condition")
    undecided = (numbers < 0) & ~cut_off
    count = style.counted(int(undecided.sum()), "initial condition")
    yield undecided, maps.OPEN, f"undecided: neither a cycle nor certain chaos ({count})"


def _mark_attractors(ax: Axes, dataset: xr.Dataset, axes: tuple[str, str]) -> bool:
    """Mark the points of each attractor that lie in the portrait; return whether there are any."""
    marked = False
    for x, y in zip(*(dataset[f"point_{axis}"].values for axis in axes), strict=True):
        points = int(np.isfinite(x).sum())
        if points:
            ax.plot(x, y, **(RING if points <= FEW else DOT), zorder=4)
            marked = True
    return marked
