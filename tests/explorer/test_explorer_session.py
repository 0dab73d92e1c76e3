"""The explorer without its page: what is computed when, what is not, and what stops."""

import json
import re
import threading
import time
import tomllib
from dataclasses import replace

import numpy as np
import pytest

import vibroimpact as vi
from explorers import SMALL, filled, received
from processes import until
from vibroimpact.backends.cpu import CpuBackend
from vibroimpact.coexistence import Attractor
from vibroimpact.explorer.files import KINDS, export, python_lines, study_file
from vibroimpact.explorer.limits import FINEST, budget
from vibroimpact.explorer.plane import OTHERS, SIDES, TRANSIENT, Curves, Plane, bands, find_curves, lattice, positions
from vibroimpact.explorer.point import compute_point
from vibroimpact.explorer.session import Explorer
from vibroimpact.explorer.shades import name_of, shades
from vibroimpact.explorer.state import View
from vibroimpact.explorer.views import PlaneView, PointView, one_turn
from vibroimpact.explorer.work import Pool, Urgency
from vibroimpact.indices import INDICES
from vibroimpact.motion import MotionClass
from vibroimpact.plotting.style import BOUNDARY_COLORS, STICKING

TUBE = vi.ImpactOscillator(
    mass=2.1, damping_ratio=0.01, stiffness=26860.0, amplitude=5.0, omega=157.08, restitution=0.7, gap=0.5e-3
)
BOUNCING = Attractor("periodic", 1, 1, share=0.88, max_velocity=0.105)
KNOCKS = View(osc=TUBE, x="omega", x_range=(60.0, 220.0), y="gap", y_range=(1e-4, 1.5e-3), samples=200)


@pytest.fixture
def explorer(heard):
    made = Explorer(SMALL, listener=heard.extend)
    yield made
    made.close()


def test_each_cell_is_computed_once_and_all_are():
    counts = np.zeros((FINEST, FINEST), int)
    for side in SIDES:
        for columns, rows in bands(side):
            counts[np.ix_(columns, rows)] += 1
        inner = lattice(side)
        assert (counts[np.ix_(inner, inner)] == 1).all()
        assert counts.sum() == side * side
    assert (counts == 1).all()


def test_cells_are_those_of_parameter_map_and_come_coarse_first_and_then_finer(explorer, heard):
    explorer.start()
    assert explorer.wait(300)
    plane, kinds = explorer.plane, [what for what, _ in heard]
    assert plane.side == FINEST
    assert kinds.count("plane") == len(SIDES)
    assert kinds.index("point") < kinds.index("plane") or kinds.count("point") == 1
    cells = np.array([0, 77, 255])
    sweep = vi.parameter_map(
        SMALL.osc, omega=positions(1.8, 2.2, cells), mass=positions(0.9, 1.1, cells), indices=["std", "lyapunov"],
        sample_impacts=200,
    )  # fmt: skip
    for name in ("std", "lyapunov"):
        assert (plane.values[name][np.ix_(cells, cells)] == sweep[name].values).all()


@pytest.mark.long
def test_a_click_tells_a_motion_and_leaves_the_plane_alone(explorer, heard):
    explorer.start()
    assert explorer.wait(300)
    plane = explorer.plane
    heard.clear()
    assert explorer.click(2.1, 1.05)
    explorer.wait(300)
    assert explorer.click(2.0, 1.0)
    explorer.wait(300)
    other, point = received(heard, "point")
    assert other.osc.omega == 2.1
    assert point.name == "period-1 impact-1"
    assert "largest impact velocity 6.23 m/s once per period" in point.sentence
    assert not received(heard, "plane")
    assert explorer.plane is plane


def test_where_the_point_went_and_its_motion_are_told_together():
    together = []
    explorer = Explorer(SMALL, listener=together.append)
    explorer.click(2.1, 1.05)
    assert explorer.wait(300)
    explorer.close()
    (first, *_) = [received for received in together if received[0][0] == "view"]
    assert [what for what, _ in first] == ["view", "point"]
    assert first[0][1].osc == first[1][1].osc


