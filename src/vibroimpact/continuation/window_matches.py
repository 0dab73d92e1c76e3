"""Whether continuation and a sweep find the same stable windows, and why not, where they do not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from vibroimpact.continuation.results import Branch
from vibroimpact.continuation.windows import Window, alike, stable_windows, swept_windows
from vibroimpact.dataset import oscillator_of
from vibroimpact.motion import cycle_name
from vibroimpact.parameters import whole_number
from vibroimpact.status import Status


@dataclass(frozen=True, eq=False)
class WindowMatch:
    """What the other method says of a window.

    Parameters
    ----------
    window : Window
        The one looked for.
    source : {"continuation", "sweep"}
        Who found it.
    outcome : {"found", "coexistence", "out_of_scope", "unexplained"}
        The other has the same orbit at every value of the grid inside; or the sweep is on another attractor at the
        rest of them; the name is longer than those followed; or none of these.
    values, found : int
        Values of the grid inside, and those at which both have the orbit.
    others : dict of str to int
        What the sweep shows instead, and at how many values.
    unexplained : tuple of float
        Values without counterpart and without such a reason.
    """

    window: Window
    source: str
    outcome: str
    values: int
    found: int = 0
    others: dict[str, int] | None = None
    unexplained: tuple[float, ...] = ()

    @property
    def message(self) -> str:
        """The match in a sentence."""
        w = self.window
        text = f"{w.name}, {w.parameter} = {w.low:.6g} ({w.ends[0]}) to {w.high:.6g} ({w.ends[1]}): "
        if self.outcome == "out_of_scope":
            return text + "longer than the names followed"
        by = "sweep" if self.source == "continuation" else "continuation"
        text += f"the {by} has it at {self.found} of {self.values} values"
        if self.others:
            told = ", ".join(f"{name} ({count})" for name, count in self.others.items())
            text += f"; coexistence: elsewhere the sweep shows {told}"
        if self.unexplained:
            text += f"; {len(self.unexplained)} without a reason, the first {self.unexplained[0]:.6g}"
        return text


def compare_windows(
    branches: Iterable[Branch], sweep: xr.Dataset, *, steps: int = 3, longest: int = 4, most: int = 4
) -> list[WindowMatch]:
    """Look for each stable window of continuation in a sweep, and for each window of the sweep in continuation.

    Parameters
    ----------
    branches : iterable of Branch
        What `follow_all` returned.
    sweep : xarray.Dataset
        From `bifurcation_diagram` over the same parameter, with `indices` n_periods, n_impacts and
        lyapunov_per_impact.
    steps : int, >= 0
        Windows of at most so many grid steps, or values of the sweep, are passed over.
    longest, most : int, >= 1
        Largest n_periods and n_impacts of orbits that were followed. Of the sweep's windows, those of longer names and
        of cycles that stick are out of scope.

    Returns
    -------
    list of WindowMatch
        Those of continuation first.

    Raises
    ------
    ValueError
        The sweep is over another parameter or oscillator than the branches, or lacks what names a motion.

    Notes
    -----
    A value is found if the sweep's last p velocities there are those of the orbit that Newton's method finds, within
    1e-6 of its fastest, and that orbit is stable and a motion of the mass. The sweep is on another attractor where it
    names another cycle, comes to rest, ends without impacts or has a positive exponent; a motion that still settles is
    no reason: leave out more impacts. Some milliseconds a value.

    Examples
    --------
    >>> import numpy as np, vibroimpact as vi
    >>> from vibroimpact.continuation.windows import follow_all
    >>> from vibroimpact.orbits import find_orbit
    >>> osc = vi.ImpactOscillator(omega=2.0)
    >>> names = ("n_periods", "n_impacts", "lyapunov_per_impact")
    >>> sweep = vi.bifurcation_diagram(osc, omega=np.arange(1.9, 2.45, 0.1), sample_impacts=200, indices=names)
    >>> branches = follow_all(find_orbit(osc), "omega", (1.85, 2.45))
    >>> print(compare_windows(branches, sweep)[0].message)
    period-1 impact-1, omega = 1.85 (range) to 2.45 (range): the sweep has it at 6 of 6 values
    """
    least, followed = whole_number("steps", steps, 0), list(branches)
    longest, most = whole_number("longest", longest, 1), whole_number("most", most, 1)
    swept = swept_windows(sweep)
    parameter = str(sweep["count"].dims[0])
    for branch in followed:
        _check_same(branch, sweep, parameter)
    grid, windows, matches = sweep[parameter].values, stable_windows(followed), []
    step = float(np.diff(grid).max()) if len(grid) > 1 else 0.0
    for window in windows:
        if window.high - window.low > least * step:
            matches.append(
                _in_sweep(window, sweep, np.flatnonzero((window.low < grid) & (grid < window.high)).tolist())
            )
    for window in swept:
        inside = np.flatnonzero((window.low <= grid) & (grid <= window.high)).tolist()
        if len(inside) > least:
            known = 0 < window.n_impacts <= most and window.n_periods <= longest
            matches.append(
                _in_branches(window, windows, sweep, inside)
                if known
                else WindowMatch(window, "sweep", "out_of_scope", len(inside))
            )
    return matches


def _in_sweep(window: Window, sweep: xr.Dataset, inside: Sequence[int]) -> WindowMatch:
    missed = [at for at in inside if not _shows(sweep, at, window)]
    instead = {at: _attractor(sweep, at, window) for at in missed}
    others = Counter(name for name in instead.values() if name)
    unexplained = tuple(_value(sweep, at) for at, name in instead.items() if not name)
    outcome = "unexplained" if unexplained else "coexistence" if others else "found"
    found = len(inside) - len(missed)
    return WindowMatch(window, "continuation", outcome, len(inside), found, dict(others), unexplained)


def _in_branches(window: Window, known: Sequence[Window], sweep: xr.Dataset, inside: Sequence[int]) -> WindowMatch:
    alike = [w for w in known if (w.n_periods, w.n_impacts) == (window.n_periods, window.n_impacts)]
    missed = [at for at in inside if not any(_shows(sweep, at, w) for w in alike)]
    outcome = "unexplained" if missed else "found"
    found = len(inside) - len(missed)
    return WindowMatch(
        window, "sweep", outcome, len(inside), found, unexplained=tuple(_value(sweep, at) for at in missed)
    )


def _shows(sweep: xr.Dataset, at: int, window: Window) -> bool:
    """Whether the last impacts of the sweep are those of the window's orbit there."""
    value, count = _value(sweep, at), int(sweep["count"][at])
    if not window.low <= value <= window.high:
        return False
    seen = sweep["velocity"].values[at, max(0, count - window.n_impacts) : count]
    return any(alike(orbit, seen) for orbit in window.orbits_at(value))


def _value(sweep: xr.Dataset, at: int) -> float:
    return float(sweep[str(sweep["count"].dims[0])][at])


def _attractor(sweep: xr.Dataset, at: int, window: Window) -> str:
    """Return what else the sweep is on; nothing if it still settles."""
    n, p, growth = (sweep[name].values[at].item() for name in ("n_periods", "n_impacts", "lyapunov_per_impact"))
    status = Status(int(sweep["status"][at]))
    if n > 0:
        return "another " * ((n, p) == (window.n_periods, window.n_impacts)) + cycle_name(n, p)
    if not status.has_indices:
        return "" if status in (Status.BUDGET, Status.INTERRUPTED) else status.word.replace("_", " ")
    if growth == -np.inf:
        return "sticking, cycle longer than the sample"
    return "aperiodic" if growth > 0.0 else ""


def _check_same(branch: Branch, sweep: xr.Dataset, parameter: str) -> None:
    own = branch.orbits[0].oscillator
    if branch.parameter == parameter and oscillator_of(sweep).replace(**{parameter: branch.values[0]}) == own:
        return
    raise ValueError(
        f"`branches` holds one along {branch.parameter} of {own}; allowed are branches along {parameter} of the "
        "sweep's oscillator; follow orbits of that"
    )
