"""Systems of several coordinates and stops: identities, the witness, and hard cases, each with its outcome."""

import math
import os
from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import expm

import vibroimpact as vi
from systems import changed, difference, impacts, linear, outcome, system, two_masses
from vibroimpact import Status
from vibroimpact.backends.reference.systems import follow

SEEDS, BLOCK = 1000 if "FUZZ" in os.environ else 100, 100  # `make fuzz` asks for all
KEPT = ("velocity", "phase", "time")


def same(one, other, tolerance=1e-11, units=None):
    """Hold the first impacts of two motions to each other."""
    assert one.sizes["impact"] == other.sizes["impact"] > 0
    for name in KEPT:
        factor = (units or {}).get(name, 1.0)
        scale = np.abs(one[name].values).max() * factor
        np.testing.assert_allclose(other[name], one[name] * factor, rtol=0, atol=tolerance * scale, err_msg=name)


@pytest.mark.parametrize("unit", [2.0**-8, 2.0**5])
def test_units_that_are_powers_of_two_give_the_same_numbers(unit):
    plain = impacts(two_masses(), 12)
    same(plain, impacts(changed(two_masses(), mass=unit), 12), 1e-12)
    same(plain, impacts(changed(two_masses(), length=unit), 12), 1e-12, {"velocity": unit})
    same(plain, impacts(changed(two_masses(), time=unit), 12), 1e-12, {"velocity": 1 / unit, "time": unit})


def test_a_shift_of_time_by_periods_changes_nothing():
    model, start = two_masses(), vi.State([0.01, -0.005], [0.3, 0.1], 0.0)
    later = vi.State([0.01, -0.005], [0.3, 0.1], 64 * model.period)
    one, other = impacts(model, 12, start=start), impacts(model, 12, start=later)
    np.testing.assert_allclose(other["velocity"], one["velocity"], rtol=1e-11)
    np.testing.assert_allclose(other["time"] - 64 * model.period, one["time"], rtol=1e-11)


def test_the_order_of_coordinates_and_stops_and_their_signs_change_nothing():
    model = two_masses()
    plain = impacts(model, 12)
    for basis in (np.eye(2)[::-1], -np.eye(2), np.diag([1.0, -1.0]), np.array([[1.0, 0.5], [0.25, -1.0]])):
        same(plain, impacts(changed(model, basis=basis), 12))
    turned = impacts(two_masses(stops=model.stops[::-1]), 12)
    same(plain, turned)
    assert turned["stop"].values.tolist() == plain["stop"].values.tolist()


def test_a_mode_that_is_not_coupled_changes_nothing():
    model = two_masses()
    wider = [np.pad(matrix, (0, 1)) for matrix in (model.mass, model.damping, model.stiffness)]
    for matrix, own in zip(wider, (3.0, 0.7, 11.0), strict=True):
        matrix[2, 2] = own
    stops = [stop.replace(direction=[*stop.direction, 0.0]) for stop in model.stops]
    force = {order: [*load, 2.0j] for order, load in model.force.harmonics.items()}
    constant = [*model.force.constant, 1.0]
    same(impacts(model, 12), impacts(system(*wider, model.omega, stops, force, constant), 12))


def test_two_halves_of_a_mass_move_as_the_whole():
    """Both hit at once; the spring that joins them is never stretched."""
    osc = vi.ImpactOscillator(omega=2.0, damping=0.1, restitution=0.6, gap=0.2)
    halves = system(
        np.eye(2) / 2, 0.05 * np.eye(2), np.array([[0.5, 0.0], [0.0, 0.5]]) + 3.0 * np.array([[1, -1], [-1, 1]]), 2.0,
        [vi.Stop(direction=row, gap=0.2, restitution=0.6) for row in np.eye(2)], {1: [0.5, 0.5]},
    )  # fmt: skip
    whole, both = impacts(osc, 200), impacts(halves, 400)
    assert both["simultaneous"].values.all()
    assert both["velocity"].values[::2] == pytest.approx(whole["velocity"].values, rel=1e-12)
    assert both["time"].values[1::2] == pytest.approx(whole["time"].values, rel=1e-12)


