"""A model of one's own on the command line: its parameters are what -p and the axes take."""

from __future__ import annotations

import json
import re

import pytest

import vibroimpact as vi
from fenced import ROOT

TUBE = """
import math
import vibroimpact as vi

@vi.family(units={"rpm": "1/min"})
def shaker(unbalance=0.002, rpm=1500.0, clearance_mm=0.5):
    omega = rpm * 2 * math.pi / 60
    force, gap = unbalance * omega**2, clearance_mm / 1e3
    return vi.ImpactOscillator(mass=1.0, stiffness=2e4, damping_ratio=0.02, amplitude=force, omega=omega, gap=gap)

heavy = vi.ImpactOscillator(mass=2.0)
plain = 3
"""
MODEL = "--model tube.py:shaker"


@pytest.fixture(autouse=True)
def tube(tmp_path):
    (tmp_path / "tube.py").write_text(TUBE)


def test_a_family_takes_its_own_parameters_and_axes(run, tmp_path):
    command = f"map {MODEL} -p unbalance=0.001 --x rpm=1200:1500:4 --y clearance_mm=0.1:0.5:3 --sample-impacts 50"
    assert run(f"{command} --out map.zarr")[0] == 0
    stored = vi.load(tmp_path / "map.zarr")
    assert stored["std"].dims == ("rpm", "clearance_mm")
    assert stored["rpm"].attrs["units"] == "1/min"
    assert run("plot map.zarr")[1][0] == (
        "4 x 3 cells from rest at y = min(0, gap): rpm 1200 to 1500 1/min; clearance mm 0.1 to 0.5"
    )
    assert "over rpm 1200 to 1500 1/min in 4 and clearance_mm" in run("info map.zarr")[1][0]


@pytest.mark.parametrize(
    ("command", "line"),
    [
        ("section -p rpm=1700 --sample-impacts 50", "period-1 impact-1"),
        ("simulate --periods 3", "3 driving periods of 0.04 s"),
        ("diagram --x rpm=1600:1700:2 --sample-impacts 50", "hardest impact .* at rpm .* 1/min"),
        ("orbit -p rpm=1700", "1. period-1 impact-1, stable"),
        ("continue -p rpm=1700 --x rpm=1690:1710 --step 0.1", "stable for rpm 1690 to 1710"),
        ("basins -p rpm=1700 --x phase=0:1:3 --y velocity=0:1:2 --sample-impacts 50", "period-1 impact-1"),
    ],
)
def test_a_command_computes_a_family(run, command, line):
    code, lines, complaints = run(f"{command} {MODEL}")
    assert code == 0, complaints
    assert any(re.search(line, entry) for entry in lines), lines


def test_an_oscillator_in_a_file_is_a_model_with_its_values_for_defaults(run):
    assert (
        run("section --model tube.py:heavy --sample-impacts 50")[1][:2]
        == run("section -p m=2 --sample-impacts 50")[1][:2]
    )


