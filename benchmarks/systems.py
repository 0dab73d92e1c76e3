"""Systems: what an impact costs with more modes and stops, beside one mass and beside heyoka."""

from __future__ import annotations

import time
from statistics import median
from typing import Any

import numpy as np

import vibroimpact as vi
from benchmarks.effort import Effort
from benchmarks.measure import Job, interleaved, ratio
from benchmarks.taylor import heyoka
from vibroimpact import models
from vibroimpact.backends import ImpactWindow, Measurement, get_backend
from vibroimpact.backends.modal.sweep import SystemSweep
from vibroimpact.indices import INDICES

Results = dict[str, Any]
CELLS = 64  # of a sweep, four rounds of lanes; frequencies within 2 %
K, C = np.array([[2.0, -1.0], [-1.0, 2.0]]), 0.05
GAP, RESTITUTION, OMEGA = 0.5, 0.7, 0.95
SPRING, BEAT, SLACK = 100.0, 2.6, 0.1  # of a one-sided spring: its stiffness, and the force's frequency; its gap


def one_mass(omega: float = 2.8) -> vi.ImpactSystem:
    """Return the oscillator of the other benchmarks as a system."""
    stops = [vi.Stop(direction=1, gap=0.0, restitution=0.8)]
    force = vi.Force(omega=omega, harmonics={1: 1.0})
    return vi.ImpactSystem(mass=1.0, damping=0.01, stiffness=1.0, force=force, stops=stops)


def two_masses(damping: Any = C * K) -> vi.ImpactSystem:
    """Return two masses on three springs, each in front of a stop; damping is proportional if not given."""
    stops = [
        vi.Stop(direction=[1, 0], gap=GAP, restitution=RESTITUTION),
        vi.Stop(direction=[0, -1], gap=GAP, restitution=RESTITUTION),
    ]
    force = vi.Force(omega=OMEGA, harmonics={1: [1.0, 0.0]})
    return vi.ImpactSystem(mass=np.eye(2), damping=damping, stiffness=K, force=force, stops=stops)


def one_sided_spring(gap: float = SLACK, omega: float = BEAT) -> vi.ImpactSystem:
    """Return one mass on a spring in front of another one: piecewise linear."""
    stops = [vi.Stop(direction=1, gap=gap, stiffness=SPRING)]
    force = vi.Force(omega=omega, harmonics={1: 1.0})
    return vi.ImpactSystem(mass=1.0, damping=0.1, stiffness=1.0, force=force, stops=stops)


def equal_modes(n: int) -> vi.ImpactSystem:
    """Return n equal masses on springs of their own; the first one hits, the others are carried along."""
    stops = [vi.Stop(direction=np.eye(n)[0], gap=0.0, restitution=0.8)]
    force = vi.Force(omega=2.0, harmonics={1: np.ones(n)})
    return vi.ImpactSystem(mass=np.eye(n), damping=0.01 * np.eye(n), stiffness=np.eye(n), force=force, stops=stops)


