"""Attractors and basins of systems: which motions coexist, and which initial conditions lead to which."""

import json
import math

import numpy as np
import pytest

import vibroimpact as vi
from codes import Witness
from contents import names_of_starts
from systems import THREE, TWINS, beside_its_centre, free_pair, linear, one_mass, random_pair, two_sided
from systems import system as of
from vibroimpact.backends import ImpactWindow
from vibroimpact.backends.reference.systems import follow
from vibroimpact.coexistence import settling, striking
from vibroimpact.coexistence.losses import lasting_stops
from vibroimpact.coexistence.measuring import Runner, spread_cells
from vibroimpact.motion import MotionClass
from vibroimpact.orbits import same_orbit
from vibroimpact.report import sentences_of

pytestmark = pytest.mark.usefixtures("modal_engine")


STATES = {"displacement_1": np.linspace(-0.2, 0.2, 7), "velocity_1": np.linspace(-2.0, 2.0, 7)}


def mirrored(one, other):
    """Whether a cycle of a two-sided oscillator is another one, mirrored and half a period later."""
    swapped = tuple({"above": "below", "below": "above"}[stop] for stop in other.stops)
    later = vi.coexistence.Attractor(
        "periodic", velocities=other.velocities, phases=tuple((p + 0.5) % 1 for p in other.phases)
    )
    turns = [tuple(np.roll(swapped, shift).tolist()) for shift in range(len(swapped))]
    return one.stops in turns and same_orbit(one, later, tolerance=1e-9)


def test_a_motion_and_its_mirror_image_are_two_attractors():
    found = vi.attractors(TWINS)
    one, other = (attractor for attractor in found if attractor.kind == "periodic")
    assert one.name == other.name == "period-1 impact-2"
    assert mirrored(one, other)
    assert not same_orbit(one, other, tolerance=1e-3)
    assert sum(attractor.share for attractor in found) == 1.0
    (symmetric,) = (found for found in vi.attractors(two_sided(2.0, 0.6, 0.5)) if found.kind == "periodic")
    assert symmetric.stops == ("above", "below")
    assert mirrored(symmetric, symmetric)
    assert symmetric.velocities[0] == pytest.approx(1.01091975000998629752895, rel=1e-13)
    assert symmetric.phases[0] == pytest.approx(0.30697182627669859292, rel=1e-12)


@pytest.mark.parametrize(("omega", "number"), [(0.8, 2), (0.9, 1)])
def test_chaos_is_told_from_its_mirror_image_until_both_merge(omega, number):
    """After a pitchfork each chaotic attractor strikes one of the stops harder, for good; after the crisis neither."""
    model = two_sided(omega, 0.85, 0.2)
    found = vi.attractors(model)
    assert [one.kind for one in found] == ["chaotic"] * number
    assert sum(one.share for one in found) == 1.0
    assert all(one.share > 0.4 for one in found)
    for transient in (0, 10_000) if number == 2 else ():
        samples = [
            vi.impact_section(model, start=one.start, transient_impacts=transient, sample_impacts=5000) for one in found
        ]
        above, below = ([float(hits["velocity"][hits["stop"] == stop].mean()) for hits in samples]
                        for stop in ("above", "below"))  # fmt: skip
        assert above == pytest.approx(below[::-1], rel=2e-3)
        assert above != pytest.approx(below, rel=0.01)
    for one in found if number == 2 else ():
        start = one.start.displacement, one.start.velocity, one.start.time
        hits = Witness().impacts(model, *start, number=400)
        mean = [float(hits["velocity"][hits["stop"] == stop].mean()) for stop in (0, 1)]
        assert mean == pytest.approx([0.4207, 0.4286][:: 1 if mean[0] < mean[1] else -1], rel=3e-3)
        assert (mean[0] > mean[1]) == (above[found.index(one)] > below[found.index(one)])


