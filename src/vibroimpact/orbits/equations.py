r"""The equations of a period-n impact-p orbit, and its stability.

The unknowns are the turns s_i (times of the impacts in driving periods) and the velocities v_i just before them, i = 1
... p, with s_{p+1} = s_1 + n. Flight i leaves the stop at s_i with velocity -r v_i and must come back at s_{i+1} with
v_{i+1}:

    u_i(s_{i+1}) = 0,    -u_i'(s_{i+1}) = v_{i+1}.

They stay smooth where the orbit would penetrate the stop, so a branch can be continued through a graze.

Each flight is known in closed form; one formula covers any damping, at resonance and near it. The gap u = g - y obeys m
u'' + c u' + k u = k g - f sin(w t). With the impulse response q,

    u(tau) = q u0' + (k g/m) E(0) - (f/m) Im(e^{i angle} E(i w)),
    E(nu)  = integral of q(tau - s) e^{nu s} over the flight, from u = 0.

E is the divided difference of exp(tau x) over the two rates of free motion and nu, so no term becomes infinite where
two of the three coincide, and short flights are as accurate as long ones.

Stability follows from the product over all flights of the flow and the impact's saltation matrix (theory, eq. 5.1),

    [ -r, 0; (a+ + r a-)/v, -r ],   a-, a+ = y'' just before and after the impact of velocity v

(P. C. Müller, Chaos, Solitons & Fractals 5 (1995) 1671-1681; the engine uses the same for its tangent vectors), which
is infinite at a graze, v = 0 (A. B. Nordmark, J. Sound Vib. 145 (1991) 279-297).

With one impact the equations have a closed form. Over nT the gap returns to zero and the velocity to v if, with
E0 = E(0) and E = E(i w),

    (f/m) Im(e^{i psi} E)          = r q v + (k g/m) E0,
    (f/m) Im(e^{i psi} (q + i w E)) = (1 + r q') v + (k g/m) q.

Two linear equations give sin psi and cos psi as linear functions of v; sin^2 + cos^2 = 1 is a quadratic in v. This is
the usual (alpha^2 + beta^2/w^2) v^2 + 2 alpha g v + g^2 - R^2 = 0 (S. W. Shaw and P. J. Holmes, J. Sound Vib. 90 (1983)
129-155), but none of its terms becomes infinite at resonance.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.model.oscillator import ImpactOscillator
from vibroimpact.motion import cycle_name
from vibroimpact.parameters import counted

Floats = NDArray[np.float64]
Parameters = Sequence[float]  # m, c, k, f, w, r, g

TURN = 2.0 * math.pi
NEAR = 0.5  # of rate times duration: if nodes are closer, the divided difference is expanded in a series
STRIDE = 0.15  # radians of the fastest rate between two samples of a flight
FEWEST_SAMPLES, MOST_SAMPLES = 16, 1 << 15  # number of samples of one flight, at most
# Largest difference between equal orbits, and between repetitions of a cycle: relative to the fastest impact, to the
# driving period, and in sine and cosine of the driving angle. Newton's method leaves 1e-14 times the condition number.
SAME = 1e-7
VANISHED = 1e-12  # relative: a response this small is rounding
BOUNDLESS = 1e12  # of V: larger velocities are treated as infinite
UNFORCED = "unforced: impacts and damping dissipate energy, and nothing supplies it"
RESONANT = "undamped, without loss and in resonance: impact velocities grow without bound"


def sinhc(z2: complex) -> complex:
    """Return sinh(z)/z of z squared, for |z| < 1."""
    total = term = 1.0 + 0.0j
    for j in range(1, 10):
        term *= z2 / ((2 * j) * (2 * j + 1))
        total += term
    return total


class Flight:
    """The motion of one oscillator away from its stop."""

    def __init__(
        self, mass: float, damping: float, stiffness: float, amplitude: float, omega: float, gap: float
    ) -> None:
        self.damp, self.stiff, self.drive = damping / mass, stiffness / mass, amplitude / mass
        self.omega, self.gap = omega, gap
        self.preload = self.stiff * gap
        self.split2 = 0.25 * self.damp * self.damp - self.stiff
        # Rates of free motion, the slower first; it is computed from their product, which avoids cancellation.
        fast = -(0.5 * self.damp + cmath.sqrt(self.split2))
        self.rates = self.stiff / fast, fast

    @property
    def fastest(self) -> float:
        """The fastest rate of the motion in 1/s."""
        return max(abs(self.omega), abs(self.rates[1]))

    def kick(self, tau: float) -> tuple[float, float]:
        """Return displacement q and velocity q' at tau after a unit impulse (a velocity of 1 at tau = 0)."""
        z2 = self.split2 * tau * tau
        if abs(z2) < NEAR * NEAR:
            fade, shape = math.exp(-0.5 * self.damp * tau), tau * sinhc(z2).real
            # cosh z = 1 + 2 sinh^2(z/2)
            half = sinhc(0.25 * z2).real
            return fade * shape, fade * (1.0 + 0.5 * z2 * half * half - 0.5 * self.damp * shape)
        slow, fast = self.rates
        a, b = cmath.exp(slow * tau), cmath.exp(fast * tau)
        return ((a - b) / (slow - fast)).real, ((slow * a - fast * b) / (slow - fast)).real

    def driven(self, nu: complex, tau: float, q: float, dq: float) -> complex:
        """Return E(nu), the response from rest to the force e^{nu t}, given q and q' at tau."""
        slow, fast = self.rates
        if abs(nu - fast) < abs(nu - slow):
            slow, fast = fast, slow
        if abs(nu - slow) * abs(tau) >= NEAR:
            return (cmath.exp(nu * tau) - dq - (self.damp + nu) * q) / ((nu + self.damp) * nu + self.stiff)
        if abs(nu - fast) * abs(tau) >= 2.0 * NEAR:
            half = 0.5 * (nu - slow) * tau
            near = tau * cmath.exp(0.5 * (nu + slow) * tau) * sinhc(half * half)
            far = (cmath.exp(nu * tau) - cmath.exp(fast * tau)) / (nu - fast)
            return (near - far) / (slow - fast)
        return self._close_nodes(nu, tau)

    def _close_nodes(self, nu: complex, tau: float) -> complex:
        """Return the divided difference from its series about the mean of the nodes, whose symmetric sums are known."""
        mean = (nu - self.damp) / 3.0
        # About the mean the nodes are roots of x^3 + e2 x - e3.
        e2 = (self.stiff - self.damp * nu - 3.0 * mean * mean) * tau * tau
        e3 = (nu - mean) * (mean * mean + self.damp * mean + self.stiff) * tau * tau * tau
        h = [1.0 + 0.0j, 0.0j, -e2]
        for _ in range(18):
            h.append(e3 * h[-3] - e2 * h[-2])
        total, factorial = 0.0j, 1.0
        for j, term in enumerate(h):
            factorial *= max(j, 1)
            total += term / (factorial * (j + 1) * (j + 2))
        return total * tau * tau * cmath.exp(mean * tau)

    def responses(self, tau: float) -> tuple[float, float, float, complex, complex]:
        """Return q, q' and E(0) at tau, then E(i w) and its rate: the response to the force e^{i w t}."""
        q, dq = self.kick(tau)
        driven = self.driven(1j * self.omega, tau, q, dq)
        return q, dq, self.driven(0.0, tau, q, dq).real, driven, q + 1j * self.omega * driven

    def after(self, angle: float, rate: float, tau: float) -> tuple[float, float]:
        """Return gap and rate at tau after the mass leaves the stop with the given rate at the given driving angle."""
        q, dq, steady, driven, hurried = self.responses(tau)
        turn = self.drive * cmath.exp(1j * angle)
        return (
            q * rate + self.preload * steady - (turn * driven).imag,
            dq * rate + self.preload * q - (turn * hurried).imag,
        )

    def slopes(self, angle: float, rate: float, tau: float) -> tuple[tuple[float, float], ...]:
        """Return gap and rate at tau, and their derivatives with respect to angle, initial rate, and tau."""
        q, dq, steady, driven, hurried = self.responses(tau)
        turn = self.drive * cmath.exp(1j * angle)
        moved, hurried = turn * driven, turn * hurried
        gap = q * rate + self.preload * steady - moved.imag
        speed = dq * rate + self.preload * q - hurried.imag
        bend = self.bend(angle + self.omega * tau, gap, speed)
        return (gap, speed), (-moved.real, -hurried.real), (q, dq), (speed, bend)

    def bend(self, angle: float, gap: float, rate: float) -> float:
        """Return the second derivative of the gap."""
        return self.preload - self.drive * math.sin(angle) - self.damp * rate - self.stiff * gap

    def sampled(self, angle: float, rate: float, tau: float) -> tuple[Floats, Floats, Floats]:
        """Return times, gaps and rates along a flight from the stop, dense enough to show every near-miss."""
        number = min(MOST_SAMPLES, max(FEWEST_SAMPLES, math.ceil(abs(tau) * self.fastest / STRIDE)))
        step = tau / number
        q, dq, steady, driven, hurried = self.responses(step)
        sine, cosine = math.sin(self.omega * step), math.cos(self.omega * step)
        p, f, g = dq + self.damp * q, self.drive, self.preload
        # x = (u, u', sin, cos, 1) is multiplied by one matrix per step; doubling fills the table.
        hop: Floats = np.array(
            [
                [p, q, -f * driven.real, -f * driven.imag, g * steady],
                [-self.stiff * q, dq, -f * hurried.real, -f * hurried.imag, g * q],
                [0.0, 0.0, cosine, sine, 0.0],
                [0.0, 0.0, -sine, cosine, 0.0],
                [0.0, 0.0, 0.0, 0.0, 1.0],
            ]
        )
        table: Floats = np.array([[0.0, rate, math.sin(angle), math.cos(angle), 1.0]]).T
        while table.shape[1] <= number:
            table = np.concatenate([table, hop @ table], axis=1)
            hop = hop @ hop
        times = np.asarray(step * np.arange(number + 1), dtype=np.float64)
        return times, table[0, : number + 1], table[1, : number + 1]


