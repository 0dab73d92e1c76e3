"""What is told of one attractor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from vibroimpact.motion import Motion
from vibroimpact.oscillator import State
from vibroimpact.status import Status

_MOTIONS = {"chaotic": "aperiodic", "at_rest": "decaying"}  # what `Motion` calls those of another name


@dataclass(frozen=True)
class Attractor:
    """A motion that starts end in, and how many of them do.

    Parameters
    ----------
    kind : str
        "periodic", "sticking", "chaotic", "no_impact" (the mass settles clear of the stop), "stuck_forever" (the force
        never lets it go) or "at_rest" (nothing drives it).
    n_periods : int
        Driving periods in a cycle; 0 where there is none, also between rests so far apart that rounding decides.
    n_impacts : int
        Impacts in a cycle; -1 for a complete chatter, 0 where there is no cycle.
    velocities, phases : tuple of float
        Speeds just before contact in m/s and phases in [0, 1) of one cycle, from its hardest hit on in the order of
        time; of a complete chatter those above its cut. Empty where there is no cycle.
    std, mean_velocity, max_velocity : float
        Of the impact velocities, in m/s, over exactly one cycle, or over a long sample of chaos.
    lyapunov : float
        Largest Lyapunov exponent in 1/s; -inf for an orbit that sticks.
    dissipation : float
        Energy lost at the stop per driving period, in J.
    status : Status
        How the start that stands for the others ended.
    share : float
        Part of the starts that lead here; undecided starts count in the whole.
    start : State
        A state on the attractor: at its hardest hit, at its release from the stop, or where it rests.

    Notes
    -----
    Numbers that a motion without impacts does not have are NaN.

    Examples
    --------
    >>> Attractor("periodic", 2, 2, max_velocity=0.43).name
    'period-2 impact-2'
    >>> Attractor("no_impact").name
    'no impact'
    """

    kind: str
    n_periods: int = 0
    n_impacts: int = 0
    velocities: tuple[float, ...] = ()
    phases: tuple[float, ...] = ()
    std: float = float("nan")
    mean_velocity: float = float("nan")
    max_velocity: float = float("nan")
    lyapunov: float = float("nan")
    dissipation: float = float("nan")
    status: Status = Status.OK
    share: float = float("nan")
    start: State = field(default_factory=lambda: State(0.0))

    @property
    def motion(self) -> Motion:
        """The motion as `recognise` would call it."""
        kind = _MOTIONS.get(self.kind, self.kind)
        return Motion(kind, self.n_periods, self.n_impacts, self.velocities, self.phases)

    @property
    def name(self) -> str:
        """The motion in two or three words."""
        if self.kind in ("periodic", "sticking", "stuck_forever"):
            return self.motion.name
        return self.kind.replace("_", " ")


def distinct_names(found: Sequence[Attractor]) -> list[str]:
    """Return the attractors' names, with a letter behind those that several of them share.

    Examples
    --------
    >>> distinct_names([Attractor("chaotic"), Attractor("no_impact"), Attractor("chaotic")])
    ['chaotic a', 'no impact', 'chaotic b']
    """
    names = [attractor.name for attractor in found]
    return [
        f"{name} {_letters(names[:at].count(name))}" if names.count(name) > 1 else name for at, name in enumerate(names)
    ]


def _letters(number: int) -> str:
    """Return a, b, ..., z, ba, bb, ..."""
    rest, digit = divmod(number, 26)
    return (_letters(rest) if rest else "") + chr(ord("a") + digit)
