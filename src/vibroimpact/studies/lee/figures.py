"""The paper's twenty figures: the datasets behind them, one public call each, and how they are drawn."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import vibroimpact as vi
from vibroimpact import plotting
from vibroimpact.plotting.style import STYLE
from vibroimpact.studies.lee.paper import INDICES, ORBITS, OSCILLATOR, PAIRS, Pair, Scale, frequencies

Results = Mapping[str, xr.Dataset]
Draw = Callable[[Axes], Axes]
Tick = Callable[[float], None]  # receives the completed part of a step, 0 to 1
Make = Callable[[Tick], xr.Dataset]


@dataclass(frozen=True)
class Job:
    """One dataset to be computed: its key, what it is, its share of the work, and the call."""

    key: str
    text: str
    weight: int
    make: Make


def jobs(scale: Scale, workers: int | None) -> Iterator[Job]:
    """Yield the datasets in the order of the figures."""
    along: dict[str, Any] = {"omega": frequencies(scale.columns), "workers": workers}
    sampling: dict[str, Any] = {
        "indices": INDICES,
        "transient_impacts": scale.map_transient,
        "sample_impacts": scale.map_impacts,
    }

    def diagram(**changes: float) -> Make:
        osc, impacts = OSCILLATOR.replace(**changes), scale.column_impacts
        return lambda _: vi.bifurcation_diagram(
            osc, **along, transient_impacts=scale.column_transient, sample_impacts=impacts
        )

    def looks(_: Tick) -> xr.Dataset:
        return vi.bifurcation_diagram(
            OSCILLATOR,
            **along,
            section="stroboscopic",
            transient_periods=2 * scale.map_transient,
            sample_periods=scale.looks,
        )

    def sections(omega: float) -> tuple[Make, Make]:
        osc, kept = OSCILLATOR.replace(omega=omega), scale.orbit_impacts
        return (
            lambda _: vi.stroboscopic_section(osc, transient_periods=1000, sample_periods=kept),
            lambda _: vi.impact_section(osc, transient_impacts=1000, sample_impacts=kept),
        )

    def sweep(pair: Pair) -> Make:
        axes: dict[str, Any] = {
            "omega": frequencies(scale.map_points),
            pair.name: np.linspace(pair.low, pair.high, scale.map_points),
        }
        return lambda tick: vi.parameter_map(
            OSCILLATOR, **axes, **sampling, workers=workers, progress=lambda done, total, _: tick(done / total)
        )

    yield Job("figure-02", "diagram of the Poincaré displacement", 8, looks)
    yield Job("figure-03", "diagram of the impact velocity", 8, diagram())
    for figure, omega in ORBITS.items():
        for letter, what, make in zip("ab", ("Poincaré", "impact"), sections(omega), strict=True):
            yield Job(f"figure-{figure:02d}{letter}", f"{what} map at w = {omega:g}", 1, make)
    yield Job("figure-10", "Std along w", 4, lambda _: vi.parameter_map(OSCILLATOR, **along, **sampling))
    for pair in PAIRS:
        yield Job(pair.key, f"map over (w, {pair.symbol})", 200, sweep(pair))
        for letter, value in zip("ab", pair.examples, strict=True):
            key, text = f"figure-{pair.map_figure + 1}{letter}", f"diagram at {pair.symbol} = {value:g}"
            yield Job(key, text, 8, diagram(**{pair.name: value}))


@dataclass(frozen=True)
class Panel:
    """One drawing of a figure: its title and how it is drawn on given axes."""

    title: str
    draw: Draw
    solid: bool = False


@dataclass(frozen=True)
class Plate:
    """One figure of the paper: its title and caption, the datasets it shows, its panels and how they are laid out."""

    number: int
    title: str
    caption: str
    data: tuple[str, ...]
    panels: tuple[Panel, ...]
    size: tuple[float, float]
    stacked: bool = False

    @property
    def name(self) -> str:
        """Name of the files."""
        return f"figure-{self.number:02d}"


def plates(results: Results, level: float) -> Iterator[Plate]:
    """Yield the figures in the paper's order."""
    yield Plate(1, "The model", "Impact vibration with a one-sided constraint.", (),
                (Panel("", lambda ax: plotting.oscillator_sketch(ax=ax)),), (6.5, 3.6))  # fmt: skip
    yield _diagram(2, "Poincaré displacement", "figure-02", results)
    yield _diagram(3, "Impact velocity", "figure-03", results)
    for number, omega in ORBITS.items():
        yield _orbit(number, omega, results)
    overlay = Panel("", lambda ax: plotting.diagram_with_index(results["figure-03"], results["figure-10"], ax=ax))
    caption = "Impact velocity (blue dots) and five times its Std (black line) over the driving frequency."
    keys = ("figure-03", "figure-10")
    yield Plate(10, "Impact velocity and its Std over w", caption, keys, (overlay,), (9.0, 4.6))
    for pair in PAIRS:
        yield _map(pair, results, level)
        yield _effect(pair, results)


