"""From a motion to its orbit: attractors, states and sections lead to the orbit that they are on."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

import vibroimpact as vi
from systems import a_random_machine, drawn, on_springs, two_sided
from vibroimpact.orbits import orbit_distance, same_orbit

CHAOS = vi.ImpactOscillator(omega=2.8)
HITTING = vi.ImpactOscillator(omega=0.9)
RESTING = vi.ImpactOscillator(omega=0.1)
SETTLING = {
    "one mass": HITTING,
    "its system": HITTING.system,
    "between two stops": two_sided().replace(below_gap=0.3),
    "at rest": RESTING,
    "a system at rest": RESTING.system,
}


def a_random_oscillator(rng):
    """Return one mass before a rigid stop, which loses from all to none of its speed."""
    return vi.ImpactOscillator(
        omega=rng.uniform(0.3, 4.0),
        restitution=rng.choice([0.0, rng.uniform(0.1, 0.95)], p=[0.1, 0.9]),
        gap=rng.uniform(-0.5, 1.0),
        damping=rng.uniform(0.0, 0.2),
    )


def periodic_motions(make, seed):
    """Return a random design, its attractors that repeat, and what else they need."""
    rng = np.random.default_rng(seed)
    model = make(rng)
    return model, [found for found in vi.attractors(model, workers=1) if found.n_periods], rng


RANDOM = [
    pytest.param(make, seed, id=f"{make.__name__}-{seed}")
    for make, seeds in ((a_random_oscillator, range(8)), (on_springs, range(6)), (a_random_machine, range(3, 6)))
    for seed in seeds
]


@pytest.mark.long(but=3)
@pytest.mark.parametrize(("make", "seed"), RANDOM[::6] + RANDOM)
def test_an_attractor_that_repeats_is_a_stable_orbit_which_its_states_lead_to_and_simulate_follows(make, seed):
    model, repeating, rng = periodic_motions(make, seed)
    for attractor in repeating:
        orbit = attractor.orbit
        assert (orbit.n_periods, orbit.model, orbit.stable) == (attractor.n_periods, model, True)
        assert orbit.admissible, orbit.message
        assert max(orbit.velocities) == pytest.approx(attractor.max_velocity, rel=1e-9)
        assert vi.find_orbit(model, near=attractor) == [orbit]
        near = [attractor.start]
        if not orbit.sticks:
            assert sorted(orbit.velocities) == pytest.approx(sorted(attractor.velocities), rel=1e-9)
            time = rng.uniform(0.0, orbit.period)
            place, speed, _ = orbit.motion([time])
            at = (place[0], speed[0]) if np.ndim(orbit.start.displacement) else (float(place[0, 0]), float(speed[0, 0]))
            near.append(vi.State(*at, time))
        followed = vi.simulate(model, start=orbit.start, periods=orbit.n_periods, samples_per_period=40)
        place, _, _ = orbit.motion(followed["time"])
        size = max(np.abs(place).max(), orbit.oscillator.velocity_scale / orbit.oscillator.omega)
        assert followed["displacement"].values.reshape(place.shape) == pytest.approx(place, abs=1e-7 * size)
        for state in near:
            (found,) = vi.find_orbit(model, near=state)
            assert found.stable
            assert orbit_distance(found, orbit) < 1e-7


def test_what_does_not_repeat_has_no_orbit_and_find_orbit_says_why(form):
    (chaos,) = vi.attractors(form(CHAOS))
    assert chaos.orbit is None
    orbits = vi.find_orbit(form(CHAOS), near=chaos)
    assert orbits.outcome == "not_periodic"
    assert "is chaotic, the impacts do not repeat; this unstable period-" in orbits.message
    (quiet,) = vi.attractors(form(vi.ImpactOscillator(gap=10.0)))
    assert quiet.orbit is None
    orbits = vi.find_orbit(quiet.model, near=quiet)
    assert (list(orbits), orbits.outcome) == ([], "none")
    assert "ends without impacts: no impact: the mass never reaches the stop" in orbits.message
    assert vi.attractors(form(RESTING))[0].orbit.sticks


@pytest.mark.parametrize("name", SETTLING)
def test_a_section_or_a_simulation_of_a_settled_motion_leads_to_its_orbit(name):
    model = SETTLING[name]
    (orbit,) = vi.find_orbit(model, near=model.rest)
    for motion in (
        vi.impact_section(model, transient_impacts=3000),
        vi.stroboscopic_section(model, transient_periods=1000, phase=0.3),
        vi.simulate(model, periods=2, skip_periods=1000),
    ):
        (found,) = vi.find_orbit(model, near=motion)
        assert found.stable
        assert orbit_distance(found, orbit) < 1e-7
    assert vi.find_orbit(model, near=vi.impact_section(model), n_impacts=orbit.n_impacts)[0].name == orbit.name


def test_the_orbit_nearest_to_a_chaotic_section_is_one_that_the_motion_passes_by(form):
    section = vi.impact_section(form(CHAOS))
    (found,) = vi.find_orbit(form(CHAOS), near=section)
    assert not found.stable
    assert found.admissible
    phases, speeds = section["phase"].values, section["velocity"].values
    angle = 2.0 * np.pi * (phases - found.phases[0])
    apart = np.hypot(2.0 * np.sin(angle / 2.0), (speeds - found.velocities[0]) / speeds.max())
    assert apart.min() < 0.05


@pytest.mark.long(but=2)
@pytest.mark.parametrize("seed", [5, 9, 0, 2, 4, 7, 13, 15, 20, 23, 25, 26])
def test_the_motion_from_rest_of_any_system_settles_to_the_orbit_found_or_passes_it(seed):
    model, _, _ = drawn(np.random.default_rng([41, seed]), of_any_kind=True)
    found = vi.find_orbit(model, near=model.rest)
    assert found.outcome in ("found", "not_periodic")
    assert all(orbit.admissible for orbit in found)
    if found.outcome == "found" and not found[0].sticks:
        (orbit,) = found
        assert orbit.stable
        assert "settles to this" in found.message
        hits = vi.impact_section(model, transient_impacts=5000, sample_impacts=len(orbit.velocities))
        settled = SimpleNamespace(phases=hits["phase"].values, velocities=hits["velocity"].values)
        assert orbit_distance(orbit, settled) < 1e-6


def test_a_state_on_an_unstable_orbit_leads_to_it_and_not_to_where_the_motion_settles(form):
    osc = vi.ImpactOscillator(omega=1.3)
    known = vi.find_orbit(osc, n_periods=2, n_impacts=3)
    assert any(not orbit.stable for orbit in known)
    for orbit in known:
        (found,) = vi.find_orbit(form(osc), near=orbit.start)
        assert found.stable == orbit.stable
        assert orbit_distance(found, orbit) < 1e-9
    orbits = vi.find_orbit(form(osc), near=vi.State(-0.5, 0.3))
    assert "settles to this" in orbits.message


@pytest.mark.parametrize("name", SETTLING)
def test_a_section_of_another_design_is_a_guess(name):
    model = SETTLING[name]
    other = model.replace(omega=1.01 * model.omega)
    (found,) = vi.find_orbit(other, near=vi.impact_section(model, transient_impacts=3000))
    assert (found.model, found.stable) == (other, True)


def test_the_orbit_of_a_familys_attractor_is_followed_along_its_parameters():
    machine = vi.family(vi.models.bouncing_ball)
    (attractor,) = (found for found in vi.attractors(machine) if found.kind == "periodic")
    assert attractor.orbit.model == machine
    branch = vi.continue_orbit(attractor.orbit, "amplitude", (1.2e-4, 1.4e-4), step=0.2)
    assert branch.outcome == ("range", "range")


@pytest.mark.parametrize("model", [HITTING, HITTING.system, two_sided()], ids=["one mass", "its system", "two sides"])
def test_what_no_orbit_is_near_to_is_refused_in_a_sentence(model):
    stop, gap = model.stop_names[0], model.gap if model is HITTING else model.stops[0].gap
    clear = model.replace(**{name: 99.0 for name in model.parameters if name.endswith("gap")})
    for near, words in (
        (vi.State((0.1, 0.2)), "`near` must have 1 coordinate, as the mass matrix has, got 2"),
        (vi.State(gap + 0.1), f"`near` lies beyond '{stop}' by 0.1 m"),
        (vi.parameter_map(model, omega=[1.0, 1.1], sample_impacts=5), "got a Dataset of parameter_map"),
        (vi.impact_section(model).drop_attrs(), "got another Dataset"),
        (vi.impact_section(clear), "a motion that strikes a stop, got a result of impact_section"),
        (vi.impact_section(vi.models.cantilever_with_stop()), "must be a motion with 1 coordinate, got one with 3"),
        ("there", "got 'there'"),
    ):
        with pytest.raises(ValueError, match=re.escape(words)):
            vi.find_orbit(model, near=near)


def test_the_orbit_of_a_stiff_beam_is_found_before_its_motion_has_settled():
    """Its fastest mode is 2000 times as fast as the drive; 1e-10 of the transient would last for 3000 periods."""
    beam = vi.models.fe_beam(
        length=0.7, elements=4, supports={0.0: "clamp"}, rigidity=12487.5, mass_per_length=7.047, rayleigh=(3.0, 1e-5),
        points={"spring": 0.3, "tip": 0.7}, force=vi.Force(frequency=48.5, harmonics={1: {"tip": 20.0}}),
        stops=[vi.Stop(direction={"spring": 1.0}, gap=1e-3, stiffness=1.3e6, name="spring")],
    )  # fmt: skip
    (known,) = (orbit for orbit in vi.find_orbit(beam) if orbit.stable)
    (found,) = vi.find_orbit(beam, near=beam.rest)
    assert same_orbit(found, known)
    orbits = vi.find_orbit(beam, near=vi.simulate(beam, periods=100))
    assert re.fullmatch(
        "the motion from `near` settles to this period-1 impact-1 orbit: after 242 impacts its distance from it is "
        r"[\de.-]+", orbits.message,
    )  # fmt: skip
    assert same_orbit(orbits[0], known)
    again = vi.find_orbit(beam, near=known.start)
    assert same_orbit(again[0], known)
    assert again.message == "1 period-1 impact-1 orbit"
