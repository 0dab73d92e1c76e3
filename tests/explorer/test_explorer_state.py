"""The explorer's view: what it may be, and how an address holds it."""

import math
from dataclasses import fields, replace
from itertools import product
from urllib.parse import parse_qsl, urlencode

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import vibroimpact as vi
from vibroimpact.explorer.address import BY_NAME, LONGEST, PRESETS, case_of, from_query, ranges_for, to_query
from vibroimpact.explorer.limits import least_width, stiffness, with_ranges
from vibroimpact.explorer.state import CASES, SAMPLES, SHOWN, View, rounded

NAMES = tuple(vi.ImpactOscillator().values)
OF_SYSTEMS = ("model", "coordinate", "stop")  # parts of a view that one mass with one stop has no choice of

EVERYTHING = {
    "osc": vi.ImpactOscillator(mass=1 / 3, omega=2.8000000000000003, gap=-0.1), "x": "gap", "y": "restitution",
    "x_range": (-1.0, 1e-9), "y_range": (0.1, 0.99), "index": "motion", "log": True, "line": "y", "samples": 2000,
    "boundaries": True, "settled": False, "worst": True, "start": vi.State(-0.2, 1e-17, 3.0), "case": "tube",
    "pins": (vi.ImpactOscillator(gap=-0.1), vi.ImpactOscillator(mass=2.0)),
}  # fmt: skip


@st.composite
def oscillators(draw):
    """Any that a page may ask for, from the plain to the extreme."""
    mass, stiffness = (10.0 ** draw(st.floats(-9.0, 9.0)) for _ in range(2))
    return vi.ImpactOscillator(
        mass=mass,
        stiffness=stiffness,
        omega=math.sqrt(stiffness / mass) * 10.0 ** draw(st.floats(-2.9, 1.9)),
        damping=draw(st.sampled_from([0.0, 1e-3, 0.5])) * 2.0 * math.sqrt(stiffness * mass),
        amplitude=draw(st.sampled_from([0.0, 1.0, 1e-6, 12345.678])),
        restitution=draw(st.floats(1e-9, 1.0)),
        gap=draw(st.sampled_from([0.0, -0.1, 1e-6, -2.5])),
    )


@st.composite
def ends(draw, parameter, osc):
    """A range about the oscillator's own value, down to where double precision ends."""
    value = getattr(osc, parameter)
    width = max(abs(value), 0.1) * 10.0 ** draw(st.floats(-11.0, -0.5))
    low = max(value - width, 1e-9) if parameter not in ("damping", "amplitude", "gap") else value
    return (low, min(value, 1.0 - width) + width) if parameter == "restitution" else (low, value + width)


@st.composite
def views(draw):
    """Views in which every part may differ from what is usual."""
    osc = draw(oscillators())
    x, y = draw(st.permutations(NAMES))[:2]
    x_range, y_range = draw(ends(x, osc)), draw(ends(y, osc))
    number = st.floats(-1e15, 1e15)
    start = vi.State(osc.gap - abs(draw(number)), draw(number), draw(st.floats(-1e8, 1e8)) * osc.period)
    try:
        return View(
            osc=osc, x=x, y=y, x_range=x_range, y_range=y_range, index=draw(st.sampled_from(SHOWN)),
            log=draw(st.booleans()), line=draw(st.sampled_from("xy")), samples=draw(st.sampled_from(SAMPLES)),
            boundaries=draw(st.booleans()), settled=draw(st.booleans()), worst=draw(st.booleans()),
            case=draw(st.sampled_from(CASES)),
            start=start if osc.velocity_scale and draw(st.booleans()) else None,
            pins=tuple(draw(st.lists(oscillators(), max_size=2))),
        )  # fmt: skip
    except ValueError:  # at a corner of the plane, say
        return View(osc=osc, x="restitution", x_range=(0.5, 0.6), y="gap", y_range=(-0.01, 0.5))


def test_every_preset_is_told_by_its_address():
    for preset in PRESETS:
        assert from_query(to_query(preset.view)) == preset.view


def test_a_view_with_everything_in_it_is_told_by_its_address():
    view = View(**EVERYTHING)
    usual = {field.name for field in fields(View) if getattr(view, field.name) == getattr(View(), field.name)}
    assert usual == {*OF_SYSTEMS, "hertz"}
    assert from_query(to_query(view)) == view
    assert from_query("?" + to_query(view)) == view


