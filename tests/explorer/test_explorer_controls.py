"""The controls without a browser: what they ask of the session, and that they show what it has."""

import re
from dataclasses import replace

import pytest

import vibroimpact as vi

pytest.importorskip("tornado", reason="needs the extra [web]")

from explorers import received
from vibroimpact.coexistence import Attractor
from vibroimpact.explorer.address import BY_NAME, PRESETS
from vibroimpact.explorer.controls import TICKS, Commands, Controls
from vibroimpact.explorer.session import Explorer
from vibroimpact.explorer.state import View

MOVED = View(
    osc=vi.ImpactOscillator(omega=2.5, damping=3.0, gap=-0.1), x="gap", y="restitution", x_range=(-1.0, 0.0),
    y_range=(0.1, 0.99), index="motion", log=True, line="y", samples=2000, boundaries=True, settled=False, worst=True,
)  # fmt: skip


class Idle(Explorer):
    """A session that computes nothing."""

    def __init__(self, heard):
        super().__init__(listener=heard.extend)
        self._work.close()

    @property
    def closed(self):
        return False


@pytest.fixture
def controls(heard):
    explorer = Idle(heard)
    yield Controls(explorer)
    explorer._work.pool.close()


def shown(controls):
    """Return the view that the controls show."""
    menus = {name: menu.value for name, menu in controls.menus().items()}
    return View(
        osc=vi.ImpactOscillator(**{name: value for name, (value, low, high) in controls.rows().items()}),
        x=menus["x"], y=menus["y"], index=menus["index"], line=menus["line"], samples=int(menus["samples"]),
        x_range=controls.explorer.view.x_range, y_range=controls.explorer.view.y_range,
        **{name: getattr(controls.explorer.view, name) for name in TICKS},
    )  # fmt: skip


def chosen(controls, name):
    """Return what is chosen in a menu, which has to offer it."""
    menu = controls.menus()[name]
    assert menu.value in dict(menu.options)
    return menu.value


def test_controls_show_all_of_a_view(controls):
    for view in (MOVED, View(), *(preset.view for preset in PRESETS)):
        controls.explorer.view = view
        assert shown(controls) == replace(view, case="")
        assert list(controls.rows()) == list(controls.explorer.view.osc.values)
        for value, low, high in controls.rows().values():
            assert low <= value <= high


def test_menus_tell_the_session_what_was_chosen(commands, controls):
    commands.run("choose samples 5000 1")
    commands.run("choose x mass 2")  # which was upwards: the two change places
    view = controls.explorer.view
    assert (view.samples, view.x, view.y) == (5000, "mass", "omega")
    commands.run("choose y mass 3")
    assert (controls.explorer.view.x, controls.explorer.view.y) == ("omega", "mass")


@pytest.mark.parametrize(("menu", "value"), [
    ("samples", "five"), ("samples", "²"), ("samples", "9" * 5000), ("index", "__class__"), ("line", ""),
])  # fmt: skip
def test_a_menu_with_a_value_that_it_does_not_offer_is_answered_and_put_back(commands, controls, heard, menu, value):
    before = controls.explorer.view
    commands.run(f"choose {menu} {value} 5")
    assert controls.explorer.view == before
    assert any(f"`{menu}` must be one of" in message for message in received(heard, "message"))
    assert heard[-1] == ("view", before)
    assert commands.last == 5
    assert chosen(controls, menu) == str(getattr(before, menu))


def test_axes_cases_and_starts_that_are_not_offered_change_nothing(commands, controls, heard):
    before = controls.explorer.view
    for text in ("choose x colour 1", "choose start ² 2", "choose start 17 3", "choose case model:../../etc 4",
                 "choose case nobody's 5", "choose colour red 6", "choose 7", "choose"):  # fmt: skip
        commands.run(text)
    assert controls.explorer.view == before
    assert heard[-1] == ("view", before)


def test_choosing_a_case_sets_everything_and_undo_takes_it_back(commands, controls):
    valve = BY_NAME["valve"]
    commands.run("choose case valve 1")
    assert controls.explorer.view == valve.view
    assert "Wu, Li and Deng" in controls.about()
    assert "Idealised:" in controls.about()
    assert controls.rows()["stiffness"] == (34590.0, 10_000.0, 150_000.0)
    assert controls.explorer.set_parameter("omega", 900.0)
    assert chosen(controls, "case") == "valve"
    assert controls.explorer.view.case == "valve"
    assert controls.explorer.undo()
    assert controls.explorer.undo()
    assert chosen(controls, "case") == "paper-mass"
    assert controls.rows()["stiffness"] == (1.0, 0.1, 5.0)


def test_a_system_has_menus_for_what_is_shown_of_it_and_one_mass_has_none(commands, controls):
    assert [controls.menus()[name].options for name in ("coordinate", "stop")] == [[], []]
    commands.run("choose case model:impact_pair 1")
    assert chosen(controls, "case") == "model:impact_pair"
    assert [label for _, label in controls.menus()["coordinate"].options] == ["towards the stop", "coordinate 1"]
    assert len(controls.menus()["stop"].options) == 3
    assert "all stops together" in controls.about()


