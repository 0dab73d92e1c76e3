"""The attractors of an oscillator, and their basins: which initial conditions lead to each."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from vibroimpact.backends import Cells, ImpactWindow, StroboscopicWindow
from vibroimpact.cells import Floats
from vibroimpact.coexistence.attractor import DIM, STATISTICS, Attractor, Basin, attractor_variables, distinct, match
from vibroimpact.coexistence.measuring import (
    SPREAD,
    Measured,
    Runner,
    carried,
    indices_of_cycle,
    orbit_cells,
    spread_cells,
    state_cells,
    warn_of_cost,
)
from vibroimpact.coexistence.planes import Plane, plane_of
from vibroimpact.coexistence.settling import SAMPLING, Settled, Settling, outlook_from, outlook_of, settle
from vibroimpact.dataset import dataset_of, flags, provenance, status_variable
from vibroimpact.indices import INDICES
from vibroimpact.model import Model, State, check_model
from vibroimpact.motion import MotionClass
from vibroimpact.options import Sampling, Tolerances
from vibroimpact.orbits.results import rows_of
from vibroimpact.parameters import check_steps
from vibroimpact.progress import Report, reporter
from vibroimpact.request import COSTLY
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr

POINTS = 256  # of an attractor, at most, that are returned to be marked in a portrait


def attractors(
    osc: Model,
    starts: Iterable[State] | None = None,
    *,
    transient_impacts: int = 100,
    sample_impacts: int = 500,
    backend: str = "cpu",
    tolerances: Tolerances | None = None,
    workers: int | None = None,
    progress: bool | Report | None = None,
) -> list[Attractor]:
    r"""Return the attractors that initial conditions lead to: the motions that coexist.

    Two cycles are the same attractor if, up to a cyclic shift, their impacts agree to :math:`10^{-6}` as points
    :math:`(\sin 2\pi\psi_i, \cos 2\pi\psi_i, I_i/\max I)` and, for systems, strike the same stops.

    Parameters
    ----------
    osc : ImpactOscillator, ImpactSystem or family
        The model.
    starts : list of State, optional
        The initial conditions. None means 256 impacts, the same in every call, spread evenly over phases 0 to 1 and
        velocities 0 to 4 V, V = max(f, k |g|)/sqrt(k m). For systems, they strike the stops in turn, and V is the
        `velocity_scale`; with several coordinates, the velocities of the coordinates are spread as well.
    transient_impacts, sample_impacts : int, >= 0 and >= 1
        Impacts to skip, then to keep, in the first of three rounds. Initial conditions that are not decided by then are
        followed in a second and a third round, four and sixteen times as long, and then for 1e5 impacts. For systems,
        2^k - 1 impacts are skipped and 2^k kept, with the smallest k that skips at least as many as given and keeps at
        least a quarter (127 and 128 by default); the last round has 32,767 impacts.
    backend : str
        Name of the back end; it must compute `n_periods` and `n_impacts`.
    tolerances : Tolerances, optional
        Numerical tolerances.
    workers : int, optional
        Threads; None means one per core. The result does not depend on it.
    progress : bool or callable, optional
        None shows a temporary line on a terminal or in a notebook if it takes more than a second.
        True shows a bar; a callable gets (initial conditions decided, their total number, their `status` so far) and
        stops the search by returning False: the attractors found by then are returned.

    Returns
    -------
    list of Attractor
        In the order of their shares of the initial conditions, the largest first. Shares sum to 1 if every initial
        condition was decided; the list is empty if none was.

    Raises
    ------
    ValueError
        An entry of `starts` is not a `State` or lies beyond the stop, or another argument is out of its range.

    Notes
    -----
    An initial condition is decided if its cycle is certain (stable, and within 1e-10 V), if it certainly never hits
    again, or if it is chaotic by the rule of `classify` in the sample of the last round and 32 of the chaotic motions,
    some of each group, stay chaotic for 1e5 impacts. If one of these 32 does not, all chaotic motions are followed for
    up to 1e5 impacts and sorted by their ends, as are undecided ones. If more than 9 in 10 of them rest in between, all
    chaotic motions count as intermittent sticking. With slow back ends, which take seconds per motion, the search ends
    after the last round.

    All motions that stick are one attractor, because every release is the same state. If perturbations grow by more
    than 1e13 from one rest to the next, rounding would decide what follows. Instead, 32 releases, perturbed by up to
    1e-11 V, are followed, and the motion to which most of those lead that do not rest again is the attractor. If all of
    them rest again, time after time, for 1e5 impacts, it is intermittent sticking.

    Chaotic motions are compared on a 64 x 64 grid of boxes on the impact surface. Two are the same attractor if the
    second visits the boxes of a long sample of the first more than half as often as the first itself does. With r = 1
    and c = 0, areas are preserved and nothing is attracted: only motions that never hit are decided. With c = 0 alone,
    it often cannot be proved that a motion never hits again; it is then undecided. If `starts` is None, the stable
    orbits of one impact in up to 16 periods, known in closed form, are tried as well. They do not count in the shares:
    an attractor that no other initial condition leads to has share 0. Other attractors that no initial condition leads
    to are not found. Time: tens of milliseconds, a second for chaotic motions, some seconds if chaos does not last.

    For systems, a motion and its mirror image are two attractors, unless they are the same motion. No rest erases all
    memory, so a motion that rests at a stop is a cycle like any other. An initial condition is decided once its whole
    state returns to within 1e-7 V. It leads to the cycle whose impacts agree with its first kept impact and its mean
    velocity within :math:`10^{-6} \|(1 - J)^{-1}\|`, where J is the derivative of the cycle's map; the cycle is
    followed further and, unless it rests, solved for. If every mode decays, impacts determine all coordinates. Impacts
    on a rigid stop with r = 1, or on an undamped compliant stop, last if damping does not act on the motion that they
    excite: nothing is attracted then, and a motion that strikes such a stop is undecided; without any load,
    `find_orbit` finds such motions by their energy. Chaotic motions are compared by boxes on the impact surfaces of all
    stops. All quasi-periodic motions count as one attractor, all that stick and never repeat as another, and all that
    never hit again as a third, even with an undamped mode. If a rest of all coordinates erases all memory, and rounding
    decides when the next one comes, the end is that of most motions perturbed after a rest which do not rest again, as
    for one mass. Time: less than a second for a periodic system, seconds for
    a chaotic one.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> [(found.name, round(found.share, 2)) for found in attractors(vi.ImpactOscillator(omega=1.45))]
    [('period-1 impact-1', 0.86), ('period-3 impact-4', 0.14)]
    """
    sampling = Sampling(transient_impacts=transient_impacts, sample_impacts=sample_impacts)
    check_model(osc)
    runner = Runner(backend, tolerances, workers)
    warn_of_cost(osc.at(), len(starts) if isinstance(starts, Sequence) else SPREAD, runner)
    return attractors_by(runner, osc, starts, sampling, progress)


def attractors_by(
    runner: Runner,
    model: Model,
    starts: Iterable[State] | None = None,
    sampling: Sampling = SAMPLING,
    progress: bool | Report | None = None,
) -> list[Attractor]:
    """Return the attractors of a model as `attractors` does, with a runner that may hold results already."""
    settling = Settling.of(runner, model, sampling)
    osc, windows = settling.osc, settling.windows
    chosen = spread_cells(osc.cells({})) if starts is None else state_cells(osc, starts)

    def outlook(settled: Settled, window: ImpactWindow) -> MotionClass:
        return outlook_of(settled) if window is windows[-1] else MotionClass.UNDECIDED

    _check_cost("starts", chosen, windows[0])
    with reporter(progress, "initial conditions") as tell:
        cells = chosen.join([chosen, *orbit_cells(settling.search)]) if starts is None else chosen
        _, reached = _matched(settling, cells, len(chosen), tell, lambda settled: settled.status, outlook)
    return [basin.attractor for basin in reached]


def from_rest(runner: Runner, model: Model) -> tuple[Attractor | None, Measured]:
    """Return the attractor that a system at rest settles to, None if it is undecided, and the motion with its indices.

    The indices of a cycle are those of one cycle; without one, of the longest window.
    """
    settling = Settling.of(runner, model)
    system = settling.osc
    settled = settle(settling, system.cells({}), settling.whole)
    measured = settled[0]
    indices = {name: measured.indices.get(name, math.nan) for name in INDICES}
    reached = match(settled, 1)
    if not reached:
        kind = MotionClass.BUDGET if measured.status == Status.BUDGET else MotionClass.UNDECIDED
        return None, replace(measured, kind=kind.word, n_periods=0, n_impacts=0, indices=indices)
    attractor = reached[0].attractor
    n, p = attractor.n_periods, attractor.n_impacts
    if measured.motion_class.hits:
        (again,) = runner.measure(carried(system, attractor.start), settling.windows[-1], names=tuple(INDICES))
        indices |= {name: value for name, value in again.indices.items() if name not in measured.indices}
    indices |= {name: float(getattr(attractor, name)) for name in STATISTICS}
    if attractor.velocities:
        indices |= indices_of_cycle(n, attractor.velocities, attractor.phases)
        indices["lyapunov_per_impact"] = attractor.lyapunov * system.period / indices["impacts_per_period"]
    return attractor, replace(measured, kind=attractor.kind, n_periods=n, n_impacts=p, indices=indices)


def basins(
    osc: Model,
    *,
    transient_impacts: int = 100,
    sample_impacts: int = 500,
    start: State | None = None,
    stop: str | None = None,
    backend: str = "cpu",
    tolerances: Tolerances | None = None,
    workers: int | None = None,
    progress: bool | Report | None = None,
    **axes: ArrayLike,
) -> xr.Dataset:
    r"""Return the attractor that each initial condition of a grid leads to, and the attractors' properties.

    Initial conditions are impacts, or states in front of the stop at one driving phase:

    .. math:: (\psi, I): y = g,\ \dot y = I,\ t = \psi T; \qquad
              (y_0, v_0): y = y_0 \le g,\ \dot y = v_0,\ t = \psi T

    Parameters
    ----------
    osc : ImpactOscillator, ImpactSystem or family
        The model.
    start : State, optional
        For systems: the coordinates that no axis varies; None means at rest. Its time is the time of all states.
    stop : str, optional
        For systems, with the axes `phase` and `velocity`: the stop that the impacts strike; it may be omitted if there
        is only one. The state is the one nearest to `start`, in the mass metric, that strikes the stop at this
        velocity.
    transient_impacts, sample_impacts, backend, tolerances, workers
        As in `attractors`.
    progress : bool or callable, optional
        None shows a temporary line on a terminal or in a notebook if it takes more than a second.
        True shows a bar; a callable gets (initial conditions decided, their total number, Dataset with their `status`)
        and stops the search by returning False: the result so far is returned, with unfinished cells `interrupted`.
    **axes : sequences of numbers
        Two axes, strictly increasing. For impacts: `phase` from 0 to 1 and `velocity` >= 0 in m/s (0 is at rest at the
        stop). For states in front of the stop: `displacement` in m, at most the gap, and `velocity` in m/s of either
        sign; a number `phase` gives their time, 0 by default. For a system of n coordinates: two of `displacement_0`,
        `velocity_0`, `displacement_1`, ... and `phase`; or `phase` and `velocity` at a `stop`.

    Returns
    -------
    xarray.Dataset
        Over the two axes in the order given: `attractor` (0, 1, ... by decreasing share, -1 if undecided; its
        `flag_meanings` are their names) and `status`. Over `attractor_id`: `share` of the grid, `n_periods`,
        `n_impacts`, `std`, `mean_velocity`, `max_velocity`, `lyapunov`, `dissipation`; and over `point` as well:
        `point_...` for each axis, the points of the attractor itself in the plane (NaN-padded, 256 at most).

    Raises
    ------
    ValueError
        The axes are not one of the pairs, a value is out of its range, or one lies beyond a stop.

    Notes
    -----
    Each initial condition is decided by the rules of `attractors`, independently of the others: chaos is accepted after
    the first round if, from 256 initial conditions spread over the impact surface, it lasts in all rounds and then for
    1e5 impacts; if not, each chaotic motion is followed for up to 1e5 impacts. Shares are fractions of the grid's
    points. A motion that leads to a cycle takes some 600 certified steps (30 microseconds on a core), a chaotic one
    2500, one that settles slowly up to 50,000; `attrs` contain the total number of steps.

    Examples
    --------
    >>> import numpy as np, vibroimpact as vi
    >>> found = basins(vi.ImpactOscillator(omega=3.0), phase=np.linspace(0, 1, 21), velocity=np.linspace(0, 3, 21))
    >>> found["attractor"].dims, found["attractor"].attrs["flag_meanings"]
    (('phase', 'velocity'), 'undecided period-2_impact-2 period-6_sticking')
    """
    plane = plane_of(osc, axes, stop, start)
    model, grid, cells = plane.model, plane.axes, plane.cells()
    sampling = Sampling(transient_impacts=transient_impacts, sample_impacts=sample_impacts)
    runner = Runner(backend, tolerances, workers)
    settling = Settling.of(runner, model, sampling)
    arguments = {
        **{name: np.asarray(value).tolist() for name, value in axes.items() if np.ndim(value) == 0},
        **plane.arguments(),
        "transient_impacts": sampling.transient_impacts,
        "sample_impacts": sampling.sample_impacts,
        "backend": backend,
        "tolerances": runner.tolerances,
    }
    coords = {name: plane.labelled(name, name, values) for name, values in grid.items()}
    labelled = dataset_of(coords=coords, attrs=provenance("basins", osc, arguments) | plane.note())
    dims, shape = tuple(grid), tuple(len(values) for values in grid.values())

    def so_far(settled: Settled) -> xr.Dataset:
        return labelled.assign(status=status_variable(dims, settled.status.reshape(shape)))

    survey = cache(lambda: outlook_from(settling, spread_cells(model.cells({}))))
    _check_cost("axes", cells, settling.windows[0])
    warn_of_cost(model, len(cells), runner)
    with reporter(progress, "initial conditions") as tell:
        settled, reached = _matched(settling, cells, len(cells), tell, so_far, lambda settled, window: survey())
    numbers = np.full(len(cells), -1)
    for at, basin in enumerate(reached):
        numbers[basin.members] = at
    names = ["undecided", *distinct([basin.attractor.name for basin in reached])]
    over_grid = {
        "attractor": flags(
            dims, numbers.reshape(shape), "attractor that the initial condition leads to", names, -1, np.int16
        ),
        "status": status_variable(dims, settled.status.reshape(shape)),
    }
    result = labelled.assign(
        over_grid | attractor_variables([basin.attractor for basin in reached]) | _points(runner, plane, reached)
    )
    return result.assign_attrs(steps_computed=int(settled.indices["steps"].sum()))


def _check_cost(name: str, cells: Cells, first: ImpactWindow) -> None:
    """Refuse initial conditions that would take too many steps in the first round alone."""
    impacts = first.transient + first.keep
    what = f"give {len(cells):,} initial conditions of {impacts:,} impacts or more each, which take"
    check_steps(name, what, len(cells) * impacts, COSTLY)


def _matched(
    settling: Settling,
    cells: Cells,
    counted: int,
    tell: Report,
    so_far: Callable[[Settled], Any],
    outlook: Callable[[Settled, ImpactWindow], MotionClass],
) -> tuple[Settled, list[Basin]]:
    """Return the motion that each cell settles to, and the attractors; `tell` gets the progress and may stop it.

    The last initial condition is decided when the attractors are known.
    """
    stop = settling.runner.stop

    def report(settled: Settled, undecided: int) -> None:
        stopped = stop.is_set()  # what had ended by then still comes in
        if not stopped and tell(len(cells) - undecided, len(cells), so_far(settled)) is False:
            stop.set()

    settled = settle(settling, cells, settling.whole, outlook, lambda so, undecided: report(so, max(undecided, 1)))
    reached = match(settled, counted)
    report(settled, int(np.count_nonzero(settled.kind == MotionClass.UNDECIDED)))
    return settled, reached


def _points(runner: Runner, plane: Plane, basins: Sequence[Basin]) -> dict[str, xr.Variable]:
    """Return the points of each attractor in the portrait: its impacts, or its states at the portrait's phase.

    If one axis is the phase of states, attractors have no points there.
    """
    portraits = [_points_of(runner, plane, basin.attractor) for basin in basins]
    longest = max((len(next(iter(points.values()))) for points in portraits), default=0)
    tables = {axis: rows_of([points[axis] for points in portraits], longest) for axis in plane.axes}
    return {f"point_{axis}": plane.labelled(axis, (DIM, "point"), table) for axis, table in tables.items()}


def _points_of(runner: Runner, plane: Plane, attractor: Attractor) -> dict[str, Floats]:
    periods = attractor.n_periods or (POINTS if MotionClass[attractor.kind.upper()].hits else 1)
    at_impacts = plane.struck
    if "phase" in plane.axes and not at_impacts:
        return dict.fromkeys(plane.axes, np.zeros(0))
    window = StroboscopicWindow(0, min(periods, POINTS) + at_impacts, None if at_impacts else plane.phase)
    (samples,) = runner.samples(carried(plane.model, attractor.start), window)
    most = attractor.n_impacts if at_impacts and attractor.n_impacts > 0 else POINTS
    return {axis: values[:most] for axis, values in plane.points(samples).items()}
