"""The witness for systems against Siconos: 50 random systems, most of which stick, some of them struck while closed."""

import json
import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from vibroimpact.backends.reference.phases import LinearSystem
from vibroimpact.backends.reference.stops import RigidStop
from witness import follow

RECORDED = json.loads((Path(__file__).parents[1] / "data" / "siconos.json").read_text())["systems"]  # by tests/oracles
NUDGE = 1e-9  # of the velocity at the start, to see how errors grow


def design(recorded):
    matrices = {name: np.array(recorded[name]) for name in ("mass", "damping", "stiffness", "constant")}
    waves = {int(h): np.array(sines) + 1j * np.array(recorded["cosines"][h]) for h, sines in recorded["sines"].items()}
    stops = zip(recorded["directions"], recorded["gaps"], recorded["restitution"], strict=True)
    parts = tuple(RigidStop(np.array(a), gap, r) for a, gap, r in stops)
    return LinearSystem(**matrices, omega=recorded["omega"], harmonics=waves, stops=parts)


@cache  # most of the tests' time
def impacts(number, factor=1.0):
    """Return time, closing speed and stop of as many impacts as are recorded, and the whole motion."""
    recorded = RECORDED[number]
    last = recorded["impacts"][-1][0] + 1e-3
    trajectory = follow(
        design(recorded),
        recorded["displacement"],
        factor * np.array(recorded["velocity"]),
        impacts=1000,
        most_periods=last * recorded["omega"] / (2 * math.pi),
    )
    hits = [event for event in trajectory.impacts if event.velocity > recorded["least"]][: len(recorded["impacts"])]
    return np.array([(event.time, event.velocity) for event in hits]), [event.stop for event in hits], trajectory


@pytest.mark.long(but=4)
@pytest.mark.parametrize("number", range(len(RECORDED)))
def test_the_first_impacts_are_those_of_siconos(number):
    recorded = RECORDED[number]
    found, stops, _ = impacts(number)
    known = np.array([(time, velocity) for time, _, velocity in recorded["impacts"]])
    assert stops == [stop for _, stop, _ in recorded["impacts"]]
    wrong = np.abs(found - known).max(axis=1)
    if wrong.max() > 1e-9:
        near, others, _ = impacts(number, 1.0 + NUDGE)
        assert others == stops
        growth = np.maximum.accumulate(np.abs(near - found).max(axis=1)) / NUDGE
        wrong /= growth.clip(1.0)
    assert wrong.max() < 1e-9


@pytest.mark.long
def test_what_is_recorded_is_of_all_kinds():
    motions = [impacts(number)[2] for number in range(len(RECORDED))]
    assert sum(any(event.kind == "release" for event in motion.events) for motion in motions) >= 20
    assert sum(any(event.closed for event in motion.impacts) for motion in motions) >= 8
    assert sum(np.linalg.eigvalsh(recorded["stiffness"])[0] < 2e-3 for recorded in RECORDED) >= 5
    assert sum(len(recorded["impacts"]) for recorded in RECORDED) >= 800
