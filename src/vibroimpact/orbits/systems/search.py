"""Find the periodic orbits of a system: those of one impact in closed form, others by Newton's method from a guess."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.model import Model, State, check_model
from vibroimpact.motion import cycle_name
from vibroimpact.orbits import equations
from vibroimpact.orbits.equations import TURN
from vibroimpact.orbits.orbit import SAME, true_cycle
from vibroimpact.orbits.search import IMPACTS, Orbits
from vibroimpact.orbits.systems.closed_form import one_impact
from vibroimpact.orbits.systems.cycle import Cycle
from vibroimpact.orbits.systems.events import struck
from vibroimpact.orbits.systems.flow import Flow
from vibroimpact.orbits.systems.newton import from_angles, solve, with_releases
from vibroimpact.orbits.systems.one_contact import one_contact
from vibroimpact.orbits.systems.orbit import SystemOrbit, cycle_of, make_orbit
from vibroimpact.orbits.systems.symmetry import mirror
from vibroimpact.orbits.systems.trace import cycle_from
from vibroimpact.parameters import choice, invalid, real_number, several, truth, whole_number
from vibroimpact.system import ImpactSystem

Near = SystemOrbit | State | Sequence[float] | None


def find(
    model: Model,
    *,
    n_periods: int = 1,
    stops: str | Sequence[str] | None = None,
    symmetric: bool = False,
    near: Near = None,
) -> Orbits[SystemOrbit]:
    r"""Find the periodic orbits of a system that strike given stops in turn, stable or not.

    Parameters
    ----------
    model : ImpactSystem or family
        Whose orbits; of a family, those at its own values.
    n_periods : int, >= 1
        Driving periods in a cycle, n.
    stops : str or sequence of str, optional
        Names of the stops that are struck in a cycle, in the order of time. None takes those of `near`, or each stop
        for itself, once per cycle; of symmetric motions one of each pair.
    symmetric : bool
        Take motions that are mirrored, q -> -q, after half a cycle (n odd); `stops` are those of half a cycle.
    near : SystemOrbit, State or sequence of float, optional
        Initial guess, needed for several impacts: an orbit of this or another system, a state near it, or the times of
        the impacts in s. For one impact on a rigid stop only a state is used: there all solutions are known without a
        guess.

    Returns
    -------
    Orbits
        A list of `SystemOrbit`, stable ones first, from the first of `stops` on; inadmissible ones, which penetrate a
        stop, included. With the `outcome` and `message` of `vibroimpact.find_orbit`; of several stops, each for
        itself, the messages of those without an orbit are joined.

    Raises
    ------
    ValueError
        A stop is unknown, `n_periods` is below 1, or even for symmetric motions, or a guess is missing or has other
        than one time per impact.

    Notes
    -----
    With one impact on a rigid stop all orbits are found, for any number of coordinates and harmonics, moving stops and
    singular stiffness; orbits that are not isolated are reported in `message`, not listed. Of a stop whose restitution
    is a law, two orbits may be missed whose r differ by less than 1/64; it takes 0.2 s. Velocities and phases are
    accurate to about 1e-14 times the condition of the equations, but to some 1e-16 times the number of periods of the
    fastest mode where that is larger. Multipliers are those of the product of flows and saltation matrices [1]_. A
    system is symmetric if the load has odd harmonics only and each stop has its mirror image. About 2 ms per orbit.

    On a compliant stop an impact is where contact begins. With one contact the state follows from its duration and
    phase, and the two equations that are left for these are solved by subdivision: parts of the plane are left out
    only where a bound excludes a solution, and divided until each holds one at most. So all orbits are found, light
    contacts, folds and light damping included, except pairs that a fold has brought nearer to each other than 1/4000 of
    an interval of durations. The bounds rest on how the last terms of Chebyshev series decay. In an undamped stop that
    is stiff contacts can last for many of its periods: durations that were not searched through are named in `message`.
    It takes 20 to 100 ms. Times of several impacts are a guess only where contacts are about half a turn of a mass on
    the stop's spring; a state does better.

    References
    ----------
    .. [1] P. C. Müller, "Calculation of Lyapunov exponents for dynamic systems with discontinuities", Chaos, Solitons
       & Fractals 5 (1995) 1671-1681.

    Examples
    --------
    >>> from vibroimpact import Force, Stop
    >>> stops = [Stop(direction=d, gap=0.5, restitution=0.6, name=name) for d, name in ((1, "above"), (-1, "below"))]
    >>> system = ImpactSystem(
    ...     mass=1.0, damping=0.05, stiffness=1.0, force=Force(omega=2.0, harmonics={1: 1.0}), stops=stops
    ... )
    >>> (orbit,) = (orbit for orbit in find(system, stops="above", symmetric=True) if orbit.stable)
    >>> orbit.stops, orbit.admissible, round(orbit.velocities[0], 12), round(orbit.phases[0], 12)
    (('above', 'below'), True, 1.01091975001, 0.306971826277)
    """
    check_model(model, "system")
    if not isinstance(system := model.at(), ImpactSystem):
        raise invalid("system", model, "an ImpactSystem")
    n_periods, names = whole_number("n_periods", n_periods, 1), system.stop_names
    images, why = mirror(system)
    if truth("symmetric", symmetric):
        if n_periods % 2 == 0:
            raise invalid("n_periods", n_periods, "odd for symmetric motions", "the force repeats itself in the mirror")
        if why:
            return Orbits(outcome="none", message=why)
    if stops is None and isinstance(near, SystemOrbit):
        stops = near.stops[: len(near.stops) // 2] if symmetric else near.stops
    elif stops is None:
        sequences: list[tuple[int, ...]] = [(at,) for at in range(len(names)) if not symmetric or at < images[at]]
    if stops is not None:
        given = several("stops", stops, "a stop's name or a list of them")
        sequences = [tuple(names.index(choice("stops", name, names)) for name in given)]
    if any(not 1 <= len(sequence) <= IMPACTS for sequence in sequences) or not sequences:
        raise invalid("stops", stops, f"1 to {IMPACTS} stops to strike")
    flow, mirrored = Flow(system), images if symmetric else ()
    known = near is None or not (isinstance(near, State) or flow.compliant[sequences[0][0]])
    if len(sequences[0]) == 1 and known:
        return _of_one(model, [Cycle(flow, n_periods, struck(sequence), mirrored) for sequence in sequences])
    return _from(model, *_guess(flow, n_periods, sequences[0], mirrored, near), images)


def cycles_of_one_impact(system: ImpactSystem, n_periods: int) -> list[Cycle]:
    """Return the cycles with one impact on each stop, and those with one on each of a pair that is mirrored.

    Where a stop gives, contact begins, and when it ends is to be found.
    """
    flow, images = Flow(system), mirror(system)[0] if n_periods % 2 else ()
    cycles = [Cycle(flow, n_periods, struck((stop,))) for stop in range(len(system.stops))]
    return cycles + [Cycle(flow, n_periods, struck((at,)), images) for at, image in enumerate(images) if at < image]


def of_one_impact(cycle: Cycle) -> tuple[list[tuple[Cycle, Floats]], str]:
    """Return all orbits with the one impact of a cycle, as solutions of their equations, and why there are none.

    On a compliant stop also which others may have been missed.
    """
    if cycle.flow.compliant[cycle.events[0].stop]:
        return one_contact(cycle)
    unknowns, why = one_impact(cycle)
    return [(cycle, unknown) for unknown in unknowns], why


def _of_one(model: Model, cycles: Iterable[Cycle]) -> Orbits[SystemOrbit]:
    found, reasons = Orbits[SystemOrbit](), []
    for cycle in cycles:
        solutions, why = of_one_impact(cycle)
        found += [make_orbit(model, *solution) for solution in solutions]
        if why:
            reasons.append((bool(solutions), f"{model.at().stop_names[cycle.events[0].stop]}: {why}"))
    if not found:
        return Orbits(outcome="none", message="; ".join(reason for _, reason in reasons))
    found = ordered(found)
    found.message = "; ".join([found.message, *(reason for beside, reason in reasons if beside)])
    return found


def struck_from(system: ImpactSystem, n_periods: int, n_impacts: int, state: State) -> list[str] | None:
    """Return the stops of the cycle of so many impacts that the motion from a state nearly repeats; None if of none."""
    system.cells({}, state)  # refused where it does not fit
    flow = Flow(system)
    x = np.linalg.solve(flow.physical, np.append(state.displacement, state.velocity))
    found = cycle_from(flow, n_periods, x, state.time * flow.omega, n_impacts)
    return found and [system.stop_names[stop] for stop in found[0].stops]


def ordered(orbits: Iterable[SystemOrbit]) -> Orbits[SystemOrbit]:
    """Return orbits, stable ones first, then admissible ones, then hard ones, and what they are."""
    found = sorted(orbits, key=lambda orbit: (not orbit.stable, not orbit.admissible, -max(orbit.velocities)))
    good = sum(orbit.admissible for orbit in found)
    if good:
        return Orbits(found, message=f"{good} {found[0].name} orbit{'s' if good > 1 else ''}")
    return Orbits(found, outcome="inadmissible", message=found[0].message)


def _guess(
    flow: Flow, n_periods: int, stops: tuple[int, ...], images: tuple[int, ...], near: Near
) -> tuple[Cycle, Floats]:
    """Return the cycle and the unknown that Newton's method starts from."""
    length = TURN * n_periods * (0.5 if images else 1.0)
    if isinstance(near, SystemOrbit) and len(near.system.mass) == flow.n:
        cycle, unknown = cycle_of(near)
        state = cycle.flow.physical @ unknown[len(cycle.events) :]
        p = len(cycle.events) // (2 if images and near.symmetric else 1)
        cycle = replace(cycle, flow=flow, n_periods=n_periods, events=cycle.events[:p], images=images)
        if cycle.stops == stops:
            return cycle, np.append(unknown[:p], np.linalg.solve(flow.physical, state))
    elif isinstance(near, State):
        x = np.linalg.solve(flow.physical, np.append(near.displacement, near.velocity))
        found = cycle_from(flow, n_periods, x, near.time * flow.omega, stops)
        if found is None:
            raise invalid("near", near, f"a state from which these stops are struck in {n_periods} periods")
        return replace(found[0], images=()), found[1]
    if near is None:
        raise invalid("near", near, "an orbit or the times of the impacts", "orbits of several impacts need a guess")
    if isinstance(near, SystemOrbit):
        angles = TURN * np.array(near.turns[: near.n_impacts // (2 if images and near.symmetric else 1)])
    else:
        times = [real_number(f"near[{i}]", time) for i, time in enumerate(several("near", near, "an orbit or times"))]
        angles = flow.omega * np.array(times)
    if len(angles) != len(stops):
        raise invalid("near", near, f"one time for each of the {len(stops)} stops struck")
    if not (np.diff(np.append(angles, angles[0] + length)) > 0.0).all():
        raise invalid("near", near, f"times in order, within {length / flow.omega:.6g} s")
    events, angles = with_releases(flow, stops, angles, angles[0] + length)
    cycle = Cycle(flow, n_periods, events, images)
    return cycle, from_angles(cycle, angles)


def _from(model: Model, cycle: Cycle, start: Floats, images: tuple[int, ...]) -> Orbits[SystemOrbit]:
    """Return the orbit that Newton's method reaches."""
    found = solve(cycle, start)
    name = cycle_name(cycle.n_periods, len(cycle.stops) * (2 if cycle.images else 1))
    if found.singular:
        message = "converged to a fold or a graze, where the equations are singular; begin beside it"
        return Orbits(outcome="singular", message=message)
    if not found.converged:
        return Orbits(outcome="not_converged", message=f"not converged to a {name} orbit; begin nearer to one")
    orbit = make_orbit(model, *halved(cycle, found.z, images))
    whole = equations.Cycle(orbit.n_periods, orbit.n_impacts)
    own = true_cycle(whole, np.array([*orbit.turns, *orbit.velocities]))
    if own != whole and orbit.stops == orbit.stops[: own.n_impacts] * (orbit.n_impacts // own.n_impacts):
        message = f"converged to a {own.name} orbit instead of a {name} one"
        return Orbits(outcome="other_name", message=message)
    return ordered([orbit])


def halved(cycle: Cycle, unknown: Floats, images: tuple[int, ...]) -> tuple[Cycle, Floats]:
    """Return half of a cycle and its unknown, if the mirror makes the second half of the first, else both unchanged."""
    p = len(cycle.events)
    half = replace(cycle, events=cycle.events[: p // 2], images=images)
    if cycle.images or not images or p % 2 or cycle.n_periods % 2 == 0:
        return cycle, unknown
    if cycle.events[p // 2 :] != tuple(event.in_mirror(images) for event in half.events):
        return cycle, unknown
    x, mirrored = (state[~cycle.flow.neutral] for state in (unknown[p:], cycle.states(unknown)[p // 2]))
    angles = unknown[:p]
    apart = np.abs(angles[p // 2 :] - angles[: p // 2] - half.length).max()
    if apart > SAME or np.abs(x + mirrored).max() > SAME * np.abs(x).max():
        return cycle, unknown
    return half, np.append(angles[: p // 2], unknown[p:])
