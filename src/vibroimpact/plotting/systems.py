"""What is drawn of a system: a coordinate or the clearance of a stop, with the walls of the stops that act on it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.colors import to_rgba
from matplotlib.patches import Rectangle
from scipy.interpolate import CubicHermiteSpline

from vibroimpact.parameters import choice, invalid, whole_number
from vibroimpact.plotting import labels, style
from vibroimpact.plotting.style import INK, RED, Floats, Mask
from vibroimpact.system import ImpactSystem

STOPS = (RED, "#e69f00", "#7a3dd8", "#0b7a75", "#7a5230")  # impacts on each, in the order of the system
SMOOTH = 200  # places of a moving stop per driving period, as of a motion by default
FAR = 3.0  # spans of the motion: a wall farther off is only pointed at
PARALLEL = 1e-12


@dataclass(frozen=True)
class Wall:
    """A stop that acts on what is drawn alone: y <= wall where `ratio` > 0, else y >= wall."""

    name: str
    number: int
    ratio: float  # of its direction to the form drawn
    compliant: bool


@dataclass(frozen=True)
class View:
    """One number of a system over time: y = form . q, or the clearance u of a stop, with its rate."""

    system: ImpactSystem
    form: Floats
    stop: int | None  # whose clearance it is
    coordinate: int = 0

    @cached_property
    def walls(self) -> list[Wall]:
        """The stops whose directions are multiples of the form."""
        found, at = [], int(np.abs(self.form).argmax())
        for number, stop in enumerate(self.system.stops):
            ratio = float(stop.direction[at] / self.form[at])
            if ratio and np.abs(stop.direction - ratio * self.form).max() <= PARALLEL * np.abs(stop.direction).max():
                found.append(Wall(str(stop.name), number, ratio, stop.compliant))
        return found

    def _moved(self, number: int, time: Floats, *, rate: bool = False) -> Floats:
        """Return the distance of a stop from q = 0 along its direction, or its rate."""
        stop, omega = self.system.stops[number], self.system.omega
        parts = [
            (by * (1j * order * omega) ** rate * np.exp(1j * order * omega * time)).imag
            for order, by in stop.motion.items()
        ]
        found: Floats = sum(parts, np.full_like(time, 0.0 if rate else stop.gap))
        return found

    def values(self, time: Floats, coordinates: Floats, *, rate: bool = False) -> Floats:
        """Return y, or its rate, from displacements or velocities, one row per time."""
        found: Floats = coordinates @ self.form
        return found if self.stop is None else found + self._moved(self.stop, time, rate=rate)

    def place(self, wall: Wall, time: Floats, *, rate: bool = False) -> Floats:
        """Return the place of a wall, or its velocity."""
        if wall.number == self.stop:
            return np.zeros_like(time)
        offset = 0.0 if self.stop is None else self._moved(self.stop, time, rate=rate)
        found: Floats = offset + self._moved(wall.number, time, rate=rate) / wall.ratio
        return found

    def moves(self, wall: Wall) -> bool:
        """Whether a wall moves in this view."""
        return wall.number != self.stop and any(
            self.system.stops[number].motion for number in (wall.number, self.stop) if number is not None
        )

    def held(self, wall: Wall, start: float, end: float) -> Floats:
        """Return time, y and y' while a wall is closed; of one that moves at so many times that it draws no polygon."""
        number = 2 + math.ceil((end - start) / self.system.period * SMOOTH) * self.moves(wall)
        time = np.linspace(start, end, number)
        return np.column_stack([time, self.place(wall, time), self.place(wall, time, rate=True)])

    def impacts(self, simulation: xr.Dataset) -> tuple[Floats, Floats, Floats]:
        """Return y and its rates before and after each impact, whichever stop is struck.

        Of a stop that acts on y alone they are the wall's and those of the law of restitution. At any other y' jumps by
        -form . M^-1 d p, with p the impulse along d; without these jumps y is smooth, and the cubic through the samples
        leads to the impact. Where a contact with a compliant stop begins no rate jumps.
        """
        time, speed = simulation["impact_time"].values, simulation["impact_velocity"].values
        found = self._through(simulation, time, self._jumps(simulation))
        for wall, here in self.struck(simulation):
            moves = self.place(wall, time[here], rate=True)
            r = -1.0 if wall.compliant else self.system.stops[wall.number].rebound(speed[here])
            found[0, here] = self.place(wall, time[here])
            found[1, here] = moves + speed[here] / wall.ratio
            found[2, here] = moves - r * speed[here] / wall.ratio
        return found[0], found[1], found[2]

    def struck(self, simulation: xr.Dataset) -> Iterator[tuple[Wall, Mask]]:
        """Yield each wall that is struck, and at which impacts."""
        for wall in self.walls:
            here: Mask = simulation["impact_stop"].values == wall.name
            if here.any():
                yield wall, here

    def _jumps(self, simulation: xr.Dataset) -> Floats:
        """Return by how much y' jumps at each impact."""
        struck, found = simulation["impact_stop"].values, np.zeros(simulation.sizes["impact"])
        for stop in (stop for stop in self.system.stops if not stop.compliant):
            here, per_impulse = struck == stop.name, self.form @ np.linalg.solve(self.system.mass, stop.direction)
            found[here] = -per_impulse * simulation["impulse"].values[here]
        return found

    def _through(self, simulation: xr.Dataset, at: Floats, jumps: Floats) -> Floats:
        """Return y and its rates before and after each jump, from the samples around it."""
        time = simulation["time"].values
        y = self.values(time, simulation["displacement"].values)
        rate = self.values(time, simulation["velocity"].values, rate=True)
        own = between_impacts(time, at)
        if own.sum() < 2:
            return np.full((3, len(at)), np.nan)
        total, moment = (np.append(0.0, np.cumsum(jumps * by)) for by in (1.0, at))
        passed = np.searchsorted(at, time)
        smooth = CubicHermiteSpline(
            time[own], (y - time * total[passed] + moment[passed])[own], (rate - total[passed])[own]
        )
        here = smooth(at) + at * total[:-1] - moment[:-1], smooth(at, 1) + total[:-1], smooth(at, 1) + total[1:]
        return np.array(here)

    def labelled(self, dataset: xr.Dataset, *, rate: bool = False) -> xr.DataArray:
        """Return y, or its rate, over the time or the periods of a result, with name, unit and symbol."""
        source = dataset["velocity" if rate else "displacement"]
        time = dataset["time"].values
        if self.stop is None and len(self.form) == 1:
            attrs = dict(source.attrs)
        else:
            name = None if self.stop is None else self.system.stop_names[self.stop]
            words = f"clearance of {name}" if name else f"coordinate {self.coordinate}"
            symbol = f"u_{name}" if name else f"q_{self.coordinate}"
            attrs = {"long_name": "rate of " * rate + words, "symbol": symbol + "'" * rate}
        values = self.values(time, source.values, rate=rate)
        return xr.DataArray(
            values, dims=source.dims[:1], attrs={**attrs, "units": "m/s" if rate else "m"}, name="shown"
        )


