"""Attractors that coexist, and which starts lead to which."""

import itertools
import math

import numpy as np
import pytest
import xarray as xr

import vibroimpact as vi
from contents import names_of_starts
from designs import RARE, RESTS, TRANSIENTS, random_oscillator
from systems import THREE, TWINS
from vibroimpact.backends import ImpactWindow
from vibroimpact.coexistence import Attractor
from vibroimpact.coexistence.attractor import distinct_names
from vibroimpact.coexistence.final import final_motion
from vibroimpact.coexistence.measuring import Runner, cells_of
from vibroimpact.coexistence.settling import clusters
from vibroimpact.coexistence.striking import SAME, SettledMotion
from vibroimpact.motion import Motion
from vibroimpact.orbits import same_orbit
from vibroimpact.orbits.distance import Impacts
from vibroimpact.orbits.sticking import find_sticking_orbit

TWO = vi.ImpactOscillator(omega=3.0)  # a cycle and a sticking orbit
CYCLES = vi.ImpactOscillator(omega=1.45)  # period-1 impact-1 and period-3 impact-4
CHAOS = vi.ImpactOscillator(omega=3.0, restitution=0.9, gap=0.05)  # chaos and period-4 impact-3
PHASE, VELOCITY = np.linspace(0.0, 1.0, 41), np.linspace(0.0, 3.0, 41)


@pytest.fixture(scope="module")
def portrait():
    return vi.basins(TWO, phase=PHASE, velocity=VELOCITY)


def at(osc, phase, velocity):
    return vi.State(osc.gap, velocity, phase * osc.period)


def test_at_omega_3_a_cycle_coexists_with_a_motion_that_sticks_from_one_start_in_eight():
    cycle, sticking = vi.attractors(TWO)
    assert (cycle.name, sticking.name) == ("period-2 impact-2", "period-6 sticking")
    assert cycle.share + sticking.share == 1.0
    assert sticking.share == pytest.approx(1 / 8, abs=0.02)
    assert (cycle.status, sticking.status) == (vi.Status.CLOSED, vi.Status.STICKING)
    assert cycle.lyapunov < 0.0
    assert sticking.lyapunov == -math.inf


def test_a_finer_portrait_at_omega_3_says_the_same(portrait):
    assert portrait["attractor"].dims == ("phase", "velocity")
    assert portrait["attractor"].attrs["flag_meanings"] == "undecided period-2_impact-2 period-6_sticking"
    assert float(portrait["share"].sum()) == 1.0
    assert float(portrait["share"][1]) == pytest.approx(1 / 8, abs=0.01)
    counted = [(portrait["attractor"] == number).mean() for number in (0, 1)]
    np.testing.assert_array_equal(portrait["share"], counted)


def test_a_start_on_a_cycle_costs_some_600_steps(portrait):
    assert portrait.attrs["steps_computed"] / portrait["attractor"].size < 700


@pytest.mark.parametrize("osc", [TWO, CYCLES], ids=["sticking", "cycles"])
def test_every_impact_of_an_attractor_leads_to_it(osc):
    for known in vi.attractors(osc):
        starts = [at(osc, *hit) for hit in zip(known.phases, known.velocities, strict=True) if hit[1] > 1e-4]
        for found in (vi.attractors(osc, starts), vi.attractors(osc, [known.start])):
            assert [(one.name, one.share) for one in found] == [(known.name, 1.0)]
            np.testing.assert_allclose(found[0].velocities, known.velocities, rtol=0, atol=1e-9)


def test_cycles_are_those_that_newton_finds():
    for known in vi.attractors(CYCLES):
        orbits = vi.find_orbit(
            CYCLES, n_periods=known.n_periods, n_impacts=known.n_impacts, near=(known.phases[0], known.velocities[0])
        )
        np.testing.assert_allclose(known.velocities, orbits[0].velocities, rtol=0, atol=1e-11)
        np.testing.assert_allclose(known.phases, orbits[0].phases, rtol=0, atol=1e-11)
        assert known.lyapunov == pytest.approx(orbits[0].lyapunov, rel=1e-8)
        lost = 0.5 * (1 - CYCLES.restitution**2) * sum(v * v for v in orbits[0].velocities) / known.n_periods
        assert known.dissipation == pytest.approx(lost, rel=1e-9)
        assert (known.max_velocity, known.mean_velocity) == (max(known.velocities), np.mean(known.velocities))


