"""The kinds of stops: their numbers, their contact laws, and the quantities that are reported for each contact.

Every stop has an element of one of these kinds. Outside the kernels and the back ends, only this module names them.
Other code asks an element for its traits.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import numpy as np

from vibroimpact.contact import LAWS, Law, law_of
from vibroimpact.parameters import CRITICAL, OF_ONE_MASS, Parameter, Scale, critical_damping, invalid

SHORTEST = 1e-9  # driving periods: a shorter contact is equivalent to an impact on a rigid stop

_STIFFNESS = replace(
    OF_ONE_MASS["stiffness"], hint="give the stiffness of a compliant stop in N/m; leave it out for a rigid stop"
)
# The numbers of stops that are parameters of systems.
NUMBERS: Mapping[str, Parameter] = MappingProxyType(
    {name: OF_ONE_MASS[name] for name in ("gap", "restitution")}
    | {"stiffness": _STIFFNESS, "damping": OF_ONE_MASS["damping"]}
)


class Block(NamedTuple):
    """The columns of a table of cells that hold one number of every stop, and their value for stops without it.

    Divided by the mass that hits the stop, such a number has the unit 1/s^`power`; engines need this because they
    measure time in steps.
    """

    name: str
    none: float = 0.0
    power: int = 0


# By the numbers' names; then the mark of a law, whose own number takes the place of a restitution.
BLOCKS: Mapping[str, Block] = MappingProxyType(
    {
        "gap": Block("gap"),
        "restitution": Block("restitution", 1.0),
        "stiffness": Block("spring", power=2),
        "damping": Block("dashpot", power=1),
        "law": Block("law"),
    }
)


class Report(NamedTuple):
    """The label of a quantity of a `Contact` that is reported; a time `since` the impact is listed as a time."""

    long_name: str
    unit: str
    symbol: str
    since: bool = False


REPORTS: Mapping[str, Report] = MappingProxyType(
    {
        "impulse": Report("impulse of the impact", "N s", "P"),
        "energy_lost": Report("energy lost at the stop by the impact", "J", "E"),
        "peak_force": Report("largest force of the contact", "N", "F"),
        "contact_time": Report("duration of the contact", "s", "t_c"),
        "penetration": Report("deepest penetration of the contact", "m", "d"),
        "exit_velocity": Report("speed of separation at the end of the contact", "m/s", "v"),
        "exit_time": Report("time of the end of the contact", "s", "t", True),
        "peak_force_time": Report("time of the largest force of the contact", "s", "t", True),
        "penetration_time": Report("time of the deepest penetration of the contact", "s", "t", True),
    }
)


class Contact(NamedTuple):
    """One impact: impulse (N s), contact time (s), peak force (N), penetration (m), loss (J), exit velocity (m/s).

    Then how long after the impact, in s, its force ends, and force and penetration are largest. Contact time, largest
    values and their times are NaN on rigid stops. The entries may be arrays, for several impacts.
    """

    impulse: Any
    contact_time: Any = math.nan
    peak_force: Any = math.nan
    penetration: Any = math.nan
    energy_lost: Any = math.nan
    exit_velocity: Any = math.nan
    exit_time: Any = math.nan
    peak_force_time: Any = math.nan
    penetration_time: Any = math.nan

    def joined(self, other: Contact) -> Contact:
        """Return the sum of this part of a contact and a later one."""
        if not other.contact_time:
            return self
        harder, deeper = other.peak_force > self.peak_force, other.penetration > self.penetration
        return Contact(
            self.impulse + other.impulse,
            self.contact_time + other.contact_time,
            other.peak_force if harder else self.peak_force,
            other.penetration if deeper else self.penetration,
            self.energy_lost + other.energy_lost,
            other.exit_velocity,
            other.exit_time,
            other.peak_force_time if harder else self.peak_force_time,
            other.penetration_time if deeper else self.penetration_time,
        )


NO_CONTACT = Contact(0.0, 0.0, 0.0, 0.0, 0.0)


class Element(ABC):
    """One kind of stop, with its numbers.

    Attributes
    ----------
    word : str
        The kind in words, for messages.
    holds : str
        The words before the name of a stop that holds a motion without impacts.
    takes : tuple of str
        The arguments of `Stop` that make it; if the first one is given, the stop is of this kind.
    instead : mapping of str to str
        What to do instead, for each argument that only another kind takes.
    reports : tuple of str
        The quantities that are reported for each contact.
    instantaneous : bool
        Whether a contact takes no time: the rate of the clearance jumps, and the force has no value.
    impenetrable : bool
        Whether the clearance is never negative.
    """

    word: ClassVar[str]
    holds: ClassVar[str]
    takes: ClassVar[tuple[str, ...]]
    instead: ClassVar[Mapping[str, str]]
    reports: ClassVar[tuple[str, ...]] = ("impulse", "energy_lost", "exit_velocity")
    instantaneous: ClassVar[bool]
    impenetrable: ClassVar[bool]

    @property
    def label(self) -> str:
        """The words before its name in legends; the usual kind is not named."""
        return "stop" if isinstance(self, KINDS[-1]) else f"{self.word} stop"

    @property
    def parameters(self) -> tuple[str, ...]:
        """The numbers that are parameters of a system."""
        return self.takes

    @property
    @abstractmethod
    def lossless(self) -> bool:
        """Whether contacts lose no energy."""

    @property
    def law(self) -> Law | None:
        """The law of restitution, if there is one."""
        return None

    @property
    def ratio(self) -> float | None:
        """The restitution, if it is the same at all speeds."""
        return None

    @property
    def coefficients(self) -> tuple[float, float]:
        """The k in N/m and c in N s/m of the force k d + c d' while it acts; zeros if contacts are impulses."""
        return 0.0, 0.0

    def row(self) -> dict[str, float]:
        """Return the numbers for the columns of `BLOCKS`."""
        return {name: getattr(self, name) for name in self.takes}

    @abstractmethod
    def rebound(self, v: Any) -> Any:
        """Return r = -(rate of the clearance just after contact begins) / (rate before), at speeds v in m/s."""

    @abstractmethod
    def sensitivity(self, v: Any) -> Any:
        """Return d(r v)/dv with that r: the change of the speed after an impact per change of the speed before it."""

    def acts_as(self, other: Element, ratio: float, within: float) -> bool:
        """Return whether another element acts the same along a direction that is shorter by that ratio."""
        return self == other

    @abstractmethod
    def force(self, depth: Any, rate: Any) -> Any:
        """Return the force in N at penetrations in m and their rates in m/s; NaN if the force has no value."""

    @abstractmethod
    def scales(self, mass: float, omega: float) -> dict[str, Scale]:
        """Return the scales of its numbers for the mass in kg that hits it and the angular driving frequency."""

    def too_short(self, mass: float, period: float) -> str:
        """Return the reason why a simpler stop is equivalent for a mass in kg and a period in s; "" if it is not."""
        return ""


