"""Motions with a closed form, by the engine and by the witness: orbits, contacts, rests, chains, an elastic bar."""

import math
from itertools import pairwise

import mpmath as mp
import numpy as np
import pytest

import vibroimpact as vi
from codes import Witness, differences, later
from oracles.one_impact import motions
from systems import chain, changed, drawn, impact_damper, impacts, springs_of, system, two_sided


def spring(stiffness, damping=0.0, gap=0.0, direction=1.0, **more):
    return vi.Stop(direction=direction, gap=gap, stiffness=stiffness, damping=damping, **more)


def wall(direction, gap=0.0, restitution=0.8, **more):
    return vi.Stop(direction=direction, gap=gap, restitution=restitution, **more)


# One impact in each period, or in each half of it on either of two stops

ONE_IMPACT = {  # velocity and phase have 50 digits in mpmath
    "two-sided": (two_sided(), (1.01091975000998629752895, 0.30697182627669859292, 0.576894695880845)),
    "three masses": (chain(), (0.6314772880991517553058458, 0.61512189651226436508, 0.916997423593104)),
    "impact damper": (impact_damper(), (9.407221992561745893002965, 0.74256436841325221938, 0.951484071086934)),
}


def orbit_of(name):
    """Return a system, velocity and phase of its motion, the state after an impact, and the part of T that it takes."""
    model, (velocity, phase, _) = ONE_IMPACT[name]
    v, at, q, dq = min(motions(model), key=lambda orbit: abs(orbit[0] - velocity))
    assert (v, at) == pytest.approx((velocity, phase), rel=1e-12)
    return model, velocity, phase, np.concatenate([q, dq]), 0.5 if len(model.stops) == 2 else 1.0


@pytest.mark.parametrize("name", ONE_IMPACT)
def test_a_motion_of_one_impact_is_that_of_its_closed_form(code, name):
    model, velocity, phase, state, turn = orbit_of(name)
    hits = code.impacts(model, *np.split(state, 2), phase * model.period, number=6)
    assert hits["velocity"] == pytest.approx(velocity, rel=1e-12)
    assert hits["time"] / model.period == pytest.approx(phase + turn * np.arange(1, 7), rel=1e-12)
    assert hits["stop"].tolist() == ([1, 0] * 3 if turn < 1.0 else [0] * 6)
    begin = phase * model.period
    on_the_way, there = later(code, model, state, begin, 0.3125 * turn), begin + 0.3125 * turn * model.period
    jacobian = (-1.0 if turn < 1.0 else 1.0) * differences(code, model, on_the_way, there, turn)
    assert max(abs(np.linalg.eigvals(jacobian))) == pytest.approx(ONE_IMPACT[name][1][2], rel=1e-7)


@pytest.mark.parametrize("name", ONE_IMPACT)
def test_a_motion_from_rest_settles_on_that_of_its_closed_form(name):
    model, (velocity, phase, _) = ONE_IMPACT[name]
    hits, turns = impacts(model, 100, transient=3000), len(model.stops)
    assert hits["velocity"].values == pytest.approx(velocity, rel=1e-12)
    off = (hits["phase"].values - phase) * turns
    assert off == pytest.approx(np.round(off), abs=1e-11)
    assert len(set(hits["stop"].values)) == turns


@pytest.mark.parametrize("name", ONE_IMPACT)
def test_the_modal_form_has_the_orbits_of_the_system(name):
    model, (velocity, phase, _) = ONE_IMPACT[name]
    n = len(model.mass)
    basis = np.random.default_rng(14).standard_normal((n, n)) + 2.0 * np.eye(n)
    for there, unit, near in (model, 1.0, 1e-12), (changed(model, basis=basis, length=3.0, time=0.7), 3.0 / 0.7, 1e-11):
        form = there.modal()
        stops = [stop.replace(direction=a) for stop, a in zip(there.stops, form.directions, strict=True)]
        loads = {int(h): form.masses * load for h, load in zip(form.orders, form.forces, strict=True)}
        damping, stiffness = form.masses[:, None] * form.damping, np.diag(form.masses * form.squares)
        found = motions(system(np.diag(form.masses), damping, stiffness, there.omega, stops, loads))
        nearest = min(found, key=lambda orbit: abs(orbit[0] - velocity * unit))[:2]
        np.testing.assert_allclose(nearest, (velocity * unit, phase), rtol=near)


