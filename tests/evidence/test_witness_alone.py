"""What only the witness shows: laws of impacts, forces of compliant stops, and the balance of energy."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import vibroimpact as vi
from systems import drawn, linear, system
from vibroimpact.backends.reference.contacts import impact_law
from witness import follow

# Laws of impacts


@pytest.mark.long
def test_energy_never_grows_at_an_impact():
    rng = np.random.default_rng(2)
    for _ in range(10_000):
        s = int(rng.integers(1, 4))
        n = int(rng.integers(1, 5))
        root = rng.normal(size=(n, n))
        mass, directions = root @ root.T + 0.01 * np.eye(n), rng.normal(size=(s, n))
        if s > 1 and rng.random() < 0.2:
            directions[1] = 2.0 * directions[0]  # parallel stops
        closed = int(rng.integers(0, min(s, n)))  # so many of them are closed: no velocity in their directions
        velocity = rng.normal(size=n)
        velocity -= np.linalg.pinv(directions[:closed]) @ directions[:closed] @ velocity
        rates = -directions @ velocity
        rates[np.abs(rates) < 1e-12] = 0.0
        directions[rates > 0.0] *= -1.0
        rates = -np.abs(rates)
        kappa, restitution = np.linalg.solve(mass, directions.T), rng.uniform(0, 1, s)
        after, impulses = impact_law(directions @ kappa, restitution, rates)
        speeds = velocity - kappa @ impulses
        scale = velocity @ mass @ velocity
        assert speeds @ mass @ speeds <= scale * (1 + 1e-11)
        size = math.sqrt(scale) * np.sqrt(np.diag(directions @ kappa))
        assert (impulses * np.diag(directions @ kappa) >= -1e-9 * size).all()
        assert (after + restitution * rates >= -1e-9 * size).all()
        assert after == pytest.approx(rates + directions @ kappa @ impulses, abs=1e-9 * size.max())


@pytest.mark.parametrize(("side", "impulses"), [(-1, (6.0, 6.0)), (1, (0.0, 2.0))])
def test_a_closed_stop_bears_what_a_struck_one_hands_on_and_opens_where_it_is_pulled_at(side, impulses):
    """Of two free masses the first one lies on its stop: the second one strikes it from behind, or takes it along."""
    seat = vi.Stop(direction=[1, 0], gap=0.0, restitution=0.25 + 0.25 * side)
    stops = [seat, vi.Stop(direction=[side, -side], gap=1.0, restitution=0.5)]
    pair = system(np.diag([1.0, 2.0]), np.zeros((2, 2)), np.zeros((2, 2)), 1.0, stops, constant=[1.0, 0.0])
    (hit,) = follow(linear(pair), [0.0, 0.0], [0.0, -2.0 * side], impacts=1).impacts
    assert (hit.time, hit.velocity, hit.closed) == (pytest.approx(0.5), pytest.approx(2.0), (0,))
    assert hit.impulses == pytest.approx(impulses, abs=1e-13)


def test_stops_that_squeeze_a_mass_are_refused():
    """A moving corner presses the mass against a stop that stands."""
    corner = [vi.Stop(direction=[-1, side], gap=0.0, restitution=0.0, motion={1: -2.0}) for side in (1, -1)]
    stops = [vi.Stop(direction=[1, 0], gap=1.0, restitution=0.0), *corner]
    nothing = np.zeros((2, 2))
    with pytest.raises(ValueError, match="no velocity separates"):
        follow(linear(system(np.eye(2), nothing, nothing, 1.0, stops, constant=[-9.0, 0.0])), [0.5, 0.0], [0.0, 0.0])


def test_a_start_beyond_a_stop_is_refused():
    with pytest.raises(ValueError, match="beyond a stop"):
        follow(linear(system(1, 0.05, 1, 2.0, [vi.Stop(direction=1, gap=0.5)])), [0.6], [0.0])


# Compliant stops


def test_a_stop_that_let_go_pushes_again_in_the_same_contact():
    # Let go at k d = c s, d' = -s, the mass is turned by its weight f before it is out: d = d0 - s t + f t^2/(2 m), and
    # k d + c d' is zero again after 2 (s m/f - c/k).
    v, k, c = 1.65, 4.0, 1.0  # c/(m k) < s/f < 2 c/(m k)
    pressed = system(1, 0, 0, 1.0, [vi.Stop(direction=1, gap=0.0, stiffness=k, damping=c)], constant=[1.0])
    trajectory = follow(linear(pressed), [-(v**2) / 2], [0.0], impacts=3, most_periods=4)
    changes = [
        now for now, before in zip(trajectory.pieces[1:], trajectory.pieces, strict=False) if now[1] is not before[1]
    ]
    (touch, _, _), (let_go, _, _), (again, phase, _) = changes
    assert touch == trajectory.impacts[0].time == pytest.approx(v, rel=1e-14)
    assert phase.pushing == (0,)
    speed = -trajectory.at([let_go])[1][0, 0]
    assert again - let_go == pytest.approx(2.0 * (speed - c / k), rel=1e-12)
    end = (trajectory.end.periods + trajectory.end.phase) * 2 * math.pi
    (hit,) = trajectory.impacts
    assert hit.contact_time == pytest.approx(end - touch - (again - let_go), rel=1e-13)
    assert hit.impulse == pytest.approx(v + (end - touch) - trajectory.end.velocity[0], rel=1e-13)


def work_and_losses(model, trajectory, begin, end):
    """Return the work of the force between two times and what the dampers of the system took, by quadrature."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    edges = np.array([begin, *(t for t, _, _ in trajectory.pieces if begin < t < end), end])
    work = lost = 0.0
    for low, high in pairwise(edges):
        times = low + (high - low) * (1.0 + nodes) / 2.0
        v = trajectory.at(times)[1]
        turn = np.exp(1j * model.omega * times)
        load = model.constant + sum((np.outer(turn**h, p)).imag for h, p in model.harmonics.items())
        part = (high - low) * weights / 2.0
        work += part @ (load * v).sum(axis=1)
        lost += part @ (v * (v @ model.damping.T)).sum(axis=1)
    return work, lost


