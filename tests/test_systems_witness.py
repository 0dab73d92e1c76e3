"""The witness for systems of several coordinates and stops, against closed forms and identities."""

import cmath
import math
from functools import cache

import numpy as np
import pytest
from scipy.linalg import block_diag, expm

import vibroimpact as vi
from vibroimpact.backends.reference.contacts import impact_law
from vibroimpact.backends.reference.systems import LinearSystem, RigidStop, follow


def system(mass, damping, stiffness, omega, stops, force=None, constant=None):
    mass, damping, stiffness = (np.atleast_2d(np.asarray(a, float)) for a in (mass, damping, stiffness))
    harmonics = {h: np.asarray(p, complex) for h, p in (force or {}).items()}
    load = np.zeros(len(mass)) if constant is None else np.asarray(constant, float)
    return LinearSystem(mass, damping, stiffness, omega, load, harmonics, tuple(stops))


def stop(direction, gap, restitution, motion=None):
    return RigidStop(np.asarray(direction, float), gap, restitution, motion or {})


CHAIN = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
TWO_SIDED = system(1, 0.05, 1, 2.0, [stop([1], 0.5, 0.6), stop([-1], 0.5, 0.6)], {1: [1.0]})
THREE_MASSES = system(np.eye(3), 0.02 * CHAIN, CHAIN, 0.9, [stop([0, 0, 1], 0.5, 0.7)], {1: [1.0, 0.0, 0.0]})
PARTICLE = system(
    np.diag([1.0, 0.1]),
    np.diag([0.02, 0.0]),
    np.diag([1.0, 0.0]),
    1.0,
    [stop([-1, 1], 10.0, 0.8), stop([1, -1], 10.0, 0.8)],
    {1: [1.0, 0.0]},
)


def one_impact(design, half=False):
    """Return velocity, phase of contact and the state after it, of all motions with one impact in T (or T/2)."""
    hit = design.stops[0]
    a, n, w = hit.direction, len(design.mass), design.omega
    kappa = np.linalg.solve(design.mass, a) / (a @ np.linalg.solve(design.mass, a))
    flow = np.linalg.solve(design.mass, np.column_stack([-design.stiffness, -design.damping]))
    matrix = np.block([[np.zeros((n, n)), np.eye(n)], [flow]])
    jump = (1 + hit.restitution) * np.concatenate([np.zeros(n), kappa])
    if half:
        z = -np.linalg.solve(expm(matrix * math.pi / w) + np.eye(2 * n), jump)
    else:
        z = np.linalg.solve(expm(matrix * 2 * math.pi / w) - np.eye(2 * n), jump)
    alpha, beta = -a @ z[:n], -hit.restitution - a @ z[n:]
    steady = np.linalg.solve(design.stiffness + 1j * w * design.damping - w**2 * design.mass, design.harmonics[1])
    reach = a @ steady
    quadratic = [alpha**2 + beta**2 / w**2, 2 * alpha * hit.gap, hit.gap**2 - abs(reach) ** 2]
    found = []
    for v in np.roots(quadratic).real:
        if v > 0:
            wave = complex(beta * v / w, hit.gap + alpha * v) / reach  # exp(i w t)
            q = (steady * wave).imag + z[:n] * v
            found.append((v, cmath.phase(wave) / (2 * math.pi) % 1.0, q, w * (steady * wave).real + z[n:] * v))
    return found


