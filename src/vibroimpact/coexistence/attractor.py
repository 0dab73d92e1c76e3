"""Attractors: what a result holds of one, and how they are found from what each initial condition settled to.

Initial conditions are first sorted by what does not depend on where a sample began: n and p, the energy lost per
period, the exponent and the closest near-miss of a cycle, or the mean velocity and the impacts per period of chaos.
Wherever the sorted values leave a gap, a new group begins. One of each group is then followed onto its attractor, and
groups with the same cycle (`same_orbit`), or whose chaos fills the same part of the impact surface, become one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from vibroimpact.backends import Cells, ImpactWindow, StroboscopicWindow
from vibroimpact.backends.base import Counts, Floats, energy_loss
from vibroimpact.coexistence import systems
from vibroimpact.coexistence.final import release_phase, released
from vibroimpact.coexistence.measuring import AT_REST, QUIET, Measured, Runner
from vibroimpact.coexistence.settling import Settled, chaotic_groups, clusters
from vibroimpact.coexistence.systems import BOXES, SHARED
from vibroimpact.model import State
from vibroimpact.model.oscillator import ImpactOscillator
from vibroimpact.model.system import ImpactSystem
from vibroimpact.motion import Motion, MotionClass
from vibroimpact.orbits.orbit import Impacts, same_orbit
from vibroimpact.orbits.systems import SystemOrbit
from vibroimpact.showing import Shown, Table
from vibroimpact.status import Status

SAME = 1e-6  # `orbit_distance` between cycles that are one
# Gaps that part groups of cycles, beyond what the way to go (1e-10 V) leaves.
ENERGY_GAP = 1e-7  # of m V^2, of a cycle's loss per period
EXPONENT_GAP = 1e-5  # per period; the logarithm of two equal multipliers is good to 1e-5
MISS_GAP = 1e-6  # of V/w_n
WANDERING = 4000  # impacts, at most, from a release to the next rest that are sampled of intermittent sticking


@dataclass(frozen=True, repr=False)
class Attractor(Shown):
    """A settled motion, and the share of initial conditions that lead to it.

    Parameters
    ----------
    kind : str
        "periodic", "sticking", "chaotic" (watched for 1e5 impacts, see `attractors`), "no_impact" (the mass settles
        clear of the stop), "stuck_forever" (the force never lifts it off the stop) or "at_rest" (nothing drives it).
    n_periods, n_impacts, velocities, phases
        As of `Motion`; `n_periods` is 0 also in intermittent sticking: double precision does not resolve when the mass
        rests again, and for 1e5 impacts it always did.
    std, mean_velocity, max_velocity : float
        Of the impact velocities, in m/s, over exactly one cycle, or over a long sample of chaos.
    lyapunov : float
        Largest Lyapunov exponent in 1/s; -inf for an orbit that sticks.
    dissipation : float
        Energy lost at the stop per driving period, in J.
    status : Status
        How the initial condition that represents the others ended.
    share : float
        Share of the initial conditions that lead here; the total includes undecided ones.
    start : State
        A state on the attractor: at its hardest hit, at its release from the stop, or where it rests.
    transient_impacts : int
        The most impacts that one of the initial conditions took until it was certain to lead here.
    transient_velocity : float
        The hardest hit in m/s seen of those that had not repeated within 500 impacts, before they did; 0 without any.
    stops : tuple of str
        For systems: the stop of each impact of the cycle.
    orbit : SystemOrbit or None
        For systems: the cycle solved exactly, with multipliers, where it does not rest at a stop.

    Notes
    -----
    Numbers that a motion without impacts does not have are NaN.

    Examples
    --------
    >>> Attractor("periodic", 2, 2, max_velocity=0.43).name
    'period-2 impact-2'
    >>> Attractor("no_impact").name
    'no impact'
    """

    kind: str
    n_periods: int = 0
    n_impacts: int = 0
    velocities: tuple[float, ...] = ()
    phases: tuple[float, ...] = ()
    std: float = float("nan")
    mean_velocity: float = float("nan")
    max_velocity: float = float("nan")
    lyapunov: float = float("nan")
    dissipation: float = float("nan")
    status: Status = Status.OK
    share: float = float("nan")
    start: State = field(default_factory=lambda: State(0.0))
    transient_impacts: int = 0
    transient_velocity: float = 0.0
    stops: tuple[str, ...] = ()
    orbit: SystemOrbit | None = field(default=None, repr=False, compare=False)

    @property
    def motion(self) -> Motion:
        """The motion as `recognise` would call it."""
        return Motion(self.kind, self.n_periods, self.n_impacts, self.velocities, self.phases, self.status)

    @property
    def name(self) -> str:
        """The motion in two or three words."""
        return self.motion.name

    def _table(self) -> Table:
        facts = {
            "share of the initial conditions [%]": 100.0 * self.share,
            "hardest impact [m/s]": self.max_velocity,
            "mean impact velocity [m/s]": self.mean_velocity,
            "Std of the impact velocities [m/s]": self.std,
            "largest Lyapunov exponent [1/s]": self.lyapunov,
            "energy lost per driving period [J]": self.dissipation,
        }
        return Table(self.name, ("", ""), [fact for fact in facts.items() if not math.isnan(fact[1])])


def distinct_names(attractors: Sequence[Attractor]) -> list[str]:
    """Return the attractors' names, followed by a letter where several share one."""
    names = [attractor.name for attractor in attractors]
    return [
        f"{name} {_letters(names[:at].count(name))}" if names.count(name) > 1 else name for at, name in enumerate(names)
    ]