def shrinking(kind):
    """Return a system, a state in flight, when, and over how many periods to carry it on, through impacts."""
    if kind in ONE_IMPACT:
        model, _, phase, state, turn = orbit_of(kind)
        before = later(Witness(), model, state, phase * model.period, turn - 0.125)
        return model, before, (phase + turn - 0.125) * model.period, 0.75
    model, q, speed = drawn(np.random.default_rng([7, kind]))
    return model, np.concatenate([q, speed]), 0.0, 0.5


@pytest.mark.parametrize("kind", [*ONE_IMPACT, 20, 24, 37, 46])
def test_volumes_shrink_by_the_damping_and_by_the_square_of_the_restitution(code, kind):
    model, state, begin, turns = shrinking(kind)
    events = code.motion(model, *np.split(state, 2), begin, turns).events
    assert {what for _, what, _ in events} == {"impact"}
    bounced = math.prod(model.stops[stop].restitution ** 2 for *_, stop in events)
    loss = np.trace(np.linalg.solve(model.mass, model.damping)) * turns * model.period
    found = np.linalg.det(differences(code, model, state, begin, turns))
    assert found == pytest.approx(bounced * math.exp(-loss), rel=1e-7)


@pytest.mark.parametrize(("n_periods", "share"), [(1, 1.05), (1, 1.1), (1, 1.24), (1, 1.43), (2, 1.1)])
def test_a_ball_bounces_on_a_table_as_its_fixed_point_says(code, n_periods, share):
    r, g, w = 0.5, 9.81, 10.0
    fold = n_periods * math.pi * (1 - r) / (1 + r)
    gamma = share * fold
    ball = system(1, 0, 0, w, [wall(-1, 0.0, r, motion={1: -gamma * g / w**2})], constant=[-g])
    phase = math.acos(fold / gamma)
    speed = g * n_periods * math.pi / w  # before and after, of the ball itself
    state, begin = np.array([gamma * g / w**2 * math.sin(phase), speed]), phase / w
    hits = code.impacts(ball, *state[:, None], begin, number=code.many)
    assert hits["velocity"] == pytest.approx(speed + gamma * g / w * math.cos(phase), rel=1e-11)
    since = n_periods * ball.period * np.arange(1, code.many + 1)
    assert hits["time"] == pytest.approx(begin + since, rel=1e-11)
    there, on_the_way = begin + 0.40625 * ball.period, later(code, ball, state, begin, 0.40625)
    trace = np.trace(differences(code, ball, on_the_way, there, n_periods))
    assert trace == pytest.approx(1 + r**2 - (1 + r) ** 2 * gamma * math.sin(phase), rel=1e-6)


# Contacts with a spring and a damper


def kelvin_voigt(z):
    """Return the restitution of a free mass, and w_n times the contact, which ends where its force is zero.

    exp(-z w_n t_c) with t_c = (pi - atan2(2 z s, 1 - 2 z^2))/(w_n s), s = sqrt(1 - z^2); above z = 1 its continuation.
    """
    s = math.sqrt(abs(1.0 - z * z))
    if z < 1.0:
        duration = (math.pi - math.atan2(2.0 * z * s, 1.0 - 2.0 * z * z)) / s
    else:
        duration = math.atanh(2.0 * z * s / (2.0 * z * z - 1.0)) / s
    return math.exp(-z * duration), duration


STIFF = (3.0, 1e-14), (700.0, 1e-14), (1e5, 1e-13), (1e9, 1e-11)


