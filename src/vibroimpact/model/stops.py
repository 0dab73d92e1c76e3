"""The stops of a system, and the checks of their numbers."""

from __future__ import annotations

import keyword
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.by_value import ByValue, written
from vibroimpact.contact import Law
from vibroimpact.matrices import ROUNDING, nearest, numbers
from vibroimpact.model.elements import NUMBERS, Element, element_of
from vibroimpact.model.force import by_order, check_length, turning_values, vector
from vibroimpact.parameters import SMALLEST, invalid, real_number, several

STOPS = 64  # at most: a set of stops is the bits of a number


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Stop(ByValue):
    r"""A rigid or compliant stop, fixed or moving, that limits a linear combination of the coordinates.

    .. math:: u = g + \sum_h \mathrm{Im}\left(d_h e^{i h \omega t}\right) - a \cdot q

    A rigid stop keeps u >= 0, and an impact turns its rate from -v to r v. A stop with a `stiffness` is compliant: it
    pushes back along -a with

    .. math:: F = \max(0,\ k d + c \dot d), \qquad d = -u > 0,

    from the time when u falls below zero until the force has fallen to zero. It never pulls: if c > 0, it separates
    before u returns to zero, and exerts no force until contact is made again.

    Parameters
    ----------
    direction : sequence of n float
        a, not zero: a . q = gap is contact. ``[0, 1]`` stops the second coordinate from above, ``[0, -1]`` from
        below, ``[1, -1]`` the first from overtaking the second.
    gap : float
        g in m; negative means preloaded.
    restitution : float, 0 to 1, or Law or function
        r of a rigid stop: the rate of the clearance after an impact over that before it; 0.8 by default. A law of
        `vibroimpact.contact`, or a Python function of the speed in m/s that numba can compile, gives r at each speed.
    stiffness : float, > 0
        k in N/m of a compliant stop; None makes a rigid stop.
    damping : float, >= 0
        c in N s/m of a compliant stop; zero by default.
    name : str, optional
        The prefix of its parameters, as in ``bar_gap``; ``stop_1``, ``stop_2``, ... by default.
    motion : mapping of int to complex, optional
        d_h in m by the order h >= 1 of the force's frequency: a real number is a sine, an imaginary one a cosine.
        A positive one moves the stop in the direction of a.
    group : str, optional
        The support that it is a part of; stops of one group are reported together.
    angle : float, optional
        For facets of a round obstacle (`round_obstacle`): where on the circle it stands, in degrees. Tables of impacts
        list it.

    Raises
    ------
    ValueError
        The direction is zero, the name or the group is not a word, or a number is out of range; a compliant stop has a
        restitution, or a rigid one has damping.

    Notes
    -----
    With one coordinate, the direction may be a number. In a system with named points it may be a mapping from names of
    points to factors of their displacements.

    Examples
    --------
    >>> Stop(direction=[0, -1], gap=2e-4, restitution=0.7, name="baffle")
    Stop(direction=[0.0, -1.0], gap=0.0002, restitution=0.7, name='baffle')
    >>> Stop(direction=1.0, gap=2e-4, stiffness=2e6, damping=40.0).compliant
    True
    >>> from vibroimpact.contact import hunt_crossley
    >>> Stop(direction=1.0, gap=2e-4, restitution=hunt_crossley(damping=0.2)).kinds
    ('gap',)
    """

    direction: Any
    gap: float
    restitution: float | Law | None
    stiffness: float | None
    damping: float | None
    name: str | None
    motion: Mapping[int, complex]
    group: str | None
    angle: float | None
    element: Element  # the contact law and its numbers

    def __init__(
        self,
        *,
        direction: Any,
        gap: float,
        restitution: float | Law | Callable[[float], float] | None = None,
        stiffness: float | None = None,
        damping: float | None = None,
        name: str | None = None,
        motion: Mapping[int, complex] | None = None,
        group: str | None = None,
        angle: float | None = None,
    ) -> None:
        for argument, word in (("name", name), ("group", group)):
            if word is not None and not (isinstance(word, str) and word.isidentifier() and not keyword.iskeyword(word)):
                raise invalid(argument, word, "a word of letters, digits and underscores", f"as in {argument}='bar'")
        form = vector("direction", direction)
        entries = form.tolist() if isinstance(form, np.ndarray) else form.values()
        if not max(map(abs, entries)) >= SMALLEST:
            of = f" of stop {name!r}" if name else ""
            raise ValueError(f"`direction`{of} must not be zero, got {written(form)}; a . q = gap is contact")
        contact = {"restitution": restitution, "stiffness": stiffness, "damping": damping}
        element = element_of(contact)
        waves = {
            order: complex(numbers(f"motion[{order}]", value, 0, np.complex128).item())
            for order, value in by_order("motion", motion).items()
        }
        vars(self).update(
            direction=form,
            gap=NUMBERS["gap"].check(gap),
            name=name,
            motion=MappingProxyType(waves),
            group=group,
            angle=None if angle is None else real_number("angle", angle),
            element=element,
            **dict.fromkeys(contact) | vars(element),
        )

    def arguments(self) -> dict[str, Any]:
        """Return the arguments of the constructor by name."""
        return {
            "direction": self.direction,
            "gap": self.gap,
            **vars(self.element),
            "name": self.name,
            "motion": dict(self.motion),
            **{name: value for name in ("group", "angle") if (value := getattr(self, name)) is not None},
        }

    @property
    def compliant(self) -> bool:
        """Whether contacts last a finite time, with a finite force."""
        return not self.element.instantaneous

    @property
    def reach(self) -> float:
        """An upper bound of the size of a . q in contact, in m."""
        return float(abs(self.gap) + sum(map(abs, self.motion.values())))

    @property
    def kinds(self) -> tuple[str, ...]:
        """The names of its numbers that are parameters of a system."""
        return ("gap", *self.element.parameters)

    @property
    def law(self) -> Law | None:
        """The law of restitution of a rigid stop; None if it is a number."""
        return self.element.law

    @property
    def ratio(self) -> float | None:
        """The restitution of a rigid stop if it is the same at all speeds."""
        return self.element.ratio

    def rebound(self, v: Any) -> Any:
        """Return r of impacts at speeds v in m/s; for a compliant stop -1, which changes nothing."""
        return self.element.rebound(v)

    def shift(self, angle: Any) -> Any:
        """Return the displacement of the stop along its direction, in m, at driving angles w t."""
        turn = 1j * np.asarray(angle, np.float64)
        return sum((by * np.exp(order * turn)).imag for order, by in self.motion.items())

    def speed(self, angle: Any, omega: float) -> Any:
        """Return the rate of that displacement in m/s, at driving angles w t."""
        turn = 1j * np.asarray(angle, np.float64)
        return sum((1j * order * omega * by * np.exp(order * turn)).imag for order, by in self.motion.items())

    def acceleration(self, angle: Any, omega: float) -> Any:
        """Return the rate of that speed in m/s^2, at driving angles w t."""
        turn = 1j * np.asarray(angle, np.float64)
        return sum(((1j * order * omega) ** 2 * by * np.exp(order * turn)).imag for order, by in self.motion.items())

    def called(self, name: str) -> Stop:
        """Return a copy with that name; fast, since families make thousands of stops."""
        renamed = object.__new__(Stop)
        vars(renamed).update(vars(self), name=name)
        return renamed

    def at(self, values: Mapping[str, float]) -> Stop:
        """Return the stop with new numbers, taken from values of its system's parameters."""
        changes = {kind: values[name] for kind in self.kinds if (name := f"{self.name}_{kind}") in values}
        return self.replace(**changes) if changes else self

    def replace(self, **changes: Any) -> Stop:
        """Return a copy with some arguments changed; to change the kind, give all arguments of the new one."""
        return Stop(**{**self.arguments(), **changes})


