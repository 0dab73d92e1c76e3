"""Find the periodic orbits of one type.

Orbits with one impact are known in closed form, those that stick by following the mass from its release. For the rest
Newton's method solves the equations of a cycle, from motions that the engine followed: the attractor reached from rest,
and a grid over the impact surface.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from vibroimpact.backends import ImpactWindow, Measurement, Samples, get_backend
from vibroimpact.backends.scalar import outlast
from vibroimpact.model import Model, State, check_model
from vibroimpact.orbits.admissibility import contacts
from vibroimpact.orbits.equations import Cycle, Floats, fastest_of, impact_1_orbits, parameters_of
from vibroimpact.orbits.orbit import Orbit, from_hardest, impacts_of, make_orbit, same_orbit, solution_of, true_cycle
from vibroimpact.oscillator import ImpactOscillator
from vibroimpact.parameters import invalid, real_number, whole_number

Near = Orbit | State | tuple[float, float] | None


Kind = TypeVar("Kind")


class Orbits(list[Kind], Generic[Kind]):
    """The orbits of one (n, p) type, stable ones first, with the outcome of the search.

    Attributes
    ----------
    outcome : str
        "found"; "inadmissible" (solutions, but each penetrates the stop); "none" (none exists, or no initial guess
        converged to one); "other_name" (the guess converged to an orbit of fewer periods and impacts);
        "not_converged"; "singular" (it converged to a fold or a graze, where the equations do not fix an orbit).
    message : str
        The outcome in a sentence.
    """

    def __init__(self, orbits: Iterable[Kind] = (), *, outcome: str = "found", message: str = "") -> None:
        super().__init__(orbits)
        self.outcome = outcome
        self.message = message


def find_orbit(
    osc: ImpactOscillator | Model, *, n_periods: int = 1, n_impacts: int = 1, near: Any = None
) -> Orbits[Any]:
    r"""Find the period-n impact-p orbits of an oscillator or a system, stable or not.

    Impact times and velocities solve, flight by flight,

    .. math:: y_i(t_{i+1}) = g, \qquad \dot y_i(t_{i+1}) = v_{i+1}, \qquad t_{p+1} = t_1 + nT,

    where flight i leaves the stop at :math:`t_i` with :math:`-r v_i`.

    Parameters
    ----------
    osc : ImpactOscillator, ImpactSystem or family
        Whose orbits; of a family, those at its own values.
    n_periods : int, >= 1
        Driving periods in a cycle, n.
    n_impacts : int, >= 1 or -1
        Impacts in a cycle, p; -1 for an orbit with a complete chatter, which sticks.
    near : Orbit, Attractor, State or (phase, velocity), optional
        Initial guess: an orbit or an attractor of this or another oscillator, a state at the stop, or phase in [0, 1)
        and velocity > 0 (m/s) of an impact. None tries the attractor reached from rest and a grid over the impact
        surface. Not used for one impact on a rigid stop, where all solutions are known in closed form. For systems, an
        orbit, an attractor or any state near one; None tries symmetric orbits (two impacts) and the motion from rest.

    Returns
    -------
    Orbits
        A list of `Orbit`, stable ones first, each from its hardest impact on, or of `SystemOrbit`; with `outcome` and
        `message`. With one impact, or with `near`, it includes inadmissible orbits (they penetrate the stop), whose
        `message` gives the reason; otherwise only admissible ones.

    Raises
    ------
    ValueError
        `n_periods` or `n_impacts` is below 1, or `near` is not an orbit, a State or a pair (phase, velocity).

    Notes
    -----
    Velocities and phases are accurate to about 1e-14 times the condition number of the equations: flights and their
    derivatives are in closed form. The multipliers are those of the product of flows and saltation matrices [2]_ [3]_.
    An orbit is admissible if each flight's first certified contact is the orbit's next impact. With several impacts and
    without `near` the list may be incomplete. A millisecond for one impact, about a tenth of a second for several.

    References
    ----------
    .. [1] S. W. Shaw and P. J. Holmes, "A periodically forced piecewise linear oscillator", J. Sound Vib. 90 (1983)
       129-155: the closed form for one impact.
    .. [2] P. C. Müller, "Calculation of Lyapunov exponents for dynamic systems with discontinuities", Chaos, Solitons
       & Fractals 5 (1995) 1671-1681: saltation (theory, equation 5.1).
    .. [3] M. di Bernardo, C. J. Budd, A. R. Champneys and P. Kowalczyk, "Piecewise-smooth Dynamical Systems",
       Springer (2008), chapter 2.

    Examples
    --------
    >>> (orbit,) = find_orbit(ImpactOscillator(omega=2.0))
    >>> orbit.name, orbit.stable, round(orbit.velocities[0], 6)
    ('period-1 impact-1', True, 6.226413)
    >>> find_orbit(ImpactOscillator(omega=2.0), n_periods=1, n_impacts=2).message
    'no initial guess converged to a period-1 impact-2 orbit'
    """
    check_model(osc)
    if isinstance(start := getattr(near, "start", None), State) and hasattr(near, "orbit"):  # an attractor
        near = near.orbit or start
    cycle = Cycle(whole_number("n_periods", n_periods, 1), whole_number("n_impacts", n_impacts, -1, IMPACTS))
    if cycle.n_impacts == 0:
        raise invalid("n_impacts", n_impacts, "a whole number >= 1, or -1 for a complete chatter")
    if not isinstance(made := osc.at(), ImpactOscillator):
        from vibroimpact.orbits.systems.named import find_named

        return find_named(osc, cycle.n_periods, cycle.n_impacts, near)
    begin = _start(made, near, cycle)
    if cycle.n_impacts == -1:
        from vibroimpact.orbits.sticking import find_sticking_orbit, why_none  # slower to import

        found = find_sticking_orbit(osc, cycle.n_periods)
        return Orbits(found) if found else Orbits(outcome="none", message=why_none(osc.at(), cycle.n_periods))
    if cycle.n_impacts == 1 or osc.at().amplitude == 0.0:
        solutions, why = impact_1_orbits(osc.at(), cycle.n_periods)
        return _sorted(osc, cycle, solutions) if solutions else Orbits(outcome="none", message=why)
    return _search(osc, cycle) if begin is None else _from(osc, cycle, begin)


def stable_orbits(osc: ImpactOscillator, n_periods: int) -> list[Orbit]:
    """Return the stable, admissible period-n impact-1 orbits, the hardest first; only of stable ones it is asked."""
    cycle, parameters = Cycle(n_periods, 1), parameters_of(osc)
    solutions, _ = impact_1_orbits(osc, n_periods)
    stable = [z for z in solutions if max(map(abs, cycle.multipliers(parameters, z))) < 1.0]
    return [orbit for orbit in _sorted(osc, cycle, stable) if orbit.stable and orbit.admissible] if stable else []


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
            raise invalid("near", near, f"a state at an impact, with displacement = gap = {osc.gap!r}")
        phase, velocity = near.time / osc.period, near.velocity
    elif isinstance(near, (tuple, list)) and len(near) == 2:
        phase, velocity = real_number("near", near[0]), near[1]
    else:
        what = "an Orbit, a State at the stop, or (phase, velocity)"
        raise invalid("near", near, what, "for example near=(0.25, 1.4)")
    allowed = "an impact of velocity > 0"
    speed = real_number("near", velocity, allowed)
    if speed <= 0.0:
        raise invalid("near", velocity, allowed, "give the speed just before contact")
    return phase, speed


def _sorted(model: Model, cycle: Cycle, solutions: Iterable[Floats]) -> Orbits[Orbit]:
    orbits = sorted(
        (make_orbit(model, cycle, z) for z in solutions),
        key=lambda orbit: (not orbit.stable, not orbit.admissible, -max(orbit.velocities)),
    )
    good = sum(orbit.admissible for orbit in orbits)
    if good:
        return Orbits(orbits, message=f"{good} {cycle.name} orbit{'s' if good > 1 else ''}")
    return Orbits(orbits, outcome="inadmissible", message=orbits[0].message)


def _from(model: Model, cycle: Cycle, begin: Orbit | tuple[float, float]) -> Orbits[Orbit]:
    """Return the orbit that Newton's method reaches from an orbit, or from the motion that follows an impact."""
    osc = model.at()
    if isinstance(begin, Orbit):
        start = solution_of(begin)[1]
    else:
        (chain,) = followed(osc, cycle, np.array([begin[0]]), np.array([begin[1]]))
        if chain is None:
            few = f"fewer than {cycle.n_impacts} impacts follow from there; begin where the mass hits more often"
            return Orbits(outcome="not_converged", message=few)
        start = cycle_of(chain)
    found = solve(osc, cycle, start)
    if found.singular:
        message = "converged to a fold or a graze, where the equations are singular; begin beside it"
        return Orbits(outcome="singular", message=message)
    if not found.converged:
        return Orbits(outcome="not_converged", message=f"not converged to a {cycle.name} orbit; begin nearer to one")
    own = true_cycle(cycle, found.z)
    if own != cycle:
        message = f"converged to a {own.name} orbit instead of a {cycle.name} one"
        return Orbits(outcome="other_name", message=message)
    return _sorted(model, cycle, [from_hardest(cycle, found.z)])


