"""A request: everything that determines the numbers of a map, a diagram or a store, and a check of memory."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends import ImpactWindow, Measurement
from vibroimpact.cells import FASTEST, Cells, Floats
from vibroimpact.dataset import (
    dataset_of,
    label,
    missing,
    package_version,
    plain_variable,
    provenance,
    status_variable,
    variable,
)
from vibroimpact.indices import DISPLACEMENTS, EVERY, without_value
from vibroimpact.model import Model, State, check_names, one_start
from vibroimpact.model.units import DISPLAY, in_own_unit
from vibroimpact.parameters import Parameter, check_steps, invalid, positive_number, whole_number
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr

Places = NDArray[np.int64]
CELL, INDEX = 250, 8  # bytes per cell of a map while it is computed, and per index beyond the first
COSTLY = "use fewer points or impacts"
BLOCK = 1 << 18  # cells made at once when all must be checked: about 25 MB


@dataclass(frozen=True)
class Request:
    """The designs, initial conditions, measurement and back end of a computation."""

    model: Model  # its parameters that no axis varies
    axes: Mapping[str, Floats]  # the values of a grid; if `scattered`, the columns of a table with one design per row
    measurement: Measurement
    # For every cell; a tuple adds a dim `start`, and so does a number: at rest first, then spread impacts.
    start: State | tuple[State | None, ...] | int | None = None
    backend: str = "cpu"
    time_step: float | None = None
    of: Any = None  # what the indices of displacements are of, as it was given
    scattered: bool = False  # points (dim `point`) instead of a grid
    further: Mapping[str, Any] = field(default_factory=dict)  # other inputs of the result: how a map is refined
    units: Mapping[str, str] = field(
        default_factory=dict
    )  # of axes, to write and draw them in; no number depends on it

    @property
    def n_starts(self) -> int:
        """The number of initial conditions along the dim `start`; 0 without that dim."""
        return len(self.start) if isinstance(self.start, tuple) else self.start if isinstance(self.start, int) else 0

    @property
    def sizes(self) -> dict[str, int]:
        """Cells along each dimension."""
        sizes = {name: len(values) for name, values in self.axes.items()}
        if self.scattered:
            sizes = {"point": next(iter(sizes.values()))}
        return sizes | ({"start": self.n_starts} if self.n_starts else {})

    @property
    def dims(self) -> tuple[str, ...]:
        """The names of the dimensions; the last one varies fastest."""
        return tuple(self.sizes)

    @property
    def shape(self) -> tuple[int, ...]:
        """Cells along each dimension."""
        return tuple(self.sizes.values())

    def __len__(self) -> int:
        return math.prod(self.shape)

    @property
    def indices(self) -> tuple[str, ...]:
        """The requested indices."""
        return self.measurement.indices

    @cached_property
    def absent(self) -> dict[str, str]:
        """The requested indices of which the model has no value, with the reasons."""
        design = self.model.at()
        of = self.measurement.of
        return {name: reason for name in self.indices if (reason := without_value(name, design, of))}

    @property
    def measured(self) -> Measurement:
        """The measurement of the other indices."""
        return replace(self.measurement, indices=tuple(name for name in self.indices if name not in self.absent))

    def completed(self, outcome: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        """Return the outcome of some cells with missing values of the indices that the model lacks."""
        cells, status = len(outcome["status"]), outcome["status"]
        if not self.model.at().periodic:  # there are no periods to be few
            outcome = {
                **outcome,
                "status": np.where(status == Status.SHORT_WINDOW, status.dtype.type(Status.OK), status),
            }
        sizes = {name: tuple(self.sizes_of(name).values())[len(self.shape) :] for name in self.absent}
        return {**outcome, **{name: missing(name, (cells, *more)) for name, more in sizes.items()}}

    def attrs_of(self, name: str) -> dict[str, str]:
        """Return the attributes of a variable: its labels, and why it has no value."""
        attrs = EVERY[name].label if name in EVERY else {}
        if self.of is not None and name in DISPLACEMENTS:
            what = self.of if isinstance(self.of, str) or np.ndim(self.of) else f"coordinate {self.of}"
            attrs["long_name"] += f" of {what}"
            if isinstance(self.measurement.of, int):
                attrs["long_name"] = attrs["long_name"].replace("displacement", "clearance")
        return attrs | ({"no_value": self.absent[name]} if name in self.absent else {})

    @cached_property
    def stops(self) -> tuple[str, ...]:
        """The names of the stops for which indices are given; empty if indices cover all stops together."""
        return tuple(self.model.at().stop_names) if self.measurement.by_stop else ()

    def sizes_of(self, name: str) -> dict[str, int]:
        """Return the size of a result along each dimension."""
        by_stop = self.measurement.by_stop and name in EVERY and EVERY[name].by_stop
        return self.sizes | ({"stop": len(self.stops)} if by_stop else {})

    @property
    def cell_size(self) -> int:
        """Bytes of memory per cell while a map is computed."""
        return CELL + INDEX * (sum(math.prod(self.sizes_of(name).values()) for name in self.indices) // len(self) - 1)

    def coordinates(self) -> dict[str, xr.Variable]:
        """Return the labelled axes of a result."""
        shown = {name: {DISPLAY: unit} for name, unit in self.units.items()}
        labels = {name: label(self.model.parameters[name]) | shown.get(name, {}) for name in self.axes}
        dims = dict.fromkeys(self.axes, "point") if self.scattered else {name: name for name in self.axes}
        whole = {name for name in self.axes if self.model.parameters[name].whole}
        columns = {name: values.astype(np.int64) if name in whole else values for name, values in self.axes.items()}
        variables = {name: plain_variable(dims[name], values, labels[name]) for name, values in columns.items()}
        if self.n_starts:
            attrs = {"long_name": "number of the initial condition", "units": "1", "symbol": "start"}
            variables["start"] = plain_variable("start", np.arange(self.n_starts), attrs)
        if self.stops:
            variables["stop"] = plain_variable("stop", np.array(self.stops), {"long_name": "stop"})
        return variables

    def cells(self, at: slice | Places = slice(None)) -> Cells:
        """Return the cells at some flat indices, bit for bit the same in every selection."""
        flat = np.arange(*at.indices(len(self))) if isinstance(at, slice) else at
        if not isinstance(self.start, (tuple, int)):
            return self._designs_at(flat).begun(self.start, self._names)
        designs, owner = np.unique(flat // self.n_starts, return_inverse=True)
        cells, numbers = self._designs_at(designs)[owner], flat % self.n_starts
        if isinstance(self.start, int):
            struck = numbers > 0
            cells.table[struck] = cells[struck].struck(numbers[struck] - 1).table
        else:
            for number, start in enumerate(self.start):
                cells.table[numbers == number] = cells[numbers == number].begun(start, self._names).table
        return cells

    @cached_property
    def _names(self) -> tuple[str, ...]:
        """The names of the stops."""
        return tuple(self.model.at().stop_names)

    def _designs_at(self, flat: Places) -> Cells:
        """Return designs by flat index, at rest; the function of a family is called once for each."""
        if self.scattered:
            return self._designs[flat]
        places = np.unravel_index(flat, tuple(map(len, self.axes.values())))
        along = zip(self.axes.items(), places, strict=True)
        return self.model.cells({name: values[place] for (name, values), place in along})

    @cached_property
    def _designs(self) -> Cells:
        """The designs of a table, at rest; made once, since the function of a family may be slow."""
        return self.model.cells(self.axes)

    def box(self, part: tuple[slice, ...]) -> Places:
        """Return the flat indices of a box of cells."""
        ranges = [np.arange(*along.indices(size)) for along, size in zip(part, self.shape, strict=True)]
        return np.ravel_multi_index(np.ix_(*ranges), self.shape).ravel()

    def check_starts(self) -> None:
        """Raise if an initial condition lies beyond the stop at a corner of the grid, before anything is computed."""
        self._corners()

    def check_cost(self, most: int) -> None:
        """Raise if a request takes more than `most` steps: one per impact, or steps of a fixed length in a period."""
        window, each = self.measurement.impacts, 1.0
        if self.time_step is not None:
            each = max(
                2.0 * math.pi / float(self._corners()["omega"].max()) / positive_number("time_step", self.time_step),
                1.0,
            )
        impacts = window.transient + window.keep
        what = f"make {len(self):,} cells of {impacts:,} impacts each, which take"
        check_steps("axes", what, len(self) * impacts * each, COSTLY, most)

    def _corners(self) -> Cells:
        ends = [(0, size - 1) for size in self.shape]
        corners = [np.ravel_multi_index(corner, self.shape) for corner in product(*ends)]
        return self.cells(slice(None) if self.scattered else np.unique(corners))

    def identity(self) -> dict[str, Any]:
        """Return the identity that two requests must share if one is to continue the other."""
        varied = {self.model.parameters[name].replaces or name for name in self.axes}
        window = self.measurement.impacts
        return {
            "version": package_version(),
            **{name: value for name, value in self.model.values.items() if name not in varied},
            **self._numbers(),
            **{f"axis {number}": mark(name, values) for number, (name, values) in enumerate(self.axes.items(), 1)},
            "indices": ", ".join(self.measurement.indices),
            "transient_impacts": window.transient,
            "sample_impacts": window.keep,
            **asdict(self.measurement.tolerances),
            "start": self._start(),
            "backend": self.backend,
            "time_step": self.time_step,
            "early_closing": self.measurement.early_closing,
            **({"points": "scattered"} if self.scattered else {}),
            **({"by_stop": True} if self.measurement.by_stop else {}),
            **({} if self.of is None else {"of": str(self.of)}),
            **self.further,
        }

    def _start(self) -> str:
        if isinstance(self.start, int):
            return f"at rest; {self.n_starts - 1} impacts at phases 0 to 1, velocities 0 to {FASTEST:g} V"
        starts = self.start if isinstance(self.start, tuple) else (self.start,)
        return "; ".join("at rest" if start is None else str(start) for start in starts)

    def _numbers(self) -> dict[str, Any]:
        """Return a mark of the numbers behind a name: those that a family makes, and the matrices of a system."""
        if getattr(self.model, "says_all", False):
            return {}
        digest = hashlib.sha256()
        for low in range(0, len(self), BLOCK):
            digest.update(np.ascontiguousarray(self.cells(slice(low, low + BLOCK)).table).tobytes())
        return {"family": str(self.model), "numbers": digest.hexdigest()[:16]}

    def arguments(self) -> dict[str, Any]:
        """Return the call in the terms of the API."""
        window = self.measurement.window
        counts = {} if not isinstance(window, ImpactWindow) else {
            "transient_impacts": window.transient, "sample_impacts": window.keep,
        }  # fmt: skip
        return {
            "indices": self.measurement.indices,
            "backend": self.backend,
            "time_step": self.time_step,
            **counts,
            "start": self.start,
            "early_closing": self.measurement.early_closing,
            **({"by_stop": True} if self.measurement.by_stop else {}),
            **({} if self.of is None else {"of": self.of}),
            "tolerances": self.measurement.tolerances,
            **self.further,
        }

    def provenance(self, function: str) -> dict[str, str]:
        """Return the attributes that record how a result was made."""
        return provenance(function, self.model, self.arguments())


def map_of(request: Request, arrays: Mapping[str, NDArray[Any]]) -> xr.Dataset:
    """Return a map of the arrays of indices and status, without copying them."""
    variables = {
        name: variable(name, tuple(request.sizes_of(name)), arrays[name], **request.attrs_of(name))
        for name in request.indices
    }
    variables["status"] = status_variable(request.dims, arrays["status"])
    counts = {"impacts_computed": 0, "steps_computed": 0}
    return dataset_of(variables, request.coordinates(), attrs=counts | request.provenance("parameter_map"))


def check_axes(axes: Mapping[str, Any], parameters: Mapping[str, Parameter]) -> dict[str, Floats]:
    """Return the axes of a grid as arrays in the order given; raise `ValueError` naming the first wrong one."""
    _check_varied(axes, parameters)
    checked = {name: _values(values, parameters[name]) for name, values in axes.items()}
    for name, values in checked.items():
        falls = np.flatnonzero(np.diff(values) <= 0.0)
        if falls.size:
            low, high = values[falls[0]], values[falls[0] + 1]
            raise ValueError(f"`{name}` must increase strictly, but goes from {low:g} to {high:g}; sort its values")
    return checked


def check_apart(axes: Iterable[str], indices: Iterable[str]) -> None:
    """Raise if a result would have an axis and an index of one name."""
    for name in sorted({*axes}.intersection(indices)):
        raise ValueError(
            f"`{name}` is an axis and an index here; vary the axis under another name, "
            f"vi.family(lambda load=1.0: model.replace({name}=load))"
        )


def units_of(axes: Mapping[str, Any], parameters: Mapping[str, Parameter]) -> dict[str, str]:
    """Return the units in which checked axes were given, where these are not the parameters' own."""
    given = {name: in_own_unit(parameters[name], values).unit for name, values in axes.items()}
    return {name: unit for name, unit in given.items() if unit not in ("", parameters[name].unit)}


