"""Two designs side by side."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

import numpy as np

from vibroimpact.dataset import (
    VARIABLES,
    dataset_of,
    flags,
    label,
    plain_variable,
    provenance,
    status_variable,
    variable,
)
from vibroimpact.indices import INDICES, shown_spread, spread_scale
from vibroimpact.model import Model
from vibroimpact.model.units import shown_as, shown_value
from vibroimpact.options import Tolerances
from vibroimpact.parameters import Parameter, hertz, invalid, labelled, several
from vibroimpact.progress import Report, reporter
from vibroimpact.showing import aligned
from vibroimpact.status import Status
from vibroimpact.verdict.changes import advice_text, axis_name, ends_of
from vibroimpact.verdict.describe import Verdict, describe
from vibroimpact.verdict.edges import BOUNDARIES, ONSETS, Edge
from vibroimpact.verdict.hits import undecided_share
from vibroimpact.verdict.ranges import percent

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, eq=False)
class Comparison:
    """Two verdicts side by side; `str()` is a table.

    Attributes
    ----------
    names : tuple of two str
        The names of the designs.
    verdicts : tuple of two Verdict
        The result of `describe` for each.
    """

    names: tuple[str, str]
    verdicts: tuple[Verdict, Verdict]

    def __str__(self) -> str:
        return "\n".join([*aligned([("", *self.names), *self._rows()]), *self._advice()])

    def _rows(self) -> Iterator[tuple[str, str, str]]:
        """Yield label and both cells; a star marks parameters that differ."""
        first, second = self.verdicts
        models, units = self._models(), first.units
        for parameter, pair in self._parameters():
            star = " *" if pair[0] != pair[1] else ""
            owner = models[0] if parameter.name in models[0].parameters else models[1]
            shown, unit = shown_as(owner, parameter.name, units)
            cells = [
                _number(value if math.isnan(value) else shown_value(owner, parameter.name, value, units))
                for value in pair
            ]
            yield labelled(shown.long_name, unit) + star, cells[0], cells[1]
            if unit == "rad/s":
                frequency = labelled(parameter.long_name.replace("angular ", ""), "Hz")
                yield frequency + star, _number(hertz(pair[0])), _number(hertz(pair[1]))
        yield "motion, from rest", first.motion.name, second.motion.name
        yield "hardest hit, from rest [m/s]", _number(first.max_velocity), _number(second.max_velocity)
        yield "hardest hit, from any initial condition [m/s]", _worst(first), _worst(second)
        for name in INDICES:
            yield labelled(*VARIABLES[name][:2]), _index(first, name), _index(second, name)
        yield "mean power lost [W]", _number(first.power), _number(second.power)
        for (varied, direction), edges in self._boundaries().items():
            name = axis_name(first.model if edges[0] else second.model, varied, units)
            ends = [ends_of(verdict, edge) if edge else () for verdict, edge in zip(self.verdicts, edges, strict=True)]
            for at, (one, other) in enumerate(zip_longest(*ends, fillvalue=("-", ""))):
                label = f"{name}, {'down' if direction < 0 else 'up'} to"
                yield label if at == 0 else "", "\n".join(one).rstrip(), "\n".join(other).rstrip()
        yield "coexisting motions", _others(first), _others(second)

    def _parameters(self) -> Iterator[tuple[Parameter, tuple[float, float]]]:
        """Yield the parameters of both designs: their models' own if these are the same, else the oscillators'."""
        models = self._models()
        first, second = (model.values for model in models)
        for name in dict.fromkeys([*first, *second]):
            model = models[0] if name in first else models[1]
            yield model.parameters[name], (first.get(name, math.nan), second.get(name, math.nan))

    def _models(self) -> list[Model]:
        """Return the models of both designs if these have the same parameters, else their oscillators."""
        models: list[Model] = [verdict.model for verdict in self.verdicts]
        alike = set(models[0].values) == set(models[1].values)
        return models if alike else [verdict.oscillator for verdict in self.verdicts]

    def _boundaries(self) -> dict[tuple[str, int], list[Edge | None]]:
        """Return the boundaries of both designs by parameter and direction; None if it was not varied."""
        found = [{(edge.parameter, edge.direction): edge for edge in verdict.boundaries} for verdict in self.verdicts]
        return {key: [edges.get(key) for edges in found] for key in dict.fromkeys([*found[0], *found[1]])}

    def _advice(self) -> Iterator[str]:
        for name, verdict in zip(self.names, self.verdicts, strict=True):
            if verdict.advice:
                yield f"to soften the impacts of {name}: {advice_text(verdict.model, verdict.advice[0], verdict.units)}"

    def to_dict(self) -> dict[str, Any]:
        """Return both verdicts as plain dictionaries, ready for JSON."""
        return {name: verdict.to_dict() for name, verdict in zip(self.names, self.verdicts, strict=True)}

    @property
    def dataset(self) -> xr.Dataset:
        """Parameters, indices, boundaries and the hardest hit from any initial condition, over `design`."""
        content: dict[str, Any] = {
            parameter.name: plain_variable("design", list(values), label(parameter))
            for parameter, values in self._parameters()
        }
        for name, index in INDICES.items():
            values = np.array([verdict.indices[name] for verdict in self.verdicts])
            lacking = [verdict.no_value.get(name) for verdict in self.verdicts]
            why = {"no_value": lacking[0]} if all(lacking) else {}
            content[name] = variable(name, "design", values.astype(index.dtype), **why)
        power, motion = zip(*((verdict.power, verdict.motion.name) for verdict in self.verdicts), strict=True)
        content["power"] = plain_variable("design", list(power), {"long_name": "mean power lost", "units": "W"})
        content["motion"] = plain_variable("design", _texts(motion), {"long_name": "name of the motion"})
        content |= _worst_variables(self.verdicts)
        content["status"] = status_variable("design", [Status[v.status.upper()] for v in self.verdicts])
        boundaries = self._boundaries()
        varied = list(dict.fromkeys(parameter for parameter, _ in boundaries))
        content |= _boundary_variables([[boundaries[name, way] for way in (-1, 1)] for name in varied])
        arguments = {"names": self.names, "oscillators": [verdict.oscillator.plain() for verdict in self.verdicts]}
        return dataset_of(
            content,
            coords={"design": _texts(self.names), "parameter": _texts(varied), "direction": np.array([-1, 1], np.int8)},
            attrs=provenance("compare", self.verdicts[0].model, arguments),
        )


def _texts(items: Iterable[str]) -> np.ndarray[Any, Any]:
    """Return text as stores keep it: of any length."""
    return np.array(list(items), dtype=object)


def _worst_variables(verdicts: tuple[Verdict, Verdict]) -> dict[str, xr.Variable]:
    """Return the hardest hit from any initial condition, with its motion and the share that leads to it."""
    hit, speeds = "hardest hit from any initial condition", [_hardest(verdict) for verdict in verdicts]
    hit += " that was decided" * any(verdict.undecided for verdict in verdicts)
    names = [(verdict.harder or verdict.motion).name for verdict in verdicts]
    shares = [verdict.harder.share if verdict.harder else math.nan for verdict in verdicts]
    share = "share of the initial conditions that lead to it; none where rest does"
    undecided = "share of the initial conditions whose motions are undecided"
    return {
        "worst_velocity": plain_variable("design", speeds, {"long_name": hit, "units": "m/s"}),
        "worst_motion": plain_variable("design", _texts(names), {"long_name": f"motion with the {hit}"}),
        "worst_share": plain_variable("design", shares, {"long_name": share, "units": "1"}),
        "undecided": plain_variable(
            "design", [verdict.undecided for verdict in verdicts], {"long_name": undecided, "units": "1"}
        ),
    }


def _boundary_variables(boundaries: list[list[list[Edge | None]]]) -> dict[str, xr.Variable]:
    """Return the boundaries, by parameter, direction and design, as variables."""
    dims, shape = ("design", "parameter", "direction"), (len(boundaries), 2, 2)
    edges = [edge for parameter in boundaries for direction in parameter for edge in direction]

    def by_design(values: Iterable[Any], dtype: Any) -> np.ndarray[Any, Any]:
        return np.moveaxis(np.array(list(values), dtype).reshape(shape), -1, 0)

    def numbers(name: str, long_name: str) -> xr.Variable:
        values = by_design((getattr(edge, name, math.nan) for edge in edges), np.float64)
        return plain_variable(dims, values, {"long_name": long_name})

    def onsets(name: str, words: str) -> xr.Variable:
        values = by_design((getattr(getattr(edge, name, None), "value", math.nan) for edge in edges), np.float64)
        return plain_variable(dims, values, {"long_name": f"{words}, in the parameter's unit"})

    kinds = by_design((list(BOUNDARIES).index(edge.kind if edge else "none") for edge in edges), np.int8)
    return {
        "boundary": numbers("value", "nearest boundary, in the parameter's unit"),
        "boundary_change": numbers("change", "relative change to the nearest boundary"),
        "boundary_spacing": numbers(
            "spacing", "widest step between the values tried, as a relative change; 0 where exact"
        ),
        "boundary_half_width": numbers("half_width", "uncertainty of the nearest boundary; 0 where exact"),
        **{f"boundary_{name}": onsets(name, words) for name, words in ONSETS.items()},
        "boundary_kind": flags(dims, kinds, "kind of the nearest boundary", BOUNDARIES),
    }


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.6g}"


def _index(verdict: Verdict, name: str) -> str:
    return _number(shown_spread(verdict.indices[name], spread_scale(name, verdict.max_velocity)))


def _worst(verdict: Verdict) -> str:
    share = f" ({percent(verdict.harder.share)} of them)" if verdict.harder else ""
    return _number(_hardest(verdict)) + share + undecided_share(verdict)


def _hardest(verdict: Verdict) -> float:
    """Return the hardest hit from any initial condition that was decided; 0 if all are, and lead to no impacts."""
    if verdict.worst:
        return verdict.worst.max_velocity
    return 0.0 if not verdict.undecided and verdict.max_velocity == 0.0 else math.nan


def _others(verdict: Verdict) -> str:
    others = [f"{100.0 * m.share:.3g} % {m.name}" for m in verdict.attractors if not m.from_rest]
    if verdict.undecided:
        others.append(f"{percent(verdict.undecided)} undecided")
    return ", ".join(others) or "none"


def compare(
    a: Model,
    b: Model,
    *,
    names: tuple[str, str] = ("A", "B"),
    parameters: Iterable[str] | None = None,
    within: float = 3.0,
    units: Mapping[str, str] | None = None,
    tolerances: Tolerances | None = None,
    workers: int | None = None,
    progress: bool | Report | None = None,
) -> Comparison:
    """Compare two designs side by side: parameters, motion, every index, boundaries, ways to soften the impacts.

    Parameters
    ----------
    a, b : ImpactOscillator, ImpactSystem or family
        The two designs.
    names : tuple of two str
        Their names; not the same.
    parameters, within, units, tolerances, workers
        As in `describe`.
    progress : bool or callable, optional
        None shows a temporary line on a terminal or in a notebook if it takes more than a second.
        True shows a bar; a callable gets (parts done, parts in all, None) and stops the computation by returning False.

    Returns
    -------
    Comparison
        `str()` is a table in which a star marks the parameters that differ; `dataset` holds the table over `design`.

    Raises
    ------
    ValueError
        `a` or `b` is not a model, `names` are not two different texts, or `describe` refuses an argument.

    Notes
    -----
    Costs two verdicts. `vibroimpact.plotting.comparison_figure` draws it.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> slow, fast = (vi.ImpactOscillator(omega=omega) for omega in (1.4, 2.0))
    >>> str(compare(slow, fast, names=("slow", "fast"), parameters=[])).splitlines()[5].split()
    ['angular', 'driving', 'frequency', '[rad/s]', '*', '1.4', '2']
    """
    pair = _two_names(names)
    varied = None if parameters is None else several("parameters", parameters, "a list of names")
    with reporter(progress, "parts") as report:

        def tally(before: int, done: int, total: int, _: Any) -> Any:
            """Report the parts of a verdict that follows `before` other verdicts."""
            return report(before * total + done, 2 * total, None)

        first, second = (
            describe(
                design,
                parameters=varied,
                within=within,
                units=units,
                tolerances=tolerances,
                workers=workers,
                progress=partial(tally, before),
            )
            for before, design in enumerate((a, b))
        )
    return Comparison(pair, (first, second))


def _two_names(names: Any) -> tuple[str, str]:
    pair = tuple(names) if isinstance(names, (tuple, list)) else ()
    if len(pair) != 2 or not all(isinstance(name, str) and name for name in pair) or pair[0] == pair[1]:
        raise invalid("names", names, "two different names", 'give for example ("old", "new")')
    return pair[0], pair[1]
