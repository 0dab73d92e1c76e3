"""Orbits of a given type, from the motion from rest or from a guess: what each guess leads to, and what is refused."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from compliant import mixed
from plain import Plain, differences, witnessed
from systems import a_random_system, chain, two_sided
from vibroimpact.orbits import same_orbit

OSC = vi.ImpactOscillator(omega=0.9)
MODELS = {  # which settle to a period-1 impact-2 motion from rest, and a change of each
    "one mass": (OSC, {"gap": -0.01}),
    "its system": (OSC.system, {"stop_gap": -0.01}),
    "between two stops": (two_sided().replace(below_gap=0.3), {"below_gap": 0.31}),
    "between a spring and a stop": (mixed.at(), {"below_gap": 0.41}),
}


@pytest.mark.parametrize("name", MODELS)
def test_the_motion_from_rest_gives_the_orbit_that_it_settles_to(name):
    model, _ = MODELS[name]
    orbit = vi.find_orbit(model, n_impacts=2)[0]
    hits = vi.impact_section(model, transient_impacts=2000, sample_impacts=2)
    assert orbit.stable
    assert sorted(orbit.velocities) == pytest.approx(sorted(hits.velocity.values), rel=1e-12)
    assert set(orbit.stops) == {*model.stop_names}


@pytest.mark.parametrize("name", MODELS)
def test_an_orbit_of_another_design_is_a_guess(name):
    model, changes = MODELS[name]
    orbit = vi.find_orbit(model, n_impacts=2)[0]
    near = vi.find_orbit(model.replace(**changes), n_impacts=2, near=orbit)
    assert [found.stable for found in near] == [True]
    assert near[0].velocities == pytest.approx(orbit.velocities, rel=0.1)
    assert near[0].velocities != orbit.velocities


@pytest.mark.parametrize("name", MODELS)
def test_each_way_of_saying_near_leads_to_the_same_orbit(name):
    model, changes = MODELS[name]
    orbit = vi.find_orbit(model, n_impacts=2)[0]
    before = vi.find_orbit(model.replace(**changes), n_impacts=2)[0]
    settled = next(found for found in vi.attractors(model) if found.kind == "periodic")
    place, speed, _ = (part[0] for part in orbit.motion([0.4]))
    on_it = vi.State(*((place, speed) if np.ndim(orbit.start.displacement) else (place.item(), speed.item())), 0.4)
    struck = (before.phases[1], before.velocities[1]), (0.1, 1.5)
    for near in (before, before.start, settled, on_it, *(struck if name == "one mass" else ())):
        (again,) = vi.find_orbit(model, n_impacts=2, near=near)
        assert again.stable
        assert sorted(again.velocities) == pytest.approx(sorted(orbit.velocities), rel=1e-12)
        assert sorted(again.phases) == pytest.approx(sorted(orbit.phases), rel=1e-12)
    assert sorted(settled.velocities) == pytest.approx(sorted(orbit.velocities), rel=1e-9)


def test_one_mass_and_its_system_take_the_orbits_and_attractors_of_the_other_as_guesses():
    one = vi.ImpactOscillator(omega=0.9)
    for p in (2, -1):
        model = one if p > 0 else one.replace(omega=0.1)
        guesses = [*vi.find_orbit(model, n_impacts=p), *vi.find_orbit(model.system, n_impacts=p)]
        assert len(guesses) == 2
        for near in (*guesses, vi.attractors(model)[0] if p > 0 else guesses[0]):
            for machine in (model, model.system):
                (found,) = vi.find_orbit(machine, n_impacts=p, near=near)
                assert sorted(found.velocities)[-1] == pytest.approx(sorted(near.velocities)[-1], rel=1e-9)


def test_the_stops_of_one_mass_are_those_of_a_system_of_one_stop():
    one = vi.ImpactOscillator(omega=0.9)
    assert vi.find_orbit(one, stops=["stop", "stop"]) == vi.find_orbit(one, n_impacts=2)
    assert vi.find_orbit(one, symmetric=True).outcome == vi.find_orbit(one.system, symmetric=True).outcome == "none"


@pytest.mark.parametrize("late", [3000, 50_000])
def test_the_times_of_a_guess_may_be_late(late):
    system = two_sided().replace(below_gap=0.3)
    orbit = vi.find_orbit(system, n_impacts=2)[0]
    times = (np.array(orbit.turns) + late) * system.period
    (again,) = vi.find_orbit(system, stops=orbit.stops, near=times)
    assert again.turns[0] < 1.0
    for name in ("phases", "velocities"):
        assert getattr(again, name) == pytest.approx(getattr(orbit, name), rel=1e-13)


def test_of_one_contact_the_orbit_near_a_guess_is_reached():
    stops = [vi.Stop(direction=1, gap=0.785, stiffness=10.298, name="stop")]
    force = vi.Force(omega=1.33, harmonics={1: 0.05})
    system = vi.ImpactSystem(mass=1.0, damping=0.02, stiffness=1.0, force=force, stops=stops)
    both = vi.find_orbit(system)
    for orbit in both:
        assert [near.velocities for near in vi.find_orbit(system, stops=orbit.stops, near=orbit)] == [
            pytest.approx(orbit.velocities, rel=1e-9)
        ]
        assert len(vi.find_orbit(system, near=orbit)) == len(both)


# What is not found, or found instead


def test_orbits_that_are_not_there_are_not_found():
    orbits = vi.find_orbit(two_sided(), n_impacts=4)
    assert not orbits
    assert "the motion from rest does not settle to a period-1 impact-4 orbit within 32768 impacts" in orbits.message


def test_an_orbit_that_is_reached_after_a_long_transient_is_found(form):
    slow = form(
        vi.ImpactOscillator(
            damping=0.04840109500397925,
            omega=2.7116540730750396,
            restitution=0.8122562355431232,
            gap=0.1520699669575002,
        )
    )
    early = vi.impact_section(slow, transient_impacts=2000, sample_impacts=6)
    assert abs(float(early["velocity"][5] - early["velocity"][0])) > 1e-4
    (orbit,) = (one for one in vi.find_orbit(slow, n_periods=4, n_impacts=5) if one.stable)
    late = vi.impact_section(slow, transient_impacts=20_000, sample_impacts=5)
    assert sorted(orbit.velocities) == pytest.approx(sorted(late["velocity"].values), rel=1e-9)


ONCE = vi.ImpactOscillator(omega=2.0)  # its stable orbit has one impact, as that of the chain
SHORTER = {
    "one mass, from an impact": (ONCE, lambda known: {"n_impacts": 2, "near": (0.499, 6.2)}),
    "one mass, from a state": (ONCE, lambda known: {"n_impacts": 2, "near": known.start}),
    "its system, from a state": (ONCE.system, lambda known: {"n_impacts": 2, "near": known.start}),
    "one mass, from times": (
        ONCE,
        lambda known: {"stops": ["stop", "stop"], "near": ONCE.period * (known.turns[0] + np.arange(2))},
    ),
    "chain, from times": (
        chain(),
        lambda known: {"stops": ["bar", "bar"], "near": chain().period * (known.turns[0] + np.arange(2))},
    ),
}


@pytest.mark.parametrize("name", SHORTER)
def test_a_guess_that_leads_to_a_shorter_orbit_is_told(name):
    model, guess = SHORTER[name]
    known = next(orbit for orbit in vi.find_orbit(model) if orbit.stable)
    orbits = vi.find_orbit(model, n_periods=2, **guess(known))
    assert (list(orbits), orbits.outcome) == ([], "other_name")
    assert orbits.message == "converged to a period-1 impact-1 orbit instead of a period-2 impact-2 one"


def test_times_of_impacts_are_a_guess_of_one_mass_as_of_its_system(form):
    model = form(vi.ImpactOscillator(omega=0.95))
    (orbit,) = vi.find_orbit(model, n_impacts=2, near=None if model.forgets else vi.State(-0.5))
    times = model.period * np.array(orbit.turns)
    (again,) = vi.find_orbit(model, stops=["stop", "stop"], near=times + np.array([0.01, -0.01]))
    assert again.oscillator == model
    assert again.velocities == pytest.approx(orbit.velocities, rel=1e-12)


def test_guesses_that_all_lead_to_a_shorter_orbit_are_told():
    assert vi.find_orbit(ONCE, n_periods=3, n_impacts=3).outcome == "other_name"


def test_a_start_at_a_fold_is_called_singular(form):
    """At g^2 = R^2 (1 + (alpha w / beta)^2) the two impact-1 orbits are one; no equation tells it from its twin."""
    osc = vi.ImpactOscillator(omega=1.2, gap=3.0)
    low, high = 20.0, 30.0
    assert [len(vi.find_orbit(form(osc.replace(gap=gap)))) for gap in (low, high)] == [2, 0]
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if len(vi.find_orbit(osc.replace(gap=middle))) == 2 else (low, middle)
    for gap, outcome in ((low, "singular"), (low - 1e-6, "other_name")):
        one, other = vi.find_orbit(osc.replace(gap=gap))
        # Of two that no number parts any further, the mean is the fold.
        v, phase = np.mean([[*one.velocities, *one.phases], [*other.velocities, *other.phases]], axis=0)
        v, phase = (v, phase) if outcome == "singular" else (one.velocities[0], one.phases[0])
        doubled = vi.Orbit(one.oscillator, 2, 2, (v, v), (phase, phase), one.multipliers)
        assert vi.find_orbit(one.model, n_periods=2, n_impacts=2, near=doubled).outcome == outcome
        assert vi.find_orbit(form(one.model), n_periods=2, n_impacts=2, near=doubled.start).outcome == outcome


@pytest.mark.parametrize(("damping", "omega", "gap"), [(10.0, 0.99, -0.57), (10.0, 0.26, 0.4), (3.0, 0.92, -0.44)])
def test_orbits_of_heavily_damped_masses_are_sought_without_an_overflow(form, damping, omega, gap):
    """A step of Newton's method may put an impact long before the one that it follows."""
    osc = vi.ImpactOscillator(damping=damping, omega=omega, gap=gap, restitution=0.5)
    assert vi.find_orbit(form(osc), n_impacts=2).outcome in ("none", "other_name")