def double_turns(slopes: Floats, bends: Floats, step: float) -> NDArray[np.int64]:
    """Return the samples before steps in which a slope may change its sign twice: its tangents meet beyond zero.

    A mass that leaves the stop slowly while the force still presses it may turn back and away within one step.
    """
    sides = np.where(slopes[:-1] < 0.0, -1.0, 1.0)
    first, last, bend, other = sides * slopes[:-1], sides * slopes[1:], sides * bends[:-1], sides * bends[1:]
    found = np.flatnonzero((last >= 0.0) & (bend < 0.0) & (other > 0.0))
    first, last, bend, other = first[found], last[found], bend[found], other[found]
    return found[first + bend * (last - first - step * other) / (bend - other) < 0.0]


def parameters_of(osc: ImpactOscillator) -> list[float]:
    """Return m, c, k, f, w, r, g."""
    return [osc.mass, osc.damping, osc.stiffness, osc.amplitude, osc.omega, osc.restitution, osc.gap]


def fastest_of(osc: ImpactOscillator, velocities: Floats) -> float:
    """Return the velocity scale of an orbit in m/s."""
    return max(float(np.abs(velocities).max()), osc.velocity_scale)


def flight_of(parameters: Parameters) -> Flight:
    """Return the free flight of an oscillator from its parameters."""
    m, c, k, f, w, _, g = parameters
    return Flight(m, c, k, f, w, g)


