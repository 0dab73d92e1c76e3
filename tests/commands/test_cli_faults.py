"""The command line when something is wrong: one line for every fault, nothing half-written."""

from __future__ import annotations

import re
import subprocess

import pytest

import vibroimpact as vi
from processes import COMMAND, names
from vibroimpact.files import formats

# Wrong requests


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("section -p mass=0", "`mass` must be a finite number > 0, got 0"),
        ("section -p amplitude=-1", "half a period later"),
        ("section -p r=1.1", "`r` must be between 0 and 1, got 1.1"),
        ("section -p gap=nan", "`gap` must be .*, got nan"),
        ("section -p mass=heavy", "`mass` must be .*, got 'heavy'"),
        ("section -p m=-1 -p r=2", "`m` must be .*, got -1.* `r` must be .*, got 2"),
        ("section -p mas=1", "did you mean 'mass'"),
        ("section -p Mass=1", "did you mean 'mass'"),
        ("section -p omega=0,95", "`omega` must be .*, got '0,95'; write the decimals after a point: 0.95"),
        ("section -p gap=-,5mm", "write the decimals after a point: -.5mm"),
        ("diagram --x omega=0,5:2:3", "write the decimals after a point: 0.5"),
        ("section omega=2", "did you mean `-p omega=2`?"),
        ("map omega=1:2:5", "did you mean `--x omega=1:2:5`?"),
        ("section model.py", "did you mean `--model model.py:NAME`?"),
        ("section map.zarr", "a saved result is shown by `vibroimpact plot map.zarr`"),
        ("section --omega 2", "no option '--omega': parameters are given as -p omega=VALUE"),
        ("section --damping-ratio 2", "parameters are given as -p damping_ratio=VALUE"),
        ("section --periods 2", "Try `vibroimpact section --help`"),
        ("section --backend gpu", "unknown `backend` 'gpu'; choose from cpu, cuda.*; did you mean 'cuda'"),
        ("section --backend cuda:0", "did you mean 'cuda'"),
        ("section --backend CPU", "did you mean 'cpu'"),
        ("section --backend CUDA", "did you mean 'cuda'"),
        ("section -p omega=1 -p frequency=1", "`omega`.*`frequency`"),
        ("section -p zeta=0.01 -p c=0.1", "give either `damping` or `damping_ratio`, not both"),
        ("section -p zeta=-0.01", "`zeta` must be a finite number >= 0, got -0.01"),
        ("section -p damping_ratio=much", "`damping_ratio` must be a finite number >= 0, got 'much'"),
        ("map -p zeta=0.01 --x m=1:2:3", "`damping_ratio` must not be given where mass varies, which changes it"),
        ("section -p omega", "`-p` must be NAME=VALUE such as omega=2.8, got 'omega'"),
        ("section -p gap=-0.5 --start 0", "start"),
        ("section --start 1,2,3,4", "`--start` must be .* Y,V,T .*, got '1,2,3,4'"),
        ("section --start fast", "`displacement` must be .*, got 'fast'"),
        ("section --transient-impacts 1.5", "`transient_impacts` must be .*, got 1.5"),
        ("section --kind poincare", "unknown `section` 'poincare'; choose from impact, stroboscopic"),
        ("section --time-step 0.001", "`time_step` applies only to back end 'fixed-step'"),
        ("section --chatter 1", "`chatter` must be above 0 and up to 0.01, got 1"),
        ("section none.toml", "`study` 'none.toml' cannot be read"),
        ("section --colour red", "No such option"),
        ("secton", "No such command"),
        ("simulate --periods 0", "`periods` must be a finite number > 0, got 0"),
        ("diagram", "needs exactly one axis, got none"),
        ("diagram --x omega=1:2:3 --direction left", "unknown `direction` 'left'; choose from fresh, up, down"),
        ("map", "needs an axis"),
        ("map --x omega=1:2", "`--x` must be NAME=FROM:TO:POINTS, got 'omega=1:2'"),
        ("map --x omega=1:2:0", "`omega.points` must be .*, got 0"),
        ("map --x omega=1:2:1", "`omega.points` must be at least 2 from 1 to 2, got 1"),
        (
            "map --x omega=1:2:1000000000 --y m=1:2:300000",
            "`omega.points` must be at most 10,000,000, got 1000000000",
        ),
        ("map --x omega=1:2:3 --starts 1", "`starts` must be a whole number >= 2, got 1"),
        ("map --x omega=1:2:3 --starts 8 --start -1", "give either `start` or `starts`, not both"),
        ("map --x omega=1:2:3 --y m=1:2:3 --starts 8 --refine 2", "`refine` needs a grid and one initial"),
        ("map --x omega=2:1:5", "`omega` must increase, got 2 to 1 rad/s; give the smaller end first"),
        ("map --x omega=a:b:5", "`omega.from` must be .*, got 'a'.*`omega.to` must be .*, got 'b'"),
        ("map --x omgea=1:2:3", "did you mean 'omega'"),
        ("map --x omega=1:2:3 --y w=1:2:3", "give either `omega` or `w`, not both"),
        ("map --x omega=1:2:3 --indices stt", "unknown index 'stt'; choose from std"),
        ("map --x omega=1:2:3 --index maximum", "unknown index .maximum."),
        ("map --x omega=1:2:3 --figure index-contour", "`--figure` 'index-contour'.*choose from index-curve"),
        ("map --x omega=1:2:3 --level high", "`--level` must be a finite number, got 'high'"),
        ("section --size 8", "`--size` must be width x height .*, got '8'"),
        ("section --dpi 0", "`--dpi` must be between 10 and 2400, got 0"),
        ("orbit", "`out` must end in .zarr, .nc, .csv, .mat or .json, got 'result.png'"),
        ("continue", "needs exactly one axis, got none"),
        ("continue --x omega=2", "`--x` must be NAME=FROM:TO, got 'omega=2'; for example --x omega=0.8:3"),
        ("continue --x omega=3:4", "`omega` must have a range that contains 2"),
        ("continue --x omega=3:1", "`omega` must increase, got 3 to 1 rad/s"),
        ("continue --x omega=1:3 --step 2", "`step` must be .*, got 2"),
        ("continue --x omega=1:3 --doublings -1", "`--doublings` must be .*, got -1"),
        ("boundary --x omega=1:3", "needs exactly two axes, got omega"),
        ("boundary --x omega=1:3 --y omega=1:2", "the axis omega is given twice"),
        ("boundary --x omega=1:3 --y r=0.5:0.9 --kind hopf", "unknown `--kind` 'hopf'; choose from fold"),
        ("boundary --x omega=1:3 --y r=0.5:0.9 --periods 1,x", "`n_periods` must be .*, got 'x'"),
        ("boundary --x omega=1:3 --y r=0.5:0.9 --lines 1", "`lines` must be .*, got 1"),
        ("boundary --x omega=1:3 --y r=0.5:0.9 --over none.zarr", "does not exist"),
        ("boundary -p omega=5 --impacts 2 --x omega=1:3 --y r=0.5:0.9", "`omega` must have a range that contains 5"),
        ("basins --x phase=0:1", "`--x` must be NAME=FROM:TO:POINTS, got 'phase=0:1'"),
        ("basins --x phase=0:2:10", "`phase` must be between 0 and 1, got 2"),
        ("basins --x omega=0:2:10 --y velocity=0:1:5", "unknown coordinate 'omega'; choose from"),
        (
            "basins --x displacement=0:1:5 --y velocity=0:1:5",
            "the axes must stay in front of all .* 'stop' by 0.25 m",
        ),
        ("basins --x phase=0:1:4 --y displacement=0:1:5", "the axes must be .*, got `phase`, `displacement`"),
        ("map --x omega=1:2:3 --y m=1:2:3 --refine 1 --tile 9", "`tile` needs a `cluster`"),
        ("map --x omega=1:2:3 --tile 9", r"`tile` needs a `store` \(--out run.zarr\) or a `cluster`, got 9"),
        ("basins --x phase=0:1:1", "`phase.points` must be .*, got 1"),
        ("basins --x phase=0:nan:4", "`phase.to` must be .*, got nan"),
        ("basins --x phase=0:1:4 --phase 0.2", "`--phase` needs an axis of displacement"),
        ("basins --x phase=0:1:4 --backend fixed-step", "`backend` must be one that computes n_periods and n_impacts"),
        ("compare", "Missing argument 'A.toml'"),
        ("compare none.toml none.toml", "`study` 'none.toml' cannot be read"),
        (
            "map --x w=1:2:3 --y r=0.5:0.9:2 --figure motion-map --indices std",
            "`--indices` must include lyapunov_per_impact",
        ),
        ("diagram --x omega=1:2:3 --index sdt", "unknown index .sdt.; choose from std"),
        ("plot none.zarr", "does not exist"),
        ("plot none.csv", "must be a .zarr folder or a .nc file"),
        ("plot", "Missing argument 'FILE'"),
        ("reproduce", "Missing option '--out'"),
        ("reproduce --level -1 --out report", "`level` must be a height above 0 m/s, got -1"),
    ],
)
def test_a_wrong_request_exits_2_with_one_line_and_touches_nothing(refused, command, words):
    given = command if command.startswith("reproduce") else f"{command} --out result.png"
    assert re.search(words, refused(given))


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("help", "No such command 'help'. Try `vibroimpact --help`"),
        ("version", "Try `vibroimpact --version`"),
        ("Map --x omega=1:2:3", "Did you mean 'map'"),
        ("map help", "did you mean `--help`?"),
        ("describe -p omega = 2", "; parameters are given as -p NAME=VALUE, without spaces"),
        ("describe omega 2", "; parameters are given as -p NAME=VALUE, without spaces"),
        ("describe --p omega=2", "No such option: --p; parameters are given as -p NAME=VALUE"),
        ("describe -omega 2", "No such option: -o; parameters are given as -p NAME=VALUE"),
        ("map -x omega=1:2:3", "No such option: -x; did you mean --x?"),
        ("boundary --x omega=1:2 --y mass=1:2 --kind folds", "unknown `--kind` 'folds'; choose from fold"),
        ("describe old.toml", "did you mean 'odd.toml'?"),
        ("describe missing.toml", "give the name of a TOML file"),
        ("plot notes.nc --index std", "`--index` needs a figure; add for example --out figure.png"),
        ("describe -p omega= 2", "`-p` must be NAME=VALUE such as omega=2.8, got 'omega='; write it without spaces"),
        ("describe -p omega=1 2", "write -p NAME=VALUE without spaces"),
        ("describe -p omega=1:2:3", "give a range as an axis: --x omega=1:2:3"),
        ("describe -p gap=5 mm", "write a value and its unit without a space, as in gap=0.5mm"),
        ("describe -p omega=25HZ", "turned into rad/s, got '25HZ'; did you mean 25Hz?"),
        ("describe -p stiffness=3KN/m", "turned into N/m, got '3KN/m'; did you mean 3kN/m?"),
        ("describe -p mass=2m", "turned into kg, got '2m'"),
        ("describe -p OMEGA=2", "did you mean 'omega'?"),
        ("describe -p gap=-inf", "`gap` must be a finite number, got -inf"),
        ("describe -p omega=1e400", "`omega` must be a finite number > 0, got inf"),
        ("describe -p “omega=2”", "got '“omega=2”'; leave out the quotation marks"),
        ("describe -p omega=‘2’", "got '‘2’'; leave out the quotation marks"),
        ('describe -p omega="25Hz"', "leave out the quotation marks"),
        ("describe --vary omega gap", "separate several names or numbers by commas alone"),
        ("map --x omega=1:2:3 --indices std lyapunov", "separate several names or numbers by commas alone"),
        ("map --x omega=1:2:3 --indices ,", "`indices` must be one or more of std"),
        ("map --x omega=1:2:3 --indices Std", "did you mean 'std'?"),
        ("orbit --near 0.2 1.4", "separate several names or numbers by commas alone"),
        ("section --start 1mm,0,0", "`displacement` must be a finite number, got '1mm'; write it without a unit"),
        ("section --sample-impacts 1e6", "`sample_impacts` must be a whole number >= 1, got 1000000.0; write 1000000"),
        ("section --sample-impacts 100000000000", "`sample_impacts` must be at most 1,000,000,000"),
        ("simulate --periods inf", "`periods` must be a finite number > 0, got inf"),
        ("describe --model Bouncing_Ball", "did you mean 'bouncing_ball'?"),
        ("describe --model notes.txt", "`model` must be FILE.py:NAME"),
        ("describe --model plain.py", "but plain.py has none; write @vibroimpact.family above a function"),
        ("describe --model plain.py:x", "but plain.py has none; write @vibroimpact.family above a function"),
        ("describe notes.txt", "is not a study file"),
        ("describe quotes.toml", "write straight quotation marks"),
        ("describe folder.toml", "it is a folder; give the name of a TOML file"),
        ("map --x omega=1:2:3 --out folder", "`out` must end in .zarr"),
        ("plot folder.nc", "is not a regular file"),
        ("orbit --model two_sided_oscillator --stops middle", "unknown `stops` 'middle'; choose from left, right"),
    ],
)
def test_a_newcomers_mistake_is_answered_with_what_to_type(refused, tmp_path, command, words):
    for folder in ("folder", "folder.toml", "folder.nc"):
        (tmp_path / folder).mkdir()
    (tmp_path / "notes.txt").write_text("gap 0.5 mm\n")
    (tmp_path / "quotes.toml").write_text("[oscillator]\nmass = “2kg”\n", encoding="utf-8")
    (tmp_path / "plain.py").write_text("x = 3\n")
    (tmp_path / "odd.toml").write_text("[oscillator]\nmass = 2\n")
    assert words in refused(command)


