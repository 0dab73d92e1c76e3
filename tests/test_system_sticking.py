"""Orbits of systems that rest at a stop: fixed points of their motion, with the multipliers of its derivative."""

import dataclasses

import numpy as np
import pytest

import vibroimpact as vi
from differences import derivative
from systems import linear, one_mass, sticking
from vibroimpact.backends.modal.carry import Carrier
from vibroimpact.backends.reference.systems import follow
from vibroimpact.orbits.sticking_end import scaling_exponent

pytestmark = pytest.mark.usefixtures("modal_engine")

SLOW = vi.ImpactOscillator(omega=0.1)
ONES = {
    "at the middle": SLOW,
    "pressed": SLOW.replace(omega=0.2, gap=-0.5),
    "hard": SLOW.replace(omega=0.15, restitution=0.9, damping=0.1),
    "soft": SLOW.replace(omega=0.3, restitution=0.3, gap=0.2),
}


def moving():
    """Return two coupled masses, one of which rests at a stop that moves; the other strikes one that gives."""
    return vi.ImpactSystem(
        mass=[[2.0, 0.3], [0.3, 1.0]],
        damping=[[0.1, 0.0], [0.0, 0.3]],
        stiffness=[[2.0, -1.0], [-1.0, 3.0]],
        force=vi.Force(omega=0.5, harmonics={1: [1.0, 0.0]}),
        stops=[
            vi.Stop(direction=[1, 0], gap=0.1, restitution=0.3, motion={1: 0.1j}),
            vi.Stop(direction=[0, 1], gap=0.2, stiffness=40.0, damping=0.5),
        ],
    )


def two_sides():
    """Return a mass that rests at either stop, with one on a spring beside it."""
    return vi.ImpactSystem(
        mass=np.eye(2),
        damping=0.05 * np.eye(2),
        stiffness=[[1.0, -0.3], [-0.3, 1.3]],
        force=vi.Force(omega=0.15, harmonics={1: [1.0, 0.0]}),
        stops=[
            vi.Stop(direction=[1, 0], gap=0.1, restitution=0.5, name="right"),
            vi.Stop(direction=[-1, 0], gap=0.1, restitution=0.5, name="left"),
        ],
    )


SYSTEMS = {"two masses": sticking(), "a moving stop": moving(), "both sides": two_sides()}


def the_orbit(model, **asked):
    (orbit,) = vi.find_orbit(model, n_impacts=-1, **asked)
    return orbit


def unstable():
    """Return an orbit of the two masses that no motion settles to, along 15 frequencies from one that some do."""
    orbit = None
    for omega in np.linspace(0.4, 0.55, 16):
        orbit = the_orbit(sticking().replace(omega=omega), near=orbit)
    return orbit


def carrier_of(orbit):
    carrier = Carrier(orbit.system.cells({}), vi.Tolerances())
    x = carrier.state(np.array(orbit.start.displacement), np.array(orbit.start.velocity))
    return carrier, x, orbit.start.time / orbit.system.period


