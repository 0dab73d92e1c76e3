"""The model: a mass on a spring and a damper, shaken by a sine, in front of a stop."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch, Rectangle

from vibroimpact.oscillator import ImpactOscillator
from vibroimpact.plotting.style import BLUE, INK, RED, new_axes, value_text

# Where things stand, in drawing units: frame | spring and damper | mass | clearance | stop.
_FRAME, _MASS_LEFT, _MASS_RIGHT, _STOP = 0.0, 4.0, 6.4, 8.0
_BOTTOM, _TOP = 0.0, 2.8
_SPRING, _DAMPER = 2.05, 0.75


def _wall(ax: Axes, left: float, right: float, bottom: float, top: float, face: str) -> None:
    """Draw fixed ground: hatched, with a firm line on the side named by `face`."""
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
    style = {"arrowstyle": "<|-|>" if both else "-|>", "color": color, "linewidth": 1.5, "shrinkA": 0, "shrinkB": 0,
             "mutation_scale": 14}  # fmt: skip
    ax.annotate("", xy=end, xytext=start, arrowprops=style)


def _mass(ax: Axes) -> None:
    """Draw the mass on its two rollers."""
    width = _MASS_RIGHT - _MASS_LEFT
    ax.add_patch(FancyBboxPatch((_MASS_LEFT + 0.08, 0.38), width - 0.16, 2.1, boxstyle="round,pad=0.08",
                                facecolor="#d6e6f2", edgecolor=BLUE, linewidth=1.8))  # fmt: skip
    for roller in (_MASS_LEFT + 0.55, _MASS_RIGHT - 0.55):
        ax.plot(roller, 0.15, "o", markersize=8.5, markerfacecolor="white", markeredgecolor=INK, markeredgewidth=1.3)


def oscillator_sketch(oscillator: ImpactOscillator | None = None, ax: Axes | None = None) -> Axes:
    r"""Draw the model: mass, spring, damper, sine force, clearance and stop.

    .. math:: m \ddot y + c \dot y + k y = f \sin \omega t \quad (y < g), \qquad
              \dot y \to -r \dot y \quad (y = g,\ \dot y > 0)

    Parameters
    ----------
    oscillator : ImpactOscillator, optional
        Whose seven numbers stand under the sketch.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure without it.

    Returns
    -------
    matplotlib.axes.Axes

    References
    ----------
    Lee, equation 1 (which prints k y' for k y, a misprint) and figure 1.

    Examples
    --------
    >>> oscillator_sketch(ImpactOscillator(omega=2.8)).axison
    False
    """
    ax = new_axes(ax, (7.2, 3.4))
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
        numbers = ("mass", "damping", "stiffness", "amplitude", "omega", "restitution", "gap")
        text = ",   ".join(value_text(name, getattr(oscillator, name)) for name in numbers)
        ax.text(4.0, -0.75, text, ha="center", va="center", fontsize=8.5, color="#555555")
    ax.set_xlim(_FRAME - 0.6, _STOP + 0.75)
    ax.set_ylim(-0.55 if oscillator is None else -1.0, 3.4)
    return ax
