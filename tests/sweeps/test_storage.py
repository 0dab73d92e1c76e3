"""Results are written whole or not at all, and come back as they were."""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy.io import loadmat

import vibroimpact as vi
from processes import names, python
from systems import two_masses, two_sided
from vibroimpact import files
from vibroimpact.dataset import bundle, impact_speed, model_of, provenance, status_variable, variable
from vibroimpact.files import formats
from vibroimpact.orbits.results import orbits_dataset
from vibroimpact.report import sentences_of

OSC = vi.ImpactOscillator(omega=2.8)
SHORT = {"transient_impacts": 20, "sample_impacts": 30}


def sweep(value: float = 0.5) -> xr.Dataset:
    omega, mass = np.array([1.0, 2.0, 3.0]), np.array([0.5, 1.5])
    std = np.full((3, 2), value)
    std[2, 1] = np.nan
    return xr.Dataset(
        {
            "std": variable("std", ("omega", "mass"), std),
            "status": status_variable(("omega", "mass"), [[1, 1], [0, 2], [0, 4]]),
        },
        {"omega": variable("omega", "omega", omega), "mass": variable("mass", "mass", mass)},
        provenance("parameter_map", OSC, {"indices": ("std",)}),
    )


def diagram() -> xr.Dataset:
    nan = float("nan")
    return xr.Dataset(
        {
            "velocity": impact_speed(("omega", "impact"), [[1.0, 2.0], [3.0, nan], [nan, nan]]),
            "phase": variable("phase", ("omega", "impact"), [[0.1, 0.2], [0.3, nan], [nan, nan]]),
            "count": variable("count", "omega", np.array([2, 1, 0])),
            "status": status_variable("omega", [0, 5, 4]),
        },
        {"omega": variable("omega", "omega", [1.0, 2.0, 3.0])},
        provenance("bifurcation_diagram", OSC, {}),
    )


def simulation() -> xr.Dataset:
    return xr.Dataset(
        {
            "displacement": variable("displacement", "time", [-1.0, -0.5, 0.0]),
            "velocity": variable("velocity", "time", [0.0, 1.0, -0.8]),
            "impact_time": variable("impact_time", "impact", [1.9, 2.0]),
            "impact_velocity": variable("impact_velocity", "impact", [1.0, 0.5]),
            "stick_time": variable("stick_time", "stick", [2.1]),
            "release_time": variable("release_time", "stick", [np.nan]),
            "status": status_variable((), 0),
        },
        {"time": variable("time", "time", [0.0, 1.0, 2.0])},
        provenance("simulate", OSC, {}),
    )


def never_hits() -> xr.Dataset:
    return vi.impact_section(OSC.replace(gap=10.0))


@pytest.mark.parametrize("ending", [".zarr", ".nc"])
@pytest.mark.parametrize("name", ["two words", "Stöße α", "run[1]*?", "a#b%20", "-x"])
def test_a_result_may_have_any_name(tmp_path, name, ending):
    vi.save(sweep(), tmp_path / f"{name}{ending}")
    assert [entry.name for entry in tmp_path.iterdir()] == [f"{name}{ending}"]
    xr.testing.assert_identical(vi.load(tmp_path / f"{name}{ending}"), sweep())


def test_a_zarr_store_is_format_3_and_its_root_holds_result_variables_only(tmp_path):
    path = vi.save(sweep(), tmp_path / "map.zarr")
    assert '"zarr_format": 3' in (path / "zarr.json").read_text()
    with xr.open_zarr(path, consolidated=False) as stored:
        assert set(stored.variables) == {"std", "status", "omega", "mass"}
        np.testing.assert_array_equal(stored["std"], sweep()["std"])


def test_csv_of_a_map_has_a_row_a_cell_and_statuses_in_words(tmp_path):
    path = vi.save(sweep(), tmp_path / "map.csv")
    table = pd.read_csv(path)
    assert list(table.columns) == ["omega", "mass", "std", "status"]
    assert len(table) == 6
    assert table.status.tolist() == ["closed", "closed", "ok", "sticking", "ok", "no_impact"]
    labels = json.loads((tmp_path / "map.csv.json").read_text())
    assert labels["columns"]["omega"] == {"meaning": "angular driving frequency", "units": "rad/s"}
    assert labels["provenance"]["oscillator"]["damping"] == 0.01