@pytest.mark.parametrize(
    ("z", "k", "rounding"),
    [(1e-6, 700.0, 1e-14), *((z, *stiff) for z in (0.0, 0.05, 0.2, 0.7, 0.95, 1.5, 20.0) for stiff in STIFF)],
)
def test_a_free_mass_rebounds_as_kelvin_and_voigt_say(code, z, k, rounding):
    mass, v = 2.5, 0.7
    rate, c = math.sqrt(k / mass), 2.0 * z * math.sqrt(k * mass)
    box = system(mass, 0, 0, 1.3, [spring(k, c, gap=0.5), wall(-1, 0.5, 1.0)])
    near = max(rounding, 1e-12) if isinstance(code, Witness) or z >= 1.0 else rounding
    hits = code.impacts(box, [0.0], [v], number=3)
    r, lasts = kelvin_voigt(z)
    assert hits["stop"].tolist() == [0, 1, 0]
    assert hits["velocity"][:2] == pytest.approx([v, r * v], rel=near)
    assert hits["contact_time"][0] == pytest.approx(lasts / rate, rel=near)
    assert hits["impulse"][0] == pytest.approx((1.0 + r) * mass * v, rel=near)
    lost = (1.0 - r**2) * mass * v**2 / 2.0
    assert hits["energy_lost"][0] == pytest.approx(lost, rel=10 * near, abs=1e-13 * mass * v**2)
    if z == 0.0:  # half a sine
        assert hits["peak_force"][0] == pytest.approx(v * math.sqrt(k * mass), rel=near)
        assert hits["penetration"][0] == pytest.approx(v / rate, rel=near)
    if z > 0.5:  # it presses hardest at the touch
        assert hits["peak_force"][0] == pytest.approx(c * v, rel=near)


def test_the_restitution_of_twenty_percent_damping_is_the_value_of_fifty_digits():
    assert kelvin_voigt(0.2)[0] == pytest.approx(0.571740027585, rel=1e-11)


def test_an_overdamped_stop_lets_go_pushed_in_and_its_force_stays_zero():
    """d = v (exp(slow t) - exp(fast t))/(slow - fast), and d'' = 0 where the force is zero."""
    k, c = 1.0, 10.0
    free = system(1, 0, 0, 1.3, [spring(k, c)])
    motion = vi.simulate(free, start=vi.State(-1.0, 1.0), periods=3.0, samples_per_period=2000)
    fast, slow = (-c - math.sqrt(c * c - 4.0 * k)) / 2.0, (-c + math.sqrt(c * c - 4.0 * k)) / 2.0
    after = motion["time"].values > 1.0 + math.log((fast / slow) ** 2) / (slow - fast)
    assert (motion["force"].values[after] == 0.0).all()
    assert motion["displacement"].values[after][0] > 0.0


def test_the_half_periods_of_a_free_bilinear_oscillator_are_those_of_its_two_springs(code):
    m, k, more = 2.0, 3.0, 40.0
    hits = code.impacts(system(m, 0, k, 1.0, [spring(more)]), [-1.0], [0.0], number=6)
    slow, fast = math.sqrt(k / m), math.sqrt((k + more) / m)
    times = [0.5 * math.pi / slow + i * math.pi * (1 / slow + 1 / fast) for i in range(6)]
    assert hits["time"] == pytest.approx(times, rel=1e-13)
    assert hits["velocity"] == pytest.approx([slow] * 6, rel=1e-13)


def test_a_mass_pressed_on_a_compliant_stop_rests_in_it(code):
    pressed = system(1, 0, 0, 1.0, [spring(50.0, 3.0)], constant=[10.0])
    assert code.impacts(pressed, [0.2], [0.0], number=1)["time"].size == 0
    assert later(code, pressed, [0.2, 0.0], 0.0, 5) == pytest.approx([0.2, 0.0], abs=1e-13)


@pytest.mark.parametrize("z", [0.0, 0.2, 0.4])
def test_a_stiff_stop_tends_to_the_rigid_one_of_its_restitution(code, z):
    direction, mass = np.array([0.3, 1.0]), np.array([[2.0, 0.3], [0.3, 1.0]])
    struck = 1.0 / (direction @ np.linalg.solve(mass, direction))
    matrices = mass, 0.05 * np.eye(2), np.array([[3.0, -1.0], [-1.0, 1.5]]), 1.3

    def velocities(stop):
        return code.impacts(system(*matrices, [stop], {1: [0.5, 1.0]}), [0, 0], [0, 0], number=6)["velocity"]

    hard = velocities(wall(direction, 0.4, kelvin_voigt(z)[0]))
    apart = [
        np.abs(velocities(spring(k, 2.0 * z * math.sqrt(k * struck), 0.4, direction)) - hard).max()
        for k in 10.0 ** np.arange(3, 10)
    ]
    assert all(stiff < soft * 1.1 / math.sqrt(10.0) for soft, stiff in pairwise(apart))
    assert apart[-1] < 1e-3 * hard.max()


# Flights


