"""Leaps of systems: no stop is touched on the way, and they end where matrix exponentials do."""

import numpy as np
import pytest
from scipy.linalg import expm

import vibroimpact as vi
from systems import a_random_system
from vibroimpact.backends.modal.rows import in_steps, steps_of
from vibroimpact.backends.modal.sweep import layout_for
from vibroimpact.kernels.systems.layout import OPEN, STRUCK
from vibroimpact.kernels.systems.leap import FAR, HALF, LEAPS, WHOLE, leap, leap_far, look

POINTS = 100
LENGTHS = HALF, WHOLE


def remade(model, **changes):
    return vi.ImpactSystem(**model.arguments() | changes)


def proportional(rng, n):
    """Return a random system whose damping is a part of its stiffness; its modes decouple."""
    model = a_random_system(rng, n)
    return remade(model, damping=0.1 * model.stiffness)


def stiff(rng, n):
    """Return a random system with a mode some 30 times faster than the others, and a damper that couples it."""
    model, push = a_random_system(rng, n), rng.standard_normal(n)
    hard = model.stiffness + 1000.0 * np.outer(push, push)
    return remade(model, stiffness=hard, damping=np.outer(push, push) + 0.05 * np.eye(n))


def rolling(rng, n):
    """Return a random system that drifts as a whole, with a dashpot between some of its coordinates."""
    apart = np.eye(n) - 1.0 / n
    model, between = a_random_system(rng, n), rng.standard_normal(n) @ apart
    return remade(model, stiffness=apart @ model.stiffness @ apart, damping=np.outer(between, between))


def overdamped(rng, n):
    """Return a random system of which some modes creep back."""
    spread = rng.standard_normal((n, n))
    return a_random_system(rng, n, damping=2.0 * spread @ spread.T)


KINDS = {"general": a_random_system} | {made.__name__: made for made in (proportional, stiff, rolling, overdamped)}


class Leaping:
    """A system in the engine's rows, and the matrix of (q, v, 1, sin hwt, cos hwt)' of its equations."""

    def __init__(self, model):
        far = remade(model, stops=[stop.replace(gap=1e3) for stop in model.stops])  # there is room for a start
        cells, n = far.cells({}), len(model.mass)
        self.k, self.cells, self.step = layout_for(cells), cells, float(steps_of(cells)[0])
        self.table, self.mass = in_steps(cells, 1e-9, self.k), model.mass
        inverse, constant = np.linalg.inv(model.mass), model.force.constant
        orders = sorted(model.force.harmonics | {h: 0 for stop in model.stops for h in stop.motion})
        self.matrix = np.zeros((2 * n + 1 + 2 * len(orders),) * 2)
        self.matrix[:n, n : 2 * n] = np.eye(n)
        self.matrix[n : 2 * n, : 2 * n + 1] = inverse @ np.column_stack(
            [-model.stiffness, -model.damping, np.zeros(n) if constant is None else constant]
        )
        self.waves, self.rounding = np.array(orders), 1e-13 * max(1.0, 1.0 / self.step)
        self.seen = np.zeros((len(model.stops), len(self.matrix)))
        self.seen[:, :n] = [-stop.direction for stop in model.stops]
        for place, order in enumerate(orders):
            at, push = 2 * n + 1 + 2 * place, inverse @ model.force.harmonics.get(order, np.zeros(n))
            self.matrix[n : 2 * n, at], self.matrix[n : 2 * n, at + 1] = push.real, push.imag
            self.matrix[at, at + 1], self.matrix[at + 1, at] = order * model.omega, -order * model.omega
            moved = np.array([stop.motion.get(order, 0.0) for stop in model.stops], complex)
            self.seen[:, at], self.seen[:, at + 1] = moved.real, moved.imag

    def state(self, rng):
        """Return a random state of some size, at a random phase."""
        n, angle = self.k.modes, rng.uniform(0.0, 2.0 * np.pi)
        waves = np.column_stack([np.sin(self.waves * angle), np.cos(self.waves * angle)]).ravel()
        free = rng.standard_normal(2 * n) * 10.0 ** rng.uniform(-2, 1)
        free[n:] *= 10.0 ** rng.uniform(-1, 1)
        return np.concatenate([free, [1.0], waves]), angle

    def course(self, state, length, points=POINTS):
        """Return the states on the way, and what the clearances are but for the gaps."""
        step, states = expm(self.matrix * self.step * length / points), [state]
        for _ in range(points):
            states.append(step @ states[-1])
        return np.array(states), np.array(states) @ self.seen.T

    def leap(self, state, angle, gaps, kinds, length, deviation=None):
        """Return whether a leap is made from there, and coordinates and velocities after it, or a neighbour's."""
        k, form, rows = self.k, self.cells.shapes[0], np.zeros(self.k.rows)
        rows[: k.constants], rows[k.pace] = self.table[0], 1.0
        inverse, n = np.linalg.inv(form), k.modes
        rows[k.eta : k.eta + n] = inverse @ state[:n]
        rows[k.rate : k.rate + n] = inverse @ state[n : 2 * n] * self.step
        if deviation is not None:
            k = k._replace(thorough=True)
            rows[k.deta : k.deta + n], rows[k.drate : k.drate + n] = (
                inverse @ deviation[:n],
                (inverse @ deviation[n : 2 * n] * self.step),
            )
        rows[k.turn : k.turn + 2] = np.sin(angle), np.cos(angle)
        rows[k.gap : k.gap + k.stops], rows[k.kind : k.kind + k.stops] = gaps, kinds
        rows[k.calm] = np.inf  # all stops are looked at
        before = rows.copy()
        look(rows, k, None)
        if length == FAR:
            leap_far.part(rows, k, None, True)
            made = round(rows[k.age] / FAR)
        else:
            made = leap(rows, k, None, length == WHOLE, True)
        if not made:
            np.testing.assert_array_equal(rows[: k.reference], before[: k.reference])
        y, p = (k.eta, k.rate) if deviation is None else (k.deta, k.drate)
        return made, np.concatenate([form @ rows[y : y + n], form @ rows[p : p + n] / self.step])


