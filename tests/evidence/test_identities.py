"""What changes nothing, by the engine and by the witness: coordinates, units, time; and what rests remember."""

from functools import cache

import numpy as np
import pytest

import vibroimpact as vi
from codes import Witness, later
from systems import changed, drawn, impacts, system, two_masses

NUMBER = 12
SYSTEMS = {f"rigid stops, seed {seed}": ([7, seed], False) for seed in (0, 1, 2, 3, 5, 6, 8, 10, 11, 12, 15, 26)}
SYSTEMS |= {f"any stops, seed {seed}": ([17, seed], True) for seed in (0, 1, 2, 3, 4, 5)}


@cache
def case(name):
    """Return a system and a state in front of its stops."""
    if name == "two masses":
        return two_masses(), np.array([0.01, -0.005]), np.array([0.3, 0.1])
    seed, of_any_kind = SYSTEMS[name]
    return drawn(np.random.default_rng(seed), of_any_kind)


@cache
def followed(kind, name):
    """Return the first impacts by a code, and by how much an error of one has grown up to each."""
    model, q, v = case(name)
    moved = [stop.replace(gap=stop.gap + 1e-9) for stop in model.stops]
    off = vi.ImpactSystem(**model.arguments() | {"stops": moved})
    hits, near = (kind().impacts(one, q, u, number=NUMBER) for one, u in ((model, v), (off, v * (1 + 1e-9))))
    both = min(len(hits["time"]), len(near["time"]))
    apart = np.max([np.abs(near[part][:both] - hits[part][:both]) for part in ("time", "velocity")], axis=0) / 1e-9
    parted = np.flatnonzero(hits["stop"][:both] != near["stop"][:both])
    return hits, np.maximum.accumulate(apart[: parted[0] if len(parted) else both]).clip(1.0)


def assert_the_same(code, name, other, stops=None, units=(1.0, 1.0), since=0.0):
    """Two motions have the same impacts, as far as errors have not grown; times and velocities in units."""
    hits, growth = followed(type(code), name)
    sure = np.flatnonzero(growth < 1e5)
    assert len(sure)
    number = np.arange(9) if stops is None else np.asarray(stops)
    assert number[other["stop"][sure]].tolist() == hits["stop"][sure].tolist()
    near = 1e-12 if name.startswith(("rigid", "two")) else 1e-11
    for part, unit, begin in ("time", units[0], since), ("velocity", units[1], 0.0):
        size = max(1.0, np.abs(hits[part]).max())
        wrong = np.abs(other[part][sure] - begin - unit * hits[part][sure])
        assert (wrong <= near * unit * size * growth[sure]).all(), part


CASES = pytest.mark.parametrize("name", ["two masses", *SYSTEMS])


@CASES
@pytest.mark.parametrize("kind", ["order", "signs", "any"])
def test_coordinates_change_nothing(code, name, kind):
    model, q, v = case(name)
    rng, n = np.random.default_rng(8), len(q)
    basis = {
        "order": np.eye(n)[rng.permutation(n)],
        "signs": np.diag(np.where(np.arange(n) % 2, 1.0, -1.0)),
        "any": np.eye(n) + 0.5 * rng.uniform(-1.0, 1.0, (n, n)),
    }[kind]
    there = (np.linalg.solve(basis, part) for part in (q, v))
    assert_the_same(code, name, code.impacts(changed(model, basis=basis), *there, number=NUMBER))


@CASES
def test_the_order_of_stops_changes_nothing(code, name):
    model, q, v = case(name)
    ranks = np.random.default_rng(8).permutation(len(model.stops))
    turned = vi.ImpactSystem(**model.arguments() | {"stops": [model.stops[j] for j in ranks]})
    assert_the_same(code, name, code.impacts(turned, q, v, number=NUMBER), stops=ranks)


@CASES
def test_a_mode_that_is_not_coupled_changes_nothing(code, name):
    model, q, v = case(name)
    wider = [np.pad(matrix, (0, 1)) for matrix in (model.mass, model.damping, model.stiffness)]
    for matrix, alone in zip(wider, (3.0, 0.7, 11.0), strict=True):
        matrix[-1, -1] = alone
    stops = [stop.replace(direction=[*stop.direction, 0.0]) for stop in model.stops]
    force = {order: [*load, 2.0j] for order, load in model.force.harmonics.items()}
    constant = [*(np.zeros(len(q)) if model.force.constant is None else model.force.constant), 1.0]
    joined = system(*wider, model.omega, stops, force, constant)
    assert_the_same(code, name, code.impacts(joined, [*q, 0.5], [*v, 1.0], number=NUMBER))