def check_points(points: Any, model: Model) -> dict[str, Floats]:
    """Return the columns of a table of designs as arrays of equal length."""
    try:
        columns = {str(name): points[name] for name in points}
    except (TypeError, KeyError, IndexError):
        raise invalid(
            "points", points, "a mapping or DataFrame of columns", "as in {'omega': [...], 'gap': [...]}"
        ) from None
    if not columns:
        raise invalid("points", points, "a table with at least one column")
    _check_varied(columns, model.parameters)
    checked = {name: _values(values, model.parameters[name]) for name, values in columns.items()}
    if len({len(values) for values in checked.values()}) > 1:
        lengths = ", ".join(f"{name} has {len(values)}" for name, values in checked.items())
        raise ValueError(f"`points` must have columns of equal length, but {lengths}")
    return checked


def check_start(start: Any) -> State | tuple[State | None, ...] | int | None:
    """Return one initial condition, several as a tuple, or their number."""
    if hasattr(start, "__index__"):
        return whole_number("start", start, 2)
    if not isinstance(start, (list, tuple)):
        return one_start(start)
    if not start:
        raise invalid("start", start, "None, a State or a list of at least one")
    return tuple(one_start(one) for one in start)


def _check_varied(names: Mapping[str, Any], parameters: Mapping[str, Parameter]) -> None:
    check_names(parameters, names)
    for name in names:
        if (other := parameters[name].replaces) in names:
            raise ValueError(f"give either `{other}` or `{name}`, not both")


