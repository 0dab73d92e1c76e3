"""Beams and rods: their cross-sections; their finite elements, meshes and modes, in lengths of an average element."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.matrices import scaled
from vibroimpact.parameters import invalid, positive_number

_GAUSS = 0.5 / math.sqrt(3.0)  # two points at this distance from the middle, of a length 1, integrate cubics exactly
_SHAPES = "width and thickness, diameter, or outer_diameter and wall_thickness"


@dataclass(frozen=True, eq=False)
class Element:
    """A kind of element, for unit rigidity and unit mass per length, with the `freedoms` of a node.

    `supports` are the stiffnesses of named supports against the freedoms of their node.
    """

    name: str
    freedoms: int
    supports: Mapping[str, tuple[float, ...]]

    def strains(self, length: float) -> Floats:
        """Return rows over the freedoms of an element; its energy is half the sum of their squares."""
        if self.freedoms == 1:
            return np.array([[-1.0, 1.0]]) / math.sqrt(length)
        bend = np.array([0.0, -1.0, 0.0, 1.0]) / math.sqrt(length)
        shear = np.array([1.0, 0.5 * length, -1.0, 0.5 * length]) * math.sqrt(12.0 / length**3)
        return np.array([bend, shear])

    def mass(self, length: float) -> Floats:
        """Return the consistent mass matrix of an element."""
        if self.freedoms == 1:
            return np.array([[2.0, 1.0], [1.0, 2.0]]) * (length / 6.0)
        a, b, c, d = 22.0 * length, 13.0 * length, 4.0 * length**2, 3.0 * length**2
        rows = [[156.0, a, 54.0, -b], [a, c, b, -d], [54.0, b, 156.0, -a], [-b, -d, -a, c]]
        return np.array(rows) * (length / 420.0)

    def shape(self, length: float, s: float) -> Floats:
        """Return the displacement at s, from 0 to 1 along an element, as a row over its freedoms."""
        r = 1.0 - s
        if self.freedoms == 1:
            return np.array([r, s])
        return np.array([r * r * (1.0 + 2.0 * s), length * s * r * r, s * s * (1.0 + 2.0 * r), -length * s * s * r])

    def rigid(self, nodes: Floats) -> Floats:
        """Return the rigid-body motions over the freedoms of all nodes, as columns."""
        if self.freedoms == 1:
            return np.ones((len(nodes), 1))
        motions = np.zeros((len(nodes), 2, 2))
        motions[:, 0, 0], motions[:, 0, 1], motions[:, 1, 1] = 1.0, nodes, 1.0
        return motions.reshape(-1, 2)


FIXED = math.inf
BEAM = Element("beam", 2, {"clamp": (FIXED, FIXED), "pin": (FIXED, 0.0), "guide": (0.0, FIXED)})
ROD = Element("rod", 1, {"clamp": (FIXED,)})


def nodes_of(kind: Element, bounds: list[float], elements: int) -> tuple[float, ...]:
    """Return the nodes, in lengths of an average element: some at the bounds, the largest distance being smallest."""
    spans = np.diff(bounds)
    if len(spans) > elements:
        raise invalid("elements", elements, f"at least {len(spans)}, as supports are at nodes of the {kind.name}")
    number = np.ones(len(spans), int)
    for _ in range(elements - len(spans)):
        number[np.argmax(spans / number)] += 1
    inside = [
        np.linspace(low, high, n, endpoint=False) for (low, high), n in zip(pairwise(bounds), number, strict=True)
    ]
    return (*np.concatenate(inside).tolist(), bounds[-1])


@lru_cache(maxsize=64)
def modes_of(
    kind: Element, nodes: tuple[float, ...], held: tuple[tuple[float, tuple[float, ...]], ...]
) -> tuple[Floats, Floats]:
    """Return natural angular frequencies, ascending, and mass-normalised shapes over the freedoms of all nodes.

    Frequencies are singular values of the strains in mass-normalised freedoms: their rounding error is that of the
    highest one, where eigenvalues of the stiffness matrix have that of its square.
    """
    each, size = kind.freedoms, kind.freedoms * len(nodes)
    strains, mass = np.zeros((each * (len(nodes) - 1), size)), np.zeros((size, size))
    for at, (low, high) in enumerate(pairwise(nodes)):
        over = slice(each * at, each * (at + 2))
        strains[each * at : each * (at + 1), over] = kind.strains(high - low)
        mass[over, over] += kind.mass(high - low)
    stiffness = np.zeros(size)
    for place, stiff in held:
        at = each * int(np.argmin(np.abs(np.array(nodes) - place)))
        stiffness[at : at + each] = stiff
    free = np.flatnonzero(stiffness < FIXED)
    springs = np.flatnonzero((stiffness > 0.0) & (stiffness < FIXED))
    rows = np.concatenate([strains, np.sqrt(stiffness[springs, None]) * np.eye(size)[springs]])[:, free]
    lower = np.linalg.cholesky(mass[np.ix_(free, free)])
    _, singular, turned = np.linalg.svd(np.linalg.solve(lower, rows.T).T)
    rigid = kind.rigid(np.array(nodes))
    _, sizes, turn = np.linalg.svd(rigid[stiffness > 0.0])
    kept = turn[np.count_nonzero(sizes > 1e-12 * np.abs(nodes[-1])) :].T if len(sizes) else turn.T
    number = kept.shape[1]
    rates = np.append(np.zeros(number), singular[: len(free) - number][::-1])
    vectors = turned[: len(free) - number][::-1].T
    if number:
        still, _ = np.linalg.qr(lower.T @ (rigid @ kept)[free])
        vectors = np.hstack([still, vectors])
    shapes = np.zeros((size, len(free)))
    shapes[free] = scaled(np.linalg.solve(lower.T, vectors))
    shapes /= np.sqrt(np.einsum("ji,jk,ki->i", shapes, mass, shapes))
    for part in (rates, shapes):
        part.setflags(write=False)
    return rates, shapes


def row_of(kind: Element, nodes: Floats, begin: float, end: float | None = None) -> Floats:
    """Return the displacement at a place, or its mean along a span, as a row over the freedoms of all nodes."""
    row = np.zeros(kind.freedoms * len(nodes))
    if end is None:
        at = min(int(np.searchsorted(nodes, begin, side="right")) - 1, len(nodes) - 2)
        length = nodes[at + 1] - nodes[at]
        row[kind.freedoms * at : kind.freedoms * (at + 2)] = kind.shape(length, (begin - nodes[at]) / length)
        return row
    for low, high in pairwise([begin, *nodes[(nodes > begin) & (nodes < end)].tolist(), end]):
        share = 0.5 * (high - low) / (end - begin)
        for side in (-_GAUSS, _GAUSS):
            row += share * row_of(kind, nodes, 0.5 * (low + high) + side * (high - low))
    return row


# Cross-sections


def area_and_second_moment(section: Any) -> tuple[float, float]:
    """Return the area in m^2 and the second moment of area in m^4 of a section given by its dimensions in m."""
    if not isinstance(section, Mapping):
        raise invalid("section", section, f"a mapping of dimensions in m ({_SHAPES})", 'write {"diameter": 0.02}')
    sizes = {name: positive_number(f"section[{name!r}]", value) for name, value in section.items()}
    match sizes:
        case {"width": width, "thickness": thickness} if len(sizes) == 2:
            return width * thickness, width * thickness**3 / 12.0
        case {"diameter": diameter} if len(sizes) == 1:
            return 0.25 * math.pi * diameter**2, math.pi * diameter**4 / 64.0
        case {"outer_diameter": outer, "wall_thickness": wall_thickness} if len(sizes) == 2:
            area, squared = ring(outer, wall_thickness)
            return area, area * squared
    raise ValueError(f"`section` must have the dimensions {_SHAPES}, got {', '.join(map(str, sizes)) or 'none'}")


def ring(outer: float, wall_thickness: float) -> tuple[float, float]:
    """Return the area of the wall of a tube, and the square of its radius of gyration."""
    inner = outer - 2.0 * wall_thickness
    if inner <= 0.0:
        raise invalid("wall_thickness", wall_thickness, f"less than half of `outer_diameter`, {outer / 2:g}")
    wall = math.pi * wall_thickness * (outer - wall_thickness)
    return wall, (outer**2 + inner**2) / 16.0
