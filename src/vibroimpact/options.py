"""Sampling and numerical tolerances."""

from __future__ import annotations

from dataclasses import dataclass, fields

from vibroimpact.parameters import invalid, real_number, whole_number


@dataclass(frozen=True)
class Sampling:
    """The numbers of impacts or periods to skip as transient and to keep.

    Parameters
    ----------
    transient_impacts, sample_impacts : int, >= 0 and >= 1
        Impacts to skip and to keep on the impact surface; the paper uses 100 and 5000.
    transient_periods, sample_periods : int, >= 0 and >= 1
        Driving periods to skip and to keep on the stroboscopic section.
    """

    transient_impacts: int = 100
    sample_impacts: int = 5000
    transient_periods: int = 200
    sample_periods: int = 500

    def __post_init__(self) -> None:
        for field in fields(self):
            least = 1 if field.name.startswith("sample") else 0
            object.__setattr__(self, field.name, whole_number(field.name, getattr(self, field.name), least))


@dataclass(frozen=True)
class Tolerances:
    """Numerical tolerances, all relative, so that results do not depend on units.

    Parameters
    ----------
    chatter : float, 0 < chatter <= 1e-2
        Impacts slower than this times V = max(f, k |g|)/sqrt(k m) are neither recorded nor counted; if such an impact
        certainly completes its chatter, the rest of the chatter is added in closed form.
    flight_periods : float, >= 1
        A flight longer than this many times the longer of the driving and the natural period ends the cell with status
        `budget`.
    steps_per_impact : int, >= 1
        Certified steps allowed per impact, on average over a cell, at w = w_n; scaled up with stiffness, to 2^22 in
        all.
    """

    chatter: float = 1e-9
    flight_periods: float = 1000.0
    steps_per_impact: int = 1000

    @classmethod
    def of(cls, tolerances: Tolerances | None) -> Tolerances:
        """Return the given tolerances; None means the default ones."""
        if tolerances is not None and not isinstance(tolerances, cls):
            raise invalid("tolerances", tolerances, "Tolerances(...) or None")
        return tolerances or cls()

    def __post_init__(self) -> None:
        allowed = "above 0 and up to 0.01"
        chatter = real_number("chatter", self.chatter, allowed)
        if not 0.0 < chatter <= 1e-2:
            raise invalid("chatter", chatter, allowed, "1e-9 is usual")
        flight = real_number("flight_periods", self.flight_periods, "a number >= 1")
        if flight < 1.0:
            raise invalid("flight_periods", flight, "a number >= 1", "1000 is usual")
        object.__setattr__(self, "chatter", chatter)
        object.__setattr__(self, "flight_periods", flight)
        object.__setattr__(self, "steps_per_impact", whole_number("steps_per_impact", self.steps_per_impact, 1))
