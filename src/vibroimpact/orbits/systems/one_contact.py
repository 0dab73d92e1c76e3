r"""All orbits with one contact with a compliant stop per cycle, or one per half cycle of a symmetric orbit.

At a given duration tau of the contact everything is linear: with the flows of the contact and of the flight after it,
the 2n equations N x = P z for the closure of the cycle make the state x at the beginning of contact a trigonometric
polynomial of the driving angle there. Then

    u = 0 where contact begins,    u + l u' = 0 (zero force) where it ends

are two equations for tau and the angle. Multiplied by det N, which vanishes where a free motion repeats after the
cycle's length, they have coefficients that are smooth functions of tau, and `common_zeros` finds all solutions. No
guess is needed, and unstable orbits are found, too.

A contact of zero duration would satisfy both, and with an undamped stop a flight of zero duration, too. Therefore the
first equation is subtracted from the second and the difference is divided by tau + l; with an undamped stop tau is
replaced there by tau (Theta - tau)/Theta. The solutions left at tau = 0 are grazes, and the lightest contacts near them
are simple zeros.
"""

from __future__ import annotations

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.matrices import growth
from vibroimpact.orbits.admissibility import ROUNDING
from vibroimpact.orbits.cycle import Cycle
from vibroimpact.orbits.distance import Impacts, same_orbit
from vibroimpact.orbits.equations import TURN
from vibroimpact.orbits.events import Pushing
from vibroimpact.orbits.flow import Flow
from vibroimpact.orbits.systems.admissibility import courses
from vibroimpact.orbits.systems.closed_form import EPS, VANISHED, not_isolated, nowhere
from vibroimpact.orbits.systems.common_zeros import NODES, common_zeros
from vibroimpact.parameters import counted

MOST_ORBITS = 256  # solutions for one contact: if there are more, they are not isolated
CLOSED = 1e-3  # of the orbit's size, and of the largest force: a larger residual means no orbit
GRAZED = 1e-7  # of the state: a graze, as which a double zero is known to the root of rounding only
SHARES = (np.arange(8) + 0.5) / 8  # samples of a contact, at which the force must not pull


def one_contact(cycle: Cycle) -> tuple[list[tuple[Cycle, Floats]], str]:
    """Return the cycles and unknowns of all orbits with one contact per cycle, and which others may be missed."""
    flow = cycle.flow
    if why := _not_isolated(cycle):
        return [], why
    try:
        zeros = common_zeros(lambda lows, width: _coefficients(cycle, lows, width), cycle.length, flow.orders)
    except np.linalg.LinAlgError:  # as what a gyroscopic system without loss conserves
        return [], "cycles close from a continuum of states, whatever the duration of a contact; give `near`"
    starts = _starts(cycle, zeros.durations, zeros.angles)
    if len(starts) > MOST_ORBITS:
        return [], "contacts of many durations repeat: orbits are not isolated"
    solutions: list[Floats] = []
    contacts: list[Impacts] = []
    for start in starts:
        solved = cycle.solve(start)
        touches = cycle.speeds(solved.z)[0] > GRAZED * np.abs(solved.z[2:]).max()
        if solved.converged and touches and not _pulls(cycle, solved.z):
            contact = Impacts(solved.z[:1] / TURN, cycle.velocities(solved.z))
            if not any(same_orbit(contact, other) for other in contacts):
                solved.z[:2] -= TURN * np.floor(solved.z[0] / TURN)
                solutions.append(solved.z)
                contacts.append(contact)
    what = "half a cycle" if cycle.images else counted(cycle.n_periods, "driving period")
    why = "" if solutions else f"no orbit with one contact per {what} was found"
    if zeros.unsearched:
        begin, end = np.array(zeros.unsearched) / flow.omega
        why = f"{why}{'; ' if why else ''}some contacts of {begin:.3g} to {end:.3g} s may be missed"
    return [(cycle, z) for z in solutions], why


def _not_isolated(cycle: Cycle) -> str:
    """Return the reason why there are no isolated orbits at any duration of contact; empty if there may be some."""
    flow, n = cycle.flow, 2 * cycle.flow.n
    if flow.unforced:
        lossless = not (flow.damping.any() or flow.viscosity.any())
        free = "unforced and without loss: each orbit is one of a continuum; give its `energy`"
        return free if lossless else nowhere(cycle)
    matrices, loads, _ = _equations(cycle, cycle.length * np.array([0.21, 0.47, 0.79]))
    left, sizes, right = np.linalg.svd(matrices)
    steepest = 1.0 + cycle.length * float(np.linalg.norm(flow.phase().matrix, 2))
    at = int(np.argmax(sizes[:, -1] / sizes[:, 0]))  # if any is singular, all are
    rank = int((sizes[at] > 16.0 * EPS * steepest * sizes[at, 0]).sum())
    if rank == n:
        return ""
    size = cycle.length * float(np.linalg.norm(flow.phase().load)) + float(np.linalg.norm(flow.bounds))
    conditions = np.linalg.svd(left[at, :, rank:].T @ loads[at], compute_uv=False)
    return not_isolated(cycle, np.append(right[at, rank], 0.0), bool((conditions[2:] > VANISHED * size).any()))


