"""The explorer with models of several parameters, coordinates and stops: what it shows is what the package computes."""

import math
from dataclasses import replace
from urllib.request import urlopen

import numpy as np
import pytest

import vibroimpact as vi
from explorers import received
from vibroimpact.explorer.address import from_query, keys, ranges_for, to_query
from vibroimpact.explorer.limits import budget, stiffness
from vibroimpact.explorer.models import find_ready_made, finder, first_view, open_model, usual_range
from vibroimpact.explorer.plane import SIDES, TRANSIENT, lattice, sides
from vibroimpact.explorer.point import compute_point, index_text
from vibroimpact.explorer.session import Explorer
from vibroimpact.explorer.state import View, parameter_label, table
from vibroimpact.explorer.views import PointView
from vibroimpact.families import load_model, ready_made
from vibroimpact.indices import INDICES
from vibroimpact.plotting.views import view_of_page


@vi.family(units={"rpm": "1/min", "clearance_mm": "mm"})
def shaker(unbalance=0.002, rpm=1500.0, clearance_mm=0.5):
    omega = rpm * 2 * math.pi / 60
    if clearance_mm > 1.2:
        raise RuntimeError("the shaker has no room")
    force = unbalance * omega**2
    return vi.ImpactOscillator(
        mass=2.0, stiffness=3e4, damping=5.0, amplitude=force, omega=omega, gap=clearance_mm / 1e3
    )


def of(name):
    return first_view(find_ready_made(name), name)


@pytest.mark.parametrize("name", vi.models.__all__)
def test_every_ready_made_model_has_a_first_view_within_limits_that_its_address_tells(name):
    view = of(name)
    assert from_query(to_query(view)) == view
    assert view.osc.values == ready_made(name).values
    assert list(ranges_for(view)) == list(table(view.osc))
    for axis, ends in ((view.x, view.x_range), (view.y, view.y_range)):
        assert ends[0] <= view.osc.values[axis] <= ends[1]


def test_a_plane_lies_over_the_frequency_and_what_moves_a_stop():
    axes = {name: (of(name).x, of(name).y) for name in ("two_sided_oscillator", "idle_gear", "unbalanced_machine")}
    assert axes == {
        "two_sided_oscillator": ("frequency", "left_gap"), "idle_gear": ("rpm", "backlash"),
        "unbalanced_machine": ("rpm", "gap"),
    }  # fmt: skip
    view, find = open_model(shaker, "shaker.py:shaker")
    assert (view.x, view.y, view.model) == ("rpm", "clearance_mm", "shaker.py:shaker")
    assert from_query(to_query(view), find) == view


def test_a_link_holds_coordinate_stop_start_and_pins_of_a_system():
    view = of("tube_in_supports")
    view = replace(
        view, coordinate=2, stop=3, start=vi.State([1e-5, 0.0, 0.0], [0.01, 0.0, 1e-17], 0.25),
        pins=(view.osc.replace(frequency=21.0),), index="lyapunov", line="y",
    )  # fmt: skip
    assert from_query(to_query(view)) == view


def test_a_link_runs_no_file(tmp_path):
    (tmp_path / "evil.py").write_text("raise SystemExit('it ran')")
    with pytest.raises(ValueError, match="not known here; start the explorer with --model"):
        from_query(f"model={tmp_path}/evil.py:model")


def test_the_stop_and_the_coordinate_are_among_those_there_are():
    for part in ({"stop": 5}, {"coordinate": 4}):
        with pytest.raises(ValueError, match="the number available"):
            replace(of("tube_in_supports"), **part)
    with pytest.raises(ValueError, match="at most 1"):
        View(stop=2)


def test_a_slider_spans_a_decade_to_either_side_of_a_number_that_must_be_positive_and_all_of_a_bounded_range():
    view = of("bilinear_oscillator")
    reach = {name: usual_range(parameter, view.osc.values[name], view.system) for name, parameter in view.table.items()}
    assert reach["stop_stiffness"] == (1.2e4, 1.2e6)
    assert reach["frequency"] == (7.0 / 3.0, 21.0)
    assert reach["gap"] == (-1e-3, 3e-3)
    assert usual_range(vi.ImpactOscillator.parameters["restitution"], 0.8, None) == (0.0, 1.0)
    assert parameter_label(view.table["stop_stiffness"]) == "stiffness of the stop [N/m]"


