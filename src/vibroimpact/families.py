"""Models made from any function of named numbers: linked parameters, other units, forces that grow with speed."""

from __future__ import annotations

import inspect
import re
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from itertools import chain
from pathlib import Path
from types import MappingProxyType
from typing import Any, overload

import numpy as np

from vibroimpact.cells import Cells
from vibroimpact.model import Model, State, check_model, check_names, is_model
from vibroimpact.parameters import Parameter, invalid, unknown


class Family:
    """A model made from a function of named numbers, which are its parameters.

    `family` makes one. Calling it returns what the function returns. Every function that takes an oscillator takes a
    family, at the values of its parameters and with any of them as axes.
    """

    def __init__(self, function: Callable[..., Any], parameters: Mapping[str, Parameter], values: dict[str, float]):
        self.function, self.parameters, self.values = function, MappingProxyType(dict(parameters)), values
        self.__doc__, self.__name__ = function.__doc__, function.__name__

    def __call__(self, **values: float) -> Any:
        """Return the result of the function."""
        return self.function(**self.values | self._checked(values))

    def __getattr__(self, name: str) -> float:
        """Return the value of a parameter that follows another, and was not given."""
        parameter = self.__dict__.get("parameters", {}).get(name)
        if parameter is None or not parameter.follows:
            raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")
        return float(self.values.get(name, self.values[parameter.follows]))

    def __repr__(self) -> str:
        return f"{self.__name__}({', '.join(f'{name}={value!r}' for name, value in self.values.items())})"

    def __str__(self) -> str:
        return self.__name__

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Family) and (self.function, self.values) == (other.function, other.values)

    def __hash__(self) -> int:
        return hash((self.function, *self.values.values()))

    def __reduce__(self) -> Any:
        """Pickle by name if the name refers to this family, as functions do; otherwise, with the function."""
        home = sys.modules.get(self.function.__module__)
        named = getattr(home, self.function.__qualname__, None)
        if isinstance(named, Family) and named.function is self.function:
            return _named, (self.function.__module__, self.function.__qualname__, self.values)
        return Family, (self.function, dict(self.parameters), self.values)

    def replace(self, **changes: float) -> Family:
        """Return the family with some parameters changed."""
        return Family(self.function, self.parameters, self.values | self._checked(changes))

    def at(self, **values: float) -> Any:
        """Return the oscillator or system that the function makes from its parameters, some of them changed."""
        arguments = self.values | self._checked(values)
        try:
            model = self.function(**arguments)
        except Exception as error:
            where = ", ".join(f"{name}={value:g}" for name, value in arguments.items())
            clear = isinstance(error, (ValueError, ArithmeticError, ImportError))  # their text is enough
            words = error if clear else f"{type(error).__name__}: {error}"
            raise ValueError(f"{self} fails at {where}: {words}{self._place(error)}") from error
        if not is_model(model):
            hint = f"return an ImpactOscillator or an ImpactSystem{self._place()}"
            raise invalid(f"{self}(...)", model, "a model", hint)
        return model.at()

    def _place(self, error: BaseException | None = None) -> str:
        """Return the file and line of the function, or of the error in its file; nothing for ready-made models."""
        code = getattr(inspect.unwrap(self.function), "__code__", None)
        if code is None or self.function.__module__.startswith("vibroimpact."):
            return ""
        return f" ({_line_in(code.co_filename, error) or f'{Path(code.co_filename).name}, line {code.co_firstlineno}'})"

    def cells(self, points: Mapping[str, Any], start: State | None = None) -> Cells:
        """Return one cell per point; the function is called at each of them."""
        check_names(self.parameters, points)
        rows = zip(*(np.asarray(values, np.float64).tolist() for values in points.values()), strict=True)
        designs = (self.at(**dict(zip(points, row, strict=True))) for row in rows) if points else iter([self.at()])
        first = next(designs)
        cells: Cells = first.cells_of(chain([first], _of_one_kind(designs, first.kind)))
        return cells.begun(start, first.stop_names)

    def _checked(self, values: Mapping[str, Any]) -> dict[str, float]:
        check_names(self.parameters, values)
        return {name: self.parameters[name].check(value) for name, value in values.items()}


def _of_one_kind(designs: Iterable[Any], kind: str) -> Iterator[Any]:
    """Yield designs; raise if they are of two kinds, which no table holds together."""
    for design in designs:
        if design.kind != kind:
            raise ValueError("a `family` must return either oscillators or systems, but this one returns both")
        yield design


def _named(module: str, name: str, values: dict[str, float]) -> Family:
    family: Family = getattr(import_module(module), name)
    return family.replace(**values)


@overload
def family(function: Callable[..., Any], /) -> Family: ...


@overload
def family(*, units: Mapping[str, str]) -> Callable[[Callable[..., Any]], Family]: ...


