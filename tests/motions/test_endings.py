"""How motions end: at rest for good, parted, dying out, out of reach, given up, or never."""

import math
import os

import numpy as np
import pytest

import vibroimpact as vi
from systems import impacts, linear, system, two_masses
from witness import follow

OK = {vi.Status.OK, vi.Status.SHORT_WINDOW}
NONE, CEASE, STAYS = {vi.Status.NO_IMPACT}, {vi.Status.STOPPED_IMPACTING}, {vi.Status.STUCK_FOREVER}
BOUNCY = vi.Stop(direction=1, gap=1.0, restitution=0.5)
STILL, APART = np.zeros((2, 2)), np.array([[1.0, -1.0], [-1.0, 1.0]])


def pair(load=0.0, gap=1.0, damper=0.0, **stop):
    """Return two free masses, the first one of which may strike the second; `load` moves both, a damper joins them."""
    stops = [vi.Stop(direction=[1, -1], gap=gap, **stop)]
    return system(np.eye(2), damper * APART, STILL, 1.0, stops, constant=[load, load])


def free_mass(damping, constant, beside=False):
    """Return a mass that drag and a load alone hold, or the same beside one on a spring that it does not feel."""
    if not beside:
        return system(1, damping, 0, 1.0, [BOUNCY], {1: 0.001}, constant=[constant])
    matrices = np.eye(2), np.diag([damping, 0.1]), np.diag([0.0, 1.0])
    return system(*matrices, 1.0, [BOUNCY.replace(direction=[1, 0])], {1: [0.001, 0.3]}, constant=[constant, 0.0])


def swinging(share):
    """Return a mass driven by three harmonics: its steady peak is at a share of the gap, their sum beyond."""
    times, loads = np.linspace(0, 2 * np.pi, 20001), {1: 1.0, 2: 0.6, 3: -0.8}
    parts = {h: p / (4 - h * h + 0.3j * h) for h, p in loads.items()}
    gap = sum((part * np.exp(1j * h * times)).imag for h, part in parts.items()).max() / share
    assert gap < 0.99 * sum(map(abs, parts.values()))
    return system(1, 0.3, 4, 1.0, [vi.Stop(direction=1, gap=gap, restitution=0.5)], loads)


def pressed(preload, damping=0.0):
    """Return two masses, the first pressed to a stop: what holds it is `preload` and how far the second is from it."""
    springs = np.array([[2.0, -1.0], [-1.0, 1.0]])
    stop = vi.Stop(direction=[1, 0], gap=-preload, restitution=0.5)
    return system(np.eye(2), damping * springs, springs, 1.7, [stop], {1: [0.0, 0.1]})


def beside_one_that_swings(share, damping):
    """Return such masses on their steady motion: the second stands at minus the preload, and swings."""
    swing = 0.1 / (1.0 - 1.7**2 + 1.7j * damping)
    preload = share * abs(swing)
    return pressed(preload, damping), vi.State([-preload, -preload + swing.imag], [0.0, 1.7 * swing.real])


def on_a_spring(force, **numbers):
    """Return a mass on a compliant stop, with a load."""
    arguments = {"stiffness": 0.0, "damping": 0.0, "constant": 0.0, "k": 10.0, "c": 0.0} | numbers
    stop = vi.Stop(direction=1, gap=0.0, stiffness=arguments["k"], damping=arguments["c"])
    return system(
        1, arguments["damping"], arguments["stiffness"], 1.3, [stop], {1: force}, constant=[arguments["constant"]]
    )


def corner():
    """Return a mass that a load presses between two stops."""
    sides = ([1, 0.3], 0.7), ([-0.3, 1], 0.5)
    stops = [vi.Stop(direction=a, gap=0.0, restitution=r) for a, r in sides]
    return system(np.eye(2), 0, STILL, 0.1, stops, constant=[1.0, 1.3])


