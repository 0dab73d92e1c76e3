r"""Motions that strike stops: which settled motions are the same, and which initial conditions lead to each.

One initial condition is followed to its cycle, or its chaos is sampled; then the other initial conditions that lead
there are found. An initial condition that leads to a known motion is added to that motion. For one mass, an impact is
the whole state: initial conditions whose indices leave no gap (`settling.cycle_groups`, `chaotic_groups`) lead to one
motion, and so do all that rest at the stop, because every release is the same state.

For systems, a rest at one stop does not erase the state of the other coordinates, and a motion and its mirror image
have the same indices; so cycles are compared impact by impact. For every initial condition the lanes return the first
impact that its window keeps (stop, phase, velocity), the number of impacts and periods after which the whole state
returned to it within 1e-7 V, and the mean and the largest velocity of the window. An initial condition leads to a cycle
if its first impact is one of the cycle and its means are those of the cycle from there on. If every mode decays, the
impacts of a cycle determine all coordinates.

With P the map of a cycle, x* its fixed point and J the derivative there, :math:`P(x) - x = (J - 1)(x - x^*)`: a state
that returned to within 1e-7 V is within :math:`\|(1 - J)^{-1}\|` times that distance of the cycle. Ten times as much is
allowed; a motion farther away is followed itself and added to the cycle on which it is found. No cycle is solved for
twice.

Chaotic motions are distinguished by the boxes, on the impact surface of each stop, that a long sample visits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends import ImpactWindow, StroboscopicWindow
from vibroimpact.backends.base import Counts, Floats, Samples, energy_loss
from vibroimpact.coexistence.final import release_phase, released
from vibroimpact.coexistence.losses import Design
from vibroimpact.coexistence.measuring import AT_REST, EQUAL, SPREAD, Runner, carried
from vibroimpact.coexistence.settling import Settled, chaotic_groups, cycle_groups
from vibroimpact.model import State
from vibroimpact.motion import MotionClass
from vibroimpact.orbits.cycle import cycle_of
from vibroimpact.orbits.distance import Impacts, points_of, smallest_cycle
from vibroimpact.orbits.orbit import Orbit
from vibroimpact.orbits.search import settled_orbit

SAME = 1e-6  # ten times how near a state must come back; of phases as points of the unit circle, and of the hardest hit
FARTHEST = 1e-3  # of those: so far from a cycle its derivative says little
SOLVED = 64  # impacts of the longest cycle that is solved for
BOXES = 64  # of the impact surface, along phase and along velocity
SHARED = 0.5  # of the impacts of two chaotic motions in the same boxes: above this they are one attractor
SHORTER = 16  # samples that are compared with that of an attractor, than this
WANDERING = 4000  # impacts that are sampled of intermittent sticking, at most, from a release to the next rest


@dataclass(frozen=True)
class SettledMotion:
    """The impacts of a cycle of `n_periods`, hardest first, or a sample of a motion that does not repeat (0 periods).

    `start` is a state on it, `exponent` the largest exponent in 1/s, `loss` the energy in J that the stops take per
    driving period; `tolerance` is the distance within which its members lie, `orbit` the cycle solved for, or None.
    """

    phases: Floats
    velocities: Floats
    stops: Counts
    start: State
    exponent: float
    loss: float
    n_periods: int = 0
    tolerance: float = SAME
    orbit: Orbit | None = None

    @cached_property
    def _boxes(self) -> tuple[NDArray[np.complex128], float]:
        """The boxes that it visits, and how often another motion must visit them: half as often as this one."""
        boxes, half = self._boxes_of(self.phases, self.velocities, self.stops), len(self.stops) // 2
        return boxes, SHARED * float(np.isin(boxes[half:], boxes[:half]).mean())

    def _boxes_of(self, phases: Floats, velocities: Floats, stops: Counts) -> NDArray[np.complex128]:
        height = self.velocities.max() / BOXES
        boxes: NDArray[np.complex128] = np.floor((stops + phases) * BOXES) + 1j * np.floor(velocities / height)
        return boxes

    def visited(self, phases: Floats, velocities: Floats, stops: Counts) -> bool:
        """Return whether impacts of a chaotic motion show that it is this one."""
        return self.shared(phases, velocities, stops) > self._boxes[1]

    def shared(self, phases: Floats, velocities: Floats, stops: Counts) -> float:
        """Return the share of some impacts that lie in boxes that this motion visits."""
        return float(np.isin(self._boxes_of(phases, velocities, stops), self._boxes[0]).mean())


def alike(one: Any, other: Any, tolerance: float = SAME) -> bool:
    """Return whether two cycles are the same: all impacts agree, on the same stops, up to a cyclic shift."""
    if len(one.stops) != len(other.stops) or not len(one.stops):
        return len(one.stops) == len(other.stops)
    fastest = max(np.max(one.velocities, initial=0.0), np.max(other.velocities, initial=0.0))
    first, second = (points_of(cycle, fastest) for cycle in (one, other))
    struck, others = np.asarray(one.stops), np.asarray(other.stops)
    return any(
        (np.roll(struck, shift) == others).all() and np.abs(np.roll(first, shift, axis=0) - second).max() <= tolerance
        for shift in range(len(struck))
    )


def striking(settled: Settled) -> Iterator[tuple[int, SettledMotion, Counts]]:
    """Yield for every motion that strikes stops: an initial condition that leads to it, the motion, and all that do."""
    runner, indices, forgets = settled.runner, settled.indices, settled.osc.forgets
    longest = settled.settling.windows[-1]
    endless, sticks = indices["n_periods"] == 0, settled.kind == MotionClass.STICKING
    repeats = np.flatnonzero(~endless & ((settled.kind == MotionClass.PERIODIC) | (sticks & (not forgets))))

    def visitors(others: Counts, _: int, chaos: SettledMotion) -> NDArray[np.bool_]:
        short = ImpactWindow(longest.transient // SHORTER, max(longest.keep // SHORTER, 1))
        parts = np.split(others, range(SPREAD, len(others), SPREAD))
        samples = (one for part in parts for one in runner.samples(settled.cells[part], short))
        return np.array([chaos.visited(one.impact_phase, one.impact_velocity, one.impact_stop) for one in samples])

    lead = (_whole_group, _whole_group) if forgets else (partial(_members, settled), visitors)
    yield from _distinct(settled, cycle_groups(settled, repeats), partial(follow, settled), lead[0], alike)
    for at, motion, members in _distinct(
        settled,
        chaotic_groups(settled),
        lambda at, _: sample(settled, at, longest),
        lead[1],
        lambda chaos, one: chaos.visited(one.phases, one.velocities, one.stops),
    ):
        exponent, loss = (float(indices[name][members].mean()) for name in ("lyapunov", "dissipation"))
        yield at, replace(motion, exponent=exponent, loss=loss), members
    for members in map(np.flatnonzero, (settled.kind == MotionClass.QUASI_PERIODIC, sticks & (endless | forgets))):
        if members.size:
            at = int(members[0])
            yield at, _sticking(settled, at) if forgets else sample(settled, at, longest), members


def _whole_group(candidates: Counts, at: int, motion: SettledMotion) -> NDArray[np.bool_]:
    """Return that all of a group of one mass lead to the motion of one of them."""
    return np.ones(len(candidates), bool)


def _distinct(
    settled: Settled,
    groups: list[Counts],
    followed: Callable[[int, list[SettledMotion]], SettledMotion],
    lead: Callable[[Counts, int, SettledMotion], NDArray[np.bool_]],
    same: Callable[[SettledMotion, SettledMotion], bool],
) -> Iterator[tuple[int, SettledMotion, Counts]]:
    """Follow one initial condition after another, until the motion that each leads to is known."""
    distinct: list[tuple[int, SettledMotion, list[Counts]]] = []
    for remaining in groups:
        while remaining.size:
            at = int(remaining[settled.indices["impacts"][remaining].argmin()])  # the one that settled first
            motion = followed(at, [other for _, other, _ in distinct])
            leading = (remaining == at) | lead(remaining, at, motion)
            for _, other, members in distinct:
                if same(other, motion):
                    members.append(remaining[leading])
                    break
            else:
                distinct.append((at, motion, [remaining[leading]]))
            remaining = remaining[~leading]
    for at, motion, members in distinct:
        yield at, motion, np.sort(np.concatenate(members))


def _members(settled: Settled, candidates: Counts, at: int, cycle: SettledMotion) -> NDArray[np.bool_]:
    """Return which initial conditions lead to a cycle, from the first impact and the means of their window."""
    columns = {name: column[candidates] for name, column in settled.indices.items()}
    fastest, most, p = cycle.velocities.max(), cycle.tolerance, len(cycle.velocities)
    number, repeats = (settled.indices[name][at] for name in ("n_periods", "n_impacts"))
    possible = (columns["n_periods"] == number) & (columns["n_impacts"] == repeats)
    possible &= settled.kind[candidates] == settled.kind[at]
    possible &= np.abs(columns["max_velocity"] - fastest) <= most * fastest
    kept, turn = columns["kept"], np.exp(2j * np.pi * columns["first_phase"])
    sums = np.concatenate([[0.0], np.cumsum(np.tile(cycle.velocities, 2))])
    members = np.zeros(len(candidates), bool)
    for j in range(p):
        matches = possible & (columns["first_stop"] == cycle.stops[j])
        matches &= np.abs(turn - np.exp(2j * np.pi * cycle.phases[j])) <= most
        matches &= np.abs(columns["first_velocity"] - cycle.velocities[j]) <= most * fastest
        if repeats > 0:
            whole, rest = np.divmod(kept, p)
            mean = (whole * sums[p] + sums[j + rest] - sums[j]) / kept
            matches &= np.abs(columns["mean_velocity"] - mean) <= most * fastest
        members |= matches
    return members


def follow(settled: Settled, at: int, others: Sequence[SettledMotion] = ()) -> SettledMotion:
    """Return the cycle that an initial condition leads to, after as many further impacts as it took to close.

    A cycle that is none of the `others` and has few impacts is solved for, unless it rests or strikes several stops at
    once.
    """
    system: Any = settled.osc
    n, p, settling = (int(settled.indices[name][at]) for name in ("n_periods", "n_impacts", "impacts"))
    if system.forgets:  # what closed the cycle brought it within 1e-10 V; as many impacts again leave only rounding
        samples = sampled(settled, at, ImpactWindow(2 * settling, p))
        return _of_one_mass(settled, at, samples.impact_phase, samples.impact_velocity, n)
    keep = 2 * max(p, 16) + 1
    while True:
        samples = sampled(settled, at, ImpactWindow(settling, keep))
        turns, speeds = samples.impact_turns, samples.impact_velocity
        if turns[-1] - turns[0] > 2 * n - 1e-6 or len(turns) < keep:
            break
        keep *= 2
    early = int(np.searchsorted(turns, turns[0] + n - 1e-6))
    first = _hardest(speeds[:early], samples.impact_stop[:early])
    last = first + p if p > 0 else int(np.searchsorted(turns, turns[first] + n - 1e-6))
    n, span = _smallest(samples, slice(first, last), n)
    phases, speeds, stops = samples.impact_phase[span], speeds[span], samples.impact_stop[span]
    loss, end = float(np.nansum(samples.contacts.energy_lost[span])) / n, samples.last_state(system.period)
    exponent = float(settled.indices["lyapunov"][at])
    cycle = SettledMotion(phases, speeds, stops, end, exponent, loss, n, _by_growth(exponent * n * system.period))
    for other in others:
        if alike(other, cycle, other.tolerance):
            return other
    plain = p > 0 and not len(samples.rest_stop) and not samples.impact_simultaneous.any()
    orbit = settled_orbit(settled.settling.search, n, samples, span) if plain and len(stops) <= SOLVED else None
    if orbit is None:
        first_hit = sampled(settled, at, ImpactWindow(settling, first + 1))
        return replace(cycle, start=first_hit.last_state(system.period))
    numbers = np.array([system.stop_names.index(stop) for stop in orbit.stops])
    start = _state_of(carried(system, orbit.start), orbit.start.time)
    phases, speeds = np.array(orbit.phases), np.array(orbit.velocities)
    return SettledMotion(phases, speeds, numbers, start, orbit.lyapunov, loss, n, _by_derivative(orbit), orbit)


def _of_one_mass(settled: Settled, at: int, phases: Floats, speeds: Floats, n: int = 0) -> SettledMotion:
    """Return a motion of one mass from its impacts in the order of time, a cycle of n periods from its hardest."""
    if n:
        phases, speeds = (np.roll(column, -int(np.argmax(speeds))) for column in (phases, speeds))
    start = State(settled.osc.gap, float(speeds[0]), float(phases[0]) * settled.osc.period)
    return _as_settled(settled, at, phases, speeds, np.zeros(len(speeds), np.int64), start, n)


def _as_settled(
    settled: Settled, at: int, phases: Floats, speeds: Floats, stops: Counts, start: State, n: int = 0
) -> SettledMotion:
    """Return a motion with the exponent and the loss of the initial condition that leads to it."""
    exponent, loss = (float(settled.indices[name][at]) for name in ("lyapunov", "dissipation"))
    return SettledMotion(phases, speeds, stops, start, exponent, loss, n)


def most_like(runner: Runner, osc: Design, state: State, others: Sequence[State]) -> int:
    """Return which of some states lies on the motion that does not repeat of another state, or on one most like it."""
    cells = (carried(osc, each) for each in (state, *others))
    mine, *theirs = (runner.samples(cell, ImpactWindow(0, WANDERING))[0] for cell in cells)
    impacts = mine.impact_phase, mine.impact_velocity, mine.impact_stop

    def shared(number: int) -> float:
        one = theirs[number]
        motion = SettledMotion(one.impact_phase, one.impact_velocity, one.impact_stop, state, math.nan, math.nan)
        return motion.shared(*impacts) if len(one.impact_phase) and len(mine.impact_phase) else 0.0

    return max(range(len(theirs)), key=shared)


def sample(settled: Settled, at: int, window: ImpactWindow) -> SettledMotion:
    """Return a sample of a motion that does not repeat."""
    samples = sampled(settled, at, window)
    if len(samples.impact_phase) < window.keep:  # it ended later on, but not within its own window
        samples = sampled(settled, at, ImpactWindow(0, int(settled.indices["impacts"][at]) // 2))
    phases, speeds = samples.impact_phase, samples.impact_velocity
    if settled.osc.forgets:
        return _of_one_mass(settled, at, phases, speeds)
    return _as_settled(settled, at, phases, speeds, samples.impact_stop, samples.last_state(settled.osc.period))


def _sticking(settled: Settled, at: int) -> SettledMotion:
    """Return the motion of one mass that rests at its stop: every release is the same state, sin = k g / f falling."""
    osc, n = settled.osc, settled[at].n_periods
    motion = _turn(settled, at, n) if n else _turns(settled, at)
    return replace(motion, start=State(osc.gap, 0.0, release_phase(osc) * osc.period), exponent=-math.inf)


def _turn(settled: Settled, at: int, n: int) -> SettledMotion:
    """Return a cycle of n periods that rests."""
    (samples,) = settled.runner.samples(AT_REST.cell(settled.osc), StroboscopicWindow(0, n + 2))
    release = samples.rest_end[0].sum()
    time = samples.impact_turns
    turn = (time > release) & (time < release + n)
    return _of_one_mass(settled, at, samples.impact_phase[turn], samples.impact_velocity[turn], n)


def _turns(settled: Settled, at: int) -> SettledMotion:
    """Return the impacts of intermittent sticking from perturbed releases to the next rest.

    From the exact release, rounding would determine the impacts.
    """
    osc, phases, velocities, periods = settled.osc, [], [], 0.0
    for samples in settled.runner.samples(released(osc), ImpactWindow(0, WANDERING)):
        time = samples.impact_turns
        releases = samples.rest_end[:1].sum(axis=1)
        end = releases[0] if np.isfinite(releases).any() else time[-1]
        phases.append(samples.impact_phase[time <= end])
        velocities.append(samples.impact_velocity[time <= end])
        periods += float(end) - release_phase(osc)
    speeds = np.concatenate(velocities)
    loss = energy_loss(osc.mass, osc.restitution) * float((speeds**2).sum()) / periods
    return replace(_of_one_mass(settled, at, np.concatenate(phases), speeds), loss=loss)


def sampled(settled: Settled, at: int, window: ImpactWindow | StroboscopicWindow) -> Samples:
    """Return the samples, in a window, of the motion that initial condition number `at` settles to."""
    return settled.runner.samples(settled.cells[at : at + 1], window)[0]


def _state_of(cell: Any, time: float) -> State:
    """Return the initial state of a cell."""
    shapes = cell.shapes[0]
    return State(shapes @ cell.block("eta")[0], shapes @ cell.block("rate")[0], time)


def _hardest(speeds: Floats, stops: Counts) -> int:
    """Return the hardest impact; of equally hard ones, the one on the first stop."""
    tied = np.flatnonzero(speeds >= (1.0 - EQUAL) * speeds.max())
    return int(tied[stops[tied].argmin()])


def _smallest(samples: Samples, span: slice, n: int) -> tuple[int, slice]:
    """Return the smallest number of periods, and the impacts, after which a cycle repeats."""
    impacts = Impacts(samples.impact_phase[span], samples.impact_velocity[span])
    n, p = smallest_cycle(n, impacts, samples.impact_stop[span], tolerance=SAME)
    return n, slice(span.start, span.start + p)


def _by_derivative(orbit: Orbit) -> float:
    """Return the distance from a cycle within which a motion returns to within 1e-7 V."""
    cycle, unknown = cycle_of(orbit)
    jacobian = cycle.monodromy(unknown)
    smallest = float(np.linalg.svd(np.eye(len(jacobian)) - jacobian, compute_uv=False)[-1])
    return min(max(SAME, SAME / smallest if smallest else FARTHEST), FARTHEST)


def _by_growth(growth: float) -> float:
    """Return the same for a cycle that is not solved for, from the logarithm of its largest multiplier."""
    decay = -math.expm1(min(growth, -SAME))
    return min(SAME / decay, FARTHEST)
