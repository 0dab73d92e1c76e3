"""Orbits of systems with compliant stops: against an independent integrator, balances, and rigid stops."""

import math
import os

import numpy as np
import pytest
import xarray as xr
from scipy.optimize import brentq

import vibroimpact as vi
from compliant import bilinear, chain_on_two_stops, mixed, the_stable, two_masses
from differences import derivative
from dop853 import later

KELVIN_VOIGT = 0.571740027585  # restitution of z = 0.2, let go where the force is zero

# All orbits of one contact


def one_mass(omega, force, gap, spring, **changes):
    """Return one mass in front of one compliant stop."""
    stops = [vi.Stop(direction=1, gap=gap, stiffness=spring)]
    arguments = {"mass": 1.0, "stiffness": 1.0, "force": vi.Force(omega=omega, harmonics={1: force}), "stops": stops}
    return vi.ImpactSystem(**arguments | changes)


LIGHTEST = one_mass(0.70799343999615 * (1.0 + 3e-5), 1.0, 2.0, 10.0, damping=0.05)


@pytest.mark.parametrize(
    ("system", "velocity"),
    [
        (one_mass(150.0, 5.0, 0.66e-3, 2e5, mass=2.0, damping=4.0, stiffness=2e4), 1.17778),
        (one_mass(1.33, 0.05, 0.785, 10.298, damping=0.02), 2.1299),
        (LIGHTEST, 0.01528),
    ],
    ids=["near a fold", "lightly damped", "just beyond a graze"],
)
def test_a_stable_orbit_of_one_contact_is_found(system, velocity):
    (stable,) = (orbit for orbit in vi.find_orbit(system) if orbit.stable)
    assert stable.admissible
    assert stable.velocities[0] == pytest.approx(velocity, abs=6e-6 if velocity < 0.1 else 6e-5)
    begin = stable.start.time
    state = np.concatenate([stable.start.displacement, stable.start.velocity])
    assert later(system, state, begin, stable.period, (0,)) == pytest.approx(state, abs=1e-9 * abs(state).max())


@pytest.mark.parametrize("spring", [10.0, 1e3])
def test_ever_lighter_contacts_are_found_up_to_the_graze(spring):
    # A contact as light as that leaves the motion as it was: it reaches e of its amplitude beyond the stop.
    amplitude, found = abs(1.0 / (1.0 - 1.3**2 + 0.26j)), []
    for beyond in 10.0 ** -np.arange(2.0, 11.0):
        orbits = vi.find_orbit(one_mass(1.3, 1.0, amplitude * (1.0 - beyond), spring, damping=0.2))
        lightest = min(orbit.velocities[0] for orbit in orbits if orbit.admissible)
        found.append(lightest / amplitude / math.sqrt(beyond))
    assert found[-1] == pytest.approx(1.3 * math.sqrt(2.0), rel=1e-2)


def test_both_orbits_of_a_resonance_are_found_for_ever_less_damping():
    # Without damping and force the mass swings freely with the period, half of it in contact.
    frequency, gap, apart = 0.6466310406398371, 0.01, []
    omega = 2.0 * math.pi * frequency

    def swing(velocity):
        outside = 2.0 * (math.pi - math.atan2(velocity, math.sqrt(10.0) * gap)) / math.sqrt(10.0)
        return outside + 2.0 * math.atan2(velocity, math.sqrt(60.0) * gap / 6.0) / math.sqrt(60.0)

    free = brentq(lambda velocity: swing(velocity) - 1.0 / frequency, 0.01, 10.0)
    for damping in (1e-2, 1e-3, 1e-4, 1e-5):
        force = 2.0 * damping * 0.036 * omega
        both = vi.find_orbit(one_mass(omega, force, gap, 50.0, damping=damping, stiffness=10.0))
        assert [orbit.stable for orbit in both] == [True, False]
        apart.append([orbit.velocities[0] - free for orbit in both])
    assert np.abs(apart[-1]).max() < 1e-4 * free
    assert np.ptp(apart[-2]) / np.ptp(apart[-1]) == pytest.approx(10.0, rel=0.05)


def test_orbits_of_a_stiff_undamped_stop_are_found_and_the_durations_left_out_are_told():
    (orbit,) = vi.find_orbit(bilinear(1e7, 0.0))
    assert 0.0 < orbit.contacts[0].contact_time < 0.002
    message = vi.find_orbit(bilinear(1e7, 0.0, push=0.1)).message
    assert "s may be missed" in message


