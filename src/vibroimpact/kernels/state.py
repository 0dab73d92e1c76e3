"""The tuples that kernels pass: the state of a cell, its constants, and how they are kept in an array."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple, get_type_hints

from numba import types
from numba.extending import intrinsic

from vibroimpact.kernels.shared.machine import inner
from vibroimpact.kernels.shared.vectors import kind_at, place_of, read, select, write


class Motion(NamedTuple):
    """The state: gap u, its rate p in steps, the pair (sin wt, cos wt), whole driving periods n."""

    u: float
    p: float
    s: float
    c: float
    n: float


@inner(forceinline=True)
def chosen(condition, yes, no):
    """Return one of two motions."""
    return Motion(
        select(condition, yes.u, no.u),
        select(condition, yes.p, no.p),
        select(condition, yes.s, no.s),
        select(condition, yes.c, no.c),
        select(condition, yes.n, no.n),
    )


class Flow(NamedTuple):
    """The flow over a fixed length, u1 = uu u + up p + us s + uc c + ug and so p1, and the turn of (s, c)."""

    uu: float
    up: float
    pu: float
    pp: float
    us: float
    uc: float
    ug: float
    ps: float
    pc: float
    pg: float
    sine: float
    cosine: float


class Leap(NamedTuple):
    """A flow over X, and what gives q/2 = load - push sin wt in its certificate."""

    flow: Flow
    push: float
    load: float
    X: float


class Leapt(NamedTuple):
    """Where leaps have come to, the steps they passed, and the least gap of the near-misses that were looked for."""

    at: Motion
    steps: float
    margin: float


class Constants(NamedTuple):
    """What a cell is stepped with, in units of a step.

    C, K, A, G, th, Q stand in the equation of motion (`vibroimpact.kernels`); r is the restitution, cut the speed
    below which impacts are not recorded, tail the factor 2 r/(1 - r) of a chatter's duration, (sr, cr) the pair
    (sin wt, cos wt) of the release, `short` and `long` are the leaps.
    """

    C: float
    K: float
    A: float
    G: float
    th: float
    Q: float
    r: float
    cut: float
    tail: float
    sr: float
    cr: float
    short: Leap
    long: Leap


OMITTED = types.Omitted(None)


def accessors(first: int, stride: int, *kinds: Any) -> tuple[Any, ...]:
    """Return the functions load(array, i) and store(array, i, value) of each named tuple kept in a flat array.

    Entries are `stride` apart: entry k is `array[k * stride + i]`, or with `wide` (not None) as many from there on as a
    value of lanes holds. The tuples follow one another from entry `first` on; the entry after them is returned last.
    """
    pairs = []
    for kind in kinds:
        pairs.append(_pair(kind, first, stride))
        first += _count(kind)
    return *pairs, first


def _pair(kind: Any, first: int, stride: int) -> tuple[Any, Any]:
    """Return the functions that load and store one named tuple.

    Emitted entry by entry: as functions of Python they would be a tenth of all that is compiled.
    """

    def places(context: Any, builder: Any, array: Any, values: Any, number: Any) -> Iterator[Any]:
        """Go through the places of the entries: constant distances, which the compiler sees."""
        for entry in range(first, first + _count(kind)):
            place = builder.add(values[1], context.get_constant(types.intp, entry * stride))
            yield place_of(context, builder, (array, values[0]), place, number)

    @intrinsic
    def load(typingctx: Any, array: Any, i: Any, wide: Any = None) -> Any:
        number = kind_at(wide)
        result = _type(kind, number)

        def codegen(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            return _assembled(context, builder, result, places(context, builder, array, values, number))

        return result(array, types.intp, wide or OMITTED), codegen

    @intrinsic
    def store(typingctx: Any, array: Any, i: Any, value: Any, wide: Any = None) -> Any:
        number = kind_at(wide)

        def codegen(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            parts = _parts(builder, value, values[2])
            for (part, its), place in zip(parts, places(context, builder, array, values, number), strict=True):
                write(context, builder, place, part, (its, number))
            return context.get_dummy_value()

        return types.none(array, types.intp, value, wide or OMITTED), codegen

    return load, store


def _fields(kind: Any) -> list[Any]:
    return list(get_type_hints(kind).values())


def _count(kind: Any) -> int:
    """Return the number of numbers that a named tuple holds, nested ones too."""
    return sum(_count(part) if issubclass(part, tuple) else 1 for part in _fields(kind))


def _type(kind: Any, number: Any) -> Any:
    """Return the compiler's type of a named tuple whose numbers have this type."""
    return types.BaseTuple.from_types(
        [_type(part, number) if issubclass(part, tuple) else number for part in _fields(kind)], kind
    )


def _assembled(context: Any, builder: Any, kind: Any, places: Iterator[Any]) -> Any:
    """Emit a tuple of what lies at the places."""
    parts = [
        _assembled(context, builder, part, places) if isinstance(part, types.BaseTuple) else read(builder, next(places))
        for part in kind
    ]
    return context.make_tuple(builder, kind, parts)


def _parts(builder: Any, kind: Any, value: Any) -> Iterator[tuple[Any, Any]]:
    """Go through the numbers of a tuple, each with its type."""
    for at, part in enumerate(kind):
        item = builder.extract_value(value, at)
        if isinstance(part, types.BaseTuple):
            yield from _parts(builder, part, item)
        else:
            yield item, part