def test_what_is_told_last_is_the_view_as_it_is():
    heard = []
    explorer = Explorer(SMALL, listener=heard.extend)
    for change in ({"index": "motion"}, {"line": "y"}, {"boundaries": True}, {"pins": (SMALL.osc,)}):
        explorer.click(1.9 if explorer.view.osc.omega != 1.9 else 2.1, 1.0)
        explorer.set(**change)  # while the motion there is computed
        until(lambda: explorer.point is not None)
        assert received(heard, "view")[-1] == explorer.view
    explorer.close()


def test_only_cells_that_stick_have_the_colour_of_sticking():
    picture = shades(filled(View(index="lyapunov")))
    assert ((np.array(picture.colors)[picture.number] == STICKING) == np.isneginf(picture.value)).all()


@pytest.mark.parametrize("index", ["n_periods", "n_impacts", "motion"])
def test_no_impact_chaos_and_every_count_have_colours_of_their_own(index):
    plane = filled(View(osc=TUBE, x="omega", x_range=(60.0, 220.0), y="gap", y_range=(1e-4, 1.5e-3), index=index))
    picture, kinds = shades(plane), plane.array("motion").T
    of = {kind: set(picture.number[kinds == kind]) for kind in MotionClass if (kinds == kind).any()}
    assert {MotionClass.NO_IMPACT, MotionClass.PERIODIC, MotionClass.CHAOTIC} <= set(of)
    assert sum(map(len, of.values())) == len(set().union(*of.values()))  # none in common
    assert len(set(picture.colors)) == len(picture.colors) == len(picture.legend)
    assert picture.number.max() < len(picture.colors)


def test_cells_without_a_value_say_why():
    plane = filled(View(osc=TUBE, x="omega", x_range=(60.0, 220.0), y="gap", y_range=(-5e-4, 1.5e-3)))
    picture, status = shades(plane), plane.array("status").T
    words = {text: color for color, text in picture.legend}
    assert set(words) == {"no impact from rest", "impacts cease after a transient", "permanently in contact"}
    for code, text in zip((4, 5, 6), words, strict=True):
        assert ((np.array(picture.colors)[picture.number] == words[text]) == (status == code)).all()


@pytest.mark.long
def test_what_has_no_impact_from_rest_is_hatched_where_others_of_16_hit(heard):
    explorer = Explorer(KNOCKS, listener=heard.extend)
    explorer.start()
    assert explorer.wait(300)
    kinds, plane = [what for what, _ in heard], explorer.plane
    assert plane.tried
    assert kinds.count("hatch") == 2  # when it begins, and when it ends
    assert kinds.index("hatch") > max(at for at, kind in enumerate(kinds) if kind == "plane")
    quiet = plane.values["motion"] == MotionClass.NO_IMPACT
    assert (np.isfinite(plane.elsewhere) == quiet).all()
    assert 0.1 < (plane.elsewhere[quiet] > 0.0).mean() < 0.5
    rng = np.random.default_rng(13)
    at = rng.permutation(np.argwhere(quiet))[:200]
    points = {"omega": positions(60.0, 220.0, at[:, 0]), "gap": positions(1e-4, 1.5e-3, at[:, 1])}
    sweep = vi.parameter_map(
        TUBE, points=points, start=OTHERS + 1, indices=["max_velocity"], sample_impacts=200,
        tolerances=budget(KNOCKS.stiffness, 300),
    )  # fmt: skip
    assert not (sweep["max_velocity"].isel(start=0) > 0.0).any()
    assert ((sweep["max_velocity"].max("start") > 0.0) == (plane.elsewhere[tuple(at.T)] > 0.0)).all()
    explorer.set(index="motion")
    assert explorer.wait(300)
    assert [what for what, _ in heard].count("hatch") == 2  # the cells are the same
    explorer.close()


