"""Motions under laws of restitution: bounces replayed by hand, chatter, exponents, orbits, sweeps, stores, files."""

import functools
import pickle

import numba
import numpy as np
import pytest
from scipy.optimize import brentq

import vibroimpact as vi
from differences import derivative
from studies import ball, growing
from systems import a_random_system, chain, linear, two_masses
from vibroimpact.contact import hunt_crossley, kelvin_voigt, law_of, piecewise
from vibroimpact.dataset import model_of
from vibroimpact.orbits.events import Event
from vibroimpact.orbits.flow import Flow
from witness import follow

pytestmark = pytest.mark.usefixtures("modal_engine")

HUNT = hunt_crossley(damping=0.3)


def power(v):
    return 1.0 - 0.5 * min(v, 1.0) ** 0.2


LAWS = [HUNT, piecewise([0.05, 0.3, 1.0, 2.5], [0.9, 0.8, 0.5, 0.45]), law_of(power), law_of(growing)]


def dropped(system, speed, number):
    start = vi.State(-(speed**2) / 6.0, 0.0)
    return vi.impact_section(system, start=start, transient_impacts=0, sample_impacts=number)


@pytest.mark.long(but=3)
@pytest.mark.parametrize("law", LAWS, ids=str)
def test_a_bouncing_mass_is_replayed_by_hand(code, law):
    speed, time = 2.0, 2.0 / 3.0
    hits = code.impacts(ball(law), [-2.0 / 3.0], [0.0], number=25)
    for at in range(25):
        assert hits["velocity"][at] == pytest.approx(speed, rel=1e-12)
        assert hits["time"][at] == pytest.approx(time, rel=1e-12)
        assert hits["impulse"][at] == pytest.approx(2.0 * (1.0 + law(speed)) * speed, rel=1e-12)
        assert hits["energy_lost"][at] == pytest.approx((1 - law(speed) ** 2) * speed**2, rel=1e-11)
        speed = law(speed) * speed
        time += 2.0 * speed / 3.0


@pytest.mark.parametrize("law", [lambda v: 0.7, piecewise([1.0, 2.0], [0.7, 0.7]), kelvin_voigt(damping_ratio=0.2)])
def test_a_constant_law_moves_as_its_number_that_of_kelvin_and_voigt_bit_for_bit(law):
    constant = getattr(law, "constant", None)
    same, number = (vi.impact_section(chain(r), sample_impacts=40) for r in (law, constant or 0.7))
    for name in ("time", "velocity", "impulse"):
        assert same[name].values == pytest.approx(number[name].values, rel=0.0 if constant else 1e-12), name