SEAT, BAR = vi.Stop(direction=[1, 0], gap=0.0, restitution=0.5), vi.Stop(direction=[0, 1], gap=0.2, restitution=0.7)
PRELOADED = {"stiffness": 1.0, "damping": 0.4, "k": 3.0, "constant": 1.0}
GAIN = 4.0 / abs(4.0 - 1.3**2 + 0.4j * 1.3)  # of d'' + .4 d' + 4 d = 1 + f/G sin wt, where the stop pushes with 3 d
TOUCHED = {f"rests at {name}, damping {c}": system(1, c, k, 1.0, [stop]) for name, stop in {
    "a spring": vi.Stop(direction=1, gap=0.0, stiffness=10.0),
    "a spring and a damper": vi.Stop(direction=1, gap=0.0, stiffness=10.0, damping=0.5),
    "a rigid stop": vi.Stop(direction=1, gap=0.0),
}.items() for c, k in ((0.0, 1.0), (0.1, 1.0), (0.1, 0.0))}  # fmt: skip
OF_SYSTEMS = {
    **{f"parted, both at {v}, under {load}, {next(iter(stop))}": (
        pair(load, **stop), vi.State([0, 0], [v + 0.999, v]), CEASE)
       for v in (0.0, 3.0) for load in (0.0, -2.0) for stop in ({"restitution": 0.5}, {"stiffness": 40.0})},
    **{f"parting, both at {v}, under {load}": (
        pair(load, restitution=0.5), vi.State([0, 0], [v + 0.478, v + 0.999]), NONE)
       for v in (0.0, 3.0) for load in (0.0, -2.0)},
    "meet without rebound": (pair(restitution=0.0), vi.State([0, 0], [1.0, 0.0]), STAYS),
    # From 1 m/s apart and 1 to brake, they have 1 m to go: enough, or not.
    "a damper stops them late": (pair(gap=0.99, damper=0.5, restitution=0.5), vi.State([0, 0], [7.0, 6.0]), CEASE),
    "a damper stops them early": (pair(gap=1.01, damper=0.5, restitution=0.5), vi.State([0, 0], [7.0, 6.0]), NONE),
    "a free mass leaves": (system(1, 0, 0, 1.0, [BOUNCY]), vi.State([0.0], [-1.0]), NONE),
    "a free mass never moves": (system(1, 0, 0, 1.0, [BOUNCY]), None, NONE),
    "two masses never move": (two_masses(force=vi.Force(omega=8.0), stops=[BAR]), None, NONE),
    "a free mass hits once": (system(1, 0, 0, 1.0, [BOUNCY]), vi.State([0.0], [1.0]), CEASE),
    **{f"damping {c}, under {load}, at {v}, {'beside another' if beside else 'alone'}": (
        free_mass(c, load, beside), vi.State([0.0, 0.0][:1 + beside], [v, 0.0][:1 + beside]), ends)
       for c, load, v, ends in (
           (0.0, -1.0, 1.3, NONE),  # thrown to 0.845 of the way, it falls back
           (0.0, -1.0, 1.5, CEASE),
           (1.0, 0.0, 0.9, NONE),  # drag stops it after 0.9
           (1.0, 0.0, 1.1, CEASE),
           (0.0, 1.0, -5.0, STAYS),  # it comes back and stays; beside it the other moves on
           (1.0, 1.0, -5.0, STAYS),
       ) for beside in (False, True)},
    "swings short of the stop": (swinging(0.97), None, NONE),
    "swings beyond the stop": (swinging(1.03), None, OK),
    **{f"pressed {share} times as much as needed, damping {c}": (
        *beside_one_that_swings(share, c), STAYS if share > 1 else OK)
       for share in (0.99, 1.01, 30.0) for c in (0.0, 0.05)},
    "never released": (system(1, 0.1, 1, 1.0, [vi.Stop(direction=1, gap=0.1)], {1: 0.5}, constant=[2.0]), None, STAYS),
    "a corner": (corner(), vi.State([-1.0, -1.0], [0.0, 0.0]), STAYS),
    **{name: (model, None, STAYS) for name, model in TOUCHED.items()},
    "a weight on a spring": (on_a_spring(0.1, k=100.0, c=2.0, constant=5.0), None, STAYS),
    "pressed from rest": (on_a_spring(0.0, damping=0.1, constant=1.0), vi.State(0.0), STAYS),
    "pushed by a preloaded stop": (on_a_spring(0.9 / GAIN, **PRELOADED), None, STAYS),
    "not always pushed": (on_a_spring(1.1 / GAIN, **PRELOADED), None, OK | CEASE),
}  # fmt: skip
OF_ONE_MASS = [
    ("kg below -f: pressed for ever", {"gap": -2.0}, None, "stuck_forever"),
    ("kg far below -f", {"gap": -100.0}, (-100.5, 0.0), "stuck_forever"),
    ("kg equal -f: pressed for ever", {"gap": -1.0}, None, "stuck_forever"),
    ("kg equal -f, thrown at it", {"gap": -1.0}, (-1.5, 0.0), "stuck_forever"),
    ("kg equal f from the stop: leaves by its fourth derivative", {"gap": 1.0, "omega": 0.9}, (1.0, 0.0), "ok"),
    ("stop out of reach", {"gap": 5.0, "omega": 3.0}, None, "no_impact"),
    ("settles clear of the stop", {"gap": 1.0, "omega": 3.0}, (-2.0, 0.0), "stopped_impacting"),
    ("no force, no gap, at rest", {"amplitude": 0.0}, None, "stuck_forever"),
    ("no force, gap, at rest", {"amplitude": 0.0, "gap": 0.5}, None, "no_impact"),
    ("no force, no gap, moving", {"amplitude": 0.0, "restitution": 0.2}, (-1.0, 0.0), "decaying"),
    ("no force, no gap, creeping back", {"amplitude": 0.0, "damping": 5.0}, (-1.0, 0.0), "no_impact"),
    ("no force, no gap, no rebound", {"amplitude": 0.0, "restitution": 0.0}, (-1.0, 0.0), "stuck_forever"),
    ("no force, preload", {"amplitude": 0.0, "gap": -1.0, "restitution": 0.5}, (-2.0, 0.0), "stuck_forever"),
    ("no force, gap, losses only at the stop", {"amplitude": 0.0, "gap": 1.0, "damping": 0.0, "restitution": 0.5},
     (-2.0, 0.0), "ok or stopped_impacting"),  # it loses no more: rounding decides whether it still grazes the stop
    ("no damping, beats below the stop", {"damping": 0.0, "gap": 3.0, "omega": 3.0}, (-2.9, 0.0), "budget"),
    ("r = 0", {"restitution": 0.0}, None, "sticking"),
    ("r = 1", {"restitution": 1.0, "omega": 2.7}, None, "ok"),
    ("r = 1, slow", {"restitution": 1.0, "omega": 0.5}, None, "ok or short_window"),
    ("r = 1, c = 0, w = 2 w_n", {"restitution": 1.0, "damping": 0.0}, None, "ok"),
    ("c = 0, w = w_n", {"damping": 0.0, "omega": 1.0}, None, "ok"),
    ("w = w_n/100", {"omega": 0.01}, None, "short_window"),
    ("w = 100 w_n", {"omega": 100.0}, None, "ok"),
]  # fmt: skip