def test_the_worst_of_17_initial_conditions_is_that_of_figures_and_motions_stay_those_from_rest():
    view = replace(KNOCKS, worst=True)
    plane, cells = Plane.unknown(view), np.arange(0, 256, 37)
    assert plane.fill(cells, cells, lambda: True)
    plane.side = 256
    axes = {view.x: plane.axis("x")[cells], view.y: plane.axis("y")[cells]}
    several = vi.parameter_map(
        TUBE, start=17, transient_impacts=TRANSIENT, sample_impacts=200, tolerances=budget(view.stiffness, 300),
        indices=tuple(INDICES), **axes,
    )  # fmt: skip
    rest = several.isel(start=0)
    coarse = np.ix_(cells, cells)
    worse = 0
    for name in ("std", "max_velocity", "lyapunov", "grazing_margin"):
        worst = several[name].min("start") if name == "grazing_margin" else several[name].max("start")
        np.testing.assert_array_equal(plane.values[name][coarse], worst.values)
        worse += int(((worst != rest[name]) & worst.notnull()).sum())
    assert worse > 20
    np.testing.assert_array_equal(plane.values["n_periods"][coarse], rest["n_periods"].values)
    np.testing.assert_array_equal(plane.values["motion"][coarse], vi.classify(rest)["motion"].values)
    head = PlaneView().show_plane(plane)["#plane-head"]["html"]
    assert "worst of 17 initial conditions" in head
    plane.view = replace(view, index="motion")
    assert "worst" not in PlaneView().show_plane(plane)["#plane-head"]["html"]


def test_the_page_hatches_a_plane_until_there_is_another_one():
    drawn, plane, other = PlaneView(), Plane.unknown(View()), Plane.unknown(View())

    def hatched(parts):
        return parts["hatch"]["side"], parts["#hatch"]["html"]

    side, words = hatched(drawn.show_hatch(plane))
    assert side == 0
    assert "16 other initial conditions are being tried in grey cells" in words
    plane.tried = True
    side, words = hatched(drawn.show_hatch(plane))
    assert side == 0
    assert "16 other initial conditions tried in grey cells: no impacts" in words
    plane.elsewhere[3, 5], plane.tried = 0.5, False
    assert "(16 tried), not in all" in hatched(drawn.show_hatch(plane))[1]
    plane.tried = True
    side, words = hatched(drawn.show_hatch(plane))
    assert side == FINEST
    assert "no impact from rest; impacts from other initial conditions (16 tried)" in words
    plane.side = other.side = SIDES[0]
    assert "hatch" not in drawn.show_plane(plane)
    assert hatched(drawn.show_plane(other)) == (0, "")


def test_boundaries_have_the_colours_that_they_have_in_figures():
    kinds = ["grazing", "fold", "grazing"]
    drawn = PlaneView()
    parts = drawn.show_curves(Curves([np.zeros((2, 2))] * 3, kinds, kinds))
    assert parts["curves"]["colors"] == [BOUNDARY_COLORS[kind] for kind in kinds]
    named = [kind for kind, (color, _) in BOUNDARY_COLORS.items() if parts["#boundaries"]["html"].count(color) == 1]
    assert named == ["fold", "grazing"]


def test_a_boundary_says_which_motion_ends_there():
    view = View(osc=vi.ImpactOscillator(damping=0.1), x="gap", x_range=(0.5, 3.0), y="amplitude", y_range=(0.5, 3.0))
    assert "grazing, the motion without impacts" in find_curves(view, lambda: True).descriptions


@pytest.fixture
def runs(monkeypatch):
    """How often the engine ran."""
    counts = {"follow": 0, "samples": 0, "share": 0, "indices": 0}
    for name in counts:
        ask = getattr(CpuBackend, name)

        def counted(*arguments, name=name, ask=ask):
            counts[name] += 1
            return ask(*arguments)

        monkeypatch.setattr(CpuBackend, name, counted)
    return counts


ON_AN_IMPACT = vi.State(0.0, 1.2, 0.3 * np.pi)


