"""The command line end to end: words, files, one line for every fault, nothing half-written."""

from __future__ import annotations

import re

import numpy as np
import pytest
import xarray as xr

import vibroimpact as vi
from processes import names, python
from vibroimpact.dataset import model_of
from vibroimpact.families import load_model

COMMANDS = (
    "simulate", "section", "diagram", "map", "orbit", "continue", "boundary", "attractors", "basins", "describe",
    "compare", "plot", "models", "reproduce",
)  # fmt: skip


# Help


@pytest.mark.parametrize("command", [[], ["--help"], *([name, "--help"] for name in COMMANDS)])
def test_help_tells_an_example_and_imports_nothing_heavy(command):
    code = (
        "import sys; from vibroimpact.cli import main; code = main(sys.argv[1:]); "
        "print('heavy:', {'numba', 'numpy', 'xarray', 'matplotlib', 'pandas', 'pydantic'} & set(sys.modules), code)"
    )
    done = python(code, *command)
    assert "heavy: set() 0" in done.stdout
    assert re.search(r"\n +vibroimpact ", done.stdout.split("For example:")[1])


def test_version_is_that_of_the_package(run):
    assert run("--version") == (0, [f"vibroimpact {vi.__version__}"], [])


# Words


def test_the_motion_is_named_in_a_sentence_with_units(run):
    code, lines, complaints = run("section -p omega=0.9")
    assert (code, len(complaints)) == (0, 1)
    assert lines[0] == "from rest at y = min(0, gap): period-1 impact-2, hits at 1.48 and 1.13 m/s every 6.98 s"


@pytest.mark.parametrize("parameter", ["omega=2.0", "w=2", f"frequency={1 / np.pi}"])
def test_a_parameter_goes_by_word_symbol_or_frequency_in_hz(run, parameter):
    _, lines, _ = run(f"section -p {parameter} --sample-impacts 200")
    assert lines[0] == "from rest at y = min(0, gap): period-1 impact-1, hits at 6.23 m/s every 3.14 s"


def test_a_stroboscopic_section_is_told_by_its_period(run):
    _, lines, _ = run("section -p w=4 --kind stroboscopic --sample-periods 50")
    assert lines[0] == "from rest at y = min(0, gap): period-2, repeats every 3.14 s"


def test_a_simulation_is_told_with_its_hits_and_what_it_settles_to(run):
    code, lines, _ = run("simulate -p w=0.9 --start -1,0,0 --periods 5")
    assert code == 0
    assert lines[0].startswith("from y = -1 m, y' = 0 m/s at t = 0 s: 5 driving periods of 6.981 s")
    assert any("the hardest at" in line for line in lines)
    assert lines[-1] == "settles to: period-1 impact-2, hits at 1.48 and 1.13 m/s every 6.98 s"


@pytest.mark.parametrize(
    ("length", "times"),
    [
        ("--times 0,0.3,20", [0.0, 0.3, 20.0]),
        ("--times 0:500ms:3", [0.0, 0.25, 0.5]),
        ("--times 0.1s,200ms", [0.1, 0.2]),
        ("--duration 500ms --samples-per-period 20", [0.0, np.pi / 20, np.pi / 10, 3 * np.pi / 20, 0.5]),
    ],
)
def test_a_simulation_is_sampled_at_times_in_seconds(run, tmp_path, length, times):
    assert run(f"simulate -p w=2 {length} --out {tmp_path / 'motion.nc'}")[0] == 0
    assert vi.load(tmp_path / "motion.nc")["time"].values.tolist() == pytest.approx(times)