def test_a_list_may_end_in_a_comma(run):
    assert run("map --x omega=2:2.1:2 --indices std, --sample-impacts 20")[0] == 0


@pytest.mark.parametrize(
    ("name", "text", "instead"),
    [
        ("tube.nc", "", "a saved result is shown by `vibroimpact plot tube.nc`"),
        ("tube.toml", "", "write [oscillator] and its numbers"),
        ("tube.toml", "# mass = 2.1\n", "write [oscillator] and its numbers"),
    ],
)
def test_an_empty_file_is_no_study_of_the_numbers_of_the_paper(refused, tmp_path, name, text, instead):
    (tmp_path / name).write_text(text)
    assert refused(f"section {name} -p omega=2").endswith(f"`study` '{name}' is empty; {instead}")


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (
            "map --x w=1:2:9000 --y m=1:2:9000 --out map.nc",
            "81,000,000 cells, which take 20.2 GB .* --out run.zarr, or us",
        ),
        ("map --x w=1:2:9000 --y m=1:2:9000", "81,000,000 cells"),
        ("map --x w=1:2:9000 --y m=1:2:9000 --tile 10000000 --out map.zarr", "`tile` is .* which take 2.* GB"),
        ("map --x w=1:2:9000 --y m=1:2:9000 --refine 3 --out map.zarr", "`refine` makes .* which take 155 GB"),
        ("diagram --x w=1:2:30000 --out map.nc", "`axes` hold 30,000 values, 150,000,000 samples, which take 2.4 GB"),
        ("diagram --x w=1:2:300000 --section stroboscopic", "150,000,000 samples, .* smaller `sample_periods`"),
    ],
)
def test_what_memory_cannot_hold_is_refused_before_computing(refused, memory, command, words):
    memory(2_000_000_000)
    assert re.search(words, refused(command))