def test_a_ball_under_a_constant_force_bounces_from_where_it_begins(code):
    hits = code.impacts(system(1, 0, 0, 1.0, [wall(1, 0.0, 0.5)], constant=[2.0]), [-1.0], [0.0], number=3)
    assert hits["velocity"] == pytest.approx([2.0, 1.0, 0.5], rel=1e-14)
    assert hits["time"] == pytest.approx([1.0, 2.0, 2.5], rel=1e-14)


def test_a_system_without_stops_moves_freely_from_where_it_begins():
    free = system(np.diag([1.0, 2.0]), np.zeros((2, 2)), np.diag([1.0, 8.0]), 1.3, [])
    motion = vi.simulate(free, start=vi.State([0.3, -0.1], [0.0, 0.4]), periods=5)
    t = motion["time"].values
    np.testing.assert_allclose(motion["displacement"][:, 0], 0.3 * np.cos(t), atol=1e-13)
    np.testing.assert_allclose(motion["displacement"][:, 1], 0.2 * np.sin(2 * t) - 0.1 * np.cos(2 * t), atol=1e-13)


@pytest.mark.parametrize("gap", [5.0, 10.0])
def test_an_undamped_mode_at_resonance_grows_until_it_hits(code, gap):
    """From rest q'' + q = sin t has q = (sin t - t cos t)/2."""
    hits = code.impacts(system(1, 0, 1, 1.0, [wall(1, gap)], {1: 1.0}), [0.0], [0.0], number=1)
    (time,), (velocity,) = hits["time"], hits["velocity"]
    t = np.append(np.linspace(0.0, time - 1e-3, 1000), time)
    displacement = (np.sin(t) - t * np.cos(t)) / 2
    assert displacement[-1] == pytest.approx(gap, rel=1e-12)
    assert velocity == pytest.approx(time * math.sin(time) / 2, rel=1e-12)
    assert displacement[:-1].max() < gap  # not before


def test_a_mass_that_drifts_away_has_hit_once(code):
    drifting = system(1, 0, 0, 1.0, [wall(1, 1.0, 0.5)])
    assert code.motion(drifting, [0.0], [2.0], periods=20).events == [(pytest.approx(0.5, rel=1e-14), "impact", 0)]
    assert code.impacts(drifting, [0.0], [2.0], number=1)["velocity"] == pytest.approx([2.0], rel=1e-14)
    assert later(code, drifting, [0.0, 2.0], 0.0, 20)[0] == pytest.approx(1.0 - (40 * math.pi - 0.5), rel=1e-13)


def test_a_moving_stop_takes_a_resting_mass_along_and_throws_it(code):
    """A table of amplitude 1 lets go where its acceleration downwards is that of gravity: sin wt = 1/Gamma."""
    gravity, gamma = 9.81, 2.0
    w = math.sqrt(gamma * gravity)
    table = system(1, 0, 0, w, [wall(-1, 0.0, 0.3, motion={1: -1.0})], constant=[-gravity])
    (_, *stick), (thrown, *release) = code.motion(table, [0.0], [w], periods=0.25).events[:2]
    assert (stick, release) == (["stick", 0], ["release", 0])
    assert thrown == pytest.approx(math.asin(1 / gamma) / w, rel=1e-13)
    angle = 2 * math.pi * 5 / 64  # it is thrown at pi/6
    assert later(code, table, [0.0, w], 0.0, 5 / 64) == pytest.approx([math.sin(angle), w * math.cos(angle)], rel=1e-12)


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
def test_a_chain_pulled_at_its_far_end_leaves_the_stop_it_rests_at(code, n, damping):
    # Of the last clearance the first derivative that is not zero has the order 2 n + 1 without damping.
    if isinstance(code, Witness) and n > 3:
        pytest.skip("the witness looks at no derivatives beyond the eighth")
    load, last = np.eye(n)[0], np.eye(n)[-1]
    pulled = system(np.eye(n), float(damping) * springs_of(n), springs_of(n), 0.9, [wall(last, 0.0, 0.7)], {1: -load})
    hits = code.impacts(pulled, np.zeros(n), np.zeros(n), number=1)
    time, v = mp.mpf(float(hits["time"][0])), float(hits["velocity"][0])
    assert clearance_of_the_free_chain(n, damping, time) == pytest.approx(0.0, abs=1e-13)
    assert all(clearance_of_the_free_chain(n, damping, time * i / 40) > 0 for i in range(20, 40))
    step = 1e-6
    before, after = (clearance_of_the_free_chain(n, damping, time + sign * step) for sign in (-1, 1))
    assert (before - after) / (2 * step) == pytest.approx(v, rel=1e-9)