def test_the_sticking_attractor_is_the_one_sticking_orbit():
    sticking = vi.attractors(TWO)[1]
    (orbit,) = find_sticking_orbit(TWO)
    assert sticking.n_periods == orbit.n_periods
    hardest = int(np.argmax(orbit.velocities))
    np.testing.assert_allclose(sticking.velocities, np.roll(orbit.velocities, -hardest), rtol=0, atol=1e-9)
    assert sticking.start == orbit.start


def test_a_start_and_the_same_start_one_period_later_share_their_attractor():
    for y, v, t in itertools.product((-1.0, -0.3), (-0.7, 0.4), (0.0, 0.9)):
        one, later = (vi.attractors(TWO, [vi.State(y, v, t + turns * TWO.period)])[0] for turns in (0, 1))
        assert (one.kind, one.n_periods, one.n_impacts) == (later.kind, later.n_periods, later.n_impacts)
        np.testing.assert_allclose(one.velocities, later.velocities, rtol=0, atol=1e-9)


def test_phase_0_and_phase_1_are_the_same_starts(portrait):
    np.testing.assert_array_equal(portrait["attractor"][0], portrait["attractor"][-1])


@pytest.mark.parametrize("osc", [TWO, CHAOS], ids=["sticking", "chaos"])
def test_a_finer_grid_keeps_what_becomes_of_the_starts_they_share(osc):
    fine = vi.basins(osc, phase=PHASE, velocity=VELOCITY[::2])
    coarse = vi.basins(osc, phase=PHASE[::4], velocity=VELOCITY[::4])
    np.testing.assert_array_equal(names_of_starts(fine)[::4, ::2], names_of_starts(coarse))
    np.testing.assert_array_equal(fine["status"][::4, ::2], coarse["status"])


STATES = {"displacement_1": np.linspace(-0.2, 0.2, 7), "velocity_1": np.linspace(-2.0, 2.0, 7)}


@pytest.mark.parametrize(
    ("model", "axes", "near"),
    [(TWO, {"phase": PHASE, "velocity": VELOCITY}, 0.0), (THREE, STATES, 1e-14)],
    ids=["one mass", "a system"],
)
def test_threads_change_no_bit_nor_does_the_order_of_axes_change_a_label(model, axes, near):
    first, second = axes
    plain, alone = (vi.basins(model, **axes, **more) for more in ({}, {"workers": 1}))
    xr.testing.assert_identical(alone, plain)
    turned = vi.basins(model, **dict(reversed(axes.items())), workers=1)
    assert turned["attractor"].dims == (second, first)
    xr.testing.assert_allclose(turned.transpose(first, ...), plain.transpose(first, ...), rtol=near, atol=near)
    assert turned.attrs == plain.attrs


def test_a_portrait_scales_with_force_and_gap():
    scaled = CHAOS.replace(amplitude=2.0, gap=2.0 * CHAOS.gap)
    one = vi.basins(CHAOS, phase=PHASE[::4], velocity=VELOCITY[::4])
    two = vi.basins(scaled, phase=PHASE[::4], velocity=2.0 * VELOCITY[::4])
    np.testing.assert_array_equal(one["attractor"], two["attractor"].values)
    np.testing.assert_array_equal(2.0 * one["max_velocity"], two["max_velocity"])
    np.testing.assert_array_equal(4.0 * one["dissipation"], two["dissipation"])


def test_the_attractor_of_a_start_is_the_motion_recognised_in_its_impacts(portrait):
    labels = names_of_starts(portrait)
    for i, j in itertools.product(range(3, 41, 9), range(0, 41, 8)):
        section = vi.impact_section(TWO, start=at(TWO, PHASE[i], VELOCITY[j]), sample_impacts=1500)
        assert vi.recognise(section).name.replace(" ", "_") == labels[i, j]


def test_states_in_front_of_the_stop_lead_where_their_impacts_lead():
    y, v = np.linspace(-2.0, 0.0, 5), np.linspace(-1.0, 1.0, 4)
    found = vi.basins(TWO, displacement=y, velocity=v, phase=0.25)
    assert found["attractor"].dims == ("displacement", "velocity")
    for i, j in itertools.product(range(5), range(4)):
        (one,) = vi.attractors(TWO, [vi.State(y[i], v[j], 0.25 * TWO.period)])
        assert one.name.replace(" ", "_") == names_of_starts(found)[i, j]


