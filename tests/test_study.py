"""A study file is read whole, completed by the caller, and all its faults are told at once."""

from __future__ import annotations

import re

import numpy as np
import pytest

import vibroimpact as vi
from fenced import ROOT, blocks, table
from vibroimpact.cli.study import make_study, read_study
from vibroimpact.cli.study.tables import TABLES

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


@pytest.fixture
def write(tmp_path):
    def written(text: str):
        path = tmp_path / "study.toml"
        path.write_text(text)
        return path

    return written


def test_the_study_of_the_house_plan_is_understood(write):
    study = read_study(write(DESIGN))
    assert study.make_oscillator() == vi.ImpactOscillator()
    assert list(study.grid()) == ["omega", "mass"]
    np.testing.assert_array_equal(study.grid()["omega"], np.linspace(0.025, 5.0, 200))
    assert study.arguments("parameter_map") == {
        "transient_impacts": 100,
        "sample_impacts": 5000,
        "indices": ("std",),
        "backend": "cpu",
    }


def test_symbols_and_words_mean_the_same():
    words = {"mass": 2, "damping": 0.1, "stiffness": 3, "amplitude": 4, "omega": 5, "restitution": 0.6, "gap": 0.7}
    symbols = dict(zip("mckfwrg", words.values(), strict=True))
    assert make_study({"oscillator": symbols}).make_oscillator() == make_study({"oscillator": words}).make_oscillator()


def test_axes_keep_the_order_of_the_file_and_may_list_their_values():
    study = make_study({"axes": {"g": [-0.5, 0.0, 0.25], "w": {"from": 1, "to": 2, "points": 3}, "m": {"values": [1]}}})
    assert {name: values.tolist() for name, values in study.grid().items()} == {
        "gap": [-0.5, 0.0, 0.25],
        "omega": [1.0, 1.5, 2.0],
        "mass": [1.0],
    }
    assert list(study.grid()) == ["gap", "omega", "mass"]


def test_a_frequency_in_hz_stands_for_omega():
    assert make_study({"oscillator": {"frequency": 0.5}}).make_oscillator().omega == pytest.approx(np.pi)
    assert make_study({"axes": {"frequency": [0.5, 1.0]}}).grid()["frequency"].tolist() == [0.5, 1.0]


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
    result = getattr(vi, function)(study.make_oscillator(), **study.arguments(function), **axes)
    assert result.attrs["function"] == function


def test_values_of_the_caller_take_the_place_of_those_in_the_file(write):
    study = read_study(write(DESIGN), {"oscillator": {"m": 3.0}, "sampling": {"sample_impacts": 10}})
    assert study.make_oscillator().mass == 3.0
    assert study.arguments("parameter_map")["sample_impacts"] == 10
    assert study.arguments("parameter_map")["transient_impacts"] == 100


def test_axes_of_the_caller_replace_all_of_the_file(write):
    study = read_study(write(DESIGN), {"axes": {"gap": {"from": 0, "to": 1, "points": 2}}})
    assert list(study.grid()) == ["gap"]


def test_a_frequency_of_the_caller_takes_the_place_of_omega_in_the_file(write):
    study = read_study(write("[oscillator]\nw = 2.0\n"), {"oscillator": {"frequency": 0.5}})
    assert study.make_oscillator().frequency == pytest.approx(0.5)


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
        frequency = 1.0
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
    with pytest.raises(ValueError, match="study") as raised:
        read_study(path)
    first, *faults = str(raised.value).splitlines()
    assert first == f"`study` is {str(path)!r}, with {len(faults)} faults:"
    told = {re.match(r"`([^`]*)`", fault).group(1): fault for fault in faults}
    assert set(told) == {
        "colour", "oscillator.m", "oscillator.stifness", "oscillator.r", "oscillator.gap", "oscillator.frequency",
        "axes.w", "axes.k.from", "axes.k.to", "axes.k.upto", "axes.k.points", "axes.c", "axes.m",
        "sampling.sample_impacts", "sampling.phase", "start.displacement", "start.velocity", "tolerances.chatter",
        "run.indices", "run.backend", "run.workers", "run.direction", "run.early_closing",
    }  # fmt: skip
    assert "did you mean 'stiffness'?" in told["oscillator.stifness"]
    assert told["oscillator.m"].startswith("`oscillator.m` is -1; allowed is a finite number > 0;")
    assert all("allowed" in fault and fault.count(";") >= 2 for fault in faults)


