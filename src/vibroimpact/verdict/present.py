"""The motion an oscillator settles to from rest: its name, its cycle, and the orbit it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from vibroimpact.motion import Motion, recognise
from vibroimpact.orbits import Orbit, find_orbit
from vibroimpact.oscillator import ImpactOscillator
from vibroimpact.sections import impact_section
from vibroimpact.verdict.readings import Laboratory, Reading, Start

SETTLED = 1000  # impacts left out before a cycle is read off
SHOWN = 400  # impacts it is read off
ALIKE = 1e-3  # of the fastest hit and of a period: an orbit this near the settled motion is it
LONGEST = 16  # impacts in a cycle that is still solved for


@dataclass(frozen=True)
class Present:
    """A settled motion: what was read of it, its cycle, its exact orbit where there is one, and a state on it."""

    oscillator: ImpactOscillator
    reading: Reading
    motion: Motion
    orbit: Orbit | None
    state: Start | None


def present_motion(osc: ImpactOscillator, laboratory: Laboratory) -> Present:
    """Return the motion that a start from rest settles to."""
    (reading,) = laboratory.read([osc], [None])
    (state,) = laboratory.carry([osc], [None], SETTLED)
    if not reading.status.has_indices:
        return Present(osc, reading, Motion(reading.status.word), None, state)
    section = impact_section(osc, transient_impacts=SETTLED, sample_impacts=SHOWN, tolerances=laboratory.tolerances)
    seen = recognise(section)
    if reading.kind == "periodic":
        orbit = _orbit(osc, reading.n_periods, reading.n_impacts, section) if section.sizes["impact"] else None
        return Present(osc, reading, _told(orbit) if orbit else _named(reading, seen), orbit, state)
    if reading.kind == "sticking":
        orbit = next(iter(find_orbit(osc, n_periods=max(reading.n_periods, 1), n_impacts=-1)), None)
        return Present(osc, reading, _named(reading, seen), orbit, state)
    return Present(osc, reading, Motion("aperiodic" if reading.kind == "chaotic" else "undetermined"), None, state)


def _orbit(osc: ImpactOscillator, n_periods: int, n_impacts: int, section: xr.Dataset) -> Orbit | None:
    """Return the stable orbit that the settled motion's last impact lies on."""
    if n_impacts > LONGEST:
        return None
    last = float(section["phase"][-1]), float(section["velocity"][-1])
    near = [
        orbit
        for orbit in find_orbit(osc, n_periods=n_periods, n_impacts=n_impacts, near=last)
        if orbit.stable and orbit.admissible and _distance(orbit, *last) < ALIKE
    ]
    return min(near, key=lambda orbit: _distance(orbit, *last), default=None)


def _distance(orbit: Orbit, phase: float, velocity: float) -> float:
    turns = np.abs(np.array(orbit.phases) - phase)
    speeds = np.abs(np.array(orbit.velocities) - velocity) / max(orbit.velocities)
    return float(np.maximum(np.minimum(turns, 1.0 - turns), speeds).min())


def _told(orbit: Orbit) -> Motion:
    return Motion("periodic", orbit.n_periods, orbit.n_impacts, orbit.velocities, orbit.phases)


def _named(reading: Reading, seen: Motion) -> Motion:
    """Return the cycle seen, under the name that the indices tell."""
    if seen.kind == reading.kind:
        return seen
    return Motion(reading.kind, reading.n_periods, reading.n_impacts)
