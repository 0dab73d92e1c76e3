"""Systems in their own coordinates, flown by SciPy's exponential, and their orbits by brute force and differences."""

import math

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from differences import derivative
from systems import linear
from witness import follow


class Plain:
    """A system in its own coordinates, flown by SciPy's exponential: nothing is shared with the package's equations."""

    def __init__(self, system):
        self.system, n = system, len(system.mass)
        inverse = np.linalg.inv(system.mass)
        self.free = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ system.stiffness, -inverse @ system.damping]])
        orders = sorted(system.force.harmonics)
        constant = np.zeros(n) if system.force.constant is None else system.force.constant
        loads, turns = [constant], [np.zeros((1, 1))]
        for h in orders:
            loads += [system.force.harmonics[h].real, system.force.harmonics[h].imag]
            turns.append(h * system.omega * np.array([[0.0, 1.0], [-1.0, 0.0]]))
        size = 1 + 2 * len(orders)
        self.whole = np.zeros((2 * n + size, 2 * n + size))
        self.whole[: 2 * n, : 2 * n] = self.free
        self.whole[n : 2 * n, 2 * n :] = inverse @ np.array(loads).T
        at = 2 * n
        for turn in turns:
            self.whole[at : at + len(turn), at : at + len(turn)] = turn
            at += len(turn)
        self.orders, self.n, self.inverse = orders, n, inverse

    def fly(self, x, begin, end):
        drive = [1.0]
        for h in self.orders:
            drive += [math.sin(h * self.system.omega * begin), math.cos(h * self.system.omega * begin)]
        return (expm(self.whole * (end - begin)) @ np.append(x, drive))[: 2 * self.n]

    def wall(self, stop, time, order=0):
        """Return the contact value of a . q, or its rate."""
        factors = {h: by * (1j * h * self.system.omega) ** order for h, by in stop.motion.items()}
        moved = sum((by * np.exp(1j * h * self.system.omega * time)).imag for h, by in factors.items())
        return moved + (stop.gap if order == 0 else 0.0)

    def clearance(self, stop, x, time):
        return self.wall(stop, time) - stop.direction @ x[: self.n]

    def speed(self, stop, x, time):
        return stop.direction @ x[self.n :] - self.wall(stop, time, 1)

    def hit(self, stop, x, time):
        kappa = self.inverse @ stop.direction
        kappa /= stop.direction @ kappa
        return x - np.append(np.zeros(self.n), (1.0 + stop.restitution) * self.speed(stop, x, time) * kappa)

    def replayed(self, orbit):
        """Return the largest miss of an orbit's contacts and velocities, and of its return, over their sizes."""
        stops = {stop.name: stop for stop in self.system.stops}
        times = [turn * self.system.period for turn in orbit.turns]
        x = start = np.append(orbit.start.displacement, orbit.start.velocity)
        size, misses = np.abs(start).max(), []
        for i, name in enumerate(orbit.stops):
            misses.append(self.clearance(stops[name], x, times[i]) / size)
            misses.append((self.speed(stops[name], x, times[i]) - orbit.velocities[i]) / orbit.velocities[i])
            end = times[i + 1] if i + 1 < len(times) else times[0] + orbit.period
            x = self.fly(self.hit(stops[name], x, times[i]), times[i], end)
        return max(np.abs(misses).max(), np.abs(x - start).max() / size)


def by_brute_force(system, stop, n_periods, mirrored=False, points=4000):
    """Return phases and velocities > 0 from steady state and flow over the cycle, roots by a scan of the phase."""
    plain, n, w = Plain(system), len(system.mass), system.omega
    half = 0.5 if mirrored else 1.0
    flow, one = expm(plain.free * system.period * n_periods * half), np.eye(2 * n)
    kappa = plain.inverse @ stop.direction
    kick = np.append(np.zeros(n), (1.0 + stop.restitution) * kappa / (stop.direction @ kappa))
    deviation = np.linalg.solve((-one if mirrored else one) - flow, -flow @ kick)
    reach, speed = stop.direction @ deviation[:n], 1.0 - stop.direction @ deviation[n:]
    steady = {
        h: stop.direction
        @ np.linalg.solve(system.stiffness + 1j * h * w * system.damping - (h * w) ** 2 * system.mass, p)
        for h, p in system.force.harmonics.items()
    }
    constant = np.zeros(n) if system.force.constant is None else system.force.constant
    level = stop.direction @ np.linalg.solve(system.stiffness, constant)

    def of(phase):
        turn = 2j * np.pi * phase
        moved = sum((c * np.exp(h * turn)).imag for h, c in steady.items())
        rate = sum((1j * h * w * c * np.exp(h * turn)).imag for h, c in steady.items())
        time = phase * system.period
        return plain.wall(stop, time) - level - moved, rate - plain.wall(stop, time, 1)

    def miss(phase):
        clearance, rate = of(phase)
        return clearance * speed - rate * reach

    phases = np.arange(points + 1) / points
    values, found = miss(phases), []
    for i in np.flatnonzero(np.diff(np.sign(values))):
        phase = brentq(miss, phases[i], phases[i + 1], xtol=1e-16)
        velocity = of(phase)[1] / speed
        if velocity > 0.0:
            found.append((phase, velocity))
    return sorted(found)


def differences(system, orbit, step=1e-6):
    """Return the Jacobian of the motion over a cycle, from before its first impact, by differences of plain flights."""
    plain, stops = Plain(system), {stop.name: stop for stop in system.stops}
    times = [turn * system.period for turn in orbit.turns]
    flights = np.diff([*times, times[0] + orbit.period])
    early = 0.02 * flights.min()
    begin = times[0] - early
    start = plain.fly(np.append(orbit.start.displacement, orbit.start.velocity), times[0], begin)

    def after(x):
        now = begin
        for name, time in zip(orbit.stops, times, strict=True):

            def gap(at, x=x, now=now, stop=stops[name]):
                return plain.clearance(stop, plain.fly(x, now, at), at)

            hit = brentq(gap, time - 0.5 * early, time + 0.5 * early, xtol=1e-15)
            x, now = plain.hit(stops[name], plain.fly(x, now, hit), hit), hit
        return plain.fly(x, now, begin + orbit.period)

    return derivative(after, start, step * np.abs(start).max())


def witnessed(system, start, impacts):
    """Return the impacts that the plain witness sees from a start."""
    return follow(linear(system), start.displacement, start.velocity, start.time, impacts=impacts).impacts
