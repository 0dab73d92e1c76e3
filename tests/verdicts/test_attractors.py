"""Motions that coexist: which there are, and what is true of each of them."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

import vibroimpact as vi
from contents import names_of_starts
from designs import RESTS, TRANSIENTS, random_oscillator
from systems import FORMS, THREE, TWINS, random_pair, two_sided
from texts import text_of
from vibroimpact.backends import ImpactWindow
from vibroimpact.coexistence import Attractor, settling
from vibroimpact.coexistence.measuring import Runner, spread_cells
from vibroimpact.motion import Motion, MotionClass
from vibroimpact.orbits import same_orbit
from vibroimpact.orbits.search import search_of

TWO = vi.ImpactOscillator(omega=3.0)  # a cycle and a sticking orbit
CYCLES = vi.ImpactOscillator(omega=1.45)  # period-1 impact-1 and period-3 impact-4
CHAOS = vi.ImpactOscillator(omega=3.0, restitution=0.9, gap=0.05)  # chaos and period-4 impact-3
MODELS = {"one mass": CYCLES, "one mass that sticks": TWO, "one mass between stops": TWINS, "two masses": THREE}
SAME = 1e-6  # within which impacts of one attractor agree


def at(osc, phase, velocity):
    return vi.State(osc.gap, velocity, phase * osc.period)


def states_along(model, attractor):
    """Return states at five instants of each period of an attractor's cycle and, of one mass, at its impacts."""
    motion = vi.simulate(model, start=attractor.start, periods=max(attractor.n_periods, 1), samples_per_period=5)
    columns = (motion[name].values.tolist() for name in ("displacement", "velocity", "time"))
    impacts = [] if attractor.stops else zip(attractor.phases, attractor.velocities, strict=True)
    struck = [at(model, phase, velocity) for phase, velocity in impacts if velocity > 1e-4]
    return struck + [vi.State(*state) for state in zip(*columns, strict=True)]


def test_at_omega_3_a_cycle_coexists_with_a_motion_that_sticks_from_one_start_in_eight():
    cycle, sticking = vi.attractors(TWO)
    assert (cycle.name, sticking.name) == ("period-2 impact-2", "period-6 sticking")
    assert cycle.share + sticking.share == 1.0
    assert sticking.share == pytest.approx(1 / 8, abs=0.02)
    assert (cycle.status, sticking.status) == (vi.Status.CLOSED, vi.Status.STICKING)
    assert cycle.lyapunov < 0.0
    assert sticking.lyapunov == -math.inf


@pytest.mark.parametrize("name", MODELS)
def test_every_state_and_impact_of_an_attractor_leads_to_it(name):
    model = MODELS[name]
    for known in vi.attractors(model):
        for starts in (states_along(model, known), [known.start]):
            (found,) = vi.attractors(model, starts)
            assert (found.name, found.share, found.stops) == (known.name, 1.0, known.stops)
            np.testing.assert_allclose(found.velocities, known.velocities, rtol=0, atol=1e-9)


def solved(model, attractor):
    """Return the orbits that Newton's method finds from the impacts of a cycle."""
    if not attractor.stops:
        first = attractor.phases[0], attractor.velocities[0]
        return vi.find_orbit(model, n_periods=attractor.n_periods, n_impacts=attractor.n_impacts, near=first)
    p = len(attractor.velocities)
    hits = vi.impact_section(model, start=attractor.start, transient_impacts=0, sample_impacts=p)
    assert tuple(hits["stop"].values) == attractor.stops
    times = hits["time"].values - math.floor(float(hits["time"][0]) / model.period) * model.period
    return vi.find_orbit(model, n_periods=attractor.n_periods, stops=attractor.stops, near=times.tolist())


def energy_lost(model, orbit):
    """Return the energy that the stops take in a cycle, I v (1 - r)/2 at each impact."""
    if not orbit.stops:
        return sum(0.5 * model.mass * (1 - model.restitution**2) * v * v for v in orbit.velocities)
    restitution = {stop.name: stop.restitution for stop in model.stops}
    impacts = zip(orbit.impulses, orbit.velocities, orbit.stops, strict=True)
    return sum(0.5 * impulse * v * (1 - restitution[stop]) for impulse, v, stop in impacts)