def tube(stops: int) -> vi.ImpactSystem:
    """Return three modes of a tube in supports with two sides, of which only the first one, at mid-span, is struck."""
    places = [0.5, *np.linspace(0.1, 0.9, stops // 2 - 1)]
    shapes = np.sin(np.pi * np.outer(places, [1.0, 2.0, 3.0]))
    rates = 2.0 * np.pi * 18.0 * np.array([1.0, 4.0, 9.0])
    return vi.ImpactSystem(
        mass=np.eye(3),
        damping=np.diag(0.03 * rates),
        stiffness=np.diag(rates**2),
        force=vi.Force(frequency=20.0, harmonics={1: [8.0, 3.0, 3.0]}),
        stops=[
            vi.Stop(direction=sign * row, gap=4e-3 if at else 4e-4, restitution=0.6)
            for at, row in enumerate(shapes)
            for sign in (1.0, -1.0)
        ],
    )


def sweep(system: vi.ImpactSystem, impacts: int, *indices: str, modal: bool = False) -> Job:
    """Return the job of a sweep over frequencies near the system's own, on one thread, of Std alone or of more.

    If `modal`, one mass, too, goes to the engine of systems.
    """
    cells = system.cells({"omega": np.linspace(0.99, 1.01, CELLS) * system.omega})
    measurement = Measurement(ImpactWindow(0, impacts), early_closing=False, indices=indices or ("std",))

    def by_modes() -> int:
        work = SystemSweep(cells, measurement)
        return sum(int(work.outcome(done)["impacts"].sum()) for done in work.finished(lambda: False))

    if modal:
        return by_modes
    engine = get_backend("cpu")
    return lambda: int(engine.indices(cells, measurement)["impacts"].sum())


def orbit_of_heyoka(impacts: int) -> Job:
    """Return the job of one orbit of the two masses, with a terminal event per stop."""
    names = heyoka.make_vars("x", "y", "u", "v")
    x, y, u, v = names
    found = [0]

    def turning(place: int) -> Any:
        def turn_round(ta: Any, direction: int) -> bool:
            ta.state[place] *= -RESTITUTION
            found[0] += 1
            return found[0] < impacts

        return turn_round

    force = heyoka.sin(OMEGA * heyoka.time)
    equations = [(x, u), (y, v), (u, force - 2.0 * x + y - C * (2.0 * u - v)), (v, x - 2.0 * y - C * (2.0 * v - u))]
    rising, falling = heyoka.event_direction.positive, heyoka.event_direction.negative
    events = [
        heyoka.t_event(x - GAP, callback=turning(2), direction=rising),
        heyoka.t_event(y + GAP, callback=turning(3), direction=falling),
    ]
    ta = heyoka.taylor_adaptive(equations, [0.0] * 4, t_events=events)

    def job() -> int:
        ta.time, found[0] = 0.0, 0
        ta.state[:] = 0.0
        ta.reset_cooldowns()
        ta.propagate_until(1e12)
        return found[0]

    return job


def spring_of_heyoka(contacts: int) -> Job:
    """Return the job of one orbit of the mass and its one-sided spring, with a terminal event for each of its ends."""
    x, u = heyoka.make_vars("x", "u")
    push, found = SPRING * (x - SLACK), [0]

    def touch(ta: Any, direction: int) -> bool:
        found[0] += int(ta.pars[0] == 0.0)
        ta.pars[0] = 1.0
        return found[0] < contacts

    def let_go(ta: Any, direction: int) -> bool:
        ta.pars[0] = 0.0
        return True

    rising, falling = heyoka.event_direction.positive, heyoka.event_direction.negative
    events = [
        heyoka.t_event(x - SLACK, callback=touch, direction=rising),
        heyoka.t_event(x - SLACK, callback=let_go, direction=falling),
    ]
    force = heyoka.sin(BEAT * heyoka.time) - x - 0.1 * u - heyoka.par[0] * push
    ta = heyoka.taylor_adaptive([(x, u), (u, force)], [0.0] * 2, t_events=events, pars=[0.0])

    def job() -> int:
        ta.time, ta.pars[0], found[0] = 0.0, 0.0, 0
        ta.state[:] = 0.0
        ta.reset_cooldowns()
        ta.propagate_until(1e12)
        return found[0]

    return job


def map_seconds(model: Any, **axes: Any) -> float:
    """Return the seconds of a map of 1000 impacts a cell on all cores."""
    begin = time.perf_counter()
    vi.parameter_map(model, sample_impacts=1000, transient_impacts=0, **axes)
    return time.perf_counter() - begin


def measure(effort: Effort) -> Results:
    """Return nanoseconds an impact, ratios within rounds, and the seconds of two maps."""
    cantilever = {n: models.cantilever_with_stop(modes=n) for n in (1, 4)}
    jobs: dict[str, Job] = {
        "one mass as a system": sweep(one_mass(), effort.impacts),
        "the same mass as an oscillator": sweep(vi.ImpactOscillator(omega=2.8), effort.impacts),
        "two masses, two stops": sweep(two_masses(), effort.impacts),
        "two masses, all indices": sweep(two_masses(), effort.impacts, *INDICES),
        "two masses, a dashpot each": sweep(two_masses(np.diag([0.1, 0.05])), effort.impacts),
        "one-sided spring": sweep(one_sided_spring(), effort.impacts),
        **{f"equal modes: {n}": sweep(equal_modes(n), effort.impacts, modal=True) for n in (1, 2, 4, 8)},
        **{f"cantilever, modes: {n}": sweep(beam, effort.impacts, modal=True) for n, beam in cantilever.items()},
        **{f"tube, stops: {n}, two struck": sweep(tube(n), effort.impacts) for n in (2, 4, 8, 16, 32)},
    }
    if heyoka:
        jobs["two masses, heyoka"] = orbit_of_heyoka(effort.orbit_impacts)
        jobs["one-sided spring, heyoka"] = spring_of_heyoka(effort.orbit_impacts)
    for job in jobs.values():
        job()
    cost = interleaved(jobs, effort.rounds)
    points = effort.map_points
    damper = {"slot_clearance": np.linspace(2.0, 20.0, points), "omega": np.linspace(0.8, 1.2, points)}
    gaps = {"gap": np.linspace(0.1, 1.0, points), "omega": np.linspace(0.5, 3.0, points)}
    rattling = vi.family(models.tube_in_many_supports).replace(modes=3)
    shaken = {"frequency": np.linspace(10.0, 22.0, points), "force_per_length": np.linspace(3.0, 20.0, points)}
    return {
        "cost": {name: median(found) for name, found in cost.items()},
        "over_one_mass": ratio(cost["one mass as a system"], cost["the same mass as an oscillator"]),
        "heyoka_over_ours": ratio(cost["two masses, heyoka"], cost["two masses, two stops"]) if heyoka else None,
        "heyoka_over_spring": ratio(cost["one-sided spring, heyoka"], cost["one-sided spring"]) if heyoka else None,
        "cantilever_4_over_1": ratio(cost["cantilever, modes: 4"], cost["cantilever, modes: 1"]),
        "modes_8_over_1": ratio(cost["equal modes: 8"], cost["equal modes: 1"]),
        "damper_map_seconds": map_seconds(vi.family(damper_of), **damper),
        "two_sided_map_seconds": map_seconds(vi.family(two_sided_of), **gaps),
        "spring_map_seconds": map_seconds(vi.family(one_sided_spring), **gaps),
        "stops_16_over_2": ratio(cost["tube, stops: 16, two struck"], cost["tube, stops: 2, two struck"]),
        "tube_map_seconds": map_seconds(rattling, **shaken),
        "points": points,
    }


def damper_of(slot_clearance: float = 10.0, omega: float = 1.0) -> vi.ImpactSystem:
    """Return a mass with a free particle in a slot."""
    stops = [vi.Stop(direction=[sign, -sign], gap=slot_clearance, restitution=0.8) for sign in (1, -1)]
    force = vi.Force(omega=omega, harmonics={1: [1.0, 0.0]})
    damping, stiffness = np.diag([0.02, 0.0]), np.diag([1.0, 0.0])
    return vi.ImpactSystem(mass=np.diag([1.0, 0.1]), damping=damping, stiffness=stiffness, force=force, stops=stops)


def two_sided_of(gap: float = 0.5, omega: float = 2.0) -> vi.ImpactSystem:
    """Return one mass between two stops."""
    stops = [vi.Stop(direction=sign, gap=gap, restitution=0.6) for sign in (1, -1)]
    force = vi.Force(omega=omega, harmonics={1: 1.0})
    return vi.ImpactSystem(mass=1.0, damping=0.05, stiffness=1.0, force=force, stops=stops)
