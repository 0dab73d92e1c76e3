"""A motion as a film: where the mass is, how long it takes, and that no film is half written."""

import os
import sys

import numpy as np
import pytest
from PIL import Image

import vibroimpact as vi
from vibroimpact.plotting import animate
from vibroimpact.plotting.animation import RATE


@pytest.fixture(scope="module")
def motion():
    return vi.simulate(vi.ImpactOscillator(omega=2.8), periods=25, samples_per_period=500)


def frames(path):
    with Image.open(path) as film:
        for number in range(film.n_frames):
            film.seek(number)
            assert film.info["duration"] == 1000 // RATE
            yield np.asarray(film.convert("RGB")).astype(int)


@pytest.mark.long
def test_the_mass_runs_from_left_to_right_once_a_page_along_the_displacement(motion, tmp_path):
    pictures = list(frames(animate(motion, tmp_path / "motion.gif", seconds=3.0)))
    assert len(pictures) == 75
    # The square is the largest dark thing: sums over 12 x 12 pixels find it.
    places = []
    for picture in pictures:
        black = (picture < 60).all(-1)
        square = sum(np.roll(np.roll(black, -i, 0), -j, 1) for i in range(12) for j in range(12))
        places.append(np.argwhere(square == square.max()).mean(0))
    rows, columns = np.array(places).T
    turns = np.flatnonzero(np.diff(columns) < 0)
    assert len(turns) == 2  # 25 periods are three pages
    now = np.linspace(*motion["time"].values[[0, -1]], 75)
    height = np.interp(now, motion["time"], motion["displacement"])
    slope, offset = np.polyfit(height, rows, 1)
    assert slope < 0.0  # upwards on the picture
    assert abs(rows - (slope * height + offset)).max() < 1.5


def test_an_mp4_has_as_many_frames(motion, tmp_path):
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    path = animate(motion, tmp_path / "motion.mp4", seconds=1.0)
    number, seconds = ffmpeg.count_frames_and_secs(path)
    assert (number, seconds) == (25, pytest.approx(1.0, abs=0.05))


def test_of_a_system_the_coordinate_or_stop_is_shown_that_is_asked_for(tmp_path):
    motion = vi.simulate(vi.models.two_sided_oscillator(), periods=3)
    first = next(frames(animate(motion, tmp_path / "a.gif", seconds=0.1)))
    other = next(frames(animate(motion, tmp_path / "b.gif", seconds=0.1, stop=motion["stop"].values[0])))
    assert (first != other).any()


@pytest.mark.parametrize("ending", [".gif", ".mp4"])
def test_a_film_that_is_interrupted_leaves_what_was_there(motion, tmp_path, ending):
    path = tmp_path / f"motion{ending}"
    path.write_bytes(b"before")
    with pytest.raises(KeyboardInterrupt):
        animate(motion, path, overwrite=True, progress=lambda done, total, partial: done < 5)
    assert path.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [path]


@pytest.fixture
def in_place_of_ffmpeg(tmp_path, monkeypatch):
    """Return a function that lets Python code do the work of ffmpeg, and a file that it may write to."""
    written, program = tmp_path / "written", tmp_path / "ffmpeg"

    def replace(code):
        program.write_text(f"#!{sys.executable}\nimport os, sys, time\nwritten = {str(written)!r}\n{code}")
        program.chmod(0o755)
        monkeypatch.setattr("shutil.which", lambda name: str(program))

    return replace, written


def test_an_interrupted_film_leaves_no_process_that_writes_it(motion, tmp_path, in_place_of_ffmpeg):
    replace, written = in_place_of_ffmpeg
    replace("open(written, 'w').write(str(os.getpid()))\nsys.stdin.buffer.read()\ntime.sleep(600)")
    with pytest.raises(KeyboardInterrupt):
        animate(motion, tmp_path / "motion.mp4", progress=lambda *done: False)
    with pytest.raises(ProcessLookupError):
        os.kill(int(written.read_text()), 0)


def test_when_ffmpeg_ends_early_its_message_is_passed_on(motion, tmp_path, in_place_of_ffmpeg):
    in_place_of_ffmpeg[0]("sys.exit('No space left on device')")
    with pytest.raises(OSError, match=r"ffmpeg could not write .*motion.*: No space left on device"):
        animate(motion, tmp_path / "motion.mp4")
    assert not list(tmp_path.glob("motion*"))


def test_what_cannot_be_a_film_is_refused(motion, tmp_path):
    with pytest.raises(ValueError, match=r"must end in \.gif or \.mp4"):
        animate(motion, tmp_path / "motion.png")
    for seconds in (0.0, -1.0, float("nan"), 121.0):
        with pytest.raises(ValueError, match="`seconds` must be"):
            animate(motion, tmp_path / "motion.gif", seconds=seconds)
    (tmp_path / "motion.gif").touch()
    with pytest.raises(FileExistsError, match="motion.gif"):
        animate(motion, tmp_path / "motion.gif")


def test_without_ffmpeg_the_message_says_how_to_install_it(motion, tmp_path, monkeypatch):
    monkeypatch.setattr("shutil.which", lambda name: None)
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
    with pytest.raises(
        ValueError, match=r"needs ffmpeg; install ffmpeg, or `pip install imageio-ffmpeg`, or write a \.gif"
    ):
        animate(motion, tmp_path / "motion.mp4")


@pytest.mark.long
def test_the_command_line_writes_films_of_motions_alone(run):
    code, out, _ = run("simulate -p omega=2.8 --periods 3 --out motion.gif")
    assert code == 0
    assert out[-1].startswith("wrote motion.gif")
    code, _, complaint = run("simulate -p omega=2.8 --out other.gif --figure phase-portrait")
    assert code == 2
    assert "a film shows the time history" in complaint[-1]
    code, _, complaint = run("diagram --x omega=2:3:5 --out diagram.gif")
    assert code == 2
    assert "`out` must end in" in complaint[-1]
