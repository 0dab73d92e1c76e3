"""Figures on disk, written completely or not at all."""

from __future__ import annotations

import os
from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroimpact.files import check_output, replacing
from vibroimpact.parameters import invalid

ENDINGS = (".png", ".svg", ".pdf")

# Without a date and with fixed identifiers, the same figure is the same file.
_UNDATED: dict[str, dict[str, None]] = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}


def save_figure(
    figure: Axes | Figure,
    path: str | os.PathLike[str],
    size: tuple[float, float] | None = None,
    dpi: float = 150.0,
    overwrite: bool = False,
) -> Path:
    """Write a figure under its final name in one step, so that no half-written file ever appears there.

    Parameters
    ----------
    figure : matplotlib.axes.Axes or matplotlib.figure.Figure
        What to write; of axes, the whole figure that holds them.
    path : path
        The file; its ending, .png, .svg or .pdf, sets the format.
    size : (float, float), optional
        Width and height in inches; None keeps the figure's own.
    dpi : float, > 0
        Dots per inch, also of pixel parts inside an .svg or .pdf.
    overwrite : bool
        Whether an existing file may be replaced.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    ValueError
        The ending, `size` or `dpi` is not allowed.
    OSError
        The file exists and `overwrite` is False, or it cannot be written; nothing is left behind.

    Examples
    --------
    >>> import tempfile, vibroimpact as vi
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_figure(vi.plotting.oscillator_sketch(), f"{folder}/model.svg").name
    'model.svg'
    """
    if not dpi > 0:
        raise invalid("dpi", dpi, "a number above 0", "150 is usual")
    if size is not None and (len(size) != 2 or not min(size) > 0):
        raise invalid("size", size, "a width and a height above 0 in inches", "(8, 5) is usual")
    whole = figure if isinstance(figure, Figure) else figure.get_figure(root=True)
    if whole is None:
        raise ValueError(
            "`figure` must be axes that belong to a figure; these were removed from theirs, draw them again"
        )
    target = check_output(path, overwrite=overwrite, endings=ENDINGS)
    ending, own_size = target.suffix.lower(), whole.get_size_inches()
    try:
        if size is not None:
            whole.set_size_inches(*size)
        with replacing(target, overwrite=overwrite) as part, mpl.rc_context({"svg.hashsalt": "vibroimpact"}):
            whole.savefig(part, dpi=dpi, format=ending[1:], metadata=_UNDATED[ending])
    finally:
        whole.set_size_inches(*own_size)
    return target