@pytest.mark.parametrize("name", ONES)
def test_one_mass_as_a_system_rests_as_the_oscillator_does(name):
    one = ONES[name]
    (known,) = vi.find_orbit(one, n_impacts=-1)
    orbit = the_orbit(one_mass(one))
    (rest,) = orbit.rests
    assert orbit.name == known.name
    assert orbit.n_impacts == -1
    assert orbit.stable
    assert rest.end % 1.0 == pytest.approx(known.release_phase, abs=1e-12)
    assert (rest.end - rest.begin) * one.period == pytest.approx(known.stuck_time, rel=1e-8)
    shared = min(len(orbit.velocities), len(known.velocities))
    assert orbit.velocities[:shared] == pytest.approx(known.velocities[:shared], rel=1e-8)
    assert orbit.turns[:shared] == pytest.approx(known.turns[:shared], abs=1e-8)
    assert rest == pytest.approx(known.rests[0]._replace(stop=rest.stop), abs=1e-8)
    assert np.abs(orbit.multipliers).max() < 1e-12
    assert orbit.lyapunov < -10.0 * one.omega


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_witness_comes_back_to_where_an_orbit_begins_and_rests_as_long(name):
    orbit = the_orbit(SYSTEMS[name])
    start, period = orbit.start, orbit.system.period
    place, rate = (np.array(part) for part in (start.displacement, start.velocity))
    trajectory = follow(linear(orbit.system), place, rate, start.time, impacts=1000, most_periods=orbit.n_periods)
    assert trajectory.end.displacement == pytest.approx(place, abs=1e-9 * np.abs(place).max())
    rested = dict.fromkeys(orbit.system.stop_names, 0.0)
    for rest in orbit.rests:
        rested[rest.stop] += (rest.end - rest.begin) * period
    for number, stop in enumerate(orbit.system.stop_names):
        ways = {"stick": -1.0, "release": 1.0}
        closed = sum(ways.get(event.kind, 0.0) * event.time for event in trajectory.events if event.stop == number)
        assert closed == pytest.approx(rested[stop], abs=1e-6 * period)


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_derivative_is_that_of_the_motion(name):
    orbit = the_orbit(SYSTEMS[name])
    carrier, x, phase = carrier_of(orbit)
    end, matrix = carrier.over(x, phase, orbit.n_periods)
    assert end == pytest.approx(x, abs=1e-12 * np.abs(x).max())
    known = derivative(lambda state: carrier.over(state, phase, orbit.n_periods)[0], x, 1e-6 * np.abs(x).max())
    assert matrix == pytest.approx(known, abs=1e-7)
    assert sorted(np.abs(orbit.multipliers)) == pytest.approx(sorted(np.abs(np.linalg.eigvals(matrix))), abs=1e-12)


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_rest_takes_a_coordinate_and_its_rate_and_leaves_the_others_their_memory(name):
    orbit = the_orbit(SYSTEMS[name])
    sizes = np.abs(orbit.multipliers)
    assert (sizes < 1e-12).sum() == 2
    assert sizes[0] > 1e-3
    assert orbit.determinant == 0.0


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_exponent_is_that_of_the_motion_that_settles_to_it(name):
    orbit = the_orbit(SYSTEMS[name])
    settled = vi.parameter_map(
        SYSTEMS[name], omega=[orbit.system.omega], indices=["lyapunov", "n_periods"], sample_impacts=50_000
    )
    assert orbit.stable
    assert settled["n_periods"].item() == orbit.n_periods
    assert settled["lyapunov"].item() == pytest.approx(orbit.lyapunov, rel=1e-3)  # over a finite window


def test_an_unstable_orbit_that_rests_is_found_and_left_by_its_multiplier():
    orbit = unstable()
    assert not orbit.stable
    assert orbit.multipliers[0].real < -1.5
    carrier, x, phase = carrier_of(orbit)
    _, derivative = carrier.over(x, phase, 1.0)
    values, vectors = np.linalg.eig(derivative)
    along = vectors[:, np.abs(values).argmax()].real
    moved = (carrier.over(x + 1e-8 * along, phase, 1.0)[0] - x) / 1e-8
    assert moved == pytest.approx(orbit.multipliers[0].real * along, rel=1e-5, abs=1e-6)


def test_a_state_near_it_does_as_well_as_the_motion_from_rest():
    orbit = the_orbit(sticking())
    place, rate = (np.array(part) + 1e-3 for part in (orbit.start.displacement, orbit.start.velocity))
    again = the_orbit(sticking(), near=vi.State(place, rate, orbit.start.time))
    assert again.velocities == pytest.approx(orbit.velocities, rel=1e-10)
    assert again.turns == pytest.approx(orbit.turns, abs=1e-10)


def test_its_twin_is_a_motion_of_the_symmetric_system_too():
    orbit = the_orbit(two_sides())
    twin = orbit.twin
    assert {rest.stop for rest in twin.rests} == {rest.stop for rest in orbit.rests} == {"left", "right"}
    again = the_orbit(two_sides(), near=twin)
    assert again.start.displacement == pytest.approx(twin.start.displacement, abs=1e-10)
    assert sorted(again.velocities) == pytest.approx(sorted(orbit.velocities), rel=1e-9)