PERIODIC = {"one mass": CYCLES, **{f"two masses, seed {seed}": random_pair(seed) for seed in (0, 4, 10, 19, 22)}}


@pytest.mark.parametrize("model", PERIODIC.values(), ids=PERIODIC)
def test_every_periodic_attractor_is_a_stable_admissible_orbit_that_newton_finds(model):
    # 100 systems were tried once: all were.
    motions = vi.attractors(model)
    assert sum(attractor.share for attractor in motions) == 1.0
    for attractor in (one for one in motions if one.kind == "periodic"):
        orbit = next(one for one in solved(model, attractor) if same_orbit(one, attractor, tolerance=1e-12))
        assert orbit.stable
        assert orbit.admissible
        assert orbit.n_periods == attractor.n_periods
        assert attractor.lyapunov == pytest.approx(orbit.lyapunov, rel=1e-9)
        assert attractor.dissipation == pytest.approx(energy_lost(model, orbit) / orbit.n_periods, rel=1e-9)
        assert attractor.max_velocity == max(attractor.velocities)
        assert attractor.mean_velocity == np.mean(attractor.velocities)
        (again,) = vi.attractors(model, [attractor.start])
        assert again.share == 1.0
        assert same_orbit(again, attractor, tolerance=1e-9)


def test_the_sticking_attractor_is_the_one_sticking_orbit():
    sticking = vi.attractors(TWO)[1]
    (orbit,) = vi.find_orbit(TWO, n_periods=sticking.n_periods, n_impacts=-1)
    hardest = int(np.argmax(orbit.velocities))
    np.testing.assert_allclose(sticking.velocities, np.roll(orbit.velocities, -hardest), rtol=0, atol=1e-9)
    turns = (orbit.start.time - sticking.start.time) / TWO.period  # an orbit begins on the time axis of its turns
    assert turns == pytest.approx(round(turns), abs=1e-9)
    assert replace(sticking.start, time=0.0) == replace(orbit.start, time=0.0)


@pytest.mark.parametrize("name", MODELS)
def test_a_start_and_the_same_start_one_period_later_share_their_attractor(name):
    model = MODELS[name]
    reach, n = (1.0, 1) if isinstance(model, vi.ImpactOscillator) else (0.05, model.coordinates)
    for y, v, t in itertools.product((-reach, -0.3 * reach), (-0.7, 0.4), (0.0, 0.9)):
        q, speed = ([0.0] * (n - 1) + [last] for last in (y, v))
        one, later = (vi.attractors(model, [vi.State(q, speed, t + turns * model.period)])[0] for turns in (0, 1))
        assert (one.kind, one.n_periods, one.n_impacts, one.stops) == (
            later.kind, later.n_periods, later.n_impacts, later.stops)  # fmt: skip
        np.testing.assert_allclose(one.velocities, later.velocities, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("model", "starts", "sample"),
    [
        (CYCLES, [at(CYCLES, 0.3, 1.0), at(CYCLES, 0.0, 2.2)], 80),
        (TWINS, [vi.State(0.0), vi.State(0.0, -1.0)], 60),
    ],
    ids=["one mass", "one mass between stops"],
)
def test_the_witness_finds_the_same_attractors(model, starts, sample):
    few = {"transient_impacts": 60, "sample_impacts": sample, "workers": 1}
    ours, theirs = (vi.attractors(model, starts, backend=name, **few) for name in ("cpu", "reference"))
    assert [(one.name, one.share, one.stops) for one in ours] == [(one.name, one.share, one.stops) for one in theirs]
    for one, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(one.velocities, other.velocities, rtol=1e-9, atol=0)