@dataclass(frozen=True, init=False)
class Rigid(Element):
    """A rigid stop: an impact turns the rate of the clearance from -v to r v."""

    word, holds = "rigid", "at rest at"
    takes = ("restitution",)
    instead = MappingProxyType({"damping": "give a `stiffness` (N/m) for a compliant stop"})
    instantaneous = impenetrable = True

    restitution: float | Law

    def __init__(self, restitution: Any) -> None:
        ratio = 0.8 if restitution is None else restitution
        if type(ratio) is not float:  # a short way, since families have thousands of these
            ratio = law_of(ratio)
        vars(self)["restitution"] = ratio if isinstance(ratio, Law) else NUMBERS["restitution"].check(ratio)

    @property
    def law(self) -> Law | None:
        """The law of restitution; None if it is a number."""
        return self.restitution if isinstance(self.restitution, Law) else None

    @property
    def parameters(self) -> tuple[str, ...]:
        """The restitution, if it is a number."""
        return () if self.law else self.takes

    @property
    def lossless(self) -> bool:
        """Whether r is 1 at all speeds."""
        return self.ratio == 1.0

    @property
    def ratio(self) -> float | None:
        """The restitution, if it is the same at all speeds."""
        return self.restitution.constant if isinstance(self.restitution, Law) else self.restitution

    def row(self) -> dict[str, float]:
        """Return the restitution, or the number of a law and the mark by which kernels find the law."""
        if (ratio := self.ratio) is not None:
            return {"restitution": ratio}
        law: Any = self.restitution
        LAWS.setdefault(law.mark, law)
        return {"restitution": law.number, "law": law.mark}

    def rebound(self, v: Any) -> Any:
        """Return r at speeds v in m/s."""
        return self.law(v) if self.law else self.ratio

    def sensitivity(self, v: Any) -> Any:
        """Return r + v dr/dv at speeds v in m/s."""
        return self.law(v) + v * self.law.slope(v) if self.law else self.ratio

    def force(self, depth: Any, rate: Any) -> Any:
        """Return NaN: an impulse has no force."""
        return math.nan * depth

    def scales(self, mass: float, omega: float) -> dict[str, Scale]:
        """Return 1 for the restitution."""
        return {"restitution": Scale(1.0, "1")}


