"""A sweep that can be cut, sent away, stored and taken up again."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends import ImpactWindow, get_backend
from vibroimpact.backends.starts import make_cells
from vibroimpact.dataset import package_version
from vibroimpact.options import Tolerances
from vibroimpact.oscillator import ImpactOscillator, State

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SweepRequest:
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

    @property
    def varied(self) -> set[str]:
        """The oscillator's parameters that the axes vary."""
        return {"omega" if name == "frequency" else name for name in self.axes}

    def compute(self, part: tuple[slice, ...]) -> tuple[dict[str, NDArray[Any]], float]:
        """Return indices, status, impacts and steps of a box of cells, each in its shape, and the seconds it took."""
        began = perf_counter()
        axes = {name: values[along] for (name, values), along in zip(self.axes.items(), part, strict=True)}
        engine = get_backend(self.backend, time_step=self.time_step)
        cells = make_cells(self.oscillator, self.start, axes)
        result = engine.indices(cells, self.window, self.tolerances, self.early_closing, self.indices)
        box = tuple(len(values) for values in axes.values())
        kept = {name: result[name].reshape(box) for name in (*self.indices, "status", "impacts", "steps")}
        return kept, perf_counter() - began


def key_of(identity: dict[str, Any]) -> str:
    """Return a short name of an identity: the same for the same study, on any machine."""
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()[:16]


def differences(stored: dict[str, Any], asked: dict[str, Any]) -> str:
    """Return in words where two identities differ."""
    names = [name for name in {**stored, **asked} if stored.get(name) != asked.get(name)]
    return "; ".join(f"{name} is {stored.get(name, 'none')} there, {asked.get(name, 'none')} here" for name in names)


def told(name: str, values: Floats) -> str:
    """Return an axis in words, with a mark that no other values share."""
    mark = hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()[:8]
    return f"{name} {values[0]:g} to {values[-1]:g} in {len(values)} ({mark})"
