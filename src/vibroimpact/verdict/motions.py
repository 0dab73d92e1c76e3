"""The motions of designs: measured many at once, each from its own start, and the one from rest in detail."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from threading import Event
from typing import Any

import numpy as np
import xarray as xr

from vibroimpact.backends import Cells, ImpactWindow, Measurement, get_backend
from vibroimpact.coexistence import Attractor, attractors
from vibroimpact.execution.threads import run_sweep, worker_count
from vibroimpact.indices import INDICES
from vibroimpact.motion import Motion, MotionClass, decide, motion_name, recognise
from vibroimpact.options import Tolerances
from vibroimpact.orbits import Orbit, find_orbit, orbit_distance, same_orbit
from vibroimpact.orbits.orbit import Impacts
from vibroimpact.oscillator import ImpactOscillator, Model
from vibroimpact.sections import impact_section
from vibroimpact.status import Status

PAPER = ImpactWindow(100, 5000)
BRIEF = ImpactWindow(100, 1500)  # enough for a name, and an exponent to a few per cent
THRIFT = 100  # certified steps per impact, but for the motion itself: others are not worth a long wait for rare hits
HARDLY_EVER = 64  # periods: chaos in which the mass rests now and then is, strictly, a long sticking cycle
SETTLED, SHOWN = 1000, 400  # impacts left out before a cycle is recognised, and those it is recognised from
ALIKE = 5e-3  # `orbit_distance` from the settled motion within which an orbit or attractor is the same
LONGEST = 16  # impacts in a cycle that is still solved for
QUIET = (MotionClass.NO_IMPACT, MotionClass.STUCK_FOREVER)


@dataclass(frozen=True)
class Start:
    """Clearance to the stop in m, velocity in m/s and driving phase: what a motion is continued from."""

    clearance: float
    velocity: float
    phase: float


@dataclass(frozen=True)
class Measured:
    """The status and indices of one motion, from `sampled` impacts."""

    status: Status
    indices: dict[str, float]
    sampled: int

    @cached_property
    def motion_class(self) -> MotionClass:
        """The kind of the motion, by the rule of `classify`."""
        growth = self.sampled * self.indices["lyapunov_per_impact"]
        return MotionClass(int(decide(self.status, growth, self.n_periods, self.n_impacts)))

    @property
    def kind(self) -> str:
        """The kind of the motion in a word."""
        return self.motion_class.word

    @property
    def n_periods(self) -> int:
        """Driving periods in a cycle; 0 where there is none."""
        return int(self.indices["n_periods"])

    @property
    def n_impacts(self) -> int:
        """Impacts in a cycle; -1 for a complete chatter."""
        return int(self.indices["n_impacts"])

    @property
    def group(self) -> tuple[str, int, int]:
        """What distinguishes classes of motion along a path; all that do not repeat, or hardly ever, are one."""
        rare = self.n_periods > HARDLY_EVER or (self.motion_class == MotionClass.STICKING and not self.n_periods)
        if rare or self.motion_class in (MotionClass.CHAOTIC, MotionClass.UNDECIDED):
            return "aperiodic", 0, 0
        return self.kind, self.n_periods, self.n_impacts

    @property
    def name(self) -> str:
        """The motion in two or three words."""
        return motion_name(self.motion_class, self.n_periods, self.n_impacts)

    @property
    def hardest(self) -> float:
        """The largest impact velocity in m/s; 0 where the mass does not hit, NaN where it is not known."""
        return 0.0 if self.motion_class in QUIET else self.indices["max_velocity"]

    @property
    def loss(self) -> float:
        """Energy lost at the stop per driving period, in J; NaN where it is not known."""
        return 0.0 if self.motion_class in QUIET else self.indices["dissipation"]


@dataclass(frozen=True)
class Engine:
    """How motions are computed: tolerances and threads; `cells` counts them."""

    tolerances: Tolerances = field(default_factory=Tolerances)
    workers: int | None = None
    cells: list[int] = field(default_factory=lambda: [0])

    def measure(
        self, designs: Sequence[Model], starts: Sequence[Start | None], window: ImpactWindow = PAPER
    ) -> list[Measured]:
        """Return the motion of each design from its start; None is at rest at min(0, gap)."""
        if not designs:
            return []
        self.cells[0] += len(designs)
        cells, names = _cells(designs, starts), tuple(INDICES)
        table: dict[str, Any] = {name: np.full(len(cells), np.nan) for name in (*names, "status")}
        limits = self.tolerances
        if window is not PAPER:
            limits = replace(limits, steps_per_impact=min(limits.steps_per_impact, THRIFT))
        measurement = Measurement(window, limits, indices=names)
        for which, found in run_sweep(get_backend("cpu"), cells, measurement, worker_count(self.workers), Event()):
            for name, column in table.items():
                column[which] = found[name]
        return [
            Measured(Status(int(table["status"][i])), {name: float(table[name][i]) for name in names}, window.keep)
            for i in range(len(cells))
        ]

    def follow(
        self, designs: Sequence[Model], starts: Sequence[Start | None], impacts: int = 300
    ) -> list[Start | None]:
        """Return where each motion is after so many impacts, or None where it could not be followed."""
        if not designs:
            return []
        window = ImpactWindow(impacts, 1)
        seen = get_backend("cpu").samples(_cells(designs, starts), Measurement(window, self.tolerances))
        return [
            Start(max(s.last_clearance, 0.0), s.last_velocity, s.last_phase)
            if s.status != Status.BUDGET and all(map(math.isfinite, (s.last_clearance, s.last_velocity, s.last_phase)))
            else None
            for s in seen
        ]


def _cells(designs: Sequence[Model], starts: Sequence[Start | None]) -> Cells:
    """Return one cell per design."""
    return Cells.join([_cell(design, start) for design, start in zip(designs, starts, strict=True)])


def _cell(design: Model, start: Start | None) -> Cells:
    cell = design.at().cells({})
    if start is None:
        return cell
    return cell.replace(clearance=start.clearance, velocity=start.velocity, phase=start.phase)


@dataclass(frozen=True)
class Present:
    """The motion that a design settles to from rest: measured, its cycle, its exact orbit if any, a state on it."""

    model: Model
    oscillator: ImpactOscillator
    measured: Measured
    motion: Motion
    orbit: Orbit | None
    state: Start | None

    @property
    def kind(self) -> MotionClass:
        """The kind of the motion."""
        return self.measured.motion_class


def present_motion(model: Model, engine: Engine) -> Present:
    """Return the motion that a start from rest settles to.

    The orbit is measured once and, where it has a cycle, sampled once; the first impact of the sample is the state that
    its boundaries and advice are followed from.
    """
    osc = model.at()
    (measured,) = engine.measure([osc], [None])
    motion = Motion(measured.kind, measured.n_periods, measured.n_impacts, status=measured.status)
    if not (measured.motion_class.hits and measured.n_periods):
        (state,) = engine.follow([osc], [None], SETTLED)
        orbit = _sticking_orbit(model, 1) if measured.motion_class == MotionClass.STICKING else None
        return Present(model, osc, measured, motion, orbit, state)
    section = impact_section(osc, transient_impacts=SETTLED, sample_impacts=SHOWN, tolerances=engine.tolerances)
    seen = recognise(section)
    if measured.motion_class == MotionClass.STICKING:
        orbit = _sticking_orbit(model, measured.n_periods)
    else:
        orbit = _cycle(model, measured, section)
    if orbit is not None and not orbit.sticks:
        motion = replace(motion, velocities=orbit.velocities, phases=orbit.phases)
    elif seen.kind == motion.kind:
        motion = seen
    return Present(model, osc, measured, motion, orbit, _after_first(osc, section))


def _after_first(osc: ImpactOscillator, section: xr.Dataset) -> Start | None:
    """Return the state just after the first impact of a section."""
    if not section.sizes["impact"]:
        return None
    return Start(0.0, -osc.restitution * float(section["velocity"][0]), float(section["phase"][0]))


def _sticking_orbit(model: Model, n_periods: int) -> Orbit | None:
    return next(iter(find_orbit(model, n_periods=n_periods, n_impacts=-1)), None)


def _cycle(model: Model, measured: Measured, section: xr.Dataset) -> Orbit | None:
    """Return the stable orbit that the settled motion is on."""
    if measured.n_impacts > LONGEST or section.sizes["impact"] < measured.n_impacts:
        return None
    last = Impacts(*(section[name].values[-measured.n_impacts :] for name in ("phase", "velocity")))
    near = float(last.phases[-1]), float(last.velocities[-1])
    found = [
        orbit
        for orbit in find_orbit(model, n_periods=measured.n_periods, n_impacts=measured.n_impacts, near=near)
        if orbit.stable and orbit.admissible and same_orbit(orbit, last, tolerance=ALIKE)
    ]
    return min(found, key=partial(orbit_distance, last), default=None)


@dataclass(frozen=True)
class Coexisting:
    """A motion that some initial conditions settle to.

    Parameters
    ----------
    name : str
        The motion in two or three words.
    share : float
        The share of the initial conditions that settle to it; shares sum to less than 1 where some stay undecided.
    max_velocity : float
        Its hardest hit in m/s; 0 where it does not hit.
    dissipation : float
        Energy lost at the stop per driving period, in J.
    from_rest : bool
        Whether it is the motion that a start from rest settles to.
    """

    name: str
    share: float
    max_velocity: float
    dissipation: float
    from_rest: bool


def coexisting_motions(present: Present, engine: Engine) -> tuple[Coexisting, ...]:
    """Return the motions that `attractors` finds, that from rest first, with share 0 if it is none of them."""
    found = attractors(present.oscillator, tolerances=engine.tolerances, workers=engine.workers)
    motions = [_coexisting(attractor) for attractor in found]
    same = next((i for i, attractor in enumerate(found) if _is_present(attractor, present)), None)
    if same is None:
        measured = present.measured
        first = Coexisting(measured.name, 0.0, measured.hardest, measured.loss, True)
    else:
        first = replace(motions.pop(same), from_rest=True)
    return first, *motions


def _coexisting(attractor: Attractor) -> Coexisting:
    hits = MotionClass[attractor.kind.upper()].hits
    velocity, loss = (attractor.max_velocity, attractor.dissipation) if hits else (0.0, 0.0)
    return Coexisting(attractor.name, attractor.share, velocity, loss, False)


def _is_present(attractor: Attractor, present: Present) -> bool:
    """Whether an attractor is the present motion; of those that stick or do not hit there is one of each kind."""
    measured = present.measured
    if attractor.kind == measured.kind == MotionClass.PERIODIC.word:
        if present.motion.velocities:
            return same_orbit(attractor, present.motion, tolerance=ALIKE)
        return (attractor.n_periods, attractor.n_impacts) == (measured.n_periods, measured.n_impacts)
    if attractor.kind == MotionClass.AT_REST.word:
        return measured.motion_class in (*QUIET, MotionClass.DECAYING)
    return attractor.kind == measured.kind
