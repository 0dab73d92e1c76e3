r"""The free flight of a system and its impacts, in a form without infinite terms at any damping and resonance.

Time is the driving angle, theta = w t. The state x = (sigma y, y') holds the mass-normalised modes y and their rates
with respect to theta, with sigma = max(Omega/w, 1), so that both parts of a mode have the same magnitude. Load and
stops are linear in the drive z = (1, sin h theta, ..., cos h theta, ...) over all orders h:

    x' = A x + F z,    z' = W z,    b - beta . y = clearance,    b = bounds z,

where each clearance is divided by the length of its stop's direction in modal coordinates, sqrt(a . M^-1 a), so that
|beta| = 1. Then an impact of restitution r changes y' to y' - (1 + r) v beta, where v = beta . y' - b' is its velocity.
If r is a law of v, derivatives contain R = d(r v)/dv in its place.

Over a flight of length tau the state becomes x(tau) = Phi x(0) + Psi z(0). Both are blocks of one matrix exponential
(C. F. Van Loan, IEEE Trans. Automat. Control 23 (1978) 395-404): no steady state is used, since a free mass or an
undamped mode in resonance has none.

Each pushing compliant stop adds (k u + c u') beta to y'', with k and c divided by the length squared and in units of
angle, which changes A and F. The exponential is then computed in coordinates that begin with the directions of these
stops, the stiffest first, each displacement multiplied by its own rate. In these coordinates a stiff stop does not
round the terms of the others, and the exponent is as large as the fastest rate, not as its square.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.matrices import block_matrix, growth
from vibroimpact.model.system import ImpactSystem
from vibroimpact.orbits.events import GRAZE, IMPACT, LET_GO, Event, Pushing

ORTHOGONAL = 1e-12  # largest cosine between directions of stops whose impacts do not affect one another
KEPT = 64  # flights cached: those of one cycle, while its equations are differentiated and its orbit is built


class Phase(NamedTuple):
    """The law x' = matrix x + load z while some stops push, and the same law in scaled coordinates for exponentials.

    `fastest` is the fastest rate, per unit of the driving angle.
    """

    matrix: Floats
    load: Floats
    whole: Floats
    sizes: Floats
    fastest: float
    turned: Floats | None = None
    back: Floats | None = None


class Flow:
    """The flights, contacts and impacts of one system in scaled modes."""

    def __init__(self, system: ImpactSystem) -> None:
        form = system.modal()
        self.n, self.omega, self.restitution = len(form.squares), form.omega, form.restitution
        self.compliant = np.array([not stop.element.instantaneous for stop in system.stops], bool)
        self.names = system.stop_names
        self.elements = [stop.element for stop in system.stops]
        roots, self.orders = np.sqrt(form.masses), form.orders.astype(float)
        self.neutral: Any = form.neutral.ravel()  # components of the state: position and drift of a free centre
        self.centre = np.flatnonzero(self.neutral)
        self.rates = np.sqrt(form.squares) / self.omega
        self.units = np.maximum(self.rates, 1.0)
        self.damping = roots[:, None] * form.damping / roots / self.omega
        harmonic = [form.forces.T.real, form.forces.T.imag]
        self.push = np.column_stack([form.constant, *harmonic]) * roots[:, None] / self.omega**2
        towards = form.directions / roots
        self.lengths = np.linalg.norm(towards, axis=1)
        self.beta = towards / self.lengths[:, None]
        self.stiffness = form.stiffness * (self.lengths / self.omega) ** 2
        self.viscosity = form.viscosity * self.lengths**2 / self.omega
        self.bounds = np.column_stack([form.gaps, form.motions.real, form.motions.imag]) / self.lengths[:, None]
        self.turning = np.zeros((self.push.shape[1],) * 2)
        first = 1 + np.arange(len(self.orders))
        self.turning[first, first + len(self.orders)] = self.orders
        self.turning[first + len(self.orders), first] = -self.orders
        to_displacement, to_rate = form.shapes / roots / self.units, self.omega * form.shapes / roots
        none = np.zeros((self.n, self.n))
        self.physical = block_matrix(to_displacement, none, none, to_rate)
        self._phases: dict[Pushing, Phase] = {}
        self.stages: dict[Pushing, Any] = {}  # of the motion, by the stops that push: see `sampling`
        self._flights: dict[tuple[float, Pushing], tuple[Floats, Floats]] = {}

    @cached_property
    def unforced(self) -> bool:
        """Whether the load and all stops are constant over a driving period."""
        return not (self.push[:, 1:].any() or self.bounds[:, 1:].any())

    def drive(self, angle: float | Floats) -> Floats:
        """Return z at a driving angle, or one row per angle."""
        turned = np.multiply.outer(angle, self.orders)
        return np.concatenate([np.ones((*turned.shape[:-1], 1)), np.sin(turned), np.cos(turned)], axis=-1)

    def phase(self, pushing: Pushing = ()) -> Phase:
        """Return the law while some stops push."""
        if pushing not in self._phases:
            self._phases[pushing] = self._phase(pushing)
        return self._phases[pushing]

    def _phase(self, pushing: Pushing) -> Phase:
        n, stiff = self.n, sorted(pushing, key=lambda stop: -self.stiffness[stop])
        turn, along = np.linalg.qr(self.beta[stiff].T, mode="complete") if stiff else (np.eye(n), np.zeros((n, 0)))
        elastic, viscous = turn.T @ np.diag(self.rates**2) @ turn, turn.T @ self.damping @ turn
        push = turn.T @ self.push
        for stop, row in zip(stiff, along.T, strict=True):
            k, c, bound = self.stiffness[stop], self.viscosity[stop], self.bounds[stop]
            elastic, viscous = elastic + k * np.outer(row, row), viscous + c * np.outer(row, row)
            push = push + np.outer(row, k * bound + c * bound @ self.turning)
        units, none = np.sqrt(np.maximum(np.diag(elastic), 1.0)) if stiff else self.units, np.zeros((n, n))
        # y'' = -elastic y - viscous y' + push z for the state (units y, y')
        matrix = block_matrix(none, np.diag(units), -elastic / units, -viscous)
        load = np.vstack([np.zeros_like(push), push])
        whole, sizes = self.whole(matrix, load)
        fastest = float(max(units.max(), np.abs(viscous).sum(axis=1).max(), self.orders.max(initial=1.0)))
        if not stiff:
            return Phase(matrix, load, whole, sizes, fastest)
        turned = block_matrix(units[:, None] * turn.T / self.units, none, none, turn.T)
        back = block_matrix(self.units[:, None] * turn / units, none, none, turn)
        return Phase(back @ matrix @ turned, back @ load, whole, sizes, fastest, turned, back)

    def whole(self, matrix: Floats, load: Floats) -> tuple[Floats, Floats]:
        """Return the law of state and drive as one matrix, and the scales by which the drive is divided in it."""
        sizes = np.linalg.norm(load, axis=0)
        pairs = np.hypot(*sizes[1:].reshape(2, -1))  # sine and cosine of one order have one scale
        sizes = np.concatenate([sizes[:1], pairs, pairs])
        sizes[sizes == 0.0] = 1.0
        return block_matrix(matrix, load / sizes, np.zeros(load.T.shape), self.turning), sizes

    def over(self, angle: float | Floats, pushing: Pushing = ()) -> tuple[Floats, Floats]:
        """Return Phi - 1 and Psi of a flight over an angle, or of flights over many."""
        if np.ndim(angle):
            return self._over(angle, pushing)
        key = float(angle), pushing
        if key not in self._flights:
            if len(self._flights) == KEPT:
                self._flights.clear()
            self._flights[key] = self._over(*key)
        return self._flights[key]

    def _over(self, angle: float | Floats, pushing: Pushing) -> tuple[Floats, Floats]:
        phase, n = self.phase(pushing), 2 * self.n
        grown = growth(phase.whole * np.asarray(angle)[..., None, None])
        moved, driven = grown[..., :n, :n], grown[..., :n, n:] * phase.sizes
        if phase.back is None or phase.turned is None:
            return moved, driven
        with np.errstate(invalid="ignore"):
            return phase.back @ moved @ phase.turned, phase.back @ driven

    def drift(self, angle: float) -> Floats:
        """Return Phi of a free centre over an angle; impacts in between do not affect it."""
        number, within = len(self.centre), np.ix_(self.centre, self.centre)
        return np.eye(number) + self.over(angle)[0][within] if number else np.eye(0)

    def fly(self, x: Floats, begin: float, end: float, pushing: Pushing = ()) -> Floats:
        """Return the state at the angle `end` of a flight with the state x at the angle `begin`."""
        grown, driven = self.over(end - begin, pushing)
        state: Floats = x + grown @ x + driven @ self.drive(begin)
        return state

    def rate(self, x: Floats, z: Floats, pushing: Pushing) -> Floats:
        """Return x'."""
        phase = self.phase(pushing)
        rate: Floats = phase.matrix @ x + phase.load @ z
        return rate

    def energy(self, x: Floats, pushing: Pushing) -> tuple[float, Floats]:
        """Return kinetic and elastic energy of a system without load, over w^2, and its gradient by the state."""
        n, place = self.n, x[: self.n] / self.units
        gradient = np.concatenate([self.rates**2 * place, x[n:]])
        energy = 0.5 * float(x[n:] @ x[n:] + place @ gradient[:n])
        for stop in pushing:
            u, k = float(self.bounds[stop, 0] - self.beta[stop] @ place), float(self.stiffness[stop])
            energy += 0.5 * k * u * u
            gradient[:n] -= k * u * self.beta[stop]
        gradient[:n] /= self.units
        return energy, gradient

    def clearance(self, stop: int, x: Floats, z: Floats, pushing: Pushing = ()) -> tuple[float, float, float]:
        """Return the clearance of a stop over its length, and its first two derivatives."""
        beta, rate = self.beta[stop], self.rate(x, z, pushing)
        bound, turned = self.bounds[stop], self.turning @ z
        return (
            float(bound @ z - beta @ (x[: self.n] / self.units)),
            float(bound @ turned - beta @ x[self.n :]),
            float(bound @ (self.turning @ turned) - beta @ rate[self.n :]),
        )

    def closing(self, stop: int, x: Floats, z: Floats) -> float:
        """Return the first derivative of the clearance of a stop over its length."""
        return float(self.bounds[stop] @ (self.turning @ z) - self.beta[stop] @ x[self.n :])

    def contact(self, stop: int) -> tuple[Event, ...]:
        """Return the events of one contact: an impact and, if contacts last, the end of the force."""
        return (Event(stop), Event(stop, LET_GO))[: 1 + self.compliant[stop]]

    def commute(self, stop: int, other: int) -> bool:
        """Whether events of two stops at the same time have the same effect in either order."""
        lasting = self.compliant[stop] and self.compliant[other]
        return stop != other and bool(lasting or abs(self.beta[stop] @ self.beta[other]) <= ORTHOGONAL)

    def after(self, event: Event, pushing: Pushing) -> Pushing:
        """Return the stops that push after an event, given those that pushed before."""
        if not self.compliant[event.stop] or event.kind == GRAZE:
            return pushing
        others = {stop for stop in pushing if stop != event.stop}
        return tuple(sorted(others if event.kind == LET_GO else {*others, event.stop}))

    def pressed(self, x: Floats, z: Floats) -> Pushing:
        """Return the stops that push in a state: those that are pressed in and whose force does not pull."""
        pushing = []
        for stop in np.flatnonzero(self.compliant).tolist():
            u, rate, _ = self.clearance(stop, x, z)
            if u < 0.0 and u + self.lag(stop) * rate < 0.0:
                pushing.append(stop)
        return tuple(pushing)

    def rebound(self, stop: int, closing: float) -> tuple[float, float]:
        """Return r and R of an impact with that scaled clearance rate; -1, no jump, for compliant stops."""
        v, element = max(-closing * float(self.lengths[stop]) * self.omega, 0.0), self.elements[stop]
        return element.rebound(v), element.sensitivity(v)

    def placed(self, event: Event, x: Floats, z: Floats) -> Floats:
        """Return the state nearest to x in which an event happens."""
        level, row, _ = self.level(event, x, z)
        place: Floats = x - level / (row @ row) * row
        return place

    def struck(self, stop: int, x: Floats, z: Floats) -> Floats:
        """Return the state just after an impact."""
        after, closing = x.copy(), self.closing(stop, x, z)
        after[self.n :] += (1.0 + self.rebound(stop, closing)[0]) * closing * self.beta[stop]
        return after

    def impact_slopes(self, stop: int, x: Floats, z: Floats) -> tuple[Floats, Floats]:
        """Return the derivatives of the state after an impact with respect to the state before it and the angle."""
        beta, factor = self.beta[stop], 1.0 + self.rebound(stop, self.closing(stop, x, z))[1]
        by_state, by_angle = np.eye(2 * self.n), np.zeros(2 * self.n)
        by_state[self.n :, self.n :] -= factor * np.outer(beta, beta)
        by_angle[self.n :] = factor * float(self.bounds[stop] @ self.turning @ self.turning @ z) * beta
        return by_state, by_angle

    def lag(self, stop: int) -> float:
        """Return l = c/k of a stop, 0 if rigid: its force is proportional to u + l u' and ends where that is 0."""
        return float(self.viscosity[stop] / self.stiffness[stop]) if self.compliant[stop] else 0.0

    def rotation(self, angle: float | Floats) -> Floats:
        """Return the matrix by which z is multiplied over an angle, or over many."""
        turned = np.multiply.outer(angle, self.orders)
        rotation = np.zeros((*turned.shape[:-1], 1 + 2 * len(self.orders), 1 + 2 * len(self.orders)))
        sine = 1 + np.arange(len(self.orders))
        cosine = sine + len(self.orders)
        rotation[..., 0, 0] = 1.0
        rotation[..., sine, sine] = rotation[..., cosine, cosine] = np.cos(turned)
        rotation[..., sine, cosine], rotation[..., cosine, sine] = np.sin(turned), -np.sin(turned)
        return rotation

    def watched(self, event: Event) -> tuple[Floats, Floats]:
        """Return the linear forms of state and drive whose sum vanishes at an event.

        The sum is the clearance u where contact begins, and (u + l u')/(1 + l), positive for a pulling force, where the
        force begins or ends.
        """
        beta, bound, lag = self.beta[event.stop], self.bounds[event.stop], self.lag(event.stop)
        share = 0.0 if event.kind in (IMPACT, GRAZE) else lag / (1.0 + lag)
        row = np.concatenate([-(1.0 - share) * beta / self.units, -share * beta])
        return row, (1.0 - share) * bound + share * bound @ self.turning

    def level(self, event: Event, x: Floats, z: Floats) -> tuple[float, Floats, float]:
        """Return the function that vanishes at an event, and its derivatives by state and driving angle."""
        row, bound = self.watched(event)
        return float(bound @ z + row @ x), row, float(bound @ self.turning @ z)

    def touching(self, stop: int, x: Floats, z: Floats, pushing: Pushing = ()) -> tuple[tuple[float, float], bool]:
        """Return the function that vanishes where a leg grazes a stop and its rate, and whether it is the stop's pull.

        It is the clearance u of a free stop, and the pull of one that pushes or has let go while pressed in. A touch of
        zero pull and rate has u = l^2 u'', which is negative there; u has a minimum at a touch of a free stop.
        """
        u, rate, bend = self.clearance(stop, x, z, pushing)
        lag = self.lag(stop)
        pull = (u + lag * rate) / (1.0 + lag), (rate + lag * bend) / (1.0 + lag)
        pulls = stop in pushing or (lag > 0.0 and bend < 0.0)
        return (pull, True) if pulls else ((u, rate), False)

    def saltation(self, event: Event, x: Floats, z: Floats, pushing: Pushing = ()) -> Floats:
        r"""Return the saltation matrix of an event; it is infinite at a graze of a rigid stop.

        For an impact it is, in (y, y'), with the damping D and the acceleration u'' of the clearance just before,

        .. math:: \begin{pmatrix} \Gamma(r) & 0 \\
                  ((1 + r) D \beta - (1 + R) \beta u''/v)\beta^T & \Gamma(R) \end{pmatrix}, \qquad
                  \Gamma(r) = 1 - (1 + r) \beta \beta^T,

        whose determinant is r R, also for moving stops. Where a compliant stop is touched, the force jumps to c v: the
        lower left block is :math:`-c \beta \beta^T`, for every v > 0, and the other blocks are those of the identity.
        Where the force is zero nothing jumps.
        """
        n, stop = self.n, event.stop
        beta, matrix = self.beta[stop], np.eye(2 * n)
        if self.compliant[stop]:
            if event.kind == IMPACT:
                matrix[n:, :n] = -self.viscosity[stop] * np.outer(beta, beta) / self.units
            return matrix
        damping = -self.phase(pushing).matrix[n:, n:]
        _, closing, bend = self.clearance(stop, x, z, pushing)
        r, slope = self.rebound(stop, closing)
        bent = bend / -closing if closing else math.inf
        moved, turned = (np.eye(n) - (1.0 + factor) * np.outer(beta, beta) for factor in (r, slope))
        with np.errstate(invalid="ignore"):
            below = (1.0 + r) * (damping @ beta) - (1.0 + slope) * bent * beta
            matrix[n:, :n] = np.outer(below, beta) / self.units
        matrix[:n, :n] = self.units[:, None] * moved / self.units
        matrix[n:, n:] = turned
        return matrix
