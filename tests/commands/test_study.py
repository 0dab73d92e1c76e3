"""A study file is read whole, completed by the caller, and all its faults are told at once."""

from __future__ import annotations

import re

import numpy as np
import pytest

import vibroimpact as vi
from fenced import ROOT, blocks, table
from vibroimpact.cli.endings import WrongRequest
from vibroimpact.cli.options import Options
from vibroimpact.cli.schema import PARAMETERS, SAMPLE_IMPACTS, STUDY, TABLES, X
from vibroimpact.cli.study import make_study, study_of

DESIGN = """
[oscillator]
mass = 1.0
damping = 0.01
restitution = 0.8
[axes]
omega = { from = 0.025, to = 5.0, points = 200 }
mass = { from = 0.1, to = 5.0, points = 200 }
[sampling]
transient_impacts = 100
sample_impacts = 5000
[run]
indices = ["std"]
backend = "cpu"
"""


def read_study(path, **typed):
    """Return the request of a file and of options as typed."""
    return study_of(Options((STUDY, PARAMETERS, X, SAMPLE_IMPACTS), {"study": path, **typed}))


@pytest.fixture
def write(tmp_path):
    def written(text: str):
        path = tmp_path / "study.toml"
        path.write_text(text)
        return path

    return written


def test_the_study_of_the_house_plan_is_understood(write):
    study = read_study(write(DESIGN))
    assert study.model == vi.ImpactOscillator()
    assert list(study.axes) == ["omega", "mass"]
    np.testing.assert_array_equal(study.axes["omega"], np.linspace(0.025, 5.0, 200))
    assert study.arguments("parameter_map") == {
        "transient_impacts": 100,
        "sample_impacts": 5000,
        "indices": ("std",),
        "backend": "cpu",
    }


def test_symbols_and_words_mean_the_same():
    words = {"mass": 2, "damping": 0.1, "stiffness": 3, "amplitude": 4, "omega": 5, "restitution": 0.6, "gap": 0.7}
    symbols = dict(zip("mckfwrg", words.values(), strict=True))
    assert make_study({"oscillator": symbols}).model == make_study({"oscillator": words}).model


def test_axes_keep_the_order_of_the_file_and_may_list_their_values():
    study = make_study({"axes": {"g": [-0.5, 0.0, 0.25], "w": {"from": 1, "to": 2, "points": 3}, "m": {"values": [1]}}})
    assert {name: values.tolist() for name, values in study.axes.items()} == {
        "gap": [-0.5, 0.0, 0.25],
        "omega": [1.0, 1.5, 2.0],
        "mass": [1.0],
    }
    assert list(study.axes) == ["gap", "omega", "mass"]


def test_a_frequency_in_hz_stands_for_omega():
    assert make_study({"oscillator": {"frequency": 0.5}}).model.omega == pytest.approx(np.pi)
    assert make_study({"axes": {"frequency": [0.5, 1.0]}}).axes["frequency"].tolist() == [0.5, 1.0]


def test_start_and_tolerances_become_the_objects_the_functions_take():
    study = make_study({"start": {"displacement": -1, "time": 2}, "tolerances": {"chatter": 1e-6}})
    assert study.arguments("simulate") == {
        "start": vi.State(-1.0, 0.0, 2.0),
        "tolerances": vi.Tolerances(chatter=1e-6),
    }


@pytest.mark.parametrize("function", ["simulate", "impact_section", "stroboscopic_section", "bifurcation_diagram"])
def test_each_function_is_given_only_what_it_takes(function):
    everything = {
        "sampling": {
            "transient_impacts": 1, "sample_impacts": 12, "transient_periods": 1, "sample_periods": 12,
            "phase": 0.25, "periods": 3, "samples_per_period": 4,
        },
        "start": {"displacement": -1.0},
        "tolerances": {"steps_per_impact": 2000},
        "run": {"backend": "cpu", "workers": 1, "indices": ["std"], "early_closing": False},
    }  # fmt: skip
    study = make_study(everything)
    axes = {"omega": [2.0, 2.1]} if function == "bifurcation_diagram" else {}
    result = getattr(vi, function)(study.model, **study.arguments(function), **axes)
    assert result.attrs["function"] == function