@pytest.mark.parametrize(
    ("design", "half", "velocity", "phase", "radius"),
    [
        (TWO_SIDED, True, 1.01091975000998629752895, 0.30697182627669859292, 0.576894695880845),
        (THREE_MASSES, False, 0.6314772880991517553058458, 0.61512189651226436508, 0.916997423593104),
        (PARTICLE, True, 9.407221992561745893002965, 0.74256436841325221938, 0.951484071086934),
    ],
    ids=["two-sided", "three masses", "impact damper"],
)
def test_a_motion_of_one_impact_is_that_of_its_closed_form(design, half, velocity, phase, radius):
    v, at, q, dq = next(orbit for orbit in one_impact(design, half) if abs(orbit[0] - velocity) < 1e-6)
    assert v == pytest.approx(velocity, rel=1e-13)
    period = 2 * math.pi / design.omega
    span = period / 2 if half else period
    seen = follow(design, q, dq, at * period, impacts=6)
    assert [event.velocity for event in seen.impacts] == pytest.approx([velocity] * 6, rel=1e-12)
    turn = 0.5 if half else 1.0
    assert [event.time / period for event in seen.impacts] == pytest.approx(
        [phase + turn * (i + 1) for i in range(6)], rel=1e-12
    )
    assert [event.stop for event in seen.impacts] == ([1, 0] * 3 if half else [0] * 6)
    begin = (at + 0.3 * turn) * period
    state = np.concatenate([part[0] for part in seen.at([begin])])
    sign = -1.0 if half else 1.0
    jacobian = sign * differences(design, state, begin, span)
    assert max(abs(np.linalg.eigvals(jacobian))) == pytest.approx(radius, rel=1e-7)


def differences(design, state, begin, span):
    """Return the derivative of the state after a time by the state before, by central differences."""
    n, step = len(design.mass), 2e-5
    turns = span * design.omega / (2 * math.pi)

    def ended(x):
        end = follow(design, x[:n], x[n:], begin, impacts=100, most_periods=turns).end
        return np.concatenate([end.displacement, end.velocity])

    columns = []
    for unit in step * np.eye(2 * n):
        near = (ended(state + unit) - ended(state - unit)) / (2 * step)
        far = (ended(state + 2 * unit) - ended(state - 2 * unit)) / (4 * step)
        columns.append((4 * near - far) / 3)
    return np.array(columns).T


def test_volumes_shrink_by_the_damping_and_by_the_square_of_the_restitution():
    rng = np.random.default_rng(3)
    for n in (1, 2, 3):
        design = random_system(rng, n, 1, restitution=0.6)
        _, _, seen = hitting(design, rng)
        first, second = (event.time for event in seen.impacts[:2])
        begin, span = 0.5 * first, 0.5 * first + 0.5 * (second - first)
        state = np.concatenate([part[0] for part in seen.at([begin])])
        found = np.linalg.det(differences(design, state, begin, span))
        loss = np.trace(np.linalg.solve(design.mass, design.damping))
        assert found == pytest.approx(0.36 * math.exp(-loss * span), rel=1e-7)


def random_system(rng, n, stops, restitution=None, free=False):
    def positive(size, least):
        root = rng.normal(size=(size, size))
        return root @ root.T / size + least * np.eye(size)

    stiffness = positive(n, 0.2)
    if free:
        mode = rng.normal(size=n)
        mode /= np.linalg.norm(mode)
        away = np.eye(n) - np.outer(mode, mode)
        stiffness = away @ stiffness @ away
    return system(
        positive(n, 0.5),
        0.05 * positive(n, 0.1),
        stiffness,
        rng.uniform(0.5, 2.0),
        [
            stop(
                rng.normal(size=n),
                rng.uniform(0.0, 0.5),
                rng.uniform(0.3, 0.9) if restitution is None else restitution,
                {2: 0.1 * complex(*rng.normal(size=2))} if j else {},
            )
            for j in range(stops)
        ],
        {1: rng.normal(size=n) + 1j * rng.normal(size=n), 3: 0.5 * rng.normal(size=n)},
        0.2 * rng.normal(size=n),
    )


def hitting(design, rng, impacts=3, tries=1000):
    """Return a start in front of every stop and the motion from it; None if no start makes so many impacts soon."""
    for _ in range(tries):
        q, dq = 0.3 * rng.normal(size=len(design.mass)), rng.normal(size=len(design.mass))
        room = [s.gap + sum(d.imag for d in s.motion.values()) - s.direction @ q for s in design.stops]
        if min(room) > 0.05:
            seen = follow(design, q, dq, impacts=impacts, most_periods=10)
            if len(seen.impacts) >= impacts:
                return q, dq, seen
    return None


