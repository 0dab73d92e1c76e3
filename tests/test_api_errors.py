"""A wrong request is refused with the argument, the value, what is allowed, and what to do."""

import math

import numpy as np
import pytest

import vibroimpact as vi

OSC = vi.ImpactOscillator()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("mass", 0.0),
        ("mass", -1.0),
        ("stiffness", 0.0),
        ("stiffness", -2.0),
        ("damping", -0.1),
        ("amplitude", -1.0),
        ("omega", 0.0),
        ("omega", -1.0),
        ("frequency", 0.0),
        ("restitution", -0.01),
        ("restitution", 1.01),
        ("gap", math.inf),
        *[(name, bad) for name in ("mass", "omega", "gap", "restitution") for bad in (math.nan, "1", None, 1j, [1.0])],
    ],
)
def test_a_parameter_out_of_range_is_refused_by_name_value_and_range(name, value):
    if name == "omega" and value is None:
        assert vi.ImpactOscillator(omega=None).omega == 2.0
        return
    with pytest.raises(ValueError, match=f"`{name}` is .*; allowed is .*; "):
        vi.ImpactOscillator(**{name: value})


def test_a_negative_amplitude_is_answered_with_half_a_period():
    with pytest.raises(ValueError, match="start half a period later instead"):
        vi.ImpactOscillator(amplitude=-1.0)


def test_omega_and_frequency_at_once_are_refused():
    with pytest.raises(ValueError, match="`omega` is 2.0 and `frequency` is 0.3"):
        vi.ImpactOscillator(omega=2.0, frequency=0.3)


def test_frequency_in_hertz_stands_for_omega_everywhere():
    assert vi.ImpactOscillator(frequency=0.5).omega == pytest.approx(math.pi)
    assert OSC.replace(frequency=0.5).omega == pytest.approx(math.pi)
    by_hertz = vi.parameter_map(OSC, frequency=np.array([0.3, 0.4]), sample_impacts=20)
    by_omega = vi.parameter_map(OSC, omega=2 * math.pi * np.array([0.3, 0.4]), sample_impacts=20)
    assert by_hertz["std"].dims == ("frequency",)
    assert by_hertz["frequency"].attrs["units"] == "Hz"
    assert np.array_equal(by_hertz["std"].values, by_omega["std"].values)


def test_a_misspelt_parameter_is_refused():
    with pytest.raises(ValueError, match="`masss` is no parameter"):
        OSC.replace(masss=2.0)


@pytest.mark.parametrize("value", [math.nan, math.inf, "0", None])
def test_a_state_takes_finite_numbers(value):
    with pytest.raises(ValueError, match="`displacement` is"):
        vi.State(value)


FUNCTIONS = [
    lambda **k: vi.simulate(OSC, **k),
    lambda **k: vi.impact_section(OSC, **k),
    lambda **k: vi.stroboscopic_section(OSC, **k),
    lambda **k: vi.bifurcation_diagram(OSC, omega=[1.0, 2.0], **k),
    lambda **k: vi.parameter_map(OSC, omega=[1.0, 2.0], **k),
]


@pytest.mark.parametrize("function", FUNCTIONS)
def test_a_start_beyond_the_stop_is_refused_by_every_function(function):
    with pytest.raises(ValueError, match="`start` has displacement 0.5; allowed is at most the gap"):
        function(start=vi.State(0.5))


@pytest.mark.parametrize("function", FUNCTIONS)
def test_a_start_that_is_no_state_is_refused(function):
    with pytest.raises(ValueError, match="`start` is 0.5; allowed is None or a State"):
        function(start=0.5)


@pytest.mark.parametrize("function", FUNCTIONS)
def test_an_unknown_back_end_is_refused(function):
    with pytest.raises(ValueError, match="`backend` is 'gpu'"):
        function(backend="gpu")


def test_an_axis_of_gaps_that_passes_the_start_is_refused():
    with pytest.raises(ValueError, match="allowed is at most the gap, -1 here"):
        vi.parameter_map(OSC, gap=[-1.0, 1.0], start=vi.State(0.0))


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        ({}, "no axis is given"),
        ({"omega": []}, "`omega` is .*non-empty"),
        ({"omega": [2.0, 1.0]}, "`omega` goes from 2 to 1; allowed are strictly increasing"),
        ({"omega": [1.0, 1.0]}, "strictly increasing"),
        ({"omega": [[1.0]]}, "one-dimensional"),
        ({"omega": 1.0}, "one-dimensional"),
        ({"omega": ["a"]}, "one-dimensional"),
        ({"omega": [1.0, math.nan]}, "`omega` is nan"),
        ({"omega": [-1.0, 1.0]}, "`omega` is -1.0; allowed is a finite number > 0"),
        ({"restitution": [0.5, 1.5]}, "`restitution` is 1.5; allowed is a number from 0 to 1"),
        ({"omga": [1.0]}, "`omga` is no parameter to vary.*did you mean 'omega'"),
        ({"omega": [1.0], "frequency": [1.0]}, "`omega` and `frequency` are one parameter"),
    ],
)
def test_a_wrong_axis_is_refused(axes, message):
    with pytest.raises(ValueError, match=message):
        vi.parameter_map(OSC, **axes)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"indices": ("stdd",)}, "`indices` holds 'stdd'.*did you mean 'std'"),
        ({"indices": ()}, "`indices` is empty"),
        ({"indices": ("std", "std")}, "each index once"),
        ({"sample_impacts": 0}, "`sample_impacts` is 0; allowed is a whole number >= 1"),
        ({"sample_impacts": 2.5}, "`sample_impacts` is 2.5"),
        ({"transient_impacts": -1}, "`transient_impacts` is -1; allowed is a whole number >= 0"),
        ({"workers": 0}, "`workers` is 0"),
    ],
)
def test_wrong_settings_of_a_map_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        vi.parameter_map(OSC, omega=[1.0], **settings)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"section": "poincare"}, "`section` is 'poincare'; allowed are impact, stroboscopic"),
        ({"direction": "left"}, "`direction` is 'left'; allowed are fresh, up, down"),
        ({"phase": 1.0, "section": "stroboscopic"}, "`phase` is 1.0"),
        ({"mass": [1.0, 2.0]}, "the axes given are omega, mass; allowed is exactly one"),
        ({"sample_periods": 0}, "`sample_periods` is 0"),
    ],
)
def test_wrong_settings_of_a_diagram_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        vi.bifurcation_diagram(OSC, omega=[1.0], **settings)


@pytest.mark.parametrize(("periods", "density"), [(0, 10), (-1, 10), (math.nan, 10), (1, 0), (1, 1.5)])
def test_wrong_lengths_of_a_simulation_are_refused(periods, density):
    with pytest.raises(ValueError, match="`(periods|samples_per_period)` is"):
        vi.simulate(OSC, periods=periods, samples_per_period=density)


@pytest.mark.parametrize(
    "settings", [{"chatter": 0.0}, {"chatter": 0.1}, {"flight_periods": 0.5}, {"steps_per_impact": 0}]
)
def test_wrong_tolerances_are_refused(settings):
    (name,) = settings
    with pytest.raises(ValueError, match=f"`{name}` is"):
        vi.Tolerances(**settings)


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