def view_of(dataset: xr.Dataset, coordinate: int | None, stop: str | None) -> View | None:
    """Return the view of a system's result; None of an oscillator, which has one displacement.

    Unless asked it is coordinate 0, or, where no stop acts on that alone, the clearance of the first stop.
    """
    system = labels.made(dataset)
    if not isinstance(system, ImpactSystem):
        if stop is not None or (coordinate is not None and whole_number("coordinate", coordinate, 0) > 0):
            raise ValueError("`coordinate` and `stop` are for results of systems; one mass has one displacement")
        return None
    if stop is not None and coordinate is not None:
        raise ValueError("give either `coordinate` or `stop`, not both")
    if stop is not None:
        return _of_stop(system, system.stop_names.index(choice("stop", stop, system.stop_names)))
    n = len(system.mass)
    at = 0 if coordinate is None else whole_number("coordinate", coordinate, 0)
    if at >= n:
        raise invalid("coordinate", coordinate, f"less than the number of coordinates, {n}")
    view = View(system, np.eye(n)[at], None, at)
    return _of_stop(system, 0) if coordinate is None and system.stops and not view.walls else view


def _of_stop(system: ImpactSystem, number: int) -> View:
    return View(system, -np.array(system.stops[number].direction), number)


def between_impacts(sampled: Floats, times: Floats) -> Mask:
    """Return which samples lie between impacts.

    A sample at an impact holds the state after it, but rounding may put its time before: it adds nothing.
    """
    around = np.concatenate([[-np.inf], times, [np.inf]])
    after = np.searchsorted(times, sampled)
    found: Mask = np.minimum(sampled - around[after], around[after + 1] - sampled) >= 1e-6 * np.ptp(sampled[:2])
    return found


def color_of(system: ImpactSystem, name: str) -> str:
    """Return the colour of the impacts on a stop."""
    return STOPS[system.stop_names.index(name) % len(STOPS)]


