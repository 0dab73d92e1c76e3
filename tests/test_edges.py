"""Every edge that a verdict prints holds when the oscillator is carried there in small steps, and just beyond."""

import numpy as np

import vibroimpact as vi
from designs import random_designs
from vibroimpact.backends import Cells, ImpactWindow
from vibroimpact.coexistence.measuring import Runner, cells_of, orbit_cells, spread_cells
from vibroimpact.motion import MotionClass
from vibroimpact.verdict.boundaries import nearest_boundaries
from vibroimpact.verdict.present import coexisting_motions, present_motion, range_of

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
    tracks = [track for track in tracks if track.last != track.origin]
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
    return Cells.join([spread_cells(osc, 64), *orbit_cells(osc)])


def lasting(cells, runner):
    motions = runner.measure(cells, SEEN)
    left = np.array([i for i, motion in enumerate(motions) if hits(motion) and not motion.n_periods], int)
    if left.size:
        for i, motion in zip(left, runner.measure(cells[left], LATEST), strict=True):
            motions[i] = motion
    return motions


def wrong_edges(osc, parameters, runner):
    present = present_motion(osc, runner)
    ranges = [range_of(osc, name, 3.0) for name in parameters]
    edges = nearest_boundaries(present, ranges, runner, coexisting=coexisting_motions(present, runner))
    if present.measured.kind in ("no_impact", "stuck_forever"):
        return [text for edge in edges for text in quiet_faults(present, edge, runner)], present
    return carry(present, edges, runner), present


def test_every_edge_of_random_designs_holds():
    rng, runner = np.random.default_rng(1307), Runner()
    for osc in random_designs(rng, 12):
        wrong, _ = wrong_edges(osc, rng.permutation(list(osc.values))[:2].tolist(), runner)
        assert not wrong, wrong[0]