# The engine of systems does not see how a motion without force dies out.
OTHERWISE = {
    ("engine of systems", "no force, no gap, moving"): "stuck_forever",
    ("engine of systems", "no force, no gap, creeping back"): "budget",
}


ENDINGS = OF_SYSTEMS | {
    case: (
        vi.ImpactOscillator(**changes),
        start and vi.State(*start),
        {vi.Status[w.upper()] for w in words.split(" or ")},
    )
    for case, changes, start, words in OF_ONE_MASS
}


@pytest.mark.parametrize("name", ENDINGS)
def test_each_motion_ends_with_its_status_in_a_section_and_in_a_map(way, name):
    model, start, outcomes = ENDINGS[name]
    if otherwise := OTHERWISE.get((way.name, name)):
        outcomes = {vi.Status[otherwise.upper()]}
    if name in OF_SYSTEMS:
        window, how = (0, 1000 if name == "a corner" and not way.slow else 100), {"start": start}
    else:
        # 20 natural periods of flight suffice to tell a flight without end here.
        window = 5, 200 if outcomes == STAYS else 40
        how = {"start": start, "tolerances": vi.Tolerances(flight_periods=20.0)}
    hits = way.section(model, *window, **how)
    indices = way.indices(
        model, ("std", "mean_velocity", "max_velocity", "impacts_per_period"), *window, early_closing=False, **how
    )
    assert vi.Status(int(hits["status"])) in outcomes
    assert indices["status"] == int(hits["status"])
    assert (hits["velocity"] > 0).all()
    assert vi.Status(indices["status"]).has_indices != math.isnan(indices["std"])
    if outcomes is NONE or (name.startswith(("rests", "pressed from")) and outcomes is STAYS):
        assert hits.sizes["impact"] == 0