@pytest.mark.parametrize(
    ("osc", "hardest"),
    [
        (vi.ImpactOscillator(damping=0.00132, omega=1.935, restitution=0.924, gap=0.947), 17.9701),
        (vi.ImpactOscillator(damping=0.00373, omega=3.765, restitution=0.945, gap=0.752), 8.231),
    ],
)
def test_a_hard_attractor_beyond_the_initial_conditions_is_found(osc, hardest):
    motions = vi.attractors(osc)
    assert motions[-1].share == 0.0
    assert motions[-1].max_velocity == pytest.approx(hardest, rel=1e-4)
    assert sum(attractor.share for attractor in motions) == 1.0
    verdict = vi.describe(osc, parameters=[])
    assert f"stable, but reached from none of them: {motions[-1].name}" in text_of(verdict)


def random_masses():
    """Yield oscillators, each with a number of periods."""
    random = np.random.default_rng(12)
    while True:
        osc = random_oscillator(random, restitution=(0.2, 0.98), gap=(-0.8, 2.5))
        yield osc, int(random.integers(1, 17))


def random_pairs():
    """Yield pairs of masses, each with a number of periods."""
    yield from ((random_pair(seed), 1) for seed in range(60))


@pytest.mark.long
@pytest.mark.parametrize(
    ("designs", "number"), [(random_masses, 60), (random_pairs, 3)], ids=["one mass", "two masses"]
)
def test_every_stable_orbit_of_one_impact_is_an_attractor(designs, number):
    # 2,000 of one mass were tried once (seeds 1 and 7): all were found.
    orbits = 0
    for model, n in designs():
        known = [orbit for stop in model.stop_names for orbit in vi.find_orbit(model, n_periods=n, stops=stop)]
        stable = [orbit for orbit in known if orbit.stable and orbit.admissible]
        found = [attractor for attractor in (vi.attractors(model) if stable else []) if attractor.kind == "periodic"]
        for orbit in stable:
            assert any(same_orbit(attractor, orbit, tolerance=SAME) for attractor in found)
        orbits += len(stable)
        if orbits >= number:
            break
    assert orbits >= number


def test_cycles_approached_slowly_are_waited_for():
    osc = vi.ImpactOscillator(omega=5.0)  # within 1e-10 V after 3000 impacts
    cycle, sticking = vi.attractors(osc, [at(osc, 0.3, 1.0), at(osc, 0.1, 1.7), at(osc, 0.5, 0.001)])
    assert (cycle.name, sticking.name) == ("period-6 impact-4", "period-3 sticking")


@pytest.mark.usefixtures("modal_engine")
def test_cycles_and_sticking_of_the_bouncing_ball_are_found_by_the_same_call():
    ball = vi.models.bouncing_ball()
    motions = vi.attractors(ball)
    assert sum(one.share for one in motions) == 1.0
    assert all(one.stops[:1] == ("table",) for one in motions if one.n_periods)


def test_a_family_of_systems_has_attractors():
    @vi.family
    def design(gap=0.05):
        return two_sided(5.0, 0.8, gap)

    assert [one.name for one in vi.attractors(design)] == [one.name for one in vi.attractors(TWINS)]


# What does not repeat


@pytest.mark.parametrize(
    ("model", "names", "exponent"),
    [(CHAOS, ["chaotic", "period-4 impact-3"], 0.2), (two_sided(0.9, 0.85, 0.2), ["chaotic"], 0.2)],
    ids=["one mass", "one mass between stops"],
)
def test_chaos_is_one_attractor_and_keeps_its_exponent(model, names, exponent):
    found = vi.attractors(model)
    chaos, *_ = found
    assert [one.name for one in found] == names
    assert chaos.lyapunov > exponent
    assert chaos.velocities == ()
    assert sum(one.share for one in found) == 1.0
    (again,) = vi.attractors(model, [chaos.start])
    assert again.name == "chaotic"
    assert again.mean_velocity == pytest.approx(chaos.mean_velocity, rel=0.02)


def test_chaos_with_flights_too_long_to_watch_keeps_its_exponent_and_loss():
    osc = vi.ImpactOscillator(omega=3.0415, gap=0.6965, restitution=0.6337, damping=0.0, amplitude=1.1442)
    (chaotic,) = (one for one in vi.attractors(osc) if one.kind == "chaotic")
    assert chaotic.lyapunov == pytest.approx(0.09, abs=0.01)
    assert chaotic.dissipation == pytest.approx(0.018, abs=0.001)