def test_initial_conditions_that_mirror_each_other_lead_to_chaos_that_does():
    model = two_sided(0.8, 0.85, 0.2)
    starts = [vi.State(y, v, 0.3) for y, v in ((0.1, 0.2), (-0.05, 0.7), (0.0, -0.4))]
    images = [vi.State(-np.array(s.displacement), -np.array(s.velocity), 0.3 + model.period / 2) for s in starts]
    both = [vi.attractors(model, [start, image]) for start, image in zip(starts, images, strict=True)]
    assert all([one.share for one in found] == [0.5, 0.5] for found in both)


def test_twins_have_basins_that_are_mirror_images():
    y, v = np.linspace(-0.05, 0.05, 16), np.linspace(-1.0, 1.0, 15)
    here, there = (vi.basins(TWINS, displacement=y, velocity=v, phase=phase) for phase in (0.0, 0.5))
    at = [[vi.State(*(float(row[f"point_{axis}"][0]) for axis in ("displacement", "velocity")), time) for row in
           (found.isel(attractor_id=number) for number in range(2))] for found, time in
          ((here, 0.0), (there, 0.5 * TWINS.period))]  # fmt: skip
    first, second = ([vi.attractors(TWINS, [start])[0] for start in starts] for starts in at)
    image = [next(j for j in range(2) if mirrored(first[i], second[j])) for i in range(2)]
    assert sorted(image) == [0, 1]
    mapped = np.array([*image, 2, -1])[here["attractor"].values]
    np.testing.assert_array_equal(mapped, there["attractor"].values[::-1, ::-1])


@pytest.mark.parametrize(("omega", "gap", "restitution"), [(3.0, 0.0, 0.8), (1.45, 0.0, 0.8), (0.9, 0.3, 0.7)])
def test_one_coordinate_and_one_stop_have_the_basins_of_the_oscillator(omega, gap, restitution):
    osc = vi.ImpactOscillator(omega=omega, gap=gap, restitution=restitution)
    impacts = {"phase": np.linspace(0.0, 1.0, 15), "velocity": np.linspace(0.0, 3.0, 12)}
    states = {"displacement": np.linspace(gap - 2.0, gap, 9), "velocity": np.linspace(-1.0, 1.0, 8), "phase": 0.3}
    for plane in (impacts, states):
        portrait, as_system = vi.basins(osc, **plane), vi.basins(one_mass(osc), **plane)
        np.testing.assert_array_equal(names_of_starts(portrait), names_of_starts(as_system))
        np.testing.assert_array_equal(portrait["share"], as_system["share"])
        for name in ("max_velocity", "mean_velocity", "dissipation"):
            np.testing.assert_allclose(portrait[name], as_system[name], rtol=1e-6, atol=0)
        np.testing.assert_allclose(portrait["max_velocity"], as_system["max_velocity"], rtol=1e-9, atol=0)
    mine, theirs = vi.attractors(one_mass(osc)), vi.attractors(osc)
    assert [(one.name, one.share) for one in mine] == [(one.name, one.share) for one in theirs]


def test_a_decoupled_mode_changes_no_label():
    plain = two_sided(0.8, 0.6, 0.5)
    stops = [stop.replace(direction=[float(stop.direction[0]), 0.0]) for stop in plain.stops]
    more = of(np.diag([1.0, 2.0]), np.diag([0.05, 0.3]), np.diag([1.0, 5.0]), 0.8, stops, {1: [1.0, 0.4]})
    y, v = np.linspace(-0.5, 0.5, 9), np.linspace(-1.0, 1.0, 8)
    alone = vi.basins(plain, displacement=y, velocity=v, phase=0.2)
    assert {"period-1_impact-4", "period-1_impact-2"} == set(names_of_starts(alone).ravel())
    begun = vi.State([0.0, 0.3], [0.0, -0.7], 0.2 * plain.period)
    beside = vi.basins(more, displacement_0=y, velocity_0=v, start=begun)
    np.testing.assert_array_equal(names_of_starts(alone), names_of_starts(beside))
    np.testing.assert_allclose(alone["max_velocity"], beside["max_velocity"], rtol=1e-12)