@pytest.mark.parametrize("n_periods", [1, 2])
def test_a_ball_bounces_on_a_table_as_its_fixed_point_says(n_periods):
    r, g, w = 0.5, 9.81, 10.0
    fold = n_periods * math.pi * (1 - r) / (1 + r)
    gamma = 1.1 * fold
    design = system(1, 0, 0, w, [stop([-1], 0.0, r, {1: -gamma * g / w**2})], constant=[-g])
    phase = math.acos(fold / gamma)
    speed = g * n_periods * math.pi / w  # before and after, of the ball itself
    table = gamma * g / w
    height, before = gamma * g / w**2 * math.sin(phase), speed + table * math.cos(phase)
    seen = follow(design, [height], [-speed], phase / w, impacts=5)
    period = 2 * math.pi / w
    assert [event.velocity for event in seen.impacts] == pytest.approx([before] * 5, rel=1e-11)
    assert [event.time for event in seen.impacts] == pytest.approx(
        [phase / w + n_periods * period * i for i in range(5)], rel=1e-11
    )
    begin = phase / w + 0.4 * period
    state = np.concatenate([part[0] for part in seen.at([begin])])
    trace = np.trace(differences(design, state, begin, n_periods * period))
    assert trace == pytest.approx(1 + r**2 - (1 + r) ** 2 * gamma * math.sin(phase), rel=1e-6)


# One mass with one stop


def as_system(osc):
    stops = [stop([1], osc.gap, osc.restitution)]
    return system(osc.mass, osc.damping, osc.stiffness, osc.omega, stops, {1: [osc.amplitude]})


def alike(osc, start, impacts=20):
    """Return the errors of times (of 1/w_n) and velocities (of V), and how many sticks there were."""
    theirs = vi.impact_section(osc, start=start, transient_impacts=0, sample_impacts=impacts)
    how = {"impacts": impacts, "cut": 1e-9 * osc.velocity_scale, "most_periods": 300}
    seen = follow(as_system(osc), [start.displacement], [start.velocity], start.time, **how)
    hits = seen.impacts
    assert len(hits) == theirs.sizes["impact"]
    last = hits[-1].time if hits else 0.0
    sticks = [event.time for event in seen.events if event.kind == "stick" and event.time < last]
    releases = [event.time for event in seen.events if event.kind == "release" and event.time < last]
    late = np.array([event.time for event in hits]) - theirs.time.values
    fast = np.array([event.velocity for event in hits]) - theirs.velocity.values
    errors = [late * osc.natural_frequency, fast / osc.velocity_scale]
    errors += [(found - known) * osc.natural_frequency for found, known in
               ((sticks, theirs.stick_time.values), (releases, theirs.release_time.values))]  # fmt: skip
    return np.array([np.abs(e).max(initial=0.0) for e in errors]), len(hits), len(sticks)


@pytest.mark.parametrize(
    ("osc", "sticks"),
    [
        (vi.ImpactOscillator(omega=2.0), 0),
        (vi.ImpactOscillator(omega=1.4, gap=0.4, damping=0.1), 0),
        (vi.ImpactOscillator(omega=0.2, restitution=0.2, damping=0.05), 3),
        (vi.ImpactOscillator(omega=0.6, restitution=0.3, gap=-0.3, damping=0.1), 3),
        (vi.ImpactOscillator(omega=0.3, restitution=0.0, gap=0.2), 3),
        (vi.ImpactOscillator(omega=0.25, restitution=0.4, gap=-0.2, damping=3.0), 2),
    ],
    ids=["w=2", "gap", "slow", "preloaded", "r=0", "overdamped"],
)
def test_one_mass_and_one_stop_move_as_the_oscillator_does(osc, sticks):
    errors, impacts, stuck = alike(osc, vi.State(min(0.0, osc.gap) - 1.0, 0.1, 0.3), 60)
    assert errors.max() < 1e-12
    assert impacts == 60
    assert stuck >= sticks


