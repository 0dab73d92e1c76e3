"""The one vocabulary of motions: their kinds, how a kind is decided, names, sentences, and recognising one.

Whatever names a motion - maps, sections, attractors, verdicts, diagrams, the explorer - decides its kind with `decide`
and words it with `motion_name`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vibroimpact.dataset import oscillator_of
from vibroimpact.parameters import real_number, whole_number
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr

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
_NAMES = {MotionClass.STUCK_FOREVER: "stuck for ever"}
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
    'stuck for ever'
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
        return f"period-{n_periods} sticking" if n_periods else "irregular with rests"
    return _NAMES.get(kind, kind.word.replace("_", " "))


def cycle_name(n_periods: int, n_impacts: int, sticks: bool = False) -> str:
    """Return the name of an orbit of n periods and p impacts; one with -1 impacts sticks."""
    kind = MotionClass.STICKING if sticks or n_impacts == -1 else MotionClass.PERIODIC
    return motion_name(kind, n_periods, n_impacts)


@dataclass(frozen=True)
class Motion:
    """What a motion is called, and the impacts of one of its cycles.

    Parameters
    ----------
    kind : str
        "periodic", "sticking", "aperiodic", "undetermined" (too few impacts to tell), or how the motion
        ended ("no_impact", "stopped_impacting", "stuck_forever", "decaying", "budget", "interrupted").
    n_periods : int
        Driving periods in a cycle; 0 where there is none.
    n_impacts : int
        Impacts in a cycle; -1 for a complete chatter (infinitely many), 0 where there is no cycle.
    velocities, phases : tuple of float
        Impact velocities in m/s and phases in [0, 1) of one cycle, from its hardest hit on in the order of
        time; for a sticking motion those of the recorded impacts. Empty where there is no cycle.

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

    @property
    def name(self) -> str:
        """The motion in two or three words."""
        if self.kind in ("aperiodic", "undetermined"):
            return self.kind
        if self.kind == "stopped_impacting":
            return "no impact any more"
        return motion_name(MotionClass[self.kind.upper()], self.n_periods, self.n_impacts)

    def sentence(self, period: float) -> str:
        """Return the motion in a sentence, given the driving period in s."""
        cycle = f"every {self.n_periods * period:.3g} s"
        if self.kind == "periodic":
            return f"{self.name}, {_hits(self.velocities)} {cycle}"
        if self.kind == "sticking":
            hardest = f", hardest hit {max(self.velocities):.3g} m/s" if self.velocities else ""
            if not self.n_periods:
                return f"{self.name}, comes to rest at the stop so seldom that rounding decides when{hardest}"
            return f"{self.name}, comes to rest at the stop {cycle}{hardest}"
        if self.kind == "aperiodic":
            return "aperiodic, the impacts do not repeat"
        if self.kind == "undetermined":
            return "undetermined, too few impacts to tell whether they repeat; sample more"
        return f"{self.name}: {Status[self.kind.upper()].sentence}"