@pytest.mark.parametrize("cut", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("law", LAWS[2:], ids=str)
def test_a_chatter_ends_when_the_sum_of_its_flights_does(law, cut):
    speed, time = 2.0, 2.0 / 3.0
    while speed > 1e-13:
        speed *= law(speed)
        time += 2.0 * speed / 3.0
    if law == LAWS[2]:  # 1 - A v^p, p = 0.2: the integral of dv/(1 - r)
        time += 2.0 / 3.0 * speed**0.8 / (0.8 * 0.5)
    tolerances = vi.Tolerances(chatter=cut)
    motion = vi.simulate(ball(law), start=vi.State(-2.0 / 3.0, 0.0), periods=2, tolerances=tolerances)
    assert motion["stick_time"].values == pytest.approx([time], rel=max(10.0 * cut, 1e-12))


def test_bounces_of_hunt_and_crossley_fall_exponentially_and_never_end():
    hits = dropped(ball(HUNT), 0.2, 3000)
    v, t = hits["velocity"].values, hits["time"].values
    assert hits.sizes["stick"] == 0
    rate = np.log(v[-1000] / v[-1]) / (t[-1] - t[-1000])
    assert rate == pytest.approx(0.3 * 3.0 / 3.0, rel=1e-2)
    n = np.arange(3000)
    assert v[2000:] == pytest.approx(1.0 / (1.0 / v[0] + 2.0 * 0.3 / 3.0 * n[2000:]), rel=0.02)


def test_an_endless_chatter_is_held_below_the_cut():
    begin = vi.State(0.0, 1e-11)
    hits = vi.impact_section(ball(HUNT), start=begin, sample_impacts=10)
    assert vi.Status(int(hits["status"])) == vi.Status.STUCK_FOREVER
    elastic = vi.simulate(ball(lambda v: 1.0), start=begin, periods=1e-9)
    assert elastic.sizes["stick"] == 0


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_orbits_of_one_impact_satisfy_their_law(law):
    system = chain(law)
    orbits = vi.find_orbit(system)
    assert orbits
    for orbit in orbits:
        (same,) = (
            o
            for o in vi.find_orbit(chain(law(orbit.velocities[0])))
            if abs(o.velocities[0] - orbit.velocities[0]) < 1e-9
        )
        assert orbit.phases[0] == pytest.approx(same.phases[0], abs=1e-12)
    settled = vi.impact_section(system, transient_impacts=2000, sample_impacts=20)
    stable = [orbit for orbit in orbits if orbit.stable and orbit.admissible]
    for orbit in stable[:1]:
        assert settled["velocity"].values == pytest.approx(orbit.velocities[0], rel=1e-9)


@pytest.mark.long
def test_an_orbit_is_continued_under_a_law():
    branch = vi.continue_orbit(vi.find_orbit(chain(HUNT))[0], "omega", (0.85, 0.95))
    for orbit in (branch.orbits[0], branch.orbits[-1]):
        (same,) = (o for o in vi.find_orbit(orbit.system) if abs(o.velocities[0] - orbit.velocities[0]) < 1e-6)
        assert orbit.velocities[0] == pytest.approx(same.velocities[0], rel=1e-9)


def test_saltation_is_the_derivative_of_an_impact():
    flow = Flow(two_masses(stops=[vi.Stop(direction=[0.5, 1.0], gap=0.05, restitution=HUNT, motion={1: 0.01})]))
    rng = np.random.default_rng(1)
    x, angle = rng.standard_normal(4), 0.7
    z = flow.drive(angle)
    x[:2] *= flow.bounds[0] @ z / (flow.beta[0] @ (x[:2] / flow.units))  # contact
    x[2:] *= np.sign(-flow.clearance(0, x, z)[1])

    def over(x):
        """Return the state some time after the impact."""

        def gap(s):
            return flow.clearance(0, flow.fly(x, angle - 0.05, s), flow.drive(s))[0]

        hit = brentq(gap, angle - 0.05, angle + 0.05, xtol=1e-15)
        return flow.fly(flow.struck(0, flow.fly(x, angle - 0.05, hit), flow.drive(hit)), hit, angle + 0.05)

    before = flow.fly(x, angle, angle - 0.05)
    flight = np.eye(4) + flow.over(0.05)[0]
    assert flight @ flow.saltation(Event(0), x, z) @ flight == pytest.approx(derivative(over, before, 1e-4), abs=1e-8)


@pytest.mark.parametrize("seed", range(24))
def test_random_systems_with_laws_move_as_the_witness_does(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 5))
    model = a_random_system(rng, n, s=int(rng.integers(1, 4)))
    stops = [stop.replace(restitution=(*LAWS, 0.6)[rng.integers(5)]) for stop in model.stops]
    model = vi.ImpactSystem(**model.arguments() | {"stops": stops})
    trajectory = follow(
        linear(model), *model.initial()[:2], impacts=8, cut=1e-9 * model.velocity_scale, most_periods=200
    )
    hits = vi.impact_section(model, transient_impacts=0, sample_impacts=max(len(trajectory.impacts), 1))
    names = list(model.stop_names)
    assert [names.index(name) for name in hits["stop"].values[:8]] == [event.stop for event in trajectory.impacts[:8]]
    for name in ("velocity", "time", "impulse"):
        known = [getattr(event, name) for event in trajectory.impacts[:8]]
        assert hits[name].values[:8] == pytest.approx(known, rel=1e-7, abs=1e-9), name


