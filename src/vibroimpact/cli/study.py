"""A checked request, from a study file (TOML), from options, or from both: one schema for either."""

from __future__ import annotations

import inspect
import math
import re
import sys
import tomllib
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vibroimpact.beside import compile_beside
from vibroimpact.cli.endings import refusing
from vibroimpact.cli.options import Options, number
from vibroimpact.cli.schema import TABLES
from vibroimpact.cli.times import ENDS, MOST
from vibroimpact.indices import EVERY
from vibroimpact.model import Model, State
from vibroimpact.model.oscillator import ImpactOscillator
from vibroimpact.model.units import (
    InUnit,
    few_values,
    has_unit,
    is_unit,
    quantity,
    shown_as,
    shown_value,
    unit_of,
    without_unit,
)
from vibroimpact.options import Tolerances
from vibroimpact.parameters import OF_ONE_MASS, Parameter, closest, invalid, unknown, whole_number, with_unit

if TYPE_CHECKING:
    from vibroimpact.cells import Floats


@dataclass(frozen=True)
class Study:
    """A whole request: a model, axes, and the keyword arguments of the public functions.

    Examples
    --------
    >>> study = make_study({"oscillator": {"m": 2.0}, "axes": {"w": {"from": 1, "to": 2, "points": 3}}})
    >>> study.model.mass, study.axes
    (2.0, {'omega': array([1. , 1.5, 2. ])})
    """

    model: Model
    axes: dict[str, Floats]
    settings: dict[str, Any]
    warning: str = ""
    units: dict[str, str] = field(default_factory=dict)  # by parameter, as they were given

    def __str__(self) -> str:
        """Return the model and its numbers, or the range of those that an axis varies, in the units given."""
        model, units = self.model, self.units
        values, others = few_values(model)
        varied = {model.parameters[name].replaces or name for name in self.axes}
        numbers = [
            f"{shown_as(model, name, units)[0].name} {quantity(model, name, value, 6, units)}"
            for name, value in values.items()
            if name not in varied
        ] + others
        for name, axis in self.axes.items():
            low = f"{shown_value(model, name, float(axis[0]), units):.6g}"
            numbers.append(f"{name} {low} to {quantity(model, name, float(axis[-1]), 6, units)}")
        return f"{getattr(self.model, '__name__', type(self.model).__name__)}: {', '.join(numbers)}"

    def announce(self) -> None:
        """Print the model and the numbers used, once the whole request has been accepted."""
        warning = [f"vibroimpact: {self.warning}"] if self.warning else []
        print(self, *warning, sep="\n", file=sys.stderr, flush=True)

    @property
    def typed_axes(self) -> dict[str, InUnit]:
        """The axes, with the units in which they were given."""
        return {name: InUnit(values, self.units.get(name, "")) for name, values in self.axes.items()}

    def arguments(self, function: str) -> dict[str, Any]:
        """Return the arguments of a public function from the study, without axes; others are left out."""
        import vibroimpact

        accepted = inspect.signature(getattr(vibroimpact, function)).parameters
        arguments = {name: value for name, value in self.settings.items() if name in accepted}
        if function == "parameter_map" and "starts" in self.settings:
            arguments["start"] = self.settings["starts"]
        return arguments


def study_of(options: Options, file: Path | None = None) -> Study:
    """Return the request that the options of a command and a study file, if there is one, make together."""
    path, changes, model = file or options.get("study"), options.changes(), options.get("model")
    with refusing(OSError):
        document = {} if path is None else _load(path)
        if model is not None:
            document["model"] = model
        try:
            study = make_study(document, changes, dotted=path is not None)
        except ValueError as error:
            if path is None:
                raise
            faults = str(error).splitlines()
            count = "1 error" if len(faults) == 1 else f"{len(faults)} errors"
            raise ValueError("\n".join([f"`study` {str(path)!r} has {count}:", *faults])) from None
    compile_beside(study.model.at)
    return study


def _load(path: Path) -> dict[str, Any]:
    text = ""
    try:
        text = Path(path).read_text(encoding="utf-8")
        document = tomllib.loads(text)
    except OSError as error:
        message = f"`study` {str(path)!r} cannot be read ({error.strerror}); {_instead_of(path)}"
        raise OSError(error.errno, message) from error
    except ValueError as error:
        if path.suffix.lower() == ".toml":
            curved = re.search(r"=\s*[“”‘’„«»]", text)
            straight = '; write straight quotation marks: "' if curved else ""
            raise ValueError(f"`study` {str(path)!r} is invalid TOML: {error}{straight}") from error
        raise ValueError(f"`study` {str(path)!r} is not a study file (TOML); {_instead_of(path)}") from error
    except RecursionError:
        raise ValueError(f"`study` {str(path)!r} is invalid TOML: its values are nested too deeply") from None
    if not document:  # the paper's numbers would be taken for those of the file
        instead = "write [oscillator] and its numbers" if path.suffix.lower() == ".toml" else _instead_of(path)
        raise ValueError(f"`study` {str(path)!r} is empty; {instead}")
    return document


