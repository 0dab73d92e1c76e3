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
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends import ImpactWindow, StroboscopicWindow
from vibroimpact.backends.base import Counts, Floats, SystemSamples
from vibroimpact.coexistence.measuring import Runner, carried
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
STEADY = 1000  # driving periods after which a motion in permanent contact is steady
TIED = 1e-9  # of the hardest hit: hits as hard as that are as hard


@dataclass(frozen=True)
class Seen:
    """The impacts of a cycle from its hardest on, or a sample of a motion that does not repeat.

    `lost` is the energy in J that each takes; `orbit` the cycle solved for, or None; `start` a state on it; `tolerance`
    how near its members come; `whole` the driving periods that it takes.
    """

    phases: Floats
    velocities: Floats
    stops: Counts
    lost: Floats
    start: State
    whole: float
    tolerance: float = SAME
    orbit: SystemOrbit | None = None

    @property
    def energy(self) -> float:
        """Energy lost at the stops per driving period in J."""
        return float(np.nansum(self.lost)) / self.whole


def alike(one: Any, other: Any, tolerance: float = SAME) -> bool:
    """Return whether two cycles are one: all impacts agree, on the same stops, from some impact of either on."""
    if len(one.stops) != len(other.stops) or not len(one.stops):
        return len(one.stops) == len(other.stops)
    fastest = max(np.max(one.velocities, initial=0.0), np.max(other.velocities, initial=0.0))
    first, second = (
        _points(np.asarray(seen.phases), np.asarray(seen.velocities) / fastest, np.zeros(len(seen.stops), np.int64))
        for seen in (one, other)
    )
    struck, others = np.asarray(one.stops), np.asarray(other.stops)
    return any(
        (np.roll(struck, shift) == others).all() and np.abs(np.roll(first, shift, axis=0) - second).max() <= tolerance
        for shift in range(len(struck))
    )


def _points(phases: Floats, velocities: Floats, stops: Counts) -> Floats:
    angles = 2.0 * np.pi * phases
    return np.column_stack([np.sin(angles), np.cos(angles), velocities, stops])


def cycles(runner: Runner, settled: Settled) -> Iterator[tuple[int, Seen, Counts]]:
    """Yield every cycle that initial conditions lead to: a representative, the cycle, and all of them."""
    found: list[tuple[int, Seen, list[Counts]]] = []
    repeats = settled.indices["n_periods"] > 0
    left = np.flatnonzero(repeats & np.isin(settled.kind, (MotionClass.PERIODIC, MotionClass.STICKING)))
    while left.size:
        at = int(left[settled.indices["impacts"][left].argmin()])  # the one that settled first
        seen = follow(runner, settled, at, [known for _, known, _ in found])
        mine = left[(left == at) | _members(settled, left, at, seen)]
        for _, known, members in found:
            if alike(known, seen):
                members.append(mine)
                break
        else:
            found.append((at, seen, [mine]))
        left = np.setdiff1d(left, mine, assume_unique=True)
    for at, seen, members in found:
        yield at, seen, np.sort(np.concatenate(members))


def _members(settled: Settled, left: Counts, at: int, seen: Seen) -> NDArray[np.bool_]:
    """Return which initial conditions lead to a cycle, by the first impact of their window and by its means."""
    own = {name: column[left] for name, column in settled.indices.items()}
    fastest, most, p = seen.velocities.max(), seen.tolerance, len(seen.velocities)
    number, repeats = (settled.indices[name][at] for name in ("n_periods", "n_impacts"))
    alike = (own["n_periods"] == number) & (own["n_impacts"] == repeats) & (settled.kind[left] == settled.kind[at])
    alike &= np.abs(own["max_velocity"] - fastest) <= most * fastest
    kept, turn = own["kept"], np.exp(2j * np.pi * own["first_phase"])
    sums = np.concatenate([[0.0], np.cumsum(np.tile(seen.velocities, 2))])
    found = np.zeros(len(left), bool)
    for j in range(p):
        here = alike & (own["first_stop"] == seen.stops[j])
        here &= np.abs(turn - np.exp(2j * np.pi * seen.phases[j])) <= most
        here &= np.abs(own["first_velocity"] - seen.velocities[j]) <= most * fastest
        if repeats > 0:
            whole, rest = np.divmod(kept, p)
            mean = (whole * sums[p] + sums[j + rest] - sums[j]) / kept
            here &= np.abs(own["mean_velocity"] - mean) <= most * fastest
        found |= here
    return found


