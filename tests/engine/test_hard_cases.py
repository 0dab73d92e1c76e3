"""Hard cases of impacts, rests and flights: at the stop, within the budget, of many modes, and without loss."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

import vibroimpact as vi
from codes import Engine, Witness
from systems import a_random_system, impacts, linear, springs_of, system, two_masses
from vibroimpact.orbits.cycle import Leg
from vibroimpact.orbits.flow import Flow
from vibroimpact.orbits.systems.admissibility import clearances, courses
from vibroimpact.orbits.systems.sampling import evenly, sampled
from witness import follow

NAMES = ("std", "mean_velocity", "max_velocity", "impacts_per_period")


# At the stop


def test_at_the_stop_with_zero_velocity_and_pressed_it_sticks_until_the_force_reverses(way):
    orbit = way.simulate(vi.ImpactOscillator(omega=2.0), periods=1)
    assert orbit["stick_time"].values[0] == 0.0
    assert orbit["release_time"].values[0] == pytest.approx(math.pi / 2, rel=1e-15)
    assert (orbit["displacement"].values[:100] == 0.0).all()


def test_at_the_stop_with_zero_velocity_and_not_pressed_it_leaves(way):
    osc = vi.ImpactOscillator(omega=2.0)
    orbit = way.simulate(osc, start=vi.State(0.0, 0.0, 0.6 * osc.period), periods=0.3)
    assert orbit.sizes["stick"] == 0
    assert (orbit["displacement"].values[1:] < 0.0).all()


def test_a_start_at_the_stop_towards_it_is_an_impact_at_the_start(way):
    osc = vi.ImpactOscillator(omega=2.0, gap=0.3)
    orbit = way.simulate(osc, start=vi.State(0.3, 1.25, 0.7), periods=1)
    assert orbit["impact_time"].values[0] == pytest.approx(0.7, rel=1e-14)
    assert orbit["impact_velocity"].values[0] == pytest.approx(1.25, rel=1e-15)
    assert orbit["velocity"].values[0] == pytest.approx(-0.8 * 1.25, rel=1e-15)


@pytest.mark.parametrize("speed", [-0.5, 0.0, 0.5])
def test_a_start_exactly_at_a_stop(speed):
    model = two_masses(stops=[vi.Stop(direction=[0, 1], gap=0.05, restitution=0.7)])
    motion = vi.simulate(model, start=vi.State([0.0, 0.05], [0.0, speed]), periods=2)
    struck = motion.sizes["impact"] and motion["impact_time"].values[0] == 0.0
    assert bool(struck) == (speed > 0.0)
    if speed > 0.0:
        assert motion["impact_velocity"].values[0] == pytest.approx(speed, rel=1e-14)
        assert motion["velocity"].values[0, 1] == pytest.approx(-0.7 * speed, rel=1e-14)
    assert (motion["clearance"].values >= 0.0).all()


def test_a_small_impact_that_is_no_chatter_is_rebounded_unrecorded(way):
    """Pulled away from the stop, a contact slower than the cut neither counts nor sticks."""
    osc = vi.ImpactOscillator(omega=2.0)
    start = vi.State(0.0, 1e-12, 0.75 * osc.period)
    hits = way.section(osc, 0, 1, start=start)
    assert hits["time"].values[0] > start.time + 1.0
    assert hits.sizes["stick"] == 0


def test_impacts_below_the_cut_are_rebounded_but_not_counted(way):
    osc = vi.ImpactOscillator(amplitude=0.0, gap=0.5, damping=0.0, restitution=0.1)
    hits = way.section(osc, 0, 100, start=vi.State(-1.0), tolerances=vi.Tolerances(chatter=1e-3))
    speeds = math.sqrt(1 - 0.25) * 0.1 ** np.arange(4)
    assert hits["velocity"].values == pytest.approx(speeds[speeds > 0.5e-3], rel=1e-12)


def test_a_chatter_that_the_release_interrupts_does_not_stick(way):
    """Impacts at the end of the pressing half period: t1 is longer than what is left of it."""
    osc = vi.ImpactOscillator(omega=1.0)
    start = vi.State(0.0, 1e-10, 0.5 * osc.period - 1e-10)
    orbit = way.simulate(osc, start=start, periods=0.1)
    assert orbit.sizes["stick"] == 0
    assert orbit["displacement"].values[-1] < -1e-3


def test_without_restitution_an_impact_sticks_where_the_force_presses_and_leaves_where_it_pulls(way):
    osc = vi.ImpactOscillator(omega=1.0, restitution=0.0)
    pressed = way.simulate(osc, start=vi.State(0.0, 0.5, 0.25 * osc.period), periods=1)
    assert pressed["impact_velocity"].values[0] == 0.5
    assert pressed["stick_time"].values[0] == pytest.approx(0.25 * osc.period)
    assert pressed["release_time"].values[0] == pytest.approx(0.5 * osc.period)
    pulled = way.simulate(osc, start=vi.State(0.0, 0.5, 0.75 * osc.period), periods=0.2)
    assert pulled.sizes["stick"] == 0
    assert (pulled["displacement"].values[1:] < 0.0).all()


def test_without_rebound_every_recorded_impact_rests_or_leaves_with_no_velocity(way):
    osc = vi.ImpactOscillator(restitution=0.0, omega=0.5, gap=0.2)
    hits = way.section(osc)
    pressed = np.sin(2 * math.pi * hits["phase"].values) > osc.gap
    rests = hits["time"].values[:-1][pressed[:-1]]
    assert 0 < len(rests) < 20
    assert hits["stick_time"].values == pytest.approx(rests, rel=1e-14)


@pytest.mark.parametrize("n", [2, 3, 4])
def test_a_chain_pushed_at_its_far_end_is_held_by_the_stop_it_rests_at(n):
    stop, springs = vi.Stop(direction=np.eye(n)[-1], gap=0.0, restitution=0.7), springs_of(n)
    pushed = system(np.eye(n), 0.02 * springs, springs, 0.9, [stop], {1: np.eye(n)[0]})
    trajectory = follow(linear(pushed), np.zeros(n), np.zeros(n), impacts=3)
    motion = vi.simulate(pushed, periods=3)
    assert motion["stick_time"].values[0] == 0.0
    released = next(event.time for event in trajectory.events if event.kind == "release")
    assert motion["release_time"].values[0] == pytest.approx(released, rel=1e-12)
    assert motion["impact_time"].values[0] == pytest.approx(trajectory.impacts[0].time, rel=1e-12)


@pytest.mark.parametrize("restitution", [0.605720375787613, 0.3, 0.0])
def test_twins_that_rest_at_two_stops_are_let_go_at_one_instant_and_fly_on(restitution):
    """A tube that moves symmetrically rests at both supports beside its middle; rounding lets one go first."""
    tube = vi.models.tube_in_many_supports(supports=10, modes=8, force_per_length=12.0, restitution=restitution)
    rest = np.zeros(8)
    known = follow(linear(tube), rest, rest, impacts=140, most_periods=40, cut=1e-9 * tube.velocity_scale).impacts[:140]
    few = vi.Tolerances(steps_per_impact=100)
    hits = vi.impact_section(tube, transient_impacts=0, sample_impacts=140, tolerances=few)
    assert vi.Status(int(hits["status"])).has_indices
    strong = hits["time"].values[hits["velocity"].values > 1e-3]  # which of the weakest ones count is rounding
    expected = [event.time for event in known if event.velocity > 1e-3]
    number = min(len(strong), len(expected), 40)
    assert number > 30
    np.testing.assert_allclose(strong[:number], expected[:number], rtol=1e-6)


def test_a_stop_that_opens_and_closes_at_one_instant_ends_a_rest_and_begins_another():
    """Three masses fill a room of no width, rigid on one side, until the budget is spent."""
    rigid = vi.Stop(direction=[1, 1, 1], gap=0.0, restitution=0.0)
    compliant = vi.Stop(direction=[-1, -1, -1], gap=0.0, stiffness=1e4, damping=1.0)
    load = {1: [1.0, 1.0, -1.0]}
    filled = system(np.eye(3), 0, np.diag([1.0, 0.0, 0.0]), 1.3, [rigid, compliant], load, [-1.0, -1.0, 0.0])
    hits = impacts(filled, 20, 5)
    closed = hits.isel(stick=np.flatnonzero(hits["stick_stop"] == "stop_1"))
    begun, ended = closed["stick_time"].values, closed["release_time"].values
    over = np.isfinite(ended)
    assert (~over).sum() <= 1 < over.sum()
    assert (ended - begun)[over].min() >= -1e-12  # rounding of times of 36 s
    assert (ended - begun)[over].sum() <= np.nanmax(ended) * (1.0 + 1e-9)  # rests of one stop do not overlap


# Within the budget


@pytest.mark.parametrize("gap", [1.0, 1.2])
def test_a_gap_beyond_the_static_reach_never_presses_yet_may_be_hit(way, gap):
    hits = way.section(vi.ImpactOscillator(gap=gap, omega=1.0), 100, 100)
    assert int(hits["status"]) == vi.Status.OK
    assert hits.sizes["stick"] == 0


def test_undamped_resonance_is_bounded_by_its_impacts(way):
    """At c = 0, w = w_n an orbit of one impact, here through the stop, has v = pi f / ((1 + r) sqrt(k m))."""
    osc = vi.ImpactOscillator(damping=0.0, omega=1.0, restitution=0.5)
    (orbit,) = vi.find_orbit(osc)
    assert orbit.velocities == pytest.approx([math.pi / 1.5], rel=1e-9)
    assert way.section(osc, 300, 50)["velocity"].max() < math.pi


def test_impact_resonance_without_loss_grows_for_ever_and_is_reported_finite(way):
    osc = vi.ImpactOscillator(damping=0.0, omega=2.0, restitution=1.0)
    early, late = (way.indices(osc, NAMES, transient, 200) for transient in (100, 1000))
    assert late["status"] == vi.Status.OK
    assert late["mean_velocity"] > 2 * early["mean_velocity"]


@pytest.mark.long(but=1)
@pytest.mark.parametrize("gyroscopic", [False, True])
@pytest.mark.parametrize("load", [0.0, 0.1])
def test_masses_that_only_dampers_hold_are_given_up_where_they_never_come_back(load, gyroscopic):
    """Free motion from the last impact, by the exponential of the matrix, is watched over 2,000 periods."""
    rng, outcomes = np.random.default_rng(int(100 * load) + gyroscopic), []
    for _ in range(50):
        n = int(rng.integers(2, 4))
        mass, springs, dampers, turns = (rng.normal(size=(n, n)) for _ in range(4))
        springs[int(rng.integers(1, n)) :] = 0.0
        damping = 0.1 * (dampers @ dampers.T + gyroscopic * (turns - turns.T))
        stop = vi.Stop(direction=rng.normal(size=n), gap=rng.uniform(0.2, 3.0), restitution=0.6)
        drifting = system(
            mass @ mass.T + n * np.eye(n), damping, springs.T @ springs, rng.uniform(0.5, 2.0), [stop],
            {1: 0.3 * rng.normal(size=n)}, constant=load * rng.normal(size=n),
        )  # fmt: skip
        start = vi.State(np.zeros(n), rng.normal(size=n) * rng.choice([0.1, 1.0]))
        hits = impacts(drifting, 20, start=start)
        outcomes.append(vi.Status(int(hits["status"])))
        if outcomes[-1] not in (vi.Status.NO_IMPACT, vi.Status.STOPPED_IMPACTING):
            continue
        number, phase = hits.sizes["impact"], 0.0
        if number:
            start = follow(linear(drifting), start.displacement, start.velocity, impacts=number).end
            phase = start.phase
        assert clearance_ahead(drifting, start, phase) > 0.0
    assert outcomes.count(vi.Status.BUDGET) <= 1  # one slides by 0.05 m in 1,000 periods, and hits after 2,600
    assert outcomes.count(vi.Status.NO_IMPACT) + outcomes.count(vi.Status.STOPPED_IMPACTING) > 10


def clearance_ahead(model, state, phase):
    """Return the least clearance of free motion from a state at a phase on, over 2,000 periods at 64 points each."""
    n, omega, inverse, angle = len(model.mass), model.omega, np.linalg.inv(model.mass), 2.0 * math.pi * phase
    flow = np.zeros((2 * n + 3, 2 * n + 3))  # of q, q', sin wt, cos wt, 1
    flow[:n, n : 2 * n] = np.eye(n)
    flow[n : 2 * n, : 2 * n] = -inverse @ np.hstack([model.stiffness, model.damping])
    flow[n : 2 * n, 2 * n] = inverse @ model.force.harmonics[1].real
    flow[n : 2 * n, -1] = inverse @ model.force.constant
    flow[2 * n, 2 * n + 1], flow[2 * n + 1, 2 * n] = omega, -omega
    step = expm(flow * model.period / 64.0)
    now = np.hstack([state.displacement, state.velocity, math.sin(angle), math.cos(angle), 1.0])
    block, least = np.column_stack([np.linalg.matrix_power(step, j) @ now for j in range(1, 65)]), math.inf
    period = np.linalg.matrix_power(step, 64)
    for _ in range(2000):
        least = min(least, float((model.stops[0].gap - model.stops[0].direction @ block[:n]).min()))
        block = period @ block
    return least


@pytest.mark.parametrize("offset", [-1e-15, 0.0, 1e-15])
def test_an_impact_next_to_the_start_of_a_period_keeps_its_time(way, offset):
    osc = vi.ImpactOscillator(omega=2.0)
    hits = way.section(osc, 0, 1, start=vi.State(0.0, 1.0, (3.0 + offset) * osc.period))
    assert hits["time"].values[0] == pytest.approx(3 * osc.period, rel=1e-14)
    assert 0.0 <= hits["phase"].values[0] < 1.0


def test_nearly_equal_velocities_have_a_tiny_std_not_the_rounding_of_their_squares(way):
    indices = way.indices(vi.ImpactOscillator(omega=2.0), NAMES, 300 if way.slow else 2000, 100 if way.slow else 5000)
    assert 0.0 <= indices["std"] < 1e-13


def test_a_long_transient_of_periods_is_within_the_budget():
    looks = vi.stroboscopic_section(vi.ImpactOscillator(omega=2.8), transient_periods=2000, sample_periods=1)
    assert looks.sizes["period"] == 1


# Several stops, many modes


@pytest.mark.parametrize("gap", [0.2, 0.0])
@pytest.mark.parametrize("n", [1, 2])
def test_parallel_stops_at_one_place_are_struck_together_and_flagged(n, gap):
    one = np.eye(2)[0, :n]
    stops = [
        vi.Stop(direction=one, gap=gap, restitution=0.5),
        vi.Stop(direction=3 * one, gap=3 * gap, restitution=0.7),
    ]
    spring = np.array([[2.0, -1.0], [-1.0, 2.0]])[:n, :n]
    hits = impacts(system(np.eye(n), 0.1 * np.eye(n), spring, 0.8, stops, {1: [1.0, 0.5][:n]}), 20)
    assert hits["simultaneous"].values.all()
    assert hits["velocity"].values[1::2] == pytest.approx(3 * hits["velocity"].values[::2], rel=1e-11)


def test_stops_without_room_between_them_hand_a_mass_to_each_other():
    slot = system(1, 0.1, 1, 1.0, [vi.Stop(direction=1, gap=0.0), vi.Stop(direction=-1, gap=0.0)], {1: 1.0})
    motion = vi.simulate(slot, periods=5)
    assert motion.sizes["impact"] == 0
    assert np.abs(motion["displacement"].values).max() < 1e-15


def twelve_modes():
    """Return twelve coupled masses before five stops under three harmonics."""
    rng, n = np.random.default_rng(3), 12
    root = rng.normal(size=(n, n))
    stiffness = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    stops = [vi.Stop(direction=np.eye(n)[2 * j + 1], gap=0.4 + 0.1 * j, restitution=0.6) for j in range(5)]
    force = {1: np.ones(n), 5: 0.3 * rng.normal(size=n), 12: 0.2 * rng.normal(size=n)}
    return system(np.eye(n) + 0.05 * root @ root.T / n, 0.02 * stiffness, stiffness, 0.35, stops, force)


BOUNCY = [vi.Stop(direction=[1, 0], gap=0.1, restitution=1.0), vi.Stop(direction=[0, 1], gap=0.1, restitution=0.0)]
SLANTED = [vi.Stop(direction=[1, 0.1], gap=0.3, restitution=0.6)]


@pytest.mark.parametrize(
    ("model", "near"),
    [
        (system(np.eye(2), 0.05 * np.eye(2), [[2, -1], [-1, 2]], 0.8, BOUNCY, {1: [1.0, 0.4]}), 1e-9),
        (system(np.eye(2), np.diag([0.1, 4.0]), np.diag([1.0, 1e4]), 0.9, SLANTED, {1: [1.0, 0.0]}), 1e-8),
        (twelve_modes(), 1e-9),
    ],
    ids=["no rebound beside no loss", "a stiff mode beside a slow one", "twelve modes, five stops, twelve harmonics"],
)
def test_hard_designs_make_the_impacts_of_the_witness(model, near):
    rest = np.zeros(len(model.mass))
    ours, theirs = (code.impacts(model, rest, rest, number=8) for code in (Engine(), Witness()))
    assert ours["velocity"] == pytest.approx(theirs["velocity"], rel=near)
    assert ours["time"] == pytest.approx(theirs["time"], rel=near)


# Energy and room

LOSSLESS = {
    "one mass": vi.ImpactOscillator(amplitude=0.0, damping=0.0, restitution=1.0, gap=0.3),
    "two masses": system(np.eye(2), 0, [[2, -1], [-1, 2]], 1.0, [vi.Stop(direction=[1, 0], gap=0.3, restitution=1.0)]),
}


@pytest.mark.parametrize("name", LOSSLESS)
def test_without_any_loss_energy_stays(name):
    model = LOSSLESS[name]
    form = model.system if model.forgets else model
    start = vi.State(0.0, 1.0) if name == "one mass" else vi.State([0.0, 0.0], [1.0, 0.0])
    motion = vi.simulate(model, start=start, periods=100, samples_per_period=4)
    q, v = (motion[part].values.reshape(-1, len(form.mass)) for part in ("displacement", "velocity"))
    energy = ((q @ form.stiffness) * q + v * v).sum(axis=1) / 2
    assert energy == pytest.approx(np.full(len(energy), 0.5), rel=1e-11)
    assert motion.sizes["impact"] > 50


def test_energy_never_grows_at_ten_thousand_impacts():
    rng, count = np.random.default_rng(10), 0
    while count < 10_000:
        model = a_random_system(rng, int(rng.integers(1, 5)), int(rng.integers(1, 4)))
        if (model.clearances(np.zeros(len(model.mass))) < 0.0).any():
            continue
        hits = impacts(model, 200)
        lost, most = hits["energy_lost"].values, hits["velocity"].values * hits["impulse"].values
        assert (lost >= -1e-12 * most).all()
        assert (lost <= 0.5 * (1.0 + 1e-12) * most).all()
        count += len(lost)


def test_no_flight_passes_a_stop():
    """Leaps and steps alike: clearances between impacts, looked at densely, are never below rounding."""
    for seed in range(12):
        rng = np.random.default_rng(1000 + seed)
        n = int(rng.integers(1, 5))
        root = rng.normal(size=(n, n))
        stiffness, mass = root @ root.T / n + 0.2 * np.eye(n), np.diag(rng.uniform(0.5, 2.0, n))
        built = vi.ImpactSystem(
            mass=mass,
            damping=0.02 * mass + 0.01 * stiffness,
            stiffness=stiffness,
            force=vi.Force(omega=rng.uniform(0.3, 2.0), harmonics={1: rng.normal(size=n), 2: 0.3 * rng.normal(size=n)}),
            stops=[
                vi.Stop(direction=rng.normal(size=n), gap=rng.uniform(0.0, 0.6), restitution=rng.uniform(0.0, 1.0))
                for _ in range(int(rng.integers(1, 4)))
            ],
        )
        motion = vi.simulate(built, periods=40, samples_per_period=500)
        size = np.abs(motion.displacement).max().item() + 1.0
        assert motion.clearance.min().item() > -1e-12 * size


def overdamped(rng):
    """Return a system whose fastest components decay in a small part of a period, and what it moves on from."""
    n = int(rng.integers(1, 6))
    inertia, springs, dampers = (rng.standard_normal((n, n)) for _ in range(3))
    stiffness = springs @ np.diag(10.0 ** rng.uniform(0.0, 2.0, n)) @ springs.T + 0.1 * np.eye(n)
    viscous = (dampers * 10.0 ** rng.uniform(0.0, 1.2, n)) @ (dampers * 10.0 ** rng.uniform(0.0, 1.2, n)).T
    damping = rng.choice([0.1, 1.0, 10.0]) * stiffness if rng.random() < 0.5 else 0.5 * (viscous + viscous.T)
    damping += max(0.0, -2.0 * np.linalg.eigvalsh(damping)[0]) * np.eye(n)
    gives = {"stiffness": 10.0 ** rng.uniform(1.0, 3.0), "name": "soft"}
    stops = [
        vi.Stop(direction=rng.standard_normal(n), gap=rng.uniform(0.1, 1.0), name="hard", restitution=0.5),
        vi.Stop(direction=rng.standard_normal(n), gap=rng.uniform(0.1, 1.0), **gives),
    ]
    load = {1: rng.standard_normal(n), 3: 0.3 * rng.standard_normal(n)}
    flow = Flow(system(inertia @ inertia.T + np.eye(n), damping, stiffness, rng.uniform(0.5, 2.0), stops, load))
    start = np.concatenate([rng.standard_normal(2 * n), flow.drive(rng.uniform(0.0, 6.0))])
    return Leg(flow, start, 2.0 * math.pi * rng.uniform(0.3, 3.0), (1,) if rng.random() < 0.5 else ())


@pytest.mark.long(but=4)
@pytest.mark.parametrize("seed", range(24))
def test_components_that_have_decayed_need_no_places_and_hide_no_turning_point(seed):
    """Clearances are those of the matrix exponential, and nowhere below their minima."""
    leg = overdamped(np.random.default_rng(seed))
    law, rows = sampled(leg)[0].stage.law, clearances(leg.flow)
    everywhere = evenly(leg, 30_000).along(rows)
    parts = sampled(leg)
    assert sum(len(part.angles) for part in parts) < 6000
    for course in courses(leg):
        sign = -1.0 if course.stop in leg.pushing else 1.0  # there the force, which is -u over the stiffness
        for angles, gaps in ((course.angles, course.gaps), (course.places, course.lowest)):
            some = np.linspace(0, len(angles) - 1, min(len(angles), 12)).astype(int)
            exact = [sign * float(rows[course.stop] @ expm(law * angle) @ leg.start) for angle in angles[some]]
            np.testing.assert_allclose(gaps[some], exact, rtol=0.0, atol=1e-11 * course.size)
        lowest = min(course.gaps.min(), course.lowest.min(initial=math.inf))
        assert lowest <= (sign * everywhere[course.stop]).min() + 1e-11 * course.size