def _search(model: Model, cycle: Cycle) -> Orbits[Orbit]:
    """Return the admissible orbits found from the attractor reached from rest and from a grid of impacts."""
    osc = model.at()
    solutions: list[Floats] = []
    others: list[Cycle] = []
    for start in candidates(osc, cycle):
        found = solve(osc, cycle, start)
        if not found.converged or found.singular or found.z[cycle.n_impacts :].min() <= 0.0:
            continue
        z = from_hardest(cycle, found.z)
        if any(same_orbit(impacts_of(cycle, z), impacts_of(cycle, known)) for known in solutions):
            continue
        own = true_cycle(cycle, z)
        if own == cycle:
            solutions.append(z)
        elif own not in others:
            others.append(own)
    orbits = _sorted(model, cycle, solutions) if solutions else Orbits[Orbit]()
    real = [orbit for orbit in orbits if orbit.admissible]
    virtual = len(orbits) - len(real)
    if real:
        return Orbits(real, message=orbits.message)
    message = f"no initial guess converged to a {cycle.name} orbit"
    if others:
        message += f"; some converged to {' or '.join(other.name for other in others)} orbits"
    if virtual:
        message += f"; {virtual} solution{'s' if virtual > 1 else ''} inadmissible (penetrating the stop)"
    return Orbits(outcome="other_name" if others else "none", message=message)