def a_random_design(rng):
    """Return a family over the gap of one or two masses before one or two springs, and where the free motion grazes."""
    n, omega = int(rng.integers(1, 3)), rng.uniform(0.5, 2.5)
    chain = np.array([[1.0]]) if n == 1 else np.array([[2.0, -1.0], [-1.0, 1.0]])
    damping, force = rng.uniform(0.02, 0.3) * chain, vi.Force(omega=omega, harmonics={1: np.eye(n)[rng.integers(n)]})
    dynamic = chain - omega**2 * np.eye(n) + 1j * omega * damping
    swing = abs(np.linalg.solve(dynamic, force.harmonics[1])[0])
    stiffness, lost = 10.0 ** rng.uniform(0.0, 3.5), float(rng.choice([0.0, 0.05]))
    sides = [1.0, -1.0][: int(rng.integers(1, 3))]

    @vi.family
    def design(gap=swing):
        springs = [
            vi.Stop(direction=side * np.eye(n)[0], gap=gap * scale, stiffness=stiffness, damping=lost * stiffness**0.5)
            for side, scale in zip(sides, (1.0, 1.2), strict=False)
        ]
        return vi.ImpactSystem(mass=np.eye(n), damping=damping, stiffness=chain, force=force, stops=springs)

    return design, swing


@pytest.mark.long
@pytest.mark.parametrize("part", range(50 if "FUZZ" in os.environ else 1))  # `make fuzz` asks for 300 designs
def test_every_motion_of_one_contact_that_a_sweep_of_the_gap_meets_is_found(part):
    rng, met = np.random.default_rng(38 + part), 0
    for _ in range(6):
        design, swing = a_random_design(rng)
        gaps = swing * np.linspace(0.3, 1.3, 12)
        for direction in ("up", "down"):
            diagram = vi.bifurcation_diagram(
                design, direction=direction, transient_impacts=300, sample_impacts=4, gap=gaps
            )
            for gap, velocities, stops in zip(gaps, diagram["velocity"].values, diagram["stop"].values, strict=True):
                if np.isnan(velocities).any() or np.ptp(velocities) > 1e-9 * velocities[0] or np.ptp(stops):
                    continue
                met += 1
                found = (
                    one for n in range(1, 7) for one in vi.find_orbit(design.at(gap=gap), n_periods=n) if one.stable
                )
                struck, speed = (design.at().stop_names[int(stops[0])],), velocities[0]
                same = (one for one in found if one.stops == struck and abs(one.velocities[0] - speed) < 1e-6 * speed)
                assert (orbit := next(same, None)), (gap, design)
                if met % 20 == 1:
                    attracting = [one.orbit for one in vi.attractors(design.at(gap=gap), workers=1) if one.orbit]
                    assert any(vi.orbits.same_orbit(orbit, one, tolerance=1e-5) for one in attracting), (gap, design)
    assert met > (0 if part else 20)


# An independent integrator


@pytest.mark.parametrize(
    ("system", "stops"),
    [
        (bilinear(), 1),
        (bilinear(damping=0.0), 1),
        (mixed.at(), 2),
        (chain_on_two_stops(), 2),
        (two_masses.at(omega=0.73), 1),
    ],
    ids=["bilinear", "elastic", "mixed", "two at once", "two masses"],
)
def test_an_orbit_returns_to_itself_and_its_multipliers_are_those_of_a_runge_kutta_method(system, stops):
    orbit = the_stable(vi.find_orbit(system, n_impacts=stops))
    assert orbit.admissible, orbit.message
    names = system.stop_names
    turn, pushing = _before_a_contact(orbit)
    begin, pushing = turn * system.period, [names.index(stop) for stop in pushing]
    state = np.concatenate([part[0] for part in orbit.motion([begin])[:2]])
    assert later(system, state, begin, orbit.period, pushing) == pytest.approx(state, abs=1e-9)
    jacobian = derivative(lambda x: later(system, x, begin, orbit.period, pushing), state, 1e-5)
    expected = np.linalg.eigvals(jacobian)
    for multiplier in orbit.multipliers:
        assert np.abs(expected - multiplier).min() < 2e-6
    assert np.prod(orbit.multipliers).real == pytest.approx(orbit.determinant, abs=1e-12)


