"""The end of sticking, where a chatter's end meets the release, and branches and curves that lead to it."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from resting import ONES, SYSTEMS, moving, the_orbit, two_sides, witnessed_rests
from systems import sticking
from vibroimpact.orbits.sticking import find_sticking_orbit
from vibroimpact.orbits.sticking_end import scaling_exponent

# The end of sticking of the default oscillator, by bisection with closed-form flights in 45 digits.
END = 0.34718041326569632613


def stuck_fraction(**numbers):
    (orbit,) = find_sticking_orbit(vi.ImpactOscillator(**numbers))
    return orbit.stuck_time / orbit.oscillator.period


def test_a_graze_in_the_flight_does_not_end_sticking():
    # Between these frequencies the period-2 cycle loses an impact outside its chatter: it dies weightless.
    def outside(omega):
        orbit = the_orbit(vi.ImpactOscillator(omega=omega), n_periods=2)
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


@pytest.mark.usefixtures("modal_engine")
@pytest.mark.parametrize("name", ONES)
def test_the_end_of_sticking_of_one_mass_as_a_system_is_that_of_the_oscillator(name):
    one = ONES[name]
    known, found = (vi.end_of_sticking(model, "omega", (one.omega, 2.0)) for model in (one, one.system))
    assert (known.outcome, found.outcome) == ("found", "found")
    assert found.value == pytest.approx(known.value, rel=1e-9)
    assert found.residual < 1e-7


# The power of the distance with which the stuck time vanishes


@pytest.mark.parametrize("restitution", [0.2, 0.5, 0.8, 0.9])
def test_the_stuck_time_vanishes_with_the_power_that_self_similar_chatter_gives(restitution):
    osc = vi.ImpactOscillator(restitution=restitution)
    end = vi.end_of_sticking(osc, "omega", (0.05, 2.0)).value
    near, far = (stuck_fraction(restitution=restitution, omega=end * (1 - d)) for d in (1e-10, 1e-7))
    assert math.log(far / near) / math.log(1e3) == pytest.approx(scaling_exponent(restitution), abs=0.02)


ENDS = {  # where sticking ends, and the restitution of the stop
    "two masses": (moving(), (0.5, 0.9), 0.3),
    "both sides": (two_sides(), (0.9, 1.5), 0.5),
}


@pytest.mark.parametrize("name", ENDS)
def test_the_stuck_time_of_systems_vanishes_with_the_same_power(name):
    model, between, restitution = ENDS[name]
    end = vi.end_of_sticking(model, "omega", between)
    assert end.found
    distances = np.array([1e-5, 1e-6, 1e-7])
    orbits, orbit = [], end.orbit
    for away in distances[::-1]:
        near = model.replace(omega=end.value + away * (between[0] - end.value))
        orbit = the_orbit(near, near=orbit)
        orbits.append(orbit)
    stuck = [orbit.rests[0].end - orbit.rests[0].begin for orbit in orbits[::-1]]
    slopes = np.diff(np.log(stuck)) / np.diff(np.log(distances))
    assert slopes == pytest.approx(scaling_exponent(restitution), abs=0.02)
    beyond = model.replace(omega=end.value + 1e-6 * (between[1] - end.value))
    assert not vi.find_orbit(beyond, n_impacts=-1, near=end.orbit)


def test_the_exponent_of_the_stuck_time_runs_from_one_to_three_fifths():
    exponents = [scaling_exponent(r) for r in np.linspace(0.0, 1.0, 101)]
    assert exponents[0] == 1.0
    assert exponents[-1] == pytest.approx(0.6)
    assert (np.diff(exponents) <= 0.0).all()
    assert scaling_exponent(1 - 2e-6) == pytest.approx(0.6, abs=1e-9)


def test_without_restitution_sticking_ends_where_a_flight_lasts_from_release_to_release(form):
    point = vi.end_of_sticking(form(vi.ImpactOscillator(restitution=0.0)), "omega", (1.0, 2.5))
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


# Other ends, and none


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


@pytest.mark.parametrize(
    ("model", "between", "why"),
    [
        (vi.ImpactOscillator(), (0.1, 0.2), "give values with a change"),
        (vi.ImpactOscillator(), (1.1, 1.2), "give values with a change"),
        (vi.ImpactOscillator().system, (1.1, 1.2), "give values with a change"),
        (sticking(), (0.5, 0.6), "persists up to 0.6"),
        (vi.ImpactOscillator().system, (0.1, 0.2), "persists up to 0.2"),
    ],
    ids=[
        "it persists",
        "there is none",
        "a system, there is none",
        "a system, it persists",
        "as a system, it persists",
    ],
)
def test_without_a_change_between_no_end_is_made_up(model, between, why):
    point = vi.end_of_sticking(model, "omega", between)
    assert (point.outcome, point.found) == ("no_change", False)
    assert why in point.message
    assert math.isnan(point.value)
    assert point.orbit is None


def test_a_stuck_time_that_jumps_is_never_passed_off_as_the_end_of_sticking():
    # After some fifty chaotic periods neighbouring numbers already come to rest in different periods.
    point = vi.end_of_sticking(vi.ImpactOscillator(), "omega", (2.8644, 2.8645))
    assert point.outcome == "unresolved"
    assert point.stuck_fraction > 1e-3
    assert "amplifies rounding errors" in point.message


def test_how_an_orbit_of_a_system_is_lost_is_said():
    assert vi.end_of_sticking(sticking(), "omega", (0.5, 0.6)).outcome == "no_change"
    gear = vi.models.idle_gear()
    lost = vi.end_of_sticking(gear, "omega", (0.6 * gear.omega, 0.5 * gear.omega))
    assert (lost.outcome, lost.found) == ("lost", False)
    assert "the orbit still rests for 0.999 T" in lost.message
    folds = vi.end_of_sticking(two_sides(), "left_gap", (0.1, 3.0))
    assert (folds.outcome, "where it folds" in folds.message) == ("lost", True)
    (end,) = vi.continue_orbit(the_orbit(two_sides().replace(omega=1.1)), "omega", (1.09, 1.2)).special
    with pytest.raises(ValueError, match="of an orbit that never rests, or of one mass"):
        vi.continue_boundary(end, ("omega", "left_gap"), ((1.0, 1.2), (0.0, 0.5)))


def test_a_lightly_damped_mode_that_no_stop_feels_makes_no_fold_of_an_end():
    def system(third):
        return vi.ImpactSystem(
            mass=np.eye(3),
            damping=[[0.2, -0.02, 0.0], [-0.02, 0.2, 0.0], [0.0, 0.0, 1e-5]],
            stiffness=[[2.0, -1.0, 0.0], [-1.0, 2.0, 0.0], [0.0, 0.0, third]],
            force=vi.Force(omega=0.55, harmonics={1: [1.0, -0.8j, 0.0]}),
            stops=[
                vi.Stop(direction=[1, 0, 0], gap=0.0, restitution=0.0, name="s"),
                vi.Stop(direction=[0, 1, 0], gap=1.2, restitution=0.6, name="t"),
            ],
        )

    apart, resonant = (vi.end_of_sticking(system(third), "t_gap", (1.2, 0.25)) for third in (1.0, 1.1**2))
    assert min(abs(mu - 1.0) for mu in resonant.orbit.multipliers) < 1e-3
    assert resonant.message == apart.message
    assert "where no next orbit is found" in apart.message


# Branches


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


def test_a_branch_that_rests_ends_where_sticking_does_or_folds():
    orbit = the_orbit(two_sides())
    branch = vi.continue_orbit(orbit, "omega", (0.15, 1.5), step=0.05)
    assert branch.outcome == ("range", "end_of_sticking")
    (end,) = branch.special
    assert end.value == pytest.approx(vi.end_of_sticking(two_sides(), "omega", (0.15, 1.5)).value, rel=1e-10)
    hardest = branch.dataset["velocity"].max("impact").values  # a row begins at the same release
    assert np.abs(np.diff(hardest)).max() < 0.1
    assert branch.dataset["velocity"].values[:, 0] == pytest.approx(hardest)
    folding = vi.continue_orbit(orbit, "left_gap", (0.1, 2.0), step=0.05)
    assert folding.outcome == ("range", "fold")
    (fold,) = folding.special
    assert (fold.kind, fold.residual < 1e-3) == ("fold", True)
    assert min(abs(m - 1.0) for m in fold.orbit.multipliers) == fold.residual
    nearer = [min(abs(m - 1.0) for m in one.multipliers) for one in folding.orbits[-6:]]
    assert nearer == sorted(nearer, reverse=True)


@pytest.mark.parametrize("name", SYSTEMS)
def test_along_a_branch_the_witness_comes_back_and_rests_as_long(name):
    orbit = the_orbit(SYSTEMS[name])
    omega = orbit.system.omega
    branch = vi.continue_orbit(orbit, "omega", (0.97 * omega, 1.03 * omega))
    assert branch.outcome == ("range", "range")
    assert len(branch.orbits) > 50
    for one in branch.orbits[::9]:
        seen, rested = witnessed_rests(one)
        assert seen.displacement == pytest.approx(np.array(one.start.displacement), abs=1e-8)
        assert sum(rested.values()) == pytest.approx(one.stuck_time, abs=1e-6 * one.system.period)


# Curves of ends in a plane


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


@pytest.mark.parametrize(
    ("model", "restitution"),
    [(vi.ImpactOscillator(), "restitution"), (vi.ImpactOscillator().system, "stop_restitution")],
    ids=["one mass", "its system"],
)
def test_bad_requests_for_an_end_name_what_is_wrong(model, restitution):
    with pytest.raises(ValueError, match="unknown parameter 'speed'"):
        vi.end_of_sticking(model, "speed", (0.3, 0.4))
    with pytest.raises(ValueError, match="`between` must be two different values"):
        vi.end_of_sticking(model, "omega", (0.3, 0.3))
    with pytest.raises(ValueError, match="`between` must be two values of omega, got 0.3"):
        vi.end_of_sticking(model, "omega", 0.3)
    with pytest.raises(ValueError, match=f"`{restitution}` must be between 0 and 1, got 1.5"):
        vi.end_of_sticking(model, restitution, (0.3, 1.5))


def test_bad_requests_for_a_curve_name_what_is_wrong(default_end):
    osc = vi.ImpactOscillator()
    ranges = ((0.3, 0.4), (0.5, 2.0))
    with pytest.raises(ValueError, match="`step` must be .*, got 0"):
        vi.continue_boundary(default_end, ("omega", "mass"), ranges, step=0)
    with pytest.raises(ValueError, match="two different parameters"):
        vi.continue_boundary(default_end, ("omega", "omega"), ranges)
    with pytest.raises(ValueError, match="`range` must be .* contains the orbit's omega"):
        vi.continue_boundary(default_end, ("omega", "mass"), ((0.1, 0.2), (0.5, 2.0)))
    with pytest.raises(ValueError, match="`point` must be .*, got 'no_change'"):
        vi.continue_boundary(vi.end_of_sticking(osc, "omega", (0.1, 0.2)), ("omega", "mass"), ranges)