@pytest.mark.parametrize(
    ("kind", "why"), [("one mass", "fewer than 2 impacts follow"), ("its system", "does not come close to")]
)
def test_a_start_from_which_the_mass_hits_no_more_is_told(kind, why):
    osc = vi.ImpactOscillator(gap=3.0, damping=0.5)
    model = osc if kind == "one mass" else osc.system
    orbits = vi.find_orbit(model, n_impacts=2, near=vi.State(osc.gap, 0.01))
    assert orbits.outcome == "not_converged"
    assert why in orbits.message


# Several impacts by Newton's method


@pytest.mark.long(but=1)
@pytest.mark.parametrize(
    ("system", "omega", "start", "n", "names"),
    [
        (chain(), 0.5, vi.State([0.0, 0.0, 0.0]), 1, ("bar", "bar")),
        (chain(), 1.1, vi.State([0.0, 0.0, 0.0]), 2, ("bar", "bar")),
        (two_sided(), 0.8, vi.State([0.1], [0.3]), 1, ("above", "below", "below", "above")),
        (two_sided(), 1.3, vi.State([0.1], [0.3]), 1, ("above", "below")),
    ],
)
def test_newton_makes_the_orbit_of_an_attractor_from_the_times_of_its_impacts(system, omega, start, n, names):
    system = system.replace(omega=omega)
    hits = witnessed(system, start, 250)[-len(names) :]
    first = int(hits[0].time / system.period) * system.period
    (orbit,) = vi.find_orbit(system, n_periods=n, stops=names, near=[round(hit.time - first, 2) for hit in hits])
    assert orbit.velocities == pytest.approx([hit.velocity for hit in hits], rel=1e-5)
    assert orbit.impulses == pytest.approx([hit.impulse for hit in hits], rel=1e-5)
    assert (orbit.stable, orbit.admissible, orbit.n_impacts) == (True, True, len(names))
    assert orbit.symmetric == (omega == 0.8)
    assert Plain(system).replayed(orbit) < 1e-12
    again = witnessed(system, orbit.start, 2 * len(names))
    assert [hit.velocity for hit in again] == pytest.approx(2 * orbit.velocities, rel=1e-10)
    jacobian = differences(system, orbit)
    assert np.poly(np.array(orbit.multipliers)) == pytest.approx(np.poly(jacobian), abs=1e-6 * np.abs(jacobian).max())
    moved = system.replace(omega=1.01 * omega)
    (next_one,) = vi.find_orbit(moved, n_periods=n, stops=orbit.stops, near=orbit)
    assert Plain(moved).replayed(next_one) < 1e-12
    assert next_one.velocities == pytest.approx(orbit.velocities, rel=0.2)