IMPACTS = 1000  # in a cycle, at most: the equations grow as its square
GRID = (40, 28)  # initial impacts: phases, velocities
TRIES = 40  # of them that Newton's method tries besides the local minima of the miss
SETTLING = 2000  # impacts left out on the way to the attractor


def followed(osc: ImpactOscillator, cycle: Cycle, phases: Floats, velocities: Floats) -> list[Floats | None]:
    """Return from each impact the p impacts that follow, itself included, and the next: turns and velocities."""
    return [_chain(seen, cycle.n_impacts) for seen in contacts(osc, phases, velocities, cycle.n_impacts)]


def _chain(seen: Samples, p: int) -> Floats | None:
    """Return turns and velocities of p + 1 impacts in a row, or None if there are fewer."""
    if len(seen.impact_phase) < p + 1:
        return None
    periods, phases, velocities = (
        column[-p - 1 :] for column in (seen.impact_periods, seen.impact_phase, seen.impact_velocity)
    )
    return np.concatenate([periods - periods[0] + phases, velocities])


def cycle_of(chain: Floats) -> Floats:
    """Return the cycle that a chain would be if its last impact were its first."""
    p = len(chain) // 2 - 1
    return np.concatenate([chain[:p], chain[p + 1 : -1]])


def _miss(cycle: Cycle, chain: Floats | None, speed: float) -> float:
    """Return the distance of a chain from closing after n periods, in turns and parts of a speed; or infinity."""
    if chain is None:
        return np.inf
    p = cycle.n_impacts
    late = abs(chain[p] - chain[0] - cycle.n_periods)
    return float(late + abs(chain[-1] - chain[p + 1]) / speed) if late < 0.5 else np.inf


