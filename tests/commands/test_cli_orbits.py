"""The commands on orbits, branches, boundaries, basins and sweeps with indices, as a user types them."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace

import pytest
import xarray as xr

import vibroimpact as vi
from processes import is_png, names
from vibroimpact.cli import compute, output
from vibroimpact.cli.orbits import orbits_json
from vibroimpact.dataset import bundle, unbundle
from vibroimpact.orbits.results import Orbits

PLANE = "--x omega=2.5:2.8 --y restitution=0.7:0.9 --lines 2 --step 0.05 --periods 1"
STARTS = "--x phase=0:1:12 --y velocity=0:3:10"
MAP = "map --x omega=2.5:2.8:4 --y restitution=0.7:0.9:3 --sample-impacts 300"


# Orbits


def test_an_orbit_is_told_with_its_impacts_and_multipliers(run, values):
    code, lines, complaints = run("orbit -p omega=2.0")
    assert (code, len(complaints)) == (0, 1)
    assert lines[0] == "1 period-1 impact-1 orbit"
    assert lines[1].startswith("1. period-1 impact-1, stable, repeats every 3.14159 s")
    assert "hits at 6.22641 m/s at phase 0.498992" in lines[2]
    assert "multipliers 0.787766 and 0.787298" in lines[3]


def test_a_pair_of_complex_multipliers_is_told_with_its_modulus(run):
    _, lines, _ = run("orbit -p omega=0.9 --impacts 2")
    assert re.search(r"multipliers -0.366553 ± 0.497613 i, modulus 0.618045", lines[3])


def test_unstable_orbits_are_found_where_the_mass_moves_chaotically(run):
    _, lines, _ = run("orbit -p omega=2.8")
    assert lines[1].startswith("1. period-1 impact-1, unstable")


def test_a_sticking_orbit_is_told_with_its_rest(run):
    _, lines, _ = run("orbit -p omega=0.1 --impacts -1")
    assert lines[1].startswith("1. period-1 sticking, stable")
    assert any("at rest at the stop from phase 0.112769 to 0.5" in line for line in lines)
    assert any("erases all memory" in line for line in lines)


def test_no_orbit_of_that_name_is_an_answer_and_no_fault(run, tmp_path):
    code, lines, _ = run("orbit -p omega=2.0 --impacts 2")
    assert (code, lines[0]) == (0, "no initial guess converged to a period-1 impact-2 orbit")
    assert run("orbit -p omega=2.0 --impacts 2 --out none.json")[0] == 0
    assert json.loads((tmp_path / "none.json").read_text())["orbits"] == []


def test_solutions_that_are_no_motion_of_the_mass_say_why(run):
    _, lines, _ = run("orbit -p omega=3 --periods 2")
    assert lines[0].startswith("no admissible period-2 impact-1 orbit")
    assert ", inadmissible, " in lines[1]
    assert "after impact 1 the mass first hits the stop" in lines[2]


def test_orbits_as_json_hold_every_digit(run, tmp_path):
    run("orbit -p omega=2.8 --out orbit.json")
    (stored,) = json.loads((tmp_path / "orbit.json").read_text())["orbits"]
    (orbit,) = vi.find_orbit(vi.ImpactOscillator(omega=2.8))
    assert (stored["velocities"], stored["phases"]) == (list(orbit.velocities), list(orbit.phases))
    assert [complex(*pair) for pair in stored["multipliers"]] == list(orbit.multipliers)
    assert (stored["stable"], stored["admissible"], stored["stick_phase"]) == (False, True, None)
    assert (stored["turns"], stored["stops"], stored["rests"]) == (list(orbit.turns), ["stop"], [])
    assert stored["contacts"][0]["energy_lost"] == orbit.contacts[0].energy_lost


def test_a_multiplier_without_bound_at_a_graze_is_a_word_in_json():
    (orbit,) = vi.find_orbit(vi.ImpactOscillator(omega=2.8))
    grazing = Orbits([replace(orbit, multipliers=(complex(-math.inf, 0.0), 0j))])
    (stored,) = json.loads(output.as_json(orbits_json(grazing, orbit.model)))["orbits"]
    assert stored["multipliers"] == [["-inf", 0.0], [0.0, 0.0]]


def test_orbits_are_saved_told_again_and_converted(run, tmp_path):
    lines = run("orbit -p gap=0.2 -p omega=0.9")[1]
    for ending in (".zarr", ".nc", ".csv", ".mat"):
        assert run(f"orbit -p gap=0.2 -p omega=0.9 --out o{ending}")[0] == 0
    for ending in (".zarr", ".nc"):
        assert run(f"plot o{ending}")[1] == lines[:-1]
    rows = (tmp_path / "o.csv").read_text().splitlines()
    assert len(rows) == 1 + sum(line[0].isdigit() for line in lines[1:])  # a head, and a row an impact


# Branches


def test_a_branch_is_told_with_its_special_points_to_twelve_digits(run, values):
    code, lines, _ = run("continue -p omega=2.6 --x omega=2.4:2.7 --step 0.05")
    assert code == 0
    assert lines[0].startswith("period-1 impact-1: ")
    assert lines[1].startswith("  stable for omega 2.4 to 2.65392")
    assert lines[2].startswith("  period doubling at omega = 2.65392352018 rad/s, hits at 0.448492 m/s")


def test_doubled_branches_are_followed_and_drawn_over_the_diagram(run, tmp_path):
    follow = "continue -p omega=2.6 --x omega=2.6:2.75:20 --step 0.05 --doublings 1"
    assert run(f"{follow} --out branches.nc")[0] == 0
    first, second = unbundle(vi.load(tmp_path / "branches.nc"))
    assert [branch.attrs["n_periods"] for branch in (first, second)] == [1, 2]
    assert float(second["special_value"][0]) == pytest.approx(float(first["special_value"][0]), abs=1e-12)
    code, lines, progress = run(f"{follow} --diagram --out branches.png --size 6x4 --dpi 60")
    assert (code, lines[0].startswith("wrote branches.png")) == (0, True)
    assert any(line.startswith("diagram: 100 % of 20") for line in progress)
    assert is_png(tmp_path / "branches.png")


def test_a_branch_from_a_file_is_drawn_over_a_saved_diagram(run, tmp_path):
    run("continue -p omega=2.6 --x omega=2.5:2.7 --step 0.05 --out branch.zarr")
    run("diagram --x omega=2.5:2.7:5 --sample-impacts 20 --out diagram.zarr")
    assert run("plot branch.zarr --over diagram.zarr --out figure.png --dpi 60")[0] == 0
    assert is_png(tmp_path / "figure.png")


def test_nothing_to_follow_is_told_and_fails_only_where_a_file_was_asked_for(run, tmp_path):
    request = "continue -p omega=2 --impacts 3 --x omega=1:3"
    assert run(request)[:2] == (0, ["no initial guess converged to a period-1 impact-3 orbit"])
    code, _, complaints = run(f"{request} --out branch.zarr")
    assert (code, len(complaints)) == (1, 2)
    assert "nothing was written" in complaints[1]
    assert names(tmp_path) == []


# Boundaries


@pytest.mark.long
def test_boundaries_are_told_saved_and_drawn_over_maps(run, tmp_path):
    lines = run(f"boundary {PLANE}")[1]
    assert lines[0] == "1 curve in the plane of omega and restitution"
    assert lines[1].startswith("  period doubling of period-1 impact-1: angular driving frequency 2.")
    assert run(f"boundary {PLANE} --out curves.zarr")[0] == 0
    assert run("plot curves.zarr")[1] == lines[:-1]
    run(f"{MAP} --indices all --out map.zarr")
    for index in ("motion", "lyapunov"):
        assert run(f"plot curves.zarr --over map.zarr --index {index} --out {index}.png --dpi 50")[0] == 0
        assert is_png(tmp_path / f"{index}.png")
    assert run(f"boundary {PLANE} --over map.zarr --out direct.png --dpi 50")[0] == 0


def test_a_kind_that_is_not_there_is_no_curve(run):
    code, lines, _ = run(f"boundary {PLANE} --kind fold,grazing")
    assert (code, lines) == (
        0,
        [
            "no such boundary found in the plane of omega and restitution: fold and grazing only; searched for "
            "period-1 impact-1 on lines across the plane only; other motions end elsewhere"
        ],
    )


def test_boundaries_of_an_orbit_with_two_impacts_start_from_that_orbit(run):
    plane = "--x gap=0.3:0.4 --y omega=0.88:0.92 --step 0.1"
    code, lines, _ = run(f"boundary -p omega=0.9 -p gap=0.35 --impacts 2 {plane} --kind fold")
    assert (code, len(lines)) == (0, 5)
    assert lines[1].startswith("  fold of period-1 impact-2: gap 0.3")
    assert lines[2:4] == [
        "followed period-1 impact-2 from the oscillator at -p along gap only", "other motions end elsewhere",
    ]  # fmt: skip


def test_the_end_of_sticking_is_a_boundary_too(run, tmp_path):
    request = "boundary --x omega=0.3:0.4 --y restitution=0.75:0.85 --lines 2 --periods 1 --kind end-of-sticking"
    assert run(f"{request} --step 0.1 --out end.nc")[0] == 0
    (curve,) = unbundle(vi.load(tmp_path / "end.nc"))
    assert run("plot end.nc")[1][1].startswith("  end of sticking of period-1 sticking: ")
    assert curve.attrs["n_impacts"] == -1


# Bundles of curves


def test_curves_come_out_of_a_bundle_as_they_went_in():
    osc = vi.ImpactOscillator()
    curves = vi.boundary_curves(osc, ("omega", "mass"), ((2.4, 2.8), (0.9, 1.1)), n_periods=(1,), lines=2, step=0.05)
    parts = [curve.dataset for curve in curves]
    joined = bundle(parts, "boundary_curves", {"oscillator": parts[0].attrs["oscillator"]})
    for back, part in zip(unbundle(joined), parts, strict=True):
        xr.testing.assert_equal(back, part)
        assert list(back.coords) == ["omega", "mass"]
        for key in ("n_periods", "outcome", "message"):
            assert back.attrs[key] == part.attrs[key]


# Basins


def test_basins_are_told_with_names_shares_and_hardest_hits(run, tmp_path):
    code, lines, _ = run(f"basins -p omega=3.0 {STARTS}")
    assert code == 0
    assert lines[0] == "12 x 10 initial conditions: phase of the driving period 0 to 1; impact velocity 0 to 3 m/s"
    assert re.match(r"  [\d.]+ % period-2 impact-2, hardest hit 0.4287 m/s, largest exponent -0.1115 1/s", lines[1])
    assert sum(float(line.split()[0]) for line in lines if " % " in line) == pytest.approx(100.0, abs=0.5)


def test_basins_are_saved_and_drawn(run, tmp_path):
    assert run(f"basins -p omega=3.0 {STARTS} --out basins.zarr")[0] == 0
    assert run("plot basins.zarr --out portrait.png --dpi 60")[0] == 0
    assert is_png(tmp_path / "portrait.png")


def test_starts_in_front_of_the_stop_take_one_phase(run, tmp_path):
    plane = "--x displacement=-2:0:5 --y velocity=-1:1:4 --phase 0.25"
    assert run(f"basins -p omega=1.45 {plane} --out basins.nc")[0] == 0
    loaded = vi.load(tmp_path / "basins.nc")
    assert loaded["attractor"].dims == ("displacement", "velocity")
    assert json.loads(loaded.attrs["arguments"])["phase"] == 0.25


def test_axes_of_starts_left_out_span_the_impact_surface(run, monkeypatch, tmp_path):
    monkeypatch.setattr(compute, "INITIAL_CONDITIONS", 6)
    run("basins -p omega=2.0 --out basins.nc")
    loaded = vi.load(tmp_path / "basins.nc")
    assert (loaded["phase"].values[[0, -1]].tolist(), float(loaded["velocity"][-1])) == ([0.0, 1.0], 4.0)


# Indices and pictures in sweeps


def test_a_map_of_names_and_one_of_exponents_bring_their_own_indices(run, tmp_path):
    for kind in ("motion-map", "exponent-map"):
        assert run(f"{MAP} --figure {kind} --out {kind}.png --dpi 50")[0] == 0
        assert is_png(tmp_path / f"{kind}.png")


def test_a_map_with_names_is_told_by_its_motions(run):
    _, lines, _ = run(f"{MAP} --indices all")
    assert any(re.match(r"  [\d.]+ % period-1 impact-1$", line) for line in lines)
    assert any(line.startswith("largest Lyapunov exponent (lyapunov): ") for line in lines)


def test_a_saved_map_is_drawn_as_the_index_asks(run, tmp_path):
    run(f"{MAP} --indices all --out map.nc")
    for index in ("dissipation", "lyapunov", "motion"):
        assert run(f"plot map.nc --index {index} --out {index}.png --dpi 50")[0] == 0


def test_a_diagram_holds_indices_and_shows_one_on_top(run, tmp_path):
    diagram = "diagram --x omega=2.5:2.8:4 --sample-impacts 200 --indices lyapunov,n_periods"
    assert run(f"{diagram} --out diagram.nc")[0] == 0
    assert set(vi.load(tmp_path / "diagram.nc")) >= {"lyapunov", "n_periods"}
    assert run("plot diagram.nc --index lyapunov --out figure.png --dpi 50")[0] == 0
    assert run(f"{diagram} --index lyapunov --out direct.png --dpi 50")[0] == 0


def test_a_study_file_may_ask_for_the_new_indices(run, tmp_path):
    (tmp_path / "study.toml").write_text('[axes]\nomega = [2.0, 2.5]\n[run]\nindices = ["lyapunov", "n_impacts"]\n')
    for command in ("map", "diagram"):
        assert run(f"{command} study.toml --sample-impacts 100 --out {command}.nc")[0] == 0
        assert vi.load(tmp_path / f"{command}.nc")["n_impacts"].values.tolist() == [1, 1]


# Interruptions


@pytest.mark.usefixtures("stopped_early")
def test_an_interrupted_branch_keeps_the_orbits_it_has(run, tmp_path):
    code, _, complaints = run("continue -p omega=2.6 --x omega=2:3 --out branch.nc")
    assert code == 130
    assert complaints[-1] == "vibroimpact: interrupted; what was finished is kept"
    assert unbundle(vi.load(tmp_path / "branch.nc"))[0].attrs["outcome"] == "stopped stopped"


NOTHING = "vibroimpact: interrupted before anything was finished; nothing was written"
KEPT = "vibroimpact: interrupted; what was finished is kept"


@pytest.mark.usefixtures("stopped_early")
@pytest.mark.parametrize(("command", "words", "left"), [
    (f"boundary {PLANE} --kind fold --out curves.nc", "nothing was written", [[]]),
    ("basins -p omega=2.8 --x phase=0:1:40 --y velocity=0:3:40 --workers 1 --out basins.nc", "", [[], ["basins.nc"]]),
    ("response -p gap=0.1 -p damping=0.1 --x omega=1.5:3", NOTHING, [[]]),
    ("response -p gap=0.1 -p damping=0.1 --x omega=1.5:3 --out curve.nc", NOTHING, [[]]),
    ("response -p gap=1.5 -p damping=0.1 --x omega=0.3:3", KEPT, [[]]),
    ("response -p gap=1.5 -p damping=0.1 --x omega=0.3:3 --out curve.nc", KEPT, [["curve.nc"]]),
])  # fmt: skip
def test_an_interrupted_command_keeps_what_it_has_found_and_all_else(run, tmp_path, command, words, left):
    (tmp_path / "curves.json").write_text("{}")
    code, _, complaints = run(command)
    assert code == 130
    assert words in complaints[-1]
    assert names(tmp_path) in [sorted(["curves.json", *one]) for one in left]


# Requests that do not go together


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("continue --x omega=1:3 --diagram", "`--diagram` needs a figure"),
        ("continue --x omega=1:3 --diagram --out branch.nc", "`--diagram` needs a figure"),
        ("boundary --x omega=1:3 --y r=0.5:0.9 --over map.zarr", "`--over` needs a figure"),
        ("orbit --impacts 0", "`n_impacts` must be .*, got 0"),
        ("orbit --periods x", "`n_periods` must be a whole number >= 1, got 'x'"),
        ("orbit --near 1", "`--near` must be PHASE,VELOCITY .*, got '1'"),
        ("orbit --impacts 2 --near 0.1,-1", "`near` must be .* velocity > 0, got -1"),
        ("describe --vary speed", "unknown parameter 'speed'"),
        ("describe --within 0", "`within` must be above 0 and up to 1000, got 0"),
    ],
)
def test_what_does_not_go_together_is_refused(refused, command, words):
    assert re.search(words, refused(command))


def test_a_map_over_another_plane_is_refused_before_computing(run, refused, monkeypatch):
    run("map --x omega=2:3:3 --y mass=1:2:3 --sample-impacts 20 --out map.zarr")
    monkeypatch.setattr(vi, "boundary_curves", pytest.fail, raising=False)
    words = "`--over` must be a map over omega and restitution, as the curves are, got one over omega and mass"
    assert words in refused(f"boundary {PLANE} --over map.zarr --out curves.png")


@pytest.mark.parametrize("command", ["orbit", "continue --x omega=1.9:2.1", f"boundary {PLANE}", f"basins {STARTS}"])
def test_an_existing_output_is_refused(refused, tmp_path, command):
    (tmp_path / "old.nc").write_text("precious")
    assert "exists" in refused(f"{command} --out old.nc")


def test_a_response_curve_without_a_load_is_a_wrong_request_and_one_without_motions_an_answer(run, tmp_path):
    code, _, notes = run("response -p amplitude=0 --x omega=1:2")
    assert code == 2
    assert notes[-1].startswith("vibroimpact: `model` has no periodic load and no moving stop, and a response curve")
    empty = "response -p gap=-50 --x omega=0.05:0.06 --step 0.2"
    code, lines, _ = run(empty)
    assert (code, lines[-1][:49]) == (0, "no periodic motion was found along omega from 0.0")
    code, _, notes = run(f"{empty} --out curve.nc")
    assert (code, notes[-1][-21:]) == (1, "; nothing was written")
    assert not list(tmp_path.glob("*.nc"))
