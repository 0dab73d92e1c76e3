"""Views of a motion: a coordinate or the clearance of a stop, with the stops that act on it as walls."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from scipy.interpolate import CubicHermiteSpline

from vibroimpact.model.elements import Element
from vibroimpact.model.stops import Stop
from vibroimpact.parameters import choice, invalid, whole_number
from vibroimpact.plotting import labels
from vibroimpact.plotting.style import Floats, Mask

SMOOTH = 200  # positions of a moving stop per driving period, as many as samples of a motion by default
PARALLEL = 1e-9  # relative tolerance for a direction that is a multiple of another


@dataclass(frozen=True)
class Wall:
    """A stop that acts on the quantity drawn alone: y <= wall if `ratio` > 0, else y >= wall."""

    stop: Stop
    number: int
    ratio: float  # ratio of its direction to the form drawn

    @property
    def name(self) -> str:
        """The name of the stop."""
        return str(self.stop.name)

    @property
    def element(self) -> Element:
        """The contact law of the stop, and its traits."""
        return self.stop.element

    @property
    def side(self) -> int:
        """Side of the wall: 1 above y, -1 below."""
        return 1 if self.ratio > 0.0 else -1


@dataclass(frozen=True)
class View:
    """The quantity of a motion that is drawn: y = form . q, or the clearance u of a stop, with its rate.

    Parameters
    ----------
    model : ImpactOscillator or ImpactSystem
        The model in motion.
    form : (n,) array
        The weights of the coordinates.
    name, symbol : str
        Name and symbol of y.
    stop : int, optional
        The number of the stop if y is a clearance.
    at_point : bool
        Whether results hold y itself: they are those of `ImpactSystem.at_point`.
    """

    model: Any
    form: Floats
    name: str = ""
    symbol: str = ""
    stop: int | None = None
    at_point: bool = False

    @cached_property
    def walls(self) -> list[Wall]:
        """The stops whose directions are multiples of the form."""
        walls, largest = [], int(np.abs(self.form).argmax())
        for number, stop in enumerate(self.model.stops):
            ratio = float(stop.direction[largest] / self.form[largest])
            if ratio and np.abs(stop.direction - ratio * self.form).max() <= PARALLEL * np.abs(stop.direction).max():
                walls.append(Wall(stop, number, ratio))
        return walls

    def values(self, time: Floats, coordinates: Any, *, rate: bool = False) -> Floats:
        """Return y, or its rate, from displacements or velocities, one row per time."""
        alone = self.at_point and np.ndim(coordinates) == 1
        y: Floats = np.asarray(coordinates) if alone else np.reshape(coordinates, (-1, len(self.form))) @ self.form
        return y if self.stop is None else y + self._stop_place(self.stop, time, rate=rate)

    def _stop_place(self, number: int, time: Floats, *, rate: bool = False) -> Floats:
        """Return the position of a stop along its direction, or its velocity."""
        stop, omega = self.model.stops[number], self.model.omega
        mean, motion = (0.0, stop.speed(omega * time, omega)) if rate else (stop.gap, stop.shift(omega * time))
        place: Floats = np.full_like(time, mean) + motion
        return place

    def place(self, wall: Wall, time: Floats, *, rate: bool = False) -> Floats:
        """Return the position of a wall, or its velocity."""
        if wall.number == self.stop:
            return np.zeros_like(time)
        offset = 0.0 if self.stop is None else self._stop_place(self.stop, time, rate=rate)
        place: Floats = offset + self._stop_place(wall.number, time, rate=rate) / wall.ratio
        return place

    def moves(self, wall: Wall) -> bool:
        """Whether a wall moves in this view."""
        return wall.number != self.stop and any(
            self.model.stops[number].motion for number in (wall.number, self.stop) if number is not None
        )

    def rest(self, wall: Wall, start: float, end: float) -> Floats:
        """Return time, y and y' while a wall is closed, with enough points to draw a moving wall smoothly."""
        number = 2 + math.ceil((end - start) / self.model.period * SMOOTH) * self.moves(wall)
        time = np.linspace(start, end, number)
        return np.column_stack([time, self.place(wall, time), self.place(wall, time, rate=True)])

    def sides(self, wall: Wall, time: Floats, speed: Floats) -> tuple[Floats, Floats, Floats]:
        """Return y and its rates before and after impacts on a wall; the rate jumps only if an impact takes no time."""
        moves, closing = self.place(wall, time, rate=True), speed / wall.ratio
        return self.place(wall, time), moves + closing, moves - wall.element.rebound(speed) * closing

    def impacts(self, simulation: xr.Dataset) -> tuple[Floats, Floats, Floats]:
        """Return y and its rates before and after each impact on any stop.

        At a stop that acts on y alone they follow from the wall and the law of restitution. At any other stop y' jumps
        by -form . M^-1 d p, with p the impulse along d; without these jumps y is smooth and is interpolated by the
        cubic through the samples.
        """
        time, speed = simulation["impact_time"].values, simulation["impact_velocity"].values
        struck = list(self.struck(simulation))
        if sum(at.sum() for _, at in struck) < len(time):
            sides = self._through(simulation, time, self._jumps(simulation))
        else:
            sides = np.empty((3, len(time)))
        for wall, at in struck:
            sides[:, at] = self.sides(wall, time[at], speed[at])
        return sides[0], sides[1], sides[2]

    def struck(self, simulation: xr.Dataset) -> Iterator[tuple[Wall, Mask]]:
        """Yield each wall that is struck, with the mask of its impacts."""
        names = stops_of(simulation, "impact", self.model)
        for wall in self.walls:
            at: Mask = names == wall.name
            if at.any():
                yield wall, at

    def _jumps(self, simulation: xr.Dataset) -> Floats:
        """Return the jump of y' at each impact."""
        struck, jumps = simulation["impact_stop"].values, np.zeros(simulation.sizes["impact"])
        for stop in (stop for stop in self.model.stops if stop.element.instantaneous):
            at, per_impulse = struck == stop.name, self.form @ np.linalg.solve(self.model.mass, stop.direction)
            jumps[at] = -per_impulse * simulation["impulse"].values[at]
        return jumps

    def _through(self, simulation: xr.Dataset, at: Floats, jumps: Floats) -> Floats:
        """Return y and its rates before and after each jump, interpolated from the samples around it."""
        time = simulation["time"].values
        y = self.values(time, simulation["displacement"].values)
        rate = self.values(time, simulation["velocity"].values, rate=True)
        free = between_impacts(time, at)
        if free.sum() < 2:
            return np.full((3, len(at)), np.nan)
        total, moment = (np.append(0.0, np.cumsum(jumps * by)) for by in (1.0, at))
        passed = np.searchsorted(at, time)
        smooth = CubicHermiteSpline(
            time[free], (y - time * total[passed] + moment[passed])[free], (rate - total[passed])[free]
        )
        return np.array([
            smooth(at) + at * total[:-1] - moment[:-1], smooth(at, 1) + total[:-1], smooth(at, 1) + total[1:],
        ])  # fmt: skip

    def labelled(self, dataset: xr.Dataset, *, rate: bool = False) -> xr.DataArray:
        """Return y, or its rate, over the times or periods of a result, with name, unit and symbol."""
        source = dataset["velocity" if rate else "displacement"]
        attrs = dict(source.attrs)
        if self.stop is not None or len(self.form) > 1:
            attrs = {"long_name": "rate of " * rate + self.name, "symbol": self.symbol + "'" * rate}
            attrs["units"] = "m/s" if rate else "m"
        values = self.values(times_of(dataset), source.values, rate=rate)
        return xr.DataArray(values, dims=source.dims[:1], attrs=attrs, name=source.name)


