"""The engine of systems against closed forms, the oscillator of one mass, identities and the witness."""

import json
import math

import mpmath as mp
import numpy as np
import pytest

import vibroimpact as vi
from systems import a_random_system, impacts, linear, one_mass, outcome, system, two_masses
from vibroimpact import Status
from vibroimpact.backends.reference.systems import follow

pytestmark = pytest.mark.usefixtures("modal_engine")

# What the class allows is followed, and labelled.


def test_a_system_without_any_harmonic_starts_where_it_is_told():
    ball = system(1, 0, 0, 1.0, [vi.Stop(direction=1, gap=0.0, restitution=0.5)], constant=[2.0])
    hits = impacts(ball, 3, start=vi.State([-1.0], [0.0]))
    assert hits["velocity"].values == pytest.approx([2.0, 1.0, 0.5], rel=1e-14)
    assert hits["time"].values == pytest.approx([1.0, 2.0, 2.5], rel=1e-14)


def test_a_result_says_how_its_stops_move():
    made = json.loads(vi.simulate(two_masses(), periods=1).attrs["system"])
    assert made["stops"][0]["motion"] == {"1": [0.01, 0.0]}


# One coordinate and one stop are the oscillator.


@pytest.mark.parametrize(
    ("osc", "start"),
    [
        (
            vi.ImpactOscillator(mass=1.0, damping=0.11, stiffness=1.47, amplitude=0.63, omega=0.32, restitution=0.0),
            None,
        ),
        (vi.ImpactOscillator(amplitude=0.4, omega=0.8, gap=-1.0, restitution=0.6), vi.State(-1.5, 0.0)),
        (vi.ImpactOscillator(damping=0.34, amplitude=1.0, gap=1.1, omega=0.2), vi.State(1.0, 3.0)),
        (vi.ImpactOscillator(damping=0.4, stiffness=2.5, omega=1.1, restitution=0.03, gap=-0.4), vi.State(-1.0, 0.0)),
    ],
)
def test_sticks_and_status_are_those_between_the_first_and_the_last_impact(osc, start):
    there = start and vi.State([start.displacement], [start.velocity])
    for transient in (0, 2):
        own, other = impacts(osc, 15, transient, start=start), impacts(one_mass(osc), 15, transient, start=there)
        assert int(own["status"]) == int(other["status"])
        for name in ("stick_time", "release_time", "time", "velocity"):
            np.testing.assert_allclose(other[name].values, own[name].values, rtol=1e-12, err_msg=name)


def test_a_map_and_a_section_agree_on_a_stop_that_is_closed_before_and_after_the_window():
    pressed = vi.Stop(direction=[1, 0], gap=0.0, restitution=0.5, name="seat")
    struck = vi.Stop(direction=[0, 1], gap=0.2, restitution=0.7, name="bar")
    both = system(
        np.eye(2), 0.1 * np.eye(2), [[2, -0.1], [-0.1, 1]], 1.3, [pressed, struck], {1: [0, 1]}, constant=[5.0, 0.0]
    )
    assert outcome(both, 40, transient=10) == Status.STICKING
    found = vi.parameter_map(both, omega=[1.3], transient_impacts=10, sample_impacts=40)
    assert Status(int(found["status"].values[0])) == Status.STICKING


# A stop at which a system rests in balance is held or left by the first derivative that does not vanish.

CHAIN = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])


def chain(n):
    stiffness = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    stiffness[-1, -1] = 1.0
    return stiffness


def clearance_of_the_free_chain(n, damping, time):
    """Return minus the last displacement of a chain from rest under -sin(0.9 t) at its first mass, with 40 digits."""
    with mp.workdps(40):
        found, w = mp.mpf(0), mp.mpf("0.9")
        for j in range(n):
            angle = (2 * j + 1) * mp.pi / (2 * n + 1)
            shape = [mp.sin((i + 1) * angle) for i in range(n)]
            square = 2 - 2 * mp.cos(angle)
            c = mp.mpf(damping) * square
            steady = -shape[0] / (square - w * w + 1j * w * c)
            s = mp.sqrt(square - c * c / 4)
            y, p = -steady.imag, -w * steady.real
            free = mp.exp(-c * time / 2) * (y * mp.cos(s * time) + (p + c / 2 * y) / s * mp.sin(s * time))
            found += ((steady * mp.expj(w * time)).imag + free) * shape[-1] / sum(x * x for x in shape)
        return float(-found)


