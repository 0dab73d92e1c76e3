"""The explorer's view: what it may be, and how it is told in an address."""

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vibroimpact.explorer.address import LONGEST, from_query, to_query
from vibroimpact.explorer.presets import BY_NAME, PRESETS, ranges_for
from vibroimpact.explorer.state import View, least_width, offset, rounded, with_ranges
from vibroimpact.oscillator import PARAMETERS, ImpactOscillator, State


def test_every_preset_is_told_by_its_address():
    for preset in PRESETS:
        assert from_query(to_query(preset.view)) == preset.view


def test_a_view_with_everything_in_it_is_told_by_its_address():
    osc = ImpactOscillator(mass=1 / 3, omega=2.8000000000000003, gap=-0.1)
    view = View(
        osc=osc, x="gap", y="restitution", x_range=(-1.0, 1e-9), y_range=(0.1, 0.99), index="motion", log=True,
        line="y", samples=2000, boundaries=True, settled=False, start=State(-0.2, 1e-17, 3.0),
        pins=(osc, osc.replace(mass=2.0)),
    )  # fmt: skip
    assert from_query(to_query(view)) == view
    assert from_query("?" + to_query(view)) == view


@settings(max_examples=60, deadline=None)
@given(st.floats(0.05, 90.0), st.floats(1e-3, 1e3), st.floats(1e-9, 1.0))
def test_addresses_keep_every_digit(ratio, mass, restitution):
    view = View(osc=ImpactOscillator(mass=mass, stiffness=mass, omega=ratio, restitution=restitution), x="gap",
                x_range=(-1.0, 1.0), y="damping", y_range=(0.0, 1e-3))  # fmt: skip
    assert from_query(to_query(view)) == view


@pytest.mark.parametrize(
    ("query", "told"),
    [
        ("w=fast", "`w`"),
        ("w=nan", "`omega`"),
        ("w=inf", "`omega`"),
        ("w=1e300", "`omega`"),
        ("m=-1", "`mass`"),
        ("r=2", "`restitution`"),
        ("w=5000", "natural frequency"),
        ("c=1e6", "critical"),
        ("w=1&w=2", "2 times"),
        ("password=x", "no part of a view"),
        ("index=__class__", "`index`"),
        ("index=" + "a" * 500, "`index`"),
        ("x=w,1", "`x`"),
        ("x=w,2,1", "`x`"),
        ("x=q,1,2", "`x`"),
        ("x=w,2,2.0000000000000004", "double precision"),
        ("x=m,1,2&y=m,1,2", "different"),
        ("n=100000000", "`samples`"),
        ("n=\u0665", "`samples`"),
        ("log=yes", "`log`"),
        ("line=z", "`line`"),
        ("start=0,0", "`start`"),
        ("start=5,0,0", "beyond the stop"),
        ("start=0,1e300,0", "`start`"),
        ("pin=1,2,3", "`pin`"),
        ("&".join(["pin=1,0,1,1,1,1,0"] * 3), "3 times"),
        ("&".join(["pin=1,0,1,1,1,1,0"] * 50), "address"),
        ("w=2&" + "a" * LONGEST, "characters"),
        ("w", "address"),
        ("w=<script>alert(1)</script>", "`w`"),
    ],
)
def test_hostile_addresses_are_refused_in_words(query, told):
    with pytest.raises(ValueError, match="allowed") as refusal:
        from_query(query)
    assert told in str(refusal.value)
    assert len(str(refusal.value)) < 400


def test_zoom_stops_where_double_precision_ends_and_says_so():
    view = View()
    deep, message = with_ranges(view, (2.0, 2.0 + 1e-14), (1.0, 1.5))
    assert "double precision" in message
    assert deep.y_range == (1.0, 1.5)
    low, high = deep.x_range
    assert high - low < 1e-9 * (view.x_range[1] - view.x_range[0])
    assert high - low >= least_width(low, high)


def test_a_zoom_to_a_thousand_millionth_of_the_range_is_allowed():
    view = View(x_range=(2.0, 2.0 + 5e-9), y_range=(1.0, 1.0 + 5e-9))
    assert view.x_range[1] > view.x_range[0]


def test_a_pan_beyond_what_is_physical_stops_at_the_edge():
    view, message = with_ranges(View(), (-2.0, 3.0), (0.1, 5.0))
    assert "`omega`" in message
    assert 0.0 < view.x_range[0] < 0.01
    assert view.x_range[1] == 3.0


def test_a_click_has_no_more_digits_than_a_pixel_tells():
    assert rounded(2.3456789, (0.025, 5.0)) == 2.346
    assert rounded(2.0 + 1.23456e-9, (2.0, 2.0 + 5e-9)) == pytest.approx(2.0 + 1.235e-9, abs=2e-12)


def test_deep_axes_are_counted_from_a_round_value():
    assert offset((0.0, 5.0)) == 0.0
    assert offset((2.8 - 1e-10, 2.8 + 1e-10)) == 2.8


def test_a_click_leaves_the_plane_as_it_is_and_a_slider_of_another_parameter_does_not():
    view = View()
    clicked = replace(view, osc=view.osc.replace(omega=3.0, mass=2.0))
    assert clicked.plane_key == view.plane_key
    assert clicked.point_key != view.point_key
    assert replace(view, osc=view.osc.replace(damping=0.02)).plane_key != view.plane_key


def test_every_preset_tells_its_source_and_what_it_idealises():
    for preset in PRESETS:
        assert len(preset.source) > 40
        assert len(preset.idealised) > 40
        for name in PARAMETERS:
            low, high = ranges_for(preset.view, preset.name)[name]
            assert low <= getattr(preset.view.osc, name) <= high


def test_the_tube_has_the_frequency_that_its_source_derives():
    osc = BY_NAME["tube"].view.osc
    assert osc.natural_frequency / 6.283185 == pytest.approx(16.4, rel=0.02)
    assert osc.damping_ratio == pytest.approx(0.02, rel=0.02)


def test_the_ship_has_the_period_that_its_source_prints():
    osc = BY_NAME["ship"].view.osc
    assert 6.283185 / osc.replace(stiffness=5e5).natural_frequency == pytest.approx(148.0, rel=0.01)
    assert 6.283185 / osc.replace(stiffness=4e6).natural_frequency == pytest.approx(52.0, rel=0.01)
