"""Orbits that rest at a stop: of one mass from its release, of systems as fixed points of their motion."""

import dataclasses
import math

import numpy as np
import pytest

import vibroimpact as vi
from designs import RESTS
from differences import derivative
from resting import ONES, OSCILLATORS, SYSTEMS, the_orbit, two_sides, witnessed_rests
from systems import sticking
from vibroimpact.backends.modal.carry import Carrier
from vibroimpact.orbits.sticking import find_sticking_orbit

pytestmark = pytest.mark.usefixtures("modal_engine")

SLOW = vi.ImpactOscillator(omega=0.1)
FORMS = OSCILLATORS | {f"{name}, as a system": (osc.system, n) for name, (osc, n) in OSCILLATORS.items()}
MODELS = FORMS | {name: (system, 1) for name, system in SYSTEMS.items()}


def orbit_of(name):
    model, n_periods = MODELS[name]
    return the_orbit(model, n_periods=n_periods)


ACROSS_PERIODS = {  # orbits of two periods and more, at whose release a driving period has passed
    "one mass": (vi.ImpactOscillator(omega=3.0, restitution=0.0, damping=0.05), 2),
    "a system": (vi.ImpactOscillator(omega=3.0, restitution=0.0, damping=0.05).system, 2),
}


@pytest.mark.parametrize("name", [*MODELS, *ACROSS_PERIODS])
def test_the_motion_of_an_orbit_is_at_its_stops_at_its_impacts_and_during_its_rests(name):
    model, n_periods = (MODELS | ACROSS_PERIODS)[name]
    orbit = the_orbit(model, n_periods=n_periods)
    rests = [(rest.stop, turn) for rest in orbit.rests for turn in (rest.begin, 0.5 * (rest.begin + rest.end))]
    for stop, turn in [*zip(orbit.stops, orbit.turns, strict=True), *rests]:
        time = turn * orbit.system.period
        place = np.atleast_1d(np.squeeze(orbit.motion(np.array([time]))[0]))
        clearance = orbit.system.clearances(place, time)[orbit.system.stop_names.index(stop)]
        assert clearance == pytest.approx(0.0, abs=1e-7 * (1.0 + np.abs(place).max())), (stop, turn)


# The cycle from release to release


def test_the_sticking_orbit_at_w_01_to_fifty_digit_values(values, form):
    known = values["sticking_w=0.1"]
    orbit = the_orbit(form(SLOW))
    assert orbit.stick_phase == pytest.approx(float(known["accumulation_phase_frac"]), abs=1e-15)
    assert orbit.stuck_time == pytest.approx(float(known["stuck_duration"]), rel=1e-14)
    assert orbit.release_phase == float(known["lift_off_phase_frac"])
    assert max(orbit.velocities) == pytest.approx(float(known["max_v"]), rel=1e-14)
    assert orbit.velocities[:40] == pytest.approx([float(hit["v"]) for hit in known["impacts"]], rel=1e-11)
    assert orbit.phases[:40] == pytest.approx([float(hit["phase_frac"]) for hit in known["impacts"]], abs=1e-14)


def test_a_chatter_is_infinitely_many_impacts_and_erases_memory(form):
    orbit = the_orbit(form(SLOW))
    assert (orbit.n_periods, orbit.n_impacts) == (1, -1)
    assert orbit.multipliers == (0j, 0j)
    assert orbit.stable
    assert orbit.admissible
    assert orbit.lyapunov == -math.inf


@pytest.mark.parametrize("name", FORMS)
def test_the_mass_rests_from_the_chatters_end_until_the_force_falls_through_the_preload(name):
    orbit, osc = orbit_of(name), OSCILLATORS[name.partition(",")[0]][0]
    angle = math.pi - math.asin(osc.stiffness * osc.gap / osc.amplitude)
    assert orbit.release_phase == pytest.approx(angle / (2 * math.pi), abs=1e-15)
    wait = (orbit.release_phase - orbit.stick_phase) % 1.0
    assert orbit.stuck_time == pytest.approx(wait * osc.period, rel=1e-13)
    assert osc.amplitude * math.sin(2 * math.pi * orbit.stick_phase) > osc.stiffness * osc.gap


