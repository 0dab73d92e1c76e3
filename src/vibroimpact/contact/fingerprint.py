"""A short text that identifies what a Python function does: it changes with the code and the numbers it uses."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from types import CodeType, FunctionType, ModuleType
from typing import Any


def fingerprint(function: Any) -> str:
    """Return a text that two functions share only if they have the same bytecode, constants and captured values.

    Functions that it calls count, and so do defaults; names, comments and positions in a file do not. Another version
    of Python produces other bytecode.

    Examples
    --------
    >>> one, same, other = (lambda v: 0.5 * v), (lambda v: 0.5 * v), (lambda v: 0.6 * v)
    >>> fingerprint(one) == fingerprint(same), fingerprint(one) == fingerprint(other)
    (True, False)
    """
    return hashlib.sha256(repr(list(_parts(function, ()))).encode()).hexdigest()


def _parts(value: Any, above: tuple[Any, ...]) -> Iterator[Any]:
    """Yield the parts of a value as strings and numbers; `above` are the functions that contain it."""
    value = getattr(value, "py_func", value)  # the function that numba has compiled
    if isinstance(value, CodeType):
        yield value.co_code, value.co_names, value.co_varnames
        for constant in value.co_consts:
            yield from _parts(constant, above)
    elif isinstance(value, FunctionType) and value not in above:
        inside, within = value.__code__, (*above, value)
        cells = [cell.cell_contents for cell in value.__closure__ or ()]
        uses = [value.__globals__[name] for name in _names(inside) if name in value.__globals__]
        for part in (inside, *(value.__defaults__ or ()), *cells, *uses):
            yield from _parts(part, within)
    elif isinstance(value, (tuple, list)):
        for part in value:
            yield from _parts(part, above)
    elif isinstance(value, (FunctionType, ModuleType)):
        yield value.__name__
    else:
        yield value.tobytes() if hasattr(value, "tobytes") else repr(value)


def _names(code: CodeType) -> list[str]:
    """Return the names that a code object, and those inside it, look up."""
    inner = [name for part in code.co_consts if isinstance(part, CodeType) for name in _names(part)]
    return [*code.co_names, *inner]