@settings(max_examples=50, deadline=None)
@given(st.floats(1.9, 2.1), st.floats(1.9, 2.1))
def test_a_view_in_hertz_is_the_same_motion_and_is_restored_from_its_address(omega, pinned):
    view = View(osc=vi.ImpactOscillator(omega=omega), pins=(vi.ImpactOscillator(omega=pinned),), hertz=True)
    assert (view.x, view.osc.omega) == ("frequency", omega)
    assert view.osc.replace(frequency=view.values["frequency"]).omega == pytest.approx(omega, rel=3e-16)
    assert from_query(to_query(view)).values == view.values
    assert from_query("hz=1").x == from_query("hz=1&model=two_sided_oscillator").x == "frequency"
    back = replace(view, hertz=False)
    assert (back.x, back.x_range, back.osc) == ("omega", View.x_range, view.osc)


@settings(max_examples=150, deadline=None)
@given(views())
def test_every_view_is_restored_from_its_address(view):
    query = to_query(view)
    assert from_query(query) == view
    assert to_query(from_query(query)) == query
    sent = urlencode(parse_qsl(query, keep_blank_values=True))  # as a server hands it on, commas quoted
    assert len(sent) <= LONGEST
    assert from_query(sent) == view


@pytest.mark.parametrize("name", [field.name for field in fields(View) if field.name not in (*OF_SYSTEMS, "hertz")])
def test_each_part_of_a_view_has_its_place_in_the_address(name):
    whole, usual = View(**EVERYTHING), View()
    changes = {
        "osc": {"osc": usual.osc, "start": None}, "x": {"x": "damping", "x_range": (0.0, 1.0)}, "y": {"y": "damping"},
        "x_range": {"x_range": (-0.5, 0.5)}, "y_range": {"y_range": (0.2, 0.3)},
    }  # fmt: skip
    other = replace(whole, **changes.get(name, {name: getattr(usual, name)}))
    assert to_query(other) != to_query(whole)
    assert getattr(from_query(to_query(other)), name) == getattr(other, name) != getattr(whole, name)


def outcome(query):
    try:
        return "", from_query(query)
    except ValueError as refusal:
        return str(refusal), None


KEYS = ["m", "c", "w", "r", "g", "x", "y", "n", "start", "pin", "case", "index", "log", "from"]
VALUES = ["nan", "-inf", "1e999", "1e-300", "1e300", "0", "-0", "", "1,2", "w,0,1", "w,nan,2", "m,1e-300,1e300", "tube",
          "1,0,1,1,1,1,0", "0,0,1e300", "\u0665", "1_0", "0x1", "2", "1"]  # fmt: skip
PAIRS = st.tuples(st.sampled_from(KEYS), st.sampled_from(VALUES) | st.text(max_size=8))


@settings(max_examples=200, deadline=None)
@given(st.text(max_size=60) | st.lists(PAIRS, max_size=6).map(urlencode))
def test_no_address_does_more_than_be_refused_in_words(query):
    message, view = outcome(query)
    assert bool(message) != (view is not None)
    assert len(message) < 500
    assert view is None or from_query(to_query(view)) == view


@pytest.mark.parametrize(
    ("query", "part"),
    [
        ("w=fast", "`w`"),
        ("w=nan", "`omega`"),
        ("w=inf", "`omega`"),
        ("w=1e300", "`omega`"),
        ("m=-1", "`mass`"),
        ("r=2", "`restitution`"),
        ("w=5000", "driving"),
        ("c=1e6", "decay"),
        ("password=x", "unknown part of a view 'password'"),
        ("index=__class__", "`index`"),
        ("index=" + "a" * 500, "`index`"),
        ("x=w,1", "`x`"),
        ("x=w,2,1", "`x`"),
        ("x=q,1,2", "`x`"),
        ("x=w,2,2.0000000000000004", "double precision"),
        ("m=1e-300", "`mass`"),
        ("g=1e300", "`gap`"),
        ("k=1e15&g=1e15&w=3e7", "energies"),
        ("x=w,0.0001,5", "at the edge of the plane"),
        ("pin=1e-12,0,1,1,1,1,0", "in a pin"),
        ("c=150&w=0.01&x=r,0.1,0.2", "decay"),
        ("start=0,1,1e20", "driving periods"),
        ("f=0&start=0,1,0&x=g,0,1&y=r,0.1,0.2", "without a force"),
        ("case=yacht", "`case`"),
        ("x=m,1,2&y=m,1,2", "`y` must be a parameter different"),
        ("n=100000000", "`samples`"),
        ("n=\u0665", "`samples`"),
        ("log=yes", "`log`"),
        ("line=z", "`line`"),
        ("start=0,0", "`start`"),
        ("start=5,0,0", "in front of the stop"),
        ("start=0,1e300,0", "`start`"),
        ("pin=1,2,3", "`pin`"),
        ("&".join(["pin=1,0,1,1,1,1,0"] * 3), "got 3"),
        ("&".join(["pin=1,0,1,1,1,1,0"] * 50), "address"),
        ("w=2&" + "a" * LONGEST, "characters"),
        ("w", "address"),
        ("w=<script>alert(1)</script>", "`w`"),
    ],
)
def test_hostile_addresses_are_refused_in_words(query, part):
    with pytest.raises(ValueError, match=r"must|choose from") as refusal:
        from_query(query)
    assert part in str(refusal.value)
    assert len(str(refusal.value)) < 500