def test_chaos_that_does_not_last_is_not_believed():
    osc = vi.ImpactOscillator(omega=2.9)  # chaotic for hundreds of impacts, until a chatter is complete
    first = vi.impact_section(osc, start=at(osc, 0.5, 0.9), sample_impacts=100)
    assert vi.recognise(first, longest=32).kind in ("chaotic", "undecided")
    found = vi.basins(osc, phase=np.linspace(0.0, 0.9, 10), velocity=np.linspace(0.3, 3.0, 10))
    assert found["attractor"].attrs["flag_meanings"] == "undecided intermittent_sticking"
    assert float(found["share"][0]) == 1.0


@pytest.mark.long
def test_chaos_that_rests_within_1e5_impacts_is_one_attractor_that_sticks():
    """Chaos that rarely sticks: the release comes back after thousands of periods, later than most starts are run."""
    osc = vi.ImpactOscillator(mass=0.605, damping=0.0, stiffness=0.1645, omega=2.116, restitution=0.9, gap=0.5)
    (sticking,) = vi.attractors(osc)
    waiting = vi.impact_section(osc, start=at(osc, 0.25, 0.0), transient_impacts=0, sample_impacts=20_000)
    assert vi.recognise(waiting) == Motion("sticking", 0, -1)  # on its way rounding grows to the size of the motion
    assert (sticking.name, sticking.share, sticking.velocities) == ("intermittent sticking", 1.0, ())
    assert 0.0 < sticking.std < sticking.mean_velocity < sticking.max_velocity


@pytest.mark.long
@pytest.mark.parametrize("name", TRANSIENTS)
def test_chaos_that_ends_leads_to_the_cycle_that_it_ends_in(name):
    osc = TRANSIENTS[name]
    (cycle,) = vi.attractors(osc)
    assert (cycle.name, cycle.share) == (name, 1.0)
    portrait = vi.basins(osc, phase=[0.0, 0.5, 1.0], velocity=[0.0, 1.5, 3.0])
    assert set(names_of_starts(portrait).ravel()) == {name.replace(" ", "_")}
    if cycle.n_impacts == 7:  # the hardest hits are those of the motion from rest
        verdict = vi.describe(osc, parameters=[])
        assert cycle.max_velocity == pytest.approx(verdict.indices["max_velocity"], rel=1e-9)


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
@pytest.mark.parametrize("hardest", RESTS)
def test_a_rest_that_rounding_repeats_is_no_attractor(hardest, form):
    model = form(RESTS[hardest])
    (cycle,) = vi.attractors(model)
    assert (cycle.name, cycle.share) == ("period-1 impact-1", 1.0)
    assert cycle.max_velocity == pytest.approx(hardest, abs=1e-3)
    assert vi.describe(model, parameters=[]).motion.name == cycle.name
    portrait = vi.basins(model, phase=np.linspace(0.0, 1.0, 11), velocity=0.075 + 0.6 * np.arange(5))
    assert set(names_of_starts(portrait).ravel()) == {"period-1_impact-1"}


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_rests_that_come_again_from_wherever_rounding_leads_are_an_attractor(form):
    (sticking,) = vi.attractors(form(vi.ImpactOscillator(omega=2.9)))
    assert (sticking.name, sticking.share) == ("intermittent sticking", 1.0)


def test_a_chaotic_attractor_still_is_so_1e5_impacts_later():
    random, irregular = np.random.default_rng(14), 0
    for osc in (random_oscillator(random) for _ in range(60)):
        if vi.recognise(vi.impact_section(osc, transient_impacts=100, sample_impacts=5000)).kind != "chaotic":
            continue
        irregular += 1
        for attractor in (found for found in vi.attractors(osc) if found.kind == "chaotic"):
            section = vi.impact_section(osc, start=attractor.start, transient_impacts=96_000, sample_impacts=4000)
            assert not vi.recognise(section, longest=512).n_periods
    assert irregular


