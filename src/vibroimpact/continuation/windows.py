"""Parameter windows in which a motion is stable: found by continuation, or seen in a sweep."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial
from itertools import groupby, pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from vibroimpact.continuation.bifurcations import switch_branch
from vibroimpact.continuation.branch import continue_orbit
from vibroimpact.continuation.results import Branch
from vibroimpact.motion import cycle_name
from vibroimpact.orbits.distance import orbit_distance, same_orbit
from vibroimpact.orbits.orbit import Orbit
from vibroimpact.orbits.search import find_orbit
from vibroimpact.progress import Report

if TYPE_CHECKING:
    import xarray as xr

SAME = 1e-6  # largest `orbit_distance` between equal orbits
NEEDED = ("velocity", "count", "status", "n_periods", "n_impacts", "lyapunov_per_impact")


@dataclass(frozen=True, eq=False)
class Window:
    """An interval of a parameter in which one motion is stable (continuation) or observed (sweep).

    Parameters
    ----------
    parameter : str
        The parameter that varies.
    n_periods, n_impacts : int
        Driving periods and impacts in a cycle of the motion.
    low, high : float
        Ends of the window; in a sweep, the first and the last value with the motion.
    ends : tuple of two str
        Why it ends: "fold", "period_doubling", "grazing", or the outcome of the branch; "grid" in a sweep.
    orbits : tuple of Orbit
        The orbits along the window, from continuation; empty in a sweep.
    """

    parameter: str
    n_periods: int
    n_impacts: int
    low: float
    high: float
    ends: tuple[str, str]
    orbits: tuple[Orbit, ...] = field(default=(), repr=False)

    @property
    def name(self) -> str:
        """The name of the motion."""
        return cycle_name(self.n_periods, self.n_impacts)

    def orbits_at(self, value: float) -> list[Orbit]:
        """Return the stable orbits at a value, found by Newton's method from the two nearest orbits of the window."""
        nearest = sorted(self.orbits, key=lambda orbit: abs(orbit.value(self.parameter) - value))
        moved = [_moved(orbit, self.parameter, value) for orbit in nearest[:2]]
        return [orbit for orbit in moved if orbit and orbit.stable]


def follow_all(
    orbits: Iterable[Any],
    parameter: str,
    range: tuple[float, float],
    *,
    longest: float = 4,
    most: float = 4,
    doublings: float = math.inf,
    step: float = 0.02,
    virtual: bool = False,
    amplitude: float = 1e-2,
    progress: bool | Report = False,
) -> list[Branch]:
    """Follow each orbit that lies on no branch yet, and the orbits born at its period doublings and pitchforks.

    Parameters
    ----------
    orbits : iterable of Orbit
        The orbits to begin with. Orbits that stick are skipped, and, unless `virtual`, inadmissible ones.
    parameter, range, step, virtual, progress
        As in `continue_orbit`.
    longest, most : int, >= 1
        Largest n_periods and n_impacts of doubled orbits; infinity for no limit.
    doublings : int, >= 0
        Number of successive period doublings and pitchforks to follow; infinity for as many as `longest` and `most`
        allow.
    amplitude : float, 0 to 0.5
        As in `switch_branch`.

    Returns
    -------
    list of Branch
        Each branch once: those through `orbits` first, then those born at their period doublings, and so on. If stopped
        by `progress`, the branches followed so far.

    Notes
    -----
    Orbits born at a fold are followed only if an orbit on their branch is given. Of the two twins born at a pitchfork
    one is followed. A branch takes about 0.1 s.

    Examples
    --------
    >>> from vibroimpact.model.oscillator import ImpactOscillator
    >>> branches = follow_all(find_orbit(ImpactOscillator(omega=2.5)), "omega", (2.0, 2.7))
    >>> [(branch.orbits[0].name, branch.outcome) for branch in branches]
    [('period-1 impact-1', ('range', 'range')), ('period-2 impact-2', ('period_doubling', 'range'))]
    """
    branches: list[Branch] = []
    waiting = deque((orbit, 0) for orbit in orbits)
    while waiting:
        orbit, doubled = waiting.popleft()
        skipped = orbit.sticks or not (virtual or orbit.admissible)
        if skipped or any(_lies_on(orbit, branch) for branch in branches):
            continue
        branch = continue_orbit(orbit, parameter, range, step=step, virtual=virtual, progress=progress)
        branches.append(branch)
        if "stopped" in branch.outcome:
            break
        if doubled < doublings:
            kinds = ["pitchfork"] * getattr(branch.orbits[0], "symmetric", False)
            kinds += ["period_doubling"] * (2 * orbit.n_periods <= longest and 2 * orbit.n_impacts <= most)
            waiting += [(born, doubled + 1) for born in _born(branch, range, amplitude, kinds)]
    return branches