def test_harmonics_of_twice_the_frequency_are_the_first_of_half_the_period():
    stop = vi.Stop(direction=[0, 1], gap=0.1, restitution=0.6)
    given = np.eye(2), 0.1 * np.eye(2), [[2, -1], [-1, 2]]
    one = impacts(system(*given, 1.6, [stop], {1: [1.0, 0.2]}), 30)
    other = impacts(system(*given, 0.8, [stop], {2: [1.0, 0.2]}), 30)
    np.testing.assert_allclose(other["velocity"], one["velocity"], rtol=1e-9)
    np.testing.assert_allclose(other["time"], one["time"], rtol=1e-10)


def drawn(rng):
    """Return a random system of one to four coordinates and one to three stops, and a state before all of them."""
    n, s = int(rng.integers(1, 5)), int(rng.integers(1, 4))

    def positive(least):
        root = rng.normal(size=(n, n))
        return root @ root.T / n + least * np.eye(n)

    mass, stiffness = positive(0.5), positive(0.2)
    if rng.random() < 0.25:
        free = rng.normal(size=n)
        keeps = np.eye(n) - np.outer(free, free) / (free @ free)
        stiffness = keeps @ stiffness @ keeps
    damping = 0.05 * positive(0.1) if rng.random() < 0.5 else 0.03 * mass + 0.02 * stiffness
    stops = [
        vi.Stop(
            direction=rng.normal(size=n),
            gap=rng.uniform(0, 0.5),
            restitution=rng.choice([0.0, rng.uniform(0.1, 0.9)]),
            motion={2: 0.1 * complex(*rng.normal(size=2))} if j and rng.random() < 0.5 else {},
        )
        for j in range(s)
    ]
    force = {1: rng.normal(size=n) + 1j * rng.normal(size=n), 3: 0.5 * rng.normal(size=n)}
    model = system(mass, damping, (stiffness + stiffness.T) / 2, rng.uniform(0.3, 2.0), stops, force)
    for _ in range(1000):
        q = 0.3 * rng.normal(size=n)
        if model.clearances(q).min() > 0.05:
            return model, q, rng.normal(size=n)
    return drawn(rng)  # its stops leave too little room


def test_random_systems_make_the_impacts_of_the_witness():
    sticks = compared = 0
    for seed in range(40):
        model, q, speed = drawn(np.random.default_rng([7, seed]))
        cut = 1e-9 * model.velocity_scale
        seen = follow(linear(model), q, speed, impacts=10, most_periods=30, cut=cut)
        sticks += any(event.kind == "stick" for event in seen.events)
        number = len(seen.impacts)
        if not number:
            continue
        near = 1e-9 * np.random.default_rng(seed).normal(size=len(q))
        own, other = (impacts(model, number, start=vi.State(at.tolist(), speed.tolist())) for at in (q, q + near))
        period, scale = model.period, max(own["velocity"].values.max(), 1e-3)
        both = min(own.sizes["impact"], other.sizes["impact"])
        apart = np.maximum(
            np.abs(other["velocity"].values[:both] - own["velocity"].values[:both]) / scale,
            np.abs(other["time"].values[:both] - own["time"].values[:both]) / period,
        )
        growth = np.maximum(np.maximum.accumulate(apart / 1e-9), 1.0)
        for at in np.flatnonzero(growth < 1e6):
            event = seen.impacts[at]
            assert model.stop_names[event.stop] == own["stop"].values[at], (seed, at)
            assert abs(event.velocity - own["velocity"].values[at]) < 1e-11 * scale * growth[at], (seed, at)
            assert abs(event.time - own["time"].values[at]) < 1e-11 * period * growth[at], (seed, at)
            compared += 1
    assert compared > 250
    assert sticks > 8