def _before_a_contact(orbit):
    """Return turns in the middle of the longest leg, and the stops that push there."""
    turns = [turn for turn, _, _ in orbit.events]
    lengths = np.diff([*turns, turns[0] + orbit.n_periods])
    longest, pushing = int(np.argmax(lengths)), set(orbit.pushing)
    for _, kind, stop in orbit.events[: longest + 1]:
        gives = next(each.compliant for each in orbit.system.stops if each.name == stop)
        pushing = pushing - {stop} if kind == "let_go" or not gives else pushing | {stop}
    return turns[longest] + 0.5 * lengths[longest], pushing


def test_two_stops_push_at_once_in_the_chain():
    orbit = the_stable(vi.find_orbit(chain_on_two_stops(), n_impacts=2))
    assert orbit.stops == ("second", "first")
    assert orbit.pushing == ("first",)
    assert [kind for _, kind, _ in orbit.events] == ["impact", "let_go", "let_go", "impact"]


# The engine, and balances


def test_the_motion_from_rest_settles_to_the_orbit_with_its_impulses_forces_times_and_depths():
    orbit = the_stable(vi.find_orbit(mixed, n_impacts=2))
    hits = vi.impact_section(mixed.at(), transient_impacts=2000, sample_impacts=4)
    for stop, velocity, impulse, contact in zip(
        orbit.stops, orbit.velocities, orbit.impulses, orbit.contacts, strict=True
    ):
        mine = np.flatnonzero(np.isclose(hits["velocity"].values, velocity, rtol=1e-9))
        assert mine.size, stop
        for name, expected in numbers_of(hits).items():
            value = pytest.approx(getattr(contact, name), rel=1e-9, abs=1e-12, nan_ok=True)
            assert expected[mine] == value or name == "exit_time", (stop, name)
        assert contact.impulse == impulse
    assert math.isnan(orbit.contacts[orbit.stops.index("below")].peak_force)


def test_a_table_of_orbits_lists_when_contacts_end_and_are_hardest_as_one_of_a_motion_does(tmp_path):
    orbits = vi.find_orbit(mixed, n_impacts=2)
    number = [orbit.stable and orbit.admissible for orbit in orbits].index(True)
    motion = vi.simulate(mixed.at(), start=orbits[number].start, periods=3)
    vi.save(orbits, tmp_path / "orbits.nc")
    listed = xr.load_dataset(tmp_path / "orbits.nc").isel(orbit=number)
    np.testing.assert_allclose(listed["time"], motion["impact_time"][:2], rtol=1e-9)
    for name in ("exit_time", "exit_velocity", "peak_force_time", "penetration_time"):
        np.testing.assert_allclose(listed[name], motion[name][:2], rtol=1e-9, err_msg=name)


def numbers_of(hits):
    """Return the numbers of the contacts in a section by name, times counted from the beginning of each contact."""
    names = "impulse", "energy_lost", "exit_velocity", "contact_time", "peak_force", "penetration"
    since = {name: hits[name] - hits["time"] for name in ("exit_time", "peak_force_time", "penetration_time")}
    return {name: values.values for name, values in ({name: hits[name] for name in names} | since).items()}


def a_random_mixed_system(rng):
    """Return a damped system of one to three coordinates whose first stop gives, as others may."""
    n = int(rng.integers(1, 4))
    mass, stiffness = (spread @ spread.T / n for spread in rng.standard_normal((2, n, n)))
    stiffness += 0.3 * np.eye(n)
    stops = []
    for at in range(int(rng.integers(1, 4))):
        where = {"direction": rng.standard_normal(n), "gap": rng.uniform(0.05, 0.6)}
        moved = {"motion": {1: complex(*(0.05 * rng.standard_normal(2)))}} if rng.random() < 0.3 else {}
        springy = {"stiffness": 10.0 ** rng.uniform(0.5, 5.0), "damping": float(rng.choice([0.0, 0.1, 3.0]))}
        bouncy = {"restitution": rng.uniform(0.3, 0.9)}
        stops.append(vi.Stop(**where, **moved, **(springy if at == 0 or rng.random() < 0.5 else bouncy)))
    force = vi.Force(omega=rng.uniform(0.5, 3.0), harmonics={1: rng.standard_normal(n)})
    return vi.ImpactSystem(
        mass=mass + np.eye(n), damping=0.15 * stiffness, stiffness=stiffness, force=force, stops=stops
    )


