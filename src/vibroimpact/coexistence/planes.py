"""Planes of initial conditions: the two coordinates that the axes vary, and the values of the others."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.dataset import VARIABLES, impact_speed, variable
from vibroimpact.model import State, check_model, one_start
from vibroimpact.model.units import DISPLAY
from vibroimpact.parameters import Parameter, choice, invalid, phase_number, unknown
from vibroimpact.request import check_axes, units_of

if TYPE_CHECKING:
    import xarray as xr

_SIZES = {"displacement": "y", "velocity": "y'"}


@dataclass(frozen=True)
class Plane:
    """Two axes of initial conditions of a model: of impacts (`struck`) on a stop, or of states.

    `start` holds the coordinates without an axis, `phase` the phase if no axis varies it; `stop` is the number of the
    stop that is struck.
    """

    model: Any  # a `Design`
    axes: Mapping[str, Floats]
    struck: bool
    phase: float
    start: State | None = None
    stop: int = 0
    units: Mapping[str, str] = field(default_factory=dict)  # of axes, to write and draw them in

    def cells(self) -> Any:
        """Return one cell per point of the plane, the last axis fastest; refuse points beyond a stop."""
        columns = {
            name: np.ravel(values)
            for name, values in zip(self.axes, np.meshgrid(*self.axes.values(), indexing="ij"), strict=True)
        }
        number = math.prod(map(len, self.axes.values()))
        phases = columns.get("phase", np.full(number, self.phase))
        q, speed, _ = self.model.initial() if self.start is None else _numbers(self.start, self.model.coordinates)
        state = {"displacement": np.tile(q, (number, 1)), "velocity": np.tile(speed, (number, 1))}
        for name, values in columns.items():
            kind, _, at = name.partition("_")
            if kind in state and not self.struck:
                state[kind][:, int(at or 0)] = values
        cells = self.model.cells({}).copies(number).at(**state, turns=phases)
        if self.struck:
            cells = cells.striking(np.full(number, self.stop), columns["velocity"], phases)
        over = cells.beyond()
        if over.any():
            row, stop = np.argwhere(over)[0].tolist()
            where = " and ".join(f"{name} = {values[row]:.6g}" for name, values in columns.items())
            raise ValueError(
                f"the axes must stay in front of all stops, but {where} lies beyond {self.model.stop_names[stop]!r} by "
                f"{over[row, stop]:.3g} m; narrow them, or change `start`"
            )
        return cells

    def points(self, samples: Any) -> dict[str, Floats]:
        """Return the points of a sampled motion in the plane, by axis."""
        if self.struck:
            on_stop = samples.impact_stop == self.stop
            return {axis: getattr(samples, f"impact_{axis}")[on_stop] for axis in self.axes}
        points = {}
        for axis in self.axes:
            kind, _, at = axis.partition("_")
            values = getattr(samples, f"look_{kind}")
            points[axis] = values[:, int(at or 0)] if values.ndim > 1 else values
        return points

    def arguments(self) -> dict[str, Any]:
        """Return the arguments of a plane other than its axes."""
        arguments: dict[str, Any] = {}
        if self.struck and len(self.model.stops) > 1:
            arguments["stop"] = self.model.stop_names[self.stop]
        if self.start is not None:
            arguments["others"] = str(self.start)
            if not self.struck and "phase" not in self.axes:
                arguments["phase"] = self.phase
        return arguments

    def note(self) -> dict[str, str]:
        """Return the part of a title that describes the plane, apart from its axes."""
        parts = [f"impacts on {self.model.stop_names[self.stop]}"] if self.struck and len(self.model.stops) > 1 else []
        if self.start is not None and self.model.coordinates > 1:
            parts.append(f"others of q = {_listed(self.start.displacement)} m, q' = {_listed(self.start.velocity)} m/s")
        return {"note": ", ".join(parts)} if parts else {}

    def labelled(self, axis: str, dims: Any, values: Floats) -> xr.Variable:
        """Return values along an axis, labelled."""
        kind, _, at = axis.partition("_")
        shown = {DISPLAY: self.units[axis]} if axis in self.units else {}
        if at:
            symbol = _SIZES[kind].replace("y", f"q_{at}")
            return variable(kind, dims, values, long_name=f"{kind} of coordinate {at}", symbol=symbol, **shown)
        if self.struck and axis == dims == "velocity":
            return impact_speed(dims, values, **shown)
        return variable(axis, dims, values, **shown)


def _listed(numbers: Any) -> str:
    return "(" + ", ".join(f"{number:.4g}" for number in np.atleast_1d(numbers)) + ")"


def plane_of(model: Any, axes: Mapping[str, Any], stop: str | None, start: State | None) -> Plane:
    """Return the plane that two axes span, checked."""
    check_model(model)
    design, spanned, phase = model.at(), dict(axes), 0.0
    n = design.coordinates
    names = [*_SIZES] if n == 1 else [f"{kind}_{at}" for at in range(n) for kind in _SIZES]
    coordinates = [*names, *(["velocity"] if n > 1 else []), "phase"]
    for name in axes:
        if name not in coordinates:
            raise unknown("coordinate", name, coordinates)
    if (state := one_start(start)) is not None:
        phase = state.time / design.period % 1.0
        _numbers(state, n)
    if set(spanned) & set(names) - {"velocity"} and np.ndim(spanned.get("phase", ())) == 0:
        phase = phase_number("phase", spanned.pop("phase"))
    struck = set(spanned) == {"phase", "velocity"}
    states = len(spanned) == 2 and set(spanned) <= {*names, "phase"} and (n > 1 or "phase" not in spanned)
    if not struck and not states:
        got = ", ".join(f"`{name}`" for name in axes) or "no axis"
        raise ValueError(f"the axes must be {_pairs(n)}, got {got}; name both, such as `phase` and `velocity`")
    number, table = _number_of(design.stop_names, stop, struck), _coordinates(names, struck)
    return Plane(design, check_axes(spanned, table), struck, phase, state, number, units_of(spanned, table))


def _pairs(n: int) -> str:
    if n == 1:
        return "(displacement, velocity), with `phase` a number, or (phase, velocity)"
    return "two of displacement_0, velocity_0, displacement_1, ... and phase, or (phase, velocity) at a stop"


def _number_of(names: Sequence[str], stop: str | None, struck: bool) -> int:
    """Return the number of the stop that is struck; it may be omitted if there is only one."""
    if not struck:
        if stop is not None:
            raise ValueError("`stop` applies only to the axes (phase, velocity); leave it out")
        return 0
    if stop is None and len(names) != 1:
        raise ValueError(f"`stop` must name the stop that is struck: {', '.join(names) or 'this system has none'}")
    return names.index(names[0] if stop is None else choice("stop", stop, names))


def _coordinates(names: Sequence[str], struck: bool) -> dict[str, Parameter]:
    units = {kind: VARIABLES[kind][1] for kind in _SIZES}
    velocity = Parameter("velocity", "velocity", units["velocity"])
    if struck:
        velocity = replace(velocity, low=0.0, hint="an impact has velocity > 0, a mass at rest 0")
    phase = Parameter("phase", "phase", low=0.0, high=1.0, hint="give (t mod T)/T")
    columns = {name: Parameter(name, name, units[name.partition("_")[0]]) for name in names}
    return columns | {"velocity": velocity, "phase": phase}


def _numbers(start: State, n: int) -> tuple[Floats, Floats, float]:
    """Return coordinates and velocities of an initial condition, which may lie beyond stops."""
    q, speed = (np.array(part, np.float64, ndmin=1) for part in (start.displacement, start.velocity))
    if len(q) != n:
        raise invalid("start", start, f"a State of {n} coordinates")
    return q, speed, start.time