def follow(runner: Runner, settled: Settled, at: int, known: Sequence[Seen] = ()) -> Seen:
    """Return the cycle that an initial condition leads to, from as many impacts after the one that came back as before.

    If it is none of those known, one of a few impacts is then solved for, if it neither rests nor strikes several stops
    at once.
    """
    system: Any = settled.osc
    n, p = (int(settled.indices[name][at]) for name in ("n_periods", "n_impacts"))
    settling, keep = int(settled.indices["impacts"][at]), 2 * max(p, 16) + 1
    while True:
        seen = _sampled(runner, settled, at, ImpactWindow(settling, keep))
        turns, speeds = seen.impact_periods + seen.impact_phase, seen.impact_velocity
        if turns[-1] - turns[0] > 2 * n - 1e-6 or len(turns) < keep:
            break
        keep *= 2
    early = int(np.searchsorted(turns, turns[0] + n - 1e-6))
    first = _hardest(speeds[:early], seen.impact_stop[:early])
    last = first + p if p > 0 else int(np.searchsorted(turns, turns[first] + n - 1e-6))
    n, cycle = _smallest(seen, slice(first, last), n)
    phases, speeds, stops = seen.impact_phase[cycle], speeds[cycle], seen.impact_stop[cycle]
    lost, end = seen.impact_energy[cycle], ended(system, seen)
    found = Seen(phases, speeds, stops, lost, end, float(n), _by_growth(settled, at, n * system.period))
    for other in known:
        if alike(other, found, other.tolerance):
            return other
    plain = p > 0 and not len(seen.rest_stop) and not seen.impact_simultaneous.any()
    orbit = solved(system, n, stops, turns[cycle], speeds, end) if plain and len(stops) <= SOLVED else None
    if orbit is None:
        return replace(found, start=ended(system, _sampled(runner, settled, at, ImpactWindow(settling, first + 1))))
    numbers = np.array([system.stop_names.index(stop) for stop in orbit.stops])
    start = _state_of(system, carried(system, orbit.start), orbit.start.time)
    phases, speeds = np.array(orbit.phases), np.array(orbit.velocities)
    return Seen(phases, speeds, numbers, lost, start, float(n), _by_derivative(orbit), orbit)


def sample(runner: Runner, settled: Settled, at: int, window: ImpactWindow) -> Seen:
    """Return a sample of a motion that does not repeat."""
    seen = _sampled(runner, settled, at, window)
    turns = seen.impact_periods + seen.impact_phase
    state, whole = ended(settled.osc, seen), float(turns[-1] - turns[0])
    return Seen(seen.impact_phase, seen.impact_velocity, seen.impact_stop, seen.impact_energy, state, whole)


def resting(runner: Runner, settled: Settled, at: int) -> State:
    """Return the state in which an initial condition that ends without impacts comes to stay.

    In permanent contact the other coordinates may still move: that is followed until it is steady.
    """
    twice = 2 * int(settled.indices["impacts"][at]) + 1  # as long as it took to know: weak impacts may last for ever
    system, seen = settled.osc, _sampled(runner, settled, at, ImpactWindow(0, twice))
    if seen.status == Status.STUCK_FOREVER and system.modal().squares.all():
        last = int(seen.impact_periods[-1]) if len(seen.impact_periods) else 0
        seen = _sampled(runner, settled, at, StroboscopicWindow(last + STEADY, 1))
    return ended(system, seen)


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
    (seen,) = runner.samples(settled.cells[at : at + 1], window)
    found: Any = seen
    return found  # type: ignore[no-any-return]


def _state_of(system: ImpactSystem, cell: Any, time: float) -> State:
    """Return the state in which a cell starts."""
    shapes = cell.shapes[0]
    return State(shapes @ cell.block("eta")[0], shapes @ cell.block("rate")[0], time)


def _hardest(speeds: Floats, stops: Counts) -> int:
    """Return the hardest impact, of those as hard the one on the first stop."""
    tied = np.flatnonzero(speeds >= (1.0 - TIED) * speeds.max())
    return int(tied[stops[tied].argmin()])


def _smallest(seen: SystemSamples, cycle: slice, n: int) -> tuple[int, slice]:
    """Return the smallest number of periods, and the impacts, after which a cycle repeats."""
    p, speeds = cycle.stop - cycle.start, seen.impact_velocity[cycle]
    points = _points(seen.impact_phase[cycle], speeds / speeds.max(), seen.impact_stop[cycle])
    for parts in range(math.gcd(n, p), 1, -1):
        if n % parts == p % parts == 0 and np.abs(points - np.roll(points, p // parts, axis=0)).max() <= SAME:
            return n // parts, slice(cycle.start, cycle.start + p // parts)
    return n, cycle


def solved(model: Model, n: int, stops: Counts, turns: Floats, speeds: Floats, end: State) -> SystemOrbit | None:
    """Return the stable orbit that Newton's method reaches from a cycle's impacts or a state, if it is that cycle."""
    system = model.at()
    times = ((turns - math.floor(turns[0])) * system.period).tolist()
    impacts = Impacts(turns % 1.0, speeds)
    for orbit in find_near(model, n, stops.tolist(), times, end):
        if orbit.stable and orbit.admissible and same_orbit(orbit, impacts, tolerance=NEAR):
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
    left = -math.expm1(min(float(settled.indices["lyapunov"][at]) * length, -SAME))
    return min(SAME / left, FARTHEST)