@pytest.mark.long
def test_what_random_motions_settle_to_is_an_orbit_with_the_same_velocities_and_contacts():
    rng, repeating = np.random.default_rng(17), 0
    for _ in range(40):
        system = a_random_mixed_system(rng)
        hits = vi.impact_section(system, transient_impacts=1500, sample_impacts=12)
        if hits.sizes["impact"] < 12:
            continue
        turns = hits["time"].values / system.period
        for p in range(1, 5):
            n = round(turns[10] - turns[10 - p])
            if n and abs(turns[10] - turns[10 - p] - n) < 1e-8 and abs(turns[9] - turns[9 - p] - n) < 1e-8:
                break
        else:
            continue
        repeating += 1
        orbits = vi.find_orbit(system, n_periods=n, n_impacts=p)
        orbit = next(one for one in orbits if one.stable and one.admissible)
        order, mine = np.argsort(hits["velocity"].values[-1 - p : -1]), np.argsort(orbit.velocities)
        for name, values in ({"velocity": hits["velocity"].values} | numbers_of(hits)).items():
            of_orbit = orbit.velocities if name == "velocity" else [getattr(each, name) for each in orbit.contacts]
            expected = pytest.approx(values[-1 - p : -1][order], rel=1e-6, abs=1e-9, nan_ok=True)
            assert np.array(of_orbit)[mine] == expected, (system, name)
        assert np.prod(orbit.multipliers).real == pytest.approx(orbit.determinant, abs=1e-9)
    assert repeating >= 15


@pytest.mark.parametrize("seed", [0, 1, 2, 5])
def test_an_orbit_that_strikes_a_stiff_stop_many_times_is_the_motion_of_the_engine_and_can_be_followed(seed):
    # A contact turns a displacement into a speed some 500 times larger: from impact to impact, up to 1e40 times.
    rng = np.random.default_rng([91, seed])
    stop = vi.Stop(direction=1, gap=rng.uniform(0.0, 0.1), stiffness=10.0 ** rng.uniform(5.0, 5.8), damping=100.0)
    force = vi.Force(omega=rng.uniform(0.3, 0.5), harmonics={1: 1.0})
    system = vi.ImpactSystem(mass=1.0, damping=0.1, stiffness=1.0, force=force, stops=[stop])
    attractor, *_ = vi.attractors(system)
    assert attractor.n_impacts >= 10
    (orbit,) = vi.find_orbit(system, near=attractor)
    assert (orbit.n_periods, orbit.n_impacts, orbit.stable) == (attractor.n_periods, attractor.n_impacts, True)
    p = orbit.n_impacts
    section = vi.impact_section(system, start=attractor.start, transient_impacts=20 * p, sample_impacts=p)
    np.testing.assert_allclose(np.sort(orbit.velocities), np.sort(section["velocity"]), rtol=0.0, atol=1e-12)
    assert np.prod(orbit.multipliers) == pytest.approx(orbit.determinant, rel=1e-9, abs=1e-15)
    branch = vi.continue_orbit(orbit, "omega", (0.999 * force.omega, 1.001 * force.omega), step=0.2)
    assert branch.outcome == ("range", "range")


@pytest.mark.parametrize("system", [bilinear(), mixed.at(), chain_on_two_stops()], ids=["one", "mixed", "two at once"])
def test_over_a_cycle_the_force_does_the_work_that_dampers_and_stops_take(system):
    orbit = the_stable(vi.find_orbit(system, n_impacts=len(system.stops)))
    lost = sum(
        contact.energy_lost
        if stop.compliant
        else 0.5 * (1.0 - stop.restitution**2) / (1.0 + stop.restitution) * speed * kick
        for contact, speed, kick, stop in (
            (contact, speed, kick, next(each for each in system.stops if each.name == name))
            for contact, speed, kick, name in zip(
                orbit.contacts, orbit.velocities, orbit.impulses, orbit.stops, strict=True
            )
        )
    )
    nodes, weights = np.polynomial.legendre.leggauss(60)
    turns = [turn for turn, _, _ in orbit.events]
    gained = 0.0
    for begin, end in zip(turns, [*turns[1:], turns[0] + orbit.n_periods], strict=True):
        times = system.period * (0.5 * (end - begin) * (nodes + 1.0) + begin)
        _, velocity, _ = orbit.motion(times)
        constant = 0.0 if system.force.constant is None else system.force.constant
        load = constant + np.sin(np.outer(times, [system.force.omega])) * system.force.harmonics[1].real
        power = (velocity * load).sum(axis=1) - np.einsum("ti,ij,tj->t", velocity, system.damping, velocity)
        gained += 0.5 * (end - begin) * system.period * float(weights @ power)
    assert gained == pytest.approx(lost, abs=1e-11)