@pytest.mark.parametrize("osc", [
    *(vi.ImpactOscillator(omega=omega) for omega in (2.0, 2.661, 0.1, 2.8)),
    vi.ImpactOscillator(gap=9.0, omega=3.0, damping=0.1), vi.ImpactOscillator(gap=-2.0), vi.ImpactOscillator(omega=0.6),
], ids=["periodic", "period 2", "sticking", "chaotic", "no impact", "rests for ever", "chaotic, slow"])  # fmt: skip
@pytest.mark.parametrize("start", [None, vi.State(-0.5, 0.2, 1.7), ON_AN_IMPACT], ids=["from rest", "off", "on"])
@pytest.mark.parametrize("settled", [True, False], ids=["settled", "from the start"])
def test_a_click_runs_the_engine_once(runs, osc, start, settled):
    """Indices, sections, history and rests come from one run of one orbit, wherever the history begins."""
    start = start and replace(start, displacement=min(osc.gap, start.displacement))
    point = compute_point(View(osc=osc, x="gap", x_range=(osc.gap, 10.0), start=start, settled=settled))
    assert runs == {"follow": 1, "samples": 0, "share": 0, "indices": 0}
    assert len(point.history["time"]) > 1000
    if point.name == "chaotic":
        assert len(point.impact_map["phase"]) == 800


@pytest.mark.parametrize("osc", [
    vi.ImpactOscillator(omega=12.0, mass=5.0),  # an impact in some periods
    vi.ImpactOscillator(omega=0.077, damping=50.0, restitution=1.0),  # many steps per period
])  # fmt: skip
def test_an_orbit_goes_on_where_its_record_is_too_short(runs, osc):
    view = View(osc=osc, x="amplitude", x_range=(0.5, 1.5), y="stiffness", y_range=(0.9, 1.1))
    point = compute_point(view)
    assert (runs["follow"], runs["samples"]) == (1, 1)
    assert point.settled
    assert len(point.impact_map["phase"]) == 800
    assert osc.omega > 1.0 or point.history["displacement"][0] == osc.gap


@pytest.mark.parametrize("start", [None, vi.State(-0.5, 0.2, 1.7), vi.State(-0.5, 0.2, 0.0), ON_AN_IMPACT])
def test_a_history_from_the_start_is_what_is_simulated_from_there(start):
    osc = vi.ImpactOscillator(omega=2.0)
    history = compute_point(View(osc=osc, start=start, settled=False)).history
    orbit = vi.simulate(osc, start=start, periods=40, samples_per_period=60)
    assert history["time"][0] == orbit["time"][0]
    assert history["time"][-1] == pytest.approx(orbit["time"][-1].item(), abs=osc.period / 60)
    if start is not None:
        assert (history["displacement"][0], history["velocity"][0]) == (start.displacement, start.velocity)
    shared = orbit.sel(time=slice(None, history["time"][-1]))
    between = np.interp(shared["time"], history["time"], history["displacement"])
    assert np.abs(between - shared["displacement"].values).max() < 0.002 * np.ptp(shared["displacement"].values)


@pytest.mark.parametrize(("osc", "n"), [
    (vi.ImpactOscillator(), 1), (vi.ImpactOscillator(omega=2.661), 2), (vi.ImpactOscillator(omega=0.25), 1),
])  # fmt: skip
def test_the_portrait_of_a_cycle_is_one_turn_that_comes_back_to_where_it_began(osc, n):
    point = compute_point(View(osc=osc))
    assert point.n_periods == n
    turn = one_turn(point)
    time, places = point.history["time"], np.column_stack([point.history["displacement"], point.history["velocity"]])
    assert time[turn - 2] - time[0] == pytest.approx(n * osc.period, rel=0.1)
    assert turn < len(time) / 3
    apart = np.abs(places[turn:, None] - places[None, :turn]).max(axis=2).min(axis=1)  # to the nearest of the turn
    steps = np.abs(np.diff(places[:turn], axis=0)).max()
    assert apart.max() <= steps


