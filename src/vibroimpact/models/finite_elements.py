"""Beams and rods of finite elements, with supports, stops and loads at any place."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.matrices import COORDINATES, numbers
from vibroimpact.model.force import Force
from vibroimpact.model.points import over_points, resolved
from vibroimpact.model.stops import Stop, several_stops
from vibroimpact.model.system import ImpactSystem
from vibroimpact.models.arguments import sharing
from vibroimpact.models.meshes import BEAM, FIXED, ROD, Element, area_and_second_moment, modes_of, nodes_of, row_of
from vibroimpact.parameters import choice, invalid, positive_number, real_number, whole_number

_SAME = 1e-9  # of the length: places nearer to each other, or nearer beyond an end, differ by rounding

_SHARED = r"""
Parameters
----------
length : float, > 0
    Length in m; places are measured from the left end.
elements : int, >= 1
    The number of elements. A node is at each support; between supports elements are equally long.
supports : mapping of float to str, float or pair of float
    What holds the structure, by places in m: ``{0.0: "clamp"}``. A beam may have a ``"clamp"``, a ``"pin"``, a
    ``"guide"`` (which prevents rotation only), a spring in N/m, or a pair (N/m, N m/rad) against displacement and
    rotation; a rod a ``"clamp"`` or a spring. A stiffness of `math.inf` is rigid. ``{}`` leaves the structure free.
section : mapping of str to float, optional
    Dimensions in m: ``{"width": 0.03, "thickness": 0.03}``, which bends in the direction of its thickness,
    ``{"diameter": 0.02}``, or ``{"outer_diameter": 0.02, "wall_thickness": 0.002}``.
youngs_modulus, density : float, > 0
    E in Pa and the density in kg/m^3, with `section`.
rigidity, mass_per_length : float, > 0
    E I in N m^2 of a beam or E A in N of a rod, and m' in kg/m, instead of `section`, `youngs_modulus` and `density`.
points : mapping of str to float or pair of float, optional
    Named points by their places in m, for `force`, `stops` and `ImpactSystem.at_point`. A pair is a span: a force in N
    acts evenly along it, and its displacement is the mean along it.
force : Force, optional
    Forces in N at points: ``Force(frequency=50.0, harmonics={1: {"tip": 20.0}})``.
stops : sequence of Stop
    Stops at points: ``Stop(direction={"tip": 1.0}, gap=1e-3, stiffness=1e6)``; with -1.0, on the other side.
damping_ratios : float or sequence of float, >= 0
    Damping ratio of all modes, or of each.
rayleigh : pair of float, >= 0, optional
    a in 1/s and b in s of the damping matrix a M + b K, instead of `damping_ratios`.
modes : int, optional
    The number of modes, the slowest ones; by default all, one per degree of freedom of the nodes, at most 128.

Returns
-------
ImpactSystem
    Its coordinates are modal, in m sqrt(kg) with M = I; `at_point` returns displacements in m.

Raises
------
ValueError
    A number is out of range, a place is beyond the ends, `points` lacks a name, or a stop is at a rigid support.
