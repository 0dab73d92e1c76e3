"""Motions of systems in words: the impacts on each stop, whether they repeat, and their effect on each support."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from vibroimpact.coexistence.losses import driven
from vibroimpact.motion import listed
from vibroimpact.motion.recognition import recognise, recurrence
from vibroimpact.parameters import counted, times
from vibroimpact.report.quantities import quantity
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr

    from vibroimpact.model.system import ImpactSystem

FEW = 4  # impacts of a cycle that are listed one by one
STILL = 1e-9  # of the largest coordinate: a smaller motion is rounding
# Of statistics, by name: the words before and after a quantity.
_FACTS = {
    "rate": ("", ""),
    "mean_velocity": ("mean ", ""),
    "max_velocity": ("up to ", ""),
    "mean_force": ("", " on average"),
    "rest_force": ("", " in rests"),
    "peak_force": ("up to ", ""),
    "power": ("", " lost"),
}


def system_sentence(section: xr.Dataset, system: ImpactSystem) -> str:
    """Return a sentence on whether the impacts of a system repeat, from its impact section."""
    filled, speed = Status(int(section["status"])).has_indices, section["velocity"].values
    names, codes = np.unique(section["stop"].values, return_inverse=True)
    if filled and not driven(system.modal()):
        time = section["time"].values
        p = recurrence(speed[1:], np.diff(time), codes[1:].astype(float))
        every = f"every {quantity(time[-1] - time[-1 - p], 's', 4)}; nothing drives them"
        return f"{_listed(speed[-p:], codes[-p:], names)} {every}" if p else "the sampled impacts do not repeat"
    motion, closed = recognise(section), sorted(set(section["stick_stop"].values.tolist()))
    if not motion.n_periods:
        return motion.sentence(system.period)
    if closed:
        return f"{motion.name}, closes {listed(closed)}, hardest hit {max(motion.velocities):.3g} m/s"
    p = motion.n_impacts
    return f"{motion.name}, {_listed(speed[-p:], codes[-p:], names)} every {motion.n_periods * system.period:.3g} s"


def _listed(speed: Any, cycle: Any, names: Any) -> str:
    """Return the impacts of a cycle, one by one if they are few."""
    if len(speed) <= FEW:
        return "hits at " + listed([f"{v:.3g} m/s on {names[stop]}" for v, stop in zip(speed, cycle, strict=True)])
    counts = [f"{names[stop]} ({(cycle == stop).sum()})" for stop in np.unique(cycle)]
    return f"hits at {speed.min():.3g} to {speed.max():.3g} m/s on {listed(counts)}"


def each_stop(dataset: xr.Dataset) -> Iterator[str]:
    """Yield a line for each stop that is hit or closed in a system's motion, and the number of simultaneous impacts.

    For compliant stops, the line holds the largest force, the longest contact and the deepest penetration.
    """
    simulated = "impact_stop" in dataset
    struck, speed = (dataset[f"impact_{name}" if simulated else name] for name in ("stop", "velocity"))
    closed, impulse = dataset["stick_stop"].values, dataset["impulse"].values
    for name in dict.fromkeys([*dataset["stop"].values.tolist(), *closed.tolist()]):
        on_stop, rests = struck.values == name, np.flatnonzero(closed == name)
        parts = [counted(int(on_stop.sum()), "impact")]
        if on_stop.any():
            hardest = quantity(float(speed.values[on_stop].max()), "m/s", 4)
            parts.append(f"up to {hardest} and {quantity(float(impulse[on_stop].max()), 'N s', 4)}")
        if contacts := list(_contacts(dataset.isel(impact=np.flatnonzero(on_stop)))):
            parts += contacts
        elif simulated:
            least = float(dataset["clearance"].sel(stop=name).min())
            parts.append(f"clearance at least {quantity(least, 'm', 4)}")
        if len(rests):
            parts.append(f"closes {times(len(rests))}{carried(dataset, rests)}")
        yield f"  {name}: {', '.join(parts)}"
    if "simultaneous" in dataset and (number := int(dataset["simultaneous"].sum())):
        yield f"  {counted(number, 'impact')} simultaneous with others"


def carried(dataset: xr.Dataset, rests: Any) -> str:
    """Return the impulse on a stop in some of the rests, in words; "" in results of versions that do not list it."""
    if "stick_impulse" not in dataset:
        return ""
    return f", with an impulse of {quantity(float(dataset['stick_impulse'].values[rests].sum()), 'N s', 4)} in all"


def _contacts(impacts: xr.Dataset) -> Iterator[str]:
    """Yield the largest force, the longest contact and the deepest penetration of a compliant stop."""
    most = {"peak_force": "force up to", "contact_time": "contacts of up to", "penetration": "penetration up to"}
    for name in (name for name in most if name in impacts and impacts[name].notnull().any()):
        yield f"{most[name]} {quantity(float(impacts[name].max()), impacts[name].attrs['units'], 4)}"


def moving_columns(dataset: xr.Dataset) -> list[Any]:
    """Return the displacements and velocities of a system that move; its samples are compared by these."""
    columns: list[Any] = []
    for name in ("displacement", "velocity"):
        values = dataset[name].values
        sizes = np.abs(values).max(axis=0, initial=0.0)
        columns += [
            column for column, size in zip(values.T, sizes, strict=True) if size > STILL * sizes.max(initial=0.0)
        ]
    return columns or [dataset["displacement"].values[:, 0]]


def statistics_sentences(dataset: xr.Dataset) -> Iterator[str]:
    """Yield the time, then a line for each support."""
    total = counted(int(dataset["impacts"].sum()), "impact")
    yield f"{total} in {quantity(float(dataset['duration']), 's', 4)}"
    for name in dataset["stop"].values.tolist():
        of = dataset.sel(stop=name)
        facts = [
            f"{before}{quantity(float(of[key]), of[key].attrs['units'], 4)}{after}"
            for key, (before, after) in _FACTS.items()
            if key in of and of[key].notnull() and (of[key].item() or key != "rest_force")
        ]
        yield f"  {name}: {', '.join(facts) if int(of['impacts']) else 'no impacts'}"
