"""One motion in time: over driving periods, over seconds, at given times, or under a load in pieces."""

from __future__ import annotations

import math
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from vibroimpact.backends import LooksWindow, StroboscopicWindow, TimesWindow
from vibroimpact.cells import Floats
from vibroimpact.dataset import dataset_of, status_variable
from vibroimpact.labels import in_seconds, taken_by_stops, trajectory_of
from vibroimpact.matrices import numbers
from vibroimpact.model import Model, State, one_start
from vibroimpact.options import Tolerances
from vibroimpact.parameters import COUNTS, check_one, hertz, invalid, positive_number, whole_number
from vibroimpact.sections import Followed, check_periodic
from vibroimpact.simulation.loads import Pieces, as_given

if TYPE_CHECKING:
    import xarray as xr

    from vibroimpact.model.force import Force

USUAL = 20  # driving periods
EVEN = 4000  # intervals between samples where no period sets them
ROUNDING = 1e-9  # of an interval between samples
SAME = 4.0 * np.finfo(np.float64).eps  # relative: times that are so near are the same


def simulate(
    osc: Model,
    *,
    start: State | None = None,
    periods: float | None = None,
    duration: float | None = None,
    times: ArrayLike | None = None,
    pieces: list[tuple[float, Force | None]] | None = None,
    skip_periods: int = 0,
    samples_per_period: int = 200,
    backend: str = "cpu",
    time_step: float | None = None,
    tolerances: Tolerances | None = None,
) -> xr.Dataset:
    r"""Follow the motion from an initial condition for some time.

    .. math:: m \ddot y + c \dot y + k y = f \sin \omega t \quad (y < g), \qquad
              \dot y \to -r \dot y \quad (y = g,\ \dot y > 0)

    Parameters
    ----------
    osc : ImpactOscillator, ImpactSystem or family
        The design.
    start : State, optional
        Initial condition; None means at rest at min(0, gap) at time 0.
    periods : float, > 0, optional
        The length of the motion, in driving periods T = 2 pi / omega; 20 if no length is given.
    duration : float, > 0, optional
        The length of the motion in s, instead of `periods`. The last sample is at its end.
    times : sequence of float, optional
        The times of the samples in s, ascending, evenly spaced or not, from the time of `start` on; instead of
        `periods`. The motion ends at the last one. For the dimensionless oscillator they are dimensionless.
    pieces : list of (float, Force or None), optional
        A load in pieces: the duration of each in s, > 0, and its force, which replaces that of the model. Instead of
        `periods`; sampled at 4001 instants or more, or at `times`.
    skip_periods : int, >= 0
        Driving periods to skip first.
    samples_per_period : int, >= 1
        Samples of displacement and velocity per period; impacts are exact whatever this is.
    backend : str
        Name of the back end; `time_step` in s is for "fixed-step" only.
    tolerances : Tolerances, optional
        Numerical tolerances; `chatter` sets which impacts are too weak to be recorded.

    Returns
    -------
    xarray.Dataset
        `displacement` in m and `velocity` in m/s over `time` in s; `impact_time`, `impact_velocity` (dim `impact`, the
        speed just before contact); `stick_time`, `release_time` (dim `stick`, NaN if the mass has not left yet);
        `force` of the stop in N over `time`, while the mass rests at it or penetrates it; `impulse` in N s and
        `energy_lost` in J of each impact, and `exit_velocity` in m/s, the speed of separation; `stick_impulse` in N s
        of each rest, within the time of the samples; `status`. At the instant of an impact, the velocity is the one
        after it, and `force` does not include it. Systems have `clearance` and `force` by `stop`, the stop of each
        impact and rest, and for compliant stops `peak_force`, `penetration`, the times of both, `contact_time` and
        `exit_time`.

    Raises
    ------
    ValueError
        An argument is out of range, the initial condition lies beyond the stop, two lengths are given, or none for a
        model without a driving period.

    Notes
    -----
    Flights are exact power series, and contacts are certified and found to rounding; errors grow along the orbit only
    as perturbations of the motion do. Time: about 0.7 microseconds per impact, plus a third of a microsecond per
    sample; one mass with a rigid stop takes 20 microseconds per sample at `times` that are not whole fractions of the
    period.

    A model without a driving period (`Force` without a frequency, or no force) needs `duration`, which is sampled at
    4001 instants, or `times`.

    Each force of `pieces` is a function of the time t, not of the time since the piece began: a sine goes on from one
    piece to the next. A force without a frequency keeps that of the model, which moving stops need. The state, impacts,
    contacts and rests go on from piece to piece; a contact that a switch divides is one contact.

    Impulses of rests and of divided contacts are integrated to 1e-10 from exact states. For these and for the times of
    contacts, systems of several coordinates or with compliant stops are followed again, which takes some 0.1 ms per
    contact. The numbers of a divided contact are NaN if it lasts longer than 20,000 rad of the fastest rate.

    References
    ----------
    .. [1] J.-Y. Lee, "Numerical Analysis of Impact Vibration Based on a Bifurcation Diagram With Two Varying
       Control Parameters", eq. (1); its `k y'` is a misprint for `k y`.

    Examples
    --------
    >>> from vibroimpact import Force, ImpactOscillator, ImpactSystem, Stop
    >>> orbit = simulate(ImpactOscillator(omega=2.0), periods=3)
    >>> orbit.sizes["time"]
    601
    >>> bool((orbit.displacement <= 0).all())
    True

    A ball that falls 1 m and bounces, at three instants:

    >>> ground = Stop(direction=-1.0, gap=1.0, restitution=0.5)
    >>> ball = ImpactSystem(mass=1.0, stiffness=0.0, force=Force(constant=-2.0), stops=[ground])
    >>> fall = simulate(ball, times=[0.0, 0.5, 2.0])
    >>> fall.displacement.values[:, 0].tolist(), fall.impact_time.values.round(9).tolist()
    ([0.0, -0.25, -1.0], [1.0, 2.0])

    A square pulse of 2 N for 0.5 s on a mass at rest:

    >>> mass = ImpactSystem(mass=1.0, stiffness=0.0)
    >>> pushed = simulate(mass, pieces=[(0.5, Force(constant=2.0)), (1.0, None)], times=[0.5, 1.5])
    >>> pushed.displacement.values[:, 0].tolist()
    [0.25, 1.25]
    """
    run = Followed(osc, one_start(start), backend, time_step, tolerances)
    design, given = run.design, {"periods": periods, "duration": duration, "times": times, "pieces": pieces}
    for name, other in combinations(given, 2):
        if (name, other) != ("times", "pieces"):
            check_one(name, given[name], other, given[other])
    how: dict[str, Any] = {
        "skip_periods": whole_number("skip_periods", skip_periods, 0),
        "samples_per_period": whole_number("samples_per_period", samples_per_period, 1),
    }
    if skip_periods and not (design.periodic and times is None and pieces is None):
        allowed = "0 with `times` or `pieces`" if design.periodic else "0 for a model without a driving period"
        raise invalid("skip_periods", skip_periods, allowed)
    loads = None if pieces is None else Pieces.of(design, pieces, run.begin)
    if times is not None:
        seconds = _checked(times, run.begin, math.inf if loads is None else loads.ends[-1])
        window, how = _window_at(seconds, run), {"times": len(seconds)}
    elif duration is None and loads is None:
        length = USUAL if periods is None else positive_number("periods", periods)
        window, how = _over_periods(length, design, **how), {"periods": length, **how}
    else:
        length = positive_number("duration", duration) if loads is None else loads.ends[-1] - run.begin
        if loads is not None:  # the load of the model, whose period it is, may not act at all
            how["samples_per_period"] = max(how["samples_per_period"], math.ceil(EVEN * design.period / length))
        window, how = _over_seconds(length, run, **how), {"duration": length, **how}
    if loads is not None:
        attrs = run.provenance("simulate", **how, pieces=loads.plain())
        looks = np.minimum(_seconds_of(window, run), loads.ends[-1]) if times is None else seconds  # rounded up else
        variables = loads.follow(run, looks)
    else:
        samples, attrs = run.samples(window), run.provenance("simulate", **how)
        variables = trajectory_of(samples, design)
        variables |= taken_by_stops(samples, design, run.rest_impulses(samples, window, bool(skip_periods)))
        variables["status"] = status_variable((), samples.status)
        if times is not None:
            variables["time"] = variables["time"].copy(data=as_given(variables["time"].values, seconds))
    coords = {"time": variables.pop("time")}
    motion = dataset_of(variables, coords, attrs)
    return _since(motion, motion["time"].values[:1]) if skip_periods else motion