def _equations(cycle: Cycle, durations: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the equations of closure and both events, as factors of state and z, and the flow over the contact."""
    flow, n, (begin, end) = cycle.flow, 2 * cycle.flow.n, map(cycle.flow.watched, cycle.events)
    contact = _growth(flow, durations, (cycle.events[0].stop,))
    whole = _then(contact, _growth(flow, cycle.length - durations))[:, :n]
    whole[:, :, :n] -= (cycle.sign - 1.0) * np.eye(n)
    whole = cycle.pinned(whole, np.eye(*whole.shape[1:]))
    ends = np.concatenate(end) @ (contact + np.eye(contact.shape[-1]))
    begins = np.broadcast_to(np.concatenate(begin), ends.shape)
    both = np.concatenate([whole, np.stack([begins, ends], axis=1)], axis=1)
    return both[..., :n], both[..., n:], contact


def _pulls(cycle: Cycle, z: Floats) -> bool:
    """Return whether the force falls below zero before contact ends; such a solution is no orbit."""
    course = list(courses(cycle.leg(z, 0)))[cycle.events[0].stop]
    least = np.append(course.gaps[1:-1], course.lowest).min()
    return bool(least < -ROUNDING * course.size)


def _starts(cycle: Cycle, durations: Floats, angles: Floats) -> list[Floats]:
    """Return the unknowns at zeros that are contacts: the cycle nearly closes, and the stop does not pull.

    The state is the least-squares solution of the equations of the cycle and of both events.
    """
    flow, stop, end = cycle.flow, cycle.events[0].stop, np.concatenate(cycle.flow.watched(cycle.events[1]))
    z = flow.drive(angles)
    matrices, loads, contact = _equations(cycle, durations)
    sides = np.einsum("pij,pj->pi", loads, z)
    states = -np.einsum("pij,pj->pi", np.linalg.pinv(matrices), sides)
    misses = np.abs(np.einsum("pij,pj->pi", matrices, states) + sides).max(axis=1)
    begun = np.concatenate([states, z], axis=1)
    parts = _growth(flow, np.outer(SHARES, durations).ravel(), (stop,)).reshape(len(SHARES), *contact.shape)
    pulls = (begun + np.einsum("spij,pj->spi", parts, begun)) @ end
    rates = z @ (flow.bounds[stop] @ flow.turning) - states[:, flow.n :] @ flow.beta[stop]
    good = (misses <= CLOSED * np.abs(states).max(axis=1)) & (rates < 0.0) & (durations > 0.0)
    good &= pulls.max(axis=0) <= CLOSED * np.abs(pulls).max(axis=0)
    return [
        np.concatenate(row) for row in zip(np.transpose([angles, angles + durations])[good], states[good], strict=True)
    ]


def _coefficients(cycle: Cycle, lows: Floats, width: float) -> Floats:
    """Return the coefficients of both equations at the Chebyshev points of intervals of durations."""
    flow, n, stop = cycle.flow, 2 * cycle.flow.n, cycle.events[0].stop
    offsets = 0.5 * width * (NODES + 1.0)
    durations, flights = lows[:, None] + offsets, (cycle.length - lows - width)[:, None] + offsets[::-1]
    contact = _then(_growth(flow, lows, (stop,))[:, None], _growth(flow, offsets, (stop,)))
    flight = _then(_growth(flow, offsets[::-1]), _growth(flow, cycle.length - lows - width)[:, None])
    whole = _then(contact, flight)
    matrices = cycle.pinned((cycle.sign - 1.0) * np.eye(n) - whole[..., :n, :n], np.eye(n))
    load = whole[..., :n, n:]
    determinants = np.linalg.det(matrices)
    if not determinants.all():  # exactly singular: a neighbouring value is equal to rounding
        matrices[determinants == 0.0] += EPS * np.eye(n)
        determinants = np.linalg.det(matrices)
    states = np.linalg.solve(matrices, cycle.pinned(load, np.zeros_like(load)))
    none, beta, bound, lag = np.zeros(flow.n), flow.beta[stop], flow.bounds[stop], flow.lag(stop)
    clearance = np.concatenate([-beta / flow.units, none, bound])
    rate = np.concatenate([none, -beta, bound @ flow.turning])
    shift = np.concatenate([flow.units * beta, none, np.zeros(len(bound))])[:, None]  # the clearance by -1
    same = np.broadcast_to(np.eye(len(bound)), (*durations.shape, len(bound), len(bound)))
    begin = np.concatenate([states, same], axis=-2)
    end = begin + contact @ begin
    end = end + shift * (clearance @ end + lag * (rate @ end))[..., None, :]
    begin = begin + shift * (clearance @ begin)[..., None, :]
    moved, gone = contact @ begin, flight @ end
    pressed, back, weights = clearance @ moved + lag * (rate @ (begin + moved)), clearance @ gone, flights + lag
    if cycle.images:
        image = cycle.images[stop]
        clearance = np.concatenate([-flow.beta[image] / flow.units, none, flow.bounds[image]])
        back, weights = clearance @ (end + gone), np.ones_like(flights)
    else:
        back = back - lag * (rate @ end)
    scales = determinants[..., None] / np.stack([weights, durations + lag], axis=-1)
    coefficients: Floats = scales[..., None] * np.stack([back, pressed], axis=-2)
    return coefficients


def _growth(flow: Flow, angles: Floats, pushing: Pushing = ()) -> Floats:
    """Return the matrices that carry state and drive over angles, minus the identity."""
    grown, driven = flow.over(angles, pushing)
    turned = growth(flow.turning * angles[:, None, None])
    none = np.zeros((len(angles), *flow.push.T.shape[:1], grown.shape[-1]))
    return np.concatenate([np.concatenate([grown, driven], -1), np.concatenate([none, turned], -1)], -2)


def _then(first: Floats, second: Floats) -> Floats:
    """Return the same for one flight followed by another."""
    both: Floats = first + second + second @ first
    return both
