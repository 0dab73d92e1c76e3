"""The tuples that kernels pass: the state of a cell, its constants, and how they are kept in an array."""

from __future__ import annotations

from typing import Any, NamedTuple, get_type_hints

from numba import njit

from vibroimpact.kernels.machine import inner
from vibroimpact.kernels.vectors import give, select, take


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
    """Where leaps have come to, and the steps they passed."""

    at: Motion
    steps: float


class Constants(NamedTuple):
    """What a cell is stepped with, in units of a step.

    C, K, A, G, th, Q stand in the equation of motion (`vibroimpact.kernels`); r is the restitution, cut the speed
    below which impacts are not recorded, tail the factor 2 r/(1 - r) of a chatter's duration, (sr, cr) the pair
    (sin wt, cos wt) of the release, and `short` and `long` are the leaps.
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


def kept(first: int, stride: int, *kinds: Any) -> tuple[Any, ...]:
    """Return the functions load(array, i) and store(array, i, value) of each named tuple kept in a flat array.

    Entries are `stride` apart: entry k is `array[k * stride + i]`, or with `wide` (not None) as many from there on as a
    value of lanes holds. The tuples follow one another from entry `first` on; the entry after them is returned last.
    The places are written out, so that the compiler sees constant distances between all of them.
    """
    pairs = []
    inlined = njit(error_model="numpy", forceinline=True)
    for kind in kinds:
        functions: dict[str, Any] = {"take": take, "give": give}
        written, stored, last = _places(kind, "value", first, stride, functions)
        exec(f"def load(array, i, wide=None): return {written}", functions)
        exec(f"def store(array, i, value, wide=None): {'; '.join(stored)}", functions)
        pairs.append((inlined(functions["load"]), inlined(functions["store"])))
        first = last
    return *pairs, first


def _places(kind: Any, name: str, first: int, stride: int, kinds: dict[str, Any]) -> tuple[str, list[str], int]:
    """Return the expression that makes a named tuple, nested ones too, from a flat array, the statements that store the
    one of this name there, and the entry after it.
    """
    kinds[kind.__name__] = kind
    parts, stored = [], []
    for field, part in get_type_hints(kind).items():
        if issubclass(part, tuple):
            written, more, first = _places(part, f"{name}.{field}", first, stride, kinds)
            stored += more
        else:
            place = f"array, {first * stride} + i, wide"
            written, first = f"take({place})", first + 1
            stored.append(f"give({place}, {name}.{field})")
        parts.append(written)
    return f"{kind.__name__}({', '.join(parts)})", stored, first