@pytest.mark.parametrize("change", [
    {}, {"omega": 2.8}, {"omega": 0.1}, {"gap": -1.5}, {"gap": 9.0, "omega": 3.0, "damping": 0.1}, {"amplitude": 0.0},
])  # fmt: skip
def test_a_point_and_its_cell_have_the_same_name(change):
    at = np.array([128])
    view = View(
        osc=vi.ImpactOscillator(**change), x="restitution", x_range=(0.7, 0.9), y="stiffness", y_range=(0.9, 1.1)
    )
    plane = Plane.unknown(view)
    assert plane.fill(at, at, lambda: True)
    plane.side = FINEST
    (x,), (y,) = positions(0.7, 0.9, at), positions(0.9, 1.1, at)
    there = replace(view, osc=view.osc.replace(restitution=x, stiffness=y))
    assert name_of(shades(plane).name[128, 128]) == compute_point(there).name


def test_the_impact_map_of_a_slow_cycle_has_its_impacts():
    """One impact per period, and fewer periods than impacts are usually left out."""
    point = compute_point(View(osc=vi.ImpactOscillator(omega=0.06, damping=0.5, restitution=0.0)))
    assert point.name == "period-1 sticking"
    assert len(point.impact_map["velocity"]) >= 1
    assert np.ptp(point.impact_map["velocity"]) < 1e-9


def test_the_portrait_of_chaos_or_of_a_beginning_is_all_of_the_history():
    longer = View(osc=vi.ImpactOscillator(omega=2.903))  # 42 periods, of which the history shows 40
    for view in (View(osc=vi.ImpactOscillator(omega=0.6)), View(settled=False), longer):
        point = compute_point(view)
        assert one_turn(point) == len(point.history["time"])


def test_changing_the_index_computes_nothing(explorer, heard):
    explorer.start()
    assert explorer.wait(300)
    before = explorer.plane.values["std"].copy()
    heard.clear()
    explorer.set(index="lyapunov")
    explorer.set(index="motion")
    assert [plane.side for plane in received(heard, "plane")] == [FINEST, FINEST]
    assert (explorer.plane.values["std"] == before).all()


def test_a_change_cancels_what_runs(heard):
    slow = View(osc=vi.ImpactOscillator(restitution=0.99), samples=5000)
    explorer = Explorer(slow, listener=heard.extend)
    explorer.start()
    time.sleep(0.1)
    explorer.show(SMALL)
    until(lambda: received(heard, "plane"))
    first = received(heard, "plane")[0]
    assert first.view.x_range == SMALL.x_range
    explorer.close()


def test_closing_stops_all_work(heard):
    explorer = Explorer(View(osc=vi.ImpactOscillator(restitution=0.99), samples=5000), pool=(pool := Pool()))
    explorer.start()
    time.sleep(0.05)
    explorer.close()
    assert explorer.wait(300)
    assert not pool.queued
    pool.close()


def test_what_is_refused_is_told_and_changes_nothing(explorer, heard):
    assert not explorer.set_parameter("restitution", 2.0)
    assert not explorer.set_parameter("mass", None)
    assert not explorer.set_parameter("omega", 1e9)
    assert not explorer.set(index="os.system")
    assert not explorer.click(float("nan"), 1.0)
    assert explorer.view == SMALL
    assert len(received(heard, "message")) == 5
    assert all("must be" in message for message in received(heard, "message"))


def test_undo_and_redo_walk_through_views(explorer):
    first = explorer.view
    explorer.set(index="motion")
    explorer.click(2.1, 1.0)
    last = explorer.view
    assert explorer.undo()
    assert explorer.view == replace(first, index="motion")
    assert explorer.undo()
    assert explorer.view == first
    assert not explorer.undo()
    assert explorer.redo()
    assert explorer.redo()
    assert explorer.view == last


def test_one_drag_of_a_slider_is_undone_at_once(explorer):
    for value in np.linspace(0.01, 0.05, 9):
        explorer.set_parameter("damping", float(value))
    assert explorer.undo()
    assert explorer.view == SMALL


