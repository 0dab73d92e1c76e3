"""The witness for compliant stops and for laws of restitution, against closed forms, identities and energy."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from vibroimpact.backends.reference.systems import CompliantStop, LinearSystem, RigidStop, follow


def system(mass, damping, stiffness, omega, stops, force=None, constant=None):
    mass, damping, stiffness = (np.atleast_2d(np.asarray(a, float)) for a in (mass, damping, stiffness))
    harmonics = {h: np.asarray(p, complex) for h, p in (force or {}).items()}
    load = np.zeros(len(mass)) if constant is None else np.asarray(constant, float)
    return LinearSystem(mass, damping, stiffness, omega, load, harmonics, tuple(stops))


def spring(direction, gap, stiffness, damping=0.0, motion=None):
    return CompliantStop(np.asarray(direction, float), gap, stiffness, damping, motion or {})


def wall(direction, gap, restitution, motion=None):
    return RigidStop(np.asarray(direction, float), gap, restitution, motion or {})


def rebound(ratio):
    """Return the restitution of a mass on a spring and a damper that let go at zero force, and w_n times the contact.

    exp(-z w_n t_c) with t_c = (pi - atan2(2 z s, 1 - 2 z^2))/(w_n s), s = sqrt(1 - z^2); above z = 1 its continuation.
    """
    if ratio < 1.0:
        s = math.sqrt(1.0 - ratio**2)
        lasts = (math.pi - math.atan2(2.0 * ratio * s, 1.0 - 2.0 * ratio**2)) / s
    else:
        s = math.sqrt(ratio**2 - 1.0)
        lasts = math.atanh(2.0 * ratio * s / (2.0 * ratio**2 - 1.0)) / s
    return math.exp(-ratio * lasts), lasts


# A free mass on one stop


def test_an_undamped_contact_is_half_a_sine():
    m, k, v = 2.0, 700.0, 3.0
    seen = follow(system(m, 0, 0, 1.0, [spring([1], 1.0, k)]), [0.0], [v], impacts=1)
    (hit,) = seen.impacts
    assert (hit.time, hit.velocity) == pytest.approx((1.0 / v, v), rel=1e-14)
    assert hit.impulse == pytest.approx(2.0 * m * v, rel=1e-14)
    assert hit.peak_force == pytest.approx(v * math.sqrt(k * m), rel=1e-14)
    assert hit.penetration == pytest.approx(v * math.sqrt(m / k), rel=1e-14)
    assert hit.contact_time == pytest.approx(math.pi * math.sqrt(m / k), rel=1e-14)
    assert hit.energy_lost == pytest.approx(0.0, abs=1e-14 * m * v**2)
    assert (*seen.end.displacement, *seen.end.velocity) == pytest.approx((1.0, -v), rel=1e-14)


@pytest.mark.parametrize("ratio", [1e-6, 0.05, 0.2, 0.7, 1.5, 20.0])
def test_a_damped_contact_lets_go_where_the_force_is_zero(ratio):
    m, k, v = 2.0, 700.0, 3.0
    model = system(m, 0, 0, 1.0, [spring([1], 1.0, k, 2.0 * ratio * math.sqrt(k * m))])
    seen = follow(model, [0.0], [v], impacts=1)
    r, lasts = rebound(ratio)
    if ratio == 0.2:
        assert r == pytest.approx(0.571740027585, rel=1e-12)
    (hit,) = seen.impacts
    assert seen.end.velocity == pytest.approx([-r * v], rel=1e-12)
    assert hit.contact_time == pytest.approx(lasts * math.sqrt(m / k), rel=1e-12)
    assert hit.impulse == pytest.approx((1.0 + r) * m * v, rel=1e-13)
    assert hit.energy_lost == pytest.approx((1.0 - r**2) * m * v**2 / 2.0, rel=1e-12, abs=1e-14 * m * v**2)
    assert follow(model, [0.0], [v], impacts=2, most_periods=50).impacts == (hit,)  # it leaves for good


def test_a_spring_on_one_side_makes_half_periods_of_both_frequencies():
    m, k, more = 2.0, 3.0, 40.0
    seen = follow(system(m, 0, k, 1.0, [spring([1], 0.0, more)]), [-1.0], [0.0], impacts=6)
    slow, fast = math.sqrt(k / m), math.sqrt((k + more) / m)
    times = [0.5 * math.pi / slow + i * math.pi * (1 / slow + 1 / fast) for i in range(6)]
    assert [hit.time for hit in seen.impacts] == pytest.approx(times, rel=1e-13)
    assert [hit.velocity for hit in seen.impacts] == pytest.approx([slow] * 6, rel=1e-13)


def test_a_mass_pressed_on_a_stop_that_gives_rests_in_it():
    seen = follow(system(1, 0, 0, 1.0, [spring([1], 0.0, 50.0, 3.0)], constant=[10.0]), [0.2], [0.0], most_periods=5)
    assert seen.impacts == ()
    assert (*seen.end.displacement, *seen.end.velocity) == pytest.approx((0.2, 0.0), abs=1e-13)


def test_a_stop_that_let_go_pushes_again_in_the_same_contact():
    # Let go at k d = c s, d' = -s, the mass is turned by its weight f before it is out: d = d0 - s t + f t^2/(2 m), and
    # k d + c d' is zero again after 2 (s m/f - c/k).
    v, k, c = 1.65, 4.0, 1.0  # c/(m k) < s/f < 2 c/(m k)
    seen = follow(
        system(1, 0, 0, 1.0, [spring([1], 0.0, k, c)], constant=[1.0]), [-(v**2) / 2], [0.0], impacts=3, most_periods=4
    )
    changes = [now for now, before in zip(seen.pieces[1:], seen.pieces, strict=False) if now[1] is not before[1]]
    (touch, _, _), (let_go, _, _), (again, phase, _) = changes
    assert touch == seen.impacts[0].time == pytest.approx(v, rel=1e-14)
    assert phase.pushing == (0,)
    speed = -seen.at([let_go])[1][0, 0]
    assert again - let_go == pytest.approx(2.0 * (speed - c / k), rel=1e-12)
    end = (seen.end.periods + seen.end.phase) * 2 * math.pi
    (hit,) = seen.impacts
    assert hit.contact_time == pytest.approx(end - touch - (again - let_go), rel=1e-13)
    assert hit.impulse == pytest.approx(v + (end - touch) - seen.end.velocity[0], rel=1e-13)


# Energy


def random_system(rng, n, rigid=True, still=False):
    """Return a system with two compliant stops, and a rigid one beside them."""

    def positive(least):
        root = rng.normal(size=(n, n))
        return root @ root.T / n + least * np.eye(n)

    mass = positive(0.5)
    stops = []
    for z in (0.0, rng.uniform(0.05, 1.2)):
        direction = rng.normal(size=n)
        k = 10 ** rng.uniform(1, 4) / (direction @ np.linalg.solve(mass, direction))
        c = 2.0 * z * math.sqrt(k / (direction @ np.linalg.solve(mass, direction)))
        moves = {} if still else {2: 0.1 * complex(*rng.normal(size=2))}
        stops.append(spring(direction, rng.uniform(0, 0.3), k, c, moves))
    stops += [wall(rng.normal(size=n), rng.uniform(0.1, 0.4), rng.uniform(0.2, 0.9))] if rigid else []
    force = {1: rng.normal(size=n) + 1j * rng.normal(size=n), 3: 0.5 * rng.normal(size=n)}
    return system(
        mass, 0.05 * positive(0.1), positive(0.2), rng.uniform(0.5, 2), stops, force, 0.2 * rng.normal(size=n)
    )


def work_and_losses(model, seen, begin, end):
    """Return the work of the force between two times and what the dampers of the system took, by quadrature."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    edges = np.array([begin, *(t for t, _, _ in seen.pieces if begin < t < end), end])
    work = lost = 0.0
    for low, high in pairwise(edges):
        times = low + (high - low) * (1.0 + nodes) / 2.0
        v = seen.at(times)[1]
        turn = np.exp(1j * model.omega * times)
        load = model.constant + sum((np.outer(turn**h, p)).imag for h, p in model.harmonics.items())
        part = (high - low) * weights / 2.0
        work += part @ (load * v).sum(axis=1)
        lost += part @ (v * (v @ model.damping.T)).sum(axis=1)
    return work, lost


