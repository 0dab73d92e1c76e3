"""Basins of attraction: which starts of a grid lead to which attractor."""

from __future__ import annotations

from collections.abc import Sequence
from threading import Event
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from vibroimpact.backends import Measurement, StroboscopicWindow
from vibroimpact.backends.base import Floats
from vibroimpact.coexistence.attractor import Attractor, distinct_names
from vibroimpact.coexistence.matching import Basin, match
from vibroimpact.coexistence.search import SPREAD, naming_backend
from vibroimpact.coexistence.settling import Fate, Runner, Settled, lasts, rounds, settle
from vibroimpact.coexistence.starts import check_grid, grid_cells, spread_cells, state_cells
from vibroimpact.dataset import impact_speed, provenance, status_variable, variable
from vibroimpact.execution.threads import worker_count
from vibroimpact.options import Sampling, Tolerances
from vibroimpact.oscillator import ImpactOscillator
from vibroimpact.progress import Report, reporter

POINTS = 256  # of an attractor, at most, that are handed out to be marked in a portrait
_TOLD = ("std", "mean_velocity", "max_velocity", "lyapunov", "n_periods", "n_impacts", "dissipation")


def basins(
    osc: ImpactOscillator,
    *,
    transient_impacts: int = 100,
    sample_impacts: int = 500,
    backend: str = "cpu",
    tolerances: Tolerances | None = None,
    workers: int | None = None,
    progress: bool | Report = False,
    **axes: ArrayLike,
) -> xr.Dataset:
    r"""Return which attractor each start of a grid leads to, and what is known of the attractors.

    Starts are impacts, or states in front of the stop at one driving phase:

    .. math:: (\psi, I): y = g,\ \dot y = I,\ t = \psi T; \qquad
              (y_0, v_0): y = y_0 \le g,\ \dot y = v_0,\ t = \psi T

    Parameters
    ----------
    osc : ImpactOscillator
        The seven numbers.
    transient_impacts, sample_impacts : int, >= 0 and >= 1
        Impacts left out, then kept, in the first of three rounds; starts that are then not decided go on to a
        second and a third one, four and sixteen times as long.
    backend : {"cpu", "cuda", "reference"}
        Who computes.
    tolerances : Tolerances, optional
        How small is small.
    workers : int, optional
        Threads; None is one a core. The result does not depend on it.
    progress : bool or callable
        True shows a bar; a callable gets (starts decided, starts in all, Dataset with their `status` so far) and stops
        by returning False: what was found so far is returned, unfinished starts `interrupted`.
    **axes : sequences of numbers
        Two of these, strictly increasing: `phase` from 0 to 1 and `velocity` >= 0 in m/s for impacts (velocity 0 is at
        rest at the stop), or `displacement` in m, at most the gap, and `velocity` in m/s of either sign for states in
        front of the stop; their time is then given by a number `phase`, 0 unless given.

    Returns
    -------
    xarray.Dataset
        Over the two axes in the order given: `attractor` (0, 1, ... by falling share, -1 where undecided; its
        `flag_meanings` are their names) and `status`. Over `attractor_id`: `share` of the starts, `n_periods`,
        `n_impacts`, `std`, `mean_velocity`, `max_velocity`, `lyapunov`, `dissipation`; over `point` too: where the
        attractor itself lies in the portrait, `point_...` an axis (NaN-padded, 256 points at most).

    Raises
    ------
    ValueError
        The axes are not one of the two pairs, a value is out of its range, or a start lies beyond the stop.

    Notes
    -----
    What becomes of a start is decided by the rules of `attractors`, and never depends on the other starts, but that
    chaos is believed after the first round if it lasts on 256 spread starts. Shares are parts of the grid's points. A
    start on a cycle takes some 600 certified steps (30 microseconds on a core), a chaotic one 2500, one that settles
    slowly up to 50,000; `attrs` count the steps of all.

    Examples
    --------
    >>> import numpy as np
    >>> found = basins(ImpactOscillator(omega=3.0), phase=np.linspace(0, 1, 21), velocity=np.linspace(0, 3, 21))
    >>> found["attractor"].dims, found["attractor"].attrs["flag_meanings"]
    (('phase', 'velocity'), 'undecided period-2_impact-2 period-6_sticking')
    """
    grid, phase = check_grid(osc, axes)
    sampling = Sampling(transient_impacts=transient_impacts, sample_impacts=sample_impacts)
    windows = rounds(osc, sampling.transient_impacts, sampling.sample_impacts)
    runner = Runner(osc, naming_backend(backend), tolerances or Tolerances(), worker_count(workers), Event())
    arguments = {
        **{name: np.asarray(given).tolist() for name, given in axes.items() if np.ndim(given) == 0},
        "transient_impacts": sampling.transient_impacts,
        "sample_impacts": sampling.sample_impacts,
        "backend": backend,
        "tolerances": runner.limits,
    }
    coords = {name: variable(name, name, values) for name, values in grid.items()}
    if "phase" in grid:
        coords["velocity"] = impact_speed("velocity", grid["velocity"])
    labelled = xr.Dataset(coords=coords, attrs=provenance("basins", osc, arguments))
    cells = grid_cells(osc, grid, phase)
    shape = tuple(len(values) for values in grid.values())
    with reporter(progress, "starts") as tell:

        def report(settled: Settled, undecided: int) -> None:
            so_far = labelled.assign(status=status_variable(tuple(grid), settled.status.reshape(shape)))
            if tell(len(cells) - undecided, len(cells), so_far) is False:
                runner.stop.set()

        survey = spread_cells(osc, SPREAD)
        settled = settle(runner, cells, windows, lambda: lasts(runner, survey, windows), report)
        report(settled, int(np.count_nonzero(settled.fate == Fate.UNDECIDED)))
    found = match(runner, cells, settled, windows[-1])
    over_grid = {
        "attractor": _attractor_variable(tuple(grid), _numbered(found, len(cells)).reshape(shape), found),
        "status": status_variable(tuple(grid), settled.status.reshape(shape)),
    }
    result = labelled.assign(over_grid | _table(found) | _points(runner, found, tuple(grid), phase))
    return result.assign_attrs(steps_computed=int(settled.told["steps"].sum()))


