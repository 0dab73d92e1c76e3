"""A wrong request is refused with the argument, the value, what is allowed, and what to do."""

import importlib
import inspect
import math
import os
import re
from fractions import Fraction
from functools import partial

import numpy as np
import pytest

import vibroimpact as vi
from fenced import ROOT
from vibroimpact import parameters

OSC = vi.ImpactOscillator()
MAP = partial(vi.parameter_map, OSC)
OF_NUMBERS = ("mass", "omega", "gap", "restitution")
ANY = "must be .*, got "
REFUSED = {  # by what is called: arguments and words
    vi.ImpactOscillator: [
        *(({name: value}, f"`{name}` {ANY}") for name, value in (
            ("mass", 0.0), ("mass", -1.0), ("stiffness", 0.0), ("stiffness", -2.0), ("damping", -0.1),
            ("amplitude", -1.0), ("omega", 0.0), ("omega", -1.0), ("frequency", 0.0), ("restitution", -0.01),
            ("restitution", 1.01), ("gap", math.inf), ("mass", None), ("gap", None), ("restitution", None),
            *((name, bad) for name in OF_NUMBERS for bad in (math.nan, "1", 1j, [1.0])),
        )),
        ({"amplitude": -1.0}, "start half a period later instead"),
        ({"omega": 2.0, "frequency": 0.3}, "either `omega` or `frequency`, not both; got 2.0 and 0.3"),
        ({"damping": 0.1, "damping_ratio": 0.1}, "either `damping` or `damping_ratio`, not both"),
        ({"damping_ratio": -0.1}, "`damping_ratio` must be a finite number >= 0, got -0.1"),
        ({"damping_ratio": 0.1, "mass": 0.0}, "`mass` must be .* > 0, got 0.0"),
        ({"zeta": 0.1}, "did you mean 'damping_ratio'"),
        ({"mass": "0.5"}, "`mass` must be a finite number > 0, got '0.5'; .*write numbers without quotes"),
        ({"mass": "heavy"}, "give the moving mass in kg"),
    ],
    OSC.replace: [
        ({name: None}, f"`{name}` {ANY}None") for name in ("damping", "omega", "frequency", "damping_ratio", "gap")
    ],
    vi.State: [
        ({"displacement": value}, "`displacement` must be a finite number, got")
        for value in (math.nan, math.inf, "0", None)
    ],
    MAP: [
        ({"zeta": [0.01]}, "did you mean 'damping_ratio'"),
        ({"damping": [0.1], "damping_ratio": [0.01]}, "either `damping` or `damping_ratio`, not both"),
        ({"gap": [-1.0, 1.0], "start": vi.State(0.0)}, "at most the gap, -1 m here, got 0.0"),
        ({}, "an axis is missing"),
        ({"omega": []}, "`omega` must be .*non-empty.*, got "),
        ({"omega": [2.0, 1.0]}, "`omega` must increase strictly, but goes from 2 to 1"),
        ({"omega": [1.0, 1.0]}, "increase strictly"),
        ({"omega": [[1.0]]}, "one-dimensional"),
        ({"omega": 1.0}, "one-dimensional"),
        ({"omega": ["a"]}, "one-dimensional"),
        ({"omega": ["1", "2"]}, "`omega` must be a one-dimensional, non-empty list of numbers, got .'1', '2'."),
        ({"omega": [1, "2"]}, "list of numbers"),
        ({"omega": np.array([1, "2"], object)}, "list of numbers"),
        ({"omega": [False, True]}, "list of numbers"),
        ({"omega": [1j]}, "list of numbers"),
        ({"omega": [1.0, math.inf]}, "`omega` must be .*, got inf"),
        ({"omega": [1.0, math.nan]}, "`omega` must be .*, got nan"),
        ({"omega": [-1.0, 1.0]}, "`omega` must be a finite number > 0, got -1.0"),
        ({"restitution": [0.5, 1.5]}, "`restitution` must be between 0 and 1, got 1.5"),
        ({"omga": [1.0]}, "unknown parameter 'omga'.*did you mean 'omega'"),
        ({"omega": [1.0], "frequency": [1.0]}, "either `omega` or `frequency`, not both"),
    ],
    partial(MAP, omega=[1.0]): [
        ({"indices": ("stdd",)}, "unknown index 'stdd'.*did you mean 'std'"),
        ({"indices": ()}, "`indices` must be .*, got"),
        ({"indices": 3}, "`indices` must be one or more of std, .*, got 3"),
        ({"indices": ("std", "std")}, "distinct names"),
        ({"sample_impacts": 0}, "`sample_impacts` must be a whole number >= 1, got 0"),
        ({"sample_impacts": 2.5}, "`sample_impacts` must be .*, got 2.5"),
        ({"transient_impacts": -1}, "`transient_impacts` must be a whole number >= 0, got -1"),
        ({"workers": 0}, "`workers` must be .*, got 0"),
    ],
    partial(vi.parameter_map, {"mass": 1}, omega=[1, 2]): [
        ({"refine": refine}, "`osc` must be an ImpactOscillator, .*, got {'mass': 1}; for example")
        for refine in (None, 2)
    ],
    partial(vi.bifurcation_diagram, OSC, omega=[1.0]): [
        ({"section": "poincare"}, "unknown `section` 'poincare'; choose from impact, stroboscopic"),
        ({"direction": "left"}, "unknown `direction` 'left'; choose from fresh, up, down"),
        ({"phase": 1.0, "section": "stroboscopic"}, "`phase` must be .* less than 1, got 1.0"),
        ({"mass": [1.0, 2.0]}, "give exactly one axis, such as `omega`, got `omega`, `mass`"),
        ({"sample_periods": 0}, "`sample_periods` must be .*, got 0"),
    ],
    partial(vi.impact_section, OSC): [
        ({"sample_impacts": "500"}, "`sample_impacts` must be a whole .*, got '500'; write numbers without quotes"),
    ],
    partial(vi.simulate, OSC): [
        *(({"periods": periods}, f"`periods` {ANY}") for periods in (0, -1, math.nan)),
        *(({"periods": 1, "samples_per_period": density}, f"`samples_per_period` {ANY}") for density in (0, 1.5)),
    ],
    vi.Tolerances: [
        ({name: value}, f"`{name}` {ANY}")
        for name, value in (("chatter", 0.0), ("chatter", 0.1), ("flight_periods", 0.5), ("steps_per_impact", 0))
    ],
}  # fmt: skip