def test_permuted_coordinates_and_stops_change_no_label():
    swap = np.array([[0.0, 1.0], [1.0, 0.0]])
    turned = [stop.replace(direction=swap @ stop.direction) for stop in reversed(THREE.stops)]
    matrices = (swap @ matrix @ swap for matrix in (THREE.mass, THREE.damping, THREE.stiffness))
    permuted = of(*matrices, THREE.omega, turned, {1: [0.0, 1.0]})
    portrait = vi.basins(THREE, **STATES)
    there = vi.basins(permuted, **{name.replace("1", "0"): values for name, values in STATES.items()})
    np.testing.assert_array_equal(names_of_starts(portrait), names_of_starts(there))
    np.testing.assert_allclose(portrait["max_velocity"], there["max_velocity"], rtol=1e-12)


def harvester():
    """Return a two-sided pair: a driven mass on a spring, and a free one under a weight between two stops on it."""
    force = vi.Force(omega=math.pi, harmonics={1: [1.0, 0.0]}, constant=[0.0, -0.12201 * 0.15])
    stops = [vi.Stop(direction=[sign, -sign], gap=0.175, restitution=0.5, name=name) for sign, name in
             ((1, "top"), (-1, "bottom"))]  # fmt: skip
    return vi.ImpactSystem(
        mass=np.diag([1.0, 0.15]),
        damping=np.diag([0.2, 0.0]),
        stiffness=np.diag([math.pi**2, 0.0]),
        force=force,
        stops=stops,
    )


@pytest.fixture
def solutions(monkeypatch):
    """Return the list to which every cycle that is solved for is added."""
    made, solve = [], striking.settled_orbit
    monkeypatch.setattr(striking, "settled_orbit", lambda *given: made.append(given[1:]) or solve(*given))
    return made


def test_a_cycle_of_many_initial_conditions_is_followed_and_solved_for_once(solutions, monkeypatch):
    # Each cell's mean is one over the impacts that its own round kept, also where its cycle was closed early.
    followed, told, follow_on = [], [], striking.follow
    monkeypatch.setattr(striking, "follow", lambda *given: followed.append(told[-1]) or follow_on(*given))
    grid = {"phase": np.linspace(0.0, 1.0, 15), "velocity": np.linspace(0.0, 1.0, 15)}
    portrait = vi.basins(
        harvester(), **grid, stop="top", progress=lambda done, total, partial: told.append((done, total))
    )
    assert portrait["attractor"].attrs["flag_meanings"] == "undecided period-1_impact-5"
    assert (portrait["attractor"] == 0).all()
    assert len(solutions) == len(followed) == 1
    # Not all is done before the attractors are known.
    assert all(done < total == 225 for done, total in followed)
    assert told[-1] == (225, 225)
    assert [done for done, _ in told] == sorted(done for done, _ in told)


@pytest.mark.long(but=4)
@pytest.mark.parametrize("seed", range(0, 24, 3))
def test_no_cycle_is_solved_for_twice(seed, solutions):
    motions = vi.attractors(random_pair(seed))
    assert len(solutions) == sum(attractor.kind == "periodic" for attractor in motions)


def test_an_initial_condition_outside_the_tolerance_joins_the_known_cycle_unsolved(solutions, monkeypatch):
    monkeypatch.setattr(striking, "_members", lambda settled, left, at, seen: left == at)
    starts = [vi.State([0.0, y]) for y in (-0.05, -0.1, 0.05)]
    (found,) = vi.attractors(harvester(), starts)
    assert found.share == 1.0
    assert len(solutions) == 1


@pytest.mark.parametrize("seed", [0, 4, 10, 19, 22])
def test_every_periodic_attractor_is_a_stable_admissible_orbit(seed):
    # 100 designs were tried once: all were.
    system = random_pair(seed)
    motions = vi.attractors(system)
    assert sum(attractor.share for attractor in motions) == 1.0
    for attractor in (one for one in motions if one.kind == "periodic"):
        p = len(attractor.velocities)
        hits = vi.impact_section(system, start=attractor.start, transient_impacts=0, sample_impacts=p)
        assert tuple(hits["stop"].values) == attractor.stops
        times = hits["time"].values - math.floor(float(hits["time"][0]) / system.period) * system.period
        orbits = vi.find_orbit(system, n_periods=attractor.n_periods, stops=attractor.stops, near=times.tolist())
        orbit = next(one for one in orbits if same_orbit(one, attractor, tolerance=1e-9))
        assert orbit.stable
        assert orbit.admissible
        assert orbit.n_periods == attractor.n_periods
        assert attractor.lyapunov == pytest.approx(orbit.lyapunov, rel=1e-9)
        lost = [0.5 * impulse * v * (1 - r) for impulse, v, r in zip(
            orbit.impulses, orbit.velocities, (next(s.restitution for s in system.stops if s.name == name)
                                               for name in orbit.stops), strict=True)]  # fmt: skip
        assert attractor.dissipation == pytest.approx(sum(lost) / orbit.n_periods, rel=1e-9)
        (again,) = vi.attractors(system, [attractor.start])
        assert again.share == 1.0
        assert same_orbit(again, attractor, tolerance=1e-9)