def test_values_of_the_caller_take_the_place_of_those_in_the_file(write):
    study = read_study(write(DESIGN), parameter=["m=3.0"], sample_impacts="10")
    assert study.model.mass == 3.0
    assert study.arguments("parameter_map")["sample_impacts"] == 10
    assert study.arguments("parameter_map")["transient_impacts"] == 100


def test_axes_of_the_caller_replace_all_of_the_file(write):
    study = read_study(write(DESIGN), x=["gap=0:1:2"])
    assert list(study.axes) == ["gap"]


def test_of_a_parameter_typed_twice_the_last_one_wins():
    study = read_study(None, parameter=["m=1", "zeta=0.1", "mass=2", "m=3"])
    assert (study.model.mass, study.model.damping_ratio) == (3.0, pytest.approx(0.1))
    with pytest.raises(WrongRequest, match="give either `omega` or `frequency`, not both"):
        read_study(None, parameter=["w=1", "frequency=2"])


def test_a_frequency_of_the_caller_takes_the_place_of_omega_in_the_file(write):
    study = read_study(write("[oscillator]\nw = 2.0\n"), parameter=["frequency=0.5"])
    assert study.model.frequency == pytest.approx(0.5)


def test_all_faults_of_a_file_are_told_at_once_a_line_each(write):
    path = write(
        """
        colour = "blue"
        [oscillator]
        m = -1
        stifness = 2.0
        r = 1.5
        gap = nan
        omega = 2.0
        [axes]
        w = { from = 2.0, to = 1.0, points = 5 }
        k = { from = 0, upto = 1.0, points = 0 }
        c = []
        m = [2.0, 1.0]
        [sampling]
        sample_impacts = 0
        phase = 1.0
        [start]
        velocity = "fast"
        [tolerances]
        chatter = 1.0
        [run]
        indices = ["stt"]
        backend = "gpu"
        workers = 0
        direction = "left"
        early_closing = "perhaps"
        """
    )
    with pytest.raises(WrongRequest, match="study") as raised:
        read_study(path)
    first, *faults = str(raised.value).splitlines()
    assert first == f"`study` {str(path)!r} has {len(faults)} errors:"
    for key in (
        "'colour'", "`oscillator.m`", "'stifness'", "`oscillator.r`", "`oscillator.gap`", "`axes.w`", "`axes.k.from`",
        "`axes.k.to`", "'upto'", "`axes.k.points`", "`axes.c`", "`axes.m`", "`sampling.sample_impacts`",
        "`sampling.phase`", "`displacement`", "`start.velocity`", "`tolerances.chatter`", "'stt'", "`run.backend`",
        "`run.workers`", "`run.direction`", "`run.early_closing`",
    ):  # fmt: skip
        assert sum(key in fault.split("choose from")[0] for fault in faults) == 1, (key, faults)
    assert len(faults) == 22
    assert any("did you mean 'stiffness'?" in fault for fault in faults)
    assert any(fault.startswith("`oscillator.m` must be a finite number > 0, got -1;") for fault in faults)
    assert all(any(word in fault for word in ("must", "choose from", "missing", "allowed")) for fault in faults), faults