def test_a_stop_without_restitution_is_struck_a_number_of_times_one_with_it_without_end():
    assert the_orbit(sticking()).n_impacts == 5
    assert the_orbit(two_sides()).n_impacts == -1


@pytest.mark.parametrize(
    ("model", "n_periods", "outcome", "said"),
    [
        (sticking(), 2, "other_name", "converged to a period-1 sticking orbit instead of a period-2 sticking one"),
        (vi.models.impact_damper(), 1, "other_name", "impact-2 orbit, which rests at no stop"),
        (sticking().replace(stop_1_gap=30.0, stop_2_gap=30.0), 1, "other_name", "rests at no stop"),
    ],
    ids=["once", "no rest", "no impact"],
)
def test_what_is_found_instead_is_said(model, n_periods, outcome, said):
    orbits = vi.find_orbit(model, n_periods=n_periods, n_impacts=-1)
    assert (len(orbits), orbits.outcome) == (0, outcome)
    assert said in orbits.message


def test_a_guess_that_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="must have 2 coordinates"):
        vi.find_orbit(sticking(), n_impacts=-1, near=vi.State([0.0, 0.0, 0.0]))
    with pytest.raises(ValueError, match="must be an orbit of 2 coordinates"):
        vi.find_orbit(sticking(), n_impacts=-1, near=the_orbit(one_mass(SLOW)))
    with pytest.raises(ValueError, match="an orbit or an attractor of a system"):
        vi.find_orbit(sticking(), n_impacts=-1, near=(0.1, 1.0))


ENDS = {  # where sticking ends, and the restitution of the stop
    "two masses": (moving(), (0.5, 0.9), 0.3),
    "both sides": (two_sides(), (0.9, 1.5), 0.5),
}


@pytest.mark.parametrize("name", ONES)
def test_the_end_of_sticking_of_one_mass_as_a_system_is_that_of_the_oscillator(name):
    one = ONES[name]
    known = vi.end_of_sticking(one, "omega", (one.omega, 2.0))
    found = vi.end_of_sticking(one_mass(one), "omega", (one.omega, 2.0))
    assert (known.outcome, found.outcome) == ("found", "found")
    assert found.value == pytest.approx(known.value, rel=1e-9)
    assert found.residual < 1e-7


@pytest.mark.parametrize("name", ENDS)
def test_the_stuck_time_vanishes_as_the_power_of_the_distance_that_its_restitution_sets(name):
    model, between, restitution = ENDS[name]
    end = vi.end_of_sticking(model, "omega", between)
    assert end.found
    distances = np.array([1e-5, 1e-6, 1e-7])
    orbits, orbit = [], end.orbit
    for away in distances[::-1]:
        near = model.replace(omega=end.value + away * (between[0] - end.value))
        orbit = the_orbit(near, near=orbit)
        orbits.append(orbit)
    stuck = [orbit.rests[0].end - orbit.rests[0].begin for orbit in orbits[::-1]]
    slopes = np.diff(np.log(stuck)) / np.diff(np.log(distances))
    assert slopes == pytest.approx(scaling_exponent(restitution), abs=0.02)
    beyond = model.replace(omega=end.value + 1e-6 * (between[1] - end.value))
    assert not vi.find_orbit(beyond, n_impacts=-1, near=end.orbit)


