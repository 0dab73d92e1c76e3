"""Where Newton's method may begin: motions that the engine followed from impacts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vibroimpact.backends import ImpactWindow, Samples, get_backend
from vibroimpact.backends.starts import make_cells
from vibroimpact.options import Tolerances
from vibroimpact.orbits.admissibility import contacts
from vibroimpact.orbits.equations import Cycle, Floats
from vibroimpact.oscillator import ImpactOscillator

GRID = (40, 28)  # starts on the impact surface: phases, velocities
TRIES = 40  # of them that Newton's method is given beside the local minima of the miss
SETTLING = 2000  # impacts left out on the way to the attractor


def followed(osc: ImpactOscillator, cycle: Cycle, phases: Floats, velocities: Floats) -> list[Floats | None]:
    """Return from each impact the p impacts that follow, itself included, and the next: turns and velocities."""
    return [_chain(seen, cycle.n_impacts) for seen in contacts(osc, phases, velocities, cycle.n_impacts)]


def _chain(seen: Samples, p: int) -> Floats | None:
    """Return turns and velocities of p + 1 impacts in a row, or None if there are fewer."""
    if len(seen.impact_phase) < p + 1:
        return None
    periods, phases, velocities = (
        column[-p - 1 :] for column in (seen.impact_periods, seen.impact_phase, seen.impact_velocity)
    )
    return np.concatenate([periods - periods[0] + phases, velocities])


def cycle_of(chain: Floats) -> Floats:
    """Return the cycle that a chain would be if its last impact were its first again."""
    p = len(chain) // 2 - 1
    return np.concatenate([chain[:p], chain[p + 1 : -1]])


def _miss(cycle: Cycle, chain: Floats | None, speed: float) -> float:
    """Return how badly a chain closes after n periods, in turns and parts of a speed; infinite if it is another one."""
    if chain is None:
        return np.inf
    p = cycle.n_impacts
    late = abs(chain[p] - chain[0] - cycle.n_periods)
    return float(late + abs(chain[-1] - chain[p + 1]) / speed) if late < 0.5 else np.inf


def settled(osc: ImpactOscillator, cycle: Cycle) -> Floats | None:
    """Return the last impacts of the motion that the mass settles on from rest."""
    cells = make_cells(osc, None)
    if osc.gap <= 0.0:  # a hair off balance, else nothing starts
        cells = replace(cells, velocity=cells.velocity - 1e-3 * osc.velocity_scale)
    window = ImpactWindow(SETTLING, cycle.n_impacts + 1)
    (seen,) = get_backend("cpu").samples(cells, window, Tolerances())
    return _chain(seen, cycle.n_impacts)


def candidates(osc: ImpactOscillator, cycle: Cycle) -> list[Floats]:
    """Return cycles to begin with: the attractor's, then those of a grid on the impact surface that close best."""
    attractor = settled(osc, cycle)
    hardest = 0.0 if attractor is None else float(attractor[cycle.n_impacts + 1 :].max())
    fastest = max(2.0 * osc.velocity_scale, 1.5 * hardest)
    phases, velocities = np.meshgrid(np.arange(GRID[0]) / GRID[0], fastest * (np.arange(GRID[1]) + 0.5) / GRID[1])
    chains = followed(osc, cycle, phases.ravel(), velocities.ravel())
    misses = np.array([_miss(cycle, chain, fastest) for chain in chains]).reshape(phases.shape)
    # Rows are velocities, columns phases on the circle: nothing beyond the rows comes close.
    walled = np.pad(np.pad(misses, ((0, 0), (1, 1)), mode="wrap"), ((1, 1), (0, 0)), constant_values=np.inf)
    around = [np.roll(walled, (a, b), (0, 1))[1:-1, 1:-1] for a in (-1, 0, 1) for b in (-1, 0, 1)]
    lowest = np.isfinite(misses) & (misses <= np.min(around, axis=0))
    best = misses.ravel() <= np.partition(misses.ravel(), TRIES)[TRIES]
    chosen = np.flatnonzero((lowest.ravel() | best) & np.isfinite(misses.ravel()))
    chosen = chosen[np.argsort(misses.ravel()[chosen])]
    starts = [chain for chain in [attractor, *(chains[j] for j in chosen)] if chain is not None]
    return [cycle_of(chain) for chain in starts]