def test_the_work_of_the_force_is_the_change_of_energy_and_what_dampers_and_stops_took():
    rng, compared = np.random.default_rng(5), 0
    for n in (1, 2, 3, 4):
        model = random_system(rng, n, still=True)
        seen = follow(model, np.zeros(n), 2.0 * rng.normal(size=n), impacts=12)
        flights = [piece for piece in seen.pieces if not piece[1].pushing]
        (begin, _, _), (end, _, _) = flights[1], flights[-1]
        (q0, q1), (v0, v1) = seen.at([begin, end])
        gained = (
            (v1 @ model.mass @ v1 - v0 @ model.mass @ v0) + (q1 @ model.stiffness @ q1 - q0 @ model.stiffness @ q0)
        ) / 2
        work, lost = work_and_losses(model, seen, begin, end)
        taken = [hit.energy_lost for hit in seen.impacts if begin < hit.time <= end]
        scale = abs(work) + abs(gained) + lost
        assert work == pytest.approx(gained + lost + sum(taken), abs=1e-12 * scale)
        assert min(taken) > -1e-13 * scale
        compared += len(taken)
    assert compared > 30


# Any system


@pytest.mark.long(but=1)
@pytest.mark.parametrize("seed", range(4))
def test_a_step_by_step_integration_of_the_forces_gives_the_same_motion(seed):
    rng = np.random.default_rng([11, seed])
    n = 1 + seed % 3
    model = random_system(rng, n, rigid=False)

    def change(t, x):
        q, v = x[:n], x[n:]
        turn = np.exp(1j * model.omega * t)
        load = model.constant + sum((p * turn**h).imag for h, p in model.harmonics.items())
        for stop in model.stops:
            moved = sum((d * turn**h).imag for h, d in stop.motion.items())
            moves = sum((1j * h * model.omega * d * turn**h).imag for h, d in stop.motion.items())
            d, rate = stop.direction @ q - stop.gap - moved, stop.direction @ v - moves
            if d > 0.0:
                load = load - stop.direction * max(0.0, stop.stiffness * d + stop.damping * rate)
        return np.concatenate([v, np.linalg.solve(model.mass, load - model.damping @ v - model.stiffness @ q)])

    q, v = np.zeros(n), rng.normal(size=n)
    seen = follow(model, q, v, impacts=6)
    times = np.linspace(0.0, min(seen.impacts[-1].time, 20.0), 50)
    stepped = solve_ivp(change, (0.0, times[-1]), [*q, *v], "DOP853", times, rtol=1e-11, atol=1e-12, max_step=2e-3)
    assert np.abs(stepped.y[:n].T - seen.at(times)[0]).max() < 1e-6


