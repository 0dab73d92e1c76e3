"""Walk one start that stands for others onto its attractor, and describe what it does there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vibroimpact.backends import Cells, ImpactWindow, Measurement, StroboscopicWindow
from vibroimpact.backends.base import Counts, Floats
from vibroimpact.cells import cells_at
from vibroimpact.coexistence.attractor import Attractor
from vibroimpact.coexistence.settling import Fate, Runner, Settled
from vibroimpact.coexistence.starts import CREST
from vibroimpact.oscillator import ImpactOscillator, State
from vibroimpact.status import Status

SAME = 1e-6  # of V: how well the impacts of two cycles must agree to be one cycle
BOXES = 64  # along phase and along velocity
SHARED = 0.5  # of the impacts of two chaotic motions in the same boxes: more, and they are one attractor
WANDERING = 2000  # periods that are told of a motion whose rests have no period


@dataclass(frozen=True)
class Walk:
    """The impacts of a settled motion, those of a cycle from its hardest hit on."""

    velocity: Floats
    phase: Floats


def settled_walk(runner: Runner, cells: Cells, settled: Settled, at: int, longest: ImpactWindow) -> Walk:
    """Return the impacts that start `at` has on its attractor: one cycle, or a long sample of chaos."""
    told = settled.told
    if settled.fate[at] == Fate.PERIODIC:
        # The impacts that closed the cycle brought it within 1e-10 V; as many again leave rounding alone.
        seen = _impacts(
            runner, cells[at : at + 1], ImpactWindow(2 * int(told["impacts"][at]), int(told["n_impacts"][at]))
        )
        turn = -int(seen.velocity.argmax())
        return Walk(np.roll(seen.velocity, turn), np.roll(seen.phase, turn))
    seen = _impacts(runner, cells[at : at + 1], longest)
    if len(seen.velocity) == longest.keep:
        return seen
    half = int(told["impacts"][at]) // 2  # it ended after all; within its own window it has not
    return _impacts(runner, cells[at : at + 1], ImpactWindow(0, half))


def _impacts(runner: Runner, cell: Cells, window: ImpactWindow) -> Walk:
    (seen,) = runner.engine.samples(cell, Measurement(window, runner.limits))
    return Walk(seen.impact_velocity, seen.impact_phase)


def same_cycle(one: Walk, other: Walk, scale: float) -> bool:
    """Return whether two cycles have the same impacts, from whichever of them they are told."""
    if len(one.velocity) != len(other.velocity):
        return False
    most = SAME * scale
    points = [np.column_stack([w.velocity, w.velocity * np.exp(2j * np.pi * w.phase)]) for w in (one, other)]
    # Hits that are equally hard may come first in either.
    return any(
        bool((np.abs(points[0] - np.roll(points[1], turn, axis=0)) <= most).all()) for turn in range(len(points[0]))
    )


def same_chaos(one: Walk, other: Walk) -> bool:
    """Return whether more than half of the impacts of two motions fall into the same boxes of the impact surface."""
    top = max(one.velocity.max(), other.velocity.max())
    parts = [
        np.histogram2d(w.phase, w.velocity, bins=BOXES, range=((0.0, 1.0), (0.0, top)))[0] / len(w.velocity)
        for w in (one, other)
    ]
    return bool(np.minimum(*parts).sum() > SHARED)


def described(runner: Runner, settled: Settled, at: int, members: Counts, seen: Walk) -> Attractor:
    """Return the attractor of start `at` and others, which repeats or wanders as it was seen to."""
    told, chaotic = settled.told, settled.fate[at] == Fate.CHAOTIC
    sample = members if chaotic else [at]
    return Attractor(
        kind="chaotic" if chaotic else "periodic",
        n_periods=int(told["n_periods"][at]),
        n_impacts=int(told["n_impacts"][at]),
        velocities=() if chaotic else tuple(seen.velocity.tolist()),
        phases=() if chaotic else tuple(seen.phase.tolist()),
        **_statistics(seen.velocity),
        lyapunov=float(told["lyapunov"][sample].mean()),
        dissipation=float(told["dissipation"][sample].mean()),
        status=Status(int(settled.status[at])),
        start=State(runner.osc.gap, float(seen.velocity[0]), float(seen.phase[0]) * runner.osc.period),
    )


def sticking(runner: Runner, settled: Settled, at: int) -> Attractor:
    """Return the one attractor that sticks: every release is the same state, sin = k g / f falling.

    Where rounding decides when the mass rests again, it is told of by a long sample, as chaos is.
    """
    osc, n_periods = runner.osc, int(settled.told["n_periods"][at])
    # At rest when the force presses most, the mass waits for its release.
    cell = cells_at(osc, np.zeros(1), np.zeros(1), np.array([CREST]))
    window = StroboscopicWindow(0, n_periods + 2 if n_periods else WANDERING)
    (seen,) = runner.engine.samples(cell, Measurement(window, runner.limits))
    release = seen.release_periods + seen.release_phase
    time = seen.impact_periods + seen.impact_phase
    turn = (time > release[0]) & (time < release[0] + (n_periods or WANDERING))
    velocity, phase = seen.impact_velocity[turn], seen.impact_phase[turn]
    hardest = -int(velocity.argmax())
    return Attractor(
        kind="sticking",
        n_periods=n_periods,
        n_impacts=int(settled.told["n_impacts"][at]),
        velocities=tuple(np.roll(velocity, hardest).tolist()) if n_periods else (),
        phases=tuple(np.roll(phase, hardest).tolist()) if n_periods else (),
        **_statistics(velocity),
        lyapunov=-math.inf,
        dissipation=float(settled.told["dissipation"][at]),
        status=Status.STICKING,
        start=State(osc.gap, 0.0, float(seen.release_phase[0]) * osc.period),
    )


def quiet(osc: ImpactOscillator, fate: Fate, status: int) -> Attractor:
    """Return an attractor without impacts: the steady motion without a stop, or rest."""
    if fate == Fate.STUCK_FOREVER:
        start = State(osc.gap)
    elif fate == Fate.AT_REST:
        start = State(min(0.0, osc.gap))
    else:
        inertia = osc.stiffness - osc.mass * osc.omega**2
        impedance = inertia**2 + (osc.damping * osc.omega) ** 2
        sine, cosine = (
            osc.amplitude * part / impedance if osc.amplitude else 0.0 for part in (inertia, -osc.damping * osc.omega)
        )
        start = State(cosine, sine * osc.omega)
    return Attractor(kind=fate.name.lower(), status=Status(status), start=start)


def _statistics(velocity: Floats) -> dict[str, float]:
    return {
        "std": float(velocity.std()),
        "mean_velocity": float(velocity.mean()),
        "max_velocity": float(velocity.max()),
    }