def test_csv_of_a_diagram_has_a_row_an_impact_and_one_for_a_cell_without_impacts(tmp_path):
    table = pd.read_csv(vi.save(diagram(), tmp_path / "diagram.csv"))
    assert table.omega.tolist() == [1.0, 1.0, 2.0, 3.0]
    assert table.velocity.tolist()[:3] == [1.0, 2.0, 3.0]
    assert np.isnan(table.velocity[3])
    assert table.status[3] == "no_impact"


def test_csv_of_a_simulation_says_what_each_row_records(tmp_path):
    table = pd.read_csv(vi.save(simulation(), tmp_path / "orbit.csv"))
    assert table.record.tolist() == ["impact"] * 2 + ["stick"] + ["time"] * 3
    assert table.impact_velocity.dropna().tolist() == [1.0, 0.5]
    assert table.displacement.dropna().tolist() == [-1.0, -0.5, 0.0]


def test_mat_holds_arrays_units_and_provenance(tmp_path):
    content = loadmat(vi.save(sweep(), tmp_path / "map.mat"), simplify_cells=True)
    np.testing.assert_array_equal(content["std"], sweep()["std"])
    assert content["units"]["omega"] == "rad/s"
    assert content["dimensions"]["std"] == "omega, mass"
    assert content["provenance"]["function"] == "parameter_map"
    assert content["status_meanings"][4] == "no_impact"


# Every kind of result


def branch() -> xr.Dataset:
    return vi.continue_orbit(vi.find_orbit(OSC.replace(omega=2.6))[0], "omega", (2.4, 2.7), step=0.05).dataset


def boundary() -> xr.Dataset:
    (point,) = vi.continue_orbit(vi.find_orbit(OSC.replace(omega=2.6))[0], "omega", (2.5, 2.7), step=0.1).special
    return vi.continue_boundary(point, ("omega", "gap"), ((2.5, 2.8), (-0.1, 0.1)), step=0.1).dataset


def branches() -> xr.Dataset:
    return bundle([branch(), branch()], "continue_orbit", provenance("continue_orbit", OSC, {}))


def boundaries() -> xr.Dataset:
    return bundle([boundary(), boundary()], "boundary_curves", provenance("boundary_curves", OSC, {}))


def orbits() -> xr.Dataset:
    osc = OSC.replace(gap=0.2, omega=0.9)
    return orbits_dataset(vi.find_orbit(osc), osc, {})


def attractors() -> xr.Dataset:
    return vi.basins(OSC.replace(omega=3.0), phase=np.linspace(0, 1, 5), velocity=np.linspace(0, 3, 4), workers=1)


def classes() -> xr.Dataset:
    naming = ("lyapunov_per_impact", "n_periods", "n_impacts", "std")
    return vi.classify(vi.parameter_map(OSC, omega=[0.5, 2.0], mass=[1.0, 2.0], indices=naming, sample_impacts=100))