def test_a_single_value_may_be_an_axis_of_its_own(run):
    assert run("map --x omega=2:2:1 --sample-impacts 20")[1][0] == (
        "1 cell from rest at y = min(0, gap): angular driving frequency 2 rad/s"
    )


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("map --x w=1:2:3 --out map.xls", "`out` "),
        ("map --x w=1:2:3 --out map", "`out` "),
        ("map --x w=1:2:3 --out missing/map.zarr", "`out` "),
        ("map --x w=1:2:2 --y m=1:2:2 --axis k=1:2:2 --out map.png", "for 3 axes"),
    ],
)
def test_an_impossible_output_is_refused_before_computing(refused, monkeypatch, command, words):
    monkeypatch.setattr(vi, "parameter_map", pytest.fail, raising=False)
    assert words in refused(command)


@pytest.mark.parametrize("out", ["old.zarr", "old.png", "old.csv"])
def test_an_existing_output_is_kept_without_overwrite_and_replaced_with_it(run, refused, tmp_path, out):
    run(f"section --sample-impacts 20 --out {out}")
    before = (tmp_path / out).stat().st_mtime_ns
    assert "exists" in refused(f"section --sample-impacts 20 --out {out}")
    assert run(f"section --sample-impacts 20 --out {out} --overwrite")[0] == 0
    assert (tmp_path / out).stat().st_mtime_ns > before


