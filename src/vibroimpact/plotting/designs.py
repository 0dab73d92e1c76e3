"""Figures of designs: a sketch of the model, and the settled motions of two designs side by side."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch, Rectangle

from vibroimpact.dataset import arguments_of, family_in, model_from
from vibroimpact.figures import check_size
from vibroimpact.model import Model, State
from vibroimpact.motion import NAMING, motion_name, refined
from vibroimpact.motion.classes import classify
from vibroimpact.parameters import several
from vibroimpact.plotting import labels, style
from vibroimpact.plotting.orbits import phase_portrait, time_history
from vibroimpact.plotting.sections import impact_map
from vibroimpact.plotting.style import BLUE, INK, RED, on_axes
from vibroimpact.plotting.ticks import quantity
from vibroimpact.sections import impact_section, stroboscopic_section
from vibroimpact.simulation import simulate
from vibroimpact.sweeps import parameter_map

# Positions in drawing units: frame | spring and damper | mass | clearance | stop.
_FRAME, _MASS_LEFT, _MASS_RIGHT, _STOP = 0.0, 4.0, 6.4, 8.0
_BOTTOM, _TOP = 0.0, 2.8
_SPRING, _DAMPER = 2.05, 0.75

SETTLED = 1000  # transient impacts and periods left out in a comparison
SAMPLED = 2000  # impacts of each design in a comparison
COMPARABLE = 4.0  # largest ratio between the views of two designs that share their axis limits


def _wall(ax: Axes, left: float, right: float, bottom: float, top: float, face: str) -> None:
    """Draw fixed ground: hatched, with a solid line on the side `face`."""
    ax.add_patch(Rectangle((left, bottom), right - left, top - bottom, facecolor="#f0f0f0", edgecolor="#8a8a8a",
                           hatch="/////", linewidth=0.0))  # fmt: skip
    edges = {"left": ([left, left], [bottom, top]), "right": ([right, right], [bottom, top]),
             "top": ([left, right], [top, top])}  # fmt: skip
    ax.plot(*edges[face], color=INK, linewidth=2.0, solid_capstyle="butt")


def _spring(ax: Axes) -> None:
    """Draw a spring of seven turns between the frame and the mass."""
    lead, turns = 0.55, 7
    along = np.linspace(_FRAME + lead, _MASS_LEFT - lead, 2 * turns + 1)
    across = np.concatenate([[0.0], 0.27 * np.tile([1.0, -1.0], turns)[: 2 * turns - 1], [0.0]])
    x = np.concatenate([[_FRAME], along, [_MASS_LEFT]])
    ax.plot(x, _SPRING + np.concatenate([[0.0], across, [0.0]]), color=INK, linewidth=1.5, solid_joinstyle="round")


def _damper(ax: Axes) -> None:
    """Draw a dashpot: an open cylinder fixed to the frame, a piston fixed to the mass."""
    back, mouth, piston, half = 1.45, 2.65, 2.15, 0.26
    ax.plot([_FRAME, back], [_DAMPER] * 2, color=INK, linewidth=1.5)
    ax.plot([mouth, back, back, mouth], [_DAMPER + half] * 2 + [_DAMPER - half] * 2, color=INK, linewidth=1.5)
    ax.plot([piston] * 2, [_DAMPER - 0.8 * half, _DAMPER + 0.8 * half], color=INK, linewidth=3.0)
    ax.plot([piston, _MASS_LEFT], [_DAMPER] * 2, color=INK, linewidth=1.5)


def _arrow(ax: Axes, start: tuple[float, float], end: tuple[float, float], color: str, both: bool = False) -> None:
    look = {"arrowstyle": "<|-|>" if both else "-|>", "color": color, "linewidth": 1.5, "shrinkA": 0, "shrinkB": 0,
            "mutation_scale": 14}  # fmt: skip
    ax.annotate("", xy=end, xytext=start, arrowprops=look)


def _mass(ax: Axes) -> None:
    """Draw the mass on its two rollers."""
    width = _MASS_RIGHT - _MASS_LEFT
    ax.add_patch(FancyBboxPatch((_MASS_LEFT + 0.08, 0.38), width - 0.16, 2.1, boxstyle="round,pad=0.08",
                                facecolor="#d6e6f2", edgecolor=BLUE, linewidth=1.8))  # fmt: skip
    for roller in (_MASS_LEFT + 0.55, _MASS_RIGHT - 0.55):
        ax.plot(roller, 0.15, "o", markersize=8.5, markerfacecolor="white", markeredgecolor=INK, markeredgewidth=1.3)


@on_axes
def oscillator_sketch(oscillator: Model | None = None, ax: Axes | None = None) -> Axes:
    r"""Draw the model: mass, spring, damper, sine force, clearance and stop.

    .. math:: m \ddot y + c \dot y + k y = f \sin \omega t \quad (y < g), \qquad
              \dot y \to -r \dot y \quad (y = g,\ \dot y > 0)

    Parameters
    ----------
    oscillator : ImpactOscillator or family, optional
        The oscillator whose parameters are written below the sketch; None writes none.

    References
    ----------
    Lee, equation 1 (with the misprint k y' for k y) and figure 1.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> oscillator_sketch(vi.ImpactOscillator(omega=2.8)).axison
    False
    """
    drawn = isinstance(oscillator, Model) and not isinstance(oscillator, type) and oscillator.at().says_all
    if oscillator is not None and not drawn:
        raise labels.refused("oscillator", oscillator, "an ImpactOscillator or a family", "leave it out to write none")
    ax = style.new_axes(ax, (7.2, 3.4))
    ax.set_axis_off()
    ax.set_aspect("equal")
    _wall(ax, _FRAME - 0.45, _FRAME, _BOTTOM, _TOP, "right")
    _wall(ax, _STOP, _STOP + 0.6, 0.35, 2.45, "left")
    _wall(ax, _FRAME - 0.45, _STOP + 0.6, _BOTTOM - 0.4, _BOTTOM, "top")
    _spring(ax)
    _damper(ax)
    _mass(ax)
    _arrow(ax, (_MASS_RIGHT, 1.65), (_MASS_RIGHT + 1.15, 1.65), RED)
    # The rest position of the striking face: both y and the clearance are measured from it.
    ax.plot([_MASS_RIGHT] * 2, [2.5, 3.25], color=INK, linewidth=0.9, linestyle=(0, (4, 2)))
    _arrow(ax, (_MASS_RIGHT, 3.05), (_MASS_RIGHT + 0.9, 3.05), INK)
    _arrow(ax, (_MASS_RIGHT, 0.75), (_STOP, 0.75), INK, both=True)
    for x, y, text, color in (
        (2.0, 2.55, "$k$", INK),
        (2.0, 1.22, "$c$", INK),
        (5.2, 1.4, "$m$", BLUE),
        (7.18, 1.98, r"$f\,\sin\,\omega t$", RED),
        (7.5, 3.05, "$y$", INK),
        (7.2, 0.98, "$g$", INK),
        (_STOP + 0.3, 2.7, "$r$", INK),
    ):
        ax.text(x, y, text, color=color, fontsize=14, ha="center", va="center")
    if oscillator is not None:
        text = ",  ".join(labels.parameter_text(name, oscillator) for name in oscillator.values)
        ax.text(4.0, -0.8, style.broken(text, 75), ha="center", va="center", fontsize=8.5, color="#555555")
    ax.set_xlim(_FRAME - 0.6, _STOP + 0.75)
    ax.set_ylim(-0.55 if oscillator is None else -1.1, 3.4)
    return ax


def comparison_figure(
    designs: xr.Dataset | Sequence[Model],
    *,
    names: Sequence[str] = ("A", "B"),
    periods: float = 8,
    size: tuple[float, float] = (11.0, 12.0),
) -> Figure:
    """Draw the settled motions of two designs side by side: time history, phase portrait, impact map.

    Parameters
    ----------
    designs : xarray.Dataset or two models
        The `dataset` of a `vibroimpact.compare` result, or the two designs: oscillators, systems or families. For
        systems, the first coordinate is drawn, or, if no stop acts on it alone, the clearance of the first stop.
    names : two str
        The names of the two designs; a dataset includes its names.
    periods : float, > 0
        Number of driving periods shown.
    size : (float, float), 0.5 to 100
        Width and height in inches.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ValueError
        `designs` is neither a comparison nor two models.

    Notes
    -----
    Each motion starts from rest and is drawn after 1000 driving periods. If other motions hit harder, the title of a
    comparison gives their impact velocity and share of initial conditions. Axes in a row have the same limits unless
    the motions differ more than fourfold in size, or a system's stops are shown.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> figure = comparison_figure([vi.ImpactOscillator(omega=1.4), vi.ImpactOscillator(omega=2.8)])
    >>> len(figure.axes), figure.axes[1].get_title().splitlines()[0]
    (6, 'B: chaotic from rest')
    """
    import matplotlib.pyplot as plt

    models, heads, differing = _designs(designs, several("names", names, "two names"))
    style.load_back_end()
    with mpl.rc_context(style.STYLE):
        figure, axes = plt.subplots(3, 2, figsize=check_size(size), layout="constrained")
    for column, (osc, head, texts) in enumerate(zip(models, heads, differing, strict=True)):
        section = impact_section(osc, transient_impacts=SETTLED, sample_impacts=SAMPLED)
        motion = simulate(osc, start=_settled_state(osc), periods=periods)
        time_history(motion, ax=axes[0, column])
        phase_portrait(motion, ax=axes[1, column])
        impact_map(section, ax=axes[2, column])
        axes[0, column].set_title("\n".join([*head, ",  ".join(texts)]), fontsize=10)
    if all(map(_has_one_fixed_stop, models)):
        gaps = [model.stops[0].gap for model in models]
        _share(axes[0], "y", gaps)
        _share(axes[1], "x", gaps)
    _share(axes[1], "y")
    if all(ax.lines for ax in axes[2]):
        _share(axes[2], "y")
    return figure


Designs = tuple[list[Any], list[list[str]], list[list[str]]]


def _designs(designs: Any, names: Sequence[str]) -> Designs:
    """Return the oscillators or systems of two designs, their names and motions, and their differences as text."""
    if isinstance(designs, xr.Dataset) and designs.attrs.get("function") == "compare":
        return _compared(designs)
    models = designs if isinstance(designs, (list, tuple)) else ()
    if len(models) == len(names) == 2 and all(isinstance(model, Model) for model in models):
        a, b = (model.values for model in models)
        differing = [name for name in a if a[name] != b.get(name)]
        texts = [[labels.parameter_text(name, model) for name in differing if name in model.values] for model in models]
        heads = [
            [f"{name}: {_motion_from_rest(model.at())} from rest"] for name, model in zip(names, models, strict=True)
        ]
        return [model.at() for model in models], heads, texts
    allowed = "the dataset of a comparison, or two models with two names"
    raise labels.refused("designs", designs, allowed, "pass for example compare(a, b).dataset")


def _compared(dataset: xr.Dataset) -> Designs:
    """Return the designs of a comparison from its dataset."""
    models = [model_from(plain) for plain in arguments_of(dataset)["oscillators"]]
    family = family_in(dataset)
    names = family[1] if family else models[0].values
    parameters = [dataset[name] for name in names if name in dataset]
    differing = [(labels.described(pair), pair.values) for pair in parameters if pair.values[0] != pair.values[1]]
    texts = [
        [labels.parameter_value_text(symbol, values[i], units) for (_, units, symbol), values in differing]
        for i in range(2)
    ]
    return models, [list(_heads(dataset.isel(design=i))) for i in range(2)], texts


def _heads(design: xr.Dataset) -> Iterator[str]:
    """Yield the motion of a design from rest, and a harder one reached from other initial conditions."""
    yield f"{design['design'].item()}: {design['motion'].item()} from rest"
    if "worst_share" in design and np.isfinite(share := float(design["worst_share"])):
        yield f"from {labels.percent(share)} of initial conditions: {design['worst_motion'].item()}"
        yield f"up to {quantity(float(design['worst_velocity']), 'm/s', 4)}"


def _motion_from_rest(model: Any) -> str:
    """Return the name of the motion that is reached from rest."""
    window: dict[str, Any] = {"transient_impacts": SETTLED, "sample_impacts": SAMPLED}
    cell = classify(parameter_map(model, omega=[model.omega], indices=NAMING, **window)).isel(omega=0)
    return motion_name(int(refined(cell["motion"], cell["status"])), int(cell["n_periods"]), int(cell["n_impacts"]))


def _settled_state(model: Model) -> State | None:
    """Return the state of the settled motion at phase 0, before an impact there; None if there is none."""
    looks = stroboscopic_section(model, transient_periods=SETTLED, sample_periods=1)
    if not looks.sizes["period"]:
        return None
    displacement, velocity = (looks[name][0].values.tolist() for name in ("displacement", "velocity"))
    return State(displacement, velocity)


def _has_one_fixed_stop(model: Any) -> bool:
    """Whether the models can share axis limits: one coordinate below one fixed impenetrable stop."""
    return model.coordinates == len(model.stops) == 1 and not (
        model.stops[0].motion or model.stops[0].direction[0] < 0.0 or not model.stops[0].element.impenetrable
    )


def _share(axes: Sequence[Axes], along: str, gaps: Sequence[float] | None = None) -> None:
    """Set the same limits for axes of comparable size, and extend the stop to them."""
    views = [ax.get_xlim() if along == "x" else ax.get_ylim() for ax in axes]
    low, high = min(low for low, _ in views), max(high for _, high in views)
    if high - low > COMPARABLE * min(b - a for a, b in views):
        return
    for i, ax in enumerate(axes):
        (ax.set_xlim if along == "x" else ax.set_ylim)(low, high)
        if gaps is not None and gaps[i] < high:
            style.draw_stop(ax, gaps[i], high, upright=along == "x")
