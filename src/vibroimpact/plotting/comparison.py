"""Two designs side by side: how they move, where and how hard they hit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroimpact.motion import recognise
from vibroimpact.oscillator import PARAMETERS, ImpactOscillator, State
from vibroimpact.plotting.orbit import phase_portrait, time_history
from vibroimpact.plotting.sections import impact_map
from vibroimpact.plotting.style import STYLE, draw_stop, held_text
from vibroimpact.sections import impact_section, simulate, stroboscopic_section

SETTLED = 1000  # impacts, and periods, left out
SAMPLED = 2000
COMPARABLE = 4.0  # designs whose views differ by more than this factor keep views of their own


def comparison_figure(
    designs: xr.Dataset | Sequence[ImpactOscillator],
    *,
    names: Sequence[str] = ("A", "B"),
    periods: float = 8,
    size: tuple[float, float] = (11.0, 12.0),
) -> Figure:
    """Draw the settled motion of two designs side by side: time history, phase portrait, impact map.

    Parameters
    ----------
    designs : xarray.Dataset or two ImpactOscillator
        The `dataset` of what `vibroimpact.compare` returns, or the two designs.
    names : two str
        What two oscillators are called; a dataset tells names of its own.
    periods : float, > 0
        Driving periods shown.
    size : (float, float)
        Width and height in inches.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ValueError
        `designs` is neither.

    Notes
    -----
    Each motion is that from rest after 1000 driving periods. Figures in a row share their
    view unless the motions differ more than fourfold in size.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> figure = comparison_figure([vi.ImpactOscillator(omega=1.4), vi.ImpactOscillator(omega=2.8)])
    >>> len(figure.axes), figure.axes[1].get_title().splitlines()[0]
    (6, 'B: aperiodic')
    """
    import matplotlib.pyplot as plt

    oscillators, names = _designs(designs, names)
    with mpl.rc_context(STYLE):
        figure, axes = plt.subplots(3, 2, figsize=size, layout="constrained")
    for column, (osc, name) in enumerate(zip(oscillators, names, strict=True)):
        section = impact_section(osc, transient_impacts=SETTLED, sample_impacts=SAMPLED)
        motion = simulate(osc, start=_settled(osc), periods=periods)
        time_history(motion, ax=axes[0, column])
        phase_portrait(motion, ax=axes[1, column])
        impact_map(section, ax=axes[2, column])
        axes[0, column].set_title(f"{name}: {recognise(section).name}\n{_differing(osc, oscillators)}", fontsize=10)
    gaps = [osc.gap for osc in oscillators]
    _share(axes[0], "y", gaps)
    _share(axes[1], "x", gaps)
    _share(axes[1], "y")
    if all(ax.lines for ax in axes[2]):
        _share(axes[2], "y")
    return figure


def _designs(designs: Any, names: Sequence[str]) -> tuple[list[ImpactOscillator], list[str]]:
    if isinstance(designs, xr.Dataset) and designs.sizes.get("design") == 2 and set(PARAMETERS) <= set(designs):
        rows = [designs.isel(design=i) for i in range(2)]
        told = [ImpactOscillator(**{name: float(row[name]) for name in PARAMETERS}) for row in rows]
        return told, [str(name) for name in designs["design"].values]
    if isinstance(designs, (list, tuple)) and len(designs) == 2:
        pair = [osc for osc in designs if isinstance(osc, ImpactOscillator)]
        if len(pair) == 2 and len(names) == 2:
            return pair, [str(name) for name in names]
    raise ValueError(
        f"`designs` is a {type(designs).__name__}; allowed is the dataset of a comparison, or two oscillators with two "
        "names; give for example compare(a, b).dataset"
    )


def _settled(osc: ImpactOscillator) -> State | None:
    """Return where the settled motion is at phase 0: an impact would fall upon a sample, before or after it."""
    looks = stroboscopic_section(osc, transient_periods=SETTLED, sample_periods=1)
    if not looks.sizes["period"]:
        return None
    return State(min(float(looks["displacement"][0]), osc.gap), float(looks["velocity"][0]))


def _differing(osc: ImpactOscillator, both: Sequence[ImpactOscillator]) -> str:
    a, b = both
    return ",  ".join(held_text(name, osc) for name in PARAMETERS if getattr(a, name) != getattr(b, name))


def _share(axes: Sequence[Axes], along: str, gaps: Sequence[float] | None = None) -> None:
    """Give figures of comparable size one view, and let the stop reach to its end."""
    views = [ax.get_xlim() if along == "x" else ax.get_ylim() for ax in axes]
    low, high = min(low for low, _ in views), max(high for _, high in views)
    if high - low > COMPARABLE * min(b - a for a, b in views):
        return
    for i, ax in enumerate(axes):
        (ax.set_xlim if along == "x" else ax.set_ylim)(low, high)
        if gaps is not None and gaps[i] < high:
            draw_stop(ax, gaps[i], high, upright=along == "x")