def known(model, q, v, **how):
    """Return the motion of 12 impacts, and how errors of 1e-9 of its start and of its gaps have grown up to each."""
    seen = follow(model, q, v, impacts=12, most_periods=30, **how)
    off = tuple(type(s)(**{**vars(s), "gap": s.gap + 1e-9}) for s in model.stops)
    near = follow(LinearSystem(**{**vars(model), "stops": off}), q, v * (1 + 1e-9), impacts=12, most_periods=30)
    both = min(len(seen.impacts), len(near.impacts))
    growth = np.abs(listed(seen)[:both] - listed(near)[:both]).max(axis=1) / 1e-9
    return seen, np.maximum.accumulate(growth).clip(1.0)


def listed(seen):
    return np.array([(hit.time, hit.velocity, hit.impulse, hit.energy_lost, hit.peak_force) for hit in seen.impacts])


def test_the_order_and_the_signs_of_coordinates_the_order_of_stops_and_a_shift_of_time_change_nothing():
    rng, compared = np.random.default_rng(23), 0
    for n in (1, 2, 3, 4):
        model, q, v = random_system(rng, n), np.zeros(n), 2.0 * rng.normal(size=n)
        seen, growth = known(model, q, v)
        order, signs, ranks = rng.permutation(n), rng.choice([-1.0, 1.0], n), rng.permutation(3)
        square, outer = np.ix_(order, order), np.outer(signs, signs)
        stops = [model.stops[j] for j in ranks]
        other = LinearSystem(
            *((a * outer)[square] for a in (model.mass, model.damping, model.stiffness)),
            model.omega,
            (model.constant * signs)[order],
            {h: (p * signs)[order] for h, p in model.harmonics.items()},
            tuple(type(s)(**{**vars(s), "direction": (s.direction * signs)[order]}) for s in stops),
        )
        later = 2 * math.pi / model.omega
        again = follow(other, (q * signs)[order], (v * signs)[order], later, impacts=12, most_periods=30)
        sure = growth < 1e5
        apart = np.abs(listed(again)[: len(growth)] - [later, 0, 0, 0, 0] - listed(seen)[: len(growth)])
        assert (apart <= 1e-11 * np.abs(listed(seen)).max(axis=0).clip(1.0) * growth[:, None])[sure].all()
        assert [ranks[hit.stop] for hit in again.impacts[: sure.sum()]] == [
            hit.stop for hit in seen.impacts[: sure.sum()]
        ]
        compared += sure.sum()
    assert compared > 30


