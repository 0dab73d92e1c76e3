"""The oscillators every contender gets, and what is known of them to 50 digits."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

import vibroimpact as vi
from benchmarks.effort import Effort
from benchmarks.measure import ROOT, Job

Floats = NDArray[np.float64]

OSCILLATOR = vi.ImpactOscillator()  # m = k = f = 1, c = 0.01, r = 0.8, g = 0, so V = 1 m/s
START = vi.State(-1.0)  # at rest, away from the stop: no contender begins with a contact
LOW = 0.1  # rad/s, where each period has a complete chatter, a stick, and a release at T/2
LOW_PERIODS = 3
LOW_PERIOD = 2 * np.pi / LOW
CASES = {"chaotic": (2.8, 2.8), "period-1": (2.0, 2.0), "spread": (0.05, 5.0)}  # the ends of w
CUT = 1e-6  # m/s; below it, contenders with sticking added look whether the chatter is complete


def frequencies(case: str, number: int) -> Floats:
    """Return driving frequencies of a case; those of a single oscillator differ by 1e-9, as an axis must rise."""
    low, high = CASES[case]
    if low == high:
        return np.asarray(low * (1 + 1e-9 * np.arange(number)))
    return np.linspace(low, high, number)


@dataclass(frozen=True)
class LowRun:
    """What a contender makes of three periods at w = 0.1; `highest` is its largest displacement in m."""

    velocities: Sequence[float] | Floats
    highest: float | None
    stalled: str = ""


class Contender(Protocol):
    """One way to compute impacts; `note` says why it could not be measured here, if so."""

    @property
    def name(self) -> str: ...

    @property
    def note(self) -> str: ...

    def velocities(self, omega: float, count: int) -> Floats:
        """Return the velocities of the first impacts from `START`."""
        ...

    def low_frequency(self) -> LowRun:
        """Run three periods at w = 0.1 from `START`."""
        ...

    def job(self, case: str, effort: Effort) -> Job | None:
        """Return what to time, ready to run, or None where timing it would mean nothing."""
        ...


@cache
def known() -> Any:
    """Return the values computed with 50 digits by independent code."""
    return json.loads((ROOT / "tests" / "data" / "values.json").read_text())


def accuracy(contender: Contender, effort: Effort) -> dict[str, Any]:
    """Return the largest error of the first 20 impacts (w = 2.8) and of a settled one (w = 2), in m/s."""
    first = np.array([float(hit["v"]) for hit in known()["first_20_impacts"]["w=2.8,y-1"]["impacts"]])
    settled = float(known()["period_n_impact_1"]["w=2.0,n=1"]["v"])
    found = contender.velocities(2.8, len(first))
    last = contender.velocities(2.0, effort.settle)[-1]
    return {"error_first_20": float(np.abs(found - first).max()), "error_settled": float(abs(last - settled))}


def verdict(run: LowRun) -> dict[str, Any]:
    """Return whether a run at w = 0.1 stays in front of the stop, sticks, and leaves it at T/2.

    After a release at T/2 the next impact is known to all digits; no other way leads to its velocity.
    """
    next_hit = float(known()["sticking_w=0.1"]["impacts"][0]["v"])
    velocities = np.asarray(run.velocities)
    rattles = len(velocities) > 1000  # a chatter down to 1e-9 m/s has 89 impacts, and there are three
    stalls = f"rattles, {len(velocities)} impacts in three periods" if rattles else run.stalled
    return {
        "passes_the_stop_by": None if run.highest is None else max(float(run.highest), 0.0),
        "stays_in_front": None if run.highest is None else bool(run.highest <= 1e-9),
        "sticks_and_leaves": not stalls and bool((np.abs(velocities - next_hit) < 1e-6).any()),
        "stalls": stalls,
        "impacts_in_3_periods": len(velocities),
    }