def _instead_of(path: Path) -> str:
    """Return the probable meaning of the text typed in place of a study file."""
    text, ending = str(path), path.suffix.lower()
    if "=" in text:
        flag = "--x" if ":" in text else "-p"
        return f"did you mean `{flag} {text}`?"
    if ending == ".py":
        return f"did you mean `--model {text}:NAME`?"
    if ending in (".zarr", ".nc"):
        return f"a saved result is shown by `vibroimpact plot {text}`"
    if text == "help":
        return "did you mean `--help`?"
    if path.is_dir():
        return "it is a folder; give the name of a TOML file"
    if text == "=" or text in {*OF_ONE_MASS, *EVERY} or isinstance(number(text), (int, float)):
        return "write -p NAME=VALUE without spaces, and separate several names or numbers by commas alone"
    with suppress(OSError):
        files = {each.stem: each for each in path.parent.iterdir() if each.suffix == ".toml" and each.is_file()}
        if near := closest(path.stem, files):
            return f"did you mean {str(files[near])!r}?"
    if is_unit(text):
        return "write a value and its unit without a space, as in gap=0.5mm"
    return "give the name of a TOML file, and parameters as -p NAME=VALUE"


def make_study(
    document: Mapping[str, Any], changes: Mapping[str, Mapping[str, Any]] | None = None, *, dotted: bool = False
) -> Study:
    """Return the request in the tables of a study file, or raise one `ValueError` with a line for each error.

    The tables of `changes` complete or replace values of `document`; axes in them replace all of its axes. If `dotted`,
    errors name a key with its table (`oscillator.mass`), otherwise without it (`mass`).

    Examples
    --------
    >>> make_study({"sampling": {"sample_impacts": 0}})
    Traceback (most recent call last):
    ValueError: `sample_impacts` must be a whole number >= 1, got 0
    """
    reader, typed = _Reader(dotted), changes or {}
    file = reader.tables(document)
    if typed.get("start"):
        file["run"] = {key: value for key, value in file["run"].items() if key != "starts"}
    if "starts" in typed.get("run", ()):
        file["start"] = {}
    model: Model = ImpactOscillator()
    if "model" in document:
        from vibroimpact.families import load_model

        model = load_model(document["model"])

    values = reader.values("oscillator", model, Parameter.check, file["oscillator"], typed.get("oscillator", {}))
    if not reader.faults:
        model = reader.check("", "", lambda: model.replace(**values)) or model
    axes = reader.values("axes", model, axis_values, typed.get("axes") or file["axes"], {})
    checked = {table: reader.entries(table, {**file[table], **typed.get(table, {})}) for table in TABLES}
    if checked["start"] and "displacement" not in checked["start"]:
        reader.faults.append("`start` must have a `displacement`, in m")
    if checked["start"] and "starts" in checked["run"]:
        reader.faults.append("give either `start` or `starts`, not both")
    if not reader.faults:
        reader.check("", "", _check_replaced, model, values, axes)
    start = {}
    if checked["start"] and not reader.faults:
        start["start"] = reader.check("", "", lambda: State(**checked["start"]))
    if reader.faults:
        raise ValueError("\n".join(reader.faults))
    tolerances = {"tolerances": Tolerances(**checked["tolerances"])} if checked["tolerances"] else {}
    given = {**file["oscillator"], **typed.get("oscillator", {})}, typed.get("axes") or file["axes"]
    written = {name_of(model, key): value for table in given for key, value in table.items()}
    in_si = {"mass", "stiffness"} <= set(values) or has_unit(written.values())
    warning = mixed_units_warning({*values, *axes}) if in_si and "model" not in document else ""
    units = {name: unit_of(written[name]) or model.parameters[name].unit for name in {**values, **axes}}
    return Study(model, axes, {**checked["sampling"], **checked["run"], **start, **tolerances}, warning, units)