def test_two_pins_are_kept_and_the_older_one_goes(explorer):
    for omega in (1.9, 2.0, 2.1):
        explorer.click(omega, 1.0)
        explorer.pin()
    assert [pin.omega for pin in explorer.view.pins] == [2.0, 2.1]
    explorer.wait(300)
    assert [point.osc.omega for point in explorer.pins] == [2.0, 2.1]


def test_coexisting_motions_are_found_and_can_be_followed(explorer):
    explorer.show(replace(SMALL, osc=vi.ImpactOscillator(omega=1.45), x_range=(1.4, 1.5)))
    assert explorer.wait(300)
    assert {other.name for other in explorer.others} == {"period-1 impact-1", "period-3 impact-4"}
    rare = next(other for other in explorer.others if other.name == "period-3 impact-4")
    explorer.follow(rare)
    assert explorer.wait(300)
    assert explorer.point.name == "period-3 impact-4"


def test_what_other_initial_conditions_lead_to_is_told_with_their_number():
    shown = PointView()

    def told(osc, *others):
        shown.show_point(compute_point(View(osc=osc, x="damping", x_range=(0.0, 20.0), y="mass", y_range=(0.9, 5.0))))
        parts = shown.show_others(list(others))
        return re.sub("<[^>]*>", "", parts["#others"]["html"])

    same = replace(BOUNCING, share=1.0, max_velocity=compute_point(View()).indices["max_velocity"])
    assert told(vi.ImpactOscillator(), same) == "All 256 other initial conditions tried lead to this motion."
    everywhere = replace(BOUNCING, share=1.0)  # though nothing hits from rest
    assert told(TUBE, everywhere) == "From 256 other initial conditions: 100 % period-1 impact-1 (up to 0.105 m/s)."
    clear = Attractor("no_impact", share=0.1)
    several = BOUNCING, clear, replace(BOUNCING, n_periods=3, share=0.0, max_velocity=0.002)
    assert told(TUBE, *several) == (
        "From 256 other initial conditions: 88 % period-1 impact-1 (up to 0.105 m/s), 10 % no impact, "
        "none period-3 impact-1 (up to 2 mm/s), 2 % undecided."
    )


def test_the_history_shows_both_sides_of_every_impact_and_never_passes_the_stop():
    for omega in (0.1, 0.9, 2.0, 2.8):
        point = compute_point(View(osc=vi.ImpactOscillator(omega=omega)))
        assert (np.diff(point.history["time"]) >= 0.0).all()
        assert point.history["displacement"].max() <= 1e-12
        at_stop = point.history["displacement"] == 0.0
        assert point.history["velocity"][at_stop].max() == point.impacts["velocity"].max()


@pytest.mark.parametrize(
    ("osc", "words"),
    [
        (vi.ImpactOscillator(omega=2.0), ("From rest: period-1 impact-1", "stable", "once per period")),
        (vi.ImpactOscillator(omega=0.1), ("sticking", "at rest at the stop")),
        (vi.ImpactOscillator(omega=2.8), ("Chaotic over 1100 impacts", "perturbations double")),
        (
            vi.ImpactOscillator(gap=9.0, omega=3.0, damping=0.1),
            ("From rest: no impact", "steady amplitude of 0.125 m", "gap of 9 m"),
        ),
        (vi.ImpactOscillator(gap=-2.0), ("permanently in contact", "stop")),
        (vi.ImpactOscillator(amplitude=1e-6), ("largest impact velocity", "µm/s")),
    ],
)
def test_a_sentence_tells_the_motion(osc, words):
    sentence = compute_point(View(osc=osc, x="damping", x_range=(0.0, 0.2), samples=1000)).sentence
    for word in words:
        assert word.lower() in sentence.lower()


