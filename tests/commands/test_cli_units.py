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
from vibroimpact.report import sentences_of

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


def test_zero_needs_no_unit(run):
    assert "gap -1 to 0 mm" in "\n".join(run("map --x gap=-1mm:0:2 --sample-impacts 5")[1])


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
    ("command", "words"),
    [
        ("map --x gap=1mm:1:5", "`gap` must have a unit at its second end, got 1mm to 1; write 1mm, or 1m"),
        ("map --x w=1Hz:20:5", "`w` must have a unit at its second end, got 1Hz to 20; write 20Hz, or 20rad/s"),
        ("map --x omega=2:3:2 --x gap=0:1:2", "`--x` takes one parameter, got omega and gap"),
        ("diagram --x omega=2:3:2 --x gap=0:1:2", "`--x` takes one parameter, got omega and gap"),
        ("map --x omega=2:3:2 --y gap=0:1:2 --y m=1:2:2", "`--y` takes one parameter, got gap and m"),
        ("continue -p w=2.5 --x w=2:3 --x gap=0:1", "`--x` takes one parameter, got w and gap"),
        ("basins --x phase=0:1:3 --x velocity=0:1:3", "`--x` takes one parameter, got phase and velocity"),
        ("section -p gap=3s", "`gap` must be a number, or one with a unit that can be turned into m, got '3s'"),
        ("section -p omega=3furlong", "turned into rad/s"),
        ("section -p restitution=2mm", "without a unit, or in %"),
    ],
)
def test_a_wrong_unit_or_range_is_refused_in_a_line(refused, command, words):
    assert words in refused(command)


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


SWEEPS = [
    ("map --x omega=0.3Hz:0.5Hz:5 --sample-impacts 50", "driving frequency 0.3 to 0.5 Hz", "largest at omega = 0.4"),
    ("map --x gap=1mm:3mm:5 --sample-impacts 50", "gap 1 to 3 mm", r"largest at gap = [\d.]+ mm"),
    ("map --x omega=24rpm:30rpm:3 --y gap=1:3mm:4 --refine 1", "frequency 24 to 30 rpm; gap 1 to 3 mm", " rpm, gap"),
    ("diagram --x omega=0.3Hz:0.5Hz:5", "of driving frequency 0.3 to 0.5 Hz", r"hardest impact .* at omega 0\.3 Hz"),
    ("diagram --x gap=1mm:3mm:5 --direction up", "of gap 1 to 3 mm", r"  gap [\d.]+( to 3)? mm: "),
    ("continue -p omega=0.41Hz --x omega=0.3Hz:0.5Hz", r"from omega = 0\.3 Hz", r"doubling at omega = 0\.4223\d* Hz"),
    ("response -p c=0.1 -p gap=1500mm --x omega=0.1Hz:0.5Hz --step 0.05", "along omega from 0.1 to 0.5 Hz",
     r"fold at omega = 0\.2626\d* Hz"),
    ("boundary --x omega=0.3Hz:0.5Hz --y gap=0mm:300mm --periods 1 --lines 2",
     r"driving frequency 0\.3297 to 0\.4224 Hz, gap 0 to 300 mm", "grazing .* mm "),
]  # fmt: skip


@pytest.mark.parametrize(("command", "first", "second"), SWEEPS)
def test_a_sweep_answers_and_is_saved_in_the_unit_that_was_typed(run, command, first, second):
    code, lines, _ = run(command)
    assert code == 0
    text = "\n".join(lines)
    assert re.search(first, text)
    assert re.search(second, text)
    assert not re.search(r"rad/s|gap [-.\d to]+ m\b|angular", text)
    ending = "zarr" if command.startswith("map") else "nc"
    assert run(f"{command} --out a.{ending}")[0] == 0
    saved = vi.load(f"a.{ending}")
    for name, si, unit in (("omega", "rad/s", "Hz|rpm"), ("gap", "m", "mm")):
        if name in saved.coords:
            assert saved[name].attrs["units"] == si
            assert re.fullmatch(unit, saved[name].attrs["display_units"])
    assert [line for line in lines if "computed in" not in line] == run(f"plot a.{ending}")[1]


def test_a_stored_map_is_told_in_the_unit_that_was_typed(run):
    run("map --x omega=0.3Hz:0.5Hz:5 --y gap=1mm:3mm:4 --sample-impacts 50 --out m.zarr")
    assert "over omega 0.3 to 0.5 Hz in 5 and gap 1 to 3 mm in 4" in run("info m.zarr")[1][0]
    assert vi.load("m.zarr")["gap"].values == pytest.approx([1e-3, 5e-3 / 3, 7e-3 / 3, 3e-3])