@pytest.mark.long
def test_the_witness_leads_to_the_same_attractors():
    plane = {name: values[::3] for name, values in STATES.items()}
    labels, tried = names_of_starts(vi.basins(THREE, **plane)), set()
    for i, y in enumerate(plane["displacement_1"]):
        for j, v in enumerate(plane["velocity_1"]):
            motion = follow(linear(THREE), [0.0, y], [0.0, v], 0.0, impacts=600, most_periods=150)
            phases = [event.time / THREE.period for event in motion.impacts if event.time > 138 * THREE.period]
            label = {0: "no_impact", 36: "period-2_impact-6", 32: "period-3_impact-8"}.get(len(phases), "transient")
            assert label in (labels[i, j], "transient")
            tried.add(label)
    assert {"period-2_impact-6", "period-3_impact-8"} <= tried


def test_impacts_on_a_stop_are_the_nearest_states_that_strike_it():
    begun = vi.State([0.1, 0.05], [0.3, -0.2])
    plane = {"phase": np.array([0.1, 0.6]), "velocity": np.array([0.4, 1.5, 2.5])}
    portrait = vi.basins(THREE, **plane, stop="left", start=begun)
    stop = THREE.stops[1]
    towards = np.linalg.solve(THREE.mass, stop.direction)
    towards = towards / (stop.direction @ towards)
    for i, phase in enumerate(plane["phase"]):
        for j, v in enumerate(plane["velocity"]):
            q = np.array(begun.displacement) + (stop.gap - stop.direction @ begun.displacement) * towards
            rate = np.array(begun.velocity) + (v - stop.direction @ begun.velocity) * towards
            start = vi.State(q, rate, phase * THREE.period)
            first = vi.impact_section(THREE, start=start, transient_impacts=0, sample_impacts=1)
            assert str(first["stop"][0].item()) == "left"
            assert float(first["velocity"][0]) == pytest.approx(v, rel=1e-12)
            (one,) = vi.attractors(THREE, [start])
            assert one.name.replace(" ", "_") == names_of_starts(portrait)[i, j]


def test_a_number_of_starts_are_impacts_that_attractors_are_looked_for_from():
    osc = vi.ImpactOscillator(omega=1.45, gap=0.2)
    how = {"indices": ("max_velocity",), "transient_impacts": 20, "sample_impacts": 60}
    sweep = vi.parameter_map(osc, start=9, gap=[0.1, 0.2], early_closing=False, **how)
    as_system = vi.parameter_map(one_mass(osc), start=9, stop_1_gap=[0.1, 0.2], **how)
    np.testing.assert_allclose(sweep["max_velocity"].values, as_system["max_velocity"].values, rtol=1e-9)
    several = vi.parameter_map(THREE, start=5, omega=[THREE.omega], **how)
    assert several.sizes["start"] == 5
    assert (
        "4 impacts at phases 0 to 1 and velocities 0 to 4 V, on all stops in turn" in several.attrs["initial_condition"]
    )


def test_a_motion_clear_of_the_stops_is_the_steady_one():
    (quiet,) = (one for one in vi.attractors(THREE) if one.kind == "no_impact")
    motion = vi.simulate(THREE, start=quiet.start, periods=7, samples_per_period=4)
    np.testing.assert_allclose(motion["displacement"][-1], quiet.start.displacement, rtol=0, atol=1e-12)
    assert float(motion["clearance"].min()) > 0.0


