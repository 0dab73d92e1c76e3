"""The results of continuation: branches, bifurcation points and boundaries, and their datasets."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.dataset import (
    bifurcation_name,
    dataset_of,
    flags,
    label,
    plain_variable,
    provenance,
    variable,
)
from vibroimpact.indices import DISPLACEMENTS, EVERY
from vibroimpact.model import Model
from vibroimpact.model.units import DISPLAY, display, displayed_text
from vibroimpact.orbits.orbit import SPLIT
from vibroimpact.orbits.results import number, orbit_variables
from vibroimpact.orbits.systems.response import Response, response_of
from vibroimpact.parameters import ENERGY, counted, labelled, parameter_of, with_unit
from vibroimpact.showing import Shown, Table

if TYPE_CHECKING:
    import xarray as xr

ENDS = {
    "range": "at the end of the range",
    "grazing": "where it grazes the stop",
    "inadmissible": "where its orbits become inadmissible",
    "period_doubling": "at the period doubling it comes from",
    "pitchfork": "at the pitchfork it comes from",
    "closed": "where it began (closed)",
    "impacts_merge": "where two impacts merge",
    "end_of_sticking": "where the end of its chatter meets the release",
    "fold": "where it folds",
    "resonance": "where its pair of multipliers becomes real",
    "lost": "where no next orbit is found",
    "budget": "at the largest number of orbits followed",
    "stopped": "where it was stopped",
    "unstable": "where its orbit becomes unstable",
    "joined": "where it joins another curve",
}
MISS = "residual of the defining condition"
KINDS = ("fold", "period_doubling", "grazing", "end_of_sticking", "neimark_sacker", "pitchfork")


@dataclass(frozen=True)
class BifurcationPoint:
    """A bifurcation: its kind, the parameter and its value, and the orbit at it.

    Parameters
    ----------
    kind : {"fold", "period_doubling", "grazing", "end_of_sticking", "neimark_sacker", "pitchfork"}
        "fold": a multiplier is 1. "period_doubling": a multiplier is -1. "grazing": the orbit touches a stop, or one of
        its impacts has velocity zero. "end_of_sticking": the end of a chatter meets the release. "neimark_sacker": a
        complex pair of multipliers has modulus 1. "pitchfork": two asymmetric orbits, mirror images of each other,
        branch off a symmetric orbit (a multiplier of the half map is -1).
    parameter : str
        The parameter that varied along the branch.
    value : float
        The value of the parameter at the bifurcation.
    orbit : Orbit
        The orbit at the bifurcation.
    residual : float
        Residual of the orbit's flights and its defining condition, relative to its size.
    touch_phase : float
        Driving phase of the graze, in [0, 1); NaN for other kinds.
    """

    kind: str
    parameter: str
    value: float
    orbit: Any
    residual: float = 0.0
    touch_phase: float = math.nan

    @property
    def message(self) -> str:
        """The point as a sentence."""
        touch = "" if math.isnan(self.touch_phase) else f" at phase {self.touch_phase:.6g}"
        return (
            f"{bifurcation_name(self.kind)} of the {self.orbit.name} orbit{touch}: {self.parameter} = {self.value:.12g}"
        )


@dataclass(frozen=True, repr=False)
class Branch(Shown):
    """The orbits of one (n, p) type along a parameter, in the order of the curve.

    Attributes
    ----------
    parameter : str
        The parameter that varies.
    orbits : list of Orbit
        The orbits along the branch; contacts with compliant stops may appear, vanish and change places along it.
    special : list of BifurcationPoint
        The bifurcations on the branch, in its order; their orbits are among `orbits`.
    outcome : tuple of two str
        Why the branch ends at its first and at its last orbit: "range", "grazing", "inadmissible", "period_doubling",
        "pitchfork", "closed", "impacts_merge", "end_of_sticking", "fold", "lost", "budget" or "stopped".
    message : str
        The outcome in sentences.
    units : dict
        The unit of the parameter in tables and figures, if its range was given as quantities in another one.
    """

    parameter: str
    orbits: list[Any]
    special: list[BifurcationPoint]
    outcome: tuple[str, str]
    message: str
    arguments: dict[str, Any] = field(default_factory=dict, repr=False)
    units: dict[str, str] = field(default_factory=dict, repr=False)

    @property
    def values(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """The parameter at each orbit."""
        return np.array([orbit.value(self.parameter) for orbit in self.orbits])

    @property
    def frequencies(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Cycles per second at each orbit, in Hz; along the energy they vary."""
        return np.array([orbit.frequency for orbit in self.orbits])

    def _table(self) -> Table:
        attrs = axis_labels(self.orbits[0].model, self.parameter, self.units)
        factor, shown = display(attrs)
        rows = [
            (bifurcation_name(point.kind), factor * point.value, max(point.orbit.velocities, default=0.0))
            for point in self.special
        ]
        return Table(
            f"{self.orbits[0].name} along {self.parameter}: {counted(len(self.orbits), 'orbit')}",
            ("bifurcation", labelled(self.parameter, shown["units"]), "hardest impact [m/s]"),
            rows,
            [displayed_text(self.message, self.parameter, attrs)],
        )

    @property
    def dataset(self) -> xr.Dataset:
        """The branch as a labelled dataset over `point`, its special points over `special`."""
        p, model, units = max(len(orbit.velocities) for orbit in self.orbits), self.orbits[0].model, self.units
        several = zip_longest(*(orbit.multipliers for orbit in self.orbits), fillvalue=math.nan)
        multipliers = np.array(list(several)).T  # a centre that drag brakes has one more than a free one
        content = orbit_variables(self.orbits, p, "point") | {
            "multiplier_real": number(("point", "multiplier"), multipliers.real, "real part of multiplier"),
            "multiplier_imag": number(("point", "multiplier"), multipliers.imag, "imaginary part of multiplier"),
            "special_kind": kind_variable("special", [point.kind for point in self.special]),
            "special_value": axis(model, self.parameter, "special", [point.value for point in self.special], units),
            "special_residual": number("special", [point.residual for point in self.special], MISS),
            "special_touch_phase": variable("phase", "special", np.array([q.touch_phase for q in self.special])),
        }
        if self.parameter == ENERGY.name:
            cycles = {"long_name": "frequency of the cycle", "units": "Hz"}
            neutral = [orbit.spectral_radius <= 1.0 + SPLIT for orbit in self.orbits]
            words = "whether no multiplier is larger than 1", ("unstable", "neutrally_stable")
            content |= {
                "cycle_frequency": plain_variable("point", self.frequencies, cycles),
                "stable": flags("point", neutral, *words),
            }
        of_special = orbit_variables([point.orbit for point in self.special], p, "special")
        content |= {f"special_{name}": of_special[name] for name in ("velocity", "phase")}
        return _along(self, content, {self.parameter: self.values}, "continue_orbit", {"parameter": self.parameter})

    def response(self, of: Any = None) -> xr.Dataset:
        """Return amplitude, mean, rms and harmonic of a displacement on each orbit.

        Parameters
        ----------
        of : str, int or sequence of n float, optional
            As in `response_of`.

        Returns
        -------
        xarray.Dataset
            `amplitude`, `rms`, `mean`, `harmonic_amplitude` (m) and `harmonic_phase` (rad) over `point`, with the
            parameter.

        Raises
        ------
        ValueError
            `of` is none of the model's points, stops or coordinates, or an orbit rests at a stop.

        Examples
        --------
        >>> import vibroimpact as vi
        >>> orbit = vi.find_orbit(vi.ImpactOscillator(omega=2.5))[0]
        >>> branch = vi.continue_orbit(orbit, "omega", (2.4, 2.6))
        >>> swings = branch.response()["amplitude"]
        >>> f"{float(swings.min()):.2f} to {float(swings.max()):.2f} m"
        '0.33 to 0.50 m'
        """
        content = responses("point", [response_of(orbit, of=of) for orbit in self.orbits])
        values = axis(self.orbits[0].model, self.parameter, "point", self.values, self.units)
        return dataset_of(content, {self.parameter: values})


