"""The contract every back end keeps: shapes, labels, statuses, starts, samples."""

import math
from functools import partial

import numpy as np
import pytest

import vibroimpact as vi
from cells import make_cells
from vibroimpact.backends import BACKENDS, ImpactWindow, Measurement, StroboscopicWindow, get_backend
from vibroimpact.indices import INDICES
from vibroimpact.kernels.cell import Cell


def here(name):
    try:
        get_backend(name)
    except ValueError:
        return False
    return True


# Without a GPU `cuda` is held to this by tests/engine/test_cuda.py, in the simulator.
ALL = tuple(name for name in BACKENDS if here(name))
EXACT = tuple(name for name in ALL if get_backend(name).known_indices == set(INDICES))
OSC = vi.ImpactOscillator(omega=2.0)


@pytest.fixture(params=ALL)
def backend(request):
    return request.param


@pytest.fixture(params=EXACT)
def exact(request):
    return request.param


def test_indices_come_with_every_name_of_the_table(backend):
    cells = make_cells(OSC, None, {"omega": np.array([1.5, 2.0])})
    engine = get_backend(backend)
    result = engine.indices(cells, Measurement(ImpactWindow(2, 5), vi.Tolerances(), indices=engine.known_indices))
    assert {*engine.known_indices, "status", "impacts", "steps"} <= set(result)
    assert all(len(values) == 2 for values in result.values())
    assert (result["impacts"] >= 7).all()
    assert (result["steps"] > 0).all()


def test_a_system_that_is_one_mass_is_the_oscillator_that_it_is(backend):
    """Driven at another phase, loaded, in front of a stop on the other side; asked by stop, too."""
    osc = vi.ImpactOscillator(mass=2.0, damping=0.3, omega=2.0, restitution=0.5, gap=0.1)
    system = vi.ImpactSystem(
        mass=2.0,
        damping=0.3,
        stiffness=1.0,
        force=vi.Force(omega=2.0, harmonics={1: -1.0j}, constant=-0.2),
        stops=[vi.Stop(direction=-1.0, gap=0.3, restitution=0.5)],
    )
    engine = get_backend(backend)
    ahead = 0.25  # driven by sin(w t + pi/2) towards its stop
    alike = make_cells(osc, vi.State(-0.2, 0.0, ahead * osc.period))
    wanted = Measurement(ImpactWindow(2, 5), indices=tuple(engine.known_indices), by_stop=True)
    ours, theirs = (engine.indices(cells, wanted) for cells in (system.cells({}), alike))
    assert ours.keys() == theirs.keys()
    if "first_phase" in ours:
        theirs["first_phase"] -= ahead
    for name, values in ours.items():
        assert values == pytest.approx(theirs[name], rel=1e-9, abs=1e-12, nan_ok=True), name
    (mine,), (its,) = (engine.samples(cells, Measurement(ImpactWindow(2, 5))) for cells in (system.cells({}), alike))
    assert mine.impact_velocity == pytest.approx(its.impact_velocity, rel=1e-9)
    turns = its.impact_periods + its.impact_phase - ahead
    assert mine.impact_periods + mine.impact_phase == pytest.approx(turns, rel=1e-9)


TWO = vi.models.two_sided_oscillator()
MAP = partial(vi.parameter_map, backend="fixed-step")
ONE_OF_TWO = vi.ImpactSystem(**TWO.arguments() | {"stops": TWO.stops[:1]})
WITNESSED = partial(vi.parameter_map, vi.models.bilinear_oscillator(), omega=[1.0], backend="reference")


@pytest.mark.parametrize(("call", "words"), [
    (partial(get_backend, "cpuu"), "unknown `backend` 'cpuu'.*did you mean 'cpu'"),
    (partial(MAP, TWO, omega=[1.0]), "'fixed-step' takes only one mass in front of one fixed rigid stop"),
    (partial(MAP, ONE_OF_TWO, omega=[1.0], indices=["mean_force"]),
     "'fixed-step' does not compute the index 'mean_force', only std, .*spread$"),
    (partial(WITNESSED, indices=["rms_force"]),
     "'reference' does not compute the index 'rms_force', only std, .*damper_rate$"),
    (partial(vi.simulate, OSC, backend="cpu", time_step=0.001), "`time_step` applies only to back end 'fixed-step'"),
])  # fmt: skip
def test_what_a_back_end_cannot_do_is_refused(call, words):
    with pytest.raises(ValueError, match=words):
        call()


def test_an_impact_window_keeps_as_many_impacts_as_asked(backend):
    (samples,) = get_backend(backend).samples(make_cells(OSC, None), Measurement(ImpactWindow(3, 4)))
    assert len(samples.impact_velocity) == len(samples.impact_phase) == len(samples.impact_periods) == 4
    assert (samples.impact_velocity > 0).all()
    assert ((samples.impact_phase >= 0) & (samples.impact_phase < 1)).all()
    assert len(samples.look_velocity) == 0
    assert samples.last_clearance == pytest.approx(0.0, abs=1e-12)
    assert samples.last_velocity[0] == pytest.approx(-0.8 * samples.impact_velocity[-1], rel=1e-12)


def test_a_stroboscopic_window_looks_at_its_phase(backend):
    window = StroboscopicWindow(2, 4, 0.25)
    (samples,) = get_backend(backend).samples(make_cells(OSC, None), Measurement(window))
    assert samples.look_phase == pytest.approx(0.25, abs=1e-3)
    assert samples.look_periods.tolist() == [2, 3, 4, 5]
    assert samples.last_clearance == pytest.approx(OSC.gap - samples.look_displacement[-1, 0], abs=1e-12)


