"""The kinds of motion, how a kind is decided, and its name and sentence."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vibroimpact.status import Status

Floats = NDArray[np.float64]

# The one threshold of chaos: ln of the growth that carries the last binary digit of a double to the motion's own size.
CERTAIN_GROWTH = 53 * math.log(2.0)


class MotionClass(IntEnum):
    """The kind of a motion.

    `classify` stores 0 to 4 in files; these numbers never change. The others refine 1 (no impact) and 0 (undecided)
    where the status is known; `stored` leads back.
    """

    UNDECIDED = 0
    NO_IMPACT = 1
    PERIODIC = 2
    STICKING = 3
    CHAOTIC = 4
    STUCK_FOREVER = 5  # pressed against the stop
    DECAYING = 6  # unforced impacts die out
    AT_REST = 7  # where a motion ends that nothing drives
    BUDGET = 8  # not followed to the end
    INTERRUPTED = 9

    @property
    def word(self) -> str:
        """The name as it stands in datasets."""
        return self.name.lower()

    @property
    def stored(self) -> MotionClass:
        """The kind of 0 to 4 that this one refines."""
        return MotionClass(int(_STORED[self]))

    @property
    def hits(self) -> bool:
        """Whether the settled motion touches the stop again and again."""
        return self in (MotionClass.PERIODIC, MotionClass.STICKING, MotionClass.CHAOTIC)


_STORED = np.array([0, 1, 2, 3, 4, 1, 1, 1, 0, 0], dtype=np.int8)
_NAMES = {MotionClass.STUCK_FOREVER: "permanently in contact", MotionClass.BUDGET: "not followed to the end"}
# The kind that a status alone decides, by status; the first four decide nothing.
_BY_STATUS = np.array([0, 0, 0, 0, 1, 1, 5, 6, 8, 9], dtype=np.int8)


def decide(status: ArrayLike, growth: ArrayLike, n_periods: ArrayLike, n_impacts: ArrayLike) -> NDArray[np.int8]:
    r"""Return the kind of motion, as a number of `MotionClass`, of one cell or of an array of cells.

    Parameters
    ----------
    status : int or array
        A `Status` a cell.
    growth : float or array
        ln of the factor by which neighbours part over the sampled impacts, :math:`N \lambda_\mathrm{impact}`.
    n_periods, n_impacts : int or array
        Driving periods and impacts of the cycle that was found; 0 where there is none, -1 impacts for complete chatter.

    Returns
    -------
    ndarray of int8
        The first of these that fits: what the status alone decides (no impact, stuck, decaying, budget, interrupted);
        sticking, where two of three hold: there is a cycle, :math:`\lambda = -\infty`, a complete chatter; periodic,
        with another cycle; chaotic, if growth exceeds 53 ln 2 in a window of 10 periods or more; undecided.

    Examples
    --------
    >>> [MotionClass(code).word for code in decide([2, 1, 0, 6], [-np.inf, -9.0, 90.0, np.nan], [1, 2, 0, 0], 0)]
    ['sticking', 'periodic', 'chaotic', 'stuck_forever']
    """
    status, growth = np.asarray(status), np.asarray(growth)
    cycle, rests, chatters = np.asarray(n_periods) > 0, np.isneginf(growth), np.asarray(n_impacts) == -1
    chaotic = (growth > CERTAIN_GROWTH) & (status != Status.SHORT_WINDOW)
    kind = np.where(chaotic, MotionClass.CHAOTIC, MotionClass.UNDECIDED)
    kind = np.where(cycle, MotionClass.PERIODIC, kind)
    kind = np.where((cycle & rests) | (cycle & chatters) | (rests & chatters), MotionClass.STICKING, kind)
    return refined(kind, status)


def stored(kinds: NDArray[Any]) -> NDArray[np.int8]:
    """Return kinds as `classify` stores them, 0 to 4."""
    codes: NDArray[np.int8] = _STORED[kinds]
    return codes


def refined(codes: ArrayLike, status: ArrayLike) -> NDArray[np.int8]:
    """Return stored kinds with those that the status tells apart.

    Examples
    --------
    >>> motion_name(MotionClass(int(refined(MotionClass.NO_IMPACT, Status.STUCK_FOREVER))))
    'permanently in contact'
    """
    by_status = _BY_STATUS[np.asarray(status)]
    return np.where(by_status > 0, by_status, np.asarray(codes, dtype=np.int8))


def motion_name(kind: int, n_periods: int = 0, n_impacts: int = 0) -> str:
    """Return a motion in two or three words.

    Examples
    --------
    >>> motion_name(MotionClass.PERIODIC, 2, 1), motion_name(MotionClass.STICKING, 1, -1)
    ('period-2 impact-1', 'period-1 sticking')
    """
    kind = MotionClass(kind)
    if kind == MotionClass.PERIODIC:
        return f"period-{n_periods} impact-{n_impacts}"
    if kind == MotionClass.STICKING:
        return f"period-{n_periods} sticking" if n_periods else "intermittent sticking"
    return _NAMES.get(kind, kind.word.replace("_", " "))


def cycle_name(n_periods: int, n_impacts: int, sticks: bool = False) -> str:
    """Return the name of an orbit of n periods and p impacts; one with -1 impacts sticks."""
    kind = MotionClass.STICKING if sticks or n_impacts == -1 else MotionClass.PERIODIC
    return motion_name(kind, n_periods, n_impacts)


@dataclass(frozen=True)
class Motion:
    """The kind of a motion, and the impacts of one of its cycles.

    Parameters
    ----------
    kind : str
        "periodic", "sticking", "chaotic", "undecided" (no cycle, and chaos not certain), "no_impact", "stuck_forever",
        "decaying", "at_rest", "budget" or "interrupted": the word of a `MotionClass`.
    n_periods : int
        Driving periods in a cycle; 0 where there is none.
    n_impacts : int
        Impacts in a cycle; -1 for a complete chatter (infinitely many), 0 where there is no cycle.
    velocities, phases : tuple of float
        Impact velocities in m/s and phases in [0, 1) of one cycle, from its hardest hit on in the order of
        time; for a sticking motion those of the recorded impacts. Empty where there is no cycle.
    status : Status
        How the sampled motion ended.

    Examples
    --------
    >>> motion = Motion("periodic", 1, 2, (1.48, 1.13), (0.3, 0.8))
    >>> motion.name
    'period-1 impact-2'
    >>> motion.sentence(7.0)
    'period-1 impact-2, hits at 1.48 and 1.13 m/s every 7 s'
    """

    kind: str
    n_periods: int = 0
    n_impacts: int = 0
    velocities: tuple[float, ...] = ()
    phases: tuple[float, ...] = ()
    status: Status = field(default=Status.OK, compare=False)

    @property
    def motion_class(self) -> MotionClass:
        """The kind as a `MotionClass`."""
        return MotionClass[self.kind.upper()]

    @property
    def name(self) -> str:
        """The motion in two or three words."""
        return motion_name(self.motion_class, self.n_periods, self.n_impacts)

    def sentence(self, period: float) -> str:
        """Return the motion in a sentence, given the driving period in s."""
        kind, cycle = self.motion_class, f"every {self.n_periods * period:.3g} s"
        if kind == MotionClass.PERIODIC:
            return f"{self.name}, {_hits(self.velocities)} {cycle}"
        if kind == MotionClass.STICKING:
            hardest = f", hardest hit {max(self.velocities):.3g} m/s" if self.velocities else ""
            rest = f", comes to rest at the stop {cycle}" if self.n_periods else INTERMITTENT
            return f"{self.name}{rest}{hardest}"
        if kind == MotionClass.CHAOTIC:
            return "chaotic, the impacts do not repeat"
        if kind == MotionClass.UNDECIDED:
            return "undecided, the sampled impacts do not repeat and are too few to prove chaos; sample more"
        return f"{self.name}: {self.status.sentence}"


INTERMITTENT = "; its period is not resolved in double precision"  # follows the name of intermittent sticking


def _hits(velocities: tuple[float, ...]) -> str:
    numbers = [f"{velocity:.3g}" for velocity in velocities]
    if len(numbers) > 4:
        return f"hits from {min(velocities):.3g} to {max(velocities):.3g} m/s"
    return f"hits at {' and '.join([', '.join(numbers[:-1]), numbers[-1]] if len(numbers) > 1 else numbers)} m/s"