def test_a_load_in_pieces_is_typed_with_durations_and_forces(run):
    design = "simulate -p omega=2 -p gap=0.1"
    assert run(f"{design} --piece 500ms:20N --piece 0.5s:0 --piece 3s:model --times 0:4:81 --out a.nc")[0] == 0
    own = vi.ImpactOscillator(omega=2.0, gap=0.1)
    pieces = [(0.5, vi.Force(constant=20.0)), (0.5, None), (3.0, own.system.force)]
    expected = vi.simulate(own, pieces=pieces, times=np.linspace(0.0, 4.0, 81))
    typed = vi.load("a.nc")
    for name in ("displacement", "impact_time", "impact_velocity"):
        np.testing.assert_allclose(typed[name].values, expected[name].values, atol=1e-12)
    _, lines, _ = run(f"{design} --piece 0.5s:20N --piece 0.5s:0")
    assert lines[0] == "from rest at y = min(0, gap): 0 to 1 s"
    assert not any("settles" in line for line in lines)  # the load of the model, which settles, is not there


def test_a_system_takes_a_force_for_each_coordinate_and_a_study_file_its_pieces(run, tmp_path):
    (tmp_path / "chain.py").write_text(
        "import vibroimpact as vi\n"
        "chain = vi.ImpactSystem(mass=[[1.0, 0.0], [0.0, 1.0]], stiffness=[[2.0, -1.0], [-1.0, 1.0]],\n"
        "    stops=[vi.Stop(direction=[0.0, 1.0], gap=0.5)], force=vi.Force(omega=1.3, harmonics={1: [0.2, 0.0]}))\n"
    )
    (tmp_path / "chain.toml").write_text('[sampling]\npieces = [["1s", 0, "3N"], [2, "model"]]\n')
    chain = load_model(f"{tmp_path / 'chain.py'}:chain")
    pieces = [(1.0, vi.Force(constant=[0.0, 3.0])), (2.0, chain.force)]
    expected = vi.simulate(chain, pieces=pieces, times=np.linspace(0.0, 3.0, 31))
    for request in ("--piece 1s:0,3N --piece 2:model", "chain.toml"):
        assert run(f"simulate {request} --model chain.py:chain --times 0:3:31 --out a.nc --overwrite")[0] == 0
        typed = vi.load("a.nc")["displacement"]
        assert typed.dims == ("time", "coordinate")
        np.testing.assert_allclose(typed.values, expected["displacement"].values, atol=1e-12)


@pytest.mark.parametrize(
    ("typed", "message"),
    [
        ("--times 2,1", "`times` must increase, got 2 s, then 1 s"),
        ("--times 0:1", "`--times` must be T,T,... or FROM:TO:POINTS"),
        ("--times 0:1kg:3", "`times`"),
        ("--duration -1", "`duration` must be a finite number > 0, got -1"),
        ("--duration 1 --periods 2", "give either `periods` or `duration`, not both"),
        ("--piece 0.5s", "`--piece` must be TIME:FORCE such as 4ms:50N, or 1s:model, got '0.5s'"),
        ("--piece 0:5", "`pieces[0] duration` must be a finite number > 0, got 0"),
        ("--piece 1s:2 --piece 1s:5m", "`pieces[1] force` must be a number, or one with a unit that can be turned"),
        ("--piece 1s:mode", "`pieces[0] force` must be a finite number, got 'mode'; give a force in N, or model"),
        ("--piece 1s:1,2", "one per coordinate, got 2"),
        ("--piece 1s:1 --periods 3", "give either `periods` or `pieces`, not both"),
    ],
)
def test_what_is_wrong_with_times_and_pieces_is_said(refused, typed, message):
    assert message in refused(f"simulate {typed}")


def test_a_diagram_is_told_by_its_stretches(run):
    _, lines, _ = run("diagram --x omega=1.8:2.2:5 --sample-impacts 200")
    values, rest = "5 values of angular driving frequency 1.8 to 2.2 rad/s", "from rest at y = min(0, gap)"
    assert lines[0] == f"{values}, each {rest}"
    assert "  omega 1.8 to 2.2 rad/s: 1 impact per cycle" in lines
    _, lines, _ = run("diagram --x omega=1.8:2.2:5 --sample-impacts 200 --direction up")
    assert lines[0] == f"{values}, going up {rest}, then each next one from the last state"


