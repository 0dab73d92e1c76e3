"""The tables of indices: the numbers that a sweep gives for each cell."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from vibroimpact.parameters import invalid, several, unknown


@dataclass(frozen=True)
class Index:
    """One number that sums up a motion: its name in datasets, its words, unit, type and missing value.

    One `from_velocities` follows from sums over the impact velocities; others need a tangent vector, phases and
    near-misses too.
    """

    name: str
    long_name: str
    units: str
    symbol: str
    dtype: str = "float64"
    fill: float = float("nan")
    from_velocities: bool = False
    by_stop: bool = False


INDICES: dict[str, Index] = {
    index.name: index
    for index in (
        Index("std", "standard deviation of impact velocities", "m/s", "Std", from_velocities=True, by_stop=True),
        Index("mean_velocity", "mean impact velocity", "m/s", "<I>", from_velocities=True, by_stop=True),
        Index("max_velocity", "largest impact velocity", "m/s", "max I", from_velocities=True, by_stop=True),
        Index("impacts_per_period", "impacts per driving period", "1", "p/n", from_velocities=True, by_stop=True),
        Index("lyapunov", "largest Lyapunov exponent", "1/s", "λ"),
        Index("lyapunov_per_impact", "largest Lyapunov exponent per impact", "1", "λ per impact"),
        Index("n_periods", "driving periods in a cycle", "1", "n", "int32", 0),
        Index("n_impacts", "impacts in a cycle", "1", "p", "int32", 0),
        Index("dissipation", "energy lost at the stop per driving period", "J", "E", by_stop=True),
        Index("stick_fraction", "share of time at rest at the stop", "1", "stuck", by_stop=True),
        Index("impact_phase_spread", "spread of the impact phases", "1", "spread", by_stop=True),
        Index("grazing_margin", "gap left by the closest near-miss", "m", "margin", by_stop=True),
    )
}


# What only systems have: forces of their stops.
FORCES: dict[str, Index] = {
    index.name: index
    for index in (
        Index("mean_force", "mean force of the stop", "N", "mean F", by_stop=True),
        Index("max_force", "largest force of a compliant stop", "N", "max F", by_stop=True),
        Index("work_rate", "energy lost at the stop per second", "W", "W", by_stop=True),
        Index("damper_rate", "energy lost in the dampers per second", "W", "D"),
    )
}
EVERY = INDICES | FORCES

VELOCITY_INDICES = frozenset(name for name, index in INDICES.items() if index.from_velocities)

ROUNDING = 1e-9  # of what it is a part of: a spread this small is that of a cycle, by rounding


def spread_scale(index: str, speed: float) -> float:
    """Return the scale of which an index that is a spread is a part, speeds being some `speed`; 0 for other indices."""
    return {"std": speed, "impact_phase_spread": 1.0}.get(index, 0.0)


def shown_spread(spread: float, scale: float) -> float:
    """Return a spread as it is shown: 0 where it is only rounding of what spreads."""
    return 0.0 if abs(spread) <= ROUNDING * scale else spread


def check_indices(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names of indices as a tuple, or raise `ValueError` naming the table."""
    chosen = several("indices", names, f"names out of {', '.join(EVERY)}")
    if not chosen:
        raise invalid("indices", names, f"names out of {', '.join(EVERY)}", "write for example ('std',)")
    for name in chosen:
        if not isinstance(name, str) or name not in EVERY:
            raise unknown("index", name, EVERY)
    if len(set(chosen)) < len(chosen):
        raise invalid("indices", chosen, "each index once")
    return chosen
