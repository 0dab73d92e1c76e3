"""What losses, loads and stops make of a motion: rest, contact for ever, flight clear of the stops, energy for ever."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from systems import THREE, TWINS, free_pair, one_mass
from systems import system as of
from texts import text_of
from vibroimpact.coexistence.losses import lasting_stops
from vibroimpact.report import sentences_of

pytestmark = pytest.mark.usefixtures("modal_engine")

MODELS = {"one mass": lambda osc: osc, "as a system": one_mass}


@pytest.fixture(params=MODELS)
def kind(request):
    """Return what makes an oscillator a model of each kind."""
    return MODELS[request.param]


def quiet(model, name):
    """Return the only attractor, which has no impacts and leads to itself."""
    (found,) = vi.attractors(model)
    assert (found.name, found.share) == (name, 1.0)
    assert math.isnan(found.mean_velocity)
    (again,) = vi.attractors(model, [found.start])
    assert again.name == name
    return found


def position(state):
    """Return where the mass of a state is."""
    return np.ravel(state.displacement)


def test_behind_a_wide_gap_the_mass_never_hits(kind):
    osc = vi.ImpactOscillator(omega=3.0, gap=30.0)
    found = quiet(kind(osc), "no impact")
    orbit = vi.simulate(kind(osc), start=found.start, periods=50)
    assert float(orbit["displacement"].max()) == pytest.approx(osc.steady_amplitude, rel=1e-3)
    assert np.ravel(orbit["displacement"][-1]) == pytest.approx(position(found.start), abs=1e-10)


def test_a_mass_pressed_too_hard_stays_for_ever(kind):
    found = quiet(kind(vi.ImpactOscillator(gap=-3.0)), "permanently in contact")
    assert position(found.start) == -3.0


@pytest.mark.parametrize("gap", [-1.0, 0.0, 1.0])
def test_unforced_every_start_comes_to_rest(kind, gap):
    start = quiet(kind(vi.ImpactOscillator(amplitude=0.0, gap=gap)), "at rest").start
    assert (position(start), np.ravel(start.velocity)) == (min(0.0, gap), 0.0)


def test_without_rebound_every_start_sticks(kind):
    (found,) = vi.attractors(kind(vi.ImpactOscillator(restitution=0.0)))
    assert (found.name, found.n_impacts, found.share) == ("period-1 sticking", 1, 1.0)
    assert len(found.velocities) == 1


def test_without_any_loss_nothing_attracts(kind):
    osc = vi.ImpactOscillator(omega=3.0, restitution=1.0, damping=0.0)
    starts = [vi.State(osc.gap, speed, phase * osc.period) for phase, speed in ((0.2, 1.0), (0.7, 2.0))]
    assert vi.attractors(kind(osc), starts) == []
    stop = {} if kind(osc) is osc else {"stop": "stop_1"}
    found = vi.basins(kind(osc), phase=[0.2, 0.7], velocity=[1.0, 2.0], **stop)
    assert (found["attractor"] == -1).all()
    assert found.sizes["attractor_id"] == 0


def test_a_motion_clear_of_the_stops_is_the_steady_one():
    (quiet,) = (one for one in vi.attractors(THREE) if one.kind == "no_impact")
    motion = vi.simulate(THREE, start=quiet.start, periods=7, samples_per_period=4)
    np.testing.assert_allclose(motion["displacement"][-1], quiet.start.displacement, rtol=0, atol=1e-12)
    assert float(motion["clearance"].min()) > 0.0


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
    verdict = text_of(vi.describe(walls, parameters=[]))
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
    verdict = text_of(vi.describe(weight, parameters=[]))
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
    assert "no impact, it never comes back to a stop" in text_of(vi.describe(adrift, parameters=[]))


def test_a_mode_that_nothing_damps_has_no_attractor():
    stops = [stop.replace(direction=[float(stop.direction[0]), 0.0]) for stop in TWINS.stops]
    more = of(np.eye(2), np.diag([0.05, 0.0]), np.diag([1.0, 3.0]), TWINS.omega, stops, {1: [1.0, 0.0]})
    motions = vi.attractors(more, [vi.State([0.01, 0.0], [0.3, 0.0]), vi.State([0.01, 0.1], [0.3, 0.0])])
    assert {one.kind for one in motions} <= {"periodic", "quasi_periodic"}
    assert sum(one.share for one in motions) <= 1.0


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


def test_a_system_without_stops_is_refused_but_has_a_map():
    free = of(1.0, 0.1, 1.0, 2.0, [], {1: 1.0})
    with pytest.raises(ValueError, match="`osc` must have a stop"):
        vi.attractors(free)
    sweep = vi.parameter_map(free, omega=[2.0], indices=("n_periods", "max_velocity"), sample_impacts=10)
    assert sweep["status"].values.tolist() == [vi.Status.NO_IMPACT]
