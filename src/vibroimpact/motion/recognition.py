"""Recognising the motion in a sampled section: how its impacts repeat, and how perturbations grow between impacts."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vibroimpact.backends import ImpactWindow, Measurement, get_backend
from vibroimpact.cells import Floats
from vibroimpact.dataset import arguments_of, model_of, start_of
from vibroimpact.model.oscillator import ImpactOscillator
from vibroimpact.motion import NAMING, Motion, MotionClass, decide, may_wind
from vibroimpact.options import Tolerances
from vibroimpact.parameters import invalid, real_number, whole_number
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr

    from vibroimpact.model.system import ImpactSystem

UNRESOLVED = math.log(1e13)  # ln of the growth between two rests beyond which rounding decides when the second comes
PERIODS_SAME = 1e-6  # driving periods: impacts this close to the end of a cycle belong to it


def recognise(section: xr.Dataset, *, tolerance: float = 1e-6, longest: int = 64) -> Motion:
    r"""Return the motion that a settled impact section belongs to.

    A period-n impact-p motion repeats after p impacts that take n driving periods: :math:`I_{i+p} = I_i`,
    :math:`\psi_{i+p} = \psi_i`, :math:`t_{i+p} = t_i + nT` for all i, with the smallest such p. A rest at the stop
    erases all memory, so a motion that leaves the stop from rest twice repeats from one release to the next. The
    exception is growth of perturbations by more than 1e13 on the way (`resolved`): such a motion is intermittent
    sticking in this section, which the smallest disturbance may end. A motion that does not repeat is chaotic if
    perturbations grow by more than 2^53.

    For systems, impacts must repeat stop by stop. A motion that does not repeat, or that rests, is named as `classify`
    names it: since the section does not hold the coordinates, the motion is computed once more from its initial
    condition.

    Parameters
    ----------
    section : xarray.Dataset
        The result of `impact_section`: `time` in s, `phase`, `velocity` in m/s (dim `impact`), `release_time` (dim
        `stick`), `status`, and the oscillator or the system in its attributes.
    tolerance : float, > 0
        The accuracy with which impacts must repeat: velocities relative to the largest one, phases as points of the
        unit circle.
    longest : int, >= 1
        The largest number of impacts in a cycle.

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
    All of the section must repeat, or all of its second half, so that a transient slower than `transient_impacts` is
    not taken for chaos. A motion that repeats less accurately than `tolerance` does not count as repeating: close to a
    bifurcation, skip more impacts. Growth is computed for a perturbation through flights and impacts (`separations`).
    Cost: a few passes over the section for each p, and 2 microseconds per impact without a cycle.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> [recognise(vi.impact_section(vi.ImpactOscillator(omega=omega))).name for omega in (2.0, 2.8)]
    ['period-1 impact-1', 'chaotic']
    """
    _check(section, tolerance, longest)
    model: Any = model_of(section)
    status = Status(int(section["status"]))
    time, phase, velocity, releases = (section[name].values for name in ("time", "phase", "velocity", "release_time"))
    if model.forgets:
        impacts = time, phase, velocity
        return motion_of_impacts(model, status, impacts, releases, tolerance=tolerance, longest=longest)
    return _named(status, _by_states(section, model, tolerance=tolerance, longest=longest), phase, velocity)


def motion_of_impacts(
    osc: ImpactOscillator, status: Status, impacts: tuple[Floats, Floats, Floats], releases: Floats, **limits: Any
) -> Motion:
    """Return the motion of one mass as `recognise` does: from times in s, phases and velocities of settled impacts.

    `releases` are the times in s at which it leaves the stop, and `limits` those of `recurrence`.
    """
    return _named(status, _by_impacts(osc, status, impacts, releases, **limits), *impacts[1:])


def _named(status: Status, evidence: _Evidence, phase: Floats, velocity: Floats) -> Motion:
    """Return the motion that the evidence shows."""
    kind = MotionClass(int(decide(status, evidence.growth, evidence.n, evidence.p, evidence.sampled)))
    if kind not in (MotionClass.PERIODIC, MotionClass.STICKING):
        return Motion(kind.word, status=status)
    hardest_first = _from_hardest(velocity[evidence.cycle], phase[evidence.cycle])
    return Motion(kind.word, evidence.n, evidence.p, *hardest_first, status)


class _Evidence(NamedTuple):
    """The numbers that name a motion.

    n and p, 0 without a cycle; ln of the growth of perturbations over the sample; which impacts belong to the last
    cycle; and over how many impacts the motion may have been quasi-periodic.
    """

    n: int
    p: int
    growth: float
    cycle: NDArray[np.bool_]
    sampled: int = 0


def _by_impacts(
    osc: ImpactOscillator, status: Status, impacts: tuple[Floats, Floats, Floats], releases: Floats, **limits: Any
) -> _Evidence:
    """Return the numbers that name a motion from its impacts, which are its whole state."""
    time, phase, velocity = impacts
    releases = np.sort(releases[np.isfinite(releases)])
    n, p, growth, cycle = 0, 0, -math.inf, np.zeros(len(time), dtype=bool)
    if len(releases) >= 2:
        n, p, cycle = _between_releases(time, releases, osc)
        from_release = [np.append(0.0, column[cycle]) for column in (time, phase, velocity)]
        from_release[0][0] = releases[-1] - n * osc.period
        if not resolved(osc, *from_release):
            n, p = 0, -1  # intermittent: rounding decides when the mass rests again
    elif p := cycle_length(velocity, phase, **limits):
        n, growth = _whole_periods(time, p, osc.period), 0.0
        cycle[-p:] = True
    if not n and status.has_indices and status != Status.STICKING:
        growth = float(separations(osc, time, phase, velocity)[-1:].sum())
    return _Evidence(n, p, growth, cycle & (n > 0))


def _by_states(section: xr.Dataset, system: ImpactSystem, **limits: Any) -> _Evidence:
    """Return the numbers that name a system's motion; if it does not repeat, or rests, it is computed once more."""
    status, period, keep = Status(int(section["status"])), system.period, 0
    n, p, growth = *system_cycle(section, period, **limits), 0.0
    if status.has_indices and (not n or section.sizes["stick"]):
        arguments = arguments_of(section)
        keep = arguments["sample_impacts"]
        measurement = Measurement(ImpactWindow(arguments["transient_impacts"], keep), Tolerances(), indices=NAMING)
        values = get_backend("cpu").indices(system.cells({}, start_of(section)), measurement)
        growth, n, p = (values[name][0] for name in NAMING)
        growth *= keep
    turns, number = section["time"].values / period, section.sizes["impact"]
    last = np.arange(number) >= number - p if p > 0 else turns > turns[-1:] - n + PERIODS_SAME
    return _Evidence(int(n), int(p), growth, last, keep if may_wind(system) else 0)


