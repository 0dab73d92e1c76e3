"""Response curves: how far a forced system swings along one parameter, with and without contact."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.continuation.branch import continue_orbit
from vibroimpact.continuation.equations import Range
from vibroimpact.continuation.following import check_range, check_share
from vibroimpact.continuation.lines import covered
from vibroimpact.continuation.results import (
    BifurcationPoint,
    Branch,
    axis,
    kind_variable,
    responses,
    span_text,
)
from vibroimpact.dataset import dataset_of, flags, plain_variable, provenance
from vibroimpact.indices import DISPLACEMENTS
from vibroimpact.labels import displayed
from vibroimpact.model import Model, as_system, check_model
from vibroimpact.model.points import observed
from vibroimpact.model.system import ImpactSystem
from vibroimpact.model.units import display
from vibroimpact.orbits.search import find_orbit
from vibroimpact.orbits.systems.response import Response, response_of, steady_motion
from vibroimpact.parameters import counted, invalid, labelled, with_unit
from vibroimpact.progress import Report, reporter
from vibroimpact.request import check_apart, units_of
from vibroimpact.showing import Shown, Table

if TYPE_CHECKING:
    import xarray as xr

TURNED = 0.2  # rad: largest change of a mode's phase lag between two values for the motion without contact
FINEST = 1e-6  # of the range: smallest distance between two of them
INSIDE = 1e-3  # of an interval with contact: how far from its ends orbits are sought
NOTHING = Response(*[math.nan] * len(DISPLACEMENTS))
PART, IMPACTS = {"long_name": "part of the curve"}, {"long_name": "impacts in a cycle", "units": "1"}
STABLE = "unstable", "stable"


class NoCurve(ValueError):
    """A range without any periodic motion that a response curve consists of."""


@dataclass(frozen=True, eq=False, repr=False)
class ResponseCurve(Shown):
    """How far a system swings along one parameter: motions without contact, and branches of orbits with contact.

    Attributes
    ----------
    parameter : str
        The parameter that varies.
    of : str, int or sequence of float, or None
        What is observed.
    model : ImpactOscillator, ImpactSystem or family
        The model.
    steady : list of (n,) array
        Values of the parameter on each part of the curve without contact, ascending.
    branches : list of Branch
        The branches of orbits with contact, with their folds and other bifurcations.
    message : str
        What was found, in sentences.
    units : dict
        The unit of the parameter in tables and figures, if its range was given as quantities in another one.
    """

    parameter: str
    of: Any
    model: Model
    steady: list[Floats]
    branches: list[Branch]
    message: str
    arguments: dict[str, Any]
    units: dict[str, str] = field(default_factory=dict)

    @cached_property
    def dataset(self) -> xr.Dataset:
        """The curve as a labelled dataset over `point`, its special points over `special`; a line joins each `part`."""
        parts = [(values, *self._free(values)) for values in self.steady]
        parts += [(branch.values, *self._of_orbits(branch)) for branch in self.branches]
        values, rows, impacts, stable = map(np.concatenate, zip(*parts, strict=True))
        special, units = self.special, self.units
        content = responses("point", rows)
        content |= {
            "part": plain_variable("point", np.repeat(np.arange(len(parts)), [len(part[0]) for part in parts]), PART),
            "impacts": plain_variable("point", impacts, IMPACTS),
            "stable": flags("point", stable, "whether it is stable", STABLE),
            "special_kind": kind_variable("special", [point.kind for point in special]),
            "special_value": axis(self.model, self.parameter, "special", [point.value for point in special], units),
        }
        of_special = responses("special", [response_of(point.orbit, of=self.of) for point in special])
        content |= {f"special_{name}": column for name, column in of_special.items()}
        attrs = provenance("response_curve", self.model, self.arguments) | {"message": self.message}
        along = axis(self.model, self.parameter, "point", values, self.units)
        return dataset_of(content, {self.parameter: along}, attrs)

    def _free(self, values: Floats) -> tuple[list[Response], Floats, Floats]:
        """Return responses, impacts and stability of the motion without contact."""
        row, stop = observed(as_system(self.model.at()), self.of)
        designs = (self.model.at(**{self.parameter: value}) for value in values.tolist())
        motions = [steady_motion(as_system(design)) for design in designs]
        rows = [NOTHING if motion is None else motion.response(row, stop) for motion in motions]
        return rows, np.zeros(len(rows), int), np.ones(len(rows), int)

    def _of_orbits(self, branch: Branch) -> tuple[list[Response], Floats, Floats]:
        """Return responses, impacts and stability of the orbits of a branch."""
        impacts, stable = np.array([(orbit.n_impacts, orbit.stable) for orbit in branch.orbits]).T
        return [response_of(orbit, of=self.of) for orbit in branch.orbits], impacts, stable

    @property
    def special(self) -> list[BifurcationPoint]:
        """The bifurcations on all branches."""
        return [point for branch in self.branches for point in branch.special]

    def _table(self) -> Table:
        shown, factor = displayed(self.dataset), display(self.dataset[self.parameter].attrs)[0]
        largest, along = shown["amplitude"].values, shown[self.parameter]
        at = int(np.nanargmax(largest))
        unit = along.attrs["units"]
        where = with_unit(f"{self.parameter} = {float(along[at]):.6g}", unit)
        rows = [(b.orbits[0].name, len(b.orbits), *np.sort(factor * b.values[[0, -1]]).tolist()) for b in self.branches]
        head = ("orbits with contact", "number", *(labelled(end, unit) for end in ("from", "to")))
        notes = [f"largest amplitude: {largest[at]:.4g} m at {where}", shown.attrs["message"]]
        return Table(f"response along {self.parameter}", head, rows, notes)


def response_curve(
    model: Model, *, of: Any = None, step: float = 0.01, progress: bool | Report | None = None, **axes: Range
) -> ResponseCurve:
    """Follow how far a forced system swings along one parameter, with its folds and where contact begins.

    The curve consists of the steady motion without contact, in closed form, wherever that keeps clear of all stops, and
    of the branches of period-1 orbits with one impact, or with one in each half of the period, that begin where it
    grazes. Branches are followed through folds, stable and unstable parts alike.

    Parameters
    ----------
    model : ImpactOscillator, ImpactSystem or family
        The model; it needs a periodic load or a moving stop.
    of : str, int or sequence of n float, optional
        What is observed, as in `response_of`: a point, a stop (its clearance) or a coordinate.
    step : float, 1e-6 to 0.5
        Longest step along branches, as in `continue_orbit`, and share of the range between steady motions.
    progress : bool or callable, optional
        None shows a temporary line on a terminal or in a notebook if it takes more than a second.
        True shows a count; a callable gets (orbits done, None, None) and stops the computation by returning False.
    **axes : tuple of two float
        One parameter and its lowest and highest value, such as ``omega=(280, 340)``. Tables and figures show a quantity
        of pint in its own unit.

    Returns
    -------
    ResponseCurve
        With `dataset` (amplitude, rms, mean and first harmonic at each point of the curve), `branches` and `message`.

    Raises
    ------
    ValueError
        There is not exactly one range, `of` does not name anything in the model, or the model has no periodic load.

    Notes
    -----
    Motions with more impacts per period, subharmonic and chaotic motions are not part of the curve: where it is
    unstable, a `bifurcation_diagram` shows what the system does. The motion without contact counts as stable, also
    without damping, where nearby motions do not settle to it. Branches that are not connected to the curve are
    found if they exist at the middle or at an end of an interval with contact. For accuracy and cost see
    `continue_orbit` and `response_of`.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> stop = vi.Stop(direction=1, gap=1.0, stiffness=0.5, damping=0.0)
    >>> force = vi.Force(omega=1.0, harmonics={1: 0.1})
    >>> system = vi.ImpactSystem(mass=1.0, damping=0.05, stiffness=1.0, force=force, stops=[stop])
    >>> curve = vi.response_curve(system, omega=(0.8, 1.4), step=0.05)
    >>> [(point.kind, round(point.value, 6)) for point in curve.special]
    [('grazing', 0.955059), ('fold', 1.046094), ('fold', 1.040426), ('grazing', 1.041807)]
    >>> f"{float(curve.dataset['amplitude'].max()):.2f} m"
    '1.93 m'
    """
    check_model(model)
    if len(axes) != 1:
        raise invalid("axes", tuple(axes), "exactly one parameter with its range", "for example omega=(1.0, 2.0)")
    ((parameter, ends),) = axes.items()
    check_apart(axes, DISPLACEMENTS)
    design = model.at()
    form = as_system(design).modal()
    if not (form.forces.any() or form.motions.any()):
        instead = "" if design.energy_changes else "; follow a free vibration with continue_orbit along its energy"
        raise ValueError(f"`model` has no periodic load and no moving stop, and a response curve needs one{instead}")
    units = units_of({parameter: ends}, model.parameters) if parameter in model.parameters else {}
    ends, longest = check_range(model, parameter, ends, None), check_share("step", step)
    observed(as_system(design), of)

    @cache
    def system_at(value: float) -> ImpactSystem:
        system: ImpactSystem = as_system(model.at(**{parameter: value}))
        return system

    values = _grid(system_at, ends, longest)
    free, touching = _without_contact(system_at, values)
    with reporter(progress, "orbits") as report:
        branches, stopped = _branches(model, parameter, ends, touching, longest, report)
    if stopped and not (free or branches):
        raise ValueError("stopped by `progress` before a motion was found")
    if not (free or branches):
        raise NoCurve(
            f"no periodic motion was found along {span_text(model, parameter, ends)}, neither without contact nor with "
            "one impact per period; a bifurcation diagram shows what the system does"
        )
    message = (
        f"{counted(len(free), 'part')} without contact and {counted(len(branches), 'part')} with contact, along "
        f"{span_text(model, parameter, ends)}"
    )
    arguments = {"range": ends, "of": of if isinstance(of, str | int | None) else list(of), "step": longest}
    branches = [replace(branch, units=units) for branch in branches]
    return ResponseCurve(parameter, of, model, free, branches, message, arguments, units)


def _grid(system_at: Callable[[float], ImpactSystem], ends: Range, longest: float) -> Floats:
    """Return evenly spaced values, and more where a harmonic of the load passes the resonance of a mode."""

    def lags(value: float) -> Floats:
        form = system_at(value).modal()
        rates = form.omega * form.orders[:, None]
        lagging: Floats = np.arctan2(rates * np.diag(form.damping), form.squares - rates**2)
        return lagging

    values = np.linspace(*ends, math.ceil(1.0 / longest) + 1).tolist()
    known, finest = {value: lags(value) for value in values}, FINEST * (ends[1] - ends[0])
    waiting = list(pairwise(values))
    while waiting:
        low, high = waiting.pop()
        if high - low > finest and np.abs(known[high] - known[low]).max() > TURNED:
            middle = 0.5 * (low + high)
            known[middle] = lags(middle)
            waiting += [(low, middle), (middle, high)]
    return np.array(sorted(known))


def _without_contact(system_at: Callable[[float], ImpactSystem], values: Floats) -> tuple[list[Floats], list[Range]]:
    """Return the values at which the steady motion touches no stop, part by part, and the intervals between them."""
    from scipy.optimize import brentq, minimize_scalar

    def margin(value: float) -> float:
        motion = steady_motion(system_at(value))
        return -math.inf if motion is None else float(motion.clearances().min(initial=math.inf))

    margins = [margin(value) for value in values.tolist()]
    for at in range(len(values) - 1, -1, -1):  # a shallow touch between values, or a narrow part without contact
        around, sign = slice(max(at - 1, 0), at + 2), 1.0 if margins[at] >= 0.0 else -1.0
        if not sign * margins[at] <= min(sign * beside for beside in margins[around]) < math.inf:
            continue
        span = values[around][[0, -1]]
        signed, close = partial(lambda sign, value: sign * margin(value), sign), 1e-7 * float(np.ptp(span))
        nearest = minimize_scalar(signed, bounds=span, method="bounded", options={"xatol": close})
        if -math.inf < nearest.fun < 0.0:
            place = int(np.searchsorted(values, nearest.x))
            values = np.insert(values, place, nearest.x)
            margins.insert(place, sign * float(nearest.fun))
    ends, narrow = [float(values[0])], 1e-14 * (values[-1] - values[0])
    for (low, before), (high, after) in pairwise(zip(values.tolist(), margins, strict=True)):
        if (before >= 0.0) == (after >= 0.0):
            continue
        graze = low if before >= 0.0 else high
        if math.isfinite(before) and math.isfinite(after):
            graze = float(brentq(margin, low, high, xtol=narrow))
        ends.append(graze)
    parts, clear = [*pairwise([*ends, float(values[-1])])], margins[0] >= 0.0  # with and without contact in turn
    free = [np.unique([low, *values[(low < values) & (values < high)], high]) for low, high in parts[not clear :: 2]]
    return free, parts[clear::2]


def _branches(
    model: Model, parameter: str, ends: Range, touching: list[Range], longest: float, report: Report
) -> tuple[list[Branch], bool]:
    """Return the branches of orbits with contact that begin near the ends or in the middle of each interval.

    Also return whether `report` stopped the search.
    """
    branches: list[Branch] = []
    done = 0

    def count(number: int, *_: Any) -> Any:
        return report(done + number, None, None)  # type: ignore[arg-type]

    for low, high in touching:
        inside = INSIDE * (high - low)
        for value in (low + inside, high - inside, 0.5 * (low + high)):
            if count(0) is False:
                return branches, True
            for orbit in _orbits(model.replace(**{parameter: value})):
                if any(_on(branch, value, orbit) for branch in branches):
                    continue
                with suppress(ValueError):
                    branches.append(continue_orbit(orbit, parameter, ends, step=longest, progress=count, virtual=False))
                    done += len(branches[-1].orbits)
    return branches, False


def _orbits(model: Model) -> Iterator[Any]:
    """Yield the admissible period-1 orbits with one impact, or with one in each half."""
    found = list(find_orbit(model))
    if not model.at().forgets:
        found += find_orbit(model, symmetric=True)
    yield from (orbit for orbit in found if orbit.admissible and orbit.n_impacts > 0)


def _on(branch: Branch, value: float, orbit: Any) -> bool:
    """Return whether an orbit lies on a branch, between two of its orbits in parameter and speed, on the same stops."""
    alike = {_struck(other) for other in branch.orbits}
    rows = np.array([[other.value(branch.parameter), max(other.velocities)] for other in branch.orbits])
    return _struck(orbit) in alike and covered(rows, value, max(orbit.velocities))


def _struck(orbit: Any) -> Any:
    """Return the stops that an orbit strikes; None where there is one stop only."""
    return None if orbit.oscillator.forgets else frozenset(orbit.stops)