@pytest.mark.parametrize(
    ("document", "words"),
    [
        ({"oscillator": {"m": 1, "mass": 2}}, "give either `m` or `mass`, not both"),
        ({"oscillator": {"omega": 1, "frequency": 2}}, "give either `omega` or `frequency`, not both"),
        ({"oscillator": {"mass": True}}, "`mass` must be a finite number > 0, got True"),
        ({"oscillator": {"mass": "1"}}, "`mass` must be .*, got '1'"),
        ({"oscillator": {"omega": float("inf")}}, "`omega` must be .*, got inf"),
        ({"oscillator": 3}, r"`oscillator` must be a table, got 3; write \[oscillator\]"),
        ({"axes": {"omega": 2.0}}, "`omega` must be a list of values or { from, to, points }, got 2.0"),
        ({"axes": {"phase": [1.0]}}, "unknown parameter 'phase'"),
        ({"axes": {"omega": [1.0], "w": [1.0]}}, "give either `omega` or `w`, not both"),
        ({"axes": {"restitution": {"from": 0, "to": 1.5, "points": 3}}}, "`restitution.to` must be .*, got 1.5"),
        ({"sampling": {"sample_impacts": 10.5}}, "`sample_impacts` must be a whole number >= 1, got 10.5"),
        ({"run": {"time_step": 0}}, "`time_step` must be a finite number > 0, got 0"),
        ({"run": {"indices": 3}}, "`indices` must be a list of names .*, got 3"),
        ({"run": {"early_closing": 1}}, "`early_closing` must be true or false, got 1"),
    ],
)
def test_a_wrong_value_is_refused_with_its_name_and_what_is_allowed(document, words):
    with pytest.raises(ValueError, match=f"^{words}"):
        make_study(document)


def test_numbers_in_quotes_are_answered_with_their_quotes(write):
    text = """
    [oscillator]
    mass = "0.5"
    [axes]
    omega = { from = "1", to = 2.0, points = "3" }
    gap = ["0.0", 1.0]
    [sampling]
    sample_impacts = "500"
    phase = "0.5"
    [start]
    displacement = "-1"
    [tolerances]
    chatter = "1e-6"
    """
    with pytest.raises(WrongRequest, match="`study` ") as raised:
        read_study(write(text))
    faults = str(raised.value).splitlines()[1:]
    assert len(faults) == 8
    assert all(re.search(r"` must be .*, got '[^']+'; write numbers without quotes$", fault) for fault in faults), (
        faults
    )


def test_an_axis_of_one_point_needs_no_second_end():
    assert make_study({"axes": {"omega": {"from": 2, "to": 2, "points": 1}}}).axes["omega"].tolist() == [2.0]
    with pytest.raises(ValueError, match=r"`omega.points` must be at least 2 from 2 to 3, got 1"):
        make_study({"axes": {"omega": {"from": 2, "to": 3, "points": 1}}})


def test_an_axis_of_a_billion_points_is_refused_before_it_is_made(monkeypatch):
    monkeypatch.setattr("numpy.linspace", pytest.fail)
    with pytest.raises(ValueError, match="`omega.points` must be at most 10,000,000, got 1000000000"):
        make_study({"axes": {"omega": {"from": 2, "to": 3, "points": 10**9}}})


def test_every_key_of_a_study_file_is_on_the_page_of_the_command_line(write):
    page = ROOT / "docs" / "reference" / "cli.md"
    keys = {name: set(checks) for name, checks in TABLES.items()} | {"oscillator": set(vi.ImpactOscillator.parameters)}
    rows = table(page, "| table | key")
    documented = {name: {word for owner, words, *_ in rows if owner == name for word in words.split()} for name in keys}
    assert {owner for owner, *_ in rows} - {"axes"} == set(keys)
    for name in keys:
        assert keys[name] <= {word.strip(",") for word in documented[name]}, name
    for text in blocks(page, "toml"):
        read_study(write(text))


def test_invalid_toml_and_a_missing_file_are_refused(write, tmp_path):
    with pytest.raises(WrongRequest, match=r"`study` .* is invalid TOML: .*end of document"):
        read_study(write("[oscillator"))
    with pytest.raises(WrongRequest, match=r"`study` .*none\.toml.* cannot be read"):
        read_study(tmp_path / "none.toml")