def test_the_whole_plane_of_a_link_is_at_least_what_it_shows(controls):
    view = replace(MOVED, x="omega", x_range=(1.0, 20.0))
    controls.explorer.view = view
    controls.fit()
    assert controls.axis_range("omega") == (0.025, 20.0)
    controls.home()
    assert controls.explorer.view.x_range == (0.025, 20.0)


def test_the_start_in_the_menu_is_the_one_of_the_view(commands, controls):
    other = Attractor("periodic", 3, 4, share=0.14, max_velocity=1.0, start=vi.State(0.0, 1.5, 0.25))
    explorer = controls.explorer
    explorer.others = [other]
    assert controls.menus()["start"].options == [("rest", "at rest"), ("0", "on period-3 impact-4 (14 %)")]
    commands.run("choose start 0 1")
    assert explorer.view.start == other.start
    explorer.undo()
    assert chosen(controls, "start") == "rest"
    explorer.redo()
    explorer.others = [other]  # they were forgotten with the point
    assert chosen(controls, "start") == "0"
    explorer.others = []
    assert chosen(controls, "start") == "kept"


@pytest.fixture
def commands(controls, heard):
    return Commands(controls.explorer, controls, heard.append)


def test_a_typed_number_is_taken_as_typed_and_a_slid_one_with_the_digits_that_a_slider_tells_apart(commands, controls):
    commands.run("type mass 1.2345678901234567 0")
    assert controls.explorer.view.osc.mass == 1.2345678901234567
    commands.run("slide mass 1.2345678901234567 1")
    assert controls.explorer.view.osc.mass == 1.235  # a 2000th of 0.1 to 5 kg
    assert commands.last == 1
    for end in (0.025, 5.0):  # round numbers or not, the ends can be reached and not passed
        commands.run(f"slide omega {end} 2")
        assert controls.explorer.view.osc.omega == end
    commands.run("type omega 10 3")
    assert controls.rows()["omega"] == (10.0, 0.025, 10.0)
    commands.run("slide omega 9.98005 4")  # beyond its range a slider keeps the room that it has
    assert controls.rows()["omega"] == (9.98, 0.025, 10.0)
    commands.run("type omega 3 5")
    assert controls.rows()["omega"] == (3.0, 0.025, 5.0)


@pytest.mark.parametrize(
    "text", ["", "nan", "inf", "1e400", "1e300", "-1", "1,5", "1 5", "1_0", "١", "heavy", "9" * 5000]
)
def test_what_is_typed_and_no_mass_is_answered_and_put_back(commands, controls, heard, text):
    commands.run(f"type mass {text} 7")
    assert controls.explorer.view == View()
    (complaint,) = received(heard, "message")
    assert re.match("`mass` must (be|have) .*, got ", complaint)
    assert len(complaint) < 300
    assert heard[-1] == ("view", View())
    assert commands.last == 7


@pytest.mark.parametrize("text", [
    "", " ", "slide", "slide mass", "type 1", "slide colour 1 2", "slide __class__ 1 2", "slide mass heavy 3",
    "click 1 2", "click 1 2 three", "zoom 1 2 3", "undo now x", "view 1", "heard 5", "slide mass nan 3",
    "type mass 2 " + "9" * 5000,
])  # fmt: skip
def test_messages_that_the_page_does_not_send_change_nothing(commands, controls, text):
    commands.run(text)
    assert controls.explorer.view == View()


def test_every_key_does_what_the_help_says(commands, controls):
    explorer = controls.explorer

    def after(word):
        commands.run(f"{word} 1")
        assert controls.rows()  # as the page asks for them with every view
        return explorer.view

    assert after("right").osc.omega == pytest.approx(2.0 + (5.0 - 0.025) / 64, abs=1e-3)
    assert after("up").osc.mass == pytest.approx(1.0 + (5.0 - 0.1) / 64, abs=1e-3)
    assert (after("left").osc.omega, after("down").osc.mass) == pytest.approx((2.0, 1.0), abs=2e-3)
    low, high = after("in").x_range
    assert high - low == pytest.approx(0.5 * 4.975)
    assert after("out").x_range == pytest.approx((0.025, 5.0))
    assert after("motion").index == "motion"
    assert after("motion").index == "std"
    assert (after("log").log, after("boundaries").boundaries, after("line").line) == (True, True, "y")
    assert after("pin").pins == (explorer.view.osc,)
    assert after("unpin").pins == ()
    assert after("home").x_range == (0.025, 5.0)
    assert after("undo").x_range != (0.025, 5.0)
    assert after("redo").x_range == (0.025, 5.0)
    commands.run("along 2.5 2")
    assert explorer.view.osc.mass == 2.5


def test_the_kind_of_file_that_is_asked_for_is_passed_on(commands, heard):
    commands.run("export csv 3")
    assert heard == ["csv"]