UNITS = {"mass": 2.0**-8}, {"length": 2.0**5}, {"time": 2.0**-8}, {"mass": 2.0**7, "length": 2.0**-11, "time": 2.0**-5}


@CASES
@pytest.mark.parametrize("units", UNITS)
def test_units_that_are_powers_of_two_change_nothing(code, name, units):
    model, q, v = case(name)
    length, time = units.get("length", 1.0), units.get("time", 1.0)
    scaled = code.impacts(changed(model, **units), length * q, length / time * v, number=NUMBER)
    assert_the_same(code, name, scaled, units=(time, length / time))


@CASES
@pytest.mark.parametrize("periods", [3, 64])
def test_a_shift_of_time_by_periods_changes_nothing(code, name, periods):
    model, q, v = case(name)
    later_on = code.impacts(model, q, v, periods * model.period, number=NUMBER)
    assert_the_same(code, name, later_on, since=periods * model.period)


def test_two_halves_of_a_mass_move_as_the_whole(code):
    """Both hit at once; the spring that joins them is never stretched."""
    osc = vi.ImpactOscillator(omega=2.0, damping=0.1, restitution=0.6, gap=0.2)
    springs = 0.5 * np.eye(2) + 3.0 * np.array([[1, -1], [-1, 1]])
    stops = [vi.Stop(direction=row, gap=0.2, restitution=0.6) for row in np.eye(2)]
    halves = system(np.eye(2) / 2, 0.05 * np.eye(2), springs, 2.0, stops, {1: [0.5, 0.5]})
    whole = impacts(osc, code.many)
    both = code.impacts(halves, [0.0, 0.0], [0.0, 0.0], number=2 * code.many)
    assert both["simultaneous"].all()
    assert both["velocity"] == pytest.approx(np.repeat(whole["velocity"].values, 2), rel=1e-12)
    assert both["time"] == pytest.approx(np.repeat(whole["time"].values, 2), rel=1e-12)


def test_harmonics_of_twice_the_frequency_are_the_first_of_half_the_period(code):
    stop = vi.Stop(direction=[0, 1], gap=0.1, restitution=0.6)
    arguments = np.eye(2), 0.1 * np.eye(2), [[2, -1], [-1, 2]]
    loads = (1.6, {1: [1.0, 0.2]}), (0.8, {2: [1.0, 0.2]})
    one, other = (
        code.impacts(system(*arguments, omega, [stop], force), [0, 0], [0, 0], number=30) for omega, force in loads
    )
    np.testing.assert_allclose(other["velocity"], one["velocity"], rtol=1e-9)
    np.testing.assert_allclose(other["time"], one["time"], rtol=1e-10)


# What a rest forgets and what it remembers


def test_a_mode_remembers_what_was_before_a_stick(code):
    """The stop holds the first mass, while the second one goes on as it likes."""
    stop = vi.Stop(direction=[1, 0], gap=0.0, restitution=0.3)
    pair = system(np.eye(2), 0.05 * np.eye(2), [[2.0, -0.5], [-0.5, 1.0]], 0.3, [stop], {1: [2.0, 0.0]})
    after = []
    for other in (0.0, 0.8):
        events = code.motion(pair, [0.0, other], [0.0, 0.0], 1.0).events
        assert [kind for _, kind, _ in events[:3]] == ["stick", "release", "impact"]
        hits = code.impacts(pair, [0.0, other], [0.0, 0.0], 1.0, number=1)
        after.append((events[1][0], hits["velocity"][0]))
    assert np.abs(np.subtract(*after)).min() > 1e-2  # released at other times, and back with other velocities


def test_a_stick_of_one_mass_has_no_memory(code):
    one = system(1, 0.1, 1, 0.1, [vi.Stop(direction=1, gap=0.0, restitution=0.3)], {1: 1.0})
    motions = [code.motion(one, [-0.3], [speed], periods=2) for speed in (0.5, 1.5)]
    released = [next(time for time, kind, _ in motion.events if kind == "release") for motion in motions]
    assert released[0] == pytest.approx(released[1], rel=1e-12)
    assert motions[0].state == pytest.approx(motions[1].state, rel=1e-12, abs=1e-13)