def test_no_allowed_point_takes_long():
    """The slowest corners of what is allowed, each well below a second."""
    for osc in (
        vi.ImpactOscillator(omega=99.0, gap=-1.0, amplitude=1e3), vi.ImpactOscillator(omega=0.0011),
        vi.ImpactOscillator(damping=190.0), vi.ImpactOscillator(restitution=1.0, damping=0.0, omega=3.3),
        vi.ImpactOscillator(amplitude=0.0, gap=-1.0, restitution=1.0),
        vi.ImpactOscillator(restitution=0.0), vi.ImpactOscillator(omega=90.0, restitution=0.999, damping=0.0),
    ):  # fmt: skip
        view = View(osc=osc, x="gap", x_range=(-1.0, 1.0), y="amplitude", y_range=(1.0, 2.0))
        begun = time.process_time()
        compute_point(view)
        assert time.process_time() - begun < 10.0


def test_colours_have_room_for_every_value():
    plane = Plane.unknown(View(x_range=(0.1, 5.0)))
    for columns, rows in bands(SIDES[0]):
        assert plane.fill(columns[:8], rows[:4], lambda: True)
    plane.side = SIDES[0]
    for index in ("motion", "std", "lyapunov", "n_periods", "grazing_margin", "stick_fraction"):
        for log in (False, True):
            plane.view = replace(plane.view, index=index, log=log)
            picture = shades(plane)
            assert picture.number.dtype == np.uint16
            assert picture.number.max() < len(picture.colors)
            assert picture.high > picture.low
            assert picture.number.shape == picture.value.shape == picture.name.shape == (64, 64)


def test_the_page_that_waited_longest_is_served_first():
    pool, order, gate = Pool(1), [], threading.Event()
    pool.submit("a", Urgency.FINE, gate.wait)
    time.sleep(0.05)
    for _ in range(3):
        pool.submit("a", Urgency.FINE, lambda: order.append("a"))
    for _ in range(3):
        pool.submit("b", Urgency.FINE, lambda: order.append("b"))
    gate.set()
    until(lambda: len(order) == 6)
    assert order == ["b", "a", "b", "a", "b", "a"]
    pool.close()


def test_a_job_that_fails_is_told_and_stops_nothing(explorer, heard):
    explorer.run("bad", lambda: 1 / 0)
    assert explorer.wait(300)
    assert "could not be computed" in received(heard, "message")[0]
    explorer.click(2.1, 1.0)
    assert explorer.wait(300)
    assert received(heard, "point")


def test_exports_hold_the_view(explorer, tmp_path):
    explorer.start()
    assert explorer.wait(300)
    files = {kind: export(kind, explorer) for kind in KINDS}
    (tmp_path / "plane.nc").write_bytes(files["nc"].content)
    loaded = vi.load(tmp_path / "plane.nc")
    assert loaded["std"].dims == ("omega", "mass")
    assert json.loads(loaded.attrs["oscillator"])["omega"] == 2.0
    assert vi.classify(loaded)["motion"].equals(vi.classify(explorer.plane.dataset())["motion"])
    study = tomllib.loads(files["toml"].content.decode())
    assert study["axes"]["omega"]["points"] == FINEST
    assert files["csv"].content.count(b"\n") > 1000


def test_the_study_file_is_one_that_the_command_reads(tmp_path):
    from vibroimpact.cli.study import make_study

    assert make_study(tomllib.loads(study_file(SMALL))).axes
    assert make_study(tomllib.loads(study_file(replace(SMALL, worst=True)))).settings["starts"] == 17


@pytest.mark.long
@pytest.mark.parametrize("change", [{"index": "motion"}, {"index": "std", "worst": True}], ids=["motion", "worst"])
def test_the_python_lines_run(tmp_path, monkeypatch, change):
    monkeypatch.chdir(tmp_path)
    lines = python_lines(replace(SMALL, **change)).replace(f", {FINEST})", ", 6)")
    exec(compile(lines.replace("print(vi.describe(osc))", ""), "view.py", "exec"), {})
    assert {path.name for path in tmp_path.iterdir()} == {
        "plane.png", "history.png", "portrait.png", "impact_map.png", "poincare_map.png"
    }  # fmt: skip
