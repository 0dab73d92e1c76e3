"""The tuples that kernels pass: the state of a cell, its constants, and how they are kept in an array."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba import njit


class Motion(NamedTuple):
    """The state: gap u, its rate p in steps, the pair (sin wt, cos wt), whole driving periods n."""

    u: float
    p: float
    s: float
    c: float
    n: float


class Constants(NamedTuple):
    """What a cell is stepped with, in units of a step.

    C, K, A, G, th, Q stand in the equation of motion (`vibroimpact.kernels`); r is the restitution, cut the speed
    below which impacts are not recorded, tail the factor 2 r/(1 - r) of a chatter's duration, and (sr, cr) the pair
    (sin wt, cos wt) of the release.
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


def kept(first: int, stride: int, *kinds: Any) -> tuple[Any, ...]:
    """Return the functions load(array, i) and store(array, i, value) of each named tuple kept in a flat array.

    Entries are `stride` apart: entry k is `array[k * stride + i]`. The tuples follow one another from entry `first` on;
    the entry after them is returned last. The places are written out, so that the compiler sees constant distances
    between all of them.
    """
    pairs = []
    inlined = njit(inline="always", error_model="numpy")
    for kind in kinds:
        last = first + len(kind._fields)
        places = ", ".join(f"array[{k * stride} + i]" for k in range(first, last))
        functions: dict[str, Any] = {"kind": kind}
        exec(f"def load(array, i): return kind({places})\ndef store(array, i, value): {places} = value", functions)
        pairs.append((inlined(functions["load"]), inlined(functions["store"])))
        first = last
    return *pairs, first
