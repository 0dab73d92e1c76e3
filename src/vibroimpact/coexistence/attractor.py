"""Attractors: the properties of each, also as a labelled dataset, and the initial conditions that lead to it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from vibroimpact.backends import ImpactWindow, StroboscopicWindow
from vibroimpact.backends.base import Counts
from vibroimpact.coexistence.measuring import QUIET
from vibroimpact.coexistence.settling import Settled
from vibroimpact.coexistence.striking import SAME, SettledMotion, sampled, striking
from vibroimpact.dataset import dataset_of, flags, impact_speed, plain_variable, provenance, status_variable, variable
from vibroimpact.model import Model, State
from vibroimpact.motion import Motion, MotionClass
from vibroimpact.orbits import Orbit, find_orbit, same_orbit
from vibroimpact.orbits.orbit import family_of
from vibroimpact.orbits.results import rows_of
from vibroimpact.orbits.systems.response import steady_motion
from vibroimpact.showing import Shown, Table
from vibroimpact.status import Status

if TYPE_CHECKING:
    import xarray as xr

STEADY = 1000  # driving periods after which a motion in permanent contact is steady
DIM = "attractor_id"
STATISTICS = ("std", "mean_velocity", "max_velocity", "lyapunov", "n_periods", "n_impacts", "dissipation")


@dataclass(frozen=True, repr=False)
class Attractor(Shown):
    """A settled motion, and the share of initial conditions that lead to it.

    Parameters
    ----------
    kind : str
        "periodic", "sticking", "chaotic" (watched for 1e5 impacts, see `attractors`), "no_impact" (the mass settles
        clear of the stop), "stuck_forever" (the force never lifts it off the stop) or "at_rest" (nothing drives it).
    n_periods, n_impacts, velocities, phases
        As in `Motion`; `n_periods` is also 0 for intermittent sticking: the mass rests again and again over 1e5
        impacts, at times that double precision does not resolve.
    std, mean_velocity, max_velocity : float
        Statistics of the impact velocities, in m/s, over exactly one cycle or, for chaos, over a long sample.
    lyapunov : float
        Largest Lyapunov exponent in 1/s; -inf for an orbit that sticks.
    dissipation : float
        Energy lost at the stop per driving period, in J.
    status : Status
        How the motion ended that represents the others.
    share : float
        Share of the initial conditions that lead here; the total includes undecided ones.
    start : State
        A state on the attractor: at its hardest impact, at its release from the stop, or at rest.
    transient_impacts : int
        The largest number of impacts, over the initial conditions, before it was certain that they lead here.
    transient_velocity : float
        The hardest impact in m/s, before the motion repeats, from initial conditions that do not repeat within 500
        impacts; 0 if there are none.
    stops : tuple of str
        For systems: the stop of each impact of the cycle.
    model : ImpactOscillator, ImpactSystem or family, optional
        The model that has this attractor.
    known_orbit : Orbit, optional
        Its orbit, where that is known already; see `orbit`.

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
    std: float = math.nan
    mean_velocity: float = math.nan
    max_velocity: float = math.nan
    lyapunov: float = math.nan
    dissipation: float = math.nan
    status: Status = Status.OK
    share: float = math.nan
    start: State = field(default_factory=lambda: State(0.0))
    transient_impacts: int = 0
    transient_velocity: float = 0.0
    stops: tuple[str, ...] = ()
    model: Model | None = field(default=None, repr=False, compare=False)
    known_orbit: Orbit | None = field(default=None, repr=False, compare=False)

    @property
    def motion(self) -> Motion:
        """The motion as `recognise` would call it."""
        return Motion(self.kind, self.n_periods, self.n_impacts, self.velocities, self.phases, self.status)

    @property
    def name(self) -> str:
        """The motion in two or three words."""
        return self.motion.name

    @cached_property
    def orbit(self) -> Orbit | None:
        """The periodic orbit that it is: the cycle solved for, with multipliers; None where `n_periods` is 0.

        None also for a cycle of more than 1000 impacts, or one at a graze, where the equations do not determine it. It
        is solved for when it is first used; `find_orbit(model, near=attractor)` says why there is none.

        Examples
        --------
        >>> import vibroimpact as vi
        >>> (attractor,) = vi.attractors(vi.ImpactOscillator(omega=2.0))
        >>> attractor.orbit.name, round(attractor.orbit.spectral_radius, 6)
        ('period-1 impact-1', 0.787766)
        """
        if self.model is None or not self.n_periods:
            return None
        found = [self.known_orbit] if self.known_orbit else find_orbit(self.model, near=self.start)
        same = (
            orbit for orbit in found if orbit.stable and orbit.n_periods == self.n_periods and _hits_as(orbit, self)
        )
        return next((replace(orbit, family=family_of(self.model, self.model.at())) for orbit in same), None)

    def _table(self) -> Table:
        facts = {
            "share of the initial conditions [%]": 100.0 * self.share,
            "hardest impact [m/s]": self.max_velocity,
            "mean impact velocity [m/s]": self.mean_velocity,
            "Std of the impact velocities [m/s]": self.std,
            "largest Lyapunov exponent [1/s]": self.lyapunov,
            "energy lost per driving period [J]": self.dissipation,
        }
        return Table(self.name, ("", ""), [fact for fact in facts.items() if not math.isnan(fact[1])])


def _hits_as(orbit: Orbit, attractor: Attractor) -> bool:
    """Return whether an orbit is an attractor's cycle; of a chatter, whose weakest impacts count, by its hardest."""
    if orbit.sticks:
        return math.isclose(max(orbit.velocities, default=0.0), attractor.max_velocity, rel_tol=SAME)
    return same_orbit(orbit, attractor, tolerance=SAME)


