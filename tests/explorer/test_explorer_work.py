"""Many pages on few threads: what is cancelled, what is cut short and said so, and who is served when."""

import gc
import os
import queue
import sys
import threading
import time
import weakref
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import vibroimpact as vi
from explorers import SMALL, received
from processes import until
from vibroimpact.explorer import plane, session, work
from vibroimpact.explorer.files import export
from vibroimpact.explorer.limits import FINEST, budget
from vibroimpact.explorer.plane import SIDES, Plane, bands, compute_line, find_curves
from vibroimpact.explorer.point import find_others
from vibroimpact.explorer.session import Explorer
from vibroimpact.explorer.state import View
from vibroimpact.explorer.work import NICE, Clock, Pool, Urgency
from vibroimpact.kernels.shared.claims import claim_what_is_missing


@pytest.fixture
def pool():
    made = Pool(1)
    yield made
    made.close()


@pytest.fixture
def explorer(heard, pool):
    made = Explorer(SMALL, pool, listener=heard.extend)
    yield made
    made.close()


@pytest.fixture
def no_rest(monkeypatch):
    monkeypatch.setattr(session, "OTHERS_DELAY", 0.0)
    monkeypatch.setattr(session, "LINE_DELAY", 0.0)


def test_while_pages_are_open_a_motion_waits_for_no_search_each_time_it_comes_back_from_a_kernel():
    """A thread in Python gives way after 5 ms by default; a motion calls tens of kernels."""
    usual = sys.getswitchinterval()  # pools of other tests may be open
    sys.setswitchinterval(0.005)
    pool = Pool(1)
    assert sys.getswitchinterval() <= 1e-4
    pool.close()
    assert sys.getswitchinterval() == pytest.approx(0.005)
    sys.setswitchinterval(usual)


@pytest.mark.skipif(sys.platform != "linux", reason="only on Linux do threads have their own niceness")
def test_what_a_thread_of_low_priority_needs_is_compiled_at_the_full_one(pool):
    """On a busy machine the motion of a click, too, waited minutes for what a plane had begun to compile."""
    niceness, told = [], queue.Queue()

    class Alone:
        """Stands for a kernel that is compiled in a thread begun by one of the pool's, as maps begin some."""

        _cache = SimpleNamespace(load_overload=None, _py_func=vi.simulate)

        def compile(self, signature):
            niceness.append(os.getpriority(os.PRIO_PROCESS, threading.get_native_id()))

    kernel = Alone()
    claim_what_is_missing(kernel, "", ("nothing", 0.0, ""))

    def work():
        thread = threading.Thread(target=kernel.compile, args=("signature",))
        thread.start()
        thread.join()
        told.put(os.getpriority(os.PRIO_PROCESS, threading.get_native_id()))

    pool.submit(None, Urgency.FINE, work)
    usual = os.getpriority(os.PRIO_PROCESS, threading.get_native_id())
    assert told.get(timeout=300) == min(usual + NICE, 19)
    assert niceness == [usual]


class Endless:
    """Stands for a search that stops only when its progress callback says so."""

    def __init__(self, monkeypatch, name):
        self.begun, self.stopped, self.oscillators = threading.Event(), threading.Event(), []
        monkeypatch.setattr(vi, name, self)

    def __call__(self, osc, *args, progress, **options):
        self.oscillators.append(osc)
        self.begun.set()
        while progress(0, 10, None) is not False:
            time.sleep(0.002)
        self.stopped.set()
        return []


@pytest.mark.parametrize(("name", "kind", "begin", "change"), [
    *(("attractors", "others", lambda page: page.click(2.05, 1.0), change) for change in (
        lambda page: page.click(2.1, 1.0), lambda page: page.set_parameter("damping", 0.02), lambda page: page.close(),
        lambda page: page.undo())),
    *(("boundary_curves", "curves", lambda page: page.set(boundaries=True), change) for change in (
        lambda page: page.zoom((1.9, 2.0), (1.0, 1.1)), lambda page: page.close(),
        lambda page: page.set(boundaries=False))),
])  # fmt: skip
def test_a_search_stops_when_the_point_or_the_plane_that_it_is_for_changes(
    explorer, heard, monkeypatch, no_rest, name, kind, begin, change
):
    search = Endless(monkeypatch, name)
    assert begin(explorer)
    assert search.begun.wait(300)
    heard.clear()
    change(explorer)
    assert search.stopped.wait(300)
    assert not any(received(heard, kind))