@pytest.mark.long
def test_chaos_that_ends_in_a_cycle_is_not_called_quasi_periodic_where_the_exponents_of_both_cancel():
    # of some starts the 32,767 impacts watched are half chaos, half the approach to a cycle: their mean exponent is 0
    class Watching(Runner):
        again = ()

        def run(self, cells, window, *more):
            self.again = cells.table.copy() if window is settling.AFTER_LATE else self.again
            return super().run(cells, window, *more)

    beam, runner = vi.models.clamped_beam_with_stop(), Watching()
    starts = spread_cells(beam.cells({}), 2048)
    watching = settling.Settling(runner, search_of(beam), (ImpactWindow(2047, 2048), settling.LATE_OF_SYSTEMS))
    for first in range(1920, -1, -128):
        settled = settling.settle(watching, starts[first + np.arange(128)], watching.windows)
        assert not (settled.kind == MotionClass.QUASI_PERIODIC).any()
        if len(runner.again):
            break
    for row in runner.again:
        (at,) = np.flatnonzero((settled.cells.table == row).all(axis=1))
        assert settled[at].name == "period-8 impact-12"
        assert settled.indices["lyapunov"][at] < 0.0
    assert len(runner.again) > 0


def test_a_particle_that_nothing_strikes_makes_no_cycle_quasi_periodic():
    """It drifts, so that neighbours part in proportion to time."""
    damper = vi.models.two_unit_impact_damper(
        damping_ratio=0.009943, force=31.66, particle_mass=0.3488, second_particle_mass=0.2646, clearance=0.005515
    )
    (found,) = vi.attractors(damper, [vi.State([0.0] * 3, [0.0] * 3)])
    assert found.name == "period-2 impact-4"
    section = vi.impact_section(damper, transient_impacts=1000, sample_impacts=9)
    assert section["velocity"].values[4:8] == pytest.approx(section["velocity"].values[:4], rel=1e-6)


# Which are the same


def test_cycles_are_the_same_whichever_of_their_impacts_they_begin_with():
    def cycle(phases, velocities):
        return Attractor("periodic", phases=tuple(phases), velocities=tuple(velocities))

    one = cycle([0.1, 0.5, 0.999999999], [2.0, 1.0, 2.0])
    assert same_orbit(one, cycle(np.roll(one.phases, 1), np.roll(one.velocities, 1)), tolerance=SAME)
    assert same_orbit(one, cycle([0.1, 0.5, 0.0], one.velocities), tolerance=SAME)
    assert not same_orbit(one, cycle([0.1, 0.500001, 0.0], one.velocities), tolerance=SAME)
    assert not same_orbit(one, cycle(one.phases[:2], one.velocities[:2]), tolerance=SAME)


def test_values_part_where_any_column_leaves_a_gap():
    energy, exponent = np.array([1.0, 1.0, 1.0, 5.0]), np.array([0.0, 0.3, 0.01, 0.0])
    groups = [group.tolist() for group in settling.clusters([(energy, 0.1), (exponent, 0.1)])]
    assert groups == [[0, 2], [1], [3]]


@pytest.mark.parametrize(
    ("model", "starts", "message"),
    [
        (TWO, [], r"`starts` must be a list of at least one State .*, got \[\]"),
        (TWO, vi.State(-1.0), r"`starts` must be a list .*; write starts=\[State"),
        (TWO, 3, "`starts` must be a list .*, got 3"),
        (TWO, [0.3], "`starts` must be a list .*, got 0.3; write State"),
        (TWO, [vi.State(0.1)], "`starts` lies beyond 'stop' by 0.1 m at time 0; start in front of"),
        (THREE, [vi.State(0.1)], "`starts` must have 2 coordinates"),
        (THREE, [vi.State([0.0, 9.0])], "lies beyond 'right'"),
    ],
)
def test_wrong_starts_are_refused(model, starts, message):
    with pytest.raises(ValueError, match=message):
        vi.attractors(model, starts)
