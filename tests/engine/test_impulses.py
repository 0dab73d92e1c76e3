"""What stops take in impacts, contacts and rests, against the balance of momentum and closed forms."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.polynomial import legendre

import vibroimpact as vi
from systems import CONTACT, drawn, linear, on_springs
from vibroimpact.orbits.results import orbits_dataset
from witness import follow

NODES, WEIGHTS = legendre.leggauss(10)
COURSE = "exit_time", "exit_velocity", "peak_force_time", "penetration_time"
FINE = vi.Tolerances(chatter=1e-12)  # impulses of weaker impacts are in no table


def pressed(seed):
    """Return a random design whose load presses it on its stops, most of them inelastic, and a state before them."""
    rng = np.random.default_rng([43, seed])
    model, q, v = drawn(rng, of_any_kind=seed % 2 == 0)
    stops = [
        stop if stop.compliant else stop.replace(restitution=float(rng.choice([0.0, 0.3, 0.6]))) for stop in model.stops
    ]
    towards = sum(rng.uniform(0.0, 3.0) * stop.direction for stop in stops)
    force = vi.Force(omega=model.omega, harmonics=dict(model.force.harmonics), constant=towards)
    model = vi.ImpactSystem(**model.arguments() | {"stops": stops, "force": force})
    in_front = model.clearances(q).min() > 0.0  # else a contact has begun before the motion
    return (model, vi.State(q, v)) if in_front else pressed(seed + 1000)


def in_pieces(model, seed):
    """Return its load for a period, one that differs from it by a constant, then its load again."""
    rng = np.random.default_rng([44, seed])
    other = vi.Force(**model.force.arguments() | {"constant": rng.normal(size=model.coordinates)})
    return [(model.period, model.force), (rng.uniform(0.5, 1.0) * model.period, other), (model.period, model.force)]


def taken(motion, model):
    """Return the sum of the directions of stops times the impulses in all impacts, contacts and rests."""
    directions = dict(zip(model.stop_names, [stop.direction for stop in model.stops], strict=True))
    total = np.zeros(model.coordinates)
    for stops, impulses in (("impact_stop", "impulse"), ("stick_stop", "stick_impulse")):
        for stop, impulse in zip(motion[stops].values, motion[impulses].values, strict=True):
            total += impulse * directions[stop]
    return total


def up_to(pieces, last):
    """Return the pieces of a load up to a time in s."""
    begins = np.cumsum([0.0, *(length for length, _ in pieces[:-1])])
    return [(min(length, last - a), force) for a, (length, force) in zip(begins, pieces, strict=True) if a < last]


def given(model, pieces, last):
    """Return the integral of the load up to a time in s."""
    begin, total = 0.0, np.zeros(model.coordinates)
    for length, force in up_to(pieces, last):
        end = begin + length
        for order, wave in force.harmonics.items():
            turn = 1j * order * model.omega
            total += (wave * (np.exp(turn * end) - np.exp(turn * begin)) / turn).imag
        total += force.constant * (end - begin)
        begin = end
    return total


def mean_displacement(motion, pieces, at):
    """Return the integral of displacements over a motion, by samples at nodes between its events."""
    begins, last = motion["impact_time"].values, float(motion["time"][-1])
    contacts = np.nan_to_num(motion["contact_time"].values) if "contact_time" in motion else 0.0
    rests = motion["stick_time"].values, motion["release_time"].values
    events = [*begins, *(begins + contacts), *np.concatenate(rests), *np.cumsum([length for length, _ in pieces])]
    edges = np.unique([0.0, last, *(time for time in events if 0.0 < time < last)])
    edges = np.append(0.0, edges[1:][np.diff(edges) > 1e-10])
    ends = np.unique(np.concatenate([np.linspace(a, b, int(50 * (b - a)) + 2) for a, b in pairwise(edges)]))
    half = 0.5 * np.diff(ends)[:, None]
    return (half * WEIGHTS).ravel() @ at((ends[:-1, None] + half * (1.0 + NODES)).ravel())["displacement"].values


@pytest.mark.long(but=24)
@pytest.mark.parametrize("changes", [False, True])
@pytest.mark.parametrize("seed", range(60))
def test_impulses_of_impacts_contacts_and_rests_sum_to_the_change_of_momentum(seed, changes):
    """Together with load, springs and dampers, in each coordinate; the load may change during contacts and rests."""
    model, start = pressed(seed)
    pieces = in_pieces(model, seed) if changes else [(3.0 * model.period, model.force)]

    def at(times):
        load = up_to(pieces, times[-1]) if changes else None
        return vi.simulate(model, start=start, times=times, pieces=load, tolerances=FINE)

    motion = at(np.linspace(0.0, sum(length for length, _ in pieces), 301))
    free = (motion["clearance"] > 0.0).values[:, [stop.compliant for stop in model.stops]].all(axis=1)
    if vi.Status(int(motion["status"])) == vi.Status.BUDGET:
        pytest.skip("it chatters for longer than is followed")
    last = motion["time"].values[free].max()  # in no contact
    motion = at([0.0, last])
    (q0, q1), (v0, v1) = motion["displacement"].values, motion["velocity"].values
    change, stops = model.mass @ (v1 - v0), taken(motion, model)
    others = model.damping @ (q1 - q0) + model.stiffness @ mean_displacement(motion, pieces, at)
    missing = change + stops + others - given(model, pieces, last)
    growing = 1e-12 * motion.sizes["impact"]  # some have 20,000
    assert np.abs(missing).max() <= (1e-10 + growing) * np.abs([change, stops, others]).max()


def test_a_stop_carries_what_presses_a_mass_on_it_over_time_and_in_each_rest():
    """Before a stop at g, it pushes with f sin wt - k g while the mass rests; an impact has an impulse, no force."""
    osc = vi.ImpactOscillator(omega=0.3, gap=-0.2, stiffness=2.0, restitution=0.3)
    motion = vi.simulate(osc, periods=4)
    time, begin, end = (motion[name].values for name in ("time", "stick_time", "release_time"))
    closed = ((begin <= time[:, None]) & (time[:, None] < end)).any(axis=1)
    exact = np.where(closed, osc.amplitude * np.sin(osc.omega * time) - osc.stiffness * osc.gap, 0.0)
    np.testing.assert_allclose(motion["force"], exact, atol=1e-14)
    waves = osc.amplitude / osc.omega * (np.cos(osc.omega * begin) - np.cos(osc.omega * end))
    np.testing.assert_allclose(motion["stick_impulse"], waves - osc.stiffness * osc.gap * (end - begin), rtol=1e-12)
    assert motion["force"].attrs["units"] == "N"
    assert motion["stick_impulse"].attrs["units"] == "N s"
    section = vi.impact_section(osc, sample_impacts=60)
    np.testing.assert_allclose(section["stick_impulse"], motion["stick_impulse"][-1], rtol=1e-9)


@pytest.mark.long(but=6)
@pytest.mark.parametrize("seed", range(1, 40, 2))
def test_the_force_of_a_closed_stop_is_that_of_the_witness(seed):
    model, start = pressed(seed)
    motion = vi.simulate(model, start=start, times=np.linspace(0.0, 0.5 * model.period, 200))
    cut = 1e-9 * model.velocity_scale
    witness = follow(linear(model), start.displacement, start.velocity, impacts=10**6, most_periods=0.5, cut=cut)
    begins = np.array([begin for begin, _, _ in witness.pieces])
    near = [*motion["stick_time"].values, *motion["release_time"].values, *motion["impact_time"].values]
    for time, forces in zip(motion["time"].values, motion["force"].values, strict=True):
        if np.abs(time - np.array(near)).min(initial=1.0) > 1e-6:
            begin, phase, x = witness.pieces[np.searchsorted(begins, time, side="right") - 1]
            np.testing.assert_allclose(phase.force @ phase.moved(x, time - begin), forces, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("number", [1, 2, 5])
def test_a_contact_that_a_switch_divides_is_one_contact_with_the_numbers_of_all_its_parts(number):
    """A mass of 2 kg meets a spring at 3 m/s: half a sine, whichever of its parts the record is made of."""
    stop = vi.Stop(direction=1.0, gap=0.5, stiffness=5e3)
    model = vi.ImpactSystem(mass=2.0, stiffness=0.0, stops=[stop])
    cuts = 1.0 / 6.0 + np.pi / 50.0 * np.arange(1, number + 1) / (number + 1.0)
    pieces = [(float(length), None) for length in np.diff([0.0, *cuts, 1.0])]
    motion = vi.simulate(model, start=vi.State(0.0, 3.0), pieces=pieces)
    whole = {"impulse": 12.0, "energy_lost": 0.0, "peak_force": 300.0, "contact_time": np.pi / 50, "penetration": 0.06}
    begin, middle, end = 1.0 / 6.0 + np.pi / 50.0 * np.array([0.0, 0.5, 1.0])
    whole |= {"impact_time": begin, "exit_time": end, "impact_velocity": 3.0, "exit_velocity": 3.0}
    for name, value in whole.items():
        np.testing.assert_allclose(motion[name], [value], rtol=1e-12, atol=1e-13, err_msg=name)
    for name in ("peak_force_time", "penetration_time"):
        np.testing.assert_allclose(motion[name], [middle], rtol=1e-9, err_msg=name)


@pytest.mark.long(but=6)
@pytest.mark.parametrize("seed", range(24))
def test_where_a_load_is_divided_within_contacts_changes_none_of_their_numbers(seed):
    rng = np.random.default_rng(seed)
    model = on_springs(rng)
    while not model.stops[0].compliant:
        model = on_springs(rng)
    whole = vi.simulate(model, periods=4)
    begins, lengths = (whole[name].values for name in ("impact_time", "contact_time"))
    cuts = np.unique((begins + rng.uniform(0.0, 1.0, len(begins)) * lengths)[np.isfinite(lengths)])
    cuts = cuts[np.diff(cuts, prepend=0.0) > 1e-6]
    pieces = [(length, model.force) for length in np.diff([0.0, *cuts, 4.0 * model.period])]
    divided = vi.simulate(model, times=whole["time"].values, pieces=pieces)
    for name in ("impact_time", "impact_velocity", *CONTACT, *COURSE):
        np.testing.assert_allclose(divided[name], whole[name], rtol=1e-7, atol=1e-7, err_msg=name)


@pytest.mark.parametrize("seed", [0, 2, 8, 14, 24])
def test_a_contact_whose_force_begins_again_is_over_when_the_force_ends_for_good(seed):
    """In between it pushes no more, and while it pushes again none of its numbers is known."""
    model, start = pressed(seed)
    motion = vi.simulate(model, start=start, periods=3)
    lasts = (motion["exit_time"] - motion["impact_time"]).values
    (row,) = np.flatnonzero(lasts > motion["contact_time"].values + 1e-6)
    end = float(motion["exit_time"][row])
    looks = np.array([-1e-6, -1e-9, 1e-9]) * model.period + end
    forces = vi.simulate(model, start=start, times=looks)["force"].sel(stop=motion["impact_stop"][row]).values
    assert min(forces[:2]) > 0.0 == forces[2]
    cut = vi.simulate(model, start=start, times=[0.0, looks[0]])
    assert all(np.isnan(cut[name][row]) for name in (*CONTACT, *COURSE))


@pytest.mark.parametrize("damping", [0.0, 20.0, 120.0])
def test_a_free_mass_leaves_a_compliant_stop_with_the_restitution_of_its_damping(damping):
    """The largest force of an overdamped stop is that of the damper where contact begins."""
    stop = vi.Stop(direction=-1.0, gap=0.5, stiffness=5e3, damping=damping)
    model = vi.ImpactSystem(mass=2.0, stiffness=0.0, stops=[stop])
    hits = vi.simulate(model, start=vi.State(0.0, -3.0), duration=1.0).isel(impact=0)
    r = vi.contact.restitution_of(damping, stiffness=5e3, mass=2.0)
    assert hits["exit_velocity"].item() == pytest.approx(3.0 * r, rel=1e-9)
    assert hits["exit_time"].item() == pytest.approx((hits["impact_time"] + hits["contact_time"]).item(), rel=1e-12)
    first = hits["peak_force_time"].item() == pytest.approx(hits["impact_time"].item())
    assert first == (damping == 120.0)
    assert hits["impulse"].item() == pytest.approx(2.0 * 3.0 * (1.0 + r), rel=1e-9)


@pytest.mark.long(but=8)
@pytest.mark.parametrize("seed", range(40))
def test_contacts_are_deepest_press_hardest_and_end_where_their_records_say(seed):
    model, start = pressed(seed)
    motion = vi.simulate(model, start=start, periods=2)
    for name, value in (("peak_force_time", "peak_force"), ("penetration_time", "penetration")):
        if name not in motion:
            continue
        known = np.flatnonzero(np.isfinite(motion[name].values))
        times, order = np.unique(motion[name].values[known], return_inverse=True)
        if not len(times):
            continue
        at = vi.simulate(model, start=start, times=times)
        seen = at["force"] if value == "peak_force" else -at["clearance"]
        for row, sample in zip(known, order.ravel(), strict=True):
            hit = motion.isel(impact=row)
            there = seen.isel(time=sample).sel(stop=hit["impact_stop"]).item()
            jumps = np.abs(motion["impact_time"] - hit[name]).min() < 1e-9  # of the rate, with the force of dampers
            assert jumps or there == pytest.approx(hit[value].item(), rel=1e-6, abs=1e-9)
    rigid = np.isin(motion["impact_stop"], [stop.name for stop in model.stops if not stop.compliant])
    alone = rigid & (motion.sizes["stick"] == 0)
    r = {stop.name: stop.restitution for stop in model.stops}
    speeds = motion["impact_velocity"].values * [r[name] or 0.0 for name in motion["impact_stop"].values]
    np.testing.assert_allclose(motion["exit_velocity"][alone], speeds[alone], rtol=1e-9, atol=1e-12)


PAIR = vi.ImpactSystem(
    mass=np.eye(2),
    damping=0.05 * np.eye(2),
    stiffness=[[2.0, -0.5], [-0.5, 1.0]],
    force=vi.Force(omega=0.3, harmonics={1: [2.0, 0.0]}),
    stops=[vi.Stop(direction=[1.0, 0.0], gap=0.0, restitution=0.3)],
)
RESTING = [vi.ImpactOscillator(omega=0.1), vi.ImpactOscillator(omega=0.3, gap=-0.5, amplitude=0.8), PAIR]


@pytest.mark.parametrize("model", RESTING)
def test_an_orbit_that_rests_gives_what_its_stop_takes_in_each_impact_and_rest_of_a_cycle(model):
    (orbit,) = vi.find_orbit(model, n_periods=1, n_impacts=-1)
    motion = vi.simulate(model, start=orbit.start, skip_periods=4, periods=6)
    found = vi.impact_statistics(motion)
    for total, name in ((orbit.impulses, "mean_force"), (orbit.rest_impulses, "rest_force")):
        assert sum(total) == pytest.approx(found[name].item() * orbit.period, rel=1e-6)
    assert sum(contact.energy_lost for contact in orbit.contacts) == pytest.approx(
        found["power"].item() * orbit.period, rel=1e-6
    )
    assert f"which takes {orbit.rest_impulses[0]:.4g} N s" in orbit._repr_html_()
    listed = orbits_dataset(vi.find_orbit(model, n_periods=1, n_impacts=-1), model, {})
    np.testing.assert_allclose(listed["impulse"][0], orbit.impulses)
    np.testing.assert_allclose(listed["energy_lost"][0], [contact.energy_lost for contact in orbit.contacts])
