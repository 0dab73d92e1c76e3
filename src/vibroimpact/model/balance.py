"""The forces of stops and the accelerations in given states of a system, from the balance of forces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from vibroimpact.cells import BEYOND, Floats

if TYPE_CHECKING:
    from vibroimpact.model.stops import Stop
    from vibroimpact.model.system import ImpactSystem


def clearances(system: ImpactSystem, q: Floats, angle: Floats) -> Floats:
    """Return the clearances of all stops; a penetration of rounding size is contact.

    `q` has one row of coordinates per driving angle.
    """
    u = np.empty((*np.shape(angle), len(system.stops)))
    for at, stop in enumerate(system.stops):
        u[..., at] = stop.gap + stop.shift(angle) - q @ stop.direction
    rounding = BEYOND * np.abs(q).max(initial=1e-300)
    return np.where((u < 0.0) & (u > -rounding), 0.0, u)


def depth_of(stop: Stop, omega: float, q: Floats, v: Floats, angle: Floats) -> tuple[Floats, Floats]:
    """Return the penetration of a stop in m in states q, v at driving angles, and its rate in m/s."""
    return q @ stop.direction - stop.gap - stop.shift(angle), v @ stop.direction - stop.speed(angle, omega)


def law_of(stop: Stop, depth: Floats, rate: Floats) -> Floats:
    """Return k d + c d' of a compliant stop in N: its force while that is above zero."""
    k, c = stop.element.coefficients
    return k * depth + c * rate


def accelerations(system: ImpactSystem, q: Floats, v: Floats, angle: Floats, forces: Floats) -> Floats:
    """Return the accelerations in states q, v at driving angles, under given forces of the stops."""
    push = system.force.at(angle, system.coordinates) - q @ system.stiffness.T - v @ system.damping.T
    for stop, force in zip(system.stops, np.moveaxis(forces, -1, 0), strict=True):
        push = push - force[..., None] * stop.direction
    solved: Floats = np.linalg.solve(system.mass, push[..., None])[..., 0]
    return solved


def stop_forces(system: ImpactSystem, q: Floats, v: Floats, angle: Floats, closed: Sequence[int] = ()) -> Floats:
    r"""Return the forces of all stops in N in states q, v at driving angles, one column per stop.

    Compliant stops push by their law. Rigid ones push while they are `closed`: with their directions a, their
    accelerations :math:`\ddot s` along these, and the acceleration :math:`\ddot q_0` under all other forces,

    .. math:: \lambda = (a M^{-1} a^T)^{-1} (a \ddot q_0 - \ddot s)

    If more stops are closed than their directions allow to tell apart, a distribution without pulling forces is taken.
    """
    forces = np.zeros((*np.shape(angle), len(system.stops)))
    depths = -clearances(system, q, angle)
    for at, stop in enumerate(system.stops):
        if not stop.element.instantaneous:
            rate = v @ stop.direction - stop.speed(angle, system.omega)
            forces[..., at] = stop.element.force(depths[..., at], rate)
    held = list(closed)
    if held:
        rows = np.array([system.stops[at].direction for at in held])
        moved = [np.broadcast_to(system.stops[at].acceleration(angle, system.omega), np.shape(angle)) for at in held]
        needed = accelerations(system, q, v, angle, forces) @ rows.T - np.stack(moved, axis=-1)
        forces[..., held] = np.maximum(pressing(system, held, needed), 0.0)
    return forces


def coupling_of(system: ImpactSystem, stops: Sequence[int]) -> tuple[Floats, bool]:
    """Return a M^-1 a^T of some stops, and whether it is regular, so that it determines their forces."""
    rows = np.array([system.stops[at].direction for at in stops])
    coupling: Floats = rows @ np.linalg.solve(system.mass, rows.T)
    return coupling, np.linalg.matrix_rank(coupling, hermitian=True) == len(rows)


def pressing(system: ImpactSystem, stops: Sequence[int], needed: Floats) -> Any:
    """Return forces or impulses that change the rates along some stops' directions as needed, one row each."""
    coupling, regular = coupling_of(system, stops)
    if regular:
        return np.linalg.solve(coupling, needed[..., None])[..., 0]
    from scipy.optimize import nnls

    flat = [nnls(coupling, each)[0] for each in needed.reshape(-1, len(coupling))]
    return np.reshape(flat, needed.shape)
