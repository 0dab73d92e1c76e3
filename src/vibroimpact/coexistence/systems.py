r"""Attractors of systems: initial conditions whose settled impacts agree, stop by stop.

A rest at one stop does not erase what the other coordinates remember, and a motion and its mirror image share all
their indices; so cycles are compared impact by impact. Lanes give of every initial condition the first impact that its
window keeps (stop, phase, velocity), after how many impacts and periods the whole state came back to it within 1e-7 V,
and the mean and the largest velocity of the window. One initial condition is followed onto its cycle; the others lead
there whose first impact is one of the cycle's and whose means are those of the cycle from there on. Where every mode
decays, the impacts of a cycle determine all coordinates.

With P the map of a cycle, x* its fixed point and J the derivative there, :math:`P(x) - x = (J - 1)(x - x^*)`: a state
that came back within 1e-7 V is within :math:`\|(1 - J)^{-1}\|` times that of the cycle. Ten times as much is allowed
for; what lies farther away is followed itself, and joins the cycle that it is found on. No cycle is solved for twice.

Chaos is told apart in the same way, by boxes of the impact surface of each stop that a long sample of it visits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends import ImpactWindow, StroboscopicWindow
from vibroimpact.backends.base import Counts, Floats, SystemSamples
from vibroimpact.coexistence.measuring import EQUAL, SPREAD, Runner, carried
from vibroimpact.coexistence.settling import Settled
from vibroimpact.model import Model, State
from vibroimpact.model.system import ImpactSystem
from vibroimpact.motion import MotionClass
from vibroimpact.orbits.orbit import Impacts, same_orbit
from vibroimpact.orbits.systems import SystemOrbit, ended, find_near
from vibroimpact.orbits.systems.orbit import cycle_of
from vibroimpact.status import Status

SAME = 1e-6  # ten times how near a state must come back; of phases as points of the unit circle, and of the hardest hit
FARTHEST = 1e-3  # of those: so far from a cycle its derivative says little
SOLVED = 64  # impacts of the longest cycle that is solved for
NEAR = 1e-3  # of an orbit solved for, from the impacts that it was solved from
BOXES = 64  # of the impact surface, along phase and along velocity
SHARED = 0.5  # of the impacts of two chaotic motions in the same boxes: above this they are one attractor
SHORTER = 16  # samples that are compared with that of an attractor, than this
STEADY = 1000  # driving periods after which a motion in permanent contact is steady


@dataclass(frozen=True)
class SettledMotion:
    """The impacts of a cycle from its hardest on, or a sample of a motion that does not repeat.

    `losses` are the energies in J that each takes; `orbit` is the cycle solved for, or None; `start` a state on it;
    `tolerance` how near its members come; `periods` the driving periods that it takes.
    """

    phases: Floats
    velocities: Floats
    stops: Counts
    losses: Floats
    start: State
    periods: float
    tolerance: float = SAME
    orbit: SystemOrbit | None = None

    @property
    def energy(self) -> float:
        """Energy lost at the stops per driving period in J."""
        return float(np.nansum(self.losses)) / self.periods


def alike(one: Any, other: Any, tolerance: float = SAME) -> bool:
    """Return whether two cycles are one: all impacts agree, on the same stops, from some impact of either on."""
    if len(one.stops) != len(other.stops) or not len(one.stops):
        return len(one.stops) == len(other.stops)
    fastest = max(np.max(one.velocities, initial=0.0), np.max(other.velocities, initial=0.0))
    first, second = (
        _points(np.asarray(cycle.phases), np.asarray(cycle.velocities) / fastest, np.zeros(len(cycle.stops), np.int64))
        for cycle in (one, other)
    )
    struck, others = np.asarray(one.stops), np.asarray(other.stops)
    return any(
        (np.roll(struck, shift) == others).all() and np.abs(np.roll(first, shift, axis=0) - second).max() <= tolerance
        for shift in range(len(struck))
    )


def _points(phases: Floats, velocities: Floats, stops: Counts) -> Floats:
    angles = 2.0 * np.pi * phases
    return np.column_stack([np.sin(angles), np.cos(angles), velocities, stops])


def cycles(runner: Runner, settled: Settled) -> Iterator[tuple[int, SettledMotion, Counts]]:
    """Yield every cycle that initial conditions lead to: a representative, the cycle, and all of them."""
    distinct: list[tuple[int, SettledMotion, list[Counts]]] = []
    repeats = settled.indices["n_periods"] > 0
    remaining = np.flatnonzero(repeats & np.isin(settled.kind, (MotionClass.PERIODIC, MotionClass.STICKING)))
    while remaining.size:
        at = int(remaining[settled.indices["impacts"][remaining].argmin()])  # the one that settled first
        cycle = follow(runner, settled, at, [other for _, other, _ in distinct])
        leading = remaining[(remaining == at) | _members(settled, remaining, at, cycle)]
        for _, other, members in distinct:
            if alike(other, cycle):
                members.append(leading)
                break
        else:
            distinct.append((at, cycle, [leading]))
        remaining = np.setdiff1d(remaining, leading, assume_unique=True)
    for at, cycle, members in distinct:
        yield at, cycle, np.sort(np.concatenate(members))


def _members(settled: Settled, candidates: Counts, at: int, cycle: SettledMotion) -> NDArray[np.bool_]:
    """Return which initial conditions lead to a cycle, by the first impact of their window and by its means."""
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


def follow(runner: Runner, settled: Settled, at: int, others: Sequence[SettledMotion] = ()) -> SettledMotion:
    """Return the cycle that an initial condition leads to, from as many impacts after the one that came back as before.

    If it is none of the `others`, one of a few impacts is then solved for, if it neither rests nor strikes several
    stops at once.
    """
    system: Any = settled.osc
    n, p = (int(settled.indices[name][at]) for name in ("n_periods", "n_impacts"))
    settling, keep = int(settled.indices["impacts"][at]), 2 * max(p, 16) + 1
    while True:
        samples = _sampled(runner, settled, at, ImpactWindow(settling, keep))
        turns, speeds = samples.impact_periods + samples.impact_phase, samples.impact_velocity
        if turns[-1] - turns[0] > 2 * n - 1e-6 or len(turns) < keep:
            break
        keep *= 2
    early = int(np.searchsorted(turns, turns[0] + n - 1e-6))
    first = _hardest(speeds[:early], samples.impact_stop[:early])
    last = first + p if p > 0 else int(np.searchsorted(turns, turns[first] + n - 1e-6))
    n, span = _smallest(samples, slice(first, last), n)
    phases, speeds, stops = samples.impact_phase[span], speeds[span], samples.impact_stop[span]
    losses, end = samples.impact_energy[span], ended(system, samples)
    cycle = SettledMotion(phases, speeds, stops, losses, end, float(n), _by_growth(settled, at, n * system.period))
    for other in others:
        if alike(other, cycle, other.tolerance):
            return other
    plain = p > 0 and not len(samples.rest_stop) and not samples.impact_simultaneous.any()
    orbit = solved(system, n, stops, turns[span], speeds, end) if plain and len(stops) <= SOLVED else None
    if orbit is None:
        return replace(cycle, start=ended(system, _sampled(runner, settled, at, ImpactWindow(settling, first + 1))))
    numbers = np.array([system.stop_names.index(stop) for stop in orbit.stops])
    start = _state_of(carried(system, orbit.start), orbit.start.time)
    phases, speeds = np.array(orbit.phases), np.array(orbit.velocities)
    return SettledMotion(phases, speeds, numbers, losses, start, float(n), _by_derivative(orbit), orbit)


def sample(runner: Runner, settled: Settled, at: int, window: ImpactWindow) -> SettledMotion:
    """Return a sample of a motion that does not repeat."""
    samples = _sampled(runner, settled, at, window)
    if len(samples.impact_phase) < window.keep:  # it ended later on, but not within its own window
        samples = _sampled(runner, settled, at, ImpactWindow(0, int(settled.indices["impacts"][at]) // 2))
    turns = samples.impact_periods + samples.impact_phase
    state, periods = ended(settled.osc, samples), float(turns[-1] - turns[0])
    return SettledMotion(
        samples.impact_phase, samples.impact_velocity, samples.impact_stop, samples.impact_energy, state, periods
    )


def chaos(runner: Runner, settled: Settled, longest: ImpactWindow) -> Iterator[tuple[int, SettledMotion, Counts]]:
    """Yield every chaotic attractor: a representative, a sample of its impacts, and all that lead to it."""
    distinct: list[tuple[int, SettledMotion, Callable[[Floats, Floats, Counts], bool], list[Counts]]] = []
    remaining = np.flatnonzero(settled.kind == MotionClass.CHAOTIC)
    short = ImpactWindow(longest.transient // SHORTER, max(longest.keep // SHORTER, 1))
    while remaining.size:
        at, others = int(remaining[0]), remaining[1:]
        motion = sample(runner, settled, at, longest)
        visits, leading = _visits_of(motion), [True]
        for some in np.split(others, range(SPREAD, len(others), SPREAD)):
            samples = runner.samples(settled.cells[some], short) if some.size else []
            leading += [visits(one.impact_phase, one.impact_velocity, one.impact_stop) for one in samples]
        for _, _, known, members in distinct:
            if known(motion.phases, motion.velocities, motion.stops):
                members.append(remaining[leading])
                break
        else:
            distinct.append((at, motion, visits, [remaining[leading]]))
        remaining = remaining[~np.array(leading)]
    for at, motion, _, members in distinct:
        yield at, motion, np.sort(np.concatenate(members))


def _visits_of(attractor: SettledMotion) -> Callable[[Floats, Floats, Counts], bool]:
    """Return the test of whether impacts fall into a chaotic attractor's boxes, half as often as its own return."""
    height, half = attractor.velocities.max() / BOXES, len(attractor.stops) // 2

    def boxes(phases: Floats, velocities: Floats, stops: Counts) -> NDArray[np.complex128]:
        corners: NDArray[np.complex128] = np.floor((stops + phases) * BOXES) + 1j * np.floor(velocities / height)
        return corners

    own = boxes(attractor.phases, attractor.velocities, attractor.stops)
    least = SHARED * np.isin(own[half:], own[:half]).mean()
    return lambda *impacts: bool(np.isin(boxes(*impacts), own).mean() > least)


