"""How much work the engine does: counted, never timed, so that a change that makes it do more is seen."""

import numpy as np
import pytest
from numba.core.runtime import _nrt_python, rtsys

import systems
import vibroimpact as vi
from cells import make_cells
from processes import python
from vibroimpact.backends import ImpactWindow, Measurement, get_backend
from vibroimpact.kernels.systems import march
from vibroimpact.kernels.systems.pressed import repetition_is_due
from vibroimpact.orbits import flow
from vibroimpact.orbits.search import search_of, stable_orbits
from vibroimpact.orbits.systems import admissibility

OSC = vi.ImpactOscillator()
SPREAD = np.linspace(0.05, 5.0, 128)


def work(**settings):
    return vi.parameter_map(OSC, sample_impacts=1000, **settings).attrs


def test_an_impact_takes_at_most_46_tenths_of_a_certified_step():
    done = work(omega=SPREAD, early_closing=False)
    assert done["impacts_computed"] == 128 * 1100
    assert done["steps_computed"] <= 4.6 * done["impacts_computed"]


@pytest.mark.parametrize(("omega", "most"), [(0.05, 1.7), (0.3, 1.4), (0.9, 3.6), (2.0, 4.1), (2.8, 4.3), (4.5, 7.1)])
def test_certified_steps_an_impact_regime_by_regime(omega, most):
    done = work(omega=omega * (1 + 1e-9 * np.arange(16)), early_closing=False)
    assert done["steps_computed"] <= most * done["impacts_computed"]


@pytest.mark.parametrize(
    ("name", "values", "most"),
    [
        ("mass", np.linspace(0.1, 5.0, 40), 0.19),
        ("damping", np.linspace(0.005, 1.0, 40), 0.13),
        ("stiffness", np.linspace(0.1, 5.0, 40), 0.19),
        ("amplitude", np.linspace(0.1, 5.0, 40), 0.18),
        ("restitution", np.linspace(0.1, 0.99, 40), 0.15),
    ],
)
def test_early_closing_leaves_a_sixth_of_the_impacts_of_the_paper_s_maps(name, values, most):
    sweep = vi.parameter_map(OSC, omega=np.linspace(0.025, 5, 40), **{name: values})
    assert sweep.attrs["impacts_computed"] <= most * 1600 * 5100


def test_no_cell_crawls():
    # A mass that leaves the stop slowly once took millions of steps in one cell of this map's neighbourhood.
    cells = make_cells(OSC, None, {"omega": np.linspace(4.9, 5.0, 21), "restitution": np.linspace(0.1, 0.99, 40)})
    done = get_backend("cpu").indices(cells, Measurement(ImpactWindow(100, 1000)))
    assert (done["steps"] <= 40 * done["impacts"] + 2000).all()


def test_a_stiff_cell_takes_as_many_steps_as_its_flight_is_long():
    done = work(omega=[100.0], start=vi.State(-1.0), early_closing=False)
    # A flight of half a natural period is 50 driving periods, 314 radians: 131 full steps.
    assert done["steps_computed"] <= 150 * done["impacts_computed"]


def test_memory_is_taken_once_a_tile_and_never_by_an_impact():
    _nrt_python.memsys_enable_stats()

    def allocations(sample):
        before = rtsys.get_allocation_stats().alloc
        cells = make_cells(OSC, None, {"omega": SPREAD})
        get_backend("cpu").indices(cells, Measurement(ImpactWindow(10, sample), vi.Tolerances(), early_closing=False))
        return rtsys.get_allocation_stats().alloc - before

    allocations(10)
    few, many = allocations(10), allocations(500)
    assert many == few


def test_a_pressed_motion_is_compared_with_itself_ever_more_rarely_before_its_first_impact_too():
    """Each comparison follows it for up to eight periods more."""
    notes = np.zeros(march.SUMS)
    assert [period for period in range(100) if repetition_is_due(notes, 1, 0, float(period))] == [4, 12, 28, 60]