def test_a_stop_out_of_reach_has_no_impacts_and_impacts_that_cease_are_told(way):
    assert way.section(vi.ImpactOscillator(gap=10.0, omega=3.0))["velocity"].size == 0
    hits = way.section(vi.ImpactOscillator(gap=1.0, omega=3.0, damping=0.1), 0, 5000, start=vi.State(-5.0))
    assert 0 < hits.sizes["impact"] < 5000
    assert int(hits["status"]) == vi.Status.STOPPED_IMPACTING


def test_a_flight_that_does_not_end_is_over_budget():
    # Undamped, R < g, yet the free motion left over from the start reaches beyond g - R without ever hitting.
    osc = vi.ImpactOscillator(damping=0.0, amplitude=0.1, gap=1.0, omega=math.sqrt(2.0))
    window = {"transient_impacts": 20, "sample_impacts": 200}
    sweep = vi.parameter_map(osc, gap=[0.0, 1.05, 1.2], start=vi.State(-0.95), **window)
    assert sweep["status"].values.tolist() == [vi.Status.CLOSED, vi.Status.BUDGET, vi.Status.NO_IMPACT]


@pytest.mark.parametrize("above", [1e-8, 1e-10, 1e-12])
def test_a_force_that_barely_lifts_the_mass_ends_over_budget_not_never(above):
    sweep = vi.parameter_map(vi.ImpactOscillator(gap=-1.0 + above), omega=[0.7], transient_impacts=20)
    assert sweep["status"].item() == vi.Status.BUDGET


def test_masses_that_part_slowly_are_waited_for():
    """No faster than 1 mm/s they meet after 1,000 s."""
    hits = impacts(pair(restitution=0.5), 1, start=vi.State([0, 0], [1e-3, 0.0]))
    assert hits["velocity"].values == pytest.approx([1e-3], rel=1e-9)


def test_a_free_mass_that_damping_couples_to_another_is_waited_for():
    """It is shaken to and fro far from the stop, towards which it drifts."""
    stop, start = vi.Stop(direction=[1, 0], gap=0.1, restitution=0.5), vi.State([-60.0, 0.0], [-8.0, 0.0])
    free = system(np.eye(2), [[0.02, -0.01], [-0.01, 0.05]], np.diag([0.0, 1.0]), 1.0, [stop], {1: [10.0, 1.0]})
    hits = impacts(free, 1, start=start)
    trajectory = follow(linear(free), [-60.0, 0.0], [-8.0, 0.0], impacts=1, cut=1e-9 * free.velocity_scale)
    assert hits["time"].values == pytest.approx([trajectory.impacts[0].time], rel=1e-11)
    assert trajectory.impacts[0].time > 4 * free.period


