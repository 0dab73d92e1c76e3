"""The vocabulary of motions: their kinds, how a kind is decided, names and sentences, and recognition.

Everything that names a motion - maps, sections, attractors, verdicts, diagrams, the explorer - decides its kind with
`decide` and names it with `motion_name`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vibroimpact.model import Model
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr

# The threshold of chaos: ln of the growth that amplifies the last binary digit of a double to the motion's own size.
CERTAIN_GROWTH = 53 * math.log(2.0)
NAMING = ("lyapunov_per_impact", "n_periods", "n_impacts")  # the indices that name a motion
WITHOUT = "the motion without impacts"  # along the graze at which it first touches a stop
WINDS = 1000  # impacts: in fewer, slow convergence cannot be distinguished from none


class MotionClass(IntEnum):
    """The kind of a motion.

    `classify` stores 0 to 5 in files; 0 to 4 never change. The others refine 1 (no impact) and 0 (undecided) by the
    status; `stored` converts them back.
    """

    UNDECIDED = 0
    NO_IMPACT = 1
    PERIODIC = 2
    STICKING = 3
    CHAOTIC = 4
    QUASI_PERIODIC = 5  # only with two coordinates or more
    STUCK_FOREVER = 6  # permanently in contact
    DECAYING = 7  # unforced impacts die out
    AT_REST = 8  # the end of unforced motion
    BUDGET = 9  # not followed to the end
    INTERRUPTED = 10

    @property
    def word(self) -> str:
        """The name in datasets."""
        return self.name.lower()

    @property
    def label(self) -> str:
        """The name in sentences and legends."""
        return _NAMES.get(self, self.word.replace("_", " "))

    @property
    def stored(self) -> MotionClass:
        """The stored kind, 0 to 5, that this one refines."""
        return MotionClass(int(_STORED[self]))

    @property
    def hits(self) -> bool:
        """Whether the settled motion hits the stop again and again."""
        return self.stored not in (MotionClass.UNDECIDED, MotionClass.NO_IMPACT)


_STORED = np.array([0, 1, 2, 3, 4, 5, 1, 1, 1, 0, 0], dtype=np.int8)
_NAMES = {
    MotionClass.QUASI_PERIODIC: "quasi-periodic",
    MotionClass.STUCK_FOREVER: "permanently in contact",
    MotionClass.BUDGET: "not followed to the end",
}
# The kinds that follow from a status alone, by status; the first four statuses leave the kind open.
_BY_STATUS = np.array([0, 0, 0, 0, 1, 1, 6, 7, 9, 10, 9], dtype=np.int8)


def decide(
    status: ArrayLike, growth: ArrayLike, n_periods: ArrayLike, n_impacts: ArrayLike, impacts: ArrayLike = 0
) -> NDArray[np.int8]:
    r"""Return the kind of motion, as a number of `MotionClass`, of one cell or of an array, by the rules of `classify`.

    `growth` is ln of the factor by which perturbations grow over the sampled impacts, :math:`N
    \lambda_\mathrm{impact}`; `n_periods` and `n_impacts` are 0 if no cycle was found, and `n_impacts` is -1 for
    complete chatter. The mass sticks if two of three hold: there is a cycle, :math:`\lambda = -\infty`, there is
    complete chatter. `impacts` is the number of sampled impacts if the motions of the model `may_wind`, else 0.

    Examples
    --------
    >>> [MotionClass(code).word for code in decide([2, 1, 0, 6], [-np.inf, -9.0, 90.0, np.nan], [1, 2, 0, 0], 0)]
    ['sticking', 'periodic', 'chaotic', 'stuck_forever']
    """
    status, growth, impacts = np.asarray(status), np.asarray(growth), np.asarray(impacts)
    cycle, rests, chatters = np.asarray(n_periods) > 0, np.isneginf(growth), np.asarray(n_impacts) == -1
    chaotic = (growth > CERTAIN_GROWTH) & (status != Status.SHORT_WINDOW)
    kind = np.where(chaotic, MotionClass.CHAOTIC, MotionClass.UNDECIDED)
    keeps = (impacts >= WINDS) & (growth >= -1.0) & (growth <= np.log(np.maximum(impacts, 1)))
    kind = np.where(keeps & (status != Status.SHORT_WINDOW), MotionClass.QUASI_PERIODIC, kind)
    kind = np.where(cycle, MotionClass.PERIODIC, kind)
    kind = np.where((cycle & rests) | (cycle & chatters) | (rests & chatters), MotionClass.STICKING, kind)
    return refined(kind, status)


def may_wind(model: Model) -> bool:
    """Return whether motions may be quasi-periodic: with two coordinates or more, not counting a free centre.

    The stroboscopic section of one coordinate is a plane, even between two stops, if the rates before and after an
    impact are taken as one point. A closed curve on the section would enclose an area that each period preserves, but
    stops and dampers that lose energy shrink it.
    """
    system: Any = model.at()
    return np.size(system.mass) > 1 and int((~system.modal().neutral[1]).sum()) > 1


def stored(kinds: NDArray[Any]) -> NDArray[np.int8]:
    """Return kinds as `classify` stores them, 0 to 5."""
    codes: NDArray[np.int8] = _STORED[kinds]
    return codes


def refined(codes: ArrayLike, status: ArrayLike) -> NDArray[np.int8]:
    """Return stored kinds, refined if the status alone decides."""
    by_status = _BY_STATUS[np.asarray(status)]
    return np.where(by_status > 0, by_status, np.asarray(codes, dtype=np.int8))


def motion_name(kind: int, n_periods: int = 0, n_impacts: int = 0) -> str:
    """Return the name of a motion in two or three words.

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
    return kind.label