def several_stops(stops: Any) -> tuple[Stop, ...]:
    """Return a list of stops as a tuple, after checking it."""
    checked = several("stops", stops, "a list of Stops")
    for at, stop in enumerate(checked):
        if not isinstance(stop, Stop):
            raise invalid(f"stops[{at}]", stop, "a Stop", "write Stop(direction=[...], gap=...)")
    if len(checked) > STOPS:
        raise ValueError(f"`stops` must have at most {STOPS} entries, got {len(checked)}")
    return checked


def named_stops(stops: Any, n: int) -> tuple[Stop, ...]:
    """Return stops with names, after checking their directions; those without a name are named by position."""
    named = tuple(stop if stop.name else stop.called(f"stop_{at}") for at, stop in enumerate(several_stops(stops), 1))
    names = [stop.name for stop in named]
    for at, (stop, name) in enumerate(zip(named, map(str, names), strict=True)):
        check_length(f"stops[{at}].direction", stop.direction, n)
        other, _, kind = name.rpartition("_")
        reserved = name in ("omega", "frequency") or (other in names and kind in NUMBERS)
        if reserved or names.count(name) > 1:
            owner = "a parameter" if reserved else "another stop"
            raise ValueError(f"`stops[{at}].name` {name!r} is also the name of {owner}; give each stop its own name")
    _check_groups([stop for stop in named if stop.group], names)
    _check_places(named)
    return named