@pytest.mark.parametrize("name", MODELS)
def test_started_on_the_orbit_the_mass_leaves_the_stop_and_repeats_it(name):
    orbit = orbit_of(name)
    period, count = orbit.oscillator.period, len(orbit.velocities)
    hits = vi.impact_section(orbit.model, start=orbit.start, transient_impacts=0, sample_impacts=2 * count)
    velocities = hits["velocity"].values[:count]
    first = np.abs(np.array(orbit.velocities) - velocities[0]).argmin()
    assert velocities == pytest.approx(np.roll(orbit.velocities, -first), rel=1e-9, abs=1e-13)
    begin, end = (hits[name].values[0] / period % 1.0 for name in ("stick_time", "release_time"))
    rest = min(orbit.rests, key=lambda rest: abs(rest.begin % 1.0 - begin))
    assert (begin, end) == pytest.approx((rest.begin % 1.0, rest.end % 1.0), abs=1e-12)
    if orbit.start.velocity == 0.0:
        assert hits["release_time"].values[0] - orbit.start.time == pytest.approx(orbit.period, rel=1e-12)


# The two masses rest at a stop without restitution: their motion is recognised by its five impacts.
@pytest.mark.parametrize("name", [name for name in MODELS if name != "two masses"])
def test_a_settled_section_is_recognised_as_the_same_motion(name):
    orbit = orbit_of(name)
    count = len(orbit.velocities)
    transient, start = (20 * count, None) if orbit.n_periods == 1 else (0, orbit.start)
    section = vi.impact_section(orbit.model, start=start, transient_impacts=transient, sample_impacts=1000)
    motion = vi.recognise(section)
    assert (motion.kind, motion.n_periods, motion.n_impacts) == ("sticking", orbit.n_periods, -1)
    assert motion.velocities[0] == pytest.approx(max(orbit.velocities), rel=1e-9)
    assert name not in OSCILLATORS or len(motion.velocities) == count


@pytest.mark.parametrize("name", MODELS)
def test_the_witness_comes_back_to_where_an_orbit_begins_and_rests_as_long(name):
    orbit = orbit_of(name)
    place = np.atleast_1d(orbit.start.displacement)
    seen, rested = witnessed_rests(orbit)
    assert seen.displacement == pytest.approx(place, abs=1e-9 * (np.abs(place).max() or 1.0))
    for stop in orbit.model.stop_names:
        known = sum(rest.end - rest.begin for rest in orbit.rests if rest.stop == stop) * orbit.oscillator.period
        assert rested[stop] == pytest.approx(known, abs=1e-6 * orbit.oscillator.period)


@pytest.mark.parametrize("name", MODELS)
def test_its_motion_is_that_of_simulate(name):
    orbit = orbit_of(name)
    followed = vi.simulate(orbit.model, start=orbit.start, periods=orbit.n_periods)
    place = orbit.motion(followed["time"])[0]
    assert place == pytest.approx(followed["displacement"].values.reshape(place.shape), abs=1e-9)
    assert place[-1] == pytest.approx(place[0], abs=1e-9)


@pytest.mark.parametrize("model", [SLOW, SLOW.system, sticking()], ids=["one mass", "its system", "two masses"])
def test_accelerations_of_an_orbit_that_rests_are_the_slopes_of_its_velocities(model):
    (orbit,) = vi.find_orbit(model, near=model.rest)
    rests = [(rest.begin, rest.end) for rest in orbit.rests]
    turns = np.arange(200) / 200 * orbit.n_periods
    hits = np.array([*orbit.phases, *np.ravel(rests)])[:, None]
    turns = turns[np.abs((turns - hits + 0.5) % 1.0 - 0.5).min(axis=0) > 1e-4]
    step = 1e-5 * orbit.oscillator.period
    times = turns * orbit.oscillator.period
    _, before, _ = orbit.motion(times - step)
    _, after, _ = orbit.motion(times + step)
    _, _, acceleration = orbit.motion(times)
    slope = (after - before) / (2.0 * step)
    assert acceleration == pytest.approx(slope, abs=1e-6 * np.abs(slope).max())
    begin, end = rests[0]
    inside = (turns - begin) % orbit.n_periods < end - begin
    assert inside.any()
    if np.size(model.rest.displacement) == 1:
        assert np.abs(acceleration[inside]).max() < 1e-12