"""


@sharing(_SHARED)
def fe_beam(
    *,
    length: float,
    elements: int,
    supports: Mapping[float, Any],
    section: Mapping[str, float] | None = None,
    youngs_modulus: float | None = None,
    density: float | None = None,
    rigidity: float | None = None,
    mass_per_length: float | None = None,
    points: Mapping[str, Any] | None = None,
    force: Force | None = None,
    stops: Iterable[Stop] = (),
    damping_ratios: Any = 0.0,
    rayleigh: tuple[float, float] | None = None,
    modes: int | None = None,
) -> ImpactSystem:
    r"""Return a beam of Hermite finite elements with any supports, stops and loads.

    .. math:: E I w'''' + m' \ddot w + \mathrm{damping} = \sum_i F_i(t)\, \delta(x - x_i)

    Notes
    -----
    Static deflections of the nodes are exact for forces anywhere. Natural frequencies of waves cos(bx) are too high by
    the fraction (b h)^4/1440 with elements of length h; those of rigid-body modes are exactly 0. With rigid stops,
    results depend on the number of modes and do not converge: see `cantilever_with_stop`. If the supports move with an
    acceleration a(t), w is relative to them, and the load is -m' L a(t) along the span (0, L). Left out: shear and
    rotary inertia, axial loads, large deflections.

    References
    ----------
    M. Petyt, Introduction to Finite Element Vibration Analysis, 2nd edition, 2010, chapter 3.

    Examples
    --------
    A cantilever with a spring behind a gap of 1 mm, driven at its tip:

    >>> import vibroimpact as vi
    >>> beam = fe_beam(
    ...     length=0.7,
    ...     elements=7,
    ...     supports={0.0: "clamp"},
    ...     section={"width": 0.03, "thickness": 0.03},
    ...     youngs_modulus=185e9,
    ...     density=7830.0,
    ...     points={"spring": 0.3, "tip": 0.7},
    ...     force=vi.Force(frequency=48.5, harmonics={1: {"tip": 20.0}}),
    ...     stops=[vi.Stop(direction={"spring": 1.0}, gap=1e-3, stiffness=1.3e6, name="spring")],
    ...     damping_ratios=0.008,
    ... )
    >>> (beam.natural_frequencies[:5] / (2 * np.pi)).round(1).tolist()
    [48.1, 301.3, 844.4, 1659.2, 2758.0]
    >>> motion = beam.at_point("tip", vi.simulate(beam, periods=40))
    >>> print(f"{1e3 * float(motion['displacement'].max()):.2f} mm, {motion.sizes['impact']} contacts")
    6.42 mm, 31 contacts
    """
    return _system(BEAM, locals())


@sharing(_SHARED)
def fe_rod(
    *,
    length: float,
    elements: int,
    supports: Mapping[float, Any],
    section: Mapping[str, float] | None = None,
    youngs_modulus: float | None = None,
    density: float | None = None,
    rigidity: float | None = None,
    mass_per_length: float | None = None,
    points: Mapping[str, Any] | None = None,
    force: Force | None = None,
    stops: Iterable[Stop] = (),
    damping_ratios: Any = 0.0,
    rayleigh: tuple[float, float] | None = None,
    modes: int | None = None,
) -> ImpactSystem:
    r"""Return a rod of linear finite elements that moves along its axis, with any supports, stops and loads.

    .. math:: -E A u'' + m' \ddot u + \mathrm{damping} = \sum_i F_i(t)\, \delta(x - x_i)

    Notes
    -----
    Static displacements of the nodes are exact for forces anywhere. Natural frequencies of waves cos(bx) are too high
    by the fraction (b h)^2/24 with elements of length h; that of the rigid-body mode is exactly 0. Left out: lateral
    inertia and bending.

    References
    ----------
    M. Petyt, Introduction to Finite Element Vibration Analysis, 2nd edition, 2010, chapter 3.

    Examples
    --------
    A steel rod that is free, with a rigid wall in front of its right end:

    >>> import vibroimpact as vi
    >>> rod = fe_rod(
    ...     length=1.0,
    ...     elements=20,
    ...     supports={},
    ...     section={"diameter": 0.02},
    ...     youngs_modulus=2.1e11,
    ...     density=7800.0,
    ...     points={"end": 1.0},
    ...     stops=[vi.Stop(direction={"end": 1.0}, gap=1e-3, restitution=0.0, name="wall")],
    ... )
    >>> (rod.natural_frequencies[:3] / (2 * np.pi)).round().tolist()
    [0.0, 2597.0, 5210.0]
    """
    return _system(ROD, locals())


def _system(kind: Element, given: Mapping[str, Any]) -> ImpactSystem:
    """Return the system of a beam or rod, from the arguments that both share."""
    length, elements = positive_number("length", given["length"]), whole_number("elements", given["elements"], 1)
    rigidity, per_length = _material(kind, given)
    unit = length / elements
    sizes = rigidity / unit ** (2.0 * kind.freedoms - 1.0 - 2.0 * np.arange(kind.freedoms))
    held = {
        place * elements / length: tuple((np.array(stiffness) / sizes).tolist())
        for place, stiffness in _supports(kind, given["supports"], length).items()
    }
    free = kind.freedoms * (elements + 1) - sum(each == FIXED for stiff in held.values() for each in stiff)
    if not 0 < free <= COORDINATES:
        most = elements - math.ceil((free - COORDINATES) / kind.freedoms)
        allowed = f"at most {most}, for {COORDINATES} degrees of freedom" if free > 0 else "at least 2 here"
        raise invalid("elements", elements, allowed, "" if free > 0 else "the supports hold all nodes")
    kept = free if given["modes"] is None else whole_number("modes", given["modes"], 1)
    if kept > free:
        raise invalid("modes", kept, f"at most {free}, the degrees of freedom of the nodes", "or choose more elements")
    nodes = nodes_of(kind, sorted({0.0, *held, float(elements)}), elements)
    rates, shapes = modes_of(kind, nodes, tuple(held.items()))
    rates = rates[:kept] * math.sqrt(rigidity / per_length) / unit**kind.freedoms
    shapes = shapes[:, :kept] / math.sqrt(per_length * unit)
    rows = {}
    for name, place in _points(given["points"]).items():
        ends = [_place(kind, f"points[{name!r}]", each, length) * elements / length for each in place]
        rows[name] = row_of(kind, np.array(nodes), *ends) @ shapes
    stops = several_stops(given["stops"])
    _check_moving(stops, rows)
    force, placed = resolved(given["force"], stops, rows, kept, over_points if rows else _no_points)
    linear = {"mass": np.eye(kept), "damping": np.diag(_damping(given, rates)), "stiffness": np.diag(rates**2)}
    return ImpactSystem(**linear, force=force, stops=placed, points=rows)


def _material(kind: Element, given: Mapping[str, Any]) -> tuple[float, float]:
    """Return the rigidity and the mass per length."""
    by_section, by_numbers = ("section", "youngs_modulus", "density"), ("rigidity", "mass_per_length")
    present = [name for name in (*by_section, *by_numbers) if given[name] is not None]
    if present == [*by_numbers]:
        rigidity, per_length = (positive_number(name, given[name]) for name in by_numbers)
        return rigidity, per_length
    if present == [*by_section]:
        area, second_moment = area_and_second_moment(given["section"])
        modulus, density = (positive_number(name, given[name]) for name in by_section[1:])
        return modulus * (second_moment if kind.freedoms == 2 else area), density * area
    raise ValueError(
        "give either `section`, `youngs_modulus` and `density`, or `rigidity` and `mass_per_length`; got "
        f"{', '.join(f'`{name}`' for name in present) or 'none of them'}"
    )


def _supports(kind: Element, supports: Any, length: float) -> dict[float, tuple[float, ...]]:
    """Return the stiffnesses of each support against the freedoms of its node, by places, ascending."""
    if not isinstance(supports, Mapping):
        raise invalid("supports", supports, "a mapping from places in m to supports", 'write {0.0: "clamp"}')
    held: dict[float, tuple[float, ...]] = {}
    for at, support in supports.items():
        place, name = _place(kind, "supports", at, length), f"supports[{at!r}]"
        if near := [other for other in held if abs(other - place) <= _SAME * length]:
            raise ValueError(f"`supports` has two supports at {near[0]:g} m; give one with both stiffnesses")
        if isinstance(support, str):
            held[place] = kind.supports[choice(name, support, kind.supports, "or give a stiffness in N/m")]
            continue
        given = tuple(support) if isinstance(support, (tuple, list)) else (support,)
        if len(given) > kind.freedoms:
            allowed = "a stiffness in N/m" if kind.freedoms == 1 else "two stiffnesses in N/m and N m/rad"
            raise invalid(name, support, allowed)
        stiff = tuple(each if each == FIXED else real_number(name, each) for each in given)
        if min(stiff) < 0.0 or not any(stiff):
            raise invalid(name, support, f"{' or '.join(map(repr, kind.supports))}, or a stiffness > 0")
        held[place] = stiff + (0.0,) * (kind.freedoms - len(stiff))
    return dict(sorted(held.items()))


def _place(kind: Element, name: str, place: Any, length: float) -> float:
    """Return a place in m between the ends, after checking it."""
    allowed = f"on the {kind.name}, from 0 to {length:g} m"
    at = real_number(name, place, allowed)
    if not -_SAME * length <= at <= (1.0 + _SAME) * length:
        raise invalid(name, place, allowed)
    return min(max(at, 0.0), length)


def _points(points: Any) -> dict[str, tuple[Any, ...]]:
    """Return the places of points by name: one each, or the ends of a span."""
    if points is None:
        return {}
    if not isinstance(points, Mapping) or not all(isinstance(name, str) for name in points):
        raise invalid("points", points, "a mapping from names to places in m", "write {'tip': 0.7}")
    places = {name: tuple(at) if isinstance(at, (tuple, list)) else (at,) for name, at in points.items()}
    for name, place in places.items():
        if len(place) > 2 or (len(place) == 2 and not place[0] < place[1]):
            raise invalid(f"points[{name!r}]", points[name], "a place in m, or the two ends of a span, ascending")
    return places


def _damping(given: Mapping[str, Any], rates: Floats) -> Floats:
    """Return the damping of each mode over its mass, in 1/s."""
    if given["rayleigh"] is None:
        ratios = numbers("damping_ratios", given["damping_ratios"], 1)
        if len(ratios) not in (1, len(rates)) or ratios.min() < 0.0:
            allowed = f"a number >= 0, or {len(rates)} of them, one per mode"
            raise invalid("damping_ratios", given["damping_ratios"], allowed)
        return np.broadcast_to(2.0 * ratios * rates, rates.shape)
    if np.any(given["damping_ratios"]):
        raise ValueError("give either `damping_ratios` or `rayleigh`, not both")
    pair = numbers("rayleigh", given["rayleigh"], 1)
    if len(pair) != 2 or pair.min() < 0.0:
        raise invalid("rayleigh", given["rayleigh"], "two numbers >= 0, a in 1/s and b in s of a M + b K")
    damping: Floats = pair[0] + pair[1] * rates**2
    return damping


def _check_moving(stops: Iterable[Stop], rows: Mapping[str, Floats]) -> None:
    """Raise if a stop acts on a point that a support holds."""
    for at, stop in enumerate(stops):
        for point in stop.direction if isinstance(stop.direction, Mapping) else ():
            if point in rows and not rows[point].any():
                where = f"`stops[{at}].direction` refers to point {point!r}"
                raise ValueError(f"{where}, which a rigid support holds; keep stops away from rigid supports")


def _no_points(name: str, value: Any, points: Any) -> Any:
    raise ValueError(f"`{name}` refers to points, but none are named; give `points`, as in points={{'tip': 0.7}}")