def test_of_a_repeated_entry_the_last_one_counts():
    assert from_query("w=1&w=2.5").osc.omega == 2.5


def test_zoom_stops_where_double_precision_ends_and_says_so():
    view = View()
    deep, message = with_ranges(view, (2.0, 2.0 + 1e-14), (1.0, 1.5))
    assert "double precision" in message
    assert deep.y_range == (1.0, 1.5)
    low, high = deep.x_range
    assert high - low < 1e-9 * (view.x_range[1] - view.x_range[0])
    assert high - low >= least_width(low, high)


def test_a_pan_beyond_what_is_physical_stops_at_the_edge():
    view, message = with_ranges(View(), (-2.0, 3.0), (0.1, 5.0))
    assert "`omega`" in message
    assert 0.0 < view.x_range[0] < 0.01
    assert view.x_range[1] == 3.0


def test_a_click_has_no_more_digits_than_a_pixel_tells_also_in_the_deepest_or_smallest_plane():
    assert rounded(2.3456789, (0.025, 5.0)) == 2.346
    assert rounded(1.23456789e-15, (1e-15, 2e-15)) == pytest.approx(1.23456789e-15, rel=1e-3)
    with pytest.raises(ValueError, match="`point`"):
        rounded(None, (0.0, 1.0))
    assert rounded(2.0 + 1.23456e-9, (2.0, 2.0 + 5e-9)) == pytest.approx(2.0 + 1.235e-9, abs=2e-12)


def test_a_click_leaves_the_plane_as_it_is_and_a_slider_of_another_parameter_does_not():
    view = View()
    clicked = replace(view, osc=view.osc.replace(omega=3.0, mass=2.0))
    assert clicked.plane_key == view.plane_key
    assert clicked.point_key != view.point_key
    assert replace(view, osc=view.osc.replace(damping=0.02)).plane_key != view.plane_key


@pytest.mark.parametrize("ends", [(None, 1.0), (math.nan, 1.0), (-math.inf, math.inf), "ab", (1.0,), None, (3.0, 2.0)])
def test_a_zoom_to_nowhere_changes_nothing_and_is_answered(ends):
    view, message = with_ranges(View(), ends, (0.1, 5.0))
    assert view.x_range == View().x_range
    assert "must be" in message


def test_parts_of_a_view_are_what_they_should_be():
    view = View(samples=200.0, log=1)
    assert to_query(view) == to_query(View(samples=200, log=True))
    for wrong in (
        {"log": "yes"},
        {"settled": None},
        {"samples": [200]},
        {"index": np.zeros(3)},
        {"x_range": (1, 2, 3)},
    ):
        with pytest.raises(ValueError, match="must be"):
            View(**wrong)