def test_the_search_for_coexisting_motions_goes_on_when_only_colours_change(explorer, monkeypatch, no_rest):
    search = Endless(monkeypatch, "attractors")
    explorer.click(2.05, 1.0)
    assert search.begun.wait(300)
    explorer.set(index="motion")
    explorer.pin()
    assert not search.stopped.wait(0.1)


@pytest.mark.long
def test_hatching_stops_when_the_plane_changes(explorer, heard, monkeypatch):
    begun, stopped = threading.Event(), threading.Event()

    def endless(self, places, keep_going):
        begun.set()
        while keep_going():
            time.sleep(0.002)
        stopped.set()
        return False

    monkeypatch.setattr(Plane, "quiet", lambda self: [np.zeros((1, 2), int)])
    monkeypatch.setattr(Plane, "try_others", endless)
    explorer.start()
    assert begun.wait(300)
    (first,) = received(heard, "hatch")
    assert first.tried is None
    explorer.zoom((1.9, 2.0), (1.0, 1.1))
    assert stopped.wait(300)
    assert first.tried is None
    assert explorer.plane is not first


def test_hatching_that_is_cut_short_says_so(explorer, heard, monkeypatch):
    def no_time(self):
        monkeypatch.setattr(work, "PLANE_SECONDS", 0.0)
        return [np.zeros((1, 2), int)]

    monkeypatch.setattr(Plane, "quiet", no_time)
    explorer.start()
    until(lambda: received(heard, "message"))
    assert received(heard, "message")[0].endswith("incomplete: stopped after 0 s")
    assert [one.tried for one in received(heard, "hatch")] == [False, False]  # one plane, at the beginning and the end


@pytest.mark.parametrize(("limit", "ask", "what"), [
    ("SEARCH_SECONDS", lambda page: page.set(boundaries=True), "boundaries"),
    ("SEARCH_SECONDS", lambda page: page.click(2.8, 1.0), "coexisting motions"),
    ("LINE_SECONDS", lambda page: page.click(2.0, 1.05), "diagram"),
])  # fmt: skip
def test_what_is_cut_short_says_so(explorer, heard, monkeypatch, no_rest, limit, ask, what):
    monkeypatch.setattr(session, limit, 0.0)
    monkeypatch.setattr(plane, "PART", 40)
    ask(explorer)
    until(lambda: received(heard, "message"))
    assert received(heard, "message") == [f"{what} incomplete: stopped after 0 s"]
    assert what != "diagram" or explorer.line.values.max() < 1.9


def test_searches_that_come_to_their_end_say_nothing(heard, no_rest):
    clock = Clock(lambda: True, 60.0)
    find_curves(replace(SMALL, x="restitution", x_range=(0.5, 0.9), y="gap", y_range=(-0.1, 0.1)), clock)
    assert [other.name for other in find_others(SMALL, clock)] == ["period-1 impact-1"]
    assert len(set(compute_line(SMALL, clock).values)) == plane.VALUES
    assert clock.complete


@pytest.mark.parametrize("search", [find_curves, find_others, compute_line])
def test_what_is_not_wanted_any_more_is_not_complete(search):
    clock = Clock(lambda: False, 60.0)
    search(SMALL, clock)
    assert not clock.complete


def test_the_search_for_attractors_stops_where_it_is_told_to():
    calls = []
    vi.attractors(vi.ImpactOscillator(omega=2.8), workers=1, progress=lambda *received: calls.append(received))
    assert len(calls) > 3
    assert {(total, len(status)) for _, total, status in calls} == {(256, 256)}
    few = []
    vi.attractors(
        vi.ImpactOscillator(omega=2.8), workers=1, progress=lambda *received: few.append(received) or len(few) < 2
    )
    assert len(few) == 2


