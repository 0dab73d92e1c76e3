"""One motion by the witness, as the list of its events: for tests, and to look at a motion more closely."""

from __future__ import annotations

import math
from typing import Literal

from numpy.typing import ArrayLike

from vibroimpact.backends.reference.events import Event, Moment, Trajectory
from vibroimpact.backends.reference.phases import Equations, LinearSystem
from vibroimpact.backends.reference.walk import EVENTS, Walk

__all__ = ["Event", "LinearSystem", "Moment", "Trajectory", "follow"]


def follow(
    system: LinearSystem,
    displacement: ArrayLike,
    velocity: ArrayLike,
    time: float = 0.0,
    *,
    impacts: int = 20,
    most_periods: float = 1000.0,
    cut: float | None = None,
) -> Trajectory:
    """Follow a system from a state for a number of impacts or driving periods, whichever ends first.

    Parameters
    ----------
    system : LinearSystem
        Matrices, forces and stops.
    displacement, velocity : array, shape (n,)
        The state at `time`, not beyond any rigid stop.
    time : float
        In s.
    impacts : int
        Number of impacts to record; contacts with compliant stops are followed to their end.
    most_periods : float
        Largest number of driving periods.
    cut : float, optional
        Impacts slower than this, in m/s, are not recorded; a chatter below it that certainly completes is replaced by
        its end. None means 1e-10 of the fastest impact so far.

    Returns
    -------
    Trajectory
        The events in order; its method `at` returns states at any time.

    Raises
    ------
    ValueError
        The state lies beyond a rigid stop, or a mass is squeezed between rigid stops.

    Notes
    -----
    The motion is exact up to rounding and its growth. Two events of one stop are resolved down to a tenth of a radian
    of the fastest rate. An impact takes a few milliseconds.

    Examples
    --------
    >>> import numpy as np
    >>> from vibroimpact.backends.reference.stops import RigidStop
    >>> ball = LinearSystem(np.eye(1), np.zeros((1, 1)), np.zeros((1, 1)), 1.0, np.array([2.0]), {},
    ...                     (RigidStop(np.array([1.0]), 0.0, 0.5),))
    >>> motion = follow(ball, [-1.0], [0.0], impacts=3)
    >>> [round(event.velocity, 12) for event in motion.events]
    [2.0, 1.0, 0.5]
    """
    eq = Equations(system)
    turns = time / eq.period
    start = Moment.of(eq, math.floor(turns), turns - math.floor(turns), displacement, velocity)
    walk = Walk(eq, start, cut)
    last = walk.turns + most_periods
    ended: Literal["impacts", "time", "events"] = "events"
    for _ in range(EVENTS * (impacts + 1)):
        walk.meet()
        walk.full = walk.recorded >= impacts
        if walk.full and not walk.in_contact:
            ended = "impacts"
            break
        if walk.turns >= last:
            ended = "time"
            break
        walk.move((last - walk.turns) * walk.eq.period)
    return Trajectory(tuple(walk.events), walk.at, walk.closed, walk.pushing, ended, tuple(walk.pieces))
