"""The command line end to end: words, files, one line for every fault, nothing half-written."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr

import vibroimpact as vi
from vibroimpact import formats
from vibroimpact.cli import main
from vibroimpact.cli.progress import Meter

COMMANDS = ("simulate", "section", "diagram", "map", "plot", "reproduce")


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Run a command in an empty folder; return exit code, lines told and lines of complaint."""
    monkeypatch.chdir(tmp_path)

    def ran(command: str):
        capsys.readouterr()
        code = main(command.split())
        told = capsys.readouterr()
        return code, told.out.splitlines(), told.err.splitlines()

    return ran


def child(*arguments: str, **options):
    return subprocess.Popen(
        [sys.executable, "-m", "vibroimpact", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )


def names(folder):
    return sorted(path.name for path in folder.iterdir())


# Help


@pytest.mark.parametrize("command", [[], ["--help"], *([name, "--help"] for name in COMMANDS)])
def test_help_tells_an_example_and_imports_nothing_heavy(command):
    code = (
        "import sys; from vibroimpact.cli import main; code = main(sys.argv[1:]); "
        "print('heavy:', {'numba', 'numpy', 'xarray', 'matplotlib', 'pandas', 'pydantic'} & set(sys.modules), code)"
    )
    done = subprocess.run([sys.executable, "-c", code, *command], capture_output=True, text=True, check=True)
    assert "heavy: set() 0" in done.stdout
    assert re.search(r"\n +vibroimpact ", done.stdout.split("For example:")[1])


def test_version_is_that_of_the_package(run):
    assert run("--version") == (0, [f"vibroimpact {vi.__version__}"], [])


# Words


def test_the_motion_is_named_in_a_sentence_with_units(run):
    code, told, complaints = run("section -p omega=0.9")
    assert (code, complaints) == (0, [])
    assert told[0] == "period-1 impact-2, hits at 1.48 and 1.13 m/s each 6.98 s"


@pytest.mark.parametrize("parameter", ["omega=2.0", "w=2", f"frequency={1 / np.pi}"])
def test_a_parameter_goes_by_word_symbol_or_frequency_in_hz(run, parameter):
    _, told, _ = run(f"section -p {parameter} --sample-impacts 200")
    assert told[0] == "period-1 impact-1, hits at 6.23 m/s each 3.14 s"


def test_a_stroboscopic_section_is_told_by_its_period(run):
    _, told, _ = run("section -p w=4 --kind stroboscopic --sample-periods 50")
    assert told[0] == "period-2, repeats each 3.14 s"


def test_a_simulation_is_told_with_its_hits_and_what_it_settles_to(run):
    code, told, _ = run("simulate -p w=0.9 --start -1,0,0 --periods 5")
    assert code == 0
    assert told[0].startswith("5 driving periods of 6.981 s")
    assert any("the hardest at" in line for line in told)
    assert told[-1] == "settles to: period-1 impact-2, hits at 1.48 and 1.13 m/s each 6.98 s"


def test_a_diagram_is_told_by_its_stretches(run):
    _, told, _ = run("diagram --x omega=1.8:2.2:5 --sample-impacts 200")
    assert told[0] == "5 values of angular driving frequency 1.8 to 2.2 rad/s"
    assert "  omega 1.8 to 2.2: 1 impact a cycle" in told


def test_a_map_is_told_by_ranges_shares_and_speed(run):
    _, told, progress = run("map --x omega=2:2.8:3 --y m=1:2:2 --indices std,max_velocity --sample-impacts 200")
    assert told[0] == "3 x 2 cells: angular driving frequency 2 to 2.8 rad/s; mass 1 to 2 kg"
    assert re.match(r"largest impact velocity \(max_velocity\): .* m/s, largest at omega = \S+, mass = \S+", told[2])
    assert sum(float(line.split()[0]) for line in told if " % " in line) == pytest.approx(100.0, abs=0.5)
    assert re.match(r"computed in .* s, .* impacts/s", told[-1])
    assert re.match(r"map: 100 % of 6, .* impacts/s, .* s", progress[-1])


def test_a_motion_without_impacts_is_told_and_no_fault(run):
    code, told, _ = run("section -p gap=10")
    assert code == 0
    assert told[0] == "no impact: the mass never reaches the stop from this start"


# Files


def test_a_result_is_written_in_the_format_its_ending_names(run, tmp_path):
    for ending in (".zarr", ".nc", ".csv", ".mat", ".png", ".svg", ".pdf"):
        code, told, _ = run(f"map --x omega=2:2.8:3 --y m=1:2:2 --sample-impacts 50 --out map{ending}")
        assert code == 0
        assert told[0].startswith(f"wrote map{ending}")
    with xr.open_zarr(tmp_path / "map.zarr", consolidated=False) as stored:
        assert stored["std"].dims == ("omega", "mass")
    assert (tmp_path / "map.png").read_bytes()[1:4] == b"PNG"
    assert b"<svg" in (tmp_path / "map.svg").read_bytes()
    assert (tmp_path / "map.pdf").read_bytes()[:4] == b"%PDF"


def test_every_command_draws_its_figure(run, tmp_path):
    for command in (
        "simulate --periods 3",
        "simulate --periods 3 --figure phase-portrait",
        "section --sample-impacts 20",
        "section --kind stroboscopic --sample-periods 20",
        "diagram --x w=2:2.1:3 --sample-impacts 20",
        "map --x w=2:2.1:3 --sample-impacts 20",
        "map --x w=2:2.1:3 --y r=0.7:0.8:2 --sample-impacts 20 --figure index-surface",
    ):
        code, _, complaints = run(f"{command} --out figure.png --overwrite --size 4x3 --dpi 50")
        assert (code, complaints[-1:] if code else []) == (0, [])
        assert (tmp_path / "figure.png").stat().st_size > 1000


def test_the_size_of_a_figure_is_in_inches(run, tmp_path):
    run("section --sample-impacts 20 --out figure.png --size 4x3 --dpi 50")
    header = (tmp_path / "figure.png").read_bytes()[16:24]
    assert (int.from_bytes(header[:4], "big"), int.from_bytes(header[4:], "big")) == (200, 150)


def test_options_complete_a_study_file(run, tmp_path):
    (tmp_path / "study.toml").write_text(
        "[oscillator]\nrestitution = 0.7\n[axes]\nw = [2.0, 2.5]\nmass = { from = 1, to = 2, points = 3 }\n"
        "[sampling]\nsample_impacts = 50\n"
    )
    assert run("map study.toml -p c=0.02 --indices mean_velocity --out map.nc")[0] == 0
    found = vi.load(tmp_path / "map.nc")
    expected = vi.parameter_map(
        vi.ImpactOscillator(restitution=0.7, damping=0.02),
        omega=[2.0, 2.5], mass=[1.0, 1.5, 2.0], indices=("mean_velocity",), sample_impacts=50,
    )  # fmt: skip
    xr.testing.assert_equal(found, expected)


def test_a_saved_result_is_told_drawn_and_converted(run, tmp_path):
    run("diagram --x w=2:2.4:5 --sample-impacts 20 --out diagram.zarr")
    run("map --x w=2:2.4:5 --sample-impacts 20 --out sweep.nc")
    code, told, _ = run("plot diagram.zarr")
    assert code == 0
    assert told[0] == "5 values of angular driving frequency 2 to 2.4 rad/s"
    for command in ("diagram.zarr --out a.svg", "diagram.zarr --sweep sweep.nc --out b.png", "sweep.nc --out c.csv"):
        assert run(f"plot {command}")[0] == 0
    assert {"a.svg", "b.png", "c.csv"} <= set(names(tmp_path))


def test_reproduce_hands_folder_and_choices_on(run, tmp_path, monkeypatch):
    import vibroimpact.reproduce

    seen = {}

    def reproduced(out, **choices):
        seen.update(choices, out=str(out))
        return out

    monkeypatch.setattr(vibroimpact.reproduce, "run", reproduced, raising=False)
    assert run("reproduce --out report --quick --level 0.05")[0] == 0
    assert seen["out"] == "report"
    assert (seen["quick"], seen["level"]) == (True, 0.05)


@pytest.mark.parametrize("command", ["reproduce --out mine", "reproduce --out mine --overwrite"])
def test_reproduce_leaves_a_folder_alone_that_is_no_study(run, tmp_path, command):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("precious")
    code, _, complaints = run(command)
    assert (code, len(complaints)) == (2, 1)
    assert "`out` is 'mine'" in complaints[0]
    assert names(tmp_path / "mine") == ["thesis.txt"]


# Wrong requests


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("section -p mass=0", "`mass` is 0; allowed is a finite number > 0"),
        ("section -p k=-1", "`k` is -1; allowed"),
        ("section -p damping=-0.1", "`damping` is -0.1"),
        ("section -p amplitude=-1", "half a period later"),
        ("section -p omega=0", "`omega` is 0"),
        ("section -p r=1.1", "`r` is 1.1; allowed is a number from 0 to 1"),
        ("section -p gap=nan", "`gap` is nan"),
        ("section -p f=inf", "`f` is inf"),
        ("section -p mass=heavy", "`mass` is 'heavy'"),
        ("section -p m=-1 -p r=2", "`m` is -1; allowed .* `r` is 2"),
        ("section -p mas=1", "did you mean 'mass'"),
        ("section -p omega=1 -p frequency=1", "`frequency` stands beside `omega`"),
        ("section -p omega", "`-p` is 'omega'; allowed is name=value"),
        ("section -p m=1 -p m=2", "given twice"),
        ("section -p gap=-0.5 --start 0", "start"),
        ("section --start 1,2,3,4", "`--start` is '1,2,3,4'"),
        ("section --start fast", "`displacement` is 'fast'"),
        ("section --sample-impacts 0", "`sample_impacts` is 0; allowed is a whole number >= 1"),
        ("section --transient-impacts 1.5", "`transient_impacts` is 1.5"),
        ("section --kind poincare", "`section` is 'poincare'"),
        ("section --backend gpu", "`backend` is 'gpu'; allowed are cpu"),
        ("section --time-step 0.001", "`time_step` is 0.001"),
        ("section --chatter 1", "`chatter` is 1"),
        ("section none.toml", "`study` is 'none.toml', which cannot be read"),
        ("section --colour red", "No such option"),
        ("secton", "No such command"),
        ("simulate --periods 0", "`periods` is 0"),
        ("diagram", "`axes` are none; allowed is exactly one"),
        ("diagram --x omega=1:2:3 --direction left", "`direction` is 'left'"),
        ("map", "`axes` are none"),
        ("map --x omega=1:2", "`--x` is 'omega=1:2'; allowed is name=from:to:points"),
        ("map --x omega=1:2:0", "`omega.points` is 0"),
        ("map --x omega=2:1:5", "`omega` is from 2 to 1"),
        ("map --x omega=a:b:5", "`omega.from` is 'a'.*`omega.to` is 'b'"),
        ("map --x omgea=1:2:3", "did you mean 'omega'"),
        ("map --x omega=1:2:3 --y w=1:2:3", "`w` is given twice"),
        ("map --x omega=1:2:3 --indices stt", "`indices` holds 'stt'"),
        ("map --x omega=1:2:3 --workers 0", "`workers` is 0"),
        ("map --x omega=1:2:3 --index max_velocity", "`--index` is 'max_velocity'"),
        ("map --x omega=1:2:3 --figure index-contour", "`--figure` is 'index-contour'; allowed here are index-curve"),
        ("map --x omega=1:2:3 --level high", "`--level` is 'high'"),
        ("section --size 8", "`--size` is '8'; allowed is width x height"),
        ("section --dpi 0", "`--dpi` is '0'"),
        ("plot none.zarr", "nothing is there"),
        ("plot none.csv", "allowed are .zarr and .nc"),
        ("plot", "Missing argument 'FILE'"),
        ("reproduce", "Missing option '--out'"),
        ("reproduce --level -1 --out report", "`level` is -1"),
    ],
)
def test_a_wrong_request_exits_2_with_one_line_and_touches_nothing(run, tmp_path, command, words):
    given = command if command.startswith("reproduce") else f"{command} --out result.png"
    code, told, complaints = run(given)
    assert (code, told, len(complaints)) == (2, [], 1)
    assert re.search(words, complaints[0])
    assert names(tmp_path) == []


