"""Motions through stops by SciPy's DOP853 with events: an integration that shares no code with the package."""

import numpy as np
from scipy.integrate import solve_ivp


class Compliant:
    """A compliant stop: pushes from zero clearance until its force, or with `pulls` its penetration, is zero."""

    def __init__(self, direction, gap, stiffness, damping=0.0, moves=lambda t: 0.0, pulls=False):
        self.a, self.gap, self.k, self.c, self.moves, self.pulls = direction, gap, stiffness, damping, moves, pulls
        self.closed = self.loose = False

    def depth(self, t, q):
        return self.a @ q - self.gap - self.moves(t)

    def force(self, t, q, v):
        return self.k * self.depth(t, q) + self.c * (self.a @ v)

    def pushes(self, t, q, v):
        return self.force(t, q, v) if self.closed else 0.0

    def watched(self, t, q, v):
        """Return what falls through zero at the next change."""
        if self.closed and not self.pulls:
            return self.force(t, q, v)
        return self.depth(t, q) if self.closed or self.loose else -self.depth(t, q)

    def closes_again(self, t, q, v):
        """Return what falls through zero where a stop that was let loose pushes again."""
        return -self.force(t, q, v) if self.loose else 1.0

    def change(self, t, q, v):
        """Close, let loose while there is penetration, or open; return the velocities after it."""
        deep = self.depth(t, q) > 1e-12
        self.closed, self.loose = not self.closed and (deep or not self.loose), self.closed and deep
        return v


class Rigid(Compliant):
    """A rigid stop that turns the speed along its direction."""

    def __init__(self, direction, gap, restitution, mass):
        super().__init__(direction, gap, 0.0)
        self.r, self.row = restitution, np.linalg.solve(mass, direction)
        self.speeds, self.times = [], []

    def change(self, t, q, v):
        speed = self.a @ v
        self.speeds.append(speed)
        self.times.append(t)
        return v - (1.0 + self.r) * speed / (self.a @ self.row) * self.row


def march(stops, q, v, until, *, mass, damping, stiffness, load, step=np.inf, instants=(), begin=0.0, closed=()):
    """Return the last state, and states and pushes of all stops at instants, by DOP853 from event to event.

    The stops numbered in `closed` push at the beginning, and so do those that are touched and approached.
    """
    n, inverse = len(q), np.linalg.inv(mass)
    y, t, found = np.concatenate([q, v]), begin, []
    for at, stop in enumerate(stops):
        stop.closed = at in closed or (abs(stop.depth(t, y[:n])) < 1e-15 and stop.a @ y[n:] > 0.0)
        stop.loose = False

    def rate(t, y):
        push = load(t) - damping @ y[n:] - stiffness @ y[:n]
        for stop in stops:
            if stop.closed:
                push = push - stop.pushes(t, y[:n], y[n:]) * stop.a
        return np.concatenate([y[n:], inverse @ push])

    def event(watched):
        falls = lambda t, y: watched(t, y[:n], y[n:])  # noqa: E731
        falls.terminal, falls.direction = True, -1.0
        return falls

    events = [event(watched) for stop in stops for watched in (stop.watched, stop.closes_again)]
    while t < until:
        run = solve_ivp(
            rate, (t, until), y, "DOP853", rtol=1e-12, atol=1e-15, events=events, max_step=step,
            dense_output=len(instants) > 0,
        )  # fmt: skip
        for at in [at for at in instants if t <= at < run.t[-1] or at == until == run.t[-1]]:
            state = run.sol(at)
            found.append([state, [stop.pushes(at, state[:n], state[n:]) for stop in stops]])
        t, y = run.t[-1], run.y[:, -1].copy()
        for at, stop in enumerate(stops):
            together = abs(stop.watched(t, y[:n], y[n:])) < 1e-12 and t < until
            if len(run.t_events[2 * at]) or len(run.t_events[2 * at + 1]) or together:
                y[n:] = stop.change(t, y[:n], y[n:])
    return y, found


def later(system, state, begin, duration, closed=()):
    """Return the state of a system some time later; the stops numbered in `closed` push at the beginning."""
    load, omega = system.force, system.force.omega
    constant = np.zeros(len(system.mass)) if load.constant is None else load.constant
    stops = [
        Compliant(stop.direction, stop.gap, stop.stiffness, stop.damping)
        if stop.compliant
        else Rigid(stop.direction, stop.gap, stop.restitution, system.mass)
        for stop in system.stops
    ]
    return march(
        stops, *np.split(np.asarray(state), 2), begin + duration, begin=begin, closed=closed,
        load=lambda t: constant + sum(np.imag(p * np.exp(1j * h * omega * t)) for h, p in load.harmonics.items()),
        mass=system.mass, damping=system.damping, stiffness=system.stiffness, step=duration / 200.0,
    )[0]  # fmt: skip
