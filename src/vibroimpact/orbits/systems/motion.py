"""The motion along an orbit at given times: flight by flight in closed form, or by the engine if it rests at a stop."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from vibroimpact.backends.modal.carry import Carrier
from vibroimpact.cells import Floats
from vibroimpact.options import Tolerances
from vibroimpact.orbits.systems.flow import Flow
from vibroimpact.orbits.systems.orbit import cycle_of


def motion_of(orbit: Any, times: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Return displacements, velocities and accelerations at times in s, each of shape (times, coordinates)."""
    kinematics = (_with_rests if orbit.sticks else _in_flight)(orbit, np.ravel(np.asarray(times, np.float64)))
    return kinematics[0], kinematics[1], kinematics[2]


def _in_flight(orbit: Any, times: Floats) -> Floats:
    cycle, unknown = cycle_of(orbit)
    flow, ends = cycle.flow, cycle.angles(unknown)
    angles = times * flow.omega
    kinematics = np.empty((3, len(angles), flow.n))
    for row, angle in enumerate(unknown[0] + (angles - unknown[0]) % cycle.length):
        i = min(int(np.searchsorted(ends, angle, side="right")) - 1, len(cycle.events) - 1)
        leg = cycle.leg(unknown, i)
        x = flow.fly(leg.start[: 2 * flow.n], ends[i], angle, leg.pushing)
        rate = flow.rate(x, flow.drive(angle), leg.pushing)
        kinematics[:2, row] = (flow.physical @ x).reshape(2, flow.n)
        kinematics[2, row] = flow.omega * (flow.physical @ rate)[flow.n :]
    return kinematics


def _with_rests(orbit: Any, times: Floats) -> Floats:
    """Return the same of an orbit with rests, each time from the one before."""
    system, period = orbit.system, orbit.system.period
    carrier, flow = Carrier(system.cells({}), Tolerances()), Flow(system)
    first, done = orbit.start.time / period, 0.0
    later = (times / period - first) % orbit.n_periods
    x = carrier.state(*(np.atleast_1d(part) for part in (orbit.start.displacement, orbit.start.velocity)))
    kinematics = np.empty((3, len(times), flow.n))
    for row in np.argsort(later, kind="stable"):
        if later[row] > done:
            x, _ = carrier.over(x, (first + done) % 1.0, later[row] - done)
            done = later[row]
        place, speed = carrier.coordinates(x)
        kinematics[:, row] = place, speed, _acceleration(orbit, flow, np.append(place, speed), first + done)
    return kinematics


def _acceleration(orbit: Any, flow: Flow, state: Floats, turn: float) -> Floats:
    """Return accelerations, in a rest under the forces of the closed stops, which keep their clearances at 0."""
    system, angle = orbit.system, 2.0 * np.pi * turn
    x = np.linalg.solve(flow.physical, state).astype(np.float64)
    z = flow.drive(angle)
    free: Floats = flow.omega * (flow.physical @ flow.rate(x, z, flow.pressed(x, z)))[flow.n :]
    closed = [stop for stop, begin, end in orbit.rests if (turn - begin) % orbit.n_periods < end - begin]
    if not closed:
        return free
    stops = [system.stops[system.stop_names.index(name)] for name in closed]
    directions = np.array([stop.direction for stop in stops])
    pushed = np.linalg.solve(system.mass, directions.T)
    moved = [
        sum(
            ((1j * order * flow.omega) ** 2 * by * np.exp(1j * order * angle)).imag for order, by in stop.motion.items()
        )
        for stop in stops
    ]
    opening = np.array(moved) - directions @ free
    held: Floats = free + pushed @ np.linalg.lstsq(directions @ pushed, opening, rcond=None)[0]
    return held
