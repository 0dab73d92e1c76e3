r"""What a rigid stop takes in each rest, in closed form.

While stops are closed and no compliant one pushes, the motion is linear, and so are the forces of the closed stops:
:math:`X' = A X` and :math:`\lambda = \Lambda X` for the state X of coordinates, velocities and load. An impulse is
:math:`\Lambda \int e^{A s} ds\, X`, exact to rounding from one state, however long it takes. Parts of rests in which a
compliant stop is pressed in are integrated as contacts are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from vibroimpact.backends.effects import SHORT, Rates, Rests, States, angles_of, orders_of, panels_over, parts_of
from vibroimpact.cells import Floats
from vibroimpact.matrices import block_matrix, growth
from vibroimpact.model.balance import clearances, coupling_of, pressing

if TYPE_CHECKING:
    from vibroimpact.model.system import ImpactSystem

NEAR = 1e-6  # driving periods: velocities are extrapolated to the time of an impact from so near
MANY = 256  # parts at once, for the sake of memory
LATER = 1e-3  # rad of the fastest rate: the state after an event is taken so much later


def rest_impulses(system: ImpactSystem, samples: Any, first: float, last: float, states: States) -> Floats:
    """Return the impulse in N s that a stop takes in each rest, between two times in driving periods.

    It contains the shares of impacts on other stops. A rest that ends before the first time has none.
    """
    rests = Rests(samples, last, first)
    impulses, lasting = np.zeros(len(rests.ends)), np.flatnonzero(rests.ends > rests.begins)
    if not len(lasting):
        return impulses
    spans, stops = np.column_stack([rests.begins, rests.ends])[lasting], rests.stops[lasting]
    parts = parts_of(spans, system, samples, rests)
    if system.coordinates == 1:  # a closed stop determines the state

        def states(turns: Floats) -> tuple[Floats, Floats]:
            return _beside(system, rests, turns)

    forces = _taken(system, parts, rests, states)
    rows = np.searchsorted(parts.mean(axis=1), spans)
    impulses[lasting] = [forces[slice(*row), stop].sum() for row, stop in zip(rows.tolist(), stops, strict=True)]
    if system.coordinates > 1:
        impulses += _shares(system, samples, rests, spans, states)
    return impulses


def _shares(system: ImpactSystem, samples: Any, rests: Rests, spans: Floats, states: States) -> Floats:
    """Return the shares of closed stops in impacts on others, one per rest, from the jumps of the velocities."""
    impacts, shares = samples.impact_turns, np.zeros(len(rests.ends))
    times = np.unique(impacts)
    begun, ended = (np.searchsorted(np.sort(ends), times) for ends in (spans[:, 0], spans[:, 1] + SHORT))
    times = times[begun > ended]
    if not len(times):
        return shares
    around = np.clip(times[:, None] + [-NEAR, NEAR], spans[0, 0], np.inf)
    near = np.concatenate([np.column_stack([around[:, 0], times]), np.column_stack([times, around[:, 1]])])
    panels = panels_over(system, parts_of(near, system, samples, rests), rests, states)
    for time in times:
        closed = np.flatnonzero((rests.begins < time) & (time <= rests.ends + SHORT))
        touched = np.unique([*rests.stops[closed], *samples.impact_stop[np.abs(impacts - time) <= SHORT]]).tolist()
        stops = [at for at in touched if system.stops[at].element.instantaneous]
        before, after = (
            panels.velocity(np.abs(panels.ends[:, side] - time).argmin(), end) for side, end in ((1, 1.0), (0, -1.0))
        )
        jumps = [system.stops[at].direction @ (before - after) for at in stops]
        taken = dict(zip(stops, pressing(system, stops, np.array(jumps)), strict=True))
        shares[closed] += [taken[at] for at in rests.stops[closed].tolist()]
    return shares


def _taken(system: ImpactSystem, parts: Floats, rests: Rests, states: States) -> Floats:
    """Return the integrals of the forces of all stops over parts without events, one row each."""
    taken = np.zeros((len(parts), len(system.stops)))
    if not len(parts):
        return taken
    lengths = parts[:, 1] - parts[:, 0]
    turns = parts[:, 0] + np.minimum(0.5 * lengths, LATER / max(Rates(system)[()], LATER))
    q, v = states(turns)
    soft = [not stop.element.instantaneous for stop in system.stops]
    rough = (clearances(system, q, angles_of(turns)) < 0.0)[:, soft].any(axis=1)
    sets, which = np.unique(rests.closed(turns, len(system.stops)), axis=0, return_inverse=True)
    for number, each in enumerate(sets):
        closed, rows = np.flatnonzero(each).tolist(), which.ravel() == number
        if not coupling_of(system, closed)[1]:
            rough |= rows
            continue
        rows &= ~rough
        spans = (parts[rows] - turns[rows, None]) * system.period
        taken[np.ix_(rows, closed)] = _integrals(system, closed, q[rows], v[rows], angles_of(turns[rows]), spans)
    panels = panels_over(system, parts[rough], rests, states)
    for row in np.flatnonzero(rough):
        part = panels.between(*parts[row])
        taken[row] = [part.integral(part.forces[..., at]) for at in range(len(system.stops))]
    return taken


def _integrals(system: ImpactSystem, closed: list[int], q: Floats, v: Floats, angles: Floats, spans: Floats) -> Floats:
    """Return the integrals of the forces of closed stops over spans in s, relative to the times of the states.

    Coordinates are scaled to unit masses, and time by the fastest rate.
    """
    n, orders = system.coordinates, orders_of(system)
    rate = Rates(system)[()] / system.period or 1.0
    factor, turning = np.linalg.cholesky(system.mass), np.diag(system.omega / rate * np.array(orders, float))
    elastic, viscous = (
        np.linalg.solve(factor, np.linalg.solve(factor, matrix).T).T for matrix in (system.stiffness, system.damping)
    )
    still, none = np.zeros(n), np.zeros((len(orders), len(orders)))
    waves = [np.asarray(system.force.harmonics.get(order, still), complex) for order in orders]
    constant = still if system.force.constant is None else system.force.constant
    push = np.column_stack([constant, *(wave.real for wave in waves), *(wave.imag for wave in waves)])
    free = np.hstack([-elastic / rate**2, -viscous / rate, np.linalg.solve(factor, push) / rate**2])
    moves = np.array([[system.stops[at].motion.get(order, 0.0) for order in orders] for at in closed], complex)
    bends = -(np.diag(turning) ** 2) * moves.reshape(len(closed), -1)
    rows = np.linalg.solve(factor, np.array([system.stops[at].direction for at in closed]).T).T
    needed = rows @ free
    needed[:, 2 * n + 1 :] -= np.hstack([bends.real, bends.imag])
    forces = np.linalg.solve(rows @ rows.T, needed)
    law = np.zeros((2 * n + 1 + 2 * len(orders),) * 2)
    law[:n, n : 2 * n], law[n : 2 * n] = np.eye(n), free - rows.T @ forces
    law[2 * n + 1 :, 2 * n + 1 :] = block_matrix(none, turning, -turning, none)
    angle = np.multiply.outer(angles, orders)
    load = np.column_stack([np.ones(len(angles)), np.sin(angle), np.cos(angle)])
    size = float(np.abs(law[: 2 * n, 2 * n :]).max()) or 1.0  # so that the load does not set the norm
    scales = np.append(np.ones(2 * n), np.full(load.shape[1], size))
    law, forces = law / scales * scales[:, None], forces / scales
    x = np.column_stack([q @ factor, v @ factor / rate, size * load])
    integral = block_matrix(law, np.eye(len(law)), np.zeros(law.shape), np.zeros(law.shape))
    impulses = np.empty((len(x), len(closed)))
    for first in range(0, len(x), MANY):
        some = slice(first, first + MANY)
        grown = growth(integral * (rate * spans[some])[..., None, None])[..., : len(law), len(law) :]
        impulses[some] = rate * np.einsum("kn,pnm,pm->pk", forces, grown[:, 1] - grown[:, 0], x[some])
    return impulses


def _beside(system: ImpactSystem, rests: Rests, turns: Floats) -> tuple[Floats, Floats]:
    """Return the states of one coordinate at the stops that are closed at these times."""
    closed, q, v = rests.closed(turns, len(system.stops)), np.zeros((len(turns), 1)), np.zeros((len(turns), 1))
    for at, stop in enumerate(system.stops):
        rows = closed[:, at]
        angles = angles_of(turns[rows])
        q[rows] = ((stop.gap + stop.shift(angles)) / stop.direction)[:, None]
        v[rows] = (stop.speed(angles, system.omega) / stop.direction)[:, None]
    return q, v
