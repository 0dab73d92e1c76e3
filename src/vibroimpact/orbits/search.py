"""Find periodic orbits by name."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from vibroimpact.orbits.building import ALIKE, distance, from_hardest, make_orbit, solution_of, true_name
from vibroimpact.orbits.closed_form import impact_1_orbits
from vibroimpact.orbits.equations import Cycle, Floats
from vibroimpact.orbits.newton import solve
from vibroimpact.orbits.orbit import Orbit
from vibroimpact.orbits.starts import candidates, cycle_of, followed
from vibroimpact.oscillator import ImpactOscillator, State
from vibroimpact.parameters import real_number, whole_number

Near = Orbit | State | tuple[float, float] | None


class Orbits(list[Orbit]):
    """The orbits of one name, stable ones first, with the outcome of the search.

    Attributes
    ----------
    outcome : str
        "found"; "inadmissible" (solutions, but the mass does not move along any); "none" (there is none, or no start
        led to one); "other_name" (the start led to an orbit with a smaller name); "not_converged"; "singular" (it
        led to a fold or a graze, where the equations do not fix an orbit).
    message : str
        The same in a sentence.
    """

    def __init__(self, orbits: Iterable[Orbit] = (), *, outcome: str = "found", message: str = "") -> None:
        super().__init__(orbits)
        self.outcome = outcome
        self.message = message


def find_orbit(osc: ImpactOscillator, *, n_periods: int = 1, n_impacts: int = 1, near: Near = None) -> Orbits:
    r"""Find the period-n impact-p orbits of an oscillator, stable or not.

    Impact times and velocities solve, flight by flight,

    .. math:: y_i(t_{i+1}) = g, \qquad \dot y_i(t_{i+1}) = v_{i+1}, \qquad t_{p+1} = t_1 + nT,

    where flight i leaves the stop at :math:`t_i` with :math:`-r v_i`.

    Parameters
    ----------
    osc : ImpactOscillator
        The seven numbers.
    n_periods : int, >= 1
        Driving periods in a cycle, n.
    n_impacts : int, >= 1 or -1
        Impacts in a cycle, p; -1 for an orbit with a complete chatter, which sticks.
    near : Orbit, State or (phase, velocity), optional
        Where to begin: an orbit of this or another oscillator, a state at the stop with velocity > 0 (m/s), or phase
        in [0, 1) and velocity of an impact. None: the attractor reached from rest, and a grid over the impact
        surface. One impact needs no start: all solutions are known in closed form.

    Returns
    -------
    Orbits
        A list of `Orbit`, stable ones first, each told from its hardest hit on; with `outcome` and `message`. With
        one impact, or with `near`, orbits that the mass cannot follow are among them, `admissible` False and saying
        why; without, only admissible ones are kept.

    Raises
    ------
    ValueError
        An argument is out of its range.

    Notes
    -----
    Derivatives are exact (complex step), so Newton's method ends at rounding: velocities and phases are right to
    about 1e-14 times the condition of the equations. An orbit is admissible if each flight's first certified
    contact is the orbit's next impact. With several impacts and without `near` nothing proves the list complete. One
    impact takes about a millisecond, several about a tenth of a second.

    References
    ----------
    .. [1] S. W. Shaw and P. J. Holmes, "A periodically forced piecewise linear oscillator", J. Sound Vib. 90 (1983)
       129-155: the closed form for one impact.

    Examples
    --------
    >>> (orbit,) = find_orbit(ImpactOscillator(omega=2.0))
    >>> orbit.name, orbit.stable, round(orbit.velocities[0], 6)
    ('period-1 impact-1', True, 6.226413)
    >>> find_orbit(ImpactOscillator(omega=2.0), n_periods=1, n_impacts=2).message
    'no start led to a period-1 impact-2 orbit'
    """
    cycle = _checked(osc, n_periods, n_impacts)
    begin = _start(osc, near, cycle)
    if cycle.n_impacts == -1:
        return _sticking(osc, cycle.n_periods)
    if cycle.n_impacts == 1:
        solutions, why = impact_1_orbits(osc, cycle.n_periods)
        return _sorted(osc, cycle, solutions) if solutions else Orbits(outcome="none", message=why)
    if osc.amplitude == 0.0:
        return Orbits(outcome="none", message=impact_1_orbits(osc, cycle.n_periods)[1])
    return _search(osc, cycle) if begin is None else _from(osc, cycle, begin)


def _checked(osc: Any, n_periods: Any, n_impacts: Any) -> Cycle:
    if not isinstance(osc, ImpactOscillator):
        raise ValueError(
            f"`osc` is {osc!r}; allowed is an ImpactOscillator; write ImpactOscillator(omega=2.0) for example"
        )
    n = whole_number("n_periods", n_periods, 1)
    p = whole_number("n_impacts", n_impacts, -1)
    if p == 0:
        raise ValueError("`n_impacts` is 0; allowed is a whole number >= 1, or -1 for a complete chatter; give one")
    return Cycle(n, p)


def _start(osc: ImpactOscillator, near: Any, cycle: Cycle) -> Orbit | tuple[float, float] | None:
    """Return an orbit of the same name, or phase and velocity of an impact, or None."""
    if near is None:
        return None
    if isinstance(near, Orbit):
        same = (near.n_periods, near.n_impacts) == (cycle.n_periods, cycle.n_impacts)
        if same or not near.velocities:
            return near if same else None
        return near.phases[0], near.velocities[0]
    if isinstance(near, State):
        if near.displacement != osc.gap:
            raise ValueError(
                f"`near` has displacement {near.displacement!r}; allowed is the gap, {osc.gap!r}; "
                "give a state at an impact"
            )
        return near.time / osc.period, _positive(near.velocity)
    if isinstance(near, (tuple, list)) and len(near) == 2:
        return real_number("near", near[0]), _positive(near[1])
    raise ValueError(
        f"`near` is {near!r}; allowed is an Orbit, a State at the stop, or (phase, velocity); "
        "give for example near=(0.25, 1.4)"
    )


def _positive(velocity: Any) -> float:
    value = real_number("near", velocity, "a velocity > 0 at an impact")
    if value <= 0.0:
        raise ValueError(f"`near` has velocity {velocity!r}; allowed is a number > 0; give the speed before an impact")
    return value


def _sticking(osc: ImpactOscillator, n_periods: int) -> Orbits:
    from vibroimpact.orbits.sticking import find_sticking_orbit

    found = find_sticking_orbit(osc, n_periods)
    if found:
        return Orbits(found)
    return Orbits(outcome="none", message=f"no period-{n_periods} orbit sticks")


def _sorted(osc: ImpactOscillator, cycle: Cycle, solutions: Iterable[Floats]) -> Orbits:
    orbits = sorted(
        (make_orbit(osc, cycle, z) for z in solutions),
        key=lambda orbit: (not orbit.stable, not orbit.admissible, -max(orbit.velocities)),
    )
    good = sum(orbit.admissible for orbit in orbits)
    if good:
        return Orbits(orbits, message=f"{good} {_called(cycle)} orbit{'s' if good > 1 else ''}")
    return Orbits(orbits, outcome="inadmissible", message=orbits[0].message)


def _called(cycle: Cycle) -> str:
    return f"period-{cycle.n_periods} impact-{cycle.n_impacts}"


def _from(osc: ImpactOscillator, cycle: Cycle, begin: Orbit | tuple[float, float]) -> Orbits:
    """Return the orbit that Newton's method reaches from an orbit, or from the motion that follows an impact."""
    if isinstance(begin, Orbit):
        start = solution_of(begin)[1]
    else:
        (chain,) = followed(osc, cycle, np.array([begin[0]]), np.array([begin[1]]))
        if chain is None:
            few = f"from there fewer than {cycle.n_impacts} impacts follow; start where the mass hits more often"
            return Orbits(outcome="not_converged", message=few)
        start = cycle_of(chain)
    found = solve(osc, cycle, start)
    if found.singular:
        return Orbits(
            outcome="singular",
            message="the start led to where the equations are singular (a fold or a graze); start beside it",
        )
    if not found.converged:
        return Orbits(
            outcome="not_converged", message=f"the start led to no {_called(cycle)} orbit; start nearer to one"
        )
    name = true_name(cycle, found.z)
    if name != cycle:
        return Orbits(
            outcome="other_name", message=f"the start led to a {_called(name)} orbit, which is no {_called(cycle)} one"
        )
    return _sorted(osc, cycle, [from_hardest(cycle, found.z)])