RESULTS = {
    "map": lambda: vi.parameter_map(OSC, omega=[2.0, 2.8], mass=[1.0, 2.0, 3.0], sample_impacts=20),
    "refined map": lambda: vi.parameter_map(OSC, omega=[2.0, 2.8], mass=[1.0, 2.0], refine=2, sample_impacts=20),
    "classes": classes,
    "diagram": lambda: vi.bifurcation_diagram(OSC, omega=[2.0, 2.8], sample_impacts=12, indices=("std",)),
    "impact section": lambda: vi.impact_section(OSC, sample_impacts=12),
    "section without impacts": never_hits,
    "stroboscopic section": lambda: vi.stroboscopic_section(OSC, sample_periods=5),
    "simulation": lambda: vi.simulate(OSC, periods=3),
    "orbits": orbits,
    "branch": branch,
    "branches": branches,
    "boundary": boundary,
    "boundaries": boundaries,
    "basins and their attractors": attractors,
    "comparison": lambda: vi.compare(OSC, OSC.replace(gap=0.1)).dataset,
    "map of a family": lambda: vi.parameter_map(vi.family(vi.models.impact_damper), clearance=[4e-3, 5e-3], **SHORT),
    "map by stop": lambda: vi.parameter_map(two_masses(), omega=[7.0, 8.0], by_stop=True, **SHORT),
    "diagram of a system": lambda: vi.bifurcation_diagram(two_masses(), bar_gap=[0.02, 0.04, 0.06], **SHORT),
    "impact section of a system": lambda: vi.impact_section(two_masses(), **SHORT),
    "section of a system without impacts": lambda: vi.impact_section(vi.models.two_sided_oscillator(force=0.001)),
    "stroboscopic section of a system": lambda: vi.stroboscopic_section(two_masses(), sample_periods=9),
    "simulation of a system": lambda: vi.simulate(two_masses(), periods=2, samples_per_period=20),
    "simulation of a system that rests": lambda: vi.simulate(vi.models.bouncing_ball(), periods=3),
    "branch of a system": lambda: (
        vi.continue_orbit(vi.find_orbit(two_sided(), n_impacts=2)[0], "omega", (1.9, 2.1)).dataset
    ),
}


def entries(variable: xr.Variable) -> set[str]:
    """Return the values of a variable as a table has them: numbers to twelve digits, codes in words."""
    values = variable.values.ravel().tolist()
    if "flag_meanings" in variable.attrs:
        codes = np.asarray(variable.attrs["flag_values"]).tolist()
        words = dict(zip(codes, variable.attrs["flag_meanings"].split(), strict=True))
        return {words[value] for value in values}
    return {str(value) if isinstance(value, (str, bool)) else f"{value:.12g}" for value in values if value == value}


@pytest.fixture(scope="module")
def result():
    return cache(lambda kind: RESULTS[kind]())


@pytest.mark.long(but=1)
@pytest.mark.parametrize("kind", RESULTS)
def test_every_value_of_every_variable_reaches_the_csv(tmp_path, kind, result):
    dataset = result(kind)
    path = vi.save(dataset, tmp_path / "result.csv")
    with path.open(newline="") as file:  # old versions of pandas round numbers their own way
        rows = list(csv.DictReader(file))
    for name, array in dataset.variables.items():
        assert {shown(row[name]) for row in rows if row[name]} == entries(array), name


def shown(text):
    try:
        return f"{float(text):.12g}"
    except ValueError:
        return text


@pytest.mark.parametrize("kind", RESULTS)
@pytest.mark.parametrize("ending", [".zarr", ".nc"])
def test_a_result_comes_back_as_it_was_in_its_own_order_and_makes_the_same_table(
    recwarn, tmp_path, kind, ending, result
):
    back = vi.load(vi.save(result(kind), tmp_path / f"result{ending}"))
    xr.testing.assert_identical(back, result(kind))
    for name, array in result(kind).variables.items():
        assert array.dtype.kind in "OTU" or back[name].dtype == array.dtype, name
    assert kind == "comparison" or model_of(back) == model_of(result(kind))
    assert kind == "comparison" or sentences_of(back) == sentences_of(result(kind))
    assert not [str(entry.message) for entry in recwarn if "data type" in str(entry.message)]
    assert list(back.variables) == list(result(kind).variables)
    assert list(back.dims) == list(result(kind).dims)
    assert "variable_order" not in back.attrs
    first, second = (vi.save(dataset, tmp_path / f"{at}.csv") for at, dataset in enumerate((result(kind), back)))
    assert first.read_text() == second.read_text()


def test_a_file_without_an_order_comes_back_by_name(tmp_path):
    xr.Dataset({"std": ("omega", [0.1]), "count": ("omega", [1])}, {"omega": [2.0]}).to_netcdf(
        tmp_path / "other.nc", engine="h5netcdf"
    )
    assert list(vi.load(tmp_path / "other.nc").variables) == ["count", "omega", "std"]


