"""Orbits, branches and attractors on disk: a labelled dataset, and in it a record that makes the same objects again.

The record is JSON: Python writes a float with the digits that give it back to the bit. It makes only the classes listed
here, and runs no code: a family is found again if it is ready-made, or if this process has imported its module.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from vibroimpact.coexistence.attractor import Attractor, attractors_dataset
from vibroimpact.continuation.results import BifurcationPoint, Boundary, Branch
from vibroimpact.dataset import model_from, plain_variable
from vibroimpact.families import Family, ready_made
from vibroimpact.files import RECORD
from vibroimpact.model import State, is_model
from vibroimpact.orbits.orbit import Orbit, Rest
from vibroimpact.orbits.results import Orbits, orbits_dataset
from vibroimpact.orbits.systems import Contact
from vibroimpact.parameters import invalid
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr

CLASSES: dict[str, Any] = {
    kind.__name__: kind for kind in (Orbit, Rest, Contact, State, Branch, Boundary, BifurcationPoint, Attractor, Orbits)
}
KIND = "class"  # the key that names a class


def labelled(value: Any) -> xr.Dataset:
    """Return the record that `save` writes of an orbit, an attractor, a list of these, a branch or a boundary."""
    several = value if isinstance(value, list) and value else [value]
    traits = {trait for trait in ("share", "multipliers") if all(hasattr(each, trait) for each in several)}
    if "share" in traits:
        value = [_solved(each) for each in several] if several is value else _solved(value)
        dataset = attractors_dataset(several)
    elif "multipliers" in traits:
        orbits = Orbits(several, message=getattr(value, "message", ""), outcome=getattr(value, "outcome", "found"))
        dataset = orbits_dataset(orbits, several[0].model, {})
    elif type(value).__name__ in ("Branch", "Boundary"):
        dataset = value.dataset
    else:
        what = "an xarray.Dataset, an orbit, an attractor, a list of these (not empty), a branch or a boundary"
        raise invalid("dataset", value, what, "functions of this package return them")
    models: list[dict[str, Any]] = []
    record = {"object": _plain(value, models), "models": models}
    return dataset.assign(
        {RECORD: plain_variable((), np.array(json.dumps(record)), {"long_name": "the object as JSON"})}
    )


def restored(dataset: xr.Dataset) -> Any:
    """Return the object that `labelled` wrote."""
    record = json.loads(str(dataset[RECORD].values), parse_constant=_CONSTANTS.__getitem__)
    models: list[Any] = []
    for plain in record["models"]:
        models.append(_model(record["models"][0]["design"] | plain["design"], plain))
    return _made(record["object"], models)


# json makes a NaN of its own; objects are equal if they hold this one, as Python compares tuples by identity first.
_CONSTANTS = {"NaN": math.nan, "Infinity": math.inf, "-Infinity": -math.inf}


def _solved(attractor: Attractor) -> Attractor:
    """Return an attractor with its orbit solved for."""
    return replace(attractor, known_orbit=attractor.orbit)


def _plain(value: Any, models: list[dict[str, Any]]) -> Any:
    """Return a value as JSON has it; models are listed once, by what differs from the first."""
    if is_model(value):
        return {KIND: "model", "number": _number(_described(value), models)}
    if isinstance(value, complex):
        return {KIND: "complex", "parts": [value.real, value.imag]}
    if isinstance(value, IntEnum):
        return {KIND: "status", "code": int(value)}
    if is_dataclass(value) and not isinstance(value, type):
        parts = {part.name: _plain(getattr(value, part.name), models) for part in fields(value)}
        return {KIND: type(value).__name__, **parts}
    if hasattr(value, "_asdict"):
        return {KIND: type(value).__name__, **{name: _plain(part, models) for name, part in value._asdict().items()}}
    if isinstance(value, Mapping):
        return {KIND: "dict", "items": {name: _plain(part, models) for name, part in value.items()}}
    if type(value) is tuple:
        return [_plain(part, models) for part in value]
    if isinstance(value, list):
        content = {KIND: "list", "items": [_plain(part, models) for part in value]}
        ends = {"outcome": value.outcome, "message": value.message} if type(value) is Orbits else {}
        return content | ends
    return value.item() if isinstance(value, np.generic) else value


def _made(plain: Any, models: list[Any]) -> Any:
    """Return the value that `_plain` wrote."""
    if isinstance(plain, list):
        return tuple(_made(part, models) for part in plain)
    if not isinstance(plain, dict):
        return plain
    kind = plain[KIND]
    if kind == "dict":
        return {name: _made(part, models) for name, part in plain["items"].items()}
    parts = {name: _made(part, models) for name, part in plain.items() if name != KIND}
    if kind == "model":
        return models[parts["number"]]
    if kind == "complex":
        return complex(*parts["parts"])
    if kind == "status":
        return Status(parts["code"])
    if kind == "list":
        items = list(parts["items"])
        return Orbits(items, outcome=parts["outcome"], message=parts["message"]) if "outcome" in parts else items
    return CLASSES[kind](**parts)


def _described(model: Any) -> dict[str, Any]:
    """Return the numbers of a model, and the name and the values of a family."""
    if model is model.at():
        return {"design": {KIND: model.kind, **model.plain()}}
    names = (model.function.__module__, model.function.__qualname__) if hasattr(model, "function") else ("", str(model))
    return {"design": {KIND: model.at().kind, **model.at().plain()}, "family": names, "values": model.values}


def _number(described: dict[str, Any], models: list[dict[str, Any]]) -> int:
    """Return the number of a model in the list, after adding it if it is not in it."""
    if models:
        first = models[0]["design"]
        differs = {name: part for name, part in described["design"].items() if name not in first or first[name] != part}
        described = described | {"design": differs}
    if described not in models:
        models.append(described)
    return models.index(described)


def _model(design: dict[str, Any], described: dict[str, Any]) -> Any:
    """Return the family that a record describes if it still makes the same model, else that model."""
    model = model_from({name: part for name, part in design.items() if name != KIND})
    if "family" not in described:
        return model
    found = _family(*described["family"])
    found = found and found.replace(**described["values"])
    return found if found is not None and found.at() == model else model


def _family(module: str, name: str) -> Any:
    """Return the ready-made or imported family of this name, or None."""
    from vibroimpact import models

    if module.startswith("vibroimpact.models") and name in models.__all__:
        return ready_made(name)
    found = getattr(sys.modules.get(module), name, None)
    return found if isinstance(found, Family) else None