# Stops that are closed


def test_a_stop_is_struck_while_another_is_closed(code):
    """A mass on a free particle that is pressed on a stop: while it is held the second one obeys 2 q'' + q = 3."""
    springs, stops = [[1.0, -1.0], [-1.0, 1.0]], [wall([1, 0], 0.0, 0.0), wall([-1, 1], 1.0, 0.5)]
    carried = system(np.diag([1.0, 2.0]), np.zeros((2, 2)), springs, 1.0, stops, constant=[1.0, 3.0])
    events = code.motion(carried, [0.0, 0.0], [0.0, 1.0]).events
    assert [event[1:] for event in events[:2]] == [("stick", 0), ("impact", 1)]
    hits, rate = code.impacts(carried, [0.0, 0.0], [0.0, 1.0], number=1), math.sqrt(0.5)
    (time,), (velocity,) = hits["time"], hits["velocity"]
    assert 3 - 3 * math.cos(rate * time) + math.sin(rate * time) / rate == pytest.approx(1.0, abs=1e-13)
    assert velocity == pytest.approx(3 * rate * math.sin(rate * time) + math.cos(rate * time), rel=1e-13)
    # The struck mass passes on no less than it has: 0 <= P with the held one taking the reaction.
    assert hits["impulse"] == pytest.approx([2.0 * 1.5 * velocity], rel=1e-13)


def test_an_impact_can_open_a_closed_stop(code):
    """The second mass strikes the first one from the other side and takes it along."""
    stops = [wall([1, 0], 0.0, 0.5), wall([1, -1], 1.0, 0.5)]
    pair = system(np.diag([1.0, 2.0]), np.zeros((2, 2)), np.zeros((2, 2)), 1.0, stops, constant=[1.0, 0.0])
    events = code.motion(pair, [0.0, 0.0], [0.0, -2.0], periods=0.25).events
    assert sorted(event[1:] for event in events) == [("impact", 1), ("release", 0), ("stick", 0)]
    assert [time for time, *_ in events] == pytest.approx([0.0, 0.5, 0.5], rel=1e-13)
    hits = code.impacts(pair, [0.0, 0.0], [0.0, -2.0], number=1)
    assert (hits["velocity"], hits["impulse"]) == (pytest.approx([2.0], rel=1e-13), pytest.approx([2.0], rel=1e-13))
    (_, _, first, second), more = later(code, pair, [0.0, 0.0, 0.0, -2.0], 0.0, 0.25), 0.5 * math.pi - 0.5
    assert (first, second) == pytest.approx((-2.0 + more, -1.0), rel=1e-12)


def test_a_closed_stop_opens_where_its_force_falls_through_zero(code):
    """Two masses, the first one pressed on its stop through the spring between them: 1 + (q2 - q1) = 0."""
    springs, stop = [[1.0, -1.0], [-1.0, 1.0]], wall([1, 0], 0.0, 0.5)
    pair = system(np.eye(2), np.zeros((2, 2)), springs, 1.0, [stop], constant=[1.0, 0.0])
    events = code.motion(pair, [0.0, 0.0], [0.0, -2.0]).events
    assert [event[1:] for event in events[:2]] == [("stick", 0), ("release", 0)]
    assert events[1][0] == pytest.approx(math.pi / 6, rel=1e-14)  # -2 sin t = -1


def test_a_closed_rigid_stop_bears_what_a_compliant_one_hands_on(code):
    """The first mass is pressed on its rigid stop while the second one is thrown back by a spring between them."""
    stops = [wall([1, 0], 0.0, 0.0), spring(100.0, 0.0, 0.5, [-1, 1])]
    pair = system(np.diag([1.0, 2.0]), np.zeros((2, 2)), np.zeros((2, 2)), 1.0, stops, constant=[1.0, 0.0])
    hits, lasts = code.impacts(pair, [0.0, 0.0], [0.0, 1.5], number=1), math.pi * math.sqrt(2.0 / 100.0)
    assert hits["time"] == pytest.approx([1.0 / 3.0], rel=1e-13)
    assert hits["contact_time"] == pytest.approx([lasts], rel=1e-13)
    whole, since = code.motion(pair, [0.0, 0.0], [0.0, 1.5], periods=0.25), pair.period / 4 - 1.0 / 3.0 - lasts
    assert [event[1:] for event in whole.events] == [("stick", 0), ("impact", 1)]
    assert whole.state == pytest.approx([0, 0.5 - 1.5 * since, 0, -1.5], abs=1e-12)