@pytest.mark.parametrize("cut", [1e-6, 1e-9, 1e-12])
def test_the_end_of_a_chatter_does_not_depend_on_its_cut(code, cut):
    pair = system(
        *([[1.0, 0.2], [0.2, 2.0]], 0.05 * np.eye(2), [[2.0, -0.5], [-0.5, 1.0]], 0.2),
        *([vi.Stop(direction=[1, 0.3], gap=0.0, restitution=0.5)], {1: [2.0, 0.5]}),
    )

    def ends(cut):
        events = code.motion(pair, [-0.5, 0.1], [0.0, 0.0], cut=cut).events
        return [next(time for time, what, _ in events if what == kind) for kind in ("stick", "release")]

    stick, release = np.subtract(ends(cut), ends(1e-13))
    squared = (cut * pair.velocity_scale) ** 2
    assert abs(stick) < max((0.1 if isinstance(code, Witness) else 0.3) * squared, 1e-13)
    assert abs(release) < max(10 * squared, 1e-12)


# Stops that are touched at once


def test_two_stops_struck_at_once_are_flagged_and_have_no_order(code):
    """Two equal masses that a spring couples fall on two equal stops at the same instant."""
    stops = [
        vi.Stop(direction=a, gap=gap, restitution=0.5) for a, gap in (([1, 0], 1.0), ([0, 1], 1.0), ([-1, 0], 9.0))
    ]
    pair = system(np.eye(2), np.zeros((2, 2)), [[3.0, -1.0], [-1.0, 3.0]], 1.0, stops, {1: [2.0, 2.0]})
    hits = code.impacts(pair, [0.0, 0.0], [0.3, 0.3], number=6)
    assert hits["stop"].tolist() == [0, 1] * 3
    assert hits["simultaneous"].all()
    for part in ("time", "velocity", "impulse"):
        assert hits[part][::2] == pytest.approx(hits[part][1::2], rel=1e-12)
    alone = system(1, 0, 2, 1.0, [vi.Stop(direction=1, gap=1.0, restitution=0.5)], {1: 2.0})
    once = code.impacts(alone, [0.0], [0.3], number=3)
    for part in ("time", "velocity"):
        assert once[part] == pytest.approx(hits[part][::2], rel=1e-11)


def test_parallel_stops_share_a_contact(code):
    twice = [vi.Stop(direction=a, gap=0.0, restitution=0.4) for a in (1, 2)]
    one, two = (
        code.impacts(system(1, 0.1, 1, 0.3, stops, {1: 1.0}), [-1.0], [0.0], number=12)["time"]
        for stops in (twice[:1], twice)
    )
    assert np.abs(two[:, None] / one - 1.0).min(axis=1).max() < 1e-12


def test_a_mass_pressed_into_a_corner_comes_to_rest_there_and_keeps_what_lies_along_it(code):
    """It knocks between the two stops faster and faster, at last several times within rounding of one instant."""
    mass = np.array([[2.0, 0.5, 0.3], [0.5, 1.0, -0.2], [0.3, -0.2, 1.5]])
    first, second = np.array([1.0, 0.2, 0.1]), np.array([-0.9, 0.4, 0.3])
    stops = [vi.Stop(direction=first, gap=0.3, restitution=0.5), vi.Stop(direction=second, gap=0.2, restitution=0.5)]
    still, begin = np.zeros((3, 3)), np.array([1.0, -0.5, 2.0])
    corner = system(mass, still, still, 1.0, stops, constant=4.0 * first + 5.0 * second)
    _, events, state = code.motion(corner, np.zeros(3), begin)
    along = np.cross(first, second)
    assert sorted(stop for _, kind, stop in events if kind == "stick") == [0, 1]
    assert along @ mass @ state[3:] == pytest.approx(along @ mass @ begin, rel=1e-12)
    assert np.abs([first @ state[3:], second @ state[3:]]).max() < 1e-13


def test_a_system_at_rest_never_moves(code):
    stops = [vi.Stop(direction=[1, 0], gap=0.0, restitution=0.5), vi.Stop(direction=[0, 1], gap=1.0, restitution=0.5)]
    still = system(np.eye(2), np.zeros((2, 2)), [[2.0, -1.0], [-1.0, 2.0]], 1.0, stops)
    assert "impact" not in {kind for _, kind, _ in code.motion(still, [0, 0], [0, 0], periods=5).events}
    assert (later(code, still, np.zeros(4), 0.0, 5) == 0.0).all()