# The rigid stop


def test_a_stiff_stop_tends_to_the_rigid_one_of_its_restitution():
    ratio, direction, mass = 0.2, np.array([0.3, 1.0]), np.array([[2.0, 0.3], [0.3, 1.0]])
    struck = 1.0 / (direction @ np.linalg.solve(mass, direction))
    others = mass, 0.05 * np.eye(2), np.array([[3.0, -1.0], [-1.0, 1.5]]), 1.3

    def velocities(stop):
        seen = follow(system(*others, [stop], {1: [0.5, 1.0]}), [0.0, 0.0], [0.0, 0.0], impacts=6)
        return np.array([hit.velocity for hit in seen.impacts])

    hard = velocities(wall(direction, 0.4, rebound(ratio)[0]))
    apart = [
        np.abs(velocities(spring(direction, 0.4, k, 2.0 * ratio * math.sqrt(k * struck))) - hard).max()
        for k in 10.0 ** np.arange(3, 10)
    ]
    assert all(stiff < soft * 1.1 / math.sqrt(10.0) for soft, stiff in pairwise(apart))
    assert apart[-1] < 1e-3 * hard.max()


def test_a_ball_bounces_as_its_law_of_restitution_says():
    # J. P. Hunt and F. R. Crossley, F = k d^n (1 + D d'): D v (1 + r) = ln((1 + D v)/(1 - r D v)).
    def law(v, damping=0.5):
        x = damping * v
        return brentq(
            lambda r: x * (1 + r) - math.log((1 + x) / (1 - r * x)), 1e-9, min(1.0, (1 - 1e-12) / x), xtol=1e-15
        )

    assert law(2.0) == pytest.approx(0.59362426004004, rel=1e-13)
    ball = system(1, 0, 0, 1.0, [wall([1], 0.0, law)], constant=[9.81])
    seen = follow(ball, [-(3.0**2) / (2 * 9.81)], [0.0], impacts=40)
    time, speed = 3.0 / 9.81, 3.0
    for hit in seen.impacts:
        assert (hit.time, hit.velocity) == pytest.approx((time, speed), rel=1e-11)
        assert hit.impulse == pytest.approx((1 + law(speed)) * speed, rel=1e-11)
        assert hit.energy_lost == pytest.approx((1 - law(speed) ** 2) * speed**2 / 2, rel=1e-10)
        speed *= law(speed)
        time += 2 * speed / 9.81
    assert len(seen.impacts) == 40


