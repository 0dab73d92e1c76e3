"""The effect of impacts on each support: rates, speeds, impulses, forces and power."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.dataset import arguments_of, dataset_of, model_of, plain_variable, variable
from vibroimpact.labels import impulses_of
from vibroimpact.matrices import numbers
from vibroimpact.model import is_model
from vibroimpact.model.elements import REPORTS
from vibroimpact.parameters import Parameter, choice, invalid, whole_number
from vibroimpact.sections import impact_section

if TYPE_CHECKING:
    import xarray as xr

    from vibroimpact.model import Model

CLASSES = 20  # of impact speeds, by default


def impact_statistics(
    source: Model | xr.Dataset,
    *,
    by: str = "group",
    classes: Any = CLASSES,
    rest_time: float = 0.0,
    transient_impacts: int = 100,
    sample_impacts: int = 5000,
) -> xr.Dataset:
    r"""Return rates, speeds, impulses and losses of the impacts of a motion on each support.

    Parameters
    ----------
    source : ImpactOscillator, ImpactSystem, family or xarray.Dataset
        A model, whose settled motion from rest is followed; or the result of `impact_section` or `simulate`.
    by : str
        ``"group"`` adds up the stops of a group (see `Stop`), ``"stop"`` lists each stop by itself.
    classes : int >= 1, or sequence of float
        Number of classes of impact speeds, from 0 to the fastest impact; or their edges in m/s, ascending.
    rest_time : float, >= 0
        In s. An impact that begins less than this after the end of the previous impact on the same support is its
        rebound, and belongs to the same burst. With 0, each impact is a burst.
    transient_impacts, sample_impacts : int
        For a model: impacts to skip, then to keep.

    Returns
    -------
    xarray.Dataset
        Over `stop`, the names of groups or stops: `impacts`, `bursts`, `rate` in 1/s, `impacts_per_period`;
        `mean_velocity`, `rms_velocity`, `max_velocity` in m/s; `mean_impulse`, `max_impulse` in N s; `mean_force` in N,
        the sum of impulses divided by the time; `power` in W, the energy lost at the stop divided by the time (the work
        rate of wear by impact); `rest_fraction`; `rest_force` in N, the impulses of rests divided by the time. If a
        stop is compliant, also `mean_peak_force`, `peak_force` in N, `mean_contact_time` in s, `contact_fraction`,
        `max_penetration` in m. `number` (stop, velocity_class) is the histogram, with `velocity_from` and
        `velocity_to` in m/s; `duration` is the time in s. Means and largest values of a support without impacts are
        NaN, and so is `impacts_per_period` of a model without a driving period.

    Raises
    ------
    ValueError
        The source is something else, an argument is out of range, or fewer than two impacts were kept.

    Notes
    -----
    The time of a section runs from its first impact, which is not counted, to its last one, so that a periodic motion
    is counted exactly over whole cycles. Statistics of chaos are estimates from N impacts, with relative errors of
    about :math:`1/\sqrt{N}`. In a complete chatter, the impacts listed in the section are counted. What a stop carries
    while a mass rests at it is in `rest_force` alone. Contacts slide without friction, so no work of sliding is
    included. Cost: that of the section.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> statistics = impact_statistics(vi.ImpactOscillator(omega=2.0))
    >>> [round(float(statistics[name].item()), 4) for name in ("impacts_per_period", "mean_velocity", "power")]
    [1.0, 6.2264, 2.2213]
    """
    choice("by", by, ("group", "stop"))
    motion: Any = source
    if is_model(source):
        motion = impact_section(source, transient_impacts=transient_impacts, sample_impacts=sample_impacts)
    record, model = _record(motion), model_of(motion)
    support = dict(zip(model.stop_names, model.groups if by == "group" else model.stop_names, strict=True))
    names = list(dict.fromkeys(support.values()))
    struck = np.array([names.index(support[name]) for name in record.stops], int)
    edges = _edges(classes, float(record.columns["velocity"].max(initial=0.0)))
    gap = Parameter("rest_time", "rest time", "s", low=0.0).check(rest_time)
    rows = [
        _of_support(record, struck == at, gap, edges, model.period if model.periodic else np.nan)
        for at in range(len(names))
    ]
    for row, name in zip(rows, names, strict=True):
        row |= {
            quantity: sum(record.rests[stop][quantity] for stop in support if support[stop] == name) / record.duration
            for quantity in record.rests[model.stop_names[0]]
        }
    variables = {
        name: variable(name, ("stop", "velocity_class") if name == "number" else "stop", [row[name] for row in rows])
        for name in rows[0]
    }
    variables["duration"] = plain_variable((), record.duration, {"long_name": "time", "units": "s", "symbol": "T"})
    kept = {name: text for name, text in motion.attrs.items() if name not in ("function", "arguments")}
    arguments = {"by": by, "rest_time": gap} | arguments_of(motion)
    coords = {"stop": plain_variable("stop", np.array(names), {"long_name": "support"}), **_classes(edges)}
    attrs = kept | {"function": "impact_statistics", "arguments": json.dumps(arguments)}
    return dataset_of(variables | {"status": motion["status"].variable}, coords, attrs)


@dataclass(frozen=True)
class _Record:
    """Impacts within a time: their columns and stops; time in s and impulse in N s of all rests at each stop."""

    columns: dict[str, Floats]
    stops: list[str]
    rests: dict[str, dict[str, float]]
    duration: float


def _record(source: Any) -> _Record:
    """Return the impacts in a section after its first one, or all in a simulated motion."""
    function = getattr(source, "attrs", {}).get("function")
    if function not in ("impact_section", "simulate"):
        raise invalid("source", source, "a model, or a result of `impact_section` or `simulate`")
    prefix = "impact_" * (function == "simulate")
    model: Any = model_of(source)
    columns = {name: source[prefix + name].values for name in ("time", "velocity")}
    columns |= {name: source[name].values for name in REPORTS if name in source}
    stops = source[f"{prefix}stop"].values if f"{prefix}stop" in source else np.full(source.sizes["impact"], "stop")
    if "impulse" not in columns:
        columns |= {name: column.values for name, column in impulses_of(model, columns["velocity"]).items()}
    if prefix:
        begin, end = source["time"].values[[0, -1]].tolist()
    else:
        if len(stops) < 2:
            raise ValueError(
                f"`source` must hold at least two impacts, got {len(stops)}: rates are taken over the "
                "time between the first and the last one"
            )
        begin, end = columns["time"][[0, -1]].tolist()
        columns, stops = {name: column[1:] for name, column in columns.items()}, stops[1:]
    if end <= begin:
        raise invalid("source", source, "a motion over some time")
    resting = source["stick_stop"].values if "stick_stop" in source else np.full(source.sizes["stick"], "stop")
    until = np.nan_to_num(source["release_time"].values, nan=end)
    spans = np.clip(until, begin, end) - np.clip(source["stick_time"].values, begin, end)
    sums = {"rest_fraction": spans}
    if "stick_impulse" in source:
        sums["rest_force"] = source["stick_impulse"].values
    rests = {
        name: {quantity: float(values[resting == name].sum()) for quantity, values in sums.items()}
        for name in model.stop_names
    }
    return _Record(columns, stops.tolist(), rests, end - begin)


def _of_support(record: _Record, at: Any, rest_time: float, edges: Floats, period: float) -> dict[str, Any]:
    """Return the quantities of the impacts on one support."""
    columns = {name: column[at] for name, column in record.columns.items()}
    count, speeds = int(at.sum()), columns["velocity"]
    ends = columns["time"] + np.nan_to_num(columns.get("contact_time", 0.0 * speeds))
    apart = columns["time"][1:] - np.maximum.accumulate(ends)[:-1] >= rest_time

    def over(name: str, fold: Any) -> float:
        values = columns[name][np.isfinite(columns[name])]
        return float(fold(values)) if len(values) else np.nan

    row = {
        "impacts": count,
        "bursts": int(apart.sum()) + (count > 0),
        "rate": count / record.duration,
        "impacts_per_period": count * period / record.duration,
        "mean_velocity": over("velocity", np.mean),
        "rms_velocity": float(np.sqrt(over("velocity", lambda values: np.mean(values**2)))),
        "max_velocity": over("velocity", np.max),
        "mean_impulse": over("impulse", np.mean),
        "max_impulse": over("impulse", np.max),
        "mean_force": np.nansum(columns["impulse"]) / record.duration,
        "power": np.nansum(columns["energy_lost"]) / record.duration,
        "number": np.histogram(speeds, edges)[0],
    }
    if "peak_force" in columns:
        row |= {
            "mean_peak_force": over("peak_force", np.mean),
            "peak_force": over("peak_force", np.max),
            "mean_contact_time": over("contact_time", np.mean),
            "contact_fraction": np.nansum(columns["contact_time"]) / record.duration,
            "max_penetration": over("penetration", np.max),
        }
    return row


def _edges(classes: Any, fastest: float) -> Floats:
    """Return the edges of classes of speeds."""
    if np.ndim(classes) == 0:
        return np.linspace(0.0, fastest or 1.0, whole_number("classes", classes, 1) + 1)
    edges: Floats = numbers("classes", classes, 1)
    if len(edges) < 2 or not (np.diff(edges) > 0.0).all():
        raise invalid("classes", classes, "a whole number, or two or more ascending edges in m/s")
    return edges


def _classes(edges: Floats) -> dict[str, Any]:
    """Return the coordinates of classes: the middle, the lower and the upper edge of each."""
    parts = {"class": 0.5 * (edges[1:] + edges[:-1]), "from": edges[:-1], "to": edges[1:]}
    words = {"class": "middle of the class of impact velocities", "from": "its lower edge", "to": "its upper edge"}
    return {
        f"velocity_{name}": plain_variable(
            "velocity_class", values, {"long_name": words[name], "units": "m/s", "symbol": "I"}
        )
        for name, values in parts.items()
    }