def motions(kind, seed, number=30):
    """Yield a generator, random systems of a kind, states and phases."""
    rng = np.random.default_rng(seed)
    for _ in range(number):
        one = Leaping(KINDS[kind](rng, int(rng.integers(1, 5))))
        for _ in range(20):
            yield rng, one, *one.state(rng)


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("length", LENGTHS)
def test_no_leap_is_made_over_a_stop_that_is_touched_and_others_end_where_they_should(kind, length):
    count = 0
    for rng, one, state, angle in motions(kind, 1):
        states, without = one.course(state, length)
        lowest, depth = -without.min(axis=0), np.ptp(without, axis=0)
        over = 10.0 ** rng.uniform(-12, 1, size=one.k.stops) * depth + one.rounding * np.abs(states).max()
        opened, touched = np.full(one.k.stops, OPEN), np.arange(one.k.stops) == rng.integers(one.k.stops)
        assert not one.leap(state, angle, np.where(touched, lowest - over, lowest + over), opened, length)[0]
        leapt, after = one.leap(state, angle, lowest + over, opened, length)
        if leapt:
            np.testing.assert_allclose(
                after, states[-1][: len(after)], rtol=0, atol=one.rounding * np.abs(states).max()
            )
        count += leapt
    assert count > 200  # of 600


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("length", LENGTHS)
def test_no_leap_is_made_from_an_impact_to_the_next(kind, length):
    """The speed after the impact is that with which the same stop is just touched, or missed, later on."""
    count = 0
    for rng, one, state, angle in motions(kind, 2):
        n, z, far = one.k.modes, int(rng.integers(one.k.stops)), int(rng.integers(1, POINTS))
        kick = 0.0 * state
        kick[n : 2 * n] = np.linalg.solve(one.mass, one.seen[z, :n])
        (_, a), (_, b) = one.course(state, length), one.course(kick, length)
        gained, needed = b[far:, z], a[0, z] - a[far:, z]
        least = np.max(needed[gained > 0.0] / gained[gained > 0.0], initial=0.0)
        for off in 10.0 ** rng.uniform(-12, 2) * np.array([-1.0, 1.0]) * abs(least):
            without = a + (least + off) * b
            kinds, gaps = np.full(one.k.stops, OPEN), 2.0 * np.abs(without).max(axis=0)
            kinds[z], gaps[z] = STRUCK, -a[0, z]
            leapt, _ = one.leap(state + (least + off) * kick, angle, gaps, kinds, length)
            count += leapt
            assert not leapt or (without[1:, z] > a[0, z] - one.rounding * np.abs(without).max()).all()
    assert count > 10


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_a_neighbour_leaps_as_the_motion_without_load_does(kind):
    for rng, one, state, angle in motions(kind, 3, 10):
        deviation = 0.0 * state
        deviation[: 2 * one.k.modes] = rng.standard_normal(2 * one.k.modes)
        (after, _), size = one.course(deviation, WHOLE), np.abs(state).max()
        gaps, opened = np.full(one.k.stops, 1e6 * size), np.full(one.k.stops, OPEN)
        leapt, beside = one.leap(state, angle, gaps, opened, WHOLE, deviation)
        if leapt:
            np.testing.assert_allclose(
                beside, after[-1][: len(beside)], rtol=0, atol=one.rounding * np.abs(after).max()
            )


