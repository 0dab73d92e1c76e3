"""A motion as a film: the mass on its time history."""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from vibroimpact.files import check_output, replacing
from vibroimpact.parameters import positive_number
from vibroimpact.plotting.orbits import time_history
from vibroimpact.plotting.style import INK

ENDINGS = (".gif", ".mp4")
RATE = 25  # frames a second
MOST = 3000  # frames, two minutes
PERIODS = 10  # of the driving, at once
DOTS = 100


def animate(
    simulation: xr.Dataset,
    path: str | os.PathLike[str],
    *,
    seconds: float = 12.0,
    coordinate: int | None = None,
    stop: str | None = None,
    overwrite: bool = False,
    progress: Callable[[int, int, Any], bool] | None = None,
) -> Path:
    """Write a motion as a film of so many seconds, whatever time it takes itself.

    Parameters
    ----------
    simulation : xarray.Dataset
        What `vibroimpact.simulate` returns.
    path : path
        `.gif`, or `.mp4`, written by ffmpeg: that of the system, or of the package imageio-ffmpeg.
    seconds : float, > 0 to 120
        How long the film takes, at 25 frames a second.
    coordinate : int, optional
        For systems, which coordinate is shown, as in `time_history`.
    stop : str, optional
        For systems, the stop whose clearance is shown instead.
    overwrite : bool
        Whether an existing film may be replaced.
    progress : callable, optional
        Gets (frames done, frames in all, None) and returns whether to go on; else `KeyboardInterrupt` is raised.

    Returns
    -------
    pathlib.Path
        The path of the film.

    Raises
    ------
    ValueError
        The ending is neither `.gif` nor `.mp4`, no ffmpeg is found for the latter, or the film is too long.
    OSError
        The film exists and `overwrite` is false, or it cannot be written.

    Notes
    -----
    Ten driving periods are seen at once; a longer motion turns pages. Between samples displacements are interpolated:
    ask `simulate` for as many as the film shall show. 10 ms a frame.

    Examples
    --------
    >>> import tempfile, vibroimpact as vi
    >>> motion = vi.simulate(vi.ImpactOscillator(omega=2.0), periods=2)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     animate(motion, f"{folder}/motion.gif", seconds=0.2).name
    'motion.gif'
    """
    target = check_output(path, overwrite=overwrite, endings=ENDINGS)
    number = max(round(positive_number("seconds", seconds) * RATE), 1)
    if number > MOST:
        raise ValueError(f"`seconds` must be at most {MOST / RATE:g}, got {seconds:g}")
    write = _write_gif if target.suffix.lower() == ".gif" else _mp4_writer()
    ax = time_history(simulation, coordinate=coordinate, stop=stop)

    def watched() -> Iterator[Image.Image]:
        for done, frame in enumerate(_frames(ax, simulation, number), 1):
            yield frame
            if progress is not None and not progress(done, number, None):
                raise KeyboardInterrupt

    try:
        with replacing(target, overwrite=overwrite) as part:
            write(part, watched())
    finally:
        plt.close(ax.get_figure(root=True))
    return target


def _frames(ax: Axes, simulation: xr.Dataset, number: int) -> Iterator[Image.Image]:
    """Draw each page once, and the mass upon it."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    figure.set_dpi(DOTS)
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    figure.set_layout_engine("none")  # else every page were laid out anew, and the motion jumped
    times, places = (np.asarray(values, np.float64) for values in ax.lines[0].get_data())
    begin, end = (float(simulation["time"][i]) for i in (0, -1))
    pages = max(math.ceil((end - begin) / (PERIODS * _period(simulation)) - 1e-6), 1)
    page, width = -1, (end - begin) / pages
    (mass,) = ax.plot([], [], "s", color=INK, markersize=11, zorder=6, clip_on=False, animated=True)
    for now in np.linspace(begin, end, number):
        if (at := min(int((now - begin) / width), pages - 1)) != page:
            page = at
            ax.set_xlim(begin + page * width, begin + (page + 1) * width)
            canvas.draw()
            blank = canvas.copy_from_bbox(figure.bbox)
        canvas.restore_region(blank)
        mass.set_data([now], [np.interp(now, times, places)])
        ax.draw_artist(mass)
        yield Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())


def _period(simulation: xr.Dataset) -> float:
    """Return the driving period, from the samples taken of each."""
    density = json.loads(simulation.attrs["arguments"])["samples_per_period"]
    return float(np.diff(simulation["time"].values).mean()) * float(density)


def _write_gif(path: Path, frames: Iterator[Image.Image]) -> None:
    palette = next(frames).quantize(256, Image.Quantize.MAXCOVERAGE)
    rest = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    with path.open("wb") as file:
        palette.save(file, "GIF", save_all=True, append_images=rest, duration=1000 // RATE, loop=0)


def _mp4_writer() -> Callable[[Path, Iterator[Image.Image]], None]:
    """Return the writer of an `.mp4`; raise `ValueError` where no ffmpeg is found."""
    program = shutil.which("ffmpeg")
    if program is None:
        try:
            from imageio_ffmpeg import get_ffmpeg_exe
        except ImportError:
            raise ValueError(
                "`out` ends in .mp4, which needs ffmpeg; install that, or imageio-ffmpeg by pip, or write a .gif"
            ) from None
        program = get_ffmpeg_exe()

    def write(path: Path, frames: Iterator[Image.Image]) -> None:
        first = next(frames)
        width, height = (side - side % 2 for side in first.size)  # as the usual colours of films need
        command = [program, "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}",
                   "-r", str(RATE), "-i", "-", "-pix_fmt", "yuv420p", "-f", "mp4", "-y", str(path)]  # fmt: skip
        with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as running:
            assert running.stdin is not None
            assert running.stderr is not None
            for frame in chain((first,), frames):
                running.stdin.write(frame.crop((0, 0, width, height)).tobytes())
            running.stdin.close()
            errors = running.stderr.read().decode(errors="replace")
        if running.returncode:
            raise OSError(f"ffmpeg could not write {path.name}: {errors.strip()[-200:]}")

    return write