@dataclass(frozen=True, init=False)
class Compliant(Element):
    """A compliant stop: a spring and a damper push with max(0, k d + c d') at a penetration d > 0."""

    word, holds = "compliant", "pressed into"
    takes = ("stiffness", "damping")
    instead = MappingProxyType({"restitution": "give `damping` instead"})
    reports = tuple(REPORTS)
    instantaneous = impenetrable = False

    stiffness: float
    damping: float

    def __init__(self, stiffness: Any, damping: Any) -> None:
        vars(self)["stiffness"] = NUMBERS["stiffness"].check(stiffness)
        vars(self)["damping"] = NUMBERS["damping"].check(damping or 0.0)

    @property
    def lossless(self) -> bool:
        """Whether it has no damper."""
        return self.damping == 0.0

    @property
    def coefficients(self) -> tuple[float, float]:
        """The stiffness and the damping."""
        return self.stiffness, self.damping

    def rebound(self, v: Any) -> Any:
        """Return -1: the rate does not change."""
        return -1.0

    def sensitivity(self, v: Any) -> Any:
        """Return -1: nothing jumps."""
        return -1.0

    def acts_as(self, other: Element, ratio: float, within: float) -> bool:
        """Return whether k and c of another stop are the same, per length of its direction squared."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=False)
        return isinstance(other, Compliant) and all(abs(a * ratio**2 - b) <= within * b for a, b in pairs)

    def force(self, depth: Any, rate: Any) -> Any:
        """Return max(0, k d + c d'), or 0 if d <= 0."""
        return np.where(depth > 0.0, np.maximum(self.stiffness * depth + self.damping * rate, 0.0), 0.0)

    def scales(self, mass: float, omega: float) -> dict[str, Scale]:
        """Return m w^2 for the stiffness, and critical damping for the damping."""
        critical = critical_damping(self.stiffness, mass)
        return {"stiffness": Scale(mass * omega**2, "m w^2"), "damping": Scale(critical, CRITICAL)}

    def too_short(self, mass: float, period: float) -> str:
        """Return the equivalent restitution if contacts last less than 1e-9 driving periods."""
        if math.pi * math.sqrt(mass / self.stiffness) >= SHORTEST * period:
            return ""
        ratio = self.damping / critical_damping(self.stiffness, mass)
        return (
            f"takes less than {SHORTEST:g} driving periods; a rigid stop with the restitution of a damping ratio of "
            f"{ratio:.3g} gives the same result faster"
        )


KINDS: tuple[Any, ...] = (Compliant, Rigid)  # the last one is the default


def element_of(arguments: Mapping[str, Any]) -> Element:
    """Return the element for arguments of a stop; None means not given, and the default is used."""
    for kind in KINDS:
        if arguments[kind.takes[0]] is not None:
            break
    for name, value in arguments.items():
        if value is not None and name not in kind.takes:
            raise invalid(name, value, f"None for a {kind.word} stop", kind.instead[name])
    element: Element = kind(*[arguments[name] for name in kind.takes])
    return element


def reports_of(stops: Any) -> tuple[str, ...]:
    """Return the quantities that are reported for every contact, if stops are of these kinds."""
    return tuple(dict.fromkeys([*Element.reports, *(name for stop in stops for name in stop.element.reports)]))


def bars(blocks: Mapping[str, Any]) -> Any:
    """Return the mask of impenetrable stops in a table of cells, from its blocks by name."""
    return blocks["stiffness"] == 0.0
