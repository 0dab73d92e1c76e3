"""Round obstacles as rings of flat facets."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from vibroimpact.model.force import vector
from vibroimpact.model.stops import STOPS, Stop
from vibroimpact.parameters import OF_ONE_MASS, invalid, real_number, whole_number


def round_obstacle(
    x: Any, y: Any, *, clearance: float, facets: int = 16, name: str = "ring", first_at: float = 0.0, **contact: Any
) -> list[Stop]:
    r"""Return the stops of a round hole around a round part: a rotor in its casing, a tube in a drilled support.

    .. math:: x \cos \theta_j + y \sin \theta_j \le c, \qquad \theta_j = \theta_0 + 2 \pi j/n

    The part moves within the circle of radius c about the centre; n facets that touch this circle replace it. Where two
    facets meet, the part may go farther than c by the factor :math:`1/\cos(\pi/n)` (`facet_error`), and an impact acts
    along the nearest of the n directions, which differs from the true one by up to :math:`\pi/n`. Contacts are without
    friction.

    Parameters
    ----------
    x, y : sequence of n float, or mapping of points to factors
        Directions of the part's displacements along two perpendicular axes, as the `direction` of a `Stop`.
    clearance : float, > 0
        c in m: the radius of the hole less that of the part; half of the diametral clearance.
    facets : int, 3 to 64
        n; 16 let the part go 2 % of c too far at worst, 32 let it go .5 %.
    name : str
        The group of the stops, which are called `<name>_1`, `<name>_2`, ...
    first_at : float
        Angle of the first facet from x towards y, in degrees.
    **contact
        `restitution`, or `stiffness` and `damping`, of every facet, as for a `Stop`.

    Returns
    -------
    list of Stop
        The facets, each with its `angle`, which tables of impacts list.

    Raises
    ------
    ValueError
        A number is out of range, or x and y are not both sequences of one length or both mappings, or are parallel.

    Notes
    -----
    Cost: only facets that can be reached soon are looked at.

    Examples
    --------
    A rotor on an isotropic support within its casing:

    >>> import vibroimpact as vi
    >>> casing = vi.round_obstacle([1, 0], [0, 1], clearance=1e-3, restitution=0.5, name="casing")
    >>> force = vi.Force(frequency=20.0, harmonics={1: [40.0, 40.0j]})
    >>> rotor = vi.ImpactSystem(
    ...     mass=np.eye(2), damping=20.0 * np.eye(2), stiffness=1e4 * np.eye(2), force=force, stops=casing
    ... )
    >>> hits = vi.impact_section(rotor, sample_impacts=200)
    >>> sorted(set(hits["angle"].values.tolist()))[:3], round(100 * facet_error(16), 2)
    ([0.0, 22.5, 45.0], 1.96)
    """
    n = whole_number("facets", facets, 3, STOPS)
    if OF_ONE_MASS["gap"].check(clearance) <= 0.0:
        raise invalid("clearance", clearance, "> 0", "it is the radius of the hole less that of the part")
    along, across = vector("x", x), vector("y", y)
    if isinstance(along, Mapping) != isinstance(across, Mapping):
        raise ValueError("`x` and `y` must be both sequences of numbers, or both mappings from names of points")
    if not isinstance(along, Mapping):
        if len(along) != len(across):
            raise ValueError(f"`x` and `y` must have the same length, got {len(along)} and {len(across)} numbers")
        if np.linalg.matrix_rank([along, across]) < 2:
            raise ValueError("`x` and `y` must be two different directions, not zero; got two that are parallel")
    angles = real_number("first_at", first_at) + 360.0 * np.arange(n) / n
    return [
        Stop(
            direction=_between(along, across, math.radians(angle)),
            gap=clearance,
            name=f"{name}_{number}",
            group=name,
            angle=angle,
            **contact,
        )
        for number, angle in enumerate(angles.tolist(), 1)
    ]


def _between(x: Any, y: Any, angle: float) -> Any:
    """Return x cos + y sin of an angle."""
    if not isinstance(x, Mapping):
        return x * math.cos(angle) + y * math.sin(angle)
    points = dict.fromkeys([*x, *y])
    return {point: x.get(point, 0.0) * math.cos(angle) + y.get(point, 0.0) * math.sin(angle) for point in points}


def facet_error(facets: int) -> float:
    r"""Return the largest distance beyond the clearance that n facets let a part go, over the clearance.

    .. math:: \frac{1}{\cos(\pi/n)} - 1

    Parameters
    ----------
    facets : int, >= 3
        n.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        n is less than 3.

    Examples
    --------
    >>> [round(100 * facet_error(n), 1) for n in (8, 16, 32, 64)]
    [8.2, 2.0, 0.5, 0.1]
    """
    return 1.0 / math.cos(math.pi / whole_number("facets", facets, 3)) - 1.0
