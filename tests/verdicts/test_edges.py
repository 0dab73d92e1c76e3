"""Every edge that a verdict prints holds when the oscillator is carried there in small steps, and just beyond."""

import json
import math

import numpy as np
import pytest

import vibroimpact as vi
from designs import random_designs
from systems import random_pair
from texts import text_of
from vibroimpact.backends import Cells, ImpactWindow
from vibroimpact.coexistence.measuring import Runner, cells_of, orbit_cells, spread_cells
from vibroimpact.motion import MotionClass
from vibroimpact.orbits.search import search_of
from vibroimpact.verdict.boundaries import nearest_boundaries
from vibroimpact.verdict.branches import Branches
from vibroimpact.verdict.present import coexisting_motions, present_motion
from vibroimpact.verdict.ranges import percent, range_of

STEPS = 60  # of a test's own path to an edge
SEEN, LATEST = ImpactWindow(300, 2000), ImpactWindow(30_000, 5000)
LASTING = ImpactWindow(5000, 5000)
UNSURE = (MotionClass.UNDECIDED, MotionClass.BUDGET)


def hits(motion):
    return motion.status.has_indices


class Carried:
    """A motion on its way to an edge."""

    def __init__(self, present, edge):
        self.edge, self.start, self.group = edge, present.start, present.measured.group
        self.value, self.wrong = getattr(present.oscillator, edge.parameter), []
        self.origin = self.value
        if not edge.found:
            self.last = edge.searched_to
        elif edge.exact:
            self.last = edge.value + 1e-3 * (self.origin - edge.value)
        else:
            self.last = edge.value - 1.01 * edge.direction * edge.half_width

    def at(self, share):
        if self.origin > 0.0 and self.last > 0.0:
            return self.origin * (self.last / self.origin) ** share
        return self.origin + share * (self.last - self.origin)

    def cell(self, osc, value):
        return cells_of([osc.replace(**{self.edge.parameter: value})], [self.start])

    @property
    def beyond(self):
        edge = self.edge
        if edge.exact:
            return edge.value - 1e-3 * (self.origin - edge.value)
        return edge.value + edge.direction * edge.half_width


def carry(present, edges, runner):
    """Return what is wrong with the edges of a motion that hits, or rests: sentences."""
    osc, tracks = present.oscillator, [Carried(present, edge) for edge in edges]
    scaled = osc.gap == 0.0 and "amplitude"  # the motion only grows with the force: there is nothing to carry
    tracks = [track for track in tracks if track.last != track.origin and track.edge.parameter != scaled]
    for step in range(1, STEPS + 1) if tracks else ():
        values = [track.at(step / STEPS) for track in tracks]
        cells = Cells.join([track.cell(osc, value) for track, value in zip(tracks, values, strict=True)])
        motions = runner.measure(cells, SEEN)
        states = runner.follow(cells)
        for track, value, motion, state in zip(tracks, values, motions, states, strict=True):
            is_same = motion.motion_class in UNSURE or motion.group == track.group
            if not is_same and track.group[0] != "aperiodic":
                is_same, state = closer(track, osc, value, runner)
            if is_same:
                track.value, track.start = value, state or track.start
            else:
                track.wrong.append((step, value, motion.name))
    return [text for track in tracks for text in faults(present, track, runner)]


def closer(track, osc, value, runner):
    """Follow a motion that left its basin in a step in a hundred smaller ones."""
    first, start = track.value, track.start
    for j in range(1, 101):
        track.start = start
        cell = track.cell(osc, first + (value - first) * j / 100)
        (motion,), (state,) = runner.measure(cell, SEEN), runner.follow(cell)
        if motion.motion_class not in UNSURE and motion.group != track.group:
            return False, None
        start = state or start
    return True, start


def runs(wrong):
    """Yield the values of each run of steps in which the motion was another."""
    steps = np.array([step for step, _, _ in wrong])
    for part in np.split(np.array([value for _, value, _ in wrong]), np.flatnonzero(np.diff(steps) > 1) + 1):
        if part.size:
            yield part