OF_ONE_MASS = "vi.ImpactOscillator()"
FIRST = {
    "parameter_map": f"{OF_ONE_MASS}, omega=[2.8], sample_impacts=10",
    "bifurcation_diagram": f"{OF_ONE_MASS}, omega=[2.8], sample_impacts=10",
    "impact_section": f"{OF_ONE_MASS}, sample_impacts=10",
    "describe": f"{OF_ONE_MASS}, parameters=[]",
}


@pytest.mark.long(but=1)
@pytest.mark.parametrize("function", FIRST)
def test_a_first_result_waits_for_no_library_that_it_does_without(function):
    unneeded = {"zarr", "dask.base", "pint", "distributed", "matplotlib", "scipy.optimize", "scipy.integrate"}
    code = (
        f"import sys, vibroimpact as vi; vi.{function}({FIRST[function]}); "
        f"print('heavy:', {unneeded} & set(sys.modules))"
    )
    assert "heavy: set()" in python(code).stdout


def two_masses_and_a_spring_stop():
    force, stop = vi.Force(omega=1.0, harmonics={1: [1.0, 0.0]}), vi.Stop(direction=[1, 0], gap=0.3, stiffness=50.0)
    stiffness = np.array([[2.0, -1.0], [-1.0, 1.0]])
    return vi.ImpactSystem(
        mass=np.diag([1, 2]), damping=0.1 * np.eye(2), stiffness=stiffness, force=force, stops=[stop]
    )


@pytest.mark.long(but=1)
@pytest.mark.parametrize(
    ("model", "span"),
    [(vi.models.cantilever_with_stop(modes=4), (74.0, 77.0)), (two_masses_and_a_spring_stop(), (0.9, 1.1))],
)
def test_each_orbit_of_a_branch_is_made_once(model, span, monkeypatch):
    legs, exponentials, courses, growth = [], [], admissibility.courses, flow.growth

    def looked_at(leg, *struck):
        legs.append((leg.start.tobytes(), leg.duration, leg.pushing))
        return courses(leg, *struck)

    monkeypatch.setattr(admissibility, "courses", looked_at)
    monkeypatch.setattr(flow, "growth", lambda matrix: exponentials.append(matrix.tobytes()) or growth(matrix))
    orbit = vi.find_orbit(model)[0]
    legs.clear()
    exponentials.clear()
    branch = vi.continue_orbit(orbit, "omega", span, step=0.05)
    # The first orbit begins both ways, and special points have an orbit of their own and one on the branch.
    assert len(branch.orbits) > 20
    assert len(legs) - len(set(legs)) <= len(branch.special) + 3
    # Newton's method takes some four, with two differences by the parameter each.
    assert len(exponentials) - len(set(exponentials)) <= 0.05 * len(exponentials)
    assert len(exponentials) <= 16 * len(legs)


def test_stable_orbits_of_twenty_stops_are_found_without_testing_each_solution_at_every_place(monkeypatch):
    tube, seen = vi.models.tube_in_many_supports(supports=10, modes=12), []
    spy = lambda *given: seen.append(given) or admissibility.objection(*given)  # noqa: E731
    monkeypatch.setattr("vibroimpact.orbits.systems.orbit.objection", spy)
    assert stable_orbits(search_of(tube), 1) == [] == stable_orbits(search_of(tube), 3)
    assert not seen
    assert len(vi.find_orbit(tube)) == len(seen) == 16  # each with its reason


def test_stable_orbits_are_those_of_all_orbits():
    rng, number = np.random.default_rng(5), 0
    machines = [vi.models.gear_pair(), vi.models.bouncing_ball(), vi.models.bilinear_oscillator()]
    for model in [*machines, *(systems.on_springs(rng) for _ in range(8)), systems.a_random_system(rng, 2)]:
        for n in range(1, 5):
            stable = [each for each in vi.find_orbit(model, n_periods=n) if each.stable]
            assert stable_orbits(search_of(model), n) == stable
            number += len(stable)
    assert number >= 5
