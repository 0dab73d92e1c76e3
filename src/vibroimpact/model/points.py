"""The named points of a system, by which loads and stops refer to places and results are read at them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.matrices import numbers
from vibroimpact.model.force import Force, check_length, checked_force
from vibroimpact.model.stops import Stop, several_stops
from vibroimpact.parameters import choice, invalid, several, unknown, whole_number


def checked_points(points: Any, n: int) -> Mapping[str, NDArray[np.float64]]:
    """Return the rows of the points over n coordinates by name, after checking them; None means no points."""
    if points is None:
        return MappingProxyType({})
    if not isinstance(points, Mapping) or not all(isinstance(name, str) for name in points):
        raise invalid("points", points, "a mapping from names of points to rows of numbers", "write {'tip': [0, 1]}")
    rows = {name: numbers(f"points[{name!r}]", row, 1) for name, row in points.items()}
    for name, row in rows.items():
        check_length(f"points[{name!r}]", row, n)
    return MappingProxyType(rows)


def rows_of(points: Any, shapes: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Return the rows of a table of modes by the names of its points; None names them by position."""
    count = len(shapes)
    if points is None:
        points = [f"point_{at}" for at in range(1, count + 1)]
    allowed = f"{count} different names, one per row of `shapes`"
    names = several("points", points, allowed)
    if len(names) != count or not all(isinstance(name, str) for name in names) or len(set(names)) != count:
        raise invalid("points", points, allowed)
    return dict(zip(names, shapes, strict=True))


def over_coordinates(name: str, value: Any, points: Mapping[str, Any]) -> Any:
    """Return the vector over the coordinates of a mapping from names of points; without points, the value itself."""
    if not isinstance(value, Mapping) or not points:
        return value
    for point in value:
        if point not in points:
            raise unknown("point", point, points)
    return np.array([value.get(point, 0.0) for point in points]) @ np.array(list(points.values()))


def over_points(name: str, value: Any, points: Mapping[str, Any]) -> Any:
    """Return the vector over the coordinates of a sequence over all points, or of a mapping from their names."""
    if not isinstance(value, Mapping) and len(value) != len(points):
        raise ValueError(f"`{name}` must have {len(points)} numbers, one per point, got {len(value)}")
    return over_coordinates(
        name, value if isinstance(value, Mapping) else dict(zip(points, value, strict=True)), points
    )


def resolved(
    force: Any, stops: Any, points: Mapping[str, Any], n: int, over: Callable[..., Any] = over_coordinates
) -> tuple[Force, list[Stop]]:
    """Return a load and stops with vectors over the n coordinates, after checking them; None means no load."""
    load = checked_force(force)
    vectors = {name: over(name, value, points) for name, value in load.vectors.items()}
    for name, vector in vectors.items():
        check_length(name, vector, n)
    if any(vectors[name] is not value for name, value in load.vectors.items()):
        harmonics = {order: vectors[f"harmonics[{order}]"] for order in load.harmonics}
        load = Force(omega=load.omega, harmonics=harmonics, constant=vectors.get("constant"))
    placed = []
    for at, stop in enumerate(several_stops(stops)):
        direction = over(f"stops[{at}].direction", stop.direction, points)
        placed.append(stop if direction is stop.direction else stop.replace(direction=direction))
    return load, placed


def observed(system: Any, of: Any) -> tuple[NDArray[np.float64], int | None]:
    """Return the observed point as a row over the coordinates, and the stop whose clearance it is.

    `of` is the name of a point or of a stop, the number of a coordinate from 0 on, or a row of factors; None means the
    only coordinate or point.
    """
    n, points, stops = system.coordinates, system.points, system.stop_names
    names = list(dict.fromkeys([*points, *stops]))
    numbers_of = f"the number of a coordinate, 0 to {n - 1}" if n > 1 else "0 for the only coordinate"
    if of is None and 1 in (n, len(points)):
        of = 0 if n == 1 else next(iter(points))
    if of is None:
        raise ValueError(f"`of` must say what is observed: {', '.join(names)}, or {numbers_of}")
    if isinstance(of, str):
        if of not in names:
            raise unknown("point or stop", of, names)
        if of in points:
            return points[of], None
        at = stops.index(of)
        return -system.stops[at].direction, at
    if np.ndim(of):
        row = numbers("of", of, 1)
        check_length("of", row, n)
        return row, None
    if (at := whole_number("of", of, 0)) >= n:
        raise invalid("of", of, f"one of {', '.join(names)}, or {numbers_of}")
    return np.eye(n)[at], None


class NamedPoints:
    """A model that reads its motions at named points: base class of `ImpactSystem`."""

    points: Mapping[str, Any]

    def row_of(self, point: str) -> NDArray[np.float64]:
        """Return the row of a named point over the coordinates."""
        if not self.points:
            raise ValueError(f"unknown point {point!r}; the system has no named points, give it `points`")
        row: NDArray[np.float64] = self.points[choice("point", point, self.points)]
        return row

    def at_point(self, point: str, motion: Any) -> Any:
        r"""Return a motion at a named point, from its motion in coordinates.

        Parameters
        ----------
        point : str
            One of `points`.
        motion : Dataset, DataArray or array_like
            What `simulate`, `stroboscopic_section` or `Orbit.motion` returns, or coordinates, in the last axis of an
            array: displacements, velocities or accelerations.

        Returns
        -------
        Dataset, DataArray or array
            The same without coordinates: `displacement` in m and `velocity` in m/s are those of the point. Figures of
            motions draw a Dataset with the stops that act on the point alone.

        Raises
        ------
        ValueError
            The system has no such point, or the motion has another number of coordinates.

        Examples
        --------
        >>> import vibroimpact as vi
        >>> stop = vi.Stop(direction={"tip": 1.0}, gap=1e-3, restitution=0.6)
        >>> beam = vi.models.fe_beam(
        ...     length=0.3, rigidity=0.35, mass_per_length=0.156, elements=3, supports={0.0: "clamp"},
        ...     points={"tip": 0.3}, force=vi.Force(frequency=12.0, harmonics={1: {"tip": 0.1}}), stops=[stop],
        ... )
        >>> motion = beam.at_point("tip", vi.simulate(beam, periods=10))
        >>> motion["displacement"].dims, f"{float(motion['displacement'].max()):.6f} m"
        (('time',), '0.001000 m')
        """
        row = self.row_of(point)
        if hasattr(motion, "data_vars"):
            tables = [name for name, table in motion.data_vars.items() if "coordinate" in table.dims]
            if not tables:
                raise ValueError("`motion` must have coordinates; take the result of simulate or stroboscopic_section")
            return motion.assign({name: self.at_point(point, motion[name]) for name in tables}).assign_attrs(
                point=point
            )
        if hasattr(motion, "dims"):
            along = motion.get_axis_num("coordinate")
            alone = motion.isel(coordinate=0, drop=True)
            return alone.copy(data=self.at_point(point, np.moveaxis(motion.values, along, -1)))
        coordinates = np.asarray(motion, np.float64)
        if coordinates.shape[-1:] != row.shape:
            shape = f"an array of shape {coordinates.shape}"
            raise ValueError(f"`motion` must have {len(row)} coordinates in its last axis, got {shape}")
        return coordinates @ row
