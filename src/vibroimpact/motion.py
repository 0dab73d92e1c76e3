"""The one vocabulary of motions: their kinds, how a kind is decided, names and sentences, and recognition.

Whatever names a motion - maps, sections, attractors, verdicts, diagrams, the explorer - decides its kind with `decide`
and names it with `motion_name`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vibroimpact.backends import ImpactWindow, Measurement, get_backend
from vibroimpact.cells import Floats
from vibroimpact.dataset import model_of, oscillator_of, start_of
from vibroimpact.neighbours import resolved, separations
from vibroimpact.options import Tolerances
from vibroimpact.oscillator import ImpactOscillator, Model
from vibroimpact.parameters import invalid, real_number, whole_number
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr

# The one threshold of chaos: ln of the growth that carries the last binary digit of a double to the motion's own size.
CERTAIN_GROWTH = 53 * math.log(2.0)
WITHOUT = "the motion without impacts"  # along the graze at which it first touches a stop
_NAMING = ("lyapunov_per_impact", "n_periods", "n_impacts")
WINDS = 1000  # impacts: in fewer a motion that settles slowly looks as if it never did


class MotionClass(IntEnum):
    """The kind of a motion.

    `classify` stores 0 to 5 in files; 0 to 4 never change. The others refine 1 (no impact) and 0 (undecided) where the
    status is known; `stored` leads back.
    """

    UNDECIDED = 0
    NO_IMPACT = 1
    PERIODIC = 2
    STICKING = 3
    CHAOTIC = 4
    QUASI_PERIODIC = 5  # of two coordinates or more
    STUCK_FOREVER = 6  # pressed against the stop
    DECAYING = 7  # unforced impacts die out
    AT_REST = 8  # where a motion ends that nothing drives
    BUDGET = 9  # not followed to the end
    INTERRUPTED = 10

    @property
    def word(self) -> str:
        """The name as it stands in datasets."""
        return self.name.lower()

    @property
    def label(self) -> str:
        """The name in sentences and legends."""
        return _NAMES.get(self, self.word.replace("_", " "))

    @property
    def stored(self) -> MotionClass:
        """The kind of 0 to 5 that this one refines."""
        return MotionClass(int(_STORED[self]))

    @property
    def hits(self) -> bool:
        """Whether the settled motion touches the stop again and again."""
        return self.stored not in (MotionClass.UNDECIDED, MotionClass.NO_IMPACT)


_STORED = np.array([0, 1, 2, 3, 4, 5, 1, 1, 1, 0, 0], dtype=np.int8)
_NAMES = {
    MotionClass.QUASI_PERIODIC: "quasi-periodic",
    MotionClass.STUCK_FOREVER: "permanently in contact",
    MotionClass.BUDGET: "not followed to the end",
}
# The kind that a status alone decides, by status; the first four decide nothing.
_BY_STATUS = np.array([0, 0, 0, 0, 1, 1, 6, 7, 9, 10, 9], dtype=np.int8)


def decide(
    status: ArrayLike, growth: ArrayLike, n_periods: ArrayLike, n_impacts: ArrayLike, impacts: ArrayLike = 0
) -> NDArray[np.int8]:
    r"""Return the kind of motion, as a number of `MotionClass`, of one cell or of an array, by the rules of `classify`.

    `growth` is ln of the factor by which neighbours part over the sampled impacts, :math:`N \lambda_\mathrm{impact}`;
    `n_periods` and `n_impacts` are 0 where no cycle was found, and -1 impacts are a complete chatter. The mass sticks
    where two of three hold: there is a cycle, :math:`\lambda = -\infty`, a complete chatter. `impacts` were sampled of
    a model whose motions `may_wind`, 0 of another.

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
    """Return whether motions may be quasi-periodic: of two coordinates or more beside a free centre.

    The stroboscopic section of one coordinate is a plane, also between two stops, where each rate before an impact and
    that after it are one point. A closed curve of the section would enclose an area that each period keeps; but it
    shrinks where a stop or a damper takes energy.
    """
    system: Any = model.at()
    return np.size(system.mass) > 1 and int((~system.modal().neutral[1]).sum()) > 1