def test_a_range_beside_the_orbit_is_refused_in_the_unit_that_was_typed(refused):
    words = "`omega` must have a range that contains 0.41 Hz, where the orbit is searched for, got 0.5 Hz to 0.6 Hz"
    assert words in refused("continue -p omega=0.41Hz --x omega=0.5Hz:0.6Hz")


def test_a_quantity_of_pint_is_an_axis_in_its_unit():
    pint = pytest.importorskip("pint")
    of = pint.UnitRegistry().Quantity
    design = vi.ImpactOscillator()
    sweep = vi.parameter_map(design, gap=of(np.array([1.0, 2.0, 3.0]), "mm"), sample_impacts=50)
    assert sweep["gap"].values == pytest.approx([1e-3, 2e-3, 3e-3], rel=1e-15)
    assert any("gap 1 to 3 mm" in line for line in sentences_of(sweep))
    turning = vi.bifurcation_diagram(design, omega=of([20.0, 30.0], "rpm"), sample_impacts=50)
    assert turning["omega"].values == pytest.approx([2.0 * np.pi / 3.0, np.pi], rel=1e-15)
    ax = vi.plotting.bifurcation_diagram(turning)
    assert ax.get_xlabel() == r"driving frequency $\omega/2\pi$ [rpm]"
    assert turning["omega"].values[0] < ax.get_xlim()[1] < 1.1 * np.pi  # the data stay in rad/s
    ticks = [float(text) for text in ax.xaxis.major.formatter.format_ticks(ax.get_xticks())]
    assert ticks == pytest.approx(30.0 / np.pi * np.array(ax.get_xticks()))
    assert all(tick == round(tick) for tick in ticks)
    table = vi.parameter_map(design, points={"omega": of([0.3, 0.4], "Hz"), "mass": [1.0, 2.0]}, sample_impacts=50)
    assert table["omega"].values == pytest.approx([0.6 * np.pi, 0.8 * np.pi])
    with pytest.raises(ValueError, match="`gap` must be a quantity that can be turned into m"):
        vi.parameter_map(design, gap=of([1.0, 2.0], "s"))
    with pytest.raises(ValueError, match="`gap` must be a finite number"):
        design.replace(gap=of(1.0, "mm"))
    curve = vi.response_curve(vi.ImpactOscillator(damping=0.1, gap=1.5), omega=(of(0.2, "Hz"), of(0.3, "Hz")), step=0.1)
    assert curve.dataset["omega"].values[[0, -1]].max() <= 0.6 * np.pi


def test_quantities_of_pint_as_ranges_are_the_units_of_tables_and_figures(tmp_path):
    of = pytest.importorskip("pint").UnitRegistry().Quantity
    design = vi.ImpactOscillator(omega=2.6)
    hertz, gaps = (of(0.38, "Hz"), of(0.44, "Hz")), of([-300.0, 300.0], "mm")
    branch = vi.continue_orbit(vi.find_orbit(design)[0], "omega", hertz, step=0.05)
    (point,) = branch.special
    plain = vi.continue_orbit(vi.find_orbit(design)[0], "omega", (0.76 * np.pi, 0.88 * np.pi), step=0.05)
    assert point.value == pytest.approx(plain.special[0].value, rel=1e-9)  # the numbers stay in rad/s
    assert vi.plotting.branch_diagram(branch).get_xlabel() == r"driving frequency $\omega/2\pi$ [Hz]"
    in_hertz = f"{point.value / (2.0 * np.pi):.4g}"
    html = branch._repr_html_()
    assert all(text in html for text in ("omega [Hz]", in_hertz))
    assert "rad/s" not in html
    assert any("period doubling at omega = 0.42238" in line and " Hz" in line for line in sentences_of(branch.dataset))
    vi.save(branch, tmp_path / "branch.nc")
    assert vi.load(tmp_path / "branch.nc") == branch
    plane = ("omega", "gap"), (hertz, gaps)
    curves = [vi.continuation.continue_boundary(point, *plane, step=0.1)]
    curves += vi.boundary_curves(design, *plane, n_periods=(1,), lines=2, kinds=("period_doubling",))
    for curve in curves:
        rows = {name: (low, high) for name, low, high in curve._table().rows}
        assert set(rows) == {"omega [Hz]", "gap [mm]"}
        assert rows["omega [Hz]"][1] == pytest.approx(curve.values[:, 0].max() / (2.0 * np.pi))
        assert rows["gap [mm]"][1] == pytest.approx(1e3 * curve.values[:, 1].max())
        ax = vi.plotting.boundaries(curve)
        assert (ax.get_xlabel().endswith("[Hz]"), ax.get_ylabel()) == (True, "gap $g$ [mm]")
    response = vi.response_curve(design.replace(damping=0.1), gap=of([1.0, 200.0], "cm"), step=0.1)
    assert vi.plotting.response_curve(response).get_xlabel() == "gap $g$ [cm]"
    assert response._table().head[2:] == ("from [cm]", "to [cm]")
    assert response._table().rows[0][2:] == pytest.approx([1.0, 100.0 * response.steady[0][0]])
    assert "gap from 1 to 200 cm" in response._table().notes[1]
    found = vi.basins(design, phase=[0.0, 0.5], velocity=of([100.0, 2000.0], "mm/s"))
    assert vi.plotting.basin_portrait(found).get_ylabel() == "impact velocity $I$ [mm/s]"
    assert "velocity 100 to 2000 mm/s" in sentences_of(found)[0]
    with pytest.raises(ValueError, match="contains the orbit's omega = 2.6 rad/s, got .*hertz"):
        vi.continue_orbit(vi.find_orbit(design)[0], "omega", (of(1.0, "Hz"), of(2.0, "Hz")))