@pytest.mark.parametrize(
    ("call", "arguments", "words"), [(call, *row) for call, rows in REFUSED.items() for row in rows]
)
def test_what_is_wrong_is_refused_by_name_value_and_what_is_allowed(call, arguments, words):
    with pytest.raises(ValueError, match=words):
        call(**arguments)


def test_frequency_in_hertz_stands_for_omega_everywhere():
    assert vi.ImpactOscillator(frequency=0.5).omega == pytest.approx(math.pi)
    assert vi.ImpactOscillator(omega=None).omega == 2.0
    assert OSC.replace(frequency=0.5).omega == pytest.approx(math.pi)
    by_hertz = vi.parameter_map(OSC, frequency=np.array([0.3, 0.4]), sample_impacts=20)
    by_omega = vi.parameter_map(OSC, omega=2 * math.pi * np.array([0.3, 0.4]), sample_impacts=20)
    assert by_hertz["std"].dims == ("frequency",)
    assert by_hertz["frequency"].attrs["units"] == "Hz"
    assert np.array_equal(by_hertz["std"].values, by_omega["std"].values)


def test_a_damping_ratio_stands_for_the_damping_of_this_mass_and_stiffness():
    osc = vi.ImpactOscillator(mass=4.0, stiffness=9.0, damping_ratio=0.05)
    assert osc.damping == pytest.approx(0.6, rel=1e-15)
    assert osc.damping_ratio == pytest.approx(0.05, rel=1e-15)
    other = osc.replace(damping_ratio=0.1, mass=16.0)
    assert other.damping == pytest.approx(2.4, rel=1e-15)
    assert other.replace(damping=0.0).damping_ratio == 0.0
    assert vi.ImpactOscillator(damping_ratio=1.0).damping == 2.0  # critical


def test_a_damping_ratio_is_an_axis_that_follows_mass_and_stiffness():
    axes = {"damping_ratio": [0.01, 0.02], "mass": [1.0, 4.0]}
    sweep = vi.parameter_map(OSC.replace(stiffness=9.0), sample_impacts=50, **axes)
    alone = vi.parameter_map(
        OSC.replace(stiffness=9.0, mass=4.0, damping_ratio=0.02), omega=[OSC.omega], sample_impacts=50
    )
    assert sweep["std"].sel(damping_ratio=0.02, mass=4.0) == alone["std"][0]


@pytest.mark.parametrize(
    ("name", "meant"),
    [("masss", "did you mean 'mass'"), ("m", "did you mean 'mass'"), ("w", "did you mean 'omega'"),
     ("stifness", "did you mean 'stiffness'"), ("freq", "did you mean 'frequency'"),
     ("zz", "choose from mass, damping, damping_ratio, .*, gap")],
)  # fmt: skip
def test_a_misspelt_parameter_is_answered_with_the_one_that_was_meant(name, meant):
    words = f"unknown parameter '{name}'; .*{meant}"
    for call, value in ((vi.ImpactOscillator, 1.0), (OSC.replace, 1.0), (partial(vi.parameter_map, OSC), [1.0])):
        with pytest.raises(ValueError, match=words):
            call(**{name: value})


