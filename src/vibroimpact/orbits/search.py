"""Find the periodic orbits of a model: check the arguments, then call the search for one mass or for systems."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from vibroimpact.backends import Samples
from vibroimpact.model import Model, check_model
from vibroimpact.orbits import one_mass
from vibroimpact.orbits.distance import Impacts, orbit_distance, same_orbit
from vibroimpact.orbits.near import orbit_near, state_of
from vibroimpact.orbits.orbit import Orbit, family_of
from vibroimpact.orbits.results import IMPACTS, Guess, Orbits, Search, numbers_of, ordered
from vibroimpact.parameters import invalid, truth, whole_number
from vibroimpact.progress import reporter

WITHOUT_PERIOD = "the load has no frequency, and so there is no driving period and no period-n orbit; see simulate"
ALIKE = 5e-3  # `orbit_distance` of a settled motion from its orbit, within which they are the same
AT_AN_ENERGY = ", or give `energy`: without loss and load, motions that repeat have periods of their own"


def find_orbit(
    osc: Model,
    *,
    n_periods: int | None = None,
    n_impacts: int | None = None,
    stops: str | Sequence[str] | None = None,
    symmetric: bool = False,
    near: Any = None,
    energy: float | None = None,
    mode: int | None = None,
) -> Orbits:
    r"""Find the period-n impact-p orbits of an oscillator or a system, stable or not.

    Impact times and velocities solve, flight by flight,

    .. math:: y_i(t_{i+1}) = g, \qquad \dot y_i(t_{i+1}) = v_{i+1}, \qquad t_{p+1} = t_1 + nT,

    where flight i leaves the stop at :math:`t_i` with :math:`-r v_i`.

    Parameters
    ----------
    osc : ImpactOscillator, ImpactSystem or family
        The model whose orbits are sought; a family is taken at its own values.
    n_periods : int, >= 1, optional
        Driving periods in a cycle, n; 1 unless given.
    n_impacts : int, >= 1 or -1, optional
        Impacts in a cycle, p, on any stops; -1 for a sticking orbit, with a complete chatter. The default is 1, or
        follows from `stops` or `symmetric` if given.
    stops : str or sequence of str, optional
        Names of the stops struck in a cycle, in the order of time; for symmetric motions, in half a cycle. Inadmissible
        orbits are listed, too.
    symmetric : bool
        Search for motions that are their own mirror image, q -> -q, half a cycle later (n odd). Without `stops`, those
        that strike one stop of each mirrored pair in half a cycle, or the stops of `near`.
    near : Orbit, Attractor, State, Dataset or sequence of float, optional
        With `near` alone, the orbit near a motion, whatever its type: that of the attractor, that on which the state
        lies, or that to which the motion from it settles; for an orbit, those of its type. A result of `simulate` or of
        a section stands for its last state; a pair of phase in [0, 1) and velocity > 0 (m/s) for an impact of one mass.
        With a type, an initial guess: one of these, also of another model, or, with `stops`, the times of the impacts
        in s. None tries the motion from rest and, for one mass, a grid over the impact surface, for systems symmetric
        orbits (two impacts). With one impact on a rigid stop, no guess is used: all solutions are known in closed form.
    energy : float, > 0, optional
        Energy in J of a periodic motion without load and loss. Its period is then sought, too: the orbit is the one of
        the family that is born from a linear mode (a nonlinear normal mode). Nothing else but `mode` may be given.
    mode : int, 1 to n, optional
        The mode, by ascending frequency, from which that family is born; 1 by default.

    Returns
    -------
    Orbits
        A list of `Orbit`, stable ones first, each beginning with its hardest impact, for systems with an impact on the
        first of `stops`. It has an `outcome` and a `message`. With one impact, or with `near`, it includes inadmissible
        orbits (they penetrate the stop); their `message` gives the reason, and they are never `stable`. Otherwise it
        holds only admissible ones. Without `stops`, `message` joins the reasons of all stops for which no orbit was
        found. With `near` alone, it holds one admissible orbit or none, and `message` says whether the motion settles
        to it, or only passes by (`outcome` "not_periodic"). It is empty for a model without a driving period unless
        `energy` is given.

    Raises
    ------
    ValueError
        `n_periods` or `n_impacts` is below 1, a stop is unknown, `n_periods` is even for symmetric motions, or `near`
        is required (several stops given) but missing, is not of a kind listed above, or does not fit the model.

    Notes
    -----
    Velocities and phases are accurate to about 1e-14 times the condition number of the equations: flights and their
    derivatives are in closed form. The multipliers are the eigenvalues of the product of flows and saltation matrices
    [2]_ [3]_. An orbit is admissible if the first certified contact of each flight is the orbit's next impact. With
    several impacts and without `near`, the list may be incomplete. A search takes about 1 ms for one impact and 0.1 s
    for several.

    For systems with one impact on a rigid stop, all orbits are found, for any number of coordinates and harmonics,
    moving stops and singular stiffness; orbits that are not isolated are reported in `message`, not listed. If the
    restitution of a stop is a law, two orbits whose r differ by less than 1/64 may be missed, and the search takes 0.2
    s. The accuracy is about 1e-16 times the number of periods of the fastest mode if that is larger. A system is
    symmetric if the load has odd harmonics only and each stop has its mirror image. A search takes about 2 ms per
    orbit.

    On a compliant stop an impact is the beginning of a contact. With one contact, the state follows from its duration
    and phase, which satisfy two equations. These are solved by subdivision: a part of the plane is discarded only if a
    bound excludes a solution, and is divided until it holds at most one. All orbits are therefore found, including
    those with light contacts, near folds or with light damping, except pairs near a fold that are closer than 1/4000 of
    an interval of durations. The bounds are estimated from the decay of the last terms of Chebyshev series. In a stiff
    undamped stop, a contact can last for many of its periods; `message` gives the durations that were not searched. A
    search takes 20 to 100 ms. For several impacts, times are a good guess only if each contact lasts about half a
    period of a mass on the stop's spring; a state is a better guess.

    With `near` alone, the motion is followed until its cycle is certain, for 32,767 impacts at most, and the cycle is
    solved for. The motion of a system is compared with stable orbits at first, and after 49, 242 and 1011 impacts:
    within 1e-3 (`orbit_distance`) of one, it counts as settling to it. If the state is not on that cycle, Newton's
    method also starts from the first returns of up to 64 impacts; an orbit within 0.05 (`orbit_distance`), stable or
    not, is preferred to the one where the motion settles. For motions that do not repeat, the closest returns of up to
    8 impacts are tried: the orbit found is near, but another one may be nearer.

    With `energy`, the family of a mode is followed from its first contact, where the mode touches a stop, through its
    folds (pseudo-arclength), until it has that energy [4]_ [5]_. Above the energy of the first contact the list holds
    the first orbit on the curve; below it, where some families begin, all of them. The period and the states have the
    accuracy of other orbits, and the energy is exact to rounding. Orbits of one family differ in energy and in phase,
    so two multipliers are 1: such a motion is periodic, one of a continuum, and attracts no other. The others come in
    pairs with the product 1. Just above the first contact they are exp(2 pi i f_j/f) of the other modes; where a pair
    meets at 1 or -1, another mode is in internal resonance. Without contact the motion is linear, and the error message
    gives its frequency and the energy of the first contact. Stops may be touched at the same instant, except rigid ones
    whose impacts affect one another: then the motion depends on their order. Some families end below the energy, most
    of them near an internal resonance, at an orbit of half the period, beyond which the same orbits come again. The
    list is then empty, and `message` gives the energies of the family and why it ended. A search takes 0.1 to 1 s, near
    internal resonances up to a minute, during which a line on the error stream of a terminal shows how many orbits have
    been followed (at most 1000).

    References
    ----------
    .. [1] S. W. Shaw and P. J. Holmes, "A periodically forced piecewise linear oscillator", J. Sound Vib. 90 (1983)
       129-155: the closed form for one impact.
    .. [2] P. C. Müller, "Calculation of Lyapunov exponents for dynamic systems with discontinuities", Chaos, Solitons
       & Fractals 5 (1995) 1671-1681: saltation (theory, equation 5.1).
    .. [3] M. di Bernardo, C. J. Budd, A. R. Champneys and P. Kowalczyk, "Piecewise-smooth Dynamical Systems",
       Springer (2008), chapter 2.
    .. [4] M. Peeters, R. Viguié, G. Sérandour, G. Kerschen and J.-C. Golinval, "Nonlinear normal modes, Part II", Mech.
       Syst. Signal Process. 23 (2009) 195-216: continuation in energy.
    .. [5] F. J. Muñoz-Almaraz, E. Freire, J. Galán, E. Doedel and A. Vanderbauwhede, "Continuation of periodic orbits
       in conservative and Hamiltonian systems", Physica D 181 (2003) 1-38.

    Examples
    --------
    >>> from vibroimpact import ImpactOscillator
    >>> (orbit,) = find_orbit(ImpactOscillator(omega=2.0))
    >>> orbit.name, orbit.stable, round(orbit.velocities[0], 6)
    ('period-1 impact-1', True, 6.226413)
    >>> find_orbit(ImpactOscillator(omega=2.0), n_periods=1, n_impacts=2).message
    'no initial guess converged to a period-1 impact-2 orbit'
    >>> from vibroimpact import State
    >>> found = find_orbit(ImpactOscillator(omega=0.9), near=State(-0.5))
    >>> found[0].name, found.message.startswith("the motion from `near` settles to this period-1 impact-2 orbit")
    ('period-1 impact-2', True)
    >>> from vibroimpact import Force, ImpactSystem, Stop
    >>> stops = [Stop(direction=d, gap=0.5, restitution=0.6, name=name) for d, name in ((1, "above"), (-1, "below"))]
    >>> system = ImpactSystem(
    ...     mass=1.0, damping=0.05, stiffness=1.0, force=Force(omega=2.0, harmonics={1: 1.0}), stops=stops
    ... )
    >>> (orbit,) = (orbit for orbit in find_orbit(system, stops="above", symmetric=True) if orbit.stable)
    >>> orbit.stops, orbit.admissible, round(orbit.velocities[0], 12), round(orbit.phases[0], 12)
    (('above', 'below'), True, 1.01091975001, 0.306971826277)

    The free vibration of a mass with a spring behind its gap, at an energy:

    >>> bar = Stop(direction=1, gap=0.01, stiffness=50.0, name="bar")
    >>> (orbit,) = find_orbit(ImpactSystem(mass=1.0, stiffness=10.0, stops=[bar]), energy=0.00650108331626)
    >>> round(orbit.frequency, 10), round(orbit.energy, 12), orbit.multipliers
    (0.6466310406, 0.006501083316, ((1+0j), (1+0j)))
    """
    check_model(osc)
    search = search_of(osc)
    design = search.design
    if energy is not None:
        if (n_periods, n_impacts, stops, symmetric, near) != (None, None, None, False, None):
            raise ValueError("give either `energy` (and `mode`) or the impacts of the orbit, not both")
        from vibroimpact.orbits.systems.nonlinear_modes import find_of_energy

        return find_of_energy(design, energy, mode)
    if mode is not None:
        raise invalid(
            "mode", mode, "omitted without `energy`", "it is the mode from which orbits of an energy are born"
        )
    guess = Guess.of(state_of(near, design))
    if not design.periodic:
        return Orbits(outcome="none", message=WITHOUT_PERIOD + ("" if design.energy_changes else AT_AN_ENERGY))
    if guess.only_state:
        design.initial(guess.state, "near")  # refused if it does not fit, or lies beyond a stop
    typed = truth("symmetric", symmetric) or any(given is not None for given in (n_periods, n_impacts, stops))
    if not (guess.none or typed):
        if guess.orbit is not None:
            with reporter(None, "orbits"):
                return _of_its_type(search, guess)
        if (state := search.state_of(guess)) is not None:
            with reporter(None, "orbits"):
                return orbit_near(search, state)
    n = whole_number("n_periods", 1 if n_periods is None else n_periods, 1)
    p = whole_number("n_impacts", 1 if n_impacts is None else n_impacts, -1, IMPACTS)
    if p == 0:
        raise invalid("n_impacts", n_impacts, "a whole number >= 1, or -1 for a complete chatter")
    if symmetric and n % 2 == 0:
        raise invalid("n_periods", n, "odd for symmetric motions", "after whole periods the force is not mirrored")
    if n_impacts is not None and (symmetric or stops is not None):
        raise invalid("n_impacts", n_impacts, "omitted if `stops` or `symmetric` is given", "they determine it")
    struck = None if stops is None else numbers_of(stops, tuple(stop.name for stop in design.stops))
    with reporter(None, "orbits"):
        return search.of_type(n, p, struck, guess, symmetric=symmetric)


def _of_its_type(search: Search, guess: Guess) -> Orbits:
    """Return the orbits of the type of a given one; the nearest only, if it was given as an attractor."""
    orbit, attractor = guess.orbit, guess.orbit is not guess.near
    if attractor and orbit.oscillator == search.design:
        return ordered([replace(orbit, family=family_of(search.model, search.design))])
    n_impacts = -1 if guess.sticks else orbit.n_impacts
    found = search.of_type(orbit.n_periods, n_impacts, None, Guess.of(orbit), symmetric=False)
    return ordered(sorted(found, key=partial(orbit_distance, orbit))[:1]) if attractor and found else found


def search_of(model: Model) -> Search:
    """Return the search for the orbits of a model: closed forms and the engine of one mass serve where they can."""
    design = model.at()
    if design.forgets:
        return one_mass.OneMassSearch(model, design)
    from vibroimpact.orbits.systems.search import SystemSearch  # slower to import

    return SystemSearch(model, design)


def stable_orbits(search: Search, n_periods: int) -> list[Orbit]:
    """Return the stable period-n impact-1 orbits of a model, the hardest first; few of the others are constructed."""
    solutions = search.of_one_impact(n_periods)
    orbits = (solution.orbit() for solution in solutions if solution.may_attract())
    return sorted((orbit for orbit in orbits if orbit.stable), key=lambda orbit: -max(orbit.velocities))


def settled_orbit(search: Search, n_periods: int, samples: Samples, span: slice) -> Orbit | None:
    """Return the stable orbit of a motion that has settled, from the impacts of one cycle in its samples."""
    impacts = Impacts(samples.impact_phase[span], samples.impact_velocity[span])
    found = search.of_cycle(n_periods, samples, span)
    alike = [orbit for orbit in found if orbit.stable and same_orbit(orbit, impacts, tolerance=ALIKE)]
    return min(alike, key=partial(orbit_distance, impacts), default=None)
