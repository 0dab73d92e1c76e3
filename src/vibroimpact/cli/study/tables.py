"""The tables of a study file and what each key may hold."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any, Literal

from pydantic import (
    AliasChoices,
    BaseModel,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    PrivateAttr,
    ValidationInfo,
    field_validator,
    model_validator,
)

from vibroimpact.backends import BACKENDS
from vibroimpact.cli.study.axis import Floats, axis_values
from vibroimpact.dataset import SYMBOLS
from vibroimpact.indices import check_indices
from vibroimpact.options import Sampling, Tolerances
from vibroimpact.oscillator import ImpactOscillator, State, parameter_value
from vibroimpact.parameters import real_number, whole_number

# what of a study each public function takes, besides its oscillator and axes
_MOTION = ("start", "tolerances", "backend", "time_step")
_TAKES = {
    "simulate": (*_MOTION, "periods", "samples_per_period"),
    "impact_section": (*_MOTION, "transient_impacts", "sample_impacts"),
    "stroboscopic_section": (*_MOTION, "phase", "transient_periods", "sample_periods"),
    "bifurcation_diagram": (
        *_MOTION, "transient_impacts", "sample_impacts", "phase", "transient_periods", "sample_periods",
        "section", "direction", "indices", "workers",
    ),
    "parameter_map": (*_MOTION, "transient_impacts", "sample_impacts", "indices", "early_closing", "workers"),
    "basins": ("tolerances", "backend", "transient_impacts", "sample_impacts", "workers"),
    "describe": ("tolerances", "workers"),
    "compare": ("tolerances", "workers"),
}  # fmt: skip


WORDS = {**SYMBOLS, "zeta": "damping_ratio"}  # what a symbol stands for


class Table(BaseModel):
    """A table of a study file; keys it does not know are refused."""

    model_config = ConfigDict(extra="forbid", arbitrary_types_allowed=True)


def _either(name: str) -> Any:
    """Let a parameter be given by its word or by its symbol."""
    symbols = [symbol for symbol, word in WORDS.items() if word == name]
    return Field(default=None, validation_alias=AliasChoices(name, *symbols))


def _refuse_both(name: str, earlier: Mapping[str, Any]) -> None:
    if name == "frequency" and earlier.get("omega") is not None:
        raise ValueError("`frequency` stands beside `omega`; allowed is one of the two; keep Hz or rad/s")
    if name == "damping_ratio" and earlier.get("damping") is not None:
        raise ValueError("`damping_ratio` stands beside `damping`; allowed is one of the two; c = 2 zeta sqrt(k m)")


class OscillatorTable(Table):
    """`[oscillator]`: the seven numbers, or those that differ from the defaults."""

    mass: float | None = _either("mass")
    damping: float | None = _either("damping")
    damping_ratio: float | None = _either("damping_ratio")
    stiffness: float | None = _either("stiffness")
    amplitude: float | None = _either("amplitude")
    omega: float | None = _either("omega")
    frequency: float | None = None
    restitution: float | None = _either("restitution")
    gap: float | None = _either("gap")

    @field_validator("*", mode="plain")
    @classmethod
    def _in_range(cls, value: Any, info: ValidationInfo) -> float:
        _refuse_both(str(info.field_name), info.data)
        return parameter_value(str(info.field_name), value)


class AxesTable(Table):
    """`[axes]`: each `{ from, to, points }`, linear with both ends, or a list of values."""

    mass: Floats | None = _either("mass")
    damping: Floats | None = _either("damping")
    stiffness: Floats | None = _either("stiffness")
    amplitude: Floats | None = _either("amplitude")
    omega: Floats | None = _either("omega")
    frequency: Floats | None = None
    restitution: Floats | None = _either("restitution")
    gap: Floats | None = _either("gap")
    _order: tuple[str, ...] = PrivateAttr(())

    @field_validator("*", mode="plain")
    @classmethod
    def _values(cls, value: Any, info: ValidationInfo) -> Floats:
        _refuse_both(str(info.field_name), info.data)
        return axis_values(str(info.field_name), value)

    @model_validator(mode="wrap")
    @classmethod
    def _keep_order(cls, value: Any, handler: ModelWrapValidatorHandler[AxesTable]) -> AxesTable:
        table = handler(value)
        if isinstance(value, Mapping):
            table._order = tuple(WORDS.get(str(name), str(name)) for name in value)
        return table


class SamplingTable(Table):
    """`[sampling]`: what is left out and what is kept."""

    transient_impacts: int | None = None
    sample_impacts: int | None = None
    transient_periods: int | None = None
    sample_periods: int | None = None
    phase: float | None = None
    periods: float | None = None
    samples_per_period: int | None = None

    @field_validator("*", mode="plain")
    @classmethod
    def _in_range(cls, value: Any, info: ValidationInfo) -> float:
        name = str(info.field_name)
        if name == "phase":
            phase = real_number("phase", value, "a number from 0 to below 1", "it is the fraction of a period")
            if not 0.0 <= phase < 1.0:
                raise ValueError(f"`phase` is {value!r}; allowed is a number from 0 to below 1; take its fraction")
            return phase
        if name == "periods":
            length = real_number("periods", value, "a number > 0")
            if length <= 0.0:
                raise ValueError(f"`periods` is {value!r}; allowed is a number > 0; say how many to follow")
            return length
        if name == "samples_per_period":
            return whole_number(name, value, 1)
        return int(getattr(Sampling(**{name: value}), name))


class StartTable(Table):
    """`[start]`: where the mass is, how fast it moves, and when."""

    displacement: float
    velocity: float = 0.0
    time: float = 0.0

    @field_validator("*", mode="plain")
    @classmethod
    def _finite(cls, value: Any, info: ValidationInfo) -> float:
        return real_number(str(info.field_name), value)


class TolerancesTable(Table):
    """`[tolerances]`: how small is small."""

    chatter: float | None = None
    flight_periods: float | None = None
    steps_per_impact: int | None = None

    @field_validator("*", mode="plain")
    @classmethod
    def _in_range(cls, value: Any, info: ValidationInfo) -> float:
        name = str(info.field_name)
        checked: float = getattr(Tolerances(**{name: value}), name)
        return checked


class RunTable(Table):
    """`[run]`: what is asked for, and how it is computed."""

    indices: tuple[str, ...] | None = None
    backend: str | None = None
    workers: int | None = None
    time_step: float | None = None
    section: Literal["impact", "stroboscopic"] | None = None
    direction: Literal["fresh", "up", "down"] | None = None
    early_closing: bool | None = None

    @field_validator("indices", mode="plain")
    @classmethod
    def _in_table(cls, value: Any) -> tuple[str, ...]:
        if not isinstance(value, (str, list, tuple)):
            raise ValueError(f'`indices` is {value!r}; allowed is a list of names; write ["std"]')
        return check_indices(value)

    @field_validator("backend", mode="plain")
    @classmethod
    def _known(cls, value: Any) -> str:
        if value not in BACKENDS:
            raise ValueError(f"`backend` is {value!r}; allowed are {', '.join(BACKENDS)}; {nearest(value, BACKENDS)}")
        return str(value)

    @field_validator("workers", mode="plain")
    @classmethod
    def _at_least_one(cls, value: Any) -> int:
        return whole_number("workers", value, 1)

    @field_validator("time_step", mode="plain")
    @classmethod
    def _positive(cls, value: Any, info: ValidationInfo) -> float:
        step = real_number("time_step", value, "a number > 0")
        if step <= 0.0:
            raise ValueError(f"`time_step` is {value!r}; allowed is a number > 0; 0.0005 is usual")
        if info.data.get("backend", "fixed-step") != "fixed-step":
            raise ValueError(f"`time_step` is {value!r}; allowed with backend 'fixed-step' only; leave it out")
        return step


TABLES: dict[str, type[Table]] = {
    "oscillator": OscillatorTable,
    "axes": AxesTable,
    "sampling": SamplingTable,
    "start": StartTable,
    "tolerances": TolerancesTable,
    "run": RunTable,
}


class Study(Table):
    """A whole request: oscillator, axes, sampling, start, tolerances and how to run it.

    Examples
    --------
    >>> study = Study.model_validate({"oscillator": {"m": 2.0}, "axes": {"w": {"from": 1, "to": 2, "points": 3}}})
    >>> study.make_oscillator().mass
    2.0
    >>> study.grid()
    {'omega': array([1. , 1.5, 2. ])}
    """

    oscillator: OscillatorTable = OscillatorTable()
    axes: AxesTable = AxesTable()
    sampling: SamplingTable = SamplingTable()
    start: StartTable | None = None
    tolerances: TolerancesTable = TolerancesTable()
    run: RunTable = RunTable()

    def make_oscillator(self) -> ImpactOscillator:
        """Return the oscillator; parameters that are axes stand at their reference value."""
        varied = {"mass", "damping", "stiffness"} & set(self.grid())
        if self.oscillator.damping_ratio is not None and varied:
            raise ValueError(
                f"`damping_ratio` is given, and {min(varied)} varies; allowed is it where c = 2 zeta sqrt(k m) is one "
                "number; give `damping` in N s/m"
            )
        return ImpactOscillator(**self.oscillator.model_dump(exclude_none=True))

    def grid(self) -> dict[str, Floats]:
        """Return the values of every axis, in the order they were given."""
        return {name: getattr(self.axes, name) for name in self.axes._order}

    def arguments(self, function: str) -> dict[str, Any]:
        """Return the keyword arguments that the study has for a public function, axes left out."""
        given = {**self.sampling.model_dump(exclude_none=True), **self.run.model_dump(exclude_none=True)}
        if self.start is not None:
            given["start"] = State(**self.start.model_dump())
        if tolerances := self.tolerances.model_dump(exclude_none=True):
            given["tolerances"] = Tolerances(**tolerances)
        return {name: value for name, value in given.items() if name in _TAKES[function]}


def nearest(name: Any, allowed: Mapping[str, Any]) -> str:
    """Return the remedy for a misspelt name."""
    close = get_close_matches(str(name), allowed, 1)
    return f"did you mean {close[0]!r}?" if close else "check the spelling"