@pytest.mark.long
@pytest.mark.parametrize("first", range(0, SEEDS, BLOCK))
def test_the_first_20_impacts_of_random_systems_are_those_of_the_witness(first):
    """Up to two stops struck so soon after one another that rounding decides which is struck next."""
    compared = squeezed = 0
    for seed in range(first, first + BLOCK):
        model, q, speed = drawn(np.random.default_rng([7, seed]))
        cut, apart = 1e-9 * model.velocity_scale, 1e-9 * model.period
        try:
            seen = follow(linear(model), q, speed, impacts=20, most_periods=30, cut=cut).impacts[:20]
        except ValueError:  # a stop that moves squeezes a mass against another
            squeezed += 1
            continue
        pairs = enumerate(pairwise(seen), start=1)
        sure = next((at for at, (a, b) in pairs if a.stop != b.stop and b.time - a.time < apart), len(seen))
        number, wrong, what = difference(seed, model, q, speed, sure)
        assert wrong < 1e-11, (seed, what)
        compared += number
    assert compared > 15 * BLOCK
    assert squeezed < 0.02 * BLOCK


def of_whole_numbers(rng):
    """Return a chain of small whole numbers and a speed: gaps of 0, r of 0 and 1, masses that nothing holds."""
    n = int(rng.integers(1, 4))
    stiffness = np.diag(rng.integers(0, 3, n)).astype(float)
    for i in range(n - 1):
        stiffness[i : i + 2, i : i + 2] += rng.integers(0, 3) * np.array([[1.0, -1.0], [-1.0, 1.0]])
    stops, known = [], set()
    for _ in range(rng.integers(1, 4)):
        direction = rng.integers(-1, 2, n)
        if direction.any() and tuple(direction) not in known:  # which of two at one place is struck, rounding decides
            known.add(tuple(direction))
            moves = {1: float(rng.integers(-1, 2))} if rng.random() < 0.3 else {}
            gap, ratio = float(rng.choice([0, 0, 1, 2])), float(rng.choice([0, 1, 0.5]))
            stops.append(vi.Stop(direction=direction, gap=gap, restitution=ratio, motion=moves))
    damping = rng.choice([0.0, 0.1, 1.0]) * np.diag(rng.integers(0, 2, n))
    mass, load, constant = np.diag(rng.integers(1, 4, n)), rng.integers(-2, 3, n), rng.integers(-1, 2, n)
    model = system(mass, damping, stiffness, rng.choice([1.0, 2.0, 0.5]), stops, {1: load}, constant=constant)
    return model, (rng.integers(-1, 2, n) * rng.integers(0, 2)).astype(float)


@pytest.mark.long
def test_systems_of_whole_numbers_make_the_impacts_of_the_witness():
    """Two motions stay together until rounding decides: a stop is just touched, or struck just after another."""
    compared = 0
    for seed in range(80):
        model, speed = of_whole_numbers(np.random.default_rng([23, seed]))
        start, cut = np.zeros(len(speed)), 1e-9 * model.velocity_scale
        try:
            seen = follow(linear(model), start, speed, impacts=12, most_periods=20, cut=cut).impacts[:12]
        except ValueError:  # a stop that moves squeezes a mass against another
            continue
        own = impacts(model, 12, start=vi.State(start.tolist(), speed.tolist()))
        hard = 1e-6 * max([model.velocity_scale, *(event.velocity for event in seen)])
        touched = [event.time for event in seen if event.velocity < hard]
        touched += own["time"].values[own["velocity"].values < hard].tolist()
        after = [(b.time, b.time - a.time) for a, b in pairwise(seen) if a.stop != b.stop]
        touched += [time for time, since in after if 0.0 < since < 1e-3 * model.period]
        until = min([*touched, math.inf]) - 1e-6
        known = sorted((e.time, model.stop_names[e.stop], e.velocity) for e in seen if e.time < until)
        found = sorted(zip(*(own[name].values.tolist() for name in ("time", "stop", "velocity")), strict=True))
        assert len(found) >= len(known), seed
        for one, other in zip(known, found, strict=False):
            assert one[1] == other[1], seed
            assert (one[0], one[2]) == pytest.approx((other[0], other[2]), rel=1e-7, abs=hard), seed
        compared += len(known)
    assert compared > 300