def test_info_lists_fixed_parameters_with_their_units(run, tmp_path):
    short = "--sample-impacts 50 --out"
    run(f"map -p gap=0.5mm -p damping_ratio=2% --x omega=2:3:3 {short} one.zarr")
    fixed = run("info one.zarr")[1][1]
    assert "mass 1 kg, damping 0.04 N s/m, stiffness 1 N/m, amplitude 1 N, restitution 0.8, gap 0.0005 m" in fixed
    run(f"map --model impact_damper --x frequency=25:30:3 {short} damper.zarr")
    assert re.search(r"clearance [\d.e-]+ m\b", run("info damper.zarr")[1][1])
    slot = [vi.Stop(direction=side, gap=0.2, stiffness=50.0, name=name) for side, name in ((1, "up"), (-1, "down"))]
    load = vi.Force(omega=2.0, harmonics={1: 1.0})
    model = vi.ImpactSystem(mass=1.0, damping=0.1, stiffness=1.0, force=load, stops=slot)
    vi.parameter_map(model, up_gap=[0.1, 0.2], sample_impacts=20, store=tmp_path / "slot.zarr")
    fixed = run("info slot.zarr")[1][1]
    assert "omega 2 rad/s, up_stiffness 50 N/m, up_damping 0 N s/m, down_gap 0.2 m" in fixed


def test_curves_lie_on_a_map_whose_axes_are_in_other_units(run):
    run("map --x omega=0.3Hz:0.5Hz:5 --y gap=0:300mm:4 --sample-impacts 50 --out m.zarr")
    curves = vi.boundary_curves(
        vi.ImpactOscillator(), ("gap", "omega"), ((0.0, 0.3), (2.0, 3.0)), n_periods=(1,), lines=2
    )
    sweep = vi.load("m.zarr")
    ax = vi.plotting.index_contour(sweep)
    over = vi.plotting.boundaries(curves, ax=ax)
    assert over.get_xlabel() == r"driving frequency $\omega/2\pi$ [Hz]"
    assert over.get_ylabel() == "gap $g$ [mm]"
    names = ("omega", "gap")
    drawn = [line.get_xydata() for line in over.lines if len(line.get_xydata()) > 9]
    for curve in curves:
        expected = np.column_stack([curve.dataset[name].values for name in names])
        assert any(len(line) == len(expected) and np.allclose(line, expected) for line in drawn)


def test_the_line_of_the_model_is_named_in_the_unit_of_its_axis(run):
    run("map -p gap=2mm -p omega=0.4Hz --x omega=0.3Hz:0.5Hz:5 --y gap=1mm:3mm:4 --sample-impacts 50 --out m.zarr")
    sweep = vi.load("m.zarr")
    ax = vi.plotting.index_contour(sweep, reference={"gap": 2e-3, "omega": 0.8 * np.pi})
    assert {r"$g$ = 2 mm", r"$\omega/2\pi$ = 0.4 Hz"} <= {text.get_text() for text in ax.texts}


@pytest.mark.parametrize("unit", ["furlong", "", "\x1b[2J"])
def test_an_unknown_unit_in_a_file_leaves_the_own_one(unit):
    label = {"long_name": "gap", "units": "m", "symbol": "g"}
    assert units.display(label | {units.DISPLAY: unit})[1]["units"] in ("m", "furlong")


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