def system_cycle(section: xr.Dataset, period: float, **limits: Any) -> tuple[int, int]:
    """Return the driving periods and impacts after which the impacts of a system repeat, stop by stop, or 0 and 0."""
    speed, phase, time, stop = (section[name].values for name in ("velocity", "phase", "time", "stop"))
    if np.isnan(phase).any():  # the model has no driving period
        return 0, 0
    p = cycle_length(speed, phase, np.unique(stop, return_inverse=True)[1].astype(float), **limits)
    n = _whole_periods(time, p, period) if p else 0
    return (n, p) if n else (0, 0)


def _whole_periods(time: Floats, p: int, period: float) -> int:
    """Return the driving periods that p impacts take in the second half; 0 if they are not always the same number."""
    settled = time[min(len(time) // 2, len(time) - p - 1) :]
    waits = np.rint((settled[p:] - settled[:-p]) / period)
    return int(waits[0]) if (waits == waits[0]).all() else 0


def recurrence(*columns: NDArray[Any], tolerance: float = 1e-6, longest: int = 64) -> int:
    """Return the fewest samples after which all columns, or their second halves, repeat; 0 if they do not.

    Each cycle must equal the last one within `tolerance`, relative to a column's largest modulus. It must also be
    closer than after any smaller number of samples, by a factor of sqrt(`tolerance`): a motion that still drifts, or
    alternates between two sides, has no cycle yet. Phases are given as points exp(2 pi i phase). Cycles longer than
    half of the samples are not found.
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
    """Return the largest distance of cycles of p samples from the last one."""
    return float(np.abs(column[len(column) % p :].reshape(-1, p) - column[-p:]).max())


def cycle_length(velocity: Floats, phase: Floats, *stops: Floats, **limits: Any) -> int:
    """Return the fewest impacts after which velocities and phases (and numbers of stops, if given) repeat, or 0.

    `limits` are those of `recurrence`.
    """
    return recurrence(velocity, np.exp(2j * np.pi * phase), *stops, **limits)


def _check(section: xr.Dataset, tolerance: float, longest: int) -> None:
    variables = map(str, getattr(section, "variables", ()))
    of_systems = {"stop"} if "system" in getattr(section, "attrs", {}) else set()
    missing = ({"time", "phase", "velocity", "release_time", "status"} | of_systems).difference(variables)
    if missing or not {"oscillator", "system"} & set(section.attrs):
        raise ValueError(
            f"`section` must be an impact section; it holds no {min(missing, default='oscillator')!r}; "
            "give the result of `impact_section`"
        )
    if real_number("tolerance", tolerance) <= 0.0:
        raise invalid("tolerance", tolerance, "a number > 0", "1e-6 is usual")
    whole_number("longest", longest, 1)


def _between_releases(time: Floats, releases: Floats, osc: ImpactOscillator) -> tuple[int, int, NDArray[np.bool_]]:
    """Return n, p, and which impacts belong to the last cycle between releases."""
    waits = np.rint(np.diff(releases) / osc.period)
    lengths = range(1, max(2, len(waits) // 2 + 1))  # a single wait is a cycle: a rest at the stop erases all memory
    q = next((q for q in lengths if (waits[q:] == waits[:-q]).all()), 0)
    if not q:
        return 0, -1, np.zeros(len(time), dtype=bool)
    between = (time > releases[-1 - q]) & (time <= releases[-1])
    # r = 0 sticks after one impact; r > 0 after infinitely many, of which the largest are recorded
    return int(waits[-q:].sum()), int(between.sum()) if osc.restitution == 0.0 else -1, between


def _from_hardest(velocity: Floats, phase: Floats) -> tuple[tuple[float, ...], tuple[float, ...]]:
    start = -int(velocity.argmax()) if len(velocity) else 0
    return tuple(np.roll(velocity, start).tolist()), tuple(np.roll(phase, start).tolist())


def separations(osc: ImpactOscillator, time: Floats, phase: Floats, velocity: Floats) -> Floats:
    r"""Return ln of the growth of a perturbation since the first of some impacts, after each later one.

    A perturbation :math:`(\delta y, \delta\dot y)` obeys the homogeneous equation in flight. At an impact with speed v
    before it and accelerations :math:`a_-, a_+` before and after, it obeys the saltation (theory, equation 5.1; P. C.
    Müller, Chaos, Solitons & Fractals 5, 1671 (1995), for exponents of systems with jumps)

    .. math:: \delta y \to -r\,\delta y, \qquad
              \delta\dot y \to \frac{a_+ + r a_-}{v}\,\delta y - r\,\delta\dot y.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> osc = vi.ImpactOscillator(omega=2.8)
    >>> hits = vi.impact_section(osc, sample_impacts=1000)
    >>> grown = separations(osc, hits.time.values, hits.phase.values, hits.velocity.values)
    >>> round(float(grown[-1]) / 999, 2)  # the exponent per impact of `parameter_map`
    0.28
    """
    grown: list[float] = []
    total, scale = 0.0, osc.natural_frequency
    y, rate = 1.0, scale
    for a, b, d, e in _across(osc, time, phase, velocity):
        y, rate = a * y + b * rate, d * y + e * rate
        size = math.hypot(y * scale, rate)
        if not size:  # the perturbation has become zero
            return np.array([*grown, -math.inf])
        total += math.log(size)
        grown.append(total)
        y, rate = y / size, rate / size
    return np.array(grown)


def resolved(osc: ImpactOscillator, time: Floats, phase: Floats, velocity: Floats) -> bool:
    """Return whether double precision resolves the motion from a release, the first row, through impacts to the next.

    It does unless perturbations grow by 1e13 between any two of the times: beyond that, rounding decides when the mass
    rests again, and the motion is not an orbit of the oscillator. As in `describe_turn` of the kernels, perturbations
    begin as (1, 0.7) in units of a step's length and speed, and begin again when they become smaller than that.
    """
    from vibroimpact.kernels.flight import REACH  # slower to import

    step = REACH / float(osc.cells({}).fastest_rate[0])
    begin = 1.0, 0.7
    (y, rate), whole = begin, sum(begin)
    for a, b, d, e in _across(osc, time, phase, velocity):
        y, rate = a * y + b * rate / step, step * d * y + e * rate
        size = abs(y) + abs(rate)
        if size >= math.exp(UNRESOLVED) * whole:
            return False
        if size < whole:
            y, rate = begin
    return True


def _across(
    osc: ImpactOscillator, time: Floats, phase: Floats, velocity: Floats
) -> Iterator[tuple[float, float, float, float]]:
    """Yield the matrices that carry a perturbation from just after one impact to just after the next, by rows."""
    m, c, k, r = osc.mass, osc.damping, osc.stiffness, osc.restitution
    half, flight, speed = 0.5 * c / m, np.diff(time), velocity[1:]
    root = np.sqrt(complex(k / m - half * half))  # imaginary above critical damping
    damped = np.exp(-half * flight)
    cosine = damped * np.cos(root * flight).real
    sine = damped * ((np.sin(root * flight) / root).real if root else flight)
    force = (osc.amplitude * np.sin(2.0 * np.pi * phase[1:]) - k * osc.gap) / m
    salt = ((force + r * c / m * speed) + r * (force - c / m * speed)) / speed
    columns = cosine + half * sine, sine, -k / m * sine, cosine - half * sine, salt
    for a, b, d, e, kick in zip(*(column.tolist() for column in columns), strict=True):  # numbers of Python are faster
        yield -r * a, -r * b, kick * a - r * d, kick * b - r * e