def test_symbols_stand_for_the_same_parameters_wherever_they_are_told():
    symbols = {name: entry.symbol for name, entry in OSC.parameters.items() if not entry.replaces}
    for name, symbol in symbols.items():
        with pytest.raises(ValueError, match=f"unknown parameter '{symbol}'; .*did you mean '{name}'"):
            OSC.replace(**{symbol: 1.0})


FUNCTIONS = [
    lambda **k: vi.simulate(OSC, **k),
    lambda **k: vi.impact_section(OSC, **k),
    lambda **k: vi.stroboscopic_section(OSC, **k),
    lambda **k: vi.bifurcation_diagram(OSC, omega=[1.0, 2.0], **k),
    lambda **k: vi.parameter_map(OSC, omega=[1.0, 2.0], **k),
]


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize(("how", "words"), [
    ({"start": vi.State(0.5)}, "`start` must have a displacement of at most the gap, .* got 0.5"),
    ({"start": 0.5}, "`start` must be None.* State.*, got 0.5"),
    ({"backend": "gpu"}, "unknown `backend` 'gpu'; choose from cpu"),
])  # fmt: skip
def test_a_start_beyond_the_stop_or_of_another_kind_and_an_unknown_back_end_are_refused(function, how, words):
    with pytest.raises(ValueError, match=words):
        function(**how)


@pytest.mark.parametrize("values", [range(1, 3), np.array([1, 2]), (Fraction(1), 2), np.float32([1, 2])])
def test_an_axis_may_be_any_list_of_numbers(values):
    assert vi.parameter_map(OSC, omega=values, sample_impacts=1)["omega"].values.tolist() == [1.0, 2.0]


@pytest.fixture
def small(memory, monkeypatch):
    """Let the machine have ten megabytes of memory."""
    memory(10_000_000)
    monkeypatch.setattr("vibroimpact.sweeps._empty_map", pytest.fail)


PLANE = {"omega": np.linspace(1, 2, 1000), "mass": np.linspace(1, 2, 300)}


@pytest.mark.usefixtures("small")
def test_a_map_that_memory_cannot_hold_is_refused_before_a_cell_is_made():
    words = "`axes` span 1000 x 300 = 300,000 cells, which take 75 MB of memory, but this machine has 10 MB; write"
    with pytest.raises(ValueError, match=words):
        vi.parameter_map(OSC, **PLANE)
    with pytest.raises(ValueError, match="which take 77.4 MB"):
        vi.parameter_map(OSC, indices=("std", "lyapunov"), **PLANE)
    with pytest.raises(ValueError, match="`refine` makes 7993 x 2393 = 19,127,249 cells, which take 574 MB of memory"):
        vi.parameter_map(OSC, refine=3, **PLANE)


def test_nothing_is_refused_where_the_machine_does_not_tell_its_memory(monkeypatch):
    monkeypatch.delattr("os.sysconf")
    assert parameters.installed() is None
    parameters.check_fits("axes", "take", 10**30, "take fewer")


@pytest.mark.skipif(not hasattr(os, "sysconf"), reason="tells no memory")
def test_the_memory_of_this_machine_is_some_gigabytes():
    assert 10**8 < parameters.installed() < 10**14


def public(pages):
    """Return the functions that the pages of the API list, those that draw or save left out."""
    listed = "".join(page.read_text(encoding="utf-8") for page in sorted(pages.glob("*.md")))
    names = [name.rpartition(".") for name in re.findall(r"^   (vibroimpact\.\S+)$", listed, re.MULTILINE)]
    drawn = ("vibroimpact.plotting", "vibroimpact.studies.lee")
    named = [getattr(importlib.import_module(home), name) for home, _, name in names if home not in drawn]
    return [function for function in named if not inspect.isclass(function)]


def test_how_something_is_computed_is_given_by_name_as_the_page_says():
    # Of `attractors`, of `find_sticking_orbit`, of `family`, of `explore`.
    worked_on = ("starts", "n_periods", "function", "model")
    for function in public(ROOT / "docs" / "reference" / "api"):
        for name, parameter in inspect.signature(function).parameters.items():
            if parameter.default is not inspect.Parameter.empty and name not in worked_on:
                assert parameter.kind is inspect.Parameter.KEYWORD_ONLY, (function, name)


def test_the_dimensionless_form_moves_as_the_oscillator_does():
    osc = vi.ImpactOscillator(
        mass=2.0, damping=0.3, stiffness=50.0, amplitude=4.0, omega=9.0, gap=0.02, restitution=0.7
    )
    scaled, unit = osc.dimensionless()
    assert (scaled.mass, scaled.stiffness, scaled.amplitude) == (1.0, 1.0, 1.0)
    real = vi.impact_section(osc, transient_impacts=300, sample_impacts=3)
    plain = vi.impact_section(scaled, transient_impacts=300, sample_impacts=3)
    assert plain["velocity"].values * unit["velocity"] == pytest.approx(real["velocity"].values, rel=1e-9)
    assert plain["time"].values * unit["time"] == pytest.approx(real["time"].values, rel=1e-12)