@dataclass(frozen=True)
class Cycle:
    """The equations of one (n, p) type: n driving periods, p impacts; unknowns z = (s_1 ... s_p, v_1 ... v_p)."""

    n_periods: int
    n_impacts: int

    @property
    def name(self) -> str:
        """The (n, p) type in words."""
        return cycle_name(self.n_periods, self.n_impacts)

    def span(self, z: Floats, i: int) -> tuple[float, float]:
        """Return the turns at which flight i begins and ends."""
        return float(z[i]), float(z[i + 1] if i + 1 < self.n_impacts else z[0] + self.n_periods)

    def in_order(self, turns: Floats) -> bool:
        """Whether the impacts follow one another, the first of the next cycle included."""
        return bool((np.diff(np.append(turns[: self.n_impacts], turns[0] + self.n_periods)) > 0.0).all())

    def takeoff(self, parameters: Parameters, z: Floats, i: int) -> tuple[float, float, float]:
        """Return the driving angle and the rate at which flight i leaves the stop, and its duration in s."""
        begin, end = self.span(z, i)
        return TURN * begin, parameters[5] * float(z[self.n_impacts + i]), (end - begin) * TURN / parameters[4]

    def scales(self, osc: ImpactOscillator, speed: float) -> tuple[Floats, Floats]:
        """Return the scales of the residuals (m, m/s) and of the unknowns (turns, m/s) for an orbit of that speed."""
        length = speed / max(osc.natural_frequency, osc.omega)
        return np.repeat([length, speed], self.n_impacts), np.repeat([1.0, speed], self.n_impacts)

    def misses(self, parameters: Parameters, z: Floats) -> Floats:
        """Return the residuals of all flights at their impacts: p gaps, then p velocities."""
        p, flight = self.n_impacts, flight_of(parameters)
        ends = [flight.after(*self.takeoff(parameters, z, i)) for i in range(p)]
        late = [-rate - float(z[p + (i + 1) % p]) for i, (_, rate) in enumerate(ends)]
        return np.array([gap for gap, _ in ends] + late)

    def linearised(self, parameters: Parameters, z: Floats) -> tuple[Floats, Floats]:
        """Return the residuals and their derivative: a flight depends only on its two ends and its initial velocity."""
        p, flight, period = self.n_impacts, flight_of(parameters), TURN / parameters[4]
        misses, matrix = np.zeros(2 * p), np.zeros((2 * p, 2 * p))
        for i in range(p):
            (gap, speed), by_angle, by_rate, by_time = flight.slopes(*self.takeoff(parameters, z, i))
            after = (i + 1) % p
            misses[i], misses[p + i] = gap, -speed - float(z[p + after])
            for row, sign, j in ((i, 1.0, 0), (p + i, -1.0, 1)):
                matrix[row, i] += sign * (TURN * by_angle[j] - period * by_time[j])
                matrix[row, after] += sign * period * by_time[j]
                matrix[row, p + i] += sign * parameters[5] * by_rate[j]
            matrix[p + i, p + after] -= 1.0
        return misses, matrix

    def determinant(self, parameters: Parameters) -> float:
        """Return the determinant of the cycle's Jacobian, r^(2p) exp(-c n T/m)."""
        m, c, _, _, w, r, _ = parameters
        return r ** (2 * self.n_impacts) * math.exp(-c * self.n_periods * TURN / (w * m))

    def trace(self, parameters: Parameters, z: Floats) -> float:
        """Return the trace of the cycle's Jacobian in (y, y'), the product of flows and saltation matrices."""
        p, flight, r = self.n_impacts, flight_of(parameters), parameters[5]
        a, b, c, d = 1.0, 0.0, 0.0, 1.0
        for i in range(p):
            begin, end = self.span(z, i)
            q, dq = flight.kick((end - begin) * TURN / parameters[4])
            stay, back = dq + flight.damp * q, -flight.stiff * q
            a, b, c, d = stay * a + q * c, stay * b + q * d, back * a + dq * c, back * b + dq * d
            v = float(z[p + (i + 1) % p])
            # `recognition.separations` has the same saltation; its forces round as (f sin - k g)/m, not as here.
            # y'' = -u'' just before (y' = v) and just after (y' = -r v).
            before, after = -flight.bend(TURN * end, 0.0, -v), -flight.bend(TURN * end, 0.0, r * v)
            kick = (after + r * before) / v if v else math.inf
            a, b, c, d = -r * a, -r * b, kick * a - r * c, kick * b - r * d
        return a + d

    def multipliers(self, parameters: Parameters, z: Floats) -> tuple[complex, complex]:
        """Return the Floquet multipliers, the larger first; for a complex pair, that with positive imaginary part."""
        determinant = self.determinant(parameters)
        half = 0.5 * self.trace(parameters, z)
        if not math.isfinite(half):
            return complex(math.inf), 0j  # at a graze the Jacobian is singular
        split = half * half - determinant
        if split < 0.0:
            side = math.sqrt(-split)
            return complex(half, side), complex(half, -side)
        large = half + math.copysign(math.sqrt(split), half)
        # The smaller one is computed as a quotient, which avoids cancellation.
        return complex(large), complex(determinant / large if large else 0.0)


