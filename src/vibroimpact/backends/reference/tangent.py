"""How small deviations of a motion grow: through flights, impacts, contacts and rests.

In a phase X' = A X a deviation is carried by exp(A t). An event happens where h . X = 0, with h a row of the phase; a
neighbour reaches it later by dt = -(h . dX)/(h . X'). If the event takes X to J(X), then

    dX+ = D (dX- + X'- dt) - X'+ dt,    D = dJ/dX,

(the saltation of M. A. Aizerman and F. R. Gantmakher, J. Appl. Math. Mech. 22 (1958) 1065). Impulses dP of a set of
stops with the mobility G change velocities by -kappa dP and the clearances' rates by G dP, with G dP = -(1 + d(r v)/dv)
du' over the set; a stop that closes acts as one of r = 0, and takes what would move its clearance.
"""

from __future__ import annotations

import math

import numpy as np

from vibroimpact.backends.reference.phases import BLOCK, Phase, Which, exponential
from vibroimpact.backends.reference.stops import Floats
from vibroimpact.backends.reference.walk import Walk, solved


class Tangent:
    """Deviations along every eta and eta', in columns, since the last time that they began."""

    def __init__(self, walk: Walk) -> None:
        eq = self.eq = walk.eq
        unit = np.eye(2 * eq.n)
        clearances = np.kron(np.eye(2), -eq.directions) @ unit
        self.begin = np.vstack([unit, clearances, np.zeros((1 + 2 * len(eq.orders), 2 * eq.n))])
        self.columns = self.begin

    def restart(self, walk: Walk) -> None:
        """Begin with all deviations that closed stops allow."""
        self.columns = self._confined(self.begin, walk.closed)

    @property
    def matrix(self) -> Floats:
        """The deviations of eta and eta' now, one column for each of them at the beginning."""
        matrix: Floats = self.columns[: 2 * self.eq.n]
        return matrix

    def fly(self, phase: Phase, time: float) -> None:
        """Carry the deviations over a time in a phase."""
        whole = time == BLOCK * phase.stride
        self.columns = (
            phase.block[-1] if whole else exponential(phase.matrix, time, time / phase.stride)
        ) @ self.columns

    def cross(self, walk: Walk) -> None:
        """Carry the deviations over the event that the walk has just resolved."""
        flight, columns = walk.flight, self.columns
        if flight is None or flight.event is None:
            return
        after = self.eq.phase(walk.held, walk.pushing)
        for stops, factors in walk.jumps:
            columns = self._impulses(columns, stops, factors)
        if walk.jumps or after is not flight.phase:
            rate = flight.phase.matrix @ flight.end
            landed = rate
            for stops, factors in walk.jumps:
                landed = self._impulses(landed[:, None], stops, factors)[:, 0]
            left, slope = after.matrix @ walk.vector(), float(flight.event @ rate)
            if slope != 0.0:
                columns = columns + np.outer(left - landed, flight.event @ self.columns) / slope
        self.columns = self._confined(columns, walk.closed)

    def _impulses(self, columns: Floats, stops: Which, factors: Floats) -> Floats:
        n, s, eq = self.eq.n, self.eq.s, self.eq
        rates, columns = columns[2 * n + s : 2 * n + 2 * s], columns.copy()
        impulses = solved(eq.coupling[np.ix_(stops, stops)], -factors[:, None] * rates[stops])
        columns[n : 2 * n] -= eq.kappa[:, stops] @ impulses
        columns[2 * n + s : 2 * n + 2 * s] += eq.coupling[:, stops] @ impulses
        return columns

    def _confined(self, columns: Floats, closed: tuple[int, ...]) -> Floats:
        """Return the deviations without what moves the clearances of closed stops, along M^-1 a."""
        n, s, eq, index = self.eq.n, self.eq.s, self.eq, list(closed)
        if not index:
            return columns
        columns = columns.copy()
        for first, u in ((0, 2 * n), (n, 2 * n + s)):
            moved = solved(eq.coupling[np.ix_(index, index)], columns[u : u + s][index])
            columns[first : first + n] += eq.kappa[:, index] @ moved
            columns[u : u + s] -= eq.coupling[:, index] @ moved
        return columns


def product(matrices: list[Floats]) -> tuple[float, Floats]:
    """Return ln of the spectral radius of a product of matrices, the first one applied first, and the product."""
    total, size = np.eye(len(matrices[0])), 0.0
    for matrix in matrices:
        total = matrix @ total
        largest = float(np.abs(total).max())
        if largest == 0.0:
            return -math.inf, total
        total, size = total / largest, size + math.log(largest)
    radius = float(np.abs(np.linalg.eigvals(total)).max())
    return size + math.log(radius) if radius > 0.0 else -math.inf, math.exp(min(size, 700.0)) * total