@pytest.mark.parametrize("out", ["map.xls", "map", "missing/map.zarr"])
def test_an_impossible_output_is_refused_before_computing(run, tmp_path, monkeypatch, out):
    monkeypatch.setattr(vi, "parameter_map", pytest.fail, raising=False)
    code, _, complaints = run(f"map --x w=1:2:3 --out {out}")
    assert (code, len(complaints)) == (2, 1)
    assert "`out` is" in complaints[0]
    assert names(tmp_path) == []


def test_a_figure_of_three_axes_is_refused_before_computing(run, monkeypatch):
    monkeypatch.setattr(vi, "parameter_map", pytest.fail, raising=False)
    code, _, complaints = run("map --x w=1:2:2 --y m=1:2:2 --axis k=1:2:2 --out map.png")
    assert code == 2
    assert "3 axes; allowed are one or two" in complaints[0]


@pytest.mark.parametrize("out", ["old.zarr", "old.png", "old.csv"])
def test_an_existing_output_is_kept_without_overwrite_and_replaced_with_it(run, tmp_path, out):
    run(f"section --sample-impacts 20 --out {out}")
    before = (tmp_path / out).stat().st_mtime_ns
    code, _, complaints = run(f"section --sample-impacts 20 --out {out}")
    assert code == 2
    assert "exists" in complaints[0]
    assert (tmp_path / out).stat().st_mtime_ns == before
    assert run(f"section --sample-impacts 20 --out {out} --overwrite")[0] == 0
    assert (tmp_path / out).stat().st_mtime_ns > before