def test_the_work_of_the_force_is_the_change_of_energy_and_what_dampers_and_stops_took():
    compared = 0
    for seed in range(8):
        model, q, v = drawn(np.random.default_rng([17, seed]), of_any_kind=True)
        still = [stop.replace(motion={}) for stop in model.stops]
        model = linear(vi.ImpactSystem(**model.arguments() | {"stops": still}))
        trajectory = follow(model, q, v, impacts=12, most_periods=30)
        flights = [piece for piece in trajectory.pieces if not piece[1].pushing]
        (begin, _, _), (end, _, _) = flights[1], flights[-1]
        (q0, q1), (v0, v1) = trajectory.at([begin, end])
        gained = (
            (v1 @ model.mass @ v1 - v0 @ model.mass @ v0) + (q1 @ model.stiffness @ q1 - q0 @ model.stiffness @ q0)
        ) / 2
        work, lost = work_and_losses(model, trajectory, begin, end)
        losses = [hit.energy_lost for hit in trajectory.impacts if begin < hit.time <= end]
        scale = abs(work) + abs(gained) + lost
        assert work == pytest.approx(gained + lost + sum(losses), abs=1e-12 * scale)
        assert min(losses) > -1e-13 * scale
        compared += len(losses)
    assert compared > 30


@pytest.mark.long(but=1)
@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_a_step_by_step_integration_of_the_forces_gives_the_same_motion(seed):
    model, q, v = drawn(np.random.default_rng([17, seed]), of_any_kind=True)
    soft = [stop for stop in model.stops if stop.compliant and stop.stiffness < 1e4]
    n, model = len(q), linear(vi.ImpactSystem(**model.arguments() | {"stops": soft}))

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

    trajectory = follow(model, q, v, impacts=6, most_periods=10)
    assert trajectory.impacts
    times = np.linspace(0.0, min(trajectory.impacts[-1].time, 20.0), 50)
    stepped = solve_ivp(change, (0.0, times[-1]), [*q, *v], "DOP853", times, rtol=1e-11, atol=1e-12, max_step=2e-3)
    assert np.abs(stepped.y[:n].T - trajectory.at(times)[0]).max() < 1e-6
