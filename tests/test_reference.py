"""The independent witness against 50-digit values, closed forms, and what decides the hard cases."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import vibroimpact as vi
from cells import make_cells
from vibroimpact.backends import ImpactWindow, Measurement, StroboscopicWindow, get_backend
from vibroimpact.backends.reference.flight import FreeMotion, State
from vibroimpact.backends.reference.motion import fly
from vibroimpact.options import Tolerances

REFERENCE = get_backend("reference")


def watch(osc, window, start=None, **tolerances):
    (seen,) = REFERENCE.samples(make_cells(osc, start), Measurement(window, Tolerances(**tolerances)))
    return seen


def times(seen, osc):
    return (seen.impact_periods + seen.impact_phase) * osc.period


def free_motion(**changes):
    defaults = {"mass": 1.0, "damping": 0.01, "stiffness": 1.0, "amplitude": 1.0, "omega": 2.0, "gap": 0.0}
    return FreeMotion(**(defaults | changes))


@pytest.mark.parametrize("name", ["under", "critical", "over", "resonant_c0", "near_resonant", "stiff"])
def test_free_flight_to_rounding_at_any_damping_and_at_resonance(values, name):
    flow = values["flow_values"][name]
    m, c, k, f, w = map(float, flow["m_c_k_f_w"])
    y, v = map(float, flow["y_v"])
    free = free_motion(mass=m, damping=c, stiffness=k, amplitude=f, omega=w, gap=0.5)
    clearance, velocity = free.after(State(0.8, 0.4, 0.0, 0.2 * w / (2 * math.pi)), np.array([1.7]))
    assert 0.5 - clearance[0] == pytest.approx(y, abs=1e-14)
    assert velocity[0] == pytest.approx(v, abs=1e-14 * math.sqrt(k / m) + 1e-14)


@pytest.mark.parametrize("tau", [1e-12, 1e-6, 1e-2])
def test_short_flights_keep_the_relative_accuracy_of_every_part(tau):
    grown = free_motion().propagators([tau])[0]
    # u from u', from the force and from its rate: tau, -tau^2/2, -tau^3/6, next order relative 0.01 tau or less.
    parts = grown[0, 1] / tau, -2 * grown[0, 2] / tau**2, -6 * grown[0, 3] / tau**3
    assert parts == pytest.approx([1, 1, 1], rel=1e-15 + 0.005 * tau + tau**2)


@pytest.mark.parametrize(
    ("name", "omega", "start"),
    [("w=2.8,y-1", 2.8, vi.State(-1.0)), ("w=0.9,liftoff", 0.9, None), ("w=0.9,liftoff", 0.9, "at the release")],
)
def test_first_20_impacts_to_13_digits(values, name, omega, start):
    known = values["first_20_impacts"][name]
    osc = vi.ImpactOscillator(omega=omega)
    start = vi.State(0.0, 0.0, math.pi / omega) if start == "at the release" else start
    seen = watch(osc, ImpactWindow(0, 20), start)
    growth = max(1.0, float(known["linear_error_amplification"]))
    assert seen.impact_velocity == pytest.approx([float(i["v"]) for i in known["impacts"]], abs=1e-13 * growth)
    assert times(seen, osc) == pytest.approx([float(i["t"]) for i in known["impacts"]], abs=1e-13 * growth)


@pytest.mark.parametrize("name", ["w=2.0,n=1", "w=1.4,n=1", "w=2.6,n=1"])
def test_a_stable_period_1_orbit_is_kept_for_hundreds_of_impacts(values, name):
    known = values["period_n_impact_1"][name]
    v, phase = float(known["v"]), float(known["phase_frac"])
    osc = vi.ImpactOscillator(omega=float(name.split(",")[0][2:]))
    seen = watch(osc, ImpactWindow(300, 20), vi.State(0.0, v, phase * osc.period))
    assert seen.impact_velocity == pytest.approx([v] * 20, rel=1e-13)
    assert seen.impact_phase == pytest.approx([phase] * 20, abs=1e-13)


def test_period_1_impact_2_from_rest_settles_on_its_two_impacts(values):
    known = values["period_1_impact_2"]["w=0.95"]
    seen = watch(vi.ImpactOscillator(omega=0.95), ImpactWindow(300, 20))
    assert sorted(seen.impact_velocity) == pytest.approx(
        [float(known["v_b"])] * 10 + [float(known["v_a"])] * 10, rel=1e-13
    )


def test_complete_chatter_impact_by_impact(values):
    known = values["sticking_w=0.1"]["impacts"]
    osc = vi.ImpactOscillator(omega=0.1)
    seen = watch(osc, ImpactWindow(0, len(known)))
    assert seen.impact_velocity == pytest.approx([float(i["v"]) for i in known], abs=1e-13)
    assert times(seen, osc) == pytest.approx([float(i["t_minus_liftoff"]) + math.pi / 0.1 for i in known], rel=1e-14)


@pytest.mark.parametrize("cut", [1e-9, 1e-7, 1e-4])
def test_the_end_of_a_chatter_is_the_same_wherever_it_is_cut(values, cut):
    known = float(values["sticking_w=0.1"]["accumulation_phase_frac"])
    seen = watch(vi.ImpactOscillator(omega=0.1), ImpactWindow(0, 150), chatter=cut)
    assert seen.stick_phase == pytest.approx([known] * len(seen.stick_phase), abs=1e-13)
    assert seen.release_phase == pytest.approx([0.5] * len(seen.stick_phase), abs=0)
    assert vi.Status(seen.status) in (vi.Status.STICKING, vi.Status.SHORT_WINDOW)


def test_unforced_chatter_ends_as_the_sum_of_its_flights_and_stays():
    osc = vi.ImpactOscillator(amplitude=0.0, damping=0.0, gap=-1.0, omega=1.0)
    seen = watch(osc, ImpactWindow(0, 1000), vi.State(-1.0, 1.0))
    end = 2 * math.fsum(math.atan(0.8**j) for j in range(1, 400))
    assert (seen.stick_periods + seen.stick_phase) * osc.period == pytest.approx([end], rel=1e-14)
    assert np.isnan(seen.release_phase).all()
    assert seen.impact_velocity == pytest.approx(0.8 ** np.arange(len(seen.impact_velocity)), rel=1e-13)
    assert vi.Status(seen.status) == vi.Status.STUCK_FOREVER


def closed_form_orbit(osc, n):
    """Return velocity and phase of the period-n impact-1 orbit that exists alone at g = 0."""
    half, time = osc.damping / (2 * osc.mass), n * osc.period
    stiff = osc.stiffness / osc.mass
    flow = free_motion(mass=osc.mass, damping=osc.damping, stiffness=osc.stiffness, amplitude=0.0, omega=osc.omega)
    p, q = flow.propagators([time])[0][0, :2]
    if half**2 > stiff:
        l1, l2 = (half + s * math.sqrt(half**2 - stiff) for s in (-1, 1))
        delta = (1 - math.exp(-l1 * time)) * (1 - math.exp(-l2 * time))
    else:
        decay, wd = math.exp(-half * time), math.sqrt(stiff - half**2)
        delta = 1 - 2 * decay * math.cos(wd * time) + decay**2
    alpha = (1 + osc.restitution) * q / delta
    beta = -osc.restitution - (1 + osc.restitution) * (p - 1) / delta
    inertia, damper = osc.stiffness - osc.mass * osc.omega**2, osc.damping * osc.omega
    reach = osc.amplitude / math.hypot(inertia, damper)
    v = reach / math.hypot(alpha, beta / osc.omega)
    # alpha v = R sin(wt - lag), beta v = w R cos(wt - lag)
    turn = math.atan2(alpha * v, beta * v / osc.omega) + math.atan2(damper, inertia)
    return v, turn / (2 * math.pi) % 1.0


@pytest.mark.parametrize(
    ("changes", "n"),
    [
        ({"omega": 1.7}, 1),
        ({"omega": 4.1}, 2),
        ({"omega": 2.0, "damping": 2.0}, 1),
        ({"omega": 2.3, "damping": 5.0}, 1),
        ({"omega": 1.3, "damping": 0.0}, 1),
        ({"omega": 7.4, "mass": 2.0, "stiffness": 3.0, "restitution": 0.5}, 3),
    ],
)
def test_a_period_n_impact_1_orbit_returns_as_its_closed_form_says(changes, n):
    osc = vi.ImpactOscillator(**changes)
    v, phase = closed_form_orbit(osc, n)
    seen = watch(osc, ImpactWindow(0, 2), vi.State(0.0, v, phase * osc.period))
    assert seen.impact_velocity == pytest.approx([v, v], rel=1e-12)
    assert seen.impact_phase == pytest.approx([phase, phase], abs=1e-12)
    assert np.diff(seen.impact_periods) == n


def first_peak(free, start):
    """Return when the free motion first turns back, and the clearance there."""
    grid = np.linspace(0.0, 8 * free.period, 16000)[1:]
    _, velocity = free.after(start, grid)
    i = int(np.flatnonzero((velocity[:-1] > 0) & (velocity[1:] <= 0))[0])
    low, high = grid[i], grid[i + 1]
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if free.after(start, np.array([middle]))[1] > 0 else (low, middle)
    return low, float(free.after(start, np.array([low]))[0][0])


@pytest.mark.long(but=4)
@pytest.mark.parametrize("margin", [1e-6, 1e-8, 1e-10, 1e-12])
@pytest.mark.parametrize("case", range(12))
def test_a_graze_is_seen_where_it_touches_and_only_there(margin, case):
    draw = np.random.default_rng(case)
    changes = {"damping": 10 ** draw.uniform(-3, 0.8), "omega": 10 ** draw.uniform(-0.7, 0.7), "gap": 1.0}
    start = State(3.0, draw.uniform(-2, 2), 0.0, draw.uniform())
    time, nearest = first_peak(free_motion(**changes), start)
    for sign in (1, -1):
        # The same y(t) in front of a stop that its first peak reaches by, or misses by, the margin.
        shift = nearest + sign * margin
        free = free_motion(**(changes | {"gap": 1.0 - shift}))
        state = State(3.0 - shift, start.velocity, start.periods, start.phase)
        elapsed, piece = 0.0, fly(free, state)
        while piece.speed is None and elapsed + piece.duration < time:
            elapsed, piece = elapsed + piece.duration, fly(free, piece.end)
        touched = piece.speed is not None and elapsed + piece.duration < time + 1e-2
        assert touched == (sign > 0)


def test_no_look_ever_lies_beyond_the_stop():
    draw = np.random.default_rng(3)
    for _ in range(25):
        osc = vi.ImpactOscillator(
            damping=10 ** draw.uniform(-3, 0.8),
            omega=10 ** draw.uniform(-1, 1),
            restitution=draw.uniform(0, 0.95),
            gap=draw.uniform(-0.9, 1.2),
        )
        seen = watch(osc, StroboscopicWindow(0, 400, None, 100))
        assert (seen.look_displacement <= osc.gap).all()
        assert len(seen.look_displacement) == 400


def test_impacts_agree_with_a_ready_made_integrator_away_from_sticking():
    osc = vi.ImpactOscillator(omega=1.7, damping=0.3, gap=0.4)

    def contact(t, y):
        return osc.gap - y[0]

    contact.terminal, contact.direction = True, -1
    t, y, found = 0.0, np.array([0.0, 0.0]), []
    while len(found) < 6:
        run = solve_ivp(
            lambda t, y: [y[1], math.sin(1.7 * t) - 0.3 * y[1] - y[0]],
            (t, t + 100), y, "DOP853", events=contact, rtol=1e-12, atol=1e-13, max_step=0.2,
        )  # fmt: skip
        t, y = run.t[-1], np.array([osc.gap, -0.8 * run.y[1, -1]])
        found.append((t, run.y[1, -1]))
    seen = watch(osc, ImpactWindow(0, 6))
    assert np.column_stack([times(seen, osc), seen.impact_velocity]) == pytest.approx(np.array(found), abs=1e-9)


def test_a_start_whole_periods_later_gives_the_same_motion_bit_for_bit():
    osc = vi.ImpactOscillator(omega=2 * math.pi * 0.45)
    late = REFERENCE.samples(make_cells(osc, vi.State(-1.0)), Measurement(ImpactWindow(5, 30)))[0]
    cells = make_cells(osc, vi.State(-1.0)).replace(periods=1e6)
    later = REFERENCE.samples(cells, Measurement(ImpactWindow(5, 30)))[0]
    assert (later.impact_velocity == late.impact_velocity).all()
    assert (later.impact_phase == late.impact_phase).all()
    assert (later.impact_periods == late.impact_periods + 1e6).all()


def test_after_its_release_the_mass_leaves_with_the_third_derivative():
    osc = vi.ImpactOscillator(omega=0.7, gap=0.3)
    seen = watch(osc, StroboscopicWindow(0, 20000, 0.0, 20000), vi.State(0.3, 0.0, 0.2 * osc.period))
    since = ((seen.look_periods + seen.look_phase) - (seen.release_periods[0] + seen.release_phase[0])) * osc.period
    soon = (since > 0) & (since < 0.02)
    jerk = osc.omega * math.sqrt(1 - 0.3**2)
    assert seen.release_phase[0] == pytest.approx(0.5 - math.asin(0.3) / (2 * math.pi), abs=1e-15)
    assert osc.gap - seen.look_displacement[soon] == pytest.approx(jerk * since[soon] ** 3 / 6, rel=0.01, abs=1e-15)


ENDINGS = [
    ("kg below -f: pressed for ever", {"gap": -2.0}, None, "stuck_forever"),
    ("kg equal -f: pressed for ever", {"gap": -1.0}, None, "stuck_forever"),
    ("kg equal f from the stop: leaves by its fourth derivative", {"gap": 1.0, "omega": 0.9}, (1.0, 0.0), "ok"),
    ("stop out of reach", {"gap": 5.0, "omega": 3.0}, None, "no_impact"),
    ("settles clear of the stop", {"gap": 1.0, "omega": 3.0}, (-2.0, 0.0), "stopped_impacting"),
    ("no force, no gap, at rest", {"amplitude": 0.0}, None, "stuck_forever"),
    ("no force, no gap, moving", {"amplitude": 0.0, "restitution": 0.2}, (-1.0, 0.0), "decaying"),
    ("no force, no gap, creeping back", {"amplitude": 0.0, "damping": 5.0}, (-1.0, 0.0), "no_impact"),
    ("no force, no gap, no rebound", {"amplitude": 0.0, "restitution": 0.0}, (-1.0, 0.0), "stuck_forever"),
    ("no force, preload", {"amplitude": 0.0, "gap": -1.0, "restitution": 0.5}, (-2.0, 0.0), "stuck_forever"),
    ("no force, gap, losses only at the stop", {"amplitude": 0.0, "gap": 1.0, "damping": 0.0, "restitution": 0.5},
     (-2.0, 0.0), "decaying or stopped_impacting"),
    ("no damping, beats below the stop", {"damping": 0.0, "gap": 3.0, "omega": 3.0}, (-2.9, 0.0), "budget"),
    ("r = 0", {"restitution": 0.0}, None, "sticking"),
    ("r = 1", {"restitution": 1.0, "omega": 2.7}, None, "ok"),
    ("r = 1, c = 0, w = 2 w_n", {"restitution": 1.0, "damping": 0.0}, None, "ok"),
    ("c = 0, w = w_n", {"damping": 0.0, "omega": 1.0}, None, "ok"),
    ("w = w_n/100", {"omega": 0.01}, None, "short_window"),
    ("w = 100 w_n", {"omega": 100.0}, None, "ok"),
]  # fmt: skip


@pytest.mark.parametrize(("case", "changes", "start", "word"), ENDINGS, ids=[ending[0] for ending in ENDINGS])
def test_each_motion_ends_with_its_status(case, changes, start, word):
    osc = vi.ImpactOscillator(**changes)
    start = vi.State(*start) if start else None
    # 20 natural periods of flight suffice to tell a flight without end here.
    seen = watch(osc, ImpactWindow(5, 40), start, flight_periods=20.0)
    assert vi.Status(seen.status).word in word.split(" or ")
    assert (seen.impact_velocity > 0).all()


def test_without_rebound_every_recorded_impact_rests_or_leaves_with_no_velocity():
    osc = vi.ImpactOscillator(restitution=0.0, omega=0.5, gap=0.2)
    seen = watch(osc, ImpactWindow(0, 20))
    rests = set(zip(seen.stick_periods, seen.stick_phase, strict=True))
    pressed = np.sin(2 * math.pi * seen.impact_phase) > osc.gap
    contacts = list(zip(seen.impact_periods, seen.impact_phase, strict=True))
    assert rests == {at for at, presses in zip(contacts[:-1], pressed, strict=False) if presses}
    assert 0 < len(rests) < 20


def test_impacts_below_the_cut_are_rebounded_but_not_counted():
    osc = vi.ImpactOscillator(amplitude=0.0, gap=0.5, damping=0.0, restitution=0.1)
    seen = watch(osc, ImpactWindow(0, 100), vi.State(-1.0), chatter=1e-3)
    speeds = math.sqrt(1 - 0.25) * 0.1 ** np.arange(4)
    assert seen.impact_velocity == pytest.approx(speeds[speeds > 0.5e-3], rel=1e-12)


def test_indices_are_those_of_the_kept_impacts():
    osc = vi.ImpactOscillator(omega=0.95)
    cells = make_cells(osc, None, {"gap": np.array([0.0, 50.0])})
    table = REFERENCE.indices(cells, Measurement(ImpactWindow(200, 100)))
    seen = watch(osc, ImpactWindow(200, 100))
    span = (times(seen, osc)[-1] - times(seen, osc)[0]) / osc.period
    assert table["std"][0] == pytest.approx(np.std(seen.impact_velocity), rel=1e-12)
    assert table["mean_velocity"][0] == pytest.approx(seen.impact_velocity.mean(), rel=1e-14)
    assert table["max_velocity"][0] == seen.impact_velocity.max()
    assert table["impacts_per_period"][0] == pytest.approx(99 / span, rel=1e-12)
    assert table["impacts"].tolist() == [300, 0]
    assert np.isnan([table[name][1] for name in ("std", "mean_velocity", "max_velocity", "impacts_per_period")]).all()


def test_one_kept_impact_has_no_rate():
    table = REFERENCE.indices(make_cells(vi.ImpactOscillator(), None), Measurement(ImpactWindow(10, 1)))
    assert table["std"][0] == 0.0
    assert np.isnan(table["impacts_per_period"][0])
    assert vi.Status(table["status"][0]) == vi.Status.SHORT_WINDOW


def test_a_window_carries_on_where_the_one_before_it_ended():
    osc = vi.ImpactOscillator(omega=2.8)
    whole = watch(osc, ImpactWindow(0, 12))
    first = watch(osc, ImpactWindow(0, 5))
    names = ("clearance", "velocity", "periods", "phase")
    cells = make_cells(osc, None).replace(**{name: getattr(first, f"last_{name}") for name in names})
    (rest,) = REFERENCE.samples(cells, Measurement(ImpactWindow(0, 7)))
    assert (rest.impact_velocity == whole.impact_velocity[5:]).all()