def test_all_faults_of_a_study_file_come_in_one_line(run, tmp_path):
    (tmp_path / "bad.toml").write_text('[oscillator]\nmass = -1\n[run]\nbackend = "gpu"\n')
    code, _, complaints = run("section bad.toml")
    assert (code, len(complaints)) == (2, 1)
    assert "2 faults" in complaints[0]
    assert "`oscillator.mass`" in complaints[0]
    assert "`run.backend`" in complaints[0]


def test_a_damaged_store_is_an_unreadable_input(run, tmp_path):
    (tmp_path / "bad.zarr").mkdir()
    (tmp_path / "bad.nc").write_text("no HDF5")
    for name in ("bad.zarr", "bad.nc"):
        code, _, complaints = run(f"plot {name} --out figure.png")
        assert (code, len(complaints)) == (2, 1)
        assert "cannot be read" in complaints[0]
    assert "figure.png" not in names(tmp_path)


# Failures and interruptions


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (RuntimeError("the kernel\nfell over"), 1, "it failed: RuntimeError: the kernel | fell over"),
        (ValueError("operands could not be broadcast"), 1, "it failed: ValueError: operands"),
        (MemoryError(), 1, "out of memory"),
        (KeyboardInterrupt(), 130, "interrupted"),
    ],
)
def test_a_failure_is_one_line_and_no_traceback(run, tmp_path, monkeypatch, error, code, words):
    def fail(*arguments, **options):
        raise error

    monkeypatch.setattr(vi, "impact_section", fail, raising=False)
    found, _, complaints = run("section --out result.zarr")
    assert found == code
    assert words in complaints[-1]
    assert not any("Traceback" in line for line in complaints)
    assert names(tmp_path) == []