def _numbered(found: Sequence[Basin], number: int) -> NDArray[np.int16]:
    attractor = np.full(number, -1, np.int16)
    for at, basin in enumerate(found):
        attractor[basin.members] = at
    return attractor


def _attractor_variable(dims: tuple[str, ...], numbers: NDArray[np.int16], found: Sequence[Basin]) -> xr.Variable:
    names = ["undecided", *distinct_names([basin.attractor for basin in found])]
    return xr.Variable(
        dims,
        numbers,
        {
            "long_name": "attractor that the start leads to",
            "flag_values": np.arange(-1, len(found), dtype=np.int16),
            "flag_meanings": " ".join(name.replace(" ", "_") for name in names),
        },
    )


def _table(found: Sequence[Basin]) -> dict[str, xr.Variable]:
    """Return what is told of each attractor."""
    rows = [basin.attractor for basin in found]
    share = {"long_name": "share of the starts", "units": "1", "symbol": "share"}
    return {
        "attractor_id": xr.Variable("attractor_id", np.arange(len(rows), dtype=np.int16), {"long_name": "attractor"}),
        "share": xr.Variable("attractor_id", np.array([row.share for row in rows], float), share),
        **{
            name: variable(
                name,
                "attractor_id",
                np.array([getattr(row, name) for row in rows], np.int32 if name.startswith("n_") else np.float64),
            )
            for name in _TOLD
        },
    }


def _points(runner: Runner, found: Sequence[Basin], axes: tuple[str, ...], phase: float) -> dict[str, xr.Variable]:
    """Return where each attractor lies in the portrait: its impacts, or its states at the portrait's phase."""
    seen = [_seen(runner, basin.attractor, axes, phase) for basin in found]
    longest = max((len(next(iter(points.values()))) for points in seen), default=0)
    columns = {}
    for axis in axes:
        rows = np.full((len(found), longest), np.nan)
        for row, points in zip(rows, seen, strict=True):
            row[: len(points[axis])] = points[axis]
        columns[f"point_{axis}"] = variable(axis, ("attractor_id", "point"), rows)
    return columns


def _seen(runner: Runner, attractor: Attractor, axes: tuple[str, ...], phase: float) -> dict[str, Floats]:
    periods = attractor.n_periods or (POINTS if attractor.kind in ("chaotic", "sticking") else 1)
    cell = state_cells(runner.osc, [attractor.start])
    at_impacts = "phase" in axes
    window = StroboscopicWindow(0, min(periods, POINTS) + at_impacts, None if at_impacts else phase)
    (seen,) = runner.engine.samples(cell, Measurement(window, runner.limits))
    told: dict[str, Any] = {"displacement": seen.look_displacement, "velocity": seen.look_velocity}
    if at_impacts:
        told = {"phase": seen.impact_phase, "velocity": seen.impact_velocity}
    most = attractor.n_impacts if at_impacts and attractor.n_impacts > 0 else POINTS
    return {axis: told[axis][:most] for axis in axes}