def test_a_portrait_says_what_holds_the_other_coordinates_and_comes_back_from_disk(tmp_path):
    begun = vi.State([0.1, 0.0], [0.0, 0.2], 0.25 * THREE.period)
    portrait = vi.basins(THREE, displacement_0=[-0.1, 0.1], velocity_1=[-1.0, 0.5], start=begun)
    assert portrait["attractor"].dims == ("displacement_0", "velocity_1")
    assert portrait["displacement_0"].attrs == {
        "long_name": "displacement of coordinate 0",
        "units": "m",
        "symbol": "q_0",
    }
    assert json.loads(portrait.attrs["arguments"])["phase"] == pytest.approx(0.25)
    assert vi.load(vi.save(portrait, tmp_path / "basins.zarr")).identical(portrait)
    axes = vi.plotting.basin_portrait(portrait)
    assert axes.get_xlabel() == r"displacement of coordinate 0 $q_\mathrm{0}$ [m]"
    assert axes.get_ylabel() == r"velocity of coordinate 1 $\dot q_\mathrm{1}$ [m/s]"
    assert "others of q = (0.1, 0) m, q' = (0, 0.2) m/s" in axes.get_title().replace("\n", " ")
    assert r"\psi/T$ = 0.25" in axes.get_title()


def test_cycles_and_sticking_of_the_bouncing_ball_are_found_by_the_same_call():
    ball = vi.models.bouncing_ball()
    motions = vi.attractors(ball)
    assert sum(one.share for one in motions) == 1.0
    assert all(one.stops[:1] == ("table",) for one in motions if one.n_periods)


PLANE = {"displacement_0": [0.0, 0.1], "velocity_1": [0.0, 0.1]}


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        ({"displacement_2": [0.0]}, "unknown coordinate 'displacement_2'; choose from displacement_0, velocity_0"),
        ({"displacement_0": [0.0, 0.1]}, "the axes must be two of displacement_0, .*, got `displacement_0`"),
        (PLANE | {"velocity_0": [0.0]}, "the axes must be two of .*, got `displacement_0`, `velocity_1`, `velocity_0`"),
        (PLANE | {"start": vi.State(0.1)}, "`start` must be a State of 2 coordinates, got State"),
        (PLANE | {"stop": "left"}, r"`stop` applies only to the axes \(phase, velocity\)"),
        ({"phase": [0.1, 0.2], "velocity": [1.0]}, "`stop` must name the stop that is struck: right, left"),
        ({"phase": [0.1], "velocity": [1.0], "stop": "up"}, "unknown `stop` 'up'|`stop` must be .* 'up'"),
        ({"phase": [0.1], "velocity": [-1.0], "stop": "left"}, "`velocity` must be .*>= 0, got -1"),
        (
            {"displacement_1": [0.0, 9.0], "velocity_1": [0.0]},
            "displacement_1 = 9 and velocity_1 = 0 lies beyond 'right'",
        ),
        (PLANE | {"backend": "fixed-step"}, "`backend` must be one that computes n_periods and n_impacts"),
    ],
)
def test_a_wrong_request_is_refused_in_one_sentence(axes, message):
    with pytest.raises(ValueError, match=message):
        vi.basins(THREE, **axes)


def test_the_witness_finds_the_attractors_of_a_mass_between_two_stops():
    starts, few = [vi.State(0.0), vi.State(0.0, -1.0)], {"transient_impacts": 60, "sample_impacts": 60, "workers": 1}
    ours, theirs = (vi.attractors(TWINS, starts, backend=name, **few) for name in ("cpu", "reference"))
    assert [(one.name, one.share, one.stops) for one in ours] == [(one.name, one.share, one.stops) for one in theirs]
    for one, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(one.velocities, other.velocities, rtol=1e-9)


def test_a_system_without_stops_is_refused_but_has_a_map():
    free = of(1.0, 0.1, 1.0, 2.0, [], {1: 1.0})
    with pytest.raises(ValueError, match="`osc` must have a stop"):
        vi.attractors(free)
    sweep = vi.parameter_map(free, omega=[2.0], indices=("n_periods", "max_velocity"), sample_impacts=10)
    assert sweep["status"].values.tolist() == [vi.Status.NO_IMPACT]


