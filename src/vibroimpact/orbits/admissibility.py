"""Check that the mass can move along an orbit: certified contacts of the engine, near-misses in closed form."""

from __future__ import annotations

import numpy as np

from vibroimpact.backends import Cells, ImpactWindow, Measurement, Samples, get_backend
from vibroimpact.kernels.cell import MOST
from vibroimpact.kernels.flight import REACH
from vibroimpact.model.oscillator import ImpactOscillator
from vibroimpact.orbits.equations import SAME, TURN, Cycle, Flight, Floats, fastest_of, flight_of, parameters_of
from vibroimpact.orbits.events import Nearest

ROUNDING = 1e-12  # relative to the orbit's size: the sign of a smaller gap is undecided
LOWEST = 3  # number of sampled near-misses that are refined


def contacts(osc: ImpactOscillator, phases: Floats, velocities: Floats, following: int) -> list[Samples]:
    """Return, for an impact at each phase and velocity, that impact and those that follow it."""
    cells: Cells = osc.cells({}).copies(len(phases)).striking(0, velocities, phases)
    cells = cells.replace(phase=np.minimum(cells["phase"], 1.0 - 2.0**-53))  # a phase just below 1 may round up to 1
    return get_backend("cpu").samples(cells, Measurement(ImpactWindow(0, following + 1)))


def orbit_size(osc: ImpactOscillator, z: Floats) -> float:
    """Return the length scale of the orbit in m, with which gaps along it are compared."""
    fastest = max(osc.omega, osc.natural_frequency)
    return float(np.abs(z[len(z) // 2 :]).max()) / fastest + osc.velocity_scale / osc.natural_frequency


def nearest_misses(osc: ImpactOscillator, cycle: Cycle, z: Floats) -> list[Nearest]:
    """Return the closest near-miss of each flight that has one."""
    flight, size, misses = flight_of(parameters_of(osc)), orbit_size(osc, z), []
    for i in range(cycle.n_impacts):
        begin, end = cycle.span(z, i)
        if end <= begin:
            continue
        rate, tau = osc.restitution * float(z[cycle.n_impacts + i]), (end - begin) * osc.period
        angle = TURN * begin
        times, gaps, rates = flight.sampled(angle, rate, tau)
        turns = np.flatnonzero((rates[:-1] < 0.0) & (rates[1:] >= 0.0))
        likely = turns[np.argsort(np.minimum(gaps[turns], gaps[turns + 1]))[:LOWEST]]
        minima = [_minimum(flight, angle, rate, float(times[j]), float(times[j + 1])) for j in likely]
        if minima:
            time, gap = min(minima, key=lambda minimum: minimum[1])
            misses.append(Nearest(i, begin + time / osc.period, gap / size))
    return misses


def closest(osc: ImpactOscillator, cycle: Cycle, z: Floats) -> Nearest | None:
    """Return the near-miss of the lowest clearance, if there is one."""
    return min(nearest_misses(osc, cycle, z), key=lambda miss: miss.margin, default=None)


def _minimum(flight: Flight, angle: float, rate: float, low: float, high: float) -> tuple[float, float]:
    """Return the time between two times at which the rate rises through zero, and the gap there (bracketed Newton)."""
    time = 0.5 * (low + high)
    for _ in range(60):
        gap, slope = flight.after(angle, rate, time)
        low, high = (time, high) if slope < 0.0 else (low, time)
        bend = flight.bend(angle + flight.omega * time, gap, slope)
        better = time - slope / bend if bend > 0.0 else low
        if not low < better < high:
            better = 0.5 * (low + high)
        if abs(better - time) <= 1e-15 * abs(time) or high - low <= 1e-15 * high:
            break
        time = better
    return time, flight.after(angle, rate, time)[0]


def objection(osc: ImpactOscillator, cycle: Cycle, z: Floats) -> str:
    """Return the reason why the mass cannot move along this orbit; empty if it can.

    The engine follows each flight from its impact: its next certified contact must be the orbit's next impact. If a
    near-miss or an impact is within rounding of a graze, the closed form decides.
    """
    p = cycle.n_impacts
    speeds, fastest = z[p:], fastest_of(osc, z[p:])
    away = np.flatnonzero(speeds < -ROUNDING * fastest)
    if away.size:
        i = int(away[0])
        return f"impact {i + 1} would have velocity {speeds[i]:.3g} m/s, away from the stop"
    if speeds.min() <= ROUNDING * fastest:
        return _beyond(osc, cycle, z)
    turns = [end - begin for begin, end in (cycle.span(z, i) for i in range(p))]
    a_turn = TURN / REACH * flight_of(parameters_of(osc)).fastest / osc.omega
    if max(turns) * a_turn > MOST:
        i = int(np.argmax(turns))
        return (
            f"the flight after impact {i + 1} needs about {turns[i] * a_turn:.1g} certified steps: it was not checked"
        )
    for i, samples in enumerate(contacts(osc, z[:p], speeds, 1)):
        begin, end = cycle.span(z, i)
        wrong = _first_difference(samples, end - begin, float(speeds[(i + 1) % p]), fastest)
        if wrong:
            graze = closest(osc, cycle, z)
            return "" if graze and abs(graze.margin) <= ROUNDING else f"after impact {i + 1} {wrong}"
    return ""


def _beyond(osc: ImpactOscillator, cycle: Cycle, z: Floats) -> str:
    """Return a sentence that says where a flight penetrates the stop between its ends; empty if none does."""
    for miss in nearest_misses(osc, cycle, z):
        if miss.margin < -ROUNDING:
            return f"after impact {miss.flight + 1} the mass would penetrate the stop at phase {miss.turns % 1.0:.6g}"
    return ""


def _first_difference(samples: Samples, turns: float, velocity: float, largest: float) -> str:
    """Return a sentence on what the engine finds before the impact expected `turns` later; empty if nothing."""
    if len(samples.rest_begin):
        return f"the mass comes to rest at the stop at phase {samples.rest_begin[0, 1]:.6g}"
    if len(samples.impact_phase) < 2:
        return "the mass never reaches the stop again"
    later = (samples.impact_periods[1] - samples.impact_periods[0]) + (
        samples.impact_phase[1] - samples.impact_phase[0]
    )
    if abs(later - turns) <= SAME * max(turns, 1.0) and abs(samples.impact_velocity[1] - velocity) <= SAME * largest:
        return ""
    return (
        f"the mass first hits the stop at phase {samples.impact_phase[1]:.6g} "
        f"with {samples.impact_velocity[1]:.3g} m/s, before or after the orbit's next impact"
    )