@pytest.mark.parametrize("damping", ["0", "0.02"])
@pytest.mark.parametrize("n", [1, 2, 3, 4, 6, 9])
def test_a_chain_pulled_at_its_far_end_leaves_the_stop_it_rests_at(n, damping):
    # Of the last clearance the first derivative that is not zero has the order 2 n + 1 without damping.
    load, last = np.eye(n)[0], np.eye(n)[-1]
    stop = vi.Stop(direction=last, gap=0.0, restitution=0.7)
    pulled = system(np.eye(n), float(damping) * chain(n), chain(n), 0.9, [stop], {1: -load})
    hits = impacts(pulled, 2)
    time, v = mp.mpf(float(hits["time"][0])), float(hits["velocity"][0])
    assert clearance_of_the_free_chain(n, damping, time) == pytest.approx(0.0, abs=1e-13)
    assert all(clearance_of_the_free_chain(n, damping, time * i / 40) > 0 for i in range(20, 40))
    step = 1e-6
    before = clearance_of_the_free_chain(n, damping, time - step)
    after = clearance_of_the_free_chain(n, damping, time + step)
    assert (before - after) / (2 * step) == pytest.approx(v, rel=1e-9)


@pytest.mark.parametrize("n", [2, 3, 4])
def test_a_chain_pushed_at_its_far_end_is_held_by_the_stop_it_rests_at(n):
    stop = vi.Stop(direction=np.eye(n)[-1], gap=0.0, restitution=0.7)
    pushed = system(np.eye(n), 0.02 * chain(n), chain(n), 0.9, [stop], {1: np.eye(n)[0]})
    seen = follow(linear(pushed), np.zeros(n), np.zeros(n), impacts=3)
    motion = vi.simulate(pushed, periods=3)
    assert motion["stick_time"].values[0] == 0.0
    released = next(event.time for event in seen.events if event.kind == "release")
    assert motion["release_time"].values[0] == pytest.approx(released, rel=1e-12)
    assert motion["impact_time"].values[0] == pytest.approx(seen.impacts[0].time, rel=1e-12)


@pytest.mark.parametrize("stiffness", [0.0, 1.0])
def test_a_mass_that_rests_at_a_stop_and_is_not_moved_stays_there(stiffness):
    osc = system(1, 0.1, stiffness, 1.0, [vi.Stop(direction=1, gap=0.0)])
    assert outcome(osc) == Status.STUCK_FOREVER


def test_stops_without_room_between_them_hand_a_mass_to_each_other():
    slot = system(1, 0.1, 1, 1.0, [vi.Stop(direction=1, gap=0.0), vi.Stop(direction=-1, gap=0.0)], {1: 1.0})
    motion = vi.simulate(slot, periods=5)
    assert motion.sizes["impact"] == 0
    assert np.abs(motion["displacement"].values).max() < 1e-15


# Closed forms.

THREE = {
    "two-sided": (
        system(
            *(1, 0.05, 1, 2.0),
            [vi.Stop(direction=1, gap=0.5, restitution=0.6), vi.Stop(direction=-1, gap=0.5, restitution=0.6)],
            {1: 1.0},
        ),
        (1.01091975000998629752895, 0.30697182627669859292),
    ),
    "three masses": (
        system(
            *(np.eye(3), 0.02 * CHAIN, CHAIN, 0.9),
            [vi.Stop(direction=[0, 0, 1], gap=0.5, restitution=0.7)],
            {1: [1, 0, 0]},
        ),
        (0.6314772880991517553058458, 0.61512189651226436508),
    ),
    "impact damper": (
        system(
            *(np.diag([1, 0.1]), np.diag([0.02, 0]), np.diag([1, 0]), 1.0),
            [
                vi.Stop(direction=[-1, 1], gap=10.0, restitution=0.8),
                vi.Stop(direction=[1, -1], gap=10.0, restitution=0.8),
            ],
            {1: [1, 0]},
        ),
        (9.407221992561745893002965, 0.74256436841325221938),
    ),
}


@pytest.mark.parametrize("name", THREE)
def test_attractors_have_the_velocity_and_phase_of_their_closed_form(name):
    model, (velocity, phase) = THREE[name]
    hits = impacts(model, 100, transient=3000)
    assert hits["velocity"].values == pytest.approx(velocity, rel=1e-12)
    turns = 2 if len(model.stops) == 2 else 1
    assert (hits["phase"].values - phase) * turns == pytest.approx(np.round((hits["phase"] - phase) * turns), abs=1e-11)
    assert len(set(hits["stop"].values)) == turns


def ball(gamma, r):
    """Return a ball on a table of amplitude A, gamma = A w^2/g; the coordinate points down."""
    table = vi.Stop(direction=1, gap=0.0, restitution=r, motion={1: -gamma})
    return system(1, 0, 0, 1.0, [table], constant=[1.0])


@pytest.mark.parametrize("gamma", [1.1, 1.3, 1.5])
def test_a_ball_bounces_once_a_period_at_its_fixed_point(gamma):
    r = 0.5
    fold = math.pi * (1 - r) / (1 + r)
    phase = math.acos(fold / gamma) / (2 * math.pi)  # of the table, at the contact
    flight = math.pi  # g T / 2 of the ball's own speed just after and before a bounce
    table = gamma * math.cos(2 * math.pi * phase)
    begun = vi.State([-gamma * math.sin(2 * math.pi * phase)], [-flight], 2 * math.pi * phase)
    hits = impacts(ball(gamma, r), 200, transient=400, start=begun)
    assert hits["velocity"].values == pytest.approx(flight + table, rel=1e-12)
    assert hits["phase"].values == pytest.approx(phase, abs=1e-12)