def test_a_closed_rigid_stop_bears_what_a_stop_that_gives_hands_on():
    # The first mass is pressed on its rigid stop while the second one is thrown back by a spring between them.
    stops = [wall([1, 0], 0.0, 0.0), spring([-1, 1], 0.5, 100.0)]
    model = system(np.diag([1.0, 2.0]), np.zeros((2, 2)), np.zeros((2, 2)), 1.0, stops, constant=[1.0, 0.0])
    seen = follow(model, [0.0, 0.0], [0.0, 1.5], impacts=1)
    (hit,) = seen.impacts
    assert hit.time == pytest.approx(1.0 / 3.0, rel=1e-13)
    assert hit.closed == (0,)
    assert hit.contact_time == pytest.approx(math.pi * math.sqrt(2.0 / 100.0), rel=1e-13)
    assert (*seen.end.displacement, *seen.end.velocity) == pytest.approx((0.0, 0.5, 0.0, -1.5), abs=1e-13)
    assert seen.closed == (0,)
    assert all(event.kind != "release" for event in seen.events)


# The elastic bar

BAR = {"modulus": 210e9, "density": 7800.0, "speed": 0.1, "gap": 5e-5}
WAVE = 2.0 * math.sqrt(BAR["density"] / BAR["modulus"])  # there and back over its length of 1 m


def elastic_bar(nodes, stop):
    """Return a free bar with a stop at its last node.

    Masses are half consistent and half lumped: the speed of waves errs by the fourth power of an element's length.
    """
    links, size = 2 * np.eye(nodes) - np.eye(nodes, k=1) - np.eye(nodes, k=-1), 1.0 / (nodes - 1)
    links[0, 0] = links[-1, -1] = 1.0
    lumped = np.diag([0.5, *[1.0] * (nodes - 2), 0.5])
    return system(BAR["density"] * size * (lumped - links / 12), 0 * links, BAR["modulus"] / size * links, 1e4, [stop])


@pytest.mark.parametrize("gives", [False, True])
def test_an_elastic_bar_stays_for_a_wave_there_and_back_and_leaves_with_its_whole_speed(gives):
    # With 100 nodes contact and speed are 0.13 % and 0.64 % off at the rigid stop, 0.09 % and 0.41 % at the other one.
    errors = []
    for nodes in (10, 20, 40):
        last = np.eye(nodes)[-1]
        stop = spring(last, BAR["gap"], 3 * nodes * BAR["modulus"]) if gives else wall(last, BAR["gap"], 0.0)
        bar, turns = elastic_bar(nodes, stop), 1.2e-3 * 1e4 / (2 * math.pi)
        seen = follow(bar, np.zeros(nodes), np.full(nodes, BAR["speed"]), most_periods=turns)
        hit, end = seen.events[0], seen.events[-1].time + seen.events[-1].contact_time
        assert hit.time == pytest.approx(BAR["gap"] / BAR["speed"], rel=1e-12)
        assert {event.kind for event in seen.events} == ({"impact"} if gives else {"impact", "stick", "release"})
        mass = bar.mass.sum(axis=0)
        speed = -(mass @ seen.end.velocity) / mass.sum()
        errors.append((abs(end - hit.time - WAVE) / WAVE, abs(speed - BAR["speed"]) / BAR["speed"]))
    assert np.max(errors[2]) < (0.006 if gives else 0.015)
    assert all(after < before for one, other in pairwise(errors) for before, after in zip(one, other, strict=True))