@pytest.mark.parametrize(("damping", "name"), [(0.1, "at rest"), (0.0, "no impact")])
def test_impacts_that_nothing_drives_die_out(damping, name):
    motions = vi.attractors(of(1.0, damping, 1.0, 2.0, [vi.Stop(direction=1, gap=0.5)]))
    assert [one.name for one in motions] == [name]


def between_walls(restitution, damping=0.0, spring=0.0, gaps=(1.0, 1.0)):
    sides = zip((1, -1), gaps, restitution, strict=True)
    walls = [vi.Stop(direction=sign, gap=gap, restitution=r) for sign, gap, r in sides]
    return of(1.0, damping, spring, 1.0, walls)


def test_a_mass_that_bounces_between_elastic_walls_for_ever_is_one_of_a_continuum():
    walls = between_walls((1.0, 1.0))
    hits = vi.impact_section(walls, start=vi.State(0.0, 1.0), transient_impacts=0)
    np.testing.assert_allclose(hits["velocity"], 1.0, rtol=1e-12)
    np.testing.assert_allclose(np.diff(hits["time"]), 2.0, rtol=1e-9)
    assert vi.attractors(walls) == []
    portrait = vi.basins(walls, displacement=[-0.5, 0.5], velocity=[0.0, 1.0])
    assert portrait["attractor"].values.tolist() == [[0, -1], [0, -1]]  # what is at rest stays so
    verdict = " ".join(str(vi.describe(walls, parameters=[])).split())
    assert "100 %: motions of constant energy, periodic or not, each one of a continuum" in verdict
    assert "no impacts from rest, but 100 % of the initial conditions keep the energy with which they hit" in verdict
    assert "from any of" not in verdict


def test_a_weight_on_an_undamped_spring_stop_jumps_for_ever():
    g, k = 9.81, 1000.0
    weight = of(1.0, 0.0, 0.0, 1.0, [vi.Stop(direction=1, gap=1.0, stiffness=k)], constant=[g])
    assert vi.attractors(weight) == []
    assert vi.attractors(weight, [vi.State(0.0)]) == []
    section = vi.impact_section(weight, sample_impacts=2000)
    speed, rate = math.sqrt(2.0 * g), math.sqrt(k)
    period = 2.0 * speed / g + 2.0 / rate * (math.pi - math.atan(speed * rate / g))
    np.testing.assert_allclose(section["velocity"], speed, rtol=1e-9)
    np.testing.assert_allclose(np.diff(section["time"]), period, rtol=1e-9)
    assert f"hits at 4.43 m/s on stop_1 every {period:.4g} s; nothing drives them" in sentences_of(section)[0]
    verdict = " ".join(str(vi.describe(weight, parameters=[])).split())
    assert "from rest undecided: impacts lose no energy" in verdict
    assert "no impact," not in verdict


@pytest.mark.parametrize(
    "stop", [{"restitution": 0.8}, {"stiffness": 1000.0, "damping": 30.0}, {"stiffness": 1000.0, "damping": 0.0}]
)
def test_a_weight_that_a_stop_or_a_damper_brakes_comes_to_rest_on_it(stop):
    drag = 0.0 if stop.get("damping") != 0.0 else 3.0
    weight = of(1.0, drag, 0.0, 1.0, [vi.Stop(direction=1, gap=1.0, **stop)], constant=[9.81])
    (found,) = vi.attractors(weight, [vi.State(0.0), vi.State(0.5, 2.0)])
    assert (found.name, found.share) == ("at rest", 1.0)
    assert found.start.displacement == pytest.approx((1.0 + 9.81 / stop.get("stiffness", math.inf),), abs=1e-6)