def test_all_faults_of_a_study_file_come_in_one_line(refused, tmp_path):
    (tmp_path / "bad.toml").write_text('[oscillator]\nmass = -1\n[run]\nbackend = "gpu"\n')
    complaint = refused("section bad.toml")
    for words in ("2 errors", "`oscillator.mass`", "`run.backend`"):
        assert words in complaint


def test_a_damaged_store_is_an_unreadable_input(refused, tmp_path):
    (tmp_path / "bad.zarr").mkdir()
    (tmp_path / "bad.nc").write_text("no HDF5")
    for name in ("bad.zarr", "bad.nc"):
        assert "cannot be read" in refused(f"plot {name} --out figure.png")


def test_a_stored_map_whose_axis_is_damaged_is_not_gone_on_with(run, refused, tmp_path):
    small = "map --x w=1.5:2.5:3 --y m=1:2:3 --sample-impacts 20 --out map.zarr"
    assert run(small)[0] == 0
    (tmp_path / "map.zarr/omega/c/0").unlink()
    for command in (small, "info map.zarr"):
        assert "omega/c/0' is missing or damaged); restore that file, delete the store" in refused(command)


# Failures and interruptions


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (RuntimeError("the kernel\nfell over"), 1, "RuntimeError: the kernel | fell over"),
        (ValueError("operands could not be broadcast"), 1, "ValueError: operands"),
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
    assert (code, len(complaints)) == (1, 2)
    assert "No space left on device" in complaints[1]
    assert names(tmp_path) == ["old.zarr"]
    assert vi.load(tmp_path / "old.zarr").sizes["impact"] == 20