def _checked(times: Any, first: float, last: float) -> Floats:
    """Return times in s as an array, after checking it."""
    seconds: Floats = np.atleast_1d(numbers("times", times, 1))
    at = int(np.argmin(np.diff(seconds, prepend=-math.inf)))
    if at and not seconds[at] > seconds[at - 1]:
        follows = "again" if seconds[at] == seconds[at - 1] else f"{seconds[at]:g} s"
        raise ValueError(f"`times` must increase, got {seconds[at - 1]:g} s, then {follows}; sort them, each once")
    if not first <= seconds[0] * (1.0 + SAME * np.sign(seconds[0])):
        raise ValueError(
            f"`times` must not lie before the initial condition, at {first:g} s, got {seconds[0]:g} s; "
            "State(..., time=...) sets its time"
        )
    if not seconds[-1] <= last * (1.0 + SAME):
        raise ValueError(f"`times` must not lie after the end of `pieces`, at {last:g} s, got {seconds[-1]:g} s")
    return np.clip(seconds, first, last)


def _over_periods(length: float, design: Any, skip_periods: int, samples_per_period: int) -> StroboscopicWindow:
    """Return the window of evenly spaced samples over a number of driving periods."""
    check_periodic(design, "give `duration` (s) or `times`")
    number = int(np.floor(length * samples_per_period + ROUNDING)) + 1
    return StroboscopicWindow(skip_periods, number, None, samples_per_period)


