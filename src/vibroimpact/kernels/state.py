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


def kept(kind: Any, first: int, stride: int) -> tuple[Any, Any]:
    """Return the functions load(array, i) and store(array, i, value) of a named tuple kept in a flat array.

    Its entries are `stride` apart: entry k is `array[(first + k) * stride + i]`. The places are written out, so that
    the compiler sees constant distances between all of them.
    """
    places = ", ".join(f"array[{(first + k) * stride} + i]" for k in range(len(kind._fields)))
    functions: dict[str, Any] = {"kind": kind}
    exec(f"def load(array, i): return kind({places})\ndef store(array, i, value): {places} = value", functions)
    inlined = njit(inline="always", error_model="numpy")
    return inlined(functions["load"]), inlined(functions["store"])
