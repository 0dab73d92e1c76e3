"""The controls without a browser: what they ask of the session, and that they show what it has."""

from dataclasses import replace

import pytest

pytest.importorskip("bokeh", reason="no Bokeh: install the extra [web]")

from vibroimpact.explorer.controls import Controls
from vibroimpact.explorer.presets import BY_NAME, PRESETS
from vibroimpact.explorer.searches import Other
from vibroimpact.explorer.session import Explorer
from vibroimpact.explorer.state import View
from vibroimpact.oscillator import PARAMETERS, ImpactOscillator, State

MOVED = View(
    osc=ImpactOscillator(omega=2.5, damping=3.0, gap=-0.1), x="gap", y="restitution", x_range=(-1.0, 0.0),
    y_range=(0.1, 0.99), index="motion", log=True, line="y", samples=2000, boundaries=True, settled=False,
)  # fmt: skip


class Idle(Explorer):
    """A session that computes nothing."""

    def __init__(self, told):
        super().__init__(listener=lambda what, content: told.append((what, content)))
        self._work.close()

    @property
    def closed(self):
        return False


@pytest.fixture
def told():
    return []


@pytest.fixture
def controls(told):
    explorer = Idle(told)
    yield Controls(explorer, told.append)
    explorer._work.pool.close()


def shown(controls):
    """Return the view that the widgets show."""
    return View(
        osc=ImpactOscillator(**{name: controls.sliders[name].value for name in PARAMETERS}),
        x=controls.x.value, y=controls.y.value, index=controls.menus["index"].value, line=controls.menus["line"].value,
        samples=int(controls.menus["samples"].value), x_range=controls.explorer.view.x_range,
        y_range=controls.explorer.view.y_range, **{name: tick.active for name, tick in controls.ticks.items()},
    )  # fmt: skip


def test_widgets_show_all_of_a_view(controls):
    for view in (MOVED, View(), *(preset.view for preset in PRESETS)):
        controls.explorer.view = view
        controls.show_view(view)
        assert shown(controls) == replace(view, case="")
        assert [controls.numbers[name].value for name in PARAMETERS] == [getattr(view.osc, name) for name in PARAMETERS]
        for name in PARAMETERS:
            assert controls.sliders[name].start <= getattr(view.osc, name) <= controls.sliders[name].end


def test_widgets_tell_the_session_what_was_done(controls):
    view = controls.explorer
    controls.sliders["damping"].value = 0.25
    assert view.view.osc.damping == 0.25
    controls.numbers["gap"].value = -0.5
    assert view.view.osc.gap == -0.5
    controls.menus["samples"].value = "5000"
    controls.ticks["log"].active = True
    controls.x.value = "mass"  # which was upwards: the two change places
    assert (view.view.samples, view.view.log, view.view.x, view.view.y) == (5000, True, "mass", "omega")


@pytest.mark.parametrize(("widget", "value"), [
    ("samples", "five"), ("samples", "²"), ("samples", "9" * 5000), ("index", "__class__"), ("line", ""),
])  # fmt: skip
def test_a_menu_with_a_value_that_it_does_not_offer_is_answered_and_put_back(controls, told, widget, value):
    before = controls.explorer.view
    controls.menus[widget].value = value
    assert controls.explorer.view == before
    assert any(what == "message" and "allowed" in content for what, content in told)
    assert controls.menus[widget].value == str(getattr(before, widget))


@pytest.mark.parametrize("value", [None, float("nan"), float("inf"), 1e300, -1.0])
def test_a_number_that_is_none_is_put_back(controls, value):
    controls.numbers["mass"].value = value
    assert controls.numbers["mass"].value == controls.sliders["mass"].value == 1.0


def test_axes_and_starts_that_are_not_offered_change_nothing(controls):
    before = controls.explorer.view
    controls.x.value = "colour"
    controls.start.value = "²"
    controls.start.value = "17"
    assert controls.explorer.view == before
    assert controls.x.value == "omega"


def test_choosing_a_case_sets_everything_and_undo_takes_it_back(controls):
    valve = BY_NAME["valve"]
    controls.preset.value = "valve"
    assert controls.explorer.view == valve.view
    assert "Wu, Li and Deng" in controls.about.text
    assert "Idealised:" in controls.about.text
    assert controls.sliders["stiffness"].end == 150_000.0
    controls.sliders["omega"].value = 900.0
    assert controls.preset.value == "valve"
    assert controls.explorer.view.case == "valve"
    assert controls.explorer.undo()
    assert controls.explorer.undo()
    controls.show_view(controls.explorer.view)
    assert controls.preset.value == "paper-mass"
    assert controls.sliders["stiffness"].end == 5.0


def test_the_whole_plane_of_a_link_is_at_least_what_it_shows(controls):
    view = replace(MOVED, x="omega", x_range=(1.0, 20.0))
    controls.explorer.view = view
    controls.fit(view)
    assert controls.axis_range("omega") == (0.025, 20.0)
    controls.home()
    assert controls.explorer.view.x_range == (0.025, 20.0)


def test_the_start_in_the_menu_is_the_one_of_the_view(controls):
    other = Other("period-3 impact-4", 0.14, 1.0, State(0.0, 1.5, 0.25))
    explorer = controls.explorer
    explorer.others = [other]
    controls.show_others(explorer.others)
    assert controls.start.options == [("rest", "from rest"), ("0", "on period-3 impact-4 (14 %)")]
    controls.start.value = "0"
    assert explorer.view.start == other.start
    explorer.undo()
    controls.show_view(explorer.view)
    assert controls.start.value == "rest"
    explorer.redo()
    controls.show_view(explorer.view)
    assert controls.start.value == "0"
    explorer.others = []
    controls.show_view(explorer.view)
    assert controls.start.value == "kept"