@pytest.mark.long
def test_a_slow_boundary_is_asked_between_its_points_whether_to_go_on():
    osc = vi.ImpactOscillator(omega=0.5)
    plane = ("omega", "restitution"), ((0.3, 0.4), (0.7, 0.9))
    calls = []
    vi.boundary_curves(osc, *plane, n_periods=[1], kinds=["end_of_sticking"], lines=2,
                       progress=lambda done, total, curves: calls.append(done))  # fmt: skip
    assert len(calls) > 20 * calls[-1]
    few = []
    vi.boundary_curves(osc, *plane, n_periods=[1], kinds=["end_of_sticking"], lines=2,
                       progress=lambda done, total, curves: few.append(done) or len(few) < 50)  # fmt: skip
    assert few == calls[:50]


def test_a_plane_that_takes_too_long_is_left_and_told_of_once_and_goes_on_when_asked(explorer, heard, monkeypatch):
    with monkeypatch.context() as hurried:
        hurried.setattr(work, "PLANE_SECONDS", 0.0)
        explorer.start()
        assert explorer.wait(300)
    messages = received(heard, "message")
    assert len(messages) == 1
    assert "takes more than 0 s: continue it, zoom in" in messages[0]
    assert explorer.plane is None
    assert received(heard, "late") == [False, True]
    explorer.go_on()
    explorer.go_on()  # it goes on already
    assert explorer.wait(300)
    assert explorer.plane.side == FINEST
    assert received(heard, "late") == [False, True, False, False]
    assert received(heard, "message") == messages


def test_a_part_under_way_when_a_plane_is_left_disturbs_nothing_once_it_goes_on(heard, monkeypatch):
    """It ends after that, with its cells: these are made anew, and the plane is neither left again nor a failure."""
    fill, first, gate, left = Plane.fill, threading.Event(), threading.Event(), threading.Event()

    def slow(self, *part):
        *places, keep_going = part
        if not first.is_set():
            first.set()
            assert gate.wait(300)
            return fill(self, *places, lambda: True)
        return left.is_set() and fill(self, *places, keep_going)  # the others have no time until the plane was left

    monkeypatch.setattr(Plane, "fill", slow)
    pool = Pool(2)
    explorer = Explorer(replace(SMALL, samples=2000), pool, heard.extend)
    explorer.start()
    until(lambda: received(heard, "late") == [False, True])
    left.set()
    explorer.go_on()
    gate.set()
    assert explorer.wait(300)
    assert received(heard, "late") == [False, True, False]
    assert len(received(heard, "message")) == 1
    assert explorer.plane.side == FINEST
    explorer.close()
    pool.close()


def test_a_plane_that_cannot_be_computed_is_told_of_once(explorer, heard, monkeypatch):
    def fault(*args, **options):
        raise RuntimeError

    monkeypatch.setattr(vi, "parameter_map", fault)
    explorer.zoom((1.9, 2.1), (0.9, 1.0))
    assert explorer.wait(300)
    assert [message for message in received(heard, "message") if "plane" in message] == [
        "The plane could not be computed. Change the view, and please report how to reproduce this error."
    ]


@pytest.mark.long
def test_what_was_computed_for_one_plane_is_never_shown_as_another(explorer, heard, pool):
    explorer.start()
    assert explorer.wait(300)
    gate = threading.Event()
    pool.submit("somebody else", Urgency.COARSE, lambda: gate.wait(300))
    heard.clear()
    assert explorer.zoom((1.9, 2.0), (1.0, 1.1))
    assert explorer.set(index="motion")
    assert not received(heard, "plane")
    with pytest.raises(ValueError, match="still being computed"):
        export("nc", explorer)
    gate.set()
    assert explorer.wait(300)
    assert {(plane.view.x_range, plane.view.index) for plane in received(heard, "plane")} == {((1.9, 2.0), "motion")}


def test_a_search_holds_up_neither_planes_nor_clicks(pool):
    gate, done = threading.Event(), {urgency: threading.Event() for urgency in Urgency}
    pool.submit("a", Urgency.SEARCH, lambda: gate.wait(300))
    pool.submit("a", Urgency.SEARCH, lambda: gate.wait(300))
    for urgency in (Urgency.CLICK, Urgency.COARSE, Urgency.LINE, Urgency.FINE):
        pool.submit("b", urgency, done[urgency].set)
        assert done[urgency].wait(300)
    gate.set()