def test_csv_of_a_branch_says_of_each_row_whether_it_is_an_orbit_a_multiplier_or_a_special_point(tmp_path, result):
    dataset = result("branch")
    table = pd.read_csv(vi.save(dataset, tmp_path / "branch.csv"))
    assert table.record.value_counts().to_dict() == {
        "point x impact": dataset.sizes["point"],
        "point x multiplier": 2 * dataset.sizes["point"],
        "special x impact": dataset.sizes["special"],
    }
    orbits = table[table.record == "point x impact"]
    np.testing.assert_allclose(orbits.velocity, dataset["velocity"].values[:, 0], rtol=1e-15)
    np.testing.assert_allclose(orbits.omega, dataset["omega"], rtol=1e-15)
    assert set(orbits.stable) == {"stable", "unstable"}
    assert table.special_kind.dropna().tolist() == ["period_doubling"]


def test_csv_leaves_out_padding_but_no_cell_without_a_value(tmp_path, result):
    dataset = result("basins and their attractors")
    table = pd.read_csv(vi.save(dataset, tmp_path / "basins.csv"))
    points = table[table.record == "attractor_id x point"]
    assert len(points) == int(np.isfinite(dataset["point_velocity"]).sum())
    assert len(pd.read_csv(vi.save(sweep()[["std"]], tmp_path / "std.csv"))) == sweep()["std"].size


def test_csv_of_a_motion_without_impacts_tells_its_status(tmp_path):
    table = pd.read_csv(vi.save(never_hits(), tmp_path / "none.csv"))
    assert table.status.dropna().tolist() == ["no_impact"]


SAVED = "`dataset` must be an xarray.Dataset, an orbit, .*, got .*; functions of this package return them"
LOADED = r"`path` must be a \.zarr folder or a \.nc file, got"