def test_random_oscillators_make_the_same_first_20_impacts():
    rng = np.random.default_rng(1)
    for _ in range(25):
        osc = vi.ImpactOscillator(
            mass=10 ** rng.uniform(-1, 1), stiffness=10 ** rng.uniform(-1, 1), damping=10 ** rng.uniform(-2, 0),
            amplitude=1.0, omega=10 ** rng.uniform(-0.7, 0.7), restitution=rng.uniform(0, 0.8),
            gap=rng.uniform(-0.5, 0.5),
        )  # fmt: skip
        behind = rng.uniform(0, 1)
        theirs, near = (
            vi.impact_section(osc, start=vi.State(osc.gap - back, 0.0, 0.0), transient_impacts=0, sample_impacts=20)
            for back in (behind, behind * (1 + 1e-9))
        )
        seen = follow(as_system(osc), [osc.gap - behind], [0.0], cut=1e-9 * osc.velocity_scale, most_periods=200)
        assert len(seen.impacts) == theirs.sizes["impact"]
        for name in ("time", "velocity"):
            if near.sizes["impact"] == theirs.sizes["impact"]:
                values = np.array([getattr(event, name) for event in seen.impacts])
                growth = np.maximum.accumulate(np.abs(near[name].values - theirs[name].values)) / 1e-9
                assert (
                    np.abs(values - theirs[name].values) <= 1e-12 * (1 + theirs[name].values) + 1e-13 * growth
                ).all()


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
        left = velocity - kappa @ impulses
        scale = velocity @ mass @ velocity
        assert left @ mass @ left <= scale * (1 + 1e-11)
        size = math.sqrt(scale) * np.sqrt(np.diag(directions @ kappa))
        assert (impulses * np.diag(directions @ kappa) >= -1e-9 * size).all()
        assert (after + restitution * rates >= -1e-9 * size).all()
        assert after == pytest.approx(rates + directions @ kappa @ impulses, abs=1e-9 * size.max())


def test_an_impact_on_one_stop_loses_what_its_restitution_says():
    rng = np.random.default_rng(4)
    for _ in range(20):
        design = random_system(rng, 3, 1)
        hit = design.stops[0]
        _, _, seen = hitting(design, rng, impacts=1)
        struck = 1.0 / (hit.direction @ np.linalg.solve(design.mass, hit.direction))
        event = seen.impacts[0]
        assert event.impulse == pytest.approx((1 + hit.restitution) * event.velocity * struck, rel=1e-12)
        before = seen.at([event.time - 1e-9])[1][0]
        loss = before @ design.mass @ before / 2 - seen.end.velocity @ design.mass @ seen.end.velocity / 2
        assert loss == pytest.approx(struck * event.velocity**2 * (1 - hit.restitution**2) / 2, rel=1e-6)


# Stops that are closed


def carried(restitution=0.0, gap=1.0):
    """Return a mass on a free particle that is pressed on a stop: both stops in one line, the first one closed."""
    return system(
        np.diag([1.0, 2.0]), np.zeros((2, 2)), [[1.0, -1.0], [-1.0, 1.0]], 1.0,
        [stop([1, 0], 0.0, 0.0), stop([-1, 1], gap, restitution)], constant=[1.0, 3.0],
    )  # fmt: skip


def test_a_stop_can_be_struck_while_another_is_closed():
    design = carried(restitution=0.5)
    seen = follow(design, [0.0, 0.0], [0.0, 1.0], impacts=1)
    assert [(event.kind, event.stop) for event in seen.events] == [("stick", 0), ("impact", 1)]
    hit = seen.impacts[0]
    # While the first mass is held the second one is an oscillator: 2 q'' + q = 3.
    rate = math.sqrt(0.5)
    assert hit.closed == (0,)
    assert 3 + (-3) * math.cos(rate * hit.time) + math.sin(rate * hit.time) / rate == pytest.approx(1.0, abs=1e-13)
    assert hit.velocity == pytest.approx(3 * rate * math.sin(rate * hit.time) + math.cos(rate * hit.time), rel=1e-13)
    # The struck mass passes on no less than it has: 0 <= P with the held one taking the reaction.
    assert hit.impulses[0] == pytest.approx(hit.impulses[1], rel=1e-13)
    assert hit.impulse == pytest.approx(2.0 * 1.5 * hit.velocity, rel=1e-13)
    assert seen.closed == (0,)


