"""Orbits that rest at the stop, and the end of sticking, where their chatter's end meets the release."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from designs import RESTS
from vibroimpact.coexistence.measuring import AT_REST, Runner, cells_of
from vibroimpact.orbits.sticking import closes, find_sticking_orbit, from_release
from vibroimpact.orbits.sticking_end import scaling_exponent

# The end of sticking of the default oscillator, by bisection with closed-form flights in 45 digits.
END = 0.34718041326569632613
HALF_GAP = {"gap": 0.2, "omega": 0.15}
OSCILLATORS = [
    {"omega": 0.1},
    {"omega": 0.05, "damping": 0.3},
    HALF_GAP,
    {"gap": -0.5, "omega": 0.3, "amplitude": 0.8},
    {"omega": 0.2, "restitution": 0.3, "mass": 1.7, "stiffness": 2.3},
    {"omega": 3.005},  # period 2
    {"omega": 2.8625},  # period 7
]


def orbit_of(**numbers):
    (orbit,) = find_sticking_orbit(vi.ImpactOscillator(**numbers))
    return orbit


def stuck_fraction(**numbers):
    orbit = orbit_of(**numbers)
    return orbit.stuck_time / orbit.oscillator.period


def test_the_sticking_orbit_at_w_01_to_fifty_digit_values(values):
    known = values["sticking_w=0.1"]
    orbit = orbit_of(omega=0.1)
    assert orbit.stick_phase == pytest.approx(float(known["accumulation_phase_frac"]), abs=1e-15)
    assert orbit.stuck_time == pytest.approx(float(known["stuck_duration"]), rel=1e-14)
    assert orbit.release_phase == float(known["lift_off_phase_frac"])
    assert max(orbit.velocities) == pytest.approx(float(known["max_v"]), rel=1e-14)
    assert orbit.velocities[:40] == pytest.approx([float(hit["v"]) for hit in known["impacts"]], rel=1e-11)
    assert orbit.phases[:40] == pytest.approx([float(hit["phase_frac"]) for hit in known["impacts"]], abs=1e-14)


def test_a_chatter_is_infinitely_many_impacts_and_erases_memory():
    orbit = orbit_of(omega=0.1)
    assert (orbit.n_periods, orbit.n_impacts) == (1, -1)
    assert orbit.multipliers == (0j, 0j)
    assert orbit.stable
    assert orbit.admissible
    assert orbit.lyapunov == -math.inf


@pytest.mark.parametrize("numbers", OSCILLATORS)
def test_the_mass_is_let_go_where_the_force_falls_through_the_preload(numbers):
    orbit = orbit_of(**numbers)
    osc = orbit.oscillator
    angle = math.pi - math.asin(osc.stiffness * osc.gap / osc.amplitude)
    assert orbit.release_phase == pytest.approx(angle / (2 * math.pi), abs=1e-15)


@pytest.mark.parametrize("numbers", OSCILLATORS)
def test_time_at_rest_is_the_wait_from_the_chatters_end_to_the_release(numbers):
    orbit = orbit_of(**numbers)
    wait = (orbit.release_phase - orbit.stick_phase) % 1.0
    assert orbit.stuck_time == pytest.approx(wait * orbit.oscillator.period, rel=1e-13)
    pressing = orbit.oscillator.amplitude * math.sin(2 * math.pi * orbit.stick_phase)
    assert pressing > orbit.oscillator.stiffness * orbit.oscillator.gap


@pytest.mark.parametrize("numbers", OSCILLATORS)
def test_started_on_the_orbit_the_mass_leaves_the_stop_and_repeats_it(numbers):
    orbit = orbit_of(**numbers)
    period = orbit.oscillator.period
    count = len(orbit.velocities)
    hits = vi.impact_section(orbit.oscillator, start=orbit.start, transient_impacts=0, sample_impacts=2 * count)
    assert hits["velocity"].values[:count] == pytest.approx(orbit.velocities, rel=1e-9, abs=1e-13)
    assert hits["stick_time"].values[0] / period % 1 == pytest.approx(orbit.stick_phase, abs=1e-12)
    assert hits["release_time"].values[0] - orbit.start.time == pytest.approx(orbit.period, rel=1e-12)


@pytest.mark.parametrize("numbers", OSCILLATORS)
def test_a_settled_section_is_recognised_as_the_same_motion(numbers):
    orbit = orbit_of(**numbers)
    transient = 20 * len(orbit.velocities) if numbers["omega"] < 1 else 0
    start = None if numbers["omega"] < 1 else orbit.start
    section = vi.impact_section(orbit.oscillator, start=start, transient_impacts=transient, sample_impacts=1000)
    motion = vi.recognise(section)
    assert (motion.kind, motion.n_periods, motion.n_impacts) == ("sticking", orbit.n_periods, -1)
    assert motion.velocities[0] == pytest.approx(max(orbit.velocities), rel=1e-9)
    assert len(motion.velocities) == len(orbit.velocities)


def test_independent_code_finds_the_same_chatter_and_stick():
    orbit = orbit_of(**HALF_GAP)
    period = orbit.oscillator.period
    hits = vi.impact_section(
        orbit.oscillator, start=orbit.start, transient_impacts=0, sample_impacts=100, backend="reference"
    )
    count = len(orbit.velocities)
    assert hits["velocity"].values[:count] == pytest.approx(orbit.velocities, rel=1e-7, abs=1e-12)
    assert hits["stick_time"].values[0] / period % 1 == pytest.approx(orbit.stick_phase, abs=1e-10)


@pytest.mark.parametrize("factor", [2.0, 0.25])
def test_scaling_a_sticking_orbit_is_exact_bit_for_bit(factor):
    osc = vi.ImpactOscillator(**HALF_GAP)
    (orbit,) = find_sticking_orbit(osc)
    (larger,) = find_sticking_orbit(osc.replace(amplitude=factor, gap=factor * osc.gap))
    assert larger.velocities == tuple(factor * v for v in orbit.velocities)
    assert (larger.phases, larger.stick_phase) == (orbit.phases, orbit.stick_phase)
    (faster,) = find_sticking_orbit(
        osc.replace(mass=osc.mass / factor**2, damping=osc.damping / factor, omega=osc.omega * factor)
    )
    assert faster.velocities == larger.velocities
    assert faster.stuck_time == orbit.stuck_time / factor
    (heavier,) = find_sticking_orbit(
        osc.replace(mass=factor, damping=factor * osc.damping, stiffness=factor, amplitude=factor)
    )
    assert heavier.velocities == orbit.velocities


def test_without_restitution_one_impact_is_enough():
    orbit = orbit_of(omega=0.1, restitution=0.0)
    assert (orbit.n_periods, orbit.n_impacts, len(orbit.velocities)) == (1, 1, 1)
    assert orbit.stick_phase == orbit.phases[0]
    chattering = orbit_of(omega=0.1)
    assert orbit.velocities[0] == pytest.approx(chattering.velocities[0], rel=1e-14)


@pytest.mark.parametrize(
    "numbers",
    [
        {"omega": 2.0},
        {"gap": -1.0},
        {"gap": -3.0, "omega": 0.1},
        {"gap": 1.0, "omega": 0.1},
        {"omega": 0.1, "restitution": 1.0},
        {"amplitude": 0.0},
        {"amplitude": 0.0, "gap": -1.0},
        {"damping": 0.0, "restitution": 1.0},
    ],
)
def test_no_sticking_orbit_where_the_mass_never_rests_or_is_never_let_go(numbers):
    assert find_sticking_orbit(vi.ImpactOscillator(**numbers)) == []


@pytest.mark.parametrize("osc", RESTS.values())
def test_a_rest_that_rounding_repeats_is_no_orbit(osc):
    stick = from_release(osc, 1000)
    assert stick is not None
    assert find_sticking_orbit(osc) == []
    orbits = vi.find_orbit(osc, n_periods=stick.periods, n_impacts=-1)
    assert (orbits, orbits.outcome) == ([], "none")
    assert "rounding decides" in orbits.message


def test_maps_and_orbits_agree_on_which_rests_repeat():
    # 1,500 motions that rest were tried once, 1 in 10 of them irregular: both agreed on each.
    random = np.random.default_rng(21)
    oscillators = [
        vi.ImpactOscillator(
            mass=10 ** random.uniform(-0.5, 0.5),
            damping=10 ** random.uniform(-3.0, -0.5),
            omega=random.uniform(0.3, 5.0),
            restitution=random.uniform(0.3, 0.95),
            gap=random.uniform(-0.9, 0.6),
        )
        for _ in range(400)
    ]
    runner = Runner()
    found = runner.measure(cells_of(oscillators, [AT_REST] * len(oscillators)))
    resting = [(osc, motion) for osc, motion in zip(oscillators, found, strict=True) if motion.kind == "sticking"]
    assert sum(not motion.n_periods for _, motion in resting) >= 10
    for osc, motion in resting:
        if (stick := from_release(osc, 1000)) is not None:
            assert closes(osc, stick) == bool(motion.n_periods)
            if closes(osc, stick):
                assert stick.periods == motion.n_periods


def test_an_orbit_of_another_name_is_not_handed_out():
    osc = vi.ImpactOscillator(omega=3.005)
    assert find_sticking_orbit(osc, n_periods=1) == []
    assert find_sticking_orbit(osc, n_periods=2)[0].name == "period-2 sticking"
    assert find_sticking_orbit(osc, longest=1) == []


def test_only_impacts_above_the_cut_are_listed_and_the_chatters_end_stays():
    osc = vi.ImpactOscillator(omega=0.1)
    (few,) = find_sticking_orbit(osc, tolerances=vi.Tolerances(chatter=1e-3))
    (many,) = find_sticking_orbit(osc)
    assert few.velocities == many.velocities[: len(few.velocities)]
    assert min(few.velocities) >= 1e-3 > many.velocities[len(few.velocities)]
    assert few.stuck_time == many.stuck_time


def test_a_graze_in_the_flight_does_not_end_sticking():
    # Between these frequencies the period-2 cycle loses an impact outside its chatter: it dies weightless.
    def outside(omega):
        orbit = orbit_of(omega=omega)
        return [v for v, phase in zip(orbit.velocities, orbit.phases, strict=True) if phase > 0.5]

    low, high = 3.0003, 3.001
    while (middle := 0.5 * (low + high)) not in (low, high):
        low, high = (middle, high) if outside(middle) else (low, middle)
    assert len(outside(low)) == 1
    assert outside(high) == []
    assert outside(low)[0] < 1e-6
    assert outside(3.0003)[0] > 0.005
    assert stuck_fraction(omega=low) == pytest.approx(stuck_fraction(omega=high), abs=1e-6)
    assert stuck_fraction(omega=low) > 0.2


def test_the_end_of_sticking_of_the_default_oscillator_to_twenty_digits_by_independent_code():
    point = vi.end_of_sticking(vi.ImpactOscillator(), "omega", (0.3, 0.4))
    assert point.found
    assert point.n_periods == 1
    assert point.value == pytest.approx(END, rel=1e-15)
    # The stuck time goes as the distance to the power 0.6: 1e-16 of the frequency leave 5e-10 of the period.
    assert 0.0 <= point.stuck_fraction < 2e-9
    assert point.residual < 1e-14
    assert point.orbit.sticks
    assert find_sticking_orbit(vi.ImpactOscillator(omega=point.value + 1e-15), n_periods=1) == []


def test_the_end_is_the_same_from_either_side_and_in_hertz():
    osc = vi.ImpactOscillator()
    assert vi.end_of_sticking(osc, "omega", (0.36, 0.33)).value == pytest.approx(END, rel=1e-15)
    assert 2 * math.pi * vi.end_of_sticking(osc, "frequency", (0.05, 0.06)).value == pytest.approx(END, rel=1e-14)


def test_the_end_scales_with_mass_and_damping():
    scaled = vi.end_of_sticking(vi.ImpactOscillator(mass=0.25, damping=0.005), "omega", (0.6, 0.8))
    assert scaled.value == pytest.approx(2 * END, rel=1e-14)


@pytest.mark.parametrize("restitution", [0.2, 0.5, 0.8, 0.9])
def test_the_stuck_time_vanishes_with_the_power_that_self_similar_chatter_gives(restitution):
    osc = vi.ImpactOscillator(restitution=restitution)
    end = vi.end_of_sticking(osc, "omega", (0.05, 2.0)).value
    near, far = (stuck_fraction(restitution=restitution, omega=end * (1 - d)) for d in (1e-10, 1e-7))
    assert math.log(far / near) / math.log(1e3) == pytest.approx(scaling_exponent(restitution), abs=0.02)


def test_the_exponent_of_the_stuck_time_runs_from_one_to_three_fifths():
    exponents = [scaling_exponent(r) for r in np.linspace(0.0, 1.0, 101)]
    assert exponents[0] == 1.0
    assert exponents[-1] == pytest.approx(0.6)
    assert (np.diff(exponents) <= 0.0).all()
    assert scaling_exponent(1 - 2e-6) == pytest.approx(0.6, abs=1e-9)


def test_without_restitution_sticking_ends_where_a_flight_lasts_from_release_to_release():
    point = vi.end_of_sticking(vi.ImpactOscillator(restitution=0.0), "omega", (1.0, 2.5))
    w, c = point.value, 0.01
    inertia, damper = 1 - w * w, c * w
    size = 1 / (inertia**2 + damper**2)
    # Steady motion at the release, w t = pi; what is left of rest at the stop decays freely over one period.
    y0, v0 = size * -damper, size * inertia * w
    b, wd = c / 2, math.sqrt(1 - c * c / 4)
    flight = 2 * math.pi / w
    free = math.exp(-b * flight) * (y0 * math.cos(wd * flight) + (v0 + b * y0) / wd * math.sin(wd * flight))
    assert free == pytest.approx(y0, abs=1e-13)
    assert point.stuck_fraction < 1e-14


def test_both_ends_of_a_period_2_window_are_ends_of_sticking():
    osc = vi.ImpactOscillator()
    low, high = (vi.end_of_sticking(osc, "omega", (3.005, away)) for away in (3.0, 3.0125))
    assert low.found
    assert high.found
    assert (low.n_periods, high.n_periods) == (2, 2)
    assert low.value == pytest.approx(3.000065074383, abs=1e-11)
    assert high.value == pytest.approx(3.011663687048, abs=1e-11)
    assert max(low.residual, high.residual) < 1e-10


def test_a_longer_cycle_is_lost_to_the_end_of_a_shorter_one():
    # Period 6 at w = 3 gives way to period 2: the boundary found is where the chatter of period 2 is just complete.
    point = vi.end_of_sticking(vi.ImpactOscillator(), "omega", (3.0, 3.005))
    assert point.n_periods == 2
    assert point.found


@pytest.mark.parametrize(
    ("numbers", "parameter", "between"),
    [
        ({"omega": 0.3}, "mass", (1.0, 2.0)),
        ({"omega": 0.3}, "restitution", (0.8, 0.95)),
        ({"omega": 0.1}, "gap", (0.0, 1.1)),
        ({"omega": 0.3, "gap": 0.05}, "amplitude", (1.0, 0.01)),
        ({"omega": 0.34}, "stiffness", (1.0, 0.5)),
        ({"gap": 0.6}, "omega", (0.18, 0.17)),
        ({"gap": 0.6}, "omega", (0.437, 0.442)),
    ],
)
def test_sticking_ends_in_any_parameter_with_a_vanishing_stuck_time(numbers, parameter, between):
    point = vi.end_of_sticking(vi.ImpactOscillator(**numbers), parameter, between)
    assert point.found
    assert point.stuck_fraction < 1e-8
    assert point.residual < 1e-10
    assert point.oscillator == vi.ImpactOscillator(**numbers).replace(**{parameter: point.value})


def test_a_preload_that_is_never_lifted_is_no_end_of_sticking():
    point = vi.end_of_sticking(vi.ImpactOscillator(omega=0.1), "gap", (0.0, -1.1))
    assert point.outcome == "pressed_for_ever"
    assert point.value == pytest.approx(-1.0, abs=1e-6)
    assert not point.found


@pytest.mark.parametrize("between", [(0.1, 0.2), (1.1, 1.2)])
def test_without_a_change_between_no_end_is_made_up(between):
    point = vi.end_of_sticking(vi.ImpactOscillator(), "omega", between)
    assert point.outcome == "no_change"
    assert "give values with a change" in point.message
    assert math.isnan(point.value)


def test_a_stuck_time_that_jumps_is_never_passed_off_as_the_end_of_sticking():
    # After some fifty chaotic periods neighbouring numbers already come to rest in different periods.
    point = vi.end_of_sticking(vi.ImpactOscillator(), "omega", (2.8644, 2.8645))
    assert point.outcome == "unresolved"
    assert point.stuck_fraction > 1e-3
    assert "amplifies rounding errors" in point.message


@pytest.fixture(scope="module")
def default_end():
    return vi.end_of_sticking(vi.ImpactOscillator(), "omega", (0.3, 0.4))


@pytest.mark.parametrize("order", [1, -1])
def test_without_a_gap_the_end_of_sticking_knows_no_amplitude(default_end, order):
    names, ranges = ("omega", "amplitude")[::order], ((0.2, 0.5), (0.5, 2.0))[::order]
    curve = vi.continue_boundary(default_end, names, ranges, step=0.02)
    omega, amplitude = curve.values.T[::order]
    assert curve.outcome == ("range", "range")
    assert omega == pytest.approx(END, rel=1e-14)
    assert sorted((amplitude[0], amplitude[-1])) == pytest.approx([0.5, 2.0], rel=1e-14)
    assert np.array(curve.touch_phases) == pytest.approx(0.5)


def test_a_curve_that_begins_on_the_edge_of_the_ranges_leads_away_from_it(default_end):
    curve = vi.continue_boundary(default_end, ("omega", "mass"), ((default_end.value, 0.6), (0.5, 2.0)), step=0.02)
    assert curve.outcome == ("range", "range")
    assert curve.values[-1].tolist() == [default_end.value, 1.0]
    assert curve.values[0, 1] == 0.5
    assert len(curve.orbits) > 30


def test_a_curve_of_ends_of_sticking_may_be_stopped_on_request(default_end):
    plane = ("omega", "restitution"), ((0.1, 2.5), (0.0, 0.9))
    curve = vi.continue_boundary(default_end, *plane, progress=lambda done, total, partial: done < 5)
    assert curve.outcome == ("stopped", "stopped")
    assert 5 <= len(curve.orbits) <= 12


@pytest.mark.long(but=1)
@pytest.mark.parametrize(
    ("names", "ranges"),
    [
        (("omega", "restitution"), ((0.1, 2.5), (0.0, 0.9))),
        (("omega", "mass"), ((0.1, 2.0), (0.1, 5.0))),
        (("mass", "damping"), ((0.5, 2.5), (0.0, 0.5))),
        (("gap", "stiffness"), ((-0.2, 0.2), (0.8, 1.2))),
    ],
)
def test_all_along_the_curve_the_stuck_time_is_zero_and_sticking_lies_on_one_side(default_end, names, ranges):
    curve = vi.continue_boundary(default_end, names, ranges, step=0.02)
    assert curve.outcome == ("range", "range"), curve.message
    assert len(curve.orbits) > 10
    assert max(curve.residuals) < 1e-10
    points = curve.values
    width = np.array([high - low for low, high in ranges])
    inner = points[1:-1]
    along = (points[2:] - points[:-2]) / width
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)

    def sticks(point):
        values = np.clip(point, *np.transpose(ranges))
        osc = default_end.oscillator.replace(**dict(zip(names, map(float, values), strict=True)))
        return bool(find_sticking_orbit(osc, n_periods=1, longest=1))

    for shift in (0.02, 1e-3):
        resting = [sticks(at) for at in inner + shift * across * width]
        right = [sticks(at) for at in inner - shift * across * width]
        assert all(a != b and a == resting[0] for a, b in zip(resting, right, strict=True))


def test_the_curve_passes_through_ends_found_one_by_one(default_end):
    curve = vi.continue_boundary(default_end, ("omega", "mass"), ((0.1, 2.0), (0.1, 5.0)), step=0.02)
    omega, mass = curve.values.T
    for at in range(0, len(curve.orbits), 4):
        osc = vi.ImpactOscillator(mass=mass[at])
        alone = vi.end_of_sticking(osc, "omega", (0.98 * omega[at], 1.02 * omega[at]))
        assert omega[at] == pytest.approx(alone.value, rel=1e-13)


def test_a_tongue_of_period_2_sticking_is_followed_around_its_tip():
    start = vi.end_of_sticking(vi.ImpactOscillator(), "omega", (3.005, 3.0125))
    curve = vi.continue_boundary(start, ("omega", "restitution"), ((2.9, 3.1), (0.6, 0.99)), step=0.02)
    assert curve.outcome == ("range", "range"), curve.message
    # At the tip a graze lies on the curve: there the stuck time has an infinite slope, and the root of 1e-16 is left.
    assert max(curve.residuals) < 1e-7
    assert np.median(curve.residuals) < 1e-12
    omega, restitution = curve.values.T
    assert restitution[[0, -1]] == pytest.approx([0.6, 0.6], rel=1e-14)
    assert restitution.max() > 0.93
    ends = [
        vi.end_of_sticking(vi.ImpactOscillator(restitution=0.6), "omega", (0.5 * sum(omega[[0, -1]]), away)).value
        for away in (2.9, 3.1)
    ]
    assert sorted(omega[[0, -1]]) == pytest.approx(sorted(ends), rel=1e-13)


def test_bad_requests_name_what_is_wrong(default_end):
    osc = vi.ImpactOscillator()
    with pytest.raises(ValueError, match="`n_periods` must be .*, got 0"):
        find_sticking_orbit(osc, n_periods=0)
    with pytest.raises(ValueError, match="unknown parameter 'speed'"):
        vi.end_of_sticking(osc, "speed", (0.3, 0.4))
    with pytest.raises(ValueError, match="`between` must be two different values"):
        vi.end_of_sticking(osc, "omega", (0.3, 0.3))
    with pytest.raises(ValueError, match="`between` must be two values of omega, got 0.3"):
        vi.end_of_sticking(osc, "omega", 0.3)
    with pytest.raises(ValueError, match="`restitution` must be between 0 and 1, got 1.5"):
        vi.end_of_sticking(osc, "restitution", (0.3, 1.5))
    ranges = ((0.3, 0.4), (0.5, 2.0))
    with pytest.raises(ValueError, match="`step` must be .*, got 0"):
        vi.continue_boundary(default_end, ("omega", "mass"), ranges, step=0)
    with pytest.raises(ValueError, match="two different parameters"):
        vi.continue_boundary(default_end, ("omega", "omega"), ranges)
    with pytest.raises(ValueError, match="`range` must be .* contains the orbit's omega"):
        vi.continue_boundary(default_end, ("omega", "mass"), ((0.1, 0.2), (0.5, 2.0)))
    with pytest.raises(ValueError, match="`point` must be .*, got 'no_change'"):
        vi.continue_boundary(vi.end_of_sticking(osc, "omega", (0.1, 0.2)), ("omega", "mass"), ranges)


def test_a_branch_of_the_sticking_orbit_goes_to_its_end_and_leads_on_to_the_curve_of_ends():
    osc = vi.ImpactOscillator(omega=0.3)
    (orbit,) = vi.find_orbit(osc, n_impacts=-1)
    branch = vi.continue_orbit(orbit, "omega", (0.1, 0.5), step=0.05)
    assert branch.outcome == ("range", "end_of_sticking")
    for one in branch.orbits[::4]:
        assert [one] == find_sticking_orbit(osc.replace(omega=one.value("omega")))
        (rest,) = one.rests
        assert rest.end % 1.0 == pytest.approx(one.release_phase, abs=1e-12)
        assert (rest.end - rest.begin) * one.oscillator.period == pytest.approx(one.stuck_time, rel=1e-9)
    (end,) = branch.special
    known = vi.end_of_sticking(osc, "omega", (0.3, 0.4))
    assert (end.kind, end.value) == ("end_of_sticking", pytest.approx(known.value, rel=1e-15))
    plane = ("omega", "restitution"), ((0.3, 0.4), (0.7, 0.9))
    ours, theirs = (vi.continue_boundary(point, *plane, step=0.1) for point in (end, known))
    assert ours.values[[0, -1]] == pytest.approx(theirs.values[[0, -1]], rel=1e-9)