class _Reader:
    """Checks entry by entry and collects the errors, so that all of them are reported at once."""

    def __init__(self, dotted: bool) -> None:
        self.dotted, self.faults = dotted, []  # type: bool, list[str]

    def tables(self, document: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
        """Return every table; missing ones are empty."""
        tables: dict[str, Mapping[str, Any]] = {name: {} for name in ("oscillator", "axes", *TABLES)}
        for name, value in document.items():
            if name not in (*tables, "model"):
                self.faults.append(str(unknown("table", name, (*tables, "model"))))
            elif isinstance(value, Mapping):
                tables[name] = value
            elif name != "model":
                self.faults.append(str(invalid(name, value, "a table", f"write [{name}] above its keys")))
        return tables

    def values(
        self,
        table: str,
        model: Model,
        check: Callable[[Parameter, Any], Any],
        file: Mapping[str, Any],
        typed: Mapping[str, Any],
    ) -> dict[str, Any]:
        """Return checked values by parameter; the last one typed wins, and replaces the value in a file."""
        parameters = model.parameters
        replaced = {name_of(model, key) for key in typed}
        replaced |= {parameters[name].replaces or name for name in replaced & set(parameters)}
        keys_and_values: dict[str, tuple[str, Any]] = {}
        for key, value in file.items():
            name = name_of(model, key)
            if name in keys_and_values:
                self.faults.append(f"give either `{keys_and_values[name][0]}` or `{key}`, not both")
            elif name not in replaced and (name not in parameters or parameters[name].replaces not in replaced):
                keys_and_values[name] = key, value
        keys_and_values |= {name_of(model, key): (key, value) for key, value in typed.items()}

        def checked(parameter: Parameter, value: Any) -> Any:
            return check(parameter, without_unit(parameter, value))

        for name, (key, _) in keys_and_values.items():
            if name not in parameters:
                self.refuse(table, key, parameters)
        return {
            name: self.check(table, key, checked, parameters[name], value)
            for name, (key, value) in keys_and_values.items()
            if name in parameters
        }

    def entries(self, table: str, entries: Mapping[str, Any]) -> dict[str, Any]:
        """Return the checked entries of a table."""
        checks = TABLES[table]
        for key in entries:
            if key not in checks:
                self.refuse(table, key, checks)
        return {
            key: self.check(table, key, check, key, entries[key]) for key, check in checks.items() if key in entries
        }

    def refuse(self, table: str, key: str, choices: Iterable[str]) -> None:
        """Refuse an unknown key."""
        self.faults.append(str(unknown(f"key in [{table}]" if self.dotted else "parameter", key, choices)))

    def check(self, table: str, key: str, function: Callable[..., Any], *arguments: Any) -> Any:
        """Return the value that a check returns; its errors name the key as it was written."""
        try:
            return function(*arguments)
        except ValueError as error:
            name = f"{table}.{key}" if self.dotted else key
            lines = str(error).splitlines()
            self.faults += [re.sub(r"^(unknown |)`\w+", rf"\1`{name}", line) for line in lines] if key else lines


# Parameters of the model, and axes over them


def name_of(model: Model, key: str) -> str:
    """Return the name of a parameter from its name or symbol; unknown names are returned unchanged."""
    symbols = {parameter.symbol: name for name, parameter in model.parameters.items()}
    return key if key in model.parameters else symbols.get(key, key)


def _check_replaced(model: Model, values: Mapping[str, Any], axes: Mapping[str, Floats]) -> None:
    """Refuse a value, such as of the damping ratio, that changes along an axis because others change."""
    for name, value in values.items():
        replaces = model.parameters[name].replaces
        for axis, points in axes.items():
            if replaces in (None, axis) or axis == name:
                continue
            at_end = getattr(model.at(**{axis: float(points[-1])}), name, value)
            if not math.isclose(at_end, value, rel_tol=1e-9):
                raise ValueError(f"`{name}` must not be given where {axis} varies, which changes it; give `{replaces}`")


def axis_values(parameter: Parameter, value: Any) -> Floats:
    """Return the values of an axis, strictly increasing, or raise with a line for each error."""
    import numpy as np

    name = parameter.name
    if isinstance(value, Mapping) and set(value) == {"values"}:
        value = value["values"]
    if isinstance(value, Mapping):
        return span_values(parameter, value)
    if not isinstance(value, (list, tuple)):
        hint = "write { from = 1.0, to = 2.0, points = 11 }"
        raise invalid(name, value, "a list of values or { from, to, points }", hint)
    if not value:
        raise invalid(name, value, "at least one value")
    listed = np.array([parameter.check(entry) for entry in value])
    if not (np.diff(listed) > 0.0).all():
        raise invalid(name, value, "strictly increasing", "sort the values")
    return listed


def span_values(parameter: Parameter, span: Mapping[str, Any], least: int = 1) -> Floats:
    """Return the values of `{ from, to, points }`: linear, both ends included."""
    import numpy as np

    name, reader = parameter.name, _Reader(dotted=False)
    reader.faults += [f"`{name}.{key}` is missing; give from, to and points" for key in ENDS if key not in span]
    reader.faults += [str(unknown(f"key in `{name}`", key, ENDS)) for key in span if key not in ENDS]
    low, high = (reader.check("", f"{name}.{key}", parameter.check, span.get(key, 1.0)) for key in ENDS[:2])
    points = reader.check("", f"{name}.points", whole_number, "points", span.get("points", least), least, MOST)
    if not reader.faults:
        if points > 1 and not low < high:
            got = with_unit(f"{low:g} to {high:g}", parameter.unit)
            raise ValueError(f"`{name}` must increase, got {got}; give the smaller end first")
        if points == 1 and low != high:
            hint = f"for a single value give {low:g} as both ends"
            raise invalid(f"{name}.points", points, f"at least 2 from {low:g} to {high:g}", hint)
    if reader.faults:
        raise ValueError("\n".join(reader.faults))
    return np.linspace(low, high, points)


def mixed_units_warning(names: set[str]) -> str:
    """Return a warning if numbers in SI units are combined with dimensionless numbers of the paper."""
    table, usual = ImpactOscillator.parameters, ImpactOscillator()
    names = {table[name].replaces or name for name in names}
    defaults = [name for name in ("mass", "damping", "stiffness", "amplitude", "omega") if name not in names]
    numbers = ", ".join(f"{name} = {getattr(usual, name):g} {table[name].unit}" for name in defaults)
    return f"not given, so the paper's values are used: {numbers}" if defaults else ""
