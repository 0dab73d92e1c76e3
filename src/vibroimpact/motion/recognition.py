"""Recognise a motion from the recurrence of its impacts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.dataset import oscillator_of
from vibroimpact.motion.kinds import Motion, MotionClass, decide
from vibroimpact.oscillator import ImpactOscillator
from vibroimpact.parameters import invalid, real_number, whole_number
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr

Floats = NDArray[np.float64]
UNRESOLVED = math.log(1e13)  # ln of the growth between two rests from which on rounding decides when the second comes


def recognise(section: xr.Dataset, *, tolerance: float = 1e-6, longest: int = 64) -> Motion:
    r"""Return the motion that a settled impact section belongs to.

    A period-n impact-p motion repeats after p impacts that take n driving periods:
    :math:`I_{i+p} = I_i`, :math:`\psi_{i+p} = \psi_i`, :math:`t_{i+p} = t_i + nT` for all i, with the
    smallest such p. A stick erases all memory, so a motion that leaves the stop from rest twice repeats
    from one release to the next, unless neighbours part by more than 1e13 on the way. What does not repeat is
    chaotic if neighbours part by more than 2^53 over its impacts.

    Parameters
    ----------
    section : xarray.Dataset
        What `impact_section` returned: `time` in s, `phase`, `velocity` in m/s (dim `impact`), `release_time`
        (dim `stick`), `status`, and the oscillator in its attributes.
    tolerance : float, > 0
        How well impacts must repeat, relative to the section's largest velocity; phases are compared as
        points on the unit circle.
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
        if separations(osc, *from_release).max(initial=0.0) > UNRESOLVED:
            n, p = 0, -1  # intermittent: rounding decides when the mass rests again
    elif p := cycle_length(velocity, phase, tolerance=tolerance, longest=longest):
        n, growth = _whole_periods(time[len(time) // 2 :], p, osc.period), 0.0
        cycle[-p:] = True
    if not n and status.has_indices and status != Status.STICKING:
        growth = float(separations(osc, time, phase, velocity)[-1:].sum())
    kind = MotionClass(int(decide(status, growth, n, p)))
    if kind not in (MotionClass.PERIODIC, MotionClass.STICKING):
        return Motion(kind.word, status=status)
    impacts = _from_hardest(velocity[cycle], phase[cycle]) if n else ((), ())
    return Motion(kind.word, n, p, *impacts, status)


def separations(osc: ImpactOscillator, time: Floats, phase: Floats, velocity: Floats) -> Floats:
    r"""Return ln of the factor by which neighbours have parted since the first of some impacts, after each later one.

    A deviation :math:`(\delta y, \delta\dot y)` obeys the homogeneous equation in flight; at an impact with speed v
    before it and accelerations :math:`a_-, a_+` before and after, it takes the saltation
    (P. C. Mueller, Chaos, Solitons & Fractals 5, 1671 (1995), for exponents of systems with jumps)

    .. math:: \delta y \to -r\,\delta y, \qquad
              \delta\dot y \to \frac{a_+ + r a_-}{v}\,\delta y - r\,\delta\dot y.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> osc = vi.ImpactOscillator(omega=2.8)
    >>> hits = vi.impact_section(osc, sample_impacts=1000)
    >>> grown = separations(osc, hits.time.values, hits.phase.values, hits.velocity.values)
    >>> sweep = vi.parameter_map(osc, omega=[2.8], sample_impacts=1000, indices=["lyapunov_per_impact"])
    >>> round(float(grown[-1]) / 999, 2), round(float(sweep["lyapunov_per_impact"][0]), 2)
    (0.33, 0.33)
    """
    m, c, k, r = osc.mass, osc.damping, osc.stiffness, osc.restitution
    half, flight, speed = 0.5 * c / m, np.diff(time), velocity[1:]
    root = np.sqrt(complex(k / m - half * half))  # imaginary beyond critical damping
    damped = np.exp(-half * flight)
    cosine = damped * np.cos(root * flight).real
    sine = damped * ((np.sin(root * flight) / root).real if root else flight)
    force = (osc.amplitude * np.sin(2.0 * np.pi * phase[1:]) - k * osc.gap) / m
    salt = ((force + r * c / m * speed) + r * (force - c / m * speed)) / speed
    rows = zip(cosine + half * sine, sine, -k / m * sine, cosine - half * sine, salt, strict=True)
    grown: list[float] = []
    total, scale = 0.0, osc.natural_frequency
    y, rate = 1.0, scale
    for a, b, d, e, kick in rows:
        y, rate = a * y + b * rate, d * y + e * rate
        y, rate = -r * y, kick * y - r * rate
        size = math.hypot(y * scale, rate)
        if not size:  # nothing is left of the deviation
            return np.array([*grown, -math.inf])
        total += math.log(size)
        grown.append(total)
        y, rate = y / size, rate / size
    return np.array(grown)


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
            continue  # the first pair rules most candidates out
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
            f"`section` must be an impact section; it holds no {min(missing, default='oscillator')!r}; "
            "give what `impact_section` returned"
        )
    if real_number("tolerance", tolerance) <= 0.0:
        raise invalid("tolerance", tolerance, "a number > 0", "1e-6 is usual")
    whole_number("longest", longest, 1)


def _whole_periods(time: Floats, p: int, period: float) -> int:
    """Return the driving periods that every p impacts take, or 0 if they do not agree."""
    counts = np.rint((time[p:] - time[:-p]) / period)
    return int(counts[0]) if (counts == counts[0]).all() else 0


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
    if len(velocity) == 0:
        return (), ()
    start = -int(velocity.argmax())
    return tuple(np.roll(velocity, start).tolist()), tuple(np.roll(phase, start).tolist())