# Cells that have ended are handed on some twenty times a second.
BIG = "map --x w=1.5:2.5:200 --y m=1:2:200 --sample-impacts 500 --workers 1"


@pytest.mark.usefixtures("stopped_early")
def test_an_interrupted_map_keeps_what_is_finished(run, tmp_path):
    code, _, complaints = run(f"{BIG} --out map.nc")
    assert code == 130
    assert "what was finished is kept" in complaints[-1]
    status = vi.load(tmp_path / "map.nc")["status"]
    unfinished = int((status == vi.Status.INTERRUPTED).sum())
    assert 0 < unfinished < status.size


@pytest.mark.usefixtures("stopped_early")
def test_an_interrupted_map_never_replaces_a_complete_one(run, tmp_path):
    vi.save(vi.parameter_map(vi.ImpactOscillator(), omega=[2.0], sample_impacts=20), tmp_path / "map.nc")
    code, _, complaints = run(f"{BIG} --out map.nc --overwrite")
    assert code == 130
    assert "map.nc is unchanged" in complaints[-1]
    assert vi.load(tmp_path / "map.nc").sizes == {"omega": 1}
    assert vi.load(tmp_path / "map.partial.nc").sizes == {"omega": 200, "mass": 200}


@pytest.mark.usefixtures("stopped_early")
def test_an_interrupted_store_keeps_its_tiles_and_the_same_command_goes_on(run, tmp_path, monkeypatch):
    code, _, complaints = run(f"{BIG} --tile 4000 --out map.zarr")
    assert code == 130
    assert "run the same command again to continue" in complaints[-1]
    status = vi.load(tmp_path / "map.zarr")["status"]
    assert int((status == vi.Status.INTERRUPTED).sum()) > 0
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    code, _, complaints = run(f"{BIG} --out map.zarr")
    assert code == 0
    assert "continuing" in complaints[1]
    assert int((vi.load(tmp_path / "map.zarr")["status"] == vi.Status.INTERRUPTED).sum()) == 0
    summary = " ".join(run("info map.zarr")[1])
    assert "100% of 40,000 cells" in summary
    assert "continue with" not in summary


@pytest.mark.usefixtures("stopped_early")
def test_an_interrupted_store_never_replaces_a_complete_one_until_it_is_complete(run, tmp_path, monkeypatch):
    again = f"{BIG} --tile 4000 --out map.zarr --overwrite"
    vi.save(vi.parameter_map(vi.ImpactOscillator(), omega=[2.0], sample_impacts=20), tmp_path / "map.zarr")
    code, _, complaints = run(again)
    assert code == 130
    assert "map.zarr is unchanged; map.partial.zarr: " in complaints[-1]
    assert vi.load(tmp_path / "map.zarr").sizes == {"omega": 1}
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    code, _, complaints = run(again)
    assert code == 0
    assert any("map.partial.zarr exists" in line and "continuing" in line for line in complaints)
    assert vi.load(tmp_path / "map.zarr").sizes == {"omega": 200, "mass": 200}
    assert names(tmp_path) == ["map.zarr"]


