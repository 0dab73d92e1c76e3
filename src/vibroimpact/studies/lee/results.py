"""The data behind the figures: one public call each."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import vibroimpact as vi
from vibroimpact.studies.lee.paper import ORBITS, OSCILLATOR, PAIRS, TOP, Pair
from vibroimpact.studies.lee.scale import Scale
from vibroimpact.studies.lee.stages import Tick

INDICES = ("std", "mean_velocity", "max_velocity", "impacts_per_period")


@dataclass(frozen=True)
class Job:
    """One dataset to be made: its key, what it is in words, its share of the work, and the call."""

    key: str
    text: str
    weight: int
    make: Callable[[Tick], xr.Dataset]


def frequencies(points: int) -> NDArray[np.float64]:
    """Return `points` driving frequencies, evenly spaced up to the end of the paper's axis."""
    return np.linspace(0.0, TOP, points + 1)[1:]


def jobs(scale: Scale, workers: int | None) -> Iterator[Job]:
    """Yield the datasets in the order of the figures."""

    def job(key: str, text: str, weight: int, call: Callable[..., xr.Dataset], *given: Any, **changes: float) -> Job:
        return Job(key, text, weight, lambda tick: call(*given, scale, workers, tick, **changes))

    yield job("figure-02", "diagram of the Poincaré displacement", 8, looks)
    yield job("figure-03", "diagram of the impact velocity", 8, diagram)
    for figure, omega in ORBITS.items():
        osc = OSCILLATOR.replace(omega=omega)
        yield job(f"figure-{figure:02d}a", f"Poincaré map at w = {omega:g}", 1, poincare, osc)
        yield job(f"figure-{figure:02d}b", f"impact map at w = {omega:g}", 1, impacts, osc)
    yield job("figure-10", "Std along w", 4, std_line)
    for pair in PAIRS:
        yield job(pair.key, f"map over (w, {pair.symbol})", 200, two_parameters, pair)
        for letter, value in zip("ab", pair.examples, strict=True):
            text = f"diagram at {pair.symbol} = {value:g}"
            yield job(f"figure-{pair.map_figure + 1}{letter}", text, 8, diagram, **{pair.name: value})


def looks(scale: Scale, workers: int | None, tick: Tick) -> xr.Dataset:
    """Return the bifurcation diagram of the Poincare displacement."""
    return vi.bifurcation_diagram(
        OSCILLATOR,
        omega=frequencies(scale.columns),
        section="stroboscopic",
        transient_periods=2 * scale.map_transient,
        sample_periods=scale.looks,
        workers=workers,
    )


def diagram(scale: Scale, workers: int | None, tick: Tick, **changes: float) -> xr.Dataset:
    """Return the bifurcation diagram of the impact velocity at changed parameters."""
    return vi.bifurcation_diagram(
        OSCILLATOR.replace(**changes),
        omega=frequencies(scale.columns),
        transient_impacts=scale.column_transient,
        sample_impacts=scale.column_impacts,
        workers=workers,
    )


def poincare(osc: vi.ImpactOscillator, scale: Scale, workers: int | None, tick: Tick) -> xr.Dataset:
    """Return the Poincare map of one settled motion."""
    return vi.stroboscopic_section(osc, transient_periods=1000, sample_periods=scale.orbit_impacts)


def impacts(osc: vi.ImpactOscillator, scale: Scale, workers: int | None, tick: Tick) -> xr.Dataset:
    """Return the impact map of one settled motion."""
    return vi.impact_section(osc, transient_impacts=1000, sample_impacts=scale.orbit_impacts)


def std_line(scale: Scale, workers: int | None, tick: Tick) -> xr.Dataset:
    """Return the indices along w, at the sampling of the maps."""
    return vi.parameter_map(
        OSCILLATOR,
        omega=frequencies(scale.columns),
        indices=INDICES,
        transient_impacts=scale.map_transient,
        sample_impacts=scale.map_impacts,
        workers=workers,
    )


def two_parameters(pair: Pair, scale: Scale, workers: int | None, tick: Tick) -> xr.Dataset:
    """Return the indices over w and one more parameter."""
    axes: dict[str, Any] = {
        "omega": frequencies(scale.map_points),
        pair.name: np.linspace(pair.low, pair.high, scale.map_points),
    }
    return vi.parameter_map(
        OSCILLATOR,
        **axes,
        indices=INDICES,
        transient_impacts=scale.map_transient,
        sample_impacts=scale.map_impacts,
        workers=workers,
        progress=lambda done, total, partial: tick(done / total),
    )
