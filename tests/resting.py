"""Masses and systems that come to rest at a stop, and what the witness sees of their orbits."""

import numpy as np

import vibroimpact as vi
from systems import linear, sticking
from witness import follow

OSCILLATORS = {  # with the periods of their cycles
    "slow": (vi.ImpactOscillator(omega=0.1), 1),
    "damped": (vi.ImpactOscillator(omega=0.05, damping=0.3), 1),
    "half a gap": (vi.ImpactOscillator(gap=0.2, omega=0.15), 1),
    "pressed": (vi.ImpactOscillator(gap=-0.5, omega=0.3, amplitude=0.8), 1),
    "soft": (vi.ImpactOscillator(omega=0.2, restitution=0.3, mass=1.7, stiffness=2.3), 1),
    "period 2": (vi.ImpactOscillator(omega=3.005), 2),
    "period 7": (vi.ImpactOscillator(omega=2.8625), 7),
}
ONES = {
    "at the middle": vi.ImpactOscillator(omega=0.1),
    "pressed": vi.ImpactOscillator(omega=0.2, gap=-0.5),
    "hard": vi.ImpactOscillator(omega=0.15, restitution=0.9, damping=0.1),
    "soft": vi.ImpactOscillator(omega=0.3, restitution=0.3, gap=0.2),
}


def moving():
    """Return two coupled masses, one of which rests at a stop that moves; the other strikes one that gives."""
    return vi.ImpactSystem(
        mass=[[2.0, 0.3], [0.3, 1.0]],
        damping=[[0.1, 0.0], [0.0, 0.3]],
        stiffness=[[2.0, -1.0], [-1.0, 3.0]],
        force=vi.Force(omega=0.5, harmonics={1: [1.0, 0.0]}),
        stops=[
            vi.Stop(direction=[1, 0], gap=0.1, restitution=0.3, motion={1: 0.1j}),
            vi.Stop(direction=[0, 1], gap=0.2, stiffness=40.0, damping=0.5),
        ],
    )


def two_sides():
    """Return a mass that rests at either stop, with one on a spring beside it."""
    return vi.ImpactSystem(
        mass=np.eye(2),
        damping=0.05 * np.eye(2),
        stiffness=[[1.0, -0.3], [-0.3, 1.3]],
        force=vi.Force(omega=0.15, harmonics={1: [1.0, 0.0]}),
        stops=[
            vi.Stop(direction=[1, 0], gap=0.1, restitution=0.5, name="right"),
            vi.Stop(direction=[-1, 0], gap=0.1, restitution=0.5, name="left"),
        ],
    )


SYSTEMS = {"two masses": sticking(), "a moving stop": moving(), "both sides": two_sides()}


def the_orbit(model, **asked):
    """Return the only orbit of a model that rests."""
    (orbit,) = vi.find_orbit(model, n_impacts=-1, **asked)
    return orbit


def witnessed_rests(orbit):
    """Return the state a cycle after an orbit begins, and the time at rest on each stop, as the witness follows it."""
    start = orbit.start
    place, rate = (np.atleast_1d(part) for part in (start.displacement, start.velocity))
    seen = follow(linear(orbit.system), place, rate, start.time, impacts=1000, most_periods=orbit.n_periods)
    ways, names = {"stick": -1.0, "release": 1.0}, orbit.model.stop_names
    rested = dict.fromkeys(names, 0.0)
    for event in seen.events:
        rested[names[event.stop]] += ways.get(event.kind, 0.0) * event.time
    return seen.end, rested
