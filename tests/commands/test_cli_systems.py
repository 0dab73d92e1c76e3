"""Systems on the command line: one's own and the ready-made ones, their parameters, starts and words."""

from __future__ import annotations

import json
import re

import pytest

import vibroimpact as vi
from systems import two_masses

TWO = """
import vibroimpact as vi

two = vi.ImpactSystem(
    mass=[[2.0, 0.5], [0.5, 1.0]],
    damping=[[0.3, -0.1], [-0.1, 0.2]],
    stiffness=[[300.0, -100.0], [-100.0, 100.0]],
    force=vi.Force(omega=8.0, harmonics={1: [5.0, 0.0], 3: [0.0, 0.5 + 0.25j]}, constant=[0.0, -2.0]),
    stops=[
        vi.Stop(direction=[0, 1], gap=0.05, restitution=0.7, name="bar", motion={1: 0.01}),
        vi.Stop(direction=[0.5, -1], gap=0.02, name="baffle"),
    ],
)
slot = vi.family(vi.models.impact_damper)
"""
OWN = "--model two.py:two"


@pytest.fixture(autouse=True)
def two(tmp_path):
    (tmp_path / "two.py").write_text(TWO)
    (tmp_path / "old.toml").write_text("")
    (tmp_path / "new.toml").write_text("[oscillator]\nbar_gap = 0.04\n")


@pytest.mark.long(but=4)
@pytest.mark.parametrize(
    ("command", "lines"),
    [
        (f"simulate {OWN} -p bar_gap=0.04 --periods 3", ["3 driving periods of 0.7854 s", "coordinate 1: ", "  bar: "]),
        (f"section {OWN} --sample-impacts 50", ["50 impacts kept", "  baffle: .* impacts, up to .* m/s and .* N s"]),
        (f"section {OWN} --kind stroboscopic --sample-periods 9", ["do not repeat", "coordinate 1: "]),
        (f"map {OWN} --x bar_gap=0.04:0.05:2 --sample-impacts 20", ["gap of bar 0.04 to 0.05 m", "short window"]),
        (
            "section --model two.py:slot --transient-impacts 3000 --sample-impacts 50",
            ["period-1 impact-2, hits at .* m/s on (left|right) and"],
        ),
        ("section --model bouncing_ball --sample-impacts 90", ["period-1 sticking, closes table, hardest hit"]),
        ("section --model bouncing_ball -p frequency=60 --sample-impacts 9", ["9 impacts kept"]),
        ("section --model unbalanced_machine --sample-impacts 50", ["period-1 impact-1, hits at 0.171 m/s"]),
        ("map --model impact_damper --x clearance=5e-3:6e-3:2 --sample-impacts 20", ["total clearance 0.005 to 0.006"]),
        (
            "describe --model two_sided_oscillator --vary frequency --full",
            ["from rest period-1 impact-2", r"^  frequency \[Hz\] +[\d.]+ +pitchfork"],
        ),
        ("describe --model two_sided_oscillator --vary frequency --json", ['"system": {', '"kind": "pitchfork"']),
        (f"map {OWN} --x bar_gap=0.04:0.05:2 --by-stop --sample-impacts 20", ["gap of bar 0.04 to 0.05 m"]),
        (f"map {OWN} --x bar_gap=0.04:0.05:2 --starts 3 --sample-impacts 20", ["3 initial conditions"]),
        (
            "basins --model two_sided_oscillator --x displacement=-1e-3:1e-3:3 --y velocity=0:1:3 --phase 0.2",
            ["3 x 3 initial conditions: displacement -0.001 to 0.001 m", "100 % period-1 impact-2"],
        ),
        (
            "basins --model two_sided_oscillator --stop left --x phase=0:1:3 --y velocity=0:1:3",
            ["3 x 3 initial conditions: phase"],
        ),
    ],
)
def test_a_command_computes_a_system(run, command, lines):
    code, output, complaints = run(command)
    assert code == 0, complaints
    for line in lines:
        assert any(re.search(line, entry) for entry in output), output


def test_orbits_of_a_system_are_listed_and_kept_as_those_of_one_mass(run, tmp_path):
    code, lines, _ = run("orbit --model two_sided_oscillator --stops left --symmetric")
    (orbit,) = vi.find_orbit(vi.models.two_sided_oscillator(), stops="left", symmetric=True)
    assert (code, lines[0]) == (0, "1 period-1 impact-2 orbit")
    assert lines[1].startswith("1. period-1 impact-2, stable, repeats every 0.04 s")
    assert f"hits at {orbit.velocities[0]:.6g} m/s at phase {orbit.phases[0]:.6g} on left" in lines[2]
    assert f"multipliers 2, the largest {orbit.multipliers[0].real:.6g}" in lines[3]
    times = ",".join(repr(turn * orbit.system.period) for turn in orbit.turns)
    assert run(f"orbit --model two_sided_oscillator --stops left,right --near {times} --out orbit.json")[0] == 0
    (read,) = json.loads((tmp_path / "orbit.json").read_text())["orbits"]
    assert read["velocities"] == pytest.approx(orbit.velocities, rel=1e-12)
    assert read["stops"] == ["left", "right"]
    assert run("orbit --model two_sided_oscillator --impacts 2 --out orbit.nc")[0] == 0
    kept = vi.load(tmp_path / "orbit.nc").isel(orbit=0)
    assert kept["stop"].values.tolist() == ["left", "right"]
    assert kept["impulse"].values == pytest.approx(orbit.impulses, rel=1e-12)
    assert kept["multiplier_real"].values == pytest.approx([value.real for value in orbit.multipliers], rel=1e-9)


