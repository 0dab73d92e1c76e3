"""Cells of systems: designs with their initial conditions, as the one table that the engine of systems reads."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.cells import BEYOND, COUNTABLE, NOWHERE, Cells, Floats, spread
from vibroimpact.matrices import nearest
from vibroimpact.model.elements import BLOCKS, bars
from vibroimpact.model.modal import ModalForm, fastest_rates, speed_parts, steady_motions, velocity_scales
from vibroimpact.parameters import hertz, radians

if TYPE_CHECKING:
    from vibroimpact.model import State
    from vibroimpact.model.system import ImpactSystem


@dataclass(frozen=True)
class Shape:
    """Properties that all systems of one table share: their numbers of modes, stops and harmonics.

    `coupled`: at least one has non-proportional damping; `moving`: at least one stop moves; `compliant`, `rigid`: at
    least one stop is compliant, or rigid.
    """

    modes: int
    stops: int
    harmonics: int
    coupled: bool
    moving: bool
    compliant: bool = False
    rigid: bool = True

    @property
    def sizes(self) -> dict[str, int]:
        """The size of each block of a row by name; a harmonic has two numbers, its real and imaginary parts."""
        n, s, m = self.modes, self.stops, self.harmonics
        return {
            "eta": n, "rate": n, "turn": 3, "square": n, "damping": n * n, "load": n, "force": 2 * m * n,
            "alpha": s * n, "jump": s * n, "weight": n, "gap": s, "motion": 2 * m * s,
            **{block.name: s for block in BLOCKS.values()},
            "omega": 1, "scale": 1, "steady": n + 2 * m * n, "margin": s, "give": s, "slide": n, "sliding": s * n,
            "neutral": 2 * n, "fastest": 1, "shapes": n * n, "time": 2,
        }  # fmt: skip


@dataclass(frozen=True)
class SystemCells(Cells):
    """One cell per row: the modal form of a system, its velocity scale and its initial condition, all in SI units.

    `cells[name]` is a column; ``cells.block("shapes")`` is a block of several columns.
    """

    # In place of the closest near-miss: stop (-1: not known), phase and velocity of the first impact kept.
    parting = "first_stop", "first_phase", "first_velocity"

    shape: Shape

    @classmethod
    def of_systems(cls, systems: Iterable[ImpactSystem]) -> SystemCells:
        """Return one cell per system, at rest; all must have the same numbers of coordinates and stops.

        Quantities that do not depend on the numbers of stops are computed once for all systems that share them; only
        the first of these systems is kept, and those in which a stop may be in the way of q = 0.
        """
        groups: dict[Any, int] = {}
        bases, which, numbers, pushed = [], [], [], {}
        for row, system in enumerate(systems):
            key = _fixed(system)
            if key not in groups:
                groups[key] = len(groups)
                bases.append(system)
            which.append(groups[key])
            numbers.append([_numbers(stop) for stop in system.stops])
            if any((stop.gap < 0.0 or stop.motion) and stop.element.impenetrable for stop in system.stops):
                pushed[row] = system
        if len({(len(base.mass), len(base.stops)) for base in bases}) > 1:
            raise ValueError("`osc` must have equal numbers of coordinates and stops at all points, but these differ")
        table = np.array(numbers).reshape(len(which), -1, len(BLOCKS))
        forms = [(form, np.array([form.omega])) for form in (base.modal() for base in bases)]
        return cls._of_forms(forms, np.array(which), table, pushed.__getitem__)

    @classmethod
    def of_points(cls, system: ImpactSystem, points: Mapping[str, Any]) -> SystemCells:
        """Return one cell per point of a system's own parameters, at rest.

        What depends on the frequency is computed once for each of its values, together; numbers of stops are columns.
        """
        number = len(np.atleast_1d(next(iter(points.values()), 0.0)))
        omegas = points.get("omega", radians(points["frequency"]) if "frequency" in points else None)
        values, which = np.unique(np.full(number, system.omega) if omegas is None else omegas, return_inverse=True)
        table = np.empty((number, len(system.stops), len(BLOCKS)))
        for j, stop in enumerate(system.stops):
            table[:, j] = _numbers(stop)
            for place, kind in enumerate(BLOCKS):
                if f"{stop.name}_{kind}" in points:
                    table[:, j, place] = points[f"{stop.name}_{kind}"]

        def system_of(row: int) -> ImpactSystem:
            gaps = {f"{name}_gap": float(gap) for name, gap in zip(system.stop_names, table[row, :, 0], strict=True)}
            pace = {"omega": float(values[which[row]])} if system.periodic else {}
            return system.replace(**pace, **gaps)

        return cls._of_forms([(system.modal(), values)], which, table, system_of)

    @classmethod
    def _of_forms(
        cls,
        forms: Sequence[tuple[ModalForm, Floats]],
        which: Any,
        numbers: Floats,
        system_of: Callable[[int], ImpactSystem],
    ) -> SystemCells:
        """Return one cell, at rest, per row of the numbers of stops; `which` is the form and frequency of each row.

        `system_of` returns the system of a row; it is called if stops are in the way of q = 0.
        """
        highest = max(int(form.orders.max(initial=0)) for form, _ in forms)
        coupled, moving = any(not form.decoupled for form, _ in forms), any(form.motions.any() for form, _ in forms)
        blocks = {name: numbers[..., place] for place, name in enumerate(BLOCKS)}
        gaps, barring = blocks["gap"], bars(blocks)
        shape = Shape(
            len(forms[0][0].masses),
            gaps.shape[1],
            highest,
            coupled,
            moving,
            not barring.all(),
            bool(barring.any()),
        )
        parts = zip(*(_rows(form, omegas, shape) for form, omegas in forms), strict=True)
        rows, still, swung, driven, rate, offset = (np.concatenate(part)[which] for part in parts)
        cells = cls(rows, _columns(shape), shape)
        places, margins = cells.places, gaps - still - swung
        for name, values in blocks.items():
            cells.table[:, places[BLOCKS[name].name]] = values
        cells.table[:, places["margin"]] = np.where(np.isnan(margins), -np.inf, margins)
        cells.table[:, places["scale"]] = velocity_scales(driven, rate, offset, cells["omega"], gaps)[:, None]
        beyond = cells._clearances(np.zeros(3), np.zeros_like(cells.block("eta"))) < 0.0
        closed = (beyond & barring).any(axis=1)
        for row in np.flatnonzero(closed).tolist():
            design = system_of(row)
            cells.table[row, places["eta"]] = design.modal().inverse @ design.initial()[0]
        return cells

    @property
    def places(self) -> Mapping[str, slice]:
        """The columns of each block of a row."""
        return _places(self.shape)

    def block(self, name: str) -> Floats:
        """Return the columns of that name."""
        columns: Floats = self.table[:, self.places[name]]
        return columns

    def __getitem__(self, part: Any) -> Any:
        if isinstance(part, str):
            return self.block(part)[:, 0]
        return SystemCells(self.table[part], self.columns, self.shape)

    @property
    def coordinates(self) -> int:
        """The number of coordinates of each cell, not counting a free centre."""
        return int(np.count_nonzero(self._felt))

    @property
    def _felt(self) -> NDArray[np.bool_]:
        """The modes whose drift a stop or a spring resists, in any of the cells."""
        felt: NDArray[np.bool_] = (self.block("neutral")[:, self.shape.modes :] == 0.0).any(axis=0)
        return felt

    @property
    def phases(self) -> Floats:
        """The phases of the initial conditions, in [0, 1)."""
        return self.block("time")[:, 1]

    @property
    def fastest_rate(self) -> Floats:
        """The largest rate in 1/s of free motion or of a harmonic; it limits the step size."""
        return self.block("fastest")[:, 0]

    @property
    def slowest_rate(self) -> Floats:
        """The driving rate or the slowest nonzero natural rate, whichever is slower."""
        squares = np.where(self.block("square") > 0.0, self.block("square"), np.inf)
        slowest: Floats = np.minimum(self["omega"], np.sqrt(squares.min(axis=1)))
        return slowest

    @property
    def shapes(self) -> Floats:
        """The matrix of each cell that converts modes to coordinates."""
        return self.block("shapes").reshape(-1, self.shape.modes, self.shape.modes)

    def struck(self, numbers: Any) -> SystemCells:
        """Return the cells, each starting with one of the numbered impacts on its stops, at some phase and velocity.

        Impact j hits stop j modulo the number of stops; `striking` moves the system there from rest. With several
        coordinates the other velocities are spread too: in each mode up to the energy that V has at the stop, except
        for a centre whose drift nothing resists. Without stops the cells are returned unchanged.
        """
        felt, n, s = self._felt, self.coordinates, self.shape.stops
        if not s:
            return self
        counted = np.asarray(numbers, np.int64)
        phase, velocity, *others = spread(counted, n if n > 1 else 0)
        which, cells = counted % s, self
        if others:
            lightness = self._at_stops(which)[2][:, None] * self.block("weight")[:, felt]
            rate = np.zeros_like(self.block("rate"))
            rate[:, felt] = self["scale"][:, None] * np.column_stack(others) / np.sqrt(lightness)
            cells = self._with({"rate": rate})
        return cells.striking(which, self["scale"] * velocity, phase)

    def striking(self, stops: Any, velocities: Any, phases: Any) -> SystemCells:
        """Return the cells starting with hits of these stops at velocities and phases, with the least change of state.

        The state moves along M^-1 a until the clearance is zero and closes at that velocity, which is the nearest state
        in the mass metric. If it lies beyond other stops, the nearest displacement in front of all of them is taken.
        """
        alpha, jump, mobility = self._at_stops(stops)
        times, rows = _times(np.asarray(phases, np.float64)), np.arange(len(self))
        eta, rate = self.block("eta"), self.block("rate")
        gap = self._clearances(times["turn"], eta)[rows, stops] / mobility
        closing = velocities + self._moving(times["turn"])[rows, stops] - (alpha * rate).sum(axis=1)
        moved = {"eta": eta + gap[:, None] * jump, "rate": rate + (closing / mobility)[:, None] * jump}
        return self._with(moved | times)._before_stops()

    def _at_stops(self, stops: Any) -> tuple[Floats, Floats, Floats]:
        """Return alpha, alpha over the modal masses, and their product, for one stop of each cell."""
        alpha, jump = (self.by_stop(name)[np.arange(len(self)), stops] for name in ("alpha", "jump"))
        return alpha, jump, (alpha * jump).sum(axis=1)

    def by_stop(self, name: str) -> Floats:
        """Return a block with one number per stop and mode, for every cell."""
        return self.block(name).reshape(len(self), self.shape.stops, self.shape.modes)

    def _before_stops(self) -> SystemCells:
        """Return the cells; those beyond a rigid stop are moved to the nearest point in front of all rigid ones."""
        table, alpha, rigid = self.table.copy(), self.by_stop("alpha"), self.bars
        clearances = self._clearances(self.block("turn"), self.block("eta"))
        for row in np.flatnonzero(self.beyond().any(axis=1)).tolist():
            masses, barring = np.diag(self.block("weight")[row]), rigid[row]
            back = nearest(masses, alpha[row][barring], clearances[row][barring])
            table[row, self.places["eta"]] += 0.0 if back is None else back
        return SystemCells(table, self.columns, self.shape)

    def begun(self, start: State | None, names: Sequence[str] = ()) -> SystemCells:
        """Return the cells started from an initial condition; None leaves them as they are; errors use names of stops.

        Raises
        ------
        ValueError
            The initial condition does not have n coordinates, lies beyond a stop of a cell, or is 2^53 driving periods
            or more from time 0.
        """
        if start is None:
            return self
        q, speed = (np.array(part, np.float64, ndmin=1) for part in (start.displacement, start.velocity))
        if len(q) != self.shape.modes:
            raise ValueError(f"`start` must have {self.shape.modes} coordinates, one per mode, got {len(q)}")
        turns = hertz(start.time * self["omega"])
        if not np.abs(turns).max(initial=0.0) < COUNTABLE:
            raise ValueError(f"`start` must have a time of less than 2^53 driving periods, got {start.time!r}")
        cells = self.at(q, speed, turns)
        over = cells.beyond()
        if over.any():
            cell, stop = np.argwhere(over)[0].tolist()
            name, depth = repr(names[stop]) if names else f"stop {stop + 1}", over[cell, stop]
            raise ValueError(
                f"`start` lies beyond {name} by {depth:.3g} m at time {start.time:g}; start in front of it"
            )
        return cells

    def at(self, displacement: Any, velocity: Any, turns: Any) -> SystemCells:
        """Return the cells started from coordinates and velocities, a row each or one for all, at times in periods."""
        columns = (np.broadcast_to(part, (len(self), self.shape.modes)) for part in (displacement, velocity))
        eta, rate = (np.linalg.solve(self.shapes, column[..., None])[..., 0] for column in columns)
        return self._with({"eta": eta, "rate": rate} | _times(turns))

    def _with(self, parts: Mapping[str, Any]) -> SystemCells:
        """Return the cells with some blocks of numbers changed."""
        table = self.table.copy()
        for name, values in parts.items():
            table[:, self.places[name]] = values
        return SystemCells(table, self.columns, self.shape)

    def carried(self, displacement: Any, velocity: Any, phases: Any) -> SystemCells:
        """Return the cells started from states, one row each, at phases.

        States beyond rigid stops are moved to the nearest one in front of them, in the norm sqrt(q . M q); a cell whose
        stops leave no room at that phase keeps its own initial condition.
        """
        moved = self.at(displacement, velocity, np.atleast_1d(phases))._before_stops()
        no_room = moved.beyond().any(axis=1, keepdims=True)
        return SystemCells(np.where(no_room, self.table, moved.table), self.columns, self.shape)

    def beyond(self) -> Floats:
        """Return the depth in m of each initial condition beyond each rigid stop; 0 if it is within rounding."""
        eta = self.block("eta")
        size = np.abs(self.block("gap")) + (np.abs(self.by_stop("alpha")) @ np.abs(eta)[..., None])[..., 0]
        rounding = BEYOND * size + NOWHERE * (self["scale"] / self["omega"])[:, None]
        depth = -self._clearances(self.block("turn"), eta)
        return np.where((depth > rounding) & self.bars, depth, 0.0)

    @property
    def bars(self) -> Any:
        """Which stops are impenetrable, in every cell."""
        return bars({name: self.block(block.name) for name, block in BLOCKS.items()})

    def _clearances(self, turn: Floats, eta: Floats) -> Floats:
        """Return the clearances of all stops at (sin wt, cos wt)."""
        waves, motion = self._waves(turn)
        moved = (motion[..., 0] * waves.imag + motion[..., 1] * waves.real).sum(axis=-1)
        clearances: Floats = self.block("gap") + moved - (self.by_stop("alpha") @ eta[..., None])[..., 0]
        return clearances

    def _moving(self, turn: Floats) -> Floats:
        """Return the velocities of all stops, along their directions, at (sin wt, cos wt)."""
        waves, motion = self._waves(turn)
        rates = self["omega"][:, None] * np.arange(1, self.shape.harmonics + 1)
        velocities: Floats = (rates[:, None] * (motion[..., 0] * waves.real - motion[..., 1] * waves.imag)).sum(axis=-1)
        return velocities

    def _waves(self, turn: Floats) -> tuple[Any, Floats]:
        """Return exp(i h w t) of all orders, and the harmonics of each stop's motion."""
        wave = (turn[..., 1] + 1j * turn[..., 0]) if turn.ndim > 1 else np.ones(len(self), complex)
        powers = wave[:, None] ** np.arange(1, self.shape.harmonics + 1)
        return powers[:, None, :], self.block("motion").reshape(len(self), self.shape.stops, self.shape.harmonics, 2)

    def __iter__(self) -> Iterator[dict[str, float]]:
        raise TypeError("cells of systems have blocks of numbers, not one row of named ones")