@pytest.mark.long(but=4)
@pytest.mark.parametrize("out", ["map.zarr", "map.nc", "map.csv", "map.png"])
@pytest.mark.parametrize(
    "fault",
    ["--cluster tcp://127.0.0.1:9", "--start 9,0,0", "disk", "memory"],
    ids=["cluster", "start", "disk", "memory"],
)
def test_whatever_fails_an_output_that_may_be_overwritten_stays(run, tmp_path, monkeypatch, out, fault):
    small = f"map --x w=1.5:2.5:9 --y m=1:2:3 --sample-impacts 20 --out {out}"
    assert run(small)[0] == 0
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    error = OSError(28, "No space left on device") if fault == "disk" else MemoryError()

    def fail(*given):
        raise error

    if fault in ("disk", "memory"):
        fault = ""
        monkeypatch.setattr("vibroimpact.backends.cpu.CpuBackend.share", fail)
    code, _, complaints = run(f"{small} --sample-impacts 30 --overwrite {fault}")
    assert code in (1, 2)
    assert not any("Traceback" in line for line in complaints)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_another_study_on_a_store_is_refused_with_the_difference_and_nothing_is_touched(run, refused, tmp_path):
    small = "map --x w=1.5:2.5:9 --sample-impacts 20"
    assert run(f"{small} --out map.zarr")[0] == 0
    complaint = refused("map --x w=1.5:2.5:9 --sample-impacts 30 --out map.zarr")  # not that it continues
    assert "sample_impacts is 20 there, 30 here" in complaint
    complaint = refused("map --x w=1.5:2.5:8 --sample-impacts 20 --out map.zarr")
    assert "omega 1.5 to 2.5 in 9 there, omega 1.5 to 2.5 in 8 here" in complaint
    assert "map of std over omega 1.5 to 2.5 rad/s in 9" in run("info map.zarr")[1][0]
    assert not re.search(r"\([0-9a-f]{8}\)", run("info map.zarr")[1][0])
    assert run(f"{small} -p gap=-1 --start 0,0,0 --out map.zarr --overwrite")[0] == 2
    assert vi.load(tmp_path / "map.zarr").sizes == {"omega": 9}
    assert names(tmp_path) == ["map.zarr"]


def test_a_store_that_is_finished_says_so_and_is_left_as_it_is(run):
    small = "map --x w=1.5:2.5:9 --sample-impacts 20 --out map.zarr"
    assert not any(" exists: " in line for line in run(small)[2])
    code, _, complaints = run(small)
    assert code == 0
    assert complaints[1] == "map.zarr exists: 1 of 1 tiles done, 100% of 9 cells; nothing is left to compute"


def test_a_plain_result_is_no_store_to_go_on_with(run, tmp_path):
    vi.save(vi.parameter_map(vi.ImpactOscillator(), omega=[2.0], sample_impacts=20), tmp_path / "map.zarr")
    code, _, complaints = run("map --x w=1.5:2.5:9 --sample-impacts 20 --out map.zarr")
    assert code == 2
    assert "exists" in complaints[-1]
    code, lines, _ = run("info map.zarr")
    assert (code, lines[0]) == (0, "1 cell from rest at y = min(0, gap): angular driving frequency 2 rad/s")


@pytest.mark.long
def test_exit_codes_reach_the_shell():
    for arguments, code in ((["section", "-p", "mass=-1"], 2), (["section", "--sample-impacts", "20"], 0)):
        done = subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, timeout=600)
        assert done.returncode == code
        assert len(done.stderr.splitlines()) == 1
        assert done.stderr.startswith("vibroimpact: `mass`" if code else "ImpactOscillator: mass 1 kg")


@pytest.mark.long
def test_a_reader_that_has_seen_enough_causes_no_traceback():
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen([*COMMAND, "section", "--sample-impacts", "20"], **pipes) as process:
        process.stdout.close()
        assert "Traceback" not in process.stderr.read()