@pytest.mark.parametrize("factor", [2.0, 0.25])
def test_scaling_a_sticking_orbit_is_exact_bit_for_bit(factor):
    osc, _ = OSCILLATORS["half a gap"]
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


@pytest.mark.parametrize("name", ONES)
def test_one_mass_as_a_system_rests_as_the_oscillator_does(name):
    known, orbit = (the_orbit(model) for model in (ONES[name], ONES[name].system))
    (rest,) = orbit.rests
    assert (orbit.name, orbit.n_impacts, orbit.stable) == (known.name, -1, True)
    assert rest.end % 1.0 == pytest.approx(known.release_phase, abs=1e-12)
    assert orbit.stuck_time == pytest.approx(known.stuck_time, rel=1e-8)
    shared = min(len(orbit.velocities), len(known.velocities))
    assert orbit.velocities[:shared] == pytest.approx(known.velocities[:shared], rel=1e-8)
    assert orbit.turns[:shared] == pytest.approx(known.turns[:shared], abs=1e-8)
    assert rest == pytest.approx(known.rests[0]._replace(stop=rest.stop), abs=1e-8)
    assert np.abs(orbit.multipliers).max() < 1e-12
    assert orbit.lyapunov < -10.0 * ONES[name].omega
    times = np.linspace(0.0, 2.0 * orbit.period, 50)
    for ours, theirs in zip(known.motion(times), orbit.motion(times), strict=True):
        assert ours == pytest.approx(theirs, abs=1e-9)


def test_without_restitution_one_impact_is_enough(form):
    orbit = the_orbit(form(SLOW.replace(restitution=0.0)))
    assert (orbit.n_periods, orbit.n_impacts, len(orbit.velocities)) == (1, 1, 1)
    assert orbit.stick_phase == orbit.phases[0]
    assert orbit.velocities[0] == pytest.approx(the_orbit(SLOW).velocities[0], rel=1e-14)


def test_a_stop_without_restitution_is_struck_a_number_of_times_one_with_it_without_end():
    assert the_orbit(sticking()).n_impacts == 5
    assert the_orbit(two_sides()).n_impacts == -1


def test_only_impacts_above_the_cut_are_listed_and_the_chatters_end_stays():
    osc = vi.ImpactOscillator(omega=0.1)
    (few,) = find_sticking_orbit(osc, tolerances=vi.Tolerances(chatter=1e-3))
    (many,) = find_sticking_orbit(osc)
    assert few.velocities == many.velocities[: len(few.velocities)]
    assert min(few.velocities) >= 1e-3 > many.velocities[len(few.velocities)]
    assert few.stuck_time == many.stuck_time


# Its derivative


def carrier_of(orbit):
    """Return what carries states over a period, with the state and the phase in which an orbit begins."""
    carrier = Carrier(orbit.system.cells({}), vi.Tolerances())
    x = carrier.state(np.array(orbit.start.displacement), np.array(orbit.start.velocity))
    return carrier, x, orbit.start.time / orbit.system.period


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_derivative_is_that_of_the_motion(name):
    orbit = the_orbit(SYSTEMS[name])
    carrier, x, phase = carrier_of(orbit)
    end, matrix = carrier.over(x, phase, orbit.n_periods)
    assert end == pytest.approx(x, abs=1e-12 * np.abs(x).max())
    known = derivative(lambda state: carrier.over(state, phase, orbit.n_periods)[0], x, 1e-6 * np.abs(x).max())
    assert matrix == pytest.approx(known, abs=1e-7)
    assert sorted(np.abs(orbit.multipliers)) == pytest.approx(sorted(np.abs(np.linalg.eigvals(matrix))), abs=1e-12)


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_rest_takes_a_coordinate_and_its_rate_and_leaves_the_others_their_memory(name):
    orbit = the_orbit(SYSTEMS[name])
    sizes = np.abs(orbit.multipliers)
    assert (sizes < 1e-12).sum() == 2
    assert sizes[0] > 1e-3
    assert orbit.determinant == 0.0


