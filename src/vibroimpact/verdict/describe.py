"""The motions of a design, the distance to other motions, and the changes that soften its impacts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from itertools import count
from typing import Any

from vibroimpact.coexistence.measuring import EQUAL, SPREAD, Runner, SpentError, warn_of_cost
from vibroimpact.indices import without_value
from vibroimpact.model import Model, check_model
from vibroimpact.model.units import check_units
from vibroimpact.motion import Motion
from vibroimpact.options import Tolerances
from vibroimpact.progress import Report, reporter
from vibroimpact.showing import Shown, Table, plain
from vibroimpact.verdict.advice import Advice, advise
from vibroimpact.verdict.boundaries import nearest_boundaries
from vibroimpact.verdict.branches import Branches
from vibroimpact.verdict.edges import Edge
from vibroimpact.verdict.present import Coexisting, coexisting_motions, present_motion, step_limit
from vibroimpact.verdict.ranges import check_parameters, check_within, range_of
from vibroimpact.verdict.text import verdict_facts, verdict_lines

BESIDE = 3  # parts of the work besides one per parameter


@dataclass(frozen=True, repr=False)
class Verdict(Shown):
    """The result of `describe`; `str()` gives it in words.

    Attributes
    ----------
    model : ImpactOscillator, ImpactSystem or family
        The design that was described, whose parameters were varied.
    oscillator : ImpactOscillator or ImpactSystem
        The oscillator or system at the values of the model.
    kind : str
        "periodic", "sticking", "chaotic", "quasi_periodic", "undecided", "no_impact", "stuck_forever", "at_rest",
        "decaying" or "budget".
    motion : Motion
        The motion from rest: its name, and speeds (m/s) and phases of one cycle, beginning with its hardest hit.
    orbit : Orbit or None
        The exact solution for this motion, with multipliers, if it is periodic or, for one mass, sticks.
    status : str
        How the sampled motion ended, as in `parameter_map`.
    indices : dict
        Every index of `parameter_map`, with its default sampling, or over the cycle if the motion reaches it later. If
        there is no value, it is NaN, or 0 for counts; `no_value` gives the reason if the model has none.
    power, rate : float
        Mean power lost at the stops in W, and impacts per second; defined also without a driving period.
    watched : int
        Impacts after which the motion was certain, or over which it did not repeat.
    transient : str
        The motion named by the first 5100 impacts, if that is another one.
    releases : dict
        If rounding decides the next rest: how many perturbed releases lead to the motion of each name.
    boundaries : tuple of Edge
        The nearest boundary below and above each parameter.
    attractors : tuple of Coexisting
        The motions that 256 spread initial conditions settle to; the motion from rest comes first.
    advice : tuple of Advice
        For each parameter, the smallest change that softens the impacts and the smallest that ends them; in the order
        of their sizes.
    complete : bool
        False if `progress` stopped the computation, or if more than 2^29 certified steps (2^27 for systems) would have
        been needed.
    cells, steps : int
        Number of motions computed, and of their certified steps.
    stops : tuple of str
        For systems: the stop of each impact of the motion.
    units : dict
        Units in which the text gives parameters, by name; the numbers in the fields are in the parameters' own units.
    """

    model: Model
    oscillator: Any
    kind: str
    motion: Motion
    orbit: Any
    status: str
    indices: dict[str, float]
    power: float = math.nan
    rate: float = math.nan
    watched: int = 0
    transient: str = ""
    releases: dict[str, int] = field(default_factory=dict)
    boundaries: tuple[Edge, ...] = ()
    attractors: tuple[Coexisting, ...] = ()
    advice: tuple[Advice, ...] = ()
    complete: bool = True
    cells: int = 0
    steps: int = 0
    stops: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def no_value(self) -> dict[str, str]:
        """Why the model has no value of an index, by the name of the index; empty if it has all of them."""
        return {name: reason for name in self.indices if (reason := without_value(name, self.oscillator))}

    @property
    def max_velocity(self) -> float:
        """The hardest hit of the motion from rest in m/s, over the cycle or the samples; 0 without impacts."""
        if self.kind in ("no_impact", "stuck_forever", "at_rest"):
            return 0.0
        return max(self.motion.velocities, default=self.indices["max_velocity"])

    @property
    def worst(self) -> Coexisting | None:
        """The motion with the hardest hits that initial conditions lead to; None if none of the motions hits."""
        hitting = (motion for motion in self.attractors if motion.reached and motion.max_velocity > 0.0)  # not NaN
        return max(hitting, key=lambda motion: motion.max_velocity, default=None)

    @property
    def harder(self) -> Coexisting | None:
        """The worst motion if it hits harder than that from rest, or the hits from rest are unknown; else None."""
        worst = self.worst
        softer = worst is None or worst.from_rest or worst.max_velocity <= (1.0 + EQUAL) * self.max_velocity
        return None if softer else worst

    @property
    def undecided(self) -> float:
        """The share of the initial conditions whose motions are undecided."""
        share = 1.0 - sum(motion.share for motion in self.attractors)
        return share if share >= EQUAL else 0.0

    def __str__(self) -> str:
        return "\n".join(verdict_lines(self))

    def _table(self) -> Table:
        facts = [(title, lines) for title, lines in verdict_facts(self) if lines]
        return Table(f"from rest {self.motion.name}", ("", ""), facts)

    def to_dict(self) -> dict[str, Any]:
        """Return plain dictionaries, lists, numbers and text, ready for JSON: NaN as None, infinity as "-inf"."""
        family = {} if self.model is self.oscillator else {"model": {"family": str(self.model), **self.model.values}}
        content: dict[str, Any] = {
            **family,
            self.oscillator.kind: self.oscillator.plain(),
            "kind": self.kind,
            "motion": asdict(self.motion) | {"name": self.motion.name},
            "multipliers": self.orbit and self.orbit.multipliers,
            "stops": self.stops,
            "status": self.status,
            "indices": self.indices,
            **({"no_value": reasons} if (reasons := self.no_value) else {}),
            "watched": self.watched,
            "transient": self.transient,
            "releases": self.releases,
            "power": self.power,
            "rate": self.rate,
            "boundaries": [asdict(edge) | {"accuracy": edge.accuracy} for edge in self.boundaries],
            "attractors": self.attractors,
            "advice": self.advice,
            "complete": self.complete,
        }
        return {name: plain(value) for name, value in content.items()}


def describe(
    osc: Model,
    *,
    parameters: Iterable[str] | None = None,
    within: float = 3.0,
    units: Mapping[str, str] | None = None,
    tolerances: Tolerances | None = None,
    workers: int | None = None,
    progress: bool | Report | None = None,
) -> Verdict:
    """Describe the motions of a design, the distance to other motions, and the changes that soften its impacts.

    Parameters
    ----------
    osc : ImpactOscillator, ImpactSystem or family
        The design.
    parameters : names, optional
        The parameters to vary in search of boundaries and advice; None means all (seven for an oscillator), and
        `frequency` may replace `omega`. The parameters of a family are those of its function.
    within : float, > 0
        The range of each parameter: from value / (1 + within) to value * (1 + within); 3 means from a quarter to four
        times the value. The gap is varied by `within` times the larger of |g| and f/k. For a parameter that is 0, the
        design gives a scale: the static deflection for a gap, a twentieth of critical damping for damping.
    units : mapping of str to str, optional
        Units in which the text gives parameters, such as {"gap": "mm", "frequency": "rpm"}, where `frequency` stands
        for `omega`; all others are given in their own units. The numbers in the fields are not converted. Needs pint.
    tolerances : Tolerances, optional
        Numerical tolerances.
    workers : int, optional
        Threads; None means one per core. The verdict does not depend on it.
    progress : bool or callable, optional
        None shows a temporary line on a terminal or in a notebook if it takes more than a second.
        True shows a bar; a callable gets (parts done, parts in all, None) and stops the computation by returning False:
        the verdict then holds what was found by then.

    Returns
    -------
    Verdict
        `str()` gives a short text; the fields and `to_dict()` are for programs.

    Raises
    ------
    ValueError
        `osc` is not a model, one of `parameters` or of `units` is not a parameter of the model, a unit has another
        dimension, or `within` is not a number > 0.

    Notes
    -----
    The motion described is that from rest. For a periodic motion, the orbit is continued until it folds, doubles or
    grazes; for a sticking motion, the end of the chatter is followed to the release; without impacts, R = g and f = -k
    g are solved. Such boundaries are exact to about 1e-12. Other boundaries are bisected between motions; the state is
    carried along, so that coexisting motions are not mistaken for changes. There, and with sticking, windows narrower
    than `spacing` may be missed: about 1 % near the present value and 6 % far from it. For a motion without impacts,
    `strikes`, `from_rest` and `from_some` of an edge give the values beyond which other motions hit.

    Advice lowers the hardest hit of all coexisting motions that initial conditions lead to by at least a fifth, ends
    all impacts, or ends chaos without harder hits. It is given only if nothing hits harder at the advised value: from
    rest, from 256 spread impacts, on the stable orbits of one impact, on the branches of the present orbits continued
    to that value, and after the change is made at 128 instants of each present cycle. Changes have two significant
    digits, relative to the value that they refer to. A verdict takes one to three seconds on two cores, rarely four,
    and seven for chaos with long flights; it computes 4,000 to 14,000 motions.

    For systems, a verdict contains what is defined for any number of coordinates and stops: the motion from rest, the
    impacts on each stop, the energy lost, multipliers or exponent, and the motions that the initial conditions of
    `attractors` lead to. For a periodic motion that does not rest at a stop, it also contains the nearest fold, period
    doubling, Neimark-Sacker point, pitchfork and graze along each parameter, followed in steps of 2 % of its range, or
    up to 8 % far from them. At a graze of a compliant stop, the motion gains or loses a contact and continues, smoothly
    if the stop has no damping. Advice is sought as for one mass, with the orbits of one impact on any stop and the
    spread impacts of `attractors`. This takes seconds per parameter, and a minute or so if the motion is chaotic.

    Examples
    --------
    >>> from vibroimpact import ImpactOscillator
    >>> verdict = describe(ImpactOscillator(omega=1.4), parameters=["omega"])
    >>> verdict.motion.name
    'period-1 impact-1'
    >>> down, up = verdict.boundaries
    >>> down.kind, round(down.value, 9), down.accuracy
    ('period_doubling', 1.258962235, 'exact')
    """
    check_model(osc)
    reach, shown = check_within(within), check_units(osc, units)
    ranges = [range_of(osc, name, reach) for name in check_parameters(osc, parameters)]
    runner = Runner("cpu", tolerances, workers)
    warn_of_cost(osc.at(), SPREAD, runner)
    parts = len(ranges) + BESIDE
    with reporter(progress, "parts") as report:
        done = count(1)

        def going() -> None:
            if report(next(done), parts, None) is False:
                raise SpentError

        present, branches = present_motion(osc, runner), Branches()
        surroundings: dict[str, Any] = {}
        runner.most, complete = runner.steps + step_limit(present.oscillator), False
        try:
            going()
            surroundings["attractors"] = motions = coexisting_motions(present, runner)
            going()
            surroundings["boundaries"] = nearest_boundaries(present, ranges, runner, branches, motions, going)
            surroundings["advice"] = advise(present, motions, ranges, runner, branches)
            complete = True
            going()
        except SpentError:
            pass  # the verdict holds what was found by then
    return Verdict(
        model=osc,
        oscillator=present.oscillator,
        kind=present.motion.kind,
        motion=present.motion,
        orbit=present.orbit,
        status=present.measured.status.word,
        indices=present.indices,
        power=present.per_second("dissipation"),
        rate=present.per_second("impacts_per_period"),
        watched=present.final.watched,
        transient=present.final.before.name if present.final.before else "",
        releases=present.final.ends,
        complete=complete,
        cells=runner.measured,
        steps=runner.steps,
        stops=present.attractor.stops if present.attractor else (),
        units=shown,
        **surroundings,
    )