def view_of(dataset: xr.Dataset, coordinate: int | None, stop: str | None) -> View | None:
    """Return the view of a result; None if the result has no model.

    The default is coordinate 0 or, if no stop acts on it alone, the clearance of the first stop.
    """
    model = labels.selected_model(dataset)
    if stop is not None and coordinate is not None:
        raise ValueError("give either `coordinate` or `stop`, not both")
    if model is None:
        return None
    if (point := dataset.attrs.get("point")) and "coordinate" not in dataset.dims:
        if stop is not None or coordinate is not None:
            raise ValueError(f"the motion is that of point {point!r}; leave out `coordinate` and `stop`")
        return View(model, model.row_of(point), f"displacement of {point}", f"y_{point}", at_point=True)
    if stop is not None:
        return _clearance(model, model.stop_names.index(choice("stop", stop, model.stop_names)))
    n, at = model.coordinates, 0 if coordinate is None else whole_number("coordinate", coordinate, 0)
    if at >= n:
        raise invalid("coordinate", coordinate, f"less than the number of coordinates, {n}")
    view = View(model, np.eye(n)[at], f"coordinate {at}", f"q_{at}")
    return _clearance(model, 0) if coordinate is None and model.stops and not view.walls else view


def _clearance(model: Any, number: int) -> View:
    name = model.stop_names[number]
    return View(model, -np.array(model.stops[number].direction), f"clearance of {name}", f"u_{name}", number)


def view_of_page(model: Any, coordinate: int = 0, stop: int = 0) -> View:
    """Return the view of an explorer page: a coordinate or the displacement towards a stop, from 1; 0: default."""
    if coordinate or not model.stops:
        form, name = np.eye(model.coordinates)[max(coordinate, 1) - 1], f"coordinate {max(coordinate, 1)}"
    else:
        number = max(stop, 1) - 1
        form, name = model.stops[number].direction, f"y at {model.stop_names[number]}"
    if len(model.stops) == 1 and form.tolist() == [1.0]:  # there is no other quantity to show
        name = "displacement y"
    return View(model, form, name)


def stops_of(result: Mapping[Any, Any], event: str, model: Any) -> Any:
    """Return the name of the stop at each "impact" or "stick" of a result; results for one stop do not list it."""
    if f"{event}_stop" in result:
        return np.asarray(result[f"{event}_stop"])
    return np.full(len(result.get(f"{event}_time", ())), model.stop_names[0])


def times_of(result: xr.Dataset) -> Floats:
    """Return the times of a result, zeros if it has none: only moving stops need them."""
    return result["time"].values if "time" in result else np.zeros(len(result["displacement"]))


def between_impacts(sampled: Floats, times: Floats, width: float | None = None) -> Mask:
    """Return which samples lie between impacts, `width` or more from each; by default a millionth of a time step.

    A sample at an impact holds the state after it, but rounding may place it before; such samples are left out.
    """
    around = np.concatenate([[-np.inf], times, [np.inf]])
    after = np.searchsorted(times, sampled)
    width = 1e-6 * float(np.ptp(sampled[:2])) if width is None else width
    free: Mask = np.minimum(sampled - around[after], around[after + 1] - sampled) >= width
    return free
