"""Values with units on the command line and in study files, and what follows from other options."""

import json
import re
import shlex
import sys
import tomllib

import numpy as np
import pytest

import vibroimpact as vi
from fenced import ROOT
from processes import python
from vibroimpact.cli.study import make_study
from vibroimpact.model import units
from vibroimpact.model.units import without_unit
from vibroimpact.parameters import to_install

OF = vi.ImpactOscillator.parameters


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("omega", "1500rpm", 50.0 * np.pi),
        ("omega", "25 Hz", 50.0 * np.pi),
        ("omega", "25 rad/s", 25.0),
        ("frequency", "1500rpm", 25.0),
        ("gap", "-0.5mm", -0.5e-3),
        ("gap", "1e-3km", 1.0),
        ("mass", "2.1 kg", 2.1),
        ("stiffness", "3 kN/mm", 3e6),
        ("damping", "5 N s/m", 5.0),
        ("restitution", "80%", 0.8),
        ("damping_ratio", "2 %", 0.02),
    ],
)
def test_a_value_may_have_a_unit(name, text, value):
    assert without_unit(OF[name], text) == pytest.approx(value, rel=1e-15)
    model = make_study({"oscillator": {name: text}}).model
    assert getattr(model, name) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    ("axis", "words"),
    [
        ("gap=1mm:1:5", "`gap` must have a unit at its second end, got 1mm to 1; write 1mm, or 1m"),
        ("w=1Hz:20:5", "`w` must have a unit at its second end, got 1Hz to 20; write 20Hz, or 20rad/s"),
    ],
)
def test_a_range_with_a_unit_at_its_first_end_alone_is_refused(refused, axis, words):
    assert words in refused(f"map --x {axis}")


def test_zero_needs_no_unit(run):
    assert "gap -0.001 to 0 m" in "\n".join(run("map --x gap=-1mm:0:2 --sample-impacts 5")[1])


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("map --x omega=2:3:2 --x gap=0:1:2", "`--x` takes one parameter, got omega and gap"),
        ("diagram --x omega=2:3:2 --x gap=0:1:2", "`--x` takes one parameter, got omega and gap"),
        ("map --x omega=2:3:2 --y gap=0:1:2 --y m=1:2:2", "`--y` takes one parameter, got gap and m"),
        ("continue -p w=2.5 --x w=2:3 --x gap=0:1", "`--x` takes one parameter, got w and gap"),
        ("basins --x phase=0:1:3 --x velocity=0:1:3", "`--x` takes one parameter, got phase and velocity"),
    ],
)
def test_two_parameters_for_one_axis_are_refused(refused, command, words):
    assert words in refused(command)


@pytest.mark.parametrize(
    ("unit", "text", "value"),
    [("1/min", "25 Hz", 1500.0), ("1/min", "1500rpm", 1500.0), ("rpm", "25Hz", 1500.0), ("1/s", "1500 rpm", 25.0),
     ("N/m2", "200GPa", 200e9), ("m/s2", "2 m/s2", 2.0), ("mm", "0.5e-3m", 0.5)],
)  # fmt: skip
def test_a_family_counts_turns_and_powers_as_machines_do(unit, text, value):
    assert without_unit(vi.parameters.Parameter("rate", "rate", unit), text) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize("plain", ["2", "1e-3", "-.5", "abc", "", "nan", 0.5, None])
def test_what_has_no_unit_stays_as_it_is(plain):
    assert without_unit(OF["gap"], plain) == plain


def test_the_first_end_of_a_range_is_in_the_unit_of_the_second():
    axes = make_study({"axes": {"gap": {"from": 0.5, "to": "2mm", "points": 4}}}).axes
    assert axes["gap"] == pytest.approx([0.5e-3, 1e-3, 1.5e-3, 2e-3])
    axes = make_study({"axes": {"omega": {"from": "600rpm", "to": "20Hz", "points": 2}}}).axes
    assert axes["omega"] == pytest.approx([20.0 * np.pi, 40.0 * np.pi])


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("gap=3s", "`gap` must be a number, or one with a unit that can be turned into m, got '3s'"),
        ("omega=3furlong", "turned into rad/s"),
        ("restitution=2mm", "without a unit, or in %"),
    ],
)
def test_a_unit_of_something_else_is_refused_in_a_line(refused, value, words):
    assert words in refused(f"section -p {value}")


