"""Draw what each ready-made machine does, settled: `make figures` runs it, and so does this file alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

import vibroimpact as vi
from vibroimpact.plotting.style import BLUE, GREEN, INK, RED, STYLE, WALL

IMAGES = Path(__file__).parent / "images" / "machines"
SETTLED, LOOKS = 500, 800  # periods left out, samples per period


@dataclass(frozen=True)
class Picture:
    """What is drawn of a machine: a displacement with the walls in its way, and others beside it, as rows of numbers.

    Without a row it is that in the direction of the first stop.
    """

    label: str
    row: Sequence[float] = ()
    beside: Mapping[str, Sequence[float]] = field(default_factory=dict)
    unit: str = "mm"
    within: bool = False  # from the middle between the walls, not from where the first coordinate is 0
    start: vi.State | None = None


PICTURES = {
    "two_sided_oscillator": Picture("mass"),
    "bilinear_oscillator": Picture("mass"),
    "base_excited_oscillator": Picture("mass over table"),
    "unbalanced_machine": Picture("housing"),
    "bouncing_ball": Picture("ball over its table", [1.0], start=vi.find_orbit(vi.models.bouncing_ball())[0].start),
    "impact_pair": Picture("mass", [1.0]),
    "idle_gear": Picture("idle gear in its backlash", unit="µm", within=True),
    "gear_pair": Picture("teeth in their backlash", unit="µm", within=True),
    "impact_damper": Picture("particle", [0.0, 1.0], {"structure": [1.0, 0.0]}),
    "two_unit_impact_damper": Picture("first particle", [0.0, 1.0, 0.0], {"structure": [1.0, 0.0, 0.0]}),
    "tuned_mass_damper": Picture("absorber", [0.0, 1.0], {"bridge": [1.0, 0.0]}),
    "cantilever_with_stop": Picture("strip at its stop"),
    "clamped_beam_with_stop": Picture("beam at its stop"),
    "clamped_pinned_beam_with_stop": Picture("beam at its stop"),
    "pinned_beam_with_stop": Picture("beam at its stop"),
    "tube_in_supports": Picture("tube in first support"),
    "clamped_tube_in_supports": Picture("tube in first support"),
    "tube_in_many_supports": Picture("tube in first support"),
}


def settled(model: Any, start: vi.State | None) -> xr.Dataset:
    """Return the last two periods of a motion."""
    motion = vi.simulate(model, start=start, periods=SETTLED + 2, samples_per_period=LOOKS)
    motion = motion.isel(time=slice(-LOOKS * 2 - 1, None))
    return motion.isel(impact=motion["impact_time"].values >= float(motion["time"][0]))


def walls(model: Any, motion: xr.Dataset, given: Picture) -> Iterator[tuple[str, float, np.ndarray]]:
    """Yield of each stop in the way its name, on which side it is, and where the displacement would meet it."""
    if isinstance(model, vi.ImpactOscillator):
        yield "", 1.0, np.full(motion.sizes["time"], model.gap)
        return
    row = np.array(given.row or model.stops[0].direction)
    for at, stop in enumerate(model.stops):
        factor = float(stop.direction @ row / (row @ row))
        if abs(factor) > 1e-9 and (given.row or np.allclose(stop.direction, factor * row)):
            yield (
                str(stop.name),
                factor,
                motion["displacement"].values @ row + motion["clearance"].values[:, at] / factor,
            )


def draw(name: str, given: Picture) -> plt.Figure:
    """Draw the displacement, the walls on either side, the displacements beside it, and impacts."""
    model = getattr(vi.models, name)()
    motion, scale = settled(model, given.start), {"mm": 1e3, "µm": 1e6}[given.unit]
    time = motion["time"].values - float(motion["time"][0])
    unit, times = ("s", 1.0) if time[-1] > 1.0 else ("ms", 1e3)
    shown = motion["displacement"].values
    if not isinstance(model, vi.ImpactOscillator):
        shown = shown @ np.array(given.row or model.stops[0].direction)
    found = list(walls(model, motion, given))
    if given.within:
        middle = np.mean([wall for _, _, wall in found], axis=0)
        shown, found = shown - middle, [(stop, factor, wall - middle) for stop, factor, wall in found]
    figure, ax = plt.subplots(figsize=(5.0, 2.5), layout="constrained")
    every = scale * np.concatenate([shown, *(wall for _, _, wall in found)])
    room = 0.12 * np.ptp(every)
    low, high = every.min() - room, every.max() + room
    for _, factor, wall in found:
        dense = 0.25 if name in ("bilinear_oscillator", "gear_pair") else 0.6  # compliant stops
        ax.fill_between(times * time, scale * wall, high if factor > 0 else low, color=WALL, alpha=dense, linewidth=0)
        ax.plot(times * time, scale * wall, color="#777777", linewidth=1.0)
    for (text, row), color in zip(given.beside.items(), (GREEN,), strict=False):
        ax.plot(times * time, scale * motion["displacement"].values @ row, "--", color=color, linewidth=1.2, label=text)
    ax.plot(times * time, scale * shown, color=BLUE, linewidth=1.6, label=given.label)
    hits = motion["impact_time"].values - float(motion["time"][0])
    if "impact_stop" in motion:
        hits = hits[np.isin(motion["impact_stop"].values, [name for name, _, _ in found])]
    ax.plot(times * hits, scale * np.interp(hits, time, shown), "o", color=RED, markersize=4, zorder=3, label="impact")
    ax.set(xlim=(0, times * time[-1]), ylim=(low, high), xlabel=f"time [{unit}]", ylabel=f"displacement [{given.unit}]")
    ax.grid(visible=False)
    figure.legend(loc="outside upper left", ncols=3, frameon=False, fontsize=8.5, labelcolor=INK)
    return figure


def main() -> None:
    """Draw all pictures into docs/images/machines/."""
    IMAGES.mkdir(exist_ok=True)
    with mpl.rc_context(STYLE):
        for name, given in PICTURES.items():
            vi.plotting.save_figure(draw(name, given), IMAGES / f"{name}.png", dpi=100, overwrite=True)
            plt.close("all")


if __name__ == "__main__":
    main()
