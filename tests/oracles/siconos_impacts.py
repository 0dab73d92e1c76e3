"""The first impacts of random systems by Siconos, written to tests/data/siconos.json.

`python3 tests/oracles/siconos_impacts.py` runs with the system's Python, for which Debian has `python3-siconos`. It
is an independent code with an event-driven mode: an integrator of variable order with root finding, and complementarity
problems for impacts and closed stops. Its linear systems have constant forces only, so each harmonic is a pair of
further coordinates, undamped oscillators of frequency h w that pull at the others.
"""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

TABLE = Path(__file__).parents[1] / "data" / "siconos.json"
SYSTEMS, IMPACTS = 50, 20
TOLERANCES = {"rtol": 1e-13, "atol": 1e-13, "events": 1e-11}
WEAK = 1e-3  # of the fastest impact: slower ones are left out, as how many there are depends on tolerances


def drawn(rng: np.random.Generator, number: int) -> dict[str, Any]:
    """Return a random system as plain lists: the last 15 stick often, a fifth have hardly a stiffness in one way."""
    n, s, sticky = 1 + number % 4, 1 + number // 4 % 3, number >= 35

    def positive(size: int, least: float) -> Any:
        root = rng.normal(size=(size, size))
        return root @ root.T / size + least * np.eye(size)

    stiffness = positive(n, 0.3)
    if number % 5 == 4:
        mode = np.ones(n) / np.sqrt(n)
        stiffness = (away := np.eye(n) - np.outer(mode, mode)) @ stiffness @ away
    parts = {
        "mass": positive(n, 0.5),
        "damping": (0.3 if sticky else 0.05) * positive(n, 0.2),
        "stiffness": stiffness,
        "omega": rng.uniform(0.2, 0.5) if sticky else rng.uniform(0.5, 2.0),
        "constant": 0.3 * rng.normal(size=n),
        "sines": {"1": rng.normal(size=n), "3": 0.3 * rng.normal(size=n)},
        "cosines": {"1": rng.normal(size=n), "3": 0.3 * rng.normal(size=n)},
        "directions": rng.normal(size=(s, n)),
        "gaps": rng.uniform(0.1, 0.6, s),
        "restitution": rng.uniform(0.0, 0.25, s) if sticky else rng.uniform(0.3, 0.9, s),
        "displacement": np.zeros(n),
        "velocity": rng.normal(size=n),
    }
    rounded: dict[str, Any] = json.loads(json.dumps(parts, default=lambda part: np.round(part, 3).tolist()))
    return rounded | {"omega": round(parts["omega"], 3)}


def impacts(system: dict[str, Any], end: float) -> list[tuple[float, int, float]]:
    """Return time, stop and closing speed of the impacts up to a time."""
    import siconos.kernel as sk

    n, w = len(system["mass"]), system["omega"]
    orders = sorted({*system["sines"], *system["cosines"]})
    size = n + 2 * len(orders)
    mass, damping, stiffness = np.eye(size), np.zeros((size, size)), np.zeros((size, size))
    mass[:n, :n], damping[:n, :n], stiffness[:n, :n] = system["mass"], system["damping"], system["stiffness"]
    displacement, velocity = np.zeros(size), np.zeros(size)
    displacement[:n], velocity[:n] = system["displacement"], system["velocity"]
    for k, h in enumerate(orders):
        sine, cosine, rate = n + 2 * k, n + 2 * k + 1, int(h) * w
        stiffness[sine, sine] = stiffness[cosine, cosine] = rate**2
        stiffness[:n, sine], stiffness[:n, cosine] = -np.array(system["sines"][h]), -np.array(system["cosines"][h])
        velocity[sine], displacement[cosine] = rate, 1.0
    bodies = sk.LagrangianLinearTIDS(displacement, velocity, mass, stiffness, damping)
    bodies.setFExtPtr(np.concatenate([system["constant"], np.zeros(size - n)]))
    world = sk.NonSmoothDynamicalSystem(0.0, end)
    world.insertDynamicalSystem(bodies)
    rows = []
    for direction, gap, restitution in zip(system["directions"], system["gaps"], system["restitution"]):  # noqa: B905
        row = -np.concatenate([direction, np.zeros(size - n)])[None]
        rows.append(row[0])
        law, relation = sk.NewtonImpactNSL(restitution), sk.LagrangianLinearTIR(row, np.array([gap]))
        world.link(sk.Interaction(law, relation), bodies)
    steps, integrator = sk.TimeDiscretisation(0.0, 0.5), sk.LsodarOSI()
    simulation = sk.EventDriven(world, steps)
    simulation.insertIntegrator(integrator)

    class Accelerations(sk.LCP):  # type: ignore[misc]
        def compute(self, time: float) -> int:
            # Siconos takes the accelerations of its last evaluation, which may be one of another time.
            integrator.computeRhs(time)
            solved: int = super().compute(time)
            return solved

    accelerations = Accelerations()  # named, because Python must not forget it
    simulation.insertNonSmoothProblem(sk.LCP(), sk.SICONOS_OSNSP_ED_IMPACT)
    simulation.insertNonSmoothProblem(accelerations, sk.SICONOS_OSNSP_ED_SMOOTH_ACC)
    simulation.setToleranceED(TOLERANCES["events"])
    simulation.initialize()
    integrator.setTol(1, TOLERANCES["rtol"], TOLERANCES["atol"])
    manager, found = simulation.eventsManager(), []
    while simulation.hasNextEvent():
        simulation.advanceToEvent()
        event = manager.nextEvent()
        before = bodies.velocity().copy()
        simulation.processEvents()
        if event.getType() == 2:  # not one of the steps
            change = bodies.velocity() - before
            gaps = np.array(system["gaps"]) + np.array(rows) @ bodies.q()
            rates = np.where(np.abs(gaps) < 1e-8, np.array(rows) @ before, 0.0)
            if np.abs(change).max() > 0.0 and rates.min() < -1e-9:
                found.append((float(event.getDoubleTimeOfEvent()), int(rates.argmin()), float(-rates.min())))
    return found


def into_a_corner(found: list[tuple[float, int, float]]) -> bool:
    """Return whether a mass knocks between two stops faster and faster, where Siconos takes them as one contact."""
    return any(a[1] != b[1] and b[0] - a[0] < 1e-6 for a, b in pairwise(found))


def main() -> None:
    """Draw systems until enough of them have been followed, and write what they did."""
    rng, table = np.random.default_rng(16), []
    tried = 0
    while len(table) < SYSTEMS:
        tried += 1
        system = drawn(rng, len(table))
        try:
            found = impacts(system, 80.0)
        except Exception as error:
            print(f"left out: {error}")
            continue
        least = WEAK * max((velocity for *_, velocity in found), default=0.0)
        kept = [impact for impact in found if impact[2] > least][:IMPACTS]
        if len(kept) >= 8 and not into_a_corner(kept):
            table.append(system | {"least": least, "impacts": kept})
    about = (
        f"Impacts (time, stop, closing speed) by Siconos 4.4.0, tolerances {TOLERANCES}; 50 of {tried} random systems."
    )
    TABLE.write_text(json.dumps({"about": about, "systems": table}, separators=(",", ":")) + "\n")
    print(f"{TABLE}: {TABLE.stat().st_size} bytes, {sum(len(system['impacts']) for system in table)} impacts")


if __name__ == "__main__":
    main()