def _times(turns: Floats) -> dict[str, Floats]:
    """Return the blocks of times, given in driving periods."""
    whole = np.floor(turns)
    angle = radians(turns - whole)
    turn = np.column_stack([np.sin(angle), np.cos(angle), whole])
    return {"turn": turn, "time": np.column_stack([whole, turns - whole])}


@cache
def _places(shape: Shape) -> Mapping[str, slice]:
    ends = np.cumsum([0, *shape.sizes.values()]).tolist()
    return {name: slice(first, last) for name, (first, last) in zip(shape.sizes, pairwise(ends), strict=True)}


def _columns(shape: Shape) -> tuple[str, ...]:
    return tuple(f"{name}_{place}" for name, size in shape.sizes.items() for place in range(size))


def _numbers(stop: Any) -> tuple[float, ...]:
    """Return the numbers of a stop in the order of `BLOCKS`."""
    row = {"gap": stop.gap} | stop.element.row()
    return tuple(row.get(name, block.none) for name, block in BLOCKS.items())


def _fixed(system: ImpactSystem) -> tuple[Any, ...]:
    """Return a key of all numbers of a system except those of its stops."""
    force = system.force
    load = [(order, part.tobytes()) for order, part in force.harmonics.items()]
    stops = [(stop.direction.tobytes(), *stop.motion.items()) for stop in system.stops]
    matrices = system.mass.tobytes(), system.damping.tobytes(), system.stiffness.tobytes()
    return force.rate, None if force.constant is None else force.constant.tobytes(), *matrices, *load, *stops