@pytest.mark.parametrize("name", ["slow", "slow, as a system", *SYSTEMS])
def test_the_exponent_is_that_of_the_motion_that_settles_to_it(name):
    orbit = orbit_of(name)
    omega, indices = [orbit.oscillator.omega], ["lyapunov", "n_periods"]
    settled = vi.parameter_map(orbit.model, omega=omega, indices=indices, sample_impacts=50_000)
    assert orbit.stable
    assert settled["n_periods"].item() == orbit.n_periods
    assert settled["lyapunov"].item() == pytest.approx(orbit.lyapunov, rel=1e-3)  # over a finite window


def unstable():
    """Return an orbit of the two masses that no motion settles to, along 15 frequencies from one that some do."""
    orbit = None
    for omega in np.linspace(0.4, 0.55, 16):
        orbit = the_orbit(sticking().replace(omega=omega), near=orbit)
    return orbit


def test_an_unstable_orbit_that_rests_is_found_and_left_by_its_multiplier():
    orbit = unstable()
    assert not orbit.stable
    assert orbit.multipliers[0].real < -1.5
    carrier, x, phase = carrier_of(orbit)
    _, derivative = carrier.over(x, phase, 1.0)
    values, vectors = np.linalg.eig(derivative)
    along = vectors[:, np.abs(values).argmax()].real
    moved = (carrier.over(x + 1e-8 * along, phase, 1.0)[0] - x) / 1e-8
    assert moved == pytest.approx(orbit.multipliers[0].real * along, rel=1e-5, abs=1e-6)


# Guesses


def test_a_state_near_it_does_as_well_as_the_motion_from_rest():
    orbit = the_orbit(sticking())
    place, rate = (np.array(part) + 1e-3 for part in (orbit.start.displacement, orbit.start.velocity))
    again = the_orbit(sticking(), near=vi.State(place, rate, orbit.start.time))
    assert again.velocities == pytest.approx(orbit.velocities, rel=1e-10)
    assert again.turns == pytest.approx(orbit.turns, abs=1e-10)


def test_its_twin_is_a_motion_of_the_symmetric_system_too():
    orbit = the_orbit(two_sides())
    twin = orbit.twin
    assert {rest.stop for rest in twin.rests} == {rest.stop for rest in orbit.rests} == {"left", "right"}
    again = the_orbit(two_sides(), near=twin)
    assert again.start.displacement == pytest.approx(twin.start.displacement, abs=1e-10)
    assert sorted(again.velocities) == pytest.approx(sorted(orbit.velocities), rel=1e-9)


@pytest.mark.parametrize(("gap", "symmetric"), [(0.3, True), (0.31, False)])
def test_a_resting_orbit_is_symmetric_if_it_is_its_own_mirror_image(gap, symmetric):
    stops = [vi.Stop(direction=1, gap=0.3, restitution=0.3), vi.Stop(direction=-1, gap=gap, restitution=0.3)]
    force = vi.Force(omega=0.8, harmonics={1: 1.0})
    orbit = the_orbit(vi.ImpactSystem(mass=1.0, damping=0.05, stiffness=1.0, force=force, stops=stops))
    (one, other) = (rest.end for rest in orbit.rests)
    assert (abs((other - one) % 1.0 - 0.5) < 1e-9) == symmetric
    assert orbit.symmetric == symmetric


def test_an_orbit_entered_within_a_rest_has_that_rest_once():
    """The state found before is at rest where the parameter moved on: the rest was listed twice."""
    orbit = the_orbit(sticking().replace(omega=0.6))
    rest = orbit.rests[0]
    within = 0.5 * (rest.begin + rest.end) - orbit.start.time / orbit.system.period
    moved = vi.simulate(orbit.system, start=orbit.start, periods=1, samples_per_period=1000)
    at = round(within % 1.0 * 1000)
    state = vi.State(moved["displacement"].values[at], moved["velocity"].values[at], moved["time"].values[at])
    again = the_orbit(orbit.system, near=dataclasses.replace(orbit, start=state))
    assert len(again.rests) == len(orbit.rests) == 1
    assert again.stuck_time == pytest.approx(orbit.stuck_time, rel=1e-8)


