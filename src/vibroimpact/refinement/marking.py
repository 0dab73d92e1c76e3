"""Which cells to compute next."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from vibroimpact.refinement.lattice import Flags, Places, places, points_of, quads, widen
from vibroimpact.refinement.picture import Picture


@dataclass(frozen=True)
class Rule:
    """What makes a square of neighbours worth a closer look.

    Parameters
    ----------
    jumps : mapping of str to float
        The least difference of an index between neighbours that counts as a boundary; a change of motion always does.
    margin : int
        Squares around a mixed one that are refined unseen. By trial none: boundaries that slip between samples are
        found at less cost by `overlooked`.
    """

    jumps: Mapping[str, float] = field(default_factory=dict)
    margin: int = 0


def wanted(picture: Picture, step: int, rule: Rule) -> Places:
    """Return the cells of the lattice of `step` to be computed, judged by the lattice of twice the step."""
    squares = widen(mixed_squares(picture, 2 * step, rule), rule.margin)
    points = points_of(squares) & (picture.level[::step, ::step] < 0)
    return places(points, step, picture.shape)


def overlooked(picture: Picture, step: int, rule: Rule) -> Places:
    """Return the cells of the lattice of `step` that were filled in, but lie beside a boundary as it turns out."""
    squares = mixed_squares(picture, step, rule)
    points = np.zeros(picture.level[::step, ::step].shape, bool)
    for corner in quads(points):
        corner |= squares
    return places(points & (picture.level[::step, ::step] < 0), step, picture.shape)


def mixed_squares(picture: Picture, step: int, rule: Rule) -> Flags:
    """Return the squares of a lattice whose corners differ in motion, or in an index by more than the rule allows."""
    first, *others = quads(picture.motion[::step, ::step])
    mixed: Flags = np.zeros(first.shape, bool)
    for other in others:
        mixed |= first != other
    for name, most in rule.jumps.items():
        corners = quads(picture.values[name][::step, ::step])
        with np.errstate(invalid="ignore"):  # no value is no boundary: the class tells
            mixed |= np.max(corners, axis=0) - np.min(corners, axis=0) > most
    return mixed