def test_pint_is_imported_only_where_a_unit_is_written():
    code = (
        "import sys; from vibroimpact.cli.study import make_study; make_study({'oscillator': {'gap': GAP}}); "
        "print('pint' in sys.modules)"
    )
    for gap, imported in (("0.5", "False"), ("'5mm'", "True")):
        assert python(code.replace("GAP", gap)).stdout.strip() == imported


def test_a_frequency_and_a_damping_ratio_are_axes(run):
    assert run("map --x frequency=24:30rpm:2 --y damping_ratio=1%:2%:2 --sample-impacts 20 -o a.nc")[0] == 0
    sweep = vi.load("a.nc")
    assert sweep["frequency"].values == pytest.approx([0.4, 0.5])
    assert sweep["damping_ratio"].values == pytest.approx([0.01, 0.02])


def test_the_index_of_a_figure_is_computed(run, tmp_path):
    for command in ("map --x w=2:3:4 --index lyapunov", "diagram --x w=2:3:4 --index max_velocity"):
        assert run(f"{command} --sample-impacts 50 -o a.png --overwrite")[0] == 0
    assert run("map --x w=2:3:4 --indices std --index lyapunov --sample-impacts 50 -o a.nc")[0] == 0
    assert {"std", "lyapunov"} <= set(vi.load("a.nc"))


def test_the_last_of_repeated_values_wins(run, tmp_path):
    assert run("section -p w=0.7 -p omega=2 -p w=0.9 --sample-impacts 10 --sample-impacts 20 -o a.nc")[0] == 0
    section = vi.load("a.nc")
    assert json.loads(section.attrs["oscillator"])["omega"] == 0.9
    assert section.sizes["impact"] == 20


def test_the_first_line_says_which_model_and_numbers_were_used(run):
    paper = "ImpactOscillator: mass 1 kg, damping 0.01 N s/m, stiffness 1 N/m, amplitude 1 N"
    typed = run("section -p gap=5mm -p r=0.5 --sample-impacts 20")[2][0]
    assert typed == f"{paper}, omega 2 rad/s, restitution 0.5, gap 5 mm"
    swept = run("diagram --x frequency=0.2:0.3:4 --sample-impacts 20")[2][0]
    assert swept == f"{paper}, restitution 0.8, gap 0 m, frequency 0.2 to 0.3 Hz"
    slot = run("section --model impact_damper -p force=40 --sample-impacts 20")[2][0]
    assert slot.startswith("impact_damper: mass 10 kg, natural_frequency 30 Hz, damping_ratio 0.01, force 40 N, ")


@pytest.mark.parametrize(
    ("command", "names"),
    [
        ("section -p m=2 -p k=3000 -p w=30", "damping = 0.01 N s/m, amplitude = 1 N"),
        ("section -p gap=0.5mm -p m=2 -p zeta=1% -p k=3000 -p f=3", "omega = 2 rad/s"),
        ("section -p m=2 -p k=3000 -p w=30 -p c=1 -p f=2", None),
        ("section -p m=2", None),
        ("section --model two_sided_oscillator", None),
    ],
)
def test_numbers_of_the_paper_beside_ones_in_si_are_warned_of(run, command, names):
    code, _, complaints = run(f"{command} --sample-impacts 20")
    assert code == 0
    assert complaints[1:] == ([f"vibroimpact: not given, so the paper's values are used: {names}"] if names else [])


def test_without_pint_a_unit_is_refused_with_what_installs_it(refused, monkeypatch):
    monkeypatch.setitem(sys.modules, "pint", None)
    units._registry.cache_clear()
    assert "values with units need pint, which is missing; `pip install pint` installs it" in refused(
        "section -p gap=0.5mm"
    )


@pytest.mark.parametrize("extra", ["web", "cluster", "cuda", "units"])
def test_what_installs_an_extra_is_named_by_its_packages_for_this_one_is_on_no_index(extra):
    command = to_install(extra)
    assert command.startswith("`pip install ")
    named = {re.split(r"[\[<>=]", word)[0] for word in shlex.split(command.strip("`"))[2:]}
    listed = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"][extra]
    assert named == {re.split(r"[\[<>=]", entry)[0] for entry in listed}