def test_an_impact_can_open_a_closed_stop():
    # The second mass strikes the first one from the other side and takes it along.
    design = system(
        np.diag([1.0, 2.0]), np.zeros((2, 2)), np.zeros((2, 2)), 1.0,
        [stop([1, 0], 0.0, 0.5), stop([1, -1], 1.0, 0.5)], constant=[1.0, 0.0],
    )  # fmt: skip
    seen = follow(design, [0.0, 0.0], [0.0, -2.0], impacts=1)
    assert [(event.kind, event.stop) for event in seen.events] == [("stick", 0), ("impact", 1), ("release", 0)]
    hit = seen.impacts[0]
    assert (hit.time, hit.velocity) == pytest.approx((0.5, 2.0), rel=1e-13)
    assert hit.closed == (0,)
    assert hit.impulses == pytest.approx((0.0, 2.0), abs=1e-13)
    assert seen.end.velocity == pytest.approx([-2.0, -1.0], rel=1e-13)


def test_a_closed_stop_opens_where_its_force_falls_through_zero():
    # Two masses, the first one pressed on its stop through the spring between them: 1 + (q2 - q1) = 0.
    design = system(
        np.eye(2), np.zeros((2, 2)), [[1.0, -1.0], [-1.0, 1.0]], 1.0, [stop([1, 0], 0.0, 0.5)], constant=[1.0, 0.0]
    )
    seen = follow(design, [0.0, 0.0], [0.0, -2.0], impacts=1, most_periods=1)
    assert [(event.kind, event.stop) for event in seen.events[:2]] == [("stick", 0), ("release", 0)]
    assert seen.events[1].time == pytest.approx(math.pi / 6, rel=1e-14)  # -2 sin t = -1


def test_a_mode_remembers_what_was_before_a_stick():
    # The stop holds the first mass, while the second one goes on as it likes.
    design = system(
        np.eye(2), 0.05 * np.eye(2), [[2.0, -0.5], [-0.5, 1.0]], 0.3, [stop([1, 0], 0.0, 0.3)], {1: [2.0, 0.0]}
    )
    begin, after = 1.0, []
    for other in (0.0, 0.8):
        seen = follow(design, [0.0, other], [0.0, 0.0], begin, impacts=3)
        assert [event.kind for event in seen.events[:3]] == ["stick", "release", "impact"]
        after.append([(event.time, event.velocity) for event in seen.events[1:3]])
    assert abs(after[0][0][0] - after[1][0][0]) > 1e-2  # released at different times
    assert abs(after[0][1][1] - after[1][1][1]) > 1e-2  # and back with different velocities


def test_a_stick_of_one_mass_has_no_memory():
    ends = []
    for speed in (0.5, 1.5):
        design = as_system(vi.ImpactOscillator(omega=0.1, restitution=0.3, gap=0.0, damping=0.1))
        seen = follow(design, [-0.3], [speed], 0.0, impacts=100, most_periods=2)
        releases = [event for event in seen.events if event.kind == "release"]
        ends.append((releases[0].phase, seen.end.displacement[0], seen.end.velocity[0]))
    assert ends[0] == pytest.approx(ends[1], rel=1e-12)


@pytest.mark.parametrize("cut", [1e-6, 1e-9, 1e-12])
def test_the_end_of_a_chatter_does_not_depend_on_its_cut(cut):
    design = system(
        [[1.0, 0.2], [0.2, 2.0]], 0.05 * np.eye(2), [[2.0, -0.5], [-0.5, 1.0]], 0.2, [stop([1, 0.3], 0.0, 0.5)],
        {1: [2.0, 0.5]},
    )  # fmt: skip

    def first(kind, cut):
        seen = follow(design, [-0.5, 0.1], [0.0, 0.0], 0.0, cut=cut, impacts=200, most_periods=1)
        return next(event.time for event in seen.events if event.kind == kind)

    assert first("stick", cut) == pytest.approx(first("stick", 1e-13), abs=max(0.1 * cut**2, 1e-13))
    assert first("release", cut) == pytest.approx(first("release", 1e-13), abs=max(10 * cut**2, 1e-12))


# Identities


