"""How motions of systems end: parted for good, clear of all stops, or in contact for ever beside what still moves."""

import math
import os

import numpy as np
import pytest

import vibroimpact as vi
from systems import impacts, linear, outcome, system
from vibroimpact import Status
from vibroimpact.backends.reference.systems import follow


@pytest.mark.parametrize("together", [0.0, 3.0])
@pytest.mark.parametrize("load", [0.0, -2.0])
def test_two_free_masses_that_have_parted_are_given_up_whatever_both_do(load, together):
    load, still = [load, load], np.zeros((2, 2))
    rigid, soft = (vi.Stop(direction=[1, -1], gap=1.0, **how) for how in ({"restitution": 0.5}, {"stiffness": 40.0}))
    pair = system(np.eye(2), 0, still, 1.0, [rigid], constant=load)
    assert outcome(pair, start=vi.State([0, 0], [together + 0.478, together + 0.999])) == Status.NO_IMPACT
    assert outcome(pair, start=vi.State([0, 0], [together + 0.999, together])) == Status.STOPPED_IMPACTING
    hits = impacts(pair, 1, start=vi.State([0, 0], [together + 1e-3, together]))  # no faster they meet after 1,000 s
    assert hits["velocity"].values == pytest.approx([1e-3], rel=1e-9)
    pair = system(np.eye(2), 0, still, 1.0, [soft], constant=load)
    assert outcome(pair, start=vi.State([0, 0], [together + 0.999, together])) == Status.STOPPED_IMPACTING


def test_two_free_masses_that_meet_without_rebound_or_force_stay_together():
    pair = system(np.eye(2), 0, np.zeros((2, 2)), 1.0, [vi.Stop(direction=[1, -1], gap=1.0, restitution=0.0)])
    assert outcome(pair, start=vi.State([0, 0], [1.0, 0.0])) == Status.STUCK_FOREVER


def test_masses_with_a_damper_between_them_part_until_it_has_stopped_them():
    """From 1 m/s apart and 1 to brake, they have 1 m to go: enough, or not."""
    pairs = {gap: system(np.eye(2), 0.5 * np.array([[1, -1], [-1, 1]]), np.zeros((2, 2)), 1.0,
                         [vi.Stop(direction=[1, -1], gap=gap, restitution=0.5)]) for gap in (0.99, 1.01)}  # fmt: skip
    start = vi.State([0, 0], [7.0, 6.0])
    assert [outcome(pairs[gap], start=start) for gap in pairs] == [Status.STOPPED_IMPACTING, Status.NO_IMPACT]


@pytest.mark.parametrize(("share", "outcomes"), [(0.97, {Status.NO_IMPACT}), (1.03, {Status.OK, Status.SHORT_WINDOW})])
def test_a_steady_motion_of_several_harmonics_is_clear_of_a_stop_beyond_its_peak(share, outcomes):
    """The sum of the amplitudes is beyond the stop: it says nothing."""
    omega, orders, loads = 1.0, (1, 2, 3), (1.0, 0.6, -0.8)
    times, response = np.linspace(0, 2 * np.pi, 20001), 0.0
    for h, p in zip(orders, loads, strict=True):
        response = response + (p / (4 - h * h * omega**2 + 0.3j * h * omega) * np.exp(1j * h * times)).imag
    gap = response.max() / share
    amplitudes = sum(abs(p / (4 - h * h + 0.3j * h)) for h, p in zip(orders, loads, strict=True))
    assert gap < 0.99 * amplitudes
    model = system(1, 0.3, 4, omega, [vi.Stop(direction=1, gap=gap, restitution=0.5)],
                   {h: [p] for h, p in zip(orders, loads, strict=True)})  # fmt: skip
    assert outcome(model, 40) in outcomes


def pressed(preload, damping=0.0):
    """Return two masses, the first pressed to a stop: what holds it is `preload` and how far the second is from it."""
    springs = np.array([[2.0, -1.0], [-1.0, 1.0]])
    stop = vi.Stop(direction=[1, 0], gap=-preload, restitution=0.5)
    return system(np.eye(2), damping * springs, springs, 1.7, [stop], {1: [0.0, 0.1]})