def cycle_name(n_periods: int, n_impacts: int, forgets: bool = False) -> str:
    """Return the name of an orbit of n periods and p impacts; p = -1, or a rest that erases all memory, is sticking."""
    kind = MotionClass.STICKING if forgets or n_impacts == -1 else MotionClass.PERIODIC
    return motion_name(kind, n_periods, n_impacts)


def motion_along(followed: xr.Dataset, sticks: bool = False) -> str:
    """Return the name of the motions along a branch or a curve.

    If all velocities are 0 there are no impacts. On a branch, grazes of compliant stops change the number of impacts.
    """
    n, p = (int(followed.attrs[name]) for name in ("n_periods", "n_impacts"))
    if sticks or p < 1:
        return cycle_name(n, p, sticks)
    speeds = followed["velocity"].transpose("point", "impact").values
    if not np.nanmax(speeds, initial=0.0) > 0.0:
        return WITHOUT
    counts = np.isfinite(speeds).sum(axis=1)
    few, many = int(counts.min()), int(counts.max())
    return cycle_name(n, few) + (f" to impact-{many}" if many > few else "")


@dataclass(frozen=True)
class Motion:
    """The kind of a motion, and the impacts of one of its cycles.

    Parameters
    ----------
    kind : str
        "periodic", "sticking", "chaotic", "quasi_periodic", "undecided" (no cycle, and chaos not certain), "no_impact",
        "stuck_forever", "decaying", "at_rest", "budget" or "interrupted": the word of a `MotionClass`.
    n_periods : int
        Driving periods in a cycle; 0 if there is no cycle.
    n_impacts : int
        Impacts in a cycle; -1 for complete chatter (infinitely many), 0 if there is no cycle.
    velocities, phases : tuple of float
        Impact velocities in m/s and phases in [0, 1) of one cycle's recorded impacts, in order of time from its hardest
        impact. Empty if there is no cycle.
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

    @cached_property
    def motion_class(self) -> MotionClass:
        """The kind as a `MotionClass`."""
        return MotionClass[self.kind.upper()]

    @property
    def name(self) -> str:
        """The name of the motion in two or three words."""
        return motion_name(self.motion_class, self.n_periods, self.n_impacts)

    def sentence(self, period: float) -> str:
        """Return the motion in a sentence, given the driving period in s."""
        kind, cycle = self.motion_class, f"every {self.n_periods * period:.3g} s"
        if kind == MotionClass.PERIODIC:
            return f"{self.name}, {_hits(self.velocities)} {cycle}"
        if kind == MotionClass.STICKING:
            hardest = f", hardest hit {max(self.velocities):.3g} m/s" if self.velocities else ""
            rest = f", comes to rest at the stop {cycle}"
            if not self.n_periods:
                rest = "; its period is not resolved in double precision"
            return f"{self.name}{rest}{hardest}"
        if kind == MotionClass.CHAOTIC:
            return "chaotic, the impacts do not repeat"
        if kind == MotionClass.QUASI_PERIODIC:
            return "quasi-periodic, the impacts do not repeat, and perturbations neither grow nor decay"
        if kind == MotionClass.UNDECIDED:
            return "undecided, no cycle of whole driving periods was found, and chaos is not certain; sample more"
        return f"{self.name}: {self.status.sentence.removeprefix(f'{self.name}: ')}"


def _hits(velocities: tuple[float, ...]) -> str:
    if len(velocities) > 4:
        return f"hits from {min(velocities):.3g} to {max(velocities):.3g} m/s"
    return f"hits at {listed([f'{velocity:.3g}' for velocity in velocities])} m/s"


def listed(items: list[str]) -> str:
    """Return a list with commas, and an "and" before the last item."""
    return " and ".join(part for part in (", ".join(items[:-1]), items[-1]) if part) if items else ""