def _rows(form: ModalForm, omegas: Floats, shape: Shape) -> tuple[Floats, ...]:
    """Return one row per frequency, without what depends on the numbers of stops.

    The rows are followed by the steady motion's parts of the gaps, and by the parts of V (`speed_parts`).
    """
    n, s, highest = shape.modes, shape.stops, shape.harmonics
    forces, motions = np.zeros((n, highest), complex), np.zeros((s, highest), complex)
    forces[:, form.orders - 1], motions[:, form.orders - 1] = form.forces.T, form.motions
    parts: dict[str, Any] = {
        "turn": (0.0, 1.0, 0.0),
        "square": form.squares,
        "damping": form.damping,
        "load": form.constant,
        "force": np.stack([forces.real, forces.imag], -1),
        "alpha": form.directions,
        "jump": form.jumps,
        "weight": form.masses,
        "neutral": form.neutral,
        "motion": np.stack([motions.real, motions.imag], -1),
        "shapes": form.shapes,
    }
    steady, still, swung = steady_motions(form, omegas, forces, motions)
    columns = {"omega": omegas[:, None], "fastest": fastest_rates(form, omegas)[:, None]} | steady
    rows, places = np.zeros((len(omegas), sum(shape.sizes.values()))), _places(shape)
    for name, values in (columns | {name: np.ravel(values) for name, values in parts.items()}).items():
        rows[:, places[name]] = values
    return rows, still, swung, *speed_parts(form, omegas)