def test_an_orbit_without_symmetry_has_a_twin_and_the_symmetric_one_between_them_is_unstable():
    system = two_sided().replace(omega=1.3)
    (orbit,) = vi.find_orbit(system, stops=["above", "below"], near=[0.3 * system.period, 0.95 * system.period])
    times = (np.array(orbit.turns) + 0.5) * system.period
    (twin,) = vi.find_orbit(system, stops=["below", "above"], near=times + 0.01)
    assert twin.velocities == pytest.approx(orbit.velocities, rel=1e-12)
    assert twin.multipliers == pytest.approx(orbit.multipliers, rel=1e-9)
    assert not orbit.symmetric
    assert orbit.stable
    between = [other for other in vi.find_orbit(system, stops="above", symmetric=True) if other.admissible]
    assert [other.half_multipliers[0].real < -1.0 for other in between] == [True]


def test_newton_knows_a_symmetric_orbit_when_it_meets_one():
    (known,) = (orbit for orbit in vi.find_orbit(two_sided(), stops="above", symmetric=True) if orbit.stable)
    times = np.array(known.turns) * two_sided().period
    (orbit,) = vi.find_orbit(two_sided(), stops=["above", "below"], near=times + np.array([0.02, -0.03]))
    assert orbit.symmetric
    assert orbit.velocities == pytest.approx(known.velocities, rel=1e-13)
    assert orbit.multipliers == pytest.approx(known.multipliers, rel=1e-12)