def test_a_guess_that_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="must have 2 coordinates"):
        vi.find_orbit(sticking(), n_impacts=-1, near=vi.State([0.0, 0.0, 0.0]))
    with pytest.raises(ValueError, match="must be an orbit of 2 coordinates"):
        vi.find_orbit(sticking(), n_impacts=-1, near=the_orbit(SLOW.system))
    with pytest.raises(ValueError, match="an orbit or an attractor of a system"):
        vi.find_orbit(sticking(), n_impacts=-1, near=(0.1, 1.0))


# None


@pytest.mark.parametrize(
    "numbers",
    [
        {"omega": 2.0},
        {"gap": -1.0},
        {"gap": -3.0, "omega": 0.1},
        {"gap": 1.0, "omega": 0.1},
        {"omega": 0.1, "restitution": 1.0},
        {"amplitude": 0.0, "gap": -1.0},
        {"amplitude": 0.0, "gap": 0.0},
        {"damping": 0.0, "restitution": 1.0},
    ],
)
def test_no_sticking_orbit_where_the_mass_never_rests_or_is_never_let_go(form, numbers):
    osc = vi.ImpactOscillator(**numbers)
    assert find_sticking_orbit(osc) == []
    assert vi.find_orbit(form(osc), n_impacts=-1) == []


@pytest.mark.parametrize(("hardest", "n_periods"), [(5.411, 18), (1.381, 27), (2.114, 30)])
def test_a_rest_that_rounding_repeats_is_no_orbit(hardest, n_periods):
    osc = RESTS[hardest]
    assert find_sticking_orbit(osc) == []
    orbits = vi.find_orbit(osc, n_periods=n_periods, n_impacts=-1)
    assert (orbits, orbits.outcome) == ([], "none")
    assert "rounding decides" in orbits.message


def test_maps_and_orbits_agree_on_which_rests_repeat():
    # 1,500 motions that rest were tried once, 1 in 10 of them irregular: both agreed on each.
    random = np.random.default_rng(21)
    designs = [
        {
            "mass": 10 ** random.uniform(-0.5, 0.5),
            "damping": 10 ** random.uniform(-3.0, -0.5),
            "omega": random.uniform(0.3, 5.0),
            "restitution": random.uniform(0.3, 0.95),
            "gap": random.uniform(-0.9, 0.6),
        }
        for _ in range(400)
    ]
    points = {name: [design[name] for design in designs] for name in designs[0]}
    indices = ("lyapunov_per_impact", "n_periods", "n_impacts")
    sweep = vi.classify(vi.parameter_map(SLOW, points=points, indices=indices))
    kinds = sweep["motion"].attrs["flag_meanings"].split()
    resting = np.flatnonzero(sweep["motion"].values == kinds.index("sticking"))
    periods = sweep["n_periods"].values.astype(int)
    assert sum(periods[resting] == 0) >= 10
    for at in resting:
        found = find_sticking_orbit(vi.ImpactOscillator(**designs[at]))
        assert [orbit.n_periods for orbit in found] == [periods[at]] * bool(periods[at])


def test_an_orbit_of_another_name_is_not_handed_out(form):
    osc = vi.ImpactOscillator(omega=3.005)
    assert vi.find_orbit(form(osc), n_impacts=-1) == []
    assert the_orbit(form(osc), n_periods=2).name == "period-2 sticking"
    assert find_sticking_orbit(osc, longest=1) == []
    with pytest.raises(ValueError, match="`n_periods` must be .*, got 0"):
        find_sticking_orbit(osc, n_periods=0)


@pytest.mark.parametrize(
    ("model", "n_periods", "outcome", "said"),
    [
        (sticking(), 2, "other_name", "converged to a period-1 sticking orbit instead of a period-2 sticking one"),
        (vi.models.impact_damper(), 1, "other_name", "impact-2 orbit, which rests at no stop"),
        (sticking().replace(stop_1_gap=30.0, stop_2_gap=30.0), 1, "none", "the motion reached has no impacts"),
        (vi.ImpactOscillator(gap=-3.0, omega=0.1).system, 1, "none", "the motion reached stays at stop for ever"),
    ],
    ids=["once", "no rest", "no impact", "pressed for ever"],
)
def test_what_is_found_instead_is_said(model, n_periods, outcome, said):
    orbits = vi.find_orbit(model, n_periods=n_periods, n_impacts=-1)
    assert (len(orbits), orbits.outcome) == (0, outcome)
    assert said in orbits.message