def _over_seconds(length: float, run: Followed, skip_periods: int, samples_per_period: int) -> LooksWindow:
    """Return the window of evenly spaced samples over a time in s, with one at its end."""
    design = run.design
    if not design.periodic:
        return _window_at(run.begin + np.linspace(0.0, length, EVEN + 1), run)
    window = _over_periods(length / design.period, design, skip_periods, samples_per_period)
    run.check_cost(window)
    seconds = _seconds_of(window, run)
    end = seconds[0] + length
    if end - seconds[-1] <= ROUNDING * design.period / samples_per_period:
        return window
    return _window_at(np.append(seconds, end), run)


def _window_at(seconds: Floats, run: Followed) -> LooksWindow:
    """Return the window of samples at times in s; if whole fractions of the period separate them, that of periods."""
    turns = (seconds - run.begin) / run.design.period
    whole, steps = round(float(turns[0])), max(len(turns) - 1, 1)
    per_period = round(steps / float(turns[-1] - turns[0])) if turns[-1] > turns[0] else 1
    if 0 < per_period <= COUNTS and whole <= COUNTS:
        even = StroboscopicWindow(whole, len(turns), None, per_period)
        if np.allclose(_seconds_of(even, run), seconds, rtol=SAME, atol=0.0):
            return even
    return TimesWindow.of(hertz(seconds * run.design.omega), hertz(run.begin * run.design.omega))


def _seconds_of(window: LooksWindow, run: Followed) -> Floats:
    """Return the times of the samples of a window in s."""
    start = hertz(run.begin * run.design.omega)
    seconds: Floats = in_seconds(run.design, *window.schedule(math.floor(start), start - math.floor(start)))
    return seconds


def _since(motion: xr.Dataset, first: Floats) -> xr.Dataset:
    """Return a motion without the impacts and sticks that ended before its first sample."""
    over = {"impact": motion["impact_time"].values}
    if "release_time" in motion:
        over["stick"] = np.nan_to_num(motion["release_time"].values, nan=np.inf)
    return motion.isel({dim: ends >= first if len(first) else ends < 0.0 for dim, ends in over.items()})