@cache
def others():
    """Return random systems, sticking among them, with a start, and how an error of 1e-9 of it grows by each event."""
    rng, found = np.random.default_rng(7), []
    for k in range(12):
        n, s, start = 1 + k % 4, 1 + k % 3, None
        while start is None:
            design = random_system(rng, n, s, restitution=(None, 0.2, 0.0)[k % 3], free=k % 4 == 3)
            start = hitting(design, rng, tries=5)
        q, dq, _ = start
        seen, near = (follow(design, q, dq * factor, impacts=12, most_periods=20) for factor in (1.0, 1.0 + 1e-9))
        known = min(len(seen.events), len(near.events))
        apart = np.abs(listed(seen)[:known] - listed(near)[:known]).max(axis=1) / 1e-9
        sure = [a.kind == b.kind and a.stop == b.stop for a, b in zip(seen.events, near.events, strict=False)]
        known = sure.index(False) if False in sure else known
        growth = np.maximum.accumulate(apart[:known]).clip(1.0)
        found.append((design, q, dq, seen, growth))
    return found


def listed(seen):
    return np.array([(event.time, event.velocity) for event in seen.events]).reshape(-1, 2)


def assert_same(first, second, growth, units=(1.0, 1.0), stops=None):
    """Two motions have the same events: kinds and stops; times and velocities, as far as errors have not grown."""
    known = len(growth)
    number = (lambda j: j) if stops is None else (lambda j: stops[j])
    assert [(e.kind, number(e.stop)) for e in first.events[:known]] == [(e.kind, e.stop) for e in second.events[:known]]
    wrong = np.abs(listed(first)[:known] * np.array(units) - listed(second)[:known])
    assert (wrong <= 1e-12 * np.array(units) * growth[:, None]).all()


def changed(design, **parts):
    return LinearSystem(**{**vars(design), **parts})


def test_the_order_of_coordinates_and_stops_changes_nothing():
    rng = np.random.default_rng(8)
    for design, q, dq, seen, growth in others():
        order, ranks = rng.permutation(len(q)), rng.permutation(len(design.stops))
        square = np.ix_(order, order)
        stops = [design.stops[j] for j in ranks]
        permuted = changed(
            design, mass=design.mass[square], damping=design.damping[square], stiffness=design.stiffness[square],
            constant=design.constant[order], harmonics={h: p[order] for h, p in design.harmonics.items()},
            stops=tuple(stop(s.direction[order], s.gap, s.restitution, s.motion) for s in stops),
        )  # fmt: skip
        again = follow(permuted, q[order], dq[order], impacts=12, most_periods=20)
        assert_same(seen, again, growth, stops=list(np.argsort(ranks)))


def test_mirrored_coordinates_change_nothing():
    for design, q, dq, seen, growth in others():
        mirror = np.where(np.arange(len(q)) % 2, 1.0, -1.0)
        square = np.outer(mirror, mirror)
        mirrored = changed(
            design, mass=design.mass * square, damping=design.damping * square, stiffness=design.stiffness * square,
            constant=design.constant * mirror, harmonics={h: p * mirror for h, p in design.harmonics.items()},
            stops=tuple(stop(s.direction * mirror, s.gap, s.restitution, s.motion) for s in design.stops),
        )  # fmt: skip
        assert_same(seen, follow(mirrored, q * mirror, dq * mirror, impacts=12, most_periods=20), growth)


def test_a_mode_that_is_not_coupled_changes_nothing():
    for design, q, dq, seen, growth in others():
        wider = changed(
            design, mass=block_diag(design.mass, 3.0), damping=block_diag(design.damping, 0.1),
            stiffness=block_diag(design.stiffness, 20.0), constant=np.append(design.constant, 1.0),
            harmonics={h: np.append(p, 2.0) for h, p in design.harmonics.items()},
            stops=tuple(stop(np.append(s.direction, 0.0), s.gap, s.restitution, s.motion) for s in design.stops),
        )  # fmt: skip
        assert_same(seen, follow(wider, np.append(q, 0.5), np.append(dq, 1.0), impacts=12, most_periods=20), growth)