def test_a_table_that_falls_faster_than_the_mass_opens_its_contact(code):
    table = system(1, 0, 0, 1.0, [wall(1, 0.0, 0.0, motion={1: -2.0})], constant=[1.0])
    events = code.motion(table, [0.0], [0.0], periods=0.25).events
    released = next(time for time, kind, _ in events if kind == "release")
    assert released == pytest.approx(math.asin(0.5), rel=1e-13)  # where 2 sin(t) = 1


# An elastic bar of steel in front of a stop at its end

YOUNG, DENSITY, SPEED, GAP = 210e9, 7800.0, 0.1, 5e-5
WAVE = 2.0 * math.sqrt(DENSITY / YOUNG)  # there and back over its length of 1 m


def bar(nodes, stop):
    """Return a free bar with a stop at its last node.

    Masses are half consistent and half lumped: the speed of waves errs by the fourth power of an element's length.
    """
    links, size = 2 * np.eye(nodes) - np.eye(nodes, k=1) - np.eye(nodes, k=-1), 1.0 / (nodes - 1)
    links[0, 0] = links[-1, -1] = 1.0
    lumped = np.diag([0.5, *[1.0] * (nodes - 2), 0.5])
    return system(DENSITY * size * (lumped - links / 12), 0 * links, YOUNG / size * links, 2e3 * math.pi / 1.2, [stop])


@pytest.mark.parametrize(("compliant", "near"), [(False, 0.015), (True, 0.006)])
def test_an_elastic_bar_stays_for_a_wave_there_and_back_and_leaves_with_its_whole_speed(code, compliant, near):
    """With 100 nodes contact and speed are 0.13 % and 0.64 % off at a rigid stop, 0.09 % and 0.41 % at the other."""
    errors, sizes = [], (10, 20, 40) if isinstance(code, Witness) else (10, 20, 40, 100)
    for nodes in sizes:
        last = np.eye(nodes)[-1]
        stop = spring(3 * nodes * YOUNG, 0.0, GAP, last) if compliant else wall(last, GAP, 0.0)
        model, moving = bar(nodes, stop), (np.zeros(nodes), np.full(nodes, SPEED))
        hits, events, state = code.motion(model, *moving)
        assert events[0] == (pytest.approx(GAP / SPEED, rel=1e-12), "impact", 0)
        assert {kind for _, kind, _ in events} == ({"impact"} if compliant else {"impact", "stick", "release"})
        end = hits["time"][-1] + hits["contact_time"][-1] if compliant else events[-1][0]
        mass = model.mass.sum(axis=0)
        speed = -(mass @ state[nodes:]) / mass.sum()
        errors.append((abs(end - GAP / SPEED - WAVE) / WAVE, abs(speed - SPEED) / SPEED))
    assert np.max(errors[2]) < near
    assert all(after < before for one, other in pairwise(errors) for before, after in zip(one, other, strict=True))
    if len(errors) == 4:
        assert errors[3] == pytest.approx((0.0009, 0.0041) if compliant else (0.0013, 0.0064), rel=0.1)


# What an impact costs


@pytest.mark.parametrize("seed", range(7, 19))
def test_an_impact_on_one_stop_loses_what_its_restitution_says(code, seed):
    model, q, v = drawn(np.random.default_rng([7, seed]))
    model = vi.ImpactSystem(**model.arguments() | {"stops": model.stops[:1]})
    (stop,) = model.stops
    hits = code.impacts(model, q, v, number=1)
    struck = 1.0 / (stop.direction @ np.linalg.solve(model.mass, stop.direction))
    (speed,), (impulse,), (lost,) = hits["velocity"], hits["impulse"], hits["energy_lost"]
    assert impulse == pytest.approx((1 + stop.restitution) * speed * struck, rel=1e-12)
    assert lost == pytest.approx(struck * speed**2 * (1 - stop.restitution**2) / 2, rel=1e-12)
