"""The nearest boundary of a motion along a parameter in one direction, as it is found and as callers receive it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from vibroimpact.coexistence.measuring import Start
from vibroimpact.verdict.ranges import Range

NOISE = 1e-12  # of a change: what is smaller is rounding
BOUNDARIES = {  # in words
    "period_doubling": "period doubling",
    "period_halving": "period halving",
    "fold": "fold",
    "grazing": "grazing",
    "end_of_sticking": "end of sticking",
    "first_contact": "the motion first touches the stop",
    "lift_off": "the force first lifts the mass off the stop",
    "pressed_for_ever": "the force no longer lifts the mass off the stop",
    "change": "another motion",
    "none": "none",
    "neimark_sacker": "Neimark-Sacker point",
    "pitchfork": "pitchfork",
    "impacts_merge": "two stops are struck at once",
}
ONSETS = {  # of others, beside a motion without impacts
    "from_some": "lasting impacts from some initial conditions",
    "strikes": "passing impacts from rest",
    "from_rest": "lasting impacts from rest",
}


@dataclass(frozen=True)
class Onset:
    """The value of a parameter beyond which initial conditions settle to impacts.

    Parameters
    ----------
    value : float
        The value; the present value if some initial conditions settle to impacts there already.
    change : float
        The change from the present value to it, as in an `Edge`.
    half_width : float
        `value` is known to within this; 0 if it is exact.
    spacing : float
        The widest step between the values examined on the way, in the unit of `change`; 0 if it is exact.
    start : Start
        An impact (clearance 0 in m, velocity in m/s, phase) after which the mass continues to hit just beyond; None if
        none is given.
    """

    value: float
    change: float
    half_width: float = 0.0
    spacing: float = 0.0
    start: Start | None = None


@dataclass(frozen=True)
class Edge:
    """The nearest boundary of a motion along one parameter, downwards or upwards.

    Parameters
    ----------
    parameter : str
        The parameter that is varied.
    direction : int
        -1 for smaller values, +1 for larger ones.
    kind : str
        "period_doubling", "period_halving" (the orbit ends where it was born, at a period doubling of another orbit),
        "fold", "grazing", "neimark_sacker", "pitchfork" and "impacts_merge" (systems only), "end_of_sticking",
        "first_contact" and "lift_off" (motions without impacts), "pressed_for_ever", "change" (to another class of
        motion, found by bisection), or "none" within the range.
    value : float
        The parameter at the boundary; NaN for "none".
    change : float
        The change from the present value to it, signed, relative to the present value, or to `of`.
    of : str
        What the change is relative to, if not the present value: "f/k" for a gap smaller than f/k, "the static
        deflection" for a system's gap of 0, "critical damping", or a number for a family's parameter at 0.
    half_width : float
        0 if `value` solves the equation of the boundary (to some 1e-11); otherwise, the boundary is within this of
        `value`.
    beyond : str
        The motion just beyond, found by following the motion across the boundary; empty if none was found.
    beyond_at : float
        The value at which that motion was computed; NaN if it was not.
    searched_to : float
        The end of the range, or the value up to which the motion could be followed; NaN if no boundary was sought
        because the motion is undecided.
    spacing : float
        The widest step between the values at which the motion was examined, in the unit of `change`: narrower windows
        of another motion may have been missed. 0 if the equation of the boundary was followed.
    strikes, from_rest, from_some : Onset or None
        For a motion without impacts: beyond which values the motion from rest strikes the stop at all, settles to
        impacts, and some initial condition settles to impacts. None if none was found, and for motions with impacts.
    """

    parameter: str
    direction: int
    kind: str
    value: float
    change: float
    of: str
    half_width: float = 0.0
    beyond: str = ""
    beyond_at: float = math.nan
    searched_to: float = math.nan
    spacing: float = 0.0
    strikes: Onset | None = None
    from_rest: Onset | None = None
    from_some: Onset | None = None

    @property
    def found(self) -> bool:
        """Whether there is a boundary."""
        return self.kind != "none"

    @property
    def not_sought(self) -> bool:
        """Whether nothing is known about where the boundary is."""
        return not self.found and math.isnan(self.searched_to)

    @property
    def exact(self) -> bool:
        """Whether the value solves the equation of the boundary."""
        return self.found and self.half_width == 0.0

    @property
    def what(self) -> str:
        """The boundary in words, or the motion beyond if only that is known."""
        return self.beyond if self.kind == "change" and self.beyond else BOUNDARIES[self.kind]

    @property
    def at_once(self) -> bool:
        """Whether the present value lies on the boundary, to within rounding."""
        return self.exact and abs(self.change) < NOISE

    @property
    def accuracy(self) -> str:
        """`exact`, `to within ...`, or nothing if no boundary was found."""
        return "" if not self.found else "exact" if self.exact else f"to within {self.half_width:.1g}"


@dataclass(frozen=True)
class Side:
    """A range in one direction, and the boundary of the motion there, before the motion beyond it is computed.

    `start` is the state to carry across; `reached` is the value up to which the motion could be followed, if not the
    end of the range. `beyond` is a motion already computed at `outside`, and `onsets` are those of the `Edge`.
    """

    range: Range
    direction: int
    kind: str = "none"
    value: float = math.nan
    half_width: float = 0.0
    start: Start | None = None
    spacing: float = 0.0
    reached: float | None = None
    beyond: str = ""
    outside: float = math.nan
    onsets: tuple[Onset | None, Onset | None, Onset | None] = (None, None, None)

    @property
    def end(self) -> float:
        """The end of the range."""
        return self.range.end(self.direction)

    @property
    def has_room(self) -> bool:
        """Whether the range extends in this direction."""
        return self.end != self.range.value

    @property
    def limit(self) -> float:
        """The value at which the motion ends, or the end of the range."""
        return self.end if self.kind == "none" else self.value

    def beyond_at(self) -> float:
        """Return a value a little beyond the boundary; NaN if the range ends first."""
        if self.kind == "none":
            return math.nan
        scale = self.range.scale
        ahead = min(0.02 * abs(self.value - self.range.value) + 1e-6 * scale, 4e-3 * scale) + 2.0 * self.half_width
        value = self.value + self.direction * ahead
        value = min(value, self.end) if self.direction > 0 else max(value, self.end)
        return value if (value - self.value) * self.direction > 0.0 else math.nan

    def onset(self, value: float, half_width: float = 0.0, spacing: float = 0.0, start: Start | None = None) -> Onset:
        """Return the onset of impacts of other motions at a value, as callers receive it."""
        return Onset(value, self.range.change(value), half_width, spacing, start)

    def edge(self, beyond: str = "", at: float = math.nan) -> Edge:
        """Return the boundary as callers receive it, with the motion beyond and the value at which it was computed."""
        strikes, from_rest, from_some = self.onsets
        return Edge(
            parameter=self.range.name,
            direction=self.direction,
            kind=self.kind,
            value=self.value,
            change=self.range.change(self.value),
            of=self.range.of,
            half_width=self.half_width,
            beyond=beyond,
            beyond_at=at,
            searched_to=self.end if self.reached is None else self.reached,
            spacing=self.spacing,
            strikes=strikes,
            from_rest=from_rest,
            from_some=from_some,
        )