def test_a_full_disk_exits_1_and_keeps_what_was_there(run, tmp_path, monkeypatch):
    run("section --sample-impacts 20 --out old.zarr")

    def full(dataset, part):
        part.mkdir()
        raise OSError(28, "No space left on device")

    monkeypatch.setitem(formats.WRITERS, ".zarr", full)
    code, _, complaints = run("section --sample-impacts 30 --out old.zarr --overwrite")
    assert (code, len(complaints)) == (1, 1)
    assert "No space left on device" in complaints[0]
    assert names(tmp_path) == ["old.zarr"]
    assert vi.load(tmp_path / "old.zarr").sizes["impact"] == 20


@pytest.fixture
def interrupted_early(monkeypatch):
    def stop(meter, done, total, partial):
        meter.stopped = True
        return False

    monkeypatch.setattr(Meter, "__call__", stop)


BIG = "map --x w=1.5:2.5:30 --y m=1:2:30 --sample-impacts 20 --workers 1"


@pytest.mark.usefixtures("interrupted_early")
def test_an_interrupted_map_keeps_what_is_finished(run, tmp_path):
    code, _, complaints = run(f"{BIG} --out map.zarr")
    assert code == 130
    assert "what was finished is kept" in complaints[-1]
    status = vi.load(tmp_path / "map.zarr")["status"]
    unfinished = int((status == vi.Status.INTERRUPTED).sum())
    assert 0 < unfinished < status.size


@pytest.mark.usefixtures("interrupted_early")
def test_an_interrupted_map_never_replaces_a_complete_one(run, tmp_path):
    vi.save(vi.parameter_map(vi.ImpactOscillator(), omega=[2.0], sample_impacts=20), tmp_path / "map.zarr")
    code, _, complaints = run(f"{BIG} --out map.zarr --overwrite")
    assert code == 130
    assert "map.zarr is as it was" in complaints[-1]
    assert vi.load(tmp_path / "map.zarr").sizes == {"omega": 1}
    assert vi.load(tmp_path / "map.partial.zarr").sizes == {"omega": 30, "mass": 30}


@pytest.mark.skipif(os.name == "nt", reason="a child cannot be sent Ctrl-C alone")
def test_ctrl_c_ends_a_running_map_with_exit_code_130_and_a_store_that_opens(tmp_path):
    out = tmp_path / "map.zarr"
    process = child("map", "--x", "w=0.1:5:400", "--y", "m=0.1:5:400", "--sample-impacts", "500", "--out", str(out))
    assert process.stderr is not None
    process.stderr.readline()
    process.send_signal(signal.SIGINT)
    _, complaints = process.communicate(timeout=120)
    assert process.returncode == 130, complaints
    assert "Traceback" not in complaints
    assert names(tmp_path) == ["map.zarr"]
    assert vi.Status.INTERRUPTED in vi.load(out)["status"].values


def test_exit_codes_reach_the_shell():
    for arguments, code in ((["section", "-p", "mass=-1"], 2), (["section", "--sample-impacts", "20"], 0)):
        process = child(*arguments)
        _, complaints = process.communicate(timeout=120)
        assert process.returncode == code
        assert len(complaints.splitlines()) == (1 if code else 0)


def test_a_reader_that_has_seen_enough_causes_no_traceback():
    process = child("section", "--sample-impacts", "20")
    assert process.stdout is not None
    process.stdout.close()
    assert process.stderr is not None
    assert "Traceback" not in process.stderr.read()
    process.wait(timeout=120)
    process.stderr.close()