@pytest.mark.parametrize("damping", [0.0, 0.05])
@pytest.mark.parametrize(("share", "stays"), [(0.99, False), (1.01, True), (30.0, True)])
def test_a_mass_pressed_to_its_stop_beside_one_that_moves_is_permanently_in_contact(share, stays, damping):
    """The second stands at minus the preload and swings by .1/(1 - w^2 + i c w)."""
    swing = 0.1 / (1.0 - 1.7**2 + 1.7j * damping)
    preload = share * abs(swing)
    start = vi.State([-preload, -preload + swing.imag], [0.0, 1.7 * swing.real])
    assert (outcome(pressed(preload, damping), start=start) == Status.STUCK_FOREVER) == stays


def test_all_that_is_said_of_a_mass_pressed_to_its_stop_agrees():
    model = pressed(1.0, 0.05)
    (attractor,) = vi.attractors(model)
    assert (attractor.kind, attractor.name, attractor.share) == ("stuck_forever", "permanently in contact", 1.0)
    assert vi.describe(model).kind == "stuck_forever"
    # It starts on the steady motion: a period later it is there again.
    later = vi.simulate(model, start=attractor.start, periods=1, samples_per_period=1)
    assert later["displacement"].values[-1] == pytest.approx(attractor.start.displacement, abs=1e-9)
    assert attractor.start.displacement[0] == pytest.approx(-1.0, abs=1e-9)


@pytest.mark.long
def test_teeth_that_stay_pressed_while_their_force_comes_and_goes_are_in_contact_for_ever():
    """A damper takes the force to zero before the flanks part; the torque presses them on before they do."""
    pair, stiffness = vi.models.gear_pair(), [8.3e7, 8.38e7, 8.4e7, 8.45e7, 8.47e7]
    cells = vi.parameter_map(pair, drive_stiffness=stiffness, indices=["max_velocity"])
    assert cells["status"].values.tolist() == [Status.STUCK_FOREVER] * 4 + [Status.CLOSED]
    for one in stiffness[1:4]:
        changed = pair.replace(drive_stiffness=one)
        late = vi.simulate(changed, periods=400).isel(time=slice(-4000, None), stop=0)
        assert late["clearance"].max() < 0.0
        assert (late["force"] == 0.0).any()
        assert int(impacts(changed, 100)["status"]) == Status.STUCK_FOREVER
        assert vi.describe(changed, parameters=[], workers=1).motion.name == "permanently in contact"


def test_a_mass_between_a_rigid_stop_and_one_that_gives_at_its_rest_position_is_as_stiff_as_both():
    """Released where the force is zero it is at both stops at once, and leaves one into the other."""
    stops = [vi.Stop(direction=1, gap=0.0, restitution=0.8), vi.Stop(direction=-1, gap=0.0, stiffness=39.4)]
    between = system(1.0, 0.07, 2.7, 1.6, stops, force={1: 1.0})
    alone = system(1.0, 0.07, 2.7 + 39.4, 1.6, stops[:1], force={1: 1.0})
    columns = []
    for one in (between, alone):
        seen = impacts(one, 1000)
        hard = (seen["stop"].values == "stop_1") & (seen["velocity"].values > 1e-6)  # how a chatter ends is scaled by V
        columns.append(np.array([seen["time"].values[hard], seen["velocity"].values[hard]])[:, :300])
    assert columns[0].shape == columns[1].shape == (2, 300)
    assert columns[0] == pytest.approx(columns[1], rel=1e-8, abs=1e-12)
    cells = [vi.parameter_map(one, omega=[1.6], indices=["n_periods"]) for one in (between, alone)]
    assert [int(cell["n_periods"][0]) for cell in cells] == [1, 1]