def test_units_change_nothing():
    for design, q, dq, seen, growth in others():
        mass, length, time = 2.0**7, 2.0**-11, 2.0**-5
        force = mass * length / time**2
        scaled = changed(
            design, mass=design.mass * mass, damping=design.damping * mass / time, omega=design.omega / time,
            stiffness=design.stiffness * mass / time**2, constant=design.constant * force,
            harmonics={h: p * force for h, p in design.harmonics.items()},
            stops=tuple(
                stop(s.direction, s.gap * length, s.restitution, {h: d * length for h, d in s.motion.items()})
                for s in design.stops
            ),
        )  # fmt: skip
        again = follow(scaled, q * length, dq * length / time, impacts=12, most_periods=20)
        assert_same(seen, again, growth, units=(time, length / time))


def test_a_shift_of_time_by_a_period_changes_nothing():
    for design, q, dq, seen, growth in others():
        period = 2 * math.pi / design.omega
        again = follow(design, q, dq, 3 * period, impacts=12, most_periods=20)
        moved = listed(again)[: len(growth)] - [3 * period, 0.0]
        assert (np.abs(moved - listed(seen)[: len(growth)]) <= 1e-12 * growth[:, None]).all()


# Hard cases


def test_simultaneous_impacts_are_flagged_and_have_no_order():
    # Two equal masses that a spring couples fall on two equal stops at the same instant.
    stops = [stop([1, 0], 1.0, 0.5), stop([0, 1], 1.0, 0.5), stop([-1, 0], 9.0, 0.5)]
    design = system(np.eye(2), np.zeros((2, 2)), [[3.0, -1.0], [-1.0, 3.0]], 1.0, stops, {1: [2.0, 2.0]})
    seen = follow(design, [0.0, 0.0], [0.3, 0.3], impacts=6)
    assert [event.stop for event in seen.impacts] == [0, 1] * 3
    assert all(event.simultaneous for event in seen.impacts)
    for first, second in zip(seen.impacts[::2], seen.impacts[1::2], strict=True):
        assert (first.time, first.impulse) == (second.time, pytest.approx(second.impulse, rel=1e-12))
    alone = follow(system(1, 0, 2, 1.0, [stop([1], 1.0, 0.5)], {1: [2.0]}), [0.0], [0.3], impacts=3)
    assert listed(alone) == pytest.approx(listed(seen)[::2], rel=1e-11)


def test_a_system_at_rest_never_moves():
    design = system(np.eye(2), np.zeros((2, 2)), CHAIN[:2, :2], 1.0, [stop([1, 0], 0.0, 0.5), stop([0, 1], 1.0, 0.5)])
    seen = follow(design, [0.0, 0.0], [0.0, 0.0], most_periods=5)
    assert (seen.impacts, seen.ended) == ((), "time")
    assert np.abs(seen.end.displacement).max() == np.abs(seen.end.velocity).max() == 0.0


def test_a_mass_that_drifts_away_never_hits_again():
    design = system(1, 0, 0, 1.0, [stop([1], 1.0, 0.5)])
    seen = follow(design, [0.0], [2.0], most_periods=20)
    assert [(event.time, event.velocity) for event in seen.events] == [pytest.approx((0.5, 2.0), rel=1e-14)]
    assert seen.end.displacement == pytest.approx([1.0 - (40 * math.pi - 0.5)], rel=1e-13)


def test_an_undamped_mode_at_resonance_grows_until_it_hits():
    # q'' + q = sin t from rest: q = (sin t - t cos t)/2 reaches 10 for the first time in the period before t = 22.
    design = system(1, 0, 1, 1.0, [stop([1], 10.0, 1.0)], {1: [1.0]})
    hit = follow(design, [0.0], [0.0], impacts=1).impacts[0]
    assert (math.sin(hit.time) - hit.time * math.cos(hit.time)) / 2 == pytest.approx(10.0, rel=1e-13)
    assert hit.velocity == pytest.approx(hit.time * math.sin(hit.time) / 2, rel=1e-12)
    assert 20 < hit.time < 22