def faults(present, track, runner):
    edge, osc = track.edge, present.oscillator
    where = f"{present.measured.name}: {edge}\n   of {osc}\n   "
    varied = range_of(osc, edge.parameter, 3.0)
    for run in runs(track.wrong):
        if abs(varied.change(run[-1]) - varied.change(run[0])) > edge.spacing:
            yield where + f"another motion on the way, from {run[0]} to {run[-1]}: {track.wrong[:3]}"
    if edge.spacing == 0.0 and track.wrong:
        yield where + f"another motion on the way: {track.wrong[:3]}, followed to {track.value}"
    if edge.found and not edge.at_once:
        cell = track.cell(osc, track.beyond)
        for _ in range(8 if track.group[0] == "aperiodic" else 1):  # chaos ends sooner or later, as it began
            (there,) = runner.measure(cell, LATEST)
            if there.group != track.group or (there.motion_class in UNSURE and track.group[0] != "aperiodic"):
                break
            (track.start,) = runner.follow(track.cell(osc, track.value), 997)
            cell = track.cell(osc, track.beyond)
        else:
            there = edge.value if math.isnan(edge.beyond_at) else edge.beyond_at
            around = spread_cells(osc.replace(**{edge.parameter: there}).cells({}), 64)
            others = {motion.name for motion in runner.measure(around, LATEST)}
            another = edge.kind == "fold" and edge.beyond == present.measured.name  # an orbit of the same n and p
            chaos_goes_on = track.group[0] == "aperiodic" and edge.beyond in others  # beside what may follow on it
            if not (another or chaos_goes_on):
                yield where + f"just beyond, at {track.beyond}, it is the same"


def quiet_faults(present, edge, runner):
    """Yield what is wrong with the three edges of a motion without impacts."""
    osc, name = present.oscillator, edge.parameter
    origin = getattr(osc, name)
    varied = range_of(osc, name, 3.0)
    where = f"{present.measured.name}: {edge}\n   of {osc}\n   "
    end = edge.value if edge.found else edge.searched_to
    if end == origin or varied.only_scales:
        return

    def at(value):
        return osc.replace(**{name: value})

    if edge.kind == "first_contact":
        inside, outside = (at(edge.value + share * (origin - edge.value)) for share in (1e-9, -1e-9))
        if not inside.steady_amplitude <= inside.gap or not outside.steady_amplitude >= outside.gap:
            yield where + "the steady motion does not touch the stop there"
    for share in np.linspace(0.0, 1.0, 400)[:-1]:
        one = at(origin + share * (end - origin))
        if present.measured.kind == "no_impact" and one.damping > 0.0 and one.steady_amplitude > one.gap:
            yield where + f"the steady motion touches the stop at {getattr(one, name)} before"
            break
    for onset, begin in ((edge.from_rest, rest), (edge.from_some, many)):
        if onset is None or onset.change != 0.0:
            last = end if onset is None else onset.value
            shares = np.linspace(0.0, 1.0, 25)[1:-1] if begin is rest else (0.15, 0.4, 0.7, 0.95)
            values = [origin + share * (last - origin) for share in shares]
            begun = [any(map(hits, lasting(begin(at(value)), runner))) for value in values]
            wrong = [(i, value, "") for i, (value, hit) in enumerate(zip(values, begun, strict=True)) if hit]
            for run in runs(wrong):
                if abs(varied.change(run[-1]) - varied.change(run[0])) > (onset.spacing if onset else 0.0):
                    yield where + f"{begin.__name__} hits from {run[0]} to {run[-1]} before {last}"
        if onset is None or onset.change == 0.0:
            continue
        last = edge.direction * (onset.half_width or abs(onset.value - origin) * 1e-4)
        beyond = [onset.value + share * last for share in (1.0, 1.01, 1.02, 1.05)]  # what leads where is fractal
        cells = cells_of([at(value) for value in beyond], [None if begin is rest else onset.start] * 4)
        if not any(map(hits, runner.measure(cells, LASTING))):
            yield where + f"{begin.__name__}: no impacts at {beyond}"
    if edge.strikes and edge.strikes.change and edge.strikes.half_width:
        for way in (-1.01, 1.01):
            cell = cells_of([at(edge.strikes.value + way * edge.direction * edge.strikes.half_width)])
            (motion,) = runner.measure(cell, SEEN)
            if (motion.status == vi.Status.NO_IMPACT) != (way < 0.0):
                yield where + "strikes"