@pytest.mark.parametrize(
    ("job", "error", "words"),
    [
        *((lambda what=what: vi.save(what, "x.zarr"), ValueError, SAVED) for what in (OSC, sweep()["std"], [], None)),
        *((lambda end=end: vi.load(f"map{end}"), ValueError, LOADED) for end in (".csv", ".mat", ".xls")),
        *((lambda no=no: vi.load(no), ValueError, "`path` must be the name of a file") for no in (3, None, ["x.zarr"])),
        *((lambda no=no: vi.save(sweep(), no), ValueError, "`out` must be the name of a") for no in (3, None, ["x"])),
        (lambda: vi.save(sweep(), "map.xls"), ValueError, r"`out` must end in \.zarr, .* or \.mat, got .*map\.xls"),
        (lambda: vi.load("none.nc"), FileNotFoundError, "does not exist"),
        (lambda: vi.load("bad.nc"), OSError, "cannot be read"),
        (lambda: vi.load("bad.zarr"), OSError, "cannot be read"),
        (lambda: files.check_output("no/map.zarr"), FileNotFoundError, "folder does not exist"),
        (lambda: vi.save(sweep(), "thesis.zarr", overwrite=True), IsADirectoryError, "not a Zarr store"),
    ],
)
def test_what_cannot_be_saved_or_loaded_is_refused_and_nothing_is_written(tmp_path, monkeypatch, job, error, words):
    monkeypatch.chdir(tmp_path)
    Path("bad.nc").write_text("no HDF5")
    Path("bad.zarr").mkdir()
    Path("thesis.zarr").mkdir()
    Path("thesis.zarr/chapter.txt").write_text("precious")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(error, match=words):
        job()
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("ending", files.DATA_ENDINGS)
def test_an_existing_output_is_kept_unless_overwriting_is_allowed(tmp_path, ending):
    path = vi.save(sweep(1.0), tmp_path / f"map{ending}")
    with pytest.raises(FileExistsError, match="exists"):
        vi.save(sweep(2.0), path)
    if ending in (".zarr", ".nc"):
        assert vi.load(path)["std"][0, 0] == 1.0
    vi.save(sweep(2.0), path, overwrite=True)
    if ending in (".zarr", ".nc"):
        assert vi.load(path)["std"][0, 0] == 2.0
    assert outputs(tmp_path) == [path.name]


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="rights do not bind the superuser")
def test_an_unwritable_folder_is_told_before_computing(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(PermissionError, match="cannot be written to"):
        files.check_output(tmp_path / "map.zarr")


@pytest.mark.parametrize("ending", files.DATA_ENDINGS)
@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_write_that_breaks_off_leaves_what_was_there_and_nothing_else(tmp_path, monkeypatch, ending, error):
    path = vi.save(sweep(1.0), tmp_path / f"map{ending}")
    before = sorted(p.name for p in tmp_path.rglob("*"))

    def break_off(dataset: xr.Dataset, part: Path) -> None:
        part.write_bytes(b"half")
        raise error

    monkeypatch.setitem(formats.WRITERS, ending, break_off)
    with pytest.raises(type(error)):
        vi.save(sweep(2.0), path, overwrite=True)
    assert sorted(p.name for p in tmp_path.rglob("*")) == before


def test_an_old_store_comes_back_if_the_new_one_cannot_be_moved(tmp_path, monkeypatch):
    path = vi.save(sweep(1.0), tmp_path / "map.zarr")
    replace = os.replace

    def fail_where_nothing_is(source: Path, target: Path) -> None:
        if target == path and not path.exists():
            raise OSError(5, "Input/output error")
        replace(source, target)

    monkeypatch.setattr(files.os, "replace", fail_where_nothing_is)
    with pytest.raises(OSError, match="nothing was changed"):
        vi.save(sweep(2.0), path, overwrite=True)
    monkeypatch.undo()
    assert vi.load(path)["std"][0, 0] == 1.0
    assert [p.name for p in tmp_path.iterdir()] == ["map.zarr"]


def outputs(folder: Path) -> list[str]:
    """Return the names in a folder, but for the labels beside a table."""
    return [name for name in names(folder) if not name.endswith(".csv.json")]


DYING = """
import os, sys
import numpy as np, xarray as xr
import vibroimpact as vi
from vibroimpact import files
def die(*where, **how):
    os._exit(9)
if sys.argv[2] == "replacing":
    moved = files._moved
    files._moved = lambda part, target: moved(part, target) if target.exists() else die()
elif sys.argv[2] == "removing":
    files.shutil.rmtree = die
else:
    files.replace_output = die
vi.save(xr.Dataset({"std": ("omega", [2.0])}, {"omega": [1.0]}), sys.argv[1], overwrite=True)
"""


def die(path: Path, when: str) -> None:
    """Save to a path in a process that is killed while it writes, or between setting aside and replacing."""
    assert python(DYING, path, when).returncode == 9


def test_what_a_killed_process_had_set_aside_is_offered_and_never_deleted(tmp_path):
    path = vi.save(sweep(1.0), tmp_path / "map.zarr")
    die(path, "replacing")
    (aside,) = (entry for entry in tmp_path.iterdir() if entry.suffix == ".old")
    with pytest.raises(FileNotFoundError, match=f"is in .*{aside.name}"):
        vi.load(path)
    vi.save(sweep(3.0), path)
    aside.rename(tmp_path / "former.zarr")
    assert vi.load(tmp_path / "former.zarr")["std"][0, 0] == 1.0
    assert outputs(tmp_path) == ["former.zarr", "map.zarr"]


@pytest.mark.long
def test_what_a_killed_process_had_replaced_and_half_removed_is_never_offered_and_removed_by_the_next_one(tmp_path):
    path = vi.save(sweep(1.0), tmp_path / "map.zarr")
    die(path, "removing")
    assert vi.load(path)["std"].values == 2.0
    shutil.move(path, tmp_path / "moved.zarr")
    with pytest.raises(FileNotFoundError, match="check the spelling"):
        vi.load(path)
    vi.save(sweep(3.0), path)
    assert outputs(tmp_path) == ["map.zarr", "moved.zarr"]


@pytest.mark.long
@pytest.mark.parametrize("ending", files.DATA_ENDINGS)
def test_what_a_killed_process_had_half_written_is_removed_by_the_next_one(tmp_path, ending):
    path = vi.save(sweep(1.0), tmp_path / f"map{ending}")
    die(path, "writing")
    assert len(outputs(tmp_path)) == 2
    with files.replacing(path, overwrite=True) as part:  # that of a process which lives is left alone
        part.parent.joinpath("mine").touch()
        vi.save(sweep(2.0), path, overwrite=True)
        assert part.parent.joinpath("mine").exists()
        assert outputs(tmp_path) == [part.parent.name, path.name]
        part.touch()
    assert outputs(tmp_path) == [path.name]


REPLACING = """
import sys
from pathlib import Path
from vibroimpact.files import replacing
print("ready", flush=True)
folder, number = sys.stdin.readline().split()
for turn in range(300):
    for path in (Path(folder, "map.zarr"), Path(folder, "map.nc")):
        with replacing(path, overwrite=True) as part:
            files = [part / "zarr.json", part / "0"] if path.suffix == ".zarr" else [part]
            for file in files:
                file.parent.mkdir(exist_ok=True)
                file.write_text(number * 1000)
refused = 0
try:
    with replacing(Path(folder, "once.zarr")) as part:
        part.mkdir()
        (part / "zarr.json").write_text(number)
except FileExistsError as error:
    refused = "exists now; choose another name" in str(error)
print(int(refused))
"""


@pytest.mark.long
def test_of_outputs_put_in_one_place_at_the_same_moment_one_is_there_whole(tmp_path):
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    children = [subprocess.Popen([sys.executable, "-c", REPLACING], **pipes) for _ in range(3)]
    for child in children:
        assert child.stdout.readline() == "ready\n"
    for number, child in enumerate(children):
        child.stdin.write(f"{tmp_path} {number}\n")
        child.stdin.flush()
    outcomes = [(*child.communicate(timeout=600), child.returncode) for child in children]
    assert all((complaint, code) == ("", 0) for _, complaint, code in outcomes), outcomes
    assert sum(int(refused) for refused, *_ in outcomes) == 2  # of three that may not overwrite
    words = {file.read_text() for file in (tmp_path / "map.zarr").iterdir()}
    assert len(words) == 1
    assert {len(text) for text in (*words, (tmp_path / "map.nc").read_text())} == {1000}
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["map.nc", "map.zarr", "once.zarr"]


FULL_DISK = """
import resource, sys
import numpy as np, xarray as xr
from vibroimpact.files import save
data = xr.Dataset({"std": ("omega", np.random.default_rng(0).random(100_000))}, {"omega": np.arange(1e5)})
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
try:
    save(data, sys.argv[1], overwrite=True)
except OSError as error:
    print(error)
"""


@pytest.mark.long
@pytest.mark.skipif(not hasattr(signal, "SIGXFSZ"), reason="needs a limit on the size of files")
@pytest.mark.parametrize("ending", files.DATA_ENDINGS)
def test_a_full_disk_is_told_and_nothing_is_left(tmp_path, ending):
    path = tmp_path / f"map{ending}"
    child = python(FULL_DISK, path)
    assert "could not be written" in child.stdout, child.stderr
    assert child.returncode == 0
    assert not list(tmp_path.iterdir())


def test_a_thread_that_writes_on_after_a_failure_leaves_nothing(tmp_path):
    # Zarr writes chunks from threads: one of them fails, the others do not know it yet.
    def write_on(part: Path) -> None:
        for number in range(20):
            with suppress(FileNotFoundError, FileExistsError):  # removed between two of its steps
                part.mkdir(parents=True, exist_ok=True)
                (part / f"chunk-{number}").write_bytes(b"late")
            time.sleep(0.005)

    def fail() -> None:
        with files.replacing(tmp_path / "map.zarr") as part:
            threads.append(threading.Thread(target=write_on, args=(part,)))
            threads[0].start()
            time.sleep(0.02)
            raise OSError(28, "No space left on device")

    threads: list[threading.Thread] = []
    with pytest.raises(OSError, match="nothing was changed"):
        fail()
    threads[0].join()
    assert not list(tmp_path.iterdir())