def test_a_moving_stop_takes_a_resting_mass_along_and_throws_it():
    # A table of amplitude 1 lets go where its acceleration downwards is that of gravity: sin wt = 1/Gamma.
    gravity, gamma = 9.81, 2.0
    w = math.sqrt(gamma * gravity)
    design = system(1, 0, 0, w, [stop([-1], 0.0, 0.3, {1: -1.0})], constant=[-gravity])
    seen = follow(design, [0.0], [w], impacts=1)
    assert [(event.kind, event.stop) for event in seen.events[:2]] == [("stick", 0), ("release", 0)]
    assert seen.events[1].time == pytest.approx(math.asin(1 / gamma) / w, rel=1e-13)
    (q,), (dq,) = (part[0] for part in seen.at([0.9 * seen.events[1].time]))
    assert (q, dq) == pytest.approx((math.sin(0.9 * math.asin(0.5)), w * math.cos(0.9 * math.asin(0.5))), rel=1e-12)


def test_parallel_stops_share_a_contact():
    twice = [stop([1], 0.0, 0.4), stop([2], 0.0, 0.4)]
    one, two = (system(1, 0.1, 1, 0.3, stops, {1: [1.0]}) for stops in (twice[:1], twice))
    first, second = (follow(design, [-1.0], [0.0], impacts=12, most_periods=5) for design in (one, two))
    times = sorted({event.time for event in second.impacts})
    assert [event.time for event in first.impacts[: len(times)]] == pytest.approx(times, rel=1e-12)


def test_a_mass_that_is_pressed_into_a_corner_comes_to_rest_there_and_keeps_what_lies_along_it():
    # It knocks between the two stops faster and faster, at last several times within rounding of one instant.
    mass = np.array([[2.0, 0.5, 0.3], [0.5, 1.0, -0.2], [0.3, -0.2, 1.5]])
    first, second = np.array([1.0, 0.2, 0.1]), np.array([-0.9, 0.4, 0.3])
    along = np.cross(first, second)
    stops = [stop(first, 0.3, 0.5), stop(second, 0.2, 0.5)]
    design = system(mass, np.zeros((3, 3)), np.zeros((3, 3)), 1.0, stops, constant=4.0 * first + 5.0 * second)
    begin = np.array([1.0, -0.5, 2.0])
    seen = follow(design, np.zeros(3), begin, impacts=1000, most_periods=1)
    assert seen.closed == (0, 1)
    assert sorted(event.stop for event in seen.events if event.kind == "stick") == [0, 1]
    assert along @ mass @ seen.end.velocity == pytest.approx(along @ mass @ begin, rel=1e-12)
    assert np.abs([first @ seen.end.velocity, second @ seen.end.velocity]).max() < 1e-13


def test_stops_that_squeeze_a_mass_are_refused():
    # A moving stop presses the mass against one that stands.
    design = system(1, 0, 0, 1.0, [stop([1], 1.0, 0.0), stop([-1], 0.0, 0.0, {1: -2.0})], constant=[-9.0])
    with pytest.raises(ValueError, match="no velocity leaves"):
        follow(design, [0.5], [0.0])


def test_a_start_beyond_a_stop_is_refused():
    with pytest.raises(ValueError, match="beyond a stop"):
        follow(TWO_SIDED, [0.6], [0.0])


def test_an_elastic_bar_leaves_a_rigid_stop_with_most_of_its_speed():
    # r = 0 at the end node: the waves give the speed back after 2 L sqrt(rho/E), all of it with infinitely many nodes.
    young, density, speed, nodes = 210e9, 7800.0, 0.1, 25
    cell = 1.0 / nodes
    mass = density * cell * np.diag([0.5] + [1.0] * (nodes - 1) + [0.5])
    stiffness = (
        young / cell * (np.diag([1.0] + [2.0] * (nodes - 1) + [1.0]) - np.eye(nodes + 1, k=1) - np.eye(nodes + 1, k=-1))
    )
    end = np.eye(nodes + 1)[-1]
    design = system(mass, 0 * mass, stiffness, 2 * math.pi / 1.2e-3, [stop(end, 5e-5, 0.0)])
    seen = follow(design, np.zeros(nodes + 1), np.full(nodes + 1, speed), impacts=100, most_periods=1)
    assert seen.impacts[0].time == pytest.approx(5e-4, rel=1e-12)
    left = max(event.time for event in seen.events if event.kind == "release")
    assert left - 5e-4 == pytest.approx(2 * math.sqrt(density / young), rel=0.1)
    assert np.diag(mass) @ seen.end.velocity / density == pytest.approx(-speed, rel=0.05)
