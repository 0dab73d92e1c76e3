"""Options of the command line, which may also be keys of study files, and the values typed for them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import KW_ONLY, dataclass
from inspect import Parameter, Signature
from pathlib import Path
from typing import Annotated, Any

import typer

from vibroimpact.cli.endings import WrongRequest

# Numbers arrive as text: the checks of the schema then name value, range and remedy.
TEXT, TEXTS, FLAG, PATH = str | None, list[str] | None, bool, Path | None


def number(text: str) -> int | float | str:
    """Return a text as a number, or unchanged if it is none, so that a check can refuse it."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def numbers(flag: str, text: str, example: str, count: int = 0) -> tuple[int | float | str, ...]:
    """Return the numbers of a comma-separated list; `count` is the required length, if it is known."""
    parts = tuple(number(part.strip()) for part in text.split(","))
    if (count and len(parts) != count) or "" in parts:
        raise WrongRequest(f"`{flag}` must be {example}, got {text!r}; separate numbers by commas")
    return parts


def words(text: str) -> list[str]:
    """Return the words of a comma-separated list, which may end in a comma."""
    return [word for part in text.split(",") if (word := part.strip())]


@dataclass(frozen=True)
class Key:
    """A value of a request: a key of a table of study files.

    `check` takes its name and its value and returns the value, or raises a `ValueError` that names it.
    """

    name: str
    _: KW_ONLY
    table: str = ""
    check: Callable[[str, Any], Any] = lambda name, value: value


@dataclass(frozen=True)
class Option(Key):
    """An option or a positional argument of a command; with a `table`, it is also a key of study files.

    `name` is its keyword in commands and functions, and `flags` are the flags typed (by default made from the name; an
    empty tuple makes it a positional argument). `read` converts the text to its value, or to several keys of its table
    with their values; without a text, the value is `default`.
    """

    metavar: str = ""
    help: str = ""
    panel: str | None = None
    _: KW_ONLY
    flags: tuple[str, ...] | None = None
    kind: Any = TEXT
    required: bool = False
    read: Callable[[Any], Any] = number
    default: Any = None

    @property
    def typed(self) -> tuple[str, ...]:
        """The flags that are typed."""
        return (f"--{self.name.replace('_', '-')}",) if self.flags is None else self.flags

    @property
    def parameter(self) -> Parameter:
        """The function parameter from which typer makes this option."""
        text = self.help if self.default is None else f"{self.help} (default: {self.default})"
        more: dict[str, Any] = {"help": text} | ({} if self.kind is FLAG else {"metavar": self.metavar})
        flags = self.typed
        declaration: Any = typer.Option(*flags, rich_help_panel=self.panel, **more) if flags else typer.Argument(**more)
        kind = Path if self.required else self.kind
        usual = Parameter.empty if self.required else False if self.kind is FLAG else None
        return Parameter(self.name, Parameter.KEYWORD_ONLY, default=usual, annotation=Annotated[kind, declaration])


class Options(Mapping[str, Any]):
    """The texts typed for the options that a command declares."""

    def __init__(self, declared: tuple[Option, ...], typed: Mapping[str, Any]) -> None:
        self._declared, self._typed = {option.name: option for option in declared}, typed

    def __getitem__(self, name: str) -> Any:
        return self._typed[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._typed)

    def __len__(self) -> int:
        return len(self._typed)

    def with_values(self, **values: Any) -> Options:
        """Return a copy with other values of some options."""
        return Options(tuple(self._declared.values()), {**self._typed, **values})

    def value(self, name: str) -> Any:
        """Return the value of an option: the text typed, read and checked, or its default."""
        option, text = self._declared.get(name), self.get(name)
        if option is None or text is None:
            return option and option.default
        try:
            return option.check(name, option.read(text))
        except ValueError as error:
            raise WrongRequest(re.sub(r"^`\w+`", f"`{option.typed[0]}`", str(error))) from None

    def given(self, *names: str) -> dict[str, Any]:
        """Return the values of these options; those not given are left out."""
        return {name: self.value(name) for name in names if self.get(name) is not None}

    def changes(self) -> dict[str, dict[str, Any]]:
        """Return the typed options as the tables of a study file."""
        tables: dict[str, dict[str, Any]] = {}
        for name, option in self._declared.items():
            if option.table and self.get(name) not in (None, (), [], False):
                value = option.read(self[name])
                entries = value if isinstance(value, dict) else {name: value}
                table = tables.setdefault(option.table, {})
                if option.table == "axes" and (twice := set(table) & set(entries)):
                    raise WrongRequest(f"the axis {min(twice)} is given twice; give each parameter one axis")
                table.update(entries)
        return tables


def with_options(*groups: Option | tuple[Option, ...]) -> Callable[[Callable[[Options], None]], Callable[..., None]]:
    """Make a command from a function of `Options`: typer sees one parameter for each option listed."""
    declared = tuple(option for group in groups for option in (group if isinstance(group, tuple) else (group,)))

    def decorator(function: Callable[[Options], None]) -> Callable[..., None]:
        def command(**typed: Any) -> None:
            function(Options(declared, typed))

        parameters = [option.parameter for option in declared]
        command.__doc__, command.__name__ = function.__doc__, function.__name__
        command.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
        command.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
        return command

    return decorator