def _values(entries: Any, parameter: Parameter) -> Floats:
    values = _numbers(in_own_unit(parameter, entries).values)
    if values.ndim != 1 or values.size == 0:
        hint = f"as in {parameter.name}=np.linspace(0.1, 5, 200)"
        raise invalid(parameter.name, entries, "a one-dimensional, non-empty list of numbers", hint)
    for value in (*values[~np.isfinite(values)][:1], values.min(), values.max()):  # ranges are intervals
        parameter.check(value.item())
    return values


def _numbers(entries: Any) -> Floats:
    """Return a list of numbers as a one-dimensional array, or a two-dimensional one for text and other input."""
    none = np.empty((0, 0))
    try:
        array = np.asarray(entries)
        listed = array.dtype.kind == "O" and not any(isinstance(value, (str, bytes, bool)) for value in array.flat)
        return np.array(array, dtype=np.float64) if array.dtype.kind in "iuf" or listed or not array.size else none
    except (TypeError, ValueError, OverflowError):
        return none


def key_of(identity: dict[str, Any]) -> str:
    """Return a short name of an identity: the same for the same study, on any machine."""
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()[:16]


def differences(stored: dict[str, Any], wanted: dict[str, Any]) -> str:
    """Return the differences of two identities in words."""
    texts = []
    for name in {**stored, **wanted}:
        if stored.get(name) != wanted.get(name):
            marked = [str(identity.get(name, "none")) for identity in (stored, wanted)]
            plain = [unmarked(name, entry) for entry in marked]
            old, new = marked if plain[0] == plain[1] else plain
            texts.append(f"{name} is {old} there, {new} here")
    return "; ".join(texts)


def unmarked(name: str, value: str) -> str:
    """Return the entry of an identity under a name; for an axis, without its mark."""
    return re.sub(r" \([0-9a-f]{8}\)$", "", value) if name.startswith("axis ") else value


def mark(name: str, values: Floats) -> str:
    """Return an axis in words, with a mark that identifies its values."""
    digest = hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()[:8]
    return f"{name} {values[0]:g} to {values[-1]:g} in {len(values)} ({digest})"
