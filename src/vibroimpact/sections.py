"""One orbit at its impacts and once per driving period; how a back end follows it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from vibroimpact.backends import (
    Backend,
    ImpactWindow,
    Measurement,
    StroboscopicWindow,
    TimesWindow,
    Window,
    check_takes,
    get_backend,
)
from vibroimpact.backends.effects import States
from vibroimpact.backends.rests import rest_impulses
from vibroimpact.cells import Floats
from vibroimpact.dataset import dataset_of, provenance, status_variable, variable
from vibroimpact.labels import in_seconds, labelled_impacts, of_one_mass, trajectory_of
from vibroimpact.model import Model, State, as_system, check_model, one_start
from vibroimpact.options import Sampling, Tolerances
from vibroimpact.parameters import STEPS, check_fits, check_steps, counted, hertz, invalid, phase_number
from vibroimpact.progress import reporter
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr

ROW = 200  # bytes of memory per sample while it is labelled


@dataclass(frozen=True)
class Followed:
    """One orbit of a model, followed by a back end."""

    model: Model
    start: State | None
    backend: str
    time_step: float | None
    tolerances: Tolerances | None

    @cached_property
    def engine(self) -> Backend:
        """The back end, made once."""
        return get_backend(self.backend, time_step=self.time_step)

    @cached_property
    def design(self) -> Any:
        """The oscillator or the system of the model."""
        check_model(self.model)
        return self.model.at()

    @property
    def begin(self) -> float:
        """The time of the initial condition in s."""
        start = one_start(self.start)
        return 0.0 if start is None else start.time

    @property
    def cells(self) -> Any:
        """The design with its initial condition, as a table of one cell."""
        return self.model.cells({}, one_start(self.start))

    def samples(self, window: Window) -> Any:
        """Return the samples in a window."""
        return self.samples_of(self.design, self.cells, window)

    def samples_of(self, design: Any, cells: Any, window: Window) -> Any:
        """Return the samples of one cell of a design in a window."""
        check_takes(self.engine, design)
        self.check_cost(window)
        if isinstance(window, TimesWindow):
            steps = window.length * design.period * float(cells.fastest_rate[0])
            check_steps("times", "needs", steps, "end sooner")
        with reporter(None, "motion"):
            (samples,) = self.engine.samples(cells, Measurement(window, Tolerances.of(self.tolerances)))
        return of_any_length(samples, design)

    def states(self, design: Any, cells: Any, begin: float, length: float) -> States:
        """Return the function that follows one cell again, from `begin` in s, for its states at other times.

        `length`, in driving periods or impacts, is that of the first run, by which steps are granted.
        """

        def states(turns: Floats) -> tuple[Floats, Floats]:
            window = replace(TimesWindow.of(turns, hertz(begin * design.omega)), length=length)
            (found,) = self.engine.samples(cells, Measurement(window, Tolerances.of(self.tolerances)))
            lost = (0, len(turns) - len(found.look_phase)), (0, 0)  # after the end of a motion that ended early
            q, v = found.look_displacement, found.look_velocity
            return np.pad(q, lost, constant_values=np.nan), np.pad(v, lost, constant_values=np.nan)

        return states

    def rest_impulses(self, samples: Any, window: Window, skips: bool = True) -> Floats:
        """Return the impulse in N s of each rest in the samples in a window, within their time.

        If it `skips` nothing, what comes before the first sample counts.
        """
        if isinstance(window, ImpactWindow):
            times, length = samples.impact_turns, float(window.transient + window.keep)
        else:
            times, length = samples.look_turns, window.length
        first, last = (float(times[0]), float(times[-1])) if len(times) else (math.inf, -math.inf)
        states = self.states(self.design, self.cells, self.begin, length)
        return rest_impulses(as_system(self.design), samples, first if skips else -math.inf, last, states)

    def check_cost(self, window: Window) -> None:
        """Raise if memory cannot hold the samples, or if fixed steps would take too long."""
        rows = f"needs {window.keep:.3g} rows, which take"
        if isinstance(window, ImpactWindow):
            name, periods = "sample_impacts", float(window.transient + window.keep)  # about one per impact
        else:
            name, periods = "samples_per_period", window.length
            if isinstance(window, TimesWindow):
                name = "times"
            elif window.per_period == 1:
                name = "sample_periods"
        check_fits(name, rows, ROW * window.keep, "choose fewer")
        length = periods * self.design.period
        if self.time_step is not None and length > STEPS * self.time_step:
            hint = f"that is {length / self.time_step:.2g} steps"
            raise invalid("time_step", self.time_step, "larger, or the motion shorter", hint)

    def provenance(self, function: str, **how: Any) -> dict[str, str]:
        """Return the attributes that record how a result was made."""
        common = {"backend": self.engine.sampler, "time_step": self.time_step}
        return provenance(function, self.model, {"start": self.start, **how, **common})


def of_any_length(samples: Any, design: Any) -> Any:
    """Return samples that are not called short for their driving periods if the design has none."""
    if samples.status != Status.SHORT_WINDOW or design.periodic:
        return samples
    return replace(samples, status=int(Status.STICKING if len(samples.rest_begin) else Status.OK))


def check_periodic(design: Any, hint: str) -> None:
    """Raise unless a design has a driving period."""
    if not design.periodic:
        raise ValueError(f"{design!s} has no driving period, since its force has no frequency; {hint}")


def measure_orbit(
    osc: Model,
    *,
    start: State | None = None,
    indices: tuple[str, ...],
    transient_impacts: int,
    sample_impacts: int,
    periods: int,
    samples_per_period: int,
    tolerances: Tolerances,
    patience: Tolerances,
) -> tuple[dict[str, float], dict[str, Floats], int]:
    """Return the indices and the status of one orbit, and all data for a picture of it, from one run.

    The indices equal those of `parameter_map` bit for bit, within `tolerances`; a system is run twice. The orbit is
    followed for `periods` driving periods within `patience`; it contains the result of `simulate`, and `impact_phase`
    in [0, 1). Its samples lie at multiples of 1 / `samples_per_period` of phase, the first of them at or just after the
    initial condition. The number of the first sample of phase 0, on the stroboscopic section, is the third result.
    """
    cell: Any = osc.cells({}, one_start(start))
    design, engine = osc.at(), get_backend("cpu")
    begin = float(cell.phases[0])
    first = math.ceil(begin * samples_per_period)
    first += first / samples_per_period < begin
    phase = (first % samples_per_period) / samples_per_period
    impacts = ImpactWindow(transient_impacts, sample_impacts)
    window = StroboscopicWindow(0, periods * samples_per_period, phase, samples_per_period)
    measure, record = Measurement(impacts, tolerances, indices=indices), Measurement(window, patience)
    measured, samples = engine.follow(cell, measure, record)
    numbers = {name: float(measured[name][0]) for name in (*indices, "status")}
    recorded = {name: values.values for name, values in trajectory_of(samples, design).items()}
    return numbers, recorded | {"impact_phase": samples.impact_phase}, -first % samples_per_period


def impact_section(
    osc: Model,
    *,
    start: State | None = None,
    transient_impacts: int = 100,
    sample_impacts: int = 5000,
    backend: str = "cpu",
    time_step: float | None = None,
    tolerances: Tolerances | None = None,
) -> xr.Dataset:
    """Return the impacts of a settled motion: their times, phases and velocities (the paper's impact map).

    Parameters
    ----------
    osc, start, backend, time_step, tolerances
        As in `simulate`.
    transient_impacts, sample_impacts : int, >= 0 and >= 1
        Impacts to skip, then to keep.

    Returns
    -------
    xarray.Dataset
        `time` in s, `phase` (t mod T)/T in [0, 1), NaN for a model without a driving period, `velocity` in m/s just
        before contact, > 0, `impulse` in N s, `energy_lost` in J, `exit_velocity` in m/s (dim `impact`, fewer rows if
        impacts cease); `stick_time`, `release_time` and `stick_impulse` in N s (dim `stick`) from the first to the last
        of them; `status`. Systems have more columns, as in `simulate`.

    Raises
    ------
    ValueError
        An argument is out of range, or the initial condition lies beyond the stop.

    Notes
    -----
    Each impact is exact to rounding and to the growth of errors along the orbit. Time: about 0.7 microseconds per
    impact.

    References
    ----------
    .. [1] J.-Y. Lee, section 2: the point set (y'(t_impact), psi_impact).

    Examples
    --------
    >>> from vibroimpact import ImpactOscillator
    >>> hits = impact_section(ImpactOscillator(omega=2.0), sample_impacts=3)
    >>> [round(float(v), 6) for v in hits.velocity]
    [6.226413, 6.226413, 6.226413]
    """
    orbit = Followed(osc, start, backend, time_step, tolerances)
    sampling = Sampling(transient_impacts=transient_impacts, sample_impacts=sample_impacts)
    window = ImpactWindow(sampling.transient_impacts, sampling.sample_impacts)
    samples = orbit.samples(window)
    how = orbit.provenance("impact_section", transient_impacts=window.transient, sample_impacts=window.keep)
    return labelled_impacts(samples, orbit.design, how, orbit.rest_impulses(samples, window))


def stroboscopic_section(
    osc: Model,
    *,
    start: State | None = None,
    phase: float = 0.0,
    transient_periods: int = 200,
    sample_periods: int = 500,
    backend: str = "cpu",
    time_step: float | None = None,
    tolerances: Tolerances | None = None,
) -> xr.Dataset:
    """Return the state once per driving period, always at the same phase (the paper's Poincare map).

    Parameters
    ----------
    osc, start, backend, time_step, tolerances
        As in `simulate`.
    phase : float, 0 <= phase < 1
        Phase of the section, (t mod T)/T.
    transient_periods, sample_periods : int, >= 0 and >= 1
        Driving periods to skip, then to keep.

    Returns
    -------
    xarray.Dataset
        `time` in s, `displacement` in m, `velocity` in m/s (dim `period`); `status`. At the instant of an impact, the
        velocity is the one after it.

    Raises
    ------
    ValueError
        An argument is out of range, or the initial condition lies beyond the stop.

    Notes
    -----
    The section does not affect the motion: the orbit's impacts are bit for bit the same with and without it.

    References
    ----------
    .. [1] J.-Y. Lee, section 2: the point set (y, y') at t modulo T.

    Examples
    --------
    >>> from vibroimpact import ImpactOscillator
    >>> looks = stroboscopic_section(ImpactOscillator(omega=4.0), sample_periods=4)
    >>> len(set(looks.displacement.values.round(9)))  # period-2
    2
    """
    orbit = Followed(osc, start, backend, time_step, tolerances)
    sampling = Sampling(transient_periods=transient_periods, sample_periods=sample_periods)
    check_periodic(orbit.design, "use simulate or impact_section")
    window = StroboscopicWindow(sampling.transient_periods, sampling.sample_periods, phase_number("phase", phase))
    samples = orbit.samples(window)
    looks = {
        "time": variable("time", "period", in_seconds(orbit.design, samples.look_periods, samples.look_phase)),
        "displacement": variable("displacement", ("period", "coordinate"), samples.look_displacement),
        "velocity": variable("velocity", ("period", "coordinate"), samples.look_velocity),
        "status": status_variable((), samples.status),
    }
    return dataset_of(
        of_one_mass(looks, orbit.design),
        attrs=orbit.provenance(
            "stroboscopic_section",
            phase=window.phase,
            transient_periods=window.skip_periods,
            sample_periods=window.keep,
        ),
    )


def impact_map(
    osc: Model, *, backend: str = "cpu", time_step: float | None = None, tolerances: Tolerances | None = None
) -> Callable[[ArrayLike, ArrayLike], tuple[Floats, Floats]]:
    """Return the map from one impact to the next as a function of phase and velocity.

    Parameters
    ----------
    osc, backend, time_step, tolerances
        As in `simulate`; one coordinate and one stop, so that phase and velocity are the whole state.

    Returns
    -------
    callable
        Takes phases in [0, 1) and velocities > 0 in m/s just before contact, numbers or arrays of equal shape, and
        returns those of the next recorded impact, in the same shape; NaN if none follows. A complete chatter is passed
        over: the next impact is the first one after the release.

    Raises
    ------
    ValueError
        The model has several coordinates or stops, or a phase or velocity is out of range.

    Notes
    -----
    Exact to rounding. With a fixed rigid stop, its Jacobian has the determinant r^2 (v0/v1) exp(-c tau/m) and is
    singular if the next impact is a graze. Time: some microseconds per impact; a tenth of that for many at once.

    Examples
    --------
    >>> from vibroimpact import ImpactOscillator
    >>> following = impact_map(ImpactOscillator(omega=2.0))
    >>> phase, velocity = 0.3, 5.0
    >>> for _ in range(2000):
    ...     phase, velocity = following(phase, velocity)
    >>> round(float(velocity), 9)
    6.226413477
    """
    check_model(osc)
    design = osc.at()
    if (design.coordinates, len(design.stops)) != (1, 1):
        has = f"{counted(design.coordinates, 'coordinate')} and {counted(len(design.stops), 'stop')}"
        raise ValueError(
            "`osc` must have one coordinate and one stop, so that phase and velocity of an impact are the whole state; "
            f"{design!s} has {has}; use impact_section"
        )
    engine = get_backend(backend, time_step=time_step)
    check_takes(engine, design)
    measurement = Measurement(ImpactWindow(0, 2), Tolerances.of(tolerances))

    def following(phase: ArrayLike, velocity: ArrayLike) -> tuple[Floats, Floats]:
        try:
            phases, velocities = np.broadcast_arrays(np.asarray(phase, float), np.asarray(velocity, float))
        except (TypeError, ValueError, OverflowError) as error:
            raise ValueError(f"`phase` and `velocity` must be numbers, or arrays of equal shape: {error}") from error
        if not phases.size:
            return phases, velocities
        if not ((phases >= 0.0) & (phases < 1.0)).all():
            raise invalid("phase", phase, "at least 0 and less than 1")
        if not ((velocities > 0.0) & np.isfinite(velocities)).all():
            raise invalid("velocity", velocity, "finite and > 0")
        first = np.zeros(phases.size, np.int64)  # the only cell, and its only stop
        cells = design.cells({})[first].striking(first, velocities.ravel(), phases.ravel())
        images = np.full((2, phases.size), np.nan)
        for at, samples in enumerate(engine.samples(cells, measurement)):
            # The given impact is recorded too, both numbers to rounding, unless it is too weak.
            skipped = int(
                len(samples.impact_phase) > 0
                and math.isclose(samples.impact_turns[0], phases.flat[at], abs_tol=1e-12)
                and math.isclose(samples.impact_velocity[0], velocities.flat[at], rel_tol=1e-12)
            )
            if len(samples.impact_phase) > skipped:
                images[:, at] = samples.impact_phase[skipped], samples.impact_velocity[skipped]
        return images[0].reshape(phases.shape), images[1].reshape(phases.shape)

    return following
