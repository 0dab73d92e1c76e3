"""The motion along an orbit at given times: flight by flight in closed form, or by the engine if it rests at a stop."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from vibroimpact.backends import StroboscopicWindow
from vibroimpact.backends.modal.carry import Carrier
from vibroimpact.cells import Floats
from vibroimpact.model.balance import accelerations, stop_forces
from vibroimpact.options import Tolerances
from vibroimpact.orbits.cycle import cycle_of
from vibroimpact.orbits.equations import SAME
from vibroimpact.sections import Followed


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
    carrier = Carrier(system.cells({}), Tolerances())
    first, done = orbit.start.time / period, 0.0
    later = (times / period - first) % orbit.n_periods
    x = carrier.state(*(np.atleast_1d(part) for part in (orbit.start.displacement, orbit.start.velocity)))
    kinematics = np.empty((3, len(times), system.coordinates))
    for row in np.argsort(later, kind="stable"):
        if later[row] > done:
            x, _ = carrier.over(x, (first + done) % 1.0, later[row] - done)
            done = later[row]
        place, speed = carrier.coordinates(x)
        kinematics[:, row] = place, speed, _acceleration(orbit, place, speed, first + done)
    return kinematics


def _acceleration(orbit: Any, q: Floats, v: Floats, turn: float) -> Floats:
    """Return accelerations, in a rest under the forces of the closed stops."""
    system, angle = orbit.system, np.array(2.0 * np.pi * turn)
    closed = [stop for stop, begin, end in orbit.rests if (turn - begin) % orbit.n_periods < end - begin]
    forces = stop_forces(system, q, v, angle, sorted({system.stop_names.index(name) for name in closed}))
    return accelerations(system, q, v, angle, forces)


def rest_impulses_of(orbit: Any) -> tuple[float, ...]:
    """Return the impulse of each rest of an orbit in N s, from the motion over two cycles."""
    run, n = Followed(orbit.system, orbit.start, "cpu", None, None), orbit.n_periods
    impulses: list[float] = []
    for stop, begin, end in orbit.rests:
        window = StroboscopicWindow(0, n + 1 if end - begin >= n else 2 * n + 1)
        samples = run.samples(window)
        later = np.abs((samples.rest_begin.sum(axis=1) - begin + 0.5 * n) % n - 0.5 * n)
        later[samples.rest_stop != orbit.system.stop_names.index(stop)] = np.inf
        first = int(np.argmax(later <= later.min() + SAME))  # the next one may not be over
        impulses.append(float(run.rest_impulses(samples, window, skips=False)[first]))
    return tuple(impulses)