def rest(osc):
    return cells_of([osc])


def many(osc):
    return Cells.join([spread_cells(osc.cells({}), 64), *orbit_cells(search_of(osc))])


def lasting(cells, runner):
    motions = runner.measure(cells, SEEN)
    unnamed = np.array([i for i, motion in enumerate(motions) if hits(motion) and not motion.n_periods], int)
    if unnamed.size:
        for i, motion in zip(unnamed, runner.measure(cells[unnamed], LATEST), strict=True):
            motions[i] = motion
    return motions


def wrong_edges(osc, parameters, runner):
    present = present_motion(osc, runner)
    ranges = [range_of(osc, name, 3.0) for name in parameters]
    edges = nearest_boundaries(present, ranges, runner, Branches(), coexisting_motions(present, runner))
    if present.measured.kind in ("no_impact", "stuck_forever"):
        return [text for edge in edges for text in quiet_faults(present, edge, runner)], present
    return carry(present, edges, runner), present


@pytest.fixture(scope="module")
def quiet():
    """A design of which the steady motion first touches the stop at three times the force, f = |k - m w^2| g."""
    return vi.describe(vi.ImpactOscillator(omega=2.0, gap=1.0), parameters=["amplitude", "omega"])


def test_a_motion_without_impacts_has_an_edge_from_rest_and_one_from_anywhere(quiet):
    osc, up = quiet.oscillator, quiet.boundaries[1]
    assert (up.kind, up.exact) == ("first_contact", True)
    assert up.value == pytest.approx(math.hypot(3.0, 0.02), rel=1e-12)
    assert up.from_rest.value == up.value, "in passing it strikes before, but then swings clear"
    for share, status in ((0.999, vi.Status.NO_IMPACT), (1.001, vi.Status.STOPPED_IMPACTING)):
        (motion,) = Runner().measure(cells_of([osc.replace(amplitude=share * up.strikes.value)]), SEEN)
        assert motion.status == status
    inside, outside = (osc.replace(amplitude=share * up.from_some.value) for share in (0.999, 1.001))
    assert [one.name for one in vi.attractors(inside)] == ["no impact"]
    assert len(vi.attractors(outside)) > 1


def test_the_three_edges_are_said_where_they_differ(quiet):
    text = text_of(quiet)
    assert "1.1543 lasting impacts from some" in text
    assert "1.1628 passing impacts from rest" in text
    assert "3.00007 the motion first touches the" in text
    assert "period-1 impact-1 at 3.00407" in text
    assert "lasting impacts from rest" in text, "below w = 2 they differ"
    assert json.loads(json.dumps(quiet.to_dict(), allow_nan=False))["boundaries"][1]["from_some"]["half_width"] < 1e-6


def test_that_others_hit_already_is_said_with_their_share():
    """From rest no impact, from most initial conditions impacts: the steel tube at 25 Hz."""
    tube = vi.ImpactOscillator(
        mass=2.1, stiffness=26860.0, damping_ratio=0.01, amplitude=5.0, restitution=0.7, gap=0.5e-3, frequency=25.0
    )
    verdict = vi.describe(tube, parameters=["gap"])
    assert verdict.kind == "no_impact"
    hitting = sum(one.share for one in verdict.attractors if one.max_velocity)
    assert hitting > 0.8
    assert f"here already {percent(hitting)} of the initial conditions settle to impacts" in text_of(verdict)
    assert all(edge.from_some.change == 0.0 for edge in verdict.boundaries)