def turns_of(
    osc: ImpactOscillator, n_periods: int, phases: Sequence[float], velocities: Sequence[float]
) -> list[float]:
    """Return the times of the impacts of a cycle in driving periods: the whole periods in each flight that fit best."""
    parameters, turns = parameters_of(osc), list(phases[:1])
    for at in range(len(phases) - 1):
        ahead = (phases[at + 1] - phases[at]) % 1.0

        def miss(whole: int, at: int = at, ahead: float = ahead) -> float:
            pair = np.array([turns[at], turns[at] + ahead + whole, velocities[at], velocities[at + 1]])
            gap, _, speed, _ = Cycle(n_periods, 2).misses(parameters, pair)
            return float(abs(gap) * osc.natural_frequency + abs(speed))

        turns.append(turns[at] + ahead + min(range(n_periods + 1), key=miss))
    return turns


def impact_1_orbits(osc: ImpactOscillator, n_periods: int) -> tuple[list[Floats], str]:
    """Return (turns, velocity) of every period-n impact-1 orbit, the faster first, and the reason if there is none."""
    if osc.amplitude == 0.0:
        return [], _unforced(osc)
    flight, tau = flight_of(parameters_of(osc)), n_periods * osc.period
    q, dq, steady, driven, velocity = flight.responses(tau)
    if abs(driven) <= VANISHED * tau / max(osc.omega, osc.natural_frequency):
        return [], (
            f"undamped, and {n_periods} driving period{'s are' if n_periods > 1 else ' is'} a whole number of free "
            "periods: the force does no work over a flight and cannot make up for the loss at impact"
        )
    force, r, preload = osc.amplitude / osc.mass, osc.restitution, osc.stiffness * osc.gap / osc.mass
    matrix = force * np.array([[driven.real, driven.imag], [velocity.real, velocity.imag]])
    # (sin psi, cos psi) = slope v + shift
    slope = np.asarray(np.linalg.solve(matrix, [r * q, 1.0 + r * dq]), dtype=np.float64)
    shift = np.linalg.solve(matrix, [preload * steady, preload * q])
    size = math.hypot(*slope)
    parts = slope @ shift, slope[0] * shift[1] - slope[1] * shift[0]
    along, across = (float(part) / size if size else math.inf for part in parts)
    if not abs(across) <= 1.0:
        return [], _nowhere(osc, slope, n_periods)
    # The roots of |slope v + shift| = 1, across being what v does not change, without cancellation.
    reach = math.copysign(math.sqrt((1.0 - across) * (1.0 + across)), along)
    low = -(along + reach)
    roots = {low / size: -reach, (float(shift @ shift) - 1.0) / (low * size) if low else 0.0: reach}
    orbits = []
    for v in sorted(roots, reverse=True):
        if 0.0 < v < BOUNDLESS * osc.velocity_scale:
            sine, cosine = (slope * roots[v] + np.array([-slope[1], slope[0]]) * across) / size
            orbits.append(np.array([math.atan2(sine, cosine) / TURN % 1.0, v]))
    return orbits, "" if orbits else _nowhere(osc, slope, n_periods)


def _unforced(osc: ImpactOscillator) -> str:
    if osc.restitution == 1.0 and osc.damping == 0.0:
        return "unforced and without loss: each motion with impacts is one of a continuum; give its `energy`"
    return UNFORCED


def _nowhere(osc: ImpactOscillator, slope: Floats, n_periods: int) -> str:
    if float(np.abs(slope).max()) * osc.velocity_scale < 1.0 / BOUNDLESS:
        return RESONANT
    reach = osc.steady_amplitude
    far = f", beyond the steady amplitude {reach:.6g} m" if abs(osc.gap) > reach else ""
    return f"no velocity > 0 returns to itself after {counted(n_periods, 'period')}: the gap is {osc.gap:.6g} m{far}"