def test_energy_never_grows_at_ten_thousand_impacts():
    rng, seen = np.random.default_rng(10), 0
    while seen < 10_000:
        model = a_random_system(rng, int(rng.integers(1, 5)), int(rng.integers(1, 4)))
        if (model.clearances(np.zeros(len(model.mass))) < 0.0).any():
            continue
        hits = impacts(model, 200)
        lost, most = hits["energy_lost"].values, hits["velocity"].values * hits["impulse"].values
        assert (lost >= -1e-12 * most).all()
        assert (lost <= 0.5 * (1.0 + 1e-12) * most).all()
        seen += len(lost)


# One coordinate and one stop, at random.


@pytest.mark.long
def test_random_systems_of_one_coordinate_move_as_the_oscillator_does():
    rng = np.random.default_rng(20261123)
    names, sticks, settled = ("velocity", "time", "phase", "stick_time", "release_time"), 0, 0
    while settled < 200:
        osc = vi.ImpactOscillator(
            mass=rng.uniform(0.3, 3),
            stiffness=rng.uniform(0.3, 3),
            damping=rng.uniform(0.05, 0.5),
            amplitude=rng.uniform(0.3, 2),
            omega=rng.choice([rng.uniform(0.1, 0.5), rng.uniform(0.6, 3)]),
            restitution=rng.choice([0.0, rng.uniform(0.1, 0.6)]),
            gap=rng.uniform(-0.3, 0.3),
        )
        own, other = impacts(osc, 20, 100), impacts(one_mass(osc), 20, 100)
        assert int(own["status"]) == int(other["status"])
        sticks += own.sizes["stick"]
        assert own.sizes["impact"] == other.sizes["impact"]
        if not own.sizes["impact"]:
            continue
        drift = impacts(osc, 20, 100, start=vi.State(min(0.0, osc.gap) - 1e-9))
        if drift.sizes["impact"] != own.sizes["impact"] or np.abs(drift["velocity"] - own["velocity"]).max() > 1e-9:
            continue  # not settled
        settled += 1
        for name in names:
            size = osc.period if "time" in name else 1.0
            np.testing.assert_allclose(other[name] / size, own[name] / size, rtol=1e-12, atol=1e-12, err_msg=name)
    assert sticks > 100


def test_indices_of_maps_are_those_of_the_oscillator():
    osc = vi.ImpactOscillator(damping=0.2, omega=1.4, restitution=0.6, gap=0.1)
    names = ("std", "mean_velocity", "max_velocity", "impacts_per_period", "dissipation", "impact_phase_spread")
    axis = np.linspace(0.3, 3.0, 40)
    own, other = (
        vi.parameter_map(model, omega=axis, indices=names, transient_impacts=2000, sample_impacts=600)
        for model in (osc, one_mass(osc))
    )
    once = (own["impacts_per_period"].values == 1.0) & np.isclose(own["std"], 0.0, atol=1e-9)
    assert once.sum() > 8
    for name in names:
        np.testing.assert_allclose(
            other[name].values[once], own[name].values[once], rtol=1e-10, atol=1e-10, err_msg=name
        )


def after(model, state, begin, turns):
    """Return the state a number of driving periods later."""
    n = len(model.mass)
    start = vi.State(state[:n].tolist(), state[n:].tolist(), begin)
    motion = vi.simulate(model, start=start, periods=turns, samples_per_period=64)
    return np.concatenate([motion["displacement"].values[-1], motion["velocity"].values[-1]]), motion


@pytest.mark.parametrize("name", THREE)
def test_volumes_shrink_by_the_damping_and_by_the_square_of_the_restitution(name):
    model = THREE[name][0]
    n, turns, step = len(model.mass), 0.75, 1e-4
    hits = impacts(model, 1, transient=2000)
    begin = (float(hits["phase"][0]) + 1.0 - 0.125) * model.period  # an eighth of a period before an impact
    looks = vi.stroboscopic_section(model, phase=begin / model.period % 1.0, transient_periods=3000, sample_periods=1)
    state = np.concatenate([looks["displacement"].values[0], looks["velocity"].values[0]])
    begin = begin % model.period
    number = after(model, state, begin, turns)[1].sizes["impact"]
    assert number > 0
    jacobian = []
    for unit in step * np.eye(2 * n):
        one, two = (
            (
                after(model, state + factor * unit, begin, turns)[0]
                - after(model, state - factor * unit, begin, turns)[0]
            )
            / (2 * factor * step)
            for factor in (1, 2)
        )
        jacobian.append((4 * one - two) / 3)
    loss = np.trace(np.linalg.solve(model.mass, model.damping)) * turns * model.period
    lost = model.stops[0].restitution ** (2 * number) * math.exp(-loss)
    assert np.linalg.det(np.array(jacobian)) == pytest.approx(lost, rel=1e-7)


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
