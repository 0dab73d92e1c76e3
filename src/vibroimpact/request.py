"""A sweep that can be cut, sent away, stored and taken up again."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import asdict, dataclass
from threading import Event
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends import Cells, ImpactWindow, get_backend
from vibroimpact.backends.starts import make_cells
from vibroimpact.dataset import package_version
from vibroimpact.execution.store.tiling import CELLS
from vibroimpact.execution.threads import run_here
from vibroimpact.options import Tolerances
from vibroimpact.oscillator import ImpactOscillator, State

Floats = NDArray[np.float64]
Computed = tuple[dict[str, NDArray[Any]], float]

SLOW = ("reference", "fixed-step")  # back ends that take up to seconds a cell
FEW = 4  # cells of a tile with them


@dataclass(frozen=True)
class Request:
    """All that decides the numbers of a parameter map; checked by whoever makes it."""

    oscillator: ImpactOscillator
    axes: dict[str, Floats]
    indices: tuple[str, ...]
    window: ImpactWindow
    tolerances: Tolerances
    start: State | None = None
    backend: str = "cpu"
    time_step: float | None = None
    early_closing: bool = True

    @property
    def shape(self) -> tuple[int, ...]:
        """Cells along each axis."""
        return tuple(len(values) for values in self.axes.values())

    def identity(self) -> dict[str, Any]:
        """Return what two requests must share for one to go on where the other stopped."""
        fixed = {name: value for name, value in asdict(self.oscillator).items() if name not in self.varied}
        return {
            "version": package_version(),
            **fixed,
            **{f"axis {number}": told(name, values) for number, (name, values) in enumerate(self.axes.items(), 1)},
            "indices": ", ".join(self.indices),
            "transient_impacts": self.window.transient,
            "sample_impacts": self.window.keep,
            **asdict(self.tolerances),
            "start": "at rest" if self.start is None else str(self.start),
            "backend": self.backend,
            "time_step": self.time_step,
            "early_closing": self.early_closing,
        }

    def arguments(self) -> dict[str, Any]:
        """Return the call in the words of the API, for the provenance of a result."""
        return {
            "indices": self.indices,
            "backend": self.backend,
            "time_step": self.time_step,
            "transient_impacts": self.window.transient,
            "sample_impacts": self.window.keep,
            "start": self.start,
            "early_closing": self.early_closing,
            "tolerances": self.tolerances,
        }

    @property
    def usual_tile(self) -> int:
        """Cells of a tile unless told otherwise: no more than may be lost when a sweep ends at once."""
        return FEW if self.backend in SLOW else CELLS

    @property
    def varied(self) -> set[str]:
        """The oscillator's parameters that the axes vary."""
        return {"omega" if name == "frequency" else name for name in self.axes}

    def compute(self, part: tuple[slice, ...], stop: Event | None = None) -> Computed:
        """Return indices, status, impacts and steps of a box of cells, each in its shape, and the seconds it took.

        Raises
        ------
        GivenUp
            `stop` was set before all cells had ended.
        """
        began = perf_counter()
        axes = {name: values[along] for (name, values), along in zip(self.axes.items(), part, strict=True)}
        engine = get_backend(self.backend, time_step=self.time_step)
        how = self.window, self.tolerances, self.early_closing, self.indices
        result = run_here(engine, self.cells_of(axes), *how, stop or Event())
        box = tuple(len(values) for values in axes.values())
        kept = {name: result[name].reshape(box) for name in (*self.indices, "status", "impacts", "steps")}
        return kept, perf_counter() - began

    def cells_of(self, axes: dict[str, Floats]) -> Cells:
        """Return the cells that axes span."""
        return make_cells(self.oscillator, self.start, axes)


def key_of(identity: dict[str, Any]) -> str:
    """Return a short name of an identity: the same for the same study, on any machine."""
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()[:16]


def differences(stored: dict[str, Any], asked: dict[str, Any]) -> str:
    """Return in words where two identities differ."""
    names = [name for name in {**stored, **asked} if stored.get(name) != asked.get(name)]
    pairs = [(name, str(stored.get(name, "none")), str(asked.get(name, "none"))) for name in names]
    plain = [(name, unmarked(name, there), unmarked(name, here)) for name, there, here in pairs]
    kept = [marked if short[1] == short[2] else short for marked, short in zip(pairs, plain, strict=True)]
    return "; ".join(f"{name} is {there} there, {here} here" for name, there, here in kept)


def unmarked(name: str, value: str) -> str:
    """Return what an identity holds under a name, an axis without its mark."""
    return re.sub(r" \([0-9a-f]{8}\)$", "", value) if name.startswith("axis ") else value


def told(name: str, values: Floats) -> str:
    """Return an axis in words, with a mark that no other values share."""
    mark = hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()[:8]
    return f"{name} {values[0]:g} to {values[-1]:g} in {len(values)} ({mark})"