def test_a_portrait_marks_where_its_attractors_lie(portrait):
    cycle = vi.attractors(TWO)[0]
    np.testing.assert_allclose(portrait["point_phase"][0, :2], cycle.phases, rtol=0, atol=1e-9)
    np.testing.assert_allclose(portrait["point_velocity"][0, :2], cycle.velocities, rtol=0, atol=1e-9)
    assert int(portrait["point_phase"][0].count()) == 2
    look = vi.basins(TWO, displacement=[-1.0, -0.5], velocity=[0.0, 0.5], phase=0.25)
    there = names_of_starts(look)[0, 0].replace("_", " ")
    known = next(one for one in vi.attractors(TWO) if one.name == there)
    row = look.isel(attractor_id=int(look["attractor"][0, 0]))
    y, v = (row[name].dropna("point").values for name in ("point_displacement", "point_velocity"))
    assert len(y) == known.n_periods
    leads = vi.attractors(TWO, [vi.State(a, b, 0.25 * TWO.period) for a, b in zip(y, v, strict=True)])
    assert [one.name for one in leads] == [there]


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
    assert f"stable, but reached from none of them: {motions[-1].name}" in " ".join(
        str(vi.describe(osc, parameters=[])).split()
    )


@pytest.mark.long
def test_every_stable_orbit_of_one_impact_is_an_attractor():
    # 2,000 were tried once (seeds 1 and 7): all were found.
    random, orbits = np.random.default_rng(12), 0
    while orbits < 60:
        osc = random_oscillator(random, restitution=(0.2, 0.98), gap=(-0.8, 2.5))
        known = vi.find_orbit(osc, n_periods=int(random.integers(1, 17)))
        stable = [orbit for orbit in known if orbit.stable and orbit.admissible]
        found = [attractor for attractor in (vi.attractors(osc) if stable else []) if attractor.kind == "periodic"]
        for orbit in stable:
            assert any(same_orbit(attractor, orbit, tolerance=SAME) for attractor in found)
        orbits += len(stable)


def test_chaos_is_one_attractor_and_keeps_its_exponent():
    chaos, cycle = vi.attractors(CHAOS)
    assert (chaos.name, cycle.name) == ("chaotic", "period-4 impact-3")
    assert chaos.lyapunov > 0.2
    assert chaos.velocities == ()
    assert chaos.share + cycle.share == 1.0
    (again,) = vi.attractors(CHAOS, [chaos.start])
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
    portrait = vi.basins(osc, phase=PHASE[::20], velocity=VELOCITY[::20])
    assert set(names_of_starts(portrait).ravel()) == {name.replace(" ", "_")}
    if cycle.n_impacts == 7:  # the hardest hits are those of the motion from rest
        final = final_motion(Runner(), osc.cells({}), ImpactWindow(1000, 400))
        assert cycle.max_velocity == pytest.approx(final.measured.indices["max_velocity"], rel=1e-9)


@pytest.mark.parametrize("hardest", RESTS)
def test_a_rest_that_rounding_repeats_is_no_attractor(hardest):
    (cycle,) = vi.attractors(RESTS[hardest])
    assert (cycle.name, cycle.share) == ("period-1 impact-1", 1.0)
    assert cycle.max_velocity == pytest.approx(hardest, abs=1e-3)
    portrait = vi.basins(RESTS[hardest], phase=PHASE[::4], velocity=VELOCITY[1::8])
    assert set(names_of_starts(portrait).ravel()) == {"period-1_impact-1"}


def test_initial_conditions_have_the_same_attractors_in_a_list_and_in_a_portrait():
    random, tried = np.random.default_rng(8), 0
    while tried < 2:
        osc = random_oscillator(random)
        portrait = vi.basins(osc, phase=[0.1, 0.45, 0.8], velocity=[0.2, 1.1])
        if not {"chaotic", "intermittent_sticking"} & set(names_of_starts(portrait).ravel()):
            continue
        tried += 1
        starts = [at(osc, float(phase), float(v)) for phase in portrait["phase"] for v in portrait["velocity"]]
        listed = vi.attractors(osc, starts)
        assert [attractor.name.replace(" ", "_") for attractor in listed] == sorted(
            set(names_of_starts(portrait).ravel()) - {"undecided"},
            key=lambda name: -(names_of_starts(portrait) == name).sum(),
        )
        np.testing.assert_array_equal(portrait["share"], [attractor.share for attractor in listed])


