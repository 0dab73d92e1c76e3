r"""Systems that are equivalent to one mass at one fixed rigid stop, for the engine of one mass.

In the coordinate y = alpha eta towards the stop, from equilibrium under the constant load, with the modal mass M of y,

.. math:: M \ddot y + M D \dot y + M \Omega^2 y = M |\alpha f_1| \sin(\omega t + \arg \alpha f_1), \qquad y \le g',

which is an oscillator with a phase lead.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends.base import (
    Backend,
    Floats,
    Measurement,
    Outcome,
    Samples,
    StroboscopicWindow,
    TimesWindow,
    Window,
    with_stop_axis,
)
from vibroimpact.cells import Cells
from vibroimpact.model.elements import BLOCKS
from vibroimpact.model.oscillator import ImpactOscillator
from vibroimpact.model.system_cells import SystemCells

ONE_MASS = "one mass in front of one fixed rigid stop, driven at one frequency"
BELOW_ONE = np.nextafter(1.0, 0.0)
ROUNDING = 1e-15  # relative to the lengths whose difference is the clearance
SAME = 1e-12  # relative to a velocity scale: such a difference is rounding

# Blocks of numbers that are zero for such a stop.
_NONE_OF = "motion", *(block.name for number, block in BLOCKS.items() if number not in ("gap", "restitution"))


def is_one_mass(cells: SystemCells) -> NDArray[np.bool_]:
    """Return which cells are one mass at one fixed rigid stop, driven at one frequency or not at all.

    Their velocity scale must equal that of the oscillator, which it does not if the spring is so soft that the load
    determines it.
    """
    if (cells.shape.modes, cells.shape.stops) != (1, 1):
        return np.zeros(len(cells), bool)
    lacking = [(cells.block(name) == 0.0).all(axis=1) for name in _NONE_OF]
    plain: NDArray[np.bool_] = np.logical_and.reduce(lacking) & (cells.block("force")[:, 2:] == 0.0).all(axis=1)
    plain &= (cells["square"] > 0.0) & (cells["damping"] >= 0.0) & (cells["omega"] > 0.0) & np.isfinite(cells["omega"])
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = as_one_mass(cells)[0].velocity_scale
        plain &= np.abs(scale - cells["scale"]) <= SAME * cells["scale"]
    return plain


def as_one_mass(cells: SystemCells) -> tuple[Cells, Floats]:
    """Return cells of such systems as cells of oscillators, and the phase lead of these, in [0, 1)."""
    alpha, square, weight = cells["alpha"], cells["square"], cells["weight"]
    force = cells.block("force")
    wave = alpha * (force[:, 0] + 1j * force[:, 1]) if force.shape[1] else np.zeros(len(cells), complex)
    mass, ahead = weight / alpha**2, np.angle(wave) / (2.0 * np.pi) % 1.0
    turns = cells.block("time")[:, 1] + ahead
    gap, towards = cells["gap"], alpha * cells["eta"]
    clearance = gap - towards
    clearance[np.abs(clearance) <= ROUNDING * (np.abs(gap) + np.abs(towards))] = 0.0  # at rest at the stop
    columns = {
        "mass": mass,
        "damping": mass * cells["damping"],
        "stiffness": mass * square,
        "amplitude": mass * np.abs(wave),
        "omega": cells["omega"],
        "restitution": cells["restitution"],
        "gap": gap - alpha * cells["load"] / square,
        "clearance": clearance,
        "velocity": alpha * cells["rate"],
        "periods": cells.block("time")[:, 0] + np.floor(turns),
        "phase": turns - np.floor(turns),
    }
    return Cells.of(columns), ahead


def as_systems(cells: Cells) -> SystemCells:
    """Return cells of oscillators as cells of systems of one coordinate, y."""
    systems: SystemCells = ImpactOscillator().system.cells({}).copies(len(cells))
    mass, square, damping = cells["mass"], cells["stiffness"] / cells["mass"], cells["damping"] / cells["mass"]
    force, omega, still = cells["amplitude"] / mass, cells["omega"], np.zeros(len(cells))
    with np.errstate(divide="ignore", invalid="ignore"):
        wave = np.nan_to_num(force / (square - omega**2 + 1j * omega * damping), posinf=0.0, neginf=0.0)
    columns: dict[str, list[Floats]] = {
        "square": [square], "damping": [damping], "force": [force, still], "jump": [1.0 / mass], "weight": [mass],
        "gap": [cells["gap"]], "restitution": [cells["restitution"]], "omega": [omega], "fastest": [cells.fastest_rate],
        "scale": [cells.velocity_scale], "steady": [still, wave.real, wave.imag], "give": [1.0 / cells["stiffness"]],
        "margin": [cells["gap"] - np.abs(wave)],
    }  # fmt: skip
    for name, values in columns.items():
        systems.block(name)[:] = np.column_stack(values)
    return systems


def resumed(cells: SystemCells, clearance: Floats, velocity: Floats, turns: Floats) -> SystemCells:
    """Return such systems started from states of the equivalent oscillators."""
    towards = cells.shapes[:, 0] / cells.block("alpha")  # derivative of the coordinate by y
    return cells.at(towards * (cells.block("gap") - clearance[:, None]), towards * velocity[:, None], turns)


def samples(
    cells: SystemCells,
    measurement: Measurement,
    engine: Callable[[Cells, Measurement], list[Samples]],
) -> list[Samples]:
    """Return the samples of each cell in the window, from an engine of one mass."""
    oscillators, ahead = as_one_mass(cells)
    motions: list[Any] = [None] * len(cells)
    follows = _shifted(measurement.window, 0.5) is measurement.window
    groups = np.zeros(len(cells)) if follows else ahead  # each cell has its own sampling phases
    for group in np.unique(groups):
        rows = np.flatnonzero(groups == group)
        sampled = engine(oscillators[rows], replace(measurement, window=_shifted(measurement.window, float(group))))
        for row, motion in zip(rows.tolist(), sampled, strict=True):
            gap = float(oscillators["gap"][row])
            motions[row] = _of_system(cells[row : row + 1], gap, float(ahead[row]), motion)
    return motions


def _shifted(window: Window, ahead: float) -> Window:
    """Return a window whose phases are those of a load that is ahead; one without phases of its own is unchanged."""
    if isinstance(window, TimesWindow):
        phase = window.phase + ahead
        return replace(window, periods=window.periods + np.floor(phase), phase=phase - np.floor(phase))
    if isinstance(window, StroboscopicWindow) and window.phase is not None:
        return replace(window, phase=(window.phase + ahead) % 1.0)
    return window


def _of_system(cell: SystemCells, gap: float, ahead: float, motion: Samples) -> Samples:
    """Return the samples of an oscillator with a gap as those of the equivalent system."""

    def behind(periods: Any, phase: Any) -> tuple[Floats, Floats]:
        whole = np.floor(phase - ahead)
        return periods + whole, np.minimum(phase - ahead - whole, BELOW_ONE)

    towards = cell.shapes[0, 0, 0] / cell["alpha"]  # derivative of the coordinate by y
    impacts = behind(motion.impact_periods, motion.impact_phase)
    looks = behind(motion.look_periods, motion.look_phase)
    return replace(
        motion,
        impact_periods=impacts[0],
        impact_phase=impacts[1],
        look_periods=looks[0],
        look_phase=looks[1],
        look_displacement=(cell["gap"] - gap + motion.look_displacement) * towards,
        look_velocity=motion.look_velocity * towards,
        rest_begin=np.column_stack(behind(*motion.rest_begin.T)),
        rest_end=np.column_stack(behind(*motion.rest_end.T)),
        last_displacement=(cell["gap"] - motion.last_clearance) * towards,
        last_velocity=motion.last_velocity * towards,
        last_phase=float(behind(0.0, motion.last_phase)[1]),
        last_clearance=math.nan,
    )


class OfOneMass(Backend):
    """A back end for one mass at one fixed rigid stop, driven at one frequency, given as an oscillator or a system."""

    def indices(self, cells: Cells, measurement: Measurement) -> Outcome:
        """Return the indices, the status, the impacts computed and the certified steps of each cell."""
        self.check_takes(cells)
        oscillators = as_one_mass(cells)[0] if isinstance(cells, SystemCells) else cells
        return with_stop_axis(self._indices(oscillators, measurement), measurement)

    def samples(self, cells: Cells, measurement: Measurement) -> list[Any]:
        """Return the samples of each cell in the window."""
        if not isinstance(cells, SystemCells):
            return self._samples(cells, measurement)
        self.check_takes(cells)
        return samples(cells, measurement, self._samples)

    def check_takes(self, cells: Cells) -> None:
        """Raise `ValueError` for other models."""
        if isinstance(cells, SystemCells) and not is_one_mass(cells).all():
            raise ValueError(f"`backend` {self.name!r} takes only {ONE_MASS}; omit it")

    def _indices(self, cells: Cells, measurement: Measurement) -> Outcome:
        raise NotImplementedError

    def _samples(self, cells: Cells, measurement: Measurement) -> list[Samples]:
        raise NotImplementedError