def test_cells_of_a_map_do_not_depend_on_grid_order_or_workers():
    model, axis = two_masses(), np.linspace(5.0, 12.0, 37)
    names, window = ("std", "mean_velocity", "max_velocity"), {"transient_impacts": 30, "sample_impacts": 60}
    whole = vi.parameter_map(model, omega=axis, indices=names, workers=1, **window)
    parts = vi.parameter_map(model, omega=axis[::5], indices=names, workers=2, **window)
    for name in (*names, "status"):
        np.testing.assert_array_equal(parts[name].values, whole[name].values[::5])
    for at in range(0, 37, 6):
        alone = impacts(model.replace(omega=float(axis[at])), 60, 30)
        assert alone["velocity"].values.max() == whole["max_velocity"].values[at]
        assert Status(int(alone["status"])) == Status(int(whole["status"].values[at]))


def test_a_coupled_mode_remembers_what_was_before_a_stick():
    stop = vi.Stop(direction=[1, 0], gap=0.0, restitution=0.0)
    model = system(np.eye(2), 0.02 * np.eye(2), [[2, -1], [-1, 2]], 0.5, [stop], {1: [2.0, 0.3]})
    one, other = (vi.simulate(model, start=vi.State([-0.3, q], [0.0, 0.0]), periods=3) for q in (0.0, 0.4))
    assert one.sizes["stick"] > 0 < other.sizes["stick"]
    last = -1, slice(None)
    assert np.abs(one["displacement"].values[last] - other["displacement"].values[last]).max() > 1e-3


# Hard cases.


def test_chatter_on_two_stops_at_once_ends_in_their_corner():
    stops = [
        vi.Stop(direction=[1, 0.3], gap=0.0, restitution=0.7),
        vi.Stop(direction=[-0.3, 1], gap=0.0, restitution=0.5),
    ]
    corner = system(np.eye(2), 0, np.zeros((2, 2)), 0.1, stops, constant=[1.0, 1.3])
    hits = impacts(corner, 1000, start=vi.State([-1.0, -1.0], [0.0, 0.0]))
    assert Status(int(hits["status"])) == Status.STUCK_FOREVER
    assert sorted(set(hits["stop"].values)) == ["stop_1", "stop_2"]
    assert hits["velocity"].values[-1] < 1e-6


def test_a_stop_is_struck_while_another_is_closed():
    stops = [vi.Stop(direction=[1, 0], gap=0.0, restitution=0.5), vi.Stop(direction=[0, 1], gap=0.2, restitution=0.7)]
    both = system(np.eye(2), 0.1 * np.eye(2), [[2, -0.1], [-0.1, 1]], 1.3, stops, {1: [0, 1]}, constant=[5.0, 0.0])
    hits = impacts(both, 30, start=vi.State([0.0, 0.0], [0.0, 0.0]))
    assert set(hits["stop"].values) == {"stop_2"}
    assert hits["stick_stop"].values.tolist() == ["stop_1"]
    assert np.isnan(hits["release_time"].values[0])


def test_a_mass_that_drifts_away_is_seen_to():
    free = system(1, 0, 0, 1.0, [vi.Stop(direction=1, gap=1.0, restitution=0.5)])
    assert outcome(free, start=vi.State([0.0], [-1.0])) == Status.NO_IMPACT
    assert outcome(free) == Status.NO_IMPACT  # it never moves
    once = impacts(free, 5, start=vi.State([0.0], [1.0]))
    assert once["velocity"].values == pytest.approx([1.0])
    assert Status(int(once["status"])) == Status.STOPPED_IMPACTING


