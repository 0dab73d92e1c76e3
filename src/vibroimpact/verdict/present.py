"""The present design of a verdict: its motion from rest, and the motions that coexist with it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from vibroimpact.backends import ImpactWindow, Samples
from vibroimpact.coexistence import Attractor
from vibroimpact.coexistence.attractor import distinct
from vibroimpact.coexistence.final import Final, final_motion
from vibroimpact.coexistence.losses import attracting_kinds
from vibroimpact.coexistence.measuring import (
    HARDLY_EVER,
    PAPER,
    QUIET,
    Measured,
    Runner,
    Start,
    indices_of_cycle,
    last_of,
)
from vibroimpact.coexistence.search import attractors_by, from_rest
from vibroimpact.coexistence.striking import alike, most_like
from vibroimpact.indices import with_missing
from vibroimpact.model import Model, State
from vibroimpact.motion import Motion, MotionClass
from vibroimpact.motion.recognition import motion_of_impacts
from vibroimpact.orbits import Orbit, same_orbit
from vibroimpact.orbits.results import NOTHING, Search
from vibroimpact.orbits.search import ALIKE, search_of, settled_orbit
from vibroimpact.status import Status

STEP_LIMIT = 1 << 29  # certified steps of one mass around a motion: five times those of the dearest of usual designs
SETTLED, SHOWN = 1000, 400  # impacts left out before a cycle is recognised, and those it is recognised from
MOST_IMPACTS = 16  # in a cycle that is still solved for


def step_limit(osc: Any) -> int:
    """Return the number of certified steps that a verdict may take."""
    return STEP_LIMIT // int(osc.step_cost)


@dataclass(frozen=True)
class Present:
    """The motion that a design settles to from rest.

    It was followed to the `final` motion; `motion` is its cycle, and `orbit` the exact solution for it, or None.
    `state` is on it, or at rest if it could not be followed. If an impact is the whole state, `start` continues it bit
    for bit; otherwise it was found as `attractor`.
    """

    model: Model
    oscillator: Any  # what the model is at its values
    final: Final
    motion: Motion
    orbit: Any
    state: State
    start: Start | None = None
    attractor: Attractor | None = None

    @property
    def measured(self) -> Measured:
        """The motion with its indices."""
        return self.final.measured

    @property
    def indices(self) -> dict[str, float]:
        """The indices of its motion; those that the model lacks have no value, as in maps."""
        return with_missing(self.measured.indices, self.oscillator)

    def per_second(self, index: str) -> float:
        """Return an index per driving period as a rate; without a driving period, the engine's periods last 2 pi s."""
        return self.measured.indices[index] / float(self.oscillator.period)

    @property
    def hardest(self) -> float:
        """The hardest hit of its cycle, or of the sample, in m/s; 0 without impacts."""
        return max(self.motion.velocities, default=self.measured.hardest)


def present_motion(model: Model, runner: Runner) -> Present:
    """Return the motion that rest leads to.

    If rounding after a rest at the stop may determine the end of a motion, perturbed releases decide it.
    """
    search = search_of(model)
    return (_by_impacts if search.design.forgets else _by_states)(search, runner)


def _by_impacts(search: Search, runner: Runner) -> Present:
    """Return the motion from rest of a model for which phase and velocity of an impact are the whole state.

    One run measures and samples it; if it has not repeated by then, a longer run follows. Boundaries and advice are
    followed from the first impact of the sample of a cycle, or from the end of any other sample.
    """
    osc = search.design
    final = final_motion(runner, osc, ImpactWindow(SETTLED, SHOWN))
    measured, samples = final.measured, final.samples
    settled = MotionClass(attracting_kinds(osc)[measured.motion_class])
    kind = settled.word if settled in QUIET else measured.kind  # unforced, a mass is at rest
    motion = Motion(kind, measured.n_periods, measured.n_impacts, status=measured.status)
    orbit, start = _solved(search, measured, samples), last_of(samples)
    if measured.motion_class.hits and measured.n_periods:
        if orbit is not None and not orbit.sticks:
            motion = replace(motion, velocities=orbit.velocities, phases=orbit.phases)
            cycle = indices_of_cycle(orbit.n_periods, orbit.velocities, orbit.phases)
            final = replace(final, measured=replace(measured, indices=measured.indices | cycle))
        else:
            time, release = samples.impact_turns * osc.period, samples.rest_end.sum(axis=1) * osc.period
            impacts = time, samples.impact_phase, samples.impact_velocity
            recognised = motion_of_impacts(osc, Status(samples.status), impacts, release)
            motion = recognised if recognised.kind == motion.kind else motion
        pairs = zip(samples.impact_velocity.tolist(), samples.impact_phase.tolist(), strict=True)
        start = next((Start(0.0, -osc.restitution * velocity, phase) for velocity, phase in pairs), None)
    state = osc.rest
    if start is not None:
        state = State(osc.gap - start.clearance, start.velocity, start.phase * osc.period)
    return Present(search.model, osc, final, motion, orbit, state, start)