@pytest.mark.parametrize(
    ("document", "words"),
    [
        ({"oscillator": {"m": 1, "mass": 2}}, "`m` is given twice"),
        ({"oscillator": {"mass": True}}, "`mass` is True"),
        ({"oscillator": {"mass": "1"}}, "`mass` is '1'"),
        ({"oscillator": {"omega": float("inf")}}, "`omega` is inf"),
        ({"oscillator": 3}, r"`oscillator` is 3; allowed is a table; write \[oscillator\]"),
        ({"axes": {"omega": 2.0}}, "`omega` is 2.0; allowed is { from, to, points } or a list"),
        ({"axes": {"phase": [1.0]}}, "`phase` is no such key"),
        ({"axes": {"omega": [1.0], "frequency": [1.0]}}, "`frequency` stands beside `omega`"),
        ({"axes": {"restitution": {"from": 0, "to": 1.5, "points": 3}}}, "`restitution.to` is 1.5; .* from 0 to 1"),
        ({"sampling": {"sample_impacts": 10.5}}, "`sample_impacts` is 10.5; allowed is a whole number"),
        ({"run": {"time_step": 0.001, "backend": "cpu"}}, "`time_step` is 0.001; allowed with backend 'fixed-step'"),
        ({"run": {"time_step": 0}}, "`time_step` is 0; allowed is a number > 0"),
        ({"run": {"indices": 3}}, "`indices` is 3"),
    ],
)
def test_a_wrong_value_is_told_with_name_value_allowed_and_remedy(document, words):
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
    with pytest.raises(ValueError, match="`study` is ") as raised:
        read_study(write(text))
    faults = str(raised.value).splitlines()[1:]
    assert len(faults) == 8
    assert all(re.search(r"` is '[^']+'; allowed .*; write numbers without quotes$", fault) for fault in faults), faults


def test_an_axis_of_one_point_needs_no_second_end():
    assert make_study({"axes": {"omega": {"from": 2, "to": 2, "points": 1}}}).grid()["omega"].tolist() == [2.0]
    with pytest.raises(
        ValueError, match=r"`omega.points` is 1 from 2 to 3; allowed are 2 points or more, .*; give more"
    ):
        make_study({"axes": {"omega": {"from": 2, "to": 3, "points": 1}}})


def test_an_axis_of_a_billion_points_is_refused_before_it_is_made(monkeypatch):
    monkeypatch.setattr("vibroimpact.cli.study.axis.np.linspace", pytest.fail)
    with pytest.raises(ValueError, match=r"`omega.points` is 1000000000; allowed are at most 10,000,000; take fewer"):
        make_study({"axes": {"omega": {"from": 2, "to": 3, "points": 10**9}}})


def test_every_key_of_a_study_file_is_on_the_page_of_the_command_line(write):
    page = ROOT / "docs" / "cli.md"
    rows = table(page, "| table | key")
    told = {name: {word for owner, words, *_ in rows if owner == name for word in words.split()} for name in TABLES}
    assert {owner for owner, *_ in rows} == set(TABLES)
    for name in set(TABLES) - {"axes"}:
        assert set(TABLES[name].model_fields) <= {word.strip(",") for word in told[name]}, name
    assert set(TABLES["oscillator"].model_fields) - set(TABLES["axes"].model_fields) == {"damping_ratio"}
    for text in blocks(page, "toml"):
        read_study(write(text))


def test_what_is_no_toml_or_cannot_be_read_is_told(write, tmp_path):
    with pytest.raises(ValueError, match=r"`study` is .*which is no TOML: .*end of document"):
        read_study(write("[oscillator"))
    with pytest.raises(FileNotFoundError, match=r"`study` is .*none\.toml.*cannot be read"):
        read_study(tmp_path / "none.toml")