@pytest.mark.parametrize("name", ["two_sided_oscillator", "tube_in_supports", "bouncing_ball"])
def test_the_motion_shown_of_a_system_stays_between_its_walls_and_touches_them_at_its_impacts(name):
    point = compute_point(of(name))
    time, y = point.history["time"], point.history["displacement"]
    for wall in point.shown.walls:
        room = wall.side * (point.shown.place(wall, time) - y)
        assert room.min() >= -1e-9 * np.abs(y).max()
    touched = point.places(point.impacts["stop"], point.impacts["time"])
    struck = ~np.isnan(touched)
    assert struck.any()
    at = np.searchsorted(time, point.impacts["time"][struck])
    assert y[at] == pytest.approx(touched[struck], abs=1e-12 * np.abs(y).max())


def test_the_numbers_of_a_point_are_those_of_parameter_map():
    view = of("two_sided_oscillator")
    point = compute_point(view)
    sweep = vi.parameter_map(
        view.osc, frequency=[view.osc.values["frequency"]], indices=tuple(INDICES), transient_impacts=TRANSIENT,
        sample_impacts=view.samples, tolerances=budget(stiffness(view.osc), TRANSIENT + view.samples),
    )  # fmt: skip
    for index in INDICES:
        assert point.indices[index] == pytest.approx(float(sweep[index][0]), nan_ok=True, rel=0.0)


def test_a_point_of_a_machine_without_a_driving_period_has_no_number_per_period():
    ends = [vi.Stop(direction=side, gap=1.0, restitution=1.0, name=name) for side, name in ((1, "up"), (-1, "down"))]
    fallen = vi.ImpactSystem(mass=1.0, stiffness=0.0, force=vi.Force(constant=-9.81), stops=ends)
    point = compute_point(first_view(fallen, "fallen"))
    assert point.indices["max_velocity"] > 1.0
    for index in ("impacts_per_period", "dissipation", "impact_phase_spread"):
        assert np.isnan(point.indices[index])
        assert index_text(point, index, 4) == "–"
    assert (point.n_periods, index_text(point, "n_periods", 4)) == (0, "no cycle")
    assert "period" not in point.sentence


def test_impacts_at_one_stop_are_part_of_those_at_all():
    view = of("two_sided_oscillator")
    each = [compute_point(replace(view, stop=stop)).impact_map["phase"] for stop in (0, 1, 2)]
    assert set(each[1]) | set(each[2]) >= set(each[0])
    assert not set(each[1]) & set(each[2])


def test_walls_are_the_stops_across_what_is_shown():
    system = ready_made("tube_in_supports").at()
    assert [(wall.name, wall.side) for wall in view_of_page(system, stop=3).walls] == [
        ("second_upper", 1),
        ("second_lower", -1),
    ]
    assert view_of_page(system, coordinate=1).walls == []
    ball = view_of_page(ready_made("bouncing_ball").at())
    assert ball.place(ball.walls[0], np.linspace(0.0, 0.02, 1000)).std() > 0.0  # its table moves


def test_lattices_hold_the_coarser_ones_also_those_of_systems():
    view = of("two_sided_oscillator")
    assert sides(view) == (16, 32, *SIDES)
    for coarse, fine in zip(sides(view), sides(view)[1:], strict=False):
        assert set(lattice(coarse)) < set(lattice(fine))