def _search(osc: ImpactOscillator, cycle: Cycle) -> Orbits:
    """Return the admissible orbits that the attractor from rest and a grid of starts lead to."""
    solutions: list[Floats] = []
    others: dict[Cycle, int] = {}
    for start in candidates(osc, cycle):
        found = solve(osc, cycle, start)
        if not found.converged or found.singular or found.z[cycle.n_impacts :].min() <= 0.0:
            continue
        z = from_hardest(cycle, found.z)
        if any(distance(cycle, z, known) < ALIKE for known in solutions):
            continue
        name = true_name(cycle, z)
        if name != cycle:
            others[name] = others.get(name, 0) + 1
            continue
        solutions.append(z)
    orbits = _sorted(osc, cycle, solutions) if solutions else Orbits()
    real = [orbit for orbit in orbits if orbit.admissible]
    virtual = len(orbits) - len(real)
    if real:
        return Orbits(real, message=f"{len(real)} {_called(cycle)} orbit{'s' if len(real) > 1 else ''}")
    message = f"no start led to a {_called(cycle)} orbit"
    if others:
        message += "; some led to a " + ", ".join(_called(name) for name in others) + " orbit"
    if virtual:
        message += f"; {virtual} solutions are no motion of the mass"
    return Orbits(outcome="other_name" if others else "none", message=message)