def test_a_bisected_edge_says_how_far_apart_the_values_were():
    verdict = vi.describe(vi.ImpactOscillator(omega=2.8), parameters=["omega"])
    for edge in verdict.boundaries:
        assert edge.kind == "change"
        assert 0.0 < edge.spacing < 0.06
        assert f"in steps of {percent(edge.spacing)}" in text_of(verdict)
    assert "narrower windows of other motions may lie nearer" in text_of(verdict)


@pytest.mark.long
def test_a_motion_that_settles_slowly_is_no_boundary_to_itself():
    slow = vi.ImpactOscillator(damping=0.0181, omega=0.93, restitution=0.898, gap=3.77)
    verdict = vi.describe(slow, parameters=["omega"])
    assert verdict.motion.name == "period-3 impact-1"
    assert all(edge.beyond != "period-3 impact-1" for edge in verdict.boundaries)
    assert all(edge.exact for edge in verdict.boundaries)


def test_a_resonance_narrower_than_any_step_is_not_stepped_over():
    """R = f / |k - m w^2|, and 1000 or more within 0.05 % of the resonance alone."""
    osc = vi.ImpactOscillator(damping_ratio=1e-4, omega=3.0, gap=1000.0)
    down, _ = vi.describe(osc, parameters=["omega"]).boundaries
    assert down.kind == "first_contact"
    assert down.value == pytest.approx(math.sqrt(1.001), rel=1e-4)


def swept(model, edge):
    """Return the shares of the way to an edge, and periods and impacts of the cycle that is swept along there."""
    present, end = model.values[edge.parameter], edge.value if edge.found else edge.searched_to
    shares = np.concatenate([np.linspace(0.0, 0.8, 25), 1.0 - np.geomspace(0.19, 1e-3, 30), [1.001] * edge.found])
    values, direction = present + shares * (end - present), "up" if edge.direction > 0 else "down"
    how = {"indices": ("n_periods", "n_impacts"), "transient_impacts": 3000, "sample_impacts": 200}
    diagram = vi.bifurcation_diagram(model, direction=direction, **how, **{edge.parameter: np.sort(values)})
    cycles = zip(diagram["n_periods"].values, diagram["n_impacts"].values, strict=True)
    return shares, [(int(n), int(p)) for n, p in cycles][:: edge.direction]


SWEPT = {
    "one mass": (vi.ImpactOscillator(omega=2.0), ["omega", "gap"]),
    "two masses, a grazing": (random_pair(22), ["omega"]),
    "one mass, two impacts": (vi.ImpactOscillator(omega=0.95), ["omega", "gap", "restitution"]),
    "two masses, a fold": (random_pair(17), ["omega"]),
    "two masses, a period doubling": (random_pair(0), ["omega"]),
    "two masses, a Neimark-Sacker point": (random_pair(18), ["omega"]),
}


@pytest.mark.long(but=2)
@pytest.mark.parametrize("name", SWEPT)
def test_a_cycle_that_is_swept_to_its_edge_stays_the_same_and_is_another_just_beyond(name):
    model, parameters = SWEPT[name]
    verdict = vi.describe(model, parameters=parameters)
    here = verdict.motion.n_periods, verdict.motion.n_impacts
    for edge in verdict.boundaries:
        shares, cycles = swept(model, edge)
        inside = [cycle for share, cycle in zip(shares, cycles, strict=True) if share < 0.8]
        near = [cycle for share, cycle in zip(shares, cycles, strict=True) if 0.8 <= share < 1.0]
        assert set(inside) == {here}, edge
        assert set(near) <= {here, (0, 0)}, edge  # it settles ever more slowly
        if edge.found:
            assert cycles[-1] != here, edge


@pytest.mark.long
def test_every_edge_of_random_designs_holds():
    rng, runner = np.random.default_rng(1307), Runner()
    for osc in random_designs(rng, 12):
        wrong, _ = wrong_edges(osc, rng.permutation(list(osc.values))[:2].tolist(), runner)
        assert not wrong, wrong[0]