def distinct(names: Sequence[str]) -> list[str]:
    """Return names, followed by a letter where several are the same."""
    return [
        f"{name} {_letters(names[:at].count(name))}" if names.count(name) > 1 else name for at, name in enumerate(names)
    ]


def _letters(number: int) -> str:
    """Return a, b, ..., z, ba, bb, ..."""
    rest, digit = divmod(number, 26)
    return (_letters(rest) if rest else "") + chr(ord("a") + digit)


def attractor_of(settled: Settled, at: int, motion: SettledMotion) -> Attractor:
    """Return the attractor that initial condition number `at` leads to, from its settled motion."""
    one, speeds, n = settled[at], motion.velocities, motion.n_periods
    names = () if settled.osc.forgets else tuple(settled.osc.stop_names[stop] for stop in motion.stops)
    return Attractor(
        kind=one.kind,
        n_periods=n,
        n_impacts=len(speeds) if one.n_impacts > 0 else one.n_impacts,
        velocities=tuple(speeds.tolist()) if n else (),
        phases=tuple(motion.phases.tolist()) if n else (),
        std=float(speeds.std()),
        mean_velocity=float(speeds.mean()),
        max_velocity=float(speeds.max()),
        lyapunov=motion.exponent,
        dissipation=motion.loss,
        status=one.status,
        start=motion.start,
        stops=names if n else (),
        model=settled.settling.model,
        known_orbit=motion.orbit,
    )


def quiet_attractor(settled: Settled, at: int) -> Attractor:
    """Return an attractor without impacts: the steady motion without a stop, or rest."""
    osc, one = settled.osc, settled[at]
    stays = one.status == Status.STUCK_FOREVER or not osc.modal().squares.all()  # at rest at a stop, or adrift
    if osc.forgets:
        start = State(osc.gap) if stays else osc.steady_state
    else:
        steady = None if stays else steady_motion(osc)
        start = resting(settled, at) if steady is None else steady.start
    return Attractor(kind=one.kind, status=one.status, start=start, model=settled.settling.model)


def resting(settled: Settled, at: int) -> State:
    """Return the final state of a motion that ends without impacts.

    In permanent contact the other coordinates may still move; they are followed until their motion is steady.
    """
    twice = 2 * int(settled.indices["impacts"][at]) + 1  # as long as it took to know: weak impacts may last for ever
    system, samples = settled.osc, sampled(settled, at, ImpactWindow(0, twice))
    if samples.status == Status.STUCK_FOREVER and system.modal().squares.all():
        last = int(samples.impact_periods[-1]) if len(samples.impact_periods) else 0
        samples = sampled(settled, at, StroboscopicWindow(last + STEADY, 1))
    return samples.last_state(system.period)


@dataclass(frozen=True)
class Basin:
    """An attractor and the initial conditions that lead to it."""

    attractor: Attractor
    members: Counts


def match(settled: Settled, counted: int) -> list[Basin]:
    """Return the attractors, the one with the largest share of the first `counted` initial conditions first."""
    quiet = [np.flatnonzero(settled.kind == kind) for kind in QUIET]
    basins = [
        *(Basin(attractor_of(settled, at, one), members) for at, one, members in striking(settled)),
        *(Basin(quiet_attractor(settled, int(members[0])), members) for members in quiet if members.size),
    ]
    basins = [replace(basin, attractor=_reached(basin, settled, counted)) for basin in basins]
    return sorted(basins, key=lambda b: (-b.attractor.share, b.attractor.name, -b.attractor.max_velocity))


def _reached(basin: Basin, settled: Settled, counted: int) -> Attractor:
    """Return the attractor with the share of initial conditions that lead to it, and the longest transient."""
    members = basin.members
    return replace(
        basin.attractor,
        share=int((members < counted).sum()) / counted,
        transient_impacts=int(settled.indices["impacts"][members].max()),
        transient_velocity=float(settled.passing[members].max()),
    )


def attractor_variables(attractors: Sequence[Attractor]) -> dict[str, xr.Variable]:
    """Return the properties of each attractor."""
    share = {"long_name": "share of the initial conditions", "units": "1", "symbol": "share"}
    return {
        DIM: plain_variable(DIM, np.arange(len(attractors), dtype=np.int16), {"long_name": "attractor"}),
        "share": plain_variable(DIM, np.array([each.share for each in attractors], float), share),
        **{
            name: variable(
                name,
                DIM,
                np.array([getattr(each, name) for each in attractors], np.int32 if name[:2] == "n_" else np.float64),
            )
            for name in STATISTICS
        },
    }


def attractors_dataset(attractors: Sequence[Attractor]) -> xr.Dataset:
    """Return the result of `attractors` as a dataset over `attractor_id` and `impact`, rows padded with NaN."""
    model, dims = attractors[0].model, (DIM, "impact")
    if model is None:
        raise ValueError("an attractor without a `model` cannot be saved; give one that `attractors` returned")
    longest = max(len(each.velocities) for each in attractors)
    kinds = [MotionClass[each.kind.upper()] for each in attractors]
    content = attractor_variables(attractors) | {
        "kind": flags(DIM, kinds, "kind of motion", [kind.word for kind in MotionClass]),
        "velocity": impact_speed(dims, rows_of([each.velocities for each in attractors], longest)),
        "phase": variable("phase", dims, rows_of([each.phases for each in attractors], longest)),
        "status": status_variable(DIM, [each.status for each in attractors]),
    }
    return dataset_of(content, attrs=provenance("attractors", model, {}))