def test_while_people_click_one_thread_leaves_its_core_to_them_and_to_coarse_planes(monkeypatch):
    monkeypatch.setattr(work, "CALM", threading.TIMEOUT_MAX)
    pool, gate, begun = Pool(2), threading.Event(), queue.Queue()
    clicked, coarse = threading.Event(), threading.Event()
    pool.submit("a", Urgency.CLICK, clicked.set)
    assert clicked.wait(300)
    for name in "bc":
        pool.submit(name, Urgency.LINE, lambda: (begun.put("line"), gate.wait(300)))
    assert begun.get(timeout=300) == "line"
    pool.submit("d", Urgency.COARSE, coarse.set)
    assert coarse.wait(300)  # by the thread that does not take the other line
    assert begun.empty()
    gate.set()
    assert begun.get(timeout=300) == "line"
    pool.close()


def test_pages_share_one_pool_and_all_get_what_they_asked_for(pool):
    heard = [[] for _ in range(6)]
    pages = [Explorer(replace(SMALL, x_range=(1.8 + 0.01 * i, 2.2)), pool, heard[i].extend) for i in range(6)]
    for page in pages:
        page.start()
    until(lambda: all(received(words, "point") for words in heard))
    until(lambda: all(received(words, "plane") for words in heard))
    # none is whole before all have their first picture
    assert all(plane.side < FINEST for words in heard for plane in received(words, "plane")[:1])
    assert not any(received(words, "message") for words in heard)
    for page in pages:
        page.close()


def test_a_page_that_asks_for_much_does_not_hold_up_one_that_asks_for_little(pool):
    much = View(osc=vi.ImpactOscillator(restitution=0.99), samples=5000)
    heard = [], []
    heavy, light = Explorer(much, pool, heard[0].extend), Explorer(SMALL, pool, heard[1].extend)
    heavy.start()
    time.sleep(0.05)
    light.start()
    until(lambda: received(heard[1], "plane"))
    assert FINEST not in {plane.side for plane in received(heard[0], "plane")}
    heavy.close()
    light.close()


def test_jobs_are_smaller_where_more_impacts_are_sampled():
    for side in SIDES:
        cells = [len(columns) * len(rows) for columns, rows in bands(side, 5000)]
        assert max(cells) <= 512
        assert sum(cells) == sum(len(columns) * len(rows) for columns, rows in bands(side))


def test_a_closed_page_leaves_nothing_behind(pool):
    def visit():
        page = Explorer(SMALL, pool)
        page.start()
        page.click(2.1, 1.0)
        until(lambda: page.plane is not None)
        page.close()
        assert page.wait(20.0)
        return weakref.ref(page)

    gone = visit()
    until(lambda: gc.collect() is not None and gone() is None)
    assert not pool.queued


def test_a_budget_is_at_least_what_fast_driving_needs():
    for stiff in (1.0, 10.0, 100.0, 1000.0):
        for count in (40, 600, 900, 5100):
            assert budget(stiff, count).steps_per_impact * stiff >= min(300.0, 100.0 * stiff)
            assert budget(stiff, count).steps_per_impact * stiff * count <= 6e6


@pytest.mark.skipif(sys.platform != "linux", reason="only on Linux has a thread a niceness of its own")
def test_what_may_wait_leaves_the_processor_to_clicks():
    pool = Pool(workers=1)
    received = queue.SimpleQueue()
    waiting = threading.Barrier(2)

    def tell(name):
        received.put((name, os.getpriority(os.PRIO_PROCESS, threading.get_native_id())))

    def hold():
        tell("plane")
        waiting.wait(10)

    pool.submit("page", Urgency.FINE, hold)
    while pool.queued:
        time.sleep(0.01)
    pool.submit("page", Urgency.CLICK, lambda: (tell("click"), waiting.wait(10)))
    ours = os.getpriority(os.PRIO_PROCESS, 0)
    seen = dict(received.get(timeout=300) for _ in range(2))
    assert seen["click"] == ours
    assert seen["plane"] > ours
    pool.close()
