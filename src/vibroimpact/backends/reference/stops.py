"""The kinds of stops: what a contact does. No other module of the witness distinguishes them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Stop:
    """A stop of any kind: its clearance is u = gap + Im(sum_h motion_h exp(i h w t)) - direction . q.

    Parameters
    ----------
    direction : array, shape (n,)
        The linear form a of the coordinates.
    gap : float
        Clearance at q = 0, in m.
    motion : dict of int to complex
        Harmonics of the stop's own motion, in m.
    """

    direction: Floats
    gap: float
    motion: dict[int, complex] = field(default_factory=dict, kw_only=True)

    impenetrable: ClassVar[bool]  # whether u is never negative

    @property
    def slack(self) -> tuple[float, float]:
        """The coefficients k, c of the force -k u - c u' while it pushes; zero if contacts are impulses."""
        return 0.0, 0.0

    @property
    def ending(self) -> tuple[float, float]:
        """The coefficients p, q of -p u - q u', which ends a contact where it falls to zero: by default the force."""
        return self.slack

    def ratio(self, speed: float) -> Any:
        """Return the ratio r of the speeds after and before an impact, given that before it; zero without impulses."""
        return 0.0

    def sensitivity(self, speed: float) -> Any:
        """Return d(r v)/dv at the speed v before an impact."""
        return 0.0


@dataclass(frozen=True)
class RigidStop(Stop):
    """A rigid stop: u >= 0.

    Parameters
    ----------
    restitution : float, or function of float
        Ratio r of the speeds after and before an impact, 0 to 1, or a law, a function of the speed in m/s that returns
        it, with its derivative `slope`.
    """

    restitution: float | Callable[[float], float]
    impenetrable = True

    def ratio(self, speed: float) -> Any:
        """Return r."""
        return self.restitution(speed) if callable(self.restitution) else self.restitution

    def sensitivity(self, speed: float) -> Any:
        """Return r + v dr/dv."""
        law: Any = self.restitution
        return law(speed) + speed * law.slope(speed) if callable(law) else law


@dataclass(frozen=True)
class CompliantStop(Stop):
    """A compliant stop: after u falls through zero it pushes with F = max(0, -k u - c u') until F is zero.

    If c > 0 it separates before u returns to zero, and then exerts no force, unless k u + c u' falls through zero
    before u is positive, when it pushes again.

    Parameters
    ----------
    stiffness, damping : float
        k > 0 in N/m and c >= 0 in N s/m.
    """

    stiffness: float
    damping: float = 0.0
    impenetrable = False

    @property
    def slack(self) -> tuple[float, float]:
        """The stiffness and the damping."""
        return self.stiffness, self.damping


def stop_of(direction: Floats, gap: float, motion: dict[int, complex], numbers: Mapping[str, Any]) -> Stop:
    """Return a stop of the kind that its numbers make it: with a `stiffness` and `damping`, or with a `restitution`."""
    if numbers["stiffness"] > 0.0:
        return CompliantStop(direction, gap, numbers["stiffness"], numbers["damping"], motion=motion)
    return RigidStop(direction, gap, numbers["restitution"], motion=motion)