def attractor_chain(osc: ImpactOscillator, cycle: Cycle) -> Floats | None:
    """Return the last impacts of the attractor reached from rest."""
    cells = osc.cells({})
    if osc.gap <= 0.0:  # slightly out of balance, otherwise nothing starts
        cells = cells.replace(velocity=cells["velocity"] - 1e-3 * osc.velocity_scale)
    window = ImpactWindow(SETTLING, cycle.n_impacts + 1)
    (seen,) = get_backend("cpu").samples(cells, Measurement(window))
    return _chain(seen, cycle.n_impacts)


def candidates(osc: ImpactOscillator, cycle: Cycle) -> list[Floats]:
    """Return initial guesses: the attractor's cycle, then those of a grid on the impact surface that close best."""
    attractor = attractor_chain(osc, cycle)
    if attractor is None and outlast(osc.cells({}), Measurement(ImpactWindow(0, cycle.n_impacts + 1))):
        return []  # nor would impacts of the grid be followed so far
    hardest = 0.0 if attractor is None else float(attractor[cycle.n_impacts + 1 :].max())
    fastest = max(2.0 * osc.velocity_scale, 1.5 * hardest)
    phases, velocities = np.meshgrid(np.arange(GRID[0]) / GRID[0], fastest * (np.arange(GRID[1]) + 0.5) / GRID[1])
    chains = followed(osc, cycle, phases.ravel(), velocities.ravel())
    misses = np.array([_miss(cycle, chain, fastest) for chain in chains]).reshape(phases.shape)
    # Rows are velocities, columns phases on the circle: nothing beyond the rows comes close.
    walled = np.pad(np.pad(misses, ((0, 0), (1, 1)), mode="wrap"), ((1, 1), (0, 0)), constant_values=np.inf)
    around = [np.roll(walled, (a, b), (0, 1))[1:-1, 1:-1] for a in (-1, 0, 1) for b in (-1, 0, 1)]
    lowest = np.isfinite(misses) & (misses <= np.min(around, axis=0))
    best = misses.ravel() <= np.partition(misses.ravel(), TRIES)[TRIES]
    chosen = np.flatnonzero((lowest.ravel() | best) & np.isfinite(misses.ravel()))
    chosen = chosen[np.argsort(misses.ravel()[chosen])]
    return [cycle_of(chain) for chain in [attractor, *(chains[j] for j in chosen)] if chain is not None]


MOST = 40
CLOSE = 1e-9  # relative: the correction after which convergence, being quadratic, is complete
SINGULAR = 1e13


@dataclass(frozen=True)
class Solved:
    """The result of Newton's method: whether it converged, and whether the solution is not isolated."""

    z: Floats
    converged: bool
    singular: bool = False


def solve(osc: ImpactOscillator, cycle: Cycle, start: Floats) -> Solved:
    """Return the solution that damped Newton's method reaches: steps are halved while they raise the misses."""
    parameters, z = parameters_of(osc), np.array(start, dtype=float)
    rows, columns = cycle.scales(osc, fastest_of(osc, z[cycle.n_impacts :]))
    misses = cycle.misses(parameters, z) / rows
    for _ in range(MOST):
        matrix = cycle.jacobian(parameters, z) * columns / rows[:, None]
        if not np.isfinite(matrix).all():
            break
        correction = np.linalg.lstsq(matrix, misses, rcond=None)[0]
        size, part = float(np.abs(correction).max()), 1.0
        while part > 1e-3:
            trial = z - part * columns * correction
            left = cycle.misses(parameters, trial) / rows
            if size < CLOSE or (np.abs(left).max() < np.abs(misses).max() and cycle.in_order(trial)):
                break
            part *= 0.5
        else:
            break
        z, misses = trial, left
        if size < CLOSE:
            return Solved(z, cycle.in_order(z), bool(np.linalg.cond(matrix) > SINGULAR))
    matrix = cycle.jacobian(parameters, z) * columns / rows[:, None]
    singular = bool(not np.isfinite(matrix).all() or np.linalg.cond(matrix) > 1e6)
    return Solved(z, False, singular)
