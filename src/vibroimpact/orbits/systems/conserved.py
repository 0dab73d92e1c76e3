r"""The orbits of systems without load and without loss: families in energy, each born from a mode (nonlinear modes).

Such a system conserves its energy, and the motion does not depend on the time at which it begins. The period Theta of
an orbit is therefore unknown, two of its multipliers are 1, and orbits are not isolated: with the Jacobian M of the
cycle, the rate x' and the gradient g of the energy E at the first event,

    M x' = x',    g . M = g.

The equations of `Cycle` are completed by the phase, theta_1 = 0, and the energy: the component of the closure along g
follows from the others and is replaced by E(x_1) = E. The unknowns theta_1 ... theta_p, x_1, Theta and E then describe
a curve, which is followed along its tangent (pseudo-arclength). The other multipliers are the eigenvalues of B^T M B,
with an orthonormal basis B of the directions normal to x' and g.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.model.system import ImpactSystem
from vibroimpact.orbits.cycle import Cycle, cycle_of, multipliers_of
from vibroimpact.orbits.equations import TURN
from vibroimpact.orbits.flow import Flow
from vibroimpact.orbits.orbit import Orbit
from vibroimpact.orbits.symmetry import mirror
from vibroimpact.orbits.systems.orbit import make_orbit

CORRECTIONS = 10  # per orbit, at most
CLOSE = 1e-10  # relative correction after which Newton's method has converged to rounding
NONE: Floats = np.zeros(0)
ROUGH = 1e-7  # the same for corrections that no longer become smaller, near grazes and where families meet


@dataclass(frozen=True, eq=False)
class FreeCycle(Cycle):
    """A cycle of unknown period: `span` is the driving angle of the whole cycle."""

    span: float = TURN

    @property
    def length(self) -> float:
        """Driving angle of the cycle, or of half of it."""
        return self.span * (0.5 if self.images else 1.0)

    def reduced(self, unknown: Floats) -> Floats:
        """Return the Jacobian of the cycle in the directions normal to its rate and to the gradient of its energy."""
        x, keep = unknown[len(self.events) :], ~self.flow.neutral
        rate, gradient = self.flow.rate(x, self.flow.drive(0.0), self.pushing), self.flow.energy(x, self.pushing)[1]
        rate, gradient = rate[keep], gradient[keep]
        both = np.column_stack([rate / np.linalg.norm(rate), gradient / np.linalg.norm(gradient)])
        normal = np.linalg.qr(both, mode="complete")[0][:, 2:]
        jacobian: Floats = normal.T @ self.monodromy(unknown) @ normal
        return jacobian

    def multipliers(self, unknown: Floats) -> tuple[complex, ...]:
        """Return the multipliers of the cycle, or of half of it: two are 1."""
        others = multipliers_of(self.reduced(unknown))
        return tuple(sorted([*others, 1 + 0j, 1 + 0j], key=lambda value: (-abs(value), -value.imag)))


@dataclass(frozen=True)
class Member:
    """One orbit of a family: its cycle, with z = (angles, state, Theta, E), and the tangent of the curve there.

    The energy is that of `Flow.energy`. Lengths along the curve are relative to the size of each unknown.
    """

    cycle: FreeCycle
    z: Floats
    tangent: Floats

    @property
    def unknown(self) -> Floats:
        """Angles of the events and state before the first."""
        return self.z[:-2]

    @property
    def at(self) -> FreeCycle:
        """The cycle with the period of this orbit."""
        return replace(self.cycle, span=float(self.z[-2]))

    @property
    def joules(self) -> float:
        """The energy in J."""
        return float(self.z[-1]) * self.cycle.flow.omega**2

    @cached_property
    def others(self) -> tuple[complex, ...]:
        """The multipliers, or those of half a cycle, other than the two that are 1."""
        return multipliers_of(self.at.reduced(self.unknown))

    @cached_property
    def tests(self) -> dict[str, float]:
        """Test functions that change sign: the energy turns, or a pair of multipliers meets at -1."""
        doubling = "pitchfork" if self.cycle.images else "period_doubling"
        return {"fold": float(self.tangent[-1]), doubling: _side(self.others)}

    def orbit(self, system: ImpactSystem) -> Orbit:
        """Return the orbit, whose system has its frequency."""
        slow, p, shrink = self.cycle.flow, len(self.cycle.events), TURN / float(self.z[-2])
        slowed = system.replace(omega=shrink * slow.omega)
        flow = Flow(slowed)
        state = np.linalg.solve(flow.physical, slow.physical @ self.z[p:-2])
        cycle = FreeCycle(flow, 1, self.cycle.events, self.cycle.images, self.cycle.pushing)
        return make_orbit(slowed, cycle, np.append(shrink * self.z[:p], state))


def _side(others: tuple[complex, ...]) -> float:
    """Return the product of 1 + mu, scaled to at most 1 in size; 1 if there are no other multipliers."""
    if not np.isfinite(others).all():
        return 1.0
    return float(np.prod([(1.0 + value) / (1.0 + abs(value)) for value in others]).real)


def misses(cycle: FreeCycle, z: Floats) -> tuple[Floats, Floats]:
    """Return the residuals of z = (angles, state, Theta, E), and their derivative."""
    cycle, unknown, p = replace(cycle, span=float(z[-2])), z[:-2], len(cycle.events)
    energy, gradient = cycle.flow.energy(unknown[p:], cycle.pushing)
    size = float(np.linalg.norm(gradient))
    along, matrix = gradient / size, np.zeros((len(z) - 1, len(z)))
    residuals = np.append(cycle.misses(unknown), unknown[0])
    matrix[:-1, :-2] = cycle.derivative(unknown)
    rate = cycle.flow.rate(cycle.states(unknown)[-1], cycle.flow.drive(0.0), cycle.phases[-1])
    matrix[p:-1, -2] = cycle.pinned(rate[:, None], np.zeros((len(rate), 1)))[:, 0] * (cycle.length / cycle.span)
    for part in (residuals, matrix):
        part[p:-1] -= np.tensordot(along, along @ part[p:-1], 0)
    residuals[p:-1] += along * (energy - z[-1]) / size
    matrix[p:-1, p:-2] += np.outer(along, along)
    matrix[p:-1, -1] -= along / size
    matrix[-1, 0] = 1.0
    return residuals, matrix


def sizes(cycle: FreeCycle, z: Floats) -> Floats:
    """Return the size of each unknown."""
    p, largest = len(cycle.events), float(np.abs(z[len(cycle.events) : -2]).max())
    return np.concatenate([np.full(p, z[-2] / TURN), np.full(len(z) - p - 2, largest), z[-2:]])


class Corrected(NamedTuple):
    """A solution of the equations of a cycle, the number of corrections, and the Jacobian before the last."""

    z: Floats
    number: int
    matrix: Floats
    cycle: FreeCycle

    def member(self, along: Floats) -> Member:
        """Return the solution with its tangent in the direction of `along`."""
        return member(self.cycle, self.z, along, self.matrix)


def corrected(
    cycle: FreeCycle, z: Floats, row: Floats, target: float | None = None, kept: Floats = NONE
) -> Corrected | None:
    """Return the solution near z with row . z as given (or its own).

    The linear forms `kept` are 0 in it. None if Newton's method does not converge.
    """
    aim: Any = row @ z if target is None else target
    before = math.inf
    for number in range(1, CORRECTIONS + 1):
        after = correction(cycle, z, row, aim, kept)
        if after is None:
            return None
        z, largest, matrix = after
        if largest < CLOSE or 0.5 * before < largest < ROUGH:
            return Corrected(z, number, matrix, cycle)
        before = largest
    return None


def correction(
    cycle: FreeCycle, z: Floats, row: Floats, target: float, kept: Floats = NONE
) -> tuple[Floats, float, Floats] | None:
    """Return z after one correction, which is how large relative to the size of each unknown, and the Jacobian before.

    None if it leads too far.
    """
    columns, p = sizes(cycle, z), len(cycle.events)
    residuals, matrix = misses(cycle, z)
    if kept.size:
        residuals, matrix = np.append(residuals, kept @ z), np.vstack([matrix, kept])
    whole = np.vstack([matrix, row]) * columns
    rows = np.abs(whole).max(axis=1)
    if not (np.isfinite(whole).all() and rows.all()):
        return None
    try:
        scaled, right = whole / rows[:, None], np.append(residuals, row @ z - target) / rows
        change = np.linalg.lstsq(scaled, right)[0] if kept.size else np.linalg.solve(scaled, right)
    except np.linalg.LinAlgError:
        return None
    z, largest = z - columns * change, float(np.abs(change).max())
    if not largest < 1.0 or z[-2] <= 0.0 or z[-1] <= 0.0 or (np.diff(z[:p]) < -z[-2]).any():
        return None
    return z, largest, matrix


def member(cycle: FreeCycle, z: Floats, along: Floats, matrix: Floats | None = None) -> Member:
    """Return a solution with its tangent in the direction of `along`, from the Jacobian there or near by."""
    columns = sizes(cycle, z)
    tangent = np.linalg.svd((misses(cycle, z)[1] if matrix is None else matrix) * columns)[2][-1]
    return Member(cycle, z, tangent * (1.0 if tangent @ (along / columns) >= 0.0 else -1.0))


def member_of(orbit: Orbit) -> Member:
    """Return an orbit as a member of its family; a symmetric one as half a cycle."""
    whole, unknown = cycle_of(orbit)
    images = mirror(orbit.system)[0] if orbit.symmetric else ()
    p = len(whole.events) // (2 if images else 1)
    span = TURN * orbit.n_periods
    cycle = FreeCycle(whole.flow, 1, whole.events[:p], images, whole.pushing, span)
    state = unknown[len(whole.events) :]
    z = np.concatenate([unknown[:p] - unknown[0], state, [span, cycle.flow.energy(state, whole.pushing)[0]]])
    return member(cycle, z, np.eye(len(z))[-1])