def _diagram(number: int, what: str, key: str, results: Results) -> Plate:
    panel = Panel("", lambda ax: plotting.bifurcation_diagram(results[key], ax=ax))
    caption = f"Bifurcation diagram: {what} over the driving frequency."
    return Plate(number, f"{what} over w", caption, (key,), (panel,), (9.0, 4.6))


def _orbit(number: int, omega: float, results: Results) -> Plate:
    keys = (f"figure-{number:02d}a", f"figure-{number:02d}b")
    panels = (
        Panel("(a) Poincaré map", lambda ax: plotting.stroboscopic_map(results[keys[0]], ax=ax)),
        Panel("(b) impact map", lambda ax: plotting.impact_map(results[keys[1]], ax=ax)),
    )
    caption = "Settled impact vibration: (a) once a driving period; (b) at each impact."
    return Plate(number, f"Motion at w = {omega:g}", f"w = {omega:g} rad/s. {caption}", keys, panels, (11.0, 4.6))


def _map(pair: Pair, results: Results, level: float) -> Plate:
    sweep, reference = results[pair.key], {pair.name: pair.reference}
    panels = (
        Panel("(a) surface of Std", lambda ax: plotting.index_surface(sweep, ax=ax), solid=True),
        Panel(
            f"(b) Std with the boundary at {level:g} m/s and the line {pair.symbol} = {pair.reference:g}",
            lambda ax: plotting.index_contour(sweep, level=level, reference=reference, ax=ax),
        ),
    )
    caption = f"Std over the (w, {pair.symbol}) domain; white lines: boundary at Std = {level:g} m/s."
    return Plate(pair.map_figure, f"Std over (w, {pair.symbol})", caption, (pair.key,), panels, (13.0, 5.4))


def _effect(pair: Pair, results: Results) -> Plate:
    number = pair.map_figure + 1
    keys = (f"figure-{number}a", f"figure-{number}b")

    def panel(letter: str, value: float, key: str) -> Panel:
        title = f"({letter}) {pair.symbol} = {value:g}"
        return Panel(title, lambda ax: plotting.bifurcation_diagram(results[key], ax=ax))

    panels = tuple(map(panel, "ab", pair.examples, keys))
    caption = f"Effects of {pair.word} on the impact velocity: " + ", ".join(panel.title for panel in panels) + "."
    return Plate(number, f"Effects of {pair.word}", caption, keys, panels, (9.0, 8.2), stacked=True)


def draw(plate: Plate, folder: Path, scale: Scale) -> None:
    """Write one figure as PNG and SVG."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=plate.size, layout="constrained")
        FigureCanvasAgg(figure)
        shape = (len(plate.panels), 1) if plate.stacked else (1, len(plate.panels))
        for place, panel in enumerate(plate.panels, start=1):
            axes = figure.add_subplot(*shape, place, projection="3d" if panel.solid else None)
            panel.draw(axes)
            axes.set_title(panel.title, loc="left", color="#222222", fontsize=10)
        for ending in ("png", "svg"):
            plotting.save_figure(figure, folder / f"{plate.name}.{ending}", dpi=scale.dpi)