@pytest.mark.parametrize(
    ("damping", "constant", "speed", "outcomes"),
    [
        (0.0, -1.0, 1.3, {Status.NO_IMPACT}),  # thrown to 0.845 of the way, it falls back
        (0.0, -1.0, 1.5, {Status.STOPPED_IMPACTING}),
        (1.0, 0.0, 0.9, {Status.NO_IMPACT}),  # drag stops it after 0.9
        (1.0, 0.0, 1.1, {Status.STOPPED_IMPACTING}),
        (0.0, 1.0, -5.0, {Status.STUCK_FOREVER}),  # it comes back and stays; beside it the other moves on
        (1.0, 1.0, -5.0, {Status.STUCK_FOREVER}),
    ],
)
def test_a_free_mass_is_given_up_where_it_never_comes_back(damping, constant, speed, outcomes):
    stop = vi.Stop(direction=1, gap=1.0, restitution=0.5)
    free = system(1, damping, 0, 1.0, [stop], {1: 0.001}, constant=[constant])
    assert outcome(free, start=vi.State([0.0], [speed])) in outcomes
    # Beside a mass on a spring, which the drift has nothing to do with, it is the same.
    beside = vi.Stop(direction=[1, 0], gap=1.0, restitution=0.5)
    both = system(np.eye(2), np.diag([damping, 0.1]), np.diag([0.0, 1.0]), 1.0, [beside], {1: [0.001, 0.3]},
                  constant=[constant, 0.0])  # fmt: skip
    assert outcome(both, start=vi.State([0.0, 0.0], [speed, 0.0])) in outcomes


def test_a_free_mass_that_damping_couples_to_another_is_waited_for():
    """It is shaken to and fro far from the stop, towards which it drifts."""
    stop, start = vi.Stop(direction=[1, 0], gap=0.1, restitution=0.5), vi.State([-60.0, 0.0], [-8.0, 0.0])
    free = system(np.eye(2), [[0.02, -0.01], [-0.01, 0.05]], np.diag([0.0, 1.0]), 1.0, [stop], {1: [10.0, 1.0]})
    hits = impacts(free, 1, start=start)
    seen = follow(linear(free), [-60.0, 0.0], [-8.0, 0.0], impacts=1, cut=1e-9 * free.velocity_scale)
    assert hits["time"].values == pytest.approx([seen.impacts[0].time], rel=1e-11)
    assert seen.impacts[0].time > 4 * free.period


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
        outcomes.append(Status(int(hits["status"])))
        if outcomes[-1] not in (Status.NO_IMPACT, Status.STOPPED_IMPACTING):
            continue
        number, phase = hits.sizes["impact"], 0.0
        if number:
            start = follow(linear(drifting), start.displacement, start.velocity, impacts=number).end
            phase = start.phase
        assert clearance_ahead(drifting, start, phase) > 0.0
    assert outcomes.count(Status.BUDGET) <= 1  # one slides by 0.05 m in 1,000 periods, and hits after 2,600
    assert outcomes.count(Status.NO_IMPACT) + outcomes.count(Status.STOPPED_IMPACTING) > 10


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


def test_a_system_without_stops_moves_freely_from_where_it_begins():
    free = system(np.diag([1.0, 2.0]), np.zeros((2, 2)), np.diag([1.0, 8.0]), 1.3, [])
    motion = vi.simulate(free, start=vi.State([0.3, -0.1], [0.0, 0.4]), periods=5)
    t = motion["time"].values
    np.testing.assert_allclose(motion["displacement"][:, 0], 0.3 * np.cos(t), atol=1e-13)
    np.testing.assert_allclose(motion["displacement"][:, 1], 0.2 * np.sin(2 * t) - 0.1 * np.cos(2 * t), atol=1e-13)


def test_a_system_at_rest_never_moves():
    assert (
        outcome(two_masses(force=vi.Force(omega=8.0), stops=[vi.Stop(direction=[0, 1], gap=0.1)])) == Status.NO_IMPACT
    )


def test_an_undamped_mode_at_resonance_grows_until_it_hits():
    hits = impacts(system(1, 0, 1, 1.0, [vi.Stop(direction=1, gap=5.0)], {1: 1.0}), 1)
    time = float(hits["time"][0])
    assert (np.sin(time) - time * np.cos(time)) / 2 == pytest.approx(5.0, rel=1e-12)
    assert hits["velocity"].values == pytest.approx([time * np.sin(time) / 2], rel=1e-12)


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


