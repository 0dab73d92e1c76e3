"""Which motions coexist with the one from rest."""

from __future__ import annotations

from dataclasses import dataclass, replace

from vibroimpact.coexistence import Attractor, attractors
from vibroimpact.verdict.present import Present
from vibroimpact.verdict.readings import Laboratory

ALIKE = 1e-4  # cycles of one name whose hardest hits agree so well are one
QUIET = ("no_impact", "stuck_forever", "at_rest")


@dataclass(frozen=True)
class Coexisting:
    """A motion that some starts settle to.

    Parameters
    ----------
    name : str
        The motion in two or three words.
    share : float
        The part of the starts that settle to it; shares sum to less than 1 where some stay undecided.
    max_velocity : float
        Its hardest hit in m/s; 0 where it does not hit.
    dissipation : float
        Energy lost at the stop a driving period, in J.
    from_rest : bool
        Whether it is the motion that a start from rest settles to.
    """

    name: str
    share: float
    max_velocity: float
    dissipation: float
    from_rest: bool


def coexisting_motions(present: Present, laboratory: Laboratory) -> tuple[Coexisting, ...]:
    """Return the motions that `attractors` finds, that from rest first (with share 0 if no start led to it)."""
    found = attractors(present.oscillator, tolerances=laboratory.tolerances, workers=laboratory.workers)
    told = [_told(attractor) for attractor in found]
    same = next((i for i, attractor in enumerate(found) if _is(attractor, present)), None)
    if same is None:
        reading = present.reading
        first = Coexisting(reading.name, 0.0, reading.hardest, reading.loss, True)
    else:
        first = replace(told.pop(same), from_rest=True)
    return first, *told


def _told(attractor: Attractor) -> Coexisting:
    if attractor.kind in QUIET:
        return Coexisting(attractor.name, attractor.share, 0.0, 0.0, False)
    return Coexisting(attractor.name, attractor.share, attractor.max_velocity, attractor.dissipation, False)


def _is(attractor: Attractor, present: Present) -> bool:
    """Whether an attractor is the present motion; of those that stick or do not hit there is one of each kind."""
    reading = present.reading
    if attractor.kind == "periodic" and reading.kind == "periodic":
        hardest = max(present.motion.velocities, default=reading.hardest)
        named = (attractor.n_periods, attractor.n_impacts) == (reading.n_periods, reading.n_impacts)
        return named and abs(attractor.max_velocity - hardest) <= ALIKE * hardest
    if attractor.kind == "at_rest":
        return reading.kind in ("no_impact", "stuck_forever", "decaying")
    return attractor.kind == reading.kind