def _born(branch: Branch, range: tuple[float, float], amplitude: float, kinds: list[str]) -> Iterator[Any]:
    """Yield an orbit of each branch born at a bifurcation of these kinds on a branch, inside the range."""
    for point in branch.special:
        if point.kind not in kinds or point.orbit.n_periods < branch.orbits[0].n_periods:
            continue  # a doubled branch ends at the period doubling of the orbit it comes from
        try:
            orbit = switch_branch(point, amplitude=amplitude)
        except ValueError:  # two boundaries meet here
            continue
        if range[0] <= orbit.value(branch.parameter) <= range[1]:
            yield orbit


def _lies_on(orbit: Orbit, branch: Branch) -> bool:
    """Whether Newton's method converges from the nearest orbits of the branch to this one."""
    first = branch.orbits[0]
    if (first.n_periods, first.n_impacts) != (orbit.n_periods, orbit.n_impacts):
        return False
    value = orbit.value(branch.parameter)
    apart = branch.values - value
    around = np.flatnonzero(apart[:-1] * apart[1:] <= 0.0)
    nearest = {int(j if abs(apart[j]) < abs(apart[j + 1]) else j + 1) for j in around}
    moved = [_moved(branch.orbits[j], branch.parameter, value) for j in nearest]
    return any(same_orbit(near, orbit, tolerance=SAME) for near in moved if near)


def stable_windows(branches: Branch | Iterable[Branch]) -> list[Window]:
    r"""Return the parameter windows in which the orbits of branches are stable.

    Inside a window all Floquet multipliers satisfy :math:`|\mu| < 1`, and each flight ends at the orbit's next impact.
    The ends of the windows are bifurcations of the branch, accurate to rounding, or ends of the branch. A window ends
    where a contact with a compliant stop appears or vanishes, too, since the number of impacts changes there.

    Parameters
    ----------
    branches : Branch or iterable of Branch
        Results of `continue_orbit` or `follow_all`.

    Returns
    -------
    list of Window
        From low to high.

    Examples
    --------
    >>> from vibroimpact.model.oscillator import ImpactOscillator
    >>> (orbit,) = find_orbit(ImpactOscillator(omega=2.5))
    >>> (window,) = stable_windows(continue_orbit(orbit, "omega", (2.0, 3.0), step=0.05))
    >>> window.name, window.low, round(window.high, 9), window.ends
    ('period-1 impact-1', 2.0, 2.65392352, ('range', 'period_doubling'))
    """
    several = [branches] if isinstance(branches, Branch) else branches
    return sorted((window for branch in several for window in _branch_windows(branch)), key=lambda window: window.low)


def _branch_windows(branch: Branch) -> Iterator[Window]:
    parameter = branch.parameter
    special = {point.value: point.kind for point in branch.special}
    orbits = _with_middles(branch, special)
    for (stable, n, p), run in groupby(range(len(orbits)), key=lambda i: _kind(orbits[i])):
        places = list(run)
        low, high = sorted([_end(branch, orbits, special, places[0], -1), _end(branch, orbits, special, places[-1], 1)])
        if stable and low[0] < high[0]:
            inside = tuple(orbits[i] for i in places)
            yield Window(parameter, n, p, low[0], high[0], (low[1], high[1]), inside)


