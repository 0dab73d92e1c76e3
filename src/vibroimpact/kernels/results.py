"""From what observers keep to the indices of a cell: one field an index, named as in `vibroimpact.indices`."""

from __future__ import annotations

import math
from typing import NamedTuple

from vibroimpact.kernels import lanes as lane
from vibroimpact.kernels.cell import phase_of
from vibroimpact.kernels.cycle import (
    IMPACTS,
    LOG_RADIUS,
    MISS,
    PARTING,
    PERIODS,
    RESTS,
    SQUARES,
    UNRESOLVED,
    describe_turn,
)
from vibroimpact.kernels.flight import NONE
from vibroimpact.kernels.law import energy_loss
from vibroimpact.kernels.observers import FOLD, Turn, VelocityIndices, velocity_indices
from vibroimpact.kernels.shared.machine import inner

# What is noted of a cell beside its lane; from TURN on, what its lane had summed up at a release.
H, SCALE, FLIGHT, GRANTED, STEPS, RATIO, ADDED, RELEASES, TURN = range(9)
NOTES = TURN + len(Turn._fields) + 2
WALK = 50_000  # steps after which a cycle is given up
PERHAPS = 2000  # steps in which a mass that has stuck once may stick again


class Course(NamedTuple):
    """What decides the status: periods and sticks of the window, impacts and steps computed, and impacts added."""

    span: float
    sticks: float
    counted: float
    steps: float
    added: float


class ThoroughIndices(NamedTuple):
    """Indices that thorough lanes give beside them, and the first kept impact."""

    lyapunov: float
    lyapunov_per_impact: float
    n_periods: float
    n_impacts: float
    dissipation: float
    stick_fraction: float
    impact_phase_spread: float
    grazing_margin: float
    first_phase: float
    first_velocity: float


# The columns of what cells hand out.
PLAIN = Course._fields + VelocityIndices._fields
THOROUGH = PLAIN + ThoroughIndices._fields
_VELOCITIES, _THOROUGH = len(Course._fields), len(PLAIN)


@inner
def _put(result, first, values):
    for j in range(len(values)):
        result[first + j] = values[j]


@inner
def harvest(lanes, i, note, keep, result):
    """Turn the sums of lane i, in lengths of a step, into indices per second and the course of its window."""
    h, sums = note[H], lane.load_sums(lanes, i)
    first, last = lane.load_first(lanes, i), lane.load_last(lanes, i)
    span = (last.n - first.n) + (phase_of(last.s, last.c) - phase_of(first.s, first.c))
    course = Course(
        span=span,
        sticks=lane.load_rests(lanes, i).stuck,
        counted=sums.hits - note[ADDED],
        steps=note[STEPS],
        added=note[ADDED],
    )
    _put(result, 0, course)
    _put(result, _VELOCITIES, velocity_indices(sums, span, note[RATIO], h, keep))


@inner
def harvest_thoroughly(lanes, i, note, facts, cell, keep, result, trace):
    """Turn the sums of a thorough lane and the facts of its cycle into indices; `harvest` comes first."""
    sums, rests = lane.load_sums(lanes, i), lane.load_rests(lanes, i)
    returns = rests.releases > 1.0
    stuck = returns or rests.stuck > 0.0
    if stuck and not facts[RESTS] > 0.0:  # else `close` has described the turn
        describe_turn(lane.load_constants(lanes, i), WALK if returns else PERHAPS, facts, trace)
    period = 2.0 * math.pi / cell.omega
    n_periods, n_impacts = facts[PERIODS], facts[IMPACTS]
    if facts[PERIODS] > 0.0 and facts[PARTING] >= UNRESOLVED:  # it rests again, but rounding decides when
        n_periods, n_impacts = 0.0, -1.0
    phases, opening = lane.load_phases(lanes, i), lane.load_first(lanes, i)
    lost = energy_loss(cell.mass, cell.restitution) / (note[H] * note[H])
    if facts[PERIODS] > 0.0:
        exponent = facts[LOG_RADIUS] / (facts[PERIODS] * period)
        per_impact = facts[LOG_RADIUS] / abs(facts[IMPACTS])
        dissipation = lost * facts[SQUARES] / facts[PERIODS]
        resting = facts[RESTS] / facts[PERIODS]
        margin = facts[MISS]
    else:
        margin = lane.load_misses(lanes, i).margin
        span, later = result[0], keep - 1.0
        first, last = lane.load_first_size(lanes, i), lane.load_last_size(lanes, i)
        growth = -math.inf
        if last.size > 0.0 and not stuck:
            growth = math.log(last.size / first.size) + (last.folds - first.folds) * math.log(FOLD)
            growth -= 0.5 * cell.damping / cell.mass * span * period
        exponent = growth / (span * period) if later > 0.0 else math.nan
        per_impact = growth / later if later > 0.0 else math.nan
        squares = sums.sum2 + sums.shift * (2.0 * sums.sum1 + later * sums.shift)
        dissipation = lost * squares / span if later > 0.0 else math.nan
        resting = 0.0 if later > 0.0 and not stuck else math.nan
    indices = ThoroughIndices(
        lyapunov=exponent,
        lyapunov_per_impact=per_impact,
        n_periods=n_periods,
        n_impacts=n_impacts,
        dissipation=dissipation,
        stick_fraction=resting,
        impact_phase_spread=max(1.0 - math.hypot(phases.s, phases.c) / keep, 0.0),
        grazing_margin=margin if margin < NONE else math.inf,
        first_phase=phase_of(opening.s, opening.c),
        first_velocity=sums.shift / note[H],
    )
    _put(result, _THOROUGH, indices)