def resting(runner: Runner, settled: Settled, at: int) -> State:
    """Return the state in which an initial condition that ends without impacts comes to stay.

    In permanent contact the other coordinates may still move: that is followed until it is steady.
    """
    twice = 2 * int(settled.indices["impacts"][at]) + 1  # as long as it took to know: weak impacts may last for ever
    system, samples = settled.osc, _sampled(runner, settled, at, ImpactWindow(0, twice))
    if samples.status == Status.STUCK_FOREVER and system.modal().squares.all():
        last = int(samples.impact_periods[-1]) if len(samples.impact_periods) else 0
        samples = _sampled(runner, settled, at, StroboscopicWindow(last + STEADY, 1))
    return ended(system, samples)


def steady_state(system: ImpactSystem) -> State:
    """Return the state at time 0 of the steady motion without stops, where every mode decays."""
    form = system.modal()
    elastic = np.where(form.squares > 0.0, form.squares, np.inf)
    eta, rate = form.constant / elastic, np.zeros(len(elastic))
    for order, force in zip(form.orders.tolist(), form.forces, strict=True):
        turn = order * form.omega
        matrix = np.diag(form.squares - turn**2) + 1j * turn * form.damping
        amplitude = np.linalg.solve(matrix, force) if force.any() else 0.0 * force
        eta, rate = eta + amplitude.imag, rate + turn * amplitude.real
    return State(form.shapes @ eta, form.shapes @ rate)