def spread_out(rng, n):
    """Return a random system of which some modes are up to 100 times as fast as others; none is coupled to another."""
    model, rates = a_random_system(rng, n), 10.0 ** rng.uniform(-1, 1, n)
    damping, load = 10.0 ** rng.uniform(-3, 0, n) * rates, rng.standard_normal(n) * rates
    force = vi.Force(omega=model.omega, harmonics={1: load, 3: 0.2 * load}, constant=load)
    return remade(model, mass=np.eye(n), damping=np.diag(damping), stiffness=np.diag(rates**2), force=force)


@pytest.mark.long
def test_far_leaps_end_before_a_stop_is_touched_and_where_they_should():
    rng, leaps, tried, closest = np.random.default_rng(5), 0, 0, np.inf
    for _ in range(300):
        one = Leaping(spread_out(rng, int(rng.integers(2, 5))))
        for _ in range(20 if one.k.far else 0):
            state, angle = one.state(rng)
            states, without = one.course(state, LEAPS * FAR, LEAPS * POINTS)
            swing = np.ptp(without, axis=0)
            gaps = -without[0] + 10.0 ** rng.uniform(-2, 1, one.k.stops) * swing
            leapt, after = one.leap(state, angle, gaps, np.full(one.k.stops, OPEN), FAR)
            way = (gaps + without[: leapt * POINTS + 1])[1:]
            assert (way > 0.0).all()
            there = states[leapt * POINTS][: len(after)]
            np.testing.assert_allclose(after, there, rtol=0, atol=LEAPS * one.rounding * np.abs(states).max())
            leaps, tried = leaps + (leapt > 0), tried + 1
            closest = min(closest, (way / swing).min(initial=np.inf))
    assert tried > 1000
    assert leaps > 100
    assert closest < 0.2  # of a swing: the bound is no idle one


def test_what_is_seen_within_far_leaps_is_the_motion():
    rng, count = np.random.default_rng(6), 0
    for _ in range(20):
        model = spread_out(rng, 3)
        model = remade(model, stops=[stop.replace(gap=1e3) for stop in model.stops])
        one = Leaping(model)
        if not one.k.far:
            continue
        state = np.concatenate([rng.standard_normal(6), [1.0], np.tile([0.0, 1.0], len(one.waves))])
        start = vi.State(state[:3].tolist(), state[3:6].tolist())
        motion, step = vi.simulate(model, start=start, periods=5, samples_per_period=37), model.period / 37
        turn = expm(one.matrix * step)
        for displacement, velocity in zip(motion["displacement"].values, motion["velocity"].values, strict=True):
            size = 1e-11 * np.abs(state).max()
            np.testing.assert_allclose(np.concatenate([displacement, velocity]), state[:6], rtol=0, atol=size)
            state = turn @ state
        count += 1
    assert count > 3


@pytest.mark.parametrize("ends", ["tube_in_supports", "clamped_tube_in_supports"])
@pytest.mark.parametrize("modes", [3, 5, 8, 12])
def test_to_look_for_near_misses_changes_no_motion_before_or_in_the_window(ends, modes):
    """Far leaps of many modes keep away from every stop, also where no near-miss counts yet."""
    tube = getattr(vi.models, ends)(modes=modes, force_per_length=12.0)
    window = {"omega": [tube.omega], "transient_impacts": 20, "sample_impacts": 20}
    plain = vi.parameter_map(tube, indices=["max_velocity", "mean_velocity"], **window)
    wary = vi.parameter_map(tube, indices=["max_velocity", "mean_velocity", "grazing_margin"], **window)
    for name in ("max_velocity", "mean_velocity"):
        assert wary[name].item() == pytest.approx(plain[name].item(), rel=1e-6)
    hits = vi.impact_section(tube, transient_impacts=20, sample_impacts=20)["velocity"].values
    assert wary["max_velocity"].item() == pytest.approx(hits.max(), rel=1e-6)