def stored(kinds: NDArray[Any]) -> NDArray[np.int8]:
    """Return kinds as `classify` stores them, 0 to 5."""
    codes: NDArray[np.int8] = _STORED[kinds]
    return codes


def refined(codes: ArrayLike, status: ArrayLike) -> NDArray[np.int8]:
    """Return stored kinds, refined where the status alone decides."""
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
    return kind.label


def cycle_name(n_periods: int, n_impacts: int, sticks: bool = False) -> str:
    """Return the name of an orbit of n periods and p impacts; one with -1 impacts sticks."""
    kind = MotionClass.STICKING if sticks or n_impacts == -1 else MotionClass.PERIODIC
    return motion_name(kind, n_periods, n_impacts)


def motion_along(followed: xr.Dataset, sticks: bool = False) -> str:
    """Return the name of the motions along a branch or a curve.

    Where all velocities are 0 nothing hits. On a branch, grazes of stops that give change the number of impacts.
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
        Driving periods in a cycle; 0 where there is none.
    n_impacts : int
        Impacts in a cycle; -1 for a complete chatter (infinitely many), 0 where there is no cycle.
    velocities, phases : tuple of float
        Impact velocities in m/s and phases in [0, 1) of one cycle's recorded impacts, from its hardest hit on in the
        order of time. Empty where there is no cycle.
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
        """The motion in two or three words."""
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
            return "quasi-periodic, the impacts do not repeat, and neighbours neither part nor approach"
        if kind == MotionClass.UNDECIDED:
            return "undecided, no cycle of whole driving periods was found, nor is it surely chaotic; sample more"
        return f"{self.name}: {self.status.sentence.removeprefix(f'{self.name}: ')}"


def _hits(velocities: tuple[float, ...]) -> str:
    if len(velocities) > 4:
        return f"hits from {min(velocities):.3g} to {max(velocities):.3g} m/s"
    return f"hits at {listed([f'{velocity:.3g}' for velocity in velocities])} m/s"


def listed(items: list[str]) -> str:
    """Return a list with commas, and an "and" before the last item."""
    return " and ".join(part for part in (", ".join(items[:-1]), items[-1]) if part) if items else ""


# Recognition


def recognise(section: xr.Dataset, *, tolerance: float = 1e-6, longest: int = 64) -> Motion:
    r"""Return the motion that a settled impact section belongs to.

    A period-n impact-p motion repeats after p impacts that take n driving periods: :math:`I_{i+p} = I_i`,
    :math:`\psi_{i+p} = \psi_i`, :math:`t_{i+p} = t_i + nT` for all i, with the smallest such p. A stick erases all
    memory, so a motion that leaves the stop from rest twice repeats from one release to the next, unless neighbours
    part by more than 1e13 on the way (`resolved`): then it is intermittent sticking in this section, which the smallest
    push may end. What does not repeat is chaotic if neighbours part by more than 2^53.

    For systems, impacts must repeat stop by stop. What does not repeat, or rests, is named as `classify` names it: the
    section does not hold the coordinates, so that the motion is computed once more from its initial condition.

    Parameters
    ----------
    section : xarray.Dataset
        What `impact_section` returned: `time` in s, `phase`, `velocity` in m/s (dim `impact`), `release_time`
        (dim `stick`), `status`, and the oscillator or the system in its attributes.
    tolerance : float, > 0
        How well impacts must repeat, relative to the largest velocity, and phases as points of the unit circle.
    longest : int, >= 1
        The most impacts of a cycle.

    Returns
    -------
    Motion
        Its kind, n, p and one cycle.

    Raises
    ------
    ValueError
        `section` is not an impact section, or `tolerance` or `longest` is out of its range.

    Notes
    -----
    All of the section must repeat, or else all of its second half, so that a transient slower than
    `transient_impacts` is not taken for chaos. A motion that repeats less well than `tolerance` does not repeat: close
    to a bifurcation leave out more impacts first. Growth is that of a deviation carried through flights and impacts
    (`separations`). Cost: a few passes over the section for each p, and 2 microseconds per impact without a cycle.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> [recognise(vi.impact_section(vi.ImpactOscillator(omega=omega))).name for omega in (2.0, 2.8)]
    ['period-1 impact-1', 'chaotic']
    """
    _check(section, tolerance, longest)
    if "system" in section.attrs:
        return _of_system(section, tolerance, longest)
    status = Status(int(section["status"]))
    osc = oscillator_of(section)
    time, phase, velocity = (np.asarray(section[name], dtype=np.float64) for name in ("time", "phase", "velocity"))
    releases = np.asarray(section["release_time"], dtype=np.float64)
    releases = np.sort(releases[np.isfinite(releases)])
    n, p, growth, cycle = 0, 0, -math.inf, np.zeros(len(time), dtype=bool)
    if len(releases) >= 2:
        n, p, cycle = _between_releases(time, releases, osc)
        from_release = [np.append(0.0, column[cycle]) for column in (time, phase, velocity)]
        from_release[0][0] = releases[-1] - n * osc.period
        if not resolved(osc, *from_release):
            n, p = 0, -1  # intermittent: rounding decides when the mass rests again
    elif p := cycle_length(velocity, phase, tolerance=tolerance, longest=longest):
        settled = time[len(time) // 2 :]
        waits = np.rint((settled[p:] - settled[:-p]) / osc.period)
        n, growth = int(waits[0]) if (waits == waits[0]).all() else 0, 0.0
        cycle[-p:] = True
    if not n and status.has_indices and status != Status.STICKING:
        growth = float(separations(osc, time, phase, velocity)[-1:].sum())
    kind = MotionClass(int(decide(status, growth, n, p)))
    if kind not in (MotionClass.PERIODIC, MotionClass.STICKING):
        return Motion(kind.word, status=status)
    impacts = _from_hardest(velocity[cycle], phase[cycle]) if n else ((), ())
    return Motion(kind.word, n, p, *impacts, status)


def _of_system(section: xr.Dataset, tolerance: float, longest: int) -> Motion:
    system, status = model_of(section), Status(int(section["status"]))
    velocity, phase = (np.asarray(section[name], dtype=np.float64) for name in ("velocity", "phase"))
    n, p, growth, keep = *system_cycle(section, system.period, tolerance=tolerance, longest=longest), 0.0, 0
    if status.has_indices and (not n or section.sizes["stick"]):
        how = json.loads(section.attrs["arguments"])
        keep = how["sample_impacts"]
        wanted = Measurement(ImpactWindow(how["transient_impacts"], keep), Tolerances(), indices=_NAMING)
        found = get_backend("cpu").indices(system.cells({}, start_of(section)), wanted)
        growth, n, p = (found[name][0] for name in _NAMING)
        growth *= keep
    kind = MotionClass(int(decide(status, growth, n, p, keep if may_wind(system) else 0)))
    if kind not in (MotionClass.PERIODIC, MotionClass.STICKING):
        return Motion(kind.word, status=status)
    turns = section["time"].values / system.period
    cycle = slice(-int(p), None) if p > 0 else turns > turns[-1] - n + 1e-6
    return Motion(kind.word, int(n), int(p), *_from_hardest(velocity[cycle], phase[cycle]), status)


def system_cycle(section: xr.Dataset, period: float, **limits: Any) -> tuple[int, int]:
    """Return after how many driving periods and impacts the impacts of a system repeat, stop by stop, or 0 and 0."""
    speed, phase, time, stop = (section[name].values for name in ("velocity", "phase", "time", "stop"))
    codes = np.unique(stop, return_inverse=True)[1].astype(float)
    p = recurrence(speed, np.exp(2j * np.pi * phase), codes, **limits)
    waits = np.rint((time[p:] - time[:-p]) / period)[len(time) // 2 - p :] if p else np.zeros(0)
    return (int(waits[0]), p) if len(waits) and (waits == waits[0]).all() else (0, 0)


def recurrence(*columns: NDArray[Any], tolerance: float = 1e-6, longest: int = 64) -> int:
    """Return the fewest samples after which all columns, or else their second halves, repeat; 0 if they do not.

    Each cycle must be the last one within `tolerance`, relative to a column's largest modulus, and so by its root
    nearer than after fewer samples: a motion that still drifts, or turns from one side to the other, has no cycle yet.
    Phases are given as points exp(2 pi i phase). No cycle longer than half of the samples is found.
    """
    settled = [column[len(column) // 2 :] for column in columns]
    return _repeats(columns, tolerance, longest) or _repeats(settled, tolerance, longest)


def _repeats(columns: Sequence[NDArray[Any]], tolerance: float, longest: int) -> int:
    sized = [column / (np.abs(column).max(initial=0.0) or 1.0) for column in columns]
    nearest = 1.0
    for p in range(1, min(longest, len(columns[0]) // 2) + 1):
        apart = max(_apart(column, p) for column in sized)
        if apart <= tolerance and apart <= math.sqrt(tolerance) * nearest:
            return p
        nearest = min(nearest, apart)
    return 0


def _apart(column: NDArray[Any], p: int) -> float:
    """Return how far cycles of p samples are at most from the last one."""
    return float(np.abs(column[len(column) % p :].reshape(-1, p) - column[-p:]).max())


def cycle_length(velocity: Floats, phase: Floats, *, tolerance: float = 1e-6, longest: int = 64) -> int:
    """Return the fewest impacts after which velocities and phases repeat, or 0."""
    return recurrence(velocity, np.exp(2j * np.pi * phase), tolerance=tolerance, longest=longest)


def _check(section: xr.Dataset, tolerance: float, longest: int) -> None:
    known = map(str, getattr(section, "variables", ()))
    of_systems = {"stop"} if "system" in getattr(section, "attrs", {}) else set()
    missing = ({"time", "phase", "velocity", "release_time", "status"} | of_systems).difference(known)
    if missing or not {"oscillator", "system"} & set(section.attrs):
        raise ValueError(
            f"`section` must be an impact section; it holds no {min(missing, default='oscillator')!r}; "
            "give what `impact_section` returned"
        )
    if real_number("tolerance", tolerance) <= 0.0:
        raise invalid("tolerance", tolerance, "a number > 0", "1e-6 is usual")
    whole_number("longest", longest, 1)


def _between_releases(time: Floats, releases: Floats, osc: ImpactOscillator) -> tuple[int, int, NDArray[np.bool_]]:
    """Return n, p, and which impacts belong to the last cycle between releases."""
    waits = np.rint(np.diff(releases) / osc.period)
    lengths = range(1, max(2, len(waits) // 2 + 1))  # a single wait is a cycle: a stick erases all memory
    q = next((q for q in lengths if (waits[q:] == waits[:-q]).all()), 0)
    if not q:
        return 0, -1, np.zeros(len(time), dtype=bool)
    between = (time > releases[-1 - q]) & (time <= releases[-1])
    # r = 0 sticks after one impact; r > 0 after infinitely many, of which the largest are recorded
    return int(waits[-q:].sum()), int(between.sum()) if osc.restitution == 0.0 else -1, between


def _from_hardest(velocity: Floats, phase: Floats) -> tuple[tuple[float, ...], tuple[float, ...]]:
    start = -int(velocity.argmax()) if len(velocity) else 0
    return tuple(np.roll(velocity, start).tolist()), tuple(np.roll(phase, start).tolist())
