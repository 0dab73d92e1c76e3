"""The tables of indices, the numbers that a sweep returns for each cell."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from vibroimpact.parameters import invalid, several, unknown


@dataclass(frozen=True)
class Index:
    """One number that characterises a motion: its name in datasets, long name, unit, symbol, type and missing value.

    Those with `from_velocities` follow from sums over the impact velocities; the others also need a tangent vector,
    phases and near-misses.
    """

    name: str
    long_name: str
    units: str
    symbol: str
    dtype: str = "float64"
    fill: float = float("nan")
    from_velocities: bool = False
    by_stop: bool = False

    @property
    def label(self) -> dict[str, str]:
        """The attributes of its variable."""
        return {"long_name": self.long_name, "units": self.units, "symbol": self.symbol}


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


# Those that only systems have: forces of their stops.
FORCES: dict[str, Index] = {
    index.name: index
    for index in (
        Index("mean_force", "mean force of the stop", "N", "mean F", by_stop=True),
        Index("max_force", "largest force of a compliant stop", "N", "max F", by_stop=True),
        Index("work_rate", "energy lost at the stop per second", "W", "W", by_stop=True),
        Index("damper_rate", "energy lost in the dampers per second", "W", "D"),
    )
}
# Of the displacement of a coordinate, a point or a clearance, over one cycle, and of the stops' forces.
RESPONSES: dict[str, Index] = {
    index.name: index
    for index in (
        Index("amplitude", "half the peak-to-peak displacement", "m", "A"),
        Index("rms", "rms displacement", "m", "rms y"),
        Index("mean", "mean displacement", "m", "<y>"),
        Index("harmonic_amplitude", "amplitude of the first harmonic", "m", "|Y|"),
        Index("harmonic_phase", "phase of the first harmonic", "rad", "arg Y"),
        Index("rms_force", "rms force of compliant stops", "N", "rms F", by_stop=True),
    )
}
DISPLACEMENTS = tuple(name for name, index in RESPONSES.items() if not index.by_stop)
EVERY = INDICES | FORCES | RESPONSES
ALL = "all"  # in the place of names: all that a back end computes

VELOCITY_INDICES = frozenset(name for name, index in INDICES.items() if index.from_velocities)

ROUNDING = 1e-9  # relative to the scale: a smaller spread is rounding, and the motion is a cycle


def spread_scale(index: str, speed: float) -> float:
    """Return the scale of an index that is a spread, for impact velocities of about `speed`; 0 for other indices."""
    return {"std": speed, "impact_phase_spread": 1.0}.get(index, 0.0)


def shown_spread(spread: float, scale: float) -> float:
    """Return a spread as it is shown: 0 if it is only rounding."""
    return 0.0 if abs(spread) <= ROUNDING * scale else spread


def check_indices(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names of indices as a tuple, "all" as all; raise `ValueError` with all names if one is unknown."""
    if isinstance(names, str) and names == ALL:
        return tuple(EVERY)
    chosen = several("indices", names, f"one or more of {', '.join(EVERY)}")
    if not chosen:
        raise invalid("indices", names, f"one or more of {', '.join(EVERY)}", "write for example ('std',)")
    for name in chosen:
        if not isinstance(name, str) or name not in EVERY:
            raise unknown("index", name, EVERY)
    if len(set(chosen)) < len(chosen):
        raise invalid("indices", chosen, "distinct names")
    return chosen


# Indices that count driving periods, or measure in them.
OF_PERIODS = (
    "impacts_per_period", "dissipation", "n_periods", "n_impacts", "impact_phase_spread", "harmonic_amplitude",
    "harmonic_phase",
)  # fmt: skip


def without_value(name: str, model: Any, of: Any = ()) -> str:
    """Return the reason why a model has no value of an index, or "". `of` None: no displacement is named."""
    if name in ("max_force", "rms_force") and all(stop.element.instantaneous for stop in getattr(model, "stops", ())):
        return f"`{name}` needs a compliant stop; the force of a rigid one has no largest value"
    if name in OF_PERIODS and not getattr(model, "periodic", True):
        lacks = "refers to the driving period, which the model lacks, since its load has no frequency"
        return f"`{name}` {lacks}; impact_statistics gives rates per second"
    if name in DISPLACEMENTS and of is None:
        return f"`{name}` is that of a point, a coordinate or a clearance; name it by `of`"
    return ""


def with_missing(indices: dict[str, float], model: Any) -> dict[str, float]:
    """Return the indices of a motion, with missing values of those that the model lacks, as maps have them."""
    return indices | {name: EVERY[name].fill for name in indices if without_value(name, model)}