def test_in_a_corner_both_stops_are_struck_ever_more_softly():
    hits = impacts(corner(), 1000, start=vi.State([-1.0, -1.0], [0.0, 0.0]))
    assert sorted(set(hits["stop"].values)) == ["stop_1", "stop_2"]
    assert hits["velocity"].values[-1] < 1e-6


def test_a_weight_on_a_spring_stays_where_its_spring_bears_it():
    weight = on_a_spring(0.1, k=100.0, c=2.0, constant=5.0)
    rest = vi.simulate(weight, periods=400, samples_per_period=8)["displacement"].values[-8:, 0]
    assert np.abs(rest - 0.05).max() < 2e-3


def test_a_stop_that_is_closed_before_and_after_a_window_makes_it_sticking():
    both = system(
        np.eye(2), 0.1 * np.eye(2), [[2, -0.1], [-0.1, 1]], 1.3, [SEAT, BAR], {1: [0, 1]}, constant=[5.0, 0.0]
    )
    hits = impacts(both, 40, 10)
    cell = vi.parameter_map(both, omega=[1.3], transient_impacts=10, sample_impacts=40)
    assert vi.Status(int(hits["status"])) == vi.Status(int(cell["status"][0])) == vi.Status.STICKING
    hits = impacts(both, 30)
    assert set(hits["stop"].values) == {"stop_2"}
    assert hits["stick_stop"].values.tolist() == ["stop_1"]
    assert np.isnan(hits["release_time"].values[0])


@pytest.mark.parametrize(
    ("model", "place"),
    [(pressed(1.0, 0.05), -1.0), (vi.ImpactOscillator(gap=-2.0), -2.0)],
    ids=["beside another mass", "alone"],
)
def test_all_that_is_said_of_a_mass_pressed_to_its_stop_agrees(model, place):
    (attractor,) = vi.attractors(model)
    assert (attractor.kind, attractor.name, attractor.share) == ("stuck_forever", "permanently in contact", 1.0)
    assert vi.describe(model).kind == "stuck_forever"
    # It starts on the steady motion: a period later it is there again.
    later = vi.simulate(model, start=attractor.start, periods=1, samples_per_period=1)
    assert later["displacement"].values[-1] == pytest.approx(attractor.start.displacement, abs=1e-9)
    assert np.ravel(attractor.start.displacement)[0] == pytest.approx(place, abs=1e-9)


@pytest.mark.long
def test_teeth_that_stay_pressed_while_their_force_comes_and_goes_are_in_contact_for_ever():
    """A damper takes the force to zero before the flanks part; the torque presses them on before they do."""
    pair, stiffness = vi.models.gear_pair(), [8.3e7, 8.38e7, 8.4e7, 8.45e7, 8.47e7]
    cells = vi.parameter_map(pair, drive_stiffness=stiffness, indices=["max_velocity"])
    assert cells["status"].values.tolist() == [vi.Status.STUCK_FOREVER] * 4 + [vi.Status.CLOSED]
    for one in stiffness[1:4]:
        changed = pair.replace(drive_stiffness=one)
        late = vi.simulate(changed, periods=400).isel(time=slice(-4000, None), stop=0)
        assert late["clearance"].max() < 0.0
        assert (late["force"] == 0.0).any()
        assert int(impacts(changed, 100)["status"]) == vi.Status.STUCK_FOREVER
        assert vi.describe(changed, parameters=[], workers=1).motion.name == "permanently in contact"