@pytest.mark.parametrize("name", SYSTEMS)
def test_along_a_branch_the_witness_comes_back_and_rests_as_long(name):
    orbit = the_orbit(SYSTEMS[name])
    omega = orbit.system.omega
    branch = vi.continue_orbit(orbit, "omega", (0.97 * omega, 1.03 * omega))
    assert branch.outcome == ("range", "range")
    assert len(branch.orbits) > 50
    for one in branch.orbits[::9]:
        place, rate = (np.array(part) for part in (one.start.displacement, one.start.velocity))
        seen = follow(linear(one.system), place, rate, one.start.time, impacts=1000, most_periods=1)
        assert seen.end.displacement == pytest.approx(place, abs=1e-8)
        changes = {"stick": -1.0, "release": 1.0}
        closed = sum(changes.get(event.kind, 0.0) * event.time for event in seen.events)
        assert closed == pytest.approx(one.stuck_time, abs=1e-6 * one.system.period)


def test_a_branch_that_rests_ends_where_sticking_does_or_folds():
    orbit = the_orbit(two_sides())
    branch = vi.continue_orbit(orbit, "omega", (0.15, 1.5), step=0.05)
    assert branch.outcome == ("range", "end_of_sticking")
    (end,) = branch.special
    assert end.value == pytest.approx(vi.end_of_sticking(two_sides(), "omega", (0.15, 1.5)).value, rel=1e-10)
    hardest = branch.dataset["velocity"].max("impact").values  # a row begins at the same release
    assert np.abs(np.diff(hardest)).max() < 0.1
    assert branch.dataset["velocity"].values[:, 0] == pytest.approx(hardest)
    folding = vi.continue_orbit(orbit, "left_gap", (0.1, 2.0), step=0.05)
    assert folding.outcome == ("range", "fold")
    (fold,) = folding.special
    assert (fold.kind, fold.residual < 1e-3) == ("fold", True)
    assert min(abs(m - 1.0) for m in fold.orbit.multipliers) == fold.residual
    nearer = [min(abs(m - 1.0) for m in one.multipliers) for one in folding.orbits[-6:]]
    assert nearer == sorted(nearer, reverse=True)


def test_an_orbit_entered_within_a_rest_has_that_rest_once():
    """The state found before is at rest where the parameter moved on: the rest was listed twice."""
    orbit = the_orbit(sticking().replace(omega=0.6))
    rest = orbit.rests[0]
    within = 0.5 * (rest.begin + rest.end) - orbit.start.time / orbit.system.period
    moved = vi.simulate(orbit.system, start=orbit.start, periods=1, samples_per_period=1000)
    at = round(within % 1.0 * 1000)
    state = vi.State(moved["displacement"].values[at], moved["velocity"].values[at], moved["time"].values[at])
    again = the_orbit(orbit.system, near=dataclasses.replace(orbit, start=state))
    assert len(again.rests) == len(orbit.rests) == 1
    assert again.stuck_time == pytest.approx(orbit.stuck_time, rel=1e-8)


def test_how_an_orbit_of_a_system_is_lost_is_said():
    assert vi.end_of_sticking(sticking(), "omega", (0.5, 0.6)).outcome == "no_change"
    gear = vi.models.idle_gear()
    lost = vi.end_of_sticking(gear, "omega", (0.6 * gear.omega, 0.5 * gear.omega))
    assert (lost.outcome, lost.found) == ("lost", False)
    assert "the orbit still rests for 0.999 T" in lost.message
    folds = vi.end_of_sticking(two_sides(), "left_gap", (0.1, 3.0))
    assert (folds.outcome, "where it folds" in folds.message) == ("lost", True)
    (end,) = vi.continue_orbit(the_orbit(two_sides().replace(omega=1.1)), "omega", (1.09, 1.2)).special
    with pytest.raises(ValueError, match="of an orbit that never rests, or of one mass"):
        vi.continue_boundary(end, ("omega", "left_gap"), ((1.0, 1.2), (0.0, 0.5)))


def test_its_motion_is_that_of_simulate():
    orbit = the_orbit(sticking())
    follow = vi.simulate(orbit.system, start=orbit.start, periods=1)
    assert orbit.motion(follow["time"])[0] == pytest.approx(follow["displacement"].values, abs=1e-9)
    moved = vi.simulate(orbit.system, start=orbit.start, periods=1)
    assert moved["displacement"].values[-1] == pytest.approx(moved["displacement"].values[0], abs=1e-9)
