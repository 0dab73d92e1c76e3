"""What is shown of a model: one mass and its stop, or of a system one displacement and the stops in its way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.oscillator import ImpactOscillator

Floats = NDArray[np.float64]
PARALLEL = 1e-9  # of the size of a direction: what rounding may add to one that is a multiple of another


@dataclass(frozen=True)
class Wall:
    """A stop in the way of the displacement shown: its number, and its place, which may move."""

    number: int
    name: str
    side: int  # 1 above the displacement, -1 below
    scale: float  # of its own direction over the one shown
    gap: float
    restitution: float | None  # None where the rates after impacts are not known from those before
    orders: Floats  # of its motion
    motion: NDArray[np.complex128]
    omega: float

    def at(self, time: Floats) -> Floats:
        """Return its place."""
        return np.asarray((self.gap + self._waves(time, 0).sum(0)) / self.scale, np.float64)

    def velocity(self, time: Floats) -> Floats:
        """Return its velocity."""
        return np.asarray(self._waves(time, 1).sum(0) / self.scale, np.float64)

    def _waves(self, time: Floats, derivative: int) -> Floats:
        rates = 1j * self.orders[:, None] * self.omega
        return np.asarray((rates**derivative * self.motion[:, None] * np.exp(rates * time)).imag, np.float64)


@dataclass(frozen=True)
class Shown:
    """A displacement of a model, named, and the stops in its way."""

    label: str
    unit: str
    direction: Floats | None  # over the coordinates; None of one mass
    walls: tuple[Wall, ...]

    def of(self, values: Floats) -> Floats:
        """Return the displacement or its rate from those of all coordinates."""
        return values if self.direction is None else np.asarray(values @ self.direction, np.float64)

    def places(self, stops: Any, time: Floats) -> Floats:
        """Return the places of stops of those numbers at times; NaN of those that are not in the way."""
        found = np.full(len(time), np.nan)
        for wall in self.walls:
            here = np.flatnonzero(stops == wall.number)
            found[here] = wall.at(time[here])
        return found


def shown(made: Any, coordinate: int = 0, stop: int = 0) -> Shown:
    """Return the quantity shown of an oscillator or a system: a coordinate, or the displacement towards a stop."""
    if isinstance(made, ImpactOscillator):
        none = np.zeros(0)
        wall = Wall(0, "stop", 1, 1.0, made.gap, made.restitution, none, none.astype(complex), made.omega)
        return Shown("displacement y", "m", None, (wall,))
    if coordinate or not made.stops:
        direction, label = np.eye(len(made.mass))[max(coordinate, 1) - 1], f"coordinate {max(coordinate, 1)}"
    else:
        direction = made.stops[max(stop, 1) - 1].direction
        label = f"y at {made.stop_names[max(stop, 1) - 1]}"
    walls = (_wall(made, number, direction) for number in range(len(made.stops)))
    return Shown(label, "m", direction, tuple(wall for wall in walls if wall))


def _wall(system: Any, number: int, direction: Floats) -> Wall | None:
    """Return a stop as a wall to a displacement; None where it is not one to this displacement alone."""
    stop = system.stops[number]
    scale = float(stop.direction @ direction / (direction @ direction))
    if not scale or np.abs(stop.direction - scale * direction).max() > PARALLEL * np.abs(stop.direction).max():
        return None
    bounce = None if stop.stiffness is not None else stop.ratio
    orders = np.array([float(order) for order in stop.motion])
    motion = np.array(list(stop.motion.values()), complex)
    return Wall(number, str(stop.name), 1 if scale > 0.0 else -1, scale, stop.gap, bounce, orders, motion, system.omega)