def recognise(section: xr.Dataset, *, tolerance: float = 1e-6, longest: int = 64) -> Motion:
    r"""Name the motion that a settled impact section belongs to.

    A period-n impact-p motion repeats after p impacts that take n driving periods:
    :math:`I_{i+p} = I_i`, :math:`\psi_{i+p} = \psi_i`, :math:`t_{i+p} = t_i + nT` for all i, with the
    smallest such p. A stick erases all memory, so a motion that leaves the stop from rest twice repeats
    from one release to the next.

    Parameters
    ----------
    section : xarray.Dataset
        What `impact_section` returned: `time` in s, `phase`, `velocity` in m/s (dim `impact`), `release_time`
        (dim `stick`), `status`, and the oscillator in its attributes.
    tolerance : float, > 0
        How well impacts must repeat, relative to the section's largest velocity; phases are compared as
        points on the unit circle.
    longest : int, >= 1
        The most impacts a cycle is looked for with.

    Returns
    -------
    Motion
        Its kind, n, p and one cycle.

    Raises
    ------
    ValueError
        `section` is no impact section, or `tolerance` or `longest` is out of its range.

    Notes
    -----
    All of the section must repeat, or else all of its second half, so that a transient slower than
    `transient_impacts` is not taken for an aperiodic motion. A motion that repeats less well than
    `tolerance` is called aperiodic: close to a bifurcation leave out more impacts first. With fewer than
    2 `longest` impacts nothing is called aperiodic. Cost: a few passes over the section for each p.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> recognise(vi.impact_section(vi.ImpactOscillator(omega=2.0))).name
    'period-1 impact-1'
    """
    _check(section, tolerance, longest)
    status = Status(int(section["status"]))
    if not status.has_indices:
        return Motion(status.word)
    osc = oscillator_of(section)
    time, phase, velocity = (np.asarray(section[name], dtype=np.float64) for name in ("time", "phase", "velocity"))
    releases = np.asarray(section["release_time"], dtype=np.float64)
    releases = releases[np.isfinite(releases)]
    if len(releases) >= 2:
        return _sticking(time, phase, velocity, np.sort(releases), osc.period, osc.restitution)
    p = cycle_length(velocity, phase, tolerance=tolerance, longest=longest)
    n = _whole_periods(time[len(time) // 2 :], p, osc.period) if p else 0
    if n:
        return Motion("periodic", n, p, *_from_hardest(velocity[-p:], phase[-p:]))
    stuck = status == Status.STICKING
    return Motion("undetermined" if stuck or len(time) < 2 * longest else "aperiodic")


def recurrence(*columns: NDArray[Any], tolerance: float = 1e-6, longest: int = 64) -> int:
    """Return the fewest steps after which all columns, or else their second halves, repeat; 0 if they do not.

    Parameters
    ----------
    columns : ndarray, shape (n,)
        Quantities of the same n samples, real or complex; give phases as points exp(2 pi i phase).
    tolerance : float
        Largest difference allowed in a column, relative to its largest modulus.
    longest : int
        The longest cycle looked for; none longer than half of the samples is found.

    Returns
    -------
    int
        Samples in a cycle, or 0 if they do not repeat.

    Examples
    --------
    >>> recurrence(np.array([1.0, 2.0, 1.0, 2.0, 1.0]))
    2
    """
    settled = [column[len(column) // 2 :] for column in columns]
    return _repeats(columns, tolerance, longest) or _repeats(settled, tolerance, longest)


def _repeats(columns: Sequence[NDArray[Any]], tolerance: float, longest: int) -> int:
    pairs = [(column, tolerance * np.abs(column).max(initial=0.0)) for column in columns]
    for p in range(1, min(longest, len(columns[0]) // 2) + 1):
        if any(abs(column[p] - column[0]) > most for column, most in pairs):
            continue  # the first pair tells most candidates off
        if all(np.abs(column[p:] - column[:-p]).max() <= most for column, most in pairs):
            return p
    return 0


def cycle_length(velocity: Floats, phase: Floats, *, tolerance: float = 1e-6, longest: int = 64) -> int:
    """Return the fewest impacts after which velocities (m/s) and phases ([0, 1), on the circle) repeat, or 0.

    Examples
    --------
    >>> cycle_length(np.array([1.0, 2.0] * 4), np.array([0.1, 0.6] * 4))
    2
    """
    return recurrence(velocity, np.exp(2j * np.pi * phase), tolerance=tolerance, longest=longest)


def _check(section: xr.Dataset, tolerance: float, longest: int) -> None:
    missing = {"time", "phase", "velocity", "release_time", "status"} - set(map(str, section.variables))
    if missing or "oscillator" not in section.attrs:
        raise ValueError(
            f"`section` holds no {min(missing, default='oscillator')!r}; allowed is an impact section; "
            "give what `impact_section` returned"
        )
    if real_number("tolerance", tolerance) <= 0.0:
        raise ValueError(f"`tolerance` is {tolerance!r}; allowed is a number > 0; 1e-6 is usual")
    whole_number("longest", longest, 1)


def _whole_periods(time: Floats, p: int, period: float) -> int:
    """Return the driving periods that every p impacts take, or 0 if they do not agree."""
    counts = np.rint((time[p:] - time[:-p]) / period)
    return int(counts[0]) if (counts == counts[0]).all() else 0


def _sticking(
    time: Floats, phase: Floats, velocity: Floats, releases: Floats, period: float, restitution: float
) -> Motion:
    """Name a motion from its releases; its cycle is the last one between releases."""
    waits = np.rint(np.diff(releases) / period)
    lengths = range(1, max(2, len(waits) // 2 + 1))  # a single wait is a cycle: a stick erases all memory
    q = next((q for q in lengths if (waits[q:] == waits[:-q]).all()), 0)
    if not q:
        return Motion("aperiodic")
    between = (time > releases[-1 - q]) & (time <= releases[-1])
    # r = 0 sticks after one impact; r > 0 after infinitely many, of which the largest are recorded
    n_impacts = int(between.sum()) if restitution == 0.0 else -1
    return Motion("sticking", int(waits[-q:].sum()), n_impacts, *_from_hardest(velocity[between], phase[between]))


def _from_hardest(velocity: Floats, phase: Floats) -> tuple[tuple[float, ...], tuple[float, ...]]:
    if len(velocity) == 0:
        return (), ()
    start = -int(velocity.argmax())
    return tuple(np.roll(velocity, start).tolist()), tuple(np.roll(phase, start).tolist())


def _hits(velocities: tuple[float, ...]) -> str:
    words = [f"{velocity:.3g}" for velocity in velocities]
    if len(words) > 4:
        return f"hits from {min(velocities):.3g} to {max(velocities):.3g} m/s"
    return f"hits at {' and '.join([', '.join(words[:-1]), words[-1]] if len(words) > 1 else words)} m/s"