def _letters(number: int) -> str:
    """Return a, b, ..., z, ba, bb, ..."""
    rest, digit = divmod(number, 26)
    return (_letters(rest) if rest else "") + chr(ord("a") + digit)


def settled_impacts(runner: Runner, settled: Settled, at: int, longest: ImpactWindow) -> Impacts:
    """Return the settled impacts of initial condition `at`: one cycle from its hardest, or a sample of chaos."""
    cell, computed = settled.cells[at : at + 1], int(settled.indices["impacts"][at])
    if settled.kind[at] == MotionClass.PERIODIC:
        # The impacts that closed the cycle brought it within 1e-10 V; as many again leave only rounding.
        return _from_hardest(_impacts(runner, cell, ImpactWindow(2 * computed, settled[at].n_impacts)))
    sample = _impacts(runner, cell, longest)
    if len(sample.velocities) == longest.keep:
        return sample
    return _impacts(runner, cell, ImpactWindow(0, computed // 2))  # it ended later on, but not within its own window


def _impacts(runner: Runner, cell: Cells, window: ImpactWindow) -> Impacts:
    (samples,) = runner.samples(cell, window)
    return Impacts(samples.impact_phase, samples.impact_velocity)


def _from_hardest(impacts: Impacts) -> Impacts:
    shift = -int(np.argmax(impacts.velocities))
    return Impacts(np.roll(impacts.phases, shift), np.roll(impacts.velocities, shift))


def same_chaos(one: Impacts, other: Impacts) -> bool:
    """Return whether more than half of the impacts of two motions fall into the same boxes of the impact surface."""
    top = max(np.max(one.velocities), np.max(other.velocities))
    parts = [
        np.histogram2d(i.phases, i.velocities, bins=BOXES, range=((0.0, 1.0), (0.0, top)))[0] / len(i.velocities)
        for i in (one, other)
    ]
    return bool(np.minimum(*parts).sum() > SHARED)


def attractor_of(settled: Settled, at: int, members: Counts, impacts: Impacts) -> Attractor:
    """Return the cycle or the chaos that initial condition `at` and other members lead to, from its settled impacts."""
    chaotic = settled.kind[at] == MotionClass.CHAOTIC
    sample = members if chaotic else [at]
    exponent, loss = (float(settled.indices[name][sample].mean()) for name in ("lyapunov", "dissipation"))
    start = State(settled.osc.gap, float(impacts.velocities[0]), float(impacts.phases[0]) * settled.osc.period)
    return _attractor(settled[at], impacts, None if chaotic else impacts, start, exponent, loss)


def sticking_attractor(runner: Runner, settled: Settled, at: int) -> Attractor:
    """Return the one attractor that sticks: every release is the same state, sin = k g / f falling."""
    osc, one = settled.osc, settled[at]
    if not one.n_periods:
        impacts, loss = _turns(runner, osc)
        start = State(osc.gap, 0.0, release_phase(*osc.cells({})) * osc.period)
        return _attractor(one, impacts, None, start, -math.inf, loss)
    (samples,) = runner.samples(AT_REST.cell(osc), StroboscopicWindow(0, one.n_periods + 2))
    release = samples.release_periods + samples.release_phase
    time = samples.impact_periods + samples.impact_phase
    turn = (time > release[0]) & (time < release[0] + one.n_periods)
    impacts = Impacts(samples.impact_phase[turn], samples.impact_velocity[turn])
    start = State(osc.gap, 0.0, float(samples.release_phase[0]) * osc.period)
    return _attractor(one, impacts, _from_hardest(impacts), start, -math.inf, one.indices["dissipation"])


def _turns(runner: Runner, osc: ImpactOscillator) -> tuple[Impacts, float]:
    """Return the impacts of intermittent sticking from moved releases to the next rest, and the energy lost per period.

    One turn from the exact release would be an accident of rounding.
    """
    phases, velocities, periods = [], [], 0.0
    for samples in runner.samples(released(osc.cells({})), ImpactWindow(0, WANDERING)):
        time = samples.impact_periods + samples.impact_phase
        rested = len(samples.stick_phase) > 0 and math.isfinite(samples.release_phase[0])
        end = samples.release_periods[0] + samples.release_phase[0] if rested else time[-1]
        phases.append(samples.impact_phase[time <= end])
        velocities.append(samples.impact_velocity[time <= end])
        periods += float(end) - release_phase(*osc.cells({}))
    impacts = Impacts(np.concatenate(phases), np.concatenate(velocities))
    loss = energy_loss(osc.mass, osc.restitution) * float((np.asarray(impacts.velocities) ** 2).sum()) / periods
    return impacts, loss


def _attractor(
    one: Measured, sample: Impacts, cycle: Impacts | None, start: State, exponent: float, loss: float
) -> Attractor:
    """Return an attractor from a sample of its impacts, and its cycle if it has one."""
    velocity: Floats = np.asarray(sample.velocities)
    phases, velocities = (tuple(np.asarray(column).tolist()) for column in cycle or Impacts((), ()))
    return Attractor(
        kind=one.kind,
        n_periods=one.n_periods,
        n_impacts=one.n_impacts,
        velocities=velocities,
        phases=phases,
        std=float(velocity.std()),
        mean_velocity=float(velocity.mean()),
        max_velocity=float(velocity.max()),
        lyapunov=exponent,
        dissipation=loss,
        status=one.status,
        start=start,
    )


def quiet_attractor(runner: Runner, settled: Settled, at: int) -> Attractor:
    """Return an attractor without impacts: the steady motion without a stop, or rest."""
    osc, one = settled.osc, settled[at]
    ended = one.status == Status.STUCK_FOREVER or not osc.modal().squares.all()  # at rest at a stop, or adrift
    if osc.forgets:
        start = State(osc.gap) if ended else osc.steady_state
    else:
        start = systems.resting(runner, settled, at) if ended else systems.steady_state(osc)
    return Attractor(kind=one.kind, status=one.status, start=start)


def of_system(system: ImpactSystem, one: Measured, motion: systems.SettledMotion) -> Attractor:
    """Return the attractor of a system from its cycle, or a sample of it."""
    repeats = one.n_periods > 0
    n, p = (int(motion.periods), one.n_impacts if one.n_impacts < 0 else len(motion.stops)) if repeats else (0, 0)
    impacts = Impacts(motion.phases, motion.velocities)
    attractor = _attractor(
        replace(one, n_periods=n, n_impacts=p),
        impacts,
        impacts if repeats else None,
        motion.start,
        motion.orbit.lyapunov if motion.orbit else one.indices["lyapunov"],
        motion.energy,
    )
    names = tuple(system.stop_names[stop] for stop in motion.stops) if repeats else ()
    return replace(attractor, stops=names, orbit=motion.orbit)


@dataclass(frozen=True)
class Basin:
    """An attractor and the initial conditions that lead to it."""

    attractor: Attractor
    members: Counts


def match(runner: Runner, settled: Settled, longest: ImpactWindow, counted: int) -> list[Basin]:
    """Return the attractors, the one with the largest share of the first `counted` initial conditions first."""
    striking = _by_indices if settled.osc.forgets else _by_impacts
    quiet = [np.flatnonzero(settled.kind == kind) for kind in QUIET]
    basins = [
        *striking(runner, settled, longest),
        *(Basin(quiet_attractor(runner, settled, int(members[0])), members) for members in quiet if members.size),
    ]
    basins = [replace(basin, attractor=_reached(basin, settled, counted)) for basin in basins]
    return sorted(basins, key=lambda b: (-b.attractor.share, b.attractor.name, -b.attractor.max_velocity))


def _by_impacts(runner: Runner, settled: Settled, longest: ImpactWindow) -> Iterator[Basin]:
    """Yield what strikes stops: cycles and chaos by their impacts, and one of each kind of what else has no period."""
    for found in systems.cycles(runner, settled), systems.chaos(runner, settled, longest):
        for at, motion, members in found:
            yield Basin(of_system(settled.osc, settled[at], motion), members)
    endless = settled.indices["n_periods"] == 0
    for kind in MotionClass.QUASI_PERIODIC, MotionClass.STICKING:
        members = np.flatnonzero((settled.kind == kind) & endless)
        if members.size:
            at = int(members[0])
            motion = systems.sample(runner, settled, at, longest)
            yield Basin(of_system(settled.osc, settled[at], motion), members)


def _by_indices(runner: Runner, settled: Settled, longest: ImpactWindow) -> Iterator[Basin]:
    """Yield what strikes the stop: cycles and chaos by their indices, and all that sticks as one."""
    for groups in (*_cycles(settled), chaotic_groups(settled)):
        yield from _joined(runner, settled, groups, longest)
    members = np.flatnonzero(settled.kind == MotionClass.STICKING)
    if members.size:
        yield Basin(sticking_attractor(runner, settled, int(members[0])), members)


def _reached(basin: Basin, settled: Settled, counted: int) -> Attractor:
    """Return the attractor with the share of initial conditions that lead to it, and how slowly they do."""
    members = basin.members
    return replace(
        basin.attractor,
        share=int((members < counted).sum()) / counted,
        transient_impacts=int(settled.indices["impacts"][members].max()),
        transient_velocity=float(settled.passing[members].max()),
    )


def _cycles(settled: Settled) -> Iterator[list[Counts]]:
    """Yield the groups of initial conditions that lead to cycles, those of one n and p together."""
    osc, indices = settled.osc, settled.indices
    scale = osc.velocity_scale
    periodic = np.flatnonzero(settled.kind == MotionClass.PERIODIC)
    if periodic.size == 0:
        return
    types, which = np.unique(
        np.column_stack([indices["n_periods"][periodic], indices["n_impacts"][periodic]]), axis=0, return_inverse=True
    )
    for number in range(len(types)):
        members = periodic[which.ravel() == number]
        misses = np.nan_to_num(indices["grazing_margin"][members], posinf=-scale)
        columns = [
            (indices["dissipation"][members], ENERGY_GAP * osc.mass * scale**2),
            (indices["lyapunov"][members] * osc.period * types[number, 0], EXPONENT_GAP),
            (misses, MISS_GAP * scale / osc.natural_frequency),
        ]
        yield [members[part] for part in clusters(columns)]


def _joined(runner: Runner, settled: Settled, groups: Sequence[Counts], longest: ImpactWindow) -> Iterator[Basin]:
    """Follow one initial condition of each group, join the groups that it shows to be one, and describe them."""
    distinct: list[tuple[int, Impacts, list[Counts]]] = []
    for group in groups:
        at = int(group[settled.indices["impacts"][group].argmin()])  # the one that settled first
        chaotic = settled.kind[at] == MotionClass.CHAOTIC
        impacts = settled_impacts(runner, settled, at, longest)
        for _, other, members in distinct:
            if same_chaos(impacts, other) if chaotic else same_orbit(impacts, other, tolerance=SAME):
                members.append(group)
                break
        else:
            distinct.append((at, impacts, [group]))
    for at, impacts, joined in distinct:
        together = np.sort(np.concatenate(joined))
        yield Basin(attractor_of(settled, at, together, impacts), together)