def _check_groups(stops: Sequence[Stop], names: Sequence[str | None]) -> None:
    """Raise if a group is a single stop, or has the name of a stop outside it."""
    for stop in stops:
        members = [other.name for other in stops if other.group == stop.group]
        if len(members) < 2:
            raise ValueError(
                f"`group` {stop.group!r} has only one stop, {stop.name!r}; give all sides of a support the same group, "
                "or leave it out"
            )
        if stop.group in names and stop.group not in members:
            raise ValueError(f"`group` {stop.group!r} is also the name of a stop outside it; choose another name")


def _check_places(stops: Sequence[Stop]) -> None:
    """Raise if a rigid stop is there twice: which of the two is struck is undefined."""
    places: dict[Any, str | None] = {}
    for stop in stops:
        if stop.element.impenetrable:
            place = (*stop.direction.tolist(), stop.gap, *stop.motion.items())
            if place in places:
                raise ValueError(
                    f"`stops` {places[place]!r} and {stop.name!r} are at the same place, with the same direction and "
                    "gap; leave one of them out"
                )
            places[place] = stop.name


def check_room(stops: Sequence[Stop], mass: Any) -> None:
    """Raise if stops that face each other overlap at any time, or if there is no time at which all leave room."""
    bars = [stop for stop in stops if stop.element.impenetrable]
    for one, other in combinations(bars, 2):
        ratio = np.abs(one.direction).max() / np.abs(other.direction).max()
        if (np.abs(one.direction + ratio * other.direction) > 1e-12 * np.abs(one.direction)).any():
            continue
        orders = {*one.motion, *other.motion}
        parting = {h: one.motion.get(h, 0.0) + ratio * other.motion.get(h, 0.0) for h in orders}
        shift, phase = _least_shift(parting)
        room = one.gap + ratio * other.gap + shift
        if room < -ROUNDING * (one.reach + ratio * other.reach):
            when = f" at phase {phase:.4g}" if shift else ""
            raise ValueError(
                f"`stops` {one.name!r} and {other.name!r} overlap by {-room:.6g} m{when}: they face each other, and no "
                f"position is in front of both; the sum of their gaps must be >= {abs(shift):.6g}"
            )
    if all(stop.gap >= 0.0 for stop in bars):
        return  # then q = 0 is in front of all stops when they are farthest away
    most_open = np.array([stop.gap + sum(map(abs, stop.motion.values())) for stop in bars])
    if nearest(mass, np.array([stop.direction for stop in bars]).reshape(-1, len(mass)), most_open) is None:
        names = ", ".join(str(stop.name) for stop in stops)
        raise ValueError(f"`stops` {names} overlap: no position is in front of all of them")


def _least_shift(motion: Mapping[int, complex]) -> tuple[float, float]:
    """Return the least of the sum of Im d_h exp(i h w t), and its phase: one of the zeros of the rate of change."""
    orders, sizes = np.array(list(motion), np.float64), np.array(list(motion.values()), np.complex128)
    angles, shifts = turning_values(orders, sizes)
    at = int(np.argmin(shifts))
    return float(shifts[at]), float(angles[at] / (2.0 * np.pi))


def check_moves(stops: Sequence[Stop], omega: float | None) -> None:
    """Raise if a stop moves, and no frequency says how fast."""
    moving = [stop.name for stop in stops if stop.motion]
    if moving and omega is None:
        raise ValueError(
            f"`force` must have a frequency, since {moving[0]!r} moves at its harmonics; "
            "write force=Force(frequency=...), which may have no load"
        )


def warn_of_short_contacts(stops: Sequence[Stop], mass: NDArray[np.float64], period: float) -> None:
    """Warn of contacts so short that only their restitution matters."""
    for stop in stops:
        if not stop.element.instantaneous:
            struck = 1.0 / (stop.direction @ np.linalg.solve(mass, stop.direction))
            if words := stop.element.too_short(struck, period):
                warnings.warn(f"a contact with {stop.name!r} {words}", stacklevel=4)


def check_in_front(stops: Sequence[Stop], beyond: Any, most: Any, what: str, time: float) -> None:
    """Raise if a place is beyond rigid stops by more than so much; `what` begins the message."""
    places = [
        f"{stop.name!r} by {depth:.3g} m"
        for stop, depth, least in zip(stops, beyond, most, strict=True)
        if stop.element.impenetrable and depth > least
    ]
    if places:
        raise ValueError(f"{what} beyond {' and '.join(places)} at time {time:g}; start in front of them")
