"""The `fixed-step` back end: the scheme of the paper, to reproduce the paper's numbers; it is no reference.

Classical fourth-order Runge-Kutta at a fixed `time_step` from the start; contact is tested only at the ends of steps.
If a step ends at or beyond the stop with positive velocity, an impact is recorded with the velocity and time of that
end, and the mass is placed on the stop with -r times the velocity. Chatter is not treated: a mass that should rest on
the stop rattles with one false impact per step. So `Tolerances.chatter` does not apply and sticks are never detected;
of the budgets only `flight_periods` applies, and `budget` is also the status if the step is too long for the scheme to
stay finite.

Samples are taken at the step nearest to the requested time, with the time of that step. For a time window as in the
paper, [100, 150] s, use a `StroboscopicWindow` that ends at 150 s or later: it holds every impact from the start to its
last sample.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends.base import (
    Floats,
    ImpactWindow,
    LooksWindow,
    Measurement,
    Outcome,
    Samples,
    energy_loss,
)
from vibroimpact.backends.one_mass import OfOneMass
from vibroimpact.cells import Cells
from vibroimpact.indices import INDICES, VELOCITY_INDICES
from vibroimpact.kernels.march import march
from vibroimpact.options import Tolerances
from vibroimpact.parameters import SMALLEST, invalid, real_number
from vibroimpact.status import Status, window_status

TIME_STEP = 0.0005
_ROOM = 4096  # steps and impacts between two tests of whether the motion has ended
_MARCH = 1 << 24  # steps per call, about 0.1 s, between checks for an interrupt


class State(NamedTuple):
    """Distance to the stop u = g - y in m, velocity y' in m/s, time (periods + phase) T."""

    clearance: float
    velocity: float
    periods: float
    phase: float


class Run:
    """The time integration of one oscillator; away from its stop, y'' + c/m y' + k/m y = f/m sin wt."""

    def __init__(self, cell: dict[str, float], time_step: float, tolerances: Tolerances) -> None:
        self.start = State(**{name: cell.pop(name) for name in ("clearance", "velocity", "periods", "phase")})
        self.design, self.h = cell, time_step
        self.omega, self.gap, self.restitution = (cell[name] for name in ("omega", "gap", "restitution"))
        self.damp, self.stiff, self.drive = (
            cell[name] / cell["mass"] for name in ("damping", "stiffness", "amplitude")
        )
        self.period, self.natural = 2.0 * math.pi / self.omega, math.sqrt(self.stiff)
        origin = self.start.phase * self.period
        self.law = self.damp, self.stiff, self.drive, self.omega, self.gap, self.restitution, origin, time_step
        self.longest_flight = tolerances.flight_periods * 2.0 * math.pi / min(self.omega, self.natural)
        self.y, self.v, self.step = self.gap - self.start.clearance, self.start.velocity, 0
        self.impact_steps: list[NDArray[np.int64]] = []
        self.impact_velocities: list[Floats] = []
        self.count, self.flight_from = 0, 0
        if self.start.clearance <= 0.0 and self.v > 0.0:
            self._keep(np.zeros(1, dtype=np.int64), np.array([self.v]))
            self.v *= -self.restitution

    def _keep(self, steps: NDArray[np.int64], velocities: Floats) -> None:
        if len(steps):
            self.impact_steps.append(steps)
            self.impact_velocities.append(velocities)
            self.count += len(steps)
            self.flight_from = int(steps[-1])

    def march_to(self, last: int, impacts: int = _ROOM) -> None:
        """Integrate to a step, or until a number of further impacts is recorded."""
        steps, velocities = np.empty(impacts, dtype=np.int64), np.empty(impacts)
        self.y, self.v, self.step, count = march(self.law, self.y, self.v, self.step, last, steps, velocities)
        self._keep(steps[:count], velocities[:count])

    def fill(self, wanted: int) -> Status:
        """Integrate until a number of impacts is recorded; return OK, or the reason why it never will be."""
        while self.count < wanted:
            self.march_to(self.step + _ROOM, min(_ROOM, wanted - self.count))
            if self.count == wanted:
                break
            if not math.isfinite(self.y) or (self.step - self.flight_from) * self.h > self.longest_flight:
                return Status.BUDGET
            if self.y < self.gap and self._never_again(self.state()):
                return Status.STOPPED_IMPACTING if self.count else Status.NO_IMPACT
        return Status.OK

    def _never_again(self, state: State) -> bool:
        """Whether the stop stays out of reach: R + sqrt(z^2 + (m/k) z'^2) < g, with z = y - steady motion."""
        impedance = self.stiff - self.omega**2 + 1j * self.damp * self.omega
        if impedance == 0.0 or self.gap <= 0.0:
            return False
        steady = self.drive / impedance * np.exp(2j * math.pi * state.phase)
        z, dz = self.gap - state.clearance - steady.imag, state.velocity - self.omega * steady.real
        return bool(abs(steady) + math.hypot(z, dz / self.natural) < self.gap)

    def _look(self, steps: NDArray[np.int64]) -> Floats:
        """Return (y, y') at ascending steps; fewer rows if the scheme diverges."""
        states = np.empty((len(steps), 2))
        for i, step in enumerate(steps):
            while self.step < step and math.isfinite(self.y):
                self.march_to(min(step, self.step + _MARCH))
            if not math.isfinite(self.y):
                return states[:i]
            states[i] = self.y, self.v
        return states

    def times(self, steps: NDArray[np.int64]) -> tuple[Floats, Floats]:
        """Return whole periods and phase at steps."""
        turns = self.start.phase + steps * (self.h / self.period)
        whole = np.floor(turns)
        return self.start.periods + whole, turns - whole

    def state(self) -> State:
        """Return the present state of the mass; a position beyond the stop while moving back is set to the stop."""
        periods, phase = self.times(np.array([self.step]))
        return State(max(self.gap - self.y, 0.0), self.v, float(periods[0]), float(phase[0]))

    def _impacts(self) -> Floats:
        """Return (periods, phase, velocity) of all impacts so far."""
        if not self.impact_steps:
            return np.empty((0, 3))
        periods, phase = self.times(np.concatenate(self.impact_steps))
        return np.column_stack([periods, phase, np.concatenate(self.impact_velocities)])

    def impacts(self, window: ImpactWindow) -> Samples:
        """Return the samples of an impact window."""
        ended = self.fill(window.transient + window.keep)
        kept = self._impacts()[window.transient :]
        span = float((kept[-1, 0] - kept[0, 0]) + (kept[-1, 1] - kept[0, 1])) if len(kept) else 0.0
        status = window_status(sampled=len(kept), wanted=window.keep, stuck=False, periods=span, ended=ended)
        return self._samples(kept, np.empty((0, 4)), status)

    def looks(self, window: LooksWindow) -> Samples:
        """Return the samples of a window of times."""
        periods, phase = window.schedule(self.start.periods, self.start.phase)
        ahead = ((periods - self.start.periods) + (phase - self.start.phase)) * self.period
        at = np.rint(ahead / self.h).astype(np.int64)
        states = self._look(at)
        status = Status.OK if len(states) == window.keep else Status.BUDGET
        return self._samples(self._impacts(), np.column_stack([*self.times(at[: len(states)]), states]), status)

    def _samples(self, impacts: Floats, looks: Floats, status: Status) -> Samples:
        last, sticks = self.state(), np.empty((0, 4))
        with np.errstate(over="ignore"):  # energies of a motion that does not stay finite
            return Samples.of_one_mass(
                self.design, impacts=impacts, looks=looks, sticks=sticks, status=status, last=last, steps=self.step
            )