def test_a_map_is_told_by_ranges_shares_and_speed(run):
    _, lines, progress = run("map --x omega=2:2.8:3 --y m=1:2:2 --indices std,max_velocity --sample-impacts 200")
    assert lines[0] == (
        "3 x 2 cells from rest at y = min(0, gap): angular driving frequency 2 to 2.8 rad/s; mass 1 to 2 kg"
    )
    assert re.match(
        r"largest impact velocity \(max_velocity\): .* m/s, largest at omega = 2 rad/s, mass = 1 kg$", lines[2]
    )
    assert sum(float(line.split()[0]) for line in lines if " % " in line) == pytest.approx(100.0, abs=0.5)
    assert re.match(r"computed in .* s, .* impacts/s", lines[-1])
    assert re.match(r"map: 100 % of 6, .* impacts/s, .* s", progress[-1])


def test_a_motion_without_impacts_is_told_and_no_fault(run):
    code, lines, _ = run("section -p gap=10")
    assert code == 0
    never = "no impact: the mass never reaches the stop from these initial conditions"
    assert lines[0] == f"from rest at y = min(0, gap): {never}"


def test_a_map_from_several_initial_conditions_counts_the_cells_that_hit_only_from_some(run, tmp_path):
    grid = "--x omega=1:3:5 --y gap=0:3:4 --sample-impacts 100"
    command = f"map {grid} --indices max_velocity"
    _, lines, _ = run(f"{command} --starts 8")
    assert lines[0] == "5 x 4 cells: angular driving frequency 1 to 3 rad/s; gap 0 to 3 m"
    assert lines[1].startswith(
        "each from 8 initial conditions: rest at y = min(0, gap); 7 impacts at phases 0 to 1 and "
    )
    sweep = vi.parameter_map(vi.ImpactOscillator(), omega=np.linspace(1, 3, 5), gap=np.linspace(0, 3, 4), start=8,
                             sample_impacts=100, indices=["max_velocity"])  # fmt: skip
    hits = np.isfinite(sweep["max_velocity"].values)
    first, others = hits[..., 0].sum(), (hits.any(axis=-1) & ~hits[..., 0]).sum()
    assert others > 0
    line = (
        f"impacts persist from rest in {first} of 20 cells ({5 * first:.3g} %); in {others} more ({5 * others:.3g} %) "
        "only from others of the 8 initial conditions"
    )
    assert line in lines
    assert sum(float(row.split()[0]) for row in lines if row.startswith("  ")) == pytest.approx(100.0, abs=0.5)

    run(f"{command} --starts 8 --out m.zarr")
    assert line in run("info m.zarr")[1]
    assert line in run("plot m.zarr")[1]
    xr.testing.assert_equal(vi.load("m.zarr").load(), sweep)
    for figure in ("index-contour", "index-surface", "motion-map"):
        assert run(f"map {grid} --starts 2 --figure {figure} --out {figure}.png --dpi 50")[0] == 0
    assert run("plot m.zarr --out m.png --dpi 50")[0] == 0


def test_typed_initial_conditions_replace_those_of_a_study_file(run, tmp_path):
    (tmp_path / "study.toml").write_text("[axes]\nomega = [2.0]\n[sampling]\nsample_impacts = 20\n[run]\nstarts = 3\n")
    assert run("map study.toml")[1][1].startswith("each from 3 initial conditions")
    assert run("map study.toml --starts 4")[1][1].startswith("each from 4 initial conditions")
    assert run("map study.toml --start -1")[1][0].startswith("1 cell from y = -1 m, y' = 0 m/s at t = 0 s: ")
    assert run("section study.toml")[1][0].startswith("from rest at y = min(0, gap): period-1 impact-1")


# Files