def of_any_kind(rng):
    """Return a random system of one to three coordinates: free masses, drag, loads, compliant stops and preloads."""
    n, s = int(rng.integers(1, 4)), int(rng.integers(1, 3))

    def positive(least):
        root = rng.normal(size=(n, n))
        return root @ root.T / n + least * np.eye(n)

    mass, stiffness, kind = positive(0.5), positive(0.2), rng.random()
    if kind < 0.3:
        away = rng.normal(size=n) if rng.random() < 0.5 else np.ones(n)
        keeps = np.eye(n) - np.outer(away, away) / (away @ away)
        stiffness = keeps @ stiffness @ keeps
    elif kind < 0.45:
        stiffness = np.zeros((n, n))
    damping = rng.choice([0.0, 0.05, 0.3]) * (positive(0.1) if rng.random() < 0.5 else stiffness)
    stops = []
    for j in range(s):
        direction = rng.normal(size=n) if rng.random() < 0.6 else np.eye(n)[0] * (1 - 2 * j)
        gap = float(rng.uniform(0.5, 3.0) if j else rng.choice([0.0, rng.uniform(-1.0, 1.5)]))
        rigid = {"restitution": float(rng.choice([0.0, 0.3, 0.7]))}
        gives = {"stiffness": float(rng.choice([5.0, 100.0, 1e4])), "damping": float(rng.choice([0.0, 0.5]))}
        stops.append(vi.Stop(direction=direction, gap=gap, **(rigid if rng.random() < 0.5 else gives)))
    force = {1: rng.choice([0.02, 0.3]) * rng.normal(size=n), 3: rng.choice([0.0, 0.1]) * rng.normal(size=n)}
    load = rng.choice([0.0, 1.0]) * rng.normal(size=n)
    return system(
        mass, (damping + damping.T) / 2, (stiffness + stiffness.T) / 2, rng.uniform(0.3, 2.0), stops, force, load
    )


@pytest.mark.long
def test_motions_said_to_have_no_more_impacts_have_none_in_a_thousand_periods():
    """And those said to be in contact are: no impact, no release, and a stop that is touched or pushed in."""
    seen = dict.fromkeys(Status, 0)
    for seed in range(60 if "FUZZ" not in os.environ else 1000):
        rng = np.random.default_rng([38, seed])
        try:
            model = of_any_kind(rng)
            hits = impacts(model, 60)
        except ValueError:  # two stops leave no room
            continue
        status = Status(int(hits["status"]))
        cell = vi.parameter_map(model, omega=[model.omega], indices=["std"], transient_impacts=0, sample_impacts=60)
        seen[status] += 1
        assert (Status(int(cell["status"][0])) == status) or status <= Status.SHORT_WINDOW, seed
        if status not in (Status.NO_IMPACT, Status.STOPPED_IMPACTING, Status.STUCK_FOREVER):
            continue
        last = float(hits["time"].values[-1]) if hits.sizes["impact"] else 0.0
        periods = math.ceil(last / model.period) + 1000
        motion = vi.simulate(model, periods=periods, samples_per_period=4)
        assert motion.sizes["impact"] == hits.sizes["impact"], seed
        at = slice(-400, None)
        places = zip(motion["displacement"].values[at], motion["time"].values[at], strict=True)
        least = np.array([model.clearances(q, time=t) for q, t in places])
        touched = (least <= 1e-6 * (1.0 + np.abs(motion["displacement"].values[at]).max())).all(axis=0)
        assert touched.any() == (status == Status.STUCK_FOREVER), seed
        if seed < 30:  # the witness has the same contacts, 20 periods later
            start, _, _ = model.initial()
            end = follow(linear(model), start, 0.0 * start, impacts=1000, most_periods=periods - 980)
            assert bool(end.closed or end.pushing) == (status == Status.STUCK_FOREVER), seed
    assert seen[Status.BUDGET] <= 0.05 * sum(seen.values())
    assert min(seen[Status.NO_IMPACT], seen[Status.STOPPED_IMPACTING], seen[Status.STUCK_FOREVER]) > 3