# Rigid stops


def test_an_ever_stiffer_stop_tends_to_the_rigid_one_as_the_root_of_its_stiffness():
    rigid = the_stable(vi.find_orbit(bilinear(stops=[vi.Stop(direction=1, gap=0.2, restitution=KELVIN_VOIGT)])))
    apart, turned = [], []
    for stiffness in (1e3, 1e5, 1e7, 1e9):
        orbit = the_stable(vi.find_orbit(bilinear(stiffness, 0.4 * math.sqrt(stiffness))))
        apart.append(abs(orbit.velocities[0] - rigid.velocities[0]))
        turned.append(abs(sum(orbit.multipliers) - sum(rigid.multipliers)))
        assert np.prod(orbit.multipliers).real == pytest.approx(orbit.determinant, rel=1e-10)
    assert apart[-1] < 1e-3
    assert turned[-1] < 1e-3
    assert np.array(apart[:-1]) / apart[1:] == pytest.approx(10.0, rel=0.15)


def test_the_closed_form_of_a_rigid_stop_stays_beside_a_stop_that_gives():
    alone = vi.Stop(direction=1, gap=0.2, restitution=0.7, name="bar")
    far, near = (vi.Stop(direction=-1, gap=gap, stiffness=50.0, name="spring") for gap in (5.0, 0.5))
    orbit = the_stable(vi.find_orbit(bilinear(stops=[alone])))
    beside = the_stable(vi.find_orbit(bilinear(stops=[alone, far]), stops="bar"))
    assert beside.velocities == orbit.velocities
    assert beside.admissible
    blocked = vi.find_orbit(bilinear(stops=[alone, near]), stops="bar")
    assert [found.admissible for found in blocked] == [False] * len(blocked)
    assert "would touch 'spring' too early" in blocked.message


# Guesses and verdicts


def test_a_state_near_an_orbit_of_several_contacts_is_a_guess():
    orbit = the_stable(vi.find_orbit(chain_on_two_stops(), n_impacts=2))
    displacement, velocity, _ = orbit.motion([0.0])
    state = vi.State(displacement[0] * 1.001, velocity[0], 0.0)
    (found,) = vi.find_orbit(chain_on_two_stops(), stops=orbit.stops, near=state)
    assert found.velocities == pytest.approx(orbit.velocities, rel=1e-9)
    with pytest.raises(ValueError, match="a state from which these stops are struck"):
        vi.find_orbit(chain_on_two_stops(), stops=orbit.stops * 2, near=state)


def test_times_of_contacts_are_a_guess_where_each_is_half_a_swing_on_its_spring():
    orbit = the_stable(vi.find_orbit(mixed, n_impacts=2))
    times = [turn * orbit.system.period + 0.01 for turn in orbit.turns]
    (found,) = vi.find_orbit(mixed, stops=orbit.stops, near=times)
    assert found.velocities == pytest.approx(orbit.velocities, rel=1e-9)


def test_a_verdict_tells_how_hard_how_long_and_how_deep_the_hardest_contact_is():
    text = " ".join(str(vi.describe(bilinear(), parameters=[])).split())
    (orbit,) = vi.find_orbit(bilinear())
    (contact,) = orbit.contacts
    assert f"largest force {contact.peak_force:.4g} N, which pushes for {contact.contact_time:.4g} s" in text
    assert f"pressed in by {contact.penetration:.4g} m" in text


def test_a_mass_that_never_leaves_a_spring_is_not_said_to_rest():
    spring = vi.Stop(direction=1, gap=-0.3, stiffness=100.0, damping=1.0, name="above")
    resting = bilinear(stops=[spring], push=0.1)
    text = " ".join(str(vi.describe(resting, parameters=[])).split())
    assert "pressed into the stop" in text
    assert "at rest at" not in text