def test_a_chaotic_attractor_still_is_so_1e5_impacts_later():
    random = np.random.default_rng(14)
    oscillators = [random_oscillator(random) for _ in range(60)]
    from_rest = Runner().measure(cells_of(oscillators))
    chaotic = [osc for osc, motion in zip(oscillators, from_rest, strict=True) if motion.kind == "chaotic"]
    assert chaotic
    for osc in chaotic:
        for attractor in (found for found in vi.attractors(osc) if found.kind == "chaotic"):
            section = vi.impact_section(osc, start=attractor.start, transient_impacts=96_000, sample_impacts=4000)
            assert not vi.recognise(section, longest=512).n_periods


def test_cycles_approached_slowly_are_waited_for():
    osc = vi.ImpactOscillator(omega=5.0)  # within 1e-10 V after 3000 impacts
    cycle, sticking = vi.attractors(osc, [at(osc, 0.3, 1.0), at(osc, 0.1, 1.7), at(osc, 0.5, 0.001)])
    assert (cycle.name, sticking.name) == ("period-6 impact-4", "period-3 sticking")


def quiet(name, **changes):
    osc = vi.ImpactOscillator().replace(**changes)
    (found,) = vi.attractors(osc)
    assert (found.name, found.share) == (name, 1.0)
    assert math.isnan(found.mean_velocity)
    (again,) = vi.attractors(osc, [found.start])
    assert again.name == name
    return found


def test_behind_a_wide_gap_the_mass_never_hits():
    osc = vi.ImpactOscillator(omega=3.0, gap=30.0)
    found = quiet("no impact", omega=3.0, gap=30.0)
    orbit = vi.simulate(osc, start=found.start, periods=50)
    assert float(orbit["displacement"].max()) == pytest.approx(osc.steady_amplitude, rel=1e-3)
    assert float(orbit["displacement"][-1]) == pytest.approx(found.start.displacement, abs=1e-10)


def test_a_mass_pressed_too_hard_stays_for_ever():
    quiet("permanently in contact", gap=-3.0)


@pytest.mark.parametrize("gap", [-1.0, 0.0, 1.0])
def test_unforced_every_start_comes_to_rest(gap):
    assert quiet("at rest", amplitude=0.0, gap=gap).start == vi.State(min(0.0, gap))


def test_without_rebound_every_start_sticks():
    (found,) = vi.attractors(vi.ImpactOscillator(restitution=0.0))
    assert (found.name, found.n_impacts, found.share) == ("period-1 sticking", 1, 1.0)
    assert len(found.velocities) == 1


def test_without_any_loss_nothing_attracts():
    osc = vi.ImpactOscillator(omega=3.0, restitution=1.0, damping=0.0)
    starts = [at(osc, phase, speed) for phase, speed in ((0.2, 1.0), (0.7, 2.0))]
    assert vi.attractors(osc, starts) == []
    found = vi.basins(osc, phase=[0.2, 0.7], velocity=[1.0, 2.0])
    assert (found["attractor"] == -1).all()
    assert found.sizes["attractor_id"] == 0


def test_a_start_out_of_budget_is_undecided_and_says_so():
    found = vi.basins(RARE, phase=[0.2, 0.7], velocity=[1.0, 2.0], tolerances=vi.Tolerances(steps_per_impact=1))
    assert (found["attractor"] == -1).all()
    assert (found["status"] == vi.Status.BUDGET).all()


@pytest.mark.parametrize(
    ("model", "axes"),
    [
        (TWO, {"phase": np.linspace(0, 1, 300), "velocity": np.linspace(0.1, 3, 300)}),
        (TWINS, {"displacement": np.linspace(-0.05, 0.05, 80), "velocity": np.linspace(-1.0, 1.0, 80)}),
    ],
    ids=["one mass", "a system"],
)
def test_a_sweep_that_is_stopped_returns_what_it_has(model, axes):
    news = []

    def stop(done, total, partial):
        news.append((done, total, partial["status"].shape))
        return False

    found = vi.basins(model, **axes, workers=1, progress=stop)
    done, total, shape = news[0]
    side = len(axes["velocity"])
    assert 0 < done < total == side**2
    assert shape == (side, side)
    interrupted = found["status"] == vi.Status.INTERRUPTED
    assert (found["attractor"].values[interrupted] == -1).all()
    assert float(found["share"].sum()) == pytest.approx(1.0 - float(interrupted.mean()), abs=1e-12)
    assert 0.0 < float(interrupted.mean()) < 1.0