def test_a_start_mid_period_waits_for_the_section_s_phase(exact):
    start = vi.State(-1.0, 0.0, 0.6 * OSC.period)
    looks = vi.stroboscopic_section(OSC, start=start, phase=0.25, transient_periods=0, sample_periods=2, backend=exact)
    assert looks["time"].values == pytest.approx([1.25 * OSC.period, 2.25 * OSC.period], rel=1e-14)


def test_no_displacement_lies_beyond_the_stop(backend):
    orbit = vi.simulate(vi.ImpactOscillator(omega=0.9, gap=0.1), periods=6, samples_per_period=40, backend=backend)
    assert (orbit["displacement"] <= 0.1 + 1e-15).all()
    assert orbit["displacement"].values[0] == 0.0


def test_an_impact_start_is_recorded_at_its_time(exact):
    start = vi.State(0.0, 0.7, 0.9)
    hits = vi.impact_section(OSC, start=start, transient_impacts=0, sample_impacts=1, backend=exact)
    assert hits["velocity"].values == pytest.approx([0.7], rel=1e-15)
    assert hits["time"].values == pytest.approx([0.9], rel=1e-15)


@pytest.mark.parametrize("section", ["impact", "stroboscopic"])
def test_diagrams_have_the_same_shape_from_every_back_end(backend, section):
    diagram = vi.bifurcation_diagram(
        OSC,
        omega=[1.9, 2.0],
        section=section,
        transient_impacts=1,
        sample_impacts=3,
        transient_periods=1,
        sample_periods=3,
        backend=backend,
    )
    assert diagram["velocity"].dims == ("omega", "impact" if section == "impact" else "period")
    assert diagram["velocity"].shape == (2, 3)
    assert diagram["count"].values.tolist() == [3, 3]


def test_a_start_whole_periods_later_gives_the_same_motion_bit_for_bit(exact):
    osc, window = vi.ImpactOscillator(omega=2 * math.pi * 0.45), Measurement(ImpactWindow(5, 30))
    cells = make_cells(osc, vi.State(-1.0))
    (now,), (later,) = (get_backend(exact).samples(cells.replace(periods=at), window) for at in (0.0, 1e6))
    assert (later.impact_velocity == now.impact_velocity).all()
    assert (later.impact_phase == now.impact_phase).all()
    assert (later.impact_periods == now.impact_periods + 1e6).all()


def test_a_window_carries_on_where_the_one_before_it_ended(exact):
    cells, engine = make_cells(vi.ImpactOscillator(omega=2.8)), get_backend(exact)
    (whole,), (first,) = (engine.samples(cells, Measurement(ImpactWindow(0, keep))) for keep in (12, 5))
    (after,) = engine.samples(cells.continuing(first), Measurement(ImpactWindow(0, 7)))
    known = whole.impact_velocity[5:]
    assert after.impact_velocity == pytest.approx(known, rel=0.0 if exact == "reference" else 1e-9, abs=0.0)


@pytest.mark.parametrize("name", ["cpu", "reference"])
@pytest.mark.parametrize("make", [vi.models.two_sided_oscillator, vi.models.impact_damper])
def test_a_window_of_a_system_carries_on_where_the_one_before_it_ended(name, make):
    cells, engine = make().cells({}), get_backend(name)
    (whole,), (first,) = (engine.samples(cells, Measurement(ImpactWindow(0, keep))) for keep in (12, 5))
    state = first.last_displacement[None], first.last_velocity[None], np.array([first.last_phase])
    (after,) = engine.samples(cells.at(*state), Measurement(ImpactWindow(0, 7)))
    assert after.impact_stop.tolist() == whole.impact_stop[5:].tolist()
    assert after.impact_velocity == pytest.approx(whole.impact_velocity[5:], rel=1e-9)


@pytest.mark.parametrize(
    ("parameters", "start", "expected"),
    [
        ({"gap": 10.0}, None, "no_impact"),
        ({"gap": -2.0}, None, "stuck_forever"),
        ({"amplitude": 0.0}, vi.State(-1.0), "decaying"),
        ({"gap": 1.0, "omega": 3.0, "damping": 0.1}, vi.State(-5.0), "stopped_impacting"),
        ({"omega": 0.1}, None, "sticking"),
        ({"omega": 2.0}, None, "ok"),
    ],
)
def test_exact_back_ends_agree_on_how_a_motion_ends(exact, parameters, start, expected):
    osc = vi.ImpactOscillator(**parameters)
    keep = {"sticking": 950, "decaying": 200}.get(expected, 40)
    hits = vi.impact_section(osc, start=start, transient_impacts=0, sample_impacts=keep, backend=exact)
    assert vi.Status(int(hits["status"])).word == expected


def test_exact_back_ends_agree_on_settled_indices():
    names = ("std", "mean_velocity", "max_velocity", "impacts_per_period")
    sweeps = {
        backend: vi.parameter_map(
            OSC, omega=[0.95, 2.0], indices=names, transient_impacts=150, sample_impacts=20, backend=backend
        )
        for backend in EXACT
    }
    for backend, sweep in sweeps.items():
        for name in names[:3]:
            assert sweep[name].values == pytest.approx(sweeps["reference"][name].values, rel=1e-10, abs=1e-10)
        # Slow ones know no cycles: over 20 impacts of a period-1 impact-2 motion (N - 1) T / (t_N - t_1) is not yet 2.
        slow = get_backend(backend, elsewhere=True).slow
        rates = pytest.approx([19 / 9.29, 1.0], abs=1e-3) if slow else [2.0, 1.0]
        assert sweep["impacts_per_period"].values.tolist() == rates


def test_the_columns_of_cells_are_those_that_kernels_read():
    assert make_cells(OSC, None).columns == Cell._fields