def test_a_stop_that_moves_away_opens_its_contact():
    table = system(1, 0, 0, 1.0, [vi.Stop(direction=1, gap=0.0, restitution=0.0, motion={1: -2.0})], constant=[1.0])
    motion = vi.simulate(table, periods=5)
    assert motion["release_time"].values[0] == pytest.approx(np.arcsin(0.5), rel=1e-13)  # where 2 sin(t) = 1


def test_without_any_loss_energy_stays():
    stops = [vi.Stop(direction=[1, 0], gap=0.3, restitution=1.0)]
    free = system(np.eye(2), 0, [[2, -1], [-1, 2]], 1.0, stops)
    motion = vi.simulate(free, start=vi.State([0.0, 0.0], [1.0, 0.0]), periods=100, samples_per_period=4)
    q, v = motion["displacement"].values, motion["velocity"].values
    energy = ((q @ free.stiffness) * q + v * v).sum(axis=1) / 2
    assert energy == pytest.approx(np.full(len(energy), 0.5), rel=1e-11)
    assert motion.sizes["impact"] > 50


def test_an_impact_without_rebound_beside_one_without_loss():
    stops = [vi.Stop(direction=[1, 0], gap=0.1, restitution=1.0), vi.Stop(direction=[0, 1], gap=0.1, restitution=0.0)]
    mixed = system(np.eye(2), 0.05 * np.eye(2), [[2, -1], [-1, 2]], 0.8, stops, {1: [1.0, 0.4]})
    seen = follow(linear(mixed), [0, 0], [0, 0], impacts=8, cut=1e-9 * mixed.velocity_scale)
    hits = impacts(mixed, 8)
    assert hits["velocity"].values == pytest.approx([event.velocity for event in seen.impacts], rel=1e-9)


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


def test_two_stops_struck_at_once_by_symmetry_are_flagged():
    stops = [vi.Stop(direction=[1, 0], gap=0.3, restitution=0.5), vi.Stop(direction=[0, 1], gap=0.3, restitution=0.5)]
    hits = impacts(system(np.eye(2), 0.1 * np.eye(2), [[2, -1], [-1, 2]], 0.9, stops, {1: [1, 1]}), 10)
    assert hits["simultaneous"].values.all()
    assert hits["velocity"].values[::2] == pytest.approx(hits["velocity"].values[1::2], rel=1e-11)


def test_a_pressed_mass_that_is_never_released():
    pressed = system(1, 0.1, 1, 1.0, [vi.Stop(direction=1, gap=0.1)], {1: 0.5}, constant=[2.0])
    assert outcome(pressed) == Status.STUCK_FOREVER


def test_twelve_modes_five_stops_and_twelve_harmonics_are_those_of_the_witness():
    rng = np.random.default_rng(3)
    n = 12
    root = rng.normal(size=(n, n))
    stiffness = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    stops = [vi.Stop(direction=np.eye(n)[2 * j + 1], gap=0.4 + 0.1 * j, restitution=0.6) for j in range(5)]
    force = {1: np.ones(n), 5: 0.3 * rng.normal(size=n), 12: 0.2 * rng.normal(size=n)}
    model = system(np.eye(n) + 0.05 * root @ root.T / n, 0.02 * stiffness, stiffness, 0.35, stops, force)
    seen = follow(linear(model), np.zeros(n), np.zeros(n), impacts=6, cut=1e-9 * model.velocity_scale)
    hits = impacts(model, 6)
    assert hits["velocity"].values == pytest.approx([event.velocity for event in seen.impacts], rel=1e-9)
    assert hits["time"].values == pytest.approx([event.time for event in seen.impacts], rel=1e-10)


def test_a_stiff_mode_beside_a_slow_one():
    stops = [vi.Stop(direction=[1, 0.1], gap=0.3, restitution=0.6)]
    model = system(np.eye(2), np.diag([0.1, 4.0]), np.diag([1.0, 1e4]), 0.9, stops, {1: [1.0, 0.0]})
    seen = follow(linear(model), [0, 0], [0, 0], impacts=6, cut=1e-9 * model.velocity_scale)
    hits = impacts(model, 6)
    assert hits["velocity"].values == pytest.approx([event.velocity for event in seen.impacts], rel=1e-8)


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