@settings(max_examples=60, deadline=None)
@given(views(), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_nowhere_in_a_plane_is_more_asked_than_at_its_corners(view, across, upwards):
    place = {name: low + share * (high - low) for name, share, (low, high) in
             ((view.x, across, view.x_range), (view.y, upwards, view.y_range))}  # fmt: skip
    assert stiffness(view.osc.replace(**place)) <= view.stiffness * (1.0 + 1e-9)


def test_every_case_tells_its_source_and_what_it_idealises():
    assert (*BY_NAME,) == CASES[1:]
    for preset in PRESETS:
        assert len(preset.source) > 40
        assert len(preset.idealised) > 40
        for name in NAMES:
            low, high = ranges_for(preset.view)[name]
            assert low <= getattr(preset.view.osc, name) <= high
        if preset.name in ("tube", "pipe", "ship", "valve"):
            assert "guesses: vary them" in preset.source


def test_no_slider_of_a_case_reaches_beyond_what_is_allowed():
    for preset in PRESETS:
        turned = [name for name in NAMES if name not in (preset.view.x, preset.view.y)]
        for ends in product(*(preset.ranges[name] for name in turned)):
            replace(preset.view, osc=preset.view.osc.replace(**dict(zip(turned, ends, strict=True))))


def test_a_case_is_told_of_until_another_one_is_chosen():
    tube = BY_NAME["tube"].view
    moved = replace(tube, osc=tube.osc.replace(omega=300.0, mass=2.0))
    assert case_of(moved).name == "tube"
    assert ranges_for(moved)["gap"] == BY_NAME["tube"].ranges["gap"]
    assert case_of(View()).name == "paper-mass"
    assert case_of(View(osc=vi.ImpactOscillator(omega=2.5))) is None
    assert ranges_for(View(x_range=(0.025, 20.0)))["omega"] == (0.025, 20.0)


def beam(outer, wall, added, length):
    """Return modal mass and stiffness of a steel tube's first mode between two supports, with water."""
    inner = outer - 2.0 * wall
    steel, water, displaced = (math.pi / 4.0 * a for a in (outer**2 - inner**2, inner**2, outer**2))
    a_metre = 7850.0 * steel + 1000.0 * (water + added * displaced)
    bending = 200e9 * math.pi / 64.0 * (outer**4 - inner**4)
    return a_metre * length / 2.0, math.pi**4 * bending / (2.0 * length**3)


@pytest.mark.parametrize(("name", "built", "hertz", "ratio"), [
    ("tube", beam(19.05e-3, 1.65e-3, 1.2, 1.5), 16.0, 0.02), ("pipe", beam(60.3e-3, 3.91e-3, 0.0, 3.0), 15.0, 0.005),
])  # fmt: skip
def test_tube_and_pipe_are_the_beams_that_their_sources_tell(name, built, hertz, ratio):
    osc = BY_NAME[name].view.osc
    assert (osc.mass, osc.stiffness) == pytest.approx(built, rel=0.01)
    assert osc.natural_frequency / (2.0 * math.pi) == pytest.approx(hertz, rel=0.03)
    assert osc.damping_ratio == pytest.approx(ratio, rel=0.02)
    if name == "tube":
        assert osc.gap == pytest.approx(25.4e-3 / 64.0 / 2.0, rel=0.01)
        assert math.pi * math.sqrt(osc.mass / 1e7) == pytest.approx(1e-3, rel=0.05)
    else:
        assert -osc.gap * osc.stiffness == pytest.approx(20.0, rel=0.01)
        assert osc.omega == pytest.approx(1470.0 / 60.0 * 2.0 * math.pi, rel=1e-3)


def test_the_ship_has_the_periods_that_its_source_prints():
    osc = BY_NAME["ship"].view.osc
    assert 2.0 * math.pi / osc.replace(stiffness=5e5).natural_frequency == pytest.approx(148.0, rel=0.01)
    assert 2.0 * math.pi / osc.replace(stiffness=4e6).natural_frequency == pytest.approx(52.0, rel=0.01)
    assert osc.damping_ratio == pytest.approx(0.05, rel=0.01)
    assert math.pi * math.sqrt(osc.mass / 20e6) == pytest.approx(12.0, rel=0.03)
    assert osc.period == pytest.approx(52.0, rel=0.01)


def test_the_valve_is_the_one_of_its_table():
    osc = BY_NAME["valve"].view.osc
    assert (osc.mass, osc.stiffness, osc.gap) == (0.040, 34.59e3, 0.20e-3)
    assert osc.natural_frequency / (2.0 * math.pi) == pytest.approx(148.0, rel=1e-3)
    assert osc.amplitude == pytest.approx(0.28e6 * math.pi / 4.0 * 6e-3**2, rel=0.02)
    assert osc.omega == pytest.approx(7 * 1500.0 / 60.0 * 2.0 * math.pi, rel=1e-3)
    assert osc.damping_ratio == pytest.approx(0.05, rel=0.01)