def family(function: Callable[..., Any] | None = None, /, *, units: Mapping[str, str] | None = None) -> Any:
    """Make a model from a function of named numbers that returns a model.

    Parameters
    ----------
    function : callable
        Takes numbers by name, each with a default, and returns an `ImpactOscillator`, an `ImpactSystem` or another
        family's model. It is called once per design, which takes some microseconds, and must always return the same
        model for the same numbers. An argument annotated as `int` takes whole numbers only.
    units : mapping of str to str, optional
        Units of parameters, for axes and tables: ``@family(units={"rpm": "1/min"})``.

    Returns
    -------
    Family
        A model whose parameters are those of the function, with its defaults as values. If the function has a table
        `parameters`, as those of `vibroimpact.models` do, it gives their units and ranges.

    Raises
    ------
    ValueError
        The default of a parameter is not a number, or `units` has a name that is not a parameter.

    Notes
    -----
    A store recognises a family by the numbers that it computes, not by its name: a changed function is another study.

    Examples
    --------
    >>> import math
    >>> import vibroimpact as vi
    >>> @vi.family(units={"rpm": "1/min", "clearance_mm": "mm"})
    ... def shaker(unbalance=0.002, rpm=1500.0, clearance_mm=0.5):
    ...     omega = rpm * 2 * math.pi / 60
    ...     force, gap = unbalance * omega**2, clearance_mm / 1e3
    ...     return vi.ImpactOscillator(mass=2.0, stiffness=3e4, damping=5.0, amplitude=force, omega=omega, gap=gap)
    >>> sweep = vi.parameter_map(shaker, rpm=[900.0, 1200.0, 1500.0], clearance_mm=[0.2, 0.5], sample_impacts=50)
    >>> dict(sweep.sizes), sweep["rpm"].attrs["units"]
    ({'rpm': 3, 'clearance_mm': 2}, '1/min')
    """
    if function is None:
        return lambda named: _family(named, units or {})
    return _family(function, units or {})


def _family(function: Callable[..., Any], units: Mapping[str, str]) -> Family:
    if not callable(function):
        raise invalid("function", function, "a function of named numbers that returns a model")
    parameters, values = {}, {}
    table: Mapping[str, Parameter] = getattr(function, "parameters", {})  # ready-made models have one
    for name, argument in inspect.signature(function).parameters.items():
        named = argument.kind in (argument.POSITIONAL_OR_KEYWORD, argument.KEYWORD_ONLY)
        if not named or argument.default is argument.empty:
            raise ValueError(f"`{name}` of {function.__name__} needs a number as its default, such as {name}=1.0")
        usual = table.get(name) or Parameter(name, name.replace("_", " "), symbol=name)
        counts = usual.whole or argument.annotation in (int, "int")
        parameters[name] = replace(usual, unit=units.get(name, usual.unit), whole=counts)
        if argument.default is not None or not usual.follows:
            values[name] = parameters[name].check(argument.default)
    check_names(parameters, units)
    model = Family(function, parameters, values)
    check_model(model)
    return model


# ---- models by name


def load_model(place: Any) -> Model:
    """Return the model or family NAME of `FILE.py:NAME`, or a ready-made model by its name.

    The file is run. It may import modules from its own folder.

    Raises
    ------
    ValueError
        The file cannot be run, or NAME is not a model; the message gives the line.
    """
    if not re.search(r"[.:/\\]", str(place)):
        return ready_made(str(place))
    file, name = str(place), ""
    if not file.endswith(".py"):
        file, _, name = file.rpartition(":")
    path = Path(file)
    if not file.endswith(".py") or (name and not name.isidentifier()):
        raise invalid("model", place, "FILE.py:NAME, as in tube.py:shaker, or a ready-made model, as in bouncing_ball")
    if not path.is_file():
        raise ValueError(f"`model` {place!r} cannot be loaded; there is no file {file!r}")
    spec: Any = spec_from_file_location(path.stem, path)
    module = module_from_spec(spec)
    sys.path.insert(0, str(path.resolve().parent))
    sys.modules.setdefault(path.stem, module)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        line = _line_in(str(path), error)
        what = f"{type(error).__name__}: {getattr(error, 'msg', error)}"
        raise ValueError(f"`model` {place!r} cannot be loaded; {what}{f' ({line})' * bool(line)}") from error
    return _model_in(module, name, place)


def _model_in(module: Any, name: str, place: Any) -> Model:
    """Return the model of that name in a module, after making it once at its own values."""
    models = {key: value for key, value in vars(module).items() if is_model(value)}
    if not name and models:
        file = str(place).removesuffix(":")
        raise ValueError(f"`model` must name a model of {file}: {' or '.join(f'{file}:{each}' for each in models)}")
    candidate = vars(module).get(name)
    if name not in models:
        code = getattr(candidate, "__code__", None)
        if code is not None:
            line = f"{Path(code.co_filename).name}, line {code.co_firstlineno}"
            raise ValueError(f"`model` {place!r} is a function; write @vibroimpact.family above it ({line})")
        file = Path(module.__file__).name
        if not models:
            hint = "write @vibroimpact.family above a function that returns an oscillator or a system"
            raise ValueError(f"`model` must name a model, but {file} has none; {hint}")
        raise unknown("model", name, models, f"these are in {file}")
    try:
        models[name].at()
    except ValueError as error:
        raise ValueError(f"`model` {place!r} cannot be used; {error}") from error
    return models[name]


def _line_in(file: str, error: BaseException | None) -> str:
    """Return the last line of a file in the traceback of an error, as "tube.py, line 12"; "" if there is none."""
    if error is None:
        return ""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename) == Path(file)]
    if isinstance(error, SyntaxError) and error.filename and Path(error.filename).name == Path(file).name:
        lines.append(error.lineno)
    return f"{Path(file).name}, line {lines[-1]}" if lines else ""


def ready_made(name: str) -> Family:
    """Return a model of `vibroimpact.models` as a family."""
    from vibroimpact import models

    if name not in models.__all__:
        raise unknown("model", name, models.__all__, "or give FILE.py:NAME for a model of your own")
    return _family(getattr(models, name), {})
