"""Value objects: equality and hash follow from the arguments."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np


class ByValue:
    """A value that is compared, hashed, shown and pickled by the arguments of its constructor.

    Arguments in `labels` name things only, and do not count in comparisons.
    """

    labels: ClassVar[tuple[str, ...]] = ()

    def arguments(self) -> dict[str, Any]:
        """Return the arguments of the constructor by name."""
        raise NotImplementedError

    def plain(self) -> dict[str, Any]:
        """Return the arguments as numbers, strings, lists and dictionaries."""
        return {name: _as_json(value) for name, value in self.arguments().items()}

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self._compared() == other._compared()

    def __hash__(self) -> int:
        return hash((type(self).__name__, self._compared()))

    def _compared(self) -> Any:
        return _hashable({name: value for name, value in self.arguments().items() if name not in self.labels})

    def __repr__(self) -> str:
        entries = (
            f"{name}={written(value)}"
            for name, value in self.arguments().items()
            if value is not None and not (isinstance(value, Mapping) and not value)
        )
        return f"{type(self).__name__}({', '.join(entries)})"

    def __reduce__(self) -> Any:
        return _rebuilt, (type(self), self.arguments())


def _rebuilt(kind: Any, arguments: dict[str, Any]) -> Any:
    return kind(**arguments)


def _as_json(value: Any) -> Any:
    """Return a value with arrays as lists; a complex array as two, the real and the imaginary parts."""
    if isinstance(value, ByValue):
        return value.plain()
    if isinstance(value, Mapping):
        return {str(key): _as_json(part) for key, part in value.items()}
    if isinstance(value, tuple):
        return [_as_json(part) for part in value]
    if np.iscomplexobj(value):
        return [np.asarray(value).real.tolist(), np.asarray(value).imag.tolist()]
    return value.tolist() if isinstance(value, np.ndarray) else value


def _hashable(value: Any) -> Any:
    """Return a value with arrays and mappings as tuples, for comparisons."""
    if isinstance(value, np.ndarray):
        return value.shape, tuple(value.ravel().tolist())
    if isinstance(value, Mapping):
        return frozenset((key, _hashable(entry)) for key, entry in value.items())
    return tuple(map(_hashable, value)) if isinstance(value, (tuple, list)) else value


def written(value: Any) -> str:
    """Return a value as it is written in code, arrays as lists."""
    if isinstance(value, np.ndarray):
        return f"[{', '.join(map(written, value.tolist()))}]"
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key!r}: {written(entry)}' for key, entry in value.items())}}}"
    return repr(value.real if isinstance(value, complex) and not value.imag else value)
