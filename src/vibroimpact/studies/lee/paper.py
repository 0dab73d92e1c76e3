"""The paper's oscillator and its twenty figures, and the grids on which the study computes them."""

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
from vibroimpact.cells import Floats
from vibroimpact.plotting.style import STYLE

CITATION = (
    "J.-Y. Lee, Numerical Analysis of Impact Vibration Based on a Bifurcation Diagram With Two Varying Control "
    "Parameters, National Kaohsiung University of Science and Technology"
)
OSCILLATOR = vi.ImpactOscillator(mass=1.0, damping=0.01, stiffness=1.0, amplitude=1.0, restitution=0.8, gap=0.0)
WINDOW = (100.0, 150.0)  # s; the part that the paper's simulations keep
TIME_STEP = 0.0005  # s; step of its Runge-Kutta scheme
TOP = 5.0  # rad/s; the end of every frequency axis
LEVEL = 0.05  # m/s; default height of a boundary, 5 % of f / sqrt(k m)
INDICES = ("std", "mean_velocity", "max_velocity", "impacts_per_period")  # of every map and line along w

# figure: driving frequency of its Poincare map (a) and impact map (b)
ORBITS = {4: 0.10, 5: 0.25, 6: 0.75, 7: 1.0, 8: 2.0, 9: 2.8}


@dataclass(frozen=True)
class Pair:
    """One parameter varied together with w: its map (figure `map_figure`) and its two diagrams (the next figure).

    The paper prints no ranges for the second axis; `low` and `high` are ours.
    """

    name: str
    symbol: str
    section: str
    map_figure: int
    low: float
    high: float
    examples: tuple[float, float]

    @property
    def key(self) -> str:
        """Key of the map among the results."""
        return f"figure-{self.map_figure}"

    @property
    def word(self) -> str:
        """The varied parameter in the paper's words."""
        return {"amplitude": "forcing amplitude", "restitution": "the restitution coefficient"}.get(
            self.name, self.name
        )

    @property
    def reference(self) -> float:
        """The value at which the marker line is drawn."""
        return float(getattr(OSCILLATOR, self.name))


PAIRS = (
    Pair("mass", "m", "4.1", 11, 0.1, 5.0, (0.1, 5.0)),
    Pair("damping", "c", "4.2", 13, 0.005, 1.0, (0.5, 1.0)),
    Pair("stiffness", "k", "4.3", 15, 0.1, 5.0, (0.1, 5.0)),
    Pair("amplitude", "f", "4.4", 17, 0.1, 5.0, (0.1, 5.0)),
    Pair("restitution", "r", "4.5", 19, 0.1, 0.99, (1.0, 0.1)),
)


def pair_of(name: str) -> Pair:
    """Return the pair whose second parameter has this name."""
    return next(pair for pair in PAIRS if pair.name == name)


def frequencies(points: int, low: float = 0.0, high: float = TOP) -> Floats:
    """Return `points` evenly spaced driving frequencies in (low, high], rad/s."""
    return np.linspace(low, high, points + 1)[1:]


@dataclass(frozen=True)
class Scale:
    """Grids and counts of one run of the study."""

    name: str
    map_points: int  # along either axis of the five two-parameter maps
    map_transient: int  # impacts skipped in each cell of a map and along each line of Std
    map_impacts: int  # impacts kept there
    columns: int  # frequencies of a bifurcation diagram and of a line of Std
    column_transient: int  # impacts skipped in a column of a diagram
    column_impacts: int  # impacts kept there
    looks: int  # stroboscopic samples kept in a column of figure 2, after 2 `map_transient` periods
    orbit_impacts: int  # impacts, and periods, kept on the sections of figures 4 to 9
    scan_step: float  # rad/s between the frequencies at which motions are recognised
    variant_step: float  # the same at parameters other than the paper's
    cells_along: int  # cells of a map, along either axis, in which the motion is recognised
    settle_impacts: int  # impacts skipped when a motion is recognised
    settled_impacts: int  # kept there
    dpi: int  # of the figures


PAPER = Scale(
    name="full", map_points=200, map_transient=100, map_impacts=5000,
    columns=1000, column_transient=200, column_impacts=150, looks=100, orbit_impacts=5000,
    scan_step=0.01, variant_step=0.02, cells_along=25, settle_impacts=2000, settled_impacts=1000, dpi=150,
)  # fmt: skip
QUICK = Scale(
    name="quick", map_points=40, map_transient=50, map_impacts=300,
    columns=150, column_transient=100, column_impacts=100, looks=50, orbit_impacts=1000,
    scan_step=0.01, variant_step=0.05, cells_along=13, settle_impacts=1000, settled_impacts=500, dpi=90,
)  # fmt: skip


# The figures: the datasets behind them, one public call each, and how they are drawn.

Results = Mapping[str, xr.Dataset]
Draw = Callable[[Axes], Axes]
Tick = Callable[[float], None]  # receives the completed part of a step, 0 to 1
Make = Callable[[Tick], xr.Dataset]


@dataclass(frozen=True)
class Job:
    """One dataset to be computed: its key, a description, its share of the work, and the call."""

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

    hits: dict[str, Any] = {"transient_impacts": scale.column_transient, "sample_impacts": scale.column_impacts}
    looks: dict[str, Any] = {"transient_periods": 2 * scale.map_transient, "sample_periods": scale.looks}
    looks["section"] = "stroboscopic"

    def diagram(window: dict[str, Any], **changes: float) -> Make:
        osc = OSCILLATOR.replace(**changes)
        return lambda _: vi.bifurcation_diagram(osc, **along, **window)

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

    yield Job("figure-02", "diagram of the Poincaré displacement", 8, diagram(looks))
    yield Job("figure-03", "diagram of the impact velocity", 8, diagram(hits))
    for figure, omega in ORBITS.items():
        for letter, what, make in zip("ab", ("Poincaré", "impact"), sections(omega), strict=True):
            yield Job(f"figure-{figure:02d}{letter}", f"{what} map at w = {omega:g}", 1, make)
    yield Job("figure-10", "Std along w", 4, lambda _: vi.parameter_map(OSCILLATOR, **along, **sampling))
    for pair in PAIRS:
        yield Job(pair.key, f"map over (w, {pair.symbol})", 200, sweep(pair))
        for letter, value in zip("ab", pair.examples, strict=True):
            key, text = f"figure-{pair.map_figure + 1}{letter}", f"diagram at {pair.symbol} = {value:g}"
            yield Job(key, text, 8, diagram(hits, **{pair.name: value}))


@dataclass(frozen=True)
class Panel:
    """One drawing of a figure: its title and how it is drawn on given axes."""

    title: str
    draw: Draw
    solid: bool = False


@dataclass(frozen=True)
class Plate:
    """One figure of the paper: its title and caption, its datasets, its panels and their layout."""

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
    caption = "Settled impact vibration: (a) once per driving period; (b) at each impact."
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