def test_an_orbit_that_rests_is_listed_and_kept_with_its_rests(run, tmp_path):
    code, lines, _ = run("orbit --model bouncing_ball --impacts -1")
    (orbit,) = vi.find_orbit(vi.models.bouncing_ball(), n_impacts=-1)
    assert (code, lines[0]) == (0, "1 period-1 sticking orbit")
    assert f"hits at {orbit.velocities[0]:.6g} m/s at phase {orbit.phases[0]:.6g} on table" in lines[2]
    assert run("orbit --model bouncing_ball --impacts -1 --out orbit.json")[0] == 0
    (read,) = json.loads((tmp_path / "orbit.json").read_text())["orbits"]
    assert read["rests"] == [rest._asdict() for rest in orbit.rests]


def test_a_start_gives_every_coordinate_and_its_velocity_a_number(run, tmp_path):
    assert run(f"simulate {OWN} --start 0.01,0.02:0,-0.1:0.3 --periods 2 --out motion.nc")[0] == 0
    start = vi.State([0.01, 0.02], [0.0, -0.1], 0.3)
    assert vi.load(tmp_path / "motion.nc").identical(vi.simulate(two_masses(), start=start, periods=2))


def test_a_study_file_starts_a_system_from_lists(run, tmp_path):
    (tmp_path / "study.toml").write_text(
        'model = "two.py:two"\n[oscillator]\nbar_gap = 0.04\n[start]\ndisplacement = [0.01, 0.02]\n'
        "velocity = [0.0, 0.1]\n[sampling]\nperiods = 2\n"
    )
    assert run("simulate study.toml --out motion.nc")[0] == 0
    start = vi.State([0.01, 0.02], [0.0, 0.1])
    assert vi.load(tmp_path / "motion.nc").identical(
        vi.simulate(two_masses().replace(bar_gap=0.04), start=start, periods=2)
    )


@pytest.mark.long
def test_branches_and_boundaries_of_a_machine_are_followed(run, tmp_path):
    assert run("continue --model bouncing_ball --x amplitude=1e-4:1.6e-4 --step 0.1 --out branch.zarr")[0] == 0
    kinds = vi.load(tmp_path / "branch.zarr")["special_kind"]
    assert [kinds.attrs["flag_meanings"].split()[code] for code in kinds.values] == ["fold", "period_doubling"]
    plane = "--x amplitude=1e-4:1.6e-4 --y restitution=0.45:0.55 --periods 1 --lines 2 --step 0.2 --kind fold"
    code, lines, _ = run(f"boundary --model bouncing_ball {plane} --out curves.nc")
    assert (code, len(lines)) == (0, 1)
    assert dict(vi.load(tmp_path / "curves.nc").sizes)["curve_id"] == 1


def test_a_branch_that_rests_is_followed_to_its_end(run, tmp_path):
    command = "continue --model two_sided_oscillator -p frequency=5 --impacts -1 --x frequency=4.5:6 --step 0.1"
    code, lines, complaints = run(command)
    assert code == 0, complaints
    assert any("end of sticking at frequency = 5.5395340" in line and "leaves the stop" in line for line in lines)
    assert run(f"{command} --out rest.nc")[0] == 0
    assert vi.load(tmp_path / "rest.nc")["special_value"].values == pytest.approx(5.539534069, rel=1e-9)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (f"continue {OWN} --x omega=7:9 --near 0.1,1", "`--near` for a system needs `--stops`"),
        (f"boundary {OWN} --x omega=7:9 --y bar_gap=0:1 --kind end-of-sticking", "unknown `--kind` 'end-of-sticking'"),
        (f"basins {OWN}", "`stop` must name the stop that is struck: bar, baffle"),
        (f"basins {OWN} --x gap=0:1:3 --y velocity_0=0:1:3", "unknown coordinate 'gap'; choose from displacement_0"),
        ("describe --model bouncing_ball --vary gap", "unknown parameter 'gap'; choose from mass, amplitude"),
        (f"diagram {OWN} --x bar_gap=0.04:0.05:2 --coordinate 2", "`coordinate` must be less than the number of"),
        (f"simulate {OWN} --stop bar", "`--stop` needs a figure; add for example --out figure.png"),
        (f"section {OWN} --coordinate 1 --out it.csv", "`--coordinate` needs a figure"),
        (f"section {OWN} -p gap=0.1", "unknown parameter 'gap'; choose from omega, frequency, bar_gap"),
        (f"section {OWN} -p bar_restitution=2", "`bar_restitution` must be between 0 and 1, got 2"),
        (f"section {OWN} --start 0.1", "`start` must have 2 coordinates"),
        (f"section {OWN} --start 0.1,0:0", "`displacement` and `velocity` must have the same length"),
        (f"section {OWN} --start 0.1,0:0,0:0:1", "`--start` must be Q,Q:V,V:T"),
        (f"section {OWN} --start 0.1,a:0,0", "`displacement` must be a finite number, got 'a'"),
        (f"section {OWN} --backend fixed-step", "`backend` 'fixed-step' takes only one mass"),
        ("section --model two_sided_oscillator -p left_gap=-1", "`stops` 'left' and 'right' overlap"),
        (f"orbit {OWN} --stops bar,bar", "orbits of several impacts need a guess"),
        (f"orbit {OWN} --stops bar --impacts 1", "give either `--impacts` or the stops that are struck, not both"),
        (f"orbit {OWN} --near 0.1", "`--near` for a system needs `--stops`, and a time in s for each of them"),
        (f"orbit {OWN} --stops bat", "unknown `stops` 'bat'; choose from bar, baffle"),
        ("orbit --stops bar", "`--stops` applies only to systems"),
        (
            "section --model bouncing",
            "unknown model 'bouncing'; choose from base_excited_oscillator, bilinear_oscillator",
        ),
    ],
)
def test_what_a_system_has_not_is_refused_in_one_line(refused, command, words):
    assert words in refused(command)