def test_a_result_is_written_in_the_format_its_ending_names(run, tmp_path):
    for ending in (".zarr", ".nc", ".csv", ".mat", ".png", ".svg", ".pdf"):
        code, lines, _ = run(f"map --x omega=2:2.8:3 --y m=1:2:2 --sample-impacts 50 --out map{ending}")
        assert code == 0
        assert lines[0].startswith(f"wrote map{ending}")
    with xr.open_zarr(tmp_path / "map.zarr", consolidated=False) as stored:
        assert stored["std"].dims == ("omega", "mass")
    assert (tmp_path / "map.png").read_bytes()[1:4] == b"PNG"
    assert b"<svg" in (tmp_path / "map.svg").read_bytes()
    assert (tmp_path / "map.pdf").read_bytes()[:4] == b"%PDF"


def test_every_command_draws_its_figure_of_the_size_in_inches(run, tmp_path):
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
        content = (tmp_path / "figure.png").read_bytes()
        assert len(content) > 1000
        assert [int.from_bytes(content[at : at + 4], "big") for at in (16, 20)] == [200, 150]  # inches times dpi


def test_options_complete_a_study_file(run, tmp_path):
    (tmp_path / "study.toml").write_text(
        "[oscillator]\nrestitution = 0.7\n[axes]\nw = [2.0, 2.5]\nmass = { from = 1, to = 2, points = 3 }\n"
        "[sampling]\nsample_impacts = 50\n"
    )
    assert run("map study.toml -p c=0.02 --indices mean_velocity --out map.nc")[0] == 0
    loaded = vi.load(tmp_path / "map.nc")
    expected = vi.parameter_map(
        vi.ImpactOscillator(restitution=0.7, damping=0.02),
        omega=[2.0, 2.5], mass=[1.0, 1.5, 2.0], indices=("mean_velocity",), sample_impacts=50,
    )  # fmt: skip
    xr.testing.assert_equal(loaded, expected)


def test_a_saved_result_is_told_drawn_and_converted(run, tmp_path):
    run("diagram --x w=2:2.4:5 --sample-impacts 20 --out diagram.zarr")
    run("map --x w=2:2.4:5 --sample-impacts 20 --out sweep.nc")
    code, lines, _ = run("plot diagram.zarr")
    assert code == 0
    assert lines[0] == "5 values of angular driving frequency 2 to 2.4 rad/s, each from rest at y = min(0, gap)"
    for command in ("diagram.zarr --out a.svg", "diagram.zarr --sweep sweep.nc --out b.png", "sweep.nc --out c.csv"):
        assert run(f"plot {command}")[0] == 0
    assert {"a.svg", "b.png", "c.csv"} <= set(names(tmp_path))


def test_reproduce_hands_folder_and_choices_on(run, tmp_path, monkeypatch):
    import vibroimpact.studies.lee

    options = {}

    def reproduced(out, **choices):
        options.update(choices, out=str(out))
        return out

    monkeypatch.setattr(vibroimpact.studies.lee, "run", reproduced, raising=False)
    assert run("reproduce --out report --quick --level 0.05")[0] == 0
    assert options["out"] == "report"
    assert (options["quick"], options["level"]) == (True, 0.05)


@pytest.mark.parametrize("command", ["reproduce --out mine", "reproduce --out mine --overwrite"])
def test_reproduce_leaves_a_folder_alone_that_is_no_study(refused, tmp_path, command):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("precious")
    assert "`out` 'mine'" in refused(command)
    assert names(tmp_path / "mine") == ["thesis.txt"]


# Damping as a part of critical damping: c = 2 zeta sqrt(k m)


@pytest.mark.parametrize("name", ["damping_ratio", "zeta"])
def test_a_damping_ratio_stands_for_the_damping_that_it_is_of_this_mass_and_stiffness(run, name):
    _, ratio, _ = run(f"section -p k=2000 -p {name}=0.01 -p m=0.5 -p frequency=20 --sample-impacts 50")
    c = 2.0 * 0.01 * np.sqrt(2000.0 * 0.5)
    _, damping, _ = run(f"section -p k=2000 -p damping={float(c)!r} -p m=0.5 -p frequency=20 --sample-impacts 50")
    assert ratio[:2] == damping[:2]