@pytest.mark.long
def test_a_system_is_explored_with_its_pins_diagram_and_undo(heard, monkeypatch):
    """Within the usual limit of a plane: all of this one takes a minute, many on a busy machine."""
    monkeypatch.setattr("vibroimpact.explorer.work.PLANE_SECONDS", 30.0)
    view = replace(of("two_sided_oscillator"), samples=200)
    explorer = Explorer(view, listener=heard.extend)
    explorer.start()
    explorer.pin()
    explorer.set_parameter("frequency", "26")
    explorer.set(stop=2)
    assert explorer.wait(300)
    kinds = {what for what, _ in heard}
    assert {"view", "point", "plane", "line", "pins", "others"} <= kinds
    assert explorer.plane.side in sides(view)
    assert len(explorer.pins) == 1
    for wanted in (0, 25.0):
        explorer.undo()
        assert wanted in (explorer.view.stop, explorer.view.osc.values["frequency"])
    shown_point, pinned = PointView(), PointView()
    shown_point.show_point(explorer.pins[0])
    pinned.show_pins(explorer.pins)
    explorer.close()


def test_a_combination_that_raises_is_refused_with_its_place_and_the_page_goes_on(heard):
    explorer = Explorer(open_model(shaker, "shaker")[0], listener=heard.extend)
    assert explorer.view.y_range[1] == pytest.approx(1.2, rel=1e-3)  # as far as it can be made
    before = explorer.view
    assert not explorer.set_parameter("clearance_mm", 1.3)
    (message,) = received(heard, "message")
    assert "shaker fails at" in message
    line = shaker.function.__code__.co_firstlineno + 4
    assert f"RuntimeError: the shaker has no room (test_explorer_models.py, line {line})" in message
    assert explorer.view == before
    assert explorer.set_parameter("clearance_mm", 0.6)
    explorer.close()


FAMILY = "import vibroimpact as vi\n\n@vi.family\n"
REFUSED = {
    "import math\nraise KeyError('x')\n": r"KeyError: 'x' \(mine.py, line 2\)",
    "def shaker(:\n": r"SyntaxError: .* \(mine.py, line 1\)",
    "\n\ndef shaker(a=1.0):\n    return a\n": r"is a function; write @vibroimpact.family .*\(mine.py, line 3\)",
    FAMILY + "def shaker(a):\n    return vi.ImpactOscillator(gap=a)\n": r"needs a number .*\(mine.py, line 3\)",
    FAMILY + "def shaker(a=1.0):\n    return a\n": r"a model, got 1.0; .* \(mine.py, line 3\)",
    FAMILY + "def other(a=1.0):\n    return vi.ImpactOscillator(gap=a)\n": r"choose from other; these are in mine.py",
}


@pytest.mark.parametrize(("text", "words"), REFUSED.items())
def test_a_model_file_is_refused_in_one_line_that_tells_its_own(tmp_path, monkeypatch, text, words):
    monkeypatch.setattr("sys.path", [*__import__("sys").path])
    (tmp_path / "mine.py").write_text(text)
    with pytest.raises(ValueError, match=words) as refused:
        load_model(f"{tmp_path}/mine.py:shaker")
    assert "\n" not in str(refused.value)


def test_a_model_of_ones_own_is_found_by_its_name_and_ready_made_ones_too():
    find = finder("mine.py:shaker", shaker)
    assert find("mine.py:shaker") is shaker
    assert find("bouncing_ball") == ready_made("bouncing_ball")
    assert find("") == vi.ImpactOscillator()


def test_symbols_that_an_address_needs_for_itself_are_no_keys():
    @vi.family
    def odd(x=1.0, start=2.0, gap=0.1):
        return vi.ImpactOscillator(omega=x, amplitude=start, gap=gap)

    assert list(keys(table(odd))) == ["x_", "start_", "gap"]


def test_a_notebook_has_the_page_below_its_cell_and_no_other_site_has():
    pytest.importorskip("tornado", reason="needs the extra [web]")
    from vibroimpact.explorer.notebook import address_of

    address = address_of(shaker)
    with urlopen(address, timeout=300) as answer:
        assert answer.headers["Content-Security-Policy"].startswith("frame-ancestors http://localhost:* ")
        assert b'id="parameters"' in answer.read()
    with pytest.raises(ValueError, match="`model` must be"):
        address_of(3.0)
