"""Cross-sections of beams, rods and tubes: their areas and second moments of area."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from vibroimpact.parameters import invalid, positive_number

_SHAPES = "width and thickness, diameter, or outer_diameter and wall_thickness"


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