@pytest.mark.parametrize("damping", ["zeta = 0.05", "damping_ratio = 0.05", "c = 3.0"])
def test_of_a_damping_ratio_and_a_damping_the_one_that_is_typed_takes_the_place_of_that_in_a_study(
    run, tmp_path, damping
):
    (tmp_path / "study.toml").write_text(f"[oscillator]\nm = 4.0\n{damping}\nk = 9.0\n")
    ratio = damping != "c = 3.0"
    for typed, c in (("", 0.6), (" -p m=1", 0.3), (" -p c=0.2", 0.2)) if ratio else ((" -p zeta=0.05", 0.6),):
        assert run(f"section study.toml --sample-impacts 20 --overwrite --out out.nc{typed}")[0] == 0
        assert model_of(vi.load(tmp_path / "out.nc")).damping == pytest.approx(c, rel=1e-15)


# Diagrams in words


def test_a_diagram_tells_where_it_hits_hardest(run, tmp_path):
    _, lines, _ = run("diagram --x omega=1.8:2.2:5 --sample-impacts 200")
    assert run("diagram --x omega=1.8:2.2:5 --sample-impacts 200 --out five.nc")[0] == 0
    diagram = vi.load(tmp_path / "five.nc")
    hardest = diagram["velocity"].max("impact")
    at = int(hardest.values.argmax())
    assert f"hardest impact {float(hardest[at]):.4g} m/s at omega {float(diagram['omega'][at]):.4g} rad/s" in lines


def test_a_diagram_names_cycles_and_chaos_where_indices_tell_them(run):
    _, lines, _ = run("diagram --x omega=2:2.8:2 --sample-impacts 2000 --indices all")
    assert [line.split(": ")[1] for line in lines if line.startswith("  omega")] == ["period-1 impact-1", "chaotic"]
    _, lines, _ = run("diagram --x frequency=0.3183:0.4456:2 --sample-impacts 2000 --indices lyapunov")
    assert [line.split(": ")[1] for line in lines if line.startswith("  freq")] == ["1 impact per cycle", "chaotic"]
    _, lines, _ = run("diagram --x omega=2:2.8:2 --sample-impacts 2000")
    names = [line.split(": ")[1] for line in lines if line.startswith("  omega")]
    assert names == ["1 impact per cycle", "does not repeat"]


def test_a_diagram_leaves_out_how_small_the_impacts_of_a_chatter_became(run):
    _, chatter, _ = run("diagram --x omega=0.1:0.2:2 --sample-impacts 500")
    assert any(line.startswith("impact velocity up to ") for line in chatter)
    _, cycles, _ = run("diagram --x omega=1.9:2:2 --sample-impacts 50")
    assert any(" to " in line for line in cycles if line.startswith("impact velocity"))
    assert not any(line.startswith("impact velocity up to ") for line in cycles)


def test_the_spread_of_a_cycle_is_zero_and_not_rounding(run):
    _, lines, _ = run("section -p omega=2.0 --sample-impacts 500")
    assert lines[1].endswith("standard deviation 0 m/s")
    _, lines, _ = run("map --x omega=2:2.05:2 --y m=1:1.05:2 --indices std,impact_phase_spread")
    assert "standard deviation of impact velocities (std): 0 m/s" in lines[1]
    assert "spread of the impact phases (impact_phase_spread): 0, " in lines[2]


def test_how_motions_ended_is_told_without_underscores(run):
    _, lines, _ = run("map --x omega=2:2.5:2 --y gap=9:10:2")
    assert any("% no impact: the mass never reaches the stop" in line for line in lines)
