"""From a TOML file, completed by the caller's own values, to a checked request."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from vibroimpact.cli.study.tables import TABLES, WORDS, Study, nearest
from vibroimpact.oscillator import STAND_FOR


def read_study(path: str | os.PathLike[str], changes: Mapping[str, Mapping[str, Any]] | None = None) -> Study:
    r"""Read a study file; all its faults are told at once.

    Parameters
    ----------
    path : path
        A TOML file with any of the tables `[oscillator]`, `[axes]`, `[sampling]`, `[start]`, `[tolerances]`
        and `[run]`.
    changes : mapping of tables, optional
        Values that take the place of those in the file or complete them; axes given here replace all of
        the file's.

    Returns
    -------
    Study
        The request, checked.

    Raises
    ------
    ValueError
        The file is not TOML or has faults; one line each, with key, value, what is allowed and what to do.
    OSError
        The file cannot be read.

    Examples
    --------
    >>> from pathlib import Path; import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder, "study.toml")
    ...     _ = file.write_text("[oscillator]\nmass = 2\n")
    ...     read_study(file, {"oscillator": {"r": 0.5}}).make_oscillator().restitution
    0.5
    """
    shown = repr(str(path))
    try:
        document = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        message = f"`study` is {shown}, which cannot be read ({error.strerror}); give the name of a TOML file"
        raise OSError(error.errno, message) from error
    except ValueError as error:
        raise ValueError(
            f"`study` is {shown}, which is no TOML: {error}; allowed is key = value in [tables]; mend that place"
        ) from error
    try:
        return make_study(document, changes, dotted=True)
    except ValueError as error:
        faults = str(error).splitlines()
        count = "1 fault" if len(faults) == 1 else f"{len(faults)} faults"
        raise ValueError("\n".join([f"`study` is {shown}, with {count}:", *faults])) from None


def make_study(
    document: Mapping[str, Any], changes: Mapping[str, Mapping[str, Any]] | None = None, *, dotted: bool = False
) -> Study:
    """Return the request that nested tables hold, or raise one `ValueError` with a line a fault.

    Parameters
    ----------
    document : mapping
        The tables of a study file.
    changes : mapping of tables, optional
        As for `read_study`.
    dotted : bool
        Whether faults name a key with its table (`oscillator.mass`) or alone (`mass`).

    Returns
    -------
    Study
        The request, checked.

    Raises
    ------
    ValueError
        Something is misspelt, missing or out of its range.

    Examples
    --------
    >>> make_study({"oscillator": {"mass": -1}})
    Traceback (most recent call last):
    ValueError: `mass` is -1; allowed is a finite number > 0; give the moving mass in kg
    """
    try:
        study = Study.model_validate(_merged(document, changes or {}))
    except ValidationError as error:
        faults = [_fault(found, dotted) for found in error.errors(include_url=False)]
        raise ValueError("\n".join(faults)) from None
    study.make_oscillator()  # refuses what no table can tell alone
    return study


def _merged(document: Mapping[str, Any], changes: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    merged = dict(document)
    for table, entries in changes.items():
        own = merged.get(table, {})
        if not entries or not isinstance(own, Mapping):
            continue
        if table == "axes":
            merged[table] = dict(entries)
            continue
        replaced = {WORDS.get(name, name) for name in entries}
        for pair in map(set, STAND_FOR.items()):
            replaced |= pair if replaced & pair else set()
        kept = {name: value for name, value in own.items() if WORDS.get(name, name) not in replaced}
        merged[table] = {**kept, **entries}
    return merged


def _fault(found: Any, dotted: bool) -> str:
    """Return the line, or lines, that tell of a fault pydantic found."""
    *tables, last = (str(part) for part in found["loc"])
    name = ".".join([*(tables if dotted else ()), last])
    value = found["input"]
    match found["type"]:
        case "value_error":
            word = WORDS.get(last, last)
            return re.sub(rf"^`{word}\b", f"`{name}", str(found["ctx"]["error"]), flags=re.MULTILINE)
        case "extra_forbidden":
            return _unknown(name, last, tables)
        case "missing":
            return f"`{name}` is missing; allowed is a finite number; add it"
        case "literal_error":
            return f"`{name}` is {value!r}; allowed are {found['ctx']['expected']}; choose one of them"
        case "model_type":
            return f"`{name}` is {value!r}; allowed is a table; write [{name}] above its keys"
        case "bool_type" | "bool_parsing":
            return f"`{name}` is {value!r}; allowed are true and false; choose one of them"
    return f"`{name}` is {value!r}; {found['msg']}; correct it"


def _unknown(name: str, last: str, tables: list[str]) -> str:
    fields = (TABLES[tables[0]] if tables else Study).model_fields
    if WORDS.get(last, last) in fields:
        return f"`{name}` is given twice; allowed is the word {WORDS[last]!r} or its symbol; drop one"
    return f"`{name}` is no such key; allowed are {', '.join(fields)}; {nearest(last, fields)}"