def test_a_study_file_may_name_the_model(run, tmp_path):
    (tmp_path / "study.toml").write_text(
        'model = "tube.py:shaker"\n[oscillator]\nrpm = 1700\n[sampling]\nsample_impacts = 50\n'
    )
    assert run("section study.toml")[1][0] == run(f"section {MODEL} -p rpm=1700 --sample-impacts 50")[1][0]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("--model tube.py:shaker -p omega=2", "unknown parameter 'omega'; choose from unbalance, rpm, clearance_mm"),
        ("--model tube.py:shaker -p rpm=fast", "`rpm` must be a finite number, got 'fast'"),
        ("--model tube.py:none", "unknown model 'none'; choose from shaker, heavy"),
        ("--model tube.py:plain", "unknown model 'plain'; choose from shaker, heavy"),
        ("--model tube.py", "`model` must name a model of tube.py: tube.py:shaker or tube.py:heavy"),
        ("--model tube.py:", "`model` must name a model of tube.py: tube.py:shaker or tube.py:heavy"),
        ("--model tube:shaker", "`model` must be FILE.py:NAME, as in tube.py:shaker, or a ready-made model, as in"),
        ("--model Impact_Damper", "did you mean 'impact_damper'?"),
        ("--model two-sided-oscillator", "did you mean 'two_sided_oscillator'?"),
        ("--model BouncingBall", "did you mean 'bouncing_ball'?"),
        ("--model nothing", "or give FILE.py:NAME for a model of your own"),
        ("--model bouncing_ball -p Restitution=0.5", "did you mean 'restitution'?"),
        ("--model none.py:shaker", "there is no file 'none.py'"),
        ("--model broken.py:shaker", "`model` 'broken.py:shaker' cannot be loaded; ZeroDivisionError"),
        ("--model lacking.py:shaker", "`model` 'lacking.py:shaker' cannot be loaded; ModuleNotFoundError: No module"),
    ],
)
def test_a_wrong_model_is_refused_in_one_line(refused, tmp_path, options, words):
    (tmp_path / "broken.py").write_text("1 / 0")
    (tmp_path / "lacking.py").write_text("import no_such_module")
    assert words in refused(f"section {options}")


def test_a_model_whose_function_cannot_import_what_it_needs_is_named(refused, tmp_path):
    (tmp_path / "late.py").write_text(
        "import vibroimpact\n@vibroimpact.family\ndef late(omega=2.0):\n    import no_such_module\n"
    )
    assert refused("section --model late.py:late") == (
        "vibroimpact: `model` 'late.py:late' cannot be used; "
        "late fails at omega=2: No module named 'no_such_module' (late.py, line 4)"
    )


# Ready-made machines


def test_the_ready_made_machines_are_listed_in_a_line_each(run):
    code, lines, complaints = run("models")
    assert (code, complaints) == (0, [])
    assert [line.split()[0] for line in lines] == vi.models.__all__
    assert all(len(line) < 140 for line in lines)
    assert list(json.loads("\n".join(run("models --json")[1]))) == vi.models.__all__


@pytest.mark.parametrize("name", vi.models.__all__)
def test_the_parameters_of_a_machine_are_a_table_and_its_page_is_there(run, name):
    code, lines, _ = run(f"models {name}")
    assert code == 0
    machine = json.loads("\n".join(run(f"models {name} --json")[1]))
    family = vi.family(getattr(vi.models, name))
    assert [entry["name"] for entry in machine["parameters"]] == list(family.parameters)
    head = next(line for line in lines if line.startswith("parameter"))
    column = head.index("unit")
    for entry in machine["parameters"]:
        row = next(line for line in lines if line.split()[:1] == [entry["name"]])
        assert row[column:].startswith("" if entry["unit"] == "1" else entry["unit"])
    page, _, anchor = machine["page"].partition("#")
    assert f"\n({anchor})=\n" in (ROOT / page).read_text()
    assert (ROOT / machine["picture"]).is_file()


def test_a_machine_that_does_not_exist_is_refused_with_the_one_meant(refused):
    assert "did you mean 'impact_damper'?" in refused("models Impact-Damper")


def test_the_sides_of_a_machine_may_differ(run):
    one, other = (run(f"section --model impact_pair -p {side}_restitution=0.3")[1][0] for side in ("left", "right"))
    assert one != run("section --model impact_pair")[1][0]
    assert other


def test_the_numbers_of_many_stops_are_left_out_of_the_line_that_announces_a_model(run, tmp_path):
    content = "import vibroimpact as vi\nten = vi.models.tube_in_many_supports(supports=5)\n"
    (tmp_path / "supports.py").write_text(content, encoding="utf-8")
    told = run("section --model supports.py:ten --sample-impacts 20 --out hits.nc")[2]
    assert told[0] == "ImpactSystem: omega 100.531 rad/s, 10 stops"