def fails_fast(v):
    return 0.5 if v < 150.0 else 1.5


@pytest.mark.parametrize("backend", ["cpu", "reference"])
def test_a_law_that_fails_in_a_run_ends_the_cell_with_a_status(backend):
    sound, broken = vi.State(-1.0, 0.0), vi.State(-1.0, 300.0)
    for start, ended in ((sound, False), (broken, True)):
        how = {"start": start, "transient_impacts": 0, "sample_impacts": 5, "backend": backend}
        hits = vi.impact_section(ball(fails_fast), **how)
        assert (vi.Status(int(hits["status"])) == vi.Status.INVALID_RESTITUTION) == ended
        for names in ("std", ("std", "lyapunov")):
            sweep = vi.parameter_map(ball(fails_fast), stop_1_gap=[0.0, 0.1], indices=names, **how)
            assert (sweep["status"].values == vi.Status.INVALID_RESTITUTION).all() == ended
            assert np.isnan(sweep["std"].values).all() == ended


def test_a_function_that_numba_has_compiled_is_taken_as_it_is():
    def falls(v):
        return 0.9 / (1.0 + v)

    own, plain = (dropped(ball(law), 1.0, 8) for law in (numba.njit(falls), falls))
    assert own["velocity"].values.tolist() == plain["velocity"].values.tolist()
    assert law_of(numba.njit(falls)) == law_of(falls)


def test_a_law_that_numba_cannot_compile_is_refused_in_words():
    for law in (lambda v: [0.5, open][0] if v < 1e9 else 0.1, functools.partial(min, 0.5)):
        with pytest.raises(ValueError, match="numba cannot compile"):
            dropped(ball(law), 1.0, 3)


@vi.family
def dampers(damping=0.1, slope=0.2):
    r = hunt_crossley(damping=damping)
    stops = [
        vi.Stop(direction=[0, 1], gap=0.05, restitution=r, name="bar"),
        vi.Stop(direction=[0.5, -1], gap=0.02, restitution=piecewise([0.1, 1.0], [0.9, 0.9 - slope])),
    ]
    return two_masses(stops=stops)


STUDY = {
    "damping": np.array([0.0, 0.05, 0.2, 1.0]),
    "slope": np.array([0.1, 0.5]),
    "transient_impacts": 10,
    "sample_impacts": 40,
}


def test_a_family_gives_each_design_its_own_law():
    sweep = vi.parameter_map(dampers, **STUDY)
    for i, damping in enumerate(STUDY["damping"]):
        one = vi.parameter_map(
            dampers.at(damping=damping, slope=0.5), omega=[8.0], transient_impacts=10, sample_impacts=40
        )
        assert float(one["std"].item()) == float(sweep["std"][i, 1])
    assert len(np.unique(sweep["std"])) == 8


def test_a_store_goes_on_with_the_same_law_and_refuses_another(tmp_path):
    def swept(most):
        system = ball(lambda v: most / (1.0 + v))
        return vi.parameter_map(
            system,
            stop_1_gap=[0.0, 0.1],
            start=vi.State(-1.0),
            sample_impacts=5,
            transient_impacts=0,
            store=tmp_path / "a.zarr",
        )

    first = swept(0.5).load()
    assert first.equals(swept(0.5).load())
    with pytest.raises((ValueError, OSError), match="another study|numbers"):
        swept(0.6)


def test_a_file_keeps_the_law(tmp_path):
    for at, law in enumerate(LAWS):
        hits = dropped(ball(law), 1.0, 5)
        again = vi.load(vi.save(hits, tmp_path / f"{at}.nc"))
        assert again.equals(hits)
        assert model_of(again) == ball(law)


def test_systems_with_laws_are_pickled_with_them():
    for law in LAWS:
        copy = pickle.loads(pickle.dumps(ball(law)))
        assert copy == ball(law)
        assert dropped(copy, 1.0, 5).equals(dropped(ball(law), 1.0, 5))