def draw_walls(ax: Axes, view: View, y: Floats, time: Floats, *, upright: bool) -> tuple[float, float]:
    """Draw the stops that act on y alone and return the limits of its axis.

    Over time a moving stop is drawn as it moves; upright, in a portrait, where it comes to be farthest. Arrows point to
    those too far off. Of a compliant stop, what the motion enters is shaded in its colour.
    """
    low, high = style.view(y, style.magnitude(y, 1e-300))
    span = high - low
    near: list[tuple[Wall, Floats, float]] = []
    far: list[tuple[Wall, Floats, float]] = []
    for wall in view.walls:
        place = view.place(wall, time)
        outermost = float(place.max() if wall.ratio > 0.0 else place.min())
        off = outermost - high if wall.ratio > 0.0 else low - outermost
        (near if off <= FAR * span else far).append((wall, place, outermost))
    reached = np.append(y, [outermost for _, _, outermost in near])
    low, high = style.view(reached, style.magnitude(reached, 1e-300))
    room = 0.12 * (high - low)
    deepest = {wall.name: _deepest(wall, y, place, outermost) for wall, place, outermost in near}
    for wall, _, _ in near:
        end = deepest[wall.name]
        low, high = (low, max(high, end + room)) if wall.ratio > 0.0 else (min(low, end - room), high)
    for wall, place, outermost in near:
        beyond = high if wall.ratio > 0.0 else low
        if view.moves(wall) and not upright:
            ax.fill_between(time, place, beyond, zorder=1.5, **style.BEHIND[wall.compliant])
            ax.plot(time, place, **style.FACE[wall.compliant], zorder=1.6)
        else:
            style.draw_stop(ax, outermost, beyond, upright=upright, compliant=wall.compliant)
        if wall.compliant:
            _shade(ax, wall, (time, y, place), color_of(view.system, wall.name), upright=upright)
        _name(ax, wall.name, 0.5 * (deepest[wall.name] + beyond), upright=upright)
    for wall, _, outermost in far:
        above = wall.ratio > 0.0
        arrow = r"$\downarrow$" if upright == above else r"$\uparrow$"
        _name(ax, f"{wall.name} at {outermost:.4g} m {arrow}", high - 0.5 * room if above else low + 0.5 * room,
              upright=upright)  # fmt: skip
        low, high = (low, high + 0.5 * room) if above else (low - 0.5 * room, high)
    return low, high


def draw_forces(ax: Axes, system: Any, simulation: xr.Dataset) -> None:
    """Draw the forces of compliant stops over time, each contact before a box of its duration and largest force."""
    for stop in (stop for stop in system.stops if stop.compliant):
        hits = simulation.isel(impact=np.flatnonzero(simulation["impact_stop"] == stop.name))
        begins, length, peak = (hits[name].values for name in ("impact_time", "contact_time", "peak_force"))
        # Where contact begins the force jumps from zero to c v.
        touch: Floats = float(stop.damping or 0.0) * hits["impact_velocity"].values
        time = np.concatenate([simulation["time"].values, begins, begins, begins + length])
        force = np.concatenate([simulation["force"].sel(stop=stop.name).values, 0.0 * touch, touch, 0.0 * touch])
        order, color = np.argsort(time, kind="stable")[: np.isfinite(time).sum()], color_of(system, str(stop.name))
        ax.plot(time[order], force[order], color=color, linewidth=1.2, zorder=3, label=f"force of {stop.name}")
        boxes = [Rectangle((at, 0.0), long, most) for at, long, most in zip(begins, length, peak, strict=True)]
        look: dict[str, Any] = {"facecolor": to_rgba(color, 0.2), "edgecolor": to_rgba(color, 0.5), "linewidth": 0.8}
        ax.add_collection(PatchCollection(boxes, **look, zorder=2))
    ax.set_ylim(bottom=0.0)
    labels.label_axes(ax, simulation["time"], simulation["force"])


def _deepest(wall: Wall, y: Floats, place: Floats, outermost: float) -> float:
    """Return the depth to which the motion reaches into a compliant stop; of a rigid one its place."""
    if not wall.compliant:
        return outermost
    reached = np.append(y[np.isfinite(y)], outermost)
    return float(reached.max() if wall.ratio > 0.0 else reached.min())


def _shade(ax: Axes, wall: Wall, line: tuple[Floats, Floats, Floats], color: str, *, upright: bool) -> None:
    """Shade where the motion is inside a compliant stop."""
    time, y, place = line
    inside = (y - place) * np.sign(wall.ratio) >= 0.0
    look: dict[str, Any] = {"facecolor": color, "alpha": 0.2, "linewidth": 0.0, "zorder": 1.7}
    if not upright:
        ax.fill_between(time, place, y, where=inside, label=f"penetration of {wall.name}", **look)
    elif inside.any():
        ends = place[inside], y[inside]
        ax.axvspan(min(map(np.min, ends)), max(map(np.max, ends)), label=f"penetration of {wall.name}", **look)


def _name(ax: Axes, text: str, middle: float, *, upright: bool) -> None:
    place: dict[str, Any] = {"x": 0.995, "y": middle, "transform": ax.get_yaxis_transform(), "ha": "right"}
    if upright:
        place = {"x": middle, "y": 0.995, "transform": ax.get_xaxis_transform(), "rotation": 90, "ha": "center"}
    box = {"facecolor": "#ededed", "edgecolor": "none", "pad": 2}
    ax.text(s=text, va="top" if upright else "center", fontsize=8.5, color=INK, bbox=box, **place)