def test_the_witness_finds_the_same_attractors():
    starts = [at(CYCLES, 0.3, 1.0), at(CYCLES, 0.0, 2.2)]
    fast, witness = (
        vi.attractors(CYCLES, starts, backend=name, transient_impacts=60, sample_impacts=80)
        for name in ("cpu", "reference")
    )
    assert [one.name for one in fast] == [one.name for one in witness]
    for one, other in zip(fast, witness, strict=True):
        np.testing.assert_allclose(one.velocities, other.velocities, rtol=0, atol=1e-8)


def test_cycles_are_the_same_whichever_of_their_impacts_they_begin_with():
    one = Impacts([0.1, 0.5, 0.999999999], [2.0, 1.0, 2.0])
    assert same_orbit(one, Impacts(np.roll(one.phases, 1), np.roll(one.velocities, 1)), tolerance=SAME)
    assert same_orbit(one, Impacts([0.1, 0.5, 0.0], one.velocities), tolerance=SAME)
    assert not same_orbit(one, Impacts([0.1, 0.500001, 0.0], one.velocities), tolerance=SAME)
    assert not same_orbit(one, Impacts(one.phases[:2], one.velocities[:2]), tolerance=SAME)


def test_chaos_is_told_apart_by_where_its_impacts_lie():
    whole = vi.impact_section(vi.ImpactOscillator(omega=2.8), sample_impacts=8000)
    phases, velocities, stops = whole["phase"].values, whole["velocity"].values, np.zeros(4000, int)
    first = SettledMotion(phases[:4000], velocities[:4000], stops, vi.State(0.0), 0.1, 1.0)
    assert first.visited(phases[4000:], velocities[4000:], stops)
    assert not first.visited((phases[4000:] + 0.3) % 1.0, velocities[4000:], stops)


def test_values_part_where_any_column_leaves_a_gap():
    energy, exponent = np.array([1.0, 1.0, 1.0, 5.0]), np.array([0.0, 0.3, 0.01, 0.0])
    groups = [group.tolist() for group in clusters([(energy, 0.1), (exponent, 0.1)])]
    assert groups == [[0, 2], [1], [3]]


def test_attractors_of_one_name_are_told_apart_by_letters():
    assert distinct_names([Attractor("chaotic")] * 2 + [Attractor("no_impact")]) == [
        "chaotic a",
        "chaotic b",
        "no impact",
    ]


GRID = {"phase": [0.1, 0.2], "velocity": [0.5, 1.0]}


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        ({"phase": [0.1, 0.2]}, r"the axes must be \(displacement, velocity\), .* or \(phase, velocity\), got `phase`"),
        ({}, "the axes must be .*, got no axis"),
        (GRID | {"displacement": [0.0]}, "the axes must be .*, got `phase`, `velocity`, `displacement`"),
        (GRID | {"gap": [0.0]}, "unknown coordinate 'gap'; choose from displacement, velocity, phase"),
        (GRID | {"phase": [0.1, 1.2]}, "`phase` must be between 0 and 1, got 1.2; give"),
        (GRID | {"velocity": [-0.1, 1.2]}, "`velocity` must be .*>= 0, got -0.1; an impact"),
        (GRID | {"velocity": [1.0, 0.5]}, "`velocity` must increase strictly, .* from 1 to 0.5"),
        (GRID | {"velocity": []}, r"`velocity` must be a one-dimensional, .* list of numbers, got \[\]"),
        (GRID | {"velocity": "fast"}, "`velocity` must be a one-dimensional, .* list of numbers, got 'fast'"),
        (
            GRID | {"velocity": [0.5, math.nan]},
            "`velocity` must be a finite number .*, got nan",
        ),
        (
            {"displacement": [-1.0, 0.5], "velocity": [0.0, 1.0]},
            "the axes must stay in front of all stops, but displacement = 0.5 and velocity = 0 lies beyond 'stop' by",
        ),
        (
            {"displacement": [-1.0, 0.0], "velocity": [0.0], "phase": 1.0},
            "`phase` must be .* less than 1, got 1.0",
        ),
        (GRID | {"workers": 0}, "`workers` must be a whole number >= 1, got 0"),
        (GRID | {"sample_impacts": 0}, "`sample_impacts` must be a whole number >= 1, got 0"),
        (
            GRID | {"backend": "fixed-step"},
            "`backend` must be one that computes n_periods and n_impacts, got",
        ),
    ],
)
def test_a_wrong_request_for_basins_is_refused(axes, message):
    with pytest.raises(ValueError, match=message):
        vi.basins(TWO, **axes)


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