def test_what_hits_an_elastic_wall_in_front_of_a_lossy_one_is_undecided_unless_damping_brakes_it():
    slow, between, fast = (vi.State(0.0, speed) for speed in (0.8, 1.2, 3.0))
    lossy = between_walls((0.8, 1.0), spring=1.0, gaps=(1.5, 1.0))
    assert [(one.name, one.share) for one in vi.attractors(lossy, [slow])] == [("no impact", 1.0)]
    assert vi.attractors(lossy, [between, fast]) == []
    for damped in (between_walls((0.8, 1.0), 0.1, 1.0), between_walls((1.0, 1.0), 0.1, 1.0)):
        assert [(one.name, one.share) for one in vi.attractors(damped, [slow, between, fast])] == [("at rest", 1.0)]


def test_an_undamped_mode_between_elastic_walls_leaves_the_attractors_of_another_one():
    bar = vi.Stop(direction=[0, 1], gap=0.1, name="bar")
    walls = [vi.Stop(direction=[sign, 0], gap=0.5, restitution=1.0) for sign in (1, -1)]
    both = of(np.eye(2), np.diag([0.0, 0.1]), np.eye(2), 2.0, [bar, *walls], {1: [0.0, 1.0]})
    alone = of(1.0, 0.1, 1.0, 2.0, [bar.replace(direction=1)], {1: 1.0})
    swings, bounces = vi.State([0.3, 0.0], [0.2, 0.0]), vi.State([0.3, 0.0], [1.0, 0.0])
    (truth,) = vi.attractors(alone, [vi.State(0.0)])
    (found,) = vi.attractors(both, [vi.State([0.0, 0.0]), swings, bounces, bounces])
    assert (found.name, found.share) == (truth.name, 0.5)
    assert found.velocities == pytest.approx(truth.velocities, rel=1e-6)


@pytest.mark.parametrize("seed", range(60))
def test_energy_stays_where_a_stop_can_be_struck_for_ever(seed):
    """Held to the energy after an impulse on a stop, of systems of which damping reaches some modes only."""
    rng = np.random.default_rng([38, seed])
    n = int(rng.integers(1, 4))
    basis = np.linalg.qr(rng.normal(size=(n, n)))[0]
    squares = rng.uniform(0.5, 4.0, n) * (rng.random(n) < 0.8)
    rates = rng.uniform(0.05, 0.2, n) * (rng.random(n) < 0.5)
    aims = np.eye(n)[rng.integers(n)] if rng.random() < 0.6 else np.ones(n) / n**0.5
    kind = {"restitution": rng.choice([1.0, 1.0, 0.7])} if rng.random() < 0.5 else {
        "stiffness": 30.0, "damping": rng.choice([0.0, 0.0, 1.0])}  # fmt: skip
    stops = [vi.Stop(direction=sign * basis @ aims, gap=0.1, **kind) for sign in (1, -1)]
    spring = basis @ np.diag(squares) @ basis.T
    model = of(np.eye(n), basis @ np.diag(rates) @ basis.T, 0.5 * (spring + spring.T), 1.0, stops)
    start = vi.State(np.zeros(n), model.stops[0].direction)
    motion = vi.simulate(model, start=start, periods=20, samples_per_period=8)
    q, v = motion["displacement"].values, motion["velocity"].values
    pushed = np.array([np.maximum(-model.clearances(x), 0.0) for x in q]) ** 2 @ np.array(
        [stop.stiffness or 0.0 for stop in model.stops]
    )
    energy = 0.5 * (((q @ model.stiffness) * q + v * v).sum(axis=1) + pushed)
    kept = bool(abs(energy[-1] / energy[0] - 1.0) < 1e-8)
    assert motion.sizes["impact"] > 0
    assert kept == lasting_stops(model).all() == lasting_stops(model).any()


def test_a_mass_adrift_is_where_it_was_left():
    adrift = of(1.0, 0.0, 0.0, 2.0, [vi.Stop(direction=1, gap=0.5)], {1: 1.0})
    (one,) = vi.attractors(adrift)
    after = vi.simulate(adrift, start=one.start, periods=30, samples_per_period=10)
    assert one.name == "no impact"
    assert not after.sizes["impact"]
    assert float(after["clearance"][-1, 0]) > 10.0
    assert "no impact, it never comes back to a stop" in " ".join(str(vi.describe(adrift, parameters=[])).split())