def impact_indices(samples: Samples, loss: float) -> dict[str, float]:
    """Return the indices that need only kept impacts; an impact at speed v loses the energy `loss` v^2.

    Here `loss` is m (1 - r^2)/2. The energy is the loss of all impacts after the first: these and the flights before
    them make up the span. The spread of the phases is 1 - |mean of exp(2 pi i phase)|.
    """
    velocity, last = samples.impact_velocity, len(samples.impact_velocity) - 1
    # Shifted by the first sample, so that nearly equal velocities keep the digits of their differences.
    shifted = velocity - velocity[0]
    angle = 2.0 * math.pi * samples.impact_phase
    indices = {
        "std": float(np.std(shifted)),
        "mean_velocity": float(velocity[0] + shifted.mean()),
        "max_velocity": float(velocity.max()),
        "impact_phase_spread": max(1.0 - math.hypot(float(np.cos(angle).mean()), float(np.sin(angle).mean())), 0.0),
    }
    if last == 0:
        return indices
    span = float(
        (samples.impact_periods[-1] - samples.impact_periods[0]) + (samples.impact_phase[-1] - samples.impact_phase[0])
    )
    return indices | {
        "impacts_per_period": last / span,
        "dissipation": loss * float((velocity[1:] ** 2).sum()) / span,
    }


class FixedStepBackend(OfOneMass):
    """The paper's scheme behind the back-end protocol.

    It computes one cell after another and every impact, whether or not `early_closing` is set. With contact tested only
    at step ends, no motion sticks, repeats to rounding or has a tangent; `known_indices` are the indices that still
    have a value, and all of them are returned, requested or not.
    """

    name = sampler = "fixed-step"
    smallest_tile = 1
    largest_tile = 1
    slow = True
    known_indices = VELOCITY_INDICES | {"dissipation", "impact_phase_spread"}

    def __init__(self, time_step: float) -> None:
        self.time_step = time_step

    def _runs(self, cells: Cells, measurement: Measurement) -> Iterator[Run]:
        return (Run(cell, self.time_step, measurement.tolerances) for cell in cells)

    def _indices(self, cells: Cells, measurement: Measurement) -> Outcome:
        runs = list(self._runs(cells, measurement))
        samples = [run.impacts(measurement.impacts) for run in runs]
        rows = [
            impact_indices(sample, energy_loss(run.design["mass"], run.restitution))
            if Status(sample.status).has_indices
            else {}
            for run, sample in zip(runs, samples, strict=True)
        ]
        table: Outcome = {
            index.name: np.array([indices.get(index.name, index.fill) for indices in rows], dtype=index.dtype)
            for index in INDICES.values()
        }
        return table | {
            "status": np.array([sample.status for sample in samples], dtype=np.int8),
            "impacts": np.array([run.count for run in runs], dtype=np.int64),
            "steps": np.array([sample.steps for sample in samples], dtype=np.int64),
        }

    def _samples(self, cells: Cells, measurement: Measurement) -> list[Samples]:
        window = measurement.window
        runs = self._runs(cells, measurement)
        if isinstance(window, ImpactWindow):
            return [run.impacts(window) for run in runs]
        return [run.looks(window) for run in runs]


def create(time_step: float = TIME_STEP) -> FixedStepBackend:
    """Return the back end with a time step in s, finite and > 0."""
    allowed, hint = "a finite number > 0", "give the step in s; the paper's is 0.0005"
    step = real_number("time_step", time_step, allowed, hint)
    if not step >= SMALLEST:
        raise invalid("time_step", time_step, allowed, hint)
    return FixedStepBackend(step)
