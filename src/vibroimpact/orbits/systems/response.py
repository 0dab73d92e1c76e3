r"""Amplitude, mean, rms and first harmonic of a motion along one direction, over the legs of a cycle.

In a leg, a coordinate, the displacement of a point and a clearance are power series about every 0.15 rad of the fastest
rate that has not decayed. Their turning points are roots between these places; integrals are those of Gauss and
Legendre with three nodes between neighbouring places, whose error is below 1e-11 of the fastest mode's part.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from vibroimpact.backends.base import phase_of
from vibroimpact.cells import Floats
from vibroimpact.model import State
from vibroimpact.model.force import turning_values
from vibroimpact.model.modal import ModalForm
from vibroimpact.model.points import observed
from vibroimpact.model.system import ImpactSystem
from vibroimpact.orbits.cycle import Leg, cycle_of
from vibroimpact.orbits.systems.sampling import TERMS, Samples, sampled, turning_points

PLACES, WEIGHTS = np.polynomial.legendre.leggauss(3)


class Response(NamedTuple):
    """How far a motion swings along a direction, in m, over a whole number of driving periods.

    Parameters
    ----------
    amplitude : float
        Half the difference between the largest and the smallest value.
    rms : float
        Root of the mean square, with the mean.
    mean : float
        Mean over time.
    harmonic_amplitude, harmonic_phase : float
        Amplitude and phase of the part Y sin(wt + phase) at the driving frequency; the phase is in rad, -pi to pi, and
        -pi/2 behind a force sin(wt) at phase resonance; it is NaN if the amplitude is below 1e-12 of the rms.
    """

    amplitude: float
    rms: float
    mean: float
    harmonic_amplitude: float
    harmonic_phase: float


def over(legs: Iterable[tuple[float, Leg]], form: Floats) -> Response:
    """Return the response over legs, each with the driving angle at its beginning."""
    lowest, highest, length, integrals = math.inf, -math.inf, 0.0, np.zeros(3, complex)
    for begin, leg in legs:
        if leg.duration == 0.0:
            continue
        for samples in sampled(leg):
            (series,) = samples.series(form[None])
            along = samples.along(series[:3])
            lowest = min(lowest, along[0].min(), turning_points(series, samples, along)[1].min(initial=math.inf))
            highest = max(highest, along[0].max(), -turning_points(-series, samples, -along)[1].min(initial=math.inf))
            integrals += _integrals(begin, samples, series)
        length += leg.duration
    mean, square, harmonic = integrals / length
    phasor = 2j * harmonic  # y = Im(Y e^{i wt})
    rms = math.sqrt(max(square.real, 0.0))
    swing, phase = 0.5 * float(highest - lowest), float(phase_of(phasor, rms))
    return Response(swing, rms, float(mean.real), float(abs(phasor)), phase)


def _integrals(begin: float, samples: Samples, series: Floats) -> Any:
    """Return the integrals of y, y^2 and y e^{-i wt} over the angle of a leg."""
    step = samples.step
    offsets = 0.5 * step * (1.0 + PLACES)
    values = samples.along(offsets[:, None] ** np.arange(TERMS) @ series)[:, :-1]
    turned = np.exp(-1j * (begin + samples.angles[:-1] + offsets[:, None]))
    rows = np.stack([values.astype(complex), values**2, values * turned])
    return 0.5 * step * (rows.sum(axis=-1) @ WEIGHTS)


def response_of(orbit: Any, *, of: Any = None) -> Response:
    """Return amplitude, mean, rms and harmonic of a point or a coordinate on a periodic orbit.

    Parameters
    ----------
    orbit : Orbit
        An orbit that rests at no stop.
    of : str, int or sequence of n float, optional
        The name of a point, or of a stop (then its clearance), the number of a coordinate from 0 on, or factors of all
        coordinates. None means the only coordinate or point.

    Returns
    -------
    Response
        `amplitude`, `rms`, `mean` and `harmonic_amplitude` in m, `harmonic_phase` in rad.

    Raises
    ------
    ValueError
        The orbit rests at a stop, or `of` does not name anything in its model.

    Notes
    -----
    The accuracy is that of the orbit: turning points are roots to rounding, and integrals have a relative error of
    1e-11. The cost is that of the test whether the orbit is admissible.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> (orbit,) = vi.find_orbit(vi.ImpactOscillator(damping=0.1, omega=2.5))
    >>> response = vi.response_of(orbit)
    >>> f"{response.mean:.6f} m, plus and minus {response.amplitude:.6f} m"
    '-0.455758 m, plus and minus 0.394981 m'
    """
    (cycle, unknown), (row, stop) = cycle_of(orbit), observed(orbit.system, of)
    flow = cycle.flow
    bounds = np.zeros(flow.bounds.shape[1]) if stop is None else flow.bounds[stop] * flow.lengths[stop]
    legs = [(float(unknown[i]), cycle.leg(unknown, i)) for i in range(len(cycle.events))]
    return over(legs, np.append(row @ flow.physical[: flow.n], bounds))


class Steady(NamedTuple):
    """A motion without contact as a Fourier series: mean and complex amplitudes of modes, y = Im(Y_h e^{i h wt})."""

    form: ModalForm
    mean: Floats
    phasors: Any

    @property
    def start(self) -> State:
        """The state at time 0."""
        form, turns = self.form, self.form.omega * self.form.orders
        return State(
            form.shapes @ (self.mean + self.phasors.imag.sum(axis=0)), form.shapes @ (turns @ self.phasors.real)
        )

    def along(self, row: Floats, stop: int | None = None) -> tuple[float, Any]:
        """Return mean and phasors along a row over the coordinates, or of the clearance of a stop."""
        modal = row @ self.form.shapes
        mean, phasors = float(modal @ self.mean), self.phasors @ modal
        if stop is None:
            return mean, phasors
        return mean + float(self.form.gaps[stop]), phasors + self.form.motions[stop]

    def clearances(self) -> Floats:
        """Return the least clearance of each stop."""
        form = self.form
        return np.array(
            [
                extremes(gap - alpha @ self.mean, motion - self.phasors @ alpha, form.orders)[0]
                for gap, alpha, motion in zip(form.gaps, form.directions, form.motions, strict=True)
            ]
        )

    def response(self, row: Floats, stop: int | None = None) -> Response:
        """Return the response along a row over the coordinates, or of the clearance of a stop."""
        mean, phasors = self.along(row, stop)
        lowest, highest = extremes(mean, phasors, self.form.orders)
        first = complex(phasors[self.form.orders == 1].sum())
        rms = math.sqrt(mean**2 + 0.5 * float((np.abs(phasors) ** 2).sum()))
        return Response(0.5 * (highest - lowest), rms, mean, abs(first), float(phase_of(first, rms)))


def steady_motion(system: ImpactSystem) -> Steady | None:
    """Return the steady motion without contact; None if there is none, or if it is not the only one."""
    form = system.modal()
    static = np.diag(form.squares).astype(complex)
    parts = []
    for order, force in ((0, form.constant), *zip(form.orders.tolist(), form.forces, strict=True)):
        rate = order * form.omega
        impedance = static - rate**2 * np.eye(len(static)) + 1j * rate * form.damping
        if np.linalg.matrix_rank(impedance) < len(impedance):
            return None
        parts.append(np.linalg.solve(impedance, force))
    return Steady(form, parts[0].real, np.array(parts[1:]).reshape(-1, len(static)))


def extremes(mean: float, phasors: Any, orders: Any) -> tuple[float, float]:
    """Return the smallest and the largest value of a mean and harmonics Im(Y_h e^{i h x})."""
    values = turning_values(orders, phasors)[1]
    return float(mean + values.min()), float(mean + values.max())