def test_a_mode_that_nothing_damps_has_no_attractor():
    stops = [stop.replace(direction=[float(stop.direction[0]), 0.0]) for stop in TWINS.stops]
    more = of(np.eye(2), np.diag([0.05, 0.0]), np.diag([1.0, 3.0]), TWINS.omega, stops, {1: [1.0, 0.0]})
    motions = vi.attractors(more, [vi.State([0.01, 0.0], [0.3, 0.0]), vi.State([0.01, 0.1], [0.3, 0.0])])
    assert {one.kind for one in motions} <= {"periodic", "quasi_periodic"}
    assert sum(one.share for one in motions) <= 1.0


def test_what_is_cut_off_is_undecided_and_says_so():
    portrait = vi.basins(
        THREE, **{name: values[:2] for name, values in STATES.items()}, tolerances=vi.Tolerances(steps_per_impact=1)
    )
    assert (portrait["attractor"].values[portrait["status"].values == vi.Status.BUDGET] == -1).all()


def test_a_family_of_systems_has_attractors():
    @vi.family
    def design(gap=0.05):
        return two_sided(5.0, 0.8, gap)

    assert [one.name for one in vi.attractors(design)] == [one.name for one in vi.attractors(TWINS)]


@pytest.mark.long
def test_chaos_that_ends_in_a_cycle_is_not_called_quasi_periodic_where_the_exponents_of_both_cancel():
    # of some starts the 32,767 impacts watched are half chaos, half the approach to a cycle: their mean exponent is 0
    class Watching(Runner):
        again = ()

        def run(self, cells, window, *more):
            self.again = cells.table.copy() if window is settling.AFTER_LATE else self.again
            return super().run(cells, window, *more)

    beam, runner = vi.models.clamped_beam_with_stop(), Watching()
    starts, windows = spread_cells(beam.cells({}), 2048), [ImpactWindow(2047, 2048), settling.LATE_OF_SYSTEMS]
    for first in range(1920, -1, -128):
        settled = settling.settle(runner, beam, starts[first + np.arange(128)], windows)
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


def test_two_free_masses_lead_where_their_relative_motion_does():
    (found,) = vi.attractors(free_pair())
    assert (found.name, found.share) == ("period-1 impact-2", 1.0)
    assert found.velocities == pytest.approx([4.014863874979368] * 2, rel=1e-12)
    pair = free_pair(0.9, mass=np.diag([1.0, 1.5]), force=vi.Force(omega=1.0, harmonics={1: [1.0, -0.5]}))
    both = [vi.attractors(model) for model in (pair, beside_its_centre(pair)[0])]
    seen, own = ([(one.name, one.share) for one in found] for found in both)
    assert seen == own
    hardest = [[one.max_velocity for one in found] for found in both]
    assert hardest[0] == pytest.approx(hardest[1], rel=1e-4)  # of chaos, over a sample


@pytest.mark.parametrize(("damping", "names"), [(0.0, []), (0.1, ["no impact"])])
def test_a_load_that_moves_the_centre_alone_drives_no_impacts(damping, names):
    joined = damping * np.array([[1.0, -1.0], [-1.0, 1.0]])
    load = vi.Force(omega=1.0, harmonics={1: [0.3, 1.7]})
    pair = free_pair(0.5, mass=np.diag([0.3, 1.7]), damping=joined, force=load)
    assert [one.name for one in vi.attractors(pair)] == names
    mass = 0.3 * 1.7 / 2.0
    stops = [vi.Stop(direction=sign, gap=0.5, restitution=0.5) for sign in (1, -1)]
    assert [one.name for one in vi.attractors(of(mass, damping, 0.0, 1.0, stops))] == names


def test_free_masses_that_are_pressed_together_are_in_contact_for_ever():
    stops = [vi.Stop(direction=[1.0, -1.0], gap=0.0)]
    pressed = of(np.eye(2), 0.0, 0.0, 1.0, stops, {1: [0.1, 0.0]}, [1.0, -1.0])
    (found,) = vi.attractors(pressed)
    assert (found.name, found.share) == ("permanently in contact", 1.0)
