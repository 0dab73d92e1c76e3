"""Symmetry of systems: whether the mirror image, q -> -q, half a driving period later obeys the same equations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vibroimpact.model.stops import Stop
from vibroimpact.model.system import ImpactSystem

EQUAL = 1e-12  # relative: numbers nearer than this are equal


def mirror(system: ImpactSystem) -> tuple[tuple[int, ...], str]:
    """Return the mirror image of each stop, and the reason why the system is not symmetric (empty if it is).

    The load must have odd harmonics only and no constant. Stops must face each other in pairs with equal gaps and
    restitutions, or stiffness and damping, and their own motions must be mirror images half a period apart.

    Examples
    --------
    >>> from vibroimpact.model.system import ImpactSystem
    >>> from vibroimpact.model.force import Force
    >>> stops = [Stop(direction=1, gap=0.5), Stop(direction=-1, gap=0.5)]
    >>> mirror(ImpactSystem(mass=1.0, stiffness=1.0, force=Force(omega=2.0, harmonics={1: 1.0}), stops=stops))
    ((1, 0), '')
    >>> mirror(ImpactSystem(mass=1.0, stiffness=1.0, force=Force(omega=2.0, constant=1.0), stops=stops))
    ((), 'not symmetric: the load has a constant part')
    """
    force, stops = system.force, system.stops
    if force.constant is not None and np.any(force.constant):
        return (), "not symmetric: the load has a constant part"
    for order, load in force.harmonics.items():
        if order % 2 == 0 and np.any(load):
            return (), f"not symmetric: the load has the even harmonic {order}"
    images = []
    for stop in stops:
        facing = [at for at, other in enumerate(stops) if _is_image(stop, other) and at not in images]
        if not facing:
            return (), f"not symmetric: no stop is the mirror image of {stop.name!r}"
        images.append(facing[0])
    return tuple(images), ""


def images_along(model: Any, names: Sequence[str], ranges: Sequence[tuple[float, float]]) -> tuple[int, ...]:
    """Return the mirror image of each stop, if no parameter alone breaks a model's symmetry."""
    images = mirror(model.at())[0]
    for name, (low, high) in zip(names, ranges, strict=True):
        for share in (0.0, 0.31, 1.0) if images else ():
            try:
                moved = mirror(model.at(**{name: low + share * (high - low)}))[0]
            except ValueError:  # the model does not exist at this value
                continue
            if moved != images:
                return ()
    return images


def _is_image(stop: Stop, other: Stop) -> bool:
    """Return whether a stop is the mirror image of another half a period later; directions may differ in length."""
    ratio = np.abs(stop.direction).max() / np.abs(other.direction).max()
    near = EQUAL * np.abs(stop.direction).max()
    reach = abs(stop.gap) + sum(map(abs, stop.motion.values()))
    motions = [
        stop.motion.get(order, 0.0) * (-1) ** order - ratio * other.motion.get(order, 0.0)
        for order in {*stop.motion, *other.motion}
    ]
    return bool(
        stop.element.acts_as(other.element, ratio, EQUAL)
        and (np.abs(stop.direction + ratio * other.direction) <= near).all()
        and max(map(abs, [stop.gap - ratio * other.gap, *motions])) <= EQUAL * reach
    )