def test_newton_for_half_a_symmetric_cycle():
    system = two_sided().replace(omega=0.8)
    whole = vi.find_orbit(system, stops=["above", "below", "below", "above"], near=[3.07, 5.28, 7.0, 9.21])
    half = vi.find_orbit(system, stops=["above", "below"], symmetric=True, near=[3.07, 5.28])
    assert whole[0].stops == ("above", "below", "below", "above") == half[0].stops
    assert same_orbit(whole[0], half[0], tolerance=1e-12)
    assert whole[0].half_multipliers == pytest.approx(half[0].half_multipliers, rel=1e-12)
    again = vi.find_orbit(system, symmetric=True, near=whole[0])
    assert again[0].turns == pytest.approx(whole[0].turns, rel=1e-13)


def test_every_orbit_that_newton_reaches_from_anywhere_is_one():
    rng, outcomes = np.random.default_rng(8), []
    for _ in range(35):
        system, p = a_random_system(rng, int(rng.integers(1, 4))), int(rng.integers(2, 4))
        stops = rng.choice(system.stop_names, p).tolist()
        orbits = vi.find_orbit(system, n_periods=2, stops=stops, near=2.0 * system.period * (np.arange(p) + 0.1) / p)
        outcomes.append(orbits.outcome)
        assert orbits.message
        for orbit in orbits:
            assert Plain(system).replayed(orbit) < 1e-9
            assert orbit.stops == tuple(stops)
            assert orbit.admissible or orbit.message
    assert outcomes.count("found") + outcomes.count("inadmissible") >= 10


# Refusals


REFUSED = [
    ({"n_periods": 0}, "`n_periods` must be .* >= 1, got 0"),
    ({"n_periods": 1.5}, "`n_periods` must be .*, got 1.5"),
    ({"n_impacts": 0}, "`n_impacts` must be .* -1 .*, got 0"),
    ({"n_impacts": -2}, "`n_impacts` must be .*, got -2"),
    ({"n_impacts": 2, "near": "there"}, "`near` must be .*, got 'there'"),
    ({"n_impacts": 2, "near": vi.State((0.1, 0.2), (0.0, 0.0))}, "`near` must have 1 coordinate"),
    ({"n_impacts": 2, "stops": "above"}, "omitted if `stops` or `symmetric` is given"),
    ({"n_periods": 2, "symmetric": True}, "odd for symmetric motions"),
    ({"stops": "middle"}, "unknown `stops` 'middle'; choose from "),
    ({"stops": []}, "stops to strike"),
]


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize(("arguments", "named"), REFUSED)
def test_a_wrong_request_is_refused_by_name(name, arguments, named):
    with pytest.raises(ValueError, match=named):
        vi.find_orbit(MODELS[name][0], **arguments)


@pytest.mark.parametrize(
    ("model", "arguments", "named"),
    [
        (OSC, {"n_impacts": 2, "near": vi.State(1.0, 1.0)}, "`near` lies beyond .* by 1 m"),
        (two_sided(), {"n_impacts": 2, "near": vi.State(1.0, 1.0)}, "`near` lies beyond 'above' by 0.5 m"),
        (OSC, {"n_impacts": 2, "near": (0.2, -1.0)}, "`near` must be .* > 0, got -1.0"),
        (OSC, {"n_impacts": 2, "near": (0.2, math.nan)}, "`near` must be .*, got nan"),
        (two_sided(), {"n_impacts": 2, "near": (0.1, 2.0)}, "an orbit or an attractor of a system"),
        (two_sided(), {"stops": "middle"}, "choose from above, below"),
        (two_sided(), {"stops": ["above", "below"]}, "orbits of several impacts need a guess"),
        (two_sided(), {"stops": ["above", "below"], "near": [0.1]}, "one time for each of the 2 stops"),
        (OSC, {"stops": ["stop", "stop"], "near": [0.1]}, "one time for each of the 2 stops"),
        (two_sided(), {"stops": ["above", "below"], "near": [0.1, 4.0]}, r"times in order, within 3\.14159 s"),
        (two_sided(stops=[]), {}, "stops to strike"),
        (2.0, {}, "`osc` must be .*, got 2"),
    ],
)
def test_a_guess_that_a_model_cannot_take_is_refused(model, arguments, named):
    with pytest.raises(ValueError, match=named):
        vi.find_orbit(model, **arguments)
