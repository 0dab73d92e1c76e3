"""Animation of a motion: the mass moves along its time history."""

from __future__ import annotations

import math
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from vibroimpact.dataset import arguments_of
from vibroimpact.files import check_output, replacing
from vibroimpact.parameters import positive_number
from vibroimpact.plotting.orbits import time_history
from vibroimpact.plotting.style import INK
from vibroimpact.progress import Report, reporter

ENDINGS = (".gif", ".mp4")
RATE = 25  # frames per second
MOST = 3000  # frames: two minutes
PERIODS = 10  # driving periods per page
DOTS = 100  # per inch


def animate(
    simulation: xr.Dataset,
    path: str | os.PathLike[str],
    *,
    seconds: float = 12.0,
    coordinate: int | None = None,
    stop: str | None = None,
    overwrite: bool = False,
    progress: bool | Report | None = None,
) -> Path:
    """Write a motion as a film of the given duration.

    Parameters
    ----------
    simulation : xarray.Dataset
        The result of `vibroimpact.simulate`.
    path : path
        A `.gif` or `.mp4` file. The latter needs ffmpeg, installed on the system or with the package imageio-ffmpeg.
    seconds : float, > 0 to 120
        Duration of the film, at 25 frames per second; the motion is stretched to it.
    coordinate : int, optional
        For systems, the coordinate shown, as in `time_history`.
    stop : str, optional
        For systems, the stop whose clearance is shown instead.
    overwrite : bool
        Whether an existing film may be replaced.
    progress : bool or callable, optional
        None shows a temporary line on a terminal or in a notebook if it takes more than a second.
        True shows a bar; a callable gets (frames done, frames in all, None) and stops by returning False, which raises
        `KeyboardInterrupt`.

    Returns
    -------
    pathlib.Path
        The path of the film.

    Raises
    ------
    ValueError
        The extension is neither `.gif` nor `.mp4`, ffmpeg is not found for an `.mp4`, or the film is too long.
    OSError
        The film exists and `overwrite` is false, or it cannot be written.

    Notes
    -----
    A page shows ten driving periods; a longer motion continues on further pages. Displacements are interpolated between
    samples, so `simulate` with enough samples for the film. A frame takes about 10 ms.

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

    def watched(report: Report) -> Iterator[Image.Image]:
        for done, frame in enumerate(_frames(ax, simulation, number), 1):
            yield frame
            if report(done, number, None) is False:
                raise KeyboardInterrupt

    try:
        with reporter(progress, "frames") as report, replacing(target, overwrite=overwrite) as part:
            write(part, watched(report))
    finally:
        plt.close(ax.get_figure(root=True))
    return target


def _frames(ax: Axes, simulation: xr.Dataset, number: int) -> Iterator[Image.Image]:
    """Yield the frames; each page is drawn once and the mass is added to it."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    figure.set_dpi(DOTS)
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    figure.set_layout_engine("none")  # otherwise each page would be laid out anew, and the picture would jump
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
    """Return the driving period, from the number of samples per period."""
    density = arguments_of(simulation)["samples_per_period"]
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
                "an .mp4 file needs ffmpeg; install ffmpeg, or `pip install imageio-ffmpeg`, or write a .gif"
            ) from None
        program = get_ffmpeg_exe()

    def write(path: Path, frames: Iterator[Image.Image]) -> None:
        first = next(frames)
        width, height = (side - side % 2 for side in first.size)  # the usual colour format of videos needs even numbers
        command = [program, "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}",
                   "-r", str(RATE), "-i", "-", "-pix_fmt", "yuv420p", "-f", "mp4", "-y", str(path)]  # fmt: skip
        with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as running:
            assert running.stdin is not None
            try:
                with suppress(BrokenPipeError):  # ffmpeg has ended, and its message says why
                    for frame in chain((first,), frames):
                        running.stdin.write(frame.crop((0, 0, width, height)).tobytes())
                errors = running.communicate()[1].decode(errors="replace")
            except BaseException:  # at an interruption, the context would wait for a quarter of a second only
                running.kill()
                running.wait()
                raise
        if running.returncode:
            raise OSError(f"ffmpeg could not write {path.name}: {errors.strip()[-200:]}")

    return write
