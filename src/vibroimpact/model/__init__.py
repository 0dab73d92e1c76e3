"""The interface of models, and the initial condition of a motion."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, TypeGuard, runtime_checkable

from vibroimpact.parameters import Parameter, invalid, real_number, unknown

if TYPE_CHECKING:
    from vibroimpact.cells import Cells


@runtime_checkable
class Model(Protocol):
    """The interface of models: a table of parameters, their values, and the cells that a model makes.

    `str()` of a model is its name without values; it is used in titles, in files, and in the identity of a store.
    """

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """The parameters that an axis may vary, by name."""
        ...

    @property
    def values(self) -> dict[str, float]:
        """The values by name. Of parameters that replace one another, only one is listed; the others are attributes."""
        ...

    def replace(self, **changes: float) -> Model:
        """Return the model with some parameters changed."""
        ...

    def at(self, **values: float) -> Any:
        """Return the oscillator or the system at some values of the parameters."""
        ...

    def cells(self, points: Mapping[str, Any], start: State | None = None) -> Cells:
        """Return one cell per point, from the columns of its values."""
        ...


def is_model(value: Any) -> TypeGuard[Model]:
    """Return whether something is a model, and not a class of models."""
    kind = type(value)
    if kind not in _CLASSES and isinstance(value, Model) and not isinstance(value, type):
        _CLASSES.add(kind)
    return kind in _CLASSES


_CLASSES: set[type] = set()  # of models seen before: checking a protocol takes longer than making a model


def check_model(model: Any, name: str = "osc") -> None:
    """Raise unless `model` is an oscillator, a system or a family."""
    if not is_model(model):
        raise invalid(
            name, model, "an ImpactOscillator, an ImpactSystem or a family", "for example ImpactOscillator(omega=2)"
        )


def as_system(design: Any) -> Any:
    """Return an oscillator as a system of one coordinate; a system as it is."""
    return getattr(design, "system", design)


def check_names(parameters: Mapping[str, Parameter], names: Iterable[str]) -> None:
    """Raise if names are not parameters, and suggest the one that was probably meant, also by its symbol."""
    for name in names:
        if not isinstance(name, str) or name not in parameters:
            meant = next((key for key, parameter in parameters.items() if parameter.symbol == str(name)), None)
            raise unknown("parameter", name, parameters, meant=meant or "")


@dataclass(frozen=True)
class State:
    """An initial condition: displacement, velocity and time; for a system, all its coordinates and their rates.

    Parameters
    ----------
    displacement : float or sequence of float
        y in m; at most the gap. For an `ImpactSystem`, all coordinates, kept as a tuple.
    velocity : float or sequence of float
        y' in m/s; a value > 0 at the stop is an impact at this very time. For an `ImpactSystem`, one per coordinate; 0
        by default.
    time : float
        t in s; the force is f sin(w t).

    Examples
    --------
    >>> State(-1.0)
    State(displacement=-1.0, velocity=0.0, time=0.0)
    >>> State([0.1, 0.0])
    State(displacement=(0.1, 0.0), velocity=(0.0, 0.0), time=0.0)
    """

    displacement: Any  # a float, or a tuple of them
    velocity: Any = 0.0
    time: float = 0.0

    def __post_init__(self) -> None:
        numbers = {name: _numbers(name, getattr(self, name)) for name in ("displacement", "velocity")}
        places, speeds = (len(value) if isinstance(value, tuple) else 0 for value in numbers.values())
        if places and numbers["velocity"] == 0.0:
            numbers["velocity"] = (0.0,) * places
        elif places != speeds:
            got = " and ".join(str(count or "a single number") for count in (places, speeds))
            raise ValueError(f"`displacement` and `velocity` must have the same length, got {got}")
        for name, value in numbers.items():
            object.__setattr__(self, name, value)
        object.__setattr__(self, "time", real_number("time", self.time))


def _numbers(name: str, values: Any) -> float | tuple[float, ...]:
    """Return a number, or those of a one-dimensional list or array as a tuple."""
    if isinstance(values, (list, tuple)) or getattr(values, "ndim", 0) == 1:
        if not len(values):
            raise invalid(name, values, "a number, or one number per coordinate")
        return tuple(real_number(f"{name}[{at}]", value) for at, value in enumerate(values))
    return real_number(name, values)


def one_start(start: Any) -> State | None:
    """Return an initial condition; raise if it is neither None nor a State."""
    if not (start is None or isinstance(start, State)):
        raise invalid("start", start, "None or a State", "write State(displacement, velocity=0.0, time=0.0)")
    return start
