"""Response curves: amplitudes along a parameter, with and without contact."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from vibroimpact.dataset import varied_parameters
from vibroimpact.parameters import choice
from vibroimpact.plotting import labels, style
from vibroimpact.plotting.continuation import LOOKS, UNSTABLE, draw_special, split
from vibroimpact.plotting.style import BLUE, INK, on_axes

QUANTITIES = "amplitude", "rms", "mean", "harmonic_amplitude", "harmonic_phase"


@on_axes
def response_curve(curve: Any, quantity: str = "amplitude", ax: Axes | None = None) -> Axes:
    """Draw a response curve: without contact black, with contact blue, stable parts solid, unstable parts dashed.

    Parameters
    ----------
    curve : ResponseCurve or xarray.Dataset
        The result of `vibroimpact.response_curve`, or its `dataset`.
    quantity : {"amplitude", "rms", "mean", "harmonic_amplitude", "harmonic_phase"}
        What to draw over the parameter.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> curve = vi.response_curve(vi.ImpactOscillator(damping=0.1, gap=1.5), omega=(0.3, 3.0), step=0.05)
    >>> ax = response_curve(curve)
    >>> [text.get_text() for text in ax.get_legend().get_texts()][:3]
    ['without contact', 'with contact', 'with contact, unstable']
    """
    drawn = getattr(curve, "dataset", curve)
    if not isinstance(drawn, xr.Dataset) or not {"part", "special_kind", *QUANTITIES} <= set(drawn.variables):
        raise labels.refused("curve", drawn, "a response curve", "pass what vibroimpact.response_curve returns")
    name = choice("quantity", quantity, QUANTITIES)
    (parameter,) = varied_parameters(drawn)
    ax = style.new_axes(ax, (8.0, 5.0), labels.title(drawn))
    possible = drawn.assign(admissible=xr.ones_like(drawn["stable"]))
    entries: dict[str, Line2D] = {}
    for number in np.unique(drawn["part"].values):
        part = possible.isel(point=drawn["part"].values == number)
        touches = bool(part["impacts"].values.any())
        color, words = (BLUE, "with contact") if touches else (INK, "without contact")
        for piece in split(part, parameter, name):
            ax.plot(piece.values, piece.heights, color=color, zorder=3, **LOOKS[piece.look] | {"label": None})
            text = f"{words}, unstable" if piece.look == UNSTABLE else words
            entries.setdefault(text, Line2D([], [], color=color, **LOOKS[piece.look] | {"label": text}))
    ax.set_xlim(*style.view(drawn[parameter].values, float(np.abs(drawn[parameter].values).max()) or 1.0))
    labels.label_axes(ax, drawn[parameter], drawn[name])
    style.legend_below(ax, [*entries.values(), *draw_special(ax, [drawn], name)])
    return ax
