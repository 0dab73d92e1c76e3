"""From options as typed to a checked request."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vibroimpact.cli.study import Study

_SAMPLING = (
    "transient_impacts", "sample_impacts", "transient_periods", "sample_periods", "phase", "periods",
    "samples_per_period",
)  # fmt: skip
_FORMS = {  # of an axis, and an example of each
    "grid": ("name=from:to:points", "omega=0.025:5:200"),
    "span": ("name=from:to", "omega=0.8:3"),
    "starts": ("name=from:to:points", "phase=0:1:200"),
}
MOST_STARTS = 100_000  # along an axis
_RUN = ("backend", "time_step", "workers", "section", "direction")


class WrongRequest(Exception):
    """What was asked for cannot be done; nothing has been touched."""


class Interrupted(Exception):
    """Ctrl-C stopped a sweep; the message tells what was kept."""


# how an input or a place is refused; a full disk, say, is another OSError
REFUSALS = (FileExistsError, FileNotFoundError, IsADirectoryError, NotADirectoryError, PermissionError)


@contextmanager
def asked(*refusals: type[OSError]) -> Iterator[None]:
    """Call a refusal a wrong request: those errors, and a `ValueError` that tells what is allowed."""
    try:
        yield
    except refusals as error:
        raise WrongRequest(error.strerror or str(error)) from error
    except ValueError as error:
        if not is_refusal(error):
            raise
        raise WrongRequest(str(error)) from error


def is_refusal(error: ValueError) -> bool:
    """Return whether the message names an argument: this package's own refusals do, errors of libraries do not."""
    return str(error).startswith(("`", "unknown ", "give either ", "invalid "))


def read_request(options: Mapping[str, Any], *, axes: str = "grid") -> Study:
    """Return the request that the study file and the options make together.

    `axes` tells what --x and --y are: "grid" (from:to:points), "span" (from:to), or "starts", which are no part of it.
    """
    with asked(OSError):
        changes = _tables({name: value for name, value in options.items() if value not in (None, (), [])}, axes)
        from vibroimpact.cli.study import make_study, read_study

        if options.get("study") is None:
            return make_study({}, changes)
        return read_study(options["study"], changes)


def number(text: str) -> int | float | str:
    """Return the number a text stands for, or the text, for the study to refuse."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def numbers(option: str, text: str, count: int, example: str) -> tuple[int | float | str, ...]:
    """Return the numbers, or texts, of a comma-separated list; `count` 0 allows any length."""
    parts = tuple(number(part.strip()) for part in text.split(","))
    if (count and len(parts) != count) or "" in parts:
        raise WrongRequest(f"`{option}` is {text!r}; allowed is {example}; separate numbers by commas")
    return parts


def start_axes(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the axes of starts typed as --x and --y: values of phase, displacement or velocity by name."""
    from vibroimpact.parameters import real_number, whole_number

    values: dict[str, Any] = {}
    with asked():
        given = {name: text for name, text in options.items() if text is not None}
        for name, axis in _axes(given, "starts").items():
            ends = [real_number(name, axis[end]) for end in ("from", "to")]
            points = whole_number(f"{name}.points", axis["points"], 2)
            if points > MOST_STARTS:
                raise ValueError(f"`{name}.points` is {points}; allowed is at most {MOST_STARTS}; take fewer")
            values[name] = [ends[0] + (ends[1] - ends[0]) * at / (points - 1) for at in range(points)]
            values[name][-1] = ends[1]
    return values


def _tables(given: Mapping[str, Any], axes: str) -> dict[str, dict[str, Any]]:
    run: dict[str, Any] = {name: given[name] for name in _RUN if name in given}
    run |= {name: number(run[name]) for name in ("time_step", "workers") if name in run}
    if "indices" in given:
        run["indices"] = _indices(given["indices"])
    if given.get("every_impact"):
        run["early_closing"] = False
    return {
        "oscillator": _pairs(given.get("parameter", ())),
        "axes": {} if axes == "starts" else _axes(given, axes),
        "sampling": {name: number(given[name]) for name in _SAMPLING if name in given},
        "start": _start(given["start"]) if "start" in given else {},
        "tolerances": {"chatter": number(given["chatter"])} if "chatter" in given else {},
        "run": run,
    }


def _pairs(texts: list[str]) -> dict[str, Any]:
    pairs: dict[str, Any] = {}
    for text in texts:
        name, sign, value = (part.strip() for part in text.partition("="))
        if not (name and sign and value):
            raise ValueError(f"`-p` is {text!r}; allowed is name=value; write for example -p omega=2.8")
        if name in pairs:
            raise ValueError(f"`-p {name}` is given twice; allowed is each parameter once; drop one")
        pairs[name] = number(value)
    return pairs


def _indices(text: str) -> list[str]:
    if text.strip() == "all":
        from vibroimpact.indices import INDICES

        return list(INDICES)
    return [name.strip() for name in text.split(",")]


def _axes(given: Mapping[str, Any], kind: str) -> dict[str, Any]:
    typed = [(f"--{key}", given[key]) for key in ("x", "y") if key in given]
    typed += [("--axis", text) for text in given.get("axis", ())]
    axes: dict[str, Any] = {}
    for option, text in typed:
        name, _, values = (part.strip() for part in text.partition("="))
        ends = values.split(":")
        if not name or len(ends) not in ((2, 3) if kind == "span" else (3,)):
            form, example = _FORMS[kind]
            raise ValueError(f"`{option}` is {text!r}; allowed is {form}; write for example {option} {example}")
        if name in ("damping_ratio", "zeta"):
            raise ValueError(
                f"`{option}` is {text!r}, an axis of the damping ratio; allowed is one of damping; "
                "write damping=from:to with c = 2 zeta sqrt(k m) in N s/m"
            )
        if name in axes:
            raise ValueError(f"`{option}` is {text!r}, the second axis {name}; allowed is each once; drop one")
        axes[name] = dict(zip(("from", "to", "points"), map(number, [*ends, "2"][:3]), strict=True))
    return axes


def _start(text: str) -> dict[str, Any]:
    parts = [number(part.strip()) for part in text.split(",")]
    if len(parts) > 3:
        raise ValueError(f"`--start` is {text!r}; allowed is y,v,t; write for example --start -1,0,0")
    return dict(zip(("displacement", "velocity", "time"), parts, strict=False))
