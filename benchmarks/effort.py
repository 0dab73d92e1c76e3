"""How much is measured: all of it, or a first look."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Effort:
    """Sizes of one run.

    Parameters
    ----------
    rounds : int
        Repetitions of which the median is taken.
    cells, impacts : int
        Cells of a sweep (enough to fill the lanes) and impacts in each.
    orbit_impacts, batch_periods, slow_impacts : int
        What one orbit of a Taylor integrator, one batch of them, and the slow contenders compute.
    spread : int
        Frequencies, out of 0.05 to 5, that a solver of single orbits is given.
    settle : int
        Impacts after which the orbit at w = 2 has settled; its errors fall by 0.79 an impact.
    map_points : int
        Values along either axis of the paper's five maps.
    largest_sweep : int
        Cells of the largest sweep where the growth with cells is measured.
    cold_starts : int
        Starts with an empty cache of compiled kernels, some 100 s each.
    """

    rounds: int
    cells: int
    impacts: int
    orbit_impacts: int
    batch_periods: int
    slow_impacts: int
    spread: int
    settle: int
    map_points: int
    largest_sweep: int
    cold_starts: int


FULL = Effort(
    rounds=7, cells=2048, impacts=5100, orbit_impacts=20_000, batch_periods=2000, slow_impacts=200,
    spread=64, settle=300, map_points=200, largest_sweep=8192, cold_starts=3,
)  # fmt: skip
QUICK = Effort(
    rounds=1, cells=256, impacts=600, orbit_impacts=1000, batch_periods=100, slow_impacts=20,
    spread=8, settle=300, map_points=8, largest_sweep=256, cold_starts=0,
)  # fmt: skip