def responses(dim: str, rows: Sequence[Response] | Floats) -> dict[str, Any]:
    """Return responses as labelled variables."""
    columns = np.array(rows).reshape(-1, len(DISPLACEMENTS)).T
    named = zip(DISPLACEMENTS, columns, strict=True)
    return {name: plain_variable(dim, column, EVERY[name].label) for name, column in named}


@dataclass(frozen=True, repr=False)
class Boundary(Shown):
    """The curve of a bifurcation in two parameters.

    Attributes
    ----------
    kind : str
        As in a `BifurcationPoint`.
    parameters : tuple of two str
        The parameters of the plane.
    orbits : list of Orbit
        The orbits along the curve, each at the bifurcation.
    residuals : list of float
        Residual of each orbit's flights and its defining condition, relative to its size.
    touch_phases : list of float
        Driving phase of the graze, or of the release at an end of sticking; NaN for other kinds.
    outcome : tuple of two str
        Why the curve ends at its first and at its last point: "range", "closed", "inadmissible", "impacts_merge",
        "lost", "resonance", "budget", "stopped", or, for a part of a curve, "unstable" or "joined" (the rest lies on
        another curve).
    message : str
        The outcome in sentences.
    touched : str
        For grazes of systems: name of the stop that is touched; else empty.
    units : dict
        Units of the parameters in tables and figures, by name, if their ranges were given as quantities in others.
    """

    kind: str
    parameters: tuple[str, str]
    orbits: list[Any]
    residuals: list[float]
    touch_phases: list[float]
    outcome: tuple[str, str]
    message: str
    arguments: dict[str, Any] = field(default_factory=dict, repr=False)
    touched: str = ""
    units: dict[str, str] = field(default_factory=dict, repr=False)

    @property
    def values(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """The two parameters at each point, shape (points, 2)."""
        return np.array([[orbit.value(name) for name in self.parameters] for orbit in self.orbits])

    def _table(self) -> Table:
        first, message = self.orbits[0], self.message
        heads, factors = [], []
        for name in self.parameters:
            attrs = axis_labels(first.model, name, self.units)
            factor, shown = display(attrs)
            heads.append(labelled(name, shown["units"]))
            factors.append(factor)
            message = displayed_text(message, name, attrs)
        values = self.values * factors
        lows, highs = np.nanmin(values, axis=0).tolist(), np.nanmax(values, axis=0).tolist()
        return Table(
            f"{bifurcation_name(self.kind)} of {first.name}: {counted(len(self.orbits), 'point')}",
            ("parameter", "smallest", "largest"),
            list(zip(heads, lows, highs, strict=True)),
            [message],
        )

    @property
    def dataset(self) -> xr.Dataset:
        """The curve as a labelled dataset over `point`."""
        orbits, width = self.orbits, max(len(orbit.velocities) for orbit in self.orbits)
        content = orbit_variables(orbits, width, "point") | {
            "kind": kind_variable((), self.kind),
            "residual": number("point", self.residuals, MISS),
            "touch_phase": variable("phase", "point", np.array(self.touch_phases)),
            "trace": number("point", [orbit.trace for orbit in orbits], "trace of the cycle's Jacobian"),
            "determinant": number("point", [o.determinant for o in orbits], "determinant of the cycle's Jacobian"),
        }
        values = dict(zip(self.parameters, self.values.T, strict=True))
        data = _along(self, content, values, "continue_boundary", {"kind": self.kind, "parameters": self.parameters})
        return data.assign_attrs(touched=self.touched) if self.touched else data


def _along(
    curve: Branch | Boundary, content: dict[str, Any], values: dict[str, Any], call: str, arguments: dict[str, Any]
) -> xr.Dataset:
    """Return variables along a curve as a dataset with the parameters' values, the outcome and the provenance."""
    first = curve.orbits[0]
    name = {"n_periods": first.n_periods, "n_impacts": first.n_impacts}
    ends = {"outcome": " ".join(curve.outcome), "message": curve.message}
    struck = {} if first.oscillator.forgets else {"stops": " ".join(first.stops)}
    attrs = provenance(call, first.model, arguments | name | curve.arguments) | name | struck | ends
    coords = {key: axis(first.model, key, "point", column, curve.units) for key, column in values.items()}
    return dataset_of(content, coords, attrs)


def kinds_of(model: Model) -> tuple[str, ...]:
    """Return the kinds of boundaries that a model's motions can have.

    For one mass at one stop, the product of the two multipliers is below 1 and there is no symmetry, which excludes
    some kinds. An end of sticking is followed only where a rest determines the whole state.
    """
    return KINDS[:4] if model.at().forgets else tuple(kind for kind in KINDS if kind != "end_of_sticking")


def course(what: str, orbits: Sequence[Any], names: Sequence[str], ends: tuple[str, str]) -> str:
    """Return the two ends of a branch or a curve, and why it ends there, as a sentence."""
    first, last = (
        ", ".join(value_text(orbits[j].model, name, orbits[j].value(name)) for name in names) for j in (0, -1)
    )
    if "closed" in ends:
        return f"a closed {what} through {last}"
    return f"from {first}, {ENDS[ends[0]]}, to {last}, {ENDS[ends[1]]}"


def value_text(model: Model, name: str, value: float, digits: int = 12) -> str:
    """Return a parameter and its value, with its unit."""
    return with_unit(f"{name} = {value:.{digits}g}", parameter_of(model, name).unit)


def span_text(model: Model, name: str, ends: tuple[float, float]) -> str:
    """Return a parameter and its range, with its unit."""
    return with_unit(f"{name} from {ends[0]:.12g} to {ends[1]:.12g}", parameter_of(model, name).unit)


def axis_labels(model: Model, name: str, units: Mapping[str, str]) -> dict[str, str]:
    """Return the labels of a parameter of a model, with the unit in which it is shown if that is another."""
    return label(parameter_of(model, name)) | ({DISPLAY: units[name]} if name in units else {})


def axis(model: Model, name: str, dims: Any, values: Any, units: Mapping[str, str]) -> xr.Variable:
    """Return values of a parameter of a model, labelled."""
    return plain_variable(dims, np.asarray(values, dtype=np.float64), axis_labels(model, name, units))


def kind_variable(dims: Any, kinds: Any) -> xr.Variable:
    """Return kinds of special points as flags."""
    codes = KINDS.index(kinds) if isinstance(kinds, str) else [KINDS.index(kind) for kind in kinds]
    return flags(dims, codes, "kind of boundary", KINDS)