def _sampled(runner: Runner, settled: Settled, at: int, window: ImpactWindow | StroboscopicWindow) -> SystemSamples:
    return cast(SystemSamples, runner.samples(settled.cells[at : at + 1], window)[0])


def _state_of(cell: Any, time: float) -> State:
    """Return the state in which a cell starts."""
    shapes = cell.shapes[0]
    return State(shapes @ cell.block("eta")[0], shapes @ cell.block("rate")[0], time)


def _hardest(speeds: Floats, stops: Counts) -> int:
    """Return the hardest impact, of those as hard the one on the first stop."""
    tied = np.flatnonzero(speeds >= (1.0 - EQUAL) * speeds.max())
    return int(tied[stops[tied].argmin()])


def _smallest(samples: SystemSamples, span: slice, n: int) -> tuple[int, slice]:
    """Return the smallest number of periods, and the impacts, after which a cycle repeats."""
    p, speeds = span.stop - span.start, samples.impact_velocity[span]
    points = _points(samples.impact_phase[span], speeds / speeds.max(), samples.impact_stop[span])
    for parts in range(math.gcd(n, p), 1, -1):
        if n % parts == p % parts == 0 and np.abs(points - np.roll(points, p // parts, axis=0)).max() <= SAME:
            return n // parts, slice(span.start, span.start + p // parts)
    return n, span


def solved(model: Model, n: int, stops: Counts, turns: Floats, speeds: Floats, end: State) -> SystemOrbit | None:
    """Return the stable orbit that Newton's method reaches from a cycle's impacts or a state, if it is that cycle."""
    system = model.at()
    times = ((turns - math.floor(turns[0])) * system.period).tolist()
    impacts = Impacts(turns % 1.0, speeds)
    for orbit in find_near(model, n, stops.tolist(), times, end):
        if orbit.stable and same_orbit(orbit, impacts, tolerance=NEAR):
            return orbit
    return None


def _by_derivative(orbit: SystemOrbit) -> float:
    """Return the distance from a cycle within which a motion comes back within 1e-7 V."""
    cycle, unknown = cycle_of(orbit)
    jacobian = cycle.monodromy(unknown)
    smallest = float(np.linalg.svd(np.eye(len(jacobian)) - jacobian, compute_uv=False)[-1])
    return min(max(SAME, SAME / smallest if smallest else FARTHEST), FARTHEST)


def _by_growth(settled: Settled, at: int, length: float) -> float:
    """Return the same by the exponent, of a cycle that is not solved for."""
    decay = -math.expm1(min(float(settled.indices["lyapunov"][at]) * length, -SAME))
    return min(SAME / decay, FARTHEST)