@pytest.mark.parametrize(
    ("typed", "driving"),
    [("frequency=25", "frequency 25 Hz"), ("frequency=1500rpm", "frequency 1500 rpm"), ("w=25Hz", "omega 25 Hz")],
)
def test_answers_are_in_the_parameter_and_unit_that_were_typed(run, tmp_path, typed, driving):
    design = "-p m=1.2 -p k=26860 -p c=8 -p amplitude=100N -p gap=0.5mm"
    code, lines, said = run(f"describe {design} -p {typed} --vary omega,gap --full")
    verdict = "\n".join(lines)
    assert code == 0
    assert driving in said[0]
    assert "gap 0.5 mm" in said[0]
    assert f"{driving}, restitution 0.8, gap 0.5 mm" in " ".join(verdict.split())
    name, value, unit = driving.split()
    assert re.search(rf"^  {name} \[{unit}\] ", verdict, re.MULTILINE)
    assert re.search(r"^  gap \[mm\] ", verdict, re.MULTILINE)
    (text,) = re.findall(rf"lower {name} by 2.8 % to (\S+) {unit}: ", " ".join(verdict.split()))
    assert float(text) == pytest.approx(float(value) * (1 - 0.028), rel=1e-5)
    assert "rad/s" not in verdict + said[0]
    short = " ".join(" ".join(run(f"describe {design} -p {typed} --vary omega")[1]).split())
    assert f"lower {name} by 2.8 % to {text} {unit}: " in short


def test_a_machine_is_answered_in_the_unit_that_was_typed(run):
    code, lines, said = run("describe --model unbalanced_machine -p rpm=20Hz -p gap=1mm --vary rpm --full")
    verdict = " ".join(" ".join(lines).split())
    assert code == 0
    assert "rpm 20 Hz, gap 1 mm" in said[0]
    assert "rpm 20 Hz, gap 1 mm" in verdict
    assert re.search(r"parameter down to .* rpm \[Hz\] 11\.2", verdict)
    assert re.search(r"lower rpm by [\d.]+ % to 18\.\d+ Hz: ", verdict)


def test_axes_are_announced_in_the_unit_that_was_typed(run):
    said = run("map --x frequency=24:30rpm:2 --y gap=0.1:0.2mm:2 -p zeta=2% --sample-impacts 20")[2][0]
    assert said.endswith("frequency 24 to 30 rpm, gap 0.1 to 0.2 mm")
    assert "damping_ratio 2 %" in said
    assert "omega" not in said


def test_a_branch_is_listed_in_the_unit_of_its_range(run, tmp_path):
    _, lines, _ = run("continue -p omega=0.41Hz --x omega=0.40:0.45Hz --step 0.1")
    text = "\n".join(lines)
    assert "from omega = 0.4 Hz, at the end of the range, to omega = 0.45 Hz" in text
    assert re.search(r"stable for omega 0\.4 to 0\.4223\d* Hz", text)
    assert re.search(r"period doubling at omega = 0\.4223\d* Hz, hits at 0\.448", text)
    run(f"continue -p omega=0.41Hz --x omega=0.40:0.45Hz --step 0.1 --out {tmp_path / 'branch.nc'}")
    saved = vi.load(tmp_path / "branch.nc")["omega"]
    assert float(saved.max()) == pytest.approx(0.9 * np.pi, rel=1e-12)  # files are in SI units
    assert saved.attrs["units"] == "rad/s"


def test_two_designs_are_compared_in_the_units_of_their_files(run, tmp_path):
    for name, frequency in (("old", 25), ("new", 20)):
        lines = f'[oscillator]\nmass = 1.2\nstiffness = 26860\nfrequency = {frequency}\ngap = "0.5mm"\n'
        (tmp_path / f"{name}.toml").write_text(lines)
    rows = run("compare old.toml new.toml --vary omega,gap")[1]
    assert any(re.match(r"driving frequency \[Hz\] \* +25 +20$", row) for row in rows)
    assert any(re.match(r"gap \[mm\] +0.5 +0.5$", row) for row in rows)
    for label in ("frequency [Hz], down to", "gap [mm], up to"):
        assert any(row.startswith(label) for row in rows)
    assert "rad/s" not in "".join(rows)


def test_a_percentage_is_no_sign_of_si_units(run):
    assert len(run("section -p restitution=80% --sample-impacts 50")[2]) == 1