def _kind(orbit: Orbit) -> tuple[bool, int, int]:
    """Return what is the same within a window: contacts with compliant stops appear and vanish along stable orbits."""
    return orbit.stable, orbit.n_periods, orbit.n_impacts


def _with_middles(branch: Branch, special: dict[float, str]) -> list[Orbit]:
    """Return the branch's orbits, with one inserted between any two consecutive special points."""
    orbits = [branch.orbits[0]]
    for a, b in pairwise(branch.orbits):
        low, high = sorted((a.value(branch.parameter), b.value(branch.parameter)))
        if low in special and high in special and low < high:
            middle = _moved(a, branch.parameter, 0.5 * (low + high))
            orbits += [middle] if middle else []
        orbits.append(b)
    return orbits


def _end(branch: Branch, orbits: list[Orbit], special: dict[float, str], at: int, way: int) -> tuple[float, str]:
    """Return the end of a run of orbits and its reason: a special point at or next to the last orbit, or the end."""
    value, beside = orbits[at].value(branch.parameter), at + way
    if value in special:
        return value, special[value]
    if 0 <= beside < len(orbits):
        end = orbits[beside].value(branch.parameter)
        return end, special.get(end, "lost")
    reason = branch.outcome[0 if way < 0 else 1]
    if reason == "period_doubling" and branch.special:  # a special point of the orbit it comes from, not of this branch
        return branch.special[0 if way < 0 else -1].value, reason
    return value, reason


def swept_windows(sweep: xr.Dataset) -> list[Window]:
    """Return the longest runs of values at which a diagram has cycles of one (n, p) type.

    Parameters
    ----------
    sweep : xarray.Dataset
        From `bifurcation_diagram` with `indices` n_periods, n_impacts and lyapunov_per_impact.

    Returns
    -------
    list of Window
        From low to high, down to single values; cycles that stick (n_impacts = -1) are included.

    Raises
    ------
    ValueError
        The sweep lacks one of these variables.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> sweep = vi.bifurcation_diagram(vi.ImpactOscillator(), omega=[1.9, 2.0, 2.8], sample_impacts=200,
    ...                                indices=("n_periods", "n_impacts", "lyapunov_per_impact"))
    >>> [(window.name, window.low, window.high) for window in swept_windows(sweep)]
    [('period-1 impact-1', 1.9, 2.0)]
    """
    missing = [name for name in NEEDED if name not in sweep]
    if missing or "impact" not in sweep.dims or sweep["count"].ndim != 1:
        raise ValueError(
            f"`sweep` lacks {', '.join(missing) or 'impacts'}; "
            "compute it by bifurcation_diagram with indices=('n_periods', 'n_impacts', 'lyapunov_per_impact')"
        )
    parameter = str(sweep["count"].dims[0])
    values = sweep[parameter].values.tolist()
    names = list(zip(sweep["n_periods"].values.tolist(), sweep["n_impacts"].values.tolist(), strict=True))
    runs = [(name, list(run)) for name, run in groupby(range(len(values)), key=names.__getitem__) if name[0] > 0]
    return [Window(parameter, *name, values[run[0]], values[run[-1]], ("grid", "grid")) for name, run in runs]


def _moved(orbit: Orbit, parameter: str, value: float) -> Orbit | None:
    """Return the orbit that Newton's method reaches from this one at another value of a parameter, or None."""
    model = orbit.model.replace(**{parameter: value})
    orbits = find_orbit(model, n_periods=orbit.n_periods, n_impacts=orbit.n_impacts, near=orbit)
    # With one impact all orbits are found, in closed form.
    return min(orbits, key=partial(orbit_distance, orbit), default=None)