def _solved(search: Search, measured: Measured, samples: Samples) -> Orbit | None:
    """Return the orbit of a motion of one mass: a sticking one, or one of few impacts; None for others."""
    n, p = measured.n_periods, measured.n_impacts
    if measured.motion_class == MotionClass.STICKING:
        return next(iter(search.of_type(n or 1, -1, None, NOTHING, symmetric=False)), None)
    few = measured.motion_class.hits and n and p <= min(MOST_IMPACTS, len(samples.impact_phase))
    return settled_orbit(search, n, samples, slice(-p, None)) if few else None


def _by_states(search: Search, runner: Runner) -> Present:
    """Return the motion from rest by whole states, followed for 32,767 impacts if it does not repeat."""
    model, system = search.model, search.design
    attractor, measured = from_rest(runner, model)
    (first,) = runner.measure(system.cells({})) if measured.impacts > PAPER.transient + PAPER.keep else [measured]
    final = Final(measured, None, measured.impacts, first if first.name != measured.name else None)
    if attractor is None:
        motion = Motion(measured.kind, status=measured.status)
        return Present(model, system, final, motion, None, system.rest)
    return Present(model, system, final, attractor.motion, attractor.known_orbit, attractor.start, attractor=attractor)


@dataclass(frozen=True)
class Coexisting:
    """A motion that some initial conditions settle to.

    Parameters
    ----------
    name : str
        The motion in two or three words.
    share : float
        The share of the initial conditions that settle to it; shares sum to less than 1 if some stay undecided.
    max_velocity : float
        Its hardest hit in m/s; 0 without impacts.
    dissipation : float
        Energy lost at the stop per driving period, in J; NaN without a driving period, 0 without impacts.
    from_rest : bool
        Whether it is the motion that rest leads to.
    n_periods : int
        Driving periods of its cycle; 0 if it has none.
    start : State
        A state on it.
    transient_impacts, transient_velocity
        As in `Attractor`: how many impacts it may take to reach the motion, and how hard they are.
    stop : str
        For cycles of systems: the stop that the hardest hit strikes.
    attractor : Attractor, optional
        The attractor that it is; None for a motion from rest that is none of those found.
    """

    name: str
    share: float
    max_velocity: float
    dissipation: float
    from_rest: bool
    n_periods: int = 0
    start: State = field(default_factory=lambda: State(0.0))
    transient_impacts: int = 0
    transient_velocity: float = 0.0
    stop: str = ""
    attractor: Attractor | None = field(default=None, repr=False, compare=False)

    @property
    def reached(self) -> bool:
        """Whether one of the initial conditions tried, or rest, leads to it."""
        return self.from_rest or self.share > 0.0

    @property
    def repeats(self) -> bool:
        """Whether it has no impacts, or repeats them before long."""
        return not self.max_velocity or 0 < self.n_periods <= HARDLY_EVER

    @property
    def chaotic(self) -> bool:
        """Whether it is chaotic, also if it is one of several chaotic motions."""
        return self.name.partition(" ")[0] == MotionClass.CHAOTIC.word


def coexisting_motions(present: Present, runner: Runner) -> tuple[Coexisting, ...]:
    """Return the motions that `attractors` finds; the motion from rest is first, with share 0 if it is none of them."""
    attractors = attractors_by(runner, present.model)
    names = distinct([attractor.name for attractor in attractors])
    motions = [_coexisting(*pair) for pair in zip(attractors, names, strict=True)]
    possible = [i for i, attractor in enumerate(attractors) if _is_present(attractor, present)]
    if len(possible) > 1:  # several chaotic motions, also mirror images
        others = [attractors[at].start for at in possible]
        possible = [possible[most_like(runner, present.oscillator, present.state, others)]]
    if not possible:
        measured = present.measured
        loss = measured.loss and present.indices["dissipation"]  # 0 without impacts
        first = Coexisting(measured.name, 0.0, 0.0, loss, True, measured.n_periods, present.state)
    else:
        first = replace(motions.pop(possible[0]), from_rest=True)
    return replace(first, max_velocity=present.hardest), *motions


def _coexisting(attractor: Attractor, name: str) -> Coexisting:
    hits = MotionClass[attractor.kind.upper()].hits
    return Coexisting(
        name=name,
        share=attractor.share,
        max_velocity=attractor.max_velocity if hits else 0.0,
        dissipation=attractor.dissipation if hits else 0.0,
        from_rest=False,
        n_periods=attractor.n_periods,
        start=attractor.start,
        transient_impacts=attractor.transient_impacts,
        transient_velocity=attractor.transient_velocity,
        stop=next(iter(attractor.stops), ""),
        attractor=attractor,
    )


def _is_present(attractor: Attractor, present: Present) -> bool:
    """Whether an attractor may be the present motion; only of the chaotic ones there may be several."""
    measured, followed = present.measured, present.attractor
    if followed is not None:
        return attractor.kind == followed.kind and alike(attractor, followed)
    if attractor.kind == measured.kind == MotionClass.PERIODIC.word:
        if present.motion.velocities:
            return same_orbit(attractor, present.motion, tolerance=ALIKE)
        return (attractor.n_periods, attractor.n_impacts) == (measured.n_periods, measured.n_impacts)
    if attractor.kind == MotionClass.AT_REST.word:
        return measured.motion_class in (*QUIET, MotionClass.DECAYING)
    return attractor.kind == measured.kind