@pytest.mark.parametrize("place", [0.0, 0.2])
def test_a_mass_between_two_stops_without_clearance_is_at_rest_for_ever(place):
    """The stops hold it in turn; it never moves, and nothing is hit."""
    stops = [vi.Stop(direction=side, gap=side * place, restitution=0.5) for side in (1, -1)]
    held = system(1.0, 0.1, 1.0, 0.7, stops, force={1: 1.0})
    cells = vi.parameter_map(held, omega=[0.7, 1.0])
    assert set(cells["status"].values) == STAYS
    assert cells.attrs["steps_computed"] < 1000
    (attractor,) = vi.attractors(held)
    assert attractor.kind == "stuck_forever"
    motion = vi.simulate(held, periods=3)
    assert (motion["displacement"] == place).all()
    forces = motion["force"]
    assert (forces >= 0.0).all()
    load = np.sin(0.7 * motion["time"]) - place
    np.testing.assert_allclose(forces[:, 0] - forces[:, 1], load, atol=1e-12)


def test_a_mass_between_a_rigid_stop_and_one_that_gives_at_its_rest_position_is_as_stiff_as_both():
    """Released where the force is zero it is at both stops at once, and leaves one into the other."""
    stops = [vi.Stop(direction=1, gap=0.0, restitution=0.8), vi.Stop(direction=-1, gap=0.0, stiffness=39.4)]
    between = system(1.0, 0.07, 2.7, 1.6, stops, force={1: 1.0})
    alone = system(1.0, 0.07, 2.7 + 39.4, 1.6, stops[:1], force={1: 1.0})
    columns = []
    for one in (between, alone):
        hits = impacts(one, 1000)
        hard = (hits["stop"].values == "stop_1") & (hits["velocity"].values > 1e-6)  # how a chatter ends is scaled by V
        columns.append(np.array([hits["time"].values[hard], hits["velocity"].values[hard]])[:, :300])
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
    counts = dict.fromkeys(vi.Status, 0)
    for seed in range(60 if "FUZZ" not in os.environ else 1000):
        rng = np.random.default_rng([38, seed])
        try:
            model = of_any_kind(rng)
            hits = impacts(model, 60)
        except ValueError:  # two stops leave no room
            continue
        status = vi.Status(int(hits["status"]))
        cell = vi.parameter_map(model, omega=[model.omega], indices=["std"], transient_impacts=0, sample_impacts=60)
        counts[status] += 1
        assert (vi.Status(int(cell["status"][0])) == status) or status <= vi.Status.SHORT_WINDOW, seed
        if status not in (vi.Status.NO_IMPACT, vi.Status.STOPPED_IMPACTING, vi.Status.STUCK_FOREVER):
            continue
        last = float(hits["time"].values[-1]) if hits.sizes["impact"] else 0.0
        periods = math.ceil(last / model.period) + 1000
        motion = vi.simulate(model, periods=periods, samples_per_period=4)
        assert motion.sizes["impact"] == hits.sizes["impact"], seed
        held = bool(np.isnan(motion["release_time"]).any())  # by a rigid stop
        assert (int(motion["status"]) == vi.Status.STUCK_FOREVER) == held, seed
        at = slice(-400, None)
        places = zip(motion["displacement"].values[at], motion["time"].values[at], strict=True)
        least = np.array([model.clearances(q, time=t) for q, t in places])
        touched = (least <= 1e-6 * (1.0 + np.abs(motion["displacement"].values[at]).max())).all(axis=0)
        assert touched.any() == (status == vi.Status.STUCK_FOREVER), seed
        if seed < 30:  # the witness has the same contacts, 20 periods later
            start, _, _ = model.initial()
            end = follow(linear(model), start, 0.0 * start, impacts=1000, most_periods=periods - 980)
            assert bool(end.closed or end.pushing) == (status == vi.Status.STUCK_FOREVER), seed
    assert counts[vi.Status.BUDGET] <= 0.05 * sum(counts.values())
    assert min(counts[vi.Status.NO_IMPACT], counts[vi.Status.STOPPED_IMPACTING], counts[vi.Status.STUCK_FOREVER]) > 3
