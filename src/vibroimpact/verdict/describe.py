"""What an oscillator does, how safely, and what would calm it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

from vibroimpact.motion import Motion
from vibroimpact.options import Tolerances
from vibroimpact.orbits import Orbit
from vibroimpact.oscillator import ImpactOscillator
from vibroimpact.progress import Report, reporter
from vibroimpact.verdict.advice import Advice, advise
from vibroimpact.verdict.distances import nearest_boundaries
from vibroimpact.verdict.edges import Edge
from vibroimpact.verdict.others import Coexisting, coexisting_motions
from vibroimpact.verdict.present import Present, present_motion
from vibroimpact.verdict.reach import check_parameters, check_within, reach_of
from vibroimpact.verdict.readings import Laboratory
from vibroimpact.verdict.words import lines

BESIDE = 3  # parts of the work besides one a parameter


@dataclass(frozen=True)
class Verdict:
    """What `describe` found; `str()` tells it in words.

    Attributes
    ----------
    oscillator : ImpactOscillator
        Whose verdict it is.
    kind : str
        "periodic", "sticking", "chaotic", "undecided", "no_impact", "stuck_forever", "decaying" or "budget".
    motion : Motion
        The motion from rest: its name, and speeds (m/s) and phases of one cycle, from its hardest hit on.
    orbit : Orbit or None
        The same solved exactly, with multipliers, where it is periodic or sticks.
    status : str
        How the sampled motion ended, as `parameter_map` tells it.
    indices : dict
        Every index of `parameter_map`, with its default sampling; NaN where there is no value.
    boundaries : tuple of Edge
        The nearest boundary down and up each parameter.
    attractors : tuple of Coexisting
        The motions that a grid of starts settles to, that from rest first.
    advice : tuple of Advice
        For each parameter the smallest change that calms the motion, the smallest of all first.
    complete : bool
        False where `progress` asked to stop before the end.
    cells : int
        Motions computed for it.
    """

    oscillator: ImpactOscillator
    kind: str
    motion: Motion
    orbit: Orbit | None
    status: str
    indices: dict[str, float]
    boundaries: tuple[Edge, ...] = ()
    attractors: tuple[Coexisting, ...] = ()
    advice: tuple[Advice, ...] = ()
    complete: bool = True
    cells: int = 0

    @property
    def power(self) -> float:
        """Mean power lost at the stop, in W."""
        return self.indices["dissipation"] / self.oscillator.period

    @property
    def max_velocity(self) -> float:
        """The hardest hit in m/s: that of the cycle, or the largest sampled; 0 where it does not hit."""
        if self.kind in ("no_impact", "stuck_forever"):
            return 0.0
        return max(self.motion.velocities, default=self.indices["max_velocity"])

    def __str__(self) -> str:
        return "\n".join(lines(self))

    def to_dict(self) -> dict[str, Any]:
        """Return plain dictionaries, lists, numbers and text, ready for JSON: NaN as None, infinity as "-inf"."""
        content = {
            "oscillator": asdict(self.oscillator),
            "kind": self.kind,
            "motion": asdict(self.motion) | {"name": self.motion.name},
            "multipliers": [[z.real, z.imag] for z in self.orbit.multipliers] if self.orbit else None,
            "status": self.status,
            "indices": self.indices,
            "power": self.power,
            "boundaries": [asdict(edge) | {"accuracy": edge.accuracy} for edge in self.boundaries],
            "attractors": [asdict(motion) for motion in self.attractors],
            "advice": [asdict(advice) for advice in self.advice],
            "complete": self.complete,
        }
        plain = _plain(content)
        assert isinstance(plain, dict)
        return plain


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else "inf" if value > 0.0 else "-inf"
    return value


def describe(
    osc: ImpactOscillator,
    *,
    parameters: Iterable[str] | None = None,
    within: float = 3.0,
    tolerances: Tolerances | None = None,
    workers: int | None = None,
    progress: bool | Report = False,
) -> Verdict:
    """Tell in words what an oscillator does, how far it is from doing something else, and what would calm it.

    Parameters
    ----------
    osc : ImpactOscillator
        The seven numbers.
    parameters : names, optional
        Which parameters to vary in search of boundaries and advice; None is all seven, `frequency` may stand for
        `omega`.
    within : float, > 0
        How far each is varied: from value / (1 + within) to value * (1 + within), where 3 is a quarter to fourfold; the
        gap by `within` times the larger of |g| and f/k.
    tolerances : Tolerances, optional
        How small is small.
    workers : int, optional
        Threads; None is one a core. The verdict does not depend on it.
    progress : bool or callable
        True shows a bar; a callable gets (parts done, parts in all, None) and stops by returning False: the verdict
        then tells what was found until then.

    Returns
    -------
    Verdict
        `str()` of it is a short text; its fields and `to_dict()` are for programs.

    Raises
    ------
    ValueError
        An argument is out of its range.

    Notes
    -----
    The motion told is that from rest. The orbit of a periodic motion is continued until it folds, doubles or grazes;
    of a sticking one the end of the chatter is followed to the release; without impacts R = g and f = -k g are solved:
    such boundaries are exact to about 1e-12. Others are bisected between motions, the state being carried along so
    that coexisting motions are not mistaken for changes; there, and with sticking, windows narrower than about a per
    cent near by and 6 % far off may be stepped over. "Gentler" is no impact, no chaos, or a hardest hit at least a
    fifth softer, both from rest and from the present motion. About a second on two cores, 500 to 1,000 motions.

    Examples
    --------
    >>> verdict = describe(ImpactOscillator(omega=1.4), parameters=["omega"])
    >>> verdict.motion.name
    'period-1 impact-1'
    >>> down, up = verdict.boundaries
    >>> down.kind, round(down.value, 9), down.accuracy
    ('period_doubling', 1.258962235, 'exact')
    """
    names = check_parameters(parameters)
    reaches = [reach_of(_checked(osc), name, check_within(within)) for name in names]
    laboratory = Laboratory(tolerances or Tolerances(), workers)
    parts = len(reaches) + BESIDE
    with reporter(progress, "parts") as report:
        done = 0

        def going() -> bool:
            nonlocal done
            done += 1
            return report(done, parts, None) is not False

        present = present_motion(osc, laboratory)
        found: dict[str, Any] = {}
        if complete := going():
            found["boundaries"] = nearest_boundaries(present, reaches, laboratory, going)
            complete = len(found["boundaries"]) == 2 * len(reaches)
        if complete:
            found["attractors"] = coexisting_motions(present, laboratory)
            complete = going()
        if complete:
            found["advice"] = advise(present, reaches, laboratory)
            going()
    return _verdict(present, found, complete, laboratory.cells[0])


def _checked(osc: Any) -> ImpactOscillator:
    if not isinstance(osc, ImpactOscillator):
        raise ValueError(
            f"`osc` is {osc!r}; allowed is an ImpactOscillator; write ImpactOscillator(omega=2.0) for example"
        )
    return osc


def _verdict(present: Present, found: dict[str, Any], complete: bool, cells: int) -> Verdict:
    reading = present.reading
    return Verdict(
        oscillator=present.oscillator,
        kind=reading.kind,
        motion=present.motion,
        orbit=present.orbit,
        status=reading.status.word,
        indices=reading.indices,
        complete=complete,
        cells=cells,
        **found,
    )
